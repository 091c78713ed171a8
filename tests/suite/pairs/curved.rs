//! Curved faces of second order: a wavy interface under pressure from all sides, and rings of the plane pressed into each
//! other. Curved sides of first order that are no arcs.

use crate::common::models::answer;
use crate::common::order::{Order, of_order};
use crate::common::space::Vector;
use crate::common::{built, case, solve_case};
use signorini::contact::Space;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Model, Pair, Support, Traction};
use std::f64::consts::PI;

const RUBBER: Material = Material::new(3000.0, 0.3);

/// A cube under pressure from all sides, cut along a wave, with these faces along either axis of the lower side and a few less
/// on the upper one: how far the pressures of single places are off at most, and in
/// the mean.
fn wavy(shapes: [(SolidShape, Order); 2], [a, b]: [usize; 2], sides: [&str; 2]) -> [f64; 2] {
    let part = |name: &str, (shape, order), cells: [usize; 2], up: f64| {
        let mesh = block(
            [0.0, 0.0, up],
            [1.0; 3],
            [cells[0], cells[1], 2],
            shape,
            name,
            &format!("{name}-"),
        );
        let mut mesh = of_order(mesh, order);
        for [x, y, z] in &mut mesh.nodes {
            let wave = 0.05 * (2.0 * PI * *x).sin() * (PI * *y).cos();
            *z += wave * (1.0 - (*z - 1.0).abs());
        }
        mesh
    };
    let low = part("low", shapes[0], [a, b], 0.0);
    let up = part("up", shapes[1], [a - a / 4, b - b / 4], 1.0);
    let shrunk = |c: usize| move |x: Vector| -(1.0 - 2.0 * 0.3) / 3000.0 * x[c];
    let mut model = Model::on(join(low, up))
        .material(RUBBER)
        .support(
            Support::on(["low-bottom", "up-top"])
                .x(shrunk(0))
                .y(shrunk(1))
                .z(shrunk(2)),
        )
        .contact(Pair::new(sides[0], sides[1]).gap(0.0));
    for body in ["low", "up"] {
        for side in ["left", "right", "front", "back"] {
            model = model.traction(Traction::on(format!("{body}-{side}")).pressure(1.0));
        }
    }
    let answer = answer(model, 1e-10, Stiffness::Cholesky);
    let off = (0..answer.m()).map(|i| (answer.pressure(i) - 1.0).abs());
    let off: Vec<f64> = off.collect();
    let mean = off.iter().sum::<f64>() / off.len() as f64;
    let worst = off.iter().copied().fold(0.0, f64::max);
    println!(
        "a wave of {a} × {b} {shapes:?}, λ on {}: pressures off by {worst:.1e}, in the mean by {mean:.1e}",
        sides[0]
    );
    [worst, mean]
}

#[test]
fn a_wave_under_pressure_from_all_sides() {
    let first = (SolidShape::Hexahedron, Order::First);
    let serendipity = (SolidShape::Hexahedron, Order::Serendipity);
    let lagrange = (SolidShape::Hexahedron, Order::Lagrange);
    let tetrahedra = (SolidShape::Tetrahedron, Order::Lagrange);
    for sides in [["low-top", "up-bottom"], ["up-bottom", "low-top"]] {
        wavy([first; 2], [8, 10], sides);
        for (shapes, limits) in [
            ([serendipity, lagrange], [2e-2, 4e-3]),
            ([tetrahedra, serendipity], [4e-2, 4e-3]),
            // The flat faces of the one side do not fit into the curved ones of the other.
            ([lagrange, first], [0.1, 0.02]),
        ] {
            wavy(shapes, [4, 5], sides);
            let [worst, mean] = wavy(shapes, [8, 10], sides);
            assert!(worst < limits[0] && mean < limits[1], "{worst:e} {mean:e}");
        }
    }
}

