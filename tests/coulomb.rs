//! Coulomb friction on random problems: the coupled Newton steps against rounds with frozen slip bounds.
//!
//! Every problem follows from its number alone: an elastic case as a user writes it (blocks on floors, between
//! walls, in a V, on inclined planes, stacked bodies with meshes that do not match; clamped, held in part, or held
//! by contact alone; one to four load steps with unloading and reversal), or matrices (networks of springs, AᵀA).
//! Each is solved by both ways to make products with A, with `coupled` on and off, and every step that says
//! `converged` is checked by [`Checker`] (`common/checker.rs`), which shares no code with the check of the solver: it
//! reads K, N, T, the load and the gap, and nothing else.
//!
//! What has not converged is judged as well, where that can be done: of small problems all sets are tried
//! ([`has_solution`]), so that `not_held` is wrong where there is a solution; and where no forces on Coulomb's cones
//! balance the bodies ([`unbalanced`]) there is none.
//!
//! Coulomb's law may have several solutions. Where both ways find one each, and both stand the check, that is
//! counted and no failure.
//!
//! `cargo test --release --test coulomb -- --ignored --nocapture` tries 1000 problems on each path. Environment:
//!
//! - `COULOMB_PROBLEMS`: how many problems instead;
//! - `COULOMB_SEED`: the number of the first one (1);
//! - `COULOMB_PATHS`: `cholesky` or `pcg`, to try one path only;
//! - `COULOMB_ONLY`: the number of a single problem, which is printed with the history of each of its solves.

mod common;

use common::Random;
use common::cases::{
    Range, Trial, chance, coefficient, decade, elastic, generator, one_body, pick, stack,
};
use common::checker::{BALANCE, CLEARLY, Checker, has_solution, largest, unbalanced};
use common::runs::{Run, TIME_LIMIT, Way, name_of, print_step};
use signorini::dual::DirectDual;
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::{self, Load, Settings, State};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::Status;
use std::collections::BTreeMap;
use std::ops::ControlFlow;

// ---------------------------------------------------------------------------------------------------------
// Random problems

/// The problem of a seed, or why it could not be built.
fn trial(seed: u64) -> Result<Trial, String> {
    let mut random = generator(seed);
    match random.below(10) {
        0..=4 => elastic(one_body(&mut random, Range::coulomb(600))),
        5..=6 => elastic(stack(&mut random, Range::coulomb(280))),
        _ => Ok(algebraic(&mut random)),
    }
}

