//! Large displacements: load steps by Newton's method on where the bodies are.
//!
//! Each *iteration* solves the contact problem (1)–(3) at the present configuration for the remaining displacement Δu
//! (`model/large.rs`), to a part of the present violation, and moves the bodies. A load step has converged when balance, contact, friction and
//! supports of the displaced bodies are met, all checked in f64. A step that does not converge is halved; the state before it
//! is kept.

mod anderson;
mod joints;

use crate::constraint::{self, row_of};
use crate::contact::Space;
use crate::dual::DualError;
use crate::engine::{Engine, EngineError};
use crate::mesh::ElementKind;
use crate::mesh::vector::{dot, length, minus};
use crate::model::{
    Built, Configuration, Deformation, Elastic, Help, Moment, StepData, turned_with,
};
use crate::problem::{ContactProblem, Kkt};
use crate::quasistatic::{self, NotHeld, Round, StepSettings, StepSolution};
use crate::solve::{Error, Event, Solved};
use crate::sparse::norm_max;
use crate::ssnm::{Cause, RecycledSubspace, Sets, Status};
use anderson::Anderson;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::Duration;
use web_time::Instant;

/// Iterations that a step may take: easy ones take 4 to 8, those that take more than 40 hardly ever end, unless the violation keeps
/// falling.
const MOST: usize = 40;
/// The violation keeps falling if so many iterations made it smaller than this part of itself. Slender bodies that slide over each other
/// by much may need that: shorter steps take them as many iterations.
const KEEPS_FALLING: (usize, f64) = (20, 0.2);
/// Iterations after which the next step may be longer again.
const EASY: usize = 8;
/// How often in a row a step may be halved.
const CUTS: i32 = 8;
/// An element may be pressed to this part of its least volume in one iteration.
const PRESSED: f64 = 0.1;
/// The tolerance of an inner problem over the present violation: 0.5 takes twice the iterations.
const INNER: f64 = 0.01;
/// Sets that have alternated take half a step where the violation has not become smaller than this part of its value
/// two iterations before. Without half steps the tool of `examples/ironing.toml` did not come to its end at four of
/// eight depths from 1.5 to 3.25 mm.
const STUCK: f64 = 0.5;
/// The stiffness of closed contact and of joints, over the mean diagonal of K, where only motions along them count.
const HELD: f64 = 1e3;
/// Springs let bodies slide by a facet under this part of the contact forces. A pin without friction that may turn in its hole, and a
/// hub on its shaft, in the plane and in space, take 4 to 5 iterations; with a hundredth of it 4 to 14, and one does not end.
const SPRINGS: f64 = 0.1;
/// Remedies for an indefinite tangent, in order: without the turning of pressures and contact forces; with obstacles
/// that press as stiff as the bodies, and a hundred times stiffer; without stresses that soften the bodies.
const HELP: [Help; 5] = {
    const fn help(turning: bool, held: f64) -> Help {
        Help {
            turning,
            held,
            stiffened: false,
        }
    }
    [
        help(true, 0.0),
        help(false, 0.0),
        help(false, 1.0),
        help(false, 100.0),
        Help::MOST,
    ]
};

/// Why a step has not converged.
enum Ended {
    /// It took too many iterations, elements collapsed, or no remedy made its tangent definite; or contact did not hold these
    /// bodies.
    Lost(Vec<NotHeld>),
    Stopped(Status),
}

/// The displacements of all nodes, and the forces of all contact places.
type Moved<const D: usize> = (Vec<[f64; D]>, Vec<[f64; D]>);

/// A row of a problem, with its directions.
type Row<const D: usize> = (usize, [[f64; D]; D]);

/// Where a step has come to.
struct Reached<const D: usize>
where
    ElementKind: Space<D>,
{
    /// The state from which the next step begins.
    settled: Deformation<D>,
    /// The last one, with nothing left to be moved.
    at: Configuration<D>,
    violation: Kkt,
    iterations: usize,
    unstable: bool,
}

/// Load steps on their way.
struct Process<'a, const D: usize>
where
    ElementKind: Space<D>,
{
    elastic: &'a Elastic<D>,
    engine: &'a mut Engine,
    settings: &'a StepSettings,
    begin: Instant,
    limit: Option<Duration>,
    rounds: Vec<Round>,
    known: Known<D>,
    /// Whether bodies may be on [`Self::springs`], and whether some have been.
    has_springs: bool,
    had_springs: bool,
}

