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
    /// Names of the regions that [`Element::region`] counts.
    pub regions: Vec<String>,
    /// Named boundaries: edges (from, to) with the body on the left, so that the outward normal points right.
    pub boundaries: BTreeMap<String, Vec<[u32; 2]>>,
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
    #[error(
        "boundary \"{name}\": its edge from ({x0:.6e}, {y0:.6e}) to ({x1:.6e}, {y1:.6e}) {problem}"
    )]
    BadEdge {
        name: String,
        x0: f64,
        y0: f64,
        x1: f64,
        y1: f64,
        problem: &'static str,
    },
}

/// Twice the signed area of the triangle a, b, c.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

impl Mesh {
    /// A mesh from its parts: checks them, turns clockwise elements around, drops nodes that no element
    /// uses, and directs boundary edges so that the body lies on their left.
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
            orient(element, &nodes, e)?;
        }

        // Every edge of every element, in the element's direction; an edge of the boundary has one owner.
        let has_boundaries = boundaries.values().any(|edges| !edges.is_empty());
        let mut owners: HashMap<[u32; 2], u32> = HashMap::new();
        if has_boundaries {
            let on_boundary: std::collections::HashSet<u32> =
                boundaries.values().flatten().flatten().copied().collect();
            for element in &elements {
                let corners = element.nodes();
                for (i, &a) in corners.iter().enumerate() {
                    let b = corners[(i + 1) % corners.len()];
                    if on_boundary.contains(&a) && on_boundary.contains(&b) {
                        *owners.entry([a, b]).or_default() += 1;
                    }
                }
            }
        }
        for (name, edges) in &mut boundaries {
            for edge in edges.iter_mut() {
                let forward = owners.get(&[edge[0], edge[1]]).copied().unwrap_or(0);
                let backward = owners.get(&[edge[1], edge[0]]).copied().unwrap_or(0);
                let problem = match (forward, backward) {
                    (1, 0) => continue,
                    (0, 1) => {
                        edge.swap(0, 1);
                        continue;
                    }
                    (0, 0) => "is not an edge of any element",
                    _ => "lies between elements, not on the outside of the body",
                };
                let [p, q] = edge.map(|i| nodes.get(i as usize).copied().unwrap_or([f64::NAN; 2]));
                return Err(MeshError::BadEdge {
                    name: name.clone(),
                    x0: p[0],
                    y0: p[1],
                    x1: q[0],
                    y1: q[1],
                    problem,
                });
            }
            edges.sort_unstable();
            edges.dedup();
        }

        let mut mesh = Self {
            nodes,
            elements,
            regions,
            boundaries,
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
    let corners = |element: &Element| -> Vec<f64> {
        let x: Vec<[f64; 2]> = element
            .nodes()
            .iter()
            .map(|&node| nodes[node as usize])
            .collect();
        let n = x.len();
        (0..n)
            .map(|i| cross(x[i], x[(i + 1) % n], x[(i + 2) % n]))
            .collect()
    };
    let mut areas = corners(element);
    if areas.iter().sum::<f64>() < 0.0 {
        let len = element.len as usize;
        element.nodes[..len].reverse();
        if len == 3 {
            element.nodes[3] = element.nodes[2];
        }
        areas = corners(element);
    }
    let size = element
        .nodes()
        .iter()
        .map(|&node| {
            let [a, b] = [nodes[node as usize], nodes[element.nodes[0] as usize]];
            (a[0] - b[0]).powi(2) + (a[1] - b[1]).powi(2)
        })
        .fold(0.0, f64::max);
    if areas.iter().all(|&area| area > 1e-12 * size) {
        return Ok(());
    }
    let [x, y] = nodes[element.nodes[0] as usize];
    Err(MeshError::Degenerate {
        element: number,
        x,
        y,
    })
}
