//! The choice between CPU and GPU, Cholesky and PCG for a problem, and the way back to the CPU if a GPU fails.

use crate::backend::cpu::Cpu;
#[cfg(feature = "gpu")]
use crate::backend::cpu::copy_bandwidth;
#[cfg(feature = "gpu")]
use crate::backend::gpu::{Ahead, Context, Gpu, GpuError, Speed};
use crate::backend::{GpuOptions, Precision};
use crate::control::{Accuracy, Correction, Costs, Stop};
use crate::dual::{Change, DirectDual, DualError, DualOperator, NestedDual, Request, plan};
use crate::memory;
use crate::problem::{ContactProblem, System};
use crate::sparse::Csr;
use crate::ssnm::RecycledSubspace;
use crate::stiffness::cholesky::FactorError;
use crate::stiffness::pcg::{PcgError, Preconditioner};
use std::sync::Arc;
#[cfg(feature = "gpu")]
use std::time::Duration;

/// The device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Device {
    /// On a real GPU where that gains time, on the CPU otherwise, and on the CPU if the GPU fails.
    #[default]
    Auto,
    /// On the CPU.
    Cpu,
    /// On a GPU or, without one, on a software adapter.
    Gpu,
}

/// The way to apply K⁻¹.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stiffness {
    /// The sparse factor where it is predicted to fit into half of the memory and not to take much longer
    /// than PCG; PCG otherwise, and on a GPU.
    #[default]
    Auto,
    /// The sparse factor.
    Cholesky,
    /// Preconditioned conjugate gradients.
    Pcg,
}

/// Options for an [`Engine`].
#[derive(Clone, Debug, Default)]
pub struct EngineOptions {
    /// The device.
    pub place: Device,
    /// The way to apply K⁻¹.
    pub stiffness: Stiffness,
    /// Inside PCG.
    pub preconditioner: Preconditioner,
    /// Adapter and precision, if a GPU is used.
    pub gpu: GpuOptions,
}

#[cfg(not(feature = "gpu"))]
impl EngineOptions {
    /// There is no support for GPUs.
    pub fn open_ahead(&mut self, _dimension: usize, _unknowns: usize) {}
}

#[cfg(feature = "gpu")]
impl EngineOptions {
    /// Begins to open a GPU in another thread, where an engine for so many unknowns in the plane or in space would open one: it takes
    /// half a second. The first [`Engine`] with these options, or a copy, takes it.
    pub fn open_ahead(&mut self, dimension: usize, unknowns: usize) {
        let options = match (self.place, self.stiffness) {
            (Device::Gpu, Stiffness::Auto | Stiffness::Pcg) => self.gpu.clone(),
            // In the plane the factor is mostly faster.
            (Device::Auto, Stiffness::Auto) if dimension == 2 => return,
            (Device::Auto, Stiffness::Auto | Stiffness::Pcg) if unknowns >= WORTH_A_GPU => {
                self.hardware()
            }
            _ => return,
        };
        self.gpu.ahead = Some(Ahead::new(options));
    }

    /// The options for a GPU that is not requested.
    fn hardware(&self) -> GpuOptions {
        GpuOptions {
            // Whoever names an adapter means it.
            hardware_only: self.gpu.adapter.is_none(),
            ..self.gpu.clone()
        }
    }
}

