//! A contact or a tie of a model, as stated.

use super::entities::{Facts, NO_BOUNDARY, Names, Part, by_step, not_a_switch, with_a_name};
use super::error::EntityKind;
use super::motion::Motion;
use super::stated::{self, Flaw};
use super::wear::Wear;
use super::{Quantity, Units};
use crate::contact::{Friction, Obstacle};
use crate::elasticity::Field;
use crate::mesh::vector::length;
use crate::problem::{LARGEST, UNREACHABLE};
use serde::{Deserialize, Deserializer, Serialize};

/// A contact of boundaries with others, or with a rigid obstacle; without friction if no law is stated.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Pair<const D: usize = 2> {
    pub(super) name: Option<String>,
    boundary: Option<Names>,
    /// Instead of the boundary: sets of nodes, one by one.
    nodes: Option<Names>,
    against: Option<Names>,
    #[serde(
        default,
        deserialize_with = "stated::obstacle",
        serialize_with = "stated::shape"
    )]
    obstacle: Option<Obstacle<D>>,
    #[serde(default, rename = "friction", skip_serializing_if = "Law::is_unstated")]
    pub(super) law: Law<D>,
    #[serde(default, deserialize_with = "stated::gap")]
    pub(super) gap: Option<Quantity<D>>,
    pub(super) interference: Option<Quantity<D>>,
    pub(super) overlap: Option<Overlap>,
    /// Where a boundary meets itself: boundaries that do not meet each other.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) exclude: Vec<[Names; 2]>,
    #[serde(default, skip_serializing_if = "Stiffness::is_hard")]
    pub(super) stiffness: Stiffness<D>,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    pub(super) adjust: f64,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    pub(super) offset: f64,
    pub(super) edge_angle: Option<f64>,
    pub(super) search_distance: Option<f64>,
    pub(super) motion: Option<Motion<D>>,
    /// 1 in load steps in which it acts, 0 in the others.
    active: Option<Vec<f64>>,
    /// The factor of the bound or the coefficient of its law in each load step.
    friction_factors: Option<Vec<f64>>,
    pub(super) wear: Option<Wear>,
}

/// The other side of a boundary.
#[derive(Clone, Copy, Debug)]
pub(super) enum Against<'p, const D: usize> {
    Boundary(&'p Names),
    Obstacle(&'p Obstacle<D>),
}

impl<'p, const D: usize> Against<'p, D> {
    pub(super) fn boundary(&self) -> Option<&'p Names> {
        match self {
            Self::Boundary(names) => Some(names),
            Self::Obstacle(_) => None,
        }
    }
}

/// The law of friction of a contact.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Law<const D: usize> {
    #[default]
    None,
    Tresca(#[serde(deserialize_with = "Quantity::or_infinite")] Quantity<D>),
    Coulomb(#[serde(deserialize_with = "Quantity::or_infinite")] Quantity<D>),
    #[serde(skip)]
    Tied,
}

/// The meaning of an overlap of the meshes.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Overlap {
    /// It is pressed apart.
    Interference,
    /// It comes from the drawing, and counts as touching.
    Touching,
}

/// The stiffness of a contact itself: pressure over closure of the gap, and traction over displacement before slip; hard if not
/// stated. Of a foundation, the same over its displacement; free if not stated.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { normal = 1e12, tangential = 1e11 }"
)]
pub(super) struct Stiffness<const D: usize> {
    normal: Option<Quantity<D>>,
    tangential: Option<Quantity<D>>,
}

impl<const D: usize> Law<D> {
    /// Its bound or coefficient at a place; 0 of laws without.
    pub(super) fn at(&self, x: [f64; D]) -> f64 {
        match self {
            Self::None | Self::Tied => 0.0,
            Self::Tresca(value) => value.at_most(x, UNREACHABLE),
            Self::Coulomb(value) => value.at_most(x, LARGEST),
        }
    }

