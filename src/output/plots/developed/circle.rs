//! The circle through points of the plane.

use crate::dense::least_squares;
use crate::mesh::vector::{dot, minus};
use faer::Mat;

/// The largest distance of nodes from a circle for unrolling, as a part of its radius.
const ROUND: f64 = 0.05;

/// The centre and radius of the circle through points, if they are on one.
pub(super) fn circle(points: &[[f64; 2]]) -> Option<([f64; 2], f64)> {
    if points.len() < 4 {
        return None;
    }
    // x² + y² = 2 a x + 2 b y + c around the mean, for well-scaled numbers.
    let count = points.len() as f64;
    let mean = [0, 1].map(|c| points.iter().map(|p| p[c]).sum::<f64>() / count);
    let local: Vec<[f64; 2]> = (points.iter()).map(|&p| minus(p, mean)).collect();
    let size = local.iter().flatten().fold(0.0, |a: f64, v| a.max(v.abs()));
    let matrix = Mat::from_fn(points.len(), 3, |i, j| match j {
        2 => 1.0,
        _ => local[i][j] / size,
    });
    let squares: Vec<f64> = (local.iter()).map(|&p| dot(p, p) / (size * size)).collect();
    let solution = least_squares(matrix, &squares);
    let (a, b) = (0.5 * solution[0], 0.5 * solution[1]);
    let radius = (solution[2] + a * a + b * b).sqrt() * size;
    let centre = [mean[0] + size * a, mean[1] + size * b];
    let off = (points.iter())
        .map(|&p| {
            let [x, y] = minus(p, centre);
            (x.hypot(y) - radius).abs()
        })
        .fold(0.0, f64::max);
    (off < ROUND * radius).then_some((centre, radius))
}
