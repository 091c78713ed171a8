//! Meshes with named regions and boundaries.
//!
//! [`Mesh`] is a mesh of the plane, with triangles and quadrilaterals, `Mesh<3>` one of space, with tetrahedra, hexahedra,
//! wedges and pyramids, of first and of second order. Everything is written for both dimensions; their differences are in
//! `mesh/plane.rs` and `mesh/solid.rs`, and `mesh/shape` has the shape functions of each kind.

pub(crate) mod abaqus;
mod boundary;
mod copies;
mod cut;
mod element;
mod file;
pub(crate) mod foot;
pub mod gmsh;
mod groups;
mod order;
mod plane;
mod read;
pub(crate) mod shape;
mod solid;
pub mod structured;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod vector;
#[cfg(feature = "files")]
mod vtu;

pub(crate) use cut::{Between, Cut};
#[cfg(feature = "plots")]
pub(crate) use element::edge_parts;
pub(crate) use element::nodes_of_facets;
pub use element::{Element, ElementKind, Facet, Topology, facet, facet_corners, facet_nodes};
pub(crate) use element::{border, face_parts, face_ring, facet_parts, unsided};
pub use file::FileError;
pub use gmsh::write::msh;
pub(crate) use groups::Groups;
pub use read::{has_cell_arrays, read, read_linear};
use shape::determinant;
pub use shape::{FacetPoint, Point, ShapeFunctions, Visit};
pub(crate) use vector::bounds;
use vector::minus;

use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt;
use std::sync::atomic::{AtomicBool, Ordering};

/// A mesh in D dimensions: nodes (coordinates in metres, or the user's unit of length), elements, and named parts.
#[derive(Clone, Debug)]
pub struct Mesh<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// Coordinates, one row per node.
    pub nodes: Vec<[f64; D]>,
    /// Elements; every node belongs to at least one.
    pub elements: Vec<Element<D>>,
    /// Names of the regions that [`Element::region`] counts: each element is in one.
    pub regions: Vec<String>,
    /// The regions behind each name: every region under its own name, and groups of them that may overlap.
    pub groups: BTreeMap<String, Vec<u32>>,
    /// Named boundaries. In the plane they are edges (from, to) with the body on the left, so that the outward normal
    /// points right. In space they are faces with corners counter-clockwise as seen from outside. Those listed in
    /// [`Self::faults`] also hold facets between elements, which have no outward normal: [`Mesh::outer_facets`] and
    /// [`Mesh::facets`] check for them.
    pub boundaries: BTreeMap<String, Vec<Facet<D>>>,
    /// Named sets of nodes, each sorted and without repeats, whether or not they make up facets: node sets of an Abaqus input
    /// file, physical points of a Gmsh file.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// The faults of boundaries that are not entirely on the outside of the body.
    pub faults: BTreeMap<String, FacetFault<D>>,
    /// Entries of its file that have no effect, and parts that were not counted.
    pub notes: Vec<String>,
    /// The node behind a cut that each node in front of it has been.
    pub(crate) twins: BTreeMap<u32, u32>,
    /// How many nodes sets have lost, because no element has them.
    pub(crate) lost: BTreeMap<String, usize>,
}

/// The parts of a [`Mesh`]: see its fields.
#[derive(Clone, Debug)]
pub struct MeshParts<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// Coordinates; nodes that no element uses are left out of the mesh.
    pub nodes: Vec<[f64; D]>,
    /// Elements; copies of an element on the same nodes count once, in the groups of all of them.
    pub elements: Vec<Element<D>>,
    /// Names of the regions.
    pub regions: Vec<String>,
    /// Groups of regions, including every region under its own name; if empty, each region is its own group.
    pub groups: BTreeMap<String, Vec<u32>>,
    /// Boundaries, their facets named from either side.
    pub boundaries: BTreeMap<String, Vec<Facet<D>>>,
    /// Sets of nodes.
    pub node_sets: BTreeMap<String, Vec<u32>>,
    /// Remarks on it.
    pub notes: Vec<String>,
}

/// A mesh of either dimension: which one may show only when a file is read.
#[derive(Clone, Debug)]
pub enum AnyMesh {
    /// A plane mesh.
    Plane(Mesh),
    /// A mesh of space.
    Space(Mesh<3>),
}