/// Matrices without a mesh.
fn algebraic(random: &mut Random) -> Trial {
    let n = pick(random, &[4, 6, 7, 10, 16, 20, 31, 40, 60]);
    let m = 1 + random.below((n / 2).min(30));
    let stiffness = decade(random, -2.0, 8.0);
    let kind = pick(random, &["AtA", "springs", "springs"]);
    let mut entries = Vec::new();
    match kind {
        "AtA" => {
            let mut rows = Vec::new();
            for _ in 0..n {
                let row: Vec<(usize, f64)> = (0..3)
                    .map(|_| (random.below(n), random.between(-1.0, 1.0)))
                    .collect();
                rows.push(row);
            }
            let small = decade(random, -2.0, 0.0);
            for i in 0..n {
                entries.push((i, i, stiffness * small * random.between(0.2, 1.0)));
            }
            for row in rows {
                for &(i, a) in &row {
                    for &(j, b) in &row {
                        entries.push((i, j, stiffness * a * b));
                    }
                }
            }
        }
        _ => {
            // A node is a pair of unknowns; springs have a direction.
            let nodes = n / 2;
            let mut add = |row: &[(usize, f64)], k: f64| {
                for &(i, a) in row {
                    for &(j, b) in row {
                        entries.push((i, j, k * a * b));
                    }
                }
            };
            let soft = decade(random, -3.0, -0.5);
            for i in 0..n {
                let ground = if chance(random, 0.15) { 1.0 } else { soft };
                add(&[(i, 1.0)], stiffness * ground);
            }
            for i in 0..nodes {
                for _ in 0..3 {
                    let j = random.below(nodes);
                    let (s, c) = random.between(0.0, 6.3).sin_cos();
                    let k = stiffness * decade(random, -1.0, 1.0);
                    if i != j {
                        let row = [(2 * i, c), (2 * i + 1, s), (2 * j, -c), (2 * j + 1, -s)];
                        add(&row, k);
                    }
                }
            }
        }
    }
    // Each contact node has two unknowns of its own, which a rotation takes to normal and tangent; general rows
    // have a little of other unknowns besides.
    let mut order: Vec<usize> = (0..n / 2).collect();
    for i in 0..order.len() {
        let j = i + random.below(order.len() - i);
        order.swap(i, j);
    }
    let general = chance(random, 0.3);
    let (mut normal, mut tangential) = (Vec::new(), Vec::new());
    for i in 0..m {
        let (s, c) = random.between(0.0, 6.3).sin_cos();
        let (x, y) = (2 * order[i], 2 * order[i] + 1);
        normal.extend([(i, x, c), (i, y, s)]);
        tangential.extend([(i, x, -s), (i, y, c)]);
        if general {
            for rows in [&mut normal, &mut tangential] {
                let j = random.below(n);
                if j != x && j != y {
                    rows.push((i, j, random.between(-0.2, 0.2)));
                }
            }
        }
    }
    let size = decade(random, -4.0, 1.0);
    let force = stiffness * size;
    let mut load: Vec<f64> = (0..n).map(|_| force * random.between(-0.3, 0.3)).collect();
    for &(i, j, v) in &normal {
        // Most nodes are pressed on the obstacle.
        let sign = if (i * 7 + 3) % 5 == 0 { -0.3 } else { 1.0 };
        load[j] += sign * force * v * random.between(0.0, 1.0);
    }
    let gap: Vec<f64> = (0..m)
        .map(|_| {
            if chance(random, 0.5) {
                0.0
            } else {
                size * random.between(0.0, 0.5)
            }
        })
        .collect();
    let mut mu: Vec<f64> = (0..m).map(|_| coefficient(random)).collect();
    if mu.iter().all(|&mu| mu == 0.0) {
        mu[0] = 0.4;
    }
    // Given bounds where there is no coefficient.
    let bound: Vec<f64> = (mu.iter())
        .map(|&mu| match (mu > 0.0, random.below(3)) {
            (true, _) | (_, 0) => 0.0,
            _ => force * random.between(0.0, 0.5),
        })
        .collect();
    let largest = mu.iter().copied().fold(0.0, f64::max);
    let problem = ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(n, n, entries.iter().copied()),
        load,
        normal: Csr::from_triplets(m, n, normal.iter().copied()),
        tangential: Csr::from_triplets(m, n, tangential.iter().copied()),
        gap: gap.clone(),
        slip_bound: bound.clone(),
        coordinates: None,
    })
    .and_then(|problem| problem.with_friction_coefficient(mu.clone()))
    .unwrap_or_else(|error| panic!("{error}"));
    let steps = pick(random, &[1, 1, 2, 3, 4]);
    let factors: Vec<f64> = if steps == 1 {
        vec![1.0]
    } else {
        (0..steps)
            .map(|_| pick(random, &[0.3, 1.0, -0.5, 0.2, 0.7, 0.0]))
            .collect()
    };
    let whole = Load::of(&problem);
    let loads = (factors.iter())
        .map(|factor| Load {
            force: whole.force.iter().map(|f| factor * f).collect(),
            acting: factor.abs() * whole.acting,
            ..whole.clone()
        })
        .collect();
    let mut text =
        format!("n = {n}, m = {m}, factors {factors:?}\nmu = {mu:?}\ng = {bound:?}\nd = {gap:?}\n");
    text += &format!(
        "f = {:?}\nN = {normal:?}\nT = {tangential:?}\n",
        whole.force
    );
    text += &format!(
        "K = {:?}\n",
        problem.stiffness().triplets().collect::<Vec<_>>()
    );
    Trial {
        name: format!(
            "matrices ({kind}{}), n = {n}, m = {m}, mu up to {largest:.2}, {steps} steps",
            if general { ", general rows" } else { "" }
        ),
        text,
        problem,
        loads,
    }
}

// ---------------------------------------------------------------------------------------------------------
// Runs

fn run(trial: &Trial, way: Way, coupled: bool) -> Run {
    let settings = Settings {
        coupled,
        ..Settings::default()
    };
    Run::new(trial, way, settings)
}

