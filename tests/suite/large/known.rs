//! Closed forms and figures of other programs.

use super::{End, far, neo_hooke, solved, solved_in_space, strain, works};
use signorini::contact::Obstacle;
use signorini::elasticity::Material;
use signorini::engine::Stiffness::Cholesky;
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::model::{Axis, BodyForce, Model, Motion, Pair, Support, Traction};
use signorini::ssnm::Status;

const LENGTH: f64 = 10.0;

/// The modulus of a beam of EI = 1.
fn young(thickness: f64) -> f64 {
    12.0 / thickness.powi(3)
}

/// A beam of elements of second order along x, its axis through the origin.
fn beam(thickness: f64, cells: usize) -> Mesh {
    let size = [LENGTH, thickness];
    let low = [0.0, -0.5 * thickness];
    let mesh = rectangle(low, size, [cells, 1], CellShape::Quad, "beam", "");
    mesh.raised().unwrap_or_else(|error| panic!("{error}"))
}

/// The node of a mesh at a place.
fn node_at<const D: usize>(mesh: &Mesh<D>, place: [f64; D]) -> usize
where
    ElementKind: Topology<D>,
{
    let is_there = |x: &[f64; D]| (0..D).all(|c| (x[c] - place[c]).abs() < 1e-9);
    mesh.nodes.iter().position(is_there).expect("a node")
}

fn assert_quick<const D: usize>(ends: &[End<D>], most: f64) {
    for end in ends {
        assert_eq!(end.status, Status::Converged);
    }
    let all: usize = ends.iter().map(|end| end.iterations).sum();
    let mean = all as f64 / ends.len() as f64;
    assert!(mean <= most, "{mean} iterations a load step");
}

/// A bar that rotates about one of its ends: its stretch λ with E λ (λ² − 1)/2 from ρ ω² x of all that is farther out, by steps
/// along the bar. By a rotation, and by a body force that is stated to be that of where the bar is.
#[test]
fn a_rotating_bar_is_stretched() {
    let square: f64 = 0.6;
    // The forces along the bar for the stretch at the axis, and the place of its end: by the classical Runge-Kutta method.
    let end_of = |first: f64| {
        let stretch = |force: f64| {
            let mut s: f64 = 1.2;
            for _ in 0..50 {
                s -= (0.5 * s * (s * s - 1.0) - force) / (0.5 * (3.0 * s * s - 1.0));
            }
            s
        };
        let (n, mut x, mut force) = (1000, 0.0, 0.5 * first * (first * first - 1.0));
        let h = 1.0 / f64::from(n);
        let slopes = |x: f64, force: f64| [stretch(force), -square * x];
        for _ in 0..n {
            let a = slopes(x, force);
            let b = slopes(x + 0.5 * h * a[0], force + 0.5 * h * a[1]);
            let c = slopes(x + 0.5 * h * b[0], force + 0.5 * h * b[1]);
            let d = slopes(x + h * c[0], force + h * c[1]);
            x += h / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0]);
            force += h / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1]);
        }
        (x, force)
    };
    let (mut low, mut high) = (1.0, 2.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        match end_of(middle).1 > 0.0 {
            true => high = middle,
            false => low = middle,
        }
    }
    let end = end_of(low).0;
    assert!(end > 1.15, "{end}");
    let mesh = rectangle(
        [0.0, -0.01],
        [1.0, 0.02],
        [16, 1],
        CellShape::Quad,
        "bar",
        "",
    );
    let mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
    let material = Material {
        density: 1.0,
        ..Material::new(1.0, 0.0)
    };
    let bar = Model::on(mesh.clone())
        .material(material)
        .support(Support::on("left").x(0.0))
        .support(Support::on(["top", "bottom"]).y(0.0))
        .contact(far("right", [1.0, 0.0]))
        .large_displacements();
    let stated = BodyForce::everywhere().x(move |x: [f64; 2]| square * x[0]);
    let rotating = bar.clone().rotation(Axis::at([0.0; 2]), square.sqrt());
    for model in [rotating, bar.body_force(stated.displaced())] {
        let ends = solved(model, 1e-10, Cholesky);
        assert_quick(&ends, 8.0);
        let u = ends[0].displacement[node_at(&mesh, [1.0, 0.01])];
        assert!((1.0 + u[0] - end).abs() < 1e-6, "{} {end}", 1.0 + u[0]);
    }
}

