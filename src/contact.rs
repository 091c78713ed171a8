//! Contact: from boundaries to the rows of N and T, the gaps d and the slip bounds g.
//!
//! A boundary meets a rigid [`Obstacle`] node by node ([`obstacle_contact`]), or the boundary of another body through a
//! mortar coupling of meshes that need not match ([`mortar_contact`]). The common part of two boundaries is geometry of
//! the plane or of space ([`Mortar`]); all else is written for any dimension ([`Space`]).

mod crossing;
mod equal;
mod mortar;
mod nodes;
mod obstacle;
mod rows;
mod search;
mod sectors;
#[cfg(test)]
mod tests;
mod transformed;

pub use crate::constraint::SlipBound;
pub(crate) use crossing::{crosses_itself, enclosed};
pub use equal::equal_nodes;
pub use mortar::{Excluded, Itself, Mortar, MortarContact, Unmet, Wall, mortar_contact, walls};
pub(crate) use mortar::{are_excluded, is_straight, nodes_around, ridge, smooth_parts_of};
pub use nodes::{Met, node_contact};
pub(crate) use nodes::{areas, shares};
pub use obstacle::{Obstacle, obstacle_contact};
#[cfg(feature = "files")]
pub(crate) use rows::pooled;
pub(crate) use rows::rows_of;
pub(crate) use rows::turned;
pub use rows::{ContactRows, contact_rows};
pub use sectors::Sectors;

use crate::elasticity::{Body, Field};
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Location, Mesh, Topology, bounds, facet_nodes};
use crate::problem::{SIZES, is_sized};
use std::collections::HashMap;
use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

/// A friction law on a contact boundary.
#[derive(Clone, Copy)]
pub enum Friction<'a, const D: usize = 2> {
    /// No friction.
    None,
    /// A given bound of the tangential traction, in Pa.
    Tresca(Field<'a, D>),
    /// A coefficient μ: the bound is μ times the contact pressure.
    Coulomb(Field<'a, D>),
    /// The sides hold together in every direction.
    Tied,
}

impl<const D: usize> Friction<'_, D> {
    /// The slip bound of a node at x, whose share of a Tresca bound is `force`.
    fn at(&self, x: [f64; D], force: f64) -> Result<SlipBound, ContactError> {
        Ok(match self {
            Self::None => SlipBound::Given(0.0),
            Self::Tresca(tresca) => {
                checked("Tresca bound", x, tresca(x))?;
                SlipBound::Given(checked("Tresca bound", x, force)?)
            }
            Self::Coulomb(mu) => SlipBound::Coulomb(checked("coefficient of friction", x, mu(x))?),
            Self::Tied => SlipBound::Tied,
        })
    }
}

/// Between the 45° of a circle of eight facets and the 60° of a hexagon.
pub const EDGE_ANGLE: f64 = 50.0;

/// The nodes at the sides of a sector, each with the nodes at the other side, their weights, and the turn from there to here.
pub type Seams<const D: usize> = HashMap<u32, Vec<(u32, f64, [[f64; D]; D])>>;

/// Radii of round sides that fit differ by no more than this part of the larger one: at a point of contact at the angle θ off the
/// line of both centres, the directions of both radii differ by θ times that.
pub(crate) const FITTING: f64 = 0.1;

/// Whether round sides of these radii fit into each other. Radii of sides that face their axis are below 0.
pub(crate) fn fit(one: f64, other: f64) -> bool {
    one * other < 0.0 && (one + other).abs() <= FITTING * one.abs().max(other.abs())
}

/// What a facet is round about: the axis of a cylinder, or the centre of a ball.
#[derive(Clone, Debug)]
pub struct Centre<const D: usize = 2> {
    /// A point of the axis, or the centre.
    pub point: [f64; D],
    /// Orthonormal directions perpendicular to the axis, or all of them.
    pub across: Vec<[f64; D]>,
    /// The radius; below 0 where the facet faces the axis.
    pub radius: f64,
}

