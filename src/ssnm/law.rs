//! The laws of all contact nodes, in scaled multipliers.

use super::point::project;
use super::scaling::Scaled;
use crate::constraint::{SlipBound, at};
use crate::dual::balance::Balance;
use crate::problem::ContactProblem;

/// |λτ,i| ≤ gᵢ with gᵢ given (Tresca) or gᵢ = μᵢλν,i (Coulomb), node by node; no bounds where a node is tied.
pub(super) struct Law {
    nodes: Vec<SlipBound>,
    is_coulomb: bool,
}

impl Law {
    pub fn new<const D: usize, K>(problem: &ContactProblem<D, K>, dual: &Scaled) -> Self {
        let scaled = |i: usize| {
            let tangential = dual.tangential_factor::<D>(i);
            match problem.law(i) {
                SlipBound::Given(bound) => SlipBound::Given(bound / tangential),
                SlipBound::Coulomb(mu) => SlipBound::Coulomb(mu * dual.factor(i) / tangential),
                SlipBound::Tied => SlipBound::Tied,
            }
        };
        Self {
            nodes: (0..problem.m()).map(scaled).collect(),
            is_coulomb: problem.has_coulomb(),
        }
    }

    /// Whether some bounds are μλν.
    pub fn is_coulomb(&self) -> bool {
        self.is_coulomb
    }

    /// That of a node.
    pub fn of(&self, i: usize) -> SlipBound {
        self.nodes[i]
    }

    /// The bounds at λ.
    pub fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        let each = self.nodes.iter().zip(lambda);
        each.map(|(law, &normal)| law.disc(normal).g).collect()
    }

    /// Moves λ to a point that obeys the law and balances the bodies; a λ that already does so is unchanged.
    pub fn project<const D: usize>(&self, lambda: &mut Vec<f64>, balance: Option<&Balance>) {
        if balance.is_none() || self.is_coulomb {
            // λν cut at 0, then λτ at its bound. Without Coulomb friction this is P_Λ.
            let g = self.bounds(lambda);
            project::<D>(lambda, &g);
        }
        // The nearest point of Λₑ is in Λ; under Coulomb's law a point that is cut and in balance may stay.
        if let Some(balance) = balance
            && !(self.is_coulomb && balance.holds(lambda))
        {
            let near = balance.nearest(lambda, |i, z: [f64; D]| self.of(i).nearest(z));
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
            self.of(i).nearest(z)
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
        Self {
            nodes: vec![SlipBound::of(given, mu); m],
            is_coulomb: mu > 0.0,
        }
    }
}
