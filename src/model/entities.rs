//! What a model consists of beside contacts (`pair.rs`): supports and loads, as they are stated.

use super::Quantity;
use super::axis::{AROUND, Axis};
use super::error::{Entity, EntityKind};
use std::fmt;

/// The name of a boundary, or several that count as one.
#[derive(Clone, Debug, PartialEq)]
pub struct Names(Vec<String>);

impl Names {
    /// All of them.
    pub fn all(&self) -> &[String] {
        &self.0
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

/// What the components of a vector are called.
pub(crate) const AXES: [&str; 3] = ["x", "y", "z"];

/// What parts that results speak of have in common: a name.
macro_rules! with_a_name {
    ($part:ident) => {
        impl<const D: usize> $part<D> {
            /// A name of its own, which messages, tables and pictures call it by.
            pub fn named(mut self, name: impl Into<String>) -> Self {
                self.name = Some(name.into());
                self
            }

            /// What an error calls it: its name, if it has one, and where it is.
            fn place(&self, place: String) -> String {
                match &self.name {
                    Some(name) => format!("\"{name}\" {place}"),
                    None => place,
                }
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
pub(super) use with_a_name;

/// What supports, tractions, forces and body forces have in common: a quantity along each axis, and load factors.
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

            /// Load factors of its own, one per step.
            pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
                self.factors = Some(factors.into());
                self
            }

            /// The same along any axis, which has to be one of D.
            pub(crate) fn along(mut self, axis: usize, value: impl Into<Quantity<D>>) -> Self {
                self.components[axis] = Some(value.into());
                self
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

/// What supports and tractions have in common beside: a quantity along each direction about an axis.
macro_rules! about_an_axis {
    ($part:ident, $what:literal, $unit:literal) => {
        impl<const D: usize> $part<D> {
            /// Says which axis `radial`, `hoop` and `axial` are about.
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
                self.around[way] = Some(value.into());
                self
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

/// What is wrong with what is said about an axis.
fn axis_fault<const D: usize>(axis: Option<&Axis<D>>, wanted: bool) -> Option<&'static str> {
    match axis {
        Some(axis) => axis.fault().or((!wanted).then_some(
            "there is an axis, but nothing about it: state radial, hoop, axial or, of a traction, torque",
        )),
        None if wanted => Some("radial, hoop, axial and torque are about an axis: state it"),
        None => None,
    }
}

along_axes!(Support, "displacement", "m");
along_axes!(Traction, "force per area", "Pa");
along_axes!(BodyForce, "force per volume", "N/m³");
along_axes!(Force, "force on each node", "N");

/// Prescribed displacements on boundaries or at a point. What is not stated is free.
#[derive(Clone, Debug)]
pub struct Support<const D: usize = 2> {
    pub(super) place: Target<D>,
    pub(super) components: [Option<Quantity<D>>; D],
    /// Away from the axis, around it, along it.
    pub(super) around: [Option<Quantity<D>>; 3],
    pub(super) axis: Option<Axis<D>>,
    pub(super) symmetry: bool,
    pub(super) factors: Option<Vec<f64>>,
    pub(super) name: Option<String>,
}

/// Where a support is, or a force.
#[derive(Clone, Debug)]
pub(super) enum Target<const D: usize> {
    Boundary(Names),
    /// Sets of nodes.
    Nodes(Names),
    Point([f64; D]),
}

impl<const D: usize> Target<D> {
    /// Its names or its point.
    fn name(&self) -> String {
        match self {
            Self::Boundary(names) | Self::Nodes(names) => names.to_string(),
            Self::Point(point) => {
                let point: Vec<String> = point.iter().map(f64::to_string).collect();
                format!("({})", point.join(", "))
            }
        }
    }

    /// In words, for messages.
    fn place(&self) -> String {
        match self {
            Self::Boundary(_) => format!("on \"{}\"", self.name()),
            Self::Nodes(_) => format!("on the nodes \"{}\"", self.name()),
            Self::Point(_) => format!("at {}", self.name()),
        }
    }

    fn fault(&self) -> Option<&'static str> {
        match self {
            Self::Boundary(names) if names.all().is_empty() => Some(NO_BOUNDARY),
            Self::Nodes(names) if names.all().is_empty() => {
                Some("a list of node sets is empty: name at least one")
            }
            _ => None,
        }
    }
}

impl<const D: usize> Support<D> {
    fn at(place: Target<D>) -> Self {
        Self {
            place,
            components: [const { None }; D],
            around: [const { None }; 3],
            axis: None,
            symmetry: false,
            factors: None,
            name: None,
        }
    }

    /// On a boundary, or on several.
    pub fn on(boundary: impl Into<Names>) -> Self {
        Self::at(Target::Boundary(boundary.into()))
    }

    /// At the nodes of a set, or of several.
    pub fn at_nodes(sets: impl Into<Names>) -> Self {
        Self::at(Target::Nodes(sets.into()))
    }

    /// At the node nearest to a point.
    pub fn at_point(point: [f64; D]) -> Self {
        Self::at(Target::Point(point))
    }

    /// No displacement at all.
    pub fn fixed(mut self) -> Self {
        self.components = std::array::from_fn(|_| Some(0.0.into()));
        self
    }

    /// No displacement across each of the boundaries, which have to be straight; in space, plane.
    pub fn symmetry(mut self) -> Self {
        self.symmetry = true;
        self
    }

    pub(super) fn entity(&self, number: usize) -> Entity {
        Entity::one(EntityKind::Support, number, self.place(self.place.place()))
    }

    /// Its name or, where it has none, its boundaries, sets of nodes or point, with the components where it does not hold all.
    pub(super) fn name(&self) -> String {
        if let Some(name) = &self.name {
            return name.clone();
        }
        let names = AXES[..D].iter().chain(&AROUND);
        let held: Vec<&str> = (self.components.iter().chain(&self.around).zip(names))
            .filter_map(|(value, axis)| value.as_ref().map(|_| *axis))
            .collect();
        let mut name = self.place.name();
        if held.len() < D {
            for axis in held {
                name = name + ", " + axis;
            }
        }
        name
    }

    /// What cannot be meant, whatever the mesh.
    pub(super) fn fault(&self) -> Option<&'static str> {
        let around = self.around.iter().any(Option::is_some);
        let stated = self.components.iter().any(Option::is_some) || around;
        if let Some(fault) = axis_fault(self.axis.as_ref(), around) {
            return Some(fault);
        }
        if let Some(fault) = self.place.fault() {
            return Some(fault);
        }
        match &self.place {
            Target::Point(_) | Target::Nodes(_) if self.symmetry => Some(alone::<D>()),
            _ if self.symmetry && stated => Some(alone::<D>()),
            _ if !self.symmetry && !stated => Some(match D {
                2 => {
                    "a support needs x, y or symmetry (or radial, hoop about an axis): it holds nothing"
                }
                _ => {
                    "a support needs x, y, z or symmetry (or radial, hoop, axial about an axis): it holds nothing"
                }
            }),
            _ => None,
        }
    }
}

pub(super) const NO_BOUNDARY: &str = "a list of boundaries is empty: name at least one";

/// What symmetry cannot stand with.
fn alone<const D: usize>() -> &'static str {
    match D {
        2 => "symmetry stands alone with a boundary: leave out x, y, nodes and point",
        _ => "symmetry stands alone with a boundary: leave out x, y, z, nodes and point",
    }
}

/// Forces on boundaries.
#[derive(Clone, Debug)]
pub struct Traction<const D: usize = 2> {
    pub(super) boundary: Names,
    pub(super) components: [Option<Quantity<D>>; D],
    pub(super) pressure: Option<Quantity<D>>,
    /// Away from the axis, around it, along it.
    pub(super) around: [Option<Quantity<D>>; 3],
    pub(super) axis: Option<Axis<D>>,
    pub(super) torque: Option<f64>,
    pub(super) force: Option<[f64; D]>,
    pub(super) factors: Option<Vec<f64>>,
    pub(super) name: Option<String>,
}

impl<const D: usize> Traction<D> {
    /// On a boundary, or on several.
    pub fn on(boundary: impl Into<Names>) -> Self {
        Self {
            boundary: boundary.into(),
            components: [const { None }; D],
            pressure: None,
            around: [const { None }; 3],
            axis: None,
            torque: None,
            force: None,
            factors: None,
            name: None,
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

    /// A resultant in N, spread evenly.
    pub fn force(mut self, resultant: [f64; D]) -> Self {
        self.force = Some(resultant);
        self
    }

    pub(super) fn entity(&self, number: usize) -> Entity {
        Entity::one(
            EntityKind::Traction,
            number,
            self.place(format!("on \"{}\"", self.boundary)),
        )
    }

    pub(super) fn fault(&self) -> Option<&'static str> {
        let stated = self.components.iter().chain([&self.pressure]);
        let whole = self.torque.is_some() || self.force.is_some();
        let around = self.around.iter().any(Option::is_some) || self.torque.is_some();
        let mut values = self.torque.iter().chain(self.force.iter().flatten());
        match () {
            () if self.boundary.all().is_empty() => Some(NO_BOUNDARY),
            () if stated.flatten().next().is_none() && !around && !whole => Some(match D {
                2 => {
                    "a traction needs x, y, pressure or force (or radial, hoop, torque about an axis)"
                }
                _ => {
                    "a traction needs x, y, z, pressure or force (or radial, hoop, axial, torque about an axis)"
                }
            }),
            () if !values.all(|value| value.is_finite()) => Some("torque and force must be finite"),
            () => axis_fault(self.axis.as_ref(), around),
        }
    }
}

/// Forces in the volume.
#[derive(Clone, Debug)]
pub struct BodyForce<const D: usize = 2> {
    pub(super) region: Option<String>,
    pub(super) components: [Option<Quantity<D>>; D],
    pub(super) factors: Option<Vec<f64>>,
    pub(super) name: Option<String>,
}

impl<const D: usize> BodyForce<D> {
    fn new(region: Option<String>) -> Self {
        Self {
            region,
            components: [const { None }; D],
            factors: None,
            name: None,
        }
    }

    /// In all regions.
    pub fn everywhere() -> Self {
        Self::new(None)
    }

    /// In one region, or in a group of them.
    pub fn within(region: &str) -> Self {
        Self::new(Some(region.to_owned()))
    }

    pub(super) fn entity(&self, number: usize) -> Entity {
        let place = (self.region.as_ref()).map_or(String::new(), |name| format!("in \"{name}\""));
        Entity::one(EntityKind::BodyForce, number, self.place(place))
    }

    pub(super) fn fault(&self) -> Option<&'static str> {
        let stated = self.components.iter().any(Option::is_some);
        (!stated).then_some(match D {
            2 => "a body force needs x or y",
            _ => "a body force needs x, y or z",
        })
    }
}

/// How much warmer bodies are than when they were free of stress; where a material has an expansion, they grow.
#[derive(Clone, Debug)]
pub struct Temperature<const D: usize = 2> {
    pub(super) region: Option<String>,
    pub(super) value: Quantity<D>,
    pub(super) factors: Option<Vec<f64>>,
    pub(super) name: Option<String>,
}

impl<const D: usize> Temperature<D> {
    fn new(region: Option<String>, value: Quantity<D>) -> Self {
        Self {
            region,
            value,
            factors: None,
            name: None,
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

    /// Load factors of its own, one per step.
    pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.factors = Some(factors.into());
        self
    }

    pub(super) fn entity(&self, number: usize) -> Entity {
        let place = (self.region.as_ref()).map_or(String::new(), |name| format!("in \"{name}\""));
        Entity::one(EntityKind::Temperature, number, self.place(place))
    }
}

/// Forces on single nodes, the same on each. (Of elements of second order, an even traction has other forces on corners than
/// between them: to spread a resultant, use [`Traction::force`].)
#[derive(Clone, Debug)]
pub struct Force<const D: usize = 2> {
    pub(super) place: Target<D>,
    pub(super) components: [Option<Quantity<D>>; D],
    pub(super) factors: Option<Vec<f64>>,
    pub(super) name: Option<String>,
}

impl<const D: usize> Force<D> {
    fn at(place: Target<D>) -> Self {
        Self {
            place,
            components: [const { None }; D],
            factors: None,
            name: None,
        }
    }

    /// On each node of a set, or of several; a node of two of them counts once.
    pub fn at_nodes(sets: impl Into<Names>) -> Self {
        Self::at(Target::Nodes(sets.into()))
    }

    /// On each node of a boundary, or of several.
    pub fn on(boundary: impl Into<Names>) -> Self {
        Self::at(Target::Boundary(boundary.into()))
    }

    /// On the node nearest to a point.
    pub fn at_point(point: [f64; D]) -> Self {
        Self::at(Target::Point(point))
    }

    pub(super) fn entity(&self, number: usize) -> Entity {
        Entity::one(EntityKind::Force, number, self.place(self.place.place()))
    }

    pub(super) fn fault(&self) -> Option<&'static str> {
        let stated = self.components.iter().any(Option::is_some);
        self.place.fault().or((!stated).then_some(match D {
            2 => "a force needs x or y",
            _ => "a force needs x, y or z",
        }))
    }
}

/// Sets of nodes that move alike: all nodes of a set have the same displacement. Each set moves by itself.
#[derive(Clone, Debug)]
pub struct Equal<const D: usize = 2> {
    pub(super) sets: Names,
    /// Along which axes.
    pub(super) bound: [bool; D],
    pub(super) name: Option<String>,
}

impl<const D: usize> Equal<D> {
    /// The nodes of a set ([`Mesh::node_sets`](crate::mesh::Mesh::node_sets)) or of a boundary, or those of each of several, along all
    /// axes.
    pub fn of(sets: impl Into<Names>) -> Self {
        Self {
            sets: sets.into(),
            bound: [true; D],
            name: None,
        }
    }

    /// Only along these axes.
    pub fn along(mut self, bound: [bool; D]) -> Self {
        self.bound = bound;
        self
    }

    pub(super) fn entity(&self, number: usize) -> Entity {
        let place = format!("of \"{}\"", self.title());
        Entity::one(EntityKind::Equal, number, self.place(place))
    }

    pub(super) fn fault(&self) -> Option<&'static str> {
        if self.sets.all().is_empty() {
            return Some("it needs at least one set of nodes");
        }
        (self.bound == [false; D]).then_some("directions needs at least one axis")
    }

    /// Its sets, as far as they are few.
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
