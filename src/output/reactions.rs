//! The forces of contacts and supports at the end of a step: resultants, moments, work.

use super::energy::{NodalForces, PointMotion};
use super::{NodeStatus, OfBodies};
use crate::contact::Space;
use crate::elasticity::{Deformed, Plane, Temperature, internal_forces};
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{ElementKind, Topology};
use crate::model::{Drive, Elastic, EntityKind};
use crate::quasistatic::StepSolution;
use crate::rigid;
use serde::Serialize;
use std::collections::HashSet;
use std::ops::Range;

/// A pressure above this part of the largest is near it. Next to the edge of a punch it falls to 0.6 of it from one
/// node to the next, on any mesh.
const PEAK: f64 = 0.7;

/// The forces of a contact at the end of a step.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ContactReport {
    /// Its source: a contact, or another joint of bodies.
    #[serde(skip)]
    pub kind: EntityKind,
    /// Its own name, if any.
    pub name: Option<String>,
    /// The boundary that carries the multipliers.
    pub boundary: String,
    /// The master boundary, or the kind of obstacle.
    pub against: String,
    /// The law and its bound or coefficient.
    pub friction: String,
    /// The stiffness of the contact itself, where it is compliant.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stiffness: Option<String>,
    /// Resultant on the body of `boundary` along the axes, in the unit of force, as are all that follow.
    pub force: Vec<f64>,
    /// Its moment about `centre`, in the unit of force times that of length: in the plane one number, about z; 0 of bodies of
    /// revolution.
    pub moment: Vec<f64>,
    /// The centroid of the part that may come into contact.
    pub centre: Vec<f64>,
    /// Σ λν.
    pub normal_force: f64,
    /// −Σ λτ: along the tangents, as the traction on the body; in space the length of the resultant of friction.
    pub tangential_force: f64,
    /// The work that friction has dissipated in the step: Σ λτ · (slip since the step before), with λτ at its end.
    pub slipping_work: f64,
    /// The largest pressure of a place.
    pub max_pressure: f64,
    /// Area in contact.
    pub area: f64,
    /// Places that touch nothing.
    pub separated: usize,
    /// Places in contact that do not slip.
    pub stick: usize,
    /// Places in contact that slip.
    pub slip: usize,
    /// Places in contact without a law of friction.
    pub frictionless: usize,
    /// Tied places.
    pub tied: usize,
    /// Of a preload: the tension in the section.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tension: Option<f64>,
    /// Of a preload: by how much its ends overlap, in the unit of length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shortening: Option<f64>,
    /// Of a coupling: the motion of its point, along the axes in the unit of length, then about them in rad; null where its nodes do
    /// not determine it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub motion: Vec<Option<f64>>,
    /// The largest depth that wear has taken off, of both sides together, in the unit of length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear_depth: Option<f64>,
    /// The volume that wear has taken off.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub wear_volume: Option<f64>,
    /// Pools of places with a pressure near the largest: above 0.7 of it.
    #[serde(skip)]
    pub peaks: usize,
}

impl ContactReport {
    /// Whether it is a preload, a coupling or an equation, which has no pressure.
    pub fn is_driven(&self) -> bool {
        matches!(
            self.kind,
            EntityKind::Preload | EntityKind::Coupling | EntityKind::Equation
        )
    }

    /// Its name in pictures and the summary: its own or, without one, both sides.
    pub fn title(&self) -> String {
        match &self.name {
            Some(name) => name.clone(),
            None => format!("{} / {}", self.boundary, self.against),
        }
    }
}

/// The force on a support, or on an elastic foundation, at the end of a step.
#[derive(Clone, Debug, Serialize)]
pub struct SupportReport {
    /// Its name or, where it has none, its boundary, set of nodes or point; "…, foundation" of a foundation.
    pub support: String,
    /// Resultant on the body along the axes, in N; a component that two supports hold counts for the first.
    pub force: Vec<f64>,
    /// Its moment about `centre`, as that of a contact.
    pub moment: Vec<f64>,
    /// The centroid of its boundaries, or its point.
    pub centre: Vec<f64>,
}

