//! The dual operator on the factor of K.
//!
//! A product with A needs only the dense trailing blocks of the factor ([`Factor`]). The right-hand side needs one
//! forward sweep over the rest for the whole contact problem, and the displacement one backward sweep at the end.
//!
//! Where bodies can move as a whole, as many unknowns as they have motions are fixed. Loads in balance cause no
//! reaction there.

use super::{DualError, DualOperator, Request, take_force};
use crate::control::{Accuracy, Correction, Stop};
use crate::dense;
use crate::problem::ContactProblem;
use crate::sparse::stored::SquareBlocks;
use crate::sparse::{Csr, norm};
use crate::stiffness::cholesky::{Factor, FactorError, Plan};
use faer::Mat;
use std::sync::Arc;
use web_time::Instant;

/// A relative residual of the probe solve that needs no second look.
const PROBE_LIMIT: f64 = 1e-6;
/// The largest accepted backward error of the probe solve; its relative error comes from one step of refinement.
/// Slender bodies have large residuals under small loads: there K x is a small difference of large terms.
const BACKWARD_LIMIT: f64 = 1e-12;
const FORWARD_LIMIT: f64 = 1e-4;
/// The unknowns of a rigid body in space, twice: blocks of K may be shared by two bodies.
const RIGID: usize = 12;
/// Entries of A as a matrix at most: those of 1 000 contacts in space that all depend on each other, where a Newton step takes seconds.
pub(crate) const LARGEST_MATRIX: usize = 10_000_000;
/// Steps of iterative refinement at most.
const REFINEMENTS: usize = 3;
/// The dual operator of a problem on the factor of K.
pub struct DirectDual {
    factor: Factor,
    /// B₂: 2m rows (N, then T) over the trailing positions.
    b: Csr,
    k: Arc<dyn SquareBlocks>,
    /// B over all unknowns.
    contact: Arc<Csr>,
    /// The f of the last load case, and the forward half of a solve with it.
    load: Arc<Vec<f64>>,
    reduced_load: Vec<f64>,
    workspace: Vec<f64>,
    /// K is so badly conditioned that displacements are refined with residuals of twice the precision, and r is made
    /// from them.
    refined: bool,
    /// A, where K is that of rigid bodies.
    matrix: Option<Csr>,
    /// Seconds for one full solve with K (the probe).
    pub solve_seconds: f64,
}

/// The order of elimination for a problem and the pattern of the factor.
pub(crate) fn plan<const D: usize>(problem: &ContactProblem<D>) -> Result<Plan, FactorError> {
    let touched = problem.touched();
    let fixed = (problem.floating_bodies()).unknowns_to_fix(|unknown| touched[unknown / D]);
    Plan::new(problem.stiffness(), problem.coordinates(), &touched, fixed)
}

/// B₂ of a B, unless it touches unknowns that are not among the trailing ones.
fn trailing_rows(factor: &Factor, contact: &Csr) -> Option<Csr> {
    let entries: Option<Vec<(usize, usize, f64)>> = (contact.triplets())
        .filter_map(|(i, j, v)| {
            let position = factor.position(j)?;
            Some((position.checked_sub(factor.n_leading())).map(|column| (i, column, v)))
        })
        .collect();
    let trailing = factor.n() - factor.n_leading();
    Some(Csr::from_triplets(contact.n_rows(), trailing, entries?))
}

/// An error with the place where it is known.
fn placed<const D: usize>(problem: &ContactProblem<D>, error: FactorError) -> FactorError {
    match error {
        FactorError::NotPositiveDefinite { unknown, .. } => FactorError::NotPositiveDefinite {
            unknown,
            place: problem.place_of(unknown - 1),
        },
        error => error,
    }
}

impl DirectDual {
    /// Factorises K of the problem and checks the factor with a solve.
    pub fn new<const D: usize>(problem: &ContactProblem<D>) -> Result<Self, FactorError> {
        Self::with_plan(problem, plan(problem)?)
    }

    /// Like [`DirectDual::new`], with an earlier plan for the same problem.
    pub(crate) fn with_plan<const D: usize>(
        problem: &ContactProblem<D>,
        plan: Plan,
    ) -> Result<Self, FactorError> {
        let k = problem.stiffness();
        let factor = Factor::new(k, plan).map_err(|error| placed(problem, error))?;
        let contact = Arc::clone(problem.contact_matrix());
        let b = trailing_rows(&factor, &contact).expect("what B touches comes last");
        let mut dual = Self {
            workspace: vec![0.0; b.n_cols()],
            b,
            k: Arc::clone(k) as _,
            contact,
            load: Arc::clone(problem.load_case().force()),
            reduced_load: Vec::new(),
            matrix: of_rigid_bodies(problem),
            refined: false,
            solve_seconds: 0.0,
            factor,
        };
        dual.probe(problem)?;
        Ok(dual)
    }

