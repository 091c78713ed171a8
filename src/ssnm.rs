//! The semi-smooth Newton method in dual form: Algorithms SSNM and ISSNM of the paper, with a safeguard.
//!
//! The contact problem (1)–(3) is the minimisation of q(λ) = ½ λᵀAλ − λᵀb (8) over
//! Λ = {λν ≥ 0, |λτ| ≤ g}, in space with discs: ‖λτ,i‖ ≤ gᵢ. Each outer step predicts the active sets from λ − ρr (Step 2), minimises q
//! with the inactive multipliers on their bounds by conjugate gradients (Step 3), and measures the
//! reduced gradient (10) at the projection of the result (Step 3.4).
//!
//! | of the paper | where |
//! |---|---|
//! | Algorithms SSNM, ISSNM: the loop, Step 3.1 | `Newton::run` |
//! | Step 1 | `check` (`Newton::step_1`), the final check with it |
//! | Step 2: 𝒜ν, ℐν, 𝒜τ, ℐτ⁺, ℐτ⁻ | `sets` (`Sets::predict`), node by node in `constraint` |
//! | Step 3.2, P_Λ after 3.3 | `step` (`Newton::newton_step`) |
//! | Step 3.3: CGM, the problem (11) | `cg`, under Coulomb's law `gcr`; what both share in `inner` |
//! | Step 3.4: err, (10) | `newton` (`Newton::error`) |
//! | P_Λ: (4), (5) | `constraint` (`Disc::project`) |
//! | q (8) and its gradient r (9) | `point` (`Point::q_change`), `products` |
//! | λ⁰, err⁰, ρ = β/σ_max | `setup` |
//!
//! Eight things go beyond the text of the paper, none of which changes the limit:
//!
//! - **Discs.** In space λτ of a node that slips moves along the tangent of its circle. Complementarity there is
//!   rτ + κλτ = 0, so that (11) becomes min ½ zᵀ(A + diag κ)z + zᵀr over one tangent per slipping node (`face`), κ costs no
//!   product, and CG is preconditioned by diag(c + κ), c the mean of diag(A). P_Λ takes λτ back to the circle. In the
//!   plane there are no tangents, and nothing of this is left.
//! - **Products are carried.** r = Aλ − b is updated along with λ, so a product with A is spent only on
//!   a direction of CG, on the jump of the multipliers that change to a bound, and on P_Λ(λ) − λ. Where
//!   products are a matter of iterations they are as accurate as need be (`products`).
//! - **CG is continued, not restarted,** where the next step has the same sets, and it is cut short once
//!   its residual is below a part of the last error and the sets that it would lead to have changed.
//! - **Multipliers are scaled** (`scaling`) where the stiffness under the contact varies by more than a factor of four.
//! - **Known products are used again** (`subspace`). All directions with a known product span a subspace; its part that
//!   vanishes on the held multipliers is minimised over for nothing before CG starts on new sets.
//! - **Bodies are kept in balance.** Where bodies can move as a whole, Λ is Λₑ = {λ ∈ Λ: Gλ = e}
//!   (`dual::balance`). Its projection, which costs no product with A, takes the place of P_Λ everywhere, and
//!   the minimisation (11) keeps Gλ = e. The multiplier of the balance that the projection of λ − ρ(Aλ − b)
//!   brings with it is ρα, α the rigid motion: r is Aλ − b − Gᵀα with this α at every prediction. So bodies cross
//!   gaps, tip and settle in the projection, the sets are always those of forces in balance, and where Λₑ is
//!   empty that is known before the first product.
//! - **Coulomb's law.** Where g = μλν the tangential multipliers of slipping nodes follow the normal ones in
//!   the inner problem (`face`, `gcr`), the error (10) is that with g = μλν of the same point, and the point stays on
//!   the law's cones. In space what is predicted to separate bears no friction from the start of a step, and a step takes the
//!   sets that the last one has put multipliers on. Nothing is minimised then: steps are accepted while the error
//!   falls every few of them, then made in other ways, then given up (`docs/coulomb.md`); `quasistatic` goes on from there.
//! - **The safeguard** (`safeguard`). The iterates are feasible and the change of q between them is known for nothing.
//!   Steps that lower neither the best q nor the best error are discarded: from the best point a
//!   projected gradient step with ρ = 1/σ_max < 2/σ_max lowers q by at least a fixed part of ‖r̃‖²
//!   (Kučera 2008, reference 2 of the paper), minimising over the face of Λ reached lowers it further,
//!   and the set prediction uses no more than that ρ from then on. Each time it acts it stays for twice
//!   as many steps, hence q decreases to its minimum whatever β was. In space faces are visited with circles linearised,
//!   and what has left Λ along the tangents goes back in the end, as far as q falls on the chord.

