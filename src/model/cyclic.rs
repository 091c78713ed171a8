//! Cyclic symmetry: a sector of a body that repeats itself about an axis.
//!
//! Displacements on one side of the sector are those on the other one, turned. The turned side is the boundary of a
//! turned copy of the mesh, to which the mortar method ties the other side. The nodes of the copy are those of the mesh
//! with turned displacements.

use super::axis::Axis;
use super::contacts::{
    Directions, Found, PairData, TIE_DISTANCE, bodies_of, held_on_both, largest_facet,
};
use super::entities::{Facts, NO_BOUNDARY, Names, Part, with_a_name};
use super::error::{EntityKind, Fault};
use super::loads::{area_shares, outer_facets};
use super::revolution::ON_AXIS;
use super::stated::Flaw;
use crate::contact::{
    ContactError, ContactPlace, Friction, PairOptions, Seams, Sectors, Space, mortar_contact,
};
use crate::elasticity::Body;
use crate::mesh::structured::join;
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Mesh, nodes_of_facets};
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::collections::{HashMap, HashSet};
use std::f64::consts::TAU;
use std::sync::Arc;

/// A side is tied if at least this part of its area has the other side opposite. Curved sides whose meshes do not match miss a little.
const MET: f64 = 0.9;

/// Both sides of a sector, one of several equal ones about an axis. Bodies, loads, supports and contacts are those of one sector.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Cyclic<const D: usize = 2> {
    name: Option<String>,
    low: Names,
    high: Names,
    axis: Axis<D>,
    sectors: u32,
    #[serde(default, skip_serializing_if = "super::stated::is_default")]
    whole: bool,
}

with_a_name!(Cyclic);

/// Bodies that repeat themselves about an axis.
#[derive(Clone, Debug)]
pub(super) struct Repeated<const D: usize> {
    axis: Axis<D>,
    pub sectors: Arc<Sectors<D>>,
    /// Those at the sides of the sector.
    pub bodies: HashSet<u32>,
    /// Those whose sides do not match where they have contacts, with the largest distance of a node from the nearest one there, after
    /// the turn.
    pub unmatched: HashMap<u32, f64>,
}

/// A node of the high side of a sector, that of the low side which the turn takes to it, and the turn.
type Matched<const D: usize> = (u32, u32, [[f64; D]; D]);

impl<const D: usize> Cyclic<D> {
    /// Boundaries on both sides of one of these sectors about an axis. Meshes of the sides need not match.
    pub fn between(
        low: impl Into<Names>,
        high: impl Into<Names>,
        axis: Axis<D>,
        sectors: u32,
    ) -> Self {
        Self {
            name: None,
            low: low.into(),
            high: high.into(),
            axis,
            sectors,
            whole: false,
        }
    }

    /// `solution.vtu` and pictures show all sectors.
    pub fn whole(mut self) -> Self {
        self.whole = true;
        self
    }

    /// The axis and the number of sectors, if results show all of them.
    pub(super) fn shown(&self) -> Option<(Axis<D>, u32)> {
        self.whole.then_some((self.axis, self.sectors))
    }
}

impl<const D: usize> Part for Cyclic<D> {
    fn facts(&self) -> Facts<'_> {
        Facts {
            kind: EntityKind::Cyclic,
            name: self.name.as_deref(),
            place: format!("from \"{}\" to \"{}\"", self.low, self.high),
            factors: Vec::new(),
        }
    }

    fn fault(&self) -> Option<Flaw> {
        if self.low.all().is_empty() || self.high.all().is_empty() {
            return Some(NO_BOUNDARY.into());
        }
        if self.sectors < 2 {
            let text = format!("sectors is {}: a body has at least two", self.sectors);
            return Some(Flaw::of("sectors", text));
        }
        self.axis.fault().map(|text| Flaw::of("axis", text))
    }
}

