//! The contacts of a model: their nodes and their properties.

use super::arcs::{EVEN, between_arcs, centres_of_arcs, gap_of_arcs, sagitta};
use super::cyclic::Repeated;
use super::entities::{Names, Part as _, Target};
use super::error::{Entity, EntityKind, Fault, ModelError};
use super::loads::{end_of, outer_facets};
use super::pair::{Against, Law, Overlap};
use super::stated_gap::Stated;
use super::supports::{Prescriptions, SAME, Way, extended, nodes_of_sets};
use super::{Definition, Drive, Driven, Equal, Pair, Units};
use crate::contact::{
    Centre, ContactError, ContactPlace, ContactRows, EDGE_ANGLE, Excluded, Itself, Met, Obstacle,
    PairOptions, Seams, Sectors, Space, Unmet, Wall, equal_nodes, held_across, mortar_contact,
    node_contact, obstacle_contact, walls,
};
use crate::elasticity::{Body, Field, Unknowns};
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{
    ElementKind, Facet, Location, Mesh, Topology, facet_corners, facet_nodes, nodes_of_facets,
    unsided,
};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// A contact as it was understood.
#[derive(Clone, Debug)]
pub struct PairData<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// Its kind: a contact, a tie, or another one with rows of this form.
    pub kind: EntityKind,
    /// Its number among its kind.
    pub number: usize,
    /// Its own name, if any.
    pub name: Option<String>,
    /// The boundary that carries the multipliers; several in one text.
    pub boundary: String,
    /// Its facets.
    pub facets: Vec<Facet<D>>,
    /// Those of the master boundary; none for an obstacle.
    pub others: Vec<Facet<D>>,
    /// What is behind each facet of a boundary that meets itself; otherwise behind its facets and those of the other boundary, if a body
    /// is on both sides.
    pub walls: Vec<Wall<D>>,
    /// Of a boundary that meets itself, the exclusions of each facet; empty where there are none.
    pub excluded: Vec<Vec<Excluded>>,
    /// The sectors that it goes on in, where its bodies repeat themselves about an axis.
    pub(super) sectors: Option<Arc<Sectors<D>>>,
    /// Whether its boundary meets itself.
    pub(super) itself: bool,
    /// The master boundary, or the kind of obstacle.
    pub against: String,
    /// The obstacle, if the other side is not a boundary.
    pub obstacle: Option<Obstacle<D>>,
    /// The law and its bound or coefficient.
    pub friction: String,
    /// Whether the law is Tresca's.
    pub tresca: bool,
    /// Whether it is a tie, nodes that move alike, or a spring.
    pub tied: bool,
    /// The motions that its first places measure, one each: of preloads and couplings.
    pub drives: Vec<Drive>,
    /// The stiffness of the contact itself, or of a spring; None where it is hard.
    pub stiffness: Option<String>,
    /// The volume that wear takes off over force and slip, in 1/Pa.
    pub wear: f64,
    /// The largest distance of candidates for contact; with an obstacle, the distance up to which Tresca's bound acts.
    pub search_distance: f64,
    /// The part of the master boundary that is opposite within the search distance, but is not met.
    pub unmet: Option<Unmet<D>>,
    /// Whether both sides of a tie look the same way, so that it holds node by node.
    pub alike: bool,
    /// What each facet of both sides is round about at rest, if it fits to some of the other side; empty where none is.
    pub centres: [Vec<Option<Centre<D>>>; 2],
    /// The gap between sides that are drawn as arcs about one axis, where that of their facets scatters by more than a tenth.
    pub arcs: Option<f64>,
    /// The deviation of facets from the curved surfaces (not arcs about one axis) that they approximate, if an overlap is
    /// pressed apart and the deviation exceeds a tenth of it.
    pub sagitta: Option<f64>,
    /// By how far nodes are from those of the other side of their sector, after the turn, where it goes on beyond such sides.
    pub unmatched: Option<f64>,
    /// Contact places.
    pub places: usize,
    /// Those within the search distance.
    pub within: usize,
    /// Those with a law of friction that supports or another contact keep from sliding.
    pub kept: usize,
    /// The area that may come into contact, in m².
    pub area: f64,
    /// The least and the largest initial gap, in m; negative under an interference.
    pub gap: [f64; 2],
}

