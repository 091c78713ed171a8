//! The kernels of the multigrid levels on the CPU, in f32 or f64.

use crate::sparse::stored::{BlockMatrix, BlockView, Dense, Real, times};
use rayon::prelude::*;

/// Block rows of one parallel task.
const ROWS_PER_TASK: usize = 512;
/// Rows of a dense matrix of one parallel task.
const DENSE_ROWS_PER_TASK: usize = 64;

/// D⁻¹ of a level: square blocks, by rows.
#[derive(Clone, Debug)]
pub struct Diagonal<S> {
    /// Rows of a block.
    pub(super) block: usize,
    pub(super) values: Vec<S>,
}

/// d = c D⁻¹ b, x = d.
pub(super) fn chebyshev_first<S: Real>(
    inverse_diagonal: &Diagonal<S>,
    c: S,
    b: &[S],
    d: &mut [S],
    x: &mut [S],
) {
    fn kernel<const B: usize, S: Real>(
        inverse_diagonal: &[S],
        c: S,
        b: &[S],
        d: &mut [S],
        x: &mut [S],
    ) {
        let inverse_diagonal = inverse_diagonal.as_chunks::<B>().0.as_chunks::<B>().0;
        (d.par_chunks_mut(ROWS_PER_TASK * B))
            .zip(x.par_chunks_mut(ROWS_PER_TASK * B))
            .zip(b.par_chunks(ROWS_PER_TASK * B))
            .zip(inverse_diagonal.par_chunks(ROWS_PER_TASK))
            .for_each(|(((d, x), b), blocks)| {
                let rows = (d.as_chunks_mut::<B>().0.iter_mut()).zip(x.as_chunks_mut::<B>().0);
                for (((d, x), b), block) in rows.zip(b.as_chunks::<B>().0).zip(blocks) {
                    *d = times(block, b).map(|v| c * v);
                    *x = *d;
                }
            });
    }
    match inverse_diagonal.block {
        2 => kernel::<2, S>(&inverse_diagonal.values, c, b, d, x),
        _ => kernel::<3, S>(&inverse_diagonal.values, c, b, d, x),
    }
}

/// d ← c₁ d + c₂ D⁻¹(b − A x), x_next = x + d.
pub(super) fn chebyshev_step<S: Real>(
    a: &BlockMatrix<S>,
    inverse_diagonal: &Diagonal<S>,
    step: [S; 2],
    b: &[S],
    x: &[S],
    d: &mut [S],
    x_next: &mut [S],
) {
    fn kernel<const B: usize, S: Real>(
        a: BlockView<B, B, S>,
        inverse_diagonal: &[S],
        [c1, c2]: [S; 2],
        b: &[S],
        x: &[S],
        d: &mut [S],
        x_next: &mut [S],
    ) {
        let inverse_diagonal = inverse_diagonal.as_chunks::<B>().0.as_chunks::<B>().0;
        let x_all = x.as_chunks::<B>().0;
        (d.par_chunks_mut(ROWS_PER_TASK * B))
            .zip(x_next.par_chunks_mut(ROWS_PER_TASK * B))
            .zip(b.par_chunks(ROWS_PER_TASK * B))
            .zip(x_all.par_chunks(ROWS_PER_TASK))
            .zip(inverse_diagonal.par_chunks(ROWS_PER_TASK))
            .enumerate()
            .for_each(|(task, ((((d, x_next), b), x), inverse_diagonal))| {
                let out = (d.as_chunks_mut::<B>().0.iter_mut()).zip(x_next.as_chunks_mut::<B>().0);
                let given = b.as_chunks::<B>().0.iter().zip(x).zip(inverse_diagonal);
                for (k, ((d, x_next), ((b, x), inverse_diagonal))) in out.zip(given).enumerate() {
                    let ax = a.row_times(task * ROWS_PER_TASK + k, x_all);
                    let r = std::array::from_fn(|c| b[c] - ax[c]);
                    let z = times(inverse_diagonal, &r);
                    for c in 0..B {
                        d[c] = c1 * d[c] + c2 * z[c];
                        x_next[c] = x[c] + d[c];
                    }
                }
            });
    }
    let inverse_diagonal = &inverse_diagonal.values;
    match a.block {
        [2, _] => kernel::<2, S>(a.view(), inverse_diagonal, step, b, x, d, x_next),
        _ => kernel::<3, S>(a.view(), inverse_diagonal, step, b, x, d, x_next),
    }
}

