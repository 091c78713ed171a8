//! Meshes with named regions and boundaries.
//!
//! [`Mesh`] is that of the plane, with triangles and quadrilaterals; what holds in any dimension is written for
//! `Mesh<D>`. Edges, areas and the orientation of elements are the matter of `mesh/plane.rs`.

mod element;
pub mod gmsh;
mod plane;
pub mod structured;
#[cfg(test)]
pub(crate) mod tests;
pub(crate) mod vector;

pub use element::{Element, Facet, Kind, Topology};
pub(crate) use vector::bounds;

use std::collections::{BTreeMap, HashMap};
use std::fmt;

/// A mesh in D dimensions: nodes (coordinates in metres, or the user's unit of length), elements, and named parts.
#[derive(Clone, Debug)]
pub struct Mesh<const D: usize = 2>
where
    Kind: Topology<D>,
{
    /// Coordinates, one row per node.
    pub nodes: Vec<[f64; D]>,
    /// Elements; every node belongs to at least one.
    pub elements: Vec<Element<D>>,
    /// Names of the regions that [`Element::region`] counts: each element is in one.
    pub regions: Vec<String>,
    /// The regions that a name stands for: every region under its own name, and groups of them that may overlap.
    pub groups: BTreeMap<String, Vec<u32>>,
    /// Named boundaries: in the plane edges (from, to) with the body on the left, so that the outward normal points
    /// right. Those that [`Self::faults`] names also hold edges between elements, which have no outward normal:
    /// [`Mesh::outer_edges`] and [`Mesh::edges`] mind that.
    pub boundaries: BTreeMap<String, Vec<Facet<D>>>,
    /// What is wrong with the boundaries that are not on the outside of the body altogether.
    pub faults: BTreeMap<String, Fault<D>>,
}

/// The worst that the facets of a boundary have, and the first facet that has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault<const D: usize = 2> {
    /// What it is.
    pub kind: FaultKind,
    /// The coordinates of two nodes of the facet: both ends of an edge.
    pub ends: [[f64; D]; 2],
}

/// Why an edge is no outer edge of the body.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultKind {
    /// There are elements on both sides: an interface.
    Inside,
    /// No element has it: a construction line. It is not in [`Mesh::boundaries`].
    Stray,
}

impl FaultKind {
    fn remedy(self) -> &'static str {
        match self {
            Self::Inside => {
                "take that curve out of the physical group or, where two bodies touch, draw it once for each"
            }
            Self::Stray => "take that curve out of the physical group",
        }
    }
}

impl<const D: usize> fmt::Display for Fault<D> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [from, to] = self.ends.map(Place::from);
        let what = match self.kind {
            FaultKind::Inside => "lies between elements, not on the outside of the body",
            FaultKind::Stray => "is not an edge of any element",
        };
        write!(f, "its edge from {from} to {to} {what}")
    }
}

/// Where something is wrong, in any dimension: for messages.
#[derive(Clone, Debug, PartialEq)]
pub struct Place(
    /// The coordinates.
    pub Vec<f64>,
);

impl<const D: usize> From<[f64; D]> for Place {
    fn from(x: [f64; D]) -> Self {
        Self(x.to_vec())
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let coordinates: Vec<String> = self.0.iter().map(|x| format!("{x:.6e}")).collect();
        write!(f, "({})", coordinates.join(", "))
    }
}

/// Why a mesh has no such boundary for what it is wanted for.
#[derive(Debug, thiserror::Error)]
pub enum BoundaryError {
    /// No boundary has the name.
    #[error("there is no boundary \"{0}\"")]
    Unknown(String),
    /// It has edges that it must not have.
    #[error("boundary \"{name}\": {fault}: {}", fault.kind.remedy())]
    Faulty {
        /// The boundary.
        name: String,
        /// The worst of its edges.
        fault: Fault,
    },
}

