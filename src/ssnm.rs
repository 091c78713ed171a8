//! The semi-smooth Newton method in dual form: Algorithms SSNM and ISSNM of the paper, with a safeguard.
//!
//! The contact problem (1)–(3) is the minimisation of q(λ) = ½ λᵀAλ − λᵀb (8) over
//! Λ = {λν ≥ 0, |λτ| ≤ g}. Each outer step predicts the active sets from λ − ρr (Step 2), minimises q
//! with the inactive multipliers on their bounds by conjugate gradients (Step 3), and measures the
//! reduced gradient (10) at the projection of the result (Step 3.4).
//!
//! Three things go beyond the text of the paper, none of which changes the limit:
//!
//! - **Products are carried.** r = Aλ − b is updated along with λ, so a product with A is spent only on
//!   a direction of CG, on the jump of the multipliers that change to a bound, and on P_Λ(λ) − λ.
//! - **CG is continued, not restarted,** where the next step has the same sets, and it is cut short once
//!   its residual is well below the last error and the sets that it would lead to have changed already.
//! - **The safeguard.** The iterates P_Λ(λᵏ) are feasible and their q is known for nothing. A step that
//!   lowers neither the best q nor the best error is discarded: from the best point a projected gradient
//!   step with ρ = 1/σ_max < 2/σ_max lowers q by at least a fixed part of ‖r̃‖² (Kučera 2008, [2] of the
//!   paper), CG on its free multipliers lowers it further, and the set prediction uses no more than
//!   that ρ from then on. Hence q decreases to its minimum whatever β was.

mod sets;

pub use sets::{SetSizes, Sets};

use crate::dual::{DualOperator, sigma_max};
use crate::problem::{ContactProblem, Kkt};
use crate::sparse::{dot, norm};
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

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
    /// ε: the error err = ‖r̃_ρ(P_Λ(λ))‖ to reach, relative to err⁰.
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
    /// λ⁰, length 2m; zero if None.
    pub initial: Option<&'a [f64]>,
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
    /// Products spent on the estimate of σ_max.
    pub n_a_sigma: usize,
    /// ρ = β / σ_max.
    pub rho: f64,
    /// The estimate of σ_max.
    pub sigma_max: f64,
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

/// CG may stop early, on sets that have changed, once its residual is below this part of err.
const SETS_CHANGED: f64 = 0.3;

/// Solves the problem with the given dual operator.
///
/// `observer` is called after every outer step and may stop the solve.
///
/// # Panics
/// If `initial` is given with a length other than 2m.
pub fn solve(
    problem: &ContactProblem,
    dual: &mut impl DualOperator,
    settings: &Settings,
    mut observer: impl FnMut(&Step) -> ControlFlow<()>,
) -> Solution {
    let start = Instant::now();
    let len = 2 * problem.m();
    let mut b = vec![0.0; len];
    dual.right_hand_side(&mut b);
    let (sigma, n_a_sigma) = sigma_max(dual, len);
    let setup_seconds = start.elapsed().as_secs_f64();

    let mut newton = Newton {
        g: problem.slip_bound(),
        b,
        // Without contact, or with a B that K makes infinitely stiff, any ρ will do.
        rho: if sigma > 0.0 { settings.beta / sigma } else { 1.0 },
        alpha: if sigma > 0.0 { 1.0 / sigma } else { 1.0 },
        dual,
        n_a: 0,
        stop: Stop {
            deadline: settings.time_limit.map(|limit| start + limit),
            interrupt: settings.interrupt,
        },
    };
    let mut point = newton.start(settings.initial);
    let err0 = newton.error(&point);
    let mut history: Vec<Step> = Vec::new();
    let mut epsilon = settings.tolerance;
    let mut err = err0;
    let (u, kkt, status) = loop {
        let status = newton.run(&mut point, &mut err, err0, epsilon, settings, &mut history, &mut observer);
        let u = newton.dual.displacement(&point.lambda);
        let kkt = problem.kkt(&u, &point.lambda);
        if status != Status::Converged {
            break (u, kkt, status);
        }
        // r = d − Nu and −Tu afresh: the carried residual may have drifted.
        newton.refresh(problem, &u, &mut point);
        err = newton.error(&point);
        let relative = if err0 > 0.0 { err / err0 } else { 0.0 };
        let violation = kkt.max() / (10.0 * settings.tolerance);
        if relative <= settings.tolerance * (1.0 + 1e-6) && violation <= 1.0 {
            break (u, kkt, status);
        }
        // Equilibrium does not depend on λ: no further step can mend it.
        let attainable = kkt.equilibrium <= 10.0 * settings.tolerance;
        epsilon *= 0.5 * (1.0 / violation).clamp(0.02, 1.0);
        if !attainable || !(epsilon > 1e-16) {
            break (u, kkt, Status::Stagnated);
        }
    };
    let sets = Sets::at_solution(&point.lambda, &point.r, newton.g);
    let info = Info {
        iter: history.len(),
        n_a: newton.n_a,
        n_a_sigma,
        rho: newton.rho,
        sigma_max: sigma,
        err_relative: if err0 > 0.0 { newton.error(&point) / err0 } else { 0.0 },
        kkt,
        history,
        setup_seconds,
        solve_seconds: start.elapsed().as_secs_f64() - setup_seconds,
    };
    Solution {
        status,
        u,
        lambda: point.lambda,
        sets,
        info,
    }
}

