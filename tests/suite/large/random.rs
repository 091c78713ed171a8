//! Random bodies that are pressed, turned and dragged along obstacles. Each converged load step is judged from the mesh alone: forces of
//! elements by the formulas of textbooks, distances from obstacles, and Coulomb's law, with no code of the solver.
//!
//! `CAMPAIGN_SEED` and `CAMPAIGN_PROBLEMS` say where the long run begins and how many problems it has.

use super::elements::{Point, dot, edges, minus, nodes, plus, resisting, turned};
use super::{End, tried};
use crate::common::draw::{chance, decade, generator, number, pick};
use signorini::contact::Obstacle;
use signorini::elasticity::{Hyperelastic, Material};
use signorini::engine::Stiffness;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, rectangle};
use signorini::model::{Axis, Model, Motion, Pair, Support, Traction};
use signorini::ssnm::Status;

/// A motion in proportion to the load factor: a turn about a point in degrees, then a shift.
#[derive(Clone, Copy)]
struct Rigid {
    about: Point,
    angle: f64,
    shift: Point,
}

impl Rigid {
    /// Where a point of what moves along was at rest.
    fn back(&self, x: Point, factor: f64) -> Point {
        let from = minus(minus(x, self.shift.map(|v| factor * v)), self.about);
        plus(self.about, turned(from, -factor * self.angle))
    }
}

/// What holds a side.
#[derive(Clone, Copy)]
enum Held {
    Moved(Point),
    Turned(Point, f64),
}

