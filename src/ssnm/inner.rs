//! The inner problem (11): Step 3.3, by conjugate gradients or, under Coulomb's law, conjugate residuals.

use super::face::Face;
use super::newton::{FLAT, Newton};
use super::point::Point;
use crate::dual::{DualError, DualOperator};
use crate::sparse::{add_times, dot, norm};

/// An image whose part outside the span of earlier ones is smaller than this adds nothing but rounding.
const INDEPENDENT: f64 = 1e-8;
/// A direction along which the residual falls by less than this part has nothing to add but its image.
const FRUITLESS: f64 = 1e-3;

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// Lowers the residual on the free multipliers of a face to `target`; returns the number of iterations.
    pub fn solve_inner(
        &mut self,
        point: &mut Point,
        mut face: Face<D>,
        target: f64,
    ) -> Result<usize, DualError> {
        face.set_curvature(point, self.mean);
        if self.law.is_coulomb() {
            self.gcr(point, &face, target)
        } else {
            self.cg(point, &face, target)
        }
    }

    /// No iteration ends later: what exact arithmetic would need, and something for rounding.
    fn most_iterations(face: &Face<D>) -> usize {
        2 * face.sets.n_free() + 50
    }

    /// CGM(A, b, 𝒜, λ, tol): minimises q over the free multipliers until ‖r‖ there is at most `target`. Where circles curve,
    /// A is A + diag κ, and the residual is preconditioned.
    fn cg(&mut self, point: &mut Point, face: &Face<D>, target: f64) -> Result<usize, DualError> {
        let mut p = vec![0.0; point.lambda.len()];
        let (mut iterations, mut before) = (0, f64::INFINITY);
        // On the way r is the gradient of the model: at the λ where circles are linearised the two are the same.
        let mut r = point.r.clone();
        while iterations < Self::most_iterations(face) && self.products.stop.now().is_none() {
            let mut rest: Vec<f64> = r.iter().map(|r| -r).collect();
            face.direction(&mut rest);
            if norm(&rest) <= target {
                break;
            }
            let mut z = rest.clone();
            face.precondition(&mut z);
            let rz = dot(&rest, &z);
            for (p, z) in p.iter_mut().zip(&z) {
                *p = z + rz / before * *p;
            }
            let image = self.products.apply(&p)?;
            let mut curved = image.clone();
            face.curve(&p, &mut curved);
            let curvature = dot(&p, &curved);
            if !(curvature > FLAT * self.sigma * dot(&p, &p)) {
                break;
            }
            iterations += 1;
            let step = rz / curvature;
            add_times(step, &p, &mut point.lambda);
            add_times(step, &image, &mut point.r);
            add_times(step, &curved, &mut r);
            before = rz;
        }
        Ok(iterations)
    }

    /// The same under Coulomb's law, by generalised conjugate residuals (Eisenstat, Elman and Schultz 1983).
    ///
    /// On a node in contact that slips in the direction s the multipliers move together, λτ = sμλν. With F y = (y on the
    /// free multipliers, and y_ν sμ there) a Newton step solves Zᵀ(A F y + r) = 0, Z the free multipliers: as many
    /// equations as unknowns, but not symmetric. GCR makes ‖Zᵀr‖ least over the directions F y tried so far.
    fn gcr(&mut self, point: &mut Point, face: &Face<D>, target: f64) -> Result<usize, DualError> {
        // F y, A F y, that with the curvature of circles, and what of the latter the free multipliers see: the last ones
        // orthonormal.
        let mut span: Vec<[Vec<f64>; 4]> = Vec::new();
        let mut r = point.r.clone();
        let mut stuck = None;
        let mut iterations = 0;
        while iterations < Self::most_iterations(face) && self.products.stop.now().is_none() {
            let mut rest = r.clone();
            face.residual(&mut rest);
            let residual = norm(&rest);
            if residual <= target {
                break;
            }
            // Where the residual does not fall along itself, its image is a direction that has not been tried.
            let mut p: Vec<f64> = match stuck.take() {
                Some(image) => image,
                None => rest.iter().map(|r| -r).collect(),
            };
            face.direction(&mut p);
            face.precondition(&mut p);
            if !(norm(&p) > 0.0) {
                break;
            }
            let image = self.products.apply(&p)?;
            iterations += 1;
            let mut curved = image.clone();
            face.curve(&p, &mut curved);
            let mut seen = curved.clone();
            face.residual(&mut seen);
            let before = norm(&seen);
            let mut new = [p, image, curved, seen];
            for _ in 0..2 {
                for old in &span {
                    let c = dot(&old[3], &new[3]);
                    for (new, old) in new.iter_mut().zip(old) {
                        add_times(-c, old, new);
                    }
                }
            }
            let length = norm(&new[3]);
            // Written so that NaN is refused.
            let is_flat = !(length > FLAT * self.sigma * norm(&new[0]));
            if is_flat || !(length > INDEPENDENT * before && before > 0.0) {
                break;
            }
            for v in new.iter_mut().flatten() {
                *v /= length;
            }
            let step = -dot(&new[3], &r);
            add_times(step, &new[0], &mut point.lambda);
            add_times(step, &new[1], &mut point.r);
            add_times(step, &new[2], &mut r);
            if step.abs() < FRUITLESS * residual {
                stuck = Some(new[3].iter().map(|v| v * residual).collect());
            }
            span.push(new);
        }
        Ok(iterations)
    }
}