impl<const D: usize> Centre<D> {
    /// The way to x from the axis, or from the centre.
    pub(crate) fn radius_to(&self, x: [f64; D]) -> [f64; D] {
        let from = minus(x, self.point);
        let ways = self.across.iter().map(|way| (way, dot(*way, from)));
        ways.fold([0.0; D], |sum, (way, along)| {
            std::array::from_fn(|c| sum[c] + along * way[c])
        })
    }
}

/// The definition of a contact apart from its boundaries.
#[derive(Clone, Copy)]
pub struct PairOptions<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The friction law.
    pub friction: Friction<'a, D>,
    /// The initial gap as a function of the place, instead of the distance of the meshes.
    pub gap: Option<Field<'a, D>>,
    /// The interference of the boundaries as a function of the place: the overlap of pressed or shrunk parts. It
    /// replaces a gap, whatever the overlap of the meshes.
    pub interference: Option<Field<'a, D>>,
    /// Whether an overlap of the meshes, beyond touching, is an interference that contact presses apart.
    pub overlap: bool,
    /// Whether an overlap of the meshes counts as touching, however deep.
    pub touching: bool,
    /// Gaps and overlaps up to this distance count as touching.
    pub adjust: f64,
    /// An offset added to the gap of the meshes: below 0 for coatings, above 0 for a law that begins with an overlap; in m.
    pub offset: f64,
    /// Stiffnesses per area of the contact itself, normal and tangential, in Pa/m, as functions of the place: the gap may close by
    /// pressure / stiffness, and slip begins after traction / stiffness. None: hard.
    pub stiffness: [Option<Field<'a, D>>; 2],
    /// Between bodies: edges sharper than this angle between the normals of neighbouring facets, in degrees, cut a
    /// boundary into parts with their own contact forces and normals.
    pub edge_angle: f64,
    /// For nodes on planes of symmetry, the normals of those planes. The averaged normals of a boundary are in these
    /// planes.
    pub symmetry: Option<&'a HashMap<u32, Vec<[f64; D]>>>,
    /// Of the nodes at the sides of sectors, where boundaries go on. Averaged normals include those there.
    pub seams: Option<&'a Seams<D>>,
    /// What each facet of both sides is round about, at rest; may be left empty. Between round facets that fit, normals are along the radii
    /// of the first side and gaps are those between the arcs, so that contact does not turn them.
    pub centres: [&'a [Option<Centre<D>>]; 2],
    /// Between bodies: orthonormal directions along which nodes are held, by supports or as they move alike with others.
    pub held: Option<&'a HashMap<u32, Vec<[f64; D]>>>,
    /// Beyond this distance bodies are no candidates for contact with each other, and Tresca's bound does not act on an
    /// obstacle. None: half the diagonal of the box around the smaller boundary.
    pub search_distance: Option<f64>,
    /// Whether bodies are going to move: a facet counts as wholly covered if hardly anything of it is missed, as where they have
    /// moved.
    pub moves: bool,
    /// Between bodies that have moved, the mesh at rest. Fields are functions of places there, and edges cut the
    /// boundaries into parts as they did there. Gaps are the distances of the moved boundaries, of either sign.
    pub rest: Option<&'a Mesh<D>>,
    /// What is behind each facet of the boundary at rest, and behind those of the other one; of one that meets itself behind its own
    /// alone, and empty where no body is on both sides.
    pub walls: &'a [Wall<D>],
    /// Of a boundary that meets itself.
    pub itself: Option<Itself<'a>>,
    /// Of bodies that repeat themselves about an axis: contact goes on beyond the sides of their sectors.
    pub sectors: Option<&'a Arc<Sectors<D>>>,
    /// Those, and the sector of each facet, where facets of several sectors are there.
    pub around: Option<(&'a Sectors<D>, &'a [usize])>,
}

impl<const D: usize> Default for PairOptions<'_, D>
where
    ElementKind: Topology<D>,
{
    fn default() -> Self {
        Self {
            friction: Friction::None,
            gap: None,
            interference: None,
            overlap: false,
            touching: false,
            adjust: 0.0,
            offset: 0.0,
            stiffness: [None; 2],
            edge_angle: EDGE_ANGLE,
            symmetry: None,
            seams: None,
            centres: [&[], &[]],
            held: None,
            search_distance: None,
            moves: false,
            rest: None,
            walls: &[],
            itself: None,
            sectors: None,
            around: None,
        }
    }
}

impl<const D: usize> PairOptions<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The effective gap at x, where the geometry gives `distance`.
    fn gap_at(&self, x: [f64; D], distance: f64, rounding: f64) -> f64 {
        if self.rest.is_some() {
            return distance;
        }
        if let Some(interference) = self.interference {
            return -interference(x);
        }
        let gap = self.gap.map_or(distance, |gap| gap(x));
        let counts = gap.abs() <= rounding.max(self.adjust) || self.touching && gap < 0.0;
        match gap + self.offset {
            _ if counts => self.offset,
            // The offset closes it.
            rest if rest.abs() <= rounding => 0.0,
            rest => rest,
        }
    }

    /// The place in the first sector of one on a facet, for fields.
    fn home(&self, facet: usize, x: [f64; D]) -> [f64; D] {
        (self.around).map_or(x, |(sectors, of_facets)| sectors.home(x, of_facets[facet]))
    }

    /// The compliance of a place, normal and along its tangents: 1/(k a).
    fn compliance_at(&self, x: [f64; D], area: f64) -> Result<[f64; 2], ContactError> {
        let mut compliance = [0.0; 2];
        for (compliance, stiffness) in compliance.iter_mut().zip(self.stiffness) {
            let Some(stiffness) = stiffness else { continue };
            let (value, place) = (stiffness(x), x.into());
            if !(value > 0.0 && value.is_finite()) {
                return Err(ContactError::Stiffness { place, value });
            }
            *compliance = 1.0 / (value * area);
            if !is_sized(*compliance) {
                return Err(ContactError::Compliance {
                    place,
                    value: *compliance,
                });
            }
        }
        Ok(compliance)
    }

    /// Whether a gap may be negative.
    fn may_overlap(&self) -> bool {
        self.interference.is_some() || self.overlap || self.touching || self.rest.is_some()
    }

    /// A unit normal at a node between those of the boundary here and where it goes on beyond the side of a sector; `at` has the
    /// unit normals of a node, of which the nearest counts. Not where that would make a sharp edge.
    fn across_seams(
        &self,
        normal: [f64; D],
        node: u32,
        at: impl Fn(u32) -> Vec<[f64; D]>,
    ) -> [f64; D] {
        let Some(beyond) = self.seams.and_then(|all| all.get(&node)) else {
            return normal;
        };
        let least = self.edge_angle.to_radians().cos() - 1e-9;
        let mut sum = normal;
        for (other, weight, turn) in beyond {
            let turned = at(*other).into_iter().map(|n| turn.map(|row| dot(row, n)));
            let nearest = turned.max_by(|a, b| dot(*a, normal).total_cmp(&dot(*b, normal)));
            if let Some(there) = nearest.filter(|there| dot(*there, normal) >= least) {
                (0..D).for_each(|c| sum[c] += weight * there[c]);
            }
        }
        unit(sum)
    }

    /// A unit normal of a boundary turned into all planes of symmetry that some nodes have in common, as if its mirror
    /// image were there. Not where that would make a sharp edge with it.
    fn within_planes(&self, normal: [f64; D], nodes: &[u32]) -> [f64; D] {
        let planes =
            |node: &u32| (self.symmetry.and_then(|all| all.get(node))).map_or(&[][..], |v| v);
        let Some((first, rest)) = nodes.split_first() else {
            return normal;
        };
        let steepest = (0.5 * self.edge_angle.to_radians()).sin();
        let mut turned = normal;
        for &across in planes(first) {
            let common = rest.iter().all(|node| {
                let mut same = planes(node).iter().map(|other| dot(*other, across).abs());
                same.any(|cos| cos > 1.0 - 1e-9)
            });
            let off = dot(turned, across);
            if common && off != 0.0 && off.abs() <= steepest {
                turned = unit(std::array::from_fn(|c| turned[c] - off * across[c]));
            }
        }
        turned
    }

    /// The search distance between the boundary `facets` and another one.
    pub fn distance_between(
        &self,
        body: &Body<D>,
        facets: &[Facet<D>],
        others: &[Facet<D>],
    ) -> f64 {
        self.search_distance
            .unwrap_or_else(|| reach([around(body, facets), around(body, others)]))
    }

    /// The search distance between the boundary `facets` and an obstacle.
    pub fn distance_to(&self, body: &Body<D>, facets: &[Facet<D>], obstacle: &Obstacle<D>) -> f64 {
        self.search_distance
            .unwrap_or_else(|| reach([around(body, facets), obstacle.bounds()]))
    }
}

