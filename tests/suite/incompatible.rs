//! Quadrilaterals and hexahedra of first order with incompatible modes: the fields that they reproduce exactly, and beams and
//! shells of one element through the thickness.
//!
//! `cargo test --release --test suite -- --nocapture incompatible::` shows the figures.

use crate::common::models::on_the_cpu;
use crate::common::or_panic::OrPanic as _;
use crate::common::solved::case;
use signorini::case::CaseProblem;
use signorini::contact::Space;
use signorini::elasticity::{Deformed, Stress, cauchy_stresses, stresses_at};
use signorini::engine::Stiffness;
use signorini::mesh::ElementKind;
use signorini::model::{AnyBuilt, Built};
use signorini::ssnm::Status;

/// Places, displacements and stresses of the nodes.
struct Found {
    x: Vec<[f64; 3]>,
    u: Vec<[f64; 3]>,
    stress: Vec<Stress>,
    status: Status,
}

impl Found {
    /// The displacement of the node at a place.
    fn at(&self, place: [f64; 3]) -> [f64; 3] {
        let near = |x: &[f64; 3]| (0..3).all(|c| (x[c] - place[c]).abs() < 1e-9);
        self.u[self.x.iter().position(near).expect("a node is there")]
    }
}

fn of<const D: usize>(built: &Built<D>, tolerance: f64, path: Stiffness) -> Found
where
    ElementKind: Space<D>,
{
    let solution = built
        .solve(&on_the_cpu(tolerance, path))
        .or_panic()
        .remove(0);
    let data = built.step(0).or_panic();
    let u = data.unknowns.displacements(&solution.u);
    let field = |region, x| data.temperature.at(region, x);
    let body = built.elastic.body();
    let (stress, _) = match built.elastic.is_large() {
        true => cauchy_stresses(&Deformed::new(&body, &u, Some(&field))),
        false => stresses_at(&body, &u, Some(&field)),
    };
    let three = |v: &[f64; D]| std::array::from_fn(|c| v.get(c).copied().unwrap_or(0.0));
    Found {
        x: built.elastic.mesh.nodes.iter().map(three).collect(),
        u: u.iter().map(three).collect(),
        stress,
        status: solution.status,
    }
}

fn solved(text: &str, path: Stiffness) -> Found {
    solved_to(1e-12, text, path)
}

fn solved_to(tolerance: f64, text: &str, path: Stiffness) -> Found {
    let CaseProblem::Elastic(built) = case(text).build().or_panic() else {
        panic!("it has bodies");
    };
    match *built {
        AnyBuilt::Plane(built) => of(&built, tolerance, path),
        AnyBuilt::Space(built) => of(&built, tolerance, path),
    }
}

const PATHS: [Stiffness; 2] = [Stiffness::Cholesky, Stiffness::Pcg];

