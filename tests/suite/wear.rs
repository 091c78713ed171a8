//! Wear over cycles of load steps, against Archard's law: volume = coefficient · force · slip.

use crate::common::models::{Answer, answer};
use signorini::contact::Obstacle;
use signorini::contact::Space;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Coupling, Model, Pair, Support, Traction};

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const WEAR: f64 = 1e-8;

/// The depths of the first contact at the end, with the areas of their places.
fn worn<const D: usize>(found: &Answer<D>) -> Vec<(f64, f64)>
where
    ElementKind: Space<D>,
{
    let places = found.built.elastic.contact.places.iter();
    let areas = places.map(|place| place.area);
    areas.zip(found.solution.worn.iter().copied()).collect()
}

fn volume(worn: &[(f64, f64)]) -> f64 {
    worn.iter().map(|(area, depth)| area * depth).sum()
}

/// A block is pressed on a plane and rubs to and fro: all of it slips, but for the shear of the block.
fn rubbed(cycles: usize, jump: f64, path: Stiffness) -> Answer<2> {
    let model = Model::on(rectangle(
        [0.0, 0.0],
        [2.0, 1.0],
        [8, 4],
        CellShape::Quad,
        "body",
        "",
    ))
    .material(Material::new(2e5, 0.3))
    .support(Support::on("top").x(1e-3).factors([1.0, 0.0, -1.0, 0.0]))
    .traction(Traction::on("top").y(-1.0))
    .contact(
        Pair::obstacle(
            "bottom",
            Obstacle::HalfSpace {
                point: [0.0, 0.0],
                normal: [0.0, 1.0],
            },
        )
        .coulomb(0.2)
        .wear(WEAR),
    )
    .steps([1.0, 1.0, 1.0, 1.0])
    .cycles(cycles, jump);
    answer(model, 1e-10, path)
}

#[test]
fn a_block_that_rubs_wears_by_force_and_slip() {
    for path in PATHS {
        let found = rubbed(500, 0.05, path);
        // To and fro by 4e-3 in each cycle.
        let expected = 500.0 * WEAR * 2.0 * 4e-3;
        let volume = volume(&worn(&found));
        assert!(
            (volume / expected - 1.0).abs() < 0.01,
            "{volume} {expected}"
        );
        let reports = found.reports();
        let last = reports.last().expect("a step");
        assert_eq!(last.cycle, Some(500));
        assert_eq!(last.contacts[0].wear_volume, Some(volume));
        // Two cycles, then twice as many each time.
        assert!(reports.len() < 4 * 20, "{} steps", reports.len());
        assert_eq!(reports[0].cycle, Some(1));
    }
}

