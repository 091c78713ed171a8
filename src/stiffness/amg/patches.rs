//! The approximate inverse of A in the smoother: blocks of nodes, or of patches of a few nodes that hold each other.

use super::aggregation::{Graph, Groups, NONE, ROW};
use super::coarse::SHIFT;
use super::smoother::invert;
use crate::ranks::Ranks;
use crate::sparse::{BlockCsr, ROWS_PER_TASK};
use rayon::prelude::*;

/// Nodes of a patch at most: with three, bodies of graded hexahedra took 17 and 18 iterations instead of 15 and 16.
const MOST_NODES: usize = 4;
/// A patch grows along ties of at least this part of the strongest ties of both nodes; between 0.3 and 0.7 it does not
/// matter.
const PART_OF_STRONGEST: f32 = 0.5;
/// Nodes are in patches if no more than [`ROW`] or this part of their ties are that strong. With all nodes in patches
/// uniform hexahedra took 11 iterations of 6.4 times the bytes of K, as many of 5.7 without.
const PART_OF_TIES: f32 = 1.0 / 3.0;
/// A level has patches if at least this part of its nodes is in one: they take extra passes.
const PART_OF_NODES: f64 = 0.1;

/// Disjoint patches of at most [`MOST_NODES`] nodes that hold each other much more than others. They grow one after the
/// other along the strongest tie of their nodes to a free one. None where there are few. All other nodes are patches of
/// their own.
pub(super) fn patches(ties: &Graph, strong: &Graph, ranks: &Ranks) -> Option<Groups> {
    let n = strong.len();
    let strongest = strong.strongest();
    let holds = |i: usize, tie: f32| tie >= PART_OF_STRONGEST * strongest[i];
    let uneven: Vec<bool> = (0..n)
        .into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .map(|i| {
            let holding = strong
                .of(i)
                .iter()
                .filter(|&&(_, tie)| holds(i, tie))
                .count();
            holding <= ROW || holding as f32 <= PART_OF_TIES * ties.of(i).len() as f32
        })
        .collect();
    let mut of_node = vec![NONE; n];
    let (mut count, mut in_patches) = (0, 0);
    let mut patch = Vec::with_capacity(MOST_NODES);
    for seed in 0..n {
        if of_node[seed] != NONE {
            continue;
        }
        of_node[seed] = count;
        patch.clear();
        patch.push(seed);
        while patch.len() < MOST_NODES && uneven[seed] {
            let next = (patch.iter())
                .flat_map(|&i| {
                    strong
                        .of(i)
                        .iter()
                        .map(move |&(j, tie)| (i, j as usize, tie))
                })
                .filter(|&(i, j, tie)| {
                    of_node[j] == NONE && uneven[j] && holds(i, tie) && holds(j, tie)
                })
                .max_by(|x, y| x.2.total_cmp(&y.2));
            let Some((_, next, _)) = next else {
                break;
            };
            of_node[next] = count;
            patch.push(next);
        }
        if patch.len() > 1 {
            in_patches += patch.len();
        }
        count += 1;
    }
    let mut sums = [in_patches as f64, n as f64];
    ranks.sum(&mut sums);
    let [in_patches, n] = sums;
    (in_patches >= PART_OF_NODES * n && in_patches > 0.0).then_some(Groups {
        of_node,
        count: count as usize,
    })
}

/// The inverses of the diagonal blocks of the patches, as a matrix. The nodes of a patch whose block is not positive
/// definite keep their own.
pub(super) fn inverse<const B: usize>(
    a: &BlockCsr<B>,
    inverse_diagonal: &[[[f64; B]; B]],
    patches: &Groups,
) -> BlockCsr<B> {
    let n = a.n_block_rows();
    let (start, members) = patches.members();
    let inverses: Vec<Option<Vec<f64>>> = (0..patches.count)
        .into_par_iter()
        .with_min_len(256)
        .map(|p| dense_inverse(a, &members[start[p]..start[p + 1]]))
        .collect();
    let (mut row_ptr, mut cols, mut values) = (vec![0], Vec::new(), Vec::new());
    for i in 0..n {
        let patch = patches.of_node[i] as usize;
        match &inverses[patch] {
            Some(inverse) => {
                let nodes = &members[start[patch]..start[patch + 1]];
                let size = B * nodes.len();
                let own = nodes.partition_point(|&node| (node as usize) < i);
                cols.extend_from_slice(nodes);
                values.extend((0..nodes.len()).map(|k| -> [[f64; B]; B] {
                    std::array::from_fn(|p| {
                        std::array::from_fn(|q| inverse[(B * own + p) * size + B * k + q])
                    })
                }));
            }
            None => {
                cols.push(i as u32);
                values.push(inverse_diagonal[i]);
            }
        }
        row_ptr.push(cols.len());
    }
    BlockCsr::from_parts(n, n, row_ptr, cols, values)
}

/// The inverse of the block of several nodes, by rows, its diagonal raised by [`SHIFT`]; None of a single one.
fn dense_inverse<const B: usize>(a: &BlockCsr<B>, nodes: &[u32]) -> Option<Vec<f64>> {
    if nodes.len() == 1 {
        return None;
    }
    let size = B * nodes.len();
    let mut dense = vec![0.0; size * size];
    for (k, &i) in nodes.iter().enumerate() {
        for (l, &j) in nodes.iter().enumerate() {
            for (p, row) in a
                .block(i as usize, j as usize)
                .into_iter()
                .flatten()
                .enumerate()
            {
                let at = (B * k + p) * size + B * l;
                dense[at..at + B].copy_from_slice(row);
            }
        }
    }
    for k in 0..size {
        dense[k * size + k] *= 1.0 + SHIFT;
    }
    let mut rows = vec![0.0; 2 * size];
    invert(&mut dense, rows.split_at_mut(size).into()).then_some(dense)
}
