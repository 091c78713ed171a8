//! Sparse Cholesky factorisation K = L Lᵀ (faer), ordered so that its last block is the dual operator.
//!
//! The unknowns that B touches are ordered last, body by body. Then
//!
//! ```text
//! L = | L₁₁      |      B = | 0  B₂ |      B K⁻¹ Bᵀ = B₂ (L₂₂ L₂₂ᵀ)⁻¹ B₂ᵀ
//!     | L₂₁  L₂₂ |
//! ```
//!
//! with dense trailing blocks L₂₂, one per body.
//!
//! Some unknowns may be fixed at zero: the inverse of the rest is a generalised inverse K⁺ of a K whose kernel they
//! hold.

#[cfg(test)]
mod tests;

use super::ordering::{Ordering, contact_last};
use super::panel;
use crate::sparse::BlockCsr;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Par, Side};
use rayon::prelude::*;
use web_time::Instant;

/// The reason why K could not be factorised.
#[derive(Clone, Debug, thiserror::Error)]
pub enum FactorError {
    /// A pivot is not positive.
    #[error(
        "the stiffness matrix is singular, or not positive definite (unknown {unknown}{place}): a part of a body has \
         no stiffness or hangs on a hinge: check that its parts are connected by more than a point. Bodies that can \
         move as a whole need supports, or coordinates that define their rigid-body motions"
    )]
    NotPositiveDefinite {
        /// Its unknown, from 1.
        unknown: usize,
        /// " at (x, y)", if that is known.
        place: String,
    },
    /// The error of a solve with the factor is too large.
    #[error(
        "the Cholesky factor failed its check: x of K x = f is off by {error:.1e} of its size (at most {limit:.0e} is \
         accepted), residual {backward:.1e} of |K| |x| + |f|; the stiffness matrix is too badly conditioned: look for \
         slivers, extreme ratios of the moduli, or a nearly unsupported body; mesh very slender bodies with fewer elements"
    )]
    BadFactor {
        /// The relative error of the solution.
        error: f64,
        /// The accepted limit.
        limit: f64,
        /// The backward error.
        backward: f64,
    },
    /// The memory is too small for it.
    #[error("not enough memory for the Cholesky factor ({mib} MiB)")]
    OutOfMemory {
        /// The memory needed.
        mib: usize,
    },
    /// It has too many entries.
    #[error("the Cholesky factor has too many entries for 32-bit indices")]
    TooLarge,
    /// K has another size than the one that the factor was made for.
    #[error(
        "the stiffness matrix has {found} rows, but the factor was made for {expected}: make a new factor"
    )]
    OtherSize {
        /// Its rows.
        found: usize,
        /// The size of the factor.
        expected: usize,
    },
    /// K has another pattern than the one that the factor was made for.
    #[error(
        "the stiffness matrix couples unknowns {row} and {column} outside the pattern of the factor: make a new \
         factor"
    )]
    OtherPattern {
        /// The row of the entry, from 1.
        row: usize,
        /// Its column.
        column: usize,
    },
}

impl FactorError {
    /// Whether the matrix is known to be singular or indefinite.
    pub(crate) fn is_indefinite(&self) -> bool {
        matches!(
            self,
            Self::NotPositiveDefinite { .. } | Self::BadFactor { .. }
        )
    }
}

/// From this number of operations on all threads share the dense blocks of the factorisation: some seconds of one
/// thread. The order of sums does not depend on the number of threads.
const WORTH_THREADS: f64 = 1e11;
/// A pivot below this part of its diagonal entry means a singular K.
const PIVOT_LIMIT: f64 = 1e-14;
/// An entry below this part of √(Kᵢᵢ Kⱼⱼ), the possible size of its terms, is zero up to rounding. Terms that cancel
/// for one value of Young's modulus leave some tenths of 1e-16 for another.
const ROUNDING: f64 = 1e-14;

/// The trailing block L₂₂ of one body: a dense lower triangle over the trailing positions
/// `first..first + size`.
struct TrailingBlock {
    first: usize,
    size: usize,
    values: Vec<f64>,
}

