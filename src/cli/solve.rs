//! `signorini solve`.

use super::{NOT_CONVERGED, SolveArguments};
use signorini::case::Case;
use signorini::dual::{Costs, DualOperator as _};
use signorini::engine::Engine;
use signorini::output::{EnginePath, Report, Timings, write_report, write_solution};
use signorini::ssnm::{self, SetSizes, Status, Step};
use std::fmt::Write as _;
use std::io::{IsTerminal as _, Write as _};
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Set by Ctrl-C.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

pub fn run(arguments: &SolveArguments) -> Result<u8, String> {
    let start = Instant::now();
    let case = Case::read(&arguments.case, &arguments.settings).map_err(|e| e.to_string())?;
    let output = match &arguments.output {
        Some(directory) => directory.clone(),
        None => {
            let mut name = arguments.case.file_stem().unwrap_or_default().to_owned();
            name.push("-out");
            arguments.case.with_file_name(name)
        }
    };
    let log = Log::new(arguments);
    // The second Ctrl-C ends the program at once.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });

    let build = case.build().map_err(|e| e.to_string())?;
    log.say(format_args!(
        "n = {}, m = {}: assembled in {:.3} s",
        build.problem.n_free(),
        build.problem.m(),
        build.mesh_seconds + build.assembly_seconds
    ));
    let mut timings = Timings {
        mesh: build.mesh_seconds,
        assembly: build.assembly_seconds,
        ..Default::default()
    };
    let set_up_start = Instant::now();
    let mut engine = Engine::new(&build.problem, arguments.engine.options(), |line| {
        log.tell(line)
    })
    .map_err(|e| format!("{}: {e}", arguments.case.display()))?;
    timings.factor = set_up_start.elapsed().as_secs_f64();
    match engine.cholesky() {
        Some(dual) => {
            timings.linear_reference = Some(dual.factor_seconds + dual.solve_seconds);
            log.say(format_args!(
                "Cholesky: {} entries ({:.0} MiB), factorised in {:.3} s, one solve {:.4} s",
                dual.factor_entries(),
                dual.factor_entries() as f64 * 8.0 / (1 << 20) as f64,
                dual.factor_seconds,
                dual.solve_seconds
            ));
        }
        None => {
            log.say(format_args!(
                "PCG on the {}, set up in {:.3} s",
                engine.backend(),
                timings.factor
            ));
            if let Some(table) = engine.hierarchy() {
                log.say(format_args!("{table}"));
            }
        }
    }
    let settings = ssnm::Settings {
        interrupt: Some(&INTERRUPTED),
        ..case.settings()
    };
    let solution = ssnm::solve(&build.problem, &mut engine, &settings, |step| {
        log.step(step);
        ControlFlow::Continue(())
    })
    .map_err(|e| format!("{}: {e}", arguments.case.display()))?;
    timings.setup = solution.info.setup_seconds;
    timings.ssnm = solution.info.solve_seconds;
    log.finish(&solution.info.history, settings.tolerance);
    let costs = engine.costs();
    if let Some(costs) = costs {
        log.say(format_args!("{}", describe_costs(&costs)));
    }
    let mut path = EnginePath::of(&engine);
    if solution.status == Status::Converged {
        // What the whole solve has cost in linear solves; whoever has asked to stop does not wait for it.
        path.v_cycles_linear = engine.linear_iterations(1e-8).ok().flatten();
    }
    drop(engine);

    let output_start = Instant::now();
    let mut files = write_solution(&output, &build, &solution).map_err(|e| e.to_string())?;
    timings.output = output_start.elapsed().as_secs_f64();
    timings.total = start.elapsed().as_secs_f64();
    let report = Report::new(&case.tables.title, &build, &solution, path, timings);
    files.push(write_report(&output, &report).map_err(|e| e.to_string())?);
    if !arguments.quiet {
        super::print(&summary(&report, &files));
    }
    Ok(if solution.status == Status::Converged {
        0
    } else {
        NOT_CONVERGED
    })
}

/// What the systems with K have cost.
fn describe_costs(costs: &Costs) -> String {
    let Costs { solves, device } = costs;
    let mut text = format!(
        "{} systems with K, {} PCG iterations",
        solves.solves, solves.iterations
    );
    if device.dispatches > 0 {
        let per_iteration = device.dispatches as f64 / solves.iterations.max(1) as f64;
        write!(
            text,
            "; {} dispatches ({per_iteration:.2} per iteration, all others included), {} read-backs \
             (one per {:.0} iterations), {} submissions",
            device.dispatches,
            device.readbacks,
            solves.iterations as f64 / device.readbacks.max(1) as f64,
            device.submissions
        )
        .expect("writing to a string cannot fail");
    }
    text
}