struct Problem {
    mesh: Mesh,
    material: Material,
    held: (&'static str, Held),
    pressed: Option<(&'static str, f64)>,
    obstacle: Obstacle,
    motion: Rigid,
    coulomb: f64,
    factors: Vec<f64>,
}

fn problem(seed: u64) -> Problem {
    let random = &mut generator(seed);
    let slender = chance(random, 0.3);
    let size = match slender {
        true => [random.between(3.0, 8.0), random.between(0.4, 1.0)],
        false => [random.between(0.6, 2.0), 1.0],
    };
    let cells = match slender {
        true => [6 + random.below(8), 1 + random.below(2)],
        false => [2 + random.below(5), 2 + random.below(4)],
    };
    let shape = pick(random, &[CellShape::Quad, CellShape::Triangle]);
    let mut mesh = rectangle([0.0; 2], size, cells, shape, "body", "");
    let all = random.between(-180.0, 180.0);
    for x in &mut mesh.nodes {
        *x = turned(*x, all);
    }
    let here = |x: Point| turned(x, all);
    let law = pick(
        random,
        &[Hyperelastic::NeoHooke, Hyperelastic::StVenantKirchhoff],
    );
    let young = decade(random, -3.0, 6.0);
    let material = Material {
        law,
        ..Material::new(young, pick(random, &[0.0, 0.2, 0.3, 0.4]))
    };
    // Under pressure St. Venant–Kirchhoff's law gives way from a stretch of 0.58 on.
    let much = match law {
        Hyperelastic::NeoHooke => 1.0,
        Hyperelastic::StVenantKirchhoff => 0.3,
    };
    let aside = much * random.between(-0.15, 0.15);
    let down = much * random.between(0.0, 0.2);
    let held = match (slender, chance(random, 0.3)) {
        (_, true) => {
            let about = here([size[0] * random.unit(), size[1] * random.unit()]);
            let most = if slender { 10.0 } else { 40.0 };
            Held::Turned(about, much * random.between(-most, most))
        }
        (true, false) => Held::Moved([0.0; 2]),
        (false, false) => Held::Moved(here([aside, -down])),
    };
    let side = if slender { "left" } else { "top" };
    let pressed = chance(random, 0.3).then(|| {
        let most = if slender { 1e-4 } else { 0.05 };
        ("right", young * random.between(-most, most))
    });
    let gap = random.between(0.0, 0.1);
    let along = size[0] * random.between(0.3, 1.0);
    let obstacle = match chance(random, 0.5) {
        true => Obstacle::HalfSpace {
            point: here([along, -gap]),
            normal: here([0.0, 1.0]),
        },
        false => {
            let radius = random.between(0.5, 3.0);
            Obstacle::Sphere {
                center: here([along, -gap - radius]),
                radius,
            }
        }
    };
    let about = match obstacle {
        Obstacle::HalfSpace { point, .. } => point,
        Obstacle::Sphere { center, .. } => center,
        Obstacle::Cylinder { .. } => unreachable!(),
    };
    let motion = Rigid {
        about,
        angle: much * random.between(-20.0, 20.0),
        shift: here([random.between(-0.3, 0.3), much * random.between(0.0, 0.25)]),
    };
    Problem {
        mesh,
        material,
        held: (side, held),
        pressed,
        obstacle,
        motion,
        coulomb: pick(random, &[0.0, 0.0, 0.1, 0.3, 0.6]),
        factors: pick(random, &[&[1.0][..], &[0.5, 1.0], &[0.4, 1.0, 0.2]]).to_vec(),
    }
}

impl Problem {
    fn model(&self) -> Model {
        let support = Support::on(self.held.0);
        let support = match self.held.1 {
            Held::Moved([x, y]) => support.x(x).y(y),
            Held::Turned(about, angle) => support.turned(Axis::at(about), angle),
        };
        let about = Axis::at(self.motion.about);
        let motion = Motion::turn(about, self.motion.angle).and_shift(self.motion.shift);
        let pair = Pair::obstacle("bottom", self.obstacle).moving(motion);
        let pair = match self.coulomb {
            0.0 => pair,
            mu => pair.coulomb(mu),
        };
        let model = Model::on(self.mesh.clone())
            .large_displacements()
            .material(self.material)
            .support(support)
            .contact(pair)
            .steps(self.factors.clone());
        match self.pressed {
            Some((side, pressure)) => model.traction(Traction::on(side).pressure(pressure)),
            None => model,
        }
    }

    /// How the law is broken at the end of a load step that has gone from one load factor to another: None where it is not.
    fn broken(&self, before: (f64, &[Point]), now: (f64, &End<2>)) -> Option<String> {
        let (factor, end) = now;
        let u = &end.displacement;
        let at = |node: usize, u: &[Point]| plus(self.mesh.nodes[node], u[node]);
        let held = nodes(&self.mesh, self.held.0);
        let size = self
            .mesh
            .nodes
            .iter()
            .flatten()
            .fold(0.0, |a: f64, b| a.max(b.abs()));
        for &node in &held {
            let x = self.mesh.nodes[node];
            let to = match self.held.1 {
                Held::Moved(by) => plus(x, by.map(|v| factor * v)),
                Held::Turned(about, angle) => plus(about, turned(minus(x, about), factor * angle)),
            };
            let off = minus(at(node, u), to);
            if off.iter().any(|v| v.abs() > 1e-8 * size) {
                return Some(format!("node {node} is held elsewhere: {off:?}"));
            }
        }
        let mut rest = resisting(&self.mesh, &[self.material], u);
        // Without loads there are no forces but rounding.
        let least = 1e-6 * self.material.young;
        let scale = (rest.iter().flatten()).fold(least, |a: f64, b| a.max(b.abs()));
        if let Some((side, pressure)) = self.pressed {
            for [a, b] in edges(&self.mesh, side) {
                let along = minus(at(b as usize, u), at(a as usize, u));
                // Outwards is to the right.
                let half = [along[1], -along[0]].map(|v| 0.5 * factor * pressure * v);
                for node in [a, b] {
                    rest[node as usize] = plus(rest[node as usize], half);
                }
            }
        }
        for (&node, force) in end.nodes.iter().zip(&end.forces) {
            rest[node as usize] = minus(rest[node as usize], *force);
        }
        for (node, rest) in rest.iter().enumerate() {
            if !held.contains(&node) && rest.iter().any(|v| !(v.abs() <= 1e-6 * scale)) {
                return Some(format!(
                    "node {node} is out of balance by {rest:?} of {scale:e}"
                ));
            }
        }
        let turn = factor * self.motion.angle;
        let mut forces = vec![[0.0; 2]; u.len()];
        for (&node, force) in end.nodes.iter().zip(&end.forces) {
            forces[node as usize] = *force;
        }
        for node in nodes(&self.mesh, "bottom") {
            if held.contains(&node) {
                continue;
            }
            let x = at(node, u);
            // Where it was on the obstacle and where it is, in the obstacle's own frame.
            let own = |x: Point, factor: f64| self.motion.back(x, factor);
            let [was, is] = [own(at(node, before.1), before.0), own(x, factor)];
            let (distance, normal, slip) = match self.obstacle {
                Obstacle::HalfSpace { point, normal } => {
                    let tangent = [-normal[1], normal[0]];
                    let slip = dot(minus(is, was), tangent);
                    (dot(minus(is, point), normal), normal, slip)
                }
                Obstacle::Sphere { center, radius } => {
                    let [a, b] = [was, is].map(|x| minus(x, center));
                    let reach = dot(b, b).sqrt();
                    let angle = (a[0] * b[1] - a[1] * b[0]).atan2(dot(a, b));
                    (reach - radius, b.map(|v| v / reach), radius * angle)
                }
                Obstacle::Cylinder { .. } => unreachable!(),
            };
            let normal = turned(normal, turn);
            let tangent = [-normal[1], normal[0]];
            let [pressing, rubbing] = [normal, tangent].map(|d| dot(forces[node], d));
            let wrong = |what: &str| {
                Some(format!(
                    "node {node} {what}: {distance:e}, {pressing:e}, {rubbing:e} of {scale:e}, slip {slip:e}"
                ))
            };
            if !(distance >= -1e-6 * size) {
                return wrong("is in the obstacle");
            }
            if !(pressing >= -1e-6 * scale) {
                return wrong("is pulled");
            }
            if pressing > 1e-5 * scale && distance > 1e-5 * size {
                return wrong("is pressed without contact");
            }
            let most = self.coulomb * pressing;
            if rubbing.abs() > most + 1e-5 * scale {
                return wrong("rubs too much");
            }
            let slides = slip.abs() > 1e-5 * size && end.parts == 1;
            if slides && rubbing * slip.signum() > -most + 1e-4 * scale {
                return wrong("slides without friction against it");
            }
        }
        None
    }
}

/// Solves the problems of these seeds; what is wrong, and how many load steps converged, were found unstable, and ended otherwise.
fn campaign(seeds: std::ops::Range<u64>, stiffness: Stiffness) -> (Vec<String>, [usize; 3]) {
    let (mut wrong, mut counts) = (Vec::new(), [0; 3]);
    for seed in seeds {
        let problem = problem(seed);
        let ends = match tried(problem.model(), 1e-9, stiffness) {
            Ok(ends) => ends,
            // A corner that supports hold is driven into the obstacle.
            Err(error) if error.to_string().contains("supports drive the node") => continue,
            Err(error) => {
                wrong.push(format!("{seed}: {error}"));
                continue;
            }
        };
        let mut before = (0.0, vec![[0.0; 2]; problem.mesh.nodes.len()]);
        for (step, end) in ends.iter().enumerate() {
            match end.status {
                Status::Converged => counts[0] += 1,
                // It ends where it became so, which may be on the way.
                Status::Unstable => {
                    counts[1] += 1;
                    continue;
                }
                other => {
                    counts[2] += 1;
                    eprintln!(
                        "{seed}: step {} ended as {other:?} after {} iterations",
                        step + 1,
                        end.iterations
                    );
                    continue;
                }
            }
            let factor = problem.factors[step];
            if let Some(what) = problem.broken((before.0, &before.1), (factor, end)) {
                wrong.push(format!("{seed}: step {}: {what}", step + 1));
            }
            before = (factor, end.displacement.clone());
        }
    }
    (wrong, counts)
}

fn check(seeds: std::ops::Range<u64>) {
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let (wrong, counts) = campaign(seeds.clone(), stiffness);
        println!(
            "{stiffness:?}: {counts:?} converged, unstable, without an answer; wrong: {wrong:#?}"
        );
        assert!(wrong.is_empty(), "{wrong:#?}");
        let [converged, _, without] = counts;
        assert!(without * 100 <= converged, "{counts:?}");
    }
}

#[test]
fn random_bodies_obey_the_law() {
    check(1..121);
    // The tolerance of a loosely solved problem was 1.
    for seed in [22665, 41865] {
        for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
            let (wrong, _) = campaign(seed..seed + 1, stiffness);
            assert!(wrong.is_empty(), "{wrong:#?}");
        }
    }
}

#[test]
#[ignore = "minutes; CAMPAIGN_SEED and CAMPAIGN_PROBLEMS choose the problems"]
fn many_random_bodies_obey_the_law() {
    let first = number("CAMPAIGN_SEED").unwrap_or(1000);
    check(first..first + number("CAMPAIGN_PROBLEMS").unwrap_or(2000));
}
