//! A rank's share of a contact problem whose unknowns are on several ranks (feature `mpi`).

use super::system::{compliances, is_coupled};
use super::{ContactProblem, Elsewhere, FloatingBodies, LoadCase, System};
use crate::ranks::Ranks;
use crate::sparse::{BlockCsr, Csr};
use std::sync::Arc;

/// A rank's part of a problem: the rows of K for its unknowns, and all vectors over these.
pub(crate) struct Share<'a, const D: usize> {
    /// Block rows of K of its own nodes; its block columns begin with them.
    pub rows: &'a BlockCsr<D>,
    /// Unknowns of all ranks, free ones of all ranks.
    pub n: [usize; 2],
    /// N and T, all rows, in the columns of its own unknowns.
    pub normal: Csr,
    pub tangential: Csr,
    /// A point for each of its own nodes.
    pub coordinates: Option<Vec<[f64; D]>>,
    /// All m.
    pub areas: Vec<f64>,
    /// All D m; empty where contact is hard.
    pub compliance: Vec<f64>,
    /// Its part of the floating bodies.
    pub free: FloatingBodies<D>,
    /// The connected part of K that each of its nodes belongs to, counted over all ranks.
    pub parts: Vec<u32>,
    /// f of its own unknowns, and all the rest of the load case.
    pub case: LoadCase,
}

impl<const D: usize> ContactProblem<D, Elsewhere> {
    /// The problem as this rank sees it. Collective.
    pub(crate) fn of_share(share: Share<D>, ranks: &Ranks) -> Self {
        let Share {
            rows,
            normal,
            tangential,
            ..
        } = share;
        let own = rows.n_rows();
        let m = normal.n_rows();
        let tangents = tangential.triplets().map(|(i, j, v)| (i + m, j, v));
        let contact = Csr::from_triplets(D * m, own, normal.triplets().chain(tangents));
        let diagonal = rows.diagonal();
        let own_compliance = compliances::<D>(&normal, &tangential, &diagonal, ranks);
        let mut system = System {
            n: share.n[0],
            n_free: share.n[1],
            filled: Arc::new(contact.filled_columns()),
            contact: Arc::new(contact),
            areas: share.areas,
            floating: share.free,
            parts: share.parts,
            coupled: (0..own).map(|i| is_coupled(rows, i)).collect(),
            compliance: own_compliance.clone(),
            own_compliance,
            contact_compliance: Vec::new(),
            diagonal,
            normal,
            tangential,
            coordinates: share.coordinates,
            vertices: None,
            poisson: 0.0,
            is_rigid: false,
            ranks: ranks.clone(),
        };
        if !share.compliance.is_empty() {
            system.set_compliance(share.compliance);
        }
        Self {
            system: Arc::new(system),
            stiffness: Elsewhere,
            case: share.case,
        }
    }
}
