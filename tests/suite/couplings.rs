//! Couplings of nodes with a point: beams and shafts in closed form, statics of distributed loads, what nodes do not determine.

use crate::common::apart;
use crate::common::models::{Answer, answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::{Material, Plane};
use signorini::engine::{Engine, Stiffness};
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Analysis, Coupling, Equation, Model, Pair, Support, Traction};
use signorini::output::{ContactReport, Results};
use signorini::solve::Event;
use signorini::ssnm::Status;
use std::ops::ControlFlow;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e9;

fn coupling<const D: usize>(found: &Answer<D>) -> ContactReport
where
    ElementKind: Space<D>,
{
    found.report().contacts.remove(0)
}

fn motion(report: &ContactReport) -> Vec<f64> {
    let known = report.motion.iter();
    known
        .map(|motion| motion.expect("it is determined"))
        .collect()
}

/// A beam of 8 × 1 of second order, ν = 0, whose root moves alike in x.
fn beam() -> Model {
    let mesh = rectangle([0.0, 0.0], [8.0, 1.0], [6, 2], CellShape::Quad, "beam", "");
    Model::on(mesh.raised().or_panic())
        .material(Material::new(YOUNG, 0.0))
        .thickness(0.5)
        .support(Support::on("left").x(0.0))
        .support(Support::at_point([0.0, 0.5]).y(0.0))
}

/// A moment M on the end bends the beam to an arc: θ = M l/(E I), and the middle of the end goes up by θ l/2. With that rotation in
/// place of the moment, the coupling carries the moment.
#[test]
fn a_moment_bends_a_beam_to_an_arc() {
    let (moment, inertia) = (1e4, 0.5 / 12.0);
    let turn = moment * 8.0 / (YOUNG * inertia);
    let end = || Coupling::on("right", [8.0, 0.5]);
    let couplings = [
        end().moment([moment]),
        end().turned(2, turn),
        // Another point of the same rigid end.
        Coupling::on("right", [9.0, 2.5]).moment([moment]),
        end().distributing().moment([moment]),
    ];
    for (case, coupling_of) in couplings.into_iter().enumerate() {
        for path in PATHS {
            let found = answer(beam().coupling(coupling_of.clone()), 1e-12, path);
            let report = coupling(&found);
            let up = turn * 4.0;
            let expected = match case {
                2 => [-2.0 * turn, up + turn, turn],
                _ => [0.0, up, turn],
            };
            assert!(
                apart(&motion(&report), &expected) < 1e-9 * up,
                "{case}: {report:?}"
            );
            assert!((report.moment[0] - moment).abs() < 1e-8 * moment);
            assert!(apart(&report.force, &[0.0, 0.0]) < 1e-8 * moment);
            for (x, u) in found
                .built
                .elastic
                .mesh
                .nodes
                .iter()
                .zip(found.displacement())
            {
                let curvature = turn / 8.0;
                let exact = [
                    -curvature * x[0] * (x[1] - 0.5),
                    0.5 * curvature * x[0] * x[0],
                ];
                assert!(apart(&u, &exact) < 1e-9 * up, "{case}: {x:?} {u:?}");
            }
        }
    }
}

/// Nodes of a line that follow a point beside it in y alone determine its displacement if its rotation is held: as with the point on
/// the line.
#[test]
fn a_held_rotation_is_no_part_of_a_sum() {
    let along = |x: f64| Coupling::on("right", [x, 0.5]).free([true, false]);
    let stated: [fn(Coupling) -> Coupling; 3] = [
        |coupling| coupling.force([0.0, 1e4]),
        |coupling| coupling.moved(1, 1e-3),
        |coupling| coupling.moved(1, 0.0),
    ];
    for stated in stated {
        for path in PATHS {
            let solved = |coupling: Coupling| {
                let model = beam().traction(Traction::on("right").y(1e3));
                answer(model.coupling(stated(coupling)), 1e-9, path)
            };
            let [beside, on] = [solved(along(10.0).turned(2, 0.0)), solved(along(8.0))];
            let [own, expected] = [&beside, &on].map(|found| coupling(found).motion);
            let (own, expected) = (own[1].expect("known"), expected[1].expect("known"));
            assert!((own - expected).abs() < 1e-8, "{own} {expected}");
            // Forces act on the nodes, two lengths beside the point.
            let (own, expected) = (coupling(&beside), coupling(&on));
            assert!(apart(&own.force, &expected.force) < 1e-6 * 1e4);
            assert!((own.moment[0] + 2.0 * own.force[1]).abs() < 1e-6 * 1e4);
            for (a, b) in beside.displacement().into_iter().zip(on.displacement()) {
                assert!(apart(&a, &b) < 1e-8, "{a:?} {b:?}");
            }
        }
    }
}

