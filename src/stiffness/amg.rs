//! Algebraic multigrid by smoothed aggregation (Vaněk, Mandel, Brezina 1996): the hierarchy and its
//! V-cycle, a preconditioner z = M r ≈ K⁻¹ r for conjugate gradients.
//!
//! Nodes that are strongly coupled are grouped into aggregates. On each aggregate the rigid body modes
//! (in the plane two translations and one rotation, in space three and three) give as many coarse unknowns; this
//! tentative prolongation Q is smoothed by one step of a damped Jacobi iteration, P = (I − ω D⁻¹A) Q, and the coarse
//! matrix is PᵀAP. So level 0 has 2 × 2 (3 × 3) blocks, the levels below 3 × 3 (6 × 6) blocks, and those of level 0 if
//! there are no coordinates to make rotations from. D is the block diagonal.
//!
//! A fixed component of a node, which K holds as a decoupled diagonal entry, takes no part in the modes; a
//! node that is tied to no other has no aggregate and is solved by the smoother. Where the modes are
//! dependent on an aggregate (a single node has two), the coarse unknowns that do not exist are held by a
//! diagonal entry of their own.
//!
//! Everything is computed in f64 and then stored as `S`, f32 by default, with K scaled by a power of two
//! to entries of about 1, so that the units of the problem do not matter.

mod aggregation;
mod coarse;
mod cycle;
mod product;
mod prolongation;
mod smoother;
#[cfg(test)]
mod tests;

pub use cycle::Multigrid;

use crate::sparse::BlockCsr;
use crate::sparse::stored::{BlockMatrix, Dense, Real, power_of_two_below, store};
use aggregation::{Aggregates, NONE, aggregate, strength};
use prolongation::{Modes, decoupled, rigid_body_modes, smoothed, take_out_held, tentative};
use std::fmt;

/// Settings of the hierarchy; those of [`Settings::of_dimension`] were measured, see the tests. The default is that of
/// the plane.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// θ: nodes i and j are strongly coupled if their block counts for more than θ times the largest
    /// block of either (the geometric mean of the two).
    pub theta: f64,
    /// θ on the levels below the finest.
    pub coarse_theta: f64,
    /// Whether the nodes with the most strong neighbours found their aggregates first. Their aggregates are larger, and
    /// there are fewer; otherwise nodes take turns by their number.
    pub busiest_first: bool,
    /// Degree of the Chebyshev smoother, at least 1.
    pub degree: usize,
    /// α > 1: the smoother works on the eigenvalues of D⁻¹A in [λ_max / α, λ_max].
    pub alpha: f64,
    /// Levels with at most this many unknowns are solved with their inverse.
    pub dense_limit: usize,
    /// Unless the inverse has more entries than this part of those of K.
    pub dense_part: f64,
    /// Unknowns that may be solved with their inverse where no coarser level can be made.
    pub stalled_dense_limit: usize,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            theta: 0.38,
            coarse_theta: 0.35,
            busiest_first: false,
            degree: 2,
            alpha: 10.0,
            dense_limit: 800,
            dense_part: f64::INFINITY,
            stalled_dense_limit: 2000,
        }
    }
}

impl Settings {
    /// What suits bodies of a dimension. In space a row has three times the blocks and a coarse block four times the
    /// entries: all but the weakest neighbours belong to an aggregate there, which holds the complexity down.
    pub fn of_dimension(dimension: usize) -> Self {
        match dimension {
            3 => Self {
                theta: 0.2,
                busiest_first: true,
                dense_part: 0.1,
                ..Self::default()
            },
            _ => Self::default(),
        }
    }
}

