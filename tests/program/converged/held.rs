//! Bodies that contact holds, or cannot hold: blocks on a floor, tapers, levers.

use super::cases::{
    BEAM, BEAM_CELLS, BLOCK, Case, DENSITY, FRICTIONLESS, GRAVITY, between, coulomb, end_lever,
    floor, heavy_block, lever, material, part, pressed_block, pressure, taper, traction, tresca,
};
use super::run::{CLOSE, DEFAULT, FORCE, Failures, How, PATHS, Run, length, on_both_paths, solve};

/// The error of the moment of the floor about x = `about`, from the pressures and the areas of the nodes: a cell's
/// length, half of it at the ends.
pub fn wrong_moment(run: &Run, about: f64, expected: f64) -> Option<String> {
    let cell = BEAM[0] / BEAM_CELLS[0] as f64;
    let nodes = run.nodes.first()?;
    let (mut moment, mut force) = (0.0, 0.0);
    for node in nodes {
        let end = node.x < 0.5 * cell || node.x > BEAM[0] - 0.5 * cell;
        let share = node.pressure * if end { 0.5 * cell } else { cell };
        force += share;
        moment += share * (node.x - about);
    }
    let (floor, error) = (run.force(0, 0)[1], (moment / expected - 1.0).abs());
    if !((force / floor - 1.0).abs() <= CLOSE) {
        return Some(format!(
            "pressures add up to {force:.6e} N, the floor carries {floor:.6e} N"
        ));
    }
    (!(error <= FORCE * run.tolerance)).then(|| {
        format!("moment of the floor {moment:.6e}, expected {expected:.6e}: off by {error:.1e}")
    })
}

#[test]
fn blocks_that_friction_holds() {
    let mut failures = Failures::new();
    for mu in [0.07, 0.1, 0.3, 0.8] {
        for share in [0.5, 0.8, 0.95, 0.99] {
            let friction = coulomb(mu);
            let young = if share == 0.8 { 1e9 } else { 2.1e11 };
            let heavy = heavy_block(young, share * mu * GRAVITY, &friction);
            let load = 1e5;
            let pressed = pressed_block(young, load, share * mu * load * BLOCK[0], &friction);
            for case in [heavy, pressed] {
                on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
            }
        }
    }
    // A given bound, of which the push takes a part.
    for share in [0.0, 0.5, 0.95] {
        let case = pressed_block(1e9, 1e5, share * 2e4 * BLOCK[0], &tresca(2e4));
        on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
    }
    failures.finish();
}

/// How a body may get away, and the words for it.
#[derive(Clone, Copy, PartialEq)]
pub enum Motion {
    Slides,
    /// Tips over, or turns about a pin.
    Turns,
    /// In whatever words.
    Away,
}

/// The errors of a run that has to end with a body that is not held.
pub fn wrongly_held(run: &Run, body: &str, motion: Motion) -> Vec<String> {
    let mut wrong = Vec::new();
    if run.code != Some(3) || run.status() != "not_held" {
        wrong.push(format!(
            "exit {:?}, status {}, instead of 3, not_held {}",
            run.code,
            run.status(),
            run.first_words()
        ));
    }
    let last = &run.report["steps"][run.steps().saturating_sub(1)]["status"];
    if last != "not_held" {
        wrong.push(format!("the step has the status {last}"));
    }
    let number = match run.steps() {
        0 | 1 => String::new(),
        several => format!("-{several:03}"),
    };
    for file in [
        "report.json".to_owned(),
        format!("contact{number}.csv"),
        format!("solution{number}.vtu"),
    ] {
        if !run.files.contains(&file) {
            wrong.push(format!("there is no {file}"));
        }
    }
    // The line with the body's motion and its name: that it "can rotate" if nothing holds it says little.
    let words: &[&str] = match motion {
        Motion::Slides => &["slides", "sliding", "would slide"],
        Motion::Turns => &[
            "tips",
            "tipping",
            "would tip",
            "rotates",
            "rotating",
            "would rotate",
            "turns",
            "turning",
            "tilts",
            "tilting",
            "would turn",
        ],
        Motion::Away => &[""],
    };
    let line = run
        .stdout
        .lines()
        .map(str::to_lowercase)
        // These are the resultants, with names of boundaries.
        .filter(|line| !line.trim_start().starts_with("contact "))
        .find(|line| line.contains(body) && words.iter().any(|word| line.contains(word)));
    match line {
        None => wrong.push(format!(
            "no line of the summary says of \"{body}\" how it moves: {}",
            run.stdout.lines().take(2).collect::<Vec<_>>().join(" / ")
        )),
        // A direction is a vector, an axis or a side.
        Some(line) if motion == Motion::Slides => {
            let after = &line[line.find("slid").unwrap_or(0)..];
            let named = ["(", "x", "right", "left"];
            if !named.iter().any(|word| after.contains(word)) {
                wrong.push(format!("no direction in \"{line}\""));
            }
        }
        Some(_) => {}
    }
    wrong
}

