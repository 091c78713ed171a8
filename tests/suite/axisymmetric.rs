//! Bodies of revolution against closed forms: Lamé's cylinder, a rotating one, Hertz's sphere, shrink fits; and entries that
//! are invalid for them.

use crate::common::half_space::{compare, ellipsoid_fit};
use crate::common::published;
use crate::common::solved::{Solved, solve_case, solve_case_twice};
use signorini::case::Case;
use signorini::contact::ContactPlace;
use signorini::elasticity::{Stress, stresses, stresses_at};
use std::f64::consts::PI;
use std::path::Path;

const ROUND: &str = "[analysis]\nplane = \"axisymmetric\"\n";

/// Kinds of elements: the entries of `[mesh]` and of the rectangle.
const KINDS: [(&str, &str); 4] = [
    ("order = 1", ""),
    ("order = 1", "shape = \"triangle\","),
    ("order = 2", ""),
    ("order = 2", "shape = \"triangle\","),
];

fn at_nodes(solved: &Solved) -> Vec<Stress> {
    stresses(&solved.elastic().body(), &solved.displacement()).0
}

/// Stretched by a in all radii and by b along the axis, under the tractions of that at the border, elements with straight sides
/// have that stretch everywhere, including those on the axis.
#[test]
fn a_uniform_strain_is_met() {
    let [a, b] = [1e-3, -2e-3];
    let (young, nu) = (2.0, 0.3);
    let factor = young / ((1.0 + nu) * (1.0 - 2.0 * nu));
    let radial = factor * (a + nu * b);
    let axial = factor * ((1.0 - nu) * b + 2.0 * nu * a);
    // How the outward normal of the upper side is inclined.
    let [nx, ny] = [-0.4 / 1.16_f64.sqrt(), 1.0 / 1.16_f64.sqrt()];
    for inner in [0.0, 0.7] {
        for (order, shape) in KINDS {
            // The diagonals of trapezoids would be bent.
            let low = if shape.is_empty() { 0.0 } else { 0.4 };
            let [down_x, down_y] = if shape.is_empty() {
                [0.0, -1.0]
            } else {
                [-nx, -ny]
            };
            for incompressible in [false, true] {
                let text = format!(
                    "[mesh]\n{order}\nrectangle = {{ size = [1, 1], cells = [4, 3], {shape} \
                     map = [\"{inner} + x\", \"2*y + x*({low} + {}*y)\"] }}\n{ROUND}\
                     [[material]]\nyoung = {young}\npoisson = {nu}\nincompressible = {incompressible}\n\
                     [[support]]\npoint = [{inner}, 0]\ny = 0\n\
                     [[traction]]\nboundary = \"left\"\nx = {}\n\
                     [[traction]]\nboundary = \"right\"\nx = {radial}\n\
                     [[traction]]\nboundary = \"bottom\"\nx = {}\ny = {}\n\
                     [[traction]]\nboundary = \"top\"\nx = {}\ny = {}\n\
                     [[contact]]\nboundary = \"top\"\n\
                     obstacle = {{ half_plane = {{ point = [0, 9], normal = [0, -1] }} }}\n",
                    0.4 - low,
                    -radial,
                    radial * down_x,
                    axial * down_y,
                    radial * nx,
                    axial * ny,
                );
                let solved = solve_case(&text, 1e-10);
                let what = format!("{order} {shape} from {inner}");
                for (u, x) in (solved.displacement().iter()).zip(&solved.elastic().mesh.nodes) {
                    let off = (u[0] - a * x[0]).abs().max((u[1] - b * x[1]).abs());
                    assert!(off < 1e-13, "{what}: {u:?} at {x:?}");
                }
                for s in at_nodes(&solved) {
                    let off = [s.xx - radial, s.zz - radial, s.yy - axial, s.xy];
                    assert!(off.iter().all(|v| v.abs() < 1e-12), "{what}: {s:?}");
                }
            }
        }
    }
}

