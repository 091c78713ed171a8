//! Stress recovery.

use super::element::{Elements, Visit};
use super::shape::ShapeFunctions;
use super::{Body, Material, Plane};
use crate::mesh::{self, ElementKind};

/// A state of stress, in Pa; in the plane σzz is perpendicular to it, and σyz and σzx are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stress {
    /// σxx.
    pub xx: f64,
    /// σyy.
    pub yy: f64,
    /// σzz.
    pub zz: f64,
    /// σxy.
    pub xy: f64,
    /// σyz.
    pub yz: f64,
    /// σzx.
    pub zx: f64,
}

impl Stress {
    /// The stress under the displacement gradient ∂uᵢ/∂xⱼ; `plane` is for the plane.
    fn of<const D: usize>(material: Material, plane: Plane, e: [[f64; D]; D]) -> Self {
        let space = D == 3;
        let (lambda, mu) = material.lame(if space { Plane::PlaneStrain } else { plane });
        let trace = lambda * (0..D).map(|c| e[c][c]).sum::<f64>();
        let normal = |c: usize| trace + 2.0 * mu * e[c][c];
        let shear = |i: usize, j: usize| mu * (e[i][j] + e[j][i]);
        let (xx, yy) = (normal(0), normal(1));
        Self {
            xx,
            yy,
            zz: match plane {
                _ if space => normal(D - 1),
                Plane::PlaneStrain => material.poisson * (xx + yy),
                Plane::PlaneStress => 0.0,
            },
            xy: shear(0, 1),
            yz: if space { shear(1, D - 1) } else { 0.0 },
            zx: if space { shear(D - 1, 0) } else { 0.0 },
        }
    }

    /// The von Mises equivalent stress.
    pub fn von_mises(&self) -> f64 {
        let Self {
            xx,
            yy,
            zz,
            xy,
            yz,
            zx,
        } = *self;
        let deviatoric = 0.5 * ((xx - yy).powi(2) + (yy - zz).powi(2) + (zz - xx).powi(2));
        (deviatoric + 3.0 * xy * xy + 3.0 * yz * yz + 3.0 * zx * zx).sqrt()
    }

    fn add(&mut self, weight: f64, other: Stress) {
        self.xx += weight * other.xx;
        self.yy += weight * other.yy;
        self.zz += weight * other.zz;
        self.xy += weight * other.xy;
        self.yz += weight * other.yz;
        self.zx += weight * other.zx;
    }
}

/// Stresses at the nodes and in the middle of the elements, from the displacements of all nodes.
///
/// At a node the mean of the surrounding elements, weighted with their areas (volumes); a quadrilateral, a hexahedron
/// or a wedge gives the stress extrapolated from its Gauss points, where it is most accurate. Across the border of two
/// materials the nodal mean mixes both sides: the element values do not.
pub fn stresses<const D: usize>(
    body: &Body<D>,
    displacement: &[[f64; D]],
) -> (Vec<Stress>, Vec<Stress>)
where
    ElementKind: Elements<D>,
{
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

/// Adds an element's stresses, times its area (volume), at its nodes; gives the one in its middle.
struct Recovery<'a, const D: usize>
where
    ElementKind: Elements<D>,
{
    body: &'a Body<'a, D>,
    element: &'a mesh::Element<D>,
    displacement: &'a [[f64; D]],
    at_nodes: &'a mut [Stress],
    area: &'a mut [f64],
}

impl<const D: usize> Visit<D> for Recovery<'_, D>
where
    ElementKind: Elements<D>,
{
    type Output = Stress;

    fn visit<E: ShapeFunctions<D, N>, const N: usize>(self) -> Stress {
        let x: [_; N] = self.body.mesh.coordinates(self.element);
        let nodes = self.element.nodes();
        let material = self.body.materials[self.element.region as usize];
        let stress_of = |gradient: &[[f64; D]; N]| {
            let mut e = [[0.0; D]; D];
            for (&node, g) in nodes.iter().zip(gradient) {
                let u = self.displacement[node as usize];
                for i in 0..D {
                    for j in 0..D {
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
