//! Wedges with six nodes, with 15 (serendipity) and with 18 (Lagrange): a triangle along an axis.

use super::rules::{GAUSS, LINE, triangle_points};
use super::triangle::{barycentric, inner, quadratic as in_triangle, through_inner};
use super::{ShapeFunctions, linear, quadratic};

pub(crate) struct Wedge;
pub(crate) struct Wedge15;
pub(crate) struct Wedge18;

/// The derivatives of the barycentric coordinates of the triangle.
const SLOPES: [[f64; 2]; 3] = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];

/// Corners, the midsides of the lower triangle, of the upper one and of the upright edges, and the middles of the
/// quadrilaterals, in VTK's order.
const NODES: [[f64; 3]; 18] = [
    [0.0, 0.0, -1.0],
    [1.0, 0.0, -1.0],
    [0.0, 1.0, -1.0],
    [0.0, 0.0, 1.0],
    [1.0, 0.0, 1.0],
    [0.0, 1.0, 1.0],
    [0.5, 0.0, -1.0],
    [0.5, 0.5, -1.0],
    [0.0, 0.5, -1.0],
    [0.5, 0.0, 1.0],
    [0.5, 0.5, 1.0],
    [0.0, 0.5, 1.0],
    [0.0, 0.0, 0.0],
    [1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.5, 0.0, 0.0],
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.0],
];

/// The function of the triangle (corners, then midsides) and the end or middle of the axis for each node.
const FACTORS: [(usize, f64); 18] = [
    (0, -1.0),
    (1, -1.0),
    (2, -1.0),
    (0, 1.0),
    (1, 1.0),
    (2, 1.0),
    (3, -1.0),
    (4, -1.0),
    (5, -1.0),
    (3, 1.0),
    (4, 1.0),
    (5, 1.0),
    (0, 0.0),
    (1, 0.0),
    (2, 0.0),
    (3, 0.0),
    (4, 0.0),
    (5, 0.0),
];

const CENTRE: [f64; 3] = [1.0 / 3.0, 1.0 / 3.0, 0.0];

/// 3 × 2 points; the last coordinate is the same for three of them.
#[inline]
fn six() -> [[f64; 3]; 6] {
    std::array::from_fn(|point| {
        let [_, r, s] = inner(point % 3);
        [r, s, GAUSS * FACTORS[point].1]
    })
}

/// The function linear in the triangle times linear along the axis that is one at this point of `six` and zero at the
/// others.
fn through_points([r, s, t]: [f64; 3], point: usize) -> f64 {
    through_inner(barycentric([r, s]), point % 3) * 0.5 * (1.0 + 3f64.sqrt() * FACTORS[point].1 * t)
}

/// 6 × 3 points.
fn eighteen() -> impl Iterator<Item = ([f64; 3], f64)> {
    triangle_points()
        .flat_map(|([_, r, s], share)| LINE.map(|(t, weight)| ([r, s, t], share * weight)))
}

/// The product of a function of the triangle and one of the axis, with its derivatives.
#[inline]
fn times(of_triangle: (f64, [f64; 2]), [along, slope]: [f64; 2]) -> (f64, [f64; 3]) {
    let (value, [r, s]) = of_triangle;
    (value * along, [r * along, s * along, value * slope])
}

impl ShapeFunctions<3, 6, 6> for Wedge {
    const NODES: [[f64; 3]; 6] = *NODES.first_chunk().expect("18 nodes");
    const CENTRE: [f64; 3] = CENTRE;
    const DILATATION_MODES: usize = 1;

    #[inline]
    fn shapes([r, s, t]: [f64; 3]) -> ([f64; 6], [[f64; 3]; 6]) {
        let triangle = barycentric([r, s]);
        let (mut shape, mut local) = ([0.0; 6], [[0.0; 3]; 6]);
        for node in 0..6 {
            let (a, end) = FACTORS[node];
            (shape[node], local[node]) = times((triangle[a], SLOPES[a]), linear(end, t));
        }
        (shape, local)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 6] {
        six().map(|at| (at, 1.0 / 6.0))
    }

    /// 6 × 3, because the Jacobian of a distorted one is not constant.
    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        eighteen()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        six().into_iter()
    }

    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        through_points(at, point)
    }
}

impl ShapeFunctions<3, 15, 18> for Wedge15 {
    const NODES: [[f64; 3]; 15] = *NODES.first_chunk().expect("18 nodes");
    const CENTRE: [f64; 3] = CENTRE;
    const DILATATION_MODES: usize = 4;

    /// The midsides of the triangles are linear along the axis, the upright ones linear in the triangle. The function
    /// of a corner is the linear one minus half of those of the midsides beside it.
    #[inline]
    fn shapes([r, s, t]: [f64; 3]) -> ([f64; 15], [[f64; 3]; 15]) {
        let triangle = barycentric([r, s]);
        let (of_six, slopes) = in_triangle([r, s]);
        let (mut shape, mut local) = ([0.0; 15], [[0.0; 3]; 15]);
        for node in 0..15 {
            let (a, end) = FACTORS[node];
            let in_plane = if a < 3 {
                (triangle[a], SLOPES[a])
            } else {
                (of_six[a], slopes[a])
            };
            let along = if end == 0.0 {
                quadratic(end, t)
            } else {
                linear(end, t)
            };
            (shape[node], local[node]) = times(in_plane, along);
        }
        for corner in 0..6 {
            let ring = 6 + corner / 3 * 3;
            let (next, before) = (ring + corner % 3, ring + (corner + 2) % 3);
            for midside in [next, before, 12 + corner % 3] {
                shape[corner] -= 0.5 * shape[midside];
                let slope = local[midside];
                (0..3).for_each(|c| local[corner][c] -= 0.5 * slope[c]);
            }
        }
        (shape, local)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 18] {
        Wedge18::stiffness_rule()
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        eighteen()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        six().into_iter()
    }

    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        through_points(at, point)
    }
}

impl ShapeFunctions<3, 18, 18> for Wedge18 {
    const NODES: [[f64; 3]; 18] = NODES;
    const CENTRE: [f64; 3] = CENTRE;
    const DILATATION_MODES: usize = 4;

    #[inline]
    fn shapes([r, s, t]: [f64; 3]) -> ([f64; 18], [[f64; 3]; 18]) {
        let (of_six, slopes) = in_triangle([r, s]);
        let (mut shape, mut local) = ([0.0; 18], [[0.0; 3]; 18]);
        for node in 0..18 {
            let (a, end) = FACTORS[node];
            (shape[node], local[node]) = times((of_six[a], slopes[a]), quadratic(end, t));
        }
        (shape, local)
    }

    #[inline]
    fn stiffness_rule() -> [([f64; 3], f64); 18] {
        let mut rule = [([0.0; 3], 0.0); 18];
        for (place, point) in rule.iter_mut().zip(eighteen()) {
            *place = point;
        }
        rule
    }

    fn load_rule() -> impl Iterator<Item = ([f64; 3], f64)> {
        eighteen()
    }

    fn stress_points() -> impl Iterator<Item = [f64; 3]> {
        six().into_iter()
    }

    fn extrapolation(at: [f64; 3], point: usize) -> f64 {
        through_points(at, point)
    }
}
