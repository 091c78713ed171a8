//! The stiffness matrix, pattern first and row by row.

use super::finite::{Deformed, TangentBlocks};
use super::{Body, Moduli, Plane, Unknowns, in_order};
use crate::mesh::vector::{dot, minus};
use crate::mesh::{self, ElementKind, Mesh, ShapeFunctions, Topology, Visit};
use crate::sparse::{BlockCsr, ROWS_PER_TASK};
use rayon::prelude::*;
use std::ops::Range;

/// For each node the elements around it.
struct Incidence {
    start: Vec<u32>,
    elements: Vec<u32>,
}

impl Incidence {
    fn new<const D: usize>(mesh: &Mesh<D>) -> Self
    where
        ElementKind: Topology<D>,
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
        let mut elements = vec![0; *start.last().expect("never empty") as usize];
        for (e, element) in mesh.elements.iter().enumerate() {
            for &node in element.nodes() {
                let place = &mut next[node as usize];
                elements[*place as usize] = e as u32;
                *place += 1;
            }
        }
        Self { start, elements }
    }

    fn of(&self, node: u32) -> &[u32] {
        let node = node as usize;
        &self.elements[self.start[node] as usize..self.start[node + 1] as usize]
    }
}

/// Rows that a task takes at least. In space half as many elements again are around so many nodes.
const LEAST_ROWS: usize = 256;

/// Splits a slice into the parts that the chunks of so many rows own.
fn split<'a, T>(mut slice: &'a mut [T], row_ptr: &[usize], rows: usize) -> Vec<&'a mut [T]> {
    let n_rows = row_ptr.len() - 1;
    (0..n_rows)
        .step_by(rows)
        .map(|first| {
            let last = (first + rows).min(n_rows);
            let (head, tail) =
                std::mem::take(&mut slice).split_at_mut(row_ptr[last] - row_ptr[first]);
            slice = tail;
            head
        })
        .collect()
}

/// Passes the requested blocks of the rows of an element's stiffness matrix to `take`, each with its nodes a and b: the
/// law's tangent applied to the gradients ([`Tangent::add`](super::law::Tangent::add)). Where the dilatation is
/// projected (`dilatation.rs`), the law's volumetric part acts on the projection. Incompatible modes (`modes.rs`)
/// reduce the block.
struct Blocks<'a, const D: usize, W, F>
where
    ElementKind: Topology<D>,
{
    mesh: &'a Mesh<D>,
    element: &'a mesh::Element<D>,
    plane: Plane,
    /// Of each region.
    moduli: &'a [Moduli],
    /// Whether the row of a node is wanted.
    wanted: W,
    take: F,
}

impl<const D: usize, W, F> Visit<D> for Blocks<'_, D, W, F>
where
    ElementKind: Topology<D>,
    W: Fn(usize) -> bool,
    F: FnMut(usize, usize, &[[f64; D]; D]),
{
    type Output = ();

    #[inline]
    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(mut self) {
        let x = self.mesh.coordinates(self.element);
        let moduli = self.moduli[self.element.region as usize];
        let points = self.plane.stiffness_points::<E, D, N, Q>(&x);
        let modes = moduli.modes::<E, D, N, Q>(self.element.kind(), &points, &x, self.plane);
        let dilatation =
            moduli.dilatation::<E, D, N, Q>(self.element.kind(), &points, &x, self.plane);
        let (law, bulk) = match dilatation {
            Some(_) => moduli.law.without_dilatation(),
            None => (moduli.law, 0.0),
        };
        let round = self.plane == Plane::Axisymmetric;
        for a in (0..N).filter(|&a| (self.wanted)(a)) {
            let mut blocks = [[[0.0; D]; D]; N];
            for point in &points {
                let ga = &point.gradient[a];
                let tangent = law.tangent::<D>().times(point.weight);
                let hoop = self.plane.hoop(point.place(&x));
                for (b, block) in blocks.iter_mut().enumerate() {
                    let hoops = round.then(|| [a, b].map(|node| hoop * point.shape[node]));
                    tangent.add([ga, &point.gradient[b]], hoops, block);
                }
            }
            for (b, mut block) in blocks.into_iter().enumerate() {
                if let Some(dilatation) = &dilatation {
                    dilatation.add(bulk, [a, b], &mut block);
                }
                if let Some(modes) = &modes {
                    modes.eliminated.relieve([a, b], &mut block);
                }
                (self.take)(a, b, &block);
            }
        }
    }
}

