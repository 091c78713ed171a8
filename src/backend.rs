//! Where the work of size n is done: on the CPU, or on a GPU through wgpu.
//!
//! [`Backend`] is cut at the size of a kernel: each method is one fused pass over the data, and the
//! scalars of an iteration stay where the vectors are. The algorithms ([`crate::stiffness::pcg`]) are
//! written once over it; [`cpu::Cpu`] is the reference and the fallback, [`gpu::Gpu`] runs the WGSL
//! kernels in `shaders/`.

pub mod cpu;
pub mod gpu;

use crate::control::Counters;
use crate::sparse::stored::{BlockMatrix, Dense, Real, power_of_two_below};
use crate::sparse::{BlockCsr, Csr};
use std::sync::Arc;

pub use gpu::GpuError;

/// A 2×2 block, by rows.
pub type Block = [[f64; 2]; 2];

/// How far a CG run has come.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Finished iterations.
    pub iterations: usize,
    /// ‖r‖² by the recurrence.
    pub rr: f64,
    /// ‖r‖² at which the run ends.
    pub goal: f64,
    /// ‖r‖² at its start.
    pub rr_start: f64,
    /// What the iterations have lowered eᵀKe by, e the error of x: the sum of all α rᵀz.
    pub energy: f64,
    /// The part of it that the last iterations have brought: the last one up to the ninth iteration, about
    /// the last fifth or more of them all from the tenth on.
    pub recent: f64,
    /// How many these were.
    pub recent_terms: usize,
    /// The run is over: the goal is reached, or the run broke down, or a number is not finite.
    pub done: bool,
    /// A direction had no positive curvature.
    pub broken: bool,
}

/// Where a CG run starts and when it ends: at the first goal that it reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Starts from the x that is there, with r = b − Kx on entry; from x = 0 otherwise.
    pub continues: bool,
    /// ‖r‖.
    pub residual: f64,
    /// ‖r‖ relative to the r on entry: the larger of the two counts.
    pub residual_part: f64,
    /// eᵀKe as estimated from [`Progress::recent`].
    pub remaining: f64,
    /// The same relative to the sum of all α rᵀz, to be added.
    pub remaining_part: f64,
    /// What eᵀKe is estimated to be relative to the last α rᵀz, where that stands alone; a sum of more of
    /// them is itself the estimate.
    pub to_come: f64,
}

impl Default for Run {
    /// Starts from zero and has no goal.
    fn default() -> Self {
        Self {
            continues: false,
            residual: 0.0,
            residual_part: 0.0,
            remaining: 0.0,
            remaining_part: 0.0,
            to_come: 1.0,
        }
    }
}

/// Whether a block of that many terms α rᵀz is full after so many iterations; see
/// `shaders/shared/common.wgsl`, which does the same.
///
/// The estimate of eᵀKe is made from the block before the last and what there is of the last. Up to nine
/// iterations each term is a block, which leaves the last one; from then on a block is a fifth of all
/// iterations, so that the two are at least that. Where PCG is slow, α rᵀz falls and rises again by orders
/// of magnitude, and a single one tells nothing. Sums over blocks need neither a history nor differences,
/// in which f32 would lose all digits.
fn block_is_full(terms: usize, iterations: usize) -> bool {
    terms >= (iterations / 5).max(1)
}

/// One fused pass over the data per method.
///
/// Methods that return nothing may only record their work; whatever goes wrong in them shows in the next
/// method that returns a [`Result`]. Work recorded for a CG run that is done has no effect.
pub trait Backend {
    /// Real numbers, in pairs: the two unknowns of a node.
    type Vector;
    /// K in 2×2 blocks.
    type Matrix;
    /// D⁻¹ of block-Jacobi, up to a common factor.
    type BlockDiagonal;
    /// A rectangular matrix of which most rows are empty: B, Bᵀ.
    type Rows;
    /// The scalars of a CG run.
    type State;
    /// What the preconditioner is stored and applied in.
    type Stored: Real;
    /// A vector of a multigrid level.
    type LevelVector;
    /// A, P or Pᵀ of a multigrid level.
    type LevelMatrix;
    /// D⁻¹ of a multigrid level.
    type LevelDiagonal;
    /// The inverse of the coarsest matrix.
    type DenseMatrix;