/// Cycles that are left out, against all of them.
#[test]
fn cycles_that_are_left_out_wear_alike() {
    let all = rubbed(40, 0.0, Stiffness::Cholesky);
    assert_eq!(all.before.len() + 1, 4 * 40);
    let some = rubbed(40, 0.05, Stiffness::Cholesky);
    assert!(some.before.len() + 1 < 4 * 12, "{}", some.before.len());
    for ((_, expected), (_, found)) in worn(&all).into_iter().zip(worn(&some)) {
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}

/// A disc under a force rubs a scar into a half-plane that is deep against its elastic indentation: the scar has the shape of the disc.
#[test]
fn a_disc_rubs_a_scar_of_its_shape() {
    let (radius, force, amplitude, cycles) = (1000.0, 0.5, 1e-3, 1000);
    let wear = 4e-5;
    let mesh: Mesh = rectangle(
        [-1.0, -0.4],
        [2.0, 0.4],
        [100, 20],
        CellShape::Quad,
        "body",
        "",
    );
    let disc = Obstacle::Sphere {
        center: [0.0, radius],
        radius,
    };
    let model = Model::on(mesh)
        .material(Material::new(2e5, 0.3))
        .support(
            Support::on("bottom")
                .x(amplitude)
                .y(0.0)
                .factors([1.0, -1.0]),
        )
        .contact(Pair::obstacle("top", disc).named("disc").wear(wear))
        .coupling(
            Coupling::of_obstacles("disc", [0.0, 0.0])
                .force([0.0, -force])
                .moved(0, 0.0)
                .turned(2, 0.0),
        )
        .steps([1.0, 1.0])
        .cycles(cycles, 0.05);
    let found = answer(model, 1e-9, Stiffness::Cholesky);
    let worn = worn(&found);
    let expected = wear * force * 4.0 * amplitude * cycles as f64;
    let volume = volume(&worn);
    assert!(
        (volume / expected - 1.0).abs() < 0.01,
        "{volume} {expected}"
    );
    // A segment of the disc: 2 a³ / (3 R) large, a² / (2 R) deep.
    let half = (1.5 * radius * volume).cbrt();
    let deepest = worn
        .iter()
        .fold(0.0_f64, |most, (_, depth)| most.max(*depth));
    let deep = half * half / (2.0 * radius);
    assert!((deepest / deep - 1.0).abs() < 0.02, "{deepest} {deep}");
    let wide: f64 = worn
        .iter()
        .filter(|worn| worn.1 > 0.01 * deep)
        .map(|worn| worn.0)
        .sum();
    assert!((wide / (2.0 * half) - 1.0).abs() < 0.05, "{wide} {half}");
    // Of two steps each, with three products each.
    let (cycles, products) = found
        .before
        .iter()
        .fold((0, 0), |(cycles, products), step| {
            (cycles + 1, products + step.n_a())
        });
    assert!(
        cycles < 2 * 150 && products < 4 * cycles,
        "{cycles} {products}"
    );
}

/// In space, along a square: each side of it is slip along both tangents.
#[test]
fn slip_in_space_has_a_length() {
    let mesh = block(
        [0.0; 3],
        [2.0, 2.0, 1.0],
        [3, 3, 2],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    let model = Model::on(mesh)
        .material(Material::new(2e5, 0.3))
        .support(Support::on("top").x(1e-3).factors([1.0, 0.0, -1.0, 0.0]))
        .support(Support::on("top").y(1e-3).factors([0.0, 1.0, 0.0, -1.0]))
        .traction(Traction::on("top").z(-1.0))
        .contact(
            Pair::obstacle(
                "bottom",
                Obstacle::HalfSpace {
                    point: [0.0; 3],
                    normal: [0.0, 0.0, 1.0],
                },
            )
            .wear(WEAR),
        )
        .steps([1.0; 4])
        .cycles(100, 0.05);
    for path in PATHS {
        let found = answer(model.clone(), 1e-10, path);
        // From the middle, then around.
        let slip = 1e-3 + (4.0 * 100.0 - 1.0) * 1e-3 * 2.0_f64.sqrt();
        let expected = WEAR * 4.0 * slip;
        let volume = volume(&worn(&found));
        assert!(
            (volume / expected - 1.0).abs() < 1e-6,
            "{volume} {expected}"
        );
    }
}

/// A block whose lower edge a support drives along a floor wears there by pressure and slip, as where its upper edge is driven.
#[test]
fn driven_nodes_wear() {
    let floor = Obstacle::HalfSpace {
        point: [0.0, 0.0],
        normal: [0.0, 1.0],
    };
    for sides in [&["bottom"][..], &["left", "right", "top"], &["top"]] {
        let mesh = rectangle([0.0, 0.0], [2.0, 0.5], [4, 2], CellShape::Quad, "body", "");
        let model = Model::on(mesh)
            .material(Material::new(1e9, 0.0))
            .traction(Traction::on("top").pressure(2e5))
            .contact(Pair::obstacle("bottom", floor).wear(WEAR));
        let model = (sides.iter()).fold(model, |model, side| {
            model.support(Support::on(*side).x(0.01))
        });
        for path in PATHS {
            let volume = volume(&worn(&answer(model.clone(), 1e-10, path)));
            let expected = WEAR * 2.0 * 2e5 * 0.01;
            assert!(
                (volume / expected - 1.0).abs() < 1e-6,
                "{sides:?}: {volume} {expected}"
            );
        }
    }
}

#[test]
fn wear_that_is_not_understood_is_refused() {
    let mesh = rectangle([0.0, 0.0], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let floor = Obstacle::HalfSpace {
        point: [0.0, 0.0],
        normal: [0.0, 1.0],
    };
    let model = |wear: f64| {
        Model::on(mesh.clone())
            .material(Material::new(1e9, 0.3))
            .support(Support::on("top").fixed())
            .contact(Pair::obstacle("bottom", floor).wear(wear))
            .steps([1.0, 1.0])
    };
    for (model, text) in [
        (model(-1.0), "the coefficient of wear must be finite"),
        (model(1e-9).cycles(0, 0.1), "there is at least one cycle"),
        (model(1e-9).cycles(2, 1.0), "less than 1"),
        (
            Model::on(mesh.clone())
                .material(Material::new(1e9, 0.3))
                .support(Support::on("top").fixed())
                .steps([1.0, 1.0])
                .cycles(2, 0.1),
            "jump leaves out cycles of contacts that wear",
        ),
        (
            model(1e-9).large_displacements(),
            "wear needs geometry = \"small\"",
        ),
        (
            model(0.0).large_displacements().cycles(2, 0.1),
            "geometry = \"small\"",
        ),
    ] {
        let refused = model.build().expect_err(text).to_string();
        assert!(refused.contains(text), "{refused}");
    }
    // One cycle wears as well.
    let found = answer(
        model(1e-3).traction(Traction::on("left").x(0.0)),
        1e-10,
        Stiffness::Cholesky,
    );
    assert!(found.solution.worn.iter().all(|&depth| depth == 0.0));
}
