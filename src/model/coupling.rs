//! Couplings: nodes that move with a point.
//!
//! A rigid coupling moves its nodes as a rigid body. As many of their displacements as the body has motions are free,
//! those of nodes far apart, and determine the motion of the point. All others follow, each by a row with a free
//! multiplier. A distributing coupling leaves its nodes free. The motion of the point is the rigid motion nearest to
//! theirs, by least squares with the nodes' parts of the area, and loads on the point spread over them in the same
//! proportion.
//!
//! Obstacles of contacts may move with the point as well (`coupled.rs`).

use super::entities::{Facts, Names, Part, Target, by_step, with_a_name};
use super::error::EntityKind;
use super::stated::{self, Flaw};
use crate::rigid;
use serde::{Deserialize, Serialize};

/// The motions of a point of space; in the plane the first two and the last.
pub(super) const MOTIONS: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// Nodes that move with a point, which has a displacement and a rotation. Its motions that are not stated are free.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Coupling<const D: usize = 2> {
    pub(super) name: Option<String>,
    boundary: Option<Names>,
    /// Sets of nodes.
    nodes: Option<Names>,
    /// Contacts with obstacles, by their names: the obstacles move with the point.
    pub(super) contacts: Option<Names>,
    #[serde(
        deserialize_with = "stated::point",
        serialize_with = "<[f64] as Serialize>::serialize"
    )]
    pub(super) point: [f64; D],
    #[serde(default, skip_serializing_if = "stated::is_default")]
    pub(super) kind: Kind,
    /// Directions in which a rigid coupling leaves its nodes free.
    #[serde(
        default = "stated::no_axes",
        deserialize_with = "stated::axes",
        serialize_with = "stated::names_of_axes",
        skip_serializing_if = "stated::is_none"
    )]
    pub(super) free: [bool; D],
    x: Option<f64>,
    y: Option<f64>,
    #[serde(default, deserialize_with = "stated::of_space::<_, D>")]
    z: Option<f64>,
    #[serde(default, deserialize_with = "stated::of_space::<_, D>")]
    rx: Option<f64>,
    #[serde(default, deserialize_with = "stated::of_space::<_, D>")]
    ry: Option<f64>,
    rz: Option<f64>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    force: Option<[f64; D]>,
    #[serde(default, deserialize_with = "stated::one_or_several")]
    moment: Option<Vec<f64>>,
    factors: Option<Vec<f64>>,
}

/// How the nodes of a coupling move.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum Kind {
    /// As a rigid body with the point.
    #[default]
    Rigid,
    /// Freely; the point follows their mean.
    Distributing,
}

with_a_name!(Coupling);

impl<const D: usize> Coupling<D> {
    fn between(boundary: Option<Names>, nodes: Option<Names>, point: [f64; D]) -> Self {
        Self {
            name: None,
            boundary,
            nodes,
            contacts: None,
            point,
            kind: Kind::Rigid,
            free: [false; D],
            x: None,
            y: None,
            z: None,
            rx: None,
            ry: None,
            rz: None,
            force: None,
            moment: None,
            factors: None,
        }
    }

    /// A rigid coupling of the nodes of a boundary, or of several, with a point.
    pub fn on(boundary: impl Into<Names>, point: [f64; D]) -> Self {
        Self::between(Some(boundary.into()), None, point)
    }

    /// A rigid coupling of the nodes of a set, or of several, with a point.
    pub fn at_nodes(sets: impl Into<Names>, point: [f64; D]) -> Self {
        Self::between(None, Some(sets.into()), point)
    }

    /// A rigid body with a point, which consists of the obstacles of these contacts.
    pub fn of_obstacles(contacts: impl Into<Names>, point: [f64; D]) -> Self {
        Self::between(None, None, point).with_obstacles(contacts)
    }

    /// The obstacles of these contacts move with the point, too; contacts are known by their names.
    pub fn with_obstacles(mut self, contacts: impl Into<Names>) -> Self {
        self.contacts = Some(contacts.into());
        self
    }

    /// The nodes move freely; the point follows their mean, and loads on it are spread over them.
    pub fn distributing(mut self) -> Self {
        self.kind = Kind::Distributing;
        self
    }

    /// A rigid coupling leaves its nodes free along these axes.
    pub fn free(mut self, axes: [bool; D]) -> Self {
        self.free = axes;
        self
    }

    /// Holds the point: no displacement, no rotation.
    pub fn fixed(mut self) -> Self {
        for k in 0..rigid::count(D) {
            *self.stated_mut(k) = Some(0.0);
        }
        self
    }

    /// Moves the point along an axis, counted from 0, in m.
    pub fn moved(mut self, axis: usize, by: f64) -> Self {
        assert!(axis < D, "the axes are {D}");
        *self.stated_mut(axis) = Some(by);
        self
    }

    /// Rotates the point about an axis, in rad: 0, 1 and 2 are x, y and z; the plane has the last.
    pub fn turned(mut self, axis: usize, by: f64) -> Self {
        let first = 3 - (rigid::count(D) - D);
        assert!((first..3).contains(&axis), "there is no such rotation");
        *self.stated_mut(D + axis - first) = Some(by);
        self
    }

