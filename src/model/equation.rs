//! Linear equations between displacements of nodes.

use super::contacts::Found;
use super::driven::{Drive, Term, measured};
use super::entities::{AXES, Facts, Names, Part, Target, by_step, in_a_place, with_a_name};
use super::error::{EntityKind, Fault};
use super::stated::{self, Flaw};
use super::{PairData, Units};
use crate::contact::Space;
use crate::elasticity::Body;
use crate::mesh::{ElementKind, Location};
use serde::{Deserialize, Serialize};

/// A sum of displacements of nodes, each with factors along the axes, that has a value.
///
/// A term may be of a set of nodes, or of a boundary. There is an equation for each of its nodes then, in the order of the mesh, and all terms have as
/// many nodes, or one.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Equation<const D: usize = 2> {
    name: Option<String>,
    terms: Vec<Summand<D>>,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    value: f64,
    factors: Option<Vec<f64>>,
}

/// A term of an equation.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { point = [0, 1], x = 1 } or { nodes = \"a\", y = -1 }"
)]
struct Summand<const D: usize> {
    boundary: Option<Names>,
    /// Sets of nodes.
    nodes: Option<Names>,
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    point: Option<[f64; D]>,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    x: f64,
    #[serde(default, skip_serializing_if = "stated::is_default")]
    y: f64,
    #[serde(default, deserialize_with = "stated::of_space::<_, D>")]
    z: Option<f64>,
}

with_a_name!(Equation);
in_a_place!(Summand);

impl<const D: usize> Summand<D> {
    fn along(self, factors: [f64; D]) -> Self {
        Self {
            x: factors[0],
            y: factors[1],
            z: factors.get(2).copied(),
            ..self
        }
    }

    fn factors(&self) -> [f64; D] {
        let all = [self.x, self.y, self.z.unwrap_or(0.0)];
        std::array::from_fn(|axis| all[axis])
    }

    fn told(&self) -> String {
        let parts = self.factors().into_iter().zip(AXES);
        let parts = parts.filter(|(factor, _)| *factor != 0.0);
        let parts: Vec<String> = parts
            .map(|(factor, axis)| format!("{factor} {axis}"))
            .collect();
        format!("({}) of {}", parts.join(" + "), self.target().name())
    }
}

impl<const D: usize> Equation<D> {
    /// Without terms yet; they sum up to this, in m.
    pub fn of(value: f64) -> Self {
        Self {
            value,
            ..Self::default()
        }
    }

    /// A term of the node nearest to a point, with its factors along the axes.
    pub fn point(mut self, point: [f64; D], factors: [f64; D]) -> Self {
        let point = Some(point);
        let term = Summand {
            point,
            ..Summand::default()
        };
        self.terms.push(term.along(factors));
        self
    }

    /// A term of the nodes of a boundary, with its factors along the axes.
    pub fn on(mut self, boundary: impl Into<Names>, factors: [f64; D]) -> Self {
        let boundary = Some(boundary.into());
        let term = Summand {
            boundary,
            ..Summand::default()
        };
        self.terms.push(term.along(factors));
        self
    }

    /// A term of the nodes of a set, with its factors along the axes.
    pub fn nodes(mut self, sets: impl Into<Names>, factors: [f64; D]) -> Self {
        let nodes = Some(sets.into());
        let term = Summand {
            nodes,
            ..Summand::default()
        };
        self.terms.push(term.along(factors));
        self
    }

    /// Its own load factors, one per step, for its value.
    pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.factors = Some(factors.into());
        self
    }

    /// Its load factors.
    pub(super) fn load_factors(&self) -> &Option<Vec<f64>> {
        &self.factors
    }
}

impl<const D: usize> Part for Equation<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Equation,
            name: self.name.as_deref(),
            place: (self.terms.first())
                .and_then(Summand::stated_target)
                .map_or(String::new(), Target::place),
            factors: by_step([("factors", &self.factors)]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        if self.terms.is_empty() {
            let text = "an equation needs terms, such as { nodes = \"a\", x = 1 }";
            return Some(Flaw::of("terms", text));
        }
        for term in &self.terms {
            let Some(target) = term.stated_target() else {
                let text = "a term of an equation needs one of boundary, nodes and point";
                return Some(Flaw::of("terms", text));
            };
            if let Some(fault) = target.fault() {
                return Some(Flaw::of("terms", fault));
            }
            let factors = term.factors();
            if factors == [0.0; D] || !factors.iter().all(|factor| factor.is_finite()) {
                let text = "a term of an equation needs a finite factor other than 0 along an axis";
                return Some(Flaw::of("terms", text));
            }
        }
        let unfit = !self.value.is_finite();
        unfit.then(|| Flaw::of("value", "the value of an equation must be finite"))
    }
}

impl<const D: usize> Equation<D>
where
    ElementKind: Space<D>,
{
    /// Its places, one for each equation.
    pub(super) fn find(&self, body: &Body<D>, units: &Units) -> Result<Found<D>, Fault> {
        let nodes = self
            .terms
            .iter()
            .map(|term| term.target().uncut_nodes(body.mesh));
        let nodes = nodes.collect::<Result<Vec<Vec<u32>>, Fault>>()?;
        let count = nodes.iter().map(Vec::len).max().unwrap_or(0);
        if let Some(odd) = nodes
            .iter()
            .find(|set| set.len() != 1 && set.len() != count)
        {
            return Err(Fault::Stated(format!(
                "its terms have {count} and {} nodes: each term needs the same number of nodes, or one",
                odd.len()
            )));
        }
        let place = |i: usize| {
            // Terms of one node add up.
            let mut sums: Vec<Term<D>> = Vec::new();
            for (set, term) in nodes.iter().zip(&self.terms) {
                let (node, factors) = (set[i % set.len()], term.factors());
                match sums.iter_mut().find(|sum| sum.0 == node) {
                    Some((_, sum)) => (0..D).for_each(|c| sum[c] += factors[c]),
                    None => sums.push((node, factors)),
                }
            }
            sums.retain(|(_, factors)| factors.iter().any(|&factor| factor != 0.0));
            let Some(&(own, _)) = sums.first() else {
                let x = Location::from(body.mesh.nodes[nodes[0][i % nodes[0].len()] as usize]);
                return Err(Fault::Stated(format!(
                    "its terms at the node at {x} cancel out: nothing is left of the equation"
                )));
            };
            let at = (body.mesh.nodes[own as usize], i as u32);
            // Any direction: it carries the multiplier.
            let mut frame = [[0.0; D]; D];
            frame[0][0] = 1.0;
            Ok(measured(at, own, frame, sums))
        };
        let places = (0..count).map(place).collect::<Result<Vec<_>, Fault>>()?;
        let told: Vec<String> = self.terms.iter().map(Summand::told).collect();
        let data = PairData {
            tied: true,
            drives: vec![Drive::moved(self.value); count],
            ..PairData::between(
                EntityKind::Equation,
                &self.name,
                told.join(" + "),
                format!("{}{}", self.value, Units::behind(&units.length)),
                match count {
                    1 => "one equation".to_owned(),
                    _ => format!("{count} equations"),
                },
            )
        };
        Ok((places, data))
    }
}
