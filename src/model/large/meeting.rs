//! The contact places of bodies that have moved: distances, normals and slip, and the data that they carry over from
//! before.
//!
//! A place on an obstacle stays the same. Where two bodies meet, places are made again from both boundaries as they
//! are. Those that are nearest to each other on the body at rest carry forces and slip from one configuration to the
//! next. Slip is measured between the nodes of a place and those that were opposite to them at the end of the last load
//! step; where none were, between those that are opposite now. So bodies that turn together do not slip.

use super::super::contacts::PairData;
use super::super::driven::Driven;
use super::super::elastic::Elastic;
use super::super::entities::Part as _;
use super::super::error::{EntityKind, Fault, ModelError};
use super::super::motion::Moved;
use super::super::spring::Spring;
use super::{Deformation, Moment};
use crate::contact::{
    ContactError, ContactPlace, Excluded, Met, Obstacle, PairOptions, SlipBound, Space,
    are_excluded, areas, crosses_itself, enclosed, frame, node_contact, nodes_around, shares,
};
use crate::elasticity::Body;
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{ElementKind, Facet, Mesh, bounds, facet_nodes};
use crate::rigid::Rotation;
use crate::rounding::ROUNDING;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::array::from_fn;
use std::cell::LazyCell;
use std::collections::{BTreeSet, HashMap};

/// v after the turn that takes one unit vector to another by the shortest way.
pub(crate) fn turned_with<const D: usize>(v: [f64; D], from: [f64; D], to: [f64; D]) -> [f64; D] {
    // Two reflections, v ↦ v − 2 n (n·v): in the plane across `from`, then in the plane across the bisector of both.
    let half: [f64; D] = from_fn(|c| from[c] + to[c]);
    let size = dot(half, half);
    if !(size > 1e-12) {
        return v.map(|v| -v);
    }
    let along = 2.0 * dot(v, from);
    let mirrored: [f64; D] = from_fn(|c| v[c] - along * from[c]);
    // −(I − 2hhᵀ/h²)(I − 2 from fromᵀ) takes `from` to `to` and keeps the directions across both.
    let part = 2.0 * dot(mirrored, half) / size;
    from_fn(|c| mirrored[c] - part * half[c])
}

/// A contact place of bodies that have moved.
#[derive(Clone, Debug)]
pub(crate) struct Touch<const D: usize> {
    pub pair: u32,
    pub place: ContactPlace<D>,
    /// Where its own side was at rest.
    rest: [f64; D],
    /// The force on the other side, along the axes.
    pub force: [f64; D],
    /// The same at the end of the last load step.
    pub origin: [f64; D],
    /// The slip since then, and all before.
    pub slip: [f64; D],
    pub slipped: [f64; D],
    /// The slip in this load step, up to the end of its last part.
    pub so_far: [f64; D],
    /// From the obstacle or the other body; of ties 0; of a row that is driven, the motion that is stated (0 if none), less that so far.
    pub distance: f64,
    /// What a row that is driven measures so far.
    pub measured: f64,
    /// Whether it does not act.
    pub idle: bool,
    /// Where its nodes are opposite on the obstacle.
    feet: Vec<[f64; D]>,
    /// From the mean of its partners to that of its own nodes.
    apart: [f64; D],
}

impl<const D: usize> Touch<D> {
    fn normal(&self) -> [f64; D] {
        self.place.frame[0]
    }

    /// What it has in common with another one of the same place: first a node of its side, then the smooth part of its boundary, then a
    /// node that it meets, then the normal.
    fn likeness(&self, other: &Self) -> (bool, bool, bool, f64) {
        let share = |a: &[(u32, f64)], b: &[(u32, f64)]| {
            a.iter().any(|of| b.iter().any(|other| of.0 == other.0))
        };
        let (own, there) = (&self.place, &other.place);
        (
            share(&own.own, &there.own),
            own.part == there.part,
            share(&own.partners, &there.partners),
            dot(self.normal(), other.normal()),
        )
    }

    /// The force with these directions for its own.
    fn force_along(&self, frame: &[[f64; D]; D]) -> [f64; D] {
        let mut force = [0.0; D];
        for (own, way) in self.place.frame.iter().zip(frame) {
            let along = dot(self.force, *own);
            (0..D).for_each(|c| force[c] += along * way[c]);
        }
        force
    }

    /// Whether it has forces or slip to hand on.
    fn bears(&self) -> bool {
        [self.force, self.slipped, self.so_far] != [[0.0; D]; 3]
    }

    /// As the next part of a load step begins from it, with the force at the end of this one and the slip in it.
    pub fn settled(&self, force: [f64; D], slip: [f64; D]) -> Self {
        Self {
            force,
            so_far: from_fn(|c| self.so_far[c] + slip[c]),
            slipped: from_fn(|c| self.slipped[c] + self.slip[c]),
            slip: [0.0; D],
            ..self.clone()
        }
    }

