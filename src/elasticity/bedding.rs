//! Elastic foundations under boundaries: their part of K, beside the elements.
//!
//! A foundation resists with a force per area in proportion to the displacement, ∫ v·(k_ν ν νᵀ + k_τ (I − ν νᵀ)) u ds. Both nodes of
//! each of its blocks are of one facet, and so of one element. The bars of nodes without a mesh are here, too, and rows of ties
//! that hold bodies.

use crate::mesh::FacetPoint;
use crate::mesh::vector::dot;
use std::collections::BTreeMap;

/// A block of a foundation: its row and its column, both nodes, and the number of the support that the foundation is.
pub(crate) type Place = (u32, u32, usize);

/// In place of that number: a bar or a row.
const INNER: usize = usize::MAX;

/// The stiffness of all foundations, in blocks of nodes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bedding<const D: usize> {
    blocks: BTreeMap<Place, [[f64; D]; D]>,
}

impl<const D: usize> Bedding<D> {
    /// Of blocks that are known.
    #[cfg(feature = "mpi")]
    pub fn of(blocks: impl Iterator<Item = (Place, [[f64; D]; D])>) -> Self {
        let blocks = blocks.collect();
        Self { blocks }
    }

    /// The blocks in the row of a node.
    pub fn row(&self, node: u32) -> impl Iterator<Item = (&Place, &[[f64; D]; D])> {
        self.blocks
            .range((node, 0, 0)..=(node, u32::MAX, usize::MAX))
    }

    fn add(&mut self, place: Place, block: [[f64; D]; D]) {
        let sum = self.blocks.entry(place).or_insert([[0.0; D]; D]);
        let entries = sum.as_flattened_mut().iter_mut();
        (entries.zip(block.as_flattened())).for_each(|(sum, more)| *sum += more);
    }

    /// Adds the part of a foundation with this stiffness per area, along the normal and across it, at an integration
    /// point of a facet, whose weight has its depth in it.
    pub fn add_point(
        &mut self,
        support: usize,
        nodes: &[u32],
        point: &FacetPoint<D>,
        weight: f64,
        [normal, tangential]: [f64; 2],
    ) {
        let nu = point.normal;
        let resists: [[f64; D]; D] = std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let along = nu[i] * nu[j];
                let across = f64::from(u8::from(i == j)) - along;
                normal * along + tangential * across
            })
        });
        for (&a, of_a) in nodes.iter().zip(point.shape) {
            for (&b, of_b) in nodes.iter().zip(point.shape) {
                let share = weight * (of_a * of_b);
                let block = resists.map(|row| row.map(|entry| share * entry));
                self.add((a, b, support), block);
            }
        }
    }

    /// Adds a bar between two nodes along a unit vector, or from a node to the ground where both are the same.
    pub fn add_bar(&mut self, [a, b]: [u32; 2], way: [f64; D], stiffness: f64) {
        let block = |sign: f64| way.map(|v| way.map(|w| sign * stiffness * v * w));
        self.add((a, a, INNER), block(1.0));
        if a != b {
            self.add((b, b, INNER), block(1.0));
            self.add((a, b, INNER), block(-1.0));
            self.add((b, a, INNER), block(-1.0));
        }
    }

    /// Adds the stiffness of a row, s bᵀb, in which b has a vector for each of these nodes.
    pub fn add_row(&mut self, row: &[(u32, [f64; D])], stiffness: f64) {
        for &(a, of_a) in row {
            for &(b, of_b) in row {
                let block = of_a.map(|v| of_b.map(|w| stiffness * v * w));
                self.add((a, b, INNER), block);
            }
        }
    }

    /// The same on the nodes that others follow: `follows` has the nodes whose mean each node is, or nothing where it
    /// is itself.
    pub fn on_vertices(&self, follows: &[Vec<u32>]) -> Self {
        let mut made = Self::default();
        for (&(a, b, support), block) in &self.blocks {
            let of = |node: u32| match &follows[node as usize][..] {
                [] => vec![node],
                some => some.to_vec(),
            };
            let (rows, columns) = (of(a), of(b));
            let share = ((rows.len() * columns.len()) as f64).recip();
            for &row in &rows {
                for &column in &columns {
                    let part = block.map(|row| row.map(|entry| share * entry));
                    made.add((row, column, support), part);
                }
            }
        }
        made
    }

    /// The forces that displacements of the nodes of foundations take, in parts: node, number of the support, force.
    pub fn forces<'b>(
        &'b self,
        displacement: &'b [[f64; D]],
    ) -> impl Iterator<Item = (u32, usize, [f64; D])> + 'b {
        let of_foundations = self.blocks.iter().filter(|(place, _)| place.2 != INNER);
        of_foundations.map(|(&(a, b, support), block)| {
            let u = displacement[b as usize];
            (a, support, block.map(|row| dot(row, u)))
        })
    }
}
