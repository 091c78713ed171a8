//! `signorini solve`.

#[cfg(feature = "mpi")]
pub mod distributed;
mod log;
mod summary;

use super::advice::message_of;
use super::{NOT_CONVERGED, SolveArguments};
use log::Log;
use signorini::case::{BuildError, Case, CaseProblem};
use signorini::engine::{Engine, EngineOptions};
use signorini::input::is_reading;
use signorini::mesh::{AnyMesh, ElementKind};
use signorini::model::{Analysis, AnyAnalysis};
use signorini::output::{Draw, Results, prepare, withdraw};
use signorini::solve;
use signorini::ssnm::Status;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};
use std::time::{Duration, Instant};

/// Set by Ctrl-C.
static INTERRUPTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Set when everything has been read.
static READ: AtomicBool = AtomicBool::new(false);

/// Ends the program after Ctrl-C while it is still reading: there are no results to write, and a pipe may never end. A
/// file that is read at once is not interrupted: the run then leaves its report.
fn leave_reading() {
    while !READ.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(50));
        if is_reading() {
            eprintln!("interrupted while reading the case: nothing has been computed");
            std::process::exit(NOT_CONVERGED.into());
        }
    }
}

/// Ctrl-C and SIGTERM set [`INTERRUPTED`]. The second one ends the program at once.
fn hear_interrupts() {
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        std::thread::spawn(leave_reading);
    });
}

/// The directory of the results.
fn output_directory(arguments: &SolveArguments) -> PathBuf {
    match &arguments.output {
        Some(directory) => directory.clone(),
        None => {
            let mut name = arguments.case.file_stem().unwrap_or_default().to_owned();
            name.push("-out");
            arguments.case.with_file_name(name)
        }
    }
}

pub fn run(arguments: &SolveArguments) -> Result<u8, String> {
    let start = Instant::now();
    hear_interrupts();
    #[cfg(not(feature = "plots"))]
    if arguments.plots {
        return Err(
            "--plots: this program was built without pictures; leave it out, or build the program with its feature \
             `plots`: cargo build --release"
                .to_owned(),
        );
    }
    let output = output_directory(arguments);
    let read = super::read_case(&arguments.case, &arguments.deck.ignore, &arguments.settings);
    let (case, notes) = match read {
        Ok(read) => read,
        Err(message) => {
            // Errors in the case come first, because the user has to fix them first.
            let _ = withdraw(&output, std::slice::from_ref(&arguments.case));
            return Err(message);
        }
    };
    withdraw(&output, &case.inputs()).map_err(|e| message_of(&e))?;
    let log = Log::new(arguments);
    for note in notes {
        log.say(format_args!("{note}"));
    }

    let mut engine = arguments.engine.options();
    let made = build(&case, &mut engine).map_err(|e| message_of(&e))?;
    READ.store(true, Ordering::Relaxed);
    let run = Run {
        start,
        case: &case,
        arguments,
        engine,
        output: &output,
        log,
    };
    match made.analysis() {
        AnyAnalysis::Plane(analysis) => run.make(analysis),
        AnyAnalysis::Space(analysis) => run.make(analysis),
    }
}

/// A run, of whichever dimension.
struct Run<'a> {
    start: Instant,
    case: &'a Case,
    arguments: &'a SolveArguments,
    engine: EngineOptions,
    output: &'a Path,
    log: Log,
}

/// The problem of a case. A GPU that it needs opens meanwhile.
fn build(case: &Case, engine: &mut EngineOptions) -> Result<CaseProblem, BuildError> {
    if case.tables.algebraic.is_some() {
        return case.build();
    }
    let mesh = case.read_mesh()?;
    match &mesh {
        AnyMesh::Plane(mesh) => engine.open_ahead(2, 2 * mesh.nodes.len()),
        AnyMesh::Space(mesh) => engine.open_ahead(3, 3 * mesh.nodes.len()),
    }
    case.build_on_mesh(mesh)
}