/// A bar that a pressure on its end pulls or presses: its stretches l and m follow from l S = p m, with S of St. Venant and Kirchhoff. The
/// turn of the pressure at the ends of a loaded side is not symmetric: the tangent lacks it, and a slender bar is sensitive to it.
#[test]
fn a_pressure_stretches_a_bar() {
    let (lambda, mu) = (0.3 / (1.3 * 0.4), 0.5 / 1.3);
    for pressure in [-0.2, -0.1, 0.1] {
        let state = |l: f64| {
            let along = 0.5 * (l * l - 1.0);
            let across = -lambda * along / (lambda + 2.0 * mu);
            let stress = (lambda + 2.0 * mu) * along + lambda * across;
            (l * stress + pressure * (1.0 + 2.0 * across).sqrt(), across)
        };
        let (mut low, mut high) = (0.8, 1.5);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            *(if state(middle).0 > 0.0 {
                &mut high
            } else {
                &mut low
            }) = middle;
        }
        let wide = (1.0 + 2.0 * state(low).1).sqrt();
        let mesh = rectangle([0.0; 2], [2.0, 1.0], [8, 4], CellShape::Quad, "bar", "");
        let model = Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(1.0, 0.3))
            .support(Support::on("left").x(0.0))
            .support(Support::at_point([0.0; 2]).y(0.0))
            .traction(Traction::on("right").pressure(pressure))
            .contact(far("bottom", [0.0, -1.0]));
        let end = solved(model, 1e-9, Cholesky).remove(0);
        assert_eq!(
            (end.status, end.parts),
            (Status::Converged, 1),
            "{pressure}"
        );
        assert!(end.iterations <= 20, "{pressure}: {}", end.iterations);
        for (x, u) in mesh.nodes.iter().zip(&end.displacement) {
            let known = [(low - 1.0) * x[0], (wide - 1.0) * x[1]];
            let off = (u[0] - known[0]).hypot(u[1] - known[1]);
            assert!(off < 1e-6, "{pressure}: {u:?}, not {known:?}");
        }
    }
}

/// The tip of a cantilever under a dead force: the elastica (Mattiasson, Numerical results from large deflection beam and frame
/// problems analysed by means of elliptic integrals, 1981).
#[test]
fn a_force_bends_a_cantilever() {
    let thickness = 0.2;
    let factors: [f64; 10] = std::array::from_fn(|i| (i + 1) as f64);
    let known = [(0, 0.05643, 0.30172), (9, 0.55500, 0.81061)];
    let force = 1.0 / (LENGTH * LENGTH * thickness);
    let check = |name: &str, tips: [[f64; 2]; 10]| {
        for (step, shorter, lower) in known {
            let tip = tips[step].map(|u| u / LENGTH);
            assert!(
                (tip[0] + shorter).abs() < 0.005 * shorter.max(lower),
                "{name}: {tip:?}"
            );
            assert!((tip[1] / lower - 1.0).abs() < 0.005, "{name}: {tip:?}");
        }
    };
    let mesh = beam(thickness, 16);
    let tip = node_at(&mesh, [LENGTH, 0.0]);
    let model = |factors: &[f64]| {
        Model::on(mesh.clone())
            .large_displacements()
            .material(Material::new(young(thickness), 0.0))
            .support(Support::on("left").fixed())
            .traction(Traction::on("right").y(force))
            .contact(far("bottom", [0.0, -1.0]))
            .steps(factors)
    };
    let ends = solved(model(&factors), 1e-7, Cholesky);
    assert_quick(&ends, 7.0);
    check("plane", std::array::from_fn(|i| ends[i].displacement[tip]));
    // The rule of work is of second order in the length of load steps.
    let off = |ends: &[End<2>]| {
        let [loads, supports, contacts] = works(ends);
        assert_eq!(contacts, 0.0);
        assert!(supports.abs() < 1e-12 * loads);
        loads / strain(ends.last().expect("a step")) - 1.0
    };
    let halves: [f64; 20] = std::array::from_fn(|i| 0.5 * (i + 1) as f64);
    let [coarse, fine] = [off(&ends), off(&solved(model(&halves), 1e-7, Cholesky))];
    assert!(
        coarse < 0.02 && coarse / fine > 3.6 && coarse / fine < 4.4,
        "{coarse} {fine}"
    );

    let size = [LENGTH, 0.4, thickness];
    let cells = [16, 1, 1];
    let low = [0.0, 0.0, -0.5 * thickness];
    let mesh = block(low, size, cells, SolidShape::Hexahedron, "beam", "");
    let mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
    let tip = node_at(&mesh, [LENGTH, 0.0, 0.0]);
    let below = Obstacle::HalfSpace {
        point: [0.0, 0.0, -20.0],
        normal: [0.0, 0.0, 1.0],
    };
    let model = Model::on(mesh)
        .large_displacements()
        .material(Material::new(young(thickness), 0.0))
        .support(Support::on("left").fixed())
        .traction(Traction::on("right").z(force))
        .contact(Pair::obstacle("bottom", below))
        .steps(factors);
    let ends = solved_in_space(model, 1e-7, Cholesky);
    assert_quick(&ends, 7.0);
    let tips = std::array::from_fn(|i| {
        let u: [f64; 3] = ends[i].displacement[tip];
        [u[0], u[2]]
    });
    check("space", tips);
}

