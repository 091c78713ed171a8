//! The state that all outer steps share: the products so far, what they tell, and how r follows λ.

use super::check::Certificate;
use super::dual_problem::DualProblem;
use super::gauge::Gauge;
use super::known::Known;
use super::point::Point;
use super::products::Products;
use super::surrogate::Surrogate;
use super::{EXACT, Method};
use crate::control::Stop;
use crate::dual::DualError;
use crate::rounding::{DEPENDENT, ROUNDING};
use crate::sparse::{add_times, difference, norm_max};

pub(super) struct Newton<'a, const D: usize> {
    /// What is solved, and the measure of its points.
    pub dual: &'a DualProblem<'a, D>,
    pub gauge: Gauge<'a, D>,
    pub products: Products<'a>,
    /// The known pairs of A.
    pub surrogate: Surrogate,
    /// Pairs hidden by errors of products, since products were last made more accurate.
    pub hidden: usize,
    /// A itself, if it is available as a matrix.
    pub known: Option<Known<D>>,
    /// The typical entry of diag(A).
    pub mean: f64,
    /// That of the last final check.
    pub certificate: Option<Certificate>,
    /// ‖f − Bᵀλ − Ku‖ relative to the acting forces in the final check.
    pub check_accuracy: f64,
}

impl<const D: usize> Newton<'_, D> {
    /// Moves to λ = `target`, and r with it: one product for the unknown part of the step, or none.
    pub fn move_to(&mut self, point: &mut Point, target: Vec<f64>) -> Result<(), DualError> {
        let mut jump = difference(&target, &point.lambda);
        let rounding = ROUNDING * norm_max(&target);
        point.lambda = target;
        if jump.iter().all(|v| v.abs() <= rounding) {
            return Ok(());
        }
        add_times(1.0, &self.surrogate.split(&mut jump), &mut point.r);
        if jump.iter().any(|v| v.abs() > rounding) {
            let image = self.products.apply(&jump)?;
            add_times(1.0, &image, &mut point.r);
            if self.dual.settings.method == Method::Multisecant {
                self.learn(&jump, &image);
            }
        }
        Ok(())
    }

    /// Takes a pair (v, Av) into the surrogate, and updates the estimate of σ_max.
    pub fn learn(&mut self, direction: &[f64], image: &[f64]) {
        let flat = DEPENDENT * self.surrogate.largest();
        let clear = (self.surrogate).add(direction, image, self.products.part(), flat);
        self.hidden += usize::from(!clear);
        self.gauge.sigma = self.surrogate.largest();
    }

    /// Recomputes r at a point where it is not updated, as accurately as the error there requires; λ has moved by `along`
    /// times the last product's direction. If the error turns out much smaller than expected, it is computed once more.
    pub fn refresh(&mut self, point: &mut Point, along: f64) -> Result<(), DualError> {
        for along in [along, 0.0] {
            if self.products.are_exact() {
                return Ok(());
            }
            let err = self.gauge.error(point);
            let expected = self.dual.without_motion(point);
            let made = (self.products).afresh(&point.lambda, along, err, &expected)?;
            let Some(r) = made else {
                // A GPU has failed in the meantime: none of the data so far is exact.
                return self.make_exact(point);
            };
            point.r = r;
            if let Some(forces) = self.dual.spread(&point.motion) {
                add_times(-1.0, &forces, &mut point.r);
            }
            let err = self.gauge.error(point);
            if self.products.is_enough(err) {
                return Ok(());
            }
        }
        Ok(())
    }

    /// r at a point from its displacement.
    pub fn make_exact(&mut self, point: &mut Point) -> Result<(), DualError> {
        let u = self.displacement(point, EXACT, self.products.stop)?;
        self.take_from(&u, point);
        Ok(())
    }

    /// Replaces r by c − Bu.
    pub fn take_from(&mut self, u: &[f64], point: &mut Point) {
        let (problem, gauge) = (&self.dual.problem, &mut self.gauge);
        gauge.moved = problem.row_sizes(&problem.body_sizes(u));
        let blurred = gauge.moved.iter_mut().zip(&gauge.blur);
        blurred.for_each(|(moved, blur)| *moved = moved.max(*blur));
        let (rn, rt) = point.r.split_at_mut(problem.m());
        rn.copy_from_slice(&problem.times(problem.normal(), u));
        rt.copy_from_slice(&problem.times(problem.tangential(), u));
        let offsets = problem.load_case().offsets();
        let lambda = self.products.dual.unscaled(&point.lambda);
        (self.products.dual).finish_gradient(&offsets, &lambda, &mut point.r);
        point.motion.fill(0.0);
    }

    /// u at a point, up to the motions of floating bodies, to a residual relative to the acting forces.
    pub fn displacement(
        &mut self,
        point: &Point,
        accuracy: f64,
        stop: Stop,
    ) -> Result<Vec<f64>, DualError> {
        let problem = &self.dual.problem;
        let residual = accuracy * problem.acting_forces(&self.unscaled(point).0);
        let mut u = if residual == 0.0 {
            // Neither load nor contact forces.
            vec![0.0; problem.load().len()]
        } else {
            (self.products).displacement(&point.lambda, residual, &stop)?
        };
        // Whatever K⁺ was, bodies stay in place if contact allows it.
        let floating = problem.floating_bodies();
        let place = |j: usize| self.dual.place.map_or(0.0, |place| place[j]);
        let now = floating.resultants(&u);
        let back: Vec<f64> = (0..now.len()).map(|j| place(j) - now[j]).collect();
        floating.add_motion(&back, &mut u);
        Ok(u)
    }

    /// λ and r in the units of the problem.
    pub fn unscaled(&self, point: &Point) -> (Vec<f64>, Vec<f64>) {
        let mut r = point.r.clone();
        self.products.dual.divide(&mut r);
        (self.products.dual.unscaled(&point.lambda), r)
    }
}
