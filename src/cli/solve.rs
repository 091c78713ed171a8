//! `signorini solve`.

mod log;
mod pictures;
mod summary;

use super::advice::told;
use super::{NOT_CONVERGED, SolveArguments};
use log::Log;
use pictures::{Draw, Pictures};
use signorini::case::{AnyBuild, Build, Case};
use signorini::dual::DualOperator as _;
use signorini::engine::Engine;
use signorini::input::is_reading;
use signorini::mesh::Kind;
use signorini::model::StepData;
use signorini::output::{
    EnginePath, Report, Timings, prepare, withdraw, write_index, write_report, write_solution,
};
use signorini::quasistatic::{self, Event, Load, State, StepSolution};
use signorini::ssnm::Status;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Set by Ctrl-C.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Set when everything has been read.
static READ: AtomicBool = AtomicBool::new(false);

/// Ends the program after Ctrl-C if it is still reading, or reads again: nothing has been computed that could be written,
/// and a pipe may never end. A file that is read at once is let pass: the run then leaves its report.
fn leave_reading() {
    while !READ.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(50));
        if is_reading() {
            eprintln!("interrupted while the case was read: nothing has been computed");
            std::process::exit(NOT_CONVERGED.into());
        }
    }
}

pub fn run(arguments: &SolveArguments) -> Result<u8, String> {
    let start = Instant::now();
    // The second Ctrl-C ends the program at once.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
        std::thread::spawn(leave_reading);
    });
    let pictures = arguments.plots.then(Pictures::new).transpose()?;
    let output = match &arguments.output {
        Some(directory) => directory.clone(),
        None => {
            let mut name = arguments.case.file_stem().unwrap_or_default().to_owned();
            name.push("-out");
            arguments.case.with_file_name(name)
        }
    };
    let case = match Case::read(&arguments.case, &arguments.settings) {
        Ok(case) => case,
        Err(error) => {
            // The case comes first in what the user has to mend.
            let _ = withdraw(&output, std::slice::from_ref(&arguments.case));
            return Err(told(&error));
        }
    };
    withdraw(&output, &case.inputs()).map_err(|e| told(&e))?;
    let log = Log::new(arguments);

    let prepared = Prepared {
        start,
        case: &case,
        arguments,
        output: &output,
        log: &log,
        pictures,
    };
    let build = case.build_any().map_err(|e| told(&e))?;
    READ.store(true, Ordering::Relaxed);
    match build {
        AnyBuild::Plane(build) => prepared.run(&build),
        AnyBuild::Space(build) => prepared.run(&build),
    }
}

/// What is known of a run before the dimension of its case is.
struct Prepared<'a> {
    start: Instant,
    case: &'a Case,
    arguments: &'a SolveArguments,
    output: &'a Path,
    log: &'a Log,
    /// None: not asked for.
    pictures: Option<Pictures>,
}

impl Prepared<'_> {
    /// Solves, writes and tells; the exit code.
    fn run<const D: usize>(self, build: &Build<D>) -> Result<u8, String>
    where
        Kind: Draw<D>,
    {
        let Self {
            case,
            arguments,
            output,
            log,
            ..
        } = self;
        prepare(output, &case.inputs()).map_err(|e| told(&e))?;
        log.say(format_args!(
            "n = {}, m = {}: assembled in {:.3} s, of which the contacts {:.4} s",
            build.problem.n_free(),
            build.problem.m(),
            build.mesh_seconds + build.assembly_seconds,
            build.pairing_seconds
        ));
        for body in build.free_bodies() {
            log.tell(&format!("{body}: only contact holds it"));
        }
        let mut run = Run {
            start: self.start,
            case,
            arguments,
            output,
            log,
            build,
            report: Report::new(&case.tables.title, build),
            files: Vec::new(),
            pictures: self.pictures,
            output_seconds: 0.0,
        };
        // What was finished before an error is written nevertheless.
        let solved = run.solve();
        if let Err(error) = &solved {
            run.report.fail(error);
        }
        let written = run.write();
        solved?;
        written?;
        if !arguments.quiet {
            super::print(&summary::text(&run.report, &run.files))?;
        }
        Ok(if run.report.status == Some(Status::Converged) {
            0
        } else {
            NOT_CONVERGED
        })
    }
}

/// A solve on its way, with what it has written and drawn so far.
struct Run<'a, const D: usize>
where
    Kind: Draw<D>,
{
    start: Instant,
    case: &'a Case,
    arguments: &'a SolveArguments,
    output: &'a Path,
    log: &'a Log,
    build: &'a Build<D>,
    report: Report,
    files: Vec<PathBuf>,
    /// None: not asked for.
    pictures: Option<Pictures>,
    output_seconds: f64,
}

