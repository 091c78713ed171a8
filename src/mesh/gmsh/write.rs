//! Meshes as files of Gmsh, MSH 2.2 in ASCII: to view meshes read from other formats.

use super::{TYPES, in_gmshs_order};
use crate::mesh::file::raw::Cell;
use crate::mesh::shape::face_kind;
use crate::mesh::{AnyMesh, ElementKind, Mesh, Topology, facet_nodes};
use std::fmt::Write as _;

/// The text of a file with the mesh and its regions, boundaries and sets of nodes under their names.
pub fn msh(mesh: &AnyMesh) -> String {
    match mesh {
        AnyMesh::Plane(mesh) => text(mesh),
        AnyMesh::Space(mesh) => text(mesh),
    }
}

/// Gmsh's number for a point.
const POINT: i64 = 15;

/// Gmsh's number for a kind of element.
fn number(kind: ElementKind) -> i64 {
    let of = |known: &&(i64, Cell)| known.1 == Cell::Element(kind);
    TYPES.iter().find(of).expect("every kind is known").0
}

/// Gmsh's number for a facet with so many nodes.
fn facet_number<const D: usize>(n_nodes: usize) -> i64 {
    match (D, n_nodes) {
        (2, 2) => 1,
        (2, _) => 8,
        _ => number(face_kind(n_nodes)),
    }
}

/// An element in several groups is written once for each, as Gmsh itself does.
fn text<const D: usize>(mesh: &Mesh<D>) -> String
where
    ElementKind: Topology<D>,
{
    // If other groups share the region of a group of one region, that group is only the name of the shared part.
    let named = |name: &String, regions: &Vec<u32>| {
        let alone = |&region: &u32| mesh.regions[region as usize] == *name;
        let elsewhere = |&region: &u32| {
            (mesh.groups.iter()).any(|(other, all)| other != name && all.contains(&region))
        };
        !(regions.len() == 1 && regions.iter().all(alone) && regions.iter().all(elsewhere))
    };
    let groups: Vec<(&String, &Vec<u32>)> = (mesh.groups.iter())
        .filter(|(name, regions)| named(name, regions))
        .collect();
    let boundaries: Vec<_> = (mesh.boundaries.iter())
        .filter(|boundary| !boundary.1.is_empty())
        .collect();
    let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames\n".to_owned();
    let mut put = |arguments: std::fmt::Arguments| {
        // Nothing is in the way of writing into a text.
        let _ = text.write_fmt(arguments);
        text.push('\n');
    };
    let node_sets: Vec<_> = (mesh.node_sets.iter())
        .filter(|set| !set.1.is_empty())
        .collect();
    let n_names = groups.len() + boundaries.len() + node_sets.len();
    put(format_args!("{n_names}"));
    for (tag, (name, _)) in (1..).zip(&groups) {
        put(format_args!("{D} {tag} \"{name}\""));
    }
    for (tag, (name, _)) in (1..).zip(&boundaries) {
        put(format_args!("{} {tag} \"{name}\"", D - 1));
    }
    for (tag, (name, _)) in (1..).zip(&node_sets) {
        put(format_args!("0 {tag} \"{name}\""));
    }
    put(format_args!(
        "$EndPhysicalNames\n$Nodes\n{}",
        mesh.nodes.len()
    ));
    for (node, x) in (1..).zip(&mesh.nodes) {
        let z = x.get(2).copied().unwrap_or(0.0);
        put(format_args!("{node} {:?} {:?} {z:?}", x[0], x[1]));
    }
    let mut tags_of: Vec<Vec<usize>> = vec![Vec::new(); mesh.regions.len()];
    for (tag, (_, regions)) in (1..).zip(&groups) {
        regions
            .iter()
            .for_each(|&region| tags_of[region as usize].push(tag));
    }
    let mut rows: Vec<(i64, usize, Vec<u32>)> = Vec::new();
    for (tag, (_, nodes)) in (1..).zip(&node_sets) {
        rows.extend(nodes.iter().map(|&node| (POINT, tag, vec![node])));
    }
    for (tag, (_, facets)) in (1..).zip(&boundaries) {
        let facets = facets.iter().map(facet_nodes);
        rows.extend(facets.map(|nodes| (facet_number::<D>(nodes.len()), tag, nodes.to_vec())));
    }
    for element in &mesh.elements {
        let kind = element.kind();
        for &tag in &tags_of[element.region as usize] {
            let nodes = in_gmshs_order(kind, element.nodes());
            rows.push((number(kind), tag, nodes));
        }
    }
    put(format_args!("$EndNodes\n$Elements\n{}", rows.len()));
    for (row, (kind, tag, nodes)) in (1..).zip(rows) {
        let nodes: Vec<String> = nodes.iter().map(|node| (node + 1).to_string()).collect();
        put(format_args!(
            "{row} {kind} 2 {tag} {tag} {}",
            nodes.join(" ")
        ));
    }
    put(format_args!("$EndElements"));
    text
}
