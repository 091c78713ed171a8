//! Problems with Coulomb friction in space.

use crate::common::Random;
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{SolidShape, block, join};
use signorini::model::{BodyForce, Model, Pair, Quantity, Support, Traction};
use signorini::reference::{CASE_C, MATERIAL};

pub type Vector = [f64; 3];

pub fn half_space(height: f64, normal: Vector) -> Obstacle<3> {
    Obstacle::HalfSpace {
        point: [0.0, 0.0, height],
        normal,
    }
}

pub fn floor() -> Obstacle<3> {
    half_space(0.0, [0.0, 0.0, 1.0])
}

pub fn body(mesh: Mesh<3>, poisson: f64) -> Model<3> {
    Model::on(mesh).material(Material {
        poisson,
        ..MATERIAL
    })
}

pub fn cuboid(size: Vector, q: usize, shape: SolidShape) -> Mesh<3> {
    let cells = size.map(|edge| (edge * q as f64).round() as usize);
    block([0.0; 3], size, cells, shape, "body", "")
}

/// Case C without its contact.
pub fn loaded_as_c(q: usize, shape: SolidShape, poisson: f64) -> Model<3> {
    let end = CASE_C.end;
    body(cuboid(CASE_C.size, q, shape), poisson)
        .support(Support::on("left").fixed())
        .traction(Traction::on("top").z(|x: Vector| (CASE_C.top)(x)[2]))
        .traction(Traction::on("right").x(end[0]).y(end[1]).z(end[2]))
}

/// Case C under Coulomb's law.
pub fn case_c(q: usize, mu: f64) -> Model<3> {
    loaded_as_c(q, SolidShape::Hexahedron, MATERIAL.poisson).contact(on_floor(mu))
}

pub fn on_floor(mu: impl Into<Quantity<3>>) -> Pair<3> {
    Pair::obstacle("bottom", floor()).coulomb(mu)
}

/// The beam of the reference, of any length.
pub fn beam(length: f64, mu: f64) -> Model<3> {
    let pressed = move |x: Vector| match x[0] < 0.7 * length {
        true => -2e6 * (1.0 + x[1]),
        false => 0.0,
    };
    let mesh = cuboid([length, 1.0, 1.0], 3, SolidShape::Hexahedron);
    body(mesh, MATERIAL.poisson)
        .support(Support::on("left").fixed())
        .traction(Traction::on("top").z(pressed))
        .traction(Traction::on("right").y(1e5))
        .contact(on_floor(mu))
}

/// A cube that only the floor holds, pulled by a part of the friction limit and twisted about its axis.
pub fn cube(q: usize, mu: f64, part: f64, twist: f64) -> Model<3> {
    let pressure = 1e7;
    let (pull, twist) = (part * mu * pressure, twist * mu * pressure);
    let top = Traction::on("top")
        .z(move |x: Vector| -pressure * (1.0 + 0.3 * part * (x[0] - 0.5)))
        .x(move |x: Vector| pull - twist * (x[1] - 0.5))
        .y(move |x: Vector| 0.5 * pull + twist * (x[0] - 0.5));
    body(
        cuboid([1.0; 3], q, SolidShape::Hexahedron),
        MATERIAL.poisson,
    )
    .traction(top)
    .contact(on_floor(mu))
}

/// A ball of radius 1 about the origin, of n³ cells.
pub fn ball(n: usize) -> Mesh<3> {
    let shape = SolidShape::Hexahedron;
    let mut mesh = block([-1.0; 3], [2.0; 3], [n; 3], shape, "body", "");
    for node in &mut mesh.nodes {
        let [x, y, z] = node.map(|v| v * v);
        let on = |a: f64, b: f64| (1.0 - a / 2.0 - b / 2.0 + a * b / 3.0).sqrt();
        let by = [on(y, z), on(z, x), on(x, y)];
        *node = std::array::from_fn(|c| node[c] * by[c]);
    }
    mesh
}

/// A ball on the floor under its weight, pushed sideways.
pub fn ball_on_floor(n: usize, mu: f64, push: f64) -> Model<3> {
    let weight = 2e7;
    let force = BodyForce::everywhere()
        .z(-weight)
        .x(push * mu * weight)
        .y(0.5 * push * mu * weight);
    body(ball(n), MATERIAL.poisson)
        .body_force(force)
        .contact(Pair::obstacle("bottom", half_space(-1.0, [0.0, 0.0, 1.0])).coulomb(mu))
}

/// A ball pressed on the floor by its upper part, which is then driven sideways and back.
pub fn driven_ball(n: usize, mu: f64) -> Model<3> {
    let ground = half_space(-1.0, [0.0, 0.0, 1.0]);
    body(ball(n), MATERIAL.poisson)
        .support(
            Support::on("top")
                .z(-0.15)
                .factors([1.0, 1.0, 1.0, 1.0, 0.6]),
        )
        .support(
            Support::on("top")
                .x(0.1 * mu)
                .factors([0.0, 0.3, 1.0, -0.5, -0.5]),
        )
        .support(
            Support::on("top")
                .y(0.1 * mu)
                .factors([0.0, 0.0, 0.5, 1.0, 1.0]),
        )
        .contact(Pair::obstacle("bottom", ground).coulomb(mu))
        .steps([1.0; 5])
}

