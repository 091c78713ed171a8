//! The corners of second-order elements: the first coarse level of multigrid.

use crate::sparse::BlockCsr;
use std::borrow::Cow;

/// The dependence of the nodes of second-order elements on their corners, and the stiffness matrix of the corners.
///
/// A displacement that is linear along the edges is known from the corners alone. Such displacements contain most of
/// the soft modes. Their matrix is that of first-order elements on the same corners, with a seventh of the rows
/// (Sundar, Stadler and Biros 2015 compare such hierarchies).
#[derive(Clone, Debug)]
pub struct Vertices<const D: usize = 2> {
    /// From the displacements of the corners to those of all nodes: a block row for each node of K, a block column for each
    /// corner.
    pub prolongation: BlockCsr<D, D>,
    /// The matrix of the corners; None if it is to be made as PᵀKP.
    pub stiffness: Option<BlockCsr<D>>,
    /// The places of the corners.
    pub points: Vec<[f64; D]>,
}

impl<const D: usize> Vertices<D> {
    /// The same where some unknowns of K are tied to the ground, with so much stiffness.
    pub(crate) fn grounded(&self, ties: &[(u32, f64)]) -> Cow<'_, Self> {
        if ties.is_empty() || self.stiffness.is_none() {
            return Cow::Borrowed(self);
        }
        let mut grounded = self.clone();
        let Self {
            prolongation,
            stiffness: Some(stiffness),
            ..
        } = &mut grounded
        else {
            return Cow::Owned(grounded);
        };
        for &(unknown, tie) in ties {
            let (node, component) = (unknown as usize / D, unknown as usize % D);
            let (corners, weights) = prolongation.row(node);
            for (&i, left) in corners.iter().zip(weights) {
                for (&j, right) in corners.iter().zip(weights) {
                    // Corners of one element: the block is there.
                    if let Some(block) = stiffness.block_mut(i as usize, j as usize) {
                        for a in 0..D {
                            for b in 0..D {
                                block[a][b] += tie * left[component][a] * right[component][b];
                            }
                        }
                    }
                }
            }
        }
        Cow::Owned(grounded)
    }
}
