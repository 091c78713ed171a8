//! The place of the work of size n: the CPU, or a GPU through wgpu.
//!
//! [`Backend`] is cut at the size of a kernel: each method is one fused pass over the data, and the scalars of an
//! iteration stay where the vectors are. The algorithms ([`crate::stiffness::pcg`]) are written once over it;
//! [`cpu::Cpu`] is the reference and the fallback, `gpu::Gpu` runs the WGSL kernels in `shaders/`. No code here knows
//! the dimension of space: the shape of a block is a number.

pub mod cpu;
#[cfg(feature = "gpu")]
pub mod gpu;

use crate::control::Counters;
use crate::sparse::Csr;
use crate::sparse::stored::{BlockMatrix, Dense, Real, SquareBlocks};
use std::fmt;
use std::sync::Arc;

/// A backend failed, or cannot do what was requested.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BackendError {
    /// No kernel exists for blocks of this shape.
    #[error("there is no kernel for a matrix of {rows} × {columns} blocks")]
    NoKernel {
        /// Rows of a block.
        rows: usize,
        /// Columns of a block.
        columns: usize,
    },
    /// It does not fit.
    #[error(
        "{what} needs {needed_mib} MiB, but the adapter \"{adapter}\" offers {offered_mib} MiB; \
         use a coarser mesh or a larger GPU"
    )]
    TooLarge {
        /// The data that does not fit.
        what: &'static str,
        /// The device.
        adapter: String,
        /// The total allocation then.
        needed_mib: u64,
        /// The limit.
        offered_mib: u64,
    },
    /// The device has no memory left.
    #[error("the adapter \"{adapter}\" has no memory left; close other programs that use it")]
    OutOfMemory {
        /// The device.
        adapter: String,
    },
    /// A slice of a matrix exceeds a binding.
    #[error(
        "a row of the matrix has so many entries that 32 such rows exceed one binding of the adapter \
         \"{adapter}\" ({limit_mib} MiB)"
    )]
    DenseRow {
        /// The device.
        adapter: String,
        /// The limit.
        limit_mib: u64,
    },
    /// The device was lost.
    #[error("the device \"{adapter}\" was lost: {reason}")]
    Lost {
        /// The device.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
    /// The driver has reported an error.
    #[error("the driver of \"{adapter}\" reported a fault: {reason}")]
    Fault {
        /// The device.
        adapter: String,
        /// The driver's message.
        reason: String,
    },
}

/// Arithmetic of the kernels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Precision {
    /// Vectors and K in f64, the preconditioner in f32.
    #[default]
    F64,
    /// Everything in f32; f64 accuracy comes from refinement around it.
    F32,
}

impl Precision {
    /// Bytes of a real number.
    pub fn bytes(self) -> usize {
        match self {
            Self::F64 => 8,
            Self::F32 => 4,
        }
    }
}

impl fmt::Display for Precision {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::F64 => "f64",
            Self::F32 => "f32",
        })
    }
}

/// Options for a GPU.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// A part of the adapter's name, or its number in the list of adapters; None takes the best one (the variable
    /// `WGPU_ADAPTER_NAME`, if set, names one).
    pub adapter: Option<String>,
    /// None takes f64 where the adapter has it.
    pub precision: Option<Precision>,
    /// The most bytes of one storage binding to use, below the adapter's own limit.
    pub max_binding: Option<u64>,
    /// Invocations among which the rows of a matrix are divided; None for as many as keep the adapter busy, or one a row on a
    /// software adapter.
    pub least_invocations: Option<usize>,
    /// Bytes of its memory to use at most, if less than the adapter reports.
    pub max_memory: Option<u64>,
    /// Runs the kernels with wgpu's own checks of every index and loop.
    pub checked: bool,
    /// Kernels can be timed, where the adapter has timestamps.
    pub timestamps: bool,
    /// Only a real GPU will do, no software adapter.
    pub hardware_only: bool,
    /// The number of this process among those of its machine that take an adapter by these options: where there are
    /// several as good as the best one, they take turns.
    pub turn: usize,
    /// A device that opens already ([`EngineOptions::open_ahead`](crate::engine::EngineOptions::open_ahead)); the first that asks takes it.
    #[cfg(feature = "gpu")]
    pub ahead: Option<gpu::Ahead>,
}

