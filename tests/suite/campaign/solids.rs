//! Random problems in space: blocks of all shapes, materials and units on half-spaces, balls and cylinders, in corners, and
//! on each other with meshes that do not match; clamped, guided, driven or held by contact alone; in several load steps.

use super::problems::Problem;
use crate::common::Random;
use crate::common::cases::Trial;
use crate::common::draw::{chance, decade, generator, pick};
use crate::common::space::{UPRIGHT, Vector, dot, rotation, times};
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{SolidShape, block, join};
use signorini::model::{BodyForce, Model, Pair, Support, Traction};
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// The problem of a seed, or why it could not be built.
pub fn solid(seed: u64) -> Result<Problem<3>, String> {
    let random = &mut generator(seed ^ 0x0050_11d0_0000_0000);
    // All random choices, in words.
    let mut name = String::new();
    // Three problems of four are convex.
    let coulomb = chance(random, 0.25);
    let (family, model) = if chance(random, 0.75) {
        ("solid", one_body(random, coulomb, &mut name))
    } else {
        ("solids", two_bodies(random, coulomb, &mut name))
    };
    let built = model.build().map_err(|error| error.to_string())?;
    let mut loads = Vec::new();
    for number in 0..built.n_steps() {
        loads.push(built.step(number).map_err(|error| error.to_string())?.load);
    }
    Ok(Problem {
        family,
        trial: Trial {
            text: String::new(),
            name,
            problem: built.problem,
            loads,
        },
        known: None,
        held: None,
    })
}

/// A block and its properties.
struct Block {
    size: Vector,
    cells: [usize; 3],
    shape: SolidShape,
    material: Material,
    /// The scale of forces: a pressure that strains the material by 1e-7 to 1e-3.
    pressure: f64,
}

impl Block {
    fn new(random: &mut Random, name: &mut String) -> Self {
        let unit = decade(random, -3.0, 2.0);
        let size = [(); 3].map(|()| unit * decade(random, -0.4, 0.4));
        let most = if chance(random, 0.2) { 5 } else { 3 };
        let cells = [(); 3].map(|()| 1 + random.below(most));
        let shapes = [
            SolidShape::Hexahedron,
            SolidShape::Wedge,
            SolidShape::Tetrahedron,
        ];
        let shape = pick(random, &shapes);
        let young = decade(random, 2.0, 12.0);
        let poisson = pick(random, &[0.0, 0.2, 0.3, 0.45, 0.49]);
        let pressure = young * decade(random, -7.0, -3.0);
        let _ = write!(
            name,
            "{size:.3?} of {cells:?} {shape:?}, E {young:.1e}, nu {poisson}, p {pressure:.1e}"
        );
        let material = Material::new(young, poisson);
        Self {
            size,
            cells,
            shape,
            material,
            pressure,
        }
    }

    fn mesh(&self, corner: Vector, region: &str, prefix: &str) -> Mesh<3> {
        block(corner, self.size, self.cells, self.shape, region, prefix)
    }
}

/// One to four load steps.
fn factors(random: &mut Random, name: &mut String) -> Vec<f64> {
    let steps = pick(random, &[1, 1, 1, 2, 4]);
    let factors: Vec<f64> = (0..steps)
        .map(|step| match step {
            0 => 1.0,
            // Unloading, reversal and more.
            _ => pick(random, &[0.0, 0.3, 0.7, 1.5, -0.2, -1.0]),
        })
        .collect();
    if steps > 1 {
        let _ = write!(name, ", steps {factors:?}");
    }
    factors
}

/// The law of a pair.
fn friction(
    random: &mut Random,
    pair: Pair<3>,
    coulomb: bool,
    held: bool,
    body: &Block,
    name: &mut String,
) -> Pair<3> {
    // A block without other supports needs some.
    if coulomb {
        let mu = decade(random, if held { -2.0 } else { -0.7 }, 0.3);
        let _ = write!(name, ", mu {mu:.3}");
        return pair.coulomb(mu);
    }
    let bound = body.pressure * decade(random, if held { -4.0 } else { -0.5 }, 1.5);
    match random.below(5) {
        0 if held => {
            name.push_str(", no friction");
            pair
        }
        1 => {
            let _ = write!(name, ", g {bound:.1e}, not everywhere");
            let waves = body.size.map(|edge| random.between(0.0, 9.0) / edge);
            pair.tresca(move |x: Vector| bound * dot(waves, x).sin().max(0.0))
        }
        _ => {
            let _ = write!(name, ", g {bound:.1e}");
            pair.tresca(bound)
        }
    }
}

