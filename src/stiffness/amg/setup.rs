//! The construction of the hierarchy, level by level.

use super::aggregation::{Groups, NONE, Strength, aggregate, strength, ties, weights};
use super::patches;
use super::prolongation::{Modes, Pattern, rigid_body_modes, smoothed, take_out_held, tentative};
use super::{
    AmgError, AmgSettings, Coarse, Hierarchy, Inverse, Level, Smoother, coarse, product, scale_of,
    smoother,
};
use crate::problem::Vertices;
use crate::sparse::BlockCsr;
use crate::sparse::stored::{BlockMatrix, Real, store};
use std::sync::Arc;

/// Safety factor on the estimate of λ_max(D⁻¹A), which comes from below and was found up to 10 % short.
/// The smoother of degree 2 reduces the error up to about 1.1 times the end of its interval, so that the
/// cycle stays positive definite where this factor is not enough.
const RADIUS_MARGIN: f64 = 1.1;
/// A level whose number of unknowns is smaller by less than this factor is not worth having.
const LEAST_REDUCTION: f64 = 1.5;
/// A coarse unknown with less than this part of the stiffness under it moves freely.
const FREE_LIMIT: f64 = 1e-13;
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
    /// It is inverted.
    Inverse,
    /// It is smoothed, on patches where they pay, and is the last one if it has no aggregates.
    Smoothed {
        patches: Option<Groups>,
        coarser: Option<(Groups, Pattern)>,
    },
}

