//! The files of a run, each written whole or not at all.

use super::{OfBodies, Report, StepReport, put, vtu};
use crate::contact::Space;
use crate::matrix_market::write_columns;
use crate::mesh::ElementKind;
use crate::problem::ContactProblem;
use crate::quasistatic::StepSolution;
use std::fs::File;
use std::io::ErrorKind::{NotADirectory, NotFound};
use std::io::{BufWriter, Read as _, Write as _};
use std::path::{Path, PathBuf};

/// A result could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct OutputError {
    path: PathBuf,
    source: std::io::Error,
}

impl OutputError {
    /// The error about a path.
    fn at(path: &Path) -> impl FnOnce(std::io::Error) -> Self {
        let path = path.to_owned();
        |source| Self { path, source }
    }
}

/// Writes a file beside its destination and moves it there: its name always refers to the complete old file or the
/// complete new one.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<(), OutputError> {
    whole_by(path, |to| to.write_all(contents))
}

/// The same for contents that are generated during writing.
fn whole_by(
    path: &Path,
    contents: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<(), OutputError> {
    let write = |place: &Path| {
        let mut to = BufWriter::new(File::create(place)?);
        contents(&mut to)?;
        to.flush()
    };
    // Pipes and devices are written directly, and the target of a link stays in its place.
    let place = match std::fs::metadata(path) {
        Ok(there) if !there.is_file() => {
            return write(path).map_err(OutputError::at(path));
        }
        Ok(_) => std::fs::canonicalize(path).map_err(OutputError::at(path))?,
        Err(_) => path.to_owned(),
    };
    let mut name = std::ffi::OsString::from(".");
    name.push(place.file_name().unwrap_or_default());
    name.push(".part");
    let beside = place.with_file_name(name);
    let written = write(&beside).and_then(|()| std::fs::rename(&beside, &place));
    if written.is_err() {
        // It may not even exist.
        let _ = std::fs::remove_file(&beside);
    }
    written.map_err(OutputError::at(path))
}

/// Makes the directory of the results, and tests whether files can be written there (before an hour of solving, not
/// after). Removes all results of an earlier run, recognised by their names, because the new run may have fewer steps,
/// or draw nothing. `inputs` are the files that the run reads.
///
/// # Errors
/// If files cannot be written or removed there; or, before anything is, if one of `inputs` has the name of a result
/// there.
pub fn prepare(directory: &Path, inputs: &[PathBuf]) -> Result<(), OutputError> {
    let path = directory.join(".signorini.part");
    std::fs::create_dir_all(directory).map_err(OutputError::at(directory))?;
    let before = results(directory, inputs)?;
    std::fs::write(&path, b"")
        .and_then(|()| std::fs::remove_file(&path))
        .map_err(OutputError::at(directory))?;
    before.iter().try_for_each(|path| remove(path))
}

/// The files that state how a run has ended, with their first bytes: no mesh and no matrix begins so.
const REPORTS: [(&str, &[u8]); 2] = [("report.json", b"{"), ("report.html", b"<!")];

/// Removes the files that state how the run before has ended, so that they cannot be mistaken for the end of a run that
/// fails before it has results. The results stay until [`prepare`]: an error in the new case must not destroy them.
/// `inputs` are the files that the run reads, if known.
///
/// # Errors
/// As [`prepare`]; a missing directory is not an error.
pub fn withdraw(directory: &Path, inputs: &[PathBuf]) -> Result<(), OutputError> {
    let all = results(directory, inputs)?;
    for (name, begin) in REPORTS {
        let path = directory.join(name);
        if all.contains(&path) && begins(&path, begin) {
            remove(&path)?;
        }
    }
    Ok(())
}

/// Whether a file can be read and begins so.
fn begins(path: &Path, begin: &[u8]) -> bool {
    let mut found = vec![0; begin.len()];
    std::fs::File::open(path).is_ok_and(|mut file| file.read_exact(&mut found).is_ok())
        && found == begin
}

/// The files of a directory with names of results, if none of them is one of `inputs`.
fn results(directory: &Path, inputs: &[PathBuf]) -> Result<Vec<PathBuf>, OutputError> {
    refuse_inputs(directory, inputs, is_result)
}

/// The files of a directory with names of files to be written there, if none of them is one of `inputs`.
///
/// # Errors
/// If one is, or the directory cannot be read.
pub(super) fn refuse_inputs(
    directory: &Path,
    inputs: &[PathBuf],
    is_written: impl Fn(&str) -> bool,
) -> Result<Vec<PathBuf>, OutputError> {
    // The dot is for the directory "".
    let entries = match std::fs::read_dir(directory.join(".")) {
        // A directory that does not exist yet is empty; a file in its place is an error when it is made.
        Err(error) if matches!(error.kind(), NotFound | NotADirectory) => return Ok(Vec::new()),
        entries => entries.map_err(OutputError::at(directory))?,
    };
    let mut files = Vec::new();
    for entry in entries {
        let name = entry.map_err(OutputError::at(directory))?.file_name();
        let path = directory.join(&name);
        // Pipes and devices are written to; links have to lead to a file.
        if name.to_str().is_some_and(&is_written) && path.is_file() {
            files.push(path);
        }
    }
    let inputs = inputs.iter().filter_map(|path| path.canonicalize().ok());
    let inputs: Vec<PathBuf> = inputs.collect();
    let is_input = |path: &&PathBuf| path.canonicalize().is_ok_and(|path| inputs.contains(&path));
    match files.iter().find(is_input) {
        None => Ok(files),
        Some(path) => {
            let text = "this run reads this file and would overwrite it with a result: choose another output \
                        directory, or rename the file";
            Err(OutputError::at(path)(std::io::Error::other(text)))
        }
    }
}

/// Removes a result. The target of a link stays in its place, empty.
fn remove(path: &Path) -> Result<(), OutputError> {
    let removed = if path.is_symlink() {
        std::fs::write(path, b"")
    } else {
        std::fs::remove_file(path)
    };
    removed.map_err(OutputError::at(path))
}

/// Whether this is the name of a result, or of a temporary file of one.
fn is_result(name: &str) -> bool {
    const WHOLE: [&str; 8] = [
        "report.json",
        "report.html",
        "solution.pvd",
        "u.mtx",
        "lambda_normal.mtx",
        "lambda_tangential.mtx",
        "convergence.svg",
        "steps.svg",
    ];
    // The number of a step has three digits or more; that of a contact has no leading 0.
    let of_step = |text: &str| text.len() >= 3 && number(text);
    let of_contact = |text: &str| number(text) && !text.starts_with('0');
    let rest = |kind: &str, ending: &str| {
        let rest = name.strip_prefix(kind)?.strip_suffix(ending)?;
        if rest.is_empty() {
            Some(rest)
        } else {
            rest.strip_prefix('-').filter(|rest| !rest.is_empty())
        }
    };
    let stepped = |rest: Option<&str>| rest.is_some_and(|rest| rest.is_empty() || of_step(rest));
    let picture = |rest: &str| match rest.split_once('-') {
        Some((contact, step)) => of_contact(contact) && of_step(step),
        None => rest.is_empty() || of_contact(rest) || of_step(rest),
    };
    let part = name
        .strip_prefix('.')
        .and_then(|name| name.strip_suffix(".part"));
    WHOLE.contains(&name)
        || stepped(rest("solution", ".vtu").map(whole))
        || stepped(rest("solution", ".pvtu"))
        || stepped(rest("contact", ".csv"))
        || stepped(rest("deformed", ".svg"))
        || rest("contact", ".svg").is_some_and(picture)
        || part.is_some_and(|name| !name.starts_with('.') && is_result(name))
}

/// Without the rank that has written a piece: `012-p3` or `p3`.
fn whole(rest: &str) -> &str {
    match rest.rsplit_once('p') {
        Some(("", rank)) if number(rank) => "",
        Some((step, rank)) if number(rank) => step.strip_suffix('-').unwrap_or(rest),
        _ => rest,
    }
}

/// Whether it is one.
fn number(text: &str) -> bool {
    !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit())
}

