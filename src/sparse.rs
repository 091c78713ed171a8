//! Sparse matrices with dense `R × C` blocks, in compressed rows.
//!
//! One type serves the stiffness matrix (2 × 2, a block per pair of nodes) and the rows of N and T (1 × 1, see
//! [`Csr`]). It also serves the coarse matrices and prolongations of multigrid (3 × 3 and 2 × 3). Column indices are
//! `u32` and sorted within a row.

pub(crate) mod lu;
pub mod stored;

use pulp::{Simd, WithSimd};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// A sparse matrix of `R × C` blocks in compressed block rows; square blocks if C is left out.
///
/// Block row `i` owns the entries `row_ptr[i]..row_ptr[i + 1]` of `col_idx` and `values`; its column
/// indices are strictly increasing. `values[k][a][b]` is the entry in row `a`, column `b` of block `k`.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockCsr<const R: usize, const C: usize = R> {
    n_block_rows: usize,
    n_block_cols: usize,
    row_ptr: Vec<usize>,
    col_idx: Vec<u32>,
    values: Vec<[[f64; C]; R]>,
}

/// A scalar compressed-row matrix.
pub type Csr = BlockCsr<1>;

/// Rows handled by one parallel task: enough work to hide the cost of starting it.
pub(crate) const ROWS_PER_TASK: usize = 4096;
/// Entries of a vector that one task takes: some 10 µs of work.
pub(crate) const PIECE: usize = 1 << 14;

/// Work of [`vectorised!`].
pub(crate) struct Vectorised<F>(pub F);

impl<T, F: FnMut() -> T> WithSimd for Vectorised<F> {
    type Output = T;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> T {
        (self.0)()
    }
}

/// Runs a block with the vector instructions of the processor; its sums keep their order.
///
/// A closure is compiled for them only inside the function that enables them. It has to be inlined, and must not be an
/// `FnOnce`, which would get a separate function in between.
macro_rules! vectorised {
    ($work:block) => {
        pulp::Arch::new().dispatch($crate::sparse::Vectorised(
            #[inline(always)]
            || $work,
        ))
    };
}
pub(crate) use vectorised;

