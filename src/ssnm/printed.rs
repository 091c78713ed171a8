//! The steps of Algorithms SSNM and ISSNM as printed, and the projected gradient step.

use super::face::Face;
use super::law::Merit;
use super::newton::Newton;
use super::outer::{Made, Steps, Way};
use super::point::{GradientStep, Point};
use super::safeguard::{Plan, Safeguard};
use super::sets::Sets;
use super::{EXACT, Method};
use crate::dual::DualError;

/// Steps as printed, with their safeguard.
pub(super) struct AsPrinted<const D: usize> {
    /// tol of Step 3.1.
    tol: f64,
    safeguard: Safeguard<D>,
}

impl<const D: usize> AsPrinted<D> {
    /// Before the first step: Step 3.1 starts from r_tol.
    pub fn new(newton: &Newton<D>) -> Self {
        let settings = newton.dual.settings;
        let (merit, rho) = (newton.dual.law.merit, newton.gauge.rho());
        Self {
            tol: settings.r_tol / settings.c_fact,
            safeguard: Safeguard::new(merit, rho, settings.numbers),
        }
    }
}

impl<const D: usize> Steps<D> for AsPrinted<D> {
    fn make(&mut self, newton: &mut Newton<D>, way: &mut Way<D>) -> Result<Made<D>, DualError> {
        // Step 3.1.
        let settings = newton.dual.settings;
        self.tol = (settings.r_tol * way.err / way.err0).min(settings.c_fact * self.tol);
        let target = match settings.method {
            Method::Exact => EXACT * way.err0,
            _ => self.tol * way.err0,
        };
        // Steps 2, 3.2 and 3.3, or their replacement by the safeguard.
        let plan = self.safeguard.plan();
        let (sets, inner) = match plan {
            Plan::Newton { rho } => newton.newton_step(way, rho, target)?,
            Plan::Gradient => newton.safeguarded_step(way, target)?,
        };
        // Step 3.4.
        way.err = newton.gauge.update_error(&mut way.point);
        let made = Made {
            sets,
            inner,
            predicted: None,
            safeguarded: plan == Plan::Gradient,
        };
        self.safeguard.note(&newton.gauge, way, &made);
        Ok(made)
    }

    fn turn_back(&mut self, newton: &mut Newton<D>, way: &mut Way<D>) -> Result<bool, DualError> {
        if !self.safeguard.discards {
            return Ok(false);
        }
        way.go_back();
        way.inner = None;
        way.err = newton.gauge.update_error(&mut way.point);
        let safeguarded = way.history.last().is_some_and(|step| step.safeguarded);
        // Not even a projected gradient step lowers q or the error.
        if newton.dual.law.merit == Merit::Error || (safeguarded && way.best.fruitless > 0) {
            return Ok(true);
        }
        (way.best.err, way.best.fruitless) = (way.err, 0);
        self.safeguard.act(newton.gauge.gradient_length());
        Ok(false)
    }
}

impl<const D: usize> Newton<'_, D> {
    /// Steps 2 and 3 of the paper, to a residual of `target`, then P_Λ; returns the sets and the number of inner iterations.
    fn newton_step(
        &mut self,
        way: &mut Way<D>,
        rho: f64,
        target: f64,
    ) -> Result<(Sets<D>, usize), DualError> {
        let point = &mut way.point;
        // Step 2.
        let GradientStep { end, start } = self.gauge.step_from(point, rho);
        *point = start;
        let sets = match way.inner.take() {
            Some(inner) => self.predict(&inner, rho),
            None => self.predict(point, rho),
        };
        // Step 3.2: inactive multipliers on their bounds.
        let mut start = point.lambda.clone();
        sets.set_bounds(&mut start, &self.dual.law);
        let face = Face::new(sets.clone(), &self.dual.law, self.dual.balance.as_ref());
        if !face.balance(&mut start) {
            start = end;
        }
        self.move_to(point, start)?;
        // Step 3.3.
        let iterations = self.solve_inner(point, face, target)?;
        // Step 3.4 takes the error at a point of Λ, and the next step continues from there. But a multiplier that the
        // inner problem has moved beyond its bound leaves its set, whatever r is at the projection. (The extensions to
        // the paper, balance and Coulomb's law, use feasible forces.)
        if self.dual.balance.is_none() && self.dual.law.merit == Merit::Energy {
            way.inner = Some(point.clone());
        }
        self.move_into(point)?;
        self.refresh(point, 0.0)?;
        Ok((sets, iterations))
    }

    /// P_Λ(λ).
    fn move_into(&mut self, point: &mut Point) -> Result<(), DualError> {
        let mut target = point.lambda.clone();
        self.dual.project(&mut target);
        self.move_to(point, target)
    }

    /// The predicted sets for ρ, with α unchanged. Under Coulomb's law a node without force is bounded by its predicted
    /// force, and a node predicted to separate bears no friction.
    fn predict(&self, point: &Point, rho: f64) -> Sets<D> {
        let Point { lambda, r, .. } = point;
        let (law, mut g) = (&self.dual.law, self.dual.bounds(lambda));
        for (i, g) in g.iter_mut().enumerate() {
            if *g == 0.0 {
                *g = law.of(i).disc(lambda[i] - rho * r[i]).g;
            }
        }
        let mut sets = Sets::predict(lambda, r, rho, &g);
        sets.hold_separated(law);
        sets
    }

    /// A step that lowers q: projected gradient, then towards the minimum over the resulting face of Λ, while q falls
    /// on the way to its projection.
    fn safeguarded_step(
        &mut self,
        way: &mut Way<D>,
        target: f64,
    ) -> Result<(Sets<D>, usize), DualError> {
        way.inner = None;
        let point = &mut way.point;
        self.gradient_step(point)?;
        let (law, length) = (&self.dual.law, self.gauge.gradient_length());
        *point = self.gauge.step_from(point, length).start;
        let sets = Sets::binding(&point.lambda, &point.r, &law.bounds(&point.lambda));
        let face = Face::new(sets.clone(), law, self.dual.balance.as_ref());
        let mut end = point.clone();
        let inner = self.solve_inner(&mut end, face, target)?;
        self.move_into(&mut end)?;
        self.refresh(&mut end, 0.0)?;
        let err = self.gauge.error(point);
        *point = point.towards(&end, self.gauge.part_towards(point, &end, err));
        Ok((sets, inner))
    }

    /// A projected gradient step of length 1/σ_max.
    fn gradient_step(&mut self, point: &mut Point) -> Result<(), DualError> {
        let start = point.clone();
        loop {
            let step = self.gauge.step_from(&start, self.gauge.gradient_length());
            *point = step.start;
            self.move_to(point, step.end)?;
            // Written so that NaN ends it, like a step that has become rounding.
            if !(start.q_change(point) > start.q_rounding(point)) {
                break;
            }
            // σ_max was underestimated.
            self.gauge.sigma *= 2.0;
        }
        self.refresh(point, 0.0)
    }
}
