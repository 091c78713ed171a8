//! Contacts, ties and friction that change from load step to load step, against closed forms and models that do not change.

use crate::common::models::{Answer, answer, on_the_cpu, stacked};
use crate::common::or_panic::OrPanic as _;
use crate::common::solved;
use crate::common::{apart, distance};
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, rectangle};
use signorini::model::{Model, Pair, Support, Traction};
use signorini::output::{ContactFields, NodeStatus};
use signorini::quasistatic::StepSolution;
use signorini::ssnm::Status;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e9;

const FLOOR: Obstacle = Obstacle::HalfSpace {
    point: [0.0, 0.0],
    normal: [0.0, 1.0],
};

fn block() -> signorini::mesh::Mesh {
    rectangle([0.0, 0.0], [2.0, 1.0], [8, 4], CellShape::Quad, "body", "")
}

/// The solutions of all steps.
fn steps(found: &Answer<2>) -> Vec<&StepSolution> {
    found.before.iter().chain([&found.solution]).collect()
}

fn displacement(found: &Answer<2>, step: usize) -> Vec<[f64; 2]> {
    let data = found.built.step(step).or_panic();
    data.unknowns.displacements(&steps(found)[step].u)
}

/// Pushed down by δ, a block with ν = 0 moves through a floor that is not there, is pressed by E δ/h where it is, and is free again.
#[test]
fn a_contact_acts_in_the_steps_that_are_stated() {
    let depth = 1e-4;
    let model = Model::on(block())
        .material(Material::new(YOUNG, 0.0))
        .support(Support::on("left").x(0.0))
        .support(Support::on("top").y(-depth))
        .contact(
            Pair::obstacle("bottom", FLOOR)
                .coulomb(0.3)
                .active([0.0, 1.0, 0.0, 1.0]),
        )
        .steps([1.0, 1.0, 2.0, 2.0]);
    for path in PATHS {
        let found = answer(model.clone(), 1e-11, path);
        for (step, (moved, bottom)) in [(1.0, -1.0), (1.0, 0.0), (2.0, -2.0), (2.0, 0.0)]
            .into_iter()
            .enumerate()
        {
            let u = displacement(&found, step);
            for (x, u) in found.built.elastic.mesh.nodes.iter().zip(&u) {
                let expected = depth * (bottom * (1.0 - x[1]) - moved * x[1]);
                assert!(
                    (u[1] - expected).abs() < 1e-9 * depth,
                    "{step}: {x:?} {u:?}"
                );
                assert!(u[0].abs() < 1e-9 * depth);
            }
            let data = found.built.step(step).or_panic();
            let fields = ContactFields::new(
                &found.built.problem,
                &found.built.elastic,
                &data,
                steps(&found)[step],
            );
            for i in 0..found.m() {
                let pressed = YOUNG * depth * (moved + bottom);
                assert!((fields.pressure[i] - pressed).abs() < 1e-8 * YOUNG * depth);
                let status = fields.status[i];
                assert_eq!(status == NodeStatus::Separated, bottom != 0.0, "{status:?}");
                // The gap is that of the body, whether it acts or not.
                assert!((fields.gap[i] - bottom * depth).abs() < 1e-9 * depth);
            }
        }
    }
}

