//! The stiffness matrix, pattern first and row by row.

use super::element::{Element, Elements, Visit};
use super::{Body, Unknowns};
use crate::mesh::vector::dot;
use crate::mesh::{self, Kind, Mesh, Topology};
use crate::sparse::{BlockCsr, ROWS_PER_TASK};
use rayon::prelude::*;

/// For each node the elements around it, and its corner in each.
struct Incidence {
    start: Vec<u32>,
    elements: Vec<(u32, u8)>,
}

impl Incidence {
    fn new<const D: usize>(mesh: &Mesh<D>) -> Self
    where
        Kind: Topology<D>,
    {
        let mut start = vec![0u32; mesh.nodes.len() + 1];
        for element in &mesh.elements {
            for &node in element.nodes() {
                start[node as usize + 1] += 1;
            }
        }
        for i in 0..mesh.nodes.len() {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut elements = vec![(0, 0); *start.last().expect("never empty") as usize];
        for (e, element) in mesh.elements.iter().enumerate() {
            for (corner, &node) in element.nodes().iter().enumerate() {
                let place = &mut next[node as usize];
                elements[*place as usize] = (e as u32, corner as u8);
                *place += 1;
            }
        }
        Self { start, elements }
    }

    fn of(&self, node: u32) -> &[(u32, u8)] {
        let node = node as usize;
        &self.elements[self.start[node] as usize..self.start[node + 1] as usize]
    }
}

/// Splits a slice into the parts that the chunks of rows own.
fn split<'a, T>(mut slice: &'a mut [T], row_ptr: &[usize]) -> Vec<&'a mut [T]> {
    let n_rows = row_ptr.len() - 1;
    (0..n_rows)
        .step_by(ROWS_PER_TASK)
        .map(|first| {
            let last = (first + ROWS_PER_TASK).min(n_rows);
            let (head, tail) =
                std::mem::take(&mut slice).split_at_mut(row_ptr[last] - row_ptr[first]);
            slice = tail;
            head
        })
        .collect()
}

/// Hands the blocks of row `corner` of an element's stiffness matrix to `take`, each with its node:
/// K_ab = ∫ λ ∇φ_a ∇φ_bᵀ + μ ∇φ_b ∇φ_aᵀ + μ (∇φ_a·∇φ_b) I.
struct Row<'a, const D: usize, F>
where
    Kind: Elements<D>,
{
    mesh: &'a Mesh<D>,
    element: &'a mesh::Element<D>,
    corner: usize,
    /// (λ, μ) of each region.
    moduli: &'a [(f64, f64)],
    take: F,
}

impl<const D: usize, F: FnMut(u32, &[[f64; D]; D])> Visit<D> for Row<'_, D, F>
where
    Kind: Elements<D>,
{
    type Output = ();

    #[inline]
    fn visit<E: Element<D, N>, const N: usize>(mut self) {
        let x = self.mesh.coordinates(self.element);
        let (lambda, mu) = self.moduli[self.element.region as usize];
        let mut blocks = [[[0.0; D]; D]; N];
        for point in E::stiffness_points(&x) {
            let ga = point.gradient[self.corner];
            let (l, m) = (lambda * point.weight, mu * point.weight);
            for (block, gb) in blocks.iter_mut().zip(&point.gradient) {
                let dot = m * dot(ga, *gb);
                for i in 0..D {
                    for j in 0..D {
                        block[i][j] += if i == j {
                            (l + m) * ga[i] * gb[i] + dot
                        } else {
                            l * ga[i] * gb[j] + m * gb[i] * ga[j]
                        };
                    }
                }
            }
        }
        for (&node, block) in self.element.nodes().iter().zip(&blocks) {
            (self.take)(node, block);
        }
    }
}

/// The rows of K: those of a node come from the elements around it.
struct Rows<'a, const D: usize>
where
    Kind: Elements<D>,
{
    mesh: &'a Mesh<D>,
    unknowns: &'a Unknowns<D>,
    incidence: Incidence,
    moduli: Vec<(f64, f64)>,
}

impl<const D: usize> Rows<'_, D>
where
    Kind: Elements<D>,
{
    /// The columns of a block row.
    fn columns(&self, row: usize, found: &mut Vec<u32>) {
        found.clear();
        for &(e, _) in self.incidence.of(self.unknowns.node(row)) {
            for &node in self.mesh.elements[e as usize].nodes() {
                if let Some(block) = self.unknowns.block(node)
                    && !found.contains(&block)
                {
                    found.push(block);
                }
            }
        }
        found.sort_unstable();
    }

    /// Adds up the blocks of a row, of which the columns are known.
    fn fill(&self, row: usize, columns: &[u32], values: &mut [[[f64; D]; D]]) {
        let node = self.unknowns.node(row);
        let fixed = self.unknowns.prescribed(node);
        for &(e, corner) in self.incidence.of(node) {
            let element = &self.mesh.elements[e as usize];
            element.kind().with(Row {
                mesh: self.mesh,
                element,
                corner: corner as usize,
                moduli: &self.moduli,
                take: |other, block: &[[f64; D]; D]| {
                    let Some(column) = self.unknowns.block(other) else {
                        return;
                    };
                    let given = self.unknowns.prescribed(other);
                    let place = columns.partition_point(|&c| c < column);
                    for a in 0..D {
                        for b in 0..D {
                            let decoupled = fixed[a].is_some() || given[b].is_some();
                            if !decoupled || (other == node && a == b) {
                                values[place][a][b] += block[a][b];
                            }
                        }
                    }
                },
            });
        }
    }
}

