//! The semi-smooth Newton method in dual form: Algorithms SSNM and ISSNM of the paper, with a safeguard.
//!
//! The contact problem (1)–(3) is the minimisation of q(λ) = ½ λᵀAλ − λᵀb (8) over
//! Λ = {λν ≥ 0, |λτ| ≤ g}. Each outer step predicts the active sets from λ − ρr (Step 2), minimises q
//! with the inactive multipliers on their bounds by conjugate gradients (Step 3), and measures the
//! reduced gradient (10) at the projection of the result (Step 3.4).
//!
//! Five things go beyond the text of the paper, none of which changes the limit:
//!
//! - **Products are carried.** r = Aλ − b is updated along with λ, so a product with A is spent only on
//!   a direction of CG, on the jump of the multipliers that change to a bound, and on P_Λ(λ) − λ. Where
//!   products are a matter of iterations they are as accurate as need be (`products`).
//! - **CG is continued, not restarted,** where the next step has the same sets, and it is cut short once
//!   its residual is below a part of the last error and the sets that it would lead to have changed.
//! - **Multipliers are scaled** where the stiffness under the contact varies by more than a factor of four.
//! - **Known products are used again.** All directions with a known product span a subspace; its part that
//!   vanishes on the held multipliers is minimised over for nothing before CG starts on new sets.
//! - **The safeguard.** The iterates are feasible and the change of q between them is known for nothing.
//!   Steps that lower neither the best q nor the best error are discarded: from the best point a
//!   projected gradient step with ρ = 1/σ_max < 2/σ_max lowers q by at least a fixed part of ‖r̃‖²
//!   (Kučera 2008, reference 2 of the paper), minimising over the face of Λ reached lowers it further,
//!   and the set prediction uses no more than that ρ from then on. Each time it acts it stays for twice
//!   as many steps, hence q decreases to its minimum whatever β was.

mod products;
mod scaling;
mod sets;
mod subspace;

pub use sets::{SetSizes, Sets};

use crate::dual::{DualError, DualOperator, Stop, Stopped};
use crate::problem::{ContactProblem, Kkt, slip_violation};
use crate::sparse::{dot, norm};
use products::Products;
use scaling::Scaled;
use std::ops::ControlFlow;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use subspace::Subspace;

/// How exactly the inner problems (11) are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Algorithm ISSNM: to a tolerance that follows the error.
    #[default]
    Inexact,
    /// Algorithm SSNM: to rounding, as far as CG gets.
    Exact,
}

/// Settings of the method; the defaults are those of the case file.
#[derive(Clone, Copy, Debug)]
pub struct Settings<'a> {
    /// ε: the error err = ‖r̃_ρ(P_Λ(λ))‖ to reach, relative to err⁰ at λ = 0.
    pub tolerance: f64,
    /// β: ρ = β / σ_max.
    pub beta: f64,
    /// r_tol of Step 3.1, in (0, 1).
    pub r_tol: f64,
    /// c_fact of Step 3.1, in (0, 1).
    pub c_fact: f64,
    /// Inexact (ISSNM) or exact (SSNM) inner solves.
    pub method: Method,
    /// Outer steps at most.
    pub max_iterations: usize,
    /// Wall time at most.
    pub time_limit: Option<Duration>,
    /// λ⁰, length 2m, e.g. the multipliers of an earlier solve; zero if None.
    pub initial: Option<&'a [f64]>,
    /// σ_max as an earlier solve with the same A has found it ([`Info::sigma_max`]); estimated if None.
    pub sigma_max: Option<f64>,
    /// err⁰ counts as this at least; 0 where nothing is known of what errors are small.
    pub least_error: f64,
    /// Set from outside to stop at the next product with A.
    pub interrupt: Option<&'a AtomicBool>,
}

impl Default for Settings<'_> {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            beta: 1.0,
            r_tol: 0.1,
            c_fact: 0.9,
            method: Method::Inexact,
            max_iterations: 100,
            time_limit: None,
            initial: None,
            sigma_max: None,
            least_error: 0.0,
            interrupt: None,
        }
    }
}

/// How a solve ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// err ≤ ε err⁰, and the optimality conditions checked in f64 against K are met to 10 ε.
    Converged,
    /// `max_iterations` reached.
    IterationLimit,
    /// Rounding keeps q from decreasing any further: the tolerance is below what f64 can give here.
    Stagnated,
    /// `time_limit` reached.
    TimeLimit,
    /// Stopped from outside.
    Interrupted,
}