/// Safety factor on the estimate of λ_max(D⁻¹A), which comes from below and was found up to 10 % short.
/// The smoother of degree 2 reduces the error up to about 1.1 times the end of its interval, so that the
/// cycle stays positive definite where this factor is not enough.
const RADIUS_MARGIN: f64 = 1.1;
/// A level that has fewer unknowns by less than this factor is not worth having.
const LEAST_REDUCTION: f64 = 1.5;
/// A coarse unknown with less than this part of the stiffness under it moves freely.
const FREE_LIMIT: f64 = 1e-13;
/// Degree of the smoother on a coarsest level that is too large for an inverse.
const COARSE_DEGREE: usize = 16;
/// Its α.
const COARSE_ALPHA: f64 = 300.0;

/// Why there is no hierarchy for K.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AmgError {
    /// Not a square matrix of a plane or of space.
    #[error("the stiffness matrix has no unknowns, or is not square")]
    Shape,
    /// Not a point per node.
    #[error("there are {found} points for {expected} nodes")]
    Coordinates {
        /// Points.
        found: usize,
        /// Nodes.
        expected: usize,
    },
    /// The block of a node on the diagonal is not definite.
    #[error(
        "the stiffness matrix is not positive definite at the unknowns {first} to {last}: \
         a part of a body has no stiffness, or an entry is not a finite number",
        first = block * node + 1, last = block * (node + 1)
    )]
    NotPositiveDefinite {
        /// The node, from 0.
        node: usize,
        /// Unknowns of a node.
        block: usize,
    },
    /// A motion has no stiffness.
    #[error(
        "the stiffness matrix is singular, or not positive definite: a part of a body has no stiffness or hangs \
         on a hinge: check that its parts are connected by more than a point. Bodies that can move as a whole \
         need coordinates, which tell their rigid motions, or supports"
    )]
    Singular,
    /// Indices have 32 bits.
    #[error("the stiffness matrix has too many entries for 32-bit indices")]
    TooLarge,
}

/// A level that is smoothed: its matrix and the way to the next coarser one.
#[derive(Clone, Debug)]
pub struct Level<S> {
    /// Matrix and smoother.
    pub(crate) smoother: Smoother<S>,
    /// P, from the coarser level to this one.
    pub(crate) prolongation: BlockMatrix<S>,
    /// Pᵀ, stored for access by rows.
    pub(crate) restriction: BlockMatrix<S>,
}

/// A matrix and the Chebyshev iteration in D⁻¹A that smooths with it.
#[derive(Clone, Debug)]
pub struct Smoother<S> {
    /// A, with square blocks.
    pub(crate) matrix: BlockMatrix<S>,
    /// The blocks of D⁻¹, row by row.
    pub(crate) inverse_diagonal: Vec<S>,
    /// (c₁, c₂) of each step d ← c₁ d + c₂ D⁻¹(b − A x), x ← x + d; the first c₁ is 0.
    pub(crate) steps: Vec<[S; 2]>,
}

/// What is done on the coarsest level.
#[derive(Clone, Debug)]
pub enum Coarse<S> {
    /// A product with the inverse.
    Inverse(Dense<S>),
    /// D⁻¹, the blocks row by row: block-Jacobi, the only level where there is no multigrid.
    Diagonal {
        /// Rows of a block.
        block: usize,
        /// Entries.
        values: Vec<S>,
    },
    /// More smoothing, where the coarsest level is too large for an inverse. A singular matrix is not
    /// noticed then.
    Smoothed(Smoother<S>),
}

/// The preconditioner M: one V-cycle on scale · K.
#[derive(Clone, Debug)]
pub struct Hierarchy<S = f32> {
    /// The smoothed levels, finest first; none if K is small enough for an inverse.
    pub(crate) levels: Vec<Level<S>>,
    /// The level below them.
    pub(crate) coarse: Coarse<S>,
    /// The power of two that K was multiplied with.
    pub scale: f64,
}

/// Sizes of one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelSize {
    /// Unknowns.
    pub unknowns: usize,
    /// Stored scalar entries of the matrix, or of its inverse.
    pub entries: usize,
    /// Bytes of all that is stored for the level.
    pub bytes: usize,
}

