//! The bodies of a model ready to be solved.

#[cfg(feature = "mpi")]
use super::Quantity;
use super::contacts::{PairData, Sliding};
use super::large::{Glue, LooseBody};
use super::supports::Prescriptions;
use super::{Axis, Definition, Units};
use crate::contact::{ContactPlace, ContactRows};
use crate::elasticity::{Body, Material, Plane, Unknowns};
use crate::mesh::{ElementKind, Mesh, Topology};

/// The elastic side of a problem: the basis of its results.
#[derive(Clone, Debug)]
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
    /// Prescribed components: node, component (along the directions that [`Unknowns::frame`] gives the node, if any),
    /// number of the support that prescribes it first.
    pub held: Vec<(u32, usize, usize)>,
    /// The name, boundary or point of each support; after them those of foundations.
    pub supports: Vec<String>,
    /// The centroid of the boundaries of each support, or its point; after them those of foundations.
    pub support_centres: Vec<[f64; D]>,
    /// The rows of N and T with their contact nodes.
    pub contact: ContactRows<D>,
    /// The contacts of the model, in its order.
    pub pairs: Vec<PairData<D>>,
    /// The pair of each row.
    pub pair_of: Vec<u32>,
    /// The names of lengths and forces.
    pub units: Units,
    /// Whether the model states them itself.
    pub units_stated: bool,
    /// Seconds for K, f and the contact rows.
    pub assembly_seconds: f64,
    /// The part of it for the search and the integrals of the contacts.
    pub pairing_seconds: f64,
    /// The axis and the number of sectors, if results show all of them.
    #[cfg_attr(not(feature = "files"), allow(dead_code))]
    pub(crate) sectors: Option<(Axis<D>, u32)>,
    /// The source of the load of each step.
    pub(super) definition: Definition<D>,
    pub(super) prescriptions: Prescriptions<D>,
    /// All places of contact at rest, each with its pair, for large displacements: the positions of the bodies determine which
    /// of them have rows.
    pub(super) candidates: Vec<(ContactPlace<D>, u32)>,
    /// For contact of bodies whose displacements are large.
    pub(super) sliding: Sliding<D>,
    /// The bodies that can move as a whole, where displacements are large.
    pub(crate) loose: Vec<LooseBody>,
    /// The ties that are a part of K there.
    pub(super) glued: Vec<Glue>,
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

    /// Whether displacements may be large.
    pub fn is_large(&self) -> bool {
        self.definition.is_large()
    }

    /// Number of load steps.
    pub fn n_steps(&self) -> usize {
        self.definition.n_steps()
    }

    /// The value of each temperature at the factor 1.
    #[cfg(feature = "mpi")]
    pub(crate) fn temperatures(&self) -> Vec<Quantity<D>> {
        let all = self.definition.temperatures.iter();
        all.map(|temperature| temperature.value.clone()).collect()
    }
}
