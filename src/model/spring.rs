//! Springs of a model: rows that are tied, but give way.
//!
//! The force of a spring is a free multiplier λ of the row for the approach of its ends, N u = λ/k. So K does not
//! change, a body that springs alone hold is one whose forces are in balance like any other, and a set of nodes costs
//! one row.

use super::entities::{Facts, Names, Part, Target, in_a_place, with_a_name};
use super::error::{EntityKind, Fault};
use super::loads::{area_shares, outer_facets};
use super::stated::{self, Flaw};
use super::{PairData, Units};
use crate::contact::{ContactPlace, SlipBound, Space, mean};
use crate::elasticity::Body;
use crate::mesh::vector::{length, minus, unit};
use crate::mesh::{ElementKind, Location};
use crate::problem::{SIZES, is_sized};
use serde::{Deserialize, Serialize};

/// A linear spring from a place of a body to another place, or to the ground. The place is the node nearest to a point, or the mean of
/// a set of nodes or of a boundary (by area), over which the force is spread alike.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Spring<const D: usize = 2> {
    name: Option<String>,
    boundary: Option<Names>,
    /// Sets of nodes.
    nodes: Option<Names>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    point: Option<[f64; D]>,
    /// None: the ground.
    to: Option<End<D>>,
    stiffness: f64,
    /// Of any length; None: from end to end.
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    direction: Option<[f64; D]>,
}

/// The other end of a spring.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { point = [1, 2] }, { nodes = \"a\" } or { boundary = \"b\" }"
)]
struct End<const D: usize> {
    boundary: Option<Names>,
    nodes: Option<Names>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    point: Option<[f64; D]>,
}

with_a_name!(Spring);
in_a_place!(Spring);
in_a_place!(End);

impl<const D: usize> Spring<D> {
    /// At the node nearest to a point, with this force over its change of length, in N/m.
    pub fn at_point(point: [f64; D], stiffness: f64) -> Self {
        Self {
            point: Some(point),
            stiffness,
            ..Self::default()
        }
    }

    /// At the mean of the nodes of a set, or of several.
    pub fn at_nodes(sets: impl Into<Names>, stiffness: f64) -> Self {
        Self {
            nodes: Some(sets.into()),
            stiffness,
            ..Self::default()
        }
    }

    /// On a boundary, or on several, as their mean by area.
    pub fn on(boundary: impl Into<Names>, stiffness: f64) -> Self {
        Self {
            boundary: Some(boundary.into()),
            stiffness,
            ..Self::default()
        }
    }

    /// To the node nearest to a point.
    pub fn to_point(mut self, point: [f64; D]) -> Self {
        self.to = Some(End {
            point: Some(point),
            ..End::default()
        });
        self
    }

    /// To the mean of the nodes of a set, or of several.
    pub fn to_nodes(mut self, sets: impl Into<Names>) -> Self {
        self.to = Some(End {
            nodes: Some(sets.into()),
            ..End::default()
        });
        self
    }

    /// To a boundary, or to several, as their mean by area.
    pub fn to(mut self, boundary: impl Into<Names>) -> Self {
        self.to = Some(End {
            boundary: Some(boundary.into()),
            ..End::default()
        });
        self
    }

    /// Which way it acts, in place of the line between its ends; of any length.
    pub fn along(mut self, direction: [f64; D]) -> Self {
        self.direction = Some(direction);
        self
    }

    /// Whether it acts along the line between its ends.
    pub(super) fn has_line(&self) -> bool {
        self.direction.is_none()
    }

    /// Its ends, in words, once they are checked.
    fn ends(&self) -> [String; 2] {
        let to = self.to.as_ref();
        [
            self.target().name(),
            to.map_or("the ground".to_owned(), |to| to.target().name()),
        ]
    }

    fn told_stiffness(&self, units: &Units) -> String {
        let unit = match (&units.force, &units.length) {
            (force, length) if force.is_empty() || length.is_empty() => String::new(),
            (force, length) => format!(" {force}/{length}"),
        };
        format!("{}{unit}", self.stiffness)
    }
}