impl<S: Real> Hierarchy<S> {
    /// The hierarchy for a symmetric positive definite K, with one point per block row if they are
    /// known (without, rotations are not represented and more iterations are needed).
    pub fn new<const D: usize>(
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        settings: &Settings,
    ) -> Result<Self, AmgError> {
        let n = k.n_block_rows();
        if n == 0 || k.n_block_cols() != n {
            return Err(AmgError::Shape);
        }
        if k.n_blocks() > u32::MAX as usize / 2 {
            return Err(AmgError::TooLarge);
        }
        match coordinates {
            Some(points) if points.len() != n => Err(AmgError::Coordinates {
                found: points.len(),
                expected: n,
            }),
            None => Self::build::<D, D>(k, None, settings),
            Some(_) => match D {
                2 => Self::build::<D, 3>(k, coordinates, settings),
                3 => Self::build::<D, 6>(k, coordinates, settings),
                _ => Err(AmgError::Shape),
            },
        }
    }

    /// Block-Jacobi: the inverses of the blocks on the diagonal.
    pub fn block_jacobi<const D: usize>(k: &BlockCsr<D>) -> Result<Self, AmgError> {
        let scale = scale_of(k)?;
        let inverse = smoother::inverse_diagonal(k)
            .map_err(|node| AmgError::NotPositiveDefinite { node, block: D })?;
        Ok(Self {
            levels: Vec::new(),
            coarse: Coarse::Diagonal {
                block: D,
                values: store(inverse.as_flattened().as_flattened(), 1.0 / scale),
            },
            scale,
        })
    }

    /// The hierarchy with M modes.
    fn build<const D: usize, const M: usize>(
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        settings: &Settings,
    ) -> Result<Self, AmgError> {
        let scale = scale_of(k)?;
        let modes = rigid_body_modes::<D, M>(k.n_block_rows(), coordinates);
        let mut levels = Vec::new();
        // Unknowns of which an inverse has as many entries as it may.
        let entries = (D * D * k.n_blocks()) as f64;
        let settings = &Settings {
            dense_limit: (settings.dense_limit)
                .min((settings.dense_part * entries).sqrt() as usize),
            ..*settings
        };
        let mut step = coarsen::<D, M, S>(k, modes, scale, settings.theta, settings)?;
        loop {
            match step {
                Step::Last(coarse) => {
                    return Ok(Self {
                        levels,
                        coarse,
                        scale,
                    });
                }
                Step::Coarser {
                    level,
                    matrix,
                    modes,
                } => {
                    levels.push(*level);
                    step =
                        coarsen::<M, M, S>(&matrix, modes, scale, settings.coarse_theta, settings)
                            // Only the blocks of K can be named to the user.
                            .map_err(|_| AmgError::Singular)?;
                }
            }
        }
    }

    /// Whether all rigid motions are represented on the coarser levels; without rotations the cycle misses
    /// the soft modes of bending.
    pub(crate) fn has_rotations(&self) -> bool {
        let has = |level: &Level<S>| {
            let [fine, coarse] = level.prolongation.block();
            coarse > fine
        };
        self.levels.first().is_none_or(has) && self.is_multigrid()
    }

    /// Whether it is more than block-Jacobi.
    pub(crate) fn is_multigrid(&self) -> bool {
        !matches!(self.coarse, Coarse::Diagonal { .. })
    }

    /// Sizes of all levels, finest first.
    pub fn sizes(&self) -> Vec<LevelSize> {
        let smoothed = |smoother: &Smoother<S>| LevelSize {
            unknowns: smoother.matrix.n_rows(),
            entries: smoother.matrix.values().len(),
            bytes: smoother.matrix.bytes() + size_of_val(&smoother.inverse_diagonal[..]),
        };
        let mut sizes: Vec<LevelSize> = (self.levels.iter())
            .map(|level| {
                let size = smoothed(&level.smoother);
                LevelSize {
                    bytes: size.bytes + level.prolongation.bytes() + level.restriction.bytes(),
                    ..size
                }
            })
            .collect();
        sizes.push(match &self.coarse {
            Coarse::Inverse(inverse) => LevelSize {
                unknowns: inverse.n(),
                entries: inverse.values().len(),
                bytes: size_of_val(inverse.values()),
            },
            Coarse::Diagonal { block, values } => LevelSize {
                unknowns: values.len() / block,
                entries: values.len(),
                bytes: size_of_val(&values[..]),
            },
            Coarse::Smoothed(smoother) => smoothed(smoother),
        });
        sizes
    }

