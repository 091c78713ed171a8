//! The position of a point in a facet or an element: the shape functions there.

use super::shape::{FaceAt, ShapeFunctions, Visit, edge_at, face_kind, sum, tangents};
use super::vector::{dot, length, minus};
use super::{ElementKind, Topology, facet_corners};

/// The shape functions of a piece at its point nearest to a given one, followed by zeros.
pub(crate) struct Foot {
    pub shape: [f64; 27],
    /// The distance of the given point from there, and how far outside the piece it is, both as lengths in space.
    pub miss: f64,
}

/// A piece at a point of its reference element.
struct At<const D: usize> {
    shape: [f64; 27],
    place: [f64; D],
    /// As many as the reference element has coordinates, followed by zeros.
    tangents: [[f64; D]; 3],
    /// The least shape function of the corners alone: below 0 outside.
    inside: f64,
}

/// Newton steps; on straight pieces one is enough, and a curved one bends little within itself.
const STEPS: usize = 20;

/// The point of a piece nearest to `x`, by Gauss and Newton from the middle; `size` is that of the piece.
fn foot<const R: usize, const D: usize>(
    at: impl Fn([f64; R]) -> At<D>,
    middle: [f64; R],
    x: [f64; D],
    size: f64,
) -> Foot {
    let mut xi = middle;
    let mut here = at(xi);
    for _ in 0..STEPS {
        let rest = minus(x, here.place);
        let mut system = [[0.0; 4]; R];
        for (i, row) in system.iter_mut().enumerate() {
            for j in 0..R {
                row[j] = dot(here.tangents[i], here.tangents[j]);
            }
            row[R] = dot(here.tangents[i], rest);
        }
        let step = solved(system);
        (0..R).for_each(|c| xi[c] += step[c]);
        here = at(xi);
        if !step.iter().any(|along| along.abs() > 1e-14) {
            break;
        }
    }
    let miss = length(minus(x, here.place)) + size * (-here.inside).max(0.0);
    Foot {
        shape: here.shape,
        miss: if miss.is_nan() { f64::INFINITY } else { miss },
    }
}

/// The solution of a positive definite system with its right-hand side in column R.
fn solved<const R: usize>(mut rows: [[f64; 4]; R]) -> [f64; R] {
    for k in 0..R {
        for i in k + 1..R {
            let factor = rows[i][k] / rows[k][k];
            (k..=R).for_each(|j| rows[i][j] -= factor * rows[k][j]);
        }
    }
    let mut x = [0.0; R];
    for k in (0..R).rev() {
        let known: f64 = (k + 1..R).map(|j| rows[k][j] * x[j]).sum();
        x[k] = (rows[k][R] - known) / rows[k][k];
    }
    x
}

/// The shape functions at a point of the reference element.
struct ShapesAt<const R: usize>([f64; R]);

impl<const R: usize> Visit<R> for ShapesAt<R> {
    type Output = ([f64; 27], [[f64; R]; 27], usize);

    fn visit<E: ShapeFunctions<R, N, Q>, const N: usize, const Q: usize>(self) -> Self::Output {
        let (of_nodes, slopes) = E::shapes(self.0);
        let (mut shape, mut local) = ([0.0; 27], [[0.0; R]; 27]);
        shape[..N].copy_from_slice(&of_nodes);
        local[..N].copy_from_slice(&slopes);
        (shape, local, N)
    }
}

/// The middle of the reference element.
struct Middle;

impl<const R: usize> Visit<R> for Middle {
    type Output = [f64; R];

    fn visit<E: ShapeFunctions<R, N, Q>, const N: usize, const Q: usize>(self) -> [f64; R] {
        E::CENTRE
    }
}

/// The least of some shape functions.
fn least(shape: &[f64]) -> f64 {
    shape.iter().copied().fold(f64::INFINITY, f64::min)
}

fn extent<const D: usize>(nodes: &[[f64; D]]) -> f64 {
    let (low, high) = super::bounds(nodes.iter().copied());
    length(minus(high, low))
}

/// The position of x in an element with these nodes.
pub(crate) fn in_element<const D: usize>(kind: ElementKind, nodes: &[[f64; D]], x: [f64; D]) -> Foot
where
    ElementKind: Topology<D>,
{
    let at = |xi: [f64; D]| {
        let (shape, local, n) = kind.with(ShapesAt(xi));
        let mut along = [[0.0; D]; 3];
        along[..D].copy_from_slice(&tangents::<D, D>(&local[..n], nodes));
        let (corners, _, n_corners) = kind.linear().with(ShapesAt(xi));
        At {
            place: sum(&shape[..n], nodes),
            tangents: along,
            inside: least(&corners[..n_corners]),
            shape,
        }
    };
    foot(at, kind.with(Middle), x, extent(nodes))
}

