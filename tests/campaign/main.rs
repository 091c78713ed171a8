//! What `converged` and `not_held` promise, tried on many thousand random problems.
//!
//! Every problem follows from its seed alone. Families:
//!
//! - **known**: matrices with a solution that was chosen first: u, λ and the sets, then f = K u + Bᵀλ, d and g. K is a
//!   network of springs or AᵀA with up to 10¹¹ between its largest and smallest eigenvalue, by contrasts of stiffness or
//!   by scales of the unknowns; nodes may just touch, stick at the very bound, have no gap or no friction at all;
//! - **matrices**: the same matrices under random loads, in one to four load steps;
//! - **block**, **stack**: elastic cases as a user writes them (`common/cases.rs`), in units that differ by many
//!   decades: clamped, moved, guided, pinned or held by contact alone, on floors, discs, in V's and between walls, stacked
//!   with meshes that do not match, with unloading and reversal;
//! - **edge**: a block that contact alone holds, pushed by a force that is larger or smaller by 10⁻¹ to 10⁻⁸ than
//!   what statics says that it bears before it slides or tips.
//!
//! In space (`solids.rs`): **solid**, a block on a half-space, a ball or a cylinder, **solids**, two blocks on each other.
//!
//! # What an answer is judged by
//!
//! [`Oracle`] reads K, N, T, the load and the gap, and shares no code with the solver. Its sums are compensated, so that
//! what it finds is in the answer. It allows what `docs/case-file.md` promises and no more, ε = 10⁻⁶ being the
//! tolerance:
//!
//! - conditions (1)–(3) to 10 ε: forces relative to the larger of the acting and of the contact forces, lengths relative
//!   to the deformation (u less the mean rigid motion of each body) or to what a contact force does to its own node;
//! - the balance of each body that can move as a whole (each motion by itself) to 100 ε of the forces on *this* body;
//! - node by node: forces to 3000 ε of the largest pressure: a node that is pressed *and* apart, or that slips without
//!   its full friction, is wrong by the force that would close the gap if it were the only one, at least;
//! - where these are missed after unloading, nodal forces are looked at again relative to the largest pressure before
//!   the load step, which slip is counted from, and told as a remark;
//! - where the answer is the only one (no Coulomb friction) and known, or found again at a tolerance of 10⁻¹⁰:
//!   multipliers to 3000 ε of the largest pressure. For the known answer, what rounding of f and, of matrices with
//!   contrasts of stiffness, what the condition of A makes of violations as small as promised come on top. Without a known
//!   answer that is not known, and such matrices are only told. So are they where the paths
//!   differ by more than twice that. As the solver estimates these errors, one comparison in a thousand may be off by
//!   more.
//!
//! Rounding allowed: 32 units in the last place of the terms of a difference, as the documentation says. Where bodies
//! have moved far, that may be more than the forces; such answers are counted as *blind*. Contact forces that close no
//! more than a hundred times the rounding of a gap are dust, and none.
//!
//! Bodies with supports are in balance where the forces on each of their free unknowns are: what holds the others is not
//! part of (1), so that reactions are not looked at here.
//!
//! `not_held` is right where [`least_imbalance`], a bounded least-squares problem solved by an active-set method,
//! finds that no forces within the friction law balance a body, and proves it by a motion that all of them together
//! resist less than the loads drive it. Without Coulomb friction a problem that can be balanced has a solution, so that
//! `not_held` is wrong there; with Coulomb friction all sets are tried where they are few (`common/checker.rs`).
//!
//! In space the bounded least-squares problem is a cone program, which Clarabel solves.
//!
//! `cargo test --release --test campaign -- --ignored --nocapture random_problems` tries 10 000 problems in the plane on
//! each path, `random_solids` as many in space. Environment:
//!
//! - `CAMPAIGN_PROBLEMS`: how many problems instead;
//! - `CAMPAIGN_SEED`: the seed of the first one (1);
//! - `CAMPAIGN_PATHS`: `cholesky`, `pcg` or both with a comma between;
//! - `CAMPAIGN_ONLY`: the seed of a single problem, which is printed with the history of its solves.

mod ablation;
#[path = "../common/mod.rs"]
mod common;
mod oracle;
mod problems;
mod solids;

