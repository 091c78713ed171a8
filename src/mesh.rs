//! Meshes of triangles and quadrilaterals in the plane, with named regions and boundaries.

pub mod gmsh;
pub mod structured;

use std::collections::{BTreeMap, HashMap};

/// A triangle or quadrilateral, nodes counter-clockwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Element {
    nodes: [u32; 4],
    len: u8,
    /// Index into [`Mesh::regions`].
    pub region: u32,
}

impl Element {
    /// A 3-node triangle.
    pub fn triangle(nodes: [u32; 3], region: u32) -> Self {
        let [a, b, c] = nodes;
        Self {
            nodes: [a, b, c, c],
            len: 3,
            region,
        }
    }

    /// A 4-node quadrilateral.
    pub fn quad(nodes: [u32; 4], region: u32) -> Self {
        Self {
            nodes,
            len: 4,
            region,
        }
    }

    /// The node numbers.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes[..self.len as usize]
    }
}

/// A mesh: nodes (coordinates in metres, or the user's unit of length), elements, and named parts.
#[derive(Clone, Debug)]
pub struct Mesh {
    /// Coordinates, one row per node.
    pub nodes: Vec<[f64; 2]>,
    /// Elements; every node belongs to at least one.
    pub elements: Vec<Element>,
    /// Names of the regions that [`Element::region`] counts: each element is in one.
    pub regions: Vec<String>,
    /// The regions that a name stands for: every region under its own name, and groups of them that may overlap.
    pub groups: BTreeMap<String, Vec<u32>>,
    /// Named boundaries: edges (from, to) with the body on the left, so that the outward normal points right.
    /// Those that [`Self::faults`] names also hold edges between elements, which have no outward normal:
    /// [`Self::outer_edges`] and [`Self::edges`] mind that.
    pub boundaries: BTreeMap<String, Vec<[u32; 2]>>,
    /// What is wrong with the boundaries that are not on the outside of the body altogether.
    pub faults: BTreeMap<String, Fault>,
}

/// The worst that the edges of a boundary have, and the first edge that has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fault {
    pub kind: FaultKind,
    /// The coordinates of both ends.
    pub ends: [[f64; 2]; 2],
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

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let [[x0, y0], [x1, y1]] = self.ends;
        let what = match self.kind {
            FaultKind::Inside => "lies between elements, not on the outside of the body",
            FaultKind::Stray => "is not an edge of any element",
        };
        write!(
            f,
            "its edge from ({x0:.6e}, {y0:.6e}) to ({x1:.6e}, {y1:.6e}) {what}"
        )
    }
}

/// Why a mesh has no such boundary for what it is wanted for.
#[derive(Debug, thiserror::Error)]
pub enum BoundaryError {
    #[error("there is no boundary \"{0}\"")]
    Unknown(String),
    #[error("boundary \"{name}\": {fault}: {}", fault.kind.remedy())]
    Faulty { name: String, fault: Fault },
}

/// What is wrong with a mesh.
#[derive(Debug, thiserror::Error)]
pub enum MeshError {
    #[error("the mesh has no elements")]
    Empty,
    #[error("element {element} names node {node}, but there are only {n_nodes} nodes")]
    NoSuchNode {
        element: usize,
        node: u32,
        n_nodes: usize,
    },
    #[error("node {0} has a coordinate that is not finite")]
    NotFinite(usize),
    #[error(
        "element {element} near ({x:.6e}, {y:.6e}) has no area or folds over itself: repair it in the mesher"
    )]
    Degenerate { element: usize, x: f64, y: f64 },
    #[error("element {element} is in region {region}, but there are only {n_regions} regions")]
    NoSuchRegion {
        element: usize,
        region: u32,
        n_regions: usize,
    },
    #[error("boundary \"{name}\" names node {node}, but there are only {n_nodes} nodes")]
    NoSuchBoundaryNode {
        name: String,
        node: u32,
        n_nodes: usize,
    },
}

/// Twice the signed area of the triangle a, b, c.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

