//! Large displacements: loads, supports and obstacles at a time, and the contact problem of where bodies are.
//!
//! At displacements u the unknown is the remaining displacement Δu. K is the tangent at u, f the imbalance of forces
//! there without the contact forces, and d the distances from obstacles. Slip is counted from where each contact place
//! was on its obstacle at the end of the last load step. Its violation at Δu = 0 is that of balance, contact and
//! friction where the bodies are.

mod connected;
mod glue;
mod meeting;
mod turning;

use super::build::problem_of;
use super::elastic::Elastic;
use super::entities::Part;
use super::error::{Entity, EntityKind, Fault, ModelError};
use super::loads::{StepData, TemperatureField, outer_facets, step_of};
use super::motion::Moved;
use super::pair::Law;
use super::{Definition, Driven};
use crate::contact::{ContactPlace, ContactRows, Space, rows_of};
use crate::elasticity::{
    Body, Deformed, Loose, Temperature, Unknowns, add_block, free_forces, tangent_forces,
};
use crate::mesh::bounds;
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{ElementKind, Topology, facet_nodes};
use crate::problem::{ContactProblem, Elsewhere, FloatingBody, Kkt, Scales, UNREACHABLE};
use crate::quasistatic::{Load, State, lawful};
use crate::rounding::ROUNDING;
use crate::sparse::{norm, norm_max};
use crate::ssnm::Sets;
pub(super) use connected::Carried;
pub(crate) use glue::Glue;
use meeting::Meeting;
pub(crate) use meeting::{Touch, turned_with};
use std::array::from_fn;
use std::collections::BTreeMap;

/// Loads, supports and obstacles at a time.
pub(crate) struct Moment<const D: usize> {
    time: f64,
    /// The common load factor.
    pub factor: f64,
    /// The prescribed displacements.
    pub unknowns: Unknowns<D>,
    /// Forces that keep their direction and size wherever the bodies move.
    dead: Vec<[f64; D]>,
    /// The load factors of pressures on boundaries.
    pressures: Vec<f64>,
    temperature: TemperatureField<D>,
    /// The factors of the motions of obstacles, pair by pair.
    motions: Vec<f64>,
    /// The part of overlaps that has been pressed apart: it grows in the first load step.
    grown: f64,
    /// The state of rows that are driven, by the numbers of their candidates.
    driven: BTreeMap<usize, Driven>,
    /// The factor of the coefficient of each contact; None where it does not act.
    friction: Vec<Option<f64>>,
}

impl<const D: usize> Moment<D> {
    /// Whether a pair acts; ties always do.
    fn acts(&self, pair: u32) -> bool {
        self.friction.get(pair as usize).is_none_or(Option::is_some)
    }
}

/// Bodies in balance at the end of a load step, or of a part of one.
#[derive(Clone, Debug)]
pub(crate) struct Deformation<const D: usize> {
    /// Of every node.
    pub displacement: Vec<[f64; D]>,
    /// The part of it that the last iteration added.
    pub step: Vec<[f64; D]>,
    /// The contact places, with their forces.
    pub touches: Vec<Touch<D>>,
}

impl<const D: usize> Deformation<D> {
    /// Begins a load step.
    pub fn begin(&mut self) {
        (self.touches.iter_mut()).for_each(|touch| touch.so_far = [0.0; D]);
    }
}

/// A body that no support holds, or not in every way.
#[derive(Clone, Debug)]
pub(crate) struct LooseBody {
    nodes: Vec<u32>,
    /// Half the diagonal of the box around it.
    size: f64,
    /// Whether supports hold it in some ways.
    partly: bool,
}

impl LooseBody {
    /// By its stiffness at rest.
    pub(super) fn new<const D: usize>(elastic: &Elastic<D>, body: &FloatingBody<D>) -> Self
    where
        ElementKind: Space<D>,
    {
        let node = |&block: &u32| elastic.unknowns.node(block as usize);
        Self {
            nodes: body.nodes().iter().map(node).collect(),
            size: body.size(),
            partly: body.motions().len() < D * (D + 1) / 2,
        }
    }
}

