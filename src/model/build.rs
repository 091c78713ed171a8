//! From a model to a contact problem.

use super::analysis::Analysis;
use super::contacts::PairData;
use super::error::{Entity, Fault, Kind, ModelError, listed};
use super::loads::{StepData, acting, region};
use super::supports::Prescriptions;
use super::{Definition, Model, Units};
use crate::contact::{ContactRows, Space, contact_rows};
use crate::elasticity::{Body, Material, Plane, Unknowns, assemble};
use crate::mesh::{Kind as ElementKind, Mesh, Topology};
use crate::problem::{ContactData, ContactProblem, LoadCase};
use std::time::Instant;

/// A model that is ready to be solved: the contact problem, and the bodies that it is about.
#[derive(Debug)]
pub struct Built<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The problem with the load of the first step.
    pub problem: ContactProblem<D>,
    /// What it is about.
    pub elastic: Elastic<D>,
}

/// The elastic side of a problem: what the results are written on.
#[derive(Debug)]
pub struct Elastic<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The mesh of all bodies.
    pub mesh: Mesh<D>,
    /// One per region.
    pub materials: Vec<Material>,
    /// Plane strain or plane stress; in space plane strain, which has the same moduli.
    pub plane: Plane,
    /// Thickness in m; 1 in space.
    pub thickness: f64,
    /// The numbering of the unknowns, with the prescribed displacements of the first step.
    pub unknowns: Unknowns<D>,
    /// What supports prescribe: node, component (along the directions that [`Unknowns::frame`] gives the node, if any),
    /// number of the support that does so first.
    pub held: Vec<(u32, usize, usize)>,
    /// The boundary or point of each support.
    pub supports: Vec<String>,
    /// The centroid of the boundaries of each support, or its point.
    pub support_centres: Vec<[f64; D]>,
    /// The rows of N and T with their contact nodes.
    pub contact: ContactRows<D>,
    /// The contacts of the model, in its order.
    pub pairs: Vec<PairData<D>>,
    /// Which pair each row belongs to.
    pub pair_of: Vec<u32>,
    /// What lengths and forces are called.
    pub units: Units,
    /// Whether the model says so itself.
    pub units_stated: bool,
    /// Seconds for K, f and the contact rows.
    pub assembly_seconds: f64,
    /// The part of it for the search and the integrals of the contacts.
    pub pairing_seconds: f64,
    /// What the load of each step follows from.
    pub(super) definition: Definition<D>,
    pub(super) prescriptions: Prescriptions<D>,
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Topology<D>,
{
    /// The body as the elasticity functions want it.
    pub fn body(&self) -> Body<'_, D> {
        Body {
            mesh: &self.mesh,
            materials: &self.materials,
            plane: self.plane,
            thickness: self.thickness,
        }
    }

    /// Number of load steps.
    pub fn n_steps(&self) -> usize {
        self.definition.n_steps()
    }
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