    /// The law with its bound or coefficient as a field.
    pub(super) fn of_fields<'f>(&self, field: Field<'f, D>) -> Friction<'f, D> {
        match self {
            Self::None => Friction::None,
            Self::Tied => Friction::Tied,
            Self::Tresca(_) => Friction::Tresca(field),
            Self::Coulomb(_) => Friction::Coulomb(field),
        }
    }

    /// Whether a table leaves it out: that of a tie has no such key.
    fn is_unstated(&self) -> bool {
        matches!(self, Self::None | Self::Tied)
    }
}

impl<const D: usize> Stiffness<D> {
    pub(super) fn is_hard(&self) -> bool {
        self.both().iter().all(Option::is_none)
    }

    /// Normal and tangential.
    pub(super) fn both(&self) -> [Option<&Quantity<D>>; 2] {
        [self.normal.as_ref(), self.tangential.as_ref()]
    }

    pub(super) fn both_mut(&mut self) -> [&mut Option<Quantity<D>>; 2] {
        [&mut self.normal, &mut self.tangential]
    }

    /// In words; None where it is hard.
    pub(super) fn told(&self, units: &Units) -> Option<String> {
        let parts = ["normal", "tangential"].into_iter().zip(self.both());
        let parts = parts.filter_map(|(way, k)| Some(format!("{way} {}", k?)));
        let parts: Vec<String> = parts.collect();
        let unit = match (units.stress(), &units.length) {
            (stress, _) if stress.is_empty() => stress,
            (stress, length) => format!(" {stress}/{length}"),
        };
        (!parts.is_empty()).then(|| format!("{}{unit}", parts.join(", ")))
    }
}

/// The keys of a tie, out of those of a contact.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Tie {
    name: Option<String>,
    boundary: Names,
    against: Names,
    #[serde(default)]
    adjust: f64,
    edge_angle: Option<f64>,
    active: Option<Vec<f64>>,
}

pub(super) fn ties<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Vec<Pair<D>>, S::Error> {
    let pair = |tie: Tie| Pair {
        name: tie.name,
        adjust: tie.adjust,
        edge_angle: tie.edge_angle,
        active: tie.active,
        ..Pair::tied(tie.boundary, tie.against)
    };
    Ok(Vec::deserialize(from)?.into_iter().map(pair).collect())
}

with_a_name!(Pair);

impl<const D: usize> Pair<D> {
    /// The boundary of a body, which carries the multipliers, and that of another one. Each may be several that count
    /// as one. The same on both sides may meet itself: any part of it any other.
    pub fn new(boundary: impl Into<Names>, against: impl Into<Names>) -> Self {
        Self {
            boundary: Some(boundary.into()),
            against: Some(against.into()),
            ..Self::default()
        }
    }

    /// The boundary of a body and that of another one (each may be several that count as one) that hold together in
    /// every direction, for [`Model::tie`](super::Model::tie). Their meshes need not match, and a gap in the drawing
    /// stays. [`Pair::adjust`] sets the largest distance; the default is a quarter of the longest facet of the first
    /// one.
    pub fn tied(boundary: impl Into<Names>, against: impl Into<Names>) -> Self {
        Self {
            law: Law::Tied,
            ..Self::new(boundary, against)
        }
    }

    /// Reads the names of the first side as sets of nodes ([`Mesh::node_sets`](crate::mesh::Mesh::node_sets)). Each of
    /// their nodes meets the point nearest to it. Where the nodes make up facets, [`Pair::new`] is better.
    pub fn by_nodes(mut self) -> Self {
        self.nodes = self.boundary.take().or(self.nodes);
        self
    }

    /// Its first side, once it is checked that there is one.
    pub(super) fn side(&self) -> &Names {
        self.stated_side().expect("checked: it has a side")
    }

    fn stated_side(&self) -> Option<&Names> {
        match (&self.boundary, &self.nodes) {
            (Some(names), None) | (None, Some(names)) => Some(names),
            _ => None,
        }
    }

    /// Whether its first side are sets of nodes, one by one.
    pub(super) fn is_by_nodes(&self) -> bool {
        self.nodes.is_some()
    }