impl Mesh {
    /// A mesh from its parts: checks them, turns clockwise elements around, drops nodes that no element
    /// uses, and directs boundary edges so that the body lies on their left. Boundaries may have edges
    /// that do not lie on the outside: they are noted in [`Self::faults`]. Every region is a group of its own.
    pub fn new(
        nodes: Vec<[f64; 2]>,
        mut elements: Vec<Element>,
        regions: Vec<String>,
        mut boundaries: BTreeMap<String, Vec<[u32; 2]>>,
    ) -> Result<Self, MeshError> {
        if elements.is_empty() {
            return Err(MeshError::Empty);
        }
        if let Some(i) = nodes.iter().position(|x| !x.iter().all(|v| v.is_finite())) {
            return Err(MeshError::NotFinite(i));
        }
        for (e, element) in elements.iter_mut().enumerate() {
            if let Some(&node) = element
                .nodes()
                .iter()
                .find(|&&node| node as usize >= nodes.len())
            {
                return Err(MeshError::NoSuchNode {
                    element: e,
                    node,
                    n_nodes: nodes.len(),
                });
            }
            if element.region as usize >= regions.len() {
                return Err(MeshError::NoSuchRegion {
                    element: e,
                    region: element.region,
                    n_regions: regions.len(),
                });
            }
            orient(element, &nodes, e)?;
        }
        let mut on_boundary = vec![false; nodes.len()];
        for (name, edges) in &boundaries {
            for &node in edges.iter().flatten() {
                let Some(place) = on_boundary.get_mut(node as usize) else {
                    return Err(MeshError::NoSuchBoundaryNode {
                        name: name.clone(),
                        node,
                        n_nodes: nodes.len(),
                    });
                };
                *place = true;
            }
        }

        // How many elements have an edge, in their own direction; an outer edge has one owner.
        let mut owners: HashMap<[u32; 2], u32> = HashMap::new();
        if !boundaries.is_empty() {
            for element in &elements {
                let corners = element.nodes();
                for (i, &a) in corners.iter().enumerate() {
                    let b = corners[(i + 1) % corners.len()];
                    if on_boundary[a as usize] && on_boundary[b as usize] {
                        *owners.entry([a, b]).or_default() += 1;
                    }
                }
            }
        }
        let mut faults = BTreeMap::new();
        for (name, edges) in &mut boundaries {
            edges.retain_mut(|edge| {
                let forward = owners.get(&[edge[0], edge[1]]).copied().unwrap_or(0);
                let backward = owners.get(&[edge[1], edge[0]]).copied().unwrap_or(0);
                let kind = match (forward, backward) {
                    (1, 0) => return true,
                    (0, 1) => {
                        edge.swap(0, 1);
                        return true;
                    }
                    (0, 0) => FaultKind::Stray,
                    _ => FaultKind::Inside,
                };
                let ends = edge.map(|node| nodes[node as usize]);
                let worst = faults.entry(name.clone()).or_insert(Fault { kind, ends });
                if worst.kind < kind {
                    *worst = Fault { kind, ends };
                }
                // It has no side, and must not stand twice if a file has it in both directions.
                edge.sort_unstable();
                kind == FaultKind::Inside
            });
            edges.sort_unstable();
            edges.dedup();
        }

        let mut groups = BTreeMap::<String, Vec<u32>>::new();
        for (region, name) in (0..).zip(&regions) {
            groups.entry(name.clone()).or_default().push(region);
        }
        let mut mesh = Self {
            nodes,
            elements,
            regions,
            groups,
            boundaries,
            faults,
        };
        mesh.drop_unused_nodes();
        Ok(mesh)
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
        for element in &mut self.elements {
            element.nodes = element.nodes.map(|node| new_number[node as usize]);
        }
        for edge in self.boundaries.values_mut().flatten() {
            *edge = edge.map(|node| new_number[node as usize]);
        }
    }