/// No engine could be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EngineError {
    /// A factor was asked for on a GPU.
    #[error("the sparse Cholesky factor runs on the CPU only")]
    NoCholeskyOnGpu,
    /// A GPU was requested where there is no support for it.
    #[error("this program was built without support for GPUs (the feature \"gpu\" of the crate)")]
    NoGpuSupport,
    /// No GPU could be used.
    #[cfg(feature = "gpu")]
    #[error(transparent)]
    Gpu(#[from] GpuError),
    /// K has no factor.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// PCG could not be set up.
    #[error(transparent)]
    Pcg(#[from] PcgError),
}

/// From this number of unknowns on, `Auto` opens a GPU to find out whether it is faster; it takes about half a second.
const WORTH_A_GPU: usize = 50_000;
/// An iteration with its V-cycle moves the bytes of K in f64 about this many times: 4 with hexahedra, 7 with quadrilaterals
/// (`signorini bench`).
#[cfg(feature = "gpu")]
const PASSES: f64 = 5.0;
/// Launches of an iteration with its V-cycle: 26 to 60 there.
#[cfg(feature = "gpu")]
const LAUNCHES: f64 = 45.0;
/// The time of f32 relative to that of f64, because of its corrections and of the residuals that the host makes: 1 to 2.4 on an
/// H100.
#[cfg(feature = "gpu")]
const SINGLE: f64 = 1.5;
/// A warning.
#[cfg(feature = "gpu")]
const SOFTWARE: &str = "this adapter computes on the CPU, far slower than --backend cpu. Where there is a GPU, its Vulkan driver was not \
     found: in a container it needs the capability \"graphics\" (NVIDIA_DRIVER_CAPABILITIES=all) and the package libvulkan1; an NVIDIA \
     card that is divided (MIG) has no Vulkan";
/// Bytes of the vectors that measure a bandwidth: beyond the caches of all but the largest processors.
#[cfg(feature = "gpu")]
const MEASURED: usize = 64 << 20;

/// Seconds of the factorisation for an operation and, with ordering and solves, for an unknown. Then seconds of the
/// whole iterative path for an unknown of the plane and of space, shared by up to this many threads. Measured with the
/// reference problems of n = 2e5 to 8e5, in space of 2e4 to 1e6, on two cores (`signorini bench`); only their ratio
/// matters.
const FACTOR_OPERATION: f64 = 5e-11;
const FACTOR_UNKNOWN: f64 = 1.2e-6;
const ITERATIVE_UNKNOWN: f64 = 12e-6;
const ITERATIVE_UNKNOWN_IN_SPACE: f64 = 30e-6;
const ITERATIVE_THREADS: f64 = 8.0;
/// Blocks in a row of those problems, of bilinear quadrilaterals and trilinear hexahedra. With elements of second order
/// rows are longer (16 and 64 on average with all middle nodes), and an iteration takes as many times more.
const LONG_ROW: f64 = 9.0;
const LONG_ROW_IN_SPACE: f64 = 27.0;
/// Poisson's ratio of those problems.
const ORDINARY_POISSON: f64 = 0.3;
/// PCG is called slow from this multiple of their iterations on: ν = 0.49 has 4.5 times as many.
const SLOW: f64 = 4.0;
/// The factor is taken up to this multiple of the time that PCG is predicted to take. Its own time is certain, while
/// that of PCG grows on meshes with stretched elements or hard inclusions.
const PREFERRED: f64 = 2.0;
/// Predictions below this many seconds are not logged.
const WORTH_A_WORD: f64 = 1.0;

/// By how many times iterations of PCG grow near ν = 0.5. They grow in proportion to (1 − 2ν)^−½ (docs/multigrid.md).
fn growth_of_iterations(poisson: f64) -> f64 {
    let compressible = (1.0 - 2.0 * poisson).max(f64::EPSILON);
    ((1.0 - 2.0 * ORDINARY_POISSON) / compressible)
        .sqrt()
        .max(1.0)
}

/// What PCG costs on a problem with nearly incompressible bodies; None on others.
pub(crate) fn slowness<const D: usize>(problem: &System<D>) -> Option<String> {
    let poisson = problem.poisson();
    let growth = growth_of_iterations(poisson);
    (growth > SLOW).then(|| {
        format!(
            "ν = {poisson}: conjugate gradients take about {growth:.0} times as many iterations as with ν = {ORDINARY_POISSON}"
        )
    })
}

enum Path {
    Cholesky(Box<DirectDual>),
    Cpu(Box<NestedDual<Cpu>>),
    #[cfg(feature = "gpu")]
    Gpu(Box<NestedDual<Gpu>>, Arc<Context>),
}

impl Path {
    fn dual(&self) -> &dyn DualOperator {
        match self {
            Self::Cholesky(dual) => dual.as_ref(),
            Self::Cpu(dual) => dual.as_ref(),
            #[cfg(feature = "gpu")]
            Self::Gpu(dual, _) => dual.as_ref(),
        }
    }

    fn dual_mut(&mut self) -> &mut dyn DualOperator {
        match self {
            Self::Cholesky(dual) => dual.as_mut(),
            Self::Cpu(dual) => dual.as_mut(),
            #[cfg(feature = "gpu")]
            Self::Gpu(dual, _) => dual.as_mut(),
        }
    }

    /// Remarks on PCG: the levels of multigrid, and why multigrid is missing although requested.
    fn levels(&self) -> [Option<&str>; 2] {
        match self {
            Self::Cholesky(_) => [None; 2],
            Self::Cpu(dual) => dual.levels(),
            #[cfg(feature = "gpu")]
            Self::Gpu(dual, _) => dual.levels(),
        }
    }
}

/// How often an [`Engine`] has set up the data that depends on K.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SetUps {
    /// From nothing: an order of elimination with its symbolic factor, or a hierarchy with its aggregates.
    pub made: usize,
    /// The values alone, in existing structures, for another problem.
    pub renewed: usize,
}

type Again = dyn Fn(bool, &EngineOptions, &mut dyn FnMut(&str)) -> Result<Path, EngineError> + Send;

