//! Step 1, the final check of points that meet it, and the end of a solve.

use super::goal::Goal;
use super::newton::{Newton, Way};
use super::point::Point;
use super::{EXACT, MET, NewtonSettings, Status};
use crate::control::Stop;
use crate::dual::{DualError, DualOperator, conditions};
use crate::problem::Kkt;

/// The outcome of Step 1 at a point.
pub(super) enum Ended {
    /// It is the last one.
    With(Status),
    /// Its r has been recomputed: it has to be checked again.
    Again,
    /// Another step is due.
    NotYet,
}

/// The end of a solve, and its error relative to its scale.
pub(super) struct End {
    pub status: Status,
    pub u: Vec<f64>,
    pub kkt: Kkt,
    pub err_relative: f64,
}

impl<const D: usize> Newton<'_, D> {
    /// Step 1: err ≤ ε err⁰ and, beyond it, pressures as accurate as ε requires, and conditions that hold against K.
    pub fn step_1(&mut self, way: &mut Way<D>, goal: &mut Goal) -> Result<Ended, DualError> {
        let local_error = self.local_error(&way.point.lambda);
        let rounding = self.rounding(&way.point);
        goal.err = (self.tolerance * way.err0.max(local_error)).max(rounding);
        if way.err <= goal.err {
            let now = (way.history.len(), self.products.n_a);
            way.first_met.get_or_insert(now);
        }
        if !self.meets(goal, &way.point, way.err) {
            return self.below_rounding(way, goal);
        }
        if let Some(status) = self.verify(&mut way.point, goal)? {
            return Ok(Ended::With(status));
        }
        // r is fresh now; if it differs from the one before, products were not accurate enough.
        way.err = self.update_error(&mut way.point);
        if way.err > goal.err && !self.products.tighten(self.tolerance) {
            self.refine(way)?;
        }
        // Where a stiff body moves, ‖f‖ says little about the loads of a soft one, and u may be far off.
        let closer = (goal.err / way.err).min(self.numbers.sharper);
        self.check_accuracy = (closer * self.check_accuracy).max(EXACT);
        Ok(Ended::Again)
    }

    /// The value of an error that is too small to be measured.
    fn below_rounding(&mut self, way: &mut Way<D>, goal: &mut Goal) -> Result<Ended, DualError> {
        // Before u is known, displacements that cancel in B u (gaps of zero that forces keep closed) do not show how large they are.
        let unseen = way.err <= EXACT * way.err0 && self.moved.iter().all(|&moved| moved == 0.0);
        if way.err > self.rounding(&way.point) && !unseen {
            return Ok(Ended::NotYet);
        }
        self.make_exact(&mut way.point)?;
        way.err = self.update_error(&mut way.point);
        if way.err > self.rounding(&way.point) {
            // An error that steps remove and that u brings back again and again is the error of u.
            goal.checks += 1;
            return Ok(match goal.checks > self.numbers.checks {
                true => Ended::With(Status::Stagnated),
                false => Ended::Again,
            });
        }
        if self.meets(goal, &way.point, way.err) {
            return Ok(Ended::Again);
        }
        // Forces that rounding has left at open nodes vanish after a projected gradient step; no gap shows whether it
        // was made.
        let step = self.step_from(&way.point, self.rho());
        let end = Point {
            lambda: step.end,
            ..step.start
        };
        if self.meets(goal, &end, way.err) {
            way.point = end;
            return Ok(Ended::Again);
        }
        // After unloading they may belong to slip that is only rounding of the earlier motion: zero is as good.
        let mut first = way.first.clone();
        self.make_exact(&mut first)?;
        let err = self.update_error(&mut first);
        if err <= self.rounding(&first) && self.meets(goal, &first, err) {
            way.point = first;
            way.err = err;
            return Ok(Ended::Again);
        }
        Ok(match self.refine(way)? || self.blur(way)? {
            true => Ended::Again,
            false => Ended::With(Status::Stagnated),
        })
    }

    /// Computes r from a refined u from here on, if K is so badly conditioned that rounding of K⁻¹ hides the accuracy
    /// of the goal. False if there is nothing to gain.
    fn refine(&mut self, way: &mut Way<D>) -> Result<bool, DualError> {
        if !self.products.refine() {
            return Ok(false);
        }
        self.make_exact(&mut way.point)?;
        way.err = self.update_error(&mut way.point);
        Ok(true)
    }

    /// Counts the effect of the rounding of forces on the gaps as part of their rounding from here on; false if it did
    /// before.
    ///
    /// Loads and products with K are known to the rounding of their terms. Where K is badly conditioned, B K⁻¹ times
    /// that is more than the rounding of B u. No computation with these data finds smaller gaps, or the forces that
    /// close them. The signs of rounding are arbitrary.
    fn blur(&mut self, way: &mut Way<D>) -> Result<bool, DualError> {
        if !self.blur.is_empty() {
            return Ok(false);
        }
        let u = self.displacement(&way.point, EXACT, self.products.stop)?;
        let sizes: Vec<f64> = u.iter().map(|u| u.abs()).collect();
        let [_, mut force] = self.products.dual.stiffness_times(&u, &sizes)?;
        for (i, f) in force.iter_mut().enumerate() {
            // The fractional parts of multiples of the golden ratio.
            if (i as f64 * 0.618_033_988_749_895).fract() < 0.5 {
                *f = -*f;
            }
        }
        let floating = self.problem.floating_bodies();
        let balance = |x: &mut [f64]| {
            let back: Vec<f64> = floating.resultants(x).iter().map(|a| -a).collect();
            floating.add_motion(&back, x);
        };
        balance(&mut force);
        let size = self.problem.ranks().norm(&force);
        let mut moved = self.products.moved_by(force, size)?;
        balance(&mut moved);
        self.blur = self.problem.times(self.problem.contact_matrix(), &moved);
        self.blur.iter_mut().for_each(|b| *b = b.abs());
        self.make_exact(&mut way.point)?;
        way.err = self.update_error(&mut way.point);
        Ok(true)
    }

    /// The reason not to make another step.
    pub fn limit(&self, way: &Way<D>, settings: &NewtonSettings) -> Option<Status> {
        let steps =
            (way.history.len() >= settings.max_iterations).then_some(Status::IterationLimit);
        self.products.stop.now().map(Status::from).or(steps)
    }

    /// Whether a point meets the goal, in the units of the problem.
    fn meets(&self, goal: &Goal, point: &Point, err: f64) -> bool {
        let (lambda, r) = self.unscaled(point);
        goal.met(self.problem, &lambda, &r, &self.moved, err)
    }

    /// The final check of a point that meets the goal: u from K⁻¹, and the optimality conditions against K.
    ///
    /// None, with a stricter goal and a recomputed r, if they are not yet met.
    fn verify(&mut self, point: &mut Point, goal: &mut Goal) -> Result<Option<Status>, DualError> {
        let tolerance = self.tolerance;
        let mut u = self.displacement(point, self.check_accuracy, self.products.stop)?;
        self.take_from(&u, point);
        let err = self.update_error(point);
        self.problem
            .floating_bodies()
            .add_motion(&point.motion, &mut u);
        let kkt = self.optimality(point, &u)?;
        goal.err = goal.err.max(self.rounding(point));
        let (lambda, r) = self.unscaled(point);
        let forces = goal.forces_met(self.problem, &lambda, &r, &self.moved);
        // Equilibrium does not depend on λ: no further step can repair it. A goal that was met again and again and
        // still fails the check is at the limit of rounding.
        let status = if err <= goal.err * (1.0 + 1e-6) && forces && kkt.max() <= MET * tolerance {
            Status::Converged
        } else if !(kkt.equilibrium <= MET * tolerance) || goal.checks >= self.numbers.checks {
            Status::Stagnated
        } else {
            // A missed err came from the accuracy of u: the next check has a better one.
            if err <= goal.err || self.check_accuracy <= EXACT {
                goal.checks += 1;
            }
            let scales = self.problem.scales(&u, &lambda);
            let part = MET * tolerance;
            goal.slack = part * scales.length;
            goal.work = part * scales.deformation;
            return Ok(None);
        };
        self.checked = Some((u, kkt));
        Ok(Some(status))
    }

    /// u at a point, up to the motions of floating bodies, to a residual relative to the acting forces.
    pub fn displacement(
        &mut self,
        point: &Point,
        accuracy: f64,
        stop: Stop,
    ) -> Result<Vec<f64>, DualError> {
        let mut lambda = point.lambda.clone();
        self.products.dual.times(&mut lambda);
        let residual = accuracy * self.problem.acting_forces(&lambda);
        let mut u = if residual == 0.0 {
            // Neither load nor contact forces.
            vec![0.0; self.problem.load().len()]
        } else {
            (self.products).displacement(&point.lambda, residual, &stop)?
        };
        // Whatever K⁺ was, bodies stay in place if contact allows it.
        let floating = self.problem.floating_bodies();
        let back: Vec<f64> = floating
            .resultants(&u)
            .iter()
            .enumerate()
            .map(|(j, a)| self.place.map_or(0.0, |place| place[j]) - a)
            .collect();
        floating.add_motion(&back, &mut u);
        Ok(u)
    }

    /// The optimality conditions at a point.
    fn optimality(&mut self, point: &Point, u: &[f64]) -> Result<Kkt, DualError> {
        let mut lambda = point.lambda.clone();
        self.products.dual.times(&mut lambda);
        conditions(self.problem, &mut self.products.dual, u, &lambda)
    }

    /// The end of a solve.
    pub fn end(
        &mut self,
        way: &mut Way<D>,
        outcome: Result<Status, DualError>,
    ) -> Result<End, DualError> {
        let (mut status, u, kkt) = self.last_check(&mut way.point, outcome)?;
        let err_relative = self.relative(&mut way.point, way.err0);
        // A point that meets all conditions is a solution, however it was found. After unloading, forces are no more
        // accurate than those before, from which slip is measured: rounding may hide the remaining forces.
        if status == Status::Stagnated && kkt.max() <= MET * self.tolerance {
            let now = way.err0.max(self.local_error(&way.point.lambda));
            let err = err_relative * now / now.max(self.local_error(&self.before));
            let mut goal = Goal::new(self.tolerance, self.numbers);
            goal.by_start = true;
            let (lambda, r) = self.unscaled(&way.point);
            if err <= self.tolerance && goal.forces_met(self.problem, &lambda, &r, &self.moved) {
                status = Status::Converged;
            }
        }
        Ok(End {
            status,
            u,
            kkt,
            err_relative,
        })
    }

    /// The status, with u and the optimality conditions: those of the final check or, without one, those that are
    /// known. After an interrupt no more accuracy than ε is computed.
    fn last_check(
        &mut self,
        point: &mut Point,
        outcome: Result<Status, DualError>,
    ) -> Result<(Status, Vec<f64>, Kkt), DualError> {
        let status = match outcome {
            Ok(status) => {
                if let Some((u, kkt)) = self.checked.take() {
                    return Ok((status, u, kkt));
                }
                status
            }
            Err(DualError::Stopped(stopped)) => stopped.into(),
            Err(error) if error.is_stalled() => Status::Stagnated,
            Err(error) => return Err(error),
        };
        let mut u = match self.displacement(point, self.tolerance, Stop::default()) {
            Err(error) if error.is_stalled() => {
                self.displacement(point, f64::INFINITY, Stop::default())?
            }
            made => made?,
        };
        if status == Status::Stagnated {
            self.take_from(&u, point);
            self.update_error(point);
        }
        (self.problem.floating_bodies()).add_motion(&point.motion, &mut u);
        let kkt = self.optimality(point, &u)?;
        Ok((status, u, kkt))
    }
}
