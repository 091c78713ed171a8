//! Supports, and the numbering of the free unknowns.

use super::Bedding;
use crate::mesh::vector::dot;
use crate::mesh::{ElementKind, Mesh, Topology};
use std::collections::BTreeMap;
use std::sync::Arc;

/// The prescribed displacement components, and the numbering of the others.
///
/// A node with at least one free component is a *block* of D unknowns. Components prescribed at such a node keep a
/// decoupled equation (u = 0) so that every block is D × D. Nodes prescribed in all components are not in the system.
///
/// Components are those along the axes or, at nodes with their own directions ([`Unknowns::along`]), along these. The
/// unknowns of such nodes are still along the axes, so that rigid-body motions have the same form everywhere. A
/// prescribed component along n is projected out of K and f, P = I − n nᵀ, and has the decoupled equation k n·u = 0.
#[derive(Clone, Debug)]
pub struct Unknowns<const D: usize = 2> {
    prescribed: Vec<[Option<f64>; D]>,
    /// Orthonormal directions of nodes whose components are not along the axes, one a row.
    frames: BTreeMap<u32, [[f64; D]; D]>,
    /// The elastic supports of nodes.
    bedding: Arc<Bedding<D>>,
    block_of_node: Vec<Option<u32>>,
    node_of_block: Vec<u32>,
    n_free: usize,
}

impl<const D: usize> Unknowns<D> {
    /// The numbering for `prescribed[node][component]` (None: free).
    pub fn new(prescribed: Vec<[Option<f64>; D]>) -> Self {
        let mut node_of_block = Vec::with_capacity(prescribed.len());
        let block_of_node = prescribed
            .iter()
            .enumerate()
            .map(|(node, components)| {
                components.iter().any(Option::is_none).then(|| {
                    node_of_block.push(node as u32);
                    node_of_block.len() as u32 - 1
                })
            })
            .collect();
        let n_free = prescribed.iter().flatten().filter(|c| c.is_none()).count();
        Self {
            prescribed,
            frames: BTreeMap::new(),
            bedding: Arc::default(),
            block_of_node,
            node_of_block,
            n_free,
        }
    }

    /// Sets the orthonormal directions, one a row, along which the components of some nodes are prescribed.
    pub fn along(mut self, frames: BTreeMap<u32, [[f64; D]; D]>) -> Self {
        self.frames = frames;
        self
    }

    /// States the elastic supports of nodes.
    pub(crate) fn bedded(self, bedding: Arc<Bedding<D>>) -> Self {
        Self { bedding, ..self }
    }

    /// The elastic supports of nodes: foundations.
    pub(crate) fn bedding(&self) -> &Bedding<D> {
        &self.bedding
    }

    /// The nodes whose components are not along the axes, with their directions.
    pub(super) fn frames(&self) -> &BTreeMap<u32, [[f64; D]; D]> {
        &self.frames
    }

    /// The directions of the components of a node, where they are not the axes.
    pub fn frame(&self, node: u32) -> Option<&[[f64; D]; D]> {
        self.frames.get(&node)
    }

    /// The part of a vector at a node that supports leave free.
    pub fn free_part(&self, node: u32, v: [f64; D]) -> [f64; D] {
        let held = self.prescribed[node as usize];
        let mut left = v;
        match self.frame(node) {
            None => (0..D)
                .filter(|&c| held[c].is_some())
                .for_each(|c| left[c] = 0.0),
            Some(frame) => {
                for (way, _) in frame.iter().zip(held).filter(|(_, held)| held.is_some()) {
                    let part = dot(*way, v);
                    (0..D).for_each(|c| left[c] -= part * way[c]);
                }
            }
        }
        left
    }

    /// Whether a node has its own directions.
    pub(super) fn is_turned(&self, node: u32) -> bool {
        !self.frames.is_empty() && self.frames.contains_key(&node)
    }

    /// The displacement of a node with its own directions from that of its block, if it has one.
    fn turned_displacement(&self, node: u32, frame: &[[f64; D]; D], u: [f64; D]) -> [f64; D] {
        let mut sum = self.free_part(node, u);
        for (way, value) in frame.iter().zip(self.prescribed[node as usize]) {
            let value = value.unwrap_or(0.0);
            (0..D).for_each(|c| sum[c] += value * way[c]);
        }
        sum
    }

    /// Number of free displacement components.
    pub fn n_free(&self) -> usize {
        self.n_free
    }

    /// Number of blocks: K has D times as many rows.
    pub fn n_blocks(&self) -> usize {
        self.node_of_block.len()
    }

    /// The block of a node, if any of its components is free.
    pub fn block(&self, node: u32) -> Option<u32> {
        self.block_of_node[node as usize]
    }

    /// The node of a block.
    pub fn node(&self, block: usize) -> u32 {
        self.node_of_block[block]
    }

    /// The prescribed values of the components of a node: along the axes, or along its own directions.
    pub fn prescribed(&self, node: u32) -> [Option<f64>; D] {
        self.prescribed[node as usize]
    }

    /// Displacement of every node from the solution `u` of the system.
    pub fn displacements(&self, u: &[f64]) -> Vec<[f64; D]> {
        let mut all: Vec<[f64; D]> = self
            .prescribed
            .iter()
            .zip(&self.block_of_node)
            .map(|(prescribed, block)| {
                std::array::from_fn(|c| {
                    prescribed[c].unwrap_or_else(|| {
                        let block = block.expect("a node with a free component has a block");
                        u[D * block as usize + c]
                    })
                })
            })
            .collect();
        for (&node, frame) in &self.frames {
            let of_block = self.block(node).map_or([0.0; D], |block| {
                std::array::from_fn(|c| u[D * block as usize + c])
            });
            all[node as usize] = self.turned_displacement(node, frame, of_block);
        }
        all
    }

    /// The same with the remaining part of prescribed displacements, after all nodes have moved by `moved`.
    pub(crate) fn left_of(&self, moved: &[[f64; D]]) -> Self {
        let mut left = self.clone();
        for (node, (all, u)) in (0..).zip(left.prescribed.iter_mut().zip(moved)) {
            for (c, value) in all.iter_mut().enumerate() {
                if let Some(value) = value {
                    *value -= self.frame(node).map_or(u[c], |frame| dot(frame[c], *u));
                }
            }
        }
        left
    }

    /// Coordinates of the nodes of the blocks (for rigid body modes).
    pub fn coordinates(&self, mesh: &Mesh<D>) -> Vec<[f64; D]>
    where
        ElementKind: Topology<D>,
    {
        self.node_of_block
            .iter()
            .map(|&node| mesh.nodes[node as usize])
            .collect()
    }
}
