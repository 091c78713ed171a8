//! The friction law of each contact node, in scaled multipliers.

use super::point::project;
use super::scaling::Scaled;
use crate::constraint::{Projected, lawful};
use crate::dual::DualOperator;
use crate::dual::balance::Balance;
use crate::problem::{ContactProblem, coulomb_bound, coulomb_bounds};
use std::borrow::Cow;

/// |λτ,i| ≤ gᵢ with gᵢ given (Tresca; 0 without friction) or gᵢ = μᵢλν,i (Coulomb).
pub(super) struct Law {
    /// ĝ.
    given: Vec<f64>,
    /// μ̂, 0 where ĝ is given; empty without Coulomb friction.
    mu: Vec<f64>,
}

impl Law {
    pub fn new<O: DualOperator + ?Sized, const D: usize>(
        problem: &ContactProblem<D>,
        dual: &Scaled<O>,
    ) -> Self {
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

    /// What obeys the law and is near: λν cut at 0, then λτ at its bound. Without Coulomb friction that is P_Λ.
    fn cut<const D: usize>(&self, lambda: &mut [f64]) {
        let g = self.bounds(lambda);
        project::<D>(lambda, &g);
    }

    /// The nearest point of a node's interval or cone.
    pub fn nearest<const D: usize>(&self, i: usize, z: [f64; D]) -> Projected<D> {
        lawful(self.given[i], self.mu(i), z)
    }

    /// Takes λ where it obeys the law and balances the bodies; where it does so, it stays.
    pub fn project<const D: usize>(&self, lambda: &mut Vec<f64>, balance: Option<&Balance>) {
        match balance {
            None => self.cut::<D>(lambda),
            Some(balance) if self.is_coulomb() => {
                self.cut::<D>(lambda);
                if !balance.holds(lambda) {
                    *lambda = balance
                        .nearest(lambda, |i, z: [f64; D]| self.nearest(i, z))
                        .lambda;
                }
            }
            Some(balance) => {
                *lambda = balance
                    .nearest(lambda, |i, z: [f64; D]| self.nearest(i, z))
                    .lambda;
            }
        }
    }
}
