//! The V-cycle, written once for all backends.

use super::setup::Skeleton;
use super::{AmgError, Coarse, Hierarchy, Inverse, Level, Smoother};
use crate::backend::{Backend, BackendError, Product};
use crate::problem::Vertices;
use crate::sparse::BlockCsr;
use crate::sparse::stored::Real as _;

/// A matrix on a backend, and the Chebyshev iteration that smooths with it.
struct SmootherThere<B: Backend> {
    matrix: B::LevelMatrix,
    inverse: InverseThere<B>,
    steps: Vec<[B::Stored; 2]>,
}

enum InverseThere<B: Backend> {
    Diagonal(B::LevelDiagonal),
    Patches(B::LevelMatrix),
}

struct LevelThere<B: Backend> {
    smoother: SmootherThere<B>,
    prolongation: B::LevelMatrix,
    restriction: B::LevelMatrix,
}

enum CoarseThere<B: Backend> {
    Inverse(B::DenseMatrix),
    Diagonal(B::LevelDiagonal),
    Smoothed(SmootherThere<B>),
}

/// The vectors of one level.
struct LevelVectors<B: Backend> {
    /// Right-hand side.
    b: B::LevelVector,
    /// Solution.
    x: B::LevelVector,
    /// The solution that a smoothing step writes while others still read the old one.
    x_next: B::LevelVector,
    /// Last step of the smoother; also holds the residual between the smoothers.
    d: B::LevelVector,
}

/// A hierarchy on a backend: z = M r by one V-cycle.
pub struct Multigrid<B: Backend> {
    levels: Vec<LevelThere<B>>,
    coarse: CoarseThere<B>,
    /// One more than levels.
    vectors: Vec<LevelVectors<B>>,
    skeleton: Option<Skeleton>,
}

impl<B: Backend> Multigrid<B> {
    /// Moves the hierarchy to the backend.
    pub fn new(backend: &mut B, hierarchy: Hierarchy<B::Stored>) -> Result<Self, BackendError> {
        let vectors = hierarchy
            .sizes()
            .iter()
            .map(|size| {
                Ok(LevelVectors {
                    b: backend.level_vector(size.unknowns)?,
                    x: backend.level_vector(size.unknowns)?,
                    x_next: backend.level_vector(size.unknowns)?,
                    d: backend.level_vector(size.unknowns)?,
                })
            })
            .collect::<Result<_, BackendError>>()?;
        let (levels, coarse) = there(backend, hierarchy.levels, hierarchy.coarse)?;
        Ok(Self {
            levels,
            coarse,
            vectors,
            skeleton: hierarchy.skeleton,
        })
    }

    /// Makes room for other values: there is no cycle before [`Multigrid::rebuild`].
    pub(crate) fn clear(&mut self) {
        self.levels.clear();
    }

    /// Takes the values of another K from [`Hierarchy::rebuild`]. After an error there is no cycle.
    pub(crate) fn rebuild<const D: usize, E: From<AmgError> + From<BackendError>>(
        &mut self,
        backend: &mut B,
        k: &BlockCsr<D>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
    ) -> Result<(), E> {
        self.clear();
        let skeleton = self.skeleton.clone();
        let hierarchy = Hierarchy::of_skeleton(skeleton, k, coordinates, vertices)?;
        (self.levels, self.coarse) = there(backend, hierarchy.levels, hierarchy.coarse)?;
        Ok(())
    }

    /// r, to be filled before a cycle.
    pub fn r(&mut self) -> &mut B::LevelVector {
        &mut self.vectors[0].b
    }

    /// z, after a cycle.
    pub fn z(&self) -> &B::LevelVector {
        &self.vectors[0].x
    }

    /// z = M r. Has no effect if the CG run of `state` is done.
    ///
    /// With a smoother of degree ν a level takes 2ν + 3 passes (ν before, ν after, residual, restriction,
    /// prolongation), so that the usual cycle of three levels of degree 2 and a dense coarse solve has 22.
    pub fn cycle(&mut self, backend: &mut B, state: &B::State) {
        v_cycle(
            backend,
            state,
            &self.levels,
            &self.coarse,
            &mut self.vectors,
        );
    }
}

