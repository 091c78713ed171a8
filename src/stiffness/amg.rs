//! Algebraic multigrid by smoothed aggregation (Vaněk, Mandel, Brezina 1996): the hierarchy and its V-cycle, a preconditioner
//! z = M r ≈ K⁻¹ r for conjugate gradients.
//!
//! Nodes that are strongly coupled are grouped into aggregates. On each aggregate the rigid body modes (in the plane
//! two translations and one rotation, in space three and three) give as many coarse unknowns. Two steps of a damped
//! Jacobi iteration smooth this tentative prolongation Q, P = (I − ω₂ D⁻¹A)(I − ω₁ D⁻¹A) Q. The coarse matrix is PᵀAP.
//! So level 0 has 2 × 2 (3 × 3) blocks, the levels below 3 × 3 (6 × 6) blocks, and those of level 0 without coordinates
//! for the rotations.
//!
//! Where elements are many times as long as wide, three things matter. Only neighbours that are also near count as
//! strong: ties along the diagonals of flat elements are not weak. P has blocks only for the aggregates of a node and
//! of the nodes that pull at it, while all other neighbours move rigidly with the node's own aggregate. So rigid-body
//! motions stay exact, and the coarse matrices sparse. The D of the smoother consists of the blocks of patches of up to
//! four nodes that hold each other much more than others. Elsewhere it consists of the blocks of nodes, as everywhere
//! in P.
//!
//! A fixed component of a node, which K holds as a decoupled diagonal entry, has no part in the modes. A node that is
//! tied to no other has no aggregate; the smoother solves it. Where the modes are dependent on an aggregate (a single
//! node has two), the missing coarse unknowns have decoupled diagonal entries.
//!
//! Elements of second order: the level below K is that of their corners, which the middles follow linearly. The matrix
//! there is that of the elements of first order, where aggregation begins. Aggregates of all nodes would take half as
//! many iterations more, and a third more memory.
//!
//! Everything is computed in f64 and then stored as `S`, f32 by default. K is scaled by a power of two to entries of
//! about 1, so that the units of the problem do not matter.

mod aggregation;
mod coarse;
mod cycle;
mod patches;
mod product;
mod prolongation;
mod setup;
mod smoother;
#[cfg(test)]
mod tests;

pub use cycle::Multigrid;

use crate::problem::Vertices;
use crate::ranks::{Halo, Ranks};
use crate::sparse::BlockCsr;
use crate::sparse::stored::{BlockMatrix, Dense, Real, power_of_two_below, store};
use setup::Skeleton;
use std::fmt;
use std::sync::Arc;

/// Settings of the hierarchy; those of [`AmgSettings::of_dimension`] were measured, see the tests. The default is that of
/// the plane.
#[derive(Clone, Copy, Debug)]
pub struct AmgSettings {
    /// θ: nodes i and j are strongly coupled if their block exceeds θ times the geometric mean of the largest blocks of
    /// the two.
    pub theta: f64,
    /// θ on the levels below the finest.
    pub coarse_theta: f64,
    /// θ on all levels without coordinates, where [`AmgSettings::reach`] cannot help: with 0.4 bodies of graded
    /// hexahedra take 24 iterations, with 0.2 more than 60.
    pub theta_without_points: f64,
    /// Strong neighbours are closer than this times the geometric mean of the distances of the closest of either. From
    /// 2.5 to 4 bodies of graded hexahedra take 15 to 17 iterations, 59 and 75 without. Triangles, whose closest
    /// neighbour may be very close, prefer 4 (21 instead of 23 on flat ones).
    pub reach: f64,
    /// Weights of the two smoothing steps of the prolongation, in units of 4/3 over the spectral radius of D⁻¹A with
    /// the blocks of the nodes. A single step of 1 takes 20 to 40 % more iterations. (1, 2) and (0.85, 2.3) differ
    /// little: the former is better in the plane (12 for 13), the latter on large graded bodies (17 for 19).
    pub weights: [f64; 2],
    /// Whether the nodes with the most strong neighbours found their aggregates first. This makes fewer and larger
    /// aggregates; otherwise the order is that of their numbers.
    pub busiest_first: bool,
    /// Degree of the Chebyshev smoother, at least 1.
    pub degree: usize,
    /// α > 1: the smoother works on the eigenvalues of D⁻¹A in [λ_max / α, λ_max].
    pub alpha: f64,
    /// Levels with at most this many unknowns are solved with their inverse.
    pub dense_limit: usize,
    /// Unless the inverse has more entries than this part of those of K.
    pub dense_part: f64,
    /// Unknowns that may be solved with their inverse if no coarser level can be made.
    pub stalled_dense_limit: usize,
}

