//! Springs between places and to the ground: statics, springs in series and side by side, bodies that springs alone hold.

use crate::common::distance;
use crate::common::models::{Answer, answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use crate::common::solved;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::model::{AnyAnalysis, Force, Model, Spring, Support, Traction};
use signorini::output::ContactReport;
use signorini::ssnm::Status;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e9;

/// The displacement of the node at a point.
fn at<const D: usize>(found: &Answer<D>, point: [f64; D]) -> [f64; D]
where
    signorini::mesh::ElementKind: signorini::contact::Space<D>,
{
    let nodes = &found.built.elastic.mesh.nodes;
    let off = |x: &[f64; D]| (0..D).map(|c| (x[c] - point[c]).powi(2)).sum::<f64>();
    let nearest = (0..nodes.len()).min_by(|&a, &b| off(&nodes[a]).total_cmp(&off(&nodes[b])));
    found.displacement()[nearest.expect("there are nodes")]
}

/// A body on two upright springs and a level one, however soft: statics say what each carries, and each gives way by that over its
/// stiffness.
#[test]
fn a_body_hangs_on_springs_alone() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    for (soft, tolerance) in [(1.0, 1e-9), (1e-6, 1e-7)] {
        let k = [3e6 * soft, 5e6 * soft, 2e6 * soft];
        let model = Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .force(Force::at_point([0.5, 1.0]).x(100.0).y(-800.0))
            .spring(Spring::at_point([0.0, 0.0], k[0]).along([0.0, 1.0]))
            .spring(
                Spring::at_point([2.0, 0.0], k[1])
                    .along([0.0, -3.0])
                    .named("stay"),
            )
            .spring(Spring::at_point([2.0, 0.0], k[2]).along([2.0, 0.0]));
        // About the lower left corner: 2 b = −800 · 0.5 − 100.
        let b = (-800.0 * 0.5 - 100.0) / 2.0;
        let forces = [-800.0 - b, b, 100.0];
        for path in PATHS {
            let found = answer(model.clone(), 1e-10, path);
            let [left, right] = [at(&found, [0.0, 0.0]), at(&found, [2.0, 0.0])];
            let moved = [left[1], right[1], right[0]];
            for i in 0..3 {
                let expected = forces[i] / k[i];
                assert!(
                    (moved[i] - expected).abs() < tolerance * expected.abs(),
                    "{moved:?} {i}"
                );
            }
            // Pressed is above 0: towards where ν points.
            let report = found.report();
            let carried: Vec<f64> = report.contacts.iter().map(|one| one.normal_force).collect();
            assert!(distance(&carried, &[forces[0], -forces[1], forces[2]]) < 1e-8);
            assert_eq!(report.contacts[1].name.as_deref(), Some("stay"));
            assert!(report.contacts[0].friction.starts_with("spring along"));
            assert!(report.contacts[0].force[0] == 0.0);
            let of_points = |one: &ContactReport| one.area == 0.0 && one.max_pressure == 0.0;
            assert!(report.contacts.iter().all(of_points));
        }
    }
}

/// A motion that no spring resists is found, and named.
#[test]
fn what_springs_do_not_hold_is_not_held() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .force(Force::at_point([0.5, 1.0]).x(100.0).y(-800.0))
        .spring(Spring::at_point([0.0, 0.0], 1e6).along([0.0, 1.0]))
        .spring(Spring::at_point([2.0, 0.0], 1e6).along([0.0, 1.0]));
    let built = model.build().or_panic();
    let AnyAnalysis::Plane(analysis) = AnyAnalysis::Plane((&built).into()) else {
        unreachable!("it is one of the plane");
    };
    let floating = analysis.floating_bodies();
    assert!(floating[0].contains("only springs hold it"), "{floating:?}");
    let steps = built
        .solve(&on_the_cpu(1e-9, Stiffness::Cholesky))
        .or_panic();
    assert_eq!(steps[0].status, Status::NotHeld);
    assert!(
        steps[0].not_held[0].motion.contains("slides along (1.000"),
        "{:?}",
        steps[0].not_held
    );
}

