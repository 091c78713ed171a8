//! Several ranks against one process, under `mpirun`: `sh tests/mpi.sh` installs what this needs and runs it.
//!
//! The references are the program in one process, by the factor, and for a problem from matrices the conditions themselves. The
//! same executable runs on the ranks where a library call is tested.

mod kinds;
mod rows;
mod run;

use run::{
    NODAL, Solved, TOLERANCE, compare, conditions_of_matrices, mpirun, numbers, report, signorini,
    solved,
};
use std::path::{Path, PathBuf};

fn main() {
    if let Ok(role) = std::env::var(rows::ROLE) {
        rows::rank(&role);
        return;
    }
    let only: Vec<String> = std::env::args()
        .skip(1)
        .filter(|arg| !arg.starts_with('-'))
        .collect();
    let tests: [(&str, fn()); 14] = [
        ("the_templates", the_templates),
        ("iterations", iterations),
        ("kinds", kinds::kinds),
        ("gpus", gpus),
        ("matrices", matrices),
        ("the_same_bits", the_same_bits),
        ("pieces_are_whole", pieces_are_whole),
        ("ranks_without_unknowns", ranks_without_unknowns),
        ("faults", faults),
        ("not_held", not_held),
        ("foreseen", foreseen),
        ("limits", limits),
        ("launchers", launchers),
        ("own_rows", rows::own_rows),
    ];
    for only in &only {
        let known = tests.iter().any(|(name, _)| name.contains(only.as_str()));
        assert!(known, "there is no test {only}");
    }
    for (name, test) in tests {
        if only.is_empty() || only.iter().any(|only| name.contains(only.as_str())) {
            println!("test {name} ...");
            test();
            println!("test {name} ... ok");
        }
    }
}

fn example(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("examples")
        .join(name)
}

/// Every example, in the plane and in space: Tresca, Coulomb with steps, bodies that only contact holds, supports along directions of
/// their own, second order, a drawn overlap. (shear.toml is left out: conjugate gradients need from 88 to 1200 steps for it in one
/// process, too, for tolerances from 1e-6 to 1e-7.)
fn the_templates() {
    let mut names: Vec<String> = std::fs::read_dir(example(""))
        .expect("examples")
        .map(|entry| {
            entry
                .expect("an entry")
                .file_name()
                .to_string_lossy()
                .into_owned()
        })
        .filter(|name| name.ends_with(".toml") && name != "shear.toml")
        .filter(|name| {
            // Several ranks solve small displacements only, and no cycles.
            let case = std::fs::read_to_string(example(name)).expect("a template");
            !case.contains("geometry = \"large\"") && !case.contains("cycles =")
        })
        .collect();
    names.sort();
    assert!(names.len() >= 10, "{names:?}");
    for name in names {
        // The largest take several seconds for each.
        let ranks: &[usize] = match name.as_str() {
            "ball-joint.toml" => &[4],
            "brake.toml" => &[3],
            _ => &[2, 3, 4],
        };
        compare(&example(&name), ranks);
    }
    // One rank is one process.
    let place = tempfile::tempdir().expect("a directory");
    let mut one = signorini("solve");
    one.arg(example("press.toml")).args(["--quiet", "--output"]);
    mpirun(1, one.arg(place.path()));
    assert_eq!(report(place.path()).report["backend"], "cpu");
}

