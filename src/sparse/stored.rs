//! Matrices in the form that kernels take: blocks of a shape known at run time, 32-bit indices, in f32 or f64.

use super::{BlockCsr, ROWS_PER_TASK, dot};
use crate::ranks::Halo;
use rayon::prelude::*;
use std::fmt::Debug;
use std::ops::{Add, AddAssign, Mul, Sub};

/// A real number that a matrix can be stored in.
pub trait Real:
    Copy
    + Debug
    + Default
    + Send
    + Sync
    + PartialEq
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + AddAssign
    + bytemuck::Pod
{
    /// The nearest value of this type.
    fn from_f64(value: f64) -> Self;
    /// The value as f64, exactly.
    fn to_f64(self) -> f64;
}

impl Real for f32 {
    fn from_f64(value: f64) -> Self {
        value as f32
    }
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Real for f64 {
    fn from_f64(value: f64) -> Self {
        value
    }
    fn to_f64(self) -> f64 {
        self
    }
}

/// A square matrix in f64 whose block shape is not part of its type: the form in which backends take K.
pub trait SquareBlocks: Send + Sync {
    /// Rows of a block.
    fn block(&self) -> usize;
    /// The start of each block row among the stored blocks, and the number of blocks at the end.
    fn row_ptr(&self) -> &[usize];
    /// The block columns of all stored blocks, row by row.
    fn col_idx(&self) -> &[u32];
    /// The entries of all stored blocks, block by block, each by rows.
    fn entries(&self) -> &[f64];
    /// y = K x; returns xᵀy.
    fn multiply(&self, x: &[f64], y: &mut [f64]) -> f64;
    /// y −= K x.
    fn subtract_product(&self, x: &[f64], y: &mut [f64]);
    /// K x, and |K| s: the rounding scale of K x where the entries of x are known to s.
    fn multiply_with_sizes(&self, x: &[f64], s: &[f64]) -> [Vec<f64>; 2];
    /// Passes the stored scalar entries (row, column, value), row by row.
    fn for_entries(&self, take: &mut dyn FnMut(usize, usize, f64));
    /// Where other ranks have the other rows, the halo of these: block columns are the own blocks, then copies.
    #[doc(hidden)]
    fn halo(&self) -> Option<&Halo> {
        None
    }

    /// Scalar rows.
    fn n_rows(&self) -> usize {
        self.block() * (self.row_ptr().len() - 1)
    }

    /// The same, with those of other ranks.
    fn n_all_rows(&self) -> usize {
        match self.halo() {
            Some(halo) => self.block() * halo.all() as usize,
            None => self.n_rows(),
        }
    }
}

impl<const B: usize> SquareBlocks for BlockCsr<B> {
    fn block(&self) -> usize {
        B
    }

    fn row_ptr(&self) -> &[usize] {
        self.row_ptr()
    }

    fn col_idx(&self) -> &[u32] {
        self.col_idx()
    }

    fn entries(&self) -> &[f64] {
        self.values().as_flattened().as_flattened()
    }

    fn multiply(&self, x: &[f64], y: &mut [f64]) -> f64 {
        self.for_rows(x, y, |y, x, sum| {
            y.copy_from_slice(&sum);
            dot(x, &sum)
        })
    }

    fn subtract_product(&self, x: &[f64], y: &mut [f64]) {
        self.for_rows(x, y, |y, _, sum| {
            y.iter_mut().zip(sum).for_each(|(y, v)| *y -= v);
            0.0
        });
    }

    fn multiply_with_sizes(&self, x: &[f64], s: &[f64]) -> [Vec<f64>; 2] {
        let [mut sums, mut sizes] = [(); 2].map(|()| vec![0.0; self.n_rows()]);
        (sums.par_chunks_mut(B).zip(sizes.par_chunks_mut(B)))
            .enumerate()
            .with_min_len(ROWS_PER_TASK)
            .for_each(|(i, (sum, size))| {
                let (cols, blocks) = self.row(i);
                for (&j, block) in cols.iter().zip(blocks) {
                    for (a, row) in block.iter().enumerate() {
                        for (b, v) in row.iter().enumerate() {
                            let column = B * j as usize + b;
                            sum[a] += v * x[column];
                            size[a] += (v * s[column]).abs();
                        }
                    }
                }
            });
        [sums, sizes]
    }

