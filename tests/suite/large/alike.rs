//! The same bodies, stated in two ways: with an obstacle or a body that is held, with one contact or several, turned or not.

use super::connected::turned;
use super::elements::length;
use super::{End, neo_hooke, solved, solved_in_space, tried, tried_in_space};
use crate::common::or_panic::OrPanic as _;
use signorini::contact::Obstacle;
use signorini::elasticity::{Material, Plane};
use signorini::engine::Stiffness::Cholesky;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::model::{Axis, Coupling, Model, Motion, Pair, Spring, Support, Traction};
use signorini::ssnm::Status;
use std::collections::BTreeSet;

fn part(low: [f64; 2], size: [f64; 2], cells: [usize; 2], name: &str) -> Mesh {
    rectangle(low, size, cells, CellShape::Quad, name, &format!("{name}-"))
}

fn floor() -> Obstacle {
    Obstacle::HalfSpace {
        point: [0.0; 2],
        normal: [0.0, 1.0],
    }
}

/// The last step, which has converged.
fn last<const D: usize>(mut ends: Vec<End<D>>) -> End<D> {
    let end = ends.pop().expect("a step");
    assert_eq!(end.status, Status::Converged);
    end
}

fn assert_near(a: f64, b: f64, part: f64, what: &str) {
    assert!(
        (a - b).abs() <= part * a.abs().max(b.abs()),
        "{what}: {a} {b}"
    );
}

/// Blocks on each other and on a rigid floor, pressed by a third: each pressure is the force over the area as it is, that of the other
/// contact and of the other side, in any order of contacts.
#[test]
fn pressures_are_those_of_displaced_areas() {
    for plane in [Plane::PlaneStrain, Plane::Axisymmetric] {
        for pair_first in [true, false] {
            let low = part([0.0; 2], [1.0, 0.5], [4, 2], "low");
            let up = part([0.0, 0.5], [1.0, 0.5], [4, 2], "up");
            let pair = Pair::new("up-bottom", "low-top");
            let obstacle = Pair::obstacle("low-bottom", floor());
            let [one, other] = if pair_first {
                [pair, obstacle]
            } else {
                [obstacle, pair]
            };
            let model = Model::on(join(low, up))
                .large_displacements()
                .plane(plane)
                .material(neo_hooke(1.0, 0.3))
                .support(Support::on(["low-left", "up-left"]).x(0.0))
                .support(Support::on("up-top").y(-0.3))
                .contact(one)
                .contact(other);
            let end = last(solved(model, 1e-10, Cholesky));
            let contacts = &end.report.contacts;
            for contact in contacts {
                assert_near(
                    contact.max_pressure * contact.area,
                    contact.normal_force,
                    1e-7,
                    "pressure",
                );
            }
            assert_near(
                contacts[0].max_pressure,
                contacts[1].max_pressure,
                1e-7,
                "both pressures",
            );
            let rest = if plane == Plane::Axisymmetric {
                std::f64::consts::PI
            } else {
                1.0
            };
            assert!(contacts.iter().all(|contact| contact.area > 1.1 * rest));
        }
    }
}

/// A compliant contact is as stiff with an obstacle as with a body that is held, also of sets of nodes and of second order.
#[test]
fn obstacles_are_as_compliant_as_bodies() {
    for (second_order, by_nodes) in [(false, false), (false, true), (true, false)] {
        let raised = |mesh: Mesh| {
            if second_order {
                mesh.raised().or_panic()
            } else {
                mesh
            }
        };
        let force = |rigid: bool| {
            let block = part([0.0; 2], [1.0, 1.0], [4, 4], "block");
            let plate = part([-1.0, -0.2], [4.0, 0.2], [4, 1], "plate");
            let mut mesh = raised(if rigid { block } else { join(block, plate) });
            let nodes = mesh.boundaries["block-bottom"]
                .iter()
                .flat_map(|facet| facet[..2].to_vec());
            let nodes: BTreeSet<u32> = nodes.collect();
            mesh.node_sets
                .insert("feet".into(), nodes.into_iter().collect());
            let pair = match (rigid, by_nodes) {
                (true, false) => Pair::obstacle("block-bottom", floor()),
                (true, true) => Pair::obstacle("feet", floor()).by_nodes(),
                (false, false) => Pair::new("block-bottom", "plate-top"),
                (false, true) => Pair::new("feet", "plate-top").by_nodes(),
            };
            let mut model = Model::on(mesh)
                .large_displacements()
                .material(neo_hooke(1.0, 0.3))
                .support(Support::on("block-left").x(0.0))
                .support(Support::on("block-top").y(-0.3))
                .contact(pair.normal_stiffness(2.0));
            if !rigid {
                model = model.support(Support::on(["plate-top", "plate-bottom"]).fixed());
            }
            last(solved(model, 1e-9, Cholesky)).force()[1]
        };
        assert_near(force(true), force(false), 1e-6, "forces");
    }
}