/// A round-ended bar in space turned about its axis by its end: a square shaft of hexahedra of second order, whose ends warp alike if
/// they are free to (distributing), so that Saint-Venant's torsion holds: M = G J θ/l with J = 0.1406 a⁴.
#[test]
fn a_torque_turns_a_shaft() {
    let mesh = block(
        [0.0; 3],
        [6.0, 1.0, 1.0],
        [6, 4, 4],
        SolidShape::Hexahedron,
        "shaft",
        "",
    );
    let model = Model::on(mesh.raised().or_panic()).material(Material::new(YOUNG, 0.25));
    let torque = 5e4;
    let twist = torque * 6.0 / (0.140_577 * YOUNG / 2.5);
    let model = model
        .coupling(Coupling::on("left", [0.0, 0.5, 0.5]).distributing().fixed())
        .coupling(
            Coupling::on("right", [6.0, 0.5, 0.5])
                .distributing()
                .moment([torque, 0.0, 0.0]),
        );
    for path in PATHS {
        let found = answer(model.clone(), 1e-10, path);
        let all = found.report().contacts;
        assert!(
            apart(&all[0].moment, &[-torque, 0.0, 0.0]) < 1e-8 * torque,
            "{:?}",
            all[0]
        );
        assert!(apart(&all[0].force, &[0.0; 3]) < 1e-8 * torque);
        assert!(apart(&motion(&all[0]), &[0.0; 6]) < 1e-9 * twist);
        let turned = motion(&all[1]);
        assert!(
            (turned[3] - twist).abs() < 5e-3 * twist,
            "{turned:?} {twist}"
        );
        assert!(apart(&turned[..3], &[0.0; 3]) < 1e-6 * twist, "{turned:?}");
    }
}

/// An eccentric force on a distributing coupling: the root carries the force and its moment.
#[test]
fn an_eccentric_force_is_carried() {
    let mesh = block(
        [0.0; 3],
        [3.0, 1.0, 2.0],
        [4, 3, 3],
        SolidShape::Tetrahedron,
        "arm",
        "",
    );
    let (point, force) = ([4.0, 2.5, -1.0], [3e4, -1e4, 2e4]);
    for rigid in [false, true] {
        let end = Coupling::on("right", point)
            .force(force)
            .moment([1e3, 2e3, 3e3]);
        let model = Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").fixed())
            .coupling(if rigid { end } else { end.distributing() });
        for path in PATHS {
            let found = answer(model.clone(), 1e-12, path);
            let root = &found.report().supports[0];
            assert!(
                apart(&root.force, &force.map(|f| -f)) < 1e-9 * 3e4,
                "{root:?}"
            );
            let arm: [f64; 3] = std::array::from_fn(|c| point[c] - root.centre[c]);
            let cross = |a: usize, b: usize| arm[a] * force[b] - arm[b] * force[a];
            let moment = [cross(1, 2) + 1e3, cross(2, 0) + 2e3, cross(0, 1) + 3e3];
            assert!(
                apart(&root.moment, &moment.map(|m| -m)) < 1e-9 * 1e5,
                "{root:?}"
            );
            let total = found.data.total_load;
            assert!(apart(&total, &force) < 1e-9 * 3e4, "{total:?}");
        }
    }
}

