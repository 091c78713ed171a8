//! The division and layout of vectors and matrices: segments of vectors, and sliced block-ELL. Its slices have 32 block
//! rows, padded to their longest row, column by column, and are cut into parts that fit into one binding.

use rayon::prelude::*;
use std::ops::Range;

/// Block rows of a slice.
pub(super) const SLICE: usize = 32;
/// A segment of a vector is a whole number of this many scalars: slices of blocks of 2, 3 and 6.
const WHOLE: usize = 6 * SLICE;
/// Bytes that a scalar may take in any array: its part of a 6 × 6 block of D⁻¹ in f32.
const SCALAR_BYTES: u64 = 24;

/// The ranges of scalars of the segments of a vector, where a binding has at most this many bytes.
pub(super) fn segments(len: usize, max_binding: u64) -> Vec<Range<usize>> {
    let most = (max_binding / SCALAR_BYTES) as usize;
    let step = (most / WHOLE * WHOLE).max(WHOLE);
    (0..len.max(1))
        .step_by(step)
        .map(|first| first..(first + step).min(len.max(1)))
        .collect()
}

/// A matrix in compressed block rows, as input to the layout.
pub(super) struct Source<'a, S> {
    /// Rows and columns of a block.
    pub block: [usize; 2],
    pub n_block_rows: usize,
    pub n_block_cols: usize,
    /// The start of a block row among the blocks.
    pub start: &'a (dyn Fn(usize) -> usize + Sync),
    pub col_idx: &'a [u32],
    pub values: &'a [S],
}

impl<S: Sync> Source<'_, S> {
    /// The blocks of a row whose columns are in a range.
    fn row(&self, i: usize, columns: &Range<usize>) -> Range<usize> {
        let first = (self.start)(i);
        let cols = &self.col_idx[first..(self.start)(i + 1)];
        let below = |end: usize| first + cols.partition_point(|&j| (j as usize) < end);
        below(columns.start)..below(columns.end)
    }
}

/// Some rows of a matrix with the columns of one segment.
pub(super) struct Part {
    pub row_segment: usize,
    pub column_segment: usize,
    /// First block row, within the segment.
    pub first: usize,
    pub count: usize,
    /// Whether another part has written the rows before.
    pub adds: bool,
    /// First slot of each slice, and one past the last.
    slices: Vec<u32>,
    /// The block rows and columns of the segments.
    rows: Range<usize>,
    columns: Range<usize>,
}

impl Part {
    /// Blocks with their padding.
    pub fn slots(&self) -> u64 {
        self.slices.last().copied().unwrap_or(0).into()
    }

    /// Blocks of the longest row.
    pub fn longest(&self) -> usize {
        let slices = self.slices.windows(2);
        let longest = slices.map(|ends| (ends[1] - ends[0]) as usize / SLICE);
        longest.max().unwrap_or(0)
    }

    /// The start of the columns in the structure, after the slices.
    pub fn columns_start(&self) -> usize {
        self.slices.len()
    }

    /// Slices and columns in one array, and the values of all slots, made by `value`; padding points at column 0 with
    /// the value 0. `group` entries of a block are adjacent, to be loaded at once; the same groups of the 32 blocks of
    /// a column follow each other.
    pub fn fill<S: Copy + Sync, V: Copy + Default + Send>(
        &self,
        source: &Source<S>,
        group: usize,
        value: impl Fn(S) -> V + Sync,
    ) -> (Vec<u32>, Vec<V>) {
        let block = source.block[0] * source.block[1];
        let slots = self.slots() as usize;
        let mut structure = self.slices.clone();
        structure.resize(self.slices.len() + slots, 0);
        let mut values = vec![V::default(); block * slots];
        let columns = &mut structure[self.slices.len()..];
        let pieces = pieces(&self.slices, columns, &mut values, block);
        pieces.into_par_iter().for_each(|(s, columns, values)| {
            for lane in 0..SLICE.min(self.count - s * SLICE) {
                let row = self.rows.start + self.first + s * SLICE + lane;
                for (c, k) in source.row(row, &self.columns).enumerate() {
                    columns[c * SLICE + lane] = source.col_idx[k] - self.columns.start as u32;
                    for e in 0..block {
                        let in_column = (e / group * SLICE + lane) * group + e % group;
                        values[c * block * SLICE + in_column] = value(source.values[k * block + e]);
                    }
                }
            }
        });
        (structure, values)
    }

