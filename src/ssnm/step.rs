//! The outer steps: Newton's, and the safeguarded one.

use super::face::Face;
use super::newton::{Newton, Way};
use super::point::Point;
use super::safeguard::Plan;
use super::sets::Sets;
use super::{Method, SETS_CHANGED};
use crate::constraint::{at, put};
use crate::dual::{DualError, DualOperator};

/// In space coupled steps may stop early, on sets that have changed, at this part of the error, or of so many times the
/// least one so far.
const COUPLED_SETS_CHANGED: f64 = 0.2;
const ASTRAY: f64 = 2.0;
/// Points that a search looks at, each half as far as the one before.
const HALVINGS: usize = 6;
/// Projections that are tried between the minimum over a face and the first bound on the way to it.
const NEARER: usize = 6;
/// Times that the length of a projected gradient step is halved.
const SHORTER: usize = 60;

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// Steps 2, 3.2 and 3.3 as planned, to a residual of `target`; returns the sets and the number of inner
    /// iterations. Afterwards the point is feasible.
    pub fn step(
        &mut self,
        way: &mut Way<D>,
        plan: Plan,
        target: f64,
    ) -> Result<(Sets<D>, usize), DualError> {
        match plan {
            Plan::Gradient { faces } => self.safeguarded_step(way, target, faces),
            Plan::Newton { rho, search: false } if self.law.is_coulomb() => {
                self.newton_step(way, rho, target)
            }
            Plan::Newton { rho, search: false } => {
                let before = way.point.clone();
                let made = self.newton_step(way, rho, target)?;
                // Where circles curve, q may rise although that of the model has fallen: the best of the chord.
                if made.0.turn() && before.q_change(&way.point) > before.q_rounding(&way.point) {
                    let lowest = before.lowest_towards(&way.point);
                    way.go_back_to(&lowest);
                }
                Ok(made)
            }
            Plan::Newton { rho, search: true } => {
                let before = way.point.clone();
                let made = self.newton_step(way, rho, target)?;
                if self.search(&before, &mut way.point) {
                    way.start_anew();
                }
                Ok(made)
            }
        }
    }

    /// Steps 2 and 3 of the paper, then P_Λ.
    fn newton_step(
        &mut self,
        way: &mut Way<D>,
        rho: f64,
        target: f64,
    ) -> Result<(Sets<D>, usize), DualError> {
        let predicted = way.predicted.take();
        let least = way.least();
        let (point, err) = (&mut way.point, way.err);
        // Step 2.
        let end = self.settle(point, rho);
        let sets = predicted.unwrap_or_else(|| self.predict(point, rho));
        // Step 3.2: inactive multipliers on their bounds.
        let mut start = point.lambda.clone();
        sets.set_bounds(&mut start, &self.law);
        let face = Face::new(sets.clone(), &self.law, self.balance.as_ref());
        if !face.balance(&mut start) {
            start = end;
        }
        let jumped = self.move_to(point, start)?;
        let mut inner = match way.kept.take() {
            Some(inner) if !jumped && *inner.sets() == sets => inner,
            _ => self.inner_on(face, point)?,
        };
        // Step 3.3.
        let floor = match self.method {
            Method::Inexact if self.law.is_coulomb() && D > 2 => {
                // After a step that has led astray the error is no measure.
                Some(COUPLED_SETS_CHANGED * err.min(ASTRAY * least))
            }
            Method::Inexact => Some(SETS_CHANGED * err),
            Method::Exact => None,
        };
        let enough = |newton: &Self, point: &Point, residual: f64| {
            floor.is_some_and(|floor| residual <= floor) && {
                let mut there = point.clone();
                newton.settle(&mut there, rho);
                newton.predict(&there, rho).differences(&sets) > 0
            }
        };
        let iterations = self.solve_inner(point, &mut inner, target, enough)?;
        // Step 3.4 takes the error at a point of Λ, and the next step goes on from there.
        let (moved, next) = self.move_into_bounds(point, rho)?;
        let err = self.error(point);
        self.products.allow(err);
        if self.products.has_drifted() {
            self.refresh(point)?;
        }
        if !moved && inner.can_go_on() {
            way.kept = Some(inner);
        }
        if self.law.is_coulomb() && D > 2 {
            let mut next = next;
            next.turn_to(&way.point.lambda);
            way.predicted = Some(next);
        }
        Ok((sets, iterations))
    }

    /// The sets that a prediction with ρ gives, α as it is. Under Coulomb's law a node without force is bounded by
    /// the one that it is predicted to get.
    fn predict(&self, point: &Point, rho: f64) -> Sets<D> {
        let Point { lambda, r, .. } = point;
        let mut g = self.bounds(lambda);
        if self.law.is_coulomb() {
            for (i, g) in g.to_mut().iter_mut().enumerate() {
                if *g == 0.0 {
                    *g = self.law.bound(i, lambda[i] - rho * r[i]);
                }
            }
        }
        let mut sets = Sets::predict(lambda, r, rho, &g);
        if self.law.is_coulomb() && D > 2 {
            sets.hold_separated(&self.law);
        }
        sets
    }

    /// Goes back from `point` towards where it came from, if the error is less there; says whether it is. That
    /// costs no product: what obeys Coulomb's law and balance is convex, and r linear on the chord.
    fn search(&self, before: &Point, point: &mut Point) -> bool {
        let end = point.clone();
        let (mut least, mut t, mut found) = (self.error(point), 1.0, false);
        for _ in 0..HALVINGS {
            t *= 0.5;
            let mut there = before.towards(&end, t);
            let err = self.error(&mut there);
            if err < least {
                (least, found) = (err, true);
                *point = there;
            }
        }
        found
    }

    /// P_Λ(λ), with the multipliers that the next step will hold put on their bounds by the same product.
    ///
    /// Only those that a ρ ≤ 1/σ_max holds: what a larger one says of a point outside Λ is too wild.
    fn move_into_bounds(
        &mut self,
        point: &mut Point,
        rho: f64,
    ) -> Result<(bool, Sets<D>), DualError> {
        let rho = if self.law.is_coulomb() && D > 2 {
            rho
        } else {
            rho.min(self.alpha)
        };
        self.settle(point, rho);
        let mut target = point.lambda.clone();
        let sets = self.predict(point, rho);
        sets.set_bounds(&mut target, &self.law);
        self.project(&mut target);
        Ok((self.move_to(point, target)?, sets))
    }

    /// A step that lowers q: projected gradient, then the minimum over the face of Λ that it has reached, over the
    /// smaller face where that minimum lies outside Λ, and so on.
    ///
    /// In space all of that is done with circles linearised, and what has left Λ along their tangents goes back in the end,
    /// as far as that lowers q.
    fn safeguarded_step(
        &mut self,
        way: &mut Way<D>,
        target: f64,
        faces: usize,
    ) -> Result<(Sets<D>, usize), DualError> {
        let (point, err) = (&mut way.point, way.err);
        let g = self.law.bounds(&point.lambda).into_owned();
        self.gradient_step(point)?;
        self.settle(point, self.alpha);
        let start = point.clone();
        // From here on multipliers only join the held ones, so that the loop ends.
        let mut sets = Sets::binding(&point.lambda, &point.r, &g);
        let (mut inner, mut last) = (0, None);
        for number in 1..=faces {
            let mut end = point.clone();
            let face = Face::new(sets.clone(), &self.law, self.balance.as_ref());
            let mut iteration = match last {
                Some(last) => self.inner_after(last, face, &mut end)?,
                None => self.inner_on(face, &mut end)?,
            };
            inner += self.solve_inner(&mut end, &mut iteration, target, |_, _, residual| {
                residual <= SETS_CHANGED * err
            })?;
            let projected = self.nearest_straight(&sets, &end.lambda, &g);
            if projected == end.lambda {
                *point = end;
                last = Some(iteration);
                break;
            }
            let lowest = number == faces;
            *point = self.as_far_as_q_falls(point, end, &iteration.face, &g, lowest)?;
            last = Some(iteration);
            if !sets.hold_at_bounds(&point.lambda, &g) || self.products.stop.now().is_some() {
                break;
            }
        }
        if last.is_some_and(|last| last.face.is_curved()) {
            let mut back = point.lambda.clone();
            self.project(&mut back);
            self.move_to(point, back)?;
            if start.q_change(point).abs() > start.q_rounding(point) {
                *point = start.lowest_towards(point);
            }
        }
        Ok((sets, inner))
    }

    /// From a point towards the minimum over its face, which lies outside Λ. Up to the first bound q falls and its
    /// gradient is known; beyond, the projection is tried: of the minimum and, where circles curve and a product is little
    /// beside what a face costs, of points before it that hold half as many multipliers each. `lowest`: what is left inside
    /// Λ need not lie on a bound, so that the best of the chord will do.
    fn as_far_as_q_falls(
        &mut self,
        point: &Point,
        end: Point,
        face: &Face<D>,
        g: &[f64],
        lowest: bool,
    ) -> Result<Point, DualError> {
        let cut = point.until_bound(&end, g, &face.sets);
        let reaches = point.reaches(&end, g, &face.sets);
        let mut bounds: Vec<f64> = (reaches.into_iter().flatten())
            .filter(|&reach| reach < 1.0)
            .collect();
        bounds.sort_by(f64::total_cmp);
        let tries = if face.is_curved() { NEARER } else { 1 };
        let mut there = end.clone();
        for _ in 0..tries {
            let projected = self.nearest_straight(&face.sets, &there.lambda, g);
            self.move_to(&mut there, projected)?;
            if lowest {
                there = face.lowest_towards(point, &there);
            }
            if face.q_change(&cut, &there) < 0.0 {
                return Ok(there);
            }
            bounds.truncate(bounds.len() / 2);
            match bounds.last() {
                // A little further, so that it does lie on its bound.
                Some(&reach) if bounds.len() > 1 => {
                    there = point.towards(&end, reach * (1.0 + 1e-9))
                }
                _ => break,
            }
        }
        Ok(cut)
    }

    /// P_Λ, but for what moves along the tangents of circles.
    fn nearest_straight(&self, sets: &Sets<D>, lambda: &[f64], g: &[f64]) -> Vec<f64> {
        let nearest = |i: usize, z: [f64; D]| sets.nearest_straight(i, g[i], z);
        let mut projected = lambda.to_vec();
        for i in 0..g.len() {
            put(&mut projected, i, nearest(i, at(lambda, i)).0);
        }
        match &self.balance {
            Some(balance) if projected != lambda => balance.nearest(&projected, nearest).lambda,
            _ => projected,
        }
    }

    /// A projected gradient step, made shorter until it lowers q.
    fn gradient_step(&mut self, point: &mut Point) -> Result<(), DualError> {
        let start = point.clone();
        for _ in 0..SHORTER {
            *point = start.clone();
            let end = self.settle(point, self.alpha);
            self.move_to(point, end)?;
            if start.q_change(point) <= 0.0 {
                break;
            }
            // σ_max was underestimated.
            self.alpha *= 0.5;
        }
        Ok(())
    }
}