/// A dual operator by the means chosen.
///
/// With [`Device::Auto`] a GPU that fails in the middle of a solve is replaced by the CPU: the current product is made again
/// and nothing else is lost.
///
/// It owns its data, and may be kept, moved to another thread and used again. Problems that differ only by load, gap,
/// origin of slip, slip bounds and coefficients of friction share one factor or one hierarchy. Each solve knows the
/// products of earlier ones.
///
/// # Example
/// A block pressed on a plane and pushed along it, with 20 coefficients of friction:
///
/// ```
/// use signorini::contact::Obstacle;
/// use signorini::elasticity::Material;
/// use signorini::engine::Engine;
/// use signorini::mesh::structured::{CellShape, rectangle};
/// use signorini::model::{Model, Pair, Support, Traction};
/// use signorini::ssnm::Status;
///
/// let plane = Obstacle::HalfSpace { point: [0.0; 2], normal: [0.0, 1.0] };
/// let built = Model::on(rectangle([0.0; 2], [3.0, 1.0], [12, 4], CellShape::Quad, "body", ""))
///     .material(Material::new(2e5, 0.3))
///     .support(Support::on("left").fixed())
///     .traction(Traction::on("top").pressure(100.0))
///     .traction(Traction::on("right").x(50.0))
///     .contact(Pair::obstacle("bottom", plane).coulomb(0.1))
///     .build()?;
/// let mut engine = Engine::new(&built.problem, Default::default(), |line| println!("{line}"))?;
/// // The floor carries ever more of the push, until nothing slips any more.
/// let (mut friction, mut products) = (Vec::new(), Vec::new());
/// for k in 0..20 {
///     let mu = vec![0.05 * f64::from(k); built.problem.m()];
///     let problem = built.problem.clone().with_friction_coefficient(mu)?;
///     let solution = problem.solve_on(&mut engine, &Default::default())?;
///     assert_eq!(solution.status, Status::Converged);
///     friction.push(-solution.lambda[problem.m()..].iter().sum::<f64>());
///     products.push(solution.n_a());
/// }
/// assert!(friction.is_sorted_by(|a, b| a.abs() < 1.000_001 * b.abs() + 1e-6));
/// // The first solve takes eight products with A, those behind it two on average: they know what it has found out.
/// assert!(products[1..].iter().sum::<usize>() <= 3 * 19, "{products:?}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Engine {
    /// [`again`] for the problem, hiding its dimension from the engine.
    again: Box<Again>,
    /// The addresses of K and B of the problem, which it keeps: they identify its problems. None after an update that
    /// failed.
    matrices: Option<[usize; 2]>,
    set_ups: SetUps,
    path: Path,
    options: EngineOptions,
    log: Box<dyn FnMut(&str) + Send>,
    /// The pairs that earlier solves found.
    pub(crate) recycled: RecycledSubspace,
}

impl Engine {
    /// Chooses and sets up; `log` receives one line on each choice with its reason, and on each fallback to the CPU.
    pub fn new<const D: usize>(
        problem: &ContactProblem<D>,
        options: EngineOptions,
        mut log: impl FnMut(&str) + Send + 'static,
    ) -> Result<Self, EngineError> {
        let path = chosen(problem, &options, &mut log)?;
        Ok(Self::on(path, problem.clone(), options, Box::new(log)))
    }

    /// On a path that has been set up for a problem.
    fn on<const D: usize>(
        path: Path,
        problem: ContactProblem<D>,
        options: EngineOptions,
        log: Box<dyn FnMut(&str) + Send>,
    ) -> Self {
        Self {
            matrices: Some(addresses(&problem)),
            again: Box::new(move |lost, options, log| again(&problem, lost, options, log)),
            set_ups: SetUps {
                made: 1,
                renewed: 0,
            },
            path,
            options,
            log,
            recycled: RecycledSubspace::default(),
        }
    }

    /// Whether it was made for a problem with the same K, N and T: for this one, or for one related to it by
    /// [`ContactProblem::with_data`] and its like.
    pub fn fits<const D: usize>(&self, problem: &ContactProblem<D>) -> bool {
        self.matrices == Some(addresses(problem))
    }

