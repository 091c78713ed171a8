//! A point of the way, and the projected gradient step from it.

use crate::constraint::{Disc, at, put};
use crate::dual::balance::Balance;
use crate::sparse::{add_times, difference, norm, norm_max};

/// λ with its gradient r = Aλ − b − Gᵀα.
#[derive(Clone)]
pub(super) struct Point {
    pub lambda: Vec<f64>,
    pub r: Vec<f64>,
    /// α; empty where all bodies are held.
    pub motion: Vec<f64>,
}

impl Point {
    /// q(to) − q(self) = ½ (λ' − λ)ᵀ(r + r'): free of the cancellation of a difference. Between points in balance
    /// α has no part in it.
    pub fn q_change(&self, to: &Self) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.r.len() {
            sum += (to.lambda[i] - self.lambda[i]) * (self.r[i] + to.r[i]);
        }
        0.5 * sum
    }

    /// The part of [`Point::q_change`] that is rounding of the multipliers. On a circle, where r does not vanish, it
    /// hides changes below about the square root of the rounding unit of f64.
    pub fn q_rounding(&self, to: &Self) -> f64 {
        let mut sum = 0.0;
        for i in 0..self.r.len() {
            sum += self.lambda[i].abs().max(to.lambda[i].abs()) * (self.r[i] + to.r[i]).abs();
        }
        4.0 * f64::EPSILON * sum
    }

    /// The point at the part t of the way to another one.
    pub fn towards(&self, end: &Self, t: f64) -> Self {
        if t == 1.0 {
            return end.clone();
        }
        let between = |y: &[f64], z: &[f64]| -> Vec<f64> {
            y.iter().zip(z).map(|(y, z)| y + t * (z - y)).collect()
        };
        Self {
            lambda: between(&self.lambda, &end.lambda),
            r: between(&self.r, &end.r),
            motion: between(&self.motion, &end.motion),
        }
    }

    /// The part of the way to `end` at which q is lowest.
    pub fn lowest_part(&self, end: &Self) -> f64 {
        let (mut slope, mut curvature) = (0.0, 0.0);
        for i in 0..self.r.len() {
            let step = end.lambda[i] - self.lambda[i];
            slope += step * self.r[i];
            curvature += step * (end.r[i] - self.r[i]);
        }
        match curvature > 0.0 {
            true => (-slope / curvature).clamp(0.0, 1.0),
            false if slope < 0.0 => 1.0,
            false => 0.0,
        }
    }
}

/// P_Λ of the paper: the projections (4) on λν ≥ 0 and (5) on |λτ| ≤ g (in space on a disc). λ has length D m, g
/// length m.
pub fn project<const D: usize>(lambda: &mut [f64], g: &[f64]) {
    for (i, &g) in g.iter().enumerate() {
        let projected = Disc { g }.project::<D>(at(lambda, i));
        put(lambda, i, projected);
    }
}

/// A projected gradient step that keeps the bodies in balance.
pub(super) struct GradientStep {
    /// Its end.
    pub end: Vec<f64>,
    /// Its start, with the α for it.
    pub start: Point,
}

/// That of length ρ from a point, under the bounds g. Components of α that nothing moves keep their values of the
/// point.
pub(super) fn gradient_step<const D: usize>(
    point: &Point,
    rho: f64,
    g: &[f64],
    balance: Option<&Balance>,
) -> GradientStep {
    let step = |point: &Point| -> Vec<f64> {
        (point.lambda.iter().zip(&point.r))
            .map(|(l, r)| l - rho * r)
            .collect()
    };
    let mut start = point.clone();
    let Some(balance) = balance else {
        let mut end = step(point);
        project::<D>(&mut end, g);
        return GradientStep { end, start };
    };
    let mut once = || {
        let near = balance.nearest(&step(&start), |i, z: [f64; D]| Disc { g: g[i] }.nearest(z));
        let forces = balance.spread(&near.eta);
        add_times(-1.0 / rho, &forces, &mut start.r);
        let moved = balance.coefficients(&near.eta);
        add_times(1.0 / rho, &moved, &mut start.motion);
        (near.lambda, norm_max(&forces))
    };
    let (mut end, forces) = once();
    // A result that is a difference of larger forces is computed once more from its own position.
    if !(forces <= norm_max(&end)) {
        end = once().0;
    }
    GradientStep { end, start }
}

/// ‖a − b‖.
pub(super) fn distance(a: &[f64], b: &[f64]) -> f64 {
    norm(&difference(a, b))
}
