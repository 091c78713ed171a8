//! Load steps, Coulomb friction, and bodies that only contact holds: what takes several contact problems
//! (1)–(3) in a row.
//!
//! **Load steps.** In a quasi-static process friction acts on the slip since the last step. With u = ū + v, ū
//! the displacement before, a step is a problem (1)–(3) in v with the load f − Kū and the gap d − Nū; the
//! multipliers are those of the whole load.
//!
//! **Coulomb friction** bounds λτ by μλν, which is not known beforehand. The bounds are a fixed point of
//! g ↦ μλν(g), where λν(g) solves the problem with the given bounds g (Tresca): successive approximation as in
//! Nečas, Jarušek and Haslinger (1980), warm-started, with Anderson's acceleration (Walker and Ni 2011).
//!
//! **Bodies without supports** have a singular stiffness matrix. Weak springs S make it regular; they are
//! anchored at the solution of the round before (proximal point method), until they carry nothing.

use crate::dual::{DualError, DualOperator};
use crate::problem::{ContactProblem, Scales};
use crate::sparse::{Csr, dot, norm, norm_max};
use crate::ssnm::{self, Info, Sets, SolveError, Status};
use faer::linalg::solvers::SolveLstsqCore as _;
use std::ops::ControlFlow;
use std::time::Instant;

/// What stays the same in all steps.
#[derive(Clone, Copy, Debug)]
pub struct Model<'a> {
    /// K (with the springs), N, T and the given slip bounds; load and gap are those of the steps.
    pub problem: &'a ContactProblem,
    /// μ of each contact node, length m: where it is not 0, the slip bound is μλν.
    pub coefficient: &'a [f64],
    /// The springs that hold bodies without supports, part of the diagonal of K; empty where there are none.
    pub springs: &'a [Springs],
}

/// Weak springs under a body that its supports leave a motion as a whole.
#[derive(Clone, Debug)]
pub struct Springs {
    /// Which body it is and how it can move, for messages.
    pub body: String,
    /// Unknowns with the stiffness of their springs.
    pub stiffness: Vec<(u32, f64)>,
    /// Whether no support holds it in x, and in y.
    pub translates: [bool; 2],
}

impl<'a> Model<'a> {
    /// A problem with given slip bounds and supports enough.
    pub fn new(problem: &'a ContactProblem) -> Self {
        Self {
            problem,
            coefficient: &[],
            springs: &[],
        }
    }

    /// Whether a step may take more than one problem.
    pub fn takes_rounds(&self) -> bool {
        self.has_coulomb() || !self.springs.is_empty()
    }

    /// Whether some slip bound is μλν.
    pub fn has_coulomb(&self) -> bool {
        self.coefficient.iter().any(|&mu| mu > 0.0)
    }
}

/// The load at the end of a step: totals, not increments.
#[derive(Clone, Debug)]
pub struct Load {
    /// f, as long as K has rows.
    pub force: Vec<f64>,
    /// d, length m: the initial gap less what prescribed displacements have closed of it.
    pub gap: Vec<f64>,
    /// What prescribed displacements add to T u, length m.
    pub slide: Vec<f64>,
}

impl Load {
    /// That of the problem itself.
    pub fn of(problem: &ContactProblem) -> Self {
        Self {
            force: problem.load().to_vec(),
            gap: problem.gap().to_vec(),
            slide: vec![0.0; problem.m()],
        }
    }
}

/// Where a step starts from.
#[derive(Clone, Debug)]
pub struct State {
    /// u, as long as K has rows.
    pub u: Vec<f64>,
    /// λ, length 2m.
    pub lambda: Vec<f64>,
    /// [`Load::slide`] there.
    pub slide: Vec<f64>,
    /// The largest err⁰ on the way there ([`Info::first_error`]).
    pub first_error: f64,
}

impl State {
    /// Nothing has happened yet.
    pub fn at_rest(problem: &ContactProblem) -> Self {
        Self {
            u: vec![0.0; problem.stiffness().n_rows()],
            lambda: vec![0.0; 2 * problem.m()],
            slide: vec![0.0; problem.m()],
            first_error: 0.0,
        }
    }
}

/// Settings of the rounds.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Those of each problem; `initial` is ignored.
    pub ssnm: ssnm::Settings<'a>,
    /// ‖μλν − g‖ / ‖μλν‖ to reach.
    pub friction_tolerance: f64,
    /// Rounds at most.
    pub max_rounds: usize,
    /// Whether the fixed point is accelerated.
    pub accelerate: bool,
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Self {
            ssnm: ssnm::Settings::default(),
            friction_tolerance: 1e-5,
            max_rounds: 100,
            accelerate: true,
        }
    }
}

