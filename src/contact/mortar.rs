//! Contact between two boundaries whose meshes need not match: a segment-based mortar method with dual
//! (biorthogonal) multipliers.
//!
//! The multipliers live on the nodes i of the first boundary. With dual functions ψᵢ, ∫ ψᵢ φⱼ ds = δᵢⱼ Dᵢ on
//! that boundary, the condition of node i is
//!
//! ```text
//! νᵢ · (uᵢ − Σⱼ (Mᵢⱼ/Dᵢ) uⱼ) ≤ dᵢ,     Mᵢⱼ = ∫ ψᵢ φⱼ ds,     dᵢ = ∫ ψᵢ gap ds / Dᵢ
//! ```
//!
//! with νᵢ halfway between the normals of both sides and j over the nodes of the second boundary (Wohlmuth 2000; Popp, Gee and Wall 2009). Each row has its own
//! node i, so that N and T have full row rank; weights Mᵢⱼ/Dᵢ add up to 1, so that a uniform pressure is
//! transferred exactly. All integrals are taken over the segments between projected nodes of both meshes,
//! along the field of averaged normals of the first boundary. Where an edge is covered in part, its ψ are
//! biorthogonal on that part (Cichosz and Bischoff 2011).

use super::search::{Bounds, Search};
use super::{ContactError, ContactNode, Friction, PairOptions, checked, frame, rounding};
use crate::elasticity::{Body, edge_points};
use crate::mesh::Mesh;
use crate::mesh::vector::{dot, length, minus, unit};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap, HashSet};

type Point = [f64; 2];

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// a + s (b − a).
fn between(a: Point, b: Point, s: f64) -> Point {
    [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])]
}

/// An edge of the first boundary: its ends and the averaged normals there.
struct Edge {
    ends: [Point; 2],
    normals: [Point; 2],
}

impl Edge {
    /// The place at s ∈ [0, 1] and the unit normal there.
    fn at(&self, s: f64) -> (Point, Point) {
        let normal = between(self.normals[0], self.normals[1], s);
        (between(self.ends[0], self.ends[1], s), unit(normal))
    }

    /// The s whose normal goes through x: a root of (x − p(s)) × n(s), the one nearest to the edge.
    fn projection(&self, x: Point) -> Option<f64> {
        let [p, q] = self.ends;
        let [n, k] = self.normals;
        let (along, turn, to) = (minus(q, p), minus(k, n), minus(x, p));
        // (to − s along) × (n + s turn) = c + b s + a s².
        let a = -cross(along, turn);
        let b = cross(to, turn) - cross(along, n);
        let c = cross(to, n);
        let roots = if a.abs() * 1e12 < b.abs() {
            [-c / b; 2]
        } else {
            let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
            // Free of cancellation.
            let q = -0.5 * (b + root.copysign(b));
            [q / a, c / q]
        };
        let off = |s: &f64| (s - 0.5).abs();
        let nearest = roots
            .into_iter()
            .filter(|s| s.is_finite())
            .min_by(|s, t| off(s).total_cmp(&off(t)))?;
        Some(nearest)
    }
}

/// Where the ray from x along n meets the line through the edge: the parameter on the edge and the distance.
fn meet(x: Point, n: Point, [p, q]: [Point; 2]) -> (f64, f64) {
    let (along, to) = (minus(q, p), minus(p, x));
    let det = cross(n, along);
    (cross(n, to) / -det, cross(to, along) / det)
}

/// What an edge of the first boundary adds to the integrals of its two nodes.
#[derive(Default)]
struct Shares {
    /// ∫ φᵢ.
    area: [f64; 2],
    /// ∫ φᵢ bound, for a Tresca bound.
    bound: [f64; 2],
    /// ∫ ψᵢ gap.
    gap: [f64; 2],
    /// (j, ∫ ψᵢ φⱼ).
    partners: Vec<(u32, [f64; 2])>,
    /// ∫ φᵢ n of the other boundary.
    facing: [Point; 2],
    /// The deepest overlap and where.
    depth: f64,
    place: Point,
}

/// The part of an edge covered by less than this stays out: its dual functions would be all rounding.
const COVERED: f64 = 1e-3;
/// The cosine between outward normals of boundaries that face each other is below this.
const FACING: f64 = -0.1;

