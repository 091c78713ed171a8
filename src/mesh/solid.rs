//! The geometry of space: volumes of elements, areas and normals of faces.

use super::vector::{cross, dot, length, minus, unit};
use super::{Kind, Topology};

/// Six times the signed volume of the tetrahedron a, b, c, d.
fn det([a, b, c, d]: [[f64; 3]; 4]) -> f64 {
    dot(cross(minus(b, a), minus(c, a)), minus(d, a))
}

/// Each corner of a kind, and those that edges lead to from there: right-handed.
const fn frames(kind: Kind) -> &'static [[usize; 4]] {
    match kind {
        Kind::Tetrahedron => &[[0, 1, 2, 3]],
        Kind::Hexahedron => &[
            [0, 1, 3, 4],
            [1, 2, 0, 5],
            [2, 3, 1, 6],
            [3, 0, 2, 7],
            [4, 7, 5, 0],
            [5, 4, 6, 1],
            [6, 5, 7, 2],
            [7, 6, 4, 3],
        ],
        Kind::Wedge => &[
            [0, 1, 2, 3],
            [1, 2, 0, 4],
            [2, 0, 1, 5],
            [3, 5, 4, 0],
            [4, 3, 5, 1],
            [5, 4, 3, 2],
        ],
        Kind::Triangle | Kind::Quad => &[],
    }
}

/// Space: facets are faces; one with three corners names the last of them twice.
impl Topology<3> for Kind {
    type Nodes = [u32; 8];
    type Facet = [u32; 4];

    /// By Gauss's theorem from the faces, which are bilinear: ∫ x·n ds / 3.
    fn signed_measure(self, x: &[[f64; 3]]) -> f64 {
        let faces = self.facets().iter().map(|face| {
            let corner = |a: usize| minus(x[face[a % face.len()]], x[0]);
            // A quadrilateral is, as to its volume, the mean of what either diagonal makes of it.
            let fans = match face.len() {
                3 => 1,
                _ => 2,
            };
            let fan = |first: usize| -> f64 {
                (first + 2..first + face.len())
                    .map(|a| dot(cross(corner(first), corner(a - 1)), corner(a)))
                    .sum()
            };
            (0..fans).map(fan).sum::<f64>() / fans as f64
        });
        faces.sum::<f64>() / 6.0
    }

    fn corners(self, x: &[[f64; 3]]) -> impl Iterator<Item = f64> {
        frames(self)
            .iter()
            .map(move |frame| det(frame.map(|a| x[a])))
    }

    fn turn(self, nodes: &mut [u32]) {
        let half = nodes.len() / 2;
        match self {
            Self::Tetrahedron => nodes.swap(1, 2),
            // Bottom and top change places.
            _ => nodes.rotate_left(half),
        }
    }

    fn facet_normal(x: &[[f64; 3]]) -> (f64, [f64; 3]) {
        let triangle = |a: usize, b: usize, c: usize| cross(minus(x[b], x[a]), minus(x[c], x[a]));
        if x.len() == 3 {
            let twice = triangle(0, 1, 2);
            return (0.5 * length(twice), unit(twice));
        }
        // The diagonals span twice ∫ n ds, however warped it is; the area is the mean of both ways to fold it.
        let twice = cross(minus(x[2], x[0]), minus(x[3], x[1]));
        let folds = [
            triangle(0, 1, 2),
            triangle(0, 2, 3),
            triangle(0, 1, 3),
            triangle(1, 2, 3),
        ];
        (0.25 * folds.map(length).iter().sum::<f64>(), unit(twice))
    }
}
