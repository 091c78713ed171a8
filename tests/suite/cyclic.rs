//! Cyclic symmetry: sectors against whole bodies, and sides whose meshes do not match.

use crate::common::apart;
use crate::common::models::{Answer, answer, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use signorini::contact::Space;
use signorini::elasticity::{Material, Plane, internal_forces};
use signorini::engine::{Engine, Stiffness};
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{Element, ElementKind, Mesh, Topology, facet_nodes};
use signorini::model::{
    Analysis, Axis, Cyclic, Model, Pair, Quantity, Support, Temperature, Traction,
};
use signorini::output::{Draw, Results, StepResults, shown_at_nodes};
use signorini::quasistatic::StepSettings;
use signorini::solve::Event;
use signorini::ssnm::Status;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

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
    for path in PATHS {
        let found = answer(part.clone(), 1e-11, path);
        is_a_part(&found, &whole);
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

/// An annulus that is fixed inside, with shear around it: u = τ b²/2G r (1/a² − 1/r²) around. The support holds the
/// first node of each side along axes that the turn does not take to each other.
#[test]
fn a_support_holds_both_sides() {
    let axis = Axis::at([0.0, 0.0]);
    for uneven in [0.0, 0.4] {
        let model = Model::on(sector(6.0, [8, 6], uneven))
            .plane(Plane::PlaneStress)
            .material(steel())
            .support(Support::on("left").fixed())
            .traction(Traction::on("right").about(axis).hoop(1e6))
            .cyclic(Cyclic::between("bottom", "top", axis, 6));
        let exact = |r: f64| 1e6 * 4.0 / (YOUNG / 1.3) * (r - 1.0 / r);
        for path in PATHS {
            let found = answer(model.clone(), 1e-11, path);
            let nodes = &found.built.elastic.mesh.nodes;
            for (x, u) in nodes.iter().zip(found.displacement()) {
                let r = x[0].hypot(x[1]);
                let around = (x[0] * u[1] - x[1] * u[0]) / r;
                assert!(
                    (around - exact(r)).abs() < 0.03 * exact(2.0),
                    "{x:?} {around} {}",
                    exact(r)
                );
            }
        }
    }
}

/// A tube that is fixed at one end and twisted at the other: shear up to T b/J, and nothing presses on the sides, at the fixed end either.
#[test]
fn a_fixed_end_has_no_forces_of_its_own() {
    let axis = Axis::new([0.0; 3], [0.0, 0.0, 1.0]);
    let shape = SolidShape::Tetrahedron;
    let mut mesh = block([0.0; 3], [1.0; 3], [3, 3, 2], shape, "tube", "");
    for x in &mut mesh.nodes {
        let [s, t, z] = *x;
        let (r, angle) = (1.0 + s + 0.3 * t * s * (1.0 - s), TAU * t / 6.0);
        *x = [r * angle.cos(), r * angle.sin(), z];
    }
    let model = Model::on(mesh)
        .material(steel())
        .support(Support::on("bottom").fixed())
        .traction(Traction::on("top").about(axis).torque(1e6 / 6.0))
        .cyclic(Cyclic::between("front", "back", axis, 6));
    let shear = 1e6 * 2.0 / (TAU / 4.0 * 15.0);
    for path in PATHS {
        let most = answer(model.clone(), 1e-11, path).report().contacts[0].max_pressure;
        assert!(most < shear, "{most} {shear}");
    }
}

/// A quarter of a square bar about its middle, whose sides meet at the axis, against the whole bar: nodes on the axis do not move across it, and
/// along it nothing ties them to themselves.
#[test]
fn a_quarter_meets_itself_on_the_axis() {
    let axis = Axis::at([0.0, 0.0]);
    let bar = |low: f64, cells: usize| {
        let size = 1.0 - low;
        let mesh = rectangle([low; 2], [size; 2], [cells; 2], CellShape::Quad, "bar", "");
        let sides = if low < 0.0 {
            vec!["left", "right", "bottom", "top"]
        } else {
            vec!["right", "top"]
        };
        Model::on(mesh)
            .material(steel())
            .rotation(axis, 300.0)
            .support(Support::at_point([1.0, 1.0]).about(axis).hoop(0.0))
            .traction(Traction::on(&sides[..]).pressure(PRESSURE))
    };
    let mut whole = bar(-1.0, 8);
    for corner in [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]] {
        whole = whole.support(Support::at_point(corner).about(axis).hoop(0.0));
    }
    let whole = answer(whole, 1e-12, Stiffness::Cholesky);
    let part = bar(0.0, 4).cyclic(Cyclic::between("bottom", "left", axis, 4));
    for path in PATHS {
        is_a_part(&answer(part.clone(), 1e-11, path), &whole);
    }

    let axis = Axis::new([0.0; 3], [0.0, 0.0, 1.0]);
    let bar = |low: f64, cells: usize, shape: SolidShape, order: usize| {
        let size = 1.0 - low;
        let mesh = block(
            [low, low, 0.0],
            [size, size, 2.0],
            [cells, cells, 4],
            shape,
            "bar",
            "",
        );
        let mesh = if order == 2 {
            mesh.raised().or_panic()
        } else {
            mesh
        };
        let torque = 1e6 / if low < 0.0 { 1.0 } else { 4.0 };
        let end = |name: &str, torque: f64| Traction::on(name).about(axis).torque(torque);
        Model::on(mesh)
            .material(steel())
            .support(Support::at_point([1.0; 3]).about(axis).hoop(0.0).axial(0.0))
            .traction(end("top", torque))
            .traction(end("bottom", -torque))
    };
    for order in [1, 2] {
        let of = |low, cells| bar(low, cells, SolidShape::Hexahedron, order);
        let mut whole = of(-1.0, 4);
        for corner in [[-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, 1.0]] {
            whole = whole.support(Support::at_point(corner).about(axis).hoop(0.0).axial(0.0));
        }
        let whole = answer(whole, 1e-12, Stiffness::Cholesky);
        let part = of(0.0, 2).cyclic(Cyclic::between("front", "left", axis, 4));
        for path in PATHS {
            let found = answer(part.clone(), 1e-11, path);
            is_a_part(&found, &whole);
            // The forces of places of second order are partly those of nodes beside them.
            if order == 1 {
                shears_its_side(&found, of(0.0, 2));
            }
        }
    }
    // The diagonals of tetrahedra make other meshes of both sides.
    let alone = bar(0.0, 3, SolidShape::Tetrahedron, 1);
    let part = (alone.clone()).cyclic(Cyclic::between("front", "left", axis, 4));
    for path in PATHS {
        shears_its_side(&answer(part.clone(), 1e-11, path), alone.clone());
    }
}

/// Whether the displacements are those of a whole body at the same places.
fn is_a_part<const D: usize>(found: &Answer<D>, whole: &Answer<D>)
where
    ElementKind: Space<D>,
{
    let all = whole.displacement();
    let most = all.iter().flatten().fold(0.0, |m: f64, v| m.max(v.abs()));
    let places = &whole.built.elastic.mesh.nodes;
    for (x, u) in (found.built.elastic.mesh.nodes.iter()).zip(found.displacement()) {
        let near = |y: &[f64; D]| apart(x, y);
        let (_, v) = (places.iter().zip(&all))
            .min_by(|a, b| near(a.0).total_cmp(&near(b.0)))
            .expect("nodes");
        assert!(apart(&u, v) < 1e-8 * most, "{x:?} {u:?} {v:?}");
    }
}

/// Whether the reported force along the axis, z, is what elements of a body without sectors have at the nodes of the side x = 0 beside the axis,
/// if both sides move alike.
fn shears_its_side(found: &Answer<3>, alone: Model<3>) {
    let u = found.displacement();
    let along = |c: usize| Quantity::at_nodes(u.iter().map(|u| u[c]).collect::<Vec<f64>>());
    let sides = Support::on(["front", "left"]);
    let sides = sides.x(along(0)).y(along(1)).z(along(2));
    let driven = answer(alone.support(sides), 1e-11, Stiffness::Cholesky);
    let body = driven.built.elastic.body();
    let forces = internal_forces(&body, &driven.data.unknowns, &driven.displacement());
    let of_side = body.mesh.nodes.iter().zip(&forces);
    let of_side = of_side.filter(|(x, _)| x[0] == 0.0 && x[1] > 0.0);
    let sum: f64 = of_side.map(|(_, force)| force[2]).sum();
    let told = found.report().contacts[0].force[2];
    assert!(sum.abs() > 1e4, "{sum}");
    assert!((told - sum).abs() < 1e-7 * sum.abs(), "{told} {sum}");
}

#[test]
fn sectors_that_do_not_close_are_refused() {
    // Turned by 60° about this point, a side is 0.4 of its length farther out than the other one.
    let (far, cot) = (0.4, 3.0_f64.sqrt());
    let (way, half) = ([0.5, 0.75_f64.sqrt()], 0.5 * far);
    let off = [
        half * (way[0] - cot * way[1]),
        half * (cot * way[0] + way[1]),
    ];
    let cyclic = Cyclic::between("bottom", "top", Axis::at(off), 6);
    let part = model(sector(6.0, [5, 4], 0.0)).cyclic(cyclic);
    let refused = part.build().expect_err("a part is tied").to_string();
    assert!(refused.contains("only 60 % of \"bottom\""), "{refused}");

    let axis = Axis::at([0.0, 0.0]);
    // A shaft of nine sectors in a hub of seven.
    let mut shaft = sector(9.0, [4, 3], 0.0);
    shaft.nodes.iter_mut().for_each(|x| *x = x.map(|x| 0.5 * x));
    shaft.rename(|_| "shaft".to_owned(), |name| format!("shaft-{name}"));
    let both = model(join(shaft, sector(7.0, [4, 3], 0.0)))
        .contact(Pair::new("shaft-right", "left"))
        .cyclic(Cyclic::between("shaft-bottom", "shaft-top", axis, 9))
        .cyclic(Cyclic::between("bottom", "top", axis, 7));
    let refused = both.build().expect_err("they do not fit").to_string();
    let text = "its sides belong to sectors of different numbers or about different axes";
    assert!(refused.contains(text), "{refused}");

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
    for (cells, together) in [(6, false), (6, true), (4, false)] {
        for orders in [1, 2] {
            let mut mesh = join(
                ring(1.0, inner, [3, 6], "shaft"),
                ring(inner, 2.0, [3, cells], "hub"),
            );
            if orders == 2 {
                mesh = mesh.raised().or_panic();
            }
            let side = |names: &[&str]| {
                let [low, high] = ["bottom", "top"].map(|side| {
                    let of_names = names.iter().map(|name| format!("{name}-{side}"));
                    of_names.collect::<Vec<_>>()
                });
                Cyclic::between(low, high, axis, sectors)
            };
            let model = |torque: f64| {
                let model = match together {
                    true => Model::on(mesh.clone()).cyclic(side(&["shaft", "hub"])),
                    false => Model::on(mesh.clone())
                        .cyclic(side(&["shaft"]))
                        .cyclic(side(&["hub"])),
                };
                model
                    .plane(Plane::PlaneStress)
                    .material(steel())
                    .support(Support::on("hub-right").about(axis).hoop(0.0))
                    .traction(Traction::on("shaft-left").about(axis).torque(torque))
                    .contact(
                        Pair::new("shaft-right", "hub-left")
                            .interference(1e-4)
                            .coulomb(0.3),
                    )
            };
            // Of two rings with these radii (Lamé), with their polygons.
            let found = answer(model(0.0), 1e-9, Stiffness::Cholesky);
            let of_contact = |i: &usize| found.built.elastic.pair_of[*i] == 0;
            let pressures: Vec<f64> = (0..found.m())
                .filter(of_contact)
                .map(|i| found.pressure(i))
                .collect();
            // The force at a side may be that of either of its two ends.
            let mut pressures = pressures;
            pressures.sort_unstable_by(f64::total_cmp);
            let (low, high) = (
                pressures.remove(0),
                pressures.pop().expect("there are more"),
            );
            pressures.push(0.5 * (low + high));
            let mean = pressures.iter().sum::<f64>() / pressures.len() as f64;
            // Nodes of second order, on chords, and meshes that do not match differ a little.
            let even = match [cells, orders] {
                [6, 1] => 1e-6,
                [4, 2] => 0.07,
                _ => 0.04,
            };
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
            // Polygons of different numbers of sides hold each other.
            if cells == 6 {
                assert_ne!(answers[1], Status::Converged, "{cells} {orders}");
            }
        }
    }
}

/// A ring that has shrunk onto a shaft, polygons that a quarter of a side turns against each other. As small displacements see it, the
/// ring leaves the shaft everywhere as soon as it has turned far enough, but friction keeps it where it is.
#[test]
fn a_ring_stays_on_a_polygon_that_is_turned() {
    for cells in [32_u32, 36, 40] {
        let turned = 0.25 * TAU / f64::from(cells);
        let cells = [2, cells as usize];
        let around = |from: f64| [from, from + TAU];
        let shaft = welded(ring::<3>("shaft", [0.4, 1.0], around(0.0), cells, 1));
        let hub = welded(ring::<3>("hub", [1.0, 1.6], around(turned), cells, 1));
        let mesh = join(shaft, hub);
        let warm = Material {
            expansion: 2e-5,
            ..Material::new(1e3, 0.25)
        };
        for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
            let model = Model::on(mesh.clone())
                .material_in("shaft", Material::new(2e3, 0.3))
                .material_in("hub", warm)
                .temperature(Temperature::within("hub", -20.0))
                .support(Support::on("shaft-inside").fixed())
                .contact(
                    Pair::new("shaft-outside", "hub-inside")
                        .overlap_as_interference()
                        .coulomb(0.2),
                );
            let found = answer(model, 1e-6, stiffness);
            let pressures: Vec<f64> = (0..found.m()).map(|i| found.pressure(i)).collect();
            let low = pressures.iter().copied().fold(f64::INFINITY, f64::min);
            let high = pressures.iter().copied().fold(0.0, f64::max);
            println!("{cells:?} {stiffness:?}: {low:.4} to {high:.4}");
            assert!(low > 0.9 * high, "{cells:?}: {low} to {high}");
        }
    }
}