/// λ with its gradient r = Aλ − b.
#[derive(Clone)]
struct Point {
    lambda: Vec<f64>,
    r: Vec<f64>,
}

/// When to stop in the middle of an inner solve.
struct Stop<'a> {
    deadline: Option<Instant>,
    interrupt: Option<&'a AtomicBool>,
}

impl Stop<'_> {
    fn now(&self) -> Option<Status> {
        if self.interrupt.is_some_and(|flag| flag.load(Ordering::Relaxed)) {
            Some(Status::Interrupted)
        } else if self.deadline.is_some_and(|end| Instant::now() >= end) {
            Some(Status::TimeLimit)
        } else {
            None
        }
    }
}

/// The conjugate gradient iteration on a free set, kept from one outer step to the next.
struct Cg {
    sets: Sets,
    p: Vec<f64>,
    /// ‖r‖² on the free set.
    rr: f64,
}

impl Cg {
    fn new(sets: Sets, r: &[f64]) -> Self {
        let mut p: Vec<f64> = r.iter().map(|r| -r).collect();
        sets.mask(&mut p);
        let rr = dot(&p, &p);
        Self { sets, p, rr }
    }
}

/// The state that all steps share.
struct Newton<'a, D> {
    g: &'a [f64],
    b: Vec<f64>,
    /// ρ = β/σ_max: of the error, and of the sets until the safeguard has acted.
    rho: f64,
    /// The length of safeguarding projected gradient steps, < 2/σ_max.
    alpha: f64,
    dual: &'a mut D,
    n_a: usize,
    stop: Stop<'a>,
}