/// The rows of K: those of a node come from the elements around it, and from foundations.
struct Rows<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    body: &'a Body<'a, D>,
    unknowns: &'a Unknowns<D>,
    incidence: Incidence,
    moduli: Vec<Moduli>,
    /// The positions of the bodies; None: at rest.
    at: Option<&'a Deformed<'a, D>>,
}

impl<const D: usize> Rows<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The columns of a block row.
    fn columns(&self, row: usize, found: &mut Vec<u32>) {
        found.clear();
        let here = self.unknowns.node(row);
        for &e in self.incidence.of(here) {
            for &node in self.body.mesh.elements[e as usize].nodes() {
                found.extend(self.unknowns.block(node));
            }
        }
        for (&(_, node, _), _) in self.unknowns.bedding().row(here) {
            found.extend(self.unknowns.block(node));
        }
        found.sort_unstable();
        found.dedup();
    }

    /// Adds up the blocks of some rows, with a known pattern; `columns` and `values` begin with the first of them. Each
    /// element is integrated once for all of these rows.
    fn fill(
        &self,
        rows: Range<usize>,
        row_ptr: &[usize],
        columns: &[u32],
        values: &mut [[[f64; D]; D]],
    ) {
        let around = |row| self.incidence.of(self.unknowns.node(row));
        let mut elements: Vec<u32> = rows.clone().flat_map(around).copied().collect();
        elements.sort_unstable();
        elements.dedup();
        let row_of = |node: u32| {
            let block = self.unknowns.block(node)? as usize;
            rows.contains(&block).then_some(block)
        };
        let mut add = |[a, b]: [u32; 2], block: &[[f64; D]; D]| {
            let (Some(row), Some(column)) = (row_of(a), self.unknowns.block(b)) else {
                return;
            };
            let begin = row_ptr[row] - row_ptr[rows.start];
            let columns = &columns[begin..row_ptr[row + 1] - row_ptr[rows.start]];
            let place = columns.partition_point(|&c| c < column);
            add_block(self.unknowns, [a, b], block, &mut values[begin + place]);
        };
        for &e in &elements {
            let element = &self.body.mesh.elements[e as usize];
            let nodes = element.nodes();
            let wanted = |corner: usize| row_of(nodes[corner]).is_some();
            let take = |a: usize, b: usize, block: &[[f64; D]; D]| add([nodes[a], nodes[b]], block);
            visit_blocks(self.body, self.at, element, &self.moduli, wanted, take);
        }
        for row in rows.clone() {
            for (&(a, b, _), block) in self.unknowns.bedding().row(self.unknowns.node(row)) {
                add([a, b], block);
            }
        }
    }
}

/// Adds a block K_ab to that of two nodes, without the prescribed components of either, except for the decoupled
/// equations of a node itself.
pub(crate) fn add_block<const D: usize>(
    unknowns: &Unknowns<D>,
    [a, b]: [u32; 2],
    block: &[[f64; D]; D],
    value: &mut [[f64; D]; D],
) {
    if unknowns.is_turned(a) || unknowns.is_turned(b) {
        add_projected(unknowns, [a, b], block, value);
        return;
    }
    let (fixed, given) = (unknowns.prescribed(a), unknowns.prescribed(b));
    for i in 0..D {
        for j in 0..D {
            let decoupled = fixed[i].is_some() || given[j].is_some();
            if !decoupled || (a == b && i == j) {
                value[i][j] += block[i][j];
            }
        }
    }
}