    /// Rounding error of its arithmetic with vectors: 2⁻⁵³ or 2⁻²⁴.
    fn unit_roundoff(&self) -> f64;
    /// What it has done so far.
    fn counters(&self) -> Counters;

    /// A vector of `len` zeros; `len` is rounded up to a whole pair.
    fn vector(&mut self, len: usize) -> Result<Self::Vector, GpuError>;
    /// The matrix, and the factor by which the stored one is larger: f32 has a narrow range.
    fn matrix(&mut self, k: &Arc<BlockCsr<2>>) -> Result<(Self::Matrix, f64), GpuError>;
    /// The blocks of D⁻¹, one per pair; stored in f32.
    fn block_diagonal(&mut self, blocks: &[Block]) -> Result<Self::BlockDiagonal, GpuError>;
    /// A rectangular matrix that maps vectors like `from` to vectors like `to`.
    fn rows(
        &mut self,
        matrix: &Csr,
        from: &Self::Vector,
        to: &Self::Vector,
    ) -> Result<Self::Rows, GpuError>;
    /// Scalars of a CG run on vectors like `like`.
    fn state(&mut self, k: &Self::Matrix, like: &Self::Vector) -> Result<Self::State, GpuError>;

    /// Copies numbers of the host into a vector; fewer than its length leave the rest as it is.
    fn upload(&mut self, from: &[f64], to: &mut Self::Vector);
    /// Copies a vector to the host.
    fn download(&mut self, from: &Self::Vector, to: &mut [f64]) -> Result<(), GpuError>;
    /// to = from.
    fn copy(&mut self, from: &Self::Vector, to: &mut Self::Vector);
    /// x = 0.
    fn clear(&mut self, x: &mut Self::Vector);
    /// y = M x on the rows of M that have entries; y is left as it is elsewhere.
    fn multiply_rows(&mut self, m: &Self::Rows, x: &Self::Vector, y: &mut Self::Vector);
    /// y −= K x.
    fn subtract_product(&mut self, k: &Self::Matrix, x: &Self::Vector, y: &mut Self::Vector);

    /// Starts CG with block-Jacobi for K x = b, r = b on entry: p = D⁻¹r, and x = 0 unless it continues.
    fn cg_start(
        &mut self,
        d: &Self::BlockDiagonal,
        r: &Self::Vector,
        x: &mut Self::Vector,
        p: &mut Self::Vector,
        state: &mut Self::State,
        run: Run,
    );
    /// q = K p, and pᵀq.
    fn cg_multiply(
        &mut self,
        k: &Self::Matrix,
        p: &Self::Vector,
        q: &mut Self::Vector,
        state: &mut Self::State,
    );
    /// α = rᵀz / pᵀq, x += α p, r −= α q, and rᵀz, rᵀr for the new r, where z = D⁻¹r.
    fn cg_step_1(
        &mut self,
        d: &Self::BlockDiagonal,
        p: &Self::Vector,
        q: &Self::Vector,
        x: &mut Self::Vector,
        r: &mut Self::Vector,
        state: &mut Self::State,
    );
    /// β = new rᵀz / old rᵀz, p = z + β p; ends the run where its goal is reached.
    fn cg_step_2(
        &mut self,
        d: &Self::BlockDiagonal,
        r: &Self::Vector,
        p: &mut Self::Vector,
        state: &mut Self::State,
    );
    /// A vector of `len` zeros for a multigrid level.
    fn level_vector(&mut self, len: usize) -> Result<Self::LevelVector, GpuError>;
    /// A matrix of a multigrid level.
    fn level_matrix(&mut self, m: BlockMatrix<Self::Stored>)
    -> Result<Self::LevelMatrix, GpuError>;
    /// D⁻¹ of a level: square blocks of `block` rows, by rows.
    fn level_diagonal(
        &mut self,
        values: Vec<Self::Stored>,
        block: usize,
    ) -> Result<Self::LevelDiagonal, GpuError>;
    /// A dense matrix.
    fn dense_matrix(&mut self, m: Dense<Self::Stored>) -> Result<Self::DenseMatrix, GpuError>;

