//! The data of the Chebyshev smoother: inverse diagonal blocks, spectral radius, coefficients.

use super::Inverse;
use crate::dense::tridiagonal_largest;
use crate::ranks::Halo;
use crate::sparse::stored::{BlockMatrix, Real, times};
use crate::sparse::{BlockCsr, ROWS_PER_TASK, vectorised};
use rayon::prelude::*;

/// Steps of the estimate of the spectral radius.
const LANCZOS_STEPS: usize = 10;

/// The inverses of the diagonal blocks; or the number of the first one that is not positive definite.
pub(crate) fn inverse_diagonal<const B: usize>(
    a: &BlockCsr<B>,
) -> Result<Vec<[[f64; B]; B]>, usize> {
    (0..a.n_block_rows())
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|i| {
            let mut block = *a.block(i, i).ok_or(i)?;
            match invert(block.as_flattened_mut(), [&mut [0.0; B], &mut [0.0; B]]) {
                true => Ok(block),
                false => Err(i),
            }
        })
        .collect()
}

/// Replaces a symmetric positive definite matrix by its inverse, by Gauss–Jordan elimination with room for two rows; false if
/// a pivot is not positive beyond rounding.
#[inline(always)]
pub(super) fn invert(a: &mut [f64], [least, pivot_row]: [&mut [f64]; 2]) -> bool {
    let n = least.len();
    for k in 0..n {
        least[k] = 4.0 * f64::EPSILON * a[k * n + k];
    }
    for k in 0..n {
        let pivot = a[k * n + k];
        if !(pivot > least[k]) {
            return false;
        }
        a[k * n + k] = 1.0;
        for j in 0..n {
            pivot_row[j] = a[k * n + j] / pivot;
        }
        for (i, row) in a.chunks_exact_mut(n).enumerate() {
            if i == k {
                row.copy_from_slice(pivot_row);
                continue;
            }
            let factor = std::mem::replace(&mut row[k], 0.0);
            for (v, p) in row.iter_mut().zip(&*pivot_row) {
                *v -= factor * p;
            }
        }
    }
    true
}

