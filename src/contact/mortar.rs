//! Contact between two boundaries whose meshes need not match: a segment-based mortar method with dual
//! (biorthogonal) multipliers that belong to places.
//!
//! The condition of place i on the slave boundary is
//!
//! ```text
//! νᵢ · (Σₖ (Wᵢₖ/Dᵢ) uₖ − Σⱼ (Mᵢⱼ/Dᵢ) uⱼ) ≤ dᵢ,     Dᵢ = ∫ βᵢ ds,   Wᵢₖ = ∫ ψᵢ φₖ ds,   Mᵢⱼ = ∫ ψᵢ φⱼ ds,   dᵢ = ∫ ψᵢ gap ds / Dᵢ
//! ```
//!
//! with νᵢ halfway between the normals of both sides, k over the nodes of the slave boundary and j over those of the
//! second one. All integrals are taken over what the facets of both meshes have in common: in the plane segments between
//! projected nodes (`mortar/segments.rs`), in space polygons (`mortar/polygons.rs`). The dual functions ψ span what the
//! β of a facet span, with ∫ ψᵢ βⱼ ds = δᵢⱼ Dᵢ.
//!
//! - **A facet that is wholly covered** has its own shape functions as β: its places are its nodes, Wᵢₖ = δᵢₖ Dᵢ
//!   (Wohlmuth 2000; Popp, Gee and Wall 2009). On facets of second order β are what `contact/transformed.rs` makes of them,
//!   so that each has a positive integral, and W belongs to the displacements that go with these.
//! - **A facet that is covered in part** has the places that are the vertices of the convex hull P of what one connected
//!   part of the master boundary covers of it, and as β the barycentric functions of P (Wachspress 1975; in the plane those
//!   of a segment, `mortar/hull.rs` in space). Since Σβ = 1 and Σβᵢxᵢ = x, Σψ = 1 and ∫ ψᵢ x ds = Dᵢ xᵢ: a uniform
//!   pressure is handed on exactly, and the force of a place acts just there, on the border of what is covered. With the
//!   facet's own functions it would act at nodes beyond, and a body would stand on what is not there.
//! - **Curved facets** are what their shape functions say: normals, gaps and measures are those of the true surface, and a
//!   point of one facet is found on the other by Newton's method. In space what two of them have in common is clipped between
//!   straight lines from node to node, on a plane for each facet of the slave.
//! - Facets share the places that they have in common: nodes, and points on their common edges. Where such places lie
//!   nearer to each other than the mesh can tell apart, one hands its share on to the other; corners of what is covered
//!   stay.
//! - Both boundaries are cut at edges sharper than an angle ([`super::PairOptions::edge_angle`]): each smooth part has
//!   places and normals of its own.
//!
//! Weights Mᵢⱼ/Dᵢ add up to 1, so that the contact forces of a pair add up to nothing. Rows may depend on each other where
//! several parts of the master boundary lie under one facet; forces are unique even so.

mod flat;
mod hull;
mod places;
mod polygons;
mod segments;
mod surface;

use super::search::{Bounds, Search};
use super::{ContactError, ContactPlace, Friction, PairOptions, rounding};
use crate::dense;
use crate::elasticity::{Body, Depth};
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{ElementKind, Facet, Topology, facet_nodes};
use faer::Mat;
use places::Places;
use rayon::prelude::*;
use std::collections::HashSet;
use surface::Surface;

pub use super::search::Beam;

/// A facet of the slave boundary, the one that has the multipliers.
#[derive(Clone, Copy, Debug)]
pub struct SlaveFacet<const D: usize> {
    /// How many nodes it has.
    len: usize,
    /// Where these are, corners first.
    nodes: [[f64; D]; 9],
    /// The averaged normals there.
    normals: [[f64; D]; 9],
    /// Its mean outward unit normal.
    normal: [f64; D],
    /// How far it may be off what it is drawn after.
    slack: f64,
    /// How far the body reaches perpendicular to the plane.
    depth: Depth,
}

/// A facet of the master boundary that the slave may meet.
#[derive(Clone, Copy, Debug)]
pub struct MasterFacet<const D: usize> {
    /// Its number in the boundary.
    number: usize,
    /// How many nodes it has.
    len: usize,
    /// These.
    nodes: [u32; 9],
    /// Where they are, corners first.
    places: [[f64; D]; 9],
    /// Its mean outward unit normal.
    normal: [f64; D],
    /// How far it may be off what it is drawn after.
    slack: f64,
    /// The smooth part of the boundary that it belongs to.
    part: u32,
}

