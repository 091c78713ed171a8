//! The 4-node tetrahedron: linear shape functions, constant gradients.

use super::shape::{Point, ShapeFunctions};
use crate::mesh::vector::{cross, dot, minus};

pub(super) struct Tetrahedron;

/// (5 − √5)/20: the four points (a, a, a, 1 − 3a) in barycentric coordinates integrate quadratics exactly.
const NEAR: f64 = 0.138_196_601_125_010_5;

impl Tetrahedron {
    /// `share`: the weight as a part of the volume.
    #[inline]
    fn point(shape: [f64; 4], share: f64, x: &[[f64; 3]; 4]) -> Point<3, 4> {
        let [p, q, r] = [1, 2, 3].map(|a| minus(x[a], x[0]));
        let det = dot(cross(p, q), r);
        let gradients = [cross(q, r), cross(r, p), cross(p, q)].map(|g| g.map(|v| v / det));
        let first = std::array::from_fn(|c| -gradients.iter().map(|g| g[c]).sum::<f64>());
        Point {
            shape,
            gradient: [first, gradients[0], gradients[1], gradients[2]],
            weight: det / 6.0 * share,
        }
    }
}

impl ShapeFunctions<3, 4> for Tetrahedron {
    #[inline]
    fn stiffness_points(x: &[[f64; 3]; 4]) -> impl Iterator<Item = Point<3, 4>> {
        std::iter::once(Self::centre(x))
    }

    /// Four points: exact for quadratics.
    fn load_points(x: &[[f64; 3]; 4]) -> impl Iterator<Item = Point<3, 4>> {
        (0..4).map(|corner| {
            let mut shape = [NEAR; 4];
            shape[corner] = 1.0 - 3.0 * NEAR;
            Self::point(shape, 0.25, x)
        })
    }

    #[inline]
    fn centre(x: &[[f64; 3]; 4]) -> Point<3, 4> {
        Self::point([0.25; 4], 1.0, x)
    }

    fn extrapolation(_: usize, _: usize) -> f64 {
        1.0
    }
}
