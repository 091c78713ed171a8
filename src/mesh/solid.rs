//! Space: its kinds of elements, and the geometry of faces.

use super::shape::{
    FaceAt, FacetPoint, FacetShape, Hexahedron, Hexahedron20, Hexahedron27, Pyramid,
    ShapeFunctions, Tetrahedron, Tetrahedron10, Visit, Wedge, Wedge15, Wedge18, face_kind, sum,
    tangents,
};
use super::vector::{cross, length, minus, unit};
use super::{ElementKind, Topology};

/// Space: facets are faces; one with fewer than nine nodes repeats the last of them.
impl Topology<3> for ElementKind {
    type Nodes = [u32; 27];
    type Facet = [u32; 9];

    #[inline]
    fn with<V: Visit<3>>(self, visit: V) -> V::Output {
        match self {
            Self::Tetrahedron => visit.visit::<Tetrahedron, 4, 1>(),
            Self::Tetrahedron10 => visit.visit::<Tetrahedron10, 10, 4>(),
            Self::Hexahedron => visit.visit::<Hexahedron, 8, 8>(),
            Self::Hexahedron20 => visit.visit::<Hexahedron20, 20, 27>(),
            Self::Hexahedron27 => visit.visit::<Hexahedron27, 27, 27>(),
            Self::Wedge => visit.visit::<Wedge, 6, 6>(),
            Self::Wedge15 => visit.visit::<Wedge15, 15, 18>(),
            Self::Wedge18 => visit.visit::<Wedge18, 18, 18>(),
            Self::Pyramid => visit.visit::<Pyramid, 5, 8>(),
            _ => panic!("{self:?} is no element of space"),
        }
    }

    fn facet_points(x: &[[f64; 3]], take: impl FnMut(&FacetPoint<3>)) {
        Topology::<2>::with(face_kind(x.len()), FacePoints { x, take });
    }

    fn facet_normal(x: &[[f64; 3]]) -> (f64, [f64; 3]) {
        if let [a, b, c] = *x {
            let twice = cross(minus(b, a), minus(c, a));
            return (0.5 * length(twice), unit(twice));
        }
        let (mut area, mut whole) = (0.0, [0.0; 3]);
        Self::facet_points(x, |point| {
            area += point.weight;
            (0..3).for_each(|c| whole[c] += point.weight * point.normal[c]);
        });
        (area, unit(whole))
    }

    fn normals_at_nodes(x: &[[f64; 3]]) -> Vec<[f64; 3]> {
        let tangents = at_nodes(x).map(|at| at.tangents);
        tangents.map(|[s, t]| unit(cross(s, t))).collect()
    }

    fn slopes_at_nodes(x: &[[f64; 3]]) -> Vec<Vec<[f64; 3]>> {
        at_nodes(x).map(|at| at.slopes(x.len())).collect()
    }
}

/// A face with its nodes at x at each of these.
fn at_nodes(x: &[[f64; 3]]) -> impl Iterator<Item = FacetShape<2, 3>> {
    struct Nodes;
    impl Visit<2> for Nodes {
        type Output = Vec<[f64; 2]>;
        fn visit<E: ShapeFunctions<2, N, Q>, const N: usize, const Q: usize>(
            self,
        ) -> Vec<[f64; 2]> {
            E::NODES.to_vec()
        }
    }
    let kind = face_kind(x.len());
    let nodes = Topology::<2>::with(kind, Nodes).into_iter();
    nodes.map(move |at| Topology::<2>::with(kind, FaceAt(x, at)))
}

/// Passes the integration points of a face, with the normal and the area of its curved surface at each.
struct FacePoints<'a, F> {
    x: &'a [[f64; 3]],
    take: F,
}

impl<F: FnMut(&FacetPoint<3>)> Visit<2> for FacePoints<'_, F> {
    type Output = ();

    #[inline]
    fn visit<E: ShapeFunctions<2, N, Q>, const N: usize, const Q: usize>(mut self) {
        for (xi, weight) in E::load_rule() {
            let (of_nodes, local) = E::shapes(xi);
            let [s, t] = tangents(&local, self.x);
            let surface = cross(s, t);
            let mut shape = [0.0; 9];
            shape[..N].copy_from_slice(&of_nodes);
            (self.take)(&FacetPoint {
                place: sum(&of_nodes, self.x),
                normal: unit(surface),
                shape,
                weight: weight * length(surface),
            });
        }
    }
}
