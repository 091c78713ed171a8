//! The inner problem (11): Steps 3.2 and 3.3, by conjugate gradients or, under Coulomb's law, conjugate residuals.

use super::cg::Cg;
use super::face::Face;
use super::gcr::Gcr;
use super::goal;
use super::newton::Newton;
use super::point::Point;
use super::sets::Sets;
use crate::dual::{DualError, DualOperator};

/// An iteration with inexact products ends where its residual has grown by this factor.
const GROWN: f64 = 10.0;

/// The iteration that solves the inner problem.
pub(super) enum Inner {
    Cg(Cg),
    Gcr(Gcr),
}

impl Inner {
    /// The sets that it is for.
    pub fn sets(&self) -> &Sets {
        match self {
            Self::Cg(cg) => &cg.face.sets,
            Self::Gcr(gcr) => &gcr.face.sets,
        }
    }
}

impl<D: DualOperator + ?Sized> Newton<'_, D> {
    /// Starts an iteration on a face, from the best that the known directions allow.
    pub fn inner_on(&self, face: Face, point: &mut Point) -> Inner {
        if self.law.is_coulomb() {
            Inner::Gcr(Gcr::on(face, &self.products.known))
        } else {
            Inner::Cg(Cg::on(face, &self.products.known, point))
        }
    }

    /// Lowers the residual on the free multipliers to `target`, or until `enough` says so; returns the number of
    /// iterations.
    pub fn solve_inner(
        &mut self,
        point: &mut Point,
        inner: &mut Inner,
        target: f64,
        enough: impl Fn(&Self, &Point, f64) -> bool,
    ) -> Result<usize, DualError> {
        match inner {
            Inner::Cg(cg) => self.cg(point, cg, target, enough),
            Inner::Gcr(gcr) => self.gcr(point, gcr, target, enough),
        }
    }

    /// Whether an inner iteration ends at a point: where its `residual` (a vector of that length is `rest`) has met
    /// the target or, after the `first` one, where `enough` says so or nothing more is to be had.
    pub fn ends(
        &mut self,
        point: &Point,
        rest: impl FnOnce() -> Vec<f64>,
        residual: f64,
        first: Option<f64>,
        target: f64,
        enough: &impl Fn(&Self, &Point, f64) -> bool,
    ) -> bool {
        // Where the residual grows, directions that fit only nearly have come to work against each other.
        if first.is_some_and(|first| !(residual <= GROWN * first)) && !self.products.are_exact() {
            self.products.sharpen();
            return true;
        }
        // Below its drift it says nothing.
        (residual <= target && self.is_enough(point, rest(), residual))
            || (first.is_some()
                && (residual <= self.products.drift() || enough(self, point, residual)))
    }

    /// Whether an inner problem that has met its target may end: if it may be the last one, the forces have to be
    /// accurate as well, where another step costs more than another product.
    fn is_enough(&self, point: &Point, rest: Vec<f64>, residual: f64) -> bool {
        if residual > self.goal_err || self.products.are_exact() {
            return true;
        }
        let rest = Point {
            r: rest,
            ..point.clone()
        };
        let (lambda, r) = self.unscaled(&rest);
        goal::inner_forces_met(self.tolerance, self.problem, &lambda, &r)
    }
}
