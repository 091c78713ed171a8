//! Couplings: nodes that move with a point.
//!
//! A rigid coupling moves its nodes as a rigid body. As many of their displacements as the body has motions are free, those of nodes
//! far apart, and determine the motion of the point; all others follow, each by a row with a free multiplier. A distributing coupling
//! leaves its nodes free: the motion of the point is the rigid motion nearest to theirs, by least squares with the nodes' parts of the
//! area, and loads on the point spread over them in the same proportion.

use super::driven::Drive;
use super::entities::{Facts, Names, Part, Target, by_step, with_a_name};
use super::error::{EntityKind, Fault};
use super::loads::{area_shares, outer_facets};
use super::stated::{self, Flaw};
use super::supports::Way;
use super::{PairData, Units};
use crate::contact::{ContactPlace, SlipBound, Space};
use crate::dense::pseudo_inverse;
use crate::elasticity::{Body, Plane};
use crate::mesh::vector::{length, minus};
use crate::mesh::{ElementKind, Location};
use crate::rigid::{self, Frame};
use faer::Mat;
use serde::{Deserialize, Serialize};

/// A displacement is independent of others if this part of its length is left without them: files have six digits at least.
const INDEPENDENT: f64 = 1e-5;
/// Parts of other displacements below this are rounding: displacements far apart lead, so that the largest parts are about one.
const ROUNDING_OF_P: f64 = 1e-13;
/// The motions of a point of space; in the plane the first two and the last.
const MOTIONS: [&str; 6] = ["x", "y", "z", "rx", "ry", "rz"];

/// Nodes that move with a point, which has a displacement and a rotation. Its motions that are not stated are free.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Coupling<const D: usize = 2> {
    name: Option<String>,
    boundary: Option<Names>,
    /// Sets of nodes.
    nodes: Option<Names>,
    #[serde(
        deserialize_with = "stated::point",
        serialize_with = "<[f64] as Serialize>::serialize"
    )]
    point: [f64; D],
    #[serde(default, skip_serializing_if = "stated::is_default")]
    kind: Kind,
    /// Directions in which a rigid coupling leaves its nodes free.
    #[serde(
        default = "stated::no_axes",
        deserialize_with = "stated::axes",
        serialize_with = "stated::names_of_axes",
        skip_serializing_if = "stated::is_none"
    )]
    free: [bool; D],
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
enum Kind {
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

    /// Rotates the point about an axis, in rad: 0, 1 and 2 are x, y and z, of which the plane has the last.
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
    fn in_space(k: usize) -> usize {
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

    fn stated_target(&self) -> Option<Target<'_, D>> {
        Target::of(&self.boundary, &self.nodes, None)
    }

    fn target(&self) -> Target<'_, D> {
        self.stated_target().expect("checked: it has nodes")
    }
}

impl<const D: usize> Part for Coupling<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Coupling,
            name: self.name.as_deref(),
            place: self.stated_target().map_or(String::new(), Target::place),
            factors: by_step([("factors", &self.factors)]),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        let Some(target) = self.stated_target() else {
            return Some("a coupling needs one of boundary and nodes".into());
        };
        if let Some(fault) = target.fault() {
            return Some(fault.into());
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

/// The displacement of a node along a direction, times a factor.
type Term<const D: usize> = (u32, [f64; D]);

/// The rigid motions that a point has.
struct Motions<'m, const D: usize> {
    places: &'m [[f64; D]],
    frame: Frame<D>,
    /// Their numbers.
    ways: Vec<usize>,
}

impl<const D: usize> Motions<'_, D> {
    /// Along each axis, what they are at a node.
    fn at(&self, node: u32) -> [Vec<f64>; D] {
        let all = self
            .frame
            .motions::<{ MOTIONS.len() }>(&self.places[node as usize]);
        all.map(|row| self.ways.iter().map(|&k| row[k]).collect())
    }
}

/// How nodes determine motions, and follow them.
struct Determined<const D: usize> {
    /// Each motion in displacements of nodes.
    terms: Vec<Vec<Term<D>>>,
    /// The row of a motion that the nodes determine is that of the identity.
    known: Mat<f64>,
    /// The displacements that follow others: node, axis, and those others with the opposite sign.
    follow: Vec<(u32, usize, Vec<Term<D>>)>,
}

