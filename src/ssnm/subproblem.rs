//! The contact problem with a surrogate instead of A: Algorithm SSNM in as many unknowns as there are pairs.
//!
//! Take Ã = cI + U S Uᵀ with the columns of the surrogate for U, and their signs in S: [√c Q, W] and diag(−1, 1). Given s = S Uᵀ(λ − λᵏ) and the change a of
//! the motion of the bodies, the conditions of the contact problem at λ are those of a problem with the matrix b I on
//! each node alone, b = c + τ:
//!
//! λ = P(z), z = λᵏ − (rᵏ + U s − Gᵀa)/b,
//!
//! with bI + C instead of bI for compliant contact: both tangents of a node have the same compliance, so that a disc stays a
//! disc.
//!
//! P is the solution of a node ([`SlipBound::solve`](crate::constraint::SlipBound::solve)): the sets of Step 2 are those of z, with ρ = 1/b. S s = Uᵀ(λ − λᵏ) and
//! Gλ = e remain, which Newton's method solves: it is Step 3 on these sets, solved exactly by the formula of Woodbury.
//! The derivative of P on a disc is 1/(b + κ) along the tangent, where κ is the curvature term of the circle. For one
//! pair, Becker and Fadili have the same (A quasi-Newton proximal splitting method, NIPS 2012).
//!
//! Where Newton's method finds no descent, τ is raised: the larger it is, the shorter the step, until the problem is that of a
//! projected gradient step.

use super::Numbers;
use super::law::Law;
use super::point::Point;
use super::surrogate::Surrogate;
use crate::constraint::{at, put, row_of};
use crate::control::Stop;
use crate::dense::{PARALLEL, solve, transposed_product};
use crate::dual::balance::{Balance, CURVATURE};
use crate::rounding::ROUNDING;
use crate::sparse::{add_times, difference, dot, norm};
use faer::Mat;
use rayon::prelude::*;
use std::array::from_fn;

/// The problem to solve.
pub(super) struct Subproblem<'a> {
    pub surrogate: &'a Surrogate,
    pub law: &'a Law,
    pub balance: Option<&'a Balance>,
    /// λᵏ, rᵏ and αᵏ.
    pub from: &'a Point,
    /// b.
    pub stiffness: f64,
    pub numbers: Numbers,
    pub stop: &'a Stop<'a>,
}

/// A point on the way.
#[derive(Clone)]
pub(super) struct Trial {
    /// s, then a; z where A is known.
    pub unknowns: Vec<f64>,
    /// z and P(z).
    pub z: Vec<f64>,
    pub lambda: Vec<f64>,
    /// S s − Uᵀ(λ − λᵏ), then Gλ − e; if A is known, the error of the gradient.
    pub rest: Vec<f64>,
    /// ‖U S rest‖ and b‖Gλ − e‖ together: the distance of the gradient that λ belongs to from that of the problem. The
    /// error (10) of λ is no larger, because P_Λ is nonexpansive.
    pub merit: f64,
}

impl Trial {
    /// a.
    pub fn motion(&self, surrogate: &Surrogate) -> &[f64] {
        &self.unknowns[surrogate.n_columns()..]
    }
}

