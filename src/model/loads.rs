//! The forces of each load step.

use super::entities::{Part as _, Target, Traction};
use super::error::{Entity, EntityKind, Fault, ModelError, listed};
use super::{Changes, Definition, Driven, Elastic, Quantity};
use crate::contact::Space;
use crate::elasticity::{Body, Unknowns, load_vector};
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{BoundaryError, ElementKind, Facet, Location, Mesh, Topology, facet_nodes};
use crate::problem::{LARGEST, SIZES, is_sized};
use crate::quasistatic::Load;
use crate::sparse::{norm, norm_max};

/// The load of a step on the bodies.
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
    /// The temperature of the bodies.
    pub temperature: TemperatureField<D>,
    /// The state of contacts, ties, friction and supports in this step; None where it is the same in all.
    pub changes: Option<Changes>,
    /// The rows whose motion, or the force in place of it, the step states: of preloads, couplings, equations, and supports that
    /// change.
    pub driven: Vec<Driven>,
}

/// The temperature of bodies above their stress-free state, in a load step.
#[derive(Clone, Debug, Default)]
pub struct TemperatureField<const D: usize = 2>(pub(super) Vec<Warmth<D>>);

/// A part of a temperature: regions (None: all), factor and value.
pub(super) type Warmth<const D: usize> = (Option<Vec<u32>>, f64, Quantity<D>);

impl<const D: usize> TemperatureField<D> {
    /// Whether it is not stated.
    pub fn is_none(&self) -> bool {
        self.0.is_empty()
    }

    /// In a region, at a place, in K.
    pub fn at(&self, region: u32, x: [f64; D]) -> f64 {
        let inside = |one: &&Warmth<D>| one.0.as_ref().is_none_or(|all| all.contains(&region));
        let parts = self.0.iter().filter(inside);
        parts.map(|(_, factor, value)| factor * value.at(x)).sum()
    }
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// The load at the end of a step, counted from 0.
    ///
    /// # Errors
    /// If there is no such step, or a load or a displacement is not finite, or two supports prescribe different ones.
    pub fn step(&self, step: usize) -> Result<StepData<D>, ModelError> {
        let definition = &self.definition;
        let n_steps = definition.n_steps();
        if step >= n_steps {
            return Err(Entity::all(EntityKind::Steps).error(format!(
                "there is no step {step} (they count from 0, and there are {n_steps})"
            )));
        }
        let body = self.body();
        let time = end_of(step);
        let unknowns = definition.unknowns(&self.mesh, &self.prescriptions, time)?;
        let forces = definition.forces(&body, time)?;
        let temperature = definition.temperature(&self.mesh, time)?;
        let mut total_load = [0.0; D];
        for force in &forces {
            for (sum, force) in total_load.iter_mut().zip(force) {
                *sum += force;
            }
        }
        let (_, slide) = self.contact.held_motion(&unknowns);
        let driven = definition.driven(&self.pairs, &self.pair_of, end_of(step));
        Ok(StepData {
            factor: definition.factor(&None, time),
            total_load,
            load: Load {
                force: load_vector(&body, &unknowns, &forces),
                acting: acting(&forces),
                gap: self.gap(&unknowns, &driven),
                slide,
            },
            changes: self.changes(step, &driven)?,
            driven,
            unknowns,
            forces,
            temperature,
        })
    }
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// d of a load step with these prescribed displacements and stated motions.
    pub(super) fn gap(&self, unknowns: &Unknowns<D>, driven: &[Driven]) -> Vec<f64> {
        let mut gap = self.contact.gap(unknowns);
        for driven in driven {
            gap[driven.row] += driven.motion.unwrap_or(0.0);
        }
        gap
    }

    /// The law of rows of contact in a load step, counted from 0.
    pub(super) fn changes(
        &self,
        step: usize,
        driven: &[Driven],
    ) -> Result<Option<Changes>, ModelError> {
        let of = (&self.contact, &self.pair_of[..]);
        (self.definition).changes(&self.mesh, &self.prescriptions, of, driven, step)
    }
}

