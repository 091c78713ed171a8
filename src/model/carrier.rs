//! Obstacles that move: the nodes of a rigid body that is not meshed.
//!
//! A coupling of obstacles alone gets D + 1 nodes of its own, and a truss between them: a body that floats, whose rigid motions are those
//! of the point. Forces on it spread over the nodes in proportion to rigid motions (`Determined::distributing`), so that forces in
//! balance leave none on any node. The truss never deforms; its stiffness is arbitrary.

use super::Definition;
use crate::elasticity::{Bedding, Material, Plane};
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Mesh, Topology};
use std::array::from_fn;

impl<const D: usize> Definition<D>
where
    ElementKind: Topology<D>,
{
    /// Adds the nodes of couplings of obstacles alone to a mesh: the point, and places away from it along the axes by half the diagonal
    /// of the mesh.
    pub(super) fn add_carriers(&mut self, mesh: &mut Mesh<D>) {
        let (low, high) = mesh.bounding_box();
        let arm = 0.5 * length(minus(high, low));
        self.carriers = (self.couplings.iter())
            .map(|coupling| {
                if !coupling.is_bare() {
                    return Vec::new();
                }
                let first = mesh.nodes.len() as u32;
                mesh.nodes.push(coupling.point);
                let away = |axis: usize| {
                    from_fn(|c| coupling.point[c] + if c == axis { arm } else { 0.0 })
                };
                mesh.nodes.extend((0..D).map(away));
                (first..mesh.nodes.len() as u32).collect()
            })
            .collect();
    }

    /// The nodes of a coupling of obstacles alone; none of others.
    pub(super) fn carrier(&self, coupling: usize) -> &[u32] {
        self.carriers.get(coupling).map_or(&[], Vec::as_slice)
    }

    /// Puts trusses between these nodes, as stiff as a body of the size of the mesh.
    pub(super) fn put_trusses(
        &self,
        mesh: &Mesh<D>,
        materials: &[Material],
        bedding: &mut Bedding<D>,
    ) {
        let young = materials.iter().map(|material| material.young);
        let young = young.fold(0.0, f64::max) * self.thickness();
        for nodes in self.carriers.iter().filter(|nodes| !nodes.is_empty()) {
            let at = |node: u32| mesh.nodes[node as usize];
            let size = length(minus(at(nodes[1]), at(nodes[0])));
            let stiffness = match D {
                2 => young,
                _ => young * size,
            };
            for (i, &a) in nodes.iter().enumerate() {
                if D == 2 && self.plane() == Plane::Axisymmetric {
                    let radial = from_fn(|c| if c == 0 { 1.0 } else { 0.0 });
                    bedding.add_bar([a, a], radial, stiffness);
                }
                for &b in &nodes[i + 1..] {
                    let way = unit(minus(at(b), at(a)));
                    debug_assert!((dot(way, way) - 1.0).abs() < 1e-9);
                    bedding.add_bar([a, b], way, stiffness);
                }
            }
        }
    }
}