/// Ranks that compute on an adapter each, in both precisions, take the steps of those that compute on their processors, to the
/// same forces: the plane, space, second order, own levels above those of PETSc, bodies that only contact holds. ([`matrices`] has those of matrices.)
fn gpus() {
    let place = tempfile::tempdir().expect("a directory");
    let fine = place.path().join("fine.toml");
    let case_c = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/case-c.toml");
    let text = std::fs::read_to_string(case_c).expect("the case");
    std::fs::write(&fine, text.replace("[144, 48, 48]", "[24, 8, 8]")).expect("a case");
    let second = place.path().join("second.toml");
    let text = std::fs::read_to_string(&fine).expect("the case");
    let text = text.replace("[24, 8, 8]", "[9, 4, 4]");
    std::fs::write(&second, format!("mesh.order = 2\n{text}")).expect("a case");
    for (case, ranks) in [
        (example("roller.toml"), 2),
        (example("ball.toml"), 3),
        (example("collar.toml"), 4),
        (fine.clone(), 2),
        (fine, 1),
        (second, 2),
    ] {
        let run = |backend: &[&str]| {
            let place = tempfile::tempdir().expect("a directory");
            solved(Some(ranks), &case, backend, place.path())
        };
        let processors = run(&["--backend", "cpu"]);
        for precision in ["f64", "f32"] {
            let found = run(&["--backend", "gpu", "--precision", precision]);
            let adapters = &found.report["ranks"]["adapters"];
            assert_eq!(adapters.as_array().map(Vec::len), Some(ranks), "{adapters}");
            assert_eq!(found.report["precision"], precision);
            let costs = ["iter", "n_A", "v_cycles"]
                .map(|key| [&found, &processors].map(|run| run.report[key].as_f64().expect(key)));
            let (forces, expected) = (found.forces(), processors.forces());
            let size = expected
                .iter()
                .fold(1e-300_f64, |most, v| most.max(v.abs()));
            let off = (forces.iter().zip(&expected)).map(|(a, b)| (a - b).abs());
            let off = off.fold(0.0, f64::max) / size;
            println!(
                "  {} on {ranks} in {precision}: forces {off:.1e}; {} steps, {} on processors",
                case.display(),
                costs[0][0],
                costs[0][1]
            );
            assert_eq!(forces.len(), expected.len());
            // In f64 only the order of sums differs.
            let most = if precision == "f64" { 1.0 } else { 3.0 };
            for [found, expected] in &costs[..2] {
                assert!((found - expected).abs() <= most, "{costs:?}");
            }
            let [found, expected] = costs[2];
            assert!((found - expected).abs() <= 0.1 * expected, "{costs:?}");
            assert!(off <= TOLERANCE, "{off:e}");
        }
    }
}

/// u and λ of a problem from matrices obey its conditions, which are checked from the files alone.
fn matrices() {
    for (ranks, backend) in [(2, "cpu"), (4, "cpu"), (2, "gpu")] {
        let place = tempfile::tempdir().expect("a directory");
        let run = solved(
            Some(ranks),
            &example("matrices/block.toml"),
            &["--backend", backend],
            place.path(),
        );
        let worst = conditions_of_matrices(&example("matrices"), &run.directory);
        assert!(worst <= 10.0 * TOLERANCE, "{worst:e}");
        println!("  on {ranks}, {backend}: conditions to {worst:.1e}");
    }
}

/// Two runs on the same number of ranks write the same numbers, to the last digit: contact tables and the fields of all pieces.
fn the_same_bits() {
    for (name, ranks) in [
        ("dovetail.toml", 2),
        ("bracket-3d.toml", 3),
        ("roller.toml", 4),
    ] {
        let places = [0, 1].map(|_| tempfile::tempdir().expect("a directory"));
        let files = places.each_ref().map(|place| {
            solved(Some(ranks), &example(name), &[], place.path());
            let mut files: Vec<(String, Vec<u8>)> = std::fs::read_dir(place.path())
                .expect("a directory")
                .map(|entry| entry.expect("an entry").path())
                .filter(|path| !path.ends_with("report.json"))
                .map(|path| {
                    (
                        path.file_name()
                            .expect("a name")
                            .to_string_lossy()
                            .into_owned(),
                        std::fs::read(&path).expect("a file"),
                    )
                })
                .collect();
            files.sort();
            files
        });
        assert!(files[0].len() > ranks, "{name}");
        for (a, b) in files[0].iter().zip(&files[1]) {
            assert_eq!(a.0, b.0);
            assert!(
                a.1 == b.1,
                "{name} on {ranks}: {} differs from run to run",
                a.0
            );
        }
    }
}