impl From<Stopped> for Status {
    fn from(stopped: Stopped) -> Self {
        match stopped {
            Stopped::TimeLimit => Self::TimeLimit,
            Stopped::Interrupted => Self::Interrupted,
        }
    }
}

/// A solve that could not be finished, with what it had reached.
#[derive(Debug, thiserror::Error)]
#[error("{error}")]
pub struct SolveError {
    /// What went wrong.
    pub error: DualError,
    /// λ after the last outer step: a start for another solve ([`Settings::initial`]).
    pub lambda: Vec<f64>,
    /// The outer steps made.
    pub history: Vec<Step>,
}

/// One outer step, as the observer sees it and the report lists it.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Step {
    /// Number of the step, from 1.
    pub iter: usize,
    /// CG iterations in it.
    pub inner: usize,
    /// Products with A since the start.
    #[serde(rename = "n_A")]
    pub n_a: usize,
    /// err / err⁰ after it.
    pub err: f64,
    /// Sizes of the sets it worked with.
    pub sets: SetSizes,
    /// Multipliers that changed their set since the step before.
    pub changes: usize,
    /// Whether the safeguard replaced the Newton step.
    pub safeguarded: bool,
}

/// Figures of a solve.
#[derive(Clone, Debug)]
pub struct Info {
    /// Outer steps.
    pub iter: usize,
    /// Products with A inside the method.
    pub n_a: usize,
    /// `iter` and `n_a` where err ≤ ε err⁰ held first: the paper's stopping test, before the optimality
    /// conditions were checked.
    pub first_met: Option<(usize, usize)>,
    /// Products spent on the estimate of σ_max.
    pub n_a_sigma: usize,
    /// ρ = β / σ_max.
    pub rho: f64,
    /// The estimate of σ_max.
    pub sigma_max: f64,
    /// err⁰, not relative to anything.
    pub first_error: f64,
    /// err / err⁰ at the end.
    pub err_relative: f64,
    /// The optimality conditions at the end.
    pub kkt: Kkt,
    /// A row per outer step.
    pub history: Vec<Step>,
    /// Seconds for b and σ_max.
    pub setup_seconds: f64,
    /// Seconds for the outer steps and the final check.
    pub solve_seconds: f64,
}

/// The result of a solve; after a stop without convergence, the best point found.
#[derive(Clone, Debug)]
pub struct Solution {
    /// How it ended.
    pub status: Status,
    /// u, as long as K has rows.
    pub u: Vec<f64>,
    /// λ = (λν, λτ) ∈ Λ, length 2m.
    pub lambda: Vec<f64>,
    /// The sets at the end.
    pub sets: Sets,
    /// Figures.
    pub info: Info,
}

/// Newton steps in a row without progress in q or err before the safeguard acts.
const FRUITLESS: usize = 3;
/// The part of α‖r̃_α‖² by which a step has to lower q to count as progress; a projected gradient step
/// gains at least half of it.
const GAIN: f64 = 0.05;
/// The residual of the inner problems in Algorithm SSNM, relative to err⁰.
const EXACT: f64 = 1e-12;
/// Faces of Λ that a safeguarded step may visit: one at first, four times as many each time that the
/// safeguard has to act again, up to this.
const MAX_FACES: usize = 64;
/// The accuracy of a final check after one that failed, relative to before, at most and at least: where a
/// stiff body is moved, ‖f‖ says little about the loads of a soft one, and u may be far off.
const TIGHTER: f64 = 0.1;
const LEAP: f64 = 1e-3;
/// A final check is not made more accurate than this.
const FINEST: f64 = 1e-13;
/// CG with inexact products ends where its residual has grown by this factor.
const GROWN: f64 = 10.0;
/// Relative residual for the displacement of a solve that has ended without convergence.
const ROUGH: f64 = 1e-4;
/// CG may stop early, on sets that have changed, once its residual is below this part of err.
const SETS_CHANGED: f64 = 0.3;

