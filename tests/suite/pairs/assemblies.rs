//! Solids put together, for which there are closed forms: a press fit, a wedge, a block on an incline.

use crate::common::half_space::compare;
use crate::common::models::{Answer, answer, answer_by, on_the_cpu};
use crate::common::or_panic::OrPanic as _;
use crate::common::order::{Order, of_order};
use crate::common::space::{Vector, close, length};
use signorini::backend::Precision;
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::{Device, Stiffness};
use signorini::mesh::Mesh;
use signorini::mesh::structured::{SolidShape, block, join};
use signorini::model::{Model, Pair, Support, Traction};
use signorini::ssnm::Status;
use std::f64::consts::PI;

/// A block of one shape of cells with moved nodes.
fn moved(
    name: &str,
    size: Vector,
    cells: [usize; 3],
    (shape, order): (SolidShape, Order),
    to: impl Fn(Vector) -> Vector,
) -> Mesh<3> {
    let mesh = block([0.0; 3], size, cells, shape, name, &format!("{name}-"));
    let mut mesh = of_order(mesh, order);
    mesh.nodes.iter_mut().for_each(|x| *x = to(*x));
    mesh
}

/// The resultant of the contact forces on the first-named boundary.
fn resultant(answer: &Answer<3>) -> Vector {
    let mut sum = [0.0; 3];
    for i in 0..answer.m() {
        let force = answer.contact_force(i);
        (0..3).for_each(|c| sum[c] += force[c]);
    }
    sum
}

/// A hub on a hollow shaft, in m: radii of the bore, of the fit and of the outside, the length, and the overlap.
const BORE: f64 = 0.02;
const FIT: f64 = 0.05;
const OUTSIDE: f64 = 0.1;
const LENGTH: f64 = 0.02;
const OVERLAP: f64 = 1e-5;

const SHAFT: Material = Material::new(2e11, 0.3);
const HUB: Material = Material::new(1e11, 0.3);

/// The pressure of the fit, in plane stress (Lamé).
fn lame() -> f64 {
    let ratio = |low: f64, high: f64| (high * high + low * low) / (high * high - low * low);
    let hub = (ratio(FIT, OUTSIDE) + HUB.poisson) / HUB.young;
    let shaft = (ratio(BORE, FIT) - SHAFT.poisson) / SHAFT.young;
    OVERLAP / FIT / (hub + shaft)
}

/// A quarter of the fit with this many cells around each of them and a tenth as many or more along it; in the second step
/// the shaft is pushed along its axis, if there is friction to hold it.
fn press_fit(around: [usize; 2], order: Order, sides: [&str; 2], mu: f64) -> Model<3> {
    let ring = |name: &str, [from, to]: [f64; 2], cells: [usize; 3]| {
        moved(
            name,
            [1.0; 3],
            cells,
            (SolidShape::Hexahedron, order),
            |[x, y, z]| {
                let (sin, cos) = (0.5 * PI * y).sin_cos();
                let r = from + (to - from) * x;
                // Nothing on the planes of symmetry.
                let [sin, cos] = [sin, cos].map(|c| if c < 1e-12 { 0.0 } else { c });
                [r * cos, r * sin, LENGTH * z]
            },
        )
    };
    let [n, m] = around;
    let [along, across] = if order == Order::First {
        [3, 2]
    } else {
        [1, 1]
    };
    let shaft = ring("shaft", [BORE, FIT], [n / 4, n, along]);
    let hub = ring("hub", [FIT, OUTSIDE], [m / 3, m, across]);
    let push = if mu > 0.0 { -2e-4 } else { 0.0 };
    let mut pair = Pair::new(sides[0], sides[1]).interference(OVERLAP);
    if mu > 0.0 {
        pair = pair.coulomb(mu);
    }
    Model::on(join(shaft, hub))
        .material_in("shaft", SHAFT)
        .material_in("hub", HUB)
        .support(Support::on(["shaft-front", "hub-front"]).symmetry())
        .support(Support::on(["shaft-back", "hub-back"]).symmetry())
        .support(Support::on("hub-bottom").z(0.0))
        .support(Support::on("shaft-top").z(push).factors([0.0, 1.0]))
        .contact(pair)
        .steps([1.0, 1.0])
}

const FITS: [[&str; 2]; 2] = [["hub-left", "shaft-right"], ["shaft-right", "hub-left"]];

