//! Directions about an axis, inclined symmetry, torque.

use super::*;
use crate::engine::{self, Stiffness};
use crate::mesh::structured::{SolidShape, block};
use crate::quasistatic::StepSolution;
use crate::solve::SolveOptions;
use crate::ssnm::Status;
use std::f64::consts::PI;

/// Both ways to apply K⁻¹.
const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];

fn solved<const D: usize>(built: &Built<D>, stiffness: Stiffness) -> StepSolution<D>
where
    ElementKind: crate::contact::Space<D>,
{
    let mut options = SolveOptions {
        engine: engine::EngineOptions {
            stiffness,
            place: engine::Device::Cpu,
            ..Default::default()
        },
        ..Default::default()
    };
    options.settings.ssnm.tolerance = 1e-9;
    let mut made = (built.solve(&options)).unwrap_or_else(|error| panic!("{error}"));
    let step = made.pop().expect("there is a step");
    assert_eq!(step.status, Status::Converged);
    step
}

fn displacements<const D: usize>(built: &Built<D>, stiffness: Stiffness) -> Vec<[f64; D]>
where
    ElementKind: crate::contact::Space<D>,
{
    let step = built.step(0).unwrap_or_else(|error| panic!("{error}"));
    step.unknowns.displacements(&solved(built, stiffness).u)
}

fn largest<const D: usize>(u: &[[f64; D]]) -> f64 {
    u.as_flattened().iter().fold(0.0, |max, v| max.max(v.abs()))
}

/// A rotation about an axis other than x, y and z, and a shift.
fn moved(x: [f64; 3]) -> [f64; 3] {
    let x = turned(x);
    [x[0] + 0.3, x[1] - 2.0, x[2] + 0.7]
}

fn turned(x: [f64; 3]) -> [f64; 3] {
    // Rows of a rotation by the quaternion (4, 1, 2, 3) / √30.
    let rows = [[4.0, -20.0, 22.0], [28.0, 10.0, 4.0], [-10.0, 20.0, 20.0]];
    rows.map(|row| (0..3).map(|c| row[c] * x[c] / 30.0).sum())
}

