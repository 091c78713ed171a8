//! As accurate as the tolerance promises: chosen cases and random ones.

use super::cases::{
    BLOCK, Case, FRICTIONLESS, GRAVITY, bracket, coulomb, end_lever, heavy_block, pressed_block,
    squeezed, stacked, strip, taper, tool, tresca,
};
use super::reference::{apart, reference};
use super::run::{Failures, How, PATHS, on_both_paths, solve};
use crate::random::Random;
use std::fmt::Write as _;

#[test]
fn as_accurate_as_the_tolerance_promises() {
    let mut failures = Failures::new();
    let cases = [
        bracket(2.1e11, 1e7, FRICTIONLESS),
        bracket(2.1e11, 1e7, &coulomb(0.3)),
        bracket(2.1e11, 1e7, &tresca(1e6)),
        bracket(1e9, 1e2, &coulomb(0.8)),
        strip(1e9, 1e6, true, &coulomb(0.3)).in_steps(&[1.0, 0.5]),
        strip(1e9, 1e6, false, FRICTIONLESS),
        heavy_block(2.1e11, 0.5 * 0.3 * GRAVITY, &coulomb(0.3)),
        pressed_block(1e9, 1e5, 0.8 * 1e4, &tresca(1e4)),
        pressed_block(1e9, 1e6, 0.0, FRICTIONLESS).in_steps(&[1.0, 1e-3]),
        taper(2.1e11, 0.03, 1e-4, 1e7),
        taper(2.1e11, 0.2, 0.0, 1e5),
        end_lever(1e-6, 1e4),
        stacked(2e5, 1e7, 200.0, true, FRICTIONLESS),
        stacked(1e9, 1.0, 1e6, false, &coulomb(0.3)),
        squeezed(1e9, 1.0, 1e-5, &coulomb(0.3)),
        tool(1e-3, 1.01e-3, &coulomb(0.3)),
    ];
    for case in cases {
        let Some(expected) = reference(&case) else {
            failures.add(&case.name, vec!["no reference".to_owned()]);
            continue;
        };
        for tolerance in [1e-3, 1e-5, 1e-8] {
            on_both_paths(&mut failures, &case, tolerance, |run| {
                let mut wrong = case.wrong_forces(run);
                wrong.extend(apart(&case, run, &expected));
                wrong
            });
        }
    }
    failures.finish();
}

/// 10 to a uniform exponent, rounded so that it is read as it is written.
fn decade(random: &mut Random, low: f64, high: f64) -> f64 {
    let value = 10f64.powf(random.between(low, high));
    format!("{value:.3e}").parse().unwrap_or(value)
}

/// A random case that is held in every step.
pub fn random_case(random: &mut Random, number: usize) -> Case {
    let young = decade(random, 6.0, 12.0);
    // Strains between 1e-8 and 1e-3.
    let strain = decade(random, -8.0, -3.0);
    let load = young * strain;
    let law = random.below(3);
    let bound = load * decade(random, -2.0, 0.0);
    let mu = decade(random, -1.3, -0.2);
    let friction = match law {
        0 => FRICTIONLESS.to_owned(),
        1 => coulomb(mu),
        _ => tresca(bound),
    };
    // Half of the free blocks are pushed, by up to 80 % of the holding force.
    let push = if random.unit() < 0.5 { 0.0 } else { 0.8 } * random.unit();
    let push = match law {
        0 => 0.0,
        1 => push * mu * load * BLOCK[0],
        _ => push * bound * BLOCK[0],
    };
    let ratio = decade(random, -4.0, 4.0);
    let lower_first = random.unit() < 0.5;
    let mut case = match number % 8 {
        0 => bracket(young, load, &friction),
        1 => strip(young, load, lower_first, &friction),
        2 | 3 => pressed_block(young, load, push, &friction),
        4 => {
            let lean = decade(random, -2.5, -0.5);
            let clearance = if lower_first {
                0.0
            } else {
                decade(random, -6.0, -3.0)
            };
            taper(young, lean, clearance, load)
        }
        5 => end_lever(decade(random, -7.0, -2.0), 2.1e11 * strain * 1e-3),
        6 => stacked(
            young,
            ratio,
            load * f64::min(ratio, 1.0),
            lower_first,
            &friction,
        ),
        _ => squeezed(young, ratio, strain * 0.3, &friction),
    };
    case.name = format!("{number}: {}", case.name);
    if law == 2 {
        case.locked = bound * BLOCK[0];
    }
    // Up and down over ten decades. Half of the cases with one step have it at full load.
    let steps = 1 + random.below(4);
    let mut factors: Vec<f64> = (0..steps).map(|_| decade(random, -10.0, 0.0)).collect();
    if random.unit() < 0.5 {
        factors[random.below(steps)] = 1.0;
    }
    case.in_steps(&factors)
}

/// Every status but `converged` is an acceptable answer here if it is honest; only a claim of convergence without
/// convergence is wrong. A held body must not be called `not_held`.
#[test]
#[ignore = "600 solves and more, of which a few may give up"]
fn random_cases() {
    let (mut random, mut right, mut no_reference) = (Random(20_260_101), 0, 0);
    let (mut honest, mut honest_text) = (0, String::new());
    let mut failures = Failures::new();
    for number in 0..200 {
        let case = random_case(&mut random, number);
        let tolerance = [1e-3, 1e-5, 1e-7][random.below(3)];
        let expected = reference(&case);
        no_reference += usize::from(expected.is_none());
        for path in PATHS {
            let run = solve(&case.name, &case.text, How::quiet(path, tolerance));
            let given_up = ["stagnated", "iteration_limit"];
            if run.code == Some(3) && given_up.contains(&run.status()) {
                honest += 1;
                writeln!(
                    honest_text,
                    "  {}: {} in step {} of {}",
                    run.name,
                    run.status(),
                    run.steps(),
                    case.steps
                )
                .expect("writing to a string cannot fail");
                continue;
            }
            let mut wrong = run.unconverged(case.steps);
            if run.status() == "converged" {
                wrong.extend(case.wrong_forces(&run));
                if let Some(expected) = &expected {
                    wrong.extend(apart(&case, &run, expected));
                }
            }
            right += usize::from(wrong.is_empty());
            failures.add(&run.name, wrong);
        }
    }
    println!(
        "{right} runs right, {honest} given up honestly, {} wrong; {no_reference} cases without a reference",
        failures.failed
    );
    println!("given up:\n{honest_text}");
    failures.finish();
}
