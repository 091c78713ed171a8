//! Vectors and matrices on the device.

use super::Gpu;
use super::buffers::Handle;
use super::kernels::{Scalar, Shape, WIDTH};
use super::layout::{Part, Source, segments};
use crate::backend::{BackendError, Precision, cpu};
use crate::ranks::Halo;
use crate::sparse::Csr;
use crate::sparse::stored::{BlockMatrix, SquareBlocks, power_of_two_below};
use rayon::prelude::*;
use std::ops::Range;
use wgpu::BufferUsages;

/// Scalars of a vector, with their buffer.
#[derive(Clone)]
pub(super) struct Segment {
    pub(super) range: Range<usize>,
    pub(super) data: Handle,
}

impl Segment {
    /// Scalars.
    pub(super) fn len(&self) -> usize {
        self.range.len()
    }

    /// Pairs, the last one filled up: buffers end at a whole one.
    pub(super) fn pairs(&self) -> u32 {
        self.len().div_ceil(2) as u32
    }
}

/// A vector in segments.
pub struct Vector {
    pub(super) len: usize,
    pub(super) segments: Vec<Segment>,
}

impl Vector {
    pub(super) fn ranges(&self) -> Vec<Range<usize>> {
        self.segments.iter().map(|s| s.range.clone()).collect()
    }
}

/// A vector of a multigrid level, in f32.
pub struct LevelVector(pub(super) Vector);

/// A part of a matrix in blocks.
pub(super) struct BlockPart {
    pub(super) row_segment: usize,
    pub(super) column_segment: usize,
    pub(super) first: u32,
    pub(super) count: u32,
    pub(super) adds: bool,
    pub(super) columns: u32,
    /// Invocations of a block row.
    pub(super) lanes: u32,
    pub(super) structure: Handle,
    pub(super) values: Handle,
    pub(super) groups: u32,
    pub(super) bytes: u64,
}

/// A matrix in blocks, in parts.
pub(super) struct Blocks {
    pub(super) shape: Shape,
    pub(super) scalar: Scalar,
    pub(super) n_rows: usize,
    pub(super) n_cols: usize,
    pub(super) parts: Vec<BlockPart>,
}

/// K in sliced block-ELL.
pub struct Matrix {
    pub(super) blocks: Blocks,
    /// On several ranks, the entries of others that its columns reach.
    pub(super) beyond: Option<Beyond>,
}

/// The entries of a vector that other ranks need, and copies of those of others.
pub(super) struct Beyond {
    /// That of the interface, whose rows have this many entries.
    pub(super) halo: Halo,
    pub(super) width: usize,
    /// Picks the interface of a vector.
    pub(super) picks: Rows,
    pub(super) interface: Vector,
    pub(super) copies: Vector,
}

/// A matrix of a multigrid level in sliced block-ELL, in f32.
pub struct LevelMatrix(pub(super) Blocks);

/// D⁻¹ of a multigrid level, in the segments of its vectors.
pub struct LevelDiagonal {
    pub(super) shape: Shape,
    pub(super) block: usize,
    pub(super) len: usize,
    pub(super) segments: Vec<Handle>,
}

/// A dense matrix, by rows, in f32.
pub struct DenseMatrix {
    pub(super) n: u32,
    pub(super) data: Handle,
}

/// Rows of B or Bᵀ that end in one segment, with the columns of one segment.
pub(super) struct RowsPart {
    pub(super) to: usize,
    pub(super) from: usize,
    pub(super) count: u32,
    pub(super) adds: bool,
    pub(super) starts: Handle,
    pub(super) targets: Handle,
    pub(super) columns: Handle,
    pub(super) values: Handle,
    pub(super) bytes: u64,
}

/// A rectangular matrix without its empty rows.
pub struct Rows {
    pub(super) n_rows: usize,
    pub(super) n_cols: usize,
    pub(super) parts: Vec<RowsPart>,
}

/// The scalars of a CG run and their partial sums.
pub struct State {
    /// The scalars that the iterations and their first halves read.
    pub(super) current: Handle,
    /// The scalars that the preconditioner and the second halves read.
    pub(super) next: Handle,
    pub(super) goals: Handle,
    pub(super) partials: Handle,
    /// On several ranks, the scalars that the host has: the same on all of them.
    pub(super) shared: Option<cpu::State>,
    /// Unknowns.
    pub(super) len: usize,
    /// Partial sums of pᵀKp come first, then those of the vectors.
    pub(super) n_curvature: u32,
    pub(super) n_vector: u32,
}