    /// A force with its friction within Coulomb's law; None if it pulls.
    pub fn within_law(&self, force: [f64; D]) -> Option<[f64; D]> {
        let nu = self.normal();
        let pressing = dot(force, nu);
        let along: [f64; D] = from_fn(|c| force[c] - pressing * nu[c]);
        let part = match self.place.slip_bound {
            SlipBound::Coulomb(mu) if mu * pressing < length(along) => {
                mu * pressing / length(along)
            }
            _ => 1.0,
        };
        (pressing >= 0.0).then(|| from_fn(|c| pressing * nu[c] + part * along[c]))
    }

    /// Takes over from the place that it was in the configuration before, and from that at the end of the last load step, whose sides
    /// have turned since then.
    fn carries(&mut self, now: Option<&Self>, before: Option<&Self>, turns: &[Rotation<D>]) {
        let to = self.normal();
        self.force = now.map_or([0.0; D], |from| turned_with(from.force, from.normal(), to));
        let turned = |v: [f64; D]| {
            let from = before.map_or(to, Self::normal);
            if turns.is_empty() {
                return turned_with(v, from, to);
            }
            // Half way between both sides, and as long as before.
            let all = turns
                .iter()
                .map(|turn| turned_with(turn.of(v), turn.of(from), to));
            let sum = all.fold([0.0; D], |sum, v| from_fn(|c| sum[c] + v[c]));
            let [size, long] = [length(sum), length(v)];
            match size > 0.0 {
                true => sum.map(|c| c * (long / size)),
                false => sum,
            }
        };
        self.origin = before.map_or([0.0; D], |from| turned(from.force));
        self.slipped = before.map_or([0.0; D], |from| turned(from.slipped));
        self.so_far = before.map_or([0.0; D], |from| turned(from.so_far));
    }
}

/// The contact places at a configuration.
pub(super) struct Meeting<const D: usize> {
    pub touches: Vec<Touch<D>>,
    /// For each place, the number of the one that it was in the configuration before.
    pub from: Vec<Option<usize>>,
    pub bends: Vec<Bend<D>>,
    /// Whether the places are those of the configuration before.
    pub is_alike: bool,
    /// Above all pools at rest.
    pools: u32,
}

/// A node of a place and its obstacle: along a round obstacle the contact force turns as the node moves.
pub(super) struct Bend<const D: usize> {
    /// The number of its place.
    pub touch: usize,
    pub node: u32,
    /// Of the node in its place.
    pub weight: f64,
    pub obstacle: Obstacle<D>,
    /// Where the node is.
    pub place: [f64; D],
}

/// The distance from an obstacle, the direction towards it, and the point of it that is opposite.
fn foot<const D: usize>(obstacle: &Obstacle<D>, x: [f64; D]) -> (f64, [f64; D], [f64; D]) {
    let (distance, normal) = obstacle.distance(x);
    (distance, normal, from_fn(|c| x[c] + distance * normal[c]))
}

/// The number of the first place of a pair; places are in the order of pairs.
fn first_of<const D: usize>(touches: &[Touch<D>], pair: u32) -> usize {
    touches.partition_point(|touch| touch.pair < pair)
}

/// The places of a pair.
pub(super) fn of_pair<const D: usize>(touches: &[Touch<D>], pair: u32) -> &[Touch<D>] {
    &touches[first_of(touches, pair)..first_of(touches, pair + 1)]
}

/// Places nearer to each other than this part of the size of all are at one point.
const ONE_POINT: f64 = 1e-9;

/// Places of a pair, by where they were at rest.
struct Earlier<'t, const D: usize> {
    touches: &'t [Touch<D>],
    /// The body of each node.
    body_of: &'t [u32],
    tree: RTree<GeomWithData<[f64; D], usize>>,
    /// Points are one up to this distance.
    same: f64,
}

impl<'t, const D: usize> Earlier<'t, D> {
    fn new(touches: &'t [Touch<D>], body_of: &'t [u32]) -> Self {
        let all = touches.iter().enumerate();
        let all = all.map(|(i, touch)| GeomWithData::new(touch.rest, i));
        let (low, high) = bounds(touches.iter().map(|touch| touch.rest));
        let size = length(minus(high, low));
        let far = touches.iter().flat_map(|touch| touch.rest);
        let far = far.fold(0.0, |most: f64, x| most.max(x.abs()));
        Self {
            touches,
            body_of,
            tree: RTree::bulk_load(all.collect()),
            same: (ONE_POINT * size).max(ROUNDING * far),
        }
    }

