//! The results of a campaign, in print, and its failures.

use super::problems::trial;
use super::run;
use crate::common::cases::Trial;
use crate::common::oracle::all_sets::has_solution;
use crate::common::oracle::balance::least_imbalance;
use crate::common::oracle::{Oracle, largest};
use crate::common::runs::{Run, Way, name_of};
use signorini::ssnm::Status;
use std::collections::BTreeMap;

/// The errors of the `converged` steps of a run. Correct ones close to their limit are noted in `closest`.
pub fn wrong_steps(
    trial: &Trial,
    oracle: &Oracle,
    run: &Run,
    allowed: f64,
    closest: &mut BTreeMap<&'static str, f64>,
) -> Vec<String> {
    let mut all = Vec::new();
    for (number, step) in run.steps.iter().enumerate() {
        let load = &trial.loads[number];
        if step.status != Status::Converged {
            continue;
        }
        let start = run.start(trial, number);
        let deviations = oracle.deviations(load, &start, &step.u, &step.lambda);
        let wrong: Vec<_> = deviations
            .iter()
            .filter(|d| !(d.times <= allowed))
            .collect();
        for right in deviations.iter().filter(|d| d.times <= allowed) {
            let most = closest.entry(right.name).or_default();
            *most = most.max(right.times);
        }
        // The worst one suffices.
        if let Some(worst) = wrong.iter().max_by(|a, b| a.times.total_cmp(&b.times)) {
            all.push(format!(
                "step {}: {} at {}, {:.2e} times what is allowed ({} conditions broken)",
                number + 1,
                worst.name,
                worst.place,
                worst.times,
                wrong.len()
            ));
        }
    }
    all
}

/// The verdict on a step that has not converged.
pub enum GivenUp {
    /// It is a solution.
    Right,
    /// There is a solution.
    Missed,
    /// There is no solution.
    Hopeless,
    /// Unknown.
    Open,
}

/// Judges the last step of a run, if it has not converged.
pub fn judge(trial: &Trial, oracle: &Oracle, run: &Run) -> Option<(Status, GivenUp)> {
    let number = run.steps.len().checked_sub(1)?;
    let (status, load) = (run.steps[number].status, &trial.loads[number]);
    if status == Status::Converged {
        return None;
    }
    let start = run.start(trial, number);
    let end = &run.steps[number];
    let deviations = oracle.deviations(load, &start, &end.u, &end.lambda);
    if status != Status::NotHeld && deviations.iter().all(|d| d.times <= 1.0) {
        return Some((status, GivenUp::Right));
    }
    let given_up = match has_solution(oracle, load, &start) {
        Some(true) => GivenUp::Missed,
        Some(false) => GivenUp::Hopeless,
        None if least_imbalance(oracle, load).holds() == Some(false) => GivenUp::Hopeless,
        None => GivenUp::Open,
    };
    Some((status, given_up))
}

