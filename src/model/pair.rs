//! A contact or a tie of a model, as it is stated.

use super::entities::{NO_BOUNDARY, Names, with_a_name};
use super::error::{Entity, EntityKind};
use super::{Quantity, Units};
use crate::contact::Obstacle;
use crate::mesh::vector::length;

/// A contact of boundaries with others, or with a rigid obstacle; without friction if no law is stated.
#[derive(Clone, Debug)]
pub struct Pair<const D: usize = 2> {
    pub(super) boundary: Names,
    /// Whether its first side are sets of nodes, one by one.
    pub(super) by_nodes: bool,
    pub(super) against: Against<D>,
    pub(super) law: Law<D>,
    pub(super) gap: Option<Quantity<D>>,
    pub(super) interference: Option<Quantity<D>>,
    pub(super) overlap: bool,
    /// Normal and tangential.
    pub(super) stiffness: [Option<Quantity<D>>; 2],
    pub(super) adjust: f64,
    pub(super) offset: f64,
    pub(super) edge_angle: Option<f64>,
    pub(super) search_distance: Option<f64>,
    pub(super) name: Option<String>,
}

/// What a boundary may touch.
#[derive(Clone, Debug)]
pub(super) enum Against<const D: usize> {
    Boundary(Names),
    Obstacle(Obstacle<D>),
}

/// The law of friction of a contact.
#[derive(Clone, Debug)]
pub(super) enum Law<const D: usize> {
    None,
    Tresca(Quantity<D>),
    Coulomb(Quantity<D>),
    Tied,
}

with_a_name!(Pair);

impl<const D: usize> Pair<D> {
    fn with(boundary: Names, against: Against<D>) -> Self {
        Self {
            boundary,
            by_nodes: false,
            against,
            law: Law::None,
            gap: None,
            interference: None,
            overlap: false,
            stiffness: [const { None }; 2],
            adjust: 0.0,
            offset: 0.0,
            edge_angle: None,
            search_distance: None,
            name: None,
        }
    }

    /// The boundary of a body, which carries the multipliers, and that of another one. Each may be several that count
    /// as one.
    pub fn new(boundary: impl Into<Names>, against: impl Into<Names>) -> Self {
        Self::with(boundary.into(), Against::Boundary(against.into()))
    }

    /// The boundary of a body and that of another one (each may be several that count as one) that hold together in every
    /// direction, for [`Model::tie`](super::Model::tie): their meshes need not match, and what is between them as they are drawn stays.
    /// [`Pair::adjust`] says how far apart they may be; without, a quarter of the longest facet of the first one.
    pub fn tied(boundary: impl Into<Names>, against: impl Into<Names>) -> Self {
        Self {
            law: Law::Tied,
            ..Self::new(boundary, against)
        }
    }

    /// Takes the names of the first side for sets of nodes ([`Mesh::node_sets`](crate::mesh::Mesh::node_sets)), each node of which
    /// meets the point nearest to it. Where the nodes make up facets, [`Pair::new`] does better.
    pub fn by_nodes(mut self) -> Self {
        self.by_nodes = true;
        self
    }

    /// Whether the gap is the distance of the meshes.
    pub(super) fn has_gap_of_meshes(&self) -> bool {
        self.gap.is_none() && self.interference.is_none()
    }

    pub(super) fn is_tie(&self) -> bool {
        matches!(self.law, Law::Tied)
    }

    /// The boundary of a body, or several that count as one, and a rigid obstacle.
    pub fn obstacle(boundary: impl Into<Names>, obstacle: Obstacle<D>) -> Self {
        Self::with(boundary.into(), Against::Obstacle(obstacle))
    }

    /// Coulomb's law with this coefficient of friction.
    pub fn coulomb(mut self, coefficient: impl Into<Quantity<D>>) -> Self {
        self.law = Law::Coulomb(coefficient.into());
        self
    }

    /// Tresca's law with this bound of the tangential traction, in Pa.
    pub fn tresca(mut self, bound: impl Into<Quantity<D>>) -> Self {
        self.law = Law::Tresca(bound.into());
        self
    }

    /// The initial gap in m, instead of the distance of the meshes.
    pub fn gap(mut self, gap: impl Into<Quantity<D>>) -> Self {
        self.gap = Some(gap.into());
        self
    }

    /// How far in m the sides overlap where they meet, of what is pressed or shrunk on; instead of a gap.
    pub fn interference(mut self, overlap: impl Into<Quantity<D>>) -> Self {
        self.interference = Some(overlap.into());
        self
    }

    /// What the meshes overlap is pressed apart, as what is pressed or shrunk on is; elsewhere the gap is the distance of the
    /// meshes.
    pub fn overlap_as_interference(mut self) -> Self {
        self.overlap = true;
        self
    }

    /// Compliant contact: the pressure over what the gap closes by, in Pa/m. Hard without.
    pub fn normal_stiffness(mut self, stiffness: impl Into<Quantity<D>>) -> Self {
        self.stiffness[0] = Some(stiffness.into());
        self
    }

    /// The tangential traction over what the sides move by before they slip, in Pa/m. Without it they stick altogether.
    pub fn tangential_stiffness(mut self, stiffness: impl Into<Quantity<D>>) -> Self {
        self.stiffness[1] = Some(stiffness.into());
        self
    }

    /// Gaps and overlaps up to this distance in m count as touching.
    pub fn adjust(mut self, distance: f64) -> Self {
        self.adjust = distance;
        self
    }

