//! The outer surface of solids, or all of the plane: its facets, its edges, and where it is smooth.

use crate::mesh::vector::{cross, dot, length, minus, unit};
use crate::mesh::{Facet, Mesh, face_parts, face_ring, facet, facet_corners, facet_nodes};
use rayon::prelude::*;

/// Facets that meet at a larger angle than the one with this cosine (40°) have an edge between them.
pub(super) const SMOOTH: f64 = 0.766;

/// The facets that belong to only one element, and the edges between them. A facet of second order is stored in parts,
/// whose corners are all of its nodes.
pub(super) struct Surface {
    /// Ordered by their region.
    pub facets: Vec<OuterFacet>,
    /// Corners of facets: a node has several where the surface has an edge, so that each has one normal.
    pub vertices: Vec<Vertex>,
    /// Every edge of a facet, once.
    pub edges: Vec<Edge>,
}

/// A facet on the outside, or a part of one.
#[derive(Clone, Copy)]
pub(super) struct OuterFacet {
    /// Its corners as nodes of the mesh; the last twice where there are three.
    pub nodes: [u32; 4],
    /// Its corners as numbers of vertices, in the same order.
    pub vertices: [u32; 4],
    pub region: u32,
}

impl OuterFacet {
    /// The numbers of its vertices, each once.
    pub fn corners(&self) -> &[u32] {
        &self.vertices[..facet_nodes(&self.nodes).len()]
    }

    /// Its area and its outward normal.
    pub fn normal(&self, mesh: &Mesh<3>) -> (f64, [f64; 3]) {
        mesh.facet_normal(&facet::<3>(facet_nodes(&self.nodes)))
    }
}

/// A corner of smoothly adjacent facets.
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
    /// The part of an element's edge in it: all, a half, or nothing inside a facet.
    pub share: f64,
}

impl Surface {
    /// A mesh of the plane as a surface that faces the viewer.
    pub fn of_plane(mesh: &Mesh<2>) -> Self {
        let parts = mesh.elements.iter().flat_map(|element| {
            let nodes = element.nodes();
            face_parts(nodes.len()).iter().map(move |places| {
                let corners = std::array::from_fn(|k| nodes[places[k.min(places.len() - 1)]]);
                OuterFacet {
                    nodes: corners,
                    vertices: corners,
                    region: element.region,
                }
            })
        });
        let mut facets: Vec<OuterFacet> = parts.collect();
        facets.par_sort_by_key(|facet| facet.region);
        let normal = [0.0, 0.0, 1.0];
        let vertices = (0..mesh.nodes.len() as u32).map(|node| Vertex { node, normal });
        let all = borders(facets.iter().map(|facet| facet_nodes(&facet.nodes)));
        let edge = |border: Border| Edge {
            ends: border.ends,
            facets: border.facets,
            sharp: border.count == 1 || {
                let [a, b] = border.facets.map(|k| facets[k as usize].region);
                a != b
            },
            share: 1.0,
        };
        Self {
            edges: all.into_iter().map(edge).collect(),
            vertices: vertices.collect(),
            facets,
        }
    }

    /// The surface of a mesh.
    pub fn new(mesh: &Mesh<3>) -> Self {
        let outer = outer_facets(mesh);
        // The facet that each part belongs to.
        let mut whole: Vec<u32> = Vec::with_capacity(outer.len());
        let mut facets: Vec<OuterFacet> = Vec::with_capacity(outer.len());
        for (number, (facet, region)) in (0..).zip(&outer) {
            let nodes = facet_nodes(facet);
            for places in face_parts(nodes.len()) {
                let corner = |k: usize| nodes[places[k.min(places.len() - 1)]];
                facets.push(OuterFacet {
                    nodes: std::array::from_fn(corner),
                    vertices: [0; 4],
                    region: *region,
                });
                whole.push(number);
            }
        }
        let normals: Vec<[f64; 3]> = (facets.par_iter())
            .map(|facet| facet.normal(mesh).1)
            .collect();
        let edges = edges(&facets, &normals, &whole);
        let vertices = vertices(mesh, &mut facets, &normals, &edges);
        Self {
            facets,
            vertices,
            edges,
        }
    }
}