#[test]
fn press_fit_has_lames_pressure() {
    let of = |around, order, sides, [of_mean, of_nodes]: [f64; 2]| {
        let answer = answer(
            press_fit(around, order, sides, 0.0),
            1e-8,
            Stiffness::Cholesky,
        );
        let (mut force, mut area, mut scatter) = (0.0, 0.0, 0.0f64);
        for i in 0..answer.m() {
            force += answer.solution.lambda[i];
            area += answer.area(i);
            scatter = scatter.max((answer.pressure(i) / lame() - 1.0).abs());
        }
        let name = format!("press fit {order:?} {around:?}, λ on {}", sides[0]);
        println!(
            "{name}: {} places, {} products, single ones off by {scatter:.4}",
            answer.m(),
            answer.solution.n_a()
        );
        assert!(scatter < of_nodes);
        compare(
            &format!("{name}, area"),
            4.0 * area,
            2.0 * PI * FIT * LENGTH,
            0.005,
        );
        compare(&format!("{name}, pressure"), force / area, lame(), of_mean);
        // The growth of the hub outside: 2 p b² c/(E (c² − b²)).
        let nodes = &answer.built.elastic.mesh.nodes;
        let at = (nodes.iter().zip(answer.displacement()))
            .find(|(x, _)| length([x[0] - OUTSIDE, x[1], x[2]]) < 1e-9)
            .map(|(_, u)| u[0]);
        let growth =
            2.0 * lame() * FIT.powi(2) * OUTSIDE / (OUTSIDE.powi(2) - FIT.powi(2)) / HUB.young;
        compare(
            &format!("{name}, growth outside"),
            at.expect("a node"),
            growth,
            0.01,
        );
    };
    for sides in FITS {
        of([24, 18], Order::First, sides, [0.01, 0.04]);
        // As many nodes around, and a half of them.
        of([12, 9], Order::Lagrange, sides, [0.001, 0.02]);
        of([8, 6], Order::Lagrange, sides, [0.002, 0.02]);
        // Corners of faces with eight nodes have hardly an area, so that their pressures scatter more.
        of([12, 9], Order::Serendipity, sides, [0.005, 0.15]);
    }
}

/// μ p 2πb L, once all of it slips.
#[test]
fn press_fit_holds_up_to_the_friction_limit() {
    let mu = 0.1;
    let options = on_the_cpu(1e-6, Stiffness::Cholesky);
    let answer = answer_by(press_fit([24, 18], Order::First, FITS[0], mu), &options);
    let slipping = (0..answer.m()).filter(|&i| answer.solution.sets.slips(i));
    assert_eq!(slipping.count(), answer.m());
    let held = 4.0 * resultant(&answer)[2].abs();
    compare(
        "press fit, axial force",
        held,
        mu * lame() * 2.0 * PI * FIT * LENGTH,
        0.01,
    );
    println!(
        "{} and {} products",
        answer.before[0].n_a(),
        answer.solution.n_a()
    );
}

/// The same on all paths: the factor, PCG on the CPU, and on a GPU in both precisions.
#[test]
fn press_fit_on_all_paths() {
    for order in [Order::First, Order::Serendipity] {
        on_all_paths(order);
    }
}

fn on_all_paths(order: Order) {
    let solve = |place, stiffness, precision| {
        let mut options = on_the_cpu(1e-6, stiffness);
        options.engine.place = place;
        options.engine.gpu.precision = precision;
        answer_by(press_fit([8, 6], order, FITS[0], 0.1), &options)
    };
    let reference = solve(Device::Cpu, Stiffness::Cholesky, None);
    let held = resultant(&reference);
    for (place, precision) in [
        (Device::Cpu, None),
        (Device::Gpu, Some(Precision::F64)),
        (Device::Gpu, Some(Precision::F32)),
    ] {
        let other = solve(place, Stiffness::Pcg, precision);
        let off = crate::common::distance(&other.solution.u, &reference.solution.u);
        let force = resultant(&other);
        let apart = length([0, 1, 2].map(|c| force[c] - held[c])) / length(held);
        println!("{place:?} {precision:?}: u off by {off:.1e}, force by {apart:.1e}");
        assert!(off < 1e-4 && apart < 1e-4, "{off:e} {apart:e}");
        assert_eq!(other.solution.sets.differences(&reference.solution.sets), 0);
    }
}

/// F/G = (tan α + μ)/(1 − μ tan α): a wedge pushed up an elastic slope (NAFEMS CGS-4), and a steeper one on which a
/// fixed point of slip bounds would not settle.
#[test]
fn wedge_in_space() {
    let material = Material::new(1e6, 0.3);
    for (slope, mu) in [(0.1, 0.1), (0.1, 0.3), (0.115, 0.2), (0.115, 0.3)] {
        for (sides, shape, orders) in [
            (
                ["up-bottom", "low-top"],
                SolidShape::Hexahedron,
                [Order::First; 2],
            ),
            (
                ["low-top", "up-bottom"],
                SolidShape::Wedge,
                [Order::First; 2],
            ),
            (
                ["up-bottom", "low-top"],
                SolidShape::Tetrahedron,
                [Order::Serendipity, Order::Lagrange],
            ),
        ] {
            let low = moved(
                "low",
                [6.0, 1.0, 1.0],
                [9, 4, 2],
                (SolidShape::Hexahedron, orders[0]),
                |[x, y, z]| [x - 1.0, y, z * (1.0 + slope * x) - 1.0 - slope],
            );
            let up = moved(
                "up",
                [4.0, 1.0, 1.0],
                [8, 3, 3],
                (shape, orders[1]),
                |[x, y, z]| [x, y, slope * x * (1.0 - z) + 1.2 * z],
            );
            let model = Model::on(join(low, up))
                .material(material)
                .support(Support::on("low-bottom").fixed())
                .support(Support::on("up-top").x(0.01).y(0.0))
                .traction(Traction::on("up-top").pressure(250.0))
                .contact(Pair::new(sides[0], sides[1]).coulomb(mu));
            let answer = answer(model, 1e-8, Stiffness::Cholesky);
            let [push, _, lift] = resultant(&answer).map(f64::abs);
            let name = format!(
                "wedge in space {orders:?}, slope {slope}, μ = {mu}, λ on {}",
                sides[0]
            );
            compare(&format!("{name}, load"), lift, 1000.0, 1e-5);
            compare(
                &format!("{name}, F/G"),
                push / lift,
                (slope + mu) / (1.0 - mu * slope),
                5e-4,
            );
            println!(
                "{} steps, {} products",
                answer.solution.iter(),
                answer.solution.n_a()
            );
        }
    }
}