    /// A force on the point, in N.
    pub fn force(mut self, force: [f64; D]) -> Self {
        self.force = Some(force);
        self
    }

    /// A moment on the point, in N·m: in the plane one number, about z; in space those about x, y and z.
    pub fn moment(mut self, moment: impl Into<Vec<f64>>) -> Self {
        self.moment = Some(moment.into());
        self
    }

    /// Its own load factors, one per step, for its motions and its loads.
    pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.factors = Some(factors.into());
        self
    }

    /// Where its motion k is among those of space.
    pub(super) fn in_space(k: usize) -> usize {
        if k < D {
            k
        } else {
            k + MOTIONS.len() - rigid::count(D)
        }
    }

    fn stated_mut(&mut self, k: usize) -> &mut Option<f64> {
        let all = [
            &mut self.x,
            &mut self.y,
            &mut self.z,
            &mut self.rx,
            &mut self.ry,
            &mut self.rz,
        ];
        let mut all = all.into_iter();
        all.nth(Self::in_space(k)).expect("space has six motions")
    }

    /// With a motion, or a further load, along one of the motions of space.
    #[cfg(feature = "case")]
    pub(crate) fn given(mut self, in_space: usize, size: f64, is_motion: bool) -> Self {
        let k = (0..rigid::count(D)).find(|&k| Self::in_space(k) == in_space);
        let k = k.expect("the dimension has it");
        match k.checked_sub(D) {
            _ if is_motion => *self.stated_mut(k) = Some(size),
            None => self.force.get_or_insert([0.0; D])[k] += size,
            Some(about) => {
                let moment = self
                    .moment
                    .get_or_insert_with(|| vec![0.0; rigid::count(D) - D]);
                moment[about] += size;
            }
        }
        self
    }

    /// Its load factors.
    pub(super) fn load_factors(&self) -> &Option<Vec<f64>> {
        &self.factors
    }

    /// The motion k of the point under the load factor 1: along the axes, then about them; None: free.
    pub(super) fn motion(&self, k: usize) -> Option<f64> {
        [self.x, self.y, self.z, self.rx, self.ry, self.rz][Self::in_space(k)]
    }

    /// The load along motion k under the load factor 1.
    pub(super) fn load(&self, k: usize) -> f64 {
        let (force, moment) = (self.force.as_ref(), self.moment.as_ref());
        match k.checked_sub(D) {
            None => force.map_or(0.0, |force| force[k]),
            Some(about) => moment.map_or(0.0, |moment| moment[about]),
        }
    }

    /// Its nodes of bodies; None of obstacles alone.
    pub(super) fn target(&self) -> Option<Target<'_, D>> {
        Target::of(&self.boundary, &self.nodes, None)
    }

    /// Whether it consists of obstacles alone, which have no nodes.
    pub(super) fn is_bare(&self) -> bool {
        self.target().is_none()
    }

    /// The names of the parts that move with the point, in words.
    pub(super) fn sides(&self) -> String {
        let target = self.target().map(Target::name);
        let obstacles = (self.contacts.as_ref()).map(|names| format!("obstacles of {names}"));
        let all: Vec<String> = target.into_iter().chain(obstacles).collect();
        all.join(", ")
    }
}

impl<const D: usize> Part for Coupling<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Coupling,
            name: self.name.as_deref(),
            place: match (self.target(), &self.contacts) {
                (Some(target), _) => target.place(),
                (None, Some(names)) => format!("of the obstacles of \"{names}\""),
                (None, None) => String::new(),
            },
            factors: by_step([("factors", &self.factors)]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let several = self.boundary.is_some() && self.nodes.is_some();
        let contacts = self.contacts.as_ref().map(|names| names.all().len());
        if several || self.is_bare() && contacts.is_none() {
            return Some("a coupling needs one of boundary and nodes, or contacts".into());
        }
        if let Some(fault) = self.target().and_then(Target::fault) {
            return Some(fault.into());
        }
        if contacts == Some(0) {
            let text = "a list of contacts is empty: name at least one";
            return Some(Flaw::of("contacts", text));
        }
        if contacts.is_some() && (self.kind != Kind::Rigid || self.free != [false; D]) {
            let text = "obstacles are rigid: leave out kind and free beside contacts";
            return Some(Flaw::of("contacts", text));
        }
        let turns = rigid::count(D) - D;
        if let Some(moment) = &self.moment
            && moment.len() != turns
        {
            let text = match D {
                2 => "in the plane a moment is one number, about z",
                _ => "in space a moment has three entries, about x, y and z",
            };
            return Some(Flaw::of("moment", text));
        }
        if !self.point.iter().all(|v| v.is_finite()) {
            return Some(Flaw::of("point", "the point of a coupling must be finite"));
        }
        for k in 0..rigid::count(D) {
            let all = [self.motion(k).unwrap_or(0.0), self.load(k)];
            if !all.iter().all(|v| v.is_finite()) {
                return Some("motions and loads of a coupling must be finite".into());
            }
        }
        if self.kind == Kind::Distributing && self.free != [false; D] {
            let text = "free belongs to a rigid coupling: a distributing one leaves its nodes free";
            return Some(Flaw::of("free", text));
        }
        (self.free == [true; D]).then(|| Flaw::of("free", "free leaves nothing of the coupling"))
    }
}
