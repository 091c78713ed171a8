//! The geometry of meshes in the plane: orientation, boundary edges, areas.

use super::vector::{length, minus};
use super::{BoundaryError, Element, Facet, Fault, FaultKind, Mesh, MeshError};
use std::collections::{BTreeMap, HashMap};

/// Twice the signed area of the triangle a, b, c.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

impl Mesh {
    /// A mesh of the plane from its parts: checks them, turns clockwise elements around, drops nodes that no element
    /// uses, and directs boundary edges so that the body lies on their left. Boundaries may have edges
    /// that do not lie on the outside: they are noted in [`Self::faults`]. Every region is a group of its own.
    pub fn new(
        nodes: Vec<[f64; 2]>,
        elements: Vec<Element>,
        regions: Vec<String>,
        boundaries: BTreeMap<String, Vec<[u32; 2]>>,
    ) -> Result<Self, MeshError> {
        let mut mesh = Self {
            nodes,
            elements,
            regions,
            groups: BTreeMap::new(),
            boundaries,
            faults: BTreeMap::new(),
        };
        mesh.check()?;
        for (number, element) in mesh.elements.iter_mut().enumerate() {
            orient(element, &mesh.nodes, number)?;
        }
        mesh.direct_boundaries();
        mesh.group_regions();
        mesh.drop_unused_nodes();
        Ok(mesh)
    }

    /// Directs the edges of boundaries, notes those that are no outer ones, and drops those of no element.
    fn direct_boundaries(&mut self) {
        let mut on_boundary = vec![false; self.nodes.len()];
        for &node in self.boundaries.values().flatten().flatten() {
            on_boundary[node as usize] = true;
        }
        // How many elements have an edge, in their own direction; an outer edge has one owner.
        let mut owners: HashMap<[u32; 2], u32> = HashMap::new();
        if !self.boundaries.is_empty() {
            for edge in self.elements.iter().flat_map(Element::edges) {
                if edge.iter().all(|&node| on_boundary[node as usize]) {
                    *owners.entry(edge).or_default() += 1;
                }
            }
        }
        let owners = |edge: [u32; 2]| owners.get(&edge).copied().unwrap_or(0);
        for (name, edges) in &mut self.boundaries {
            edges.retain_mut(|edge| {
                let kind = match (owners(*edge), owners([edge[1], edge[0]])) {
                    (1, 0) => return true,
                    (0, 1) => {
                        edge.swap(0, 1);
                        return true;
                    }
                    (0, 0) => FaultKind::Stray,
                    _ => FaultKind::Inside,
                };
                let ends = edge.map(|node| self.nodes[node as usize]);
                let fault = Fault { kind, ends };
                let worst = self.faults.entry(name.clone()).or_insert(fault);
                if worst.kind < kind {
                    *worst = fault;
                }
                // It has no side, and must not stand twice if a file has it in both directions.
                edge.sort_unstable();
                kind == FaultKind::Inside
            });
            edges.sort_unstable();
            edges.dedup();
        }
    }

    /// The edges of a boundary, all on the outside of the body: for what acts on it from there.
    pub fn outer_edges(&self, name: &str) -> Result<&[Facet], BoundaryError> {
        self.edges_with(name, None)
    }

    /// The edges of a boundary that may lie inside the body: for what is done to its nodes.
    pub fn edges(&self, name: &str) -> Result<&[Facet], BoundaryError> {
        self.edges_with(name, Some(FaultKind::Inside))
    }

    fn edges_with(
        &self,
        name: &str,
        allowed: Option<FaultKind>,
    ) -> Result<&[Facet], BoundaryError> {
        match (self.boundaries.get(name), self.faults.get(name)) {
            (_, Some(&fault)) if allowed != Some(fault.kind) => Err(BoundaryError::Faulty {
                name: name.to_owned(),
                fault,
            }),
            (Some(edges), _) => Ok(edges),
            (None, _) => Err(BoundaryError::Unknown(name.to_owned())),
        }
    }

    /// Length of a boundary edge and its outward unit normal.
    pub fn edge_normal(&self, edge: [u32; 2]) -> (f64, [f64; 2]) {
        let [p, q] = edge.map(|node| self.nodes[node as usize]);
        let [dx, dy] = minus(q, p);
        let length = length([dx, dy]);
        (length, [dy / length, -dx / length])
    }

    /// Area of an element, negative if its nodes are clockwise.
    pub(crate) fn signed_area(&self, element: &Element) -> f64 {
        let nodes = element.nodes();
        let x = |a: usize| self.nodes[nodes[a] as usize];
        let fan = (2..nodes.len()).map(|a| cross(x(0), x(a - 1), x(a)));
        0.5 * fan.sum::<f64>()
    }

    /// Area of each region.
    pub fn areas(&self) -> Vec<f64> {
        let mut areas = vec![0.0; self.regions.len()];
        for element in &self.elements {
            areas[element.region as usize] += self.signed_area(element);
        }
        areas
    }
}

/// Turns a clockwise element around and rejects one without area or with a reflex corner.
fn orient(element: &mut Element, nodes: &[[f64; 2]], number: usize) -> Result<(), MeshError> {
    let len = element.nodes().len();
    let corner = |element: &Element, a: usize| {
        let x = |a: usize| nodes[element.nodes()[a % len] as usize];
        cross(x(a), x(a + 1), x(a + 2))
    };
    if (0..len).map(|a| corner(element, a)).sum::<f64>() < 0.0 {
        element.nodes_mut().reverse();
    }
    let first = nodes[element.nodes()[0] as usize];
    let size = (element.nodes().iter())
        .map(|&node| {
            let [dx, dy] = minus(nodes[node as usize], first);
            dx.powi(2) + dy.powi(2)
        })
        .fold(0.0, f64::max);
    if (0..len).all(|a| corner(element, a) > 1e-12 * size) {
        return Ok(());
    }
    Err(MeshError::Degenerate {
        element: number,
        place: first.into(),
    })
}