/// An offset acts wherever sides meet, also if nothing is opposite at rest; a gap that is a function of the place at rest is one of every
/// node; a gap between sides that are too far apart to say where it is, is an error.
#[test]
fn what_is_stated_holds_where_sides_meet_later() {
    let force = |at: [f64; 2], pair: Pair| {
        let low = part([0.0; 2], [1.0, 1.0], [4, 4], "low");
        let up = part(at, [1.0, 1.0], [4, 4], "up");
        let model = Model::on(join(low, up))
            .large_displacements()
            .material(Material::new(1.0, 0.0))
            .support(Support::on("low-bottom").fixed())
            .support(Support::on("up-top").x(-at[0]))
            .support(Support::on("up-top").y(1.01 - at[1]).factors([0.0, 1.0]))
            .contact(pair)
            .steps([1.0, 1.0]);
        tried(model, 1e-8, Cholesky).map(|ends| last(ends).force()[1])
    };
    let pair = || Pair::new("low-top", "up-bottom");
    let drawn = force([0.0, 1.08], pair().offset(-0.02)).or_panic();
    assert!(drawn < -4e-3, "{drawn}");
    for (at, search) in [([0.0, 1.1], 0.05), ([3.0, 1.1], 0.5)] {
        let later = force(at, pair().offset(-0.02).search_distance(search)).or_panic();
        assert_near(later, drawn, 1e-6, "met later");
    }
    let error = force([0.0, 1.1], pair().gap(0.0).search_distance(0.05)).expect_err("nowhere");
    assert!(
        error.to_string().contains("gap says how far apart"),
        "{error}"
    );

    // It slides from where the gap is that of the meshes to where no contact can be.
    let low = part([0.0; 2], [2.0, 1.0], [16, 6], "low");
    let up = part([-0.3, 1.0], [0.8, 0.6], [8, 4], "up");
    let model = Model::on(join(low, up))
        .large_displacements()
        .material(neo_hooke(1.0, 0.3))
        .support(Support::on("low-bottom").fixed())
        .support(Support::on("up-top").x(1.4).factors([0.0, 0.3, 0.6, 1.0]))
        .support(Support::on("up-top").y(-0.04))
        .contact(Pair::new("low-top", "up-bottom").gap(|x: [f64; 2]| 1e6 * (x[0] - 0.9).max(0.0)))
        .steps([1.0; 4]);
    let ends = solved(model, 1e-8, Cholesky);
    assert!(ends.iter().all(|end| end.status == Status::Converged));
    assert!(ends[0].force()[1] < -0.01);
    assert_eq!(ends[3].force(), [0.0; 2]);
}

/// Ties over a gap in the drawing turn with their bodies: turned and loaded, the bodies are as if loaded and turned.
#[test]
fn ties_over_a_gap_turn() {
    let low = |name| part([0.0; 2], [1.0, 0.5], [4, 2], name);
    let up = |cells| part([0.0, 0.52], [1.0, 0.5], [cells, 2], "up");
    for cells in [4, 5] {
        let loaded = |angle: f64| {
            let model = Model::on(join(low("low"), up(cells)))
                .large_displacements()
                .material(Material::new(1.0, 0.3))
                .support(Support::on("low-bottom").turned(Axis::at([0.3, 0.2]), angle))
                .traction(Traction::on("up-top").pressure(0.1).factors([0.0, 1.0]))
                .tie(Pair::tied("up-bottom", "low-top"))
                .steps([1.0, 1.0]);
            let ends = solved(model, 1e-9, Cholesky);
            let end = last(ends);
            let (sin, cos) = angle.to_radians().sin_cos();
            let [x, y] = end.force();
            [x * cos + y * sin, y * cos - x * sin]
        };
        let (rest, turned) = (loaded(0.0), loaded(120.0));
        assert!(rest[1] > 0.09 || rest[1] < -0.09, "{rest:?}");
        for c in 0..2 {
            assert!((rest[c] - turned[c]).abs() < 1e-7, "{rest:?} {turned:?}");
        }
    }
    // In space, about an oblique axis.
    let cube = |at, cells, name: &str| {
        block(
            at,
            [1.0, 1.0, 0.5],
            cells,
            SolidShape::Hexahedron,
            name,
            &format!("{name}-"),
        )
    };
    let model = Model::on(join(
        cube([0.0; 3], [2, 2, 1], "low"),
        cube([0.0, 0.0, 0.53], [3, 3, 1], "up"),
    ))
    .large_displacements()
    .material(Material::new(1.0, 0.3))
    .support(
        Support::on(["low-bottom", "up-top"]).turned(Axis::new([0.3; 3], [1.0, 2.0, 0.5]), 80.0),
    )
    .tie(Pair::tied("up-bottom", "low-top"));
    let end = last(solved_in_space(model, 1e-9, Cholesky));
    assert!(
        end.forces.iter().flatten().all(|f| f.abs() < 1e-9),
        "{:?}",
        end.forces
    );
}