/// The order of elimination and the pattern of a factor: the parts that stay when K gets other values.
struct Elimination {
    /// `order[position] = unknown`.
    order: Vec<u32>,
    /// `position[unknown]` in that order.
    position: Vec<u32>,
    /// Unknowns before the trailing blocks.
    n_leading: usize,
    /// The sizes of the trailing blocks.
    sizes: Vec<usize>,
    symbolic: SymbolicCholesky<u32>,
    /// Entries of the lower triangle that it was made for.
    entries: usize,
    /// Unknowns that are fixed at zero.
    fixed: Vec<u32>,
}

impl Elimination {
    /// The number of threads that the numeric factorisation is worth.
    fn threads(&self) -> Par {
        if self.operations() >= WORTH_THREADS {
            // In a browser faer has none.
            #[cfg(not(target_family = "wasm"))]
            return Par::rayon(rayon::current_num_threads());
        }
        Par::Seq
    }

    /// Multiplications and additions of the factorisation.
    fn operations(&self) -> f64 {
        Panels::new(&self.symbolic, &[])
            .map(|panel| {
                (0..panel.cols)
                    .map(|j| ((panel.rows - j) as f64).powi(2))
                    .sum::<f64>()
            })
            .sum()
    }

    /// The entries outside the pattern, and their columns.
    fn missed(&self, lower: &Lower) -> Vec<(usize, usize)> {
        let panels = Panels::new(&self.symbolic, &[]);
        let mut panel_of = vec![0; self.order.len()];
        for s in 0..panels.end {
            let panel = panels.get(s);
            panel_of[panel.first..][..panel.cols].fill(s);
        }
        let has_no_place = |column: usize, row: u32| {
            let [p, q] = [column, row as usize].map(|unknown| self.position[unknown]);
            let panel = panels.get(panel_of[p.min(q) as usize]);
            let own = (p.max(q) as usize) < panel.first + panel.cols;
            !own && panel.below.binary_search(&p.max(q)).is_err()
        };
        (0..self.order.len())
            .into_par_iter()
            .with_min_len(1 << 12)
            .flat_map_iter(|column| {
                let missed = lower.range(column);
                let missed = missed.filter(|&k| has_no_place(column, lower.row_idx[k]));
                missed.map(|k| (k, column)).collect::<Vec<_>>()
            })
            .collect()
    }

    /// Leaves out entries that are zero up to rounding, if the pattern has no room for all. faer accepts no more
    /// entries than the order was made for, nor any outside of the factor.
    fn fit<const D: usize>(&self, k: &BlockCsr<D>, lower: &mut Lower) -> Result<(), FactorError> {
        let too_many = lower.row_idx.len() > self.entries;
        let missed = self.missed(lower);
        if missed.is_empty() && !too_many {
            return Ok(());
        }
        let diagonal = k.diagonal();
        let is_rounding = |&(entry, column): &(usize, usize)| {
            let row = lower.row_idx[entry] as usize;
            let size = (diagonal[row] * diagonal[column]).sqrt();
            row != column && lower.values[entry].abs() <= ROUNDING * size
        };
        let all = (0..self.order.len())
            .flat_map(|column| lower.range(column).map(move |entry| (entry, column)));
        let rounding: Vec<(usize, usize)> = all.filter(is_rounding).collect();
        let many = lower.row_idx.len() - rounding.len() > self.entries;
        let last = (lower.row_idx.len() - 1, self.order.len() - 1);
        let outside = missed.iter().find(|entry| !is_rounding(entry));
        if let Some(&(entry, column)) = outside.or(many.then_some(&last)) {
            let [row, column] = [lower.row_idx[entry] as usize + 1, column + 1];
            return Err(FactorError::OtherPattern { row, column });
        }
        lower.remove(&rounding);
        Ok(())
    }

