//! Published problems with known answers: docs/validation.md has the table that these tests print.
//!
//! `cargo test --release --test suite -- --nocapture validation::` shows the figures.

use crate::common::half_space::compare;
use crate::common::or_panic::OrPanic as _;
use crate::common::{
    Solved, case, distance, price_of_coulomb, published, solve_case, solve_case_twice,
};
use signorini::output::NodeStatus;
use std::f64::consts::PI;

/// Two blocks with meshes that do not match, pressed by 10 on top (Taylor and Papadopoulos 1991).
fn blocks(lower: &str, upper: &str, contact: &str) -> String {
    format!(
        "[[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [2, 1], {lower} }}\n\
         [[mesh.part]]\nname = \"up\"\nrectangle = {{ size = [2, 1], {upper} }}\nshift = [0, 1]\n\
         [[material]]\nyoung = 3000\npoisson = 0.4\n\
         [[support]]\nboundary = \"low-bottom\"\ny = 0\n[[support]]\nboundary = \"low-left\"\nx = 0\n\
         [[support]]\nboundary = \"up-left\"\nx = 0\n[[traction]]\nboundary = \"up-top\"\npressure = 10\n\
         [[contact]]\n{contact}\n"
    )
}

#[test]
fn taylor_patch_test() {
    let meshes = [
        ("cells = [7, 4]", "cells = [5, 3]"),
        ("cells = [3, 2]", "cells = [16, 5]"),
        (
            "cells = [6, 3], shape = \"triangle\"",
            "cells = [11, 4], shape = \"triangle\"",
        ),
        // Crooked meshes: nodes of the interface at uneven distances.
        (
            "cells = [7, 4], map = [\"x + 0.05*sin(PI*x)*sin(5*x)\", \"y + 0.04*sin(3*x)*sin(PI*y)\"]",
            "cells = [9, 3], map = [\"x - 0.04*sin(PI*x/2)*cos(7*y)\", \"y - 0.03*sin(2*x)*sin(PI*y)\"]",
        ),
    ];
    for (order, (lower, upper)) in [1, 2].iter().flat_map(|n| meshes.map(|sides| (n, sides))) {
        for contact in [
            "boundary = \"up-bottom\"\nagainst = \"low-top\"",
            "boundary = \"low-top\"\nagainst = \"up-bottom\"",
            "boundary = \"low-top\"\nagainst = \"up-bottom\"\nfriction = { coulomb = 0.3 }",
        ] {
            let text = format!("[mesh]\norder = {order}\n{}", blocks(lower, upper, contact));
            let solved = solve_case_twice(&text, 1e-12);
            let worst = solved
                .fields()
                .pressure
                .iter()
                .fold(0.0, |worst: f64, p| worst.max((p / 10.0 - 1.0).abs()));
            println!("patch test, order {order}: {lower} on {upper}: {worst:.1e}");
            assert!(worst < 1e-9, "{lower}, {upper}, {contact}: {worst:e}");
            // σyy = −10, σxx = 0 in plane strain: linear displacements.
            let (e, nu) = (3000.0, 0.4);
            for (u, x) in solved
                .displacement()
                .iter()
                .zip(&solved.elastic().mesh.nodes)
            {
                assert!((u[1] + 10.0 * (1.0 - nu * nu) / e * x[1]).abs() < 1e-11);
                assert!((u[0] - 10.0 * nu * (1.0 + nu) / e * x[0]).abs() < 1e-11);
            }
        }
    }
}

/// The interface may be at any angle.
#[test]
fn patch_test_on_an_inclined_interface() {
    // A square cut along y = 0.4 + 0.3 x.
    let text = "[mesh]\norder = 1\n[[mesh.part]]\nname = \"low\"\nrectangle = { size = [1, 1], cells = [5, 4], map = [\"x\", \"y*(0.4 + 0.3*x)\"] }\n\
        [[mesh.part]]\nname = \"up\"\nrectangle = { size = [1, 1], cells = [8, 3], map = [\"x\", \"(0.4 + 0.3*x)*(1 - y) + y\"] }\n\
        [[material]]\nyoung = 1000\npoisson = 0\n\
        [[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n[[support]]\nboundary = \"up-top\"\nx = 0\n\
        [[traction]]\nboundary = \"up-top\"\npressure = 0.1\n\
        [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\nfriction = { coulomb = 5 }\n";
    for order in ["order = 1", "order = 2"] {
        inclined(&text.replace("order = 1", order));
    }
}

