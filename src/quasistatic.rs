//! Load steps and Coulomb friction: sequences of contact problems (1)–(3).
//!
//! **Load steps.** In a quasi-static process friction acts on the slip since the last step. A step is a problem (1)–(3)
//! in the whole displacement u under the whole load, with T(u − ū) instead of T u. There ū is the displacement before
//! (for compliant contact minus the contact's own compression). Only the origin of slip carries the history, so an
//! earlier, larger load leaves nothing in the load or the gap of a smaller one.
//!
//! **Coulomb friction** is part of the Newton steps (`ssnm`). They minimise no function, so they may fail. Then bodies that only
//! contact holds are put on weak springs (`springs`), which show whether anything holds them, and Newton steps continue from
//! there. A load step always ends at the best of all points met.

mod springs;

use crate::constraint::node_of;
use crate::dual::balance::BALANCED;
use crate::dual::{DualOperator, conditions};
use crate::problem::{ContactProblem, Elsewhere, Kkt, LoadCase, System};
use crate::sparse::{add_times, dot, norm};
use crate::ssnm::{
    self, Cause, Info, RecycledSubspace, SetSizes, Sets, SettingsError, Solution, SolveError,
    Status, Step, WarmStart,
};
use springs::{MORE, OnSprings, STIFFER, Springs, WEAK};
use std::ops::ControlFlow;
use std::sync::Arc;
use web_time::Instant;

/// The load at the end of a step: totals, not increments.
#[derive(Clone, Debug)]
pub struct Load {
    /// f, an entry per row of K.
    pub force: Vec<f64>,
    /// ‖f‖ without the contribution of prescribed displacements: the acting forces.
    pub acting: f64,
    /// d, length m: the initial gap minus the part that prescribed displacements have closed.
    pub gap: Vec<f64>,
    /// The contribution of prescribed displacements to T u, an entry per row of T.
    pub slide: Vec<f64>,
}

impl Load {
    /// The load of the problem itself.
    pub fn of<const D: usize, K>(problem: &ContactProblem<D, K>) -> Self {
        Self {
            force: problem.load().to_vec(),
            acting: problem.ranks().norm(problem.load()),
            gap: problem.gap().to_vec(),
            slide: problem.slip_origin().iter().map(|s| -s).collect(),
        }
    }

    /// Checks that the sizes are those of this problem.
    fn check_for<const D: usize>(&self, system: &System<D>) -> Result<(), SettingsError> {
        let (n, m) = (system.n_rows(), system.m());
        SettingsError::unless_numbers(&self.force, n, "load.force")?;
        SettingsError::unless_numbers(&self.gap, m, "load.gap")?;
        SettingsError::unless_numbers(&self.slide, (D - 1) * m, "load.slide")
    }
}

/// The start of a step.
#[derive(Clone, Debug)]
pub struct State {
    /// u, an entry per row of K.
    pub u: Vec<f64>,
    /// λ, length D m.
    pub lambda: Vec<f64>,
    /// [`Load::slide`] there, and [`StepSolution::settled`].
    pub slide: Vec<f64>,
}

impl State {
    /// Nothing has happened yet.
    pub fn at_rest<const D: usize>(system: &System<D>) -> Self {
        Self {
            u: vec![0.0; system.n_rows()],
            lambda: vec![0.0; D * system.m()],
            slide: vec![0.0; system.tangential().n_rows()],
        }
    }

    /// The origin of slip in a step to this load: T ū − Cτ λ̄τ, minus the sliding by prescribed displacements meanwhile.
    pub(crate) fn slip_origin<const D: usize>(&self, system: &System<D>, load: &Load) -> Vec<f64> {
        let (rows, m) = (system.tangential(), system.m());
        let mut origin = system.beyond_compliance(rows, m, &self.u, &self.lambda);
        for (i, origin) in origin.iter_mut().enumerate() {
            *origin -= load.slide[i] - self.slide[i];
        }
        origin
    }