/// One problem (1)–(3) of a step.
#[derive(Clone, Debug)]
pub struct Round {
    /// From 1.
    pub round: usize,
    /// ‖μλν − g‖ / ‖μλν‖; 0 without Coulomb friction.
    pub friction_change: f64,
    /// ‖S(v − v')‖ / ‖Bᵀλ‖ on the unknowns of a body, the largest of all bodies on springs: what these carry
    /// beside the contact forces; 0 without springs.
    pub spring_force: f64,
    /// The tolerance of the problem.
    pub tolerance: f64,
    /// How it went.
    pub info: Info,
}

/// What an observer hears.
pub enum Event<'a> {
    /// An outer step of the Newton method.
    Newton(&'a ssnm::Step),
    /// A round has ended; heard only where there may be more than one.
    Round(&'a Round),
}

/// The end of a step.
#[derive(Clone, Debug)]
pub struct StepSolution {
    /// How it ended.
    pub status: Status,
    /// u in all, as long as K has rows.
    pub u: Vec<f64>,
    /// λ = (λν, λτ), length 2m.
    pub lambda: Vec<f64>,
    /// The slip bounds that the multipliers obey, length m.
    pub slip_bound: Vec<f64>,
    /// Slip in this step (T u and [`Load::slide`], their change), length m.
    pub slip: Vec<f64>,
    /// The sets at the end.
    pub sets: Sets,
    /// The rounds; their last one has the optimality conditions at the end.
    pub rounds: Vec<Round>,
    /// The largest err⁰ so far, earlier steps included.
    pub first_error: f64,
    /// The bodies whose springs could not be let go ([`Springs::body`]).
    pub loose: Vec<String>,
}

impl StepSolution {
    /// Where the next step starts from.
    pub fn state(&self, load: &Load) -> State {
        State {
            u: self.u.clone(),
            lambda: self.lambda.clone(),
            slide: load.slide.clone(),
            first_error: self.first_error,
        }
    }

    /// The last round.
    pub fn last(&self) -> &Round {
        self.rounds.last().expect("there is at least one")
    }

    /// Outer steps of all rounds.
    pub fn iter(&self) -> usize {
        self.rounds.iter().map(|r| r.info.iter).sum()
    }

    /// Products with A of all rounds.
    pub fn n_a(&self) -> usize {
        self.rounds.iter().map(|r| r.info.n_a).sum()
    }
}

/// The tolerance of the problem of a round beside the change of the slip bounds in the round before.
const FOLLOWS: f64 = 1e-3;
/// The same of the first rounds.
const FIRST_TOLERANCE: f64 = 1e-3;
/// Springs whose force has not fallen to this part of what it was so many rounds ago will not be let go.
const LET_GO: (usize, f64) = (16, 0.7);
/// A body without contact moves twice as far in each round, so that it gets across any gap; after so many rounds
/// there is nothing in its way.
const FLIGHTS: usize = 40;
/// Tolerances with springs, relative to those without.
const INFLATED: f64 = 0.05;
/// err⁰ counts as this part of the largest so far at least: where a load goes back to zero it says nothing.
const LEAST_ERROR: f64 = 1e-3;
/// The part of the friction tolerance that the last problem may be off by.
const RESOLVED: f64 = 0.1;

/// Solves one load step from `start`; the operator belongs to `model.problem`.
///
/// A model without Coulomb friction and springs takes one problem, otherwise rounds follow until slip bounds
/// and springs have settled. A step that does not get there ends with the [`Status`] of the round that
/// failed, or [`Status::IterationLimit`] after too many of them.
///
/// # Errors
/// If the operator fails; λ is that of the last round.
///
/// # Panics
/// If a length does not fit.
pub fn solve_step(
    model: &Model,
    load: &Load,
    start: &State,
    dual: &mut (impl DualOperator + ?Sized),
    settings: &Settings,
    mut observer: impl FnMut(Event) -> ControlFlow<()>,
) -> Result<StepSolution, SolveError> {
    let begin = Instant::now();
    let whole = model.problem;
    let m = whole.m();
    let (coulomb, springs) = (model.has_coulomb(), !model.springs.is_empty());
    // err⁰, at zero contact forces, is large where only springs hold a body.
    let finer = if springs { INFLATED } else { 1.0 };
    let tight = finer
        * if coulomb {
            (settings.ssnm.tolerance).min(RESOLVED * settings.friction_tolerance)
        } else {
            settings.ssnm.tolerance
        };
    let spring_limit = 10.0 * settings.ssnm.tolerance;

    let held_unknowns: Vec<(u32, f64)> = (model.springs.iter().flat_map(|body| &body.stiffness))
        .copied()
        .collect();
    let base = base(whole.tangential(), load, start);
    let (mut force, mut gap) = (load.force.clone(), load.gap.clone());
    let mut scales = Scales::default();
    if let Some(base) = &base {
        let mut pull = vec![0.0; base.len()];
        whole.stiffness().mul(base, &mut pull);
        let load_before = norm(&pull);
        for (force, pull) in force.iter_mut().zip(pull) {
            *force -= pull;
        }
        for &(i, s) in &held_unknowns {
            force[i as usize] += s * base[i as usize];
        }
        let mut moved = vec![0.0; m];
        whole.normal().mul(base, &mut moved);
        for (gap, moved) in gap.iter_mut().zip(moved) {
            *gap -= moved;
        }
        scales = Scales {
            u_max: norm_max(base),
            u: norm(base),
            load: norm(&load.force).max(load_before),
        };
    }

    let mut lambda = start.lambda.clone();
    let mut bounds = coulomb_bounds(model, &lambda);
    // Where the springs are anchored.
    let mut anchor = vec![0.0; force.len()];
    // The forces of springs are spread over a whole body, slip bounds over few nodes.
    let weight = (held_unknowns.len() as f64 / m.max(1) as f64).sqrt();
    let mut anderson = Anderson::default();
    let mut flights = 0;
    // The round since which no body has flown.
    let mut settled_from = 0;
    let mut rounds: Vec<Round> = Vec::new();
    let mut sigma = settings.ssnm.sigma_max;
    let mut tolerance = if coulomb || springs {
        tight.max(finer * FIRST_TOLERANCE)
    } else {
        tight
    };
    loop {
        let mut f = force.clone();
        for &(i, s) in &held_unknowns {
            f[i as usize] += s * anchor[i as usize];
        }
        let problem = whole.with_data(f, gap.clone(), bounds.clone(), scales);
        let failed = |error: DualError| SolveError {
            error,
            lambda: lambda.clone(),
            history: Vec::new(),
        };
        dual.set_data(problem.load(), problem.gap())
            .map_err(failed)?;
        let mut stopped = false;
        let solution = ssnm::solve(
            &problem,
            dual,
            &ssnm::Settings {
                tolerance,
                initial: Some(&lambda),
                sigma_max: sigma,
                least_error: LEAST_ERROR * start.first_error,
                time_limit: (settings.ssnm.time_limit)
                    .map(|limit| limit.saturating_sub(begin.elapsed())),
                ..settings.ssnm
            },
            |step| {
                let flow = observer(Event::Newton(step));
                stopped |= flow.is_break();
                flow
            },
        )?;
        sigma = Some(solution.info.sigma_max);
        lambda = solution.lambda;

        let next = coulomb_bounds(model, &lambda);
        let changes: Vec<f64> = next.iter().zip(&bounds).map(|(a, b)| a - b).collect();
        let friction: f64 = (0..m)
            .filter(|&i| model.coefficient.get(i).is_some_and(|&mu| mu > 0.0))
            .map(|i| next[i] * next[i])
            .sum::<f64>()
            .sqrt();
        let friction_change = match norm(&changes) {
            0.0 => 0.0,
            change if friction > 0.0 => change / friction,
            _ => 1.0,
        };
        let mut info = solution.info;
        let carried = spring_forces(model, [&lambda, &start.lambda], &solution.u, &anchor);
        let flies = carried.iter().any(|c| c.free && c.relative > spring_limit);
        flights = if flies { flights + 1 } else { 0 };
        let spring_force = carried.iter().map(|c| c.relative).fold(0.0, f64::max);
        let carried_in_all = norm(&carried.iter().map(|c| c.force).collect::<Vec<_>>());
        if carried_in_all > 0.0 {
            let size = norm(&load.force).max(norm(&force)).max(scales.load);
            info.kkt.equilibrium += carried_in_all / size;
        }
        let mut v = solution.u;
        rounds.push(Round {
            round: rounds.len() + 1,
            friction_change,
            spring_force,
            tolerance,
            info,
        });
        if coulomb || springs {
            stopped |= observer(Event::Round(rounds.last().expect("just pushed"))).is_break();
        }
        let settled = friction_change <= settings.friction_tolerance
            && spring_force <= spring_limit
            && tolerance <= tight;
        let falling = |back: usize, part: f64| {
            let before = rounds.len().checked_sub(back + 1);
            before.is_none_or(|i| spring_force <= part * rounds[i].spring_force)
        };
        let held = if flies {
            flights < FLIGHTS
        } else {
            rounds.len() < settled_from + LET_GO.0 || falling(LET_GO.0, LET_GO.1)
        };
        let mut loose = Vec::new();
        let status = if solution.status != Status::Converged {
            Some(solution.status)
        } else if settled {
            Some(Status::Converged)
        } else if stopped {
            Some(Status::Interrupted)
        } else if spring_force > spring_limit && !held {
            loose = (model.springs.iter().zip(&carried))
                .filter(|(_, carried)| carried.relative > spring_limit)
                .map(|(springs, _)| springs.body.clone())
                .collect();
            Some(Status::Stagnated)
        } else if rounds.len() >= settings.max_rounds {
            Some(Status::IterationLimit)
        } else {
            None
        };
        if let Some(status) = status {
            let mut slip = vec![0.0; m];
            whole.tangential().mul(&v, &mut slip);
            if let Some(base) = base {
                v.iter_mut().zip(base).for_each(|(v, base)| *v += base);
            }
            return Ok(StepSolution {
                status,
                u: v,
                lambda,
                slip_bound: bounds,
                slip,
                sets: solution.sets,
                first_error: (start.first_error)
                    .max(rounds.last().map_or(0.0, |round| round.info.first_error)),
                rounds,
                loose,
            });
        }
        let settling = friction_change.max(spring_force);
        tolerance = (finer * FOLLOWS * settling).clamp(tight, tolerance);
        if friction_change <= settings.friction_tolerance && spring_force <= spring_limit {
            tolerance = tight;
        }
        if !settings.accelerate {
            bounds = next;
            anchor = v;
            continue;
        }
        if flies {
            fly(model, &carried, 2f64.powi(flights as i32), &v, &mut anchor);
            bounds = next;
            anderson = Anderson::default();
            settled_from = rounds.len();
            continue;
        }
        // The fixed point of both at once; all entries are forces.
        let mut point = bounds.clone();
        let mut change = changes;
        for &(i, s) in &held_unknowns {
            let i = i as usize;
            point.push(weight * s * anchor[i]);
            change.push(weight * s * (v[i] - anchor[i]));
        }
        let point = anderson.next(&point, &change);
        bounds = point[..m].iter().map(|g| g.max(0.0)).collect();
        for (&(i, s), force) in held_unknowns.iter().zip(&point[m..]) {
            anchor[i as usize] = force / (weight * s);
        }
    }
}

/// ū: the displacement before the step, changed so that T ū leaves out what prescribed displacements slide in
/// it. None where it is zero.
fn base(t: &Csr, load: &Load, start: &State) -> Option<Vec<f64>> {
    let mut base = start.u.clone();
    let slide: Vec<f64> = (load.slide.iter().zip(&start.slide))
        .map(|(a, b)| a - b)
        .collect();
    if norm_max(&slide) > 0.0 {
        // The least w with T w = slide is Tᵀy with T Tᵀ y = slide; CG, as T Tᵀ is the identity and little more.
        let mut y = vec![0.0; slide.len()];
        let mut r = slide.clone();
        let mut p = slide.clone();
        let mut image = vec![0.0; slide.len()];
        let mut w = vec![0.0; base.len()];
        let mut rr = dot(&r, &r);
        let first = rr;
        for _ in 0..10 * slide.len() {
            if !(rr > 1e-28 * first) {
                break;
            }
            w.fill(0.0);
            t.mul_transpose_add(1.0, &p, &mut w);
            t.mul(&w, &mut image);
            let alpha = rr / dot(&p, &image);
            for i in 0..y.len() {
                y[i] += alpha * p[i];
                r[i] -= alpha * image[i];
            }
            let next = dot(&r, &r);
            let beta = next / rr;
            rr = next;
            p.iter_mut().zip(&r).for_each(|(p, r)| *p = r + beta * *p);
        }
        t.mul_transpose_add(-1.0, &y, &mut base);
    }
    (norm_max(&base) > 0.0).then_some(base)
}

/// What the springs under a body carry.
struct Carried {
    /// ‖S(u − u')‖.
    force: f64,
    /// The same over ‖Bᵀλ‖ on the same unknowns, now or before the step; 1 without contact forces.
    relative: f64,
    /// No contact forces.
    free: bool,
}

/// Anchors the springs at `v`; those of bodies without contact go on by `far` times their mean motion, so that
/// such a body comes across a gap without being stretched.
fn fly(model: &Model, carried: &[Carried], far: f64, v: &[f64], anchor: &mut [f64]) {
    for (body, carried) in model.springs.iter().zip(carried) {
        let (mut moved, mut weight) = ([0.0; 2], [0.0; 2]);
        for &(i, s) in &body.stiffness {
            let (i, c) = (i as usize, i as usize % 2);
            moved[c] += s * (v[i] - anchor[i]);
            weight[c] += s;
        }
        for &(i, _) in &body.stiffness {
            let (i, c) = (i as usize, i as usize % 2);
            anchor[i] = v[i];
            if carried.free && body.translates[c] && weight[c] > 0.0 {
                anchor[i] += far * moved[c] / weight[c];
            }
        }
    }
}

/// What the springs carry between the displacements `old`, where they are anchored, and `new`.
fn spring_forces(
    model: &Model,
    [now, before]: [&[f64]; 2],
    new: &[f64],
    old: &[f64],
) -> Vec<Carried> {
    if model.springs.is_empty() {
        return Vec::new();
    }
    let contact = |lambda: &[f64]| {
        let mut forces = vec![0.0; new.len()];
        let (normal, tangential) = lambda.split_at(model.problem.m());
        (model.problem.normal()).mul_transpose_add(1.0, normal, &mut forces);
        (model.problem.tangential()).mul_transpose_add(1.0, tangential, &mut forces);
        forces
    };
    let (now, before) = (contact(now), contact(before));
    model
        .springs
        .iter()
        .map(|body| {
            let over = |value: &dyn Fn(usize, f64) -> f64| {
                let all = body.stiffness.iter();
                norm(&all.map(|&(i, s)| value(i as usize, s)).collect::<Vec<_>>())
            };
            let force = over(&|i, s| s * (new[i] - old[i]));
            let (now, before) = (over(&|i, _| now[i]), over(&|i, _| before[i]));
            let contact = now.max(before);
            Carried {
                force,
                free: now == 0.0,
                relative: match (force > 0.0, contact > 0.0) {
                    (false, _) => 0.0,
                    (true, true) => force / contact,
                    (true, false) => 1.0,
                },
            }
        })
        .collect()
}

/// The given bounds, and μλν where there is a μ.
fn coulomb_bounds(model: &Model, lambda: &[f64]) -> Vec<f64> {
    let mut bounds = model.problem.slip_bound().to_vec();
    for ((bound, &mu), &normal) in bounds.iter_mut().zip(model.coefficient).zip(lambda) {
        if mu > 0.0 {
            *bound = mu * normal.max(0.0);
        }
    }
    bounds
}

/// Earlier pairs that Anderson's acceleration looks at.
const DEPTH: usize = 5;
/// A residual that grows by more than this starts it anew.
const WORSE: f64 = 2.0;

/// Anderson's acceleration of a fixed point iteration x ↦ x + r(x).
#[derive(Default)]
struct Anderson {
    /// Differences of successive x and r.
    steps: Vec<(Vec<f64>, Vec<f64>)>,
    last: Option<(Vec<f64>, Vec<f64>)>,
    /// The least ‖r‖ so far.
    best: Option<f64>,
}

impl Anderson {
    /// The next point from the present one and its residual.
    fn next(&mut self, x: &[f64], r: &[f64]) -> Vec<f64> {
        let size = norm(r);
        let worse = self.best.is_some_and(|best| size > WORSE * best);
        let difference =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        match self.last.take() {
            Some((old_x, old_r)) if !worse => {
                self.steps
                    .push((difference(x, &old_x), difference(r, &old_r)));
                if self.steps.len() > DEPTH {
                    self.steps.remove(0);
                }
            }
            _ => self.steps.clear(),
        }
        self.best = Some(self.best.map_or(size, |best| best.min(size)));
        self.last = Some((x.to_vec(), r.to_vec()));
        let mut next: Vec<f64> = x.iter().zip(r).map(|(x, r)| x + r).collect();
        let columns = self.steps.len();
        if columns > 0 && columns < x.len() {
            // The combination of the differences that comes closest to r.
            let matrix = faer::Mat::from_fn(x.len(), columns, |i, j| self.steps[j].1[i]);
            let mut gamma = faer::Mat::from_fn(x.len(), 1, |i, _| r[i]);
            matrix
                .col_piv_qr()
                .solve_lstsq_in_place_with_conj(faer::Conj::No, gamma.as_mut());
            let gamma: Vec<f64> = (0..columns).map(|j| gamma[(j, 0)]).collect();
            if gamma.iter().all(|g| g.is_finite() && g.abs() < 1e3) {
                for (g, (dx, dr)) in gamma.iter().zip(&self.steps) {
                    for i in 0..next.len() {
                        next[i] -= g * (dx[i] + dr[i]);
                    }
                }
            }
        }
        next
    }
}
