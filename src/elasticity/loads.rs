//! Loads: nodal forces of loads on boundaries and in bodies.

use super::{Body, Field, Temperature};
use crate::mesh::{
    self, ElementKind, Facet, FacetPoint, ShapeFunctions, Topology, Visit, facet_nodes,
};

impl<const D: usize> Body<'_, D>
where
    ElementKind: Topology<D>,
{
    /// Adds ∫ t·v over the facets to the nodal forces (D per node); `traction(x, n)` gives t in Pa at
    /// the point x with outward unit normal n.
    pub fn add_traction(
        &self,
        facets: &[Facet<D>],
        traction: impl Fn([f64; D], [f64; D]) -> [f64; D],
        forces: &mut [[f64; D]],
    ) {
        self.on_boundary(facets, |nodes, point, weight| {
            let t = traction(point.place, point.normal);
            for (&node, shape) in nodes.iter().zip(point.shape) {
                for (force, t) in forces[node as usize].iter_mut().zip(t) {
                    *force += weight * shape * t;
                }
            }
        });
    }

    /// ∫ q φᵢ ds for every node i of the facets: the nodal share of a quantity q given per area.
    pub fn integrate_on_boundary(&self, facets: &[Facet<D>], q: Field<D>, shares: &mut [f64]) {
        self.on_boundary(facets, |nodes, point, weight| {
            let weight = weight * q(point.place);
            for (&node, shape) in nodes.iter().zip(point.shape) {
                shares[node as usize] += weight * shape;
            }
        });
    }

    /// Passes the integration points of facets with the nodes of each, and the weight, which includes the depth of the body.
    pub(crate) fn on_boundary(
        &self,
        facets: &[Facet<D>],
        mut take: impl FnMut(&[u32], &FacetPoint<D>, f64),
    ) {
        let depths = self.depths();
        for facet in facets {
            let (x, len) = self.mesh.places_of(facet);
            let nodes = facet_nodes(facet);
            let depth = depths.of(nodes);
            <ElementKind as Topology<D>>::facet_points(&x[..len], |point| {
                take(nodes, point, depth.at(point.place) * point.weight);
            });
        }
    }
}

impl<const D: usize> Body<'_, D>
where
    ElementKind: Topology<D>,
{
    /// Adds ∫ b·v over the elements of some regions (None: all) to the nodal forces; `force(x, density)`
    /// gives the force per volume in N/m³.
    pub fn add_body_force(
        &self,
        regions: Option<&[u32]>,
        force: impl Fn([f64; D], f64) -> [f64; D],
        forces: &mut [[f64; D]],
    ) {
        self.within(regions, |element, place, shape, weight| {
            let b = force(place, self.materials[element.region as usize].density);
            for (&node, shape) in element.nodes().iter().zip(shape) {
                (0..D).for_each(|c| forces[node as usize][c] += weight * shape * b[c]);
            }
        });
    }

    /// The same where nodes have moved by u and the force depends on where the body is; it is per volume at rest. Adds the
    /// symmetric part of its change with the displacement to one block for each node, as if the volume around a node moved as
    /// the node does. Changes are differences over the length `step`.
    pub(crate) fn add_moved_force(
        &self,
        regions: Option<&[u32]>,
        (u, step): (&[[f64; D]], f64),
        force: impl Fn([f64; D], f64) -> [f64; D],
        forces: &mut [[f64; D]],
        changes: &mut [[[f64; D]; D]],
    ) {
        self.within(regions, |element, place, shape, weight| {
            let density = self.materials[element.region as usize].density;
            let mut x = place;
            for (&node, shape) in element.nodes().iter().zip(shape) {
                (0..D).for_each(|c| x[c] += shape * u[node as usize][c]);
            }
            let b = force(x, density);
            let mut change = [[0.0; D]; D];
            for k in 0..D {
                let [ahead, back] = [0.5, -0.5].map(|part| {
                    let mut y = x;
                    y[k] += part * step;
                    force(y, density)
                });
                for c in 0..D {
                    let half = 0.5 * (ahead[c] - back[c]) / step;
                    change[c][k] += half;
                    change[k][c] += half;
                }
            }
            for (&node, shape) in element.nodes().iter().zip(shape) {
                for c in 0..D {
                    forces[node as usize][c] += weight * shape * b[c];
                    (0..D).for_each(|k| {
                        changes[node as usize][c][k] += weight * shape * change[c][k]
                    });
                }
            }
        });
    }

    /// Passes the integration points of the elements of some regions (None: all), each with its place, shape functions and
    /// weight, which includes the depth of the body.
    fn within(
        &self,
        regions: Option<&[u32]>,
        mut take: impl FnMut(&mesh::Element<D>, [f64; D], &[f64], f64),
    ) {
        for element in &self.mesh.elements {
            if regions.is_none_or(|regions| regions.contains(&element.region)) {
                element.kind().with(Points {
                    body: self,
                    element,
                    take: &mut take,
                });
            }
        }
    }
}

