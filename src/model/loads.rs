//! Prescribed displacements and forces of each load step.

use super::entities::{AXES, Place, Support};
use super::error::{Entity, Fault, Kind, ModelError};
use super::{Definition, Elastic, Quantity};
use crate::contact::Space;
use crate::elasticity::{Body, Unknowns, load_vector};
use crate::mesh::vector::{length, minus};
use crate::mesh::{
    BoundaryError, Facet, Kind as ElementKind, Mesh, Place as At, Topology, facet_nodes,
};
use crate::quasistatic::Load;
use crate::sparse::norm;
use std::collections::HashSet;

/// What a load step puts on the bodies.
#[derive(Clone, Debug)]
pub struct StepData<const D: usize = 2> {
    /// The common load factor.
    pub factor: f64,
    /// The numbering, with the prescribed displacements of the step.
    pub unknowns: Unknowns<D>,
    /// Nodal forces of the step, D per node of the mesh.
    pub forces: Vec<[f64; D]>,
    /// The resultant of all loads, in N.
    pub total_load: [f64; D],
    /// The same for the solver.
    pub load: Load,
}

/// A displacement component of a node that a support prescribes.
#[derive(Clone, Debug)]
pub(super) struct Prescription {
    node: u32,
    component: usize,
    /// The number of the support.
    support: usize,
    /// Under the load factor 1.
    value: f64,
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// The load at the end of a step, counted from 0.
    ///
    /// # Errors
    /// If there is no such step, or a load or a displacement is not finite, or two supports differ about one.
    pub fn step(&self, step: usize) -> Result<StepData<D>, ModelError> {
        let definition = &self.definition;
        let n_steps = definition.n_steps();
        if step >= n_steps {
            return Err(Entity::all(Kind::Steps).error(format!(
                "there is no step {step} (they count from 0, and there are {n_steps})"
            )));
        }
        let body = self.body();
        let unknowns =
            Unknowns::new(definition.prescribed(&self.mesh, &self.prescriptions, step)?);
        let forces = definition.forces(&body, step)?;
        let mut total_load = [0.0; D];
        for force in &forces {
            for (sum, force) in total_load.iter_mut().zip(force) {
                *sum += force;
            }
        }
        let (_, slide) = self.contact.held_motion(&unknowns);
        Ok(StepData {
            factor: definition.factor(&None, step),
            total_load,
            load: Load {
                force: load_vector(&body, &unknowns, &forces),
                acting: acting(&forces),
                gap: self.contact.gap(&unknowns),
                slide,
            },
            unknowns,
            forces,
        })
    }
}

/// How large the forces are that act on the nodes.
pub(super) fn acting<const D: usize>(forces: &[[f64; D]]) -> f64 {
    norm(forces.as_flattened())
}

/// The facets of a boundary that were looked for in a mesh, or what it has instead.
fn known<'m, const D: usize>(
    mesh: &Mesh<D>,
    facets: Result<&'m [Facet<D>], BoundaryError>,
) -> Result<&'m [Facet<D>], Fault>
where
    ElementKind: Topology<D>,
{
    facets.map_err(|error| match error {
        BoundaryError::Unknown(name) => Fault::NoBoundary {
            name,
            known: mesh.boundaries.keys().cloned().collect(),
            dimension: D,
        },
        error => Fault::Boundary(error),
    })
}

/// The facets of several boundaries on the outside as of one.
pub(super) fn outer_facets<const D: usize>(
    mesh: &Mesh<D>,
    names: &[String],
) -> Result<Vec<Facet<D>>, Fault>
where
    ElementKind: Topology<D>,
{
    let mut all = Vec::new();
    for name in names {
        all.extend_from_slice(known(mesh, mesh.outer_facets(name))?);
    }
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// The regions that a name stands for.
pub(super) fn region<'m, const D: usize>(mesh: &'m Mesh<D>, name: &str) -> Result<&'m [u32], Fault>
where
    ElementKind: Topology<D>,
{
    match mesh.groups.get(name) {
        Some(regions) => Ok(regions),
        None => Err(Fault::NoRegion {
            name: name.to_owned(),
            known: mesh.groups.keys().cloned().collect(),
        }),
    }
}

/// The nodes of a support, with what it prescribes of each.
type Held<'s, const D: usize> = Vec<(u32, [Option<&'s Quantity<D>>; D])>;

impl<const D: usize> Support<D> {
    fn nodes<'s>(&'s self, mesh: &Mesh<D>, zero: &'s Quantity<D>) -> Result<Held<'s, D>, Fault>
    where
        ElementKind: Topology<D>,
    {
        let stated = self.components.each_ref().map(Option::as_ref);
        let names = match &self.place {
            Place::Point(point) => return Ok(vec![(nearest_node(mesh, *point)?, stated)]),
            Place::Boundary(names) => names.all(),
        };
        let mut nodes = Held::new();
        for name in names {
            let facets = known(mesh, mesh.facets(name))?;
            let mut components = stated;
            if self.symmetry {
                let across = |&axis: &usize| {
                    (facets.iter()).all(|facet| mesh.facet_normal(facet).1[axis].abs() > 1.0 - 1e-9)
                };
                let Some(axis) = (0..D).find(across) else {
                    let (what, wanted) = match D {
                        2 => ("parallel to an axis", "symmetry needs one that is"),
                        _ => (
                            "across an axis",
                            "symmetry needs a plane boundary whose normal is along x, y or z",
                        ),
                    };
                    return Err(Fault::Stated(format!(
                        "boundary \"{name}\" is not {what}: {wanted}"
                    )));
                };
                components[axis] = Some(zero);
            }
            let held = facets.iter().flat_map(facet_nodes);
            nodes.extend(held.map(|&node| (node, components)));
        }
        Ok(nodes)
    }
}