impl<const B: usize> BlockCsr<B> {
    /// A matrix of `n_rows × n_cols` scalars from triplets (row, column, value); repeated entries add up, in their
    /// order.
    ///
    /// Sizes are rounded up to whole blocks.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn from_triplets(
        n_rows: usize,
        n_cols: usize,
        triplets: impl IntoIterator<Item = (usize, usize, f64)>,
    ) -> Self {
        let entries: Vec<(u32, u32, f64)> = triplets
            .into_iter()
            .map(|(i, j, v)| {
                assert!(i < n_rows && j < n_cols, "entry ({i}, {j}) out of range");
                (i as u32, j as u32, v)
            })
            .collect();
        Self::from_passes(n_rows, n_cols, || entries.iter().copied())
    }

    /// The same from entries that are iterated twice: to count those of each row, and to store them. Rows are then
    /// sorted one by one.
    pub(crate) fn from_passes<I: Iterator<Item = (u32, u32, f64)>>(
        n_rows: usize,
        n_cols: usize,
        entries: impl Fn() -> I,
    ) -> Self {
        assert!(
            n_rows.max(n_cols) <= u32::MAX as usize,
            "indices are 32 bits"
        );
        let (n_block_rows, n_block_cols) = (n_rows.div_ceil(B), n_cols.div_ceil(B));
        let b = B as u32;
        // The position of the next entry of each row: in the end, the end of the row.
        let mut ends = vec![0; n_block_rows + 1];
        entries().for_each(|(i, _, _)| ends[(i / b) as usize + 1] += 1);
        for i in 0..n_block_rows {
            ends[i + 1] += ends[i];
        }
        // Block column, place within the block, value.
        let mut filled = vec![(0, 0, 0.0); ends[n_block_rows]];
        entries().for_each(|(i, j, v)| {
            let next = &mut ends[(i / b) as usize];
            filled[*next] = (j / b, (i % b * b + j % b) as u8, v);
            *next += 1;
        });
        ends.truncate(n_block_rows);
        let mut row_ptr = vec![0; n_block_rows + 1];
        (split_rows(&mut filled, &ends).into_par_iter())
            .zip(row_ptr[1..].par_chunks_mut(ROWS_PER_TASK))
            .for_each(|(rows, counts)| {
                for (row, count) in rows.into_iter().zip(counts) {
                    // Entries of one place keep their order.
                    row.sort_by_key(|&(j, _, _)| j);
                    *count = row.chunk_by(|(j, _, _), (k, _, _)| j == k).count();
                }
            });
        for i in 0..n_block_rows {
            row_ptr[i + 1] += row_ptr[i];
        }
        let mut col_idx = vec![0; row_ptr[n_block_rows]];
        let mut values = vec![[[0.0; B]; B]; col_idx.len()];
        (split_rows(&mut filled, &ends).into_par_iter())
            .zip(split_rows(&mut col_idx, &row_ptr[1..]))
            .zip(split_rows(&mut values, &row_ptr[1..]))
            .for_each(|((rows, cols), blocks)| {
                for ((row, cols), blocks) in rows.into_iter().zip(cols).zip(blocks) {
                    let same = row.chunk_by(|(j, _, _), (k, _, _)| j == k);
                    for ((entries, col), block) in same.zip(cols).zip(blocks) {
                        *col = entries[0].0;
                        for &(_, place, v) in entries {
                            block[place as usize / B][place as usize % B] += v;
                        }
                    }
                }
            });
        Self::from_parts(n_block_rows, n_block_cols, row_ptr, col_idx, values)
    }

    /// Mᵀ.
    pub fn transposed(&self) -> Self {
        Self::from_triplets(
            self.n_cols(),
            self.n_rows(),
            self.triplets().map(|(i, j, v)| (j, i, v)),
        )
    }

    /// The number of connected parts of the graph of the nonzero blocks, and the part of each block row.
    pub(crate) fn components(&self) -> (usize, Vec<u32>) {
        // Each row points to an earlier one of its part, the first one to itself.
        let earlier: Vec<AtomicU32> = (0..self.n_block_rows as u32).map(AtomicU32::new).collect();
        let next = |i: u32| earlier[i as usize].load(Relaxed);
        let first = |mut i: u32| {
            while next(i) != i {
                earlier[i as usize].fetch_min(next(next(i)), Relaxed);
                i = next(i);
            }
            i
        };
        (0..self.n_block_rows)
            .into_par_iter()
            .with_min_len(ROWS_PER_TASK)
            .for_each(|i| {
                let (cols, blocks) = self.row(i);
                for (&j, block) in cols.iter().zip(blocks) {
                    let (mut a, mut b) = (first(i as u32), first(j));
                    while a != b && block.as_flattened().iter().any(|&v| v != 0.0) {
                        let (low, high) = (a.min(b), a.max(b));
                        let place = &earlier[high as usize];
                        // Another thread may have found one before it.
                        let _ = place.compare_exchange(high, low, Relaxed, Relaxed);
                        (a, b) = (first(low), first(high));
                    }
                }
            });
        let mut count = 0;
        let mut part = vec![0; self.n_block_rows];
        for i in 0..part.len() {
            part[i] = match first(i as u32) as usize {
                first if first < i => part[first],
                _ => {
                    count += 1;
                    count - 1
                }
            };
        }
        (count as usize, part)
    }

    /// The scalar diagonal of the matrix; zero where nothing is stored.
    pub fn diagonal(&self) -> Vec<f64> {
        let mut diagonal = vec![[0.0; B]; self.n_block_rows];
        (diagonal.par_iter_mut().enumerate())
            .with_min_len(ROWS_PER_TASK)
            .for_each(|(i, diagonal)| {
                if let Some(block) = self.block(i, i) {
                    *diagonal = std::array::from_fn(|a| block[a][a]);
                }
            });
        diagonal.into_flattened()
    }
}

