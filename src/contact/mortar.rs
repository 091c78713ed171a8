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
//! with νᵢ halfway between the normals of both sides and j over the nodes of the second boundary (Wohlmuth 2000; Popp,
//! Gee and Wall 2009). Each row has its own node i, so that N and T have full row rank; weights Mᵢⱼ/Dᵢ add up to 1, so
//! that a uniform pressure is transferred exactly and the contact forces of a pair add up to nothing. All integrals are
//! taken over what the facets of both meshes have in common: in the plane segments between projected nodes
//! (`mortar/segments.rs`), in space polygons (`mortar/polygons.rs`). Where a facet is covered in part, its ψ are
//! biorthogonal on that part (Cichosz and Bischoff 2011).

mod polygons;
mod segments;

use super::search::{Bounds, Search};
use super::{ContactError, ContactNode, Friction, PairOptions, checked, frame, rounding};
use crate::dense;
use crate::elasticity::Body;
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{Facet, Kind, Mesh, Topology, facet_nodes};
use faer::Mat;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap, HashSet};

pub use super::search::Beam;

/// The corners of a facet, and how many these are.
pub type Corners<const D: usize> = ([[f64; D]; 4], usize);

/// A facet of the first boundary.
#[derive(Clone, Copy, Debug)]
pub struct Here<const D: usize> {
    /// How many corners it has.
    len: usize,
    /// These.
    corners: [[f64; D]; 4],
    /// The averaged normals there.
    normals: [[f64; D]; 4],
    /// Its outward unit normal.
    normal: [f64; D],
    /// The thickness of the body.
    thickness: f64,
}

/// A place where a facet of the first boundary meets one of the other: an integration point of what they have in
/// common.
#[derive(Clone, Copy, Debug)]
pub struct Meeting<const D: usize> {
    /// Which facet of the other boundary.
    other: usize,
    /// The place on the first boundary.
    place: [f64; D],
    /// φ of the nodes of the facet there.
    here: [f64; 4],
    /// φ of the nodes of the other facet, at the place that it meets.
    there: [f64; 4],
    /// How far apart they are, along the averaged normal; negative where they overlap.
    distance: f64,
    /// The weight, with the thickness in it.
    weight: f64,
}

/// Where a facet of the first boundary meets those of the other one.
#[derive(Clone, Debug)]
pub struct Overlap<const D: usize> {
    /// The part of the facet that is covered.
    covered: f64,
    /// Integration points, those with one facet one after the other.
    meetings: Vec<Meeting<D>>,
}

/// What boundaries have in common, in the plane and in space.
pub trait Mortar<const D: usize>: Topology<D> {
    /// A box that holds whatever a facet can meet within a distance.
    fn beam(here: &Here<D>, distance: f64) -> Beam<D>;

    /// Where a facet meets some others, no farther away than the distance: what is nearest, where there are several.
    fn overlap(here: &Here<D>, near: &[Corners<D>], distance: f64) -> Overlap<D>;

    /// What the normal of a facet weighs at each of its corners in the averaged normal.
    fn corner_weights(corners: &[[f64; D]]) -> [f64; 4];
}

impl Mortar<2> for Kind {
    fn beam(here: &Here<2>, distance: f64) -> Beam<2> {
        let ends = here.corners[..here.len].iter().copied();
        Beam::around([[1.0, 0.0], [0.0, 1.0]], ends, [distance; 2])
    }

    fn overlap(here: &Here<2>, near: &[Corners<2>], distance: f64) -> Overlap<2> {
        segments::overlap(here, near, distance)
    }

    fn corner_weights(_: &[[f64; 2]]) -> [f64; 4] {
        [1.0; 4]
    }
}

impl Mortar<3> for Kind {
    fn beam(here: &Here<3>, distance: f64) -> Beam<3> {
        polygons::beam(here, distance)
    }

    fn overlap(here: &Here<3>, near: &[Corners<3>], distance: f64) -> Overlap<3> {
        polygons::overlap(here, near, distance)
    }

    fn corner_weights(corners: &[[f64; 3]]) -> [f64; 4] {
        polygons::angles(corners)
    }
}

/// What a facet of the first boundary adds to the integrals of its nodes.
struct Shares<const D: usize> {
    /// ∫ φᵢ.
    area: [f64; 4],
    /// ∫ φᵢ bound, for a Tresca bound.
    bound: [f64; 4],
    /// ∫ ψᵢ gap.
    gap: [f64; 4],
    /// (j, ∫ ψᵢ φⱼ).
    partners: Vec<(u32, [f64; 4])>,
    /// ∫ φᵢ n of the other boundary.
    facing: [[f64; D]; 4],
    /// The deepest overlap and where.
    depth: f64,
    place: [f64; D],
}