/// What is known of A from the configurations before.
#[derive(Clone)]
struct Known<const D: usize> {
    recycled: RecycledSubspace,
    /// The row of each contact place of the last configuration.
    rows: Vec<Option<Row<D>>>,
    /// The remedy of its tangent, and whether this was replaced.
    tangent: (Help, bool),
}

/// Whether K is singular or not definite.
fn is_indefinite(error: &Error) -> bool {
    match error {
        Error::Engine(EngineError::Factor(error)) => error.is_indefinite(),
        Error::Engine(EngineError::Pcg(error)) => error.is_indefinite(),
        Error::Step(error) => match &error.error.cause {
            Cause::Operator(DualError::Factor(error)) => error.is_indefinite(),
            Cause::Operator(DualError::Pcg(error)) => error.is_indefinite(),
            _ => false,
        },
        _ => false,
    }
}

impl<const D: usize> Known<D> {
    /// Nothing.
    fn new() -> Self {
        Self {
            recycled: RecycledSubspace::default(),
            rows: Vec::new(),
            tangent: (HELP[0], false),
        }
    }

    /// Carries it over to the rows of the next configuration.
    fn renew(&mut self, at: &Configuration<D>)
    where
        ElementKind: Space<D>,
    {
        let m = at.contact.places.len();
        let before = std::mem::replace(&mut self.rows, vec![None; at.touches.len()]);
        for (row, i, place) in at.contact.numbered() {
            self.rows[i] = Some((row, place.frame));
        }
        let moved_to = |(now, from): (&Option<Row<D>>, &Option<usize>)| {
            let was = before.get((*from)?).copied().flatten()?;
            Some((was, (*now)?))
        };
        let moved = self.rows.iter().zip(&at.from);
        let moved: Vec<_> = moved.filter_map(moved_to).collect();
        let b = at.problem.contact_matrix();
        let is_empty = |row: usize| b.row(row).1.iter().all(|v| v[0][0] == 0.0);
        // Directions turn with the normal. Rows without entries would have forces that nothing takes back.
        let turned = |v: &[f64]| {
            let mut new = vec![0.0; D * m];
            for &((was, old_frame), (row, frame)) in &moved {
                let entries = constraint::at::<D>(v, was);
                let mut along = [0.0; D];
                for (entry, way) in entries.iter().zip(&old_frame).skip(1) {
                    (0..D).for_each(|c| along[c] += entry * way[c]);
                }
                let along = turned_with(along, old_frame[0], frame[0]);
                new[row] = entries[0];
                for (a, way) in frame.iter().enumerate().skip(1) {
                    new[row_of::<D>(m, row, a)] = dot(along, *way);
                }
            }
            for (row, v) in new.iter_mut().enumerate() {
                if is_empty(row) {
                    *v = 0.0;
                }
            }
            new
        };
        let factors = |v: &[f64]| {
            let mut new = vec![0.0; D * m];
            for &((was, _), (row, _)) in &moved {
                for (a, entry) in constraint::at::<D>(v, was).into_iter().enumerate() {
                    new[row_of::<D>(m, row, a)] = entry;
                }
            }
            new
        };
        self.recycled.renew(turned, factors);
    }

    /// Forgets what belongs to a tangent with other remedies than this one.
    fn check(&mut self, tangent: (Help, bool)) {
        if self.tangent != tangent {
            self.recycled = RecycledSubspace::default();
            self.tangent = tangent;
        }
    }
}