    /// Switches to another problem, with the same K if `same_k` is true. Returns whether K has new values; None if its
    /// unknowns, the pattern of K or the unknowns that B touches do not fit. After None and after an error the operator is
    /// unusable.
    pub(crate) fn update<const D: usize>(
        &mut self,
        problem: &ContactProblem<D>,
        same_k: bool,
    ) -> Result<Option<bool>, FactorError> {
        let touched = problem.touched();
        let fixed = problem
            .floating_bodies()
            .unknowns_to_fix(|unknown| touched[unknown / D]);
        if problem.n_rows() != self.factor.n() || fixed != self.factor.fixed() {
            return Ok(None);
        }
        let Some(b) = trailing_rows(&self.factor, problem.contact_matrix()) else {
            return Ok(None);
        };
        if !same_k {
            match self.factor.refactor(problem.stiffness()) {
                Err(FactorError::OtherPattern { .. }) => return Ok(None),
                outcome => outcome.map_err(|error| placed(problem, error))?,
            }
            self.k = Arc::clone(problem.stiffness()) as _;
        }
        (self.b, self.contact) = (b, Arc::clone(problem.contact_matrix()));
        self.matrix = of_rigid_bodies(problem);
        if same_k {
            self.take(problem.load_case().force());
        } else {
            self.load = Arc::clone(problem.load_case().force());
            self.refined = false;
            self.probe(problem)?;
        }
        Ok(Some(!same_k))
    }

    /// The factor of K.
    pub fn factor(&self) -> &Factor {
        &self.factor
    }

    /// Solves K x = f, checks the residual, and keeps the forward half for all that follows.
    fn probe<const D: usize>(&mut self, problem: &ContactProblem<D>) -> Result<(), FactorError> {
        let n = self.factor.n();
        let f = problem.load();
        let zero_load = f.iter().all(|&v| v == 0.0);
        // Without a load anything will do that excites every unknown.
        let mut test: Vec<f64> = if zero_load {
            (0..n).map(|i| 1.0 + (i % 7) as f64).collect()
        } else {
            f.to_vec()
        };
        let start = Instant::now();
        self.reduced_load = self.factor.reduce(&test);
        let mut x = self.reduced_load.clone();
        if zero_load {
            self.reduced_load.fill(0.0);
        }
        let u = self.factor.finish(&mut x);
        self.solve_seconds = start.elapsed().as_secs_f64();
        self.factor.release(&mut test);
        // Without the reactions, where the load is not in balance.
        let residual = self.residual(&u, &test);
        if norm(&residual) <= PROBE_LIMIT * norm(&test) {
            return Ok(());
        }
        let backward = norm(&residual) / norm(&self.terms(&u, &test));
        let mut x = self.factor.reduce(&residual);
        let error = norm(&self.factor.finish(&mut x)) / norm(&u);
        // Written so that NaN is refused.
        if backward <= BACKWARD_LIMIT && error <= FORWARD_LIMIT {
            self.refined = true;
            return Ok(());
        }
        Err(FactorError::BadFactor {
            error,
            limit: FORWARD_LIMIT,
            backward,
        })
    }

    /// Takes another f.
    fn take(&mut self, force: &Arc<Vec<f64>>) {
        if take_force(force, &mut self.load) {
            self.reduced_load = self.factor.reduce(&self.load);
        }
    }

    /// f − K u where nothing is fixed; in twice the precision for a K that needs it.
    fn residual(&self, u: &[f64], f: &[f64]) -> Vec<f64> {
        let mut rest: Vec<f64> = f.to_vec();
        if self.refined {
            // Sum and error of each row (Ogita, Rump and Oishi 2005).
            let mut errors = vec![0.0; f.len()];
            self.k.for_entries(&mut |i, j, value| {
                let product = -value * u[j];
                let sum = rest[i] + product;
                let part = sum - rest[i];
                errors[i] += (-value).mul_add(u[j], -product)
                    + ((rest[i] - (sum - part)) + (product - part));
                rest[i] = sum;
            });
            rest.iter_mut().zip(errors).for_each(|(r, e)| *r += e);
        } else {
            self.k.subtract_product(u, &mut rest);
        }
        self.factor.release(&mut rest);
        rest
    }

    /// |K| |x| + |f|: the scale of the terms of K x − f.
    fn terms(&self, x: &[f64], f: &[f64]) -> Vec<f64> {
        let mut terms: Vec<f64> = f.iter().map(|f| f.abs()).collect();
        (self.k).for_entries(&mut |i, j, value| terms[i] += (value * x[j]).abs());
        terms
    }
}

