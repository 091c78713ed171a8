//! The parts of a model except contacts (`pair.rs`): supports and loads, as stated.

use super::axis::{AROUND, Axis};
use super::error::{Entity, EntityKind};
use super::motion::Turn;
use super::pair::Stiffness;
use super::stated::{self, Flaw};
use super::{Quantity, Units};
use crate::elasticity::{Hyperelastic, Incompressible, Material};
use crate::mesh::vector::{dot, unit};
use crate::problem::{SIZES, is_sized};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fmt;

/// The name of a boundary, or several that count as one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Names(Vec<String>);

impl Names {
    /// All of them.
    pub fn all(&self) -> &[String] {
        &self.0
    }

    /// Whether both have the same names.
    pub(super) fn are(&self, other: &Self) -> bool {
        let [here, there] = [self, other].map(|names| names.0.iter().collect::<BTreeSet<_>>());
        here == there
    }

    /// Whether both have a name in common.
    pub(super) fn meet(&self, other: &Self) -> bool {
        self.0.iter().any(|name| other.0.contains(name))
    }
}

impl From<&str> for Names {
    fn from(name: &str) -> Self {
        Self(vec![name.to_owned()])
    }
}

impl From<&String> for Names {
    fn from(name: &String) -> Self {
        name.as_str().into()
    }
}

impl From<String> for Names {
    fn from(name: String) -> Self {
        Self(vec![name])
    }
}

impl From<Vec<String>> for Names {
    fn from(names: Vec<String>) -> Self {
        Self(names)
    }
}

impl From<&[&str]> for Names {
    fn from(names: &[&str]) -> Self {
        Self(names.iter().map(|&name| name.to_owned()).collect())
    }
}

impl<const N: usize> From<[&str; N]> for Names {
    fn from(names: [&str; N]) -> Self {
        names[..].into()
    }
}

impl fmt::Display for Names {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.0.join(", "))
    }
}

/// The names of the components of a vector.
pub(crate) const AXES: [&str; 3] = ["x", "y", "z"];

/// A statement of a model: a table of a case file.
pub(crate) trait Part {
    fn facts(&self) -> Facts<'_>;

    /// Its inconsistency, whatever the mesh.
    fn fault(&self) -> Option<Flaw>;

    /// Its part of a description of the model, after a word for its kind; None if other lines have it.
    #[cfg_attr(not(feature = "case"), allow(dead_code))]
    fn told(&self, _: &Units) -> Option<(&'static str, String)> {
        None
    }

    /// Its name in errors: its number, its own name, if any, and its place.
    fn entity(&self, number: usize) -> Entity {
        let facts = self.facts();
        let place = match facts.name {
            Some(name) => format!("\"{name}\" {}", facts.place),
            None => facts.place,
        };
        Entity::one(facts.kind, number, place)
    }
}

/// Properties that all parts have, or may have.
pub(crate) struct Facts<'p> {
    pub kind: EntityKind,
    /// The name that it was given.
    pub name: Option<&'p str>,
    /// Its place, in words; empty without one.
    pub place: String,
    /// The lists with a number for each load step by their keys, such as its own load factors.
    pub factors: Vec<(&'static str, &'p [f64])>,
}

/// Those of the lists that are stated.
pub(super) fn by_step<'p, const N: usize>(
    all: [(&'static str, &'p Option<Vec<f64>>); N],
) -> Vec<(&'static str, &'p [f64])> {
    let stated = all.into_iter();
    stated
        .filter_map(|(key, list)| Some((key, list.as_deref()?)))
        .collect()
}

/// The flaw of a list that says in which load steps something acts, if it has other numbers than 0 and 1.
pub(super) fn not_a_switch(key: &'static str, steps: &Option<Vec<f64>>) -> Option<Flaw> {
    let fits = |v: &f64| *v == 0.0 || *v == 1.0;
    let text = match key {
        "active" => "active is 1 in load steps in which it acts, and 0 in the others",
        _ => {
            "lock is 1 in load steps in which it holds its nodes where they are, and 0 in the others"
        }
    };
    (!steps.iter().flatten().all(fits)).then(|| Flaw::of(key, text))
}

/// The common method of parts that results mention: a name.
macro_rules! with_a_name {
    ($part:ident) => {
        impl<const D: usize> $part<D> {
            /// Its own name, used in messages, tables and pictures.
            pub fn named(mut self, name: impl Into<String>) -> Self {
                self.name = Some(name.into());
                self
            }
        }
    };
}

