//! The active and inactive sets of Step 2.

use super::law::Law;
use crate::constraint::{Disc, NodeSets, at, put};
use crate::problem::ContactProblem;

/// The sets 𝒜ν, ℐν, 𝒜τ and ℐτ (in the plane ℐτ⁺ and ℐτ⁻), stored as the sets of each contact node.
#[derive(Clone, Debug, PartialEq)]
pub struct Sets<const D: usize = 2>(Vec<NodeSets<D>>);

/// The numbers of contact nodes in each set; a separated node sticks or slips as well, if it has friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SetSizes {
    /// ℐν: not in contact.
    pub separated: usize,
    /// 𝒜τ: λτ within the bound, and no slip.
    pub stick: usize,
    /// ℐτ: λτ at the bound, or slip.
    #[serde(flatten)]
    pub slip: SlipSizes,
    /// No law of friction acts: neither stick nor slip.
    pub frictionless: usize,
    /// Tied: no multiplier is bounded.
    pub tied: usize,
}

impl SetSizes {
    /// The number of contact nodes.
    pub fn total(&self) -> usize {
        self.stick + self.slip.total() + self.frictionless + self.tied
    }
}

/// The number of slipping contact nodes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(untagged)]
pub enum SlipSizes {
    /// In the plane.
    Plane {
        /// ℐτ⁺: λτ = g.
        slip_plus: usize,
        /// ℐτ⁻: λτ = −g.
        slip_minus: usize,
    },
    /// In space.
    Space {
        /// ‖λτ‖ = g.
        slip: usize,
    },
}

impl Default for SlipSizes {
    fn default() -> Self {
        Self::Plane {
            slip_plus: 0,
            slip_minus: 0,
        }
    }
}

impl SlipSizes {
    /// None slips, in D dimensions.
    pub fn none<const D: usize>() -> Self {
        match D {
            2 => Self::default(),
            _ => Self::Space { slip: 0 },
        }
    }

    /// In either direction.
    pub fn total(&self) -> usize {
        match *self {
            Self::Plane {
                slip_plus,
                slip_minus,
            } => slip_plus + slip_minus,
            Self::Space { slip } => slip,
        }
    }

    fn add(&mut self, forwards: bool) {
        *match self {
            Self::Plane { slip_plus, .. } if forwards => slip_plus,
            Self::Plane { slip_minus, .. } => slip_minus,
            Self::Space { slip } => slip,
        } += 1;
    }
}

impl<const D: usize> Sets<D> {
    /// Node by node, under the bounds g.
    fn of(g: &[f64], node: impl Fn(Disc, usize) -> NodeSets<D>) -> Self {
        let discs = g.iter().map(|&g| Disc { g });
        Self(discs.enumerate().map(|(i, disc)| node(disc, i)).collect())
    }

    /// The sets at λ with gradient r (Step 2).
    pub(super) fn predict(lambda: &[f64], r: &[f64], rho: f64, g: &[f64]) -> Self {
        let z: Vec<f64> = lambda.iter().zip(r).map(|(l, r)| l - rho * r).collect();
        Self::of(g, |disc, i| disc.predict_from(at(lambda, i), at(&z, i)))
    }

    /// The multipliers of λ ∈ Λ that are on a bound and that a step against the gradient would push out.
    pub(super) fn binding(lambda: &[f64], r: &[f64], g: &[f64]) -> Self {
        Self::of(g, |disc, i| disc.binding(at(lambda, i), at(r, i)))
    }

    /// The sets at a solution λ ∈ Λ with gradient r.
    pub(super) fn at_solution(lambda: &[f64], r: &[f64], rho: f64, g: &[f64]) -> Self {
        let z: Vec<f64> = lambda.iter().zip(r).map(|(l, r)| l - rho * r).collect();
        Self::of(g, |disc, i| {
            disc.at_solution(at(lambda, i), at(r, i), at(&z, i))
        })
    }

    /// The same for the gradient of a solved problem; ρ is the ratio of forces to their effect on their own nodes.
    pub(crate) fn of_solved<K>(problem: &ContactProblem<D, K>, lambda: &[f64], r: &[f64]) -> Self {
        let compliance = problem.compliance();
        let rho = compliance.len() as f64 / compliance.iter().sum::<f64>();
        Self::at_solution(lambda, r, rho, &problem.bounds(lambda))
    }

