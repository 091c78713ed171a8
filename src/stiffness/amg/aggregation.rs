//! Strongly connected nodes, and their grouping into aggregates.

use crate::ranks::Halo;
use crate::sparse::{BlockCsr, ROWS_PER_TASK, collect_rows};
use rayon::prelude::*;
use std::cmp::Reverse;

/// Marks a node without aggregate.
pub(super) const NONE: u32 = u32::MAX;

/// Disjoint groups of nodes: aggregates, which become one node each of the coarser level, and the patches of
/// the smoother.
#[derive(Clone, Debug)]
pub(super) struct Groups {
    /// The group of each node, or [`NONE`]. Where there are other ranks, aggregates of copies of their nodes come after those of
    /// own ones.
    pub of_node: Vec<u32>,
    /// Number of groups on this rank.
    pub count: usize,
}

impl Groups {
    /// The nodes of each group, in their order: `members[start[i]..start[i + 1]]`.
    pub fn members(&self) -> (Vec<usize>, Vec<u32>) {
        let mut start = vec![0; self.count + 1];
        for &group in self.of_node.iter().filter(|&&i| (i as usize) < self.count) {
            start[group as usize + 1] += 1;
        }
        for i in 0..self.count {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut members = vec![0; start[self.count]];
        for (node, &group) in self.of_node.iter().enumerate() {
            if (group as usize) < self.count {
                members[next[group as usize]] = node as u32;
                next[group as usize] += 1;
            }
        }
        (start, members)
    }
}

/// The neighbours of each node, with how strongly it is tied to them, by their number.
#[derive(Clone, Debug)]
pub(super) struct Graph {
    start: Vec<usize>,
    neighbours: Vec<(u32, f32)>,
}

impl Graph {
    /// The neighbours of node i.
    pub fn of(&self, i: usize) -> &[(u32, f32)] {
        &self.neighbours[self.start[i]..self.start[i + 1]]
    }

    /// Nodes.
    pub fn len(&self) -> usize {
        self.start.len() - 1
    }

    /// The graph that `row` gives for n nodes, in parallel.
    pub fn collect(n: usize, row: impl Fn(usize, &mut Vec<(u32, f32)>) + Sync) -> Self {
        let (start, neighbours) = collect_rows(n, row);
        Self { start, neighbours }
    }

    /// The same of the neighbours for which `keep` holds.
    pub fn filtered(&self, keep: impl Fn(usize, u32, f32) -> bool + Sync) -> Self {
        Self::collect(self.len(), |i, row| {
            row.extend(self.of(i).iter().filter(|&&(j, tie)| keep(i, j, tie)));
        })
    }

    /// The same without ties to nodes of other ranks.
    pub fn within(self, halo: &Halo) -> Self {
        match halo.copies() {
            0 => self,
            _ => self.filtered(|_, j, _| (j as usize) < halo.own()),
        }
    }