/// A fit without friction first, and then with it. What is pressed spreads freely; friction then keeps it as it is when the load goes,
/// and carries a push of less than its bound without slip: by as much as a block on a rough ground gives way.
#[test]
fn a_fit_first_without_friction_and_then_with_it() {
    let (pressure, push) = (1e6, 5e4);
    let base = || {
        Model::on(block())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::at_point([1.0, 0.0]).x(0.0))
            .traction(
                Traction::on("top")
                    .pressure(pressure)
                    .factors([1.0, 1.0, 1.0]),
            )
            .traction(Traction::on("top").x(push).factors([0.0, 0.0, 1.0]))
            .steps([1.0, 1.0, 1.0])
    };
    let fit = |law: Pair| base().contact(law);
    let changed = fit(Pair::obstacle("bottom", FLOOR)
        .coulomb(0.4)
        .friction_factors([0.0, 1.0, 1.0]));
    // Alone: the bottom tied to the ground along it, under the push alone.
    let rough = Model::on(block())
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("bottom").fixed())
        .traction(Traction::on("top").x(push));
    let rough = answer(rough, 1e-11, Stiffness::Cholesky).displacement();
    for path in PATHS {
        let found = answer(changed.clone(), 1e-11, path);
        let free = answer(fit(Pair::obstacle("bottom", FLOOR)), 1e-11, path);
        let flat = |u: Vec<[f64; 2]>| u.concat();
        let [first, second, third] = [0, 1, 2].map(|step| flat(displacement(&found, step)));
        assert!(distance(&first, &flat(displacement(&free, 0))) < 1e-9);
        assert!(distance(&second, &first) < 1e-9);
        // With friction from the beginning it spreads less.
        let always = answer(
            fit(Pair::obstacle("bottom", FLOOR).coulomb(0.4)),
            1e-11,
            path,
        );
        assert!(distance(&flat(displacement(&always, 0)), &first) > 1e-2);
        // Nothing lifts off and nothing slips.
        let m = found.m();
        let last = &found.solution;
        assert!(last.lambda[..m].iter().all(|&pressed| pressed > 0.0));
        let slips = |i: usize| last.lambda[m + i].abs() > 0.4 * last.lambda[i] * (1.0 - 1e-6);
        assert!(!(0..m).any(slips));
        let pushed: Vec<f64> = third
            .iter()
            .zip(&second)
            .map(|(u, before)| u - before)
            .collect();
        assert!(distance(&pushed, &flat(rough.clone())) < 1e-8);
        let report = found.report();
        let carried = report.contacts[0].force[0] + report.supports[0].force[0];
        assert!((carried + 2.0 * push).abs() < 1e-6 * push, "{carried}");
        let text = &found.built.elastic.pairs[0].friction;
        assert_eq!(text, "Coulomb coefficient 0.4 times [0.0, 1.0, 1.0]");
    }
}

/// A tie that sets while its sides are apart holds them there: it carries what comes after that, as one bar of both heights does; taken
/// away it carries nothing, and set again it holds them as they are then.
#[test]
fn a_tie_holds_what_it_finds() {
    let depth = 1e-3;
    let lifted = [1.0, 1.0, 2.0, 2.0, 2.0, 3.0];
    // What the tie stretches both by, over δ.
    let stretch = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0];
    for driven in ["up-top", "up-bottom"] {
        // The upper block moves with its lower side, or is stretched as the lower one.
        let height = if driven == "up-top" { 2.0 } else { 1.0 };
        let model = Model::on(stacked(1.0, [6, 3]))
            .material(Material::new(YOUNG, 0.0))
            .support(Support::on("low-bottom").fixed())
            .support(Support::on(driven).x(0.0).y(depth).factors(lifted))
            .tie(Pair::tied("low-top", "up-bottom").active([0.0, 1.0, 1.0, 0.0, 1.0, 1.0]))
            .steps([1.0; 6]);
        for path in PATHS {
            let found = answer(model.clone(), 1e-11, path);
            for step in 0..6 {
                let (low, up) = (stretch[step] * depth / height, lifted[step] * depth);
                let u = displacement(&found, step);
                // The nodes of the lower block come first.
                let of_low = 9 * 5;
                for (number, (x, u)) in found.built.elastic.mesh.nodes.iter().zip(&u).enumerate() {
                    let expected = match (number < of_low, driven) {
                        (true, _) => low * x[1],
                        (false, "up-top") => up - low * (2.0 - x[1]),
                        (false, _) => up,
                    };
                    let off = u[0].abs().max((u[1] - expected).abs());
                    assert!(off < 1e-8 * depth, "{driven} {step}: {x:?} {u:?}");
                }
                let pull: f64 = steps(&found)[step].lambda[..found.m()].iter().sum();
                assert!(
                    (pull + YOUNG * low * 2.0).abs() < 1e-7 * YOUNG * depth,
                    "{driven} {step}: {pull}"
                );
            }
        }
    }
}

