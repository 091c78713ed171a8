//! The contact problem where A is available as a matrix: Newton's method in z, with one unknown per multiplier.
//!
//! λ = P(z) solves the problem on A + τI next to λᵏ, with rᵏ + (A + τI)(λ − λᵏ) instead of Aλ − b, where
//!
//! b(z − P(z)) + rᵏ + (A + τI)(P(z) − λᵏ) = 0,
//!
//! and P is the solution of a node ([`SlipBound::solve`](crate::constraint::SlipBound::solve)) on bI. With τ = 0 that is the problem itself. If contacts depend on
//! each other, like those of rigid bodies, A is singular on the sets of the solution, and forces are not unique. τ, a
//! small part of b, selects those nearest to λᵏ, and λᵏ⁺¹ is a step of the proximal point method (Rockafellar 1976).
//! Acary, Brémond and Huber compare it with others for such contacts (On solving contact problems with Coulomb
//! friction: formulations and numerical comparisons, 2018).

use super::Numbers;
use super::law::Law;
use super::point::Point;
use super::subproblem::{Equations, Trial};
use crate::constraint::{at, put, row_of, tangential};
use crate::control::Stop;
use crate::sparse::lu::Pattern;
use crate::sparse::{BlockCsr, Csr, add_times, difference, norm};
use std::array::from_fn;

/// The most iterations for the λ of one node in a sweep: the next sweep continues after them.
const LOCAL: usize = 100;

/// A, node by node.
pub(super) struct Known<const D: usize> {
    blocks: BlockCsr<D>,
    /// The pattern of Newton's matrix.
    pattern: Pattern,
    /// The mean of the diagonal.
    mean: f64,
    /// τ of the next step, as a part of that.
    proximal: f64,
    /// Whether the last step was not solved.
    is_stuck: bool,
}

impl<const D: usize> Known<D> {
    /// Splits A; None if it is zero, or there is no memory for it.
    pub fn new(matrix: &Csr, proximal: f64) -> Option<Self> {
        let (n, m) = (matrix.n_rows(), matrix.n_rows() / D);
        let place = |row: usize| match row.checked_sub(m) {
            None => D * row,
            Some(t) => D * (t / (D - 1)) + 1 + t % (D - 1),
        };
        let entries = (matrix.triplets()).map(|(i, j, v)| (place(i), place(j), v));
        // Newton's matrix has a diagonal even where A has none.
        let all = entries.chain((0..n).map(|i| (i, i, 0.0)));
        let blocks = BlockCsr::<D>::from_triplets(n, n, all);
        let mut starts = vec![0];
        let mut rows = Vec::new();
        for i in 0..m {
            for _ in 0..D {
                let of_node = |&j: &u32| (0..D).map(move |a| D * j as usize + a);
                rows.extend(blocks.row(i).0.iter().flat_map(of_node));
                starts.push(rows.len());
            }
        }
        let mean = blocks.diagonal().iter().sum::<f64>() / n.max(1) as f64;
        let pattern = (mean > 0.0).then(|| Pattern::new(starts, rows))??;
        Some(Self {
            blocks,
            pattern,
            mean,
            proximal,
            is_stuck: false,
        })
    }

    /// Whether the last step was not solved.
    pub fn is_stuck(&self) -> bool {
        self.is_stuck
    }

    /// Makes steps longer after one that is solved, down to the least τ, and shorter otherwise. The error says nothing about τ: it
    /// may grow in a step that is solved, and a shorter step would only take longer there.
    pub fn adapt(&mut self, is_solved: bool, numbers: &Numbers) {
        self.is_stuck = !is_solved;
        self.proximal = match is_solved {
            true => (self.proximal / numbers.proximal_factor).max(numbers.proximal),
            false => (self.proximal * numbers.proximal_factor).min(1.0),
        };
    }

    /// A p.
    pub fn times(&self, p: &[f64]) -> Vec<f64> {
        let mut by_node = vec![0.0; p.len()];
        self.blocks.mul(&node_by_node::<D>(p), &mut by_node);
        from_nodes::<D>(&by_node)
    }

