//! Random problems on some paths, and the printout of one of them.

use super::problems::Problem;
use super::tally::{Tally, failures};
use crate::common::cases::Trial;
use crate::common::draw::number;
use crate::common::or_panic::OrPanic as _;
use crate::common::oracle::balance::least_imbalance;
use crate::common::oracle::{NODAL, Oracle, TOLERANCE, largest};
use crate::common::runs::{Run, Way, print_step};
use signorini::quasistatic;
use signorini::quasistatic::{Load, State, StepSettings, StepSolution};
use signorini::ssnm::Status;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// That of a second solve, where the first is compared with it.
pub const TIGHT: f64 = 1e-10;

pub fn settings(tolerance: f64) -> StepSettings {
    let mut settings = StepSettings::default();
    settings.ssnm.tolerance = tolerance;
    settings
}

pub fn run<const D: usize>(trial: &Trial<D>, way: Way) -> Run<D> {
    let mut run = Run::new(trial, way, settings(TOLERANCE));
    if let Some(error) = run.end.strip_prefix("error: ") {
        // Without figures, so that the same errors are counted together.
        let words = error.chars().filter(|c| !c.is_ascii_digit()).take(100);
        run.end = format!("error: {}", words.collect::<String>());
    }
    run
}

/// A step once more, at a much finer tolerance, on the direct path.
pub fn tight<const D: usize>(
    trial: &Trial<D>,
    load: &Load,
    start: &State,
) -> Option<StepSolution<D>> {
    let solved = catch_unwind(AssertUnwindSafe(|| {
        let mut dual = Way::Cholesky.dual(&trial.problem).ok()?;
        let problem = &trial.problem;
        quasistatic::solve_step(
            problem,
            load,
            start,
            &mut *dual,
            &settings(TIGHT),
            &mut Default::default(),
            |_| ControlFlow::Continue(()),
        )
        .ok()
    }));
    solved
        .ok()
        .flatten()
        .filter(|solution| solution.status == Status::Converged)
}

/// Tries this many problems on some paths: a tally for each.
///
/// Each worker has its own pool with a single thread, so that no solve waits for parts of another one.
pub fn campaign<const D: usize>(
    make: fn(u64) -> Result<Problem<D>, String>,
    ways: &[Way],
    first: u64,
    problems: u64,
) -> Vec<Tally> {
    let next = AtomicU64::new(first);
    let tallies = Mutex::new(ways.iter().map(|_| Tally::default()).collect::<Vec<_>>());
    let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
                let pool = pool.or_panic();
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= first + problems {
                        break;
                    }
                    let found = pool.install(|| one(make, ways, seed));
                    let mut tallies = tallies.lock().expect("no worker panics while it holds it");
                    for (tally, found) in tallies.iter_mut().zip(found) {
                        tally.merge(found);
                    }
                }
            });
        }
    });
    let mut tallies = tallies.into_inner().expect("no worker has panicked");
    for (way, tally) in ways.iter().zip(&mut tallies) {
        tally.print(way.name());
    }
    tallies
}

/// One problem on some paths.
pub fn one<const D: usize>(
    make: fn(u64) -> Result<Problem<D>, String>,
    ways: &[Way],
    seed: u64,
) -> Vec<Tally> {
    let mut tallies: Vec<Tally> = ways.iter().map(|_| Tally::default()).collect();
    let made = catch_unwind(|| make(seed)).unwrap_or_else(|_| Err("panic".to_owned()));
    let problem = match made {
        Ok(problem) => problem,
        Err(error) => {
            for tally in &mut tallies {
                // Right: a prescribed motion into an obstacle has no solution.
                if error.contains("supports drive the node") {
                    tally.remark(
                        "refused: supports drive a node into an obstacle",
                        seed,
                        String::new(),
                    );
                } else {
                    tally.fail("refused", seed, error.clone());
                }
            }
            return tallies;
        }
    };
    let oracle = Oracle::new(&problem.trial.problem);
    let runs: Vec<Run<D>> = ways.iter().map(|&way| run(&problem.trial, way)).collect();
    for (tally, run) in tallies.iter_mut().zip(&runs) {
        tally.add(seed, &problem, &oracle, run);
    }
    // Both paths, as long as their histories are the same.
    if let ([a, b], [_, tally]) = (&runs[..], &mut tallies[..]) {
        // Each step starts from the end of the one before, with its errors.
        let (mut pressure, mut noise) = (0.0_f64, vec![0.0_f64; D * oracle.m]);
        for (number, (a, b)) in a.steps.iter().zip(&b.steps).enumerate() {
            if a.status != Status::Converged || b.status != Status::Converged {
                break;
            }
            let load = &problem.trial.loads[number];
            let start = runs[0].start(&problem.trial, number);
            let now = oracle.noise(load, &start, &a.u);
            noise
                .iter_mut()
                .zip(now)
                .for_each(|(d, now)| *d = d.max(now));
            pressure = pressure.max(oracle.largest_pressure(&a.lambda, &noise));
            let apart = oracle.apart(&b.lambda, &a.lambda, &noise, pressure);
            let place = format!("step {} [{}]", number + 1, problem.trial.name);
            let allowed = 2.0 * NODAL * (number + 1) as f64;
            if oracle.has_coulomb() {
                if apart > 3.0 * allowed {
                    let line = format!("off by {apart:.1e}, {place}");
                    tally.remark("paths differ, Coulomb", seed, line);
                    break;
                }
            } else if matches!(problem.family, "known" | "matrices") && apart > allowed {
                // As A is conditioned; each answer is judged by itself.
                let line = format!("off by {apart:.1e}, {place}");
                tally.remark("paths differ, matrices", seed, line);
                break;
            } else {
                tally.compare(2, apart, allowed, seed, place);
            }
        }
    }
    tallies
}

