//! Tetrahedra with four nodes and with ten.

use super::ShapeFunctions;
use super::rules::{NEAR, tetrahedron_points};

pub(crate) struct Tetrahedron;
pub(crate) struct Tetrahedron10;

/// The derivatives of the barycentric coordinates.
const SLOPES: [[f64; 3]; 4] = [
    [-1.0, -1.0, -1.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, 1.0],
];
/// The corners on either side of each midside node.
const EDGES: [[usize; 2]; 6] = [[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]];

#[inline]
fn barycentric([r, s, t]: [f64; 3]) -> [f64; 4] {
    [1.0 - r - s - t, r, s, t]
}

/// Four points inside: exact for quadratics.
#[inline]
fn inner(corner: usize) -> [f64; 3] {
    let mut at = [NEAR; 4];
    at[corner] = 1.0 - 3.0 * NEAR;
    [at[1], at[2], at[3]]
}

impl ShapeFunctions<3, 4, 1> for Tetrahedron {
    const NODES: [[f64; 3]; 4] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
    ];
    const CENTRE: [f64; 3] = [0.25; 3];
    const DILATATION_MODES: usize = 0;

    #[inline]
    fn shapes(xi: [f64; 3]) -> ([f64; 4], [[f64; 3]; 4]) {
        (barycentric(xi), SLOPES)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 1] {
        [(Self::CENTRE, 1.0 / 6.0)]
    }

    /// Fourteen points: exact to degree 5.
    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        tetrahedron_points().map(|([_, r, s, t], weight)| ([r, s, t], weight / 6.0))
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        std::iter::once(Self::CENTRE)
    }

    fn extrapolation(_: [f64; 3], _: usize) -> f64 {
        1.0
    }
}

impl ShapeFunctions<3, 10, 4> for Tetrahedron10 {
    const NODES: [[f64; 3]; 10] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 1.0],
        [0.5, 0.0, 0.0],
        [0.5, 0.5, 0.0],
        [0.0, 0.5, 0.0],
        [0.0, 0.0, 0.5],
        [0.5, 0.0, 0.5],
        [0.0, 0.5, 0.5],
    ];
    const CENTRE: [f64; 3] = [0.25; 3];
    const DILATATION_MODES: usize = 1;

    #[inline]
    fn shapes(xi: [f64; 3]) -> ([f64; 10], [[f64; 3]; 10]) {
        let at = barycentric(xi);
        let (mut shape, mut local) = ([0.0; 10], [[0.0; 3]; 10]);
        for a in 0..4 {
            shape[a] = at[a] * (2.0 * at[a] - 1.0);
            local[a] = SLOPES[a].map(|slope| (4.0 * at[a] - 1.0) * slope);
        }
        for (k, [a, b]) in EDGES.into_iter().enumerate() {
            shape[4 + k] = 4.0 * at[a] * at[b];
            local[4 + k] =
                std::array::from_fn(|c| 4.0 * (at[a] * SLOPES[b][c] + at[b] * SLOPES[a][c]));
        }
        (shape, local)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 4] {
        std::array::from_fn(|corner| (inner(corner), 1.0 / 24.0))
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        Tetrahedron::load_rule()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        (0..4).map(inner)
    }

    /// The linear function that is 1 at this point and 0 at the other three.
    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        (barycentric(at)[point] - NEAR) / (1.0 - 4.0 * NEAR)
    }
}
