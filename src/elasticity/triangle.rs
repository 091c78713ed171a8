//! The 3-node triangle: linear shape functions, constant gradients.

use super::shape::{Point, ShapeFunctions};

pub(super) struct Triangle;

impl Triangle {
    /// `sixths`: the weight in sixths of twice the area.
    #[inline]
    fn point(shape: [f64; 3], sixths: f64, x: &[[f64; 2]; 3]) -> Point<2, 3> {
        let [a, b, c] = *x;
        let det = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        Point {
            shape,
            gradient: [
                [(b[1] - c[1]) / det, (c[0] - b[0]) / det],
                [(c[1] - a[1]) / det, (a[0] - c[0]) / det],
                [(a[1] - b[1]) / det, (b[0] - a[0]) / det],
            ],
            weight: det / 6.0 * sixths,
        }
    }
}

impl ShapeFunctions<2, 3> for Triangle {
    #[inline]
    fn stiffness_points(x: &[[f64; 2]; 3]) -> impl Iterator<Item = Point<2, 3>> {
        std::iter::once(Self::centre(x))
    }

    /// The midpoints of the edges: exact for quadratics.
    fn load_points(x: &[[f64; 2]; 3]) -> impl Iterator<Item = Point<2, 3>> {
        [[0.0, 0.5, 0.5], [0.5, 0.0, 0.5], [0.5, 0.5, 0.0]]
            .into_iter()
            .map(|shape| Self::point(shape, 1.0, x))
    }

    #[inline]
    fn centre(x: &[[f64; 2]; 3]) -> Point<2, 3> {
        Self::point([1.0 / 3.0; 3], 3.0, x)
    }

    fn extrapolation(_: usize, _: usize) -> f64 {
        1.0
    }
}
