//! The optimality conditions (1)–(3), and what their violations are measured by.
//!
//! Violations are relative to the problem at hand, not to where bodies have been moved as a whole nor to an
//! earlier, larger load:
//!
//! - lengths to the largest deformation, which is u without the mean rigid motion of each connected body, or
//!   if that is larger to what a contact force does to its own node at least (Σ Bᵢⱼ²/Kⱼⱼ · λᵢ);
//! - forces to those that act: the larger of ‖f‖ (without what prescribed displacements add) and ‖Bᵀλ‖.
//!
//! A difference that is no more than the rounding of its terms (32 units in the last place) counts as none: f64
//! holds nothing smaller.

use super::ContactProblem;
use crate::dense::pseudo_inverse;
use crate::sparse::{Csr, ROWS_PER_TASK, dot, norm, norm_max};
use faer::Mat;
use rayon::prelude::*;

/// Rigid motions of a part are dependent below this part of the largest eigenvalue.
const DEPENDENT: f64 = 1e-10;
/// Rounding of a sum relative to its terms.
pub(crate) const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Violations of the optimality conditions, each relative to the size of what it is measured in: see
/// [`ContactProblem::kkt`].
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Kkt {
    /// ‖Ku + Nᵀλν + Tᵀλτ − f‖ / the acting forces.
    pub equilibrium: f64,
    /// max (Nu − d)₊ / the deformation.
    pub penetration: f64,
    /// max (−λν)₊ / ‖λ‖∞.
    pub tension: f64,
    /// |λνᵀ(Nu − d)| / (‖λ‖ · the deformation).
    pub complementarity: f64,
    /// max (|λτ| − g)₊ / ‖g‖∞.
    pub friction_bound: f64,
    /// max over sticking nodes of the slip, over slipping ones of slip against the sign of λτ; / the deformation.
    /// What a tangential force lacks to its bound counts as a length, with the compliance of its node.
    pub slip: f64,
}

impl Kkt {
    /// The largest of the six; NaN if one is.
    pub fn max(&self) -> f64 {
        norm_max(&[
            self.equilibrium,
            self.penetration,
            self.tension,
            self.complementarity,
            self.friction_bound,
            self.slip,
        ])
    }
}

/// What violations are measured by.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Yardsticks {
    /// The largest component of the deformation.
    pub length: f64,
    /// Its Euclidean norm.
    pub deformation: f64,
    /// The forces that act.
    pub force: f64,
    /// What a length may be off by for rounding alone.
    pub rounding: f64,
}

impl ContactProblem {
    /// The optimality conditions (1)–(3) at (u, λ), in f64 against the assembled K, relative to the deformation
    /// and the forces of this problem (the module's head says how).
    ///
    /// `u` as long as K has rows, `lambda` of length 2m: λν, then λτ.
    pub fn kkt(&self, u: &[f64], lambda: &[f64]) -> Kkt {
        let m = self.m();
        let yardsticks = self.yardsticks(u, lambda);
        let (lambda_n, lambda_t) = lambda.split_at(m);
        let mut closing = self.along(self.normal(), u);
        for (closing, d) in closing.iter_mut().zip(self.gap()) {
            *closing = beyond(*closing - d, yardsticks.rounding);
        }
        let mut slip = self.along(self.tangential(), u);
        for (slip, origin) in slip.iter_mut().zip(self.slip_origin()) {
            *slip = beyond(*slip - origin, yardsticks.rounding);
        }
        let bound = self.bounds(lambda);
        let positive = |values: &mut dyn Iterator<Item = f64>| {
            values.fold(
                0.0,
                |acc: f64, v| if v > acc || v.is_nan() { v } else { acc },
            )
        };
        let compliance = &self.compliance()[m..];
        let slips =
            &mut (0..m).map(|i| slip_violation(lambda_t[i], slip[i], bound[i], compliance[i]));
        Kkt {
            equilibrium: ratio(self.imbalance(u, lambda), yardsticks.force),
            penetration: ratio(positive(&mut closing.iter().copied()), yardsticks.length),
            tension: ratio(positive(&mut lambda_n.iter().map(|v| -v)), norm_max(lambda)),
            complementarity: ratio(
                dot(lambda_n, &closing).abs(),
                norm(lambda) * yardsticks.deformation,
            ),
            friction_bound: ratio(
                positive(&mut (0..m).map(|i| lambda_t[i].abs() - bound[i])),
                norm_max(&bound),
            ),
            slip: ratio(positive(slips), yardsticks.length),
        }
    }

    fn along(&self, rows: &Csr, u: &[f64]) -> Vec<f64> {
        let mut sums = vec![0.0; self.m()];
        rows.mul(u, &mut sums);
        sums
    }

    /// ‖Ku + Bᵀλ − f‖, what is rounding of its terms left out.
    fn imbalance(&self, u: &[f64], lambda: &[f64]) -> f64 {
        let mut forces = self.load().to_vec();
        let mut sizes: Vec<f64> = forces.iter().map(|f| f.abs()).collect();
        let (lambda_n, lambda_t) = lambda.split_at(self.m());
        for (rows, lambda) in [(self.normal(), lambda_n), (self.tangential(), lambda_t)] {
            for (i, j, v) in rows.triplets() {
                forces[j] -= v * lambda[i];
                sizes[j] += (v * lambda[i]).abs();
            }
        }
        let k = self.stiffness();
        // K R = 0, which products with rounded numbers say the worse the farther a body has moved.
        let free = self.free_bodies();
        let back: Vec<f64> = free.resultants(u).iter().map(|a| -a).collect();
        let mut deformed = u.to_vec();
        free.add_motion(&back, &mut deformed);
        // What is left of a long way has the rounding of that.
        let reach = self.reach();
        let mut residual = vec![0.0; u.len()];
        residual
            .par_chunks_mut(2)
            .enumerate()
            .with_min_len(ROWS_PER_TASK)
            .for_each(|(i, row)| {
                let (cols, blocks) = k.row(i);
                for a in 0..2 {
                    let (mut sum, mut size) = (0.0, sizes[2 * i + a]);
                    for (&j, block) in cols.iter().zip(blocks) {
                        for b in 0..2 {
                            let column = 2 * j as usize + b;
                            sum += block[a][b] * deformed[column];
                            // Entries of u are rounded themselves.
                            size += (block[a][b] * (u[column].abs() + reach)).abs();
                        }
                    }
                    row[a] = beyond(sum - forces[2 * i + a], ROUNDING * size);
                }
            });
        norm(&residual)
    }

