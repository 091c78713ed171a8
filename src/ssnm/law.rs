//! The laws of all contact nodes, in scaled multipliers.

use super::Numbers;
use super::point::{Point, project};
use super::scaling::Scaled;
use crate::constraint::{SlipBound, at};
use crate::dual::balance::Balance;
use crate::problem::ContactProblem;

/// |λτ,i| ≤ gᵢ with gᵢ given (Tresca) or gᵢ = μᵢλν,i (Coulomb), node by node; no bounds where a node is tied.
pub(super) struct Law {
    nodes: Vec<SlipBound>,
    /// What steps are to lower: where any bound is μλν, the error.
    pub merit: Merit,
}

/// What steps are to lower.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Merit {
    /// q (8), under given bounds.
    Energy,
    /// err (10), under Coulomb's law: there is no q.
    Error,
}

impl Merit {
    /// Whether q has fallen, by more than rounding.
    pub fn falls(self, before: &Point, after: &Point) -> bool {
        self == Self::Energy && before.q_change(after) < -before.q_rounding(after)
    }

    /// Steps without progress before the method returns to the best point.
    pub fn patience(self, numbers: &Numbers) -> usize {
        match self {
            Self::Energy => numbers.denied,
            Self::Error => numbers.patience,
        }
    }

    /// τ/c after steps without progress. Under given bounds the minimum of q on the chord makes steps as short as necessary.
    pub fn shortening(self, fruitless: usize, numbers: &Numbers) -> f64 {
        match self {
            Self::Energy => 0.0,
            Self::Error => (fruitless / numbers.fruitless.max(1)) as f64,
        }
    }
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
            merit: match problem.has_coulomb() {
                true => Merit::Error,
                false => Merit::Energy,
            },
        }
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

    /// The law with the bounds at λ as given ones.
    pub fn held_at(&self, lambda: &[f64]) -> Self {
        let each = self.nodes.iter().zip(self.bounds(lambda));
        let nodes = each.map(|(&law, g)| match law {
            SlipBound::Tied => law,
            _ => SlipBound::Given(g),
        });
        Self {
            nodes: nodes.collect(),
            merit: self.merit,
        }
    }

    /// Moves λ to a point that obeys the law and balances the bodies; a λ that already does so is unchanged.
    pub fn project<const D: usize>(&self, lambda: &mut Vec<f64>, balance: Option<&Balance>) {
        if balance.is_none() || self.merit == Merit::Error {
            // λν cut at 0, then λτ at its bound. Without Coulomb friction this is P_Λ.
            let g = self.bounds(lambda);
            project::<D>(lambda, &g);
        }
        // The nearest point of Λₑ is in Λ; under Coulomb's law a point that is cut and in balance may stay.
        if let Some(balance) = balance
            && !(self.merit == Merit::Error && balance.holds(lambda))
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
            merit: if mu > 0.0 {
                Merit::Error
            } else {
                Merit::Energy
            },
        }
    }
}