    /// Makes the factor of K, whose lower triangle is given, in `values`.
    fn factorise<const D: usize>(
        &self,
        k: &BlockCsr<D>,
        lower: &Lower,
        values: &mut Vec<f64>,
        threads: Par,
    ) -> Result<(), FactorError> {
        let n = self.order.len();
        let (symbolic, len) = (&self.symbolic, self.symbolic.len_val());
        let out_of_memory = || FactorError::OutOfMemory {
            mib: (len * 8) >> 20,
        };
        (values.try_reserve_exact(len.saturating_sub(values.len())))
            .map_err(|_| out_of_memory())?;
        values.resize(len, 0.0);
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(threads, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| out_of_memory())?;
        let not_definite = |position: usize| {
            let unknown = self.order[position] as usize;
            FactorError::NotPositiveDefinite {
                unknown: unknown + 1,
                place: String::new(),
            }
        };
        symbolic
            .factorize_numeric_llt(
                values,
                SparseColMatRef::new(lower.pattern(), &lower.values),
                Side::Lower,
                LltRegularization::default(),
                threads,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|LltError::NonPositivePivot { index }| not_definite(index.min(n - 1)))?;
        drop(memory);

        let diagonal = k.diagonal();
        for panel in Panels::new(symbolic, values) {
            for j in 0..panel.cols {
                let pivot = panel.values[j * panel.rows + j];
                let unknown = self.order[panel.first + j] as usize;
                // Written so that NaN is refused.
                if !(pivot * pivot > PIVOT_LIMIT * diagonal[unknown]) {
                    return Err(not_definite(panel.first + j));
                }
            }
        }
        Ok(())
    }
}

/// The order of elimination and the pattern of the factor, which give its cost in advance.
pub struct Plan {
    elimination: Elimination,
    lower: Lower,
    seconds: f64,
}

impl Plan {
    /// Orders the unknowns and finds the pattern of the factor.
    ///
    /// `coordinates` has a point per block row, if they are known; `touched` tells which block rows come last; the
    /// unknowns `fixed`, in ascending order, count as zero.
    pub fn new<const D: usize>(
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        touched: &[bool],
        fixed: Vec<u32>,
    ) -> Result<Self, FactorError> {
        let start = Instant::now();
        let n = k.n_rows();
        let Ordering {
            order,
            n_leading,
            sizes,
        } = contact_last(k, coordinates, touched);
        let position = inverse(&order);

        let lower = Lower::of(k, &fixed);
        let perm = faer::perm::PermRef::new_checked(&order, &position, n);
        let symbolic = factorize_symbolic_cholesky(
            lower.pattern(),
            Side::Lower,
            SymmetricOrdering::Custom(perm),
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
                ..Default::default()
            },
        )
        .map_err(|error| match error {
            faer::sparse::FaerError::OutOfMemory => FactorError::OutOfMemory { mib: 0 },
            _ => FactorError::TooLarge,
        })?;