with_a_name!(Support);
with_a_name!(Traction);
with_a_name!(BodyForce);
with_a_name!(Force);
with_a_name!(Temperature);
with_a_name!(Equal);
with_a_name!(Foundation);
pub(super) use with_a_name;

/// The common methods of supports, tractions, forces and body forces: a quantity along each axis, and load factors.
macro_rules! along_axes {
    ($part:ident, $what:literal, $unit:literal) => {
        impl<const D: usize> $part<D> {
            #[doc = concat!("The ", $what, " along x, in ", $unit, ".")]
            pub fn x(self, value: impl Into<Quantity<D>>) -> Self {
                self.along(0, value)
            }

            #[doc = concat!("The ", $what, " along y, in ", $unit, ".")]
            pub fn y(self, value: impl Into<Quantity<D>>) -> Self {
                self.along(1, value)
            }

            /// Its own load factors, one per step.
            pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
                self.factors = Some(factors.into());
                self
            }

            /// The same along any axis, one of D.
            pub(crate) fn along(mut self, axis: usize, value: impl Into<Quantity<D>>) -> Self {
                *self.components_mut()[axis] = Some(value.into());
                self
            }

            /// Its components along the axes.
            pub(super) fn components(&self) -> [Option<&Quantity<D>>; D] {
                let all = [&self.x, &self.y, &self.z];
                std::array::from_fn(|axis| all[axis].as_ref())
            }

            pub(super) fn components_mut(&mut self) -> [&mut Option<Quantity<D>>; 3] {
                [&mut self.x, &mut self.y, &mut self.z]
            }
        }

        /// Space.
        impl $part<3> {
            #[doc = concat!("The ", $what, " along z, in ", $unit, ".")]
            pub fn z(self, value: impl Into<Quantity<3>>) -> Self {
                self.along(2, value)
            }
        }
    };
}

/// Further common methods of supports and tractions: a quantity along each direction about an axis.
macro_rules! about_an_axis {
    ($part:ident, $what:literal, $unit:literal) => {
        impl<const D: usize> $part<D> {
            /// Sets the axis of `radial`, `hoop` and `axial`.
            pub fn about(mut self, axis: Axis<D>) -> Self {
                self.axis = Some(axis);
                self
            }

            #[doc = concat!("The ", $what, " away from the axis, in ", $unit, ".")]
            pub fn radial(self, value: impl Into<Quantity<D>>) -> Self {
                self.around(0, value)
            }

            #[doc = concat!("The ", $what, " around the axis, by the right-hand rule, in ", $unit, ".")]
            pub fn hoop(self, value: impl Into<Quantity<D>>) -> Self {
                self.around(1, value)
            }

            /// The same along any of radial, hoop and axial.
            pub(crate) fn around(mut self, way: usize, value: impl Into<Quantity<D>>) -> Self {
                *self.ways_mut()[way] = Some(value.into());
                self
            }

            /// Its components away from the axis, around it and along it.
            pub(super) fn ways(&self) -> [Option<&Quantity<D>>; 3] {
                [&self.radial, &self.hoop, &self.axial].map(Option::as_ref)
            }

            fn ways_mut(&mut self) -> [&mut Option<Quantity<D>>; 3] {
                [&mut self.radial, &mut self.hoop, &mut self.axial]
            }
        }

        /// Space.
        impl $part<3> {
            #[doc = concat!("The ", $what, " along the axis, in ", $unit, ".")]
            pub fn axial(self, value: impl Into<Quantity<3>>) -> Self {
                self.around(2, value)
            }
        }
    };
}

about_an_axis!(Support, "displacement", "m");
about_an_axis!(Traction, "force per area", "Pa");

/// The fault of the entries about an axis.
fn axis_fault<const D: usize>(axis: Option<&Axis<D>>, wanted: bool) -> Option<Flaw> {
    match axis {
        Some(axis) => axis.fault().or((!wanted).then_some(
            "an axis is stated, but no component about it: state radial, hoop, axial or, of a traction, torque",
        )),
        None if wanted => {
            return Some("radial, hoop, axial and torque need an axis: state it".into());
        }
        None => None,
    }
    .map(|text| Flaw::of("axis", text))
}

