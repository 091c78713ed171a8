//! The algebraic contact problem (1)–(3) of the paper, validated: the door for users with their own
//! discretisation.
//!
//! D is the number of unknowns per node: 2 in the plane, where it may be left out, and 3 in space. There a contact
//! node slides in two directions, so that T has two rows for each, one after the other.

mod check;
mod free;
mod kkt;
mod matrices;
#[cfg(test)]
mod tests;

pub use check::ProblemError;
pub(crate) use check::{LARGEST, SIZES, is_sized};
pub use free::{FreeBodies, FreeBody};
pub use kkt::Kkt;
pub(crate) use kkt::{ROUNDING, slip_violation};
pub use matrices::{Index, Matrices, SparseRef};

use crate::sparse::{BlockCsr, Csr, norm, norm_max};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// The data of a [`ContactProblem`], not yet checked; [`Matrices`] is the same with scalar matrices.
///
/// The letters are those of the paper: find u ∈ ℝⁿ, λν ∈ ℝᵐ and λτ, with D − 1 components for each contact node,
///
/// ```text
/// (1)  K u + Nᵀλν + Tᵀλτ = f
/// (2)  N u − d ≤ 0,   λν ≥ 0,   λνᵀ(N u − d) = 0
/// (3)  |λτ,i| ≤ gᵢ;   |λτ,i| < gᵢ ⇒ (T u)ᵢ = 0;   |λτ,i| = gᵢ ⇒ (T u)ᵢ = cᵢ λτ,i with cᵢ ≥ 0
/// ```
///
/// In space |λτ,i| is the Euclidean length of the two components, and (3) keeps it in a disc.
#[derive(Clone, Debug)]
pub struct ContactData<const D: usize = 2> {
    /// K, n × n, symmetric positive definite, or semidefinite where bodies can move as a whole. Where n is no
    /// multiple of D, [`BlockCsr::from_triplets`] completes the last block.
    pub stiffness: BlockCsr<D>,
    /// f, length n.
    pub load: Vec<f64>,
    /// N, m × n: the displacement of contact node i towards the obstacle is (N u)ᵢ.
    pub normal: Csr,
    /// T, (D − 1)m × n: the displacement of contact node i along the boundary is (T u)ᵢ; in space its components
    /// along two directions at right angles, rows 2i and 2i + 1 counted from 0. All rows of a node may be empty
    /// where gᵢ = 0 (it cannot move sideways), and in space one of the two (it can move along a line).
    pub tangential: Csr,
    /// d, length m: the initial gap, ≥ 0.
    pub gap: Vec<f64>,
    /// g, length m: the slip bound (a force per contact node), ≥ 0; for Coulomb's law see
    /// [`ContactProblem::with_friction_coefficient`].
    pub slip_bound: Vec<f64>,
    /// One point per D unknowns, if they are the displacements of nodes; gives rigid body modes.
    pub coordinates: Option<Vec<[f64; D]>>,
}

/// How many directions a contact node slides in, in D dimensions.
pub(crate) const fn tangents<const D: usize>() -> usize {
    D - 1
}

/// The rows of T, and the entries of λτ, that belong to contact node i.
pub(crate) fn tangents_of<const D: usize>(i: usize) -> Range<usize> {
    tangents::<D>() * i..tangents::<D>() * (i + 1)
}

/// A validated contact problem: everything that works on it may trust its claims.
#[derive(Clone, Debug)]
pub struct ContactProblem<const D: usize = 2> {
    n: usize,
    n_free: usize,
    /// Shared, since backends on the CPU work on it where it is.
    stiffness: Arc<BlockCsr<D>>,
    load: Vec<f64>,
    normal: Csr,
    tangential: Csr,
    gap: Vec<f64>,
    slip_bound: Vec<f64>,
    /// μ, length m, 0 where the slip bound is given; empty without Coulomb friction.
    friction: Vec<f64>,
    coordinates: Option<Vec<[f64; D]>>,
    /// Where slip is counted from: T u less this is the slip, an entry per row of T.
    slip_origin: Vec<f64>,
    /// The areas that turn nodal forces into pressures, length m.
    areas: Arc<Vec<f64>>,
    /// The largest displacement before this load step: what comes out as a difference is rounded accordingly.
    travelled: f64,
    /// ‖forces that act on the bodies‖: ‖f‖, but for what prescribed displacements add to f.
    acting: f64,
    free: Arc<FreeBodies<D>>,
    /// The connected part of K that each node belongs to.
    parts: Arc<Vec<u32>>,
    /// Σⱼ Bᵢⱼ²/Kⱼⱼ, length D m; in space the mean of the tangents of a node for both.
    compliance: Arc<Vec<f64>>,
}

