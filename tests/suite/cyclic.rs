//! Cyclic symmetry: sectors against whole bodies, and sides whose meshes do not match.

use crate::common::models::{answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use signorini::elasticity::{Material, Plane};
use signorini::engine::Stiffness;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::model::{Axis, Cyclic, Model, Pair, Support, Temperature, Traction};
use signorini::ssnm::Status;
use std::f64::consts::TAU;

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];
const YOUNG: f64 = 2e11;
const PRESSURE: f64 = 1e8;

fn steel() -> Material {
    Material {
        expansion: 1e-5,
        density: 7800.0,
        ..Material::new(YOUNG, 0.3)
    }
}

/// A sector of an annulus from 1 to 2, one of several; `uneven`: the nodes of the last side are elsewhere than those of the first.
fn sector(sectors: f64, cells: [usize; 2], uneven: f64) -> Mesh {
    let mut mesh = rectangle([0.0; 2], [1.0; 2], cells, CellShape::Quad, "disc", "");
    for x in &mut mesh.nodes {
        let [s, t] = *x;
        let (r, angle) = (1.0 + s + uneven * t * s * (1.0 - s), TAU * t / sectors);
        *x = [r * angle.cos(), r * angle.sin()];
    }
    mesh
}

fn model(mesh: Mesh) -> Model {
    let axis = Axis::at([0.0, 0.0]);
    Model::on(mesh)
        .plane(Plane::PlaneStress)
        .material(steel())
        .support(Support::on("left").about(axis).hoop(0.0))
}

/// A sector grows freely as it becomes warmer, and shrinks evenly under a pressure all around, whichever side is named first, and however
/// the meshes of the sides lie. The sides pass the pressure on.
#[test]
fn a_warm_sector_under_pressure() {
    for (low, high) in [("bottom", "top"), ("top", "bottom")] {
        for uneven in [0.0, 0.4] {
            let axis = Axis::at([0.0, 0.0]);
            let model = model(sector(7.0, [4, 3], uneven))
                .temperature(Temperature::everywhere(100.0))
                .traction(Traction::on(["left", "right"]).pressure(PRESSURE))
                .cyclic(Cyclic::between(low, high, axis, 7));
            let growth = 1e-3 - PRESSURE * 0.7 / YOUNG;
            for path in PATHS {
                let found = answer(model.clone(), 1e-11, path);
                let nodes = &found.built.elastic.mesh.nodes;
                for (x, u) in nodes.iter().zip(found.displacement()) {
                    for c in 0..2 {
                        assert!((u[c] - growth * x[c]).abs() < 1e-11, "{x:?} {u:?}");
                    }
                }
            }
        }
    }
}

/// A rotating annulus as a twelfth and whole; and one under forces around it, which turn with the sectors.
#[test]
fn a_sector_is_a_part_of_the_whole() {
    let axis = Axis::at([0.0, 0.0]);
    let whole = {
        let mesh = sector(1.0, [4, 36], 0.0);
        // Both ends of the ring are the same nodes.
        let first: Vec<u32> = (0..5).collect();
        let close = |node: u32| match node.checked_sub(5 * 36) {
            Some(i) => first[i as usize],
            None => node,
        };
        let mut elements = mesh.elements.clone();
        for element in &mut elements {
            let nodes: Vec<u32> = element.nodes().iter().map(|&node| close(node)).collect();
            *element = signorini::mesh::Element::new(element.kind(), &nodes, element.region);
        }
        let boundaries = ["left", "right"].map(|name| {
            let facets = mesh.boundaries[name].iter();
            let facets = facets.map(|facet| facet.map(close));
            (name.to_owned(), facets.collect())
        });
        Mesh::new(mesh.nodes, elements, mesh.regions, boundaries.into()).expect("a ring")
    };
    let loaded = |model: Model| {
        model
            .rotation(axis, 300.0)
            .traction(Traction::on("right").about(axis).hoop(1e6).radial(3e6))
    };
    let part =
        loaded(model(sector(12.0, [4, 3], 0.0))).cyclic(Cyclic::between("bottom", "top", axis, 12));
    let whole = answer(loaded(model(whole)), 1e-12, Stiffness::Cholesky);
    let most = whole
        .displacement()
        .iter()
        .flatten()
        .fold(0.0, |m: f64, v| m.max(v.abs()));
    for path in PATHS {
        let found = answer(part.clone(), 1e-11, path);
        for (x, u) in found
            .built
            .elastic
            .mesh
            .nodes
            .iter()
            .zip(found.displacement())
        {
            let nodes = whole
                .built
                .elastic
                .mesh
                .nodes
                .iter()
                .zip(whole.displacement());
            let near = |y: &[f64; 2]| (x[0] - y[0]).hypot(x[1] - y[1]);
            let (_, v) = nodes
                .min_by(|a, b| near(a.0).total_cmp(&near(b.0)))
                .expect("nodes");
            assert!(
                (u[0] - v[0]).hypot(u[1] - v[1]) < 1e-8 * most,
                "{x:?} {u:?} {v:?}"
            );
        }
        assert_eq!(found.report().contacts[0].tied, 5);
    }
}

