//! Edges with two and with three nodes, the facets of the plane; the third node is the middle.

use super::rules::LINE4;
use super::{FacetPoint, FacetShape, linear, product, quadratic, sum, tangents};
use crate::mesh::vector::{length, unit};

/// The shape functions of an edge with its nodes at x, the tangent ∂x/∂ξ and the place at a point of (−1, 1).
pub(crate) fn edge_at(x: &[[f64; 2]], xi: f64) -> FacetShape<1, 2> {
    let (mut shape, mut local) = ([0.0; 9], [[0.0]; 9]);
    if x.len() == 2 {
        let (of_nodes, slopes) = product(&[[-1.0], [1.0]], linear, [xi]);
        shape[..2].copy_from_slice(&of_nodes);
        local[..2].copy_from_slice(&slopes);
    } else {
        let (of_nodes, slopes) = product(&[[-1.0], [1.0], [0.0]], quadratic, [xi]);
        shape[..3].copy_from_slice(&of_nodes);
        local[..3].copy_from_slice(&slopes);
    }
    FacetShape {
        place: sum(&shape, x),
        tangents: tangents(&local, x),
        shape,
        local,
    }
}

/// Passes the integration points of an edge with its nodes at x.
pub(crate) fn points(x: &[[f64; 2]], mut take: impl FnMut(&FacetPoint<2>)) {
    for (xi, weight) in LINE4 {
        let at = edge_at(x, xi);
        let [[dx, dy]] = at.tangents;
        take(&FacetPoint {
            place: at.place,
            normal: unit([dy, -dx]),
            shape: at.shape,
            weight: 2.0 * weight * length([dx, dy]),
        });
    }
}