/// A = B K⁻¹ Bᵀ where K consists of bodies with few unknowns: then A couples only the contacts of each body.
fn of_rigid_bodies<const D: usize>(problem: &ContactProblem<D>) -> Option<Csr> {
    if !problem.floating_bodies().is_empty() {
        return None;
    }
    let (n, b, k) = (
        problem.n_rows(),
        problem.contact_matrix(),
        problem.stiffness(),
    );
    let (count, part_of) = k.components();
    let mut bodies = vec![Vec::new(); count];
    (part_of.iter().enumerate()).for_each(|(node, &part)| bodies[part as usize].push(node));
    if bodies.iter().any(|body| D * body.len() > RIGID) {
        return None;
    }
    let mut inverse = Vec::new();
    for body in bodies {
        let unknowns: Vec<usize> = (body.iter())
            .flat_map(|&node| D * node..D * node + D)
            .collect();
        let place = |unknown: usize| unknowns.iter().position(|&u| u == unknown);
        let mut own = Mat::<f64>::zeros(unknowns.len(), unknowns.len());
        for &node in &body {
            let (cols, blocks) = k.row(node);
            for (&col, block) in cols.iter().zip(blocks) {
                for (a, row) in block.iter().enumerate() {
                    for (c, &value) in row.iter().enumerate() {
                        let at = place(D * node + a).zip(place(D * col as usize + c));
                        if let Some(at) = at {
                            own[at] = value;
                        }
                    }
                }
            }
        }
        let own = dense::inverse(&dense::cholesky(own)?);
        for (i, &row) in unknowns.iter().enumerate() {
            let entries = unknowns.iter().enumerate();
            inverse.extend(entries.map(|(j, &col)| (row, col, own[(i.max(j), i.min(j))])));
        }
    }
    let moved = b.times(&Csr::from_triplets(n, n, inverse), usize::MAX)?;
    moved.times(&b.transposed(), LARGEST_MATRIX)
}

impl DualOperator for DirectDual {
    fn size(&self) -> (usize, usize) {
        (self.load.len(), self.contact.n_rows())
    }

    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        _accuracy: Accuracy,
        _stop: &Stop,
    ) -> Result<(), DualError> {
        let mut x = std::mem::take(&mut self.workspace);
        x.fill(0.0);
        self.b.mul_transpose_add(1.0, p, &mut x);
        self.factor.solve_touched(&mut x);
        self.b.mul(&x, y);
        self.workspace = x;
        Ok(())
    }

    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.contact.mul(u, y);
    }

    fn at_contact(&mut self, request: &Request, y: &mut [f64]) -> Result<Correction, DualError> {
        if self.refined {
            let u = self.displacement(request)?;
            self.restrict(&u, y);
        } else {
            self.take(request.force);
            let mut x = self.reduced_load[self.factor.n_leading()..].to_vec();
            self.b.mul_transpose_add(-1.0, request.lambda, &mut x);
            self.factor.solve_touched(&mut x);
            self.b.mul(&x, y);
        }
        Ok(Correction::default())
    }

    fn is_exact(&self) -> bool {
        !self.refined
    }

    fn refine(&mut self) -> bool {
        !std::mem::replace(&mut self.refined, true)
    }

    fn matrix(&self) -> Option<Csr> {
        self.matrix.clone()
    }

    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        self.take(request.force);
        let residual = request.residual();
        let mut x = self.reduced_load.clone();
        let trailing = &mut x[self.factor.n_leading()..];
        self.b.mul_transpose_add(-1.0, request.lambda, trailing);
        let mut u = self.factor.finish(&mut x);
        let forces = request.forces(&self.contact);
        // Refined where rounding has left too much.
        let mut before = f64::INFINITY;
        for _ in 0..REFINEMENTS {
            let rest = self.residual(&u, &forces);
            let left = norm(&rest);
            if !self.refined && (left <= residual || !(left <= 0.5 * before)) {
                break;
            }
            let mut x = self.factor.reduce(&rest);
            let correction = self.factor.finish(&mut x);
            let moved = norm(&correction);
            // The residual says little if K x is a small difference of large terms.
            if self.refined && !(moved <= 0.5 * before) {
                break;
            }
            before = if self.refined { moved } else { left };
            u.iter_mut().zip(correction).for_each(|(u, c)| *u += c);
            if self.refined && moved <= f64::EPSILON * norm(&u) {
                break;
            }
        }
        Ok(u)
    }

    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        Ok(self.k.multiply_with_sizes(u, s))
    }
}