/// Elements of any shape reproduce a uniform strain that is prescribed at their border, with its stress.
#[test]
fn patches_are_strained_uniformly() {
    let bump = "x*(2 - x)*y*(1 - y)";
    for kind in ["plane_strain", "plane_stress", "axisymmetric", "space"] {
        for nu in [0.3, 0.49] {
            let [a, b] = [1e-3, -2e-3];
            let (head, sides) = match kind {
                "space" => (
                    format!(
                        "[mesh.box]\nsize = [2, 1, 1]\ncells = [3, 3, 2]\n\
                         map = [\"x + 0.6*{bump}*z*(1 - z)\", \"y - 0.5*{bump}*z*(1 - z)\", \"z + 0.7*{bump}*z*(1 - z)\"]\n"
                    ),
                    "\"left\", \"right\", \"front\", \"back\", \"bottom\", \"top\"",
                ),
                _ => (
                    format!(
                        "[analysis]\nplane = \"{kind}\"\n[mesh.rectangle]\nsize = [2, 1]\ncells = [4, 3]\n\
                         map = [\"x + 0.4*{bump}*sin(5*x)\", \"y + 0.5*{bump}\"]\n"
                    ),
                    "\"left\", \"right\", \"bottom\", \"top\"",
                ),
            };
            // In addition a shear, which a ring cannot have.
            let shear = if kind == "axisymmetric" { 0.0 } else { 3e-3 };
            let third = if kind == "space" {
                "z = \"5e-4*z\"\n"
            } else {
                ""
            };
            let text = format!(
                "{head}[[material]]\nyoung = 2\npoisson = {nu}\nincompatible_modes = true\n\
                 [[support]]\nboundary = [{sides}]\nx = \"{a}*x + {shear}*y\"\ny = \"{b}*y\"\n{third}"
            );
            let c = match kind {
                "space" => 5e-4,
                "axisymmetric" => a,
                "plane_strain" => 0.0,
                _ => -nu / (1.0 - nu) * (a + b),
            };
            let (mu, lambda) = (1.0 / (1.0 + nu), 2.0 * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)));
            let normal = |e: f64| lambda * (a + b + c) + 2.0 * mu * e;
            for path in PATHS {
                let found = solved(&text, path);
                for (u, x) in found.u.iter().zip(&found.x) {
                    let off = [u[0] - a * x[0] - shear * x[1], u[1] - b * x[1]];
                    assert!(
                        off.iter().all(|v| v.abs() < 1e-13),
                        "{kind}: {u:?} at {x:?}"
                    );
                }
                for s in &found.stress {
                    let off = [
                        s.xx - normal(a),
                        s.yy - normal(b),
                        s.zz - normal(c),
                        s.xy - mu * shear,
                    ];
                    assert!(
                        off.iter().all(|v| v.abs() < 1e-11),
                        "{kind}, ν = {nu}: {s:?}"
                    );
                }
            }
        }
    }
}

/// A beam of 10 × 1 (× 1) with so many elements along it and one through its thickness, with further entries.
fn beam(kind: &str, cells: usize, material: &str, load: &str) -> String {
    let (head, up) = match kind {
        "space" => (
            format!(
                "[mesh.box]\nsize = [10, 1, 1]\ncells = [{cells}, 1, 1]\n\
                 [[support]]\npoint = [0, 0, 0]\ny = 0\nz = 0\n[[support]]\npoint = [0, 1, 0]\nz = 0\n"
            ),
            "z",
        ),
        _ => (
            format!(
                "[analysis]\nplane = \"{kind}\"\n[mesh.rectangle]\nsize = [10, 1]\ncells = [{cells}, 1]\n\
                 [[support]]\npoint = [0, 0]\ny = 0\n"
            ),
            "y",
        ),
    };
    let load = load.replace('H', up);
    format!(
        "{head}[[material]]\nyoung = 1000\n{material}\n[[support]]\nboundary = \"left\"\nx = 0\n{load}\n"
    )
}

/// Under a moment M a beam has the curvature M/(E I), E/(1 − ν²) in plane strain, and the stress M h/I: exactly, however close ν
/// is to 1/2 in the plane. Without modes it is far too stiff.
#[test]
fn beams_bend_under_moments() {
    let moment = "[[traction]]\nboundary = \"right\"\nx = \"12*(H - 0.5)\"";
    for kind in ["plane_stress", "plane_strain", "space"] {
        for nu in [0.0, 0.3, 0.499] {
            for cells in [5, 10] {
                let with = format!("poisson = {nu}\nincompatible_modes = true");
                let text = beam(kind, cells, &with, moment);
                let factor = if kind == "plane_strain" {
                    1.0 - nu * nu
                } else {
                    1.0
                };
                let exact = -0.6 * factor;
                let up = if kind == "space" { 2 } else { 1 };
                for path in PATHS {
                    let found = solved(&text, path);
                    let tip = found.at([10.0, 0.0, 0.0])[up];
                    assert!((tip / exact - 1.0).abs() < 1e-8, "{kind}, ν = {nu}: {tip}");
                    for (s, x) in found.stress.iter().zip(&found.x) {
                        let off = s.xx - 12.0 * (x[up] - 0.5);
                        assert!(off.abs() < 1e-7, "{kind}, ν = {nu}: {s:?} at {x:?}");
                    }
                }
                let plain = beam(kind, cells, &format!("poisson = {nu}"), moment);
                let tip = solved(&plain, Stiffness::Cholesky).at([10.0, 0.0, 0.0])[up];
                println!(
                    "{kind}, ν = {nu}, {cells} cells: {:.3} of the exact tip without modes",
                    tip / exact
                );
                // Near ν = 1/2 the mean dilatation makes them too soft in plane strain.
                assert!(tip / exact < 0.85 || nu > 0.45, "{kind}, ν = {nu}: {tip}");
            }
        }
    }
}

