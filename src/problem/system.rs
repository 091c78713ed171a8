//! The data of K, N, T, the points and the areas: made once, and shared by all load cases.

use super::{ContactData, FloatingBodies, Vertices, tangents};
use crate::constraint::node_of;
use crate::ranks::Ranks;
use crate::sparse::{BlockCsr, Csr, PIECE, ROWS_PER_TASK};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// The part of a contact problem that does not change from load step to load step.
///
/// [`ContactProblem`](super::ContactProblem) derefs to it. It knows the properties of K that the method needs, but not
/// K itself.
#[derive(Clone, Debug)]
pub struct System<const D: usize = 2> {
    pub(super) n: usize,
    pub(super) n_free: usize,
    pub(super) normal: Csr,
    pub(super) tangential: Csr,
    /// B.
    pub(super) contact: Arc<Csr>,
    /// Bᵀ without its empty rows.
    pub(super) filled: Arc<Csr>,
    pub(super) coordinates: Option<Vec<[f64; D]>>,
    /// The corners of elements of second order.
    pub(super) vertices: Option<Arc<Vertices<D>>>,
    /// The largest Poisson's ratio of bodies that resist a change of volume, 0 if unknown.
    pub(super) poisson: f64,
    /// The areas that turn nodal forces into pressures, length m.
    pub(super) areas: Vec<f64>,
    pub(super) floating: FloatingBodies<D>,
    /// The connected part of K that each node belongs to.
    pub(super) parts: Vec<u32>,
    /// Whether K ties an unknown to another one.
    pub(super) coupled: Vec<bool>,
    /// The diagonal of K.
    pub(super) diagonal: Vec<f64>,
    /// Σⱼ Bᵢⱼ²/Kⱼⱼ, length D m; in space the mean of the tangents of a node for both.
    pub(super) own_compliance: Vec<f64>,
    /// The diagonal of C, length D m; empty where all contact is hard.
    pub(super) contact_compliance: Vec<f64>,
    /// Both together.
    pub(super) compliance: Vec<f64>,
    /// Whether W is given in place of K: own compliances are those of bodies that move as a whole, and say nothing about lengths.
    pub(super) is_rigid: bool,
    /// The ranks with the other unknowns, if this process has not all.
    pub(super) ranks: Ranks,
}

impl<const D: usize> System<D> {
    /// From checked data, whose first n unknowns are those that do not merely complete a block.
    pub(super) fn new(data: &ContactData<D>, n: usize) -> Self {
        const { assert!(D == 2 || D == 3, "contact is in the plane or in space") };
        let k = &data.stiffness;
        let (count, parts) = k.components();
        let floating = match &data.coordinates {
            Some(points) => FloatingBodies::among(k, points, count, &parts),
            None => FloatingBodies::default(),
        };
        Self {
            n,
            n_free: n,
            contact: Arc::new(Csr::from_triplets(0, 0, [])),
            filled: Arc::new(Csr::from_triplets(0, 0, [])),
            areas: Vec::new(),
            floating,
            parts,
            coupled: (0..k.n_rows())
                .into_par_iter()
                .with_min_len(ROWS_PER_TASK)
                .map(|i| is_coupled(k, i))
                .collect(),
            compliance: Vec::new(),
            own_compliance: Vec::new(),
            contact_compliance: Vec::new(),
            is_rigid: false,
            ranks: Ranks::default(),
            diagonal: k.diagonal(),
            normal: Csr::from_triplets(0, 0, []),
            tangential: Csr::from_triplets(0, 0, []),
            coordinates: data.coordinates.clone(),
            vertices: None,
            poisson: 0.0,
        }
        .with_rows(data.normal.clone(), data.tangential.clone())
    }

    /// The same K with other rows of hard contact, whose areas are unknown.
    pub(super) fn with_rows(self, normal: Csr, tangential: Csr) -> Self {
        let m = normal.n_rows();
        let tangents = tangential.triplets().map(|(i, j, v)| (i + m, j, v));
        let rows = normal.triplets().chain(tangents);
        let contact = Csr::from_triplets(D * m, self.n_rows(), rows.filter(|&(_, _, v)| v != 0.0));
        let own = compliances::<D>(&normal, &tangential, &self.diagonal, &self.ranks);
        Self {
            filled: Arc::new(contact.filled_columns()),
            contact: Arc::new(contact),
            areas: vec![1.0; m],
            compliance: own.clone(),
            own_compliance: own,
            contact_compliance: Vec::new(),
            normal,
            tangential,
            ..self
        }
    }

    /// The corners of elements of second order, if there are any.
    pub fn vertices(&self) -> Option<&Arc<Vertices<D>>> {
        self.vertices.as_ref()
    }

    /// The largest Poisson's ratio of bodies that resist a change of volume, 0 if unknown.
    pub(crate) fn poisson(&self) -> f64 {
        self.poisson
    }

    /// Whether W is given in place of K.
    pub(crate) fn is_rigid(&self) -> bool {
        self.is_rigid
    }

