//! The faults of a model, each with its part.

use crate::contact::ContactError;
use crate::mesh::BoundaryError;
use crate::problem::ProblemError;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A model is inconsistent.
#[derive(Debug, thiserror::Error)]
#[error("{entity}: {fault}")]
pub struct ModelError {
    /// The part of the model at fault.
    pub entity: Entity,
    /// The fault.
    #[source]
    pub fault: Box<Fault>,
}

impl ModelError {
    /// Whether a contact boundary turns back on itself.
    pub(crate) fn is_folded(&self) -> bool {
        matches!(*self.fault, Fault::Contact(ContactError::Folded { .. }))
    }

    /// Whether bodies have been moved so far that a boundary is folded or a stiffness or a load is no number within limits.
    pub(crate) fn is_astray(&self) -> bool {
        use ProblemError::{Diagonal, NotFinite, Size};
        let unfit = |error: &ProblemError| {
            matches!(error, Diagonal { .. } | NotFinite { .. } | Size { .. })
        };
        self.is_folded() || matches!(&*self.fault, Fault::Problem(error) if unfit(error))
    }
}

/// A part of a model, such as `support 2 on "bottom"`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entity {
    /// Its kind.
    pub kind: EntityKind,
    /// Its number among its kind, from 0; None for all of them.
    pub number: Option<usize>,
    /// Its place: `on "bottom"`, `at (0, 1)`; empty without one.
    pub place: String,
    /// The key at fault; empty for the part as a whole.
    pub key: &'static str,
}

/// The parts that models consist of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
pub enum EntityKind {
    /// The model as a whole.
    Model,
    /// A material.
    Material,
    /// A support.
    Support,
    /// An elastic foundation.
    Foundation,
    /// A traction.
    Traction,
    /// A body force.
    BodyForce,
    /// A force on nodes.
    Force,
    /// A temperature.
    Temperature,
    /// A rotation.
    Rotation,
    /// A contact.
    #[default]
    Contact,
    /// A tie.
    Tie,
    /// Nodes that move alike.
    Equal,
    /// A spring.
    Spring,
    /// Preload of bolts.
    Preload,
    /// Nodes that move with a point.
    Coupling,
    /// Sectors.
    Cyclic,
    /// A linear equation.
    Equation,
    /// The thickness.
    Thickness,
    /// Gravity.
    Gravity,
    /// The load steps.
    Steps,
    /// The names of lengths and forces.
    Units,
}

/// The fault of a part of a model.
#[derive(Debug, thiserror::Error)]
pub enum Fault {
    /// The mesh has no such boundary.
    #[error("there is no boundary \"{name}\"{}", boundaries(name, known, *dimension))]
    NoBoundary {
        /// The name that was stated.
        name: String,
        /// The boundaries of the mesh.
        known: Vec<String>,
        /// The dimension of the mesh: 2 or 3.
        dimension: usize,
    },
    /// The mesh has no such region.
    #[error(
        "there is no region \"{name}\"; the mesh has {}{}",
        listed(known),
        meant(name, known)
    )]
    NoRegion {
        /// The name that was stated.
        name: String,
        /// The regions of the mesh and their groups.
        known: Vec<String>,
    },
    /// The mesh has no such set of nodes.
    #[error("there is no set of nodes \"{name}\"{}", node_sets(name, known, *is_boundary))]
    NoNodeSet {
        /// The name that was stated.
        name: String,
        /// The sets of the mesh.
        known: Vec<String>,
        /// Whether there is a boundary of this name.
        is_boundary: bool,
    },
    /// The boundary cannot be used in this way.
    #[error(transparent)]
    Boundary(BoundaryError),
    /// The boundaries do not make a contact.
    #[error(transparent)]
    Contact(ContactError),
    /// The matrices do not make a contact problem.
    #[error(transparent)]
    Problem(ProblemError),
    /// Anything else, in words.
    #[error("{0}")]
    Stated(String),
}

impl Entity {
    /// All parts of a kind, or the only one.
    pub(crate) fn all(kind: EntityKind) -> Self {
        Self {
            kind,
            number: None,
            place: String::new(),
            key: "",
        }
    }

    /// One part of a kind.
    pub(crate) fn one(kind: EntityKind, number: usize, place: String) -> Self {
        Self {
            kind,
            number: Some(number),
            place,
            key: "",
        }
    }

    /// One key of it.
    pub(super) fn at(self, key: &'static str) -> Self {
        Self { key, ..self }
    }

    /// Its path in a case file, such as `support[1].axis`. Without a number, a kind with several entries gives the
    /// first, and materials the last, after which another one could follow.
    #[cfg(feature = "case")]
    pub(crate) fn path(&self) -> String {
        let key = self.kind.words()[0];
        let table = match (self.number, self.kind) {
            (Some(number), _) => format!("{key}[{number}]"),
            (None, EntityKind::Material) => format!("{key}[]"),
            (None, kind) if kind.is_one() => key.to_owned(),
            (None, _) => format!("{key}[0]"),
        };
        match self.key {
            "" => table,
            key => format!("{table}.{key}"),
        }
    }