impl<const D: usize> ContactProblem<D> {
    /// Checks the data: shapes, finite values, K symmetric with a positive diagonal, d ≥ 0, g ≥ 0, no
    /// zero or parallel rows in B = (N; T). That K is positive definite shows when it is factorised.
    ///
    /// # Errors
    /// What is wrong with which entry.
    pub fn new(data: ContactData<D>) -> Result<Self, ProblemError> {
        let n = data.load.len();
        Ok(Self::from_checked(check::checked(data)?, n))
    }

    /// The same for rows that bodies in contact give rise to: those may depend on each other, where several parts of one
    /// body lie under one facet of another. Forces are unique even so, multipliers need not be.
    pub(crate) fn of_bodies(data: ContactData<D>) -> Result<Self, ProblemError> {
        let n = data.load.len();
        Ok(Self::from_checked(check::checked_but_for_rank(data)?, n))
    }

    /// From checked data, of which the first n unknowns are not there to complete a block.
    fn from_checked(data: ContactData<D>, n: usize) -> Self {
        const { assert!(D == 2 || D == 3, "contact is in the plane or in space") };
        let m = data.gap.len();
        let (count, parts) = data.stiffness.components();
        let free = match &data.coordinates {
            Some(points) => FreeBodies::among(&data.stiffness, points, count, &parts),
            None => FreeBodies::default(),
        };
        let compliance = compliances(&data);
        Self {
            n,
            n_free: n,
            slip_origin: vec![0.0; tangents::<D>() * m],
            areas: Arc::new(vec![1.0; m]),
            travelled: 0.0,
            acting: norm(&data.load),
            free: Arc::new(free),
            parts: Arc::new(parts),
            compliance: Arc::new(compliance),
            stiffness: Arc::new(data.stiffness),
            load: data.load,
            normal: data.normal,
            tangential: data.tangential,
            gap: data.gap,
            slip_bound: data.slip_bound,
            friction: Vec::new(),
            coordinates: data.coordinates,
        }
    }

    /// Gives contact nodes Coulomb's law: where μᵢ > 0 the slip bound is μᵢλν,i and `slip_bound` says nothing.
    ///
    /// # Errors
    /// If the length is not m (or 0: no Coulomb friction), an entry is negative or not finite, or is above 0 on a
    /// node whose rows of T are empty.
    pub fn with_friction_coefficient(mut self, mu: Vec<f64>) -> Result<Self, ProblemError> {
        if !mu.is_empty() {
            check::friction::<D>(&mu, self.m(), &self.tangential)?;
        }
        self.friction = if mu.iter().all(|&mu| mu == 0.0) {
            Vec::new()
        } else {
            mu
        };
        Ok(self)
    }

    /// The problem with the same K, N and T and another load, gap, origin of slip and slip bound: a load step, or
    /// one of several problems in a row. `load` is as long as K has rows, `gap` and `slip_bound` have length m,
    /// `slip_origin` as many entries as T has rows: (3) is then about T u − `slip_origin`. The gap may be negative
    /// here, where a prescribed motion has closed it.
    ///
    /// # Errors
    /// If a length differs, an entry is not finite, or one of the slip bound is negative.
    pub fn with_data(
        &self,
        load: Vec<f64>,
        gap: Vec<f64>,
        slip_origin: Vec<f64>,
        slip_bound: Vec<f64>,
    ) -> Result<Self, ProblemError> {
        let lengths = [
            ("the load f", &load, &self.load, "one entry per row of K"),
            (
                "the origin of slip",
                &slip_origin,
                &self.slip_origin,
                "one entry per row of T",
            ),
        ];
        for (name, new, old, reason) in lengths {
            if new.len() != old.len() {
                return Err(ProblemError::Length {
                    name,
                    found: new.len(),
                    expected: old.len(),
                    reason,
                });
            }
        }
        check::length("the gap d", &gap, self.m())?;
        check::finite("the load f", &load)?;
        check::sized_load(&load)?;
        check::finite("the gap d", &gap)?;
        check::finite("the origin of slip", &slip_origin)?;
        check::slip_bound(&slip_bound, self.m())?;
        Ok(self.with_step(load, gap, slip_origin, slip_bound))
    }