/// Rigid nodes keep their distances, to first order; along a free axis they do not.
#[test]
fn rigid_nodes_move_as_a_body() {
    let mesh = block(
        [0.0; 3],
        [2.0, 1.0, 1.0],
        [4, 3, 2],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    for free in [false, true] {
        let end = Coupling::on(["right", "top"], [2.0, 0.0, 0.0])
            .free([false, free, false])
            .force([1e5, 0.0, -4e5]);
        let model = Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").fixed())
            .coupling(end);
        let found = answer(model, 1e-11, Stiffness::Pcg);
        let (nodes, u) = (&found.built.elastic.mesh.nodes, found.displacement());
        // Without rows along y, nothing says where the point is along it.
        let report = coupling(&found);
        assert_eq!(report.motion[1].is_none(), free);
        let q: Vec<f64> = report.motion.iter().map(|q| q.unwrap_or(0.0)).collect();
        let most = q.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
        let mut off = [0.0_f64; 3];
        for (x, u) in nodes.iter().zip(&u) {
            if x[0] == 2.0 || x[2] == 1.0 {
                let [x, y, z] = [x[0] - 2.0, x[1], x[2]];
                let exact = [
                    q[0] + q[4] * z - q[5] * y,
                    q[1] + q[5] * x - q[3] * z,
                    q[2] + q[3] * y - q[4] * x,
                ];
                (0..3).for_each(|c| off[c] = off[c].max((u[c] - exact[c]).abs()));
            }
        }
        assert!(off[0] < 1e-9 * most && off[2] < 1e-9 * most, "{off:?}");
        assert_eq!(off[1] > 1e-4 * most, free, "{off:?}");
    }
}

/// A ring moves along its axis, and keeps its radius.
#[test]
fn a_coupled_ring_moves_along_its_axis() {
    let mesh = rectangle([1.0, 0.0], [1.0, 2.0], [3, 5], CellShape::Quad, "ring", "");
    let (nu, moved) = (0.3, 1e-4);
    let model = |end: Coupling| {
        Model::on(mesh.clone())
            .plane(Plane::Axisymmetric)
            .material(Material::new(YOUNG, nu))
            .support(Support::on("bottom").y(0.0))
            .coupling(end)
    };
    let found = answer(
        model(
            Coupling::on("top", [0.0, 2.0])
                .distributing()
                .moved(1, moved),
        ),
        1e-12,
        Stiffness::Cholesky,
    );
    let report = coupling(&found);
    // Uniform: the radius of the free sides changes freely.
    let force = YOUNG * moved / 2.0 * std::f64::consts::PI * 3.0;
    assert!((report.force[1] - force).abs() < 1e-9 * force, "{report:?}");
    assert_eq!((report.motion[0], report.motion[2]), (None, None));
    let found = answer(
        model(Coupling::on("top", [0.0, 2.0]).moved(1, moved)),
        1e-12,
        Stiffness::Cholesky,
    );
    for (x, u) in found
        .built
        .elastic
        .mesh
        .nodes
        .iter()
        .zip(found.displacement())
    {
        assert!(x[1] < 2.0 || apart(&u, &[0.0, moved]) < 1e-9 * moved);
    }
    let refused = model(Coupling::on("top", [0.0, 2.0]).turned(2, 0.1));
    let text = refused
        .build()
        .expect_err("a ring does not turn")
        .to_string();
    assert!(text.contains("moves along y alone: leave out rz"), "{text}");
}

/// A coupling without any load or motion adds rigidity and holds nothing.
#[test]
fn a_free_point_holds_nothing() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let model = Model::on(mesh)
        .material(Material::new(YOUNG, 0.3))
        .coupling(
            Coupling::on("left", [0.0, 0.0])
                .moved(0, 0.0)
                .turned(2, 0.0),
        )
        .traction(Traction::on("top").y(-1e3));
    let built = model.build().or_panic();
    let steps = built
        .solve(&on_the_cpu(1e-9, Stiffness::Cholesky))
        .or_panic();
    assert_eq!(steps[0].status, Status::NotHeld);
    let motion = &steps[0].not_held[0].motion;
    assert!(motion.contains("slides along (0.000, -1.000)"), "{motion}");
}