impl<const D: usize> Determined<D> {
    /// Of nodes that move as a rigid body along the axes that are not `free`.
    fn rigid(nodes: &[u32], motions: &Motions<D>, free: [bool; D]) -> Self {
        let count = motions.ways.len();
        let bound: Vec<usize> = (0..D).filter(|&c| !free[c]).collect();
        let all: Vec<(u32, usize, Vec<f64>)> = (nodes.iter())
            .flat_map(|&node| {
                let at = motions.at(node);
                let of_axis = move |&c: &usize| (node, c, at[c].clone());
                bound.iter().map(of_axis)
            })
            .collect();
        let lead = independent(&all, count);
        let p = Mat::from_fn(lead.len(), count, |r, k| all[lead[r]].2[k]);
        let inverse = p.transpose() * pseudo_inverse(&(&p * p.transpose()), ROUNDING_OF_P);
        let term = |i: usize, factor: f64| -> Term<D> {
            let (node, c, _) = all[i];
            (node, Way::<D>::Axis(c).vector().map(|v| factor * v))
        };
        let of_leads = |part: &dyn Fn(usize) -> f64| -> Vec<Term<D>> {
            let parts = lead.iter().enumerate().map(|(r, &i)| (i, part(r)));
            let parts = parts.filter(|(_, part)| part.abs() > ROUNDING_OF_P);
            parts.map(|(i, part)| term(i, part)).collect()
        };
        let follows = all.iter().enumerate().filter(|(i, _)| !lead.contains(i));
        Self {
            terms: (0..count).map(|k| of_leads(&|r| inverse[(k, r)])).collect(),
            follow: follows
                .map(|(_, (node, c, at))| {
                    let part = |r| -(0..count).map(|k| at[k] * inverse[(k, r)]).sum::<f64>();
                    (*node, *c, of_leads(&part))
                })
                .collect(),
            known: &inverse * &p,
        }
    }

    /// Of nodes that move freely, each with its share.
    fn distributing(shares: &[(u32, f64)], motions: &Motions<D>) -> Self {
        let count = motions.ways.len();
        let mut m = Mat::<f64>::zeros(count, count);
        for &(node, share) in shares {
            for row in motions.at(node) {
                for (i, a) in row.iter().enumerate() {
                    for (j, b) in row.iter().enumerate() {
                        m[(i, j)] += share * a * b;
                    }
                }
            }
        }
        let inverse = pseudo_inverse(&m, INDEPENDENT * INDEPENDENT);
        let of_motion = |k: usize| {
            let term = |&(node, share): &(u32, f64)| {
                let part = motions.at(node).map(|row| {
                    let parts = row.iter().enumerate();
                    share * parts.map(|(l, v)| inverse[(k, l)] * v).sum::<f64>()
                });
                (node, part)
            };
            shares.iter().map(term).collect()
        };
        Self {
            terms: (0..count).map(of_motion).collect(),
            known: &inverse * &m,
            follow: Vec::new(),
        }
    }

    /// Whether the nodes determine a motion.
    fn is_known(&self, k: usize) -> bool {
        (0..self.terms.len()).all(|l| {
            let off = self.known[(k, l)] - f64::from(u8::from(k == l));
            off.abs() < INDEPENDENT
        })
    }
}

/// A coupling on a mesh.
struct Coupled<const D: usize> {
    nodes: Vec<u32>,
    /// The motions that the nodes determine.
    drives: Vec<Drive>,
    /// What each is, in displacements of nodes.
    motions: Vec<Vec<Term<D>>>,
    /// As [`Determined::follow`].
    follow: Vec<(u32, usize, Vec<Term<D>>)>,
}

