//! Sparse Cholesky factorisation K = L Lᵀ (faer), ordered so that its last block is the dual operator.
//!
//! The unknowns that B touches are ordered last, body by body. Then
//!
//! ```text
//! L = | L₁₁      |      B = | 0  B₂ |      A = B K⁻¹ Bᵀ = B₂ (L₂₂ L₂₂ᵀ)⁻¹ B₂ᵀ
//!     | L₂₁  L₂₂ |
//! ```
//!
//! so a product with A needs only the dense trailing blocks L₂₂ (one per body), the right-hand side
//! needs one forward sweep over L₁₁ for the whole contact problem, and the displacement one backward
//! sweep at the end.
//!
//! Where bodies can move as a whole, as many unknowns as they have motions are fixed: the inverse of the rest
//! is a generalised inverse K⁺ of K. Loads in balance cause no reaction there.

use super::ordering::{Ordering, contact_last};
use super::panel;
use crate::dual::{Accuracy, DualError, DualOperator, Followed, Stop};
use crate::problem::ContactProblem;
use crate::sparse::{BlockCsr, Csr, norm};
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymbolicCholeskyRaw, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Par, Side};
use std::sync::Arc;
use std::time::Instant;

/// Why K could not be factorised.
#[derive(Debug, thiserror::Error)]
pub enum FactorError {
    #[error(
        "the stiffness matrix is singular, or not positive definite (unknown {unknown}{place}): a part of a body \
         has no stiffness or hangs on a hinge: check that its parts are connected by more than a point. \
         Bodies that can move as a whole need coordinates, which tell their rigid motions, or supports"
    )]
    NotPositiveDefinite { unknown: usize, place: String },
    #[error(
        "the Cholesky factor failed its check: x of K x = f is off by {error:.1e} of its size (at most {limit:.0e} is \
         accepted), residual {backward:.1e} of |K| |x| + |f|; the stiffness matrix is too badly conditioned: look for \
         slivers, extreme ratios of the moduli, or a nearly unsupported body; mesh very slender bodies with fewer elements"
    )]
    BadFactor {
        error: f64,
        limit: f64,
        backward: f64,
    },
    #[error("not enough memory for the Cholesky factor ({mib} MiB)")]
    OutOfMemory { mib: usize },
    #[error("the Cholesky factor has too many entries for 32-bit indices")]
    TooLarge,
}

/// A relative residual of the probe solve that needs no second look.
const PROBE_LIMIT: f64 = 1e-6;
/// The backward error of the probe solve, and its relative error by one step of refinement, that are accepted at most.
/// Slender bodies have large residuals beside small loads: there K x is a small difference of large terms.
const BACKWARD_LIMIT: f64 = 1e-12;
const FORWARD_LIMIT: f64 = 1e-4;
/// Steps of iterative refinement at most.
const REFINEMENTS: usize = 3;
/// A pivot below this part of its diagonal entry means a singular K.
const PIVOT_LIMIT: f64 = 1e-14;

/// The trailing block L₂₂ of one body: a dense lower triangle over the trailing positions
/// `first..first + size`.
struct TrailingBlock {
    first: usize,
    size: usize,
    values: Vec<f64>,
}

/// K = L Lᵀ with the unknowns of B last, and B in that order.
pub struct CholeskyDual {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<f64>,
    /// `order[position] = unknown`.
    order: Vec<u32>,
    /// `position[unknown]` in that order.
    position: Vec<u32>,
    /// Unknowns before the trailing block.
    n_leading: usize,
    blocks: Vec<TrailingBlock>,
    /// B₂: 2m rows (N, then T) over the trailing positions.
    b: Csr,
    k: Arc<BlockCsr<2>>,
    /// B over all unknowns.
    contact: Csr,
    /// f.
    load: Vec<f64>,
    /// Unknowns that are fixed at zero.
    fixed: Vec<u32>,
    /// L₁₁⁻¹f₁ on the leading positions, f₂ − L₂₁L₁₁⁻¹f₁ on the trailing ones; in the order of L.
    reduced_load: Vec<f64>,
    /// c = (d, origin of slip).
    offsets: Vec<f64>,
    workspace: Vec<f64>,
    /// Longest panel, for the workspace of the sweeps.
    max_rows: usize,
    /// K is so badly conditioned that displacements are refined with residuals of twice the precision, and r is made
    /// from them.
    refined: bool,
    /// Seconds for ordering, symbolic and numeric factorisation.
    pub factor_seconds: f64,
    /// Seconds for one full solve with K (the probe).
    pub solve_seconds: f64,
}

/// The order of elimination and the pattern of the factor: what it will cost is known before it is made.
pub struct Plan {
    order: Vec<u32>,
    position: Vec<u32>,
    n_leading: usize,
    sizes: Vec<usize>,
    col_ptr: Vec<u32>,
    row_idx: Vec<u32>,
    values: Vec<f64>,
    symbolic: SymbolicCholesky<u32>,
    fixed: Vec<u32>,
    seconds: f64,
}