impl Gpu {
    /// Workgroups for `count` invocations where `share` dispatches do the same work.
    pub(super) fn groups(&self, count: u32, share: usize) -> u32 {
        let most = (self.context.max_groups() / share.max(1) as u32).max(1);
        count.div_ceil(WIDTH).clamp(1, most)
    }

    /// Workgroups of each segment of a vector.
    pub(super) fn vector_groups(&self, x: &Vector) -> Vec<u32> {
        (x.segments.iter())
            .map(|s| self.groups(s.pairs(), x.segments.len()))
            .collect()
    }

    /// A zeroed vector with this many bytes a scalar.
    pub(super) fn zeros(
        &mut self,
        label: &'static str,
        len: usize,
        scalar_bytes: u64,
    ) -> Result<Vector, BackendError> {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let segments = segments(len, self.context.max_binding())
            .into_iter()
            .map(|range| {
                let bytes = range.len() as u64 * scalar_bytes;
                let data = self.allocate(label, bytes, usage)?;
                Ok(Segment { range, data })
            })
            .collect::<Result<_, BackendError>>()?;
        Ok(Vector { len, segments })
    }

    /// A matrix in blocks on the device; `value` makes a number of the kernels of an entry. Of its columns, those from `own` on
    /// are in a vector of their own.
    fn blocks<S: Copy + Sync, V: Copy + Default + Send + bytemuck::NoUninit>(
        &mut self,
        what: &'static str,
        scalar: Scalar,
        source: &Source<S>,
        own: usize,
        value: impl Fn(S) -> V + Sync,
    ) -> Result<Blocks, BackendError> {
        let shape = Shape::of(source.block)?;
        let [n_rows, n_cols] = [
            source.n_block_rows * source.block[0],
            source.n_block_cols * source.block[1],
        ];
        let most = self.context.max_binding();
        let mut ranges = [segments(n_rows, most), segments(own, most)];
        if n_cols > own {
            let copies = segments(n_cols - own, most).into_iter();
            ranges[1].extend(copies.map(|range| own + range.start..own + range.end));
        }
        let scalar_bytes = size_of::<V>() as u64;
        let layouts =
            Part::all(source, &ranges[0], &ranges[1], most, scalar_bytes).ok_or_else(|| {
                BackendError::DenseRow {
                    adapter: self.context.adapter.to_string(),
                    limit_mib: most >> 20,
                }
            })?;
        let block_bytes = (source.block[0] * source.block[1]) as u64 * scalar_bytes + 4;
        let slots: u64 = layouts.iter().map(Part::slots).sum();
        self.context.check_memory(what, slots * block_bytes)?;
        let group = shape.group(scalar, self.context.precision);
        let share = match scalar {
            Scalar::Real => layouts.len(),
            Scalar::Single => 1,
        };
        let mut parts = Vec::new();
        for layout in layouts {
            let (structure, values) = layout.fill(source, group, &value);
            let (structure, values): (&[u8], &[u8]) = (
                bytemuck::cast_slice(&structure),
                bytemuck::cast_slice(&values),
            );
            let lanes = self.context.lanes(layout.count, layout.longest());
            let vectors = layout.count * source.block[0] * 2 * size_of::<V>();
            parts.push(BlockPart {
                row_segment: layout.row_segment,
                column_segment: layout.column_segment,
                first: layout.first as u32,
                count: layout.count as u32,
                adds: layout.adds,
                columns: layout.columns_start() as u32,
                lanes,
                groups: self.groups(layout.count as u32 * lanes, share),
                bytes: (structure.len() + values.len() + vectors) as u64,
                structure: self.upload_bytes(what, structure)?,
                values: self.upload_bytes(what, values)?,
            });
        }
        Ok(Blocks {
            shape,
            scalar,
            n_rows,
            n_cols,
            parts,
        })
    }

