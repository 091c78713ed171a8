//! Bodies that only contact holds, on weak springs.
//!
//! Under Coulomb's law forces that balance a body may exist (a block turned about its vertical axis could rest on its
//! corners) that belong to no motion. With weak springs between the bodies and their earlier positions a state always
//! exists. Held bodies hardly feel the springs; others move until the springs bear the part of the load that contact
//! and friction do not.
//!
//! Springs of stiffness k on each of the motions R, with orthonormal columns, turn K into K + k R Rᵀ:
//!
//! ```text
//! u = (1 − R Rᵀ) K⁺ (1 − R Rᵀ)(f − Bᵀλ) + R α,    α = Rᵀ(f − Bᵀλ) / k
//! ```

use crate::control::{Accuracy, Stop};
use crate::dual::{DualError, DualOperator, Request};
use crate::problem::{ContactProblem, Elsewhere, LoadCase};
use crate::ssnm::Solution;
use std::sync::Arc;

/// k is so small that springs which bear the whole load would take up this many times the work of the contact forces on
/// their own nodes. A held body then moves as if there were no springs. One that is pushed by 1e-4 more than it bears
/// moves until the springs take up more work than the contact. From 1e4 to 1e8 a block turned 3 % beyond its friction
/// takes 24 to 25 steps and leaves the springs 3.73 to 3.77. With 1e10 one in four no longer converges.
pub(super) const WEAK: f64 = 1e8;

/// The factor of stiffer springs that tell whether a body is held, and by how much more they then bear at least. The springs of
/// a body that needs some way bear up to 100 times more, less where they hold it back before it has come there.
pub(super) const STIFFER: f64 = 100.0;
pub(super) const MORE: f64 = 2.0;

/// A relative residual that is accurate enough for a product.
const ACCURATE: f64 = 1e-10;

/// The result for bodies on weak springs.
pub(super) enum Springs<const D: usize> {
    /// Not found.
    Break,
    /// The springs bear hardly anything: λ of bodies that are held, or at the limit of it.
    Idle(Vec<f64>),
    /// The springs bear a part that contact and friction do not: the bodies are not held.
    Bear(Box<Solution<D>>),
}

/// The dual operator of a problem with floating bodies, with springs on their motions.
pub(super) struct OnSprings<'a, const D: usize> {
    dual: &'a mut dyn DualOperator,
    problem: &'a ContactProblem<D, Elsewhere>,
    /// k.
    stiffness: f64,
}

impl<'a, const D: usize> OnSprings<'a, D> {
    pub fn new(
        dual: &'a mut dyn DualOperator,
        problem: &'a ContactProblem<D, Elsewhere>,
        stiffness: f64,
    ) -> Self {
        Self {
            dual,
            problem,
            stiffness,
        }
    }

    /// The problem on springs that are at rest where Rᵀu is `place`.
    pub fn problem(&self, place: &[f64]) -> ContactProblem<D, Elsewhere> {
        let held: Vec<f64> = place.iter().map(|a| self.stiffness * a).collect();
        let case = self.problem.load_case().clone();
        let mut force = case.force.to_vec();
        self.problem.floating_bodies().add_motion(&held, &mut force);
        self.problem.supported().under(LoadCase {
            force: Arc::new(force),
            ..case
        })
    }

    /// The part along motions, R Rᵀx: its coefficients, which are removed from x.
    fn take_out(&self, x: &mut [f64]) -> Vec<f64> {
        let along = self.problem.floating_bodies().resultants(x);
        let back: Vec<f64> = along.iter().map(|a| -a).collect();
        self.problem.floating_bodies().add_motion(&back, x);
        along
    }

    /// u under forces, to this residual.
    fn moved(
        &mut self,
        mut forces: Vec<f64>,
        residual: f64,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        let mut alpha = self.take_out(&mut forces);
        alpha.iter_mut().for_each(|a| *a /= self.stiffness);
        let (forces, none) = (Arc::new(forces), vec![0.0; self.size().1]);
        let request = Request::new(&forces, &none, Accuracy::Residual(residual), stop);
        let mut u = self.dual.displacement(&request)?;
        self.take_out(&mut u);
        self.problem.floating_bodies().add_motion(&alpha, &mut u);
        Ok(u)
    }
}

impl<const D: usize> DualOperator for OnSprings<'_, D> {
    fn size(&self) -> (usize, usize) {
        self.dual.size()
    }

    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        let b = self.problem.contact_matrix();
        let mut forces = vec![0.0; b.n_cols()];
        b.mul_transpose_add(1.0, p, &mut forces);
        let part = match accuracy {
            Accuracy::Residual(part) => part,
            Accuracy::Energy { .. } => ACCURATE,
        };
        let residual = part * self.problem.ranks().norm(&forces);
        let u = self.moved(forces, residual, stop)?;
        self.restrict(&u, y);
        Ok(())
    }

    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.dual.restrict(u, y);
    }

    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        let forces = request.forces(self.problem.contact_matrix());
        let residual = match request.accuracy {
            Accuracy::Residual(residual) => residual,
            Accuracy::Energy { .. } => ACCURATE * self.problem.ranks().norm(&forces),
        };
        self.moved(forces, residual, request.stop)
    }

    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        let [mut product, sizes] = self.dual.stiffness_times(u, s)?;
        let mut alpha = self.problem.floating_bodies().resultants(u);
        alpha.iter_mut().for_each(|a| *a *= self.stiffness);
        self.problem
            .floating_bodies()
            .add_motion(&alpha, &mut product);
        Ok([product, sizes])
    }
}
