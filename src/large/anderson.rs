//! Anderson's acceleration (1965) of a fixed point iteration x ↦ g(x), in the form of Walker and Ni (2011).
//!
//! Contact forces between bodies turn and move with both of them, and the tangent has only a part of it: iterations converge linearly.
//! The next point is the combination of the last ones whose residuals g(x) − x add up to least.

use crate::dense::least_squares;
use crate::sparse::{add_times, norm};
use faer::Mat;
use std::collections::VecDeque;

/// Differences of successive points that are combined, at first and where iterations go on: with 5 a prototype took 11 to 14 iterations for
/// 24 to 31 without. Of 217 load steps of slender strips 25 had no answer with 5 throughout, and 20 with up to 10; with 8 from the start
/// ironing takes more iterations.
const DEPTH: [usize; 2] = [5, 10];
/// Differences of residuals below this part of the last residual are left out: they are rounding, which the combination would
/// multiply.
const NEW: f64 = 1e-8;

/// The last points of an iteration.
#[derive(Default)]
pub(super) struct Anderson {
    /// x and g(x) − x, the last one in front.
    points: VecDeque<[Vec<f64>; 2]>,
    /// How many there have been.
    seen: usize,
}

impl Anderson {
    /// The next point after x, where the iteration goes to g(x).
    pub fn next(&mut self, x: Vec<f64>, to: Vec<f64>) -> Vec<f64> {
        let residual: Vec<f64> = to.iter().zip(&x).map(|(to, x)| to - x).collect();
        self.points.push_front([x, residual]);
        self.seen += 1;
        let depth = (self.seen / 3).clamp(DEPTH[0], DEPTH[1]);
        self.points.truncate(depth + 1);
        let differences: Vec<[Vec<f64>; 2]> = (self.points.iter().zip(self.points.iter().skip(1)))
            .map(|(new, old)| {
                [0, 1].map(|k| new[k].iter().zip(&old[k]).map(|(a, b)| a - b).collect())
            })
            .collect();
        let residual = &self.points[0][1];
        let sizes: Vec<f64> = differences.iter().map(|d| norm(&d[1])).collect();
        let all = sizes
            .iter()
            .take_while(|size| **size > NEW * norm(residual));
        // Least squares need as many equations.
        let n = all.count().min(residual.len());
        let mut next = to;
        if n > 0 {
            let matrix = Mat::from_fn(residual.len(), n, |i, j| differences[j][1][i] / sizes[j]);
            let parts = least_squares(matrix, residual);
            if parts.iter().all(|part| part.is_finite()) {
                for ((difference, part), size) in differences.iter().zip(parts).zip(&sizes) {
                    add_times(-part / size, &difference[0], &mut next);
                    add_times(-part / size, &difference[1], &mut next);
                }
            }
        }
        next
    }

    /// Forgets all points.
    pub fn clear(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of a linear iteration in n dimensions n + 1 points suffice, even if it diverges by itself.
    #[test]
    fn a_linear_iteration_ends() {
        let map = |x: &[f64]| vec![0.9 * x[0] + 0.3 * x[1] + 1.0, -1.4 * x[1] + 2.0, 0.5 * x[0]];
        let (mut anderson, mut x) = (Anderson::default(), vec![0.0; 3]);
        for _ in 0..5 {
            let to = map(&x);
            x = anderson.next(x, to);
        }
        let off = map(&x)
            .iter()
            .zip(&x)
            .fold(0.0, |max: f64, (a, b)| max.max((a - b).abs()));
        assert!(off < 1e-9, "{off}");
    }
}
