//! The semi-smooth Newton method in dual form: Algorithms SSNM and ISSNM of the paper, with a safeguard.
//!
//! The contact problem (1)–(3) is the minimisation of q(λ) = ½ λᵀAλ − λᵀb (8) over
//! Λ = {λν ≥ 0, |λτ| ≤ g}. Each outer step predicts the active sets from λ − ρr (Step 2), minimises q
//! with the inactive multipliers on their bounds by conjugate gradients (Step 3), and measures the
//! reduced gradient (10) at the projection of the result (Step 3.4).
//!
//! Seven things go beyond the text of the paper, none of which changes the limit:
//!
//! - **Products are carried.** r = Aλ − b is updated along with λ, so a product with A is spent only on
//!   a direction of CG, on the jump of the multipliers that change to a bound, and on P_Λ(λ) − λ. Where
//!   products are a matter of iterations they are as accurate as need be (`products`).
//! - **CG is continued, not restarted,** where the next step has the same sets, and it is cut short once
//!   its residual is below a part of the last error and the sets that it would lead to have changed.
//! - **Multipliers are scaled** where the stiffness under the contact varies by more than a factor of four.
//! - **Known products are used again.** All directions with a known product span a subspace; its part that
//!   vanishes on the held multipliers is minimised over for nothing before CG starts on new sets.
//! - **Bodies are kept in balance.** Where bodies can move as a whole, Λ is Λₑ = {λ ∈ Λ: Gλ = e}
//!   (`dual::balance`). Its projection, which costs no product with A, takes the place of P_Λ everywhere, and
//!   the minimisation (11) keeps Gλ = e. The multiplier of the balance that the projection of λ − ρ(Aλ − b)
//!   brings with it is ρα, α the rigid motion: r is Aλ − b − Gᵀα with this α at every prediction. So bodies cross
//!   gaps, tip and settle in the projection, the sets are always those of forces in balance, and where Λₑ is
//!   empty that is known before the first product.
//! - **Coulomb's law.** Where g = μλν the tangential multipliers of slipping nodes follow the normal ones in
//!   the inner problem (`face`, `gcr`), the error (10) is that with g = μλν of the same point, and the point stays on
//!   the law's cones. Nothing is minimised then: steps are accepted while the error falls every few of them, then made
//!   in other ways, then given up (`docs/coulomb.md`); `quasistatic` goes on from there.
//! - **The safeguard.** The iterates are feasible and the change of q between them is known for nothing.
//!   Steps that lower neither the best q nor the best error are discarded: from the best point a
//!   projected gradient step with ρ = 1/σ_max < 2/σ_max lowers q by at least a fixed part of ‖r̃‖²
//!   (Kučera 2008, reference 2 of the paper), minimising over the face of Λ reached lowers it further,
//!   and the set prediction uses no more than that ρ from then on. Each time it acts it stays for twice
//!   as many steps, hence q decreases to its minimum whatever β was.

mod face;
mod gcr;
mod goal;
mod law;
mod point;
mod products;
mod scaling;
mod sets;
mod step;
mod subspace;

pub use point::project;
pub use sets::{SetSizes, Sets};

use crate::control::{Stop, Stopped};
use crate::dual::balance::Balance;
use crate::dual::{DualError, DualOperator};
use crate::problem::{ContactProblem, Kkt, ROUNDING};
use crate::sparse::{norm, norm_max};
use goal::{Goal, forces_met};
use law::Law;
use point::{Point, distance, settle};
use products::Products;
use scaling::Scaled;
use std::borrow::Cow;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::rc::Rc;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};
use step::Inner;
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
    /// ε: what the answer may be off by. The error err = ‖r̃_ρ(P_Λ(λ))‖ is reached relative to err⁰, that at λ = 0
    /// (or, where bodies can move as a whole, at the least forces that balance them); beside it what the rest of
    /// the gradient could still move is made so small that nodal pressures are right to 3000 ε of the largest.
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
    /// Rᵀu before, for the motions of [`ContactProblem::free_bodies`]: what neither load nor contact moves stays
    /// there; zero if None.
    pub place: Option<&'a [f64]>,
    /// err⁰ as an earlier solve of the same step has found it ([`Info::first_error`]): where bodies can move as a
    /// whole it costs a product.
    pub first_error: Option<f64>,
    /// What earlier solves with the same K, N and T have found out; this one adds to it.
    pub memory: Option<&'a RefCell<Memory>>,
    /// Set from outside to stop at the next product with A.
    pub interrupt: Option<&'a AtomicBool>,
}

