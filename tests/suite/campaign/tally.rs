//! The results of one path, and the failures among them.

use super::problems::Problem;
use super::runs::tight;
use crate::common::oracle::all_sets::has_solution;
use crate::common::oracle::balance::least_imbalance;
use crate::common::oracle::{NODAL, Oracle, RESULTANT};
use crate::common::runs::{Run, name_of};
use signorini::quasistatic::{Load, State, StepSolution};
use signorini::ssnm::Status;
use std::collections::BTreeMap;

/// The remark about forces that are off by more, where the condition of A explains it or may explain it.
pub const CONDITIONED: &str = "forces of matrices off by more than 3000 ε, as A is conditioned";

/// Nodal forces are estimated from the gradient: no more than one comparison in this many may be off by more.
pub const RARE: usize = 1000;

/// At most two load steps in this many may miss an existing answer, and a few of them in all.
pub const ANSWERED: usize = 1000;

/// More Newton steps of a convex problem are worth a look.
pub const STEPS: usize = 60;

/// Lines about seeds, by subject.
pub type Notes = BTreeMap<String, Vec<(u64, String)>>;

/// The results of one path.
#[derive(Default)]
pub struct Tally {
    pub problems: usize,
    pub steps: usize,
    pub products: usize,
    pub longest: (usize, u64),
    /// For each family, how often it ended in which way.
    pub ends: BTreeMap<&'static str, BTreeMap<String, usize>>,
    /// For each condition the largest part of the allowed deviation.
    pub worst: BTreeMap<&'static str, (f64, u64)>,
    /// Failures.
    pub failures: Notes,
    /// Remarks that deserve a look.
    pub remarks: Notes,
    /// Answers to steps whose forces are below rounding.
    pub blind: usize,
    /// Steps without an answer although there is one.
    pub unanswered: usize,
    /// Steps compared with a known answer, with one at a finer tolerance, and with the other path.
    pub compared: [usize; 3],
    /// Those of them that were off by more than promised.
    pub beyond: [usize; 3],
}

impl Tally {
    pub fn fail(&mut self, what: &str, seed: u64, line: String) {
        let of = self.failures.entry(what.to_owned()).or_default();
        of.push((seed, line));
    }

    pub fn remark(&mut self, what: &str, seed: u64, line: String) {
        let of = self.remarks.entry(what.to_owned()).or_default();
        of.push((seed, line));
    }

    pub fn worst(&mut self, name: &'static str, times: f64, seed: u64) {
        let worst = self.worst.entry(name).or_insert((0.0, seed));
        if !(times <= worst.0) {
            *worst = (times, seed);
        }
    }

    /// Two answers where there is one only.
    pub fn compare(&mut self, which: usize, apart: f64, allowed: f64, seed: u64, line: String) {
        const NAMES: [&str; 3] = [
            "forces from a known answer",
            "forces from a finer answer",
            "forces from the other path",
        ];
        self.compared[which] += 1;
        self.worst(NAMES[which], apart / allowed, seed);
        if !(apart <= allowed) {
            self.beyond[which] += 1;
            let line = format!("off by {apart:.1e} of the largest, {line}");
            self.remark(NAMES[which], seed, line);
        }
    }

