//! Quadrilaterals with four nodes, with eight (serendipity) and with nine (Lagrange).

use super::rules::{GAUSS, LINE, LINE4, grid};
use super::{ShapeFunctions, linear, product, quadratic};

pub(crate) struct Quad;
pub(crate) struct Quad8;
pub(crate) struct Quad9;

/// Corners of the reference square, counter-clockwise; the points of the rule of degree 3 are beside them.
const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Corners, midsides and the centre.
const NODES: [[f64; 2]; 9] = [
    CORNERS[0],
    CORNERS[1],
    CORNERS[2],
    CORNERS[3],
    [0.0, -1.0],
    [1.0, 0.0],
    [0.0, 1.0],
    [-1.0, 0.0],
    [0.0, 0.0],
];

#[inline]
fn beside_corners() -> [[f64; 2]; 4] {
    CORNERS.map(|corner| corner.map(|v| v * GAUSS))
}

/// The bilinear function that is one at this point of `beside_corners` and zero at the others.
fn through_points(at: [f64; 2], point: usize) -> f64 {
    let r3 = 3f64.sqrt();
    (0..2)
        .map(|c| 0.5 * (1.0 + r3 * CORNERS[point][c] * at[c]))
        .product()
}

/// 3 × 3 points.
#[inline]
fn nine() -> [([f64; 2], f64); 9] {
    std::array::from_fn(|index| grid(&LINE, index))
}

impl ShapeFunctions<2, 4, 4> for Quad {
    const NODES: [[f64; 2]; 4] = CORNERS;
    const CENTRE: [f64; 2] = [0.0; 2];
    const DILATATION_MODES: usize = 1;

    #[inline]
    fn shapes(xi: [f64; 2]) -> ([f64; 4], [[f64; 2]; 4]) {
        product(&CORNERS, linear, xi)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 2], f64); 4] {
        beside_corners().map(|at| (at, 1.0))
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 2], f64)> {
        nine().into_iter()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 2]> {
        beside_corners().into_iter()
    }

    fn extrapolation(at: [f64; 2], point: usize) -> f64 {
        through_points(at, point)
    }
}

impl ShapeFunctions<2, 8, 9> for Quad8 {
    const NODES: [[f64; 2]; 8] = *NODES.first_chunk().expect("nine nodes");
    const CENTRE: [f64; 2] = [0.0; 2];
    const DILATATION_MODES: usize = 3;

    /// The quadratic function of a corner is the bilinear one minus half of those of the midsides beside it.
    #[inline]
    fn shapes(xi: [f64; 2]) -> ([f64; 8], [[f64; 2]; 8]) {
        let (mut shape, mut local) = ([0.0; 8], [[0.0; 2]; 8]);
        for (a, &[s, t]) in Self::NODES.iter().enumerate() {
            let along = |node: f64, xi: f64| match node {
                0.0 => quadratic(node, xi),
                _ => linear(node, xi),
            };
            let ([fs, ds], [ft, dt]) = (along(s, xi[0]), along(t, xi[1]));
            shape[a] = fs * ft;
            local[a] = [ds * ft, fs * dt];
        }
        for corner in 0..4 {
            for midside in [4 + corner, 4 + (corner + 3) % 4] {
                shape[corner] -= 0.5 * shape[midside];
                let slope = local[midside];
                (0..2).for_each(|c| local[corner][c] -= 0.5 * slope[c]);
            }
        }
        (shape, local)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 2], f64); 9] {
        nine()
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 2], f64)> {
        (0..16).map(|index| grid(&LINE4, index))
    }

    fn stress_points() -> impl Iterator<Item = [f64; 2]> {
        beside_corners().into_iter()
    }

    fn extrapolation(at: [f64; 2], point: usize) -> f64 {
        through_points(at, point)
    }
}

impl ShapeFunctions<2, 9, 9> for Quad9 {
    const NODES: [[f64; 2]; 9] = NODES;
    const CENTRE: [f64; 2] = [0.0; 2];
    const DILATATION_MODES: usize = 3;

    #[inline]
    fn shapes(xi: [f64; 2]) -> ([f64; 9], [[f64; 2]; 9]) {
        product(&NODES, quadratic, xi)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 2], f64); 9] {
        nine()
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 2], f64)> {
        (0..16).map(|index| grid(&LINE4, index))
    }

    fn stress_points() -> impl Iterator<Item = [f64; 2]> {
        beside_corners().into_iter()
    }

    fn extrapolation(at: [f64; 2], point: usize) -> f64 {
        through_points(at, point)
    }
}