    /// Checks that the sizes are those of this problem.
    fn check_for<const D: usize>(&self, system: &System<D>) -> Result<(), SettingsError> {
        let (n, m) = (system.n_rows(), system.m());
        SettingsError::unless_numbers(&self.u, n, "start.u")?;
        SettingsError::unless_numbers(&self.lambda, D * m, "start.lambda")?;
        SettingsError::unless_numbers(&self.slide, (D - 1) * m, "start.slide")
    }
}

/// Settings of a step.
#[derive(Clone, Debug, Default)]
pub struct StepSettings {
    /// The settings of the method.
    pub ssnm: ssnm::NewtonSettings,
}

/// One solve of a step: the only one, or one of several if that was not enough.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Round {
    /// From 1.
    pub round: usize,
    /// Whether bodies that only contact holds were on weak springs, under Coulomb's law.
    pub on_springs: bool,
    /// The tolerance of the solve.
    pub tolerance: f64,
    /// Its course.
    pub info: Info,
}

/// The events that an observer receives.
pub enum Event<'a> {
    /// An outer step of the Newton method.
    Newton(&'a Step),
    /// Under Coulomb's law a solve has ended without progress, or one on springs.
    Round(&'a Round),
}

/// A body that contact and friction do not hold.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NotHeld {
    /// Its number among [`System::floating_bodies`].
    pub body: usize,
    /// The direction in which the loads push it, in words.
    pub motion: String,
    /// No forces within the friction law balance it. Otherwise some do, but contact and friction do not reach them: on
    /// springs, however weak, it moves away.
    pub proven: bool,
}

/// The end of a step.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct StepSolution<const D: usize = 2> {
    /// Its end.
    pub status: Status,
    /// The whole u, an entry per row of K.
    pub u: Vec<f64>,
    /// λ = (λν, λτ), length D m.
    pub lambda: Vec<f64>,
    /// The slip bounds that the multipliers obey, length m.
    pub slip_bound: Vec<f64>,
    /// Slip in this step (T u − Cτ λτ and [`Load::slide`], their change), an entry per row of T.
    pub slip: Vec<f64>,
    /// The part of T u by which it differs from slip that contradicts neither ties, nor closed contacts, nor nodes that
    /// stick, an entry per row of T: below the tolerance, and part of the origin of the slip that follows.
    pub settled: Vec<f64>,
    /// The sets at the end.
    pub sets: Sets<D>,
    /// Their sizes under the law of this step.
    pub sizes: SetSizes,
    /// One solve, or several under Coulomb's law.
    pub rounds: Vec<Round>,
    /// The optimality conditions at the end.
    pub kkt: Kkt,
    /// The bodies that are not held, if that is the status.
    pub not_held: Vec<NotHeld>,
    /// Its cycle, from 1, where load steps are repeated.
    pub cycle: usize,
    /// The depth that wear has taken off at each contact place by its end, which counts in its gaps; empty where nothing wears.
    pub worn: Vec<f64>,
}

/// A step that could not be finished, with its results so far.
#[derive(Debug, thiserror::Error)]
#[error("{}", error.cause)]
#[non_exhaustive]
pub struct StepError {
    /// The error and its solve; its λ can start another solve.
    pub error: Box<SolveError>,
    /// The solves that were finished before.
    pub rounds: Vec<Round>,
}

impl<C: Into<Cause>> From<C> for StepError {
    /// Nothing had been reached.
    fn from(cause: C) -> Self {
        Self {
            error: Box::new(cause.into().into()),
            rounds: Vec::new(),
        }
    }
}

impl<const D: usize> StepSolution<D> {
    /// The start of the next step.
    pub fn state(&self, load: &Load) -> State {
        let mut slide = load.slide.clone();
        add_times(1.0, &self.settled, &mut slide);
        State {
            u: self.u.clone(),
            lambda: self.lambda.clone(),
            slide,
        }
    }

    /// Counts earlier solves of the same step with the last one.
    pub(crate) fn count(&mut self, earlier: Vec<Info>) {
        let Some(last) = self.rounds.last_mut() else {
            return;
        };
        let info = &mut last.info;
        for one in earlier.into_iter().rev() {
            info.iter += one.iter;
            info.n_a += one.n_a;
            info.n_a_sigma += one.n_a_sigma;
            info.setup_seconds += one.setup_seconds;
            info.solve_seconds += one.solve_seconds;
            info.history.splice(0..0, one.history);
        }
    }