/// The fault of vectors that are to be perpendicular to each other.
fn not_perpendicular<const D: usize>(vectors: &[[f64; D]; D]) -> Option<&'static str> {
    // Files have six digits at least.
    const ALONG: f64 = 1e-5;
    let units = vectors.map(unit);
    let are_units = units.iter().flatten().all(|part| part.is_finite());
    let pairs = (0..D).flat_map(|a| (0..a).map(move |b| (a, b)));
    let are_across = pairs
        .into_iter()
        .all(|(a, b)| dot(units[a], units[b]).abs() <= ALONG);
    (!(are_units && are_across)).then_some(match D {
        2 => "directions are finite vectors, perpendicular to each other and none of them zero: [[0.8, 0.6], [-0.6, 0.8]]",
        _ => {
            "directions are finite vectors, perpendicular to each other and none of them zero: \
             [[0.8, 0.6, 0], [-0.6, 0.8, 0], [0, 0, 1]]"
        }
    })
}

/// The stated values, with their names.
fn values<'q, const D: usize>(
    stated: impl IntoIterator<Item = (&'static str, Option<&'q Quantity<D>>)>,
) -> Vec<String> {
    let stated = stated.into_iter();
    stated
        .filter_map(|(name, value)| Some(format!("{name} = {}", value?)))
        .collect()
}

along_axes!(Support, "displacement", "m");
along_axes!(Traction, "force per area", "Pa");
along_axes!(BodyForce, "force per volume", "N/m³");
along_axes!(Force, "force on each node", "N");

/// Prescribed displacements on boundaries or at a point. Components that are not stated are free.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Support<const D: usize = 2> {
    pub(super) name: Option<String>,
    pub(super) boundary: Option<Names>,
    /// Sets of nodes.
    pub(super) nodes: Option<Names>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    pub(super) point: Option<[f64; D]>,
    pub(super) x: Option<Quantity<D>>,
    pub(super) y: Option<Quantity<D>>,
    #[serde(default, deserialize_with = "stated::z")]
    pub(super) z: Option<Quantity<D>>,
    /// Those of x, y and z, perpendicular to each other and of any length; None: the axes.
    #[serde(
        default,
        deserialize_with = "stated::vectors",
        serialize_with = "stated::entries_of_vectors"
    )]
    pub(super) directions: Option<[[f64; D]; D]>,
    pub(super) radial: Option<Quantity<D>>,
    pub(super) hoop: Option<Quantity<D>>,
    #[serde(default, deserialize_with = "stated::axial")]
    pub(super) axial: Option<Quantity<D>>,
    pub(super) axis: Option<Axis<D>>,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    pub(super) symmetry: bool,
    pub(super) rotate: Option<Turn<D>>,
    pub(super) factors: Option<Vec<f64>>,
    /// 1 in load steps in which it acts, 0 in the others.
    pub(super) active: Option<Vec<f64>>,
    /// 1 in load steps in which it holds its nodes where they are, 0 in the others.
    pub(super) lock: Option<Vec<f64>>,
}

/// The place of a support, or a force.
#[derive(Clone, Copy, Debug)]
pub(super) enum Target<'n, const D: usize> {
    Boundary(&'n Names),
    /// Sets of nodes.
    Nodes(&'n Names),
    Point([f64; D]),
}

impl<'n, const D: usize> Target<'n, D> {
    /// The stated place, if it is exactly one.
    pub(super) fn of(
        boundary: &'n Option<Names>,
        nodes: &'n Option<Names>,
        point: Option<[f64; D]>,
    ) -> Option<Self> {
        match (boundary, nodes, point) {
            (Some(names), None, None) => Some(Self::Boundary(names)),
            (None, Some(sets), None) => Some(Self::Nodes(sets)),
            (None, None, Some(point)) => Some(Self::Point(point)),
            _ => None,
        }
    }

    /// Its names or its point.
    pub(super) fn name(self) -> String {
        match self {
            Self::Boundary(names) | Self::Nodes(names) => names.to_string(),
            Self::Point(point) => {
                let point: Vec<String> = point.iter().map(f64::to_string).collect();
                format!("({})", point.join(", "))
            }
        }
    }

    /// In words, for messages.
    pub(super) fn place(self) -> String {
        match self {
            Self::Boundary(_) => format!("on \"{}\"", self.name()),
            Self::Nodes(_) => format!("on the nodes \"{}\"", self.name()),
            Self::Point(_) => format!("at {}", self.name()),
        }
    }

    pub(super) fn fault(self) -> Option<&'static str> {
        match self {
            Self::Boundary(names) if names.all().is_empty() => Some(NO_BOUNDARY),
            Self::Nodes(names) if names.all().is_empty() => {
                Some("a list of node sets is empty: name at least one")
            }
            _ => None,
        }
    }
}

