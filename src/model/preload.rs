//! Preload of bolts: a section through the body whose ends are pulled towards each other.
//!
//! The body is cut along facets of the mesh. Its sides keep together in all but one way: they may overlap, all nodes by
//! the same length along the normal of the section. A row of its own measures that length, the mean by area. Either a
//! load step states the force, as loads on both sides, and the row does not act. Or it states the length, and the
//! multiplier of the row is the force.

use super::driven::Drive;
use super::entities::{Facts, NO_BOUNDARY, Names, Part, by_step, with_a_name};
use super::error::{EntityKind, Fault, listed};
use super::loads::{area_shares, known, region};
use super::stated::{self, Flaw};
use super::supports::NEAR;
use super::{Definition, PairData, Units};
use crate::contact::{ContactPlace, SlipBound, Space, frame, mean};
use crate::elasticity::Body;
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{Between, Cut, Element, ElementKind, Facet, Location, Mesh, unsided};
use serde::{Deserialize, Serialize};
use std::collections::{HashMap, HashSet};

/// A facet has no side if the part of its normal along the mean normal of its section is below this. The facet is then
/// within 6 degrees of the direction of the bolt.
const ACROSS: f64 = 0.1;

/// A bolt that is tightened: where it is cut, and the force in it or its shortening.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Preload<const D: usize = 2> {
    name: Option<String>,
    /// Within the body.
    boundary: Option<Names>,
    /// None: all of them.
    region: Option<Names>,
    plane: Option<Plane<D>>,
    /// Of any length; None: the normal of the section.
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    direction: Option<[f64; D]>,
    force: Option<f64>,
    shortening: Option<f64>,
    factors: Option<Vec<f64>>,
    lock: Option<Lock>,
}

/// When a preload by force becomes one by the shortening that the force has made.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(
    untagged,
    expecting = "expected true, false, or a list with 0 or 1 for each load step"
)]
enum Lock {
    /// If so, after the first step with the largest force.
    After(bool),
    /// In the steps that have 1.
    In(Vec<f64>),
}

/// A plane that cuts bodies.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { point = [0, 0], normal = [0, 1] }"
)]
struct Plane<const D: usize> {
    #[serde(
        deserialize_with = "stated::point",
        serialize_with = "<[f64] as Serialize>::serialize"
    )]
    point: [f64; D],
    /// Of any length.
    #[serde(
        deserialize_with = "stated::point",
        serialize_with = "<[f64] as Serialize>::serialize"
    )]
    normal: [f64; D],
}

/// The section of a preload in the mesh.
#[derive(Clone, Debug)]
pub(crate) struct Section<const D: usize> {
    /// From the side that has kept its nodes towards the other one.
    normal: [f64; D],
    /// The nodes of the sides, each with its part of the area.
    sides: Vec<([u32; 2], f64)>,
    area: f64,
}

with_a_name!(Preload);

impl<const D: usize> Preload<D> {
    /// On a named surface within the body that cuts it through.
    pub fn on(boundary: impl Into<Names>) -> Self {
        Self {
            boundary: Some(boundary.into()),
            ..Self::default()
        }
    }

    /// On facets of the mesh near a plane: of the sections that it makes, the one nearest to the point. The normal has any length.
    pub fn across(point: [f64; D], normal: [f64; D]) -> Self {
        Self {
            plane: Some(Plane { point, normal }),
            ..Self::default()
        }
    }

    /// Cuts only these regions.
    pub fn within(mut self, regions: impl Into<Names>) -> Self {
        self.region = Some(regions.into());
        self
    }

    /// The direction of the bolt, where the mean normal of its section is another one; of any length and either sign.
    pub fn along(mut self, direction: [f64; D]) -> Self {
        self.direction = Some(direction);
        self
    }

    /// The tension in the section, in N.
    pub fn force(mut self, force: f64) -> Self {
        self.force = Some(force);
        self
    }

    /// By how much the ends at the section overlap, in m.
    pub fn shortening(mut self, length: f64) -> Self {
        self.shortening = Some(length);
        self
    }

