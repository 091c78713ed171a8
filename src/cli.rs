//! The command line: arguments, progress, exit codes. No numerics.

#[cfg(feature = "gpu")]
mod adapters;
mod advice;
#[cfg(feature = "gpu")]
mod bench;
mod check;
mod convert;
mod export;
mod solve;
mod table1;

use clap::{Parser, Subcommand, ValueEnum};
use signorini::backend;
use signorini::engine;
use signorini::stiffness::pcg;
use std::path::PathBuf;
use std::process::ExitCode;

/// Exit code for an error: bad input, no such adapter, out of memory.
const ERROR: u8 = 1;
/// Exit code for a stop without convergence; what was computed is written.
const NOT_CONVERGED: u8 = 3;

#[derive(Parser)]
#[command(
    version,
    about = "Contact with friction between elastic bodies and rigid obstacles",
    after_help = "Exit codes: 0 converged, 1 error, 2 wrong usage, 3 stopped without convergence."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Solve a case and write report.json, solution.vtu, contact.csv and, with --plots, report.html
    Solve(SolveArguments),
    /// Validate and describe a case, solve nothing
    Check {
        /// The case file (TOML)
        case: PathBuf,
        /// Replace an entry of the case, e.g. --set solver.tolerance=1e-8
        #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
        settings: Vec<String>,
    },
    /// Write a mesh of Abaqus (.inp), VTK (.vtu) or Gmsh as a file of Gmsh (MSH 2.2), and list its names
    Convert {
        /// The mesh to read
        input: PathBuf,
        /// The file to write, .msh
        output: PathBuf,
        /// Factor for the coordinates, e.g. 1e-3 for a drawing in millimetres
        #[arg(long, default_value_t = 1.0)]
        scale: f64,
        /// The cell array of a .vtu file that tells regions and boundaries
        #[arg(long, value_name = "NAME")]
        cell_data: Option<String>,
    },
    /// Write a case as matrices and vectors (Matrix Market), with a case file that names them, for each load step
    Export(ExportArguments),
    /// Reproduce Table 1 of the paper: outer steps and products with A
    Table1(Table1Arguments),
    /// CPU against GPU, direct against iterative, on the same contact problem (reference case B, in space case C)
    #[cfg(feature = "gpu")]
    Bench(BenchArguments),
    /// List the GPUs and software adapters, the one that would be taken first
    #[cfg(feature = "gpu")]
    Adapters,
}

#[derive(clap::Args)]
struct SolveArguments {
    /// The case file (TOML)
    case: PathBuf,
    /// Where to write the results [default: beside the case, its name + "-out"]
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Replace an entry of the case, e.g. --set solver.tolerance=1e-8 or --set contact.0.friction.tresca=2e6
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    settings: Vec<String>,
    /// Draw pictures (SVG) and write report.html, a page with everything that any browser opens
    #[arg(long)]
    plots: bool,
    /// No progress, no summary: results go to files, errors to standard error
    #[arg(long, short)]
    quiet: bool,
    /// More about sizes and phases
    #[arg(long, short)]
    verbose: bool,
}

#[derive(clap::Args)]
struct ExportArguments {
    /// The case file (TOML)
    case: PathBuf,
    /// Where to write the files
    directory: PathBuf,
    #[command(flatten)]
    engine: EngineArguments,
    /// Replace an entry of the case, e.g. --set steps.factors=[1]
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    settings: Vec<String>,
}