impl<D: DualOperator> Newton<'_, D> {
    fn apply(&mut self, p: &[f64], ap: &mut [f64]) {
        self.dual.apply(p, ap);
        self.n_a += 1;
    }

    /// λ⁰ projected on Λ, and r there.
    fn start(&mut self, initial: Option<&[f64]>) -> Point {
        let mut point = Point {
            lambda: vec![0.0; self.b.len()],
            r: self.b.iter().map(|b| -b).collect(),
        };
        if let Some(initial) = initial {
            assert_eq!(initial.len(), self.b.len(), "λ⁰ needs 2m entries");
            let mut target = initial.to_vec();
            project(&mut target, self.g);
            self.move_to(&mut point, target);
        }
        point
    }

    /// Moves to λ = `target`, carrying r along: one product, or none if it is there already.
    fn move_to(&mut self, point: &mut Point, target: Vec<f64>) -> bool {
        let jump: Vec<f64> = target.iter().zip(&point.lambda).map(|(t, l)| t - l).collect();
        if jump.iter().all(|&v| v == 0.0) {
            return false;
        }
        let mut image = vec![0.0; jump.len()];
        self.apply(&jump, &mut image);
        point.lambda = target;
        point.r.iter_mut().zip(image).for_each(|(r, a)| *r += a);
        true
    }

    /// err = ‖r̃_ρ(λ)‖, the reduced gradient (10) at a point of Λ.
    fn error(&self, point: &Point) -> f64 {
        norm(&reduced_gradient(point, self.rho, self.g))
    }

    /// q(λ) = ½ λᵀ(r − b), for r = Aλ − b.
    fn q(&self, point: &Point) -> f64 {
        0.5 * (dot(&point.lambda, &point.r) - dot(&point.lambda, &self.b))
    }

    /// Replaces the carried r by what the displacement says: d − Nu and −Tu.
    fn refresh(&self, problem: &ContactProblem, u: &[f64], point: &mut Point) {
        let m = problem.m();
        let (rn, rt) = point.r.split_at_mut(m);
        problem.normal().mul(u, rn);
        problem.tangential().mul(u, rt);
        rn.iter_mut().zip(problem.gap()).for_each(|(r, d)| *r = d - *r);
        rt.iter_mut().for_each(|r| *r = -*r);
    }

    /// Outer steps until err ≤ ε err⁰ or a reason to stop.
    #[allow(clippy::too_many_arguments)]
    fn run(
        &mut self,
        point: &mut Point,
        err: &mut f64,
        err0: f64,
        epsilon: f64,
        settings: &Settings,
        history: &mut Vec<Step>,
        observer: &mut impl FnMut(&Step) -> ControlFlow<()>,
    ) -> Status {
        // Step 3.1 starts from tol⁰ = r_tol / c_fact.
        let mut tol = settings.r_tol / settings.c_fact;
        let mut cg: Option<Cg> = None;
        let mut set_rho = self.rho;
        let mut best = point.clone();
        let (mut best_q, mut best_err) = (self.q(point), *err);
        // Safeguarded steps still to make, and how many the next discarded step will cost.
        let (mut guarded, mut penalty) = (0usize, 1usize);
        loop {
            // Step 1, written so that NaN never passes.
            if *err <= epsilon * err0 {
                return Status::Converged;
            }
            if let Some(status) = self.stop.now() {
                return status;
            }
            if history.len() >= settings.max_iterations {
                *point = best;
                return Status::IterationLimit;
            }
            tol = (settings.r_tol * *err / err0).min(settings.c_fact * tol);
            let target = match settings.method {
                Method::Inexact => tol * err0,
                Method::Exact => 1e-12 * err0,
            };
            let previous = cg.as_ref().map(|cg| cg.sets.clone());
            let safeguarded = guarded > 0;
            let (sets, inner) = if safeguarded {
                guarded -= 1;
                let outcome = self.safeguarded_step(point, target);
                cg = None;
                outcome
            } else {
                self.newton_step(point, &mut cg, set_rho, target, *err, settings.method)
            };
            *err = self.error(point);
            let q = self.q(point);
            history.push(Step {
                iter: history.len() + 1,
                inner,
                n_a: self.n_a,
                err: *err / err0,
                sets: sets.sizes(),
                changes: previous.map_or(2 * self.g.len(), |old| old.differences(&sets)),
                safeguarded,
            });
            let stopped = observer(history.last().expect("just pushed")).is_break();

            let progress = q < best_q || *err < best_err;
            if q < best_q || (*err < best_err && *err <= epsilon * err0) {
                best = point.clone();
                best_q = q;
            }
            best_err = best_err.min(*err);
            if stopped {
                *point = best;
                return Status::Interrupted;
            }
            // Written so that NaN is no progress.
            if !progress || !q.is_finite() {
                if safeguarded {
                    *point = best;
                    *err = self.error(point);
                    return if *err <= epsilon * err0 {
                        Status::Converged
                    } else {
                        Status::Stagnated
                    };
                }
                *point = best.clone();
                *err = self.error(point);
                best_err = *err;
                cg = None;
                set_rho = set_rho.min(self.alpha);
                guarded = penalty;
                penalty *= 2;
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
    ) -> (Sets, usize) {
        let sets = Sets::predict(&point.lambda, &point.r, rho, self.g);
        // Step 3.2: inactive multipliers on their bounds.
        let mut start = point.lambda.clone();
        sets.set_bounds(&mut start, self.g);
        let jumped = self.move_to(point, start);
        let mut cg = match kept.take() {
            Some(cg) if !jumped && cg.sets == sets => cg,
            _ => Cg::new(sets.clone(), &point.r),
        };
        // Step 3.3.
        let floor = match method {
            Method::Inexact => Some(SETS_CHANGED * err),
            Method::Exact => None,
        };
        let inner = self.cg(point, &mut cg, target, |newton, point, residual| {
            floor.is_some_and(|floor| residual <= floor)
                && Sets::predict(&point.lambda, &point.r, rho, newton.g) != sets
        });
        // Step 3.4 takes the error at the projection; going on from there costs nothing more.
        let mut projected = point.lambda.clone();
        project(&mut projected, self.g);
        if !self.move_to(point, projected) {
            *kept = Some(cg);
        }
        (sets, inner)
    }

    /// CGM(A, b, 𝒜, λ, tol): minimises q over the free multipliers until ‖r‖ there is at most `target`
    /// or `enough` says so; returns the number of iterations.
    fn cg(
        &mut self,
        point: &mut Point,
        cg: &mut Cg,
        target: f64,
        enough: impl Fn(&Self, &Point, f64) -> bool,
    ) -> usize {
        let mut image = vec![0.0; point.lambda.len()];
        let limit = 2 * cg.sets.n_free() + 50;
        let mut inner = 0;
        while cg.rr.sqrt() > target && inner < limit && self.stop.now().is_none() {
            self.apply(&cg.p, &mut image);
            let curvature = dot(&cg.p, &image);
            if !(curvature > 0.0) {
                break;
            }
            inner += 1;
            let step = cg.rr / curvature;
            let mut rr = 0.0;
            for i in 0..image.len() {
                point.lambda[i] += step * cg.p[i];
                point.r[i] += step * image[i];
                if cg.sets.is_free(i) {
                    rr += point.r[i] * point.r[i];
                }
            }
            let beta = rr / cg.rr;
            cg.rr = rr;
            for (i, p) in cg.p.iter_mut().enumerate() {
                if cg.sets.is_free(i) {
                    *p = -point.r[i] + beta * *p;
                }
            }
            if enough(self, point, rr.sqrt()) {
                break;
            }
        }
        inner
    }

    /// A step that lowers q: projected gradient, then CG on what is free there.
    fn safeguarded_step(&mut self, point: &mut Point, target: f64) -> (Sets, usize) {
        let before = self.q(point);
        loop {
            let mut next = point.clone();
            for (l, r) in next.lambda.iter_mut().zip(&point.r) {
                *l -= self.alpha * r;
            }
            project(&mut next.lambda, self.g);
            let lambda = std::mem::replace(&mut next.lambda, point.lambda.clone());
            if !self.move_to(&mut next, lambda) || self.q(&next) <= before || self.alpha == 0.0 {
                *point = next;
                break;
            }
            // σ_max was underestimated, or this is rounding.
            let rounding = 1e-14 * before.abs();
            if self.q(&next) - before <= rounding {
                break;
            }
            self.alpha *= 0.5;
        }
        let start = point.clone();
        let start_q = self.q(&start);
        let sets = Sets::predict(&point.lambda, &point.r, self.alpha, self.g);
        let mut bounded = point.lambda.clone();
        sets.set_bounds(&mut bounded, self.g);
        self.move_to(point, bounded);
        let mut cg = Cg::new(sets.clone(), &point.r);
        let inner = self.cg(point, &mut cg, target, |newton, point, _| {
            Sets::predict(&point.lambda, &point.r, newton.alpha, newton.g) != sets
        });
        let mut projected = point.lambda.clone();
        project(&mut projected, self.g);
        self.move_to(point, projected);
        if !(self.q(point) <= start_q) {
            *point = start;
        }
        (sets, inner)
    }
}

/// P_Λ: the projections (4) on λν ≥ 0 and (5) on |λτ| ≤ g.
pub fn project(lambda: &mut [f64], g: &[f64]) {
    let (normal, tangential) = lambda.split_at_mut(g.len());
    for l in normal {
        *l = l.max(0.0);
    }
    for (l, &g) in tangential.iter_mut().zip(g) {
        *l = (*l + g).max(0.0) - (*l - g).max(0.0) - g;
        // The sum above rounds: the bound must hold exactly.
        *l = l.clamp(-g, g);
    }
}

/// The reduced gradient (10): r̃_α(λ) = (λ − P_Λ(λ − α r)) / α.
fn reduced_gradient(point: &Point, alpha: f64, g: &[f64]) -> Vec<f64> {
    let mut step: Vec<f64> = point
        .lambda
        .iter()
        .zip(&point.r)
        .map(|(l, r)| l - alpha * r)
        .collect();
    project(&mut step, g);
    step.iter_mut()
        .zip(&point.lambda)
        .for_each(|(s, l)| *s = (l - *s) / alpha);
    step
}
