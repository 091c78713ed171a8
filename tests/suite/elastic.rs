//! Elasticity and contact against closed forms and published figures.

use crate::common::or_panic::OrPanic as _;
use crate::common::{Solved, solve_case_twice};

/// Every case here is solved by iterations as well.
fn run(text: &str, tolerance: f64) -> Solved {
    solve_case_twice(text, tolerance)
}

/// A block pressed on a rigid plane: the contact pressure is the load, to rounding, on any mesh.
#[test]
fn patch_test_against_an_obstacle() {
    let meshes = [
        "rectangle = { size = [2, 1], cells = [7, 3] }",
        "rectangle = { size = [2, 1], cells = [5, 4], shape = \"triangle\" }",
        "file = \"meshes/b41a.msh\"",
    ];
    for (i, mesh) in meshes.iter().enumerate() {
        let material = if i < 2 {
            "[[material]]\nyoung = 3000\npoisson = 0.4"
        } else {
            "[[material]]\nregion = \"steel\"\nyoung = 3000\npoisson = 0.4\n\
             [[material]]\nregion = \"soft rubber\"\nyoung = 3000\npoisson = 0.4"
        };
        // The corner that holds the height is on the plane already; it bears its share of the load.
        let text = format!(
            "[mesh]\n{mesh}\n{material}\n[[support]]\nboundary = \"left\"\nx = 0\n\
             [[support]]\npoint = [0, 0]\ny = 0\n[[traction]]\nboundary = \"top\"\npressure = 10\n\
             [[contact]]\nboundary = \"bottom\"\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 3] }} }}\n"
        );
        let solved = run(&text, 1e-13);
        let elastic = solved.elastic();
        let fields = solved.fields();
        assert!(fields.pressure.len() > 4);
        for p in &fields.pressure {
            assert!((p - 10.0).abs() < 1e-9, "mesh {i}: {p}");
        }
        let u = solved.displacement();
        let (e, nu) = (3000.0, 0.4);
        for (x, u) in elastic.mesh.nodes.iter().zip(&u) {
            assert!((u[1] + 10.0 * (1.0 - nu * nu) / e * x[1]).abs() < 1e-12);
            assert!((u[0] - 10.0 * nu * (1.0 + nu) / e * x[0]).abs() < 1e-12);
        }
        let (nodes, elements) = signorini::elasticity::stresses(&elastic.body(), &u);
        for s in nodes.iter().chain(&elements) {
            assert!((s.yy + 10.0).abs() < 1e-8 && s.xx.abs() < 1e-8 && s.xy.abs() < 1e-8);
            assert!((s.zz + 4.0).abs() < 1e-8);
        }
    }
}

/// The same in a rotated frame and against discs of huge radius: the direction of the plane is not a special case.
#[test]
fn patch_test_on_the_left_side() {
    for obstacle in [
        "{ half_plane = { point = [0, 0], normal = [2, 0] } }",
        "{ circle = { center = [-1e9, 0.5], radius = 1e9 } }",
    ] {
        let text = format!(
            "[mesh]\nrectangle = {{ size = [1, 1], cells = [4, 6] }}\n[[material]]\nyoung = 1\npoisson = 0.3\n\
             [[support]]\nboundary = \"bottom\"\nsymmetry = true\n[[support]]\npoint = [0, 0]\nx = 0\n\
             [[traction]]\nboundary = \"right\"\nx = -1e-3\n\
             [[contact]]\nboundary = \"left\"\nobstacle = {obstacle}\n"
        );
        let solved = run(&text, 1e-10);
        for p in solved.fields().pressure {
            assert!((p - 1e-3).abs() < 1e-8, "{p}");
        }
    }
}

/// Pushed sideways below the bound everything sticks, above it everything slips, without friction the
/// bound 0 gives the same as no law.
#[test]
fn stick_and_slip_of_a_block() {
    let text = |friction: &str| {
        format!(
            "[mesh]\nrectangle = {{ size = [4, 1], cells = [16, 4] }}\n[[material]]\nyoung = 1e5\npoisson = 0.3\n\
             [[support]]\nboundary = \"left\"\nx = 0\n[[support]]\npoint = [0, 1]\ny = -1e-2\n\
             [[traction]]\nboundary = \"top\"\npressure = 100\n[[traction]]\nboundary = \"right\"\nx = 20\n\
             [[contact]]\nboundary = \"bottom\"\nfriction = {friction}\n\
             obstacle = {{ half_plane = {{ point = [0, 0], normal = [0, 1] }} }}\n"
        )
    };
    let stick = run(&text("{ tresca = 1e4 }"), 1e-9);
    let sizes = stick.sizes();
    assert_eq!(sizes.slip.total(), 0);
    let slip = run(&text("{ tresca = 0.01 }"), 1e-9);
    // Except for the corner, which the support keeps from sliding.
    assert_eq!((slip.sizes().stick, slip.sizes().frictionless), (0, 1));
    let zero = run(&text("{ tresca = 0 }"), 1e-9);
    let none = run(&text("\"none\""), 1e-9);
    assert_eq!(zero.solution().u, none.solution().u);
    assert!(crate::common::distance(&slip.solution().u, &none.solution().u) < 1e-2);
}