    /// Switches to another problem and keeps as much as possible. If K has the same pattern, that is the order of elimination and
    /// the symbolic factor, or the structure of the hierarchy. If K is the same and N, T and d have changed, it is everything, as
    /// long as B touches no other unknowns. Otherwise everything is set up again; [`Engine::set_ups`] counts this. Pairs of
    /// earlier solves are dropped, unless K, N and T are the same.
    ///
    /// # Errors
    /// Those of [`Engine::new`]. The engine then fits no problem until an update succeeds.
    ///
    /// # Example
    /// Ten values of Young's modulus, and then another position of the floor, all with one order of elimination:
    ///
    /// ```
    /// use signorini::contact::Obstacle;
    /// use signorini::elasticity::Material;
    /// use signorini::engine::{Engine, SetUps};
    /// use signorini::mesh::structured::{CellShape, rectangle};
    /// use signorini::model::{Model, Pair, Support, Traction};
    /// use signorini::ssnm::Status;
    ///
    /// let built = |young: f64, normal: [f64; 2]| {
    ///     let plane = Obstacle::HalfSpace { point: [0.0, -1e-4], normal };
    ///     Model::on(rectangle([0.0; 2], [3.0, 1.0], [12, 4], CellShape::Quad, "body", ""))
    ///         .material(Material::new(young, 0.3))
    ///         .support(Support::on("left").fixed())
    ///         .traction(Traction::on("top").pressure(100.0))
    ///         .contact(Pair::obstacle("bottom", plane).coulomb(0.3))
    ///         .build()
    /// };
    /// let level = [0.0, 1.0];
    /// let first = built(1e5, level)?.problem;
    /// let mut engine = Engine::new(&first, Default::default(), |line| println!("{line}"))?;
    /// let mut forces = Vec::new();
    /// for k in 1..=10 {
    ///     let problem = built(1e5 * f64::from(k), level)?.problem;
    ///     engine.update(&problem)?;
    ///     let solution = problem.solve_on(&mut engine, &Default::default())?;
    ///     forces.push(solution.lambda[..problem.m()].iter().sum::<f64>());
    /// }
    /// // The stiffer the body, the more of the load its support carries.
    /// assert!(forces.is_sorted_by(|a, b| a > b));
    /// assert_eq!(engine.set_ups(), SetUps { made: 1, renewed: 10 });
    /// // The floor is tilted a little: K stays as it is.
    /// engine.update(&first)?;
    /// let other = built(1e5, [0.001, 1.0])?.problem;
    /// let (normal, tangential) = (other.normal().clone(), other.tangential().clone());
    /// let bounds = vec![0.0; other.m()];
    /// let tilted = first.with_contact(normal, tangential, other.gap().to_vec(), bounds)?;
    /// engine.update(&tilted)?;
    /// assert_eq!(tilted.solve_on(&mut engine, &Default::default())?.status, Status::Converged);
    /// assert_eq!(engine.set_ups(), SetUps { made: 1, renewed: 11 });
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn update<const D: usize>(
        &mut self,
        problem: &ContactProblem<D>,
    ) -> Result<(), EngineError> {
        self.switch(problem, Change::Other)
    }

    /// The same for a K that is near the one before: PCG keeps its preconditioner for as long as this is fast.
    pub(crate) fn follow<const D: usize>(
        &mut self,
        problem: &ContactProblem<D>,
    ) -> Result<(), EngineError> {
        self.switch(problem, Change::Near)
    }

    fn switch<const D: usize>(
        &mut self,
        problem: &ContactProblem<D>,
        change: Change,
    ) -> Result<(), EngineError> {
        if self.fits(problem) {
            return Ok(());
        }
        // During an update, and after an error.
        let before = self.matrices.take();
        self.recycled = RecycledSubspace::default();
        let kept = problem.clone();
        self.again = Box::new(move |lost, options, log| again(&kept, lost, options, log));
        let change = match before {
            Some([k, _]) if k == addresses(problem)[0] => Change::Same,
            _ => change,
        };
        let renewed = match (&mut self.path, before) {
            (_, None) => None,
            (Path::Cholesky(dual), _) => dual.update(problem, change == Change::Same)?,
            (Path::Cpu(dual), _) => dual.update(problem, change)?,
            #[cfg(feature = "gpu")]
            (Path::Gpu(dual, _), _) => dual.update(problem, change)?,
        };
        match renewed {
            Some(renewed) => self.set_ups.renewed += usize::from(renewed),
            None => {
                self.path = chosen(problem, &self.options, &mut self.log)?;
                self.set_ups.made += 1;
            }
        }
        self.matrices = Some(addresses(problem));
        Ok(())
    }

    /// Whether K is positive definite, judged by the factor or by conjugate gradients with a random load.
    pub(crate) fn is_definite(&mut self) -> Result<bool, EngineError> {
        Ok(match &mut self.path {
            // There would be no factor.
            Path::Cholesky(_) => true,
            Path::Cpu(dual) => dual.is_definite()?,
            #[cfg(feature = "gpu")]
            Path::Gpu(dual, _) => dual.is_definite()?,
        })
    }

    /// How often the data that depends on K was set up.
    pub fn set_ups(&self) -> SetUps {
        self.set_ups
    }

    /// "cpu" or "gpu".
    pub fn backend(&self) -> &'static str {
        match self.path {
            #[cfg(feature = "gpu")]
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
        match &self.path {
            #[cfg(feature = "gpu")]
            Path::Gpu(_, context) => Some(context.adapter.to_string()),
            _ => None,
        }
    }

