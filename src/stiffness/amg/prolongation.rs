//! Near-null space and the smoothed prolongation.

use super::aggregation::{Graph, Groups, NONE};
use super::product::add_product;
use super::smoother::invert;
use crate::ranks::{Halo, Ranks};
use crate::rigid::Frame;
use crate::sparse::{BlockCsr, ROWS_PER_TASK, collect_rows, vectorised};
use rayon::prelude::*;

/// A column that keeps less than this part of its norm when the columns before it are projected out
/// depends on them.
const RANK_TOLERANCE: f64 = 1e-8;
/// Nodes of an aggregate are on a line if the arm of the rotation about it is less than this part of the largest one. As a
/// coarse unknown it would be a rotation so large that rounding of PᵀAP hides all others: a plate of 60 × 4 × 2 cells looks
/// singular with nodes 1e-8 off lines, takes 44 iterations with 1e-6, and 23 with 1e-5 (3e-4 of the arms).
const ON_A_LINE: f64 = 1e-4;
/// Weight of the own aggregate of a node where the effect of a smoothing step beyond the row is spread over it: its blocks
/// may be as large as three times the others. With equal weights a checkerboard of moduli takes 45 iterations instead of 30. With
/// a weight of 100 uniform quadrilaterals take 12 instead of 10.
const OWN_WEIGHT: f64 = 10.0;

/// The values of M modes at one node with B components.
pub(super) type Modes<const B: usize, const M: usize> = [[f64; M]; B];

/// The first M rigid motions of n nodes about the centre of all: translations and, with coordinates, rotations.
pub(super) fn rigid_body_modes<const D: usize, const M: usize>(
    n: usize,
    coordinates: Option<&[[f64; D]]>,
    ranks: &Ranks,
) -> Vec<Modes<D, M>> {
    let frame = match coordinates {
        // Of size about 1, so that the unit of length does not matter.
        Some(points) => Frame::of_box(&ranks.box_around(points), |edges| {
            edges.into_iter().fold(0.0, f64::max)
        }),
        None => Frame {
            centre: [0.0; D],
            size: 1.0,
        },
    };
    let origin = frame.centre;
    (0..n)
        .into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .map(|i| frame.motions(coordinates.map_or(&origin, |points| &points[i])))
        .collect()
}