/// Warmer at its top than at its bottom, a beam bends as much as it expands, and has no stress.
#[test]
fn beams_bend_where_one_side_is_warmer() {
    let warmth = "[[temperature]]\nvalue = \"50*H\"";
    for kind in ["plane_stress", "space"] {
        let material = "poisson = 0.3\nexpansion = 2e-4\nincompatible_modes = true";
        for path in PATHS {
            let found = solved(&beam(kind, 5, material, warmth), path);
            let up = if kind == "space" { 2 } else { 1 };
            let tip = found.at([10.0, 0.0, 0.0])[up];
            assert!((tip + 0.5).abs() < 1e-9, "{kind}: {tip}");
            for s in &found.stress {
                let all = [s.xx, s.yy, s.zz, s.xy, s.yz, s.zx];
                assert!(all.iter().all(|v| v.abs() < 1e-8), "{kind}: {s:?}");
            }
        }
    }
}

/// With large displacements a beam under small loads gives way as with small ones, in proportion to the load.
#[test]
fn small_loads_of_large_displacements() {
    for kind in ["plane_stress", "plane_strain", "space"] {
        let up = if kind == "space" { 2 } else { 1 };
        for modes in [true, false] {
            let tip = |law: &str, head: &str, force: f64| {
                let material = format!("poisson = 0.3\nincompatible_modes = {modes}\n{law}");
                let load = format!("[[traction]]\nboundary = \"right\"\nH = {force:e}");
                let text = beam(kind, 10, &material, &load);
                let text = match kind {
                    "space" => format!("[analysis]\n{head}\n{text}"),
                    _ => text.replace("[analysis]", &format!("[analysis]\n{head}")),
                };
                let found = solved_to(1e-6, &text, Stiffness::Cholesky);
                assert_eq!(found.status, Status::Converged, "{text}");
                found.at([10.0, 0.0, 0.0])[up] / force
            };
            let small = tip("", "", 1.0);
            for law in ["st-venant-kirchhoff", "neo-hooke"] {
                for exponent in [-18, -12, -9, -8, -6] {
                    let law = format!("law = \"{law}\"");
                    let large = tip(&law, "geometry = \"large\"", 10_f64.powi(exponent));
                    assert!(
                        (large / small - 1.0).abs() < 1e-5,
                        "{kind}, {law}, modes: {modes}, 1e{exponent}: {large} {small}"
                    );
                }
            }
        }
    }
}

/// A thin cylinder under a moment at its end, one element thick: w = M/(2 β² D) there with β⁴ = 3 (1 − ν²)/(R² h²).
#[test]
fn a_cylinder_bends_at_its_end() {
    let (radius, height, nu) = (10.0, 0.2, 0.3_f64);
    let beta = (3.0 * (1.0 - nu * nu) / f64::powi(radius * height, 2)).powf(0.25);
    let stiffness = 1000.0 * f64::powi(height, 3) / (12.0 * (1.0 - nu * nu));
    let exact = 1.0 / (2.0 * beta * beta * stiffness);
    let tip = |modes: bool| {
        let text = format!(
            "[analysis]\nplane = \"axisymmetric\"\n[mesh.rectangle]\norigin = [{}, 0]\nsize = [{height}, 6]\ncells = [1, 40]\n\
             [[material]]\nyoung = 1000\npoisson = {nu}\nincompatible_modes = {modes}\n\
             [[support]]\nboundary = \"bottom\"\ny = 0\n[[traction]]\nboundary = \"top\"\ny = \"{}*(x - {radius})\"\n",
            radius - 0.5 * height,
            12.0 / f64::powi(height, 3),
        );
        let found = solved(&text, Stiffness::Cholesky);
        let inner = found.at([radius - 0.5 * height, 6.0, 0.0])[0];
        let outer = found.at([radius + 0.5 * height, 6.0, 0.0])[0];
        0.5 * (inner + outer)
    };
    let [with, without] = [true, false].map(|modes| tip(modes).abs() / exact);
    println!(
        "cylinder bent at its end, one element thick: {with:.4} of the shell, {without:.4} without modes"
    );
    assert!(
        (with - 1.0).abs() < 0.03 && without < 0.85,
        "{with}, {without}"
    );
}