/// A contact that becomes a tie on the same sides takes as many steps of the method as the first load step, and not several times as many:
/// what was learnt of rows that do not act any more is forgotten.
#[test]
fn a_contact_becomes_a_tie() {
    let model = Model::on(stacked(1.0, [6, 3]))
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("low-bottom").fixed())
        .support(Support::on("up-top").y(-1e-4))
        .traction(
            Traction::on("up-left")
                .x(1e4)
                .factors([0.1, 1.0, 1.0, -1.0]),
        )
        .contact(
            Pair::new("up-bottom", "low-top")
                .coulomb(0.3)
                .active([1.0, 1.0, 0.0, 0.0]),
        )
        .tie(Pair::tied("up-bottom", "low-top").active([0.0, 0.0, 1.0, 1.0]))
        .steps([1.0; 4]);
    for path in PATHS {
        let found = answer(model.clone(), 1e-10, path);
        let taken: Vec<usize> = steps(&found).iter().map(|step| step.iter()).collect();
        assert!(
            taken[2] <= 2 * taken[0] && taken[3] <= taken[0],
            "{taken:?}"
        );
        // The push turns round, and the tie carries all of it.
        let report = found.report();
        assert!(
            (report.contacts[1].force[0] - 1e4).abs() < 1e-6,
            "{:?}",
            report.contacts[1]
        );
        assert!(report.contacts[0].force.iter().all(|&f| f == 0.0));
    }
}

/// A body that only a contact holds that does not act yet is held by nothing.
#[test]
fn what_does_not_act_holds_nothing() {
    let model = |active: [f64; 2]| {
        Model::on(block())
            .material(Material::new(YOUNG, 0.3))
            .support(Support::on("left").x(0.0))
            .traction(Traction::on("top").pressure(1e5))
            .contact(Pair::obstacle("bottom", FLOOR).active(active))
            .steps([1.0, 1.0])
    };
    for path in PATHS {
        let solve = |active| {
            let built = model(active).build().or_panic();
            let made = built.solve(&on_the_cpu(1e-9, path)).or_panic();
            made.iter().map(|step| step.status).collect::<Vec<Status>>()
        };
        assert_eq!(solve([1.0, 1.0]), [Status::Converged, Status::Converged]);
        assert_eq!(solve([0.0, 1.0]), [Status::NotHeld]);
        assert_eq!(solve([1.0, 0.0]), [Status::Converged, Status::NotHeld]);
    }
}

#[test]
fn changes_that_make_no_sense_are_refused() {
    let refusal = |steps: &str, contact: &str| {
        let text = format!(
            "[mesh.rectangle]\nsize = [1, 1]\ncells = [2, 2]\n[[material]]\nyoung = 1e5\npoisson = 0.3\n[[support]]\nboundary = \"top\"\nx = 0\ny = 0\n\
             {steps}[[contact]]\nboundary = \"bottom\"\nobstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n{contact}\n"
        );
        solved::refusal(&text)
    };
    let two = "[steps]\nfactors = [1, 1]\n";
    for (steps, contact, expected) in [
        (
            two,
            "active = [1]",
            "active needs 2 finite numbers, one for each load step",
        ),
        ("", "active = [0, 1]", "active applies to load steps"),
        (
            two,
            "active = [1, 2]",
            "active is 1 in load steps in which it acts",
        ),
        (
            two,
            "friction_factors = [0, 1]",
            "friction_factors multiply a law of friction",
        ),
        (
            two,
            "friction = { coulomb = 0.1 }\nfriction_factors = [0, -1]",
            "finite and not negative",
        ),
    ] {
        let error = refusal(steps, contact);
        assert!(error.contains(expected), "{error}");
    }
}

