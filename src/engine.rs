//! Which arithmetic solves a problem: the choice between CPU and GPU, Cholesky and PCG, and the way back
//! to the CPU where a GPU fails.

use crate::backend::GpuError;
use crate::backend::cpu::Cpu;
use crate::backend::gpu::{Context, Gpu, Options as GpuOptions, Precision};
use crate::dual::{Accuracy, Costs, DualError, DualOperator, Followed, NestedDual, Stop};
use crate::problem::ContactProblem;
use crate::stiffness::cholesky::{CholeskyDual, FactorError};
use crate::stiffness::pcg::{PcgError, Preconditioner};
use std::sync::Arc;

/// Where to compute.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Place {
    /// On a real GPU where that gains time, on the CPU otherwise, and on the CPU if the GPU fails.
    #[default]
    Auto,
    Cpu,
    /// On a GPU or, if there is no other, on a software adapter.
    Gpu,
}

/// How to apply K⁻¹.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stiffness {
    /// The sparse factor where it can be had, PCG otherwise; PCG on a GPU.
    #[default]
    Auto,
    Cholesky,
    Pcg,
}

/// What to ask of an [`Engine`].
#[derive(Clone, Debug, Default)]
pub struct Options {
    pub place: Place,
    pub stiffness: Stiffness,
    /// Inside PCG.
    pub preconditioner: Preconditioner,
    /// Adapter and precision, where a GPU is used.
    pub gpu: GpuOptions,
}

/// No engine could be made.
#[derive(Debug, thiserror::Error)]
pub enum EngineError {
    #[error(
        "the sparse Cholesky factor runs on the CPU only: use --stiffness pcg (or auto) with --backend gpu"
    )]
    NoCholeskyOnGpu,
    #[error(transparent)]
    Gpu(#[from] GpuError),
    #[error(transparent)]
    Factor(#[from] FactorError),
    #[error(transparent)]
    Pcg(PcgError),
}

impl From<PcgError> for EngineError {
    fn from(error: PcgError) -> Self {
        match error {
            PcgError::Gpu(error) => Self::Gpu(error),
            error => Self::Pcg(error),
        }
    }
}

/// Unknowns from which a GPU is worth its launches in `Auto`.
const WORTH_A_GPU: usize = 50_000;

enum Path<'a> {
    Cholesky(Box<CholeskyDual>),
    Cpu(Box<NestedDual<'a, Cpu>>),
    Gpu(Box<NestedDual<'a, Gpu>>, Arc<Context>),
}

/// A dual operator by the means chosen.
///
/// With [`Place::Auto`] a GPU that fails in the middle of a solve is replaced by the CPU: the product under
/// way is made again and nothing else is lost.
pub struct Engine<'a> {
    problem: &'a ContactProblem,
    path: Path<'a>,
    options: Options,
    log: Box<dyn FnMut(&str) + 'a>,
}

impl<'a> Engine<'a> {
    /// Chooses and sets up; `log` hears, in one line each, what was chosen and why, and of each way back to
    /// the CPU.
    pub fn new(
        problem: &'a ContactProblem,
        options: Options,
        log: impl FnMut(&str) + 'a,
    ) -> Result<Self, EngineError> {
        let mut log: Box<dyn FnMut(&str) + 'a> = Box::new(log);
        let n = problem.n();
        let path = match (options.place, options.stiffness) {
            (Place::Gpu, Stiffness::Cholesky) => return Err(EngineError::NoCholeskyOnGpu),
            (Place::Gpu, _) => on_gpu(problem, &options, &mut log)?,
            (Place::Cpu, Stiffness::Pcg) => on_cpu(problem, &options)?,
            (_, Stiffness::Cholesky) => Path::Cholesky(Box::new(CholeskyDual::new(problem)?)),
            (place, Stiffness::Auto) => match CholeskyDual::new(problem) {
                Ok(dual) => Path::Cholesky(Box::new(dual)),
                Err(error @ (FactorError::OutOfMemory { .. } | FactorError::TooLarge)) => {
                    log(&format!("{error}: using PCG instead"));
                    if place == Place::Auto {
                        on_best(problem, &options, &mut log)?
                    } else {
                        on_cpu(problem, &options)?
                    }
                }
                Err(error) => return Err(error.into()),
            },
            // Whoever names an adapter means it.
            (Place::Auto, Stiffness::Pcg) if n < WORTH_A_GPU && options.gpu.adapter.is_none() => {
                on_cpu(problem, &options)?
            }
            (Place::Auto, Stiffness::Pcg) => on_best(problem, &options, &mut log)?,
        };
        if !matches!(path, Path::Cholesky(_)) && problem.coordinates().is_none() {
            log(
                "no coordinates are given: multigrid has no rotations to work with and needs more iterations",
            );
        }
        Ok(Self {
            problem,
            path,
            options,
            log,
        })
    }

    /// "cpu" or "gpu".
    pub fn backend(&self) -> &'static str {
        match self.path {
            Path::Gpu(..) => "gpu",
            _ => "cpu",
        }
    }

    /// "cholesky" or "pcg".
    pub fn stiffness(&self) -> &'static str {
        match self.path {
            Path::Cholesky(_) => "cholesky",
            _ => "pcg",
        }
    }

    /// The adapter, on a GPU.
    pub fn adapter(&self) -> Option<String> {
        self.context().map(|context| context.adapter.to_string())
    }

    /// What the kernels compute in.
    pub fn precision(&self) -> Precision {
        self.context()
            .map_or(Precision::F64, |context| context.precision)
    }

    /// The device in use.
    pub fn context(&self) -> Option<&Arc<Context>> {
        match &self.path {
            Path::Gpu(_, context) => Some(context),
            _ => None,
        }
    }

    /// The levels of multigrid, where it is used, as a table.
    pub fn hierarchy(&self) -> Option<&str> {
        match &self.path {
            Path::Cholesky(_) => None,
            Path::Cpu(dual) => dual.hierarchy(),
            Path::Gpu(dual, _) => dual.hierarchy(),
        }
    }

    /// The factor, on the direct path.
    pub fn cholesky(&self) -> Option<&CholeskyDual> {
        match &self.path {
            Path::Cholesky(dual) => Some(dual),
            _ => None,
        }
    }

    /// Runs `work` and, if the GPU fails in it and the choice was left open, runs it again on the CPU.
    fn with_fallback<T>(
        &mut self,
        mut work: impl FnMut(&mut dyn DualOperator) -> Result<T, DualError>,
    ) -> Result<T, DualError> {
        let outcome = match &mut self.path {
            Path::Cholesky(dual) => return work(dual.as_mut()),
            Path::Cpu(dual) => return work(dual.as_mut()),
            Path::Gpu(dual, _) => work(dual.as_mut()),
        };
        match outcome {
            Err(DualError::Pcg(PcgError::Gpu(error))) if self.options.place == Place::Auto => {
                (self.log)(&format!(
                    "{error}; going on with the Cholesky factor on the CPU"
                ));
                let mut dual = Box::new(CholeskyDual::new(self.problem)?);
                let outcome = work(dual.as_mut());
                self.path = Path::Cholesky(dual);
                outcome
            }
            outcome => outcome,
        }
    }
}