/// Adds the block K_ab of an element to that of two nodes, one or both with directions of their own. It is without the
/// prescribed components of either, P_a K_ab P_b, except for the decoupled equations of a node itself, n (n·K_aa n) nᵀ.
fn add_projected<const D: usize>(
    unknowns: &Unknowns<D>,
    [a, b]: [u32; 2],
    block: &[[f64; D]; D],
    value: &mut [[f64; D]; D],
) {
    let rows = block.map(|row| unknowns.free_part(b, row));
    for j in 0..D {
        let column = unknowns.free_part(a, rows.map(|row| row[j]));
        for i in 0..D {
            value[i][j] += column[i];
        }
    }
    let (Some(frame), true) = (unknowns.frame(a), a == b) else {
        return;
    };
    let held = frame.iter().zip(unknowns.prescribed(a));
    for (way, _) in held.filter(|(_, value)| value.is_some()) {
        let stiffness = dot(*way, block.map(|row| dot(row, *way)));
        for i in 0..D {
            for j in 0..D {
                value[i][j] += stiffness * way[i] * way[j];
            }
        }
    }
}

/// The stiffness matrix K of the free unknowns and the load f, both in blocks of D per node.
///
/// `forces` are the nodal forces (D per node of the mesh). Prescribed displacements move to the right-hand side. A
/// component prescribed at a node that keeps another free one has the decoupled equation `k u = 0`, with the diagonal
/// entry k that it would have had (along a direction of the node's own: [`Unknowns`]).
///
/// Each row is computed from the elements around its node, in their order, so that threads share nothing and the sum
/// has one order.
pub fn assemble<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    forces: &[[f64; D]],
) -> (BlockCsr<D>, Vec<f64>)
where
    ElementKind: Topology<D>,
{
    (
        assemble_rows(body, unknowns, unknowns.n_blocks()),
        load_vector(body, unknowns, forces),
    )
}

/// The first block rows of K: those of the first so many blocks, which have all elements around them in the mesh. Columns are
/// those of all blocks.
pub(crate) fn assemble_rows<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    n_blocks: usize,
) -> BlockCsr<D>
where
    ElementKind: Topology<D>,
{
    rows_of(body, unknowns, n_blocks, None)
}

/// The first block rows of K at rest, or of the tangent of displaced bodies.
pub(super) fn rows_of<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    n_blocks: usize,
    at: Option<&Deformed<D>>,
) -> BlockCsr<D>
where
    ElementKind: Topology<D>,
{
    let rows = Rows {
        body,
        unknowns,
        incidence: Incidence::new(body.mesh),
        moduli: body.moduli(),
        at,
    };

    // Elements at the border of tasks are integrated in each of them. Sums do not depend on the tasks.
    let rows_per_task = n_blocks.div_ceil(rayon::current_num_threads());
    let rows_per_task = rows_per_task.clamp(LEAST_ROWS, ROWS_PER_TASK);
    let mut row_ptr = vec![0usize; n_blocks + 1];
    row_ptr[1..]
        .par_chunks_mut(rows_per_task)
        .enumerate()
        .for_each(|(chunk, counts)| {
            let mut found = Vec::with_capacity(64);
            for (k, count) in counts.iter_mut().enumerate() {
                rows.columns(chunk * rows_per_task + k, &mut found);
                *count = found.len();
            }
        });
    for i in 0..n_blocks {
        row_ptr[i + 1] += row_ptr[i];
    }

    let mut col_idx = vec![0u32; row_ptr[n_blocks]];
    let mut values = vec![[[0.0; D]; D]; row_ptr[n_blocks]];
    split(&mut col_idx, &row_ptr, rows_per_task)
        .into_par_iter()
        .zip(split(&mut values, &row_ptr, rows_per_task))
        .enumerate()
        .for_each(|(chunk, (columns, values))| {
            let first = chunk * rows_per_task;
            let chunk = first..(first + rows_per_task).min(n_blocks);
            let mut found = Vec::with_capacity(64);
            for row in chunk.clone() {
                rows.columns(row, &mut found);
                let begin = row_ptr[row] - row_ptr[first];
                columns[begin..begin + found.len()].copy_from_slice(&found);
            }
            rows.fill(chunk, &row_ptr, columns, values);
        });
    BlockCsr::from_parts(n_blocks, unknowns.n_blocks(), row_ptr, col_idx, values)
}

/// The load f of the free unknowns, in blocks of D per node: the nodal forces (D per node of the mesh) and the
/// contribution of prescribed displacements. It is 0 for a prescribed component at a node with a free one.
pub fn load_vector<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    forces: &[[f64; D]],
) -> Vec<f64>
where
    ElementKind: Topology<D>,
{
    let zero = vec![0.0; D * unknowns.n_blocks()];
    let held = internal_forces(body, unknowns, &unknowns.displacements(&zero));
    let net: Vec<[f64; D]> = (forces.iter().zip(held))
        .map(|(force, held)| minus(*force, held))
        .collect();
    free_forces(unknowns, &net)
}