/// Solves the problem with the given dual operator.
///
/// `observer` is called after every outer step and may stop the solve.
///
/// # Errors
/// If the operator fails; the error keeps λ. To be stopped or not to converge is no error but a [`Status`].
///
/// # Panics
/// If `initial` is given with a length other than 2m.
pub fn solve(
    problem: &ContactProblem,
    dual: &mut (impl DualOperator + ?Sized),
    settings: &Settings,
    mut observer: impl FnMut(&Step) -> ControlFlow<()>,
) -> Result<Solution, SolveError> {
    let start = Instant::now();
    let len = 2 * problem.m();
    let stop = Stop {
        deadline: settings.time_limit.map(|limit| start + limit),
        interrupt: settings.interrupt,
    };
    let exact = settings.method == Method::Exact;
    let dual = Scaled::new(problem, dual);
    let g = dual.slip_bound(problem.slip_bound());
    let mut c = problem.gap().to_vec();
    c.resize(len, 0.0);
    dual.times(&mut c);
    let mut products = Products::new(dual, exact, stop);
    let set_up = products.set_up(c, settings.sigma_max);
    let setup_seconds = start.elapsed().as_secs_f64();
    let mut failure = None;
    let (b, n_a_sigma) = set_up.unwrap_or_else(|error| {
        failure = Some(error);
        (vec![0.0; len], 0)
    });
    // Without contact, or with a B that K makes infinitely stiff, any ρ will do.
    let alpha = if products.sigma > 0.0 {
        1.0 / products.sigma
    } else {
        1.0
    };
    let mut newton = Newton {
        problem,
        g: &g,
        b,
        rho: settings.beta * alpha,
        alpha,
        products,
        checked: None,
        check_accuracy: settings.tolerance,
    };
    let mut point = newton.origin();
    // err⁰ at λ = 0 even for a warm start: a good start must not make the same tolerance harder.
    let first_error = newton.error(&point);
    let err0 = first_error.max(settings.least_error);
    let level = settings.tolerance.min(if exact { EXACT } else { 1.0 });
    newton.products.aim_at(level * err0);
    newton.products.allow(err0);
    let mut history: Vec<Step> = Vec::new();
    let mut first_met = None;
    let outcome = match failure {
        Some(error) => Err(error),
        None => newton
            .start(settings.initial)
            .map(|first| point = first)
            .and_then(|()| {
                newton.run(
                    &mut point,
                    err0,
                    settings,
                    &mut history,
                    &mut observer,
                    |newton, point, goal, iter| {
                        first_met.get_or_insert((iter, newton.products.n_a));
                        newton.verify(point, goal, err0, settings.tolerance)
                    },
                )
            }),
    };
    let (status, checked) = match outcome {
        Ok(status) => (status, newton.checked.take()),
        Err(DualError::Stopped(stopped)) => (stopped.into(), None),
        Err(error) => return Err(newton.failed(error, point, history)),
    };
    let (u, kkt) = match checked {
        Some(checked) => checked,
        // Whoever has asked to stop does not wait for more than a picture.
        None => match newton.displacement(&point, ROUGH, Stop::default()) {
            Ok(u) => {
                let kkt = newton.optimality(&point, &u);
                (u, kkt)
            }
            Err(error) => return Err(newton.failed(error, point, history)),
        },
    };
    let sets = Sets::at_solution(&point.lambda, &point.r, newton.g);
    let info = Info {
        iter: history.len(),
        n_a: newton.products.n_a,
        first_met,
        n_a_sigma,
        rho: newton.rho,
        sigma_max: newton.products.sigma,
        first_error,
        err_relative: if err0 > 0.0 {
            newton.error(&point) / err0
        } else {
            0.0
        },
        kkt,
        history,
        setup_seconds,
        solve_seconds: start.elapsed().as_secs_f64() - setup_seconds,
    };
    let mut lambda = point.lambda;
    newton.products.dual.times(&mut lambda);
    Ok(Solution {
        status,
        u,
        lambda,
        sets,
        info,
    })
}

/// What a point has to meet before the final check is worth its price.
struct Goal {
    /// err at most.
    err: f64,
    /// Penetration, and slip where there should be none, at most; known after the first check.
    slack: f64,
    /// |λνᵀ(Nu − d)| / ‖λ‖ at most; likewise.
    work: f64,
    /// Final checks that failed.
    checks: usize,
}

impl Goal {
    /// Whether a point with gradient r (not scaled) and error err meets it. Written so that NaN never passes.
    fn met(&self, lambda: &[f64], r: &[f64], err: f64, g: &[f64]) -> bool {
        if !(err <= self.err) {
            return false;
        }
        if self.checks == 0 {
            return true;
        }
        let m = g.len();
        let (ln, lt) = lambda.split_at(m);
        let (rn, rt) = r.split_at(m);
        let penetration = rn.iter().fold(0.0, |acc: f64, r| acc.max(-r));
        let slip = (0..m).fold(0.0, |acc: f64, i| {
            acc.max(slip_violation(lt[i], -rt[i], g[i]))
        });
        let length = norm(lambda);
        penetration.max(slip) <= self.slack
            && (length == 0.0 || dot(ln, rn).abs() / length <= self.work)
    }
}

