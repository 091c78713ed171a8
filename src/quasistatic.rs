//! Load steps and Coulomb friction: what takes several contact problems (1)–(3) in a row.
//!
//! **Load steps.** In a quasi-static process friction acts on the slip since the last step. A step is a problem
//! (1)–(3) in the whole displacement u under the whole load, with T(u − ū) in place of T u, ū the displacement
//! before: the history is in the origin of slip alone, so that nothing of an earlier, larger load is left in
//! the load or the gap of a small one.
//!
//! **Coulomb friction** bounds λτ by μλν, which is not known beforehand. The bounds are a fixed point of
//! g ↦ μλν(g), where λν(g) solves the problem with the given bounds g (Tresca): successive approximation as in
//! Nečas, Jarušek and Haslinger (1980), warm-started, with Anderson's acceleration (Walker and Ni 2011).
//!
//! **Bodies that only contact holds** have to be balanced by the forces of each round. The bounds of a round are
//! those of forces on or inside Coulomb's cones that balance the bodies, so that the round can; the forces
//! found so far are projected there. If there are no such forces, no contact can hold the bodies, and the
//! projection tells which way they are pushed.

use crate::dual::DualOperator;
use crate::dual::balance::{Balance, Nearest, cone, interval};
use crate::problem::ContactProblem;
use crate::sparse::norm;
use crate::ssnm::{self, Info, Sets, SolveError, Status};
use faer::linalg::solvers::SolveLstsqCore as _;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::time::Instant;

/// What stays the same in all steps.
#[derive(Clone, Copy, Debug)]
pub struct Model<'a> {
    /// K, N, T and the given slip bounds; load and gap are those of the steps.
    pub problem: &'a ContactProblem,
    /// μ of each contact node, length m: where it is not 0, the slip bound is μλν. Empty without Coulomb friction.
    pub coefficient: &'a [f64],
}

impl<'a> Model<'a> {
    /// A problem with given slip bounds.
    pub fn new(problem: &'a ContactProblem) -> Self {
        Self {
            problem,
            coefficient: &[],
        }
    }

    /// Whether some slip bound is μλν: a step takes more than one problem then.
    pub fn has_coulomb(&self) -> bool {
        self.coefficient.iter().any(|&mu| mu > 0.0)
    }

    /// μ of a contact node, 0 where its bound is given.
    fn mu(&self, i: usize) -> f64 {
        self.coefficient.get(i).copied().unwrap_or(0.0)
    }

    /// The given bounds, and μλν where there is a μ.
    fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        let given = self.problem.slip_bound().iter().enumerate();
        given
            .map(|(i, &given)| match self.mu(i) {
                0.0 => given,
                mu => mu * lambda[i].max(0.0),
            })
            .collect()
    }
}

/// The load at the end of a step: totals, not increments.
#[derive(Clone, Debug)]
pub struct Load {
    /// f, as long as K has rows.
    pub force: Vec<f64>,
    /// ‖f‖ without what prescribed displacements add to it: the forces that act.
    pub acting: f64,
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
            acting: norm(problem.load()),
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
}

impl State {
    /// Nothing has happened yet.
    pub fn at_rest(problem: &ContactProblem) -> Self {
        Self {
            u: vec![0.0; problem.stiffness().n_rows()],
            lambda: vec![0.0; 2 * problem.m()],
            slide: vec![0.0; problem.m()],
        }
    }
}

/// Settings of the rounds.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// Those of each problem; `initial`, `place` and `first_error` are ignored.
    pub ssnm: ssnm::Settings<'a>,
    /// ‖μλν − g‖ / ‖μλν‖ to reach; ten times the tolerance of the problems if None.
    pub friction_tolerance: Option<f64>,
    /// Rounds at most.
    pub max_rounds: usize,
    /// Whether the fixed point is accelerated.
    pub accelerate: bool,
}