/// The contact nodes of the boundary `edges` against the boundary `others` of another body (or of the same
/// one, across a slit): see the module for the method.
///
/// `edges` carry the multipliers: take the side with the coarser mesh where they differ much. Edges point so that
/// the body lies on their left, as in [`crate::mesh::Mesh::boundaries`].
///
/// # Errors
/// If the boundaries overlap, share a node, do not find each other within the search distance, or if a bound,
/// coefficient or gap is negative or not finite.
pub fn mortar_contact(
    body: &Body,
    edges: &[[u32; 2]],
    others: &[[u32; 2]],
    options: &PairOptions,
) -> Result<Vec<ContactNode>, ContactError> {
    let mesh = body.mesh;
    let place = |node: u32| mesh.nodes[node as usize];
    let other_nodes: HashSet<u32> = others.iter().flatten().copied().collect();
    if let Some(&node) = edges.iter().flatten().find(|n| other_nodes.contains(n)) {
        let place = place(node).into();
        return Err(ContactError::Shared { place });
    }
    // What lies just at the distance is within it.
    let distance = options.distance_between(body, edges, others) * (1.0 + 1e-9);
    let rounding = rounding(body);
    let normals = averaged_normals(mesh, edges)?;
    let search = Search::new(mesh, others);
    let shares: Vec<Shares> = edges
        .par_iter()
        .map(|&edge| {
            let (_, normal) = mesh.facet_normal(&edge);
            let near: Vec<[u32; 2]> = search
                .near(Bounds::around(mesh, &edge), distance)
                .filter(|&other| dot(mesh.facet_normal(&other).1, normal) < FACING)
                .collect();
            let geometry = Edge {
                ends: edge.map(place),
                normals: edge.map(|node| normals[&node]),
            };
            integrate(body, &geometry, &near, distance, rounding, options)
        })
        .collect();
    if let Some(worst) = shares
        .iter()
        .max_by(|a, b| a.depth.total_cmp(&b.depth))
        .filter(|worst| worst.depth > 0.0)
    {
        return Err(ContactError::BodiesOverlap {
            place: worst.place.into(),
            depth: worst.depth,
        });
    }

    // The sums at the nodes, in the order of the edges.
    let mut sums: BTreeMap<u32, Sums> = BTreeMap::new();
    for (&edge, shares) in edges.iter().zip(&shares) {
        let half = 0.5 * body.thickness * mesh.facet_normal(&edge).0;
        for (end, &node) in edge.iter().enumerate() {
            sums.entry(node).or_default().add(half, shares, end);
        }
    }
    let covered = (sums.into_iter()).filter(|(_, sums)| !(sums.area <= 1e-6 * sums.full));
    let found = covered
        .map(|(node, sums)| sums.contact_node(node, place(node), normals[&node], options))
        .collect::<Result<Vec<_>, _>>()?;
    if found.is_empty() {
        let nearest = search.nearest(edges.iter().map(|edge| Bounds::around(mesh, edge)));
        return Err(ContactError::Apart { distance, nearest });
    }
    Ok(found)
}

/// At each node of a boundary the unit normal halfway between those of its edges.
fn averaged_normals(mesh: &Mesh, edges: &[[u32; 2]]) -> Result<HashMap<u32, Point>, ContactError> {
    let mut normals: HashMap<u32, Point> = HashMap::new();
    for &edge in edges {
        let (_, n) = mesh.facet_normal(&edge);
        for node in edge {
            let sum = normals.entry(node).or_default();
            *sum = [sum[0] + n[0], sum[1] + n[1]];
        }
    }
    for (&node, normal) in &mut normals {
        if !(length(*normal) > 1e-6) {
            let place = mesh.nodes[node as usize].into();
            return Err(ContactError::Folded { place });
        }
        *normal = unit(*normal);
    }
    Ok(normals)
}

/// What the edges of the first boundary add up to at a node.
#[derive(Default)]
struct Sums {
    /// ∫ φ over all of them, covered or not.
    full: f64,
    area: f64,
    bound: f64,
    gap: f64,
    facing: Point,
    partners: Vec<(u32, f64)>,
}

impl Sums {
    /// Adds the shares of an edge of which the node is this end.
    fn add(&mut self, full: f64, shares: &Shares, end: usize) {
        self.full += full;
        self.area += shares.area[end];
        self.bound += shares.bound[end];
        self.gap += shares.gap[end];
        for c in 0..2 {
            self.facing[c] += shares.facing[end][c];
        }
        for &(other, weight) in &shares.partners {
            match self.partners.iter_mut().find(|p| p.0 == other) {
                Some(partner) => partner.1 += weight[end],
                None => self.partners.push((other, weight[end])),
            }
        }
    }

    fn contact_node(
        &self,
        node: u32,
        x: Point,
        own: Point,
        options: &PairOptions,
    ) -> Result<ContactNode, ContactError> {
        let slip_bound = options.friction.at(x, self.bound)?;
        // ν lies between the normals of both sides, so that it does not matter which of them is named first.
        let normal = unit(minus(own, self.facing.map(|c| c / self.area)));
        let gap = self.gap / self.area * dot(own, normal);
        if !gap.is_finite() {
            checked("gap", x, f64::NAN)?;
        }
        let mut partners: Vec<(u32, f64)> = (self.partners.iter())
            .map(|&(other, weight)| (other, weight / self.area))
            .filter(|p| p.1.abs() > 1e-14)
            .collect();
        partners.sort_unstable_by_key(|p| p.0);
        Ok(ContactNode {
            node,
            partners,
            frame: frame(normal),
            // ψ has negative parts, so that the mean of a gap that is nowhere negative may be, by O(h²).
            gap: gap.max(0.0),
            area: self.area,
            slip_bound,
        })
    }
}

