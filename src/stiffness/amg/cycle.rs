//! The V-cycle, written once for all backends.

use super::setup::Skeleton;
use super::{AmgError, Below, Beyond, Coarse, Hierarchy, Inverse, Level, Smoother};
use crate::backend::{Backend, BackendError, Product};
use crate::problem::Vertices;
use crate::ranks::Halo;
use crate::sparse::BlockCsr;
use crate::sparse::stored::{BlockMatrix, Real};

/// A matrix between vectors of a level and rows of other ranks.
struct OtherRows<B: Backend> {
    matrix: B::LevelMatrix,
    /// The values of copies of their rows.
    copies: B::LevelVector,
}

impl<B: Backend> OtherRows<B> {
    /// With so many values of copies.
    fn new(
        backend: &mut B,
        matrix: BlockMatrix<B::Stored>,
        copies: usize,
    ) -> Result<Self, BackendError> {
        Ok(Self {
            matrix: backend.level_matrix(matrix)?,
            copies: backend.level_vector(copies)?,
        })
    }
}

/// The part of a level matrix that couples own rows to those of other ranks.
struct MatrixBeyond<B: Backend> {
    /// A from copies to own rows.
    reach: OtherRows<B>,
    /// The right-hand side less its product.
    b: B::LevelVector,
    /// Picks the values that other ranks need, and these.
    interface: OtherRows<B>,
    halo: Halo,
    /// Values of the interface and of copies on the host, and the number of values of a row.
    values: Vec<B::Stored>,
    width: usize,
}

impl<B: Backend> MatrixBeyond<B> {
    fn new(
        backend: &mut B,
        nodes: &Halo,
        matrix: BlockMatrix<B::Stored>,
    ) -> Result<Self, BackendError> {
        let [width, _] = matrix.block();
        let (rows, halo) = nodes.interface();
        let picks = BlockMatrix::picks(width, &rows, nodes.own());
        let copies = matrix.n_cols();
        Ok(Self {
            b: backend.level_vector(matrix.n_rows())?,
            reach: OtherRows::new(backend, matrix, copies)?,
            interface: OtherRows::new(backend, picks, width * rows.len())?,
            values: vec![B::Stored::default(); width * (rows.len() + nodes.copies())],
            halo,
            width,
        })
    }

    /// The right-hand side b − A x of own rows, with the columns of copies only.
    fn remaining(
        &mut self,
        backend: &mut B,
        state: &B::State,
        b: &B::LevelVector,
        x: &B::LevelVector,
    ) -> Result<&B::LevelVector, BackendError> {
        if !backend.is_over(state) {
            let OtherRows { matrix, copies } = &mut self.interface;
            backend.level_multiply(state, matrix, Product::Plain, x, x, copies);
            let own = self.width * self.halo.own();
            backend.read_level(copies, &mut self.values[..own])?;
            self.halo.update(self.width, &mut self.values);
            backend.write_level(&self.values[own..], &mut self.reach.copies);
        }
        let OtherRows { matrix, copies } = &self.reach;
        backend.level_multiply(state, matrix, Product::Residual, b, copies, &mut self.b);
        Ok(&self.b)
    }
}

/// The part of P and Pᵀ that couples to nodes of the coarser level on other ranks.
struct CoarseBeyond<B: Backend> {
    halo: Halo,
    width: usize,
    prolongation: OtherRows<B>,
    restriction: OtherRows<B>,
    /// Values of own nodes and copies of the coarser level on the host.
    values: Vec<B::Stored>,
}

impl<B: Backend> CoarseBeyond<B> {
    fn new(
        backend: &mut B,
        halo: Halo,
        prolongation: BlockMatrix<B::Stored>,
        restriction: BlockMatrix<B::Stored>,
    ) -> Result<Self, BackendError> {
        let [_, width] = prolongation.block();
        let copies = width * halo.copies();
        Ok(Self {
            prolongation: OtherRows::new(backend, prolongation, copies)?,
            restriction: OtherRows::new(backend, restriction, copies)?,
            values: vec![B::Stored::default(); width * (halo.own() + halo.copies())],
            halo,
            width,
        })
    }

