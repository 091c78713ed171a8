//! Shape functions of elements: a file for each shape, with its kinds of both orders.
//!
//! A kind defines the positions of its nodes in the reference element, its shape functions, and its integration points.
//! All operations on elements are written once over [`ShapeFunctions`] and reaches the type of a kind through
//! [`super::Topology::with`].

mod hexahedron;
mod line;
mod pyramid;
mod quad;
pub(super) mod rules;
#[cfg(test)]
mod tests;
mod tetrahedron;
mod triangle;
mod wedge;

pub(crate) use hexahedron::{Hexahedron, Hexahedron20, Hexahedron27};
pub(crate) use line::{edge_at, points as edge_integration};
pub(crate) use pyramid::Pyramid;
pub(crate) use quad::{Quad, Quad8, Quad9};
pub(crate) use rules::{LINE5, LINE8, edge_points, triangle_points};
pub(crate) use tetrahedron::{Tetrahedron, Tetrahedron10};
pub(crate) use triangle::{Triangle, Triangle6};
pub(crate) use wedge::{Wedge, Wedge15, Wedge18};

use super::ElementKind;
use super::vector::{cross, dot, minus};

/// A type of element with N nodes in D dimensions, whose stiffness is integrated with Q points.
pub trait ShapeFunctions<const D: usize, const N: usize, const Q: usize> {
    /// The positions of the nodes in the reference element.
    const NODES: [[f64; D]; N];

    /// The middle of the reference element.
    const CENTRE: [f64; D];

    /// The number of functions for the projected dilatation of a nearly incompressible element: 0, no projection; 1, its
    /// mean; 1 + D, linear functions.
    const DILATATION_MODES: usize;

    /// The shape functions at a point of the reference element, and their derivatives by its coordinates.
    fn shapes(xi: [f64; D]) -> ([f64; N], [[f64; D]; N]);

    /// Points and weights that integrate the stiffness of an element with straight sides exactly enough.
    fn stiffness_rule() -> [([f64; D], f64); Q];

    /// Points and weights that integrate shape functions times a quadratic load, and the measure of a curved element.
    fn load_rule() -> impl Iterator<Item = ([f64; D], f64)>;

    /// The points where stresses are most accurate.
    fn stress_points() -> impl Iterator<Item = [f64; D]>;

    /// Stress recovery: the weight of the stress at one of the stress points in the stress at `at`.
    fn extrapolation(at: [f64; D], point: usize) -> f64;

    /// The data of the element at a point of the reference element; `x` are its nodes, `weight` the weight of the
    /// point.
    #[inline]
    fn at(xi: [f64; D], weight: f64, x: &[[f64; D]; N]) -> Point<D, N> {
        let (shape, local) = Self::shapes(xi);
        Point::mapped(shape, &local, weight, x)
    }

    /// The points of [`Self::stiffness_rule`] in an element.
    #[inline]
    fn stiffness_points(x: &[[f64; D]; N]) -> [Point<D, N>; Q] {
        Self::stiffness_rule().map(|(xi, weight)| Self::at(xi, weight, x))
    }

    /// The points of [`Self::load_rule`] in an element.
    fn load_points(x: &[[f64; D]; N]) -> impl Iterator<Item = Point<D, N>> {
        Self::load_rule().map(|(xi, weight)| Self::at(xi, weight, x))
    }
}

/// A point of an element with N nodes.
#[derive(Clone, Copy, Debug)]
pub struct Point<const D: usize, const N: usize> {
    /// The shape functions.
    pub shape: [f64; N],
    /// Their gradients.
    pub gradient: [[f64; D]; N],
    /// The weight, with the area (volume) in it; negative where the element is inside out.
    pub weight: f64,
}

impl<const D: usize, const N: usize> Point<D, N> {
    /// The point of the element with its nodes at x where the shape functions have these values and derivatives by
    /// the reference coordinates; `weight` is that of the reference element.
    #[inline]
    fn mapped(shape: [f64; N], local: &[[f64; D]; N], weight: f64, x: &[[f64; D]; N]) -> Self {
        let (rows, det) = cofactors(tangents(local, x));
        let inverse = 1.0 / det;
        Self {
            shape,
            gradient: local.map(|slope| {
                std::array::from_fn(|c| {
                    (0..D).map(|j| slope[j] * rows[j][c]).sum::<f64>() * inverse
                })
            }),
            weight: det * weight,
        }
    }