impl<const D: usize> Default for Shares<D> {
    fn default() -> Self {
        Self {
            area: [0.0; 4],
            bound: [0.0; 4],
            gap: [0.0; 4],
            partners: Vec::new(),
            facing: [[0.0; D]; 4],
            depth: 0.0,
            place: [0.0; D],
        }
    }
}

/// A facet of which less than this part is covered stays out: its dual functions would be all rounding.
const COVERED: f64 = 1e-3;
/// The cosine between outward normals of boundaries that face each other is below this.
const FACING: f64 = -0.1;

/// The contact nodes of the boundary `facets` against the boundary `others` of another body (or of the same
/// one, across a slit): see the module for the method.
///
/// `facets` carry the multipliers: take the side with the coarser mesh where they differ much. They are directed as in
/// [`crate::mesh::Mesh::boundaries`].
///
/// # Errors
/// If the boundaries overlap, share a node, do not find each other within the search distance, or if a bound,
/// coefficient, gap or interference is negative or not finite.
pub fn mortar_contact<const D: usize>(
    body: &Body<D>,
    facets: &[Facet<D>],
    others: &[Facet<D>],
    options: &PairOptions<D>,
) -> Result<Vec<ContactNode<D>>, ContactError>
where
    Kind: Mortar<D>,
{
    let mesh = body.mesh;
    let place = |node: u32| mesh.nodes[node as usize];
    let nodes_of = |facet: &Facet<D>| -> Vec<u32> { facet_nodes(facet).to_vec() };
    let other_nodes: HashSet<u32> = others.iter().flat_map(nodes_of).collect();
    let mut nodes = facets.iter().flat_map(nodes_of);
    if let Some(node) = nodes.find(|node| other_nodes.contains(node)) {
        let place = place(node).into();
        return Err(ContactError::Shared { place });
    }
    // What lies just at the distance is within it.
    let distance = options.distance_between(body, facets, others) * (1.0 + 1e-9);
    let rounding = rounding(body);
    let normals = averaged_normals(mesh, facets)?;
    let search = Search::new(mesh, others);
    let shares: Vec<Shares<D>> = facets
        .par_iter()
        .map(|facet| {
            let here = Here::new(body, facet, &normals);
            let near: Vec<Facet<D>> = search
                .near(<Kind as Mortar<D>>::beam(&here, distance))
                .filter(|other| dot(mesh.facet_normal(other).1, here.normal) < FACING)
                .collect();
            integrate(body, &here, &near, distance, rounding, options)
        })
        .collect();
    if let Some(worst) = shares
        .iter()
        .max_by(|a, b| a.depth.total_cmp(&b.depth))
        .filter(|worst| worst.depth > 0.0)
    {
        let (place, depth) = (worst.place.into(), worst.depth);
        return Err(match options.gap {
            Some(_) => ContactError::NotPositive {
                what: "gap",
                place,
                value: -depth,
            },
            None => ContactError::BodiesOverlap { place, depth },
        });
    }

    // The sums at the nodes, in the order of the facets.
    let mut sums: BTreeMap<u32, Sums<D>> = BTreeMap::new();
    for (facet, shares) in facets.iter().zip(&shares) {
        let nodes = facet_nodes(facet);
        let part = body.thickness * mesh.facet_normal(facet).0 / nodes.len() as f64;
        for (end, &node) in nodes.iter().enumerate() {
            sums.entry(node).or_default().add(part, shares, end);
        }
    }
    let covered = (sums.into_iter()).filter(|(_, sums)| !(sums.area <= 1e-6 * sums.full));
    let found = covered
        .map(|(node, sums)| sums.contact_node(mesh, node, normals[&node], options))
        .collect::<Result<Vec<_>, _>>()?;
    if found.is_empty() {
        let nearest = search.nearest(facets.iter().map(|facet| Bounds::around(mesh, facet)));
        return Err(ContactError::Apart { distance, nearest });
    }
    Ok(found)
}

impl<const D: usize> Here<D> {
    fn new(body: &Body<D>, facet: &Facet<D>, averaged: &HashMap<u32, [f64; D]>) -> Self
    where
        Kind: Topology<D>,
    {
        let (corners, len) = body.mesh.corners_of(facet);
        let (_, normal) = body.mesh.facet_normal(facet);
        let mut normals = [normal; 4];
        for (normal, node) in normals.iter_mut().zip(facet_nodes(facet)) {
            *normal = averaged[node];
        }
        Self {
            len,
            corners,
            normals,
            normal,
            thickness: body.thickness,
        }
    }
}

