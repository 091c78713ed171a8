//! Shape functions and integration points.

/// An integration point of an element: shape functions, their gradients, and the weight with the area.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub shape: [f64; 4],
    pub gradient: [[f64; 2]; 4],
    pub weight: f64,
}

impl Point {
    /// Where the point lies.
    pub fn place(&self, x: &[[f64; 2]; 4]) -> [f64; 2] {
        let mut place = [0.0; 2];
        for (shape, x) in self.shape.iter().zip(x) {
            place[0] += shape * x[0];
            place[1] += shape * x[1];
        }
        place
    }
}

/// 1/√3: the Gauss points of the 2-point rule on (−1, 1).
const GAUSS: f64 = 0.577_350_269_189_625_8;

/// Corners of the reference square, counter-clockwise.
pub(super) const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// The integration points of an element with `n` nodes: 2 × 2 Gauss points of a quadrilateral; of a
/// triangle, whose gradients are constant, the three midpoints of the edges (exact for quadratics).
pub(super) fn integration_points(n: usize, x: &[[f64; 2]; 4]) -> impl Iterator<Item = Point> + '_ {
    let count = if n == 3 { 3 } else { 4 };
    (0..count).map(move |i| {
        if n == 3 {
            triangle_point(i, x)
        } else {
            quad_point(CORNERS[i].map(|v| v * GAUSS), x)
        }
    })
}

/// The points that integrate the stiffness exactly enough: one for a triangle, 2 × 2 for a quadrilateral.
#[inline]
pub(super) fn stiffness_points(n: usize, x: &[[f64; 2]; 4]) -> impl Iterator<Item = Point> + '_ {
    let count = if n == 3 { 1 } else { 4 };
    (0..count).map(move |i| {
        if n == 3 {
            let mut point = triangle_point(0, x);
            point.weight *= 3.0;
            point
        } else {
            quad_point(CORNERS[i].map(|v| v * GAUSS), x)
        }
    })
}

fn triangle_point(i: usize, x: &[[f64; 2]; 4]) -> Point {
    let [a, b, c] = [x[0], x[1], x[2]];
    let det = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    let mut shape = [0.5, 0.5, 0.5, 0.0];
    shape[i] = 0.0;
    Point {
        shape,
        gradient: [
            [(b[1] - c[1]) / det, (c[0] - b[0]) / det],
            [(c[1] - a[1]) / det, (a[0] - c[0]) / det],
            [(a[1] - b[1]) / det, (b[0] - a[0]) / det],
            [0.0; 2],
        ],
        weight: det / 6.0,
    }
}

#[inline]
pub(super) fn quad_point(xi: [f64; 2], x: &[[f64; 2]; 4]) -> Point {
    let mut shape = [0.0; 4];
    let mut local = [[0.0; 2]; 4];
    let mut jacobian = [[0.0; 2]; 2];
    for a in 0..4 {
        let [s, t] = CORNERS[a];
        let (fs, ft) = (1.0 + s * xi[0], 1.0 + t * xi[1]);
        shape[a] = 0.25 * fs * ft;
        local[a] = [0.25 * s * ft, 0.25 * t * fs];
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

/// Three Gauss points on an edge: place, the shape functions of its two nodes, weight (they sum to 1).
pub(crate) fn edge_points(ends: [[f64; 2]; 2]) -> [([f64; 2], [f64; 2], f64); 3] {
    const OUTER: f64 = 0.774_596_669_241_483_4; // √(3/5)
    [(-OUTER, 5.0 / 18.0), (0.0, 8.0 / 18.0), (OUTER, 5.0 / 18.0)].map(|(s, weight)| {
        let shape = [0.5 * (1.0 - s), 0.5 * (1.0 + s)];
        let place = std::array::from_fn(|c| shape[0] * ends[0][c] + shape[1] * ends[1][c]);
        (place, shape, weight)
    })
}
