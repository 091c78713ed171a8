//! The dual operator A = B K⁻¹ Bᵀ and its parts.

pub(crate) mod balance;
mod delassus;
mod direct;
mod nested;

pub use delassus::DelassusDual;
pub use direct::DirectDual;
pub(crate) use direct::LARGEST_MATRIX;
pub(crate) use direct::plan;
pub use nested::NestedDual;

use crate::control::{Accuracy, Correction, Costs, Stop, Stopped};
use crate::dense::{symmetric_eigen, tridiagonal_largest};
use crate::problem::{ContactProblem, Kkt};
use crate::sparse::{Csr, dot, norm};
use crate::stiffness::cholesky::FactorError;
use crate::stiffness::pcg::PcgError;
use faer::Mat;
use std::sync::Arc;

/// The K of another problem beside the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Change {
    Same,
    /// So near that the same preconditioner may do.
    Near,
    Other,
}

/// From this relative residual on, PCG has made no progress.
const HARDLY_MOVED: f64 = 0.1;

/// The reason why a product with A could not be made.
#[derive(Debug, thiserror::Error)]
pub enum DualError {
    /// Not an error of the problem: somebody asked to stop.
    #[error("{0}")]
    Stopped(Stopped),
    /// PCG has failed.
    #[error(transparent)]
    Pcg(PcgError),
    /// The factor has failed.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// Another operator that applies K⁻¹ has failed.
    #[error(transparent)]
    Other(Box<dyn std::error::Error + Send + Sync>),
}

impl DualError {
    /// Whether K⁻¹ was applied less accurately than requested. A residual that hardly moved does not count: K is
    /// singular then.
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

/// A request for u = K⁺(f − Bᵀλ), or for B u. Where bodies can move as a whole, λ has to balance them.
#[derive(Clone, Copy, Debug)]
pub struct Request<'a> {
    /// f, with an entry per row of K. Requests for the same f share it.
    pub force: &'a Arc<Vec<f64>>,
    /// λ, with an entry per row of B.
    pub lambda: &'a [f64],
    /// If this is not 0, λ has changed since the last request by exactly this times the p of the last product, and a u
    /// that is kept makes use of that product.
    pub along: f64,
    /// A residual is absolute here: ‖f − Bᵀλ − Ku‖.
    pub accuracy: Accuracy,
    /// When to stop.
    pub stop: &'a Stop<'a>,
}

impl<'a> Request<'a> {
    /// A request that knows nothing about the last λ.
    pub fn new(
        force: &'a Arc<Vec<f64>>,
        lambda: &'a [f64],
        accuracy: Accuracy,
        stop: &'a Stop<'a>,
    ) -> Self {
        Self {
            force,
            lambda,
            along: 0.0,
            accuracy,
            stop,
        }
    }

    /// f − Bᵀλ.
    pub fn forces(&self, b: &Csr) -> Vec<f64> {
        let mut forces = self.force.to_vec();
        b.mul_transpose_add(-1.0, self.lambda, &mut forces);
        forces
    }

    /// The residual that u may have; 0 where only the energy of its error is limited.
    pub(crate) fn residual(&self) -> f64 {
        match self.accuracy {
            Accuracy::Residual(residual) => residual,
            Accuracy::Energy { .. } => 0.0,
        }
    }
}

/// Replaces the last f; returns whether it has changed.
pub(crate) fn take_force(force: &Arc<Vec<f64>>, last: &mut Arc<Vec<f64>>) -> bool {
    if Arc::ptr_eq(last, force) {
        return false;
    }
    let before = std::mem::replace(last, Arc::clone(force));
    before != *force
}

