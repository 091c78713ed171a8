//! The settings of a solve.

use super::numbers::Numbers;
use super::surrogate::Surrogate;
use crate::problem::ContactProblem;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

/// The method for a contact problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Deserialize, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Newton's method on a surrogate of A from all known products, one product in each outer step.
    #[default]
    Multisecant,
    /// Algorithm ISSNM of the paper: inner problems (11) solved to a tolerance that follows the error.
    Inexact,
    /// Algorithm SSNM of the paper: inner problems solved to rounding, or to the limit of CG.
    Exact,
}

/// Settings of the method; the defaults are those of the case file.
#[derive(Clone, Debug)]
pub struct NewtonSettings {
    /// ε, in (0, 1): the tolerance. The error err = ‖r̃_ρ(P_Λ(λ))‖ is reached relative to err⁰, that at λ = 0 (or,
    /// where bodies can move as a whole, at the least forces that balance them). In addition the possible effect of the
    /// remaining gradient is made so small that nodal pressures are accurate to 3000 ε of the largest.
    pub tolerance: f64,
    /// β > 0: ρ = β / σ_max.
    pub beta: f64,
    /// r_tol of Step 3.1, in (0, 1).
    pub r_tol: f64,
    /// c_fact of Step 3.1, in (0, 1).
    pub c_fact: f64,
    /// Multisecant, or an algorithm of the paper as printed.
    pub method: Method,
    /// Outer steps at most.
    pub max_iterations: usize,
    /// Wall time at most.
    pub time_limit: Option<Duration>,
    /// Set from outside, by another thread, to stop at the next product with A.
    pub interrupt: Option<Arc<AtomicBool>>,
    /// Numbers of the method that the paper does not give, for research.
    pub numbers: Numbers,
}

impl Default for NewtonSettings {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            beta: 1.0,
            r_tol: 0.1,
            c_fact: 0.9,
            method: Method::default(),
            max_iterations: 500,
            time_limit: None,
            interrupt: None,
            numbers: Numbers::default(),
        }
    }
}

/// A setting, or an initial vector, that no solve accepts.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} must {must}")]
pub struct SettingsError {
    /// Its name.
    pub field: &'static str,
    /// The condition, as the end of a sentence.
    pub must: String,
}

impl SettingsError {
    pub(crate) fn unless(good: bool, field: &'static str, must: &str) -> Result<(), Self> {
        let must = must.to_owned();
        if good {
            Ok(())
        } else {
            Err(Self { field, must })
        }
    }

    /// An error unless a number is in (0, 1).
    pub(crate) fn unless_part(value: f64, field: &'static str) -> Result<(), Self> {
        Self::unless(value > 0.0 && value < 1.0, field, "lie between 0 and 1")
    }

    /// Unless a vector has the length, and finite entries.
    pub(crate) fn unless_numbers(
        values: &[f64],
        length: usize,
        field: &'static str,
    ) -> Result<(), Self> {
        let found = values.len();
        let must = format!("have {length} entries, it has {found}");
        Self::unless(found == length, field, &must)?;
        let finite = values.iter().all(|v| v.is_finite());
        Self::unless(finite, field, "have finite entries")
    }
}

impl NewtonSettings {
    /// Checks that the numbers are valid for any problem; the same for a case file, for Rust, and at the start of each
    /// solve.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn check(&self) -> Result<(), SettingsError> {
        SettingsError::unless_part(self.tolerance, "tolerance")?;
        let positive = self.beta > 0.0 && self.beta.is_finite();
        SettingsError::unless(positive, "beta", "be positive")?;
        SettingsError::unless_part(self.r_tol, "r_tol")?;
        SettingsError::unless_part(self.c_fact, "c_fact")?;
        Ok(())
    }
}

/// The start of a solve that does not begin from zero.
#[derive(Debug, Default)]
pub struct WarmStart<'a> {
    /// λ⁰, length D m (2m in the plane), e.g. the multipliers of an earlier solve; zero if None.
    pub lambda: Option<&'a [f64]>,
    /// Rᵀu before, for the motions of [`System::floating_bodies`](crate::problem::System::floating_bodies): the rigid-body
    /// position where neither load nor contact determines it; zero if None.
    pub motion: Option<&'a [f64]>,
    /// The pairs that earlier solves with the same K, N and T found; this one adds to them.
    pub recycled: Option<&'a mut RecycledSubspace>,
}

impl WarmStart<'_> {
    /// Whether it belongs to a problem of this size.
    pub(super) fn check_for<const D: usize, K>(
        &self,
        problem: &ContactProblem<D, K>,
    ) -> Result<(), SettingsError> {
        let len = D * problem.m();
        if let Some(lambda) = self.lambda {
            SettingsError::unless_numbers(lambda, len, "start.lambda")?;
        }
        if let Some(motion) = self.motion {
            let n_modes = problem.floating_bodies().n_modes();
            SettingsError::unless_numbers(motion, n_modes, "start.motion")?;
        }
        let fits = (self.recycled.as_ref()).is_none_or(|known| known.surrogate.fits_length(len));
        let must = "be that of a problem of the same size";
        SettingsError::unless(fits, "start.recycled", must)
    }
}

/// Known products with A, and its spectrum: valid for every load, gap, slip bound and coefficient of friction, as long
/// as K, N and T stay the same. With large displacements it begins as what is known of a similar A.
#[derive(Clone, Debug, Default)]
pub struct RecycledSubspace {
    /// Products with A that earlier solves have made.
    pub(super) surrogate: Surrogate,
    /// σ_max and the mean of diag(A), where an algorithm as printed has estimated them.
    pub(super) spectrum: Option<(f64, f64)>,
}

impl RecycledSubspace {
    /// Keeps what is known of A for a similar one, with rows to which `change` takes vectors of the old ones: orthogonally, except for
    /// rows that are lost. `factors` does so with factors of rows.
    pub(crate) fn renew(
        &mut self,
        change: impl Fn(&[f64]) -> Vec<f64>,
        factors: impl Fn(&[f64]) -> Vec<f64>,
    ) {
        self.spectrum = None;
        self.surrogate.renew(change, factors);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn invalid_settings_explain_their_fault() {
        let good = NewtonSettings::default();
        assert_eq!(good.check(), Ok(()));
        for value in [0.0, 1.0, -0.5, f64::NAN, f64::INFINITY] {
            let wrong = |settings: NewtonSettings, field: &str| {
                let text = settings.check().expect_err("it is wrong").to_string();
                assert!(text.starts_with(field) && text.contains(" must "), "{text}");
            };
            wrong(
                NewtonSettings {
                    tolerance: value,
                    ..good.clone()
                },
                "tolerance",
            );
            wrong(
                NewtonSettings {
                    r_tol: value,
                    ..good.clone()
                },
                "r_tol",
            );
            wrong(
                NewtonSettings {
                    c_fact: value,
                    ..good.clone()
                },
                "c_fact",
            );
            if value != 1.0 {
                wrong(
                    NewtonSettings {
                        beta: value,
                        ..good.clone()
                    },
                    "beta",
                );
            }
        }
    }
}