impl Plan {
    /// Orders the unknowns and finds the pattern of the factor.
    pub fn new(problem: &ContactProblem) -> Result<Self, FactorError> {
        let start = Instant::now();
        let k = problem.stiffness();
        let n = k.n_rows();
        let contact = problem.touched();
        let Ordering {
            order,
            n_leading,
            sizes,
        } = contact_last(k, problem.coordinates(), &contact);
        let position = inverse(&order);

        let touched = |unknown: usize| contact[unknown / 2];
        let fixed = problem.free_bodies().unknowns_to_fix(touched);
        let (col_ptr, row_idx, values) = lower_columns(k, &fixed);
        let pattern = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &col_ptr, None, &row_idx);
        let perm = faer::perm::PermRef::new_checked(&order, &position, n);
        let symbolic = factorize_symbolic_cholesky(
            pattern,
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
            order,
            position,
            n_leading,
            sizes,
            col_ptr,
            row_idx,
            values,
            symbolic,
            fixed,
            seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Bytes that the factor and its making will take, beside K itself.
    pub fn bytes(&self) -> usize {
        let scratch = (self.symbolic)
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default())
            .unaligned_bytes_required();
        let lower = size_of_val(&self.values[..]) + size_of_val(&self.row_idx[..]);
        8 * self.symbolic.len_val() + scratch + 2 * lower
    }

    /// Multiplications and additions of the factorisation.
    pub fn operations(&self) -> f64 {
        Panels::new(&self.symbolic, &[])
            .map(|panel| {
                (0..panel.cols)
                    .map(|j| ((panel.rows - j) as f64).powi(2))
                    .sum::<f64>()
            })
            .sum()
    }
}

impl CholeskyDual {
    /// Factorises K of the problem and checks the factor with a solve.
    pub fn new(problem: &ContactProblem) -> Result<Self, FactorError> {
        Self::with_plan(problem, Plan::new(problem)?)
    }

    /// As [`CholeskyDual::new`], with a plan made for the same problem before.
    pub fn with_plan(problem: &ContactProblem, plan: Plan) -> Result<Self, FactorError> {
        let start = Instant::now();
        let Plan {
            order,
            position,
            n_leading,
            sizes,
            col_ptr,
            row_idx,
            values,
            symbolic,
            fixed,
            seconds,
        } = plan;
        let k = problem.stiffness();
        let n = k.n_rows();
        let pattern = SymbolicSparseColMatRef::new_unsorted_checked(n, n, &col_ptr, None, &row_idx);
        let out_of_memory = || FactorError::OutOfMemory {
            mib: (symbolic.len_val() * 8) >> 20,
        };
        let mut factor: Vec<f64> = Vec::new();
        factor
            .try_reserve_exact(symbolic.len_val())
            .map_err(|_| out_of_memory())?;
        factor.resize(symbolic.len_val(), 0.0);
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).map_err(|_| out_of_memory())?;
        let not_definite = |position: usize| {
            let unknown = order[position] as usize;
            FactorError::NotPositiveDefinite {
                unknown: unknown + 1,
                place: problem.place_of(unknown),
            }
        };
        symbolic
            .factorize_numeric_llt(
                &mut factor,
                SparseColMatRef::new(pattern, &values),
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|LltError::NonPositivePivot { index }| not_definite(index.min(n - 1)))?;

        drop(memory);

        let diagonal = k.diagonal();
        let mut max_rows = 0;
        for panel in Panels::new(&symbolic, &factor) {
            max_rows = max_rows.max(panel.rows);
            for j in 0..panel.cols {
                let pivot = panel.values[j * panel.rows + j];
                let unknown = order[panel.first + j] as usize;
                // Written so that NaN is refused.
                if !(pivot * pivot > PIVOT_LIMIT * diagonal[unknown]) {
                    return Err(not_definite(panel.first + j));
                }
            }
        }
        let blocks = trailing_blocks(&symbolic, &factor, n_leading, &sizes);
        let factor_seconds = seconds + start.elapsed().as_secs_f64();