    /// Number of unknowns n that the user gave.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Number of unknowns that are free to move.
    pub fn n_free(&self) -> usize {
        self.n_free
    }

    /// Rows of K: n, rounded up to a multiple of D.
    pub fn n_rows(&self) -> usize {
        self.diagonal.len()
    }

    /// Number of contact nodes m.
    pub fn m(&self) -> usize {
        self.normal.n_rows()
    }

    /// B = (N; T): D m rows, and as many columns as K.
    pub fn contact_matrix(&self) -> &Arc<Csr> {
        &self.contact
    }

    /// Bᵀ without its empty rows.
    pub(crate) fn filled_columns(&self) -> &Arc<Csr> {
        &self.filled
    }

    /// Whether B touches each block row of K.
    pub(crate) fn touched(&self) -> Vec<bool> {
        self.touched_by(|_| true)
    }

    /// Whether the rows of B of such contact nodes touch each block row of K.
    pub(crate) fn touched_by(&self, node: impl Fn(usize) -> bool) -> Vec<bool> {
        let m = self.normal.n_rows();
        let mut touched = vec![false; self.n_rows() / D];
        for (row, j, _) in self.contact.triplets() {
            touched[j / D] |= node(node_of::<D>(m, row));
        }
        touched
    }

    /// The ranks with the other unknowns, if this process has not all. u, f, the columns of B and all vectors over them
    /// are then this rank's part, and sums over the unknowns go over all ranks.
    pub(crate) fn ranks(&self) -> &Ranks {
        &self.ranks
    }

    /// M u for B, N or T, over all ranks.
    pub(crate) fn times(&self, rows: &Csr, u: &[f64]) -> Vec<f64> {
        let mut sums = rows.product(u);
        self.ranks.sum(&mut sums);
        sums
    }

    /// N.
    pub fn normal(&self) -> &Csr {
        &self.normal
    }

    /// T.
    pub fn tangential(&self) -> &Csr {
        &self.tangential
    }

    /// The areas of the contact nodes; ones where they are not known.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// The bodies that can move as a whole, judged by K and the coordinates.
    pub fn floating_bodies(&self) -> &FloatingBodies<D> {
        &self.floating
    }

    /// The same with springs on all motions of bodies as a whole: none is free.
    pub(super) fn supported(&self) -> Self {
        Self {
            floating: FloatingBodies::default(),
            ..self.clone()
        }
    }

    /// The points that each D unknowns belong to, if known.
    pub fn coordinates(&self) -> Option<&[[f64; D]]> {
        self.coordinates.as_deref()
    }

    /// The diagonal of K.
    pub(crate) fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// The compliance of a multiplier at its own contact node, if nothing moved except the contact itself and, one at a
    /// time, the unknowns that it acts on. This is Σⱼ Bᵢⱼ²/Kⱼⱼ (at most Aᵢᵢ if it acts on one) and Cᵢᵢ, length D m; 0
    /// for an empty row of hard contact.
    pub(crate) fn compliance(&self) -> &[f64] {
        &self.compliance
    }

    /// The part of it that comes from K.
    pub(crate) fn own_compliance(&self) -> &[f64] {
        &self.own_compliance
    }

    /// The diagonal of C, length D m, in m/N: by how much contact gives way per force
    /// ([`ContactProblem::with_compliance`](super::ContactProblem::with_compliance)). Empty where all contact is hard.
    pub fn contact_compliance(&self) -> &[f64] {
        &self.contact_compliance
    }

    /// Makes contact compliant; directions without sliding have no compliance.
    pub(super) fn set_compliance(&mut self, mut compliance: Vec<f64>) {
        let own = self.own_compliance.iter().enumerate();
        for (c, (i, own)) in compliance.iter_mut().zip(own) {
            if i >= self.normal.n_rows() && *own == 0.0 {
                *c = 0.0;
            }
        }
        if compliance.iter().all(|&c| c == 0.0) {
            compliance.clear();
        }
        self.compliance.clone_from(&self.own_compliance);
        (self.compliance.iter_mut().zip(&compliance)).for_each(|(all, c)| *all += c);
        self.contact_compliance = compliance;
    }

    /// Adds to the compliance of normal contact. The factors of rows stay.
    pub(super) fn add_compliance(&mut self, more: &[f64]) {
        let rows = D * self.normal.n_rows();
        self.contact_compliance.resize(rows, 0.0);
        (self.contact_compliance.iter_mut().zip(more)).for_each(|(c, more)| *c += more);
    }