/// A coarse shaft warms by very little in a coarse hub that is turned. Where displacements are large the gaps between arcs are carried
/// to the displaced places, and must not change where nothing has moved.
#[test]
fn a_coarse_shaft_warms_in_a_turned_hub() {
    for cells in [8_u32, 16] {
        let ring = |name, radii, from: f64| {
            welded(ring::<3>(
                name,
                radii,
                [from, from + TAU],
                [2, cells as usize],
                1,
            ))
        };
        let model = Model::on(join(
            ring("shaft", [0.4, 1.0], 0.0),
            ring("hub", [1.0, 1.6], 0.3),
        ))
        .material(Material {
            expansion: 1e-5,
            ..Material::new(1e3, 0.3)
        })
        .temperature(Temperature::within("shaft", 0.01))
        .support(Support::on("shaft-inside").fixed())
        .contact(
            Pair::new("shaft-outside", "hub-inside")
                .overlap_as_touching()
                .coulomb(0.3),
        );
        let [small, large] = [model.clone(), model.large_displacements()].map(|model| {
            let found = answer(model, 1e-6, Stiffness::Cholesky);
            let pressures = (0..found.m()).map(|i| found.pressure(i));
            pressures.fold([f64::INFINITY, 0.0], |[low, high], p| {
                [f64::min(low, p), f64::max(high, p)]
            })
        });
        println!("{cells} cells: {small:?} and {large:?}");
        // The gaps between the arcs are 0.076 and 0.019, the shaft grows by 1e-7.
        let part = if cells == 8 { 0.5 } else { 0.01 };
        for (small, large) in small.iter().zip(large) {
            assert!(
                (large - small).abs() < part * small,
                "{cells}: {large} for {small}"
            );
        }
    }
}

