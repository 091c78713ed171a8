//! Load steps and Coulomb friction: sequences of contact problems (1)–(3).
//!
//! **Load steps.** In a quasi-static process friction acts on the slip since the last step. A step is a problem (1)–(3) in the
//! whole displacement u under the whole load, with T(u − ū) instead of T u, where ū is the displacement before (for compliant
//! contact minus the contact's own compression). Only the origin of slip carries the history, so an earlier, larger load leaves
//! nothing in the load or the gap of a smaller one.
//!
//! **Coulomb friction** is part of the Newton steps (`ssnm`). They minimise no function, so they may fail. Then bodies that only
//! contact holds are put on weak springs (`springs`), which show whether anything holds them. Rounds with frozen slip bounds
//! (`rounds`) continue from the best point, and the monolithic step is tried once more where they converge. A step always ends at
//! the best of all points met, and everything reported about it is for g = μλν.

mod rounds;
mod springs;

use crate::dual::balance::BALANCED;
use crate::dual::{DualOperator, conditions};
use crate::problem::{ContactProblem, Elsewhere, Kkt, LoadCase, System};
use crate::sparse::{norm, norm_max};
use crate::ssnm::{
    self, Cause, Info, RecycledSubspace, Sets, SettingsError, Solution, SolveError, Status, Step,
    WarmStart,
};
use rounds::Rounds;
use springs::{OnSprings, Springs, WEAK};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Instant;

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
    /// [`Load::slide`] there.
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
#[derive(Clone, Debug)]
pub struct StepSettings {
    /// The settings of the method.
    pub ssnm: ssnm::NewtonSettings,
    /// Under Coulomb's law: whether the bounds are part of the Newton steps. Otherwise only rounds are made.
    pub monolithic: bool,
    /// max |μλν − g| / max μλν that rounds have to reach; ten times the tolerance of the problems if None.
    pub friction_tolerance: Option<f64>,
    /// Rounds at most.
    pub max_rounds: usize,
}

impl StepSettings {
    /// max |μλν − g| / max μλν that rounds have to reach.
    pub fn friction_tolerance(&self) -> f64 {
        self.friction_tolerance
            .unwrap_or(ssnm::MET * self.ssnm.tolerance)
    }

    /// Checks that the numbers are valid for any problem: see [`ssnm::NewtonSettings::check`].
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn check(&self) -> Result<(), SettingsError> {
        self.ssnm.check()?;
        self.friction_tolerance.map_or(Ok(()), |tolerance| {
            SettingsError::unless_part(tolerance, "friction_tolerance")
        })
    }
}

impl Default for StepSettings {
    fn default() -> Self {
        Self {
            ssnm: ssnm::NewtonSettings::default(),
            monolithic: true,
            friction_tolerance: None,
            max_rounds: 100,
        }
    }
}

/// One solve of a step: the only one, or a round or an attempt if that was not enough.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Round {
    /// From 1.
    pub round: usize,
    /// Whether slip bounds were frozen under Coulomb's law, separately for each solve.
    pub frozen: bool,
    /// Whether bodies that only contact holds were on weak springs, under Coulomb's law.
    pub on_springs: bool,
    /// max |μλν − g| / max μλν; 0 where no bounds were frozen.
    pub friction_change: f64,
    /// The tolerance of the solve.
    pub tolerance: f64,
    /// Its course.
    pub info: Info,
}

