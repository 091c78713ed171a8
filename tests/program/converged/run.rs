//! A run of the program on a case, and the errors of its results.

use super::cases::Case;
use crate::or_panic::OrPanic as _;
use crate::run::{command, write};
use serde_json::Value;
use std::fmt::{Display, Write as _};
use std::path::Path;

/// Both ways to make products with A.
pub const PATHS: [&str; 2] = ["cholesky", "pcg"];

/// `solver.tolerance` by default.
pub const DEFAULT: f64 = 1e-6;

/// The allowed violation, in tolerances: of the optimality conditions (relative as `kkt` is) …
pub const KKT: f64 = 10.0;

/// … of the resultants, relative to the largest of the step; at the default tolerance that is 1e-4 …
pub const FORCE: f64 = 100.0;

/// … and of nodal pressures and tangential tractions, relative to the largest pressure of the step.
pub const NODAL: f64 = 1000.0;

/// The allowed difference between pressures reached in steps or at once, and between areas times pressures and their
/// sum.
pub const CLOSE: f64 = 1e-4;

/// A row of `contact.csv`.
#[derive(Clone, Debug)]
pub struct Node {
    pub x: f64,
    pub pressure: f64,
    pub traction: f64,
}

/// The results of a run.
pub struct Run {
    pub name: String,
    pub tolerance: f64,
    pub code: Option<i32>,
    pub stdout: String,
    pub stderr: String,
    /// `Null` where nothing was written.
    pub report: Value,
    /// The contact nodes of each step, in the order of the file.
    pub nodes: Vec<Vec<Node>>,
    /// The vectors of an algebraic case: u, λν, λτ.
    pub vectors: [Vec<f64>; 3],
    /// The files in the output directory.
    pub files: Vec<String>,
}

/// The way to run a case.
#[derive(Clone, Copy)]
pub struct How<'a> {
    pub path: &'a str,
    pub tolerance: f64,
    pub quiet: bool,
}

impl<'a> How<'a> {
    pub fn quiet(path: &'a str, tolerance: f64) -> Self {
        Self {
            path,
            tolerance,
            quiet: true,
        }
    }
}

pub fn read(path: &Path) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

/// Solves a case in its own directory, beside the given files.
pub fn solve_with(name: &str, text: &str, files: &[(&str, String)], how: How) -> Run {
    let place = tempfile::tempdir().or_panic();
    let case = place.path().join("case.toml");
    write(&case, text);
    for (file, contents) in files {
        write(&place.path().join(file), contents);
    }
    let out = place.path().join("out");
    let mut command = command(&["solve"]);
    command.arg(&case).arg("--output").arg(&out);
    command.args(["--backend", "cpu", "--stiffness", how.path]);
    command.args(["--set", &format!("solver.tolerance={:e}", how.tolerance)]);
    if how.quiet {
        command.arg("--quiet");
    }
    let output = command.output().or_panic();
    let report = read(&out.join("report.json"))
        .and_then(|text| serde_json::from_str(&text).ok())
        .unwrap_or(Value::Null);
    let steps = report["steps"].as_array().map_or(0, Vec::len);
    let one = read(&out.join("contact.csv")).map(|text| vec![contact_nodes(&text)]);
    let nodes = one.unwrap_or_else(|| {
        (1..=steps)
            .filter_map(|step| read(&out.join(format!("contact-{step:03}.csv"))))
            .map(|text| contact_nodes(&text))
            .collect()
    });
    let files = std::fs::read_dir(&out)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    Run {
        name: format!("{name}, {}, ε = {:e}", how.path, how.tolerance),
        tolerance: how.tolerance,
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        report,
        nodes,
        vectors: ["u", "lambda_normal", "lambda_tangential"]
            .map(|name| read(&out.join(format!("{name}.mtx"))).map_or(Vec::new(), vector)),
        files,
    }
}

pub fn solve(name: &str, text: &str, how: How) -> Run {
    solve_with(name, text, &[], how)
}

/// The rows of `contact.csv`: x, y, gap, normal_pressure, tangential_traction, slip, status, contact.
pub fn contact_nodes(text: &str) -> Vec<Node> {
    text.lines()
        .skip(1)
        .map(|line| {
            let field: Vec<&str> = line.split(',').collect();
            let number = |i: usize| field[i].parse().unwrap_or(f64::NAN);
            Node {
                x: number(0),
                pressure: number(3),
                traction: number(4),
            }
        })
        .collect()
}

/// A vector in a Matrix Market file.
pub fn vector(text: String) -> Vec<f64> {
    let lines = text.lines().filter(|line| !line.starts_with('%'));
    lines
        .skip(1)
        .map(|line| line.trim().parse().unwrap_or(f64::NAN))
        .collect()
}

impl Run {
    pub fn status(&self) -> &str {
        self.report["status"].as_str().unwrap_or("no report")
    }

    pub fn steps(&self) -> usize {
        self.report["steps"].as_array().map_or(0, Vec::len)
    }

