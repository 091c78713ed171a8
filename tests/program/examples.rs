//! Every template of examples/ as a newcomer runs it: on the factor, by iterations on the CPU, and by kernels
//! on an adapter in both precisions, with the same forces.

use crate::or_panic::OrPanic as _;
use crate::run::{command, report};
use std::path::{Path, PathBuf};

const TEMPLATES: [&str; 19] = [
    "stack",
    "press",
    "cylinder",
    "shear",
    "dovetail",
    "fretting",
    "roller",
    "collar",
    "bracket-3d",
    "ball",
    "shrink-fit",
    "brake",
    "ball-joint",
    "ironing",
    "bolted-flange",
    "snap-fit",
    "hose",
    "gears",
    "matrices/block",
];

/// Solves a template and returns its report.
fn solve(name: &str, options: &[&str], directory: &Path) -> serde_json::Value {
    let run = command(&["solve", &format!("examples/{name}.toml"), "--quiet"])
        .arg("--output")
        .arg(directory)
        .args(options)
        .output()
        .or_panic();
    let message = String::from_utf8_lossy(&run.stderr);
    assert_eq!(run.status.code(), Some(0), "{name} {options:?}: {message}");
    report(directory)
}

fn forces(report: &serde_json::Value) -> Vec<f64> {
    report["steps"]
        .as_array()
        .into_iter()
        .flatten()
        .flat_map(|step| step["contacts"].as_array().into_iter().flatten())
        .flat_map(|contact| [&contact["normal_force"], &contact["tangential_force"]])
        .map(|force| force.as_f64().unwrap_or(f64::NAN))
        .collect()
}

fn all(templates: &[&str], options: &[&str]) {
    let directory = tempfile::tempdir().or_panic();
    for name in templates {
        let plain = solve(name, &["--stiffness", "cholesky"], directory.path());
        let report = solve(name, options, directory.path());
        println!("{name} {options:?}: n_A {}", report["n_A"]);
        // Hardly any iteration is issued in vain, and the device does not wait for long recordings.
        let costs = &report["costs"];
        let count = |pointer: &str| costs.pointer(pointer).and_then(|count| count.as_f64());
        if let (Some(issued), Some(iterations)) =
            (count("/solves/issued"), count("/solves/iterations"))
        {
            assert!(issued <= 1.3 * iterations, "{name} {options:?}: {costs}");
        }
        if let (Some(dispatches), Some(submissions)) =
            (count("/device/dispatches"), count("/device/submissions"))
        {
            assert!(
                dispatches <= 64.0 * submissions,
                "{name} {options:?}: {costs}"
            );
        }
        let (a, b) = (forces(&plain), forces(&report));
        assert_eq!(a.len(), b.len());
        let scale = a
            .iter()
            .fold(0.0, |scale: f64, force| scale.max(force.abs()));
        for (a, b) in a.iter().zip(&b) {
            assert!((a - b).abs() <= 1e-3 * scale, "{name} {options:?}: {a} {b}");
        }
    }
}

#[test]
fn templates_by_iterations_on_the_cpu() {
    all(&TEMPLATES, &["--stiffness", "pcg", "--backend", "cpu"]);
}

#[test]
fn templates_on_an_adapter_in_f64() {
    // One solid is enough: without a real GPU both take long.
    let mut templates = TEMPLATES.to_vec();
    templates.retain(|&name| name != "ball");
    all(&templates, &["--backend", "gpu", "--precision", "f64"]);
}

#[test]
fn templates_on_an_adapter_in_f32() {
    // One of each kind: without a real GPU these take long.
    all(
        &[
            "press",
            "cylinder",
            "dovetail",
            "ball-joint",
            "shrink-fit",
            "matrices/block",
        ],
        &["--backend", "gpu", "--precision", "f32"],
    );
}

/// The torques of both gears differ only by what friction takes. They are those of a mesh of half the size at the flanks, from the same
/// `.geo`.
#[test]
fn gears_turn_smoothly() {
    let finer = [
        23.77, 24.38, 24.76, 25.02, 24.88, 24.82, 24.43, 24.52, 24.37, 23.99, 24.20, 24.84, 24.92,
        28.74, 32.94, 33.95, 32.63, 27.91, 25.31, 24.69, 24.20,
    ];
    let directory = tempfile::tempdir().or_panic();
    let report = solve("gears", &[], directory.path());
    let steps = report["steps"].as_array().expect("steps");
    assert_eq!(steps.len(), finer.len());
    for (step, finer) in steps.iter().zip(finer) {
        let number = |value: &serde_json::Value| value.as_f64().expect("a number");
        let torque = |of: usize, axis: f64| {
            let support = &step["supports"][of];
            let vector = |name: &str| [0, 1].map(|c| number(&support[name][c]));
            let ([x, y], [fx, fy]) = (vector("centre"), vector("force"));
            number(&support["moment"][0]) + (x - axis) * fy - y * fx
        };
        let [driver, driven] = [torque(0, 0.0), torque(1, 0.04)];
        assert!((driver / finer - 1.0).abs() < 0.04, "{driver} {finer}");
        assert!(
            (-0.02..0.05).contains(&(1.0 - driven / driver)),
            "{driver} {driven}"
        );
        let iterations = number(&step["iterations"]);
        assert!(
            iterations <= 8.0 && number(&step["parts"]) == 1.0,
            "{iterations}"
        );
    }
}

/// The list above is complete, and the gallery shows all of them.
#[test]
fn every_template_is_tested_and_named() {
    let gallery = std::fs::read_to_string("docs/gallery.md").or_panic();
    let mut found = 0;
    for folder in ["examples", "examples/matrices"] {
        let entries = std::fs::read_dir(folder).or_panic();
        for entry in entries.flatten() {
            let path: PathBuf = entry.path();
            if path.extension().is_some_and(|e| e == "toml") {
                let path = path.to_string_lossy().replace('\\', "/");
                let name = path
                    .trim_start_matches("examples/")
                    .trim_end_matches(".toml");
                assert!(TEMPLATES.contains(&name), "{name} is not tested");
                assert!(gallery.contains(&format!("(../{path})")), "gallery: {path}");
                found += 1;
            }
        }
    }
    assert_eq!(found, TEMPLATES.len());
}
