//! The dual operator where it is known itself: the Delassus operator of contacts.

use super::{DualError, DualOperator, Request};
use crate::control::{Accuracy, Correction, Stop};
use crate::problem::{ContactProblem, Elsewhere};
use crate::sparse::Csr;
use std::sync::Arc;

/// The number of u that are remembered with their forces.
const REMEMBERED: usize = 8;

/// A = B W Bᵀ with W as a product y = W x, for [`ContactProblem::from_delassus`].
///
/// # Example
/// A ball that rests on a floor and is pushed along it: it sticks.
///
/// ```
/// use signorini::dual::DelassusDual;
/// use signorini::problem::ContactProblem;
/// use signorini::ssnm::{self, NewtonSettings, Status};
/// use std::ops::ControlFlow;
///
/// let q = [-1.0, 0.2, 0.0];
/// let problem = ContactProblem::<3>::from_delassus(&[2.0; 3], &q, &[0.5])?;
/// let mut dual = DelassusDual::new(&problem, |x: &[f64], y: &mut [f64]| {
///     y.iter_mut().zip(x).for_each(|(y, x)| *y = 2.0 * x);
///     Ok(())
/// });
/// let solution = ssnm::solve(&problem, &mut dual, &NewtonSettings::default(), |_| ControlFlow::Continue(()))?;
/// assert_eq!(solution.status, Status::Converged);
/// let r = dual.impulses(&solution.lambda);
/// assert!((r[0] - 0.5).abs() < 1e-9 && (r[1] + 0.1).abs() < 1e-9 && r[2] == 0.0, "{r:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct DelassusDual<W> {
    contact: Arc<Csr>,
    product: W,
    /// W, if it is known as more than a product.
    matrix: Option<Csr>,
    /// (u, K u), the last ones.
    known: Vec<[Vec<f64>; 2]>,
}

impl<W> DelassusDual<W>
where
    W: FnMut(&[f64], &mut [f64]) -> Result<(), DualError>,
{
    /// For a problem, with the product y = W x in the order of its q.
    pub fn new<const D: usize>(problem: &ContactProblem<D, Elsewhere>, product: W) -> Self {
        Self {
            contact: Arc::clone(problem.contact_matrix()),
            product,
            matrix: None,
            known: Vec::new(),
        }
    }

    /// The same where W is available as a matrix: few steps then solve problems with many contacts that depend on each
    /// other.
    pub fn with_matrix(self, matrix: Csr) -> Self {
        Self {
            matrix: Some(matrix),
            ..self
        }
    }

    /// r = Bᵀλ: the impulses in the order of q.
    pub fn impulses(&self, lambda: &[f64]) -> Vec<f64> {
        let mut r = vec![0.0; self.contact.n_cols()];
        self.contact.mul_transpose_add(1.0, lambda, &mut r);
        r
    }

    /// W x.
    ///
    /// # Errors
    /// Those of the product.
    pub fn times(&mut self, x: &[f64]) -> Result<Vec<f64>, DualError> {
        let mut y = vec![0.0; x.len()];
        (self.product)(x, &mut y)?;
        Ok(y)
    }
}

impl<W> DualOperator for DelassusDual<W>
where
    W: FnMut(&[f64], &mut [f64]) -> Result<(), DualError>,
{
    fn size(&self) -> (usize, usize) {
        (self.contact.n_cols(), self.contact.n_rows())
    }

    fn apply(&mut self, p: &[f64], y: &mut [f64], _: Accuracy, _: &Stop) -> Result<(), DualError> {
        let moved = self.times(&self.impulses(p))?;
        self.restrict(&moved, y);
        Ok(())
    }

    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.contact.mul(u, y);
    }

    fn at_contact(&mut self, request: &Request, y: &mut [f64]) -> Result<Correction, DualError> {
        let u = self.times(&request.forces(&self.contact))?;
        self.restrict(&u, y);
        Ok(Correction::default())
    }

    fn matrix(&self) -> Option<Csr> {
        // The row of B for each entry of q.
        let mut rows = vec![0; self.contact.n_cols()];
        (self.contact.triplets()).for_each(|(row, entry, _)| rows[entry] = row);
        let entries = self.matrix.as_ref()?.triplets();
        let n = rows.len();
        Some(Csr::from_triplets(
            n,
            n,
            entries.map(|(i, j, v)| (rows[i], rows[j], v)),
        ))
    }

    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        let forces = request.forces(&self.contact);
        let u = self.times(&forces)?;
        if self.known.len() == REMEMBERED {
            self.known.remove(0);
        }
        self.known.push([u.clone(), forces]);
        Ok(u)
    }

    /// For the result of [`Self::displacement`], K u is the vector it was made from: W has no inverse to apply.
    fn stiffness_times(&mut self, u: &[f64], _: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        if u.iter().all(|&u| u == 0.0) {
            return Ok([vec![0.0; u.len()], vec![0.0; u.len()]]);
        }
        let known = self.known.iter().rev().find(|[known, _]| known == u);
        let [_, forces] = known.ok_or_else(|| {
            let text = "W has no inverse: only velocities that it has made can be checked";
            DualError::Other(text.into())
        })?;
        let sizes = forces.iter().map(|f| f.abs()).collect();
        Ok([forces.clone(), sizes])
    }
}
