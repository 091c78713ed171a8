//! What comes before the first outer step: the balance of free bodies, b, σ_max, err⁰ and λ⁰.

use super::law::Law;
use super::newton::{Newton, Way};
use super::point::Point;
use super::products::Products;
use super::scaling::Scaled;
use super::{EXACT, Method, Settings};
use crate::constraint::NodeSets;
use crate::control::Stop;
use crate::dual::balance::Balance;
use crate::dual::{DualError, DualOperator};
use crate::problem::ContactProblem;
use std::rc::Rc;
use std::time::Instant;

/// Where a solve starts from, in scaled multipliers.
pub(super) struct Start {
    law: Law,
    /// Of the free bodies; None where there are none.
    balance: Option<Rc<Balance>>,
    /// The λ that err⁰ is taken at: 0, or the least forces that balance the bodies. With `first_error`, λ⁰.
    lambda: Vec<f64>,
    /// err⁰, where it is known and λ is λ⁰.
    first_error: Option<f64>,
    /// What of the load no λ ∈ Λ can balance; empty if there is nothing.
    pub imbalance: Vec<f64>,
    /// The motion that this drives.
    pub driven: Vec<f64>,
}

impl Start {
    /// Balances the bodies, before any product is made.
    pub fn new<O: DualOperator + ?Sized, const D: usize>(
        problem: &ContactProblem<D>,
        dual: &Scaled<O>,
        settings: &Settings,
    ) -> Self {
        let mut start = Self {
            law: Law::new(problem, dual),
            balance: None,
            lambda: vec![0.0; D * problem.m()],
            first_error: None,
            imbalance: Vec::new(),
            driven: Vec::new(),
        };
        let free = problem.free_bodies();
        if free.is_empty() {
            return start;
        }
        let law = &start.law;
        let nearest = |i: usize, z: [f64; D]| law.nearest(i, z);
        let b = problem.contact_matrix();
        let mut balance = Balance::new(free, &b, problem.load(), |i| dual.factor(i));
        let least = balance.least(nearest);
        start.lambda = least.lambda;
        if !least.balanced {
            start.imbalance = least.imbalance;
            start.driven = least.motion;
        }
        // Where err⁰ is known, the way may start from λ⁰ at once.
        start.first_error = settings.first_error;
        if let (Some(_), Some(initial)) = (settings.first_error, settings.initial) {
            let mut initial = initial.to_vec();
            dual.divide(&mut initial);
            start.lambda = balance.nearest(&initial, nearest).lambda;
        }
        start.balance = Some(Rc::new(balance));
        start
    }

    /// The problem without what no contact can balance of its load, so that the rest can be solved; None where all of it
    /// can.
    pub fn reduced<const D: usize>(
        &self,
        problem: &ContactProblem<D>,
    ) -> Option<ContactProblem<D>> {
        if self.imbalance.is_empty() {
            return None;
        }
        let mut load = problem.load().to_vec();
        let less: Vec<f64> = self.imbalance.iter().map(|v| -v).collect();
        problem.free_bodies().add_motion(&less, &mut load);
        let (gap, origin) = (problem.gap().to_vec(), problem.slip_origin().to_vec());
        Some(problem.with_step(load, gap, origin, problem.slip_bound().to_vec()))
    }
}

/// What a solve works on.
pub(super) struct SetUp<'a, O: ?Sized, const D: usize> {
    pub newton: Newton<'a, O, D>,
    pub way: Way<D>,
    /// err⁰, as computed or known.
    pub first_error: f64,
    /// Products that σ_max took.
    pub n_a_sigma: usize,
    /// Seconds for b and σ_max.
    pub seconds: f64,
    /// Whether b, σ_max and λ⁰ could be had.
    pub outcome: Result<(), DualError>,
}

