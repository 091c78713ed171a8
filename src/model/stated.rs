//! Reading parts of a model from the tables of a case file, where their types alone do not suffice.

use super::Quantity;
use super::entities::{AXES, Names};
use crate::contact::Obstacle;
use crate::elasticity::{Incompressible, Plane};
use serde::de::{Error, IgnoredAny};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt::Display;

/// The fault of a part, and its key: none for the part as a whole.
pub(crate) struct Flaw {
    pub key: &'static str,
    pub text: String,
}

impl Flaw {
    pub(super) fn of(key: &'static str, text: impl Into<String>) -> Self {
        let text = text.into();
        Self { key, text }
    }
}

impl From<&str> for Flaw {
    fn from(text: &str) -> Self {
        Self::of("", text)
    }
}

impl From<String> for Flaw {
    fn from(text: String) -> Self {
        Self::of("", text)
    }
}

/// Begins messages of this room, which are whole sentences about the meaning of a value; other messages are about its
/// form.
pub(crate) const MEANING: char = '\u{2}';

pub(super) fn meaningless<E: Error>(text: impl Display) -> E {
    E::custom(format_args!("{MEANING}{text}"))
}

/// The name of D dimensions.
pub(crate) fn called(dimension: usize) -> &'static str {
    match dimension {
        2 => "the plane",
        _ => "space",
    }
}

/// Numbers as a point or a vector.
pub(crate) fn as_vector<const D: usize>(entries: &[f64]) -> Result<[f64; D], String> {
    entries.try_into().map_err(|_| {
        let (found, place) = (entries.len(), called(D));
        format!("expected {D} entries, found {found}: the mesh is in {place}")
    })
}

pub(super) fn point<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<[f64; D], S::Error> {
    as_vector(&Vec::deserialize(from)?).map_err(meaningless)
}

pub(super) fn vector<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<[f64; D]>, S::Error> {
    point(from).map(Some)
}

/// A point or a vector that may be left out, as it is read.
pub(super) fn entries<S: Serializer, const D: usize>(
    vector: &Option<[f64; D]>,
    to: S,
) -> Result<S::Ok, S::Error> {
    (vector.as_ref()).map(<[f64; D]>::as_slice).serialize(to)
}

/// A vector for each dimension.
pub(super) fn vectors<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<[[f64; D]; D]>, S::Error> {
    let vectors = Vec::<Vec<f64>>::deserialize(from)?;
    let rows = vectors.iter().map(|entries| as_vector(entries));
    let rows = rows.collect::<Result<Vec<_>, _>>().map_err(meaningless)?;
    let found = rows.len();
    let wrong = |_| {
        let place = called(D);
        meaningless(format_args!(
            "expected {D} vectors, found {found}: the mesh is in {place}"
        ))
    };
    rows.try_into().map(Some).map_err(wrong)
}

pub(super) fn entries_of_vectors<S: Serializer, const D: usize>(
    vectors: &Option<[[f64; D]; D]>,
    to: S,
) -> Result<S::Ok, S::Error> {
    let rows = vectors
        .as_ref()
        .map(|rows| rows.each_ref().map(<[f64; D]>::as_slice));
    rows.as_ref().map(<[_; D]>::as_slice).serialize(to)
}

/// Whether an entry equals its default.
pub(super) fn is_default<T: Default + PartialEq>(entry: &T) -> bool {
    *entry == T::default()
}

/// An entry that exists in only one dimension; `beyond` explains why the other lacks it.
fn only<'de, S: Deserializer<'de>, T: Deserialize<'de>>(
    has: bool,
    beyond: &str,
    from: S,
) -> Result<Option<T>, S::Error> {
    if has {
        return T::deserialize(from).map(Some);
    }
    IgnoredAny::deserialize(from)?;
    Err(meaningless(beyond))
}

pub(super) fn z<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<Quantity<D>>, S::Error> {
    let beyond = "z has no meaning here: the mesh is in the plane, with x and y";
    only(D == 3, beyond, from)
}

/// A number that only space has.
pub(super) fn of_space<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<f64>, S::Error> {
    let beyond = "z, rx and ry have no meaning here: the mesh is in the plane, with x, y and rz";
    only(D == 3, beyond, from)
}

/// A gap, which is infinite where there is no obstacle.
pub(super) fn gap<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<Quantity<D>>, S::Error> {
    Quantity::or_infinite(from).map(Some)
}

pub(super) fn axial<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<Quantity<D>>, S::Error> {
    let beyond = "axial has no meaning here: the mesh is in the plane, which has radial and hoop";
    only(D == 3, beyond, from)
}