/// Pure bending of a cantilever in plane stress: u = (C x y, −C (x² + ν y²)/2) / E; the error of the
/// tip falls with h² for both elements.
#[test]
fn bending_converges_with_h_squared() {
    let (nu, c) = (0.3, 1.0);
    let tip = -c * 9.0 / 2.0;
    for (shape, order) in [("quad", 1.85), ("triangle", 1.7)] {
        let errors: Vec<f64> = [4, 8, 16]
            .iter()
            .map(|&cells| {
                let text = format!(
                    "[mesh]\nrectangle = {{ origin = [0, -0.5], size = [3, 1], cells = [{}, {cells}], shape = \"{shape}\" }}\n\
                     [analysis]\nplane = \"plane_stress\"\n[[material]]\nyoung = 1\npoisson = {nu}\n\
                     [[support]]\nboundary = \"left\"\nx = 0\ny = \"-{nu} * y^2 / 2\"\n\
                     [[traction]]\nboundary = \"right\"\nx = \"{c} * y\"\n",
                    3 * cells
                );
                let solved = run(&text, 1e-9);
                let elastic = solved.elastic();
                let u = solved.displacement();
                let node = elastic
                    .mesh
                    .nodes
                    .iter()
                    .position(|x| (x[0] - 3.0).abs() < 1e-12 && x[1].abs() < 1e-12)
                    .expect("a node at the tip");
                (u[node][1] - tip).abs() / tip.abs()
            })
            .collect();
        let rate = (errors[1] / errors[2]).log2();
        assert!(rate > order, "{shape}: errors {errors:?}, order {rate}");
        assert!(errors[2] < 0.02, "{shape}: {errors:?}");
    }
}

/// Weight: the reaction of the ground is the weight of the body.
#[test]
fn gravity_and_body_forces_balance() {
    let text = "[mesh]\nrectangle = { size = [2, 3], cells = [4, 6] }\n[analysis]\ngravity = [0, -9.81]\nthickness = 0.5\n\
        [[material]]\nyoung = 1e9\npoisson = 0.2\ndensity = 1000\n\
        [[support]]\nboundary = \"left\"\nx = 0\n[[support]]\npoint = [0, 0]\ny = 0\n\
        [[body_force]]\nregion = \"body\"\ny = \"-1000 * y\"\n\
        [[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }\n";
    let solved = run(text, 1e-11);
    // ρ g V = 1000 · 9.81 · 3 and ∫ 1000 y = 1000 · 0.5 · 2 · 4.5.
    let weight = 29430.0 + 4500.0;
    assert!((solved.data.total_load[1] + weight).abs() < 1e-8 * weight);
    // The held corner bears the part that the contact nodes do not.
    let reaction: f64 = solved.solution().lambda[..solved.build.problem.m()]
        .iter()
        .sum();
    assert!(reaction > 0.8 * weight && reaction < weight);
}

/// Prescribed displacements press the body on the obstacle as a traction would.
#[test]
fn prescribed_displacement_closes_the_gap() {
    let text = "[mesh]\nrectangle = { size = [1, 1], cells = [4, 4] }\n[[material]]\nyoung = 1000\npoisson = 0\n\
        [[support]]\nboundary = \"top\"\nx = 0\ny = -0.03\n\
        [[contact]]\nboundary = \"bottom\"\nobstacle = { half_plane = { point = [0, -0.01], normal = [0, 1] } }\n";
    let solved = run(text, 1e-11);
    // With ν = 0 a column of stiffness E: 0.02 of shortening.
    for p in solved.fields().pressure {
        assert!((p - 20.0).abs() < 1e-6, "{p}");
    }
}

/// A rigid disc pressed into a half-plane-like block: the pressure is Hertz's where the mesh resolves it.
#[test]
fn disc_on_a_block() {
    let text = "[mesh]\nrectangle = { origin = [0, -8], size = [8, 8], cells = [160, 160] }\n\
        [[material]]\nyoung = 1000\npoisson = 0.3\n[[support]]\nboundary = \"left\"\nx = 0\n\
        [[support]]\nboundary = \"bottom\"\ny = 0.05\n\
        [[contact]]\nboundary = \"top\"\nobstacle = { circle = { center = [0, 20], radius = 20 } }\n";
    let solved = run(text, 1e-8);
    let fields = solved.fields();
    let half: f64 = solved.solution().lambda[..solved.build.problem.m()]
        .iter()
        .sum();
    // Half model: P = 2 Σ λν; a = √(4PR/(πE*)), p₀ = 2P/(πa).
    let e_star = 1000.0 / (1.0 - 0.09);
    let a = (4.0 * 2.0 * half * 20.0 / (std::f64::consts::PI * e_star)).sqrt();
    let p0 = 4.0 * half / (std::f64::consts::PI * a);
    let top = fields.pressure.iter().copied().fold(0.0, f64::max);
    println!("a = {a:.4}, p0 = {p0:.3}, computed {top:.3}");
    assert!((top / p0 - 1.0).abs() < 0.04, "{top} {p0}");
    let edge = (0..fields.pressure.len())
        .filter(|&i| fields.pressure[i] > 0.0)
        .map(|i| solved.place(i)[0])
        .fold(0.0, f64::max);
    assert!((edge - a).abs() < 0.1, "{edge} {a}");
}

