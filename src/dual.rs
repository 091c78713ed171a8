//! The dual operator A = B K⁻¹ Bᵀ and what belongs to it.

pub(crate) mod balance;
mod direct;
mod nested;

pub use direct::DirectDual;
pub(crate) use direct::plan;
pub use nested::NestedDual;

use crate::control::{Accuracy, Costs, Followed, Stop, Stopped};
use crate::sparse::{dot, norm};
use crate::stiffness::cholesky::FactorError;
use crate::stiffness::pcg::PcgError;

/// A relative residual that says that PCG did not get anywhere.
const HARDLY_MOVED: f64 = 0.1;

/// Why a product with A could not be made.
#[derive(Debug, thiserror::Error)]
pub enum DualError {
    /// Not an error of the problem: somebody asked to stop.
    #[error("{0}")]
    Stopped(Stopped),
    #[error(transparent)]
    Pcg(PcgError),
    #[error(transparent)]
    Factor(#[from] FactorError),
}

impl DualError {
    /// Whether K⁻¹ was applied, but not as accurately as asked. A residual that has hardly moved is no such case:
    /// K is singular then.
    pub fn is_stalled(&self) -> bool {
        matches!(self, Self::Pcg(PcgError::Stalled { reached, .. }) if *reached < HARDLY_MOVED)
    }
}

impl From<PcgError> for DualError {
    fn from(error: PcgError) -> Self {
        match error {
            PcgError::Stopped(stopped) => Self::Stopped(stopped),
            error => Self::Pcg(error),
        }
    }
}

/// What the semi-smooth Newton method needs of the linear algebra behind the contact problem.
///
/// Implemented by the Cholesky path, by the nested path on any backend, and by whatever else can apply
/// K⁻¹; the algorithms are written once over it. Where K⁻¹ is a matter of many iterations, they stop at the
/// accuracy asked for, and end with [`DualError::Stopped`] once `stop` says so.
pub trait DualOperator {
    /// Rows of K, and of B (2m), of the problem that it was made for.
    fn size(&self) -> (usize, usize);
    /// Goes on with the load f and the offsets c = (d, origin of slip), length 2m. A u that follows λ starts anew
    /// from zero, unless nothing has changed.
    fn set_data(&mut self, load: &[f64], offsets: &[f64]) -> Result<(), DualError>;
    /// y = A p; both have length 2m, normal part first. Where bodies can move as a whole, p has to leave them in
    /// balance (G p = 0), and y is known but for a motion Gᵀα.
    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError>;
    /// b = B K⁺ f − c.
    fn right_hand_side(
        &mut self,
        b: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError>;
    /// r = Aλ − b = c − B u with u = K⁺(f − Bᵀλ), where u is kept and its error is lowered from one time to
    /// the next. Where bodies can move as a whole, λ has to balance them.
    ///
    /// None, without a result, where products are exact and r can be carried along.
    fn gradient(
        &mut self,
        _lambda: &[f64],
        _r: &mut [f64],
        _accuracy: Accuracy,
        _stop: &Stop,
    ) -> Result<Option<Followed>, DualError> {
        Ok(None)
    }
    /// u = K⁺(f − Bᵀλ) with ‖f − Bᵀλ − Ku‖ ≤ `residual`, or as close as rounding allows; what is at hand where
    /// that is infinite.
    fn displacement(
        &mut self,
        lambda: &[f64],
        residual: f64,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError>;
    /// PCG iterations of one system K x = f to a relative residual of `tolerance`, not counted in the costs;
    /// None where K⁻¹ is not applied by iterations.
    fn linear_iterations(&mut self, _tolerance: f64) -> Result<Option<usize>, DualError> {
        Ok(None)
    }
    /// What it has cost so far, where K⁻¹ is applied by iterations.
    fn costs(&self) -> Option<Costs> {
        None
    }
}

/// An estimate of the largest eigenvalue of A, not below the true one beyond its margin, and the number
/// of products with A that it took.
///
/// Lanczos with full reorthogonalisation; the Ritz value is taken when it has settled to 0.1 %, and
/// raised by 2 % since it approaches σ_max from below. The products need no more accuracy than that.
///
/// Where bodies can move as a whole, A is meant on the directions that leave them in balance; `project` takes
/// a vector there.
pub(crate) fn sigma_max(
    dual: &mut impl DualOperator,
    len: usize,
    project: impl Fn(&mut [f64]),
    stop: &Stop,
) -> Result<(f64, usize), DualError> {
    const MAX_STEPS: usize = 30;
    const SETTLED: f64 = 1e-3;
    const MARGIN: f64 = 1.02;
    const ACCURACY: Accuracy = Accuracy::Energy {
        absolute: 0.0,
        relative: 0.05,
    };
    // A fixed pseudo-random start, so that results do not change from run to run.
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    let mut q: Vec<f64> = (0..len)
        .map(|_| {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        })
        .collect();
    project(&mut q);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let (mut alpha, mut beta) = (Vec::new(), Vec::new());
    let mut w = vec![0.0; len];
    let mut ritz = 0.0;
    for step in 1..=MAX_STEPS.min(len) {
        let length = norm(&q);
        if length == 0.0 {
            break;
        }
        q.iter_mut().for_each(|v| *v /= length);
        dual.apply(&q, &mut w, ACCURACY, stop)?;
        project(&mut w);
        alpha.push(dot(&q, &w));
        basis.push(std::mem::replace(&mut q, w.clone()));
        // Twice is enough.
        for _ in 0..2 {
            for p in &basis {
                let c = dot(p, &q);
                q.iter_mut().zip(p).for_each(|(q, p)| *q -= c * p);
            }
        }
        project(&mut q);
        let previous = ritz;
        ritz = largest_eigenvalue(&alpha, &beta);
        let next = norm(&q);
        if next <= 1e-12 * ritz || (step > 2 && ritz - previous <= SETTLED * ritz) {
            break;
        }
        beta.push(next);
    }
    Ok((MARGIN * ritz, basis.len()))
}

/// Largest eigenvalue of the symmetric tridiagonal matrix, by bisection on the signs of its pivots.
fn largest_eigenvalue(diagonal: &[f64], off: &[f64]) -> f64 {
    let radius = |i: usize| {
        let left = if i > 0 { off[i - 1] } else { 0.0 };
        left + off
            .get(i)
            .copied()
            .filter(|_| i + 1 < diagonal.len())
            .unwrap_or(0.0)
    };
    let mut high = (0..diagonal.len())
        .map(|i| diagonal[i] + radius(i))
        .fold(f64::MIN, f64::max);
    let mut low = diagonal.iter().copied().fold(f64::MIN, f64::max);
    for _ in 0..60 {
        let x = 0.5 * (low + high);
        let mut pivot = 1.0;
        let all_below = diagonal.iter().enumerate().all(|(i, d)| {
            let coupling = if i > 0 {
                off[i - 1] * off[i - 1] / pivot
            } else {
                0.0
            };
            pivot = d - x - coupling;
            pivot < 0.0
        });
        if all_below {
            high = x;
        } else {
            low = x;
        }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn largest_eigenvalue_of_the_second_difference() {
        let n = 7;
        let expected = 2.0 - 2.0 * (std::f64::consts::PI * n as f64 / (n + 1) as f64).cos();
        let found = largest_eigenvalue(&vec![2.0; n], &vec![1.0; n - 1]);
        approx::assert_relative_eq!(found, expected, max_relative = 1e-12);
    }
}