/// The components that are tied to nothing: their row has no entry off the diagonal. For a node that is tied to no
/// other node all components count, because the inverse of its block solves it.
fn decoupled<const B: usize>(a: &BlockCsr<B>) -> Vec<[bool; B]> {
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

/// Removes held directions from the modes. These are the components that [`decoupled`] finds, which are returned, and
/// at the nodes of a finest level directions other than the axes that are tied to no other node.
pub(super) fn take_out_held<const B: usize, const M: usize>(
    a: &BlockCsr<B>,
    modes: &mut [Modes<B, M>],
) -> Vec<[bool; B]> {
    let decoupled = decoupled(a);
    let nodes = modes.par_iter_mut().zip(&decoupled).enumerate();
    nodes
        .with_min_len(1 << 12)
        .for_each(|(i, (mode, decoupled))| {
            for (row, _) in mode.iter_mut().zip(decoupled).filter(|(_, held)| **held) {
                *row = [0.0; M];
            }
            // Nodes of bodies: no others have directions.
            let held = match B {
                2 | 3 => held_directions(a, i),
                _ => Vec::new(),
            };
            for n in held {
                for k in 0..M {
                    let part: f64 = (0..B).map(|c| n[c] * mode[c][k]).sum();
                    (0..B).for_each(|c| mode[c][k] -= part * n[c]);
                }
            }
        });
    decoupled
}

/// Orthonormal directions at node i along which its row ties it to no other node. None if all directions are such, or
/// if they are along the axes and nowhere else.
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
    // `decoupled` handles zero rows.
    if !(size > 0.0) || (0..B).any(|c| square[c][c] == 0.0) {
        return Vec::new();
    }
    let small = |n: &[f64; B], tolerance: f64| {
        let tied = (0..B).map(|p| (0..B).map(|q| n[q] * square[q][p]).sum::<f64>().powi(2));
        tied.sum::<f64>().sqrt() <= tolerance * size
    };
    // Gram–Schmidt on the rows of the square spans the tied directions; the rest of the axes is free of ties.
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

/// Removes the part along a unit vector from another one.
fn remove<const B: usize>(v: &mut [f64; B], unit: &[f64; B]) {
    let part: f64 = v.iter().zip(unit).map(|(a, b)| a * b).sum();
    v.iter_mut().zip(unit).for_each(|(v, u)| *v -= part * u);
}

/// The tentative prolongation: node i of aggregate I interpolates by the block Qᵢ from node I. Of nodes and aggregates of other
/// ranks there may be copies ([`Tentative::extend`]).
pub(super) struct Tentative<const B: usize, const M: usize> {
    /// Qᵢ; zero without aggregate. Within an aggregate the nonzero columns are orthonormal.
    pub q: Vec<Modes<B, M>>,
    /// The modes on the coarse level: Qᵢ · coarse[I] are the modes of node i. A zero row means that the
    /// coarse unknown does not exist (its column of Q is zero).
    pub coarse: Vec<Modes<M, M>>,
    /// The factors of Q of own aggregates: the modes of node i times `factors[I]` are Qᵢ. For another node they give its rigid
    /// motion with aggregate I.
    pub factors: Vec<Modes<M, M>>,
}

impl<const B: usize, const M: usize> Tentative<B, M> {
    /// Adds the copies.
    pub fn extend(&mut self, nodes: &Halo, aggregates: &Halo) {
        extend(&mut self.q, nodes);
        extend(&mut self.coarse, aggregates);
    }
}

/// Adds the copies to blocks of rows.
fn extend<const R: usize, const C: usize>(blocks: &mut Vec<[[f64; C]; R]>, halo: &Halo) {
    blocks.resize(halo.own() + halo.copies(), [[0.0; C]; R]);
    halo.update(R * C, blocks.as_flattened_mut().as_flattened_mut());
}

/// Factors the modes of each aggregate as Q R by Gram–Schmidt, each column twice. R has a positive diagonal, with zero
/// rows (and zero columns of Q) where the modes are dependent on the aggregate.
pub(super) fn tentative<const B: usize, const M: usize>(
    modes: &[Modes<B, M>],
    aggregates: &Groups,
) -> Tentative<B, M> {
    let (start, members) = aggregates.members();
    // The three of space; the one of the plane has nothing to be compared with.
    let rotations = if M == 6 { 3..6 } else { 0..0 };
    // Q = (modes) T, so that only T is kept per aggregate while the sums run over its members.
    let (factors, coarse): (Vec<Modes<M, M>>, Vec<Modes<M, M>>) = (0..aggregates.count)
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
            // columns[k]: column k of T. Rotations of space with arms up to this one are left out.
            let factored = |short: f64| {
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
                    if left > RANK_TOLERANCE * full && (!rotations.contains(&k) || left > short) {
                        r[k][k] = left;
                        columns[k] = t.map(|v| v / left);
                    }
                }
                (columns, r)
            };
            let (mut columns, mut r) = factored(0.0);
            let arms = || rotations.clone().map(|k| r[k][k]);
            let short = ON_A_LINE * arms().fold(0.0, f64::max);
            if arms().any(|arm| 0.0 < arm && arm <= short) {
                (columns, r) = factored(short);
            }
            let factor = std::array::from_fn(|p| std::array::from_fn(|k| columns[k][p]));
            (factor, r)
        })
        .unzip();
    let q = modes
        .par_iter()
        .zip(&aggregates.of_node)
        .with_min_len(1 << 12)
        .map(|(mode, &aggregate)| {
            let mut q = [[0.0; M]; B];
            if aggregate != NONE {
                add_product(mode, &factors[aggregate as usize], &mut q);
            }
            q
        })
        .collect();
    Tentative { q, coarse, factors }
}