/// The results of a campaign on one path.
#[derive(Default)]
pub struct Tally {
    pub problems: usize,
    pub refused: Vec<String>,
    pub driven: usize,
    pub steps: [usize; 2],
    pub ends: [BTreeMap<String, usize>; 2],
    pub wrong: [Vec<String>; 2],
    /// For each condition, the largest part of the limit in a right answer.
    pub closest: [BTreeMap<&'static str, f64>; 2],
    /// Steps that have not converged, by status: those that nevertheless have a solution; and the numbers of those that
    /// have none, or may have one.
    pub missed: [Vec<String>; 2],
    pub too_strict: [Vec<String>; 2],
    pub hopeless: [BTreeMap<&'static str, usize>; 2],
    pub open: [BTreeMap<&'static str, usize>; 2],
    pub panics: Vec<String>,
    pub only_rounds: Vec<String>,
    pub only_coupled: Vec<String>,
    pub disputed: Vec<String>,
    pub others: Vec<String>,
    pub both: usize,
    pub products: [usize; 2],
    pub iterations: [usize; 2],
    pub slower: Vec<(usize, usize, u64, usize, String)>,
    pub resorted: Vec<String>,
    pub resort_rounds: usize,
}

pub const WAYS: [&str; 2] = ["monolithic", "rounds"];

/// The allowed error of their answers, in parts of the oracle's limits: rounds end when the slip bounds of a problem that is
/// solved to 10 ε differ by as much from those of its pressures.
pub const ALLOWED: [f64; 2] = [1.0, 2.0];

impl Tally {
    pub fn add(&mut self, seed: u64, way: Way) {
        self.problems += 1;
        let trial = match trial(seed) {
            Ok(trial) => trial,
            // Right: a motion prescribed into an obstacle has no solution.
            Err(error) if error.contains("supports drive the node") => {
                self.driven += 1;
                return;
            }
            Err(error) => {
                self.refused.push(format!("{seed}: {error}"));
                return;
            }
        };
        let oracle = Oracle::new(&trial.problem);
        let runs = [true, false].map(|monolithic| run(&trial, way, monolithic));
        let mut right = [true; 2];
        for (k, run) in runs.iter().enumerate() {
            self.steps[k] += run.steps.len();
            *self.ends[k].entry(run.end.clone()).or_default() += 1;
            if run.end.starts_with("panic") {
                self.panics
                    .push(format!("{seed} {}: {}", WAYS[k], trial.name));
            }
            let wrong = wrong_steps(&trial, &oracle, run, ALLOWED[k], &mut self.closest[k]);
            right[k] = wrong.is_empty();
            for wrong in wrong {
                self.wrong[k].push(format!("{seed}: {wrong} [{}]", trial.name));
            }
            let number = run.steps.len();
            match judge(&trial, &oracle, run) {
                Some((Status::NotHeld, GivenUp::Missed)) => self.wrong[k].push(format!(
                    "{seed}: step {number}: not_held, but there is a solution [{}]",
                    trial.name
                )),
                Some((status, GivenUp::Right)) => self.too_strict[k].push(format!(
                    "{seed}: step {number}: {} [{}]",
                    name_of(status),
                    trial.name
                )),
                Some((status, GivenUp::Missed)) => self.missed[k].push(format!(
                    "{seed}: step {number}: {} [{}]",
                    name_of(status),
                    trial.name
                )),
                Some((status, GivenUp::Hopeless)) => {
                    *self.hopeless[k].entry(name_of(status)).or_default() += 1;
                }
                Some((status, GivenUp::Open)) => {
                    *self.open[k].entry(name_of(status)).or_default() += 1;
                }
                None => {}
            }
        }
        let [monolithic, rounds] = &runs;
        // Step by step, as far as both have solved, and as long as both have the same history.
        for number in 0..trial.loads.len() {
            let [c, r] = [monolithic, rounds].map(|run| run.status(number));
            let (Some(c), Some(r)) = (c, r) else {
                // Panics and errors have no status.
                let broken =
                    |run: &Run| run.end.starts_with("panic") || run.end.starts_with("error");
                if c.is_none() && r == Some(Status::Converged) && broken(monolithic) {
                    let line = format!(
                        "{seed}: step {}: {} [{}]",
                        number + 1,
                        monolithic.end,
                        trial.name
                    );
                    self.only_rounds.push(line);
                }
                if r.is_none() && c == Some(Status::Converged) && broken(rounds) {
                    let line = format!(
                        "{seed}: step {}: {} [{}]",
                        number + 1,
                        rounds.end,
                        trial.name
                    );
                    self.only_coupled.push(line);
                }
                break;
            };
            let line = || {
                format!(
                    "{seed}: step {} of {}: monolithic {} ({} products, {} solves), rounds {} ({} products, {} solves) [{}]",
                    number + 1,
                    trial.loads.len(),
                    name_of(c),
                    monolithic.steps[number].n_a(),
                    monolithic.steps[number].rounds.len(),
                    name_of(r),
                    rounds.steps[number].n_a(),
                    rounds.steps[number].rounds.len(),
                    trial.name
                )
            };
            let not_held = [c, r].contains(&Status::NotHeld);
            match (c == Status::Converged, r == Status::Converged) {
                (true, true) => {
                    let [a, b] = [monolithic, rounds].map(|run| &run.steps[number]);
                    let size = (oracle.size(&a.u, &a.lambda)).max(oracle.size(&b.u, &b.lambda));
                    let apart: Vec<f64> = a.u.iter().zip(&b.u).map(|(a, b)| a - b).collect();
                    // If all loads are gone, rounding of the earlier forces is left.
                    let ago = (monolithic.steps[..number].iter())
                        .fold(0.0, |s: f64, step| s.max(largest(&step.u)));
                    // And a body that moves as a whole has hardly a deformation.
                    let far = 1e-4 * largest(&a.u).max(largest(&b.u));
                    let apart = largest(&apart) / (size + 1e-9 * ago).max(far);
                    if apart > 1e-3 {
                        self.others.push(format!(
                            "{seed}: step {}: apart by {apart:.1e}{} [{}]",
                            number + 1,
                            if right == [true; 2] {
                                ""
                            } else {
                                ", and one is WRONG"
                            },
                            trial.name
                        ));
                        break;
                    }
                }
                (false, true) => self.only_rounds.push(line()),
                (true, false) => self.only_coupled.push(line()),
                // Both fail, but one claims that there is no solution.
                (false, false) if not_held && c != r => self.disputed.push(line()),
                (false, false) => {}
            }
        }
        for (number, step) in monolithic.steps.iter().enumerate() {
            if step.rounds.len() > 1 {
                self.resort_rounds += step.rounds.len() - 1;
                self.resorted.push(format!(
                    "{seed}: step {}: {}, {} solves [{}]",
                    number + 1,
                    name_of(step.status),
                    step.rounds.len(),
                    trial.name
                ));
            }
        }
        if monolithic.solved() && rounds.solved() {
            self.both += 1;
            let products = [monolithic.products(), rounds.products()];
            for k in 0..2 {
                self.products[k] += products[k];
                self.iterations[k] += runs[k].iterations;
            }
            if products[0] > products[1] {
                let solves = monolithic.steps.iter().map(|s| s.rounds.len()).sum();
                self.slower
                    .push((products[0], products[1], seed, solves, trial.name));
            }
        }
    }

    pub fn print(&mut self, way: Way) {
        let section = |title: &str, lines: &[String]| {
            println!("{}: {}", title, lines.len());
            for line in lines {
                println!("    {line}");
            }
        };
        println!("\n== {} ==", way.name());
        println!(
            "problems {}, of which refused {} and {} driven into obstacles",
            self.problems,
            self.refused.len(),
            self.driven
        );
        for k in 0..2 {
            let ends: Vec<String> = self.ends[k]
                .iter()
                .map(|(e, n)| format!("{e} {n}"))
                .collect();
            println!(
                "{:8} steps {}; problems: {}",
                WAYS[k],
                self.steps[k],
                ends.join(", "),
            );
        }
        for k in 0..2 {
            let parts: Vec<String> = (self.closest[k].iter())
                .map(|(name, part)| format!("{name} {part:.1e}"))
                .collect();
            println!(
                "{:8} right answers use of what is allowed at most: {}",
                WAYS[k],
                parts.join(", ")
            );
        }
        println!(
            "both solved {}; products: monolithic {}, rounds {} (PCG iterations {}, {})",
            self.both, self.products[0], self.products[1], self.iterations[0], self.iterations[1]
        );
        println!(
            "monolithic took more products in {} problems; the worst:",
            self.slower.len()
        );
        self.slower
            .sort_by_key(|&(c, r, ..)| std::cmp::Reverse(c - r));
        for (c, r, seed, solves, name) in self.slower.iter().take(10) {
            println!("    {seed}: {c} against {r}, {solves} solves [{name}]");
        }
        println!(
            "monolithic steps that took rounds: {} of {}, {} more solves",
            self.resorted.len(),
            self.steps[0],
            self.resort_rounds
        );
        section("    they are", &self.resorted);
        section("another solution", &self.others);
        section("solved by rounds, not monolithic", &self.only_rounds);
        section("solved monolithic, not by rounds", &self.only_coupled);
        section("no solution by one, given up by the other", &self.disputed);
        for k in 0..2 {
            println!(
                "{:8} given up, but a small problem that has a solution: {}; without a solution {:?}, not known {:?}",
                WAYS[k],
                self.missed[k].len(),
                self.hopeless[k],
                self.open[k]
            );
            for line in &self.missed[k] {
                println!("    {line}");
            }
            println!(
                "{:8} given up at a point that stands the check: {}",
                WAYS[k],
                self.too_strict[k].len()
            );
            for line in &self.too_strict[k] {
                println!("    {line}");
            }
        }
        section("wrong, monolithic", &self.wrong[0]);
        section("wrong, rounds", &self.wrong[1]);
        section("panics", &self.panics);
        section("refused", &self.refused);
    }

    /// The requirements on a campaign.
    pub fn failures(&self, way: Way) -> Vec<String> {
        let mut failures = Vec::new();
        let mut none = |what: &str, count: usize| {
            if count > 0 {
                failures.push(format!("{}: {count} {what}", way.name()));
            }
        };
        none("wrong answers of monolithic steps", self.wrong[0].len());
        none("wrong answers of rounds", self.wrong[1].len());
        none("panics", self.panics.len());
        none("solved by rounds only", self.only_rounds.len());
        none("refused", self.refused.len());
        if self.products[0] >= self.products[1] {
            none("products too many", 1 + self.products[0] - self.products[1]);
        }
        failures
    }
}