/// The forces at the contact places on their body along the axes: those of pressure and those of friction.
fn contact_forces<'a, const D: usize>(
    elastic: &'a Elastic<D>,
    solution: &'a StepSolution<D>,
) -> impl Iterator<Item = [[f64; D]; 2]> + 'a
where
    ElementKind: Topology<D>,
{
    let (normal, tangential) = solution.lambda.split_at(elastic.contact.places.len());
    let places = elastic.contact.places.iter().zip(normal);
    (places.zip(tangential.chunks(D - 1))).map(|((place, normal), tangential)| {
        let tangents = || place.frame[1..].iter().zip(tangential);
        [
            place.frame[0].map(|nu| -normal * nu),
            std::array::from_fn(|c| -tangents().map(|(tau, force)| force * tau[c]).sum::<f64>()),
        ]
    })
}

/// The moment of a force at the end of an arm: about z in the plane, otherwise about the axes; zero for a ring.
fn moment<const D: usize>(plane: Plane, arm: [f64; D], force: [f64; D]) -> Vec<f64> {
    let about = |a: usize, b: usize| arm[a] * force[b] - arm[b] * force[a];
    match D {
        2 if plane == Plane::Axisymmetric => vec![0.0],
        2 => vec![about(0, 1)],
        _ => vec![about(1, 2), about(2, 0), about(0, 1)],
    }
}

/// Adds to a sum.
fn add(sum: &mut [f64], more: &[f64]) {
    sum.iter_mut()
        .zip(more)
        .for_each(|(sum, more)| *sum += more);
}

/// The centroids of the parts of the pairs that may touch.
fn pair_centres<const D: usize>(elastic: &Elastic<D>) -> Vec<[f64; D]>
where
    ElementKind: Topology<D>,
{
    let mut sums = vec![([0.0; D], 0.0); elastic.pairs.len()];
    for (place, &pair) in elastic.contact.places.iter().zip(&elastic.pair_of) {
        let (sum, area) = &mut sums[pair as usize];
        (0..D).for_each(|c| sum[c] += place.area * place.place[c]);
        *area += place.area;
    }
    sums.into_iter()
        // Sides that have not met yet have no centroid.
        .map(|(sum, area)| sum.map(|v| if area > 0.0 { v / area } else { 0.0 }))
        .collect()
}

/// Where the forces of contact place i act on its own side after these displacements: the mean of its nodes there. On a curved facet of
/// second order it is not the node at which the place is.
fn acts_at<const D: usize>(elastic: &Elastic<D>, i: usize, displacement: &[[f64; D]]) -> [f64; D]
where
    ElementKind: Topology<D>,
{
    let place = &elastic.contact.places[i];
    let moves = f64::from(u8::from(elastic.is_large()));
    let at = |node: u32| -> Option<[f64; D]> {
        let x = elastic.mesh.nodes.get(node as usize)?;
        let u = displacement.get(node as usize)?;
        Some(std::array::from_fn(|c| x[c] + moves * u[c]))
    };
    let own: Option<Vec<_>> = (place.own.iter())
        .map(|&(node, weight)| at(node).map(|x| (x, weight)))
        .collect();
    let (Some(own), Some(node)) = (own, place.node.and_then(at)) else {
        return place.place;
    };
    // The weights of equations may have any sum.
    let whole: f64 = own.iter().map(|(_, weight)| weight).sum();
    let sum = |c: usize| own.iter().map(|(x, weight)| weight * x[c]).sum::<f64>();
    let mean = std::array::from_fn(|c| sum(c) / whole);
    let off = |x: [f64; D]| length(minus(x, place.place));
    match off(node) < off(mean) {
        true => mean,
        false => place.place,
    }
}