/// The pieces of all ranks have the elements of the whole mesh, and displacements, stresses and pressures at its nodes as in one process,
/// also where elements of several ranks meet, with temperatures, and at the sides of sectors.
fn pieces_are_whole() {
    pieces_of(&example("press.toml"), 4, "");
    let place = tempfile::tempdir().expect("a directory");
    for (name, step) in [
        (kinds::WARM, "-002"),
        (kinds::NODAL, ""),
        (kinds::FIT, "-002"),
    ] {
        pieces_of(&kinds::case(name, place.path()), 3, step);
    }
}

fn pieces_of(case: &Path, ranks: usize, step: &str) {
    let place = tempfile::tempdir().expect("a directory");
    let alone = solved(
        None,
        case,
        &["--stiffness", "cholesky"],
        &place.path().join("alone"),
    );
    let shared = solved(Some(ranks), case, &[], &place.path().join("shared"));
    let whole = run::Grid::read(&alone.directory.join(format!("solution{step}.vtu")));
    let index = shared.directory.join(format!("solution{step}.pvtu"));
    let index = std::fs::read_to_string(index).expect("an index");
    let mut cells = 0;
    // Stresses are as accurate as pressures.
    let accuracies = [10.0 * TOLERANCE, NODAL, NODAL];
    for rank in 0..ranks {
        let name = format!("solution{step}-p{rank}.vtu");
        assert!(
            index.contains(&format!("<Piece Source=\"{name}\"/>")),
            "{index}"
        );
        let piece = run::Grid::read(&shared.directory.join(name));
        cells += piece.cells;
        for (point, here) in &piece.nodes {
            let there = &whole.nodes[point];
            for (a, b) in here.iter().zip(there) {
                let scale = whole.largest(b.0);
                assert!(
                    (a.1 - b.1).abs() <= accuracies[b.0] * scale,
                    "{}: {point:?} {a:?} {b:?}",
                    case.display()
                );
            }
        }
    }
    assert_eq!(cells, whole.cells);
}

/// Two free nodes on four ranks.
fn ranks_without_unknowns() {
    let place = tempfile::tempdir().expect("a directory");
    let case = place.path().join("tiny.toml");
    std::fs::write(&case, TINY).expect("a case");
    let direct = solved(None, &case, &["--stiffness", "cholesky"], place.path());
    let alone = std::fs::read(place.path().join("solution.vtu")).expect("a file");
    let shared = solved(Some(4), &case, &[], place.path());
    std::fs::write(place.path().join("solution.vtu"), alone).expect("a file");
    assert!(numbers(&shared.report["ranks"]["unknowns"]).contains(&0.0));
    for (a, b) in shared.forces().iter().zip(direct.forces()) {
        assert!((a - b).abs() < 10.0, "{a} {b}");
    }
    // Each piece has the arrays of the whole file, or it cannot be shown.
    let arrays = |file: &str| -> Vec<String> {
        let text = std::fs::read_to_string(place.path().join(file)).expect("a file");
        let names = text.split("Name=\"").skip(1);
        names
            .map(|rest| rest.split('"').next().unwrap_or_default().to_owned())
            .collect()
    };
    let whole = arrays("solution.vtu");
    assert!(whole.iter().any(|name| name == "sliding_distance"));
    for rank in 0..4 {
        assert_eq!(arrays(&format!("solution-p{rank}.vtu")), whole, "{rank}");
    }
}