    fn for_entries(&self, take: &mut dyn FnMut(usize, usize, f64)) {
        self.triplets().for_each(|(i, j, v)| take(i, j, v));
    }
}

/// A sparse matrix of blocks in compressed block rows, ready to upload.
///
/// Block row `i` owns the blocks `row_ptr[i]..row_ptr[i + 1]`; block k is in block column `col_idx[k]`, and its
/// entries, row by row, in `values[k·rows·columns..]`. Kernels rely on these indices: they come from a [`BlockCsr`]
/// only.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockMatrix<S> {
    block: [usize; 2],
    n_block_cols: usize,
    row_ptr: Vec<u32>,
    col_idx: Vec<u32>,
    values: Vec<S>,
}

impl<S: Real> BlockMatrix<S> {
    /// `scale` · `matrix`, rounded to S.
    ///
    /// # Panics
    /// If there are more than 2³² − 1 blocks.
    pub fn new<const R: usize, const C: usize>(matrix: &BlockCsr<R, C>, scale: f64) -> Self {
        assert!(
            matrix.n_blocks() <= u32::MAX as usize,
            "indices are 32 bits"
        );
        Self {
            block: [R, C],
            n_block_cols: matrix.n_block_cols(),
            row_ptr: matrix.row_ptr().par_iter().map(|&k| k as u32).collect(),
            col_idx: matrix.col_idx().to_vec(),
            values: store(matrix.values().as_flattened().as_flattened(), scale),
        }
    }

    /// The blocks in the first block columns, in the memory of all, and those in the others, counted from there.
    pub(crate) fn split_columns(mut self, columns: usize) -> (Self, Self) {
        let size = self.block[0] * self.block[1];
        let mut others = Self {
            block: self.block,
            n_block_cols: self.n_block_cols - columns,
            row_ptr: vec![0],
            col_idx: Vec::new(),
            values: Vec::new(),
        };
        let (mut begin, mut kept) = (0, 0);
        for i in 0..self.n_block_rows() {
            let end = self.row_ptr[i + 1] as usize;
            let here = self.col_idx[begin..end].partition_point(|&j| (j as usize) < columns);
            let there = begin + here;
            let beyond = self.col_idx[there..end].iter();
            others.col_idx.extend(beyond.map(|j| j - columns as u32));
            (others.values).extend_from_slice(&self.values[there * size..end * size]);
            others.row_ptr.push(others.col_idx.len() as u32);
            self.col_idx.copy_within(begin..there, kept);
            (self.values).copy_within(begin * size..there * size, kept * size);
            kept += here;
            (self.row_ptr[i + 1], begin) = (kept as u32, end);
        }
        self.col_idx.truncate(kept);
        self.values.truncate(kept * size);
        self.col_idx.shrink_to_fit();
        self.values.shrink_to_fit();
        self.n_block_cols = columns;
        (self, others)
    }

    /// The matrix that picks block rows of a vector with `n_block_cols`.
    pub(crate) fn picks(block: usize, rows: &[u32], n_block_cols: usize) -> Self {
        let identity = (0..block * block).map(|k| f64::from(u8::from(k % (block + 1) == 0)));
        let identity: Vec<S> = identity.map(S::from_f64).collect();
        Self {
            block: [block; 2],
            n_block_cols,
            row_ptr: (0..=rows.len() as u32).collect(),
            col_idx: rows.to_vec(),
            values: identity.repeat(rows.len()),
        }
    }

    /// The first block rows, and the others.
    pub(crate) fn split_rows(mut self, rows: usize) -> (Self, Self) {
        let size = self.block[0] * self.block[1];
        let first = self.row_ptr[rows] as usize;
        let others = Self {
            block: self.block,
            n_block_cols: self.n_block_cols,
            row_ptr: (self.row_ptr[rows..].iter())
                .map(|end| end - first as u32)
                .collect(),
            col_idx: self.col_idx.split_off(first),
            values: self.values.split_off(size * first),
        };
        self.row_ptr.truncate(rows + 1);
        (self, others)
    }

    /// The blocks on and above the diagonal, in the memory of all.
    pub(crate) fn into_upper(mut self) -> Self {
        let size = self.block[0] * self.block[1];
        let (mut begin, mut kept) = (0, 0);
        for i in 0..self.n_block_rows() {
            let end = self.row_ptr[i + 1] as usize;
            let upper = begin + self.col_idx[begin..end].partition_point(|&j| (j as usize) < i);
            self.col_idx.copy_within(upper..end, kept);
            self.values
                .copy_within(upper * size..end * size, kept * size);
            kept += end - upper;
            (self.row_ptr[i + 1], begin) = (kept as u32, end);
        }
        self.col_idx.truncate(kept);
        self.values.truncate(kept * size);
        self.col_idx.shrink_to_fit();
        self.values.shrink_to_fit();
        self
    }