    /// Bytes that one V-cycle must move: each pass reads its inputs once and writes its outputs once.
    pub fn cycle_bytes(&self) -> usize {
        let vector = |n: usize| n * size_of::<S>();
        // The first step reads D⁻¹ and b and writes d and x; the others read A, D⁻¹, b, x, d and write
        // d and the new x.
        let smoothing = |smoother: &Smoother<S>, steps: usize, from_zero: bool| {
            let n = vector(smoother.matrix.n_rows());
            let diagonal = size_of_val(&smoother.inverse_diagonal[..]);
            let others = steps - usize::from(from_zero);
            others * (smoother.matrix.bytes() + diagonal + 5 * n)
                + usize::from(from_zero) * (diagonal + 3 * n)
        };
        let levels: usize = (self.levels.iter())
            .map(|level| {
                let (smoother, p) = (&level.smoother, &level.prolongation);
                let (fine, coarse) = (vector(p.n_rows()), vector(p.n_cols()));
                let degree = smoother.steps.len();
                smoothing(smoother, degree, true)
                    + smoothing(smoother, degree, false)
                    + (smoother.matrix.bytes() + 3 * fine)
                    + (level.restriction.bytes() + fine + coarse)
                    + (p.bytes() + 2 * fine + coarse)
            })
            .sum();
        levels
            + match &self.coarse {
                Coarse::Inverse(dense) => size_of_val(dense.values()) + 2 * vector(dense.n()),
                Coarse::Diagonal { block, values } => {
                    size_of_val(&values[..]) + 3 * vector(values.len() / block)
                }
                Coarse::Smoothed(smoother) => smoothing(smoother, smoother.steps.len(), true),
            }
    }

    /// Stored matrix entries of all levels over those of the finest; the inverse counts in full.
    pub fn operator_complexity(&self) -> f64 {
        let sizes = self.sizes();
        sizes.iter().map(|size| size.entries as f64).sum::<f64>() / sizes[0].entries as f64
    }
}

/// A table of the levels.
impl<S: Real> fmt::Display for Hierarchy<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sizes = self.sizes();
        writeln!(
            f,
            "{:>5} {:>10} {:>12} {:>9}",
            "level", "unknowns", "entries", "MiB"
        )?;
        let mib = |bytes: usize| bytes as f64 / f64::from(1 << 20);
        for (i, size) in sizes.iter().enumerate() {
            writeln!(
                f,
                "{i:5} {:10} {:12} {:9.2}",
                size.unknowns,
                size.entries,
                mib(size.bytes)
            )?;
        }
        let how = match &self.coarse {
            Coarse::Inverse(_) => "inverse",
            Coarse::Diagonal { .. } => "block-Jacobi",
            Coarse::Smoothed(_) => "smoothing",
        };
        write!(
            f,
            "coarsest level by {how}, operator complexity {:.2}, {:.1} MiB",
            self.operator_complexity(),
            mib(sizes.iter().map(|size| size.bytes).sum())
        )
    }
}

/// A power of two, so that scaling costs no digit, that brings the diagonal of K near one.
fn scale_of<const D: usize>(k: &BlockCsr<D>) -> Result<f64, AmgError> {
    let largest = k.diagonal().into_iter().fold(0.0, f64::max);
    if largest > 0.0 && largest.is_finite() {
        Ok(power_of_two_below(largest).recip())
    } else {
        Err(AmgError::NotPositiveDefinite { node: 0, block: D })
    }
}