/// A place where a facet of the slave boundary meets one of the master: an integration point of what they have in
/// common.
#[derive(Clone, Copy, Debug)]
pub struct IntegrationPoint<const D: usize> {
    /// Which of the facets that are near.
    other: usize,
    /// The place on the slave boundary.
    place: [f64; D],
    /// φ of the nodes of the facet there.
    slave: [f64; 9],
    /// φ of the nodes of the other facet, at the place that it meets.
    master: [f64; 9],
    /// The outward unit normals of both there.
    normals: [[f64; D]; 2],
    /// How far apart they are, along the averaged normal; negative where they overlap.
    distance: f64,
    /// The weight, with how far the body reaches perpendicular to the plane in it.
    weight: f64,
}

/// Where on its facet a vertex of what is covered lies.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Site {
    /// At this node.
    Node(usize),
    /// On the edge from one node to the next one on the border, at this fraction of its length.
    Edge([usize; 2], f64),
    /// Inside.
    Inside,
}

/// What one connected part of the master boundary covers of a slave facet.
#[derive(Clone, Debug)]
pub struct Cover<const D: usize> {
    /// The smooth part of the master boundary.
    part: u32,
    /// The places that it hands forces on at, the vertices of its convex hull, with its angle there in half turns (in the
    /// plane a half for either end): those of all that is covered around a place on its border add up to 1 or, at a
    /// corner, to less.
    vertices: Vec<(Site, [f64; D], f64)>,
    /// Integration points, those with one facet one after the other.
    points: Vec<IntegrationPoint<D>>,
    /// Whether that is the whole facet: its vertices are its nodes then.
    is_whole: bool,
    /// β of the vertices at each of them.
    functions: Vec<f64>,
}

/// What boundaries have in common, in the plane and in space.
pub trait Mortar<const D: usize>: Topology<D> {
    /// A box that holds whatever a facet can meet within a distance.
    fn beam(slave: &SlaveFacet<D>, distance: f64) -> Beam<D>;

    /// Where a facet meets some others, no farther away than the distance: what is nearest, where there are several.
    fn covers(slave: &SlaveFacet<D>, near: &[MasterFacet<D>], distance: f64) -> Vec<Cover<D>>;

    /// What the normal of a facet weighs at each of its corners in the averaged normal.
    fn corner_weights(corners: &[[f64; D]]) -> [f64; 4];
}

impl Mortar<2> for ElementKind {
    fn beam(slave: &SlaveFacet<2>, distance: f64) -> Beam<2> {
        let ends = slave.places().iter().copied();
        Beam::around([[1.0, 0.0], [0.0, 1.0]], ends, [distance; 2])
    }

    fn covers(slave: &SlaveFacet<2>, near: &[MasterFacet<2>], distance: f64) -> Vec<Cover<2>> {
        segments::covers(slave, near, distance)
    }

    fn corner_weights(_: &[[f64; 2]]) -> [f64; 4] {
        [1.0; 4]
    }
}

impl Mortar<3> for ElementKind {
    fn beam(slave: &SlaveFacet<3>, distance: f64) -> Beam<3> {
        polygons::beam(slave, distance)
    }

    fn covers(slave: &SlaveFacet<3>, near: &[MasterFacet<3>], distance: f64) -> Vec<Cover<3>> {
        polygons::covers(slave, near, distance)
    }

    fn corner_weights(corners: &[[f64; 3]]) -> [f64; 4] {
        polygons::angles(corners)
    }
}

/// The cosine between outward normals of boundaries that face each other is below this.
const FACING: f64 = -0.1;
/// Vertices this near to a corner or an edge of their facet, in its size, are there.
const SAME: f64 = 1e-9;
/// The same in the least width of what is covered: places of a needle stay apart from each other.
const SAME_OF_WIDTH: f64 = 1e-2;
/// A facet of which no more than this part of its size is missed along a border is wholly covered, if it bends by as much. Where
/// two curved boundaries end in one plane, one seen from the other misses the gap between them times the slope there: at a few
/// parts in a thousand pressures were off by up to 18 % on such a border, and are by 6 % (a wave of 8 × 10 faces against one of
/// first order).
const MISSED: f64 = 1e-2;
/// Newton's method has come to a point of a facet if its last step is below this: its steps fall by their square, down to what
/// rounding makes of a facet that is small beside its distance from the origin.
const CONVERGED: f64 = 1e-6;
/// What part of a smooth boundary is not met by the other one may be lost to curvature: less integrated than this part of
/// what lies opposite is told.
const MET: f64 = 0.5;