/// The common methods of supports and forces: they have one of three places.
macro_rules! in_a_place {
    ($part:ident) => {
        impl<const D: usize> $part<D> {
            /// Its place, after the check.
            pub(super) fn target(&self) -> Target<'_, D> {
                self.stated_target().expect("checked: it is in one place")
            }

            fn stated_target(&self) -> Option<Target<'_, D>> {
                Target::of(&self.boundary, &self.nodes, self.point)
            }
        }
    };
}

pub(super) use in_a_place;

in_a_place!(Support);
in_a_place!(Force);

impl<const D: usize> Support<D> {
    /// On a boundary, or on several.
    pub fn on(boundary: impl Into<Names>) -> Self {
        Self {
            boundary: Some(boundary.into()),
            ..Self::default()
        }
    }

    /// At the nodes of a set, or of several.
    pub fn at_nodes(sets: impl Into<Names>) -> Self {
        Self {
            nodes: Some(sets.into()),
            ..Self::default()
        }
    }

    /// At the node nearest to a point.
    pub fn at_point(point: [f64; D]) -> Self {
        Self {
            point: Some(point),
            ..Self::default()
        }
    }

    /// No displacement at all.
    pub fn fixed(self) -> Self {
        (0..D).fold(self, |support, axis| support.along(axis, 0.0))
    }

    /// Turns x, y and z: they are along these vectors, which are perpendicular to each other and of any length.
    pub fn directed(mut self, directions: [[f64; D]; D]) -> Self {
        self.directions = Some(directions);
        self
    }

    /// Rotates the held nodes about an axis, by an angle in degrees at the load factor 1; in the plane counter-clockwise.
    /// Displacements along the axes are added. For large displacements.
    pub fn turned(mut self, axis: Axis<D>, angle: f64) -> Self {
        self.rotate = Some(Turn::new(axis, angle));
        self
    }

    /// No displacement perpendicular to each of the boundaries, which must be straight; in space, plane.
    pub fn symmetry(mut self) -> Self {
        self.symmetry = true;
        self
    }

    /// Acts only in the load steps that have 1, not in those that have 0: its nodes are free there.
    pub fn active(mut self, steps: impl Into<Vec<f64>>) -> Self {
        self.active = Some(steps.into());
        self
    }

    /// In the load steps that have 1, its nodes stay where they are at the end of the step before, whatever it prescribes; the first
    /// step has 0.
    pub fn locked_in(mut self, steps: impl Into<Vec<f64>>) -> Self {
        self.lock = Some(steps.into());
        self
    }

    /// All quantities that it prescribes.
    pub(super) fn quantities_mut(&mut self) -> impl Iterator<Item = &mut Quantity<D>> {
        let along = [&mut self.x, &mut self.y, &mut self.z];
        let around = [&mut self.radial, &mut self.hoop, &mut self.axial];
        along.into_iter().chain(around).flatten()
    }

    /// Its name or, where it has none, its boundaries, sets of nodes or point, with the components where it does not hold all.
    pub(super) fn name(&self) -> String {
        if let Some(name) = &self.name {
            return name.clone();
        }
        let stated = self.components().into_iter().zip(AXES);
        let stated = stated.chain(self.ways().into_iter().zip(AROUND));
        let held: Vec<&str> = stated
            .filter_map(|(value, axis)| value.map(|_| axis))
            .collect();
        let mut name = self.target().name();
        if held.len() < D {
            for axis in held {
                name = name + ", " + axis;
            }
        }
        name
    }
}

