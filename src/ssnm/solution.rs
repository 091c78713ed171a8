//! The result of a solve.

use super::sets::{SetSizes, Sets};
use super::settings::SettingsError;
use crate::control::Stopped;
use crate::dual::DualError;
use crate::problem::Kkt;
use std::fmt;

/// The end of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Status {
    /// err ≤ ε err⁰ (or ε times the effect of the forces on their own nodes, or rounding). The nodal forces are as
    /// accurate as ε requires, and the optimality conditions checked in f64 against K are met to 10 ε.
    Converged,
    /// `max_iterations` reached.
    IterationLimit,
    /// Progress has stopped: the tolerance is below the accuracy of f64, or of PCG, here, or under Coulomb's law no
    /// step lowers the error.
    Stagnated,
    /// Contact and friction do not balance the loads on a body that can move as a whole. No forces within the law do,
    /// or, under Coulomb's law, none that contact reaches ([`crate::quasistatic::NotHeld::proven`]). λ balances them as
    /// well as possible ([`Solution::imbalance`]), and no outer steps are made in the former case.
    NotHeld,
    /// `time_limit` reached.
    TimeLimit,
    /// Stopped from outside.
    Interrupted,
    /// With large displacements: in balance, but the slightest push makes the bodies move elsewhere, like a column that has
    /// stayed straight under more than its buckling load.
    Unstable,
}

impl From<Stopped> for Status {
    fn from(stopped: Stopped) -> Self {
        match stopped {
            Stopped::TimeLimit => Self::TimeLimit,
            Stopped::Interrupted => Self::Interrupted,
        }
    }
}

/// A solve that could not be finished, with its results so far.
#[derive(Debug, thiserror::Error)]
#[error("{cause}")]
#[non_exhaustive]
pub struct SolveError {
    /// The cause.
    pub cause: Cause,
    /// The best λ reached: a start for another solve ([`super::WarmStart::lambda`]). Empty where the operator or a setting
    /// does not fit.
    pub lambda: Vec<f64>,
    /// The outer steps made.
    pub history: Vec<Step>,
}

/// The reason why a solve could not be finished.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Cause {
    /// The request was invalid.
    #[error(transparent)]
    NewtonSettings(#[from] SettingsError),
    /// The dual operator does not belong to the problem.
    #[error(
        "the dual operator was made for another problem, with {} rows of K and {} multipliers instead of {} and {}",
        found.0, found.1, expected.0, expected.1
    )]
    OtherProblem {
        /// Rows of K and of B that the problem has.
        expected: (usize, usize),
        /// The sizes of the operator.
        found: (usize, usize),
    },
    /// The operator has failed.
    #[error(transparent)]
    Operator(#[from] DualError),
}

impl<C: Into<Cause>> From<C> for SolveError {
    /// Nothing had been reached.
    fn from(cause: C) -> Self {
        Self {
            cause: cause.into(),
            lambda: Vec::new(),
            history: Vec::new(),
        }
    }
}

/// One outer step, as the observer sees it and the report lists it.
#[derive(Clone, Copy, Debug, serde::Serialize)]
#[non_exhaustive]
pub struct Step {
    /// Number of the step, from 1.
    pub iter: usize,
    /// Newton steps of the problem on the surrogate; in the algorithms as printed, CG iterations.
    pub inner: usize,
    /// Products with A since the start.
    #[serde(rename = "n_A")]
    pub n_a: usize,
    /// err / err⁰ after it.
    pub err: f64,
    /// The same as predicted by the surrogate; missing in the algorithms as printed.
    pub predicted: Option<f64>,
    /// Sizes of the sets it worked with.
    pub sets: SetSizes,
    /// Multipliers that changed their set since the step before.
    pub changes: usize,
    /// Whether the safeguard replaced the Newton step of an algorithm as printed.
    pub safeguarded: bool,
}

/// The line on it during a solve.
impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let nodes = self.sets.total();
        write!(
            f,
            "step {}: err {:.2e}, {} products, {} of {nodes} nodes in contact",
            self.iter,
            self.err,
            self.n_a,
            nodes - self.sets.separated
        )
    }
}

/// Figures of a solve.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Info {
    /// Outer steps.
    pub iter: usize,
    /// Products with A inside the method.
    pub n_a: usize,
    /// `iter` and `n_a` where the error was small enough first: the paper's stopping test, before the optimality
    /// conditions were checked.
    pub first_met: Option<(usize, usize)>,
    /// Products spent on the estimate of σ_max, which only the algorithms as printed make beforehand.
    pub n_a_sigma: usize,
    /// ρ = β / σ_max.
    pub rho: f64,
    /// σ_max from Lanczos, or from the products of the method.
    pub sigma_max: f64,
    /// err⁰, not relative to anything.
    pub first_error: f64,
    /// err at the end relative to err⁰ or, if that is larger, to the effect of the forces on their own nodes; 0 where
    /// it is rounding.
    pub err_relative: f64,
    /// The optimality conditions at the end.
    pub kkt: Kkt,
    /// A row per outer step.
    pub history: Vec<Step>,
    /// Seconds for b and σ_max.
    pub setup_seconds: f64,
    /// Seconds for the outer steps and the final check.
    pub solve_seconds: f64,
}

/// The result of a solve; after a stop without convergence, the best point found.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Solution<const D: usize = 2> {
    /// Its end.
    pub status: Status,
    /// u, an entry per row of K.
    pub u: Vec<f64>,
    /// λ = (λν, λτ) ∈ Λ, length D m: λν, then λτ node by node.
    pub lambda: Vec<f64>,
    /// The sets at the end.
    pub sets: Sets<D>,
    /// Rᵀ(f − Bᵀλ) for the motions of [`crate::problem::System::floating_bodies`], if that cannot be made zero: the
    /// push on bodies that are not held. Empty otherwise.
    pub imbalance: Vec<f64>,
    /// The motion that it drives and that no forces of Λ resist, as coefficients of the same motions; empty as above.
    pub mechanism: Vec<f64>,
    /// Figures.
    pub info: Info,
}
