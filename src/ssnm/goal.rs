//! What a point has to meet before the final check is worth its price.

use crate::constraint::{Disc, at};
use crate::problem::{ContactProblem, ROUNDING, slip_violation, tangents_of};
use crate::sparse::{dot, norm, norm_max};
use std::array::from_fn;

/// What the rest of the gradient could still move a pressure by at the end, in ε times the largest pressure, if each
/// gap were that of one node alone. Neighbours share most of it: pressures were found right to 0.2 to 1.6 times
/// this figure.
const FORCES: f64 = 2000.0;
/// The part of it that is asked for under Coulomb's law, where no energy is made least, so that more is left of what a
/// force on a single node does.
const COULOMB: f64 = 0.25;
/// Pressures below this part of the tractions are none.
const NO_PRESSURE: f64 = 1e-9;

/// The goal of a solve; all in the units of the problem but for `err`.
pub(super) struct Goal {
    /// err at most.
    pub err: f64,
    /// ε.
    pub tolerance: f64,
    /// Penetration, and slip where there should be none, at most; known after the first check.
    pub slack: f64,
    /// |λνᵀ(Nu − d)| / ‖λ‖ at most; likewise.
    pub work: f64,
    /// Final checks that failed.
    pub checks: usize,
}

impl Goal {
    /// Of a solve to ε; err is set at each point.
    pub fn new(tolerance: f64) -> Self {
        Self {
            err: 0.0,
            tolerance,
            slack: f64::INFINITY,
            work: f64::INFINITY,
            checks: 0,
        }
    }

    /// Whether a point with gradient r and error err meets it. Written so that NaN never passes.
    pub fn met<const D: usize>(
        &self,
        problem: &ContactProblem<D>,
        lambda: &[f64],
        r: &[f64],
        err: f64,
    ) -> bool {
        if !(err <= self.err) || !self.forces_met(problem, lambda, r) {
            return false;
        }
        if self.checks == 0 {
            return true;
        }
        let m = problem.m();
        let (ln, lt) = lambda.split_at(m);
        let (rn, rt) = r.split_at(m);
        let penetration = rn.iter().fold(0.0, |acc: f64, r| acc.max(-r));
        let (g, c) = (problem.bounds(lambda), &problem.compliance()[m..]);
        let slip = (0..m).fold(0.0, |acc: f64, i| {
            let at = tangents_of::<D>(i);
            let slip: [f64; D] = from_fn(|a| if a == 0 { 0.0 } else { -rt[at.start + a - 1] });
            let c = norm_max(&c[at.clone()]);
            acc.max(slip_violation(&lt[at], &slip[1..], g[i], c))
        });
        let length = norm(lambda);
        penetration.max(slip) <= self.slack
            && (length == 0.0 || dot(ln, rn).abs() / length <= self.work)
    }

    /// Whether the forces are as accurate as ε asks for.
    pub fn forces_met<const D: usize>(
        &self,
        problem: &ContactProblem<D>,
        lambda: &[f64],
        r: &[f64],
    ) -> bool {
        forces_met(self.tolerance, problem, lambda, r)
    }
}

/// Whether what the gradient r at a point could still move a pressure or a traction by is as small a part of the largest
/// pressure (without pressure, of the largest traction) as ε asks for.
///
/// A gap rᵢ in what ought to be closed is closed by a force of rᵢ/cᵢ if it is that of a single node: cᵢ is
/// Σⱼ Bᵢⱼ²/Kⱼⱼ ≤ Aᵢᵢ, where nodes share what they meet (many of them on one large element) with their shares. No gap is
/// known better than to the rounding of what it is the difference of, and forces that rounding hides to the accuracy asked
/// for are none.
pub(super) fn forces_met<const D: usize>(
    tolerance: f64,
    problem: &ContactProblem<D>,
    lambda: &[f64],
    r: &[f64],
) -> bool {
    let asked = tolerance
        * match problem.has_coulomb() {
            true => COULOMB * FORCES,
            false => FORCES,
        };
    let (areas, compliance) = (problem.areas(), problem.own_compliance());
    let (bounds, offsets) = (problem.bounds(lambda), problem.offsets());
    let terms = offsets
        .iter()
        .zip(r)
        .map(|(c, r)| c.abs().max((c - r).abs()));
    let rounding = ROUNDING * terms.fold(problem.reach(), f64::max);
    let (mut pressure, mut traction) = (0.0_f64, 0.0_f64);
    let mut off = 0.0_f64;
    for (i, (&g, &area)) in bounds.iter().zip(areas).enumerate() {
        let [node, slope, c] = [lambda, r, compliance].map(|x| at::<D>(x, i));
        let disc = Disc { g };
        let wanted: [f64; D] = from_fn(|a| {
            if c[a] > 0.0 {
                node[a] - slope[a] / c[a]
            } else {
                node[a]
            }
        });
        let met = disc.project(wanted);
        for a in 0..D {
            if asked * c[a] * node[a].abs() > rounding {
                let largest = if a == 0 { &mut pressure } else { &mut traction };
                *largest = largest.max(node[a].abs() / area);
            }
            if !(c[a] > 0.0) {
                continue;
            }
            let moved = (met[a] - node[a]).abs() / area;
            // NaN must not pass.
            if moved.is_nan() || wanted[a].is_nan() {
                return false;
            }
            if slope[a].abs() > rounding {
                off = off.max(moved);
            }
        }
    }
    // Under given bounds tractions may be all there is.
    let largest = if pressure > NO_PRESSURE * traction {
        pressure
    } else {
        traction
    };
    largest == 0.0 || off <= asked * largest
}