/// Two blocks in a row, held at one end and pulled at the other, with springs between them: the gap opens by F/(k₁ + k₂), and by
/// F/k of each where they follow one another. Ends that are boundaries spread the force as an even traction does.
#[test]
fn springs_in_series_and_side_by_side() {
    let beam = |x: f64, name: &str, prefix: &str| {
        rectangle([x, 0.0], [1.0, 1.0], [3, 3], CellShape::Quad, name, prefix)
    };
    let mesh = join(
        join(beam(0.0, "a", "a-"), beam(2.0, "b", "b-")),
        beam(4.0, "c", "c-"),
    );
    let (k, force) = ([2e6, 3e6, 4e6], 500.0);
    let base = Model::on(mesh)
        .material(Material::new(YOUNG, 0.25))
        .support(Support::on("a-left").x(0.0))
        .support(Support::on(["a-bottom", "b-bottom", "c-bottom"]).y(0.0))
        .traction(Traction::on("c-right").x(force));
    let model = base
        .clone()
        .spring(Spring::on("a-right", k[0]).to("b-left"))
        .spring(Spring::on("a-right", k[1]).to("b-left"))
        .spring(Spring::on("c-left", k[2]).to("b-right"));
    for path in PATHS {
        let found = answer(model.clone(), 1e-11, path);
        // Uniform stresses F on an area of 1: each block is longer by F/E' and thinner by as much as ν' says.
        let nu = 0.25_f64;
        let strain = force * (1.0 - nu * nu) / YOUNG;
        let shifts = [
            0.0,
            force / (k[0] + k[1]),
            force / (k[0] + k[1]) + force / k[2],
        ];
        for (x, u) in (found.built.elastic.mesh.nodes.iter()).zip(found.displacement()) {
            let number = (x[0] / 2.0) as usize;
            let expected = [
                shifts[number] + strain * (x[0] - number as f64),
                -strain * nu / (1.0 - nu) * x[1],
            ];
            assert!(distance(&u, &expected) < 1e-8, "{x:?}: {u:?} {expected:?}");
        }
        let report = found.report();
        let pulled: Vec<f64> = report.contacts.iter().map(|one| one.normal_force).collect();
        let shared = |i: usize| -force * k[i] / (k[0] + k[1]);
        assert!(
            distance(&pulled, &[shared(0), shared(1), -force]) < 1e-9,
            "{pulled:?}"
        );
        assert_eq!(report.contacts[2].against, "b-right");
    }
}

/// An inclined spring in space between two blocks, from node to node along the line between them; the other ways are held.
#[test]
fn a_spring_acts_along_the_line_between_its_ends() {
    let solid = |z: f64, name: &str, prefix: &str| {
        block(
            [0.0, 0.0, z],
            [1.0, 1.0, 1.0],
            [2, 2, 2],
            SolidShape::Hexahedron,
            name,
            prefix,
        )
    };
    let mesh = join(solid(0.0, "low", "low-"), solid(3.0, "up", "up-"));
    // From (0, 0, 1) to (1, 1, 3): along (1, 1, 2)/√6.
    let way = [1.0, 1.0, 2.0].map(|v: f64| v / 6.0_f64.sqrt());
    let (k, lift) = (1e5, 2e-3);
    let model = Model::on(mesh)
        .material(Material::new(1e14, 0.3))
        .support(Support::on("low-bottom").fixed())
        .support(Support::on("up-top").x(0.0).y(0.0).z(lift))
        .spring(Spring::at_point([0.0, 0.0, 1.0], k).to_point([1.0, 1.0, 3.0]));
    for path in PATHS {
        let found = answer(model.clone(), 1e-10, path);
        let pull = k * lift * way[2];
        let report = found.report();
        for c in 0..3 {
            let [low, up] = [0, 1].map(|i: usize| report.supports[i].force[c]);
            assert!((low + pull * way[c]).abs() < 1e-6 * pull, "{low} {c}");
            assert!((up - pull * way[c]).abs() < 1e-6 * pull, "{up} {c}");
        }
    }
}

/// With both ends held there is nothing to solve for, and the force is what the supports say; with one end held, half of that.
#[test]
fn supports_may_hold_the_ends() {
    let mut mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    mesh.node_sets.insert("corner".to_owned(), vec![0]);
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("left").x(0.0).y(1e-3).factors([0.0, 1.0, -2.0]))
        .steps([1.0, 1.0, 1.0])
        .spring(Spring::at_nodes("corner", 1e6).along([0.0, 1.0]));
    for path in PATHS {
        let found = answer(model.clone(), 1e-10, path);
        let carried = found.report().contacts[0].normal_force;
        assert!((carried + 2e3).abs() < 1e-6, "{carried}");
    }
}

fn refusal(text: &str) -> String {
    let text = format!(
        "[mesh.rectangle]\nsize = [1, 1]\ncells = [2, 2]\n[[material]]\nyoung = 1e5\npoisson = 0.3\n[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n[[spring]]\n{text}"
    );
    solved::refusal(&text)
}

#[test]
fn a_spring_that_makes_no_sense_is_refused() {
    for (text, expected) in [
        (
            "stiffness = 1",
            "line 11: a spring needs one of boundary, nodes and point",
        ),
        (
            "point = [1, 1]\nstiffness = 1",
            "a spring to the ground needs a direction",
        ),
        (
            "point = [1, 1]\nstiffness = 0\ndirection = [1, 0]",
            "it must be above 0",
        ),
        (
            "point = [1, 1]\nstiffness = 1\ndirection = [0, 0]",
            "the direction of a spring must be finite and not zero",
        ),
        (
            "point = [1, 1]\nstiffness = 1\ndirection = [1, 0, 0]",
            "expected 2 entries, found 3",
        ),
        (
            "point = [1, 1]\nstiffness = 1\nto = {}",
            "the other end of a spring",
        ),
        (
            "point = [1, 1]\nstiffness = 1\nto = { point = [1.02, 1] }\ndirection = [1, 0]",
            "line 11: both ends of the spring are the same nodes",
        ),
        (
            "boundary = \"rigth\"\nstiffness = 1\ndirection = [1, 0]",
            "did you mean \"right\"?",
        ),
        (
            "point = [1, 1]\nstiffness = 1\nto = { nodes = \"a\" }",
            "there is no set of nodes \"a\"",
        ),
    ] {
        let error = refusal(&format!("{text}\n"));
        assert!(error.contains(expected), "{error}");
    }
}