/// In space, about an axis that is nowhere near the origin, with the end held along it: warm and under pressure all around.
#[test]
fn a_sector_of_a_tube() {
    let sectors = 5;
    // x, y, z of the tube are y, z, x here.
    let centre = [3.0, -1.0, 2.0];
    let axis = Axis::new(centre, [2.0, 0.0, 0.0]);
    for (shape, uneven) in [
        (SolidShape::Hexahedron, 0.3),
        (SolidShape::Tetrahedron, 0.0),
        (SolidShape::Tetrahedron, 0.3),
    ] {
        let mut mesh = block([0.0; 3], [1.0; 3], [3, 3, 2], shape, "tube", "");
        for x in &mut mesh.nodes {
            let [s, t, z] = *x;
            let (r, angle) = (
                1.0 + s + uneven * t * s * (1.0 - s),
                TAU * t / f64::from(sectors),
            );
            *x = [
                centre[0] + z,
                centre[1] + r * angle.cos(),
                centre[2] + r * angle.sin(),
            ];
        }
        let model = Model::on(mesh)
            .material(steel())
            .support(Support::on("bottom").x(0.0))
            .support(Support::on("left").about(axis).hoop(0.0))
            .cyclic(Cyclic::between("front", "back", axis, sectors))
            .temperature(Temperature::everywhere(100.0))
            .traction(Traction::on(["left", "right", "top"]).pressure(PRESSURE));
        let growth = 1e-3 - PRESSURE * 0.4 / YOUNG;
        for path in PATHS {
            let found = answer(model.clone(), 1e-11, path);
            for (x, u) in found
                .built
                .elastic
                .mesh
                .nodes
                .iter()
                .zip(found.displacement())
            {
                for c in 0..3 {
                    let exact = growth * (x[c] - centre[c]);
                    assert!(
                        (u[c] - exact).abs() < 1e-11,
                        "{shape:?} {uneven}: {x:?} {u:?}"
                    );
                }
            }
        }
    }
}

/// A thin sector, whichever side is first, and one whose last side has the only held node: Lamé's ring.
#[test]
fn a_thin_sector_and_a_held_node() {
    let axis = Axis::at([0.0, 0.0]);
    let base = |mesh: Mesh, sides: [&str; 2], sectors: u32| {
        Model::on(mesh)
            .plane(Plane::PlaneStress)
            .material(steel())
            .traction(Traction::on("left").pressure(PRESSURE))
            .cyclic(Cyclic::between(sides[0], sides[1], axis, sectors))
    };
    // r = 1: p/E (1 + ν + 2 a²/(b² − a²) …) of Lamé.
    let exact = PRESSURE / YOUNG * (0.7 * 1.0 / 3.0 + 1.3 * 4.0 / 3.0);
    for sides in [["bottom", "top"], ["top", "bottom"]] {
        let thin = base(sector(180.0, [12, 1], 0.0), sides, 180)
            .support(Support::at_point([1.0, 0.0]).y(0.0));
        let wide = base(sector(12.0, [12, 12], 0.0), sides, 12)
            .support(Support::at_point([1.0, 0.0]).y(0.0));
        for (model, off) in [(thin, 3e-3), (wide, 3e-3)] {
            let found = answer(model, 1e-10, Stiffness::Cholesky);
            for (x, u) in found
                .built
                .elastic
                .mesh
                .nodes
                .iter()
                .zip(found.displacement())
            {
                if x[0].hypot(x[1]) < 1.0 + 1e-9 {
                    assert!(
                        (u[0].hypot(u[1]) - exact).abs() < off * exact,
                        "{sides:?} {x:?} {u:?} {exact}"
                    );
                }
            }
        }
    }
}

