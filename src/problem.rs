//! The algebraic contact problem (1)–(3) of the paper, validated: the entry for users with their own discretisation.
//!
//! D is the number of unknowns per node: 2 in the plane, where it may be left out, and 3 in space. There a contact node
//! slides in two directions, so that T has two rows for each, one after the other.

mod any;
mod check;
mod delassus;
mod floating;
mod kkt;
mod load;
mod matrices;
#[cfg(feature = "mpi")]
mod share;
mod system;
#[cfg(test)]
mod tests;
mod vertices;

pub use any::{AnyProblem, dimension};
pub(crate) use check::{LARGEST, SIZES, UNREACHABLE, is_infinite, is_sized};
pub use check::{Place, ProblemError};
#[cfg(feature = "mpi")]
pub(crate) use floating::Motions;
pub use floating::{FloatingBodies, FloatingBody};
pub use kkt::Kkt;
pub(crate) use kkt::{Scales, beyond, slip_violation};
pub use load::LoadCase;
pub use matrices::{Index, Matrices, SparseRef};
#[cfg(feature = "mpi")]
pub(crate) use share::Share;
pub use system::System;
pub use vertices::Vertices;

use crate::constraint::{SlipBound, TIED};
use crate::sparse::{BlockCsr, Csr, norm};
use std::borrow::Cow;
use std::ops::{Deref, Range};
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
/// In space |λτ,i| is the Euclidean length of the two components, and (3) keeps it in a disc. Where contact is compliant
/// ([`ContactProblem::with_compliance`]), N u − Cν λν replaces N u, and T u − Cτ λτ replaces T u, in (2) and (3).
#[derive(Clone, Debug)]
pub struct ContactData<const D: usize = 2> {
    /// K, n × n, symmetric positive definite, or semidefinite where bodies can move as a whole. If n is not a multiple
    /// of D, [`BlockCsr::from_triplets`] completes the last block.
    pub stiffness: BlockCsr<D>,
    /// f, length n.
    pub load: Vec<f64>,
    /// N, m × n: the displacement of contact node i towards the obstacle is (N u)ᵢ.
    pub normal: Csr,
    /// T, (D − 1)m × n: the displacement of contact node i along the boundary is (T u)ᵢ. In space rows 2i and 2i + 1,
    /// counted from 0, are its components along two directions at right angles. All rows of a node may be empty where
    /// gᵢ = 0 (it cannot move sideways), and in space one of the two (it can move along a line).
    pub tangential: Csr,
    /// d, length m: the initial gap, ≥ 0.
    pub gap: Vec<f64>,
    /// g, length m: the slip bound (a force per contact node), ≥ 0; for Coulomb's law see
    /// [`ContactProblem::with_friction_coefficient`].
    pub slip_bound: Vec<f64>,
    /// One point per D unknowns, if they are the displacements of nodes; gives rigid body modes.
    pub coordinates: Option<Vec<[f64; D]>>,
}

/// The number of sliding directions of a contact node in D dimensions.
pub(crate) const fn tangents<const D: usize>() -> usize {
    D - 1
}

/// The rows of T, and the entries of λτ, that belong to contact node i.
pub(crate) fn tangents_of<const D: usize>(i: usize) -> Range<usize> {
    tangents::<D>() * i..tangents::<D>() * (i + 1)
}

/// A validated contact problem: all code that works on it may rely on that.
///
/// It is a [`System`], which is made once and shared, with a [`LoadCase`]: cloning it and taking another load
/// ([`ContactProblem::with_data`]) copies neither matrices nor points. K is the matrix or, once only an operator knows
/// it, [`Elsewhere`].
#[derive(Clone, Debug)]
pub struct ContactProblem<const D: usize = 2, K = Arc<BlockCsr<D>>> {
    system: Arc<System<D>>,
    /// Shared, because backends on the CPU work on it in place.
    stiffness: K,
    case: LoadCase,
}

/// The K of a problem that only its dual operator knows.
#[derive(Clone, Copy, Debug)]
pub struct Elsewhere;

impl<const D: usize, K> Deref for ContactProblem<D, K> {
    type Target = System<D>;

    fn deref(&self) -> &System<D> {
        &self.system
    }
}

impl<const D: usize> ContactProblem<D> {
    /// Checks the data: shapes, finite values, K symmetric with a positive diagonal, d ≥ 0, g ≥ 0, no parallel rows in B = (N;
    /// T). Factorisation checks that K is positive definite. An infinite entry of d means a node without an obstacle, an
    /// infinite entry of g a node that never slips. A row without entries has no effect.
    ///
    /// # Errors
    /// The entry and its fault.
    pub fn new(data: ContactData<D>) -> Result<Self, ProblemError> {
        Self::compliant(data, Vec::new())
    }

