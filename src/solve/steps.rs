//! Load steps made one after another, and cycles of them.
//!
//! Where contacts wear, slip s under a contact force λ takes off a depth k s λ / area in a load step. This is a
//! compliance of the gap, which never springs back. With it pressures at the end of a step are those that its own wear
//! leaves (implicit Euler). Taken off with the pressures of the step before, wear would swing from place to place as
//! soon as it exceeds the amount by which the bodies give way. Slip is that of the same step in the cycle before, or of
//! the same step solved before, where it differs.
//!
//! One cycle wears little. Each cycle that is computed therefore counts for as many as move a stated part of the
//! wear to other places at most (a cycle jump). If they move more than twice that, the bodies go back to the cycle
//! before, and fewer are left out. The rows of B and A do not change.

use super::{Error, Event, Solved};
use crate::constraint::row_of;
use crate::dual::DualOperator;
use crate::mesh::{ElementKind, Topology};
use crate::model::{Changes, Cycles, ModelError, StepData, Wearing};
use crate::problem::{ContactProblem, Elsewhere, UNREACHABLE};
use crate::quasistatic::{self, Load, State, StepSettings, StepSolution};
use crate::sparse::add_times;
use crate::ssnm::{Info, RecycledSubspace, Status};
use std::ops::ControlFlow;
use std::time::Duration;
use web_time::Instant;

/// Load steps to be made.
pub(crate) struct Plan<'p, const D: usize>
where
    ElementKind: Topology<D>,
{
    /// Their number in a cycle.
    pub n_steps: usize,
    /// The load of each, counted from 0; None: that of the problem.
    pub step: &'p dyn Fn(usize) -> Result<Option<StepData<D>>, ModelError>,
    pub cycles: Cycles,
    /// How contacts wear, if they do.
    pub wearing: Option<Wearing>,
}

/// A load step in which contacts, ties or friction differ from those in the problem.
pub(crate) struct Changed<const D: usize> {
    pub problem: ContactProblem<D, Elsewhere>,
    pub load: Load,
    pub start: State,
}

impl<const D: usize> Changed<D> {
    /// Under the load of a step, from where the one before has ended.
    pub fn new(
        problem: &ContactProblem<D, Elsewhere>,
        load: &Load,
        state: &State,
        changes: &Changes,
    ) -> Self {
        let (mut load, mut start) = (load.clone(), state.clone());
        for &row in &changes.idle {
            load.gap[row] = UNREACHABLE;
            (0..D).for_each(|a| start.lambda[row_of::<D>(problem.m(), row, a)] = 0.0);
        }
        if !changes.bonded.is_empty() {
            let closed = problem.beyond_compliance(problem.normal(), 0, &state.u, &state.lambda);
            for &(row, moved) in &changes.bonded {
                load.gap[row] = closed[row] - moved;
            }
        }
        let [bound, friction] =
            [problem.slip_bound(), problem.friction_coefficient()].map(|all| changes.of_step(all));
        Self {
            problem: problem.under_law(bound, friction),
            load,
            start,
        }
    }
}

/// Bodies between two load steps.
struct Course<'a, const D: usize> {
    problem: ContactProblem<D, Elsewhere>,
    dual: &'a mut dyn DualOperator,
    settings: StepSettings,
    recycled: &'a mut RecycledSubspace,
    begin: Instant,
    limit: Option<Duration>,
    state: State,
    /// The rows that have not acted in the step before.
    idle: Vec<usize>,
}

impl<const D: usize> Course<'_, D>
where
    ElementKind: Topology<D>,
{
    /// Makes a step, with gaps that have grown by these depths and grow by a depth over the force.
    fn step(
        &mut self,
        data: Option<&StepData<D>>,
        worn: &[f64],
        rates: &[f64],
        within: &mut dyn FnMut(quasistatic::Event) -> ControlFlow<()>,
    ) -> Result<StepSolution<D>, Error> {
        let stated = data.map(|data| &data.load);
        let mut load = stated.map_or_else(|| Load::of(&self.problem), Load::clone);
        add_times(1.0, worn, &mut load.gap[..worn.len()]);
        let load = &load;
        let changes = data.and_then(|data| data.changes.as_ref());
        let changed =
            changes.map(|changes| Changed::new(&self.problem, load, &self.state, changes));
        // Pairs of rows that do not act any more, beside new ones of the same nodes, lead astray. Where a contact
        // becomes a tie, it takes 30 to 469 steps in place of 11.
        let idle = changes.map_or(&[][..], |changes| &changes.idle);
        if idle != self.idle {
            *self.recycled = RecycledSubspace::default();
            self.idle = idle.to_vec();
        }
        let left = self
            .limit
            .map(|limit| limit.saturating_sub(self.begin.elapsed()));
        self.settings.ssnm.time_limit = left;
        let (mut problem, of_step, start) = match &changed {
            Some(one) => (&one.problem, &one.load, &one.start),
            None => (&self.problem, load, &self.state),
        };
        let worn_off;
        if rates.iter().any(|&rate| rate > 0.0) {
            worn_off = problem.giving_way(rates);
            problem = &worn_off;
        }
        let (dual, recycled) = (&mut *self.dual, &mut *self.recycled);
        let made = quasistatic::solve_step(
            problem,
            of_step,
            start,
            dual,
            &self.settings,
            recycled,
            within,
        );
        let solution = made.map_err(Box::new)?;
        self.state = solution.state(load);
        Ok(solution)
    }
}