fn inclined(text: &str) {
    let solved = solve_case_twice(text, 1e-12);
    // With friction enough it is one square under σyy = −0.1: p = 0.1 cos²φ, tan φ = 0.3.
    let expected = 0.1 / 1.09;
    let fields = solved.fields();
    for i in 0..fields.pressure.len() {
        assert!((fields.pressure[i] / expected - 1.0).abs() < 1e-8);
        assert!((fields.traction[i].abs() / (0.3 * expected) - 1.0).abs() < 1e-8);
        assert_eq!(fields.status[i], NodeStatus::Stick);
    }
}

/// A block that hangs over: the covered part of an edge carries the load on it, and forces balance.
#[test]
fn partly_covered_edges_transfer_all_force() {
    for order in [1, 2] {
        overhang(order);
    }
}

fn overhang(order: usize) {
    let text = |contact: &str| {
        format!(
            "[mesh]\norder = {order}\n\
             [[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [2, 1], cells = [7, 4] }}\n\
             [[mesh.part]]\nname = \"up\"\nrectangle = {{ size = [1.1, 1], cells = [5, 3] }}\nshift = [0.37, 1]\n\
             [[material]]\nyoung = 3000\npoisson = 0.3\n[[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"up-left\"\nx = 0\n[[traction]]\nboundary = \"up-top\"\npressure = \"10*x\"\n\
             [[contact]]\n{contact}\n"
        )
    };
    let load = 10.0 * (1.47f64.powi(2) - 0.37f64.powi(2)) / 2.0;
    let mut heights = Vec::new();
    for contact in [
        "boundary = \"up-bottom\"\nagainst = \"low-top\"",
        "boundary = \"low-top\"\nagainst = \"up-bottom\"",
    ] {
        let solved = solve_case_twice(&text(contact), 1e-11);
        let normal: f64 = solved.solution().lambda[..solved.build.problem.m()]
            .iter()
            .sum();
        assert!((normal / load - 1.0).abs() < 1e-8, "{normal} {load}");
        let node = solved.node_at([0.37, 2.0]);
        heights.push(solved.displacement()[node][1]);
    }
    assert!((heights[0] / heights[1] - 1.0).abs() < 0.1, "{heights:?}");
}

/// Two blocks pushed sideways: μ = 0.01 slips, μ = 1 sticks, μ = 0 is the frictionless solution.
#[test]
fn blocks_pushed_sideways() {
    let text = |friction: &str| {
        format!(
            "[[mesh.part]]\nname = \"low\"\nrectangle = {{ size = [2, 1], cells = [9, 4] }}\n\
             [[mesh.part]]\nname = \"up\"\nrectangle = {{ size = [2, 1], cells = [7, 3] }}\nshift = [0, 1]\n\
             [[material]]\nyoung = 3000\npoisson = 0.4\n[[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\n\
             [[support]]\nboundary = \"up-top\"\nx = 0.004\ny = -0.006\n\
             [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\nfriction = {friction}\n"
        )
    };
    let states = |solved: &Solved| {
        let fields = solved.fields();
        let all: Vec<NodeStatus> = (0..fields.pressure.len())
            .map(|i| fields.status[i])
            .collect();
        all
    };
    let slip = solve_case_twice(&text("{ coulomb = 0.01 }"), 1e-10);
    assert!(states(&slip).iter().all(|&s| s == NodeStatus::Slip));
    for (i, node) in slip.fields().traction.iter().enumerate() {
        let bound = 0.01 * slip.fields().pressure[i];
        assert!((node.abs() - bound).abs() < 1e-5 * bound);
    }
    let stick = solve_case_twice(&text("{ coulomb = 1 }"), 1e-10);
    assert!(states(&stick).iter().all(|&s| s == NodeStatus::Stick));
    let zero = solve_case_twice(&text("{ coulomb = 0 }"), 1e-10);
    let none = solve_case_twice(&text("\"none\""), 1e-10);
    assert_eq!(zero.solution().u, none.solution().u);
    assert!(distance(&slip.solution().u, &none.solution().u) < 0.05);
}

