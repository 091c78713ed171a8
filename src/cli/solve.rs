//! `signorini solve`.

use super::{NOT_CONVERGED, SolveArguments};
use signorini::case::{Build, Case, StepData};
use signorini::control::Costs;
use signorini::dual::DualOperator as _;
use signorini::engine::Engine;
use signorini::output::{
    ContactReport, EnginePath, Picture, Report, Timings, pictures, prepare, step_pictures,
    write_index, write_pictures, write_report, write_solution,
};
use signorini::quasistatic::{self, Event, Load, Round, State, StepSolution};
use signorini::ssnm::{SetSizes, Status, Step};
use std::cell::RefCell;
use std::fmt::Write as _;
use std::io::{IsTerminal as _, Write as _};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Set by Ctrl-C.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

pub fn run(arguments: &SolveArguments) -> Result<u8, String> {
    let start = Instant::now();
    // The second Ctrl-C ends the program at once.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    });
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

    let build = case.build().map_err(|e| e.to_string())?;
    prepare(&output).map_err(|e| e.to_string())?;
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
        start,
        case: &case,
        arguments,
        output: &output,
        log: &log,
        build: &build,
        report: Report::new(&case.tables.title, &build),
        files: Vec::new(),
        drawn: Vec::new(),
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
        super::print(&summary(&run.report, &run.files))?;
    }
    Ok(if run.report.status == Some(Status::Converged) {
        0
    } else {
        NOT_CONVERGED
    })
}

/// A solve on its way, with what it has written and drawn so far.
struct Run<'a> {
    start: Instant,
    case: &'a Case,
    arguments: &'a SolveArguments,
    output: &'a Path,
    log: &'a Log,
    build: &'a Build,
    report: Report,
    files: Vec<PathBuf>,
    drawn: Vec<Picture>,
    output_seconds: f64,
}

