//! From a model to a contact problem.

use super::analysis::{Analysis, AnyAnalysis};
use super::contacts::Sliding;
use super::elastic::Elastic;
use super::entities::Part as _;
use super::error::{Entity, EntityKind, Fault, ModelError, listed};
use super::large::LooseBody;
use super::loads::{StepData, acting, end_of, region};
use super::preload::Section;
use super::{Cyclic, Definition, Model, Pair};
use crate::contact::{ContactRows, Space, rows_of};
use crate::elasticity::{Body, Material, Unknowns, assemble, vertices};
use crate::mesh::{Cut, ElementKind, Mesh, Topology};
use crate::problem::{ContactData, ContactProblem, LoadCase, Vertices};
use crate::sparse::BlockCsr;
use std::collections::{HashMap, HashSet};
use web_time::Instant;

/// A model ready to be solved: the contact problem, and its bodies.
#[derive(Debug)]
pub struct Built<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The problem with the load of the first step.
    pub problem: ContactProblem<D>,
    /// Its bodies.
    pub elastic: Elastic<D>,
}

impl<const D: usize> Built<D>
where
    ElementKind: Space<D>,
{
    /// Number of load steps.
    pub fn n_steps(&self) -> usize {
        self.elastic.n_steps()
    }

    /// The load at the end of a step, counted from 0: [`Elastic::step`].
    pub fn step(&self, step: usize) -> Result<StepData<D>, ModelError> {
        self.elastic.step(step)
    }
}

impl<'a, const D: usize> From<&'a Built<D>> for Analysis<'a, D>
where
    ElementKind: Topology<D>,
{
    fn from(built: &'a Built<D>) -> Self {
        Self {
            problem: &built.problem,
            elastic: Some(&built.elastic),
        }
    }
}

/// A [`Built`] model of either dimension, for those who learn it at run time.
#[derive(Debug)]
pub enum AnyBuilt {
    /// Of the plane.
    Plane(Built),
    /// Of space.
    Space(Built<3>),
}

impl<'a> From<&'a AnyBuilt> for AnyAnalysis<'a> {
    fn from(built: &'a AnyBuilt) -> Self {
        match built {
            AnyBuilt::Plane(built) => Self::Plane(built.into()),
            AnyBuilt::Space(built) => Self::Space(built.into()),
        }
    }
}

/// A checked model, with all of its contact problem except K.
#[cfg(feature = "mpi")]
#[derive(Debug)]
pub struct Draft<const D: usize = 2>(pub(crate) Box<Elastic<D>>)
where
    ElementKind: Topology<D>;

#[cfg(feature = "mpi")]
impl<const D: usize> Draft<D>
where
    ElementKind: Topology<D>,
{
    /// The bodies with their contacts.
    pub fn elastic(&self) -> &Elastic<D> {
        &self.0
    }
}

