//! The inner problem under Coulomb's law, by generalised conjugate residuals.
//!
//! On a node in contact that slips in the direction s the multipliers move together, λτ = sμλν. With F y = (y on the
//! free multipliers, and y_ν sμ there) a Newton step solves Zᵀ(A F y + r) = 0, Z the free multipliers: as many
//! equations as unknowns, but not symmetric. GCR (Eisenstat, Elman and Schultz 1983) makes ‖Zᵀr‖ least over the
//! directions F y tried so far; A F y is kept beside each of them, so that r follows for nothing.

use super::cg::FLAT;
use super::face::Face;
use super::newton::Newton;
use super::point::Point;
use super::subspace::{Subspace, subtract};
use crate::dual::{DualError, DualOperator};
use crate::sparse::{dot, norm};

/// An image whose part outside the span of earlier ones is smaller than this adds nothing but rounding.
const INDEPENDENT: f64 = 1e-8;
/// A direction along which the residual falls by less than this part has nothing to add but its image.
const FRUITLESS: f64 = 1e-3;

/// The iteration on a face, kept from one outer step to the next.
pub(super) struct Gcr {
    /// F y, A F y, and Zᵀ A F y: the last ones orthonormal; A with the curvature of circles.
    span: Vec<[Vec<f64>; 3]>,
}

impl Gcr {
    /// Starts with the known directions that the face allows.
    pub fn on<const D: usize>(face: &Face<D>, known: &Subspace, sigma: f64) -> Self {
        let fitting = known.combinations(face);
        let mut gcr = Self { span: Vec::new() };
        for (direction, mut image) in fitting {
            face.curve(&direction, &mut image);
            gcr.add(face, direction, image, sigma);
        }
        gcr
    }

    /// Adds a direction with its image; says whether it adds anything. `sigma`: the largest eigenvalue of A.
    fn add<const D: usize>(
        &mut self,
        face: &Face<D>,
        mut direction: Vec<f64>,
        mut image: Vec<f64>,
        sigma: f64,
    ) -> bool {
        let mut seen = image.clone();
        face.residual(&mut seen);
        let before = norm(&seen);
        for _ in 0..2 {
            for [other, its_image, its_seen] in &self.span {
                let c = dot(its_seen, &seen);
                subtract(c, its_seen, &mut seen);
                subtract(c, other, &mut direction);
                subtract(c, its_image, &mut image);
            }
        }
        let length = norm(&seen);
        // Written so that NaN is refused. With σ = 0 nothing is known of A.
        let is_flat = !(length > FLAT * sigma * norm(&direction));
        if is_flat || !(length > INDEPENDENT * before && before > 0.0) {
            return false;
        }
        for vector in [&mut direction, &mut image, &mut seen] {
            vector.iter_mut().for_each(|v| *v /= length);
        }
        self.span.push([direction, image, seen]);
        true
    }

    /// Makes the residual least along the direction with number k; returns how far that is.
    fn step(&self, k: usize, point: &mut Point) -> f64 {
        let [direction, image, seen] = &self.span[k];
        let step = dot(seen, &point.r);
        subtract(step, direction, &mut point.lambda);
        subtract(step, image, &mut point.r);
        step
    }

    /// Makes the residual least over all that is known.
    pub fn minimise(&self, point: &mut Point) {
        for k in 0..self.span.len() {
            self.step(k, point);
        }
    }
}

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// Lowers the residual on the face to `target`, or until `enough` says so; returns the number of iterations.
    pub fn gcr(
        &mut self,
        point: &mut Point,
        face: &Face<D>,
        gcr: &mut Gcr,
        target: f64,
        enough: &impl Fn(&Self, &Point, f64) -> bool,
    ) -> Result<usize, DualError> {
        let mut image = vec![0.0; point.lambda.len()];
        let limit = 2 * face.sets.n_free() + 50;
        let (mut inner, mut first) = (0, None);
        // Of the last iteration, per length of its direction; before the first, what a well-conditioned A would give.
        let mut step = 2.0 / self.products.sigma;
        let mut stuck = None;
        while inner < limit && self.products.stop.now().is_none() {
            if inner == 0 || !self.products.are_exact() {
                gcr.minimise(point);
            }
            let mut rest = point.r.clone();
            face.residual(&mut rest);
            let residual = norm(&rest);
            first.get_or_insert(residual);
            let earlier = first.filter(|_| inner > 0);
            if self.ends(point, || rest.clone(), residual, earlier, target, enough) {
                break;
            }
            // Where the residual does not fall along itself, its image is a direction that has not been tried.
            let mut p: Vec<f64> = match stuck.take() {
                Some(image) => image,
                None => rest.iter().map(|r| -r).collect(),
            };
            face.direction(&mut p);
            face.precondition(&mut p);
            let size = norm(&p);
            if !(size > 0.0) {
                break;
            }
            self.products.apply(&p, &mut image, step, size)?;
            face.curve(&p, &mut image);
            inner += 1;
            if !gcr.add(face, p, image.clone(), self.products.sigma) {
                break;
            }
            let last = gcr.span.len() - 1;
            let fallen = gcr.step(last, point).abs();
            step = fallen * norm(&gcr.span[last][0]) / size;
            if fallen < FRUITLESS * residual {
                let mut seen = gcr.span[last][2].clone();
                seen.iter_mut().for_each(|v| *v *= residual);
                stuck = Some(seen);
            }
        }
        Ok(inner)
    }
}
