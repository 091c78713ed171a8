//! Scaling of the multipliers where the stiffness under the contact varies widely.

use crate::constraint::row_of;
use crate::control::{Accuracy, Stop};
use crate::dual::{DualError, DualOperator};
use crate::problem::ContactProblem;
use crate::sparse::{Csr, norm_max};

/// The dual operator in scaled multipliers λ̂ with λ = S λ̂: Â = S (A + C) S, b̂ = S b, ĝ = S⁻¹ g. C is that of compliant
/// contact: it is included in every product and gradient here, whatever makes A, so that the code above need not know it.
///
/// One ρ for all multipliers suits contact nodes of similar stiffness. Where materials differ, the diagonal of A varies
/// as much, and the sets that one ρ predicts are wild on one side or slow to move on the other. S evens out the
/// estimate Σⱼ Bᵢⱼ²/Kⱼⱼ + Cᵢᵢ of its diagonal, in powers of two, so that scaling back and forth is exact. It does so
/// only beyond a factor of four from the median, so that a homogeneous problem is unchanged. Corners of a block differ
/// by exactly that factor (one cell meets there, four on a face), and rounding must not decide on them.
pub(super) struct Scaled<'a> {
    /// A, in the multipliers of the problem.
    pub operator: &'a mut dyn DualOperator,
    /// S, or None for the identity.
    scale: Option<Vec<f64>>,
    /// The diagonal of C, not scaled; empty where all contact is hard.
    compliance: Vec<f64>,
    /// Contact nodes.
    m: usize,
}

impl<'a> Scaled<'a> {
    /// `power` is [`super::Numbers::scaling`].
    pub fn new<const D: usize, K>(
        problem: &ContactProblem<D, K>,
        operator: &'a mut dyn DualOperator,
        power: f64,
    ) -> Self {
        let m = problem.m();
        let mut estimates = problem.compliance().to_vec();
        // One factor for all tangents of a node, or its disc became an ellipse.
        for tangents in estimates[m..].chunks_mut(D - 1) {
            tangents.fill(norm_max(tangents));
        }
        // Rows of T may be empty.
        let mut sorted: Vec<f64> = estimates.iter().copied().filter(|&e| e > 0.0).collect();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(sorted.len() / 2).copied().unwrap_or(1.0);
        let exponent = |e: f64| (power * (median / e).log2()).trunc();
        let factor = estimates.iter().map(|&e| match e > 0.0 {
            true => exponent(e).clamp(-60.0, 60.0).exp2(),
            false => 1.0,
        });
        let scale: Vec<f64> = factor.collect();
        let needed = scale.iter().any(|&s| s != 1.0);
        Self {
            operator,
            scale: needed.then_some(scale),
            compliance: problem.contact_compliance().to_vec(),
            m,
        }
    }

    /// x ← S x: from λ̂ to λ, from a gradient r to r̂.
    pub fn times(&self, x: &mut [f64]) {
        if let Some(scale) = &self.scale {
            x.iter_mut().zip(scale).for_each(|(x, s)| *x *= s);
        }
    }

    /// The diagonal of S; empty for the identity.
    pub fn scale(&self) -> &[f64] {
        self.scale.as_deref().unwrap_or_default()
    }

    /// Sᵢᵢ.
    pub fn factor(&self, i: usize) -> f64 {
        self.scale.as_ref().map_or(1.0, |scale| scale[i])
    }

    /// The diagonal of Ĉ = S C S; empty where all contact is hard.
    pub fn compliance(&self) -> Vec<f64> {
        let entries = self.compliance.iter().enumerate();
        entries.map(|(i, c)| c * self.factor(i).powi(2)).collect()
    }

    /// S (A + C) S, if A is available as a matrix.
    pub fn matrix(&self) -> Option<Csr> {
        let matrix = self.operator.matrix()?;
        let n = matrix.n_rows();
        let given_way = self.compliance.iter().enumerate().map(|(i, &c)| (i, i, c));
        let entries = matrix.triplets().chain(given_way);
        let scaled = entries.map(|(i, j, v)| (i, j, v * self.factor(i) * self.factor(j)));
        Some(Csr::from_triplets(n, n, scaled))
    }

    /// y ← y + Cλ.
    fn give_way(&self, lambda: &[f64], y: &mut [f64]) {
        for (y, (c, l)) in y.iter_mut().zip(self.compliance.iter().zip(lambda)) {
            *y += c * l;
        }
    }

    /// λ = S λ̂.
    pub fn unscaled(&self, lambda: &[f64]) -> Vec<f64> {
        let mut unscaled = lambda.to_vec();
        self.times(&mut unscaled);
        unscaled
    }

    /// Â p.
    pub fn apply(
        &mut self,
        p: &[f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        let unscaled = self.unscaled(p);
        let mut y = vec![0.0; p.len()];
        self.operator.apply(&unscaled, &mut y, accuracy, stop)?;
        self.give_way(&unscaled, &mut y);
        self.times(&mut y);
        Ok(y)
    }

    /// r ← S (c − B u + Cλ), where r is B u and λ is not scaled.
    pub fn finish_gradient(&self, offsets: &[f64], lambda: &[f64], r: &mut [f64]) {
        r.iter_mut().zip(offsets).for_each(|(r, c)| *r = c - *r);
        self.give_way(lambda, r);
        self.times(r);
    }

    /// x ← S⁻¹ x: from λ to λ̂, from r̂ to r.
    pub fn divide(&self, x: &mut [f64]) {
        if let Some(scale) = &self.scale {
            x.iter_mut().zip(scale).for_each(|(x, s)| *x /= s);
        }
    }

    /// Sᵢᵢ of the tangential multipliers of a contact node.
    pub fn tangential_factor<const D: usize>(&self, node: usize) -> f64 {
        self.factor(row_of::<D>(self.m, node, 1))
    }
}
