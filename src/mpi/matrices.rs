//! Problems from matrices: rows of K where they are, and a problem of one machine divided.

use super::partition;
use super::share::{MpiError, agreed, coefficients};
use crate::mesh::Groups;
use crate::model::share::Graph;
use crate::problem::{ContactProblem, FloatingBodies, LoadCase, Motions};
use crate::ranks::{Group, Halo, Ranks};
use crate::sparse::{BlockCsr, Csr};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::Arc;

/// A rank's part of the matrices and vectors of a contact problem in D dimensions: the rows of K of its nodes, each with D
/// unknowns, and their data. Unknowns are counted over the ranks, those of rank 0 first; multipliers, gaps and bounds are complete
/// and the same on each rank.
///
/// K has to be positive definite: bodies that can move as a whole are found by [`Share::of_model`](super::Share::of_model) and
/// [`Share::of_problem`](super::Share::of_problem).
#[derive(Clone, Debug, Default)]
pub struct OwnMatrices<const D: usize> {
    /// The start of each own row of K among the entries, and the end of the last one.
    pub starts: Vec<usize>,
    /// Columns of all ranks.
    pub columns: Vec<u64>,
    /// Entries.
    pub values: Vec<f64>,
    /// f of the own unknowns.
    pub load: Vec<f64>,
    /// Entries of N in the columns of own unknowns: row, column counted from the first own one, value.
    pub normal: Vec<(usize, usize, f64)>,
    /// The entries of T, which has D − 1 rows for each of N.
    pub tangential: Vec<(usize, usize, f64)>,
    /// d, length m.
    pub gap: Vec<f64>,
    /// g, length m; infinite where a node is tied ([`ContactProblem::with_ties`]).
    pub slip_bound: Vec<f64>,
    /// μ, length m; empty without Coulomb friction.
    pub friction: Vec<f64>,
    /// A point for each own node. Without, on any rank, multigrid has no rotations to work with.
    pub coordinates: Option<Vec<[f64; D]>>,
}

/// The additional data of a problem on one machine.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct More {
    /// The number of unknowns that do not merely complete a block, and the number of free ones.
    n: Option<[usize; 2]>,
    slip_origin: Vec<f64>,
    areas: Vec<f64>,
    compliance: Vec<f64>,
    /// Bodies that can move as a whole, with their own blocks here.
    bodies: Vec<(Motions, Vec<u32>)>,
    /// Components of own blocks that do not move.
    fixed: Vec<u32>,
    ties: Vec<u32>,
}

/// The same as the rest of the program has it.
pub(super) struct Made<const D: usize> {
    pub rows: BlockCsr<D>,
    pub first: u64,
    pub ghosts: Vec<u64>,
    pub n: [usize; 2],
    pub normal: Csr,
    pub tangential: Csr,
    pub coordinates: Option<Vec<[f64; D]>>,
    pub areas: Vec<f64>,
    pub compliance: Vec<f64>,
    pub free: FloatingBodies<D>,
    pub parts: Vec<u32>,
    pub case: LoadCase,
    pub ties: Vec<u32>,
}