    /// [`ContactProblem::with_data`] on the way of a solve, where numbers may have become anything.
    ///
    /// # Panics
    /// If a length differs.
    pub(crate) fn with_step(
        &self,
        load: Vec<f64>,
        gap: Vec<f64>,
        slip_origin: Vec<f64>,
        slip_bound: Vec<f64>,
    ) -> Self {
        assert_eq!(load.len(), self.load.len());
        assert_eq!((gap.len(), slip_bound.len()), (self.m(), self.m()));
        assert_eq!(slip_origin.len(), self.slip_origin.len());
        Self {
            acting: norm(&load),
            load,
            gap,
            slip_origin,
            slip_bound,
            ..self.clone()
        }
    }

    /// Gives the area of each contact node, length m: what turns its force into a pressure. Without, forces are
    /// compared as they are.
    ///
    /// # Errors
    /// If the length differs, or an entry is not a positive number.
    pub fn with_areas(mut self, areas: Vec<f64>) -> Result<Self, ProblemError> {
        check::length("the areas", &areas, self.m())?;
        check::finite("the areas", &areas)?;
        if let Some(i) = areas.iter().position(|&area| !(area > 0.0)) {
            return Err(ProblemError::Area {
                row: i + 1,
                value: areas[i],
            });
        }
        self.areas = Arc::new(areas);
        Ok(self)
    }

    /// Says how large the forces are that act on the bodies (a Euclidean norm), where the load f is larger by
    /// what prescribed displacements add to it.
    pub(crate) fn with_acting_forces(mut self, acting: f64) -> Self {
        self.acting = acting;
        self
    }

    /// Says how far bodies have been displaced before this load step (the largest component).
    pub(crate) fn with_travelled(mut self, travelled: f64) -> Self {
        self.travelled = travelled;
        self
    }

    /// The length that displacements, gaps and slips of this problem are differences of, at most.
    pub(crate) fn reach(&self) -> f64 {
        (self.travelled)
            .max(norm_max(&self.gap))
            .max(norm_max(&self.slip_origin))
    }

    /// Says how many of the unknowns are free, where some rows of K only hold a prescribed component.
    pub(crate) fn with_free_unknowns(mut self, n_free: usize) -> Self {
        self.n_free = n_free.min(self.n);
        self
    }

    /// The problem without Coulomb's law, with the slip bounds given.
    ///
    /// # Panics
    /// If the length differs.
    pub(crate) fn with_frozen_bounds(mut self, slip_bound: Vec<f64>) -> Self {
        assert_eq!(slip_bound.len(), self.m());
        self.slip_bound = slip_bound;
        self.friction = Vec::new();
        self
    }

    /// Whether a law of friction acts on contact node i: a slip bound, or a coefficient, above 0.
    pub fn has_friction(&self, i: usize) -> bool {
        self.slip_bound[i] > 0.0 || self.friction.get(i).is_some_and(|&mu| mu > 0.0)
    }

    /// Number of unknowns n that the user gave.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Number of unknowns that are free to move.
    pub fn n_free(&self) -> usize {
        self.n_free
    }

    /// Number of contact nodes m.
    pub fn m(&self) -> usize {
        self.gap.len()
    }

    /// K; where n is no multiple of D with decoupled unknowns that complete the last block.
    pub fn stiffness(&self) -> &Arc<BlockCsr<D>> {
        &self.stiffness
    }

    /// B = (N; T): D m rows, and as many columns as K.
    pub fn contact_matrix(&self) -> Csr {
        let m = self.m();
        let tangential = self.tangential.triplets().map(|(i, j, v)| (i + m, j, v));
        Csr::from_triplets(
            D * m,
            self.stiffness.n_cols(),
            self.normal
                .triplets()
                .chain(tangential)
                .filter(|&(_, _, v)| v != 0.0),
        )
    }

    /// Whether B touches each block row of K.
    pub(crate) fn touched(&self) -> Vec<bool> {
        let mut touched = vec![false; self.stiffness.n_block_rows()];
        for (_, j, v) in self.normal.triplets().chain(self.tangential.triplets()) {
            touched[j / D] |= v != 0.0;
        }
        touched
    }

    /// f, as long as K has rows.
    pub fn load(&self) -> &[f64] {
        &self.load
    }

    /// Where slip is counted from: (3) is about T u less this.
    pub fn slip_origin(&self) -> &[f64] {
        &self.slip_origin
    }