    /// The precision of the kernels.
    pub fn precision(&self) -> Precision {
        match &self.path {
            #[cfg(feature = "gpu")]
            Path::Gpu(_, context) => context.precision,
            _ => Precision::F64,
        }
    }

    /// The device in use.
    #[cfg(feature = "gpu")]
    pub fn context(&self) -> Option<&Arc<Context>> {
        match &self.path {
            Path::Gpu(_, context) => Some(context),
            _ => None,
        }
    }

    /// The levels of multigrid, where it is used, as a table.
    pub fn hierarchy(&self) -> Option<&str> {
        self.path.levels()[0]
    }

    /// The factor, on the direct path.
    pub fn cholesky(&self) -> Option<&DirectDual> {
        match &self.path {
            Path::Cholesky(dual) => Some(dual),
            _ => None,
        }
    }

    /// Runs `work` and, if the GPU or PCG fails in it and the choice was left open, runs it again on the CPU.
    fn with_fallback<T>(
        &mut self,
        mut work: impl FnMut(&mut dyn DualOperator) -> Result<T, DualError>,
    ) -> Result<T, DualError> {
        loop {
            let error = match work(self.path.dual_mut()) {
                Err(DualError::Pcg(error)) => error,
                outcome => return outcome,
            };
            self.path = self.way_back(error)?;
            self.set_ups.made += 1;
        }
    }

    /// The path to continue on after an error: without the lost GPU, as if there had never been one, or with the factor
    /// where PCG fails.
    ///
    /// # Errors
    /// The same error, if the choice was not left open or nothing else can be made.
    fn way_back(&mut self, error: PcgError) -> Result<Path, DualError> {
        let EngineOptions {
            place, stiffness, ..
        } = self.options;
        let lost = matches!(error, PcgError::Backend(_));
        let open = match error {
            PcgError::Backend(_) => place == Device::Auto,
            PcgError::Stalled { .. } | PcgError::NotPositiveDefinite => {
                stiffness == Stiffness::Auto && place != Device::Gpu
            }
            _ => false,
        };
        if !open {
            return Err(error.into());
        }
        (self.log)(&format!("{error}; continuing on the CPU"));
        (self.again)(lost, &self.options, &mut self.log).map_err(|other| {
            // The first failure is of more use than a second complaint.
            (self.log)(&format!("{other}"));
            match other {
                EngineError::Factor(
                    other @ (FactorError::NotPositiveDefinite { .. }
                    | FactorError::BadFactor { .. }),
                ) => other.into(),
                _ => error.into(),
            }
        })
    }
}

/// The choice that options and problem suggest.
fn chosen<const D: usize>(
    problem: &ContactProblem<D>,
    options: &EngineOptions,
    log: &mut dyn FnMut(&str),
) -> Result<Path, EngineError> {
    let n = problem.n();
    let path = match (options.place, options.stiffness) {
        (Device::Gpu, Stiffness::Cholesky) => return Err(EngineError::NoCholeskyOnGpu),
        (Device::Gpu, _) => on_gpu(problem, options, log)?,
        (Device::Cpu, Stiffness::Pcg) => on_cpu(problem, options)?,
        (_, Stiffness::Cholesky) => Path::Cholesky(Box::new(DirectDual::new(problem)?)),
        (place, Stiffness::Auto) => match direct(
            problem,
            memory::total_bytes(),
            rayon::current_num_threads(),
            log,
        )? {
            Some(dual) => Path::Cholesky(dual),
            None if place == Device::Auto && n >= WORTH_A_GPU => on_best(problem, options, log)?,
            None => on_cpu(problem, options)?,
        },
        // Whoever names an adapter means it.
        (Device::Auto, Stiffness::Pcg) if n < WORTH_A_GPU && options.gpu.adapter.is_none() => {
            on_cpu(problem, options)?
        }
        (Device::Auto, Stiffness::Pcg) => on_best(problem, options, log)?,
    };
    let [_, fallback] = path.levels();
    if let Some(reason) = fallback {
        log(&format!(
            "{reason}: using block-Jacobi instead of multigrid"
        ));
    } else if !matches!(path, Path::Cholesky(_)) && problem.coordinates().is_none() {
        log("without coordinates multigrid does not know the rotations, and needs more iterations");
    }
    if !matches!(path, Path::Cholesky(_)) {
        slowness(problem).iter().for_each(|text| log(text));
    }
    Ok(path)
}

/// Bytes that the Cholesky factor of a problem will take, as [`Stiffness::Auto`] predicts them.
///
/// # Errors
/// If even its pattern does not fit.
pub fn factor_bytes<const D: usize>(problem: &ContactProblem<D>) -> Result<usize, FactorError> {
    plan(problem).map(|plan| plan.bytes())
}

/// The addresses of K and B of a problem.
fn addresses<const D: usize>(problem: &ContactProblem<D>) -> [usize; 2] {
    [
        Arc::as_ptr(problem.stiffness()).addr(),
        Arc::as_ptr(problem.contact_matrix()).addr(),
    ]
}

