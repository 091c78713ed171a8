//! Coulomb friction by rounds with frozen slip bounds: the last resort of the coupled Newton step.
//!
//! The bounds are a fixed point of g ↦ μλν(g), where λν(g) solves the problem with the given bounds g (Tresca), which
//! is a minimisation and has a safeguard: successive approximation as in Nečas, Jarušek and Haslinger (1980),
//! warm-started. Where coupled steps give up, rounds mostly end with a certificate that nothing holds a body.
//!
//! **Bodies that only contact holds** have to be balanced by the forces of each round. The bounds of a round are
//! those of forces on or inside Coulomb's cones that balance the bodies, so that the round can; the forces
//! found so far are projected there. If there are no such forces, no contact can hold the bodies, and the
//! projection tells which way they are pushed.

use super::{Event, Process};
use crate::constraint::{Disc, lawful};
use crate::dual::DualOperator;
use crate::dual::balance::{Balance, Nearest};
use crate::problem::{ContactProblem, Elsewhere};
use crate::sparse::{difference, norm};
use crate::ssnm::{Solution, SolveError, Status};
use std::ops::ControlFlow;

/// The tolerance of the problem of a round beside the change of the slip bounds in the round before.
const FOLLOWS: f64 = 1e-3;
/// The same of the first rounds.
const FIRST_TOLERANCE: f64 = 1e-3;
/// The same beside the error that the first one starts from.
const CLOSER: f64 = 0.1;
/// The part of the friction tolerance that the last problem may be off by.
const RESOLVED: f64 = 0.1;

/// Rounds on their way.
pub(super) struct Rounds<const D: usize> {
    cones: Cones<D>,
    /// λ of the last one.
    pub lambda: Vec<f64>,
    /// The bounds of the last one that was made, or of the first.
    pub bounds: Vec<f64>,
    next: Vec<f64>,
    /// The tolerance of the next one, and of the last.
    tolerance: f64,
    tight: f64,
    made: usize,
}

impl<const D: usize> Rounds<D> {
    /// Before the first one, which starts from λ where the relative error is about `reached`.
    pub fn new<O: DualOperator + ?Sized, V: FnMut(Event) -> ControlFlow<()>>(
        step: &Process<D, O, V>,
        lambda: &[f64],
        reached: f64,
    ) -> Self {
        let cones = Cones::new(&step.lawful);
        let bounds = cones.bounds(lambda);
        let settings = step.settings;
        let tight = (settings.ssnm.tolerance).min(RESOLVED * settings.friction_tolerance());
        Self {
            cones,
            lambda: lambda.to_vec(),
            next: bounds.clone(),
            bounds,
            tolerance: tight.max(FIRST_TOLERANCE.min(CLOSER * reached)),
            tight,
            made: 0,
        }
    }