use common::cases::{Trial, elastic, generator};
use common::checker::{has_solution, largest, length};
use common::runs::{Run, TIME_LIMIT, Way, name_of, print_step};
use oracle::{NODAL, Oracle, RESULTANT, TOLERANCE, least_imbalance};
use problems::{Problem, edge, problem};
use signorini::quasistatic::{self, Load, Settings, State, StepSolution};
use signorini::ssnm::Status;
use solids::solid;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// That of a second solve, where the first is compared with it.
const TIGHT: f64 = 1e-10;
/// What is told of forces that are off by more, where the condition of A explains it or may explain it.
const CONDITIONED: &str = "forces of matrices off by more than 3000 ε, as A is conditioned";
/// Nodal forces are estimated from the gradient: no more than one comparison in so many may be off by more in the plane …
const RARE: usize = 1000;
/// … and in space, where blocks hang over others with slivers of facets, and their moduli differ by 10⁴.
const RARE_IN_SPACE: usize = 200;
/// Two load steps in so many at most may be without the answer that there is, and a few of them in all.
const ANSWERED: usize = 1000;
/// More Newton steps of a convex problem are worth a look.
const STEPS: usize = 60;

// ---------------------------------------------------------------------------------------------------------
// Runs

fn settings(tolerance: f64) -> Settings {
    let mut settings = Settings::default();
    settings.ssnm.time_limit = Some(TIME_LIMIT);
    settings.ssnm.tolerance = tolerance;
    settings
}

fn run<const D: usize>(trial: &Trial<D>, way: Way) -> Run<D> {
    let mut run = Run::new(trial, way, settings(TOLERANCE));
    if let Some(error) = run.end.strip_prefix("error: ") {
        // Without figures, so that the same errors are counted together.
        let words = error.chars().filter(|c| !c.is_ascii_digit()).take(100);
        run.end = format!("error: {}", words.collect::<String>());
    }
    run
}