impl<const D: usize> Part for Support<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Support,
            name: self.name.as_deref(),
            place: self.stated_target().map_or(String::new(), Target::place),
            factors: by_step([
                ("factors", &self.factors),
                ("active", &self.active),
                ("lock", &self.lock),
            ]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let Some(target) = self.stated_target() else {
            return Some("a support needs one of boundary, nodes and point".into());
        };
        let around = self.ways().iter().any(Option::is_some);
        let stated = self.components().iter().any(Option::is_some) || around;
        if let Some(fault) = axis_fault(self.axis.as_ref(), around) {
            return Some(fault);
        }
        if let Some(fault) = target.fault() {
            return Some(fault.into());
        }
        if let Some(directions) = &self.directions {
            let fault = match self.components().iter().any(Option::is_some) {
                _ if around => Some(
                    "radial, hoop and axial have directions of their own: state them in a support of their own, or leave directions out",
                ),
                false => Some("directions are those of x, y and z: state one of these beside them"),
                true => not_perpendicular(directions),
            };
            if let Some(text) = fault {
                return Some(Flaw::of("directions", text));
            }
        }
        if let Some(flaw) = not_a_switch("active", &self.active) {
            return Some(flaw);
        }
        if let Some(flaw) = not_a_switch("lock", &self.lock) {
            return Some(flaw);
        }
        if (self.lock.iter()).any(|steps| steps.first() == Some(&1.0)) {
            let text =
                "lock holds nodes where the load step before has left them: the first step has 0";
            return Some(Flaw::of("lock", text));
        }
        if let Some(turn) = &self.rotate {
            let alone = (around || self.symmetry || self.directions.is_some()).then_some(
                "a support that rotates holds all directions: state only displacements along the axes beside rotate",
            );
            let lasting = self.changes().then_some(
                "a support that rotates acts in all load steps: leave active and lock out, or rotate out",
            );
            return alone
                .or(lasting)
                .or(turn.fault())
                .map(|text| Flaw::of("rotate", text));
        }
        let text = match target {
            Target::Point(_) | Target::Nodes(_) if self.symmetry => alone::<D>(),
            _ if self.symmetry && stated => alone::<D>(),
            _ if !self.symmetry && !stated => match D {
                2 => {
                    "a support needs x, y or symmetry (or radial, hoop about an axis): it holds nothing"
                }
                _ => {
                    "a support needs x, y, z or symmetry (or radial, hoop, axial about an axis): it holds nothing"
                }
            },
            _ => return None,
        };
        Some(text.into())
    }

    fn told(&self, _: &Units) -> Option<(&'static str, String)> {
        let stated = AXES.into_iter().zip(self.components());
        let mut what = values(stated.chain(AROUND.into_iter().zip(self.ways())));
        what.extend(self.axis.map(|axis| format!("about {axis}")));
        what.extend(self.directions.map(|ways| format!("directions {ways:?}")));
        if self.symmetry {
            what.push("symmetry".to_owned());
        }
        if let Some(factors) = &self.factors {
            what.push(format!("factors {factors:?}"));
        }
        for (key, steps) in [("active", &self.active), ("lock", &self.lock)] {
            what.extend(steps.as_ref().map(|steps| format!("{key} {steps:?}")));
        }
        let text = format!("\"{}\": {}", self.name(), what.join(", "));
        Some(("support", text))
    }
}

pub(super) const NO_BOUNDARY: &str = "a list of boundaries is empty: name at least one";

/// An elastic foundation under boundaries on the outside: a force per area against the displacement, in proportion to
/// it. Motions that are not stated are free.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Foundation<const D: usize = 2> {
    pub(super) name: Option<String>,
    pub(super) boundary: Names,
    pub(super) stiffness: Stiffness<D>,
}

impl<const D: usize> Foundation<D> {
    /// Under a boundary, or under several.
    pub fn under(boundary: impl Into<Names>) -> Self {
        Self {
            name: None,
            boundary: boundary.into(),
            stiffness: Stiffness::default(),
        }
    }

    /// The pressure over the displacement along the normal, in Pa/m.
    pub fn normal(mut self, stiffness: impl Into<Quantity<D>>) -> Self {
        *self.stiffness.both_mut()[0] = Some(stiffness.into());
        self
    }

    /// The traction over the displacement across the normal, in Pa/m.
    pub fn tangential(mut self, stiffness: impl Into<Quantity<D>>) -> Self {
        *self.stiffness.both_mut()[1] = Some(stiffness.into());
        self
    }

    /// Its name or, where it has none, its boundaries.
    pub(super) fn title(&self) -> String {
        (self.name.clone()).unwrap_or_else(|| format!("{}, foundation", self.boundary))
    }
}

impl<const D: usize> Part for Foundation<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Foundation,
            name: self.name.as_deref(),
            place: format!("under \"{}\"", self.boundary),
            factors: Vec::new(),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        if self.boundary.all().is_empty() {
            return Some(NO_BOUNDARY.into());
        }
        let text = "a foundation needs a stiffness: normal, tangential or both";
        (self.stiffness.is_hard()).then(|| Flaw::of("stiffness", text))
    }

    fn told(&self, units: &Units) -> Option<(&'static str, String)> {
        let name = (self.name.as_ref()).map_or(String::new(), |name| format!("\"{name}\" under "));
        let stiffness = self.stiffness.told(units)?;
        Some((
            "foundation",
            format!("{name}\"{}\": stiffness {stiffness}", self.boundary),
        ))
    }
}