/// Another path for a problem: without the lost GPU, or with the factor where PCG fails.
fn again<const D: usize>(
    problem: &ContactProblem<D>,
    lost: bool,
    options: &EngineOptions,
    log: &mut dyn FnMut(&str),
) -> Result<Path, EngineError> {
    if !lost {
        // PCG was chosen because it would be faster; now it is the factor or nothing.
        return Ok(Path::Cholesky(Box::new(DirectDual::new(problem)?)));
    }
    if options.stiffness != Stiffness::Pcg {
        let threads = rayon::current_num_threads();
        if let Some(dual) = direct(problem, memory::total_bytes(), threads, log)? {
            return Ok(Path::Cholesky(dual));
        }
    }
    on_cpu(problem, options)
}

/// The factor, or None where PCG is the better choice on a machine of this many bytes, if known, and threads.
fn direct<const D: usize>(
    problem: &ContactProblem<D>,
    memory: Option<usize>,
    threads: usize,
    log: &mut dyn FnMut(&str),
) -> Result<Option<Box<DirectDual>>, EngineError> {
    let outcome = plan(problem).and_then(|plan| {
        let gib = |bytes: usize| bytes as f64 / f64::from(1 << 30);
        let bytes = plan.bytes();
        if let Some(memory) = memory
            && bytes > memory / 2
        {
            log(&format!(
                "the Cholesky factor would take {:.1} GiB, more than half of the {:.1} GiB of this machine: \
                 using PCG",
                gib(bytes),
                gib(memory)
            ));
            return Ok(None);
        }
        let n = problem.n() as f64;
        let threads = (threads as f64).min(ITERATIVE_THREADS);
        let factor = FACTOR_OPERATION * plan.operations() + FACTOR_UNKNOWN * n;
        let unknown = match D {
            3 => ITERATIVE_UNKNOWN_IN_SPACE,
            _ => ITERATIVE_UNKNOWN,
        };
        let row = problem.stiffness().n_blocks() as f64 / problem.stiffness().n_block_rows() as f64;
        let long = (row / if D == 3 { LONG_ROW_IN_SPACE } else { LONG_ROW }).max(1.0);
        let slow = growth_of_iterations(problem.poisson());
        let iterative = unknown * n * long * slow / threads;
        let (choice, taken) = if factor > PREFERRED * iterative {
            ("PCG", None)
        } else {
            ("the factor", Some(plan))
        };
        if factor > WORTH_A_WORD || taken.is_none() {
            log(&format!(
                "predicted: {factor:.1} s with the Cholesky factor ({:.1} GiB), {iterative:.1} s with PCG: \
                 using {choice}",
                gib(bytes)
            ));
        }
        // PCG says so itself.
        if taken.is_some() && factor > PREFERRED * iterative / slow {
            slowness(problem).iter().for_each(|text| log(text));
        }
        taken
            .map(|plan| DirectDual::with_plan(problem, plan).map(Box::new))
            .transpose()
    });
    match outcome {
        Err(error @ (FactorError::OutOfMemory { .. } | FactorError::TooLarge)) => {
            log(&format!("{error}: using PCG instead"));
            Ok(None)
        }
        outcome => Ok(outcome?),
    }
}

fn on_cpu<const D: usize>(
    problem: &ContactProblem<D>,
    options: &EngineOptions,
) -> Result<Path, EngineError> {
    let cpu = Cpu::<f32>::default();
    let dual = NestedDual::new(problem, cpu, options.preconditioner)?;
    Ok(Path::Cpu(Box::new(dual)))
}

#[cfg(not(feature = "gpu"))]
fn on_gpu<const D: usize>(
    _problem: &ContactProblem<D>,
    _options: &EngineOptions,
    _log: &mut dyn FnMut(&str),
) -> Result<Path, EngineError> {
    Err(EngineError::NoGpuSupport)
}

#[cfg(feature = "gpu")]
fn on_gpu<const D: usize>(
    problem: &ContactProblem<D>,
    options: &EngineOptions,
    log: &mut dyn FnMut(&str),
) -> Result<Path, EngineError> {
    on_device(problem, options, &Context::new(&options.gpu)?, log)
}

#[cfg(feature = "gpu")]
fn on_device<const D: usize>(
    problem: &ContactProblem<D>,
    options: &EngineOptions,
    context: &Arc<Context>,
    log: &mut dyn FnMut(&str),
) -> Result<Path, EngineError> {
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
    if context.adapter.is_software {
        log(SOFTWARE);
    }
    let gpu = Gpu::new(context).map_err(PcgError::from)?;
    let dual = NestedDual::new(problem, gpu, options.preconditioner)?;
    Ok(Path::Gpu(Box::new(dual), Arc::clone(context)))
}

