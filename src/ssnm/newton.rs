//! The state that all outer steps share, and the error of a point.

use super::known::Known;
use super::law::Law;
use super::point::{GradientStep, Point, distance, gradient_step};
use super::products::Products;
use super::sets::Sets;
use super::solution::Step;
use super::surrogate::Surrogate;
use super::{EXACT, Method, Numbers};
use crate::constraint::{SlipBound, row_of, tangential};
use crate::dual::DualError;
use crate::dual::balance::{Balance, FaceBalance};
use crate::problem::{ContactProblem, Elsewhere, Kkt, beyond};
use crate::rounding::{DEPENDENT, ROUNDING};
use crate::sparse::{add_times, difference, norm, norm_max};
use std::rc::Rc;

/// The data that persist from step to step; multipliers are scaled.
pub(super) struct Newton<'a, const D: usize> {
    pub problem: &'a ContactProblem<D, Elsewhere>,
    pub law: Law,
    /// If bodies can move as a whole.
    pub balance: Option<Rc<Balance>>,
    /// G on all multipliers. Products are made with balanced directions: the rest of a short step is rounding of λ, and
    /// along it A depends on where K⁻¹ holds the bodies.
    pub balanced: Option<FaceBalance<D>>,
    /// c.
    pub offsets: Vec<f64>,
    /// The diagonal of C; empty where all contact is hard.
    pub compliance: Vec<f64>,
    /// β, of ρ = β/σ_max.
    pub beta: f64,
    /// σ_max: from Lanczos before the algorithms as printed, otherwise from the products so far.
    pub sigma: f64,
    /// The typical entry of diag(A).
    pub mean: f64,
    pub products: Products<'a>,
    /// Pairs hidden by errors of products, since products were last made more accurate.
    pub hidden: usize,
    /// The known pairs of A.
    pub surrogate: Surrogate,
    /// A itself, if it is available as a matrix.
    pub known: Option<Known<D>>,
    pub method: Method,
    pub numbers: Numbers,
    /// u and the optimality conditions of the last final check.
    pub checked: Option<(Vec<f64>, Kkt)>,
    /// ‖f − Bᵀλ − Ku‖ relative to the acting forces in the final check.
    pub check_accuracy: f64,
    /// ε.
    pub tolerance: f64,
    /// The terms of each row of B u, not scaled: [`ContactProblem::reach`].
    pub reach: Vec<f64>,
    /// How far the bodies of each row of B had moved when u was last computed, without rigid-body motions; 0 before.
    pub moved: Vec<f64>,
    /// The motion of each row of B by the rounding of forces, if they were the size of their terms, not scaled; empty
    /// before it counts.
    pub blur: Vec<f64>,
    /// λ before the load step, scaled; empty at rest.
    pub before: Vec<f64>,
    /// Rigid-body positions where neither load nor contact determines them, as coefficients of the motions.
    pub place: Option<&'a [f64]>,
}

/// The data that change from step to step.
pub(super) struct Way<const D: usize> {
    /// P_Λ(λᵏ) and its gradient.
    pub point: Point,
    /// λᵏ itself, as the inner problem of a step as printed has left it: Step 2 uses it.
    pub inner: Option<Point>,
    /// errᵏ.
    pub err: f64,
    /// The point where err⁰ is computed, and err⁰.
    pub first: Point,
    pub err0: f64,
    /// The sets of the last step.
    pub sets: Option<Sets<D>>,
    /// The steps made.
    pub history: Vec<Step>,
    /// The numbers of steps and products when the error was first small enough.
    pub first_met: Option<(usize, usize)>,
}