/// What is wrong with the steps of a run that say `converged`. What is right, but close to its limit,
/// is noted in `closest`.
fn wrong_steps(
    trial: &Trial,
    checker: &Checker,
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
        let conditions = checker.conditions(load, &start, &step.u, &step.lambda);
        let wrong: Vec<_> = conditions.iter().filter(|c| !(c.2 <= 1.0)).collect();
        for &(name, _, times) in conditions.iter().filter(|c| c.2 <= 1.0) {
            let most = closest.entry(name).or_default();
            *most = most.max(times);
        }
        // The worst one says enough.
        if let Some((name, node, times)) = wrong.iter().max_by(|a, b| a.2.total_cmp(&b.2)) {
            all.push(format!(
                "step {}: {name} at contact node {node}, {times:.2e} times what is allowed ({} conditions broken)",
                number + 1,
                wrong.len()
            ));
        }
    }
    all
}

/// What a step that has not converged is worth.
enum GivenUp {
    /// It is a solution.
    Right,
    /// There is a solution.
    Missed,
    /// There is none.
    Hopeless,
    /// Nobody knows.
    Open,
}

/// Judges the last step of a run, if it has not converged.
fn judge(trial: &Trial, checker: &Checker, run: &Run) -> Option<(Status, GivenUp)> {
    let number = run.steps.len().checked_sub(1)?;
    let (status, load) = (run.steps[number].status, &trial.loads[number]);
    if status == Status::Converged {
        return None;
    }
    let start = run.start(trial, number);
    let end = &run.steps[number];
    let conditions = checker.conditions(load, &start, &end.u, &end.lambda);
    if status != Status::NotHeld && conditions.iter().all(|c| c.2 <= CLEARLY) {
        return Some((status, GivenUp::Right));
    }
    let given_up = match has_solution(checker, load, &start) {
        Some(true) => GivenUp::Missed,
        Some(false) => GivenUp::Hopeless,
        None if unbalanced(&trial.problem, checker, load) > BALANCE => GivenUp::Hopeless,
        None => GivenUp::Open,
    };
    Some((status, given_up))
}

