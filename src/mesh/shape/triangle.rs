//! Triangles with three nodes and with six.

use super::ShapeFunctions;
use super::rules::{more_triangle_points, triangle_points};

pub(crate) struct Triangle;
pub(crate) struct Triangle6;

/// The derivatives of the barycentric coordinates.
const SLOPES: [[f64; 2]; 3] = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
/// The corners on either side of each midside node.
const EDGES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
const THIRD: f64 = 1.0 / 3.0;

#[inline]
pub(super) fn barycentric([r, s]: [f64; 2]) -> [f64; 3] {
    [1.0 - r - s, r, s]
}

/// The points of a rule in barycentric coordinates, whose weights sum to 1.
#[inline]
fn in_reference((at, weight): ([f64; 3], f64)) -> ([f64; 2], f64) {
    ([at[1], at[2]], 0.5 * weight)
}

/// The quadratic shape functions of the corners and of the midsides, and their derivatives.
#[inline]
pub(super) fn quadratic(xi: [f64; 2]) -> ([f64; 6], [[f64; 2]; 6]) {
    let at = barycentric(xi);
    let (mut shape, mut local) = ([0.0; 6], [[0.0; 2]; 6]);
    for a in 0..3 {
        shape[a] = at[a] * (2.0 * at[a] - 1.0);
        local[a] = SLOPES[a].map(|slope| (4.0 * at[a] - 1.0) * slope);
    }
    for (k, [a, b]) in EDGES.into_iter().enumerate() {
        shape[3 + k] = 4.0 * at[a] * at[b];
        local[3 + k] = std::array::from_fn(|c| 4.0 * (at[a] * SLOPES[b][c] + at[b] * SLOPES[a][c]));
    }
    (shape, local)
}

/// The three points inside that integrate quadratics exactly, in barycentric coordinates.
#[inline]
pub(super) fn inner(corner: usize) -> [f64; 3] {
    let mut at = [1.0 / 6.0; 3];
    at[corner] = 2.0 / 3.0;
    at
}

/// The linear function that is 1 at one of these points and 0 at the other two.
pub(super) fn through_inner(at: [f64; 3], point: usize) -> f64 {
    2.0 * at[point] - THIRD
}

impl ShapeFunctions<2, 3, 1> for Triangle {
    const NODES: [[f64; 2]; 3] = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]];
    const CENTRE: [f64; 2] = [THIRD; 2];
    const DILATATION_MODES: usize = 0;

    #[inline]
    fn shapes(xi: [f64; 2]) -> ([f64; 3], [[f64; 2]; 3]) {
        (barycentric(xi), SLOPES)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 2], f64); 1] {
        [(Self::CENTRE, 0.5)]
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 2], f64)> {
        triangle_points().map(in_reference)
    }

    fn stress_points() -> impl Iterator<Item = [f64; 2]> {
        std::iter::once(Self::CENTRE)
    }

    fn extrapolation(_: [f64; 2], _: usize) -> f64 {
        1.0
    }
}

impl ShapeFunctions<2, 6, 3> for Triangle6 {
    const NODES: [[f64; 2]; 6] = [
        [0.0, 0.0],
        [1.0, 0.0],
        [0.0, 1.0],
        [0.5, 0.0],
        [0.5, 0.5],
        [0.0, 0.5],
    ];
    const CENTRE: [f64; 2] = [THIRD; 2];
    const DILATATION_MODES: usize = 0;

    #[inline]
    fn shapes(xi: [f64; 2]) -> ([f64; 6], [[f64; 2]; 6]) {
        quadratic(xi)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 2], f64); 3] {
        std::array::from_fn(|corner| in_reference((inner(corner), THIRD)))
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 2], f64)> {
        more_triangle_points().map(in_reference)
    }

    fn stress_points() -> impl Iterator<Item = [f64; 2]> {
        Self::stiffness_rule().into_iter().map(|(at, _)| at)
    }

    fn extrapolation(at: [f64; 2], point: usize) -> f64 {
        through_inner(barycentric(at), point)
    }
}