impl<'a, O: DualOperator + ?Sized, const D: usize> SetUp<'a, O, D> {
    /// Hands load and gap to the operator, makes r and σ_max, and moves to λ⁰.
    pub fn new(
        problem: &'a ContactProblem<D>,
        mut dual: Scaled<'a, O>,
        start: Start,
        settings: &Settings<'a>,
        begin: Instant,
    ) -> Self {
        let exact = settings.method == Method::Exact;
        let stop = Stop {
            // A limit beyond what the clock can show is none.
            deadline: (settings.time_limit).and_then(|limit| begin.checked_add(limit)),
            interrupt: settings.interrupt,
        };
        let Start {
            law,
            balance,
            mut lambda,
            first_error: known,
            ..
        } = start;
        let everything = (balance.as_ref())
            .map(|balance| balance.on_face(&vec![NodeSets::<D>::FREE; problem.m()], &[]));
        let project = |p: &mut [f64]| {
            if let Some(face) = &everything {
                face.project(p);
            }
        };
        let mut offsets = problem.offsets();
        let set = dual.set_data(problem.load(), &offsets);
        dual.times(&mut offsets);
        let mut products = Products::new(dual, exact, stop);
        let made = set
            .and_then(|()| products.set_up(offsets.clone(), &lambda, settings.sigma_max, project));
        if let Some(memory) = settings.memory {
            let mut memory = memory.borrow_mut();
            products.mean = products.mean.or(memory.mean);
            if products.are_exact() {
                products.known = std::mem::take(&mut memory.known);
            }
        }
        let seconds = begin.elapsed().as_secs_f64();
        let mut outcome = Ok(());
        let (r, n_a_sigma) = made.unwrap_or_else(|error| {
            outcome = Err(error);
            lambda.fill(0.0);
            (vec![0.0; lambda.len()], 0)
        });
        // Without contact, or with a B that K makes infinitely stiff, any ρ will do.
        let alpha = match products.sigma {
            sigma if sigma > 0.0 => 1.0 / sigma,
            _ => 1.0,
        };
        let mut point = Point {
            lambda,
            r,
            motion: vec![0.0; problem.free_bodies().n_motions()],
        };
        let mut newton = Newton {
            problem,
            law,
            balance,
            offsets,
            rho: settings.beta * alpha,
            alpha,
            products,
            method: settings.method,
            checked: None,
            check_accuracy: settings.tolerance,
            tolerance: settings.tolerance,
            goal_err: 0.0,
            refreshed: f64::INFINITY,
            place: settings.place,
        };
        let error = newton.error(&mut point);
        let first_error = known.unwrap_or(error);
        let err0 = newton.measure(&point, first_error, settings.tolerance);
        let initial = settings.initial.filter(|_| known.is_none());
        if let (Ok(()), Some(initial)) = (&outcome, initial) {
            outcome = newton.move_to_start(&mut point, initial);
        }
        Self {
            newton,
            way: Way {
                point,
                err: first_error,
                err0,
                // So that Step 3.1 starts from r_tol.
                tol: settings.r_tol / settings.c_fact,
                kept: None,
                predicted: None,
                sets: None,
                history: Vec::new(),
                first_met: None,
            },
            first_error,
            n_a_sigma,
            seconds,
            outcome,
        }
    }
}

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// err⁰, and what products have to resolve. It is taken at λ = 0 even for a warm start: a good start must not make
    /// the same tolerance harder.
    fn measure(&mut self, point: &Point, first_error: f64, tolerance: f64) -> f64 {
        let err0 = first_error.max(self.rounding(point));
        let finest = match self.method {
            Method::Inexact => 1.0,
            Method::Exact => EXACT,
        };
        self.products.aim_at(tolerance.min(finest) * err0);
        self.products.allow(err0);
        err0
    }

    /// λ⁰ projected on Λ, and r there.
    fn move_to_start(&mut self, point: &mut Point, initial: &[f64]) -> Result<(), DualError> {
        let mut there = point.clone();
        let mut target = initial.to_vec();
        self.products.dual.divide(&mut target);
        self.project(&mut target);
        self.move_to(&mut there, target)?;
        *point = there;
        Ok(())
    }
}