impl<const D: usize> PairData<D>
where
    ElementKind: Topology<D>,
{
    /// The names of these sides, before anything else is known.
    pub(super) fn between(
        kind: EntityKind,
        name: &Option<String>,
        boundary: String,
        against: String,
        friction: String,
    ) -> Self {
        Self {
            kind,
            number: 0,
            drives: Vec::new(),
            name: name.clone(),
            boundary,
            facets: Vec::new(),
            others: Vec::new(),
            walls: Vec::new(),
            itself: false,
            excluded: Vec::new(),
            sectors: None,
            against,
            obstacle: None,
            friction,
            tresca: false,
            tied: false,
            stiffness: None,
            wear: 0.0,
            search_distance: 0.0,
            unmet: None,
            alike: false,
            centres: [Vec::new(), Vec::new()],
            arcs: None,
            sagitta: None,
            unmatched: None,
            places: 0,
            within: 0,
            kept: 0,
            area: 0.0,
            gap: [f64::INFINITY, f64::NEG_INFINITY],
        }
    }

    /// The part of it that ranks other than the first know.
    #[cfg(feature = "mpi")]
    pub(super) fn known(&(kind, number): &(EntityKind, usize)) -> Self {
        let nothing = String::new;
        Self {
            number,
            ..Self::between(kind, &None, nothing(), nothing(), nothing())
        }
    }

    /// Whether it ties single nodes, and has no sides.
    pub fn is_of_nodes(&self) -> bool {
        !matches!(self.kind, EntityKind::Contact | EntityKind::Tie)
    }

    /// Whether its boundary meets itself.
    pub(super) fn meets_itself(&self) -> bool {
        self.itself
    }

    /// Whether two bodies meet that are not tied.
    pub(super) fn slides(&self) -> bool {
        !self.tied && self.obstacle.is_none()
    }

    /// Its name in results: its own or, without one, both sides.
    pub fn title(&self) -> String {
        match &self.name {
            Some(name) => name.clone(),
            None if self.kind == EntityKind::Equal => self.boundary.clone(),
            None => format!("{} / {}", self.boundary, self.against),
        }
    }

    /// A word about sides of a tie that look the same way.
    pub fn alike_text(&self) -> Option<String> {
        self.alike.then(|| {
            "no two facets of its sides face each other (one side lies within the other): each node of the first side is tied to the \
             nearest point of the second"
                .to_owned()
        })
    }

    /// The part of the master boundary that is opposite but not met, in words.
    pub fn unmet_text(&self, units: &Units) -> Option<String> {
        let unmet = self.unmet.as_ref()?;
        let kind = if D == 2 { "edge" } else { "face" };
        let (facets, have, meet) = match unmet.facets {
            1 => (format!("1 {kind}"), "has", "meets"),
            n => (format!("{n} {kind}s"), "have", "meet"),
        };
        Some(format!(
            "{facets} of \"{}\", the largest around {}, {have} an area of {:.3e}{} opposite within the search distance \
             but {meet} nothing: something else is nearer, or the sides are folded there",
            self.against,
            Location::from(unmet.place),
            unmet.area,
            Units::behind(&units.area())
        ))
    }
}

impl<const D: usize> PairData<D>
where
    ElementKind: Topology<D>,
{
    /// A recommendation to state the gap, in words.
    pub fn arcs_text(&self, units: &Units) -> Option<String> {
        let gap = self.arcs?;
        let [apart, low, high] = [gap, self.gap[0], self.gap[1]].map(|gap| units.long(gap));
        Some(format!(
            "both sides are drawn as arcs about one axis, {apart} apart, but between their facets the gap varies from \
             {low} to {high}: state the gap (gap = {gap:.4e}), so that the result does not depend on how facets meet"
        ))
    }
}

impl<const D: usize> PairData<D>
where
    ElementKind: Topology<D>,
{
    /// A warning, in words, that facets may lose a part of the overlap that is pressed apart.
    pub fn sagitta_text(&self, units: &Units) -> Option<String> {
        let (off, overlap) = (self.sagitta?, -self.gap[0]);
        (overlap > 0.0 && off > EVEN * overlap).then(|| {
            format!(
                "its facets deviate by up to {} from the curved surfaces that they approximate, and the overlap to \
                 press apart is {}: state the gap or the interference, or take a finer mesh or order = 2",
                units.long(off),
                units.long(overlap)
            )
        })
    }

    /// A warning, in words, about sides of sectors whose meshes do not match.
    pub fn unmatched_text(&self, units: &Units) -> Option<String> {
        let off = units.long(self.unmatched?);
        Some(format!(
            "it goes on beyond the sides of sectors, whose nodes there differ by up to {off} after the turn: its forces may be off by some \
             hundredths; mesh both sides of a sector alike, or draw the sectors of both bodies between the same half-planes"
        ))
    }
}

/// The contact places of all pairs, before supports.
pub(super) struct Candidates<const D: usize>
where
    ElementKind: Topology<D>,
{
    pub(super) places: Vec<ContactPlace<D>>,
    /// The pair of each place.
    pub(super) pair_of: Vec<u32>,
    pub(super) pairs: Vec<PairData<D>>,
    /// The directions that they were found with; [`Definition::state_sliding`] completes it.
    pub(super) sliding: Sliding<D>,
}

/// The default distance of the sides of a tie, in facets of its first boundary: the gap between curved sides or coarse
/// meshes of a common surface. (An arc of eight facets has a tenth of one between it and the circle.)
pub(super) const TIE_DISTANCE: f64 = 0.25;

/// The default search distance of a boundary that meets itself, in that of two boundaries: it finds contacts in all of an assembly,
/// and few across its parts.
const OF_ITSELF: f64 = 0.2;

/// The longest way between corners of a facet.
pub(super) fn largest_facet<const D: usize>(mesh: &Mesh<D>, facets: &[Facet<D>]) -> f64
where
    ElementKind: Topology<D>,
{
    let size = |facet: &Facet<D>| {
        let corners = || {
            facet_corners(facet)
                .iter()
                .map(|&node| mesh.nodes[node as usize])
        };
        let ways = corners().flat_map(|x| corners().map(move |y| length(minus(x, y))));
        ways.fold(0.0, f64::max)
    };
    facets.iter().map(size).fold(0.0, f64::max)
}

/// Unit vectors that belong to nodes.
pub(super) type Directions<const D: usize> = HashMap<u32, Vec<[f64; D]>>;

/// The data that find the contact places of bodies again where these have moved.
#[derive(Clone, Debug, Default)]
pub(super) struct Sliding<const D: usize>
where
    ElementKind: Topology<D>,
{
    /// The planes of symmetry of nodes.
    symmetry: Directions<D>,
    /// The directions along which nodes are held.
    pub(super) held: Directions<D>,
    /// Where contacts go on beyond the sides of sectors.
    pub(super) seams: Seams<D>,
    /// The bodies that repeat themselves.
    rings: Vec<Repeated<D>>,
    /// The body of each node.
    pub(super) body_of: Vec<u32>,
    /// The surfaces of the bodies, where displacements are large.
    pub(super) surfaces: Vec<Vec<Facet<D>>>,
    /// Of contacts between two bodies, by their numbers.
    pub(super) stated: HashMap<u32, Stated>,
}