    /// The position of the point.
    pub fn place(&self, x: &[[f64; D]; N]) -> [f64; D] {
        sum(&self.shape, x)
    }

    /// The part of div u due to the motion of node a along each axis: its gradient, and the hoop strain where u_x causes
    /// one by `hoop`.
    #[inline]
    pub fn divergence(&self, a: usize, hoop: f64) -> [f64; D] {
        let mut part = self.gradient[a];
        part[0] += hoop * self.shape[a];
        part
    }
}

/// Σ wₐ xₐ.
#[inline]
pub(crate) fn sum<const D: usize>(weights: &[f64], x: &[[f64; D]]) -> [f64; D] {
    std::array::from_fn(|c| weights.iter().zip(x).map(|(w, x)| w * x[c]).sum())
}

/// ∂x/∂ξⱼ, one a row, of nodes at x in D dimensions; the reference element may have fewer. Places count from the first
/// node: far from the origin, products with whole coordinates would lose the digits of the element.
#[inline]
pub(crate) fn tangents<const R: usize, const D: usize>(
    local: &[[f64; R]],
    x: &[[f64; D]],
) -> [[f64; D]; R] {
    derivatives(local, x.iter().map(|at| minus(*at, x[0])))
}

/// Σ ∂φₐ/∂ξⱼ vₐ, one a row.
#[inline]
pub(crate) fn derivatives<const R: usize, const D: usize>(
    local: &[[f64; R]],
    values: impl Iterator<Item = [f64; D]>,
) -> [[f64; D]; R] {
    let mut along = [[0.0; D]; R];
    for (local, x) in local.iter().zip(values) {
        for (along, slope) in along.iter_mut().zip(local) {
            for (along, x) in along.iter_mut().zip(x) {
                *along += slope * x;
            }
        }
    }
    along
}

/// Of the tangents ∂x/∂ξⱼ: det(∂x/∂ξ), and ∂ξⱼ/∂x times that, one a row.
#[inline]
pub(crate) fn cofactors<const D: usize>(along: [[f64; D]; D]) -> ([[f64; D]; D], f64) {
    let mut rows = [[0.0; D]; D];
    match D {
        2 => {
            let ([a, c], [b, d]) = ([along[0][0], along[0][1]], [along[1][0], along[1][1]]);
            [rows[0][0], rows[0][1]] = [d, -b];
            [rows[1][0], rows[1][1]] = [-c, a];
        }
        _ => {
            let of = |j: usize| [along[j % D][0], along[j % D][1], along[j % D][2]];
            for (j, row) in rows.iter_mut().enumerate() {
                row.copy_from_slice(&cross(of(j + 1), of(j + 2)));
            }
        }
    }
    (rows, dot(rows[0], along[0]))
}

/// det(∂x/∂ξ) where the shape functions have these derivatives.
#[inline]
pub(super) fn determinant<const D: usize, const N: usize>(
    local: &[[f64; D]; N],
    x: &[[f64; D]; N],
) -> f64 {
    cofactors(tangents(local, x)).1
}

/// A task for an element of any type.
pub trait Visit<const D: usize> {
    /// The result.
    type Output;

    /// Carries out the task, with an element of the type E.
    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> Self::Output;
}

/// Shape functions from those of lines: the product of the lowest at a node of the reference square or cube. Its
/// coordinates say which: −1, 0 or 1 for the ends and the middle.
#[inline]
fn product<const D: usize, const N: usize>(
    nodes: &[[f64; D]; N],
    of_line: impl Fn(f64, f64) -> [f64; 2],
    xi: [f64; D],
) -> ([f64; N], [[f64; D]; N]) {
    let (mut shape, mut local) = ([0.0; N], [[0.0; D]; N]);
    // Along each axis for the node at −1, 0 and 1.
    let values = xi.map(|xi| [-1.0, 0.0, 1.0].map(|node| of_line(node, xi)));
    for (a, node) in nodes.iter().enumerate() {
        let of: [[f64; 2]; D] = std::array::from_fn(|c| values[c][(node[c] + 1.0) as usize]);
        shape[a] = of.iter().map(|v| v[0]).product();
        local[a] = std::array::from_fn(|j| (0..D).map(|c| of[c][usize::from(c == j)]).product());
    }
    (shape, local)
}

