//! The bilinear quadrilateral with 2 × 2 Gauss points.

use super::shape::{GAUSS, Point, ShapeFunctions};

pub(crate) struct Quad;

/// Corners of the reference square, counter-clockwise; the Gauss points lie beside them.
const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

impl Quad {
    /// The shape functions and their derivatives at a point of the reference square.
    #[inline]
    pub(crate) fn shapes(xi: [f64; 2]) -> ([f64; 4], [[f64; 2]; 4]) {
        let mut shape = [0.0; 4];
        let mut local = [[0.0; 2]; 4];
        for a in 0..4 {
            let [s, t] = CORNERS[a];
            let (fs, ft) = (1.0 + s * xi[0], 1.0 + t * xi[1]);
            shape[a] = 0.25 * fs * ft;
            local[a] = [0.25 * s * ft, 0.25 * t * fs];
        }
        (shape, local)
    }

    #[inline]
    fn point(xi: [f64; 2], x: &[[f64; 2]; 4]) -> Point<2, 4> {
        let (shape, local) = Self::shapes(xi);
        let mut jacobian = [[0.0; 2]; 2];
        for a in 0..4 {
            for i in 0..2 {
                for j in 0..2 {
                    jacobian[i][j] += local[a][j] * x[a][i];
                }
            }
        }
        let [[a, b], [c, d]] = jacobian;
        let det = a * d - b * c;
        let inverse = 1.0 / det;
        Point {
            shape,
            gradient: local.map(|[s, t]| [(d * s - c * t) * inverse, (a * t - b * s) * inverse]),
            weight: det,
        }
    }
}

impl ShapeFunctions<2, 4> for Quad {
    #[inline]
    fn stiffness_points(x: &[[f64; 2]; 4]) -> impl Iterator<Item = Point<2, 4>> {
        (CORNERS.iter()).map(|corner| Self::point(corner.map(|v| v * GAUSS), x))
    }

    fn load_points(x: &[[f64; 2]; 4]) -> impl Iterator<Item = Point<2, 4>> {
        Self::stiffness_points(x)
    }

    fn centre(x: &[[f64; 2]; 4]) -> Point<2, 4> {
        Self::point([0.0, 0.0], x)
    }

    /// The bilinear function that is one at this Gauss point and zero at the others, taken at the corner.
    fn extrapolation(corner: usize, point: usize) -> f64 {
        let (at, [s, t]) = (CORNERS[corner], CORNERS[point]);
        let r3 = 3f64.sqrt();
        0.25 * (1.0 + r3 * s * at[0]) * (1.0 + r3 * t * at[1])
    }
}
