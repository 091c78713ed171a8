//! Running the program and reading its results, for several rooms.

use crate::or_panic::OrPanic as _;
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

/// The program with these arguments.
pub fn command(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_signorini"));
    command.args(arguments);
    command
}

/// Runs it where the tests run.
pub fn signorini(arguments: &[&str]) -> Output {
    command(arguments).output().or_panic()
}

/// Runs it in a directory.
pub fn signorini_in(directory: &Path, arguments: &[&str]) -> Output {
    command(arguments)
        .current_dir(directory)
        .output()
        .or_panic()
}

/// Solves a case in its own directory, quietly: the report.
pub fn solved(case: &str) -> Value {
    solved_in(directory().path(), case)
}

/// Solves a case beside the files of a directory, quietly: the report.
pub fn solved_in(directory: &Path, case: &str) -> Value {
    write(&directory.join("case.toml"), case);
    let arguments = ["solve", "case.toml", "--output", "out", "--quiet"];
    let run = signorini_in(directory, &arguments);
    assert_eq!(run.status.code(), Some(0), "{}", text(&run.stderr));
    report(&directory.join("out"))
}

pub fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

pub fn directory() -> tempfile::TempDir {
    tempfile::tempdir().or_panic()
}

pub fn write(path: &Path, contents: &str) {
    std::fs::write(path, contents).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}

pub fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The report among the results of a run.
pub fn report(directory: &Path) -> Value {
    serde_json::from_str(&read(&directory.join("report.json"))).or_panic()
}

/// The names in a directory, in order; empty if it does not exist.
pub fn names(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory).into_iter().flatten();
    let mut names: Vec<String> = entries
        .map(|entry| entry.or_panic().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// The numbers of a list in a report.
#[track_caller]
pub fn numbers(value: &Value) -> Vec<f64> {
    let list = value.as_array().unwrap_or_else(|| panic!("{value}"));
    let number = |v: &Value| v.as_f64().unwrap_or_else(|| panic!("{value}"));
    list.iter().map(number).collect()
}
