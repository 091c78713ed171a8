//! A boundary that meets itself, or several of which each may meet any other: the facets that carry multipliers, and
//! those that they meet.
//!
//! Each facet looks for the nearest ones opposite. Of two that are opposite each other one carries the multipliers: a
//! graph of facets is coloured with two colours. Where that is impossible, as where three parts meet in one point, the
//! pair that is farther apart does not meet. Neighbours on a smooth surface have one colour if nothing nearer than
//! their size is against it. From one configuration to the next facets keep their colours where these are still possible.

use super::surface::Surface;
use super::{ContactError, Cover, FACING, MasterFacet, Mortar, PairOptions, Search, SlaveFacet};
use crate::contact::held_across;
use crate::contact::nodes::depth_within;
use crate::elasticity::Body;
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{
    ElementKind, Facet, Groups, Mesh, Topology, facet_corners, facet_nodes, unsided,
};
use rayon::prelude::*;
use std::collections::{BTreeMap, HashMap};

/// What is known of a boundary that meets itself before its places are found.
#[derive(Clone, Copy, Debug)]
pub struct Itself<'a> {
    /// Above 0 where a facet had multipliers in the configuration before, below 0 where it was met; may be empty.
    pub before: &'a [i32],
    /// The sides of exclusions that each facet is on; may be empty.
    pub excluded: &'a [Vec<Excluded>],
}

/// The number of an exclusion, and one of its two sides: facets of either do not meet those of the other.
pub type Excluded = (u32, bool);

/// Whether two facets are on the two sides of an exclusion; `all` has those of each facet, or nothing.
pub(crate) fn are_excluded(all: &[Vec<Excluded>], facets: [usize; 2]) -> bool {
    let [a, b] = facets.map(|k| all.get(k).map_or(&[][..], Vec::as_slice));
    a.iter().any(|(number, side)| b.contains(&(*number, !side)))
}

/// The body behind a facet, at rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall<const D: usize> {
    /// The middle of the facet, and its outward unit normal.
    middle: [f64; D],
    normal: [f64; D],
    /// The extent of the facet.
    size: f64,
    /// How thick the body is there; infinite where that is more than the search distance.
    thickness: f64,
}

/// A side that the body behind another one has come to within this part of its thickness around the point behind the latter at rest
/// is the other side of the same wall, whatever it has been sheared by.
const BEHIND: f64 = 0.5;
/// Overlaps are looked at if they are deeper than this part of a facet.
pub(super) const SHALLOW: f64 = 0.1;
/// An overlap with another body is with the side through which it has come in only if the way of both out of each other is at least this
/// part of it.
const WAY_OUT: f64 = 0.25;
/// What is deeper in a wall than this part of the thinner one's thickness is behind it.
const DEEPEST: f64 = 0.9;

impl<const D: usize> Wall<D> {
    /// Whether the facet of another one is the other side of this wall.
    fn ends_at(&self, other: &Self) -> bool {
        let to = minus(self.middle, other.middle);
        let depth = dot(to, self.normal);
        let aside: [f64; D] = std::array::from_fn(|c| to[c] - depth * self.normal[c]);
        let some = BEHIND * self.thickness;
        self.thickness.is_finite()
            && (depth - self.thickness).abs() < some
            && length(aside) < some + self.size + other.size
    }

    /// After a turn of places and vectors.
    pub(in super::super) fn turned(
        &self,
        places: impl Fn([f64; D]) -> [f64; D],
        vectors: impl Fn([f64; D]) -> [f64; D],
    ) -> Self {
        Self {
            middle: places(self.middle),
            normal: vectors(self.normal),
            ..*self
        }
    }

    /// Whether this facet and another one are the two sides of a wall.
    pub(in super::super) fn is_between(&self, other: &Self) -> bool {
        self.ends_at(other) || other.ends_at(self)
    }
}

