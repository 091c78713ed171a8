//! Contact between two boundaries whose meshes need not match: a segment-based mortar method with dual (biorthogonal) multipliers
//! that belong to places.
//!
//! The condition of place i on the slave boundary is
//!
//! ```text
//! νᵢ · (Σₖ (Wᵢₖ/Dᵢ) uₖ − Σⱼ (Mᵢⱼ/Dᵢ) uⱼ) ≤ dᵢ,     Dᵢ = ∫ βᵢ ds,   Wᵢₖ = ∫ ψᵢ φₖ ds,   Mᵢⱼ = ∫ ψᵢ φⱼ ds,   dᵢ = ∫ ψᵢ gap ds / Dᵢ
//! ```
//!
//! with νᵢ halfway between the normals of both sides, k over the nodes of the slave boundary and j over those of the second one.
//! All integrals are taken over the intersections of the facets of both meshes: in the plane segments between projected nodes
//! (`mortar/segments.rs`), in space polygons (`mortar/polygons.rs`). The dual functions ψ span what the β of a facet span, with ∫
//! ψᵢ βⱼ ds = δᵢⱼ Dᵢ.
//!
//! - **A facet that is wholly covered** has its own shape functions as β: its places are its nodes, Wᵢₖ = δᵢₖ Dᵢ (Wohlmuth 2000;
//!   Popp, Gee and Wall 2009). On facets of second order β are the functions of `contact/transformed.rs`, so that each has a
//!   positive integral, and W belongs to the displacements of these functions.
//! - **A facet that is covered in part** has its places at the vertices of the convex hull P of the part that one
//!   connected part of the master boundary covers. Its β are the barycentric functions of P (Wachspress 1975; in the
//!   plane those of a segment, `mortar/hull.rs` in space). Since Σβ = 1 and Σβᵢxᵢ = x, Σψ = 1 and ∫ ψᵢ x ds = Dᵢ xᵢ. So
//!   a uniform pressure is transferred exactly, and the force of a place acts exactly there, on the border of the
//!   covered part. With the facet's own functions it would act at nodes beyond that border, and a body would be
//!   supported where nothing is.
//! - **A facet with nodes that supports hold** in a direction, or that move alike with others, has no multipliers at
//!   these nodes in that direction. Their β are added to those of the free places F beside them, β̃ = β + Σ c βₕ, and ψ = C
//!   β̃ among those with C = diag(1ᵀG) G⁻¹, Gᵢⱼ = ∫ β̃ᵢ βⱼ over F. Then Σψ = 1 again, and where one place is free
//!   ψ = 1. With ψ of both signs the row of a held place would contain only the master's nodes and forbid the master to
//!   bend away; with βₕ there were more rows than the slave can follow. Where all are held, ψ = β ≥ 0. Along
//!   tangents with friction a place that is free along its normal keeps its friction: ψₕ = βₕ. Each direction e has
//!   its own ψ, and a row combines all of them with the weights (v·e)², where v is the normal or the tangent of the
//!   facet. The directions e are those of the supports, and the tangents are along them where they can be: the answer
//!   turns with the bodies. Facets of second order that are held along their normals have the places of their corners,
//!   with linear β, as if they were covered in part. Reason: β of second order have both signs. Ties may have them, and
//!   keep β: without the held nodes there are as many rows as free nodes, and nodes that coincide move as one.
//! - **Curved facets** follow their shape functions: normals, gaps and measures are those of the true surface, and a point of one
//!   facet is found on the other by Newton's method. In space the intersection of two of them is clipped between straight lines
//!   from node to node, on a plane for each facet of the slave.
//! - **Two sides that are round**, one in the other one, have ν along the radius of the slave ([`super::PairOptions::centres`]). Halfway
//!   between facets that do not match, forces would pass the axis at a small distance, all on the same side. Gaps are those of
//!   the arcs through the nodes of each facet, and do not change as the sides turn. Both turn and move with the facets around a node.
//! - Facets share their common places: nodes, and points on common edges. Where such places are closer to each other than the mesh
//!   can resolve, one passes its share to the other; corners of the covered part stay.
//! - Both boundaries are cut at edges sharper than an angle ([`super::PairOptions::edge_angle`]): each smooth part has its own
//!   places and normals.
//!
//! Weights Mᵢⱼ/Dᵢ add up to 1, so that the contact forces of a pair add up to zero. Rows may depend on each other where several
//! parts of the master boundary are under one facet; forces are still unique.

mod bulge;
mod flat;
mod hull;
mod itself;
mod places;
mod polygons;
mod segments;
mod surface;