/// The contact of two boundaries.
#[derive(Clone, Debug)]
pub struct MortarContact<const D: usize> {
    /// The places that may come into contact.
    pub places: Vec<ContactPlace<D>>,
    /// What of the master boundary lies opposite of the slave, but is not met by it.
    pub unmet: Option<Unmet<D>>,
}

/// Facets of the master boundary that the slave does not meet, although it lies opposite within the search distance.
#[derive(Clone, Debug, PartialEq)]
pub struct Unmet<const D: usize> {
    /// How many.
    pub facets: usize,
    /// The area of them that lies opposite.
    pub area: f64,
    /// The middle of the one with most of it.
    pub place: [f64; D],
}

/// The contact of the boundary `facets` with the boundary `others` of another body (or of the same one, across a slit):
/// see the module for the method.
///
/// `facets` carry the multipliers. They are directed as in [`crate::mesh::Mesh::boundaries`].
///
/// # Errors
/// If the boundaries overlap, share a node, do not find each other within the search distance, or if a bound,
/// coefficient, gap or interference is negative or not finite.
pub fn mortar_contact<const D: usize>(
    body: &Body<D>,
    facets: &[Facet<D>],
    others: &[Facet<D>],
    options: &PairOptions<D>,
) -> Result<MortarContact<D>, ContactError>
where
    ElementKind: Mortar<D>,
{
    let mesh = body.mesh;
    let nodes_of = |facet: &Facet<D>| -> Vec<u32> { facet_nodes(facet).to_vec() };
    let other_nodes: HashSet<u32> = others.iter().flat_map(nodes_of).collect();
    let mut nodes = facets.iter().flat_map(nodes_of);
    if let Some(node) = nodes.find(|node| other_nodes.contains(node)) {
        let place = mesh.nodes[node as usize].into();
        return Err(ContactError::Shared { place });
    }
    // What lies just at the distance is within it.
    let distance = options.distance_between(body, facets, others) * (1.0 + 1e-9);
    let rounding = rounding(body);
    let first = Surface::new(mesh, facets, options)?;
    let second = Surface::new(mesh, others, options)?;
    let search = Search::new(mesh, others);
    let shares: Vec<FacetShares<D>> = (0..facets.len())
        .into_par_iter()
        .map(|number| {
            let slave = SlaveFacet::new(body, &first, number);
            let near = second.near(mesh, &search, &slave, distance);
            integrate(&slave, &near, distance, rounding, options)
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
    if let Some(place) = shares.iter().find_map(|shares| shares.folded) {
        return Err(ContactError::Folded {
            place: place.into(),
        });
    }
    let found = Places::new(body, &first, &shares).finish(body, &first, options)?;
    if found.is_empty() {
        let nearest = search.nearest(facets.iter().map(|facet| Bounds::around(mesh, facet)));
        return Err(ContactError::Apart { distance, nearest });
    }
    Ok(MortarContact {
        places: found,
        unmet: unmet(body, [&first, &second], &shares, distance),
    })
}

/// What the master boundary sees of the slave, and is not met there.
fn unmet<const D: usize>(
    body: &Body<D>,
    [first, second]: [&Surface<D>; 2],
    shares: &[FacetShares<D>],
    distance: f64,
) -> Option<Unmet<D>>
where
    ElementKind: Mortar<D>,
{
    let mut met = vec![0.0; second.facets.len()];
    for &(number, area) in shares.iter().flat_map(|shares| &shares.met) {
        met[number] += area;
    }
    let search = Search::new(body.mesh, first.facets);
    let opposite: Vec<f64> = (0..second.facets.len())
        .into_par_iter()
        .map(|number| {
            let facet = SlaveFacet::new(body, second, number);
            let near = first.near(body.mesh, &search, &facet, distance);
            let covers = <ElementKind as Mortar<D>>::covers(&facet, &near, distance);
            let points = covers.iter().flat_map(|cover| &cover.points);
            points.map(|point| point.weight).sum()
        })
        .collect();
    let missed = (met.iter().zip(&opposite).enumerate())
        .filter(|(_, (met, opposite))| **met < MET * **opposite);
    let missed: Vec<(usize, f64)> = missed.map(|(number, (_, area))| (number, *area)).collect();
    let &(most, _) = missed.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    Some(Unmet {
        facets: missed.len(),
        area: missed.iter().map(|m| m.1).sum(),
        place: body.mesh.facet_middle(&second.facets[most]),
    })
}

impl<const D: usize> MasterFacet<D> {
    /// Its nodes.
    fn nodes(&self) -> &[u32] {
        &self.nodes[..self.len]
    }

    /// Where they are.
    fn places(&self) -> &[[f64; D]] {
        &self.places[..self.len]
    }
}

impl<const D: usize> SlaveFacet<D> {
    fn new(body: &Body<D>, surface: &Surface<D>, number: usize) -> Self
    where
        ElementKind: Topology<D>,
    {
        let facet = &surface.facets[number];
        let (nodes, len) = body.mesh.places_of(facet);
        let mut normals = [surface.outward[number]; 9];
        for (normal, &node) in normals.iter_mut().zip(facet_nodes(facet)) {
            *normal = surface.normal(node, surface.part[number]);
        }
        Self {
            len,
            nodes,
            normals,
            normal: surface.outward[number],
            slack: surface.slack[number],
            depth: body.depth(),
        }
    }

    /// Where its nodes are.
    fn places(&self) -> &[[f64; D]] {
        &self.nodes[..self.len]
    }
}

/// What part of its size may be missed along a border of a facet that bends by this part of it: nothing of a flat one, which
/// shows where that of the other side is.
fn missed(bend: f64) -> f64 {
    bend.clamp(SAME, MISSED)
}

/// How far a facet of second order may be off the smooth surface that its nodes lie on: an edge of length h whose middle is
/// off its chord by s, and along it by e, is off a circle by s³/h² and, as it is parabolic in another parameter, by s e/h.
/// Facets of first order are what they are.
fn slack<const D: usize>(nodes: &[[f64; D]; 9], n_corners: usize, len: usize) -> f64 {
    let edges = (nodes[n_corners..len].iter().enumerate()).take(n_corners);
    let of_edge = |(k, &middle): (usize, &[f64; D])| {
        let (a, b) = (nodes[k], nodes[(k + 1) % n_corners]);
        let chord = minus(b, a);
        let h = length(chord);
        let off: [f64; D] = std::array::from_fn(|c| middle[c] - 0.5 * (a[c] + b[c]));
        let along = dot(off, chord) / (h * h);
        let across = length(std::array::from_fn::<_, D, _>(|c| {
            off[c] - along * chord[c]
        }));
        across * (along.abs() + (across / h).powi(2))
    };
    edges.map(of_edge).fold(0.0, f64::max)
}

/// What a facet of the slave boundary adds to the integrals of places.
struct FacetShares<const D: usize> {
    /// Of each part of the master boundary that it meets.
    covers: Vec<Shares<D>>,
    /// How much of which facets of the master boundary it meets.
    met: Vec<(usize, f64)>,
    /// The deepest overlap and where.
    depth: f64,
    place: [f64; D],
    /// A place where a curved facet cannot be seen from the other one.
    folded: Option<[f64; D]>,
}

/// What is covered of a facet by one part of the master boundary, and what it adds to the integrals of its vertices.
struct Shares<const D: usize> {
    part: u32,
    vertices: Vec<Share<D>>,
}

/// The integrals of a vertex.
struct Share<const D: usize> {
    site: Site,
    place: [f64; D],
    angle: f64,
    /// ∫ βᵢ.
    area: f64,
    /// ∫ βᵢ bound, for a Tresca bound.
    bound: f64,
    /// ∫ ψᵢ gap.
    gap: f64,
    /// Whether the sides overlap anywhere there.
    overlaps: bool,
    /// ∫ βᵢ n of the slave boundary and of the master boundary.
    normals: [[f64; D]; 2],
    /// ∫ ψᵢ φₖ over the nodes of the facet; none where it is wholly covered: there ∫ ψᵢ Ñₖ are δᵢₖ ∫ βᵢ.
    own: Option<[f64; 9]>,
    /// (j, ∫ ψᵢ φⱼ).
    partners: Vec<(u32, f64)>,
}

/// Adds to the entry of a node.
fn add_to(entries: &mut Vec<(u32, f64)>, node: u32, value: f64) {
    match entries.iter_mut().find(|entry| entry.0 == node) {
        Some(entry) => entry.1 += value,
        None => entries.push((node, value)),
    }
}

/// The integrals over one facet of the slave boundary. (One text: all of them are sums over the same points, made once.)
fn integrate<const D: usize>(
    slave: &SlaveFacet<D>,
    near: &[MasterFacet<D>],
    distance: f64,
    rounding: f64,
    options: &PairOptions<D>,
) -> FacetShares<D>
where
    ElementKind: Mortar<D>,
{
    let mut all = FacetShares {
        covers: Vec::new(),
        met: Vec::new(),
        depth: 0.0,
        place: [0.0; D],
        folded: None,
    };
    for cover in <ElementKind as Mortar<D>>::covers(slave, near, distance) {
        let n = cover.vertices.len();
        let functions = |number: usize| &cover.functions[n * number..][..n];
        // Mass matrix and ∫ β over the covered part; ψ = C β with C = diag(∫ β) mass⁻¹.
        let (mut mass, mut area) = (Mat::<f64>::zeros(n, n), vec![0.0; n]);
        for (number, IntegrationPoint { weight, .. }) in cover.points.iter().enumerate() {
            let beta = functions(number);
            for i in 0..n {
                for j in i..n {
                    mass[(j, i)] += weight * beta[i] * beta[j];
                }
                area[i] += weight * beta[i];
            }
        }
        let dual = dual(&mass, &area);
        let vertices = cover.vertices.iter().zip(&area);
        let mut vertices: Vec<Share<D>> = vertices
            .map(|(&(site, place, angle), &area)| Share {
                site,
                place,
                angle,
                area,
                bound: 0.0,
                gap: 0.0,
                overlaps: false,
                normals: [[0.0; D]; 2],
                own: (!cover.is_whole).then_some([0.0; 9]),
                partners: Vec::new(),
            })
            .collect();
        for (number, point) in cover.points.iter().enumerate() {
            let &IntegrationPoint {
                place: x,
                weight: w,
                ..
            } = point;
            let other = &near[point.other];
            match all.met.last_mut() {
                Some(last) if last.0 == other.number => last.1 += w,
                _ => all.met.push((other.number, w)),
            }
            if !point.distance.is_finite() {
                all.folded = Some(x);
            }
            let beta = functions(number);
            let gap = options.gap_at(x, point.distance, rounding.max(slave.slack + other.slack));
            // NaN from an expression must stay.
            if gap < -all.depth && !options.may_overlap() {
                all.depth = -gap;
                all.place = x;
            }
            let bound = match options.friction {
                Friction::Tresca(tresca) => tresca(x),
                _ => 0.0,
            };
            for (i, share) in vertices.iter_mut().enumerate() {
                let psi = (1..n).fold(dual[(i, 0)] * beta[0], |sum, k| {
                    sum + dual[(i, k)] * beta[k]
                });
                share.gap += w * psi * gap;
                share.overlaps |= gap < 0.0;
                share.bound += w * beta[i] * bound;
                for (sum, normal) in share.normals.iter_mut().zip(&point.normals) {
                    (0..D).for_each(|c| sum[c] += w * beta[i] * normal[c]);
                }
                if let Some(own) = &mut share.own {
                    for (own, phi) in own.iter_mut().zip(point.slave) {
                        *own += w * psi * phi;
                    }
                }
                for (&node, master) in other.nodes().iter().zip(point.master) {
                    add_to(&mut share.partners, node, w * psi * master);
                }
            }
        }
        all.covers.push(Shares {
            part: cover.part,
            vertices,
        });
    }
    all
}

/// C of ψ = C β = diag(∫ β) mass⁻¹ β, from the lower triangle of the mass matrix.
///
/// Where what is covered is so thin and bent that its functions depend on each other there, the pseudo-inverse of the
/// matrix keeps Σψ = 1 and the moments.
fn dual(mass: &Mat<f64>, area: &[f64]) -> Mat<f64> {
    let n = area.len();
    if n == 2 {
        let (m00, m01, m11) = (mass[(0, 0)], mass[(1, 0)], mass[(1, 1)]);
        let det = m00 * m11 - m01 * m01;
        let other = [[m11, -m01], [-m01, m00]];
        return Mat::from_fn(2, 2, |i, j| area[i] * other[i][j] / det);
    }
    let lower = |i: usize, j: usize| mass[(i.max(j), i.min(j))];
    let inverse = match dense::cholesky(Mat::from_fn(n, n, lower)) {
        Some(factor) => dense::inverse(&factor),
        None => {
            let scale: Vec<f64> = (0..n).map(|i| mass[(i, i)].sqrt().recip()).collect();
            let scaled = Mat::from_fn(n, n, |i, j| scale[i] * lower(i, j) * scale[j]);
            let inverse = dense::pseudo_inverse(&scaled, 1e-10);
            Mat::from_fn(n, n, |i, j| scale[i] * inverse[(i, j)] * scale[j])
        }
    };
    Mat::from_fn(n, n, |i, j| area[i] * inverse[(i.max(j), i.min(j))])
}