/// At each node of a boundary the unit normal halfway between those of its facets.
fn averaged_normals<const D: usize>(
    mesh: &Mesh<D>,
    facets: &[Facet<D>],
) -> Result<HashMap<u32, [f64; D]>, ContactError>
where
    Kind: Mortar<D>,
{
    let mut normals: HashMap<u32, [f64; D]> = HashMap::new();
    for facet in facets {
        let (_, n) = mesh.facet_normal(facet);
        let (corners, len) = mesh.corners_of(facet);
        let weights = <Kind as Mortar<D>>::corner_weights(&corners[..len]);
        for (&node, weight) in facet_nodes(facet).iter().zip(weights) {
            let sum = normals.entry(node).or_insert([0.0; D]);
            *sum = std::array::from_fn(|c| sum[c] + weight * n[c]);
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

/// What the facets of the first boundary add up to at a node.
struct Sums<const D: usize> {
    /// ∫ φ over all of them, covered or not (of a quadrilateral a fourth of its area).
    full: f64,
    area: f64,
    bound: f64,
    gap: f64,
    facing: [f64; D],
    partners: Vec<(u32, f64)>,
}

impl<const D: usize> Default for Sums<D> {
    fn default() -> Self {
        Self {
            full: 0.0,
            area: 0.0,
            bound: 0.0,
            gap: 0.0,
            facing: [0.0; D],
            partners: Vec::new(),
        }
    }
}

impl<const D: usize> Sums<D> {
    /// Adds the shares of a facet of which the node is this corner.
    fn add(&mut self, full: f64, shares: &Shares<D>, end: usize) {
        self.full += full;
        self.area += shares.area[end];
        self.bound += shares.bound[end];
        self.gap += shares.gap[end];
        for c in 0..D {
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
        mesh: &Mesh<D>,
        node: u32,
        own: [f64; D],
        options: &PairOptions<D>,
    ) -> Result<ContactNode<D>, ContactError>
    where
        Kind: Topology<D>,
    {
        let x = mesh.nodes[node as usize];
        let slip_bound = options.friction.at(x, self.bound)?;
        // ν lies between the normals of both sides, so that it does not matter which of them is named first.
        let normal = unit(minus(own, self.facing.map(|c| c / self.area)));
        let gap = self.gap / self.area * dot(own, normal);
        if let Some(interference) = options.interference {
            checked("interference", x, interference(x))?;
        }
        if !gap.is_finite() {
            checked("gap", x, f64::NAN)?;
        }
        let frame = frame(normal);
        let mut partners: Vec<(u32, f64)> = (self.partners.iter())
            .map(|&(other, weight)| (other, weight / self.area))
            .filter(|p| p.1.abs() > 1e-14)
            .collect();
        partners.sort_unstable_by_key(|p| p.0);
        // In the plane nothing is moved yet: published figures of curved boundaries would change by as little as O(h²).
        if D > 2 {
            centre(mesh, x, &frame, self.area.sqrt(), &mut partners);
        }
        Ok(ContactNode {
            node,
            partners,
            frame,
            // ψ has negative parts, so that the mean of a gap that is nowhere negative may be, by O(h²).
            gap: if options.interference.is_some() {
                gap
            } else {
                gap.max(0.0)
            },
            area: self.area,
            slip_bound,
        })
    }
}

/// Moves the mean place of the partners of a node at x onto its normal, by the least change of their weights.
///
/// Only then a pressure has no moment on the pair, and none is needed to turn it as a whole. Where both boundaries are
/// flat this holds as it is; on curved ones it misses by O(h²).
fn centre<const D: usize>(
    mesh: &Mesh<D>,
    x: [f64; D],
    frame: &[[f64; D]; D],
    size_of_facets: f64,
    partners: &mut [(u32, f64)],
) where
    Kind: Topology<D>,
{
    // Offsets along the tangents; the first entry stands for the normal and stays 0.
    let offset = |node: u32| -> [f64; D] {
        let to = minus(mesh.nodes[node as usize], x);
        std::array::from_fn(|a| if a == 0 { 0.0 } else { dot(frame[a], to) })
    };
    let (mut off, mut middle, mut size) = ([0.0; D], [0.0; D], 0.0);
    for &(node, weight) in &*partners {
        let y = offset(node);
        size += weight.abs();
        for a in 1..D {
            off[a] += weight * y[a];
            middle[a] += weight.abs() * y[a];
        }
    }
    let middle = middle.map(|sum| sum / size);
    let mut spread = Mat::<f64>::zeros(D - 1, D - 1);
    for &(node, weight) in &*partners {
        let y = minus(offset(node), middle);
        for a in 1..D {
            for b in 1..D {
                spread[(a - 1, b - 1)] += weight.abs() * y[a] * y[b];
            }
        }
    }
    let scale = (0..D - 1).map(|a| spread[(a, a)]).sum::<f64>().sqrt();
    // Rounding needs no correction, and partners in one place allow none.
    if !(length(off) > 1e-11 * size_of_facets && length(off) < 0.5 * scale) {
        return;
    }
    let inverse = dense::pseudo_inverse(&spread, 1e-6);
    let slope: [f64; D] = std::array::from_fn(|a| match a {
        0 => 0.0,
        _ => (1..D).map(|b| -inverse[(a - 1, b - 1)] * off[b]).sum(),
    });
    for (node, weight) in partners {
        *weight += weight.abs() * dot(slope, minus(offset(*node), middle));
    }
}

/// The integrals over one facet of the first boundary.
fn integrate<const D: usize>(
    body: &Body<D>,
    here: &Here<D>,
    near: &[Facet<D>],
    distance: f64,
    rounding: f64,
    options: &PairOptions<D>,
) -> Shares<D>
where
    Kind: Mortar<D>,
{
    let mesh = body.mesh;
    let corners: Vec<Corners<D>> = near.iter().map(|other| mesh.corners_of(other)).collect();
    let overlap = <Kind as Mortar<D>>::overlap(here, &corners, distance);
    let mut shares = Shares::default();
    if overlap.covered < COVERED {
        return shares;
    }
    // Mass matrix and ∫ φ over the covered part; ψ = C φ with C = diag(∫ φ) mass⁻¹.
    let mut mass = [[0.0; 4]; 4];
    for Meeting {
        here: phi, weight, ..
    } in &overlap.meetings
    {
        for i in 0..here.len {
            for j in i..here.len {
                mass[i][j] += weight * phi[i] * phi[j];
            }
            shares.area[i] += weight * phi[i];
        }
    }
    let Some(dual) = dual(&mass, &shares.area, here.len) else {
        return Shares::default();
    };
    let facing: Vec<[f64; D]> = near
        .iter()
        .map(|other| mesh.facet_normal(other).1)
        .collect();
    for meeting in &overlap.meetings {
        let Meeting {
            other,
            place: x,
            here: phi,
            there,
            distance,
            weight: w,
        } = *meeting;
        let psi: [f64; 4] = std::array::from_fn(|i| {
            (1..here.len).fold(dual[i][0] * phi[0], |sum, k| sum + dual[i][k] * phi[k])
        });
        let gap = options.gap_at(x, distance, rounding);
        // NaN from an expression must stay.
        if gap < -shares.depth && options.interference.is_none() {
            shares.depth = -gap;
            shares.place = x;
        }
        let bound = match options.friction {
            Friction::Tresca(tresca) => tresca(x),
            _ => 0.0,
        };
        for i in 0..here.len {
            shares.gap[i] += w * psi[i] * gap;
            shares.bound[i] += w * phi[i] * bound;
            for c in 0..D {
                shares.facing[i][c] += w * phi[i] * facing[other][c];
            }
        }
        for (&node, there) in facet_nodes(&near[other]).iter().zip(there) {
            let weight = psi.map(|psi| w * psi * there);
            match shares.partners.iter_mut().find(|p| p.0 == node) {
                Some(partner) => {
                    for (sum, weight) in partner.1.iter_mut().zip(weight) {
                        *sum += weight;
                    }
                }
                None => shares.partners.push((node, weight)),
            }
        }
    }
    shares
}

/// C of ψ = C φ = diag(∫ φ) mass⁻¹ φ, from the upper triangle of the mass matrix of so many functions; None if that is
/// singular to rounding.
fn dual(mass: &[[f64; 4]; 4], area: &[f64; 4], len: usize) -> Option<[[f64; 4]; 4]> {
    let mut dual = [[0.0; 4]; 4];
    if len == 2 {
        let [[m00, m01, ..], [_, m11, ..], ..] = *mass;
        let det = m00 * m11 - m01 * m01;
        let [d0, d1, ..] = *area;
        dual[0][..2].copy_from_slice(&[d0 * m11 / det, -d0 * m01 / det]);
        dual[1][..2].copy_from_slice(&[-d1 * m01 / det, d1 * m00 / det]);
        return Some(dual);
    }
    let factor = dense::cholesky(Mat::from_fn(len, len, |i, j| mass[j.min(i)][i.max(j)]))?;
    let inverse = dense::inverse(&factor);
    for i in 0..len {
        for j in 0..len {
            dual[i][j] = area[i] * inverse[(i.max(j), i.min(j))];
        }
    }
    Some(dual)
}