    /// First smoothing step from x = 0: d = c D⁻¹b, x = d.
    fn chebyshev_first(
        &mut self,
        state: &Self::State,
        inverse_diagonal: &Self::LevelDiagonal,
        c: Self::Stored,
        b: &Self::LevelVector,
        d: &mut Self::LevelVector,
        x: &mut Self::LevelVector,
    );
    /// A smoothing step: d = c₁ d + c₂ D⁻¹(b − A x), x_next = x + d.
    #[allow(clippy::too_many_arguments, reason = "one fused pass over this data")]
    fn chebyshev_step(
        &mut self,
        state: &Self::State,
        a: &Self::LevelMatrix,
        inverse_diagonal: &Self::LevelDiagonal,
        steps: [Self::Stored; 2],
        b: &Self::LevelVector,
        x: &Self::LevelVector,
        d: &mut Self::LevelVector,
        x_next: &mut Self::LevelVector,
    );
    /// r = b − A x.
    fn level_residual(
        &mut self,
        state: &Self::State,
        a: &Self::LevelMatrix,
        b: &Self::LevelVector,
        x: &Self::LevelVector,
        r: &mut Self::LevelVector,
    );
    /// y = M x.
    fn level_product(
        &mut self,
        state: &Self::State,
        m: &Self::LevelMatrix,
        x: &Self::LevelVector,
        y: &mut Self::LevelVector,
    );
    /// y += M x.
    fn level_product_add(
        &mut self,
        state: &Self::State,
        m: &Self::LevelMatrix,
        x: &Self::LevelVector,
        y: &mut Self::LevelVector,
    );
    /// x = M b.
    fn dense_product(
        &mut self,
        state: &Self::State,
        m: &Self::DenseMatrix,
        b: &Self::LevelVector,
        x: &mut Self::LevelVector,
    );

    /// Starts CG with multigrid for K x = b, r = b on entry: r rounded for the cycle, and x = 0 unless it
    /// continues.
    fn mg_load(
        &mut self,
        r: &Self::Vector,
        x: &mut Self::Vector,
        rounded: &mut Self::LevelVector,
        state: &mut Self::State,
        run: Run,
    );
    /// α = rᵀz / pᵀq, x += α p, r −= α q, r rounded for the cycle; ends the run where its goal is reached.
    fn mg_step_1(
        &mut self,
        p: &Self::Vector,
        q: &Self::Vector,
        x: &mut Self::Vector,
        r: &mut Self::Vector,
        rounded: &mut Self::LevelVector,
        state: &mut Self::State,
    );
    /// β = new rᵀz / old rᵀz (0 in the first iteration), p = z + β p.
    fn mg_step_2(
        &mut self,
        r: &Self::Vector,
        z: &Self::LevelVector,
        p: &mut Self::Vector,
        state: &mut Self::State,
    );

    /// Waits for all work so far; the progress of the run, and a short vector along with it.
    fn progress(
        &mut self,
        state: &Self::State,
        result: Option<(&Self::Vector, &mut [f64])>,
    ) -> Result<Progress, GpuError>;
}

/// Blocks in f32, by rows, times a power of two that brings the largest near one, so that the unit of K
/// does not leave the range of f32.
fn scaled_to_f32(blocks: &[Block]) -> Vec<[f32; 4]> {
    let largest = blocks
        .iter()
        .flatten()
        .flatten()
        .fold(0.0, |acc: f64, v| acc.max(v.abs()));
    let scale = power_of_two_below(largest).recip();
    blocks
        .iter()
        .map(|b| [b[0][0], b[0][1], b[1][0], b[1][1]].map(|v| (v * scale) as f32))
        .collect()
}