/// The four formats of Gmsh hold the same mesh and give the same answer.
#[test]
fn gmsh_formats_agree() {
    let solutions: Vec<Solved> = ["b22a", "b22b", "b41a", "b41b"]
        .iter()
        .map(|name| {
            run(
                &format!(
                    "[mesh]\nfile = \"meshes/{name}.msh\"\nscale = 1e-3\n\
                     [[material]]\nregion = \"steel\"\nyoung = 2.1e11\npoisson = 0.3\n\
                     [[material]]\nregion = \"soft rubber\"\nyoung = 1e9\npoisson = 0.45\n\
                     [[support]]\nboundary = \"left\"\nx = 0\ny = 0\n[[traction]]\nboundary = \"77\"\ny = -1e5\n\
                     [[contact]]\nboundary = \"bottom\"\nfriction = {{ tresca = 1e4 }}\n\
                     obstacle = {{ half_plane = {{ point = [0, -1e-8], normal = [0, 1] }} }}\n"
                ),
                1e-9,
            )
        })
        .collect();
    let mesh = |i: usize| &solutions[i].elastic().mesh;
    assert_eq!(mesh(0).regions.len(), 2);
    assert_eq!(mesh(0).boundaries.len(), 4);
    let areas = mesh(0).measures();
    assert!(areas.iter().all(|a| (a - 1e-6).abs() < 1e-15));
    for i in 1..4 {
        assert_eq!(mesh(i).elements.len(), mesh(0).elements.len());
        assert_eq!(
            mesh(i).boundaries.keys().collect::<Vec<_>>(),
            mesh(0).boundaries.keys().collect::<Vec<_>>()
        );
        assert_eq!(solutions[i].sizes(), solutions[0].sizes());
        let norm = |s: &Solved| s.solution().u.iter().map(|u| u * u).sum::<f64>().sqrt();
        let (a, b) = (norm(&solutions[i]), norm(&solutions[0]));
        assert!((a / b - 1.0).abs() < 1e-9, "{a} {b}");
    }
    let sizes = solutions[0].sizes();
    assert!(sizes.separated > 0 && sizes.separated < solutions[0].build.problem.m());
}

#[test]
fn broken_gmsh_files_say_where() {
    let directory = tempfile::tempdir().or_panic();
    let path = directory.path().join("broken.msh");
    let message = |bytes: &[u8]| -> String {
        std::fs::write(&path, bytes).or_panic();
        match signorini::mesh::gmsh::read(&path, 1.0) {
            Ok(_) => panic!("it was read"),
            Err(error) => error.to_string(),
        }
    };
    for name in ["b22a", "b22b", "b41a", "b41b"] {
        let whole = std::fs::read(format!("tests/meshes/{name}.msh")).or_panic();
        // Cut anywhere, the file must give an error or, after the last element, a mesh: never a panic.
        for end in (0..whole.len()).step_by(37) {
            std::fs::write(&path, &whole[..end]).or_panic();
            if let Err(error) = signorini::mesh::gmsh::read(&path, 1.0) {
                assert!(error.to_string().contains("broken.msh"));
            }
        }
        // The same with bytes changed.
        let mut random = crate::common::Random(11);
        for _ in 0..300 {
            let mut bytes = whole.clone();
            for _ in 0..3 {
                let place = random.below(bytes.len());
                bytes[place] = random.below(256) as u8;
            }
            std::fs::write(&path, &bytes).or_panic();
            let _ = signorini::mesh::gmsh::read(&path, 1.0);
        }
    }
    let head = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n";
    assert!(message(b"").contains("empty"));
    assert!(message(b"solid cube\n").contains("does not begin with $MeshFormat"));
    assert!(message(b"$MeshFormat\n4.0 0 8\n$EndMeshFormat\n").contains("4.0 is not supported"));
    assert!(
        message(format!("{head}$Nodes\n2\n1 0 0 0\n2 0 zero 0\n$EndNodes\n").as_bytes())
            .contains("line 7: \"zero\" is not a number")
    );
    assert!(message(
        format!("{head}$Nodes\n1\n1 0 0 0\n$EndNodes\n$Elements\n1\n1 21 2 1 1 1 1 1 1 1 1\n$EndElements\n")
            .as_bytes()
    )
    .contains("Mesh.ElementOrder = 1"));
    assert!(message(
        format!("{head}$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0.5\n$EndNodes\n$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n")
            .as_bytes()
    )
    .contains("not plane"));
    assert!(message(
        format!("{head}$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 2 0 0\n$EndNodes\n$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n")
            .as_bytes()
    )
    .contains("no area"));
}