/// The linear function of a line that is 1 at the end −1 or 1 (0 for no other node), and its derivative.
#[inline]
fn linear(node: f64, xi: f64) -> [f64; 2] {
    [0.5 * (1.0 + node * xi), 0.5 * node]
}

/// The quadratic function of a line that is 1 at −1, 0 or 1 and 0 at the other two, and its derivative.
#[inline]
fn quadratic(node: f64, xi: f64) -> [f64; 2] {
    if node == 0.0 {
        [1.0 - xi * xi, -2.0 * xi]
    } else {
        [0.5 * xi * (xi + node), xi + 0.5 * node]
    }
}

/// An integration point of a facet.
#[derive(Clone, Copy, Debug)]
pub struct FacetPoint<const D: usize> {
    /// Its position.
    pub place: [f64; D],
    /// The outward unit normal there.
    pub normal: [f64; D],
    /// The shape functions of the nodes of the facet; zeros behind them.
    pub shape: [f64; 9],
    /// The weight, with the length (area) in it.
    pub weight: f64,
}

/// The kinds of elements of the plane that the faces of solids are, by their numbers of nodes.
///
/// # Panics
/// If no face has so many nodes.
pub(crate) fn face_kind(n_nodes: usize) -> ElementKind {
    match n_nodes {
        3 => ElementKind::Triangle,
        4 => ElementKind::Quad,
        6 => ElementKind::Triangle6,
        8 => ElementKind::Quad8,
        9 => ElementKind::Quad9,
        _ => panic!("no face has {n_nodes} nodes"),
    }
}

/// The data of a facet at a point of its reference element: its shape functions, and the tangents there.
pub(crate) struct FacetShape<const R: usize, const D: usize> {
    pub shape: [f64; 9],
    /// Its derivatives by the coordinates of the reference element.
    pub local: [[f64; R]; 9],
    pub place: [f64; D],
    pub tangents: [[f64; D]; R],
}

impl<const R: usize, const D: usize> FacetShape<R, D> {
    /// The derivatives of the shape functions of the first nodes along the surface.
    pub fn slopes(&self, n_nodes: usize) -> Vec<[f64; D]> {
        // With tangents aⱼ and ∂φ/∂ξⱼ it is Σ (G⁻¹)ⱼₗ ∂φ/∂ξⱼ aₗ, G = aⱼ·aₗ.
        let a = &self.tangents;
        let metric: [[f64; R]; R] =
            std::array::from_fn(|j| std::array::from_fn(|l| dot(a[j], a[l])));
        let inverse: [[f64; R]; R] = match R {
            1 => [[1.0 / metric[0][0]; R]; R],
            _ => {
                let (rows, det) = cofactors(metric);
                rows.map(|row| row.map(|v| v / det))
            }
        };
        let slope = |local: &[f64; R]| -> [f64; D] {
            let parts = inverse.map(|row| dot(row, *local));
            std::array::from_fn(|c| (0..R).map(|j| parts[j] * a[j][c]).sum())
        };
        self.local[..n_nodes].iter().map(slope).collect()
    }
}

/// The shape of a face with its nodes at x at a point of the reference triangle or square.
pub(crate) struct FaceAt<'a>(pub &'a [[f64; 3]], pub [f64; 2]);

impl Visit<2> for FaceAt<'_> {
    type Output = FacetShape<2, 3>;

    #[inline]
    fn visit<E: ShapeFunctions<2, N, Q>, const N: usize, const Q: usize>(self) -> FacetShape<2, 3> {
        let (of_nodes, local) = E::shapes(self.1);
        let (mut shape, mut slopes) = ([0.0; 9], [[0.0; 2]; 9]);
        shape[..N].copy_from_slice(&of_nodes);
        slopes[..N].copy_from_slice(&local);
        FacetShape {
            shape,
            local: slopes,
            place: sum(&of_nodes, self.0),
            tangents: tangents(&local, self.0),
        }
    }
}