#[test]
fn sectors_that_do_not_close_are_refused() {
    let axis = Axis::at([0.0, 0.0]);
    for (sectors, low, text) in [
        (
            9,
            "bottom",
            "turned by 360/9 degrees about the point [0.0, 0.0], lies on \"top\"",
        ),
        (1, "bottom", "sectors is 1: a body has at least two"),
        (7, "nowhere", "nowhere"),
    ] {
        let model =
            model(sector(7.0, [4, 3], 0.0)).cyclic(Cyclic::between(low, "top", axis, sectors));
        let refused = model.build().expect_err("it does not close").to_string();
        assert!(refused.contains(text), "{refused}");
    }
}

/// A shaft in a hub that is too small for it by as much everywhere, a sector of both: the pressure is even up to the sides of the
/// sectors, and a torque meets nothing but friction.
#[test]
fn contact_goes_on_beyond_the_sides() {
    let (sectors, inner) = (8_u32, 1.5);
    let ring = |low: f64, high: f64, cells: [usize; 2], name: &str| {
        let prefix = format!("{name}-");
        let mut mesh = rectangle([0.0; 2], [1.0; 2], cells, CellShape::Quad, name, &prefix);
        for x in &mut mesh.nodes {
            let (r, angle) = (low + (high - low) * x[0], TAU * x[1] / f64::from(sectors));
            *x = [r * angle.cos(), r * angle.sin()];
        }
        mesh
    };
    let axis = Axis::at([0.0, 0.0]);
    for cells in [6, 4] {
        for orders in [1, 2] {
            let mut mesh = join(
                ring(1.0, inner, [3, 6], "shaft"),
                ring(inner, 2.0, [3, cells], "hub"),
            );
            if orders == 2 {
                mesh = mesh.raised().or_panic();
            }
            let side = |name: &str| {
                let [low, high] = ["bottom", "top"].map(|side| format!("{name}-{side}"));
                Cyclic::between(low, high, axis, sectors)
            };
            let model = |torque: f64| {
                Model::on(mesh.clone())
                    .plane(Plane::PlaneStress)
                    .material(steel())
                    .support(Support::on("hub-right").about(axis).hoop(0.0))
                    .cyclic(side("shaft"))
                    .cyclic(side("hub"))
                    .traction(Traction::on("shaft-left").about(axis).torque(torque))
                    .contact(
                        Pair::new("shaft-right", "hub-left")
                            .interference(1e-4)
                            .coulomb(0.3),
                    )
            };
            // Of two rings with these radii (Lamé), with their polygons.
            let found = answer(model(0.0), 1e-9, Stiffness::Cholesky);
            let pressures: Vec<f64> = (0..found.m()).map(|i| found.pressure(i)).collect();
            let mean = pressures.iter().sum::<f64>() / pressures.len() as f64;
            let even = if cells == 6 { 1e-6 } else { 0.03 };
            let off = pressures.iter().map(|p| (p / mean - 1.0).abs());
            let off = off.fold(0.0, f64::max);
            assert!(off < even, "{cells} {orders}: {pressures:?}");
            // Friction bears a torque up to its limit, and nothing bears more.
            let area = TAU * inner / f64::from(sectors);
            let limit = 0.3 * mean * area * inner;
            let answers = [0.7, 1.1].map(|part| {
                let built = model(part * limit).build().or_panic();
                let steps = built
                    .solve(&on_the_cpu(1e-7, Stiffness::Cholesky))
                    .or_panic();
                steps[0].status
            });
            assert_eq!(answers[0], Status::Converged, "{cells} {orders}");
            assert_ne!(answers[1], Status::Converged, "{cells} {orders}");
        }
    }
}