mod cg;
mod check;
mod face;
mod gcr;
mod goal;
mod inner;
mod law;
mod newton;
mod point;
mod products;
mod safeguard;
mod scaling;
mod sets;
mod settings;
mod setup;
mod solution;
mod step;
mod subspace;

pub use point::project;
pub use sets::{SetSizes, Sets, SlipSizes};
pub use settings::{Memory, Method, Settings, SettingsError};
pub use solution::{Cause, Info, Solution, SolveError, Status, Step};

use crate::dual::{DualError, DualOperator};
use crate::problem::ContactProblem;
use check::Ended;
use goal::{Goal, forces_met};
use newton::{Newton, Way};
use safeguard::{Plan, Safeguard};
use scaling::Scaled;
use setup::{SetUp, Start};
use std::ops::ControlFlow;
use std::time::Instant;

/// The violation of the optimality conditions that `converged` allows, relative to ε.
pub(crate) const MET: f64 = 10.0;
/// The residual of the inner problems in Algorithm SSNM, relative to err⁰.
const EXACT: f64 = 1e-12;
/// CG may stop early, on sets that have changed, once its residual is below this part of err.
const SETS_CHANGED: f64 = 0.3;
/// Directions handed on from one solve to the next: the fewer, the cheaper they are to fit to new sets.
const REMEMBERED: usize = 40;