impl<const D: usize> Model<D>
where
    ElementKind: Space<D>,
{
    /// Checks the model and assembles its contact problem.
    ///
    /// # Errors
    /// If the model cannot be meant: the error names the part at fault.
    pub fn build(self) -> Result<Built<D>, ModelError> {
        let start = Instant::now();
        let Self { mesh, definition } = self;
        definition.check()?;
        let materials = definition.materials(&mesh)?;
        let body = Body {
            mesh: &mesh,
            materials: &materials,
            plane: definition.plane,
            thickness: definition.thickness,
        };
        let prescriptions = definition.prescriptions(&mesh)?;
        let unknowns = definition.unknowns(&mesh, &prescriptions, 0)?;
        if unknowns.n_free() == 0 {
            return Err(Entity::all(Kind::Support)
                .error("the supports hold every node: nothing is left to solve"));
        }
        let forces = definition.forces(&body, 0)?;

        let pairing = Instant::now();
        let mut candidates = definition.candidates(&body)?;
        let pairing_seconds = pairing.elapsed().as_secs_f64();
        let contact = contact_rows(&body, &unknowns, &candidates.places)
            .map_err(|error| Entity::all(Kind::Contact).error(Fault::Contact(error)))?;
        let pair_of: Vec<u32> = (contact.candidate.iter())
            .map(|&i| candidates.pair_of[i])
            .collect();
        definition.foresee(&mesh, &prescriptions, &unknowns, &contact)?;
        definition.count_places(&contact, &pair_of, &mut candidates.pairs)?;

        let support_centres = definition.support_centres(&body, &prescriptions);
        let problem = problem(&body, &unknowns, &forces, &contact)?;
        let mut elastic = Elastic {
            plane: definition.plane,
            thickness: definition.thickness,
            unknowns,
            held: prescriptions.held(),
            supports: definition.supports.iter().map(|s| s.name()).collect(),
            support_centres,
            contact,
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
        let analysis = Analysis {
            problem: &problem,
            elastic: Some(&elastic),
        };
        if let Some(text) = analysis.loose_body() {
            return Err(Entity::all(Kind::Support)
                .error(format!("{text}: add a support, symmetry, or hold a point")));
        }
        elastic.assembly_seconds = start.elapsed().as_secs_f64();
        Ok(Built { problem, elastic })
    }
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
    let failed = |error| Entity::all(Kind::Model).error(Fault::Problem(error));
    // A prescribed motion may have closed a gap, and an interference is meant: what overlaps by mistake, the search for
    // contact nodes has refused.
    let problem = ContactProblem::of_bodies(ContactData {
        stiffness,
        load: load.clone(),
        normal: contact.normal.clone(),
        tangential: contact.tangential.clone(),
        gap: (contact.places.iter())
            .map(|place| place.gap.max(0.0))
            .collect(),
        slip_bound: contact.slip_bound.clone(),
        coordinates: Some(unknowns.coordinates(body.mesh)),
    })
    .map_err(failed)?
    .with_free_unknowns(unknowns.n_free());
    let zero = vec![0.0; (D - 1) * problem.m()];
    problem
        .with_areas(contact.pooled_areas())
        .map_err(failed)?
        .under(LoadCase {
            acting: acting(forces),
            ..LoadCase::new(
                load,
                contact.gap(unknowns),
                zero,
                contact.slip_bound.clone(),
            )
        })
        .with_friction_coefficient(contact.coefficient.clone())
        .map_err(failed)
}

impl<const D: usize> Definition<D>
where
    ElementKind: Topology<D>,
{
    /// The material of each region.
    fn materials(&self, mesh: &Mesh<D>) -> Result<Vec<Material>, ModelError> {
        // With the name that has brought it.
        let mut found: Vec<Option<(Material, &str)>> = vec![None; mesh.regions.len()];
        for (number, (region_name, material)) in self.materials.iter().enumerate() {
            let at_fault = |fault: Fault| self.material_entity(number).error(fault);
            let Some(name) = region_name else {
                if self.materials.len() == 1 {
                    found.fill(Some((*material, "")));
                    continue;
                }
                return Err(at_fault(Fault::Stated(format!(
                    "with several materials each needs its region: {}",
                    listed(mesh.groups.keys())
                ))));
            };
            for &region in region(mesh, name).map_err(at_fault)? {
                let before = found[region as usize].replace((*material, name));
                let message = match before {
                    Some((_, other)) if other == name => {
                        format!("region \"{name}\" has two materials")
                    }
                    Some((old, other)) if old != *material => format!(
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
        let regions = found.iter().zip(&mesh.regions);
        regions
            .map(|(material, name)| match material {
                Some((material, _)) => Ok(*material),
                None => {
                    Err(Entity::all(Kind::Material)
                        .error(format!("region \"{name}\" has no material")))
                }
            })
            .collect()
    }
}