    /// A sweep of projected Gauss–Seidel: node by node the λ that obeys the law while all others stay; r follows. Newton's method
    /// may have no descent where many contacts depend on each other, sweeps always have one.
    pub fn sweep(&self, law: &Law, point: &mut Point) {
        let Point { lambda, r, .. } = point;
        for i in 0..lambda.len() / D {
            let Some(own) = self.blocks.block(i, i) else {
                continue;
            };
            let b: f64 = (0..D).map(|a| own[a][a]).sum();
            let [before, slope]: [[f64; D]; 2] = [at(lambda, i), at(r, i)];
            if b == 0.0 {
                continue;
            }
            let mut now = before;
            for _ in 0..LOCAL {
                let mut moved: [f64; D] = from_fn(|a| {
                    let more: f64 = (0..D).map(|c| own[a][c] * (now[c] - before[c])).sum();
                    slope[a] + more
                });
                // A sliding node is to lift off by μ times its slip: then λ is the nearest point of the cone (De Saxcé and Feng
                // 1998).
                moved[0] += law.of(i).mu() * tangential(moved);
                let next = law.of(i).nearest(from_fn(|a| now[a] - moved[a] / b)).0;
                if std::mem::replace(&mut now, next) == next {
                    break;
                }
            }
            let change: [f64; D] = from_fn(|a| now[a] - before[a]);
            put(lambda, i, now);
            let (nodes, blocks) = self.blocks.row(i);
            for (&j, block) in nodes.iter().zip(blocks) {
                let there: [f64; D] = at(r, j as usize);
                let moved = from_fn(|a| {
                    // Aⱼᵢ is the transpose of Aᵢⱼ.
                    let sum: f64 = (0..D).map(|c| block[c][a] * change[c]).sum();
                    there[a] + sum
                });
                put::<D>(r, j as usize, moved);
            }
        }
    }
}

/// The entries of a vector with the length of λ, contact by contact.
fn node_by_node<const D: usize>(x: &[f64]) -> Vec<f64> {
    let m = x.len() / D;
    (0..x.len())
        .map(|k| x[row_of::<D>(m, k / D, k % D)])
        .collect()
}

/// The vector with the length of λ from these entries contact by contact.
fn from_nodes<const D: usize>(by_node: &[f64]) -> Vec<f64> {
    let mut x = vec![0.0; by_node.len()];
    for (i, of) in by_node.chunks_exact(D).enumerate() {
        put::<D>(&mut x, i, from_fn(|a| of[a]));
    }
    x
}

/// The problem to solve.
pub(super) struct OnMatrix<'a, const D: usize> {
    pub known: &'a Known<D>,
    pub law: &'a Law,
    /// λᵏ and rᵏ.
    pub from: &'a Point,
    pub numbers: Numbers,
    pub stop: &'a Stop<'a>,
}

impl<const D: usize> OnMatrix<'_, D> {
    /// τ.
    fn tau(&self) -> f64 {
        self.known.proximal * self.known.mean
    }

    /// Solves the problem from λᵏ, to a merit of `target`; λᵏ itself if that fails. Also returns the number of Newton steps, and
    /// whether it is solved.
    pub fn solve(&self, target: f64) -> (Vec<f64>, usize, bool) {
        let mut start = self.from.lambda.clone();
        add_times(-1.0 / self.known.mean, &self.from.r, &mut start);
        let before = self.at(start.clone()).merit;
        let (solved, steps) = Equations::<D>::solve(self, start, target);
        match solved.merit <= 0.5 * before {
            true => (solved.lambda, steps, solved.merit <= target),
            false => (self.from.lambda.clone(), steps, false),
        }
    }
}

