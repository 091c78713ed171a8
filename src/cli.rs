//! The command line: arguments, progress, exit codes. No numerics.

#[cfg(feature = "gpu")]
mod adapters;
mod advice;
#[cfg(feature = "gpu")]
mod bench;
mod check;
mod completions;
mod convert;
mod export;
mod launcher;
mod man;
mod mesh;
mod phases;
mod solve;
mod table1;

use clap::{Parser, Subcommand, ValueEnum, ValueHint};
use signorini::backend;
use signorini::case::Case;
use signorini::deck;
use signorini::engine;
use signorini::stiffness::pcg;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

/// Exit code for an error: bad input, no such adapter, out of memory.
const ERROR: u8 = 1;
/// Exit code for a stop without convergence; results so far are written.
const NOT_CONVERGED: u8 = 3;

#[derive(Parser)]
#[command(
    version,
    about = "Contact with friction between elastic bodies and rigid obstacles",
    after_help = "Exit codes: 0 done (a solve: converged); 1 error, with a message that says where and what to do; 2 \
                  wrong usage; 3 stopped without convergence. `signorini solve --help` has the details."
)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Solve a case and write report.json, solution.vtu, contact.csv and, with --plots, report.html
    #[command(
        after_help = "Exit codes: 0 converged; 1 error; 2 wrong usage; 3 stopped without convergence: a limit, \
                      stagnation, a body that is not held, or Ctrl-C (SIGTERM as well). Results so far are written, \
                      and `status` in report.json names the reason. A second Ctrl-C ends the program at once, with \
                      130."
    )]
    Solve(SolveArguments),
    /// Read a case and its meshes, print how they were understood and how much memory the solve will take; solve
    /// nothing
    Check {
        /// The case file (TOML), a deck of Abaqus or CalculiX (.inp), or a mesh (.msh, .inp, .vtu)
        case: PathBuf,
        #[command(flatten)]
        deck: DeckArguments,
        /// Replace or add an entry of the case, e.g. --set solver.tolerance=1e-8; may be given several times
        #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
        settings: Vec<String>,
    },
    /// Write a mesh of Abaqus (.inp), VTK (.vtu) or Gmsh as a Gmsh file (MSH 2.2), and list its regions and boundaries; or
    /// write a deck of Abaqus or CalculiX (.inp) as a case file (.toml) with its mesh beside it
    Convert {
        /// The mesh to read: .inp, .vtu or .msh
        input: PathBuf,
        /// The file to write, .msh or, for a deck, .toml; an existing file is replaced
        output: PathBuf,
        #[command(flatten)]
        deck: DeckArguments,
        /// Factor for the coordinates, e.g. 1e-3 to bring a drawing in millimetres to metres
        #[arg(long, default_value_t = 1.0, value_name = "F")]
        scale: f64,
        /// The cell array of a .vtu file whose values distinguish regions and boundaries
        #[arg(long, value_name = "NAME")]
        cell_data: Option<String>,
    },
    /// Write a case as matrices and vectors (Matrix Market), with a case file that names them, for each load step
    Export(ExportArguments),
    /// Reproduce Table 1 of the paper: outer steps and products with A, beside the paper's figures
    Table1(Table1Arguments),
    /// Measure the CPU against the GPU and Cholesky against PCG on one contact problem of growing size
    ///
    /// The problem is reference case B, in space case C. All paths solve it, and the program compares their answers: if
    /// they disagree, the exit code is 3. Other programs on this machine distort the times.
    #[cfg(feature = "gpu")]
    Bench(BenchArguments),
    /// Measure each phase of a case with several numbers of threads, and what is not done in parallel
    ///
    /// Results go to a folder that is removed. Other programs on this machine distort the times.
    Phases(PhasesArguments),
    /// List the GPUs and software adapters with their capabilities, in order of preference
    #[cfg(feature = "gpu")]
    Adapters,
    /// Print a script that completes commands, options and their values in a shell
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Write the man pages, signorini.1 and one for each command, into a directory, or print signorini.1
    Man {
        /// Where to write the pages, e.g. ~/.local/share/man/man1; made if it is not there [default: print signorini.1]
        #[arg(value_name = "DIR", value_hint = ValueHint::DirPath)]
        directory: Option<PathBuf>,
    },
}

