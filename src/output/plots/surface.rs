//! The outer surface of solids: its facets, its edges, and where it is smooth.

use crate::mesh::vector::{cross, dot, minus, unit};
use crate::mesh::{Facet, Mesh, facet_nodes};
use rayon::prelude::*;

/// Facets that meet at a larger angle than the one with this cosine (40°) have an edge between them.
const SMOOTH: f64 = 0.766;

/// The facets that belong to one element only, and what lies between them.
pub(super) struct Surface {
    /// Ordered by their region.
    pub facets: Vec<OuterFacet>,
    /// Corners of facets: a node has several where the surface has an edge, so that each has one normal.
    pub vertices: Vec<Vertex>,
    /// Every edge of a facet, once.
    pub edges: Vec<Edge>,
}

/// A facet on the outside.
#[derive(Clone, Copy)]
pub(super) struct OuterFacet {
    /// Its corners as nodes of the mesh.
    pub nodes: Facet<3>,
    /// Its corners as numbers of vertices, in the same order.
    pub vertices: [u32; 4],
    pub region: u32,
}

impl OuterFacet {
    /// The numbers of its vertices, each once.
    pub fn corners(&self) -> &[u32] {
        &self.vertices[..facet_nodes(&self.nodes).len()]
    }
}

/// A corner of facets that lie smoothly beside each other.
#[derive(Clone, Copy)]
pub(super) struct Vertex {
    pub node: u32,
    /// Outward, of the mesh at rest.
    pub normal: [f64; 3],
}

/// An edge of facets.
#[derive(Clone, Copy)]
pub(super) struct Edge {
    /// Its ends as nodes of the mesh.
    pub ends: [u32; 2],
    /// The two facets that share it; the first twice where it has one.
    pub facets: [u32; 2],
    /// Whether the surface bends sharply there, or parts meet.
    pub sharp: bool,
}

impl Surface {
    /// That of a mesh.
    pub fn new(mesh: &Mesh<3>) -> Self {
        let outer = outer_facets(mesh);
        let normals: Vec<[f64; 3]> = (outer.par_iter())
            .map(|(facet, _)| mesh.facet_normal(facet).1)
            .collect();
        let edges = edges(&outer, &normals);
        let (vertices, corners) = vertices(mesh, &outer, &normals, &edges);
        let facets = (outer.iter().zip(corners))
            .map(|(&(nodes, region), vertices)| OuterFacet {
                nodes,
                vertices,
                region,
            })
            .collect();
        Self {
            facets,
            vertices,
            edges,
        }
    }
}

/// The facets of one element only with the region of that, ordered by region.
fn outer_facets(mesh: &Mesh<3>) -> Vec<(Facet<3>, u32)> {
    // Facets stand with their lowest node: as the number of the element and that of the facet in it.
    const PLACES: u64 = 8;
    let lowest = |facet: &Facet<3>| facet.iter().copied().min().unwrap_or(0) as usize;
    let mut start = vec![0_usize; mesh.nodes.len() + 2];
    for element in &mesh.elements {
        for facet in element.facets() {
            start[lowest(&facet) + 2] += 1;
        }
    }
    for i in 2..start.len() {
        start[i] += start[i - 1];
    }
    let mut held = vec![0_u64; start.last().copied().unwrap_or(0)];
    for (number, element) in mesh.elements.iter().enumerate() {
        for (place, facet) in element.facets().enumerate() {
            let next = &mut start[lowest(&facet) + 1];
            held[*next] = number as u64 * PLACES + place as u64;
            *next += 1;
        }
    }
    let of = |id: u64| {
        let element = &mesh.elements[(id / PLACES) as usize];
        let facet = element.facets().nth((id % PLACES) as usize);
        (facet.unwrap_or_default(), element.region)
    };
    let mut outer: Vec<(Facet<3>, u32)> = (start[..mesh.nodes.len() + 1].par_windows(2))
        .flat_map_iter(|ends| {
            let mut here: Vec<([u32; 4], u64)> = (held[ends[0]..ends[1]].iter())
                .map(|&id| {
                    let mut key = of(id).0;
                    // A triangle names its last corner twice, whichever that is.
                    if key[2] == key[3] {
                        key[3] = u32::MAX;
                    }
                    key.sort_unstable();
                    (key, id)
                })
                .collect();
            here.sort_unstable();
            let alone = |k: usize| {
                let same =
                    |other: Option<&([u32; 4], u64)>| other.is_some_and(|o| o.0 == here[k].0);
                !same(here.get(k + 1)) && !(k > 0 && same(here.get(k - 1)))
            };
            let found: Vec<_> = (0..here.len()).filter(|&k| alone(k)).collect();
            found.into_iter().map(|k| of(here[k].1)).collect::<Vec<_>>()
        })
        .collect();
    outer.par_sort_by_key(|&(_, region)| region);
    outer
}

