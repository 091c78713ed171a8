//! The same bodies, stated in two ways: with an obstacle or a body that is held, with one contact or several, turned or not.

use super::elements::length;
use super::{End, neo_hooke, solved, solved_in_space, tried};
use crate::common::or_panic::OrPanic as _;
use signorini::contact::Obstacle;
use signorini::elasticity::{Material, Plane};
use signorini::engine::Stiffness::Cholesky;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::model::{Axis, Coupling, Model, Pair, Spring, Support, Traction};
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