impl<const D: usize> Run<'_, D>
where
    Kind: Draw<D>,
{
    /// An error of the solver, with the case that it has met.
    fn failed(&self, error: impl std::error::Error + 'static) -> String {
        format!("{}: {}", self.arguments.case.display(), told(&error))
    }

    /// Sets up and makes the load steps.
    fn solve(&mut self) -> Result<(), String> {
        let (build, log) = (self.build, self.log);
        if INTERRUPTED.load(Ordering::Relaxed) {
            return Ok(());
        }
        let start = Instant::now();
        let options = self.arguments.engine.options();
        let mut engine = Engine::new(&build.problem, options, |line| log.tell(line))
            .map_err(|error| self.failed(error))?;
        give_back_freed();
        self.report.timings.factor = start.elapsed().as_secs_f64();
        self.report.timings.linear_reference = engine
            .cholesky()
            .map(|dual| dual.factor().seconds + dual.solve_seconds);
        log.engine(&engine, self.report.timings.factor);

        let made = self.steps(&mut engine);
        log.costs(&engine);
        let mut path = EnginePath::of(&engine);
        if self.report.status == Some(Status::Converged) {
            // What the whole solve has cost in linear solves; whoever has asked to stop does not wait for it.
            path.v_cycles_linear = engine.linear_iterations(1e-8).ok().flatten();
        }
        self.report.set_path(path);
        made
    }

    /// Makes the load steps, until one does not converge.
    fn steps(&mut self, engine: &mut Engine) -> Result<(), String> {
        let (build, log, n_steps) = (self.build, self.log, self.case.n_steps());
        let mut settings = self.case.settings();
        let memory = RefCell::default();
        settings.ssnm.memory = Some(&memory);
        settings.ssnm.interrupt = Some(&INTERRUPTED);
        let limit = settings.ssnm.time_limit;
        let mut state = State::at_rest(&build.problem);
        for number in 0..n_steps {
            let data = self.case.step(build, number).map_err(|e| told(&e))?;
            let of_problem;
            let load = match &data {
                Some(data) => &data.load,
                None => {
                    of_problem = Load::of(&build.problem);
                    &of_problem
                }
            };
            if n_steps > 1 {
                log.tell(&format!(
                    "load step {} of {n_steps}, factor {}",
                    number + 1,
                    data.as_ref().map_or(1.0, |data| data.factor)
                ));
            }
            settings.ssnm.time_limit =
                limit.map(|limit| limit.saturating_sub(self.start.elapsed()));
            let mut steps = Vec::new();
            let observer = |event: Event| {
                match event {
                    Event::Newton(step) => {
                        log.step(step);
                        steps.push(*step);
                    }
                    Event::Round(round) => log.round(round),
                }
                ControlFlow::Continue(())
            };
            let solution =
                quasistatic::solve_step(&build.problem, load, &state, engine, &settings, observer)
                    .map_err(|error| self.failed(error))?;
            log.finish(&steps, settings.ssnm.tolerance);
            self.report.add_step(build, data.as_ref(), &solution);
            state = solution.state(load);
            self.write_step(data.as_ref(), &solution)?;
            if solution.status != Status::Converged {
                break;
            }
        }
        Ok(())
    }

    /// Writes and draws the step that was added to the report last.
    fn write_step(
        &mut self,
        data: Option<&StepData<D>>,
        solution: &StepSolution<D>,
    ) -> Result<(), String> {
        let start = Instant::now();
        let several = self.case.n_steps() > 1;
        let number = self.report.steps.len();
        let written = write_solution(
            self.output,
            self.build,
            data,
            solution,
            several.then_some(number),
        );
        self.files.extend(written.map_err(|e| told(&e))?);
        if several {
            // After every step, so that ParaView can look in.
            let index = write_index(self.output, &self.report.steps).map_err(|e| told(&e))?;
            if number == 1 {
                self.files.push(index);
            }
        }
        if let Some(pictures) = &mut self.pictures {
            pictures.add_step(&self.report, self.build, data, solution, several);
        }
        self.output_seconds += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Writes the pictures and the report.
    fn write(&mut self) -> Result<(), String> {
        self.report.timings = Timings {
            mesh: self.build.mesh_seconds,
            assembly: self.build.assembly_seconds,
            pairing: self.build.pairing_seconds,
            output: self.output_seconds,
            total: self.start.elapsed().as_secs_f64(),
            ..self.report.timings
        };
        let drawn = match &mut self.pictures {
            Some(pictures) => pictures.write(self.output, &self.report),
            None => Ok(Vec::new()),
        };
        let drawn = drawn.map_err(|e| told(&e));
        if let Err(error) = &drawn {
            self.report.fail(error);
        }
        // Whether or not there was room for pictures.
        let report = write_report(self.output, &self.report).map_err(|e| told(&e))?;
        self.files.extend(drawn?);
        self.files.push(report);
        Ok(())
    }
}

/// Gives the system back what was freed before the first load step: glibc keeps it, 0.3 GiB at a million unknowns.
fn give_back_freed() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    // SAFETY: it touches nothing but free memory.
    unsafe {
        libc::malloc_trim(0);
    }
}
