//! Several bodies, of materials that differ by many decades.

use super::cases::{FRICTIONLESS, coulomb, squeezed, stacked, tower_of_three, tresca};
use super::run::{DEFAULT, FORCE, Failures, Run, length, on_both_paths};

/// The error of the forces on a body between two contacts and without a load: they cancel out.
pub fn wrong_balance(run: &Run) -> Option<String> {
    let (below, above) = (run.force(0, 0), run.force(0, 1));
    let rest = length([below[0] + above[0], below[1] + above[1]]);
    let error = rest / length(below);
    (!(below[1] > 0.0) || !(error <= FORCE * run.tolerance)).then(|| {
        format!(
            "the forces ({:.6e}, {:.6e}) and ({:.6e}, {:.6e}) do not cancel out",
            below[0], below[1], above[0], above[1]
        )
    })
}

#[test]
fn floating_bodies_on_others() {
    let mut failures = Failures::new();
    // Stiff on soft, either side first, with pressures of a thousandth of the soft modulus.
    for ratio in [1e7, 1.0, 1e-3] {
        for lower_first in [true, false] {
            for friction in [FRICTIONLESS, &coulomb(0.3)] {
                let case = stacked(
                    2e5,
                    ratio,
                    200.0 * f64::min(ratio, 1.0),
                    lower_first,
                    friction,
                );
                on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
            }
        }
    }
    // Nothing is pushed or pulled sideways, and without friction the middle block may be anywhere.
    for friction in [FRICTIONLESS, &coulomb(0.3), &tresca(1e3)] {
        for ratio in [1.0, 1e4] {
            let case = squeezed(1e9, ratio, 1e-5, friction);
            on_both_paths(&mut failures, &case, DEFAULT, |run| {
                Vec::from_iter(wrong_balance(run))
            });
        }
    }
    for young in [2.1e11, 1e9] {
        let case = tower_of_three(young);
        on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
    }
    failures.finish();
}