    /// K, and the factor by which the stored one is larger.
    pub(super) fn stiffness(
        &mut self,
        k: &dyn SquareBlocks,
    ) -> Result<(Matrix, f64), BackendError> {
        let n = k.row_ptr().len() - 1;
        let own = k.n_rows();
        let source = Source {
            block: [k.block(); 2],
            n_block_rows: n,
            n_block_cols: n + k.halo().map_or(0, Halo::copies),
            start: &|i| k.row_ptr()[i],
            col_idx: k.col_idx(),
            values: k.entries(),
        };
        let what = "the stiffness matrix";
        let (blocks, scale) = match self.context.precision {
            Precision::F64 => (self.blocks(what, Scalar::Real, &source, own, |v| v)?, 1.0),
            Precision::F32 => {
                // The same on all ranks, as are the scalars of CG.
                let scale = power_of_two_below(self.ranks.max(largest(k))).recip();
                let value = |v| (v * scale) as f32;
                (self.blocks(what, Scalar::Real, &source, own, value)?, scale)
            }
        };
        let beyond = match k.halo() {
            Some(halo) => Some(self.beyond(halo, k.block())?),
            None => None,
        };
        Ok((Matrix { blocks, beyond }, scale))
    }

    /// A matrix of a level.
    pub(super) fn stored(&mut self, m: &BlockMatrix<f32>) -> Result<LevelMatrix, BackendError> {
        let [_, columns] = m.block();
        let source = Source {
            block: m.block(),
            n_block_rows: m.n_block_rows(),
            n_block_cols: m.n_cols() / columns,
            start: &|i| m.row_ptr()[i] as usize,
            col_idx: m.col_idx(),
            values: m.values(),
        };
        let what = "the multigrid hierarchy";
        let blocks = self.blocks(what, Scalar::Single, &source, m.n_cols(), |v| v)?;
        Ok(LevelMatrix(blocks))
    }

    /// The rows of a matrix that have entries.
    pub(super) fn filled_rows(
        &mut self,
        matrix: &Csr,
        from: &Vector,
        to: &Vector,
    ) -> Result<Rows, BackendError> {
        assert!(matrix.n_cols() <= from.len && matrix.n_rows() <= to.len);
        let filled = matrix.filled_rows();
        let mut parts = Vec::new();
        for (t, targets) in to.ranges().iter().enumerate() {
            let rows: Vec<u32> = filled
                .iter()
                .copied()
                .filter(|&i| targets.contains(&(i as usize)))
                .collect();
            for (s, sources) in from.ranges().iter().enumerate() {
                let (mut starts, mut places) = (vec![0u32], Vec::new());
                let (mut columns, mut values) = (Vec::new(), Vec::new());
                for &i in &rows {
                    let (cols, blocks) = matrix.row(i as usize);
                    for (&j, v) in cols.iter().zip(blocks) {
                        if sources.contains(&(j as usize)) {
                            columns.push(j - sources.start as u32);
                            values.push(v[0][0]);
                        }
                    }
                    // The first part writes all rows; the others add to those where they have entries.
                    if s == 0 || columns.len() > starts[starts.len() - 1] as usize {
                        starts.push(columns.len() as u32);
                        places.push(i - targets.start as u32);
                    }
                }
                if places.is_empty() {
                    continue;
                }
                let values = self.real_array(&values);
                parts.push(RowsPart {
                    to: t,
                    from: s,
                    count: places.len() as u32,
                    adds: s > 0,
                    bytes: (values.len() + 4 * columns.len()) as u64,
                    starts: self.upload_bytes("rows of B", bytemuck::cast_slice(&starts))?,
                    targets: self.upload_bytes("rows of B", bytemuck::cast_slice(&places))?,
                    columns: self.upload_bytes("columns of B", bytemuck::cast_slice(&columns))?,
                    values: self.upload_bytes("values of B", &values)?,
                });
            }
        }
        Ok(Rows {
            n_rows: to.len,
            n_cols: from.len,
            parts,
        })
    }

    /// Bytes of `arrays` vectors over one segment.
    pub(super) fn vector_bytes(&self, segment: &Segment, arrays: u64) -> u64 {
        segment.len() as u64 * self.real_bytes() * arrays
    }
}

/// The largest entry of a matrix.
fn largest(k: &dyn SquareBlocks) -> f64 {
    (k.entries().par_iter())
        .with_min_len(1 << 14)
        .map(|v| v.abs())
        .reduce(|| 0.0, f64::max)
}