#[test]
fn what_nodes_do_not_determine_is_refused() {
    let mut mesh: Mesh<3> = block(
        [0.0; 3],
        [2.0, 1.0, 1.0],
        [2, 1, 1],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let at = |x: [f64; 3]| mesh.nodes.iter().position(|y| *y == x).expect("a corner") as u32;
    let edge = vec![at([2.0, 0.0, 0.0]), at([2.0, 1.0, 0.0])];
    mesh.node_sets.insert("edge".to_owned(), edge);
    let refusal = |coupling: Coupling<3>| {
        let model = Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").fixed())
            .coupling(coupling);
        model.build().expect_err("it is refused").to_string()
    };
    let point = [2.0, 0.0, 0.0];
    for (coupling, text) in [
        (
            Coupling::at_nodes("edge", point).turned(1, 0.1),
            "coupling 1 on the nodes \"edge\": its nodes do not determine the motion ry",
        ),
        (
            Coupling::at_nodes("edge", point)
                .distributing()
                .moment([0.0, 1.0, 0.0]),
            "do not determine the motion ry of the point: couple nodes",
        ),
        (
            Coupling::at_nodes("edge", point)
                .turned(1, 0.0)
                .moment([0.0, 1.0, 0.0]),
            "do not determine the motion ry of the point, which is held at 0: a load along it would act on nothing",
        ),
        (Coupling::on("nowhere", point), "nowhere"),
        (Coupling::on("right", point).moment([1.0]), "three entries"),
        (
            Coupling::on("right", point).free([true; 3]),
            "free leaves nothing",
        ),
        (
            Coupling::on("right", point).force([f64::NAN, 0.0, 0.0]),
            "must be finite",
        ),
    ] {
        let refused = refusal(coupling);
        assert!(refused.contains(text), "{refused}");
    }
    // About the other axes an edge turns.
    let held = Coupling::at_nodes("edge", point)
        .turned(0, 1e-3)
        .turned(2, 0.0);
    let model = Model::on(mesh.clone())
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("left").fixed())
        .coupling(held);
    let report = coupling(&answer(model, 1e-11, Stiffness::Cholesky));
    assert_eq!(report.motion[4], None);
    assert!((report.motion[3].expect("known") - 1e-3).abs() < 1e-12);
}

/// A motion that supports contradict is an error, whichever load step has it; one that they make themselves is not.
#[test]
fn a_motion_against_supports_is_refused() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let model = |by: f64| {
        Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("bottom").x(0.0).y(2e-4))
            .coupling(
                Coupling::on("bottom", [0.0, 0.0])
                    .moved(1, by)
                    .factors([1.0, by / 2e-4]),
            )
            .steps([1.0, 1.0])
    };
    let text = model(1e-4)
        .build()
        .expect_err("it is contradicted")
        .to_string();
    assert!(
        text.contains("against the motion that a coupling, a preload or an equation states"),
        "{text}"
    );
    let found = answer(model(2e-4), 1e-10, Stiffness::Cholesky);
    assert!((motion(&coupling(&found))[1] - 2e-4).abs() < 1e-15);
}