impl<const D: usize> Sliding<D>
where
    ElementKind: Topology<D>,
{
    /// The sectors that a contact goes on in. Bodies that are not at their sides repeat themselves as well, unless they are all around
    /// the axis.
    fn sectors(
        &self,
        mesh: &Mesh<D>,
        sides: [&[Facet<D>]; 2],
    ) -> Result<Option<&Arc<Sectors<D>>>, Fault> {
        let bodies = sides.map(|facets| bodies_of(&self.body_of, facets));
        let is_at = |ring: &&Repeated<D>| bodies.iter().any(|of| !of.is_disjoint(&ring.bodies));
        let at_sides: Vec<_> = self.rings.iter().filter(is_at).collect();
        let ring = match (&at_sides[..], &self.rings[..]) {
            ([ring], _) => *ring,
            ([], [ring]) => ring,
            ([], _) => return Ok(None),
            _ => {
                return Err(Fault::Stated(
                    "its sides belong to sectors of different numbers or about different axes: draw one of as many sectors of each, \
                     or the whole bodies"
                        .to_owned(),
                ));
            }
        };
        let is_around = |facets: &[Facet<D>]| {
            let nodes = facets.iter().flat_map(facet_nodes);
            let nodes = nodes.filter(|node| !ring.bodies.contains(&self.body_of[**node as usize]));
            let mut places = nodes.map(|node| mesh.nodes[*node as usize]).peekable();
            places.peek().is_some() && ring.sectors.surrounded(places)
        };
        Ok((!sides.into_iter().any(is_around)).then_some(&ring.sectors))
    }
}

impl<const D: usize> Sliding<D>
where
    ElementKind: Space<D>,
{
    /// Where places go on beyond sides of sectors that do not match: how far these are off.
    fn off_beyond(&self, sides: [&[Facet<D>]; 2], places: &[ContactPlace<D>]) -> Option<f64> {
        /// Rounding, or sides that differ a little.
        const LITTLE: f64 = 1e-2;
        let bodies = sides.map(|facets| bodies_of(&self.body_of, facets));
        let of_rings = self.rings.iter().flat_map(|ring| &ring.unmatched);
        let of_sides = of_rings.filter(|(body, _)| bodies.iter().any(|of| of.contains(body)));
        let off = of_sides.map(|(_, off)| *off).reduce(f64::max)?;
        let beyond = |place: &ContactPlace<D>| -> f64 {
            let all = place.sides(0).into_iter().flatten();
            let images = all.filter(|entry| place.is_image(entry.0));
            images.map(|entry| entry.1.abs()).fold(0.0, f64::max)
        };
        places
            .iter()
            .any(|place| beyond(place) > LITTLE)
            .then_some(off)
    }
}

/// The bodies that facets are on.
pub(super) fn bodies_of<const D: usize>(body_of: &[u32], facets: &[Facet<D>]) -> HashSet<u32>
where
    ElementKind: Topology<D>,
{
    let first = facets.iter().map(|facet| facet_nodes(facet)[0]);
    first.map(|node| body_of[node as usize]).collect()
}

/// The directions along which nodes of a tie are held, with those of its first side only where near nodes of the other side are held along
/// them as well: where one side is held, the other one follows it. Each side has the directions of its nodes.
pub(super) fn held_on_both<const D: usize>(
    mesh: &Mesh<D>,
    [facets, others]: [&[Facet<D>]; 2],
    [of_first, of_other]: [&Directions<D>; 2],
) -> Directions<D>
where
    ElementKind: Topology<D>,
{
    /// The part of a direction among others above which it is one of them, or between them.
    const SAME_WAY: f64 = 1.0 - 1e-9;
    let size = largest_facet(mesh, facets);
    let there = nodes_of_facets(others).into_iter();
    // In the order of x, for the search.
    let mut near: Vec<([f64; D], &Vec<[f64; D]>)> = there
        .filter_map(|node| Some((mesh.nodes[node as usize], of_other.get(&node)?)))
        .collect();
    near.sort_unstable_by(|a, b| a.0[0].total_cmp(&b.0[0]));
    let is_held = |x: [f64; D], way: &[f64; D]| {
        let begin = near.partition_point(|(other, _)| other[0] < x[0] - size);
        let mut around = near[begin..]
            .iter()
            .take_while(|(other, _)| other[0] <= x[0] + size);
        around.any(|(other, ways)| {
            let along = ways.iter().map(|other| dot(*other, *way).powi(2));
            length(minus(*other, x)) <= size && along.sum::<f64>() > SAME_WAY
        })
    };
    let mut held = of_other.clone();
    for node in nodes_of_facets(facets) {
        if let Some(ways) = of_first.get(&node) {
            let x = mesh.nodes[node as usize];
            let ways = ways.iter().copied().filter(|way| is_held(x, way));
            held.insert(node, ways.collect());
        }
    }
    held
}

/// The surface of each body.
fn surfaces<const D: usize>(mesh: &Mesh<D>, count: usize, body_of: &[u32]) -> Vec<Vec<Facet<D>>>
where
    ElementKind: Topology<D>,
{
    let nodes: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    let mut surfaces = vec![Vec::new(); count];
    for facet in mesh.outer_facets_at(&nodes, true) {
        surfaces[body_of[facet_nodes(&facet)[0] as usize] as usize].push(facet);
    }
    surfaces
}

