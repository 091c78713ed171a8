//! Keyword arguments as settings of a solve.

use crate::errors::argument;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyInt, PyString};
use signorini::backend::{GpuOptions, Precision};
use signorini::engine::{Device, EngineOptions, Stiffness};
use signorini::quasistatic::StepSettings;
use signorini::ssnm::Method;
use signorini::stiffness::pcg::Preconditioner;
use std::time::Duration;

/// One of several words.
fn word<T: Copy>(name: &str, value: &Bound<PyAny>, words: &[(&str, T)]) -> PyResult<T> {
    let known = || words.iter().map(|(word, _)| format!("\"{word}\""));
    let text = value.cast::<PyString>().ok();
    let found = text.and_then(|text| {
        let text = text.to_string_lossy();
        words.iter().find(|(word, _)| *word == text)
    });
    found.map(|&(_, meaning)| meaning).ok_or_else(|| {
        let known: Vec<String> = known().collect();
        let shown = value
            .repr()
            .map_or(String::new(), |repr| format!(", not {repr}"));
        argument(name, format!("must be one of {}{shown}", known.join(", ")))
    })
}

/// A number, or an error with its name.
fn number<'py, T: for<'a> FromPyObject<'a, 'py>>(
    name: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<T> {
    value
        .extract()
        .map_err(|_| match value.is_instance_of::<PyInt>() {
            true => argument(name, format!("{value} is out of range")),
            false => {
                let kind = value.get_type();
                argument(name, format!("expected a number, found {kind}"))
            }
        })
}

/// Applies the keywords for the engine and the settings of a solve; others stay as they are.
pub fn apply(
    keywords: &Bound<PyDict>,
    engine: &mut EngineOptions,
    settings: &mut StepSettings,
) -> PyResult<()> {
    for (key, value) in keywords {
        let name: String = key.extract()?;
        let name = name.as_str();
        if value.is_none() {
            continue;
        }
        let ssnm = &mut settings.ssnm;
        match name {
            "stiffness" => {
                engine.stiffness = word(
                    name,
                    &value,
                    &[
                        ("auto", Stiffness::Auto),
                        ("cholesky", Stiffness::Cholesky),
                        ("pcg", Stiffness::Pcg),
                    ],
                )?;
            }
            "backend" => {
                engine.place = word(
                    name,
                    &value,
                    &[
                        ("auto", Device::Auto),
                        ("cpu", Device::Cpu),
                        ("gpu", Device::Gpu),
                    ],
                )?;
            }
            "preconditioner" => {
                engine.preconditioner = word(
                    name,
                    &value,
                    &[
                        ("multigrid", Preconditioner::Multigrid),
                        ("block-jacobi", Preconditioner::BlockJacobi),
                    ],
                )?;
            }
            "precision" => {
                engine.gpu.precision = word(
                    name,
                    &value,
                    &[
                        ("auto", None),
                        ("f64", Some(Precision::F64)),
                        ("f32", Some(Precision::F32)),
                    ],
                )?;
            }
            "adapter" => {
                engine.gpu = GpuOptions {
                    adapter: Some(value.str()?.to_string()),
                    ..engine.gpu.clone()
                };
            }
            "method" => {
                ssnm.method = word(
                    name,
                    &value,
                    &[
                        ("multisecant", Method::Multisecant),
                        ("inexact", Method::Inexact),
                        ("exact", Method::Exact),
                    ],
                )?;
            }
            "tolerance" => ssnm.tolerance = number(name, &value)?,
            "beta" => ssnm.beta = number(name, &value)?,
            "r_tol" => ssnm.r_tol = number(name, &value)?,
            "c_fact" => ssnm.c_fact = number(name, &value)?,
            "max_iterations" => ssnm.max_iterations = number(name, &value)?,
            "time_limit" => {
                let seconds: f64 = number(name, &value)?;
                let limit = Duration::try_from_secs_f64(seconds);
                ssnm.time_limit = Some(limit.map_err(|_| {
                    argument(name, format!("must be a number of seconds, not {seconds}"))
                })?);
            }
            _ => return Err(argument(name, "no solve has such a setting")),
        }
    }
    settings
        .ssnm
        .check()
        .map_err(|error| pyo3::exceptions::PyValueError::new_err(error.to_string()))
}