/// A cantilever that a roller bends, far enough to turn its tip by 45°: figures of an independent program on the same mesh, and the
/// elastica on ever finer ones.
#[test]
fn a_roller_bends_a_cantilever() {
    let thickness = 0.1;
    let roller = Obstacle::Sphere {
        center: [7.0, 0.5 + 0.5 * thickness],
        radius: 0.5,
    };
    let with = |cells: usize, coulomb: f64, travel: f64, steps: usize| {
        let factors: Vec<f64> = (1..=steps).map(|i| i as f64 / steps as f64).collect();
        let model = Model::on(beam(thickness, cells))
            .large_displacements()
            .material(Material::new(young(thickness), 0.0))
            .support(Support::on("left").fixed())
            .contact(
                Pair::obstacle("top", roller)
                    .coulomb(coulomb)
                    .moving(Motion::shift([0.0, -travel])),
            )
            .steps(factors);
        solved(model, 1e-9, Cholesky)
    };
    let known = [
        (0.0, [-0.019971928, -0.017590282]),
        (0.3, [-0.013501992, -0.022215909]),
    ];
    for (coulomb, expected) in known {
        let ends = with(60, coulomb, 4.0, 8);
        assert_quick(&ends, 8.0);
        let force = ends[7].force();
        for c in 0..2 {
            assert!((force[c] - expected[c]).abs() < 1e-7, "{force:?}");
        }
    }
    let mut errors = Vec::new();
    for cells in [120, 240] {
        let ends = with(cells, 0.0, 4.0, 8);
        assert_quick(&ends, 8.0);
        errors.push((ends[7].force()[0] / -0.018625 - 1.0).abs());
    }
    assert!(errors[1] < 0.02 && errors[0] < 0.04, "{errors:?}");
    // By ten thicknesses at once: the roller never leaves the beam behind.
    let force = with(60, 0.0, 1.0, 1)[0].force();
    assert!((force[1] / (-3.0 / 343.0) - 1.0).abs() < 0.1, "{force:?}");
}