/// What coarsening one level gave.
enum Step<const M: usize, S> {
    /// A smoothed level, and the matrix and the modes of the one below.
    Coarser {
        level: Box<Level<S>>,
        matrix: BlockCsr<M>,
        modes: Vec<Modes<M, M>>,
    },
    /// The level is the coarsest.
    Last(Coarse<S>),
}

/// Makes the level of `a` and the matrix below it, or finishes with `a`.
fn coarsen<const B: usize, const M: usize, S: Real>(
    a: &BlockCsr<B>,
    mut modes: Vec<Modes<B, M>>,
    scale: f64,
    theta: f64,
    settings: &Settings,
) -> Result<Step<M, S>, AmgError> {
    let n = a.n_rows();
    if n <= settings.dense_limit {
        return Ok(Step::Last(Coarse::Inverse(coarse::inverse(a, scale)?)));
    }
    let inverse_diagonal = smoother::inverse_diagonal(a)
        .map_err(|node| AmgError::NotPositiveDefinite { node, block: B })?;
    let decoupled = decoupled(a);
    for (mode, decoupled) in modes.iter_mut().zip(&decoupled) {
        for c in 0..B {
            if decoupled[c] {
                mode[c] = [0.0; M];
            }
        }
    }
    take_out_held(a, &mut modes);
    let aggregates = {
        let strength = strength(a, theta);
        aggregate(a, &strength, settings.busiest_first, |i| {
            decoupled[i] == [true; B]
        })
    };
    let stalled = (aggregates.count * M) as f64 * LEAST_REDUCTION > n as f64;
    if (stalled || aggregates.count == 0) && n <= settings.stalled_dense_limit {
        return Ok(Step::Last(Coarse::Inverse(coarse::inverse(a, scale)?)));
    }
    let stored = BlockMatrix::new(a, scale);
    let stored_inverse = store(inverse_diagonal.as_flattened().as_flattened(), 1.0 / scale);
    let radius = RADIUS_MARGIN * smoother::spectral_radius::<B, S>(&stored, &stored_inverse);
    // Written so that NaN is refused. An indefinite K may show here, and singular ones on the coarsest
    // level.
    if !(radius > 0.0) {
        return Err(AmgError::Singular);
    }
    let smoother = |degree: usize, alpha: f64| Smoother {
        matrix: stored,
        inverse_diagonal: stored_inverse,
        steps: smoother::chebyshev(degree, radius / alpha, radius)
            .into_iter()
            .map(|step| step.map(S::from_f64))
            .collect(),
    };
    if stalled || aggregates.count == 0 {
        return Ok(Step::Last(Coarse::Smoothed(smoother(
            COARSE_DEGREE,
            COARSE_ALPHA,
        ))));
    }
    let tentative = tentative(&modes, &aggregates);
    let omega = 4.0 / 3.0 / radius;
    let p = smoothed(a, &inverse_diagonal, omega, &aggregates, &tentative.q);
    let r = product::transpose(&p);
    let mut matrix = product::galerkin(&r, a, &p);
    if has_free_modes(a, &matrix, &aggregates, &tentative.coarse) {
        return Err(AmgError::Singular);
    }
    hold_missing(&mut matrix, &tentative.coarse, 1.0 / scale);
    let level = Box::new(Level {
        smoother: smoother(settings.degree, settings.alpha),
        prolongation: BlockMatrix::new(&p, 1.0),
        restriction: BlockMatrix::new(&r, 1.0),
    });
    Ok(Step::Coarser {
        level,
        matrix,
        modes: tentative.coarse,
    })
}

/// Whether a coarse unknown moves without energy, up to rounding: a body without supports has shrunk to
/// one aggregate.
fn has_free_modes<const B: usize, const M: usize>(
    a: &BlockCsr<B>,
    coarse: &BlockCsr<M>,
    aggregates: &Aggregates,
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

/// Gives coarse unknowns that do not exist (a zero row in their modes) a diagonal entry of their own, so
/// that the coarse matrix is not singular.
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
