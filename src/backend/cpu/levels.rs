//! The kernels of the multigrid levels on the CPU, in f32 or f64.
//!
//! They use all vector instructions of the processor (`vectorised!`). The order of sums is fixed here, so that no
//! processor changes them.

use super::half::LevelMatrix;
use crate::backend::{BackendError, Product};
use crate::sparse::stored::{BlockMatrix, Dense, Real, times};
use crate::sparse::vectorised;
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

/// Calls a kernel with the shape of blocks as constants.
macro_rules! with_shape {
    ($block:expr, [$([$r:literal, $c:literal]),+], $kernel:ident $args:tt) => {
        match $block {
            $([$r, $c] => $kernel::<$r, $c, _> $args,)+
            _ => unreachable!("other shapes are refused when a matrix is handed over"),
        }
    };
}

/// The shapes of the plane and of space: finest level, between the finest and the coarser ones, coarser ones.
macro_rules! with_any_shape {
    ($block:expr, $kernel:ident $args:tt) => {
        with_shape!(
            $block,
            [[2, 2], [2, 3], [3, 2], [3, 3], [3, 6], [6, 3], [6, 6]],
            $kernel $args
        )
    };
}

/// Refuses shapes without a kernel in [`with_any_shape`].
pub(super) fn check_shape(block: [usize; 2]) -> Result<(), BackendError> {
    match block {
        [2 | 3, 2 | 3] | [3 | 6, 6] | [6, 3] => Ok(()),
        [rows, columns] => Err(BackendError::NoKernel { rows, columns }),
    }
}