/// The equations of a contact problem in which a model replaces A.
pub(super) trait Equations<const D: usize> {
    fn numbers(&self) -> (Numbers, &Stop<'_>);
    /// The point with these unknowns.
    fn at(&self, unknowns: Vec<f64>) -> Trial;
    /// Newton's direction there; not finite if it does not exist.
    fn direction(&self, trial: &Trial) -> Vec<f64>;
    /// Whether bodies may move as a whole.
    fn floats(&self) -> bool;
    /// Whether a trial is good enough; `stays`: the last step was no better than it.
    fn is_solved(&self, best: &Trial, target: f64, stays: bool) -> bool;

    /// Lowers the merit to `target`; also returns the number of Newton steps.
    fn solve(&self, start: Vec<f64>, target: f64) -> (Trial, usize) {
        let mut here = self.at(start);
        let mut best = here.clone();
        let mut merits = vec![here.merit];
        let (numbers, stop) = self.numbers();
        let Numbers {
            newton_steps,
            fall,
            memory,
            halvings,
            progress,
            ..
        } = numbers;
        for step in 0..newton_steps {
            // If the last step brought nothing, the rest of a small imbalance is rounding.
            let stays = merits[merits.len() - 1] > best.merit;
            if self.is_solved(&best, target, stays) || stop.now().is_some() {
                return (best, step);
            }
            let direction = self.direction(&here);
            if direction.iter().any(|v| !v.is_finite()) {
                return (best, step);
            }
            let recent = &merits[merits.len().saturating_sub(memory)..];
            let bound = recent.iter().fold(0.0_f64, |a, &b| a.max(b));
            let along = |t: f64| {
                let mut unknowns = here.unknowns.clone();
                add_times(t, &direction, &mut unknowns);
                self.at(unknowns)
            };
            let mut next: Option<Trial> = None;
            for halved in 0..=halvings {
                let t = 0.5_f64.powi(halved as i32);
                let trial = along(t);
                let falls = trial.merit <= (1.0 - fall * t) * bound;
                if next.as_ref().is_none_or(|next| trial.merit < next.merit) {
                    next = Some(trial);
                }
                if falls {
                    break;
                }
            }
            let mut next = next.expect("the whole step was tried");
            if self.floats() && next.merit > progress * here.merit {
                next = lowest(along, &here, &direction).unwrap_or(next);
            }
            here = next;
            merits.push(here.merit);
            if here.merit < best.merit {
                best = here.clone();
            }
        }
        (best, newton_steps)
    }
}

/// The point along a step where the equations, those of a gradient, have no part along it any more; None if the whole step does not
/// go far beyond it. Newton's method may go back and forth between two sides of it: a body on a soft spring slips one way, then the other,
/// and all ways that are halved several times miss the short one on which it sticks.
fn lowest(along: impl Fn(f64) -> Trial, here: &Trial, direction: &[f64]) -> Option<Trial> {
    /// Such a part of the slope at the start is on the short way: from there Newton's step is exact.
    const NONE: f64 = 0.1;
    let slope = |trial: &Trial| dot(&trial.rest, direction);
    let (start, mut trial) = (slope(here), along(1.0));
    if !(start < 0.0 && slope(&trial) > -0.5 * start) {
        return None;
    }
    let (mut low, mut high) = (0.0, 1.0);
    // As often as f64 has digits.
    for _ in 0..f64::MANTISSA_DIGITS {
        if slope(&trial).abs() <= -NONE * start {
            break;
        }
        let middle = 0.5 * (low + high);
        trial = along(middle);
        match slope(&trial) < 0.0 {
            true => low = middle,
            false => high = middle,
        }
    }
    Some(trial)
}

/// Adds columns times these numbers.
fn add_columns(columns: &[(&[f64], f64, f64)], parts: &[f64], sum: &mut [f64]) {
    /// Entries of a task.
    const PIECE: usize = 4096;
    let add = |(piece, sum): (usize, &mut [f64])| {
        for ((column, ..), part) in columns.iter().zip(parts) {
            add_times(*part, &column[piece * PIECE..][..sum.len()], sum);
        }
    };
    match columns.len() * sum.len() < PARALLEL {
        true => sum.chunks_mut(PIECE).enumerate().for_each(add),
        false => sum.par_chunks_mut(PIECE).enumerate().for_each(add),
    }
}

impl Subproblem<'_> {
    /// Solves the problem from s = 0 and a motion to start from: [`Equations::solve`].
    pub fn solve<const D: usize>(&self, motion: Vec<f64>, target: f64) -> (Trial, usize) {
        let mut unknowns = vec![0.0; self.surrogate.n_columns()];
        unknowns.extend(motion);
        Equations::<D>::solve(self, unknowns, target)
    }

