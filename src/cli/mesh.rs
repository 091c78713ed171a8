//! The description of a mesh in `check` and `convert`.

use signorini::mesh::{AnyMesh, ElementKind, Mesh, Topology};
use std::collections::BTreeSet;

/// The mesh, and the names that a case calls its parts by.
pub(super) fn described(mesh: &AnyMesh) -> Vec<String> {
    match mesh {
        AnyMesh::Plane(mesh) => parts(mesh),
        AnyMesh::Space(mesh) => parts(mesh),
    }
}

fn parts<const D: usize>(mesh: &Mesh<D>) -> Vec<String>
where
    ElementKind: Topology<D>,
{
    let mut lines = vec![size(mesh)];
    lines.extend(notes(mesh));
    let (measure, facets) = match D {
        2 => ("area", "edges"),
        _ => ("volume", "faces"),
    };
    let measures = mesh.measures();
    for (name, regions) in &mesh.groups {
        let size: f64 = (regions.iter())
            .map(|&region| measures[region as usize])
            .sum();
        lines.push(format!("region        \"{name}\": {measure} {size:.4e}"));
    }
    for (name, all) in &mesh.boundaries {
        let fault = (mesh.faults.get(name)).map_or(String::new(), |fault| format!("; {fault}"));
        lines.push(format!(
            "boundary      \"{name}\": {} {facets}{fault}",
            all.len()
        ));
    }
    lines.extend(node_sets(mesh));
    lines
}

/// The number of elements of each kind, with their order if it is not the first; in the plane triangles and
/// quadrilaterals of first order even if there are zero.
fn elements<const D: usize>(mesh: &Mesh<D>) -> String
where
    ElementKind: Topology<D>,
{
    let mut kinds = mesh.kinds();
    let orders: BTreeSet<usize> = kinds.iter().map(|(kind, _)| kind.order()).collect();
    if D == 2 && !orders.contains(&2) {
        kinds = [ElementKind::Triangle, ElementKind::Quad]
            .map(|kind| {
                (
                    kind,
                    mesh.elements.iter().filter(|e| e.kind() == kind).count(),
                )
            })
            .to_vec();
    }
    let counted: Vec<String> = (kinds.into_iter())
        .map(|(kind, count)| {
            let name = match kind.linear() {
                ElementKind::Triangle => "triangles",
                ElementKind::Quad => "quadrilaterals",
                ElementKind::Tetrahedron => "tetrahedra",
                ElementKind::Hexahedron => "hexahedra",
                ElementKind::Wedge => "wedges",
                _ => "pyramids",
            };
            match kind.order() {
                1 => format!("{count} {name}"),
                _ => format!("{count} {name} with {} nodes", kind.n_nodes()),
            }
        })
        .collect();
    let order = match (orders.contains(&1), orders.contains(&2)) {
        (_, false) => "",
        (false, true) => " (order 2)",
        (true, true) => " (orders 1 and 2)",
    };
    counted.join(", ") + order
}

/// The size of a mesh: nodes, elements, bodies, the box around it.
pub(super) fn size<const D: usize>(mesh: &Mesh<D>) -> String
where
    ElementKind: Topology<D>,
{
    let (low, high) = mesh.bounding_box();
    let sides: Vec<String> = (low.iter().zip(high))
        .map(|(low, high)| format!("[{low:.4e}, {high:.4e}]"))
        .collect();
    let (bodies, _) = mesh.bodies();
    format!(
        "mesh          {} nodes, {}, {bodies} {}; {}",
        mesh.nodes.len(),
        elements(mesh),
        if bodies == 1 { "body" } else { "bodies" },
        sides.join(" × "),
    )
}

/// Entries of a mesh file that have no effect.
pub(super) fn notes<const D: usize>(mesh: &Mesh<D>) -> impl Iterator<Item = String>
where
    ElementKind: Topology<D>,
{
    mesh.notes
        .iter()
        .map(|note| format!("              {note}"))
}

/// The sets of nodes.
pub(super) fn node_sets<const D: usize>(mesh: &Mesh<D>) -> impl Iterator<Item = String>
where
    ElementKind: Topology<D>,
{
    (mesh.node_sets.iter()).map(|(name, nodes)| match nodes.len() {
        1 => format!("nodes         \"{name}\": 1 node"),
        n => format!("nodes         \"{name}\": {n} nodes"),
    })
}
