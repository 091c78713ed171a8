//! The measure of points: the error (10), its scale, and what rounding leaves of it.

use super::dual_problem::DualProblem;
use super::law::Merit;
use super::point::{GradientStep, Point, distance, gradient_step};
use crate::constraint::{SlipBound, row_of, tangential};
use crate::problem::beyond;
use crate::rounding::ROUNDING;
use crate::sparse::{difference, norm};
use std::array::from_fn;

/// Projected gradient steps with the bounds of the one before, from friction that holds everything: the second one has the bounds of
/// pressures, the third those of pressures under such bounds.
const FROM_ABOVE: usize = 3;

/// Measures points by ρ = β/σ_max and by the sizes of displacements that products have shown so far.
pub(super) struct Gauge<'a, const D: usize> {
    pub dual: &'a DualProblem<'a, D>,
    /// σ_max: from Lanczos before the algorithms as printed, otherwise from the products so far.
    pub sigma: f64,
    /// How far the bodies of each row of B had moved when u was last computed, without rigid-body motions; 0 before.
    pub moved: Vec<f64>,
    /// The error at λ = 0 with the friction of what is squeezed there ([`Self::squeeze_of`]); 0 under given bounds, and where no body
    /// can move as a whole.
    pub squeeze: f64,
    /// The motion of each row of B by the rounding of forces, if they were the size of their terms, not scaled; empty
    /// before it counts.
    pub blur: Vec<f64>,
}