/// The worst that the facets of a boundary have, and the first facet that has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FacetFault<const D: usize = 2> {
    /// Its kind.
    pub kind: FaultKind,
    /// The coordinates of two nodes of the facet: both ends of an edge, two corners of a face. A boundary
    /// without facets has zeros here.
    pub ends: [[f64; D]; 2],
}

/// The reason why a facet is not an outer facet of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultKind {
    /// There are elements on both sides: an interface.
    Inside,
    /// No element has it: a construction line or surface. It is not in [`Mesh::boundaries`].
    Stray,
    /// A set of nodes that contains all corners of no outer facet.
    NoFacet,
    /// A boundary without any facet.
    Empty,
}

impl<const D: usize> fmt::Display for FacetFault<D> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [from, to] = self.ends.map(Location::from);
        let (which, a_facet, no_facet) = match D {
            2 => ("edge from", "an edge", "both ends of no outer edge"),
            _ => (
                "face with corners from",
                "a face",
                "all corners of no outer face",
            ),
        };
        match self.kind {
            FaultKind::Inside => write!(
                f,
                "its {which} {from} to {to} lies between elements, not on the outside of the body"
            ),
            FaultKind::Stray => {
                write!(
                    f,
                    "its {which} {from} to {to} is not {a_facet} of any element"
                )
            }
            FaultKind::NoFacet => {
                write!(f, "a set of nodes, with one at {from}, that has {no_facet}")
            }
            FaultKind::Empty => f.write_str("it has no facet"),
        }
    }
}

/// The location of a fault, in any dimension, for messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Location(
    /// The coordinates.
    pub Vec<f64>,
);

impl<const D: usize> From<[f64; D]> for Location {
    fn from(x: [f64; D]) -> Self {
        Self(x.to_vec())
    }
}

impl fmt::Display for Location {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let coordinates: Vec<String> = self.0.iter().map(|x| format!("{x:.6e}")).collect();
        write!(f, "({})", coordinates.join(", "))
    }
}

/// A mesh does not have the boundary that is needed.
#[derive(Debug, thiserror::Error)]
pub enum BoundaryError {
    /// No boundary has the name.
    #[error("there is no boundary \"{0}\"")]
    Unknown(String),
    /// It has facets that it must not have.
    #[error("boundary \"{name}\": {fault}")]
    Faulty {
        /// The boundary.
        name: String,
        /// The worst kind of fault among its facets.
        kind: FaultKind,
        /// The facet at fault, and the remedy.
        fault: String,
    },
}