impl Csr {
    /// The product with another matrix; None where it has more than `most` entries.
    pub(crate) fn times(&self, other: &Self, most: usize) -> Option<Self> {
        let mut triplets = Vec::new();
        // Of the present row: its entries, and whether there is one in a column.
        let mut sums = vec![0.0; other.n_cols()];
        let mut is_met = vec![false; other.n_cols()];
        for i in 0..self.n_rows() {
            let mut met = Vec::new();
            let (cols, values) = self.row(i);
            for (&k, [[value]]) in cols.iter().zip(values) {
                let (cols, others) = other.row(k as usize);
                for (&j, [[other]]) in cols.iter().zip(others) {
                    if !std::mem::replace(&mut is_met[j as usize], true) {
                        met.push(j as usize);
                    }
                    sums[j as usize] += value * other;
                }
            }
            if triplets.len() + met.len() > most {
                return None;
            }
            for j in met {
                is_met[j] = false;
                triplets.push((i, j, std::mem::take(&mut sums[j])));
            }
        }
        Some(Self::from_triplets(self.n_rows(), other.n_cols(), triplets))
    }
}

impl<const R: usize, const C: usize> BlockCsr<R, C> {
    /// A matrix from its parts.
    ///
    /// # Panics
    /// If the parts do not describe a matrix (lengths, order of the columns, indices in range). They come from our own
    /// assembly, and kernels on a GPU look nothing up twice. Data of users goes through [`BlockCsr::from_triplets`].
    pub fn from_parts(
        n_block_rows: usize,
        n_block_cols: usize,
        row_ptr: Vec<usize>,
        col_idx: Vec<u32>,
        values: Vec<[[f64; C]; R]>,
    ) -> Self {
        assert_eq!(row_ptr.len(), n_block_rows + 1);
        assert_eq!(row_ptr[0], 0);
        assert_eq!(row_ptr.last().copied(), Some(col_idx.len()));
        assert_eq!(values.len(), col_idx.len());
        let rows = row_ptr.par_windows(2).with_min_len(ROWS_PER_TASK);
        assert!(rows.all(|ends| {
            let row = &col_idx[ends[0]..ends[1]];
            row.is_sorted_by(|i, j| i < j)
                && row.last().is_none_or(|&j| (j as usize) < n_block_cols)
        }));
        Self {
            n_block_rows,
            n_block_cols,
            row_ptr,
            col_idx,
            values,
        }
    }

    /// Scalar rows.
    pub fn n_rows(&self) -> usize {
        self.n_block_rows * R
    }

    /// Scalar columns.
    pub fn n_cols(&self) -> usize {
        self.n_block_cols * C
    }

    /// The first block rows.
    pub(crate) fn truncated(mut self, n_block_rows: usize) -> Self {
        self.n_block_rows = n_block_rows;
        self.row_ptr.truncate(n_block_rows + 1);
        self.col_idx.truncate(self.row_ptr[n_block_rows]);
        self.values.truncate(self.row_ptr[n_block_rows]);
        self
    }

    /// Block rows.
    pub fn n_block_rows(&self) -> usize {
        self.n_block_rows
    }

    /// Block columns.
    pub fn n_block_cols(&self) -> usize {
        self.n_block_cols
    }

    /// Stored blocks.
    pub fn n_blocks(&self) -> usize {
        self.col_idx.len()
    }

    /// The column indices and blocks of block row `i`.
    pub fn row(&self, i: usize) -> (&[u32], &[[[f64; C]; R]]) {
        let range = self.row_ptr[i]..self.row_ptr[i + 1];
        (&self.col_idx[range.clone()], &self.values[range])
    }

    /// Block `(i, j)` where it is stored.
    pub fn block(&self, i: usize, j: usize) -> Option<&[[f64; C]; R]> {
        let (cols, blocks) = self.row(i);
        cols.binary_search(&(j as u32)).ok().map(|k| &blocks[k])
    }

    /// The start of each block row among the stored blocks, and the number of blocks at the end.
    pub fn row_ptr(&self) -> &[usize] {
        &self.row_ptr
    }