    /// The strongest tie of each node, 0 without any.
    pub fn strongest(&self) -> Vec<f32> {
        (0..self.len())
            .into_par_iter()
            .with_min_len(ROWS_PER_TASK)
            .map(|i| self.of(i).iter().map(|&(_, tie)| tie).fold(0.0, f32::max))
            .collect()
    }
}

/// A block that is positive to more than this part of its norm is not a bond (see [`ties`]).
const POSITIVE_PART: f64 = 0.5;

/// The strength of ties between nodes.
///
/// A block is measured as Sᵢⱼ = Dᵢ^−½ Aᵢⱼ Dⱼ^−½ with D the scalar diagonal, so that neither the materials nor the unit
/// of a component matter; the tie is ‖Sᵢⱼ‖_F. A mass-like block with a large positive trace is not a tie. Such blocks
/// couple nodes that do *not* hold each other, such as the far nodes of a flat bilinear element, and aggregates across
/// them would represent no smooth error.
pub(super) fn ties<const B: usize>(a: &BlockCsr<B>, halo: &Halo) -> Graph {
    let weight: Vec<f64> = (a.diagonal().into_par_iter())
        .with_min_len(ROWS_PER_TASK)
        .map(|v| 1.0 / v.sqrt())
        .collect();
    let weight = halo.extended(B, weight);
    let weight = weight.as_chunks::<B>().0;
    Graph::collect(a.n_block_rows(), |i, row| {
        let (cols, blocks) = a.row(i);
        for (&j, block) in cols.iter().zip(blocks) {
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
            if j as usize != i && norm > 0.0 && trace < POSITIVE_PART * norm {
                row.push((j, norm as f32));
            }
        }
    })
}

/// The strong ties, and the other neighbours that the rows of P follow.
pub(super) struct Strength {
    /// The ties that exceed θ times the geometric mean of the strongest of either node.
    pub strong: Graph,
    /// The strong ones, and those that pull at a node with more than [`PULL`] of the strongest pull.
    pub pulling: Graph,
}

/// A soft node follows a stiff neighbour, although that tie means little to the stiff one. On a checkerboard of moduli
/// 1 and 1e-4 in the plane PCG takes 31 iterations; it takes 43 if only ties with 0.4 of the strongest pull count.
/// Below 0.1 the number does not matter.
const PULL: f32 = 0.05;

/// Sorts the [`ties`] with `theta`; `weight` has the root of the stiffness of each node. Weights and points include
/// those of copies. Where the points of the nodes are known, strong and pulling ties are shorter than `reach` times the
/// geometric mean of the shortest strong one of either node. In elements that are stretched in two directions, the ties
/// along the diagonals are not weak, but long.
pub(super) fn strength<const D: usize>(
    ties: &Graph,
    weight: &[f32],
    theta: f64,
    reach: f64,
    points: Option<&[[f64; D]]>,
    halo: &Halo,
) -> Strength {
    let theta = theta as f32;
    let largest = halo.extended(1, ties.strongest());
    let is_strong =
        |i: usize, j: u32, tie: f32| tie > theta * (largest[i] * largest[j as usize]).sqrt();
    let square = |i: usize, j: u32| match points {
        Some(points) => {
            let (x, y) = (&points[i], &points[j as usize]);
            (0..D).map(|c| (x[c] - y[c]).powi(2)).sum()
        }
        None => 0.0,
    };
    let per_node = |of: &(dyn Fn(usize) -> f64 + Sync)| -> Vec<f64> {
        let nodes = (0..ties.len()).into_par_iter();
        nodes.with_min_len(ROWS_PER_TASK).map(of).collect()
    };
    let nearest = per_node(&|i| {
        let strong = ties.of(i).iter().filter(|&&(j, tie)| is_strong(i, j, tie));
        strong.fold(f64::INFINITY, |least, &(j, _)| least.min(square(i, j)))
    });
    let nearest = halo.extended(1, nearest);
    let most = per_node(&|i| {
        let pulls = ties.of(i).iter().map(|&(j, tie)| tie * weight[j as usize]);
        pulls.fold(0.0, f32::max).into()
    });
    // Written so that points that coincide stay tied.
    let is_near = |i: usize, j: u32| {
        !(square(i, j) > reach * reach * (nearest[i] * nearest[j as usize]).sqrt())
    };
    let strong = |i, j, tie| is_strong(i, j, tie) && is_near(i, j);
    Strength {
        strong: ties.filtered(strong),
        pulling: ties.filtered(|i, j, tie| {
            let pulls = tie * weight[j as usize] > PULL * most[i] as f32 && is_near(i, j);
            pulls || strong(i, j, tie)
        }),
    }
}

/// The root of `scale` times the stiffness of each node, copies included.
pub(super) fn weights<const B: usize>(a: &BlockCsr<B>, scale: f64, halo: &Halo) -> Vec<f32> {
    let own = (a.diagonal().par_chunks(B))
        .with_min_len(ROWS_PER_TASK)
        .map(|d| (scale * d.iter().sum::<f64>()).sqrt() as f32)
        .collect();
    halo.extended(1, own)
}

/// Nodes with so many strong neighbours are on a row of nodes.
pub(super) const ROW: usize = 2;
/// Nodes are thin if they have no more strong neighbours than [`ROW`] or one in so many of all: 4 amid hexahedra, as on a
/// sheet of nodes.
const THIN: usize = 6;

/// The strong graph with second neighbours, from a thin node to another one, tied by half of the weaker of the two ties
/// between. Of the nodes of a row this makes aggregates of five.
fn with_second_neighbours(ties: &Graph, graph: &Graph) -> Graph {
    let thin = |i: usize| graph.of(i).len() <= (ties.of(i).len() / THIN).max(ROW);
    Graph::collect(graph.len(), |i, row| {
        let own = graph.of(i);
        row.extend_from_slice(own);
        if !thin(i) {
            return;
        }
        let first = row.len() - own.len();
        for &(j, tie) in own {
            for &(k, next) in graph.of(j as usize) {
                if k as usize != i
                    && thin(k as usize)
                    && !row[first..].iter().any(|&(other, _)| other == k)
                {
                    row.push((k, 0.5 * tie.min(next)));
                }
            }
        }
    })
}

/// Aggregates of fewer nodes join another one: they have not all rigid-body motions, and no stiffness.
const LEAST_NODES: u32 = 3;

/// Groups the nodes in three passes (Vaněk, Mandel, Brezina 1996). A node whose strong neighbours are all free founds
/// an aggregate with them. A node left over joins the aggregate it is tied to most strongly. The remaining nodes are
/// grouped with their free neighbours. Nodes of `alone` get no aggregate. The order of nodes in the first pass is their
/// number or, `busiest_first`, the number of their strong neighbours.
///
/// Then aggregates of fewer than [`LEAST_NODES`] nodes join the one to which they have the strongest of all `ties`.
pub(super) fn aggregate(
    ties: &Graph,
    strong: &Graph,
    busiest_first: bool,
    alone: impl Fn(usize) -> bool,
) -> Groups {
    let graph = with_second_neighbours(ties, strong);
    let n = graph.len();
    let mut of_node = vec![NONE; n];
    let mut count = 0;
    let mut turns: Vec<u32> = (0..n as u32).collect();
    if busiest_first {
        turns.par_sort_by_cached_key(|&i| Reverse(graph.of(i as usize).len()));
    }
    for i in turns.into_iter().map(|i| i as usize) {
        let neighbours = graph.of(i);
        if of_node[i] == NONE
            && !alone(i)
            && !neighbours.is_empty()
            && neighbours.iter().all(|&(j, _)| of_node[j as usize] == NONE)
        {
            of_node[i] = count;
            for &(j, _) in neighbours {
                of_node[j as usize] = count;
            }
            count += 1;
        }
    }
    let founded = of_node.clone();
    let left = of_node
        .par_iter_mut()
        .enumerate()
        .with_min_len(ROWS_PER_TASK);
    left.filter(|(_, group)| **group == NONE)
        .for_each(|(i, group)| {
            let strongest = (graph.of(i).iter())
                .filter(|&&(j, _)| founded[j as usize] != NONE)
                .max_by(|x, y| x.1.total_cmp(&y.1));
            if let Some(&(j, _)) = strongest {
                *group = founded[j as usize];
            }
        });
    for i in 0..n {
        if of_node[i] == NONE && !alone(i) {
            of_node[i] = count;
            for &(j, _) in graph.of(i) {
                if of_node[j as usize] == NONE {
                    of_node[j as usize] = count;
                }
            }
            count += 1;
        }
    }
    join_small(
        ties,
        Groups {
            of_node,
            count: count as usize,
        },
    )
}

/// Joins groups of fewer than [`LEAST_NODES`] nodes to the one that they are tied to most strongly, one after the other.
fn join_small(ties: &Graph, mut groups: Groups) -> Groups {
    let (start, members) = groups.members();
    let mut size: Vec<u32> = start
        .windows(2)
        .map(|ends| (ends[1] - ends[0]) as u32)
        .collect();
    // The group that a group has joined, itself at first; the last of the chain counts.
    let mut part_of: Vec<u32> = (0..groups.count as u32).collect();
    let last = |part_of: &[u32], mut group: u32| {
        while part_of[group as usize] != group {
            group = part_of[group as usize];
        }
        group
    };
    for i in 0..groups.count {
        if size[i] >= LEAST_NODES || part_of[i] != i as u32 {
            continue;
        }
        let strongest = (members[start[i]..start[i + 1]].iter())
            .flat_map(|&node| ties.of(node as usize))
            .filter(|&&(j, _)| {
                let group = groups.of_node[j as usize];
                group != NONE && last(&part_of, group) != i as u32
            })
            .max_by(|x, y| x.1.total_cmp(&y.1));
        if let Some(&(j, _)) = strongest {
            let to = last(&part_of, groups.of_node[j as usize]);
            part_of[i] = to;
            size[to as usize] += size[i];
        }
    }
    // Numbers without gaps, in their old order.
    let mut number = vec![NONE; groups.count];
    let mut count = 0;
    for i in (0..groups.count).filter(|&i| part_of[i] == i as u32) {
        number[i] = count;
        count += 1;
    }
    for group in groups.of_node.iter_mut().filter(|group| **group != NONE) {
        *group = number[last(&part_of, *group) as usize];
    }
    groups.count = count as usize;
    groups
}