/// Whether two boundaries have facets of one body.
fn have_common_body<const D: usize>(body_of: &[u32], sides: [&[Facet<D>]; 2]) -> bool
where
    ElementKind: Topology<D>,
{
    let [own, other] = sides.map(|facets| bodies_of(body_of, facets));
    !own.is_disjoint(&other)
}

/// The contact places of a pair, and its data so far.
pub(super) type Found<const D: usize> = (Vec<ContactPlace<D>>, PairData<D>);

/// Where the sides of a pair are round.
#[derive(Default)]
struct Rounds<const D: usize> {
    /// [`PairData::centres`].
    centres: [Vec<Option<Centre<D>>>; 2],
    /// The gap between arcs about one axis, where an overlap counts that these centres do not know.
    gap: Option<f64>,
    /// The deviation of the other facets, if an overlap counts.
    sagitta: Option<f64>,
}

impl<const D: usize> Pair<D>
where
    ElementKind: Space<D>,
{
    /// The facets of its own side.
    fn own_facets(&self, mesh: &Mesh<D>) -> Result<Vec<Facet<D>>, Fault> {
        match self.is_by_nodes() {
            true => Ok(mesh.outer_facets_at(&nodes_of_sets(mesh, self.side())?, false)),
            false => outer_facets(mesh, self.side().all()),
        }
    }

    /// Of a boundary that meets itself, the exclusions of each facet: those that are stated, and the sides of others, as of ties.
    fn excluded<'p>(
        &'p self,
        mesh: &Mesh<D>,
        others: impl Iterator<Item = &'p Self>,
    ) -> Result<Vec<Vec<Excluded>>, Fault> {
        if !self.is_with_itself() {
            return Ok(Vec::new());
        }
        let facets_of = |names: &Names| outer_facets(mesh, names.all());
        let mut all = Vec::new();
        for [one, other] in &self.exclude {
            all.push([facets_of(one)?, facets_of(other)?]);
        }
        for other in others.filter(|other| !other.is_with_itself()) {
            if let Against::Boundary(names) = other.meets() {
                all.push([other.own_facets(mesh)?, facets_of(names)?]);
            }
        }
        let facets = self.own_facets(mesh)?;
        let numbered = facets.iter().enumerate();
        let number_of: HashMap<_, _> = numbered.map(|(k, facet)| (unsided(facet), k)).collect();
        let mut excluded = vec![Vec::new(); facets.len()];
        for (number, sides) in (0..).zip(&all) {
            for (facets, side) in sides.iter().zip([false, true]) {
                let known = facets
                    .iter()
                    .filter_map(|facet| number_of.get(&unsided(facet)));
                known.for_each(|&k| excluded[k].push((number, side)));
            }
        }
        if excluded.iter().all(Vec::is_empty) {
            excluded.clear();
        }
        Ok(excluded)
    }

    /// What is round about its sides.
    fn rounds(
        &self,
        mesh: &Mesh<D>,
        sides: [&[Facet<D>]; 2],
        sectors: Option<&Sectors<D>>,
    ) -> Rounds<D> {
        let steepest = self.edge_angle.unwrap_or(EDGE_ANGLE);
        let mut centres = match sectors {
            _ if self.is_tie() => [Vec::new(), Vec::new()],
            None => centres_of_arcs(mesh, sides, steepest),
            Some(sectors) => {
                let (whole, all) = sectors.all_around(mesh, sides);
                centres_of_arcs(&whole, all.each_ref().map(Vec::as_slice), steepest)
            }
        };
        for (centres, facets) in centres.iter_mut().zip(sides) {
            centres.truncate(facets.len());
        }
        // Overlapping arcs lose that overlap as polygons.
        let overlaps = self.overlap.is_some() && !self.is_with_itself();
        let gap = (overlaps && centres[0].is_empty()).then(|| gap_of_arcs(mesh, sides, steepest));
        let gap = gap.flatten();
        let sagitta = (overlaps && gap.is_none()).then(|| {
            let others = [0, 1].map(|side: usize| -> Vec<Facet<D>> {
                let is_round = |k: usize| centres[side].get(k).is_some_and(Option::is_some);
                let others = sides[side].iter().enumerate().filter(|at| !is_round(at.0));
                others.map(|(_, facet)| *facet).collect()
            });
            sagitta(mesh, others.each_ref().map(Vec::as_slice), steepest)
        });
        Rounds {
            centres,
            gap,
            sagitta,
        }
    }

    /// Looks for its contact places beside all pairs of a model. Where displacements are `large`, bodies may meet later.
    fn find<'p>(
        &'p self,
        body: &Body<D>,
        units: &Units,
        sliding: &Sliding<D>,
        large: bool,
        all: impl Iterator<Item = &'p Self>,
    ) -> Result<Found<D>, Fault> {
        let mesh = body.mesh;
        let nodes = match self.is_by_nodes() {
            true => nodes_of_sets(mesh, self.side())?,
            false => Vec::new(),
        };
        let mut facets = self.own_facets(mesh)?;
        let excluded = self.excluded(mesh, all)?;
        let law = |x| self.law.at(x);
        let mut others = match self.meets() {
            Against::Boundary(names) => outer_facets(mesh, names.all())?,
            Against::Obstacle(_) => Vec::new(),
        };
        let sectors = match self.meets() {
            Against::Boundary(_) => sliding.sectors(mesh, [&facets, &others])?.cloned(),
            Against::Obstacle(_) => None,
        };
        let Rounds {
            mut centres,
            gap: of_arcs,
            sagitta,
        } = match others.is_empty() || self.is_by_nodes() {
            true => Rounds::default(),
            false => self.rounds(mesh, [&facets, &others], sectors.as_deref()),
        };
        let stated = self.stated_gap().map(|(_, gap)| gap);
        let gap = |x| of_arcs.unwrap_or_else(|| stated.as_ref().map_or(0.0, |gap| gap(x)));
        let overlap = |x| -gap(x);
        let [normal, tangential] = [0, 1].map(|way: usize| {
            let stiffness = self.stiffness.both()[way];
            move |x| stiffness.map_or(f64::NAN, |k| k.at(x))
        });
        let mut options = PairOptions {
            gap: (self.gap.is_some() || self.is_tie() || of_arcs.is_some()).then_some(&gap),
            interference: self.interference.is_some().then_some(&overlap),
            overlap: self.overlap == Some(Overlap::Interference),
            touching: self.overlap == Some(Overlap::Touching),
            adjust: self.adjust,
            offset: self.offset,
            search_distance: self.search_distance,
            moves: large && !self.is_tie(),
            ..self.options(&law, [&normal, &tangential], sliding)
        };
        let (mut unmet, mut alike) = (None, false);
        let mut behind = Vec::new();
        let held;
        let mut boundary = self.side().to_string();
        let (found, against, search_distance) = match self.meets() {
            Against::Boundary(names) => {
                let mut against = match self.is_with_itself() {
                    true => "itself".to_owned(),
                    false => names.to_string(),
                };
                // Multipliers belong to a side that can give way.
                let is_held = |facets: &[Facet<D>]| {
                    let mut all = facets.iter();
                    all.all(|facet| held_across(facet, mesh.facet_normal(facet).1, &sliding.held))
                };
                if !self.is_by_nodes() && is_held(&facets) && !is_held(&others) {
                    std::mem::swap(&mut facets, &mut others);
                    std::mem::swap(&mut boundary, &mut against);
                    centres.swap(0, 1);
                }
                if self.is_tie() {
                    options.search_distance = Some(match self.adjust {
                        0.0 => TIE_DISTANCE * largest_facet(body.mesh, &facets),
                        adjust => adjust,
                    });
                }
                let distance = match (self.is_with_itself(), self.search_distance) {
                    (true, None) => OF_ITSELF * options.distance_between(body, &facets, &others),
                    _ => options.distance_between(body, &facets, &others),
                };
                options.search_distance = Some(distance);
                if self.is_with_itself() {
                    behind = walls(body, &facets, distance, &options).map_err(Fault::Contact)?;
                    options.itself = Some(Itself {
                        before: &[],
                        excluded: &excluded,
                    });
                } else if !self.is_tie() && have_common_body(&sliding.body_of, [&facets, &others]) {
                    let both = [&facets[..], &others].concat();
                    behind = walls(body, &both, distance, &options).map_err(Fault::Contact)?;
                }
                if self.is_tie() {
                    held = held_on_both(body.mesh, [&facets, &others], [&sliding.held; 2]);
                    options.held = Some(&held);
                }
                options.walls = &behind;
                options.centres = centres.each_ref().map(Vec::as_slice);
                options.sectors = sectors.as_ref();
                let found = match self.is_by_nodes() {
                    true => node_contact(body, &nodes, &facets, Met::Facets(&others), &options),
                    false => mortar_contact(body, &facets, &others, &options).map(|found| {
                        unmet = found.unmet;
                        found.places
                    }),
                };
                // Sides of a tie may be within each other and look the same way: each node is near the other side all
                // the same.
                let found = match found {
                    Err(apart @ ContactError::Apart { .. })
                        if self.is_tie() && !self.is_by_nodes() =>
                    {
                        let (own, met) = (nodes_of_facets(&facets), Met::Facets(&others));
                        let found = node_contact(body, &own, &facets, met, &options);
                        alike = found.is_ok();
                        found.map_err(|_| apart)
                    }
                    found => found,
                };
                (found, against, distance)
            }
            Against::Obstacle(obstacle) => {
                let name = format!("rigid {}", obstacle.name());
                let distance = options.distance_to(body, &facets, obstacle);
                options.search_distance = Some(distance);
                let found = match self.is_by_nodes() {
                    true => node_contact(body, &nodes, &facets, Met::Obstacle(obstacle), &options),
                    false => obstacle_contact(body, &facets, obstacle, &options),
                };
                (found, name, distance)
            }
        };
        let kind = match self.is_tie() {
            true => EntityKind::Tie,
            false => EntityKind::Contact,
        };
        let mut data = PairData {
            facets,
            others,
            walls: behind,
            itself: self.is_with_itself(),
            excluded,
            sectors: sectors.clone(),
            obstacle: match self.meets() {
                Against::Obstacle(obstacle) => Some(*obstacle),
                Against::Boundary(_) => None,
            },
            tresca: matches!(self.law, Law::Tresca(_)),
            tied: self.is_tie(),
            stiffness: self.stiffness.told(units),
            wear: self.wear.map_or(0.0, |wear| wear.coefficient),
            search_distance,
            unmet,
            alike,
            centres,
            sagitta,
            ..PairData::between(kind, &self.name, boundary, against, self.friction(units))
        };
        let found = match found {
            // Bodies may meet later, or other contacts have all that there is.
            Err(ContactError::Apart { .. })
                if large && data.slides() || !data.excluded.is_empty() =>
            {
                Ok(Vec::new())
            }
            found => found,
        };
        let found = found.map_err(|error| match error {
            ContactError::Apart { distance, nearest } if self.is_tie() && nearest > distance => {
                Fault::Stated(format!(
                    "no part of it faces the master boundary within {distance:.3e}; they are at least {nearest:.3e} apart: check the \
                     boundaries, or state adjust (POSITION TOLERANCE of a deck)"
                ))
            }
            error => Fault::Contact(error),
        })?;
        data.unmatched = sliding.off_beyond([&data.facets, &data.others], &found);
        if self.is_tie() && data.unmatched.is_some() {
            return Err(Fault::Stated(
                "it goes on beyond the sides of sectors whose meshes do not match there, which would be tied too firmly: mesh both sides of a \
                 sector alike where they meet the tie, or draw the sectors of both bodies between the same half-planes"
                    .to_owned(),
            ));
        }
        Ok((found, data))
    }
}

