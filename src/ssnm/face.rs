//! What is free in an outer step, and how it moves.

use super::law::Law;
use super::sets::Sets;
use crate::constraint::{at, put};
use crate::dual::balance::{Balance, FaceBalance};
use std::rc::Rc;

/// The unknowns y of a step: λ moves by F y.
///
/// F y has y on the free multipliers. On a node in contact that slips under Coulomb's law, λτ = sμλν: there the
/// tangential multiplier follows the normal one.
pub(super) struct Face {
    pub sets: Sets,
    /// sμ on those nodes, 0 on all others; empty where there is none.
    slope: Vec<f64>,
    /// G F, where bodies can move as a whole.
    balance: Option<FaceBalance>,
}

impl Face {
    pub fn new(sets: Sets, law: &Law, balance: Option<&Rc<Balance>>) -> Self {
        let m = sets.len() / 2;
        let mut slope = Vec::new();
        if law.is_coulomb() {
            slope = (0..m)
                .map(|i| match sets.is_separated(i) {
                    true => 0.0,
                    false => f64::from(sets.slip_sign(i)) * law.mu(i),
                })
                .collect();
            if slope.iter().all(|&s| s == 0.0) {
                slope.clear();
            }
        }
        let balance = balance.map(|balance| balance.on_face(|i| sets.is_free(i), &slope));
        Self {
            sets,
            slope,
            balance,
        }
    }

    /// sμ where the tangential multiplier of row i (of 2m) follows the normal one.
    pub fn follows(&self, i: usize) -> Option<f64> {
        let slope = *self.slope.get(i.checked_sub(self.sets.len() / 2)?)?;
        (slope != 0.0).then_some(slope)
    }

    /// From y, whatever it is elsewhere, to F y that leaves the bodies in balance.
    pub fn direction(&self, y: &mut [f64]) {
        self.lift(y);
        if let Some(balance) = &self.balance {
            balance.project(y);
        }
    }

    fn lift(&self, y: &mut [f64]) {
        self.sets.mask(y);
        for (i, &s) in self.slope.iter().enumerate().filter(|(_, s)| **s != 0.0) {
            let [normal, _] = at(y, i);
            put(y, i, [normal, s * normal]);
        }
    }

    /// The part of a gradient that a step has to remove: on the free multipliers, but for motions of the bodies.
    pub fn residual(&self, r: &mut [f64]) {
        self.sets.mask(r);
        if let Some(balance) = &self.balance {
            balance.project_residual(r);
        }
    }

    /// Balances the bodies by what is free; false where that cannot.
    pub fn balance(&self, lambda: &mut [f64]) -> bool {
        self.balance
            .as_ref()
            .is_none_or(|balance| balance.balance(lambda))
    }

    /// Gλ for a direction; empty without free bodies.
    pub fn moves(&self, direction: &[f64]) -> Vec<f64> {
        self.balance
            .as_ref()
            .map_or(Vec::new(), |balance| balance.moves(direction))
    }

    /// Whether there are bodies to be kept in balance.
    pub fn has_balance(&self) -> bool {
        self.balance.is_some()
    }
}
