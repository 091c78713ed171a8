//! The construction of the hierarchy, level by level.

use super::aggregation::{Groups, NONE, Strength, aggregate, strength, ties, weights};
use super::patches;
use super::prolongation::{
    Modes, Pattern, Tentative, rigid_body_modes, smoothed, take_out_held, tentative,
};
use super::{
    AmgError, AmgSettings, Below, Beyond, Coarse, Hierarchy, Inverse, Level, OnRanks, RowsBelow,
    Smoother, coarse, inverse_diagonal, product, scale_of, smoother,
};
use crate::problem::Vertices;
use crate::ranks::{Halo, Ranks};
use crate::sparse::stored::{BlockMatrix, Real, store};
use crate::sparse::{BlockCsr, ROWS_PER_TASK};
use rayon::prelude::*;
use std::sync::Arc;

/// Safety factor on the estimate of λ_max(D⁻¹A), which comes from below and was found up to 10 % short. The smoother of
/// degree 2 reduces the error up to about 1.1 times the end of its interval. So the cycle stays positive definite where
/// this factor is not enough.
const RADIUS_MARGIN: f64 = 1.1;
/// A level whose number of unknowns is smaller by less than this factor is not worth having.
const LEAST_REDUCTION: f64 = 1.5;
/// A coarse unknown with less than this part of the stiffness under it moves freely.
const FREE_LIMIT: f64 = 1e-13;
/// Below the first aggregates, levels with fewer nodes a rank are left to the solver of all ranks, which gathers them on fewer.
/// Aggregates of few nodes a rank are small, because they end at its rim: with 88 nodes on each of 8 ranks PCG took 17 iterations
/// instead of 11. With this limit it takes as many on 16 ranks as on one, and PETSc gets small matrices, whose set-up is slow.
const LEAST_NODES_PER_RANK: u64 = 200;
/// A middle node of an element is far from its corners if it has a neighbour closer by this factor: on uniform elements of all kinds
/// none is. On cells of aspect ratio 3 with 27 nodes PCG takes 31 iterations by the corners, 16 from the nodes.
const STRETCHED: f64 = 3.0;
/// Aggregation begins at the nodes of second-order elements, not at their corners, where more than this part of the middles is far.
/// It is 0 to 0.06 up to an aspect ratio of 2, where the corners are good, and 0.19 to 0.85 where they are not.
const PART_OF_MIDDLES: f64 = 0.1;
/// Degree of the smoother on a coarsest level that is too large for an inverse.
const COARSE_DEGREE: usize = 16;
/// Its α.
const COARSE_ALPHA: f64 = 300.0;

/// The parts of a hierarchy that stay when K gets other values.
#[derive(Clone, Debug)]
pub(super) struct Skeleton {
    settings: AmgSettings,
    /// Nodes and blocks of K.
    size: [usize; 2],
    /// Corners of elements of second order, where it begins with them.
    corners: Option<usize>,
    /// From the first level that is coarsened by aggregates.
    shapes: Vec<Arc<Shape>>,
}

/// The analysis of the matrix of a level.
#[derive(Debug)]
enum Shape {
    /// It is the last one, and solved.
    Solved,
    /// It is smoothed, on patches where they pay, and is the last one if it has no aggregates.
    Smoothed {
        patches: Option<Groups>,
        coarser: Option<Box<(Groups, Pattern, Halo)>>,
    },
}

impl Skeleton {
    /// Without shapes, which the first hierarchy finds.
    pub fn new<const D: usize>(k: &BlockCsr<D>, settings: &AmgSettings, ranks: &Ranks) -> Self {
        // The most unknowns whose inverse is within the limit of entries.
        let mut entries = [(D * D * k.n_blocks()) as f64];
        ranks.sum(&mut entries);
        let most = (settings.dense_part * entries[0]).sqrt() as usize;
        Self {
            settings: AmgSettings {
                dense_limit: settings.dense_limit.min(most),
                ..*settings
            },
            size: [k.n_block_rows(), k.n_blocks()],
            corners: None,
            shapes: Vec::new(),
        }
    }