    /// The same for rows of bodies in contact, which may depend on each other where several parts of one body are under
    /// one facet of another. Forces are unique even so, multipliers need not be.
    pub(crate) fn of_bodies(
        data: ContactData<D>,
        compliance: Vec<f64>,
        tied: &[bool],
    ) -> Result<Self, ProblemError> {
        let n = data.load.len();
        let data = check::checked_but_for_rank(data, &compliance)?;
        Self::from_checked(data, n)
            .with_compliance(compliance)?
            .with_ties(tied)
    }

    /// The same with a compliance: compliant rows may depend on each other, others must not.
    pub(crate) fn compliant(
        data: ContactData<D>,
        compliance: Vec<f64>,
    ) -> Result<Self, ProblemError> {
        let n = data.load.len();
        let data = check::checked_but_for_rank(data, &compliance)?;
        check::rank(&data.normal, &data.tangential, n, &compliance)?;
        Self::from_checked(data, n).with_compliance(compliance)
    }

    fn from_checked(data: ContactData<D>, n: usize) -> Self {
        let system = System::new(&data, n);
        let origin = vec![0.0; system.tangential().n_rows()];
        let acting = norm(&data.load);
        Self {
            system: Arc::new(system),
            stiffness: Arc::new(data.stiffness),
            case: LoadCase::new(data.load, acting, data.gap, origin, data.slip_bound),
        }
    }

    /// Whether rows of B depend on each other, by the checks with which [`ContactProblem::new`] refuses them.
    #[cfg(feature = "case")]
    pub(crate) fn has_dependent_rows(&self) -> bool {
        let compliance = self.contact_compliance();
        check::rank(self.normal(), self.tangential(), self.n(), compliance).is_err()
    }

    /// K; if n is not a multiple of D, with decoupled unknowns that complete the last block.
    pub fn stiffness(&self) -> &Arc<BlockCsr<D>> {
        &self.stiffness
    }
}

impl<const D: usize, K> ContactProblem<D, K> {
    /// The problem with a K that only a dual operator knows. Of its matrix K only the diagonal is used any more, which
    /// may be all it had, and the floating bodies found before.
    pub fn elsewhere(&self) -> ContactProblem<D, Elsewhere> {
        ContactProblem {
            system: Arc::clone(&self.system),
            stiffness: Elsewhere,
            case: self.case.clone(),
        }
    }

    /// The same problem for a K with springs on all motions of bodies as a whole: none is free.
    pub(crate) fn supported(&self) -> Self
    where
        K: Clone,
    {
        Self {
            system: Arc::new(self.system.supported()),
            ..self.clone()
        }
    }

    /// Gives contact nodes Coulomb's law, or other coefficients than before: where μᵢ > 0 the slip bound is μᵢλν,i and the entry of
    /// `slip_bound` is ignored. A node with an infinite μᵢ never slips while it is pressed, and a tied node stays tied.
    ///
    /// # Errors
    /// If the length is not m (or 0: no Coulomb friction), or an entry is negative or not a number.
    pub fn with_friction_coefficient(mut self, mut mu: Vec<f64>) -> Result<Self, ProblemError> {
        if !mu.is_empty() {
            check::friction(&mut mu, self.m())?;
        }
        self.set_friction(mu);
        Ok(self)
    }

    /// Sets the area of each contact node, length m, which turns its force into a pressure. Without areas, forces are
    /// compared directly.
    ///
    /// # Errors
    /// If the length differs, or an entry is not a positive number.
    pub fn with_areas(mut self, areas: Vec<f64>) -> Result<Self, ProblemError> {
        check::length("the areas", &areas, self.m(), check::PER_NODE)?;
        check::finite("the areas", &areas)?;
        if let Some(i) = areas.iter().position(|&area| !(area > 0.0)) {
            return Err(ProblemError::Area {
                row: i + 1,
                value: areas[i],
            });
        }
        Arc::make_mut(&mut self.system).areas = areas;
        Ok(self)
    }