/// The forces of the contacts; `before` is the slip at the beginning of the step, empty if it begins from rest.
pub(super) fn contact_reports<const D: usize>(
    of: &OfBodies<D>,
    solution: &StepSolution<D>,
    before: &[f64],
) -> Vec<ContactReport>
where
    ElementKind: Topology<D>,
{
    let (elastic, fields) = (of.elastic, &of.contact);
    let (normal, tangential) = solution.lambda.split_at(elastic.contact.places.len());
    let centres = pair_centres(elastic);
    let mut contacts: Vec<ContactReport> = (elastic.pairs.iter().zip(&centres))
        .map(|(pair, centre)| ContactReport {
            kind: pair.kind,
            name: pair.name.clone(),
            boundary: pair.boundary.clone(),
            against: pair.against.clone(),
            friction: pair.friction.clone(),
            stiffness: pair.stiffness.clone(),
            force: vec![0.0; D],
            moment: moment(elastic.plane, [0.0; D], [0.0; D]),
            centre: centre.to_vec(),
            ..Default::default()
        })
        .collect();
    let mut friction = vec![[0.0; D]; contacts.len()];
    for (i, [pressed, rubbed]) in contact_forces(elastic, solution).enumerate() {
        let pair = elastic.pair_of[i] as usize;
        let contact = &mut contacts[pair];
        for c in 0..D {
            contact.force[c] += pressed[c] + rubbed[c];
            friction[pair][c] += rubbed[c];
        }
        let place = acts_at(elastic, i, &of.fields.displacement);
        let whole = std::array::from_fn(|c| pressed[c] + rubbed[c]);
        add(
            &mut contact.moment,
            &moment(elastic.plane, minus(place, centres[pair]), whole),
        );
        for k in (D - 1) * i..(D - 1) * (i + 1) {
            // The elastic part of a compliant contact is recovered.
            let slip = match elastic.contact.compliance.is_empty() {
                _ if fields.status[i] == NodeStatus::Tied => 0.0,
                // Rows are others in each step.
                _ if elastic.is_large() => solution.slip[k],
                true => fields.slip[k] - before.get(k).copied().unwrap_or(0.0),
                false => solution.slip[k],
            };
            contact.slipping_work += tangential[k] * slip;
        }
        contact.normal_force += normal[i];
        if D == 2 {
            contact.tangential_force -= tangential[i];
        }
        contact.max_pressure = contact.max_pressure.max(fields.pressure[i]);
        let status = fields.status[i];
        *match status {
            NodeStatus::Separated => &mut contact.separated,
            NodeStatus::Stick => &mut contact.stick,
            NodeStatus::Tied => &mut contact.tied,
            NodeStatus::Slip => &mut contact.slip,
            NodeStatus::Frictionless => &mut contact.frictionless,
        } += 1;
        if status != NodeStatus::Separated {
            contact.area += elastic.contact.places[i].area;
        }
    }
    for (data, contact) in elastic.pairs.iter().zip(&mut contacts) {
        // Their forces act at points.
        if matches!(data.kind, EntityKind::Spring | EntityKind::Equation) {
            (contact.area, contact.max_pressure) = (0.0, 0.0);
        }
    }
    if D == 3 {
        for (contact, friction) in contacts.iter_mut().zip(friction) {
            contact.tangential_force = length(friction);
        }
    }
    for (i, depth) in solution.worn.iter().enumerate() {
        let pair = elastic.pair_of[i] as usize;
        if elastic.pairs[pair].wear > 0.0 {
            let contact = &mut contacts[pair];
            *contact.wear_volume.get_or_insert_default() += elastic.contact.places[i].area * depth;
            let most = contact.wear_depth.get_or_insert_default();
            *most = most.max(*depth);
        }
    }
    for driven in &of.data.driven {
        let pair = elastic.pair_of[driven.row];
        let first = elastic.pair_of.partition_point(|&other| other < pair);
        let (data, contact) = (&elastic.pairs[pair as usize], &mut contacts[pair as usize]);
        let Drive {
            component, size, ..
        } = data.drives[driven.row - first];
        // An equation has no point, and a support is no contact.
        if !matches!(data.kind, EntityKind::Preload | EntityKind::Coupling) {
            continue;
        }
        let moved = (driven.motion.unwrap_or(0.0) - fields.gap[driven.row]) / size;
        let force = (driven.force - normal[driven.row]) * size;
        let place = &elastic.contact.places[first];
        let is_first = contact.motion.is_empty();
        // All other places pass on the forces here; their rows are no contact by themselves.
        contact.centre = place.place.to_vec();
        (contact.separated, contact.tied) = (0, data.places);
        (contact.normal_force, contact.tangential_force) = (0.0, 0.0);
        (contact.area, contact.max_pressure) = (0.0, 0.0);
        if data.kind == EntityKind::Preload {
            (contact.tension, contact.shortening) = (Some(force), Some(moved));
            (contact.normal_force, contact.area) = (-force, place.area);
            let rows = first..first + data.places;
            (contact.force, contact.moment) = section_forces(elastic, solution, rows, force);
            continue;
        }
        if is_first {
            contact.motion = vec![None; rigid::count(D)];
            contact.force.fill(0.0);
            contact.moment.fill(0.0);
        }
        contact.motion[component] = Some(moved);
        let mut along = |component: usize, force: f64| match component.checked_sub(D) {
            None => contact.force[component] += force,
            Some(about) => contact.moment[about] += force,
        };
        along(component, force);
        // Nodes that determine a sum of motions alone bear forces along those that are held at 0, too.
        let (mut sum, mut turning) = (vec![0.0; D], moment(elastic.plane, [0.0; D], [0.0; D]));
        for (node, way) in elastic.contact.places[driven.row].further.iter().flatten() {
            let here = way.map(|v| v * force / size);
            let arm = minus(elastic.mesh.nodes[*node as usize], place.place);
            add(&mut sum, &here);
            add(&mut turning, &moment(elastic.plane, arm, here));
        }
        for (other, part) in sum.into_iter().chain(turning).enumerate() {
            let is_driven = data.drives.iter().any(|drive| drive.component == other);
            if !is_driven && elastic.plane != Plane::Axisymmetric {
                along(other, part);
            }
        }
    }
    // The multiplier of an equation is the force along no direction.
    let of_pairs = contacts.iter_mut().zip(&elastic.pairs);
    for (contact, _) in of_pairs.filter(|(_, pair)| pair.kind == EntityKind::Equation) {
        contact.force.fill(0.0);
        contact.moment.fill(0.0);
    }
    // Those of supports are among the forces on supports: they come last.
    let supports = elastic
        .pairs
        .partition_point(|pair| pair.kind != EntityKind::Support);
    // Places of one pool have one pressure.
    let mut seen = HashSet::new();
    for (i, pressure) in fields.pressure.iter().enumerate() {
        let contact = &mut contacts[elastic.pair_of[i] as usize];
        let is_peak = *pressure > PEAK * contact.max_pressure;
        if is_peak && seen.insert(elastic.contact.places[i].pool) {
            contact.peaks += 1;
        }
    }
    contacts.truncate(supports);
    contacts
}