/// The stiffness matrix K of the free unknowns and the load f, both in blocks of D per node.
///
/// `forces` are the nodal forces (D per node of the mesh). Prescribed displacements move to the
/// right-hand side; a component prescribed at a node that keeps another free one has the decoupled
/// equation `k u = 0` with the diagonal entry k that it would have had.
///
/// Each row is computed from the elements around its node, so that threads share nothing and the sum
/// has one order.
pub fn assemble<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    forces: &[[f64; D]],
) -> (BlockCsr<D>, Vec<f64>)
where
    Kind: Elements<D>,
{
    let n_blocks = unknowns.n_blocks();
    let rows = Rows {
        mesh: body.mesh,
        unknowns,
        incidence: Incidence::new(body.mesh),
        moduli: body.moduli(),
    };

    let mut row_ptr = vec![0usize; n_blocks + 1];
    row_ptr[1..]
        .par_chunks_mut(ROWS_PER_TASK)
        .enumerate()
        .for_each(|(chunk, counts)| {
            let mut found = Vec::with_capacity(16);
            for (k, count) in counts.iter_mut().enumerate() {
                rows.columns(chunk * ROWS_PER_TASK + k, &mut found);
                *count = found.len();
            }
        });
    for i in 0..n_blocks {
        row_ptr[i + 1] += row_ptr[i];
    }

    let mut col_idx = vec![0u32; row_ptr[n_blocks]];
    let mut values = vec![[[0.0; D]; D]; row_ptr[n_blocks]];
    split(&mut col_idx, &row_ptr)
        .into_par_iter()
        .zip(split(&mut values, &row_ptr))
        .enumerate()
        .for_each(|(chunk, (columns, values))| {
            let first = chunk * ROWS_PER_TASK;
            let mut found = Vec::with_capacity(16);
            for row in first..(first + ROWS_PER_TASK).min(n_blocks) {
                let range = row_ptr[row] - row_ptr[first]..row_ptr[row + 1] - row_ptr[first];
                rows.columns(row, &mut found);
                columns[range.clone()].copy_from_slice(&found);
                rows.fill(row, &found, &mut values[range]);
            }
        });
    (
        BlockCsr::from_parts(n_blocks, n_blocks, row_ptr, col_idx, values),
        load_vector(body, unknowns, forces),
    )
}

/// The load f of the free unknowns, in blocks of D per node: the nodal forces (D per node of the mesh)
/// and what prescribed displacements add; 0 for a prescribed component at a node that keeps a free one.
pub fn load_vector<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    forces: &[[f64; D]],
) -> Vec<f64>
where
    Kind: Elements<D>,
{
    let zero = vec![0.0; D * unknowns.n_blocks()];
    let held = internal_forces(body, unknowns, &unknowns.displacements(&zero));
    let mut load = zero;
    for (row, load) in load.chunks_mut(D).enumerate() {
        let node = unknowns.node(row);
        let fixed = unknowns.prescribed(node);
        for c in 0..D {
            if fixed[c].is_none() {
                load[c] = forces[node as usize][c] - held[node as usize][c];
            }
        }
    }
    load
}

/// The nodal forces that the displacements of all nodes take, from the elements with a prescribed
/// displacement at one of their nodes: complete at these nodes.
pub fn internal_forces<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    displacement: &[[f64; D]],
) -> Vec<[f64; D]>
where
    Kind: Elements<D>,
{
    let moduli = body.moduli();
    let mut forces = vec![[0.0; D]; body.mesh.nodes.len()];
    for element in &body.mesh.elements {
        let nodes = element.nodes();
        let held = |&node: &u32| unknowns.prescribed(node).iter().any(Option::is_some);
        if !nodes.iter().any(held) {
            continue;
        }
        for (corner, &node) in nodes.iter().enumerate() {
            let force = &mut forces[node as usize];
            element.kind().with(Row {
                mesh: body.mesh,
                element,
                corner,
                moduli: &moduli,
                take: |other, block: &[[f64; D]; D]| {
                    for (force, row) in force.iter_mut().zip(block) {
                        *force += dot(*row, displacement[other as usize]);
                    }
                },
            });
        }
    }
    forces
}