/// Multigrid takes as many iterations as in one process, on stretched hexahedra, and on tetrahedra and hexahedra of second order;
/// and so does the contact.
fn iterations() {
    let place = tempfile::tempdir().expect("a directory");
    let place = place.path();
    for (name, order, linear, cells) in [
        ("stretched", 1, 0.2, "cells = [24, 24, 12]"),
        ("hex20", 2, 0.7, "cells = [12, 12, 6]"),
        (
            "tet10",
            2,
            0.7,
            "cells = [12, 8, 4]\nshape = \"tetrahedron\"",
        ),
    ] {
        let case = place.join(format!("{name}.toml"));
        // The part of cells that does not grow with the distance from the corner.
        let map = ["x", "y", "z"].map(|x| format!("{linear}*{x} + {}*{x}^3", 1.0 - linear));
        let mesh = format!("[mesh]\norder = {order}\n[mesh.box]\n{cells}\nmap = {map:?}");
        std::fs::write(&case, format!("{mesh}{PRESSED}")).expect("a case");
        let counts = |ranks: Option<usize>, more: &[&str]| {
            let run = solved(ranks, &case, more, &place.join("out"));
            ["v_cycles_linear", "iter"].map(|key| run.report[key].as_f64().expect(key))
        };
        let [alone, steps] = counts(None, &["--stiffness", "pcg", "--backend", "cpu"]);
        for ranks in [1, 2, 8] {
            let [found, steps_there] = counts(Some(ranks), &[]);
            println!(
                "  {name} on {ranks}: {found} iterations, {alone} in one process; {steps_there} and {steps} steps"
            );
            assert!((found - alone).abs() <= 2.0, "{name} on {ranks}");
            assert!(steps_there <= steps + 3.0, "{name} on {ranks}");
        }
    }
}

const PRESSED: &str = r#"
size = [1, 1, 1]
[[material]]
young = 2e11
poisson = 0.3
[[support]]
boundary = "top"
x = 0
y = 0
z = -1e-4
[[contact]]
boundary = "bottom"
obstacle = { half_space = { point = [0, 0, 0], normal = [0, 0, 1] } }
friction = { coulomb = 0.3 }
"#;

const TINY: &str = r#"
[mesh.rectangle]
size = [1, 1]
cells = [1, 1]
[[material]]
young = 1e9
poisson = 0.3
[[support]]
boundary = "left"
x = 0
y = 0
[[traction]]
boundary = "top"
y = -1e6
[[contact]]
boundary = "bottom"
obstacle = { half_plane = { point = [0, 0], normal = [0, 1] } }
friction = { coulomb = 0.3 }
"#;

/// A fault is reported once, with the exit code of an error.
fn faults() {
    let place = tempfile::tempdir().expect("a directory");
    let case = place.path().join("case.toml");
    let told_by = |command: &str, text: &str, more: &[&str], expected: &str| {
        std::fs::write(&case, text).expect("a case");
        let run = mpirun(3, signorini(command).arg(&case).args(more));
        let said = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{said}");
        assert_eq!(said.matches("error: ").count(), 1, "{said}");
        assert!(said.contains(expected), "{said}");
    };
    let told = |text: &str, more: &[&str], expected: &str| told_by("solve", text, more, expected);
    told(
        &TINY.replace("-1e6", "\"1 / (x - x)\""),
        &[],
        "no finite value",
    );
    // A body that its supports do not hold, without a contact.
    let loose = TINY
        .replace("x = 0\n", "")
        .split("[[contact]]")
        .next()
        .expect("a text")
        .to_owned();
    for command in ["solve", "check"] {
        told_by(command, "[mesh", &[], "case.toml");
        told_by(
            command,
            &TINY.replace("\"left\"", "\"lefty\""),
            &[],
            "line 8: there is no boundary \"lefty\"",
        );
        told_by(command, &loose, &[], "no contact to hold it");
    }
    told(TINY, &["--stiffness", "cholesky"], "leave it out");
    // Each rank looks for an adapter, and may tell of it; the first one to do so ends all.
    std::fs::write(&case, TINY).expect("a case");
    let mut command = signorini("solve");
    command
        .arg(&case)
        .args(["--backend", "gpu", "--adapter", "nosuch"]);
    let run = mpirun(3, &mut command);
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{said}");
    assert!(
        said.contains("no adapter has \"nosuch\" in its name"),
        "{said}"
    );
    told(TINY, &["--output", "/dev/null/out"], "cannot write");
    // Wrong usage, too.
    let run = mpirun(3, signorini("solve").arg("--nosuch"));
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert_eq!(said.matches("error: ").count(), 1, "{said}");
    // A piece that cannot be written: the report names it.
    let out = place.path().join("out");
    std::fs::create_dir_all(out.join("solution-p1.vtu/full")).expect("a directory");
    std::fs::write(&case, TINY).expect("a case");
    let run = mpirun(2, signorini("solve").arg(&case).arg("--output").arg(&out));
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{said}");
    let report = report(&out).report;
    let told = report["error"].as_str().unwrap_or_default();
    assert!(told.contains("solution-p1.vtu"), "{report}");
    // A panic of one rank ends all of them.
    let run = mpirun(3, rows::command("panic"));
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{said}");
    assert_eq!(said.matches("error: rank 1:").count(), 1, "{said}");
}