    /// The edges of a boundary, all on the outside of the body: for what acts on it from there.
    pub fn outer_edges(&self, name: &str) -> Result<&[[u32; 2]], BoundaryError> {
        self.edges_with(name, None)
    }

    /// The edges of a boundary that may lie inside the body: for what is done to its nodes.
    pub fn edges(&self, name: &str) -> Result<&[[u32; 2]], BoundaryError> {
        self.edges_with(name, Some(FaultKind::Inside))
    }

    fn edges_with(
        &self,
        name: &str,
        allowed: Option<FaultKind>,
    ) -> Result<&[[u32; 2]], BoundaryError> {
        match (self.boundaries.get(name), self.faults.get(name)) {
            (_, Some(&fault)) if allowed != Some(fault.kind) => Err(BoundaryError::Faulty {
                name: name.to_owned(),
                fault,
            }),
            (Some(edges), _) => Ok(edges),
            (None, _) => Err(BoundaryError::Unknown(name.to_owned())),
        }
    }

    /// Moves the mesh as a whole.
    pub fn shift(&mut self, by: [f64; 2]) {
        let ends = self.faults.values_mut().flat_map(|fault| &mut fault.ends);
        for x in self.nodes.iter_mut().chain(ends) {
            *x = [x[0] + by[0], x[1] + by[1]];
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

    /// Coordinates of the nodes of an element; a triangle's third node stands twice.
    pub fn coordinates(&self, element: &Element) -> [[f64; 2]; 4] {
        element.nodes.map(|node| self.nodes[node as usize])
    }

    /// Length of a boundary edge and its outward unit normal.
    pub fn edge_normal(&self, edge: [u32; 2]) -> (f64, [f64; 2]) {
        let [p, q] = edge.map(|node| self.nodes[node as usize]);
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        let length = dx.hypot(dy);
        (length, [dy / length, -dx / length])
    }

    /// Area of an element, negative if its nodes are clockwise.
    pub(crate) fn signed_area(&self, element: &Element) -> f64 {
        let [a, b, c, d] = self.coordinates(element);
        0.5 * (cross(a, b, c) + cross(a, c, d))
    }

    /// Area of each region.
    pub fn areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.regions.len()];
        for element in &self.elements {
            areas[element.region as usize] += self.signed_area(element);
        }
        areas
    }

    /// Smallest and largest corner of the box around the mesh.
    pub fn bounding_box(&self) -> ([f64; 2], [f64; 2]) {
        bounds(self.nodes.iter().copied())
    }
}

/// Smallest and largest corner of the box around some points.
pub(crate) fn bounds(points: impl IntoIterator<Item = [f64; 2]>) -> ([f64; 2], [f64; 2]) {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for x in points {
        for c in 0..2 {
            low[c] = low[c].min(x[c]);
            high[c] = high[c].max(x[c]);
        }
    }
    (low, high)
}

/// Turns a clockwise element around and rejects one without area or with a reflex corner.
fn orient(element: &mut Element, nodes: &[[f64; 2]], number: usize) -> Result<(), MeshError> {
    let len = element.len as usize;
    let corners = |element: &Element| -> [f64; 4] {
        let x = element.nodes.map(|node| nodes[node as usize]);
        std::array::from_fn(|i| cross(x[i % len], x[(i + 1) % len], x[(i + 2) % len]))
    };
    let mut areas = corners(element);
    if areas[..len].iter().sum::<f64>() < 0.0 {
        element.nodes[..len].reverse();
        if len == 3 {
            element.nodes[3] = element.nodes[2];
        }
        areas = corners(element);
    }
    let [x, y] = nodes[element.nodes[0] as usize];
    let size = element
        .nodes()
        .iter()
        .map(|&node| {
            let [a, b] = nodes[node as usize];
            (a - x).powi(2) + (b - y).powi(2)
        })
        .fold(0.0, f64::max);
    if areas[..len].iter().all(|&area| area > 1e-12 * size) {
        return Ok(());
    }
    Err(MeshError::Degenerate {
        element: number,
        x,
        y,
    })
}