/// A place of a contact boundary that a contact force acts at.
#[derive(Clone, Debug, PartialEq)]
pub struct ContactPlace<const D: usize = 2> {
    /// Its position.
    pub place: [f64; D],
    /// Its node of the mesh; None at the border of the covered part of a facet.
    pub node: Option<u32>,
    /// The smooth part of its boundary, where edges cut that between bodies; otherwise 0.
    pub part: u32,
    /// The nodes of its own body, with weights that add up to 1 and whose mean is the place: usually one, at a node.
    pub own: Vec<(u32, f64)>,
    /// The nodes of the other body that it meets, with weights that add up to 1; none for a rigid obstacle.
    pub partners: Vec<(u32, f64)>,
    /// Both sides in the row along each direction of the frame, where nodes of its own side are held; otherwise empty.
    pub directed: Vec<[Vec<(u32, f64)>; 2]>,
    /// Further nodes in the row along each direction of the frame, of couplings, sectors and obstacles that move. Each
    /// has the vector that its displacement is multiplied by there; otherwise empty.
    pub further: Vec<Vec<(u32, [f64; D])>>,
    /// Where its nodes and partners may be images of those of one sector ([`Sectors`]), whose numbers are above those of the mesh.
    pub sectors: Option<Arc<Sectors<D>>>,
    /// Orthonormal directions, one a row: ν towards the obstacle or the other body, then the tangents, as [`frame`]
    /// makes them. Nodes that move alike have the axes along which they do, springs their direction, and zeros for the
    /// others.
    pub frame: [[f64; D]; D],
    /// Initial distance along ν.
    pub gap: f64,
    /// ∫ β ds times the thickness over the part that may come into contact, with the function β of the place (at a node
    /// φ). This is the area that turns forces into stresses. On facets of second order between bodies it is |∫ β n ds|.
    /// With it a uniform pressure on a curved surface is uniform to 1e-5, where ∫ β ds is off by 1e-3 (rings of 8
    /// facets a quarter).
    pub area: f64,
    /// Places with the same number share one displayed pressure: a force on hardly any area means little by itself.
    pub pool: u32,
    /// The slip bound as a nodal force.
    pub slip_bound: SlipBound,
    /// The compliance of the contact itself, along ν and along the tangents, in m/N; 0: hard.
    pub compliance: [f64; 2],
}

