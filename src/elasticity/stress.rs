//! Stress recovery.

use super::element::{Element, Elements, Visit};
use super::{Body, Material, Plane};
use crate::mesh;

/// A plane stress state: σxx, σyy, σzz (perpendicular to the plane) and σxy, in Pa.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stress {
    /// σxx.
    pub xx: f64,
    /// σyy.
    pub yy: f64,
    /// σzz, perpendicular to the plane.
    pub zz: f64,
    /// σxy.
    pub xy: f64,
}

impl Stress {
    /// The stress under the displacement gradient ∂uᵢ/∂xⱼ.
    fn of(material: Material, plane: Plane, e: [[f64; 2]; 2]) -> Self {
        let (lambda, mu) = material.lame(plane);
        let trace = lambda * (e[0][0] + e[1][1]);
        let (xx, yy) = (trace + 2.0 * mu * e[0][0], trace + 2.0 * mu * e[1][1]);
        Self {
            xx,
            yy,
            zz: match plane {
                Plane::PlaneStrain => material.poisson * (xx + yy),
                Plane::PlaneStress => 0.0,
            },
            xy: mu * (e[0][1] + e[1][0]),
        }
    }

    /// The von Mises equivalent stress.
    pub fn von_mises(&self) -> f64 {
        let Self { xx, yy, zz, xy } = *self;
        (0.5 * ((xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2)) + 3.0 * xy * xy).sqrt()
    }

    fn add(&mut self, weight: f64, other: Stress) {
        self.xx += weight * other.xx;
        self.yy += weight * other.yy;
        self.zz += weight * other.zz;
        self.xy += weight * other.xy;
    }
}

/// Stresses at the nodes and in the middle of the elements, from the displacements of all nodes.
///
/// At a node the mean of the surrounding elements, weighted with their areas; a quadrilateral gives the
/// stress extrapolated from its 2 × 2 Gauss points, where it is most accurate. Across the border of two
/// materials the nodal mean mixes both sides: the element values do not.
pub fn stresses(body: &Body, displacement: &[[f64; 2]]) -> (Vec<Stress>, Vec<Stress>) {
    let mut at_nodes = vec![Stress::default(); body.mesh.nodes.len()];
    let mut area = vec![0.0; body.mesh.nodes.len()];
    let mut in_elements = Vec::with_capacity(body.mesh.elements.len());
    for element in &body.mesh.elements {
        in_elements.push(element.kind().with(Recovery {
            body,
            element,
            displacement,
            at_nodes: &mut at_nodes,
            area: &mut area,
        }));
    }
    for (stress, area) in at_nodes.iter_mut().zip(area) {
        let sum = std::mem::take(stress);
        stress.add(1.0 / area, sum);
    }
    (at_nodes, in_elements)
}

/// Adds an element's stresses, times its area, at its nodes; gives the one in its middle.
struct Recovery<'a> {
    body: &'a Body<'a>,
    element: &'a mesh::Element,
    displacement: &'a [[f64; 2]],
    at_nodes: &'a mut [Stress],
    area: &'a mut [f64],
}

impl Visit<2> for Recovery<'_> {
    type Output = Stress;

    fn visit<E: Element<2, N>, const N: usize>(self) -> Stress {
        let x = self.body.mesh.coordinates(self.element);
        let nodes = self.element.nodes();
        let material = self.body.materials[self.element.region as usize];
        let stress_of = |gradient: &[[f64; 2]; N]| {
            let mut e = [[0.0; 2]; 2];
            for (&node, g) in nodes.iter().zip(gradient) {
                let u = self.displacement[node as usize];
                for i in 0..2 {
                    for j in 0..2 {
                        e[i][j] += u[i] * g[j];
                    }
                }
            }
            Stress::of(material, self.body.plane, e)
        };
        let mut size = 0.0;
        let mut corners = [Stress::default(); N];
        for (number, point) in E::stiffness_points(&x).enumerate() {
            size += point.weight;
            let stress = stress_of(&point.gradient);
            for (corner, sum) in corners.iter_mut().enumerate() {
                sum.add(E::extrapolation(corner, number), stress);
            }
        }
        for (&node, stress) in nodes.iter().zip(corners) {
            self.at_nodes[node as usize].add(size, stress);
            self.area[node as usize] += size;
        }
        stress_of(&E::centre(&x).gradient)
    }
}
