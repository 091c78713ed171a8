//! Supports, and the numbering of what they leave free.

use crate::mesh::{Kind, Mesh, Topology};

/// Which displacement components are prescribed, and the numbering of the rest.
///
/// A node with at least one free component is a *block* of D unknowns; components prescribed at such
/// a node keep a decoupled equation (u = 0) so that every block is D × D. Nodes prescribed in all
/// components are not in the system.
#[derive(Clone, Debug)]
pub struct Unknowns<const D: usize = 2> {
    prescribed: Vec<[Option<f64>; D]>,
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
            block_of_node,
            node_of_block,
            n_free,
        }
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

    /// The prescribed value of a component of a node.
    pub fn prescribed(&self, node: u32) -> [Option<f64>; D] {
        self.prescribed[node as usize]
    }

    /// Displacement of every node from the solution `u` of the system.
    pub fn displacements(&self, u: &[f64]) -> Vec<[f64; D]> {
        self.prescribed
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
            .collect()
    }

    /// Coordinates of the nodes of the blocks (for rigid body modes).
    pub fn coordinates(&self, mesh: &Mesh<D>) -> Vec<[f64; D]>
    where
        Kind: Topology<D>,
    {
        self.node_of_block
            .iter()
            .map(|&node| mesh.nodes[node as usize])
            .collect()
    }
}