/// Coulomb friction takes at most 1.3 times the products that the slip bounds it ends with would take if they were
/// given.
fn at_the_price_of_tresca(text: &str) {
    let [coulomb, tresca] = price_of_coulomb(&case(text), 1e-6);
    assert!(10 * coulomb <= 13 * tresca, "{coulomb}, {tresca}");
}

/// The GRECO plate (SSNV128). The reference is an independent 128 × 128 computation.
#[test]
fn greco_plate() {
    let solved = solve_case(&published::greco(128), 1e-8);
    let u = solved.displacement();
    for (x, expected) in [
        (0.0, 2.860),
        (0.00125, 2.723),
        (0.005, 2.287),
        (0.0075, 1.981),
        (0.01125, 1.541),
    ] {
        let ux = u[solved.node_at([x, 0.0])][0] * 1e5;
        compare(&format!("GRECO, 1e5 u_x at x = {x}"), ux, expected, 0.005);
    }
    // Separation up to x ≈ 0.0031, slip to 0.03, stick beyond.
    let fields = solved.fields();
    let last = |status: NodeStatus| {
        (0..fields.pressure.len())
            .filter(|&i| fields.status[i] == status)
            .map(|i| solved.place(i)[0])
            .fold(0.0, f64::max)
    };
    assert!((last(NodeStatus::Separated) - 0.0031).abs() < 0.0005);
    let slip = last(NodeStatus::Slip);
    assert!((slip - 0.03).abs() < 0.001, "{slip}");
    let solution = solved.solution();
    println!("GRECO: {} products", solution.n_a());
    assert!(solution.rounds.len() == 1 && solution.n_a() <= 60);
    at_the_price_of_tresca(&published::greco(128));
}

/// r and k of the half ellipse y = k √(r² − x²) through points (x, y): y² over x² is a line.
fn half_ellipse(points: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    let points: Vec<(f64, f64)> = points.map(|(x, y)| (x * x, y * y)).collect();
    let n = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / n;
    let (mx, my) = (mean(&|p| p.0), mean(&|p| p.1));
    let slope = mean(&|p| (p.0 - mx) * (p.1 - my)) / mean(&|p| (p.0 - mx).powi(2));
    (((my - slope * mx) / -slope).sqrt(), (-slope).sqrt())
}

/// The half-width a and the peak p₀ of Hertz's pressure p₀ √(1 − x²/a²).
fn hertz_fit(solved: &Solved) -> (f64, f64) {
    let fields = solved.fields();
    let top = fields.pressure.iter().copied().fold(0.0, f64::max);
    let (a, k) = half_ellipse(
        (0..fields.pressure.len())
            .filter(|&i| fields.pressure[i] > 0.2 * top)
            .map(|i| (solved.place(i)[0], fields.pressure[i])),
    );
    (a, k * a)
}

fn hertz(r: f64, cells: usize, grade: f64, young: [f64; 2], force: f64, sides: &str) -> Solved {
    let text = published::hertz(r, cells, grade, young, force, sides);
    solve_case(&text, 1e-8)
}

/// The multipliers on the plate, whose normal is that of Hertz's theory, or on the disc, whose normals turn
/// with the boundary: then points that move along it change their height, which Hertz neglects (x u_x / R).
const ON_THE_PLATE: &str = "boundary = \"plate-top\"\nagainst = \"disc-bottom\"";
const ON_THE_DISC: &str = "boundary = \"disc-bottom\"\nagainst = \"plate-top\"";

