//! Progress on standard error.

use super::SolveArguments;
use signorini::control::Costs;
use signorini::dual::DualOperator as _;
use signorini::engine::Engine;
use signorini::mesh::{ElementKind, Topology};
use signorini::quasistatic::{self, Round};
use signorini::solve::{Event, Solved};
use signorini::ssnm::{SlipSizes, Step};
use std::io::{IsTerminal as _, Write as _};
use std::ops::ControlFlow;

/// The amount of output.
#[derive(Clone, Copy)]
pub struct Log {
    quiet: bool,
    verbose: bool,
    terminal: bool,
}

/// Back to the beginning of a line of a terminal, which is emptied.
const ERASED: &str = "\r\x1b[2K";

/// The heads of the columns; in the plane there is slip forwards and backwards.
fn header(slip: SlipSizes) -> String {
    let slip = match slip {
        SlipSizes::Plane { .. } => " slip+  slip−",
        SlipSizes::Space { .. } => "  slip",
    };
    format!("step  inner  products  predicted       err   contact   stick {slip}  changes")
}

fn row(step: &Step, m: usize) -> String {
    format!(
        "{:4}  {:5}  {:8}  {:>9}  {:8.2e}  {:8}  {:6} {}  {:7}{}",
        step.iter,
        step.inner,
        step.n_a,
        (step.predicted).map_or(String::new(), |predicted| format!("{predicted:.1e}")),
        step.err,
        m - step.sets.separated,
        step.sets.stick,
        match step.sets.slip {
            SlipSizes::Plane {
                slip_plus,
                slip_minus,
            } => format!("{slip_plus:6} {slip_minus:6}"),
            SlipSizes::Space { slip } => format!("{slip:6}"),
        },
        step.changes,
        if step.safeguarded { "  safeguard" } else { "" }
    )
}

impl Log {
    pub fn new(arguments: &SolveArguments) -> Self {
        Self {
            quiet: arguments.quiet,
            verbose: arguments.verbose,
            terminal: std::io::stderr().is_terminal(),
        }
    }

    /// For one of several ranks: only one rank writes.
    #[cfg(feature = "mpi")]
    pub fn of_rank(arguments: &SolveArguments, speaks: bool) -> Self {
        let log = Self::new(arguments);
        Self {
            quiet: log.quiet || !speaks,
            ..log
        }
    }

    /// A line for every user.
    pub fn tell(&self, line: &str) {
        if !self.quiet {
            eprintln!("{line}");
        }
    }

    /// With -v.
    pub fn say(&self, line: std::fmt::Arguments) {
        if self.verbose && !self.quiet {
            eprintln!("{line}");
        }
    }

    /// The solver of the systems with K, with -v.
    pub fn engine(&self, engine: &Engine, seconds: f64) {
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

    /// The costs of the systems with K, with -v.
    pub fn costs(&self, engine: &Engine) {
        if let Some(costs) = engine.costs() {
            self.say(format_args!("{}", describe(&costs)));
        }
    }

    /// Reports load steps as they are made, and passes on finished ones; they continue until that fails.
    pub fn observer<const D: usize, E>(
        self,
        [n_steps, n_cycles]: [usize; 2],
        tolerance: f64,
        written: &mut Result<(), E>,
        mut add: impl FnMut(&Solved<D>) -> Result<(), E>,
    ) -> impl FnMut(Event<D>) -> ControlFlow<()>
    where
        ElementKind: Topology<D>,
    {
        let mut outer = Vec::new();
        move |event| {
            match event {
                Event::Begins {
                    number,
                    cycle,
                    factor,
                } if n_steps * n_cycles > 1 => {
                    let step = (number - 1) % n_steps + 1;
                    let of = match n_cycles {
                        1 => String::new(),
                        _ => format!("cycle {cycle} of {n_cycles}, "),
                    };
                    self.tell(&format!(
                        "{of}load step {step} of {n_steps}, factor {factor}"
                    ));
                }
                Event::Begins { .. } => {}
                // A cycle whose steps have a line each.
                Event::Within(_) if n_cycles > 1 => {}
                Event::Within(quasistatic::Event::Newton(step)) => {
                    self.step(step);
                    outer.push(*step);
                }
                Event::Within(quasistatic::Event::Round(round)) => self.round(round),
                Event::Ends(solved) => {
                    self.finish(&std::mem::take(&mut outer), tolerance);
                    *written = add(&solved);
                }
            }
            match written {
                Ok(()) => ControlFlow::Continue(()),
                Err(_) => ControlFlow::Break(()),
            }
        }
    }

    /// One line that is overwritten on a terminal, and separate lines elsewhere.
    fn step(&self, step: &Step) {
        if self.quiet {
            return;
        }
        if self.terminal {
            eprint!("{ERASED}{step}");
            let _ = std::io::stderr().flush();
        } else {
            eprintln!("{step}");
        }
    }

    fn erase(&self) {
        if self.terminal {
            eprint!("{ERASED}");
        }
    }

    /// The end of a solve that may not be the last of its step.
    fn round(&self, round: &Round) {
        if self.quiet {
            return;
        }
        self.erase();
        let Round { round: k, info, .. } = round;
        let cost = format!("{} steps, {} products", info.iter, info.n_a);
        if round.on_springs {
            eprintln!("solve {k}: weak springs under bodies that only contact holds; {cost}");
        } else {
            eprintln!(
                "solve {k}: Newton steps make no progress, least err {:.2e}; {cost}",
                info.err_relative
            );
        }
    }

    /// The table of all steps.
    fn finish(&self, history: &[Step], tolerance: f64) {
        if self.quiet {
            return;
        }
        self.erase();
        if history.is_empty() {
            return;
        }
        eprintln!("{}", header(history[0].sets.slip));
        for step in history {
            let met = if step.err <= tolerance {
                "  err met"
            } else {
                ""
            };
            eprintln!("{}{met}", row(step, step.sets.total()));
        }
    }
}

/// The costs of the systems with K.
pub fn describe(costs: &Costs) -> String {
    let Costs { solves, device } = costs;
    let mut text = format!(
        "{} systems with K, {} PCG iterations",
        solves.solves, solves.iterations
    );
    if device.dispatches > 0 {
        let per_iteration = |count: usize| count as f64 / solves.iterations.max(1) as f64;
        text += &format!(
            " ({} issued); {} dispatches ({:.2} per iteration, all others included), {} read-backs ({:.2} per iteration), \
             {} submissions",
            solves.issued,
            device.dispatches,
            per_iteration(device.dispatches),
            device.readbacks,
            per_iteration(device.readbacks),
            device.submissions
        );
    }
    text
}
