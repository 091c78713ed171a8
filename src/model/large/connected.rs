//! Springs, preloads and couplings of bodies that have moved.
//!
//! The rows of a preload and of a coupling turn with their nodes, by the rigid motion nearest to the one that these have made:
//! x = x̄ + R (X − X̄). What their rows measure is the rest v = Rᵀ(x − x̄) − (X − X̄) in the directions at rest. It has no part that is a
//! rigid motion. So the rows of nodes that follow a point are met where the nodes have their shape at rest, however far they have
//! turned, and a bolt is pulled along its own axis.

use super::super::coupled::Coupled;
use super::super::driven::Driven;
use super::super::elastic::Elastic;
use super::super::entities::Part as _;
use super::super::error::{EntityKind, ModelError};
use super::Moment;
use super::meeting::{Touch, of_pair};
use crate::contact::{ContactPlace, Space};
use crate::elasticity::Plane;
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Mesh};
use crate::rigid::Rotation;
use std::array::from_fn;

/// The rigid motion nearest to that of some nodes, by least squares.
pub(in super::super) struct Carried<const D: usize> {
    /// Their mean at rest, and now.
    rest: [f64; D],
    now: [f64; D],
    pub turn: Rotation<D>,
}

impl<const D: usize> Carried<D> {
    /// Of nodes with their shares, from places at rest to those now.
    /// With directions in which some of them are held, they turn about these alone.
    pub fn of(
        shares: &[(u32, f64)],
        at_rest: &[[f64; D]],
        now: &[[f64; D]],
        held: &[[f64; D]],
    ) -> Self {
        let all: f64 = shares.iter().map(|(_, share)| share).sum();
        let mean = |places: &[[f64; D]]| {
            crate::contact::mean(shares, |node| places[node as usize]).map(|x| x / all)
        };
        let [rest, here] = [at_rest, now].map(mean);
        let arms = shares.iter().map(|&(node, share)| {
            let [from, to] = [(at_rest, rest), (now, here)]
                .map(|(places, mean)| minus(places[node as usize], mean));
            (share, from, to)
        });
        Self {
            rest,
            now: here,
            turn: match held {
                [] => Rotation::nearest(arms),
                [axis] if D == 3 => Rotation::nearest_about(*axis, arms),
                _ => Rotation::nearest(std::iter::empty()),
            },
        }
    }

    /// Where a place at rest is.
    pub fn place(&self, rest: [f64; D]) -> [f64; D] {
        let arm = self.turn.of(minus(rest, self.rest));
        from_fn(|c| self.now[c] + arm[c])
    }

    /// How far a node is from there, in the directions at rest.
    fn off(&self, rest: [f64; D], now: [f64; D]) -> [f64; D] {
        minus(self.turn.back(minus(now, self.now)), minus(rest, self.rest))
    }
}

/// The rows of a place where the bodies are.
pub(super) struct Connected<const D: usize> {
    /// With the remaining motion along its first direction as its gap: of a row that is driven, less the motion that is stated.
    pub place: ContactPlace<D>,
    /// The motion so far along the others.
    pub moved: [f64; D],
    /// What its first row measures so far.
    pub measured: f64,
    /// The remaining motion of a row that is driven, where it is not the stated one less this.
    pub left: Option<f64>,
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// The places of a spring, a preload or a coupling; None where their rows stay as they are at rest.
    pub(super) fn connected(
        &self,
        pair: u32,
        moved: &Mesh<D>,
        was: &[Touch<D>],
        to: &Moment<D>,
    ) -> Result<Option<Vec<Connected<D>>>, ModelError> {
        let (data, definition) = (&self.pairs[pair as usize], &self.definition);
        let begin = self.candidates.partition_point(|place| place.1 < pair);
        let places = self.candidates[begin..]
            .iter()
            .take_while(|place| place.1 == pair);
        let places: Vec<&ContactPlace<D>> = places.map(|(place, _)| place).collect();
        let [rest, now] = [&self.mesh.nodes, &moved.nodes];
        Ok(match data.kind {
            EntityKind::Spring if definition.springs[data.number].has_line() => {
                let line = |nodes: &[[f64; D]]| {
                    let end = |shares| crate::contact::mean(shares, |node| nodes[node as usize]);
                    minus(end(&places[0].partners), end(&places[0].own))
                };
                let [before, line] = [rest, now].map(|nodes| line(nodes));
                let mut place = places[0].clone();
                place.place = place.mean_place(now);
                // Ends in one place have no line.
                if length(line) > f64::EPSILON * length(before) {
                    place.frame[0] = unit(line);
                }
                let approach = length(before) - length(line);
                place.gap = -approach;
                Some(vec![Connected {
                    place,
                    moved: [0.0; D],
                    measured: approach,
                    left: None,
                }])
            }
            EntityKind::Preload if self.plane != Plane::Axisymmetric => {
                let nodes = definition.sections[data.number].nodes();
                let carried = Carried::of(&nodes, rest, now, &self.held_along(&nodes));
                Some(self.turned(&places, &carried, moved))
            }
            EntityKind::Coupling if self.plane != Plane::Axisymmetric => {
                let coupling = &definition.couplings[data.number];
                let at = coupling.on_mesh(&self.body(), definition.carrier(data.number));
                let at = at.map_err(|fault| coupling.entity(data.number).error(fault))?;
                let carried = at.carried(rest, now);
                let mut turned = self.turned(&places, &carried, moved);
                let stated = |k: usize| to.driven.get(&(begin + k))?.motion;
                Self::drive(&at, &carried, [rest, now], was, stated, &mut turned);
                Some(turned)
            }
            // All others stay as they are at rest.
            _ => None,
        })
    }