    /// Its own load factors, one per step.
    pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.factors = Some(factors.into());
        self
    }

    /// After the first step with the largest force, the section stays as short as it is then.
    pub fn locked(mut self) -> Self {
        self.lock = Some(Lock::After(true));
        self
    }

    /// The section is locked in the load steps that have 1, not in those that have 0; the first must have 0.
    pub fn locked_in(mut self, steps: impl Into<Vec<f64>>) -> Self {
        self.lock = Some(Lock::In(steps.into()));
        self
    }

    /// Its load factors.
    pub(super) fn load_factors(&self) -> &Option<Vec<f64>> {
        &self.factors
    }

    /// Whether it is locked in a load step, counted from 0; the force is largest first in the step `tightened`.
    fn locks(&self, step: usize, tightened: usize) -> bool {
        match &self.lock {
            None => false,
            Some(Lock::After(lock)) => *lock && step > tightened,
            Some(Lock::In(steps)) => steps[step] != 0.0,
        }
    }
}

impl<const D: usize> Part for Preload<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Preload,
            name: self.name.as_deref(),
            place: match (&self.boundary, &self.region) {
                (Some(names), _) => format!("on \"{names}\""),
                (None, Some(names)) => format!("in \"{names}\""),
                (None, None) => String::new(),
            },
            factors: {
                let mut all = by_step([("factors", &self.factors)]);
                if let Some(Lock::In(steps)) = &self.lock {
                    all.push(("lock", steps));
                }
                all
            },
        }
    }

    fn fault(&self) -> Option<Flaw> {
        if let Some(Lock::In(steps)) = &self.lock
            && (steps.first() != Some(&0.0) || steps.iter().any(|&v| v != 0.0 && v != 1.0))
        {
            let text = "lock has 0 or 1 for each load step, and 0 for the first: a force comes before what it locks";
            return Some(Flaw::of("lock", text));
        }
        match (&self.boundary, &self.plane) {
            (Some(names), None) if names.all().is_empty() => return Some(NO_BOUNDARY.into()),
            (Some(_), None) if self.region.is_some() => {
                let text =
                    "a region belongs to a plane: a boundary says itself where the section is";
                return Some(Flaw::of("region", text));
            }
            (None, Some(plane)) => {
                let size = length(plane.normal);
                if !(size > 0.0 && size.is_finite() && plane.point.iter().all(|v| v.is_finite())) {
                    let text = "the plane needs a finite point and a normal that is not zero";
                    return Some(Flaw::of("plane", text));
                }
            }
            (Some(_), None) => {}
            _ => {
                return Some(
                    "a preload needs a section: boundary, a surface within the body, or plane = { point = …, normal = … }"
                        .into(),
                );
            }
        }
        if let Some(way) = self.direction
            && !(length(way) > 0.0 && length(way).is_finite())
        {
            let text = "the direction of a preload must be finite and not zero";
            return Some(Flaw::of("direction", text));
        }
        match (self.force, self.shortening) {
            (Some(force), None) if !force.is_finite() => {
                Some(Flaw::of("force", "the force of a preload must be finite"))
            }
            (None, Some(length)) if !length.is_finite() => Some(Flaw::of(
                "shortening",
                "the shortening of a preload must be finite",
            )),
            (None, Some(_)) if self.lock.is_some() => {
                let text = "lock belongs to a force: a shortening is held in any case";
                Some(Flaw::of("lock", text))
            }
            (Some(_), None) | (None, Some(_)) => None,
            _ => Some("a preload needs one of force and shortening".into()),
        }
    }
}