/// The largest eigenvalue of D⁻¹A, from below: the largest Ritz value of a few steps of conjugate gradients
/// preconditioned with D, which build the Lanczos tridiagonal matrix on the way.
///
/// A, with the columns of copies, and D⁻¹ are used in their stored precision: two digits of the result suffice.
pub(super) fn spectral_radius<const B: usize, S: Real>(
    a: &BlockMatrix<S>,
    inverse: &Inverse<S>,
    halo: &Halo,
) -> f64 {
    let n = a.n_block_rows();
    let first = halo.first() as usize;
    let a = a.view::<B, B>();
    let multiplied = |r: &[[S; B]], z: &mut [[S; B]]| {
        let rows = z.par_chunks_mut(ROWS_PER_TASK).enumerate();
        rows.for_each(|(task, z)| {
            vectorised!({
                for (k, z) in z.iter_mut().enumerate() {
                    let i = task * ROWS_PER_TASK + k;
                    *z = match inverse {
                        Inverse::Diagonal { values, .. } => {
                            times(&values.as_chunks::<B>().0.as_chunks::<B>().0[i], &r[i])
                        }
                        Inverse::Patches(patches) => patches.view::<B, B>().row_times(i, r),
                    };
                }
            });
        });
    };
    let mut r: Vec<[S; B]> = (0..n)
        .into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .map(|i| std::array::from_fn(|c| S::from_f64(noise((first + i) * B + c))))
        .collect();
    let mut z = vec![[S::default(); B]; n];
    let mut p = halo.extended(B, z.as_flattened().to_vec());
    let mut q = z.clone();
    // r ← r − α q, z = D⁻¹ r; returns rᵀz.
    let precondition = |alpha: S, q: &[[S; B]], r: &mut [[S; B]], z: &mut [[S; B]]| {
        (r.par_iter_mut().zip(q))
            .with_min_len(ROWS_PER_TASK)
            .for_each(|(r, q)| *r = std::array::from_fn(|c| r[c] - alpha * q[c]));
        multiplied(r, z);
        let rows = r.par_chunks(ROWS_PER_TASK).zip(z.par_chunks(ROWS_PER_TASK));
        let parts = rows.map(|(r, z)| r.iter().zip(z).map(|(r, z)| inner(r, z)).sum());
        ordered_sum(parts, halo)
    };
    let first = precondition(S::default(), &q, &mut r, &mut z);
    let (mut rz, mut alpha_old, mut beta) = (first, 1.0, 0.0);
    let (mut diagonal, mut off_diagonal) = (Vec::new(), Vec::new());
    for _ in 0..LANCZOS_STEPS {
        let b = S::from_f64(beta);
        (p.as_chunks_mut::<B>().0.par_iter_mut().zip(&z))
            .with_min_len(ROWS_PER_TASK)
            .for_each(|(p, z)| *p = std::array::from_fn(|c| z[c] + b * p[c]));
        halo.update(B, &mut p);
        let p = p.as_chunks::<B>().0;
        let rows = q.par_chunks_mut(ROWS_PER_TASK).enumerate();
        let parts = rows.map(|(task, q)| {
            vectorised!({
                let mut sum = 0.0;
                for (k, q) in q.iter_mut().enumerate() {
                    let i = task * ROWS_PER_TASK + k;
                    *q = a.row_times(i, p);
                    sum += inner(q, &p[i]);
                }
                sum
            })
        });
        let pq = ordered_sum(parts, halo);
        let alpha = rz / pq;
        if !(alpha > 0.0 && alpha.is_finite()) {
            break;
        }
        diagonal.push(1.0 / alpha + beta / alpha_old);
        let rz_old = rz;
        rz = precondition(S::from_f64(alpha), &q, &mut r, &mut z);
        // The Krylov space is exhausted, and the Ritz values are eigenvalues.
        if !(rz > 1e-12 * first) {
            break;
        }
        beta = rz / rz_old;
        off_diagonal.push(beta.sqrt() / alpha);
        alpha_old = alpha;
    }
    off_diagonal.truncate(diagonal.len().saturating_sub(1));
    tridiagonal_largest(&diagonal, &off_diagonal)
}

/// Σ xᵢ yᵢ of two short vectors.
fn inner<const B: usize, S: Real>(x: &[S; B], y: &[S; B]) -> f64 {
    (0..B).map(|c| x[c].to_f64() * y[c].to_f64()).sum()
}

/// The sum of the results of parallel tasks, in the order of the tasks, and of all ranks.
fn ordered_sum(parts: impl IndexedParallelIterator<Item = f64>, halo: &Halo) -> f64 {
    let mut sum = [parts.collect::<Vec<f64>>().into_iter().sum()];
    halo.ranks().sum(&mut sum);
    sum[0]
}

/// A number in (−1, 1) that depends on `i` without any pattern (the mixing function of SplitMix64).
pub(super) fn noise(i: usize) -> f64 {
    let mut x = (i as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((x ^ (x >> 31)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}

/// The coefficients (c₁, c₂) of the steps d ← c₁ d + c₂ D⁻¹(b − A x), x ← x + d. The Chebyshev iteration is on the
/// interval [`low`, `high`] (Saad, Iterative Methods, Algorithm 12.1).
pub(super) fn chebyshev(degree: usize, low: f64, high: f64) -> Vec<[f64; 2]> {
    let (centre, half) = (0.5 * (high + low), 0.5 * (high - low));
    let sigma = centre / half;
    let mut rho = 1.0 / sigma;
    let mut steps = vec![[0.0, 1.0 / centre]];
    for _ in 1..degree {
        let next = 1.0 / (2.0 * sigma - rho);
        steps.push([next * rho, 2.0 * next / half]);
        rho = next;
    }
    steps
}