/// The part of the wear of a step that may go with a slip other than its own.
const SLIP: f64 = 0.01;
/// Solves of a step at most, to find its slip.
const PASSES: usize = 5;

impl<const D: usize> Course<'_, D>
where
    ElementKind: Topology<D>,
{
    /// Makes a step in which contacts wear as often as stated, with a guess of its slip; returns its slip.
    fn worn_step(
        &mut self,
        data: Option<&StepData<D>>,
        (wearing, times): (&Wearing, usize),
        guess: Option<&Vec<f64>>,
        depths: &mut [f64],
        within: &mut dyn FnMut(quasistatic::Event) -> ControlFlow<()>,
    ) -> Result<(StepSolution<D>, Vec<f64>), Error> {
        let start = self.state.clone();
        let m = depths.len();
        let mut slips = guess.cloned().unwrap_or_else(|| vec![0.0; m]);
        let mut earlier: Vec<Info> = Vec::new();
        for pass in 1.. {
            let mut rates = wearing.rates(&slips);
            rates.iter_mut().for_each(|rate| *rate *= times as f64);
            let mut solution = self.step(data, depths, &rates, within)?;
            let found = wearing.slips(&solution);
            let normal = &solution.lambda[..m];
            let wear = |slip: &dyn Fn(usize) -> f64| -> f64 {
                let slips: Vec<f64> = (0..m).map(slip).collect();
                wearing.volumes(&slips, normal).sum()
            };
            let off = wear(&|i| (found[i] - slips[i]).abs());
            if solution.status == Status::Converged
                && off > SLIP * wear(&|i| found[i])
                && pass < PASSES
            {
                earlier.push(solution.last().info.clone());
                self.state.clone_from(&start);
                slips = found;
                continue;
            }
            let worn = rates.iter().zip(normal).map(|(rate, force)| rate * force);
            depths
                .iter_mut()
                .zip(worn)
                .for_each(|(depth, worn)| *depth += worn);
            solution.count(earlier);
            return Ok((solution, found));
        }
        unreachable!("the last pass returns")
    }
}

/// A cycle that has been computed, to which those after it return if they have left out too many.
struct Computed {
    cycle: usize,
    /// Where bodies are at its end, and the rows that have not acted last.
    state: State,
    idle: Vec<usize>,
    /// The depths at its end.
    depths: Vec<f64>,
    /// The slip in each of its steps.
    slips: Vec<Vec<f64>>,
    /// The volume that wears off at each place in each of its steps.
    volumes: Vec<f64>,
}

impl Computed {
    /// The part of the wear that has moved elsewhere since an earlier one.
    fn change_since(&self, earlier: &Self) -> f64 {
        let pairs = self.volumes.iter().zip(&earlier.volumes);
        let change: f64 = pairs.map(|(now, before)| (now - before).abs()).sum();
        let size: f64 = self.volumes.iter().sum();
        if size > 0.0 { change / size } else { 0.0 }
    }
}

/// Makes load steps one after another, like [`Analysis::solve_on`](crate::model::Analysis::solve_on), with any way to apply K⁻¹.
pub(crate) fn make_steps<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    before: State,
    plan: &Plan<D>,
    dual: &mut dyn DualOperator,
    settings: &StepSettings,
    recycled: &mut RecycledSubspace,
    observer: &mut dyn FnMut(Event<D>) -> ControlFlow<()>,
) -> Result<(), Error>
where
    ElementKind: Topology<D>,
{
    settings.ssnm.check()?;
    let mut course = Course {
        problem: problem.elsewhere(),
        dual,
        settings: settings.clone(),
        recycled,
        begin: Instant::now(),
        limit: settings.ssnm.time_limit,
        state: before,
        idle: Vec::new(),
    };
    make_cycles(&mut course, plan, observer)?;
    if !course.idle.is_empty() {
        *course.recycled = RecycledSubspace::default();
    }
    Ok(())
}