/// How a tangent that is not definite is helped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Help {
    /// Whether pressures and contact forces that turn with their surface have a part in it, and forces in the volume that depend on
    /// where bodies are.
    pub turning: bool,
    /// The stiffness of closed contact with obstacles, over the mean diagonal of K: the solution stays the same, as the gap is zero there.
    pub held: f64,
    /// Whether it is made without stresses that soften bodies: it is definite then, and steps are short where these matter.
    pub stiffened: bool,
}

impl Help {
    /// The last remedy.
    pub const MOST: Self = Self {
        turning: false,
        held: 0.0,
        stiffened: true,
    };
}

/// Bodies on the way from one load step to the next, with the contact problem for their remaining displacement.
pub(crate) struct Configuration<const D: usize> {
    pub problem: ContactProblem<D>,
    pub load: Load,
    pub state: State,
    pub contact: ContactRows<D>,
    /// The remaining prescribed displacements.
    pub left: Unknowns<D>,
    /// All forces on nodes except those of contact and supports.
    pub outer: Vec<[f64; D]>,
    scales: Scales,
    /// Whether the requested tangent had a diagonal entry that is not positive, and [`Help::MOST`] replaced it.
    pub is_replaced: bool,
    /// The rounding error of the forces.
    rounding: f64,
    /// How far from the origin each unknown may have been and is.
    sizes: Vec<f64>,
    /// λ, in the rows of the problem.
    pub lambda: Vec<f64>,
    /// The contact places, with the forces of the configuration before.
    pub touches: Vec<Touch<D>>,
    /// For each place, the number of the one that it was in the configuration before.
    pub from: Vec<Option<usize>>,
    /// Whether they are those of the configuration before.
    pub is_alike: bool,
}

