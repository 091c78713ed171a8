//! Sliced block-ELL: slices of 32 block rows, padded to their longest row, column by column, cut into parts
//! that fit into one binding.

use crate::sparse::BlockCsr;
use crate::sparse::stored::BlockMatrix;
use rayon::prelude::*;
use std::ops::Range;

/// Block rows of a slice.
pub(super) const SLICE: usize = 32;

/// The slices of the widths `widths[start..]` that fit into `most` slots, as long as `wanted`: where each
/// starts, and one past the last; None if the first one does not fit.
fn cut(
    widths: &[usize],
    start: usize,
    most: usize,
    wanted: impl Fn(&usize) -> bool,
) -> Option<Vec<u32>> {
    let mut slices = vec![0u32];
    let mut total = 0;
    for s in (start..widths.len()).take_while(wanted) {
        let size = widths[s] * SLICE;
        if total + size > most {
            break;
        }
        total += size;
        slices.push(total as u32);
    }
    (slices.len() > 1).then_some(slices)
}

/// The columns and the values of each slice, with its number; a slot has `block` values.
fn pieces<'a, V>(
    slices: &[u32],
    mut columns: &'a mut [u32],
    mut values: &'a mut [V],
    block: usize,
) -> Vec<(usize, &'a mut [u32], &'a mut [V])> {
    let mut pieces = Vec::with_capacity(slices.len() - 1);
    for (s, ends) in slices.windows(2).enumerate() {
        let size = (ends[1] - ends[0]) as usize;
        let (c, c_rest) = columns.split_at_mut(size);
        let (v, v_rest) = values.split_at_mut(block * size);
        (columns, values) = (c_rest, v_rest);
        pieces.push((s, c, v));
    }
    pieces
}

/// The slots of all slices.
fn slots(slices: &[u32]) -> u64 {
    slices.last().copied().unwrap_or(0).into()
}

/// Which slices a part of K has, and where they start.
pub(super) struct PartLayout {
    pub row_segment: usize,
    pub column_segment: usize,
    /// First block row, within the segment.
    pub first: usize,
    pub count: usize,
    /// First slot of each slice, and one past the last.
    pub slices: Vec<u32>,
}

impl PartLayout {
    pub fn slots(&self) -> u64 {
        slots(&self.slices)
    }

    /// The columns and values of all slots; padding points at column 0 with the value 0. With `by_rows` the
    /// top rows of the blocks of a column come first, then their bottom rows; otherwise block by block.
    pub fn fill(
        &self,
        k: &BlockCsr<2>,
        segment_start: usize,
        columns_of_segment: &Range<usize>,
        scale: f64,
        by_rows: bool,
    ) -> (Vec<u32>, Vec<f64>) {
        let mut columns = vec![0u32; self.slots() as usize];
        let mut values = vec![0.0f64; 4 * columns.len()];
        let pieces = pieces(&self.slices, &mut columns, &mut values, 4);
        pieces.into_par_iter().for_each(|(s, columns, values)| {
            for lane in 0..SLICE.min(self.count - s * SLICE) {
                let row = segment_start + self.first + s * SLICE + lane;
                let (cols, blocks) = k.row(row);
                let own = cols
                    .iter()
                    .zip(blocks)
                    .filter(|(j, _)| columns_of_segment.contains(&(**j as usize)));
                for (c, (&j, block)) in own.enumerate() {
                    let slot = c * SLICE + lane;
                    columns[slot] = j - columns_of_segment.start as u32;
                    for (a, row) in block.iter().enumerate() {
                        for (b, v) in row.iter().enumerate() {
                            let place = if by_rows {
                                4 * c * SLICE + 2 * a * SLICE + 2 * lane + b
                            } else {
                                4 * slot + 2 * a + b
                            };
                            values[place] = v * scale;
                        }
                    }
                }
            }
        });
        (columns, values)
    }