/// The edges of facets. Facets whose nodes are ordered the same way along an edge (of bodies that touch in it) or of
/// which more than two meet have a sharp one.
fn edges(facets: &[(Facet<3>, u32)], normals: &[[f64; 3]]) -> Vec<Edge> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::with_capacity(4 * facets.len());
    for (number, (facet, _)) in (0..).zip(facets) {
        let nodes = facet_nodes(facet);
        for (i, &a) in nodes.iter().enumerate() {
            let b = nodes[(i + 1) % nodes.len()];
            sides.push(([a.min(b), a.max(b)], number));
        }
    }
    sides.par_sort_unstable();
    let groups = sides.chunk_by(|a, b| a.0 == b.0);
    groups
        .map(|group| {
            let (first, last) = (group[0].1, group[group.len() - 1].1);
            let [a, b] = [first, last].map(|k| k as usize);
            let bends = || dot(normals[a], normals[b]) < SMOOTH;
            Edge {
                ends: group[0].0,
                facets: [first, last],
                sharp: group.len() != 2 || facets[a].1 != facets[b].1 || bends(),
            }
        })
        .collect()
}

/// The vertices, and those of each facet.
fn vertices(
    mesh: &Mesh<3>,
    facets: &[(Facet<3>, u32)],
    normals: &[[f64; 3]],
    edges: &[Edge],
) -> (Vec<Vertex>, Vec<[u32; 4]>) {
    // Corners of neighbours are joined along edges that are not sharp.
    let mut joined: Vec<u32> = (0..4 * facets.len() as u32).collect();
    fn root(joined: &mut [u32], mut i: u32) -> u32 {
        while joined[i as usize] != i {
            joined[i as usize] = joined[joined[i as usize] as usize];
            i = joined[i as usize];
        }
        i
    }
    let corner = |facet: u32, node: u32| {
        let place = facets[facet as usize].0.iter().position(|&n| n == node);
        4 * facet + place.unwrap_or(0) as u32
    };
    for edge in edges.iter().filter(|edge| !edge.sharp) {
        for node in edge.ends {
            let [a, b] = edge.facets.map(|facet| corner(facet, node));
            let [a, b] = [a, b].map(|c| root(&mut joined, c));
            joined[b as usize] = a;
        }
    }
    let mut number = vec![u32::MAX; joined.len()];
    let mut vertices: Vec<Vertex> = Vec::new();
    let mut of_facets = Vec::with_capacity(facets.len());
    for (f, (facet, _)) in facets.iter().enumerate() {
        let nodes = facet_nodes(facet);
        let mut corners = [0; 4];
        for (k, &node) in nodes.iter().enumerate() {
            let group = root(&mut joined, (4 * f + k) as u32) as usize;
            if number[group] == u32::MAX {
                number[group] = vertices.len() as u32;
                vertices.push(Vertex {
                    node,
                    normal: [0.0; 3],
                });
            }
            corners[k] = number[group];
            let vertex = &mut vertices[corners[k] as usize];
            let weight = angle(mesh, nodes, k);
            for c in 0..3 {
                vertex.normal[c] += weight * normals[f][c];
            }
        }
        let last = corners[nodes.len() - 1];
        corners[nodes.len()..].fill(last);
        of_facets.push(corners);
    }
    for vertex in &mut vertices {
        let normal = unit(vertex.normal);
        vertex.normal = if normal.iter().all(|v| v.is_finite()) {
            normal
        } else {
            [0.0, 0.0, 1.0]
        };
    }
    (vertices, of_facets)
}

/// The angle of a facet at one of its corners.
fn angle(mesh: &Mesh<3>, nodes: &[u32], corner: usize) -> f64 {
    let place = |k: usize| mesh.nodes[nodes[k % nodes.len()] as usize];
    let here = place(corner);
    let (a, b) = (
        minus(place(corner + 1), here),
        minus(place(corner + nodes.len() - 1), here),
    );
    let [x, y, z] = cross(a, b);
    x.hypot(y).hypot(z).atan2(dot(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::structured::{SolidShape, block};

    #[test]
    fn a_box_has_six_faces_with_edges_between() {
        let mesh = block(
            [0.0; 3],
            [2.0, 1.0, 1.0],
            [4, 2, 3],
            SolidShape::Hexahedron,
            "body",
            "",
        );
        let surface = Surface::new(&mesh);
        assert_eq!(surface.facets.len(), 2 * (4 * 2 + 4 * 3 + 2 * 3));
        let sharp: Vec<&Edge> = surface.edges.iter().filter(|e| e.sharp).collect();
        assert_eq!(sharp.len(), 4 * (4 + 2 + 3));
        // Corners of the box have three vertices, its edges two.
        let inner = 2 * (3 + 3 * 2 + 2);
        assert_eq!(surface.vertices.len(), inner + 2 * 4 * (3 + 1 + 2) + 3 * 8);
        for facet in &surface.facets {
            let (_, normal) = mesh.facet_normal(&facet.nodes);
            for &corner in facet.corners() {
                let vertex = surface.vertices[corner as usize];
                assert!(facet.nodes.contains(&vertex.node));
                assert!(dot(vertex.normal, normal) > 1.0 - 1e-12);
            }
        }
    }
}
