//! The paper's Table 1: its figures beside ours.

use crate::dual::DualOperator;
use crate::problem::ContactProblem;
use crate::ssnm::{self, Method, NewtonSettings, SolveError, Status};
use serde::Serialize;
use std::ops::ControlFlow;

/// The refinements k of the seven rows.
pub const SIZES: [usize; 7] = [1, 3, 5, 7, 9, 11, 13];
/// The five values of β of the columns.
pub const BETAS: [f64; 5] = [0.05, 1.0, 1.9, 20.0, 100.0];
/// Our tolerance ε; the paper does not give its own.
pub const TOLERANCE: f64 = 1e-4;

/// (iter, n_A) of the paper, a row per size, a column per β.
pub const PAPER: [[(usize, usize); 5]; 7] = [
    [(7, 35), (7, 35), (7, 35), (7, 36), (10, 48)],
    [(9, 49), (9, 49), (9, 49), (8, 41), (10, 52)],
    [(9, 48), (9, 48), (9, 48), (8, 43), (10, 55)],
    [(9, 49), (9, 49), (9, 49), (10, 59), (11, 62)],
    [(9, 51), (9, 51), (9, 51), (9, 45), (12, 72)],
    [(9, 53), (10, 57), (10, 57), (10, 59), (10, 54)],
    [(10, 59), (10, 59), (10, 59), (10, 61), (10, 56)],
];

/// Assumptions of the table that the paper does not give.
pub const ASSUMPTIONS: &str = "\
The paper gives n, m, β, iter and n_A. Assumed here: E = 21.19e10 Pa, ν = 0.277, plane strain, bilinear \
squares; top traction (0, −6e7 − (1/3)e7·x) Pa, right-side traction (2e7, 4e7 − 2e7·y) Pa, zero gap, \
Tresca bound 2e6 Pa; ε = 1e-4 relative to err⁰, r_tol = 0.1, c_fact = 0.9, λ⁰ = 0. \
iter and n_A count until err ≤ ε err⁰, the stopping test of the paper; in brackets they count until the \
optimality conditions, checked in f64 against K, are met to 10 ε as well, which is when signorini stops. \
Products for b are not counted, nor are those that ISSNM as printed spends on σ_max beforehand; on the surrogate there are \
none, σ_max is what products have shown so far.";

/// One cell of the table.
#[derive(Clone, Debug, Serialize)]
pub struct Cell {
    /// The refinement.
    pub k: usize,
    /// Number of free unknowns.
    pub n: usize,
    /// Number of contact nodes.
    pub contact_nodes: usize,
    /// β, of ρ = β/σ_max.
    pub beta: f64,
    /// As printed, or on a surrogate of A.
    pub method: Method,
    /// How the solve ended.
    pub status: Status,
    /// Until err ≤ ε err⁰.
    pub iter: usize,
    /// Products with A until then.
    #[serde(rename = "n_A")]
    pub n_a: usize,
    /// Until the final check passed.
    pub iter_checked: usize,
    /// Products with A until then.
    #[serde(rename = "n_A_checked")]
    pub n_a_checked: usize,
    /// (iter, n_A) of the paper, for the sizes and β that it has.
    pub paper: Option<(usize, usize)>,
    /// The error at the end over err⁰.
    pub err_relative: f64,
    /// The optimality conditions at the end, against K.
    pub kkt: crate::problem::Kkt,
    /// Seconds for b, σ_max, the outer steps and the check.
    pub seconds: f64,
}

/// The cells of one row by a method, with an operator of the problem of refinement k; `before_cell` may stop the row early.
///
/// # Errors
/// If a solve fails.
pub fn row(
    problem: &ContactProblem,
    dual: &mut impl DualOperator,
    k: usize,
    betas: &[f64],
    method: Method,
    mut before_cell: impl FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<Cell>, SolveError> {
    let mut cells = Vec::new();
    for &beta in betas {
        if before_cell(beta).is_break() {
            break;
        }
        let settings = NewtonSettings {
            tolerance: TOLERANCE,
            beta,
            method,
            ..Default::default()
        };
        let solution = ssnm::solve(problem, dual, &settings, |_| ControlFlow::Continue(()))?;
        let info = &solution.info;
        let (iter, n_a) = info.first_met.unwrap_or((info.iter, info.n_a));
        let row = SIZES.iter().position(|&size| size == k);
        let column = BETAS.iter().position(|&b| b == beta);
        cells.push(Cell {
            k,
            n: problem.n_free(),
            contact_nodes: problem.m(),
            beta,
            method,
            status: solution.status,
            iter,
            n_a,
            iter_checked: info.iter,
            n_a_checked: info.n_a,
            paper: row.zip(column).map(|(i, j)| PAPER[i][j]),
            err_relative: info.err_relative,
            kkt: info.kkt,
            seconds: info.setup_seconds + info.solve_seconds,
        });
    }
    Ok(cells)
}