use super::search::{Bounds, Search};
use super::sectors;
use super::transformed::n_middles;
use super::{ContactError, ContactPlace, Friction, PairOptions, frame, rounding, turn_tangents};
use crate::dense;
use crate::elasticity::{Body, Depth, Plane};
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Topology, bounds, facet_nodes};
use bulge::Bulge;
pub(crate) use bulge::{is_straight, ridge};
use faer::Mat;
use faer::linalg::solvers::DenseSolveCore as _;
pub(crate) use itself::are_excluded;
use itself::{Behind, SHALLOW};
pub use itself::{Excluded, Itself, Wall, walls};
use places::Places;
use rayon::prelude::*;
use std::collections::{HashMap, HashSet};
use std::sync::OnceLock;
use surface::Surface;
pub(crate) use surface::{nodes_around, smooth_parts_of};

pub use super::search::Beam;

/// A facet of the slave boundary, the one that has the multipliers.
#[derive(Clone, Debug)]
pub struct SlaveFacet<const D: usize> {
    /// The number of its nodes.
    len: usize,
    /// Their positions, corners first.
    nodes: [[f64; D]; 9],
    /// The averaged normals there.
    normals: [[f64; D]; 9],
    /// Its mean outward unit normal.
    normal: [f64; D],
    /// Its largest deviation from the surface that it approximates.
    slack: f64,
    bulge: Bulge<D>,
    /// The extent of the body perpendicular to the plane.
    depth: Depth,
    plane: Plane,
    /// The directions along which some of its nodes are held.
    held: Vec<HeldAlong<D>>,
    /// Whether the bodies move: [`PairOptions::moves`].
    moves: bool,
    /// Whether it is tied: its multipliers may have both signs.
    is_tied: bool,
}

/// Directions along which the same nodes of a facet are held.
#[derive(Clone, Debug)]
struct HeldAlong<const D: usize> {
    /// The projector onto these directions.
    onto: [[f64; D]; D],
    /// The nodes that are held.
    nodes: [bool; 9],
}

impl<const D: usize> HeldAlong<D> {
    /// The directions along which some of the nodes are held, if `ways` of a node are the unit vectors along which it is.
    fn of(nodes: &[u32], ways: &HashMap<u32, Vec<[f64; D]>>) -> Vec<Self> {
        let ways_of = |node: &u32| ways.get(node).map_or(&[][..], |ways| ways);
        let basis = basis_of(nodes.iter().flat_map(ways_of));
        let mut all: Vec<Self> = Vec::new();
        for way in basis {
            let mut held = [false; 9];
            for (held, node) in held.iter_mut().zip(nodes) {
                let along = ways_of(node).iter().map(|w| dot(*w, way).powi(2));
                *held = along.sum::<f64>() > 0.5;
            }
            if !held.contains(&true) {
                continue;
            }
            let alike = all.iter().position(|other| other.nodes == held);
            let at = alike.unwrap_or_else(|| {
                all.push(Self {
                    onto: [[0.0; D]; D],
                    nodes: held,
                });
                all.len() - 1
            });
            for a in 0..D {
                for b in 0..D {
                    all[at].onto[a][b] += way[a] * way[b];
                }
            }
        }
        all
    }

    /// The part of it in a unit vector: vᵀ P v. Within 6° of these directions, or of all across them, it is all or nothing:
    /// no place is left with a hundredth of itself.
    fn part(onto: &[[f64; D]; D], v: [f64; D]) -> f64 {
        const ALL: f64 = 0.99;
        match dot(v, onto.map(|row| dot(row, v))) {
            part if part > ALL => 1.0,
            part if part < 1.0 - ALL => 0.0,
            part => part,
        }
    }

    /// The vertices of the covered part that are held.
    fn vertices(&self, cover: &Cover<D>, len: usize, n_corners: usize) -> Vec<bool> {
        if cover.is_whole {
            return self.nodes[..len].to_vec();
        }
        // Between nodes the held part of a vertex varies linearly from corner to corner.
        let n_middles = n_middles(n_corners);
        let mut part = [0.0; 9];
        for (k, part) in part[..n_corners].iter_mut().enumerate() {
            let beside = [k, (k + n_middles - 1) % n_middles].map(|edge| n_corners + edge);
            let inner = n_corners + n_middles..len;
            let near = beside.into_iter().filter(|&b| b < len).chain(inner);
            *part = f64::from(u8::from(
                self.nodes[k] || near.into_iter().any(|k| self.nodes[k]),
            ));
        }
        let corners = part;
        for k in n_corners..len {
            part[k] = match k - n_corners {
                edge if edge < n_middles => 0.5 * (corners[edge] + corners[(edge + 1) % n_corners]),
                _ => corners[..n_corners].iter().sum::<f64>() / n_corners as f64,
            };
        }
        (cover.vertices.iter())
            .map(|vertex| {
                let held = (vertex.shape.iter().zip(part)).map(|(phi, part)| phi * part);
                held.sum::<f64>() > 0.5 + SAME
            })
            .collect()
    }
}