impl<const D: usize> ContactPlace<D> {
    /// The nodes of its own body and of the other side in the row along direction `a` of its frame.
    pub fn sides(&self, a: usize) -> [&[(u32, f64)]; 2] {
        match self.directed.get(a) {
            Some([own, partners]) => [own, partners],
            None => [&self.own, &self.partners],
        }
    }

    /// The nodes of the mesh in the row along direction `a` of its frame, each with the vector that its displacement is multiplied by.
    pub fn terms(&self, a: usize) -> impl Iterator<Item = (u32, [f64; D])> {
        let (way, sides) = (self.frame[a], self.sides(a));
        let further = self.further.get(a).into_iter().flatten().copied();
        (sides.into_iter().zip([1.0, -1.0]))
            .flat_map(move |(side, sign)| {
                let terms = side.iter();
                terms.map(move |&(node, weight)| self.term(node, sign * weight, way))
            })
            .chain(further)
    }

    /// The mean over its own nodes of displacements or other vectors of the mesh.
    pub fn mean(&self, of: impl Fn(u32) -> [f64; D]) -> [f64; D] {
        mean(&self.own, |node| {
            self.turned_to(node, of(self.node_of(node)))
        })
    }

    /// The mean of its own nodes, where nodes of the mesh are at these places.
    pub(crate) fn mean_place(&self, nodes: &[[f64; D]]) -> [f64; D] {
        mean(&self.own, |node| self.place_of(node, nodes))
    }
}