/// Nodal forces as a load of the free unknowns, in blocks of D per node: 0 for a prescribed component at a node that keeps a free
/// one.
pub(crate) fn free_forces<const D: usize>(unknowns: &Unknowns<D>, forces: &[[f64; D]]) -> Vec<f64> {
    let free = |row: usize| {
        let node = unknowns.node(row);
        unknowns.free_part(node, forces[node as usize])
    };
    (0..unknowns.n_blocks()).flat_map(free).collect()
}

/// The nodal forces for a displacement beyond the present position of the bodies, to first order, from the elements with a moved
/// node.
pub(crate) fn tangent_forces<const D: usize>(
    of: &Deformed<D>,
    displacement: &[[f64; D]],
) -> Vec<[f64; D]>
where
    ElementKind: Topology<D>,
{
    let moves = |&node: &u32| displacement[node as usize] != [0.0; D];
    forces_of(of.body, Some(of), displacement, moves)
}

/// The nodal forces for the displacements of all nodes, from the foundations and the elements with a prescribed
/// displacement at one of their nodes: complete at these nodes.
pub fn internal_forces<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    displacement: &[[f64; D]],
) -> Vec<[f64; D]>
where
    ElementKind: Topology<D>,
{
    let held = |&node: &u32| unknowns.prescribed(node).iter().any(Option::is_some);
    let mut forces = forces_of(body, None, displacement, held);
    for (node, _, taken) in unknowns.bedding().forces(displacement) {
        (0..D).for_each(|c| forces[node as usize][c] += taken[c]);
    }
    forces
}

/// Elements whose forces one task finds: some 100 µs of work, and at most 100 MB of 64 tasks.
const PIECE: usize = 64;

/// The nodal forces of a displacement by K at rest, or by the tangent of displaced bodies, from the elements that contain one of
/// some nodes.
fn forces_of<const D: usize>(
    body: &Body<D>,
    at: Option<&Deformed<D>>,
    displacement: &[[f64; D]],
    some: impl Fn(&u32) -> bool + Sync,
) -> Vec<[f64; D]>
where
    ElementKind: Topology<D>,
{
    let moduli = body.moduli();
    let mut forces = vec![[0.0; D]; body.mesh.nodes.len()];
    let elements = body.mesh.elements.par_iter();
    let elements = elements.filter(|element| element.nodes().iter().any(&some));
    let elements: Vec<&mesh::Element<D>> = elements.collect();
    let of_some = |elements: &[&mesh::Element<D>]| {
        let mut all: Vec<(u32, [f64; D])> = Vec::new();
        for element in elements {
            let nodes = element.nodes();
            let take = |a: usize, b: usize, block: &[[f64; D]; D]| {
                let u = displacement[nodes[b] as usize];
                all.push((nodes[a], block.map(|row| dot(row, u))));
            };
            visit_blocks(body, at, element, &moduli, |_| true, take);
        }
        all
    };
    in_order(&elements, PIECE, of_some, |_, parts| {
        for (node, part) in parts {
            (0..D).for_each(|c| forces[node as usize][c] += part[c]);
        }
    });
    forces
}

/// Passes the blocks of an element of K at rest, or of the tangent of displaced bodies, in the requested rows.
fn visit_blocks<const D: usize>(
    body: &Body<D>,
    at: Option<&Deformed<D>>,
    element: &mesh::Element<D>,
    moduli: &[Moduli],
    wanted: impl Fn(usize) -> bool,
    take: impl FnMut(usize, usize, &[[f64; D]; D]),
) where
    ElementKind: Topology<D>,
{
    match at {
        None => element.kind().with(Blocks {
            mesh: body.mesh,
            element,
            plane: body.plane,
            moduli,
            wanted,
            take,
        }),
        Some(at) => element.kind().with(TangentBlocks {
            of: *at,
            element,
            moduli,
            wanted,
            take,
        }),
    }
}