impl<const D: usize> Coupling<D>
where
    ElementKind: Space<D>,
{
    fn on_mesh(&self, body: &Body<D>) -> Result<Coupled<D>, Fault> {
        let (mesh, target) = (body.mesh, self.target());
        let nodes = target.nodes(mesh)?;
        let away = |&node: &u32| length(minus(mesh.nodes[node as usize], self.point));
        let frame = Frame {
            centre: self.point,
            size: match nodes.iter().map(away).fold(0.0, f64::max) {
                0.0 => 1.0,
                size => size,
            },
        };
        let motions = Motions {
            places: &mesh.nodes,
            frame,
            // A ring moves along its axis.
            ways: match body.plane {
                Plane::Axisymmetric if D == 2 => vec![1],
                _ => (0..rigid::count(D)).collect(),
            },
        };
        let found = match (self.kind, target) {
            (Kind::Rigid, _) => Determined::rigid(&nodes, &motions, self.free),
            (Kind::Distributing, Target::Boundary(names)) => {
                let (shares, _) = area_shares(body, &outer_facets(mesh, names.all())?);
                Determined::distributing(&shares, &motions)
            }
            (Kind::Distributing, _) => {
                let share = (nodes.len() as f64).recip();
                let shares: Vec<_> = nodes.iter().map(|&node| (node, share)).collect();
                Determined::distributing(&shares, &motions)
            }
        };
        let known: Vec<usize> = (0..motions.ways.len())
            .filter(|&k| found.is_known(k))
            .collect();
        let drives: Vec<Drive> = (known.iter().map(|&k| motions.ways[k]))
            .map(|component| Drive {
                component,
                size: if component < D { 1.0 } else { frame.size },
            })
            .collect();
        let wanted = (0..rigid::count(D)).find(|&k| {
            // Holding still what nothing moves is no error.
            let is_stated = self.motion(k).unwrap_or(0.0) != 0.0 || self.load(k) != 0.0;
            is_stated && drives.iter().all(|drive| drive.component != k)
        });
        if let Some(k) = wanted {
            let name = MOTIONS[Self::in_space(k)];
            return Err(Fault::Stated(match motions.ways.len() {
                1 => format!(
                    "a body of revolution moves along y alone: leave out {name} and loads along it"
                ),
                _ => format!(
                    "its nodes do not determine the motion {name} of the point: couple nodes that are farther apart and in all directions, or leave out {name} and loads along it"
                ),
            }));
        }
        if drives.is_empty() {
            let text = "its nodes determine no motion of the point: couple more nodes, or leave fewer directions free";
            return Err(Fault::Stated(text.to_owned()));
        }
        Ok(Coupled {
            nodes,
            drives,
            motions: known.iter().map(|&k| found.terms[k].clone()).collect(),
            follow: found.follow,
        })
    }

    /// Adds its loads times a factor.
    pub(super) fn push(
        &self,
        body: &Body<D>,
        factor: f64,
        forces: &mut [[f64; D]],
    ) -> Result<(), Fault> {
        if (0..rigid::count(D)).all(|k| self.load(k) == 0.0) {
            return Ok(());
        }
        let coupled = self.on_mesh(body)?;
        for (drive, terms) in coupled.drives.iter().zip(&coupled.motions) {
            let load = factor * self.load(drive.component) / drive.size;
            for (node, way) in terms {
                (0..D).for_each(|c| forces[*node as usize][c] += load * way[c]);
            }
        }
        Ok(())
    }

    /// Its places: first the motions of the point, then the nodes that follow.
    pub(super) fn find(
        &self,
        body: &Body<D>,
        units: &Units,
    ) -> Result<(Vec<ContactPlace<D>>, PairData<D>), Fault> {
        let coupled = self.on_mesh(body)?;
        let mut places: Vec<ContactPlace<D>> = Vec::new();
        let mut add =
            |place: [f64; D], node: Option<u32>, own: u32, frame, rows: Vec<Vec<Term<D>>>| {
                places.push(ContactPlace {
                    place,
                    node,
                    own: vec![(own, 1.0)],
                    partners: Vec::new(),
                    directed: match node {
                        Some(_) => Vec::new(),
                        None => vec![Default::default(); D],
                    },
                    further: rows,
                    frame,
                    gap: 0.0,
                    area: 1.0,
                    pool: places.len() as u32,
                    slip_bound: SlipBound::Tied,
                    compliance: [0.0; 2],
                });
            };
        for (drive, terms) in coupled.drives.iter().zip(&coupled.motions) {
            let mut frame = [[0.0; D]; D];
            if drive.component < D {
                frame[0] = Way::Axis(drive.component).vector();
            }
            add(
                self.point,
                None,
                coupled.nodes[0],
                frame,
                vec![terms.clone()],
            );
        }
        for rows in coupled.follow.chunk_by(|a, b| a.0 == b.0) {
            let node = rows[0].0;
            let mut frame = [[0.0; D]; D];
            for (way, (_, c, _)) in frame.iter_mut().zip(rows) {
                *way = Way::Axis(*c).vector();
            }
            let others = rows.iter().map(|(.., others)| others.clone()).collect();
            add(
                body.mesh.nodes[node as usize],
                Some(node),
                node,
                frame,
                others,
            );
        }
        let mut what = vec![match self.kind {
            Kind::Rigid => "rigid".to_owned(),
            Kind::Distributing => "distributing".to_owned(),
        }];
        for k in 0..rigid::count(D) {
            let name = MOTIONS[Self::in_space(k)];
            what.extend(self.motion(k).map(|motion| format!("{name} = {motion}")));
            let unit = match k < D {
                true => units.force.clone(),
                false => units.moment(),
            };
            if self.load(k) != 0.0 {
                let (load, of) = (self.load(k), if k < D { "force" } else { "moment" });
                what.push(format!("{of} {load}{} along {name}", Units::behind(&unit)));
            }
        }
        let data = PairData {
            tied: true,
            drives: coupled.drives,
            ..PairData::between(
                EntityKind::Coupling,
                &self.name,
                self.target().name(),
                format!("the point {}", Location::from(self.point)),
                what.join(", "),
            )
        };
        Ok((places, data))
    }
}

/// As many displacements as there are independent motions, one after the other that with the most left of it.
fn independent(all: &[(u32, usize, Vec<f64>)], most: usize) -> Vec<usize> {
    let mut left: Vec<Vec<f64>> = all.iter().map(|(.., at)| at.clone()).collect();
    let mut chosen = Vec::new();
    let mut largest = 0.0;
    while chosen.len() < most {
        let sizes = left.iter().map(|row| rigid::length(row)).enumerate();
        let Some((next, size)) =
            sizes.reduce(|best, next| if next.1 > best.1 { next } else { best })
        else {
            break;
        };
        largest = f64::max(largest, size);
        if !(size > INDEPENDENT * largest) {
            break;
        }
        chosen.push(next);
        let way: Vec<f64> = left[next].iter().map(|v| v / size).collect();
        for row in &mut left {
            let along: f64 = row.iter().zip(&way).map(|(v, w)| v * w).sum();
            row.iter_mut().zip(&way).for_each(|(v, w)| *v -= along * w);
        }
    }
    chosen
}