/// The time at the end of a load step, counted from 0.
pub(super) fn end_of(step: usize) -> f64 {
    step as f64 + 1.0
}

/// The load step of a time, counted from 0.
pub(super) fn step_of(time: f64) -> usize {
    (time.ceil() as usize).saturating_sub(1)
}

/// The size of the forces on the nodes.
pub(super) fn acting<const D: usize>(forces: &[[f64; D]]) -> f64 {
    norm(forces.as_flattened())
}

/// The nodes of facets with their parts of the area, which is the second value; the thickness of the plane counts.
pub(super) fn area_shares<const D: usize>(
    body: &Body<D>,
    facets: &[Facet<D>],
) -> (Vec<(u32, f64)>, f64)
where
    ElementKind: Space<D>,
{
    let mut shares = vec![0.0; body.mesh.nodes.len()];
    body.integrate_on_boundary(facets, &|_| 1.0, &mut shares);
    let area: f64 = shares.iter().sum();
    let shares = (0..).zip(shares).filter(|(_, share)| *share != 0.0);
    let parts = shares.map(|(node, share)| (node, share / area));
    (parts.collect(), area)
}

/// The facets of a boundary of a mesh, or the boundaries that it has instead.
pub(super) fn known<'m, const D: usize>(
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

/// The outer facets of several boundaries as of one. Where some of them are sets of nodes without their own faces, the facets
/// whose nodes are in all of them together.
pub(super) fn outer_facets<const D: usize>(
    mesh: &Mesh<D>,
    names: &[String],
) -> Result<Vec<Facet<D>>, Fault>
where
    ElementKind: Topology<D>,
{
    let is_bare =
        |name: &String| mesh.outer_facets(name).is_err() && mesh.node_sets.contains_key(name);
    if names.iter().any(is_bare) {
        return between_sets(mesh, names);
    }
    let mut all = Vec::new();
    for name in names {
        all.extend_from_slice(known(mesh, mesh.outer_facets(name))?);
    }
    all.sort_unstable();
    all.dedup();
    Ok(all)
}

/// The outer facets whose corners are all in sets of nodes and on boundaries.
fn between_sets<const D: usize>(mesh: &Mesh<D>, names: &[String]) -> Result<Vec<Facet<D>>, Fault>
where
    ElementKind: Topology<D>,
{
    let mut nodes = Vec::new();
    for name in names {
        match mesh.node_sets.get(name) {
            Some(set) => nodes.extend_from_slice(set),
            None => {
                let facets = known(mesh, mesh.outer_facets(name))?;
                nodes.extend(facets.iter().flat_map(facet_nodes));
            }
        }
    }
    let facets = mesh.outer_facets_at(&nodes, true);
    if facets.is_empty() {
        return Err(Fault::Stated(format!(
            "no outer {} has all of its corners in the nodes of {}: name more sets with a comma between, or take their nodes one by \
             one (nodes = … in a contact)",
            if D == 2 { "edge" } else { "face" },
            listed(names)
        )));
    }
    Ok(facets)
}

