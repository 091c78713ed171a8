//! Supports that begin, end and hold where they are, against models whose supports do not change; equations between displacements.

use crate::common::apart;
use crate::common::models::{Answer, answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::model::{Axis, Coupling, Equation, Model, Pair, Support, Traction};
use signorini::ssnm::Status;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e9;

fn mesh() -> Mesh {
    rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "")
}

fn displacement(found: &Answer<2>, step: usize) -> Vec<[f64; 2]> {
    let steps: Vec<_> = found.before.iter().chain([&found.solution]).collect();
    let data = found.built.step(step).or_panic();
    data.unknowns.displacements(&steps[step].u)
}

fn difference(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    apart(a.as_flattened(), b.as_flattened())
}

/// With friction on a floor, without a memory of it in the first step: a support acts as if it were alone in the model, and its end
/// lets the body go. What it holds is in the report as the force on it.
#[test]
fn a_support_acts_in_the_steps_that_are_stated() {
    let depth = 1e-3;
    let model = |of_side: Option<Support>| {
        let model = Model::on(mesh())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("bottom").y(0.0))
            .support(Support::at_point([0.0, 0.0]).x(0.0))
            .traction(Traction::on("top").y(-1e6));
        of_side.into_iter().fold(model, Model::support)
    };
    let side = || Support::on("right").x(depth).y(|x: [f64; 2]| -1e-4 * x[1]);
    let side_alone = || {
        Support::on("right")
            .x(depth)
            .y(|x: [f64; 2]| -1e-4 * x[1])
            .named("side")
    };
    for path in PATHS {
        let with = answer(model(Some(side_alone())), 1e-12, path);
        let without = answer(model(None), 1e-12, path);
        let changing =
            model(Some(side().named("side").active([1.0, 0.0, 1.0]))).steps([1.0, 1.0, 1.0]);
        let found = answer(changing, 1e-12, path);
        let [held, free] = [with.displacement(), without.displacement()];
        for (step, expected) in [&held, &free, &held].into_iter().enumerate() {
            let off = difference(&displacement(&found, step), expected);
            assert!(off < 1e-9 * depth, "{path:?}, {step}: {off:e}");
        }
        let [expected, reports] = [with.reports(), found.reports()];
        let support = |step: usize| &reports[step].supports[2];
        assert_eq!(support(0).support, "side");
        let size = 1e6;
        assert!(apart(&support(0).force, &expected[0].supports[2].force) < 1e-8 * size);
        assert!(apart(&support(0).moment, &expected[0].supports[2].moment) < 1e-8 * size);
        assert!(
            apart(&support(1).force, &[0.0, 0.0]) < 1e-8 * size,
            "{:?}",
            support(1)
        );
        assert!(reports[0].contacts.is_empty());
    }
}

/// Stretched by a force, clamped where it is, let go: the clamp takes the force over, and the bar stays as long as it is.
#[test]
fn a_lock_holds_nodes_where_they_are() {
    let force = 4e6;
    let model = Model::on(mesh())
        .material(Material::new(YOUNG, 0.0))
        .support(Support::on("left").x(0.0))
        .support(Support::at_point([0.0, 0.0]).y(0.0))
        .support(
            Support::on("right")
                .x(0.0)
                .active([0.0, 1.0, 1.0, 0.0])
                .locked_in([0.0, 1.0, 1.0, 0.0])
                .named("clamp"),
        )
        .traction(Traction::on("right").x(force).factors([1.0, 1.0, 0.0, 0.0]))
        .steps([1.0, 1.0, 1.0, 1.0]);
    for path in PATHS {
        let found = answer(model.clone(), 1e-12, path);
        let long = 2.0 * force / YOUNG;
        for (step, stretched, taken) in
            [(0, 1.0, 0.0), (1, 1.0, 0.0), (2, 1.0, force), (3, 0.0, 0.0)]
        {
            for (x, u) in mesh().nodes.iter().zip(displacement(&found, step)) {
                let expected = [stretched * long * x[0] / 2.0, 0.0];
                assert!(
                    apart(&u, &expected) < 1e-9 * long,
                    "{step}: {u:?} {expected:?}"
                );
            }
            let clamp = &found.reports()[step].supports[2];
            assert!(
                apart(&clamp.force, &[taken, 0.0]) < 1e-8 * force,
                "{step}: {clamp:?}"
            );
        }
    }
}