/// The linear algebra that the semi-smooth Newton method needs.
///
/// The Cholesky path and the nested path on any backend implement it, as can any other way to apply K⁻¹; the algorithms are
/// written once over it. Iterations for K⁻¹ stop at the requested accuracy, and end with [`DualError::Stopped`] once `stop`
/// says so. Whoever asks adds the offsets c and the compliance of contact.
///
/// # Example
/// A K whose inverse is only a closure: a chain of springs between two walls with a known inverse. Its third and sixth
/// links may move by 0.1 until they touch. The problem itself has only the diagonal of K.
///
/// ```
/// use signorini::control::{Accuracy, Stop};
/// use signorini::dual::{DualError, DualOperator, Request};
/// use signorini::problem::{ContactData, ContactProblem};
/// use signorini::sparse::{BlockCsr, Csr};
/// use signorini::ssnm::{self, NewtonSettings, Status};
/// use std::ops::ControlFlow;
///
/// struct Chain<K> {
///     b: Csr,
///     inverse: K,
/// }
///
/// impl<K: Fn(&[f64]) -> Vec<f64>> DualOperator for Chain<K> {
///     fn size(&self) -> (usize, usize) {
///         (self.b.n_cols(), self.b.n_rows())
///     }
///     fn restrict(&self, u: &[f64], y: &mut [f64]) {
///         self.b.mul(u, y);
///     }
///     fn apply(&mut self, p: &[f64], y: &mut [f64], _: Accuracy, _: &Stop) -> Result<(), DualError> {
///         let mut f = vec![0.0; self.b.n_cols()];
///         self.b.mul_transpose_add(1.0, p, &mut f);
///         self.restrict(&(self.inverse)(&f), y);
///         Ok(())
///     }
///     fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
///         Ok((self.inverse)(&request.forces(&self.b)))
///     }
///     fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
///         let product = |x: &[f64], off: f64| {
///             let n = x.len() as isize;
///             let entry = |i: isize| if (0..n).contains(&i) { x[i as usize] } else { 0.0 };
///             (0..n).map(|i| 2.0 * entry(i) + off * (entry(i - 1) + entry(i + 1))).collect()
///         };
///         Ok([product(u, -1.0), product(s, 1.0)])
///     }
/// }
///
/// let n = 8;
/// // (K⁻¹)ᵢⱼ = min(i, j) (n + 1 − max(i, j)) / (n + 1), counted from 1.
/// let inverse = |f: &[f64]| -> Vec<f64> {
///     let entry = |i: usize, j: usize| (i.min(j) * (n + 1 - i.max(j))) as f64 / (n + 1) as f64;
///     (1..=n).map(|i| (1..=n).map(|j| entry(i, j) * f[j - 1]).sum()).collect()
/// };
/// let problem = ContactProblem::<2>::new(ContactData {
///     stiffness: BlockCsr::from_triplets(n, n, (0..n).map(|i| (i, i, 2.0))),
///     load: vec![0.1; n],
///     normal: Csr::from_triplets(2, n, [(0, 2, 1.0), (1, 5, 1.0)]),
///     tangential: Csr::from_triplets(2, n, []),
///     gap: vec![0.1; 2],
///     slip_bound: vec![0.0; 2],
///     coordinates: None,
/// })?
/// .elsewhere();
/// let mut chain = Chain { b: problem.contact_matrix().as_ref().clone(), inverse };
/// let solution = ssnm::solve(&problem, &mut chain, &NewtonSettings::default(), |_| ControlFlow::Continue(()))?;
/// assert_eq!(solution.status, Status::Converged);
/// assert!((solution.u[2] - 0.1).abs() < 1e-9 && (solution.u[5] - 0.1).abs() < 1e-9);
/// // By symmetry.
/// assert!(solution.lambda[0] > 0.2 && (solution.lambda[0] - solution.lambda[1]).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait DualOperator {
    /// Rows of K, and of B (D m, 2m in the plane), of the problem that it was made for.
    fn size(&self) -> (usize, usize);
    /// y = A p; both are as long as B has rows, normal part first. Where bodies can move as a whole, p must leave them in
    /// balance (G p = 0), and y is determined only up to a motion Gᵀα.
    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError>;
    /// y = B u for any u.
    fn restrict(&self, u: &[f64], y: &mut [f64]);
    /// u = K⁺(f − Bᵀλ) as accurate as requested, or as close as rounding allows; if the residual may be infinite, the
    /// present u.
    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError>;
    /// y = B u with u = K⁺(f − Bᵀλ): r = Aλ − b is c − y. Iterations keep u, and lower its error from call to call.
    fn at_contact(&mut self, request: &Request, y: &mut [f64]) -> Result<Correction, DualError> {
        let u = self.displacement(request)?;
        self.restrict(&u, y);
        Ok(Correction::default())
    }
    /// Whether products are exact, so that r can be updated with them. Otherwise it is made from [`Self::at_contact`] after
    /// each step.
    fn is_exact(&self) -> bool {
        true
    }
    /// K u, and |K| s with the absolute values of the entries of K: the rounding scale of K u where u is known to s. The
    /// final check measures forces by it.
    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError>;
    /// PCG iterations of one system K x = f, f the last one, to a relative residual of `tolerance`. They are not
    /// counted in the costs. None where K⁻¹ is not applied by iterations.
    fn linear_iterations(&mut self, _tolerance: f64) -> Result<Option<usize>, DualError> {
        Ok(None)
    }
    /// A itself, where it is available as a matrix: the method then uses it for everything else, and makes no more products than
    /// steps.
    fn matrix(&self) -> Option<Csr> {
        None
    }
    /// Refines u from here on to the accuracy that f64 allows, so that r is made from it, if K is badly conditioned and u
    /// is not refined yet. False if there is nothing to gain.
    fn refine(&mut self) -> bool {
        false
    }
    /// The costs so far, where K⁻¹ is applied by iterations.
    fn costs(&self) -> Option<Costs> {
        None
    }
}

