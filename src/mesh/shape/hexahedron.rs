//! Hexahedra with eight nodes, with 20 (serendipity) and with 27 (Lagrange).

use super::rules::{GAUSS, LINE, grid};
use super::{ShapeFunctions, linear, product, quadratic};

pub(crate) struct Hexahedron;
pub(crate) struct Hexahedron20;
pub(crate) struct Hexahedron27;

/// Corners, midsides, the middles of the faces and the centre of the reference cube, in VTK's order.
const NODES: [[f64; 3]; 27] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
    [0.0, -1.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [-1.0, 0.0, -1.0],
    [0.0, -1.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [-1.0, 0.0, 1.0],
    [-1.0, -1.0, 0.0],
    [1.0, -1.0, 0.0],
    [1.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [-1.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, 0.0, -1.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, 0.0],
];

/// The points of the rule of degree 3 are beside the corners.
#[inline]
fn beside_corners() -> [[f64; 3]; 8] {
    std::array::from_fn(|corner| NODES[corner].map(|v| v * GAUSS))
}

/// The trilinear function that is one at this point of `beside_corners` and zero at the others.
fn through_points(at: [f64; 3], point: usize) -> f64 {
    let r3 = 3f64.sqrt();
    (0..3)
        .map(|c| 0.5 * (1.0 + r3 * NODES[point][c] * at[c]))
        .product()
}

/// 3 × 3 × 3 points: with these the volume of a curved element is exact, as it is of degree 5 along each axis.
#[inline]
fn in_threes() -> [([f64; 3], f64); 27] {
    std::array::from_fn(|index| grid(&LINE, index))
}

impl ShapeFunctions<3, 8, 8> for Hexahedron {
    const NODES: [[f64; 3]; 8] = *NODES.first_chunk().expect("27 nodes");
    const CENTRE: [f64; 3] = [0.0; 3];
    const DILATATION_MODES: usize = 1;

    #[inline]
    fn shapes(xi: [f64; 3]) -> ([f64; 8], [[f64; 3]; 8]) {
        product(&Self::NODES, linear, xi)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 8] {
        beside_corners().map(|at| (at, 1.0))
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        in_threes().into_iter()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        beside_corners().into_iter()
    }

    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        through_points(at, point)
    }
}

impl ShapeFunctions<3, 20, 27> for Hexahedron20 {
    const NODES: [[f64; 3]; 20] = *NODES.first_chunk().expect("27 nodes");
    const CENTRE: [f64; 3] = [0.0; 3];
    const DILATATION_MODES: usize = 4;

    /// The quadratic function of a corner is the trilinear one minus half of those of the midsides beside it.
    #[inline]
    fn shapes(xi: [f64; 3]) -> ([f64; 20], [[f64; 3]; 20]) {
        let (mut shape, mut local) = ([0.0; 20], [[0.0; 3]; 20]);
        let values = xi.map(|xi| [linear(-1.0, xi), quadratic(0.0, xi), linear(1.0, xi)]);
        for (a, node) in Self::NODES.iter().enumerate() {
            let [r, s, t]: [[f64; 2]; 3] =
                std::array::from_fn(|c| values[c][(node[c] + 1.0) as usize]);
            shape[a] = r[0] * s[0] * t[0];
            local[a] = [r[1] * s[0] * t[0], r[0] * s[1] * t[0], r[0] * s[0] * t[1]];
        }
        for corner in 0..8 {
            // Bottom and top are rings of four midsides each; the upright ones follow.
            let ring = 8 + corner / 4 * 4;
            let (next, before) = (ring + corner % 4, ring + (corner + 3) % 4);
            for midside in [next, before, 16 + corner % 4] {
                shape[corner] -= 0.5 * shape[midside];
                let slope = local[midside];
                (0..3).for_each(|c| local[corner][c] -= 0.5 * slope[c]);
            }
        }
        (shape, local)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 27] {
        in_threes()
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        in_threes().into_iter()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        beside_corners().into_iter()
    }

    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        through_points(at, point)
    }
}

impl ShapeFunctions<3, 27, 27> for Hexahedron27 {
    const NODES: [[f64; 3]; 27] = NODES;
    const CENTRE: [f64; 3] = [0.0; 3];
    const DILATATION_MODES: usize = 4;

    #[inline]
    fn shapes(xi: [f64; 3]) -> ([f64; 27], [[f64; 3]; 27]) {
        product(&NODES, quadratic, xi)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 27] {
        in_threes()
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        in_threes().into_iter()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        beside_corners().into_iter()
    }

    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        through_points(at, point)
    }
}