/// A fault of a mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    /// There is nothing to compute.
    #[error("the mesh has no elements")]
    Empty,
    /// An element names a node that does not exist.
    #[error("element {element} names node {node}, but there are only {n_nodes} nodes")]
    NoSuchNode {
        /// The element.
        element: usize,
        /// The number that it names.
        node: u32,
        /// The number of nodes.
        n_nodes: usize,
    },
    /// A coordinate is infinite or NaN.
    #[error("node {0} has a coordinate that is not finite")]
    NotFinite(usize),
    /// An element has no area (volume), or a corner that turns inwards.
    #[error(
        "element {element} near {place} has no {} or folds over itself: repair it in the mesher",
        if place.0.len() == 2 { "area" } else { "volume" }
    )]
    Degenerate {
        /// The element.
        element: usize,
        /// Its first node.
        place: Location,
    },
    /// The map of an element of second order folds because of the positions of its midside nodes.
    #[error(
        "element {element} near {place} folds over itself, because nodes in the middle of its sides are too far from \
         there: {}",
        if *other_order {
            "they are probably listed in the order of another program (Gmsh and VTK differ)"
        } else {
            "repair it in the mesher, or leave these nodes out (order = 1)"
        }
    )]
    Folded {
        /// The element.
        element: usize,
        /// Its first node.
        place: Location,
        /// Whether it would not fold if its nodes were listed as another program does.
        other_order: bool,
    },
    /// An edge has a node in its middle in one element, and none in another.
    #[error(
        "element {quadratic} has a midside node on the edge near {place}, but its neighbour {linear} has none there: \
         mesh a body with elements of one order, or leave midside nodes out (order = 1)"
    )]
    Hanging {
        /// The element without it.
        linear: usize,
        /// The element with it.
        quadratic: usize,
        /// The middle of the edge.
        place: Location,
    },
    /// Two neighbours each have a separate node in the middle of their common edge or face.
    #[error(
        "elements {} and {} share the edge or face near {place}, but not the node in its middle: merge coincident \
         nodes in the mesher, or leave midside nodes out (order = 1)",
        elements[0], elements[1]
    )]
    TwoMiddles {
        /// The elements.
        elements: [usize; 2],
        /// The middle of the edge or face.
        place: Location,
    },
    /// Two elements share a facet and are on the same side of it.
    #[error(
        "elements {} and {} overlap: both lie on the same side of the {} near {place} that they share. Delete one of them in the \
         mesher, or the copy of the body that it belongs to",
        elements[0], elements[1], if place.0.len() == 2 { "edge" } else { "face" }
    )]
    Overlap {
        /// The elements.
        elements: [usize; 2],
        /// The middle of the edge or face.
        place: Location,
    },
    /// No element of second order exists for this element of first order.
    #[error(
        "element {element} near {place} is a pyramid, and pyramids of second order are not supported: leave out order \
         = 2, or use tetrahedra alone, or hexahedra and wedges"
    )]
    NotRaised {
        /// The element.
        element: usize,
        /// Its first node.
        place: Location,
    },
    /// An element names a region that does not exist.
    #[error("element {element} is in region {region}, but there are only {n_regions} regions")]
    NoSuchRegion {
        /// The element.
        element: usize,
        /// The number that it names.
        region: u32,
        /// The number of regions.
        n_regions: usize,
    },
    /// A boundary names a node that does not exist.
    #[error("boundary \"{name}\" names node {node}, but there are only {n_nodes} nodes")]
    NoSuchBoundaryNode {
        /// The boundary.
        name: String,
        /// The number that it names.
        node: u32,
        /// The number of nodes.
        n_nodes: usize,
    },
    /// A set of nodes names one that does not exist.
    #[error("set of nodes \"{name}\" names node {node}, but there are only {n_nodes} nodes")]
    NoSuchSetNode {
        /// The set.
        name: String,
        /// The number that it names.
        node: u32,
        /// The number of nodes.
        n_nodes: usize,
    },
}