    /// Whether the matrix has the size of that for which this was made.
    pub fn fits<const D: usize>(&self, k: &BlockCsr<D>) -> bool {
        [k.n_block_rows(), k.n_blocks()] == self.size
    }

    /// The hierarchy of a K, with M modes; of the rows of K on this rank where there are others, and with their halo.
    pub fn fill<const D: usize, const M: usize, S: Real>(
        self,
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
        others: Option<OnRanks>,
    ) -> Result<Hierarchy<S>, AmgError> {
        if !self.fits(k) {
            return Err(AmgError::OtherPattern {
                found: [k.n_block_rows(), k.n_blocks()],
                expected: self.size,
            });
        }
        let alone = Halo::alone(k.n_block_rows());
        let halo = others.map_or(&alone, |others| others.nodes);
        let n = D * halo.all() as usize;
        let vertices = vertices.filter(|_| n > self.settings.dense_limit);
        // The structure stays as it was found, wherever the nodes have moved.
        let vertices = match (self.shapes.is_empty(), coordinates) {
            (true, Some(points)) => vertices.filter(|v| !is_stretched(k, points, v, halo.ranks())),
            (true, None) => vertices,
            (false, _) => vertices.filter(|_| self.corners.is_some()),
        };
        let corners = vertices.map(|vertices| vertices.prolongation.n_block_cols());
        if !self.shapes.is_empty() && corners != self.corners {
            return Err(AmgError::OtherCorners);
        }
        let scale = scale_of(k, halo.ranks())?;
        let theta = match coordinates {
            Some(_) => [self.settings.theta, self.settings.coarse_theta],
            None => [self.settings.theta_without_points; 2],
        };
        let mut making = Making {
            skeleton: Self { corners, ..self },
            scale,
            theta,
            level: 0,
            others,
        };
        let (mut levels, coarse) = match vertices {
            Some(vertices) => to_vertices::<D, M, S>(k, vertices, halo, &mut making)?,
            None => {
                let modes = rigid_body_modes::<D, M>(k.n_block_rows(), coordinates, halo.ranks());
                coarsen(k, modes, coordinates, halo, &mut making)?
            }
        };
        levels.reverse();
        Ok(Hierarchy {
            levels,
            coarse,
            scale,
            skeleton: Some(making.skeleton),
        })
    }
}

/// A hierarchy under construction, level by level.
struct Making<'a> {
    skeleton: Skeleton,
    scale: f64,
    /// θ of the first level and of those below.
    theta: [f64; 2],
    /// The level whose shape is needed next.
    level: usize,
    /// The other ranks, if K is on several.
    others: Option<OnRanks<'a>>,
}