/// The only support of a body: it presses the body onto a floor, where friction keeps it when it has gone.
#[test]
fn a_body_is_let_go_on_a_floor() {
    let model = Model::on(mesh())
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("left").fixed().active([1.0, 0.0]))
        .traction(Traction::on("top").y(-1e6))
        .traction(Traction::on("right").x(1e5))
        .contact(
            Pair::obstacle(
                "bottom",
                Obstacle::HalfSpace {
                    point: [0.0, 0.0],
                    normal: [0.0, 1.0],
                },
            )
            .coulomb(0.3),
        )
        .steps([1.0, 1.0]);
    for path in PATHS {
        let found = answer(model.clone(), 1e-10, path);
        let floor = &found.reports()[1].contacts[0];
        assert!(apart(&floor.force, &[-1e5, 2e6]) < 1e-7 * 2e6, "{floor:?}");
    }
}

/// u_x(a) + 2 u_y(b) − u_x(c) = v against the forces that superposition gives: the multiplier is (v − c·u₀)/(c·K⁻¹c).
#[test]
fn an_equation_holds_between_displacements() {
    let [a, b, c] = [[2.0, 0.0], [1.0, 1.0], [2.0, 1.0]];
    let value = 3e-4;
    let base = || {
        Model::on(mesh())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").fixed())
    };
    let load = |scale: f64| base().traction(Traction::on("right").y(-1e5 * scale));
    let row = |u: &[[f64; 2]]| {
        let at = |x: [f64; 2]| mesh().nodes.iter().position(|y| *y == x).expect("a node");
        u[at(a)][0] + 2.0 * u[at(b)][1] - u[at(c)][0]
    };
    for path in PATHS {
        let free = answer(load(1.0), 1e-12, path).displacement();
        let unit = |x: [f64; 2], f: [f64; 2]| signorini::model::Force::at_point(x).x(f[0]).y(f[1]);
        let of_unit = base()
            .force(unit(a, [1e5, 0.0]))
            .force(unit(b, [0.0, 2e5]))
            .force(unit(c, [-1e5, 0.0]));
        let of_unit = answer(of_unit, 1e-12, path).displacement();
        let times = (value - row(&free)) / row(&of_unit);
        let equation = Equation::of(value)
            .point(a, [1.0, 0.0])
            .point(b, [0.0, 2.0])
            .point(c, [-1.0, 0.0]);
        let found = answer(load(1.0).equation(equation), 1e-12, path).displacement();
        let expected: Vec<[f64; 2]> = free
            .iter()
            .zip(&of_unit)
            .map(|(u, v)| std::array::from_fn(|k| u[k] + times * v[k]))
            .collect();
        assert!((row(&found) - value).abs() < 1e-9 * value);
        assert!(difference(&found, &expected) < 1e-8 * value);
    }
}

