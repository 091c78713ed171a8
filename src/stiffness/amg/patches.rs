//! The inverse of what the smoother takes for A: blocks of nodes, or of patches of a few nodes that hold each other.

use super::aggregation::{Graph, Groups, NONE};
use super::coarse::SHIFT;
use super::smoother::invert;
use crate::sparse::BlockCsr;
use rayon::prelude::*;

/// Nodes of a patch at most.
const MOST_NODES: usize = 4;
/// A patch grows along ties of at least this part of the strongest tie of the node there.
const PART_OF_STRONGEST: f32 = 0.5;
/// A pivot below this part of its diagonal entry counts as zero: a patch that is a body of its own.
const PIVOT_LIMIT: f64 = 1e-10;

/// Disjoint patches of at most [`MOST_NODES`] nodes, grown one after the other along the strongest tie of their nodes
/// to a free one.
pub(super) fn patches(strong: &Graph) -> Groups {
    let n = strong.len();
    let strongest = strong.strongest();
    let mut of_node = vec![NONE; n];
    let mut count = 0;
    let mut patch = Vec::with_capacity(MOST_NODES);
    for seed in 0..n {
        if of_node[seed] != NONE {
            continue;
        }
        of_node[seed] = count;
        patch.clear();
        patch.push(seed);
        while patch.len() < MOST_NODES {
            let next = (patch.iter())
                .flat_map(|&i| {
                    strong
                        .of(i)
                        .iter()
                        .map(move |&(j, tie)| (i, j as usize, tie))
                })
                .filter(|&(i, j, tie)| {
                    of_node[j] == NONE
                        && tie >= PART_OF_STRONGEST * strongest[i]
                        && tie >= PART_OF_STRONGEST * strongest[j]
                })
                .max_by(|x, y| x.2.total_cmp(&y.2));
            let Some((_, next, _)) = next else {
                break;
            };
            of_node[next] = count;
            patch.push(next);
        }
        count += 1;
    }
    Groups {
        of_node,
        count: count as usize,
    }
}

/// The inverses of the diagonal blocks of the patches, as a matrix. The nodes of a patch whose block is not positive
/// definite keep those of their own.
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
            // Nodes of a row need not all be neighbours.
            for (p, row) in a.block(i as usize, j as usize).into_iter().flatten().enumerate() {
                let at = (B * k + p) * size + B * l;
                dense[at..at + B].copy_from_slice(row);
            }
        }
    }
    for k in 0..size {
        dense[k * size + k] *= 1.0 + SHIFT;
    }
    invert(&mut dense, size, PIVOT_LIMIT).then_some(dense)
}
