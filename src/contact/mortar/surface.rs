//! A boundary of a pair: its facets, the smooth parts that sharp edges cut it into, and its averaged normals.

use super::{MasterFacet, Mortar, PairOptions, SlaveFacet};
use crate::contact::ContactError;
use crate::contact::search::Search;
use crate::mesh::vector::{dot, length, unit};
use crate::mesh::{ElementKind, Facet, Groups, Mesh, Topology, facet_nodes};
use std::collections::HashMap;

pub(super) struct Surface<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    pub facets: &'a [Facet<D>],
    /// Their lengths (areas).
    pub measure: Vec<f64>,
    /// Their outward unit normals.
    pub outward: Vec<[f64; D]>,
    /// The smooth part that each belongs to.
    pub part: Vec<u32>,
    /// At each node, and in each part that it belongs to, the unit normal halfway between those of the facets.
    normals: HashMap<(u32, u32), [f64; D]>,
}

impl<'a, const D: usize> Surface<'a, D>
where
    ElementKind: Mortar<D>,
{
    /// # Errors
    /// If it turns back on itself within a smooth part.
    pub fn new(
        mesh: &Mesh<D>,
        facets: &'a [Facet<D>],
        options: &PairOptions<D>,
    ) -> Result<Self, ContactError> {
        let (measure, outward): (Vec<f64>, Vec<_>) =
            facets.iter().map(|facet| mesh.facet_normal(facet)).unzip();
        let part = smooth_parts(facets, &outward, options.edge_angle);
        let mut normals: HashMap<(u32, u32), [f64; D]> = HashMap::new();
        for ((facet, n), &part) in facets.iter().zip(&outward).zip(&part) {
            let (corners, len) = mesh.corners_of(facet);
            let weights = <ElementKind as Mortar<D>>::corner_weights(&corners[..len]);
            for (&node, weight) in facet_nodes(facet).iter().zip(weights) {
                let sum = normals.entry((node, part)).or_insert([0.0; D]);
                *sum = std::array::from_fn(|c| sum[c] + weight * n[c]);
            }
        }
        for (&(node, _), normal) in &mut normals {
            if !(length(*normal) > 1e-6) {
                let place = mesh.nodes[node as usize].into();
                return Err(ContactError::Folded { place });
            }
            *normal = options.within_planes(unit(*normal), &[node]);
        }
        Ok(Self {
            facets,
            measure,
            outward,
            part,
            normals,
        })
    }

    /// The facets that one of another boundary may meet within a distance.
    pub fn near(
        &self,
        mesh: &Mesh<D>,
        search: &Search<D>,
        slave: &SlaveFacet<D>,
        distance: f64,
    ) -> Vec<MasterFacet<D>> {
        (search.near(<ElementKind as Mortar<D>>::beam(slave, distance)))
            .filter(|&(number, _)| dot(self.outward[number], slave.normal) < super::FACING)
            .map(|(number, facet)| MasterFacet {
                number,
                nodes: std::array::from_fn(|k| facet.as_ref()[k.min(facet.as_ref().len() - 1)]),
                corners: mesh.corners_of(&facet),
                normal: self.outward[number],
                part: self.part[number],
            })
            .collect()
    }
}

impl<const D: usize> Surface<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The averaged normal of a smooth part at one of its nodes.
    pub fn normal(&self, node: u32, part: u32) -> [f64; D] {
        self.normals[&(node, part)]
    }
}

/// The part that each facet belongs to: neighbours whose normals differ by no more than the angle, in degrees, are in
/// the same one.
fn smooth_parts<const D: usize>(
    facets: &[Facet<D>],
    outward: &[[f64; D]],
    edge_angle: f64,
) -> Vec<u32>
where
    ElementKind: Topology<D>,
{
    // Rounding must not decide about meshes that have just this angle between their facets.
    let least = edge_angle.to_radians().cos() - 1e-9;
    let mut groups = Groups::new(facets.len());
    let mut at_edge: HashMap<[u32; 2], Vec<u32>> = HashMap::new();
    for (number, facet) in (0..).zip(facets) {
        let nodes = facet_nodes(facet);
        for (k, &node) in nodes.iter().enumerate() {
            // In the plane neighbours have a node in common.
            let next = if D == 2 {
                node
            } else {
                nodes[(k + 1) % nodes.len()]
            };
            let beside = at_edge.entry([node.min(next), node.max(next)]).or_default();
            for &other in &*beside {
                if dot(outward[number as usize], outward[other as usize]) >= least {
                    groups.join(other, number);
                }
            }
            beside.push(number);
        }
    }
    groups.numbers().1
}