/// d = c D⁻¹ b, x = d.
pub(super) fn smooth_first<S: Real>(
    inverse_diagonal: &Diagonal<S>,
    c: S,
    b: &[S],
    d: &mut [S],
    x: &mut [S],
) {
    fn kernel<const B: usize, const C: usize, S: Real>(
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
    with_shape!(
        [inverse_diagonal.block; 2],
        [[2, 2], [3, 3], [6, 6]],
        kernel(&inverse_diagonal.values, c, b, d, x)
    );
}

/// d ← c₁ d + c₂ D⁻¹(b − A x), x_next = x + d.
pub(super) fn smooth<S: Real>(
    a: &LevelMatrix<S>,
    inverse_diagonal: &Diagonal<S>,
    step: [S; 2],
    b: &[S],
    x: &[S],
    d: &mut [S],
    x_next: &mut [S],
) {
    fn kernel<const B: usize, const C: usize, S: Real>(
        a: &LevelMatrix<S>,
        inverse_diagonal: &[S],
        step: [S; 2],
        b: &[S],
        x: &[S],
        d: &mut [S],
        x_next: &mut [S],
    ) {
        let blocks = x.as_chunks::<B>().0;
        match a {
            LevelMatrix::Full(a) => {
                let a = a.view::<B, B>();
                with_product(
                    #[inline(always)]
                    |i| a.row_times(i, blocks),
                    inverse_diagonal,
                    step,
                    b,
                    x,
                    d,
                    x_next,
                );
            }
            LevelMatrix::Half(a) => {
                let product = a.times(blocks);
                with_product(
                    #[inline(always)]
                    |i| product.row(i),
                    inverse_diagonal,
                    step,
                    b,
                    x,
                    d,
                    x_next,
                );
            }
        }
    }
    fn with_product<const B: usize, S: Real>(
        ax: impl Fn(usize) -> [S; B] + Sync,
        inverse_diagonal: &[S],
        [c1, c2]: [S; 2],
        b: &[S],
        x: &[S],
        d: &mut [S],
        x_next: &mut [S],
    ) {
        let inverse_diagonal = inverse_diagonal.as_chunks::<B>().0.as_chunks::<B>().0;
        let (b, x, d) = (
            b.as_chunks::<B>().0,
            x.as_chunks::<B>().0,
            d.as_chunks_mut::<B>().0,
        );
        (x_next.par_chunks_mut(ROWS_PER_TASK * B))
            .zip(d.par_chunks_mut(ROWS_PER_TASK))
            .enumerate()
            .for_each(|(task, (x_next, d))| {
                vectorised!({
                    let rows = task * ROWS_PER_TASK..;
                    let out = x_next.as_chunks_mut::<B>().0.iter_mut().zip(&mut *d);
                    for (i, (x_next, d)) in rows.zip(out) {
                        let ax = ax(i);
                        let r = std::array::from_fn(|c| b[i][c] - ax[c]);
                        let z = times(&inverse_diagonal[i], &r);
                        for c in 0..B {
                            d[c] = c1 * d[c] + c2 * z[c];
                            x_next[c] = x[i][c] + d[c];
                        }
                    }
                });
            });
    }
    with_shape!(
        a.block(),
        [[2, 2], [3, 3], [6, 6]],
        kernel(a, &inverse_diagonal.values, step, b, x, d, x_next)
    );
}

/// d ← c₁ d + c₂ D⁻¹ r, x += d with D⁻¹ as a matrix; without c₁ d = c₂ D⁻¹ r, x = d.
pub(super) fn smooth_patches<S: Real>(
    patches: &BlockMatrix<S>,
    c1: Option<S>,
    c2: S,
    r: &[S],
    d: &mut [S],
    x: &mut [S],
) {
    fn kernel<const B: usize, const C: usize, S: Real>(
        patches: &BlockMatrix<S>,
        c1: Option<S>,
        c2: S,
        r: &[S],
        d: &mut [S],
        x: &mut [S],
    ) {
        let (patches, r) = (patches.view::<B, B>(), r.as_chunks::<B>().0);
        (d.par_chunks_mut(ROWS_PER_TASK * B))
            .zip(x.par_chunks_mut(ROWS_PER_TASK * B))
            .enumerate()
            .for_each(|(task, (d, x))| {
                vectorised!({
                    let rows = (d.as_chunks_mut::<B>().0.iter_mut()).zip(x.as_chunks_mut::<B>().0);
                    for (i, (d, x)) in (task * ROWS_PER_TASK..).zip(rows) {
                        let z = patches.row_times(i, r);
                        for c in 0..B {
                            match c1 {
                                Some(c1) => {
                                    d[c] = c1 * d[c] + c2 * z[c];
                                    x[c] += d[c];
                                }
                                None => {
                                    d[c] = c2 * z[c];
                                    x[c] = d[c];
                                }
                            }
                        }
                    }
                });
            });
    }
    with_shape!(
        patches.block(),
        [[2, 2], [3, 3], [6, 6]],
        kernel(patches, c1, c2, r, d, x)
    );
}

/// y of M x: see [`Product`].
pub(super) fn multiply<S: Real>(
    m: &LevelMatrix<S>,
    product: Product,
    b: &[S],
    x: &[S],
    y: &mut [S],
) {
    match product {
        Product::Plain => with_any_shape!(m.block(), rows(m, x, y, |_, y, v| *y = v)),
        Product::Added => with_any_shape!(m.block(), rows(m, x, y, |_, y, v| *y += v)),
        Product::Residual => with_any_shape!(m.block(), rows(m, x, y, |i, y, v| *y = b[i] - v)),
    }
}

/// Calls `write(i, yᵢ, (M x)ᵢ)` for every row i of M.
fn rows<const R: usize, const C: usize, S: Real>(
    matrix: &LevelMatrix<S>,
    x: &[S],
    y: &mut [S],
    write: impl Fn(usize, &mut S, S) + Sync,
) {
    match matrix {
        LevelMatrix::Full(matrix) => {
            let (matrix, x) = (matrix.view::<R, C>(), x.as_chunks::<C>().0);
            write_rows(
                #[inline(always)]
                |i| matrix.row_times(i, x),
                y,
                write,
            );
        }
        LevelMatrix::Half(matrix) => {
            let product = matrix.times(x.as_chunks::<R>().0);
            write_rows(
                #[inline(always)]
                |i| product.row(i),
                y,
                write,
            );
        }
    }
}

/// The same of a product by rows.
fn write_rows<const R: usize, S: Real>(
    mx: impl Fn(usize) -> [S; R] + Sync,
    y: &mut [S],
    write: impl Fn(usize, &mut S, S) + Sync,
) {
    y.par_chunks_mut(ROWS_PER_TASK * R)
        .enumerate()
        .for_each(|(task, y)| {
            vectorised!({
                let first = task * ROWS_PER_TASK;
                for (k, y) in y.as_chunks_mut::<R>().0.iter_mut().enumerate() {
                    let sum = mx(first + k);
                    for c in 0..R {
                        write((first + k) * R + c, &mut y[c], sum[c]);
                    }
                }
            });
        });
}

/// x = M b with a dense symmetric M.
pub(super) fn dense_apply<S: Real>(m: &Dense<S>, b: &[S], x: &mut [S]) {
    // Several sums per row, so that the additions need not wait for each other.
    const LANES: usize = 16;
    (x.par_chunks_mut(DENSE_ROWS_PER_TASK))
        .zip(m.values().par_chunks(DENSE_ROWS_PER_TASK * m.n()))
        .for_each(|(x, rows)| {
            for (x, row) in x.iter_mut().zip(rows.chunks(m.n())) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::BlockCsr;

    /// Two rows of 2 × 3 blocks: 1 2 3 / 4 5 6 in the column 1 of the first, 1 0 0 / 0 1 0 in both of the second.
    fn matrix() -> LevelMatrix<f64> {
        let one = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        let blocks = vec![[[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], one, one];
        let matrix = BlockCsr::<2, 3>::from_parts(2, 2, vec![0, 1, 3], vec![1, 0, 1], blocks);
        LevelMatrix::Full(BlockMatrix::new(&matrix, 1.0))
    }

    #[test]
    fn products_by_hand() {
        let x = [1.0, 10.0, 100.0, 1.0, -1.0, 2.0];
        // M x = (5, 11, 2, 9).
        for (product, expected) in [
            (Product::Plain, [5.0, 11.0, 2.0, 9.0]),
            (Product::Added, [6.0, 13.0, 5.0, 13.0]),
            (Product::Residual, [5.0, -1.0, 8.0, 1.0]),
        ] {
            let mut y = [1.0, 2.0, 3.0, 4.0];
            multiply(&matrix(), product, &[10.0; 4], &x, &mut y);
            assert_eq!(y, expected, "{product:?}");
        }
    }

    #[test]
    fn smoothing_by_hand() {
        // D⁻¹ is 1/2 of the identity and A the identity with a coupling of the nodes: x = (1, 2, 3, 4).
        let identity = [[1.0, 0.0], [0.0, 1.0]];
        let coupling = [[0.0, 1.0], [0.0, 0.0]];
        let a = BlockCsr::<2>::from_parts(
            2,
            2,
            vec![0, 2, 3],
            vec![0, 1, 1],
            vec![identity, coupling, identity],
        );
        let a = LevelMatrix::Full(BlockMatrix::new(&a, 1.0));
        let half = Diagonal {
            block: 2,
            values: [0.5, 0.0, 0.0, 0.5].repeat(2),
        };
        let b = [9.0, 8.0, 7.0, 6.0];
        let (mut d, mut x) = ([0.0; 4], [0.0; 4]);
        smooth_first(&half, 2.0, &b, &mut d, &mut x);
        assert_eq!((d, x), (b, b));
        let x = [1.0, 2.0, 3.0, 4.0];
        let (mut d, mut next) = ([10.0, 0.0, 0.0, 0.0], [0.0; 4]);
        // A x = (5, 2, 3, 4), r = (4, 6, 4, 2); d = 0.1 d + 4 · r/2.
        smooth(&a, &half, [0.1, 4.0], &b, &x, &mut d, &mut next);
        assert_eq!(d, [9.0, 12.0, 8.0, 4.0]);
        assert_eq!(next, [10.0, 14.0, 11.0, 8.0]);
    }

    #[test]
    fn patches_by_hand() {
        // D⁻¹ ties two nodes: D⁻¹ r = (3, 0, 2, 0) of r = (1, 0, 2, 0).
        let [one, zero] = [[[1.0, 0.0], [0.0, 1.0]], [[0.0; 2]; 2]];
        let patches = BlockCsr::<2>::from_parts(
            2,
            2,
            vec![0, 2, 4],
            vec![0, 1, 0, 1],
            vec![one, one, zero, one],
        );
        let patches = BlockMatrix::new(&patches, 1.0);
        let r = [1.0, 0.0, 2.0, 0.0];
        let (mut d, mut x) = ([7.0; 4], [7.0; 4]);
        smooth_patches(&patches, None, 2.0, &r, &mut d, &mut x);
        assert_eq!((d, x), ([6.0, 0.0, 4.0, 0.0], [6.0, 0.0, 4.0, 0.0]));
        smooth_patches(&patches, Some(0.5), 1.0, &r, &mut d, &mut x);
        assert_eq!((d, x), ([6.0, 0.0, 4.0, 0.0], [12.0, 0.0, 8.0, 0.0]));
    }

    #[test]
    fn dense_by_hand() {
        let n = 19;
        // Row i is i, 2i, 3i …; times ones this is i n(n + 1)/2.
        let values = (0..n * n).map(|k| ((k / n) * (k % n + 1)) as f64);
        let m = Dense::new(n, values.collect());
        let mut x = vec![0.0; n];
        dense_apply(&m, &vec![1.0; n], &mut x);
        assert!(x.iter().enumerate().all(|(i, &v)| v == (i * 190) as f64));
    }

    #[test]
    fn other_shapes_have_no_kernel() {
        assert!(check_shape([6, 6]).is_ok() && check_shape([3, 6]).is_ok());
        for block in [[1, 1], [2, 6], [6, 2], [4, 4], [3, 9]] {
            assert!(check_shape(block).is_err());
        }
    }
}