    /// E and P'E/b, column by column, on the nodes where P' is not zero.
    fn images<const D: usize>(&self, trial: &Trial) -> [Vec<f64>; 2] {
        let m = trial.z.len() / D;
        let (count, size) = (self.surrogate.n_columns(), trial.unknowns.len());
        let moving: Vec<_> = (0..m)
            .map(|i| (i, self.law.of(i).solve::<D>(at(&trial.z, i)).1))
            .filter(|(_, derivative)| derivative.iter().flatten().any(|&v| v != 0.0))
            .collect();
        let rows = D * moving.len();
        let mut e = vec![0.0; rows * size];
        if let Some(balance) = self.balance {
            for (place, &(i, _)) in moving.iter().enumerate() {
                for a in 0..D {
                    for (j, v) in balance.row(row_of::<D>(m, i, a)) {
                        e[rows * (count + j) + D * place + a] = -v;
                    }
                }
            }
        }
        let columns: Vec<(&[f64], f64, f64)> = self.surrogate.columns().collect();
        let is_compliant = self.surrogate.softest() > 0.0;
        let mut moved = vec![0.0; rows * size];
        let fill = |(j, (e, moved)): (usize, (&mut [f64], &mut [f64]))| {
            if let Some((column, factor, _)) = columns.get(j) {
                for (e, &(i, _)) in e.chunks_exact_mut(D).zip(&moving) {
                    let own: [f64; D] = at(column, i);
                    (0..D).for_each(|a| e[a] = factor * own[a]);
                }
            }
            let places = e.chunks_exact(D).zip(moved.chunks_exact_mut(D));
            for ((e, moved), &(i, derivative)) in places.zip(&moving) {
                // ∂z of the gradient is 1/(b + C).
                let diagonal = |c| {
                    self.surrogate
                        .diagonal(row_of::<D>(m, i, c), self.stiffness)
                };
                let (before, after): ([f64; D], f64) = match is_compliant {
                    true => (from_fn(|c| e[c] / diagonal(c)), 1.0),
                    false => (from_fn(|c| e[c]), self.stiffness),
                };
                for a in 0..D {
                    let terms = derivative[a].iter().zip(before).map(|(d, e)| d * e);
                    moved[a] = terms.sum::<f64>() / after;
                }
            }
        };
        // Without a node that moves there is nothing to fill.
        let long = rows.max(1);
        match rows * size < PARALLEL {
            true => (e.chunks_mut(long).zip(moved.chunks_mut(long)))
                .enumerate()
                .for_each(fill),
            false => (e.par_chunks_mut(long).zip(moved.par_chunks_mut(long)))
                .enumerate()
                .for_each(fill),
        }
        [e, moved]
    }
}