/// A block of a tangent: nodes and derivatives.
type Block<const D: usize> = ([u32; 2], [[f64; D]; D]);

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// Whether nothing is stated that belongs to large displacements alone.
    pub(super) fn check_small(&self) -> Result<(), ModelError> {
        const LARGE: &str = "belongs to large displacements: state geometry = \"large\" under [analysis], or leave it out";
        let turning = self
            .supports
            .iter()
            .position(|support| support.rotate.is_some());
        if let Some(i) = turning {
            let text = format!("rotate {LARGE}");
            return Err(self.supports[i].entity(i).at("rotate").error(text));
        }
        if let Some(i) = self.body_forces.iter().position(|force| force.displaced) {
            let text = format!("displaced {LARGE}");
            return Err(self.body_forces[i].entity(i).at("displaced").error(text));
        }
        match self.pairs.iter().position(|pair| pair.motion.is_some()) {
            Some(i) => {
                let text = format!("the motion of an obstacle {LARGE}");
                Err(self.pairs[i].entity(i).at("motion").error(text))
            }
            None => Ok(()),
        }
    }

    /// Whether all that is stated is understood where displacements are large.
    pub(super) fn check_large(&self) -> Result<(), ModelError> {
        for (i, pair) in self.pairs.iter().enumerate() {
            let text = match &pair.law {
                Law::Tresca(_) => {
                    "where displacements are large, friction is Coulomb's: friction = { coulomb = … }"
                }
                _ => continue,
            };
            return Err(pair.entity(i).error(text));
        }
        if let Some(i) = self.ties.iter().position(|tie| tie.has_steps()) {
            return Err(self.ties[i].entity(i).error(
                "ties that change need geometry = \"small\": where displacements are large they are not known yet",
            ));
        }
        let small = "needs geometry = \"small\": where displacements are large it is not known yet";
        if let Some(i) = self.pairs.iter().position(|pair| pair.wear.is_some()) {
            return Err(self.pairs[i]
                .entity(i)
                .at("wear")
                .error(format!("wear {small}")));
        }
        if self.cycles().count > 1 {
            let steps = Entity::all(EntityKind::Steps).at("cycles");
            return Err(steps.error(format!("more than one cycle of load steps {small}")));
        }
        for (i, coupling) in self.couplings.iter().enumerate() {
            if coupling.contacts.is_some() {
                return Err(coupling.entity(i).at("contacts").error(format!(
                    "an obstacle that moves with a point {small}: state its motion (motion = {{ … }} of the contact)"
                )));
            }
            if coupling.free != [false; D] {
                let text = format!("a coupling that leaves directions free {small}");
                return Err(coupling.entity(i).at("free").error(text));
            }
        }
        Ok(())
    }
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// Whether there are pressures, which follow their surface.
    pub(crate) fn has_pressures(&self) -> bool {
        let mut tractions = self.definition.tractions.iter();
        tractions.any(|traction| traction.pressure.is_some())
    }

    /// Whether there are forces in the volume that depend on where bodies are.
    pub(crate) fn has_moved_forces(&self) -> bool {
        self.definition.has_moved_forces()
    }

    /// The common load factor at a time: 1 is the end of the first load step.
    pub(crate) fn factor(&self, time: f64) -> f64 {
        self.definition.factor(&None, time)
    }

    /// Loads, supports and obstacles at a time.
    pub(crate) fn moment(&self, time: f64) -> Result<Moment<D>, ModelError> {
        let definition = &self.definition;
        let body = self.body();
        let own = |factors: &Option<Vec<f64>>| definition.factor(factors, time);
        Ok(Moment {
            time,
            factor: self.factor(time),
            unknowns: definition.unknowns(&self.mesh, &self.prescriptions, time)?,
            dead: definition.forces(&body, time)?,
            pressures: definition
                .tractions
                .iter()
                .map(|t| own(&t.factors))
                .collect(),
            temperature: definition.temperature(&self.mesh, time)?,
            motions: (definition.pairs.iter())
                .map(|pair| {
                    pair.motion
                        .as_ref()
                        .map_or(0.0, |motion| own(&motion.factors))
                })
                .collect(),
            grown: time.min(1.0),
            driven: {
                let pair_of: Vec<u32> = self.candidates.iter().map(|(_, pair)| *pair).collect();
                let driven = definition.driven(&self.pairs, &pair_of, time);
                driven.into_iter().map(|one| (one.row, one)).collect()
            },
            friction: (definition.pairs.iter())
                .map(|pair| {
                    let step = step_of(time);
                    pair.acts(step).then(|| pair.friction_factor(step))
                })
                .collect(),
        })
    }

    /// Which nodes belong to bodies that can move as a whole; empty where all bodies are held.
    fn loose_nodes(&self, u: &[[f64; D]]) -> Vec<Loose> {
        /// A body that supports hold in some ways has the tangent of rest up to this turn: its error is that of directions, and slows
        /// convergence by as much.
        const TURN: f64 = 0.05;
        let mut loose = Vec::new();
        for body in &self.loose {
            loose.resize(u.len(), Loose::No);
            let (low, high) = bounds(body.nodes.iter().map(|&node| u[node as usize]));
            let kind = match body.partly && length(minus(high, low)) < TURN * body.size {
                true => Loose::Partly,
                false => Loose::Free,
            };
            body.nodes
                .iter()
                .for_each(|&node| loose[node as usize] = kind);
        }
        loose
    }

    /// At rest.
    pub(crate) fn undeformed(&self) -> Deformation<D> {
        let zeros = || vec![[0.0; D]; self.mesh.nodes.len()];
        Deformation {
            displacement: zeros(),
            step: zeros(),
            touches: self.untouched(),
        }
    }

    /// The forces of pressures, which follow the surface, and the symmetric part of their tangent.
    fn pressures(
        &self,
        at: &Moment<D>,
        u: &[[f64; D]],
        forces: &mut [[f64; D]],
        blocks: &mut Vec<Block<D>>,
    ) -> Result<(), ModelError> {
        let depths = self.body().depths();
        let tractions = self
            .definition
            .tractions
            .iter()
            .zip(&at.pressures)
            .enumerate();
        for (number, (traction, &factor)) in tractions {
            let (Some(pressure), true) = (&traction.pressure, factor != 0.0) else {
                continue;
            };
            let facets = outer_facets(&self.mesh, traction.boundary.all());
            let facets = facets.map_err(|fault| traction.entity(number).error(fault))?;
            for facet in &facets {
                let nodes = facet_nodes(facet);
                let depth = depths.of(nodes);
                let rest: Vec<[f64; D]> = nodes
                    .iter()
                    .map(|&node| self.mesh.nodes[node as usize])
                    .collect();
                let mut x: Vec<[f64; D]> = (nodes.iter().zip(&rest))
                    .map(|(&node, x)| from_fn(|c| x[c] + u[node as usize][c]))
                    .collect();
                let of = |x: &[[f64; D]]| {
                    let mut forces = vec![[0.0; D]; x.len()];
                    <ElementKind as Topology<D>>::facet_points(x, |point| {
                        let place = crate::mesh::shape::sum(&point.shape, &rest);
                        let size = -factor * pressure.at(place) * depth.at(point.place);
                        for (force, shape) in forces.iter_mut().zip(point.shape) {
                            let part = size * point.weight * shape;
                            (0..D).for_each(|c| force[c] += part * point.normal[c]);
                        }
                    });
                    forces
                };
                for (&node, force) in nodes.iter().zip(of(&x)) {
                    (0..D).for_each(|c| forces[node as usize][c] += force[c]);
                }
                // The forces are quadratic in the places of nodes: central differences are exact, however long.
                let size = (x.iter()).fold(0.0, |max: f64, y| max.max(length(minus(*y, x[0]))));
                let mut slopes = vec![[[0.0; D]; D]; nodes.len() * nodes.len()];
                for b in 0..nodes.len() {
                    for k in 0..D {
                        let here = x[b][k];
                        let [before, behind] = [-0.5, 0.5].map(|part| {
                            x[b][k] = here + part * size;
                            of(&x)
                        });
                        x[b][k] = here;
                        for a in 0..nodes.len() {
                            for i in 0..D {
                                let slope = (behind[a][i] - before[a][i]) / size;
                                slopes[a * nodes.len() + b][i][k] -= 0.5 * slope;
                                slopes[b * nodes.len() + a][k][i] -= 0.5 * slope;
                            }
                        }
                    }
                }
                for (number, block) in slopes.into_iter().enumerate() {
                    let pair = [number / nodes.len(), number % nodes.len()].map(|a| nodes[a]);
                    blocks.push((pair, block));
                }
            }
        }
        Ok(())
    }

    /// The longest facet of round sides in each other; of several contacts that of the finest.
    pub(crate) fn round_facet(&self) -> Option<f64> {
        let is_round = |pair: &u32| !self.pairs[*pair as usize].centres[0].is_empty();
        let round = self
            .sliding
            .stated
            .iter()
            .filter(|(pair, _)| is_round(pair));
        round.map(|(_, stated)| stated.facet).reduce(f64::min)
    }

    /// The forces in the volume that depend on where the bodies are, and the symmetric part of their tangent.
    fn moved_volumes(
        &self,
        at: &Moment<D>,
        u: &[[f64; D]],
        forces: &mut [[f64; D]],
        blocks: &mut Vec<Block<D>>,
    ) -> Result<(), ModelError> {
        if !self.has_moved_forces() {
            return Ok(());
        }
        let mut changes = vec![[[0.0; D]; D]; u.len()];
        (self.definition).add_moved_forces(&self.body(), at.time, u, forces, &mut changes)?;
        let blocks_of = (0..)
            .zip(changes)
            .filter(|(_, block)| *block != [[0.0; D]; D]);
        blocks.extend(
            blocks_of.map(|(node, block)| ([node; 2], block.map(|row| row.map(|v: f64| -v)))),
        );
        Ok(())
    }

    /// The contact problem of bodies that have moved by u and press with these forces, on the way from one end of a
    /// load step to the next. With `first`, obstacles are where they were, and their motion belongs to the remaining
    /// displacement.
    pub(crate) fn configuration(
        &self,
        before: &Deformation<D>,
        [from, to]: [&Moment<D>; 2],
        now: &Deformation<D>,
        first: bool,
        help: Help,
    ) -> Result<Configuration<D>, ModelError> {
        let (body, u) = (self.body(), &now.displacement);
        let field = |region: u32, x: [f64; D]| to.temperature.at(region, x);
        let temperature = (!to.temperature.is_none()).then_some(&field as Temperature<D>);
        let loose = self.loose_nodes(u);
        let deformed = Deformed {
            step: Some(&now.step),
            loose: &loose,
            ..Deformed::new(&body, u, temperature)
        };
        let resistance = deformed.resistance();
        let (mut outer, mut turning) = (to.dead.clone(), Vec::new());
        self.pressures(to, u, &mut outer, &mut turning)?;
        self.moved_volumes(to, u, &mut outer, &mut turning)?;

        let moved = self.moved(u);
        let met = self.meeting(&moved, before, [from, to], now, first)?;
        self.push_driven(to, &met.touches, &mut outer);
        self.turns(&moved, &met, &mut turning);
        let places: Vec<ContactPlace<D>> =
            (met.touches.iter().map(|touch| touch.place.clone())).collect();
        let failed = |error| Entity::all(EntityKind::Contact).error(Fault::Contact(error));
        let there = Body {
            mesh: &moved,
            ..body
        };
        let acts = |number: usize| !met.touches[number].idle;
        let mut contact = rows_of(&there, &to.unknowns, &places, acts).map_err(failed)?;
        for (row, candidate) in contact.candidate.iter().enumerate() {
            if met.touches[*candidate].idle {
                (contact.slip_bound[row], contact.coefficient[row]) = (0.0, 0.0);
            }
        }
        let left = to.unknowns.left_of(u);

        let still = left.displacements(&vec![0.0; D * left.n_blocks()]);
        let tangent = |help: Help| {
            let deformed = Deformed {
                stiffened: help.stiffened,
                ..deformed
            };
            let mut stiffness = deformed.tangent(&to.unknowns);
            let diagonal = stiffness.diagonal();
            let mean = diagonal.iter().sum::<f64>() / diagonal.len() as f64;
            let mut blocks = if help.turning {
                turning.clone()
            } else {
                Vec::new()
            };
            let mut driven = self.helped(help, mean, &met, &mut blocks);
            self.pull_glued(&met, &still, &mut driven);
            // A foundation keeps its directions: its forces follow from displacements.
            let whole: Vec<[f64; D]> = (u.iter().zip(&still))
                .map(|(u, still)| from_fn(|c| u[c] + still[c]))
                .collect();
            for (node, _, taken) in to.unknowns.bedding().forces(&whole) {
                (0..D).for_each(|c| driven[node as usize][c] -= taken[c]);
            }
            let mut held = tangent_forces(&deformed, &still);
            let is_loose = |node: u32| loose.get(node as usize).is_some_and(|is| *is != Loose::No);
            // A body that can move as a whole must not resist that.
            for ([a, b], block) in blocks.iter().filter(|(nodes, _)| !is_loose(nodes[0])) {
                for (force, row) in held[*a as usize].iter_mut().zip(block) {
                    *force += dot(*row, still[*b as usize]);
                }
                let rows = [a, b].map(|node| to.unknowns.block(*node));
                if let [Some(row), Some(column)] = rows
                    && let Some(value) = stiffness.block_mut(row as usize, column as usize)
                {
                    add_block(&to.unknowns, [*a, *b], block, value);
                }
            }
            (stiffness, held, driven)
        };
        let mut made = tangent(help);
        let is_replaced = help != Help::MOST && made.0.diagonal().iter().any(|v| !(*v > 0.0));
        if is_replaced {
            made = tangent(Help::MOST);
        }
        let (stiffness, held, driven) = made;
        let net: Vec<[f64; D]> = (0..u.len())
            .map(|i| from_fn(|c| outer[i][c] + driven[i][c] - resistance.forces[i][c] - held[i][c]))
            .collect();
        let net = free_forces(&to.unknowns, &net);

        let rows = contact.places.len();
        let mut lambda = vec![0.0; D * rows];
        let mut slips = vec![0.0; (D - 1) * rows];
        let mut given_way = slips.clone();
        for (r, i, place) in contact.numbered() {
            let touch = &met.touches[i];
            lambda[r] = dot(touch.force, place.frame[0]);
            for (a, tangent) in place.frame[1..].iter().enumerate() {
                let at = (D - 1) * r + a;
                // Without friction, or where supports take the place of it, a force along the tangents is rounding of the turn.
                if place.slip_bound.is_any() && !contact.keeps_from_sliding(r) {
                    lambda[rows + at] = dot(touch.force, *tangent);
                }
                slips[at] = dot(touch.slip, *tangent);
                given_way[at] = dot(touch.origin, *tangent);
            }
        }
        let force = norm(resistance.forces.as_flattened()).max(norm(outer.as_flattened()));
        let sizes: Vec<f64> = (0..to.unknowns.n_blocks())
            .map(|block| to.unknowns.node(block) as usize)
            .flat_map(|node| [length(u[node]) + length(self.mesh.nodes[node]); D])
            .collect();
        // The effect of rounded coordinates on the forces on each node, by the stiffness of the node.
        let diagonal = stiffness.diagonal();
        let rounded = diagonal.chunks_exact(D).zip(sizes.chunks_exact(D));
        let rounded: Vec<f64> = rounded.map(|(k, size)| norm_max(k) * size[0]).collect();
        let rounding = ROUNDING * norm(&rounded);
        let (_, slide) = contact.held_motion(&left);
        let mut gap = contact.gap(&left);
        for (r, i, _) in contact.numbered() {
            if met.touches[i].idle {
                gap[r] = UNREACHABLE;
            }
        }
        let load = Load {
            force: net.clone(),
            acting: force,
            gap,
            slide,
        };
        let compliance = contact.compliance.get(rows..);
        let state = State {
            u: vec![0.0; net.len()],
            slide: (0..slips.len())
                .map(|at| {
                    let compliance = compliance.map_or(0.0, |c| c[at]);
                    compliance * (lambda[rows + at] - given_way[at]) - slips[at]
                })
                .collect(),
            lambda: lambda.clone(),
        };
        let places_now: Vec<[f64; D]> = (0..to.unknowns.n_blocks())
            .map(|block| to.unknowns.node(block) as usize)
            .map(|node| match loose.get(node) {
                Some(Loose::Partly) => self.mesh.nodes[node],
                _ => moved.nodes[node],
            })
            .collect();
        let points = (places_now, deformed.vertices(&to.unknowns));
        let problem = problem_of(stiffness, net, force, points, &to.unknowns, &contact)?
            .with_poisson(self.body().poisson());
        let all: f64 = resistance.forces.iter().map(|f| length(*f)).sum();
        // The work of the forces over their sum: the motion of a load of as many.
        let deformation = if all > 0.0 {
            4.0 * resistance.energy / all
        } else {
            0.0
        };
        let scale = deformation.max(norm_max(&problem.own_effects(&lambda)));
        Ok(Configuration {
            scales: Scales {
                length: scale,
                deformation: scale * (rows.max(1) as f64).sqrt(),
                force,
            },
            is_replaced,
            rounding,
            sizes,
            problem,
            load,
            state,
            contact,
            left,
            outer,
            lambda,
            touches: met.touches,
            from: met.from,
            is_alike: met.is_alike,
        })
    }

    /// Adds the turning of contact forces and the remedies to the tangent; returns the forces that belong to the remedies.
    fn helped(
        &self,
        help: Help,
        mean: f64,
        met: &Meeting<D>,
        blocks: &mut Vec<Block<D>>,
    ) -> Vec<[f64; D]> {
        let mut driven = vec![[0.0; D]; self.mesh.nodes.len()];
        for bend in &met.bends {
            let Touch { place, force, .. } = &met.touches[bend.touch];
            let (weight, x, nu) = (bend.weight, bend.place, place.frame[0]);
            let pressing = dot(*force, nu);
            let along: [f64; D] = from_fn(|c| force[c] - pressing * nu[c]);
            if help.turning && *force != [0.0; D] {
                let bent = bend.obstacle.bend(x, along);
                let mut block = [[0.0; D]; D];
                for k in 0..D {
                    let column = bend
                        .obstacle
                        .bend(x, from_fn(|c| f64::from(u8::from(c == k))));
                    (0..D).for_each(|j| {
                        let turning = 0.5 * (nu[j] * bent[k] + bent[j] * nu[k]);
                        block[j][k] = weight * (turning - pressing * column[j]);
                    });
                }
                blocks.push(([bend.node; 2], block));
            }
        }
        if help.held > 0.0 {
            let size = help.held * mean;
            for touch in &met.touches {
                let nu = touch.place.frame[0];
                if self.pairs[touch.pair as usize].obstacle.is_none()
                    || !(dot(touch.force, nu) > 0.0)
                {
                    continue;
                }
                for &(a, wa) in &touch.place.own {
                    for &(b, wb) in &touch.place.own {
                        blocks.push((
                            [a, b],
                            from_fn(|j| from_fn(|k| size * wa * wb * nu[j] * nu[k])),
                        ));
                    }
                    let push = size * wa * touch.distance;
                    (0..D).for_each(|c| driven[a as usize][c] += push * nu[c]);
                }
            }
        }
        driven
    }

    /// The forces of the rows of a configuration, place by place along the axes.
    pub(crate) fn forces_of(&self, at: &Configuration<D>, lambda: &[f64]) -> Vec<[f64; D]> {
        let mut forces = vec![[0.0; D]; at.touches.len()];
        let (normal, tangential) = lambda.split_at(at.contact.places.len());
        for (r, i, place) in at.contact.numbered() {
            let tied = self.pairs[at.touches[i].pair as usize].tied;
            let pressing = if tied { normal[r] } else { normal[r].max(0.0) };
            forces[i] = from_fn(|c| pressing * place.frame[0][c]);
            for (tangent, force) in place.frame[1..].iter().zip(&tangential[(D - 1) * r..]) {
                (0..D).for_each(|c| forces[i][c] += force * tangent[c]);
            }
        }
        forces
    }

    /// The state at the end of a part of a load step, from which the next one begins.
    pub(crate) fn settled(&self, now: Deformation<D>, at: &Configuration<D>) -> Deformation<D> {
        let forces = self.forces_of(at, &at.lambda);
        // Without the elastic part of a compliant contact.
        let mut slips = vec![[0.0; D]; at.touches.len()];
        for (r, i, place) in at.contact.numbered() {
            for (a, tangent) in place.frame[1..].iter().enumerate() {
                let slip = -at.state.slide[(D - 1) * r + a];
                (0..D).for_each(|c| slips[i][c] += slip * tangent[c]);
            }
        }
        let touches = at.touches.iter().zip(forces).zip(slips);
        let touches = touches.map(|((touch, force), slip)| touch.settled(force, slip));
        Deformation {
            step: vec![[0.0; D]; now.step.len()],
            touches: touches.collect(),
            ..now
        }
    }

    /// The bodies where they are, for results, with u as long as K has rows, and the forces there: gaps and slip follow
    /// from u as where displacements are small. With the slip of each row in this load step.
    pub(crate) fn results_at(
        &self,
        now: &Deformation<D>,
        to: &Moment<D>,
        at: &Configuration<D>,
    ) -> (Self, StepData<D>, Vec<f64>, Vec<f64>) {
        let u: Vec<f64> = (0..to.unknowns.n_blocks())
            .flat_map(|block| now.displacement[to.unknowns.node(block) as usize])
            .collect();
        let (moved, slid) = (
            at.problem.times(at.problem.normal(), &u),
            at.problem.times(at.problem.tangential(), &u),
        );
        let gap = (at.contact.candidate.iter().zip(&moved))
            .map(|(&i, moved)| at.touches[i].distance + moved)
            .collect();
        let (mut slide, mut slip) = (vec![0.0; slid.len()], vec![0.0; slid.len()]);
        for (r, i, place) in at.contact.numbered() {
            for (a, tangent) in place.frame[1..].iter().enumerate() {
                let k = (D - 1) * r + a;
                slide[k] = dot(now.touches[i].slipped, *tangent) - slid[k];
                slip[k] = dot(now.touches[i].so_far, *tangent);
            }
        }
        let mut total_load = [0.0; D];
        for force in &at.outer {
            (0..D).for_each(|c| total_load[c] += force[c]);
        }
        let mut elastic = self.clone();
        elastic.contact = at.contact.clone();
        for (number, (pair, stated)) in
            (elastic.pairs.iter_mut().zip(&self.definition.pairs)).enumerate()
        {
            let moved = Moved {
                of: stated.motion.as_ref(),
                factor: to.motions[number],
            };
            pair.obstacle = pair.obstacle.map(|obstacle| moved.obstacle(&obstacle));
        }
        elastic.pair_of = at
            .contact
            .candidate
            .iter()
            .map(|&i| at.touches[i].pair)
            .collect();
        let data = StepData {
            factor: to.factor,
            unknowns: to.unknowns.clone(),
            forces: at.outer.clone(),
            total_load,
            load: Load {
                force: at.load.force.clone(),
                acting: at.load.acting,
                gap,
                slide,
            },
            temperature: to.temperature.clone(),
            changes: None,
            driven: {
                let pair_of = &elastic.pair_of;
                self.definition.driven(&self.pairs, pair_of, to.time)
            },
        };
        (elastic, data, u, slip)
    }

    /// det ∂x/∂X where it is least.
    pub(crate) fn least_volume(&self, u: &[[f64; D]]) -> f64 {
        let body: Body<D> = self.body();
        let of = Deformed::new(&body, u, None);
        of.least_volume()
    }

    /// Supports that drive nodes without any freedom into an obstacle, or across the only direction of their friction.
    pub(crate) fn check_driven(
        &self,
        before: &Deformation<D>,
        to: &Moment<D>,
        at: &Configuration<D>,
    ) -> Result<(), ModelError> {
        /// Distances below this part of the coordinates are rounding, or what is left of motions.
        const NOTHING: f64 = 1e-9;
        let failed = |error| Entity::all(EntityKind::Support).error(Fault::Contact(error));
        let least = NOTHING * norm_max(&at.sizes);
        let slides = |row: usize| {
            let (place, along) = (row / (D - 1), 1 + row % (D - 1));
            let touch = &at.touches[at.contact.candidate[place]];
            let slip = dot(touch.slip, at.contact.places[place].frame[along]);
            at.lambda[place] > 0.0 && slip.abs() > least
        };
        let moves = to.unknowns.left_of(&before.displacement);
        at.contact
            .check_moved([&moves, &at.left], slides, least)
            .map_err(failed)
    }
}