impl Default for AmgSettings {
    fn default() -> Self {
        Self {
            theta: 0.38,
            coarse_theta: 0.35,
            theta_without_points: 0.4,
            reach: 4.0,
            weights: [1.0, 2.0],
            busiest_first: false,
            degree: 2,
            alpha: 10.0,
            dense_limit: 800,
            dense_part: f64::INFINITY,
            stalled_dense_limit: 2000,
        }
    }
}

impl AmgSettings {
    /// The settings that suit bodies of a dimension. In space a row has three times the blocks and a coarse block four
    /// times the entries. All neighbours except the weakest belong to an aggregate there, which limits the complexity.
    pub fn of_dimension(dimension: usize) -> Self {
        match dimension {
            3 => Self {
                theta: 0.2,
                coarse_theta: 0.25,
                reach: 3.0,
                weights: [0.85, 2.3],
                busiest_first: true,
                dense_part: 0.1,
                ..Self::default()
            },
            _ => Self::default(),
        }
    }
}

/// The reason why K has no hierarchy.
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
        "the stiffness matrix is singular, or not positive definite: a part of a body has no stiffness or hangs on a \
         hinge: check that its parts are connected by more than a point. Bodies that can move as a whole need \
         supports, or coordinates that define their rigid-body motions"
    )]
    Singular,
    /// The pattern of K differs from the one that the hierarchy was made for.
    #[error(
        "the stiffness matrix has {} nodes and {} blocks, but the hierarchy was made for {} and {}: make a new hierarchy",
        found[0], found[1], expected[0], expected[1]
    )]
    OtherPattern {
        /// Nodes and blocks of K.
        found: [usize; 2],
        /// The sizes that it was made for.
        expected: [usize; 2],
    },
    /// The corners of second-order elements differ, or exist on one side only.
    #[error(
        "the corners of second-order elements differ from those that the hierarchy was made for: make a new hierarchy"
    )]
    OtherCorners,
    /// The levels below those of this hierarchy were not made.
    #[error("the levels below the finest could not be made: {0}")]
    Below(String),
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
    /// The rows and columns of other ranks, if there are such.
    pub(crate) beyond: Option<Beyond<S>>,
}

/// The part of a level that couples it to other ranks, where these matrices and those of [`Level`] are parts of the same.
#[derive(Clone, Debug)]
pub(crate) struct Beyond<S> {
    /// The halo of its nodes, and A between own nodes and copies.
    pub nodes: Halo,
    pub matrix: BlockMatrix<S>,
    /// The halo of the nodes of the coarser level, P from copies of them, and Pᵀ to copies.
    pub coarse: Halo,
    pub prolongation: BlockMatrix<S>,
    pub restriction: BlockMatrix<S>,
}

/// A solver for a level whose rows are on several ranks.
pub(crate) trait SolverBelow: fmt::Debug + Send + Sync {
    /// z ≈ A⁻¹r, each with the entries of this rank. Collective. After a failure z is not a number.
    fn solve(&self, r: &[f64], z: &mut [f64]);
}

/// The rows of a level that are on this rank, with its near-null space.
#[cfg_attr(not(feature = "mpi"), expect(dead_code, reason = "PETSc reads them"))]
pub(crate) struct RowsBelow<'a> {
    /// Rows of a block.
    pub block: usize,
    /// The halo of the columns.
    pub halo: &'a Halo,
    /// The starts of the block rows among the blocks, their columns by their place in the halo, and the entries.
    pub row_ptr: &'a [usize],
    pub col_idx: &'a [u32],
    pub entries: &'a [f64],
    /// The number of modes, and the values of all of them in each scalar row, one row after the other.
    pub n_modes: usize,
    pub modes: &'a [f64],
}

/// The other ranks of a hierarchy.
#[derive(Clone, Copy)]
pub(crate) struct OnRanks<'a> {
    /// The halo of the rows of K, and that of the corners of elements of second order.
    pub nodes: &'a Halo,
    pub corners: Option<&'a Halo>,
    /// Makes the solver for the levels below.
    pub below: &'a MakeBelow<'a>,
}

/// Makes a solver for rows on several ranks.
pub(crate) type MakeBelow<'a> = dyn Fn(RowsBelow) -> Result<Arc<dyn SolverBelow>, AmgError> + 'a;

/// A matrix and the Chebyshev iteration in D⁻¹A that smooths with it.
#[derive(Clone, Debug)]
pub struct Smoother<S> {
    /// A, with square blocks.
    pub(crate) matrix: BlockMatrix<S>,
    /// D⁻¹.
    pub(crate) inverse: Inverse<S>,
    /// (c₁, c₂) of each step d ← c₁ d + c₂ D⁻¹(b − A x), x ← x + d; the first c₁ is 0.
    pub(crate) steps: Vec<[S; 2]>,
}