/// A cylinder from radius 1 to 2 and of this height, held at both ends and loaded as `loads` say.
fn cylinder((order, shape): (&str, &str), cells: usize, nu: f64, loads: &str) -> Solved {
    solve_case(
        &format!(
            "[mesh]\n{order}\nrectangle = {{ size = [1, 0.5], cells = [{cells}, {}], {shape} map = [\"1 + x\", \"y\"] }}\n\
             [analysis]\nplane = \"axisymmetric\"\n{loads}\n\
             [[support]]\nboundary = [\"bottom\", \"top\"]\ny = 0\n\
             [[contact]]\nboundary = \"left\"\n\
             obstacle = {{ half_plane = {{ point = [0.5, 0], normal = [1, 0] }} }}\n",
            cells / 2
        )
        .replace("NU", &nu.to_string()),
        1e-10,
    )
}

/// Lamé: u = (1 + ν)/E p a²/(b² − a²) ((1 − 2ν) r + b²/r), σ = p a²/(b² − a²) (1 ∓ b²/r²). Errors fall with the order of the
/// elements, also where the body is nearly incompressible.
#[test]
fn a_cylinder_under_pressure_is_lames() {
    let p = 3.0;
    for nu in [0.3, 0.4999] {
        // Triangles of first order lock.
        for (number, kind) in KINDS
            .into_iter()
            .enumerate()
            .filter(|k| k.0 != 1 || nu < 0.4)
        {
            let second = number > 1;
            let mut last = [f64::INFINITY; 2];
            for cells in [4, 8, 16] {
                let solved = cylinder(
                    kind,
                    cells,
                    nu,
                    &format!(
                        "[[material]]\nyoung = 1000\npoisson = NU\n\
                         [[traction]]\nboundary = \"left\"\npressure = {p}\n"
                    ),
                );
                let (mut off, mut of_stress) = (0.0_f64, 0.0_f64);
                let nodes = &solved.elastic().mesh.nodes;
                for ((u, x), s) in solved
                    .displacement()
                    .iter()
                    .zip(nodes)
                    .zip(at_nodes(&solved))
                {
                    let r = x[0];
                    let exact = (1.0 + nu) / 1000.0 * p / 3.0 * ((1.0 - 2.0 * nu) * r + 4.0 / r);
                    off = off.max((u[0] / exact - 1.0).abs());
                    let hoop = p / 3.0 * (1.0 + 4.0 / (r * r));
                    of_stress = of_stress.max((s.zz / hoop - 1.0).abs());
                }
                println!(
                    "Lamé, {kind:?}, ν = {nu}, {cells} cells: u {off:.1e}, hoop stress {of_stress:.1e}"
                );
                // By half of the size a fourth is left, of second order an eighth or less; of stresses at the border a half and a fourth.
                let [fall, of] = if second { [6.0, 3.0] } else { [3.5, 1.5] };
                assert!(off < last[0] / fall && of_stress < last[1] / of);
                last = [off, of_stress];
            }
            let [limit, of] = if second { [2e-5, 4e-3] } else { [2e-3, 0.06] };
            assert!(last[0] < limit && last[1] < of, "{last:?}");
        }
    }
}

/// Of a long one that rotates (Timoshenko and Goodier, § 32, for plane strain): between the radii a and b with
/// k = (3 − 2ν)/(8 (1 − ν)) ρω², σ_r = k (a² + b² − a²b²/r² − r²), and the hoop stress with (1 + 2ν)/(3 − 2ν) r².
#[test]
fn a_rotating_cylinder_is_stressed_as_it_should_be() {
    let (nu, density, speed) = (0.3, 7.0, 5.0);
    let solved = cylinder(
        KINDS[2],
        16,
        nu,
        &format!(
            "rotation = {{ speed = {speed} }}\n[[material]]\nyoung = 1000\npoisson = NU\ndensity = {density}\n"
        ),
    );
    let k = (3.0 - 2.0 * nu) / (8.0 * (1.0 - nu)) * density * speed * speed;
    let nodes = &solved.elastic().mesh.nodes;
    for (s, x) in at_nodes(&solved).iter().zip(nodes) {
        let square = x[0] * x[0];
        let hoop = k * (5.0 + 4.0 / square - (1.0 + 2.0 * nu) / (3.0 - 2.0 * nu) * square);
        let radial = k * (5.0 - 4.0 / square - square);
        assert!(
            (s.zz - hoop).abs() < 1e-2 * k && (s.xx - radial).abs() < 2e-2 * k,
            "{s:?} at {x:?}"
        );
    }
}