/// PCG on a real GPU that is faster or, without one or if it fails, on the CPU.
#[cfg(feature = "gpu")]
fn on_best<const D: usize>(
    problem: &ContactProblem<D>,
    options: &EngineOptions,
    log: &mut dyn FnMut(&str),
) -> Result<Path, EngineError> {
    let named = options.gpu.adapter.is_some();
    let made = Context::new(&options.hardware())
        .map_err(EngineError::from)
        .and_then(|context| {
            // Whoever names an adapter means it.
            match !named && !is_faster(&context, problem, log)? {
                true => on_cpu(problem, options),
                false => on_device(problem, options, &context, log),
            }
        });
    match made {
        Err(error @ (EngineError::Gpu(_) | EngineError::Pcg(PcgError::Backend(_)))) => {
            log(&format!("{error}; computing on the CPU"));
            on_cpu(problem, options)
        }
        outcome => outcome,
    }
}

/// A GPU was not requested, and is not supported.
#[cfg(not(feature = "gpu"))]
fn on_best<const D: usize>(
    problem: &ContactProblem<D>,
    options: &EngineOptions,
    _log: &mut dyn FnMut(&str),
) -> Result<Path, EngineError> {
    on_cpu(problem, options)
}

/// Whether iterations for this problem take less time on a device than on the CPU, as its speed and that of the CPU predict.
#[cfg(feature = "gpu")]
fn is_faster<const D: usize>(
    context: &Arc<Context>,
    problem: &ContactProblem<D>,
    log: &mut dyn FnMut(&str),
) -> Result<bool, EngineError> {
    let mut gpu = Gpu::new(context).map_err(PcgError::from)?;
    let time = Duration::from_millis(20);
    let speed = gpu.speed(MEASURED as u64, time).map_err(PcgError::from)?;
    let cpu = copy_bandwidth(MEASURED);
    let k = problem.stiffness();
    let bytes = PASSES * (k.n_blocks() * (8 * D * D + 4)) as f64;
    let [there, here] = iteration_times(bytes, speed, context.precision, cpu);
    let faster = there < here;
    log(&format!(
        "{}: {:.0} GB/s and {:.0} µs a launch, the CPU: {:.0} GB/s; an iteration takes about {:.2} ms there and {:.2} ms on the \
         CPU{}",
        context.adapter,
        speed.bandwidth / 1e9,
        1e6 * speed.launch,
        cpu / 1e9,
        1e3 * there,
        1e3 * here,
        if faster { "" } else { ": computing on the CPU" }
    ));
    Ok(faster)
}

/// Seconds of an iteration that moves so many bytes on a device, and on a CPU of this bandwidth.
#[cfg(feature = "gpu")]
fn iteration_times(bytes: f64, speed: Speed, precision: Precision, cpu: f64) -> [f64; 2] {
    let there = bytes / speed.bandwidth + LAUNCHES * speed.launch;
    let factor = match precision {
        Precision::F64 => 1.0,
        Precision::F32 => SINGLE,
    };
    [factor * there, bytes / cpu]
}

