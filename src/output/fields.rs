//! The fields of a step: displacements and stresses of the bodies, what happens at the contact nodes.

use super::put;
use crate::case::Build;
use crate::elasticity::{Stress, stresses};
use crate::model::{Elastic, StepData};
use crate::quasistatic::StepSolution;
use crate::ssnm::Sets;

/// Displacements and stresses at the end of a step, in the units of the case.
pub struct StepFields {
    /// Of every node.
    pub displacement: Vec<[f64; 2]>,
    /// Stresses at the nodes.
    pub at_nodes: Vec<Stress>,
    /// Stresses in the middle of the elements.
    pub in_elements: Vec<Stress>,
}

impl StepFields {
    /// From a solution.
    pub fn new(elastic: &Elastic, data: &StepData, solution: &StepSolution) -> Self {
        let displacement = data.unknowns.displacements(&solution.u);
        let (at_nodes, in_elements) = stresses(&elastic.body(), &displacement);
        Self {
            displacement,
            at_nodes,
            in_elements,
        }
    }
}

/// What a contact node does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeStatus {
    /// It touches nothing.
    Separated,
    /// It is in contact, and no law of friction acts on it.
    Frictionless,
    /// It is in contact, its traction below the slip bound.
    Stick,
    /// It is in contact, its traction at the slip bound.
    Slip,
}

impl NodeStatus {
    /// The word for it in contact.csv and in pictures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Separated => "separated",
            Self::Frictionless => "contact",
            Self::Stick => "stick",
            Self::Slip => "slip",
        }
    }
}

/// What happens at the m contact nodes, in the units of the case. Tangential fields have one component per node in
/// the plane; those of several tangents of a node stand side by side.
pub struct ContactFields {
    /// Gap after loading, d − Nu, length m.
    pub gap: Vec<f64>,
    /// Contact pressure λν / area, ≥ 0, length m.
    pub pressure: Vec<f64>,
    /// Traction on the body along the tangent (ν turned counter-clockwise): −λτ / area.
    pub traction: Vec<f64>,
    /// The slip bound g / area that the traction obeys, length m.
    pub bound: Vec<f64>,
    /// Displacement along the tangent relative to the other side, Tu.
    pub slip: Vec<f64>,
    /// Whether a law of friction acts on the node.
    has_friction: Vec<bool>,
    sets: Sets,
}

impl ContactFields {
    /// At the end of a step.
    pub fn new(build: &Build, elastic: &Elastic, data: &StepData, solution: &StepSolution) -> Self {
        let m = build.problem.m();
        let (normal, tangential) = solution.lambda.split_at(m);
        let (mut gap, mut slip) = (vec![0.0; m], vec![0.0; tangential.len()]);
        build.problem.normal().mul(&solution.u, &mut gap);
        build.problem.tangential().mul(&solution.u, &mut slip);
        for (gap, before) in gap.iter_mut().zip(&data.load.gap) {
            *gap = before - *gap;
        }
        for (slip, of_supports) in slip.iter_mut().zip(&data.load.slide) {
            *slip += of_supports;
        }
        let areas: Vec<f64> = elastic.contact.nodes.iter().map(|node| node.area).collect();
        Self {
            gap,
            pressure: per_area(normal, &areas, 1.0),
            traction: per_area(tangential, &areas, -1.0),
            bound: per_area(&solution.slip_bound, &areas, 1.0),
            slip,
            has_friction: (0..m).map(|i| build.problem.has_friction(i)).collect(),
            sets: solution.sets.clone(),
        }
    }

    /// The state of contact node i.
    pub fn status(&self, i: usize) -> NodeStatus {
        if self.sets.is_separated(i) {
            NodeStatus::Separated
        } else if !self.has_friction[i] {
            NodeStatus::Frictionless
        } else if !self.sets.slips(i) && self.bound[i] > 0.0 {
            NodeStatus::Stick
        } else {
            NodeStatus::Slip
        }
    }

    /// Whether a law of friction acts on any node.
    #[cfg(feature = "plots")]
    pub(super) fn any_friction(&self) -> bool {
        self.has_friction.contains(&true)
    }

    /// `contact.csv`, in the order of the contacts, of the nodes along x, then y.
    pub(super) fn csv(&self, elastic: &Elastic) -> String {
        let place = |i: usize| elastic.mesh.nodes[elastic.contact.nodes[i].node as usize];
        let mut order: Vec<usize> = (0..self.gap.len()).collect();
        order.sort_by(|&a, &b| {
            let (p, q) = (place(a), place(b));
            let pairs = elastic.pair_of[a].cmp(&elastic.pair_of[b]);
            pairs
                .then(p[0].total_cmp(&q[0]))
                .then(p[1].total_cmp(&q[1]))
        });
        let (length, stress) = if elastic.units_stated {
            let (length, stress) = (&elastic.units.length, elastic.units.stress());
            (format!(" [{length}]"), format!(" [{stress}]"))
        } else {
            Default::default()
        };
        let mut text = format!(
            "x{length},y{length},gap{length},normal_pressure{stress},tangential_traction{stress},slip{length},\
             status,contact\n"
        );
        for i in order {
            let [x, y] = place(i);
            put(
                &mut text,
                format_args!(
                    "{x:e},{y:e},{:e},{:e},{:e},{:e},{},{}",
                    self.gap[i],
                    self.pressure[i],
                    self.traction[i],
                    self.slip[i],
                    self.status(i).name(),
                    csv_text(&elastic.pairs[elastic.pair_of[i] as usize].boundary)
                ),
            );
        }
        text
    }
}

/// Forces as stresses; there are as many for each node as go to each area.
fn per_area(forces: &[f64], areas: &[f64], sign: f64) -> Vec<f64> {
    let each = forces.len() / areas.len().max(1);
    let areas = areas.iter().flat_map(|&a| std::iter::repeat_n(a, each));
    // + 0.0 turns −0 into 0.
    (forces.iter().zip(areas))
        .map(|(f, a)| sign * f / a + 0.0)
        .collect()
}

/// A text as a field of a CSV file (RFC 4180).
fn csv_text(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_fields_are_quoted_where_they_must_be() {
        assert_eq!(csv_text("bottom"), "bottom");
        assert_eq!(csv_text("left, right"), "\"left, right\"");
        assert_eq!(csv_text("the \"foot\""), "\"the \"\"foot\"\"\"");
        assert_eq!(csv_text("two\nlines"), "\"two\nlines\"");
    }

    #[test]
    fn forces_per_area_keep_the_tangents_of_a_node_together() {
        let plane = per_area(&[2.0, 0.0, 6.0], &[1.0, 2.0, 4.0], -1.0);
        assert_eq!(plane, [-2.0, 0.0, -1.5]);
        assert!(plane[1].is_sign_positive());
        let space = per_area(&[2.0, 4.0, 6.0, 8.0], &[2.0, 4.0], 1.0);
        assert_eq!(space, [1.0, 2.0, 1.5, 2.0]);
        assert!(per_area(&[], &[], 1.0).is_empty());
    }
}
