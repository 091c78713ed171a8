//! Matrices as kernels take them: blocks of a shape that is known at run time, 32-bit indices, in f32 or f64.

use super::BlockCsr;
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
    + 'static
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

/// A sparse matrix of `block[0] × block[1]` blocks in compressed block rows, ready to upload.
///
/// Block row `i` owns the blocks `row_ptr[i]..row_ptr[i + 1]`; block k stands in block column
/// `col_idx[k]`, and its entries, row by row, in `values[k·block[0]·block[1]..]`.
#[derive(Clone, Debug, PartialEq)]
pub struct BlockMatrix<S> {
    /// Rows and columns of a block.
    pub block: [usize; 2],
    /// Block columns.
    pub n_block_cols: usize,
    /// Starts of the block rows; one more entry than block rows.
    pub row_ptr: Vec<u32>,
    /// Block columns of the blocks.
    pub col_idx: Vec<u32>,
    /// Entries of the blocks.
    pub values: Vec<S>,
}

impl<S: Real> BlockMatrix<S> {
    /// `scale` · `matrix`, rounded to S.
    pub(crate) fn new<const R: usize, const C: usize>(matrix: &BlockCsr<R, C>, scale: f64) -> Self {
        Self {
            block: [R, C],
            n_block_cols: matrix.n_block_cols(),
            row_ptr: matrix.row_ptr().par_iter().map(|&k| k as u32).collect(),
            col_idx: matrix.col_idx().to_vec(),
            values: store(matrix.values().as_flattened().as_flattened(), scale),
        }
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
        4 * (self.row_ptr.len() + self.col_idx.len()) + size_of::<S>() * self.values.len()
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
    /// Block row `i` times x.
    #[inline(always)]
    pub(crate) fn row_times(&self, i: usize, x: &[[S; C]]) -> [S; R] {
        let range = self.row_ptr[i] as usize..self.row_ptr[i + 1] as usize;
        // One sum per entry of a block: the columns are added up at the end, so that a block costs as
        // few vector instructions as it can.
        let mut sums = [[S::default(); C]; R];
        for (&j, block) in self.col_idx[range.clone()].iter().zip(&self.values[range]) {
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
    /// Rows.
    pub n: usize,
    /// n² entries.
    pub values: Vec<S>,
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