    /// The block columns of all stored blocks, row by row.
    pub fn col_idx(&self) -> &[u32] {
        &self.col_idx
    }

    /// Block `(i, j)` where it is stored, to change it.
    pub(crate) fn block_mut(&mut self, i: usize, j: usize) -> Option<&mut [[f64; C]; R]> {
        let start = self.row_ptr[i];
        let place = self.row(i).0.binary_search(&(j as u32)).ok()?;
        Some(&mut self.values[start + place])
    }

    /// All stored values.
    pub fn values(&self) -> &[[[f64; C]; R]] {
        &self.values
    }

    /// The stored scalar entries (row, column, value), row by row; explicit zeros inside blocks included.
    pub fn triplets(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        (0..self.n_block_rows).flat_map(move |i| {
            let (cols, blocks) = self.row(i);
            (0..R).flat_map(move |a| {
                cols.iter().zip(blocks).flat_map(move |(&j, block)| {
                    (0..C).map(move |b| (i * R + a, j as usize * C + b, block[a][b]))
                })
            })
        })
    }

    /// y = M x.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn mul(&self, x: &[f64], y: &mut [f64]) {
        self.for_rows(x, y, |y, _, sum| {
            y.copy_from_slice(&sum);
            0.0
        });
    }

    /// M x.
    pub(crate) fn product(&self, x: &[f64]) -> Vec<f64> {
        let mut y = vec![0.0; self.n_rows()];
        self.mul(x, &mut y);
        y
    }

    /// Passes each block row of y, with the same rows of x (if given) and of M x, to `finish`. Returns the sum of its
    /// results, made in tasks of a fixed size so that the number of threads does not change it.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub(crate) fn for_rows(
        &self,
        x: &[f64],
        y: &mut [f64],
        finish: impl Fn(&mut [f64], &[f64], [f64; R]) -> f64 + Sync,
    ) -> f64 {
        assert_eq!(x.len(), self.n_cols());
        assert_eq!(y.len(), self.n_rows());
        let partials: Vec<f64> = y
            .par_chunks_mut(ROWS_PER_TASK * R)
            .enumerate()
            .map(|(chunk, y)| {
                vectorised!({
                    let mut total = 0.0;
                    for (k, y) in y.chunks_mut(R).enumerate() {
                        let row = chunk * ROWS_PER_TASK + k;
                        let (cols, blocks) = self.row(row);
                        let mut sum = [0.0; R];
                        for (&j, block) in cols.iter().zip(blocks) {
                            let x = &x[j as usize * C..][..C];
                            for a in 0..R {
                                for b in 0..C {
                                    sum[a] += block[a][b] * x[b];
                                }
                            }
                        }
                        total += finish(y, x.get(row * R..row * R + R).unwrap_or(&[]), sum);
                    }
                    total
                })
            })
            .collect();
        partials.iter().sum()
    }

    /// The block rows that have entries.
    pub(crate) fn filled_rows(&self) -> Vec<u32> {
        (0..self.n_block_rows)
            .filter(|&i| self.row_ptr[i + 1] > self.row_ptr[i])
            .map(|i| i as u32)
            .collect()
    }

    /// y += α Mᵀ x.
    ///
    /// # Panics
    /// If the lengths do not fit.
    pub fn mul_transpose_add(&self, alpha: f64, x: &[f64], y: &mut [f64]) {
        assert_eq!(x.len(), self.n_rows());
        assert_eq!(y.len(), self.n_cols());
        for i in 0..self.n_block_rows {
            let (cols, blocks) = self.row(i);
            for (&j, block) in cols.iter().zip(blocks) {
                for a in 0..R {
                    for b in 0..C {
                        y[j as usize * C + b] += alpha * block[a][b] * x[i * R + a];
                    }
                }
            }
        }
    }
}

impl Csr {
    /// Mᵀ without its empty rows.
    pub(crate) fn filled_columns(&self) -> Self {
        let Self {
            n_block_cols,
            mut row_ptr,
            col_idx,
            values,
            ..
        } = self.transposed();
        row_ptr.dedup();
        Self::from_parts(row_ptr.len() - 1, n_block_cols, row_ptr, col_idx, values)
    }
}

