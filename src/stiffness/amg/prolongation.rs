//! Near-null space and the smoothed prolongation.

use super::aggregation::{Aggregates, NONE};
use super::product::add_product;
use crate::rigid::Frame;
use crate::sparse::{BlockCsr, ROWS_PER_TASK};
use pulp::Arch;
use rayon::prelude::*;

/// A column that keeps less than this part of its norm when the columns before it are projected out
/// depends on them.
const RANK_TOLERANCE: f64 = 1e-8;

/// The values of M modes at one node with B components.
pub(super) type Modes<const B: usize, const M: usize> = [[f64; M]; B];

/// The first M rigid motions of n nodes about the centre of all: translations and, with coordinates, rotations.
pub(super) fn rigid_body_modes<const D: usize, const M: usize>(
    n: usize,
    coordinates: Option<&[[f64; D]]>,
) -> Vec<Modes<D, M>> {
    let frame = match coordinates {
        // Of size about 1, so that the unit of length does not matter.
        Some(points) => Frame::of_box(points, |edges| edges.into_iter().fold(0.0, f64::max)),
        None => Frame {
            centre: [0.0; D],
            size: 1.0,
        },
    };
    let origin = frame.centre;
    (0..n)
        .map(|i| frame.motions(coordinates.map_or(&origin, |points| &points[i])))
        .collect()
}

/// Which components are tied to nothing: their row has no entry off the diagonal. Of a node that is tied
/// to no other node all components count, since the inverse of its block is all it needs.
pub(super) fn decoupled<const B: usize>(a: &BlockCsr<B>) -> Vec<[bool; B]> {
    (0..a.n_block_rows())
        .into_par_iter()
        .with_min_len(1 << 12)
        .map(|i| {
            let mut alone = true;
            let mut decoupled = [true; B];
            let (cols, blocks) = a.row(i);
            for (&j, block) in cols.iter().zip(blocks) {
                let own = j as usize == i;
                for p in 0..B {
                    for q in 0..B {
                        let zero = block[p][q] == 0.0;
                        decoupled[p] &= zero || (own && p == q);
                        alone &= zero || own;
                    }
                }
            }
            if alone { [true; B] } else { decoupled }
        })
        .collect()
}

/// Takes out of the modes at the nodes of a finest level what supports hold there along directions other than the axes:
/// those that no other node is tied to, as [`decoupled`] finds them along the axes.
pub(super) fn take_out_held<const B: usize, const M: usize>(
    a: &BlockCsr<B>,
    modes: &mut [Modes<B, M>],
) {
    // Nodes of bodies: no others have directions.
    if B != 2 && B != 3 {
        return;
    }
    let nodes = modes.par_iter_mut().enumerate().with_min_len(1 << 12);
    nodes.for_each(|(i, mode)| {
        for n in held_directions(a, i) {
            for k in 0..M {
                let part: f64 = (0..B).map(|c| n[c] * mode[c][k]).sum();
                (0..B).for_each(|c| mode[c][k] -= part * n[c]);
            }
        }
    });
}