    /// The last solve.
    pub fn last(&self) -> &Round {
        self.rounds.last().expect("there is at least one")
    }

    /// Outer steps of all solves.
    pub fn iter(&self) -> usize {
        self.rounds.iter().map(|r| r.info.iter).sum()
    }

    /// Products with A of all solves.
    pub fn n_a(&self) -> usize {
        self.rounds.iter().map(|r| r.info.n_a).sum()
    }
}

/// The part of the contradictions of a solution, below ε, that may remain.
const SETTLED: f64 = 1e-6;
/// Steps to remove them at most.
const SETTLING: usize = 100;

/// A body counts as pushed if this part of the largest imbalance acts on it.
const PUSHED: f64 = 1e-3;

/// Solves one load step from `start`; the operator belongs to `problem`. `recycled` has the pairs of earlier steps with
/// the same K, N and T, or what is known of a similar A.
///
/// # Errors
/// If a setting is invalid, a size differs from the problem's, or the operator fails; the error keeps the rounds made,
/// with λ and the steps of the last one.
pub fn solve_step<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    load: &Load,
    start: &State,
    dual: &mut dyn DualOperator,
    settings: &StepSettings,
    recycled: &mut RecycledSubspace,
    mut observer: impl FnMut(Event) -> ControlFlow<()>,
) -> Result<StepSolution<D>, StepError> {
    let whole = problem.elsewhere();
    make_step(
        whole,
        load,
        start,
        dual,
        settings,
        None,
        recycled,
        &mut observer,
    )
}

/// The same with springs of this stiffness between the bodies that only contact holds and where they are, on each of their motions:
/// they keep the bodies from going far at once. The solution is that of bodies on springs.
pub(crate) fn solve_step_on_springs<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    load: &Load,
    start: &State,
    dual: &mut dyn DualOperator,
    settings: &StepSettings,
    stiffness: f64,
    observer: &mut dyn FnMut(Event) -> ControlFlow<()>,
) -> Result<StepSolution<D>, StepError> {
    let (whole, stiffness) = (problem.elsewhere(), Some(stiffness));
    let none = &mut RecycledSubspace::default();
    make_step(
        whole, load, start, dual, settings, stiffness, none, observer,
    )
}

/// The same, compiled once for all K and observers.
#[allow(clippy::too_many_arguments)]
fn make_step<const D: usize>(
    whole: ContactProblem<D, Elsewhere>,
    load: &Load,
    start: &State,
    dual: &mut dyn DualOperator,
    settings: &StepSettings,
    springs: Option<f64>,
    recycled: &mut RecycledSubspace,
    observer: &mut dyn FnMut(Event) -> ControlFlow<()>,
) -> Result<StepSolution<D>, StepError> {
    settings.ssnm.check()?;
    load.check_for(&whole)?;
    start.check_for(&whole)?;
    let mut step = Process::new(whole, load, start, dual, settings, recycled, observer);
    let made = match springs {
        Some(_) => step.solve(springs, &start.lambda, settings.ssnm.clone()),
        None => step.make(start),
    };
    match made {
        Ok(solution) => Ok(step.end(solution)),
        Err(error) => Err(StepError {
            error: Box::new(error),
            rounds: step.made,
        }),
    }
}

/// The problem of a step under its whole load: the origin of slip is T ū, minus the sliding by prescribed displacements
/// meanwhile.
pub(crate) fn lawful<const D: usize>(
    whole: ContactProblem<D, Elsewhere>,
    load: &Load,
    start: &State,
) -> ContactProblem<D, Elsewhere> {
    let case = LoadCase {
        travelled: Some(Arc::new(whole.body_sizes(&start.u))),
        before: start.lambda.clone(),
        friction: Arc::clone(&whole.load_case().friction),
        ..LoadCase::new(
            load.force.clone(),
            load.acting,
            load.gap.clone(),
            start.slip_origin(&whole, load),
            whole.slip_bound().to_vec(),
        )
    };
    whole.under(case)
}