    /// The parts of K: for each pair of segments the rows that have entries there, cut so that no array
    /// exceeds `max_binding` bytes; None if a single slice does.
    pub fn all(
        k: &BlockCsr<2>,
        ranges: &[Range<usize>],
        max_binding: u64,
        real_bytes: u64,
    ) -> Option<Vec<Self>> {
        let most = (max_binding / (4 * real_bytes)).min(u64::from(u32::MAX)) as usize;
        let mut parts = Vec::new();
        for (row_segment, rows) in ranges.iter().enumerate() {
            // The part on the diagonal writes all rows and comes first; the others add to it.
            let others = (0..ranges.len()).filter(|&c| c != row_segment);
            for column_segment in std::iter::once(row_segment).chain(others) {
                let columns = &ranges[column_segment];
                let widths: Vec<usize> = (rows.start..rows.end)
                    .into_par_iter()
                    .step_by(SLICE)
                    .map(|first| {
                        (first..(first + SLICE).min(rows.end))
                            .map(|i| {
                                let cols = k.row(i).0;
                                let below =
                                    |end: usize| cols.partition_point(|&j| (j as usize) < end);
                                below(columns.end) - below(columns.start)
                            })
                            .max()
                            .unwrap_or(0)
                    })
                    .collect();
                let diagonal = row_segment == column_segment;
                let filled = |s: &usize| diagonal || widths[*s] > 0;
                let mut next = 0;
                while let Some(start) = (next..widths.len()).find(filled) {
                    let slices = cut(&widths, start, most, filled)?;
                    next = start + slices.len() - 1;
                    let first = start * SLICE;
                    parts.push(Self {
                        row_segment,
                        column_segment,
                        first,
                        count: (next * SLICE).min(rows.len()) - first,
                        slices,
                    });
                }
            }
        }
        Some(parts)
    }
}

/// Which slices a part of a matrix of a multigrid level has, and where they start.
pub(super) struct LevelLayout {
    pub first: usize,
    pub count: usize,
    /// First slot of each slice, and one past the last.
    pub slices: Vec<u32>,
}

impl LevelLayout {
    pub fn slots(&self) -> u64 {
        slots(&self.slices)
    }

    /// Slices and columns in one array, and the values of all slots, entry by entry of a block; padding
    /// points at column 0 with the value 0.
    pub fn fill(&self, m: &BlockMatrix<f32>) -> (Vec<u32>, Vec<f32>) {
        let block = m.block[0] * m.block[1];
        let slots = self.slots() as usize;
        let mut structure = self.slices.clone();
        structure.resize(self.slices.len() + slots, 0);
        let mut values = vec![0.0f32; block * slots];
        let (_, columns) = structure.split_at_mut(self.slices.len());
        let pieces = pieces(&self.slices, columns, &mut values, block);
        pieces.into_par_iter().for_each(|(s, columns, values)| {
            for lane in 0..SLICE.min(self.count - s * SLICE) {
                let row = self.first + s * SLICE + lane;
                for (c, k) in (m.row_ptr[row] as usize..m.row_ptr[row + 1] as usize).enumerate() {
                    columns[c * SLICE + lane] = m.col_idx[k];
                    for e in 0..block {
                        values[(c * block + e) * SLICE + lane] = m.values[k * block + e];
                    }
                }
            }
        });
        (structure, values)
    }

    /// The parts of a matrix, cut so that no array exceeds `max_binding` bytes; None if a single slice does.
    pub fn all(m: &BlockMatrix<f32>, max_binding: u64) -> Option<Vec<Self>> {
        let block = (m.block[0] * m.block[1]) as u64;
        let n = m.n_block_rows();
        let most = (max_binding / (4 * block)).min(u64::from(u32::MAX) / block) as usize;
        let widths: Vec<usize> = (0..n)
            .step_by(SLICE)
            .map(|first| {
                (first..(first + SLICE).min(n))
                    .map(|i| (m.row_ptr[i + 1] - m.row_ptr[i]) as usize)
                    .max()
                    .unwrap_or(0)
            })
            .collect();
        let mut parts = Vec::new();
        let mut start = 0;
        while start < widths.len() {
            let slices = cut(&widths, start, most, |_| true)?;
            let next = start + slices.len() - 1;
            let first = start * SLICE;
            parts.push(Self {
                first,
                count: (next * SLICE).min(n) - first,
                slices,
            });
            start = next;
        }
        Some(parts)
    }
}
