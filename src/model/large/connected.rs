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
use crate::rigid::{self, Rotation};
use std::array::from_fn;
use std::f64::consts::PI;

/// The rigid motion nearest to that of some nodes, by least squares.
pub(in super::super) struct Carried<const D: usize> {
    /// Their mean at rest, and now.
    rest: [f64; D],
    now: [f64; D],
    pub turn: Rotation<D>,
}

impl<const D: usize> Carried<D> {
    /// Of nodes with their shares, from places at rest to those now.
    pub fn of(shares: &[(u32, f64)], at_rest: &[[f64; D]], now: &[[f64; D]]) -> Self {
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
            turn: Rotation::nearest(arms),
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
            EntityKind::Preload => {
                let nodes = definition.sections[data.number].nodes();
                let carried = Carried::of(&nodes, rest, now);
                Some(self.turned(&places, &carried, moved))
            }
            EntityKind::Coupling if self.plane != Plane::Axisymmetric => {
                let coupling = &definition.couplings[data.number];
                let at = coupling.on_mesh(&self.body(), definition.carrier(data.number));
                let at = at.map_err(|fault| coupling.entity(data.number).error(fault))?;
                let carried = at.carried(rest, now);
                let mut turned = self.turned(&places, &carried, moved);
                self.drive(begin, &at, &carried, now, was, to, &mut turned)
                    .map_err(|text| coupling.entity(data.number).error(text))?;
                Some(turned)
            }
            _ => None,
        })
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
            place.place = carried.place(rest.place);
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

    /// Completes the rows that measure the motions of a point.
    ///
    /// The rotation is a vector θ, of which the same turn is reached after any number of rounds: the one nearest to that of before counts.
    /// Rows measure turns ω about the axes, and the multipliers are moments. Where only some entries of θ are stated, these rows measure
    /// θ̇ = T⁻¹(θ) ω.
    #[allow(clippy::too_many_arguments)]
    fn drive(
        &self,
        begin: usize,
        at: &Coupled<D>,
        carried: &Carried<D>,
        now: &[[f64; D]],
        was: &[Touch<D>],
        to: &Moment<D>,
        turned: &mut [Connected<D>],
    ) -> Result<(), &'static str> {
        let turns = rigid::count(D) - D;
        let stated = |k: usize| to.driven.get(&(begin + k)).and_then(|driven| driven.motion);
        let drives = at.drives();
        let before: Vec<f64> = (was.iter().zip(drives))
            .filter(|(_, drive)| drive.component >= D)
            .map(|(touch, drive)| touch.measured / drive.size)
            .collect();
        // A point with a single node has no rotation.
        let theta = match before.len() == turns {
            true => carried.turn.vector_near(&before),
            false => vec![0.0; turns],
        };
        let wanted: Vec<Option<f64>> = (drives.iter().enumerate())
            .filter(|(_, drive)| drive.component >= D)
            .map(|(k, drive)| stated(k).map(|motion| motion / drive.size))
            .collect();
        let whole: Option<Vec<f64>> = wanted.iter().copied().collect();
        let left = match &whole {
            Some(whole) if !whole.is_empty() => {
                let far = whole.iter().zip(&theta).map(|(to, from)| to - from);
                if rigid::length(&far.collect::<Vec<_>>()) > PI {
                    return Err(
                        "a load step turns its point by more than half a turn: divide the turn over more load steps",
                    );
                }
                Some(Rotation::by(whole).after_back(&carried.turn))
            }
            _ => None,
        };
        let is_partly = whole.is_none() && wanted.iter().any(Option::is_some);
        let rows = at.rows(carried, &self.mesh.nodes, now);
        for (k, drive) in drives.iter().enumerate() {
            let here = &mut turned[k];
            let mut frame = [[0.0; D]; D];
            // Any direction of a rotation: it carries the multiplier.
            frame[0][drive.component % D] = 1.0;
            here.place.frame = frame;
            here.place.place = carried.place(at.point());
            let mut terms = rows[k].clone();
            match drive.component.checked_sub(D) {
                None => {
                    here.measured = here.place.place[drive.component] - at.point()[drive.component]
                }
                Some(about) => {
                    here.measured = drive.size * theta[about];
                    here.left = left.as_ref().map(|left| drive.size * left[about]);
                    if is_partly {
                        terms.clear();
                        for (part, row) in rigid::of_turns(&theta)[about].iter().zip(&rows[D..]) {
                            terms.extend(
                                row.iter().map(|(node, way)| (*node, way.map(|v| part * v))),
                            );
                        }
                    }
                }
            }
            here.place.gap = -here.measured;
            here.place.further = vec![terms];
        }
        Ok(())
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