fn on_cpu<'a>(problem: &'a ContactProblem, options: &Options) -> Result<Path<'a>, EngineError> {
    let cpu = Cpu::<f32>::default();
    let dual = NestedDual::new(problem, cpu, options.preconditioner)?;
    Ok(Path::Cpu(Box::new(dual)))
}

fn on_gpu<'a>(
    problem: &'a ContactProblem,
    options: &Options,
    log: &mut dyn FnMut(&str),
) -> Result<Path<'a>, EngineError> {
    let context = Context::new(&options.gpu)?;
    log(&format!(
        "adapter: {}, {}; taken because: {}; kernels in {}{}",
        context.adapter,
        context.adapter.driver,
        context.reason,
        context.precision,
        match context.precision {
            Precision::F64 => "",
            Precision::F32 => " inside f64 refinement",
        }
    ));
    let gpu = Gpu::new(&context)?;
    let dual = NestedDual::new(problem, gpu, options.preconditioner)?;
    Ok(Path::Gpu(Box::new(dual), context))
}

/// PCG on a real GPU or, without one or if it fails, on the CPU.
fn on_best<'a>(
    problem: &'a ContactProblem,
    options: &Options,
    log: &mut dyn FnMut(&str),
) -> Result<Path<'a>, EngineError> {
    let mut hardware = options.clone();
    hardware.gpu.hardware_only = options.gpu.adapter.is_none();
    match on_gpu(problem, &hardware, log) {
        Err(EngineError::Gpu(error)) => {
            log(&format!("{error}; computing on the CPU"));
            on_cpu(problem, options)
        }
        outcome => outcome,
    }
}

impl DualOperator for Engine<'_> {
    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        self.with_fallback(|dual| dual.apply(p, y, accuracy, stop))
    }

    fn right_hand_side(
        &mut self,
        b: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        self.with_fallback(|dual| dual.right_hand_side(b, accuracy, stop))
    }

    fn gradient(
        &mut self,
        lambda: &[f64],
        r: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<Option<Followed>, DualError> {
        self.with_fallback(|dual| dual.gradient(lambda, r, accuracy, stop))
    }

    fn displacement(
        &mut self,
        lambda: &[f64],
        accuracy: f64,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        self.with_fallback(|dual| dual.displacement(lambda, accuracy, stop))
    }

    fn linear_iterations(&mut self, tolerance: f64) -> Result<Option<usize>, DualError> {
        self.with_fallback(|dual| dual.linear_iterations(tolerance))
    }

    fn costs(&self) -> Option<Costs> {
        match &self.path {
            Path::Cholesky(_) => None,
            Path::Cpu(dual) => dual.costs(),
            Path::Gpu(dual, _) => dual.costs(),
        }
    }
}
