//! Prescribed displacements and forces of each load step.

use super::entities::{AXES, Place, Support};
use super::error::{Entity, Fault, Kind, ModelError};
use super::{Definition, Elastic, Quantity};
use crate::elasticity::{Body, Unknowns, load_vector};
use crate::mesh::{BoundaryError, Mesh};
use crate::quasistatic::Load;
use crate::sparse::norm;
use std::collections::HashSet;

/// What a load step puts on the bodies.
#[derive(Clone, Debug)]
pub struct StepData {
    /// The common load factor.
    pub factor: f64,
    /// The numbering, with the prescribed displacements of the step.
    pub unknowns: Unknowns,
    /// Nodal forces of the step, two per node of the mesh.
    pub forces: Vec<[f64; 2]>,
    /// The resultant of all loads, in N.
    pub total_load: [f64; 2],
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

impl Elastic {
    /// The load at the end of a step, counted from 0.
    ///
    /// # Errors
    /// If there is no such step, or a load or a displacement is not finite, or two supports differ about one.
    pub fn step(&self, step: usize) -> Result<StepData, ModelError> {
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
        let mut total_load = [0.0; 2];
        for force in &forces {
            total_load[0] += force[0];
            total_load[1] += force[1];
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
pub(super) fn acting(forces: &[[f64; 2]]) -> f64 {
    norm(forces.as_flattened())
}

/// The edges of a boundary that were looked for in a mesh, or what it has instead.
fn known<'m>(
    mesh: &Mesh,
    edges: Result<&'m [[u32; 2]], BoundaryError>,
) -> Result<&'m [[u32; 2]], Fault> {
    edges.map_err(|error| match error {
        BoundaryError::Unknown(name) => Fault::NoBoundary {
            name,
            known: mesh.boundaries.keys().cloned().collect(),
        },
        error => Fault::Boundary(error),
    })
}

/// The edges of several boundaries on the outside as of one.
pub(super) fn outer_edges(mesh: &Mesh, names: &[String]) -> Result<Vec<[u32; 2]>, Fault> {
    let mut all = Vec::new();
    for name in names {
        all.extend_from_slice(known(mesh, mesh.outer_facets(name))?);
    }
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// The regions that a name stands for.
pub(super) fn region<'m>(mesh: &'m Mesh, name: &str) -> Result<&'m [u32], Fault> {
    match mesh.groups.get(name) {
        Some(regions) => Ok(regions),
        None => Err(Fault::NoRegion {
            name: name.to_owned(),
            known: mesh.groups.keys().cloned().collect(),
        }),
    }
}

/// The nodes of a support, with what it prescribes of each.
type Held<'s> = Vec<(u32, [Option<&'s Quantity>; 2])>;

impl Support {
    fn nodes<'s>(&'s self, mesh: &Mesh, zero: &'s Quantity) -> Result<Held<'s>, Fault> {
        let stated = self.components.each_ref().map(Option::as_ref);
        let names = match &self.place {
            Place::Point(point) => return Ok(vec![(nearest_node(mesh, *point)?, stated)]),
            Place::Boundary(names) => names.all(),
        };
        let mut nodes = Held::new();
        for name in names {
            let edges = known(mesh, mesh.facets(name))?;
            let across = |axis: usize| {
                (edges.iter()).all(|edge| mesh.facet_normal(edge).1[axis].abs() > 1.0 - 1e-9)
            };
            let components = match self.symmetry {
                false => stated,
                true if across(0) => [Some(zero), None],
                true if across(1) => [None, Some(zero)],
                true => {
                    return Err(Fault::Stated(format!(
                        "boundary \"{name}\" is not parallel to an axis: symmetry needs one that is"
                    )));
                }
            };
            nodes.extend(edges.iter().flatten().map(|&node| (node, components)));
        }
        Ok(nodes)
    }
}

/// The node nearest to a point, which has to lie on the body or close to it.
fn nearest_node(mesh: &Mesh, point: [f64; 2]) -> Result<u32, Fault> {
    let (low, high) = mesh.bounding_box();
    let size = (high[0] - low[0]).hypot(high[1] - low[1]);
    let distance = |node: &u32| {
        let x = mesh.nodes[*node as usize];
        (x[0] - point[0]).hypot(x[1] - point[1])
    };
    let nearest = (0..mesh.nodes.len() as u32)
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .expect("a mesh has nodes");
    let far = distance(&nearest);
    if far <= 0.05 * size {
        return Ok(nearest);
    }
    Err(Fault::Stated(format!(
        "the node nearest to ({}, {}) is {far:.3e} away: is the point on the body?",
        point[0], point[1]
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

impl Definition {
    /// All that supports prescribe, in their order.
    pub(super) fn prescriptions(&self, mesh: &Mesh) -> Result<Vec<Prescription>, ModelError> {
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
        mesh: &Mesh,
        prescriptions: &[Prescription],
        step: usize,
    ) -> Result<Vec<[Option<f64>; 2]>, ModelError> {
        let factors = self.supports.iter().map(|s| self.factor(&s.factors, step));
        let factors: Vec<f64> = factors.collect();
        let mut prescribed = vec![[None; 2]; mesh.nodes.len()];
        for p in prescriptions {
            let value = factors[p.support] * p.value;
            let place = &mut prescribed[p.node as usize][p.component];
            let [x, y] = mesh.nodes[p.node as usize];
            let fault = if !value.is_finite() {
                format!("the displacement is {value} at ({x:.6e}, {y:.6e})")
            } else if place
                .is_some_and(|old: f64| (old - value).abs() > 1e-12 * old.abs().max(value.abs()))
            {
                format!(
                    "two supports prescribe different displacements in {} at ({x:.6e}, {y:.6e})",
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
    pub(super) fn forces(&self, body: &Body, step: usize) -> Result<Vec<[f64; 2]>, ModelError> {
        let mut forces = vec![[0.0; 2]; body.mesh.nodes.len()];
        let at = |quantity: &Option<Quantity>, x| quantity.as_ref().map_or(0.0, |q| q.at(x));
        let finite = |forces: &[[f64; 2]], what: &str| {
            let bad = |f: &[f64; 2]| !f.iter().all(|v| v.is_finite());
            match forces.iter().position(bad) {
                None => Ok(()),
                Some(node) => {
                    let [x, y] = body.mesh.nodes[node];
                    Err(Fault::Stated(format!(
                        "the {what} has no finite value near ({x:.6e}, {y:.6e})"
                    )))
                }
            }
        };
        for (number, t) in self.tractions.iter().enumerate() {
            let at_fault = |fault: Fault| t.entity(number).error(fault);
            let edges = outer_edges(body.mesh, t.boundary.all()).map_err(at_fault)?;
            let factor = self.factor(&t.factors, step);
            let traction = |x, n: [f64; 2]| {
                let [tx, ty] = t.components.each_ref().map(|component| at(component, x));
                let p = at(&t.pressure, x);
                [tx - p * n[0], ty - p * n[1]].map(|v| factor * v)
            };
            body.add_traction(&edges, traction, &mut forces);
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