/// The possible positions of blocks in the prolongation, copies of rows of other ranks included.
#[derive(Debug)]
pub(super) struct Pattern {
    row_ptr: Vec<usize>,
    /// Those of copies are in the order of their own rank.
    cols: Vec<u32>,
}

impl Pattern {
    /// The aggregates of a node and of its neighbours in a graph, and the halo of the aggregates: it has those that own rows and
    /// copies reach. The groups get the aggregates of copies.
    pub fn new(aggregates: &mut Groups, graph: &Graph, nodes: &Halo) -> (Self, Halo) {
        /// The number of a node without aggregate.
        const NOWHERE: u64 = u64::MAX;
        let mut coarse = nodes.of_own(aggregates.count);
        let numbers = (aggregates.of_node.iter())
            .map(|&group| match group {
                NONE => NOWHERE,
                group => coarse.number(group as usize),
            })
            .collect();
        let of_node = nodes.extended(1, numbers);
        let order = coarse.order();
        let (mut row_ptr, mut cols) = collect_rows(nodes.own(), |i, row| {
            let start = row.len();
            if of_node[i] == NOWHERE {
                return;
            }
            row.push(of_node[i]);
            for &(j, _) in graph.of(i) {
                let aggregate = of_node[j as usize];
                if aggregate != NOWHERE && !row[start..].contains(&aggregate) {
                    row.push(aggregate);
                }
            }
            row[start..].sort_unstable_by_key(|&number| order(number));
        });
        nodes.extend_starts(&mut row_ptr);
        cols.resize(row_ptr[row_ptr.len() - 1], NOWHERE);
        nodes.update_rows(|i| row_ptr[i]..row_ptr[i + 1], &mut cols);
        coarse.reach(cols.iter().copied());
        aggregates.of_node = (of_node.iter())
            .map(|&number| match number {
                NOWHERE => NONE,
                number => coarse.place(number),
            })
            .collect();
        let cols = cols.into_iter().map(|number| coarse.place(number));
        let pattern = Self {
            row_ptr,
            cols: cols.collect(),
        };
        (pattern, coarse)
    }

    fn range(&self, i: usize) -> std::ops::Range<usize> {
        self.row_ptr[i]..self.row_ptr[i + 1]
    }
}

/// P = (I − ω₂ D⁻¹A) (I − ω₁ D⁻¹A) Q for the ω given, each step held to the aggregates of a node and of its neighbours
/// in a graph.
///
/// The part that a step would put elsewhere in a row has an effect on rigid motions: Σ_J V_J R_J, where aggregate J has the rigid
/// motions R_J (its coarse unknowns) and the block V_J. [`Step::spread`] gives it to the aggregates of the row. Rigid motions
/// stay exact that way, where leaving the blocks out would cost them. With all neighbours strong a first step is that of
/// ordinary smoothed aggregation.
///
/// After the rows of this rank come copies of those of others, in the columns of [`Pattern::new`].
pub(super) fn smoothed<const B: usize, const M: usize>(
    a: &BlockCsr<B>,
    inverse_diagonal: &[[[f64; B]; B]],
    omegas: &[f64],
    aggregates: &Groups,
    pattern: &Pattern,
    tentative: &Tentative<B, M>,
    [nodes, coarse]: [&Halo; 2],
) -> BlockCsr<B, M> {
    let q = |i: usize| -> (&[u32], &[Modes<B, M>]) {
        let own = &aggregates.of_node[i];
        let there = usize::from(*own != NONE);
        (
            &std::slice::from_ref(own)[..there],
            &std::slice::from_ref(&tentative.q[i])[..there],
        )
    };
    let squares = (tentative.coarse.par_iter())
        .with_min_len(ROWS_PER_TASK)
        .map(|coarse| {
            let mut square = [[0.0; M]; M];
            add_product(&transposed(coarse), coarse, &mut square);
            square
        })
        .collect::<Vec<_>>();
    let mut p: Option<Vec<Modes<B, M>>> = None;
    for &omega in omegas {
        let step = Step {
            a,
            inverse_diagonal,
            omega,
            aggregates,
            tentative,
            squares: &squares,
            pattern,
        };
        let mut after = match &p {
            None => step.of(q),
            Some(p) => step.of(|i| (&pattern.cols[pattern.range(i)], &p[pattern.range(i)])),
        };
        let range = |i| pattern.row_ptr[i] * B * M..pattern.row_ptr[i + 1] * B * M;
        nodes.update_rows(range, after.as_flattened_mut().as_flattened_mut());
        p = Some(after);
    }
    let values = p.unwrap_or_default();
    // Decoupled components leave blocks of zeros. Copies of rows are in the order of their own rank.
    let own = nodes.own();
    let (row_ptr, places) = collect_rows(aggregates.of_node.len(), |i, row| {
        let start = row.len();
        row.extend(pattern.range(i).filter(|&k| {
            let own = pattern.cols[k] == aggregates.of_node[i];
            own || values[k].as_flattened().iter().any(|&v| v != 0.0)
        }));
        if i >= own {
            row[start..].sort_unstable_by_key(|&k| pattern.cols[k]);
        }
    });
    let cols = places.par_iter().map(|&k| pattern.cols[k]).collect();
    let kept = match places.len() == values.len() && own == aggregates.of_node.len() {
        true => values,
        false => places.par_iter().map(|&k| values[k]).collect(),
    };
    let columns = coarse.own() + coarse.copies();
    BlockCsr::from_parts(aggregates.of_node.len(), columns, row_ptr, cols, kept)
}