/// A block that only its weight and friction hold on an elastic incline, turned about its own axis: it stays up to tan
/// α = μ and slides beyond.
#[test]
fn a_block_slides_on_an_incline_from_the_angle_of_friction_on() {
    let material = Material {
        density: 1000.0,
        ..Material::new(1e7, 0.3)
    };
    for (mu, orders) in [
        (0.3f64, [Order::First; 2]),
        (0.7, [Order::First; 2]),
        (0.3, [Order::Serendipity, Order::Lagrange]),
    ] {
        for (part, status) in [(0.99, Status::Converged), (1.01, Status::NotHeld)] {
            let slope = (mu * part).atan();
            let low = moved(
                "low",
                [3.0, 2.0, 0.5],
                [9, 6, 2],
                (SolidShape::Hexahedron, orders[0]),
                |[x, y, z]| [x, y, z - 0.5],
            );
            let up = moved(
                "up",
                [1.0, 0.8, 0.4],
                [5, 4, 3],
                (SolidShape::Tetrahedron, orders[1]),
                |[x, y, z]| [1.0 + 0.8 * x - 0.6 * y, 0.6 + 0.6 * x + 0.8 * y, z],
            );
            let built = Model::on(join(low, up))
                .material(material)
                .gravity([9.81 * slope.sin(), 0.0, -9.81 * slope.cos()])
                .support(Support::on("low-bottom").fixed())
                .contact(Pair::new("up-bottom", "low-top").coulomb(mu))
                .build()
                .or_panic();
            let steps = built
                .solve(&on_the_cpu(1e-6, Stiffness::Cholesky))
                .or_panic();
            let step = steps.last().expect("a step");
            println!(
                "incline of {part} μ, μ = {mu}: {:?} after {} steps, {} products",
                step.status,
                step.iter(),
                step.n_a()
            );
            assert_eq!(step.status, status);
        }
    }
}

/// A free block in the corner of two rigid walls, on an elastic slab, pressed on all three: nodes along the edges belong to
/// two contacts, one to three.
#[test]
fn a_block_in_a_corner_on_a_slab() {
    let material = Material::new(1e9, 0.3);
    let wall = |normal| Obstacle::HalfSpace {
        point: [0.0; 3],
        normal,
    };
    for (number, shape) in [
        SolidShape::Hexahedron,
        SolidShape::Tetrahedron,
        SolidShape::Wedge,
    ]
    .into_iter()
    .enumerate()
    {
        for sides in [["low-top", "up-bottom"], ["up-bottom", "low-top"]] {
            for (mu, stiffness, order) in [
                (0.0, Stiffness::Cholesky, Order::First),
                (0.3, Stiffness::Pcg, Order::First),
                (0.3, Stiffness::Pcg, Order::Serendipity),
            ] {
                let low = moved(
                    "low",
                    [1.7, 1.6, 0.5],
                    [4 + number, 5, 2],
                    (shape, order),
                    |[x, y, z]| [x, y, z - 0.5],
                );
                let up = moved("up", [1.0; 3], [3, 3, 3], (shape, order), |x| x);
                // On all three sides by themselves, each with its own friction.
                let model = Model::on(join(low, up))
                    .material(material)
                    .support(Support::on("low-bottom").fixed())
                    .traction(Traction::on("up-top").pressure(1e6))
                    .traction(Traction::on("up-right").pressure(6e5))
                    .traction(Traction::on("up-back").pressure(5e5))
                    .contact(Pair::new(sides[0], sides[1]).coulomb(mu))
                    .contact(Pair::obstacle("up-left", wall([1.0, 0.0, 0.0])).coulomb(mu))
                    .contact(Pair::obstacle("up-front", wall([0.0, 1.0, 0.0])).coulomb(mu));
                let answer = answer(model, 1e-7, stiffness);
                let [load, contact, support] = answer.resultants();
                for c in 0..3 {
                    let rest: f64 = load[c] + contact[c] + support[c];
                    assert!(rest.abs() < 1e-5 * 1e6, "{load:?} {contact:?} {support:?}");
                }
                if mu == 0.0 {
                    close(contact, [6e5, 5e5, 0.0], 10.0);
                } else {
                    // Walls take the part that the slab's friction leaves them, and have friction along it.
                    assert!(contact[0] > 2.5e5 && contact[1] > 1.5e5, "{contact:?}");
                }
            }
        }
    }
}