        Ok(Self {
            elimination: Elimination {
                order,
                position,
                n_leading,
                sizes,
                symbolic,
                entries: lower.row_idx.len(),
                fixed,
            },
            lower,
            seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Bytes for the factor and its computation, in addition to K itself.
    pub fn bytes(&self) -> usize {
        let Elimination {
            symbolic, sizes, ..
        } = &self.elimination;
        let scratch = symbolic
            .factorize_numeric_llt_scratch::<f64>(self.elimination.threads(), Default::default())
            .unaligned_bytes_required();
        let lower = size_of_val(&self.lower.values[..]) + size_of_val(&self.lower.row_idx[..]);
        // The trailing blocks are copied when the scratch space is free again.
        let trailing: usize = sizes.iter().map(|size| 8 * size * size).sum();
        8 * symbolic.len_val() + scratch.max(trailing) + 2 * lower
    }

    /// Multiplications and additions of the factorisation.
    pub fn operations(&self) -> f64 {
        self.elimination.operations()
    }
}

/// K = L Lᵀ with the touched unknowns last.
pub struct Factor {
    elimination: Elimination,
    values: Vec<f64>,
    blocks: Vec<TrailingBlock>,
    /// Longest panel, for the workspace of the sweeps.
    max_rows: usize,
    /// Seconds for ordering, symbolic and numeric factorisation; after new values of K, those of the last
    /// factorisation.
    pub seconds: f64,
}

impl Factor {
    /// Factorises K as planned for it.
    pub fn new<const D: usize>(k: &BlockCsr<D>, plan: Plan) -> Result<Self, FactorError> {
        let threads = plan.elimination.threads();
        Self::on_threads(k, plan, threads)
    }

    /// Like [`Factor::new`], on this many threads.
    fn on_threads<const D: usize>(
        k: &BlockCsr<D>,
        plan: Plan,
        threads: Par,
    ) -> Result<Self, FactorError> {
        let start = Instant::now();
        let Plan {
            elimination,
            lower,
            seconds,
        } = plan;
        let mut values = Vec::new();
        elimination.factorise(k, &lower, &mut values, threads)?;
        let panels = Panels::new(&elimination.symbolic, &[]);
        Ok(Self {
            max_rows: panels.map(|panel| panel.rows).max().unwrap_or(0),
            blocks: trailing_blocks(&elimination, &values)?,
            elimination,
            values,
            seconds: seconds + start.elapsed().as_secs_f64(),
        })
    }

    /// Factorises a K with other values in the same order, with the same pattern of the factor. K may have as many
    /// entries as the one that it was made for, anywhere inside the pattern of the factor. Entries that are zero up to
    /// rounding do not count.
    ///
    /// # Errors
    /// If K has another size, or an entry elsewhere: the factor is then unchanged. If K is not positive definite, or couples
    /// separate bodies: there is then no factor until this succeeds.
    pub fn refactor<const D: usize>(&mut self, k: &BlockCsr<D>) -> Result<(), FactorError> {
        let start = Instant::now();
        if k.n_rows() != self.n() {
            return Err(FactorError::OtherSize {
                found: k.n_rows(),
                expected: self.n(),
            });
        }
        let mut lower = Lower::of(k, &self.elimination.fixed);
        self.elimination.fit(k, &mut lower)?;
        self.blocks.clear();
        let threads = self.elimination.threads();
        (self.elimination).factorise(k, &lower, &mut self.values, threads)?;
        self.blocks = trailing_blocks(&self.elimination, &self.values)?;
        self.seconds = start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Unknowns.
    pub fn n(&self) -> usize {
        self.elimination.order.len()
    }

    /// Unknowns before the trailing ones.
    pub fn n_leading(&self) -> usize {
        self.elimination.n_leading
    }

    /// The place of an unknown in the order of elimination; None if it is fixed.
    pub fn position(&self, unknown: usize) -> Option<usize> {
        (self
            .elimination
            .fixed
            .binary_search(&(unknown as u32))
            .is_err())
        .then(|| self.elimination.position[unknown] as usize)
    }

    /// The unknowns that are fixed at zero.
    pub fn fixed(&self) -> &[u32] {
        &self.elimination.fixed
    }

    /// Zeroes the fixed unknowns of a vector.
    pub fn release(&self, x: &mut [f64]) {
        for &i in &self.elimination.fixed {
            x[i as usize] = 0.0;
        }
    }

    /// The forward half of a solve: the input of [`Factor::finish`].
    pub fn reduce(&self, load: &[f64]) -> Vec<f64> {
        let mut x: Vec<f64> = self
            .elimination
            .order
            .iter()
            .map(|&i| load[i as usize])
            .collect();
        for &i in &self.elimination.fixed {
            x[self.elimination.position[i as usize] as usize] = 0.0;
        }
        if !self.touches_too_much() {
            self.forward(&mut x);
        }
        x
    }

    /// The rest of a solve.
    pub fn finish(&self, x: &mut [f64]) -> Vec<f64> {
        if self.touches_too_much() {
            self.forward(x);
        }
        self.trailing_solve(self.elimination.n_leading, x);
        self.backward(x);
        self.unpermute(x)
    }

    /// Entries of the factor.
    pub fn entries(&self) -> usize {
        self.values.len()
    }

    /// B touches so many unknowns that dense trailing blocks would not pay: every solve is a full one, and all unknowns
    /// count as trailing.
    fn touches_too_much(&self) -> bool {
        self.elimination.n_leading == 0 && self.blocks.is_empty()
    }

    /// The rows of K⁻¹x, or of the trailing solve, that B needs.
    pub fn solve_touched(&self, x: &mut [f64]) {
        if self.touches_too_much() {
            self.forward(x);
            self.backward(x);
        } else {
            self.trailing_solve(0, x);
        }
    }

    /// Solves with the trailing blocks; the trailing positions start at `offset` in x.
    fn trailing_solve(&self, offset: usize, x: &mut [f64]) {
        for block in &self.blocks {
            let x = &mut x[offset + block.first..][..block.size];
            panel::forward(&block.values, block.size, block.size, x);
            panel::backward(&block.values, block.size, block.size, x);
        }
    }

    /// The forward sweep over the leading unknowns (over all of them, if there are no trailing blocks).
    fn forward(&self, x: &mut [f64]) {
        let end = self.sweep_end();
        let mut local = vec![0.0; self.max_rows];
        for panel in Panels::new(&self.elimination.symbolic, &self.values) {
            if panel.first >= end {
                break;
            }
            let cols = panel.cols.min(end - panel.first);
            local[..panel.cols].copy_from_slice(&x[panel.first..][..panel.cols]);
            local[panel.cols..panel.rows].fill(0.0);
            panel::forward(panel.values, panel.rows, cols, &mut local);
            x[panel.first..][..panel.cols].copy_from_slice(&local[..panel.cols]);
            for (&row, value) in panel.below.iter().zip(&local[panel.cols..]) {
                x[row as usize] += value;
            }
        }
    }

    /// The backward sweep over the leading unknowns.
    fn backward(&self, x: &mut [f64]) {
        let end = self.sweep_end();
        let mut local = vec![0.0; self.max_rows];
        for panel in Panels::new(&self.elimination.symbolic, &self.values).rev() {
            if panel.first >= end {
                continue;
            }
            let cols = panel.cols.min(end - panel.first);
            local[..panel.cols].copy_from_slice(&x[panel.first..][..panel.cols]);
            for (&row, value) in panel.below.iter().zip(&mut local[panel.cols..]) {
                *value = x[row as usize];
            }
            panel::backward(panel.values, panel.rows, cols, &mut local);
            x[panel.first..][..cols].copy_from_slice(&local[..cols]);
        }
    }

    fn sweep_end(&self) -> usize {
        if self.blocks.is_empty() {
            self.elimination.order.len()
        } else {
            self.elimination.n_leading
        }
    }

    fn unpermute(&self, x: &[f64]) -> Vec<f64> {
        let mut u = vec![0.0; x.len()];
        for (&unknown, &value) in self.elimination.order.iter().zip(x) {
            u[unknown as usize] = value;
        }
        u
    }
}

/// One supernode of the factor.
struct Panel<'a> {
    first: usize,
    cols: usize,
    rows: usize,
    below: &'a [u32],
    values: &'a [f64],
}

/// The supernodes of the factor in order.
struct Panels<'a> {
    symbolic: &'a faer::sparse::linalg::cholesky::supernodal::SymbolicSupernodalCholesky<u32>,
    values: &'a [f64],
    next: usize,
    end: usize,
}

impl<'a> Panels<'a> {
    fn new(symbolic: &'a SymbolicCholesky<u32>, values: &'a [f64]) -> Self {
        let SymbolicCholeskyRaw::Supernodal(symbolic) = symbolic.raw() else {
            unreachable!("the factorisation was asked to be supernodal")
        };
        Self {
            symbolic,
            values,
            next: 0,
            end: symbolic.n_supernodes(),
        }
    }