#[derive(clap::Args)]
struct SolveArguments {
    /// The case file (TOML), or a deck of Abaqus or CalculiX (.inp)
    case: PathBuf,
    #[command(flatten)]
    deck: DeckArguments,
    /// Where to write the results; those of an earlier run are removed [default: beside the case, its name + "-out"]
    #[arg(long, value_name = "DIR", value_hint = ValueHint::DirPath)]
    output: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Replace or add an entry of the case, e.g. --set solver.tolerance=1e-8 or --set contact.0.friction.tresca=2e6
    ///
    /// Entries of lists count from 0. May be given several times.
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    settings: Vec<String>,
    /// Draw pictures (SVG) and write report.html, a page with everything that any browser opens
    #[arg(long)]
    plots: bool,
    /// No progress, no summary: results go to files, errors to standard error
    #[arg(long, short)]
    quiet: bool,
    /// Report more: choices and their reasons, sizes, levels of multigrid, the time of each phase, requests to a GPU
    #[arg(long, short)]
    verbose: bool,
}

#[derive(clap::Args)]
struct PhasesArguments {
    /// The case file (TOML), or a deck of Abaqus or CalculiX (.inp)
    case: PathBuf,
    #[command(flatten)]
    deck: DeckArguments,
    #[command(flatten)]
    engine: EngineArguments,
    /// Replace or add an entry of the case, e.g. --set mesh.part.0.box.cells=[84,42,46]
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    settings: Vec<String>,
    /// Numbers of threads, beside one [default: powers of two up to all cores]
    #[arg(long, value_delimiter = ',', value_name = "P,…")]
    threads: Vec<usize>,
    /// Runs with each number of threads, of which the shortest time of each phase counts
    #[arg(long, value_name = "N", default_value_t = 2)]
    repeat: usize,
    /// Write the figures to this file as well, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
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
    /// Which bodies touch; sizes are the paper's
    #[arg(long, value_enum, default_value = "one-body")]
    geometry: GeometryArgument,
    /// Largest refinement: rows k = 1, 3, … up to this; the paper ends with 13
    #[arg(long, default_value_t = 13, value_name = "K")]
    max_k: usize,
    /// Values of β in ρ = β/σ_max, one column each
    #[arg(long, value_delimiter = ',', value_name = "B,…", default_values_t = signorini::table1::BETAS)]
    beta: Vec<f64>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Write the cells of the table to this file as well, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[cfg(feature = "gpu")]
#[derive(clap::Args)]
struct BenchArguments {
    /// 2 measures a rectangle of squares (reference case B), 3 a block of hexahedra (case C), both on a rigid plane
    #[arg(long, value_name = "D", default_value_t = 2, value_parser = clap::value_parser!(u8).range(2..=3))]
    dimension: u8,
    /// Order of the elements: 2 measures second-order elements on the same mesh, always on a rigid plane
    #[arg(long, value_name = "ORDER", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    order: u8,
    /// Refinements k of the mesh: n ≈ 1200 k², in space cells per metre: n ≈ 9 k³ (of second order 4 and 8 times as many)
    /// [default: 3,7,13; in space 8,16,24; of second order 2,4,7 and 4,8,12]
    #[arg(long, value_delimiter = ',', value_name = "K,…")]
    k: Vec<usize>,
    /// Unknowns up to which Cholesky is measured as well [default: 1000000, in space 150000]
    #[arg(long, value_name = "N")]
    max_cholesky: Option<usize>,
    #[command(flatten)]
    gpu: GpuArguments,
    /// Write the figures to this file as well, as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Reading of decks.
#[derive(Clone, clap::Args)]
struct DeckArguments {
    /// For a deck (.inp): continue without these keywords, options or types of elements though they change the result,
    /// e.g. --ignore NLGEOM,PLASTIC
    #[arg(long, value_delimiter = ',', value_name = "KEYWORD,…")]
    ignore: Vec<String>,
}

/// The choice of processor and solver.
#[derive(Clone, clap::Args)]
struct EngineArguments {
    /// Where to compute, unless --stiffness decides it: the sparse factor is made on the CPU
    #[arg(long, value_enum, default_value = "auto")]
    backend: Backend,
    /// How to solve systems with the stiffness matrix K; both ways lead to the same accuracy
    #[arg(long, value_enum, default_value = "auto")]
    stiffness: Stiffness,
    /// Preconditioner of the conjugate gradients
    #[arg(long, value_enum, default_value = "multigrid")]
    preconditioner: Preconditioner,
    #[command(flatten)]
    gpu: GpuArguments,
}

/// The choice of GPU and its precision.
#[derive(Clone, clap::Args)]
struct GpuArguments {
    /// Arithmetic of the GPU's kernels; answers are accurate to f64 in any case, and the CPU is not affected
    #[arg(long, value_enum, default_value = "auto")]
    precision: Precision,
    /// The GPU or software adapter to take: a part of its name, its PCI address, or its number in the list of `signorini adapters`
    ///
    /// With --backend auto and --stiffness pcg it is used however small the problem is.
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
    fn options(&self) -> engine::EngineOptions {
        engine::EngineOptions {
            place: match self.backend {
                Backend::Auto => engine::Device::Auto,
                Backend::Cpu => engine::Device::Cpu,
                Backend::Gpu => engine::Device::Gpu,
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
    /// PCG on a real GPU from 50 000 unknowns on, if it is faster; the CPU otherwise, and where a GPU fails
    Auto,
    /// The CPU
    Cpu,
    /// PCG on a GPU or, without one, on a software adapter; an error if neither exists or it fails
    Gpu,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Preconditioner {
    /// Smoothed-aggregation multigrid: few iterations, however fine the mesh; block-Jacobi where it does not fit
    Multigrid,
    /// The inverse of the diagonal block of each node: cheap to set up, but iterations grow with the mesh
    BlockJacobi,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Stiffness {
    /// The sparse factor where it is predicted to fit into half of the memory and not to take much longer than PCG; PCG
    /// otherwise, and with --backend gpu
    Auto,
    /// The sparse Cholesky factor, on the CPU, whatever its size; not with --backend gpu
    Cholesky,
    /// Conjugate gradients with the --preconditioner, on the CPU or a GPU
    Pcg,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Precision {
    /// f64 where the adapter has it, f32 inside f64 refinement otherwise
    Auto,
    /// f64; an error where the adapter does not have it
    F64,
    /// f32 inside f64 refinement, on any adapter
    F32,
}

#[derive(Clone, Copy, ValueEnum)]
enum GeometryArgument {
    /// A body on a rigid plane
    OneBody,
    /// A body on another one, nodes on nodes
    TwoBody,
}

/// Runs the program with these arguments, its own name first; returns its exit code.
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> u8 {
    hear_file_limits();
    let command = match Cli::try_parse_from(arguments) {
        Ok(read) => read.command,
        Err(error) => return told_first(&error),
    };
    let outcome = match command {
        Command::Solve(arguments) => on_ranks(&arguments),
        Command::Check {
            case,
            deck,
            settings,
        } => check_on_ranks(&case, &deck.ignore, &settings),
        Command::Convert {
            input,
            output,
            deck,
            scale,
            cell_data,
        } => convert::run(&input, &output, &deck.ignore, scale, cell_data.as_deref()),
        Command::Export(arguments) => export::run(&arguments),
        Command::Table1(arguments) => table1::run(&arguments),
        Command::Phases(arguments) => phases::run(&arguments),
        #[cfg(feature = "gpu")]
        Command::Bench(arguments) => bench::run(&arguments),
        #[cfg(feature = "gpu")]
        Command::Adapters => adapters::run(),
        Command::Completions { shell } => completions::run(shell),
        Command::Man { directory } => man::run(directory.as_deref()),
    };
    match outcome {
        Ok(code) => code,
        Err(message) => {
            eprintln!("error: {message}");
            ERROR
        }
    }
}

/// The process as a launcher has started it.
enum Started {
    /// On its own.
    Alone,
    /// With others that it can talk to.
    #[cfg(feature = "mpi")]
    Together(signorini::mpi::World),
    /// Several processes that cannot work together: the first reports the reason, the others only have its exit code.
    Apart(Result<u8, String>),
}

/// How a launcher (`mpirun`, `srun`) started this process. A process that it started alone needs no MPI.
fn started() -> Result<Started, String> {
    let Some(place) = launcher::place() else {
        return Ok(Started::Alone);
    };
    #[cfg(feature = "mpi")]
    let why = {
        let world = signorini::mpi::World::start()?;
        if world.group().size() > 1 || place.size == 1 {
            return Ok(Started::Together(world));
        }
        format!(
            "{} processes were started that do not know each other: the launcher does not match the MPI of this \
             program; with Slurm try srun --mpi=pmix, or mpirun",
            place.size
        )
    };
    #[cfg(not(feature = "mpi"))]
    let why = "this program was built without support for several ranks: start it without mpirun or srun, or build it with its \
               feature `mpi` (docs/mpi.md): cargo build --release --features mpi"
        .to_owned();
    Ok(Started::Apart(match place.rank {
        0 => Err(why),
        _ => Ok(ERROR),
    }))
}

/// Prints help, or that the usage is wrong, in the first of several processes; the exit code.
fn told_first(error: &clap::Error) -> u8 {
    let told = || drop(error.print());
    match started() {
        #[cfg(feature = "mpi")]
        Ok(Started::Together(world)) => {
            if world.group().rank() == 0 {
                told();
            }
            // Launchers end all ranks as soon as one ends with an error.
            world.group().wait();
        }
        Ok(Started::Apart(Ok(_))) => {}
        Ok(_) | Err(_) => told(),
    }
    error.exit_code() as u8
}

/// Solves in this process, or on all ranks where a launcher has started several.
fn on_ranks(arguments: &SolveArguments) -> Result<u8, String> {
    match started()? {
        Started::Alone => solve::run(arguments),
        #[cfg(feature = "mpi")]
        Started::Together(world) => {
            let made = solve::distributed::run(arguments, world.group());
            Ok(said_first(world.group(), made))
        }
        Started::Apart(outcome) => outcome,
    }
}

/// Checks in this process; if a launcher started several, rank 0 checks and reports how they would share the work.
fn check_on_ranks(case: &Path, ignored: &[String], settings: &[String]) -> Result<u8, String> {
    match started()? {
        Started::Alone => check::run(case, ignored, settings),
        #[cfg(feature = "mpi")]
        Started::Together(world) => {
            let group = world.group();
            let made = match group.rank() {
                0 => check::on_ranks(case, ignored, settings, group.size()),
                _ => Ok(0),
            };
            let code = group.broadcast(Some(*made.as_ref().unwrap_or(&ERROR)));
            Ok(said_first(group, made.and(Ok(code))))
        }
        Started::Apart(outcome) => outcome,
    }
}

/// The exit code of a rank. Launchers end all ranks as soon as one ends with an error, so a rank with a message prints it
/// first.
#[cfg(feature = "mpi")]
fn said_first(group: &signorini::mpi::Group, made: Result<u8, String>) -> u8 {
    let code = made.unwrap_or_else(|message| {
        eprintln!("error: {message}");
        ERROR
    });
    group.wait();
    code
}

/// Reads a case file, or a deck as a case, with notes on ignored parts of the deck.
fn read_case(
    path: &Path,
    ignored: &[String],
    settings: &[String],
) -> Result<(Case, Vec<String>), String> {
    if !deck::is_deck(path) {
        if !ignored.is_empty() {
            return Err("--ignore applies only to decks (.inp)".to_owned());
        }
        let case = Case::read(path, settings).map_err(|e| advice::message_of(&e))?;
        return Ok((case, Vec::new()));
    }
    let mesh = path.file_name().unwrap_or_default().to_string_lossy();
    let deck = deck::read(path, &mesh, ignored).map_err(|e| advice::message_of(&e))?;
    let notes = deck.notes.clone();
    let case = Case::of_deck(deck, settings).map_err(|e| advice::message_of(&e))?;
    Ok((case, notes))
}

/// Writes to standard output; a closed pipe (`| head`) is not an error.
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

/// Turns a file that grows beyond a limit of the system (`ulimit -f`) into an error like a full disc: otherwise the
/// signal would end the program in the middle of the file.
fn hear_file_limits() {
    #[cfg(unix)]
    {
        // Without it files fail as they did.
        let heard = std::sync::Arc::default();
        let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, heard);
    }
}
