//! The friction law of each contact node, in scaled multipliers.

use super::point::project;
use super::scaling::Scaled;
use crate::constraint::{Disc, Projected, at, lawful, tangential};
use crate::dual::balance::Balance;
use crate::problem::{ContactProblem, coulomb_bound, coulomb_bounds};
use std::borrow::Cow;

/// |λτ,i| ≤ gᵢ with gᵢ given (Tresca; 0 without friction; ∞ where a node is tied) or gᵢ = μᵢλν,i (Coulomb).
pub(super) struct Law {
    /// ĝ.
    given: Vec<f64>,
    /// μ̂, 0 where ĝ is given; empty without Coulomb friction.
    mu: Vec<f64>,
}

impl Law {
    pub fn new<const D: usize, K>(problem: &ContactProblem<D, K>, dual: &Scaled) -> Self {
        let coefficient = problem.friction_coefficient().iter().enumerate();
        Self {
            given: dual.slip_bound::<D>(problem.slip_bound()),
            mu: coefficient
                .map(|(i, mu)| mu * dual.factor(i) / dual.tangential_factor::<D>(i))
                .collect(),
        }
    }

    /// Whether some bounds are μλν.
    pub fn is_coulomb(&self) -> bool {
        !self.mu.is_empty()
    }

    /// μ̂ of a node, 0 where its bound is given.
    pub fn mu(&self, i: usize) -> f64 {
        self.mu.get(i).copied().unwrap_or(0.0)
    }

    /// The bounds at λ.
    pub fn bounds(&self, lambda: &[f64]) -> Cow<'_, [f64]> {
        coulomb_bounds(&self.given, &self.mu, lambda)
    }

    /// The bound of a node with the normal multiplier λν.
    pub fn bound(&self, i: usize, normal: f64) -> f64 {
        coulomb_bound(self.given[i], self.mu(i), normal)
    }

    /// A nearby point that obeys the law: λν cut at 0, then λτ at its bound. Without Coulomb friction this is P_Λ.
    fn cut<const D: usize>(&self, lambda: &mut [f64]) {
        let g = self.bounds(lambda);
        project::<D>(lambda, &g);
    }

    /// The nearest point of a node's interval or cone.
    pub fn nearest<const D: usize>(&self, i: usize, z: [f64; D]) -> Projected<D> {
        lawful(self.given[i], self.mu(i), z)
    }

    /// The multipliers of a node that solve its contact problem with the identity for A: λν = max(0, zν), then λτ within its
    /// bound next to zτ; with the derivative.
    pub fn solve<const D: usize>(&self, i: usize, z: [f64; D]) -> Projected<D> {
        let mu = self.mu(i);
        let normal = z[0].max(0.0);
        let g = self.bound(i, normal);
        let (end, mut derivative) = Disc { g }.nearest(z);
        let length = tangential(z);
        if mu > 0.0 && normal > 0.0 && length > g {
            // λτ = μλν s: the bound moves with λν.
            for a in 1..D {
                derivative[a][0] = mu * z[a] / length;
            }
        }
        (end, derivative)
    }

    /// Moves λ to a point that obeys the law and balances the bodies; a λ that already does so is unchanged.
    pub fn project<const D: usize>(&self, lambda: &mut Vec<f64>, balance: Option<&Balance>) {
        if balance.is_none() || self.is_coulomb() {
            self.cut::<D>(lambda);
        }
        // The nearest point of Λₑ is in Λ; under Coulomb's law a point that is cut and in balance may stay.
        if let Some(balance) = balance
            && !(self.is_coulomb() && balance.holds(lambda))
        {
            let near = balance.nearest(lambda, |i, z: [f64; D]| self.nearest(i, z));
            *lambda = near.lambda;
        }
    }

    /// Balances the bodies to rounding by the multipliers that bear forces, if possible. A force on a node with a gap,
    /// however small, is work that no step can take back.
    pub fn balance<const D: usize>(&self, lambda: &mut Vec<f64>, balance: &Balance) {
        if balance.holds(lambda) {
            return;
        }
        let before = lambda.clone();
        let near = balance.nearest(lambda, |i, mut z: [f64; D]| {
            let bears: [f64; D] = at(&before, i);
            if bears.iter().all(|&v| v == 0.0) {
                return ([0.0; D], [[0.0; D]; D]);
            }
            // Given bounds permit friction at a node without pressure.
            if bears[0] == 0.0 {
                z[0] = 0.0;
            }
            self.nearest(i, z)
        });
        if near.balanced {
            *lambda = near.lambda;
        } else {
            self.project::<D>(lambda, Some(balance));
        }
    }

    /// The same law on all of m nodes.
    #[cfg(test)]
    pub fn with(m: usize, given: f64, mu: f64) -> Self {
        let mu = if mu > 0.0 { vec![mu; m] } else { Vec::new() };
        Self {
            given: vec![given; m],
            mu,
        }
    }
}