    /// The parts of a matrix: for each pair of segments the rows that have entries there. They are cut so that no array
    /// exceeds `max_binding` bytes at `scalar_bytes` a value; None if a single slice does. `rows` and `columns` are the
    /// segments of the vectors.
    pub fn all<S: Sync>(
        source: &Source<S>,
        rows: &[Range<usize>],
        columns: &[Range<usize>],
        max_binding: u64,
        scalar_bytes: u64,
    ) -> Option<Vec<Self>> {
        let block = (source.block[0] * source.block[1]) as u64;
        // Slices precede the columns, and positions of values are 32 bits.
        let room = max_binding.saturating_sub(source.n_block_rows as u64 / 8 + 8) / 4;
        let most = room
            .min(max_binding / (scalar_bytes * block))
            .min(u64::from(u32::MAX) / block) as usize;
        let blocks = |range: &Range<usize>, size: usize, n: usize| {
            (range.start / size).min(n)..range.end.div_ceil(size).min(n)
        };
        let mut parts = Vec::new();
        for (row_segment, rows) in rows.iter().enumerate() {
            let rows = blocks(rows, source.block[0], source.n_block_rows);
            // The part next to the diagonal writes all rows and comes first; the others add to it.
            let first = row_segment.min(columns.len() - 1);
            let others = (0..columns.len()).filter(|&c| c != first);
            for column_segment in std::iter::once(first).chain(others) {
                let columns = blocks(
                    &columns[column_segment],
                    source.block[1],
                    source.n_block_cols,
                );
                let widths: Vec<usize> = (rows.start..rows.end)
                    .into_par_iter()
                    .step_by(SLICE)
                    .map(|first| {
                        let slice = first..(first + SLICE).min(rows.end);
                        let widths = slice.map(|i| source.row(i, &columns).len());
                        widths.max().unwrap_or(0)
                    })
                    .collect();
                let writes = column_segment == first;
                let filled = |s: &usize| writes || widths[*s] > 0;
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
                        adds: !writes,
                        slices,
                        rows: rows.clone(),
                        columns: columns.clone(),
                    });
                }
            }
        }
        Some(parts)
    }
}

/// The slices of the widths `widths[start..]` that fit into `most` slots, as long as `wanted`. Returns where each
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

#[cfg(test)]
#[allow(clippy::single_range_in_vec_init, reason = "a list of one segment")]
mod tests {
    use super::*;

    #[test]
    fn segments_are_whole_slices_of_every_block() {
        assert_eq!(segments(0, 1 << 20), [0..1]);
        assert_eq!(segments(100, 1 << 20), [0..100]);
        let cut = segments(1000, 24 * 400);
        assert_eq!(cut, [0..384, 384..768, 768..1000]);
        // However little a binding holds.
        assert_eq!(segments(193, 1), [0..192, 192..193]);
    }

    /// Two rows of 1 × 2 blocks, three block columns in two segments.
    #[test]
    fn parts_hold_what_their_segments_share() {
        let start = [0, 2, 3];
        let source = Source {
            block: [1, 2],
            n_block_rows: 2,
            n_block_cols: 3,
            start: &|i| start[i],
            col_idx: &[0, 2, 1],
            values: &[1, 2, 3, 4, 5, 6],
        };
        let parts = Part::all(&source, &[0..2], &[0..4, 4..6], 1 << 20, 4).expect("they fit");
        assert_eq!(parts.len(), 2);
        for (part, (adds, filled)) in parts.iter().zip([
            (false, [[0, 1, 2], [1, 5, 6]]),
            (true, [[0, 3, 4], [0, 0, 0]]),
        ]) {
            assert_eq!((part.adds, part.first, part.count), (adds, 0, 2));
            let (structure, values) = part.fill(&source, 1, |v| v);
            assert_eq!(structure[..2], [0, 32]);
            for (lane, [column, a, b]) in filled.into_iter().enumerate() {
                assert_eq!(structure[part.columns_start() + lane], column);
                assert_eq!([values[lane], values[32 + lane]], [a as usize, b as usize]);
            }
            let (_, pairs) = part.fill(&source, 2, |v| v);
            assert_eq!(
                pairs[..2],
                values[..33].iter().step_by(32).copied().collect::<Vec<_>>()
            );
        }
        assert!(Part::all(&source, &[0..2], &[0..4, 4..6], 200, 4).is_none());
    }
}
