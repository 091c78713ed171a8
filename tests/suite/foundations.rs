//! Elastic foundations under boundaries: the beam on one, blocks under uniform pressure, bodies that they hold, wholly or in part.

use crate::common::distance;
use crate::common::models::answer;
use crate::common::or_panic::OrPanic as _;
use crate::common::solved;
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::{Material, Plane};
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Force, Foundation, Model, Pair, Support, Traction};
use std::f64::consts::PI;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e5;

/// A long beam on a foundation with a force in the middle: w = F β/(2k) e^(−βx) (cos βx + sin βx) with β⁴ = k/(4EI). Shear adds 0.3 % of
/// that to it (β h = 0.1).
#[test]
fn a_long_beam_sinks_in_as_winkler_says() {
    let (half, height, depth, force) = (60.0, 1.0, 0.5, 1.0);
    let beta: f64 = 0.1;
    let bending = YOUNG * depth * height * height * height / 12.0;
    // Per length, and per area.
    let k = 4.0 * bending * beta.powi(4);
    let mesh = rectangle(
        [0.0, 0.0],
        [half, height],
        [120, 2],
        CellShape::Quad,
        "beam",
        "",
    );
    let model = Model::on(mesh.raised().or_panic())
        .plane(Plane::PlaneStress)
        .thickness(depth)
        .material(Material::new(YOUNG, 0.0))
        // Half of it.
        .support(Support::on("left").x(0.0))
        .traction(Traction::on("left").force([0.0, -0.5 * force]))
        .foundation(Foundation::under("bottom").normal(k / depth));
    for path in PATHS {
        let found = answer(model.clone(), 1e-10, path);
        let largest = force * beta / (2.0 * k);
        let mesh = &found.built.elastic.mesh;
        let mut seen = 0;
        for (x, u) in mesh.nodes.iter().zip(found.displacement()) {
            if x[1] == 0.0 && x[0] < 40.0 {
                let s = beta * x[0];
                let expected = -largest * (-s).exp() * (s.cos() + s.sin());
                assert!(
                    (u[1] - expected).abs() < 6e-3 * largest,
                    "{x:?}: {} {expected}",
                    u[1]
                );
                seen += 1;
            }
        }
        assert_eq!(seen, 160);
        // All of the force goes into the ground, at a distance from the middle that is no matter of the mesh.
        let ground = &found.report().supports[1];
        assert_eq!(ground.support, "bottom, foundation");
        assert!((ground.force[1] - 0.5 * force).abs() < 1e-9 && ground.force[0].abs() < 1e-9);
    }
}

/// Blocks of any kind of element under a pressure p on a foundation k: u = −p/k − p y/E, to rounding, in the plane, in space, and as a
/// ring, whose force is that of all of it.
fn uniform<const D: usize>(mesh: Mesh<D>, plane: impl Fn(Model<D>) -> Model<D>, area: f64)
where
    ElementKind: Space<D>,
{
    let (p, k, rubbed) = (3e3, 5e4, 7e3);
    let up = D - 1;
    for mesh in [mesh.clone(), mesh.raised().or_panic()] {
        let nodes = mesh.nodes.clone();
        let model = plane(Model::on(mesh))
            .material(Material::new(YOUNG, 0.0))
            .traction(Traction::on("top").pressure(p))
            .foundation(
                Foundation::under("bottom")
                    .normal(k)
                    .tangential(rubbed)
                    .named("soil"),
            );
        for path in PATHS {
            for factors in [vec![1.0], vec![1.0, -0.5, 2.0]] {
                let last = *factors.last().expect("not empty");
                let found = answer(model.clone().steps(factors), 1e-11, path);
                let scale = p / k;
                for (x, u) in nodes.iter().zip(found.displacement()) {
                    for c in 0..D {
                        let expected = match c == up {
                            true => -last * p * (1.0 / k + x[up] / YOUNG),
                            false => 0.0,
                        };
                        assert!((u[c] - expected).abs() < 1e-9 * scale, "{x:?} {u:?}");
                    }
                }
                let report = found.report();
                let ground = report.supports.last().expect("the foundation is one");
                assert_eq!(ground.support, "soil");
                let expected = last * p * area;
                assert!((ground.force[up] - expected).abs() < 1e-8 * expected.abs());
                assert!(
                    ground
                        .moment
                        .iter()
                        .all(|m| m.abs() < 1e-7 * expected.abs())
                );
            }
        }
    }
}

#[test]
fn a_block_sinks_in_as_a_whole() {
    for shape in [CellShape::Quad, CellShape::Triangle] {
        let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [5, 3], shape, "body", "");
        uniform(mesh.clone(), |model| model.thickness(0.25), 0.5);
        // From the radius 0 to 2.
        uniform(mesh, |model| model.plane(Plane::Axisymmetric), 4.0 * PI);
    }
    for shape in [
        SolidShape::Hexahedron,
        SolidShape::Tetrahedron,
        SolidShape::Wedge,
    ] {
        let mesh = block([0.0; 3], [2.0, 1.5, 1.0], [3, 3, 2], shape, "body", "");
        uniform(mesh, |model| model, 3.0);
    }
}