impl<const D: usize> OwnMatrices<D> {
    /// Its fault, if one rank can see one.
    fn fault(&self, n: usize) -> Option<String> {
        let (own, m) = (self.load.len(), self.gap.len());
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        let entries = |rows: &[(usize, usize, f64)], count: usize| {
            rows.iter()
                .all(|&(i, j, v)| i < count && j < own && v.is_finite())
        };
        let text = if !own.is_multiple_of(D) {
            format!("load has {own} entries: a rank has all {D} unknowns of its nodes")
        } else if self.starts.len() != own + 1
            || self.starts.first() != Some(&0)
            || !self.starts.is_sorted()
            || self.starts.last() != Some(&self.columns.len())
            || self.columns.len() != self.values.len()
        {
            format!(
                "starts, columns and values do not describe {own} rows of K, one for each entry of load"
            )
        } else if self.columns.iter().any(|&column| column >= n as u64) {
            format!("a column of K is not below the {n} unknowns of all ranks")
        } else if !finite(&self.values) || !finite(&self.load) {
            "an entry of K or load is not finite".to_owned()
        } else if !entries(&self.normal, m) || !entries(&self.tangential, (D - 1) * m) {
            format!(
                "an entry of normal or tangential is not finite, or not in one of the {m} rows of N, {} of T, and the {own} own \
                 columns",
                (D - 1) * m
            )
        } else if self.slip_bound.len() != m
            || !(self.friction.is_empty() || self.friction.len() == m)
        {
            format!("slip_bound and friction need {m} entries, as gap has")
        } else if !finite(&self.gap)
            || !finite(&self.friction)
            || !(self.slip_bound.iter().chain(&self.friction)).all(|&v| v >= 0.0)
        {
            "gap must be finite, friction finite and not negative, and slip_bound not negative"
                .to_owned()
        } else if self
            .coordinates
            .as_ref()
            .is_some_and(|points| points.len() != own / D)
        {
            format!("coordinates needs {} points", own / D)
        } else {
            return None;
        };
        Some(text)
    }

    /// Checks it and determines the owners. Collective.
    pub(super) fn made(
        self,
        more: More,
        group: &Group,
        ranks: &Ranks,
    ) -> Result<Made<D>, MpiError> {
        let counts = group.counts(self.load.len());
        let n: usize = counts.iter().sum();
        let mut fault = self.fault(n);
        let m = self.gap.len();
        if fault.is_none() && group.counts(m).iter().any(|&other| other != m) {
            fault = Some("gap must be the same on all ranks".to_owned());
        }
        if group.any(fault.is_some()) {
            let text = fault.map_or_else(
                || "another rank has handed over matrices that do not fit".to_owned(),
                |fault| format!("rank {}: {fault}", group.rank()),
            );
            return Err(MpiError::Rows(text));
        }
        let first = counts[..group.rank()].iter().sum::<usize>() as u64;
        let own = self.load.len();
        let is_own = |column: u64| (first..first + own as u64).contains(&column);
        let (d, blocks) = (D as u64, own / D);
        let others = self.columns.iter().filter(|&&column| !is_own(column));
        let mut ghosts: Vec<u64> = others.map(|&column| column / d).collect();
        ghosts.sort_unstable();
        ghosts.dedup();
        let local = |column: u64| {
            let block = match is_own(column) {
                true => (column / d - first / d) as usize,
                false => blocks + ghosts.partition_point(|&ghost| ghost < column / d),
            };
            D * block + (column % d) as usize
        };
        let entries = (0..own).flat_map(|row| {
            let range = self.starts[row]..self.starts[row + 1];
            range.map(move |k| (row, k))
        });
        let rows = BlockCsr::from_triplets(
            own,
            D * (blocks + ghosts.len()),
            entries.map(|(row, k)| (row, local(self.columns[k]), self.values[k])),
        );
        let parts = connected(ranks, &rows, first / d, &ghosts);
        let has_points = !group.any(self.coordinates.is_none());
        let coordinates = self.coordinates.filter(|_| has_points);
        let More {
            n: sizes,
            slip_origin,
            areas,
            compliance,
            bodies,
            fixed,
            ties,
        } = more;
        let moves = |block: u32, c: usize| !fixed.contains(&(D as u32 * block + c as u32));
        let points = coordinates.as_deref().unwrap_or(&[]);
        let bodies = bodies
            .into_iter()
            .map(|(motions, nodes)| motions.body(nodes, points, moves));
        let or = |values: Vec<f64>, len: usize, value: f64| match values.is_empty() {
            true => vec![value; len],
            false => values,
        };
        let acting = ranks.norm(&self.load);
        let case = LoadCase::new(
            self.load,
            acting,
            self.gap,
            or(slip_origin, (D - 1) * m, 0.0),
            self.slip_bound,
        );
        Ok(Made {
            first: first / d,
            n: sizes.unwrap_or([n; 2]),
            normal: Csr::from_triplets(m, own, self.normal),
            tangential: Csr::from_triplets((D - 1) * m, own, self.tangential),
            free: FloatingBodies::of_ranks(bodies.collect(), ranks),
            coordinates,
            areas: or(areas, m, 1.0),
            compliance,
            parts,
            case: LoadCase {
                friction: Arc::new(coefficients(&self.friction)),
                ..case
            },
            ties,
            ghosts,
            rows,
        })
    }
}