/// Where displacements may be large and are small, contacts and friction change as they do where they are taken as small.
#[test]
fn large_displacements_know_the_same_changes() {
    let depth = 2e-6;
    let on_floor = Model::on(block())
        .support(
            Support::on("top")
                .y(-depth)
                .x(0.3 * depth)
                .factors([1.0, 1.2, 1.3, 1.1, 1.2]),
        )
        .contact(
            Pair::obstacle("bottom", FLOOR)
                .coulomb(0.3)
                .friction_factors([0.0, 1.0, 0.5, 1.0, 1.0])
                .active([1.0, 1.0, 0.0, 1.0, 1.0]),
        );
    let on_each_other = Model::on(stacked(1.0, [6, 3]))
        .support(Support::on("low-bottom").fixed())
        .support(
            Support::on("up-top")
                .y(-depth)
                .x(0.3 * depth)
                .factors([1.0, 1.2, 1.3, 1.1, 1.2]),
        )
        .contact(
            Pair::new("up-bottom", "low-top")
                .coulomb(0.3)
                .friction_factors([0.0, 1.0, 0.5, 1.0, 1.0])
                .active([1.0, 1.0, 0.0, 1.0, 1.0]),
        );
    for model in [on_floor, on_each_other] {
        let model = model
            .material(Material::new(YOUNG, 0.3))
            .steps([1.0, 1.0, 1.0, 1.0, 1.0]);
        let sums = |model: Model| -> Vec<[f64; 2]> {
            let options = on_the_cpu(1e-9, Stiffness::Cholesky);
            let made = model.build().or_panic().solve(&options).or_panic();
            let force = |step: &StepSolution| {
                assert_eq!(step.status, Status::Converged);
                let m = step.lambda.len() / 2;
                [&step.lambda[..m], &step.lambda[m..]].map(|of| of.iter().sum())
            };
            made.iter().map(force).collect()
        };
        let [small, large] = [model.clone(), model.large_displacements()].map(sums);
        assert_eq!(large.len(), 5);
        for (step, (small, large)) in small.iter().zip(&large).enumerate() {
            let size = small[0].abs().max(1.0);
            assert!(
                apart(small, large) < 1e-4 * size,
                "{step}: {small:?} {large:?}"
            );
            assert_eq!(step == 2, large[0] == 0.0, "{step}: {large:?}");
        }
    }
    let bonded = Model::on(stacked(1.0, [6, 3]))
        .material(Material::new(YOUNG, 0.3))
        .support(Support::on("low-bottom").fixed())
        .tie(Pair::tied("up-bottom", "low-top").active([0.0, 1.0]))
        .steps([1.0, 1.0])
        .large_displacements();
    let error = bonded.build().expect_err("a tie that changes").to_string();
    assert!(
        error.contains("ties that change need geometry = \"small\""),
        "{error}"
    );
}

/// The friction of a solve is that of its problem, also where something changes between load steps, and it unties nothing.
#[test]
fn friction_of_a_problem_counts_in_all_steps() {
    let model = |mu: f64, changes: bool| {
        let floor = Pair::obstacle("low-bottom", FLOOR).coulomb(mu);
        let floor = if changes {
            floor.friction_factors([1.0, 1.0])
        } else {
            floor
        };
        Model::on(stacked(1.0, [8, 4]))
            .material(Material::new(YOUNG, 0.3))
            .traction(Traction::on("up-top").x(3e5).y(-1e6))
            .contact(floor)
            .tie(Pair::tied("up-bottom", "low-top"))
            .support(Support::on("up-top").x(1e-3).factors([0.5, 1.0]))
            .steps([1.0, 1.0])
    };
    let settings = on_the_cpu(1e-10, Stiffness::Cholesky);
    let expected = model(0.5, false).build().or_panic();
    let expected = expected.solve(&settings).or_panic();
    for changes in [false, true] {
        let mut built = model(0.2, changes).build().or_panic();
        let m = built.problem.m();
        built.problem = built
            .problem
            .with_friction_coefficient(vec![0.5; m])
            .or_panic();
        let found = built.solve(&settings).or_panic();
        for (found, expected) in found.iter().zip(&expected) {
            assert_eq!(found.status, Status::Converged);
            let off = distance(&found.u, &expected.u);
            assert!(off < 1e-9, "{changes}: {off}");
        }
    }
}
