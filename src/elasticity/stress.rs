//! Stress recovery.

use super::element::{CORNERS, quad_point, stiffness_points};
use super::{Body, Plane};

/// A plane stress state: σxx, σyy, σzz (perpendicular to the plane) and σxy, in Pa.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stress {
    pub xx: f64,
    pub yy: f64,
    pub zz: f64,
    pub xy: f64,
}

impl Stress {
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
        let material = body.materials[element.region as usize];
        let (lambda, mu) = material.lame(body.plane);
        let nodes = element.nodes();
        let x = body.mesh.coordinates(element);
        let stress_of = |gradient: &[[f64; 2]; 4]| {
            let mut e = [[0.0; 2]; 2];
            for (&node, g) in nodes.iter().zip(gradient) {
                let u = displacement[node as usize];
                for i in 0..2 {
                    for j in 0..2 {
                        e[i][j] += u[i] * g[j];
                    }
                }
            }
            let trace = lambda * (e[0][0] + e[1][1]);
            let (xx, yy) = (trace + 2.0 * mu * e[0][0], trace + 2.0 * mu * e[1][1]);
            Stress {
                xx,
                yy,
                zz: match body.plane {
                    Plane::PlaneStrain => material.poisson * (xx + yy),
                    Plane::PlaneStress => 0.0,
                },
                xy: mu * (e[0][1] + e[1][0]),
            }
        };
        let mut size = 0.0;
        let points: Vec<Stress> = stiffness_points(nodes.len(), &x)
            .map(|point| {
                size += point.weight;
                stress_of(&point.gradient)
            })
            .collect();
        for (corner, &node) in nodes.iter().enumerate() {
            let stress = if points.len() == 1 {
                points[0]
            } else {
                let mut sum = Stress::default();
                for (point, at) in points.iter().zip(CORNERS) {
                    // The bilinear function that is one at this Gauss point, taken at the corner.
                    let r3 = 3f64.sqrt();
                    let weight = 0.25
                        * (1.0 + r3 * at[0] * CORNERS[corner][0])
                        * (1.0 + r3 * at[1] * CORNERS[corner][1]);
                    sum.add(weight, *point);
                }
                sum
            };
            at_nodes[node as usize].add(size, stress);
            area[node as usize] += size;
        }
        in_elements.push(if points.len() == 1 {
            points[0]
        } else {
            stress_of(&quad_point([0.0, 0.0], &x).gradient)
        });
    }
    for (stress, area) in at_nodes.iter_mut().zip(area) {
        let sum = std::mem::take(stress);
        stress.add(1.0 / area, sum);
    }
    (at_nodes, in_elements)
}