/// The events that an observer receives.
pub enum Event<'a> {
    /// An outer step of the Newton method.
    Newton(&'a Step),
    /// A solve has ended that had frozen slip bounds, or whose monolithic steps made no progress.
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
    /// springs, however weak, it moves away, or converged slip bounds do not hold it.
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
    /// The sets at the end.
    pub sets: Sets<D>,
    /// One solve, or several where Coulomb's law took rounds.
    pub rounds: Vec<Round>,
    /// The optimality conditions at the end.
    pub kkt: Kkt,
    /// The bodies that are not held, if that is the status.
    pub not_held: Vec<NotHeld>,
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
        State {
            u: self.u.clone(),
            lambda: self.lambda.clone(),
            slide: load.slide.clone(),
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

/// A body counts as pushed if this part of the largest imbalance acts on it.
const PUSHED: f64 = 1e-3;

/// Solves one load step from `start`; the operator belongs to `problem`. `recycled` has the pairs of earlier steps with
/// the same K, N and T; it is empty before the first.
///
/// # Errors
/// If a setting is invalid, a size differs from the problem's, or the operator fails; the error keeps the rounds made,
/// with λ and the steps of the last one.
pub fn solve_step<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    load: &Load,
    start: &State,
    dual: &mut (impl DualOperator + ?Sized),
    settings: &StepSettings,
    recycled: &mut RecycledSubspace,
    mut observer: impl FnMut(Event) -> ControlFlow<()>,
) -> Result<StepSolution<D>, StepError> {
    settings.check()?;
    load.check_for(problem)?;
    start.check_for(problem)?;
    let whole = problem.elsewhere();
    let mut step = Process::new(whole, load, start, dual, settings, recycled, &mut observer);
    match step.make(start) {
        Ok((solution, frozen)) => Ok(step.end(solution, frozen)),
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
        acting: load.acting,
        travelled: Some(Arc::new(whole.body_sizes(&start.u))),
        before: start.lambda.clone(),
        friction: Arc::clone(&whole.load_case().friction),
        ..LoadCase::new(
            load.force.clone(),
            load.gap.clone(),
            start.slip_origin(&whole, load),
            whole.slip_bound().to_vec(),
        )
    };
    whole.under(case)
}

/// Whether rounds may still help.
fn has_given_up(status: Status) -> bool {
    matches!(status, Status::Stagnated | Status::IterationLimit)
}

/// A step on its way.
struct Process<'a, const D: usize, O: ?Sized, V> {
    /// Under the whole load; the origin of slip is T ū, minus the sliding by prescribed displacements meanwhile.
    lawful: ContactProblem<D, Elsewhere>,
    dual: &'a mut O,
    settings: &'a StepSettings,
    recycled: &'a mut RecycledSubspace,
    observer: V,
    begin: Instant,
    /// Rᵀū.
    place: Vec<f64>,
    made: Vec<Round>,
    /// The point so far with the least violation of Coulomb's law.
    best: Option<Met<D>>,
    /// The observer has asked for an end.
    stopped: bool,
}

/// A point met under Coulomb's law.
struct Met<const D: usize> {
    solution: Solution<D>,
    /// The largest violation of its conditions, where known.
    off: f64,
}

