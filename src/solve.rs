//! A contact problem solved in one call.

use crate::engine::{self, Engine, EngineError};
use crate::problem::ContactProblem;
use crate::quasistatic::{self, Load, State, StepError, StepSolution};
use std::ops::ControlFlow;

/// How to solve a problem.
#[derive(Clone, Debug, Default)]
pub struct Options<'a> {
    /// On what, and how to apply K⁻¹.
    pub engine: engine::Options,
    /// Of the method.
    pub settings: quasistatic::Settings<'a>,
}

/// A problem could not be solved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// No engine could be made: K is singular, say, or there is no such GPU.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The solve has failed; what it had reached is kept.
    #[error(transparent)]
    Step(#[from] Box<StepError>),
}

impl ContactProblem {
    /// Solves the problem as it is given, from rest: Coulomb friction and bodies that only contact holds included.
    ///
    /// [`crate::quasistatic::solve_step`] is for load steps, and for whoever wants to watch or to keep the engine.
    ///
    /// # Errors
    /// If no engine can be made, a setting makes no sense, or the engine fails. Not to converge is no error but the
    /// status of the solution.
    ///
    /// # Example
    /// Two springs in a row, the outer one pushed into a wall that is 1 away and rubs with at most 0.1:
    ///
    /// ```
    /// use signorini::problem::{ContactData, ContactProblem};
    /// use signorini::solve::Options;
    /// use signorini::sparse::{BlockCsr, Csr};
    /// use signorini::ssnm::Status;
    ///
    /// let problem = ContactProblem::new(ContactData {
    ///     stiffness: BlockCsr::from_triplets(2, 2, [(0, 0, 2.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)]),
    ///     load: vec![0.0, 1.0],
    ///     normal: Csr::from_triplets(1, 2, [(0, 1, 1.0)]),
    ///     tangential: Csr::from_triplets(1, 2, [(0, 0, 1.0)]),
    ///     gap: vec![1.0],
    ///     slip_bound: vec![0.1],
    ///     coordinates: None,
    /// })?;
    /// let solution = problem.solve(&Options::default())?;
    /// assert_eq!(solution.status, Status::Converged);
    /// // The wall holds the second spring at 1, friction holds back the first: 2 u₁ − 1 = −0.1.
    /// assert!((solution.u[0] - 0.45).abs() < 1e-6 && (solution.u[1] - 1.0).abs() < 1e-6);
    ///
    /// let mut options = Options::default();
    /// options.settings.ssnm.tolerance = 2.0;
    /// let error = problem.solve(&options).unwrap_err();
    /// assert_eq!(error.to_string(), "tolerance must lie between 0 and 1");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solve(&self, options: &Options) -> Result<StepSolution, Error> {
        options
            .settings
            .check()
            .map_err(|error| Box::new(error.into()))?;
        let mut engine = Engine::new(self, options.engine.clone(), |_| {})?;
        let (load, start) = (Load::of(self), State::at_rest(self));
        let go_on = |_: quasistatic::Event| ControlFlow::Continue(());
        quasistatic::solve_step(self, &load, &start, &mut engine, &options.settings, go_on)
            .map_err(|error| Box::new(error).into())
    }
}