        let contact = problem.contact_matrix();
        let b = Csr::from_triplets(
            2 * problem.m(),
            n - n_leading,
            contact
                .triplets()
                .filter(|&(_, j, _)| fixed.binary_search(&(j as u32)).is_err())
                .map(|(i, j, v)| (i, position[j] as usize - n_leading, v)),
        );
        let mut dual = Self {
            symbolic,
            values: factor,
            order,
            position,
            n_leading,
            blocks,
            b,
            k: Arc::clone(k),
            contact,
            load: Vec::new(),
            fixed,
            reduced_load: Vec::new(),
            offsets: problem.offsets(),
            workspace: vec![0.0; n - n_leading],
            max_rows,
            refined: false,
            factor_seconds,
            solve_seconds: 0.0,
        };
        dual.probe(problem)?;
        Ok(dual)
    }

    /// Solves K x = f, checks the residual, and keeps the forward half for all that follows.
    fn probe(&mut self, problem: &ContactProblem) -> Result<(), FactorError> {
        let n = self.order.len();
        let f = problem.load();
        let zero_load = f.iter().all(|&v| v == 0.0);
        // Without a load anything will do that excites every unknown.
        let mut test: Vec<f64> = if zero_load {
            (0..n).map(|i| 1.0 + (i % 7) as f64).collect()
        } else {
            f.to_vec()
        };
        let start = Instant::now();
        self.reduced_load = self.reduce(&test);
        let mut x = self.reduced_load.clone();
        if zero_load {
            self.reduced_load.fill(0.0);
        }
        self.load = f.to_vec();
        let u = self.finish(&mut x);
        self.solve_seconds = start.elapsed().as_secs_f64();
        for &i in &self.fixed {
            test[i as usize] = 0.0;
        }
        // Without the reactions, where the load is not in balance.
        let residual = self.residual(&u, &test);
        if norm(&residual) <= PROBE_LIMIT * norm(&test) {
            return Ok(());
        }
        let backward = norm(&residual) / norm(&self.terms(&u, &test));
        let mut x = self.reduce(&residual);
        let error = norm(&self.finish(&mut x)) / norm(&u);
        // Written so that NaN is refused.
        if backward <= BACKWARD_LIMIT && error <= FORWARD_LIMIT {
            self.refined = true;
            return Ok(());
        }
        Err(FactorError::BadFactor {
            error,
            limit: FORWARD_LIMIT,
            backward,
        })
    }

    /// f − K u where nothing is fixed; in twice the precision for a K that needs it.
    fn residual(&self, u: &[f64], f: &[f64]) -> Vec<f64> {
        let mut rest: Vec<f64> = f.to_vec();
        if self.refined {
            // Sum and error of each row (Ogita, Rump and Oishi 2005).
            let mut errors = vec![0.0; f.len()];
            for (i, j, value) in self.k.triplets() {
                let product = -value * u[j];
                let sum = rest[i] + product;
                let part = sum - rest[i];
                errors[i] += (-value).mul_add(u[j], -product)
                    + ((rest[i] - (sum - part)) + (product - part));
                rest[i] = sum;
            }
            rest.iter_mut().zip(errors).for_each(|(r, e)| *r += e);
        } else {
            self.k.mul(u, &mut rest);
            rest.iter_mut().zip(f).for_each(|(r, f)| *r = f - *r);
        }
        for &i in &self.fixed {
            rest[i as usize] = 0.0;
        }
        rest
    }

    /// |K| |x| + |f|: what K x − f is a difference of.
    fn terms(&self, x: &[f64], f: &[f64]) -> Vec<f64> {
        let mut terms: Vec<f64> = f.iter().map(|f| f.abs()).collect();
        for (i, j, value) in self.k.triplets() {
            terms[i] += (value * x[j]).abs();
        }
        terms
    }

    /// The forward half of a solve: what [`CholeskyDual::finish`] takes.
    fn reduce(&self, load: &[f64]) -> Vec<f64> {
        let mut x: Vec<f64> = self.order.iter().map(|&i| load[i as usize]).collect();
        for &i in &self.fixed {
            x[self.position[i as usize] as usize] = 0.0;
        }
        if !self.touches_too_much() {
            self.forward(&mut x);
        }
        x
    }

    /// The rest of a solve.
    fn finish(&self, x: &mut [f64]) -> Vec<f64> {
        if self.touches_too_much() {
            self.forward(x);
        }
        self.trailing_solve(self.n_leading, x);
        self.backward(x);
        self.unpermute(x)
    }

    /// Entries of the factor.
    pub fn factor_entries(&self) -> usize {
        self.values.len()
    }

    /// B touches so many unknowns that dense trailing blocks would not pay: every solve is a full one,
    /// and all unknowns count as trailing.
    fn touches_too_much(&self) -> bool {
        self.n_leading == 0 && self.blocks.is_empty()
    }

    /// The rows of K⁻¹x, or of the trailing solve, that B needs.
    fn solve_touched(&self, x: &mut [f64]) {
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
        for panel in Panels::new(&self.symbolic, &self.values) {
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
        for panel in Panels::new(&self.symbolic, &self.values).rev() {
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
            self.order.len()
        } else {
            self.n_leading
        }
    }

    fn unpermute(&self, x: &[f64]) -> Vec<f64> {
        let mut u = vec![0.0; x.len()];
        for (&unknown, &value) in self.order.iter().zip(x) {
            u[unknown as usize] = value;
        }
        u
    }
}