/// A smoothing step of the prolongation.
struct Step<'a, const B: usize, const M: usize> {
    a: &'a BlockCsr<B>,
    inverse_diagonal: &'a [[[f64; B]; B]],
    omega: f64,
    aggregates: &'a Groups,
    tentative: &'a Tentative<B, M>,
    /// RᵀR of the rigid motions R of each aggregate.
    squares: &'a [Modes<M, M>],
    pattern: &'a Pattern,
}

impl<const B: usize, const M: usize> Step<'_, B, M> {
    /// The blocks after it, on the pattern, of those before it.
    fn of<'a>(
        &self,
        before: impl Fn(usize) -> (&'a [u32], &'a [Modes<B, M>]) + Sync,
    ) -> Vec<Modes<B, M>> {
        let n = self.a.n_block_rows();
        // The effect of the rows on the rigid-body motions.
        let mut motions = vec![[[0.0; M]; B]; self.aggregates.of_node.len()];
        motions
            .par_iter_mut()
            .enumerate()
            .with_min_len(ROWS_PER_TASK)
            .for_each(|(i, motion)| {
                let (cols, blocks) = before(i);
                for (&aggregate, block) in cols.iter().zip(blocks) {
                    add_product(block, &self.tentative.coarse[aggregate as usize], motion);
                }
            });
        let mut after = vec![[[0.0; M]; B]; self.pattern.cols.len()];
        let mut tasks = Vec::new();
        let mut rest = &mut after[..];
        for first in (0..n).step_by(ROWS_PER_TASK) {
            let last = (first + ROWS_PER_TASK).min(n);
            let (head, tail) =
                rest.split_at_mut(self.pattern.row_ptr[last] - self.pattern.row_ptr[first]);
            tasks.push((first..last, head));
            rest = tail;
        }
        tasks.into_par_iter().for_each(|(rows, values)| {
            vectorised!({
                let mut rest = &mut *values;
                for i in rows.clone() {
                    let (row, tail) = rest.split_at_mut(self.pattern.range(i).len());
                    self.row(i, &before, &motions, row);
                    rest = tail;
                }
            });
        });
        after
    }

    /// Row i; `row` holds zeros.
    #[inline(always)]
    fn row<'a>(
        &self,
        i: usize,
        before: &impl Fn(usize) -> (&'a [u32], &'a [Modes<B, M>]),
        motions: &[Modes<B, M>],
        row: &mut [Modes<B, M>],
    ) {
        let columns = &self.pattern.cols[self.pattern.range(i)];
        let place = |aggregate: u32| columns.iter().position(|&c| c == aggregate);
        let Some(own) = place(self.aggregates.of_node[i]) else {
            return;
        };
        let mut is_complete = true;
        let mut elsewhere = [[0.0; M]; B];
        let (a_cols, a_blocks) = self.a.row(i);
        for (&j, block) in a_cols.iter().zip(a_blocks) {
            let (cols, blocks) = before(j as usize);
            for (&aggregate, other) in cols.iter().zip(blocks) {
                // A row meets few aggregates: searching them is faster than any table.
                match place(aggregate) {
                    Some(place) => add_product(block, other, &mut row[place]),
                    None => is_complete = false,
                }
            }
            add_product(block, &motions[j as usize], &mut elsewhere);
        }
        // Otherwise the effect elsewhere is that of rounding.
        if !is_complete {
            for (&aggregate, sum) in columns.iter().zip(&*row) {
                let mut here = [[0.0; M]; B];
                add_product(sum, &self.tentative.coarse[aggregate as usize], &mut here);
                subtract(&mut elsewhere, 1.0, &here);
            }
            self.spread(elsewhere, columns, own, row);
        }
        let (cols, blocks) = before(i);
        for (&aggregate, sum) in columns.iter().zip(row) {
            let mut change = [[0.0; M]; B];
            add_product(&self.inverse_diagonal[i], sum, &mut change);
            let there = cols.iter().position(|&c| c == aggregate);
            *sum = there.map_or([[0.0; M]; B], |place| blocks[place]);
            subtract(sum, self.omega, &change);
        }
    }

    /// Adds blocks with this effect E on rigid motions to a row: the smallest ones, where those of the own aggregate I count a
    /// [`OWN_WEIGHT`]th. They are w_J E T_I G⁻¹ T_Iᵀ R_Jᵀ, G = T_Iᵀ (Σ w_J R_JᵀR_J) T_I: the motions are scaled as the coarse
    /// unknowns of I are.
    #[inline(always)]
    fn spread(&self, effect: Modes<B, M>, columns: &[u32], own: usize, row: &mut [Modes<B, M>]) {
        let factor = &self.tentative.factors[columns[own] as usize];
        let weight = |place: usize| if place == own { OWN_WEIGHT } else { 1.0 };
        let mut squares = [[0.0; M]; M];
        for (place, &aggregate) in columns.iter().enumerate() {
            subtract(
                &mut squares,
                -weight(place),
                &self.squares[aggregate as usize],
            );
        }
        let (mut scaled, mut inverse) = ([[0.0; M]; M], [[0.0; M]; M]);
        add_product(&squares, factor, &mut scaled);
        add_product(&transposed(factor), &scaled, &mut inverse);
        // Unknowns that do not exist.
        for c in (0..M).filter(|&c| factor[c][c] == 0.0) {
            inverse[c][c] = 1.0;
        }
        let mut all = [[0.0; M]; B];
        add_product(&effect, factor, &mut all);
        // Rounding may leave nothing of G where I is very short.
        if !invert(inverse.as_flattened_mut(), [&mut [0.0; M], &mut [0.0; M]]) {
            return subtract(&mut row[own], -1.0, &all);
        }
        let (mut solved, mut parts) = ([[0.0; M]; B], [[0.0; M]; B]);
        add_product(&all, &inverse, &mut solved);
        add_product(&solved, &transposed(factor), &mut parts);
        for (place, block) in row.iter_mut().enumerate() {
            let coarse = transposed(&self.tentative.coarse[columns[place] as usize]);
            let parts = parts.map(|row| row.map(|v| weight(place) * v));
            add_product(&parts, &coarse, block);
        }
    }
}

/// The transpose.
#[inline(always)]
fn transposed<const R: usize, const C: usize>(a: &[[f64; C]; R]) -> [[f64; R]; C] {
    std::array::from_fn(|c| std::array::from_fn(|r| a[r][c]))
}

/// a −= s b.
#[inline(always)]
fn subtract<const B: usize, const M: usize>(a: &mut Modes<B, M>, s: f64, b: &Modes<B, M>) {
    for (a, b) in a.as_flattened_mut().iter_mut().zip(b.as_flattened()) {
        *a -= s * b;
    }
}