/// Orthonormal directions at node i along which its row ties it to no other node; none where all are such, or where
/// they are along the axes and nowhere else.
fn held_directions<const B: usize>(a: &BlockCsr<B>, i: usize) -> Vec<[f64; B]> {
    let (cols, blocks) = a.row(i);
    let others = || (cols.iter().zip(blocks)).filter(|&(&j, _)| j as usize != i);
    // Σ Kᵢⱼ Kᵢⱼᵀ, whose kernel they are.
    let mut square = [[0.0; B]; B];
    for (_, block) in others() {
        for p in 0..B {
            for q in 0..B {
                square[p][q] += (0..B).map(|c| block[p][c] * block[q][c]).sum::<f64>();
            }
        }
    }
    let size: f64 = (0..B).map(|c| square[c][c]).sum();
    // Zero rows are what `decoupled` sees.
    if !(size > 0.0) || (0..B).any(|c| square[c][c] == 0.0) {
        return Vec::new();
    }
    let small = |n: &[f64; B], tolerance: f64| {
        let tied = (0..B).map(|p| (0..B).map(|q| n[q] * square[q][p]).sum::<f64>().powi(2));
        tied.sum::<f64>().sqrt() <= tolerance * size
    };
    // Gram–Schmidt on the rows of the square spans what is tied; what is left of the axes is not.
    let mut basis: Vec<[f64; B]> = Vec::with_capacity(B);
    let mut rows = square;
    while let Some((length, row)) = (rows.iter())
        .map(|row| (row.iter().map(|v| v * v).sum::<f64>().sqrt(), *row))
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|&(length, _)| length > 1e-14 * size)
    {
        basis.push(row.map(|v| v / length));
        rows.iter_mut()
            .for_each(|row| remove(row, &basis[basis.len() - 1]));
        if basis.len() == B {
            return Vec::new();
        }
    }
    let tied = basis.len();
    for c in 0..B {
        let mut n = [0.0; B];
        n[c] = 1.0;
        (0..2).for_each(|_| basis.iter().for_each(|before| remove(&mut n, before)));
        let length = n.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length > 0.3 {
            basis.push(n.map(|v| v / length));
        }
    }
    let held = basis.split_off(tied);
    held.into_iter().filter(|n| small(n, 1e-14)).collect()
}

/// Takes the part along a unit vector out of another one.
fn remove<const B: usize>(v: &mut [f64; B], unit: &[f64; B]) {
    let part: f64 = v.iter().zip(unit).map(|(a, b)| a * b).sum();
    v.iter_mut().zip(unit).for_each(|(v, u)| *v -= part * u);
}

/// The tentative prolongation: node i of aggregate I interpolates by the block Qᵢ from node I.
pub(super) struct Tentative<const B: usize, const M: usize> {
    /// Qᵢ; zero without aggregate. Within an aggregate the nonzero columns are orthonormal.
    pub q: Vec<Modes<B, M>>,
    /// The modes on the coarse level: Qᵢ · coarse[I] are the modes of node i. A zero row means that the
    /// coarse unknown does not exist (its column of Q is zero).
    pub coarse: Vec<Modes<M, M>>,
}

/// Factors the modes of each aggregate as Q R by Gram–Schmidt, each column twice; R has a positive
/// diagonal, with zero rows (and zero columns of Q) where the modes are dependent on the aggregate.
pub(super) fn tentative<const B: usize, const M: usize>(
    modes: &[Modes<B, M>],
    aggregates: &Aggregates,
) -> Tentative<B, M> {
    let (start, members) = members(aggregates);
    // Q = (modes) T, so that only T is kept per aggregate while the sums run over its members.
    let factors: Vec<(Modes<M, M>, Modes<M, M>)> = (0..aggregates.count)
        .into_par_iter()
        .with_min_len(256)
        .map(|i| {
            let nodes = &members[start[i]..start[i + 1]];
            let apply = |t: &[f64; M], node: u32| -> [f64; B] {
                modes[node as usize].map(|row| (0..M).map(|k| row[k] * t[k]).sum())
            };
            let dot = |s: &[f64; M], t: &[f64; M]| -> f64 {
                nodes
                    .iter()
                    .map(|&node| {
                        let (x, y) = (apply(s, node), apply(t, node));
                        (0..B).map(|c| x[c] * y[c]).sum::<f64>()
                    })
                    .sum()
            };
            // columns[k]: column k of T.
            let mut columns = [[0.0; M]; M];
            let mut r = [[0.0; M]; M];
            for k in 0..M {
                let mut t = [0.0; M];
                t[k] = 1.0;
                let full = dot(&t, &t).sqrt();
                for _ in 0..2 {
                    for j in 0..k {
                        let c = dot(&columns[j], &t);
                        r[j][k] += c;
                        for p in 0..M {
                            t[p] -= c * columns[j][p];
                        }
                    }
                }
                let left = dot(&t, &t).sqrt();
                if left > RANK_TOLERANCE * full {
                    r[k][k] = left;
                    columns[k] = t.map(|v| v / left);
                }
            }
            (columns, r)
        })
        .collect();
    let q = modes
        .par_iter()
        .zip(&aggregates.of_node)
        .with_min_len(1 << 12)
        .map(|(mode, &aggregate)| {
            let mut q = [[0.0; M]; B];
            if aggregate != NONE {
                let columns = &factors[aggregate as usize].0;
                for c in 0..B {
                    for k in 0..M {
                        q[c][k] = (0..M).map(|p| mode[c][p] * columns[k][p]).sum();
                    }
                }
            }
            q
        })
        .collect();
    Tentative {
        q,
        coarse: factors.into_iter().map(|(_, r)| r).collect(),
    }
}

