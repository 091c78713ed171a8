//! A contact problem, or a model with all its load steps, solved in one call.

use crate::contact::Space;
use crate::engine::{self, Engine, EngineError};
use crate::mesh::Kind;
use crate::model::{Built, ModelError};
use crate::problem::ContactProblem;
use crate::quasistatic::{self, Load, State, StepError, StepSolution};
use crate::ssnm::{SettingsError, Status};
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::time::Instant;

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
pub enum Error<const D: usize = 2> {
    /// A setting makes no sense.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// No engine could be made: K is singular, say, or there is no such GPU.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A load step cannot be meant.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A step has failed; what it had reached is kept.
    #[error("{error}")]
    Step {
        /// What went wrong.
        #[source]
        error: Box<StepError>,
        /// The steps before it.
        finished: Vec<StepSolution<D>>,
    },
}

/// Solves load steps, one after another from rest, until one does not converge.
fn steps<const D: usize>(
    problem: &ContactProblem<D>,
    loads: impl ExactSizeIterator<Item = Result<Load, ModelError>>,
    options: &Options,
) -> Result<Vec<StepSolution<D>>, Error<D>> {
    options.settings.check()?;
    let mut engine = Engine::new(problem, options.engine.clone(), |_| {})?;
    let (begin, memory) = (Instant::now(), RefCell::default());
    let mut settings = options.settings;
    settings.ssnm.memory = settings.ssnm.memory.or(Some(&memory));
    let mut state = State::at_rest(problem);
    let mut finished: Vec<StepSolution<D>> = Vec::with_capacity(loads.len());
    for load in loads {
        let load = load?;
        let limit = options.settings.ssnm.time_limit;
        settings.ssnm.time_limit = limit.map(|limit| limit.saturating_sub(begin.elapsed()));
        let go_on = |_: quasistatic::Event| ControlFlow::Continue(());
        match quasistatic::solve_step(problem, &load, &state, &mut engine, &settings, go_on) {
            Ok(solution) => {
                state = solution.state(&load);
                finished.push(solution);
            }
            Err(error) => {
                return Err(Error::Step {
                    error: Box::new(error),
                    finished,
                });
            }
        }
        if finished
            .last()
            .is_some_and(|made| made.status != Status::Converged)
        {
            break;
        }
    }
    Ok(finished)
}

impl<const D: usize> Built<D>
where
    Kind: Space<D>,
{
    /// Solves all load steps from rest; ends after the first one that does not converge.
    ///
    /// # Errors
    /// As [`ContactProblem::solve`]; the steps before the one at fault are kept.
    pub fn solve(&self, options: &Options) -> Result<Vec<StepSolution<D>>, Error<D>> {
        let loads = (0..self.n_steps()).map(|number| self.step(number).map(|step| step.load));
        steps(&self.problem, loads, options)
    }
}

impl<const D: usize> ContactProblem<D> {
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
    /// let problem: ContactProblem = ContactProblem::new(ContactData {
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
    pub fn solve(&self, options: &Options) -> Result<StepSolution<D>, Error<D>> {
        let mut made = steps(self, std::iter::once(Ok(Load::of(self))), options)?;
        Ok(made.pop().expect("there is one step"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Obstacle;
    use crate::elasticity::Material;
    use crate::mesh::structured::{CellShape, rectangle};
    use crate::model::{Model, Pair, Support, Traction};

    /// A block on a plane, without any other support against moving up.
    fn block(steps: &[f64]) -> Built {
        let mesh = rectangle([0.0; 2], [2.0, 1.0], [6, 3], CellShape::Quad, "body", "");
        let ground = Obstacle::HalfPlane {
            point: [0.0; 2],
            normal: [0.0, 1.0],
        };
        let material = Material {
            young: 1e6,
            poisson: 0.3,
            density: 0.0,
        };
        Model::on(mesh)
            .material(material)
            .support(Support::on("left").x(0.0))
            .traction(Traction::on("top").pressure(100.0))
            .contact(Pair::obstacle("bottom", ground).coulomb(0.3))
            .steps(steps)
            .build()
            .unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn load_steps_are_made_until_one_does_not_converge() {
        let solved = |steps: &[f64]| -> Vec<(Status, f64)> {
            let built = block(steps);
            let made = built.solve(&Options::default());
            let made = made.unwrap_or_else(|error| panic!("{error}"));
            let m = built.problem.m();
            (made.iter())
                .map(|step| (step.status, step.lambda[..m].iter().sum()))
                .collect()
        };
        let made = solved(&[1.0, 0.5, 2.0]);
        assert_eq!(made.len(), 3);
        for ((status, force), factor) in made.into_iter().zip([1.0, 0.5, 2.0]) {
            assert_eq!(status, Status::Converged);
            assert!((force / (200.0 * factor) - 1.0).abs() < 1e-6, "{force}");
        }
        // Lifted off in the second one.
        let made = solved(&[1.0, -1.0, 1.0]);
        let status: Vec<Status> = made.iter().map(|made| made.0).collect();
        assert_eq!(status, [Status::Converged, Status::NotHeld]);
    }

    #[test]
    fn what_is_wrong_is_told_first() {
        let mut options = Options::default();
        options.settings.ssnm.beta = -1.0;
        let error = block(&[1.0]).solve(&options).err();
        assert!(matches!(error, Some(Error::Settings(_))), "{error:?}");
    }
}
