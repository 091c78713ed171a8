//! CGM of Step 3.3.

use super::face::Face;
use super::newton::Newton;
use super::point::Point;
use super::subspace::Subspace;
use crate::dual::{DualError, DualOperator};
use crate::sparse::{dot, norm};

/// The conjugate gradient iteration on a face, kept from one outer step to the next.
pub(super) struct Cg {
    pub face: Face,
    /// Known directions that the face allows: recycled ones, then those of this iteration.
    span: Subspace,
}

impl Cg {
    /// Starts from the minimum over the known directions that the face allows.
    pub fn on(face: Face, known: &Subspace, point: &mut Point) -> Self {
        let span = known.fitting(&face);
        span.minimise(&mut point.lambda, &mut point.r);
        Self { face, span }
    }
}

impl<D: DualOperator + ?Sized> Newton<'_, D> {
    /// CGM(A, b, 𝒜, λ, tol): minimises q over the free multipliers until ‖r‖ there is at most `target`
    /// or `enough` says so; returns the number of iterations.
    ///
    /// Each direction is the residual made conjugate to all known directions, not only to the last one:
    /// the same iterates in exact arithmetic, and the recycled directions stay minimised.
    pub fn cg(
        &mut self,
        point: &mut Point,
        cg: &mut Cg,
        target: f64,
        enough: impl Fn(&Self, &Point, f64) -> bool,
    ) -> Result<usize, DualError> {
        let mut image = vec![0.0; point.lambda.len()];
        let limit = 2 * cg.face.sets.n_free() + 50;
        let (mut inner, mut first) = (0, None);
        // Of the last iteration; before the first, what a well-conditioned A would give.
        let mut step = 2.0 / self.products.sigma;
        while inner < limit && self.products.stop.now().is_none() {
            // Where images are not exact, what the last step has left in the span is taken out again.
            if inner > 0 && !self.products.are_exact() {
                cg.span.minimise(&mut point.lambda, &mut point.r);
            }
            let mut p: Vec<f64> = point.r.iter().map(|r| -r).collect();
            cg.face.direction(&mut p);
            let residual = norm(&p);
            first.get_or_insert(residual);
            let rest = || p.iter().map(|v| -v).collect();
            let earlier = first.filter(|_| inner > 0);
            if self.ends(point, rest, residual, earlier, target, &enough) {
                break;
            }
            cg.span.make_conjugate(&mut p, None);
            self.products.apply(&p, &mut image, step, residual)?;
            let curvature = dot(&p, &image);
            if !(curvature > 0.0) {
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
            cg.span.push(p, image.iter().map(|v| v * scale).collect());
        }
        Ok(inner)
    }
}