    /// (d, origin of slip): c in r = c − B u.
    pub fn offsets(&self) -> Vec<f64> {
        [&self.gap[..], &self.slip_origin].concat()
    }

    /// The areas of the contact nodes; ones where they are not known.
    pub fn areas(&self) -> &[f64] {
        &self.areas
    }

    /// The bodies that can move as a whole, as far as K and the coordinates tell.
    pub fn free_bodies(&self) -> &FreeBodies<D> {
        &self.free
    }

    /// How far a multiplier moves its own contact node at least, per force: Σⱼ Bᵢⱼ²/Kⱼⱼ ≤ Aᵢᵢ, length D m; 0 for
    /// an empty row.
    pub(crate) fn compliance(&self) -> &[f64] {
        &self.compliance
    }

    /// N.
    pub fn normal(&self) -> &Csr {
        &self.normal
    }

    /// T.
    pub fn tangential(&self) -> &Csr {
        &self.tangential
    }

    /// d.
    pub fn gap(&self) -> &[f64] {
        &self.gap
    }

    /// g, as far as it is given: [`ContactProblem::bounds`] has all of it.
    pub fn slip_bound(&self) -> &[f64] {
        &self.slip_bound
    }

    /// μ of each contact node, 0 where the slip bound is given; empty without Coulomb friction.
    pub fn friction_coefficient(&self) -> &[f64] {
        &self.friction
    }

    /// Whether there is Coulomb friction.
    pub fn has_coulomb(&self) -> bool {
        !self.friction.is_empty()
    }

    /// g under Coulomb's law: μλν of the multipliers given, and the given bounds elsewhere.
    pub fn bounds(&self, lambda: &[f64]) -> Cow<'_, [f64]> {
        coulomb_bounds(&self.slip_bound, &self.friction, lambda)
    }

    /// The points that each D unknowns belong to, if known.
    pub fn coordinates(&self) -> Option<&[[f64; D]]> {
        self.coordinates.as_deref()
    }

    /// Whether K ties an unknown to another one; those it does not are held where they are.
    pub(crate) fn is_coupled(&self, unknown: usize) -> bool {
        is_coupled(&self.stiffness, unknown)
    }

    /// " at (x, y)", in space " at (x, y, z)", for an unknown whose place is known.
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

/// The slip bound of a node with the normal multiplier λν: μλν where μ > 0, the given one elsewhere.
pub(crate) fn coulomb_bound(given: f64, mu: f64, normal: f64) -> f64 {
    if mu > 0.0 {
        mu * normal.max(0.0)
    } else {
        given
    }
}

/// The slip bounds at λ: μλν where μ > 0, the given ones elsewhere (everywhere if μ is empty).
pub(crate) fn coulomb_bounds<'a>(given: &'a [f64], mu: &[f64], lambda: &[f64]) -> Cow<'a, [f64]> {
    if mu.is_empty() {
        return Cow::Borrowed(given);
    }
    let all = given.iter().zip(mu).zip(lambda);
    Cow::Owned(all.map(|((&g, &mu), &l)| coulomb_bound(g, mu, l)).collect())
}

/// Whether K ties an unknown to another one.
fn is_coupled<const D: usize>(k: &BlockCsr<D>, unknown: usize) -> bool {
    let (i, a) = (unknown / D, unknown % D);
    let (cols, blocks) = k.row(i);
    (cols.iter().zip(blocks))
        .any(|(&j, block)| (0..D).any(|b| D * j as usize + b != unknown && block[a][b] != 0.0))
}

/// Σⱼ Bᵢⱼ²/Kⱼⱼ for each row i of B; in space both tangents of a node get their mean.
fn compliances<const D: usize>(data: &ContactData<D>) -> Vec<f64> {
    let diagonal = data.stiffness.diagonal();
    let mut all = Vec::new();
    for matrix in [&data.normal, &data.tangential] {
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
    for tangents in all[data.gap.len()..].chunks_mut(D - 1) {
        share(tangents);
    }
    all
}

/// Gives the tangents of a node the same compliance, their mean: it does not depend on which pair of tangents they are,
/// and a disc stays one. An empty row keeps its 0.
fn share(tangents: &mut [f64]) {
    let rows = tangents.iter().filter(|&&c| c > 0.0).count();
    if rows > 1 {
        let mean = tangents.iter().sum::<f64>() / rows as f64;
        tangents.fill(mean);
    }
}
