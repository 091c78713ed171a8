//! Errors of the library as exceptions of Python, and panics, which are defects, as a separate one.

use crate::fork::with_threads;
use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use signorini::case::{BuildError, CaseError};
use signorini::engine::EngineError;
use signorini::matrix_market::MatrixMarketError;
use signorini::mesh::FileError;
use signorini::solve;
use signorini::stiffness::cholesky::FactorError;
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};

pyo3::create_exception!(
    signorini,
    ModelError,
    PyValueError,
    "A mesh, a model or a case is inconsistent; the text gives the remedy."
);
pyo3::create_exception!(
    signorini,
    SolveError,
    PyRuntimeError,
    "A problem could not be solved: K is singular, for example, or a GPU failed."
);

/// A bad argument, by its name.
pub fn argument(name: &str, message: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(format!("{name}: {message}"))
}

/// A file that cannot be read, as Python's exception for it.
fn unread(text: String, source: &std::io::Error) -> PyErr {
    std::io::Error::new(source.kind(), text).into()
}

pub fn of_case(error: CaseError) -> PyErr {
    match &error {
        CaseError::Io { source, .. } => unread(error.to_string(), source),
        _ => ModelError::new_err(error.to_string()),
    }
}

pub fn of_build(error: BuildError) -> PyErr {
    let text = error.to_string();
    match error {
        BuildError::Case(error) => of_case(error),
        BuildError::Mesh(FileError::Io { source, .. })
        | BuildError::Matrix(MatrixMarketError::Io { source, .. }) => unread(text, &source),
        _ => ModelError::new_err(text),
    }
}

pub fn of_engine(mut error: EngineError) -> PyErr {
    // Python counts from 0.
    if let EngineError::Factor(FactorError::NotPositiveDefinite { unknown, .. }) = &mut error {
        *unknown -= 1;
    }
    SolveError::new_err(error.to_string())
}

pub fn of_solve(error: solve::Error) -> PyErr {
    match error {
        solve::Error::Settings(error) => PyValueError::new_err(error.to_string()),
        solve::Error::Model(error) => ModelError::new_err(error.to_string()),
        error => SolveError::new_err(error.to_string()),
    }
}

/// A panic, which is a defect of the library.
pub fn of_panic(panic: &(dyn Any + Send)) -> PyErr {
    let text = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    SolveError::new_err(format!(
        "this is a defect of signorini, please report it with what led to it: {text}"
    ))
}

/// Works without the interpreter's lock; a panic is returned as an exception.
pub fn guarded<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    py.detach(|| catch_unwind(AssertUnwindSafe(|| with_threads(work))))
        .map_err(|panic| of_panic(panic.as_ref()))
}