/// The connected part of K that each own block belongs to, counted over all ranks.
fn connected<const D: usize>(
    ranks: &Ranks,
    rows: &BlockCsr<D>,
    first: u64,
    ghosts: &[u64],
) -> Vec<u32> {
    let own = rows.n_block_rows();
    let mut groups = Groups::new(rows.n_block_cols());
    for i in 0..own {
        let (columns, blocks) = rows.row(i);
        for (&j, block) in columns.iter().zip(blocks) {
            if block.as_flattened().iter().any(|&v| v != 0.0) {
                groups.join(i as u32, j);
            }
        }
    }
    // Each group has the least of the labels that its blocks have had, those of others included, until none changes.
    let mut label: Vec<f64> = (0..own).map(|i| first as f64 + i as f64).collect();
    label.extend(ghosts.iter().map(|&ghost| ghost as f64));
    let halo = Halo::new(ranks, own, ghosts.to_vec());
    loop {
        halo.update(1, &mut label);
        let mut least: HashMap<u32, f64> = HashMap::new();
        for (i, &label) in (0..).zip(&label) {
            let held = least.entry(groups.of(i)).or_insert(label);
            *held = held.min(label);
        }
        let mut changed = false;
        for (i, label) in (0..).zip(&mut label) {
            let new = least[&groups.of(i)];
            changed |= new != *label;
            *label = new;
        }
        if !ranks.any(changed) {
            break;
        }
    }
    // A label equal to a block's own number is that of a part.
    let own_label = |&(i, &label): &(usize, &f64)| label == first as f64 + i as f64;
    let roots: Vec<[f64; 1]> = label[..own]
        .iter()
        .enumerate()
        .filter(own_label)
        .map(|(_, &l)| [l])
        .collect();
    let roots = ranks.joined(roots);
    let part = |label: &f64| roots.partition_point(|[root]| root < label) as u32;
    label[..own].iter().map(part).collect()
}

/// The part of a rank in a problem on one machine.
#[derive(Serialize, Deserialize)]
struct Message {
    starts: Vec<usize>,
    columns: Vec<u64>,
    values: Vec<f64>,
    load: Vec<f64>,
    rows: [Vec<(usize, usize, f64)>; 2],
    gap: Vec<f64>,
    slip_bound: Vec<f64>,
    friction: Vec<f64>,
    coordinates: Option<Vec<f64>>,
    original: Vec<u32>,
    more: More,
}

/// Divides a problem on rank 0: the part of each rank, and the numbers of its blocks there. Collective.
pub(super) fn divided<const D: usize>(
    group: &Group,
    problem: Option<ContactProblem<D>>,
) -> Result<(OwnMatrices<D>, More, Vec<u32>), MpiError> {
    let problem = problem.filter(|_| group.rank() == 0);
    let owners = problem.as_ref().map(|problem| {
        let k = problem.stiffness();
        let too_large =
            || MpiError::Partition("K is too large for METIS's 32-bit numbers".to_owned());
        let mut graph = Graph::of_matrix(k).ok_or_else(too_large)?;
        partition::owners(&mut graph, group.size()).map_err(MpiError::Partition)
    });
    let owners = agreed(group, owners)?;
    let message: Message = match problem.zip(owners) {
        None => group.receive(0),
        Some((problem, owners)) => {
            let mut parts = cut(&problem, &owners, group.size());
            drop(problem);
            let own = parts.remove(0);
            (1..group.size())
                .zip(&parts)
                .for_each(|(rank, part)| group.send(rank, part));
            own
        }
    };
    let [normal, tangential] = message.rows;
    let points = |flat: Vec<f64>| {
        flat.chunks(D)
            .map(|x| std::array::from_fn(|c| x[c]))
            .collect()
    };
    let own = OwnMatrices {
        starts: message.starts,
        columns: message.columns,
        values: message.values,
        load: message.load,
        normal,
        tangential,
        gap: message.gap,
        slip_bound: message.slip_bound,
        friction: message.friction,
        coordinates: message.coordinates.map(points),
    };
    Ok((own, message.more, message.original))
}