/// A basis from unit vectors, orthonormal: each next direction is what the others leave of the one that has most left.
/// The axes complete it. So it turns with the vectors, and each that is perpendicular to all others is in it.
fn basis_of<'a, const D: usize>(ways: impl Iterator<Item = &'a [f64; D]> + Clone) -> [[f64; D]; D] {
    /// Vectors that leave less are within 30° of the directions before, where no two are perpendicular to each other.
    const LEFT: f64 = 0.5;
    let axes: [[f64; D]; D] =
        std::array::from_fn(|a| std::array::from_fn(|c| f64::from(u8::from(a == c))));
    let mut basis = axes;
    for k in 0..D {
        let left = |way: &[f64; D]| {
            let before = basis[..k].iter();
            before.fold(*way, |left, b| minus(left, b.map(|c| c * dot(*b, left))))
        };
        // The first of several that differ by rounding.
        let longer = |most: [f64; D], left: [f64; D]| match length(left) > length(most) + SAME {
            true => left,
            false => most,
        };
        let of_ways = ways.clone().map(left).fold([0.0; D], longer);
        basis[k] = unit(match length(of_ways) > LEFT {
            true => of_ways,
            false => axes.iter().map(left).fold([0.0; D], longer),
        });
    }
    basis
}

/// A facet of the master boundary that the slave may meet.
#[derive(Clone, Copy, Debug)]
pub struct MasterFacet<const D: usize> {
    /// Its number in the boundary.
    number: usize,
    /// The number of its nodes.
    len: usize,
    /// These.
    nodes: [u32; 9],
    /// Their positions, corners first.
    places: [[f64; D]; 9],
    /// Its mean outward unit normal.
    normal: [f64; D],
    /// Its largest deviation from the surface that it approximates.
    slack: f64,
    bulge: Bulge<D>,
    /// The smooth part of the boundary that it belongs to.
    part: u32,
    /// The deepest overlap with it.
    deepest: f64,
    /// Whether of several the one counts that a way out of the body from there comes to first; else the nearest.
    is_first: bool,
    /// Whether it is not met, but is in the way of what is behind it.
    hides: bool,
}

impl<const D: usize> MasterFacet<D> {
    /// Whether it may be met at this distance, up to a largest one.
    fn is_within(&self, distance: f64, largest: f64) -> bool {
        distance <= largest && -distance <= largest.min(self.deepest)
    }

    /// Of several that are at these distances the one with the least rank counts.
    fn rank(&self, distance: f64) -> f64 {
        if self.is_first {
            distance
        } else {
            distance.abs()
        }
    }
}

/// A point where a facet of the slave boundary meets one of the master: an integration point of their intersection.
#[derive(Clone, Copy, Debug)]
pub struct IntegrationPoint<const D: usize> {
    /// The number of the other facet among those nearby.
    other: usize,
    /// The place on the slave boundary.
    place: [f64; D],
    /// φ of the nodes of the facet there.
    slave: [f64; 9],
    /// φ of the nodes of the other facet, at the place that it meets.
    master: [f64; 9],
    /// The outward unit normals of both there.
    normals: [[f64; D]; 2],
    /// Their distance, along the averaged normal, between round sides that of the arcs; negative where they overlap.
    distance: f64,
    /// The weight, with how far the body reaches perpendicular to the plane in it.
    weight: f64,
}

/// The site of a vertex of the covered part on its facet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Site {
    /// At this node.
    Node(usize),
    /// On the edge from one node to the next one on the border, at this fraction of its length.
    Edge([usize; 2], f64),
    /// Inside.
    Inside,
}

/// A place where the covered part of a facet transfers forces.
#[derive(Clone, Copy, Debug)]
pub struct Vertex<const D: usize> {
    site: Site,
    place: [f64; D],
    /// The angle of the covered part there, in half turns (in the plane a half for either end). Around a place on the
    /// border of all covered parts these add up to 1 or, at a corner, to less.
    angle: f64,
    /// φ of the nodes of the facet there.
    shape: [f64; 9],
}

impl<const D: usize> Vertex<D> {
    /// The node `k` of a facet.
    fn at_node(slave: &SlaveFacet<D>, k: usize, angle: f64) -> Self {
        let mut shape = [0.0; 9];
        shape[k] = 1.0;
        Self {
            site: Site::Node(k),
            place: slave.nodes[k],
            angle,
            shape,
        }
    }
}

/// The part of a slave facet that one connected part of the master boundary covers.
#[derive(Clone, Debug)]
pub struct Cover<const D: usize> {
    /// The smooth part of the master boundary.
    part: u32,
    /// The places where it transfers forces, the vertices of its convex hull.
    vertices: Vec<Vertex<D>>,
    /// Integration points, those with one facet one after the other.
    points: Vec<IntegrationPoint<D>>,
    /// Whether the whole facet is covered: its vertices are its nodes then.
    is_whole: bool,
    /// β of the vertices at each of them.
    functions: Vec<f64>,
}