/// Cook's membrane at ν = 0.499 (as `second_order.rs` has it), in the plane and as a slab that nothing moves out of its plane.
#[test]
fn nearly_incompressible_bodies_do_not_lock() {
    const REFERENCE: f64 = 8.080_6;
    let [x, y] = ["48*x", "44*x + y*(44 - 28*x)"];
    let heads = [
        format!("[mesh.rectangle]\nsize = [1, 1]\ncells = [16, 16]\nmap = [\"{x}\", \"{y}\"]\n"),
        format!(
            "[mesh.box]\nsize = [1, 1, 1]\ncells = [16, 16, 1]\nmap = [\"{x}\", \"{y}\", \"z\"]\n\
             [[support]]\nboundary = [\"bottom\", \"top\"]\nz = 0\n"
        ),
    ];
    for (head, [left, right]) in heads.iter().zip([["left", "right"]; 2]) {
        let text = format!(
            "{head}[[material]]\nyoung = 240.565\npoisson = 0.499\nincompatible_modes = true\n\
             [[support]]\nboundary = \"{left}\"\nx = 0\ny = 0\n[[traction]]\nboundary = \"{right}\"\ny = 6.25\n"
        );
        let tip = solved(&text, Stiffness::Cholesky).at([48.0, 60.0, 0.0])[1];
        println!("Cook with modes: {:+.2} %", 100.0 * (tip / REFERENCE - 1.0));
        assert!((tip / REFERENCE - 1.0).abs() < 0.025, "{tip}");
    }
}