/// The integrals over one edge of the first boundary.
fn integrate(
    body: &Body,
    edge: &Edge,
    near: &[[u32; 2]],
    distance: f64,
    rounding: f64,
    options: &PairOptions,
) -> Shares {
    let place = |node: u32| body.mesh.nodes[node as usize];
    let segments = segments(body.mesh, edge, near, distance);
    let covered: f64 = segments.iter().map(|&(_, a, b)| b - a).sum();
    let mut shares = Shares::default();
    if covered < COVERED {
        return shares;
    }

    let length = length(minus(edge.ends[1], edge.ends[0])) * body.thickness;
    let points = |a: f64, b: f64| {
        // In the parameter of the edge; the weights of a segment add up to its length.
        edge_points([[a, 0.0], [b, 0.0]]).map(|([s, _], _, w)| (s, w * (b - a) * length))
    };
    // Mass matrix and ∫ φ over the covered part; ψ = C φ with C = diag(∫ φ) mass⁻¹.
    let (mut m00, mut m01, mut m11) = (0.0, 0.0, 0.0);
    for &(_, a, b) in &segments {
        for (s, w) in points(a, b) {
            let phi = [1.0 - s, s];
            m00 += w * phi[0] * phi[0];
            m01 += w * phi[0] * phi[1];
            m11 += w * phi[1] * phi[1];
            for i in 0..2 {
                shares.area[i] += w * phi[i];
            }
        }
    }
    let det = m00 * m11 - m01 * m01;
    let [d0, d1] = shares.area;
    let dual = [
        [d0 * m11 / det, -d0 * m01 / det],
        [-d1 * m01 / det, d1 * m00 / det],
    ];
    for &(other, a, b) in &segments {
        let ends = other.map(place);
        let (_, facing) = body.mesh.facet_normal(&other);
        for (s, w) in points(a, b) {
            let (x, n) = edge.at(s);
            let phi = [1.0 - s, s];
            let psi = dual.map(|row| row[0] * phi[0] + row[1] * phi[1]);
            let (t, between) = meet(x, n, ends);
            let gap = options.gap_at(x, between, rounding);
            // NaN from an expression must stay.
            if gap < -shares.depth {
                shares.depth = -gap;
                shares.place = x;
            }
            let bound = match options.friction {
                Friction::Tresca(tresca) => tresca(x),
                _ => 0.0,
            };
            for i in 0..2 {
                shares.gap[i] += w * psi[i] * gap;
                shares.bound[i] += w * phi[i] * bound;
                for c in 0..2 {
                    shares.facing[i][c] += w * phi[i] * facing[c];
                }
            }
            for (node, there) in other.into_iter().zip([1.0 - t, t]) {
                let weight = psi.map(|psi| w * psi * there);
                match shares.partners.iter_mut().find(|p| p.0 == node) {
                    Some(partner) => {
                        partner.1[0] += weight[0];
                        partner.1[1] += weight[1];
                    }
                    None => shares.partners.push((node, weight)),
                }
            }
        }
    }
    shares
}

/// The parts of an edge, from and to a parameter of it, each with the nearest of the edges that cover it.
fn segments(
    mesh: &Mesh,
    edge: &Edge,
    near: &[[u32; 2]],
    distance: f64,
) -> Vec<([u32; 2], f64, f64)> {
    let place = |node: u32| mesh.nodes[node as usize];
    // The part of the edge that each of the others covers.
    let covers: Vec<([u32; 2], f64, f64)> = near
        .iter()
        .filter_map(|&other| {
            let [a, b] = other.map(|node| edge.projection(place(node)));
            let (a, b) = (a?, b?);
            let (low, high) = (a.min(b).max(0.0), a.max(b).min(1.0));
            (high - low > 1e-10).then_some((other, low, high))
        })
        .collect();
    let mut cuts: Vec<f64> = covers.iter().flat_map(|&(_, a, b)| [a, b]).collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|b, a| *b - *a < 1e-10);

    let mut segments: Vec<([u32; 2], f64, f64)> = Vec::new();
    for cut in cuts.windows(2) {
        let middle = 0.5 * (cut[0] + cut[1]);
        let (x, n) = edge.at(middle);
        let nearest = covers
            .iter()
            .filter(|&&(_, a, b)| a < middle && middle < b)
            .map(|&(other, ..)| (other, meet(x, n, other.map(place)).1))
            .filter(|(_, gap)| gap.abs() <= distance)
            .min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        if let Some((other, _)) = nearest {
            segments.push((other, cut[0], cut[1]));
        }
    }
    segments
}