    /// An error about it.
    pub(crate) fn error(self, fault: impl Into<Fault>) -> ModelError {
        ModelError {
            entity: self,
            fault: Box::new(fault.into()),
        }
    }
}

impl EntityKind {
    /// The key of its table in a case file, and the words for one and several of them.
    pub(crate) fn words(self) -> [&'static str; 3] {
        match self {
            Self::Model => ["mesh", "model", "model"],
            Self::Material => ["material", "material", "materials"],
            Self::Support => ["support", "support", "supports"],
            Self::Foundation => ["foundation", "foundation", "foundations"],
            Self::Traction => ["traction", "traction", "tractions"],
            Self::BodyForce => ["body_force", "body force", "body forces"],
            Self::Force => ["force", "force", "forces"],
            Self::Temperature => ["temperature", "temperature", "temperatures"],
            Self::Rotation => ["analysis.rotation", "rotation", "rotation"],
            Self::Contact => ["contact", "contact", "contacts"],
            Self::Tie => ["tie", "tie", "ties"],
            Self::Equal => ["equal", "equal nodes", "equal nodes"],
            Self::Spring => ["spring", "spring", "springs"],
            Self::Preload => ["preload", "preload", "preloads"],
            Self::Coupling => ["coupling", "coupling", "couplings"],
            Self::Cyclic => ["cyclic", "cyclic symmetry", "cyclic symmetries"],
            Self::Equation => ["equation", "equation", "equations"],
            Self::Thickness => ["analysis.thickness", "thickness", "thickness"],
            Self::Gravity => ["analysis.gravity", "gravity", "gravity"],
            Self::Steps => ["steps", "load steps", "load steps"],
            Self::Units => ["units", "units", "units"],
        }
    }

    /// Whether there is at most one of it.
    #[cfg(feature = "case")]
    fn is_one(self) -> bool {
        let [_, one, several] = self.words();
        one == several && self != Self::Equal
    }
}

impl From<String> for Fault {
    fn from(text: String) -> Self {
        Self::Stated(text)
    }
}

impl From<&str> for Fault {
    fn from(text: &str) -> Self {
        Self::Stated(text.to_owned())
    }
}

impl fmt::Display for Entity {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [_, one, several] = self.kind.words();
        match (self.number, self.place.as_str()) {
            (None, _) => f.write_str(several),
            (Some(number), "") => write!(f, "{one} {}", number + 1),
            (Some(number), place) => write!(f, "{one} {} {place}", number + 1),
        }
    }
}

/// The boundaries that the mesh has instead.
fn boundaries(name: &str, known: &[String], dimension: usize) -> String {
    if known.is_empty() {
        return without_boundaries(name, dimension);
    }
    format!("; the mesh has {}{}", listed(known), meant(name, known))
}

/// The sets of nodes that the mesh has instead.
fn node_sets(name: &str, known: &[String], is_boundary: bool) -> String {
    if is_boundary {
        return ", but a boundary has this name: write boundary instead of nodes".to_owned();
    }
    if known.is_empty() {
        return ": the mesh file has none; in Gmsh add Physical Point(\"…\") = {…}; in an .inp file a *NSET, or hold a point"
            .to_owned();
    }
    format!("; the mesh has {}{}", listed(known), meant(name, known))
}

/// The remedy for a mesh, or a part of one, without any boundary.
pub(crate) fn without_boundaries(name: &str, dimension: usize) -> String {
    let (several, one) = match dimension {
        2 => ("curves", "Curve"),
        _ => ("surfaces", "Surface"),
    };
    format!(
        ": the mesh file has no physical {several}; add Physical {one}(\"{name}\") = {{…}}; in Gmsh and save the mesh \
         again (in an .inp file a *SURFACE or a *NSET, in a .vtu file the cells of the {several})"
    )
}

/// ": did you mean …?", where a name is like a known one.
fn meant(name: &str, known: &[String]) -> String {
    nearest(name, known).map_or(String::new(), |known| {
        format!(": did you mean \"{known}\"?")
    })
}

/// "a", "b" and "c".
pub(super) fn listed<'a>(names: impl IntoIterator<Item = &'a String>) -> String {
    let names = names.into_iter().map(|name| format!("\"{name}\""));
    let names: Vec<String> = names.collect();
    match names.split_last() {
        None => "none".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, rest)) => format!("{} and {last}", rest.join(", ")),
    }
}

/// Names are guessed in programs that read them from files.
#[cfg(not(feature = "case"))]
fn nearest<'a>(_: &str, _: impl IntoIterator<Item = &'a String>) -> Option<&'a String> {
    None
}

/// The known name that a wrong one is most like, if it is like any.
#[cfg(feature = "case")]
pub(crate) fn nearest<'a>(
    wrong: &str,
    known: impl IntoIterator<Item = &'a String>,
) -> Option<&'a String> {
    known
        .into_iter()
        .map(|name| (strsim::damerau_levenshtein(wrong, name), name))
        .min()
        .filter(|&(distance, name)| distance <= 1 + name.len() / 3)
        .map(|(_, name)| name)
}