/// Bodies that only turn have no forces but rounding, by which nothing can be judged.
#[test]
fn bodies_turn_without_loads() {
    let turned = |side| Support::on(side).turned(Axis::at([0.1, 0.2]), 90.0);
    let low = || part([0.0; 2], [1.0, 0.5], [4, 2], "low");
    let up = || part([0.0, 0.8], [1.0, 0.5], [5, 2], "up");
    let model = |mesh| {
        Model::on(mesh)
            .large_displacements()
            .material(Material::new(1e6, 0.3))
    };
    let led = Coupling::on("low-top", [0.5, 1.0]);
    let models = [
        model(low()).support(turned("low-bottom")).coupling(led),
        model(join(low(), up()))
            .support(turned("low-bottom"))
            .support(turned("up-top"))
            .spring(Spring::on("low-top", 1e5).to("up-bottom")),
        model(join(low(), part([0.0, 0.5], [1.0, 0.5], [5, 2], "up")))
            .support(turned("low-bottom"))
            .tie(Pair::tied("up-bottom", "low-top")),
    ];
    for model in models {
        let end = last(solved(model, 1e-6, Cholesky));
        assert!(end.iterations <= 20, "{}", end.iterations);
        let size = end
            .displacement
            .iter()
            .flatten()
            .fold(0.0, |most: f64, u| most.max(u.abs()));
        assert!(size > 0.5);
    }
}

/// A plate between a punch and a base: its sides in one contact do not meet each other, and are as in two contacts. Where displacements are
/// small, too.
#[test]
fn the_sides_of_a_plate_may_be_in_one_contact() {
    let solve = |large: bool, by_nodes: bool, one: bool| {
        let base = part([0.0; 2], [2.0, 0.5], [10, 3], "base");
        let plate = part([0.2, 0.5], [1.6, 0.05], [16, 1], "plate");
        let punch = part([0.6, 0.55], [0.6, 0.4], [6, 3], "punch");
        let mut mesh = join(join(base, plate), punch);
        for side in ["plate-top", "base-top"] {
            let nodes = mesh.boundaries[side]
                .iter()
                .flat_map(|facet| facet[..2].to_vec());
            let nodes: BTreeSet<u32> = nodes.collect();
            mesh.node_sets
                .insert(format!("{side}-nodes"), nodes.into_iter().collect());
        }
        let pair = |own: &[&str], other: &[&str]| match by_nodes {
            false => Pair::new(own, other),
            true => {
                let own: Vec<String> = own.iter().map(|side| format!("{side}-nodes")).collect();
                Pair::new(own, other).by_nodes()
            }
        };
        let mut model = Model::on(mesh)
            .material(Material::new(1.0, 0.3))
            .support(Support::on("base-bottom").fixed())
            .support(Support::on("plate-left").x(0.0))
            .support(Support::on("punch-top").x(0.0).y(-0.02));
        model = match one {
            true => model.contact(pair(
                &["plate-top", "base-top"],
                &["punch-bottom", "plate-bottom"],
            )),
            false => model
                .contact(pair(&["plate-top"], &["punch-bottom"]))
                .contact(pair(&["base-top"], &["plate-bottom"])),
        };
        if large {
            model = model.large_displacements();
        }
        let end = last(solved(model, 1e-9, Cholesky));
        let sum: f64 = end
            .report
            .contacts
            .iter()
            .map(|contact| contact.normal_force)
            .sum();
        (sum, end.report.supports[2].force[1])
    };
    for (large, by_nodes) in [(false, false), (false, true), (true, false)] {
        let [two, one] = [false, true].map(|one| solve(large, by_nodes, one));
        assert!(two.0 > 0.025, "{two:?}");
        assert_near(one.0, two.0, 1e-6, "contact forces");
        assert_near(one.1, two.1, 1e-6, "the force of the punch");
    }
}