/// The geometry of two boundaries in the plane and in space.
pub trait Mortar<const D: usize>: Topology<D> {
    /// A box around everything that a facet can meet within a distance.
    fn beam(slave: &SlaveFacet<D>, distance: f64) -> Beam<D>;

    /// The covered parts of a facet within the distance: only the nearest, where several overlap.
    fn covers(slave: &SlaveFacet<D>, near: &[MasterFacet<D>], distance: f64) -> Vec<Cover<D>>;

    /// The weight of a facet's normal at each of its corners in the averaged normal.
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
/// Vertices this near to a corner or an edge of their facet, in its size, are there, unless bodies move.
const SAME: f64 = 1e-9;
/// The same relative to the least width of the covered part: places of a needle stay separate.
const SAME_OF_WIDTH: f64 = 1e-2;
/// A facet counts as wholly covered if at most this part of its size is missed along a border, and it bends by as much.
/// Where two curved boundaries end in one plane, the projection of one onto the other misses the gap between them times
/// the slope there. At a few parts in a thousand pressures were off by up to 18 % on such a border, and are by 6 % (a
/// wave of 8 × 10 faces against one of first order).
const MISSED: f64 = 1e-2;
/// Newton's method has found a point of a facet if its last step is below this. Its steps decrease quadratically, down
/// to the rounding of a facet that is small compared with its distance from the origin.
const CONVERGED: f64 = 1e-6;
/// A part of a smooth boundary may escape integration because of curvature: if less than this part of the opposite area
/// is integrated, a note reports it.
const MET: f64 = 0.5;

/// The contact of two boundaries.
#[derive(Clone, Debug)]
pub struct MortarContact<const D: usize> {
    /// The places that may come into contact.
    pub places: Vec<ContactPlace<D>>,
    /// The part of the master boundary that is opposite the slave, but does not meet it.
    pub unmet: Option<Unmet<D>>,
}

/// Facets of the master boundary that the slave does not meet, although they are opposite it within the search
/// distance.
#[derive(Clone, Debug, PartialEq)]
pub struct Unmet<const D: usize> {
    /// The number of facets.
    pub facets: usize,
    /// The part of their area that is opposite the slave.
    pub area: f64,
    /// The middle of the one with most of it.
    pub place: [f64; D],
}

/// The contact of the boundary `facets` with the boundary `others` of another body (or of the same one, across a slit):
/// see the module for the method.
///
/// `facets` carry the multipliers. They are directed as in [`crate::mesh::Mesh::boundaries`]. With [`PairOptions::itself`] both are the
/// same boundary, which meets itself.
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
    if let (Some(sectors), None) = (options.sectors, options.itself) {
        return sectors::around(
            sectors,
            body,
            [facets, others],
            options,
            |around, body, options| {
                let found = mortar_contact(body, &around.facets, &around.others, options)?;
                Ok(MortarContact {
                    places: around.beginning(sectors, found.places),
                    ..found
                })
            },
        );
    }
    let mesh = body.mesh;
    if options.itself.is_none() {
        let nodes_of = |facet: &Facet<D>| -> Vec<u32> { facet_nodes(facet).to_vec() };
        let other_nodes: HashSet<u32> = others.iter().flat_map(nodes_of).collect();
        let mut nodes = facets.iter().flat_map(nodes_of);
        if let Some(node) = nodes.find(|node| other_nodes.contains(node)) {
            let place = mesh.nodes[node as usize].into();
            return Err(ContactError::Shared { place });
        }
    }
    // A point exactly at the distance is within it.
    let distance = options.distance_between(body, facets, others) * (1.0 + 1e-9);
    let rounding = rounding(body);
    let depths = body.depths();
    let [own, there] = options.centres;
    let first = Surface::new(mesh, facets, &depths, options, own)?;
    let opposite = match options.itself {
        Some(_) => None,
        None => Some(Surface::new(mesh, others, &depths, options, there)?),
    };
    let second = opposite.as_ref().unwrap_or(&first);
    let search = Search::new(mesh, others);
    // All of the outside, for the rare facets that need it.
    let (outside, skin, walls) = (OnceLock::new(), OnceLock::new(), OnceLock::new());
    let behind = || -> Option<&Behind<D>> {
        let nodes = || (0..mesh.nodes.len() as u32).collect::<Vec<_>>();
        let outside = outside.get_or_init(|| mesh.outer_facets_at(&nodes(), true));
        let skin = skin.get_or_init(|| Surface::new(mesh, outside, &depths, options, &[]).ok());
        let made = walls.get_or_init(|| skin.as_ref().map(|skin| Behind::new(body, skin)));
        made.as_ref()
    };
    let carries = (options.itself)
        .map(|itself| itself.carriers(body, &first, &search, distance, options, &behind));
    let shares: Vec<FacetShares<D>> = (0..facets.len())
        .into_par_iter()
        .map(|number| {
            if (carries.as_ref()).is_some_and(|(carries, _)| !carries[number]) {
                return FacetShares::default();
            }
            let mut slave = SlaveFacet::new(body, &first, number);
            slave.moves = options.moves;
            slave.is_tied = matches!(options.friction, Friction::Tied);
            if let Some(held) = options.held {
                slave.held = HeldAlong::of(facet_nodes(&facets[number]), held);
            }
            let mut near = second.near(mesh, &search, &slave, distance);
            if let (Some(itself), Some((carries, limits))) = (options.itself, &carries) {
                itself.may_meet(facets, options.walls, number, &mut near);
                for other in &mut near {
                    other.hides |= carries[other.number];
                    let mut limits = limits[number].iter();
                    if let Some(limit) = limits.find(|limit| limit.0 == other.number) {
                        other.deepest = limit.1;
                    }
                }
            }
            if let (None, Some(wall)) = (options.itself, options.walls.get(number)) {
                let across = &options.walls[facets.len()..];
                near.retain(|other| !wall.is_between(&across[other.number]));
            }
            let nodes = facet_nodes(&facets[number]);
            let home = |x| options.home(number, x);
            let made = integrate(&slave, nodes, &near, distance, rounding, options, &home);
            let size = slave.size();
            if options.itself.is_some() || made.deepest <= SHALLOW * size {
                return made;
            }
            let Some(behind) = behind() else {
                return made;
            };
            let before = near.clone();
            // The sides overlap by more than a facet, or nothing is opposite: what is beyond a wall is something else.
            if made.deepest > size {
                behind.limit([&first, second], number, &mut near, distance);
            }
            behind.leave_out(&slave, &facets[number], &mut near, distance);
            let mut each = before.iter().zip(&near);
            match each.any(|(before, now)| now.deepest < before.deepest) {
                true => integrate(&slave, nodes, &near, distance, rounding, options, &home),
                false => made,
            }
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
        let nearest = match options.itself {
            Some(_) => f64::NAN,
            None => search.nearest(facets.iter().map(|facet| Bounds::around(mesh, facet))),
        };
        return Err(ContactError::Apart { distance, nearest });
    }
    Ok(MortarContact {
        places: found,
        unmet: match (options.rest, options.itself) {
            (None, None) => unmet(body, [&first, second], &shares, distance),
            _ => None,
        },
    })
}

/// The part of the slave that the master boundary sees, but does not meet.
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