/// The regions behind a name.
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

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// The temperature of the bodies in a step.
    pub(super) fn temperature(
        &self,
        mesh: &Mesh<D>,
        time: f64,
    ) -> Result<TemperatureField<D>, ModelError> {
        let mut parts = Vec::new();
        for (number, t) in self.temperatures.iter().enumerate() {
            let regions = match &t.region {
                Some(name) => {
                    let found = region(mesh, name);
                    let found = found.map_err(|fault| t.entity(number).error(fault))?;
                    Some(found.to_vec())
                }
                None => None,
            };
            parts.push((regions, self.factor(&t.factors, time), t.value.clone()));
        }
        Ok(TemperatureField(parts))
    }

    /// Adds the nodal forces of thermal expansion in a step.
    fn add_expansion(
        &self,
        body: &Body<D>,
        time: f64,
        forces: &mut [[f64; D]],
    ) -> Result<(), ModelError> {
        let field = self.temperature(body.mesh, time)?;
        if field.is_none() {
            return Ok(());
        }
        if body.materials.iter().all(|m| m.expansion == 0.0) {
            return Err(Entity::all(EntityKind::Temperature)
                .error("there is a temperature, but no material has an expansion"));
        }
        body.add_expansion(&|region, x| field.at(region, x), forces);
        Ok(())
    }

    /// The regions of a body force; None: all.
    fn regions_of<'m>(
        &self,
        number: usize,
        mesh: &'m Mesh<D>,
    ) -> Result<Option<&'m [u32]>, ModelError> {
        let force = &self.body_forces[number];
        let found = force.region.as_ref().map(|name| region(mesh, name));
        (found.transpose()).map_err(|fault| force.entity(number).error(fault))
    }

    /// The force of a body force per volume, from a place.
    fn per_volume(&self, number: usize, time: f64) -> impl Fn([f64; D], f64) -> [f64; D] {
        let force = &self.body_forces[number];
        let factor = self.factor(&force.factors, time);
        move |x, _| (force.components()).map(|component| factor * at(component, x))
    }

    /// The centrifugal force per volume, from a place and the density.
    fn centrifugal(&self, time: f64) -> impl Fn([f64; D], f64) -> [f64; D] {
        let speed = (self.analysis.rotation.as_ref()).map_or(0.0, |rotation| rotation.speed);
        let square = self.factor(&None, time) * speed * speed;
        move |x, density| self.arm(x).map(|arm| square * density * arm)
    }

    /// Whether there are forces in the volume that depend on where bodies are.
    pub(super) fn has_moved_forces(&self) -> bool {
        self.is_large()
            && (self.analysis.rotation.is_some() || self.body_forces.iter().any(|b| b.displaced))
    }

    /// Adds these at displacements u, and the symmetric part of their change with these to a block for each node.
    pub(super) fn add_moved_forces(
        &self,
        body: &Body<D>,
        time: f64,
        u: &[[f64; D]],
        forces: &mut [[f64; D]],
        changes: &mut [[[f64; D]; D]],
    ) -> Result<(), ModelError> {
        /// The length of differences, in the size of the mesh: those of centrifugal forces are exact.
        const STEP: f64 = 1e-4;
        let (low, high) = body.mesh.bounding_box();
        let at = (u, STEP * length(minus(high, low)));
        let forces_of = self.body_forces.iter().enumerate();
        for (number, _) in forces_of.filter(|one| one.1.displaced) {
            let regions = self.regions_of(number, body.mesh)?;
            let force = self.per_volume(number, time);
            body.add_moved_force(regions, at, force, forces, changes);
        }
        if self.analysis.rotation.is_some() {
            body.add_moved_force(None, at, self.centrifugal(time), forces, changes);
        }
        match forces
            .iter()
            .zip(u)
            .find(|one| !one.0.iter().all(|v| v.is_finite()))
        {
            None => Ok(()),
            Some((_, u)) => {
                let number = self.body_forces.iter().position(|b| b.displaced);
                let of_force = |number: usize| self.body_forces[number].entity(number);
                let entity = number.map_or_else(|| Entity::all(EntityKind::Rotation), of_force);
                Err(entity.error(format!(
                    "a force has no finite value where a node has moved by {}",
                    Location::from(*u)
                )))
            }
        }
    }

    /// The nodal forces of a step, without those in the volume that depend on where bodies are.
    pub(super) fn forces(&self, body: &Body<D>, time: f64) -> Result<Vec<[f64; D]>, ModelError> {
        let mut forces = vec![[0.0; D]; body.mesh.nodes.len()];
        // Those, at rest.
        let mut moved = forces.clone();
        let finite = |forces: &[[f64; D]], places: &[[f64; D]], what: &str| {
            let bad = |f: &[f64; D]| f.iter().find(|v| !(v.abs() <= LARGEST)).copied();
            let found = (forces.iter().zip(places)).find_map(|(f, x)| Some((bad(f)?, x)));
            match found {
                None => Ok(()),
                Some((value, &x)) if value.is_finite() => Err(Fault::Stated(format!(
                    "the {what} is a nodal force of {value:e} near {}: {SIZES}",
                    Location::from(x)
                ))),
                Some((_, &x)) => Err(Fault::Stated(format!(
                    "the {what} has no finite value near {}",
                    Location::from(x)
                ))),
            }
        };
        let places = &body.mesh.nodes;
        // The first load that does anything.
        let mut acting = None;
        let mut note = |forces: &[[f64; D]], entity: Entity| {
            if acting.is_none() && forces.as_flattened().iter().any(|&v| v != 0.0) {
                acting = Some(entity);
            }
        };
        for (number, t) in self.tractions.iter().enumerate() {
            let at_fault = |fault: Fault| t.entity(number).error(fault);
            let facets = outer_facets(body.mesh, t.boundary.all()).map_err(at_fault)?;
            let factor = self.factor(&t.factors, time);
            let whole = t.per_area(body, &facets, self.is_large());
            let whole = whole.map_err(at_fault)?;
            let traction = |x, n| whole.at(x, n).map(|t| factor * t);
            body.add_traction(&facets, traction, &mut forces);
            finite(&forces, places, "traction").map_err(at_fault)?;
            note(&forces, t.entity(number));
        }
        for (number, b) in self.body_forces.iter().enumerate() {
            let regions = self.regions_of(number, body.mesh)?;
            let force = self.per_volume(number, time);
            let sum = if b.displaced { &mut moved } else { &mut forces };
            body.add_body_force(regions, force, sum);
            let at_fault = |fault: Fault| b.entity(number).error(fault);
            finite(sum, places, "body force").map_err(at_fault)?;
            note(sum, b.entity(number));
        }
        for (number, f) in self.forces.iter().enumerate() {
            let at_fault = |fault: Fault| f.entity(number).error(fault);
            let factor = self.factor(&f.factors, time);
            let nodes = f.target().uncut_nodes(body.mesh).map_err(at_fault)?;
            lost_nodes(body.mesh, f.target()).map_err(at_fault)?;
            for node in nodes {
                let x = body.mesh.nodes[node as usize];
                let components = f.components();
                let added = components.map(|component| factor * at(component, x));
                let mut on_axis = x;
                on_axis[0] = 0.0;
                if self.is_on_axis(x) && factor * at(components[0], on_axis) != 0.0 {
                    return Err(at_fault(Fault::Stated(format!(
                        "its node at {} is on the axis of the body of revolution, where a radial force does nothing: take the node out, or \
                         leave out x",
                        Location::from(x)
                    ))));
                }
                let sum = &mut forces[node as usize];
                (0..D).for_each(|c| sum[c] += added[c]);
                finite(&[*sum], &[x], "force").map_err(at_fault)?;
                note(&[added], f.entity(number));
            }
        }
        // With large displacements, rows turn with the bodies, and the material handles temperature.
        if !self.is_large() {
            self.add_driven(body, time, &mut forces)?;
            self.add_expansion(body, time, &mut forces)?;
        }
        if let Some(first) = self.temperatures.first() {
            let at_fault = |fault: Fault| first.entity(0).error(fault);
            finite(&forces, places, "thermal expansion").map_err(at_fault)?;
            note(&forces, first.entity(0));
        }
        if self.analysis.rotation.is_some() {
            let all = || Entity::all(EntityKind::Rotation);
            if body.materials.iter().all(|m| m.density == 0.0) {
                return Err(all().error("there is a rotation, but no material has a density"));
            }
            let sum = if self.is_large() {
                &mut moved
            } else {
                &mut forces
            };
            body.add_body_force(None, self.centrifugal(time), sum);
            finite(sum, places, "rotation").map_err(|fault| all().error(fault))?;
            note(sum, all());
        }
        if let Some(g) = self.analysis.gravity {
            if body.materials.iter().all(|m| m.density == 0.0) {
                return Err(Entity::all(EntityKind::Gravity)
                    .error("there is gravity, but no material has a density"));
            }
            let factor = self.factor(&None, time);
            let force = |_, density| g.map(|g| factor * g * density);
            body.add_body_force(None, force, &mut forces);
            let all = || Entity::all(EntityKind::Gravity);
            finite(&forces, places, "gravity").map_err(|fault| all().error(fault))?;
            note(&forces, all());
        }
        let largest = norm_max(forces.as_flattened()).max(norm_max(moved.as_flattened()));
        match acting {
            Some(entity) if !is_sized(largest) => Err(entity.error(format!(
                "the largest nodal force of load step {} is {largest:e}: {SIZES}",
                time.ceil()
            ))),
            _ => Ok(forces),
        }
    }
}