/// Writes one of the results into their directory, made if need be; returns the file.
pub(crate) fn write(
    directory: &Path,
    name: &str,
    contents: impl AsRef<[u8]>,
) -> Result<PathBuf, OutputError> {
    write_by(directory, name, |to| to.write_all(contents.as_ref()))
}

/// The same for contents in pieces.
pub(crate) fn write_pieces(
    directory: &Path,
    name: &str,
    pieces: &[Vec<u8>],
) -> Result<PathBuf, OutputError> {
    let mut all = pieces.iter();
    write_by(directory, name, |to| {
        all.try_for_each(|piece| to.write_all(piece))
    })
}

/// The same for contents that are generated during writing.
pub(super) fn write_by(
    directory: &Path,
    name: &str,
    contents: impl FnOnce(&mut BufWriter<File>) -> std::io::Result<()>,
) -> Result<PathBuf, OutputError> {
    std::fs::create_dir_all(directory).map_err(OutputError::at(directory))?;
    let path = directory.join(name);
    whole_by(&path, contents).map(|()| path)
}

/// Writes the fields of a step into `directory` (made if need be); returns the files. `suffix` goes into the names.
pub(super) fn write_fields<const D: usize>(
    directory: &Path,
    of: &OfBodies<D>,
    suffix: &str,
) -> Result<Vec<PathBuf>, OutputError>
where
    ElementKind: Space<D>,
{
    let elements = of.elastic.mesh.elements.len();
    let grid = vtu::text(of, elements);
    let table = of.contact.csv(of.elastic);
    Ok(vec![
        write_pieces(directory, &format!("solution{suffix}.vtu"), &grid)?,
        write(directory, &format!("contact{suffix}.csv"), table)?,
    ])
}