impl<const D: usize> Mesh<D>
where
    ElementKind: Topology<D>,
{
    /// A mesh from nodes, elements, the names of regions and boundaries: [`Self::from_parts`] without groups and sets of nodes.
    ///
    /// # Errors
    /// As there.
    pub fn new(
        nodes: Vec<[f64; D]>,
        elements: Vec<Element<D>>,
        regions: Vec<String>,
        boundaries: BTreeMap<String, Vec<Facet<D>>>,
    ) -> Result<Self, MeshError> {
        Self::from_parts(MeshParts {
            nodes,
            elements,
            regions,
            boundaries,
            groups: BTreeMap::new(),
            node_sets: BTreeMap::new(),
            notes: Vec::new(),
        })
    }

    /// A mesh from its parts. It checks them, reverses elements with the wrong orientation, and counts copies of
    /// elements once. It gives serendipity elements mid-face nodes where neighbours have them, and drops nodes that no
    /// element uses. It orients the facets of boundaries so that the body is behind them. Boundaries may have facets
    /// that are not on the outside: [`Self::faults`] lists them.
    ///
    /// # Errors
    /// If elements or boundaries refer to missing nodes or regions, elements have no area (volume), fold over themselves or
    /// overlap, or neighbours do not share the nodes between them.
    pub fn from_parts(parts: MeshParts<D>) -> Result<Self, MeshError> {
        Self::checked(parts, true)
    }

    /// [`Self::from_parts`], where elements may have copies or have none.
    fn checked(parts: MeshParts<D>, may_have_copies: bool) -> Result<Self, MeshError> {
        let mut mesh = Self {
            nodes: parts.nodes,
            elements: parts.elements,
            regions: parts.regions,
            groups: parts.groups,
            boundaries: parts.boundaries,
            node_sets: parts.node_sets,
            faults: BTreeMap::new(),
            notes: parts.notes,
            twins: BTreeMap::new(),
            lost: BTreeMap::new(),
        };
        if mesh.groups.is_empty() {
            mesh.group_regions();
        }
        for set in mesh.node_sets.values_mut() {
            set.sort_unstable();
            set.dedup();
        }
        mesh.check()?;
        let elements = mesh.elements.par_iter_mut().enumerate();
        let faults =
            elements.filter_map(|(number, element)| orient(element, &mesh.nodes, number).err());
        if let Some(first) = faults.find_first(|_| true) {
            return Err(first);
        }
        if may_have_copies {
            mesh.merge_copies();
        }
        mesh.check_overlaps()?;
        mesh.match_neighbours()?;
        mesh.direct_boundaries();
        mesh.drop_unused_nodes();
        Ok(mesh)
    }

    /// Checks that there are elements, that nodes are finite, and that all references exist.
    fn check(&self) -> Result<(), MeshError> {
        if self.elements.is_empty() {
            return Err(MeshError::Empty);
        }
        let not_finite = |x: &[f64; D]| !x.iter().all(|v| v.is_finite());
        if let Some(node) = self.nodes.iter().position(not_finite) {
            return Err(MeshError::NotFinite(node));
        }
        let (n_nodes, n_regions) = (self.nodes.len(), self.regions.len());
        let missing =
            |nodes: &[u32]| (nodes.iter().copied()).find(|&node| node as usize >= n_nodes);
        let fault = |(number, element): (usize, &Element<D>)| {
            if let Some(node) = missing(element.nodes()) {
                return Some(MeshError::NoSuchNode {
                    element: number,
                    node,
                    n_nodes,
                });
            }
            (element.region as usize >= n_regions).then_some(MeshError::NoSuchRegion {
                element: number,
                region: element.region,
                n_regions,
            })
        };
        let elements = self.elements.par_iter().enumerate();
        if let Some(first) = elements.filter_map(fault).find_first(|_| true) {
            return Err(first);
        }
        for (name, facets) in &self.boundaries {
            if let Some(node) = facets.iter().find_map(|facet| missing(facet.as_ref())) {
                return Err(MeshError::NoSuchBoundaryNode {
                    name: name.clone(),
                    node,
                    n_nodes,
                });
            }
        }
        for (name, set) in &self.node_sets {
            if let Some(node) = missing(set) {
                return Err(MeshError::NoSuchSetNode {
                    name: name.clone(),
                    node,
                    n_nodes,
                });
            }
        }
        Ok(())
    }

    /// Makes every region its own group.
    fn group_regions(&mut self) {
        for (region, name) in (0..).zip(&self.regions) {
            self.groups.entry(name.clone()).or_default().push(region);
        }
    }

    fn drop_unused_nodes(&mut self) {
        let used: Vec<AtomicBool> = self.nodes.iter().map(|_| AtomicBool::new(false)).collect();
        self.elements.par_iter().for_each(|element| {
            let nodes = element.nodes().iter();
            nodes.for_each(|&node| used[node as usize].store(true, Ordering::Relaxed));
        });
        let used: Vec<bool> = used.into_iter().map(AtomicBool::into_inner).collect();
        if used.iter().all(|&used| used) {
            return;
        }
        let mut new_number = vec![u32::MAX; self.nodes.len()];
        let mut kept = Vec::new();
        for (node, number) in new_number
            .iter_mut()
            .enumerate()
            .filter(|(node, _)| used[*node])
        {
            *number = kept.len() as u32;
            kept.push(self.nodes[node]);
        }
        self.nodes = kept;
        for (name, set) in &mut self.node_sets {
            let before = set.len();
            set.retain(|&node| new_number[node as usize] != u32::MAX);
            if set.len() < before {
                self.lost.insert(name.clone(), before - set.len());
            }
        }
        self.renumber(|node| new_number[node as usize]);
    }

    /// Gives the nodes that elements and boundaries name other numbers.
    pub(crate) fn renumber(&mut self, number: impl Fn(u32) -> u32) {
        let elements = self.elements.iter_mut().map(Element::nodes_mut);
        let facets = self.boundaries.values_mut().flatten();
        let sets = self.node_sets.values_mut().map(Vec::as_mut_slice);
        let of_facets = facets.map(AsMut::as_mut);
        for node in elements.chain(of_facets).chain(sets).flatten() {
            *node = number(*node);
        }
    }

    /// Moves the mesh as a whole.
    pub fn shift(&mut self, by: [f64; D]) {
        self.place_nodes(|x| std::array::from_fn(|c| x[c] + by[c]));
    }

    /// Moves all nodes by a rigid motion.
    pub(crate) fn place_nodes(&mut self, place: impl Fn([f64; D]) -> [f64; D]) {
        let ends = self.faults.values_mut().flat_map(|fault| &mut fault.ends);
        for x in self.nodes.iter_mut().chain(ends) {
            *x = place(*x);
        }
    }

    /// Gives its parts other names, which must not make different ones the same.
    pub fn rename(&mut self, region: impl Fn(&str) -> String, boundary: impl Fn(&str) -> String) {
        fn keys<T>(map: &mut BTreeMap<String, T>, name: impl Fn(&str) -> String) {
            *map = std::mem::take(map)
                .into_iter()
                .map(|(key, value)| (name(&key), value))
                .collect();
        }
        for name in &mut self.regions {
            *name = region(name);
        }
        keys(&mut self.groups, region);
        keys(&mut self.boundaries, &boundary);
        keys(&mut self.node_sets, &boundary);
        keys(&mut self.lost, &boundary);
        keys(&mut self.faults, boundary);
    }

    /// Number of bodies: parts of the mesh that share no node. Returns the count and the body of each node.
    pub fn bodies(&self) -> (usize, Vec<u32>) {
        let mut groups = Groups::new(self.nodes.len());
        for element in &self.elements {
            for &node in &element.nodes()[1..] {
                groups.join(element.nodes()[0], node);
            }
        }
        groups.numbers()
    }

    /// Coordinates of the N nodes of an element.
    #[inline]
    pub(crate) fn coordinates<const N: usize>(&self, element: &Element<D>) -> [[f64; D]; N] {
        let nodes = element.nodes();
        std::array::from_fn(|a| self.nodes[nodes[a] as usize])
    }

    /// Area (volume) of an element; negative if its nodes have the wrong orientation.
    pub(crate) fn measure(&self, element: &Element<D>) -> f64 {
        element.kind().with(Measure(self, element))
    }

    /// Area (volume) of each region.
    pub fn measures(&self) -> Vec<f64> {
        let mut measures = vec![0.0; self.regions.len()];
        let own: Vec<f64> = self.elements.par_iter().map(|e| self.measure(e)).collect();
        for (element, own) in self.elements.iter().zip(own) {
            measures[element.region as usize] += own;
        }
        measures
    }

    /// The number of elements of each kind that occurs.
    pub fn kinds(&self) -> Vec<(ElementKind, usize)> {
        let count = |kind| self.elements.iter().filter(|e| e.kind() == kind).count();
        let all = ElementKind::ALL.map(|kind| (kind, count(kind)));
        all.into_iter().filter(|&(_, count)| count > 0).collect()
    }

    /// The facts about all of it that reports tell.
    #[cfg(any(feature = "files", feature = "mpi"))]
    pub(crate) fn census(&self) -> Census {
        let (low, high) = self.bounding_box();
        let mut kinds: Vec<Vec<(ElementKind, usize)>> = vec![Vec::new(); self.regions.len()];
        for element in &self.elements {
            let of_region = &mut kinds[element.region as usize];
            match of_region
                .iter_mut()
                .find(|(kind, _)| *kind == element.kind())
            {
                Some((_, count)) => *count += 1,
                None => of_region.push((element.kind(), 1)),
            }
        }
        let (count, body_of) = self.bodies();
        let mut bodies = vec![String::new(); count];
        for element in &self.elements {
            let name = &mut bodies[body_of[element.nodes()[0] as usize] as usize];
            if name.is_empty() {
                name.clone_from(&self.regions[element.region as usize]);
            }
        }
        Census {
            bodies,
            notes: self.notes.clone(),
            kinds,
            size: vector::length(vector::minus(high, low)),
        }
    }

    /// Smallest and largest corner of the box around the elements.
    pub fn bounding_box(&self) -> ([f64; D], [f64; D]) {
        let of_elements = self.elements.iter().flat_map(Element::nodes);
        bounds(of_elements.map(|&node| self.nodes[node as usize]))
    }
}