fn make_cycles<const D: usize>(
    course: &mut Course<D>,
    plan: &Plan<D>,
    observer: &mut dyn FnMut(Event<D>) -> ControlFlow<()>,
) -> Result<(), Error>
where
    ElementKind: Topology<D>,
{
    let Cycles { count, jump: most } = plan.cycles;
    let wearing = plan.wearing.as_ref();
    let mut last: Option<Computed> = None;
    // The number of the cycle, how many it counts for, and the depths worn off.
    let (mut cycle, mut jump) = (1, 1);
    let mut depths = wearing.map_or_else(Vec::new, |_| vec![0.0; course.problem.m()]);
    // Their loads.
    let mut kept: Vec<Option<StepData<D>>> = Vec::new();
    let mut number = 0;
    // The work in cycles that do not count.
    let mut vain: Vec<Info> = Vec::new();
    loop {
        // Its steps are told when it is known that it counts.
        let on_trial = jump > 1;
        let (mut made, mut volumes, mut slips) = (Vec::new(), Vec::new(), Vec::new());
        for step in 0..plan.n_steps {
            if kept.len() <= step {
                // One that does not come again makes room for the next.
                kept.truncate(if count > 1 { step } else { 0 });
                kept.push((plan.step)(step)?);
            }
            let data = kept.get(step).or(kept.last()).and_then(Option::as_ref);
            if !on_trial {
                number += 1;
                if observer(begins(number, cycle, data)).is_break() {
                    return Ok(());
                }
            }
            let within = &mut |event: quasistatic::Event| observer(Event::Within(event));
            let mut solution = match wearing {
                None => course.step(data, &[], &[], within)?,
                Some(wearing) => {
                    let guess = last.as_ref().map(|last| &last.slips[step]);
                    let (solution, slip) =
                        course.worn_step(data, (wearing, jump), guess, &mut depths, within)?;
                    volumes.extend(wearing.volumes(&slip, &solution.lambda));
                    slips.push(slip);
                    solution
                }
            };
            solution.count(std::mem::take(&mut vain));
            solution.worn.clone_from(&depths);
            solution.cycle = cycle;
            let status = solution.status;
            if on_trial {
                made.push(solution);
            } else if observer(ends(number, data, solution)).is_break() {
                return Ok(());
            }
            match status {
                Status::Converged => {}
                _ if !on_trial => return Ok(()),
                // Fewer may do.
                _ => break,
            }
        }
        let end = (made.last()).map_or(Status::Converged, |solution| solution.status);
        let this = Computed {
            cycle,
            state: course.state.clone(),
            idle: course.idle.clone(),
            depths: depths.clone(),
            slips,
            volumes,
        };
        let change = match &last {
            _ if end != Status::Converged => f64::INFINITY,
            Some(last) => this.change_since(last),
            None => 0.0,
        };
        let is_too_long = on_trial && change > 2.0 * most && end != Status::Interrupted;
        if let (true, Some(last)) = (is_too_long, &last) {
            let rounds = made.into_iter().flat_map(|solution| solution.rounds);
            vain = rounds.map(|round| round.info).collect();
            jump = about(jump as f64 * (most / change).max(0.1));
            course.state.clone_from(&last.state);
            if course.idle != last.idle {
                *course.recycled = RecycledSubspace::default();
                course.idle.clone_from(&last.idle);
            }
            depths.clone_from(&last.depths);
            cycle = last.cycle + jump;
            continue;
        }
        for (solution, data) in made.into_iter().zip(&kept) {
            number += 1;
            if observer(begins(number, cycle, data.as_ref())).is_break()
                || observer(ends(number, data.as_ref(), solution)).is_break()
            {
                return Ok(());
            }
        }
        if end != Status::Converged || cycle == count {
            return Ok(());
        }
        // At most twice as many: forces may change more and more.
        let longer = if change > 0.0 {
            (most / change).min(2.0)
        } else {
            2.0
        };
        jump = match (&last, wearing) {
            // The first cycle begins at rest, and the second after it.
            (None, _) | (_, None) => 1,
            _ => about(jump as f64 * longer).min(count - cycle),
        };
        cycle += jump;
        last = Some(this);
    }
}

/// At least one, and not more than this, to three binary digits: rounding hardly ever decides on it.
fn about(jump: f64) -> usize {
    let jump = (jump as usize).max(1);
    let shift = jump.ilog2().saturating_sub(2);
    jump >> shift << shift
}

/// The beginning of a step with a number.
fn begins<'a, const D: usize>(
    number: usize,
    cycle: usize,
    data: Option<&StepData<D>>,
) -> Event<'a, D>
where
    ElementKind: Topology<D>,
{
    Event::Begins {
        number,
        cycle,
        factor: data.map_or(1.0, |data| data.factor),
    }
}

/// Its end.
fn ends<const D: usize>(
    number: usize,
    data: Option<&StepData<D>>,
    solution: StepSolution<D>,
) -> Event<'_, D>
where
    ElementKind: Topology<D>,
{
    Event::Ends(Box::new(Solved {
        number,
        data,
        solution,
        displaced: None,
        parts: 1,
    }))
}