/// Without friction nothing keeps a hub from turning on its shaft. Facets that do not match must not turn it.
#[test]
fn a_hub_without_friction_keeps_its_place() {
    keeps_its_place::<2>();
    keeps_its_place::<3>();
}

fn keeps_its_place<const D: usize>()
where
    ElementKind: Space<D> + Rings<D>,
{
    for order in [1, 2] {
        let pressed = |turned: f64, large: bool, stiffness: Stiffness| {
            let ring = |name, radii, from: f64| {
                welded(ring::<D>(name, radii, [from, from + TAU], [2, 24], order))
            };
            let shaft = ring("shaft", [0.4, 1.0], 0.0);
            let model = Model::on(join(shaft, ring("hub", [1.0, 1.6], turned)))
                .material(Material::new(1e3, 0.3))
                .support(Support::on("shaft-inside").fixed())
                .contact(Pair::new("shaft-outside", "hub-inside").interference(1e-3));
            let model = match large {
                true => model.large_displacements(),
                false => model,
            };
            // What turns freely is pressed off the end of the shaft by the slightest slide.
            let model = match D {
                3 => {
                    let axis = <ElementKind as Rings<D>>::axis();
                    let outside = Support::on("hub-outside").about(axis);
                    model.support(<ElementKind as Rings<D>>::along(outside))
                }
                _ => model,
            };
            let found = answer(model, 1e-7, stiffness);
            let far = found
                .solution
                .u
                .iter()
                .fold(0.0, |far: f64, u| far.max(u.abs()));
            assert!(
                far < 2e-3,
                "order {order}, turned by {turned}, large {large}: {far}"
            );
            found.solution.lambda[..found.m()].iter().sum::<f64>()
        };
        let matched = pressed(0.0, false, Stiffness::Cholesky);
        for (turned, stiffness) in [(0.1, Stiffness::Cholesky), (0.03, Stiffness::Pcg)] {
            for large in [false, true] {
                let force = pressed(turned, large, stiffness);
                println!("{D} dimensions, order {order}, large {large}: {force} for {matched}");
                let part = if large { 5e-3 } else { 2e-3 };
                assert!(
                    (force / matched - 1.0).abs() < part,
                    "{force} for {matched}"
                );
            }
        }
    }
}

