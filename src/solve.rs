//! Load steps solved one after another: a model, or a contact problem, in one call, or with an observer at each step.

mod steps;

use crate::contact::Space;
use crate::engine::{self, Engine, EngineError, EngineOptions};
use crate::large;
use crate::mesh::{ElementKind, Topology};
use crate::model::{Analysis, AnyBuilt, Built, Cycles, Elastic, ModelError, StepData};
use crate::problem::{AnyProblem, ContactProblem, Kkt};
use crate::quasistatic::{self, Round, State, StepError, StepSolution};
use crate::ssnm::{SettingsError, Status};
use std::ops::ControlFlow;
use std::sync::Arc;
#[cfg(feature = "case")]
pub(crate) use steps::Changed;
pub(crate) use steps::{Plan, make_steps};

/// The options of a solve.
#[derive(Clone, Debug, Default)]
pub struct SolveOptions {
    /// The device, and the way to apply K⁻¹.
    pub engine: engine::EngineOptions,
    /// Of the method.
    pub settings: quasistatic::StepSettings,
}

/// A problem could not be solved.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// A setting is invalid.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// No engine could be made: K is singular, for example, or the requested GPU does not exist.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The engine was made for a problem with another K, N or T.
    #[error(
        "the engine was made for a problem with other matrices: pass it this problem (Engine::update), or make this \
         problem from that one (ContactProblem::with_data, with_gap, with_friction_coefficient), which keeps the \
         matrices"
    )]
    OtherMatrices,
    /// A load step is inconsistent.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A step has failed; its results so far are kept.
    #[error(transparent)]
    Step(#[from] Box<StepError>),
}

/// An error that has ended a solve, with the load steps made before.
#[derive(Debug, thiserror::Error)]
#[error("{error}")]
pub struct Failed<const D: usize = 2> {
    /// The cause.
    #[source]
    pub error: Error,
    /// The steps before it.
    pub finished: Vec<StepSolution<D>>,
}

/// The events that an observer of load steps receives.
pub enum Event<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// A load step begins.
    Begins {
        /// Its number among those that are made, from 1.
        number: usize,
        /// Its cycle, from 1.
        cycle: usize,
        /// Its common load factor.
        factor: f64,
    },
    /// It gets on.
    Within(quasistatic::Event<'a>),
    /// It has ended, converged or not.
    Ends(Box<Solved<'a, D>>),
}

/// A load step that has ended.
pub struct Solved<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// Its number among those that are made, from 1.
    pub number: usize,
    /// Its load and the displacements that its supports prescribe; None for a problem from matrices.
    pub data: Option<&'a StepData<D>>,
    /// Its result.
    pub solution: StepSolution<D>,
    /// With large displacements, the bodies at their final positions, with the contact problem there.
    pub displaced: Option<Arc<Built<D>>>,
    /// Into how many parts it was divided, where displacements are large, as Newton's method did not come to its end at once.
    pub parts: usize,
}