/// The part of each rank in a problem whose blocks have these owners. (One function: a paragraph for each of its data.)
fn cut<const D: usize>(problem: &ContactProblem<D>, owners: &[u32], ranks: usize) -> Vec<Message> {
    let k = problem.stiffness();
    let mut blocks: Vec<Vec<u32>> = vec![Vec::new(); ranks];
    for (&owner, block) in owners.iter().zip(0u32..) {
        blocks[owner as usize].push(block);
    }
    // The number of each block, counted rank by rank, and its place on its rank.
    let (mut number, mut place) = (vec![0u64; owners.len()], vec![0usize; owners.len()]);
    for (&block, new) in blocks.iter().flatten().zip(0u64..) {
        number[block as usize] = new;
    }
    for own in &blocks {
        for (i, &block) in own.iter().enumerate() {
            place[block as usize] = i;
        }
    }
    let free = problem.floating_bodies();
    let touched = problem.touched();
    let ties = free.unknowns_to_fix(|unknown| touched[unknown / D]);
    let message = |(rank, own): (usize, &Vec<u32>)| {
        let (mut starts, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for &block in own {
            let (js, all) = k.row(block as usize);
            for c in 0..D {
                for (&j, entries) in js.iter().zip(all) {
                    columns.extend((0..D as u64).map(|e| D as u64 * number[j as usize] + e));
                    values.extend(entries[c]);
                }
                starts.push(columns.len());
            }
        }
        let here = |unknown: usize| {
            (owners[unknown / D] as usize == rank).then(|| D * place[unknown / D] + unknown % D)
        };
        let rows = [problem.normal(), problem.tangential()].map(|matrix| {
            let entries = matrix.triplets();
            entries
                .filter_map(|(i, j, v)| Some((i, here(j)?, v)))
                .collect()
        });
        let of_own = |all: &[f64]| -> Vec<f64> {
            own.iter()
                .flat_map(|&b| all[D * b as usize..][..D].to_vec())
                .collect()
        };
        let held = (0..D * own.len()).filter(|&i| {
            let block = own[i / D] as usize;
            !problem.is_coupled(D * block + i % D)
        });
        let bodies = free.bodies().iter().map(|body| {
            let nodes = body
                .nodes()
                .iter()
                .filter_map(|&block| here(D * block as usize));
            (
                body.how(),
                nodes.map(|unknown| (unknown / D) as u32).collect(),
            )
        });
        Message {
            starts,
            columns,
            values,
            load: of_own(problem.load()),
            rows,
            gap: problem.gap().to_vec(),
            slip_bound: problem.slip_bound().to_vec(),
            friction: problem.friction_coefficient().to_vec(),
            coordinates: problem
                .coordinates()
                .map(|points| of_own(points.as_flattened())),
            original: own.clone(),
            more: More {
                n: Some([problem.n(), problem.n_free()]),
                slip_origin: problem.slip_origin().to_vec(),
                compliance: problem.contact_compliance().to_vec(),
                areas: problem.areas().to_vec(),
                bodies: bodies.collect(),
                fixed: held.map(|i| i as u32).collect(),
                ties: ties
                    .iter()
                    .filter_map(|&tie| here(tie as usize))
                    .map(|i| i as u32)
                    .collect(),
            },
        }
    };
    blocks.iter().enumerate().map(message).collect()
}