/// Facts about a whole mesh, of which a rank has only a part.
#[cfg(any(feature = "files", feature = "mpi"))]
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub(crate) struct Census {
    pub notes: Vec<String>,
    /// The kinds of elements in each region, with their numbers.
    pub kinds: Vec<Vec<(ElementKind, usize)>>,
    /// The region of the first element of each body.
    pub bodies: Vec<String>,
    /// The diagonal of the box around it.
    pub size: f64,
}

/// Integrates over an element.
struct Measure<'a, const D: usize>(&'a Mesh<D>, &'a Element<D>)
where
    ElementKind: Topology<D>;

impl<const D: usize> Visit<D> for Measure<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = f64;

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> f64 {
        let x: [_; N] = self.0.coordinates(self.1);
        let weight = |(xi, weight)| weight * determinant(&E::shapes(xi).1, &x);
        E::load_rule().map(weight).sum()
    }
}

/// The least determinant of the map from the reference element, and its sum, over the nodes, where those of second order
/// would be, and the points of integration.
struct Determinants<'a, const D: usize> {
    kind: ElementKind,
    x: &'a [[f64; D]],
}

impl<const D: usize> Visit<D> for Determinants<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = (f64, f64);

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> (f64, f64) {
        let x: [_; N] = std::array::from_fn(|a| self.x[a]);
        let (mut least, mut total) = (f64::INFINITY, 0.0);
        let mut at = |xi: [f64; D]| {
            let determinant = determinant(&E::shapes(xi).1, &x);
            least = if determinant < least || determinant.is_nan() {
                determinant
            } else {
                least
            };
            total += determinant;
        };
        // A triangle or a tetrahedron with straight sides has only one.
        E::stiffness_rule().into_iter().for_each(|(xi, _)| at(xi));
        if N > D + 1 {
            E::NODES.into_iter().for_each(&mut at);
            let all = self.kind.quadratic().unwrap_or(self.kind).middles();
            for of in &all[(N - self.kind.n_corners()).min(all.len())..] {
                let mean = 1.0 / of.len() as f64;
                at(std::array::from_fn(|c| {
                    of.iter().map(|&corner| mean * E::NODES[corner][c]).sum()
                }));
            }
        }
        (least, total)
    }
}