    /// Makes contact compliant, with C = diag(`compliance`) ≥ 0, length D m, in the order of λ and in m/N (1/(k a) for
    /// a stiffness k per area on an area a). (2) and (3) hold for N u − Cν λν and T u − Cτ λτ. The gap may close by Cν
    /// λν, and slip begins after Cτ λτ. An empty vector, or zeros: hard contact.
    ///
    /// In space both tangents of a node have the same compliance. A row of T without entries has none. Rows with a compliance may
    /// depend on each other: see [`Matrices::compliance`].
    ///
    /// # Errors
    /// If the length is neither D m nor 0, an entry is negative or not finite, or the two tangents of a node differ.
    pub fn with_compliance(mut self, compliance: Vec<f64>) -> Result<Self, ProblemError> {
        check::compliance::<D>(&compliance, self.m())?;
        if !(compliance.is_empty() && self.contact_compliance().is_empty()) {
            Arc::make_mut(&mut self.system).set_compliance(compliance);
        }
        Ok(self)
    }

    /// Ties contact nodes. Their multipliers are free in every direction, and N u = d and T u = 0 hold there (with a
    /// compliance, N u − Cν λν and T u − Cτ λτ). Their slip bound is infinite from here on. m entries, or none: no node
    /// is tied.
    ///
    /// # Errors
    /// If the length is neither m nor 0, or the gap of a tied node is infinite.
    pub fn with_ties(mut self, tied: &[bool]) -> Result<Self, ProblemError> {
        if !tied.is_empty() {
            check::length_of("the ties", tied.len(), self.m(), check::PER_NODE)?;
        }
        let bounds = self.case.slip_bound.iter_mut().zip(tied);
        bounds
            .filter(|(_, tied)| **tied)
            .for_each(|(bound, _)| *bound = TIED);
        let mu = self.friction_coefficient().to_vec();
        self.set_friction(mu);
        self.with_ties_to_something()
    }

    /// The same if no tied node has an infinite gap.
    fn with_ties_to_something(self) -> Result<Self, ProblemError> {
        let is_nothing = |i: &usize| self.is_tied(*i) && self.is_far(*i);
        match (0..self.m()).find(is_nothing) {
            Some(i) => Err(ProblemError::TiedToNothing { row: i + 1 }),
            None => Ok(self),
        }
    }

    /// Sets coefficients of friction without those of tied nodes, which they would untie.
    fn set_friction(&mut self, mut mu: Vec<f64>) {
        for (mu, bound) in mu.iter_mut().zip(&self.case.slip_bound) {
            if *bound == TIED {
                *mu = 0.0;
            }
        }
        self.case.friction = match mu.iter().all(|&mu| mu == 0.0) {
            true => Arc::default(),
            false => Arc::new(mu),
        };
    }

    /// Another load f, one entry per row of K.
    ///
    /// # Errors
    /// If the length differs, or an entry is not finite, or out of range.
    pub fn with_load(mut self, load: Vec<f64>) -> Result<Self, ProblemError> {
        let (name, reason) = ("the load f", "one entry per row of K");
        check::length(name, &load, self.n_rows(), reason)?;
        check::finite(name, &load)?;
        check::sized_load(&load)?;
        self.case.acting = norm(&load);
        self.case.force = Arc::new(load);
        Ok(self)
    }

    /// Another gap, which may be negative: pressed or shrunk parts overlap (an interference), and a prescribed motion may
    /// close more than the gap. An infinite gap means no obstacle.
    ///
    /// # Errors
    /// If the length is not m, an entry is −∞ or not a number, negative where the row of N has no entries, or infinite where
    /// the node is tied.
    pub fn with_gap(mut self, mut gap: Vec<f64>) -> Result<Self, ProblemError> {
        check::length("the gap d", &gap, self.m(), check::PER_NODE)?;
        check::gap(&mut gap)?;
        let is_tied: Vec<bool> = (0..self.m()).map(|i| self.is_tied(i)).collect();
        check::no_overlap_of_nothing(&gap, self.normal(), self.contact_compliance(), &is_tied)?;
        self.case.gap = gap;
        self.with_ties_to_something()
    }

    /// Another origin of slip, an entry per row of T: (3) holds for T u minus this origin.
    ///
    /// # Errors
    /// If the length differs, or an entry is not finite.
    pub fn with_slip_origin(mut self, origin: Vec<f64>) -> Result<Self, ProblemError> {
        let (name, reason) = ("the origin of slip", "one entry per row of T");
        check::length(name, &origin, self.tangential().n_rows(), reason)?;
        check::finite(name, &origin)?;
        let case = LoadCase {
            slip_origin: origin,
            ..self.case.clone()
        };
        self.case = self.without_empty_rows(case);
        Ok(self)
    }