    /// Adds to the restricted residual of own nodes those of other ranks, where d is the residual here.
    fn restrict(
        &mut self,
        backend: &mut B,
        state: &B::State,
        d: &B::LevelVector,
        coarse: &mut B::LevelVector,
    ) -> Result<(), BackendError> {
        let OtherRows { matrix, copies } = &mut self.restriction;
        backend.level_multiply(state, matrix, Product::Plain, d, d, copies);
        if backend.is_over(state) {
            return Ok(());
        }
        let (own, there) = self.values.split_at_mut(self.width * self.halo.own());
        backend.read_level(coarse, own)?;
        backend.read_level(copies, there)?;
        self.halo.add(self.width, there, own);
        backend.write_level(own, coarse);
        Ok(())
    }

    /// Adds the corrections of nodes of other ranks to x.
    fn prolong(
        &mut self,
        backend: &mut B,
        state: &B::State,
        coarse: &B::LevelVector,
        x: &mut B::LevelVector,
    ) -> Result<(), BackendError> {
        let OtherRows { matrix, copies } = &mut self.prolongation;
        if !backend.is_over(state) {
            let own = self.width * self.halo.own();
            backend.read_level(coarse, &mut self.values[..own])?;
            self.halo.update(self.width, &mut self.values);
            backend.write_level(&self.values[own..], copies);
        }
        backend.level_multiply(state, matrix, Product::Added, copies, copies, x);
        Ok(())
    }
}

/// A matrix on a backend, and the Chebyshev iteration that smooths with it.
struct SmootherThere<B: Backend> {
    matrix: B::LevelMatrix,
    inverse: InverseThere<B>,
    steps: Vec<[B::Stored; 2]>,
    beyond: Option<MatrixBeyond<B>>,
}

enum InverseThere<B: Backend> {
    Diagonal(B::LevelDiagonal),
    Patches(B::LevelMatrix),
}

struct LevelThere<B: Backend> {
    smoother: SmootherThere<B>,
    prolongation: B::LevelMatrix,
    restriction: B::LevelMatrix,
    beyond: Option<CoarseBeyond<B>>,
}

enum CoarseThere<B: Backend> {
    Inverse(B::DenseMatrix),
    Diagonal(B::LevelDiagonal),
    Smoothed(SmootherThere<B>),
    Below(Below),
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
    turned: Option<Turned<B>>,
}