pub(super) fn plane<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<Plane>, S::Error> {
    let beyond = "plane has no meaning for a solid: leave it out";
    only(D == 2, beyond, from)
}

/// Why a solid has none.
pub(super) const NO_THICKNESS: &str = "thickness has no meaning for a solid: leave it out";

pub(super) fn thickness<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<f64>, S::Error> {
    only(D == 2, NO_THICKNESS, from)
}

/// The direction of an axis, which exists only in space; `key` names it.
fn direction_in<'de, S: Deserializer<'de>, const D: usize>(
    key: &str,
    from: S,
) -> Result<Option<[f64; 3]>, S::Error> {
    let beyond =
        format!("in the plane an axis is a point, perpendicular to the plane: leave out {key}");
    let entries: Option<Vec<f64>> = only(D == 3, &beyond, from)?;
    let vector = entries.map(|entries| as_vector(&entries));
    vector.transpose().map_err(meaningless)
}

pub(super) fn direction<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<[f64; 3]>, S::Error> {
    direction_in::<S, D>("the direction", from)
}

pub(super) fn axis<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<[f64; 3]>, S::Error> {
    direction_in::<S, D>("axis", from)
}

pub(super) fn all_axes<const D: usize>() -> [bool; D] {
    [true; D]
}

pub(super) fn no_axes<const D: usize>() -> [bool; D] {
    [false; D]
}

pub(super) fn axes<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<[bool; D], S::Error> {
    let mut bound = [false; D];
    for direction in Names::deserialize(from)?.all() {
        let Some(axis) = AXES[..D].iter().position(|axis| axis == direction) else {
            let known = AXES[..D].join("\", \"");
            let text = format_args!("\"{direction}\" is not one of the directions \"{known}\"");
            return Err(meaningless(text));
        };
        bound[axis] = true;
    }
    Ok(bound)
}

pub(super) fn is_all<const D: usize>(bound: &[bool; D]) -> bool {
    *bound == all_axes()
}

pub(super) fn is_none<const D: usize>(bound: &[bool; D]) -> bool {
    *bound == no_axes()
}

pub(super) fn names_of_axes<S: Serializer, const D: usize>(
    bound: &[bool; D],
    to: S,
) -> Result<S::Ok, S::Error> {
    let bound = AXES.iter().zip(bound).filter(|axis| *axis.1);
    to.collect_seq(bound.map(|axis| axis.0))
}

/// A number, or a list of numbers.
pub(super) fn one_or_several<'de, S: Deserializer<'de>>(
    from: S,
) -> Result<Option<Vec<f64>>, S::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected a number or a list of numbers")]
    enum Numbers {
        One(f64),
        Several(Vec<f64>),
    }
    Ok(Some(match Numbers::deserialize(from)? {
        Numbers::One(number) => vec![number],
        Numbers::Several(numbers) => numbers,
    }))
}

/// "auto", true or false.
pub(super) fn incompressible<'de, S: Deserializer<'de>>(
    from: S,
) -> Result<Incompressible, S::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected \"auto\", true or false")]
    enum Said {
        Flag(bool),
        Word(Word),
    }
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Word {
        Auto,
    }
    Ok(match Said::deserialize(from)? {
        Said::Flag(true) => Incompressible::Yes,
        Said::Flag(false) => Incompressible::No,
        Said::Word(Word::Auto) => Incompressible::Auto,
    })
}

pub(super) fn flag<S: Serializer>(said: &Incompressible, to: S) -> Result<S::Ok, S::Error> {
    match said {
        Incompressible::Auto => to.serialize_str("auto"),
        said => to.serialize_bool(*said == Incompressible::Yes),
    }
}

/// The two spellings of names.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a boundary in quotes, or a list of names"
)]
enum Spelling {
    One(String),
    Several(Vec<String>),
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<S: Deserializer<'de>>(from: S) -> Result<Self, S::Error> {
        Ok(match Spelling::deserialize(from)? {
            Spelling::One(name) => name.into(),
            Spelling::Several(names) => names.into(),
        })
    }
}

impl Serialize for Names {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match self.all() {
            [name] => name.serialize(to),
            names => names.serialize(to),
        }
    }
}

/// Exactly N entries: arrays of serde take the first N of more.
pub(crate) fn exactly<'de, S: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    from: S,
) -> Result<[T; N], S::Error> {
    let entries = Vec::<T>::deserialize(from)?;
    <[T; N]>::try_from(entries).map_err(|entries| {
        S::Error::custom(format!("expected {N} entries, found {}", entries.len()))
    })
}