/// A body that nothing holds ends a run as in one process; hints are about all of the mesh.
fn not_held() {
    let tiny = TINY.replace("cells = [1, 1]", "cells = [8, 8]");
    let lifted = tiny
        .replace("-1e6", "1e6")
        .replace("[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n", "");
    let stiff = tiny.replace("poisson = 0.3", "poisson = 0.49");
    // Pushed over, as if rotations were small.
    let soft = tiny
        .replace("1e9", "1e6")
        .replace("left", "bottom")
        .replace("y = -1e6", "x = 6e5");
    let soft = soft.split("[[contact]]").next().expect("a text").to_owned()
        + "[[contact]]
boundary = \"right\"
obstacle = { half_plane = { point = [3, 0], normal = [-1, 0] } }
friction = { coulomb = 0.3 }
";
    let told = |text: &str, more: &[&str], ranks: Option<usize>| {
        let place = tempfile::tempdir().expect("a directory");
        let case = place.path().join("case.toml");
        std::fs::write(&case, text).expect("a case");
        let out = place.path().join("out");
        let mut command = signorini("solve");
        let all = ["--quiet", "--output"];
        command.arg(&case).args(more).args(all).arg(&out);
        let run = match ranks {
            Some(ranks) => mpirun(ranks, &mut command),
            None => command.output().expect("the program"),
        };
        (run.status.code(), report(&out).report)
    };
    for (text, more) in [
        (lifted.as_str(), &[][..]),
        (&stiff, &["--set", "mesh.rectangle.shape=\"triangle\""]),
        (&soft, &[]),
    ] {
        let (code, alone) = told(text, more, None);
        for ranks in [2, 3, 4] {
            let (found, report) = told(text, more, Some(ranks));
            assert_eq!(found, code, "{report}");
            for key in ["status", "hints", "elements"] {
                assert_eq!(report[key], alone[key], "{key} on {ranks}");
            }
        }
        let expected = if text == lifted {
            "not_held"
        } else {
            "converged"
        };
        assert_eq!(alone["status"], expected);
        assert!(
            text == lifted
                || alone["hints"].to_string().contains("far too stiff")
                || text == soft && alone["hints"].to_string().contains("has turned by"),
            "{alone}"
        );
    }
}

