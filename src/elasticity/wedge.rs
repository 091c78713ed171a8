//! The 6-node wedge, linear in its triangles and along its axis, with 3 × 2 points.

use super::shape::{GAUSS, Point, ShapeFunctions};
use super::surface::{line_points, triangle_points};

pub(super) struct Wedge;

/// Where the nodes lie along the axis.
const ENDS: [f64; 2] = [-1.0, 1.0];

impl Wedge {
    /// At the barycentric coordinates `triangle` and the place `axis` ∈ [−1, 1]; `share`: the weight as a part of
    /// that of the reference wedge, which is 1.
    #[inline]
    fn point(triangle: [f64; 3], axis: f64, share: f64, x: &[[f64; 3]; 6]) -> Point<3, 6> {
        const SLOPES: [[f64; 2]; 3] = [[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]];
        let mut shape = [0.0; 6];
        let mut local = [[0.0; 3]; 6];
        for (end, &t) in ENDS.iter().enumerate() {
            let along = 0.5 * (1.0 + t * axis);
            for a in 0..3 {
                let [r, s] = SLOPES[a];
                shape[3 * end + a] = triangle[a] * along;
                local[3 * end + a] = [r * along, s * along, 0.5 * t * triangle[a]];
            }
        }
        Point::mapped(shape, &local, share, x)
    }

    /// The points inside the triangle: exact for quadratics.
    fn inner(corner: usize) -> [f64; 3] {
        let mut at = [1.0 / 6.0; 3];
        at[corner] = 2.0 / 3.0;
        at
    }
}

impl ShapeFunctions<3, 6> for Wedge {
    #[inline]
    fn stiffness_points(x: &[[f64; 3]; 6]) -> impl Iterator<Item = Point<3, 6>> {
        (0..6).map(|node| {
            let axis = GAUSS * ENDS[node / 3];
            Self::point(Self::inner(node % 3), axis, 1.0 / 6.0, x)
        })
    }

    /// 6 × 3, as the volume at a point of a distorted one is no constant.
    fn load_points(x: &[[f64; 3]; 6]) -> impl Iterator<Item = Point<3, 6>> {
        triangle_points().flat_map(move |(triangle, share)| {
            line_points().map(|(axis, weight)| Self::point(triangle, axis, share * weight, x))
        })
    }

    fn centre(x: &[[f64; 3]; 6]) -> Point<3, 6> {
        Self::point([1.0 / 3.0; 3], 0.0, 1.0, x)
    }

    /// The function linear in the triangle times linear along the axis that is one at this point and zero at the
    /// others, taken at the corner.
    fn extrapolation(corner: usize, point: usize) -> f64 {
        let triangle = if corner % 3 == point % 3 {
            5.0 / 3.0
        } else {
            -1.0 / 3.0
        };
        let r3 = 3f64.sqrt();
        triangle * 0.5 * (1.0 + r3 * ENDS[corner / 3] * ENDS[point / 3])
    }
}
