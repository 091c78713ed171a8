//! `[solver]`: tolerances and limits.

use super::{Case, CaseError};
use crate::quasistatic;
use crate::ssnm;
use serde::Deserialize;
use std::time::Duration;

/// `[solver]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverTable {
    /// ε, relative to the first error.
    pub tolerance: f64,
    /// ρ = β / σ_max.
    pub beta: f64,
    /// Of Algorithm ISSNM, as `c_fact`.
    pub r_tol: f64,
    /// Of Algorithm ISSNM, as `r_tol`.
    pub c_fact: f64,
    /// Algorithm ISSNM, or SSNM.
    pub method: ssnm::Method,
    /// Outer steps of one solve at most.
    pub max_iterations: usize,
    /// For the whole run, such as `10min`; none if left out.
    pub time_limit: Option<String>,
}

impl Default for SolverTable {
    fn default() -> Self {
        let defaults = ssnm::NewtonSettings::default();
        Self {
            tolerance: defaults.tolerance,
            beta: defaults.beta,
            r_tol: defaults.r_tol,
            c_fact: defaults.c_fact,
            method: defaults.method,
            max_iterations: defaults.max_iterations,
            time_limit: None,
        }
    }
}

impl Case {
    /// The solver table as settings.
    pub fn settings(&self) -> quasistatic::StepSettings {
        let s = &self.tables.solver;
        quasistatic::StepSettings {
            ssnm: ssnm::NewtonSettings {
                tolerance: s.tolerance,
                beta: s.beta,
                r_tol: s.r_tol,
                c_fact: s.c_fact,
                method: s.method,
                max_iterations: s.max_iterations,
                time_limit: self.time_limit,
                ..Default::default()
            },
        }
    }

    /// Checks the solver table; its time limit, if that can be counted.
    pub(super) fn check_solver(&self) -> Result<Option<Duration>, CaseError> {
        let s = &self.tables.solver;
        if let Err(error) = self.settings().ssnm.check() {
            return self.invalid(&format!("solver.{}", error.field), error.to_string());
        }
        let Some(limit) = &s.time_limit else {
            return Ok(None);
        };
        duration(limit).or_else(|error| {
            self.invalid(
                "solver.time_limit",
                format!(
                    "time_limit = \"{limit}\" is not a duration such as \"10min\" or \"90s\": {error}"
                ),
            )
        })
    }
}

/// A duration such as "2h 30min"; None if it overflows, which is as good as no limit.
fn duration(text: &str) -> Result<Option<Duration>, humantime::DurationError> {
    // Piece by piece: humantime itself panics where a sum of several overflows.
    let mut pieces = vec![String::new()];
    let mut before = ' ';
    for c in text.chars() {
        if c.is_ascii_digit() && before.is_alphabetic() {
            pieces.push(String::new());
        }
        if !c.is_whitespace() {
            before = c;
        }
        pieces.last_mut().expect("there is one").push(c);
    }
    let mut sum = Some(Duration::ZERO);
    for piece in &pieces {
        let part = match humantime::parse_duration(piece) {
            Ok(part) => Some(part),
            // If only the digits are to blame.
            Err(humantime::DurationError::NumberOverflow)
                if humantime::parse_duration(&piece.replace(|c: char| c.is_ascii_digit(), "0"))
                    .is_ok() =>
            {
                None
            }
            Err(error) => return Err(error),
        };
        sum = sum.zip(part).and_then(|(sum, part)| sum.checked_add(part));
    }
    Ok(sum)
}