impl<const D: usize> Analysis<'_, D>
where
    ElementKind: Space<D>,
{
    /// Makes the load steps one after another, from rest, until one does not converge or `observer` stops: the current step
    /// then ends as [`Status::Interrupted`]. The time limit is for all steps together.
    ///
    /// # Errors
    /// If a setting is invalid, the engine was made for other matrices or fails, or a load step is inconsistent. A solve
    /// that does not converge is not an error but a status of the solution.
    pub fn solve_on(
        &self,
        engine: &mut Engine,
        settings: &quasistatic::StepSettings,
        observer: impl FnMut(Event<D>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        self.solve_after(State::at_rest(self.problem), engine, settings, observer)
    }

    /// The same from where an earlier solve has ended ([`StepSolution::state`]): friction acts on the slip since then. Wear begins anew.
    ///
    /// # Errors
    /// As [`Analysis::solve_on`], and if the state is that of a problem of another size.
    pub fn solve_after(
        &self,
        before: State,
        engine: &mut Engine,
        settings: &quasistatic::StepSettings,
        mut observer: impl FnMut(Event<D>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        self.make(before, engine, settings, &mut observer)
    }

    /// The same, compiled once for all observers.
    fn make(
        &self,
        before: State,
        engine: &mut Engine,
        settings: &quasistatic::StepSettings,
        observer: &mut dyn FnMut(Event<D>) -> ControlFlow<()>,
    ) -> Result<(), Error> {
        if !engine.fits(self.problem) {
            return Err(Error::OtherMatrices);
        }
        if let Some(elastic) = self.elastic.filter(|elastic| elastic.is_large()) {
            return large::make_steps(elastic, self.problem, engine, settings, observer);
        }
        // The pairs of earlier solves on this engine, to which this one adds.
        let mut recycled = std::mem::take(&mut engine.recycled);
        let plan = Plan {
            n_steps: self.n_steps(),
            step: &|step| self.step(step),
            cycles: self.elastic.map_or(Cycles::ONCE, Elastic::cycles),
            wearing: self.elastic.and_then(Elastic::wearing),
        };
        let made = make_steps(
            self.problem,
            before,
            &plan,
            engine,
            settings,
            &mut recycled,
            observer,
        );
        engine.recycled = recycled;
        made
    }

    /// The same with an engine of its own and no observer.
    fn solve(&self, options: &SolveOptions) -> Result<Vec<StepSolution<D>>, Failed<D>> {
        let mut finished = Vec::with_capacity(self.n_steps());
        let made = (options.settings.ssnm.check().map_err(Error::from))
            .and_then(|()| Ok(Engine::new(self.problem, options.engine.clone(), |_| {})?))
            .and_then(|mut engine| {
                self.solve_on(&mut engine, &options.settings, |event| {
                    if let Event::Ends(solved) = event {
                        finished.push(solved.solution);
                    }
                    ControlFlow::Continue(())
                })
            });
        match made {
            Ok(()) => Ok(finished),
            Err(error) => Err(Failed { error, finished }),
        }
    }
}

/// The two long functions of a solve, compiled with this crate for the plane and for space. A generic function is compiled again in
/// each crate that calls it: these take minutes.
pub trait Compiled<const D: usize>: Space<D>
where
    ElementKind: Space<D>,
{
    /// [`Engine::new`].
    ///
    /// # Errors
    /// Those.
    fn engine(
        problem: &ContactProblem<D>,
        options: EngineOptions,
        log: Box<dyn FnMut(&str) + Send>,
    ) -> Result<Engine, EngineError>;

    /// [`Analysis::solve_after`].
    ///
    /// # Errors
    /// Those.
    fn solve_after(
        analysis: &Analysis<D>,
        before: State,
        engine: &mut Engine,
        settings: &quasistatic::StepSettings,
        observer: &mut dyn FnMut(Event<D>) -> ControlFlow<()>,
    ) -> Result<(), Error>;
}

macro_rules! compile {
    ($($d:literal)*) => {$(
        impl Compiled<$d> for ElementKind {
            fn engine(
                problem: &ContactProblem<$d>,
                options: EngineOptions,
                log: Box<dyn FnMut(&str) + Send>,
            ) -> Result<Engine, EngineError> {
                Engine::new(problem, options, log)
            }

            fn solve_after(
                analysis: &Analysis<$d>,
                before: State,
                engine: &mut Engine,
                settings: &quasistatic::StepSettings,
                observer: &mut dyn FnMut(Event<$d>) -> ControlFlow<()>,
            ) -> Result<(), Error> {
                analysis.make(before, engine, settings, observer)
            }
        }
    )*};
}

compile!(2 3);

impl<const D: usize> Built<D>
where
    ElementKind: Space<D>,
{
    /// Solves all load steps from rest; ends after the first one that does not converge. To observe, to stop, or to
    /// keep the engine, call [`Analysis::solve_on`].
    ///
    /// # Errors
    /// As [`ContactProblem::solve`]; the steps before the one at fault are kept.
    pub fn solve(&self, options: &SolveOptions) -> Result<Vec<StepSolution<D>>, Failed<D>> {
        Analysis::from(self).solve(options)
    }
}

impl<const D: usize> ContactProblem<D>
where
    ElementKind: Space<D>,
{
    /// Solves the given problem from rest, including Coulomb friction and bodies that only contact holds.
    ///
    /// # Errors
    /// If no engine can be made, a setting is invalid, or the engine fails. A solve that does not converge is not an
    /// error but a status of the solution.
    ///
    /// # Example
    /// Two springs in a row, the outer one pushed into a wall that is 1 away and rubs with at most 0.1:
    ///
    /// ```
    /// use signorini::problem::{ContactData, ContactProblem};
    /// use signorini::solve::SolveOptions;
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
    /// let solution = problem.solve(&SolveOptions::default())?;
    /// assert_eq!(solution.status, Status::Converged);
    /// // The wall holds the second spring at 1, friction holds back the first: 2 u₁ − 1 = −0.1.
    /// assert!((solution.u[0] - 0.45).abs() < 1e-6 && (solution.u[1] - 1.0).abs() < 1e-6);
    ///
    /// let mut options = SolveOptions::default();
    /// options.settings.ssnm.tolerance = 2.0;
    /// let error = problem.solve(&options).unwrap_err();
    /// assert_eq!(error.to_string(), "tolerance must lie between 0 and 1");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn solve(&self, options: &SolveOptions) -> Result<StepSolution<D>, Error> {
        let made = Analysis::from(self).solve(options);
        let mut made = made.map_err(|failed| failed.error)?;
        Ok(made.pop().expect("there is one step"))
    }

    /// The same on an engine that was made for this problem, or for one with the same K, N and T.
    ///
    /// # Errors
    /// As [`Analysis::solve_on`].
    pub fn solve_on(
        &self,
        engine: &mut Engine,
        settings: &quasistatic::StepSettings,
    ) -> Result<StepSolution<D>, Error> {
        let mut made = None;
        Analysis::from(self).solve_on(engine, settings, |event| {
            if let Event::Ends(solved) = event {
                made = Some(solved.solution);
            }
            ControlFlow::Continue(())
        })?;
        Ok(made.expect("there is one step"))
    }
}

/// The end of a load step in either dimension, for those who learn it at run time.
#[derive(Clone, Debug)]
pub enum AnySolution {
    /// In the plane.
    Plane(StepSolution),
    /// In space.
    Space(StepSolution<3>),
}

/// The same expression for both.
macro_rules! of_either {
    ($any:expr, $solution:ident => $value:expr) => {
        match $any {
            AnySolution::Plane($solution) => $value,
            AnySolution::Space($solution) => $value,
        }
    };
}

impl AnySolution {
    /// Its end.
    pub fn status(&self) -> Status {
        of_either!(self, solution => solution.status)
    }

    /// The whole u, an entry per row of K.
    pub fn u(&self) -> &[f64] {
        of_either!(self, solution => &solution.u)
    }

    /// λ = (λν, λτ): m numbers, then m in the plane and 2m in space.
    pub fn lambda(&self) -> &[f64] {
        of_either!(self, solution => &solution.lambda)
    }

    /// The slip bounds that the multipliers obey, length m.
    pub fn slip_bound(&self) -> &[f64] {
        of_either!(self, solution => &solution.slip_bound)
    }

    /// Slip in this step, an entry per row of T.
    pub fn slip(&self) -> &[f64] {
        of_either!(self, solution => &solution.slip)
    }

    /// The optimality conditions at the end.
    pub fn kkt(&self) -> Kkt {
        of_either!(self, solution => solution.kkt)
    }

    /// The solves of the step.
    pub fn rounds(&self) -> &[Round] {
        of_either!(self, solution => &solution.rounds)
    }
}

impl AnyProblem {
    /// [`ContactProblem::solve`].
    ///
    /// # Errors
    /// As there.
    pub fn solve(&self, options: &SolveOptions) -> Result<AnySolution, Error> {
        Ok(match self {
            Self::Plane(problem) => AnySolution::Plane(problem.solve(options)?),
            Self::Space(problem) => AnySolution::Space(problem.solve(options)?),
        })
    }
}

impl AnyBuilt {
    /// [`Built::solve`].
    ///
    /// # Errors
    /// As there, without the steps made before.
    pub fn solve(&self, options: &SolveOptions) -> Result<Vec<AnySolution>, Error> {
        Ok(match self {
            Self::Plane(built) => {
                let made = built.solve(options).map_err(|failed| failed.error)?;
                made.into_iter().map(AnySolution::Plane).collect()
            }
            Self::Space(built) => {
                let made = built.solve(options).map_err(|failed| failed.error)?;
                made.into_iter().map(AnySolution::Space).collect()
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Obstacle;
    use crate::elasticity::Material;
    use crate::mesh::structured::{CellShape, rectangle};
    use crate::model::{Model, Pair, Support, Traction};
    use crate::quasistatic::StepSettings;

    /// A block on a plane, without any other support against moving up.
    fn block(steps: &[f64]) -> Built {
        let mesh = rectangle([0.0; 2], [2.0, 1.0], [6, 3], CellShape::Quad, "body", "");
        let ground = Obstacle::HalfSpace {
            point: [0.0; 2],
            normal: [0.0, 1.0],
        };
        let material = Material::new(1e6, 0.3);
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
            let made = built.solve(&SolveOptions::default());
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
    fn faults_are_reported_first() {
        let mut options = SolveOptions::default();
        options.settings.ssnm.beta = -1.0;
        let failed = block(&[1.0]).solve(&options).err();
        let error = failed.map(|failed| failed.error);
        assert!(matches!(error, Some(Error::Settings(_))), "{error:?}");
    }

    /// An engine moves to another thread, and solves only problems with the same K, N and T.
    #[test]
    fn an_engine_is_kept_and_used_again() {
        let built = block(&[1.0]);
        let problem = &built.problem;
        let mut engine = Engine::new(problem, Default::default(), |_| {})
            .unwrap_or_else(|error| panic!("{error}"));
        let settings = StepSettings::default();
        let force = |engine: &mut Engine, problem: &ContactProblem| {
            let solution = problem.solve_on(engine, &settings)?;
            assert_eq!(solution.status, Status::Converged);
            Ok::<f64, Error>(solution.lambda[..problem.m()].iter().sum())
        };
        let twice = problem.load().iter().map(|f| 2.0 * f).collect();
        let twice = problem.clone().with_load(twice);
        let twice = twice.unwrap_or_else(|error| panic!("{error}"));
        let [once, twice] = std::thread::scope(|scope| {
            let work = scope.spawn(|| [problem, &twice].map(|problem| force(&mut engine, problem)));
            work.join().expect("no panic")
        });
        for (found, expected) in [(once, 200.0), (twice, 400.0)] {
            let found = found.unwrap_or_else(|error| panic!("{error}"));
            assert!((found / expected - 1.0).abs() < 1e-6, "{found}");
        }
        let other = block(&[1.0]);
        let error = force(&mut engine, &other.problem).err();
        assert!(matches!(error, Some(Error::OtherMatrices)), "{error:?}");
    }

    /// An observer ends the steps before one, within one, and after one.
    #[test]
    fn an_observer_stops_the_steps() {
        let built = block(&[0.5, 1.0, 2.0]);
        let analysis = Analysis::from(&built);
        let mut engine = Engine::new(&built.problem, Default::default(), |_| {})
            .unwrap_or_else(|error| panic!("{error}"));
        let mut heard = |stops: &dyn Fn(&Event) -> bool| {
            let mut ended = Vec::new();
            let observer = |event: Event| {
                let stops = stops(&event);
                if let Event::Ends(solved) = event {
                    ended.push((solved.number, solved.solution.status));
                }
                match stops {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            analysis
                .solve_on(&mut engine, &StepSettings::default(), observer)
                .unwrap_or_else(|error| panic!("{error}"));
            ended
        };
        let before = heard(&|event| matches!(event, Event::Begins { number: 2, .. }));
        assert_eq!(before, [(1, Status::Converged)]);
        let after = heard(&|event| matches!(event, Event::Ends(solved) if solved.number == 2));
        assert_eq!(after, [(1, Status::Converged), (2, Status::Converged)]);
        let within = heard(&|event| matches!(event, Event::Within(_)));
        assert_eq!(within, [(1, Status::Interrupted)]);
    }
}
