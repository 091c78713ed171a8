//! Coulomb friction by rounds with frozen slip bounds: the last resort of the monolithic Newton step.
//!
//! The bounds are a fixed point of g ↦ μλν(g), where λν(g) solves the problem with the given bounds g (Tresca), which
//! is a minimisation and has a safeguard: successive approximation as in Nečas, Jarušek and Haslinger (1980),
//! warm-started. Where monolithic steps fail, rounds mostly end with a certificate that nothing holds a body.
//!
//! **Bodies that only contact holds** have to be balanced by the forces of each round. Its bounds come from forces on
//! or inside Coulomb's cones that balance the bodies, so that the round can balance them too; these are the projection
//! of the forces found so far. If there are no such forces, no contact can hold the bodies, and the projection gives
//! the direction of the push.

use super::{Event, Process, changes};
use crate::constraint::{Disc, lawful};
use crate::dual::DualOperator;
use crate::dual::balance::{Balance, Nearest};
use crate::problem::{ContactProblem, Elsewhere};
use crate::sparse::norm;
use crate::ssnm::{MET, Solution, SolveError, Status};
use std::ops::ControlFlow;

/// Rounds on their way.
pub(super) struct Rounds<const D: usize> {
    cones: Cones<D>,
    /// λ of the last one.
    pub lambda: Vec<f64>,
    /// The bounds of the last round, or the initial ones.
    pub bounds: Vec<f64>,
    next: Vec<f64>,
    /// The tolerance of each.
    tolerance: f64,
    made: usize,
}

impl<const D: usize> Rounds<D> {
    /// Before the first one, which starts from λ.
    pub fn new<O: DualOperator + ?Sized, V: FnMut(Event) -> ControlFlow<()>>(
        step: &Process<D, O, V>,
        lambda: &[f64],
    ) -> Self {
        let cones = Cones::new(&step.lawful);
        let bounds = cones.bounds(lambda);
        // Bounds are a multiple of λ, so they are no more accurate than λ.
        let tolerance =
            (step.settings.ssnm.tolerance).min(step.settings.friction_tolerance() / MET);
        Self {
            cones,
            lambda: lambda.to_vec(),
            next: bounds.clone(),
            bounds,
            tolerance,
            made: 0,
        }
    }

    /// Makes rounds until the slip bounds have converged, or up to the limit. The solution is that of the last one, with
    /// the status of all.
    pub fn make<O: DualOperator + ?Sized, V: FnMut(Event) -> ControlFlow<()>>(
        &mut self,
        step: &mut Process<D, O, V>,
    ) -> Result<Solution<D>, SolveError> {
        let wanted = step.settings.friction_tolerance();
        loop {
            self.bounds.clone_from(&self.next);
            let solution = step.solve(Some(&self.bounds), &self.lambda, self.tolerance)?;
            self.made += 1;
            self.lambda.clone_from(&solution.lambda);
            let lambda = &self.lambda;

            // The law is μλν; if that could not balance the bodies, the next round tries other bounds.
            let law = step.lawful.bounds(lambda);
            let friction_change = step.relative(lambda, &changes(&law, &self.bounds));
            let next = self.cones.bounds(lambda);
            let changed = changes(&next, &self.bounds);
            let change = step.relative(lambda, &changed);
            let has_converged = change <= wanted;
            let (mut unbalanced, mut mechanism) =
                (solution.imbalance.clone(), solution.mechanism.clone());
            if unbalanced.is_empty() {
                (unbalanced, mechanism) = self.cones.unbalanced.clone();
            }
            if unbalanced.is_empty() && has_converged && friction_change > wanted {
                // Bounds that balance the bodies have converged, but differ from those of the pressures.
                (unbalanced, mechanism) = self.cones.unbalanced_within(&law, lambda);
            }
            let status = if solution.status != Status::Converged {
                Some(solution.status)
            } else if !unbalanced.is_empty() {
                Some(Status::NotHeld)
            } else if friction_change <= wanted {
                Some(Status::Converged)
            } else if has_converged && norm(&changed) == 0.0 {
                // The next round would be the same.
                Some(Status::Stagnated)
            } else if step.stopped {
                Some(Status::Interrupted)
            } else {
                None
            };
            self.next = next;
            if status.is_some() || self.made >= step.settings.max_rounds {
                return Ok(Solution {
                    status: status.unwrap_or(Status::IterationLimit),
                    imbalance: unbalanced,
                    mechanism,
                    ..solution
                });
            }
        }
    }
}

/// An imbalance, and the motion that it drives.
type Unbalanced = (Vec<f64>, Vec<f64>);

/// The slip bounds under which forces can balance the bodies that only contact holds.
struct Cones<const D: usize> {
    problem: ContactProblem<D, Elsewhere>,
    /// If there are such bodies and Coulomb friction.
    balance: Option<Balance>,
    /// The load that no forces on the cones can balance, and the motion that it drives; empty if there is none.
    unbalanced: Unbalanced,
}

impl<const D: usize> Cones<D> {
    fn new(problem: &ContactProblem<D, Elsewhere>) -> Self {
        let floating = problem.floating_bodies();
        let mut cones = Self {
            problem: problem.clone(),
            balance: None,
            unbalanced: Unbalanced::default(),
        };
        if floating.is_empty() || !problem.has_coulomb() {
            return cones;
        }
        let b = problem.contact_matrix();
        let mut balance = Balance::new(floating, b, problem.load(), |i| {
            f64::from(u8::from(!problem.is_out_of_reach(i)))
        });
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

    /// The load that forces within the given bounds cannot balance; empty if they can.
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