impl Making<'_> {
    /// The shape of the next level, determined now if it is unknown.
    fn shape(&mut self, find: impl FnOnce(&AmgSettings, f64) -> Shape) -> Arc<Shape> {
        let Skeleton {
            shapes, settings, ..
        } = &mut self.skeleton;
        if shapes.len() == self.level {
            let theta = self.theta[self.level.min(1)];
            shapes.push(Arc::new(find(settings, theta)));
        }
        self.level += 1;
        Arc::clone(&shapes[self.level - 1])
    }

    /// Whether the matrix of the next level, in blocks of so many rows, is solved before any other analysis.
    fn solves(&self, block: usize, halo: &Halo) -> bool {
        match self.skeleton.shapes.get(self.level) {
            Some(shape) => matches!(**shape, Shape::Solved),
            None => {
                let least = LEAST_NODES_PER_RANK * halo.ranks().count() as u64;
                let is_below = self.others.is_some() && self.level > 0 && halo.all() < least;
                is_below || block * halo.all() as usize <= self.skeleton.settings.dense_limit
            }
        }
    }

    /// A level from its matrix, P and Pᵀ, whose parts that belong to other ranks are split off. The halos are those of its nodes
    /// and of the nodes of the coarser level.
    fn level_of<S: Real>(
        &self,
        matrix: BlockMatrix<S>,
        [prolongation, restriction]: [BlockMatrix<S>; 2],
        smoother: impl FnOnce(BlockMatrix<S>) -> Smoother<S>,
        [nodes, coarse]: [&Halo; 2],
    ) -> Level<S> {
        if self.others.is_none() {
            return Level {
                smoother: smoother(matrix),
                prolongation,
                restriction,
                beyond: None,
            };
        }
        let (matrix, of_matrix) = matrix.split_columns(nodes.own());
        let (prolongation, of_prolongation) = prolongation.split_columns(coarse.own());
        let (restriction, of_restriction) = restriction.split_rows(coarse.own());
        Level {
            smoother: smoother(matrix),
            prolongation,
            restriction,
            beyond: Some(Beyond {
                nodes: nodes.clone(),
                matrix: of_matrix,
                coarse: coarse.clone(),
                prolongation: of_prolongation,
                restriction: of_restriction,
            }),
        }
    }

    /// The solver for the last level: an inverse, or the one on all ranks.
    fn last<const B: usize, const M: usize, S: Real>(
        &self,
        a: &BlockCsr<B>,
        modes: &[Modes<B, M>],
        halo: &Halo,
    ) -> Result<Coarse<S>, AmgError> {
        let Some(others) = self.others else {
            return Ok(Coarse::Inverse(coarse::inverse(a, self.scale)?));
        };
        let solver = (others.below)(RowsBelow {
            block: B,
            halo,
            row_ptr: a.row_ptr(),
            col_idx: a.col_idx(),
            entries: a.values().as_flattened().as_flattened(),
            n_modes: M,
            modes: modes.as_flattened().as_flattened(),
        })?;
        Ok(Coarse::Below(Below {
            solver,
            unknowns: a.n_rows(),
            scale: self.scale,
        }))
    }
}

impl Shape {
    /// For a matrix with these unconnected components.
    fn find<const B: usize, const M: usize, const D: usize>(
        a: &BlockCsr<B>,
        decoupled: &[[bool; B]],
        points: Option<&[[f64; D]]>,
        scale: f64,
        settings: &AmgSettings,
        theta: f64,
        halo: &Halo,
    ) -> Self {
        let ties = ties(a, halo);
        let weights = weights(a, scale, halo);
        let copied = points.filter(|_| halo.copies() > 0);
        let copied = copied.map(|points| halo.extended(D, points.as_flattened().to_vec()));
        let points = (copied.as_ref()).map_or(points, |points| Some(points.as_chunks().0));
        let reach = settings.reach;
        let Strength { strong, pulling } = strength(&ties, &weights, theta, reach, points, halo);
        // Aggregates and patches are of nodes of one rank; P is smoothed across.
        let (ties, strong) = (ties.within(halo), strong.within(halo));
        let mut aggregates = aggregate(&ties, &strong, settings.busiest_first, |i| {
            decoupled[i] == [true; B]
        });
        let mut sums = [aggregates.count as f64, a.n_rows() as f64];
        halo.ranks().sum(&mut sums);
        let [count, n] = sums;
        let stalled = count == 0.0 || count * M as f64 * LEAST_REDUCTION > n;
        if stalled && (!halo.ranks().is_alone() || n <= settings.stalled_dense_limit as f64) {
            return Self::Solved;
        }
        Self::Smoothed {
            patches: patches::patches(&ties, &strong, halo.ranks()),
            coarser: (!stalled).then(|| {
                let (pattern, coarse) = Pattern::new(&mut aggregates, &pulling, halo);
                Box::new((aggregates, pattern, coarse))
            }),
        }
    }
}

