//! The outer steps: Newton's, and the safeguarded one.

use super::face::Face;
use super::gcr::Gcr;
use super::point::{Point, project};
use super::subspace::Subspace;
use super::{GROWN, Method, Newton, SETS_CHANGED, Sets, goal};
use crate::dual::{DualError, DualOperator};
use crate::sparse::{dot, norm};

/// Points that a search looks at, each half as far as the one before.
const HALVINGS: usize = 6;

/// The conjugate gradient iteration on a face, kept from one outer step to the next.
pub(super) struct Cg {
    face: Face,
    /// Known directions that the face allows: recycled ones, then those of this iteration.
    span: Subspace,
}

/// The iteration that solves the inner problem.
pub(super) enum Inner {
    Cg(Cg),
    Gcr(Gcr),
}

impl Inner {
    fn sets(&self) -> &Sets {
        match self {
            Self::Cg(cg) => &cg.face.sets,
            Self::Gcr(gcr) => &gcr.face.sets,
        }
    }
}

impl<D: DualOperator + ?Sized> Newton<'_, D> {
    /// Steps 2 and 3 of the paper, then P_Λ: afterwards `point` is feasible.
    pub(super) fn newton_step(
        &mut self,
        point: &mut Point,
        kept: &mut Option<Inner>,
        rho: f64,
        target: f64,
        err: f64,
        method: Method,
    ) -> Result<(Sets, usize), DualError> {
        let end = self.settle(point, rho);
        let sets = self.predict(point, rho);
        // Step 3.2: inactive multipliers on their bounds.
        let mut start = point.lambda.clone();
        sets.set_bounds(&mut start, &self.law);
        let face = Face::new(sets.clone(), &self.law, self.balance.as_ref());
        if !face.balance(&mut start) {
            start = end;
        }
        let jumped = self.move_to(point, start)?;
        let mut inner = match kept.take() {
            Some(inner) if !jumped && *inner.sets() == sets => inner,
            _ if self.law.is_coulomb() => Inner::Gcr(Gcr::on(face, &self.products.known)),
            _ => Inner::Cg(self.cg_on(face, point)),
        };
        // Step 3.3.
        let floor = match method {
            Method::Inexact => Some(SETS_CHANGED * err),
            Method::Exact => None,
        };
        let enough = |newton: &Self, point: &Point, residual: f64| {
            floor.is_some_and(|floor| residual <= floor) && {
                let mut there = point.clone();
                newton.settle(&mut there, rho);
                newton.predict(&there, rho) != sets
            }
        };
        let iterations = match &mut inner {
            Inner::Cg(cg) => self.cg(point, cg, target, enough)?,
            Inner::Gcr(gcr) => self.gcr(point, gcr, target, enough)?,
        };
        // Step 3.4 takes the error at a point of Λ, and the next step goes on from there.
        let moved = self.move_into_bounds(point, rho)?;
        let err = self.error(point);
        self.products.allow(err);
        if self.products.has_drifted() {
            self.refresh(point)?;
        }
        if !moved {
            *kept = Some(inner);
        }
        Ok((sets, iterations))
    }

    /// Starts CG on a face from the minimum over the known directions there.
    fn cg_on(&self, face: Face, point: &mut Point) -> Cg {
        let span = self.products.known.fitting(&face);
        span.minimise(&mut point.lambda, &mut point.r);
        Cg { face, span }
    }

    /// CGM(A, b, 𝒜, λ, tol): minimises q over the free multipliers until ‖r‖ there is at most `target`
    /// or `enough` says so; returns the number of iterations.
    ///
    /// Each direction is the residual made conjugate to all known directions, not only to the last one:
    /// the same iterates in exact arithmetic, and the recycled directions stay minimised.
    fn cg(
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
            if self.ends(
                point,
                rest,
                residual,
                first.filter(|_| inner > 0),
                target,
                &enough,
            ) {
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

    /// Whether an inner iteration ends at a point: where its `residual` (a vector of that length is `rest`) has met
    /// the target or, after the `first` one, where `enough` says so or nothing more is to be had.
    pub(super) fn ends(
        &mut self,
        point: &Point,
        rest: impl FnOnce() -> Vec<f64>,
        residual: f64,
        first: Option<f64>,
        target: f64,
        enough: &impl Fn(&Self, &Point, f64) -> bool,
    ) -> bool {
        // Where the residual grows, directions that fit only nearly have come to work against each other.
        if first.is_some_and(|first| !(residual <= GROWN * first)) && !self.products.are_exact() {
            self.products.sharpen();
            return true;
        }
        // Below its drift it says nothing.
        (residual <= target && self.is_enough(point, rest(), residual))
            || (first.is_some()
                && (residual <= self.products.drift() || enough(self, point, residual)))
    }

    /// Whether an inner problem that has met its target may end: if it may be the last one, the forces have to be
    /// accurate as well, where another step costs more than another product.
    fn is_enough(&self, point: &Point, rest: Vec<f64>, residual: f64) -> bool {
        if residual > self.last_err || self.products.are_exact() {
            return true;
        }
        let rest = Point {
            r: rest,
            ..point.clone()
        };
        let (lambda, r) = self.unscaled(&rest);
        goal::inner_forces_met(self.tolerance, self.problem, &lambda, &r)
    }

    /// The sets that a prediction with ρ gives, α as it is. Under Coulomb's law a node without force is bounded by
    /// the one that it is predicted to get.
    fn predict(&self, point: &Point, rho: f64) -> Sets {
        let Point { lambda, r, .. } = point;
        let mut g = self.bounds(lambda);
        if self.law.is_coulomb() {
            for (i, g) in g.to_mut().iter_mut().enumerate() {
                if *g == 0.0 {
                    *g = self.law.bound(i, lambda[i] - rho * r[i]);
                }
            }
        }
        Sets::predict(lambda, r, rho, &g)
    }

    /// Goes back from `point` towards where it came from, if the error is less there; says whether it is. That
    /// costs no product: what obeys Coulomb's law and balance is convex, and r linear on the chord.
    pub(super) fn search(&self, before: &Point, point: &mut Point) -> bool {
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
    fn move_into_bounds(&mut self, point: &mut Point, rho: f64) -> Result<bool, DualError> {
        let rho = rho.min(self.alpha);
        self.settle(point, rho);
        let mut target = point.lambda.clone();
        self.predict(point, rho).set_bounds(&mut target, &self.law);
        self.project(&mut target);
        self.move_to(point, target)
    }

    /// A step that lowers q: projected gradient from `point`, then the minimum over the face of Λ that it
    /// has reached, over the smaller face where that minimum lies outside Λ, and so on.
    pub(super) fn safeguarded_step(
        &mut self,
        point: &mut Point,
        target: f64,
        err: f64,
        faces: usize,
    ) -> Result<(Sets, usize), DualError> {
        let g = self.law.bounds(&point.lambda).into_owned();
        let gradient = point.clone();
        for _ in 0..60 {
            *point = gradient.clone();
            let lambda = self.settle(point, self.alpha);
            self.move_to(point, lambda)?;
            if gradient.q_change(point) <= 0.0 {
                break;
            }
            // σ_max was underestimated.
            self.alpha *= 0.5;
        }
        self.settle(point, self.alpha);
        // From here on multipliers only join the held ones, so that the loop ends.
        let mut sets = Sets::binding(&point.lambda, &point.r, &g);
        let mut inner = 0;
        for face in 1..=faces {
            let mut end = point.clone();
            let mut cg = self.cg_on(
                Face::new(sets.clone(), &self.law, self.balance.as_ref()),
                &mut end,
            );
            inner += self.cg(&mut end, &mut cg, target, |_, _, residual| {
                residual <= SETS_CHANGED * err
            })?;
            let mut projected = end.lambda.clone();
            project(&mut projected, &g);
            if projected != end.lambda {
                self.project(&mut projected);
            }
            if projected == end.lambda {
                *point = end;
                break;
            }
            // Up to the first bound q falls and its gradient is known; beyond, the projection is tried.
            let cut = point.until_bound(&end, &g);
            self.move_to(&mut end, projected)?;
            // What is left inside Λ by the last face need not lie on a bound: the best of the chord.
            if face == faces {
                end = point.lowest_towards(&end);
            }
            *point = if cut.q_change(&end) < 0.0 { end } else { cut };
            if !sets.hold_at_bounds(&point.lambda, &g) || self.products.stop.now().is_some() {
                break;
            }
        }
        Ok((sets, inner))
    }
}
