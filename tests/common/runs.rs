//! Problems solved step by step on a path, whatever the result, and the printed form of such a run.

use super::cases::Trial;
use signorini::backend::cpu::Cpu;
use signorini::dual::DirectDual;
use signorini::dual::{DualOperator, NestedDual};
use signorini::problem::ContactProblem;
use signorini::quasistatic::{self, State, StepSettings, StepSolution};
use signorini::ssnm::{RecycledSubspace, Status};
use signorini::stiffness::pcg::Preconditioner;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// A path to products with A.
#[derive(Clone, Copy, PartialEq)]
pub enum Way {
    Cholesky,
    Pcg,
}

impl Way {
    pub fn name(self) -> &'static str {
        match self {
            Self::Cholesky => "cholesky",
            Self::Pcg => "pcg",
        }
    }

    pub fn dual<const D: usize>(
        self,
        problem: &ContactProblem<D>,
    ) -> Result<Box<dyn DualOperator>, String> {
        Ok(match self {
            Self::Cholesky => Box::new(DirectDual::new(problem).map_err(|e| e.to_string())?),
            Self::Pcg => Box::new(
                NestedDual::new(problem, Cpu::<f32>::default(), Preconditioner::Multigrid)
                    .map_err(|e| e.to_string())?,
            ),
        })
    }
}

/// All load steps up to the first that does not converge.
pub struct Run<const D: usize = 2> {
    pub steps: Vec<StepSolution<D>>,
    /// The status of the last step, or its error.
    pub end: String,
    /// Iterations of PCG.
    pub iterations: usize,
}

impl<const D: usize> Run<D> {
    /// The run of a problem. Directions are handed on from step to step.
    pub fn new(trial: &Trial<D>, way: Way, settings: StepSettings) -> Self {
        let mut steps: Vec<StepSolution<D>> = Vec::new();
        let ended = catch_unwind(AssertUnwindSafe(|| {
            let problem = &trial.problem;
            let mut dual = way.dual(problem)?;
            let mut recycled = RecycledSubspace::default();

            let mut state = State::at_rest(problem);
            for load in &trial.loads {
                let solution = quasistatic::solve_step(
                    problem,
                    load,
                    &state,
                    &mut *dual,
                    &settings,
                    &mut recycled,
                    |_| ControlFlow::Continue(()),
                )
                .map_err(|e| e.to_string())?;
                let status = solution.status;
                state = solution.state(load);
                steps.push(solution);
                if status != Status::Converged {
                    break;
                }
            }
            Ok::<usize, String>(dual.costs().map_or(0, |costs| costs.solves.iterations))
        }));
        let (end, iterations) = match ended {
            Ok(Ok(iterations)) => {
                let last = steps.last().expect("there is a step").status;
                (name_of(last).to_owned(), iterations)
            }
            Ok(Err(error)) => (format!("error: {error}"), 0),
            Err(cause) => {
                let said = (cause.downcast_ref::<String>().map(String::as_str))
                    .or_else(|| cause.downcast_ref::<&str>().copied());
                (format!("panic: {}", said.unwrap_or("without words")), 0)
            }
        };
        Self {
            steps,
            end,
            iterations,
        }
    }

    /// The start of one of its steps.
    pub fn start(&self, trial: &Trial<D>, step: usize) -> State {
        match step {
            0 => State::at_rest(&trial.problem),
            _ => self.steps[step - 1].state(&trial.loads[step - 1]),
        }
    }

    pub fn solved(&self) -> bool {
        self.end == "converged"
    }

    pub fn products(&self) -> usize {
        self.steps.iter().map(StepSolution::n_a).sum()
    }
}

pub fn name_of(status: Status) -> &'static str {
    match status {
        Status::Converged => "converged",
        Status::IterationLimit => "iteration_limit",
        Status::Stagnated => "stagnated",
        Status::NotHeld => "not_held",
        Status::TimeLimit => "time_limit",
        Status::Interrupted => "interrupted",
        _ => "another status",
    }
}

/// Prints a step, counted from 0, with the history of its solves.
pub fn print_step<const D: usize>(number: usize, step: &StepSolution<D>) {
    println!(
        "step {}: {}, {} products, {:?}",
        number + 1,
        name_of(step.status),
        step.n_a(),
        step.kkt
    );
    for body in &step.not_held {
        println!("  not held: {body:?}");
    }
    for round in &step.rounds {
        println!(
            "  solve {}{}: {} steps, {} products, err {:.2e}, tolerance {:.0e}",
            round.round,
            if round.on_springs {
                " (on springs)"
            } else {
                ""
            },
            round.info.iter,
            round.info.n_a,
            round.info.err_relative,
            round.tolerance
        );
        for row in &round.info.history {
            println!(
                "    {:3} inner {:3} products {:4} err {:.3e} {:?} changes {}{}",
                row.iter,
                row.inner,
                row.n_a,
                row.err,
                row.sets,
                row.changes,
                if row.safeguarded { " safeguard" } else { "" }
            );
        }
    }
}