/// The force on the side of a section that ν points away from, and its moment about the centre. It consists of the
/// tension, of the rows across ν, and of those in which a node overlaps by as much as the first.
fn section_forces<const D: usize>(
    elastic: &Elastic<D>,
    solution: &StepSolution<D>,
    rows: Range<usize>,
    tension: f64,
) -> (Vec<f64>, Vec<f64>)
where
    ElementKind: Topology<D>,
{
    let places = &elastic.contact.places;
    let (normal, tangential) = solution.lambda.split_at(places.len());
    let whole = &places[rows.start];
    let mut force = whole.frame[0].map(|nu| tension * nu).to_vec();
    let mut sum = moment(elastic.plane, [0.0; D], [0.0; D]);
    let opposite = &places[rows.start + 1];
    for i in rows.skip(1) {
        let place = &places[i];
        let along = std::iter::once(&normal[i]).chain(&tangential[(D - 1) * i..][..D - 1]);
        for (a, (way, lambda)) in place.frame.iter().zip(along).enumerate() {
            let here = way.map(|v| -lambda * v);
            let is_couple = a == 0 && !place.directed.is_empty();
            let about = if is_couple { opposite } else { whole };
            let arm = minus(place.place, about.place);
            add(&mut sum, &moment(elastic.plane, arm, here));
            if !is_couple {
                add(&mut force, &here);
            }
        }
    }
    (force, sum)
}

