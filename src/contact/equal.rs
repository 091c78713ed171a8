//! Nodes that move alike: each is tied to the first of its set, along some axes or all.
//!
//! u_i − u_1 = 0 along an axis is a row with a free multiplier, as in ties; along other axes the row is empty. The multiplier is
//! the force that moves the node with the others, and all of them act on the first node in the opposite direction.

use super::nodes::shares;
use super::{ContactPlace, SlipBound};
use crate::elasticity::Body;
use crate::mesh::{ElementKind, Topology};

/// The places of sets of nodes that move alike along the axes that are `bound`: one at each node except the first of its set,
/// between it and that one. Its area is the share that the node has of the outer facets around it, or 1 without any, so that its
/// pressure is its force.
pub fn equal_nodes<const D: usize>(
    body: &Body<D>,
    sets: &[Vec<u32>],
    bound: [bool; D],
) -> Vec<ContactPlace<D>>
where
    ElementKind: Topology<D>,
{
    let mesh = body.mesh;
    let nodes = sets.concat();
    let shares = shares(body, &mesh.outer_facets_at(&nodes, false));
    // Bound axes first: there is always one. Directions that are left out have no length, and their rows no entries.
    let mut frame = [[0.0; D]; D];
    let axes = (0..D).filter(|&axis| bound[axis]);
    for (way, axis) in frame.iter_mut().zip(axes) {
        way[axis] = 1.0;
    }
    let mut places: Vec<ContactPlace<D>> = Vec::new();
    for set in sets {
        let Some((&first, others)) = set.split_first() else {
            continue;
        };
        for &node in others {
            let area = shares[node as usize];
            places.push(ContactPlace {
                place: mesh.nodes[node as usize],
                node: Some(node),
                own: vec![(node, 1.0)],
                partners: vec![(first, 1.0)],
                directed: Vec::new(),
                further: Vec::new(),
                sectors: None,
                frame,
                gap: 0.0,
                area: if area > 0.0 { area } else { 1.0 },
                part: 0,
                pool: places.len() as u32,
                slip_bound: SlipBound::Tied,
                compliance: [0.0; 2],
            });
        }
    }
    places
}