impl<const D: usize> Preload<D>
where
    ElementKind: Space<D>,
{
    /// Cuts the mesh along its section; the normal points to the side with new nodes.
    pub(super) fn cut(&self, mesh: &mut Mesh<D>) -> Result<(Cut<D>, [f64; D]), Fault> {
        let (along, normal) = match (&self.boundary, &self.plane) {
            (Some(names), _) => named(mesh, names)?,
            (None, Some(plane)) => (self.nearest(mesh, plane)?, unit(plane.normal)),
            (None, None) => unreachable!("checked: it has a section"),
        };
        let normal = match self.direction.map(unit) {
            None => normal,
            Some(way) if dot(way, normal) > ACROSS => way,
            Some(way) if dot(way, normal) < -ACROSS => way.map(|v| -v),
            Some(_) => {
                return Err(Fault::Stated(
                    "its direction lies in the section: a bolt is pulled across it".to_owned(),
                ));
            }
        };
        let cut = mesh.cut(&along).map_err(|place| {
            Fault::Stated(format!(
                "the section ends within the body, at {place}: it must cut the bolt through"
            ))
        })?;
        Ok((cut, normal))
    }

    /// The section nearest to the point of a plane.
    fn nearest(&self, mesh: &Mesh<D>, plane: &Plane<D>) -> Result<Vec<Between<D>>, Fault> {
        let (low, high) = mesh.bounding_box();
        let nearest: [f64; D] = std::array::from_fn(|c| plane.point[c].clamp(low[c], high[c]));
        let far = length(minus(plane.point, nearest));
        if far > NEAR * length(minus(high, low)) {
            return Err(Fault::Stated(format!(
                "the point of its plane, {}, is {far:.3e} outside of the box around the bodies: move it into the bolt",
                Location::from(plane.point)
            )));
        }
        let mut wanted: Option<HashSet<u32>> = None;
        for name in self.region.iter().flat_map(Names::all) {
            let set = wanted.get_or_insert_default();
            set.extend(region(mesh, name)?);
        }
        let is_in = |element: &Element<D>, _: &Facet<D>| {
            (wanted.as_ref()).is_none_or(|wanted| wanted.contains(&element.region))
        };
        let in_front = |element: &Element<D>, _: &Facet<D>| {
            let nodes = element.linear();
            let height =
                |node: &u32| dot(minus(mesh.nodes[*node as usize], plane.point), plane.normal);
            nodes.nodes().iter().map(height).sum::<f64>() > 0.0
        };
        let away = |part: &Vec<Between<D>>| {
            let places = part.iter().map(|one| mesh.facet_middle(&one.facet));
            places
                .map(|x| length(minus(x, plane.point)))
                .fold(f64::INFINITY, f64::min)
        };
        let parts = Between::parts(&mesh.between(is_in, in_front));
        let best = parts.into_iter().min_by(|a, b| away(a).total_cmp(&away(b)));
        best.ok_or_else(|| {
            let names = self.region.as_ref().map_or(String::new(), |names| {
                format!(" of {}", listed(names.all()))
            });
            Fault::Stated(format!(
                "no elements{names} are on both sides of the plane: move its point into the bolt, and state one preload for a section"
            ))
        })
    }

    /// Its places: first the row that measures the shortening. The sides keep together in all other rows.
    pub(super) fn find(
        &self,
        mesh: &Mesh<D>,
        section: &Section<D>,
        units: &Units,
    ) -> (Vec<ContactPlace<D>>, PairData<D>) {
        let (normal, sides) = (section.normal, &section.sides);
        let [own, partners] = [0, 1].map(|side: usize| {
            let shares = sides.iter().filter(|(_, share)| *share != 0.0);
            shares
                .map(|(pair, share)| (pair[side], *share))
                .collect::<Vec<_>>()
        });
        let place = ContactPlace {
            place: mean(&own, |node| mesh.nodes[node as usize]),
            node: None,
            own,
            partners,
            directed: Vec::new(),
            further: Vec::new(),
            sectors: None,
            frame: std::array::from_fn(|a| if a == 0 { normal } else { [0.0; D] }),
            gap: 0.0,
            area: section.area,
            part: 0,
            pool: 0,
            slip_bound: SlipBound::Tied,
            compliance: [0.0; 2],
        };
        let directions = frame(normal);
        let ([first, opposite], _) = sides[0];
        let mut places = vec![place.clone()];
        for &([node, other], _) in sides {
            let sides = || [vec![(node, 1.0)], vec![(other, 1.0)]];
            // All overlap by as much as the first.
            let (frame, directed) = if node == first {
                let across =
                    std::array::from_fn(|a| directions.get(a + 1).copied().unwrap_or([0.0; D]));
                (across, Vec::new())
            } else {
                let alike = [
                    vec![(node, 1.0), (opposite, 1.0)],
                    vec![(other, 1.0), (first, 1.0)],
                ];
                let across = (1..D).map(|_| sides());
                (directions, std::iter::once(alike).chain(across).collect())
            };
            let [own, partners] = sides();
            places.push(ContactPlace {
                place: mesh.nodes[node as usize],
                node: Some(node),
                own,
                partners,
                directed,
                frame,
                area: 1.0,
                pool: places.len() as u32,
                ..place.clone()
            });
        }
        let what = match (self.force, self.shortening) {
            (Some(force), _) => format!("force {force}{}", Units::behind(&units.force)),
            (None, length) => format!(
                "shortening {}{}",
                length.unwrap_or(0.0),
                Units::behind(&units.length)
            ),
        };
        let what = match self.lock {
            None | Some(Lock::After(false)) => what,
            _ => format!("{what}, then locked"),
        };
        let data = PairData {
            tied: true,
            drives: vec![Drive {
                motion: None,
                ..Drive::moved(0.0)
            }],
            ..PairData::between(
                EntityKind::Preload,
                &self.name,
                match (&self.boundary, &self.region) {
                    (Some(names), _) | (None, Some(names)) => names.to_string(),
                    (None, None) => "section".to_owned(),
                },
                format!("itself along {}", Location::from(normal)),
                what,
            )
        };
        (places, data)
    }
}