/// Lists of n rows one after the other, and where each begins and the last one ends; `row` appends a row.
pub(crate) fn collect_rows<T: Copy + Default + Send + Sync>(
    n: usize,
    row: impl Fn(usize, &mut Vec<T>) + Sync,
) -> (Vec<usize>, Vec<T>) {
    let parts: Vec<(Vec<usize>, Vec<T>)> = (0..n.div_ceil(ROWS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            let (mut ends, mut all) = (Vec::with_capacity(ROWS_PER_TASK), Vec::new());
            for i in task * ROWS_PER_TASK..((task + 1) * ROWS_PER_TASK).min(n) {
                row(i, &mut all);
                ends.push(all.len());
            }
            (ends, all)
        })
        .collect();
    let mut starts = Vec::with_capacity(n + 1);
    starts.push(0);
    for (ends, _) in &parts {
        let before = starts[starts.len() - 1];
        starts.extend(ends.iter().map(|end| before + end));
    }
    let mut all = vec![T::default(); starts[n]];
    let ends = starts[1..].chunks(ROWS_PER_TASK);
    let ends: Vec<usize> = ends.map(|ends| ends[ends.len() - 1]).collect();
    let places: Vec<&mut [T]> = split_rows(&mut all, &ends).into_iter().flatten().collect();
    (places.into_par_iter().zip(parts)).for_each(|(place, (_, part))| place.copy_from_slice(&part));
    (starts, all)
}

/// The rows that end at `ends`, in groups of [`ROWS_PER_TASK`].
pub(crate) fn split_rows<'a, T>(mut all: &'a mut [T], ends: &[usize]) -> Vec<Vec<&'a mut [T]>> {
    let mut start = 0;
    let mut next = |&end: &usize| {
        let (row, rest) = std::mem::take(&mut all).split_at_mut(end - start);
        (all, start) = (rest, end);
        row
    };
    (ends.chunks(ROWS_PER_TASK))
        .map(|ends| ends.iter().map(&mut next).collect())
        .collect()
}

/// Euclidean norm, scaled against overflow and underflow so that the unit of `x` does not matter.
pub fn norm(x: &[f64]) -> f64 {
    let scale = norm_max(x);
    if scale == 0.0 || !scale.is_finite() {
        return scale;
    }
    scale * squares(x, scale).sqrt()
}

/// Σ (xᵢ / `scale`)², the same on any number of threads.
pub(crate) fn squares(x: &[f64], scale: f64) -> f64 {
    let of_piece = |x: &[f64]| x.iter().map(|v| (v / scale).powi(2)).sum::<f64>();
    pieces(x, of_piece).into_iter().sum()
}

/// The values of a function of each piece of a vector, a piece for every [`PIECE`] entries.
fn pieces(x: &[f64], of_piece: impl Fn(&[f64]) -> f64 + Sync + Send) -> Vec<f64> {
    match x.len() {
        ..=PIECE => vec![of_piece(x)],
        _ => x.par_chunks(PIECE).map(of_piece).collect(),
    }
}

/// Largest absolute value; NaN if there is one.
pub fn norm_max(x: &[f64]) -> f64 {
    let larger = |acc: f64, v: &f64| {
        if v.is_nan() || acc.is_nan() {
            f64::NAN
        } else {
            acc.max(v.abs())
        }
    };
    let of_pieces = pieces(x, |x| x.iter().fold(0.0, larger));
    of_pieces.iter().fold(0.0, larger)
}

/// Σ xᵢ yᵢ.
pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    debug_assert_eq!(x.len(), y.len());
    x.iter().zip(y).map(|(a, b)| a * b).sum()
}

/// y += c x.
pub(crate) fn add_times(c: f64, x: &[f64], y: &mut [f64]) {
    debug_assert_eq!(x.len(), y.len());
    y.iter_mut().zip(x).for_each(|(y, x)| *y += c * x);
}