impl<const D: usize> Part for Spring<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Spring,
            name: self.name.as_deref(),
            place: self.stated_target().map_or(String::new(), Target::place),
            factors: Vec::new(),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let Some(target) = self.stated_target() else {
            return Some("a spring needs one of boundary, nodes and point".into());
        };
        let to = match &self.to {
            None => None,
            Some(to) => match to.stated_target() {
                None => {
                    let text = "the other end of a spring is one of boundary, nodes and point";
                    return Some(Flaw::of("to", text));
                }
                to => to,
            },
        };
        if let Some(fault) = target.fault().or(to.and_then(Target::fault)) {
            return Some(fault.into());
        }
        let k = self.stiffness;
        let is_direction = |way: [f64; D]| length(way) > 0.0 && length(way).is_finite();
        if !(k > 0.0 && k.is_finite()) {
            let text = format!("the stiffness of the spring is {k}: it must be above 0");
            return Some(Flaw::of("stiffness", text));
        }
        if !is_sized(k) {
            let text = format!("the stiffness of the spring is {k:e}: {SIZES}");
            return Some(Flaw::of("stiffness", text));
        }
        match self.direction {
            Some(way) if !is_direction(way) => Some(Flaw::of(
                "direction",
                "the direction of a spring must be finite and not zero",
            )),
            None if to.is_none() => Some(
                "a spring to the ground needs a direction: direction = [0, 1], say; or state its other end (to = { point = … })"
                    .into(),
            ),
            _ => None,
        }
    }
}

impl<const D: usize> Spring<D>
where
    ElementKind: Space<D>,
{
    /// The nodes of an end with their parts of it.
    fn shares(body: &Body<D>, target: Target<D>) -> Result<Vec<(u32, f64)>, Fault> {
        let names = match target {
            Target::Boundary(names) => names,
            Target::Point(_) | Target::Nodes(_) => {
                let nodes = target.uncut_nodes(body.mesh)?;
                let share = (nodes.len() as f64).recip();
                return Ok(nodes.into_iter().map(|node| (node, share)).collect());
            }
        };
        Ok(area_shares(body, &outer_facets(body.mesh, names.all())?).0)
    }

    /// Its place and its known data: ν points from the first end to the other one.
    pub(super) fn find(
        &self,
        body: &Body<D>,
        units: &Units,
    ) -> Result<(Vec<ContactPlace<D>>, PairData<D>), Fault> {
        let own = Self::shares(body, self.target())?;
        let partners = match &self.to {
            Some(to) => Self::shares(body, to.target())?,
            None => Vec::new(),
        };
        if own == partners {
            let text =
                "both ends of the spring are the same nodes, so that it has no force: move one end";
            return Err(Fault::Stated(text.to_owned()));
        }
        let middle = |nodes: &[(u32, f64)]| mean(nodes, |node| body.mesh.nodes[node as usize]);
        let place = middle(&own);
        let way = self
            .direction
            .unwrap_or_else(|| minus(middle(&partners), place));
        let (low, high) = body.mesh.bounding_box();
        if self.direction.is_none() && !(length(way) > 1e-9 * length(minus(high, low))) {
            return Err(Fault::Stated(
                "both ends of the spring are in the same place, so that it has no line: state its direction"
                    .to_owned(),
            ));
        }
        let mut frame = [[0.0; D]; D];
        frame[0] = unit(way);
        let [boundary, against] = self.ends();
        let way = format!("spring along {}", Location::from(frame[0]));
        let data = PairData {
            tied: true,
            stiffness: Some(self.told_stiffness(units)),
            ..PairData::between(EntityKind::Spring, &self.name, boundary, against, way)
        };
        let place = ContactPlace {
            place,
            node: match own[..] {
                [(node, _)] => Some(node),
                _ => None,
            },
            own,
            partners,
            directed: Vec::new(),
            further: Vec::new(),
            sectors: None,
            frame,
            gap: 0.0,
            area: 1.0,
            part: 0,
            pool: 0,
            slip_bound: SlipBound::Tied,
            compliance: [self.stiffness.recip(), 0.0],
        };
        Ok((vec![place], data))
    }
}