#[test]
fn hertz_nafems_1() {
    for (name, sides, cells, order) in [
        ("plate", ON_THE_PLATE, 80, 1),
        ("disc", ON_THE_DISC, 80, 1),
        ("plate, order 2", ON_THE_PLATE, 40, 2),
        ("disc, order 2", ON_THE_DISC, 40, 2),
    ] {
        let text = published::hertz(50.0, cells, 0.2, [70000.0, 210000.0], 35000.0, sides);
        let solved = solve_case(&format!("[mesh]\norder = {order}\n{text}"), 1e-8);
        println!(
            "{} products, {} places",
            solved.solution().n_a(),
            solved.build.problem.m()
        );
        let (a, p0) = hertz_fit(&solved);
        compare(
            &format!("Hertz NAFEMS-1, λ on the {name}, a"),
            a,
            6.2146,
            0.015,
        );
        compare(
            &format!("Hertz NAFEMS-1, λ on the {name}, p₀"),
            p0,
            3585.36,
            0.015,
        );
    }
}

#[test]
fn hertz_cylinder_on_a_stiff_plate() {
    for (name, sides) in [("plate", ON_THE_PLATE), ("disc", ON_THE_DISC)] {
        let solved = hertz(8.0, 120, 0.08, [200.0, 2e12], 3.2032, sides);
        let (a, p0) = hertz_fit(&solved);
        compare(
            &format!("Hertz, stiff plate, λ on the {name}, a"),
            a,
            0.38530,
            0.015,
        );
        compare(
            &format!("Hertz, stiff plate, λ on the {name}, p₀"),
            p0,
            5.2926,
            0.015,
        );
    }
}

/// Errors of (a, p₀) of NAFEMS-1 for meshes of this many cells a side.
fn hertz_errors(cells: usize, sides: &str) -> (f64, f64) {
    let solved = hertz(50.0, cells, 0.2, [70000.0, 210000.0], 35000.0, sides);
    let (a, p0) = hertz_fit(&solved);
    (a / 6.2146 - 1.0, p0 / 3585.36 - 1.0)
}

/// From an eighth to the full resolution the error falls to the deviation from linear theory at p₀/E = 5 %.
#[test]
fn hertz_converges_with_h() {
    for sides in [ON_THE_PLATE, ON_THE_DISC] {
        let (coarse, fine) = (hertz_errors(20, sides), hertz_errors(160, sides));
        assert!(fine.0.abs() < 0.35 * coarse.0.abs(), "{coarse:?} {fine:?}");
        assert!(fine.0.abs() < 0.006 && fine.1.abs() < 0.005, "{fine:?}");
    }
}