/// Whether sets of nodes that a load is on have nodes without elements, which the mesh has left out.
fn lost_nodes<const D: usize>(mesh: &Mesh<D>, target: Target<D>) -> Result<(), Fault>
where
    ElementKind: Topology<D>,
{
    let Target::Nodes(names) = target else {
        return Ok(());
    };
    let mut all = names.all().iter();
    match all.find_map(|name| Some((name, mesh.lost.get(name)?))) {
        None => Ok(()),
        Some((name, lost)) => Err(Fault::Stated(format!(
            "{lost} of the nodes of the set \"{name}\" belong to no element, and nothing there takes a force: take them out of the set"
        ))),
    }
}

/// A traction on its facets, as force per area.
struct PerArea<'t, const D: usize> {
    traction: &'t Traction<D>,
    /// The factor of the arm about the axis: the torque over ∫ r².
    turn: f64,
    /// The force over the area.
    even: [f64; D],
    /// Whether its pressure follows the surface, and is taken elsewhere.
    follows: bool,
}

impl<const D: usize> Traction<D> {
    /// Its value per area on these facets, with the integrals that distribute a torque and a force.
    fn per_area(
        &self,
        body: &Body<D>,
        facets: &[Facet<D>],
        follows: bool,
    ) -> Result<PerArea<'_, D>, Fault>
    where
        ElementKind: Space<D>,
    {
        let integral = |q: &(dyn Fn([f64; D]) -> f64 + Sync)| -> f64 {
            let mut shares = vec![0.0; body.mesh.nodes.len()];
            body.integrate_on_boundary(facets, q, &mut shares);
            shares.iter().sum()
        };
        let mut turn = 0.0;
        if let (Some(torque), Some(axis)) = (self.torque, &self.axis) {
            let square = integral(&|x| {
                let arm = axis.turn(x);
                dot(arm, arm)
            });
            let (low, high) = body.mesh.bounding_box();
            let size = dot(low, low).max(dot(high, high)) * integral(&|_| 1.0);
            if !(square > 1e-18 * size) {
                return Err(Fault::Stated(
                    "this boundary lies on the axis: no traction on it has a torque".to_owned(),
                ));
            }
            turn = torque / square;
        }
        let even = match self.force {
            Some(force) => {
                let area = integral(&|_| 1.0);
                force.map(|force| force / area)
            }
            None => [0.0; D],
        };
        Ok(PerArea {
            traction: self,
            turn,
            even,
            follows,
        })
    }
}