    /// The largest |u| of the body of each unknown, where K defines the connected bodies: rounding moves the unknown by a part of
    /// that. An unconnected unknown has its own.
    pub(crate) fn body_sizes(&self, u: &[f64]) -> Vec<f64> {
        let here = self
            .parts
            .iter()
            .max()
            .map_or(0.0, |&last| f64::from(last) + 1.0);
        let mut sizes = vec![0.0_f64; self.ranks.max(here) as usize];
        let coupled = |node: usize| (D * node..D * (node + 1)).filter(|&i| self.coupled[i]);
        let found = self.over_parts(0.0_f64, |size, node| {
            *size = coupled(node).fold(*size, |size, i| size.max(u[i].abs()));
        });
        for (part, size) in found {
            sizes[part] = sizes[part].max(size);
        }
        sizes
            .iter_mut()
            .for_each(|size| *size = self.ranks.max(*size));
        let each = u.par_iter().enumerate().with_min_len(PIECE);
        each.map(|(i, u)| {
            if self.coupled[i] {
                sizes[self.parts[i / D] as usize]
            } else {
                u.abs()
            }
        })
        .collect()
    }

    /// Sums over the nodes of each connected part of K, in pieces that come in the same order on any number of threads: each begins
    /// with `none`, and `add` adds a node.
    pub(super) fn over_parts<T: Clone + Send + Sync>(
        &self,
        none: T,
        add: impl Fn(&mut T, usize) + Sync + Send,
    ) -> Vec<(usize, T)> {
        let nodes = PIECE / D;
        let pieces: Vec<BTreeMap<usize, T>> = (self.parts.par_chunks(nodes).enumerate())
            .map(|(piece, parts)| {
                let mut sums = BTreeMap::new();
                for (node, &part) in (nodes * piece..).zip(parts) {
                    add(
                        sums.entry(part as usize).or_insert_with(|| none.clone()),
                        node,
                    );
                }
                sums
            })
            .collect();
        pieces.into_iter().flatten().collect()
    }

    /// The largest |Bᵢⱼ| times the size of unknown j, for each row of B; over all ranks their sum.
    pub(crate) fn row_sizes(&self, sizes: &[f64]) -> Vec<f64> {
        let largest = |i: usize| {
            let (columns, values) = self.contact.row(i);
            let all = columns.iter().zip(values);
            all.fold(0.0_f64, |most, (&j, v)| {
                most.max((v[0][0] * sizes[j as usize]).abs())
            })
        };
        let rows = (0..self.contact.n_rows()).into_par_iter();
        let mut rows: Vec<f64> = rows.with_min_len(ROWS_PER_TASK).map(largest).collect();
        self.ranks.sum(&mut rows);
        rows
    }

    /// M u − Cλ for N or T, over all ranks: the quantity that gap and slip bound, beyond the contact's own compression. `first`
    /// is the row of λ for the first row of M.
    pub(crate) fn beyond_compliance(
        &self,
        rows: &Csr,
        first: usize,
        u: &[f64],
        lambda: &[f64],
    ) -> Vec<f64> {
        let mut moved = self.times(rows, u);
        if let Some(compliance) = self.contact_compliance.get(first..) {
            for (moved, (c, l)) in moved
                .iter_mut()
                .zip(compliance.iter().zip(&lambda[first..]))
            {
                *moved -= c * l;
            }
        }
        moved
    }

    /// Whether K ties an unknown to another one; an unconnected unknown is held in place.
    pub(crate) fn is_coupled(&self, unknown: usize) -> bool {
        self.coupled[unknown]
    }

    /// " at (x, y)", in space " at (x, y, z)", for an unknown with a known position.
    pub(crate) fn place_of(&self, unknown: usize) -> String {
        match &self.coordinates {
            Some(points) if unknown / D < points.len() => {
                let place = points[unknown / D].map(|x| format!("{x:.6e}"));
                format!(" at ({})", place.join(", "))
            }
            _ => String::new(),
        }
    }
}

/// Whether K ties an unknown to another one.
pub(super) fn is_coupled<const D: usize>(k: &BlockCsr<D>, unknown: usize) -> bool {
    let (i, a) = (unknown / D, unknown % D);
    let (cols, blocks) = k.row(i);
    (cols.iter().zip(blocks))
        .any(|(&j, block)| (0..D).any(|b| D * j as usize + b != unknown && block[a][b] != 0.0))
}

/// Σⱼ Bᵢⱼ²/Kⱼⱼ for each row i of B. Both tangents of a node in space get their mean. It does not depend on which pair
/// of tangents they are, and a disc stays one. An empty row keeps its 0.
pub(super) fn compliances<const D: usize>(
    normal: &Csr,
    tangential: &Csr,
    diagonal: &[f64],
    ranks: &Ranks,
) -> Vec<f64> {
    let mut all = Vec::new();
    for matrix in [normal, tangential] {
        for i in 0..matrix.n_rows() {
            let (cols, values) = matrix.row(i);
            let terms = cols.iter().zip(values).filter(|(_, v)| v[0][0] != 0.0);
            all.push(
                terms
                    .map(|(&j, v)| v[0][0] * v[0][0] / diagonal[j as usize])
                    .sum(),
            );
        }
    }
    ranks.sum(&mut all);
    for of_node in all[normal.n_rows()..].chunks_mut(tangents::<D>()) {
        let rows = of_node.iter().filter(|&&c| c > 0.0).count();
        if rows > 1 {
            let mean = of_node.iter().sum::<f64>() / rows as f64;
            of_node.fill(mean);
        }
    }
    all
}