/// The error that symmetry cannot be combined with other entries.
fn alone<const D: usize>() -> &'static str {
    match D {
        2 => "symmetry takes a boundary and nothing else: leave out x, y, nodes and point",
        _ => "symmetry takes a boundary and nothing else: leave out x, y, z, nodes and point",
    }
}

/// Forces on boundaries.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Traction<const D: usize = 2> {
    pub(super) name: Option<String>,
    pub(super) boundary: Names,
    pub(super) x: Option<Quantity<D>>,
    pub(super) y: Option<Quantity<D>>,
    #[serde(default, deserialize_with = "stated::z")]
    pub(super) z: Option<Quantity<D>>,
    pub(super) pressure: Option<Quantity<D>>,
    pub(super) radial: Option<Quantity<D>>,
    pub(super) hoop: Option<Quantity<D>>,
    #[serde(default, deserialize_with = "stated::axial")]
    pub(super) axial: Option<Quantity<D>>,
    pub(super) torque: Option<f64>,
    pub(super) axis: Option<Axis<D>>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    pub(super) force: Option<[f64; D]>,
    pub(super) factors: Option<Vec<f64>>,
}

impl<const D: usize> Traction<D> {
    /// On a boundary, or on several.
    pub fn on(boundary: impl Into<Names>) -> Self {
        Self {
            boundary: boundary.into(),
            ..Self::default()
        }
    }

    /// In Pa, against the outward normal.
    pub fn pressure(mut self, value: impl Into<Quantity<D>>) -> Self {
        self.pressure = Some(value.into());
        self
    }

    /// A moment about the axis in N·m, as traction around it that grows with the distance from it.
    pub fn torque(mut self, moment: f64) -> Self {
        self.torque = Some(moment);
        self
    }

    /// All of its quantities that depend on the place.
    pub(super) fn quantities_mut(&mut self) -> impl Iterator<Item = &mut Quantity<D>> {
        let along = [&mut self.x, &mut self.y, &mut self.z];
        let around = [&mut self.radial, &mut self.hoop, &mut self.axial];
        let all = along.into_iter().chain(around);
        all.chain([&mut self.pressure]).flatten()
    }

    /// A resultant in N, spread evenly.
    pub fn force(mut self, resultant: [f64; D]) -> Self {
        self.force = Some(resultant);
        self
    }
}

impl<const D: usize> Part for Traction<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Traction,
            name: self.name.as_deref(),
            place: format!("on \"{}\"", self.boundary),
            factors: by_step([("factors", &self.factors)]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let stated = self.pressure.is_some() || self.components().iter().any(Option::is_some);
        let whole = self.torque.is_some() || self.force.is_some();
        let around = self.ways().iter().any(Option::is_some) || self.torque.is_some();
        let mut values = self.torque.iter().chain(self.force.iter().flatten());
        let text = match () {
            () if self.boundary.all().is_empty() => NO_BOUNDARY,
            () if !stated && !around && !whole => match D {
                2 => {
                    "a traction needs x, y, pressure or force (or radial, hoop, torque about an axis)"
                }
                _ => {
                    "a traction needs x, y, z, pressure or force (or radial, hoop, axial, torque about an axis)"
                }
            },
            () if !values.all(|value| value.is_finite()) => "torque and force must be finite",
            () => return axis_fault(self.axis.as_ref(), around),
        };
        Some(text.into())
    }

    fn told(&self, units: &Units) -> Option<(&'static str, String)> {
        let (torque, axis) = (self.torque?, self.axis?);
        let unit = Units::behind(&units.moment());
        let text = format!("\"{}\": {torque}{unit} about {axis}", self.boundary);
        Some(("torque", text))
    }
}

/// Forces in the volume.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct BodyForce<const D: usize = 2> {
    pub(super) name: Option<String>,
    /// None: all of them.
    pub(super) region: Option<String>,
    pub(super) x: Option<Quantity<D>>,
    pub(super) y: Option<Quantity<D>>,
    #[serde(default, deserialize_with = "stated::z")]
    pub(super) z: Option<Quantity<D>>,
    pub(super) factors: Option<Vec<f64>>,
    /// Whether it is that of where the body is, where displacements are large.
    #[serde(default, skip_serializing_if = "stated::is_default")]
    pub(super) displaced: bool,
}

impl<const D: usize> BodyForce<D> {
    /// Where displacements are large: its components are functions of where the body is, instead of where it was at rest. It
    /// stays a force per volume at rest.
    pub fn displaced(mut self) -> Self {
        self.displaced = true;
        self
    }

