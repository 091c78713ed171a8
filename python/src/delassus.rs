//! Contacts with a Delassus operator from Python, as a matrix or as a product.

use crate::arrays::{Sparse, entries, flat};
use crate::errors::SolveError;
use crate::problem::word;
use crate::settings;
use crate::watch::{News, Voice, watched};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use signorini::dual::{DelassusDual, DualError};
use signorini::engine::EngineOptions;
use signorini::problem::{ContactProblem, ProblemError};
use signorini::quasistatic::{self, Load, State, StepError, StepSettings};
use signorini::sparse::Csr;
use signorini::ssnm::{Cause, RecycledSubspace};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The result of a solve.
struct Made {
    impulses: Vec<f64>,
    velocities: Vec<f64>,
    states: Vec<&'static str>,
    report: String,
}

/// Why nothing has.
enum Failure {
    Problem(ProblemError),
    Step(StepError),
    Product(DualError),
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        let of_dual = |error: DualError| match error {
            // An exception from Python is passed on unchanged.
            DualError::Other(error) => match error.downcast::<PyErr>() {
                Ok(error) => *error,
                Err(error) => SolveError::new_err(error.to_string()),
            },
            error => SolveError::new_err(error.to_string()),
        };
        match failure {
            Failure::Problem(error) => PyValueError::new_err(error.from_zero().to_string()),
            Failure::Product(error) => of_dual(error),
            Failure::Step(StepError { error, .. }) => match error.cause {
                Cause::Operator(error) => of_dual(error),
                cause => PyValueError::new_err(cause.to_string()),
            },
        }
    }
}

/// Solves u = W r + q under Coulomb's law, all with the normal entry first, contact by contact. W is a matrix or, with its
/// diagonal, a function.
#[pyfunction]
#[pyo3(signature = (matrix, product, diagonal, q, friction, dimension, hears, keywords))]
#[expect(clippy::too_many_arguments, reason = "one for each vector")]
pub fn solve_delassus<'py>(
    py: Python<'py>,
    matrix: Option<Sparse>,
    product: Option<Py<PyAny>>,
    diagonal: PyReadonlyArray1<f64>,
    q: PyReadonlyArray1<f64>,
    friction: PyReadonlyArray1<f64>,
    dimension: usize,
    hears: Option<Bound<PyAny>>,
    keywords: Bound<PyDict>,
) -> PyResult<(Bound<'py, PyDict>, Option<PyErr>)> {
    let mut settings = StepSettings::default();
    settings::apply(&keywords, &mut EngineOptions::default(), &mut settings)?;
    let interrupt = Arc::new(AtomicBool::new(false));
    settings.ssnm.interrupt = Some(Arc::clone(&interrupt));
    let matrix = match &matrix {
        Some(matrix) => Some((matrix.matrix("W")?.to_rows("W")).map_err(Failure::Problem)?),
        None => None,
    };
    let times = |x: &[f64], y: &mut [f64]| match (&matrix, &product) {
        (Some(matrix), _) => {
            matrix.mul(x, y);
            Ok(())
        }
        (None, Some(product)) => Python::attach(|py| {
            let made = product.call1(py, (PyArray1::from_slice(py, x),))?;
            let made: PyReadonlyArray1<f64> = made.extract(py)?;
            y.copy_from_slice(entries("W", &made)?);
            Ok(())
        })
        .map_err(|error: PyErr| DualError::Other(Box::new(error))),
        (None, None) => unreachable!("one of both is given"),
    };
    let given = [
        entries("diagonal", &diagonal)?,
        entries("q", &q)?,
        entries("friction", &friction)?,
    ];
    let (made, stopped) = watched(py, hears.as_ref(), &interrupt, |voice| match dimension {
        2 => solved::<2>(given, times, matrix.as_ref(), &settings, &voice),
        _ => solved::<3>(given, times, matrix.as_ref(), &settings, &voice),
    })?;
    let made = made?;
    let all = PyDict::new(py);
    all.set_item("impulses", flat(py, made.impulses))?;
    all.set_item("velocities", flat(py, made.velocities))?;
    all.set_item("state", made.states)?;
    all.set_item("report", made.report)?;
    Ok((all, stopped))
}

fn solved<const D: usize>(
    [diagonal, q, friction]: [&[f64]; 3],
    times: impl FnMut(&[f64], &mut [f64]) -> Result<(), DualError>,
    matrix: Option<&Csr>,
    settings: &StepSettings,
    voice: &Voice,
) -> Result<Made, Failure> {
    let problem = ContactProblem::<D>::from_delassus(diagonal, q, friction);
    let problem = problem.map_err(Failure::Problem)?;
    let mut dual = DelassusDual::new(&problem, times);
    if let Some(matrix) = matrix {
        dual = dual.with_matrix(matrix.clone());
    }
    voice.tell(News::Begins(1, 1, 1.0));
    let solution = quasistatic::solve_step(
        &problem,
        &Load::of(&problem),
        &State::at_rest(&problem),
        &mut dual,
        settings,
        &mut RecycledSubspace::default(),
        |event| match event {
            quasistatic::Event::Newton(step) if voice.is_heard() => {
                let mut row = serde_json::to_value(step).unwrap_or_default();
                row["load_step"] = 1.into();
                match voice.ask(row.to_string(), step.to_string()) {
                    true => ControlFlow::Continue(()),
                    false => ControlFlow::Break(()),
                }
            }
            _ => ControlFlow::Continue(()),
        },
    )
    .map_err(Failure::Step)?;
    voice.tell(News::Ends(1, word(solution.status)));
    let impulses = dual.impulses(&solution.lambda);
    let mut velocities = dual.times(&impulses).map_err(Failure::Product)?;
    velocities.iter_mut().zip(q).for_each(|(u, q)| *u += q);
    let state = |i| match (&solution.sets, friction[i]) {
        (sets, _) if sets.is_separated(i) => "separated",
        (_, 0.0) => "contact",
        (sets, _) if !sets.slips(i) && solution.slip_bound[i] > 0.0 => "stick",
        _ => "slip",
    };
    let report = serde_json::json!({
        "status": word(solution.status),
        "iter": solution.iter(),
        "n_A": solution.n_a(),
        "kkt": solution.kkt,
    });
    Ok(Made {
        impulses,
        velocities,
        states: (0..friction.len()).map(state).collect(),
        report: report.to_string(),
    })
}
