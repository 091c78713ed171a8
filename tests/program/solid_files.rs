//! Cases of solids in the program: its messages and files, and problems in space from matrices.

use crate::close::close;
use crate::or_panic::OrPanic as _;
use crate::run::{directory, numbers, signorini_in, solved, solved_in};
use std::path::Path;

fn write(directory: &Path, name: &str, text: &str) {
    crate::run::write(&directory.join(name), text);
}

fn read(directory: &Path, name: &str) -> String {
    crate::run::read(&directory.join(name))
}

const PRESSED: &str = "title = \"block\"\n[units]\nlength = \"mm\"\n[mesh.box]\nsize = [2, 1, 1]\ncells = [4, 2, 2]\n\
    [[material]]\nyoung = 3000\npoisson = 0.3\n\
    [[support]]\nboundary = \"left\"\nx = 0\ny = 0\nz = \"-1e-4 * z\"\n\
    [[traction]]\nboundary = \"top\"\npressure = 2\ny = 1\nfactors = [1, 2]\n\
    [[contact]]\nboundary = \"bottom\"\nfriction = { tresca = 0.5 }\n\
    obstacle = { half_space = { point = [0, 0, 0], normal = [0, 0, 1] } }\n\
    [steps]\nfactors = [0.5, 1]\n";