    /// Their positions.
    fn places(&self) -> &[[f64; D]] {
        &self.places[..self.len]
    }
}

impl<const D: usize> SlaveFacet<D> {
    /// The diagonal of the box around its nodes.
    fn size(&self) -> f64 {
        let (low, high) = bounds(self.nodes[..self.len].iter().copied());
        length(minus(high, low))
    }

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
            bulge: surface.bulge[number],
            depth: surface.depth[number],
            plane: body.plane,
            held: Vec::new(),
            moves: false,
            is_tied: false,
        }
    }

    /// The number of corners among its nodes.
    fn n_corners(&self) -> usize {
        match (D, self.len) {
            (2, _) => 2,
            (_, 3 | 6) => 3,
            _ => 4,
        }
    }

    /// Whether it is of second order and held along its normal, and no tie: its places are then at its corners, wherever
    /// it is covered.
    fn is_linear(&self) -> bool {
        let held = self.held.iter();
        let across: f64 = held
            .map(|held| HeldAlong::part(&held.onto, self.normal))
            .sum();
        self.len > self.n_corners() && across > 0.5 && !self.is_tied
    }

    /// The positions of its nodes.
    fn places(&self) -> &[[f64; D]] {
        &self.nodes[..self.len]
    }

    /// The part of its size that may be missed along its border if it bends by `bend`: zero for a flat one, whose border
    /// shows that of the other side. Where bodies move, borders that met at rest differ a little, and Newton's method
    /// needs the same places at each of its iterations.
    fn missed(&self, bend: f64) -> f64 {
        match self.moves {
            true => MISSED,
            false => bend.clamp(SAME, MISSED),
        }
    }

    /// The distance up to which a vertex counts as a corner or as a point of an edge, as a part of the size of the facet. Where bodies move,
    /// a neighbour that misses this much counts as wholly covered, and both facets must share the corner.
    fn same(&self) -> f64 {
        if self.moves { MISSED } else { SAME }
    }
}

/// The largest deviation of a facet of second order from the smooth surface through its nodes. Take an edge of length h
/// whose middle is off its chord by s, and along it by e. It is off a circle by s³/h² and, as a parabola in another
/// parameter, by s e/h. Facets of first order have none.
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