/// The progress of a CG run.
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
    /// By how much the iterations lowered eᵀKe, where e is the error of x: the sum of all α rᵀz.
    pub energy: f64,
    /// The part of it that the last iterations brought: up to the ninth iteration the last one; from the tenth on at
    /// least the last fifth of all iterations.
    pub recent: f64,
    /// The number of these iterations.
    pub recent_terms: usize,
    /// The run is over: the goal is reached, or the run broke down, or a number is not finite.
    pub done: bool,
    /// A direction had no positive curvature.
    pub broken: bool,
}

impl Progress {
    /// The estimate of eᵀKe from the last iterations; a single α rᵀz counts `to_come` times.
    pub(crate) fn remaining(&self, to_come: f64) -> f64 {
        match self.recent_terms {
            0 | 1 => self.recent * to_come,
            _ => self.recent,
        }
    }
}

/// The start and the end of a CG run: it ends at the first goal that it reaches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Run {
    /// Whether to start from the given x, with r = b − Kx on entry; otherwise from x = 0.
    pub continues: bool,
    /// ‖r‖.
    pub residual: f64,
    /// ‖r‖ relative to the r on entry: the larger of the two counts.
    pub residual_part: f64,
    /// eᵀKe as estimated from [`Progress::recent`].
    pub remaining: f64,
    /// The same relative to the sum of all α rᵀz, to be added.
    pub remaining_part: f64,
    /// The estimate of eᵀKe relative to the last α rᵀz, where only that term counts; a sum of several terms is itself
    /// the estimate.
    pub to_come: f64,
}

impl Run {
    /// The rest of a run that has come so far.
    pub(crate) fn after(self, progress: &Progress) -> Self {
        Self {
            continues: true,
            residual: progress.goal.sqrt(),
            residual_part: 0.0,
            remaining: self.remaining + self.remaining_part * progress.energy,
            ..self
        }
    }
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

/// Whether a block of that many terms α rᵀz is full after this many iterations; `shaders/shared/common.wgsl` does the
/// same.
///
/// The estimate of eᵀKe is the sum over the last full block and the unfinished one. Up to nine iterations each term is
/// a block, so the estimate is the last term. From then on a block is a fifth of all iterations, and the two blocks are
/// at least that. Where PCG is slow, α rᵀz falls and rises by orders of magnitude, and a single term means nothing.
/// Sums over blocks need neither a history nor differences, in which f32 would lose all digits.
fn block_is_full(terms: usize, iterations: usize) -> bool {
    terms >= (iterations / 5).max(1)
}

/// The use of a product with a matrix of a multigrid level.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Product {
    /// y = M x.
    Plain,
    /// y += M x.
    Added,
    /// y = b − M x.
    Residual,
}

/// One fused pass over the data per method.
///
/// Methods without a return value may only record their work; their errors appear in the next method that returns a
/// [`Result`]. Work recorded for a finished CG run has no effect.
///
/// # Panics
/// If the sizes of the arguments do not fit together.
pub trait Backend {
    /// Real numbers.
    type Vector;
    /// K, in square blocks.
    type Matrix;
    /// A rectangular matrix with mostly empty rows: B, Bᵀ.
    type Rows;
    /// The scalars of a CG run.
    type State;
    /// The number type in which the preconditioner is stored and applied.
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
    /// The Euclidean norm of a vector on the host that has an entry per unknown, here and on other ranks.
    fn norm(&self, x: &[f64]) -> f64;
    /// The work so far.
    fn counters(&self) -> Counters;
    /// The iterations that take as long as a new hierarchy.
    fn cost_of_hierarchy(&self) -> usize;

    /// A vector of `len` zeros.
    fn vector(&mut self, len: usize) -> Result<Self::Vector, BackendError>;
    /// The matrix, and the factor by which the stored one is larger: f32 has a narrow range.
    fn matrix(&mut self, k: Arc<dyn SquareBlocks>) -> Result<(Self::Matrix, f64), BackendError>;
    /// A rectangular matrix that maps vectors like `from` to vectors like `to`.
    fn rows(
        &mut self,
        matrix: &Csr,
        from: &Self::Vector,
        to: &Self::Vector,
    ) -> Result<Self::Rows, BackendError>;
    /// Scalars of a CG run on vectors like `like`.
    fn state(&mut self, k: &Self::Matrix, like: &Self::Vector)
    -> Result<Self::State, BackendError>;