/// x − y.
pub(crate) fn difference(x: &[f64], y: &[f64]) -> Vec<f64> {
    debug_assert_eq!(x.len(), y.len());
    x.iter().zip(y).map(|(x, y)| x - y).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triplets_add_up_and_pad_to_whole_blocks() {
        let m = BlockCsr::<2>::from_triplets(3, 3, [(0, 0, 1.0), (0, 0, 2.0), (2, 1, 5.0)]);
        assert_eq!((m.n_rows(), m.n_cols(), m.n_blocks()), (4, 4, 2));
        let mut y = vec![f64::NAN; 4];
        m.mul(&[1.0, 10.0, 100.0, 0.0], &mut y);
        assert_eq!(y, [3.0, 0.0, 50.0, 0.0]);
        let mut z = vec![0.0; 4];
        m.mul_transpose_add(2.0, &[1.0, 0.0, 1.0, 0.0], &mut z);
        assert_eq!(z, [6.0, 10.0, 0.0, 0.0]);
        assert_eq!(m.diagonal(), [3.0, 0.0, 0.0, 0.0]);
    }

    /// Rows that differ by a multiple of 7 are one part, whatever thread meets them first; a block of zeros ties nothing.
    #[test]
    fn parts_are_numbered_by_their_first_rows() {
        let n = 5 * ROWS_PER_TASK + 3;
        // Far and near neighbours, in an order without pattern.
        let tied =
            (7..n).flat_map(|i| [(i, i % 7 + (i / 7 * 5) % (i / 7) * 7, 1.0), (i, i - 7, 1.0)]);
        let untied = (1..n).map(|i| (i, i - 1, 0.0));
        let both = tied
            .chain(untied)
            .flat_map(|(i, j, v)| [(i, j, v), (j, i, v)]);
        let (count, part) = Csr::from_triplets(n, n, both).components();
        assert_eq!(count, 7);
        assert!((0..n).all(|i| part[i] as usize == i % 7));
        assert_eq!(
            Csr::from_triplets(3, 3, []).components(),
            (3, vec![0, 1, 2])
        );
    }

    /// Every entry is the sum of its contributions in their order, to the last bit.
    #[test]
    fn triplets_add_up_in_their_order() {
        let (n, mut state) = (3 * ROWS_PER_TASK + 5, 1_u64);
        let mut random = |below: usize| {
            state = state
                .wrapping_mul(6364136223846793005)
                .wrapping_add(1442695040888963407);
            (state >> 33) as usize % below
        };
        let entries: Vec<_> = (0..40 * n)
            .map(|_| {
                let i = random(n);
                let j = (i + random(7) * 11) % n;
                (i, j, [1e16, 1.0, -1e16, 0.3][random(4)])
            })
            .collect();
        let mut expected = std::collections::HashMap::new();
        for &(i, j, v) in &entries {
            *expected.entry((i, j)).or_insert(0.0) += v;
        }
        fn check<const B: usize>(
            n: usize,
            entries: &[(usize, usize, f64)],
            expected: &std::collections::HashMap<(usize, usize), f64>,
        ) {
            let m = BlockCsr::<B>::from_triplets(n, n, entries.iter().copied());
            let mut found = 0;
            for i in 0..m.n_block_rows() {
                assert!(m.row(i).0.is_sorted_by(|j, k| j < k));
            }
            for (i, j, v) in m.triplets() {
                match expected.get(&(i, j)) {
                    Some(sum) => {
                        found += 1;
                        assert_eq!(v.to_bits(), sum.to_bits(), "({i}, {j})");
                    }
                    None => assert_eq!(v, 0.0),
                }
            }
            assert_eq!(found, expected.len());
        }
        check::<1>(n, &entries, &expected);
        check::<2>(n, &entries, &expected);
        check::<3>(n, &entries, &expected);
    }

    #[test]
    fn norms_do_not_overflow() {
        assert_eq!(norm(&[3e300, 4e300]), 5e300);
        assert_eq!(norm(&[3e-300, 4e-300]), 5e-300);
        assert!(norm(&[f64::NAN, 1.0]).is_nan());
        assert_eq!(norm(&[]), 0.0);
    }
}