/// The facets of one element only with the region of that, ordered by region.
fn outer_facets(mesh: &Mesh<3>) -> Vec<(Facet<3>, u32)> {
    // The corners of a facet in order, its element, and which of those of the element it is.
    let elements = (0_u32..).zip(&mesh.elements);
    let mut all: Vec<([u32; 4], u32, u8)> = Vec::new();
    for (number, element) in elements {
        for (place, facet) in (0..).zip(element.facets()) {
            let mut corners = [u32::MAX; 4];
            for (corner, &node) in corners.iter_mut().zip(facet_corners(&facet)) {
                *corner = node;
            }
            corners.sort_unstable();
            all.push((corners, number, place));
        }
    }
    all.par_sort_unstable();
    let groups = all.chunk_by(|a, b| a.0 == b.0);
    let alone = groups.filter(|group| group.len() == 1).map(|group| {
        let element = &mesh.elements[group[0].1 as usize];
        let facet = element.facets().nth(usize::from(group[0].2));
        (facet.unwrap_or_default(), element.region)
    });
    let mut outer: Vec<_> = alone.collect();
    outer.par_sort_by_key(|&(_, region)| region);
    outer
}

/// An edge of facets, from the lower to the higher node.
pub(super) struct Border {
    pub ends: [u32; 2],
    /// The first and the last facet that have it, and how many there are.
    pub facets: [u32; 2],
    pub count: usize,
}

/// The edges of facets or elements of the plane, by their nodes, each once; those of second order in halves.
pub(super) fn borders<'a>(facets: impl Iterator<Item = &'a [u32]>) -> Vec<Border> {
    let mut sides: Vec<([u32; 2], u32)> = Vec::new();
    for (number, nodes) in (0..).zip(facets) {
        let ring = face_ring(nodes.len());
        for (i, &a) in ring.iter().enumerate() {
            let [a, b] = [a, ring[(i + 1) % ring.len()]].map(|place| nodes[place]);
            sides.push(([a.min(b), a.max(b)], number));
        }
    }
    sides.par_sort_unstable();
    let groups = sides.chunk_by(|a, b| a.0 == b.0);
    let border = |group: &[([u32; 2], u32)]| Border {
        ends: group[0].0,
        facets: [group[0].1, group[group.len() - 1].1],
        count: group.len(),
    };
    groups.map(border).collect()
}

/// The edges of the surface; `whole` gives the facet that each is a part of. An edge between facets of several bodies, or of
/// more than two facets, is sharp.
fn edges(facets: &[OuterFacet], normals: &[[f64; 3]], whole: &[u32]) -> Vec<Edge> {
    let is_part = |k: usize| {
        let beside = |other: Option<&u32>| other == Some(&whole[k]);
        beside(whole.get(k + 1)) || (k > 0 && beside(whole.get(k - 1)))
    };
    let edge = |border: Border| {
        let [a, b] = border.facets.map(|k| k as usize);
        let is_inner = border.count == 2 && whole[a] == whole[b];
        let bends = || dot(normals[a], normals[b]) < SMOOTH;
        let meet = border.count != 2 || facets[a].region != facets[b].region;
        Edge {
            ends: border.ends,
            facets: border.facets,
            sharp: meet || (!is_inner && bends()),
            share: match (is_inner, is_part(a)) {
                (true, _) => 0.0,
                (_, true) => 0.5,
                _ => 1.0,
            },
        }
    };
    let all = borders(facets.iter().map(|facet| facet_nodes(&facet.nodes)));
    all.into_iter().map(edge).collect()
}

/// The representative of the set of i.
pub(super) fn root(joined: &mut [u32], mut i: u32) -> u32 {
    while joined[i as usize] != i {
        joined[i as usize] = joined[joined[i as usize] as usize];
        i = joined[i as usize];
    }
    i
}

/// Joins two sets.
pub(super) fn join(joined: &mut [u32], pair: [u32; 2]) {
    let [a, b] = pair.map(|i| root(joined, i));
    joined[a.max(b) as usize] = a.min(b);
}