    /// The other side, after the check that it is exactly one.
    pub(super) fn meets(&self) -> Against<'_, D> {
        let met = self.stated_against();
        met.expect("checked: there is something to touch")
    }

    fn stated_against(&self) -> Option<Against<'_, D>> {
        match (&self.against, &self.obstacle) {
            (Some(names), None) => Some(Against::Boundary(names)),
            (None, Some(obstacle)) => Some(Against::Obstacle(obstacle)),
            _ => None,
        }
    }

    /// Whether a boundary meets itself.
    pub(super) fn is_with_itself(&self) -> bool {
        matches!((&self.boundary, &self.against), (Some(own), Some(other)) if own.are(other))
    }

    /// Whether the gap is the distance of the meshes.
    pub(super) fn has_gap_of_meshes(&self) -> bool {
        self.stated_gap().is_none()
    }

    /// The gap that is stated as a function of the place at rest, below 0 as an interference, and the key that states it.
    pub(super) fn stated_gap(&self) -> Option<(&'static str, impl Fn([f64; D]) -> f64 + '_)> {
        let key = match (&self.gap, &self.interference) {
            (Some(_), _) => "gap",
            (None, Some(_)) => "interference",
            (None, None) => return None,
        };
        let at = |x| match (&self.gap, &self.interference) {
            (Some(gap), _) => gap.at_most(x, UNREACHABLE),
            (None, interference) => -interference.as_ref().map_or(0.0, |value| value.at(x)),
        };
        Some((key, at))
    }

    pub(super) fn is_tie(&self) -> bool {
        matches!(self.law, Law::Tied)
    }

    /// The boundary of a body, or several that count as one, and a rigid obstacle.
    pub fn obstacle(boundary: impl Into<Names>, obstacle: Obstacle<D>) -> Self {
        Self {
            boundary: Some(boundary.into()),
            obstacle: Some(obstacle),
            ..Self::default()
        }
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

    /// The overlap in m of pressed or shrunk sides where they meet; replaces a gap.
    pub fn interference(mut self, overlap: impl Into<Quantity<D>>) -> Self {
        self.interference = Some(overlap.into());
        self
    }

    /// Overlaps of the meshes are pressed apart, as in a press fit; elsewhere the gap is the distance of the meshes.
    pub fn overlap_as_interference(mut self) -> Self {
        self.overlap = Some(Overlap::Interference);
        self
    }

    /// Overlaps of the meshes come from their drawing, and count as touching, however deep; elsewhere the gap is the distance
    /// of the meshes.
    pub fn overlap_as_touching(mut self) -> Self {
        self.overlap = Some(Overlap::Touching);
        self
    }

    /// Where a boundary meets itself: these two do not meet each other, which may be the same. Boundaries that a tie or another
    /// contact joins are left to it without this.
    pub fn exclude(mut self, one: impl Into<Names>, other: impl Into<Names>) -> Self {
        self.exclude.push([one.into(), other.into()]);
        self
    }

    /// Compliant contact: pressure over closure of the gap, in Pa/m. Hard without it.
    pub fn normal_stiffness(mut self, stiffness: impl Into<Quantity<D>>) -> Self {
        self.stiffness.normal = Some(stiffness.into());
        self
    }

    /// Tangential traction over displacement before slip, in Pa/m. Without it the sides stick rigidly.
    pub fn tangential_stiffness(mut self, stiffness: impl Into<Quantity<D>>) -> Self {
        self.stiffness.tangential = Some(stiffness.into());
        self
    }

    /// Gaps and overlaps up to this distance in m count as touching.
    pub fn adjust(mut self, distance: f64) -> Self {
        self.adjust = distance;
        self
    }

    /// An offset added to the gap of the meshes, in m. It is below 0 for coatings that are not drawn, and above 0 for a
    /// contact that begins with an overlap, as a part of a law in pieces does.
    pub fn offset(mut self, distance: f64) -> Self {
        self.offset = distance;
        self
    }

    /// Between boundaries: edges sharper than this between the outward normals of neighbouring facets, in degrees, cut them
    /// into parts with their own contact forces and normals. Without it 50, so that a hexagon has edges and a circle of
    /// eight facets has none; 180: none.
    pub fn edge_angle(mut self, degrees: f64) -> Self {
        self.edge_angle = Some(degrees);
        self
    }

    /// The motion of the obstacle, for large displacements.
    pub fn moving(mut self, motion: Motion<D>) -> Self {
        self.motion = Some(motion);
        self
    }

    /// In which load steps it acts: 1, or 0 where it has no effect, one for each. A contact that begins to act closes
    /// the rest of its gap; a tie that begins to act holds the sides together as they are then.
    pub fn active(mut self, steps: impl Into<Vec<f64>>) -> Self {
        self.active = Some(steps.into());
        self
    }

    /// The factors of the bound or the coefficient of its law of friction, one for each load step: 0 is no friction.
    pub fn friction_factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.friction_factors = Some(factors.into());
        self
    }

    /// It wears: slip under pressure takes off this volume over force and slip, in 1/Pa (Archard). Gaps grow from one cycle of load
    /// steps to the next.
    pub fn wear(mut self, coefficient: f64) -> Self {
        self.wear = Some(Wear { coefficient });
        self
    }

    /// Whether it acts in a load step, counted from 0.
    pub(super) fn acts(&self, step: usize) -> bool {
        let stated = self.active.as_ref().and_then(|steps| steps.get(step));
        stated.is_none_or(|&acts| acts != 0.0)
    }

    /// Whether something of it is stated for each load step.
    pub(super) fn has_steps(&self) -> bool {
        self.active.is_some() || self.friction_factors.is_some()
    }

    /// The factor of its law of friction in a load step.
    pub(super) fn friction_factor(&self, step: usize) -> f64 {
        let factors = self.friction_factors.as_ref();
        factors
            .and_then(|factors| factors.get(step))
            .copied()
            .unwrap_or(1.0)
    }

    /// Beyond this distance in m boundaries are not searched for contact, and Tresca's bound does not act on an
    /// obstacle. Default: half the diagonal of the box around the smaller boundary.
    pub fn search_distance(mut self, distance: f64) -> Self {
        self.search_distance = Some(distance);
        self
    }

    /// The law and its bound or coefficient, in words.
    pub(super) fn friction(&self, units: &Units) -> String {
        let mut text = match &self.law {
            Law::None => "no friction".to_owned(),
            Law::Tied => "tied".to_owned(),
            Law::Tresca(bound) => {
                format!("Tresca bound {bound}{}", Units::behind(&units.stress()))
            }
            Law::Coulomb(coefficient) => format!("Coulomb coefficient {coefficient}"),
        };
        if let Some(factors) = &self.friction_factors {
            text += &format!(" times {factors:?}");
        }
        if let Some(steps) = &self.active {
            text += &format!(", active {steps:?}");
        }
        if let Some(Wear { coefficient }) = self.wear {
            text += &format!(", wear {coefficient:e}");
        }
        text
    }

    /// The fault in its statements for each load step.
    fn fault_of_steps(&self) -> Option<Flaw> {
        let any = |list: &Option<Vec<f64>>, bad: fn(f64) -> bool| {
            list.as_ref().is_some_and(|all| all.iter().any(|&v| bad(v)))
        };
        if let Some(flaw) = not_a_switch("active", &self.active) {
            return Some(flaw);
        }
        let text = if any(&self.friction_factors, |v| !(v >= 0.0 && v.is_finite())) {
            (
                "friction_factors",
                "friction_factors must be finite and not negative",
            )
        } else if self.friction_factors.is_some() && matches!(self.law, Law::None | Law::Tied) {
            (
                "friction_factors",
                "friction_factors multiply a law of friction: state friction beside them",
            )
        } else {
            return None;
        };
        Some(Flaw::of(text.0, text.1))
    }

    /// Whether another contact has the same boundaries with its sides swapped. Laws of boundaries that meet themselves may add up, and
    /// leave other contacts out.
    pub(super) fn mirrors(&self, other: &Self) -> bool {
        if self.is_with_itself() || other.is_with_itself() {
            return false;
        }
        match (self.meets(), other.meets()) {
            (Against::Boundary(here), Against::Boundary(there)) => {
                here.meet(other.side()) && there.meet(self.side())
            }
            _ => false,
        }
    }
}