impl Run<'_> {
    /// Sets up and makes the load steps.
    fn solve(&mut self) -> Result<(), String> {
        let (build, log) = (self.build, self.log);
        if INTERRUPTED.load(Ordering::Relaxed) {
            return Ok(());
        }
        let start = Instant::now();
        let mut engine = Engine::new(&build.problem, self.arguments.engine.options(), |line| {
            log.tell(line)
        })
        .map_err(|e| format!("{}: {e}", self.arguments.case.display()))?;
        self.report.timings.factor = start.elapsed().as_secs_f64();
        self.report.timings.linear_reference = engine
            .cholesky()
            .map(|dual| dual.factor().seconds + dual.solve_seconds);
        log.engine(&engine, self.report.timings.factor);

        let made = self.steps(&mut engine);
        if let Some(costs) = engine.costs() {
            log.say(format_args!("{}", describe_costs(&costs)));
        }
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
        let (build, log) = (self.build, self.log);
        let mut settings = self.case.settings();
        let memory = RefCell::default();
        settings.ssnm.memory = Some(&memory);
        settings.ssnm.interrupt = Some(&INTERRUPTED);
        let limit = settings.ssnm.time_limit;
        let mut state = State::at_rest(&build.problem);
        for number in 0..self.case.n_steps() {
            let data = (self.case.step(build, number)).map_err(|e| e.to_string())?;
            let of_problem;
            let load = match &data {
                Some(data) => &data.load,
                None => {
                    of_problem = Load::of(&build.problem);
                    &of_problem
                }
            };
            if self.case.n_steps() > 1 {
                log.tell(&format!(
                    "load step {} of {}, factor {}",
                    number + 1,
                    self.case.n_steps(),
                    data.as_ref().map_or(1.0, |data| data.factor)
                ));
            }
            settings.ssnm.time_limit =
                limit.map(|limit| limit.saturating_sub(self.start.elapsed()));
            let mut steps = Vec::new();
            let solution =
                quasistatic::solve_step(&build.problem, load, &state, engine, &settings, |event| {
                    match event {
                        Event::Newton(step) => {
                            log.step(step);
                            steps.push(*step);
                        }
                        Event::Round(round) => log.round(round),
                    }
                    ControlFlow::Continue(())
                })
                .map_err(|e| format!("{}: {e}", self.arguments.case.display()))?;
            log.finish(&steps, settings.ssnm.tolerance);
            settings.ssnm.sigma_max = Some(solution.last().info.sigma_max);
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
        data: Option<&StepData>,
        solution: &StepSolution,
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
        self.files.extend(written.map_err(|e| e.to_string())?);
        if several {
            // After every step, so that ParaView can look in.
            let index = write_index(self.output, &self.report.steps).map_err(|e| e.to_string())?;
            if number == 1 {
                self.files.push(index);
            }
        }
        if self.arguments.plots {
            self.drawn.extend(step_pictures(
                &self.report,
                self.build,
                data,
                solution,
                several,
            ));
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
        let mut drawn = Ok(Vec::new());
        if self.arguments.plots {
            self.drawn.extend(pictures(&self.report));
            drawn = write_pictures(self.output, &self.report, &self.drawn);
        }
        if let Err(error) = &drawn {
            self.report.fail(&error.to_string());
        }
        // Whether or not there was room for pictures.
        let report = write_report(self.output, &self.report).map_err(|e| e.to_string())?;
        self.files.extend(drawn.map_err(|e| e.to_string())?);
        self.files.push(report);
        Ok(())
    }
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

fn describe(status: Option<Status>) -> &'static str {
    let Some(status) = status else {
        return "ended by an error";
    };
    match status {
        Status::Converged => "converged",
        Status::IterationLimit => {
            "NOT converged: the limit of outer steps (solver.max_iterations) or rounds (solver.max_rounds) is reached"
        }
        Status::Stagnated => {
            "NOT converged: no progress any more; loosen solver.tolerance or, where PCG is used, try --stiffness cholesky"
        }
        Status::NotHeld => {
            "NOT converged: contact and friction do not hold every body under this load"
        }
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
        frictionless,
    } = report.sets;
    let mut text = String::new();
    let contact = report.m - separated;
    writeln!(text, "{}", describe(report.status)).expect("writing to a string cannot fail");
    for one in report.steps.last().iter().flat_map(|step| &step.not_held) {
        writeln!(
            text,
            "  {} {}: add a [[support]], friction, or change the load",
            one.body, one.motion
        )
        .expect("writing to a string cannot fail");
    }
    writeln!(
        text,
        "  {} outer steps, {} products with A, err {:.1e} of the first; optimality conditions met to {:.1e}",
        report.iter,
        report.n_a,
        report.err_relative,
        report.kkt.max()
    )
    .expect("writing to a string cannot fail");
    if let Some(step) = report.steps.last().filter(|step| step.rounds > 1) {
        let steps = match report.steps.len() {
            1 => String::new(),
            n => format!(" in the last of {n} load steps"),
        };
        writeln!(
            text,
            "  {} solves{steps}: coupled steps alone did not get on, {}",
            step.rounds,
            if step.friction_change == 0.0 {
                "rounds with frozen slip bounds between them helped".to_owned()
            } else {
                format!("frozen slip bounds are off by {:.1e}", step.friction_change)
            }
        )
        .expect("writing to a string cannot fail");
    }
    let (contact, separated, stick, slip, frictionless) = match report.steps.last() {
        Some(step) if !step.contacts.is_empty() => {
            let sum =
                |of: &dyn Fn(&ContactReport) -> usize| step.contacts.iter().map(of).sum::<usize>();
            let (separated, stick, slip) =
                (sum(&|c| c.separated), sum(&|c| c.stick), sum(&|c| c.slip));
            let frictionless = sum(&|c| c.frictionless);
            (
                stick + slip + frictionless,
                separated,
                stick,
                slip,
                frictionless,
            )
        }
        // Without geometry the sets are all there is: a separated multiplier sticks or slips as well.
        _ => (
            contact,
            separated,
            stick,
            slip_plus + slip_minus,
            frictionless,
        ),
    };
    let mut states = Vec::new();
    if stick + slip > 0 {
        states.push(format!("{stick} stick, {slip} slip"));
    }
    if frictionless > 0 {
        states.push(format!("{frictionless} without friction"));
    }
    writeln!(
        text,
        "  {contact} of {} nodes in contact, {separated} separated{}{}",
        report.m,
        if states.is_empty() { "" } else { "; " },
        states.join(", ")
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
    if let Some(step) = report.steps.last() {
        for contact in &step.contacts {
            let [x, y] = contact.force;
            writeln!(
                text,
                "  contact {} / {}: force on the first ({x:.6e}, {y:.6e}) {}, pressure up to {:.4e} {}",
                contact.boundary,
                contact.against,
                report.units.force,
                contact.max_pressure,
                report.units.stress()
            )
            .expect("writing to a string cannot fail");
        }
        for support in &step.supports {
            let [x, y] = support.force;
            writeln!(
                text,
                "  support {}: force ({x:.6e}, {y:.6e}) {}",
                support.support, report.units.force
            )
            .expect("writing to a string cannot fail");
        }
    }
    for hint in &report.hints {
        writeln!(text, "  hint: {hint}").expect("writing to a string cannot fail");
    }
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
    let sets = &step.sets;
    sets.stick + sets.slip_plus + sets.slip_minus + sets.frictionless
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

    /// What solves the systems with K, with -v.
    fn engine(&self, engine: &Engine, seconds: f64) {
        match engine.cholesky() {
            Some(dual) => self.say(format_args!(
                "Cholesky: {} entries ({:.0} MiB), factorised in {:.3} s, one solve {:.4} s",
                dual.factor().entries(),
                dual.factor().entries() as f64 * 8.0 / (1 << 20) as f64,
                dual.factor().seconds,
                dual.solve_seconds
            )),
            None => {
                self.say(format_args!(
                    "PCG on the {}, set up in {seconds:.3} s",
                    engine.backend()
                ));
                if let Some(table) = engine.hierarchy() {
                    self.say(format_args!("{table}"));
                }
            }
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

    /// The end of a solve that may not be the last of its step.
    fn round(&self, round: &Round) {
        if self.quiet {
            return;
        }
        if self.terminal {
            eprint!("\r\x1b[2K");
        }
        let Round { round: k, info, .. } = round;
        let cost = format!("{} steps, {} products", info.iter, info.n_a);
        if round.frozen {
            eprintln!(
                "solve {k}: slip bounds frozen, in the end off by {:.2e}; {cost}",
                round.friction_change
            );
        } else {
            eprintln!(
                "solve {k}: coupled steps do not get on, least err {:.2e}; {cost}; next with frozen slip bounds",
                info.err_relative
            );
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