/// λ with its gradient r = Aλ − b.
#[derive(Clone)]
struct Point {
    lambda: Vec<f64>,
    r: Vec<f64>,
}

impl Point {
    /// q(to) − q(self) = ½ (λ' − λ)ᵀ(r + r'): free of the cancellation of a difference.
    fn q_change(&self, to: &Self) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.r.len() {
            sum += (to.lambda[i] - self.lambda[i]) * (self.r[i] + to.r[i]);
        }
        0.5 * sum
    }

    /// The point of lowest q between this one and `end`.
    fn lowest_towards(&self, end: &Self) -> Self {
        let (mut slope, mut curvature) = (0.0, 0.0);
        for i in 0..self.r.len() {
            let step = end.lambda[i] - self.lambda[i];
            slope += step * self.r[i];
            curvature += step * (end.r[i] - self.r[i]);
        }
        let t = if curvature > 0.0 {
            (-slope / curvature).clamp(0.0, 1.0)
        } else {
            0.0
        };
        if t == 1.0 {
            return end.clone();
        }
        let between =
            |y: &[f64], z: &[f64]| y.iter().zip(z).map(|(y, z)| y + t * (z - y)).collect();
        Self {
            lambda: between(&self.lambda, &end.lambda),
            r: between(&self.r, &end.r),
        }
    }

    /// From this point of Λ towards `end` as far as Λ goes; what stops there lies exactly on its bound.
    fn until_bound(&self, end: &Self, g: &[f64]) -> Self {
        let m = g.len();
        let bounds = |i: usize| {
            if i < m {
                (0.0, f64::INFINITY)
            } else {
                (-g[i - m], g[i - m])
            }
        };
        let reach = |i: usize| {
            let step = end.lambda[i] - self.lambda[i];
            let (low, high) = bounds(i);
            let room = if step < 0.0 {
                low - self.lambda[i]
            } else {
                high - self.lambda[i]
            };
            if step == 0.0 {
                f64::INFINITY
            } else {
                (room / step).max(0.0)
            }
        };
        let t = (0..self.r.len()).map(reach).fold(1.0, f64::min);
        let between = |y: &[f64], z: &[f64]| -> Vec<f64> {
            y.iter().zip(z).map(|(y, z)| y + t * (z - y)).collect()
        };
        let mut cut = Self {
            lambda: between(&self.lambda, &end.lambda),
            r: between(&self.r, &end.r),
        };
        for (i, l) in cut.lambda.iter_mut().enumerate() {
            let (low, high) = bounds(i);
            if reach(i) <= t {
                *l = if end.lambda[i] < self.lambda[i] {
                    low
                } else {
                    high
                };
            }
            *l = l.clamp(low, high);
        }
        cut
    }
}

/// The conjugate gradient iteration on a free set, kept from one outer step to the next.
struct Cg {
    sets: Sets,
    /// Known directions on the free set: recycled ones, then those of this iteration.
    span: Subspace,
}

/// The state that all steps share.
struct Newton<'a, D: ?Sized> {
    problem: &'a ContactProblem,
    g: &'a [f64],
    b: Vec<f64>,
    /// ρ = β/σ_max: of the error, and of the sets until the safeguard has acted.
    rho: f64,
    /// The length of safeguarding projected gradient steps, < 2/σ_max.
    alpha: f64,
    products: Products<'a, D>,
    /// u and the optimality conditions of the last final check.
    checked: Option<(Vec<f64>, Kkt)>,
    /// ‖f − Bᵀλ − Ku‖ / ‖f‖ in the final check.
    check_accuracy: f64,
}