impl DualOperator for CholeskyDual {
    fn set_data(&mut self, load: &[f64], offsets: &[f64]) -> Result<(), DualError> {
        if self.load != load {
            self.reduced_load = self.reduce(load);
            self.load.copy_from_slice(load);
        }
        self.offsets.copy_from_slice(offsets);
        Ok(())
    }

    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        _accuracy: Accuracy,
        _stop: &Stop,
    ) -> Result<(), DualError> {
        let mut x = std::mem::take(&mut self.workspace);
        x.fill(0.0);
        self.b.mul_transpose_add(1.0, p, &mut x);
        self.solve_touched(&mut x);
        self.b.mul(&x, y);
        self.workspace = x;
        Ok(())
    }

    fn right_hand_side(
        &mut self,
        b: &mut [f64],
        _accuracy: Accuracy,
        _stop: &Stop,
    ) -> Result<(), DualError> {
        let mut x = self.reduced_load[self.n_leading..].to_vec();
        self.solve_touched(&mut x);
        self.b.mul(&x, b);
        for (b, c) in b.iter_mut().zip(&self.offsets) {
            *b -= c;
        }
        Ok(())
    }

    fn displacement(
        &mut self,
        lambda: &[f64],
        residual: f64,
        _stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        let mut x = self.reduced_load.clone();
        self.b
            .mul_transpose_add(-1.0, lambda, &mut x[self.n_leading..]);
        let mut u = self.finish(&mut x);
        let mut forces = self.load.clone();
        self.contact.mul_transpose_add(-1.0, lambda, &mut forces);
        // Refined where rounding has left too much.
        let mut before = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let rest = self.residual(&u, &forces);
            let left = norm(&rest);
            if !self.refined && (left <= residual || !(left <= 0.5 * before)) {
                break;
            }
            let mut x = self.reduce(&rest);
            let correction = self.finish(&mut x);
            let moved = norm(&correction);
            // The residual says little where K x is a small difference of large terms.
            if self.refined && !(moved <= 0.5 * before) {
                break;
            }
            before = if self.refined { moved } else { left };
            u.iter_mut().zip(correction).for_each(|(u, c)| *u += c);
            if self.refined && moved <= f64::EPSILON * norm(&u) {
                break;
            }
        }
        Ok(u)
    }

    fn gradient(
        &mut self,
        lambda: &[f64],
        r: &mut [f64],
        _accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<Option<Followed>, DualError> {
        if !self.refined {
            return Ok(None);
        }
        let u = self.displacement(lambda, 0.0, stop)?;
        self.contact.mul(&u, r);
        for (r, c) in r.iter_mut().zip(&self.offsets) {
            *r = c - *r;
        }
        Ok(Some(Followed::default()))
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

/// The lower triangle of K by columns; zeros off the diagonal are left out, and so is what ties a fixed unknown.
fn lower_columns(k: &BlockCsr<2>, fixed: &[u32]) -> (Vec<u32>, Vec<u32>, Vec<f64>) {
    let n = k.n_rows();
    let tied = |unknown: usize| fixed.binary_search(&(unknown as u32)).is_err();
    let room = 2 * k.n_blocks() + n;
    let mut col_ptr = Vec::with_capacity(n + 1);
    let mut row_idx = Vec::with_capacity(room);
    let mut values = Vec::with_capacity(room);
    col_ptr.push(0);
    for i in 0..k.n_block_rows() {
        let (cols, blocks) = k.row(i);
        let below = cols.partition_point(|&j| (j as usize) < i);
        for a in 0..2 {
            // K is symmetric: the row of blocks i holds the columns 2i and 2i + 1.
            for (&j, block) in cols[below..].iter().zip(&blocks[below..]) {
                for (b, &value) in block[a].iter().enumerate() {
                    let (row, column) = (2 * j as usize + b, 2 * i + a);
                    if row == column || (row > column && value != 0.0 && tied(row) && tied(column))
                    {
                        row_idx.push(row as u32);
                        values.push(value);
                    }
                }
            }
            col_ptr.push(row_idx.len() as u32);
        }
    }
    (col_ptr, row_idx, values)
}

/// Copies the dense trailing blocks out of the factor.
fn trailing_blocks(
    symbolic: &SymbolicCholesky<u32>,
    values: &[f64],
    n_leading: usize,
    sizes: &[usize],
) -> Vec<TrailingBlock> {
    let mut first = 0;
    let mut blocks: Vec<TrailingBlock> = sizes
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
        return blocks;
    }
    let mut current = 0;
    for panel in Panels::new(symbolic, values) {
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
                if let Some(place) = target.get_mut(row - n_leading - first) {
                    *place = value;
                }
            }
        }
    }
    blocks
}
