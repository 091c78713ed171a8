//! The nested path: A p = B K⁻¹ Bᵀ p with K⁻¹ applied by preconditioned conjugate gradients.

use super::{Costs, DualError, DualOperator, Stop};
use crate::backend::{Backend, power_of_two_below};
use crate::problem::ContactProblem;
use crate::sparse::{Csr, norm};
use crate::stiffness::pcg::{Gather, Pcg, PcgError, Preconditioner};

/// The relative residual to ask for: below 1e-12, f64 has nothing to give; above 0.1, a single iteration
/// would not do what the method expects of a product.
fn within_reach(accuracy: f64) -> f64 {
    accuracy.clamp(1e-12, 0.1)
}

/// B and Bᵀ on the backend, with vectors of multipliers.
struct OnBackend<B: Backend> {
    gather: B::Rows,
    scatter: B::Rows,
    p: B::Vector,
    y: B::Vector,
}

/// The dual operator of a problem by PCG on a backend.
///
/// Where the backend computes in f64, a product moves 2m numbers to it and 2m numbers back, the latter
/// together with the progress of CG; everything of size n stays there. Where it computes in f32, the
/// products with B and Bᵀ are made on the host in f64, beside the residuals of the refinement.
pub struct NestedDual<'a, B: Backend> {
    problem: &'a ContactProblem,
    b: Csr,
    pcg: Pcg<B>,
    on_backend: Option<OnBackend<B>>,
}

impl<'a, B: Backend> NestedDual<'a, B> {
    /// Moves the problem to the backend.
    pub fn new(
        problem: &'a ContactProblem,
        backend: B,
        preconditioner: Preconditioner,
    ) -> Result<Self, PcgError> {
        let (k, coordinates) = (problem.stiffness(), problem.coordinates());
        let mut pcg = Pcg::new(backend, k, coordinates, preconditioner)?;
        let b = problem.contact_matrix();
        let on_backend = if pcg.is_f64() {
            let backend = &mut pcg.backend;
            let (p, y) = (backend.vector(b.n_rows())?, backend.vector(b.n_rows())?);
            Some(OnBackend {
                gather: backend.rows(&b, &pcg.x, &y)?,
                scatter: backend.rows(&b.transposed(), &p, &pcg.x)?,
                p,
                y,
            })
        } else {
            None
        };
        Ok(Self {
            problem,
            b,
            pcg,
            on_backend,
        })
    }

    /// The levels of multigrid, for a log.
    pub fn hierarchy(&self) -> Option<&str> {
        self.pcg.hierarchy.as_deref()
    }

    /// B x − c, on the host.
    fn gap(&self, x: &[f64], out: &mut [f64]) {
        self.b.mul(x, out);
        for (out, d) in out.iter_mut().zip(self.problem.gap()) {
            *out -= d;
        }
    }
}

impl<B: Backend> DualOperator for NestedDual<'_, B> {
    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: f64,
        stop: &Stop,
    ) -> Result<(), DualError> {
        let accuracy = within_reach(accuracy);
        let Some(OnBackend {
            gather,
            scatter,
            p: p_there,
            y: y_there,
        }) = &mut self.on_backend
        else {
            let mut load = vec![0.0; self.b.n_cols()];
            self.b.mul_transpose_add(1.0, p, &mut load);
            let mut x = vec![0.0; load.len()];
            self.pcg.solve(&load, &mut x, accuracy, stop)?;
            self.b.mul(&x, y);
            return Ok(());
        };
        let unit = power_of_two_below(norm(p));
        let scaled: Vec<f64> = p.iter().map(|v| v / unit).collect();
        let backend = &mut self.pcg.backend;
        backend.upload(&scaled, p_there);
        backend.clear(&mut self.pcg.r);
        backend.multiply_rows(scatter, p_there, &mut self.pcg.r);
        let gather = Gather {
            rows: gather,
            y: y_there,
            out: y,
        };
        self.pcg.counts.solves += 1;
        self.pcg.run(accuracy, stop, Some(gather))?;
        let scale = unit * self.pcg.scale;
        y.iter_mut().for_each(|v| *v *= scale);
        Ok(())
    }

    fn right_hand_side(
        &mut self,
        b: &mut [f64],
        accuracy: f64,
        stop: &Stop,
    ) -> Result<(), DualError> {
        let accuracy = within_reach(accuracy);
        let mut x = vec![0.0; self.b.n_cols()];
        self.pcg
            .solve(self.problem.load(), &mut x, accuracy, stop)?;
        self.gap(&x, b);
        Ok(())
    }

    fn displacement(
        &mut self,
        lambda: &[f64],
        accuracy: f64,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        let mut load = self.problem.load().to_vec();
        self.b.mul_transpose_add(-1.0, lambda, &mut load);
        let accuracy = within_reach(accuracy);
        let mut u = vec![0.0; load.len()];
        self.pcg.solve(&load, &mut u, accuracy, stop)?;
        Ok(u)
    }

    fn linear_iterations(&mut self, tolerance: f64) -> Result<Option<usize>, DualError> {
        let before = self.pcg.counts;
        let mut x = vec![0.0; self.b.n_cols()];
        self.pcg
            .solve(self.problem.load(), &mut x, tolerance, &Stop::default())?;
        let iterations = self.pcg.counts.iterations - before.iterations;
        self.pcg.counts = before;
        Ok(Some(iterations))
    }

    fn costs(&self) -> Option<Costs> {
        Some(Costs {
            solves: self.pcg.counts,
            device: self.pcg.backend.counters(),
        })
    }
}
