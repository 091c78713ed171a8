//! Step 1, the final check of points that meet it, and the end of a solve.

use super::goal::{Evidence, Goal, rounding};
use super::newton::Newton;
use super::outer::Way;
use super::point::Point;
use super::{EXACT, MET, Status};
use crate::control::Stop;
use crate::dual::{DualError, conditions};
use crate::problem::Kkt;
use crate::sparse::{add_times, dot};

/// What is due at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Verdict {
    /// Another step.
    GoOn,
    /// The final check.
    Check,
    /// An r that rounding affects as little as possible.
    MakeExact,
    /// To judge it again, after its r has been recomputed.
    Refreshed,
    /// Nothing: it is the last one.
    Done(Status),
}

/// The proof of a solution: u, and the optimality conditions against K.
pub(super) struct Certificate {
    pub u: Vec<f64>,
    pub kkt: Kkt,
}

impl<const D: usize> Newton<'_, D> {
    /// Step 1: err ≤ ε err⁰ and, beyond it, pressures as accurate as ε requires, and conditions that hold against K.
    pub fn step_1(&mut self, way: &mut Way<D>, goal: &mut Goal) -> Result<Verdict, DualError> {
        let (local_error, rounding) = (
            self.gauge.local_error(&way.point.lambda),
            self.gauge.rounding(&way.point),
        );
        let tolerance = self.dual.settings.tolerance;
        goal.err = (tolerance * way.err0.max(local_error)).max(rounding);
        if way.err <= goal.err {
            let now = (way.history.len(), self.products.n_a);
            way.first_met.get_or_insert(now);
        }
        // Before u is known, displacements that cancel in B u (gaps of zero that forces keep closed) do not show how large they are.
        let is_unseen =
            way.err <= EXACT * way.err0 && self.gauge.moved.iter().all(|&moved| moved == 0.0);
        let verdict = goal.judge(&Evidence {
            err: way.err,
            accurate: self.meets(goal, &way.point, way.err),
            hidden: !(way.err > rounding) || is_unseen,
            kkt: None,
        });
        match verdict {
            Verdict::Check => self.check(way, goal),
            Verdict::MakeExact => self.below_rounding(way, goal),
            verdict => Ok(verdict),
        }
    }

    /// The final check of a point that meets the goal: u from K⁻¹, and the optimality conditions against K. If they are not yet met,
    /// the goal becomes stricter.
    fn check(&mut self, way: &mut Way<D>, goal: &mut Goal) -> Result<Verdict, DualError> {
        let settings = self.dual.settings;
        let u = self.displacement(&way.point, self.check_accuracy, self.products.stop)?;
        self.take_from(&u, &mut way.point);
        let err = self.gauge.update_error(&mut way.point);
        let certificate = self.certify(&way.point, u)?;
        goal.err = goal.err.max(self.gauge.rounding(&way.point));
        let (lambda, r) = self.unscaled(&way.point);
        let problem = &self.dual.problem;
        let verdict = goal.judge(&Evidence {
            err,
            accurate: goal.forces_met(problem, &lambda, &r, &self.gauge.moved),
            hidden: false,
            kkt: Some(certificate.kkt),
        });
        if verdict != Verdict::Refreshed {
            self.certificate = Some(certificate);
            return Ok(verdict);
        }
        // A missed err came from the accuracy of u: the next check has a better one.
        if err <= goal.err || self.check_accuracy <= EXACT {
            goal.checks += 1;
        }
        goal.tighten(&problem.scales(&certificate.u, &lambda));
        // r is fresh now; if it differs from the one before, products were not accurate enough.
        way.err = self.gauge.update_error(&mut way.point);
        if way.err > goal.err && !self.products.tighten(settings.tolerance) {
            self.refine(way)?;
        }
        // Where a stiff body moves, ‖f‖ says little about the loads of a soft one, and u may be far off.
        let closer = (goal.err / way.err).min(settings.numbers.sharper);
        self.check_accuracy = (closer * self.check_accuracy).max(EXACT);
        Ok(verdict)
    }

    /// The value of an error that is too small to be measured.
    fn below_rounding(&mut self, way: &mut Way<D>, goal: &mut Goal) -> Result<Verdict, DualError> {
        self.refresh_exactly(way)?;
        if way.err > self.gauge.rounding(&way.point) {
            // An error that steps remove and that u brings back again and again is the error of u.
            goal.checks += 1;
            return Ok(match goal.checks > self.dual.settings.numbers.checks {
                true => Verdict::Done(Status::Stagnated),
                false => Verdict::Refreshed,
            });
        }
        if self.meets(goal, &way.point, way.err) {
            return Ok(Verdict::Refreshed);
        }
        // Forces that rounding has left at open nodes vanish after a projected gradient step; no gap shows whether it
        // was made.
        let step = self.gauge.step_from(&way.point, self.gauge.rho());
        let end = Point {
            lambda: step.end,
            ..step.start
        };
        if self.meets(goal, &end, way.err) {
            way.point = end;
            return Ok(Verdict::Refreshed);
        }
        // After unloading they may belong to slip that is only rounding of the earlier motion: zero is as good.
        let mut first = way.first.clone();
        self.make_exact(&mut first)?;
        let err = self.gauge.update_error(&mut first);
        if err <= self.gauge.rounding(&first) && self.meets(goal, &first, err) {
            way.point = first;
            way.err = err;
            return Ok(Verdict::Refreshed);
        }
        if self.refine(way)? || self.blur(way)? {
            return Ok(Verdict::Refreshed);
        }
        // The rounding of one row may hide what others are off.
        Ok(match self.gauge.hides_each_row(&way.point) {
            true => Verdict::Done(Status::Stagnated),
            false => Verdict::GoOn,
        })
    }

    /// Recomputes r and the error from u.
    pub fn refresh_exactly(&mut self, way: &mut Way<D>) -> Result<(), DualError> {
        self.make_exact(&mut way.point)?;
        way.err = self.gauge.update_error(&mut way.point);
        Ok(())
    }

    /// Computes r from a refined u from here on, if K is so badly conditioned that rounding of K⁻¹ hides the accuracy
    /// of the goal. False if there is nothing to gain.
    fn refine(&mut self, way: &mut Way<D>) -> Result<bool, DualError> {
        let refines = self.products.refine();
        if refines {
            self.refresh_exactly(way)?;
        }
        Ok(refines)
    }

    /// Counts the effect of the rounding of forces on the gaps as part of their rounding from here on; false if it did
    /// before.
    ///
    /// Loads and products with K are known to the rounding of their terms. Where K is badly conditioned, B K⁻¹ times
    /// that is more than the rounding of B u. No computation with these data finds smaller gaps, or the forces that
    /// close them. The signs of rounding are arbitrary.
    fn blur(&mut self, way: &mut Way<D>) -> Result<bool, DualError> {
        if !self.gauge.blur.is_empty() {
            return Ok(false);
        }
        let u = self.displacement(&way.point, EXACT, self.products.stop)?;
        let sizes: Vec<f64> = u.iter().map(|u| u.abs()).collect();
        let [_, mut force] = self.products.dual.operator.stiffness_times(&u, &sizes)?;
        for (i, f) in force.iter_mut().enumerate() {
            // The fractional parts of multiples of the golden ratio.
            if (i as f64 * 0.618_033_988_749_895).fract() < 0.5 {
                *f = -*f;
            }
        }
        let problem = &self.dual.problem;
        let floating = problem.floating_bodies();
        let balance = |x: &mut [f64]| {
            let back: Vec<f64> = floating.resultants(x).iter().map(|a| -a).collect();
            floating.add_motion(&back, x);
        };
        balance(&mut force);
        let size = problem.ranks().norm(&force);
        let mut moved = self.products.moved_by(force, size)?;
        balance(&mut moved);
        let mut blur = problem.times(problem.contact_matrix(), &moved);
        blur.iter_mut().for_each(|b| *b = b.abs());
        self.gauge.blur = blur;
        self.refresh_exactly(way)?;
        Ok(true)
    }

    /// Whether a point meets the goal, in the units of the problem.
    fn meets(&self, goal: &Goal, point: &Point, err: f64) -> bool {
        let (lambda, r) = self.unscaled(point);
        goal.met(&self.dual.problem, &lambda, &r, &self.gauge.moved, err)
    }

    /// Whether each force at a point closes less than the rounding of its gap.
    fn bears_nothing(&self, point: &Point) -> bool {
        let (lambda, r) = self.unscaled(point);
        let problem = &self.dual.problem;
        let rounding = rounding(problem, &lambda, &r, &self.gauge.moved);
        let touching = self.dual.settings.numbers.touching;
        let mut each = problem.compliance().iter().zip(&lambda).zip(rounding);
        each.all(|((c, force), rounding)| c * force.abs() <= touching * rounding)
    }

    /// The certificate of a point with this u, up to the motions of floating bodies.
    fn certify(&mut self, point: &Point, mut u: Vec<f64>) -> Result<Certificate, DualError> {
        let whole = self.dual.whole;
        // What nothing resists stays where it is.
        let mut motion = point.motion.clone();
        for way in &self.dual.free {
            add_times(-dot(way, &motion), way, &mut motion);
        }
        (whole.floating_bodies()).add_motion(&motion, &mut u);
        let lambda = self.unscaled(point).0;
        let kkt = conditions(whole, self.products.dual.operator, &u, &lambda)?;
        Ok(Certificate { u, kkt })
    }

    /// The end of a solve: its status, its certificate, and its error relative to its scale.
    pub fn end(
        &mut self,
        way: &mut Way<D>,
        outcome: Result<Status, DualError>,
    ) -> Result<(Status, Certificate, f64), DualError> {
        let status = match outcome {
            Ok(status) => status,
            Err(DualError::Stopped(stopped)) => stopped.into(),
            Err(error) if error.is_stalled() => Status::Stagnated,
            Err(error) => return Err(error),
        };
        let certificate = match self.certificate.take() {
            Some(checked) => checked,
            None => self.last_check(&mut way.point, status)?,
        };
        let (err, gauge) = (self.gauge.update_error(&mut way.point), &self.gauge);
        let scale = way.err0.max(gauge.local_error(&way.point.lambda));
        let err = match err <= gauge.rounding(&way.point) {
            true => 0.0,
            false => err / scale,
        };
        // A point that meets all conditions is a solution, however it was found. After unloading, forces are no more
        // accurate than those before, from which slip is measured: rounding may hide the remaining forces.
        let settings = self.dual.settings;
        if status == Status::Stagnated && certificate.kkt.max() <= MET * settings.tolerance {
            let before = err * scale / scale.max(gauge.local_error(&self.dual.before));
            let mut goal = Goal::new(settings);
            goal.by_start = true;
            let (lambda, r) = self.unscaled(&way.point);
            let forces = goal.forces_met(&self.dual.problem, &lambda, &r, &gauge.moved);
            if before <= settings.tolerance && forces {
                return Ok((Status::Converged, certificate, err));
            }
            // Where nothing has to be carried, as by bodies that expand freely, forces and gaps are rounding: that of loads, too.
            let is_blurred = !self.gauge.blur.is_empty() || matches!(self.blur(way), Ok(true));
            if is_blurred
                && way.err <= self.gauge.rounding(&way.point)
                && self.bears_nothing(&way.point)
            {
                return Ok((Status::Converged, certificate, 0.0));
            }
        }
        Ok((status, certificate, err))
    }

    /// The certificate of a point that has not passed the final check. After an interrupt no more accuracy than ε is computed.
    fn last_check(&mut self, point: &mut Point, status: Status) -> Result<Certificate, DualError> {
        let none = Stop::default();
        let u = match self.displacement(point, self.dual.settings.tolerance, none) {
            Err(error) if error.is_stalled() => self.displacement(point, f64::INFINITY, none)?,
            made => made?,
        };
        if status == Status::Stagnated {
            self.take_from(&u, point);
            self.gauge.update_error(point);
        }
        self.certify(point, u)
    }
}