#[derive(clap::Args)]
struct Table1Arguments {
    /// Which of the two geometries with the paper's sizes
    #[arg(long, value_enum, default_value = "one-body")]
    geometry: GeometryArgument,
    /// Largest refinement: rows k = 1, 3, … up to this
    #[arg(long, default_value_t = 13, value_name = "K")]
    max_k: usize,
    /// Values of β
    #[arg(long, value_delimiter = ',', value_name = "B,…", default_values_t = signorini::table1::BETAS)]
    beta: Vec<f64>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Write the cells as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[cfg(feature = "gpu")]
#[derive(clap::Args)]
struct BenchArguments {
    /// Of space: 3 measures a block of hexahedra on a plane, 2 a rectangle of squares
    #[arg(long, value_name = "D", default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=3))]
    dimension: u8,
    /// Refinements k of the mesh: n ≈ 1200 k², in space cells per metre: n ≈ 9 k³ [default: 3,7,13; in space 8,16,24]
    #[arg(long, value_delimiter = ',', value_name = "K,…")]
    k: Vec<usize>,
    /// Unknowns up to which the direct path is measured as well [default: 1000000, in space 150000]
    #[arg(long, value_name = "N")]
    max_cholesky: Option<usize>,
    #[command(flatten)]
    gpu: GpuArguments,
    /// Write the figures as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// What does the arithmetic.
#[derive(clap::Args)]
struct EngineArguments {
    /// Where to compute
    #[arg(long, value_enum, default_value = "auto")]
    backend: Backend,
    /// How to solve with the stiffness matrix
    #[arg(long, value_enum, default_value = "auto")]
    stiffness: Stiffness,
    /// Inside the conjugate gradients
    #[arg(long, value_enum, default_value = "multigrid")]
    preconditioner: Preconditioner,
    #[command(flatten)]
    gpu: GpuArguments,
}

/// Which GPU, and how.
#[derive(clap::Args)]
struct GpuArguments {
    /// Arithmetic of the GPU kernels; the answer is f64-accurate in any case
    #[arg(long, value_enum, default_value = "auto")]
    precision: Precision,
    /// A part of the adapter's name, or its number in the list of `signorini adapters`
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
}

impl GpuArguments {
    fn options(&self) -> backend::GpuOptions {
        backend::GpuOptions {
            adapter: self.adapter.clone(),
            precision: match self.precision {
                Precision::Auto => None,
                Precision::F64 => Some(backend::Precision::F64),
                Precision::F32 => Some(backend::Precision::F32),
            },
            ..Default::default()
        }
    }
}

impl EngineArguments {
    fn options(&self) -> engine::Options {
        engine::Options {
            place: match self.backend {
                Backend::Auto => engine::Place::Auto,
                Backend::Cpu => engine::Place::Cpu,
                Backend::Gpu => engine::Place::Gpu,
            },
            stiffness: match self.stiffness {
                Stiffness::Auto => engine::Stiffness::Auto,
                Stiffness::Cholesky => engine::Stiffness::Cholesky,
                Stiffness::Pcg => engine::Stiffness::Pcg,
            },
            preconditioner: match self.preconditioner {
                Preconditioner::Multigrid => pcg::Preconditioner::Multigrid,
                Preconditioner::BlockJacobi => pcg::Preconditioner::BlockJacobi,
            },
            gpu: self.gpu.options(),
        }
    }
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Backend {
    /// A real GPU where that gains time, the CPU otherwise
    Auto,
    /// The CPU
    Cpu,
    /// A GPU or, if there is no other, a software adapter
    Gpu,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Preconditioner {
    /// Smoothed-aggregation multigrid
    Multigrid,
    /// The inverse of the block of each node: cheap to set up, but iterations grow with the mesh
    BlockJacobi,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Stiffness {
    /// The direct path on the CPU, the iterative one on a GPU
    Auto,
    /// Sparse Cholesky factor, on the CPU
    Cholesky,
    /// Preconditioned conjugate gradients
    Pcg,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Precision {
    /// f64 where the adapter has it
    Auto,
    /// f64
    F64,
    /// f32 inside f64 refinement
    F32,
}

#[derive(Clone, Copy, ValueEnum)]
enum GeometryArgument {
    OneBody,
    TwoBody,
}

/// Runs the program.
pub fn run() -> ExitCode {
    hear_file_limits();
    let outcome = match Cli::parse().command {
        Command::Solve(arguments) => solve::run(&arguments),
        Command::Check { case, settings } => check::run(&case, &settings),
        Command::Convert {
            input,
            output,
            scale,
            cell_data,
        } => convert::run(&input, &output, scale, cell_data.as_deref()),
        Command::Export(arguments) => export::run(&arguments),
        Command::Table1(arguments) => table1::run(&arguments),
        #[cfg(feature = "gpu")]
        Command::Bench(arguments) => bench::run(&arguments),
        #[cfg(feature = "gpu")]
        Command::Adapters => adapters::run(),
    };
    match outcome {
        Ok(code) => ExitCode::from(code),
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::from(ERROR)
        }
    }
}

/// Writes to standard output; a reader that has gone away (`| head`) is no error.
fn print(text: &str) -> Result<(), String> {
    use std::io::Write as _;
    let mut out = std::io::stdout();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            Err(format!("cannot write to standard output: {error}"))
        }
        _ => Ok(()),
    }
}

/// Lets a file that grows beyond a limit of the system (`ulimit -f`) be an error like a full disc: unheard, the signal
/// would end the program in the middle of it.
fn hear_file_limits() {
    #[cfg(unix)]
    {
        // Without it files fail as they did.
        let heard = std::sync::Arc::default();
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, heard);
    }
}