impl<const D: usize> Preload<D> {
    /// At a time, where 1 is the end of the first load step: the stated shortening, if it is one; the stated force otherwise; and whether
    /// the section is locked, which leaves out both.
    pub(super) fn state(&self, of: &Definition<D>, time: f64) -> (Option<f64>, f64, bool) {
        let factor = |time| of.factor(&self.factors, time);
        if let Some(length) = self.shortening {
            return (Some(factor(time) * length), 0.0, false);
        }
        let force = |time| factor(time) * self.force.unwrap_or(0.0);
        let at_end = |step: usize| force(super::loads::end_of(step)).abs();
        let largest = (0..of.n_steps()).fold(0.0_f64, |most, step| most.max(at_end(step)));
        let tightened = (0..of.n_steps()).find(|&step| at_end(step) == largest);
        match self.locks(super::loads::step_of(time), tightened.unwrap_or(0)) {
            true => (None, 0.0, true),
            false => (None, force(time), false),
        }
    }
}

impl<const D: usize> Section<D> {
    /// From a cut and its normal.
    pub(super) fn new(body: &Body<D>, (cut, normal): (Cut<D>, [f64; D])) -> Self
    where
        ElementKind: Space<D>,
    {
        let (shares, area) = area_shares(body, &cut.facets);
        let shares: HashMap<u32, f64> = shares.into_iter().collect();
        let sides = cut.nodes.into_iter();
        let sides = sides.map(|pair| (pair, shares.get(&pair[0]).copied().unwrap_or(0.0)));
        Self {
            normal,
            sides: sides.collect(),
            area,
        }
    }

    /// The nodes of both sides, all alike.
    pub(super) fn nodes(&self) -> Vec<(u32, f64)> {
        let nodes = self.sides.iter().flat_map(|(pair, _)| *pair);
        nodes.map(|node| (node, 1.0)).collect()
    }

    /// Adds the forces of a tension on both sides.
    pub(super) fn pull(&self, tension: f64, forces: &mut [[f64; D]]) {
        for (pair, share) in &self.sides {
            for (&node, sign) in pair.iter().zip([1.0, -1.0]) {
                let force = sign * share * tension;
                (0..D).for_each(|c| forces[node as usize][c] += force * self.normal[c]);
            }
        }
    }
}

/// The facets of named surfaces within the body, and their mean normal.
fn named<const D: usize>(
    mesh: &Mesh<D>,
    names: &Names,
) -> Result<(Vec<Between<D>>, [f64; D]), Fault>
where
    ElementKind: Space<D>,
{
    let mut all: Vec<Facet<D>> = Vec::new();
    for name in names.all() {
        all.extend(known(mesh, mesh.facets(name))?);
    }
    let mut normal: [f64; D] = [0.0; D];
    for facet in &all {
        let (area, n) = mesh.facet_normal(facet);
        // From either side.
        let sign = if dot(n, normal) < 0.0 { -area } else { area };
        (0..D).for_each(|c| normal[c] += sign * n[c]);
    }
    let normal = unit(normal);
    let steep = |facet: &Facet<D>| {
        let (_, n) = mesh.facet_normal(facet);
        dot(n, normal)
    };
    if let Some(facet) = all.iter().find(|facet| !(steep(facet).abs() > ACROSS)) {
        return Err(Fault::Stated(format!(
            "the surface is no section of a bolt: its part at {} is nearly along the mean normal",
            Location::from(mesh.facet_middle(facet))
        )));
    }
    let wanted: HashSet<[u32; 4]> = all.iter().map(unsided).collect();
    let along = mesh.between(
        |_, facet| wanted.contains(&unsided(facet)),
        |_, facet| steep(facet) < 0.0,
    );
    if along.len() < wanted.len() {
        return Err(Fault::Stated(
            "the surface is not within the body: a preload needs a section with elements on both sides"
                .to_owned(),
        ));
    }
    match Between::parts(&along).len() {
        1 => Ok((along, normal)),
        several => Err(Fault::Stated(format!(
            "the surface has {several} parts that do not touch: state a preload for each bolt"
        ))),
    }
}
