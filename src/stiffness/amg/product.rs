//! Products and transposes of block matrices for the set-up.

use crate::sparse::BlockCsr;
use rayon::prelude::*;

/// Coarse rows of a run: enough that few rows of A P belong to two runs.
const ROWS_PER_RUN: usize = 4096;

/// c += a b for blocks.
#[inline(always)]
pub(super) fn add_product<const R: usize, const K: usize, const C: usize>(
    a: &[[f64; K]; R],
    b: &[[f64; C]; K],
    c: &mut [[f64; C]; R],
) {
    for i in 0..R {
        for k in 0..K {
            for j in 0..C {
                c[i][j] += a[i][k] * b[k][j];
            }
        }
    }
}

/// Block rows of a product that is being computed.
struct Rows<const R: usize, const C: usize> {
    /// Ends of the rows; `ends[0]` is 0.
    ends: Vec<usize>,
    cols: Vec<u32>,
    values: Vec<[[f64; C]; R]>,
}

impl<const R: usize, const C: usize> Rows<R, C> {
    fn new() -> Self {
        Self {
            ends: vec![0],
            cols: Vec::new(),
            values: Vec::new(),
        }
    }

    fn clear(&mut self) {
        self.ends.truncate(1);
        self.cols.clear();
        self.values.clear();
    }

    fn row(&self, i: usize) -> (&[u32], &[[[f64; C]; R]]) {
        let range = self.ends[i]..self.ends[i + 1];
        (&self.cols[range.clone()], &self.values[range])
    }

    /// Appends the row Σ block · (row of blocks) over the terms (Gustavson 1978): its columns are
    /// gathered and sorted first, then the blocks are added in place. `place` has an entry for every
    /// block column; what it holds does not matter.
    fn push<'a, const K: usize>(
        &mut self,
        place: &mut [u32],
        terms: impl Iterator<Item = (&'a [[f64; K]; R], (&'a [u32], &'a [[[f64; C]; K]]))> + Clone,
    ) {
        let start = self.cols.len();
        for (_, (cols, _)) in terms.clone() {
            for &j in cols {
                let seen = place[j as usize] as usize;
                if seen < start || self.cols.get(seen) != Some(&j) {
                    place[j as usize] = self.cols.len() as u32;
                    self.cols.push(j);
                }
            }
        }
        self.cols[start..].sort_unstable();
        for (k, &j) in self.cols[start..].iter().enumerate() {
            place[j as usize] = (start + k) as u32;
        }
        self.values.resize(self.cols.len(), [[0.0; C]; R]);
        for (block, (cols, others)) in terms {
            for (&j, other) in cols.iter().zip(others) {
                add_product(block, other, &mut self.values[place[j as usize] as usize]);
            }
        }
        self.ends.push(self.cols.len());
    }
}

/// R A P, with R = Pᵀ.
///
/// Runs of coarse rows are finished one after the other, with the rows of A P that they need in a buffer
/// that stays in the cache: A P as a whole would be larger than A.
pub(super) fn galerkin<const B: usize, const M: usize>(
    r: &BlockCsr<M, B>,
    a: &BlockCsr<B>,
    p: &BlockCsr<B, M>,
) -> BlockCsr<M> {
    const MISSING: u32 = u32::MAX;
    let n = r.n_block_rows();
    let rows_per_task = n
        .div_ceil(4 * rayon::current_num_threads())
        .max(ROWS_PER_RUN / 4);
    let parts: Vec<Rows<M, M>> = (0..n.div_ceil(rows_per_task))
        .into_par_iter()
        .map(|task| {
            let last = ((task + 1) * rows_per_task).min(n);
            let mut coarse = Rows::new();
            let mut place = vec![0; n];
            let mut ap = Rows::<B, M>::new();
            // Where the rows of A P stand in the buffer.
            let mut buffered = vec![MISSING; a.n_block_rows()];
            for first in (task * rows_per_task..last).step_by(ROWS_PER_RUN) {
                let run = first..(first + ROWS_PER_RUN).min(last);
                ap.clear();
                for &i in run.clone().flat_map(|coarse| r.row(coarse).0) {
                    if buffered[i as usize] == MISSING {
                        buffered[i as usize] = ap.ends.len() as u32 - 1;
                        let (cols, blocks) = a.row(i as usize);
                        let terms = blocks.iter().zip(cols.iter().map(|&j| p.row(j as usize)));
                        ap.push(&mut place, terms);
                    }
                }
                for i in run.clone() {
                    let (cols, blocks) = r.row(i);
                    let rows = cols.iter().map(|&i| ap.row(buffered[i as usize] as usize));
                    coarse.push(&mut place, blocks.iter().zip(rows));
                }
                for &i in run.flat_map(|coarse| r.row(coarse).0) {
                    buffered[i as usize] = MISSING;
                }
            }
            coarse
        })
        .collect();
    let n_blocks = parts.iter().map(|part| part.cols.len()).sum();
    let mut row_ptr = Vec::with_capacity(n + 1);
    row_ptr.push(0);
    let mut cols = Vec::with_capacity(n_blocks);
    let mut values = Vec::with_capacity(n_blocks);
    for part in parts {
        row_ptr.extend(part.ends[1..].iter().map(|end| cols.len() + end));
        cols.extend_from_slice(&part.cols);
        values.extend_from_slice(&part.values);
    }
    BlockCsr::from_parts(n, n, row_ptr, cols, values)
}

/// Aᵀ.
pub(super) fn transpose<const R: usize, const C: usize>(a: &BlockCsr<R, C>) -> BlockCsr<C, R> {
    let mut row_ptr = vec![0; a.n_block_cols() + 1];
    for &j in a.col_idx() {
        row_ptr[j as usize + 1] += 1;
    }
    for j in 0..a.n_block_cols() {
        row_ptr[j + 1] += row_ptr[j];
    }
    let mut next = row_ptr.clone();
    let mut cols = vec![0; a.n_blocks()];
    let mut values = vec![[[0.0; R]; C]; a.n_blocks()];
    for i in 0..a.n_block_rows() {
        let (row_cols, blocks) = a.row(i);
        for (&j, block) in row_cols.iter().zip(blocks) {
            let place = next[j as usize];
            next[j as usize] += 1;
            cols[place] = i as u32;
            values[place] = std::array::from_fn(|b| std::array::from_fn(|a| block[a][b]));
        }
    }
    BlockCsr::from_parts(a.n_block_cols(), a.n_block_rows(), row_ptr, cols, values)
}