    /// Another slip bound g, length m. A node with an infinite one never slips, and a tied node stays tied with it.
    ///
    /// # Errors
    /// If the length differs, or an entry is negative or not a number.
    pub fn with_slip_bound(mut self, mut bound: Vec<f64>) -> Result<Self, ProblemError> {
        let stays: Vec<bool> = (bound.iter().zip(&self.case.slip_bound))
            .map(|(g, before)| *g == TIED && *before == TIED)
            .collect();
        check::slip_bound(&mut bound, self.m())?;
        let tied = bound.iter_mut().zip(stays).filter(|(_, stays)| *stays);
        tied.for_each(|(bound, _)| *bound = TIED);
        self.case.slip_bound = bound;
        Ok(self)
    }

    /// The problem, if no contact node has a slip bound beside a coefficient of friction, which
    /// [`Self::with_friction_coefficient`] would prefer in silence.
    ///
    /// # Errors
    /// The first node that has both.
    pub fn with_one_law(self) -> Result<Self, ProblemError> {
        let (mu, g) = (self.friction_coefficient(), &self.case.slip_bound);
        let both = mu.iter().zip(g).position(|(&mu, &g)| mu > 0.0 && g > 0.0);
        match both {
            Some(i) => Err(ProblemError::TwoLaws {
                row: i + 1,
                bound: g[i],
                mu: mu[i],
            }),
            None => Ok(self),
        }
    }

    /// Sets how the nodes of second-order elements follow their corners, the first coarse level of multigrid.
    ///
    /// # Panics
    /// If the number of nodes differs from that of K.
    pub fn with_vertices(mut self, vertices: Vertices<D>) -> Self {
        assert_eq!(D * vertices.prolongation.n_block_rows(), self.n_rows());
        Arc::make_mut(&mut self.system).vertices = Some(Arc::new(vertices));
        self
    }

    /// Sets the largest Poisson's ratio, from which [`Stiffness::Auto`](crate::engine::Stiffness::Auto) predicts iterations.
    pub(crate) fn with_poisson(mut self, poisson: f64) -> Self {
        Arc::make_mut(&mut self.system).poisson = poisson;
        self
    }

    /// Sets the number of free unknowns, where some rows of K only hold a prescribed component.
    pub(crate) fn with_free_unknowns(mut self, n_free: usize) -> Self {
        let system = Arc::make_mut(&mut self.system);
        system.n_free = n_free.min(system.n);
        self
    }

    /// The problem with the same K, N and T and another load, gap, origin of slip and slip bound: a load step, or one
    /// of several problems in a row. `load` has an entry per row of K, `gap` and `slip_bound` have length m,
    /// `slip_origin` has an entry per row of T: (3) then holds for T u − `slip_origin`. The gap may be negative here,
    /// where a prescribed motion has closed it.
    ///
    /// # Errors
    /// If a length differs, an entry is not finite, or one of the slip bound is negative.
    pub fn with_data(
        &self,
        load: Vec<f64>,
        gap: Vec<f64>,
        slip_origin: Vec<f64>,
        slip_bound: Vec<f64>,
    ) -> Result<Self, ProblemError>
    where
        K: Clone,
    {
        (self.clone().with_load(load)?)
            .with_gap(gap)?
            .with_slip_origin(slip_origin)?
            .with_slip_bound(slip_bound)
    }

    /// The problem on the same K with other contact nodes, perhaps in another number: N, T, d and g as in [`ContactData`], but the
    /// gap may be negative. Contact is hard, without coefficients of friction, areas and ties; slip is measured from u = 0.
    ///
    /// # Errors
    /// Those of [`ContactProblem::new`] for these data.
    pub fn with_contact(
        &self,
        normal: Csr,
        tangential: Csr,
        mut gap: Vec<f64>,
        mut slip_bound: Vec<f64>,
    ) -> Result<Self, ProblemError>
    where
        K: Clone,
    {
        let m = gap.len();
        let shape = |matrix: &Csr| (matrix.n_rows(), matrix.n_cols());
        check::contact_shapes::<D>(shape(&normal), shape(&tangential), m, self.n())?;
        check::rows_finite(&normal, &tangential)?;
        check::gap(&mut gap)?;
        check::slip_bound(&mut slip_bound, m)?;
        check::no_overlap_of_nothing(&gap, &normal, &[], &[])?;
        check::rank(&normal, &tangential, self.n(), &[])?;
        let [normal, tangential] = [normal, tangential].map(|rows| match rows.n_cols() {
            n if n == self.n_rows() => rows,
            _ => Csr::from_triplets(rows.n_rows(), self.n_rows(), rows.triplets()),
        });
        let origin = vec![0.0; tangential.n_rows()];
        Ok(Self {
            system: Arc::new(self.system.as_ref().clone().with_rows(normal, tangential)),
            stiffness: self.stiffness.clone(),
            case: LoadCase {
                force: Arc::clone(&self.case.force),
                ..LoadCase::new(Vec::new(), self.case.acting, gap, origin, slip_bound)
            },
        })
    }