impl Itself<'_> {
    /// Those of the facets `near` that one of the boundary may meet: they have no node in common, and are not the other side of
    /// its wall. Those that it must not meet are in the way of what is behind them.
    pub(super) fn may_meet<const D: usize>(
        &self,
        facets: &[Facet<D>],
        walls: &[Wall<D>],
        number: usize,
        near: &mut Vec<MasterFacet<D>>,
    ) where
        ElementKind: Topology<D>,
    {
        let (own, wall) = (facet_nodes(&facets[number]), &walls[number]);
        near.retain_mut(|other| {
            let across = &walls[other.number];
            other.deepest = DEEPEST * wall.thickness.min(across.thickness);
            other.is_first = true;
            other.hides = are_excluded(self.excluded, [number, other.number]);
            !wall.is_between(across) && !other.nodes().iter().any(|node| own.contains(node))
        });
    }

    /// Whether each facet of a boundary carries multipliers, and with which others its overlaps end sooner than their walls: these,
    /// each with its deepest overlap.
    pub(super) fn carriers<'s, const D: usize>(
        &self,
        body: &Body<D>,
        surface: &Surface<D>,
        search: &Search<D>,
        distance: f64,
        options: &PairOptions<D>,
        behind: &(impl Fn() -> Option<&'s Behind<'s, D>> + Sync),
    ) -> (Vec<bool>, Vec<Vec<(usize, f64)>>)
    where
        ElementKind: Mortar<D>,
    {
        let mesh = body.mesh;
        let facets = surface.facets;
        let all = 0..facets.len();
        // Pairs that are opposite each other, with their distances.
        type Pairs = Vec<(f64, [usize; 2], bool)>;
        let (mut pairs, limits): (Vec<Pairs>, Vec<_>) = (all.clone().into_par_iter())
            .map(|number| {
                let slave = SlaveFacet::new(body, surface, number);
                let mut near = surface.near(mesh, search, &slave, distance);
                self.may_meet(facets, options.walls, number, &mut near);
                let mut covers = <ElementKind as Mortar<D>>::covers(&slave, &near, distance);
                let mut limits = Vec::new();
                if deepest(&covers) > SHALLOW * slave.size()
                    && let Some(behind) = behind()
                {
                    let walls: Vec<f64> = near.iter().map(|other| other.deepest).collect();
                    behind.leave_out(&slave, &facets[number], &mut near, distance);
                    let changed = near
                        .iter()
                        .zip(walls)
                        .filter(|(other, wall)| other.deepest < *wall);
                    limits.extend(changed.map(|(other, _)| (other.number, other.deepest)));
                    if !limits.is_empty() {
                        covers = <ElementKind as Mortar<D>>::covers(&slave, &near, distance);
                    }
                }
                let mut least: HashMap<usize, f64> = HashMap::new();
                let points = covers.iter().flat_map(|cover| &cover.points);
                for point in points.filter(|point| point.distance.is_finite()) {
                    let least = least
                        .entry(near[point.other].number)
                        .or_insert(f64::INFINITY);
                    *least = least.min(point.distance);
                }
                let pair =
                    |(other, distance)| (distance, [number.min(other), number.max(other)], true);
                (least.into_iter().map(pair).collect::<Pairs>(), limits)
            })
            .unzip();
        let mut pairs: Pairs = pairs.drain(..).flatten().collect();
        let mut meets = vec![false; facets.len()];
        pairs
            .iter()
            .for_each(|pair| pair.1.iter().for_each(|&k| meets[k] = true));
        let mut beside: HashMap<(u32, u32), usize> = HashMap::new();
        for number in all.clone().filter(|&number| meets[number]) {
            let (corners, len) = mesh.corners_of(&facets[number]);
            let size = length(minus(corners[0], corners[len - 1]));
            for &node in facet_corners(&facets[number]) {
                if let Some(other) = beside.insert((node, surface.part[number]), number) {
                    pairs.push((size, [other, number], false));
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        // The statements "facet k carries multipliers" and, at n + k, "it does not": those that follow from each other are one group.
        let n = facets.len() as u32;
        let mut groups = Groups::new(2 * facets.len());
        for (_, [a, b], opposite) in pairs {
            let (a, b) = (a as u32, b as u32);
            let (like, unlike) = match opposite {
                true => (b + n, b),
                false => (b, b + n),
            };
            if groups.of(a) != groups.of(unlike) {
                groups.join(a, like);
                groups.join(a + n, unlike);
            }
        }
        // In favour of each group: what was before, what can give way, the finer side, and the first facet.
        let mut favour = vec![(0, 0, 0, 0); 2 * facets.len()];
        for (number, facet) in facets.iter().enumerate() {
            let before = self.before.get(number).copied().unwrap_or(0);
            let normal = surface.outward[number];
            let held = (options.held).is_some_and(|held| held_across(facet, normal, held));
            let [own, met] = [0, n].map(|k| groups.of(number as u32 + k) as usize);
            for (group, sign) in [(own, 1), (met, -1)] {
                let sum = &mut favour[group];
                sum.0 += sign * before;
                sum.1 -= sign * i32::from(held);
                sum.2 += sign;
                if sum.3 == 0 {
                    sum.3 = sign;
                }
            }
        }
        let carries = |k: usize| {
            let [own, met] = [0, n].map(|side| favour[groups.of(k as u32 + side) as usize]);
            meets[k] && own > met
        };
        (all.map(carries).collect(), limits)
    }
}

/// What is behind the facets of a boundary, or of two that may have the sides of one wall, within a distance on the body at rest.
///
/// # Errors
/// If it turns back on itself within a smooth part.
pub fn walls<const D: usize>(
    body: &Body<D>,
    facets: &[Facet<D>],
    distance: f64,
    options: &PairOptions<D>,
) -> Result<Vec<Wall<D>>, ContactError>
where
    ElementKind: Mortar<D>,
{
    let mesh = body.mesh;
    let surface = Surface::new(mesh, facets, &body.depths(), options, &[])?;
    let behind = Behind::new(body, &surface);
    // Sides that overlap in the drawing are nearer than the element between them.
    let heights = heights(mesh, &surface);
    let of_facet = |number: usize| {
        let middle = mesh.facet_middle(&facets[number]);
        let (corners, len) = mesh.corners_of(&facets[number]);
        let to_corner = corners[..len].iter().map(|x| length(minus(*x, middle)));
        Wall {
            middle,
            normal: surface.outward[number],
            size: to_corner.fold(0.0, f64::max),
            thickness: behind.thickness(&surface, number, 0.5 * heights[number], distance),
        }
    };
    Ok((0..facets.len()).into_par_iter().map(of_facet).collect())
}

/// A boundary that limits bodies, for what is behind their facets.
pub(super) struct Behind<'s, const D: usize>
where
    ElementKind: Topology<D>,
{
    body: &'s Body<'s, D>,
    surface: &'s Surface<'s, D>,
    search: Search<D>,
    body_of: Vec<u32>,
}

impl<'s, const D: usize> Behind<'s, D>
where
    ElementKind: Mortar<D>,
{
    pub fn new(body: &'s Body<'s, D>, surface: &'s Surface<'s, D>) -> Self {
        Self {
            search: Search::new(body.mesh, surface.facets),
            body_of: body.mesh.bodies().1,
            body,
            surface,
        }
    }

    /// How thick the body is behind a facet of a surface, if that is more than `least`; infinite where it is more than a distance.
    fn thickness(&self, of: &Surface<D>, number: usize, least: f64, distance: f64) -> f64 {
        let slave = SlaveFacet::new(self.body, of, number);
        let body_of = |nodes: &[u32]| self.body_of[nodes[0] as usize];
        let here = body_of(facet_nodes(&of.facets[number]));
        let near = (self.surface).near(self.body.mesh, &self.search, &slave, distance);
        let behind = near.iter().filter(|other| body_of(other.nodes()) == here);
        let depths = behind.flat_map(|other| {
            let covers = <ElementKind as Mortar<D>>::covers(&slave, &[*other], distance);
            let points = covers.into_iter().flat_map(|cover| cover.points);
            points.map(|point| -point.distance).collect::<Vec<_>>()
        });
        let depths = depths.filter(|&depth| depth > least);
        depths.fold(f64::INFINITY, f64::min)
    }

    /// How far an overlap with a facet of a surface may reach: to the wall behind it or, of a round one, to where its normals meet.
    fn deepest(&self, of: &Surface<D>, number: usize, distance: f64) -> f64 {
        let facet = SlaveFacet::new(self.body, of, number);
        let (places, normals) = (facet.places(), &facet.normals);
        let mut roundest = 0.0_f64;
        for (a, x) in places.iter().enumerate() {
            for (b, y) in places[..a].iter().enumerate() {
                let to = minus(*x, *y);
                let bend = dot(minus(normals[a], normals[b]), to) / dot(to, to);
                roundest = roundest.max(bend);
            }
        }
        let thickness = self.thickness(of, number, 0.0, distance);
        thickness.min(roundest.recip())
    }

    /// Leaves out overlaps of a facet with others where the two bodies have a much shorter way out of each other, from the facet and from
    /// halfway to the other one: what is opposite there is another side.
    pub fn leave_out(
        &self,
        slave: &SlaveFacet<D>,
        own: &Facet<D>,
        near: &mut [MasterFacet<D>],
        distance: f64,
    ) {
        let body_of = |nodes: &[u32]| self.body_of[nodes[0] as usize];
        let here = body_of(facet_nodes(own));
        // Where one is left out, another may be behind it.
        for _ in 0..near.len() {
            // The weight of what overlaps, and the sums of its places and depths.
            let mut met: BTreeMap<usize, (f64, [f64; D], f64)> = BTreeMap::new();
            for cover in <ElementKind as Mortar<D>>::covers(slave, near, distance) {
                let overlaps = cover.points.iter().filter(|point| point.distance < 0.0);
                for point in overlaps.filter(|point| body_of(near[point.other].nodes()) != here) {
                    let sums = met.entry(point.other).or_insert((0.0, [0.0; D], 0.0));
                    sums.0 += point.weight;
                    (0..D).for_each(|c| sums.1[c] += point.weight * point.place[c]);
                    sums.2 -= point.weight * point.distance;
                }
            }
            let (mesh, all) = (self.body.mesh, self.surface.facets);
            let mut is_left_out = false;
            for (other, (weight, places, depths)) in met.into_iter().filter(|one| one.1.0 > 0.0) {
                let (x, depth) = (places.map(|sum| sum / weight), depths / weight);
                let there = body_of(near[other].nodes());
                let of = |body: u32, facet: &Facet<D>| body_of(facet_nodes(facet)) == body;
                let most = WAY_OUT * depth;
                let way_out = |x: [f64; D]| {
                    depth_within(mesh, &self.search, all, x, depth, |number| {
                        of(there, &all[number])
                    })
                };
                // The other body leaves through this side, and its own the opposite way.
                let is_short = |x: [f64; D], out: Option<(f64, [f64; D])>| {
                    out.is_some_and(|(out, through)| {
                        let faces = |number: usize| {
                            let facet = &all[number];
                            of(here, facet) && dot(mesh.facet_normal(facet).1, through) < FACING
                        };
                        let back = || depth_within(mesh, &self.search, all, x, most, faces);
                        out < 0.0 || out < most && back().is_some_and(|to| out + to.0.abs() < most)
                    })
                };
                let out = way_out(x);
                let is_outside = out.is_some_and(|(out, _)| out < 0.0);
                let halfway = std::array::from_fn(|c| x[c] - 0.5 * depth * slave.normal[c]);
                if is_outside || is_short(x, out) && is_short(halfway, way_out(halfway)) {
                    near[other].deepest = most;
                    is_left_out = true;
                }
            }
            if !is_left_out {
                return;
            }
        }
    }

    /// Limits overlaps of a facet of the first surface with some of the second to what is possible on both sides.
    pub fn limit(
        &self,
        [first, second]: [&Surface<D>; 2],
        number: usize,
        near: &mut [MasterFacet<D>],
        distance: f64,
    ) {
        let own = self.deepest(first, number, distance);
        for other in near {
            let most = own.min(self.deepest(second, other.number, distance));
            other.deepest = other.deepest.min(DEEPEST * most);
        }
    }
}

/// The deepest overlap of covered parts.
fn deepest<const D: usize>(covers: &[Cover<D>]) -> f64 {
    let points = covers.iter().flat_map(|cover| &cover.points);
    let depths = points.map(|point| -point.distance);
    depths.filter(|depth| depth.is_finite()).fold(0.0, f64::max)
}

/// How far the element behind each facet reaches.
fn heights<const D: usize>(mesh: &Mesh<D>, surface: &Surface<D>) -> Vec<f64>
where
    ElementKind: Mortar<D>,
{
    let numbered = surface.facets.iter().enumerate();
    let numbers: HashMap<_, _> = numbered.map(|(k, facet)| (unsided(facet), k)).collect();
    let mut heights = vec![0.0; surface.facets.len()];
    for element in &mesh.elements {
        for facet in element.facets() {
            let Some(&number) = numbers.get(&unsided(&facet)) else {
                continue;
            };
            let middle = mesh.facet_middle(&facet);
            let depth = |node: &u32| {
                dot(
                    surface.outward[number],
                    minus(middle, mesh.nodes[*node as usize]),
                )
            };
            heights[number] = element.nodes().iter().map(depth).fold(0.0, f64::max);
        }
    }
    heights
}