impl<const D: usize> Process<'_, D>
where
    ElementKind: Space<D>,
{
    /// The settings of a solve to a tolerance, with the time that is left.
    fn to(&self, tolerance: f64) -> StepSettings {
        let mut settings = self.settings.clone();
        settings.ssnm.tolerance = tolerance;
        settings.ssnm.time_limit = self
            .limit
            .map(|limit| limit.saturating_sub(self.begin.elapsed()));
        settings
    }

    /// Solves the problem of a configuration.
    fn solve(
        &mut self,
        at: &Configuration<D>,
        tolerance: f64,
        watch: &mut dyn FnMut(quasistatic::Event) -> ControlFlow<()>,
    ) -> Result<StepSolution<D>, Error> {
        self.engine.follow(&at.problem)?;
        let settings = self.to(tolerance);
        let springs = self.springs(at).filter(|_| self.has_springs);
        self.had_springs |= springs.is_some();
        let solved = match springs {
            Some(stiffness) => quasistatic::solve_step_on_springs(
                &at.problem,
                &at.load,
                &at.state,
                &mut *self.engine,
                &settings,
                stiffness,
                watch,
            ),
            None => quasistatic::solve_step(
                &at.problem,
                &at.load,
                &at.state,
                &mut *self.engine,
                &settings,
                &mut self.known.recycled,
                watch,
            ),
        };
        let solution = solved.map_err(Box::new)?;
        if solution.status != Status::Converged {
            self.known.recycled = RecycledSubspace::default();
        }
        for round in &solution.rounds {
            self.rounds.push(Round {
                round: self.rounds.len() + 1,
                ..round.clone()
            });
        }
        Ok(solution)
    }

    /// The stiffness of springs on the motions of bodies that contact without friction holds, some of it between round sides; None where
    /// all are held otherwise or nothing presses.
    ///
    /// Contact resists the turn of a round body by hardly more than the errors of its facets do. Newton's method would take it far
    /// around.
    fn springs(&self, at: &Configuration<D>) -> Option<f64> {
        let (bodies, tied) = (at.problem.floating_bodies().bodies(), at.contact.tied());
        let least = bodies.iter().map(|body| body.nodes().len()).min()?;
        let has_friction = (0..tied.len()).any(|row| !tied[row] && at.problem.has_friction(row));
        let force: f64 = at.touches.iter().map(|touch| length(touch.force)).sum();
        let round = self.elastic.round_facet();
        let facet = round.filter(|_| !has_friction && force > 0.0)?;
        Some(SPRINGS * force / (facet * least as f64))
    }

    /// The same with the first remedy that makes its tangent definite; None if all of them fail.
    #[allow(clippy::too_many_arguments)]
    fn helped(
        &mut self,
        before: &Deformation<D>,
        moments: [&Moment<D>; 2],
        now: &Deformation<D>,
        at: Configuration<D>,
        first: bool,
        tolerance: f64,
        watch: &mut dyn FnMut(quasistatic::Event) -> ControlFlow<()>,
    ) -> Result<Option<(Configuration<D>, StepSolution<D>)>, Error> {
        let (mut without, mut failed) = (Some(at), None);
        let presses = self.elastic.meets_obstacles();
        for help in HELP.into_iter().filter(|help| presses || help.held == 0.0) {
            let at = match without.take() {
                Some(at) => at,
                None => match (self.elastic).configuration(before, moments, now, first, help) {
                    Err(error) if !first && error.is_astray() => return Ok(None),
                    made => made?,
                },
            };
            self.known.check((help, at.is_replaced));
            match self.solve(&at, tolerance, watch) {
                Ok(solution) => return Ok(Some((at, solution))),
                Err(error) if is_indefinite(&error) => failed = Some(error),
                Err(error) => return Err(error),
            }
        }
        let Some(error) = failed.filter(|_| self.rounds.is_empty()) else {
            return Ok(None);
        };
        // Nothing has been solved at all. Bodies that are held where they are take a shorter step.
        let start = [moments[0]; 2];
        let start = (self.elastic).configuration(before, start, before, true, HELP[0])?;
        match self.engine.update(&start.problem) {
            Ok(()) if !start.is_replaced && self.engine.is_definite()? => Ok(None),
            _ => Err(error),
        }
    }

    /// From a state in balance towards another moment; where that fails on springs, without them.
    fn step(
        &mut self,
        before: &Deformation<D>,
        moments: [&Moment<D>; 2],
        watch: &mut dyn FnMut(quasistatic::Event) -> ControlFlow<()>,
    ) -> Result<Result<Reached<D>, Ended>, Error> {
        let known = self.known.clone();
        (self.has_springs, self.had_springs) = (true, false);
        match self.one_step(before, moments, watch)? {
            Err(Ended::Lost(_)) if self.had_springs => {
                (self.has_springs, self.known) = (false, known);
                self.one_step(before, moments, watch)
            }
            ended => Ok(ended),
        }
    }

    /// The same, with springs or without.
    fn one_step(
        &mut self,
        before: &Deformation<D>,
        moments: [&Moment<D>; 2],
        watch: &mut dyn FnMut(quasistatic::Event) -> ControlFlow<()>,
    ) -> Result<Result<Reached<D>, Ended>, Error> {
        let tolerance = self.settings.ssnm.tolerance;
        let mut now = before.clone();
        let mut inner = INNER;
        let mut least = self.elastic.least_volume(&now.displacement);
        let mut anderson = Anderson::default();
        // Of the last two iterations, and of all but the first.
        let (mut sets, mut violations) = ([None::<Sets<D>>, None], Vec::new());
        for iteration in 0.. {
            let first = iteration == 0;
            let (mut stuck, mut falls) = (false, false);
            let made = (self.elastic).configuration(before, moments, &now, first, HELP[0]);
            let at = match made {
                // Where the way went astray, that is not the fault of the model.
                Err(error) if !first && error.is_astray() => {
                    return Ok(Err(Ended::Lost(Vec::new())));
                }
                made => made?,
            };
            self.known.renew(&at);
            if !first {
                let violation = at.violation();
                let off = norm_max(&[violation.max(), at.unmoved(&now.displacement)]);
                if !off.is_finite() {
                    return Ok(Err(Ended::Lost(Vec::new())));
                }
                if off <= tolerance {
                    self.elastic.check_driven(before, moments[1], &at)?;
                    match self.elastic.is_pierced(&now, &at.touches, moments[1]) {
                        Ok(false) => {}
                        Err(error) if !error.is_folded() => return Err(error.into()),
                        _ => return Ok(Err(Ended::Lost(Vec::new()))),
                    }
                    let unstable = !self.is_stable(before, moments, &now, &at)?;
                    return Ok(Ok(Reached {
                        settled: self.elastic.settled(now, &at),
                        at,
                        violation,
                        iterations: iteration,
                        unstable,
                    }));
                }
                inner = (INNER * off).clamp(0.1 * tolerance, INNER);
                let before = |iterations: usize| {
                    let at = violations.len().checked_sub(iterations);
                    at.map_or(f64::INFINITY, |at| violations[at])
                };
                stuck = off > STUCK * before(2);
                let (iterations, part) = KEEPS_FALLING;
                falls = off < part * before(iterations);
                violations.push(off);
            }
            if iteration >= MOST && !(falls && iteration < 3 * MOST) {
                break;
            }
            let Some((at, solution)) =
                self.helped(before, moments, &now, at, first, inner, watch)?
            else {
                return Ok(Err(Ended::Lost(Vec::new())));
            };
            match solution.status {
                Status::TimeLimit | Status::Interrupted => {
                    return Ok(Err(Ended::Stopped(solution.status)));
                }
                Status::NotHeld => return Ok(Err(Ended::Lost(solution.not_held))),
                _ => {}
            }
            let alike = |before: &Option<Sets<D>>| {
                (before.as_ref())
                    .is_some_and(|before| at.is_alike && before.are_like(&solution.sets))
            };
            let [goes_on, recurs] = [&sets[0], &sets[1]].map(alike);
            let moves = at.left.displacements(&solution.u);
            let forces = self.elastic.forces_of(&at, &solution.lambda);
            let moved = |part: f64| -> Vec<[f64; D]> {
                let each = now.displacement.iter().zip(&moves);
                each.map(|(u, du)| std::array::from_fn(|c| u[c] + part * du[c]))
                    .collect()
            };
            let mut part = if stuck && recurs && !goes_on {
                0.5
            } else {
                1.0
            };
            let displacement = loop {
                let displacement = moved(part);
                let volume = self.elastic.least_volume(&displacement);
                if volume >= PRESSED * least.min(1.0) {
                    least = volume;
                    break displacement;
                }
                part *= 0.5;
                if part < 1e-3 {
                    return Ok(Err(Ended::Lost(Vec::new())));
                }
            };
            let new: Vec<[f64; D]> = (at.touches.iter().zip(forces))
                .map(|(touch, new)| match part {
                    1.0 => new,
                    _ => std::array::from_fn(|c| touch.force[c] + part * (new[c] - touch.force[c])),
                })
                .collect();
            let mut to = (displacement, new);
            if first || part < 1.0 || !goes_on {
                anderson.clear();
            }
            // Acceleration would take bodies on springs far all the same.
            let is_on_springs = self.has_springs && self.had_springs;
            if self.elastic.redirects_forces() && !first && part == 1.0 && !is_on_springs {
                match self.accelerated(&mut anderson, &now, &at, &to) {
                    Some((volume, better)) if volume >= PRESSED * least.min(1.0) => {
                        (least, to) = (volume, better);
                    }
                    _ => anderson.clear(),
                }
            }
            sets = [Some(solution.sets), sets[0].take()];
            let (displacement, forces) = to;
            now.touches = at.touches;
            for (touch, force) in now.touches.iter_mut().zip(forces) {
                touch.force = force;
            }
            now.step = (displacement.iter().zip(&now.displacement))
                .map(|(new, old)| minus(*new, *old))
                .collect();
            now.displacement = displacement;
        }
        Ok(Err(Ended::Lost(Vec::new())))
    }

    /// The combination of the last iterations that is nearest to a fixed point, and its least det F; None where contact would pull.
    fn accelerated(
        &self,
        anderson: &mut Anderson,
        now: &Deformation<D>,
        at: &Configuration<D>,
        to: &Moved<D>,
    ) -> Option<(f64, Moved<D>)> {
        let soft = at.problem.compliance();
        let soft = soft.iter().sum::<f64>() / soft.len().max(1) as f64;
        let packed = |u: &[[f64; D]], forces: Vec<[f64; D]>| -> Vec<f64> {
            let forces = forces.as_flattened().iter().map(|f| soft * f);
            u.as_flattened().iter().copied().chain(forces).collect()
        };
        let from = at.touches.iter().map(|touch| touch.force).collect();
        let next = anderson.next(packed(&now.displacement, from), packed(&to.0, to.1.clone()));
        let (u, forces) = next.split_at(D * to.0.len());
        let vector = |v: &[f64]| -> [f64; D] { std::array::from_fn(|c| v[c]) };
        let u: Vec<[f64; D]> = u.chunks_exact(D).map(vector).collect();
        let forces = forces
            .chunks_exact(D)
            .zip(&at.touches)
            .map(|(force, touch)| {
                let force = vector(force).map(|f| f / soft);
                match self.elastic.pairs[touch.pair as usize].tied {
                    true => Some(force),
                    false => touch.within_law(force),
                }
            });
        let forces: Vec<[f64; D]> = forces.collect::<Option<_>>()?;
        Some((self.elastic.least_volume(&u), (u, forces)))
    }

    /// Whether the bodies stay where they are when they are pushed a little: their tangent is definite, by itself, with the rows that
    /// always act, or where contact that presses is kept closed.
    fn is_stable(
        &mut self,
        before: &Deformation<D>,
        moments: [&Moment<D>; 2],
        now: &Deformation<D>,
        at: &Configuration<D>,
    ) -> Result<bool, Error> {
        let mut is_definite = |at: &Configuration<D>| -> Result<bool, Error> {
            let alone = match self.engine.update(&at.problem).map_err(Error::from) {
                _ if at.is_replaced => false,
                Ok(()) => self.engine.is_definite()?,
                Err(error) if is_indefinite(&error) => false,
                Err(error) => return Err(error),
            };
            Ok(alone || !at.is_replaced && joints::is_definite(at, HELD))
        };
        if is_definite(at)? {
            return Ok(true);
        }
        // Pressures up to a free edge are not conservative, and the symmetric part of their turn may be indefinite
        // where bodies are stable. So may that of pairs, which counts only as long as they stay closed.
        // Forces in the volume that depend on where bodies are have an approximate tangent.
        let also_without = self.elastic.has_moved_forces() || self.elastic.redirects_forces();
        let turning = [true, false]
            .into_iter()
            .take(1 + usize::from(also_without));
        for turning in turning {
            // With stiff closed contact the bodies can only give way along the obstacles.
            let closed = Help {
                turning,
                held: HELD,
                stiffened: false,
            };
            let closed = (self.elastic).configuration(before, moments, now, false, closed)?;
            if is_definite(&closed)? {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// The results of a load step.
    fn results(
        &mut self,
        reached: Reached<D>,
        to: &Moment<D>,
    ) -> (Built<D>, StepData<D>, StepSolution<D>) {
        let Reached {
            settled,
            at,
            violation,
            unstable,
            ..
        } = reached;
        let (elastic, data, u, slip) = self.elastic.results_at(&settled, to, &at);
        let solution = StepSolution {
            cycle: 1,
            worn: Vec::new(),
            status: if unstable {
                Status::Unstable
            } else {
                Status::Converged
            },
            slip_bound: at.problem.bounds(&at.lambda).into_owned(),
            u,
            settled: vec![0.0; slip.len()],
            slip,
            sizes: at.sets().sizes_in(&at.problem),
            sets: at.sets(),
            rounds: std::mem::take(&mut self.rounds),
            kkt: violation,
            not_held: Vec::new(),
            lambda: at.lambda,
        };
        let problem = at.problem;
        (Built { problem, elastic }, data, solution)
    }
}

/// Makes the load steps of bodies whose displacements may be large, until one does not converge; the engine fits the problem
/// at rest again behind them.
pub(crate) fn make_steps<const D: usize>(
    elastic: &Elastic<D>,
    problem: &ContactProblem<D>,
    engine: &mut Engine,
    settings: &StepSettings,
    observer: &mut dyn FnMut(Event<D>) -> ControlFlow<()>,
) -> Result<(), Error>
where
    ElementKind: Space<D>,
{
    let made = make_all(elastic, engine, settings, observer);
    engine.update(problem)?;
    made
}

fn make_all<const D: usize>(
    elastic: &Elastic<D>,
    engine: &mut Engine,
    settings: &StepSettings,
    observer: &mut dyn FnMut(Event<D>) -> ControlFlow<()>,
) -> Result<(), Error>
where
    ElementKind: Space<D>,
{
    settings.ssnm.check()?;
    let mut process = Process {
        elastic,
        engine,
        settings,
        begin: Instant::now(),
        limit: settings.ssnm.time_limit,
        rounds: Vec::new(),
        known: Known::new(),
        has_springs: true,
        had_springs: false,
    };
    let mut before = elastic.undeformed();
    let mut from = elastic.moment(0.0)?;
    let mut longest = 1.0_f64;
    for number in 1..=elastic.n_steps() {
        let end = number as f64;
        let factor = elastic.factor(end);
        if observer(Event::Begins {
            number,
            cycle: 1,
            factor,
        })
        .is_break()
        {
            return Ok(());
        }
        let mut time = end - 1.0;
        before.begin();
        let mut last: Option<Reached<D>> = None;
        let mut parts = 0;
        let (mut failed, mut not_held) = (None, Vec::new());
        while time < end {
            let to_time = if time + longest > end - 1e-9 {
                end
            } else {
                time + longest
            };
            let to = elastic.moment(to_time)?;
            let mut watch = |event: quasistatic::Event| observer(Event::Within(event));
            let known = process.known.clone();
            match process.step(&before, [&from, &to], &mut watch)? {
                Ok(reached) => {
                    before.clone_from(&reached.settled);
                    parts += 1;
                    if reached.iterations <= EASY {
                        longest = (1.5 * longest).min(1.0);
                    }
                    time = to_time;
                    let unstable = reached.unstable;
                    last = Some(reached);
                    from = to;
                    if unstable {
                        break;
                    }
                }
                Err(Ended::Stopped(status)) => {
                    failed = Some(status);
                    break;
                }
                Err(Ended::Lost(bodies)) => {
                    process.known = known;
                    longest = 0.5 * longest.min(to_time - time);
                    if longest < 0.5_f64.powi(CUTS) {
                        failed = Some(match bodies.is_empty() {
                            true => Status::Stagnated,
                            false => Status::NotHeld,
                        });
                        not_held = bodies;
                        break;
                    }
                }
            }
        }
        // Where nothing of a step could be made, its end is its beginning.
        let reached = match last {
            Some(reached) => reached,
            None => {
                let at = elastic.configuration(&before, [&from; 2], &before, false, HELP[0])?;
                Reached {
                    violation: at.violation(),
                    settled: elastic.settled(before.clone(), &at),
                    at,
                    iterations: 0,
                    unstable: false,
                }
            }
        };
        let (built, data, mut solution) = process.results(reached, &from);
        if let Some(status) = failed {
            (solution.status, solution.not_held) = (status, not_held);
        }
        let goes_on = solution.status == Status::Converged;
        let solved = Solved {
            number,
            data: Some(&data),
            solution,
            displaced: Some(Arc::new(built)),
            parts: parts.max(1),
        };
        if observer(Event::Ends(Box::new(solved))).is_break() || !goes_on {
            return Ok(());
        }
    }
    Ok(())
}