    /// The nearest of the same body within a distance; of several at one point, as at edges of the body or the ends of two sides
    /// that they meet, the one most like it.
    fn nearest(&self, touch: &Touch<D>, within: f64) -> Option<usize> {
        let body =
            |touch: &Touch<D>| self.body_of[touch.place.node_of(touch.place.own[0].0) as usize];
        let mut best: Option<(f64, _, usize)> = None;
        for near in self.tree.nearest_neighbor_iter(touch.rest) {
            let far = length(minus(*near.geom(), touch.rest));
            let limit = best.map_or(within, |best| best.0 + self.same);
            if far > limit {
                break;
            }
            let other = &self.touches[near.data];
            if body(other) != body(touch) {
                continue;
            }
            let alike = touch.likeness(other);
            if best.is_none_or(|best| alike > best.1) {
                best = Some((best.map_or(far, |best| best.0), alike, near.data));
            }
        }
        best.map(|best| best.2)
    }
}

/// The turn of the facets `around` one side of a place, from some positions of the nodes of the mesh to others; None without a facet.
fn turn_beside<const D: usize>(
    place: &ContactPlace<D>,
    side: &[(u32, f64)],
    around: &HashMap<u32, BTreeSet<u32>>,
    positions: [&dyn Fn(u32) -> [f64; D]; 2],
) -> Option<Rotation<D>> {
    let beside = side.iter().filter_map(|&(image, _)| {
        let nodes = around.get(&place.node_of(image))?.iter();
        Some(nodes.map(move |&node| place.beside(image, node)))
    });
    let nodes: BTreeSet<u32> = beside.flatten().collect();
    let [from, to] = positions.map(|at| {
        let all = nodes.iter().map(|&node| place.place_at(node, at));
        all.collect::<Vec<_>>()
    });
    (!nodes.is_empty()).then(|| Rotation::between(&from, &to))
}