/// A thin ring between two plates, an upper right quarter of it, to 60 %: the elastica (in `../docs/validation.md`), which a ring of half
/// the thickness is nearer to.
#[test]
fn a_ring_is_pressed_together() {
    let errors = [0.04, 0.02].map(|thickness| {
        let plate = Obstacle::HalfSpace {
            point: [0.0, 1.0 + 0.5 * thickness],
            normal: [0.0, -1.0],
        };
        let factors: Vec<f64> = (1..=12).map(f64::from).collect();
        let model = Model::on(super::ring(60, thickness))
            .large_displacements()
            .material(Material::new(12.0 / thickness.powi(3), 0.0))
            .support(Support::on("left").x(0.0))
            .support(Support::on("right").y(0.0))
            .contact(Pair::obstacle("top", plate).moving(Motion::shift([0.0, -0.05])))
            .steps(factors);
        let ends = solved(model, 1e-8, Cholesky);
        assert_quick(&ends, 5.0);
        [(3, 1.05765), (7, 1.99381), (11, 4.48606)]
            .map(|(step, force)| (-ends[step].force()[1] / force - 1.0).abs())
    });
    for (thick, thin) in errors[0].into_iter().zip(errors[1]) {
        assert!(thick < 0.01 && thin < 0.004, "{errors:?}");
    }
}

/// Cook's membrane: figures of FElupe 11.3 with the same law and quadrilaterals of nine nodes, where nothing is projected; nearly
/// incompressible it has 6.852 on 32 × 32 of them, from below.
#[test]
fn cooks_membrane() {
    let mu = 80.1938;
    let solve = |poisson: f64, cells: usize| {
        let square = rectangle([0.0; 2], [1.0; 2], [cells; 2], CellShape::Quad, "body", "");
        let mut mesh = square.raised().unwrap_or_else(|error| panic!("{error}"));
        for x in &mut mesh.nodes {
            let [a, b] = *x;
            *x = [48.0 * a, (1.0 - b) * 44.0 * a + b * (44.0 + 16.0 * a)];
        }
        let corner = node_at(&mesh, [48.0, 60.0]);
        let model = Model::on(mesh)
            .large_displacements()
            .material(neo_hooke(2.0 * mu * (1.0 + poisson), poisson))
            .support(Support::on("left").fixed())
            .traction(Traction::on("right").y(6.25))
            .contact(far("bottom", [0.0, -1.0]));
        let ends = solved(model, 1e-9, Cholesky);
        assert_quick(&ends, 12.0);
        ends[0].displacement[corner]
    };
    let known = [
        (8, [-7.88757161, 8.65902251]),
        (16, [-7.94694224, 8.68392301]),
    ];
    for (cells, expected) in known {
        let u = solve(0.3, cells);
        for c in 0..2 {
            assert!((u[c] - expected[c]).abs() < 1e-6, "{u:?}");
        }
    }
    // Mixed elements of the literature come to 6.9.
    let tips = [8, 16, 32].map(|cells| solve(0.4999, cells)[1]);
    assert!(tips.is_sorted() && tips[0] > 0.995 * tips[2], "{tips:?}");
    assert!((tips[2] - 6.926).abs() < 1e-3, "{tips:?}");
}

/// A ball is pressed into rubber by half its radius: the forces of a coarse and of a finer mesh.
#[test]
fn a_ball_is_pressed_into_rubber() {
    let pressed = |cells: [usize; 3]| {
        let shape = SolidShape::Hexahedron;
        let mut mesh = block([0.0; 3], [1.0; 3], cells, shape, "rubber", "");
        for x in &mut mesh.nodes {
            // A quarter; cells are smaller below the ball.
            *x = [
                1.5 * x[0].powf(1.4),
                1.5 * x[1].powf(1.4),
                1.25 * (x[2] - 1.0),
            ];
        }
        let mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
        let ball = Obstacle::Sphere {
            center: [0.0, 0.0, 1.0],
            radius: 1.0,
        };
        let model = Model::on(mesh)
            .large_displacements()
            .material(neo_hooke(1.0, 0.499))
            .support(Support::on("bottom").fixed())
            .support(Support::on("left").x(0.0))
            .support(Support::on("front").y(0.0))
            .contact(Pair::obstacle("top", ball).moving(Motion::shift([0.0, 0.0, -0.5])))
            .steps([0.25, 0.5, 0.75, 1.0]);
        let ends = solved_in_space(model, 1e-8, Cholesky);
        assert_quick(&ends, 10.0);
        -ends[3].force()[2]
    };
    let [coarse, fine] = [[4, 4, 3], [6, 6, 5]].map(pressed);
    assert!((coarse / fine - 1.0).abs() < 0.005, "{coarse} {fine}");
}