/// The other side of a boundary, as written: two shapes in the plane, three in space. Normals point out of the obstacle;
/// vectors are of any length.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
enum Shape {
    HalfPlane {
        #[serde(deserialize_with = "exactly")]
        point: [f64; 2],
        #[serde(deserialize_with = "exactly")]
        normal: [f64; 2],
    },
    Circle {
        #[serde(deserialize_with = "exactly")]
        center: [f64; 2],
        radius: f64,
    },
    HalfSpace {
        #[serde(deserialize_with = "exactly")]
        point: [f64; 3],
        #[serde(deserialize_with = "exactly")]
        normal: [f64; 3],
    },
    Sphere {
        #[serde(deserialize_with = "exactly")]
        center: [f64; 3],
        radius: f64,
    },
    /// Without ends.
    Cylinder {
        #[serde(deserialize_with = "exactly")]
        point: [f64; 3],
        #[serde(deserialize_with = "exactly")]
        axis: [f64; 3],
        radius: f64,
    },
}

impl Shape {
    /// Its key, and those of the dimension that it does not belong to.
    fn names(&self) -> (&'static str, &'static str) {
        const PLANE: &str = "half_plane or circle";
        const SPACE: &str = "half_space, sphere or cylinder";
        match self {
            Self::HalfPlane { .. } => ("half_plane", SPACE),
            Self::Circle { .. } => ("circle", SPACE),
            Self::HalfSpace { .. } => ("half_space", PLANE),
            Self::Sphere { .. } => ("sphere", PLANE),
            Self::Cylinder { .. } => ("cylinder", PLANE),
        }
    }

    /// The obstacle, if it exists in D dimensions.
    fn obstacle<const D: usize>(&self) -> Option<Obstacle<D>> {
        fn of<const D: usize>(vector: &[f64]) -> Option<[f64; D]> {
            vector.try_into().ok()
        }
        Some(match self {
            Self::HalfPlane { point, normal } => Obstacle::HalfSpace {
                point: of(point)?,
                normal: of(normal)?,
            },
            Self::HalfSpace { point, normal } => Obstacle::HalfSpace {
                point: of(point)?,
                normal: of(normal)?,
            },
            Self::Circle { center, radius } => Obstacle::Sphere {
                center: of(center)?,
                radius: *radius,
            },
            Self::Sphere { center, radius } => Obstacle::Sphere {
                center: of(center)?,
                radius: *radius,
            },
            Self::Cylinder {
                point,
                axis,
                radius,
            } => Obstacle::Cylinder {
                point: of(point)?,
                axis: of(axis)?,
                radius: *radius,
            },
        })
    }
}

impl<const D: usize> From<&Obstacle<D>> for Shape {
    fn from(obstacle: &Obstacle<D>) -> Self {
        fn of<const E: usize, const D: usize>(vector: [f64; D]) -> [f64; E] {
            std::array::from_fn(|c| vector[c])
        }
        match *obstacle {
            Obstacle::HalfSpace { point, normal } if D == 2 => Self::HalfPlane {
                point: of(point),
                normal: of(normal),
            },
            Obstacle::HalfSpace { point, normal } => Self::HalfSpace {
                point: of(point),
                normal: of(normal),
            },
            Obstacle::Sphere { center, radius } if D == 2 => Self::Circle {
                center: of(center),
                radius,
            },
            Obstacle::Sphere { center, radius } => Self::Sphere {
                center: of(center),
                radius,
            },
            Obstacle::Cylinder {
                point,
                axis,
                radius,
            } => Self::Cylinder {
                point: of(point),
                axis: of(axis),
                radius,
            },
        }
    }
}

pub(super) fn shape<S: Serializer, const D: usize>(
    obstacle: &Option<Obstacle<D>>,
    to: S,
) -> Result<S::Ok, S::Error> {
    obstacle.as_ref().map(Shape::from).serialize(to)
}

pub(super) fn obstacle<'de, S: Deserializer<'de>, const D: usize>(
    from: S,
) -> Result<Option<Obstacle<D>>, S::Error> {
    let shape = Shape::deserialize(from)?;
    let obstacle = shape.obstacle().ok_or_else(|| {
        let ((name, others), place) = (shape.names(), called(D));
        meaningless(format_args!(
            "{name} is not an obstacle in {place}, where the mesh is: write {others}"
        ))
    });
    obstacle.map(Some)
}