/// Directions whose products with A are known: they hold for every load, gap and slip bound, as long as K, N and T
/// stay what they are, and spare later solves their products where these are exact (by a factor).
#[derive(Clone, Debug, Default)]
pub struct Memory(Subspace);

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
            place: None,
            first_error: None,
            memory: None,
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
    /// No progress any more: the tolerance is below what f64, or PCG, can give here, or under Coulomb's law no step
    /// lowers the error.
    Stagnated,
    /// Contact and friction cannot balance the loads on a body that can move as a whole: no static solution
    /// exists. λ balances them as far as it goes ([`Solution::imbalance`]).
    NotHeld,
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
    /// Rᵀ(f − Bᵀλ) for the motions of [`ContactProblem::free_bodies`], where that cannot be made zero: which way
    /// bodies are pushed that nothing holds. Empty otherwise.
    pub imbalance: Vec<f64>,
    /// Figures.
    pub info: Info,
}

/// The violation of the optimality conditions that `converged` allows, relative to ε.
pub(crate) const MET: f64 = 10.0;
/// Newton steps in a row without progress in q or err before the safeguard acts.
const FRUITLESS: usize = 3;
/// An error below this part of the best one is progress.
const PROGRESS: f64 = 0.9;
/// There sets are predicted with so much longer a ρ than that of the error, and each time that nothing else has
/// helped again with so much more.
const LONGER: f64 = 4.0;
/// Ways to make coupled steps: whole, searched for the least error, and both longer ρ after that.
const ATTEMPTS: i32 = 4;
/// How often coupled steps start again from the best point where products are exact.
const RESTARTS: usize = 1;
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
/// Directions handed on from one solve to the next: the fewer, the cheaper they are to fit to new sets.
const REMEMBERED: usize = 40;
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
        // A limit beyond what the clock can show is none.
        deadline: (settings.time_limit).and_then(|limit| start.checked_add(limit)),
        interrupt: settings.interrupt,
    };
    let exact = settings.method == Method::Exact;
    let mut dual = Scaled::new(problem, dual);
    let law = Law::new(problem, &dual);
    let (balance, mut reference, imbalance) = balanced(problem, &dual, &law);
    // Where err⁰ is known, the way may start from λ⁰ at once.
    let known = settings.first_error.filter(|_| balance.is_some());
    if let (Some(_), Some(balance), Some(initial)) = (known, &balance, settings.initial) {
        assert_eq!(initial.len(), len, "λ⁰ needs 2m entries");
        let mut start = initial.to_vec();
        dual.divide(&mut start);
        reference = balance.nearest(&start, |i, z| law.nearest(i, z)).lambda;
    }
    // What no contact can balance is left out of the load, so that the rest can be solved.
    let reduced = (!imbalance.is_empty()).then(|| {
        let mut load = problem.load().to_vec();
        let less: Vec<f64> = imbalance.iter().map(|v| -v).collect();
        problem.free_bodies().add_motion(&less, &mut load);
        let (gap, origin) = (problem.gap().to_vec(), problem.slip_origin().to_vec());
        problem.with_data(load, gap, origin, problem.slip_bound().to_vec())
    });
    let whole = problem;
    let problem = reduced.as_ref().unwrap_or(problem);
    let mut c = problem.offsets();
    let everything = balance
        .as_ref()
        .map(|balance| balance.on_face(|_| true, &[]));
    let projects = |p: &mut [f64]| {
        if let Some(face) = &everything {
            face.project(p);
        }
    };
    let set_up = dual.set_data(problem.load(), &c);
    dual.times(&mut c);
    let offsets = c.clone();
    let mut products = Products::new(dual, exact, stop);
    let set_up = set_up.and_then(|()| products.set_up(c, &reference, settings.sigma_max, projects));
    if let Some(memory) = settings.memory
        && products.are_exact()
    {
        products.known = memory.take().0;
    }
    let setup_seconds = start.elapsed().as_secs_f64();
    let mut failure = None;
    let (r, n_a_sigma) = set_up.unwrap_or_else(|error| {
        failure = Some(error);
        reference.fill(0.0);
        (vec![0.0; len], 0)
    });
    // Without contact, or with a B that K makes infinitely stiff, any ρ will do.
    let alpha = if products.sigma > 0.0 {
        1.0 / products.sigma
    } else {
        1.0
    };
    let mut point = Point {
        lambda: reference,
        r,
        motion: vec![0.0; problem.free_bodies().n_motions()],
    };
    let mut newton = Newton {
        problem,
        law,
        balance,
        offsets,
        rho: settings.beta * alpha,
        alpha,
        products,
        checked: None,
        check_accuracy: settings.tolerance,
        tolerance: settings.tolerance,
        last_err: 0.0,
        refreshed: f64::INFINITY,
        place: settings.place,
    };
    // err⁰ at λ = 0 even for a warm start: a good start must not make the same tolerance harder.
    let error = newton.error(&mut point);
    let first_error = known.unwrap_or(error);
    let err0 = first_error.max(newton.rounding(&point));
    let level = settings.tolerance.min(if exact { EXACT } else { 1.0 });
    newton.products.aim_at(level * err0);
    newton.products.allow(err0);
    let mut history: Vec<Step> = Vec::new();
    let mut first_met = None;
    let outcome = match failure {
        Some(error) => Err(error),
        None => newton
            .start(&point, settings.initial.filter(|_| known.is_none()))
            .map(|first| point = first)
            .and_then(|()| {
                newton.run(
                    &mut point,
                    err0,
                    settings,
                    &mut history,
                    &mut observer,
                    &mut first_met,
                )
            }),
    };
    if let Some(memory) = settings.memory
        && newton.products.are_exact()
    {
        let known = std::mem::take(&mut newton.products.known);
        memory.replace(Memory(known.latest(REMEMBERED)));
    }
    let (mut status, checked) = match outcome {
        Ok(status) => (status, newton.checked.take()),
        Err(DualError::Stopped(stopped)) => (stopped.into(), None),
        Err(error) if error.is_stalled() => (Status::Stagnated, None),
        Err(error) => return Err(newton.failed(error, point, history)),
    };
    let (u, mut kkt) = match checked {
        Some(checked) => checked,
        // Whoever has asked to stop does not wait for more than a picture.
        None => {
            let u = match newton.displacement(&point, ROUGH, Stop::default()) {
                Err(error) if error.is_stalled() => {
                    newton.displacement(&point, f64::INFINITY, Stop::default())
                }
                made => made,
            };
            match u {
                Ok(mut u) => {
                    if status == Status::Stagnated {
                        newton.take_from(&u, &mut point);
                        newton.error(&mut point);
                    }
                    (problem.free_bodies()).add_motion(&point.motion, &mut u);
                    let kkt = newton.optimality(&point, &u);
                    (u, kkt)
                }
                Err(error) => return Err(newton.failed(error, point, history)),
            }
        }
    };
    let sets = Sets::at_solution(&point.lambda, &point.r, &newton.law.bounds(&point.lambda));
    let err_relative = newton.relative(&mut point, err0);
    let (lambda, r) = newton.unscaled(&point);
    // However it came about: what meets all conditions is a solution.
    if status == Status::Stagnated
        && err_relative <= settings.tolerance
        && kkt.max() <= MET * settings.tolerance
        && forces_met(settings.tolerance, problem, &lambda, &r)
    {
        status = Status::Converged;
    }
    if !imbalance.is_empty() {
        kkt = whole.kkt(&u, &lambda);
        if status == Status::Converged {
            status = Status::NotHeld;
        }
    }
    let info = Info {
        iter: history.len(),
        n_a: newton.products.n_a,
        first_met,
        n_a_sigma,
        rho: newton.rho,
        sigma_max: newton.products.sigma,
        first_error,
        err_relative,
        kkt,
        history,
        setup_seconds,
        solve_seconds: start.elapsed().as_secs_f64() - setup_seconds,
    };
    Ok(Solution {
        status,
        u,
        lambda,
        sets,
        imbalance,
        info,
    })
}