impl<const D: usize> Pair<D>
where
    ElementKind: Space<D>,
{
    /// The options of any search for its places, with its bound or coefficient and its stiffnesses as fields.
    fn options<'f>(
        &self,
        law: Field<'f, D>,
        [normal, tangential]: [Field<'f, D>; 2],
        sliding: &'f Sliding<D>,
    ) -> PairOptions<'f, D> {
        PairOptions {
            friction: self.law.of_fields(law),
            stiffness: [
                self.stiffness.both()[0].is_some().then_some(normal),
                self.stiffness.both()[1].is_some().then_some(tangential),
            ],
            edge_angle: self.edge_angle.unwrap_or(EDGE_ANGLE),
            symmetry: Some(&sliding.symmetry),
            seams: (!sliding.seams.is_empty()).then_some(&sliding.seams),
            held: Some(&sliding.held),
            ..PairOptions::default()
        }
    }

    /// The nodes of its own side.
    pub(super) fn own_nodes(&self, mesh: &Mesh<D>, data: &PairData<D>) -> Vec<u32> {
        match self.is_by_nodes() {
            true => nodes_of_sets(mesh, self.side()).unwrap_or_default(),
            false => nodes_of_facets(&data.facets),
        }
    }

    /// The contact places of two bodies that have moved, as those of `rest` have; none where they are farther from each other than a distance.
    /// Of a boundary that meets itself, `before` has the roles of facets ([`Itself`]).
    pub(super) fn meet_moved(
        &self,
        body: &Body<D>,
        data: &PairData<D>,
        rest: &Mesh<D>,
        sliding: &Sliding<D>,
        distance: f64,
        before: &[i32],
    ) -> Result<Vec<ContactPlace<D>>, ContactError> {
        let law = |x| self.law.at(x);
        let [normal, tangential] = (self.stiffness.both())
            .map(|stiffness| move |x| stiffness.map_or(f64::NAN, |k| k.at(x)));
        let options = PairOptions {
            search_distance: Some(distance),
            moves: true,
            rest: Some(rest),
            centres: data.centres.each_ref().map(Vec::as_slice),
            walls: &data.walls,
            sectors: data.sectors.as_ref(),
            itself: data.meets_itself().then_some(Itself {
                before,
                excluded: &data.excluded,
            }),
            ..self.options(&law, [&normal, &tangential], sliding)
        };
        let (facets, others) = (&data.facets, &data.others);
        let found = match self.is_by_nodes() {
            true => {
                let nodes = self.own_nodes(rest, data);
                node_contact(body, &nodes, facets, Met::Facets(others), &options)
            }
            false => mortar_contact(body, facets, others, &options).map(|found| found.places),
        };
        match found {
            Err(ContactError::Apart { .. }) => Ok(Vec::new()),
            found => found,
        }
    }
}

