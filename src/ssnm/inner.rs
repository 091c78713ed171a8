//! The inner problem (11): Steps 3.2 and 3.3, by conjugate gradients or, under Coulomb's law, conjugate residuals.

use super::face::Face;
use super::gcr::Gcr;
use super::goal;
use super::newton::Newton;
use super::point::Point;
use super::sets::Sets;
use super::subspace::Subspace;
use crate::dual::{DualError, DualOperator};

/// An iteration with inexact products ends where its residual has grown by this factor.
const GROWN: f64 = 10.0;

/// The iteration that solves the inner problem on a face, kept from one outer step to the next.
pub(super) struct Inner<const D: usize> {
    pub face: Face<D>,
    span: Span,
}

/// What it knows.
enum Span {
    /// Directions that the face allows: recycled ones, then those of this iteration.
    Cg(Subspace),
    /// Under Coulomb's law.
    Gcr(Gcr),
}

impl<const D: usize> Inner<D> {
    /// The sets that it is for.
    pub fn sets(&self) -> &Sets<D> {
        &self.face.sets
    }

    /// Whether it can be continued where the next step has the same sets: circles are linearised anew at each.
    pub fn can_go_on(&self) -> bool {
        !self.face.is_curved()
    }
}

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// Starts an iteration on a face, from the best that the known directions allow.
    pub fn inner_on(
        &mut self,
        mut face: Face<D>,
        point: &mut Point,
    ) -> Result<Inner<D>, DualError> {
        self.linearise(&mut face, None, point)?;
        Ok(self.inner_with(face, &self.products.known, point))
    }

    /// The same on a smaller face than the last one, from the best of what that one knew.
    pub fn inner_after(
        &mut self,
        last: Inner<D>,
        mut face: Face<D>,
        point: &mut Point,
    ) -> Result<Inner<D>, DualError> {
        // Earlier directions rarely fit the tangents of circles, and those of the last face nearly all do.
        if !face.sets.turn() {
            return self.inner_on(face, point);
        }
        self.linearise(&mut face, Some(&last.face), point)?;
        let known = match last.span {
            Span::Cg(span) => span.straightened(&last.face),
            Span::Gcr(_) => self.products.known.clone(),
        };
        Ok(self.inner_with(face, &known, point))
    }

    /// Linearises the circles of a face at a point on it, but for those that `earlier` has linearised.
    fn linearise(
        &mut self,
        face: &mut Face<D>,
        earlier: Option<&Face<D>>,
        point: &Point,
    ) -> Result<(), DualError> {
        if face.sets.turn() {
            let mean = self.products.mean(point.lambda.len())?;
            face.set_curvature(earlier, point, mean);
        }
        Ok(())
    }

    fn inner_with(&self, face: Face<D>, known: &Subspace, point: &mut Point) -> Inner<D> {
        let span = if self.law.is_coulomb() {
            Span::Gcr(Gcr::on(&face, known, self.products.sigma))
        } else {
            let span = known.fitting(&face);
            face.curve_gradient(point);
            span.minimise(&mut point.lambda, &mut point.r);
            face.straighten_gradient(point);
            Span::Cg(span)
        };
        Inner { face, span }
    }

    /// Lowers the residual on the free multipliers to `target`, or until `enough` says so; returns the number of
    /// iterations.
    pub fn solve_inner(
        &mut self,
        point: &mut Point,
        inner: &mut Inner<D>,
        target: f64,
        enough: impl Fn(&Self, &Point, f64) -> bool,
    ) -> Result<usize, DualError> {
        let Inner { face, span } = inner;
        // On the way r is the gradient of the model.
        let enough = |newton: &Self, point: &Point, residual: f64| {
            let mut point = point.clone();
            face.straighten_gradient(&mut point);
            enough(newton, &point, residual)
        };
        face.curve_gradient(point);
        let iterations = match span {
            Span::Cg(span) => self.cg(point, face, span, target, &enough),
            Span::Gcr(gcr) => self.gcr(point, face, gcr, target, &enough),
        }?;
        face.straighten_gradient(point);
        Ok(iterations)
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
