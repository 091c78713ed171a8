//! Before the first outer step: the balance of floating bodies, b, err⁰ and λ⁰, and for the algorithms as printed σ_max.

use super::known::Known;
use super::law::Law;
use super::newton::{Newton, Way};
use super::point::Point;
use super::products::Products;
use super::scaling::Scaled;
use super::{Method, NewtonSettings, RecycledSubspace, WarmStart};
use crate::constraint::NodeSets;
use crate::control::Stop;
use crate::dual::balance::Balance;
use crate::dual::{DualError, DualOperator, LARGEST_MATRIX, spectrum};
use crate::problem::{ContactProblem, Elsewhere, LoadCase};
use crate::sparse::{add_times, difference};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Instant;

/// The start of a solve, in scaled multipliers.
pub(super) struct Start {
    law: Law,
    /// Of the floating bodies; None without any.
    balance: Option<Rc<Balance>>,
    /// The λ of err⁰: 0, or the least forces that balance the bodies.
    lambda: Vec<f64>,
    /// The part of the load that no λ ∈ Λ can balance; empty if there is none.
    pub imbalance: Vec<f64>,
    /// The motion that this drives.
    pub mechanism: Vec<f64>,
}

impl Start {
    /// Balances the bodies, before any product is made.
    pub fn new<const D: usize, K>(problem: &ContactProblem<D, K>, dual: &Scaled) -> Self {
        let mut start = Self {
            law: Law::new(problem, dual),
            balance: None,
            lambda: vec![0.0; D * problem.m()],
            imbalance: Vec::new(),
            mechanism: Vec::new(),
        };
        let floating = problem.floating_bodies();
        if floating.is_empty() {
            return start;
        }
        let law = &start.law;
        let b = problem.contact_matrix();
        let mut balance = Balance::new(floating, b, problem.load(), |i| {
            match problem.is_out_of_reach(i) {
                true => 0.0,
                false => dual.factor(i),
            }
        });
        let least = balance.least(|i, z: [f64; D]| law.of(i).nearest(z));
        start.lambda = least.lambda;
        if !least.balanced {
            start.imbalance = least.imbalance;
            start.mechanism = least.motion;
        }
        start.balance = Some(Rc::new(balance));
        start
    }

    /// The load without the part that no contact can balance, so that the rest can be solved.
    pub fn held<const D: usize, K>(&self, problem: &ContactProblem<D, K>) -> LoadCase {
        let mut case = problem.load_case().clone();
        if !self.imbalance.is_empty() {
            let less: Vec<f64> = self.imbalance.iter().map(|v| -v).collect();
            let mut force = case.force.to_vec();
            problem.floating_bodies().add_motion(&less, &mut force);
            case = LoadCase {
                acting: problem.ranks().norm(&force),
                force: Arc::new(force),
                ..case
            };
        }
        case
    }
}

/// The operands of a solve.
pub(super) struct SetUp<'a, const D: usize> {
    pub newton: Newton<'a, D>,
    pub way: Way<D>,
    /// Products that σ_max took.
    pub n_a_sigma: usize,
    /// Seconds for b and σ_max.
    pub seconds: f64,
    /// Whether b, σ_max and λ⁰ could be computed.
    pub outcome: Result<(), DualError>,
}

