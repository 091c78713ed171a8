//! What is solved: the dual problem, in scaled multipliers.

use super::NewtonSettings;
use super::law::{Law, Merit};
use super::point::Point;
use super::scaling::Scaled;
use crate::constraint::NodeSets;
use crate::dual::balance::{Balance, FaceBalance};
use crate::problem::{ContactProblem, Elsewhere, LoadCase};
use crate::sparse::add_times;
use std::rc::Rc;
use std::sync::Arc;

/// The data of (8) over Λ, or over Λₑ where bodies can move as a whole: they stay from the first step to the last.
pub(super) struct DualProblem<'a, const D: usize> {
    /// The whole problem, by which a solution is measured.
    pub whole: &'a ContactProblem<D, Elsewhere>,
    /// Without the part of the load that no contact can balance, so that a u exists for the rest.
    pub problem: ContactProblem<D, Elsewhere>,
    pub settings: &'a NewtonSettings,
    pub law: Law,
    /// If bodies can move as a whole.
    pub balance: Option<Rc<Balance>>,
    /// G on all multipliers. Products are made with balanced directions: the rest of a short step is rounding of λ, and
    /// along it A depends on where K⁻¹ holds the bodies.
    pub balanced: Option<FaceBalance<D>>,
    /// Orthonormal coefficients of the motions that no multiplier resists.
    pub free: Vec<Vec<f64>>,
    /// The λ of err⁰: 0, or the least forces that balance the bodies.
    pub least: Vec<f64>,
    /// The part of the load that no λ ∈ Λ can balance, and the motion that this drives; both are empty if Λ balances all of it.
    pub imbalance: Vec<f64>,
    pub mechanism: Vec<f64>,
    /// c.
    pub offsets: Vec<f64>,
    /// The diagonal of C; empty where all contact is hard.
    pub compliance: Vec<f64>,
    /// The diagonal of S; empty for the identity.
    pub scale: Vec<f64>,
    /// The terms of each row of B u, not scaled: [`ContactProblem::reach`].
    pub reach: Vec<f64>,
    /// λ before the load step; empty at rest.
    pub before: Vec<f64>,
    /// Rigid-body positions where neither load nor contact determines them, as coefficients of the motions.
    pub place: Option<&'a [f64]>,
}

impl<'a, const D: usize> DualProblem<'a, D> {
    /// Balances the bodies, before any product is made.
    pub fn new(
        whole: &'a ContactProblem<D, Elsewhere>,
        dual: &Scaled,
        settings: &'a NewtonSettings,
        place: Option<&'a [f64]>,
    ) -> Self {
        let (mut offsets, mut before) = (
            whole.load_case().offsets(),
            whole.load_case().before.clone(),
        );
        dual.times(&mut offsets);
        dual.divide(&mut before);
        let mut made = Self {
            whole,
            problem: whole.clone(),
            settings,
            law: Law::new(whole, dual),
            balance: None,
            balanced: None,
            free: Vec::new(),
            least: vec![0.0; D * whole.m()],
            imbalance: Vec::new(),
            mechanism: Vec::new(),
            offsets,
            compliance: dual.compliance(),
            scale: dual.scale().to_vec(),
            reach: whole.reach(),
            before,
            place,
        };
        if !whole.floating_bodies().is_empty() {
            made.balance_bodies();
        }
        made
    }

    fn balance_bodies(&mut self) {
        let (whole, law) = (self.whole, &self.law);
        let (floating, b) = (whole.floating_bodies(), whole.contact_matrix());
        let mut balance = Balance::new(floating, b, whole.load(), |i| {
            match whole.is_out_of_reach(i) {
                true => 0.0,
                false => self.factor(i),
            }
        });
        let least = balance.least(|i, z: [f64; D]| law.of(i).nearest(z));
        self.least = least.lambda;
        if !least.balanced {
            let mut force = whole.load().to_vec();
            let less: Vec<f64> = least.imbalance.iter().map(|v| -v).collect();
            floating.add_motion(&less, &mut force);
            self.problem = whole.under(LoadCase {
                acting: whole.ranks().norm(&force),
                force: Arc::new(force),
                ..whole.load_case().clone()
            });
            (self.imbalance, self.mechanism) = (least.imbalance, least.motion);
        }
        let rubs = (0..whole.m()).map(|i| match whole.has_friction(i) {
            true => NodeSets::<D>::FREE,
            false => NodeSets {
                slip: Some([0.0; D]),
                ..NodeSets::FREE
            },
        });
        let balance = Rc::new(balance);
        let balanced = balance.on_face(&rubs.collect::<Vec<_>>(), &[]);
        self.free = balanced.free();
        self.balanced = Some(balanced);
        self.balance = Some(balance);
    }

    /// Sᵢᵢ.
    pub fn factor(&self, i: usize) -> f64 {
        self.scale.get(i).copied().unwrap_or(1.0)
    }

    /// The slip bounds at λ: under Coulomb's law those of the nearest point that obeys it.
    pub fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        let mut near = lambda.to_vec();
        if self.balance.is_some() && self.law.merit == Merit::Error {
            self.project(&mut near);
        }
        self.law.bounds(&near)
    }

    /// The projection on Λ, or on Λₑ where bodies can move as a whole.
    pub fn project(&self, lambda: &mut Vec<f64>) {
        self.law.project::<D>(lambda, self.balance.as_deref());
    }

    /// The largest normal multiplier on each body that can move as a whole.
    pub fn pressed(&self, lambda: &[f64]) -> Vec<f64> {
        let balance = self.balance.as_ref();
        balance.map_or(Vec::new(), |balance| {
            balance.pressed(lambda, self.problem.m())
        })
    }

    /// Gᵀα.
    pub fn spread(&self, motion: &[f64]) -> Option<Vec<f64>> {
        let balance = self.balance.as_ref()?;
        Some(balance.spread(&balance.eta(motion)))
    }

    /// Aλ − b at a point.
    pub fn without_motion(&self, point: &Point) -> Vec<f64> {
        let mut r = point.r.clone();
        if let Some(forces) = self.spread(&point.motion) {
            add_times(1.0, &forces, &mut r);
        }
        r
    }
}
