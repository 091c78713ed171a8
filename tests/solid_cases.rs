//! Cases of solids from their text to their files: closed forms, what is written, and what the program says.

use signorini::case::{AnyBuild, Build, Case};
use signorini::dual::DirectDual;
use signorini::model::{Elastic, StepData};
use signorini::output::{ContactFields, NodeStatus, Report, StepFields, StepReport};
use signorini::quasistatic::{self, Load, State, StepSolution};
use signorini::ssnm::Status;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Output};

/// A case in space, solved in one step.
struct Solved {
    build: Build<3>,
    data: Option<StepData<3>>,
    solution: StepSolution<3>,
}

fn solve(text: &str) -> Solved {
    let case = Case::parse(Path::new("tests/case.toml"), text.to_owned(), &[]);
    let case = case.unwrap_or_else(|error| panic!("{error}"));
    let build = match case.build_any() {
        Ok(AnyBuild::Space(build)) => build,
        Ok(AnyBuild::Plane(_)) => panic!("this is no case in space"),
        Err(error) => panic!("{error}"),
    };
    let data = (case.step(&build, 0)).unwrap_or_else(|error| panic!("{error}"));
    let load = match &data {
        Some(data) => data.load.clone(),
        None => Load::of(&build.problem),
    };
    let mut dual = DirectDual::new(&build.problem).unwrap_or_else(|error| panic!("{error}"));
    let mut settings = case.settings();
    settings.ssnm.tolerance = 1e-12;
    let start = State::at_rest(&build.problem);
    let solution =
        quasistatic::solve_step(&build.problem, &load, &start, &mut dual, &settings, |_| {
            ControlFlow::Continue(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(solution.status, Status::Converged);
    Solved {
        build,
        data,
        solution,
    }
}

impl Solved {
    fn elastic(&self) -> &Elastic<3> {
        self.build.elastic.as_ref().expect("an elastic case")
    }

    fn data(&self) -> &StepData<3> {
        self.data.as_ref().expect("an elastic case")
    }

    fn fields(&self) -> ContactFields<3> {
        ContactFields::new(&self.build, self.elastic(), self.data(), &self.solution)
    }

    /// What the report says of the step.
    fn report(&self) -> StepReport {
        let mut report = Report::new("", &self.build);
        report.add_step(&self.build, self.data.as_ref(), &self.solution);
        report.steps.remove(0)
    }
}

#[track_caller]
fn close(values: &[f64], expected: &[f64], tolerance: f64) {
    assert_eq!(values.len(), expected.len());
    for (value, expected) in values.iter().zip(expected) {
        assert!(
            (value - expected).abs() <= tolerance,
            "{value:e}, not {expected:e}"
        );
    }
}

/// Boxes of all shapes, one of them bent, one a part that is moved.
const MESHES: [&str; 5] = [
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [4, 2, 3]\n",
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [3, 2, 2]\nshape = \"tetrahedron\"\n",
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [3, 3, 2]\nshape = \"wedge\"\n",
    "[mesh.box]\norigin = [1, 2, 0]\nsize = [2, 1, 1.5]\ncells = [4, 3, 3]\nshape = \"tetrahedron\"\n\
     map = [\"x + 0.2*(x - 1)*(3 - x)\", \"y + 0.04*sin(pi*(y - 2))*x*(1.5 - z)\", \"z*(0.7 + 0.2*z)\"]\n",
    "[[mesh.part]]\nname = \"only\"\nshift = [1, 2, 0]\nbox = { size = [2, 1, 1.5], cells = [4, 2, 3] }\n",
];

/// A block pressed on the ground has the pressure of the load everywhere.
#[test]
fn uniform_pressure_is_uniform_in_space() {
    let (e, nu, p) = (3000.0, 0.4, 10.0);
    for (i, mesh) in MESHES.iter().enumerate() {
        let prefix = if i == 4 { "only-" } else { "" };
        let solved = solve(&format!(
            "{mesh}[[material]]\nyoung = {e}\npoisson = {nu}\n\
             [[support]]\nboundary = \"{prefix}left\"\nsymmetry = true\n\
             [[support]]\nboundary = \"{prefix}front\"\ny = 0\n\
             [[traction]]\nboundary = \"{prefix}top\"\npressure = {p}\n\
             [[contact]]\nboundary = \"{prefix}bottom\"\n\
             obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [0, 0, 3] }} }}\n"
        ));
        let fields = solved.fields();
        assert!(fields.pressure.len() > 8);
        for (i, pressure) in fields.pressure.iter().enumerate() {
            assert!((pressure - p).abs() < 1e-8, "{pressure}");
            assert_eq!(fields.status(i), NodeStatus::Frictionless);
        }
        let of_step = StepFields::new(solved.elastic(), solved.data(), &solved.solution);
        for (x, u) in solved
            .elastic()
            .mesh
            .nodes
            .iter()
            .zip(&of_step.displacement)
        {
            let expected = [
                nu * p / e * (x[0] - 1.0),
                nu * p / e * (x[1] - 2.0),
                -p / e * x[2],
            ];
            close(u, &expected, 1e-11);
        }
        for s in of_step.at_nodes.iter().chain(&of_step.in_elements) {
            close(
                &[s.xx, s.yy, s.zz, s.xy, s.yz, s.zx],
                &[0.0, 0.0, -p, 0.0, 0.0, 0.0],
                1e-8,
            );
            close(&[s.von_mises()], &[p], 1e-8);
        }
        let report = solved.report();
        let (contact, force) = (&report.contacts[0], p * 2.0);
        assert_eq!(contact.against, "rigid half-space");
        close(&contact.force, &[0.0, 0.0, force], 1e-8);
        close(&[contact.normal_force, contact.area], &[force, 2.0], 1e-8);
        assert_eq!(report.total_load.as_ref().map(Vec::len), Some(3));
        for support in &report.supports {
            close(&support.force, &[0.0; 3], 1e-8);
        }
    }
}

/// The weight of a block that stands on the ground and leans on a wall is what ground and wall carry.
#[test]
fn weight_is_what_reactions_add_up_to() {
    let (density, volume) = (2.0, 3.0);
    for shape in ["hexahedron", "tetrahedron", "wedge"] {
        let case = |floor: &str| {
            format!(
                "[mesh.box]\nsize = [2, 1, 1.5]\ncells = [4, 2, 3]\nshape = \"{shape}\"\n\
                 [analysis]\ngravity = [0, -1, -10]\n\
                 [[material]]\nyoung = 1e5\npoisson = 0.3\ndensity = {density}\n{floor}\
                 [[contact]]\nboundary = \"front\"\n\
                 obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [0, 1, 0] }} }}\n"
            )
        };
        let weight = density * volume * 10.0;
        // A support below: the wall takes what pushes towards it.
        let report = solve(&case("[[support]]\nboundary = \"bottom\"\nx = 0\nz = 0\n")).report();
        close(
            report.total_load.as_deref().unwrap_or(&[]),
            &[0.0, -0.1 * weight, -weight],
            1e-9,
        );
        close(&report.supports[0].force, &[0.0, 0.0, weight], 1e-7);
        close(&report.contacts[0].force, &[0.0, 0.1 * weight, 0.0], 1e-7);
        // Ground and wall, and nothing else but what keeps it from sliding away along both.
        let ground = "[[support]]\nboundary = \"left\"\nx = 0\n[[contact]]\nboundary = \"bottom\"\n\
                      obstacle = { half_space = { point = [0, 0, 0], normal = [0, 0, 1] } }\n";
        let solved = solve(&case(ground));
        assert_eq!(solved.build.problem.free_bodies().n_motions(), 3);
        let report = solved.report();
        close(&report.supports[0].force, &[0.0; 3], 1e-6);
        close(&report.contacts[0].force, &[0.0, 0.0, weight], 1e-6);
        close(&report.contacts[1].force, &[0.0, 0.1 * weight, 0.0], 1e-6);
    }
}

/// A block on a slope, pressed against it and dragged along it: tractions along the axes, whatever the tangents are.
#[test]
fn tractions_are_vectors_along_the_axes() {
    // Turned by atan(3/4) about y: the block lies on the plane with the normal (-0.6, 0, 0.8).
    let (bound, p) = (4.0, 10.0);
    let solved = solve(&format!(
        "[mesh.box]\nsize = [2, 1, 1]\ncells = [4, 2, 2]\nmap = [\"0.8*x - 0.6*z\", \"y\", \"0.6*x + 0.8*z\"]\n\
         [[material]]\nyoung = 1e5\npoisson = 0\n\
         [[traction]]\nboundary = \"top\"\npressure = {p}\nx = {}\ny = {}\nz = {}\n\
         [[support]]\nboundary = \"left\"\nx = 0\ny = 0\nz = 0\n\
         [[contact]]\nboundary = \"bottom\"\nfriction = {{ tresca = {bound} }}\n\
         obstacle = {{ half_space = {{ point = [0, 0, 0], normal = [-0.6, 0, 0.8] }} }}\n",
        // 40 along the slope and 30 across it: more than friction can hold.
        40.0 * 0.8,
        30.0,
        40.0 * 0.6,
    ));
    let fields = solved.fields();
    let mut sum = [0.0; 3];
    let mut slipping = 0;
    for (i, node) in solved.elastic().contact.nodes.iter().enumerate() {
        let [pressed, rubbed] = fields.traction_vectors(i);
        let out = [-0.6, 0.0, 0.8];
        close(&pressed, &out.map(|v| v * fields.pressure[i]), 1e-9 * p);
        let along: f64 = rubbed.iter().zip(out).map(|(t, n)| t * n).sum();
        close(&[along], &[0.0], 1e-12 * p);
        let size = rubbed.iter().map(|t| t * t).sum::<f64>().sqrt();
        close(
            &[size],
            &[fields.traction[2 * i].hypot(fields.traction[2 * i + 1])],
            1e-12 * p,
        );
        assert!(size <= bound * (1.0 + 1e-9));
        if fields.status(i) == NodeStatus::Slip {
            slipping += 1;
            close(&[size], &[bound], 1e-9);
            // Against the slip: no part of one is along the other.
            let slip = &fields.slip[2 * i..][..2];
            let traction = &fields.traction[2 * i..][..2];
            let dot = slip[0] * traction[0] + slip[1] * traction[1];
            let expected = -bound * slip[0].hypot(slip[1]);
            close(&[dot], &[expected], 1e-6 * expected.abs());
        }
        for c in 0..3 {
            sum[c] += node.area * (pressed[c] + rubbed[c]);
        }
    }
    assert!(slipping > 5, "{slipping}");
    let report = solved.report();
    close(&report.contacts[0].force, &sum, 1e-9);
    // All forces together.
    let load = report.total_load.unwrap_or_default();
    let total: Vec<f64> = (0..3)
        .map(|c| load[c] + sum[c] + report.supports[0].force[c])
        .collect();
    close(&total, &[0.0; 3], 1e-8);
    let tangential: f64 = (sum.iter().zip([-0.6, 0.0, 0.8]))
        .map(|(f, n)| f - report.contacts[0].normal_force * n)
        .map(|f| f * f)
        .sum();
    close(
        &[report.contacts[0].tangential_force],
        &[tangential.sqrt()],
        1e-9,
    );
}

/// A sphere and a cylinder in the way of a block: the contact ends where they bend away.
#[test]
fn round_obstacles_stop_a_block() {
    for obstacle in [
        "sphere = { center = [0.5, 0.5, -20], radius = 20 }",
        "cylinder = { point = [0.5, 0, -20], axis = [0, 2, 0], radius = 20 }",
    ] {
        let solved = solve(&format!(
            "[mesh.box]\nsize = [1, 1, 0.5]\ncells = [10, 10, 4]\n\
             [[material]]\nyoung = 1e6\npoisson = 0.3\n\
             [[support]]\nboundary = \"top\"\nx = 0\ny = 0\nz = -1e-3\n\
             [[contact]]\nboundary = \"bottom\"\nobstacle = {{ {obstacle} }}\n"
        ));
        let fields = solved.fields();
        let elastic = solved.elastic();
        let sphere = obstacle.starts_with("sphere");
        assert_eq!(
            elastic.pairs[0].against,
            if sphere {
                "rigid sphere"
            } else {
                "rigid cylinder"
            }
        );
        let at = |x: f64, y: f64| {
            let there = |node: &&signorini::contact::ContactNode<3>| {
                let place = elastic.mesh.nodes[node.node as usize];
                (place[0] - x).abs() + (place[1] - y).abs() < 1e-9
            };
            let row = elastic.contact.nodes.iter().position(|node| there(&node));
            fields.pressure[row.unwrap_or_else(|| panic!("no node at {x}, {y}"))]
        };
        assert!(at(0.5, 0.5) > 100.0);
        assert_eq!(at(0.0, 0.5), 0.0);
        assert_eq!(at(0.5, 0.0) == 0.0, sphere);
        // As symmetric as the mesh and the obstacle.
        close(&[at(0.4, 0.4)], &[at(0.6, 0.6)], 1e-6);
        if sphere {
            assert!(at(0.4, 0.5) > 0.0);
            close(&[at(0.4, 0.5)], &[at(0.5, 0.4)], 1e-6);
        }
    }
}

fn run(arguments: &[&str], directory: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_signorini"))
        .args(arguments)
        .current_dir(directory)
        .output()
        .unwrap_or_else(|error| panic!("{error}"))
}

fn directory() -> tempfile::TempDir {
    tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"))
}

fn write(directory: &Path, name: &str, text: &str) {
    std::fs::write(directory.join(name), text).unwrap_or_else(|error| panic!("{error}"));
}

fn read(directory: &Path, name: &str) -> String {
    std::fs::read_to_string(directory.join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
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
    let output = run(&["check", "block.toml"], directory.path());
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
        "contact       \"bottom\" / rigid half-space: 12 nodes, 1.7500e0 mm²",
        "size          108 unknowns, 12 contact nodes",
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
    let output = run(&["solve", "block.toml", "--plots"], directory.path());
    let (out, log) = (
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr),
    );
    assert_eq!(output.status.code(), Some(0), "{log}");
    if cfg!(feature = "plots") {
        assert_eq!(
            log.matches("pictures of solids are not there yet").count(),
            1,
            "{log}"
        );
    }
    assert!(
        out.contains("contact bottom / rigid half-space: force on the first ("),
        "{out}"
    );
    let results = directory.path().join("block-out");
    let report: serde_json::Value = serde_json::from_str(&read(&results, "report.json"))
        .unwrap_or_else(|error| panic!("{error}"));
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

    // contact.csv says the same: the pressures and tractions of its nodes, and their columns along the axes.
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
        assert!(
            results.join("convergence.svg").exists() && !results.join("deformed-001.svg").exists()
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
    let output = run(
        &["solve", "case.toml", "--set", "solver.tolerance=1e-12"],
        directory.path(),
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
    let report: serde_json::Value = serde_json::from_str(&read(&results, "report.json"))
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        (report["n"].as_u64(), report["m"].as_u64()),
        (Some(4), Some(1))
    );
    assert_eq!(report["sets"]["slip"].as_u64(), Some(1));
    // The unit of length has a name that fits into the tables.
    let text = format!("{ALGEBRAIC}[units]\nforce = \"k N\"\n");
    write(directory.path(), "case.toml", &text);
    let output = run(&["check", "case.toml"], directory.path());
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
        let output = run(&["solve", "case.toml"], place);
        assert_eq!(output.status.code(), Some(1));
        String::from_utf8_lossy(&output.stderr).into_owned()
    };
    point_on_springs(place);
    write(place, "T.mtx", &matrix(&[&[1.0, 0.0, 0.0, 0.0]; 3]));
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
        text.contains("T has 1 rows like N: there it has two for each contact node, 2 in all"),
        "{text}"
    );
}