impl<const D: usize> Equations<D> for OnMatrix<'_, D> {
    fn floats(&self) -> bool {
        false
    }

    fn numbers(&self) -> (Numbers, &Stop<'_>) {
        (self.numbers, self.stop)
    }

    fn at(&self, z: Vec<f64>) -> Trial {
        let b = self.known.mean;
        let mut lambda = vec![0.0; z.len()];
        for i in 0..z.len() / D {
            put::<D>(&mut lambda, i, self.law.of(i).solve(at(&z, i)).0);
        }
        let step = difference(&lambda, &self.from.lambda);
        let mut rest = self.known.times(&step);
        add_times(self.tau(), &step, &mut rest);
        add_times(1.0, &self.from.r, &mut rest);
        add_times(b, &difference(&z, &lambda), &mut rest);
        Trial {
            merit: norm(&rest),
            unknowns: z.clone(),
            z,
            lambda,
            rest,
        }
    }

    /// −(b(I − P') + (A + τI) P')⁻¹ rest.
    fn direction(&self, trial: &Trial) -> Vec<f64> {
        let Known {
            blocks,
            pattern,
            mean: b,
            ..
        } = self.known;
        let tau = self.tau();
        let mut values = Vec::new();
        for j in 0..trial.z.len() / D {
            let slope = self.law.of(j).solve::<D>(at(&trial.z, j)).1;
            let (nodes, of_row) = blocks.row(j);
            for c in 0..D {
                for (&i, block) in nodes.iter().zip(of_row) {
                    for a in 0..D {
                        // Aᵢⱼ is the transpose of Aⱼᵢ.
                        let mut value: f64 = (0..D).map(|k| block[k][a] * slope[k][c]).sum();
                        if i as usize == j {
                            let one = f64::from(u8::from(a == c));
                            value += b * one + (tau - b) * slope[a][c];
                        }
                        values.push(value);
                    }
                }
            }
        }
        let by_node = pattern.solve(&values, &node_by_node::<D>(&trial.rest));
        let mut direction = from_nodes::<D>(&by_node);
        direction.iter_mut().for_each(|v| *v = -*v);
        direction
    }

    fn is_solved(&self, best: &Trial, target: f64, _: bool) -> bool {
        !(best.merit > target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::scatter;

    /// A contact problem on HHᵀ, more rows than H has columns: the errors of Newton's answer and of many sweeps, relative to r.
    fn errors<const D: usize>(m: usize, motions: usize, mu: f64, seed: usize) -> [f64; 2] {
        let n = D * m;
        let numbers = scatter(seed + n * (motions + 1));
        let (h, r) = numbers[seed..].split_at(n * motions);
        let entry = |i: usize, j: usize| -> f64 {
            let rows = h[motions * i..].iter().zip(&h[motions * j..]);
            rows.take(motions).map(|(a, b)| a * b).sum()
        };
        let all = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
        let matrix = Csr::from_triplets(n, n, all.map(|(i, j)| (i, j, entry(i, j))));
        let known = Known::<D>::new(&matrix, 1e-12).expect("there is memory");
        let law = Law::with(m, 0.1, mu);
        // In the range of A, so that velocities alone can end all contact.
        let from = Point {
            lambda: vec![0.0; n],
            r: known.times(&r[..n]).iter().map(|v| 10.0 * v).collect(),
            motion: Vec::new(),
        };
        let error = |point: &Point| {
            let mut z = point.lambda.clone();
            add_times(-1.0 / known.mean, &point.r, &mut z);
            law.project::<D>(&mut z, None);
            known.mean * norm(&difference(&z, &point.lambda))
        };
        let numbers = Numbers::default();
        let (lambda, ..) = OnMatrix {
            known: &known,
            law: &law,
            from: &from,
            numbers,
            stop: &Stop::default(),
        }
        .solve(1e-10);
        let mut r = known.times(&lambda);
        add_times(1.0, &from.r, &mut r);
        let found = Point {
            lambda,
            r,
            motion: Vec::new(),
        };
        let mut swept = from.clone();
        (0..5000).for_each(|_| known.sweep(&law, &mut swept));
        [&found, &swept].map(|point| error(point) / norm(&from.r))
    }

    #[test]
    fn newton_and_sweeps_solve_dependent_contacts() {
        for (m, motions) in [(1, 1), (3, 4), (8, 11)] {
            for mu in [0.0, 0.3] {
                for [newton, sweeps] in [
                    errors::<2>(m, motions, mu, m),
                    errors::<3>(m, motions, mu, m),
                ] {
                    let what = format!("{m} contacts, {motions} motions, mu = {mu}");
                    assert!(newton < 1e-4, "{what}: Newton {newton:e}");
                    assert!(sweeps < 1e-4, "{what}: sweeps {sweeps:e}");
                }
            }
        }
    }
}