/// The optimality conditions (1)–(3) of a problem at (u, λ) against the K of its operator.
pub(crate) fn conditions<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    dual: &mut dyn DualOperator,
    u: &[f64],
    lambda: &[f64],
) -> Result<Kkt, DualError> {
    let [x, s] = problem.deformed(u);
    let product = dual.stiffness_times(&x, &s)?;
    Ok(problem.conditions(u, lambda, &product))
}

/// Estimates of the largest eigenvalue of A, not below the true one beyond its margin, and of the mean of its diagonal.
///
/// Lanczos with full reorthogonalisation; the Ritz value is accepted when it has settled to 0.1 %, and raised by 2 %
/// because it approaches σ_max from below. The products need no higher accuracy.
///
/// Where bodies can move as a whole, the estimates are those of A on the directions that leave them in balance;
/// `project` takes a vector there.
pub(crate) fn spectrum(
    mut apply: impl FnMut(&[f64], Accuracy) -> Result<Vec<f64>, DualError>,
    len: usize,
    project: impl Fn(&mut [f64]),
) -> Result<Spectrum, DualError> {
    const MAX_STEPS: usize = 30;
    const SETTLED: f64 = 1e-3;
    const MARGIN: f64 = 1.02;
    const ACCURACY: Accuracy = Accuracy::Energy {
        absolute: 0.0,
        relative: 0.05,
    };
    let mut q = scatter(len);
    project(&mut q);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let (mut alpha, mut beta) = (Vec::new(), Vec::new());
    let mut ritz = 0.0;
    for step in 1..=MAX_STEPS.min(len) {
        let length = norm(&q);
        if length == 0.0 {
            break;
        }
        q.iter_mut().for_each(|v| *v /= length);
        let mut w = apply(&q, ACCURACY)?;
        project(&mut w);
        alpha.push(dot(&q, &w));
        basis.push(std::mem::replace(&mut q, w));
        // Twice is enough.
        for _ in 0..2 {
            for p in &basis {
                let c = dot(p, &q);
                q.iter_mut().zip(p).for_each(|(q, p)| *q -= c * p);
            }
        }
        project(&mut q);
        let previous = ritz;
        ritz = tridiagonal_largest(&alpha, &beta);
        let next = norm(&q);
        if next <= 1e-12 * ritz || (step > 2 && ritz - previous <= SETTLED * ritz) {
            break;
        }
        beta.push(next);
    }
    Ok(Spectrum {
        largest: MARGIN * ritz,
        mean: mean_of_diagonal(&alpha, &beta, len),
        products: basis.len(),
    })
}

/// The mean of the diagonal of a matrix with `len` rows, from Lanczos started at a vector without any pattern.
///
/// Such a vector has about the same share of every eigenvector, so its Rayleigh quotient is the mean up to chance. A few
/// eigenvalues that dwarf all others make up most of the sum, and their shares vary by chance. Where Lanczos has found
/// them, they count exactly, and the vector represents the rest.
fn mean_of_diagonal(alpha: &[f64], beta: &[f64], len: usize) -> f64 {
    const LARGE: f64 = 0.1;
    let k = alpha.len();
    let lanczos = Mat::from_fn(k, k, |i, j| match i.abs_diff(j) {
        0 => alpha[i],
        1 => beta[i.min(j)],
        _ => 0.0,
    });
    let first = alpha.first().copied().unwrap_or(0.0);
    let Some((values, vectors)) = symmetric_eigen(&lanczos) else {
        return first;
    };
    let largest = values.last().copied().unwrap_or(0.0);
    let (mut large, mut count) = (0.0, 0);
    let (mut rest, mut share) = (0.0, 0.0);
    for (i, &value) in values.iter().enumerate() {
        if value > LARGE * largest {
            (large, count) = (large + value, count + 1);
        } else {
            let part = vectors[(0, i)].powi(2);
            (rest, share) = (rest + part * value, share + part);
        }
    }
    if !(share > 0.0) {
        return first;
    }
    (large + (len - count) as f64 * rest / share) / len as f64
}

