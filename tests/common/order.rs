//! Meshes of either order.

use super::or_panic::OrPanic as _;
use signorini::mesh::{Element, ElementKind, Mesh, Topology};

/// The order of elements: first, second with all nodes, or second without nodes in the middle of faces and elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Order {
    First,
    Lagrange,
    Serendipity,
}

/// A mesh of first order with elements of an order.
pub fn of_order<const D: usize>(mesh: Mesh<D>, order: Order) -> Mesh<D>
where
    ElementKind: Topology<D>,
{
    if order == Order::First {
        return mesh;
    }
    let mesh = mesh.raised().or_panic();
    if order == Order::Lagrange {
        return mesh;
    }
    let elements = mesh.elements.iter().map(|element| {
        let kind = match element.kind() {
            ElementKind::Quad9 => ElementKind::Quad8,
            ElementKind::Hexahedron27 => ElementKind::Hexahedron20,
            ElementKind::Wedge18 => ElementKind::Wedge15,
            kind => kind,
        };
        Element::new(kind, &element.nodes()[..kind.n_nodes()], element.region)
    });
    let elements = elements.collect();
    Mesh::new(mesh.nodes, elements, mesh.regions, mesh.boundaries).or_panic()
}