/// A step once more, at a much finer tolerance, on the direct path.
fn tight<const D: usize>(trial: &Trial<D>, load: &Load, start: &State) -> Option<StepSolution<D>> {
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

// ---------------------------------------------------------------------------------------------------------
// What a campaign has found

/// Lines about seeds, by what they are about.
type Notes = BTreeMap<String, Vec<(u64, String)>>;

/// What one path has come to.
#[derive(Default)]
struct Tally {
    problems: usize,
    steps: usize,
    products: usize,
    seconds: f64,
    slowest: (f64, u64),
    /// For each family, how often it ended in which way.
    ends: BTreeMap<&'static str, BTreeMap<String, usize>>,
    /// For each condition the largest part of what is allowed.
    worst: BTreeMap<&'static str, (f64, u64)>,
    /// What must not be.
    failures: Notes,
    /// What may be, and is worth a look.
    remarks: Notes,
    /// Answers to steps whose forces rounding hides.
    blind: usize,
    /// Steps without an answer although there is one.
    unanswered: usize,
    /// Steps compared with a known answer, with one at a finer tolerance, and with the other path.
    compared: [usize; 3],
    /// Those of them that were off by more than promised.
    beyond: [usize; 3],
}

impl Tally {
    fn fail(&mut self, what: &str, seed: u64, line: String) {
        let of = self.failures.entry(what.to_owned()).or_default();
        of.push((seed, line));
    }

    fn remark(&mut self, what: &str, seed: u64, line: String) {
        let of = self.remarks.entry(what.to_owned()).or_default();
        of.push((seed, line));
    }

    fn worst(&mut self, name: &'static str, times: f64, seed: u64) {
        let worst = self.worst.entry(name).or_insert((0.0, seed));
        if !(times <= worst.0) {
            *worst = (times, seed);
        }
    }

    /// Two answers where there is one only.
    fn compare(&mut self, which: usize, apart: f64, allowed: f64, seed: u64, line: String) {
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
    fn add<const D: usize>(
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
        self.seconds += run.seconds;
        if run.seconds > self.slowest.0 {
            self.slowest = (run.seconds, seed);
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
    fn converged<const D: usize>(
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
        // What rounding has left of forces after unloading is known no better than those before.
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
        let dust = oracle.dust(load, start, &step.u);
        if let Some(known) = &problem.known {
            let pressure = oracle.largest_pressure(&known.lambda, &dust);
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
                    let apart = oracle.apart(&step.lambda, &known.lambda, &dust, pressure);
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
            && oracle.of.n <= 600
            && let Some(fine) = tight(&problem.trial, load, start)
        {
            let pressure = oracle.largest_pressure(&fine.lambda, &dust);
            let apart = oracle.apart(&step.lambda, &fine.lambda, &dust, pressure);
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
    fn given_up<const D: usize>(
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
            Some(true) if D == 2 => has_solution(&oracle.of, load, start),
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

    fn merge(&mut self, other: Self) {
        self.problems += other.problems;
        self.steps += other.steps;
        self.products += other.products;
        self.seconds += other.seconds;
        self.blind += other.blind;
        self.unanswered += other.unanswered;
        for (sum, more) in self.compared.iter_mut().zip(other.compared) {
            *sum += more;
        }
        for (sum, more) in self.beyond.iter_mut().zip(other.beyond) {
            *sum += more;
        }
        if other.slowest.0 > self.slowest.0 {
            self.slowest = other.slowest;
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

    fn print(&mut self, name: &str) {
        println!("\n== {name} ==");
        println!(
            "{} problems, {} steps, {} products, {:.1} s in solves, the slowest {:.2} s (seed {})",
            self.problems, self.steps, self.products, self.seconds, self.slowest.0, self.slowest.1
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

/// Tries so many problems on some paths: a tally for each.
///
/// Each worker has a pool of its own with a single thread, so that no solve waits for parts of another one.
fn campaign<const D: usize>(
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
                let pool = pool.unwrap_or_else(|error| panic!("{error}"));
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
fn one<const D: usize>(
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
        let (mut pressure, mut dust) = (0.0_f64, vec![0.0_f64; D * oracle.of.m]);
        for (number, (a, b)) in a.steps.iter().zip(&b.steps).enumerate() {
            if a.status != Status::Converged || b.status != Status::Converged {
                break;
            }
            let load = &problem.trial.loads[number];
            let start = runs[0].start(&problem.trial, number);
            let now = oracle.dust(load, &start, &a.u);
            dust.iter_mut()
                .zip(now)
                .for_each(|(d, now)| *d = d.max(now));
            pressure = pressure.max(oracle.largest_pressure(&a.lambda, &dust));
            let apart = oracle.apart(&b.lambda, &a.lambda, &dust, pressure);
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

fn number(name: &str) -> Option<u64> {
    let value = std::env::var(name).ok()?;
    Some(
        value
            .parse()
            .unwrap_or_else(|_| panic!("{name} = {value} is no number")),
    )
}

/// Prints a problem, how its solves go and what the oracle says.
fn tell<const D: usize>(problem: &Problem<D>, seed: u64, ways: &[Way]) {
    let trial = &problem.trial;
    println!("{seed}: {}\n{}", trial.name, trial.text);
    println!("n = {}, m = {}", trial.problem.n(), trial.problem.m());
    let oracle = Oracle::new(&trial.problem);
    for &way in ways {
        let run = run(trial, way);
        println!("---- {}: {} in {:.2} s", way.name(), run.end, run.seconds);
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
            let dust = oracle.dust(load, &start, &step.u);
            if let Some(known) = &problem.known {
                println!(
                    "  from the known answer {:.2e}; rounding {:?}, condition of A {:.2e}; largest {:.2e}",
                    oracle.apart(
                        &step.lambda,
                        &known.lambda,
                        &dust,
                        oracle.largest_pressure(&known.lambda, &dust)
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
                        &dust,
                        oracle.largest_pressure(&fine.lambda, &dust)
                    )
                );
                if trial.problem.m() <= 8 {
                    println!("  λ  {:?}\n  λ\u{302}  {:?}", step.lambda, fine.lambda);
                }
            }
        }
    }
}

/// What must not be, over all paths.
fn failures<const D: usize>(tallies: &[Tally]) -> Vec<String> {
    let rare = if D == 2 { RARE } else { RARE_IN_SPACE };
    let notes = tallies.iter().flat_map(|tally| &tally.failures);
    let mut failures: Vec<String> = notes
        .map(|(what, lines)| format!("{what}: {} (first seed {})", lines.len(), lines[0].0))
        .collect();
    for tally in tallies {
        for (beyond, compared) in tally.beyond.iter().zip(tally.compared) {
            if beyond * rare > compared {
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

/// As many as the environment says.
fn many<const D: usize>(make: fn(u64) -> Result<Problem<D>, String>) {
    let ways: Vec<Way> = match std::env::var("CAMPAIGN_PATHS").as_deref() {
        Ok("cholesky") => vec![Way::Cholesky],
        Ok("pcg") => vec![Way::Pcg],
        _ => vec![Way::Cholesky, Way::Pcg],
    };
    if let Some(seed) = number("CAMPAIGN_ONLY") {
        let problem = make(seed).unwrap_or_else(|error| panic!("{error}"));
        tell(&problem, seed, &ways);
        return;
    }
    let first = number("CAMPAIGN_SEED").unwrap_or(1);
    let problems = number("CAMPAIGN_PROBLEMS").unwrap_or(10_000);
    let failures = failures::<D>(&campaign(make, &ways, first, problems));
    assert!(failures.is_empty(), "{failures:#?}");
}

fn a_few<const D: usize>(make: fn(u64) -> Result<Problem<D>, String>, problems: u64) {
    let failures = failures::<D>(&campaign(make, &[Way::Cholesky, Way::Pcg], 1, problems));
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
#[ignore = "20 000 solves"]
fn random_problems() {
    many(problem);
}

#[test]
fn a_few_random_problems() {
    a_few(problem, 150);
}

#[test]
#[ignore = "20 000 solves"]
fn random_solids() {
    many(solid);
}

#[test]
fn a_few_random_solids() {
    a_few(solid, 150);
}

/// The oracle is worth something: an answer with a multiplier changed by a hundredth, a sign turned, or a node moved
/// does not pass.
#[test]
fn the_oracle_tells_what_is_wrong() {
    let (mut told, mut missed) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for seed in 1..=120 {
        let Ok(problem) = problem(seed) else { continue };
        let oracle = Oracle::new(&problem.trial.problem);
        let (n, m) = (oracle.of.n, oracle.of.m);
        if n > 200 {
            continue;
        }
        let run = run(&problem.trial, Way::Cholesky);
        let Some(step) = run.steps.first().filter(|s| s.status == Status::Converged) else {
            continue;
        };
        let (load, start) = (&problem.trial.loads[0], run.start(&problem.trial, 0));
        let wrong = |u: &[f64], lambda: &[f64]| {
            let (deviations, blind) = oracle.judge(load, &start, u, lambda, false);
            assert!(!blind, "{seed}: {}", problem.trial.name);
            deviations.iter().any(|d| !(d.times <= 1.0))
        };
        assert!(
            !wrong(&step.u, &step.lambda),
            "{seed}: {}",
            problem.trial.name
        );
        // The multiplier with the largest force, among some of them.
        let mut weight = vec![0.0; 2 * m];
        for (shift, rows) in [(0, &oracle.of.normal), (m, &oracle.of.tangential)] {
            for &(i, _, v) in rows {
                weight[i + shift] += v * v;
            }
        }
        let heaviest = |which: std::ops::Range<usize>| {
            let force = |&i: &usize| step.lambda[i].abs() * weight[i].sqrt();
            let all = length(&oracle.contact_forces(&step.lambda));
            which
                .max_by(|a, b| force(a).total_cmp(&force(b)))
                .filter(|i| force(i) > 1e-2 * all.max(load.acting))
        };
        let mut count = |what: &'static str, is_told: bool| {
            if is_told {
                *told.entry(what).or_default() += 1;
            } else {
                missed.push(format!("{seed}: {what} [{}]", problem.trial.name));
            }
        };
        for (what, which, factor) in [
            ("a pressure changed", 0..m, 1.01),
            ("a pressure turned", 0..m, -1.0),
            ("friction changed", m..2 * m, 0.99),
            ("friction turned", m..2 * m, -1.0),
        ] {
            if let Some(i) = heaviest(which) {
                let mut lambda = step.lambda.clone();
                lambda[i] *= factor;
                count(what, wrong(&step.u, &lambda));
            }
        }
        // A node that is moved so far that it takes a thousandth of the forces.
        let force = length(&oracle.contact_forces(&step.lambda)).max(load.acting);
        let diagonal = oracle.of.k.iter().filter(|e| e.0 == e.1);
        let stiffest = diagonal.max_by(|a, b| a.2.total_cmp(&b.2));
        if let (Some(&(i, _, k)), true) = (stiffest, force > 0.0) {
            let mut u = step.u.clone();
            u[i] += 1e-3 * force / k;
            count("a node moved", wrong(&u, &step.lambda));
        }
    }
    println!("told {told:?}");
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(
        told.len() == 5 && told.values().all(|&n| n > 10),
        "{told:?}"
    );
}

/// The certificate: a block on a floor, with what statics says of it.
#[test]
fn the_certificate_is_statics() {
    let mut counts = [0; 2];
    for seed in 1..=200 {
        let (written, held) = edge(&mut generator(seed));
        let trial = elastic(written).unwrap_or_else(|error| panic!("{error}"));
        let oracle = Oracle::new(&trial.problem);
        assert_eq!(oracle.free.len(), 1, "{}", trial.name);
        assert_eq!(oracle.free[0].motions.len(), 3, "{}", trial.name);
        let balance = least_imbalance(&oracle, &trial.loads[0]);
        match held {
            Some(true) => assert!(
                balance.holds() == Some(true),
                "{}: {:e}",
                trial.name,
                balance.imbalance
            ),
            Some(false) => assert!(
                balance.holds() == Some(false),
                "{}: {:e}",
                trial.name,
                balance.imbalance
            ),
            None => continue,
        }
        counts[usize::from(held == Some(true))] += 1;
    }
    assert!(counts.iter().all(|&n| n > 50), "{counts:?}");
}
