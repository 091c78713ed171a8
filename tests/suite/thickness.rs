//! Bodies of the plane whose thickness differs.

use crate::common::models::{Answer, answer};
use crate::common::or_panic::OrPanic as _;
use signorini::elasticity::{Material, Plane};
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, join, rectangle};
use signorini::model::{Model, Pair, Support, Temperature, Traction};

const YOUNG: f64 = 1e9;
/// Of the lower block, which is that of the model, and of the upper one.
const THICK: [f64; 2] = [0.02, 0.05];

/// A block of 1 × 1 with another one of 1 × 2 on it.
fn blocks(order: u8) -> Model {
    let low = rectangle(
        [0.0, 0.0],
        [1.0, 1.0],
        [3, 2],
        CellShape::Quad,
        "low",
        "low-",
    );
    let up = rectangle([0.0, 1.0], [1.0, 2.0], [4, 3], CellShape::Quad, "up", "up-");
    let mut mesh = join(low, up);
    if order == 2 {
        mesh = mesh.raised().or_panic();
    }
    let material = Material {
        expansion: 1e-5,
        density: 500.0,
        ..Material::new(YOUNG, 0.0)
    };
    Model::on(mesh)
        .plane(Plane::PlaneStress)
        .thickness(THICK[0])
        .material_in("low", material)
        .material_in(
            "up",
            Material {
                thickness: Some(THICK[1]),
                ..material
            },
        )
        .support(Support::on(["low-left", "up-left"]).x(0.0))
        .support(Support::on("low-bottom").y(0.0))
}

/// σyy at the nodes that are not at the joint, of bodies warmer by some degrees.
fn check_stresses(found: &Answer<2>, warmer: f64, force: f64, what: &str) {
    let nodes = &found.built.elastic.mesh.nodes;
    for (x, s) in nodes.iter().zip(found.stresses()) {
        let yy = s.yy - YOUNG * 1e-5 * warmer;
        if (x[1] - 1.0).abs() > 0.1 {
            let expected = -force / THICK[usize::from(x[1] > 1.0)];
            assert!(
                (yy / expected - 1.0).abs() < 1e-4,
                "{what}: {x:?} {yy} {expected}"
            );
        }
    }
}

/// What a block carries is its stress times its thickness; contact pressures are those of the first boundary.
#[test]
fn pressure_through_a_contact() {
    for (first, second) in [("up-bottom", "low-top"), ("low-top", "up-bottom")] {
        for order in [1, 2] {
            for large in [false, true] {
                for path in [Stiffness::Cholesky, Stiffness::Pcg] {
                    let what = format!("{first} {order} {large} {path:?}");
                    let model = match large {
                        true => blocks(order).large_displacements(),
                        false => blocks(order),
                    };
                    let model = model
                        .traction(Traction::on("up-top").pressure(1e4))
                        .contact(Pair::new(first, second).coulomb(0.3));
                    let found = answer(model, 1e-11, path);
                    let force = 1e4 * THICK[1];
                    check_stresses(&found, 0.0, force, &what);
                    let expected = force / THICK[usize::from(first == "up-bottom")];
                    for p in (0..found.m()).map(|i| found.pressure(i)) {
                        assert!((p / expected - 1.0).abs() < 1e-4, "{what}: {p}");
                    }
                    let report = found.report();
                    let held: f64 = report.supports.iter().map(|one| one.force[1]).sum();
                    assert!((held / force - 1.0).abs() < 1e-4, "{what}: {held}");
                }
            }
        }
    }
}

/// Tied and warmer between two walls: F = α θ l / Σ l/(E A); and its own weight.
#[test]
fn expansion_and_weight() {
    for order in [1, 2] {
        let tied = || blocks(order).tie(Pair::tied("low-top", "up-bottom"));
        let warm = tied()
            .support(Support::on("up-top").y(0.0))
            .temperature(Temperature::everywhere(100.0));
        let force = 3e-3 / (1.0 / (YOUNG * THICK[0]) + 2.0 / (YOUNG * THICK[1]));
        check_stresses(
            &answer(warm, 1e-11, Stiffness::Cholesky),
            100.0,
            force,
            "warm",
        );
        let found = answer(tied().gravity([0.0, -10.0]), 1e-11, Stiffness::Pcg);
        let held: f64 = (found.report().supports.iter())
            .map(|one| one.force[1])
            .sum();
        let weight = 5000.0 * (THICK[0] + 2.0 * THICK[1]);
        assert!((held / weight - 1.0).abs() < 1e-8, "{held} {weight}");
    }
}

#[test]
fn a_thickness_that_means_nothing_is_refused() {
    let with = |thickness| Material {
        thickness: Some(thickness),
        ..Material::new(YOUNG, 0.0)
    };
    let plane = |material| {
        let mesh = rectangle([1.0, 0.0], [1.0, 1.0], [2, 2], CellShape::Quad, "a", "");
        Model::on(mesh)
            .material(material)
            .support(Support::on("left").fixed())
    };
    for (model, what) in [
        (plane(with(0.0)), "thickness must be positive"),
        (plane(with(1e-300)), "thickness is 1e-300"),
        (
            plane(with(2.0)).plane(Plane::Axisymmetric),
            "a body of revolution has no thickness",
        ),
    ] {
        let error = model.build().map(|_| ()).expect_err(what).to_string();
        assert!(
            error.contains(what) && error.contains("material"),
            "{error}"
        );
    }
}
