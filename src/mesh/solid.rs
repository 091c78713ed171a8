//! The geometry of space: volumes of elements, areas and normals of faces.

use super::vector::{cross, dot, length, minus, unit};
use super::{ElementKind, Topology};

/// The place of the lower Gauss point of two on (0, 1), which is (1 − 1/√3)/2.
const GAUSS: f64 = 0.211_324_865_405_187_1;

/// Edges of a hexahedron along each axis, at the lower and the upper end of the other two, the first of these faster.
const EDGES: [[[usize; 2]; 4]; 3] = [
    [[0, 1], [3, 2], [4, 5], [7, 6]],
    [[0, 3], [1, 2], [4, 7], [5, 6]],
    [[0, 4], [1, 5], [3, 7], [2, 6]],
];

/// The volume that three edges span.
fn det([a, b, c]: [[f64; 3]; 3]) -> f64 {
    dot(cross(a, b), c)
}

/// a + s (b − a).
fn between(a: [f64; 3], b: [f64; 3], s: f64) -> [f64; 3] {
    std::array::from_fn(|c| a[c] + s * (b[c] - a[c]))
}

/// The determinant of the Jacobian of a hexahedron at a point of the unit cube.
fn of_hexahedron(x: &[[f64; 3]], at: [f64; 3]) -> f64 {
    det(std::array::from_fn(|axis| {
        let [p, q, r, s] = EDGES[axis].map(|[a, b]| minus(x[b], x[a]));
        let [u, v] = [[at[1], at[2]], [at[0], at[2]], [at[0], at[1]]][axis];
        between(between(p, q, u), between(r, s, u), v)
    }))
}

/// That of a wedge above or below the corner of a triangle, at a place of (0, 1) along the axis.
fn of_wedge(x: &[[f64; 3]], corner: usize, at: f64) -> f64 {
    let [a, b, c] = [0, 1, 2].map(|k| (corner + k) % 3);
    let side = |to: usize| between(minus(x[to], x[a]), minus(x[3 + to], x[3 + a]), at);
    det([side(b), side(c), minus(x[3 + a], x[a])])
}

/// The points of a cube that have these coordinates.
fn grid<const N: usize>(of: [f64; N]) -> impl Iterator<Item = [f64; 3]> {
    (of.into_iter()).flat_map(move |r| {
        (of.into_iter()).flat_map(move |s| of.into_iter().map(move |t| [r, s, t]))
    })
}

/// Space: facets are faces; one with three corners names the last of them twice.
impl Topology<3> for ElementKind {
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

    /// At corners, in the middle of edges, faces and the element, and at Gauss points, where the weights are made of
    /// them.
    fn determinants(self, x: &[[f64; 3]]) -> impl Iterator<Item = f64> {
        let levels: &[f64] = match self {
            Self::Wedge => &[0.0, GAUSS, 0.5, 1.0 - GAUSS, 1.0],
            _ => &[],
        };
        let wedge =
            (0..3).flat_map(move |corner| levels.iter().map(move |&t| of_wedge(x, corner, t)));
        let all = grid([0.0, 0.5, 1.0]).chain(grid([GAUSS, 1.0 - GAUSS]));
        let hexahedron = all
            .take_while(move |_| self == Self::Hexahedron)
            .map(|at| of_hexahedron(x, at));
        let tetrahedron =
            (self == Self::Tetrahedron).then(|| det([1, 2, 3].map(|a| minus(x[a], x[0]))));
        wedge.chain(hexahedron).chain(tetrahedron)
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
        if let [a, b, c] = *x {
            let twice = cross(minus(b, a), minus(c, a));
            return (0.5 * length(twice), unit(twice));
        }
        // 2 × 2 Gauss points on the bilinear surface; ∫ n ds is half the product of the diagonals, however warped it is.
        let [p, q, r, s] = [[0, 1], [3, 2], [0, 3], [1, 2]].map(|[a, b]| minus(x[b], x[a]));
        let points = [GAUSS, 1.0 - GAUSS];
        let spans =
            points.map(|u| points.map(|v| length(cross(between(p, q, v), between(r, s, u)))));
        let normal = cross(minus(x[2], x[0]), minus(x[3], x[1]));
        (
            0.25 * spans.as_flattened().iter().sum::<f64>(),
            unit(normal),
        )
    }
}