    /// The larger of ‖f‖, without what prescribed displacements add to it, and ‖Bᵀλ‖.
    pub(crate) fn acting_forces(&self, lambda: &[f64]) -> f64 {
        let mut forces = vec![0.0; self.load().len()];
        let (lambda_n, lambda_t) = lambda.split_at(self.m());
        self.normal().mul_transpose_add(1.0, lambda_n, &mut forces);
        (self.tangential()).mul_transpose_add(1.0, lambda_t, &mut forces);
        match self.acting.max(norm(&forces)) {
            // Nothing but prescribed displacements.
            0.0 => norm(self.load()),
            force => force,
        }
    }

    /// What violations at (u, λ) are measured by.
    pub(crate) fn yardsticks(&self, u: &[f64], lambda: &[f64]) -> Yardsticks {
        let deformation = self.deformation(u);
        let own: Vec<f64> = (self.compliance().iter().zip(lambda))
            .map(|(c, l)| c * l)
            .collect();
        Yardsticks {
            length: norm_max(&deformation).max(norm_max(&own)),
            deformation: norm(&deformation).max(norm(&own)),
            force: self.acting_forces(lambda),
            rounding: ROUNDING * (norm_max(u) + self.reach()),
        }
    }

    /// u without the mean rigid motion of each connected part of K; u itself without coordinates.
    fn deformation(&self, u: &[f64]) -> Vec<f64> {
        let Some(points) = self.coordinates() else {
            return u.to_vec();
        };
        let count = self.parts.iter().max().map_or(0, |&last| last as usize + 1);
        // The middle and the size of each part, then the normal equations of its mean motion.
        let mut middle = vec![[0.0; 3]; count];
        for (&part, x) in self.parts.iter().zip(points) {
            let sum = &mut middle[part as usize];
            *sum = [sum[0] + x[0], sum[1] + x[1], sum[2] + 1.0];
        }
        for sum in &mut middle {
            *sum = [sum[0] / sum[2], sum[1] / sum[2], sum[2]];
        }
        let mut size = vec![0.0_f64; count];
        let offset = |part: usize, x: &[f64; 2]| [x[0] - middle[part][0], x[1] - middle[part][1]];
        for (&part, x) in self.parts.iter().zip(points) {
            let [a, b] = offset(part as usize, x);
            size[part as usize] = size[part as usize].max(a.hypot(b));
        }
        let rigid = |part: usize, x: &[f64; 2]| {
            let [a, b] = offset(part, x);
            let s = if size[part] > 0.0 { size[part] } else { 1.0 };
            [[1.0, 0.0, -b / s], [0.0, 1.0, a / s]]
        };
        let moves = |unknown: usize| self.is_coupled(unknown);
        let mut gram = vec![[[0.0; 3]; 3]; count];
        let mut right = vec![[0.0; 3]; count];
        for (node, (&part, x)) in self.parts.iter().zip(points).enumerate() {
            let part = part as usize;
            for (c, row) in rigid(part, x).iter().enumerate() {
                if !moves(2 * node + c) {
                    continue;
                }
                for a in 0..3 {
                    right[part][a] += row[a] * u[2 * node + c];
                    for b in 0..3 {
                        gram[part][a][b] += row[a] * row[b];
                    }
                }
            }
        }
        let motion: Vec<[f64; 3]> = (gram.iter().zip(&right))
            .map(|(gram, right)| {
                let inverse = pseudo_inverse(&Mat::from_fn(3, 3, |a, b| gram[a][b]), DEPENDENT);
                std::array::from_fn(|a| (0..3).map(|b| inverse[(a, b)] * right[b]).sum())
            })
            .collect();
        let mut rest = u.to_vec();
        for (node, (&part, x)) in self.parts.iter().zip(points).enumerate() {
            for (c, row) in rigid(part as usize, x).iter().enumerate() {
                if moves(2 * node + c) {
                    rest[2 * node + c] -= dot(row, &motion[part as usize]);
                }
            }
        }
        rest
    }
}

/// How far λτ,i and the slip are from (3), as a length: the slip of a node that sticks, the slip against λτ,i of
/// one that does not, or what λτ,i lacks to its bound times the compliance c, whichever is less. Forces that are
/// short of their bound by a rounding error slip all the same.
pub(crate) fn slip_violation(lambda: f64, slip: f64, g: f64, c: f64) -> f64 {
    if c > 0.0 {
        c * (lambda - (lambda + slip / c).clamp(-g, g)).abs()
    } else {
        0.0
    }
}

/// What of a difference is more than the rounding of its terms.
fn beyond(difference: f64, rounding: f64) -> f64 {
    if difference.abs() <= rounding {
        0.0
    } else {
        difference - rounding.copysign(difference)
    }
}

/// a / b, and 0 where a is; infinite where only b is 0.
fn ratio(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / b }
}