/// Whether elements of second order are too long and flat for their corners to be the next level: many middles have neighbours much
/// closer than the corners around them. Errors there are smooth along the close neighbours, and arbitrary from corner to corner.
fn is_stretched<const D: usize>(
    k: &BlockCsr<D>,
    points: &[[f64; D]],
    vertices: &Vertices<D>,
    ranks: &Ranks,
) -> bool {
    let least = |node: usize, others: &[[f64; D]], columns: &[u32]| {
        let squares = (columns.iter().filter(|&&j| (j as usize) < others.len()))
            .map(|&j| squared_distance(&points[node], &others[j as usize]));
        squares
            .filter(|&square| square > 0.0)
            .fold(f64::INFINITY, f64::min)
    };
    // Middles, and those far from their corners. Corners follow themselves alone, and copies of other ranks do not count.
    let [middles, far] = (0..points.len())
        .into_par_iter()
        .with_min_len(ROWS_PER_TASK)
        .map(|node| {
            let corners = least(node, &vertices.points, vertices.prolongation.row(node).0);
            let nearest = least(node, points, k.row(node).0);
            let is_far = corners > STRETCHED * STRETCHED * nearest;
            [corners < f64::INFINITY, corners < f64::INFINITY && is_far].map(usize::from)
        })
        .reduce(|| [0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
    let mut sums = [middles as f64, far as f64];
    ranks.sum(&mut sums);
    sums[1] > PART_OF_MIDDLES * sums[0]
}

fn squared_distance<const D: usize>(x: &[f64; D], y: &[f64; D]) -> f64 {
    (0..D).map(|c| (x[c] - y[c]).powi(2)).sum()
}

/// The levels of the corners and all below them, then that of K, in the form of [`coarsen`].
fn to_vertices<const D: usize, const M: usize, S: Real>(
    k: &BlockCsr<D>,
    vertices: &Vertices<D>,
    halo: &Halo,
    making: &mut Making,
) -> Result<(Vec<Level<S>>, Coarse<S>), AmgError> {
    let p = &vertices.prolongation;
    let alone = Halo::alone(p.n_block_cols());
    let corners = (making.others.and_then(|others| others.corners)).unwrap_or(&alone);
    let r = product::transpose(p, p.n_block_rows());
    let made = (vertices.stiffness.is_none()).then(|| match making.others {
        None => (product::galerkin(&r, k, p), alone.clone()),
        Some(_) => {
            let (p, reached) = product::with_copies(p, halo, corners);
            let r = product::transpose(&p, halo.own());
            product::collected(product::galerkin(&r, k, &p), &reached)
        }
    });
    let (matrix, columns) = match (&vertices.stiffness, &made) {
        (Some(matrix), _) => (matrix, corners),
        (None, Some((matrix, columns))) => (matrix, columns),
        (None, None) => unreachable!("one of both is there"),
    };
    let points = &vertices.points;
    let modes = rigid_body_modes::<D, M>(points.len(), Some(points), halo.ranks());
    let (mut levels, coarse) = coarsen(matrix, modes, Some(points), columns, making)?;
    drop(made);
    let scale = making.scale;
    let AmgSettings { degree, alpha, .. } = making.skeleton.settings;
    let inverse_diagonal = inverse_diagonal(k, halo.ranks())?;
    let inverse = Inverse::Diagonal {
        block: D,
        values: store(inverse_diagonal.as_flattened().as_flattened(), 1.0 / scale),
    };
    let stored = BlockMatrix::new(k, scale);
    let radius = radius::<D, S>(&stored, &inverse, halo)?;
    let smoother = |matrix| Smoother {
        matrix,
        inverse,
        steps: steps(degree, alpha, radius),
    };
    let transfer = [BlockMatrix::new(p, 1.0), BlockMatrix::new(&r, 1.0)];
    levels.push(making.level_of(stored, transfer, smoother, [halo, corners]));
    Ok((levels, coarse))
}

/// The steps of a smoother for this upper end of the eigenvalues of D⁻¹A.
fn steps<S: Real>(degree: usize, alpha: f64, radius: f64) -> Vec<[S; 2]> {
    smoother::chebyshev(degree, radius / alpha, radius)
        .into_iter()
        .map(|step| step.map(S::from_f64))
        .collect()
}

/// The upper end of the eigenvalues of D⁻¹A. Written so that NaN is refused. An indefinite K may be detected here, and
/// singular ones on the coarsest level.
fn radius<const B: usize, S: Real>(
    stored: &BlockMatrix<S>,
    inverse: &Inverse<S>,
    halo: &Halo,
) -> Result<f64, AmgError> {
    Some(RADIUS_MARGIN * smoother::spectral_radius::<B, S>(stored, inverse, halo))
        .filter(|&radius| radius > 0.0)
        .ok_or(AmgError::Singular)
}

/// The levels of `a` and all below it, the finest last, and the coarsest.
fn coarsen<const B: usize, const M: usize, const D: usize, S: Real>(
    a: &BlockCsr<B>,
    mut modes: Vec<Modes<B, M>>,
    points: Option<&[[f64; D]]>,
    halo: &Halo,
    making: &mut Making,
) -> Result<(Vec<Level<S>>, Coarse<S>), AmgError> {
    let scale = making.scale;
    let decoupled = take_out_held(a, &mut modes);
    if making.solves(B, halo) {
        making.shape(|_, _| Shape::Solved);
        return Ok((Vec::new(), making.last(a, &modes, halo)?));
    }
    let inverse_diagonal = inverse_diagonal(a, halo.ranks())?;
    let shape = making.shape(|settings, theta| {
        Shape::find::<B, M, D>(a, &decoupled, points, scale, settings, theta, halo)
    });
    let Shape::Smoothed { patches, coarser } = &*shape else {
        return Ok((Vec::new(), making.last(a, &modes, halo)?));
    };
    let smoothing = smoothing::<B, S>(a, &inverse_diagonal, patches.as_ref(), scale, halo)?;
    let smoother = |matrix: BlockMatrix<S>, degree: usize, alpha: f64| Smoother {
        matrix,
        inverse: smoothing.inverse,
        steps: steps(degree, alpha, smoothing.radius),
    };
    let Some((aggregates, pattern, coarse)) = coarser.as_deref() else {
        let last = smoother(BlockMatrix::new(a, scale), COARSE_DEGREE, COARSE_ALPHA);
        return Ok((Vec::new(), Coarse::Smoothed(last)));
    };
    let settings = making.skeleton.settings;
    let mut tentative = tentative(&modes, aggregates);
    tentative.extend(halo, coarse);
    let omegas = (settings.weights).map(|w| w * 4.0 / 3.0 / smoothing.node_radius);
    let p = smoothed(
        a,
        &inverse_diagonal,
        &omegas,
        aggregates,
        pattern,
        &tentative,
        [halo, coarse],
    );
    let r = product::transpose(&p, halo.own());
    let (mut matrix, reached) = product::collected(product::galerkin(&r, a, &p), coarse);
    tentative.coarse.truncate(aggregates.count);
    let free = has_free_modes(a, &matrix, aggregates, &tentative);
    if halo.ranks().any(free) {
        return Err(AmgError::Singular);
    }
    hold_missing(&mut matrix, &tentative.coarse, 1.0 / scale);
    // Data that is no longer needed is dropped before more is stored, and A is stored last: memory is short while the
    // coarser levels are made.
    let prolongation = BlockMatrix::new(&p.truncated(halo.own()), 1.0);
    let restriction = BlockMatrix::new(&r, 1.0);
    drop(r);
    drop((modes, tentative.q, inverse_diagonal));
    let points = points.map(|points| centres(points, aggregates));
    let coarser = coarsen(
        &matrix,
        tentative.coarse,
        points.as_deref(),
        &reached,
        making,
    );
    let (mut levels, last) = coarser.map_err(|error| match error {
        AmgError::Below(_) => error,
        // Users know only the blocks of K.
        _ => AmgError::Singular,
    })?;
    drop(matrix);
    let transfer = [prolongation, restriction];
    let smoother = |matrix| smoother(matrix, settings.degree, settings.alpha);
    let matrix = BlockMatrix::new(a, scale);
    levels.push(making.level_of(matrix, transfer, smoother, [halo, coarse]));
    Ok((levels, last))
}

/// D⁻¹ of the smoother, and the upper end of the eigenvalues of D⁻¹A: with that D, and with the blocks of the nodes.
struct Smoothing<S> {
    inverse: Inverse<S>,
    radius: f64,
    node_radius: f64,
}

/// With patches where they pay.
fn smoothing<const B: usize, S: Real>(
    a: &BlockCsr<B>,
    inverse_diagonal: &[[[f64; B]; B]],
    patches: Option<&Groups>,
    scale: f64,
    halo: &Halo,
) -> Result<Smoothing<S>, AmgError> {
    let stored = BlockMatrix::new(a, scale);
    let radius = |inverse: &Inverse<S>| radius::<B, S>(&stored, inverse, halo);
    let diagonal = Inverse::Diagonal {
        block: B,
        values: store(inverse_diagonal.as_flattened().as_flattened(), 1.0 / scale),
    };
    let node_radius = radius(&diagonal)?;
    let (inverse, radius) = match patches {
        Some(patches) => {
            let inverse = patches::inverse(a, inverse_diagonal, patches);
            let inverse = Inverse::Patches(BlockMatrix::new(&inverse, 1.0 / scale));
            let radius = radius(&inverse)?;
            (inverse, radius)
        }
        None => (diagonal, node_radius),
    };
    Ok(Smoothing {
        inverse,
        radius,
        node_radius,
    })
}

/// The means of the points of each aggregate.
fn centres<const D: usize>(points: &[[f64; D]], aggregates: &Groups) -> Vec<[f64; D]> {
    let (start, members) = aggregates.members();
    (start.windows(2))
        .map(|ends| {
            let nodes = &members[ends[0]..ends[1]];
            let sum = |c: usize| nodes.iter().map(|&i| points[i as usize][c]).sum::<f64>();
            std::array::from_fn(|c| sum(c) / nodes.len() as f64)
        })
        .collect()
}

/// Whether a coarse unknown moves without energy, up to rounding: a body without supports has shrunk to
/// one aggregate. Rounding is that of the energies of its nodes alone.
fn has_free_modes<const B: usize, const M: usize>(
    a: &BlockCsr<B>,
    coarse: &BlockCsr<M>,
    aggregates: &Groups,
    tentative: &Tentative<B, M>,
) -> bool {
    let mut alone = vec![[0.0; M]; aggregates.count];
    let nodes = aggregates.of_node.iter().zip(&tentative.q);
    for ((&aggregate, q), diagonal) in nodes.zip(a.diagonal().chunks(B)) {
        if aggregate != NONE {
            for (row, stiffness) in q.iter().zip(diagonal) {
                let sums = alone[aggregate as usize].iter_mut().zip(row);
                sums.for_each(|(sum, v)| *sum += v * v * stiffness);
            }
        }
    }
    let energies = coarse.diagonal();
    (alone.iter().zip(energies.chunks(M)).zip(&tentative.coarse)).any(
        |((alone, energies), modes)| {
            (0..M).any(|c| modes[c][c] > 0.0 && !(energies[c] > FREE_LIMIT * alone[c]))
        },
    )
}

/// Gives missing coarse unknowns (zero rows in their modes) a decoupled diagonal entry, so that the coarse matrix is
/// not singular.
fn hold_missing<const M: usize>(a: &mut BlockCsr<M>, modes: &[Modes<M, M>], value: f64) {
    for (i, mode) in modes.iter().enumerate() {
        for c in 0..M {
            if mode[c][c] == 0.0
                && let Some(block) = a.block_mut(i, i)
            {
                block[c][c] = value;
            }
        }
    }
}
