//! The plane: its kinds of elements, and the geometry of edges.

use super::shape::{
    FacetPoint, FacetShape, Quad, Quad8, Quad9, Triangle, Triangle6, Visit, edge_at,
    edge_integration,
};
use super::vector::{length, minus, unit};
use super::{ElementKind, Topology};

/// The plane: facets are edges, from one node to the other, with the middle behind them where there is one.
impl Topology<2> for ElementKind {
    type Nodes = [u32; 9];
    type Facet = [u32; 3];

    #[inline]
    fn with<V: Visit<2>>(self, visit: V) -> V::Output {
        match self {
            Self::Triangle => visit.visit::<Triangle, 3, 1>(),
            Self::Triangle6 => visit.visit::<Triangle6, 6, 3>(),
            Self::Quad => visit.visit::<Quad, 4, 4>(),
            Self::Quad8 => visit.visit::<Quad8, 8, 9>(),
            Self::Quad9 => visit.visit::<Quad9, 9, 9>(),
            _ => panic!("{self:?} is no element of the plane"),
        }
    }

    fn facet_points(x: &[[f64; 2]], take: impl FnMut(&FacetPoint<2>)) {
        edge_integration(x, take);
    }

    fn facet_normal(x: &[[f64; 2]]) -> (f64, [f64; 2]) {
        let [dx, dy] = minus(x[1], x[0]);
        let normal = unit([dy, -dx]);
        if x.len() == 2 {
            return (length([dx, dy]), normal);
        }
        let mut whole = 0.0;
        edge_integration(x, |point| whole += point.weight);
        // ∫ n ds is that of the chord.
        (whole, normal)
    }

    fn normals_at_nodes(x: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let tangents = at_nodes(x).map(|at| at.tangents[0]);
        tangents.map(|[dx, dy]| unit([dy, -dx])).collect()
    }

    fn slopes_at_nodes(x: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
        at_nodes(x).map(|at| at.slopes(x.len())).collect()
    }
}

/// An edge with its nodes at x at each of these.
fn at_nodes(x: &[[f64; 2]]) -> impl Iterator<Item = FacetShape<1, 2>> {
    let at = [-1.0, 1.0, 0.0];
    at.into_iter().take(x.len()).map(|xi| edge_at(x, xi))
}
