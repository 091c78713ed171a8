//! Stress recovery.

use super::finite::{Deformed, Finite};
use super::{Body, Plane, Temperature, in_order};
use crate::mesh::shape::sum;
use crate::mesh::{self, ElementKind, ShapeFunctions, Topology, Visit};

/// A state of stress, in Pa; in the plane σzz is perpendicular to it, round an axis the hoop stress, and σyz and σzx are zero.
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
    /// The same stress with the body turned: the axes, one a row, turn to these directions. In the plane z stays.
    #[cfg(feature = "files")]
    pub(crate) fn turned<const D: usize>(&self, ways: &[[f64; D]; D]) -> Self {
        let to = |d: usize, c: usize| match (d < D, c < D) {
            (true, true) => ways[d][c],
            _ => f64::from(u8::from(d == c)),
        };
        let own = [
            [self.xx, self.xy, self.zx],
            [self.xy, self.yy, self.yz],
            [self.zx, self.yz, self.zz],
        ];
        let part = |a: usize, b: usize| {
            let rows = (0..3).map(|i| to(i, a) * (0..3).map(|j| own[i][j] * to(j, b)).sum::<f64>());
            rows.sum()
        };
        Self {
            xx: part(0, 0),
            yy: part(1, 1),
            zz: part(2, 2),
            xy: part(0, 1),
            yz: part(1, 2),
            zx: part(2, 0),
        }
    }

    /// Subtracts a pressure that acts along all axes; in plane stress, only in the plane.
    fn relieve(&mut self, pressure: f64, in_plane_alone: bool) {
        self.xx -= pressure;
        self.yy -= pressure;
        if !in_plane_alone {
            self.zz -= pressure;
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

/// Elements whose stresses one task finds: some 100 µs of work, and at most 20 MB of 64 tasks.
const PIECE: usize = 256;

/// Stresses at the nodes and in the middle of the elements, from the displacements of all nodes.
///
/// At a node the mean of the surrounding elements, weighted with their areas (volumes, those of rings too). Each gives
/// the stress extrapolated from the points where it is most accurate. These are the points that integrate the stiffness
/// of the element of first order, and four (three) inside a tetrahedron (triangle) of second order. Across the border
/// of two materials the nodal mean mixes both sides: the element values do not.
pub fn stresses<const D: usize>(
    body: &Body<D>,
    displacement: &[[f64; D]],
) -> (Vec<Stress>, Vec<Stress>)
where
    ElementKind: Topology<D>,
{
    stresses_at(body, displacement, None)
}

/// Like [`stresses`], for bodies that are warmer than in their stress-free state.
pub fn stresses_at<const D: usize>(
    body: &Body<D>,
    displacement: &[[f64; D]],
    temperature: Option<Temperature<D>>,
) -> (Vec<Stress>, Vec<Stress>)
where
    ElementKind: Topology<D>,
{
    recovered(body, displacement, temperature, false)
}

/// Cauchy stresses of displaced bodies, as [`stresses`] recovers those of small displacements.
pub fn cauchy_stresses<const D: usize>(of: &Deformed<D>) -> (Vec<Stress>, Vec<Stress>)
where
    ElementKind: Topology<D>,
{
    recovered(of.body, of.displacement, of.temperature, true)
}

fn recovered<const D: usize>(
    body: &Body<D>,
    displacement: &[[f64; D]],
    temperature: Option<Temperature<D>>,
    large: bool,
) -> (Vec<Stress>, Vec<Stress>)
where
    ElementKind: Topology<D>,
{
    let mut at_nodes = vec![Stress::default(); body.mesh.nodes.len()];
    let mut area = vec![0.0; body.mesh.nodes.len()];
    let mut in_elements = Vec::with_capacity(body.mesh.elements.len());
    let of_some = |elements: &[mesh::Element<D>]| {
        let mut of_nodes = Vec::new();
        let of = |element: &mesh::Element<D>| {
            element.kind().with(Recovery {
                body,
                element,
                displacement,
                temperature,
                large,
                of_nodes: &mut of_nodes,
            })
        };
        let found: Vec<(Stress, f64)> = elements.iter().map(of).collect();
        (found, of_nodes)
    };
    in_order(
        &body.mesh.elements,
        PIECE,
        of_some,
        |elements, (found, of_nodes)| {
            let mut of_nodes = of_nodes.into_iter();
            for (element, (middle, size)) in elements.iter().zip(found) {
                in_elements.push(middle);
                for (&node, stress) in element.nodes().iter().zip(of_nodes.by_ref()) {
                    at_nodes[node as usize].add(size, stress);
                    area[node as usize] += size;
                }
            }
        },
    );
    // Nodes of obstacles that move are in no element.
    let of_elements = at_nodes
        .iter_mut()
        .zip(area)
        .filter(|(_, area)| *area != 0.0);
    for (stress, area) in of_elements {
        let sum = std::mem::take(stress);
        stress.add(1.0 / area, sum);
    }
    (at_nodes, in_elements)
}

/// Appends the stresses of an element at its nodes; gives the one in its middle and its area (volume).
struct Recovery<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    body: &'a Body<'a, D>,
    element: &'a mesh::Element<D>,
    displacement: &'a [[f64; D]],
    temperature: Option<Temperature<'a, D>>,
    large: bool,
    of_nodes: &'a mut Vec<Stress>,
}

impl<const D: usize> Visit<D> for Recovery<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = (Stress, f64);

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> (Stress, f64) {
        let x: [_; N] = self.body.mesh.coordinates(self.element);
        let nodes = self.element.nodes();
        let body = self.body;
        let material = body.materials[self.element.region as usize];
        let u: [[f64; D]; N] = std::array::from_fn(|a| self.displacement[nodes[a] as usize]);
        let plane = self.body.plane;
        let points = plane.stiffness_points::<E, D, N, Q>(&x);
        let in_space = if D == 3 { Plane::PlaneStrain } else { plane };
        let moduli = material.moduli(in_space, 1.0);
        let dilatation = moduli.dilatation::<E, D, N, Q>(self.element.kind(), &points, &x, plane);
        let small = || moduli.modes::<E, D, N, Q>(self.element.kind(), &points, &x, plane);
        let modes = (!self.large).then(small).flatten();
        let relief = |place| {
            let warmth = (self.temperature).map(|at| at(self.element.region, place));
            warmth.map_or(0.0, |warmth| material.thermal_pressure(in_space) * warmth)
        };
        let modes = modes.map(|modes| {
            let mut driving = [[0.0; D]; D];
            for (point, (xi, _)) in points.iter().zip(E::stiffness_rule()) {
                let size = relief(point.place(&x)) * point.weight;
                let gradients = modes.gradients.at::<E, N, Q>(xi, &x);
                let all = driving.as_flattened_mut().iter_mut();
                all.zip(gradients.as_flattened())
                    .for_each(|(f, gradient)| *f += size * gradient);
            }
            let driven = modes.eliminated.driven(&driving);
            let amplitudes = modes.eliminated.amplitudes(&driven, &u);
            (modes, amplitudes)
        });
        let finite = self.large.then(|| {
            let of = Deformed::new(body, self.displacement, self.temperature);
            Finite::of::<E, Q>(&of, self.element)
        });
        let stress_at = |xi: [f64; D]| {
            if let Some(finite) = &finite {
                return finite.cauchy_at::<E, Q>(xi);
            }
            let point = E::at(xi, 1.0, &x);
            let place = point.place(&x);
            let hoop = plane.hoop(place) * sum(&point.shape, &u)[0];
            let mut e = [[0.0; D]; D];
            for (u, g) in u.iter().zip(&point.gradient) {
                for i in 0..D {
                    for j in 0..D {
                        e[i][j] += u[i] * g[j];
                    }
                }
            }
            if let Some((modes, amplitudes)) = &modes {
                let gradients = modes.gradients.at::<E, N, Q>(xi, &x);
                for (along, g) in amplitudes.iter().zip(gradients) {
                    for i in 0..D {
                        for j in 0..D {
                            e[i][j] += along[i] * g[j];
                        }
                    }
                }
            }
            let mut stress = match &dilatation {
                None => moduli.law.response(&e, hoop).0,
                Some(dilatation) => {
                    let (law, bulk) = moduli.law.without_dilatation();
                    let (mut stress, _) = law.response(&e, hoop);
                    stress.relieve(-bulk * dilatation.at(place, &u), false);
                    stress
                }
            };
            if self.temperature.is_some() {
                stress.relieve(relief(place), in_space == Plane::PlaneStress);
            }
            stress
        };
        let size: f64 = points.iter().map(|point| point.weight).sum();
        let mut of_nodes = [Stress::default(); N];
        for (number, xi) in E::stress_points().enumerate() {
            let stress = stress_at(xi);
            for (sum, at) in of_nodes.iter_mut().zip(E::NODES) {
                sum.add(E::extrapolation(at, number), stress);
            }
        }
        let middle = stress_at(E::CENTRE);
        self.of_nodes.extend(of_nodes);
        (middle, size)
    }
}
