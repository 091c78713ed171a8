//! The stiffness matrix, pattern first and row by row.

use super::element::stiffness_points;
use super::{Body, Unknowns};
use crate::sparse::{BlockCsr, ROWS_PER_TASK};
use rayon::prelude::*;

/// For each node the elements around it, and its corner in each.
struct Incidence {
    start: Vec<u32>,
    elements: Vec<(u32, u8)>,
}

impl Incidence {
    fn new(body: &Body) -> Self {
        let mesh = body.mesh;
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

/// The stiffness matrix K of the free unknowns and the load f, both in blocks of two per node.
///
/// `forces` are the nodal forces (two per node of the mesh). Prescribed displacements move to the
/// right-hand side; a component prescribed at a node that keeps another free one has the decoupled
/// equation `k u = 0` with the diagonal entry k that it would have had.
///
/// Each row is computed from the elements around its node, so that threads share nothing and the sum
/// has one order.
pub fn assemble(body: &Body, unknowns: &Unknowns, forces: &[[f64; 2]]) -> (BlockCsr<2>, Vec<f64>) {
    let mesh = body.mesh;
    let n_blocks = unknowns.n_blocks();
    let incidence = Incidence::new(body);
    let lame: Vec<(f64, f64)> = body
        .materials
        .iter()
        .map(|m| m.lame(body.plane))
        .map(|(lambda, mu)| (lambda * body.thickness, mu * body.thickness))
        .collect();

    let neighbours = |row: usize, found: &mut Vec<u32>| {
        found.clear();
        for &(e, _) in incidence.of(unknowns.node(row)) {
            for &node in mesh.elements[e as usize].nodes() {
                if let Some(block) = unknowns.block(node)
                    && !found.contains(&block)
                {
                    found.push(block);
                }
            }
        }
        found.sort_unstable();
    };

    let mut row_ptr = vec![0usize; n_blocks + 1];
    row_ptr[1..]
        .par_chunks_mut(ROWS_PER_TASK)
        .enumerate()
        .for_each(|(chunk, counts)| {
            let mut found = Vec::with_capacity(16);
            for (k, count) in counts.iter_mut().enumerate() {
                neighbours(chunk * ROWS_PER_TASK + k, &mut found);
                *count = found.len();
            }
        });
    for i in 0..n_blocks {
        row_ptr[i + 1] += row_ptr[i];
    }

    let mut col_idx = vec![0u32; row_ptr[n_blocks]];
    let mut values = vec![[[0.0; 2]; 2]; row_ptr[n_blocks]];
    split(&mut col_idx, &row_ptr)
        .into_par_iter()
        .zip(split(&mut values, &row_ptr))
        .enumerate()
        .for_each(|(chunk, (cols, values))| {
            let first = chunk * ROWS_PER_TASK;
            let mut found = Vec::with_capacity(16);
            for row in first..(first + ROWS_PER_TASK).min(n_blocks) {
                let range = row_ptr[row] - row_ptr[first]..row_ptr[row + 1] - row_ptr[first];
                neighbours(row, &mut found);
                let (cols, values) = (&mut cols[range.clone()], &mut values[range]);
                cols.copy_from_slice(&found);

                let node = unknowns.node(row);
                let fixed = unknowns.prescribed(node);
                for &(e, corner) in incidence.of(node) {
                    let element = &mesh.elements[e as usize];
                    let nodes = element.nodes();
                    let (lambda, mu) = lame[element.region as usize];
                    let x = mesh.coordinates(element);
                    let blocks = element_row(nodes.len(), &x, corner as usize, lambda, mu);
                    for (&other, block) in nodes.iter().zip(&blocks) {
                        let given = unknowns.prescribed(other);
                        if let Some(column) = unknowns.block(other) {
                            let place = cols.partition_point(|&c| c < column);
                            for a in 0..2 {
                                for b in 0..2 {
                                    let decoupled = fixed[a].is_some() || given[b].is_some();
                                    if !decoupled || (other == node && a == b) {
                                        values[place][a][b] += block[a][b];
                                    }
                                }
                            }
                        }
                    }
                }
            }
        });
    (
        BlockCsr::from_parts(n_blocks, n_blocks, row_ptr, col_idx, values),
        load_vector(body, unknowns, forces),
    )
}

/// The load f of the free unknowns, in blocks of two per node: the nodal forces (two per node of the mesh)
/// and what prescribed displacements add; 0 for a prescribed component at a node that keeps a free one.
pub fn load_vector(body: &Body, unknowns: &Unknowns, forces: &[[f64; 2]]) -> Vec<f64> {
    let zero = vec![0.0; 2 * unknowns.n_blocks()];
    let held = internal_forces(body, unknowns, &unknowns.displacements(&zero));
    let mut load = zero;
    for (row, load) in load.chunks_mut(2).enumerate() {
        let node = unknowns.node(row);
        let fixed = unknowns.prescribed(node);
        for c in 0..2 {
            if fixed[c].is_none() {
                load[c] = forces[node as usize][c] - held[node as usize][c];
            }
        }
    }
    load
}

/// The nodal forces that the displacements of all nodes take, from the elements with a prescribed
/// displacement at one of their nodes: complete at these nodes.
pub fn internal_forces(
    body: &Body,
    unknowns: &Unknowns,
    displacement: &[[f64; 2]],
) -> Vec<[f64; 2]> {
    let mesh = body.mesh;
    let mut forces = vec![[0.0; 2]; mesh.nodes.len()];
    for element in &mesh.elements {
        let nodes = element.nodes();
        let held = |&node: &u32| unknowns.prescribed(node).iter().any(Option::is_some);
        if !nodes.iter().any(held) {
            continue;
        }
        let (lambda, mu) = body.materials[element.region as usize].lame(body.plane);
        let (lambda, mu) = (lambda * body.thickness, mu * body.thickness);
        let x = mesh.coordinates(element);
        for (corner, &node) in nodes.iter().enumerate() {
            let row = element_row(nodes.len(), &x, corner, lambda, mu);
            for (block, &other) in row.iter().zip(nodes) {
                let u = displacement[other as usize];
                for a in 0..2 {
                    forces[node as usize][a] += block[a][0] * u[0] + block[a][1] * u[1];
                }
            }
        }
    }
    forces
}

/// The 2 × 2 blocks of one row of blocks of an element's stiffness matrix:
/// K_ab = ∫ λ ∇φ_a ∇φ_bᵀ + μ ∇φ_b ∇φ_aᵀ + μ (∇φ_a·∇φ_b) I.
fn element_row(n: usize, x: &[[f64; 2]; 4], a: usize, lambda: f64, mu: f64) -> [[[f64; 2]; 2]; 4] {
    let mut blocks = [[[0.0; 2]; 2]; 4];
    for point in stiffness_points(n, x) {
        let ga = point.gradient[a];
        let (l, m) = (lambda * point.weight, mu * point.weight);
        for (block, gb) in blocks.iter_mut().zip(&point.gradient) {
            let dot = m * (ga[0] * gb[0] + ga[1] * gb[1]);
            block[0][0] += (l + m) * ga[0] * gb[0] + dot;
            block[0][1] += l * ga[0] * gb[1] + m * gb[0] * ga[1];
            block[1][0] += l * ga[1] * gb[0] + m * gb[1] * ga[0];
            block[1][1] += (l + m) * ga[1] * gb[1] + dot;
        }
    }
    blocks
}