impl Skeleton {
    /// Without shapes, which the first hierarchy finds.
    pub fn new<const D: usize>(k: &BlockCsr<D>, settings: &AmgSettings) -> Self {
        // The most unknowns whose inverse is within the limit of entries.
        let entries = (D * D * k.n_blocks()) as f64;
        let most = (settings.dense_part * entries).sqrt() as usize;
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

    /// The hierarchy of a K, with M modes.
    pub fn fill<const D: usize, const M: usize, S: Real>(
        self,
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
    ) -> Result<Hierarchy<S>, AmgError> {
        let found = [k.n_block_rows(), k.n_blocks()];
        if found != self.size {
            return Err(AmgError::OtherPattern {
                found,
                expected: self.size,
            });
        }
        let vertices = vertices.filter(|_| k.n_rows() > self.settings.dense_limit);
        let corners = vertices.map(|vertices| vertices.prolongation.n_block_cols());
        if !self.shapes.is_empty() && corners != self.corners {
            return Err(AmgError::OtherCorners);
        }
        let scale = scale_of(k)?;
        let theta = match coordinates {
            Some(_) => [self.settings.theta, self.settings.coarse_theta],
            None => [self.settings.theta_without_points; 2],
        };
        let mut making = Making {
            skeleton: Self { corners, ..self },
            scale,
            theta,
            level: 0,
        };
        let (mut levels, coarse) = match vertices {
            Some(vertices) => to_vertices::<D, M, S>(k, vertices, &mut making)?,
            None => {
                let modes = rigid_body_modes::<D, M>(k.n_block_rows(), coordinates);
                coarsen(k, modes, coordinates, &mut making)?
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
struct Making {
    skeleton: Skeleton,
    scale: f64,
    /// θ of the first level and of those below.
    theta: [f64; 2],
    /// The level whose shape is needed next.
    level: usize,
}

impl Making {
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

    /// Whether the matrix of the next level is inverted before any other analysis.
    fn inverts(&self, n: usize) -> bool {
        match self.skeleton.shapes.get(self.level) {
            Some(shape) => matches!(**shape, Shape::Inverse),
            None => n <= self.skeleton.settings.dense_limit,
        }
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
    ) -> Self {
        let ties = ties(a);
        let weights = weights(a, scale);
        let Strength { strong, pulling } = strength(&ties, &weights, theta, settings.reach, points);
        let aggregates = aggregate(&ties, &strong, settings.busiest_first, |i| {
            decoupled[i] == [true; B]
        });
        let n = a.n_rows();
        let stalled =
            aggregates.count == 0 || (aggregates.count * M) as f64 * LEAST_REDUCTION > n as f64;
        if stalled && n <= settings.stalled_dense_limit {
            return Self::Inverse;
        }
        Self::Smoothed {
            patches: patches::patches(&ties, &strong),
            coarser: (!stalled).then(|| {
                let pattern = Pattern::new(&aggregates, &pulling);
                (aggregates, pattern)
            }),
        }
    }
}

/// The levels of the corners and all below them, then that of K, in the form of [`coarsen`].
fn to_vertices<const D: usize, const M: usize, S: Real>(
    k: &BlockCsr<D>,
    vertices: &Vertices<D>,
    making: &mut Making,
) -> Result<(Vec<Level<S>>, Coarse<S>), AmgError> {
    let p = &vertices.prolongation;
    let r = product::transpose(p);
    let made = (vertices.stiffness.is_none()).then(|| product::galerkin(&r, k, p));
    let matrix = (vertices.stiffness.as_ref())
        .or(made.as_ref())
        .expect("one of both");
    let modes = rigid_body_modes::<D, M>(matrix.n_block_rows(), Some(&vertices.points));
    let (mut levels, coarse) = coarsen(matrix, modes, Some(&vertices.points), making)?;
    drop(made);
    let scale = making.scale;
    let AmgSettings { degree, alpha, .. } = making.skeleton.settings;
    let inverse_diagonal = smoother::inverse_diagonal(k)
        .map_err(|node| AmgError::NotPositiveDefinite { node, block: D })?;
    let inverse = Inverse::Diagonal {
        block: D,
        values: store(inverse_diagonal.as_flattened().as_flattened(), 1.0 / scale),
    };
    let stored = BlockMatrix::new(k, scale);
    let radius = radius::<D, S>(&stored, &inverse)?;
    levels.push(Level {
        smoother: Smoother {
            matrix: stored,
            inverse,
            steps: steps(degree, alpha, radius),
        },
        prolongation: BlockMatrix::new(p, 1.0),
        restriction: BlockMatrix::new(&r, 1.0),
    });
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
) -> Result<f64, AmgError> {
    Some(RADIUS_MARGIN * smoother::spectral_radius::<B, S>(stored, inverse))
        .filter(|&radius| radius > 0.0)
        .ok_or(AmgError::Singular)
}

/// The levels of `a` and all below it, the finest last, and the coarsest.
fn coarsen<const B: usize, const M: usize, const D: usize, S: Real>(
    a: &BlockCsr<B>,
    mut modes: Vec<Modes<B, M>>,
    points: Option<&[[f64; D]]>,
    making: &mut Making,
) -> Result<(Vec<Level<S>>, Coarse<S>), AmgError> {
    let scale = making.scale;
    let inverse = || Ok((Vec::new(), Coarse::Inverse(coarse::inverse(a, scale)?)));
    if making.inverts(a.n_rows()) {
        making.shape(|_, _| Shape::Inverse);
        return inverse();
    }
    let inverse_diagonal = smoother::inverse_diagonal(a)
        .map_err(|node| AmgError::NotPositiveDefinite { node, block: B })?;
    let decoupled = take_out_held(a, &mut modes);
    let shape = making.shape(|settings, theta| {
        Shape::find::<B, M, D>(a, &decoupled, points, scale, settings, theta)
    });
    let Shape::Smoothed { patches, coarser } = &*shape else {
        return inverse();
    };
    let smoothing = smoothing::<B, S>(a, &inverse_diagonal, patches.as_ref(), scale)?;
    let smoother = |degree: usize, alpha: f64| Smoother {
        matrix: BlockMatrix::new(a, scale),
        inverse: smoothing.inverse,
        steps: steps(degree, alpha, smoothing.radius),
    };
    let Some((aggregates, pattern)) = coarser else {
        let last = smoother(COARSE_DEGREE, COARSE_ALPHA);
        return Ok((Vec::new(), Coarse::Smoothed(last)));
    };
    let settings = making.skeleton.settings;
    let tentative = tentative(&modes, aggregates);
    let omegas = (settings.weights).map(|w| w * 4.0 / 3.0 / smoothing.node_radius);
    let p = smoothed(
        a,
        &inverse_diagonal,
        &omegas,
        aggregates,
        pattern,
        &tentative,
    );
    let r = product::transpose(&p);
    let mut matrix = product::galerkin(&r, a, &p);
    if has_free_modes(a, &matrix, aggregates, &tentative.coarse) {
        return Err(AmgError::Singular);
    }
    hold_missing(&mut matrix, &tentative.coarse, 1.0 / scale);
    // Data that is no longer needed is dropped before more is stored, and A is stored last: memory is short while the
    // coarser levels are made.
    let prolongation = BlockMatrix::new(&p, 1.0);
    drop(p);
    let restriction = BlockMatrix::new(&r, 1.0);
    drop(r);
    drop((modes, tentative.q, inverse_diagonal));
    let points = points.map(|points| centres(points, aggregates));
    let (mut levels, last) = coarsen(&matrix, tentative.coarse, points.as_deref(), making)
        // Users know only the blocks of K.
        .map_err(|_| AmgError::Singular)?;
    drop(matrix);
    levels.push(Level {
        smoother: smoother(settings.degree, settings.alpha),
        prolongation,
        restriction,
    });
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
) -> Result<Smoothing<S>, AmgError> {
    let stored = BlockMatrix::new(a, scale);
    let radius = |inverse: &Inverse<S>| radius::<B, S>(&stored, inverse);
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
/// one aggregate.
fn has_free_modes<const B: usize, const M: usize>(
    a: &BlockCsr<B>,
    coarse: &BlockCsr<M>,
    aggregates: &Groups,
    modes: &[Modes<M, M>],
) -> bool {
    let mut largest = vec![0.0_f64; aggregates.count];
    for (&aggregate, diagonal) in (aggregates.of_node.iter()).zip(a.diagonal().chunks(B)) {
        if aggregate != NONE {
            let largest = &mut largest[aggregate as usize];
            *largest = diagonal.iter().fold(*largest, |m, &v| m.max(v));
        }
    }
    let energies = coarse.diagonal();
    (0..aggregates.count).any(|i| {
        (0..M).any(|c| modes[i][c][c] > 0.0 && !(energies[i * M + c] > FREE_LIMIT * largest[i]))
    })
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
