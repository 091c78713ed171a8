//! Several ranks against one process, under `mpirun`: `sh tests/mpi.sh` installs what this needs and runs it.
//!
//! What is compared with is the program on its own, by the factor, and for a problem from matrices the conditions themselves. The
//! same executable is what runs on the ranks where a library call is tested.

mod rows;
mod run;

use run::{Solved, conditions_of_matrices, mpirun, numbers, report, signorini, solved};
use std::path::{Path, PathBuf};

/// ε of a case file, where it says nothing.
const TOLERANCE: f64 = 1e-6;
/// Pressures of single places are less accurate than what they add up to: those of the factor are measured so, too.
const NODAL: f64 = 3000.0 * TOLERANCE;

fn main() {
    if let Ok(role) = std::env::var(rows::ROLE) {
        rows::rank(&role);
        return;
    }
    let only: Vec<String> = std::env::args()
        .skip(1)
        .filter(|arg| !arg.starts_with('-'))
        .collect();
    let tests: [(&str, fn()); 9] = [
        ("the_templates", the_templates),
        ("more_ranks_than_two", more_ranks_than_two),
        ("matrices", matrices),
        ("the_same_bits", the_same_bits),
        ("pieces_are_whole", pieces_are_whole),
        ("ranks_without_unknowns", ranks_without_unknowns),
        ("faults", faults),
        ("limits", limits),
        ("own_rows", rows::own_rows),
    ];
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

/// Solves an example on ranks and compares it with the factor, and its counts with those of conjugate gradients in one process.
fn compare(name: &str, ranks: usize) {
    let case = example(name);
    let place = tempfile::tempdir().expect("a directory");
    let direct = solved(
        None,
        &case,
        &["--stiffness", "cholesky", "--backend", "cpu"],
        place.path(),
    );
    let nested = solved(
        None,
        &case,
        &["--stiffness", "pcg", "--backend", "cpu"],
        place.path(),
    );
    let shared = solved(Some(ranks), &case, &[], place.path());
    let off = |found: &[f64], expected: &[f64], scale: f64| {
        assert_eq!(found.len(), expected.len(), "{name}");
        found
            .iter()
            .zip(expected)
            .fold(0.0_f64, |max, (a, b)| max.max((a - b).abs()))
            / scale
    };
    let size = |values: &[f64]| values.iter().fold(1e-300_f64, |max, v| max.max(v.abs()));
    // Forces that are the rounding of those that act are none.
    let forces = off(
        &shared.forces(),
        &direct.forces(),
        size(&direct.normal_forces()),
    );
    assert!(
        forces <= 10.0 * TOLERANCE,
        "{name} on {ranks}: forces {forces:e}"
    );
    let pressures = off(
        &shared.column("normal_pressure"),
        &direct.column("normal_pressure"),
        size(&direct.column("normal_pressure")),
    );
    assert!(
        pressures <= NODAL,
        "{name} on {ranks}: pressures {pressures:e}"
    );
    let slips = [&shared, &direct].map(|run| [run.column("slip"), run.column("gap")].concat());
    let slip = off(&slips[0], &slips[1], size(&slips[1]));
    assert!(slip <= NODAL, "{name} on {ranks}: slip {slip:e}");
    let close = |a: f64, b: f64| (a - b).abs() <= (0.2 * b).max(2.0);
    for key in ["iter", "n_A"] {
        let [found, expected] = [&shared, &nested].map(|run| run.report[key].as_f64().expect(key));
        assert!(
            close(found, expected),
            "{name} on {ranks}: {key} is {found} instead of {expected}"
        );
    }
    println!(
        "  {name} on {ranks}: forces {forces:.1e}, pressures {pressures:.1e}, slip and gap {slip:.1e}"
    );
}

/// Every example on two ranks, in the plane and in space: Tresca, Coulomb with steps, bodies that only contact holds, supports along
/// directions of their own. (shear.toml is left out: conjugate gradients need from 88 to 1200 steps for it in one process, too, for
/// tolerances from 1e-6 to 1e-7.)
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
        .collect();
    names.sort();
    assert!(names.len() >= 10, "{names:?}");
    names.iter().for_each(|name| compare(name, 2));
}