/// Whether other steps may still help.
fn has_given_up(status: Status) -> bool {
    matches!(status, Status::Stagnated | Status::IterationLimit)
}

/// A step on its way.
struct Process<'a, const D: usize> {
    /// Under the whole load; the origin of slip is T ū, minus the sliding by prescribed displacements meanwhile.
    lawful: ContactProblem<D, Elsewhere>,
    dual: &'a mut dyn DualOperator,
    settings: &'a StepSettings,
    recycled: &'a mut RecycledSubspace,
    observer: &'a mut dyn FnMut(Event) -> ControlFlow<()>,
    begin: Instant,
    /// Rᵀū.
    place: Vec<f64>,
    /// The origin of slip, also along rows of T without entries: supports may drive their nodes.
    origin: Vec<f64>,
    made: Vec<Round>,
}

impl<'a, const D: usize> Process<'a, D> {
    fn new(
        whole: ContactProblem<D, Elsewhere>,
        load: &Load,
        start: &State,
        dual: &'a mut dyn DualOperator,
        settings: &'a StepSettings,
        recycled: &'a mut RecycledSubspace,
        observer: &'a mut dyn FnMut(Event) -> ControlFlow<()>,
    ) -> Self {
        Self {
            place: whole.floating_bodies().resultants(&start.u),
            origin: start.slip_origin(&whole, load),
            lawful: lawful(whole, load, start),
            dual,
            settings,
            recycled,
            observer,
            begin: Instant::now(),
            made: Vec::new(),
        }
    }

    /// Monolithic Newton steps and, where those fail, the same once more from bodies on springs.
    fn make(&mut self, start: &State) -> Result<Solution<D>, SolveError> {
        let is_free = self.lawful.has_coulomb() && !self.lawful.floating_bodies().is_empty();
        // Where springs can decide, they are cheaper than patience.
        let mut settings = self.settings.ssnm.clone();
        if is_free {
            settings.numbers.patience = settings.numbers.fruitless;
        }
        let first = self.solve(None, &start.lambda, settings)?;
        if !(is_free && has_given_up(first.status)) {
            return Ok(first);
        }
        let from = match self.on_springs(&first.lambda)? {
            Springs::Break => first.lambda.clone(),
            Springs::Bear(solution) => return Ok(*solution),
            Springs::Idle(lambda) => lambda,
        };
        let second = self.solve(None, &from, self.settings.ssnm.clone())?;
        let off = |solution: &Solution<D>| solution.info.kkt.max().max(solution.info.err_relative);
        if !(has_given_up(second.status) && off(&first) < off(&second)) {
            return Ok(second);
        }
        // The solve that met it has its counts already.
        let info = Info {
            iter: 0,
            n_a: 0,
            n_a_sigma: 0,
            first_met: None,
            history: Vec::new(),
            setup_seconds: 0.0,
            solve_seconds: 0.0,
            ..first.info
        };
        let best = Solution {
            status: second.status,
            info,
            ..first
        };
        self.note(false, &best);
        Ok(best)
    }

    /// Solves the problem of this step, on springs if a stiffness is given.
    fn solve(
        &mut self,
        springs: Option<f64>,
        initial: &[f64],
        settings: ssnm::NewtonSettings,
    ) -> Result<Solution<D>, SolveError> {
        let problem = &self.lawful;
        let settings = ssnm::NewtonSettings {
            time_limit: settings
                .time_limit
                .map(|limit| limit.saturating_sub(self.begin.elapsed())),
            ..settings
        };
        let lambda = Some(initial).filter(|l| l.iter().all(|v| v.is_finite()));
        let observer = &mut self.observer;
        let watch = &mut |step: &Step| observer(Event::Newton(step));
        let mut solution = match springs {
            None => {
                let start = WarmStart {
                    lambda,
                    motion: Some(&self.place),
                    recycled: Some(self.recycled),
                };
                ssnm::solve_elsewhere(start, problem, self.dual, &settings, watch)?
            }
            Some(stiffness) => {
                // A has changed, and bodies are no longer free.
                let start = WarmStart {
                    lambda,
                    ..WarmStart::default()
                };
                let mut dual = OnSprings::new(self.dual, problem, stiffness);
                let on_springs = dual.problem(&self.place);
                ssnm::solve_elsewhere(start, &on_springs, &mut dual, &settings, watch)?
            }
        };
        self.note(springs.is_some(), &solution);
        if springs.is_some() || self.lawful.has_coulomb() && has_given_up(solution.status) {
            let made = self.made.last().expect("just pushed");
            if (self.observer)(Event::Round(made)).is_break() {
                solution.status = Status::Interrupted;
            }
        }
        Ok(solution)
    }