impl<const D: usize> Model<D>
where
    ElementKind: Space<D>,
{
    /// Checks the model and assembles its contact problem.
    ///
    /// # Errors
    /// If the model is inconsistent: the error names the part at fault.
    pub fn build(self) -> Result<Built<D>, ModelError> {
        let start = Instant::now();
        let (mut elastic, forces) = self.draft()?;
        let of = |elastic: &Elastic<D>| {
            let (unknowns, contact) = (&elastic.unknowns, &elastic.contact);
            problem(&elastic.body(), unknowns, &forces, contact)
        };
        let mut problem = of(&elastic)?;
        if elastic.is_large() && elastic.glue(&problem) {
            problem = of(&elastic)?;
        }
        let analysis = Analysis {
            problem: &problem,
            elastic: Some(&elastic),
        };
        if let Some(text) = analysis.loose_body() {
            return Err(loose(&text));
        }
        if elastic.is_large() {
            let bodies = problem.floating_bodies().bodies().iter();
            elastic.loose = bodies.map(|body| LooseBody::new(&elastic, body)).collect();
        }
        elastic.assembly_seconds = start.elapsed().as_secs_f64();
        Ok(Built { problem, elastic })
    }

    /// Checks the model and makes all of its contact problem but K, for several ranks to share ([`crate::mpi::Share::of_model`]).
    ///
    /// # Errors
    /// As [`Model::build`].
    #[cfg(feature = "mpi")]
    pub fn into_draft(self) -> Result<Draft<D>, ModelError> {
        if self.definition.is_large() {
            return Err(Entity::all(EntityKind::Model).error(
                "several ranks need geometry = \"small\": solve large displacements in one process",
            ));
        }
        if let Some(i) = (self.definition.couplings.iter()).position(|one| one.is_bare()) {
            return Err(self.definition.couplings[i].entity(i).error(
                "several ranks cannot move obstacles without nodes of bodies yet: solve the model in one process, or fix the obstacles \
                 to a boundary",
            ));
        }
        const ALONE: &str = "needs one process: it is not known on several ranks yet";
        let pairs = &self.definition.pairs;
        if let Some(i) = pairs.iter().position(|pair| pair.wear.is_some()) {
            let entity = pairs[i].entity(i).at("wear");
            return Err(entity.error(format!("wear {ALONE}")));
        }
        if self.definition.cycles().count > 1 {
            let steps = Entity::all(EntityKind::Steps).at("cycles");
            return Err(steps.error(format!("more than one cycle of load steps {ALONE}")));
        }
        let start = Instant::now();
        let (mut elastic, _) = self.draft()?;
        elastic.assembly_seconds = start.elapsed().as_secs_f64();
        Ok(Draft(Box::new(elastic)))
    }

    /// Everything except K: the bodies and their contacts, checked, and the nodal forces of the first step.
    pub(crate) fn draft(self) -> Result<(Elastic<D>, Vec<[f64; D]>), ModelError> {
        let Self {
            mut mesh,
            mut definition,
        } = self;
        definition.check()?;
        definition.hold_axis(&mut mesh)?;
        // Values at nodes belong to the mesh as it was.
        definition.place_values(&mesh)?;
        let mut cuts = Vec::new();
        for (number, preload) in definition.preloads.iter().enumerate() {
            let cut = preload.cut(&mut mesh);
            let cut = cut.map_err(|fault| preload.entity(number).error(fault))?;
            let crosses = |other: &(Cut<D>, _)| {
                let nodes: HashSet<u32> = other.0.nodes.iter().flatten().copied().collect();
                cut.0.nodes.iter().any(|[node, _]| nodes.contains(node))
            };
            if cuts.iter().any(crosses) {
                return Err(preload.entity(number).error(
                    "its section meets that of another preload: sections have no node in common",
                ));
            }
            cuts.push(cut);
        }
        definition.add_carriers(&mut mesh);
        let materials = definition.materials(&mesh)?;
        match definition.is_large() {
            true => definition.check_large()?,
            false => definition.check_small()?,
        }
        let body = Body {
            mesh: &mesh,
            materials: &materials,
            plane: definition.plane(),
            thickness: definition.thickness(),
        };
        definition.sections = (cuts.into_iter().map(|cut| Section::new(&body, cut))).collect();
        let prescriptions = definition.prescriptions(&body)?;
        let unknowns = definition.unknowns(&mesh, &prescriptions, end_of(0))?;
        if unknowns.n_free() == 0 {
            return Err(Entity::all(EntityKind::Support)
                .error("the supports hold every node: nothing is left to solve"));
        }
        let forces = definition.forces(&body, end_of(0))?;

        let pairing = Instant::now();
        let mut candidates = definition.candidates(&body, &unknowns)?;
        let pairing_seconds = pairing.elapsed().as_secs_f64();
        let pairs: Vec<&Pair<D>> = definition.pairs.iter().chain(&definition.ties).collect();
        let acts = |number: usize| {
            let pair = pairs.get(candidates.pair_of[number] as usize);
            pair.is_none_or(|pair| (0..definition.n_steps()).any(|step| pair.acts(step)))
        };
        let contact = rows_of(&body, &unknowns, &candidates.places, acts)
            .map_err(|error| Entity::all(EntityKind::Contact).error(Fault::Contact(error)))?;
        let pair_of: Vec<u32> = (contact.candidate.iter())
            .map(|&i| candidates.pair_of[i])
            .collect();
        let is_met: HashSet<u32> = candidates.pair_of.iter().copied().collect();
        let (mut kept, mut sliding) = (Vec::new(), Sliding::default());
        match definition.is_large() {
            true => {
                definition.state_sliding(&body, &mut candidates)?;
                sliding = candidates.sliding;
                kept.extend(candidates.places.into_iter().zip(candidates.pair_of));
            }
            false => {
                let of = (&candidates.pairs[..], &pair_of[..]);
                let all = &candidates.pair_of;
                definition.foresee(&mesh, &prescriptions, &unknowns, &contact, of, all)?;
            }
        }
        definition.count_places(&mesh, &contact, &pair_of, &is_met, &mut candidates.pairs)?;

        let support_centres = definition.support_centres(&body);
        let elastic = Elastic {
            plane: definition.plane(),
            thickness: definition.thickness(),
            sectors: definition.cyclics.iter().find_map(Cyclic::shown),
            unknowns,
            held: prescriptions.held(),
            supports: definition.held_by(),
            support_centres,
            contact,
            candidates: kept,
            sliding,
            loose: Vec::new(),
            glued: Vec::new(),
            at_nodes: Vec::new(),
            turns: HashMap::new(),
            pairs: candidates.pairs,
            pair_of,
            units: definition.units(),
            units_stated: definition.units.is_some(),
            assembly_seconds: 0.0,
            pairing_seconds,
            mesh,
            materials,
            definition,
            prescriptions,
        };
        Ok((elastic, forces))
    }
}