impl DualOperator for Engine {
    fn size(&self) -> (usize, usize) {
        self.path.dual().size()
    }

    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        self.with_fallback(|dual| dual.apply(p, y, accuracy, stop))
    }

    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.path.dual().restrict(u, y);
    }

    fn at_contact(&mut self, request: &Request, y: &mut [f64]) -> Result<Correction, DualError> {
        self.with_fallback(|dual| dual.at_contact(request, y))
    }

    fn is_exact(&self) -> bool {
        self.path.dual().is_exact()
    }

    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        self.with_fallback(|dual| dual.displacement(request))
    }

    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        self.with_fallback(|dual| dual.stiffness_times(u, s))
    }

    fn refine(&mut self) -> bool {
        self.path.dual_mut().refine()
    }

    fn matrix(&self) -> Option<Csr> {
        self.path.dual().matrix()
    }

    fn linear_iterations(&mut self, tolerance: f64) -> Result<Option<usize>, DualError> {
        self.with_fallback(|dual| dual.linear_iterations(tolerance))
    }

    fn costs(&self) -> Option<Costs> {
        self.path.dual().costs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::BackendError;
    use crate::mesh::structured::SolidShape;
    use crate::reference::{self, CASE_B, CASE_C, Geometry};

    #[test]
    fn without_its_gpu_it_goes_where_it_would_have_begun() {
        let mesh = reference::mesh(Geometry::OneBody, 1);
        let problem = reference::problem(Geometry::OneBody, &mesh, &CASE_B).expect("valid");
        for (place, stiffness, expected) in [
            (Device::Auto, Stiffness::Auto, Some("cholesky")),
            (Device::Auto, Stiffness::Pcg, Some("pcg")),
            (Device::Gpu, Stiffness::Pcg, None),
        ] {
            let options = EngineOptions {
                place,
                stiffness,
                ..Default::default()
            };
            let path = on_cpu(&problem, &options).expect("no GPU is needed");
            let mut engine = Engine::on(path, problem.clone(), options, Box::new(|_| {}));
            let lost = BackendError::Lost {
                adapter: "some".to_owned(),
                reason: "pulled out".to_owned(),
            };
            let way = engine.way_back(PcgError::Backend(lost)).ok().map(|path| {
                engine.path = path;
                engine.stiffness()
            });
            assert_eq!(way, expected);
        }
    }

    /// An H100 beside 16 cores as measured, and made-up devices beside a laptop's processor.
    #[cfg(feature = "gpu")]
    #[test]
    fn a_device_is_taken_where_it_is_faster() {
        let faster = |n: f64, bandwidth: f64, launch: f64, precision, cpu: f64| {
            // 27 blocks a row of 76 bytes.
            let bytes = PASSES * n / 3.0 * 27.0 * 76.0;
            let speed = Speed {
                bandwidth: 1e9 * bandwidth,
                launch: 1e-6 * launch,
            };
            let [there, here] = iteration_times(bytes, speed, precision, 1e9 * cpu);
            there < here
        };
        let (double, single) = (Precision::F64, Precision::F32);
        assert!(faster(5e4, 2800.0, 5.0, double, 87.0));
        assert!(faster(1e6, 2800.0, 5.0, single, 87.0));
        // It shares the memory of the CPU.
        assert!(!faster(1e6, 45.0, 10.0, single, 50.0));
        assert!(!faster(1e6, 45.0, 10.0, double, 50.0));
        // A small card, and one whose launches are slow.
        assert!(faster(1e6, 200.0, 10.0, single, 50.0));
        assert!(!faster(5e4, 200.0, 100.0, single, 50.0));
    }

    #[test]
    fn the_factor_is_made_where_it_fits_and_gains() {
        let mesh = reference::mesh(Geometry::OneBody, 7);
        let problem = reference::problem(Geometry::OneBody, &mesh, &CASE_B).expect("valid");
        let choice = |memory, threads| {
            let mut lines = Vec::new();
            let dual = direct(&problem, memory, threads, &mut |line| {
                lines.push(line.to_owned())
            });
            (dual.expect("K is definite").is_some(), lines.concat())
        };
        let plan = plan(&problem).expect("K is definite");
        let needed = plan.bytes();
        // The prediction is roughly the actual size.
        let dual = DirectDual::with_plan(&problem, plan).expect("K is definite");
        assert!((1.0..2.0).contains(&(needed as f64 / (8 * dual.factor().entries()) as f64)));

        assert_eq!(choice(Some(2 * needed), 2), (true, String::new()));
        assert_eq!(choice(None, 2), (true, String::new()));
        let (made, why) = choice(Some(2 * needed - 2), 2);
        assert!(!made && why.contains("more than half"), "{why}");
    }

    /// In space the factor loses early, however much memory there is.
    #[test]
    fn in_space_the_factor_is_for_small_problems() {
        let takes_the_factor = |q| {
            let problem = (CASE_C.problem(q, SolidShape::Hexahedron)).expect("valid");
            let dual = direct(&problem, None, 2, &mut |_| {});
            (problem.n(), dual.expect("K is definite").is_some())
        };
        assert_eq!(takes_the_factor(8), (5832, true));
        assert_eq!(takes_the_factor(16), (41_616, false));
    }

    /// Unless ν makes PCG slow, and there is memory.
    #[test]
    fn nearly_incompressible_bodies_take_the_factor_for_longer() {
        let problem = (CASE_C.problem(16, SolidShape::Hexahedron)).expect("valid");
        let choice = |poisson, memory| {
            let mut lines = Vec::new();
            let problem = problem.clone().with_poisson(poisson);
            let dual = direct(&problem, memory, 2, &mut |line| lines.push(line.to_owned()));
            (dual.expect("K is definite").is_some(), lines.join("\n"))
        };
        let (made, why) = choice(0.4999, None);
        assert!(made && why.contains("about 45 times as many"), "{why}");
        let needed = factor_bytes(&problem).expect("K is definite");
        let (made, why) = choice(0.4999, Some(2 * needed - 2));
        assert!(!made && why.contains("more than half"), "{why}");
        // 11 iterations with ν = 0.3 and 50, 155, 494 in a block.
        for (poisson, measured) in [(0.49, 50.0), (0.499, 155.0), (0.4999, 494.0)] {
            let predicted = 11.0 * growth_of_iterations(poisson);
            assert!((predicted / measured - 1.0_f64).abs() < 0.5);
        }
        assert!(slowness(&problem).is_none());
    }
}
