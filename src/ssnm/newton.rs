//! The state that all outer steps share, and the error of a point.

use super::inner::Inner;
use super::law::Law;
use super::point::{Point, distance, settle};
use super::products::Products;
use super::sets::Sets;
use super::solution::Step;
use super::{EXACT, Method};
use crate::dual::balance::Balance;
use crate::dual::{DualError, DualOperator};
use crate::problem::{ContactProblem, Kkt, ROUNDING};
use crate::sparse::{norm, norm_max};
use std::borrow::Cow;
use std::rc::Rc;

/// What stays from step to step; multipliers are scaled.
pub(super) struct Newton<'a, O: ?Sized, const D: usize> {
    pub problem: &'a ContactProblem<D>,
    pub law: Law,
    /// Where bodies can move as a whole.
    pub balance: Option<Rc<Balance>>,
    /// c.
    pub offsets: Vec<f64>,
    /// ρ = β/σ_max: of the error, and of the sets until the safeguard has acted.
    pub rho: f64,
    /// The length of safeguarding projected gradient steps, < 2/σ_max.
    pub alpha: f64,
    pub products: Products<'a, O>,
    pub method: Method,
    /// u and the optimality conditions of the last final check.
    pub checked: Option<(Vec<f64>, Kkt)>,
    /// ‖f − Bᵀλ − Ku‖ relative to the acting forces in the final check.
    pub check_accuracy: f64,
    /// ε, and the err that it asks for.
    pub tolerance: f64,
    pub goal_err: f64,
    /// err when r was last made afresh for want of progress.
    pub refreshed: f64,
    /// Where bodies that can move as a whole are, as far as nothing moves them: coefficients of their motions.
    pub place: Option<&'a [f64]>,
}

/// What changes from step to step.
pub(super) struct Way<const D: usize> {
    /// P_Λ(λᵏ) and its gradient.
    pub point: Point,
    /// errᵏ.
    pub err: f64,
    /// err⁰.
    pub err0: f64,
    /// tolᵏ.
    pub tol: f64,
    /// The inner iteration of the last step, where it can be continued.
    pub kept: Option<Inner<D>>,
    /// The sets of the next step, where the last one has put the multipliers on their bounds already.
    pub predicted: Option<Sets<D>>,
    /// The sets of the last step.
    pub sets: Option<Sets<D>>,
    /// The steps made.
    pub history: Vec<Step>,
    /// Steps and products where err ≤ ε err⁰ held first.
    pub first_met: Option<(usize, usize)>,
}

impl<const D: usize> Way<D> {
    /// Goes back to an earlier point, where no inner iteration can be continued.
    pub fn go_back_to(&mut self, point: &Point) {
        self.point.clone_from(point);
        self.start_anew();
    }

    /// The least error of all steps so far.
    pub fn least(&self) -> f64 {
        let errors = self.history.iter().map(|step| step.err);
        self.err0 * errors.fold(1.0, f64::min)
    }

