//! What a type of element has to say: shape functions, integration points, stress recovery.

use super::quad::Quad;
use super::triangle::Triangle;
use crate::mesh::{Kind, Topology};

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

/// A type of element with N nodes in D dimensions; `x` are their coordinates.
pub trait Element<const D: usize, const N: usize> {
    /// The points that integrate the stiffness exactly enough, and whose stresses are the most accurate.
    fn stiffness_points(x: &[[f64; D]; N]) -> impl Iterator<Item = Point<D, N>>;

    /// The points that integrate a load that is linear in the place.
    fn load_points(x: &[[f64; D]; N]) -> impl Iterator<Item = Point<D, N>>;

    /// Its middle.
    fn centre(x: &[[f64; D]; N]) -> Point<D, N>;

    /// Stress recovery: how much the stress at a corner takes from that at one of the stiffness points.
    fn extrapolation(corner: usize, point: usize) -> f64;
}

/// Something to do with an element of whichever type.
pub trait Visit<const D: usize> {
    /// What comes of it.
    type Output;

    /// Does it, with an element of the type E.
    fn visit<E: Element<D, N>, const N: usize>(self) -> Self::Output;
}

/// Implemented by [`Kind`] for the dimensions in which there are elements.
pub trait Elements<const D: usize>: Topology<D> {
    /// Turns a kind into its type: the only place that does.
    fn with<V: Visit<D>>(self, visit: V) -> V::Output;
}

impl Elements<2> for Kind {
    #[inline]
    fn with<V: Visit<2>>(self, visit: V) -> V::Output {
        match self {
            Self::Triangle => visit.visit::<Triangle, 3>(),
            Self::Quad => visit.visit::<Quad, 4>(),
        }
    }
}