/// Pins that move in holes with other facets: forces are those of facets that match, of each of two pins of one contact, too, and of a
/// pin that is drawn where it touches.
#[test]
fn pins_in_holes_of_other_facets() {
    let force = |places: &[f64], facets: [usize; 2], drawn: f64, with_itself: bool| {
        let part = |name: String, radii, facets, place: [f64; 2]| {
            let mut mesh = welded(ring::<2>(&name, radii, [0.0, TAU], [6, facets], 1));
            for x in &mut mesh.nodes {
                *x = [x[0] + place[0], x[1] + place[1]];
            }
            mesh
        };
        let parts = places.iter().enumerate().map(|(k, &x)| {
            let pin = part(format!("pin{k}"), [0.4, 0.99], facets[0], [x, -drawn]);
            let plate = part(format!("plate{k}"), [1.0, 2.0], facets[1], [x, 0.0]);
            join(pin, plate)
        });
        let all = |name: &str| -> Vec<String> {
            let each = (0..places.len()).map(|k| name.replace('*', &k.to_string()));
            each.collect()
        };
        let model = Model::on(parts.reduce(join).expect("a pin"))
            .material(Material::new(1e3, 0.3))
            .support(Support::on(all("pin*-inside")).x(0.0).y(drawn - 0.02))
            .support(Support::on(all("plate*-outside")).fixed());
        let skin = [all("pin*-outside"), all("plate*-inside")];
        let model = model.contact(match with_itself {
            true => Pair::new(skin.concat(), skin.concat()),
            false => Pair::new(skin[0].clone(), skin[1].clone()),
        });
        let found = answer(model, 1e-9, Stiffness::Cholesky);
        found.solution.lambda[..found.m()].iter().sum::<f64>() / places.len() as f64
    };
    let matched = force(&[0.0], [96, 96], 0.0, false);
    let with_itself = force(&[0.0], [48, 96], 0.0, true);
    assert!(
        (with_itself / matched - 1.0).abs() < 0.02,
        "{with_itself} for {matched}"
    );
    for (places, facets, drawn, most) in [
        (&[0.0][..], [48, 96], 0.0, 0.02),
        (&[0.0], [96, 40], 0.0, 0.02),
        (&[0.0, 5.0], [48, 96], 0.0, 0.02),
        (&[0.0], [48, 96], 0.01, 0.02),
        (&[0.0], [96, 96], 0.01, 0.02),
    ] {
        let found = force(places, facets, drawn, false);
        println!("{places:?} {facets:?} {drawn}: {found} for {matched}");
        assert!(
            (found / matched - 1.0).abs() < most,
            "{found} for {matched}"
        );
    }
}

/// The mesh with one node where it has several, and without the facets that are between elements then.
fn welded<const D: usize>(mesh: Mesh<D>) -> Mesh<D>
where
    ElementKind: Topology<D>,
{
    let same = |a: &[f64; D], b: &[f64; D]| apart(a, b) < 1e-9;
    let nodes = &mesh.nodes;
    let first = |node: u32| {
        let x = &nodes[node as usize];
        nodes.iter().position(|y| same(x, y)).expect("itself") as u32
    };
    let first: Vec<u32> = (0..nodes.len() as u32).map(first).collect();
    let elements = mesh.elements.iter().map(|element| {
        let nodes: Vec<u32> = (element.nodes().iter())
            .map(|&n| first[n as usize])
            .collect();
        Element::new(element.kind(), &nodes, element.region)
    });
    let elements = elements.collect();
    let mut boundaries = mesh.boundaries.clone();
    boundaries.retain(|name, _| name.ends_with("inside") || name.ends_with("outside"));
    for facet in boundaries.values_mut().flatten() {
        (facet.as_mut().iter_mut()).for_each(|node| *node = first[*node as usize]);
    }
    Mesh::new(mesh.nodes, elements, mesh.regions, boundaries).expect("a ring")
}

/// Rings of the plane or of space in each other.
trait Rings<const D: usize>
where
    ElementKind: Topology<D>,
{
    fn axis() -> Axis<D>;

    /// A support that holds along the axis, too.
    fn along(support: Support<D>) -> Support<D>;

    /// The unit square, or a part of the unit cube, with as many cells along the first two axes.
    fn block(name: &str, cells: [usize; 2]) -> Mesh<D>;
}

/// A ring of these radii, between two angles, with as many cells out and around; of second order, too.
fn ring<const D: usize>(
    name: &str,
    radii: [f64; 2],
    angles: [f64; 2],
    cells: [usize; 2],
    order: usize,
) -> Mesh<D>
where
    ElementKind: Rings<D> + Topology<D>,
{
    let mut mesh = <ElementKind as Rings<D>>::block(name, cells);
    if order == 2 {
        mesh = mesh.raised().or_panic();
    }
    mesh.nodes.iter_mut().for_each(|x| bent(x, radii, angles));
    named(&mut mesh, name);
    mesh
}

/// The sector of a ring, from where it starts to where it ends.
fn repeated<const D: usize>(name: &str, sectors: u32) -> Cyclic<D>
where
    ElementKind: Rings<D> + Topology<D>,
{
    let [low, high] = ["start", "end"].map(|side| format!("{name}-{side}"));
    Cyclic::between(low, high, <ElementKind as Rings<D>>::axis(), sectors)
}