    /// Judges a run.
    pub fn add<const D: usize>(
        &mut self,
        seed: u64,
        problem: &Problem<D>,
        oracle: &Oracle,
        run: &Run<D>,
    ) {
        let trial = &problem.trial;
        self.problems += 1;
        self.steps += run.steps.len();
        self.products += run.products();
        if run.products() > self.longest.0 {
            self.longest = (run.products(), seed);
        }
        let ends = self.ends.entry(problem.family).or_default();
        *ends.entry(run.end.clone()).or_default() += 1;
        if run.end.starts_with("panic") {
            self.fail("panics", seed, format!("{} [{}]", run.end, trial.name));
        } else if run.end.starts_with("error") {
            let what = run.end.clone();
            self.remark(&what, seed, trial.name.clone());
        }
        for (number, step) in run.steps.iter().enumerate() {
            let load = &trial.loads[number];
            let start = run.start(trial, number);
            let place = format!(
                "step {} of {} [{}]",
                number + 1,
                trial.loads.len(),
                trial.name
            );
            if !oracle.has_coulomb() && step.iter() > STEPS {
                let line = format!("{}, {place}", step.iter());
                self.remark("many steps of a convex problem", seed, line);
            }
            if step.status == Status::Converged {
                self.converged(seed, problem, oracle, load, &start, step, &place);
            } else {
                self.given_up(seed, problem, oracle, load, &start, step, &place);
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    pub fn converged<const D: usize>(
        &mut self,
        seed: u64,
        problem: &Problem<D>,
        oracle: &Oracle,
        load: &Load,
        start: &State,
        step: &StepSolution<D>,
        place: &str,
    ) {
        let (mut deviations, blind) = oracle.judge(load, start, &step.u, &step.lambda, false);
        self.blind += usize::from(blind);
        // Remaining forces after unloading are no more accurate than those before.
        if deviations.iter().any(|d| !(d.times <= 1.0)) {
            deviations = oracle.judge(load, start, &step.u, &step.lambda, true).0;
            if deviations.iter().all(|d| d.times <= 1.0) {
                let what = "forces as exact as those before";
                self.remark(what, seed, place.to_owned());
            }
        }
        for deviation in &deviations {
            self.worst(deviation.name, deviation.times, seed);
        }
        let broken = deviations.iter().filter(|d| !(d.times <= 1.0));
        if let Some(worst) = broken.clone().max_by(|a, b| a.times.total_cmp(&b.times)) {
            let line = format!(
                "{} at {}, {:.2e} times what is allowed ({} broken), {place}",
                worst.name,
                worst.place,
                worst.times,
                broken.count()
            );
            self.fail("wrong converged", seed, line);
        }
        if problem.held == Some(false) {
            let balance = least_imbalance(oracle, load);
            if balance.imbalance > RESULTANT {
                let line = format!("imbalance {:.1e}, {place}", balance.imbalance);
                self.fail("converged where nothing holds", seed, line);
            }
        }
        let noise = oracle.noise(load, start, &step.u);
        if let Some(known) = &problem.known {
            let pressure = oracle.largest_pressure(&known.lambda, &noise);
            match known.blur {
                _ if blind || pressure == 0.0 => {}
                None => {}
                Some(blur) if blur > pressure => {
                    self.remark(
                        "rounding of f hides the known answer",
                        seed,
                        place.to_owned(),
                    );
                }
                Some(blur) => {
                    let apart = oracle.apart(&step.lambda, &known.lambda, &noise, pressure);
                    let line = format!(
                        "rounding explains {:.1e}, the condition of A {:.1e}, {place}",
                        blur / pressure,
                        known.loose / pressure
                    );
                    let allowed = NODAL + blur / pressure;
                    if apart > allowed && apart <= allowed + known.loose / pressure {
                        self.remark(CONDITIONED, seed, line);
                    } else {
                        self.compare(0, apart, allowed, seed, line);
                    }
                }
            }
        }
        let unique = !oracle.has_coulomb();
        if unique
            && !blind
            && oracle.n <= 600
            && let Some(fine) = tight(&problem.trial, load, start)
        {
            let pressure = oracle.largest_pressure(&fine.lambda, &noise);
            let apart = oracle.apart(&step.lambda, &fine.lambda, &noise, pressure);
            let explained = match &problem.known {
                Some(known) => apart <= NODAL + known.loose / pressure,
                None => problem.family == "matrices",
            };
            if apart > NODAL && explained {
                let line = format!("off by {apart:.1e} of the largest, {place}");
                self.remark(CONDITIONED, seed, line);
            } else {
                self.compare(1, apart, NODAL, seed, place.to_owned());
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    pub fn given_up<const D: usize>(
        &mut self,
        seed: u64,
        problem: &Problem<D>,
        oracle: &Oracle,
        load: &Load,
        start: &State,
        step: &StepSolution<D>,
        place: &str,
    ) {
        let status = name_of(step.status);
        let balance = least_imbalance(oracle, load);
        let line = format!("imbalance {:.1e}, {place}", balance.imbalance);
        let coulomb = oracle.has_coulomb();
        let exists = match balance.holds() {
            Some(true) if problem.family == "known" || !coulomb => Some(true),
            Some(true) if D == 2 => has_solution(oracle, load, start),
            Some(true) => None,
            other => other,
        };
        let what = match exists {
            Some(true) => "there is a solution",
            Some(false) => "there is none",
            None if balance.holds().is_none() => "on the edge of what holds",
            None => "not known whether there is a solution",
        };
        if step.status == Status::NotHeld && exists == Some(true) {
            self.fail("wrong not_held", seed, line);
        } else {
            self.unanswered += usize::from(exists == Some(true));
            self.remark(&format!("{status}, {what}"), seed, line);
        }
        if step.status == Status::NotHeld && problem.held == Some(true) {
            let line = format!("statics says it holds, {place}");
            self.fail("wrong not_held", seed, line);
        }
    }

    pub fn merge(&mut self, other: Self) {
        self.problems += other.problems;
        self.steps += other.steps;
        self.products += other.products;
        self.blind += other.blind;
        self.unanswered += other.unanswered;
        for (sum, more) in self.compared.iter_mut().zip(other.compared) {
            *sum += more;
        }
        for (sum, more) in self.beyond.iter_mut().zip(other.beyond) {
            *sum += more;
        }
        if other.longest.0 > self.longest.0 {
            self.longest = other.longest;
        }
        for (family, ends) in other.ends {
            for (end, count) in ends {
                *self.ends.entry(family).or_default().entry(end).or_default() += count;
            }
        }
        for (name, (times, seed)) in other.worst {
            self.worst(name, times, seed);
        }
        for (mine, others) in [
            (&mut self.failures, other.failures),
            (&mut self.remarks, other.remarks),
        ] {
            for (what, lines) in others {
                mine.entry(what).or_default().extend(lines);
            }
        }
    }

    pub fn print(&mut self, name: &str) {
        println!("\n== {name} ==");
        println!(
            "{} problems, {} steps, {} products, at most {} (seed {})",
            self.problems, self.steps, self.products, self.longest.0, self.longest.1
        );
        let mut all: BTreeMap<String, usize> = BTreeMap::new();
        for (family, ends) in &self.ends {
            let list: Vec<String> = ends.iter().map(|(end, n)| format!("{end} {n}")).collect();
            println!("  {family:10} {}", list.join(", "));
            for (end, n) in ends {
                *all.entry(end.clone()).or_default() += n;
            }
        }
        let list: Vec<String> = all.iter().map(|(end, n)| format!("{end} {n}")).collect();
        println!("  {:10} {}", "all", list.join(", "));
        println!(
            "compared with a known answer {}, with a finer one {}, with the other path {}; blind {}",
            self.compared[0], self.compared[1], self.compared[2], self.blind
        );
        println!("worst, in parts of what is allowed:");
        for (name, (times, seed)) in &self.worst {
            println!("  {name:28} {times:.2e} (seed {seed})");
        }
        for (title, notes) in [
            ("FAILED", &mut self.failures),
            ("remark", &mut self.remarks),
        ] {
            for (what, lines) in notes {
                lines.sort();
                println!("{title}: {what}: {}", lines.len());
                for (seed, line) in lines.iter().take(20) {
                    println!("    {seed}: {line}");
                }
            }
        }
    }
}

/// The failures over all paths.
pub fn failures(tallies: &[Tally]) -> Vec<String> {
    let notes = tallies.iter().flat_map(|tally| &tally.failures);
    let mut failures: Vec<String> = notes
        .map(|(what, lines)| format!("{what}: {} (first seed {})", lines.len(), lines[0].0))
        .collect();
    for tally in tallies {
        for (beyond, compared) in tally.beyond.iter().zip(tally.compared) {
            if beyond * RARE > compared {
                failures.push(format!(
                    "forces off by more than promised: {beyond} of {compared}"
                ));
            }
        }
        if tally.unanswered > 2 + 2 * tally.steps / ANSWERED {
            failures.push(format!(
                "no answer where there is one: {} of {} steps",
                tally.unanswered, tally.steps
            ));
        }
    }
    failures
}