/// The forces on the supports: inner forces minus all others at the nodes that they hold. Foundations follow, with their own forces.
/// Large displacements move them; moments are about the centres at rest. With all forces on the nodes.
/// Nodes from `own` on are those of other ranks.
pub(crate) fn support_reports<const D: usize>(
    of: &OfBodies<D>,
    solution: &StepSolution<D>,
    own: usize,
) -> (Vec<SupportReport>, NodalForces<D>)
where
    ElementKind: Space<D>,
{
    let (elastic, data) = (of.elastic, of.data);
    let at_rest = vec![[0.0; D]; elastic.mesh.nodes.len()];
    let mut all = NodalForces {
        loads: data.forces.clone(),
        supports: at_rest.clone(),
        contacts: at_rest,
        points: Vec::new(),
    };
    let is_of_point = |row: usize| {
        let kind = elastic.pairs[elastic.pair_of[row] as usize].kind;
        elastic.is_large() && kind == EntityKind::Coupling
    };
    let mut by_points = all.contacts.clone();
    // Rows of supports report what they carry by themselves.
    let mut by_rows = all.supports.clone();
    let (normal, tangential) = solution.lambda.split_at(elastic.contact.places.len());
    let places = elastic.contact.places.iter().zip(normal).enumerate();
    for ((row, (place, normal)), tangential) in places.zip(tangential.chunks(D - 1)) {
        let pair = elastic.pair_of[row] as usize;
        let to = match elastic.pairs[pair].kind {
            EntityKind::Support => &mut by_rows,
            _ if is_of_point(row) => &mut by_points,
            _ => &mut all.contacts,
        };
        let forces = std::iter::once(normal).chain(tangential);
        for (a, force) in forces.enumerate() {
            for (node, way) in place.terms(a) {
                (0..D).for_each(|c| to[node as usize][c] -= force * way[c]);
            }
        }
    }
    let (body, displacement) = (elastic.body(), &of.fields.displacement);
    let field = |region, x| data.temperature.at(region, x);
    let inner = match elastic.is_large() {
        true => {
            let of = Deformed::new(
                &body,
                displacement,
                (!data.temperature.is_none()).then_some(&field as Temperature<D>),
            );
            let mut inner = of.resistance().forces;
            for (node, _, taken) in data.unknowns.bedding().forces(displacement) {
                (0..D).for_each(|c| inner[node as usize][c] += taken[c]);
            }
            inner
        }
        false => internal_forces(&body, &data.unknowns, displacement),
    };
    let centres = &elastic.support_centres;
    let mut supports: Vec<SupportReport> = (elastic.supports.iter().zip(centres))
        .map(|(name, centre)| SupportReport {
            support: name.clone(),
            force: vec![0.0; D],
            moment: moment(elastic.plane, [0.0; D], [0.0; D]),
            centre: centre.to_vec(),
        })
        .collect();
    let mut carry = |node: u32, number: usize, force: [f64; D]| {
        let support: &mut SupportReport = &mut supports[number];
        add(&mut support.force, &force);
        add(&mut all.supports[node as usize], &force);
        let mut arm = minus(elastic.mesh.nodes[node as usize], centres[number]);
        if elastic.is_large() {
            (0..D).for_each(|c| arm[c] += displacement[node as usize][c]);
        }
        add(&mut support.moment, &moment(elastic.plane, arm, force));
    };
    for &(node, c, number) in &elastic.held {
        let node_of = node as usize;
        let outer = [&all.loads, &all.contacts, &by_rows, &by_points].map(|forces| forces[node_of]);
        let rest = outer.into_iter().fold(inner[node_of], minus);
        let mut force = [0.0; D];
        match data.unknowns.frame(node) {
            None => force[c] = rest[c],
            Some(frame) => force = frame[c].map(|way| dot(frame[c], rest) * way),
        }
        carry(node, number, force);
    }
    for (row, place) in elastic.contact.places.iter().enumerate() {
        let pair = &elastic.pairs[elastic.pair_of[row] as usize];
        if let (EntityKind::Support, Some(node)) = (pair.kind, place.node)
            && (node as usize) < own
        {
            let force = place.frame[0].map(|way| -normal[row] * way);
            carry(node, pair.number, force);
        }
    }
    for (node, number, taken) in data.unknowns.bedding().forces(displacement) {
        carry(node, number, taken.map(|f| -f));
    }
    for driven in data.driven.iter().filter(|driven| is_of_point(driven.row)) {
        let (row, pair) = (driven.row, elastic.pair_of[driven.row]);
        let first = elastic.pair_of.partition_point(|&other| other < pair);
        let drive = &elastic.pairs[pair as usize].drives[row - first];
        let (component, size) = (drive.component, drive.size);
        all.points.push(PointMotion {
            pair,
            component,
            motion: (driven.motion.unwrap_or(0.0) - of.contact.gap[row]) / size,
            forces: [driven.force, -normal[row]].map(|force| force * size),
        });
        for (node, way) in elastic.contact.places[row].terms(0) {
            let load = &mut all.loads[node as usize];
            (0..D).for_each(|c| load[c] -= driven.force * way[c]);
        }
    }
    (supports, all)
}