    fn get(&self, s: usize) -> Panel<'a> {
        let first = self.symbolic.supernode_begin()[s] as usize;
        let cols = self.symbolic.supernode_end()[s] as usize - first;
        let below = &self.symbolic.row_idx()[self.symbolic.col_ptr_for_row_idx()[s] as usize..]
            [..self.symbolic.nnz_per_super()[s] as usize];
        let ptr = self.symbolic.col_ptr_for_val();
        Panel {
            first,
            cols,
            rows: cols + below.len(),
            below,
            // There are none before the factorisation.
            values: (self.values)
                .get(ptr[s] as usize..ptr[s + 1] as usize)
                .unwrap_or_default(),
        }
    }
}

impl<'a> Iterator for Panels<'a> {
    type Item = Panel<'a>;
    fn next(&mut self) -> Option<Panel<'a>> {
        (self.next < self.end).then(|| {
            self.next += 1;
            self.get(self.next - 1)
        })
    }
}

impl DoubleEndedIterator for Panels<'_> {
    fn next_back(&mut self) -> Option<Self::Item> {
        (self.next < self.end).then(|| {
            self.end -= 1;
            self.get(self.end)
        })
    }
}

fn inverse(order: &[u32]) -> Vec<u32> {
    let mut position = vec![0; order.len()];
    for (p, &unknown) in order.iter().enumerate() {
        position[unknown as usize] = p as u32;
    }
    position
}

/// The lower triangle of K by columns; without zeros off the diagonal and without the couplings of a fixed unknown.
struct Lower {
    col_ptr: Vec<u32>,
    row_idx: Vec<u32>,
    values: Vec<f64>,
}