impl Settings<'_> {
    /// ‖μλν − g‖ / ‖μλν‖ to reach.
    pub fn friction_tolerance(&self) -> f64 {
        self.friction_tolerance
            .unwrap_or(FRICTION * self.ssnm.tolerance)
    }
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Self {
            ssnm: ssnm::Settings::default(),
            friction_tolerance: None,
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

/// A body that contact and friction do not hold.
#[derive(Clone, Debug, PartialEq)]
pub struct NotHeld {
    /// Its number among [`ContactProblem::free_bodies`].
    pub body: usize,
    /// Which way the loads push it, in words.
    pub motion: String,
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
    /// The bodies that nothing holds, where the status says so.
    pub not_held: Vec<NotHeld>,
}

impl StepSolution {
    /// Where the next step starts from.
    pub fn state(&self, load: &Load) -> State {
        State {
            u: self.u.clone(),
            lambda: self.lambda.clone(),
            slide: load.slide.clone(),
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

/// The tolerance of the slip bounds, relative to that of the problems.
const FRICTION: f64 = 10.0;
/// The tolerance of the problem of a round beside the change of the slip bounds in the round before.
const FOLLOWS: f64 = 1e-3;
/// The same of the first rounds.
const FIRST_TOLERANCE: f64 = 1e-3;
/// The part of the friction tolerance that the last problem may be off by.
const RESOLVED: f64 = 0.1;
/// A body counts as pushed if this part of the largest imbalance is its own.
const PUSHED: f64 = 1e-3;

/// Solves one load step from `start`; the operator belongs to `model.problem`.
///
/// A model without Coulomb friction takes one problem, otherwise rounds follow until the slip bounds have
/// settled. A step that does not get there ends with the [`Status`] of the round that failed, or
/// [`Status::IterationLimit`] after too many of them.
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
    let coulomb = model.has_coulomb();
    let friction_tolerance = settings.friction_tolerance();
    let tight = if coulomb {
        (settings.ssnm.tolerance).min(RESOLVED * friction_tolerance)
    } else {
        settings.ssnm.tolerance
    };

    // T u in this step is counted from T ū, less what prescribed displacements slide meanwhile.
    let mut origin = vec![0.0; m];
    whole.tangential().mul(&start.u, &mut origin);
    for i in 0..m {
        origin[i] -= load.slide[i] - start.slide[i];
    }
    let place = whole.free_bodies().resultants(&start.u);

    let cones = Cones::new(model, load);
    let mut lambda = start.lambda.clone();
    let mut bounds = cones.bounds(&lambda);
    let mut anderson = Anderson::default();
    let mut rounds: Vec<Round> = Vec::new();
    let mut sigma = settings.ssnm.sigma_max;
    let mut first_error = None;
    let of_this_step = RefCell::default();
    let memory = settings.ssnm.memory.unwrap_or(&of_this_step);
    let mut tolerance = if coulomb {
        tight.max(FIRST_TOLERANCE)
    } else {
        tight
    };
    loop {
        let problem = whole
            .with_data(
                load.force.clone(),
                load.gap.clone(),
                origin.clone(),
                bounds.clone(),
            )
            .with_acting_forces(load.acting);
        let mut stopped = false;
        let solution = ssnm::solve(
            &problem,
            dual,
            &ssnm::Settings {
                tolerance,
                initial: Some(&lambda),
                place: Some(&place),
                sigma_max: sigma,
                first_error,
                memory: Some(memory),
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
        first_error = Some(solution.info.first_error);
        lambda = solution.lambda;

        // The law is μλν; where that could not balance the bodies, the next round tries other bounds.
        let law = model.bounds(&lambda);
        let next = cones.bounds(&lambda);
        let changes = difference(&next, &bounds);
        let friction: f64 = (0..m)
            .filter(|&i| model.mu(i) > 0.0)
            .map(|i| law[i] * law[i])
            .sum::<f64>()
            .sqrt();
        let relative = |change: f64| match change {
            0.0 => 0.0,
            change if friction > 0.0 => change / friction,
            _ => 1.0,
        };
        let friction_change = relative(norm(&difference(&law, &bounds)));
        let step = relative(norm(&changes));
        let settled = step <= friction_tolerance && tolerance <= tight;
        rounds.push(Round {
            round: rounds.len() + 1,
            friction_change,
            tolerance,
            info: solution.info,
        });
        if coulomb {
            stopped |= observer(Event::Round(rounds.last().expect("just pushed"))).is_break();
        }
        let mut unbalanced = solution.imbalance;
        if unbalanced.is_empty() {
            unbalanced.clone_from(&cones.imbalance);
        }
        if unbalanced.is_empty() && settled && friction_change > friction_tolerance {
            // Bounds that balance the bodies have settled, but the pressures do not give them.
            unbalanced = cones.imbalance_within(&law, &lambda);
        }
        let status = if solution.status != Status::Converged {
            Some(solution.status)
        } else if !unbalanced.is_empty() {
            Some(Status::NotHeld)
        } else if friction_change <= friction_tolerance && tolerance <= tight {
            Some(Status::Converged)
        } else if settled && norm(&changes) == 0.0 {
            // The next round would be the same.
            Some(Status::Stagnated)
        } else if stopped {
            Some(Status::Interrupted)
        } else if rounds.len() >= settings.max_rounds {
            Some(Status::IterationLimit)
        } else {
            None
        };
        if let Some(status) = status {
            let mut slip = vec![0.0; m];
            whole.tangential().mul(&solution.u, &mut slip);
            slip.iter_mut().zip(origin).for_each(|(s, o)| *s -= o);
            return Ok(StepSolution {
                status,
                u: solution.u,
                lambda,
                slip_bound: bounds,
                slip,
                sets: solution.sets,
                rounds,
                not_held: pushed(whole, &unbalanced),
            });
        }
        tolerance = (FOLLOWS * step).clamp(tight, tolerance);
        if step <= friction_tolerance {
            tolerance = tight;
        }
        bounds = if settings.accelerate {
            cones.admissible(&anderson.next(&bounds, &changes), &lambda)
        } else {
            next
        };
    }
}

/// a − b.
fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// The bodies that an imbalance pushes, and which way.
fn pushed(problem: &ContactProblem, imbalance: &[f64]) -> Vec<NotHeld> {
    if imbalance.is_empty() {
        return Vec::new();
    }
    let all = norm(imbalance);
    let bodies = problem.free_bodies().parts(imbalance).enumerate();
    bodies
        .filter(|(_, (_, part))| norm(part) > PUSHED * all)
        .map(|(body, (free, part))| NotHeld {
            body,
            motion: free.describe(part),
        })
        .collect()
}

/// The slip bounds under which forces can balance the bodies that only contact holds.
struct Cones<'a> {
    model: &'a Model<'a>,
    /// Where there are such bodies and Coulomb friction.
    balance: Option<Balance>,
    /// What no forces on the cones can balance; empty where all is well.
    imbalance: Vec<f64>,
}

impl<'a> Cones<'a> {
    fn new(model: &'a Model<'a>, load: &Load) -> Self {
        let problem = model.problem;
        let free = problem.free_bodies();
        let mut cones = Self {
            model,
            balance: None,
            imbalance: Vec::new(),
        };
        if free.is_empty() || !model.has_coulomb() {
            return cones;
        }
        let b = problem.contact_matrix();
        let mut balance = Balance::new(free, &b, &load.force, |_| 1.0);
        let near = cones.nearest(&balance, &vec![0.0; 2 * problem.m()]);
        if !near.balanced {
            balance.give_up(&near.imbalance);
            cones.imbalance = near.imbalance;
        }
        cones.balance = Some(balance);
        cones
    }

    fn nearest(&self, balance: &Balance, lambda: &[f64]) -> Nearest {
        let given = self.model.problem.slip_bound();
        balance.nearest(lambda, |i, z| match self.model.mu(i) {
            0.0 => interval(given[i], z),
            mu => cone(mu, z),
        })
    }

    /// What forces within the given bounds cannot balance; empty where they can.
    fn imbalance_within(&self, bounds: &[f64], lambda: &[f64]) -> Vec<f64> {
        let Some(balance) = &self.balance else {
            return Vec::new();
        };
        let near = balance.nearest(lambda, |i, z| interval(bounds[i], z));
        if near.balanced {
            Vec::new()
        } else {
            near.imbalance
        }
    }

    /// The bounds of the forces λ, or of the nearest ones that balance the bodies.
    fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        match &self.balance {
            None => self.model.bounds(lambda),
            Some(balance) => self.model.bounds(&self.nearest(balance, lambda).lambda),
        }
    }

    /// Bounds close to `bounds`, under which forces like λ can balance the bodies.
    fn admissible(&self, bounds: &[f64], lambda: &[f64]) -> Vec<f64> {
        if self.balance.is_none() {
            return bounds.iter().map(|g| g.max(0.0)).collect();
        }
        let mut wanted = lambda.to_vec();
        for (i, &bound) in bounds.iter().enumerate() {
            let mu = self.model.mu(i);
            if mu > 0.0 {
                wanted[i] = (bound / mu).max(0.0);
            }
        }
        self.bounds(&wanted)
    }
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