/// A weighted mean over nodes.
pub(crate) fn mean<const D: usize>(
    weights: &[(u32, f64)],
    of: impl Fn(u32) -> [f64; D],
) -> [f64; D] {
    let mut sum = [0.0; D];
    for &(node, weight) in weights {
        let value = of(node);
        (0..D).for_each(|c| sum[c] += weight * value[c]);
    }
    sum
}

/// The orthonormal directions that begin with the unit vector ν. In the plane the tangent is ν turned counter-clockwise
/// by a right angle. In space the tangents are the images of the first axes under the reflection that takes the last
/// axis to ±ν.
pub fn frame<const D: usize>(normal: [f64; D]) -> [[f64; D]; D] {
    let mut frame = [normal; D];
    if D == 2 {
        [frame[1][0], frame[1][1]] = [-normal[1], normal[0]];
        return frame;
    }
    let last = normal[D - 1];
    let mut mirror = normal;
    mirror[D - 1] += if last < 0.0 { -1.0 } else { 1.0 };
    for (k, tangent) in frame[1..].iter_mut().enumerate() {
        let part = normal[k] / (1.0 + last.abs());
        *tangent = std::array::from_fn(|c| f64::from(u8::from(c == k)) - part * mirror[c]);
    }
    frame
}

/// Turns the tangents of a frame, in space, so that one has the most and one the least part in the directions of a
/// projector, if they differ: along a direction in which supports hold, and across it. Of the quarter turns it takes the
/// one nearest to the tangents before. Whether a projector says how far.
fn turn_tangents<const D: usize>(frame: &mut [[f64; D]; D], onto: &[[f64; D]; D]) -> bool {
    if D != 3 {
        return false;
    }
    let [s, t] = [frame[1], frame[2]];
    let part = |a: [f64; D], b: [f64; D]| dot(a, onto.map(|row| dot(row, b)));
    let (cos, sin) = (part(s, s) - part(t, t), 2.0 * part(s, t));
    // The projectors of directions that differ by rounding are the same.
    if cos.hypot(sin) < 1e-9 {
        return false;
    }
    // An eighth of a turn is on the same side of the choice, whichever way rounding goes.
    let quarters = 0.5 * sin.atan2(cos) / FRAC_PI_2;
    let (sin, cos) = ((quarters - (quarters - 1e-6).round()) * FRAC_PI_2).sin_cos();
    frame[1] = std::array::from_fn(|i| cos * s[i] + sin * t[i]);
    frame[2] = std::array::from_fn(|i| cos * t[i] - sin * s[i]);
    true
}

/// Turns the tangents of a frame, in space, by the quarter turn that brings the first one nearest to that of another.
fn match_tangents<const D: usize>(frame: &mut [[f64; D]; D], other: &[[f64; D]; D]) {
    if is_quarter_off(frame, other) {
        let [s, t] = [frame[1], frame[2]];
        [frame[1], frame[2]] = [t, s.map(|c| -c)];
    }
}

