//! Coulomb friction on random problems.
//!
//! Every problem follows from its number alone: an elastic case as a user writes it (blocks on floors, between walls, in a V, on
//! inclined planes, stacked bodies with meshes that do not match; clamped, held in part, or held by contact alone; one to four load
//! steps with unloading and reversal), or matrices (networks of springs, AᵀA). Each is solved by both ways to make products with A,
//! and every step with the status `converged` is checked by [`Oracle`] (`common/oracle.rs`), which
//! shares no code with the check of the solver: it reads only K, N, T, the load and the gap.
//!
//! Steps that have not converged are judged as well, where possible: for small problems all sets are tried ([`has_solution`]), so
//! that `not_held` is wrong where there is a solution; and where no forces on Coulomb's cones balance the bodies
//! ([`least_imbalance`](crate::common::oracle::balance::least_imbalance)) there is none.
//!
//! `cargo test --release --test suite -- --ignored --nocapture coulomb::random_problems` tries 1000 problems on each path.
//! Environment:
//!
//! - `COULOMB_PROBLEMS`: how many problems instead;
//! - `COULOMB_SEED`: the number of the first one (1);
//! - `COULOMB_PATHS`: `cholesky` or `pcg`, to try one path only;
//! - `COULOMB_ONLY`: the number of a single problem, which is printed with the history of each of its solves.

mod best;
mod problems;
mod tally;

use crate::common::cases::Trial;
use crate::common::draw::number;
use crate::common::or_panic::OrPanic as _;
use crate::common::oracle::all_sets::has_solution;
use crate::common::oracle::{Oracle, largest};
use crate::common::runs::{Run, Way, print_step};
use problems::trial;
use signorini::dual::DirectDual;
use signorini::quasistatic;
use signorini::quasistatic::{State, StepSettings};
use signorini::ssnm::Status;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use tally::Tally;

pub fn run(trial: &Trial, way: Way) -> Run {
    Run::new(trial, way, StepSettings::default())
}

/// Tries this many problems on a path; returns the failures.
fn campaign(way: Way, first: u64, problems: u64) -> Vec<String> {
    let mut tally = Tally::default();
    for seed in first..first + problems {
        tally.add(seed, way);
    }
    tally.print(way);
    tally.failures(way)
}

/// Prints a problem, and the course of each solve.
fn tell(seed: u64, ways: &[Way]) {
    let trial = trial(seed).or_panic();
    let problem = &trial.problem;
    println!("{seed}: {}\n{}", trial.name, trial.text);
    println!("n = {}, m = {}", problem.n(), problem.m());
    let oracle = Oracle::new(problem);
    for &way in ways {
        let run = run(&trial, way);
        println!("---- {}: {}", way.name(), run.end);
        for (number, step) in run.steps.iter().enumerate() {
            print_step(number, step);
            let start = run.start(&trial, number);
            if step.status == Status::Converged {
                let load = &trial.loads[number];
                for d in oracle.deviations(load, &start, &step.u, &step.lambda) {
                    if !(d.times <= 1.0) {
                        println!(
                            "  WRONG: {} at {}, {:.2e} times what is allowed",
                            d.name, d.place, d.times
                        );
                    }
                }
            }
        }
    }
}