/// The forecast of `check` for each rank is correct: the unknowns, and roughly the memory.
fn foreseen() {
    for (case, ranks) in [
        ("ball.toml", 2),
        ("roller.toml", 4),
        ("matrices/block.toml", 2),
    ] {
        let place = tempfile::tempdir().expect("a directory");
        let solved = solved(Some(ranks), &example(case), &[], place.path()).report;
        let check = mpirun(ranks, signorini("check").arg(example(case)));
        let said = String::from_utf8_lossy(&check.stdout).into_owned();
        assert_eq!(check.status.code(), Some(0), "{said}");
        let told: Vec<Vec<f64>> = (said.lines().filter(|line| line.starts_with("rank ")))
            .map(|line| {
                let words = line.split_whitespace();
                words.filter_map(|word| word.parse().ok()).collect()
            })
            .collect();
        assert_eq!(told.len(), ranks, "{said}");
        let of = |key: &str| numbers(&solved["ranks"][key]);
        for (told, (unknowns, peak)) in told
            .iter()
            .zip(of("unknowns").into_iter().zip(of("peak_memory_mib")))
        {
            println!("  {case} on {ranks}: {told:?}, {unknowns} unknowns and {peak:.0} MiB");
            assert_eq!(told[1], unknowns, "{said}");
            assert!((0.7..1.4).contains(&(peak / told[2])), "{peak} MiB: {said}");
        }
        let dividing = said.lines().find(|line| line.starts_with("dividing"));
        let dividing = dividing.map(|line| {
            let mut words = line.split_whitespace();
            words
                .find_map(|word| word.parse::<f64>().ok())
                .expect("mebibytes")
        });
        match (dividing, solved["ranks"]["root_mib"].as_f64()) {
            (Some(told), Some(peak)) => {
                println!("  {case}: {told} MiB while it is divided, {peak:.0} MiB");
                assert!((0.7..1.2).contains(&(peak / told)), "{peak} MiB: {said}");
            }
            (told, _) => assert!(told.is_none() && case.starts_with("matrices"), "{said}"),
        }
    }
}

/// An expired time limit, and a limit of steps: the exit code for no convergence, with everything written.
fn limits() {
    for (setting, status) in [
        ("solver.time_limit=\"1ms\"", "time_limit"),
        ("solver.max_iterations=2", "iteration_limit"),
    ] {
        let place = tempfile::tempdir().expect("a directory");
        let mut command = signorini("solve");
        command
            .arg(example("press.toml"))
            .args(["--quiet", "--set", setting, "--output"])
            .arg(place.path());
        let run = mpirun(2, &mut command);
        assert_eq!(
            run.status.code(),
            Some(3),
            "{}",
            String::from_utf8_lossy(&run.stderr)
        );
        let Solved { report, .. } = report(place.path());
        assert_eq!(report["status"], status);
        for name in [
            "solution.pvtu",
            "solution-p0.vtu",
            "solution-p1.vtu",
            "contact.csv",
        ] {
            assert!(place.path().join(name).exists(), "{name}");
        }
    }
}

/// Processes that a launcher has started without this program's MPI report that once; the variables of a Slurm allocation,
/// where a program runs alone, do not count as a launcher.
fn launchers() {
    let place = tempfile::tempdir().expect("a directory");
    let case = place.path().join("tiny.toml");
    std::fs::write(&case, TINY).expect("a case");
    let started = |command: &str, says: &[(&str, &str)]| {
        let mut program = signorini(command);
        program.arg(&case).envs(says.iter().copied());
        if command == "solve" {
            program
                .arg("--quiet")
                .arg("--output")
                .arg(place.path().join("out"));
        }
        let run = program.output().expect("the program");
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        (run.status.code(), said)
    };
    for command in ["solve", "check"] {
        for [rank, size] in [
            ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"],
            ["PMI_RANK", "PMI_SIZE"],
            ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS"],
        ] {
            let (code, said) = started(command, &[(rank, "0"), (size, "4")]);
            assert_eq!(code, Some(1), "{said}");
            assert_eq!(said.matches("error: ").count(), 1, "{said}");
            assert!(said.contains("4 processes were started"), "{said}");
            let (code, said) = started(command, &[(rank, "3"), (size, "4")]);
            assert_eq!((code, said.as_str()), (Some(1), ""));
            let (code, said) = started(command, &[(rank, "0"), (size, "1")]);
            assert_eq!(code, Some(0), "{said}");
        }
        // The shell of salloc and the script of sbatch.
        let allocation = [
            ("SLURM_JOB_ID", "17"),
            ("SLURM_NTASKS", "4"),
            ("SLURM_NPROCS", "4"),
        ];
        let (code, said) = started(command, &allocation);
        assert_eq!(code, Some(0), "{said}");
        let script = [&allocation[..], &[("SLURM_PROCID", "0")]].concat();
        let (code, said) = started(command, &script);
        assert_eq!(code, Some(0), "{said}");
    }
}
