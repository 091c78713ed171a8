//! The geometry of the plane: areas of elements, lengths and normals of edges.

use super::vector::{length, minus};
use super::{ElementKind, Topology};

/// Twice the signed area of the triangle a, b, c.
fn cross(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

/// The plane: facets are edges, from one node to the other.
impl Topology<2> for ElementKind {
    type Nodes = [u32; 4];
    type Facet = [u32; 2];

    fn signed_measure(self, x: &[[f64; 2]]) -> f64 {
        let fan = (2..x.len()).map(|a| cross(x[0], x[a - 1], x[a]));
        0.5 * fan.sum::<f64>()
    }

    fn determinants(self, x: &[[f64; 2]]) -> impl Iterator<Item = f64> {
        let corner = |a: usize| x[a % x.len()];
        (0..x.len()).map(move |a| cross(corner(a), corner(a + 1), corner(a + 2)))
    }

    fn turn(self, nodes: &mut [u32]) {
        nodes.reverse();
    }

    fn facet_normal(x: &[[f64; 2]]) -> (f64, [f64; 2]) {
        let [dx, dy] = minus(x[1], x[0]);
        let length = length([dx, dy]);
        (length, [dy / length, -dx / length])
    }
}
