//! The outer steps of Algorithms SSNM and ISSNM as printed, and the projected gradient step.

use super::check::Ended;
use super::face::Face;
use super::goal::Goal;
use super::newton::{Newton, Way};
use super::point::{GradientStep, Point};
use super::safeguard::{Plan, Safeguard};
use super::sets::Sets;
use super::{EXACT, Method, NewtonSettings, Status, Step};
use crate::dual::DualError;
use std::ops::ControlFlow;

impl<const D: usize> Newton<'_, D> {
    /// Algorithms ISSNM and SSNM: outer steps until a point that meets the goal passes the final check, or a reason to
    /// stop.
    pub fn run_as_printed(
        &mut self,
        way: &mut Way<D>,
        settings: &NewtonSettings,
        observer: &mut dyn FnMut(&Step) -> ControlFlow<()>,
    ) -> Result<Status, DualError> {
        way.err = self.update_error(&mut way.point);
        // So that Step 3.1 starts from r_tol.
        let mut tol = settings.r_tol / settings.c_fact;
        let mut goal = Goal::new(self.tolerance, self.numbers);
        let mut safeguard = Safeguard::new(self, way);
        loop {
            // Step 1.
            match self.step_1(way, &mut goal)? {
                Ended::With(status) => return Ok(status),
                Ended::Again => {
                    way.inner = None;
                    safeguard.go_on_from(&way.point, way.err);
                    continue;
                }
                Ended::NotYet => {}
            }
            if let Some(status) = self.limit(way, settings) {
                way.point.clone_from(safeguard.best());
                return Ok(status);
            }
            // Step 3.1.
            tol = (settings.r_tol * way.err / way.err0).min(settings.c_fact * tol);
            let target = match self.method {
                Method::Exact => EXACT * way.err0,
                _ => tol * way.err0,
            };
            // Steps 2, 3.2 and 3.3, or their replacement by the safeguard.
            let plan = safeguard.plan();
            let made = match plan {
                Plan::Newton { rho } => self.newton_step(way, rho, target),
                Plan::Gradient => {
                    way.inner = None;
                    self.safeguarded_step(&mut way.point, target)
                }
            };
            let (sets, inner) = match made {
                Ok(made) => made,
                Err(error) => {
                    // In the middle of a step the point need not be feasible.
                    way.point.clone_from(safeguard.best());
                    return Err(error);
                }
            };
            // Step 3.4.
            way.err = self.update_error(&mut way.point);
            let made = Step {
                iter: way.history.len() + 1,
                inner,
                n_a: self.products.n_a,
                err: way.err / way.err0,
                predicted: None,
                sets: sets.sizes_in(self.problem),
                changes: (way.sets.as_ref()).map_or(0, |old| old.differences(&sets)),
                safeguarded: plan == Plan::Gradient,
            };
            way.history.push(made);
            way.sets = Some(sets);
            let stopped = observer(&made).is_break();
            if let Some(status) = self.judge(&mut safeguard, way, stopped)? {
                return Ok(status);
            }
        }
    }

    /// Steps 2 and 3 of the paper, to a residual of `target`, then P_Λ; returns the sets and the number of inner iterations.
    fn newton_step(
        &mut self,
        way: &mut Way<D>,
        rho: f64,
        target: f64,
    ) -> Result<(Sets<D>, usize), DualError> {
        let point = &mut way.point;
        // Step 2.
        let GradientStep { end, start } = self.step_from(point, rho);
        *point = start;
        let sets = match way.inner.take() {
            Some(inner) => self.predict(&inner, rho),
            None => self.predict(point, rho),
        };
        // Step 3.2: inactive multipliers on their bounds.
        let mut start = point.lambda.clone();
        sets.set_bounds(&mut start, &self.law);
        let face = Face::new(sets.clone(), &self.law, self.balance.as_ref());
        if !face.balance(&mut start) {
            start = end;
        }
        self.move_to(point, start)?;
        // Step 3.3.
        let iterations = self.solve_inner(point, face, target)?;
        // Step 3.4 takes the error at a point of Λ, and the next step continues from there. But a multiplier that the
        // inner problem has moved beyond its bound leaves its set, whatever r is at the projection. (The extensions to
        // the paper, balance and Coulomb's law, use feasible forces.)
        if self.balance.is_none() && !self.law.is_coulomb() {
            way.inner = Some(point.clone());
        }
        self.move_into(point)?;
        self.refresh(point, 0.0)?;
        Ok((sets, iterations))
    }

    /// P_Λ(λ).
    fn move_into(&mut self, point: &mut Point) -> Result<(), DualError> {
        let mut target = point.lambda.clone();
        self.project(&mut target);
        self.move_to(point, target)
    }

    /// The predicted sets for ρ, with α unchanged. Under Coulomb's law a node without force is bounded by its predicted
    /// force, and a node predicted to separate bears no friction.
    fn predict(&self, point: &Point, rho: f64) -> Sets<D> {
        let Point { lambda, r, .. } = point;
        let mut g = self.bounds(lambda);
        for (i, g) in g.iter_mut().enumerate() {
            if *g == 0.0 {
                *g = self.law.of(i).disc(lambda[i] - rho * r[i]).g;
            }
        }
        let mut sets = Sets::predict(lambda, r, rho, &g);
        sets.hold_separated(&self.law);
        sets
    }

    /// A step that lowers q: projected gradient, then towards the minimum over the resulting face of Λ, while q falls
    /// on the way to its projection.
    fn safeguarded_step(
        &mut self,
        point: &mut Point,
        target: f64,
    ) -> Result<(Sets<D>, usize), DualError> {
        self.gradient_step(point)?;
        *point = self.step_from(point, self.gradient_length()).start;
        let sets = Sets::binding(&point.lambda, &point.r, &self.law.bounds(&point.lambda));
        let face = Face::new(sets.clone(), &self.law, self.balance.as_ref());
        let mut end = point.clone();
        let inner = self.solve_inner(&mut end, face, target)?;
        self.move_into(&mut end)?;
        self.refresh(&mut end, 0.0)?;
        let err = self.error(point);
        *point = point.towards(&end, self.part_towards(point, &end, err));
        Ok((sets, inner))
    }

    /// A projected gradient step of length 1/σ_max.
    fn gradient_step(&mut self, point: &mut Point) -> Result<(), DualError> {
        let start = point.clone();
        loop {
            let step = self.step_from(&start, self.gradient_length());
            *point = step.start;
            self.move_to(point, step.end)?;
            // Written so that NaN ends it, like a step that has become rounding.
            if !(start.q_change(point) > start.q_rounding(point)) {
                break;
            }
            // σ_max was underestimated.
            self.sigma *= 2.0;
        }
        self.refresh(point, 0.0)
    }
}
