//! Which nodes are strongly connected, and their grouping into aggregates.

use crate::sparse::{BlockCsr, ROWS_PER_TASK};
use rayon::prelude::*;
use std::cmp::Reverse;

/// Marks a node without aggregate.
pub(super) const NONE: u32 = u32::MAX;

/// Disjoint groups of nodes; each becomes one node of the coarser level.
#[derive(Clone, Debug)]
pub(super) struct Aggregates {
    /// The aggregate of each node, or [`NONE`].
    pub of_node: Vec<u32>,
    /// Number of aggregates.
    pub count: usize,
}

/// A block that is positive to more than this part of its norm is no bond (see [`strength`]).
const POSITIVE_PART: f64 = 0.5;

/// The strength of each stored block, 0 for the weak ones.
///
/// A block is measured as Sᵢⱼ = Dᵢ^−½ Aᵢⱼ Dⱼ^−½ with D the scalar diagonal, so that neither the materials
/// nor the unit of a component matter. It is strong if ‖Sᵢⱼ‖_F exceeds `theta` times the geometric mean of
/// the largest such norms in rows i and j, and if it is no mass-like block with a large positive trace:
/// those stand between nodes that do *not* hold each other, such as the far nodes of a flat bilinear
/// element, and aggregates across them would represent no smooth error.
pub(super) fn strength<const B: usize>(a: &BlockCsr<B>, theta: f64) -> Vec<f32> {
    let weight: Vec<f64> = (a.diagonal().into_par_iter())
        .with_min_len(ROWS_PER_TASK)
        .map(|v| 1.0 / v.sqrt())
        .collect();
    let weight = weight.as_chunks::<B>().0;
    let mut strength = vec![0.0; a.n_blocks()];
    for_rows(a, &mut strength, |i, cols, blocks, strength| {
        for ((&j, block), strength) in cols.iter().zip(blocks).zip(strength) {
            let (mut square, mut trace) = (0.0, 0.0);
            for p in 0..B {
                for q in 0..B {
                    let value = block[p][q] * weight[i][p] * weight[j as usize][q];
                    square += value * value;
                    if p == q {
                        trace += value;
                    }
                }
            }
            let norm = square.sqrt();
            if j as usize != i && trace < POSITIVE_PART * norm {
                *strength = norm as f32;
            }
        }
    });
    let row_ptr = a.row_ptr();
    let largest: Vec<f32> = (0..a.n_block_rows())
        .into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .map(|i| {
            let row = &strength[row_ptr[i]..row_ptr[i + 1]];
            row.iter().fold(0.0, |largest: f32, &s| largest.max(s))
        })
        .collect();
    for_rows(a, &mut strength, |i, cols, _, strength| {
        for (&j, strength) in cols.iter().zip(strength) {
            if *strength <= theta as f32 * (largest[i] * largest[j as usize]).sqrt() {
                *strength = 0.0;
            }
        }
    });
    strength
}

/// Calls `work(row, columns, blocks, its part of values)` for every block row, in parallel.
fn for_rows<const B: usize, T: Send>(
    a: &BlockCsr<B>,
    mut values: &mut [T],
    work: impl Fn(usize, &[u32], &[[[f64; B]; B]], &mut [T]) + Sync,
) {
    let row_ptr = a.row_ptr();
    let mut tasks = Vec::new();
    for first in (0..a.n_block_rows()).step_by(ROWS_PER_TASK) {
        let last = (first + ROWS_PER_TASK).min(a.n_block_rows());
        let (head, tail) = values.split_at_mut(row_ptr[last] - row_ptr[first]);
        tasks.push((first..last, head));
        values = tail;
    }
    tasks.into_par_iter().for_each(|(rows, mut values)| {
        for i in rows {
            let (cols, blocks) = a.row(i);
            let (head, tail) = values.split_at_mut(cols.len());
            work(i, cols, blocks, head);
            values = tail;
        }
    });
}

/// Groups the nodes in three passes (Vaněk, Mandel, Brezina 1996): a node whose strong neighbours are
/// all free founds an aggregate with them; a node left over joins the aggregate it is tied to most
/// strongly; what is still left is grouped with its free neighbours. Nodes of `alone` get no aggregate. In the first
/// pass nodes take turns by their number or, `busiest_first`, by that of their strong neighbours.
pub(super) fn aggregate<const B: usize>(
    a: &BlockCsr<B>,
    strength: &[f32],
    busiest_first: bool,
    alone: impl Fn(usize) -> bool,
) -> Aggregates {
    let n = a.n_block_rows();
    let row_ptr = a.row_ptr();
    let neighbours = |i: usize| {
        let range = row_ptr[i]..row_ptr[i + 1];
        a.col_idx()[range.clone()]
            .iter()
            .zip(&strength[range])
            .filter(|&(_, &s)| s > 0.0)
            .map(|(&j, &s)| (j as usize, s))
    };
    let mut of_node = vec![NONE; n];
    let mut count = 0;
    let mut turns: Vec<u32> = (0..n as u32).collect();
    if busiest_first {
        turns.sort_by_cached_key(|&i| Reverse(neighbours(i as usize).count()));
    }
    for i in turns.into_iter().map(|i| i as usize) {
        if of_node[i] == NONE
            && !alone(i)
            && neighbours(i).next().is_some()
            && neighbours(i).all(|(j, _)| of_node[j] == NONE)
        {
            of_node[i] = count;
            for (j, _) in neighbours(i) {
                of_node[j] = count;
            }
            count += 1;
        }
    }
    let founded = of_node.clone();
    for i in 0..n {
        if founded[i] == NONE {
            let strongest = neighbours(i)
                .filter(|&(j, _)| founded[j] != NONE)
                .max_by(|x, y| x.1.total_cmp(&y.1));
            if let Some((j, _)) = strongest {
                of_node[i] = founded[j];
            }
        }
    }
    for i in 0..n {
        if of_node[i] == NONE && !alone(i) {
            of_node[i] = count;
            for (j, _) in neighbours(i) {
                if of_node[j] == NONE {
                    of_node[j] = count;
                }
            }
            count += 1;
        }
    }
    Aggregates {
        of_node,
        count: count as usize,
    }
}
