//! Contacts whose Delassus operator W is given: u = W r + q.

use super::{ContactData, ContactProblem, Elsewhere, ProblemError, check, tangents};
use crate::sparse::{BlockCsr, Csr};
use std::sync::Arc;

impl<const D: usize> ContactProblem<D> {
    /// The problem of m contacts with Coulomb friction whose relative velocities (or displacements) are u = W r + q at
    /// the contact impulses (or forces) r. Both have the normal component first, then the tangential ones, contact by
    /// contact. u and r press or part along the normal (uₙ ≥ 0, rₙ ≥ 0, uₙ rₙ = 0), and friction opposes u. W is
    /// symmetric and may be semidefinite.
    ///
    /// Its unknowns are −W r, in the same order; K represents W⁻¹, and only the dual operator
    /// ([`DelassusDual`](crate::dual::DelassusDual)) knows W. B separates the rows, so that r = Bᵀλ.
    ///
    /// `diagonal` is the diagonal of W or an estimate of it; `friction` has μ of each contact.
    ///
    /// # Errors
    /// If lengths do not fit, entries are not finite, or the diagonal or μ has negative ones, or the diagonal one out of range.
    pub fn from_delassus(
        diagonal: &[f64],
        q: &[f64],
        friction: &[f64],
    ) -> Result<ContactProblem<D, Elsewhere>, ProblemError> {
        let m = friction.len();
        let (name, reason) = ("q", "a normal and the tangential entries for each contact");
        check::length(name, q, D * m, reason)?;
        check::length(
            "the diagonal of W",
            diagonal,
            D * m,
            "one entry per row of W",
        )?;
        check::delassus(diagonal)?;
        check::finite(name, q)?;
        // A contact that nothing moves has no compliance of its own, so the others' compliance is its scale.
        let moved = diagonal.iter().filter(|&&w| w > 0.0);
        let mean = match moved.clone().count() {
            0 => 1.0,
            count => moved.sum::<f64>() / count as f64,
        };
        let entries = (0..).zip(diagonal);
        let inverse = entries.map(|(i, &w)| (i, i, 1.0 / if w > 0.0 { w } else { mean }));
        let each = tangents::<D>();
        let tangential = (0..each * m).map(|row| (row, D * (row / each) + 1 + row % each, 1.0));
        let gap: Vec<f64> = q.iter().step_by(D).copied().collect();
        let origin: Vec<f64> = q.chunks(D).flat_map(|of| &of[1..]).copied().collect();
        let data = ContactData {
            stiffness: BlockCsr::from_triplets(D * m, D * m, inverse),
            load: vec![0.0; D * m],
            normal: Csr::from_triplets(m, D * m, (0..m).map(|i| (i, D * i, 1.0))),
            tangential: Csr::from_triplets(each * m, D * m, tangential),
            gap: vec![0.0; m],
            slip_bound: vec![0.0; m],
            coordinates: None,
        };
        let mut problem = Self::new(data)?
            .with_friction_coefficient(friction.to_vec())?
            .with_gap(gap)?
            .with_slip_origin(origin)?;
        Arc::make_mut(&mut problem.system).is_rigid = true;
        Ok(problem.elsewhere())
    }
}
