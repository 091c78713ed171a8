//! Integration over the facets of elements: edges in the plane, faces in space.

use super::quad::Quad;
use crate::mesh::vector::{cross, length, minus, unit};
use crate::mesh::{ElementKind, Topology};

/// An integration point of a facet.
#[derive(Clone, Copy, Debug)]
pub struct FacetPoint<const D: usize> {
    /// Where it lies.
    pub place: [f64; D],
    /// The outward unit normal there.
    pub normal: [f64; D],
    /// The shape functions of the nodes of the facet; zeros behind them.
    pub shape: [f64; 4],
    /// The weight, with the length (area) and the thickness in it.
    pub weight: f64,
}

/// Three Gauss points on an edge: place, the shape functions of its two nodes, weight (they sum to 1).
pub(crate) fn edge_points(ends: [[f64; 2]; 2]) -> [([f64; 2], [f64; 2], f64); 3] {
    const OUTER: f64 = 0.774_596_669_241_483_4; // √(3/5)
    [(-OUTER, 5.0 / 18.0), (0.0, 8.0 / 18.0), (OUTER, 5.0 / 18.0)].map(|(s, weight)| {
        let shape = [0.5 * (1.0 - s), 0.5 * (1.0 + s)];
        let place = std::array::from_fn(|c| shape[0] * ends[0][c] + shape[1] * ends[1][c]);
        (place, shape, weight)
    })
}

/// Three Gauss points on (−1, 1) with their weights, which sum to 1.
pub(super) fn line_points() -> [(f64, f64); 3] {
    edge_points([[-1.0, 0.0], [1.0, 0.0]]).map(|([s, _], _, weight)| (s, weight))
}

/// Six points in a triangle, exact to degree 4: barycentric coordinates and weights, which sum to 1.
pub(crate) fn triangle_points() -> impl Iterator<Item = ([f64; 3], f64)> {
    TRIANGLE.into_iter().flat_map(|(near, weight)| {
        (0..3).map(move |corner| {
            let mut at = [near; 3];
            at[corner] = 1.0 - 2.0 * near;
            (at, weight)
        })
    })
}

/// The points of an edge from x₀ to x₁.
pub(super) fn of_edge(x: &[[f64; 2]], thickness: f64, mut take: impl FnMut(&FacetPoint<2>)) {
    let (length, normal) = <ElementKind as Topology<2>>::facet_normal(x);
    for (place, [a, b], weight) in edge_points([x[0], x[1]]) {
        take(&FacetPoint {
            place,
            normal,
            shape: [a, b, 0.0, 0.0],
            weight: thickness * length * weight,
        });
    }
}

/// The points of a face: six on a triangle, exact to degree 4, 3 × 3 Gauss points on a quadrilateral, with the normal
/// and the area of its bilinear surface at each.
pub(super) fn of_face(x: &[[f64; 3]], thickness: f64, mut take: impl FnMut(&FacetPoint<3>)) {
    let mut point = |shape: [f64; 4], surface: [f64; 3], weight: f64| {
        let place = |c: usize| shape.iter().zip(x).map(|(shape, x)| shape * x[c]).sum();
        take(&FacetPoint {
            place: std::array::from_fn(place),
            normal: unit(surface),
            shape,
            weight: thickness * length(surface) * weight,
        });
    };
    if let [a, b, c] = *x {
        let surface = cross(minus(b, a), minus(c, a));
        for ([a, b, c], weight) in triangle_points() {
            point([a, b, c, 0.0], surface, 0.5 * weight);
        }
        return;
    }
    for (s, along) in line_points() {
        for (t, across) in line_points() {
            let (shape, local) = Quad::shapes([s, t]);
            // ∂x/∂s and ∂x/∂t.
            let tangent = |way: usize| -> [f64; 3] {
                std::array::from_fn(|c| (0..4).map(|a| local[a][way] * x[a][c]).sum())
            };
            // The reference square has the area 4.
            point(shape, cross(tangent(0), tangent(1)), 4.0 * along * across);
        }
    }
}

/// Dunavant's rule of degree 4 for triangles (Int. J. Numer. Meth. Eng. 21, 1985): the two smaller barycentric
/// coordinates of three points each, or the two larger ones, and the weight as a part of the area.
const TRIANGLE: [(f64, f64); 2] = [
    (0.091_576_213_509_770_7, 0.109_951_743_655_321_9),
    (0.445_948_490_915_964_9, 0.223_381_589_678_011_5),
];