    /// What is added to the gap that the meshes have, in m: below 0 for coatings that are not drawn, above 0 for a contact that begins
    /// with an overlap, as a part of a law in pieces does.
    pub fn offset(mut self, distance: f64) -> Self {
        self.offset = distance;
        self
    }

    /// Between boundaries: edges sharper than this between the outward normals of neighbouring facets, in degrees, cut them
    /// into parts with contact forces and normals of their own. Without it 50, so that a hexagon has edges and a circle of
    /// eight facets has none; 180: none.
    pub fn edge_angle(mut self, degrees: f64) -> Self {
        self.edge_angle = Some(degrees);
        self
    }

    /// What is farther apart is no candidate between boundaries, and not rubbed by Tresca's bound on an obstacle; in m.
    /// Without it: half the diagonal of the box around the smaller boundary.
    pub fn search_distance(mut self, distance: f64) -> Self {
        self.search_distance = Some(distance);
        self
    }

    pub(super) fn entity(&self, number: usize) -> Entity {
        Entity::one(
            if self.is_tie() {
                EntityKind::Tie
            } else {
                EntityKind::Contact
            },
            number,
            self.place(format!("on \"{}\"", self.boundary)),
        )
    }

    /// The law and its bound or coefficient, in words.
    pub(super) fn friction(&self, units: &Units) -> String {
        match &self.law {
            Law::None => "no friction".to_owned(),
            Law::Tied => "tied".to_owned(),
            Law::Tresca(bound) => {
                format!("Tresca bound {bound}{}", Units::behind(&units.stress()))
            }
            Law::Coulomb(coefficient) => format!("Coulomb coefficient {coefficient}"),
        }
    }

    /// The stiffness of the contact itself, in words; None where it is hard.
    pub(super) fn compliance(&self, units: &Units) -> Option<String> {
        let parts = ["normal", "tangential"].into_iter().zip(&self.stiffness);
        let parts = parts.filter_map(|(way, k)| Some(format!("{way} {}", k.as_ref()?)));
        let parts: Vec<String> = parts.collect();
        let unit = match (units.stress(), &units.length) {
            (stress, _) if stress.is_empty() => stress,
            (stress, length) => format!(" {stress}/{length}"),
        };
        (!parts.is_empty()).then(|| format!("{}{unit}", parts.join(", ")))
    }

    pub(super) fn fault(&self) -> Option<&'static str> {
        let distance = |value: f64| value >= 0.0 && value.is_finite();
        if self.boundary.all().is_empty() {
            return Some(NO_BOUNDARY);
        }
        if !distance(self.adjust) || !self.search_distance.is_none_or(distance) {
            return Some("search_distance and adjust must be finite and not negative");
        }
        if !self
            .edge_angle
            .is_none_or(|angle| (0.0..=180.0).contains(&angle))
        {
            return Some("edge_angle must lie between 0 and 180 degrees");
        }
        if self.gap.is_some() && self.interference.is_some() {
            return Some("gap and interference exclude each other: state one of them");
        }
        if !self.offset.is_finite() {
            return Some("offset must be finite");
        }
        if self.offset != 0.0 && !self.has_gap_of_meshes() {
            return Some(
                "offset is added to the gap that the meshes have: state no gap and no interference beside it",
            );
        }
        if self.overlap && (self.gap.is_some() || self.interference.is_some()) {
            return Some(
                "overlap = \"interference\" is about the gap that the meshes have: state no gap and no interference beside it",
            );
        }
        match &self.against {
            Against::Boundary(names) if names.all().is_empty() => Some(NO_BOUNDARY),
            Against::Boundary(names) if names.meet(&self.boundary) => Some(
                "a boundary stands on both sides of this contact: contact of a body with itself needs two boundaries \
                 that share no node",
            ),
            Against::Boundary(_) => None,
            Against::Obstacle(obstacle) => obstacle_fault(obstacle),
        }
    }

    /// Whether another contact is about the same boundaries the other way round.
    pub(super) fn mirrors(&self, other: &Self) -> bool {
        match (&self.against, &other.against) {
            (Against::Boundary(here), Against::Boundary(there)) => {
                here.meet(&other.boundary) && there.meet(&self.boundary)
            }
            _ => false,
        }
    }
}

/// What of an obstacle has no shape, in the words of its dimension.
fn obstacle_fault<const D: usize>(obstacle: &Obstacle<D>) -> Option<&'static str> {
    let finite = |point: &[f64; D]| point.iter().all(|v| v.is_finite());
    let positive = |value: f64| value > 0.0 && value.is_finite();
    match obstacle {
        Obstacle::HalfSpace { point, normal } => (!finite(point) || !positive(length(*normal)))
            .then_some(match D {
                2 => "half_plane needs a finite point and a normal that is not zero",
                _ => "half_space needs a finite point and a normal that is not zero",
            }),
        Obstacle::Sphere { center, radius } => {
            (!finite(center) || !positive(*radius)).then_some(match D {
                2 => "circle needs a finite center and a positive radius",
                _ => "sphere needs a finite center and a positive radius",
            })
        }
        Obstacle::Cylinder {
            point,
            axis,
            radius,
        } => (!finite(point) || !positive(length(*axis)) || !positive(*radius)).then_some(
            "cylinder needs a finite point, an axis that is not zero and a positive radius",
        ),
    }
}