#[cfg(feature = "plots")]
#[test]
#[ignore = "writes docs/*.svg"]
fn figures() {
    use signorini::output::plots::chart::{Axis, Chart, Mark, Series, colour};
    let mut series = Vec::new();
    for (name, sides, colours) in [
        (
            "λ on the plate",
            ON_THE_PLATE,
            [colour::BLUE, colour::GREEN],
        ),
        (
            "λ on the disc",
            ON_THE_DISC,
            [colour::ORANGE, colour::PURPLE],
        ),
    ] {
        let errors: Vec<(f64, (f64, f64))> = [20, 28, 40, 57, 80, 113, 160, 226]
            .iter()
            .map(|&cells| {
                (
                    50.0 * 0.2 / f64::from(cells) / 6.2146,
                    hertz_errors(cells as usize, sides),
                )
            })
            .collect();
        for (what, colour, pick) in [
            (
                "a",
                colours[0],
                (|e: &(f64, f64)| e.0) as fn(&(f64, f64)) -> f64,
            ),
            ("p₀", colours[1], |e: &(f64, f64)| e.1),
        ] {
            series.push(Series {
                name: format!("{what}, {name}"),
                colour,
                mark: Mark::LineAndDots,
                points: errors.iter().map(|(h, e)| (*h, 100.0 * pick(e))).collect(),
            });
        }
    }
    let chart = Chart {
        title: "Hertz, NAFEMS-1: deviation from the formula in %".to_owned(),
        x: Axis::logarithmic("finest element / half-width a", ""),
        y: Axis::new("deviation", "%"),
        series,
        zones: Vec::new(),
        rules: Vec::new(),
    };
    std::fs::create_dir_all("docs").or_panic();
    std::fs::write("docs/hertz-convergence.svg", chart.svg()).or_panic();

    let at = |cells: usize, x: f64| {
        let solved = solve_case(&published::greco(cells), 1e-9);
        solved.displacement()[solved.node_at([x, 0.0])][0]
    };
    let mut series = Vec::new();
    for (x, colour) in [(0.0, colour::BLUE), (0.01, colour::ORANGE)] {
        let finest = at(384, x);
        series.push(Series {
            name: format!("u_x at x = {x}"),
            colour,
            mark: Mark::LineAndDots,
            points: [8, 16, 32, 64, 128]
                .iter()
                .map(|&cells| (0.04 / cells as f64, (at(cells, x) / finest - 1.0).abs()))
                .collect(),
        });
    }
    let chart = Chart {
        title: "GRECO plate, Coulomb: deviation from 384 × 384 elements".to_owned(),
        x: Axis::logarithmic("h", "m"),
        y: Axis::logarithmic("relative deviation", ""),
        series,
        zones: Vec::new(),
        rules: Vec::new(),
    };
    std::fs::write("docs/greco-convergence.svg", chart.svg()).or_panic();
}

/// F/G = (tan α + μ)/(1 − μ tan α): a wedge pushed up a slope (NAFEMS CGS-4).
#[test]
fn wedge() {
    for (mu, expected) in [
        (0.0, 0.1),
        (0.1, 0.202020),
        (0.2, 0.306122),
        (0.3, 0.412371),
    ] {
        let text = format!(
            "[mesh]\nrectangle = {{ size = [4, 1], cells = [16, 6], map = [\"x\", \"0.1*x*(1 - y) + 1.2*y\"] }}\n\
             [[material]]\nyoung = 1e6\npoisson = 0.3\n[[support]]\nboundary = \"top\"\nx = 0.01\n\
             [[traction]]\nboundary = \"top\"\npressure = 250\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = {mu} }}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [-0.1, 1] }} }}\n"
        );
        let solved = solve_case_twice(&text, 1e-8);
        at_the_price_of_tresca(&text);
        let m = solved.build.problem.m();
        let (normal, tangential) = solved.solution().lambda.split_at(m);
        let push: f64 = (solved.elastic().contact.places.iter().enumerate())
            .map(|(i, node)| normal[i] * node.frame[0][0] + tangential[i] * node.frame[1][0])
            .sum();
        compare(
            &format!("wedge, μ = {mu}, F/G"),
            push / 1000.0,
            expected,
            0.001,
        );
    }
}

/// A bar pulled with P against a bound g per length: slip length P/g, end displacement P²/(2EAg).
#[test]
fn bar_pull_out() {
    let (e, h, g, p) = (1e6, 0.02, 10.0, 40.0);
    let text = format!(
        "[mesh]\nrectangle = {{ size = [6, {h}], cells = [1200, 4] }}\n[analysis]\nplane = \"plane_stress\"\n\
         [[material]]\nyoung = {e}\npoisson = 0\n[[support]]\nboundary = \"left\"\nx = 0\n\
         [[support]]\nboundary = \"top\"\ny = 0\n[[traction]]\nboundary = \"right\"\nx = {}\n\
         [[contact]]\nboundary = \"bottom\"\nfriction = {{ tresca = {g} }}\n\
         obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n",
        p / h
    );
    let solved = solve_case_twice(&text, 1e-8);
    let fields = solved.fields();
    let first = (0..fields.slip.len())
        .filter(|&i| fields.status[i] == NodeStatus::Slip)
        .map(|i| solved.place(i)[0])
        .fold(f64::INFINITY, f64::min);
    compare("bar, slip length", 6.0 - first, p / g, 0.02);
    let u = solved.displacement();
    let end = u[solved.node_at([6.0, 0.5 * h])][0];
    compare(
        "bar, end displacement",
        end,
        p * p / (2.0 * e * h * g),
        0.01,
    );
}