fn describe(status: Status) -> &'static str {
    match status {
        Status::Converged => "converged",
        Status::IterationLimit => {
            "NOT converged: the limit of outer steps is reached (solver.max_iterations)"
        }
        Status::Stagnated => "NOT converged: rounding stops all progress; loosen solver.tolerance",
        Status::TimeLimit => "NOT converged: the time limit is reached (solver.time_limit)",
        Status::Interrupted => "NOT converged: interrupted",
    }
}

fn summary(report: &Report, files: &[PathBuf]) -> String {
    let SetSizes {
        separated,
        stick,
        slip_plus,
        slip_minus,
    } = report.sets;
    let mut text = String::new();
    let contact = report.m - separated;
    writeln!(text, "{}", describe(report.status)).expect("writing to a string cannot fail");
    writeln!(
        text,
        "  {} outer steps, {} products with A, err {:.1e} of the first; optimality conditions met to {:.1e}",
        report.iter,
        report.n_a,
        report.err_relative,
        report.kkt.max()
    )
    .expect("writing to a string cannot fail");
    writeln!(
        text,
        "  {contact} of {} nodes in contact, {separated} separated; {stick} stick, {} slip",
        report.m,
        slip_plus + slip_minus
    )
    .expect("writing to a string cannot fail");
    writeln!(
        text,
        "  {:.3} s in all: mesh {:.3}, assembly {:.3}, factor {:.3}, set-up {:.3}, contact {:.3}, output {:.3}",
        report.timings.total,
        report.timings.mesh,
        report.timings.assembly,
        report.timings.factor,
        report.timings.setup,
        report.timings.ssnm,
        report.timings.output
    )
    .expect("writing to a string cannot fail");
    for file in files {
        writeln!(text, "  {}", file.display()).expect("writing to a string cannot fail");
    }
    text
}

/// Progress on standard error.
struct Log {
    quiet: bool,
    verbose: bool,
    terminal: bool,
}

const HEADER: &str = "step  inner  products       err   contact   stick  slip+  slip−  changes";

fn row(step: &Step, m: usize) -> String {
    format!(
        "{:4}  {:5}  {:8}  {:8.2e}  {:8}  {:6} {:6} {:6}  {:7}{}",
        step.iter,
        step.inner,
        step.n_a,
        step.err,
        m - step.sets.separated,
        step.sets.stick,
        step.sets.slip_plus,
        step.sets.slip_minus,
        step.changes,
        if step.safeguarded { "  safeguard" } else { "" }
    )
}

/// The number of contact nodes of a step.
fn nodes(step: &Step) -> usize {
    step.sets.stick + step.sets.slip_plus + step.sets.slip_minus
}

impl Log {
    fn new(arguments: &SolveArguments) -> Self {
        Self {
            quiet: arguments.quiet,
            verbose: arguments.verbose,
            terminal: std::io::stderr().is_terminal(),
        }
    }

    /// What the user should know without asking.
    fn tell(&self, line: &str) {
        if !self.quiet {
            eprintln!("{line}");
        }
    }

    /// With -v.
    fn say(&self, line: std::fmt::Arguments) {
        if self.verbose && !self.quiet {
            eprintln!("{line}");
        }
    }

    /// One line that is written over on a terminal, and one after the other elsewhere.
    fn step(&self, step: &Step) {
        if self.quiet {
            return;
        }
        let line = format!(
            "step {}: err {:.2e}, {} products, {} of {} nodes in contact",
            step.iter,
            step.err,
            step.n_a,
            nodes(step) - step.sets.separated,
            nodes(step)
        );
        if self.terminal {
            eprint!("\r\x1b[2K{line}");
            let _ = std::io::stderr().flush();
        } else {
            eprintln!("{line}");
        }
    }

    /// The table of all steps.
    fn finish(&self, history: &[Step], tolerance: f64) {
        if self.quiet {
            return;
        }
        if self.terminal {
            eprint!("\r\x1b[2K");
        }
        if history.is_empty() {
            return;
        }
        eprintln!("{HEADER}");
        for step in history {
            let met = if step.err <= tolerance {
                "  err met"
            } else {
                ""
            };
            eprintln!("{}{met}", row(step, nodes(step)));
        }
    }
}