/// Whether each tangent of a frame in space is nearer to the other tangent of another frame.
fn is_quarter_off<const D: usize>(frame: &[[f64; D]; D], other: &[[f64; D]; D]) -> bool {
    D == 3 && dot(frame[1], other[1]).abs() < dot(frame[2], other[1]).abs()
}

/// The requirements of elastic contact in D dimensions: `where ElementKind: Space<D>` states all of them.
pub trait Space<const D: usize>: Topology<D> + Mortar<D> {}

impl<const D: usize, T: Topology<D> + Mortar<D>> Space<D> for T {}

/// Whether all nodes of a facet are held along its normal, from the unit vectors along which nodes are.
pub(crate) fn held_across<const D: usize>(
    facet: &Facet<D>,
    normal: [f64; D],
    held: &HashMap<u32, Vec<[f64; D]>>,
) -> bool
where
    ElementKind: Topology<D>,
{
    facet_nodes(facet).iter().all(|node| {
        let ways = held.get(node).into_iter().flatten();
        ways.map(|way| dot(*way, normal).powi(2)).sum::<f64>() > 0.5
    })
}

/// Other remedies for overlaps in a drawing.
const OVERLAPS: &str = "or state what the overlap means: overlaps up to a distance count as touching (adjust), the \
                        true gap is not the drawn one (gap), or the sides are pressed apart (overlap = \
                        \"interference\")";