/// The balance of the free bodies in scaled multipliers, the least λ ∈ Λ that meets it, and what of it no λ ∈ Λ
/// can meet (empty if there is nothing).
fn balanced<D: DualOperator + ?Sized>(
    problem: &ContactProblem,
    dual: &Scaled<D>,
    law: &Law,
) -> (Option<Rc<Balance>>, Vec<f64>, Vec<f64>) {
    let zero = vec![0.0; 2 * problem.m()];
    let free = problem.free_bodies();
    if free.is_empty() {
        return (None, zero, Vec::new());
    }
    let b = problem.contact_matrix();
    let mut balance = Balance::new(free, &b, problem.load(), |i| dual.factor(i));
    let least = balance.least(|i, z| law.nearest(i, z));
    let imbalance = if least.balanced {
        Vec::new()
    } else {
        least.imbalance
    };
    (Some(Rc::new(balance)), least.lambda, imbalance)
}

/// The state that all steps share.
struct Newton<'a, D: ?Sized> {
    problem: &'a ContactProblem,
    law: Law,
    /// Where bodies can move as a whole.
    balance: Option<Rc<Balance>>,
    /// c, scaled.
    offsets: Vec<f64>,
    /// ρ = β/σ_max: of the error, and of the sets until the safeguard has acted.
    rho: f64,
    /// The length of safeguarding projected gradient steps, < 2/σ_max.
    alpha: f64,
    products: Products<'a, D>,
    /// u and the optimality conditions of the last final check.
    checked: Option<(Vec<f64>, Kkt)>,
    /// ‖f − Bᵀλ − Ku‖ relative to the acting forces in the final check.
    check_accuracy: f64,
    /// ε, and the err that it asks for.
    tolerance: f64,
    last_err: f64,
    /// err when r was last made afresh for want of progress.
    refreshed: f64,
    /// Where bodies that can move as a whole are, as far as nothing moves them: coefficients of their motions.
    place: Option<&'a [f64]>,
}

