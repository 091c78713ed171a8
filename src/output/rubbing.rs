//! How far the sides of contacts have slid on each other, and the work of friction on the way, over all load steps.

use super::{NodeStatus, OfBodies, shown_at_nodes};
use crate::mesh::{ElementKind, Topology};
use crate::quasistatic::StepSolution;
use crate::rigid::length;

/// The sliding distance and the work of friction per area at each node, up to the end of the last step.
#[derive(Debug, Default)]
pub(crate) struct Rubbing(Vec<[f64; 2]>);

impl Rubbing {
    /// Adds a step, in which a node slides as the place that it shows, if that is in contact, and gives the fields of the step the sums.
    /// Nothing where there is no friction.
    pub fn add<const D: usize>(&mut self, of: &mut OfBodies<D>, solution: &StepSolution<D>)
    where
        ElementKind: Topology<D>,
    {
        let contact = &of.contact;
        if !contact.any_friction {
            return;
        }
        self.0.resize(of.elastic.mesh.nodes.len(), [0.0; 2]);
        for (node, i) in shown_at_nodes(of.elastic, contact, None) {
            if matches!(contact.status[i], NodeStatus::Stick | NodeStatus::Slip) {
                let along = (D - 1) * i..(D - 1) * (i + 1);
                let (slip, traction) = (&solution.slip[along.clone()], &contact.traction[along]);
                let [distance, work] = &mut self.0[node as usize];
                *distance += length(slip);
                // As the slipping work of the report: the traction at the end of the step.
                *work -= slip.iter().zip(traction).map(|(s, t)| s * t).sum::<f64>();
            }
        }
        of.fields.rubbed.clone_from(&self.0);
    }
}