/// Equations of sets, one for each node: sides that keep a distance that grows, as a periodic cell has; and their factors.
#[test]
fn equations_of_sets_make_a_periodic_cell() {
    let mut mesh = block(
        [0.0; 3],
        [2.0, 1.0, 1.0],
        [4, 3, 3],
        SolidShape::Hexahedron,
        "cell",
        "",
    );
    let side = |x: f64| -> Vec<u32> {
        let of_side = |node: &u32| mesh.nodes[*node as usize][0] == x;
        (0..mesh.nodes.len() as u32).filter(of_side).collect()
    };
    let sides = [side(0.0), side(2.0)];
    for (name, nodes) in ["low", "high"].into_iter().zip(sides) {
        mesh.node_sets.insert(name.to_owned(), nodes);
    }
    let strain = 1e-3;
    let mut model = Model::on(mesh.clone())
        .material(Material::new(YOUNG, 0.3))
        .support(Support::at_point([0.0; 3]).fixed())
        .support(Support::at_point([0.0, 1.0, 0.0]).x(0.0).z(0.0))
        .support(Support::at_point([0.0, 0.0, 1.0]).x(0.0))
        .steps([0.5, 1.0]);
    for axis in 0..3 {
        let way = |sign: f64| std::array::from_fn(|c| if c == axis { sign } else { 0.0 });
        let value = if axis == 0 { 2.0 * strain } else { 0.0 };
        model = model.equation(
            Equation::of(value)
                .nodes("high", way(1.0))
                .nodes("low", way(-1.0)),
        );
    }
    for path in PATHS {
        let found = answer(model.clone(), 1e-12, path);
        for (x, u) in mesh.nodes.iter().zip(found.displacement()) {
            let expected = [strain * x[0], -0.3 * strain * x[1], -0.3 * strain * x[2]];
            assert!(apart(&u, &expected) < 1e-8 * strain, "{x:?}: {u:?}");
        }
    }
    let refused = |equation: Equation<3>| {
        let model = model.clone().equation(equation);
        model.build().expect_err("it is refused").to_string()
    };
    for (equation, text) in [
        (Equation::of(0.0), "an equation needs terms"),
        (
            Equation::of(0.0).nodes("low", [0.0; 3]),
            "needs a finite factor other than 0",
        ),
        (
            Equation::of(0.0)
                .nodes(["low", "high"], [1.0; 3])
                .nodes("low", [1.0; 3]),
            "the same number of nodes, or one",
        ),
        (
            Equation::of(0.0).nodes("lw", [1.0; 3]),
            "did you mean \"low\"?",
        ),
        (
            Equation::of(1e-3).point([0.0; 3], [1.0, 2.0, 0.0]),
            "equation 4 at (0, 0, 0): in load step 1 supports hold all of its terms",
        ),
    ] {
        let text_of = refused(equation);
        assert!(text_of.contains(text), "{text_of}");
    }
    let lock = Support::at_point([2.0, 0.0, 0.0])
        .x(0.0)
        .locked_in([1.0, 0.0]);
    let text = model
        .clone()
        .support(lock)
        .build()
        .expect_err("refused")
        .to_string();
    assert!(text.contains("the first step has 0"), "{text}");
    let turned = Support::at_point([2.0, 0.0, 0.0])
        .turned(Axis::new([0.0; 3], [0.0, 0.0, 1.0]), 0.1)
        .active([0.0, 1.0]);
    let text = model
        .clone()
        .support(turned)
        .build()
        .expect_err("refused")
        .to_string();
    assert!(text.contains("acts in all load steps"), "{text}");
    let nothing = Equation::of(0.0)
        .nodes("low", [1.0, 0.0, 0.0])
        .nodes("low", [-1.0, 0.0, 0.0]);
    let text = refused(nothing);
    assert!(text.contains("cancel out"), "{text}");
    let unused = Coupling::<3>::of_obstacles("none", [0.0; 3]);
    let text = model
        .coupling(unused)
        .build()
        .expect_err("refused")
        .to_string();
    assert!(
        text.contains("there is no contact named \"none\""),
        "{text}"
    );
}

