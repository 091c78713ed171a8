//! Decompositions of small dense matrices, by faer in the calling thread.
//!
//! faer's short forms take as many threads as there are and split sums accordingly: results would depend on the
//! number of threads in their last digits.

use faer::diag::Diag;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt;
use faer::linalg::evd::{self, ComputeEigenvectors};
use faer::linalg::lu::partial_pivoting;
use faer::linalg::matmul::matmul;
use faer::linalg::qr::{col_pivoting, no_pivoting};
use faer::linalg::svd::{self, ComputeSvdVectors};
use faer::{Accum, Conj, Mat, MatRef, Par};
use rayon::prelude::*;

const PAR: Par = Par::Seq;
/// Entries from which on operations on several vectors are shared by all cores: each takes a core more than 30 µs, and starting a
/// task some 5 µs.
pub(crate) const PARALLEL: usize = 1 << 16;

/// Eigenvalues in ascending order and eigenvectors (columns) of a symmetric matrix, from its lower triangle; None if an
/// entry is not finite.
pub(crate) fn symmetric_eigen(matrix: &Mat<f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let mut vectors = Mat::zeros(matrix.nrows(), matrix.nrows());
    let values = eigenvalues(matrix, Some(&mut vectors))?;
    Some((values, vectors))
}

/// The largest eigenvalue alone; NaN if an entry is not finite, or for an empty matrix.
pub(crate) fn symmetric_largest(matrix: &Mat<f64>) -> f64 {
    let values = eigenvalues(matrix, None);
    values
        .and_then(|values| values.last().copied())
        .unwrap_or(f64::NAN)
}