/// A quarter of a ring in another one, which is pressed on by δ/b = 1e-3: mean and scatter of the pressure, of the exact one.
fn rings(order: usize, shape: &str, interference: f64, sides: &str) -> [f64; 2] {
    let ring = |name: &str, low: f64, high: f64, cells: [usize; 2]| {
        let r = format!("({low} + {}*x)", high - low);
        format!(
            "[[mesh.part]]\nname = \"{name}\"\nrectangle = {{ size = [1, 1], cells = {cells:?}, {shape} \
             map = [\"{r}*cos(pi/2*y)\", \"{r}*sin(pi/2*y)\"] }}\n"
        )
    };
    let text = format!(
        "[mesh]\norder = {order}\n{}{}[[material]]\nyoung = 1000\npoisson = 0.3\n\
         [[support]]\nboundary = [\"in-bottom\", \"out-bottom\"]\ny = 0\n\
         [[support]]\nboundary = [\"in-top\", \"out-top\"]\nx = 0\n\
         [[contact]]\n{sides}\ninterference = {interference}\n",
        ring("in", 0.5, 1.0, [4, 8]),
        ring("out", 1.0, 2.0, [6, 11]),
    );
    let solved = solve_case(&text, 1e-10);
    let fields = solved.fields();
    let m = fields.pressure.len();
    // In plane strain: δ = p (1 − ν²)/E (s + 4/3 + s' ...) with both rings' compliances.
    let (e, nu) = (1000.0 / (1.0 - 0.09), 0.3 / 0.7);
    let ratio = |low: f64, high: f64| (high * high + low * low) / (high * high - low * low);
    let exact = interference * e / (ratio(1.0, 2.0) + nu + ratio(0.5, 1.0) - nu);
    let mean = fields.pressure.iter().sum::<f64>() / m as f64;
    let squares = fields.pressure.iter().map(|p| (p - mean).powi(2));
    let scatter = (squares.sum::<f64>() / m as f64).sqrt() / exact;
    let worst = fields.pressure.iter().map(|p| (p / exact - 1.0).abs());
    println!(
        "rings, order {order} {shape}, {sides:?}: mean {:+.3e}, scatter {scatter:.1e}, at most {:.1e}; {} products",
        mean / exact - 1.0,
        worst.fold(0.0, f64::max),
        solved.solution().n_a()
    );
    [(mean / exact - 1.0).abs(), scatter]
}

#[test]
fn rings_pressed_into_each_other() {
    for sides in [
        "boundary = \"in-right\"\nagainst = \"out-left\"",
        "boundary = \"out-left\"\nagainst = \"in-right\"",
    ] {
        rings(1, "", 1e-3, sides);
        for (shape, limits) in [("", [1e-4, 1e-4]), ("shape = \"triangle\",", [2e-3, 5e-3])] {
            let [mean, scatter] = rings(2, shape, 1e-3, sides);
            assert!(
                mean < limits[0] && scatter < limits[1],
                "{mean:e} {scatter:e}"
            );
        }
    }
}

/// The sum of the normal forces on a pin in a hole whose inside moves by 0.02.
fn pin_in_a_hole<const D: usize>(parts: [Mesh<D>; 2], sides: [&str; 2]) -> f64
where
    ElementKind: Space<D>,
{
    let [pin, hole] = parts;
    let model = Model::on(join(pin, hole))
        .material(Material::new(1000.0, 0.3))
        .support(Support::on(["hole-right"]).fixed())
        .support(Support::on(["pin-left"]).fixed().x(0.02))
        .contact(Pair::new([sides[0]], [sides[1]]));
    let found = answer(model, 1e-9, Stiffness::Cholesky);
    found.solution.lambda[..found.m()].iter().sum()
}