/// A block on a larger one that is fixed below, with meshes that do not match; nothing else holds the upper one.
pub fn block_on_block(q: usize, mu: f64, part: f64, twist: f64) -> Model<3> {
    let shape = SolidShape::Hexahedron;
    let low = block(
        [-0.5, -0.5, -1.0],
        [2.0, 2.0, 1.0],
        [2 * q, 2 * q, q],
        shape,
        "low",
        "low-",
    );
    let fine = q + 1;
    let up = block([0.0; 3], [1.0; 3], [fine, fine, q], shape, "up", "up-");
    let pressure = 1e7;
    let (pull, twist) = (part * mu * pressure, twist * mu * pressure);
    let top = Traction::on("up-top")
        .z(-pressure)
        .x(move |x: Vector| pull - twist * (x[1] - 0.5))
        .y(move |x: Vector| 0.5 * pull + twist * (x[0] - 0.5));
    Model::on(join(low, up))
        .material(MATERIAL)
        .support(Support::on("low-bottom").fixed())
        .traction(top)
        .contact(Pair::new("up-bottom", "low-top").coulomb(mu))
}

/// Blocks of all sizes and materials on floors in all directions, clamped, held in part or by nothing else.
pub fn random(seed: u64) -> (String, Model<3>) {
    let mut random = Random(0x9e37_79b9_7f4a_7c15_u64.wrapping_mul(2 * seed + 1));
    for _ in 0..8 {
        random.unit();
    }
    let mut pick = |values: &[f64]| values[random.below(values.len())];
    let size = [
        pick(&[1.0, 2.0, 4.0]),
        pick(&[0.5, 1.0, 2.0]),
        pick(&[0.5, 1.0]),
    ];
    let q = pick(&[2.0, 3.0, 4.0]);
    let mu = pick(&[0.05, 0.2, 0.4, 0.8, 1.5]);
    let held = pick(&[0.0, 0.0, 1.0, 2.0, 3.0]);
    let poisson = pick(&[0.0, 0.3, 0.45]);
    let [bumps, tilt] = [pick(&[0.0, 0.0, 1e-5]), pick(&[0.0, 0.0, 0.3, 0.8])];
    let steps = pick(&[1.0, 1.0, 3.0]) as usize;
    let shapes = [
        SolidShape::Hexahedron,
        SolidShape::Wedge,
        SolidShape::Tetrahedron,
    ];
    let shape = shapes[random.below(3)];
    let [a, b, c, d, e] = std::array::from_fn(|_| random.between(-1.0, 1.0));
    let pull = random.between(0.0, 1.2) * mu;
    let angle = random.between(0.0, 6.2);
    let cells = size.map(|edge| (edge * q).ceil() as usize);
    let mesh = block([0.0; 3], size, cells, shape, "body", "");
    let pressure = 1e7;
    // The floor falls by `tilt` times μ.
    let slope = tilt * mu;
    let normal = [slope * angle.cos(), slope * angle.sin(), 1.0];
    let top = Traction::on("top")
        .z(move |x: Vector| {
            -pressure * (1.0 + 0.3 * a * (x[0] / size[0] - 0.5) + 0.3 * b * (x[1] / size[1] - 0.5))
        })
        .x(move |x: Vector| pull * pressure * (c + 0.3 * e * (x[1] / size[1] - 0.5)))
        .y(pull * pressure * d);
    let wavy = move |x: Vector| bumps * (1.0 + (9.0 * x[0] + 5.0 * x[1]).sin());
    let mut pair = Pair::obstacle("bottom", half_space(0.0, normal)).coulomb(mu);
    if bumps > 0.0 || slope > 0.0 {
        pair = pair.gap(wavy);
    }
    let mut model = body(mesh, poisson).traction(top).contact(pair);
    model = match held as usize {
        0 => model,
        1 => model.support(Support::on("left").fixed()),
        2 => model.support(Support::on("left").x(0.0)),
        _ => model.support(Support::on("front").symmetry()),
    };
    if steps > 1 {
        model = model.steps([0.5, 1.0, -0.2, 0.7][..steps.min(4)].to_vec());
    }
    let name = format!(
        "random {seed}: {size:?} q {q} {shape:?} mu {mu} held {held} nu {poisson} tilt {tilt} bumps {bumps} steps {steps}"
    );
    (name, model)
}

pub fn cases_c(sizes: &[usize]) -> Vec<(String, Model<3>)> {
    let each = |&q: &usize| {
        [0.1, 0.3, 0.6, 1.0].map(|mu| (format!("case C, q = {q}, mu = {mu}"), case_c(q, mu)))
    };
    sizes.iter().flat_map(each).collect()
}