/// The levels and the solver on the coarsest, on the backend.
fn there<B: Backend>(
    backend: &mut B,
    levels: Vec<Level<B::Stored>>,
    coarse: Coarse<B::Stored>,
) -> Result<(Vec<LevelThere<B>>, CoarseThere<B>), BackendError> {
    let mut made = Vec::with_capacity(levels.len());
    for level in levels {
        made.push(LevelThere {
            smoother: smoother(backend, level.smoother)?,
            prolongation: backend.level_matrix(level.prolongation)?,
            restriction: backend.level_matrix(level.restriction)?,
        });
    }
    let coarse = match coarse {
        Coarse::Inverse(dense) => CoarseThere::Inverse(backend.dense_matrix(dense)?),
        Coarse::Diagonal { block, values } => {
            CoarseThere::Diagonal(backend.level_diagonal(values, block)?)
        }
        Coarse::Smoothed(coarse) => CoarseThere::Smoothed(smoother(backend, coarse)?),
    };
    Ok((made, coarse))
}

fn smoother<B: Backend>(
    backend: &mut B,
    smoother: Smoother<B::Stored>,
) -> Result<SmootherThere<B>, BackendError> {
    Ok(SmootherThere {
        inverse: match smoother.inverse {
            Inverse::Diagonal { block, values } => {
                InverseThere::Diagonal(backend.level_diagonal(values, block)?)
            }
            Inverse::Patches(patches) => InverseThere::Patches(backend.level_matrix(patches)?),
        },
        matrix: backend.symmetric_level_matrix(smoother.matrix)?,
        steps: smoother.steps,
    })
}

/// One V-cycle for A x = b from x = 0: reads `vectors[0].b`, writes `vectors[0].x`.
///
/// `vectors` has one entry for each of `levels` and one for the coarsest.
fn v_cycle<B: Backend>(
    backend: &mut B,
    state: &B::State,
    levels: &[LevelThere<B>],
    coarse: &CoarseThere<B>,
    vectors: &mut [LevelVectors<B>],
) {
    let [v, below @ ..] = vectors else {
        return;
    };
    let Some((level, coarser)) = levels.split_first() else {
        match coarse {
            CoarseThere::Inverse(inverse) => backend.dense_product(state, inverse, &v.b, &mut v.x),
            CoarseThere::Diagonal(inverse) => {
                let one = B::Stored::from_f64(1.0);
                backend.smooth_first(state, inverse, one, &v.b, &mut v.d, &mut v.x);
            }
            CoarseThere::Smoothed(smoother) => smooth_from_zero(backend, state, smoother, v),
        }
        return;
    };
    smooth_from_zero(backend, state, &level.smoother, v);
    let matrix = &level.smoother.matrix;
    backend.level_multiply(state, matrix, Product::Residual, &v.b, &v.x, &mut v.d);
    let coarse_b = &mut below[0].b;
    backend.level_multiply(
        state,
        &level.restriction,
        Product::Plain,
        &v.b,
        &v.d,
        coarse_b,
    );
    v_cycle(backend, state, coarser, coarse, below);
    let coarse_x = &below[0].x;
    backend.level_multiply(
        state,
        &level.prolongation,
        Product::Added,
        &v.b,
        coarse_x,
        &mut v.x,
    );
    smooth(backend, state, &level.smoother, &level.smoother.steps, v);
}

/// The smoother from x = 0: its first step needs no product.
fn smooth_from_zero<B: Backend>(
    backend: &mut B,
    state: &B::State,
    smoother: &SmootherThere<B>,
    v: &mut LevelVectors<B>,
) {
    let [_, c] = smoother.steps[0];
    let (b, d, x) = (&v.b, &mut v.d, &mut v.x);
    match &smoother.inverse {
        InverseThere::Diagonal(inverse) => backend.smooth_first(state, inverse, c, b, d, x),
        InverseThere::Patches(patches) => {
            backend.smooth_patches(state, patches, None, c, b, d, x);
        }
    }
    smooth(backend, state, smoother, &smoother.steps[1..], v);
}

/// Steps of the smoother on `v.x`.
fn smooth<B: Backend>(
    backend: &mut B,
    state: &B::State,
    smoother: &SmootherThere<B>,
    steps: &[[B::Stored; 2]],
    v: &mut LevelVectors<B>,
) {
    let (a, LevelVectors { b, x, x_next, d }) = (&smoother.matrix, v);
    for &step in steps {
        match &smoother.inverse {
            InverseThere::Diagonal(inverse) => {
                backend.smooth(state, a, inverse, step, b, x, d, x_next);
                std::mem::swap(x, x_next);
            }
            // A patch needs the residual of all its nodes, which is in `x_next`.
            InverseThere::Patches(patches) => {
                backend.level_multiply(state, a, Product::Residual, b, x, x_next);
                let [c1, c2] = step;
                backend.smooth_patches(state, patches, Some(c1), c2, x_next, d, x);
            }
        }
    }
}