    /// Takes down a solve.
    fn note(&mut self, on_springs: bool, solution: &Solution<D>) {
        self.made.push(Round {
            round: self.made.len() + 1,
            on_springs,
            tolerance: self.settings.ssnm.tolerance,
            info: solution.info.clone(),
        });
    }

    /// The step on springs of this stiffness, and the part of the load that they bear; None if it is not found.
    fn borne(
        &mut self,
        stiffness: f64,
        lambda: &[f64],
    ) -> Result<Option<(Solution<D>, Vec<f64>)>, SolveError> {
        let settings = self.settings.ssnm.clone();
        let tolerance = settings.tolerance;
        let solution = self.solve(Some(stiffness), lambda, settings)?;
        // The forces of a body that moves far are only known to the rounding of its motion; their sum is enough.
        if solution.status != Status::Converged && !(solution.info.err_relative <= tolerance) {
            return Ok(None);
        }
        let mut forces = self.lawful.load().to_vec();
        let b = self.lawful.contact_matrix();
        b.mul_transpose_add(-1.0, &solution.lambda, &mut forces);
        let borne = self.lawful.floating_bodies().resultants(&forces);
        Ok(Some((solution, borne)))
    }

    /// The step on weak springs, from the point where it stagnated.
    fn on_springs(&mut self, lambda: &[f64]) -> Result<Springs<D>, SolveError> {
        let own = self.lawful.compliance().iter().zip(lambda);
        let work: f64 = own.map(|(c, l)| c * l * l).sum();
        let (floating, force) = (self.lawful.floating_bodies(), self.lawful.load());
        let (load, acting) = (
            norm(&floating.resultants(force)),
            norm(&floating.sizes(force)),
        );
        let stiffness = load * load / (WEAK * work);
        // A body without a push does not move away.
        if !(load > BALANCED * acting && stiffness.is_normal()) {
            return Ok(Springs::Break);
        }
        let Some((solution, borne)) = self.borne(stiffness, lambda)? else {
            return Ok(Springs::Break);
        };
        if norm(&borne).powi(2) <= stiffness * work {
            return Ok(Springs::Idle(solution.lambda));
        }
        // A body that is held after some way strains stiffer springs more; without a hold they bear the same.
        let stiffer = self.borne(STIFFER * stiffness, &solution.lambda)?;
        if stiffer.is_some_and(|(_, more)| norm(&more) > MORE * norm(&borne)) {
            return Ok(Springs::Idle(solution.lambda));
        }
        // Back to where the bodies were.
        let mut u = solution.u;
        let back: Vec<f64> = borne.iter().map(|force| -force / stiffness).collect();
        self.lawful.floating_bodies().add_motion(&back, &mut u);
        let mut info = solution.info;
        info.kkt = conditions(&self.lawful, self.dual, &u, &solution.lambda)?;
        Ok(Springs::Bear(Box::new(Solution {
            status: Status::NotHeld,
            u,
            mechanism: borne.clone(),
            imbalance: borne,
            info,
            ..solution
        })))
    }

