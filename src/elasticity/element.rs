//! Which type of element a kind is, and what is done with elements of whichever type.

use super::hexahedron::Hexahedron;
use super::quad::Quad;
use super::shape::ShapeFunctions;
use super::surface::{self, FacetPoint};
use super::tetrahedron::Tetrahedron;
use super::triangle::Triangle;
use super::wedge::Wedge;
use crate::mesh::{ElementKind, Topology};

/// Something to do with an element of whichever type.
pub trait Visit<const D: usize> {
    /// What comes of it.
    type Output;

    /// Does it, with an element of the type E.
    fn visit<E: ShapeFunctions<D, N>, const N: usize>(self) -> Self::Output;
}

/// Implemented by [`ElementKind`] for the dimensions in which there are elements.
pub trait Elements<const D: usize>: Topology<D> {
    /// Turns a kind into its type: the only place that does.
    ///
    /// # Panics
    /// If it is a kind of another dimension, of which no [`crate::mesh::Element`] can be.
    fn with<V: Visit<D>>(self, visit: V) -> V::Output;

    /// Hands `take` the points that integrate over a facet with its corners at x a product of a shape function and a
    /// load that is quadratic in the place; `thickness` is a factor of all weights.
    fn facet_points(x: &[[f64; D]], thickness: f64, take: impl FnMut(&FacetPoint<D>));
}

impl Elements<2> for ElementKind {
    #[inline]
    fn with<V: Visit<2>>(self, visit: V) -> V::Output {
        match self {
            Self::Triangle => visit.visit::<Triangle, 3>(),
            Self::Quad => visit.visit::<Quad, 4>(),
            _ => panic!("{self:?} is no element of the plane"),
        }
    }

    fn facet_points(x: &[[f64; 2]], thickness: f64, take: impl FnMut(&FacetPoint<2>)) {
        surface::of_edge(x, thickness, take);
    }
}

impl Elements<3> for ElementKind {
    #[inline]
    fn with<V: Visit<3>>(self, visit: V) -> V::Output {
        match self {
            Self::Tetrahedron => visit.visit::<Tetrahedron, 4>(),
            Self::Hexahedron => visit.visit::<Hexahedron, 8>(),
            Self::Wedge => visit.visit::<Wedge, 6>(),
            _ => panic!("{self:?} is no element of space"),
        }
    }

    fn facet_points(x: &[[f64; 3]], thickness: f64, take: impl FnMut(&FacetPoint<3>)) {
        surface::of_face(x, thickness, take);
    }
}