    /// Rows and columns of a block.
    pub fn block(&self) -> [usize; 2] {
        self.block
    }

    /// Starts of the block rows; one more entry than block rows.
    pub fn row_ptr(&self) -> &[u32] {
        &self.row_ptr
    }

    /// Block columns of the blocks.
    pub fn col_idx(&self) -> &[u32] {
        &self.col_idx
    }

    /// Entries of the blocks.
    pub fn values(&self) -> &[S] {
        &self.values
    }

    /// Block rows.
    pub fn n_block_rows(&self) -> usize {
        self.row_ptr.len() - 1
    }

    /// Scalar rows.
    pub fn n_rows(&self) -> usize {
        self.n_block_rows() * self.block[0]
    }

    /// Scalar columns.
    pub fn n_cols(&self) -> usize {
        self.n_block_cols * self.block[1]
    }

    /// Bytes of the indices and values.
    pub fn bytes(&self) -> usize {
        4 * (self.row_ptr.len() + self.col_idx.len()) + size_of_val(&self.values[..])
    }

    /// The matrix with its block size known to the compiler.
    ///
    /// # Panics
    /// If the blocks are not R × C.
    pub(crate) fn view<const R: usize, const C: usize>(&self) -> BlockView<'_, R, C, S> {
        assert_eq!(self.block, [R, C]);
        BlockView {
            row_ptr: &self.row_ptr,
            col_idx: &self.col_idx,
            values: self.values.as_chunks::<C>().0.as_chunks::<R>().0,
        }
    }
}

/// A [`BlockMatrix`] with its block size known to the compiler.
#[derive(Clone, Copy)]
pub(crate) struct BlockView<'a, const R: usize, const C: usize, S> {
    row_ptr: &'a [u32],
    col_idx: &'a [u32],
    values: &'a [[[S; C]; R]],
}

impl<const R: usize, const C: usize, S: Real> BlockView<'_, R, C, S> {
    /// The block columns and blocks of block row `i`.
    #[inline(always)]
    pub(crate) fn row(&self, i: usize) -> (&[u32], &[[[S; C]; R]]) {
        let range = self.row_ptr[i] as usize..self.row_ptr[i + 1] as usize;
        (&self.col_idx[range.clone()], &self.values[range])
    }

    /// Block row `i` times x.
    #[inline(always)]
    pub(crate) fn row_times(&self, i: usize, x: &[[S; C]]) -> [S; R] {
        let (cols, blocks) = self.row(i);
        // One sum per entry of a block: the columns are added up at the end, so that a block costs as
        // few vector instructions as it can.
        let mut sums = [[S::default(); C]; R];
        for (&j, block) in cols.iter().zip(blocks) {
            let x = [x[j as usize]; R];
            for (sums, (block, x)) in sums
                .as_flattened_mut()
                .iter_mut()
                .zip(block.as_flattened().iter().zip(x.as_flattened()))
            {
                *sums += *block * *x;
            }
        }
        sums.map(|row| row.into_iter().fold(S::default(), |sum, v| sum + v))
    }
}

/// `scale` · `values`, rounded to S.
pub(crate) fn store<S: Real>(values: &[f64], scale: f64) -> Vec<S> {
    values
        .par_iter()
        .with_min_len(1 << 14)
        .map(|&v| S::from_f64(v * scale))
        .collect()
}

/// A dense symmetric matrix, row by row.
#[derive(Clone, Debug)]
pub struct Dense<S> {
    n: usize,
    values: Vec<S>,
}

impl<S> Dense<S> {
    /// A matrix of n rows.
    ///
    /// # Panics
    /// If there are not n² entries.
    pub fn new(n: usize, values: Vec<S>) -> Self {
        assert_eq!(values.len(), n * n);
        Self { n, values }
    }

    /// Rows.
    pub fn n(&self) -> usize {
        self.n
    }

    /// n² entries.
    pub fn values(&self) -> &[S] {
        &self.values
    }
}

/// A block times a vector.
#[inline(always)]
pub(crate) fn times<const B: usize, S: Real>(block: &[[S; B]; B], x: &[S; B]) -> [S; B] {
    block.map(|row| (0..B).fold(S::default(), |sum, k| sum + row[k] * x[k]))
}

/// The power of two at or below a positive number; 1 for anything else.
pub(crate) fn power_of_two_below(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() {
        x.log2().floor().clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}
