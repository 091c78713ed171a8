//! The trilinear hexahedron with 2 × 2 × 2 Gauss points.

use super::shape::{GAUSS, Point, ShapeFunctions};
use super::surface::line_points;

pub(super) struct Hexahedron;

/// Corners of the reference cube in the order of the nodes; the Gauss points lie beside them.
const CORNERS: [[f64; 3]; 8] = [
    [-1.0, -1.0, -1.0],
    [1.0, -1.0, -1.0],
    [1.0, 1.0, -1.0],
    [-1.0, 1.0, -1.0],
    [-1.0, -1.0, 1.0],
    [1.0, -1.0, 1.0],
    [1.0, 1.0, 1.0],
    [-1.0, 1.0, 1.0],
];

impl Hexahedron {
    #[inline]
    fn point(xi: [f64; 3], weight: f64, x: &[[f64; 3]; 8]) -> Point<3, 8> {
        let mut shape = [0.0; 8];
        let mut local = [[0.0; 3]; 8];
        for a in 0..8 {
            let [r, s, t] = CORNERS[a];
            let [fr, fs, ft] = [1.0 + r * xi[0], 1.0 + s * xi[1], 1.0 + t * xi[2]];
            shape[a] = 0.125 * fr * fs * ft;
            local[a] = [
                0.125 * r * fs * ft,
                0.125 * s * fr * ft,
                0.125 * t * fr * fs,
            ];
        }
        Point::mapped(shape, &local, weight, x)
    }
}

impl ShapeFunctions<3, 8> for Hexahedron {
    #[inline]
    fn stiffness_points(x: &[[f64; 3]; 8]) -> impl Iterator<Item = Point<3, 8>> {
        (CORNERS.iter()).map(|corner| Self::point(corner.map(|v| v * GAUSS), 1.0, x))
    }

    /// 3 × 3 × 3: the volume at a point of a distorted one is of degree 2 along each axis.
    fn load_points(x: &[[f64; 3]; 8]) -> impl Iterator<Item = Point<3, 8>> {
        (0..27).map(|number| {
            let at = [number % 3, number / 3 % 3, number / 9].map(|k| line_points()[k]);
            let weight = at.iter().fold(8.0, |product, (_, weight)| product * weight);
            Self::point(at.map(|(place, _)| place), weight, x)
        })
    }

    fn centre(x: &[[f64; 3]; 8]) -> Point<3, 8> {
        Self::point([0.0; 3], 8.0, x)
    }

    /// The trilinear function that is one at this Gauss point and zero at the others, taken at the corner.
    fn extrapolation(corner: usize, point: usize) -> f64 {
        let (at, from) = (CORNERS[corner], CORNERS[point]);
        let r3 = 3f64.sqrt();
        (0..3).fold(0.125, |product, c| product * (1.0 + r3 * at[c] * from[c]))
    }
}