/// The contribution of a facet of the slave boundary to the integrals of places.
struct FacetShares<const D: usize> {
    /// Its shares for each part of the master boundary that it meets.
    covers: Vec<Shares<D>>,
    /// The area of each facet of the master boundary that it meets.
    met: Vec<(usize, f64)>,
    /// The deepest overlap of all points.
    deepest: f64,
    /// The deepest overlap that is refused, and where.
    depth: f64,
    place: [f64; D],
    /// A place where a curved facet cannot be seen from the other one.
    folded: Option<[f64; D]>,
}

impl<const D: usize> Default for FacetShares<D> {
    fn default() -> Self {
        Self {
            covers: Vec::new(),
            met: Vec::new(),
            deepest: 0.0,
            depth: 0.0,
            place: [0.0; D],
            folded: None,
        }
    }
}

/// The part of a facet that one part of the master boundary covers, and its contribution to the integrals of its
/// vertices.
struct Shares<const D: usize> {
    part: u32,
    /// Whether both are round, and fit.
    is_round: bool,
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
    /// The same between flat facets.
    flat: f64,
    /// The least gap there, and the largest.
    range: [f64; 2],
    /// ∫ βᵢ n of the slave boundary and of the master boundary.
    normals: [[f64; D]; 2],
    /// ∫ ψᵢ φₖ over the nodes of the facet; none where it is wholly covered: there ∫ ψᵢ Ñₖ are δᵢₖ ∫ βᵢ.
    own: Option<[f64; 9]>,
    /// (j, ∫ ψᵢ φⱼ).
    partners: Vec<(u32, f64)>,
    /// The change of these by held directions.
    held: Option<Change<D>>,
}

/// The change of the integrals of a place by held directions.
#[derive(Clone, Debug)]
struct Change<const D: usize> {
    /// The projector that turns the tangents: [`turn_tangents`].
    onto: Option<[[f64; D]; D]>,
    /// The directions of the rows.
    frame: [[f64; D]; D],
    /// In the rows along ν and along each tangent.
    rows: [Integrals; D],
}

/// The integrals of some ψ.
#[derive(Clone, Debug, Default)]
struct Integrals {
    /// ∫ ψ.
    area: f64,
    /// ∫ ψ gap.
    gap: f64,
    /// The same between flat facets.
    flat: f64,
    /// (k, ∫ ψ φₖ) over the nodes of the slave.
    own: Vec<(u32, f64)>,
    /// (j, ∫ ψ φⱼ) over those of the master.
    partners: Vec<(u32, f64)>,
}

impl Integrals {
    /// Adds `factor` times others.
    fn add(&mut self, factor: f64, other: &Self) {
        self.area += factor * other.area;
        self.gap += factor * other.gap;
        self.flat += factor * other.flat;
        for (to, from) in [
            (&mut self.own, &other.own),
            (&mut self.partners, &other.partners),
        ] {
            for &(node, weight) in from {
                add_to(to, node, factor * weight);
            }
        }
    }
}

/// Adds to the entry of a node.
fn add_to(entries: &mut Vec<(u32, f64)>, node: u32, value: f64) {
    match entries.iter_mut().find(|entry| entry.0 == node) {
        Some(entry) => entry.1 += value,
        None => entries.push((node, value)),
    }
}

/// Leaves out what covers hardly anything of a facet that another part covers wholly: beside a concave edge, the flank
/// behind it as soon as the edges of both sides are not exactly in one place. Such parts, with forces of their own, come
/// and go from one iteration to the next.
fn without_slivers<const D: usize>(covers: &mut Vec<Cover<D>>) {
    let size = |cover: &Cover<D>| -> f64 { cover.points.iter().map(|point| point.weight).sum() };
    let whole = covers.iter().filter(|cover| cover.is_whole);
    let whole = whole.map(size).fold(0.0, f64::max);
    covers.retain(|cover| cover.is_whole || size(cover) > MISSED * whole);
}

/// 0 for facets whose corners are opposite to each other, 1 beyond a part of the shortest edge that rises: facets of meshes that match deviate alike
/// from a surface, whatever is known of it.
fn apart<const D: usize>(slave: &SlaveFacet<D>, other: &MasterFacet<D>) -> f64 {
    /// Known curvatures of both sides differ by some hundredths, rises thus by as much as those of facets this far apart.
    const MATCH: f64 = 0.1;
    let both = [
        &slave.nodes[..slave.bulge.corners],
        &other.places[..other.bulge.corners],
    ];
    let across = |a: [f64; D], b: [f64; D]| -> f64 {
        let way = minus(a, b);
        let part = dot(way, slave.normal);
        let across: [f64; D] = std::array::from_fn(|c| way[c] - part * slave.normal[c]);
        length(across)
    };
    let off = |from: &[[f64; D]], to: &[[f64; D]]| {
        let nearest = |a: &[f64; D]| to.iter().map(|b| across(*a, *b)).fold(f64::MAX, f64::min);
        from.iter().map(nearest).fold(0.0, f64::max)
    };
    let shortest = (slave.bulge.shortest(both[0])).min(other.bulge.shortest(both[1]));
    let off = off(both[0], both[1]).min(off(both[1], both[0]));
    (off / (MATCH * shortest)).min(1.0)
}