/// Reverses an element with the wrong orientation; rejects one that has no area (volume) or folds over itself.
fn orient<const D: usize>(
    element: &mut Element<D>,
    nodes: &[[f64; D]],
    number: usize,
) -> Result<(), MeshError>
where
    ElementKind: Topology<D>,
{
    let kind = element.kind();
    let mut x = [[0.0; D]; 27];
    let mut determinants = |element: &Element<D>| {
        let of_element = element.nodes();
        for (x, &node) in x.iter_mut().zip(of_element) {
            *x = nodes[node as usize];
        }
        let x = &x[..of_element.len()];
        (kind.with(Determinants { kind, x }), size(x))
    };
    let listed = *element;
    let ((mut least, total), size) = determinants(element);
    if total < 0.0 {
        element.turn();
        ((least, _), _) = determinants(element);
    }
    if least > 1e-13 * size {
        return Ok(());
    }
    let place = Location::from(nodes[element.nodes()[0] as usize]);
    if kind.order() == 1 {
        return Err(MeshError::Degenerate {
            element: number,
            place,
        });
    }
    // Without midside nodes the element is valid: are these at fault, and would another program's order be right?
    let straight = Element::new(kind.linear(), &element.nodes()[..kind.n_corners()], 0);
    let mut corners_alone = straight;
    if orient(&mut corners_alone, nodes, number).is_err() {
        return Err(MeshError::Degenerate {
            element: number,
            place,
        });
    }
    let meant = gmsh::other_orders(kind).into_iter().any(|order| {
        let nodes: Vec<u32> = order.iter().map(|&at| listed.nodes()[at]).collect();
        let mut other = Element::new(kind, &nodes, 0);
        let (mut least, total) = determinants(&other).0;
        if total < 0.0 {
            other.turn();
            (least, _) = determinants(&other).0;
        }
        least > 1e-13 * size
    });
    Err(MeshError::Folded {
        element: number,
        place,
        other_order: meant,
    })
}

/// The square of the size of an element, to the power of D / 2.
fn size<const D: usize>(x: &[[f64; D]]) -> f64 {
    let square = (x.iter())
        .map(|&x_a| (minus(x_a, x[0]).iter()).map(|v| v.powi(2)).sum())
        .fold(0.0, f64::max);
    if D == 2 {
        square
    } else {
        square * square.sqrt()
    }
}