impl Lower {
    fn of<const D: usize>(k: &BlockCsr<D>, fixed: &[u32]) -> Self {
        let n = k.n_rows();
        let tied = |unknown: usize| fixed.binary_search(&(unknown as u32)).is_err();
        let room = D * D * k.n_blocks() / 2 + n;
        let mut col_ptr = Vec::with_capacity(n + 1);
        let mut row_idx = Vec::with_capacity(room);
        let mut values = Vec::with_capacity(room);
        col_ptr.push(0);
        for i in 0..k.n_block_rows() {
            let (cols, blocks) = k.row(i);
            let below = cols.partition_point(|&j| (j as usize) < i);
            for a in 0..D {
                // K is symmetric: the row of blocks i holds the columns D i and those after it.
                for (&j, block) in cols[below..].iter().zip(&blocks[below..]) {
                    for (b, &value) in block[a].iter().enumerate() {
                        let (row, column) = (D * j as usize + b, D * i + a);
                        if row == column
                            || (row > column && value != 0.0 && tied(row) && tied(column))
                        {
                            row_idx.push(row as u32);
                            values.push(value);
                        }
                    }
                }
                col_ptr.push(row_idx.len() as u32);
            }
        }
        Self {
            col_ptr,
            row_idx,
            values,
        }
    }

    /// The entries of a column.
    fn range(&self, column: usize) -> std::ops::Range<usize> {
        self.col_ptr[column] as usize..self.col_ptr[column + 1] as usize
    }

    /// Without some entries, in ascending order, each with its column.
    fn remove(&mut self, entries: &[(usize, usize)]) {
        let mut next = entries.iter().map(|&(entry, _)| entry).peekable();
        let (mut kept, mut begin) = (0, 0);
        for column in 1..self.col_ptr.len() {
            let end = self.col_ptr[column] as usize;
            for entry in begin..end {
                if next.next_if_eq(&entry).is_none() {
                    self.row_idx[kept] = self.row_idx[entry];
                    self.values[kept] = self.values[entry];
                    kept += 1;
                }
            }
            (self.col_ptr[column], begin) = (kept as u32, end);
        }
        self.row_idx.truncate(kept);
        self.values.truncate(kept);
    }

    fn pattern(&self) -> SymbolicSparseColMatRef<'_, u32> {
        let n = self.col_ptr.len() - 1;
        SymbolicSparseColMatRef::new_unsorted_checked(n, n, &self.col_ptr, None, &self.row_idx)
    }
}

/// Copies the dense trailing blocks out of the factor.
///
/// # Errors
/// If K ties two bodies that it did not tie when their unknowns were ordered.
fn trailing_blocks(
    elimination: &Elimination,
    values: &[f64],
) -> Result<Vec<TrailingBlock>, FactorError> {
    let n_leading = elimination.n_leading;
    let mut first = 0;
    let mut blocks: Vec<TrailingBlock> = (elimination.sizes)
        .iter()
        .map(|&size| {
            first += size;
            TrailingBlock {
                first: first - size,
                size,
                values: vec![0.0; size * size],
            }
        })
        .collect();
    if blocks.is_empty() {
        return Ok(blocks);
    }
    let mut current = 0;
    for panel in Panels::new(&elimination.symbolic, values) {
        for j in 0..panel.cols {
            let Some(column) = (panel.first + j).checked_sub(n_leading) else {
                continue;
            };
            while column >= blocks[current].first + blocks[current].size {
                current += 1;
            }
            let block = &mut blocks[current];
            let (first, size) = (block.first, block.size);
            let target = &mut block.values[(column - first) * size..][..size];
            let source = &panel.values[j * panel.rows..][..panel.rows];
            for (i, &value) in source.iter().enumerate().skip(j) {
                let row = if i < panel.cols {
                    panel.first + i
                } else {
                    panel.below[i - panel.cols] as usize
                };
                // Supernodes may be padded with zeros across two bodies.
                match target.get_mut(row - n_leading - first) {
                    Some(place) => *place = value,
                    None if value == 0.0 => {}
                    None => {
                        let [row, column] = [row, panel.first + j]
                            .map(|position| elimination.order[position] as usize + 1);
                        return Err(FactorError::OtherPattern { row, column });
                    }
                }
            }
        }
    }
    Ok(blocks)
}