impl<const D: usize> Body<'_, D>
where
    ElementKind: Topology<D>,
{
    /// Adds the nodal forces that expand the body as it would without being held, ∫ β θ div v with the pressure β of
    /// [`Material::thermal_pressure`] per degree.
    pub(crate) fn add_expansion(&self, temperature: Temperature<D>, forces: &mut [[f64; D]]) {
        for element in &self.mesh.elements {
            if self.materials[element.region as usize].expansion != 0.0 {
                element.kind().with(Expansion {
                    body: self,
                    element,
                    temperature,
                    forces: &mut *forces,
                });
            }
        }
    }
}

/// Adds the forces of thermal expansion in an element.
struct Expansion<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    body: &'a Body<'a, D>,
    element: &'a mesh::Element<D>,
    temperature: Temperature<'a, D>,
    forces: &'a mut [[f64; D]],
}

impl<const D: usize> Visit<D> for Expansion<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = ();

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) {
        let x: [_; N] = self.body.mesh.coordinates(self.element);
        let material = self.body.materials[self.element.region as usize];
        // The points of the stiffness, so that uniform expansion leaves no stress.
        let plane = self.body.plane;
        let points = plane.stiffness_points::<E, D, N, Q>(&x);
        let moduli = material.moduli(plane, 1.0);
        let modes = moduli.modes::<E, D, N, Q>(self.element.kind(), &points, &x, plane);
        let dilatation = moduli.dilatation::<E, D, N, Q>(self.element.kind(), &points, &x, plane);
        let pressure =
            material.thermal_pressure(plane) * self.body.thickness_of(self.element.region);
        let mut driving = [[0.0; D]; D];
        for (point, (xi, _)) in points.iter().zip(E::stiffness_rule()) {
            let place = point.place(&x);
            let warmth = (self.temperature)(self.element.region, place);
            let size = pressure * warmth * point.weight;
            if let Some(modes) = &modes {
                let gradients = modes.gradients.at::<E, N, Q>(xi, &x);
                let all = driving.as_flattened_mut().iter_mut();
                all.zip(gradients.as_flattened())
                    .for_each(|(f, gradient)| *f += size * gradient);
            }
            let hoop = plane.hoop(place);
            for (a, &node) in self.element.nodes().iter().enumerate() {
                let gradient = match &dilatation {
                    Some(dilatation) => dilatation.gradient(place, a),
                    None => point.divergence(a, hoop),
                };
                let force = &mut self.forces[node as usize];
                (0..D).for_each(|c| force[c] += size * gradient[c]);
            }
        }
        if let Some(modes) = &modes {
            let driven = modes.eliminated.driven(&driving);
            for (a, &node) in self.element.nodes().iter().enumerate() {
                let part = modes.eliminated.handed_on(&driven, a);
                (0..D).for_each(|c| self.forces[node as usize][c] += part[c]);
            }
        }
    }
}

/// Passes the integration points of an element.
struct Points<'a, F, const D: usize>
where
    ElementKind: Topology<D>,
{
    body: &'a Body<'a, D>,
    element: &'a mesh::Element<D>,
    take: &'a mut F,
}

impl<F: FnMut(&mesh::Element<D>, [f64; D], &[f64], f64), const D: usize> Visit<D>
    for Points<'_, F, D>
where
    ElementKind: Topology<D>,
{
    type Output = ();

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) {
        let x: [_; N] = self.body.mesh.coordinates(self.element);
        for point in E::load_points(&x) {
            let place = point.place(&x);
            let depth = self.body.depth_of(self.element.region).at(place);
            (self.take)(self.element, place, &point.shape, depth * point.weight);
        }
    }
}