/// The vertices; facets receive theirs.
fn vertices(
    mesh: &Mesh<3>,
    facets: &mut [OuterFacet],
    normals: &[[f64; 3]],
    edges: &[Edge],
) -> Vec<Vertex> {
    // Corners of neighbours are joined along edges that are not sharp.
    let mut joined: Vec<u32> = (0..4 * facets.len() as u32).collect();
    let corner = |facet: u32, node: u32| {
        let nodes = &facets[facet as usize].nodes;
        let place = nodes.iter().position(|&n| n == node);
        4 * facet + place.unwrap_or(0) as u32
    };
    for edge in edges.iter().filter(|edge| !edge.sharp) {
        for node in edge.ends {
            join(&mut joined, edge.facets.map(|facet| corner(facet, node)));
        }
    }
    let mut number = vec![u32::MAX; joined.len()];
    let mut vertices: Vec<Vertex> = Vec::new();
    for (f, facet) in facets.iter_mut().enumerate() {
        let nodes = facet_nodes(&facet.nodes);
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
        facet.vertices = corners;
    }
    for vertex in &mut vertices {
        let normal = unit(vertex.normal);
        let is_finite = normal.iter().all(|v| v.is_finite());
        vertex.normal = if is_finite { normal } else { [0.0, 0.0, 1.0] };
    }
    vertices
}

/// The angle of a facet at one of its corners.
fn angle(mesh: &Mesh<3>, nodes: &[u32], corner: usize) -> f64 {
    let place = |k: usize| mesh.nodes[nodes[k % nodes.len()] as usize];
    let here = place(corner);
    let [a, b] = [1, nodes.len() - 1].map(|k| minus(place(corner + k), here));
    length(cross(a, b)).atan2(dot(a, b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::structured::{SolidShape, block};

    #[test]
    fn a_box_has_six_faces_with_edges_between() {
        let (size, hexahedra) = ([2.0, 1.0, 1.0], SolidShape::Hexahedron);
        let mesh = block([0.0; 3], size, [4, 2, 3], hexahedra, "body", "");
        let surface = Surface::new(&mesh);
        assert_eq!(surface.facets.len(), 2 * (4 * 2 + 4 * 3 + 2 * 3));
        let sharp: Vec<&Edge> = surface.edges.iter().filter(|e| e.sharp).collect();
        assert_eq!(sharp.len(), 4 * (4 + 2 + 3));
        // Corners of the box have three vertices, its edges two.
        let inner = 2 * (3 + 3 * 2 + 2);
        assert_eq!(surface.vertices.len(), inner + 2 * 4 * (3 + 1 + 2) + 3 * 8);
        assert!(surface.edges.iter().all(|edge| edge.share == 1.0));
        for facet in &surface.facets {
            let (_, normal) = facet.normal(&mesh);
            for &corner in facet.corners() {
                let vertex = surface.vertices[corner as usize];
                assert!(facet.nodes.contains(&vertex.node));
                assert!(dot(vertex.normal, normal) > 1.0 - 1e-12);
            }
        }
    }

    /// Facets of second order are stored in parts, and the edges inside a facet are not edges of elements.
    #[test]
    fn curved_facets_are_parts_at_their_nodes() {
        let size = [2.0, 1.0, 1.0];
        for (shape, per_cell) in [
            (SolidShape::Hexahedron, 4),
            (SolidShape::Tetrahedron, 2 * 4),
        ] {
            let linear = block([0.0; 3], size, [4, 2, 3], shape, "body", "");
            let before = Surface::new(&linear);
            let mesh = linear.raised().unwrap_or_else(|error| panic!("{error}"));
            let surface = Surface::new(&mesh);
            let cells = 2 * (4 * 2 + 4 * 3 + 2 * 3);
            assert_eq!(surface.facets.len(), cells * per_cell);
            let area = surface.facets.iter().map(|facet| facet.normal(&mesh).0);
            assert!((area.sum::<f64>() - 10.0).abs() < 1e-12);
            let shares = surface.edges.iter().map(|edge| edge.share);
            assert_eq!(shares.sum::<f64>(), before.edges.len() as f64);
            let sharp = surface.edges.iter().filter(|e| e.sharp);
            assert_eq!(sharp.count(), 2 * 4 * (4 + 2 + 3));
            assert!((surface.edges.iter()).all(|edge| !edge.sharp || edge.share == 0.5));
            let corners = surface.facets.iter().flat_map(|facet| facet.nodes);
            let seen: std::collections::BTreeSet<u32> = corners.collect();
            let on_side = |x: &[f64; 3]| (0..3).any(|c| x[c] == 0.0 || x[c] == size[c]);
            assert_eq!(seen.len(), mesh.nodes.iter().filter(|x| on_side(x)).count());
        }
    }
}