/// How an obstacle turns in a load step, where it is in its place at the end of it.
fn turn_of_obstacle<const D: usize>([was, is]: [Moved<D>; 2], first: bool) -> Rotation<D> {
    let carried = |x: [f64; D]| if first { x } else { was.carried(x, &is) };
    let origin = carried([0.0; D]);
    Rotation::nearest((0..D).map(|c| {
        let way = from_fn(|k| f64::from(u8::from(k == c)));
        (1.0, way, minus(carried(way), origin))
    }))
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// The mesh of the bodies where they are.
    pub(super) fn moved(&self, u: &[[f64; D]]) -> Mesh<D> {
        let mut mesh = self.mesh.clone();
        for (x, u) in mesh.nodes.iter_mut().zip(u) {
            (0..D).for_each(|c| x[c] += u[c]);
        }
        mesh
    }

    /// How far the sides of a place are apart, where nodes of the mesh are at these positions. Where some are held, it is measured along
    /// each of these directions as the row along it says, because the forces act on the same nodes. Positions count from the place:
    /// rounding of the weights, times positions far from the origin, would exceed the slip.
    fn apart(
        place: &ContactPlace<D>,
        frame: &[[f64; D]; D],
        at: impl Fn(u32) -> [f64; D],
    ) -> [f64; D] {
        let between = |a: usize| {
            let mut sum = [0.0; D];
            for (side, sign) in place.sides(a).into_iter().zip([1.0, -1.0]) {
                for &(node, weight) in side {
                    let x = minus(place.place_at(node, &at), place.place);
                    (0..D).for_each(|c| sum[c] += sign * weight * x[c]);
                }
            }
            sum
        };
        if place.directed.is_empty() {
            return between(0);
        }
        let mut sum = [0.0; D];
        for (a, way) in frame.iter().enumerate() {
            let along = dot(between(a), *way);
            (0..D).for_each(|c| sum[c] += along * way[c]);
        }
        sum
    }

    /// By how much the vector from one side of a tied place to the other at rest changes as it turns with the facets `around` its
    /// partners.
    fn turn_of_gap(
        &self,
        place: &ContactPlace<D>,
        around: &LazyCell<
            HashMap<u32, BTreeSet<u32>>,
            impl FnOnce() -> HashMap<u32, BTreeSet<u32>>,
        >,
        u: &[[f64; D]],
    ) -> [f64; D] {
        let rest = |node: u32| self.mesh.nodes[node as usize];
        let gap = Self::apart(place, &place.frame, rest);
        // Sides that touch are apart by the rounding of their means.
        if length(gap) <= ROUNDING * length(place.place) {
            return [0.0; D];
        }
        let now = |node: u32| from_fn(|c| rest(node)[c] + u[node as usize][c]);
        let turn = turn_beside(place, &place.partners, around, [&rest, &now]);
        turn.map_or([0.0; D], |turn| minus(turn.of(gap), gap))
    }

    /// Whether forces go to other places, or turn with the line of a spring or with the edge of a surface under pressure, which the
    /// tangent does not know.
    pub(crate) fn redirects_forces(&self) -> bool {
        // Turns of couplings do not count: acceleration takes them too far, and each of them is nearly a Newton step.
        let has_line = self.definition.springs.iter().any(Spring::has_line);
        has_line || self.has_pressures() || self.pairs.iter().any(PairData::slides)
    }

    /// Whether there are rigid obstacles.
    pub(crate) fn meets_obstacles(&self) -> bool {
        self.pairs.iter().any(|pair| pair.obstacle.is_some())
    }

    /// A place without forces and slip.
    fn touch(&self, place: ContactPlace<D>, pair: u32, nodes: &[[f64; D]]) -> Touch<D> {
        Touch {
            rest: place.mean_place(&self.mesh.nodes),
            apart: Self::apart(&place, &place.frame, |node| nodes[node as usize]),
            distance: 0.0,
            measured: 0.0,
            idle: false,
            pair,
            place,
            force: [0.0; D],
            origin: [0.0; D],
            slip: [0.0; D],
            slipped: [0.0; D],
            so_far: [0.0; D],
            feet: Vec::new(),
        }
    }

    /// The places of bodies at rest.
    pub(super) fn untouched(&self) -> Vec<Touch<D>> {
        let places = self.candidates.iter().map(|(place, pair)| {
            let mut touch = self.touch(place.clone(), *pair, &self.mesh.nodes);
            if let Some(obstacle) = &self.pairs[*pair as usize].obstacle {
                let own = place.own.iter();
                let foot =
                    |&(node, _): &(u32, f64)| foot(obstacle, self.mesh.nodes[node as usize]).2;
                touch.feet = own.map(foot).collect();
            }
            touch
        });
        places.collect()
    }

    /// Where a node is under some displacements.
    fn place_of(&self, node: u32, u: &[[f64; D]]) -> [f64; D] {
        let at = node as usize;
        from_fn(|c| self.mesh.nodes[at][c] + u[at][c])
    }

    /// The motion of an obstacle at both ends of a load step.
    fn motions<'m>(&'m self, pair: u32, moments: [&Moment<D>; 2]) -> [Moved<'m, D>; 2] {
        let number = pair as usize;
        moments.map(|at| Moved {
            of: self.definition.pairs[number].motion.as_ref(),
            factor: at.motions[number],
        })
    }

    /// The contact places at the present configuration; with `first`, obstacles are at their old places.
    pub(super) fn meeting(
        &self,
        moved: &Mesh<D>,
        before: &Deformation<D>,
        moments: [&Moment<D>; 2],
        now: &Deformation<D>,
        first: bool,
    ) -> Result<Meeting<D>, ModelError> {
        let mut met = Meeting {
            touches: Vec::with_capacity(self.candidates.len()),
            bends: Vec::new(),
            from: Vec::with_capacity(self.candidates.len()),
            is_alike: true,
            pools: (self.candidates.iter().map(|place| place.0.pool + 1).max()).unwrap_or(0),
        };
        for pair in 0..self.pairs.len() as u32 {
            let [now_of, before_of] =
                [&now.touches, &before.touches].map(|touches| of_pair(touches, pair));
            let first_now = first_of(&now.touches, pair);
            let pair_acts = moments[1].acts(pair);
            if self.pairs[pair as usize].slides() {
                if !pair_acts {
                    met.is_alike &= now_of.is_empty();
                    continue;
                }
                let begin = met.from.len();
                let then = &before.displacement;
                self.meet_bodies(moved, [now_of, before_of], then, moments[1], pair, &mut met)?;
                (met.from[begin..].iter_mut().flatten()).for_each(|from| *from += first_now);
                continue;
            }
            let begin = self.candidates.partition_point(|place| place.1 < pair);
            let connected = self.connected(pair, moved, now_of, moments[1])?;
            let is_tie = self.pairs[pair as usize].kind == EntityKind::Tie;
            let data = &self.pairs[pair as usize];
            let [around_own, around] =
                [&data.facets, &data.others].map(|facets| LazyCell::new(|| nodes_around(facets)));
            let at_then = |node: u32| self.place_of(node, &before.displacement);
            for (k, was) in now_of.iter().enumerate() {
                let mut acts = pair_acts;
                let rest = &self.candidates[begin + k].0;
                let connected = connected.as_ref().map(|all| &all[k]);
                let place = connected.map_or(rest, |connected| &connected.place);
                let mut touch = self.touch(place.clone(), pair, &moved.nodes);
                if connected.is_none() {
                    let moved = rest.mean(|node| now.displacement[node as usize]);
                    touch.place.place = from_fn(|c| rest.place[c] + moved[c]);
                }
                match &self.pairs[pair as usize].obstacle {
                    Some(obstacle) => {
                        let (feet, bends) = (&before_of[k].feet, met.bends.len());
                        self.meet_obstacle(
                            moved,
                            obstacle,
                            self.motions(pair, moments),
                            first,
                            feet,
                            &mut touch,
                            &mut met,
                        )?;
                        if !acts {
                            met.bends.truncate(bends);
                        }
                    }
                    None if self.pairs[pair as usize].drives.len() > k => {
                        let driven = moments[1].driven.get(&(begin + k));
                        touch.measured = match connected {
                            Some(connected) => connected.measured,
                            None => {
                                let u = |node: u32| now.displacement[node as usize];
                                rest.terms(0).map(|(node, way)| dot(way, u(node))).sum()
                            }
                        };
                        let motion = driven.and_then(|driven| driven.motion);
                        let stated = match driven {
                            Some(Driven { locked: true, .. }) => Some(before_of[k].measured),
                            _ => motion,
                        };
                        let left = stated.map(|stated| stated - touch.measured);
                        acts = left.is_some();
                        touch.place.gap =
                            connected.and_then(|one| one.left).or(left).unwrap_or(0.0);
                        touch.distance = motion.unwrap_or(0.0) - touch.measured;
                    }
                    None => match connected {
                        Some(connected) => touch.slip = connected.moved,
                        None => {
                            let along = |u: &[[f64; D]]| -> [f64; D] {
                                let turn = match is_tie {
                                    true => self.turn_of_gap(rest, &around, u),
                                    false => [0.0; D],
                                };
                                from_fn(|a| {
                                    let terms = rest.terms(a);
                                    let sum = terms.map(|(node, way)| dot(way, u[node as usize]));
                                    sum.sum::<f64>() - dot(rest.frame[a], turn)
                                })
                            };
                            let [so_far, then] =
                                [&now.displacement, &before.displacement].map(|u| along(u));
                            touch.place.gap = rest.gap - so_far[0];
                            for (a, way) in rest.frame.iter().enumerate().skip(1) {
                                let slip = so_far[a] - then[a];
                                (0..D).for_each(|c| touch.slip[c] += slip * way[c]);
                            }
                        }
                    },
                }
                let turns = match self.pairs[pair as usize].obstacle {
                    Some(_) if D == 3 && before_of[k].bears() => {
                        let own = turn_beside(
                            &touch.place,
                            &touch.place.own,
                            &around_own,
                            [&at_then, &|node: u32| moved.nodes[node as usize]],
                        );
                        own.into_iter()
                            .chain([turn_of_obstacle(self.motions(pair, moments), first)])
                            .collect()
                    }
                    _ => Vec::new(),
                };
                touch.carries(Some(was).filter(|_| acts), Some(&before_of[k]), &turns);
                if connected.is_some() && acts {
                    touch.force = was.force_along(&touch.place.frame);
                }
                touch.idle = !acts;
                met.from.push(Some(first_now + k));
                met.touches.push(touch);
            }
            if self.pairs[pair as usize].obstacle.is_some() {
                let begin = met.touches.len() - now_of.len();
                self.measure(moved, pair, &mut met.touches[begin..]);
            }
        }
        for touch in &mut met.touches {
            let factor = moments[1].friction.get(touch.pair as usize);
            match (&mut touch.place.slip_bound, factor) {
                (SlipBound::Coulomb(mu), Some(factor)) => *mu *= factor.unwrap_or(0.0),
                _ => continue,
            }
        }
        Ok(met)
    }

    /// Above 0 for each facet of a boundary that meets itself where it has had multipliers, below 0 where it was met; nothing of
    /// other contacts.
    fn roles(data: &PairData<D>, touches: &[Touch<D>]) -> Vec<i32> {
        let mut of_nodes: HashMap<u32, i32> = HashMap::new();
        if !data.meets_itself() {
            return Vec::new();
        }
        for touch in touches {
            for (side, sign) in touch.place.sides(0).into_iter().zip([1, -1]) {
                for (node, _) in side {
                    *of_nodes.entry(*node).or_default() += sign;
                }
            }
        }
        let of_node = |node: &u32| of_nodes.get(node).map_or(0, |sum| sum.signum());
        let of_facet = |facet: &Facet<D>| facet_nodes(facet).iter().map(of_node).sum();
        data.facets.iter().map(of_facet).collect()
    }

    /// Where a place is against an obstacle, from the points that were opposite its nodes at the end of the last load step.
    #[allow(clippy::too_many_arguments)]
    fn meet_obstacle(
        &self,
        moved: &Mesh<D>,
        obstacle: &Obstacle<D>,
        [was, is]: [Moved<D>; 2],
        first: bool,
        before: &[[f64; D]],
        touch: &mut Touch<D>,
        met: &mut Meeting<D>,
    ) -> Result<(), ModelError> {
        let number = touch.pair as usize;
        let there = if first { was } else { is }.obstacle(obstacle);
        let number_of_place = met.touches.len();
        for (k, &(node, weight)) in touch.place.own.clone().iter().enumerate() {
            let x = moved.nodes[node as usize];
            let (distance, normal, opposite) = foot(&there, x);
            if k == 0 {
                if !normal.iter().all(|v| v.is_finite()) {
                    let error = ContactError::NoNormal {
                        place: x.into(),
                        obstacle: obstacle.name(),
                    };
                    let pair = &self.definition.pairs[number];
                    return Err(pair.entity(number).error(Fault::Contact(error)));
                }
                touch.place.frame = frame(normal);
            }
            // Stated gaps, interferences and offsets stay a part of the gap.
            let stated = foot(obstacle, self.mesh.nodes[node as usize]).0;
            let (closing, way) = match first {
                true => {
                    let moves = minus(was.carried(x, &is), x);
                    let along = dot(moves, normal);
                    (-along, from_fn(|c| along * normal[c] - moves[c]))
                }
                false => {
                    let origin = was.carried(before[k], &is);
                    (0.0, there.way(origin, opposite))
                }
            };
            touch.place.gap += weight * (distance - closing - stated);
            (0..D).for_each(|c| touch.slip[c] += weight * way[c]);
            touch.feet.push(opposite);
            met.bends.push(Bend {
                touch: number_of_place,
                node,
                weight,
                obstacle: there,
                place: x,
            });
        }
        touch.distance = touch.place.gap;
        Ok(())
    }

    /// Gives the places of a contact with an obstacle the areas of the displaced boundary, as those of contacts between bodies have.
    fn measure(&self, moved: &Mesh<D>, pair: u32, touches: &mut [Touch<D>]) {
        let body = Body {
            mesh: moved,
            ..self.body()
        };
        let facets = &self.pairs[pair as usize].facets;
        let nodes: Vec<u32> = touches.iter().map(|touch| touch.place.own[0].0).collect();
        let areas = match self.definition.pairs[pair as usize].is_by_nodes() {
            true => {
                let ways: Vec<_> = touches.iter().map(|touch| Some(touch.normal())).collect();
                areas(&body, &nodes, facets, &ways, false)
            }
            false => {
                let all = shares(&body, facets);
                nodes.iter().map(|&node| all[node as usize]).collect()
            }
        };
        // Nodes whose facets look away keep the area at rest.
        let areas = touches.iter_mut().zip(areas).filter(|at| at.1 > 0.0);
        for (touch, area) in areas {
            let wider = area / touch.place.area;
            touch.place.area = area;
            touch.place.compliance = touch.place.compliance.map(|c| c / wider);
        }
    }

    /// Whether a boundary has come into the other body unseen. Where it is folded or has turned away, its facets do not
    /// meet the other side, and its nodes have no places. Nodes that are there at rest do not count.
    pub(crate) fn is_pierced(
        &self,
        now: &Deformation<D>,
        touches: &[Touch<D>],
        to: &Moment<D>,
    ) -> Result<bool, ModelError> {
        /// In facets, which differ by less from the surfaces that they approximate; nodes that are deeper below a facet may be beyond a
        /// thin body.
        const DEPTH: [f64; 2] = [0.1, 1.0];
        let moved = self.moved(&now.displacement);
        let acting = self
            .sliding
            .stated
            .iter()
            .filter(|stated| to.acts(*stated.0));
        for (&number, stated) in acting {
            let data = &self.pairs[number as usize];
            let pair = &self.definition.pairs[number as usize];
            if self.swallows(
                &moved,
                of_pair(touches, number),
                data,
                DEPTH[1] * stated.longest,
            ) {
                return Ok(true);
            }
            if data.meets_itself() {
                let met = of_pair(touches, number)
                    .iter()
                    .flat_map(|touch| touch.place.sides(0));
                let met: BTreeSet<u32> = met.flatten().map(|entry| entry.0).collect();
                let takes_part = |k: usize| {
                    let nodes = facet_nodes(&data.facets[k]);
                    nodes.iter().any(|node| met.contains(node))
                };
                let seen = |pair: [usize; 2]| {
                    pair.into_iter().all(takes_part) || are_excluded(&data.excluded, pair)
                };
                if crosses_itself(
                    [&self.mesh, &moved],
                    &data.facets,
                    DEPTH[0] * stated.longest,
                    seen,
                ) {
                    return Ok(true);
                }
                continue;
            }
            let options = PairOptions {
                search_distance: Some(DEPTH[1] * stated.longest),
                rest: Some(&self.mesh),
                ..PairOptions::default()
            };
            // Those of some nodes that are inside where the bodies are as in a mesh.
            let inside = |mesh: &Mesh<D>, nodes: &[u32]| {
                let body = Body {
                    mesh,
                    ..self.body()
                };
                let others = Met::Facets(&data.others);
                let found = match node_contact(&body, nodes, &data.facets, others, &options) {
                    // No node is near.
                    Err(ContactError::Apart { .. }) => Ok(Vec::new()),
                    found => found
                        .map_err(|error| pair.entity(number as usize).error(Fault::Contact(error))),
                };
                let is_inside = |place: &ContactPlace<D>| place.gap < -DEPTH[0] * stated.longest;
                found.map(|found| -> Vec<u32> {
                    let found = found.iter().filter(|place| is_inside(place));
                    found.filter_map(|place| place.node).collect()
                })
            };
            let mut nodes: BTreeSet<u32> = pair.own_nodes(&self.mesh, data).into_iter().collect();
            for touch in of_pair(touches, number) {
                let own = touch.place.own.iter();
                for node in own.flat_map(|&(node, _)| touch.place.nodes_of(node, moved.nodes.len()))
                {
                    nodes.remove(&node);
                }
            }
            let nodes: Vec<u32> = nodes.into_iter().collect();
            let now = inside(&moved, &nodes)?;
            if !now.is_empty() && inside(&self.mesh, &now)?.len() < now.len() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// Whether nodes of the boundaries of a contact that have no places are inside the other bodies of the contact, deeper than a distance.
    /// Nodes that are there at rest do not count, nor do those of facets that exclude facets of the other body.
    fn swallows(
        &self,
        moved: &Mesh<D>,
        touches: &[Touch<D>],
        data: &PairData<D>,
        deeper: f64,
    ) -> bool {
        let sides = || data.facets.iter().chain(&data.others).map(facet_nodes);
        let mut nodes: BTreeSet<u32> = sides().flatten().copied().collect();
        for place in touches.iter().map(|touch| &touch.place) {
            let all = place.sides(0).into_iter().flatten();
            for node in all.flat_map(|&(node, _)| place.nodes_of(node, moved.nodes.len())) {
                nodes.remove(&node);
            }
        }
        let body_of = |node: u32| self.sliding.body_of[node as usize];
        let bodies: BTreeSet<u32> = sides().map(|nodes| body_of(nodes[0])).collect();
        // The sides of exclusions that bodies and nodes are on.
        let (mut of_bodies, mut of_nodes) = (BTreeSet::new(), Vec::new());
        for (nodes, excluded) in sides().zip(&data.excluded) {
            for &side in excluded {
                of_bodies.insert((body_of(nodes[0]), side));
                of_nodes.extend(nodes.iter().map(|&node| (node, side)));
            }
        }
        bodies.into_iter().any(|body| {
            let surface = &self.sliding.surfaces[body as usize];
            let may_pass = |&&(_, (number, side)): &&(u32, Excluded)| {
                of_bodies.contains(&(body, (number, !side)))
            };
            let passing: BTreeSet<u32> =
                (of_nodes.iter().filter(may_pass)).map(|of| of.0).collect();
            let others: Vec<u32> = (nodes.iter().copied())
                .filter(|node| body_of(*node) != body && !passing.contains(node))
                .collect();
            let now = enclosed(moved, &others, surface, deeper);
            !now.is_empty() && enclosed(&self.mesh, &now, surface, deeper).len() < now.len()
        })
    }

    /// The places of a pair of bodies.
    fn meet_bodies(
        &self,
        moved: &Mesh<D>,
        [now, before]: [&[Touch<D>]; 2],
        displacement_before: &[[f64; D]],
        to: &Moment<D>,
        pair: u32,
        met: &mut Meeting<D>,
    ) -> Result<(), ModelError> {
        let body = Body {
            mesh: moved,
            ..self.body()
        };
        let (definition, number) = (&self.definition, pair as usize);
        let data = &self.pairs[number];
        let roles = Self::roles(data, now);
        let stated_pair = &definition.pairs[number];
        let find = |body: &Body<D>, distance: f64, roles: &[i32]| {
            let found =
                stated_pair.meet_moved(body, data, &self.mesh, &self.sliding, distance, roles);
            found.map_err(|error| stated_pair.entity(number).error(Fault::Contact(error)))
        };
        let places = find(&body, data.search_distance, &roles)?;
        let body_of = &self.sliding.body_of;
        let earlier = [now, before].map(|touches| Earlier::new(touches, body_of));
        let stated = &self.sliding.stated[&pair];
        let within = 0.5 * stated.facet;
        // Pool numbers are unique across contacts.
        let pools = met.pools + met.touches.len() as u32;
        let mut touches: Vec<Touch<D>> = (places.into_iter())
            .map(|mut place| {
                place.pool += pools;
                place.gap += stated.beyond(&place, to.grown);
                let mut touch = self.touch(place, pair, &moved.nodes);
                touch.distance = touch.place.gap;
                touch
            })
            .collect();
        // A force goes to one place: the nearest. Places keep the order of those whose forces they have.
        let of_now = {
            let here = Earlier::new(&touches, body_of);
            let mutual = touches.iter().enumerate().map(|(i, touch)| {
                let from = earlier[0].nearest(touch, within);
                from.filter(|&k| here.nearest(&now[k], within) == Some(i))
            });
            mutual.collect::<Vec<_>>()
        };
        let [around, beyond] =
            [&data.facets, &data.others].map(|facets| LazyCell::new(|| nodes_around(facets)));
        let here = |node: u32| moved.nodes[node as usize];
        let at_then = |node: u32| self.place_of(node, displacement_before);
        // Where a boundary meets itself, the nearest one may be across the body.
        let alike = |from: &Touch<D>, touch: &Touch<D>| {
            !data.meets_itself() || dot(from.normal(), touch.normal()) > 0.0
        };
        let origin = |touch: &Touch<D>| earlier[1].nearest(touch, within).map(|k| &before[k]);
        // Those of then that were too far for the search, or did not act.
        let was_away = |touch: &Touch<D>| {
            let is_new = origin(touch).is_none_or(|origin| !alike(origin, touch));
            let far = || Self::apart(&touch.place, &touch.place.frame, at_then);
            is_new && (before.is_empty() || length(far()) > data.search_distance)
        };
        let mut afar: Vec<Touch<D>> = Vec::new();
        if touches.iter().any(was_away) {
            let then = self.moved(displacement_before);
            let moves = moved.nodes.iter().zip(&then.nodes);
            let moves = moves.map(|(x, then)| length(minus(*x, *then)));
            // Two nodes have come towards each other by no more than both have moved.
            let distance = data.search_distance + 2.0 * moves.fold(0.0, f64::max);
            let body = Body {
                mesh: &then,
                ..self.body()
            };
            let places = find(&body, distance, &Self::roles(data, before))?.into_iter();
            afar.extend(places.map(|place| self.touch(place, pair, &then.nodes)));
        }
        let from_afar = Earlier::new(&afar, body_of);
        for (touch, now_at) in touches.iter_mut().zip(&of_now) {
            let origin = origin(touch);
            let opposite = origin.filter(|from| alike(from, touch)).or_else(|| {
                let from = from_afar.nearest(touch, within).map(|k| &afar[k]);
                from.filter(|from| alike(from, touch))
            });
            let frame = &touch.place.frame;
            touch.slip = match opposite {
                Some(opposite) => {
                    let then = turned_with(opposite.apart, opposite.normal(), touch.normal());
                    minus(Self::apart(&opposite.place, frame, here), then)
                }
                // A place that nothing was opposite to slips as the nodes that are opposite now.
                None => {
                    let far = Self::apart(&touch.place, frame, at_then);
                    let own = &touch.place.own;
                    let turn = turn_beside(&touch.place, own, &around, [&at_then, &here]);
                    minus(touch.apart, turn.map_or(far, |turn| turn.of(far)))
                }
            };
            // A turn of both bodies about the normal leaves the normal as it is. (In the plane the normal shows each turn.)
            let carries = D == 3 && origin.is_some_and(|from| from.bears());
            let sides = [
                (&touch.place.own, &around),
                (&touch.place.partners, &beyond),
            ];
            let turns: Vec<Rotation<D>> = (sides.into_iter().filter(|_| carries))
                .filter_map(|(side, around)| {
                    turn_beside(&touch.place, side, around, [&at_then, &here])
                })
                .collect();
            touch.carries(now_at.map(|k| &now[k]), origin, &turns);
        }
        let mut order: Vec<usize> = (0..touches.len()).collect();
        order.sort_by_key(|&i| of_now[i].unwrap_or(usize::MAX));
        met.is_alike &= touches.len() == now.len() && of_now.iter().all(Option::is_some);
        met.from.extend(order.iter().map(|&i| of_now[i]));
        met.touches
            .extend(order.into_iter().map(|i| touches[i].clone()));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::vector::length;

    /// The turn that takes one direction to another keeps lengths.
    #[test]
    fn forces_turn_with_their_obstacle() {
        let (from, to) = ([0.6, 0.0, 0.8], [0.0, -1.0, 0.0]);
        let turned = turned_with(from, from, to);
        assert!((0..3).all(|c| (turned[c] - to[c]).abs() < 1e-15));
        let v = [0.3, -2.0, 0.7];
        assert!((length(turned_with(v, from, to)) - length(v)).abs() < 1e-14);
    }
}