/// What a campaign on one path has found.
#[derive(Default)]
struct Tally {
    problems: usize,
    refused: Vec<String>,
    driven: usize,
    steps: [usize; 2],
    ends: [BTreeMap<String, usize>; 2],
    seconds: [f64; 2],
    slowest: [(f64, u64); 2],
    wrong: [Vec<String>; 2],
    /// For each condition, the largest part of what is allowed in a right answer.
    closest: [BTreeMap<&'static str, f64>; 2],
    /// Steps that have not converged, by what they say: those that have a solution, all the same; and how many
    /// have none, or may have one.
    missed: [Vec<String>; 2],
    too_strict: [Vec<String>; 2],
    hopeless: [BTreeMap<&'static str, usize>; 2],
    open: [BTreeMap<&'static str, usize>; 2],
    panics: Vec<String>,
    only_rounds: Vec<String>,
    only_coupled: Vec<String>,
    disputed: Vec<String>,
    others: Vec<String>,
    both: usize,
    products: [usize; 2],
    iterations: [usize; 2],
    slower: Vec<(usize, usize, u64, usize, String)>,
    resorted: Vec<String>,
    resort_rounds: usize,
}

const WAYS: [&str; 2] = ["coupled", "rounds"];

impl Tally {
    fn add(&mut self, seed: u64, way: Way) {
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
        let checker = Checker::new(&trial.problem);
        let runs = [true, false].map(|coupled| run(&trial, way, coupled));
        let mut right = [true; 2];
        for (k, run) in runs.iter().enumerate() {
            self.steps[k] += run.steps.len();
            *self.ends[k].entry(run.end.clone()).or_default() += 1;
            self.seconds[k] += run.seconds;
            if run.seconds > self.slowest[k].0 {
                self.slowest[k] = (run.seconds, seed);
            }
            if run.end.starts_with("panic") {
                self.panics
                    .push(format!("{seed} {}: {}", WAYS[k], trial.name));
            }
            let wrong = wrong_steps(&trial, &checker, run, &mut self.closest[k]);
            right[k] = wrong.is_empty();
            for wrong in wrong {
                self.wrong[k].push(format!("{seed}: {wrong} [{}]", trial.name));
            }
            let number = run.steps.len();
            match judge(&trial, &checker, run) {
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
        let [coupled, rounds] = &runs;
        // Step by step, as far as both have come, and as long as both have the same history.
        for number in 0..trial.loads.len() {
            let [c, r] = [coupled, rounds].map(|run| run.status(number));
            let (Some(c), Some(r)) = (c, r) else {
                // Panics and errors have no status.
                let broken =
                    |run: &Run| run.end.starts_with("panic") || run.end.starts_with("error");
                if c.is_none() && r == Some(Status::Converged) && broken(coupled) {
                    let line = format!(
                        "{seed}: step {}: {} [{}]",
                        number + 1,
                        coupled.end,
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
                    "{seed}: step {} of {}: coupled {} ({} products, {} solves), rounds {} ({} products, {} solves) [{}]",
                    number + 1,
                    trial.loads.len(),
                    name_of(c),
                    coupled.steps[number].n_a(),
                    coupled.steps[number].rounds.len(),
                    name_of(r),
                    rounds.steps[number].n_a(),
                    rounds.steps[number].rounds.len(),
                    trial.name
                )
            };
            let not_held = [c, r].contains(&Status::NotHeld);
            match (c == Status::Converged, r == Status::Converged) {
                (true, true) => {
                    let [a, b] = [coupled, rounds].map(|run| &run.steps[number]);
                    let size = checker
                        .size(&a.u, &a.lambda)
                        .max(checker.size(&b.u, &b.lambda));
                    let apart: Vec<f64> = a.u.iter().zip(&b.u).map(|(a, b)| a - b).collect();
                    // Where all loads are gone, rounding of what was there is left.
                    let ago = (coupled.steps[..number].iter())
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
                // Both give up, but one says that there is no solution.
                (false, false) if not_held && c != r => self.disputed.push(line()),
                (false, false) => {}
            }
        }
        for (number, step) in coupled.steps.iter().enumerate() {
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
        if coupled.solved() && rounds.solved() {
            self.both += 1;
            let products = [coupled.products(), rounds.products()];
            for k in 0..2 {
                self.products[k] += products[k];
                self.iterations[k] += runs[k].iterations;
            }
            if products[0] > products[1] {
                let solves = coupled.steps.iter().map(|s| s.rounds.len()).sum();
                self.slower
                    .push((products[0], products[1], seed, solves, trial.name));
            }
        }
    }

    fn print(&mut self, way: Way) {
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
                "{:8} steps {}; problems: {}; {:.1} s, the slowest {:.2} s (seed {})",
                WAYS[k],
                self.steps[k],
                ends.join(", "),
                self.seconds[k],
                self.slowest[k].0,
                self.slowest[k].1
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
            "both solved {}; products: coupled {}, rounds {} (PCG iterations {}, {})",
            self.both, self.products[0], self.products[1], self.iterations[0], self.iterations[1]
        );
        println!(
            "coupled took more products in {} problems; the worst:",
            self.slower.len()
        );
        self.slower
            .sort_by_key(|&(c, r, ..)| std::cmp::Reverse(c - r));
        for (c, r, seed, solves, name) in self.slower.iter().take(10) {
            println!("    {seed}: {c} against {r}, {solves} solves [{name}]");
        }
        println!(
            "coupled steps that took rounds: {} of {}, {} more solves",
            self.resorted.len(),
            self.steps[0],
            self.resort_rounds
        );
        section("    they are", &self.resorted);
        section("another solution", &self.others);
        section("solved by rounds, not coupled", &self.only_rounds);
        section("solved coupled, not by rounds", &self.only_coupled);
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
        section("wrong, coupled", &self.wrong[0]);
        section("wrong, rounds", &self.wrong[1]);
        section("panics", &self.panics);
        section("refused", &self.refused);
    }

    /// What a campaign has to keep.
    fn failures(&self, way: Way) -> Vec<String> {
        let mut failures = Vec::new();
        let mut none = |what: &str, count: usize| {
            if count > 0 {
                failures.push(format!("{}: {count} {what}", way.name()));
            }
        };
        none("wrong answers of coupled steps", self.wrong[0].len());
        none("wrong answers of rounds", self.wrong[1].len());
        none("panics", self.panics.len());
        none("solved by rounds only", self.only_rounds.len());
        none("refused", self.refused.len());
        for k in 0..2 {
            let late = self.slowest[k].0 > 4.0 * 1.5 * TIME_LIMIT.as_secs_f64();
            none("runs without an end", usize::from(late));
        }
        if self.products[0] >= self.products[1] {
            none("products too many", 1 + self.products[0] - self.products[1]);
        }
        failures
    }
}

/// Tries so many problems on a path; what has failed.
fn campaign(way: Way, first: u64, problems: u64) -> Vec<String> {
    let mut tally = Tally::default();
    for seed in first..first + problems {
        tally.add(seed, way);
    }
    tally.print(way);
    tally.failures(way)
}

fn number(name: &str) -> Option<u64> {
    let value = std::env::var(name).ok()?;
    Some(
        value
            .parse()
            .unwrap_or_else(|_| panic!("{name} = {value} is no number")),
    )
}

/// Prints a problem, and how each solve of it goes.
fn tell(seed: u64, ways: &[Way]) {
    let trial = trial(seed).unwrap_or_else(|error| panic!("{error}"));
    let problem = &trial.problem;
    println!("{seed}: {}\n{}", trial.name, trial.text);
    println!("n = {}, m = {}", problem.n(), problem.m());
    let checker = Checker::new(problem);
    for &way in ways {
        for (k, coupled) in [true, false].into_iter().enumerate() {
            let run = run(&trial, way, coupled);
            println!(
                "---- {} {}: {} in {:.2} s",
                way.name(),
                WAYS[k],
                run.end,
                run.seconds
            );
            for (number, step) in run.steps.iter().enumerate() {
                print_step(number, step);
                let start = run.start(&trial, number);
                if step.status == Status::Converged {
                    for (name, node, times) in
                        checker.conditions(&trial.loads[number], &start, &step.u, &step.lambda)
                    {
                        if !(times <= 1.0) {
                            println!(
                                "  WRONG: {name} at contact node {node}, {times:.2e} times what is allowed"
                            );
                        }
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

/// Trying all sets finds what the solver has found.
#[test]
fn all_sets_hold_the_solution() {
    let (mut tried, mut lost) = (0, Vec::new());
    for seed in 1..=150 {
        let Ok(trial) = trial(seed) else { continue };
        let checker = Checker::new(&trial.problem);
        let run = run(&trial, Way::Cholesky, true);
        for (number, step) in run.steps.iter().enumerate() {
            let start = run.start(&trial, number);
            let load = &trial.loads[number];
            if step.status == Status::Converged && largest(&step.lambda) > 0.0 {
                match has_solution(&checker, load, &start) {
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

/// The check is worth something: the answers to a neighbouring problem (friction higher or lower by a tenth, a gap
/// wider, a step that starts elsewhere) do not pass wherever they differ by a hundredth of the deformation.
#[test]
fn the_check_tells_a_neighbouring_problem() {
    let (mut told, mut missed) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for seed in 1..=150 {
        let Ok(trial) = trial(seed) else { continue };
        let checker = Checker::new(&trial.problem);
        let right = run(&trial, Way::Cholesky, true);
        if right.steps[0].status != Status::Converged {
            continue;
        }
        let solution = &right.steps[0];
        let size = checker.size(&solution.u, &solution.lambda);
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
                .unwrap_or_else(|error| panic!("{error}"));
            let mut load = trial.loads[0].clone();
            let mut start = rest.clone();
            if what == "wider gap" {
                load.gap.iter_mut().for_each(|d| *d += 0.1 * size);
            }
            if what == "other start" {
                start.slide.iter_mut().for_each(|s| *s += 0.1 * size);
            }
            let mut dual = DirectDual::new(&problem).unwrap_or_else(|error| panic!("{error}"));
            let other = quasistatic::solve_step(
                &problem,
                &load,
                &start,
                &mut dual,
                &Settings::default(),
                &mut Default::default(),
                |_| ControlFlow::Continue(()),
            )
            .unwrap_or_else(|error| panic!("{error}"));
            let apart = solution.u.iter().zip(&other.u).map(|(a, b)| a - b);
            let apart: Vec<f64> = apart.collect();
            if other.status != Status::Converged || largest(&apart) < 1e-2 * size {
                continue;
            }
            let conditions = checker.conditions(&trial.loads[0], &rest, &other.u, &other.lambda);
            match conditions.iter().max_by(|a, b| a.2.total_cmp(&b.2)) {
                Some((name, _, times)) if *times > 1.0 => *told.entry(name).or_default() += 1,
                _ => missed.push(format!("{seed}, {what}: {}", trial.name)),
            }
        }
    }
    println!("told by {told:?}");
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(told.values().sum::<usize>() > 100, "{told:?}");
}