/// r = b − A x.
pub(super) fn residual<S: Real>(a: &BlockMatrix<S>, b: &[S], x: &[S], r: &mut [S]) {
    match a.block {
        [2, _] => rows::<2, 2, S>(a, x, r, |i, r, ax| *r = from_rows(b, i, |b, c| b - ax[c])),
        _ => rows::<3, 3, S>(a, x, r, |i, r, ax| *r = from_rows(b, i, |b, c| b - ax[c])),
    }
}

/// b_coarse = R r.
pub(super) fn restrict<S: Real>(restriction: &BlockMatrix<S>, r: &[S], b_coarse: &mut [S]) {
    match restriction.block {
        [2, 2] => rows::<2, 2, S>(restriction, r, b_coarse, |_, b, v| *b = v),
        [3, 2] => rows::<3, 2, S>(restriction, r, b_coarse, |_, b, v| *b = v),
        _ => rows::<3, 3, S>(restriction, r, b_coarse, |_, b, v| *b = v),
    }
}

/// x ← x + P x_coarse.
pub(super) fn prolong_add<S: Real>(prolongation: &BlockMatrix<S>, x_coarse: &[S], x: &mut [S]) {
    match prolongation.block {
        [2, 2] => rows::<2, 2, S>(prolongation, x_coarse, x, |_, x, v| add(x, v)),
        [2, 3] => rows::<2, 3, S>(prolongation, x_coarse, x, |_, x, v| add(x, v)),
        _ => rows::<3, 3, S>(prolongation, x_coarse, x, |_, x, v| add(x, v)),
    }
}

/// x = M b with a dense symmetric M.
pub(super) fn dense_apply<S: Real>(m: &Dense<S>, b: &[S], x: &mut [S]) {
    // Several sums per row, so that the additions need not wait for each other.
    const LANES: usize = 16;
    (x.par_chunks_mut(DENSE_ROWS_PER_TASK))
        .zip(m.values.par_chunks(DENSE_ROWS_PER_TASK * m.n))
        .for_each(|(x, rows)| {
            for (x, row) in x.iter_mut().zip(rows.chunks(m.n)) {
                let mut sums = [S::default(); LANES];
                let (row, row_end) = row.as_chunks::<LANES>();
                let (b, b_end) = b.as_chunks::<LANES>();
                for (row, b) in row.iter().zip(b) {
                    for k in 0..LANES {
                        sums[k] += row[k] * b[k];
                    }
                }
                for (k, (&m, &b)) in row_end.iter().zip(b_end).enumerate() {
                    sums[k] += m * b;
                }
                *x = sums.into_iter().fold(S::default(), |sum, v| sum + v);
            }
        });
}

/// Calls `write(i, yᵢ, (M x)ᵢ)` for every block row i of M.
fn rows<const R: usize, const C: usize, S: Real>(
    matrix: &BlockMatrix<S>,
    x: &[S],
    y: &mut [S],
    write: impl Fn(usize, &mut [S; R], [S; R]) + Sync,
) {
    let (matrix, x) = (matrix.view::<R, C>(), x.as_chunks::<C>().0);
    y.par_chunks_mut(ROWS_PER_TASK * R)
        .enumerate()
        .for_each(|(task, y)| {
            let first = task * ROWS_PER_TASK;
            for (k, y) in y.as_chunks_mut::<R>().0.iter_mut().enumerate() {
                write(first + k, y, matrix.row_times(first + k, x));
            }
        });
}

/// `value(entry, component)` of the entries of block i of a vector.
fn from_rows<const B: usize, S: Real>(
    vector: &[S],
    i: usize,
    value: impl Fn(S, usize) -> S,
) -> [S; B] {
    std::array::from_fn(|c| value(vector[i * B + c], c))
}

fn add<const B: usize, S: Real>(x: &mut [S; B], y: [S; B]) {
    for c in 0..B {
        x[c] += y[c];
    }
}