#[test]
fn bodies_that_are_not_held() {
    let mut failures = Failures::new();
    let mut cases = Vec::new();
    for mu in [0.07, 0.3, 0.8] {
        let heavy = heavy_block(2.1e11, 1.01 * mu * GRAVITY, &coulomb(mu));
        let pressed = pressed_block(1e9, 1e5, 1.01 * mu * 1e5, &coulomb(mu));
        cases.extend([
            (heavy, "block", Motion::Slides),
            (pressed, "block", Motion::Slides),
        ]);
    }
    // Five times the bound.
    let small = pressed_block(2.1e11, 1e5, 5e3, &tresca(1e3 / BLOCK[0]));
    let none = heavy_block(2.1e11, 1.0, FRICTIONLESS);
    // Pulled off the floor.
    let pulled = pressed_block(2.1e11, -1e3, 0.0, &coulomb(0.3));
    // The load points (0.45, −1) from 0.5 m above the middle of a base that ends 0.05 m from there.
    let tall = part("tower", [0.0; 2], [0.1, 1.0], [3, 20])
        + &format!("[analysis]\ngravity = [4.5, {:e}]\n", -GRAVITY)
        + &material("tower", 2.1e11, DENSITY)
        + &floor("tower-bottom", 0.0, &coulomb(0.8));
    // Of two bodies the upper one slides on the lower one, which its floor holds.
    let two = part("lower", [0.0; 2], [1.2, 0.2], [18, 3])
        + &part("upper", [0.1, 0.2], [1.0, 0.2], [13, 3])
        + &format!("[analysis]\ngravity = [1, {:e}]\n", -GRAVITY)
        + &material("lower", 2.1e11, DENSITY)
        + &material("upper", 2.1e11, DENSITY)
        + &between("upper-bottom", "lower-top", &coulomb(0.05))
        + &floor("lower-bottom", 0.0, &coulomb(0.8));
    // Pressed and held in the first step, pushed away in the second: by half of the friction limit of 3e4 N, and by a
    // tenth more than that.
    let later = pressed_block(1e9, 1e5, 0.0, &coulomb(0.3)).in_steps(&[1.0, 1.0]);
    let push = traction("block-left", 'x', 1e5) + "factors = [0.5, 1.1]\n";
    let later = Case {
        name: "pushed away in the second step".to_owned(),
        text: later.text + &push,
        ..later
    };
    cases.extend([
        (later, "block", Motion::Slides),
        (small, "block", Motion::Slides),
        (none, "block", Motion::Slides),
        (pulled, "block", Motion::Away),
        (Case::new("tall and narrow", tall), "tower", Motion::Turns),
        (
            Case::new("the upper one slides", two),
            "upper",
            Motion::Slides,
        ),
    ]);
    for (case, body, motion) in cases {
        for path in PATHS {
            let how = How {
                quiet: false,
                ..How::quiet(path, DEFAULT)
            };
            let run = solve(&case.name, &case.text, how);
            let mut wrong = wrongly_held(&run, body, motion);
            if run.steps() != case.steps {
                wrong.push(format!("{} of {} steps", run.steps(), case.steps));
            }
            for step in 1..run.steps() {
                let status = &run.report["steps"][step - 1]["status"];
                if status != "converged" {
                    wrong.push(format!("step {step}: status {status}"));
                }
            }
            failures.add(&run.name, wrong);
        }
    }
    failures.finish();
}

#[test]
fn frictionless_tapers() {
    let mut failures = Failures::new();
    for lean in [0.2, 0.03, 0.005] {
        for clearance in [0.0, 1e-5, 1e-4, 1e-3] {
            for load in [1e4, 1e5, 1e7] {
                let case = taper(2.1e11, lean, clearance, load);
                on_both_paths(&mut failures, &case, DEFAULT, |run| {
                    let mut wrong = case.wrong_forces(run);
                    wrong.extend(wrong_sum(&case, run));
                    wrong
                });
            }
        }
    }
    for (lean, clearance, load) in [
        (0.2, 1e-3, 1e4),
        (0.03, 0.0, 1e5),
        (0.005, 1e-5, 1e7),
        (0.005, 1e-3, 1e4),
    ] {
        let case = taper(2.1e11, lean, clearance, load);
        on_both_paths(&mut failures, &case, 1e-3, |run| {
            let mut wrong = case.wrong_forces(run);
            wrong.extend(wrong_sum(&case, run));
            wrong
        });
    }
    failures.finish();
}

/// The error of the vertical sum of two walls: it carries the load, however large their forces are.
pub fn wrong_sum(case: &Case, run: &Run) -> Option<String> {
    let expected: f64 = case.forces[0].iter().map(|force| force[1]).sum();
    let sum: f64 = (0..2).map(|contact| run.force(0, contact)[1]).sum();
    let error = (sum / expected - 1.0).abs();
    (!(error <= FORCE * run.tolerance))
        .then(|| format!("the walls carry {sum:.6e} N of {expected:.6e} N: off by {error:.1e}"))
}

#[test]
fn levers() {
    let mut failures = Failures::new();
    for gap in [1e-6, 1e-4, 1e-2] {
        for force in [1.0, 100.0, 1e4] {
            let case = end_lever(gap, force);
            on_both_paths(&mut failures, &case, DEFAULT, |run| {
                // The force has the arm 1 m; the pin carries the part that the floor does not.
                let mut wrong = Vec::from_iter(wrong_moment(run, 0.0, force * BEAM[0]));
                let (floor, pin) = (run.force(0, 0), run.reaction(0, 0));
                let rest = length([floor[0] + pin[0], floor[1] + pin[1] - force]);
                if !(rest <= FORCE * DEFAULT * force) {
                    wrong.push(format!("floor {floor:?} and pin {pin:?} do not carry it"));
                }
                wrong
            });
        }
    }
    // Free to turn about its middle. A pressure p x on the top has the moment p (1/3 − 1/4) about x = 1/2.
    for gap in [0.0, 1e-6, 1e-3] {
        for load in [1e2, 1e6] {
            let middle = 0.5 * BEAM[0];
            let case = lever(
                &format!("pressure {load:e} x"),
                [middle, 0.5 * BEAM[1]],
                gap,
                &pressure("beam-top", &format!("{load:e} * x")),
            );
            on_both_paths(&mut failures, &case, DEFAULT, |run| {
                Vec::from_iter(wrong_moment(run, middle, load / 12.0))
            });
        }
    }
    failures.finish();
}