/// The error that a body can move as a whole and has no contact to hold it.
pub(super) fn loose(text: &str) -> ModelError {
    Entity::all(EntityKind::Support)
        .error(format!("{text}: add a support, symmetry, or hold a point"))
}

/// The contact problem under the nodal forces and prescribed displacements of the first step.
fn problem<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    forces: &[[f64; D]],
    contact: &ContactRows<D>,
) -> Result<ContactProblem<D>, ModelError>
where
    ElementKind: Space<D>,
{
    let (stiffness, load) = assemble(body, unknowns, forces);
    let points = (unknowns.coordinates(body.mesh), vertices(body, unknowns));
    let problem = problem_of(stiffness, load, acting(forces), points, unknowns, contact)?;
    Ok(problem.with_poisson(body.poisson()))
}

/// The contact problem with this K and f, the positions of its unknowns, and the dependence of second-order nodes on their corners.
pub(super) fn problem_of<const D: usize>(
    stiffness: BlockCsr<D>,
    load: Vec<f64>,
    acting: f64,
    (coordinates, vertices): (Vec<[f64; D]>, Option<Vertices<D>>),
    unknowns: &Unknowns<D>,
    contact: &ContactRows<D>,
) -> Result<ContactProblem<D>, ModelError>
where
    ElementKind: Space<D>,
{
    let failed = |error| Entity::all(EntityKind::Model).error(Fault::Problem(error));
    // A prescribed motion may close a gap, and an interference is intended; accidental overlaps were refused by the
    // search for contact nodes.
    let data = ContactData {
        stiffness,
        load: load.clone(),
        normal: contact.normal.clone(),
        tangential: contact.tangential.clone(),
        gap: (contact.places.iter())
            .map(|place| place.gap.max(0.0))
            .collect(),
        // Ties have none: below.
        slip_bound: (contact.slip_bound.iter())
            .map(|&g| if g.is_finite() { g } else { 0.0 })
            .collect(),
        coordinates: Some(coordinates),
    };
    let problem = ContactProblem::of_bodies(data, contact.compliance.clone(), &contact.tied())
        .map_err(failed)?
        .with_free_unknowns(unknowns.n_free());
    let problem = match vertices {
        Some(vertices) => problem.with_vertices(vertices),
        None => problem,
    };
    let zero = vec![0.0; (D - 1) * problem.m()];
    problem
        .with_areas(contact.pooled_areas())
        .map_err(failed)?
        .under(LoadCase::new(
            load,
            acting,
            contact.gap(unknowns),
            zero,
            contact.slip_bound.clone(),
        ))
        .with_friction_coefficient(contact.coefficient.clone())
        .map_err(failed)
}

impl<const D: usize> Definition<D>
where
    ElementKind: Topology<D>,
{
    /// The material of each region.
    fn materials(&self, mesh: &Mesh<D>) -> Result<Vec<Material>, ModelError> {
        if self.materials.is_empty() {
            return Err(Entity::all(EntityKind::Material).error("there is no material"));
        }
        // With the name that has brought it.
        let mut found: Vec<Option<(Material, &str)>> = vec![None; mesh.regions.len()];
        for (number, filling) in self.materials.iter().enumerate() {
            let at_fault = |fault: Fault| filling.entity(number).error(fault);
            let material = filling.material();
            let Some(names) = &filling.region else {
                if self.materials.len() == 1 {
                    found.fill(Some((material, "")));
                    continue;
                }
                return Err(at_fault(Fault::Stated(format!(
                    "with several materials each needs its region: {}",
                    listed(mesh.groups.keys())
                ))));
            };
            for name in names.all() {
                for &region in region(mesh, name).map_err(at_fault)? {
                    let before = found[region as usize].replace((material, name));
                    let message = match before {
                        Some((_, other)) if other == name => {
                            format!("region \"{name}\" has two materials")
                        }
                        Some((old, other)) if old != material => format!(
                            "regions \"{other}\" and \"{name}\" overlap: \"{}\" would have two materials; give both the \
                         same, or groups that share no {}",
                            mesh.regions[region as usize],
                            if D == 2 { "surface" } else { "volume" }
                        ),
                        _ => continue,
                    };
                    return Err(at_fault(Fault::Stated(message)));
                }
            }
        }
        let regions = found.iter().zip(&mesh.regions);
        regions
            .map(|(material, name)| match material {
                Some((material, _)) => Ok(*material),
                None => Err(Entity::all(EntityKind::Material)
                    .error(format!("region \"{name}\" has no material"))),
            })
            .collect()
    }
}