/// The frames of nodes that have turned since the hierarchy was made: z = Q M Qᵀ r.
struct Turned<B: Backend> {
    back: B::LevelMatrix,
    turn: B::LevelMatrix,
    r: B::LevelVector,
    z: B::LevelVector,
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
            turned: None,
        })
    }

    /// Whether levels were cleared and not made again.
    pub(crate) fn is_missing(&self) -> bool {
        self.levels.len() + 1 != self.vectors.len()
    }

    /// Whether this is the hierarchy of a matrix with as many nodes and blocks as this one.
    pub(crate) fn fits<const D: usize>(&self, k: &BlockCsr<D>) -> bool {
        let fits = |skeleton: &Skeleton| skeleton.fits(k);
        !self.levels.is_empty() && self.skeleton.as_ref().is_some_and(fits)
    }

    /// Makes room for other values: there is no cycle before [`Multigrid::rebuild`].
    pub(crate) fn clear(&mut self) {
        self.levels.clear();
        self.turned = None;
    }

    /// Turns the hierarchy as it is by these rotations of its nodes, on the diagonal of a matrix.
    pub(crate) fn turn<const D: usize>(
        &mut self,
        backend: &mut B,
        rotations: Option<BlockCsr<D>>,
    ) -> Result<(), BackendError> {
        self.turned = None;
        self.turned = match rotations {
            Some(q) => Some(Turned {
                back: backend.level_matrix(BlockMatrix::new(&q.transposed(), 1.0))?,
                turn: backend.level_matrix(BlockMatrix::new(&q, 1.0))?,
                r: backend.level_vector(q.n_rows())?,
                z: backend.level_vector(q.n_rows())?,
            }),
            None => None,
        };
        Ok(())
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
        let hierarchy = Hierarchy::of_skeleton(skeleton, k, coordinates, vertices, None)?;
        (self.levels, self.coarse) = there(backend, hierarchy.levels, hierarchy.coarse)?;
        Ok(())
    }

    /// r, to be filled before a cycle.
    pub fn r(&mut self) -> &mut B::LevelVector {
        match &mut self.turned {
            Some(turned) => &mut turned.r,
            None => &mut self.vectors[0].b,
        }
    }

    /// z, after a cycle.
    pub fn z(&self) -> &B::LevelVector {
        match &self.turned {
            Some(turned) => &turned.z,
            None => &self.vectors[0].x,
        }
    }

    /// z = M r. Has no effect if the CG run of `state` is done.
    ///
    /// With a smoother of degree ν a level takes 2ν + 3 passes (ν before, ν after, residual, restriction,
    /// prolongation). So the usual cycle of three levels of degree 2 and a dense coarse solve has 22.
    ///
    /// # Errors
    /// Those of the backend, where values of other ranks are needed.
    pub fn cycle(&mut self, backend: &mut B, state: &B::State) -> Result<(), BackendError> {
        if let Some(Turned { back, r, .. }) = &self.turned {
            let b = &mut self.vectors[0].b;
            backend.level_multiply(state, back, Product::Plain, r, r, b);
        }
        v_cycle(
            backend,
            state,
            &mut self.levels,
            &mut self.coarse,
            &mut self.vectors,
        )?;
        if let Some(Turned { turn, z, .. }) = &mut self.turned {
            let x = &self.vectors[0].x;
            backend.level_multiply(state, turn, Product::Plain, x, x, z);
        }
        Ok(())
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
        let mut smoother = smoother(backend, level.smoother)?;
        let mut coarse_beyond = None;
        if let Some(beyond) = level.beyond {
            let Beyond {
                nodes,
                matrix,
                coarse,
                prolongation,
                restriction,
            } = beyond;
            smoother.beyond = Some(MatrixBeyond::new(backend, &nodes, matrix)?);
            coarse_beyond = Some(CoarseBeyond::new(
                backend,
                coarse,
                prolongation,
                restriction,
            )?);
        }
        made.push(LevelThere {
            smoother,
            prolongation: backend.level_matrix(level.prolongation)?,
            restriction: backend.level_matrix(level.restriction)?,
            beyond: coarse_beyond,
        });
    }
    let coarse = match coarse {
        Coarse::Inverse(dense) => CoarseThere::Inverse(backend.dense_matrix(dense)?),
        Coarse::Diagonal { block, values } => {
            CoarseThere::Diagonal(backend.level_diagonal(values, block)?)
        }
        Coarse::Smoothed(coarse) => CoarseThere::Smoothed(smoother(backend, coarse)?),
        Coarse::Below(below) => CoarseThere::Below(below),
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
        beyond: None,
    })
}