/// A block, held on two sides by symmetry, driven on a third, pressed on the ground with friction: in its position, and
/// rotated. Nodes on the edges are held in two and in all directions, some of the ground too.
#[test]
fn a_turned_model_has_the_turned_solution() {
    let mesh = block(
        [0.0; 3],
        [2.0, 1.0, 1.0],
        [6, 3, 3],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let mut other = mesh.clone();
    other.nodes.iter_mut().for_each(|x| *x = moved(*x));
    let built = |mesh: Mesh<3>, point: [f64; 3], normal: [f64; 3], far: &[Support<3>], load| {
        let ground = Obstacle::HalfSpace { point, normal };
        let model = Model::on(mesh)
            .material(RUBBER)
            .support(Support::on(["left", "back"]).symmetry())
            .traction(load)
            .contact(Pair::obstacle("bottom", ground).coulomb(0.2));
        let model = far.iter().cloned().fold(model, Model::support);
        model.build().unwrap_or_else(|error| panic!("{error}"))
    };
    let here = built(
        mesh,
        [0.0; 3],
        [0.0, 0.0, 1.0],
        &[Support::on("right").x(-0.01).y(0.0)],
        Traction::on("top").pressure(2e5).force([0.0, -9e3, 0.0]),
    );
    let along = |axis: [f64; 3]| Axis::new(moved([0.0; 3]), turned(axis));
    let there = built(
        other,
        moved([0.0; 3]),
        turned([0.0, 0.0, 1.0]),
        &[
            Support::on("right")
                .about(along([2.0, 0.0, 0.0]))
                .axial(-0.01),
            Support::on("right")
                .about(along([0.0, -0.5, 0.0]))
                .axial(0.0),
        ],
        Traction::on("top")
            .pressure(2e5)
            .force(turned([0.0, -9e3, 0.0])),
    );
    assert_eq!(here.problem.n_free(), there.problem.n_free());
    assert_eq!(here.problem.m(), there.problem.m());
    for path in PATHS {
        let (a, b) = (displacements(&here, path), displacements(&there, path));
        let size = largest(&a);
        for (a, b) in a.iter().zip(&b) {
            let a = turned(*a);
            for c in 0..3 {
                assert!((a[c] - b[c]).abs() < 1e-6 * size, "{path:?}: {a:?} {b:?}");
            }
        }
    }
}

/// A ring sector from the inner to the outer radius, over an angle from `from` on, along z.
fn sector(cells: [usize; 3], radii: [f64; 2], from: f64, angle: f64, long: f64) -> Mesh<3> {
    let mut mesh = block(
        [0.0; 3],
        [1.0; 3],
        cells,
        SolidShape::Hexahedron,
        "body",
        "",
    );
    for x in &mut mesh.nodes {
        let (r, phi) = (radii[0] + (radii[1] - radii[0]) * x[0], from + angle * x[1]);
        *x = [r * phi.cos(), r * phi.sin(), long * x[2]];
    }
    mesh
}

/// Lamé's thick ring in plane strain as a sector of 40° between inclined planes of symmetry, under a pressure inside
/// and with its outer side moved outwards. The same by `radial` alone in the plane.
#[test]
fn a_sector_of_a_ring_is_a_ring() {
    let (inner, outer, pressure, out) = (1.0_f64, 2.0_f64, 1e6, 0.02);
    let (e, nu) = (RUBBER.young, RUBBER.poisson);
    let (lambda, mu) = (
        e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        e / (2.0 * (1.0 + nu)),
    );
    // u = A r + B / r, σ_r = 2 (λ + μ) A − 2 μ B / r².
    let b = (2.0 * (lambda + mu) * out / outer + pressure)
        / (2.0 * (lambda + mu) / outer.powi(2) + 2.0 * mu / inner.powi(2));
    let a = out / outer - b / outer.powi(2);
    let exact = |r: f64| a * r + b / r;
    let mesh = sector([32, 12, 1], [inner, outer], 0.4, 40.0 * PI / 180.0, 0.1);
    let built = Model::on(mesh)
        .material(RUBBER)
        .support(Support::on(["front", "back", "bottom", "top"]).symmetry())
        .support(
            Support::on("right")
                .about(Axis::new([0.0, 0.0, 7.0], [0.0, 0.0, -3.0]))
                .radial(out),
        )
        .traction(Traction::on("left").pressure(pressure))
        .build();
    let built = built.unwrap_or_else(|error| panic!("{error}"));
    for path in PATHS {
        let u = displacements(&built, path);
        for (x, u) in built.elastic.mesh.nodes.iter().zip(&u) {
            let r = x[0].hypot(x[1]);
            let radial = (x[0] * u[0] + x[1] * u[1]) / r;
            let hoop = (x[0] * u[1] - x[1] * u[0]) / r;
            assert!((radial / exact(r) - 1.0).abs() < 2e-3, "{radial} at {r}");
            assert!(hoop.abs() < 1e-4 * exact(r) && u[2].abs() < 1e-9);
        }
    }
    // All round, in the plane, held against turning by the outer side alone.
    let mut ring = rectangle([0.0; 2], [1.0, 1.0], [16, 60], CellShape::Quad, "body", "");
    for x in &mut ring.nodes {
        let (r, phi) = (
            inner + (outer - inner) * x[0],
            2.0 * PI * x[1] * 59.0 / 60.0,
        );
        *x = [r * phi.cos(), r * phi.sin()];
    }
    let around = |name: &str| Support::on(name).about(Axis::at([0.0; 2]));
    let built = Model::on(ring)
        .material(RUBBER)
        .support(around("right").radial(out))
        .support(around("bottom").hoop(0.0))
        .support(around("top").hoop(0.0))
        .traction(
            Traction::on("left")
                .about(Axis::at([0.0; 2]))
                .radial(pressure),
        )
        .build();
    let built = built.unwrap_or_else(|error| panic!("{error}"));
    for (x, u) in (built.elastic.mesh.nodes.iter()).zip(displacements(&built, Stiffness::Cholesky))
    {
        let r = x[0].hypot(x[1]);
        let radial = (x[0] * u[0] + x[1] * u[1]) / r;
        assert!((radial / exact(r) - 1.0).abs() < 1e-2, "{radial} at {r}");
    }
}

/// A round bar under a torque: the fixed end carries exactly that, and the angle is M l / (G J).
#[test]
fn a_torque_is_held_by_the_other_end() {
    let (radius, long, torque) = (0.5_f64, 3.0, 400.0);
    let mut mesh = block(
        [-1.0, -1.0, 0.0],
        [2.0, 2.0, long],
        [12, 12, 9],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    for x in &mut mesh.nodes {
        // The square to the disc.
        let [a, b] = [x[0], x[1]];
        x[0] = radius * a * (1.0 - 0.5 * b * b).sqrt();
        x[1] = radius * b * (1.0 - 0.5 * a * a).sqrt();
    }
    let axis = Axis::new([0.0, 0.0, 1.0], [0.0, 0.0, 2.0]);
    let model = Model::on(mesh).material(RUBBER).support(
        Support::on("bottom")
            .about(axis)
            .radial(0.0)
            .hoop(0.0)
            .axial(0.0),
    );
    let loaded = |traction| {
        let built = model.clone().traction(traction).build();
        built.unwrap_or_else(|error| panic!("{error}"))
    };
    let built = loaded(Traction::on("top").about(axis).torque(torque));
    let step = built.step(0).unwrap_or_else(|error| panic!("{error}"));
    let forces = step.forces.iter().zip(&built.elastic.mesh.nodes);
    let moment: f64 = forces.map(|(f, x)| x[0] * f[1] - x[1] * f[0]).sum();
    assert!((moment / torque - 1.0).abs() < 1e-12);
    assert!(
        step.total_load
            .iter()
            .all(|f| f.abs() < 1e-9 * torque / radius)
    );
    let shear = RUBBER.young / (2.0 * (1.0 + RUBBER.poisson));
    let angle = torque * long / (shear * 0.5 * PI * radius.powi(4));
    let u = displacements(&built, Stiffness::Pcg);
    for (x, u) in built.elastic.mesh.nodes.iter().zip(&u) {
        if x[2] == long && x[0].hypot(x[1]) > 0.999 * radius {
            let hoop = (x[0] * u[1] - x[1] * u[0]) / radius;
            assert!((hoop / (angle * radius) - 1.0).abs() < 0.02, "{hoop}");
        }
    }
    // The same as traction around the axis, and driven by the angle.
    let polar = loaded(
        Traction::on("top")
            .about(axis)
            .hoop(move |x: [f64; 3]| torque * x[0].hypot(x[1]) / (0.5 * PI * radius.powi(4))),
    );
    let forces = polar.step(0).map(|step| step.forces).unwrap_or_default();
    let forces = forces.iter().zip(&polar.elastic.mesh.nodes);
    let moment: f64 = forces.map(|(f, x)| x[0] * f[1] - x[1] * f[0]).sum();
    assert!((moment / torque - 1.0).abs() < 0.02, "{moment}");
    let driven = model
        .support(
            Support::on("top")
                .about(axis)
                .hoop(move |x: [f64; 3]| angle * x[0].hypot(x[1]))
                .radial(0.0),
        )
        .build();
    let driven = driven.unwrap_or_else(|error| panic!("{error}"));
    let twisted = displacements(&driven, Stiffness::Cholesky);
    for (x, u) in driven.elastic.mesh.nodes.iter().zip(&twisted) {
        let turn = angle * x[2] / long;
        let exact = [-turn * x[1], turn * x[0], 0.0];
        for c in 0..3 {
            assert!((u[c] - exact[c]).abs() < 1e-3 * angle * radius);
        }
    }
}

/// Supports that meet at a node in different directions are combined where they agree, and an error where not; a node
/// on the axis has no radial direction.
#[test]
fn directions_that_meet_agree_or_are_reported() {
    let mesh = || sector([2, 3, 2], [1.0, 2.0], 0.0, PI / 2.0, 1.0);
    let axis = Axis::new([0.0; 3], [0.0, 0.0, 1.0]);
    let model = || {
        Model::on(mesh())
            .material(STEEL)
            .support(Support::on("right").about(axis).radial(1e-3))
    };
    let displacement = |model: Model<3>| -> Result<Vec<[f64; 3]>, String> {
        let built = model.build().map_err(|error| error.to_string())?;
        Ok(displacements(&built, Stiffness::Cholesky))
    };
    // x, y and z overdetermine the node beside radial, but agree with it.
    let whole = model().support(
        Support::on("right")
            .x(|x: [f64; 3]| 1e-3 * x[0] / x[0].hypot(x[1]))
            .y(|x: [f64; 3]| 1e-3 * x[1] / x[0].hypot(x[1]))
            .z(0.0),
    );
    let u = displacement(whole).unwrap_or_else(|error| panic!("{error}"));
    for (x, u) in mesh().nodes.iter().zip(&u) {
        let r = x[0].hypot(x[1]);
        if r > 2.0 - 1e-9 {
            let exact = [1e-3 * x[0] / r, 1e-3 * x[1] / r, 0.0];
            for c in 0..3 {
                assert!((u[c] - exact[c]).abs() < 1e-15, "{u:?} {exact:?}");
            }
        }
    }
    let message = |model: Model<3>| displacement(model).err().unwrap_or_default();
    let against = message(model().support(Support::on("right").x(0.0).y(0.0)));
    assert!(
        against
            .contains("support 2 on \"right\": two supports prescribe different displacements in "),
        "{against}"
    );
    let on_axis = Axis::new([1.0, 0.0, 0.0], [0.0, 0.0, 1.0]);
    let radial = message(model().support(Support::on("front").about(on_axis).radial(0.0)));
    assert!(
        radial.contains(
            "lies on the axis, where radial and hoop have no direction: hold both at 0 there"
        ),
        "{radial}"
    );
    let both = Support::on("front").about(on_axis).radial(0.0).hoop(0.0);
    let clamped = Model::on(mesh())
        .material(STEEL)
        .support(both)
        .support(Support::on("bottom").z(0.0))
        .build();
    assert!(clamped.is_ok());
    for (support, expected) in [
        (Support::on("front").radial(0.0), "need an axis: state it"),
        (
            Support::on("front").x(0.0).about(axis),
            "no component about it",
        ),
        (
            Support::on("front")
                .hoop(0.0)
                .about(Axis::new([0.0; 3], [0.0; 3])),
            "an axis needs a finite point and a direction that is not zero",
        ),
    ] {
        let text = message(model().support(support));
        assert!(text.contains(expected), "{text}");
    }
    let traction = Traction::on("left").torque(1.0);
    let text = message(model().traction(traction));
    assert!(text.contains("need an axis: state it"), "{text}");
}

/// A ring that may only turn: the motion that supports along radial directions leave is found, and is the one.
#[test]
fn radial_supports_leave_the_turn() {
    let mesh = sector([2, 9, 2], [1.0, 2.0], 0.3, 1.5, 1.0);
    let axis = Axis::new([0.0; 3], [0.0, 0.0, 1.0]);
    let wall = Obstacle::HalfSpace {
        point: mesh.nodes[0],
        normal: [-0.3_f64.sin(), 0.3_f64.cos(), 0.0],
    };
    let built = Model::on(mesh)
        .material(RUBBER)
        .support(Support::on("right").about(axis).radial(0.0).axial(0.0))
        .traction(Traction::on("back").pressure(1e3))
        .contact(Pair::obstacle("front", wall))
        .build();
    let built = built.unwrap_or_else(|error| panic!("{error}"));
    let message = Analysis::from(&built).floating_bodies();
    assert_eq!(built.problem.floating_bodies().n_modes(), 1, "{message:?}");
    assert!(
        message[0].ends_with("can rotate as a whole: only contact holds it"),
        "{message:?}"
    );
    let all: Vec<f64> = PATHS
        .iter()
        .map(|&path| {
            let lambda = solved(&built, path).lambda;
            let nodes = built.elastic.contact.places.iter().zip(&lambda);
            // The moment about the axis balances that of the pressure on 1 × 1 at 1.5.
            nodes
                .map(|(place, force)| place.place[0].hypot(place.place[1]) * force)
                .sum()
        })
        .collect();
    for moment in all {
        assert!((moment / 1500.0 - 1.0).abs() < 1e-6, "{moment}");
    }
}