/// Solves the problem with a dual operator that was made for it, or for one with the same K, N and T: load and gap are
/// handed to the operator here.
///
/// `observer` is called after every outer step and may stop the solve.
///
/// # Errors
/// If a setting makes no sense, if the operator is that of a problem of another size, or if it fails; the error keeps
/// λ and the steps made. To be stopped or not to converge is no error but a [`Status`].
pub fn solve<const D: usize>(
    problem: &ContactProblem<D>,
    dual: &mut (impl DualOperator + ?Sized),
    settings: &Settings,
    mut observer: impl FnMut(&Step) -> ControlFlow<()>,
) -> Result<Solution<D>, SolveError> {
    let begin = Instant::now();
    settings.check()?;
    settings.check_for(problem)?;
    let expected = (problem.stiffness().n_rows(), D * problem.m());
    let found = dual.size();
    if found != expected {
        return Err(Cause::OtherProblem { expected, found }.into());
    }
    // What no contact can balance of the load is left out of it.
    let dual = Scaled::new(problem, dual);
    let start = Start::new(problem, &dual, settings);
    let (imbalance, driven) = (start.imbalance.clone(), start.driven.clone());
    let reduced = start.reduced(problem);
    let held = reduced.as_ref().unwrap_or(problem);
    let SetUp {
        mut newton,
        mut way,
        first_error,
        n_a_sigma,
        seconds: setup_seconds,
        outcome,
    } = SetUp::new(held, dual, start, settings, begin);

    let outcome = outcome.and_then(|()| newton.run(&mut way, settings, &mut observer));
    if let Some(memory) = settings.memory {
        let mut memory = memory.borrow_mut();
        memory.mean = newton.products.mean;
        if newton.products.are_exact() {
            let known = std::mem::take(&mut newton.products.known);
            memory.known = known.latest(REMEMBERED);
        }
    }
    let (mut status, u, mut kkt) = match newton.end(&mut way.point, outcome) {
        Ok(ended) => ended,
        Err(error) => {
            return Err(SolveError {
                cause: error.into(),
                lambda: newton.unscaled(&way.point).0,
                history: way.history,
            });
        }
    };

    let bounds = newton.law.bounds(&way.point.lambda);
    let sets = Sets::at_solution(&way.point.lambda, &way.point.r, newton.alpha, &bounds);
    let err_relative = newton.relative(&mut way.point, way.err0);
    let (lambda, r) = newton.unscaled(&way.point);
    // However it came about: what meets all conditions is a solution.
    if status == Status::Stagnated
        && err_relative <= settings.tolerance
        && kkt.max() <= MET * settings.tolerance
        && forces_met(settings.tolerance, held, &lambda, &r)
    {
        status = Status::Converged;
    }
    if !imbalance.is_empty() {
        kkt = problem.kkt(&u, &lambda);
        // What no λ ∈ Λ balances is known before the first step, however far the rest was solved.
        if matches!(
            status,
            Status::Converged | Status::Stagnated | Status::IterationLimit
        ) {
            status = Status::NotHeld;
        }
    }
    let info = Info {
        iter: way.history.len(),
        n_a: newton.products.n_a,
        first_met: way.first_met,
        n_a_sigma,
        rho: newton.rho,
        sigma_max: newton.products.sigma,
        first_error,
        err_relative,
        kkt,
        history: way.history,
        setup_seconds,
        solve_seconds: begin.elapsed().as_secs_f64() - setup_seconds,
    };
    Ok(Solution {
        status,
        u,
        lambda,
        sets,
        imbalance,
        driven,
        info,
    })
}

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// Algorithm ISSNM, and SSNM: outer steps until the final check is content with a point that meets the goal, or a
    /// reason to stop.
    fn run(
        &mut self,
        way: &mut Way<D>,
        settings: &Settings,
        observer: &mut impl FnMut(&Step) -> ControlFlow<()>,
    ) -> Result<Status, DualError> {
        way.err = self.error(&mut way.point);
        let mut goal = Goal::new(self.tolerance);
        let mut safeguard = Safeguard::new(self, way);
        loop {
            // Step 1.
            match self.step_1(way, &mut goal)? {
                Ended::With(status) => return Ok(status),
                Ended::Again => {
                    safeguard.go_on_from_check(&way.point, way.err);
                    continue;
                }
                Ended::NotYet => {}
            }
            let stop = self.products.stop.now();
            if stop.is_some() || way.history.len() >= settings.max_iterations {
                way.go_back_to(safeguard.best());
                return Ok(stop.map_or(Status::IterationLimit, Status::from));
            }
            match self.below_the_goal(way, &goal)? {
                Ended::With(status) => return Ok(status),
                Ended::Again => {
                    safeguard.go_on_from(&way.point);
                    continue;
                }
                Ended::NotYet => {}
            }
            // Step 3.1.
            way.tol = (settings.r_tol * way.err / way.err0).min(settings.c_fact * way.tol);
            let target = match self.method {
                Method::Inexact => way.tol * way.err0,
                Method::Exact => EXACT * way.err0,
            };
            // Steps 2, 3.2 and 3.3, or what the safeguard puts in their place.
            let longest = if D > 2 { self.alpha } else { f64::INFINITY };
            let plan = safeguard.plan(self.rho.min(longest));
            let (sets, inner) = match self.step(way, plan, target) {
                Ok(made) => made,
                Err(error) => {
                    // In the middle of a step the point need not be feasible.
                    way.go_back_to(safeguard.best());
                    return Err(error);
                }
            };
            // Step 3.4.
            way.err = self.error(&mut way.point);
            let made = Step {
                iter: way.history.len() + 1,
                inner,
                n_a: self.products.n_a,
                err: way.err / way.err0,
                sets: sets.sizes(|i| self.problem.has_friction(i)),
                changes: (way.sets.as_ref()).map_or(0, |old| old.differences(&sets)),
                safeguarded: matches!(plan, Plan::Gradient { .. }),
            };
            way.history.push(made);
            way.sets = Some(sets);
            let stopped = observer(&made).is_break();
            if let Some(status) = self.judge(&mut safeguard, way, stopped)? {
                return Ok(status);
            }
        }
    }
}