/// The integrals over one facet of the slave boundary. (One function, because all of them are sums over the same
/// points.)
fn integrate<const D: usize>(
    slave: &SlaveFacet<D>,
    nodes: &[u32],
    near: &[MasterFacet<D>],
    distance: f64,
    rounding: f64,
    options: &PairOptions<D>,
    home: &impl Fn([f64; D]) -> [f64; D],
) -> FacetShares<D>
where
    ElementKind: Mortar<D>,
{
    let mut all = FacetShares::default();
    let gap_at = |point: &IntegrationPoint<D>, distance: f64| {
        let slack = slave.slack + near[point.other].slack;
        options.gap_at(home(point.place), distance, rounding.max(slack))
    };
    let mut covers = <ElementKind as Mortar<D>>::covers(slave, near, distance);
    if slave.moves {
        without_slivers(&mut covers);
    }
    for mut cover in covers {
        // All facets of a smooth part are round about one axis.
        let mut others = cover.points.iter().map(|point| &near[point.other]);
        let is_round = (others.next()).is_some_and(|other| {
            let faces = (slave.bulge).faces(slave.normal, &other.bulge, other.normal);
            slave.bulge.fits(&other.bulge) && faces
        });
        let flat: Vec<f64> = cover.points.iter().map(|point| point.distance).collect();
        for point in &mut cover.points {
            let other = &near[point.other];
            if is_round {
                point.distance -= slave.bulge.at(&point.slave) + other.bulge.at(&point.master);
            } else if slave.bulge.is_known
                && other.bulge.is_known
                && (slave.bulge).faces(slave.normal, &other.bulge, other.normal)
            {
                let flat = point.distance;
                let rises = slave.bulge.rise(&point.slave) + other.bulge.rise(&point.master);
                if rises != 0.0 {
                    point.distance -= rises * apart(slave, other);
                }
                // Facets that are drawn as touching do so.
                if flat >= -rounding && !options.may_overlap() {
                    point.distance = point.distance.max(0.0);
                }
            }
        }
        let depths = cover.points.iter().map(|point| -point.distance);
        all.deepest = depths.fold(all.deepest, f64::max);
        // Each gap, and that between flat facets.
        let gaps = cover.points.iter().zip(&flat).map(|(point, &flat)| {
            let gap = gap_at(point, point.distance);
            match flat == point.distance {
                true => [gap; 2],
                false => [gap, gap_at(point, flat)],
            }
        });
        let gaps: Vec<[f64; 2]> = gaps.collect();
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
            .map(|(vertex, &area)| Share {
                site: vertex.site,
                place: vertex.place,
                angle: vertex.angle,
                area,
                bound: 0.0,
                gap: 0.0,
                flat: 0.0,
                range: [f64::INFINITY, f64::NEG_INFINITY],
                normals: [[0.0; D]; 2],
                own: (!cover.is_whole).then_some([0.0; 9]),
                partners: Vec::new(),
                held: None,
            })
            .collect();
        // The vertices that are held along the normal.
        let of_vertices = |held: &HeldAlong<D>| held.vertices(&cover, slave.len, slave.n_corners());
        let mut across = vec![0.0; n];
        for held in &slave.held {
            let part = HeldAlong::part(&held.onto, slave.normal);
            let vertices = across.iter_mut().zip(of_vertices(held));
            vertices.for_each(|(sum, is)| *sum += part * f64::from(u8::from(is)));
        }
        // Functions of second order have no place whose share could be passed on, unless it may be of either sign.
        let is_ring = !cover.is_whole || slave.len == slave.n_corners();
        let hands_on = is_ring || slave.is_tied;
        let mut frame = frame(slave.normal);
        let mut ontos = slave.held.iter().map(|held| held.onto);
        let onto = ontos.find(|onto| turn_tangents(&mut frame, onto));
        for held in &slave.held {
            let is_held = of_vertices(held);
            if !is_held.contains(&true) {
                continue;
            }
            let role = |a: usize| -> Vec<Role> {
                let all = is_held.iter().zip(&across);
                all.map(|(&is_held, &across)| match is_held {
                    false => Role::Free,
                    true if hands_on && (a == 0 || slave.is_tied || across > 0.5) => Role::HandsOn,
                    true => Role::Keeps,
                })
                .collect()
            };
            // The same part at all places, so that their ψ add up to 1.
            let rows = (0..D).map(|a| (a, HeldAlong::part(&held.onto, frame[a])));
            for (a, part) in rows.filter(|row| row.1 > 0.0) {
                let change = held_dual(&mass, &area, &role(a), is_ring) - &dual;
                for (i, share) in vertices.iter_mut().enumerate() {
                    let change_of = share.held.get_or_insert_with(|| Change {
                        onto,
                        frame,
                        rows: std::array::from_fn(|_| Integrals::default()),
                    });
                    let sums = &mut change_of.rows[a];
                    for (number, point) in cover.points.iter().enumerate() {
                        let (beta, other) = (functions(number), &near[point.other]);
                        let psi: f64 = (0..n).map(|k| change[(i, k)] * beta[k]).sum();
                        let w = part * point.weight * psi;
                        sums.area += w;
                        sums.gap += w * gaps[number][0];
                        sums.flat += w * gaps[number][1];
                        for (&node, phi) in nodes.iter().zip(point.slave) {
                            add_to(&mut sums.own, node, w * phi);
                        }
                        for (&node, phi) in other.nodes().iter().zip(point.master) {
                            add_to(&mut sums.partners, node, w * phi);
                        }
                    }
                }
            }
        }
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
            let [gap, flat] = gaps[number];
            // NaN from an expression must stay.
            if gap < -all.depth && !options.may_overlap() {
                all.depth = -gap;
                all.place = x;
            }
            let bound = match options.friction {
                Friction::Tresca(tresca) => tresca(home(x)),
                _ => 0.0,
            };
            for (i, share) in vertices.iter_mut().enumerate() {
                let psi = (1..n).fold(dual[(i, 0)] * beta[0], |sum, k| {
                    sum + dual[(i, k)] * beta[k]
                });
                share.gap += w * psi * gap;
                share.flat += w * psi * flat;
                share.range = [share.range[0].min(gap), share.range[1].max(gap)];
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
            is_round,
            vertices,
        });
    }
    all
}

