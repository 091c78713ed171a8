//! Supports that do not act in all load steps, or hold their nodes where they are: rows with
//! free multipliers. K is the same in all load steps.

use super::contacts::Found;
use super::driven::{Drive, measured};
use super::entities::Support;
use super::error::{EntityKind, Fault};
use super::supports::{SAME, extended};
use super::{PairData, Quantity};
use crate::contact::{ContactPlace, Space};
use crate::elasticity::Body;
use crate::mesh::ElementKind;
use std::collections::BTreeMap;

impl<const D: usize> Support<D> {
    /// Whether it acts in a load step, counted from 0.
    pub(super) fn acts(&self, step: usize) -> bool {
        self.active.as_ref().is_none_or(|steps| steps[step] != 0.0)
    }

    /// Whether it holds its nodes where they are in a load step, counted from 0.
    pub(super) fn locks(&self, step: usize) -> bool {
        self.lock.as_ref().is_some_and(|steps| steps[step] != 0.0)
    }

    /// Whether it changes from load step to load step by more than its factors.
    pub(super) fn changes(&self) -> bool {
        let any = |steps: &Option<Vec<f64>>, value| (steps.iter().flatten()).any(|v| *v == value);
        any(&self.active, 0.0) || any(&self.lock, 1.0)
    }
}

impl<const D: usize> Support<D>
where
    ElementKind: Space<D>,
{
    /// Its places: one for each direction in which it holds a node.
    pub(super) fn find(&self, body: &Body<D>) -> Result<Found<D>, Fault> {
        let zero = Quantity::from(0.0);
        // Nodes, which may be in several facets: a basis of the directions in which each is held, and these directions
        // with their prescribed displacements.
        type Ways<const D: usize> = (Vec<[f64; D]>, Vec<([f64; D], f64)>);
        let mut held: BTreeMap<u32, Ways<D>> = BTreeMap::new();
        for (node, ways) in self.nodes(body.mesh, &zero)? {
            for (way, quantity) in ways {
                let (basis, ways) = held.entry(node).or_default();
                if extended(basis, way.vector(), SAME) {
                    let value = quantity.at(body.mesh.nodes[node as usize]);
                    ways.push((way.vector(), value));
                }
            }
        }
        let (mut places, mut drives) = (Vec::new(), Vec::new());
        for (node, (_, ways)) in held {
            let x = body.mesh.nodes[node as usize];
            for (way, value) in ways {
                let mut frame = [[0.0; D]; D];
                frame[0] = way;
                let place = measured((x, places.len() as u32), node, frame, vec![(node, way)]);
                places.push(ContactPlace {
                    node: Some(node),
                    ..place
                });
                drives.push(Drive::moved(value));
            }
        }
        let data = PairData {
            tied: true,
            drives,
            ..PairData::between(
                EntityKind::Support,
                &self.name,
                self.name(),
                "the ground".to_owned(),
                String::new(),
            )
        };
        Ok((places, data))
    }
}
