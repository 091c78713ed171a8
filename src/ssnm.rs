//! The semi-smooth Newton method in dual form: Algorithms SSNM and ISSNM of the paper, on A itself and on a surrogate of it.
//!
//! The contact problem (1)–(3) is the minimisation of q(λ) = ½ λᵀAλ − λᵀb (8) over Λ = {λν ≥ 0, |λτ| ≤ g}, in space with discs:
//! ‖λτ,i‖ ≤ gᵢ. The cost is counted in products with A.
//!
//! **On a surrogate** (`multisecant`, the default; `docs/method.md`). All known pairs (v, Av) make a surrogate Ã of A
//! (`surrogate`). Each outer step solves the whole contact problem with Aλ − b replaced by rᵏ + Ã(λ − λᵏ), without
//! products (`subproblem`: Algorithm SSNM in as many unknowns as there are pairs). It spends one product on the step to
//! its solution. The product gives the exact q on the chord, whose minimum is the next point, the new pair, and r.
//!
//! **As printed** (`printed`): each outer step predicts the active sets from λ − ρr (Step 2). It minimises q with the
//! inactive multipliers on their bounds by conjugate gradients (Step 3), and measures the reduced gradient (10) at the
//! projection of the result (Step 3.4). The next sets are those of the result itself, and λ continues from its
//! projection, with the inactive multipliers on the bounds of these sets.
//!
//! | of the paper | where |
//! |---|---|
//! | Algorithms SSNM, ISSNM: the loop | `outer` (`Newton::run`) |
//! | Step 1 | `check` (`Newton::step_1`), with the final check; what ends a solve: `goal` (`Goal::judge`) |
//! | Step 2: 𝒜ν, ℐν, 𝒜τ, ℐτ⁺, ℐτ⁻ | `sets` (`Sets::predict`), node by node in `constraint`; on the surrogate within `SlipBound::solve` |
//! | Steps 3.1 and 3.2, P_Λ after 3.3 | `printed` (`AsPrinted::make`, `Newton::newton_step`) |
//! | Step 3.3: CGM, the problem (11) | `inner` (`minimise`) |
//! | Step 3.4: err, (10) | `gauge` (`Gauge::error`) |
//! | P_Λ: (4), (5) | `constraint` (`Disc::project`) |
//! | q (8) and its gradient r (9) | `point` (`Point::q_change`), `products` |
//! | Λ, λ⁰, err⁰, ρ = β/σ_max | `dual_problem`, `setup`, `gauge` |
//!
//! Extensions beyond the text of the paper have the same solutions, except for Coulomb's law, which the paper does not treat:
//!
//! - **Discs.** In space λτ of a node that slips moves along the tangent of its circle. Complementarity there is rτ +
//!   κλτ = 0, so that (11) becomes min ½ zᵀ(A + diag κ)z + zᵀr over one tangent per slipping node (`face`). κ costs no
//!   product, and CG is preconditioned by diag(c + κ), c the mean of diag(A). P_Λ takes λτ back to the circle.
//! - **Products** made by iterations are only as accurate as necessary, and r is computed from a u that follows λ (`products`).
//! - **Multipliers are scaled** (`scaling`) where the stiffness under the contact varies by more than a factor of four.
//! - **Bodies are kept in balance.** Where bodies can move as a whole, Λ is Λₑ = {λ ∈ Λ: Gλ = e} (`dual::balance`). Its
//!   projection, which costs no product with A, replaces P_Λ everywhere. The multiplier of the balance in the
//!   projection of λ − ρ(Aλ − b) is ρα, where α is the rigid-body motion: r is Aλ − b − Gᵀα with this α. So bodies
//!   cross gaps, tip over and come to rest in the projection. The sets are always those of forces in balance, and an
//!   empty Λₑ is detected before the first product.
//! - **Coulomb's law.** Where g = μλν the tangential multipliers of slipping nodes follow the normal ones in each
//!   Newton step. The error (10) is that with g = μλν of the same point (`docs/coulomb.md`). Nothing is minimised then:
//!   the method takes the point of least error on the chord.
//! - **The stop** is err ≤ ε times the largest of three errors: err⁰, the effect of the forces on their own nodes, and
//!   the rounding of r divided by ε (`check`, Step 1). In addition, forces have to be as accurate as ε requires
//!   (`goal`), and the optimality conditions are checked against K.
//! - **Numbers** that come neither from the paper nor from the user are in one table (`numbers`).
//! - **Safeguards.** Under given bounds q decreases in each step on the surrogate, by the minimum on the chord, up to
//!   the error of products. Projected gradient steps make the algorithms as printed converge (`safeguard`).

mod check;
mod dual_problem;
mod face;
mod gauge;
mod goal;
mod inner;
mod known;
mod law;
mod multisecant;
mod newton;
mod numbers;
mod outer;
mod pairs;
mod point;
mod printed;
mod products;
mod safeguard;
mod scaling;
mod sets;
mod settings;
mod setup;
mod solution;
mod subproblem;
mod surrogate;
#[cfg(test)]
mod tests;

pub use numbers::Numbers;
pub use point::project;
pub use sets::{SetSizes, Sets, SlipSizes};
pub use settings::{Method, NewtonSettings, RecycledSubspace, SettingsError, WarmStart};
pub use solution::{Cause, Info, Solution, SolveError, Status, Step};

use crate::control::Stop;
use crate::dual::{DualError, DualOperator};
use crate::problem::{ContactProblem, Elsewhere};
use check::Certificate;
use dual_problem::DualProblem;
use newton::Newton;
use outer::Way;
use scaling::Scaled;
use std::ops::ControlFlow;
use web_time::Instant;