    /// In all regions.
    pub fn everywhere() -> Self {
        Self::default()
    }

    /// In one region, or in a group of them.
    pub fn within(region: &str) -> Self {
        Self {
            region: Some(region.to_owned()),
            ..Self::default()
        }
    }
}

/// The place of something in a region, in words.
fn inside(region: &Option<String>) -> String {
    (region.as_ref()).map_or(String::new(), |name| format!("in \"{name}\""))
}

impl<const D: usize> Part for BodyForce<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::BodyForce,
            name: self.name.as_deref(),
            place: inside(&self.region),
            factors: by_step([("factors", &self.factors)]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let text = match D {
            2 => "a body force needs x or y",
            _ => "a body force needs x, y or z",
        };
        let mut stated = self.components().into_iter().flatten();
        if self.displaced && stated.clone().any(|one| one.nodal().is_some()) {
            let text = "values at nodes move with these: leave out displaced";
            return Some(Flaw::of("displaced", text));
        }
        stated.next().is_none().then(|| text.into())
    }
}

/// The temperature of bodies above their stress-free state; a material with an expansion grows.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Temperature<const D: usize = 2> {
    pub(super) name: Option<String>,
    /// None: all of them.
    pub(super) region: Option<String>,
    pub(super) value: Quantity<D>,
    pub(super) factors: Option<Vec<f64>>,
}

impl<const D: usize> Temperature<D> {
    fn new(region: Option<String>, value: Quantity<D>) -> Self {
        Self {
            name: None,
            region,
            value,
            factors: None,
        }
    }

    /// In all regions, in K.
    pub fn everywhere(value: impl Into<Quantity<D>>) -> Self {
        Self::new(None, value.into())
    }

    /// In one region, or in a group of them, in K.
    pub fn within(region: &str, value: impl Into<Quantity<D>>) -> Self {
        Self::new(Some(region.to_owned()), value.into())
    }

    /// Its own load factors, one per step.
    pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.factors = Some(factors.into());
        self
    }
}

impl<const D: usize> Part for Temperature<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Temperature,
            name: self.name.as_deref(),
            place: inside(&self.region),
            factors: by_step([("factors", &self.factors)]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        None
    }
}

/// Forces on single nodes, the same on each. (Of elements of second order, an even traction has other forces on corners than
/// between them: to spread a resultant, use [`Traction::force`].)
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Force<const D: usize = 2> {
    pub(super) name: Option<String>,
    /// Sets of nodes.
    pub(super) nodes: Option<Names>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    pub(super) point: Option<[f64; D]>,
    pub(super) boundary: Option<Names>,
    pub(super) x: Option<Quantity<D>>,
    pub(super) y: Option<Quantity<D>>,
    #[serde(default, deserialize_with = "stated::z")]
    pub(super) z: Option<Quantity<D>>,
    pub(super) factors: Option<Vec<f64>>,
}

impl<const D: usize> Force<D> {
    /// On each node of a set, or of several; a node of two of them counts once.
    pub fn at_nodes(sets: impl Into<Names>) -> Self {
        Self {
            nodes: Some(sets.into()),
            ..Self::default()
        }
    }

    /// On each node of a boundary, or of several.
    pub fn on(boundary: impl Into<Names>) -> Self {
        Self {
            boundary: Some(boundary.into()),
            ..Self::default()
        }
    }

    /// On the node nearest to a point.
    pub fn at_point(point: [f64; D]) -> Self {
        Self {
            point: Some(point),
            ..Self::default()
        }
    }
}

#[cfg(feature = "case")]
impl<const D: usize> Force<D> {
    /// The sets of nodes that it is stated for.
    pub(crate) fn sets(&self) -> &[String] {
        self.nodes.as_ref().map_or(&[], Names::all)
    }
}

impl<const D: usize> Part for Force<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Force,
            name: self.name.as_deref(),
            place: self.stated_target().map_or(String::new(), Target::place),
            factors: by_step([("factors", &self.factors)]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let Some(target) = self.stated_target() else {
            return Some("a force needs one of nodes, point and boundary".into());
        };
        let text = match D {
            2 => "a force needs x or y",
            _ => "a force needs x, y or z",
        };
        let stated = self.components().iter().any(Option::is_some);
        let fault = target.fault().or((!stated).then_some(text));
        fault.map(Flaw::from)
    }

    fn told(&self, _: &Units) -> Option<(&'static str, String)> {
        let name = (self.name.as_ref()).map_or(String::new(), |name| format!("\"{name}\" "));
        let place = match self.target() {
            Target::Nodes(names) => format!("on each node of \"{names}\""),
            Target::Boundary(names) => format!("on each node of boundary \"{names}\""),
            Target::Point(point) => format!("at {point:?}"),
        };
        let stated = values(AXES.into_iter().zip(self.components()));
        Some(("force", format!("{name}{place}: {}", stated.join(", "))))
    }
}