impl<'a, const D: usize, O, V> Process<'a, D, O, V>
where
    O: DualOperator + ?Sized,
    V: FnMut(Event) -> ControlFlow<()>,
{
    fn new(
        whole: ContactProblem<D, Elsewhere>,
        load: &Load,
        start: &State,
        dual: &'a mut O,
        settings: &'a StepSettings,
        recycled: &'a mut RecycledSubspace,
        observer: V,
    ) -> Self {
        Self {
            place: whole.floating_bodies().resultants(&start.u),
            lawful: lawful(whole, load, start),
            dual,
            settings,
            recycled,
            observer,
            begin: Instant::now(),
            made: Vec::new(),
            best: None,
            stopped: false,
        }
    }

    /// The step, with the frozen bounds of its result: monolithic Newton steps, and rounds where those fail.
    fn make(&mut self, start: &State) -> Result<(Solution<D>, Option<Vec<f64>>), SolveError> {
        let tolerance = self.settings.ssnm.tolerance;
        let has_coulomb = self.lawful.has_coulomb();
        let monolithic = self.settings.monolithic;
        let is_free = has_coulomb && !self.lawful.floating_bodies().is_empty();
        let mut from = start.lambda.clone();
        let mut is_held = false;
        if monolithic || !has_coulomb {
            // Where springs can decide, they are cheaper than patience.
            let mut settings = self.settings.ssnm.clone();
            if is_free {
                settings.numbers.patience = settings.numbers.fruitless;
            }
            let solution = self.attempt(None, None, &from, settings)?;
            if !has_coulomb || !has_given_up(solution.status) {
                return Ok((solution, None));
            }
            from = solution.lambda;
            if is_free {
                match self.on_springs(&from)? {
                    Springs::Break => {}
                    Springs::Bear(solution) => return Ok((*solution, None)),
                    Springs::Idle(lambda) => (from, is_held) = (lambda, true),
                }
                let solution = self.solve(None, &from, tolerance)?;
                if !has_given_up(solution.status) {
                    return Ok((solution, None));
                }
                from = solution.lambda;
            }
        }
        let mut rounds = Rounds::new(self, &from);
        let mut solution = rounds.make(self)?;
        if is_held && solution.status == Status::NotHeld {
            // If the bounds do not hold the body, they are not those of a state in which springs bear hardly anything.
            solution.status = Status::Stagnated;
            solution.imbalance.clear();
            solution.mechanism.clear();
        }
        if !has_coulomb || solution.status == Status::NotHeld {
            return Ok((solution, Some(rounds.bounds)));
        }
        let status = solution.status;
        if monolithic && status == Status::Converged {
            // From the result of rounds, the monolithic step may make progress.
            let again = self.solve(None, &rounds.lambda, tolerance)?;
            if !has_given_up(again.status) {
                return Ok((again, None));
            }
        }
        self.best_met(status)
    }

    /// The best point met, judged by Coulomb's law. `status`: the reason why steps ended.
    fn best_met(&mut self, status: Status) -> Result<(Solution<D>, Option<Vec<f64>>), SolveError> {
        let tolerance = self.settings.ssnm.tolerance;
        let of_rounds = status == Status::Converged;
        // The bounds of converged rounds are as accurate as requested.
        let most = match of_rounds {
            true => (self.settings.friction_tolerance()).max(ssnm::MET * tolerance),
            false => tolerance,
        };
        let Some(Met { mut solution, off }) = self.best.take() else {
            unreachable!("rounds follow an attempt under Coulomb's law, or are one");
        };
        let kkt = conditions(&self.lawful, self.dual, &solution.u, &solution.lambda)?;
        solution.status = match (off.max(kkt.max()) <= most, of_rounds) {
            (true, _) => Status::Converged,
            (false, true) => Status::Stagnated,
            (false, false) => status,
        };
        solution.imbalance.clear();
        solution.mechanism.clear();
        // The solve that met it has its counts already.
        solution.info = Info {
            iter: 0,
            n_a: 0,
            n_a_sigma: 0,
            first_met: None,
            history: Vec::new(),
            setup_seconds: 0.0,
            solve_seconds: 0.0,
            kkt,
            ..solution.info
        };
        self.note(None, None, tolerance, &solution);
        Ok((solution, None))
    }

    /// max |μλν − g| / max μλν, for this difference of the bounds.
    fn relative(&self, lambda: &[f64], difference: &[f64]) -> f64 {
        let coefficients = self.lawful.friction_coefficient().iter().zip(lambda);
        let friction = coefficients.fold(0.0_f64, |max, (mu, l)| max.max(mu * l));
        match norm_max(difference) {
            0.0 => 0.0,
            change if friction > 0.0 => change / friction,
            _ => 1.0,
        }
    }

    /// Solves the problem of this step, with its bounds frozen if any are given.
    fn solve(
        &mut self,
        frozen: Option<&[f64]>,
        initial: &[f64],
        tolerance: f64,
    ) -> Result<Solution<D>, SolveError> {
        let settings = ssnm::NewtonSettings {
            tolerance,
            ..self.settings.ssnm.clone()
        };
        self.attempt(frozen, None, initial, settings)
    }

    /// The same, on springs if they are stiff at all.
    fn attempt(
        &mut self,
        frozen: Option<&[f64]>,
        springs: Option<f64>,
        initial: &[f64],
        settings: ssnm::NewtonSettings,
    ) -> Result<Solution<D>, SolveError> {
        let mut case = self.lawful.load_case().clone();
        if let Some(bounds) = frozen {
            case.slip_bound = bounds.to_vec();
            case.frozen = true;
        }
        let problem = self.lawful.under(case);
        let settings = ssnm::NewtonSettings {
            time_limit: settings
                .time_limit
                .map(|limit| limit.saturating_sub(self.begin.elapsed())),
            ..settings
        };
        let lambda = Some(initial).filter(|l| l.iter().all(|v| v.is_finite()));
        let (observer, stopped) = (&mut self.observer, &mut self.stopped);
        let watch = |step: &Step| {
            let flow = observer(Event::Newton(step));
            *stopped |= flow.is_break();
            flow
        };
        let solution = match springs {
            None => {
                let start = WarmStart {
                    lambda,
                    motion: Some(&self.place),
                    recycled: Some(self.recycled),
                };
                ssnm::solve_from(start, &problem, self.dual, &settings, watch)?
            }
            Some(stiffness) => {
                // A has changed, and bodies are no longer free.
                let start = WarmStart {
                    lambda,
                    ..WarmStart::default()
                };
                let mut dual = OnSprings::new(self.dual, &problem, stiffness);
                let on_springs = dual.problem(&self.place);
                ssnm::solve_from(start, &on_springs, &mut dual, &settings, watch)?
            }
        };
        let friction_change = self.note(frozen, springs, settings.tolerance, &solution);
        if self.lawful.has_coulomb() && springs.is_none() {
            let info = &solution.info;
            let off = info.kkt.max().max(info.err_relative).max(friction_change);
            if self.best.as_ref().is_none_or(|best| off < best.off) {
                let solution = solution.clone();
                self.best = Some(Met { solution, off });
            }
        }
        let goes_on = problem.has_coulomb() && has_given_up(solution.status);
        if frozen.is_some() || springs.is_some() || goes_on {
            let made = self.made.last().expect("just pushed");
            self.stopped |= (self.observer)(Event::Round(made)).is_break();
        }
        Ok(solution)
    }

    /// Takes down a solve; returns how far frozen bounds are from the law.
    fn note(
        &mut self,
        frozen: Option<&[f64]>,
        springs: Option<f64>,
        tolerance: f64,
        solution: &Solution<D>,
    ) -> f64 {
        let friction_change = frozen.map_or(0.0, |bounds| {
            let law = self.lawful.bounds(&solution.lambda);
            self.relative(&solution.lambda, &changes(&law, bounds))
        });
        self.made.push(Round {
            round: self.made.len() + 1,
            frozen: frozen.is_some(),
            on_springs: springs.is_some(),
            friction_change,
            tolerance,
            info: solution.info.clone(),
        });
        friction_change
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
        let settings = self.settings.ssnm.clone();
        let solution = self.attempt(None, Some(stiffness), lambda, settings)?;
        if solution.status != Status::Converged {
            return Ok(Springs::Break);
        }
        let mut forces = self.lawful.load().to_vec();
        let b = self.lawful.contact_matrix();
        b.mul_transpose_add(-1.0, &solution.lambda, &mut forces);
        let floating = self.lawful.floating_bodies();
        let borne = floating.resultants(&forces);
        if norm(&borne).powi(2) <= stiffness * work {
            return Ok(Springs::Idle(solution.lambda));
        }
        // Back to where the bodies were.
        let mut u = solution.u;
        let back: Vec<f64> = borne.iter().map(|force| -force / stiffness).collect();
        floating.add_motion(&back, &mut u);
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

    /// The end of the step with a solution, and the bounds that were frozen for it.
    fn end(self, solution: Solution<D>, frozen: Option<Vec<f64>>) -> StepSolution<D> {
        let origin = self.lawful.slip_origin();
        let (rows, m) = (self.lawful.tangential(), self.lawful.m());
        let mut slip = (self.lawful).beyond_compliance(rows, m, &solution.u, &solution.lambda);
        (slip.iter_mut().zip(origin)).for_each(|(s, o)| *s -= o);
        let proven = (self.made.last()).is_some_and(|last| !last.on_springs && !last.frozen);
        let not_held = pushed(&self.lawful, &solution, proven);
        StepSolution {
            status: solution.status,
            slip_bound: frozen.unwrap_or_else(|| self.lawful.bounds(&solution.lambda).into_owned()),
            slip,
            sets: solution.sets,
            kkt: solution.info.kkt,
            not_held,
            u: solution.u,
            lambda: solution.lambda,
            rounds: self.made,
        }
    }
}

/// The change of bounds; those of ties stay infinite.
fn changes(now: &[f64], before: &[f64]) -> Vec<f64> {
    let each = now.iter().zip(before);
    each.map(|(now, before)| if now == before { 0.0 } else { now - before })
        .collect()
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