/// The approximate inverse of A in the smoother.
#[derive(Clone, Debug)]
pub enum Inverse<S> {
    /// The inverses of the blocks of the nodes, row by row.
    Diagonal {
        /// Rows of a block.
        block: usize,
        /// Entries.
        values: Vec<S>,
    },
    /// The inverses of the blocks of disjoint patches of nodes: a row has a block for each node of its patch.
    Patches(BlockMatrix<S>),
}

impl<S> Inverse<S> {
    /// Bytes of the indices and values.
    fn bytes(&self) -> usize
    where
        S: Real,
    {
        match self {
            Self::Diagonal { values, .. } => size_of_val(&values[..]),
            Self::Patches(patches) => patches.bytes(),
        }
    }
}

/// The solver on the coarsest level.
#[derive(Clone, Debug)]
pub enum Coarse<S> {
    /// A product with the inverse.
    Inverse(Dense<S>),
    /// D⁻¹, the blocks row by row: block-Jacobi, the only level without multigrid.
    Diagonal {
        /// Rows of a block.
        block: usize,
        /// Entries.
        values: Vec<S>,
    },
    /// More smoothing, if the coarsest level is too large for an inverse. A singular matrix is not detected then.
    Smoothed(Smoother<S>),
    /// A solver on several ranks.
    Below(Below),
}

/// A solver on several ranks for scale · A.
#[derive(Clone, Debug)]
pub struct Below {
    solver: Arc<dyn SolverBelow>,
    /// Unknowns of this rank.
    unknowns: usize,
    scale: f64,
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
    /// The structure that stays when K gets other values; None for block-Jacobi.
    skeleton: Option<Skeleton>,
}

/// Sizes of one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelSize {
    /// Unknowns.
    pub unknowns: usize,
    /// Stored scalar entries of the matrix, or of its inverse.
    pub entries: usize,
    /// Bytes of all data of the level.
    pub bytes: usize,
}

impl<S: Real> Hierarchy<S> {
    /// The hierarchy for a symmetric positive definite K, with one point per block row if they are
    /// known (without, rotations are not represented and more iterations are needed).
    pub fn new<const D: usize>(
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        settings: &AmgSettings,
    ) -> Result<Self, AmgError> {
        Self::of_second_order(k, coordinates, None, settings)
    }

    /// Like [`Hierarchy::new`]; for second-order elements the level below the first is that of their corners, and
    /// aggregation begins there, unless elements are stretched.
    pub fn of_second_order<const D: usize>(
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
        settings: &AmgSettings,
    ) -> Result<Self, AmgError> {
        let n = k.n_block_rows();
        if n == 0 || k.n_block_cols() != n {
            return Err(AmgError::Shape);
        }
        if k.n_blocks() > u32::MAX as usize / 2 {
            return Err(AmgError::TooLarge);
        }
        let skeleton = Skeleton::new(k, settings, &Ranks::default());
        Self::of_skeleton(Some(skeleton), k, coordinates, vertices, None)
    }

    /// The hierarchy of a K with other values on the aggregates, the patches and the pattern of P of this one. The
    /// values of P, the coarse matrices and the bounds of the smoothers are recomputed. Coordinates and corners may
    /// have moved.
    ///
    /// # Errors
    /// If K has another number of nodes or blocks, and those of [`Hierarchy::new`].
    pub fn rebuild<const D: usize>(
        &self,
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
    ) -> Result<Self, AmgError> {
        Self::of_skeleton(self.skeleton.clone(), k, coordinates, vertices, None)
    }

    /// The levels above that of a solver on several ranks, which have the rows of K; columns are own ones, then those of the halo.
    /// Coordinates and corners are those of own rows. A small K, and one that cannot be coarsened, goes to that solver as it is.
    /// Collective.
    #[cfg(feature = "mpi")]
    pub(crate) fn on_ranks<const D: usize>(
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
        settings: &AmgSettings,
        others: OnRanks,
    ) -> Result<Self, AmgError> {
        let ranks = others.nodes.ranks();
        if ranks.any(k.n_blocks() > u32::MAX as usize / 2) {
            return Err(AmgError::TooLarge);
        }
        let skeleton = Skeleton::new(k, settings, ranks);
        Self::of_skeleton(Some(skeleton), k, coordinates, vertices, Some(others))
    }