/// Free and warmer by θ, a body grows by α θ in all directions.
#[test]
fn warm_rings_expand_without_stress() {
    for (order, shape) in KINDS {
        let solved = solve_case(
            &format!(
                "[mesh]\n{order}\nrectangle = {{ size = [1, 1], cells = [3, 2], {shape} map = [\"x\", \"y + 0.2*x\"] }}\n{ROUND}\
                 [[material]]\nyoung = 3\npoisson = 0.3\nexpansion = 2e-4\n[[support]]\npoint = [0, 0]\ny = 0\n\
                 [[temperature]]\nvalue = 50\n\
                 [[contact]]\nboundary = \"top\"\n\
                 obstacle = {{ half_plane = {{ point = [0, 9], normal = [0, -1] }} }}\n"
            ),
            1e-10,
        );
        let u = solved.displacement();
        for (u, x) in u.iter().zip(&solved.elastic().mesh.nodes) {
            assert!((0..2).all(|c| (u[c] - 1e-2 * x[c]).abs() < 1e-14));
        }
        let field = |region, x| solved.data.temperature.at(region, x);
        let (nodes, _) = stresses_at(&solved.elastic().body(), &u, Some(&field));
        let sizes = nodes.iter().map(|s| s.von_mises().max(s.zz.abs()));
        assert!(sizes.fold(0.0, f64::max) < 1e-13);
    }
}

/// A ball on a plate, both elastic: pressures against Hertz's for the applied force.
#[test]
fn hertz_sphere() {
    let (r, a) = (50.0, 3.0);
    let young = [70000.0, 210000.0];
    let modulus = 1.0 / young.iter().map(|e| 0.91 / e).sum::<f64>();
    let force = 4.0 / 3.0 * modulus * a * a * a / r;
    let p0 = 1.5 * force / (PI * a * a);
    let on_the_plate = "boundary = \"plate-top\"\nagainst = \"disc-bottom\"";
    let on_the_ball = "boundary = \"disc-bottom\"\nagainst = \"plate-top\"";
    for (order, cells) in [("1", 80), ("2", 40)] {
        for (name, sides, limits) in [
            ("plate", on_the_plate, [0.02, 0.005]),
            ("ball", on_the_ball, [0.01, 0.002]),
        ] {
            // The pressure in its name is force/(2r).
            let text = published::hertz(r, cells, 0.2, young, 2.0 * force / (PI * r), sides)
                .replace(
                    "[[material]]\nregion = \"disc\"",
                    &format!("{ROUND}[[material]]\nregion = \"disc\""),
                );
            // The axis holds its nodes by itself.
            let text = text.replace("[[support]]\nboundary = \"disc-left\"\nx = 0\n", "");
            let text = text.replace("[[support]]\nboundary = \"plate-left\"\nx = 0\n", "");
            let solved = solve_case(&format!("[mesh]\norder = {order}\n{text}"), 1e-8);
            let (places, fields) = (&solved.elastic().contact.places, solved.fields());
            let of_place = |(lambda, place): (&f64, &ContactPlace<2>)| lambda * place.frame[0][1];
            let forces = solved.solution().lambda.iter().zip(places);
            let sum = forces.map(of_place).sum::<f64>().abs();
            compare(
                &format!("sphere, order {order}, λ on the {name}, F"),
                sum,
                force,
                1e-9,
            );
            let top = fields.pressure.iter().copied().fold(0.0, f64::max);
            let loaded = (0..places.len()).filter(|&i| fields.pressure[i] > 0.2 * top);
            let (radius, peak) = ellipsoid_fit(loaded.map(|i| {
                (
                    places[i].area,
                    places[i].place[0].powi(2),
                    fields.pressure[i],
                )
            }));
            compare(
                &format!("sphere, order {order}, λ on the {name}, a"),
                radius,
                a,
                limits[0],
            );
            compare(
                &format!("sphere, order {order}, λ on the {name}, p₀"),
                peak,
                p0,
                limits[1],
            );
            let middle = (0..places.len())
                .min_by(|&i, &j| places[i].place[0].total_cmp(&places[j].place[0]));
            let middle = middle.expect("a place");
            println!(
                "{} products, p(0)/p₀ {:.4}",
                solved.solution().n_a(),
                fields.pressure[middle] / p0
            );
        }
    }
}