/// Where displacements may be large and are small, supports change and equations hold as they do where they are taken as small.
#[test]
fn large_displacements_know_the_same_supports() {
    let tiny = 1e-6;
    let model = Model::on(mesh())
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("left").fixed().active([1.0, 1.0, 0.0, 1.0]))
        .support(
            Support::on("right")
                .x(tiny)
                .factors([1.0, 2.0, 1.0, 1.0])
                .active([0.0, 1.0, 1.0, 1.0])
                .locked_in([0.0, 0.0, 1.0, 0.0]),
        )
        .support(Support::at_point([1.0, 0.0]).y(0.0))
        .support(Support::at_point([2.0, 0.0]).y(0.0))
        .traction(Traction::on("top").y(-1e3))
        .traction(Traction::on("right").x(5e2))
        .equation(
            Equation::of(0.2 * tiny)
                .point([0.5, 1.0], [0.0, 1.0])
                .point([1.5, 1.0], [0.5, -1.0])
                .factors([1.0, 0.0, 1.0, 2.0]),
        )
        .steps([1.0, 1.0, 1.0, 1.0]);
    for path in PATHS {
        let all = |model: Model| -> (Vec<Vec<f64>>, Vec<f64>) {
            let built = model.build().or_panic();
            let steps = built.solve(&on_the_cpu(1e-10, path)).or_panic();
            let of_step = |(step, solution): (usize, &signorini::quasistatic::StepSolution)| {
                assert_eq!(
                    solution.status,
                    Status::Converged,
                    "step {step}: {:?}",
                    solution.kkt
                );
                let data = built.step(step).or_panic();
                data.unknowns.displacements(&solution.u).concat()
            };
            let last = steps.last().map(|step| step.lambda.clone());
            (
                steps.iter().enumerate().map(of_step).collect(),
                last.expect("a step"),
            )
        };
        let (small, forces) = all(model.clone());
        let (large, found) = all(model.clone().large_displacements());
        assert_eq!(large.len(), 4);
        for (step, (small, large)) in small.iter().zip(&large).enumerate() {
            assert!(
                apart(small, large) < 1e-4 * tiny,
                "{path:?}, {step}: {:e}",
                apart(small, large)
            );
        }
        let size = forces.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        assert!(apart(&forces, &found) < 1e-4 * size, "{forces:?} {found:?}");
    }
}

/// A corner of two planes of symmetry that are not perpendicular: held along both while they act, in the direction of each.
#[test]
fn a_support_that_changes_holds_along_slanted_directions() {
    let mut mesh = rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "");
    for x in &mut mesh.nodes {
        x[0] += 0.4 * x[1] * (1.0 - x[0] / 2.0);
    }
    let model = |hold: fn(Support) -> Support| {
        Model::on(mesh.clone())
            .material(Material::new(YOUNG, 0.3))
            .support(hold(Support::on(["left", "bottom"]).symmetry()))
            .support(Support::on("right").x(1e-3))
            .support(Support::at_point([2.0, 0.0]).y(0.0))
            .traction(Traction::on("top").y(-1e6))
            .steps([1.0, 1.0])
    };
    for path in PATHS {
        let lasting = answer(model(|support| support), 1e-12, path);
        let found = answer(
            model(|support| support.active([1.0, 0.0])).clone(),
            1e-12,
            path,
        );
        let off = difference(&displacement(&found, 0), &displacement(&lasting, 0));
        assert!(off < 1e-9 * 1e-3, "{path:?}: {off:e}");
        // The corner that both hold counts for either.
        let forces = [lasting.reports(), found.reports()].map(|reports| {
            let [slanted, corner] = [0, 2].map(|i| &reports[0].supports[i].force);
            [slanted[0] + corner[0], slanted[1] + corner[1]]
        });
        assert!(apart(&forces[0], &forces[1]) < 1e-7 * 1e6, "{forces:?}");
    }
}

/// A lock against a support that moves the same nodes on is refused; against one that stays, it is not.
#[test]
fn a_lock_that_another_support_breaks_is_refused() {
    let model = |factors: [f64; 3]| {
        Model::on(mesh())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").fixed())
            .support(Support::on("right").x(1e-4).factors(factors))
            .support(
                Support::on("right")
                    .x(0.0)
                    .active([0.0, 0.0, 1.0])
                    .locked_in([0.0, 0.0, 1.0]),
            )
            .steps([1.0; 3])
    };
    let text = model([1.0, 2.0, 3.0])
        .build()
        .expect_err("it moves on")
        .to_string();
    assert!(text.contains("load step 3"), "{text}");
    answer(model([1.0, 3.0, 3.0]), 1e-10, Stiffness::Cholesky);
}