    /// Makes as many as `limit` until the slip bounds have settled. The solution is that of the last one, with the
    /// status of all; says whether there may be more of them.
    pub fn make<O: DualOperator + ?Sized, V: FnMut(Event) -> ControlFlow<()>>(
        &mut self,
        step: &mut Process<D, O, V>,
        limit: usize,
    ) -> Result<(Solution<D>, bool), SolveError> {
        let last = (self.made.saturating_add(limit)).min(step.settings.max_rounds);
        let wanted = step.settings.friction_tolerance();
        loop {
            self.bounds.clone_from(&self.next);
            let solution = step.solve(Some(&self.bounds), &self.lambda, self.tolerance)?;
            self.made += 1;
            self.lambda.clone_from(&solution.lambda);
            let lambda = &self.lambda;

            // The law is μλν; where that could not balance the bodies, the next round tries other bounds.
            let law = step.lawful.bounds(lambda);
            let friction_change = step.relative(lambda, &difference(&law, &self.bounds));
            let next = self.cones.bounds(lambda);
            let changes = difference(&next, &self.bounds);
            let change = step.relative(lambda, &changes);
            let settled = change <= wanted && self.tolerance <= self.tight;
            let (mut unbalanced, mut driven) =
                (solution.imbalance.clone(), solution.driven.clone());
            if unbalanced.is_empty() {
                (unbalanced, driven) = self.cones.unbalanced.clone();
            }
            if unbalanced.is_empty() && settled && friction_change > wanted {
                // Bounds that balance the bodies have settled, but the pressures do not give them.
                (unbalanced, driven) = self.cones.unbalanced_within(&law, lambda);
            }
            let status = if solution.status != Status::Converged {
                Some(solution.status)
            } else if !unbalanced.is_empty() {
                Some(Status::NotHeld)
            } else if friction_change <= wanted && self.tolerance <= self.tight {
                Some(Status::Converged)
            } else if settled && norm(&changes) == 0.0 {
                // The next round would be the same.
                Some(Status::Stagnated)
            } else if step.stopped {
                Some(Status::Interrupted)
            } else {
                None
            };
            self.tolerance = (FOLLOWS * change).clamp(self.tight, self.tolerance);
            if change <= wanted {
                self.tolerance = self.tight;
            }
            self.next = next;
            if status.is_some() || self.made >= last {
                let more = status.is_none() && self.made < step.settings.max_rounds;
                let solution = Solution {
                    status: status.unwrap_or(Status::IterationLimit),
                    imbalance: unbalanced,
                    driven,
                    ..solution
                };
                return Ok((solution, more));
            }
        }
    }
}

/// An imbalance, and the motion that it drives.
type Unbalanced = (Vec<f64>, Vec<f64>);

/// The slip bounds under which forces can balance the bodies that only contact holds.
struct Cones<const D: usize> {
    problem: ContactProblem<D, Elsewhere>,
    /// Where there are such bodies and Coulomb friction.
    balance: Option<Balance>,
    /// What no forces on the cones can balance, and the motion that it drives; empty where all is well.
    unbalanced: Unbalanced,
}

impl<const D: usize> Cones<D> {
    fn new(problem: &ContactProblem<D, Elsewhere>) -> Self {
        let free = problem.free_bodies();
        let mut cones = Self {
            problem: problem.clone(),
            balance: None,
            unbalanced: Unbalanced::default(),
        };
        if free.is_empty() || !problem.has_coulomb() {
            return cones;
        }
        let b = problem.contact_matrix();
        let mut balance = Balance::new(free, b, problem.load(), |_| 1.0);
        let given = problem.slip_bound();
        let least = balance.least(|i, z: [f64; D]| lawful(given[i], cones.mu(i), z));
        if !least.balanced {
            cones.unbalanced = (least.imbalance, least.motion);
        }
        cones.balance = Some(balance);
        cones
    }

    fn mu(&self, i: usize) -> f64 {
        self.problem.friction_coefficient()[i]
    }

    fn nearest(&self, balance: &Balance, lambda: &[f64]) -> Nearest {
        let given = self.problem.slip_bound();
        balance.nearest(lambda, |i, z: [f64; D]| lawful(given[i], self.mu(i), z))
    }

    /// What forces within the given bounds cannot balance; empty where they can.
    fn unbalanced_within(&self, bounds: &[f64], lambda: &[f64]) -> Unbalanced {
        let Some(balance) = &self.balance else {
            return Unbalanced::default();
        };
        let near = balance.nearest(lambda, |i, z: [f64; D]| Disc { g: bounds[i] }.nearest(z));
        if near.balanced {
            Unbalanced::default()
        } else {
            (near.imbalance, near.motion)
        }
    }

    /// The bounds of the forces λ, or of the nearest ones that balance the bodies.
    fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        match &self.balance {
            None => self.problem.bounds(lambda).into_owned(),
            Some(balance) => (self.problem)
                .bounds(&self.nearest(balance, lambda).lambda)
                .into_owned(),
        }
    }
}