impl<const D: usize> Equal<D>
where
    ElementKind: Space<D>,
{
    /// Its sets of nodes.
    fn nodes(&self, mesh: &Mesh<D>) -> Result<Vec<Vec<u32>>, Fault> {
        let mut sets = Vec::new();
        for name in self.sets.all() {
            let is_boundary =
                mesh.boundaries.contains_key(name) && !mesh.node_sets.contains_key(name);
            let names = Names::from(name);
            let target = match is_boundary {
                true => Target::Boundary(&names),
                false => Target::Nodes(&names),
            };
            let nodes = target.nodes(mesh)?;
            if nodes.len() < 2 {
                let text =
                    format!("the set of nodes \"{name}\" has one node: it needs at least two");
                return Err(Fault::Stated(text));
            }
            sets.push(nodes);
        }
        Ok(sets)
    }

    /// Its places.
    fn find(&self, body: &Body<D>) -> Result<Found<D>, Fault> {
        let sets = self.nodes(body.mesh)?;
        let law = format!("equal along {}", self.directions());
        let data = PairData {
            tied: true,
            ..PairData::between(
                EntityKind::Equal,
                &self.name,
                self.title(),
                "each other".to_owned(),
                law,
            )
        };
        Ok((equal_nodes(body, &sets, self.bound), data))
    }
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// The directions along which supports hold nodes, or along which they move alike with others: orthonormal.
    fn held_directions(
        &self,
        mesh: &Mesh<D>,
        unknowns: &Unknowns<D>,
    ) -> Result<Directions<D>, ModelError> {
        let mut held: Directions<D> = HashMap::new();
        for node in 0..mesh.nodes.len() as u32 {
            for (c, value) in unknowns.prescribed(node).iter().enumerate() {
                if value.is_some() {
                    let frame = unknowns.frame(node);
                    let way = frame.map_or_else(|| Way::Axis(c).vector(), |frame| frame[c]);
                    held.entry(node).or_default().push(way);
                }
            }
        }
        for (number, equal) in self.equals.iter().enumerate() {
            let number = self.pairs.len() + self.ties.len() + number;
            let sets = equal.nodes(mesh);
            let sets = sets.map_err(|fault| self.pair_entity(number).error(fault))?;
            for node in sets.into_iter().flatten() {
                for axis in (0..D).filter(|&axis| equal.bound[axis]) {
                    let ways = held.entry(node).or_default();
                    extended(ways, Way::Axis(axis).vector(), SAME);
                }
            }
        }
        Ok(held)
    }

    /// Where the boundaries of contacts go on beyond the sides of sectors, and the bodies that repeat themselves.
    fn seams(
        &self,
        mesh: &Mesh<D>,
        body_of: &[u32],
    ) -> Result<(Seams<D>, Vec<Repeated<D>>), ModelError> {
        let (mut seams, mut rings) = (Seams::new(), Vec::new());
        let mut nodes = HashSet::new();
        let pairs = self.pairs.iter().enumerate();
        for (i, pair) in pairs.chain(self.ties.iter().enumerate()) {
            let of_pair = [Some(pair.side()), pair.meets().boundary()];
            for names in of_pair
                .into_iter()
                .flatten()
                .filter(|_| !self.cyclics.is_empty())
            {
                let facets = outer_facets(mesh, names.all());
                let facets = facets.map_err(|fault| pair.entity(i).error(fault))?;
                nodes.extend(facets.iter().flat_map(facet_nodes));
            }
        }
        for (i, cyclic) in self.cyclics.iter().enumerate() {
            let found = cyclic.repeat(mesh, &nodes, body_of, &mut seams, &mut rings);
            found.map_err(|fault| cyclic.entity(i).error(fault))?;
        }
        Ok((seams, rings))
    }

    /// The contact places of all contacts.
    pub(super) fn candidates(
        &self,
        body: &Body<D>,
        unknowns: &Unknowns<D>,
    ) -> Result<Candidates<D>, ModelError> {
        let units = self.units();
        let (count, body_of) = body.mesh.bodies();
        let (seams, rings) = self.seams(body.mesh, &body_of)?;
        let sliding = Sliding {
            symmetry: self.symmetry_planes(body.mesh)?,
            held: self.held_directions(body.mesh, unknowns)?,
            seams,
            rings,
            surfaces: match self.is_large() {
                true => surfaces(body.mesh, count, &body_of),
                false => Vec::new(),
            },
            body_of,
            stated: HashMap::new(),
        };
        let (mut places_of_all, mut pair_of, mut data_of_all) =
            (Vec::new(), Vec::new(), Vec::new());
        let all = self.pairs.iter().chain(&self.ties);
        let pairs = (all.clone())
            .map(|pair| pair.find(body, &units, &sliding, self.is_large(), all.clone()));
        let equals = self.equals.iter().map(|equal| equal.find(body));
        let springs = (self.springs.iter()).map(|spring| spring.find(body, &units));
        let preloads = self.preloads.iter().zip(&self.sections);
        let preloads = preloads.map(|(one, section)| Ok(one.find(body.mesh, section, &units)));
        let coupled = self.coupled(body)?;
        let couplings = self.couplings.iter().zip(&coupled);
        let couplings = couplings.map(|(one, coupled)| one.find(body, coupled, &units));
        let cyclics = (self.cyclics.iter()).map(|cyclic| cyclic.find(body, &sliding.held));
        let equations = (self.equations.iter()).map(|equation| equation.find(body, &units));
        let changing = self.supports.iter().filter(|support| support.changes());
        let changing = changing.map(|support| support.find(body));
        let found = pairs.chain(equals).chain(springs);
        let found = found.chain(preloads).chain(couplings).chain(cyclics);
        let found = found.chain(equations).chain(changing);
        let parts = self.connections().map(|(number, _)| number);
        for ((number, found), of_kind) in found.enumerate().zip(parts) {
            let (mut places, mut data) =
                found.map_err(|fault| self.pair_entity(number).error(fault))?;
            data.number = of_kind;
            let before = places_of_all.len() as u32;
            places.iter_mut().for_each(|place| place.pool += before);
            pair_of.extend(places.iter().map(|_| number as u32));
            places_of_all.extend(places);
            data_of_all.push(data);
        }
        for (of, coupled) in self.obstacles_of()?.iter().zip(&coupled) {
            let places = pair_of.iter().zip(&mut places_of_all);
            let carried = places.filter(|(pair, _)| of.contains(pair));
            carried.for_each(|(_, place)| coupled.carry(place, unknowns));
        }
        Ok(Candidates {
            places: places_of_all,
            pair_of,
            pairs: data_of_all,
            sliding,
        })
    }

    /// Completes the data of the contacts with their remaining places; `is_met` has those that have had any.
    pub(super) fn count_places(
        &self,
        mesh: &Mesh<D>,
        contact: &ContactRows<D>,
        pair_of: &[u32],
        is_met: &HashSet<u32>,
        pairs: &mut [PairData<D>],
    ) -> Result<(), ModelError> {
        for (i, (place, &pair)) in contact.places.iter().zip(pair_of).enumerate() {
            let pair = &mut pairs[pair as usize];
            pair.places += 1;
            pair.within += usize::from(place.gap <= pair.search_distance);
            pair.kept += usize::from(contact.keeps_from_sliding(i));
            pair.area += place.area;
            pair.gap = [pair.gap[0].min(place.gap), pair.gap[1].max(place.gap)];
        }
        for (number, data) in pairs.iter_mut().enumerate() {
            let as_drawn = (self.pairs.get(number)).is_some_and(Pair::has_gap_of_meshes);
            let as_drawn = as_drawn && data.obstacle.is_none() && data.centres[0].is_empty();
            if as_drawn && !data.meets_itself() && data.places > 0 {
                data.arcs = between_arcs(mesh, [&data.facets, &data.others], data.gap);
            }
        }
        // Bodies that meet later have had no places.
        let is_idle =
            |number: usize| is_met.contains(&(number as u32)) && pairs[number].places == 0;
        match (0..pairs.len()).find(|&number| is_idle(number)) {
            None => Ok(()),
            Some(pair) => Err(self
                .pair_entity(pair)
                .error("supports hold every node of it and of the other side")),
        }
    }

    /// A part of the model with rows of contact, by its number among all such parts.
    fn pair_entity(&self, number: usize) -> Entity {
        let (number, part) = (self.connections().nth(number)).expect("rows belong to a part");
        part.entity(number)
    }

    /// The equation at a place whose terms are all held, among all connections.
    fn held_equation(
        &self,
        contact: &ContactRows<D>,
        pair_of: &[u32],
        place: &Location,
    ) -> Option<usize> {
        let found = contact.numbered().find(|&(row, _, at)| {
            let kind = self.pair_entity(pair_of[row] as usize).kind;
            let is_held = contact.normal.row(row).0.is_empty();
            kind == EntityKind::Equation && is_held && Location::from(at.place) == *place
        });
        found.map(|(row, ..)| pair_of[row] as usize)
    }

    /// Checks that apply to all load steps before the first, with the prescribed displacements `first`: supports that
    /// contradict each other, or drive fixed nodes into the other side.
    pub(super) fn foresee(
        &self,
        mesh: &Mesh<D>,
        prescriptions: &Prescriptions<D>,
        first: &Unknowns<D>,
        contact: &ContactRows<D>,
        (pairs, pair_of): (&[PairData<D>], &[u32]),
        of_candidates: &[u32],
    ) -> Result<(), ModelError> {
        let mut seen = HashSet::new();
        for step in 0..self.n_steps() {
            let factors = (self.supports.iter().map(|s| &s.factors))
                .chain(self.couplings.iter().map(|c| c.load_factors()))
                .chain(self.preloads.iter().map(|p| p.load_factors()))
                .chain(self.equations.iter().map(|e| e.load_factors()))
                .map(|factors| self.factor(factors, end_of(step)).to_bits());
            let states = (self.supports.iter())
                .map(|support| u64::from(support.acts(step)) + 2 * u64::from(support.locks(step)));
            let acting = (self.pairs.iter()).map(|pair| u64::from(pair.acts(step)));
            // The locked displacements depend on the step before.
            let locks = self.supports.iter().any(|support| support.locks(step));
            let key = factors
                .chain(states)
                .chain(acting)
                .chain(locks.then_some(step as u64));
            if !seen.insert(key.collect::<Vec<u64>>()) {
                continue;
            }
            let later;
            let unknowns = match step {
                0 => first,
                _ => {
                    later = self.unknowns(mesh, prescriptions, end_of(step))?;
                    &later
                }
            };
            let driven = self.driven(pairs, pair_of, end_of(step));
            // One that is locked has the motion that supports have prescribed before.
            let before = match step.checked_sub(1).filter(|_| locks) {
                Some(before) => {
                    let before = self.unknowns(mesh, prescriptions, end_of(before))?;
                    contact.held_motion(&before).0
                }
                None => Vec::new(),
            };
            let motion = |driven: &Driven| match before.get(driven.row) {
                Some(before) if driven.locked => Some(*before),
                _ => driven.motion,
            };
            let driven: HashMap<usize, Option<f64>> = driven
                .iter()
                .map(|driven| (driven.row, motion(driven)))
                .collect();
            let stated = |row: usize| driven.get(&row).copied().unwrap_or(Some(0.0));
            let acts = |candidate: usize| {
                let pair = self.pairs.get(of_candidates[candidate] as usize);
                pair.is_none_or(|pair| pair.acts(step))
            };
            let Err(error) = contact.check_stated(unknowns, acts, stated) else {
                continue;
            };
            if let ContactError::DrivenApart { place, apart } = &error
                && let Some(number) = self.held_equation(contact, pair_of, place)
            {
                let step = match self.n_steps() {
                    1 => String::new(),
                    _ => format!("in load step {} ", step + 1),
                };
                return Err(self.pair_entity(number).error(format!(
                    "{step}supports hold all of its terms at {place}, and their sum differs by {apart:.3e} from its value: change the value, \
                     or free a node"
                )));
            }
            // The support that moves the node most.
            let by = |&(node, c, _): &(u32, usize, usize)| {
                unknowns.prescribed(node)[c].unwrap_or(0.0).abs()
            };
            let driving = match &error {
                ContactError::Driven { place, .. }
                | ContactError::DrivenApart { place, .. }
                | ContactError::DrivenAlong { place } => (prescriptions.held().into_iter())
                    .filter(|(node, ..)| place.0 == mesh.nodes[*node as usize])
                    .max_by(|a, b| by(a).total_cmp(&by(b))),
                _ => None,
            };
            let entity = match driving {
                Some((_, _, number)) => self.supports[number].entity(number),
                None => Entity::all(EntityKind::Support),
            };
            return Err(match self.n_steps() {
                1 => entity.error(Fault::Contact(error)),
                _ => entity.error(format!("load step {}: {error}", step + 1)),
            });
        }
        Ok(())
    }
}