/// C of ψ = C β = diag(∫ β) mass⁻¹ β, from the lower triangle of the mass matrix.
///
/// If the covered part is so thin and bent that its functions depend on each other there, the pseudo-inverse of the
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

/// The role of the β of a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    /// It has a dual function among the free ones.
    Free,
    /// It is held, and its ψ is its β.
    Keeps,
    /// It is held, and its β goes to its neighbours.
    HandsOn,
}

/// C of ψ = C β where some vertices are held: see the module. Vertices are in their order around the covered part if they
/// are a ring, and a held one goes to those beside it; else to all.
///
/// Where that leaves a vertex less than a part of its ∫ β (on no facet that meshes have), all keep theirs: the pressure of a
/// place is its force by ∫ ψ.
fn held_dual(mass: &Mat<f64>, area: &[f64], roles: &[Role], is_ring: bool) -> Mat<f64> {
    /// Of a rectangle with one held corner the opposite one keeps 2/3, of second order with a held edge each node 0.26.
    const KEEPS: f64 = 0.25;
    let n = area.len();
    let of_role = |role: Role| (0..n).filter(|&i| roles[i] == role).collect::<Vec<_>>();
    let [free, hand_on] = [Role::Free, Role::HandsOn].map(of_role);
    // β̃ from β.
    let mut taken = Mat::<f64>::identity(n, n);
    if hand_on.len() < n {
        for &h in &hand_on {
            taken[(h, h)] = 0.0;
            let takes = |i: &usize| roles[*i] != Role::HandsOn;
            let mut to: Vec<usize> = vec![(h + 1) % n, (h + n - 1) % n];
            to.retain(takes);
            to.dedup();
            if to.is_empty() || !is_ring {
                to = (0..n).filter(takes).collect();
            }
            to.iter()
                .for_each(|&i| taken[(i, h)] = 1.0 / to.len() as f64);
        }
    }
    let lower = |i: usize, j: usize| mass[(i.max(j), i.min(j))];
    let coupled = Mat::from_fn(free.len(), free.len(), |a, b| {
        (0..n).fold(0.0, |sum, k| sum + taken[(free[a], k)] * lower(k, free[b]))
    });
    let mut all = taken.clone();
    if !free.is_empty() {
        let inverse = coupled.partial_piv_lu().inverse();
        for (a, &i) in free.iter().enumerate() {
            let whole: f64 = (0..free.len()).map(|b| coupled[(b, a)]).sum();
            for k in 0..n {
                let sum = (free.iter().enumerate()).map(|(b, &j)| inverse[(a, b)] * taken[(j, k)]);
                all[(i, k)] = whole * sum.sum::<f64>();
            }
        }
    }
    let keeps = |i: &usize| (0..n).map(|j| all[(*i, j)] * area[j]).sum::<f64>() >= KEEPS * area[*i];
    if free.iter().all(keeps) {
        all
    } else {
        Mat::identity(n, n)
    }
}
