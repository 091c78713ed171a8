//! The bodies of a model ready to be solved.

#[cfg(feature = "mpi")]
use super::Quantity;
use super::contacts::{PairData, Sliding};
use super::large::{Glue, LooseBody};
use super::supports::Prescriptions;
use super::{Axis, Definition, Units};
use crate::contact::{ContactPlace, ContactRows};
use crate::elasticity::{Body, Material, Plane, Unknowns};
use crate::mesh::vector::dot;
use crate::mesh::{ElementKind, Mesh, Topology};
use std::collections::HashMap;

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
    /// On a rank, [`Elastic::at_nodes`] and [`Elastic::turn_to`] where sectors repeat themselves: it does not know their sides. Empty
    /// else.
    pub(super) at_nodes: Vec<(u32, u32, f64)>,
    pub(super) turns: HashMap<(u32, u32), [[f64; D]; D]>,
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Topology<D>,
{
    /// The nodes at which contact places are, with their parts in them: place, node, part. Both nodes on the sides of a sector, and a
    /// node that is the place more than any other.
    pub fn at_nodes(&self) -> Vec<(u32, u32, f64)> {
        if !self.at_nodes.is_empty() {
            return self.at_nodes.clone();
        }
        let count = self.mesh.nodes.len();
        let each = (0..).zip(&self.contact.places).flat_map(|(i, place)| {
            let own = place.own.iter().filter(|own| own.1 > 0.0);
            own.flat_map(move |&(image, weight)| {
                let part = match place.node == Some(image) {
                    true => f64::INFINITY,
                    false => weight,
                };
                place
                    .nodes_of(image, count)
                    .map(move |node| (i, node, part))
            })
        });
        each.collect()
    }

    /// The turn of the vectors of contact place i to a node at which it is, beyond the side of a sector.
    pub fn turn_to(&self, i: usize, node: u32) -> Option<[[f64; D]; D]> {
        let known = self.turns.get(&(i as u32, node)).copied();
        known.or_else(|| self.contact.places[i].turn_to(node, self.mesh.nodes.len()))
    }

    /// A vector of contact place i as it is at one of these nodes.
    pub fn turned_to(&self, i: usize, node: u32, v: [f64; D]) -> [f64; D] {
        let turn = self.turn_to(i, node);
        turn.map_or(v, |turn| turn.map(|row| dot(row, v)))
    }

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
