//! Wear: contact takes off a depth in proportion to pressure and slip (Archard 1953).

use super::Elastic;
use super::stated::Flaw;
use crate::mesh::vector::length;
use crate::mesh::{ElementKind, Topology};
use crate::quasistatic::StepSolution;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;

/// The law of wear of a contact.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { coefficient = 1e-14 }"
)]
pub(super) struct Wear {
    /// Volume over force and slip, in 1/Pa: depth over pressure and slip. Of both sides together.
    pub coefficient: f64,
}

impl Wear {
    pub(super) fn fault(&self) -> Option<Flaw> {
        let k = self.coefficient;
        let unfit = !(k >= 0.0 && k.is_finite());
        unfit.then(|| {
            Flaw::of(
                "wear",
                "the coefficient of wear must be finite and not negative",
            )
        })
    }
}

/// The part of wear that may move elsewhere over cycles that are left out. With it a dovetail has 0.98 of the depth and 1.06 of the
/// volume after 1 000 cycles that all of them have.
pub(crate) const JUMP: f64 = 0.05;

/// Load steps that are repeated.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cycles {
    /// How often they are made.
    pub count: usize,
    /// Cycles are left out between which at most this part of their wear moves elsewhere.
    pub jump: f64,
}

impl Cycles {
    /// Steps that are made once.
    pub const ONCE: Self = Self {
        count: 1,
        jump: 0.0,
    };
}

/// The wear of the contacts of bodies.
pub(crate) struct Wearing {
    /// Volume over force and slip at each place; 0 of contacts that do not wear.
    volumes: Vec<f64>,
    /// Depth over force and slip.
    depths: Vec<f64>,
}

/// A place counts with at least this part of the mean area of those that share its pressure: at corners of elements of second order
/// areas may vanish.
const LEAST: f64 = 0.1;

impl<const D: usize> Elastic<D>
where
    ElementKind: Topology<D>,
{
    /// How often its load steps are made.
    pub(crate) fn cycles(&self) -> Cycles {
        self.definition.cycles()
    }

    /// How its contacts wear; None if none does.
    pub(crate) fn wearing(&self) -> Option<Wearing> {
        let places = &self.contact.places;
        let mut shared: HashMap<u32, f64> = HashMap::new();
        for place in places {
            *shared.entry(place.pool).or_default() += 1.0;
        }
        let mean = (self.contact.pooled_areas().into_iter().zip(places))
            .map(|(area, place)| area / shared[&place.pool]);
        let volume = |&pair: &u32| self.pairs[pair as usize].wear;
        let volumes: Vec<f64> = self.pair_of.iter().map(volume).collect();
        let depths = (volumes.iter().zip(places.iter().zip(mean)))
            .map(|(k, (place, mean))| k / place.area.max(LEAST * mean))
            .collect();
        let any = volumes.iter().any(|&k| k > 0.0);
        any.then_some(Wearing { volumes, depths })
    }
}

impl Wearing {
    /// The length of slip in a load step at each place that wears; 0 where it sticks.
    pub fn slips<const D: usize>(&self, solution: &StepSolution<D>) -> Vec<f64> {
        let slip = |(i, k): (usize, &f64)| {
            let sticks = solution.slip_bound[i] > 0.0 && !solution.sets.slips(i);
            if *k == 0.0 || sticks {
                return 0.0;
            }
            let mut slip = [0.0; D];
            slip[1..].copy_from_slice(&solution.slip[(D - 1) * i..][..D - 1]);
            length(slip)
        };
        self.volumes.iter().enumerate().map(slip).collect()
    }

    /// The volume that this slip under these forces takes off at each place.
    pub fn volumes<'s>(
        &'s self,
        slips: &'s [f64],
        forces: &'s [f64],
    ) -> impl Iterator<Item = f64> + 's {
        let each = self.volumes.iter().zip(slips.iter().zip(forces));
        each.map(|(k, (slip, force))| k * slip * force)
    }

    /// The depth over the force that this slip takes off at each place.
    pub fn rates(&self, slips: &[f64]) -> Vec<f64> {
        let each = self.depths.iter().zip(slips);
        each.map(|(k, slip)| k * slip).collect()
    }
}