/// Prints a problem, its solves and the verdict of the oracle.
pub fn tell<const D: usize>(problem: &Problem<D>, seed: u64, ways: &[Way]) {
    let trial = &problem.trial;
    println!("{seed}: {}\n{}", trial.name, trial.text);
    println!("n = {}, m = {}", trial.problem.n(), trial.problem.m());
    let oracle = Oracle::new(&trial.problem);
    for &way in ways {
        let run = run(trial, way);
        println!("---- {}: {}", way.name(), run.end);
        for (number, step) in run.steps.iter().enumerate() {
            let (load, start) = (&trial.loads[number], run.start(trial, number));
            print_step(number, step);
            let balance = least_imbalance(&oracle, load);
            println!(
                "  least imbalance {:.2e}{}",
                balance.imbalance,
                if balance.proven { ", proven" } else { "" }
            );
            let (deviations, blind) = oracle.judge(load, &start, &step.u, &step.lambda, false);
            for deviation in deviations.iter().filter(|d| !(d.times <= 1.0)) {
                println!(
                    "  {} at {}: {:.2e} times what is allowed",
                    deviation.name, deviation.place, deviation.times
                );
            }
            if blind {
                println!("  blind: rounding hides the forces");
            }
            let noise = oracle.noise(load, &start, &step.u);
            if let Some(known) = &problem.known {
                println!(
                    "  from the known answer {:.2e}; rounding {:?}, condition of A {:.2e}; largest {:.2e}",
                    oracle.apart(
                        &step.lambda,
                        &known.lambda,
                        &noise,
                        oracle.largest_pressure(&known.lambda, &noise)
                    ),
                    known.blur,
                    known.loose,
                    largest(&known.lambda)
                );
                if trial.problem.m() <= 8 {
                    println!("  λ  {:?}\n  λ* {:?}", step.lambda, known.lambda);
                }
            }
            if let Some(fine) = tight(trial, load, &start) {
                println!(
                    "  from an answer to {TIGHT:e}: {:.2e}",
                    oracle.apart(
                        &step.lambda,
                        &fine.lambda,
                        &noise,
                        oracle.largest_pressure(&fine.lambda, &noise)
                    )
                );
                if trial.problem.m() <= 8 {
                    println!("  λ  {:?}\n  λ\u{302}  {:?}", step.lambda, fine.lambda);
                }
            }
        }
    }
}

/// As many as the environment requests.
pub fn many<const D: usize>(make: fn(u64) -> Result<Problem<D>, String>) {
    let ways: Vec<Way> = match std::env::var("CAMPAIGN_PATHS").as_deref() {
        Ok("cholesky") => vec![Way::Cholesky],
        Ok("pcg") => vec![Way::Pcg],
        _ => vec![Way::Cholesky, Way::Pcg],
    };
    if let Some(seed) = number("CAMPAIGN_ONLY") {
        let problem = make(seed).or_panic();
        tell(&problem, seed, &ways);
        return;
    }
    let first = number("CAMPAIGN_SEED").unwrap_or(1);
    let problems = number("CAMPAIGN_PROBLEMS").unwrap_or(10_000);
    let failures = failures(&campaign(make, &ways, first, problems));
    assert!(failures.is_empty(), "{failures:#?}");
}

pub fn a_few<const D: usize>(make: fn(u64) -> Result<Problem<D>, String>, problems: u64) {
    let failures = failures(&campaign(make, &[Way::Cholesky, Way::Pcg], 1, problems));
    assert!(failures.is_empty(), "{failures:#?}");
}
