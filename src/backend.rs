//! Where the work of size n is done: on the CPU, or on a GPU through wgpu.
//!
//! [`Backend`] is cut at the size of a kernel: each method is one fused pass over the data, and the
//! scalars of an iteration stay where the vectors are. The algorithms ([`crate::stiffness::pcg`]) are
//! written once over it; [`cpu::Cpu`] is the reference and the fallback, [`gpu::Gpu`] runs the WGSL
//! kernels in `shaders/`.

pub mod cpu;
pub mod gpu;

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
    /// The run is over: the goal is reached, or the run broke down, or a number is not finite.
    pub done: bool,
    /// A direction had no positive curvature.
    pub broken: bool,
}

/// What a backend has done so far; all zero on the CPU but for the preconditioner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Kernel launches.
    pub dispatches: usize,
    /// Times that the host has waited for numbers.
    pub readbacks: usize,
    /// Command buffers handed to the device.
    pub submissions: usize,
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
    /// x = 0.
    fn clear(&mut self, x: &mut Self::Vector);
    /// y = M x on the rows of M that have entries; y is left as it is elsewhere.
    fn multiply_rows(&mut self, m: &Self::Rows, x: &Self::Vector, y: &mut Self::Vector);
    /// y −= K x.
    fn subtract_product(&mut self, k: &Self::Matrix, x: &Self::Vector, y: &mut Self::Vector);

    /// Starts CG for K x = b with r = b on entry: x = 0, p = D⁻¹r; the run ends at ‖r‖ ≤ `tolerance` ‖b‖.
    fn cg_start(
        &mut self,
        d: &Self::BlockDiagonal,
        r: &Self::Vector,
        x: &mut Self::Vector,
        p: &mut Self::Vector,
        state: &mut Self::State,
        tolerance: f64,
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

/// The power of two at or below a positive number; 1 for anything else.
pub(crate) fn power_of_two_below(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() {
        x.log2().floor().clamp(-1000.0, 1000.0).exp2()
    } else {
        1.0
    }
}