/// The node nearest to a point, which has to lie on the body or close to it.
fn nearest_node<const D: usize>(mesh: &Mesh<D>, point: [f64; D]) -> Result<u32, Fault>
where
    ElementKind: Topology<D>,
{
    let (low, high) = mesh.bounding_box();
    let size = length(minus(high, low));
    let distance = |node: &u32| length(minus(mesh.nodes[*node as usize], point));
    let nearest = (0..mesh.nodes.len() as u32)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .expect("a mesh has nodes");
    let far = distance(&nearest);
    if far <= 0.05 * size {
        return Ok(nearest);
    }
    let point: Vec<String> = point.iter().map(f64::to_string).collect();
    Err(Fault::Stated(format!(
        "the node nearest to ({}) is {far:.3e} away: is the point on the body?",
        point.join(", ")
    )))
}

/// Node, component and support of what is prescribed, each where it is prescribed first.
pub(super) fn held(prescriptions: &[Prescription]) -> Vec<(u32, usize, usize)> {
    let mut seen = HashSet::new();
    let all = prescriptions.iter();
    all.filter(|p| seen.insert((p.node, p.component)))
        .map(|p| (p.node, p.component, p.support))
        .collect()
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// All that supports prescribe, in their order.
    pub(super) fn prescriptions(&self, mesh: &Mesh<D>) -> Result<Vec<Prescription>, ModelError> {
        let zero = Quantity::from(0.0);
        let mut all = Vec::new();
        for (number, support) in self.supports.iter().enumerate() {
            let nodes = support.nodes(mesh, &zero);
            for (node, components) in nodes.map_err(|fault| support.entity(number).error(fault))? {
                for (component, quantity) in components.iter().enumerate() {
                    let Some(quantity) = quantity else { continue };
                    all.push(Prescription {
                        node,
                        component,
                        support: number,
                        value: quantity.at(mesh.nodes[node as usize]),
                    });
                }
            }
        }
        Ok(all)
    }

    /// The prescribed displacements of all nodes in a step.
    pub(super) fn prescribed(
        &self,
        mesh: &Mesh<D>,
        prescriptions: &[Prescription],
        step: usize,
    ) -> Result<Vec<[Option<f64>; D]>, ModelError> {
        let factors = self.supports.iter().map(|s| self.factor(&s.factors, step));
        let factors: Vec<f64> = factors.collect();
        let mut prescribed = vec![[None; D]; mesh.nodes.len()];
        for p in prescriptions {
            let value = factors[p.support] * p.value;
            let place = &mut prescribed[p.node as usize][p.component];
            let here = At::from(mesh.nodes[p.node as usize]);
            let fault = if !value.is_finite() {
                format!("the displacement is {value} at {here}")
            } else if place
                .is_some_and(|old: f64| (old - value).abs() > 1e-12 * old.abs().max(value.abs()))
            {
                format!(
                    "two supports prescribe different displacements in {} at {here}",
                    AXES[p.component]
                )
            } else {
                *place = Some(value);
                continue;
            };
            return Err(self.supports[p.support].entity(p.support).error(fault));
        }
        Ok(prescribed)
    }

    /// The nodal forces of a step.
    pub(super) fn forces(&self, body: &Body<D>, step: usize) -> Result<Vec<[f64; D]>, ModelError> {
        let mut forces = vec![[0.0; D]; body.mesh.nodes.len()];
        let at = |quantity: &Option<Quantity<D>>, x| quantity.as_ref().map_or(0.0, |q| q.at(x));
        let finite = |forces: &[[f64; D]], what: &str| {
            let bad = |f: &[f64; D]| !f.iter().all(|v| v.is_finite());
            match forces.iter().position(bad) {
                None => Ok(()),
                Some(node) => {
                    let here = At::from(body.mesh.nodes[node]);
                    Err(Fault::Stated(format!(
                        "the {what} has no finite value near {here}"
                    )))
                }
            }
        };
        for (number, t) in self.tractions.iter().enumerate() {
            let at_fault = |fault: Fault| t.entity(number).error(fault);
            let facets = outer_facets(body.mesh, t.boundary.all()).map_err(at_fault)?;
            let factor = self.factor(&t.factors, step);
            let traction = |x, n: [f64; D]| {
                let p = at(&t.pressure, x);
                std::array::from_fn(|c| factor * (at(&t.components[c], x) - p * n[c]))
            };
            body.add_traction(&facets, traction, &mut forces);
            finite(&forces, "traction").map_err(at_fault)?;
        }
        for (number, b) in self.body_forces.iter().enumerate() {
            let at_fault = |fault: Fault| b.entity(number).error(fault);
            let regions = match &b.region {
                Some(name) => Some(region(body.mesh, name).map_err(at_fault)?),
                None => None,
            };
            let factor = self.factor(&b.factors, step);
            let force = |x, _| {
                let components = b.components.each_ref();
                components.map(|component| factor * at(component, x))
            };
            body.add_body_force(regions, force, &mut forces);
            finite(&forces, "body force").map_err(at_fault)?;
        }
        if let Some(g) = self.gravity {
            if body.materials.iter().all(|m| m.density == 0.0) {
                return Err(Entity::all(Kind::Gravity)
                    .error("there is gravity, but no material has a density"));
            }
            let factor = self.factor(&None, step);
            let force = |_, density| g.map(|g| factor * g * density);
            body.add_body_force(None, force, &mut forces);
        }
        Ok(forces)
    }
}