/// Two discs on each other with meshes that do not match, pressed together: the pressure is uniform up to the axis.
#[test]
fn a_uniform_pressure_is_handed_on() {
    for (order, shape) in KINDS {
        for sides in [["low-top", "up-bottom"], ["up-bottom", "low-top"]] {
            let part = |name: &str, y: f64, width: f64, cells: [usize; 2]| {
                format!(
                    "[[mesh.part]]\nname = \"{name}\"\nshift = [0, {y}]\nrectangle = {{ size = [{width}, 1], cells = {cells:?}, {shape} }}\n"
                )
            };
            for widths in [[2.0_f64, 2.0], [2.0, 1.5], [1.5, 2.0]] {
                let narrow = widths[0].min(widths[1]);
                let load = |width: f64| 6.0 * (narrow / width).powi(2);
                let text = format!(
                    "[mesh]\norder = {}\n{}{}{ROUND}[[material]]\nyoung = 1000\npoisson = 0\n\
                     [[support]]\nboundary = \"low-bottom\"\ny = 0\n\
                     [[traction]]\nboundary = \"up-top\"\npressure = {}\n\
                     [[contact]]\nboundary = \"{}\"\nagainst = \"{}\"\nfriction = {{ coulomb = 0.2 }}\n",
                    order.trim_start_matches("order = "),
                    part("low", 0.0, widths[0], [5, 2]),
                    part("up", 1.0, widths[1], [4, 2]),
                    load(widths[1]),
                    sides[0],
                    sides[1],
                );
                let solved = solve_case_twice(&text, 1e-11);
                let fields = solved.fields();
                let total: f64 = solved.solution().lambda[..fields.pressure.len()]
                    .iter()
                    .sum();
                let force = 6.0 * PI * narrow * narrow;
                assert!((total / force - 1.0).abs() < 1e-8, "{total} for {force}");
                if widths[0] == widths[1] {
                    let off = fields.pressure.iter().map(|p| (p / 6.0 - 1.0).abs());
                    let off = off.fold(0.0, f64::max);
                    assert!(off < 1e-8, "{order} {shape} {sides:?}: {off:e}");
                }
            }
        }
    }
}