    fn of_skeleton<const D: usize>(
        skeleton: Option<Skeleton>,
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
        others: Option<OnRanks>,
    ) -> Result<Self, AmgError> {
        let Some(skeleton) = skeleton else {
            return Self::block_jacobi(k);
        };
        match (coordinates, D) {
            (Some(points), _) if points.len() != k.n_block_rows() => Err(AmgError::Coordinates {
                found: points.len(),
                expected: k.n_block_rows(),
            }),
            (None, _) => skeleton.fill::<D, D, S>(k, None, None, others),
            (Some(_), 2) => skeleton.fill::<D, 3, S>(k, coordinates, vertices, others),
            (Some(_), 3) => skeleton.fill::<D, 6, S>(k, coordinates, vertices, others),
            (Some(_), _) => Err(AmgError::Shape),
        }
    }

    /// Block-Jacobi: the inverses of the blocks on the diagonal.
    pub fn block_jacobi<const D: usize>(k: &BlockCsr<D>) -> Result<Self, AmgError> {
        Self::block_jacobi_on(k, &Ranks::default())
    }

    /// The same of the rows of K on several ranks.
    pub(crate) fn block_jacobi_on<const D: usize>(
        k: &BlockCsr<D>,
        ranks: &Ranks,
    ) -> Result<Self, AmgError> {
        let scale = scale_of(k, ranks)?;
        let inverse = inverse_diagonal(k, ranks)?;
        Ok(Self {
            levels: Vec::new(),
            coarse: Coarse::Diagonal {
                block: D,
                values: store(inverse.as_flattened().as_flattened(), 1.0 / scale),
            },
            scale,
            skeleton: None,
        })
    }

    /// Whether all rigid motions are represented on the coarser levels; without rotations the cycle misses
    /// the soft modes of bending.
    pub(crate) fn has_rotations(&self) -> bool {
        let has = |level: &Level<S>| {
            let [fine, coarse] = level.prolongation.block();
            coarse > fine
        };
        match &self.coarse {
            Coarse::Diagonal { .. } => false,
            // Whatever the solver below does, it is not known to represent all smooth errors of K.
            Coarse::Below(_) => self.levels.iter().any(has),
            _ => self.levels.is_empty() || self.levels.iter().any(has),
        }
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
            bytes: smoother.matrix.bytes() + smoother.inverse.bytes(),
        };
        let mut sizes: Vec<LevelSize> = (self.levels.iter())
            .map(|level| {
                let size = smoothed(&level.smoother);
                let beyond = level.beyond.as_ref().map_or(0, |beyond| {
                    beyond.matrix.bytes() + beyond.prolongation.bytes() + beyond.restriction.bytes()
                });
                LevelSize {
                    bytes: size.bytes
                        + level.prolongation.bytes()
                        + level.restriction.bytes()
                        + beyond,
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
            Coarse::Below(below) => LevelSize {
                unknowns: below.unknowns,
                entries: 0,
                bytes: 0,
            },
        });
        sizes
    }

    /// Bytes that one V-cycle must move: each pass reads its inputs once and writes its outputs once.
    pub fn cycle_bytes(&self) -> usize {
        let vector = |n: usize| n * size_of::<S>();
        // The first step reads D⁻¹ and b and writes d and x; the others read A, D⁻¹, b, x, d and write
        // d and the new x. With patches they write the residual and read it again, and x.
        let smoothing = |smoother: &Smoother<S>, steps: usize, from_zero: bool| {
            let n = vector(smoother.matrix.n_rows());
            let inverse = smoother.inverse.bytes();
            let others = steps - usize::from(from_zero);
            let vectors = match smoother.inverse {
                Inverse::Diagonal { .. } => 5,
                Inverse::Patches(_) => 8,
            };
            others * (smoother.matrix.bytes() + inverse + vectors * n)
                + usize::from(from_zero) * (inverse + 3 * n)
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
                Coarse::Below(below) => 2 * vector(below.unknowns),
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
            Coarse::Below(_) => "a solver on several ranks",
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
fn scale_of<const D: usize>(k: &BlockCsr<D>, ranks: &Ranks) -> Result<f64, AmgError> {
    let largest = ranks.max(k.diagonal().into_iter().fold(0.0, f64::max));
    if largest > 0.0 && largest.is_finite() {
        Ok(power_of_two_below(largest).recip())
    } else {
        Err(AmgError::NotPositiveDefinite { node: 0, block: D })
    }
}

/// The inverses of the blocks of the nodes on the diagonal. An error on one rank is one on all.
fn inverse_diagonal<const B: usize>(
    a: &BlockCsr<B>,
    ranks: &Ranks,
) -> Result<Vec<[[f64; B]; B]>, AmgError> {
    let inverse = smoother::inverse_diagonal(a)
        .map_err(|node| AmgError::NotPositiveDefinite { node, block: B });
    match ranks.any(inverse.is_err()) {
        true => inverse.and(Err(AmgError::Singular)),
        false => inverse,
    }
}