/// Sets of nodes that move alike: all nodes of a set have the same displacement. Each set moves independently.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Equal<const D: usize = 2> {
    pub(super) name: Option<String>,
    pub(super) sets: Names,
    /// Along which axes.
    #[serde(
        rename = "directions",
        default = "stated::all_axes",
        deserialize_with = "stated::axes",
        serialize_with = "stated::names_of_axes",
        skip_serializing_if = "stated::is_all"
    )]
    pub(super) bound: [bool; D],
}

impl<const D: usize> Equal<D> {
    /// The nodes of a set ([`Mesh::node_sets`](crate::mesh::Mesh::node_sets)) or of a boundary, or those of each of several, along all
    /// axes.
    pub fn of(sets: impl Into<Names>) -> Self {
        Self {
            name: None,
            sets: sets.into(),
            bound: [true; D],
        }
    }

    /// Only along these axes.
    pub fn along(mut self, bound: [bool; D]) -> Self {
        self.bound = bound;
        self
    }

    /// Its sets, if they are few.
    pub(super) fn title(&self) -> String {
        match self.sets.all() {
            [first, .., last] if self.sets.all().len() > 3 => format!("{first} … {last}"),
            _ => self.sets.to_string(),
        }
    }

    /// Its axes, in words.
    pub(super) fn directions(&self) -> String {
        let bound = AXES.iter().zip(self.bound).filter(|axis| axis.1);
        let names: Vec<&str> = bound.map(|(name, _)| *name).collect();
        names.join(", ")
    }
}

impl<const D: usize> Part for Equal<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Equal,
            name: self.name.as_deref(),
            place: format!("of \"{}\"", self.title()),
            factors: Vec::new(),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        if self.sets.all().is_empty() {
            return Some("it needs at least one set of nodes".into());
        }
        (self.bound == [false; D]).then(|| "directions needs at least one axis".into())
    }
}

/// The material of regions.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Filling {
    /// None: all of them.
    pub(super) region: Option<Names>,
    young: f64,
    poisson: f64,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    density: f64,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    expansion: f64,
    #[serde(
        default,
        deserialize_with = "stated::incompressible",
        serialize_with = "stated::flag",
        skip_serializing_if = "stated::is_default"
    )]
    incompressible: Incompressible,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    incompatible_modes: bool,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    law: Hyperelastic,
    pub(super) thickness: Option<f64>,
}

impl Filling {
    pub(crate) fn of(region: Option<Names>, material: Material) -> Self {
        Self {
            region,
            young: material.young,
            poisson: material.poisson,
            density: material.density,
            expansion: material.expansion,
            incompressible: material.incompressible,
            incompatible_modes: material.incompatible_modes,
            law: material.law,
            thickness: material.thickness,
        }
    }

    pub(super) fn material(&self) -> Material {
        Material {
            young: self.young,
            poisson: self.poisson,
            density: self.density,
            expansion: self.expansion,
            incompressible: self.incompressible,
            incompatible_modes: self.incompatible_modes,
            law: self.law,
            thickness: self.thickness,
        }
    }
}

impl Part for Filling {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Material,
            name: None,
            place: (self.region.as_ref()).map_or(String::new(), |names| format!("of \"{names}\"")),
            factors: Vec::new(),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let text = if !(self.young > 0.0 && self.young.is_finite()) {
            format!("young is {}: it must be positive", self.young)
        } else if !is_sized(self.young) {
            format!("young is {:e}: {SIZES}", self.young)
        } else if !(self.poisson > -1.0 && self.poisson < 0.5) {
            format!(
                "poisson is {}: it must lie between −1 and 0.5, both excluded",
                self.poisson
            )
        } else if !self.expansion.is_finite() {
            format!("expansion is {}: it must be finite", self.expansion)
        } else if !(self.density >= 0.0 && self.density.is_finite()) {
            format!("density is {}: it must not be negative", self.density)
        } else {
            return None;
        };
        Some(text.into())
    }
}
