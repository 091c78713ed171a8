//! How far the sides of contacts have slid on each other, and the work of friction on the way, over all load steps.

use super::{NodeStatus, OfBodies, shown_at_nodes};
use crate::mesh::{ElementKind, Topology};
use crate::model::EntityKind;
use crate::quasistatic::StepSolution;
use crate::rigid::length;

/// The sliding distance and the work of friction per area at each node, up to the end of the last step.
#[derive(Debug, Default)]
pub(crate) struct Rubbing(Option<Vec<[f64; 2]>>);

impl Rubbing {
    /// Adds a step and gives its fields the sums, unless there has been no friction so far. In each contact a node slides as the place
    /// that it shows does, if that is in contact at the end of the step.
    pub fn add<const D: usize>(&mut self, of: &mut OfBodies<D>, solution: &StepSolution<D>)
    where
        ElementKind: Topology<D>,
    {
        let contact = &of.contact;
        if !contact.any_friction && self.0.is_none() {
            return;
        }
        let none = || vec![[0.0; 2]; of.elastic.mesh.nodes.len()];
        let rubbed = self.0.get_or_insert_with(none);
        let pairs = of.elastic.pairs.iter().enumerate();
        let contacts = pairs.filter(|(_, pair)| pair.kind == EntityKind::Contact);
        let shown = contacts.flat_map(|(pair, _)| shown_at_nodes(of.elastic, contact, Some(pair)));
        for (node, i) in shown {
            if matches!(contact.status[i], NodeStatus::Stick | NodeStatus::Slip) {
                let along = (D - 1) * i..(D - 1) * (i + 1);
                let (slip, traction) = (&solution.slip[along.clone()], &contact.traction[along]);
                let [distance, work] = &mut rubbed[node as usize];
                *distance += length(slip);
                // As the slipping work of the report: the traction at the end of the step.
                *work -= slip.iter().zip(traction).map(|(s, t)| s * t).sum::<f64>();
            }
        }
        of.fields.rubbed.clone_from(&self.0);
    }
}