impl<const D: usize> Newton<'_, D> {
    /// err = ‖r̃_ρ(λ)‖, the reduced gradient (10) at a point of Λ, with its α.
    pub fn error(&self, point: &Point) -> f64 {
        self.error_with(point, self.rho())
    }

    /// The same, and sets this α at the point.
    pub fn update_error(&self, point: &mut Point) -> f64 {
        let GradientStep { end, start } = self.step_from(point, self.rho());
        *point = start;
        distance(&point.lambda, &end) / self.rho()
    }

    /// ρ = β/σ_max.
    pub fn rho(&self) -> f64 {
        self.beta * self.gradient_length()
    }

    /// 1/σ_max: the length of projected gradient steps. Without contact, or with a B that K makes infinitely stiff, any
    /// will do.
    pub fn gradient_length(&self) -> f64 {
        match self.sigma {
            sigma if sigma > 0.0 => 1.0 / sigma,
            _ => 1.0,
        }
    }

    /// err⁰, taken at λ = 0 (at the least forces in balance) even for a warm start: a good start must not make the same
    /// tolerance harder.
    pub fn measure(&self, first: &Point) -> f64 {
        self.error(first).max(self.rounding(first))
    }

    /// The same for another ρ.
    pub fn error_with(&self, point: &Point, rho: f64) -> f64 {
        distance(&point.lambda, &self.step_from(point, rho).end) / rho
    }

    /// err relative to its scale.
    pub fn relative(&self, point: &mut Point, err0: f64) -> f64 {
        let err = self.update_error(point);
        if err <= self.rounding(point) {
            return 0.0;
        }
        err / err0.max(self.local_error(&point.lambda))
    }

    /// ‖((Σⱼ Bᵢⱼ²/Kⱼⱼ + Cᵢᵢ) λᵢ)ᵢ‖: the effect of each force on its own node if nothing else moved. An err below this times ε is
    /// good enough however small err⁰ is.
    pub fn local_error(&self, lambda: &[f64]) -> f64 {
        if self.problem.is_rigid() {
            return 0.0;
        }
        let own: Vec<f64> = (self.problem.compliance().iter().zip(lambda))
            .enumerate()
            .map(|(i, (c, l))| c * l * self.products.dual.factor(i).powi(2))
            .collect();
        norm(&own)
    }

    /// The error of err by rounding of r alone: f64 cannot measure a smaller error. Each row has its own: the rounding of its
    /// terms, and of the motion of its node. A gap that is open beyond all rounding has no part in err, nor has a traction on its
    /// bound; in space it turns there.
    pub fn rounding(&self, point: &Point) -> f64 {
        let Point { lambda, r, .. } = point;
        let (m, bounds) = (self.problem.m(), self.law.bounds(lambda));
        let length = self.gradient_length();
        let mut terms = vec![0.0; lambda.len()];
        for (i, &g) in bounds.iter().enumerate() {
            let rows: [usize; D] = std::array::from_fn(|a| row_of::<D>(m, i, a));
            // B u, including a part that cancels against a large c.
            let moved = rows.iter().fold(0.0_f64, |most, &row| {
                let (c, r) = (self.offsets[row], r[row]);
                most.max(beyond(c - r, ROUNDING * c.abs()).abs())
            });
            let term = rows.map(|row| {
                let given_way = self
                    .compliance
                    .get(row)
                    .map_or(0.0, |c| c * lambda[row].abs());
                let reach = self.reach[row].max(self.moved[row]) * self.products.dual.factor(row);
                ROUNDING * reach.max(moved).max(given_way)
            });
            let z: [f64; D] = std::array::from_fn(|a| lambda[rows[a]] - length * r[rows[a]]);
            let mut part = [1.0; D];
            if self.law.of(i) != SlipBound::Tied {
                let length = self.numbers.touching * length;
                let is_open = z[0] < -length * term[0];
                part[0] = if is_open { 0.0 } else { 1.0 };
                let off = term[1..].iter().fold(0.0_f64, |off, term| off.max(*term));
                let beyond = tangential(z) > g + length * off;
                let turns = if D == 2 { 0.0 } else { g / tangential(z) };
                let bears = if beyond { turns } else { 1.0 };
                // Under Coulomb's law a bound of 0 may be only rounding.
                let none = g == 0.0 && (is_open || self.law.of(i).mu() == 0.0);
                part[1..].fill(if none { 0.0 } else { bears });
            }
            for (row, (part, term)) in rows.into_iter().zip(part.into_iter().zip(term)) {
                terms[row] = part * term;
            }
        }
        0.5 * norm(&terms)
    }

    /// A projected gradient step of length ρ from a point, with the α that keeps the bodies in balance on it. The point
    /// is unchanged.
    pub fn step_from(&self, point: &Point, rho: f64) -> GradientStep {
        let g = self.bounds(&point.lambda);
        gradient_step::<D>(point, rho, &g, self.balance.as_deref())
    }

    /// The slip bounds at λ: under Coulomb's law those of the nearest point that obeys it.
    pub fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        let mut near = lambda.to_vec();
        if self.balance.is_some() && self.law.is_coulomb() {
            self.project(&mut near);
        }
        self.law.bounds(&near)
    }

    /// The projection on Λ, or on Λₑ where bodies can move as a whole.
    pub fn project(&self, lambda: &mut Vec<f64>) {
        self.law.project::<D>(lambda, self.balance.as_deref());
    }

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
            if self.method == Method::Multisecant {
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
        self.sigma = self.surrogate.largest();
    }

    /// The best part of the step to `end`: at the least q, or at the least error under Coulomb's law and where rounding
    /// hides q for short steps. `err` is the error at the start.
    pub fn part_towards(&self, start: &Point, end: &Point, err: f64) -> f64 {
        let is_blind = start.q_change(end).abs() <= start.q_rounding(end);
        match self.law.is_coulomb() || is_blind {
            true => self.least_error_towards(start, end, err),
            false => start.lowest_part(end),
        }
    }

    /// The part of the step to `end` with the least error among those tried; the whole step unless the error grows much.
    /// This costs no product: the set of forces that obey Coulomb's law and balance is convex, and r is linear on the
    /// chord.
    fn least_error_towards(&self, before: &Point, end: &Point, err: f64) -> f64 {
        let mut least = self.error(end);
        let (mut part, mut t) = (1.0, 1.0);
        if least <= self.numbers.growth * err {
            return part;
        }
        for _ in 0..self.numbers.halvings {
            t *= 0.5;
            let there = self.error(&before.towards(end, t));
            // Written so that a NaN is left.
            if !(least <= there) {
                (least, part) = (there, t);
            }
        }
        part
    }

    /// Gᵀα.
    pub fn spread(&self, motion: &[f64]) -> Option<Vec<f64>> {
        let balance = self.balance.as_ref()?;
        Some(balance.spread(&balance.eta(motion)))
    }

    /// Aλ − b at a point.
    pub fn without_motion(&self, point: &Point) -> Vec<f64> {
        let mut r = point.r.clone();
        if let Some(forces) = self.spread(&point.motion) {
            add_times(1.0, &forces, &mut r);
        }
        r
    }

    /// Recomputes r at a point where it is not updated, as accurately as the error there requires; λ has moved by `along`
    /// times the last product's direction. If the error turns out much smaller than expected, it is computed once more.
    pub fn refresh(&mut self, point: &mut Point, along: f64) -> Result<(), DualError> {
        for along in [along, 0.0] {
            if self.products.are_exact() {
                return Ok(());
            }
            let err = self.error(point);
            let expected = self.without_motion(point);
            let made = (self.products).afresh(&point.lambda, along, err, &expected)?;
            let Some(r) = made else {
                // A GPU has failed in the meantime: none of the data so far is exact.
                return self.make_exact(point);
            };
            point.r = r;
            if let Some(forces) = self.spread(&point.motion) {
                add_times(-1.0, &forces, &mut point.r);
            }
            let err = self.error(point);
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
        let problem = self.problem;
        self.moved = problem.row_sizes(&problem.body_sizes(u));
        (self.moved.iter_mut().zip(&self.blur)).for_each(|(moved, blur)| *moved = moved.max(*blur));
        let (rn, rt) = point.r.split_at_mut(problem.m());
        rn.copy_from_slice(&problem.times(problem.normal(), u));
        rt.copy_from_slice(&problem.times(problem.tangential(), u));
        let offsets = problem.load_case().offsets();
        (self.products.dual).finish_gradient(&offsets, &point.lambda, &mut point.r);
        point.motion.fill(0.0);
    }

    /// λ and r in the units of the problem.
    pub fn unscaled(&self, point: &Point) -> (Vec<f64>, Vec<f64>) {
        let (mut lambda, mut r) = (point.lambda.clone(), point.r.clone());
        self.products.dual.times(&mut lambda);
        self.products.dual.divide(&mut r);
        (lambda, r)
    }
}