fn cattaneo(delta: f64, friction: &str, (cells, order): (usize, usize)) -> Solved {
    let text = published::cattaneo(delta, friction, cells);
    solve_case(&format!("[mesh]\norder = {order}\n{text}"), 1e-7)
}

#[test]
fn cattaneo_mindlin() {
    let (mu, b, c, radius, p) = (0.2, 0.680778, 0.496511, 8.0, 0.625);
    let force = 2.0 * radius * p;
    let normal = |solved: &Solved| -> f64 {
        solved.solution().lambda[..solved.build.problem.m()]
            .iter()
            .sum()
    };
    let scale = mu * 4.0 * radius * p / (PI * b * b);
    let traction = |x: f64| {
        let root = |r: f64| (r * r - x * x).max(0.0).sqrt();
        scale * (root(b) - root(c))
    };
    let hertz = format!("{{ tresca = \"{scale}*sqrt(max(0, {}-x^2))\" }}", b * b);
    for (law, friction, mesh) in [
        ("Tresca", hertz.as_str(), (96, 1)),
        ("Coulomb", "{ coulomb = 0.2 }", (96, 1)),
        ("Coulomb, order 2", "{ coulomb = 0.2 }", (48, 2)),
    ] {
        // The approach that takes the force 2 R p, by the secant method.
        let (mut d0, mut d1) = (0.2, 0.22);
        let mut f0 = normal(&cattaneo(d0, friction, mesh));
        let mut solved = cattaneo(d1, friction, mesh);
        for _ in 0..2 {
            let f1 = normal(&solved);
            (d0, d1, f0) = (d1, d1 + (force - f1) * (d1 - d0) / (f1 - f0), f1);
            solved = cattaneo(d1, friction, mesh);
        }
        println!("{} products", solved.solution().n_a());
        if mesh.1 == 1 {
            at_the_price_of_tresca(&published::cattaneo(d1, friction, 96));
        }
        let fields = solved.fields();
        let at = |x: f64| {
            // The larger of the neighbours on both sides, interpolated.
            let mut points: Vec<(f64, f64)> = (0..fields.traction.len())
                .map(|i| (solved.place(i)[0], fields.traction[i].abs()))
                .collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            let k = points.partition_point(|p| p.0 < x).max(1);
            let (l, r) = (points[k - 1], points[k]);
            l.1 + (x - l.0) / (r.0 - l.0) * (r.1 - l.1)
        };
        compare(
            &format!("Cattaneo, {law}, P"),
            normal(&solved),
            force,
            0.005,
        );
        let top = fields.pressure.iter().copied().fold(0.0, f64::max);
        compare(&format!("Cattaneo, {law}, p₀"), top, 9.35135, 0.015);
        compare(&format!("Cattaneo, {law}, p_t(0)"), at(0.0), 0.506229, 0.02);
        // In the stick zone the rest of the bound is half an ellipse of width c.
        let (edge, _) = half_ellipse(
            (0..fields.traction.len())
                .filter(|&i| solved.place(i)[0].abs() < 0.9 * c)
                .map(|i| {
                    (
                        solved.place(i)[0],
                        fields.bound[i] - fields.traction[i].abs(),
                    )
                }),
        );
        compare(&format!("Cattaneo, {law}, c"), edge, c, 0.02);
        let worst = (0..fields.traction.len())
            .filter(|&i| (solved.place(i)[0].abs() - c).abs() > 0.05 * b)
            .map(|i| (fields.traction[i].abs() - traction(solved.place(i)[0])).abs())
            .fold(0.0, f64::max);
        println!("Cattaneo, {law}: off by at most {worst:.4} away from c");
    }
}
