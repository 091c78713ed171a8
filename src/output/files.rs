//! The files of a run, each written whole or not at all.

use super::{ContactFields, Report, StepFields, StepReport, put, vtu};
use crate::case::Build;
use crate::contact::Space;
use crate::matrix_market::vector_text;
use crate::mesh::Kind;
use crate::model::StepData;
use crate::quasistatic::StepSolution;
use std::path::{Path, PathBuf};

/// A result could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct OutputError {
    path: PathBuf,
    source: std::io::Error,
}

impl OutputError {
    /// What has gone wrong with a path.
    fn at(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        |source| Self { path, source }
    }
}

/// Writes a file beside its place and moves it there: under its name there is the old file or the new one, never half
/// of it.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<(), OutputError> {
    // Pipes and devices are written as they are, and what a link points to stays in its place.
    let place = match std::fs::metadata(path) {
        Ok(there) if !there.is_file() => {
            return std::fs::write(path, contents).map_err(OutputError::at(path));
        }
        Ok(_) => std::fs::canonicalize(path).map_err(OutputError::at(path))?,
        Err(_) => path.to_owned(),
    };
    let mut name = std::ffi::OsString::from(".");
    name.push(place.file_name().unwrap_or_default());
    name.push(".part");
    let beside = place.with_file_name(name);
    let written = std::fs::write(&beside, contents).and_then(|()| std::fs::rename(&beside, &place));
    if written.is_err() {
        // It may not even exist.
        let _ = std::fs::remove_file(&beside);
    }
    written.map_err(OutputError::at(path))
}

/// Makes the directory of the results, and tries whether files can be written there: not only after an hour.
pub fn prepare(directory: &Path) -> Result<(), OutputError> {
    let path = directory.join(".signorini.part");
    std::fs::create_dir_all(directory)
        .and_then(|()| std::fs::write(&path, b""))
        .and_then(|()| std::fs::remove_file(&path))
        .map_err(OutputError::at(directory))
}

/// Writes one of the results into their directory, made if need be; returns the file.
pub(super) fn write(
    directory: &Path,
    name: &str,
    contents: impl AsRef<[u8]>,
) -> Result<PathBuf, OutputError> {
    std::fs::create_dir_all(directory).map_err(OutputError::at(directory))?;
    let path = directory.join(name);
    write_whole(&path, contents.as_ref()).map(|()| path)
}

/// Writes the fields of a step into `directory` (made if need be); returns the files. `number` is that of the
/// step where there are several, and goes into the names.
pub fn write_solution<const D: usize>(
    directory: &Path,
    build: &Build<D>,
    data: Option<&StepData<D>>,
    solution: &StepSolution<D>,
    number: Option<usize>,
) -> Result<Vec<PathBuf>, OutputError>
where
    Kind: Space<D>,
{
    if let (Some(elastic), Some(data)) = (&build.elastic, data) {
        let contact = ContactFields::new(build, elastic, data, solution);
        let grid = vtu::text(elastic, &StepFields::new(elastic, data, solution), &contact);
        let suffix = number.map_or(String::new(), |number| format!("-{number:03}"));
        return Ok(vec![
            write(directory, &format!("solution{suffix}.vtu"), grid)?,
            write(
                directory,
                &format!("contact{suffix}.csv"),
                contact.csv(elastic),
            )?,
        ]);
    }
    let (normal, tangential) = solution.lambda.split_at(build.problem.m());
    [
        ("u.mtx", &solution.u[..build.problem.n()]),
        ("lambda_normal.mtx", normal),
        ("lambda_tangential.mtx", tangential),
    ]
    .into_iter()
    .map(|(name, values)| write(directory, name, vector_text(values)))
    .collect()
}

/// Writes `solution.pvd`, the index of the steps 1 … n for ParaView, with their load factors as times where
/// these increase, their numbers otherwise.
pub fn write_index(directory: &Path, steps: &[StepReport]) -> Result<PathBuf, OutputError> {
    let factors: Vec<f64> = steps.iter().map(|step| step.factor).collect();
    write(directory, "solution.pvd", index(&factors))
}

/// The text of `solution.pvd` for steps with these load factors.
fn index(factors: &[f64]) -> String {
    let increase = factors.is_sorted_by(|a, b| a < b);
    let mut text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n"
            .to_owned();
    for (number, &factor) in (1..).zip(factors) {
        let time = if increase { factor } else { f64::from(number) };
        put(
            &mut text,
            format_args!(
                "<DataSet timestep=\"{time}\" part=\"0\" file=\"solution-{number:03}.vtu\"/>"
            ),
        );
    }
    text + "</Collection>\n</VTKFile>\n"
}

/// Writes `report.json`.
pub fn write_report(directory: &Path, report: &Report) -> Result<PathBuf, OutputError> {
    let text = serde_json::to_string_pretty(report)
        .map_err(|error| OutputError::at(&directory.join("report.json"))(error.into()))?;
    write(directory, "report.json", text + "\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_index_has_times_that_increase() {
        let times = |factors: &[f64]| -> Vec<String> {
            (index(factors).split("timestep=\"").skip(1))
                .map(|rest| rest.split('"').next().unwrap_or_default().to_owned())
                .collect()
        };
        assert_eq!(times(&[0.5, 1.0]), ["0.5", "1"]);
        assert_eq!(times(&[1.0, 0.0, 1.0]), ["1", "2", "3"]);
        assert!(index(&[1.0, 2.0]).contains("part=\"0\" file=\"solution-002.vtu\"/>\n"));
    }

    #[test]
    fn a_directory_that_cannot_be_is_told_at_once() {
        let place = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let file = place.path().join("file");
        std::fs::write(&file, b"").unwrap_or_else(|error| panic!("{error}"));
        let error = prepare(&file.join("results")).map_err(|error| error.to_string());
        assert!(error.is_err_and(|text| text.starts_with("cannot write ")));
        assert!(prepare(&place.path().join("new/results")).is_ok());
    }
}