/// A plate whose nodes all move with one point is rigid: pressed on three columns with ν = 0, of which the middle one is lower, it goes
/// down by the force over the stiffness of the two others, and of all three once it has reached that one.
#[test]
fn a_rigid_plate_is_pressed_on_columns() {
    let part = |x: f64, size: [f64; 2], y: f64, name: &str| {
        let prefix = format!("{name}-");
        rectangle([x, y], size, [2, 2], CellShape::Quad, name, &prefix)
    };
    let (heights, gap) = ([1.0, 0.9998, 1.0], 2e-4);
    let mut mesh = part(-0.5, [6.0, 0.5], 1.0, "plate");
    let plate: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    mesh.node_sets.insert("all".to_owned(), plate);
    for (i, height) in heights.into_iter().enumerate() {
        mesh = join(
            mesh,
            part(2.0 * i as f64, [1.0, height], 0.0, &format!("column{i}")),
        );
    }
    let stiffness = heights.map(|height| YOUNG / height);
    let touches = gap * (stiffness[0] + stiffness[2]);
    let model = |force: f64| {
        let columns = ["column0", "column1", "column2"];
        let feet: Vec<String> = columns
            .iter()
            .map(|name| format!("{name}-bottom"))
            .collect();
        let model = Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.0))
            .support(Support::on(feet).fixed())
            .coupling(
                Coupling::at_nodes("all", [2.5, 1.0])
                    .moved(0, 0.0)
                    .force([0.0, -force]),
            );
        columns.into_iter().fold(model, |model, name| {
            model.contact(Pair::new(format!("{name}-top"), "plate-bottom"))
        })
    };
    for path in PATHS {
        for force in [0.5 * touches, 3.0 * touches] {
            let found = answer(model(force), 1e-11, path);
            let down = match force < touches {
                true => force / (stiffness[0] + stiffness[2]),
                false => (force + stiffness[1] * gap) / stiffness.iter().sum::<f64>(),
            };
            let report = found.report();
            for (i, contact) in report.contacts[..3].iter().enumerate() {
                let pressed = stiffness[i] * (down - [0.0, gap, 0.0][i]).max(0.0);
                assert!(
                    (contact.normal_force - pressed).abs() < 1e-8 * force,
                    "{i}: {contact:?}"
                );
            }
            let moved = motion(&report.contacts[3]);
            assert!(apart(&moved, &[0.0, -down, 0.0]) < 1e-8 * down, "{moved:?}");
        }
    }
}

/// Constraints that contradict each other have no answer, whatever forces cancel at their nodes.
#[test]
fn contradictions_do_not_converge() {
    let mesh = rectangle([0.0; 2], [1.0, 4.0], [4, 16], CellShape::Quad, "bar", "");
    let model = || {
        Model::on(mesh.clone())
            .material(Material::new(1e5, 0.3))
            .support(Support::on("bottom").fixed())
    };
    let floor = Obstacle::HalfSpace {
        point: [0.0, 0.0],
        normal: [0.0, 1.0],
    };
    let turned = || Coupling::on("top", [0.5, 4.0]).turned(2, 0.01);
    let level = Equation::of(0.0).point([1.0, 4.0], [0.0, 1.0]);
    let level = level.point([0.0, 4.0], [0.0, -1.0]);
    let pressed = Model::on(mesh.clone())
        .material(Material::new(1e5, 0.3))
        .support(Support::on("top").fixed())
        .coupling(
            Coupling::on("bottom", [0.5, 0.0])
                .moved(0, 0.0)
                .moved(1, -1e-3)
                .turned(2, 0.0),
        )
        .contact(Pair::obstacle("bottom", floor));
    let bar = model().traction(Traction::on("top").y(1.0));
    for (model, contradicts) in [
        (model().coupling(turned()).equation(level), true),
        (pressed, true),
        (bar.coupling(turned()), false),
    ] {
        for path in PATHS {
            let built = model.clone().build().or_panic();
            let mut options = on_the_cpu(1e-6, path);
            if !contradicts {
                // Without an answer for another reason.
                options.settings.ssnm.max_iterations = 1;
            }
            let folder = tempfile::tempdir().or_panic();
            let analysis = Analysis::from(&built);
            let mut results = Results::new(folder.path(), "", analysis).or_panic();
            let engine = Engine::new(analysis.problem, options.engine.clone(), |_| {});
            let made = analysis.solve_on(&mut engine.or_panic(), &options.settings, |event| {
                if let Event::Ends(step) = event {
                    results.add(&step).or_panic();
                }
                ControlFlow::Continue(())
            });
            made.or_panic();
            let report = &results.report;
            assert_ne!(report.status, Some(Status::Converged), "{path:?}");
            let named = report
                .hints
                .iter()
                .any(|hint| hint.contains("contradict each other"));
            assert_eq!(named, contradicts, "{path:?}: {:?}", report.hints);
        }
    }
}