#[test]
fn the_program_describes_a_solid() {
    let directory = directory();
    write(directory.path(), "block.toml", PRESSED);
    let output = signorini_in(directory.path(), &["check", "block.toml"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert_eq!(
        output.status.code(),
        Some(0),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    for line in [
        "mesh          45 nodes, 16 hexahedra, 1 body; [0.0000e0, 2.0000e0] × [0.0000e0, 1.0000e0] × [0.0000e0, 1.0000e0] mm",
        "region        \"body\": volume 2.0000e0 mm³, E = 3.0000e3 MPa, ν = 0.3, density 0",
        "boundary      \"top\": 8 faces, 2.0000e0 mm²",
        "analysis      solid",
        "total load    (0.000000e0, 4.000000e0, -8.000000e0) N, step 2",
        "support       \"left\": x = 0, y = 0, z = -1e-4 * z",
        "contact       \"bottom\" / rigid half-space: 12 places, 1.7500e0 mm²",
        "size          108 unknowns, 12 contact places",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
}

/// The columns of a CSV file by name; texts as they are.
fn columns(text: &str) -> (Vec<&str>, Vec<Vec<&str>>) {
    let mut lines = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    (lines.next().unwrap_or_default(), lines.collect())
}

#[test]
fn the_program_writes_all_of_a_solid() {
    let directory = directory();
    write(directory.path(), "block.toml", PRESSED);
    let output = signorini_in(directory.path(), &["solve", "block.toml", "--plots"]);
    let (out, log) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert_eq!(output.status.code(), Some(0), "{log}");
    assert!(
        out.contains("contact bottom / rigid half-space: force on the first ("),
        "{out}"
    );
    let results = directory.path().join("block-out");
    let report: serde_json::Value = serde_json::from_str(&read(&results, "report.json")).or_panic();
    let step = &report["steps"][1];
    let numbers = |value: &serde_json::Value| -> Vec<f64> {
        let all = value.as_array().into_iter().flatten();
        all.filter_map(serde_json::Value::as_f64).collect()
    };
    close(&numbers(&step["total_load"]), &[0.0, 4.0, -8.0], 1e-9);
    let (contact, support) = (
        numbers(&step["contacts"][0]["force"]),
        numbers(&step["supports"][0]["force"]),
    );
    let sum: Vec<f64> = (0..3)
        .map(|c| contact[c] + support[c] + [0.0, 4.0, -8.0][c])
        .collect();
    close(&sum, &[0.0; 3], 1e-6);
    let sets = &report["sets"];
    assert!(
        sets["slip"].is_u64() && sets["slip_plus"].is_null(),
        "{sets}"
    );
    let nodes = ["separated", "stick", "slip", "frictionless"];
    assert!(nodes.iter().all(|name| sets[name].is_u64()), "{sets}");

    // contact.csv has the same: the pressures and tractions of its nodes, and their columns along the axes.
    let text = read(&results, "contact-002.csv");
    let (head, rows) = columns(&text);
    assert_eq!(
        head,
        [
            "x [mm]",
            "y [mm]",
            "z [mm]",
            "gap [mm]",
            "normal_pressure [MPa]",
            "tangential_traction_1 [MPa]",
            "tangential_traction_2 [MPa]",
            "slip_1 [mm]",
            "slip_2 [mm]",
            "status",
            "contact",
            "traction_x [MPa]",
            "traction_y [MPa]",
            "traction_z [MPa]",
            "place",
        ]
    );
    assert_eq!(rows.len(), 12);
    let number = |row: &[&str], column: usize| -> f64 {
        row[column]
            .parse()
            .unwrap_or_else(|error| panic!("{}: {error}", row[column]))
    };
    for row in &rows {
        assert_eq!((number(row, 2), row[10]), (0.0, "bottom"));
        assert!(
            ["stick", "slip", "separated"].contains(&row[9]),
            "{}",
            row[9]
        );
        // On the ground the tangents are the axes x and y.
        close(
            &[number(row, 11), number(row, 12), number(row, 13)],
            &[number(row, 5), number(row, 6), number(row, 4)],
            1e-12,
        );
        assert!(number(row, 5).hypot(number(row, 6)) <= 0.5 * (1.0 + 1e-9));
    }
    let places: Vec<(f64, f64)> = rows
        .iter()
        .map(|row| (number(row, 0), number(row, 1)))
        .collect();
    assert!(places.is_sorted_by(|a, b| a < b));

    let grid = read(&results, "solution-002.vtu");
    for array in [
        "Name=\"displacement\" NumberOfComponents=\"3\"",
        "Name=\"stress\" NumberOfComponents=\"6\"",
        "Name=\"von_mises\" NumberOfComponents=\"1\"",
        "Name=\"contact_pressure\" NumberOfComponents=\"1\"",
        "Name=\"tangential_traction\" NumberOfComponents=\"3\"",
        "Name=\"contact_traction\" NumberOfComponents=\"3\"",
        "Name=\"contact_status\" NumberOfComponents=\"1\"",
        "NumberOfPoints=\"45\" NumberOfCells=\"16\"",
    ] {
        assert!(grid.contains(array), "{array}");
    }
    if cfg!(feature = "plots") {
        let page = read(&results, "report.html");
        assert!(
            page.contains("<th>force z (N)</th>") && page.contains("<svg"),
            "no forces"
        );
        for name in ["deformed-001", "deformed-002", "contact-001", "contact-002"] {
            let picture = read(&results, &format!("{name}.svg"));
            // The image may contain any letters.
            let drawn: String = picture
                .lines()
                .filter(|line| !line.contains("base64"))
                .collect();
            assert!(
                drawn.starts_with("<svg") && drawn.ends_with("</svg>"),
                "{name}"
            );
            assert!(!drawn.contains("NaN") && !drawn.contains("inf"), "{name}");
            assert!(drawn.contains("MPa"), "{name}");
            assert!(picture.contains("data:image/png;base64,"), "{name}");
        }
        let contact = read(&results, "contact-002.svg");
        for text in [
            "Seen through the body along the normal −z",
            "tangential traction on the body",
            "slip bound",
            "Along x, at y = ",
        ] {
            assert!(contact.contains(text), "{text}");
        }
        // The view that can be turned: of both steps, with nothing from outside.
        assert!(page.contains("id=\"bodies-data\"") && page.contains("\"name\":\"2\""));
        let outside = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!outside.contains("http"), "an address");
        assert_eq!(
            outside.matches("<script").count(),
            outside.matches("</script>").count()
        );
    }
}

/// The Matrix Market text of a dense matrix.
fn matrix(rows: &[&[f64]]) -> String {
    let columns = rows.first().map_or(0, |row| row.len());
    let mut text = format!(
        "%%MatrixMarket matrix array real general\n{} {columns}\n",
        rows.len()
    );
    for column in 0..columns {
        for row in rows {
            text += &format!("{:e}\n", row[column]);
        }
    }
    text
}

const ALGEBRAIC: &str = "[algebraic]\nstiffness = \"K.mtx\"\nload = \"f.mtx\"\nnormal = \"N.mtx\"\n\
    tangential = \"T.mtx\"\ngap = \"d.mtx\"\nslip_bound = \"g.mtx\"\n";

/// A point on springs of 2, 2 and 1 along x, y and z, pushed on the ground and along it by (6, 8); a fourth unknown
/// that nothing touches. Friction holds 5 of the 10.
fn point_on_springs(directory: &Path) {
    let k: [&[f64]; 4] = [
        &[2.0, 0.0, 0.0, 0.0],
        &[0.0, 2.0, 0.0, 0.0],
        &[0.0, 0.0, 1.0, 0.0],
        &[0.0, 0.0, 0.0, 4.0],
    ];
    write(directory, "K.mtx", &matrix(&k));
    write(
        directory,
        "f.mtx",
        &matrix(&[&[6.0], &[8.0], &[-3.0], &[2.0]]),
    );
    write(directory, "N.mtx", &matrix(&[&[0.0, 0.0, -1.0, 0.0]]));
    write(
        directory,
        "T.mtx",
        &matrix(&[&[1.0, 0.0, 0.0, 0.0], &[0.0, 1.0, 0.0, 0.0]]),
    );
    write(directory, "d.mtx", &matrix(&[&[1.0]]));
    write(directory, "g.mtx", &matrix(&[&[5.0]]));
    write(directory, "case.toml", ALGEBRAIC);
}

/// The numbers of a Matrix Market array file with one column.
fn vector(directory: &Path, name: &str) -> Vec<f64> {
    let text = read(directory, name);
    let numbers = text.lines().skip(2).map(str::parse);
    numbers
        .collect::<Result<_, _>>()
        .unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn matrices_with_two_tangents_a_node_are_a_problem_in_space() {
    let directory = directory();
    point_on_springs(directory.path());
    let output = signorini_in(
        directory.path(),
        &["solve", "case.toml", "--set", "solver.tolerance=1e-12"],
    );
    let log = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{log}");
    let results = directory.path().join("case-out");
    // 2 u = (6, 8) (1 − 5/10), u_z = −1, and 2 of 3 on the ground.
    close(&vector(&results, "u.mtx"), &[1.5, 2.0, -1.0, 0.5], 1e-9);
    close(&vector(&results, "lambda_normal.mtx"), &[2.0], 1e-9);
    close(
        &vector(&results, "lambda_tangential.mtx"),
        &[3.0, 4.0],
        1e-9,
    );
    let report: serde_json::Value = serde_json::from_str(&read(&results, "report.json")).or_panic();
    assert_eq!(
        (report["n"].as_u64(), report["m"].as_u64()),
        (Some(4), Some(1))
    );
    assert_eq!(report["sets"]["slip"].as_u64(), Some(1));
    // The unit of length has a name that fits into the tables.
    let text = format!("{ALGEBRAIC}[units]\nforce = \"k N\"\n");
    write(directory.path(), "case.toml", &text);
    let output = signorini_in(directory.path(), &["check", "case.toml"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("line 8: force = \"k N\" is not the short name"),
        "{told}"
    );
}

#[test]
fn matrices_of_neither_dimension_are_refused() {
    let directory = directory();
    let place = directory.path();
    let told = || {
        let output = signorini_in(place, &["solve", "case.toml"]);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    point_on_springs(place);
    let row: &[f64] = &[1.0, 0.0, 0.0, 0.0];
    write(place, "T.mtx", &matrix(&[row; 3]));
    let text = told();
    assert!(text.contains("T is 3 × 4, expected 1 × 4"), "{text}");

    point_on_springs(place);
    write(place, "x.mtx", &matrix(&[&[0.0, 0.0], &[1.0, 0.0]]));
    write(
        place,
        "case.toml",
        &format!("{ALGEBRAIC}coordinates = \"x.mtx\"\n"),
    );
    let text = told();
    assert!(
        text.contains("this is a problem in space, but the coordinates have two columns"),
        "{text}"
    );

    write(place, "T.mtx", &matrix(&[&[1.0, 0.0, 0.0, 0.0]]));
    write(
        place,
        "x.mtx",
        &matrix(&[&[0.0, 0.0, 0.0], &[1.0, 0.0, 0.0]]),
    );
    let text = told();
    assert!(
        text.contains("T has 1 rows like N: in space T needs two for each contact node, 2 in all"),
        "{text}"
    );
}

/// A bar under a torque and a force on its end: the reaction of its other end about its centre.
#[test]
fn supports_tell_the_moment_they_carry() {
    let directory = directory();
    let bar = "[mesh.box]\norigin = [-1, -1, 0]\nsize = [2, 2, 3]\ncells = [4, 4, 4]\n[[material]]\nyoung = 1e9\npoisson = 0.3\n\
        [[support]]\nboundary = \"bottom\"\nradial = 0\nhoop = 0\naxial = 0\naxis = { point = [0, 0, 0], direction = [0, 0, 1] }\n\
        [[traction]]\nboundary = \"top\"\ntorque = 1000\nforce = [50, 0, -200]\naxis = { point = [0, 0, 9], direction = [0, 0, 2] }\n\
        factors = [0.5, 1]\n[steps]\nfactors = [0.5, 1]\n";
    let report = solved(bar);
    for (step, factor) in [(0, 0.5), (1, 1.0)] {
        let support = &report["steps"][step]["supports"][0];
        close(&numbers(&support["centre"]), &[0.0; 3], 1e-12);
        let force = [-50.0 * factor, 0.0, 200.0 * factor];
        close(&numbers(&support["force"]), &force, 1e-6);
        // The force acts 3 above: its moment about y is 150.
        let moment = [0.0, -150.0 * factor, -1000.0 * factor];
        close(&numbers(&support["moment"]), &moment, 1e-5);
    }
    assert_eq!(report["steps"][0]["supports"][0]["support"], "bottom");
    write(directory.path(), "bar.toml", bar);
    let output = signorini_in(directory.path(), &["check", "bar.toml"]);
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let line = "support       \"bottom\": radial = 0, hoop = 0, axial = 0, about the axis through \
                [0.0, 0.0, 0.0] along [0.0, 0.0, 1.0]";
    assert!(text.contains(line), "{text}");
    let line = "torque        \"top\": 1000 N m about the axis through [0.0, 0.0, 9.0] along [0.0, 0.0, 2.0]";
    assert!(text.contains(line), "{text}");
}

/// A block pressed on another one and pushed along it, to and fro: forces and moments of the contact balance those of the
/// support above it and of the one below, and friction takes work.
#[test]
fn contacts_of_two_solids_tell_moment_and_work() {
    let case = "[[mesh.part]]\nname = \"low\"\nbox = { size = [2, 2, 1], cells = [4, 4, 2] }\n\
        [[mesh.part]]\nname = \"up\"\nbox = { origin = [0.5, 0.5, 1], size = [1, 1, 1], cells = [3, 3, 2], shape = \"tetrahedron\" }\n\
        [[material]]\nyoung = 1e7\npoisson = 0.3\n\
        [[support]]\nboundary = \"low-bottom\"\nx = 0\ny = 0\nz = 0\n\
        [[support]]\nboundary = \"up-top\"\ny = 0\nz = -0.01\n\
        [[support]]\nboundary = \"up-top\"\nx = 0.02\nfactors = [0, 1, -1]\n\
        [[contact]]\nboundary = \"up-bottom\"\nagainst = \"low-top\"\nfriction = { coulomb = 0.1 }\n\
        [steps]\nfactors = [1, 1, 1]\n";
    let report = solved(case);
    let cross = |a: &[f64], b: &[f64]| -> Vec<f64> {
        [(1, 2), (2, 0), (0, 1)]
            .map(|(i, j)| a[i] * b[j] - a[j] * b[i])
            .to_vec()
    };
    // Resultant and moment about the origin.
    let whole = |carried: &serde_json::Value| {
        let force = numbers(&carried["force"]);
        let lever = cross(&numbers(&carried["centre"]), &force);
        let moment = numbers(&carried["moment"]);
        let moment: Vec<f64> = moment.iter().zip(lever).map(|(m, l)| m + l).collect();
        [force, moment].concat()
    };
    for step in 0..3 {
        let step = &report["steps"][step];
        let contact = whole(&step["contacts"][0]);
        let supports: Vec<Vec<f64>> = (0..3).map(|k| whole(&step["supports"][k])).collect();
        let size = contact[2].abs();
        assert!(size > 1e3);
        for k in 0..6 {
            let above = contact[k] + supports[1][k] + supports[2][k];
            let below = -contact[k] + supports[0][k];
            assert!(
                above.abs() < 1e-5 * size && below.abs() < 1e-5 * size,
                "{k}: {above} {below}"
            );
        }
        close(
            &numbers(&step["contacts"][0]["centre"]),
            &[1.0, 1.0, 1.0],
            1e-6,
        );
    }
    let work = |step: usize| report["steps"][step]["contacts"][0]["slipping_work"].as_f64();
    let rubbed = |step: usize| report["steps"][step]["contacts"][0]["tangential_force"].as_f64();
    // It slides everywhere from the second step on, less by the compression of the blocks.
    for (step, way) in [(1, 0.02), (2, 0.04)] {
        let ratio = work(step).unwrap_or(0.0) / (rubbed(step).unwrap_or(0.0) * way);
        assert!(ratio > 0.8 && ratio < 1.05, "{ratio}");
    }
    assert!(work(0).is_some_and(|work| work >= 0.0));
}

/// A mesh of Abaqus is listed, written for Gmsh, and solved as it is.
#[test]
fn an_input_file_is_converted_and_solved() {
    let directory = directory();
    let body = "*NODE\n1, 0, 0, 0\n2, 1, 0, 0\n3, 1, 1, 0\n4, 0, 1, 0\n5, 0, 0, 1\n6, 1, 0, 1\n7, 1, 1, 1\n8, 0, 1, 1\n\
        *ELEMENT, TYPE=C3D8, ELSET=steel\n1, 1, 2, 3, 4, 5, 6, 7, 8\n*SURFACE, NAME=up\nsteel, S2\n*NSET, NSET=down\n1, 2, 3, 4\n\
        *NSET, NSET=corner\n1\n";
    write(directory.path(), "cube.inp", body);
    let output = signorini_in(
        directory.path(),
        &["convert", "cube.inp", "cube.msh", "--scale", "2"],
    );
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    for line in [
        "mesh          8 nodes, 1 hexahedra, 1 body; [0.0000e0, 2.0000e0]",
        "region        \"steel\": volume 8.0000e0",
        "boundary      \"up\": 1 faces",
        "boundary      \"corner\": 0 faces; a set of nodes, with one at (0.000000e0, 0.000000e0, 0.000000e0), that has all",
    ] {
        assert!(text.contains(line), "{line}\n{text}");
    }
    let case = |file: &str, scale: &str| {
        format!(
            "[mesh]\nfile = \"{file}\"\n{scale}[[material]]\nyoung = 1e6\npoisson = 0\n[[support]]\nboundary = \"down\"\nx = 0\ny = 0\nz = 0\n\
             [[traction]]\nboundary = \"up\"\nforce = [0, 0, -8]\n"
        )
    };
    for text in [case("cube.inp", "scale = 2\n"), case("cube.msh", "")] {
        let report = solved_in(directory.path(), &text);
        close(
            &numbers(&report["steps"][0]["supports"][0]["force"]),
            &[0.0, 0.0, 8.0],
            1e-6,
        );
    }
    for (arguments, expected) in [
        (
            vec!["convert", "cube.inp", "cube.vtu"],
            "only Gmsh meshes and, from a deck, case files are written: name the file .msh or .toml",
        ),
        (
            vec!["convert", "none.inp", "cube.msh"],
            "error: cannot read none.inp",
        ),
        (
            vec!["convert", "cube.inp", "cube.msh", "--scale", "0"],
            "--scale must be a positive number",
        ),
        (
            vec!["convert", "cube.inp", "cube.msh", "--cell-data", "a"],
            "--cell-data applies only to .vtu files",
        ),
    ] {
        let output = signorini_in(directory.path(), &arguments);
        let told = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.code() == Some(1) && told.contains(expected),
            "{told}"
        );
    }
    write(
        directory.path(),
        "bad.toml",
        &case("cube.inp", "cell_data = \"a\"\n"),
    );
    let output = signorini_in(directory.path(), &["check", "bad.toml"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains("bad.toml, line 1: cell_data applies only to .vtu files"),
        "{told}"
    );
    let held = case("cube.inp", "") + "[[traction]]\nboundary = \"corner\"\nx = 1\n";
    write(directory.path(), "corner.toml", &held);
    let output = signorini_in(directory.path(), &["check", "corner.toml"]);
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(
        told.contains(
            "no outer face has all of its corners in the nodes of \"corner\": name more sets"
        ),
        "{told}"
    );
}

/// Elements of second order: listed by `check`, counted in the report, and read back from the grid of a solution.
#[test]
fn elements_of_second_order_go_through_all_files() {
    let bent = "[mesh]\norder = 2\n[mesh.box]\nsize = [2, 1, 1]\ncells = [2, 1, 1]\nshape = \"SHAPE\"\n\
        map = [\"x\", \"y\", \"z + 0.1*x^2\"]\n[[material]]\nyoung = 3000\npoisson = 0.3\n\
        [[support]]\nboundary = \"left\"\nx = 0\ny = 0\nz = 0\n[[traction]]\nboundary = \"top\"\npressure = 2\n";
    for (shape, described, name, count, facets) in [
        ("hexahedron", "2 hexahedra with 27 nodes", "hex27", 2, 10),
        (
            "tetrahedron",
            "12 tetrahedra with 10 nodes",
            "tet10",
            12,
            20,
        ),
        ("wedge", "4 wedges with 18 nodes", "wedge18", 4, 14),
    ] {
        let directory = directory();
        let case = bent.replace("SHAPE", shape);
        let report = solved_in(directory.path(), &case);
        assert_eq!(report["elements"], serde_json::json!({ name: count }));
        assert_eq!(report["order"], 2);
        let told = |arguments: &[&str]| {
            let output = signorini_in(directory.path(), arguments);
            assert_eq!(
                output.status.code(),
                Some(0),
                "{:?}",
                String::from_utf8_lossy(&output.stderr)
            );
            String::from_utf8_lossy(&output.stdout).into_owned()
        };
        let mesh = format!("mesh          45 nodes, {described} (order 2), 1 body; ");
        let text = told(&["check", "case.toml"]);
        assert!(text.contains(&mesh), "{text}");
        // The volume is that of the map, whose sides are parabolas; the mesh read back has the same.
        let line = "region        \"body\": volume 2.0000e0";
        assert!(text.contains(line), "{text}");
        let text = told(&["convert", "out/solution.vtu", "back.msh"]);
        assert!(text.contains(&mesh), "{text}");
        assert!(
            text.contains("region        \"0\": volume 2.0000e0"),
            "{text}"
        );
        // Tetrahedra of first order lock near ν = 0.5, and have no form for it.
        for (order, told) in [(1, shape == "tetrahedron"), (2, false)] {
            let soft = case.replace("order = 2", &format!("order = {order}"));
            let soft = soft.replace("poisson = 0.3", "poisson = 0.49");
            let hints = solved(&soft)["hints"].to_string();
            assert_eq!(
                hints.contains("take order = 2, or hexahedra"),
                told,
                "{hints}"
            );
        }
        // The view has all parts of facets, and lines only along edges of elements.
        let plotted = [
            "solve",
            "case.toml",
            "--output",
            "plots",
            "--quiet",
            "--plots",
        ];
        told(&plotted);
        let page = read(&directory.path().join("plots"), "report.html");
        let (_, packed) = page.split_once("\"facets\":\"").expect("the view");
        let encoded = packed.split('"').next().unwrap_or_default();
        // Four numbers of four bytes each, in base64, for the parts at the nodes of each facet.
        assert_eq!(encoded.len(), (4 * 4 * 4 * facets as usize).div_ceil(3) * 4);
        let linear = told(&["check", "case.toml", "--set", "mesh.order=1"]);
        assert!(
            !linear.contains("order") && linear.contains("mesh          12 nodes, "),
            "{linear}"
        );
    }
}