/// The violation of the optimality conditions that `converged` allows, relative to ε.
pub(crate) const MET: f64 = 10.0;
/// Exact up to rounding, to the limit of solvers. This is the residual of the inner problems in Algorithm SSNM relative
/// to err⁰, the error of its products by PCG, and the residual below which a more accurate u gains nothing.
const EXACT: f64 = 1e-12;

/// Solves the problem from λ⁰ = 0: [`solve_from`].
///
/// # Errors
/// As [`solve_from`].
pub fn solve<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    dual: &mut dyn DualOperator,
    settings: &NewtonSettings,
    observer: impl FnMut(&Step) -> ControlFlow<()>,
) -> Result<Solution<D>, SolveError> {
    solve_from(WarmStart::default(), problem, dual, settings, observer)
}

/// Solves the problem with a dual operator made for it, or for one with the same K, N and T. The load is passed to the
/// operator with each request.
///
/// `observer` is called after every outer step and may stop the solve.
///
/// # Errors
/// If a setting is invalid, if the start or the operator has another size than the problem, or if the operator fails; the
/// error keeps λ and the steps made. A solve that is stopped or does not converge is not an error but has a [`Status`].
pub fn solve_from<const D: usize, K>(
    start: WarmStart,
    problem: &ContactProblem<D, K>,
    dual: &mut dyn DualOperator,
    settings: &NewtonSettings,
    mut observer: impl FnMut(&Step) -> ControlFlow<()>,
) -> Result<Solution<D>, SolveError> {
    solve_elsewhere(start, &problem.elsewhere(), dual, settings, &mut observer)
}

/// The same, compiled once for all K and observers.
pub(crate) fn solve_elsewhere<const D: usize>(
    mut start: WarmStart,
    problem: &ContactProblem<D, Elsewhere>,
    dual: &mut dyn DualOperator,
    settings: &NewtonSettings,
    observer: &mut dyn FnMut(&Step) -> ControlFlow<()>,
) -> Result<Solution<D>, SolveError> {
    let begin = Instant::now();
    settings.check()?;
    start.check_for(problem)?;
    let mut own = RecycledSubspace::default();
    let recycled = start.recycled.take().unwrap_or(&mut own);
    let expected = (problem.n_rows(), D * problem.m());
    let found = dual.size();
    if found != expected {
        return Err(Cause::OtherProblem { expected, found }.into());
    }
    let scaled = Scaled::new(problem, dual, settings.numbers.scaling);
    let dual = DualProblem::new(problem, &scaled, settings, start.motion);
    // Forces that do not balance the bodies are not a usable start.
    let is_held = dual.imbalance.is_empty();
    let initial = start.lambda.filter(|_| is_held);
    let stop = Stop {
        // A limit beyond the range of the clock counts as no limit.
        deadline: (settings.time_limit).and_then(|limit| begin.checked_add(limit)),
        interrupt: settings.interrupt.as_deref(),
        ranks: None,
    };
    let mut newton = Newton::new(&dual, scaled, stop, recycled);
    let mut way = Way::new(&dual);
    let set_up = newton.set_up(&mut way, initial, recycled);
    way.setup_seconds = begin.elapsed().as_secs_f64();
    let outcome = set_up.and_then(|()| match is_held {
        true => newton.run(&mut way, observer),
        // This is known before the first step. The rest of the load is on the boundary of the loads that can be
        // balanced, often by forces that no contact reaches: its solution would say nothing more.
        false => Ok(Status::NotHeld),
    });
    if settings.method == Method::Multisecant {
        recycled.surrogate = std::mem::take(&mut newton.surrogate);
    }
    newton.solution(way, outcome, begin)
}

impl<const D: usize> Newton<'_, D> {
    /// The result of a solve that began at this time.
    fn solution(
        &mut self,
        mut way: Way<D>,
        outcome: Result<Status, DualError>,
        begin: Instant,
    ) -> Result<Solution<D>, SolveError> {
        let ended = self.end(&mut way, outcome);
        let lambda = self.unscaled(&way.point).0;
        let (mut status, Certificate { u, kkt }, err_relative) = match ended {
            Ok(ended) => ended,
            Err(error) => {
                return Err(SolveError {
                    lambda,
                    history: way.history,
                    ..error.into()
                });
            }
        };
        // A product that could not be made changes nothing about that.
        if !self.dual.imbalance.is_empty() && status == Status::Stagnated {
            status = Status::NotHeld;
        }
        let (point, length) = (&way.point, self.gauge.gradient_length());
        let bounds = self.dual.law.bounds(&point.lambda);
        let mut sets = Sets::at_solution(&point.lambda, &point.r, length, &bounds);
        let part = MET * self.dual.settings.tolerance;
        sets.slide(self.dual.whole.slipped(&u, &lambda, part));
        let info = Info {
            iter: way.history.len(),
            n_a: self.products.n_a,
            first_met: way.first_met,
            n_a_sigma: way.n_a_sigma,
            rho: self.gauge.rho(),
            sigma_max: self.gauge.sigma,
            first_error: way.err0,
            err_relative,
            kkt,
            history: way.history,
            setup_seconds: way.setup_seconds,
            solve_seconds: begin.elapsed().as_secs_f64() - way.setup_seconds,
        };
        Ok(Solution {
            status,
            u,
            lambda,
            sets,
            imbalance: self.dual.imbalance.clone(),
            mechanism: self.dual.mechanism.clone(),
            info,
        })
    }
}