impl<const D: usize> Configuration<D> {
    /// The problem with the slip that counts.
    fn lawful(&self) -> ContactProblem<D, Elsewhere> {
        lawful(self.problem.elsewhere(), &self.load, &self.state)
    }

    /// By how much balance, contact, friction and supports are violated where the bodies are, in f64 from the forces of elements and the
    /// distances of obstacles.
    pub fn violation(&self) -> Kkt {
        let zeros = &self.state.u;
        let product = [zeros.clone(), zeros.clone()];
        let lawful = self.lawful();
        let mut kkt = lawful.conditions_by(self.scales, &self.sizes, zeros, &self.lambda, &product);
        // Without any load the forces of turned bodies are rounding alone.
        let known = self.rounding / self.scales.force;
        if known.is_finite() && kkt.equilibrium <= known {
            kkt.equilibrium = 0.0;
        }
        if norm_max(&self.lambda) <= self.rounding {
            (kkt.tension, kkt.friction_bound) = (0.0, 0.0);
        }
        kkt
    }

    /// The sets that contact places are in where nothing is left to be moved.
    pub fn sets(&self) -> Sets<D> {
        let lawful = self.lawful();
        let mut r = lawful.load_case().offsets();
        let given_way = lawful.contact_compliance().iter().zip(&self.lambda);
        (r.iter_mut().zip(given_way)).for_each(|(r, (c, l))| *r += c * l);
        Sets::of_solved(&lawful, &self.lambda, &r)
    }

    /// The largest displacement that supports have still to prescribe, over the size of displacements.
    pub fn unmoved(&self, u: &[[f64; D]]) -> f64 {
        let still = self
            .left
            .displacements(&vec![0.0; D * self.left.n_blocks()]);
        let size = |u: &[[f64; D]]| u.iter().fold(0.0, |max: f64, u| max.max(length(*u)));
        match size(&still) {
            0.0 => 0.0,
            left => left / size(u).max(left),
        }
    }
}