impl<const D: usize> Gauge<'_, D> {
    /// ρ = β/σ_max.
    pub fn rho(&self) -> f64 {
        self.dual.settings.beta * self.gradient_length()
    }

    /// 1/σ_max: the length of projected gradient steps. Without contact, or with a B that K makes infinitely stiff, any
    /// will do.
    pub fn gradient_length(&self) -> f64 {
        match self.sigma {
            sigma if sigma > 0.0 => 1.0 / sigma,
            _ => 1.0,
        }
    }

    /// A projected gradient step of length ρ from a point, with the α that keeps the bodies in balance on it. The point
    /// is unchanged.
    pub fn step_from(&self, point: &Point, rho: f64) -> GradientStep {
        self.step_under(point, rho, &self.dual.bounds(&point.lambda))
    }

    /// The same under given bounds.
    fn step_under(&self, point: &Point, rho: f64, g: &[f64]) -> GradientStep {
        gradient_step::<D>(point, rho, g, self.dual.balance.as_deref())
    }

    /// The end of a projected gradient step under Coulomb's law with the friction of its own pressures, where bodies can move as a
    /// whole, and its length over ρ.
    ///
    /// The bounds at λ are those of its own pressures. A body that others squeeze and that bears nothing there may leave its place
    /// without friction, however far, as soon as their normals are not quite parallel: then λ obeys all conditions, but no load that
    /// grows from zero leads there. Here the bounds come from above: first friction holds everything, then what the pressures allow.
    pub fn squeeze_of(&self, point: &Point) -> Option<(Vec<f64>, f64)> {
        let dual = self.dual;
        (dual.balance.as_ref()).filter(|_| dual.law.merit == Merit::Error)?;
        let rho = self.rho();
        let mut end = vec![f64::MAX; point.lambda.len()];
        for _ in 0..FROM_ABOVE {
            end = self.step_under(point, rho, &dual.law.bounds(&end)).end;
        }
        let length = distance(&point.lambda, &end);
        dual.project(&mut end);
        Some((end, length / rho))
    }

    /// err = ‖r̃_ρ(λ)‖, the reduced gradient (10) at a point of Λ, with its α.
    pub fn error(&self, point: &Point) -> f64 {
        self.error_with(point, self.rho())
    }

    /// The same for another ρ.
    pub fn error_with(&self, point: &Point, rho: f64) -> f64 {
        distance(&point.lambda, &self.step_from(point, rho).end) / rho
    }

    /// err, and sets this α at the point.
    pub fn update_error(&self, point: &mut Point) -> f64 {
        let GradientStep { end, start } = self.step_from(point, self.rho());
        *point = start;
        distance(&point.lambda, &end) / self.rho()
    }

    /// err⁰, taken at λ = 0 (at the least forces in balance) even for a warm start: a good start must not make the same
    /// tolerance harder. Nor must places far away, where squeezed bodies bear nothing.
    pub fn first_error(&self, first: &Point) -> f64 {
        (self.error(first))
            .max(self.rounding(first))
            .max(self.squeeze)
    }

    /// ‖((Σⱼ Bᵢⱼ²/Kⱼⱼ + Cᵢᵢ) λᵢ)ᵢ‖: the effect of each force on its own node if nothing else moved. An err below this times ε is
    /// good enough however small err⁰ is.
    pub fn local_error(&self, lambda: &[f64]) -> f64 {
        let problem = &self.dual.problem;
        if problem.is_rigid() {
            return 0.0;
        }
        let own: Vec<f64> = (problem.compliance().iter().zip(lambda))
            .enumerate()
            .map(|(i, (c, l))| c * l * self.dual.factor(i).powi(2))
            .collect();
        norm(&own)
    }

    /// The error of err by rounding of r alone: f64 cannot measure a smaller error. Each row has its own. A gap that is open
    /// beyond all rounding has no part in err, nor has a traction on its bound; in space it turns there.
    pub fn rounding(&self, point: &Point) -> f64 {
        norm(&self.rounding_of_rows(point))
    }

    /// Whether each row of the reduced gradient is below its own rounding.
    pub fn hides_each_row(&self, point: &Point) -> bool {
        let rho = self.rho();
        let GradientStep { end, start } = self.step_from(point, rho);
        let off = difference(&end, &start.lambda);
        let mut rows = off.iter().zip(self.rounding_of_rows(point));
        rows.all(|(off, rounding)| off.abs() <= rho * rounding)
    }

    /// The rounding of each row of the reduced gradient.
    fn rounding_of_rows(&self, point: &Point) -> Vec<f64> {
        let (dual, m) = (self.dual, self.dual.problem.m());
        let (bounds, length) = (dual.law.bounds(&point.lambda), self.gradient_length());
        let mut terms = vec![0.0; point.lambda.len()];
        for (i, &g) in bounds.iter().enumerate() {
            let rows: [usize; D] = from_fn(|a| row_of::<D>(m, i, a));
            let term = self.terms(point, rows);
            let z = rows.map(|row| point.lambda[row] - length * point.r[row]);
            let law = dual.law.of(i);
            let mut part = [1.0; D];
            if law != SlipBound::Tied {
                let length = dual.settings.numbers.touching * length;
                let is_open = z[0] < -length * term[0];
                part[0] = if is_open { 0.0 } else { 1.0 };
                let off = term[1..].iter().fold(0.0_f64, |off, term| off.max(*term));
                let beyond = tangential(z) > g + length * off;
                let turns = if D == 2 { 0.0 } else { g / tangential(z) };
                let bears = if beyond { turns } else { 1.0 };
                // Under Coulomb's law a bound of 0 may be only rounding.
                let none = g == 0.0 && (is_open || law.mu() == 0.0);
                part[1..].fill(if none { 0.0 } else { bears });
            }
            for (row, (part, term)) in rows.into_iter().zip(part.into_iter().zip(term)) {
                terms[row] = 0.5 * part * term;
            }
        }
        terms
    }

    /// The rounding of r in the rows of a node: that of its terms, and of the motion of the node.
    fn terms(&self, point: &Point, rows: [usize; D]) -> [f64; D] {
        let dual = self.dual;
        // B u, including a part that cancels against a large c.
        let moved = rows.iter().fold(0.0_f64, |most, &row| {
            let (c, r) = (dual.offsets[row], point.r[row]);
            most.max(beyond(c - r, ROUNDING * c.abs()).abs())
        });
        rows.map(|row| {
            let compliance = dual.compliance.get(row);
            let given_way = compliance.map_or(0.0, |c| c * point.lambda[row].abs());
            let reach = dual.reach[row].max(self.moved[row]) * dual.factor(row);
            ROUNDING * reach.max(moved).max(given_way)
        })
    }

    /// The best part of the step to `end`: at the least q, or at the least error under Coulomb's law and where rounding
    /// hides q for short steps. `err` is the error at the start.
    pub fn part_towards(&self, start: &Point, end: &Point, err: f64) -> f64 {
        let is_blind = start.q_change(end).abs() <= start.q_rounding(end);
        match self.dual.law.merit {
            Merit::Energy if !is_blind => start.lowest_part(end),
            _ => self.least_error_towards(start, end, err),
        }
    }

    /// The part of the step to `end` with the least error among those tried; the whole step unless the error grows much.
    /// This costs no product: the set of forces that obey Coulomb's law and balance is convex, and r is linear on the
    /// chord.
    fn least_error_towards(&self, before: &Point, end: &Point, err: f64) -> f64 {
        let numbers = self.dual.settings.numbers;
        let mut least = self.error(end);
        let (mut part, mut t) = (1.0, 1.0);
        if least <= numbers.growth * err {
            return part;
        }
        for _ in 0..numbers.halvings {
            t *= 0.5;
            let there = self.error(&before.towards(end, t));
            // Written so that a NaN is left.
            if !(least <= there) {
                (least, part) = (there, t);
            }
        }
        part
    }
}