/// Names of sides of a ring, from those of its unit square or cube.
fn named<const D: usize>(mesh: &mut Mesh<D>, name: &str)
where
    ElementKind: Topology<D>,
{
    let sides = match D {
        2 => ["left", "right", "bottom", "top"],
        _ => ["left", "right", "front", "back"],
    };
    for (side, to) in sides.into_iter().zip(["inside", "outside", "start", "end"]) {
        let facets = mesh
            .boundaries
            .remove(&format!("{name}-{side}"))
            .expect("a side");
        mesh.boundaries.insert(format!("{name}-{to}"), facets);
    }
}

fn bent<const D: usize>(x: &mut [f64; D], radii: [f64; 2], angles: [f64; 2]) {
    let r = radii[0] + (radii[1] - radii[0]) * x[0];
    let angle = angles[0] + (angles[1] - angles[0]) * x[1];
    [x[0], x[1]] = [r * angle.cos(), r * angle.sin()];
}

impl Rings<2> for ElementKind {
    fn axis() -> Axis {
        Axis::at([0.0; 2])
    }

    fn along(support: Support) -> Support {
        support
    }

    fn block(name: &str, cells: [usize; 2]) -> Mesh {
        let prefix = format!("{name}-");
        rectangle([0.0; 2], [1.0; 2], cells, CellShape::Quad, name, &prefix)
    }
}

impl Rings<3> for ElementKind {
    fn axis() -> Axis<3> {
        Axis::new([0.0; 3], [0.0, 0.0, 1.0])
    }

    fn along(support: Support<3>) -> Support<3> {
        support.axial(0.0)
    }

    fn block(name: &str, cells: [usize; 2]) -> Mesh<3> {
        let prefix = format!("{name}-");
        block(
            [0.0; 3],
            [1.0, 1.0, 0.3],
            [cells[0], cells[1], 2],
            SolidShape::Hexahedron,
            name,
            &prefix,
        )
    }
}

/// What a fit passes on: the normal force, the moment, the area, and the pressures in their order.
fn passed_on<const D: usize>(found: &Answer<D>, sectors: f64) -> ([f64; 3], Vec<f64>)
where
    ElementKind: Space<D>,
{
    let mut sums = [0.0; 3];
    let mut pressures = Vec::new();
    for i in (0..found.m()).filter(|i| found.built.elastic.pair_of[*i] == 0) {
        let (x, force) = (found.place(i), found.contact_force(i));
        let all = [
            found.solution.lambda[i],
            x[0] * force[1] - x[1] * force[0],
            found.area(i),
        ];
        (0..3).for_each(|k| sums[k] += sectors * all[k]);
        pressures.push(found.pressure(i));
    }
    pressures.sort_by(f64::total_cmp);
    (sums, pressures)
}