/// The position of the point nearest to x in a facet with these nodes. `facet` gives the number of corners.
pub(crate) fn on_facet<const D: usize>(
    facet: &impl AsRef<[u32]>,
    nodes: &[[f64; D]],
    x: [f64; D],
) -> Foot {
    let padded = |of_nodes: [f64; 9]| {
        let mut shape = [0.0; 27];
        shape[..9].copy_from_slice(&of_nodes);
        shape
    };
    match D {
        2 => {
            let flat: Vec<[f64; 2]> = nodes.iter().map(|x| [x[0], x[1]]).collect();
            let at = |[xi]: [f64; 1]| {
                let at = edge_at(&flat, xi);
                At {
                    shape: padded(at.shape),
                    place: at.place,
                    tangents: [at.tangents[0], [0.0; 2], [0.0; 2]],
                    inside: 0.5 * (1.0 - xi.abs()),
                }
            };
            foot(at, [0.0], [x[0], x[1]], extent(nodes))
        }
        _ => {
            let solid: Vec<[f64; 3]> = nodes.iter().map(|x| [x[0], x[1], x[2]]).collect();
            let kind = face_kind(nodes.len());
            let corners = face_kind(facet_corners(facet).len());
            let at = |xi: [f64; 2]| {
                let at = kind.with(FaceAt(&solid, xi));
                let (of_corners, _, n_corners) = corners.with(ShapesAt(xi));
                At {
                    shape: padded(at.shape),
                    place: at.place,
                    tangents: [at.tangents[0], at.tangents[1], [0.0; 3]],
                    inside: least(&of_corners[..n_corners]),
                }
            };
            let middle: [f64; 2] = corners.with(Middle);
            foot(at, middle, [x[0], x[1], x[2]], extent(nodes))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::facet;

    /// The nodes of the reference element, bent a little.
    struct Bent<const R: usize>;

    impl<const R: usize> Visit<R> for Bent<R> {
        type Output = Vec<[f64; R]>;

        fn visit<E: ShapeFunctions<R, N, Q>, const N: usize, const Q: usize>(
            self,
        ) -> Vec<[f64; R]> {
            let bent = |xi: [f64; R]| {
                std::array::from_fn(|c| xi[c] + 0.05 * xi[(c + 1) % R].powi(2) + 0.3 * xi[R - 1])
            };
            E::NODES.map(bent).to_vec()
        }
    }

    /// A point inside the reference element: near its middle, off all planes of symmetry.
    struct Inside;

    impl<const R: usize> Visit<R> for Inside {
        type Output = [f64; R];

        fn visit<E: ShapeFunctions<R, N, Q>, const N: usize, const Q: usize>(self) -> [f64; R] {
            std::array::from_fn(|c| E::CENTRE[c] + [0.07, -0.05, 0.03][c])
        }
    }

    fn check_element<const D: usize>(kind: ElementKind)
    where
        ElementKind: Topology<D>,
    {
        let nodes = kind.with(Bent::<D>);
        let xi: [f64; D] = kind.with(Inside);
        let (shape, _, n) = kind.with(ShapesAt(xi));
        let foot = in_element(kind, &nodes, sum(&shape[..n], &nodes));
        assert!(foot.miss < 1e-12, "{kind:?}: {}", foot.miss);
        for (found, expected) in foot.shape.iter().zip(shape) {
            assert!((found - expected).abs() < 1e-12, "{kind:?}");
        }
        // A point far outside is reported.
        assert!(in_element(kind, &nodes, [9.0; D]).miss > 1.0);
    }

    #[test]
    fn points_of_elements_are_found() {
        for kind in ElementKind::ALL {
            match kind.linear() {
                ElementKind::Triangle | ElementKind::Quad => check_element::<2>(kind),
                _ => check_element::<3>(kind),
            }
        }
    }

    #[test]
    fn points_of_facets_are_found() {
        for kind in [3, 4, 6, 8, 9].map(face_kind) {
            let flat = kind.with(Bent::<2>);
            let nodes: Vec<[f64; 3]> = flat
                .iter()
                .map(|x| [x[0], x[1], 0.1 * x[0] * x[1]])
                .collect();
            let face = facet::<3>(&(0..nodes.len() as u32).collect::<Vec<_>>());
            let xi: [f64; 2] = kind.with(Inside);
            let (shape, _, n) = kind.with(ShapesAt(xi));
            let place = sum(&shape[..n], &nodes);
            let foot = on_facet(&face, &nodes, place);
            assert!(foot.miss < 1e-12, "{kind:?}: {}", foot.miss);
            for (found, expected) in foot.shape.iter().zip(shape) {
                assert!((found - expected).abs() < 1e-10, "{kind:?}");
            }
        }
        for nodes in [
            vec![[0.0, 0.0], [2.0, 1.0]],
            vec![[0.0, 0.0], [2.0, 1.0], [1.1, 0.2]],
        ] {
            let edge = facet::<2>(&(0..nodes.len() as u32).collect::<Vec<_>>());
            let at = edge_at(&nodes, 0.3);
            let foot = on_facet(&edge, &nodes, at.place);
            assert!(foot.miss < 1e-12);
            let all = foot.shape.iter().zip(at.shape);
            assert!(all.into_iter().all(|(a, b)| (a - b).abs() < 1e-12));
            // Beyond an end by the length of the edge.
            let beyond = std::array::from_fn(|c| 2.0 * nodes[1][c] - nodes[0][c]);
            assert!(on_facet(&edge, &nodes, beyond).miss > 1.0);
        }
    }
}
