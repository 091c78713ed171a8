//! Runs compared with references: the same case at a finer tolerance, or in one step.

use super::cases::Case;
use super::run::{
    FORCE, How, NODAL, Node, Run, difference, largest, largest_pressure, length, solve,
};

/// Tolerances of references, the first that is reached: the comparison is a thousand times coarser.
pub const REFERENCE: [f64; 2] = [1e-11, 1e-10];

/// The same case, solved as accurately as possible; None if that fails.
pub fn reference(case: &Case) -> Option<Run> {
    REFERENCE
        .into_iter()
        .map(|tolerance| solve(&case.name, &case.text, How::quiet("cholesky", tolerance)))
        .find(|run| run.code == Some(0) && run.status() == "converged" && run.steps() == case.steps)
}

/// The errors of the nodes and the resultants of a run against its reference.
///
/// All is relative to the largest pressure or force of the step. Friction preserves the history, so the errors of a
/// step are carried on, and there the largest so far counts.
pub fn apart(case: &Case, run: &Run, reference: &Run) -> Vec<String> {
    let mut wrong = Vec::new();
    if run.nodes.len() != reference.nodes.len() {
        return vec![format!(
            "{} files of contact nodes, {} of the reference",
            run.nodes.len(),
            reference.nodes.len()
        )];
    }
    let (mut most_pressure, mut most_force) = (0.0, 0.0);
    for (step, (nodes, others)) in run.nodes.iter().zip(&reference.nodes).enumerate() {
        let contacts = 0..run.contacts(step);
        let mut scale = largest_pressure(others);
        let mut force_scale =
            largest((contacts.clone()).map(|contact| length(reference.force(step, contact))));
        if case.history {
            scale = scale.max(most_pressure);
            force_scale = force_scale.max(most_force);
            (most_pressure, most_force) = (scale, force_scale);
        }
        let off = |of: fn(&Node) -> f64| {
            largest(nodes.iter().zip(others).map(|(a, b)| of(a) - of(b))) / scale
        };
        let resultant = largest(contacts.map(|contact| {
            length(difference(
                run.force(step, contact),
                reference.force(step, contact),
            ))
        })) / force_scale;
        for (what, error, allowed) in [
            ("pressure", off(|node| node.pressure), NODAL),
            ("traction", off(|node| node.traction), NODAL),
            ("resultant", resultant, FORCE),
        ] {
            if nodes.len() != others.len() || !(error <= allowed * run.tolerance) {
                wrong.push(format!(
                    "step {}: {what} off by {error:.1e} of {:.3e}",
                    step + 1,
                    if what == "resultant" {
                        force_scale
                    } else {
                        scale
                    }
                ));
            }
        }
    }
    wrong
}

/// The largest difference of two steps in pressures and tangential tractions, relative to the largest pressure
/// of the second; NaN where they have not the same nodes.
pub fn nodes_apart(nodes: &[Node], others: &[Node]) -> f64 {
    if nodes.len() != others.len() {
        return f64::NAN;
    }
    let both = || nodes.iter().zip(others);
    let pressure = both().map(|(a, b)| a.pressure - b.pressure);
    let traction = both().map(|(a, b)| a.traction - b.traction);
    largest(pressure.chain(traction)) / largest_pressure(others)
}

pub fn wrong_by(error: f64, allowed: f64) -> Vec<String> {
    if error <= allowed {
        return Vec::new();
    }
    vec![format!(
        "pressures off by {error:.1e}, allowed {allowed:.1e}"
    )]
}
