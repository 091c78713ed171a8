//! A case as an algebraic one: K, f, N, T, d, g or μ in files of Matrix Market, and the case file that names them.

use super::files::write_by;
use super::{OutputError, write_whole};
use crate::case::Case;
use crate::contact::Space;
use crate::engine::{self, Engine};
use crate::matrix_market::{write_columns, write_matrix};
use crate::mesh::ElementKind;
use crate::model::{Analysis, Changes};
use crate::problem::ContactProblem;
use crate::quasistatic::{Load, State};
use crate::solve::{self, Changed, Event};
use crate::ssnm::Status;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use toml_edit::{DocumentMut, Table, value};

/// A case could not be exported, or not all of it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A load step could not be made.
    #[error(transparent)]
    Solve(#[from] solve::Error),
    /// Contacts wear.
    #[error("load steps in which contacts wear cannot be exported: leave out wear")]
    Worn,
    /// Displacements are large: no single matrices have the solution.
    #[error("large displacements cannot be exported as matrices: state geometry = \"small\"")]
    Large,
    /// Load steps are repeated.
    #[error("repeated load steps cannot be exported: state cycles = 1")]
    Cycles,
    /// A load step has not converged, and the next one starts from its end.
    #[error(
        "load step {step} has not converged, and later steps would start from it: the cases up to this one are written"
    )]
    NotConverged {
        /// Its number, from 1.
        step: usize,
    },
}

/// The vectors and matrices of a case in a directory, and their names in its case file.
struct Files<'a> {
    directory: &'a Path,
    written: Vec<PathBuf>,
}

impl Files<'_> {
    /// Writes vectors, or points, as columns.
    fn columns(&mut self, name: &str, columns: &[Vec<f64>]) -> Result<String, OutputError> {
        let name = format!("{name}.mtx");
        let path = write_by(self.directory, &name, |to| write_columns(to, columns))?;
        self.written.push(path);
        Ok(name)
    }

    /// Writes a matrix without the columns, and rows of K, that were added to complete a block.
    fn matrix<I: Iterator<Item = (usize, usize, f64)>>(
        &mut self,
        name: &str,
        shape: [usize; 2],
        symmetric: bool,
        entries: impl Fn() -> I,
    ) -> Result<String, OutputError> {
        let name = format!("{name}.mtx");
        let is_inside = |&(i, j, _): &(usize, usize, f64)| i < shape[0] && j < shape[1];
        let entries = || entries().filter(is_inside);
        let path = write_by(self.directory, &name, |to| {
            write_matrix(to, shape, symmetric, entries)
        })?;
        self.written.push(path);
        Ok(name)
    }
}