/// A traction that presses, mostly, and shears.
fn pressed(
    random: &mut Random,
    on: &str,
    body: &Block,
    held: bool,
    turn: [Vector; 3],
    name: &mut String,
) -> Traction<3> {
    let p = body.pressure
        * if held && chance(random, 0.1) {
            -1.0
        } else {
            1.0
        };
    let most = if held { 0.3 } else { -0.5 };
    let shear =
        [(); 2].map(|()| body.pressure * decade(random, -3.0, most) * random.between(-1.0, 1.0));
    let [a, b] = [(); 2].map(|()| random.between(-0.8, 0.8) * if held { 1.0 } else { 0.4 });
    let _ = write!(
        name,
        ", {on} {:.2e} {:.2e} {p:.2e} ({a:.2}, {b:.2})",
        shear[0], shear[1]
    );
    let size = body.size;
    // The rotated body is judged in its original frame.
    let back: [Vector; 3] = std::array::from_fn(|j| std::array::from_fn(|i| turn[i][j]));
    let force = move |x: Vector| {
        let x = times(&back, x);
        let across = [x[0] / size[0] - 0.5, x[1] / size[1] - 0.5];
        times(
            &turn,
            [
                shear[0],
                shear[1],
                -p * (1.0 + a * across[0] + b * across[1]),
            ],
        )
    };
    Traction::on(on)
        .x(move |x: Vector| force(x)[0])
        .y(move |x: Vector| force(x)[1])
        .z(move |x: Vector| force(x)[2])
}

fn one_body(random: &mut Random, coulomb: bool, name: &mut String) -> Model<3> {
    let body = Block::new(random, name);
    let held = pick(
        random,
        &[
            "no",
            "no",
            "left",
            "left",
            "point",
            "guided",
            "symmetric",
            "driven",
        ],
    );
    let is_held = matches!(held, "left" | "driven");
    let _ = write!(name, ", held: {held}");
    let turn = if chance(random, 0.3) {
        let axis = [(); 3].map(|()| random.between(-1.0, 1.0));
        rotation(axis, random.between(0.0, TAU))
    } else {
        UPRIGHT
    };
    let upright = turn == UPRIGHT;
    let mut mesh = body.mesh([0.0; 3], "body", "");
    for node in &mut mesh.nodes {
        *node = times(&turn, *node);
    }
    let [lx, ly, lz] = body.size;
    let below = lx.min(ly);
    let strain = body.pressure / body.material.young;
    // A gap that the load may close, or none.
    let gap = lz * strain * pick(random, &[0.0, 0.0, 0.0, 0.1, 0.5, 3.0]);
    let bumps = lz * strain * pick(random, &[0.0, 0.0, 0.3, 2.0]);
    let waves = [(); 2].map(|()| random.between(0.0, 9.0) / below);
    let middle = times(&turn, [0.5 * lx, 0.5 * ly, 0.0]);
    let radius = below * decade(random, -0.3, 2.0);
    let down = |by: f64| {
        let off = times(&turn, [0.0, 0.0, by]);
        std::array::from_fn(|c| middle[c] - off[c])
    };
    let obstacle = match random.below(8) {
        0 => Obstacle::Sphere {
            center: down(radius),
            radius,
        },
        1 => Obstacle::Cylinder {
            point: down(radius),
            axis: times(&turn, [random.between(-1.0, 1.0), 1.0, 0.0]),
            radius,
        },
        2 | 3 => {
            // A slope on which the block rests with its edge or a corner.
            let most = if is_held { 1.0 } else { 0.3 };
            let slope = [(); 2].map(|()| most * random.between(-0.4, 0.4));
            let corner = [
                if slope[0] < 0.0 { lx } else { 0.0 },
                if slope[1] < 0.0 { ly } else { 0.0 },
                0.0,
            ];
            Obstacle::HalfSpace {
                point: times(&turn, corner),
                normal: times(&turn, [slope[0], slope[1], 1.0]),
            }
        }
        _ => Obstacle::HalfSpace {
            point: middle,
            normal: turn[2],
        },
    };
    let kind = match obstacle {
        Obstacle::HalfSpace { normal, .. } => format!("plane {normal:.2?}"),
        Obstacle::Sphere { radius, .. } => format!("ball {radius:.2e}"),
        Obstacle::Cylinder { radius, .. } => format!("cylinder {radius:.2e}"),
    };
    let _ = write!(
        name,
        " on {kind}, gap {gap:.1e}, bumps {bumps:.1e}, upright {upright}"
    );
    let pair = Pair::obstacle("bottom", obstacle)
        .gap(move |x: Vector| gap + bumps * (1.0 + (waves[0] * x[0] + waves[1] * x[1]).sin()));
    let mut model = Model::on(mesh)
        .material(body.material)
        .contact(friction(random, pair, coulomb, is_held, &body, name));
    if chance(random, 0.15) {
        name.push_str(", at a wall");
        let wall = Pair::obstacle(
            "right",
            Obstacle::HalfSpace {
                point: times(&turn, [lx, 0.0, 0.0]),
                normal: turn[0].map(|v| -v),
            },
        );
        model = model.contact(friction(random, wall, coulomb, is_held, &body, name));
    }
    let factors = factors(random, name);
    model = match held {
        "left" => model.support(Support::on("left").fixed()),
        "point" if upright => model.support(Support::at_point([0.0, 0.0, lz]).fixed()),
        "guided" if upright => model.support(Support::on("left").x(0.0)),
        "symmetric" if upright => model.support(Support::on("front").symmetry()),
        "driven" => {
            let by = times(&turn, [0.0, 0.0, -lz * strain]);
            let top = || Support::on("top").factors(factors.clone());
            model.support(top().x(by[0]).y(by[1]).z(by[2]))
        }
        _ => model,
    };
    if held != "driven" {
        let load = pressed(random, "top", &body, is_held, turn, name);
        model = model.traction(load.factors(factors.clone()));
    }
    if chance(random, 0.3) {
        let weight = body.pressure / lz * decade(random, -1.0, 1.0);
        let force = times(&turn, [0.0, 0.0, -weight]);
        let _ = write!(name, ", weight {weight:.1e}");
        let force = BodyForce::everywhere().x(force[0]).y(force[1]).z(force[2]);
        model = model.body_force(force);
    }
    if chance(random, if is_held { 0.3 } else { 0.05 }) {
        let side = pressed(random, "back", &body, is_held, turn, name);
        model = model.traction(side);
    }
    let steps = factors.len();
    if steps > 1 {
        model = model.steps(vec![1.0; steps]);
    }
    model
}

