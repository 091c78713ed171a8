//! Loads: nodal forces from what acts on boundaries and in bodies.

use super::element::{Element, Elements, Visit};
use super::{Body, Field};
use crate::mesh::{self, Kind};

/// Boundaries of the plane.
impl Body<'_> {
    /// Adds ∫ t·v over the edges to the nodal forces (two per node); `traction(x, n)` gives t in Pa at
    /// the point x with outward unit normal n.
    pub fn add_traction(
        &self,
        edges: &[[u32; 2]],
        traction: impl Fn([f64; 2], [f64; 2]) -> [f64; 2],
        forces: &mut [[f64; 2]],
    ) {
        for &edge in edges {
            let (length, normal) = self.mesh.edge_normal(edge);
            for (x, shape, weight) in edge_points(edge.map(|node| self.mesh.nodes[node as usize])) {
                let t = traction(x, normal);
                for (node, shape) in edge.iter().zip(shape) {
                    for c in 0..2 {
                        forces[*node as usize][c] +=
                            self.thickness * length * weight * shape * t[c];
                    }
                }
            }
        }
    }

    /// ∫ q φᵢ ds for every node i of the edges: the nodal share of a quantity q given per area.
    pub fn integrate_on_boundary(&self, edges: &[[u32; 2]], q: Field, shares: &mut [f64]) {
        for &edge in edges {
            let (length, _) = self.mesh.edge_normal(edge);
            for (x, shape, weight) in edge_points(edge.map(|node| self.mesh.nodes[node as usize])) {
                for (node, shape) in edge.iter().zip(shape) {
                    shares[*node as usize] += self.thickness * length * weight * shape * q(x);
                }
            }
        }
    }
}

impl<const D: usize> Body<'_, D>
where
    Kind: Elements<D>,
{
    /// Adds ∫ b·v over the elements of some regions (None: all) to the nodal forces; `force(x, density)`
    /// gives the force per volume in N/m³.
    pub fn add_body_force(
        &self,
        regions: Option<&[u32]>,
        force: impl Fn([f64; D], f64) -> [f64; D],
        forces: &mut [[f64; D]],
    ) {
        for element in &self.mesh.elements {
            if regions.is_none_or(|regions| regions.contains(&element.region)) {
                let body_force = BodyForce {
                    body: self,
                    element,
                    force: &force,
                    forces: &mut *forces,
                };
                element.kind().with(body_force);
            }
        }
    }
}

/// Adds what acts in an element.
struct BodyForce<'a, const D: usize, F>
where
    Kind: Elements<D>,
{
    body: &'a Body<'a, D>,
    element: &'a mesh::Element<D>,
    force: &'a F,
    forces: &'a mut [[f64; D]],
}

impl<const D: usize, F: Fn([f64; D], f64) -> [f64; D]> Visit<D> for BodyForce<'_, D, F>
where
    Kind: Elements<D>,
{
    type Output = ();

    fn visit<E: Element<D, N>, const N: usize>(self) {
        let x: [_; N] = self.body.mesh.coordinates(self.element);
        let density = self.body.materials[self.element.region as usize].density;
        for point in E::load_points(&x) {
            let b = (self.force)(point.place(&x), density);
            for (&node, shape) in self.element.nodes().iter().zip(point.shape) {
                for c in 0..D {
                    self.forces[node as usize][c] +=
                        self.body.thickness * point.weight * shape * b[c];
                }
            }
        }
    }
}

/// Three Gauss points on an edge: place, the shape functions of its two nodes, weight (they sum to 1).
pub(crate) fn edge_points(ends: [[f64; 2]; 2]) -> [([f64; 2], [f64; 2], f64); 3] {
    const OUTER: f64 = 0.774_596_669_241_483_4; // √(3/5)
    [(-OUTER, 5.0 / 18.0), (0.0, 8.0 / 18.0), (OUTER, 5.0 / 18.0)].map(|(s, weight)| {
        let shape = [0.5 * (1.0 - s), 0.5 * (1.0 + s)];
        let place = std::array::from_fn(|c| shape[0] * ends[0][c] + shape[1] * ends[1][c]);
        (place, shape, weight)
    })
}