impl<'a, const D: usize> SetUp<'a, D> {
    /// Makes r, and moves to λ⁰.
    pub fn new(
        problem: &'a ContactProblem<D, Elsewhere>,
        dual: Scaled<'a>,
        start: Start,
        settings: &'a NewtonSettings,
        warm: &WarmStart<'a>,
        recycled: &mut RecycledSubspace,
        begin: Instant,
    ) -> Self {
        let stop = Stop {
            // A limit beyond the range of the clock counts as no limit.
            deadline: (settings.time_limit).and_then(|limit| begin.checked_add(limit)),
            interrupt: settings.interrupt.as_deref(),
            ranks: None,
        };
        // Forces that do not balance the bodies are not a usable start.
        let initial = warm.lambda.filter(|_| start.imbalance.is_empty());
        let mut offsets = problem.load_case().offsets();
        dual.times(&mut offsets);
        let mut before = problem.load_case().before.clone();
        dual.divide(&mut before);
        // A guess of the entries of diag(A), as if only their own unknowns moved: the first product replaces it.
        let mean = mean(problem.own_compliance().iter().enumerate().map(|(i, c)| {
            let factor = dual.factor(i);
            c * factor * factor
        }));
        let compliance = dual.compliance();
        let scale = dual.scale().to_vec();
        let products = Products::new(dual, problem.load_case(), settings, stop, mean);
        let known = (products.dual.matrix())
            .filter(|matrix| matrix.n_blocks() <= LARGEST_MATRIX)
            .filter(|_| settings.method == Method::Multisecant && start.balance.is_none())
            .and_then(|matrix| Known::new(&matrix, settings.numbers.proximal));
        let mut newton = Newton {
            problem,
            law: start.law,
            balanced: start.balance.as_ref().map(|balance| {
                let rubs = (0..problem.m()).map(|i| match problem.has_friction(i) {
                    true => NodeSets::<D>::FREE,
                    false => NodeSets {
                        slip: Some([0.0; D]),
                        ..NodeSets::FREE
                    },
                });
                balance.on_face(&rubs.collect::<Vec<_>>(), &[])
            }),
            balance: start.balance,
            beta: settings.beta,
            sigma: mean,
            mean,
            products,
            hidden: 0,
            surrogate: Default::default(),
            known,
            method: settings.method,
            numbers: settings.numbers,
            checked: None,
            check_accuracy: settings.tolerance,
            tolerance: settings.tolerance,
            reach: problem.reach(),
            moved: vec![0.0; D * problem.m()],
            blur: Vec::new(),
            before,
            place: warm.motion,
            offsets,
            compliance,
        };
        if settings.method == Method::Multisecant {
            newton.surrogate = std::mem::take(&mut recycled.surrogate);
        }
        (newton.surrogate).prepare(mean, settings.numbers.pairs, &newton.compliance, &scale);
        let first = Point {
            r: vec![0.0; start.lambda.len()],
            lambda: start.lambda,
            motion: vec![0.0; problem.floating_bodies().n_modes()],
        };
        let mut way = Way {
            point: first.clone(),
            inner: None,
            first,
            err: 0.0,
            err0: 0.0,
            sets: None,
            history: Vec::new(),
            first_met: None,
        };
        let mut n_a_sigma = 0;
        let outcome = newton.find_sigma(recycled).and_then(|products| {
            n_a_sigma = products;
            newton.start(&mut way, initial)
        });
        way.err0 = newton.measure(&way.first);
        Self {
            newton,
            way,
            n_a_sigma,
            seconds: begin.elapsed().as_secs_f64(),
            outcome,
        }
    }
}

/// The mean of the positive values; 1 if there are none.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for value in values.filter(|&value| value > 0.0) {
        (sum, count) = (sum + value, count + 1);
    }
    if count == 0 { 1.0 } else { sum / count as f64 }
}

impl<const D: usize> Newton<'_, D> {
    /// Finds σ_max: on the surrogate from its products, otherwise by Lanczos, unless an earlier solve has done so.
    /// Returns the number of products.
    fn find_sigma(&mut self, recycled: &mut RecycledSubspace) -> Result<usize, DualError> {
        if self.method == Method::Multisecant {
            self.sigma = self.surrogate.largest();
            return Ok(0);
        }
        if let Some((sigma, mean)) = recycled.spectrum {
            (self.sigma, self.mean) = (sigma, mean);
            return Ok(0);
        }
        let project = |p: &mut [f64]| {
            if let Some(face) = &self.balanced {
                face.project(p);
            }
        };
        let len = self.offsets.len();
        let found = spectrum(&mut self.products.dual, len, project, &self.products.stop)?;
        (self.sigma, self.mean) = (found.largest, found.mean);
        recycled.spectrum = Some((found.largest, found.mean));
        Ok(found.products)
    }

    /// Computes r at the point of err⁰ and moves to λ⁰. If products of earlier solves cover the difference between the two,
    /// and the former would cost one, it is the other way round: err⁰ serves only as the reference. So it is where a similar A is known,
    /// unless λ⁰ seems to be far worse than none.
    fn start(&mut self, way: &mut Way<D>, initial: Option<&[f64]>) -> Result<(), DualError> {
        let target = initial.map(|initial| {
            let mut target = initial.to_vec();
            self.products.dual.divide(&mut target);
            self.project(&mut target);
            target
        });
        let costs = self.products.dual.costs().is_some() || self.balance.is_some();
        let Some(target) = target else {
            way.first.r = self.products.first(&self.offsets, &way.first.lambda)?;
            way.point.clone_from(&way.first);
            return Ok(());
        };
        if costs && self.surrogate.is_known() {
            way.point.lambda.clone_from(&target);
            way.point.r = self.products.first(&self.offsets, &way.point.lambda)?;
            let back = difference(&way.first.lambda, &way.point.lambda);
            way.first.r.clone_from(&way.point.r);
            add_times(1.0, &self.surrogate.times(&back), &mut way.first.r);
            let is_near = self.surrogate.len() > 0
                || self.error(&way.point) <= self.numbers.growth * self.error(&way.first);
            if is_near {
                return Ok(());
            }
        }
        way.first.r = self.products.first(&self.offsets, &way.first.lambda)?;
        way.point.clone_from(&way.first);
        self.move_to(&mut way.point, target)?;
        self.refresh(&mut way.point, 0.0)?;
        // Where loads have changed much, the start may be far worse than none.
        if self.error(&way.point) > self.numbers.growth * self.error(&way.first) {
            way.point.clone_from(&way.first);
            self.refresh(&mut way.point, 0.0)?;
        }
        Ok(())
    }
}