fn two_bodies(random: &mut Random, coulomb: bool, name: &mut String) -> Model<3> {
    let mut low = Block::new(random, name);
    name.push_str(" under ");
    let mut up = Block::new(random, name);
    // Steel on rubber, or on foam.
    low.material.young = up.material.young * decade(random, -4.5, 4.5);
    let is_held = chance(random, 0.4);
    let _ = write!(name, " of E {:.1e}, held {is_held}", low.material.young);
    // Of the same size; the upper one rests on the lower one, or overhangs.
    let scale = low.size[0] / up.size[0];
    up.size = up.size.map(|edge| edge * scale * decade(random, -0.4, 0.1));
    low.pressure = up.pressure;
    // With a part of it beside the lower one, or not.
    let mut along = |axis: usize| match random.between(-0.3, 0.3) {
        part if part < 0.0 => part * up.size[axis],
        part => part * low.size[axis],
    };
    let place = [along(0), along(1), low.size[2]];
    let _ = write!(name, ", at {place:.3?} of size {:.3?}", up.size);
    let mesh = join(
        low.mesh([0.0; 3], "low", "low-"),
        up.mesh(place, "up", "up-"),
    );
    let pair = Pair::new("up-bottom", "low-top");
    let mut model = Model::on(mesh)
        .material_in("low", low.material)
        .material_in("up", up.material)
        .contact(friction(random, pair, coulomb, is_held, &up, name));
    if chance(random, 0.3) {
        let floor = Obstacle::HalfSpace {
            point: [0.0; 3],
            normal: UPRIGHT[2],
        };
        let pair = Pair::obstacle("low-bottom", floor);
        model = model.contact(friction(random, pair, coulomb, is_held, &up, name));
    } else {
        model = model.support(Support::on("low-bottom").fixed());
    }
    if is_held {
        model = model.support(Support::on("up-left").fixed());
    } else if chance(random, 0.3) {
        name.push_str(", guided");
        model = model.support(Support::on("up-left").x(0.0));
    }
    let factors = factors(random, name);
    let load = pressed(random, "up-top", &up, is_held, UPRIGHT, name);
    let steps = factors.len();
    model = model.traction(load.factors(factors));
    if steps > 1 {
        model = model.steps(vec![1.0; steps]);
    }
    model
}