/// A body that a step would put into the middle of another one does not end there, whichever side has the multipliers.
#[test]
fn no_body_is_swallowed() {
    let small = ["up-bottom", "up-left", "up-right", "up-top"];
    let large = ["low-top", "low-right", "low-left"];
    let all: Vec<&str> = small.into_iter().chain(large).collect();
    let pairs = [
        Pair::new(small, large),
        Pair::new(large, small),
        Pair::new(&all[..], &all[..]),
    ];
    for (number, pair) in pairs.into_iter().enumerate() {
        let low = part([0.0; 2], [2.0, 1.0], [8, 4], "low");
        let up = part([2.5, 1.1], [0.5, 0.5], [4, 4], "up");
        let mesh = join(low, up);
        let model = Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(1e6, 0.3))
            .support(Support::on("low-bottom").fixed())
            .support(Support::on("up-top").x(-1.5).y(-0.9))
            .contact(pair);
        let end = solved(model, 1e-6, Cholesky).pop().expect("a step");
        // The foremost node of the small one, which would be at (1, 0.2).
        let foot = mesh
            .nodes
            .iter()
            .position(|x| *x == [2.5, 1.1])
            .expect("a node");
        let [dx, dy] = end.displacement[foot];
        assert!(
            end.status != Status::Converged || length(end.force()) > 0.0,
            "{number}: {:?}, moved by ({dx}, {dy})",
            end.status
        );
    }
}

/// Slip counts from the begin of a load step, wherever the sides were then: next to each other in a contact that did not act, within the
/// distance of the search, or beyond it. By hand for rigid blocks, and for soft ones by what they do within it.
#[test]
fn slip_counts_from_the_begin_of_a_step() {
    let pressed = |young: f64, gap: f64, pair: Pair, factors: &[f64]| {
        let low = part([0.0; 2], [1.0, 0.5], [4, 2], "low");
        let up = part([0.2, 0.5 + gap], [0.7, 0.5], [3, 2], "up");
        let top = Support::on("up-top").x(1e-3).y(-0.01 - gap);
        let model = Model::on(join(low, up))
            .large_displacements()
            .material(Material::new(young, 0.3))
            .support(Support::on("low-bottom").fixed())
            .support(top.factors(factors))
            .contact(pair.coulomb(0.3))
            .steps(vec![1.0; factors.len()]);
        last(solved(model, 1e-10, Cholesky))
    };
    let pair = || Pair::new("up-bottom", "low-top");
    let soft = || pair().normal_stiffness(1e4).tangential_stiffness(1e3);
    for (gap, pair, factors) in [
        (0.0, soft(), &[1.0][..]),
        (0.0, soft().active([0.0, 1.0]), &[0.0, 1.0]),
        (0.4, soft().search_distance(1.0), &[1.0]),
        (0.4, soft().search_distance(0.1), &[1.0]),
    ] {
        let force = pressed(1e9, gap, pair, factors).force();
        assert_near(force[0], -0.7 * 1e3 * 1e-3, 1e-4, "friction");
        assert_near(force[1], 0.7 * 1e4 * 0.01, 1e-4, "pressure");
    }
    let slope = || pair().tangential_stiffness(1e5);
    let forces = [
        (0.4, slope().search_distance(1.0), &[1.0][..]),
        (0.4, slope().search_distance(0.1), &[1.0]),
        (0.0, slope().active([0.0, 1.0]), &[0.0, 1.0]),
    ];
    let forces = forces.map(|(gap, pair, factors)| pressed(1e3, gap, pair, factors).force());
    for force in &forces[1..] {
        (0..2).for_each(|c| assert_near(force[c], forces[0][c], 1e-5, "the same sides"));
    }
}