impl<const D: usize> PerArea<'_, D> {
    /// At a point with the outward normal n; not finite where the direction is undefined.
    fn at(&self, x: [f64; D], n: [f64; D]) -> [f64; D] {
        let t = self.traction;
        let components = t.components();
        let pressure = at(t.pressure.as_ref().filter(|_| !self.follows), x);
        let mut sum = std::array::from_fn(|c| at(components[c], x) - pressure * n[c]);
        let Some(axis) = &t.axis else {
            return std::array::from_fn(|c| sum[c] + self.even[c]);
        };
        let arm = axis.turn(x);
        (0..D).for_each(|c| sum[c] += self.even[c] + self.turn * arm[c]);
        if t.ways().iter().any(Option::is_some) {
            let ways = (axis.directions(x, 0.0)).unwrap_or([[f64::NAN; D]; 3]);
            for (value, way) in t.ways().into_iter().zip(ways) {
                if value.is_some() {
                    let value = at(value, x);
                    (0..D).for_each(|c| sum[c] += value * way[c]);
                }
            }
        }
        sum
    }
}

/// A quantity, or 0.
fn at<const D: usize>(quantity: Option<&Quantity<D>>, x: [f64; D]) -> f64 {
    quantity.map_or(0.0, |q| q.at(x))
}