fn eigenvalues(matrix: &Mat<f64>, vectors: Option<&mut Mat<f64>>) -> Option<Vec<f64>> {
    let n = matrix.nrows();
    if !is_finite(matrix) {
        return None;
    }
    let mut values = Diag::zeros(n);
    let with = match vectors {
        Some(_) => ComputeEigenvectors::Yes,
        None => ComputeEigenvectors::No,
    };
    let scratch = evd::self_adjoint_evd_scratch::<f64>(n, with, PAR, Default::default());
    evd::self_adjoint_evd(
        matrix.as_ref(),
        values.as_mut(),
        vectors.map(Mat::as_mut),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .ok()?;
    Some(values.column_vector().iter().copied().collect())
}

/// The largest eigenvalue of a small symmetric tridiagonal matrix from Lanczos: `off` are the off-diagonal entries, one
/// fewer. NaN if an entry is not finite, or for an empty matrix.
pub(crate) fn tridiagonal_largest(diagonal: &[f64], off: &[f64]) -> f64 {
    let n = diagonal.len();
    let lower = Mat::from_fn(n, n, |i, j| match i.checked_sub(j) {
        Some(0) => diagonal[i],
        Some(1) => off[j],
        _ => 0.0,
    });
    symmetric_largest(&lower)
}

/// Singular values, the largest first, and all right singular vectors (columns): those of a matrix with few rows,
/// too, that have no singular value. None if an entry is not finite.
pub(crate) fn right_singular(matrix: &Mat<f64>) -> Option<(Vec<f64>, Mat<f64>)> {
    let (m, n) = (matrix.nrows(), matrix.ncols());
    if !is_finite(matrix) {
        return None;
    }
    let mut values = Diag::zeros(m.min(n));
    let mut left = Mat::zeros(m, m.min(n));
    let mut vectors = Mat::zeros(n, n);
    let (thin, full) = (ComputeSvdVectors::Thin, ComputeSvdVectors::Full);
    let scratch = svd::svd_scratch::<f64>(m, n, thin, full, PAR, Default::default());
    svd::svd(
        matrix.as_ref(),
        values.as_mut(),
        Some(left.as_mut()),
        Some(vectors.as_mut()),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .ok()?;
    Some((values.column_vector().iter().copied().collect(), vectors))
}

/// The x with the least ‖M x − b‖, for a matrix with no fewer rows than columns.
pub(crate) fn least_squares(mut matrix: Mat<f64>, b: &[f64]) -> Vec<f64> {
    let (m, n) = (matrix.nrows(), matrix.ncols());
    let block = no_pivoting::factor::recommended_block_size::<f64>(m, n);
    let mut coefficients = Mat::zeros(block, n);
    let (mut forward, mut back) = (vec![0_usize; n], vec![0; n]);
    let scratch = col_pivoting::factor::qr_in_place_scratch::<usize, f64>(
        m,
        n,
        block,
        PAR,
        Default::default(),
    );
    let (_, permutation) = col_pivoting::factor::qr_in_place(
        matrix.as_mut(),
        coefficients.as_mut(),
        &mut forward,
        &mut back,
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    );
    let mut x = Mat::from_fn(m, 1, |i, _| b[i]);
    let scratch =
        col_pivoting::solve::solve_lstsq_in_place_scratch::<usize, f64>(m, n, block, 1, PAR);
    // The reflections are below the diagonal, R is the rest.
    col_pivoting::solve::solve_lstsq_in_place_with_conj(
        matrix.as_ref(),
        coefficients.as_ref(),
        matrix.get(..n, ..),
        permutation,
        Conj::No,
        x.as_mut(),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
    );
    (0..n).map(|i| x[(i, 0)]).collect()
}

/// The x with M x = b, by Gauss; not finite where M is singular.
pub(crate) fn solve(mut matrix: Mat<f64>, b: &[f64]) -> Vec<f64> {
    let n = matrix.nrows();
    let (mut forward, mut back) = (vec![0_usize; n], vec![0; n]);
    let scratch =
        partial_pivoting::factor::lu_in_place_scratch::<usize, f64>(n, n, PAR, Default::default());
    let (_, permutation) = partial_pivoting::factor::lu_in_place(
        matrix.as_mut(),
        &mut forward,
        &mut back,
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    );
    let mut x = Mat::from_fn(n, 1, |i, _| b[i]);
    let scratch = partial_pivoting::solve::solve_in_place_scratch::<usize, f64>(n, 1, PAR);
    partial_pivoting::solve::solve_in_place_with_conj(
        matrix.as_ref(),
        matrix.as_ref(),
        permutation,
        Conj::No,
        x.as_mut(),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
    );
    (0..n).map(|i| x[(i, 0)]).collect()
}

/// aᵀ b of matrices with so many rows, column by column one after the other. Where there is enough work, some columns of b are a task.
pub(crate) fn transposed_product(rows: usize, a: &[f64], b: &[f64]) -> Mat<f64> {
    /// The columns of a task: each reads all of a.
    const COLUMNS: usize = 8;
    fn of(rows: usize, data: &[f64]) -> MatRef<'_, f64> {
        MatRef::from_column_major_slice(data, rows, data.len() / rows)
    }
    let product = |b: &[f64]| {
        let (a, b) = (of(rows, a), of(rows, b));
        let mut product = Mat::zeros(a.ncols(), b.ncols());
        matmul(product.as_mut(), Accum::Replace, a.transpose(), b, 1.0, PAR);
        product
    };
    if b.len() < PARALLEL {
        return product(b);
    }
    let parts: Vec<Mat<f64>> = b.par_chunks(COLUMNS * rows).map(product).collect();
    let columns = b.len() / rows;
    Mat::from_fn(a.len() / rows, columns, |i, j| {
        parts[j / COLUMNS][(i, j % COLUMNS)]
    })
}

/// The Cholesky factor L of a symmetric matrix, from its lower triangle; None if it is not positive definite.
pub(crate) fn cholesky(mut matrix: Mat<f64>) -> Option<Mat<f64>> {
    let n = matrix.nrows();
    let scratch = llt::factor::cholesky_in_place_scratch::<f64>(n, PAR, Default::default());
    llt::factor::cholesky_in_place(
        matrix.as_mut(),
        Default::default(),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
        Default::default(),
    )
    .ok()?;
    Some(matrix)
}

/// The lower triangle of (L Lᵀ)⁻¹, of a factor made by [`cholesky`].
pub(crate) fn inverse(factor: &Mat<f64>) -> Mat<f64> {
    let n = factor.nrows();
    let mut inverse = Mat::zeros(n, n);
    let scratch = llt::inverse::inverse_scratch::<f64>(n, PAR);
    llt::inverse::inverse(
        inverse.as_mut(),
        factor.as_ref(),
        PAR,
        MemStack::new(&mut MemBuffer::new(scratch)),
    );
    inverse
}

/// The pseudo-inverse of a small symmetric positive semidefinite matrix: eigenvalues up to `dependent` times the
/// largest count as zero. Zero if an entry is not finite.
pub(crate) fn pseudo_inverse(matrix: &Mat<f64>, dependent: f64) -> Mat<f64> {
    let n = matrix.nrows();
    let mut inverse = Mat::<f64>::zeros(n, n);
    let Some((values, vectors)) = symmetric_eigen(matrix) else {
        return inverse;
    };
    let largest = values.iter().copied().fold(0.0, f64::max);
    for (c, &value) in values.iter().enumerate() {
        if value > dependent * largest && value > 0.0 {
            for p in 0..n {
                for q in 0..n {
                    inverse[(p, q)] += vectors[(p, c)] * vectors[(q, c)] / value;
                }
            }
        }
    }
    inverse
}

fn is_finite(matrix: &Mat<f64>) -> bool {
    matrix
        .col_iter()
        .all(|column| column.iter().all(|v| v.is_finite()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Entries without any pattern.
    fn arbitrary(rows: usize, cols: usize) -> Mat<f64> {
        Mat::from_fn(rows, cols, |i, j| {
            ((7 * i + 13 * j + i * j + 1) as f64).sin()
        })
    }

    /// Shared by all cores, a product has the same entries; the last task has fewer columns.
    #[test]
    fn long_columns_are_multiplied_in_parts() {
        let (rows, columns) = (PARALLEL / 16, 19);
        let m = arbitrary(rows, columns);
        let data: Vec<f64> = m.col_iter().flat_map(|c| c.iter()).copied().collect();
        let found = transposed_product(rows, &data[..3 * rows], &data);
        let expected = m.transpose().subrows(0, 3) * &m;
        assert!((&found - &expected).norm_max() < 1e-11 * expected.norm_max());
    }

    #[test]
    fn decompositions_multiply_back() {
        for n in [1, 2, 5, 40, 150] {
            let m = arbitrary(n + 3, n);
            let columns: Vec<f64> = m.col_iter().flat_map(|c| c.iter()).copied().collect();
            let gram = transposed_product(n + 3, &columns, &columns);
            assert!((&gram - m.transpose() * &m).norm_max() < 1e-12);
            let close = |a: &Mat<f64>, b: &Mat<f64>| {
                assert!((a - b).norm_max() < 1e-10 * b.norm_max(), "{n}");
            };
            let (values, vectors) =
                symmetric_eigen(&gram).unwrap_or_else(|| panic!("no eigenvalues"));
            let scaled = Mat::from_fn(n, n, |i, j| vectors[(i, j)] * values[j]);
            close(&(scaled * vectors.transpose()), &gram);
            assert!(values.is_sorted());

            let (values, right) = right_singular(&m).unwrap_or_else(|| panic!("no values"));
            let scaled = Mat::from_fn(n, n, |i, j| right[(i, j)] * values[j] * values[j]);
            close(&(scaled * right.transpose()), &gram);

            let x = arbitrary(n, 1);
            let b: Vec<f64> = (&m * &x).col(0).iter().copied().collect();
            let found = least_squares(m.clone(), &b);
            close(&Mat::from_fn(n, 1, |i, _| found[i]), &x);

            let square = arbitrary(n, n);
            let b: Vec<f64> = (&square * &x).col(0).iter().copied().collect();
            let found = Mat::from_fn(n, 1, |i, _| solve(square.clone(), &b)[i]);
            close(&(&square * found), &(&square * &x));

            let mut shifted = gram.clone();
            for i in 0..n {
                shifted[(i, i)] += 1.0;
                for j in 0..i {
                    // Entries above the diagonal are not read.
                    shifted[(j, i)] = f64::NAN;
                }
            }
            let factor = cholesky(shifted).unwrap_or_else(|| panic!("not definite"));
            let lower = inverse(&factor);
            let inverse = Mat::from_fn(n, n, |i, j| lower[(i.max(j), i.min(j))]);
            let one = Mat::<f64>::identity(n, n);
            close(&(inverse * (&gram + &one)), &one);
        }
        assert!(cholesky(Mat::from_fn(2, 2, |_, _| -1.0)).is_none());
    }

    #[test]
    fn the_largest_eigenvalue_of_the_second_difference() {
        for n in [1, 2, 7, 30] {
            let angle = std::f64::consts::PI * n as f64 / (n + 1) as f64;
            let expected = 2.0 - 2.0 * angle.cos();
            for sign in [1.0, -1.0] {
                let found = tridiagonal_largest(&vec![2.0; n], &vec![sign; n - 1]);
                assert!((found - expected).abs() < 1e-14 * expected, "{n}: {found}");
            }
        }
        assert!(tridiagonal_largest(&[], &[]).is_nan());
        assert!(tridiagonal_largest(&[1.0, f64::NAN], &[0.0]).is_nan());
    }

    #[test]
    fn few_rows_leave_a_null_space() {
        let m = arbitrary(3, 9);
        let (values, right) = right_singular(&m).unwrap_or_else(|| panic!("no values"));
        assert_eq!((values.len(), right.ncols()), (3, 9));
        assert!((&m * right.get(.., 3..)).norm_max() < 1e-13 && values[2] > 0.1);
        assert!(right_singular(&Mat::from_fn(2, 2, |_, _| f64::NAN)).is_none());
        assert!(symmetric_eigen(&Mat::from_fn(2, 2, |_, _| f64::INFINITY)).is_none());
    }
}