impl<const D: usize> Equations<D> for Subproblem<'_> {
    fn floats(&self) -> bool {
        self.balance.is_some()
    }

    fn numbers(&self) -> (Numbers, &Stop<'_>) {
        (self.numbers, self.stop)
    }

    /// The point with these s and a.
    fn at(&self, unknowns: Vec<f64>) -> Trial {
        let n = self.from.lambda.len();
        let count = self.surrogate.n_columns();
        let columns: Vec<(&[f64], f64, f64)> = self.surrogate.columns().collect();
        let mut gradient = self.from.r.clone();
        let parts = columns.iter().zip(&unknowns);
        let parts: Vec<f64> = parts.map(|((_, factor, _), s)| factor * s).collect();
        add_columns(&columns, &parts, &mut gradient);
        if let Some(balance) = self.balance {
            add_times(-1.0, &balance.spread(&unknowns[count..]), &mut gradient);
        }
        let mut z = self.from.lambda.clone();
        match self.surrogate.softest() > 0.0 {
            false => add_times(-1.0 / self.stiffness, &gradient, &mut z),
            true => (z.iter_mut().zip(&gradient).enumerate())
                .for_each(|(i, (z, g))| *z -= g / self.surrogate.diagonal(i, self.stiffness)),
        }
        let mut lambda = vec![0.0; n];
        for i in 0..n / D {
            put::<D>(&mut lambda, i, self.law.of(i).solve(at(&z, i)).0);
        }
        let step = difference(&lambda, &self.from.lambda);
        let miss = |(j, (column, factor, sign)): (usize, &(&[f64], f64, f64))| {
            sign * unknowns[j] - factor * dot(column, &step)
        };
        let mut rest: Vec<f64> = match columns.len() * n < PARALLEL {
            true => columns.iter().enumerate().map(miss).collect(),
            false => columns.par_iter().enumerate().map(miss).collect(),
        };
        let parts = columns.iter().zip(&rest);
        let parts: Vec<f64> = parts
            .map(|((_, factor, sign), miss)| sign * factor * miss)
            .collect();
        let mut missed = vec![0.0; n];
        add_columns(&columns, &parts, &mut missed);
        let mut merit = norm(&missed);
        if let Some(balance) = self.balance {
            let excess = balance.excess(&lambda);
            let stiffness = self.stiffness + self.surrogate.softest();
            merit = merit.hypot(stiffness * norm(&excess));
            rest.extend(excess);
        }
        Trial {
            unknowns,
            z,
            lambda,
            rest,
            merit,
        }
    }

    /// Newton's direction: with E = [U, −Gᵀ], (diag(S, 0) + Eᵀ P' E / b) (ds, da) = −rest.
    fn direction(&self, trial: &Trial) -> Vec<f64> {
        let (count, size) = (self.surrogate.n_columns(), trial.unknowns.len());
        let [e, moved] = self.images::<D>(trial);
        let mut matrix = match e.len() {
            0 => Mat::zeros(size, size),
            entries => transposed_product(entries / size, &e, &moved),
        };
        for (j, (_, _, sign)) in self.surrogate.columns().enumerate() {
            matrix[(j, j)] += sign;
        }
        for j in count..size {
            // A motion without resistance at the moment.
            matrix[(j, j)] += CURVATURE / self.stiffness;
        }
        let right: Vec<f64> = trial.rest.iter().map(|v| -v).collect();
        solve(matrix, &right)
    }

    /// The bodies are balanced to rounding, where possible. What restores the balance later may be more compliant than the merit assumes: a
    /// soft spring where all contact slips. And along a step in which forces change their balance q need not fall: Gᵀα does work on it.
    fn is_solved(&self, best: &Trial, target: f64, stays: bool) -> bool {
        let balanced = |part: f64| {
            let balance = self.balance;
            balance.is_none_or(|balance| balance.is_met(&best.lambda, part))
        };
        !(best.merit > target) && (balanced(ROUNDING) || (stays && balanced(100.0 * ROUNDING)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::scatter;

    /// A contact problem on a surrogate of a few pairs of diag(1, 2, 3, …) + uuᵀ, compared with many thousand projected
    /// gradient steps. Returns the error of the answer, that at the start, and the distance of the two answers.
    fn compare<const D: usize>(law: &Law, m: usize, pairs: usize, seed: usize) -> [f64; 3] {
        let n = D * m;
        let numbers = scatter(n * (pairs + 3) + seed);
        let mut rows = numbers[seed..].chunks(n);
        let mut next = || {
            rows.next()
                .unwrap_or_else(|| panic!("too few numbers"))
                .to_vec()
        };
        let u = next();
        let mut surrogate = Surrogate::default();
        surrogate.prepare(2.0, 100, &[], &[]);
        for _ in 0..pairs {
            let v = next();
            let along = dot(&u, &v);
            let image: Vec<f64> = (0..n)
                .map(|i| (1.0 + (i % 3) as f64) * v[i] + along * u[i])
                .collect();
            surrogate.add(&v, &image, 0.0, 0.0);
        }
        let from = Point {
            lambda: vec![0.0; n],
            r: next().iter().map(|v| 4.0 * v).collect(),
            motion: Vec::new(),
        };
        let stop = Stop::default();
        let (trial, _) = Subproblem {
            surrogate: &surrogate,
            law,
            balance: None,
            from: &from,
            stiffness: surrogate.base(),
            numbers: Numbers::default(),
            stop: &stop,
        }
        .solve::<D>(Vec::new(), 1e-12);
        let rho = 1.0 / surrogate.largest();
        let step = |lambda: &[f64]| -> Vec<f64> {
            let mut z = lambda.to_vec();
            add_times(-rho, &surrogate.times(lambda), &mut z);
            add_times(-rho, &from.r, &mut z);
            law.project::<D>(&mut z, None);
            z
        };
        let err = |lambda: &[f64]| norm(&difference(&step(lambda), lambda)) / rho;
        let mut slow = from.lambda.clone();
        for _ in 0..20_000 {
            slow = step(&slow);
        }
        let apart = norm(&difference(&slow, &trial.lambda));
        [err(&trial.lambda), err(&from.lambda), apart]
    }

    #[test]
    fn many_slow_steps_come_to_the_same() {
        for m in [1, 2, 7, 30] {
            for pairs in [0, 1, 5, 12] {
                for (given, mu) in [(0.0, 0.0), (0.4, 0.0), (1e3, 0.0), (0.0, 0.3)] {
                    let seed = 3 * m + pairs;
                    let law = Law::with(m, given, mu);
                    for [err, first, apart] in [
                        compare::<2>(&law, m, pairs.min(m), seed),
                        compare::<3>(&law, m, pairs.min(m), seed),
                    ] {
                        let what = format!("{m} nodes, {pairs} pairs, g = {given}, mu = {mu}");
                        assert!(err <= 1e-9 * first, "{what}: {err:e} of {first:e}");
                        assert!(apart < 1e-7, "{what}: {apart:e}");
                    }
                }
            }
        }
    }
}