#[test]
#[ignore = "some thousand solves"]
fn random_problems() {
    let ways: Vec<Way> = match std::env::var("COULOMB_PATHS").as_deref() {
        Ok("cholesky") => vec![Way::Cholesky],
        Ok("pcg") => vec![Way::Pcg],
        _ => vec![Way::Cholesky, Way::Pcg],
    };
    if let Some(seed) = number("COULOMB_ONLY") {
        tell(seed, &ways);
        return;
    }
    let first = number("COULOMB_SEED").unwrap_or(1);
    let problems = number("COULOMB_PROBLEMS").unwrap_or(1000);
    let mut failures = Vec::new();
    for way in ways {
        failures.extend(campaign(way, first, problems));
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn a_few_random_problems() {
    let mut failures = campaign(Way::Cholesky, 1, 60);
    failures.extend(campaign(Way::Pcg, 61, 20));
    assert!(failures.is_empty(), "{failures:#?}");
}

/// A block beside a floor that it never reaches, and one between walls that drifts past them: springs find their ends without forces,
/// though the sum of the rest is below the rounding of so far a motion.
#[test]
fn bodies_that_drift_are_not_held() {
    for seed in [355, 395] {
        let trial = trial(seed).or_panic();
        for way in [Way::Cholesky, Way::Pcg] {
            let run = run(&trial, way);
            assert_eq!(run.end, "not_held", "{seed} {}", way.name());
        }
    }
}

/// Trying all sets finds the solver's solution.
#[test]
fn all_sets_hold_the_solution() {
    let (mut tried, mut lost) = (0, Vec::new());
    for seed in 1..=150 {
        let Ok(trial) = trial(seed) else { continue };
        let oracle = Oracle::new(&trial.problem);
        let run = run(&trial, Way::Cholesky);
        for (number, step) in run.steps.iter().enumerate() {
            let start = run.start(&trial, number);
            let load = &trial.loads[number];
            if step.status == Status::Converged && largest(&step.lambda) > 0.0 {
                match has_solution(&oracle, load, &start) {
                    Some(true) => tried += 1,
                    Some(false) => {
                        lost.push(format!("{seed}, step {}: {}", number + 1, trial.name))
                    }
                    None => {}
                }
            }
        }
    }
    println!("{tried} steps");
    assert!(lost.is_empty(), "{lost:#?}");
    assert!(tried > 50, "{tried}");
}

/// The check detects errors: the answers to a neighbouring problem (friction higher or lower by a tenth, a gap wider, a
/// step that starts elsewhere) do not pass wherever they differ by a hundredth of the deformation.
#[test]
fn the_check_detects_a_neighbouring_problem() {
    let (mut told, mut missed) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for seed in 1..=150 {
        let Ok(trial) = trial(seed) else { continue };
        let oracle = Oracle::new(&trial.problem);
        let right = run(&trial, Way::Cholesky);
        if right.steps[0].status != Status::Converged {
            continue;
        }
        let solution = &right.steps[0];
        let size = oracle.size(&solution.u, &solution.lambda);
        if size == 0.0 {
            continue;
        }
        let rest = State::at_rest(&trial.problem);
        for what in ["more friction", "less friction", "wider gap", "other start"] {
            let factor = match what {
                "more friction" => 1.1,
                "less friction" => 0.9,
                _ => 1.0,
            };
            let mu = trial.problem.friction_coefficient().iter();
            let problem = (trial.problem.clone())
                .with_friction_coefficient(mu.map(|mu| factor * mu).collect())
                .or_panic();
            let mut load = trial.loads[0].clone();
            let mut start = rest.clone();
            if what == "wider gap" {
                load.gap.iter_mut().for_each(|d| *d += 0.1 * size);
            }
            if what == "other start" {
                start.slide.iter_mut().for_each(|s| *s += 0.1 * size);
            }
            let mut dual = DirectDual::new(&problem).or_panic();
            let other = quasistatic::solve_step(
                &problem,
                &load,
                &start,
                &mut dual,
                &StepSettings::default(),
                &mut Default::default(),
                |_| ControlFlow::Continue(()),
            )
            .or_panic();
            let apart = solution.u.iter().zip(&other.u).map(|(a, b)| a - b);
            let apart: Vec<f64> = apart.collect();
            if other.status != Status::Converged || largest(&apart) < 1e-2 * size {
                continue;
            }
            let deviations = oracle.deviations(&trial.loads[0], &rest, &other.u, &other.lambda);
            match deviations.iter().max_by(|a, b| a.times.total_cmp(&b.times)) {
                Some(worst) if worst.times > 1.0 => *told.entry(worst.name).or_default() += 1,
                _ => missed.push(format!("{seed}, {what}: {}", trial.name)),
            }
        }
    }
    println!("told by {told:?}");
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(told.values().sum::<usize>() > 100, "{told:?}");
}