impl<D: DualOperator + ?Sized> Newton<'_, D> {
    /// r at a point made afresh, where it is not exact anyhow.
    fn refresh(&mut self, point: &mut Point) -> Result<bool, DualError> {
        if self.products.are_exact() {
            return Ok(false);
        }
        point.motion.fill(0.0);
        let probe = point.clone();
        let Point { lambda, r, .. } = point;
        let g = self.bounds(&probe.lambda).into_owned();
        let (rho, balance) = (self.rho, self.balance.clone());
        let made = (self.products).refresh(lambda, r, |r| {
            let mut there = Point {
                r: r.to_vec(),
                ..probe.clone()
            };
            let end = settle(&mut there, rho, &g, balance.as_deref());
            distance(&there.lambda, &end) / rho
        })?;
        if !made {
            // A GPU has failed in between and products are exact from now on, but nothing known so far is.
            self.make_exact(point)?;
            self.products.n_a += 1;
        }
        Ok(true)
    }

    /// r at a point from its displacement.
    fn make_exact(&mut self, point: &mut Point) -> Result<(), DualError> {
        let u = self.displacement(point, EXACT, self.products.stop)?;
        self.take_from(&u, point);
        Ok(())
    }

    /// λ⁰ projected on Λ, and r there; the reference point where there is none, or where it is better.
    fn start(&mut self, reference: &Point, initial: Option<&[f64]>) -> Result<Point, DualError> {
        let mut point = reference.clone();
        if let Some(initial) = initial {
            assert_eq!(initial.len(), reference.r.len(), "λ⁰ needs 2m entries");
            let mut target = initial.to_vec();
            self.products.dual.divide(&mut target);
            self.project(&mut target);
            self.move_to(&mut point, target)?;
        }
        Ok(point)
    }

    /// The projection on Λ, or on Λₑ where bodies can move as a whole.
    fn project(&self, lambda: &mut Vec<f64>) {
        self.law.project(lambda, self.balance.as_deref());
    }

    /// The slip bounds at λ: under Coulomb's law those of the nearest point that obeys it.
    fn bounds(&self, lambda: &[f64]) -> Cow<'_, [f64]> {
        if self.balance.is_none() || !self.law.is_coulomb() {
            return self.law.bounds(lambda);
        }
        let mut near = lambda.to_vec();
        self.project(&mut near);
        Cow::Owned(self.law.bounds(&near).into_owned())
    }

    /// Chooses α at a point such that a projected gradient step of length ρ from there keeps the bodies in
    /// balance; returns where that step ends.
    fn settle(&self, point: &mut Point, rho: f64) -> Vec<f64> {
        let g = self.bounds(&point.lambda).into_owned();
        settle(point, rho, &g, self.balance.as_deref())
    }

    /// Moves to λ = `target`, and r with it: one product, or none if it is there already but for rounding.
    fn move_to(&mut self, point: &mut Point, target: Vec<f64>) -> Result<bool, DualError> {
        let jump: Vec<f64> = target
            .iter()
            .zip(&point.lambda)
            .map(|(t, l)| t - l)
            .collect();
        let rounding = ROUNDING * norm_max(&target);
        point.lambda = target;
        if jump.iter().all(|v| v.abs() <= rounding) {
            return Ok(false);
        }
        if !self.products.carry(&jump, &mut point.r)? {
            self.refresh(point)?;
        }
        Ok(true)
    }

    /// err = ‖r̃_ρ(λ)‖, the reduced gradient (10) at a point of Λ, with the α that goes with it.
    fn error(&self, point: &mut Point) -> f64 {
        self.error_with(point, self.rho)
    }

    /// The same for another ρ.
    fn error_with(&self, point: &mut Point, rho: f64) -> f64 {
        let end = self.settle(point, rho);
        distance(&point.lambda, &end) / rho
    }

    /// err relative to what it is measured by.
    fn relative(&self, point: &mut Point, err0: f64) -> f64 {
        let err = self.error(point);
        if err <= self.rounding(point) {
            return 0.0;
        }
        err / err0.max(self.own_motion(&point.lambda))
    }

    /// ‖(Σⱼ Bᵢⱼ²/Kⱼⱼ λᵢ)ᵢ‖: what the forces do to their own nodes at least. An err below this times ε is good
    /// enough however small err⁰ is.
    fn own_motion(&self, lambda: &[f64]) -> f64 {
        let own: Vec<f64> = (self.problem.compliance().iter().zip(lambda))
            .enumerate()
            .map(|(i, (c, l))| c * l * self.products.dual.factor(i).powi(2))
            .collect();
        norm(&own)
    }

    /// What r may be off by for rounding alone: f64 tells no smaller error.
    fn rounding(&self, point: &Point) -> f64 {
        let terms: Vec<f64> = (self.offsets.iter().zip(&point.r))
            .map(|(c, r)| c.abs().max((c - r).abs()))
            .collect();
        16.0 * f64::EPSILON * norm(&terms)
    }

    /// Replaces r by what the displacement says: c − Bu.
    fn take_from(&mut self, u: &[f64], point: &mut Point) {
        let problem = self.problem;
        let (rn, rt) = point.r.split_at_mut(problem.m());
        problem.normal().mul(u, rn);
        problem.tangential().mul(u, rt);
        for (r, c) in point.r.iter_mut().zip(problem.offsets()) {
            *r = c - *r;
        }
        self.products.dual.times(&mut point.r);
        self.products.checked(&point.r);
        point.motion.fill(0.0);
    }

    /// u at a point but for the motions of free bodies, to a residual relative to the acting forces.
    fn displacement(
        &mut self,
        point: &Point,
        accuracy: f64,
        stop: Stop,
    ) -> Result<Vec<f64>, DualError> {
        let mut lambda = point.lambda.clone();
        self.products.dual.times(&mut lambda);
        let residual = accuracy * self.problem.acting_forces(&lambda);
        let mut u = if residual == 0.0 {
            // Neither load nor contact forces.
            vec![0.0; self.problem.load().len()]
        } else {
            (self.products.dual).displacement(&point.lambda, residual, &stop)?
        };
        // Whichever K⁺ it was: bodies stay where they were as far as contact lets them.
        let free = self.problem.free_bodies();
        let back: Vec<f64> = free
            .resultants(&u)
            .iter()
            .enumerate()
            .map(|(j, a)| self.place.map_or(0.0, |place| place[j]) - a)
            .collect();
        free.add_motion(&back, &mut u);
        Ok(u)
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
        let (lambda, r) = self.unscaled(point);
        goal.met(self.problem, &lambda, &r, err)
    }

    /// λ and r in the units of the problem.
    fn unscaled(&self, point: &Point) -> (Vec<f64>, Vec<f64>) {
        let (mut lambda, mut r) = (point.lambda.clone(), point.r.clone());
        self.products.dual.times(&mut lambda);
        self.products.dual.divide(&mut r);
        (lambda, r)
    }

    /// The final check of a point that meets the goal: u from K⁻¹, and the optimality conditions against K.
    ///
    /// None, with a goal that is harder to meet and an r that is made afresh, if they are not yet met.
    fn verify(
        &mut self,
        point: &mut Point,
        goal: &mut Goal,
        tolerance: f64,
    ) -> Result<Option<Status>, DualError> {
        let mut u = self.displacement(point, self.check_accuracy, self.products.stop)?;
        self.take_from(&u, point);
        let err = self.error(point);
        self.problem.free_bodies().add_motion(&point.motion, &mut u);
        let kkt = self.optimality(point, &u);
        goal.err = goal.err.max(self.rounding(point));
        let (lambda, r) = self.unscaled(point);
        let forces = goal.forces_met(self.problem, &lambda, &r);
        // Equilibrium does not depend on λ: no further step can mend it. A goal that was met again and
        // again and still fails the check is at the limit of rounding.
        let status = if err <= goal.err * (1.0 + 1e-6) && forces && kkt.max() <= MET * tolerance {
            Status::Converged
        } else if !(kkt.equilibrium <= MET * tolerance) || goal.checks >= 5 {
            Status::Stagnated
        } else {
            // An err that is not met was a matter of the accuracy of u: the next check has a better one.
            if err <= goal.err || self.check_accuracy < FINEST {
                goal.checks += 1;
            }
            let yardsticks = self.problem.yardsticks(&u, &lambda);
            goal.slack = 9.0 * tolerance * yardsticks.length + yardsticks.rounding;
            goal.work = 9.0 * tolerance * yardsticks.deformation + yardsticks.rounding;
            return Ok(None);
        };
        self.checked = Some((u, kkt));
        Ok(Some(status))
    }

    /// Outer steps until the final check is content with a point that meets the goal, or a reason to stop.
    fn run(
        &mut self,
        point: &mut Point,
        err0: f64,
        settings: &Settings,
        history: &mut Vec<Step>,
        observer: &mut impl FnMut(&Step) -> ControlFlow<()>,
        first_met: &mut Option<(usize, usize)>,
    ) -> Result<Status, DualError> {
        let mut goal = Goal {
            err: settings.tolerance * err0,
            tolerance: settings.tolerance,
            slack: f64::INFINITY,
            work: f64::INFINITY,
            checks: 0,
        };
        let mut err = self.error(point);
        // Step 3.1 starts from tol⁰ = r_tol / c_fact.
        let mut tol = settings.r_tol / settings.c_fact;
        let mut cg: Option<Inner> = None;
        let mut previous: Option<Sets> = None;
        let mut set_rho = self.rho;
        // The point of lowest q, and what it took to find a better one.
        let (mut best, mut best_err) = (point.clone(), err);
        let mut first = point.clone();
        let mut fruitless = 0;
        // Safeguarded steps still to make, and how many the next discarded steps will cost.
        let (mut guarded, mut penalty, mut faces) = (0usize, 1usize, 0usize);
        // Under Coulomb's law: how often steps have been made differently for want of progress.
        let mut attempt = 0;
        let mut restarts = if self.products.are_exact() {
            RESTARTS
        } else {
            0
        };
        loop {
            self.products.allow(err);
            goal.err = (settings.tolerance * err0.max(self.own_motion(&point.lambda)))
                .max(self.rounding(point));
            self.last_err = goal.err;
            // Step 1.
            if err <= goal.err {
                first_met.get_or_insert((history.len(), self.products.n_a));
            }
            if self.meets(&goal, point, err) {
                if let Some(status) = self.verify(point, &mut goal, settings.tolerance)? {
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
                if self.law.is_coulomb() {
                    best_err = err;
                }
                cg = None;
                continue;
            }
            let stop = self.products.stop.now();
            if stop.is_some() || history.len() >= settings.max_iterations {
                *point = best;
                return Ok(stop.map_or(Status::IterationLimit, Status::from));
            }
            if err <= self.rounding(point) {
                // Nothing is left to see of the error, and yet the forces are not known well enough.
                self.make_exact(point)?;
                err = self.error(point);
                if err <= self.rounding(point) && !self.meets(&goal, point, err) {
                    return Ok(Status::Stagnated);
                }
                best = point.clone();
                cg = None;
                continue;
            }
            if err <= goal.err {
                // Small beside err⁰, but the forces are smaller still.
                let (lambda, r) = self.unscaled(point);
                let part = goal.part_for_forces(self.problem, &lambda, &r);
                let level = (0.5 * part * err).min(self.products.level());
                self.products.aim_at(level);
            }
            tol = (settings.r_tol * err / err0).min(settings.c_fact * tol);
            let target = match settings.method {
                Method::Inexact => tol * err0,
                Method::Exact => EXACT * err0,
            };
            let safeguarded = guarded > 0;
            let before = (attempt > 0).then(|| point.clone());
            let with_rho = if self.law.is_coulomb() {
                self.rho * LONGER.powi(attempt.max(1))
            } else {
                set_rho
            };
            let made = if safeguarded {
                guarded -= 1;
                self.safeguarded_step(point, target, err, faces)
            } else {
                self.newton_step(point, &mut cg, with_rho, target, err, settings.method)
            };
            let (sets, inner) = match made {
                Ok(step) => step,
                Err(error) => {
                    // In the middle of a step the point need not be feasible.
                    *point = best;
                    return Err(error);
                }
            };
            if let Some(before) = before
                && self.search(&before, point)
            {
                cg = None;
            }
            err = self.error(point);
            history.push(Step {
                iter: history.len() + 1,
                inner,
                n_a: self.products.n_a,
                err: err / err0,
                sets: sets.sizes(|i| self.problem.has_friction(i)),
                changes: previous.map_or(0, |old| old.differences(&sets)),
                safeguarded,
            });
            previous = Some(sets);
            let stopped = observer(history.last().expect("just pushed")).is_break();

            if self.law.is_coulomb() {
                // No function falls along the way: the error itself has to say.
                fruitless += 1;
                if err <= PROGRESS * best_err {
                    (fruitless, attempt) = (0, 0);
                } else if fruitless >= FRUITLESS {
                    (fruitless, attempt) = (0, attempt + 1);
                }
                if err < best_err {
                    (best, best_err) = (point.clone(), err);
                }
                if !stopped && attempt < ATTEMPTS {
                    continue;
                }
                *point = best.clone();
                if stopped {
                    return Ok(Status::Interrupted);
                }
                // It may have been for want of accuracy. Where there is no more to be had, other inexact solutions lead
                // other ways.
                if !self.products.sharpen() {
                    if restarts == 0 {
                        return Ok(Status::Stagnated);
                    }
                    restarts -= 1;
                    self.products.known = Subspace::default();
                }
                self.products.allow(best_err);
                self.refresh(point)?;
                err = self.error(point);
                (best, best_err) = (point.clone(), err);
                (attempt, cg) = (0, None);
                continue;
            }

            // Progress is a real part of what a projected gradient step from the best point would gain,
            // or a clearly smaller error: rounding must not pass for it.
            let lost = best.q_change(point);
            let least = self.alpha * self.error_with(&mut best.clone(), self.alpha).powi(2);
            let progress = -lost >= GAIN * least && lost < 0.0 || err <= PROGRESS * best_err;
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
                    // Not even a projected gradient step lowers q or the error: rounding, of an r that was
                    // carried along or of what is left to do.
                    let before = self.refreshed;
                    self.make_exact(point)?;
                    err = self.error(point);
                    if !(err <= 0.5 * before) {
                        return Ok(Status::Stagnated);
                    }
                    self.refreshed = err;
                    best = point.clone();
                    first = point.clone();
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
}
