//! The inverse on the coarsest level.

use super::AmgError;
use crate::dense::{self, cholesky};
use crate::sparse::BlockCsr;
use crate::sparse::stored::{Dense, Real};
use faer::Mat;

/// A pivot below this part of its diagonal entry means a singular matrix.
const PIVOT_LIMIT: f64 = 1e-13;
/// The diagonal is raised by this part of it before inverting. It bounds the largest entries of the
/// inverse, so that their rounding to f32 cannot make its smallest eigenvalues negative; modes that soft
/// are few and left to conjugate gradients.
pub(super) const SHIFT: f64 = 16.0 * f32::EPSILON as f64;

/// (scale · A)⁻¹ with the diagonal of A raised a little, or an error if A is not positive definite.
pub(super) fn inverse<const B: usize, S: Real>(
    a: &BlockCsr<B>,
    scale: f64,
) -> Result<Dense<S>, AmgError> {
    let n = a.n_rows();
    let mut dense = Mat::<f64>::zeros(n, n);
    for (i, j, value) in a.triplets() {
        dense[(i, j)] = scale * value;
    }
    let l = cholesky(dense.clone()).ok_or(AmgError::Singular)?;
    if !(0..n).all(|i| l[(i, i)] * l[(i, i)] > PIVOT_LIMIT * dense[(i, i)]) {
        return Err(AmgError::Singular);
    }
    for i in 0..n {
        dense[(i, i)] *= 1.0 + SHIFT;
    }
    let factor = cholesky(dense).ok_or(AmgError::Singular)?;
    let lower = dense::inverse(&factor);
    let values = (0..n * n)
        .map(|k| (k / n, k % n))
        .map(|(i, j)| S::from_f64(lower[(i.max(j), i.min(j))]));
    Ok(Dense::new(n, values.collect()))
}