/// The kinds of a fit, and whether either side has the multipliers.
fn fits<const D: usize>() -> Vec<(&'static str, Pair<D>)>
where
    ElementKind: Space<D>,
{
    let sides = [
        ("shaft-outside", "hub-inside"),
        ("hub-inside", "shaft-outside"),
    ];
    let mut all = Vec::new();
    for (one, other) in sides {
        let pressed = Pair::new(one, other).interference(0.02).coulomb(2.0);
        let slides = Pair::new(one, other).interference(0.02);
        let of_nodes = one.replace("outside", "nodes").replace("inside", "nodes");
        let by_nodes = Pair::new(of_nodes, other).by_nodes();
        let by_nodes = by_nodes.interference(0.02).coulomb(2.0);
        all.push(("pressed", pressed.clone()));
        all.push(("slides", slides));
        all.push(("nodes", by_nodes));
        all.push(("tied", Pair::tied(one, other)));
    }
    all
}

/// A model with one of these fits.
fn fitted<const D: usize>(model: Model<D>, fit: &(&str, Pair<D>)) -> Model<D>
where
    ElementKind: Space<D>,
{
    match fit {
        ("tied", fit) => model.tie(fit.clone()),
        (_, fit) => model.contact(fit.clone()),
    }
}

/// The sector of a hub may begin elsewhere than that of its shaft: the bodies, their forces and pressures are those of the whole rings.
fn fits_of_turned_sectors<const D: usize>(
    sectors: u32,
    orders: &[usize],
    offs: &[f64],
    cells: &[usize],
) where
    ElementKind: Space<D> + Rings<D>,
{
    let n = 24;
    let axis = <ElementKind as Rings<D>>::axis();
    let bodies = |off: f64, parts: usize, hub: usize, order: usize| {
        let angle = TAU / parts as f64;
        let turn = off.to_radians();
        let shaft = ring("shaft", [0.4, 1.0], [0.0, angle], [3, n / parts], order);
        let hub = ring(
            "hub",
            [1.0, 1.6],
            [turn, turn + angle],
            [3, hub / parts],
            order,
        );
        let mut both = match parts {
            1 => join(welded(shaft), welded(hub)),
            _ => join(shaft, hub),
        };
        for (side, set) in [
            ("shaft-outside", "shaft-nodes"),
            ("hub-inside", "hub-nodes"),
        ] {
            let facets = both.boundaries[side].iter().flat_map(facet_nodes);
            let nodes: BTreeSet<u32> = facets.copied().collect();
            both.node_sets
                .insert(set.to_owned(), nodes.into_iter().collect());
        }
        both
    };
    let model = |mesh: Mesh<D>| {
        Model::on(mesh)
            .material(Material::new(1e3, 0.3))
            .support(Support::on("shaft-inside").fixed())
            .support(<ElementKind as Rings<D>>::along(
                Support::on("hub-outside")
                    .about(axis)
                    .radial(0.0)
                    .hoop(0.01),
            ))
    };
    let model = |mesh: Mesh<D>, fit: &(&str, Pair<D>)| fitted(model(mesh), fit);
    for &order in orders {
        for &hub in cells {
            for fit in fits::<D>() {
                for &off in offs {
                    let mesh = bodies(off, 1, hub, order);
                    let whole = answer(model(mesh, &fit), 1e-9, Stiffness::Cholesky);
                    let whole = passed_on(&whole, 1.0);
                    let side = |name: &str| {
                        let mut sides = ["start", "end"].map(|side| format!("{name}-{side}"));
                        if off == 40.0 && name == "hub" {
                            sides.reverse();
                        }
                        let [low, high] = sides;
                        Cyclic::between(low, high, axis, sectors)
                    };
                    let part = model(bodies(off, sectors as usize, hub, order), &fit);
                    let part = part.cyclic(side("shaft")).cyclic(side("hub"));
                    let found = answer(part, 1e-9, Stiffness::Cholesky);
                    let (sums, pressures) = passed_on(&found, f64::from(sectors));
                    let kind = fit.0;
                    // Facets of second order at the sides that supports hold are tied by their corners.
                    let same = if order == 1 { 1e-6 } else { 3e-3 };
                    let about = format!(
                        "{kind} {sectors} {order} {hub} {off}: {sums:?} {:?}",
                        whole.0
                    );
                    for (a, b) in sums.iter().zip(whole.0) {
                        assert!((a - b).abs() < same * whole.0[2].max(b.abs()), "{about}");
                    }
                    assert_eq!(pressures.len() * sectors as usize, whole.1.len(), "{about}");
                    let least = whole.0[1].abs() / whole.0[2];
                    let most = whole.1.iter().fold(least, |most, p| most.max(p.abs()));
                    for (p, of) in pressures.iter().zip(whole.1.chunks(sectors as usize)) {
                        let off = of.iter().fold(0.0_f64, |off, q| off.max((p - q).abs()));
                        assert!(
                            off < 10.0 * same * most,
                            "{about} {pressures:?} {:?}",
                            whole.1
                        );
                    }
                }
            }
        }
    }
}

#[test]
fn fits_of_turned_sectors_in_the_plane() {
    fits_of_turned_sectors::<2>(8, &[1, 2], &[0.0, 40.0, -105.0], &[24, 32]);
    fits_of_turned_sectors::<2>(2, &[1, 2], &[0.0, 130.0], &[32]);
    fits_of_turned_sectors::<2>(3, &[1], &[0.0, 190.0], &[24]);
}

/// Where the meshes of the sides of sectors do not match, a fit passes on nearly as much, with friction and tied.
#[test]
fn fits_of_sectors_whose_sides_do_not_match() {
    let axis = <ElementKind as Rings<3>>::axis();
    let model = |off: f64, uneven: f64, fit: &(&str, Pair<3>)| {
        let [shaft, hub] =
            [("shaft", [0.4, 1.0], 0.0), ("hub", [1.0, 1.6], off)].map(|(name, radii, start)| {
                let mut mesh = ring(name, radii, [start, start + TAU / 8.0], [3, 4], 1);
                for x in &mut mesh.nodes {
                    let t = (x[1].atan2(x[0]) - start) / (TAU / 8.0);
                    x[2] += uneven * t * x[2] * (0.3 - x[2]);
                }
                mesh
            });
        let model = Model::on(join(shaft, hub))
            .material(Material::new(1e3, 0.3))
            .support(Support::on("shaft-inside").fixed())
            .support(
                Support::on("hub-outside")
                    .about(axis)
                    .radial(0.0)
                    .hoop(0.01)
                    .axial(0.0),
            )
            .cyclic(repeated("shaft", 8))
            .cyclic(repeated("hub", 8));
        fitted(model, fit)
    };
    let passed = |off: f64, uneven: f64, fit: &(&str, Pair<3>)| {
        let found = answer(model(off, uneven, fit), 1e-9, Stiffness::Cholesky);
        let off_sides = found.built.elastic.pairs[0].unmatched;
        // Sectors that begin at one angle meet within themselves.
        assert_eq!(
            off_sides.is_some(),
            off > 0.0 && uneven > 0.0,
            "{off_sides:?}"
        );
        passed_on(&found, 8.0).0
    };
    for fit in fits::<3>().iter().filter(|fit| fit.0 != "nodes") {
        for off in [0.0, 0.4] {
            if fit.0 == "tied" && off > 0.0 {
                let refused = model(off, 1.5, fit).build().expect_err("it is too firm");
                let refused = refused.to_string();
                assert!(refused.contains("whose meshes do not match"), "{refused}");
                continue;
            }
            let [even, uneven] = [0.0, 1.5].map(|uneven| passed(off, uneven, fit));
            // Found: 2.3e-2 of the largest force (38.5 and 39.4, pressed), with integration points from the centres of pieces.
            let part = if off > 0.0 { 0.03 } else { 1e-4 };
            let most = even.iter().fold(0.0_f64, |most, a| most.max(a.abs()));
            for (a, b) in even.iter().zip(uneven) {
                assert!(
                    (a - b).abs() < part * most,
                    "{} {off}: {even:?} {uneven:?}",
                    fit.0
                );
            }
        }
    }
}

#[test]
fn fits_of_turned_sectors_in_space() {
    fits_of_turned_sectors::<3>(8, &[1], &[0.0, 40.0], &[32]);
}

/// Facets of second order that are covered in part, some of them by images, with large displacements.
#[test]
fn a_low_ring_on_a_sector_of_a_shaft() {
    let forces = [1, 7].map(|parts| {
        let [shaft, mut hub] =
            [("shaft", [0.4, 1.0], 0.0), ("hub", [1.0, 1.6], 0.1)].map(|(name, radii, start)| {
                let angles = [start, start + TAU / f64::from(parts)];
                ring::<3>(name, radii, angles, [1, 14 / parts as usize], 2)
            });
        hub.nodes.iter_mut().for_each(|x| x[2] *= 0.7);
        let mesh = match parts {
            1 => join(welded(shaft), welded(hub)),
            _ => join(shaft, hub),
        };
        let model = Model::on(mesh)
            .large_displacements()
            .material(Material::new(1e3, 0.3))
            .support(Support::on("shaft-inside").fixed())
            .contact(
                Pair::new("shaft-outside", "hub-inside")
                    .interference(0.01)
                    .coulomb(0.3),
            );
        let model = match parts {
            1 => model,
            _ => (model.cyclic(repeated("shaft", parts))).cyclic(repeated("hub", parts)),
        };
        let found = answer(model, 1e-8, Stiffness::Cholesky);
        passed_on(&found, f64::from(parts)).0[0]
    });
    let off = (forces[1] / forces[0] - 1.0).abs();
    // Found: 3.4e-5.
    println!("{forces:?}: {off:.1e}");
    assert!(off < 1e-4, "{forces:?}");
}

/// A shaft turns in its hub by more than a sector, with and without friction: in each load step the normal force, the moment, the area
/// and the pressures are those of the whole rings.
#[test]
fn a_shaft_turns_in_its_hub() {
    let axis = Axis::at([0.0; 2]);
    let bodies = |parts: usize, off: f64| {
        let [shaft, hub] =
            [("shaft", [0.4, 1.0], 0.0), ("hub", [1.0, 1.6], off)].map(|(name, radii, start)| {
                let angles = [start, start + TAU / parts as f64];
                ring(name, radii, angles, [2, 24 / parts], 1)
            });
        match parts {
            1 => join(welded(shaft), welded(hub)),
            _ => join(shaft, hub),
        }
    };
    // Friction below 0: a tie.
    let turned = |parts: usize, angle: f64, off: f64, friction: f64, sides: [&str; 2]| {
        let model = Model::on(bodies(parts, off))
            .large_displacements()
            .material(Material::new(1e3, 0.3))
            .support(
                Support::on("shaft-inside")
                    .turned(axis, angle)
                    .factors([0.0, 0.5, 1.0]),
            )
            .support(Support::on("hub-outside").fixed())
            .steps([1.0, 1.0, 1.0]);
        let model = match friction {
            ..0.0 => model.tie(Pair::tied(sides[0], sides[1])),
            _ => model.contact(
                Pair::new(sides[0], sides[1])
                    .interference(0.01)
                    .coulomb(friction),
            ),
        };
        let model = ["shaft", "hub"]
            .iter()
            .fold(model, |model, name| match parts {
                1 => model,
                _ => model.cyclic(repeated(name, parts as u32)),
            });
        let built = model.build().or_panic();
        let mut engine = Engine::new(&built.problem, Default::default(), |_| {}).or_panic();
        let mut settings = StepSettings::default();
        settings.ssnm.tolerance = 1e-9;
        let mut ends = Vec::new();
        let solved = Analysis::from(&built).solve_on(&mut engine, &settings, |event| {
            if let Event::Ends(step) = event {
                let there = step.displaced.as_deref().unwrap_or(&built);
                let lambda = &step.solution.lambda;
                let (mut sums, mut pressures) = ([0.0; 3], Vec::new());
                let places = there.elastic.contact.places.iter().enumerate();
                for (i, place) in places.filter(|(i, _)| there.elastic.pair_of[*i] == 0) {
                    let [normal, tangent] = place.frame;
                    let rubs = lambda[there.problem.m() + i];
                    let force = [0, 1].map(|c| -lambda[i] * normal[c] - rubs * tangent[c]);
                    let x = place.place;
                    let all = [lambda[i], x[0] * force[1] - x[1] * force[0], place.area];
                    (0..3).for_each(|k| sums[k] += parts as f64 * all[k]);
                    pressures.push(lambda[i] / place.area);
                }
                pressures.sort_by(f64::total_cmp);
                ends.push((step.solution.status, sums, pressures));
            }
            ControlFlow::Continue(())
        });
        solved.or_panic();
        ends
    };
    for (parts, angle, off, friction) in [
        (8, 100.0, 0.0, 0.0),
        (8, 22.5, 1.1, 0.0),
        (4, 37.0, -2.0, 0.3),
        (2, 185.0, 0.4, 0.0),
        (6, 3.0, 0.8, -1.0),
    ] {
        for sides in [
            ["shaft-outside", "hub-inside"],
            ["hub-inside", "shaft-outside"],
        ] {
            let turned = |parts: usize| turned(parts, angle, off, friction, sides);
            let [whole, part] = [turned(1), turned(parts)];
            for (step, (a, b)) in part.iter().zip(&whole).enumerate() {
                let about =
                    format!("{parts} {angle} {off} {friction} {sides:?} {step}: {a:?} {b:?}");
                assert_eq!(
                    (a.0, b.0),
                    (Status::Converged, Status::Converged),
                    "{about}"
                );
                let most = b.1.iter().fold(0.0_f64, |most, y| most.max(y.abs()));
                for (x, y) in a.1.iter().zip(&b.1) {
                    assert!((x - y).abs() < 1e-5 * most, "{about}");
                }
                assert_eq!(parts * a.2.len(), b.2.len(), "{about}");
                for (p, all) in a.2.iter().zip(b.2.chunks(parts)) {
                    let off = all.iter().fold(0.0_f64, |off, q| off.max((p - q).abs()));
                    assert!(off < 1e-5 * most, "{about}");
                }
            }
        }
    }
}

/// Files and pictures show places whose nodes are in other sectors, of one sector and of all. Both nodes that are one show their place.
#[test]
fn results_show_places_of_other_sectors() {
    shows_turned_sectors::<2>();
    shows_turned_sectors::<3>();
}

fn shows_turned_sectors<const D: usize>()
where
    ElementKind: Space<D> + Rings<D> + Draw<D>,
{
    let part = |name: &str, radii, start: f64| {
        ring::<D>(name, radii, [start, start + TAU / 8.0], [2, 3], 1)
    };
    for is_whole in [false, true] {
        let mesh = join(part("shaft", [0.4, 1.0], 0.0), part("hub", [1.0, 1.6], 2.0));
        let shaft = repeated("shaft", 8);
        let shaft = if is_whole { shaft.whole() } else { shaft };
        let model = Model::on(mesh)
            .material(Material::new(1e3, 0.3))
            .support(Support::on("shaft-inside").fixed())
            .support(Support::on("hub-outside").fixed())
            .contact(
                Pair::new("shaft-outside", "hub-inside")
                    .interference(0.01)
                    .coulomb(0.2),
            )
            .cyclic(shaft)
            .cyclic(repeated("hub", 8));
        let built = model.build().or_panic();
        let analysis = Analysis::from(&built);
        let directory = tempfile::tempdir().or_panic();
        let mut results = Results::new(directory.path(), "Turned", analysis).or_panic();
        results.draw();
        let mut engine = Engine::new(&built.problem, Default::default(), |_| {}).or_panic();
        let solved = analysis.solve_on(&mut engine, &StepSettings::default(), |event| {
            if let Event::Ends(step) = event {
                let of = StepResults::new(analysis, &step);
                let bodies = of.of_bodies.as_ref().expect("bodies");
                let shown = shown_at_nodes(bodies.elastic, &bodies.contact, Some(0));
                let facets = bodies.elastic.mesh.boundaries["shaft-outside"].iter();
                for node in facets.flat_map(facet_nodes) {
                    let i = *shown.get(node).expect("a place");
                    // Also on the far side of the sector, whose places are those of the near side.
                    let x = bodies.elastic.mesh.nodes[*node as usize];
                    let [pressed, _] = bodies.contact.traction_vectors(i);
                    let pressed = bodies.elastic.turned_to(i, *node, pressed);
                    let inwards = -(x[0] * pressed[0] + x[1] * pressed[1]) / x[0].hypot(x[1]);
                    let pressure = bodies.contact.pressure[i];
                    assert!((inwards / pressure - 1.0).abs() < 1e-2, "{x:?} {pressed:?}");
                }
                results.add(&step).or_panic();
            }
            ControlFlow::Continue(())
        });
        solved.or_panic();
        results.finish().or_panic();
    }
}

/// An interference that is a function of the place in the drawn sector is that of the places of other sectors, turned back.
#[test]
fn stated_fields_repeat_themselves() {
    let (sectors, axis) = (8_u32, Axis::at([0.0; 2]));
    let sector = TAU / f64::from(sectors);
    let overlap = Quantity::from(move |x: [f64; 2]| {
        let angle = x[1].atan2(x[0]).rem_euclid(sector);
        0.01 + 0.01 * angle
    });
    let model = |whole: bool, sides: [&str; 2], off: f64| {
        let (angle, n) = if whole { (TAU, 24) } else { (sector, 3) };
        let shaft = ring("shaft", [0.4, 1.0], [0.0, angle], [3, n], 1);
        let hub = ring("hub", [1.0, 1.6], [off, off + angle], [3, n], 1);
        let mesh = match whole {
            true => join(welded(shaft), welded(hub)),
            false => join(shaft, hub),
        };
        let model = Model::on(mesh)
            .material(Material::new(1e3, 0.3))
            .support(Support::on("shaft-inside").fixed())
            .support(Support::on("hub-outside").fixed())
            .contact(Pair::new(sides[0], sides[1]).interference(overlap.clone()));
        match whole {
            true => model,
            false => (model.cyclic(Cyclic::between("shaft-start", "shaft-end", axis, sectors)))
                .cyclic(Cyclic::between("hub-start", "hub-end", axis, sectors)),
        }
    };
    for sides in [
        ["shaft-outside", "hub-inside"],
        ["hub-inside", "shaft-outside"],
    ] {
        for off in [0.0, 0.2, -sector] {
            let [whole, part] = [true, false].map(|is_whole| {
                let found = answer(model(is_whole, sides, off), 1e-9, Stiffness::Cholesky);
                passed_on(&found, if is_whole { 1.0 } else { f64::from(sectors) })
            });
            for (a, b) in part.0.iter().zip(whole.0) {
                assert!(
                    (a - b).abs() < 1e-6 * whole.0[0],
                    "{sides:?} {off}: {part:?} {whole:?}"
                );
            }
        }
    }
}

/// Stones of an arch all around a ring press each other as it is loaded from outside: each meets the next one beyond the side of its sector.
#[test]
fn stones_meet_those_of_the_next_sector() {
    let (sectors, axis) = (6_u32, Axis::at([0.0; 2]));
    let angle = TAU / f64::from(sectors);
    let core = |angle: f64, n: usize| ring("core", [0.5, 0.8], [0.0, angle], [2, n], 1);
    let stone = |k: u32| {
        let (name, start) = (format!("stone{k}"), (0.25 + f64::from(k)) * angle);
        ring(&name, [0.8, 1.4], [start, start + angle], [4, 4], 1)
    };
    let model = |count: u32| {
        let core = if count == 1 {
            core(angle, 4)
        } else {
            welded(core(TAU, 24))
        };
        let mesh = (0..count).fold(core, |mesh, k| join(mesh, stone(k)));
        let mut model = Model::on(mesh)
            .material(Material::new(1e3, 0.3))
            .support(Support::on("core-inside").fixed());
        for k in 0..count {
            let next = (k + 1) % count;
            model = model
                .traction(Traction::on(format!("stone{k}-outside")).pressure(1.0))
                .contact(Pair::new(
                    format!("stone{k}-end"),
                    format!("stone{next}-start"),
                ))
                .tie(Pair::tied(format!("stone{k}-inside"), "core-outside"));
        }
        match count {
            1 => model.cyclic(Cyclic::between("core-start", "core-end", axis, sectors)),
            _ => model,
        }
    };
    let [part, whole] = [1, sectors].map(|count| answer(model(count), 1e-10, Stiffness::Cholesky));
    is_a_part(&part, &whole);
    // Forces of corners where two stones and the ring meet are shared in any way.
    let pressing = |found: &Answer<2>, count: u32| -> f64 {
        let is_counted = |i: &usize| {
            let x = found.place(*i);
            found.built.elastic.pair_of[*i] < count && x[0].hypot(x[1]) > 0.81
        };
        let places = (0..found.m()).filter(is_counted);
        places.map(|i| found.solution.lambda[i]).sum::<f64>() / f64::from(count)
    };
    let [a, b] = [pressing(&part, 1), pressing(&whole, sectors)];
    assert!(b > 0.3 && (a - b).abs() < 1e-7 * b, "{a} {b}");
}