/// Half a pin in the round end of a slot, and in a hole with its taper: neither side is an arc as a whole. Whichever facets meet,
/// and whichever side is named first, forces are those of fine meshes.
#[test]
fn smooth_sides_need_not_be_arcs() {
    let ring = |name: &str, [from, to]: [f64; 2], cells: usize, straight: f64| {
        let prefix = format!("{name}-");
        let mut mesh = rectangle(
            [0.0; 2],
            [1.0; 2],
            [6, cells],
            CellShape::Quad,
            name,
            &prefix,
        );
        for x in &mut mesh.nodes {
            let (r, along) = (from + (to - from) * x[0], (1.0 + straight) * (x[1] - 0.5));
            let angle = along.clamp(-0.5, 0.5);
            let (sin, cos) = (PI * angle).sin_cos();
            *x = [r * cos - PI * (along - angle).abs(), r * sin];
        }
        mesh
    };
    let slot = |cells: [usize; 2], sides| {
        let parts = [
            ring("pin", [0.4, 0.99], cells[0], 0.0),
            ring("hole", [1.0, 2.0], cells[1], 1.0),
        ];
        pin_in_a_hole(parts, sides)
    };
    let cone = |shape, cells: [usize; 2], taper: f64, sides| {
        let part = |name: &str, [from, to]: [f64; 2], cells| {
            let (size, cells, prefix) = ([1.0, 1.0, 0.6], [3, cells, 3], format!("{name}-"));
            let mut mesh = block([0.0; 3], size, cells, shape, name, &prefix);
            for x in &mut mesh.nodes {
                let r = (from + (to - from) * x[0]) * (1.0 + taper * x[2]);
                let (sin, cos) = (PI * (x[1] - 0.5)).sin_cos();
                *x = [r * cos, r * sin, x[2]];
            }
            mesh
        };
        let parts = [
            part("pin", [0.4, 0.99], cells[0]),
            part("hole", [1.0, 2.0], cells[1]),
        ];
        pin_in_a_hole(parts, sides)
    };
    let sides = ["pin-right", "hole-left"];
    let fine = slot([96, 160], sides);
    for sides in [sides, ["hole-left", "pin-right"]] {
        for cells in [[20, 48], [14, 64]] {
            let force = slot(cells, sides);
            println!("slot, {cells:?}, {}: {force:.3} for {fine:.3}", sides[0]);
            assert!((force / fine - 1.0).abs() < 0.02, "{force} for {fine}");
        }
        for shape in [SolidShape::Hexahedron, SolidShape::Tetrahedron] {
            // Cylinders are arcs. The taper makes the gap, too, 1 % larger at one end.
            let expected = cone(shape, [16, 12], 0.0, sides);
            for cells in [[16, 12], [12, 15]] {
                let force = cone(shape, cells, 0.02, sides);
                println!("cone, {shape:?}, {cells:?}: {force:.3} for {expected:.3}");
                assert!(
                    (force / expected - 1.0).abs() < 0.02,
                    "{force} for {expected}"
                );
            }
        }
    }
}

/// The lower half of a disc of 24 facets, of which a node is lowest, over a plate: a state is the same wherever the disc was drawn, and
/// nothing is pressed that does not touch.
#[test]
fn a_curved_side_presses_nothing_before_it_touches() {
    let pressed = |drawn: f64, apart: f64, sides: [&str; 2]| -> f64 {
        let mut disc = rectangle(
            [0.0; 2],
            [1.0; 2],
            [4, 24],
            CellShape::Quad,
            "disc",
            "disc-",
        );
        for x in &mut disc.nodes {
            let (r, angle) = (4.0 + 6.0 * x[0], PI * (x[1] - 1.0));
            *x = [r * angle.cos(), r * angle.sin() + 10.0 + drawn];
        }
        let cells = [60, 8];
        let plate = rectangle(
            [-6.0, -4.0],
            [12.0, 4.0],
            cells,
            CellShape::Quad,
            "plate",
            "plate-",
        );
        let model = Model::on(join(disc, plate))
            .material(Material::new(1000.0, 0.3))
            .support(Support::on(["plate-bottom"]).fixed())
            .support(Support::on(["disc-left"]).fixed().y(apart - drawn))
            .contact(Pair::new([sides[0]], [sides[1]]));
        let found = answer(model, 1e-9, Stiffness::Cholesky);
        found.solution.lambda[..found.m()].iter().sum()
    };
    for sides in [["disc-right", "plate-top"], ["plate-top", "disc-right"]] {
        let touching = pressed(0.0, -0.05, sides);
        for drawn in [0.02, 0.1] {
            assert_eq!(pressed(drawn, 0.001, sides), 0.0, "{sides:?}");
            let force = pressed(drawn, -0.05, sides);
            println!("{}: {force} for {touching}", sides[0]);
            assert!(
                (force / touching - 1.0).abs() < 0.01,
                "{force} for {touching}"
            );
        }
    }
}

/// Teeth of two gears between each other: what a flank sees of the other gear through its own tooth, and through the next, is no
/// overlap, however far is searched.
#[test]
fn what_is_beyond_a_tooth_is_no_overlap() {
    let case = case(
        r#"
        [mesh]
        file = "../examples/gears.msh"
        scale = 1e-3
        [[material]]
        young = 1
        poisson = 0.3
        [[support]]
        boundary = ["driver-hub", "driven-hub"]
        x = 0
        y = 0
        [[contact]]
        boundary = "driver-teeth"
        against = "driven-teeth"
        "#,
    );
    let gaps = built(&case).elastic.contact.places;
    let least = gaps
        .iter()
        .map(|place| place.gap)
        .fold(f64::INFINITY, f64::min);
    // Half the backlash, along the normal.
    assert!((least / 37.6e-6 - 1.0).abs() < 0.05, "{least}");
}
