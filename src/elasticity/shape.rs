//! What a type of element has to say: shape functions, integration points, stress recovery.

use crate::mesh::vector::{cross, dot};

/// 1/√3: the Gauss points of the 2-point rule on (−1, 1).
pub(super) const GAUSS: f64 = 0.577_350_269_189_625_8;

/// An integration point of an element with N nodes.
#[derive(Clone, Copy, Debug)]
pub struct Point<const D: usize, const N: usize> {
    /// The shape functions.
    pub shape: [f64; N],
    /// Their gradients.
    pub gradient: [[f64; D]; N],
    /// The weight, with the area (volume) in it.
    pub weight: f64,
}

impl<const D: usize, const N: usize> Point<D, N> {
    pub(super) const ZERO: Self = Self {
        shape: [0.0; N],
        gradient: [[0.0; D]; N],
        weight: 0.0,
    };

    /// Where the point lies.
    pub fn place(&self, x: &[[f64; D]; N]) -> [f64; D] {
        std::array::from_fn(|c| {
            self.shape
                .iter()
                .zip(x)
                .map(|(shape, x)| shape * x[c])
                .sum()
        })
    }
}

impl<const N: usize> Point<3, N> {
    /// The point of the element with its nodes at x where the shape functions have these values and derivatives by
    /// the reference coordinates; `weight` is that of the reference element.
    #[inline]
    pub(super) fn mapped(
        shape: [f64; N],
        local: &[[f64; 3]; N],
        weight: f64,
        x: &[[f64; 3]; N],
    ) -> Self {
        // Columns of the Jacobian: ∂x/∂ξⱼ.
        let mut along = [[0.0; 3]; 3];
        for (local, x) in local.iter().zip(x) {
            for (along, slope) in along.iter_mut().zip(local) {
                for (along, x) in along.iter_mut().zip(x) {
                    *along += slope * x;
                }
            }
        }
        let [p, q, r] = along;
        let rows = [cross(q, r), cross(r, p), cross(p, q)];
        let det = dot(rows[0], p);
        let inverse = 1.0 / det;
        Self {
            shape,
            gradient: local.map(|slope| {
                std::array::from_fn(|c| {
                    (slope[0] * rows[0][c] + slope[1] * rows[1][c] + slope[2] * rows[2][c])
                        * inverse
                })
            }),
            weight: det * weight,
        }
    }
}

/// A type of element with N nodes in D dimensions; `x` are their coordinates.
pub trait ShapeFunctions<const D: usize, const N: usize> {
    /// The points that integrate the stiffness exactly enough, and whose stresses are the most accurate.
    fn stiffness_points(x: &[[f64; D]; N]) -> impl Iterator<Item = Point<D, N>>;

    /// The points that integrate a load that is linear in the place.
    fn load_points(x: &[[f64; D]; N]) -> impl Iterator<Item = Point<D, N>>;

    /// Its middle.
    fn centre(x: &[[f64; D]; N]) -> Point<D, N>;

    /// Stress recovery: how much the stress at a corner takes from that at one of the stiffness points.
    fn extrapolation(corner: usize, point: usize) -> f64;
}