/// What resists across the normal: a block pushed along, and a stiffness that grows along it, so that the rigid block turns: two
/// equations for a motion (v, ω): ∫ k(x) (v + ω x) = F, ∫ k(x) x (v + ω x) = F a.
#[test]
fn a_stiff_block_moves_as_two_equations_say() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let (k, force, rubbed) = (|x: f64| 1e3 * (1.0 + x), 40.0, 2e3);
    let model = Model::on(mesh)
        // Next to rigid.
        .material(Material::new(1e10, 0.3))
        .force(Force::at_point([0.5, 0.0]).y(-force).x(0.1 * force))
        .foundation(
            Foundation::under("bottom")
                .normal(move |x: [f64; 2]| k(x[0]))
                .tangential(rubbed),
        );
    // ∫ (1 + x) x^n over 0 … 2.
    let [zeroth, first, second] = [0, 1, 2].map(|n: i32| {
        let power = |n: i32| 2.0_f64.powi(n + 1) / f64::from(n + 1);
        1e3 * (power(n) + power(n + 1))
    });
    let determinant = zeroth * second - first * first;
    let v = -force * (second - 0.5 * first) / determinant;
    let omega = -force * (0.5 * zeroth - first) / determinant;
    let found = answer(model, 1e-10, Stiffness::Cholesky);
    for (x, u) in (found.built.elastic.mesh.nodes.iter()).zip(found.displacement()) {
        let expected = [
            0.1 * force / (2.0 * rubbed) - omega * x[1],
            v + omega * x[0],
        ];
        for c in 0..2 {
            assert!(
                (u[c] - expected[c]).abs() < 1e-5 * v.abs(),
                "{x:?}: {u:?} {expected:?}"
            );
        }
    }
}

/// On a slope, with nodes of the foundation that a plane of symmetry holds along their own directions: as the same block upright.
#[test]
fn a_foundation_may_share_its_nodes_with_supports_in_any_direction() {
    let solve = |angle: f64, path| {
        let (sin, cos) = angle.sin_cos();
        let turned = |x: [f64; 2]| [cos * x[0] - sin * x[1], sin * x[0] + cos * x[1]];
        let mut mesh = rectangle([0.0, 0.0], [2.0, 1.0], [6, 3], CellShape::Quad, "body", "");
        mesh.nodes.iter_mut().for_each(|x| *x = turned(*x));
        let push = turned([300.0, -2e3]);
        let model = Model::on(mesh.raised().or_panic())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").symmetry())
            .traction(Traction::on("top").x(push[0]).y(push[1]))
            .foundation(
                Foundation::under(["bottom", "right"])
                    .normal(4e4)
                    .tangential(1e4),
            );
        let found = answer(model, 1e-11, path);
        let back = |u: [f64; 2]| [cos * u[0] + sin * u[1], cos * u[1] - sin * u[0]];
        let u: Vec<f64> = found.displacement().into_iter().flat_map(back).collect();
        let forces = found.report().supports;
        let forces = forces
            .iter()
            .flat_map(|one| back([one.force[0], one.force[1]]));
        (u, forces.collect::<Vec<f64>>())
    };
    let (upright, forces) = solve(0.0, Stiffness::Cholesky);
    // The loads and both reactions are in balance.
    assert!((forces[0] + forces[2] + 600.0).abs() < 1e-7 && (forces[3] - 4e3).abs() < 1e-7);
    for path in PATHS {
        let (turned, turned_forces) = solve(0.6, path);
        assert!(distance(&turned, &upright) < 1e-9);
        assert!(distance(&turned_forces, &forces) < 1e-9);
    }
}

/// What a foundation leaves free, contact holds or nothing does.
#[test]
fn a_foundation_may_hold_a_body_in_part() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let on_rollers = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .traction(Traction::on("left").pressure(5e3))
        .foundation(Foundation::under("bottom").normal(1e5));
    let error = on_rollers
        .clone()
        .build()
        .expect_err("it slides")
        .to_string();
    assert!(
        error.contains("can move in x as a whole, and it has no contact to hold it"),
        "{error}"
    );
    let wall = Obstacle::HalfSpace {
        point: [2.0, 0.0],
        normal: [-1.0, 0.0],
    };
    let held = on_rollers.contact(Pair::obstacle("right", wall));
    for path in PATHS {
        let found = answer(held.clone(), 1e-11, path);
        let report = found.report();
        assert!((report.contacts[0].force[0] + 5e3).abs() < 1e-6);
        assert!(report.supports[0].force.iter().all(|f| f.abs() < 1e-6));
    }
}

/// Lines of a case file on a square.
fn refusal(text: &str) -> String {
    let text = format!(
        "[mesh.rectangle]\nsize = [1, 1]\ncells = [2, 2]\n[[material]]\nyoung = 1e5\npoisson = 0.3\n[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n{text}"
    );
    solved::refusal(&text)
}

#[test]
fn a_foundation_that_makes_no_sense_is_refused() {
    for (text, expected) in [
        ("stiffness = {}", "line 13: a foundation needs a stiffness"),
        (
            "stiffness = { normal = \"x - 0.5\" }",
            "it must be finite and not negative",
        ),
        ("stiffness = { normal = 1e-90 }", "the stiffness is 1e-90"),
        ("", "missing field `stiffness`"),
    ] {
        let error = refusal(&format!("[[foundation]]\nboundary = \"bottom\"\n{text}\n"));
        assert!(error.contains(expected), "{error}");
    }
    let error = refusal("[[foundation]]\nboundary = \"botom\"\nstiffness = { normal = 1 }\n");
    assert!(error.contains("did you mean \"bottom\"?"), "{error}");
}