/// Bodies side by side that are not tied have nodes at the same places. They are pressed as a single one is, on either side of the contact.
#[test]
fn bodies_side_by_side_are_pressed_as_one() {
    let low = || part([0.0; 2], [2.0, 0.6], [2, 1], "low");
    let one = part([0.0, 0.6], [2.0, 0.4], [2, 1], "left");
    let [left, right] = [0.0, 1.0].map(|x| (x, if x > 0.0 { "right" } else { "left" }));
    let two = join(
        part([left.0, 0.6], [1.0, 0.4], [1, 1], left.1),
        part([right.0, 0.6], [1.0, 0.4], [1, 1], right.1),
    );
    let forces = [(one, &["left"][..]), (two, &["left", "right"])].map(|(up, names)| {
        let sides = |side: &str| -> Vec<String> {
            names.iter().map(|name| format!("{name}-{side}")).collect()
        };
        [false, true].map(|swapped| {
            let pair = match swapped {
                false => Pair::new(sides("bottom"), "low-top"),
                true => Pair::new("low-top", sides("bottom")),
            };
            let model = Model::on(join(low(), up.clone()))
                .large_displacements()
                .material(Material::new(1e3, 0.0))
                .support(Support::on("low-bottom").fixed())
                .support(Support::on(sides("top")).x(0.0).y(-0.01))
                .contact(pair);
            let end = last(solved(model, 1e-9, Cholesky));
            assert!(end.iterations <= 4, "{}", end.iterations);
            end.force()[1].abs()
        })
    });
    assert_near(forces[0][0], 19.701, 1e-6, "one body");
    for force in forces.as_flattened() {
        assert_near(*force, forces[0][0], 1e-8, "two bodies");
    }
}

/// Blocks between planes of symmetry, drawn along the axes or not: under a plate that shifts, with friction, and tied to each other on a side
/// that turns. Rounding of directions and turns is no motion of supports.
#[test]
fn planes_of_symmetry_have_any_direction() {
    let normal_forces = |by: Option<[f64; 3]>| {
        let way = |x: [f64; 3]| by.map_or(x, |by| turned(x, by));
        let model = |mut mesh: Mesh<3>, names: &[&str]| {
            mesh.nodes.iter_mut().for_each(|x| *x = way(*x));
            let sides = names
                .iter()
                .flat_map(|name| ["front", "back"].map(|side| format!("{name}-{side}")));
            Model::on(mesh)
                .large_displacements()
                .material(Material::new(1e3, 0.35))
                .support(Support::on(sides.collect::<Vec<_>>()).symmetry())
        };
        let solid = |low: [f64; 3], name: &str| {
            let cells = [2, 1, 2];
            block(
                low,
                [1.0; 3],
                cells,
                SolidShape::Hexahedron,
                name,
                &format!("{name}-"),
            )
        };
        let plate = Obstacle::HalfSpace {
            point: way([0.0, 0.0, 1.0]),
            normal: way([0.0, 0.0, -1.0]),
        };
        let plate = Pair::obstacle("a-top", plate).coulomb(0.4);
        let pressed = model(solid([0.0; 3], "a"), &["a"])
            .support(Support::on("a-bottom").fixed())
            .contact(plate.moving(Motion::shift(way([0.05, 0.0, -0.1]))));
        let pressed = last(solved_in_space(pressed, 1e-9, Cholesky));
        let about = Axis::new(way([0.0; 3]), way([0.0, 1.0, 0.0]));
        let tied = join(solid([0.0; 3], "a"), solid([0.0, 0.0, 1.0], "b"));
        let tied = model(tied, &["a", "b"])
            .support(Support::on("a-bottom").turned(about, 30.0))
            .traction(Traction::on("b-top").pressure(10.0))
            .tie(Pair::tied("b-bottom", "a-top"));
        let tied = last(solved_in_space(tied, 1e-9, Cholesky));
        [pressed, tied].map(|end| end.force().map(|f| f * f).iter().sum::<f64>().sqrt())
    };
    let along = normal_forces(None);
    for number in 0..5 {
        let by = [0.4 + f64::from(number), 0.7, -0.3 * f64::from(number)];
        for (force, goal) in normal_forces(Some(by)).iter().zip(along) {
            assert_near(*force, goal, 1e-6, "the whole force");
        }
    }
}

/// Supports that drive a node across the only direction that it may slide in are refused: friction would not feel that motion.
#[test]
fn friction_feels_the_motion_of_supports() {
    let mesh = block(
        [0.0; 3],
        [1.0; 3],
        [2; 3],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let floor = Obstacle::HalfSpace {
        point: [0.0; 3],
        normal: [0.0, 0.0, 1.0],
    };
    let model = |shift: f64| {
        Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(1e3, 0.3))
            .support(Support::on("top").x(shift).z(-0.05))
            .support(Support::on("bottom").x(shift))
            .support(Support::at_point([0.0, 0.0, 1.0]).y(0.0))
            .contact(Pair::obstacle("bottom", floor).coulomb(0.3))
    };
    last(solved_in_space(model(0.0), 1e-8, Cholesky));
    let error = tried_in_space(model(0.1), 1e-8, Cholesky).map(|_| ());
    let error = error.expect_err("friction along x is missing").to_string();
    assert!(error.contains("leave it free in the other"), "{error}");
}