/// What is wrong with a mesh.
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
        /// How many nodes there are.
        n_nodes: usize,
    },
    /// A coordinate is infinite or NaN.
    #[error("node {0} has a coordinate that is not finite")]
    NotFinite(usize),
    /// An element has no area, or a corner that turns inwards.
    #[error(
        "element {element} near {place} has no area or folds over itself: repair it in the mesher"
    )]
    Degenerate {
        /// The element.
        element: usize,
        /// Its first node.
        place: Place,
    },
    /// An element names a region that does not exist.
    #[error("element {element} is in region {region}, but there are only {n_regions} regions")]
    NoSuchRegion {
        /// The element.
        element: usize,
        /// The number that it names.
        region: u32,
        /// How many regions there are.
        n_regions: usize,
    },
    /// A boundary names a node that does not exist.
    #[error("boundary \"{name}\" names node {node}, but there are only {n_nodes} nodes")]
    NoSuchBoundaryNode {
        /// The boundary.
        name: String,
        /// The number that it names.
        node: u32,
        /// How many nodes there are.
        n_nodes: usize,
    },
}

impl<const D: usize> Mesh<D>
where
    Kind: Topology<D>,
{
    /// Checks that there are elements, that nodes are finite, and that elements and boundaries name what there is.
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
        for (number, element) in self.elements.iter().enumerate() {
            if let Some(node) = missing(element.nodes()) {
                return Err(MeshError::NoSuchNode {
                    element: number,
                    node,
                    n_nodes,
                });
            }
            if element.region as usize >= n_regions {
                return Err(MeshError::NoSuchRegion {
                    element: number,
                    region: element.region,
                    n_regions,
                });
            }
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
        Ok(())
    }

    /// Makes every region a group of its own.
    fn group_regions(&mut self) {
        for (region, name) in (0..).zip(&self.regions) {
            self.groups.entry(name.clone()).or_default().push(region);
        }
    }

    fn drop_unused_nodes(&mut self) {
        let mut new_number = vec![u32::MAX; self.nodes.len()];
        for element in &self.elements {
            for &node in element.nodes() {
                new_number[node as usize] = 0;
            }
        }
        if new_number.iter().all(|&number| number == 0) {
            return;
        }
        let mut kept = Vec::new();
        for (node, number) in new_number.iter_mut().enumerate() {
            if *number == 0 {
                *number = kept.len() as u32;
                kept.push(self.nodes[node]);
            }
        }
        self.nodes = kept;
        self.renumber(|node| new_number[node as usize]);
    }

    /// Gives the nodes that elements and boundaries name other numbers.
    fn renumber(&mut self, number: impl Fn(u32) -> u32) {
        let elements = self.elements.iter_mut().map(Element::nodes_mut);
        let facets = self.boundaries.values_mut().flatten();
        for node in elements.chain(facets.map(AsMut::as_mut)).flatten() {
            *node = number(*node);
        }
    }

    /// Moves the mesh as a whole.
    pub fn shift(&mut self, by: [f64; D]) {
        let ends = self.faults.values_mut().flat_map(|fault| &mut fault.ends);
        for x in self.nodes.iter_mut().chain(ends) {
            *x = std::array::from_fn(|c| x[c] + by[c]);
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
        keys(&mut self.faults, boundary);
    }

    /// Number of bodies: parts of the mesh that share no node. Returns the count and the body of each node.
    pub fn bodies(&self) -> (usize, Vec<u32>) {
        let mut parent: Vec<u32> = (0..self.nodes.len() as u32).collect();
        fn root(parent: &mut [u32], mut i: u32) -> u32 {
            while parent[i as usize] != i {
                parent[i as usize] = parent[parent[i as usize] as usize];
                i = parent[i as usize];
            }
            i
        }
        for element in &self.elements {
            let first = root(&mut parent, element.nodes()[0]);
            for &node in &element.nodes()[1..] {
                let other = root(&mut parent, node);
                parent[other as usize] = first;
            }
        }
        let mut number = HashMap::new();
        let body = (0..self.nodes.len() as u32)
            .map(|i| {
                let r = root(&mut parent, i);
                let next = number.len() as u32;
                *number.entry(r).or_insert(next)
            })
            .collect();
        (number.len(), body)
    }

    /// Coordinates of the N nodes of an element.
    #[inline]
    pub(crate) fn coordinates<const N: usize>(&self, element: &Element<D>) -> [[f64; D]; N] {
        let nodes = element.nodes();
        std::array::from_fn(|a| self.nodes[nodes[a] as usize])
    }

    /// Smallest and largest corner of the box around the mesh.
    pub fn bounding_box(&self) -> ([f64; D], [f64; D]) {
        bounds(self.nodes.iter().copied())
    }
}