    /// Whether the same nodes are in contact as in others, and of these the same stick.
    pub(crate) fn are_like(&self, others: &Self) -> bool {
        let mut each = self.0.iter().zip(&others.0);
        let alike = |(a, b): (&NodeSets<D>, &NodeSets<D>)| {
            let kind = |node: &NodeSets<D>| node.contact.then_some(node.slip.is_some());
            kind(a) == kind(b)
        };
        self.0.len() == others.0.len() && each.all(alike)
    }

    /// Moves nodes to the slipping ones, each with its direction.
    pub(super) fn slide(&mut self, slipping: impl Iterator<Item = (usize, [f64; D])>) {
        slipping.for_each(|(i, slip)| self.0[i].slide(slip));
    }

    /// Puts the held multipliers on their bounds.
    pub(super) fn set_bounds(&self, lambda: &mut [f64], law: &Law) {
        for (i, node) in self.0.iter().enumerate() {
            let held = node.hold(at(lambda, i), |normal| law.of(i).disc(normal).g);
            put(lambda, i, held);
        }
    }

    /// Holds λτ of separated nodes at zero where Coulomb's law permits nothing else.
    pub(super) fn hold_separated(&mut self, law: &Law) {
        for (i, node) in self.0.iter_mut().enumerate() {
            if !node.contact && law.of(i).mu() > 0.0 {
                node.hold_tangents();
            }
        }
    }

    /// Node by node.
    pub(super) fn nodes(&self) -> &[NodeSets<D>] {
        &self.0
    }

    /// Whether λτ of any contact node moves along its circle.
    pub(super) fn turn(&self) -> bool {
        self.0.iter().any(|node| node.turns)
    }

    /// Number of free multipliers.
    pub(super) fn n_free(&self) -> usize {
        self.0.iter().map(NodeSets::n_free).sum()
    }

    /// Zeroes the components that are not free.
    pub(super) fn mask(&self, x: &mut [f64]) {
        for (i, node) in self.0.iter().enumerate() {
            put(x, i, node.free_part(at(x, i)));
        }
    }

    /// The number of sets in which contact nodes differ.
    pub fn differences(&self, other: &Self) -> usize {
        let pairs = self.0.iter().zip(&other.0);
        pairs.map(|(a, b)| a.differences(b)).sum()
    }

    /// Whether contact node i (of m) is separated.
    pub fn is_separated(&self, i: usize) -> bool {
        !self.0[i].contact
    }

    /// Whether contact node i (of m) slips.
    pub fn slips(&self, i: usize) -> bool {
        self.0[i].slip.is_some()
    }

    /// The sizes under the law of a problem.
    pub fn sizes_in<K>(&self, problem: &ContactProblem<D, K>) -> SetSizes {
        let mut sizes = self.sizes(|i| problem.has_friction(i));
        sizes.tied = (0..self.0.len()).filter(|&i| problem.is_tied(i)).count();
        sizes.stick -= sizes.tied;
        sizes
    }

    /// The sizes, where none is tied; `has_friction` tells on which contact nodes (of m) a law of friction acts.
    pub fn sizes(&self, has_friction: impl Fn(usize) -> bool) -> SetSizes {
        let mut sizes = SetSizes {
            slip: SlipSizes::none::<D>(),
            ..SetSizes::default()
        };
        for (i, node) in self.0.iter().enumerate() {
            sizes.separated += usize::from(!node.contact);
            match node.slip {
                _ if !has_friction(i) => sizes.frictionless += 1,
                None => sizes.stick += 1,
                Some(s) => sizes.slip.add(s[1] > 0.0),
            }
        }
        sizes
    }
}

/// The plane.
impl Sets {
    /// −1, 0 or +1: the sign of λτ where contact node i (of m) slips, 0 where it sticks.
    pub fn slip_sign(&self, i: usize) -> i8 {
        self.0[i].slip.map_or(0, |[_, s]| s as i8)
    }
}