/// Writes each load step of a case as a separate algebraic case with the same solution u and λ: `case.toml`, or
/// `case-001.toml` … for several, and the files that these name. All but the first depend on the end of the step before, the
/// origin of slip, so all but the last are solved. `log` is that of [`Engine::new`].
///
/// # Errors
/// If a file cannot be written, or would overwrite an input of the case; if contacts wear, displacements are large, or load steps are repeated; if a step fails or does not converge. Files
/// written before stay.
pub fn export<const D: usize>(
    directory: &Path,
    case: &Case,
    analysis: Analysis<D>,
    options: engine::EngineOptions,
    log: impl FnMut(&str) + Send + 'static,
) -> Result<Vec<PathBuf>, ExportError>
where
    ElementKind: Space<D>,
{
    let problem = analysis.problem;
    let n_steps = analysis.n_steps();
    if (analysis.elastic).is_some_and(|elastic| elastic.wearing().is_some()) {
        return Err(ExportError::Worn);
    }
    if (analysis.elastic).is_some_and(|elastic| elastic.is_large()) {
        return Err(ExportError::Large);
    }
    if analysis.n_cycles() > 1 {
        return Err(ExportError::Cycles);
    }
    super::files::refuse_inputs(directory, &case.inputs(), |name| {
        name.ends_with(".mtx") || name.ends_with(".toml")
    })?;
    let mut files = Files {
        directory,
        written: Vec::new(),
    };
    let first = analysis.step(0).map_err(solve::Error::from)?;
    let changes = first.is_some_and(|data| data.changes.is_some());
    let mut shared = shared_table(&mut files, problem, changes)?;
    if problem.has_dependent_rows() {
        shared["dependent_rows"] = value(true);
    }
    let mut state = State::at_rest(problem);
    let whole = problem.elsewhere();
    let mut write = |number: usize, load: &OfStep, state: &State| -> Result<(), OutputError> {
        let suffix = match n_steps {
            1 => String::new(),
            _ => format!("-{number:03}"),
        };
        let mut table = shared.clone();
        let (load, changes) = load;
        let changed = (changes.as_ref()).map(|changes| Changed::new(&whole, load, state, changes));
        let (of_step, load, state) = match &changed {
            Some(one) => (&one.problem, &one.load, &one.start),
            None => (&whole, load, state),
        };
        if changed.is_some() {
            laws(&mut files, &mut table, of_step, &suffix)?;
        }
        let force = load.force[..problem.n()].to_vec();
        table["load"] = value(files.columns(&format!("f{suffix}"), &[force])?);
        table["gap"] =
            value(files.columns(&format!("d{suffix}"), std::slice::from_ref(&load.gap))?);
        if load.gap.iter().any(|&d| d < 0.0) {
            table["interference"] = value(true);
        }
        let origin = state.slip_origin(problem, load);
        if origin.iter().any(|&s| s != 0.0) {
            table["slip_origin"] = value(files.columns(&format!("s{suffix}"), &[origin])?);
        }
        let title = match n_steps {
            1 => case.tables.title.clone(),
            _ => format!("{}, load step {number}", case.tables.title),
        };
        let mut document = DocumentMut::new();
        document["title"] = value(title.trim_start_matches(", "));
        for (key, item) in case.kept_tables(["units", "solver"]) {
            document[key] = item;
        }
        document["algebraic"] = toml_edit::Item::Table(table);
        let path = directory.join(format!("case{suffix}.toml"));
        write_whole(&path, document.to_string().as_bytes())?;
        files.written.push(path);
        Ok(())
    };
    let load_of = |number: usize| -> Result<OfStep, solve::Error> {
        let data = analysis.step(number - 1)?;
        Ok(data.map_or_else(
            || (Load::of(problem), None),
            |data| (data.load, data.changes),
        ))
    };
    if n_steps == 1 {
        write(1, &load_of(1)?, &state)?;
        return Ok(files.written);
    }
    let mut engine = Engine::new(problem, options, log).map_err(solve::Error::from)?;
    let mut outcome: Result<(), ExportError> = Ok(());
    analysis.solve_on(&mut engine, &case.settings(), |event| {
        let mut is_last = false;
        outcome = match event {
            Event::Begins { number, .. } => {
                // Nothing starts from the end of the last one.
                is_last = number == n_steps;
                load_of(number)
                    .map_err(ExportError::from)
                    .and_then(|load| Ok(write(number, &load, &state)?))
            }
            Event::Within(_) => Ok(()),
            Event::Ends(solved) => {
                if let Some(data) = solved.data {
                    state = solved.solution.state(&data.load);
                }
                match solved.solution.status {
                    Status::Converged => Ok(()),
                    _ => Err(ExportError::NotConverged {
                        step: solved.number,
                    }),
                }
            }
        };
        if is_last || outcome.is_err() {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    })?;
    outcome?;
    Ok(files.written)
}

/// The load of a step, and its contacts if these change.
type OfStep = (Load, Option<Changes>);

/// g or μ, and which nodes are tied.
fn laws<const D: usize, K>(
    files: &mut Files,
    table: &mut Table,
    problem: &ContactProblem<D, K>,
    suffix: &str,
) -> Result<(), OutputError> {
    let m = problem.m();
    for key in ["friction_coefficient", "slip_bound", "tied"] {
        table.remove(key);
    }
    let mut name = |key: &str, called: &str, column: Vec<f64>| -> Result<(), OutputError> {
        table[key] = value(files.columns(&format!("{called}{suffix}"), &[column])?);
        Ok(())
    };
    let (mu, g) = (problem.friction_coefficient(), problem.slip_bound());
    if !mu.is_empty() {
        name("friction_coefficient", "mu", mu.to_vec())?;
    }
    if mu.is_empty() || g.iter().any(|&g| g > 0.0) {
        // Where a node has Coulomb's law, and where it is tied, the slip bound does not matter.
        let g = g.iter().enumerate().map(|(i, &g)| match mu.get(i) {
            Some(&mu) if mu > 0.0 => 0.0,
            _ if g.is_finite() => g,
            _ => 0.0,
        });
        name("slip_bound", "g", g.collect())?;
    }
    let tied = (0..m).map(|i| f64::from(u8::from(problem.is_tied(i))));
    if (0..m).any(|i| problem.is_tied(i)) {
        name("tied", "tied", tied.collect())?;
    }
    Ok(())
}

/// The data common to all load steps: K, N, T, and the points; and g or μ where contacts are the same in all of them.
fn shared_table<const D: usize>(
    files: &mut Files,
    problem: &ContactProblem<D>,
    changes: bool,
) -> Result<Table, OutputError> {
    let (n, m) = (problem.n(), problem.m());
    let mut table = Table::new();
    let mut name = |key: &str, file: String| table[key] = value(file);
    name(
        "stiffness",
        files.matrix("K", [n, n], true, || problem.stiffness().triplets())?,
    );
    name(
        "normal",
        files.matrix("N", [m, n], false, || problem.normal().triplets())?,
    );
    let rows = problem.tangential().n_rows();
    name(
        "tangential",
        files.matrix("T", [rows, n], false, || problem.tangential().triplets())?,
    );
    if !changes {
        laws(files, &mut table, problem, "")?;
    }
    let mut name = |key: &str, file: String| table[key] = value(file);
    let compliance = problem.contact_compliance();
    if !compliance.is_empty() {
        name("compliance", files.columns("c", &[compliance.to_vec()])?);
    }
    if let Some(points) = problem.coordinates() {
        let column = |c: usize| points.iter().map(|point| point[c]).collect();
        let columns: Vec<Vec<f64>> = (0..D).map(column).collect();
        name("coordinates", files.columns("coordinates", &columns)?);
    }
    Ok(table)
}