/// Whether the user has asked for an end.
pub(super) fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::Relaxed)
}

impl Run<'_> {
    /// Solves, writes and reports; the exit code.
    fn make<const D: usize>(&self, analysis: Analysis<D>) -> Result<u8, String>
    where
        ElementKind: Draw<D>,
    {
        let (case, log) = (self.case, self.log);
        let made = self.start.elapsed().as_secs_f64();
        prepare(self.output, &case.inputs()).map_err(|e| message_of(&e))?;
        let mut results =
            Results::new(self.output, &case.tables.title, analysis).map_err(|e| message_of(&e))?;
        results.set_begin(self.start);
        #[cfg(feature = "plots")]
        if self.arguments.plots {
            results.draw();
        }
        let timings = &mut results.report.timings;
        timings.mesh = made - timings.assembly;
        log.say(format_args!(
            "n = {}, m = {}: assembled in {made:.3} s (contacts {:.4} s)",
            analysis.problem.n_free(),
            analysis.problem.m(),
            timings.pairing
        ));
        for body in analysis.floating_bodies() {
            log.tell(&body);
        }
        // Results finished before an error are written nevertheless.
        let solved = self.solve(analysis, &mut results);
        if let Err(error) = &solved {
            results.report.fail(error);
        }
        let written = results
            .finish()
            .map(<[_]>::to_vec)
            .map_err(|e| message_of(&e));
        solved?;
        let files = written?;
        if !self.arguments.quiet {
            super::print(&summary::text(&results.report, &files))?;
        }
        Ok(if results.report.status == Some(Status::Converged) {
            0
        } else {
            NOT_CONVERGED
        })
    }

    /// An error of the solver, with the case that it has met.
    fn failed(&self, error: solve::Error) -> String {
        match error {
            solve::Error::Model(error) => message_of(&self.case.at_line(error)),
            error => format!("{}: {}", self.arguments.case.display(), message_of(&error)),
        }
    }

    /// Sets up and makes the load steps.
    fn solve<const D: usize>(
        &self,
        analysis: Analysis<D>,
        results: &mut Results<D>,
    ) -> Result<(), String>
    where
        ElementKind: Draw<D>,
    {
        let log = self.log;
        if is_interrupted() {
            return Ok(());
        }
        let start = Instant::now();
        let options = self.engine.clone();
        let mut engine = Engine::new(analysis.problem, options, move |line| log.tell(line))
            .map_err(|error| self.failed(error.into()))?;
        give_back_freed();
        results
            .report
            .set_up(&engine, start.elapsed().as_secs_f64());
        log.engine(&engine, results.report.timings.factor);

        let made = self.steps(analysis, &mut engine, results);
        log.costs(&engine);
        results.add_engine(&mut engine);
        made
    }

    /// Makes the load steps, until one does not converge.
    fn steps<const D: usize>(
        &self,
        analysis: Analysis<D>,
        engine: &mut Engine,
        results: &mut Results<D>,
    ) -> Result<(), String>
    where
        ElementKind: Draw<D>,
    {
        let (log, n_steps) = (self.log, [analysis.n_steps(), analysis.n_cycles()]);
        let mut settings = self.case.settings();
        settings.ssnm.interrupt = Some(Arc::clone(&INTERRUPTED));
        let limit = settings.ssnm.time_limit;
        settings.ssnm.time_limit = limit.map(|limit| limit.saturating_sub(self.start.elapsed()));
        let mut written = Ok(());
        let tolerance = settings.ssnm.tolerance;
        let observer = log.observer(n_steps, tolerance, &mut written, |solved| {
            results.add(solved)
        });
        (analysis.solve_on(engine, &settings, observer)).map_err(|error| self.failed(error))?;
        written.map_err(|error| message_of(&error))
    }
}

/// Returns memory freed before the first load step to the system: glibc keeps it, 0.3 GiB at a million unknowns.
fn give_back_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: it touches only free memory.
    unsafe {
        libc::malloc_trim(0);
    }
}