fn more_ranks_than_two() {
    compare("press.toml", 3);
    compare("dovetail.toml", 3);
    for name in [
        "ball-joint.toml",
        "roller.toml",
        "stack.toml",
        "bracket-3d.toml",
    ] {
        compare(name, 4);
    }
    // One rank is one process.
    let place = tempfile::tempdir().expect("a directory");
    let one = solved(Some(1), &example("press.toml"), &[], place.path());
    assert_eq!(one.report["backend"], "cpu");
}

/// u and λ of a problem from matrices obey its conditions, which are looked at with nothing but the files.
fn matrices() {
    for ranks in [2, 4] {
        let place = tempfile::tempdir().expect("a directory");
        let run = solved(
            Some(ranks),
            &example("matrices/block.toml"),
            &[],
            place.path(),
        );
        let worst = conditions_of_matrices(&example("matrices"), &run.directory);
        assert!(worst <= 10.0 * TOLERANCE, "{worst:e}");
        println!("  on {ranks}: conditions to {worst:.1e}");
    }
}

/// Two runs on the same number of ranks write the same numbers, to the last digit.
fn the_same_bits() {
    let tables = [0, 1].map(|_| {
        let place = tempfile::tempdir().expect("a directory");
        solved(Some(4), &example("ball-joint.toml"), &[], place.path()).table
    });
    assert_eq!(tables[0], tables[1]);
}

/// The pieces of all ranks have the elements of the whole mesh, and displacements and stresses at its nodes as one process has them:
/// also where elements of several ranks meet.
fn pieces_are_whole() {
    let place = tempfile::tempdir().expect("a directory");
    let case = example("press.toml");
    let alone = solved(
        None,
        &case,
        &["--stiffness", "cholesky"],
        &place.path().join("alone"),
    );
    let shared = solved(Some(4), &case, &[], &place.path().join("shared"));
    let whole = run::Grid::read(&alone.directory.join("solution.vtu"));
    let index = std::fs::read_to_string(shared.directory.join("solution.pvtu")).expect("an index");
    let mut cells = 0;
    for rank in 0..4 {
        let name = format!("solution-p{rank}.vtu");
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
                    (a.1 - b.1).abs() <= 10.0 * TOLERANCE * scale,
                    "{point:?} {a:?} {b:?}"
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
    let shared = solved(Some(4), &case, &[], place.path());
    assert!(numbers(&shared.report["ranks"]["unknowns"]).contains(&0.0));
    for (a, b) in shared.forces().iter().zip(direct.forces()) {
        assert!((a - b).abs() < 10.0, "{a} {b}");
    }
}

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

/// What is wrong is told once, with the exit code of an error.
fn faults() {
    let place = tempfile::tempdir().expect("a directory");
    let case = place.path().join("case.toml");
    let told = |text: &str, more: &[&str], expected: &str| {
        std::fs::write(&case, text).expect("a case");
        let run = mpirun(3, signorini("solve").arg(&case).args(more));
        let said = String::from_utf8_lossy(&run.stderr);
        assert_eq!(run.status.code(), Some(1), "{said}");
        assert_eq!(said.matches("error: ").count(), 1, "{said}");
        assert!(said.contains(expected), "{said}");
    };
    told("[mesh", &[], "case.toml");
    told(
        &TINY.replace("\"left\"", "\"lefty\""),
        &[],
        "line 8: there is no boundary \"lefty\"",
    );
    told(
        &TINY.replace("-1e6", "\"1 / (x - x)\""),
        &[],
        "no finite value",
    );
    // A body that nothing holds, in space of its supports and without a contact.
    let loose = TINY
        .replace("x = 0\n", "")
        .split("[[contact]]")
        .next()
        .expect("a text")
        .to_owned();
    told(&loose, &[], "no contact to hold it");
    told(TINY, &["--stiffness", "cholesky"], "leave it out");
    told(TINY, &["--backend", "gpu"], "leave it out");
    told(TINY, &["--output", "/dev/null/out"], "cannot write");
    // A panic of one rank ends all of them.
    let run = mpirun(3, rows::command("panic"));
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(1), "{said}");
    assert_eq!(said.matches("error: rank 1:").count(), 1, "{said}");
}

/// A limit of time that is past, and one of steps: the exit code of what has not converged, with everything written.
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