impl<const D: usize> Part for Pair<D> {
    fn facts(&self) -> Facts<'_> {
        let side = self.stated_side();
        Facts {
            kind: if self.is_tie() {
                EntityKind::Tie
            } else {
                EntityKind::Contact
            },
            name: self.name.as_deref(),
            place: side.map_or(String::new(), |names| format!("on \"{names}\"")),
            factors: by_step([
                (
                    "factors",
                    self.motion.as_ref().map_or(&None, |motion| &motion.factors),
                ),
                ("active", &self.active),
                ("friction_factors", &self.friction_factors),
            ]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let distance = |value: f64| value >= 0.0 && value.is_finite();
        let Some(side) = self.stated_side() else {
            return Some("a contact needs a boundary or, instead of it, nodes".into());
        };
        let Some(against) = self.stated_against() else {
            let text = match self.against {
                None => "a contact needs either against (another boundary) or an obstacle",
                Some(_) => "a contact is either against a boundary or with an obstacle: keep one",
            };
            return Some(text.into());
        };
        if let Some(fault) = self.motion.as_ref().and_then(Motion::fault) {
            return Some(Flaw::of("motion", fault));
        }
        if let Some(fault) = self.fault_of_steps() {
            return Some(fault);
        }
        if let Some(fault) = self.wear.as_ref().and_then(Wear::fault) {
            return Some(fault);
        }
        if self.wear.is_some() && self.is_tie() {
            return Some(Flaw::of(
                "wear",
                "sides that are tied do not wear: leave out wear",
            ));
        }
        let is_angle = |angle| (0.0..=180.0).contains(&angle);
        let is_stated = self.gap.is_some() || self.interference.is_some();
        let text = match () {
            () if side.all().is_empty() => NO_BOUNDARY,
            () if !distance(self.adjust) || !self.search_distance.is_none_or(distance) => {
                "search_distance and adjust must be finite and not negative"
            }
            () if !self.edge_angle.is_none_or(is_angle) => {
                "edge_angle must lie between 0 and 180 degrees"
            }
            () if self.gap.is_some() && self.interference.is_some() => {
                "gap and interference exclude each other: state one of them"
            }
            () if !self.offset.is_finite() => "offset must be finite",
            () if self.offset != 0.0 && is_stated => {
                "offset is added to the gap in the mesh: leave out gap and interference"
            }
            () if self.overlap.is_some() && is_stated => {
                "overlap refers to the gap in the mesh: leave out gap and interference"
            }
            () if !self.exclude.is_empty() && !self.is_with_itself() => {
                "exclude belongs to boundaries that meet themselves: the same names under boundary and against"
            }
            () => match against {
                Against::Boundary(names) if names.all().is_empty() => NO_BOUNDARY,
                Against::Boundary(_) if self.is_with_itself() => match () {
                    () if self.is_tie() => {
                        "a boundary is on both sides of this tie: it needs two boundaries that share no node"
                    }
                    () if is_stated => {
                        "where a boundary meets itself, the gap is that of the mesh: leave out gap and interference"
                    }
                    () => return None,
                },
                Against::Boundary(names) if names.meet(side) => {
                    "a boundary is on both sides of this contact: state the same boundaries on both sides where \
                     each may meet itself and the others, or two sides that share no node"
                }
                Against::Boundary(_) => return None,
                Against::Obstacle(obstacle) => obstacle_fault(obstacle)?,
            },
        };
        Some(text.into())
    }
}

/// The missing part of an obstacle's shape, in the words of its dimension.
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