/// Writes u and λ of a problem from matrices into `directory` (made if need be); returns the files.
pub(crate) fn write_vectors<const D: usize, K>(
    directory: &Path,
    problem: &ContactProblem<D, K>,
    solution: &StepSolution<D>,
) -> Result<Vec<PathBuf>, OutputError> {
    let (normal, tangential) = solution.lambda.split_at(problem.m());
    [
        ("u.mtx", &solution.u[..problem.n()]),
        ("lambda_normal.mtx", normal),
        ("lambda_tangential.mtx", tangential),
    ]
    .into_iter()
    .map(|(name, values)| write_by(directory, name, |to| write_columns(to, &[values.to_vec()])))
    .collect()
}

/// Writes `solution.pvd`, the index of the steps 1 … n for ParaView, whose files have this ending, with their load factors as times where
/// these increase, their numbers otherwise.
pub(crate) fn write_index(
    directory: &Path,
    steps: &[StepReport],
    ending: &str,
) -> Result<PathBuf, OutputError> {
    // Of several cycles, the number of each and its part.
    let in_cycle = |number: usize| {
        let cycle = steps[number].cycle?;
        let all = steps
            .iter()
            .filter(|step| step.cycle == Some(cycle))
            .count();
        let before = steps[..number].iter().rev();
        let place = before.take_while(|step| step.cycle == Some(cycle)).count() + 1;
        Some((cycle - 1) as f64 + place as f64 / all as f64)
    };
    let time = |number: usize| in_cycle(number).unwrap_or(steps[number].factor);
    let times: Vec<f64> = (0..steps.len()).map(time).collect();
    write(directory, "solution.pvd", index(&times, ending))
}

/// The text of `solution.pvd` for steps with these load factors, or times.
fn index(factors: &[f64], ending: &str) -> String {
    let increase = factors.is_sorted_by(|a, b| a < b);
    let mut text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n"
            .to_owned();
    for (number, &factor) in (1..).zip(factors) {
        let time = if increase { factor } else { f64::from(number) };
        put(
            &mut text,
            format_args!(
                "<DataSet timestep=\"{time}\" part=\"0\" file=\"solution-{number:03}.{ending}\"/>"
            ),
        );
    }
    text + "</Collection>\n</VTKFile>\n"
}

/// Writes `report.json`.
pub(crate) fn write_report(directory: &Path, report: &Report) -> Result<PathBuf, OutputError> {
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
            (index(factors, "vtu").split("timestep=\"").skip(1))
                .map(|rest| rest.split('"').next().unwrap_or_default().to_owned())
                .collect()
        };
        assert_eq!(times(&[0.5, 1.0]), ["0.5", "1"]);
        assert_eq!(times(&[1.0, 0.0, 1.0]), ["1", "2", "3"]);
        assert!(index(&[1.0, 2.0], "vtu").contains("part=\"0\" file=\"solution-002.vtu\"/>\n"));
    }

    #[test]
    fn an_impossible_directory_is_reported_at_once() {
        let place = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
        let file = place.path().join("file");
        std::fs::write(&file, b"").unwrap_or_else(|error| panic!("{error}"));
        let error = prepare(&file.join("results"), &[]).map_err(|error| error.to_string());
        assert!(error.is_err_and(|text| text.starts_with("cannot write ")));
        assert!(prepare(&place.path().join("new/results"), &[]).is_ok());
    }

    #[test]
    fn results_are_known_by_their_names() {
        for name in [
            "report.json",
            "solution.vtu",
            "solution-012.vtu",
            "solution-1000.vtu",
            "solution.pvtu",
            "solution-012.pvtu",
            "solution-p0.vtu",
            "solution-012-p13.vtu",
            "contact.csv",
            "contact-003.csv",
            "deformed-001.svg",
            "contact.svg",
            "contact-2.svg",
            "contact-001.svg",
            "contact-12-003.svg",
            "lambda_normal.mtx",
            ".solution-001.vtu.part",
        ] {
            assert!(is_result(name), "{name}");
        }
        for name in [
            "solution",
            "solution-.vtu",
            "solution-1.vtu",
            "solution-p.vtu",
            "solution-012p3.vtu",
            "solution-1-p3.vtu",
            "solution-old.vtu",
            "solution001.vtu",
            "my-solution.vtu",
            "contact-3.csv",
            "contact-02-001.svg",
            "contact-2-1.svg",
            "contact-1-2-003.svg",
            "report.json~",
            "Report.json",
            "K.mtx",
            ".part",
            "..report.json.part.part",
        ] {
            assert!(!is_result(name), "{name}");
        }
    }
}