/// A large uniform strain of elements of any shape.
#[test]
fn patches_are_strained_uniformly_by_a_fifth() {
    let bump = "x*(2 - x)*y*(1 - y)";
    let slopes = [[0.2, 0.15], [-0.1, -0.12]];
    let f: [[f64; 2]; 2] = std::array::from_fn(|i| {
        std::array::from_fn(|j| slopes[i][j] + f64::from(u8::from(i == j)))
    });
    let j = f[0][0] * f[1][1] - f[0][1] * f[1][0];
    let (mu, lambda) = (1.0 / 1.3, 2.0 * 0.3 / (1.3 * 0.4));
    for law in ["st-venant-kirchhoff", "neo-hooke"] {
        // σxx, σyy, σxy of the law in plane strain.
        let product = |m: &dyn Fn(usize, usize) -> f64, a: usize, b: usize| {
            let entry = |k: usize, l: usize| f[a][k] * m(k, l) * f[b][l];
            (0..2)
                .map(|k| (0..2).map(|l| entry(k, l)).sum::<f64>())
                .sum::<f64>()
        };
        let one = |k: usize, l: usize| f64::from(u8::from(k == l));
        let strain =
            |k: usize, l: usize| 0.5 * ((0..2).map(|i| f[i][k] * f[i][l]).sum::<f64>() - one(k, l));
        let trace = strain(0, 0) + strain(1, 1);
        let expected = [(0, 0), (1, 1), (0, 1)].map(|(a, b)| match law {
            "neo-hooke" => {
                (mu * (product(&one, a, b) - one(a, b)) + lambda * j.ln() * one(a, b)) / j
            }
            _ => {
                product(
                    &|k, l| lambda * trace * one(k, l) + 2.0 * mu * strain(k, l),
                    a,
                    b,
                ) / j
            }
        });
        for kind in ["plane_strain", "space"] {
            let (mesh, sides, third) = match kind {
                "space" => (
                    format!(
                        "[mesh.box]\nsize = [2, 1, 1]\ncells = [3, 3, 2]\nmap = [\"x + 0.6*{bump}*z*(1 - z)\", \
                         \"y - 0.5*{bump}*z*(1 - z)\", \"z + 0.7*{bump}*z*(1 - z)\"]\n[analysis]\n"
                    ),
                    "\"left\", \"right\", \"front\", \"back\", \"bottom\", \"top\"",
                    "z = 0\n",
                ),
                _ => (
                    format!(
                        "[mesh.rectangle]\nsize = [2, 1]\ncells = [4, 3]\n\
                         map = [\"x + 0.4*{bump}*sin(5*x)\", \"y + 0.5*{bump}\"]\n[analysis]\nplane = \"plane_strain\"\n"
                    ),
                    "\"left\", \"right\", \"bottom\", \"top\"",
                    "",
                ),
            };
            let [[a, b], [c, d]] = slopes;
            let text = format!(
                "{mesh}geometry = \"large\"\n[[material]]\nyoung = 2\npoisson = 0.3\nlaw = \"{law}\"\n\
                 incompatible_modes = true\n[[support]]\nboundary = [{sides}]\nx = \"{a}*x + {b}*y\"\n\
                 y = \"{c}*x + {d}*y\"\n{third}"
            );
            for path in PATHS {
                let found = solved(&text, path);
                for (u, x) in found.u.iter().zip(&found.x) {
                    for (u, [a, b]) in u.iter().zip(slopes) {
                        assert!((u - a * x[0] - b * x[1]).abs() < 1e-10, "{kind} {law}");
                    }
                }
                for s in &found.stress {
                    for (found, expected) in [s.xx, s.yy, s.xy].iter().zip(expected) {
                        assert!((found - expected).abs() < 1e-9, "{kind} {law}: {s:?}");
                    }
                }
            }
        }
    }
}

/// Cantilevers of one layer of elements under a force across that moves their ends by 0.7 of their length. In the plane a thin one,
/// whose end is where the elastica's is: 0.71379 l and 0.38763 l for P l² / E I = 5 (Mattiasson, 1981). In space one of 20 × 0.4 × 1,
/// whose end is where CalculiX 2.20 has it with `C3D8I`.
#[test]
fn a_cantilever_of_one_layer_bends_far() {
    let large = "geometry = \"large\"\n";
    let rest = |young: f64, nu: f64, traction: f64, third: &str| {
        format!(
            "[[material]]\nyoung = {young}\npoisson = {nu}\nincompatible_modes = true\n[[support]]\nboundary = \"left\"\n\
             x = 0\ny = 0\n{third}[[traction]]\nboundary = \"right\"\ny = {traction}\n"
        )
    };
    let thin = format!(
        "[analysis]\nplane = \"plane_stress\"\n{large}[mesh.rectangle]\nsize = [20, 0.1]\ncells = [80, 1]\n{}",
        rest(64e6, 0.0, 2000.0 / 3.0, "")
    );
    let thick = format!(
        "[analysis]\n{large}[mesh.box]\nsize = [20, 0.4, 1]\ncells = [20, 1, 1]\n{}",
        rest(1e6, 0.3, 500.0 / 3.0, "z = 0\n")
    );
    for path in PATHS {
        let found = solved(&thin, path);
        let ends = [0.0, 0.1].map(|y| found.at([20.0, y, 0.0]));
        for (c, expected) in [-0.38763, 0.71379].into_iter().enumerate() {
            let middle = 0.5 * (ends[0][c] + ends[1][c]);
            assert!((middle / 20.0 - expected).abs() < 2e-4, "{ends:?}");
        }
        let found = solved(&thick, path);
        for (y, expected) in [(0.0, [-7.507545, 14.34311]), (0.4, [-7.882229, 14.08310])] {
            let u = found.at([20.0, y, 0.0]);
            for (u, expected) in u.iter().zip(expected) {
                assert!((u / expected - 1.0).abs() < 1e-5, "{u} {expected}");
            }
        }
    }
}