impl<const D: usize> Cyclic<D>
where
    ElementKind: Space<D>,
{
    /// Its places, on the side `high`; `held` has the directions along which nodes are held.
    pub(super) fn find(&self, body: &Body<D>, held: &Directions<D>) -> Result<Found<D>, Fault> {
        if self.whole
            && u32::try_from(body.mesh.nodes.len() as u64 * u64::from(self.sectors)).is_err()
        {
            let text = "all sectors have more nodes than a file can number: leave out whole";
            return Err(Fault::Stated(text.to_owned()));
        }
        let ([low, high], angle) = self.sides(body.mesh)?;
        let sides = [&low[..], &high];
        let of_sides = format!(
            "of \"{}\", turned by 360/{} degrees about {}, lies on \"{}\"",
            self.low, self.sectors, self.axis, self.high
        );
        let remedy = "check the axis and the number of sectors";
        let stated = |error| match error {
            ContactError::Apart { nearest, .. } => Fault::Stated(format!(
                "no part {of_sides}; they are at least {nearest:.3e} apart: {remedy}"
            )),
            error => Fault::Contact(error),
        };
        let area = |places: &[ContactPlace<D>]| places.iter().map(|place| place.area).sum::<f64>();
        let places = self.tied(body, sides, held, angle).map_err(stated)?;
        let whole = sides.map(|facets| area_shares(body, facets).1);
        let whole = whole[0].max(whole[1]);
        // Where supports hold both sides, nodes have no part of the area.
        let mut met = area(&places) / whole;
        if met < MET && !held.is_empty() {
            let free = self.tied(body, sides, &Directions::new(), angle);
            met = area(&free.map_err(stated)?) / whole;
        }
        if met < MET {
            let part = 100.0 * met;
            return Err(Fault::Stated(format!(
                "only {part:.0} % {of_sides}: {remedy}"
            )));
        }
        let data = PairData {
            tied: true,
            ..PairData::between(
                EntityKind::Cyclic,
                &self.name,
                self.high.to_string(),
                self.low.to_string(),
                format!("one of {} sectors about {}", self.sectors, self.axis),
            )
        };
        Ok((places, data))
    }

    /// The facets of its sides, low and high, and the angle from one to the other.
    fn sides(&self, mesh: &Mesh<D>) -> Result<([Vec<Facet<D>>; 2], f64), Fault> {
        let low = outer_facets(mesh, self.low.all())?;
        let high = outer_facets(mesh, self.high.all())?;
        // Which side is first about the axis, the mesh tells.
        let middle = |facets: &[Facet<D>]| {
            let part = (facets.len() as f64).recip();
            let sum = facets.iter().map(|facet| mesh.facet_middle(facet));
            sum.fold([0.0; D], |sum, x| from_fn(|c| sum[c] + part * x[c]))
        };
        let [from, to] = [&low, &high].map(|facets| middle(facets));
        let whole = TAU / f64::from(self.sectors);
        let off = |angle: f64| length(minus(self.axis.turned(from, angle), to));
        let angle = if off(whole) <= off(-whole) {
            whole
        } else {
            -whole
        };
        Ok(([low, high], angle))
    }

    /// Its sectors, whose sides are not joined yet.
    fn sectors(&self, mesh: &Mesh<D>) -> Result<Sectors<D>, Fault> {
        let turned = |x, angle| self.axis.turned(x, angle);
        Sectors::new(self.sectors, mesh.nodes.len(), turned).ok_or_else(|| {
            let text =
                "contacts number the nodes of all sectors, which are too many: take a coarser mesh";
            Fault::Stated(text.to_owned())
        })
    }

    /// Adds it to the turns of bodies, as one of those about the same axis or as another one; with the seams of some nodes.
    pub(super) fn repeat(
        &self,
        mesh: &Mesh<D>,
        nodes: &HashSet<u32>,
        body_of: &[u32],
        seams: &mut Seams<D>,
        repeated: &mut Vec<Repeated<D>>,
    ) -> Result<(), Fault> {
        let (low, high) = mesh.bounding_box();
        let size = length(minus(high, low));
        let is_same = |other: &Repeated<D>| {
            other.sectors.count() == self.sectors && other.axis.is_along(&self.axis, size)
        };
        let at = match repeated.iter().position(is_same) {
            Some(at) => at,
            None => {
                repeated.push(Repeated {
                    axis: self.axis,
                    sectors: Arc::new(self.sectors(mesh)?),
                    bodies: HashSet::new(),
                    unmatched: HashMap::new(),
                });
                repeated.len() - 1
            }
        };
        let sides = self.sides(mesh)?;
        let ring = &mut repeated[at];
        ring.bodies
            .extend(sides.0.iter().flat_map(|side| bodies_of(body_of, side)));
        // Where some do not match, all places are halves.
        let (matched, unmatched) = self.seams(mesh, sides, nodes, body_of, seams);
        let is_whole = |one: &Matched<D>| !unmatched.contains_key(&body_of[one.0 as usize]);
        let joined = Arc::make_mut(&mut ring.sectors);
        for (high, low, turn) in matched.into_iter().filter(is_whole) {
            joined.join(high, low, &turn);
        }
        for (body, off) in unmatched {
            let most = ring.unmatched.entry(body).or_default();
            *most = most.max(off);
        }
        Ok(())
    }

    /// Adds, for those of some nodes that are on its sides, where the body goes on beyond them: at the two nearest of these nodes of the
    /// same body at the other side, after the turn, or on one where that is there. A node on the axis is on all sides of itself. Returns
    /// the nodes of the high side that are where turned ones of the low side are, with these and the turn, and the bodies that have others, with the
    /// largest distance of one of these from the nearest.
    fn seams(
        &self,
        mesh: &Mesh<D>,
        (sides, angle): ([Vec<Facet<D>>; 2], f64),
        nodes: &HashSet<u32>,
        body_of: &[u32],
        seams: &mut Seams<D>,
    ) -> (Vec<Matched<D>>, HashMap<u32, f64>) {
        /// The distance at which two nodes count as one, in the largest facet.
        const ONE: f64 = 1e-6;
        let sizes = sides.each_ref().map(|facets| largest_facet(mesh, facets));
        let size = sizes[0].max(sizes[1]);
        let on_sides = sides.map(|facets| {
            let mut on_side = nodes_of_facets(&facets);
            on_side.retain(|node| nodes.contains(node));
            on_side
        });
        let turn = |angle: f64| -> [[f64; D]; D] {
            let start = self.axis.turned([0.0; D], angle);
            let columns: [[f64; D]; D] = from_fn(|c| {
                let way = from_fn(|d| f64::from(u8::from(c == d)));
                minus(self.axis.turned(way, angle), start)
            });
            from_fn(|r| from_fn(|c| columns[c][r]))
        };
        let ways = [
            (&on_sides[0], &on_sides[1], angle),
            (&on_sides[1], &on_sides[0], -angle),
        ];
        let (mut matched, mut unmatched) = (Vec::new(), HashMap::<u32, f64>::new());
        for (here, there, angle) in ways {
            for &node in here {
                let x = self.axis.turned(mesh.nodes[node as usize], angle);
                let of_body = |other: &&u32| body_of[**other as usize] == body_of[node as usize];
                let mut near: Vec<(f64, u32)> = (there.iter().filter(of_body))
                    .map(|&other| (length(minus(mesh.nodes[other as usize], x)), other))
                    .filter(|other| other.0 <= size)
                    .collect();
                near.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
                match near[..] {
                    [(off, other), ..] if off <= ONE * size => {
                        if other != node && std::ptr::eq(here, &on_sides[1]) {
                            matched.push((node, other, turn(-angle)));
                        }
                    }
                    _ => {
                        let most = unmatched.entry(body_of[node as usize]).or_default();
                        *most = most.max(near.first().map_or(size, |nearest| nearest.0));
                    }
                }
                let beyond = match near[..] {
                    [(off, other), ..] if off <= ONE * size && other == node => {
                        let sectors = 1..self.sectors;
                        let turned = |k| (node, 1.0, turn(f64::from(k) * angle));
                        sectors.map(turned).collect()
                    }
                    [(off, other), (far, _), ..] if off <= ONE * far => {
                        vec![(other, 1.0, turn(-angle))]
                    }
                    [one, two, ..] => {
                        let part = one.0 / (one.0 + two.0);
                        let back = turn(-angle);
                        vec![(one.1, 1.0 - part, back), (two.1, part, back)]
                    }
                    [(_, other)] => vec![(other, 1.0, turn(-angle))],
                    [] => continue,
                };
                seams.insert(node, beyond);
            }
        }
        (matched, unmatched)
    }

    /// The places of `high` tied to `low` after a turn by an angle.
    fn tied(
        &self,
        body: &Body<D>,
        [low, high]: [&[Facet<D>]; 2],
        of_mesh: &Directions<D>,
        angle: f64,
    ) -> Result<Vec<ContactPlace<D>>, ContactError> {
        let n = body.mesh.nodes.len() as u32;
        let origin = [0.0; D];
        let start = self.axis.turned(origin, angle);
        let turned = |v: [f64; D]| minus(self.axis.turned(v, angle), start);
        let mut copy = body.mesh.clone();
        copy.place_nodes(|x| self.axis.turned(x, angle));
        copy.rename(
            |name| format!("{name} turned"),
            |name| format!("{name} turned"),
        );
        let both = join(body.mesh.clone(), copy);
        let opposite: Vec<Facet<D>> = low
            .iter()
            .map(|facet| {
                let mut facet = *facet;
                facet.as_mut().iter_mut().for_each(|node| *node += n);
                facet
            })
            .collect();
        let of_copy = of_mesh.iter().map(|(node, ways)| {
            let ways = ways.iter().map(|way| turned(*way));
            (node + n, ways.collect::<Vec<_>>())
        });
        let of_copy: Directions<D> = of_copy.collect();
        let size = largest_facet(body.mesh, high);
        let held = held_on_both(&both, [high, &opposite], [of_mesh, &of_copy]);
        let options = PairOptions {
            friction: Friction::Tied,
            gap: Some(&|_| 0.0),
            held: Some(&held),
            search_distance: Some(TIE_DISTANCE * size),
            ..PairOptions::default()
        };
        let materials = [body.materials, body.materials].concat();
        let of_both = Body {
            mesh: &both,
            materials: &materials,
            ..*body
        };
        let found = mortar_contact(&of_both, high, &opposite, &options)?;
        let (lowest, highest) = body.mesh.bounding_box();
        let on_axis = ON_AXIS * length(minus(highest, lowest));
        Ok((found.places.into_iter())
            .map(|mut place| {
                let is_on_axis = length(self.axis.across(place.place)) <= on_axis;
                let free = is_on_axis
                    .then(|| self.along_axis(&mut place.frame))
                    .flatten();
                let sides = |a: usize, side: usize| match free {
                    Some(free) if free == a => &[][..],
                    _ => place.sides(a)[side],
                };
                let own: Vec<[Vec<(u32, f64)>; 2]> =
                    (0..D).map(|a| [sides(a, 0).to_vec(), Vec::new()]).collect();
                let further = (0..D).map(|a| {
                    let way = place.frame[a];
                    let partners = sides(a, 1).iter();
                    let terms = partners.map(|&(node, weight)| {
                        // way · R u, where u is the displacement of the node before the turn.
                        let back =
                            from_fn(|c| dot(way, turned(from_fn(|d| f64::from(u8::from(c == d))))));
                        (node - n, back.map(|v| -weight * v))
                    });
                    terms.collect()
                });
                ContactPlace {
                    further: further.collect(),
                    directed: own,
                    partners: Vec::new(),
                    ..place
                }
            })
            .collect())
    }

    /// Turns a frame so that one of its directions, whose number is returned, is along the axis; none of the plane is. Both sides have the same
    /// place on the axis: along it nothing ties the place to itself, and by symmetry sides pass on no force there.
    fn along_axis(&self, frame: &mut [[f64; D]; D]) -> Option<usize> {
        let [.., axis] = self.axis.any_directions();
        let part = |a: &usize| dot(frame[*a], axis).abs();
        let along = (0..D).max_by(|a, b| part(a).total_cmp(&part(b)));
        let along = along.filter(|a| part(a) > 0.0)?;
        let mut before = vec![axis];
        for a in (0..D).filter(|&a| a != along) {
            for other in &before {
                let part = dot(frame[a], *other);
                frame[a] = from_fn(|c| frame[a][c] - part * other[c]);
            }
            frame[a] = unit(frame[a]);
            before.push(frame[a]);
        }
        frame[along] = axis;
        Some(along)
    }
}