/// One V-cycle for A x = b from x = 0: reads `vectors[0].b`, writes `vectors[0].x`.
///
/// `vectors` has one entry for each of `levels` and one for the coarsest.
fn v_cycle<B: Backend>(
    backend: &mut B,
    state: &B::State,
    levels: &mut [LevelThere<B>],
    coarse: &mut CoarseThere<B>,
    vectors: &mut [LevelVectors<B>],
) -> Result<(), BackendError> {
    let [v, below @ ..] = vectors else {
        return Ok(());
    };
    let Some((level, coarser)) = levels.split_first_mut() else {
        match coarse {
            CoarseThere::Inverse(inverse) => backend.dense_product(state, inverse, &v.b, &mut v.x),
            CoarseThere::Diagonal(inverse) => {
                let one = B::Stored::from_f64(1.0);
                backend.smooth_first(state, inverse, one, &v.b, &mut v.d, &mut v.x);
            }
            CoarseThere::Smoothed(smoother) => smooth_from_zero(backend, state, smoother, v)?,
            CoarseThere::Below(below) => solve_below(backend, state, below, v)?,
        }
        return Ok(());
    };
    smooth_from_zero(backend, state, &mut level.smoother, v)?;
    let SmootherThere { matrix, beyond, .. } = &mut level.smoother;
    let b = match beyond {
        Some(beyond) => beyond.remaining(backend, state, &v.b, &v.x)?,
        None => &v.b,
    };
    backend.level_multiply(state, matrix, Product::Residual, b, &v.x, &mut v.d);
    let coarse_b = &mut below[0].b;
    backend.level_multiply(
        state,
        &level.restriction,
        Product::Plain,
        &v.b,
        &v.d,
        coarse_b,
    );
    if let Some(beyond) = &mut level.beyond {
        beyond.restrict(backend, state, &v.d, coarse_b)?;
    }
    v_cycle(backend, state, coarser, coarse, below)?;
    let coarse_x = &below[0].x;
    backend.level_multiply(
        state,
        &level.prolongation,
        Product::Added,
        &v.b,
        coarse_x,
        &mut v.x,
    );
    if let Some(beyond) = &mut level.beyond {
        beyond.prolong(backend, state, coarse_x, &mut v.x)?;
    }
    smooth(backend, state, &mut level.smoother, 0, v)
}

/// The solver of all ranks on the level below.
fn solve_below<B: Backend>(
    backend: &mut B,
    state: &B::State,
    below: &Below,
    v: &mut LevelVectors<B>,
) -> Result<(), BackendError> {
    if backend.is_over(state) {
        return Ok(());
    }
    let mut values = vec![B::Stored::default(); below.unknowns];
    backend.read_level(&v.b, &mut values)?;
    let r: Vec<f64> = values.iter().map(|v| v.to_f64()).collect();
    let mut z = vec![0.0; r.len()];
    below.solver.solve(&r, &mut z);
    for (to, z) in values.iter_mut().zip(z) {
        *to = B::Stored::from_f64(z / below.scale);
    }
    backend.write_level(&values, &mut v.x);
    Ok(())
}

/// The smoother from x = 0: its first step needs no product.
fn smooth_from_zero<B: Backend>(
    backend: &mut B,
    state: &B::State,
    smoother: &mut SmootherThere<B>,
    v: &mut LevelVectors<B>,
) -> Result<(), BackendError> {
    let [_, c] = smoother.steps[0];
    let (b, d, x) = (&v.b, &mut v.d, &mut v.x);
    match &smoother.inverse {
        InverseThere::Diagonal(inverse) => backend.smooth_first(state, inverse, c, b, d, x),
        InverseThere::Patches(patches) => {
            backend.smooth_patches(state, patches, None, c, b, d, x);
        }
    }
    smooth(backend, state, smoother, 1, v)
}

/// The steps of the smoother from this one on, on `v.x`.
fn smooth<B: Backend>(
    backend: &mut B,
    state: &B::State,
    smoother: &mut SmootherThere<B>,
    first: usize,
    v: &mut LevelVectors<B>,
) -> Result<(), BackendError> {
    let SmootherThere {
        matrix: a,
        inverse,
        steps,
        beyond,
    } = smoother;
    let LevelVectors { b, x, x_next, d } = v;
    for &step in &steps[first..] {
        let b = match beyond {
            Some(beyond) => beyond.remaining(backend, state, b, x)?,
            None => &*b,
        };
        match inverse {
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
    Ok(())
}
