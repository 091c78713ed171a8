//! Load steps: each carries its own load, whatever came before it.

use super::cases::{FRICTIONLESS, coulomb, pressed_block, strip, tool, tool_on_block, tresca};
use super::reference::{nodes_apart, reference, wrong_by};
use super::run::{CLOSE, DEFAULT, Failures, How, NODAL, PATHS, on_both_paths, solve};

#[test]
fn every_step_carries_its_own_load() {
    let mut failures = Failures::new();
    // The bound is that of a hundredth of a percent of the pressure: it holds the remaining slip in small steps.
    for friction in [FRICTIONLESS, &coulomb(0.3), &tresca(100.0)] {
        for factors in [
            &[1.0, 1e-4][..],
            &[1.0, 1e-6],
            &[1.0, 0.5, 1e-3, 1.0],
            &[1e-4, 1.0],
        ] {
            let case = pressed_block(1e9, 1e6, 0.0, friction).in_steps(factors);
            on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
        }
    }
    // Pushed as well: half of the friction limit.
    for factors in [&[1.0, 1e-4][..], &[1e-4, 1.0, 0.3]] {
        let case = pressed_block(1e9, 1e6, 1.5e5, &coulomb(0.3)).in_steps(factors);
        on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
    }
    failures.finish();
}

#[test]
fn a_small_step_after_a_large_one() {
    let mut failures = Failures::new();
    let (load, factor) = (1e6, 1e-4);
    for sides in [true, false] {
        let case = strip(1e9, load, sides, FRICTIONLESS).in_steps(&[1.0, factor]);
        let alone = strip(1e9, load * factor, sides, FRICTIONLESS);
        let Some(expected) = reference(&alone) else {
            failures.add(&alone.name, vec!["no reference".to_owned()]);
            continue;
        };
        for tolerance in [1e-3, 1e-6, 1e-8] {
            on_both_paths(&mut failures, &case, tolerance, |run| {
                let (Some(nodes), Some(others)) = (run.nodes.get(1), expected.nodes.first()) else {
                    return vec!["no contact nodes of the second step".to_owned()];
                };
                let error = nodes_apart(nodes, others);
                wrong_by(error, NODAL * tolerance)
            });
        }
    }
    failures.finish();
}

#[test]
fn approach_and_press() {
    let mut failures = Failures::new();
    let gap = 1e-3;
    for friction in [FRICTIONLESS, &coulomb(0.3), &tresca(1e4)] {
        for make in [tool, tool_on_block] {
            // The last factor presses by 1e-5, the one before it only just touches.
            let alone = make(gap, 1.01 * gap, friction);
            let Some(single) = reference(&alone) else {
                failures.add(&alone.name, vec!["no reference".to_owned()]);
                continue;
            };
            for factors in [&[1.0, 1.01][..], &[0.5, 1.0, 1.01]] {
                let case = make(gap, gap, friction).in_steps(factors);
                on_both_paths(&mut failures, &case, DEFAULT, |run| {
                    let (Some(nodes), Some(others)) = (run.nodes.last(), single.nodes.first())
                    else {
                        return vec!["no contact nodes".to_owned()];
                    };
                    wrong_by(nodes_apart(nodes, others), CLOSE)
                });
            }
        }
    }
    failures.finish();
}

#[test]
fn an_indentation_after_a_long_way() {
    let mut failures = Failures::new();
    let (way, depth) = (1.0, 1e-5);
    for friction in [FRICTIONLESS, &coulomb(0.3)] {
        for make in [tool, tool_on_block] {
            let near = make(0.0, depth, friction);
            let far = make(way, way + depth, friction);
            for path in PATHS {
                let at_once = solve(&near.name, &near.text, How::quiet(path, DEFAULT));
                let wrong = at_once.unconverged(1);
                let usable = wrong.is_empty();
                failures.add(&at_once.name, wrong);
                let run = solve(&far.name, &far.text, How::quiet(path, DEFAULT));
                let mut wrong = run.unconverged(1);
                if wrong.is_empty() && usable {
                    wrong.extend(run.wrong_force(0, 0, at_once.force(0, 0), 0.0));
                }
                failures.add(&run.name, wrong);
            }
        }
    }
    failures.finish();
}