impl<D: DualOperator + ?Sized> Newton<'_, D> {
    /// r at a point made afresh, where it is not exact anyhow.
    fn refresh(&mut self, point: &mut Point) -> Result<bool, DualError> {
        if self.products.are_exact() {
            return Ok(false);
        }
        let Point { lambda, r } = point;
        let (g, rho) = (self.g, self.rho);
        let made =
            (self.products).refresh(lambda, r, |r| norm(&reduced_gradient(lambda, r, rho, g)))?;
        if !made {
            // A GPU has failed in between and products are exact from now on, but nothing known so far is.
            let u = self.displacement(point, EXACT, self.products.stop)?;
            self.take_from(&u, point);
            self.products.n_a += 1;
        }
        Ok(true)
    }

    /// λ = 0, where r = −b.
    fn origin(&self) -> Point {
        Point {
            lambda: vec![0.0; self.b.len()],
            r: self.b.iter().map(|b| -b).collect(),
        }
    }

    /// λ⁰ projected on Λ, and r there.
    fn start(&mut self, initial: Option<&[f64]>) -> Result<Point, DualError> {
        let mut point = self.origin();
        if let Some(initial) = initial {
            assert_eq!(initial.len(), self.b.len(), "λ⁰ needs 2m entries");
            let mut target = initial.to_vec();
            self.products.dual.divide(&mut target);
            project(&mut target, self.g);
            self.move_to(&mut point, target)?;
        }
        Ok(point)
    }

    /// Moves to λ = `target`, and r with it: one product, or none if it is there already.
    fn move_to(&mut self, point: &mut Point, target: Vec<f64>) -> Result<bool, DualError> {
        let jump: Vec<f64> = target
            .iter()
            .zip(&point.lambda)
            .map(|(t, l)| t - l)
            .collect();
        if jump.iter().all(|&v| v == 0.0) {
            return Ok(false);
        }
        point.lambda = target;
        if !self.products.carry(&jump, &mut point.r)? {
            self.refresh(point)?;
        }
        Ok(true)
    }

    /// err = ‖r̃_ρ(λ)‖, the reduced gradient (10) at a point of Λ.
    fn error(&self, point: &Point) -> f64 {
        norm(&reduced_gradient(&point.lambda, &point.r, self.rho, self.g))
    }

    /// Replaces r by what the displacement says: d − Nu and −Tu.
    fn take_from(&mut self, u: &[f64], point: &mut Point) {
        let problem = self.problem;
        let (rn, rt) = point.r.split_at_mut(problem.m());
        problem.normal().mul(u, rn);
        problem.tangential().mul(u, rt);
        rn.iter_mut()
            .zip(problem.gap())
            .for_each(|(r, d)| *r = d - *r);
        rt.iter_mut().for_each(|r| *r = -*r);
        self.products.dual.times(&mut point.r);
        self.products.checked(&point.r);
    }

    /// u at a point.
    fn displacement(
        &mut self,
        point: &Point,
        accuracy: f64,
        stop: Stop,
    ) -> Result<Vec<f64>, DualError> {
        (self.products.dual).displacement(&point.lambda, accuracy, &stop)
    }

    /// The optimality conditions at a point.
    fn optimality(&self, point: &Point, u: &[f64]) -> Kkt {
        let mut lambda = point.lambda.clone();
        self.products.dual.times(&mut lambda);
        self.problem.kkt(u, &lambda)
    }

    fn failed(&self, error: DualError, mut point: Point, history: Vec<Step>) -> SolveError {
        self.products.dual.times(&mut point.lambda);
        SolveError {
            error,
            lambda: point.lambda,
            history,
        }
    }

    /// Whether a point meets the goal, in the units of the problem.
    fn meets(&self, goal: &Goal, point: &Point, err: f64) -> bool {
        let (mut lambda, mut r, mut g) = (point.lambda.clone(), point.r.clone(), point.r.clone());
        self.products.dual.times(&mut lambda);
        self.products.dual.divide(&mut r);
        let m = self.g.len();
        g[m..].copy_from_slice(self.g);
        self.products.dual.times(&mut g);
        goal.met(&lambda, &r, err, &g[m..])
    }

    /// The final check, with what the displacement says instead of the carried r: Converged, Stagnated, or
    /// None if the goal has to be closer.
    fn verify(
        &mut self,
        point: &mut Point,
        goal: &mut Goal,
        err0: f64,
        tolerance: f64,
    ) -> Result<Option<Status>, DualError> {
        let u = self.displacement(point, self.check_accuracy, self.products.stop)?;
        let kkt = self.optimality(point, &u);
        self.take_from(&u, point);
        let err = self.error(point);
        // Equilibrium does not depend on λ: no further step can mend it. A goal that was met again and
        // again and still fails the check is at the limit of rounding.
        let status = if err <= tolerance * err0 * (1.0 + 1e-6) && kkt.max() <= 10.0 * tolerance {
            Status::Converged
        } else if !(kkt.equilibrium <= 10.0 * tolerance) || goal.checks >= 5 {
            Status::Stagnated
        } else {
            // An err that is not met was a matter of the accuracy of u: the next check has a better one.
            if err <= goal.err || self.check_accuracy < FINEST {
                goal.checks += 1;
            }
            let (largest, length) = self.problem.sizes(&u);
            goal.slack = 9.0 * tolerance * largest;
            goal.work = 9.0 * tolerance * length;
            return Ok(None);
        };
        self.checked = Some((u, kkt));
        Ok(Some(status))
    }

    /// Outer steps until `verify` is content with a point that meets the goal, or a reason to stop.
    fn run(
        &mut self,
        point: &mut Point,
        err0: f64,
        settings: &Settings,
        history: &mut Vec<Step>,
        observer: &mut impl FnMut(&Step) -> ControlFlow<()>,
        mut verify: impl FnMut(
            &mut Self,
            &mut Point,
            &mut Goal,
            usize,
        ) -> Result<Option<Status>, DualError>,
    ) -> Result<Status, DualError> {
        let mut goal = Goal {
            err: settings.tolerance * err0,
            slack: f64::INFINITY,
            work: f64::INFINITY,
            checks: 0,
        };
        let mut err = self.error(point);
        // Step 3.1 starts from tol⁰ = r_tol / c_fact.
        let mut tol = settings.r_tol / settings.c_fact;
        let mut cg: Option<Cg> = None;
        let mut previous: Option<Sets> = None;
        let mut set_rho = self.rho;
        // The point of lowest q, and what it took to find a better one.
        let (mut best, mut best_err) = (point.clone(), err);
        let first = point.clone();
        let mut fruitless = 0;
        // Safeguarded steps still to make, and how many the next discarded steps will cost.
        let (mut guarded, mut penalty, mut faces) = (0usize, 1usize, 0usize);
        loop {
            self.products.allow(err);
            // Step 1.
            if self.meets(&goal, point, err) {
                if let Some(status) = verify(self, point, &mut goal, history.len())? {
                    return Ok(status);
                }
                // r is fresh now. Where it had drifted, so have the images of the known directions.
                err = self.error(point);
                if err > goal.err {
                    self.products.sharpen();
                    self.products.known = Subspace::default();
                } else {
                    // What is left to do lies below the error that products were to resolve.
                    self.products.aim_at(TIGHTER * self.products.level());
                }
                self.check_accuracy *= (goal.err / err).clamp(LEAP, TIGHTER);
                best = point.clone();
                cg = None;
                continue;
            }
            let stop = self.products.stop.now();
            if stop.is_some() || history.len() >= settings.max_iterations {
                *point = best;
                return Ok(stop.map_or(Status::IterationLimit, Status::from));
            }
            tol = (settings.r_tol * err / err0).min(settings.c_fact * tol);
            let target = match settings.method {
                Method::Inexact => tol * err0,
                Method::Exact => EXACT * err0,
            };
            let safeguarded = guarded > 0;
            let made = if safeguarded {
                guarded -= 1;
                self.safeguarded_step(point, target, err, faces)
            } else {
                self.newton_step(point, &mut cg, set_rho, target, err, settings.method)
            };
            let (sets, inner) = match made {
                Ok(step) => step,
                Err(error) => {
                    // In the middle of a step the point need not be feasible.
                    *point = best;
                    return Err(error);
                }
            };
            err = self.error(point);
            history.push(Step {
                iter: history.len() + 1,
                inner,
                n_a: self.products.n_a,
                err: err / err0,
                sets: sets.sizes(),
                changes: previous.map_or(0, |old| old.differences(&sets)),
                safeguarded,
            });
            previous = Some(sets);
            let stopped = observer(history.last().expect("just pushed")).is_break();

            // Progress is a real part of what a projected gradient step from the best point would gain,
            // or a clearly smaller error: rounding must not pass for it.
            let lost = best.q_change(point);
            let least = self.alpha
                * norm(&reduced_gradient(&best.lambda, &best.r, self.alpha, self.g)).powi(2);
            let progress = -lost >= GAIN * least && lost < 0.0 || err <= 0.9 * best_err;
            if progress {
                fruitless = 0;
            } else {
                fruitless += 1;
            }
            best_err = best_err.min(err);
            if stopped {
                if !(lost < 0.0) {
                    *point = best;
                }
                return Ok(Status::Interrupted);
            }
            // More than half of all progress lost counts at once. Written so that NaN does, too.
            let gained = -first.q_change(&best);
            if lost < 0.0 {
                best = point.clone();
            }
            if fruitless >= FRUITLESS || (safeguarded && fruitless > 0) || !(lost <= 0.5 * gained) {
                *point = best.clone();
                err = self.error(point);
                // It may have been for want of accuracy.
                let sharpened = self.products.sharpen();
                if sharpened {
                    self.products.allow(err);
                    self.refresh(point)?;
                    err = self.error(point);
                    best = point.clone();
                } else if safeguarded {
                    // Not even a projected gradient step lowers q or the error: rounding.
                    return Ok(Status::Stagnated);
                }
                best_err = err;
                fruitless = 0;
                cg = None;
                set_rho = set_rho.min(self.alpha);
                guarded = penalty;
                penalty *= 2;
                faces = (4 * faces).clamp(1, MAX_FACES);
            }
        }
    }

    /// Steps 2 and 3 of the paper, then P_Λ: afterwards `point` is feasible.
    fn newton_step(
        &mut self,
        point: &mut Point,
        kept: &mut Option<Cg>,
        rho: f64,
        target: f64,
        err: f64,
        method: Method,
    ) -> Result<(Sets, usize), DualError> {
        let sets = Sets::predict(&point.lambda, &point.r, rho, self.g);
        // Step 3.2: inactive multipliers on their bounds.
        let mut start = point.lambda.clone();
        sets.set_bounds(&mut start, self.g);
        let jumped = self.move_to(point, start)?;
        let mut cg = match kept.take() {
            Some(cg) if !jumped && cg.sets == sets => cg,
            _ => self.cg_on(sets.clone(), point),
        };
        // Step 3.3.
        let floor = match method {
            Method::Inexact => Some(SETS_CHANGED * err),
            Method::Exact => None,
        };
        let inner = self.cg(point, &mut cg, target, |newton, point, residual| {
            floor.is_some_and(|floor| residual <= floor)
                && Sets::predict(&point.lambda, &point.r, rho, newton.g) != sets
        })?;
        // Step 3.4 takes the error at a point of Λ, and the next step goes on from there.
        if !self.move_into_bounds(point, rho)? {
            let err = self.error(point);
            self.products.allow(err);
            if self.products.has_drifted() {
                self.refresh(point)?;
            }
            *kept = Some(cg);
        }
        Ok((sets, inner))
    }

    /// Starts CG on the free multipliers of `sets` from the minimum over the known directions there.
    fn cg_on(&self, sets: Sets, point: &mut Point) -> Cg {
        let span = self.products.known.fitting(&sets);
        span.minimise(&mut point.lambda, &mut point.r);
        Cg { sets, span }
    }

    /// CGM(A, b, 𝒜, λ, tol): minimises q over the free multipliers until ‖r‖ there is at most `target`
    /// or `enough` says so; returns the number of iterations.
    ///
    /// Each direction is the residual made conjugate to all known directions, not only to the last one:
    /// the same iterates in exact arithmetic, and the recycled directions stay minimised.
    fn cg(
        &mut self,
        point: &mut Point,
        cg: &mut Cg,
        target: f64,
        enough: impl Fn(&Self, &Point, f64) -> bool,
    ) -> Result<usize, DualError> {
        let mut image = vec![0.0; point.lambda.len()];
        let limit = 2 * cg.sets.n_free() + 50;
        let (mut inner, mut first) = (0, 0.0);
        // Of the last iteration; before the first, what a well-conditioned A would give.
        let mut step = 2.0 / self.products.sigma;
        while inner < limit && self.products.stop.now().is_none() {
            // Where images are not exact, what the last step has left in the span is taken out again.
            if inner > 0 && !self.products.are_exact() {
                cg.span.minimise(&mut point.lambda, &mut point.r);
            }
            let mut p: Vec<f64> = point.r.iter().map(|r| -r).collect();
            cg.sets.mask(&mut p);
            let residual = norm(&p);
            // Below its drift the residual says nothing, and where it grows, directions that are only nearly
            // conjugate have come to work against each other.
            let drift = self.products.drift();
            if inner == 0 {
                first = residual;
            } else if !self.products.are_exact() && !(residual <= GROWN * first) {
                self.products.sharpen();
                break;
            }
            if residual <= target
                || (inner > 0 && (residual <= drift || enough(self, point, residual)))
            {
                break;
            }
            cg.span.make_conjugate(&mut p, None);
            self.products.apply(&p, &mut image, step, residual)?;
            let curvature = dot(&p, &image);
            if !(curvature > 0.0) {
                break;
            }
            inner += 1;
            step = -dot(&p, &point.r) / curvature;
            for i in 0..image.len() {
                point.lambda[i] += step * p[i];
                point.r[i] += step * image[i];
            }
            let scale = 1.0 / curvature.sqrt();
            p.iter_mut().for_each(|v| *v *= scale);
            cg.span.push(p, image.iter().map(|v| v * scale).collect());
        }
        Ok(inner)
    }

    /// P_Λ(λ), with the multipliers that the next step will hold put on their bounds by the same product.
    ///
    /// Only those that a ρ ≤ 1/σ_max holds: what a larger one says of a point outside Λ is too wild.
    fn move_into_bounds(&mut self, point: &mut Point, rho: f64) -> Result<bool, DualError> {
        let mut target = point.lambda.clone();
        Sets::predict(&point.lambda, &point.r, rho.min(self.alpha), self.g)
            .set_bounds(&mut target, self.g);
        project(&mut target, self.g);
        self.move_to(point, target)
    }

    /// A step that lowers q: projected gradient from `point`, then the minimum over the face of Λ that it
    /// has reached, over the smaller face where that minimum lies outside Λ, and so on.
    fn safeguarded_step(
        &mut self,
        point: &mut Point,
        target: f64,
        err: f64,
        faces: usize,
    ) -> Result<(Sets, usize), DualError> {
        let gradient = point.clone();
        for _ in 0..60 {
            *point = gradient.clone();
            let mut lambda = point.lambda.clone();
            for (l, r) in lambda.iter_mut().zip(&point.r) {
                *l -= self.alpha * r;
            }
            project(&mut lambda, self.g);
            self.move_to(point, lambda)?;
            if gradient.q_change(point) <= 0.0 {
                break;
            }
            // σ_max was underestimated.
            self.alpha *= 0.5;
        }
        // From here on multipliers only join the held ones, so that the loop ends.
        let mut sets = Sets::binding(&point.lambda, &point.r, self.g);
        let mut inner = 0;
        for face in 1..=faces {
            let mut end = point.clone();
            let mut cg = self.cg_on(sets.clone(), &mut end);
            inner += self.cg(&mut end, &mut cg, target, |_, _, residual| {
                residual <= SETS_CHANGED * err
            })?;
            let mut projected = end.lambda.clone();
            project(&mut projected, self.g);
            if projected == end.lambda {
                *point = end;
                break;
            }
            // Up to the first bound q falls and its gradient is known; beyond, the projection is tried.
            let cut = point.until_bound(&end, self.g);
            self.move_to(&mut end, projected)?;
            // What is left inside Λ by the last face need not lie on a bound: the best of the chord.
            if face == faces {
                end = point.lowest_towards(&end);
            }
            *point = if cut.q_change(&end) < 0.0 { end } else { cut };
            if !sets.hold_at_bounds(&point.lambda, self.g) || self.products.stop.now().is_some() {
                break;
            }
        }
        Ok((sets, inner))
    }
}

/// P_Λ: the projections (4) on λν ≥ 0 and (5) on |λτ| ≤ g.
///
/// The sum of max-functions in (5) is the clamp to [−g, g]; written as such it leaves what is inside
/// exactly as it was.
pub fn project(lambda: &mut [f64], g: &[f64]) {
    let (normal, tangential) = lambda.split_at_mut(g.len());
    for l in normal {
        *l = l.max(0.0);
    }
    for (l, &g) in tangential.iter_mut().zip(g) {
        *l = l.clamp(-g, g);
    }
}

/// The reduced gradient (10): r̃_α(λ) = (λ − P_Λ(λ − α r)) / α.
fn reduced_gradient(lambda: &[f64], r: &[f64], alpha: f64, g: &[f64]) -> Vec<f64> {
    let mut step: Vec<f64> = lambda.iter().zip(r).map(|(l, r)| l - alpha * r).collect();
    project(&mut step, g);
    step.iter_mut()
        .zip(lambda)
        .for_each(|(s, l)| *s = (l - *s) / alpha);
    step
}
