//! The corners of second-order elements.

use super::{Body, Deformed, Unknowns, assemble_rows};
use crate::mesh::{Element, ElementKind, Mesh, Topology};
use crate::problem::Vertices;
use crate::ranks::Halo;
use crate::sparse::BlockCsr;
use std::sync::Arc;

/// Whether an element has nodes on its edges.
fn is_of_second_order<const D: usize>(element: &Element<D>) -> bool
where
    ElementKind: Topology<D>,
{
    element.kind().order() == 2
}

/// The dependence of the nodes of second-order elements on their corners, and the unknowns of the corners.
fn corners_of<const D: usize>(mesh: &Mesh<D>, unknowns: &Unknowns<D>) -> (BlockCsr<D>, Unknowns<D>)
where
    ElementKind: Topology<D>,
{
    // The corners on either side of a midside node; it may be in the middle of many elements, and is the same in all.
    let mut of_node: Vec<Vec<u32>> = vec![Vec::new(); mesh.nodes.len()];
    for element in mesh
        .elements
        .iter()
        .filter(|element| is_of_second_order(element))
    {
        let (kind, nodes) = (element.kind(), element.nodes());
        for (&node, of) in nodes[kind.n_corners()..].iter().zip(kind.middles()) {
            let corners = &mut of_node[node as usize];
            if corners.is_empty() {
                corners.extend(of.iter().map(|&corner| nodes[corner]));
            }
        }
    }
    // Middles are left out as if they were held.
    let prescribed = (0..).zip(&of_node).map(|(node, of)| {
        if of.is_empty() {
            unknowns.prescribed(node)
        } else {
            [Some(0.0); D]
        }
    });
    let frames = unknowns.frames().iter();
    let frames = frames.filter(|(node, _)| of_node[**node as usize].is_empty());
    let corners = Unknowns::new(prescribed.collect())
        .along(frames.map(|(&node, &frame)| (node, frame)).collect())
        .bedded(Arc::new(unknowns.bedding().on_vertices(&of_node)));
    let identity: [[f64; D]; D] =
        std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    let (mut row_ptr, mut columns, mut blocks) = (vec![0], Vec::new(), Vec::new());
    for row in 0..unknowns.n_blocks() {
        let node = unknowns.node(row);
        let of = &of_node[node as usize];
        // A corner follows itself, including its held components.
        let own = corners.block(node).filter(|_| of.is_empty());
        let mut entries: Vec<(u32, [[f64; D]; D])> =
            own.map(|column| (column, identity)).into_iter().collect();
        for &corner in of {
            let Some(column) = corners.block(corner) else {
                continue;
            };
            let weight = 1.0 / of.len() as f64;
            // The free part of the corner, and of that the free part of the node.
            let mut block = [[0.0; D]; D];
            for j in 0..D {
                let free = unknowns.free_part(node, corners.free_part(corner, identity[j]));
                (0..D).for_each(|i| block[i][j] = weight * free[i]);
            }
            entries.push((column, block));
        }
        entries.sort_by_key(|entry| entry.0);
        for (column, block) in entries {
            columns.push(column);
            blocks.push(block);
        }
        row_ptr.push(columns.len());
    }
    let prolongation = BlockCsr::from_parts(
        unknowns.n_blocks(),
        corners.n_blocks(),
        row_ptr,
        columns,
        blocks,
    );
    (prolongation, corners)
}

/// The dependence of the nodes of second-order elements on their corners, with the stiffness matrix of first-order elements on
/// these; None if all elements are of first order. Where the dilatation of a material is projected, the matrix is made from K
/// instead, because elements of first order would project it differently.
pub fn vertices<const D: usize>(body: &Body<D>, unknowns: &Unknowns<D>) -> Option<Vertices<D>>
where
    ElementKind: Topology<D>,
{
    let alone = Halo::alone(unknowns.n_blocks());
    vertices_of_rows(body, unknowns, &alone, true).map(|(vertices, _)| vertices)
}

/// The same of the rows of K on a rank, with the halo of their corners; None also if the ranks see different corners, where
/// elements of both orders meet. If K is not that of the body alone, the matrix of the corners is not `assembled`.
pub(crate) fn vertices_of_rows<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    nodes: &Halo,
    assembled: bool,
) -> Option<(Vertices<D>, Halo)>
where
    ElementKind: Topology<D>,
{
    /// The number of a node that is not a corner.
    const NONE: u64 = u64::MAX;
    let (mesh, ranks) = (body.mesh, nodes.ranks());
    if !ranks.any(mesh.elements.iter().any(is_of_second_order)) {
        return None;
    }
    let (prolongation, corners) = corners_of(mesh, unknowns);
    let block = |corner: usize| unknowns.block(corners.node(corner));
    let is_own =
        |corner: &usize| block(*corner).is_some_and(|block| (block as usize) < nodes.own());
    let count = (0..corners.n_blocks()).take_while(is_own).count();
    let own = nodes.of_own(count);
    let mut numbers = vec![NONE; nodes.own()];
    for corner in 0..count {
        if let Some(block) = block(corner) {
            numbers[block as usize] = own.number(corner);
        }
    }
    let numbers = nodes.extended(1, numbers);
    let others: Vec<u64> = (count..corners.n_blocks())
        .map(|corner| block(corner).map_or(NONE, |block| numbers[block as usize]))
        .collect();
    if ranks.any(others.contains(&NONE)) {
        return None;
    }
    let projected = (body.materials.iter()).any(|material| material.is_projected(body.plane));
    let stiffness = (assembled && !projected).then(|| {
        let linear = Mesh {
            nodes: mesh.nodes.clone(),
            elements: mesh.elements.iter().map(Element::linear).collect(),
            regions: mesh.regions.clone(),
            groups: Default::default(),
            boundaries: Default::default(),
            node_sets: Default::default(),
            faults: Default::default(),
            notes: Default::default(),
            twins: Default::default(),
            lost: Default::default(),
        };
        let linear = Body {
            mesh: &linear,
            ..*body
        };
        assemble_rows(&linear, &corners, count)
    });
    let mut points = corners.coordinates(mesh);
    points.truncate(count);
    let vertices = Vertices {
        prolongation: prolongation.truncated(nodes.own()),
        stiffness,
        points,
    };
    Some((vertices, Halo::new(ranks, count, others)))
}

impl<const D: usize> Deformed<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The same where the bodies are: the matrix of the corners is made from the tangent.
    pub(crate) fn vertices(&self, unknowns: &Unknowns<D>) -> Option<Vertices<D>> {
        (self.body.mesh.elements.iter()).find(|element| is_of_second_order(element))?;
        let (prolongation, corners) = corners_of(self.body.mesh, unknowns);
        let mut points = corners.coordinates(self.body.mesh);
        for (block, point) in points.iter_mut().enumerate() {
            let moved = self.displacement[corners.node(block) as usize];
            (0..D).for_each(|c| point[c] += moved[c]);
        }
        Some(Vertices {
            prolongation,
            stiffness: None,
            points,
        })
    }
}
