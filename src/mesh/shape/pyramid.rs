//! The pyramid with five nodes, between hexahedra and tetrahedra: a square that shrinks to its apex.
//!
//! With u = r / (1 − t) and v = s / (1 − t) its shape functions are ¼ (1 ± u)(1 ± v)(1 − t) and t. They are bilinear on
//! the base, linear on the sides, and rational inside (Bedrosian 1992).

use super::rules::{GAUSS, LINE, grid};
use super::{ShapeFunctions, linear};

pub(crate) struct Pyramid;

/// The corners of the base, counter-clockwise.
const BASE: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Gauss's rule with two points for ∫ f(t) (1 − t)² dt over (0, 1): points and weights, the lower point first. Their 1
/// − t are the roots of x² − 4/3 x + 2/5, and the weights give ∫ x² = 1/3 and ∫ x³ = 1/4.
fn upright() -> [(f64, f64); 2] {
    let half = (2.0f64 / 45.0).sqrt();
    let [far, near] = [2.0 / 3.0 + half, 2.0 / 3.0 - half];
    let weight = |x: f64, other: f64| (0.25 - other / 3.0) / (x - other);
    [
        (1.0 - far, weight(far, near)),
        (1.0 - near, weight(near, far)),
    ]
}

/// u and v of a point; its apex has none.
fn collapsed([r, s, t]: [f64; 3]) -> [f64; 2] {
    let width = 1.0 - t;
    if width > 0.0 {
        [r / width, s / width]
    } else {
        [0.0; 2]
    }
}

impl ShapeFunctions<3, 5, 8> for Pyramid {
    const NODES: [[f64; 3]; 5] = [
        [-1.0, -1.0, 0.0],
        [1.0, -1.0, 0.0],
        [1.0, 1.0, 0.0],
        [-1.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    const CENTRE: [f64; 3] = [0.0, 0.0, 0.25];
    const DILATATION_MODES: usize = 1;

    fn shapes(xi: [f64; 3]) -> ([f64; 5], [[f64; 3]; 5]) {
        let ([u, v], width) = (collapsed(xi), 1.0 - xi[2]);
        let (mut shape, mut local) = ([0.0; 5], [[0.0; 3]; 5]);
        for (a, [s, t]) in BASE.into_iter().enumerate() {
            let ([fu, du], [fv, dv]) = (linear(s, u), linear(t, v));
            shape[a] = fu * fv * width;
            // ∂u/∂t = u / (1 − t).
            local[a] = [du * fv, fu * dv, u * du * fv + v * fu * dv - fu * fv];
        }
        (shape[4], local[4]) = (xi[2], [0.0, 0.0, 1.0]);
        (shape, local)
    }

    fn stiffness_rule() -> [([f64; 3], f64); 8] {
        std::array::from_fn(|point| {
            let ([u, v], (t, weight)) = (BASE[point % 4], upright()[point / 4]);
            let width = GAUSS * (1.0 - t);
            ([u * width, v * width, t], weight)
        })
    }

    /// 3 × 3 × 3 of the square and the height, where (1 − t)² is part of the weight.
    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        (0..27).map(|index| {
            let ([u, v, w], weight) = grid::<3, 3>(&LINE, index);
            let t = 0.5 * (1.0 + w);
            let width = 1.0 - t;
            ([u * width, v * width, t], 0.5 * weight * width * width)
        })
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        Self::stiffness_rule().into_iter().map(|(at, _)| at)
    }

    /// Linear in u, v and t; at the apex, where these end, the mean over u and v.
    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        let [u, v] = collapsed(at);
        let [(low, _), (high, _)] = upright();
        let up = (at[2] - low) / (high - low);
        let [s, t] = BASE[point % 4];
        let r3 = 3f64.sqrt();
        let along = [1.0 - up, up][point / 4];
        0.25 * (1.0 + r3 * s * u) * (1.0 + r3 * t * v) * along
    }
}
