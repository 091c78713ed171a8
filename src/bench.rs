//! The CPU against the GPU, and the direct against the iterative path, on the same contact problem.
//!
//! Times are wall times of one run on one machine: compare them within a run, not between machines. Beside each is its
//! lower limit: the bytes that the algorithm must move at the bandwidth of a copy measured in the same run. Each input
//! is read once, each output written once.

use crate::backend::cpu::{self, COPIED, Cpu};
use crate::backend::gpu::{Context, Gpu, GpuError, KernelTime};
use crate::backend::{Backend, BackendError, Precision};
use crate::dual::{DirectDual, DualError, DualOperator, NestedDual};
use crate::output::{forget_peak_memory, peak_memory_mib};
use crate::problem::ContactProblem;
use crate::sparse::norm;
use crate::ssnm::{self, NewtonSettings, SolveError, Status};
use crate::stiffness::amg::{self, Hierarchy};
use crate::stiffness::cholesky::FactorError;
use crate::stiffness::pcg::{Pcg, PcgError};
use serde::Serialize;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// A benchmark could not be run.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// No device.
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// The device has failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// PCG has failed.
    #[error(transparent)]
    Pcg(#[from] PcgError),
    /// There is no factor.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// A product has failed.
    #[error(transparent)]
    Dual(#[from] DualError),
    /// A solve has failed.
    #[error(transparent)]
    Solve(#[from] SolveError),
}

/// Speeds of a backend at simple work of one size.
#[derive(Clone, Debug, Serialize)]
pub struct Speeds {
    /// The path.
    pub path: String,
    /// Unknowns.
    pub n: usize,
    /// Bytes per second of a copy or, on a device, of y += x, read and written bytes added up.
    pub copy: f64,
    /// Bytes per second of y −= K x.
    pub product: f64,
    /// Seconds per kernel launch with hardly any work; 0 on the CPU.
    pub dispatch: f64,
    /// Seconds of a PCG iteration with its V-cycle.
    pub iteration: f64,
    /// Seconds that its bytes take at the bandwidth of the copy.
    pub iteration_floor: f64,
    /// Iterations for K x = f to 1e-8.
    pub iterations: usize,
    /// Seconds to set up the hierarchy, on the CPU, and to move it.
    pub set_up: f64,
    /// Kernel launches per iteration.
    pub dispatches: f64,
    /// Times of each kernel in one more solve of the system, on devices that have timestamps.
    pub kernels: Vec<KernelTime>,
}

/// A contact problem solved on one path.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    /// The path.
    pub path: String,
    /// Refinement of the mesh: k of the plane, cells per metre in space.
    pub k: usize,
    /// Unknowns.
    pub n: usize,
    /// Contact nodes.
    pub m: usize,
    /// Its end.
    pub status: Status,
    /// Seconds for the factor, or for the hierarchy and moving it.
    pub set_up: f64,
    /// Seconds for b, σ_max, the outer steps and the final check.
    pub solve: f64,
    /// Seconds of both.
    pub total: f64,
    /// Outer steps.
    pub iter: usize,
    /// Products with A.
    #[serde(rename = "n_A")]
    pub n_a: usize,
    /// V-cycles of the whole solve.
    pub v_cycles: Option<usize>,
    /// V-cycles of one system with K to 1e-8.
    pub v_cycles_linear: Option<usize>,
    /// v_cycles / v_cycles_linear.
    pub work_ratio: Option<f64>,
    /// ‖u − u_reference‖ / ‖u_reference‖ against the first path.
    pub difference: f64,
    /// Multipliers that the first path has in another set.
    pub other_sets: usize,
    /// Seconds of `solve` for each V-cycle.
    pub per_v_cycle: Option<f64>,
    /// Seconds that the bytes of a PCG iteration with its V-cycle take at the bandwidth of a copy.
    pub iteration_floor: Option<f64>,
    /// The most memory that the process has held on this path, the problem included; not that of a device.
    pub peak_memory_mib: Option<f64>,
}

/// Repetitions of simple work between two looks at the clock.
const REPEATS: usize = 20;

/// The fastest of a few runs, in seconds.
fn fastest<T>(mut work: impl FnMut() -> Result<T, BenchError>) -> Result<f64, BenchError> {
    let mut best = f64::INFINITY;
    for _ in 0..4 {
        let start = Instant::now();
        work()?;
        best = best.min(start.elapsed().as_secs_f64());
    }
    Ok(best)
}

/// Measures a backend on a problem; `copy` is the bandwidth of a copy there, `real` the bytes of a number.
fn speeds<B: Backend, const D: usize>(
    path: String,
    backend: B,
    problem: &ContactProblem<D>,
    copy: f64,
    real: usize,
) -> Result<(Speeds, Pcg<B>), BenchError> {
    let k = problem.stiffness();
    let n = k.n_rows();
    let start = Instant::now();
    let settings = amg::AmgSettings::of_dimension(D);
    let vertices = problem.vertices().map(AsRef::as_ref);
    let hierarchy =
        Hierarchy::<B::Stored>::of_second_order(k, problem.coordinates(), vertices, &settings)
            .map_err(PcgError::from)?;
    let matrix_bytes = k.n_blocks() * (D * D * real + 4);
    // K p; p, q, x, r read and x, r written; r rounded; z read for the dot product and for the direction.
    let iteration_bytes = matrix_bytes + n * (11 * real + 12) + hierarchy.cycle_bytes();
    let mut pcg = Pcg::with_hierarchy(backend, Arc::clone(k) as _, hierarchy)?;
    let set_up = start.elapsed().as_secs_f64();

    let tiny = crate::sparse::Csr::from_triplets(1, n, [(0, 0, 1.0)]);
    let b = &mut pcg.backend;
    let (matrix, _) = b.matrix(Arc::clone(k) as _)?;
    let (mut x, mut y) = (b.vector(n)?, b.vector(n)?);
    b.upload(problem.load(), &mut x);
    let mut one = b.vector(1)?;
    let rows = b.rows(&tiny, &x, &one)?;
    let mut number = [0.0];
    let product = fastest(|| {
        for _ in 0..REPEATS {
            b.subtract_product(&matrix, &x, &mut y);
        }
        Ok(b.download(&one, &mut number)?)
    })?;
    let launches = 50 * REPEATS;
    let dispatch = fastest(|| {
        for _ in 0..launches {
            b.multiply_rows(&rows, &x, &mut one);
        }
        Ok(b.download(&one, &mut number)?)
    })?;

    let before = pcg.backend.counters();
    let mut u = vec![0.0; n];
    let seconds = fastest(|| Ok(pcg.solve(problem.load(), &mut u, 1e-8, &Default::default())?))?;
    let iterations = pcg.counts.iterations / pcg.counts.solves;
    let issued = pcg.backend.counters().dispatches - before.dispatches;
    let speeds = Speeds {
        path,
        n: problem.n_free(),
        copy,
        product: (REPEATS * (matrix_bytes + 3 * n * real)) as f64 / product,
        dispatch: if issued > 0 {
            dispatch / launches as f64
        } else {
            0.0
        },
        iteration: seconds / iterations as f64,
        iteration_floor: iteration_bytes as f64 / copy,
        iterations,
        set_up,
        dispatches: issued as f64 / pcg.counts.iterations as f64,
        kernels: Vec::new(),
    };
    Ok((speeds, pcg))
}

/// Simple work on the CPU.
pub fn measure<const D: usize>(problem: &ContactProblem<D>) -> Result<Speeds, BenchError> {
    let cpu = Cpu::<f32>::default();
    let copy = cpu::copy_bandwidth(COPIED);
    Ok(speeds("cpu".to_owned(), cpu, problem, copy, 8)?.0)
}

/// Simple work on a device.
pub fn measure_gpu<const D: usize>(
    problem: &ContactProblem<D>,
    context: &Arc<Context>,
) -> Result<Speeds, BenchError> {
    let mut gpu = Gpu::new(context)?;
    // Enough for an idle device to wake up.
    let time = Duration::from_millis(300);
    let copied = if context.adapter.is_software {
        COPIED / 4
    } else {
        COPIED
    };
    let copy = gpu.speed(copied as u64, time)?.bandwidth;
    let real = context.precision.bytes();
    let path = format!("gpu {}", context.precision);
    // In f32 a solve to 1e-8 consists of corrections, but each iteration is PCG in f32.
    let (mut speeds, mut pcg) = speeds(path, gpu, problem, copy, real)?;
    pcg.backend.time_kernels()?;
    let mut u = vec![0.0; problem.stiffness().n_rows()];
    pcg.solve(problem.load(), &mut u, 1e-8, &Default::default())?;
    speeds.kernels = pcg.backend.kernel_times();
    Ok(speeds)
}

/// A way to solve.
pub enum Path {
    /// On the factor.
    CpuCholesky,
    /// By PCG on the CPU.
    CpuPcg,
    /// By PCG on a device.
    Gpu(Arc<Context>),
}

impl Path {
    /// The name of its place among the [`Speeds`].
    fn place(&self) -> String {
        match self {
            Self::CpuCholesky => String::new(),
            Self::CpuPcg => "cpu".to_owned(),
            Self::Gpu(_) => self.name(),
        }
    }

    fn name(&self) -> String {
        match self {
            Self::CpuCholesky => "cpu cholesky".to_owned(),
            Self::CpuPcg => "cpu pcg".to_owned(),
            Self::Gpu(context) => match context.precision {
                Precision::F64 => "gpu f64".to_owned(),
                Precision::F32 => "gpu f32".to_owned(),
            },
        }
    }
}

/// Solves the problem on each path; `before` is told which comes next. `speeds` has those of the same problem. (One function,
/// because a path has to be set up, timed and dropped before the next one takes its memory.)
pub fn solve_on<const D: usize>(
    paths: &[Path],
    k: usize,
    problem: &ContactProblem<D>,
    tolerance: f64,
    speeds: &[Speeds],
    mut before: impl FnMut(&str),
) -> Result<Vec<Row>, BenchError> {
    let mut rows: Vec<Row> = Vec::new();
    let mut reference: Option<ssnm::Solution<D>> = None;
    for path in paths {
        before(&path.name());
        let alone = forget_peak_memory();
        let start = Instant::now();
        let mut linear = None;
        let mut dual: Box<dyn DualOperator> = match path {
            Path::CpuCholesky => Box::new(DirectDual::new(problem)?),
            Path::CpuPcg => {
                let cpu = Cpu::<f32>::default();
                let dual = NestedDual::new(problem, cpu, Default::default())?;
                Box::new(dual)
            }
            Path::Gpu(context) => {
                let gpu = Gpu::new(context)?;
                let dual = NestedDual::new(problem, gpu, Default::default())?;
                Box::new(dual)
            }
        };
        let set_up = start.elapsed().as_secs_f64();
        let settings = NewtonSettings {
            tolerance,
            ..Default::default()
        };
        let solution = ssnm::solve(problem, dual.as_mut(), &settings, |_| {
            ControlFlow::Continue(())
        })?;
        let total = start.elapsed().as_secs_f64();
        let v_cycles = dual.costs().map(|costs| costs.solves.iterations);
        if v_cycles.is_some() {
            linear = dual.linear_iterations(1e-8)?;
        }
        let (difference, other_sets) = match &reference {
            None => (0.0, 0),
            Some(reference) => {
                let change: Vec<f64> = solution
                    .u
                    .iter()
                    .zip(&reference.u)
                    .map(|(a, b)| a - b)
                    .collect();
                (
                    norm(&change) / norm(&reference.u),
                    solution.sets.differences(&reference.sets),
                )
            }
        };
        rows.push(Row {
            path: path.name(),
            k,
            n: problem.n_free(),
            m: problem.m(),
            status: solution.status,
            set_up,
            solve: total - set_up,
            total,
            iter: solution.info.iter,
            n_a: solution.info.n_a,
            v_cycles,
            v_cycles_linear: linear,
            work_ratio: v_cycles.zip(linear).map(|(v, l)| v as f64 / l as f64),
            difference,
            other_sets,
            per_v_cycle: v_cycles.map(|v| (total - set_up) / v as f64),
            iteration_floor: (speeds.iter())
                .find(|s| s.path == path.place() && s.n == problem.n_free())
                .map(|s| s.iteration_floor),
            peak_memory_mib: peak_memory_mib().filter(|_| alone),
        });
        reference.get_or_insert(solution);
    }
    Ok(rows)
}

/// The exponent p of seconds ∝ nᵖ that fits best (least squares of the logarithms); None for less than two
/// sizes.
pub fn growth(points: impl Iterator<Item = (usize, f64)>) -> Option<f64> {
    let logs: Vec<(f64, f64)> = points
        .filter(|&(n, seconds)| n > 0 && seconds > 0.0)
        .map(|(n, seconds)| ((n as f64).ln(), seconds.ln()))
        .collect();
    let count = logs.len() as f64;
    let mean = |f: fn(&(f64, f64)) -> f64| logs.iter().map(f).sum::<f64>() / count;
    let (x, y) = (mean(|l| l.0), mean(|l| l.1));
    let spread: f64 = logs.iter().map(|l| (l.0 - x).powi(2)).sum();
    let joint: f64 = logs.iter().map(|l| (l.0 - x) * (l.1 - y)).sum();
    (spread > 0.0).then(|| joint / spread)
}

#[cfg(test)]
mod tests {
    use super::growth;

    #[test]
    fn the_growth_of_a_power_is_its_exponent() {
        let points = [10usize, 100, 1000].map(|n| (n, 3.0 * (n as f64).powf(1.25)));
        let found = growth(points.into_iter()).expect("three sizes");
        approx::assert_relative_eq!(found, 1.25, max_relative = 1e-12);
        assert!(growth([(10, 1.0)].into_iter()).is_none());
    }
}
