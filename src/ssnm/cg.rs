//! CGM of Step 3.3.

use super::face::Face;
use super::newton::Newton;
use super::point::Point;
use super::subspace::Subspace;
use crate::dual::{DualError, DualOperator};
use crate::sparse::{dot, norm};

/// A direction along which A curves q by less than this part of its largest eigenvalue is one that moves no forces, but
/// for rounding: where rows of B depend on each other.
pub(super) const FLAT: f64 = 1e-12;

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// CGM(A, b, 𝒜, λ, tol): minimises q over the free multipliers until ‖r‖ there is at most `target`
    /// or `enough` says so; returns the number of iterations.
    ///
    /// Each direction is the residual made conjugate to all known directions, not only to the last one:
    /// the same iterates in exact arithmetic, and the recycled directions stay minimised. r is the gradient of the
    /// model of the face, A + diag κ, which the residual is preconditioned by where circles curve.
    pub fn cg(
        &mut self,
        point: &mut Point,
        face: &Face<D>,
        span: &mut Subspace,
        target: f64,
        enough: &impl Fn(&Self, &Point, f64) -> bool,
    ) -> Result<usize, DualError> {
        let mut image = vec![0.0; point.lambda.len()];
        let limit = 2 * face.sets.n_free() + 50;
        let (mut inner, mut first) = (0, None);
        // Of the last iteration; before the first, what a well-conditioned A would give.
        let mut step = 2.0 / self.products.sigma;
        while inner < limit && self.products.stop.now().is_none() {
            // Where images are not exact, what the last step has left in the span is taken out again.
            if inner > 0 && !self.products.are_exact() {
                span.minimise(&mut point.lambda, &mut point.r);
            }
            let mut p: Vec<f64> = point.r.iter().map(|r| -r).collect();
            face.direction(&mut p);
            let residual = norm(&p);
            first.get_or_insert(residual);
            let rest = || p.iter().map(|v| -v).collect();
            let earlier = first.filter(|_| inner > 0);
            if self.ends(point, rest, residual, earlier, target, enough) {
                break;
            }
            face.precondition(&mut p);
            span.make_conjugate(&mut p, None);
            self.products.apply(&p, &mut image, step, residual)?;
            face.curve(&p, &mut image);
            let curvature = dot(&p, &image);
            if !(curvature > FLAT * self.products.sigma * dot(&p, &p)) {
                break;
            }
            inner += 1;
            step = -dot(&p, &point.r) / curvature;
            for i in 0..image.len() {
                point.lambda[i] += step * p[i];
                point.r[i] += step * image[i];
            }
            let scale = 1.0 / curvature.sqrt();
            p.iter_mut().for_each(|v| *v *= scale);
            span.push(p, image.iter().map(|v| v * scale).collect());
        }
        Ok(inner)
    }
}