    /// Copies numbers of the host into a vector; if they are fewer than its length, the rest is unchanged.
    fn upload(&mut self, from: &[f64], to: &mut Self::Vector);
    /// Copies a vector to the host.
    fn download(&mut self, from: &Self::Vector, to: &mut [f64]) -> Result<(), BackendError>;
    /// to = from.
    fn copy(&mut self, from: &Self::Vector, to: &mut Self::Vector);
    /// x = 0.
    fn clear(&mut self, x: &mut Self::Vector);
    /// y += a x; `a` is rounded to f32.
    fn add(&mut self, a: f64, x: &Self::Vector, y: &mut Self::Vector);
    /// y = M x on the rows of M that have entries; elsewhere y is unchanged.
    fn multiply_rows(&mut self, m: &Self::Rows, x: &Self::Vector, y: &mut Self::Vector);
    /// y −= K x.
    fn subtract_product(&mut self, k: &Self::Matrix, x: &Self::Vector, y: &mut Self::Vector);

    /// Starts CG for K x = b, r = b on entry: r rounded for the preconditioner, and x = 0 unless it continues.
    fn start(
        &mut self,
        r: &Self::Vector,
        x: &mut Self::Vector,
        rounded: &mut Self::LevelVector,
        state: &mut Self::State,
        run: Run,
    );
    /// q = K p, and pᵀq.
    fn multiply(
        &mut self,
        k: &Self::Matrix,
        p: &Self::Vector,
        q: &mut Self::Vector,
        state: &mut Self::State,
    );
    /// α = rᵀz / pᵀq, x += α p, r −= α q, r rounded for the preconditioner; ends the run where its goal is
    /// reached.
    fn step(
        &mut self,
        p: &Self::Vector,
        q: &Self::Vector,
        x: &mut Self::Vector,
        r: &mut Self::Vector,
        rounded: &mut Self::LevelVector,
        state: &mut Self::State,
    );
    /// β = new rᵀz / old rᵀz (0 in the first iteration), p = z + β p.
    fn direction(
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
    ) -> Result<Progress, BackendError>;

    /// A vector of `len` zeros for a multigrid level.
    fn level_vector(&mut self, len: usize) -> Result<Self::LevelVector, BackendError>;
    /// Copies numbers of the host into a vector of a level.
    fn write_level(&mut self, from: &[Self::Stored], to: &mut Self::LevelVector);
    /// Copies a vector of a level to the host.
    fn read_level(
        &mut self,
        from: &Self::LevelVector,
        to: &mut [Self::Stored],
    ) -> Result<(), BackendError>;
    /// Whether the run is known to be over, so that work recorded for it would have no effect.
    fn is_over(&self, state: &Self::State) -> bool;
    /// A matrix of a multigrid level.
    fn level_matrix(
        &mut self,
        m: BlockMatrix<Self::Stored>,
    ) -> Result<Self::LevelMatrix, BackendError>;
    /// A symmetric matrix of a multigrid level.
    fn symmetric_level_matrix(
        &mut self,
        m: BlockMatrix<Self::Stored>,
    ) -> Result<Self::LevelMatrix, BackendError> {
        self.level_matrix(m)
    }
    /// D⁻¹ of a level: square blocks of `block` rows, by rows.
    fn level_diagonal(
        &mut self,
        values: Vec<Self::Stored>,
        block: usize,
    ) -> Result<Self::LevelDiagonal, BackendError>;
    /// A dense matrix.
    fn dense_matrix(&mut self, m: Dense<Self::Stored>) -> Result<Self::DenseMatrix, BackendError>;

    /// First smoothing step from x = 0: d = c D⁻¹b, x = d.
    fn smooth_first(
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
    fn smooth(
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
    /// A smoothing step from a residual r where D⁻¹ is a matrix, with a block for each node of a patch: d = c₁ d + c₂
    /// D⁻¹ r, x += d. The first one, without c₁, is d = c₂ D⁻¹ r, x = d.
    #[allow(clippy::too_many_arguments, reason = "one fused pass over this data")]
    fn smooth_patches(
        &mut self,
        state: &Self::State,
        patches: &Self::LevelMatrix,
        c1: Option<Self::Stored>,
        c2: Self::Stored,
        r: &Self::LevelVector,
        d: &mut Self::LevelVector,
        x: &mut Self::LevelVector,
    );
    /// A product with a matrix of a level; `product` defines y, and `b` is read for a residual only.
    fn level_multiply(
        &mut self,
        state: &Self::State,
        m: &Self::LevelMatrix,
        product: Product,
        b: &Self::LevelVector,
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
}