/// The nodes of each aggregate: `members[start[i]..start[i + 1]]`.
fn members(aggregates: &Aggregates) -> (Vec<usize>, Vec<u32>) {
    let mut start = vec![0; aggregates.count + 1];
    for &aggregate in aggregates.of_node.iter().filter(|&&i| i != NONE) {
        start[aggregate as usize + 1] += 1;
    }
    for i in 0..aggregates.count {
        start[i + 1] += start[i];
    }
    let mut next = start.clone();
    let mut members = vec![0; start[aggregates.count]];
    for (node, &aggregate) in aggregates.of_node.iter().enumerate() {
        if aggregate != NONE {
            members[next[aggregate as usize]] = node as u32;
            next[aggregate as usize] += 1;
        }
    }
    (start, members)
}

/// P = (I − ω D⁻¹A) Q.
pub(super) fn smoothed<const B: usize, const M: usize>(
    a: &BlockCsr<B>,
    inverse_diagonal: &[[[f64; B]; B]],
    omega: f64,
    aggregates: &Aggregates,
    q: &[Modes<B, M>],
) -> BlockCsr<B, M> {
    let n = a.n_block_rows();
    let parts: Vec<(Vec<u32>, Vec<u32>, Vec<Modes<B, M>>)> = (0..n.div_ceil(ROWS_PER_TASK))
        .into_par_iter()
        .map(|task| {
            let rows = task * ROWS_PER_TASK..((task + 1) * ROWS_PER_TASK).min(n);
            Arch::new().dispatch(|| {
                let mut lengths = Vec::with_capacity(rows.len());
                let (mut cols, mut values) = (Vec::new(), Vec::new());
                let mut row: Vec<(u32, Modes<B, M>)> = Vec::new();
                for i in rows {
                    row.clear();
                    let (a_cols, blocks) = a.row(i);
                    for (&j, block) in a_cols.iter().zip(blocks) {
                        let aggregate = aggregates.of_node[j as usize];
                        if aggregate == NONE {
                            continue;
                        }
                        // A row meets few aggregates: looking through them beats any table.
                        let place = row
                            .iter()
                            .position(|&(c, _)| c == aggregate)
                            .unwrap_or_else(|| {
                                row.push((aggregate, [[0.0; M]; B]));
                                row.len() - 1
                            });
                        add_product(block, &q[j as usize], &mut row[place].1);
                    }
                    row.sort_unstable_by_key(|&(c, _)| c);
                    for (aggregate, sum) in &row {
                        let mut value = [[0.0; M]; B];
                        add_product(&inverse_diagonal[i], sum, &mut value);
                        let own = *aggregate == aggregates.of_node[i];
                        for c in 0..B {
                            for k in 0..M {
                                value[c][k] *= -omega;
                                if own {
                                    value[c][k] += q[i][c][k];
                                }
                            }
                        }
                        if own || value.as_flattened().iter().any(|&v| v != 0.0) {
                            cols.push(*aggregate);
                            values.push(value);
                        }
                    }
                    lengths.push(cols.len() as u32);
                }
                (lengths, cols, values)
            })
        })
        .collect();
    let mut row_ptr = vec![0];
    let n_blocks = parts.iter().map(|part| part.1.len()).sum();
    let mut cols = Vec::with_capacity(n_blocks);
    let mut values = Vec::with_capacity(n_blocks);
    for (ends, part_cols, part_values) in parts {
        let before = cols.len();
        row_ptr.extend(ends.into_iter().map(|end| before + end as usize));
        cols.extend_from_slice(&part_cols);
        values.extend_from_slice(&part_values);
    }
    BlockCsr::from_parts(n, aggregates.count, row_ptr, cols, values)
}