    /// The end of the step with a solution.
    fn end(self, solution: Solution<D>) -> StepSolution<D> {
        let (rows, m) = (self.lawful.tangential(), self.lawful.m());
        let mut slip = (self.lawful).beyond_compliance(rows, m, &solution.u, &solution.lambda);
        add_times(-1.0, &self.origin, &mut slip);
        let settled = match solution.status {
            Status::Converged => settle(&self.lawful, &solution),
            _ => vec![0.0; slip.len()],
        };
        let proven = (self.made.last()).is_some_and(|last| !last.on_springs);
        let not_held = pushed(&self.lawful, &solution, proven);
        StepSolution {
            status: solution.status,
            slip_bound: self.lawful.bounds(&solution.lambda).into_owned(),
            slip,
            settled,
            sizes: solution.sets.sizes_in(&self.lawful),
            sets: solution.sets,
            kkt: solution.info.kkt,
            not_held,
            cycle: 1,
            worn: Vec::new(),
            u: solution.u,
            lambda: solution.lambda,
            rounds: self.made,
        }
    }
}

/// T x, where x is the least motion that makes exact the contacts that are closed, tied or stuck at a solution.
///
/// u obeys them to ε only. Where their rows depend on each other (a tie whose two sides stick to one floor, a node that
/// sticks to a floor beside a wall), T u as the origin of slip would contradict the gaps of the next step: no force could
/// make both hold, and those of the rows grew against each other.
fn settle<const D: usize>(
    problem: &ContactProblem<D, Elsewhere>,
    solution: &Solution<D>,
) -> Vec<f64> {
    let m = problem.m();
    let u = &solution.u;
    let b = problem.filled_columns();
    let mut missing = problem.load_case().offsets();
    let moved = problem.times(problem.contact_matrix(), u);
    add_times(-1.0, &moved, &mut missing);
    let compliance = problem.contact_compliance();
    let is_exact: Vec<bool> = (0..D * m)
        .map(|row| {
            let i = node_of::<D>(m, row);
            let acts = problem.is_tied(i) || !solution.sets.is_separated(i);
            let holds = row < m || !solution.sets.slips(i) && problem.has_friction(i);
            acts && holds && compliance.get(row).is_none_or(|&c| c == 0.0)
        })
        .collect();
    let keep = |x: &mut [f64]| {
        (x.iter_mut().zip(&is_exact))
            .filter(|(_, is_exact)| !**is_exact)
            .for_each(|(x, _)| *x = 0.0);
    };
    keep(&mut missing);
    // Conjugate gradients on the least squares of B x = `missing`, from 0.
    let square = |x: &[f64]| problem.ranks().norm(x).powi(2);
    let mut x = vec![0.0; b.n_rows()];
    let mut p = b.product(&missing);
    let mut size = square(&p);
    let enough = SETTLED * SETTLED * size;
    let image = |p: &[f64]| {
        let mut image = vec![0.0; D * m];
        b.mul_transpose_add(1.0, p, &mut image);
        problem.ranks().sum(&mut image);
        image
    };
    for _ in 0..SETTLING {
        if !(size > enough) {
            break;
        }
        let mut closed = image(&p);
        keep(&mut closed);
        let along = size / dot(&closed, &closed);
        add_times(along, &p, &mut x);
        add_times(-along, &closed, &mut missing);
        let slope = b.product(&missing);
        let before = std::mem::replace(&mut size, square(&slope));
        (p.iter_mut().zip(slope)).for_each(|(p, slope)| *p = slope + size / before * *p);
    }
    image(&x).split_off(m)
}

/// The bodies that an imbalance pushes, and their directions.
fn pushed<const D: usize>(
    system: &System<D>,
    solution: &Solution<D>,
    proven: bool,
) -> Vec<NotHeld> {
    let (imbalance, floating) = (&solution.imbalance, system.floating_bodies());
    if imbalance.is_empty() {
        return Vec::new();
    }
    let all = norm(imbalance);
    let bodies = floating
        .parts(imbalance)
        .zip(floating.parts(&solution.mechanism));
    (bodies.enumerate())
        .filter(|(_, ((_, part), _))| norm(part) > PUSHED * all)
        .map(|(body, (_, (floating, motion)))| NotHeld {
            body,
            motion: floating.describe(motion),
            proven,
        })
        .collect()
}

#[cfg(test)]
mod tests;
