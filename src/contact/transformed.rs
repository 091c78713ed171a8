//! Shape functions of facets of second order, transformed so that each has a positive integral.
//!
//! The functions of a facet with corners v and middles e of its edges are taken as
//!
//! ```text
//! Ñ_v = N_v + Σ α N_e  (e beside v),    Ñ_e = (1 − 2α) N_e,
//! ```
//!
//! and their displacements are û_v = u_v and û_e = (u_e − α (u_a + u_b)) / (1 − 2α) with the ends a and b of the edge.
//! A contact force is a multiplier of Ñ, so that it is positive where there is pressure, and over ∫ Ñ it is that
//! pressure. α is 1/5 for triangles with six nodes and quadrilaterals with eight, whose integrals at corners are
//! otherwise zero and negative. It is also 1/5 for the edges of bodies of revolution, where the integral over the ring
//! around a node on the axis is zero. Where all integrals are positive, on edges and quadrilaterals with nine nodes, no
//! transformation is necessary (Popp, Wohlmuth, Gee and Wall, SIAM J. Sci. Comput. 34, 2012, have the same form of it).

use crate::elasticity::Plane;
use crate::mesh::{facet_corners, facet_nodes};
use std::collections::BTreeMap;

/// α of the facets that need one: any between 1/8 and 1/2 leaves positive integrals on both.
const ALPHA: f64 = 0.2;

/// Whether the functions of a facet with so many nodes and corners need the transformation.
fn is_transformed(plane: Plane, n_nodes: usize, n_corners: usize) -> bool {
    match (n_corners, n_nodes) {
        (3, 6) | (4, 8) => true,
        (2, 3) => plane == Plane::Axisymmetric,
        _ => false,
    }
}

/// The number of its midside nodes, each between the corner of the same number and the next one.
pub(super) fn n_middles(n_corners: usize) -> usize {
    match n_corners {
        2 => 1,
        n => n,
    }
}

/// The nodes of a boundary whose functions are transformed.
pub(super) struct Transformed {
    /// For the middle of an edge the ends of that; in order, so that sums are the same in every run.
    ends: BTreeMap<u32, [u32; 2]>,
}

impl Transformed {
    pub fn new<F: AsRef<[u32]>>(plane: Plane, facets: &[F]) -> Self {
        let mut ends = BTreeMap::new();
        for facet in facets {
            let (corners, nodes) = (facet_corners(facet), facet_nodes(facet));
            if !is_transformed(plane, nodes.len(), corners.len()) {
                continue;
            }
            let middles = &nodes[corners.len()..][..n_middles(corners.len())];
            for (k, &middle) in middles.iter().enumerate() {
                ends.insert(middle, [corners[k], corners[(k + 1) % corners.len()]]);
            }
        }
        Self { ends }
    }

    /// Ñ of a facet with so many nodes and corners from its shape functions, or integrals of these from those.
    pub fn functions(plane: Plane, n_nodes: usize, corners: usize, mut of: [f64; 9]) -> [f64; 9] {
        if is_transformed(plane, n_nodes, corners) {
            for k in 0..n_middles(corners) {
                let whole = of[corners + k];
                of[corners + k] = (1.0 - 2.0 * ALPHA) * whole;
                of[k] += ALPHA * whole;
                of[(k + 1) % corners] += ALPHA * whole;
            }
        }
        of
    }

    /// From integrals with the shape functions, one a node of the mesh, to those with the transformed ones.
    pub fn share(&self, integrals: &mut [f64]) {
        for (&middle, ends) in &self.ends {
            let whole = integrals[middle as usize];
            integrals[middle as usize] = (1.0 - 2.0 * ALPHA) * whole;
            ends.iter()
                .for_each(|&end| integrals[end as usize] += ALPHA * whole);
        }
    }

    /// The nodes whose weighted displacements make up that of a node in the transformed sense, its own first.
    pub fn own(&self, node: u32) -> Vec<(u32, f64)> {
        let Some(&[a, b]) = self.ends.get(&node) else {
            return vec![(node, 1.0)];
        };
        let scale = 1.0 / (1.0 - 2.0 * ALPHA);
        vec![(node, scale), (a, -ALPHA * scale), (b, -ALPHA * scale)]
    }
}
