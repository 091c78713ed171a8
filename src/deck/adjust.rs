//! `ADJUST=`: nodes that are moved onto the opposite surface, before anything else, without strain.

use crate::mesh::foot::on_facet;
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{
    AnyMesh, ElementKind, Facet, Mesh, MeshError, MeshParts, Topology, bounds, facet_nodes,
};
use rstar::RTree;
use rstar::primitives::{GeomWithData, Rectangle};

/// The nodes of the slave surface to move.
#[derive(Clone, Debug)]
pub(super) enum Moved {
    /// Nodes within a distance, and overlapping ones.
    Within(f64),
    /// Those of a set, wherever they are.
    Set(String),
}

/// The adjustment that a contact pair states; names are those of the mesh.
#[derive(Clone, Debug)]
pub(super) struct Adjustment {
    pub line: usize,
    /// A boundary; a set of nodes as well, if it consists of nodes.
    pub slave: String,
    pub of_nodes: bool,
    pub master: String,
    pub moved: Moved,
}

/// The number of facets to check, nearest by their boxes: as many as may meet at a node of a regular mesh.
const NEAREST: usize = 8;
/// A node may be beyond the rim of the master surface by this part of a facet, like nodes in contact.
const BEYOND: f64 = 0.05;

/// The mesh with the nodes moved.
pub(super) fn adjusted(mesh: AnyMesh, all: &[Adjustment]) -> Result<AnyMesh, (usize, MeshError)> {
    Ok(match mesh {
        AnyMesh::Plane(mesh) => AnyMesh::Plane(of(mesh, all)?),
        AnyMesh::Space(mesh) => AnyMesh::Space(of(mesh, all)?),
    })
}

fn of<const D: usize>(mut mesh: Mesh<D>, all: &[Adjustment]) -> Result<Mesh<D>, (usize, MeshError)>
where
    ElementKind: Topology<D>,
{
    for adjustment in all {
        let facets = |name: &str| mesh.boundaries.get(name).map_or(&[][..], Vec::as_slice);
        let set = |name: &str| mesh.node_sets.get(name).map_or(&[][..], Vec::as_slice);
        let of_facets = facets(&adjustment.slave).iter().flat_map(facet_nodes);
        let own = match adjustment.of_nodes {
            true => set(&adjustment.slave),
            false => &[],
        };
        let mut slaves: Vec<u32> = of_facets.chain(own).copied().collect();
        slaves.sort_unstable();
        slaves.dedup();
        if let Moved::Set(name) = &adjustment.moved {
            slaves.retain(|node| set(name).binary_search(node).is_ok());
        }
        let boxed = facets(&adjustment.master).iter().map(|facet| {
            let (low, high) = bounds(facet_nodes(facet).iter().map(|&n| mesh.nodes[n as usize]));
            let corners = Rectangle::from_corners(in_space(low), in_space(high));
            GeomWithData::new(corners, *facet)
        });
        let tree = RTree::bulk_load(boxed.collect());
        let places: Vec<(u32, [f64; D])> = (slaves.into_iter())
            .filter_map(|node| Some((node, target(&mesh, &tree, node, &adjustment.moved)?)))
            .collect();
        for (node, place) in places {
            mesh.nodes[node as usize] = place;
        }
        let parts = MeshParts {
            nodes: mesh.nodes,
            elements: mesh.elements,
            regions: mesh.regions,
            groups: mesh.groups,
            boundaries: mesh.boundaries,
            node_sets: mesh.node_sets,
            notes: mesh.notes,
        };
        mesh = Mesh::from_parts(parts).map_err(|error| (adjustment.line, error))?;
    }
    Ok(mesh)
}

type Tree<F> = RTree<GeomWithData<Rectangle<[f64; 3]>, F>>;

/// A point in space, wherever it is.
fn in_space<const D: usize>(x: [f64; D]) -> [f64; 3] {
    std::array::from_fn(|c| x.get(c).copied().unwrap_or(0.0))
}

/// The new position of a node: the nearest point of the master surface, if the node is to move.
fn target<const D: usize>(
    mesh: &Mesh<D>,
    tree: &Tree<Facet<D>>,
    node: u32,
    moved: &Moved,
) -> Option<[f64; D]>
where
    ElementKind: Topology<D>,
{
    let x = mesh.nodes[node as usize];
    // Its miss, the point, the distance along the normal, and the size of the facet.
    let mut best: Option<(f64, [f64; D], f64, f64)> = None;
    for near in tree.nearest_neighbor_iter(in_space(x)).take(NEAREST) {
        let facet = &near.data;
        let nodes: Vec<[f64; D]> = (facet_nodes(facet).iter())
            .map(|&node| mesh.nodes[node as usize])
            .collect();
        let (low, high) = bounds(nodes.iter().copied());
        let size = length(minus(high, low));
        let foot = on_facet(facet, &nodes, x);
        let weights = || foot.shape.iter().zip(&nodes);
        let point: [f64; D] = std::array::from_fn(|c| weights().map(|(w, y)| w * y[c]).sum());
        let offset = minus(x, point);
        let gap = dot(offset, mesh.facet_normal(facet).1);
        // Beyond the rim of a facet its miss is larger than the distance from it.
        let beyond = foot.miss - length(offset) > BEYOND * size;
        if !beyond && best.is_none_or(|(miss, ..)| foot.miss < miss) {
            best = Some((foot.miss, point, gap, size));
        }
    }
    let (_, point, gap, size) = best?;
    match moved {
        // A node deeper than a facet's length is on the other side of something.
        Moved::Within(distance) if gap > *distance || gap < -size => None,
        _ => Some(point),
    }
}
