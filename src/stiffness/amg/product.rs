//! Products and transposes of block matrices for the set-up.

use super::prolongation::Modes;
use crate::ranks::Halo;
use crate::sparse::{BlockCsr, ROWS_PER_TASK, split_rows, vectorised};
use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Parts of the rows in a transposition: each counts its blocks in all columns.
const PARTS: usize = 16;
/// Rows of A P that a run of coarse rows needs: enough that few rows of A P belong to two runs.
const ROWS_PER_RUN: usize = 4096;

/// c += a b for blocks.
#[inline(always)]
pub(super) fn add_product<const R: usize, const K: usize, const C: usize>(
    a: &[[f64; K]; R],
    b: &[[f64; C]; K],
    c: &mut [[f64; C]; R],
) {
    // A row of the sum stays in registers.
    for (c, a) in c.iter_mut().zip(a) {
        let mut sum = *c;
        for (a, b) in a.iter().zip(b) {
            for (sum, b) in sum.iter_mut().zip(b) {
                *sum += a * b;
            }
        }
        *c = sum;
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

    #[inline(always)]
    fn row(&self, i: usize) -> (&[u32], &[[[f64; C]; R]]) {
        let range = self.ends[i]..self.ends[i + 1];
        (&self.cols[range.clone()], &self.values[range])
    }

    /// Appends the row Σ block · (row of blocks) over the terms (Gustavson 1978): its columns are gathered and sorted
    /// first, then the blocks are added in place. `place` has an entry for every block column; its contents do not
    /// matter.
    #[inline(always)]
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
/// [Runs](runs) of coarse rows are finished one after the other, with the rows of A P that they need in a buffer that
/// stays small. A P as a whole would be larger than A. A coarse row is summed in the order of the rows of A P, whatever
/// run it belongs to. The rows of A, and with them the sums, are those of this rank; [`collected`] adds those of
/// others.
pub(super) fn galerkin<const B: usize, const M: usize>(
    r: &BlockCsr<M, B>,
    a: &BlockCsr<B>,
    p: &BlockCsr<B, M>,
) -> BlockCsr<M> {
    const MISSING: u32 = u32::MAX;
    let n = r.n_block_rows();
    let runs = runs(r, p);
    // Positions of columns, and of the rows of A P in the buffer.
    let scratch = || (vec![0; n], vec![MISSING; a.n_block_rows()], Rows::new());
    let parts: Vec<Rows<M, M>> = (runs.par_iter())
        .map_init(scratch, |(place, buffered, ap), run| {
            let needed = || run.iter().flat_map(|&i| r.row(i as usize).0);
            let coarse = vectorised!({
                ap.clear();
                for &i in needed() {
                    if buffered[i as usize] == MISSING {
                        buffered[i as usize] = ap.ends.len() as u32 - 1;
                        let (cols, blocks) = a.row(i as usize);
                        let terms = blocks.iter().zip(cols.iter().map(|&j| p.row(j as usize)));
                        ap.push(place, terms);
                    }
                }
                let mut coarse = Rows::new();
                for &i in run {
                    let (cols, blocks) = r.row(i as usize);
                    let rows = cols.iter().map(|&i| ap.row(buffered[i as usize] as usize));
                    coarse.push(place, blocks.iter().zip(rows));
                }
                coarse
            });
            needed().for_each(|&i| buffered[i as usize] = MISSING);
            coarse
        })
        .collect();
    let mut row_ptr = vec![0; n + 1];
    for (run, part) in runs.iter().zip(&parts) {
        for (k, &i) in run.iter().enumerate() {
            row_ptr[i as usize + 1] = part.row(k).0.len();
        }
    }
    for i in 0..n {
        row_ptr[i + 1] += row_ptr[i];
    }
    // The run and the place in it of each row.
    let mut places = vec![(0, 0); n];
    for (number, run) in runs.iter().enumerate() {
        for (k, &i) in run.iter().enumerate() {
            places[i as usize] = (number, k);
        }
    }
    let mut cols = vec![0; row_ptr[n]];
    let mut values = vec![[[0.0; M]; M]; row_ptr[n]];
    (split_rows(&mut cols, &row_ptr[1..]).into_par_iter())
        .zip(split_rows(&mut values, &row_ptr[1..]))
        .zip(places.par_chunks(ROWS_PER_TASK))
        .for_each(|((cols, values), places)| {
            for ((cols, values), &(number, k)) in cols.into_iter().zip(values).zip(places) {
                let (part_cols, part_values) = parts[number].row(k);
                cols.copy_from_slice(part_cols);
                values.copy_from_slice(part_values);
            }
        });
    BlockCsr::from_parts(n, n, row_ptr, cols, values)
}

/// Groups of neighbouring coarse rows that share most of the rows of A P that they need, each with [`ROWS_PER_RUN`] of
/// those or hardly more. A run grows from a coarse row by its neighbours, breadth first.
fn runs<const B: usize, const M: usize>(r: &BlockCsr<M, B>, p: &BlockCsr<B, M>) -> Vec<Vec<u32>> {
    let n = r.n_block_rows();
    let mut runs: Vec<Vec<u32>> = Vec::new();
    let mut taken = vec![false; n];
    // The run that has seen a row of P.
    let mut seen_in = vec![0u32; p.n_block_rows()];
    for seed in 0..n {
        if taken[seed] {
            continue;
        }
        let number = runs.len() as u32 + 1;
        let (mut run, mut rows, mut next) = (vec![seed as u32], 0, 0);
        taken[seed] = true;
        while rows < ROWS_PER_RUN && next < run.len() {
            for &i in r.row(run[next] as usize).0 {
                if std::mem::replace(&mut seen_in[i as usize], number) == number {
                    continue;
                }
                rows += 1;
                for &j in p.row(i as usize).0 {
                    if !std::mem::replace(&mut taken[j as usize], true) {
                        run.push(j);
                    }
                }
            }
            next += 1;
        }
        // Those at its rim belong to other runs.
        for j in run.drain(next..) {
            taken[j as usize] = false;
        }
        runs.push(run);
    }
    runs
}

/// A matrix with copies of the rows of others that own rows reach, and the halo of its columns; `columns` is the one before.
pub(super) fn with_copies<const R: usize, const C: usize>(
    matrix: &BlockCsr<R, C>,
    rows: &Halo,
    columns: &Halo,
) -> (BlockCsr<R, C>, Halo) {
    let mut starts = matrix.row_ptr().to_vec();
    rows.extend_starts(&mut starts);
    let n_blocks = starts[starts.len() - 1];
    let mut numbers: Vec<u64> = (matrix.col_idx().iter())
        .map(|&j| columns.number(j as usize))
        .collect();
    numbers.resize(n_blocks, 0);
    rows.update_rows(|i| starts[i]..starts[i + 1], &mut numbers);
    let mut values = matrix.values().to_vec();
    values.resize(n_blocks, [[0.0; C]; R]);
    let range = |i| starts[i] * R * C..starts[i + 1] * R * C;
    rows.update_rows(range, values.as_flattened_mut().as_flattened_mut());
    let mut reached = columns.of_own(columns.own());
    reached.reach(numbers.iter().copied());
    let mut entries: Vec<(u32, [[f64; C]; R])> = (numbers.iter().zip(values))
        .map(|(&number, block)| (reached.place(number), block))
        .collect();
    for ends in starts.windows(2) {
        entries[ends[0]..ends[1]].sort_unstable_by_key(|&(j, _)| j);
    }
    let (cols, values) = entries.into_iter().unzip();
    let (n_rows, n_cols) = (starts.len() - 1, reached.own() + reached.copies());
    (
        BlockCsr::from_parts(n_rows, n_cols, starts, cols, values),
        reached,
    )
}

/// The rows of a matrix, which has parts of them on other ranks too, summed rank by rank on the ranks that they belong to; and
/// the halo of their columns. `halo` is that of the rows and columns before.
pub(super) fn collected<const M: usize>(matrix: BlockCsr<M>, halo: &Halo) -> (BlockCsr<M>, Halo) {
    if halo.all() == halo.own() as u64 {
        return (matrix, halo.clone());
    }
    let starts = matrix.row_ptr();
    let numbers: Vec<u64> = (matrix.col_idx().iter())
        .map(|&j| halo.number(j as usize))
        .collect();
    let lengths = halo.lengths(|row| starts[row + 1] - starts[row]);
    // Row, column and place of the blocks that come, rank by rank.
    let mut more: Vec<(u32, u64, usize)> = Vec::new();
    halo.collect(
        |row| starts[row]..starts[row + 1],
        &numbers,
        &lengths,
        |row, columns| {
            for &column in columns {
                more.push((row as u32, column, more.len()));
            }
        },
    );
    let mut blocks: Vec<f64> = Vec::with_capacity(M * M * more.len());
    let lengths: Vec<Vec<usize>> = (lengths.into_iter())
        .map(|lengths| lengths.into_iter().map(|length| M * M * length).collect())
        .collect();
    halo.collect(
        |row| M * M * starts[row]..M * M * starts[row + 1],
        matrix.values().as_flattened().as_flattened(),
        &lengths,
        |_, values| blocks.extend_from_slice(values),
    );
    let blocks = blocks.as_chunks::<M>().0.as_chunks::<M>().0;
    // Parts of a row stay in the order of the ranks.
    more.sort_by_key(|&(row, ..)| row);
    let mut reached = halo.of_own(halo.own());
    let own = &numbers[..starts[halo.own()]];
    reached.reach(
        own.iter()
            .copied()
            .chain(more.iter().map(|&(_, column, _)| column)),
    );
    let (mut row_ptr, mut cols, mut values) = (vec![0], Vec::new(), Vec::new());
    let mut more = &more[..];
    let mut row: Vec<(u32, Modes<M, M>)> = Vec::new();
    for i in 0..halo.own() {
        row.clear();
        row.extend(
            (starts[i]..starts[i + 1]).map(|k| (reached.place(numbers[k]), matrix.values()[k])),
        );
        row.sort_unstable_by_key(|&(j, _)| j);
        let here = more.partition_point(|&(row, ..)| row as usize <= i);
        for &(_, column, k) in &more[..here] {
            let column = reached.place(column);
            match row.binary_search_by_key(&column, |&(j, _)| j) {
                Ok(found) => {
                    let sum = row[found].1.as_flattened_mut();
                    sum.iter_mut()
                        .zip(blocks[k].as_flattened())
                        .for_each(|(sum, v)| *sum += v);
                }
                Err(place) => row.insert(place, (column, blocks[k])),
            }
        }
        more = &more[here..];
        cols.extend(row.iter().map(|&(j, _)| j));
        values.extend(row.iter().map(|&(_, block)| block));
        row_ptr.push(cols.len());
    }
    let columns = reached.own() + reached.copies();
    let sums = BlockCsr::from_parts(halo.own(), columns, row_ptr, cols, values);
    (sums, reached)
}

/// The transpose of the first rows of A.
pub(super) fn transpose<const R: usize, const C: usize>(
    a: &BlockCsr<R, C>,
    rows: usize,
) -> BlockCsr<C, R> {
    let (start, n) = (a.row_ptr(), a.n_block_cols());
    let parts: Vec<Range<usize>> = (0..rows)
        .step_by(rows.div_ceil(PARTS).max(1))
        .map(|first| first..(first + rows.div_ceil(PARTS)).min(rows))
        .collect();
    // For each part of the rows the place of its next block in each column: first how many it has there.
    let mut next: Vec<Vec<usize>> = (parts.par_iter())
        .map(|part| {
            let mut counts = vec![0; n];
            let cols = &a.col_idx()[start[part.start]..start[part.end]];
            cols.iter().for_each(|&j| counts[j as usize] += 1);
            counts
        })
        .collect();
    let mut row_ptr = vec![0; n + 1];
    let mut end = 0;
    for j in 0..n {
        for next in &mut next {
            (end, next[j]) = (end + next[j], end);
        }
        row_ptr[j + 1] = end;
    }
    // The row and the number of each block of A. Each place is written once.
    let places: Vec<[AtomicU32; 2]> = (0..start[rows]).map(|_| Default::default()).collect();
    (parts.into_par_iter().zip(&mut next)).for_each(|(part, next)| {
        for i in part {
            for k in start[i]..start[i + 1] {
                let next = &mut next[a.col_idx()[k] as usize];
                let values = [i, k].map(|value| value as u32);
                (places[*next].iter().zip(values)).for_each(|(at, value)| at.store(value, Relaxed));
                *next += 1;
            }
        }
    });
    let blocks = places.into_par_iter().with_min_len(ROWS_PER_TASK);
    let (cols, values) = blocks
        .map(|place| {
            let [row, block] = place.map(AtomicU32::into_inner);
            let block = &a.values()[block as usize];
            let transposed = std::array::from_fn(|b| std::array::from_fn(|a| block[a][b]));
            (row, transposed)
        })
        .unzip();
    BlockCsr::from_parts(n, rows, row_ptr, cols, values)
}