    /// Forgets what the last step has left for the next one: the point is another one, or its r.
    pub fn start_anew(&mut self) {
        self.kept = None;
        self.predicted = None;
    }
}

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// err = ‖r̃_ρ(λ)‖, the reduced gradient (10) at a point of Λ, with the α that goes with it.
    pub fn error(&self, point: &mut Point) -> f64 {
        self.error_with(point, self.rho)
    }

    /// The same for another ρ.
    pub fn error_with(&self, point: &mut Point, rho: f64) -> f64 {
        let end = self.settle(point, rho);
        distance(&point.lambda, &end) / rho
    }

    /// err relative to what it is measured by.
    pub fn relative(&self, point: &mut Point, err0: f64) -> f64 {
        let err = self.error(point);
        if err <= self.rounding(point) {
            return 0.0;
        }
        err / err0.max(self.own_motion(&point.lambda))
    }

    /// ‖(Σⱼ Bᵢⱼ²/Kⱼⱼ λᵢ)ᵢ‖: what the forces do to their own nodes at least. An err below this times ε is good
    /// enough however small err⁰ is.
    pub fn own_motion(&self, lambda: &[f64]) -> f64 {
        let own: Vec<f64> = (self.problem.compliance().iter().zip(lambda))
            .enumerate()
            .map(|(i, (c, l))| c * l * self.products.dual.factor(i).powi(2))
            .collect();
        norm(&own)
    }

    /// What r may be off by for rounding alone: f64 tells no smaller error.
    pub fn rounding(&self, point: &Point) -> f64 {
        let terms: Vec<f64> = (self.offsets.iter().zip(&point.r))
            .map(|(c, r)| c.abs().max((c - r).abs()))
            .collect();
        16.0 * f64::EPSILON * norm(&terms)
    }

    /// Chooses α at a point such that a projected gradient step of length ρ from there keeps the bodies in
    /// balance; returns where that step ends.
    pub fn settle(&self, point: &mut Point, rho: f64) -> Vec<f64> {
        let g = self.bounds(&point.lambda).into_owned();
        settle::<D>(point, rho, &g, self.balance.as_deref())
    }

    /// The slip bounds at λ: under Coulomb's law those of the nearest point that obeys it.
    pub fn bounds(&self, lambda: &[f64]) -> Cow<'_, [f64]> {
        if self.balance.is_none() || !self.law.is_coulomb() {
            return self.law.bounds(lambda);
        }
        let mut near = lambda.to_vec();
        self.project(&mut near);
        Cow::Owned(self.law.bounds(&near).into_owned())
    }

    /// The projection on Λ, or on Λₑ where bodies can move as a whole.
    pub fn project(&self, lambda: &mut Vec<f64>) {
        self.law.project::<D>(lambda, self.balance.as_deref());
    }

    /// Moves to λ = `target`, and r with it: one product, or none if it is there already but for rounding.
    pub fn move_to(&mut self, point: &mut Point, target: Vec<f64>) -> Result<bool, DualError> {
        let jump: Vec<f64> = (target.iter().zip(&point.lambda))
            .map(|(t, l)| t - l)
            .collect();
        let rounding = ROUNDING * norm_max(&target);
        point.lambda = target;
        if jump.iter().all(|v| v.abs() <= rounding) {
            return Ok(false);
        }
        if !self.products.carry(&jump, &mut point.r)? {
            self.refresh(point)?;
        }
        Ok(true)
    }

    /// r at a point made afresh, where it is not exact anyhow, and α settled for it: how much circles curve, and what is
    /// predicted next, follows from r with the motion of bodies in it.
    pub fn refresh(&mut self, point: &mut Point) -> Result<(), DualError> {
        if self.products.are_exact() {
            return Ok(());
        }
        point.motion.fill(0.0);
        let probe = point.clone();
        let Point { lambda, r, .. } = point;
        let g = self.bounds(&probe.lambda).into_owned();
        let (rho, balance) = (self.rho, self.balance.clone());
        let made = (self.products).refresh(lambda, r, |r| {
            let mut there = Point {
                r: r.to_vec(),
                ..probe.clone()
            };
            let end = settle::<D>(&mut there, rho, &g, balance.as_deref());
            distance(&there.lambda, &end) / rho
        })?;
        if !made {
            // A GPU has failed in between and products are exact from now on, but nothing known so far is.
            self.make_exact(point)?;
            self.products.n_a += 1;
        }
        if self.balance.is_some() {
            self.settle(point, self.rho);
        }
        Ok(())
    }

    /// r at a point from its displacement.
    pub fn make_exact(&mut self, point: &mut Point) -> Result<(), DualError> {
        let u = self.displacement(point, EXACT, self.products.stop)?;
        self.take_from(&u, point);
        Ok(())
    }

    /// Replaces r by what the displacement says: c − Bu.
    pub fn take_from(&mut self, u: &[f64], point: &mut Point) {
        let problem = self.problem;
        let (rn, rt) = point.r.split_at_mut(problem.m());
        problem.normal().mul(u, rn);
        problem.tangential().mul(u, rt);
        for (r, c) in point.r.iter_mut().zip(problem.offsets()) {
            *r = c - *r;
        }
        self.products.dual.times(&mut point.r);
        self.products.checked(&point.r);
        point.motion.fill(0.0);
    }

    /// λ and r in the units of the problem.
    pub fn unscaled(&self, point: &Point) -> (Vec<f64>, Vec<f64>) {
        let (mut lambda, mut r) = (point.lambda.clone(), point.r.clone());
        self.products.dual.times(&mut lambda);
        self.products.dual.divide(&mut r);
        (lambda, r)
    }
}