/// Known data on the eigenvalues of A.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spectrum {
    /// σ_max, or a little more.
    pub largest: f64,
    /// The mean of diag(A), about.
    pub mean: f64,
    /// The products that it took.
    pub products: usize,
}

/// Numbers without any pattern between −½ and ½, always the same ones, so that results do not change from run to run.
pub(crate) fn scatter(len: usize) -> Vec<f64> {
    let mut seed = 0x9e37_79b9_7f4a_7c15_u64;
    (0..len)
        .map(|_| {
            seed = seed
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (seed >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backend::cpu::Cpu;
    use crate::engine::{Device, Engine, EngineOptions, Stiffness};
    use crate::lattice::lattice;
    use crate::problem::{ContactData, ContactProblem};

    /// A lattice whose base (z = 0) meets a plane below, away from its supports.
    fn in_space() -> ContactProblem<3> {
        let (stiffness, points) = lattice([9, 8, 7]);
        let base: Vec<usize> = (0..points.len())
            .filter(|&i| points[i][2] == 0.0 && points[i][0] > 0.0)
            .collect();
        let (m, n) = (base.len(), stiffness.n_rows());
        let rows = base.iter().enumerate();
        let tangents = rows
            .clone()
            .flat_map(|(i, node)| [(2 * i, 3 * node, 1.0), (2 * i + 1, 3 * node + 1, 1.0)]);
        ContactProblem::new(ContactData {
            load: (0..n).map(|i| ((i * 37) % 11) as f64 - 5.0).collect(),
            normal: Csr::from_triplets(m, n, rows.map(|(i, node)| (i, 3 * node + 2, -1.0))),
            tangential: Csr::from_triplets(2 * m, n, tangents),
            gap: vec![0.1; m],
            slip_bound: vec![1.0; m],
            coordinates: Some(points),
            stiffness,
        })
        .unwrap_or_else(|error| panic!("{error}"))
    }

    /// The factor and PCG make the same products in space, both alone and in an engine that knows no dimension.
    #[test]
    fn products_in_space() {
        let problem = in_space();
        let len = 3 * problem.m();
        let p: Vec<f64> = (0..len).map(|i| ((i * 7) % 5) as f64 - 2.0).collect();
        let accuracy = Accuracy::Residual(1e-12);
        let made = |dual: &mut dyn DualOperator| -> [Vec<f64>; 3] {
            let (mut y, mut b) = (vec![0.0; len], vec![0.0; len]);
            let (force, none) = (problem.load_case().force(), vec![0.0; len]);
            let stop = Stop::default();
            assert_eq!(dual.size(), (problem.load().len(), len));
            dual.apply(&p, &mut y, accuracy, &stop)
                .and_then(|()| {
                    let accuracy = Accuracy::Residual(1e-10);
                    dual.at_contact(&Request::new(force, &none, accuracy, &stop), &mut b)
                })
                .and_then(|_| {
                    let accuracy = Accuracy::Residual(1e-9);
                    dual.displacement(&Request::new(force, &p, accuracy, &stop))
                })
                .map(|u| [y, b, u])
                .unwrap_or_else(|error| panic!("{error}"))
        };
        let mut direct = DirectDual::new(&problem).unwrap_or_else(|error| panic!("{error}"));
        let expected = made(&mut direct);
        // u by K itself.
        let mut forces = vec![0.0; problem.load().len()];
        problem.stiffness().mul(&expected[2], &mut forces);
        problem
            .contact_matrix()
            .mul_transpose_add(1.0, &p, &mut forces);
        for (f, load) in forces.iter().zip(problem.load()) {
            assert!((f - load).abs() < 1e-9, "{f} {load}");
        }
        let close = |found: [Vec<f64>; 3]| {
            for (found, expected) in found.iter().zip(&expected) {
                let off: Vec<f64> = found.iter().zip(expected).map(|(f, e)| f - e).collect();
                assert!(norm(&off) < 1e-7 * norm(expected), "{:e}", norm(&off));
            }
        };
        let cpu = Cpu::<f32>::default();
        let mut nested = NestedDual::new(&problem, cpu, Default::default())
            .unwrap_or_else(|error| panic!("{error}"));
        close(made(&mut nested));
        for stiffness in [Stiffness::Auto, Stiffness::Pcg] {
            let options = EngineOptions {
                place: Device::Cpu,
                stiffness,
                ..Default::default()
            };
            let mut engine =
                Engine::new(&problem, options, |_| {}).unwrap_or_else(|error| panic!("{error}"));
            close(made(&mut engine));
        }
    }
}