    /// The directions in which supports hold some of these nodes, each once: a section with nodes on a plane of symmetry keeps them there.
    fn held_along(&self, nodes: &[(u32, f64)]) -> Vec<[f64; D]> {
        let mut all: Vec<[f64; D]> = Vec::new();
        let held = nodes
            .iter()
            .filter_map(|(node, _)| self.sliding.held.get(node));
        for way in held.flatten() {
            if all.iter().all(|other| dot(*other, *way).abs() < 1.0 - 1e-6) {
                all.push(*way);
            }
        }
        all
    }

    /// Places that have turned with their nodes.
    fn turned(
        &self,
        places: &[&ContactPlace<D>],
        carried: &Carried<D>,
        moved: &Mesh<D>,
    ) -> Vec<Connected<D>> {
        let off = |node: u32| {
            let at = node as usize;
            carried.off(self.mesh.nodes[at], moved.nodes[at])
        };
        let turned = |rest: &&ContactPlace<D>| {
            let so_far: [f64; D] =
                from_fn(|a| rest.terms(a).map(|(node, way)| dot(way, off(node))).sum());
            let mut place = (*rest).clone();
            place.place = match place.node {
                Some(node) => moved.nodes[node as usize],
                None => carried.place(rest.place),
            };
            place.frame = rest.frame.map(|way| carried.turn.of(way));
            for (_, way) in place.further.iter_mut().flatten() {
                *way = carried.turn.of(*way);
            }
            place.gap = -so_far[0];
            let mut moved = [0.0; D];
            for (way, along) in place.frame.iter().zip(so_far).skip(1) {
                (0..D).for_each(|c| moved[c] += along * way[c]);
            }
            Connected {
                place,
                moved,
                measured: so_far[0],
                left: None,
            }
        };
        places.iter().map(turned).collect()
    }

    /// Completes the rows that measure the motions of a point: `was` has what they measured before, and `stated` what is stated.
    ///
    /// The rotation is a vector θ, of which the same turn is reached after any number of rounds: the one nearest to that of before counts.
    /// Rows measure turns about the axes, so that multipliers are moments about them.
    fn drive(
        at: &Coupled<D>,
        carried: &Carried<D>,
        [rest, now]: [&[[f64; D]]; 2],
        was: &[Touch<D>],
        stated: impl Fn(usize) -> Option<f64>,
        turned: &mut [Connected<D>],
    ) {
        let turns = at.drives().iter().zip(was).enumerate();
        let turns = turns.filter(|(_, (drive, _))| drive.component >= D);
        let before: Vec<f64> = turns
            .clone()
            .map(|(_, (drive, touch))| touch.measured / drive.size)
            .collect();
        let theta = carried.turn.vector_near(&before);
        let wanted = turns.map(|(k, (drive, _))| stated(k).map(|motion| motion / drive.size));
        let wanted: Option<Vec<f64>> = wanted.collect();
        let left = wanted.map(|wanted| {
            let far: Vec<f64> = wanted
                .iter()
                .zip(&theta)
                .map(|(to, from)| to - from)
                .collect();
            Rotation::by(&wanted)
                .after_back(&carried.turn)
                .vector_near(&far)
        });
        let rows = at.rows(carried, rest, now);
        for ((drive, row), here) in at.drives().iter().zip(rows).zip(turned) {
            here.place.place = carried.place(at.point());
            // Any direction of a rotation: it carries the multiplier.
            here.place.frame = [[0.0; D]; D];
            here.place.frame[0][drive.component % D] = 1.0;
            here.place.further = vec![row];
            match drive.component.checked_sub(D) {
                None => {
                    here.measured = here.place.place[drive.component] - at.point()[drive.component];
                }
                Some(about) => {
                    here.measured = drive.size * theta[about];
                    here.left = left.as_ref().map(|left| drive.size * left[about]);
                }
            }
        }
    }

    /// Adds the forces that are stated for rows that are driven, of preloads and of points.
    pub(super) fn push_driven(
        &self,
        to: &Moment<D>,
        touches: &[Touch<D>],
        forces: &mut [[f64; D]],
    ) {
        let pushing = to.driven.iter().filter(|(_, driven)| driven.force != 0.0);
        for (&candidate, Driven { force, .. }) in pushing {
            let pair = self.candidates[candidate].1;
            let begin = self.candidates.partition_point(|place| place.1 < pair);
            let place = &of_pair(touches, pair)[candidate - begin].place;
            for (node, way) in place.terms(0) {
                (0..D).for_each(|c| forces[node as usize][c] += force * way[c]);
            }
        }
    }
}