/// A ring shrunk onto another one by warming it before (as if it were too small by α θ b), both free at their ends:
/// p = E α θ (b² − a²)(c² − b²)/(2 b² (c² − a²)) for one material, and friction bears μ p 2πb L along the axis.
#[test]
fn a_shrunk_ring_holds() {
    let [a, b, c] = [0.5_f64, 1.0, 1.5];
    let (young, alpha, warmth, mu, length) = (2.0e5, 1.2e-5, -100.0, 0.1, 0.4);
    let p = young * alpha * -warmth * (b * b - a * a) * (c * c - b * b)
        / (2.0 * b * b * (c * c - a * a));
    for (order, limits) in [("1", [0.01, 0.03]), ("2", [1e-3, 0.01])] {
        for sides in [
            "boundary = \"in-right\"\nagainst = \"out-left\"",
            "boundary = \"out-left\"\nagainst = \"in-right\"",
        ] {
            let part = |name: &str, x: f64, width: f64, cells: [usize; 2]| {
                format!(
                    "[[mesh.part]]\nname = \"{name}\"\nshift = [{x}, 0]\nrectangle = {{ size = [{width}, {length}], cells = {cells:?} }}\n"
                )
            };
            let text = format!(
                "[mesh]\norder = {order}\n{}{}{ROUND}[steps]\nfactors = [1, 1]\n\
                 [[material]]\nyoung = {young}\npoisson = 0\nexpansion = {alpha}\n\
                 [[support]]\nboundary = \"in-bottom\"\ny = 0\n\
                 [[support]]\nboundary = \"out-top\"\ny = 1e-3\nfactors = [0, 1]\n\
                 [[temperature]]\nregion = \"out\"\nvalue = {warmth}\n\
                 [[contact]]\n{sides}\ngap = 0\nfriction = {{ coulomb = {mu} }}\n",
                part("in", a, b - a, [6, 5]),
                part("out", b, c - b, [6, 7]),
            );
            let solved = solve_case(&text, 1e-9);
            let m = solved.build.problem.m();
            let forces = |step: usize| -> [f64; 2] {
                let lambda = &solved.steps[step].lambda;
                [lambda[..m].iter().sum(), lambda[m..].iter().sum()]
            };
            let area = 2.0 * PI * b * length;
            compare(
                &format!("shrunk ring, order {order}, mean pressure"),
                forces(0)[0] / area,
                p,
                limits[0],
            );
            let [pressed, rubbed] = forces(1);
            compare(
                &format!("shrunk ring, order {order}, friction"),
                rubbed.abs(),
                mu * p * area,
                limits[1],
            );
            assert!((rubbed.abs() / (mu * pressed) - 1.0).abs() < 1e-6);
        }
    }
}

/// Only the floor holds a disc up: it has one motion as a whole, along the axis.
#[test]
fn a_disc_rests_on_the_floor() {
    for order in [1, 2] {
        let text = format!(
            "[mesh]\norder = {order}\nrectangle = {{ size = [1, 0.2], cells = [10, 3] }}\n[analysis]\nplane = \"axisymmetric\"\n\
             gravity = [0, -10]\n[[material]]\nyoung = 1e5\npoisson = 0.3\ndensity = 3\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {{ coulomb = 0.3 }}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n"
        );
        let solved = solve_case_twice(&text, 1e-9);
        assert_eq!(solved.build.problem.floating_bodies().n_modes(), 1);
        let m = solved.build.problem.m();
        let force: f64 = solved.solution().lambda[..m].iter().sum();
        compare("weight of a disc", force, PI * 0.2 * 30.0, 1e-8);
    }
}

#[test]
fn entries_invalid_for_a_ring_are_refused() {
    let refused = |analysis: &str, map: &str, rest: &str| -> String {
        let text = format!(
            "[mesh]\nrectangle = {{ size = [1, 1], cells = [2, 2], map = {map} }}\n[analysis]\nplane = \"axisymmetric\"\n{analysis}\n\
             [[material]]\nyoung = 1\npoisson = 0.3\ndensity = 1\n{rest}\n\
             [[contact]]\nboundary = \"bottom\"\nobstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n"
        );
        let case = Case::parse(Path::new("case.toml"), text.clone(), &[]);
        match case.map(|case| case.build()) {
            Ok(Ok(_)) => panic!("not refused: {text}"),
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        }
    };
    let straight = "[\"x\", \"y\"]";
    let told = [
        (refused("thickness = 2", straight, ""), "has no thickness"),
        (refused("gravity = [1, 0]", straight, ""), "along its axis"),
        (
            refused("rotation = { point = [1, 0], speed = 3 }", straight, ""),
            "about its axis",
        ),
        (
            refused("", "[\"x - 0.5\", \"y\"]", ""),
            "is beyond the axis of revolution",
        ),
        (
            refused(
                "",
                straight,
                "[[support]]\nboundary = \"top\"\naxis = { point = [0, 0] }\nradial = 0\n",
            ),
            "x is radial and y axial",
        ),
        (
            refused("", straight, "[[force]]\nboundary = \"top\"\nx = 1\n"),
            "is on the axis of the body of revolution",
        ),
        (
            refused("", straight, "[[support]]\nboundary = \"left\"\nx = 0.1\n"),
            "prescribe different displacements in x",
        ),
    ];
    for (told, expected) in told {
        assert!(told.contains(expected), "{told}");
    }
}