/// A fault in the definition of a contact.
#[derive(Debug, thiserror::Error)]
pub enum ContactError {
    /// A node is inside the obstacle.
    #[error(
        "the node at {place} lies {depth:.3e} inside the obstacle: move the body or the obstacle apart, {OVERLAPS}"
    )]
    Overlap {
        /// The node.
        place: Location,
        /// The depth.
        depth: f64,
    },
    /// Two bodies overlap.
    #[error("the boundaries overlap by {depth:.3e} at {place}: move the bodies apart, {OVERLAPS}")]
    BodiesOverlap {
        /// The place of the largest overlap.
        place: Location,
        /// The depth.
        depth: f64,
    },
    /// A node meets several rigid obstacles whose normal rows depend on each other.
    #[error(
        "the node at {place} meets several rigid obstacles whose normals depend on each other in the directions that \
         supports leave free: name the boundary in fewer contacts, let the obstacles differ clearly in direction \
         there, or free the node"
    )]
    Twice {
        /// The node.
        place: Location,
    },
    /// Prescribed displacements penetrate.
    #[error(
        "supports drive the node at {place} {depth:.3e} into the body or obstacle that it touches, and leave it no \
         freedom to give way: change the prescribed displacement, or free the node"
    )]
    Driven {
        /// The node.
        place: Location,
        /// The depth.
        depth: f64,
    },
    /// Prescribed displacements make a node slide in one direction, while it is free in another one.
    #[error(
        "supports move the node at {place} along its contact in one direction and leave it free in the other, which \
         friction cannot follow. Prescribe both (or hold nodes outside the contact), or state no friction there"
    )]
    DrivenAlong {
        /// The node.
        place: Location,
    },
    /// Prescribed displacements move the sides of a tie apart.
    #[error(
        "supports move the sides of the tie at {place} by {apart:.3e} against each other, or against the motion that a coupling, \
         a preload or an equation states, and leave neither free to follow: change the prescribed displacements"
    )]
    DrivenApart {
        /// The place.
        place: Location,
        /// By how much.
        apart: f64,
    },
    /// A node on both sides.
    #[error("the node at {place} belongs to both boundaries of the contact")]
    Shared {
        /// The node.
        place: Location,
    },
    /// The boundary looks away from a half-plane (half-space).
    #[error(
        "no part of it faces the obstacle: the normal of a {obstacle} points out of the obstacle, towards the body"
    )]
    FacesAway {
        /// The name of the obstacle.
        obstacle: &'static str,
    },
    /// The boundary is inside a circle (sphere, cylinder).
    #[error(
        "no part of it faces the {obstacle} from outside: the obstacle is the {solid} itself, and the body must be \
         outside it; for a hole around a body mesh its wall, hold it, and let the body meet that boundary"
    )]
    Inside {
        /// The name of the obstacle.
        obstacle: &'static str,
        /// The name of its solid interior.
        solid: &'static str,
    },
    /// A circle (sphere, cylinder) has no direction at its centre (axis).
    #[error(
        "the node at {place} lies {} of the {obstacle}, so its normal is undefined",
        if *obstacle == "cylinder" { "on the axis" } else { "at the centre" }
    )]
    NoNormal {
        /// The node.
        place: Location,
        /// The name of the obstacle.
        obstacle: &'static str,
    },
    /// The averaged normal of a node vanishes.
    #[error("the boundary turns back on itself at {place}, so its normal is undefined")]
    Folded {
        /// The node.
        place: Location,
    },
    /// The boundaries are too far from each other.
    #[error(
        "no part of it faces {} within the search distance {distance:.3e}; {}",
        if nearest.is_nan() { "another one" } else { "the master boundary" },
        if nearest.is_nan() {
            "set search_distance, or leave this contact out".to_owned()
        } else if nearest > distance {
            format!("they are at least {nearest:.3e} apart: check the boundaries, or set search_distance")
        } else {
            "they come near each other, but no two of their facets face each other: check the boundaries".to_owned()
        }
    )]
    Apart {
        /// The search distance.
        distance: f64,
        /// The least distance of the boxes around their facets; NaN of a boundary with itself.
        nearest: f64,
    },
    /// An invalid stiffness of contact.
    #[error(
        "the contact stiffness is {value} at {place}: it must be a finite number > 0; leave it out where contact is hard"
    )]
    Stiffness {
        /// The place.
        place: Location,
        /// The value there.
        value: f64,
    },
    /// A stiffness of contact that is out of range.
    #[error("the compliance of the contact is {value:e} at {place}: {SIZES}")]
    Compliance {
        /// The place.
        place: Location,
        /// 1 / (stiffness · area).
        value: f64,
    },
    /// A value that must be finite and not negative.
    #[error("the {what} is {value} at {place}: it must be a finite number ≥ 0")]
    NotPositive {
        /// The quantity at fault.
        what: &'static str,
        /// The place.
        place: Location,
        /// The value there.
        value: f64,
    },
}

/// The rounding of coordinates: within this distance sides touch.
fn rounding<const D: usize>(body: &Body<D>) -> f64
where
    ElementKind: Topology<D>,
{
    1e-9 * diagonal(body.mesh.bounding_box())
}

fn diagonal<const D: usize>((low, high): ([f64; D], [f64; D])) -> f64 {
    length(minus(high, low))
}

/// A value that must be finite and not negative.
fn checked<const D: usize>(
    what: &'static str,
    x: [f64; D],
    value: f64,
) -> Result<f64, ContactError> {
    if value >= 0.0 && value.is_finite() {
        return Ok(value);
    }
    let place = x.into();
    Err(ContactError::NotPositive { what, place, value })
}

/// The default search distance of two boundaries: half the diagonal of the smaller of the boxes around them.
fn reach<const D: usize>(boxes: [([f64; D], [f64; D]); 2]) -> f64 {
    let [a, b] = boxes.map(diagonal);
    0.5 * a.min(b)
}

/// The box around the nodes of some facets.
fn around<const D: usize>(body: &Body<D>, facets: &[Facet<D>]) -> ([f64; D], [f64; D])
where
    ElementKind: Topology<D>,
{
    let nodes = facets.iter().flat_map(|facet| facet.as_ref());
    bounds(nodes.map(|&node| body.mesh.nodes[node as usize]))
}