    /// The same system under another load case, which has its own coefficients of friction.
    ///
    /// # Panics
    /// If one of its vectors has another length than before.
    pub(crate) fn under(&self, case: LoadCase) -> Self
    where
        K: Clone,
    {
        let lengths = |case: &LoadCase| {
            let [a, b, c] = [&case.gap, &case.slip_origin, &case.slip_bound].map(Vec::len);
            [case.force.len(), a, b, c]
        };
        assert_eq!(lengths(&case), lengths(&self.case));
        let case = self.without_empty_rows(case);
        Self {
            case,
            ..self.clone()
        }
    }

    /// The same with other slip bounds and coefficients of friction, whose values have been checked.
    pub(crate) fn under_law(&self, slip_bound: Vec<f64>, mut friction: Vec<f64>) -> Self
    where
        K: Clone,
    {
        if friction.iter().all(|&mu| mu == 0.0) {
            friction.clear();
        }
        self.under(LoadCase {
            slip_bound,
            friction: Arc::new(friction),
            ..self.case.clone()
        })
    }

    /// The same with more compliance of normal contact, m values; pairs of other solves still hold.
    pub(crate) fn giving_way(&self, more: &[f64]) -> Self
    where
        K: Clone,
    {
        let mut made = self.clone();
        Arc::make_mut(&mut made.system).add_compliance(more);
        made
    }

    /// Along a row of T without entries nothing slips, whatever the origin of slip.
    fn without_empty_rows(&self, mut case: LoadCase) -> LoadCase {
        let own = &self.own_compliance()[self.m()..];
        let empty = case.slip_origin.iter_mut().zip(own);
        (empty.filter(|(_, own)| **own == 0.0)).for_each(|(origin, _)| *origin = 0.0);
        case
    }

    /// Load, gap, and origin of slip.
    pub fn load_case(&self) -> &LoadCase {
        &self.case
    }

    /// f, an entry per row of K.
    pub fn load(&self) -> &[f64] {
        &self.case.force
    }

    /// d.
    pub fn gap(&self) -> &[f64] {
        &self.case.gap
    }

    /// The origin of slip: (3) holds for T u minus this.
    pub fn slip_origin(&self) -> &[f64] {
        &self.case.slip_origin
    }

    /// g, where it is given: [`ContactProblem::bounds`] has all of it. Infinite at tied nodes.
    pub fn slip_bound(&self) -> &[f64] {
        &self.case.slip_bound
    }

    /// μ of each contact node, 0 where the slip bound is given; empty without Coulomb friction.
    pub fn friction_coefficient(&self) -> &[f64] {
        &self.case.friction
    }

    /// Whether there is Coulomb friction.
    pub fn has_coulomb(&self) -> bool {
        !self.friction_coefficient().is_empty()
    }

    /// Whether contact node i is tied.
    pub fn is_tied(&self, i: usize) -> bool {
        self.law(i) == SlipBound::Tied
    }

    /// Whether a multiplier is the normal one of a contact node whose gap is infinite: no pressure can hold a body there, though friction
    /// with a given bound can.
    pub(crate) fn is_out_of_reach(&self, row: usize) -> bool {
        row < self.m() && self.is_far(row)
    }

    /// Whether the gap of contact node i is infinite.
    fn is_far(&self, i: usize) -> bool {
        is_infinite(self.case.gap[i])
    }

    /// Whether a law of friction acts on contact node i, or a tie: a slip bound, or a coefficient, above 0.
    pub fn has_friction(&self, i: usize) -> bool {
        self.law(i).is_any()
    }

    /// The law of contact node i.
    pub(crate) fn law(&self, i: usize) -> SlipBound {
        let mu = self.friction_coefficient().get(i);
        SlipBound::of(self.slip_bound()[i], mu.copied().unwrap_or(0.0))
    }

    /// g under Coulomb's law: μλν of the multipliers given, and the given bounds elsewhere.
    pub fn bounds(&self, lambda: &[f64]) -> Cow<'_, [f64]> {
        match self.has_coulomb() {
            true => (0..self.m())
                .map(|i| self.law(i).disc(lambda[i]).g)
                .collect(),
            false => Cow::Borrowed(self.slip_bound()),
        }
    }
}
