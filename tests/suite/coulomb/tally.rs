//! The results of a campaign, in print, and its failures.

use super::problems::trial;
use super::run;
use crate::common::cases::Trial;
use crate::common::oracle::Oracle;
use crate::common::oracle::all_sets::has_solution;
use crate::common::oracle::balance::least_imbalance;
use crate::common::runs::{Run, Way, name_of};
use signorini::ssnm::Status;
use std::collections::BTreeMap;

/// The errors of the `converged` steps of a run. Correct ones close to their limit are noted in `closest`.
pub fn wrong_steps(
    trial: &Trial,
    oracle: &Oracle,
    run: &Run,
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
        let wrong: Vec<_> = deviations.iter().filter(|d| !(d.times <= 1.0)).collect();
        for right in deviations.iter().filter(|d| d.times <= 1.0) {
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
    pub steps: usize,
    pub products: usize,
    pub iterations: usize,
    pub ends: BTreeMap<String, usize>,
    pub wrong: Vec<String>,
    /// For each condition, the largest part of the limit in a right answer.
    pub closest: BTreeMap<&'static str, f64>,
    /// Steps that have not converged, by status: those that nevertheless have a solution; and the numbers of those that
    /// have none, or may have one.
    pub missed: Vec<String>,
    pub too_strict: Vec<String>,
    pub hopeless: BTreeMap<&'static str, usize>,
    pub open: BTreeMap<&'static str, usize>,
    pub without_answer: Vec<String>,
    pub panics: Vec<String>,
    pub resorted: Vec<String>,
}

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
        let run = run(&trial, way);
        let number = run.steps.len();
        self.steps += number;
        self.products += run.products();
        self.iterations += run.iterations;
        *self.ends.entry(run.end.clone()).or_default() += 1;
        if run.end.starts_with("panic") || run.end.starts_with("error") {
            self.panics
                .push(format!("{seed} {}: {}", run.end, trial.name));
        }
        for wrong in wrong_steps(&trial, &oracle, &run, &mut self.closest) {
            self.wrong.push(format!("{seed}: {wrong} [{}]", trial.name));
        }
        let line = |status| {
            format!(
                "{seed}: step {number}: {} [{}]",
                name_of(status),
                trial.name
            )
        };
        match judge(&trial, &oracle, &run) {
            Some((Status::NotHeld, GivenUp::Missed)) => self.wrong.push(format!(
                "{seed}: step {number}: not_held, but there is a solution [{}]",
                trial.name
            )),
            Some((status, GivenUp::Right)) => self.too_strict.push(line(status)),
            Some((status, GivenUp::Missed)) => self.missed.push(line(status)),
            Some((status, GivenUp::Hopeless)) => {
                *self.hopeless.entry(name_of(status)).or_default() += 1;
            }
            Some((status, GivenUp::Open)) => {
                *self.open.entry(name_of(status)).or_default() += 1;
            }
            None => {}
        }
        for (number, step) in run.steps.iter().enumerate() {
            let line = format!(
                "{seed}: step {}: {}, {} solves [{}]",
                number + 1,
                name_of(step.status),
                step.rounds.len(),
                trial.name
            );
            if step.rounds.len() > 1 {
                self.resorted.push(line.clone());
            }
            if !matches!(step.status, Status::Converged | Status::NotHeld) {
                self.without_answer.push(line);
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
        let ends: Vec<String> = (self.ends.iter().map(|(e, n)| format!("{e} {n}"))).collect();
        println!(
            "steps {}, products {} (PCG iterations {}); problems: {}",
            self.steps,
            self.products,
            self.iterations,
            ends.join(", ")
        );
        let parts: Vec<String> = (self.closest.iter())
            .map(|(name, part)| format!("{name} {part:.1e}"))
            .collect();
        println!(
            "right answers use of what is allowed at most: {}",
            parts.join(", ")
        );
        section("steps that took springs", &self.resorted);
        section("steps without an answer", &self.without_answer);
        println!(
            "not converged: without a solution {:?}, not known {:?}",
            self.hopeless, self.open
        );
        section(
            "given up, but a small problem that has a solution",
            &self.missed,
        );
        section(
            "given up at a point that passes the check",
            &self.too_strict,
        );
        section("wrong", &self.wrong);
        section("panics", &self.panics);
        section("refused", &self.refused);
    }

    /// The requirements on a campaign: one step in a hundred may have no answer.
    pub fn failures(&self, way: Way) -> Vec<String> {
        let mut failures = Vec::new();
        let mut none = |what: &str, count: usize| {
            if count > 0 {
                failures.push(format!("{}: {count} {what}", way.name()));
            }
        };
        none("wrong answers", self.wrong.len());
        none("panics", self.panics.len());
        none("refused", self.refused.len());
        let allowed = self.steps / 100;
        none(
            "steps without an answer beyond those allowed",
            self.without_answer.len().saturating_sub(allowed),
        );
        failures
    }
}