    pub fn contacts(&self, step: usize) -> usize {
        let contacts = &self.report["steps"][step]["contacts"];
        contacts.as_array().map_or(0, Vec::len)
    }

    /// The resultant of a contact on the body of its first boundary.
    pub fn force(&self, step: usize, contact: usize) -> [f64; 2] {
        pair(&self.report["steps"][step]["contacts"][contact]["force"])
    }

    /// The reaction of a support.
    pub fn reaction(&self, step: usize, support: usize) -> [f64; 2] {
        pair(&self.report["steps"][step]["supports"][support]["force"])
    }

    /// The first line with the error.
    pub fn first_words(&self) -> String {
        let line = |text: &str| text.lines().next().unwrap_or("").to_owned();
        line(if self.stderr.is_empty() {
            &self.stdout
        } else {
            &self.stderr
        })
    }

    /// The errors of a run that has to have converged in this many steps; empty if it is correct.
    pub fn unconverged(&self, steps: usize) -> Vec<String> {
        if self.code != Some(0) || self.status() != "converged" {
            let (code, status) = (self.code, self.status());
            return vec![format!(
                "exit {code:?}, status {status} after {} of {steps} steps {}",
                self.steps(),
                self.first_words()
            )];
        }
        let mut wrong = Vec::new();
        if self.steps() != steps {
            wrong.push(format!("{} of {steps} steps", self.steps()));
        }
        let of_steps = self.report["steps"].as_array().into_iter().flatten();
        for (number, step) in of_steps.enumerate() {
            if step["status"] != "converged" {
                wrong.push(format!("step {}: status {}", number + 1, step["status"]));
            }
            wrong.extend(self.broken(&step["kkt"], &format!("step {}: ", number + 1)));
        }
        wrong.extend(self.broken(&self.report["kkt"], ""));
        wrong
    }

    /// The optimality conditions that are not met.
    pub fn broken(&self, kkt: &Value, place: &str) -> Vec<String> {
        let Some(entries) = kkt.as_object().filter(|entries| !entries.is_empty()) else {
            return vec![format!("{place}there are no optimality conditions")];
        };
        entries
            .iter()
            .filter(|(_, value)| {
                !value
                    .as_f64()
                    .is_some_and(|v| v <= KKT * self.tolerance && v >= 0.0)
            })
            .map(|(name, value)| format!("{place}{name} {value}"))
            .collect()
    }

    /// The error of a resultant, which has to be this to 100 ε of its length, or of `least` if that is more.
    pub fn wrong_force(
        &self,
        step: usize,
        contact: usize,
        expected: [f64; 2],
        least: f64,
    ) -> Option<String> {
        let force = self.force(step, contact);
        let error = length(difference(force, expected)) / length(expected).max(least);
        (!(error <= FORCE * self.tolerance)).then(|| {
            format!(
                "step {}, contact {}: force ({:.6e}, {:.6e}), expected ({:.6e}, {:.6e}): off by {error:.1e}",
                step + 1,
                contact + 1,
                force[0],
                force[1],
                expected[0],
                expected[1]
            )
        })
    }
}

pub fn pair(value: &Value) -> [f64; 2] {
    [0, 1].map(|c| value[c].as_f64().unwrap_or(f64::NAN))
}

pub fn length(v: [f64; 2]) -> f64 {
    v[0].hypot(v[1])
}

pub fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// The largest absolute value; NaN if one is.
pub fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |largest, v| {
        if largest.is_nan() || v.is_nan() {
            f64::NAN
        } else {
            f64::max(largest, v.abs())
        }
    })
}

pub fn largest_pressure(nodes: &[Node]) -> f64 {
    largest(nodes.iter().map(|node| node.pressure))
}

/// The failures of a test, reported together at its end.
pub struct Failures {
    pub runs: usize,
    pub failed: usize,
    pub text: String,
}

impl Failures {
    pub fn new() -> Self {
        Self {
            runs: 0,
            failed: 0,
            text: String::new(),
        }
    }

    /// Counts a run, with its errors.
    pub fn add(&mut self, name: impl Display, wrong: Vec<String>) {
        self.runs += 1;
        if !wrong.is_empty() {
            self.failed += 1;
            writeln!(self.text, "  {name}").expect("writing to a string cannot fail");
        }
        for line in wrong {
            writeln!(self.text, "      {line}").expect("writing to a string cannot fail");
        }
    }

    pub fn finish(self) {
        assert!(self.runs > 0, "nothing was tried");
        assert!(
            self.failed == 0,
            "{} of {} runs failed:\n{}",
            self.failed,
            self.runs,
            self.text
        );
    }
}

/// Runs a case on both paths; `more` checks converged ones.
pub fn on_both_paths(
    failures: &mut Failures,
    case: &Case,
    tolerance: f64,
    more: impl Fn(&Run) -> Vec<String>,
) {
    for path in PATHS {
        let run = solve(&case.name, &case.text, How::quiet(path, tolerance));
        let mut wrong = run.unconverged(case.steps);
        if run.status() == "converged" {
            wrong.extend(more(&run));
        }
        failures.add(&run.name, wrong);
    }
}
