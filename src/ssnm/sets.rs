//! The active and inactive sets of Step 2.

use super::law::Law;
use crate::constraint::{Disc, NodeSets, at, put};

/// The sets 𝒜ν, ℐν, 𝒜τ, ℐτ⁺ and ℐτ⁻, as those that each contact node is in.
#[derive(Clone, Debug, PartialEq)]
pub struct Sets(Vec<NodeSets<2>>);

/// How many contact nodes are in each set; a separated node sticks or slips as well, if it has friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SetSizes {
    /// ℐν: not in contact.
    pub separated: usize,
    /// 𝒜τ: λτ below the bound.
    pub stick: usize,
    /// ℐτ⁺: λτ = g.
    pub slip_plus: usize,
    /// ℐτ⁻: λτ = −g.
    pub slip_minus: usize,
    /// No law of friction acts: neither stick nor slip.
    pub frictionless: usize,
}

impl Sets {
    /// Node by node, under the bounds g.
    fn of(g: &[f64], node: impl Fn(Disc, usize) -> NodeSets<2>) -> Self {
        let discs = g.iter().map(|&g| Disc { g });
        Self(discs.enumerate().map(|(i, disc)| node(disc, i)).collect())
    }

    /// The sets at λ with gradient r (Step 2).
    pub(super) fn predict(lambda: &[f64], r: &[f64], rho: f64, g: &[f64]) -> Self {
        let z: Vec<f64> = lambda.iter().zip(r).map(|(l, r)| l - rho * r).collect();
        Self::of(g, |disc, i| disc.predict(at(&z, i)))
    }

    /// The multipliers of λ ∈ Λ that lie on a bound and that a step against the gradient would push out.
    pub(super) fn binding(lambda: &[f64], r: &[f64], g: &[f64]) -> Self {
        Self::of(g, |disc, i| disc.binding(at(lambda, i), at(r, i)))
    }

    /// The sets at a solution λ ∈ Λ.
    pub(super) fn at_solution(lambda: &[f64], r: &[f64], g: &[f64]) -> Self {
        Self::of(g, |disc, i| disc.at_solution(at(lambda, i), at(r, i)))
    }

    /// Holds the free multipliers that lie on a bound; says whether there were any.
    pub(super) fn hold_at_bounds(&mut self, lambda: &[f64], g: &[f64]) -> bool {
        let before = self.n_free();
        for (i, (node, &g)) in self.0.iter_mut().zip(g).enumerate() {
            let there = Disc { g }.at_bounds(at(lambda, i));
            node.contact &= there.contact;
            node.slip = node.slip.or(there.slip);
        }
        self.n_free() < before
    }

    /// Puts the held multipliers on their bounds.
    pub(super) fn set_bounds(&self, lambda: &mut [f64], law: &Law) {
        for (i, node) in self.0.iter().enumerate() {
            let held = node.hold(at(lambda, i), |normal| law.bound(i, normal));
            put(lambda, i, held);
        }
    }

    /// Whether multiplier i (of 2m) is an unknown of the inner problem.
    pub(super) fn is_free(&self, i: usize) -> bool {
        let m = self.0.len();
        match i.checked_sub(m) {
            None => self.0[i].contact,
            Some(i) => self.0[i].slip.is_none(),
        }
    }

    /// Number of free multipliers.
    pub(super) fn n_free(&self) -> usize {
        (0..self.len()).filter(|&i| self.is_free(i)).count()
    }

    /// Zeroes what is not free.
    pub(super) fn mask(&self, x: &mut [f64]) {
        for (i, x) in x.iter_mut().enumerate() {
            if !self.is_free(i) {
                *x = 0.0;
            }
        }
    }

    /// 2m.
    pub(super) fn len(&self) -> usize {
        2 * self.0.len()
    }

    /// How many multipliers are held differently.
    pub fn differences(&self, other: &Self) -> usize {
        let pairs = self.0.iter().zip(&other.0);
        pairs
            .map(|(a, b)| usize::from(a.contact != b.contact) + usize::from(a.slip != b.slip))
            .sum()
    }

    /// Whether contact node i (of m) is separated.
    pub fn is_separated(&self, i: usize) -> bool {
        !self.0[i].contact
    }

    /// −1, 0 or +1: the sign of λτ where contact node i (of m) slips, 0 where it sticks.
    pub fn slip_sign(&self, i: usize) -> i8 {
        self.0[i].slip.map_or(0, |[_, s]| s as i8)
    }

    /// The sizes; `has_friction` says of which contact nodes (of m) a law of friction acts on.
    pub fn sizes(&self, has_friction: impl Fn(usize) -> bool) -> SetSizes {
        let mut sizes = SetSizes::default();
        for (i, node) in self.0.iter().enumerate() {
            sizes.separated += usize::from(!node.contact);
            *match self.slip_sign(i) {
                _ if !has_friction(i) => &mut sizes.frictionless,
                0 => &mut sizes.stick,
                1 => &mut sizes.slip_plus,
                _ => &mut sizes.slip_minus,
            } += 1;
        }
        sizes
    }
}
