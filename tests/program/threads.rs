//! Results are the same to the last bit, whatever the number of threads.

use crate::or_panic::OrPanic as _;
use crate::run::command;
use std::collections::BTreeMap;
use std::path::Path;

/// The results of a run without its costs: the contents of each file by its name.
fn results(arguments: &[&str], threads: usize) -> BTreeMap<String, Vec<u8>> {
    let out = tempfile::tempdir().or_panic();
    let run = command(&["solve"])
        .env("RAYON_NUM_THREADS", threads.to_string())
        .args(arguments)
        .args([Path::new("--output"), out.path()])
        .output()
        .or_panic();
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(0), "{arguments:?}: {said}");
    let files = std::fs::read_dir(out.path()).or_panic();
    files
        .map(|file| {
            let path = file.or_panic().path();
            let contents = std::fs::read(&path).or_panic();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let contents = match &*name {
                "report.json" => without_costs(&contents),
                _ => contents,
            };
            (name.into_owned(), contents)
        })
        .collect()
}

fn without_costs(report: &[u8]) -> Vec<u8> {
    let mut report: serde_json::Value = serde_json::from_slice(report).or_panic();
    let fields = report
        .as_object_mut()
        .unwrap_or_else(|| panic!("no object"));
    for costs in ["timings", "peak_memory_mib"] {
        assert!(fields.remove(costs).is_some(), "{costs}");
    }
    report.to_string().into_bytes()
}

/// Runs a case with several numbers of threads and compares everything.
fn compare(arguments: &[&str], threads: &[usize]) {
    let expected = results(arguments, threads[0]);
    assert!(expected.contains_key("report.json") && expected.len() > 2);
    for &more in &threads[1..] {
        let found = results(arguments, more);
        assert!(found.keys().eq(expected.keys()), "{:?}", found.keys());
        for (name, contents) in &expected {
            assert!(
                *contents == found[name],
                "{arguments:?}: {name} differs between {} and {more} threads",
                threads[0]
            );
        }
    }
}

const CHOLESKY: [&str; 2] = ["--stiffness", "cholesky"];
const PCG: [&str; 4] = ["--stiffness", "pcg", "--backend", "cpu"];

fn on_both_paths(case: &[&str], threads: &[usize]) {
    compare(&[case, &CHOLESKY].concat(), threads);
    compare(&[case, &PCG].concat(), threads);
}

/// Floating bodies, load steps, Coulomb friction, matrices.
#[test]
fn examples() {
    for case in [
        &["examples/stack.toml"][..],
        &["examples/shear.toml"],
        &["examples/dovetail.toml"],
        &["examples/roller.toml"],
        &["examples/matrices/block.toml"],
    ] {
        on_both_paths(case, &[1, 2, 3, 8]);
    }
}

/// So many unknowns that all loops are split: n = 62 000.
#[test]
fn large_bodies() {
    let case = [
        "examples/stack.toml",
        "--set",
        "mesh.part.0.rectangle.cells=[240, 60]",
        "--set",
        "mesh.part.1.rectangle.cells=[190, 80]",
    ];
    on_both_paths(&case, &[1, 2, 3, 8]);
}

/// Elements of second order, in space.
#[test]
fn second_order() {
    let case = [
        "examples/ball.toml",
        "--set",
        "mesh.order=2",
        "--set",
        "mesh.box.cells=[7, 7, 7]",
    ];
    on_both_paths(&case, &[1, 2, 3]);
}

/// Shapes and orders in space, with so many unknowns that all loops are split.
#[test]
fn shapes_in_space() {
    for (shape, order, cells) in [
        ("tetrahedron", 1, 18),
        ("hexahedron", 1, 18),
        ("tetrahedron", 2, 9),
        ("hexahedron", 2, 9),
    ] {
        let set = [
            format!("mesh.box.shape=\"{shape}\""),
            format!("mesh.order={order}"),
            format!("mesh.box.cells=[{cells}, {cells}, {cells}]"),
        ];
        let mut case = vec!["examples/ball.toml"];
        case.extend(PCG);
        for value in &set {
            case.extend(["--set", value]);
        }
        compare(&case, &[1, 7]);
    }
}

/// A pair of bodies in space, from a mesh file, in load steps with Coulomb friction.
#[test]
fn pairs_in_space() {
    on_both_paths(&["examples/brake.toml"], &[1, 7]);
}

/// The kernels do not know how many threads the host has.
#[test]
fn gpu() {
    let case = [
        "examples/matrices/block.toml",
        "--stiffness",
        "pcg",
        "--backend",
        "gpu",
    ];
    compare(&case, &[1, 2]);
}

/// `signorini phases` prints each phase for each number of threads and writes the same as JSON; nothing else is left behind.
#[test]
fn phases_are_measured_by_threads() {
    let out = tempfile::tempdir().or_panic();
    let json = out.path().join("phases.json");
    let run = command(&[
        "phases",
        "examples/press.toml",
        "--threads",
        "3",
        "--repeat",
        "1",
        "--json",
    ])
    .arg(&json)
    .env("TMPDIR", out.path())
    .output()
    .or_panic();
    let said = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(0), "{said}");
    let text = String::from_utf8_lossy(&run.stdout);
    let table: Vec<Vec<&str>> = text
        .lines()
        .map(|line| line.split_whitespace().collect())
        .collect();
    assert_eq!(table[0][2..], ["1", "3", "ratio", "serial", "16", "64"]);
    assert!(
        table
            .iter()
            .any(|row| row.first() == Some(&"all") && row.len() == 7),
        "{text}"
    );
    let read: serde_json::Value =
        serde_json::from_slice(&std::fs::read(&json).or_panic()).or_panic();
    assert_eq!(read["threads"], serde_json::json!([1, 3]));
    let phases = read["phases"].as_array().expect("a list");
    let seconds =
        |row: &serde_json::Value, i: usize| row["seconds"][i].as_f64().unwrap_or(f64::NAN);
    let all = phases.last().expect("all of them");
    for i in 0..2 {
        let parts: f64 = phases[..phases.len() - 1]
            .iter()
            .map(|row| seconds(row, i))
            .sum();
        assert!(
            parts > 0.5 * seconds(all, i) && parts < 1.01 * seconds(all, i),
            "{read}"
        );
    }
    assert_eq!(
        std::fs::read_dir(out.path()).or_panic().count(),
        1,
        "only phases.json"
    );
    let run = command(&["phases", "examples/press.toml", "--threads", "1"])
        .output()
        .or_panic();
    assert_eq!(run.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&run.stderr).contains("a number above 1"));
}
