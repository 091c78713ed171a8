//! The nested path: A p = B K⁻¹ Bᵀ p with K⁻¹ applied by preconditioned conjugate gradients.

use super::{
    Change, Correction, Costs, DualError, DualOperator, Request, Stop, scatter, take_force,
};
use crate::backend::{Backend, Run};
use crate::control::{Accuracy, SolveCounts};
use crate::problem::{ContactProblem, Vertices};
use crate::ranks::Ranks;
use crate::rounding::ROUNDING;
use crate::sparse::stored::{SquareBlocks, power_of_two_below};
use crate::sparse::{BlockCsr, Csr, norm};
use crate::stiffness::amg::AmgError;
use crate::stiffness::pcg::{Gather, Pcg, PcgError, Preconditioner, Renewal, UNREACHABLE};
use std::borrow::Cow;
use std::sync::Arc;

/// The number of refinements of a displacement for the sake of its ties.
const MOST_PASSES: usize = 4;
/// Load and forces together differ at most by this factor from the unit of the computation. Without a load, or beside
/// forces that a step has made huge, small values are lost in f32.
const FAR: f64 = 1e12;

/// Whether Bᵀp is no more than the rounding of its terms, as it may be where rows depend on each other.
fn is_rounding(ranks: &Ranks, b: &Csr, p: &[f64]) -> bool {
    let (mut sums, mut terms) = (vec![0.0; b.n_cols()], vec![0.0; b.n_cols()]);
    for (i, j, v) in b.triplets() {
        sums[j] += v * p[i];
        terms[j] += (v * p[i]).abs();
    }
    ranks.norm(&sums) <= ROUNDING * ranks.norm(&terms)
}

/// B, Bᵀ and u on the backend.
struct OnBackend<B: Backend> {
    gather: B::Rows,
    scatter: B::Rows,
    p: B::Vector,
    y: B::Vector,
    /// From (λ, 1) to f − Bᵀλ, on the rows of Bᵀ that have entries.
    loads: B::Rows,
    lambda: B::Vector,
    f: B::Vector,
    u: B::Vector,
}

impl<B: Backend> OnBackend<B> {
    /// For loads in this unit; None where products with B are made on the host. u is zero.
    fn new(pcg: &mut Pcg<B>, b: &Csr, load: &[f64], unit: f64) -> Result<Option<Self>, PcgError> {
        if !pcg.is_f64() {
            return Ok(None);
        }
        let backend = &mut pcg.backend;
        let (p, y) = (backend.vector(b.n_rows())?, backend.vector(b.n_rows())?);
        let lambda = backend.vector(b.n_rows() + 1)?;
        let mut f = backend.vector(b.n_cols())?;
        let scaled: Vec<f64> = load.iter().map(|f| f / unit).collect();
        backend.upload(&scaled, &mut f);
        let transposed = b.transposed();
        Ok(Some(Self {
            gather: backend.rows(b, &pcg.x, &y)?,
            scatter: backend.rows(&transposed, &p, &pcg.x)?,
            p,
            y,
            loads: backend.rows(&loads(&transposed, &scaled), &lambda, &pcg.x)?,
            lambda,
            f,
            u: backend.vector(b.n_cols())?,
        }))
    }
}

/// K with its ties to the ground where bodies can move as a whole, and the corners of its elements with the same ties.
struct Grounded<'a, const D: usize> {
    k: Arc<BlockCsr<D>>,
    ties: Vec<(u32, f64)>,
    vertices: Option<Cow<'a, Vertices<D>>>,
}

impl<'a, const D: usize> Grounded<'a, D> {
    fn of(problem: &'a ContactProblem<D>) -> Self {
        let touched = problem.touched();
        let (k, ties) = (problem.floating_bodies())
            .grounded(problem.stiffness(), |unknown| touched[unknown / D]);
        let vertices = problem.vertices().map(|vertices| vertices.grounded(&ties));
        Self { k, ties, vertices }
    }
}

/// The dual operator of a problem by PCG on a backend.
///
/// Where the backend computes in f64, a product moves 2m numbers to it and 2m numbers back, the latter together with
/// the progress of CG. All vectors of size n stay there. Where it computes in f32, the host makes the products with B
/// and Bᵀ in f64, as well as the residuals of the refinement.
///
/// On several ranks, B, u and f are those of the unknowns of this rank, and λ, p and y are on all of them.
pub struct NestedDual<B: Backend> {
    /// Those that have the other unknowns.
    ranks: Ranks,
    b: Arc<Csr>,
    /// Bᵀ without its empty rows.
    filled: Arc<Csr>,
    k: Arc<dyn SquareBlocks>,
    /// The f of the last load case.
    load: Arc<Vec<f64>>,
    pcg: Pcg<B>,
    /// Unknowns tied to the ground, where bodies can move as a whole, and how stiffly.
    ties: Vec<(u32, f64)>,
    /// A power of two near ‖f‖: the backend has f and u divided by it.
    unit: f64,
    /// u of the last gradient or displacement, the start for the next, where it is kept on the host.
    u: Vec<f64>,
    /// x = K⁻¹Bᵀp of the last product, if it is kept on the host, and its factor on the backend.
    x: Vec<f64>,
    unit_of_x: f64,
    on_backend: Option<OnBackend<B>>,
}

impl<B: Backend> NestedDual<B> {
    /// Whether conjugate gradients meet no direction without stiffness while they solve for a load at random.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn is_definite(&mut self) -> Result<bool, PcgError> {
        let load = scatter(self.b.n_cols());
        // A soft direction has a part of 1/√n in the load: it counts up to 1e12 unknowns.
        match (self.pcg).solve(&load, &mut vec![0.0; load.len()], 1e-6, &Stop::default()) {
            Err(error) if error.is_indefinite() => Ok(false),
            outcome => outcome.map(|()| true),
        }
    }

    /// Moves the problem to the backend.
    pub fn new<const D: usize>(
        problem: &ContactProblem<D>,
        backend: B,
        preconditioner: Preconditioner,
    ) -> Result<Self, PcgError> {
        let Grounded { k, ties, vertices } = Grounded::of(problem);
        let pcg = Pcg::of_second_order(
            backend,
            &k,
            problem.coordinates(),
            vertices.as_deref(),
            preconditioner,
        )?;
        let k = Arc::clone(problem.stiffness()) as _;
        Self::on(pcg, problem, k, ties)
    }

    /// On conjugate gradients for K with these ties; `k` has none.
    pub(crate) fn on<const D: usize, K>(
        mut pcg: Pcg<B>,
        problem: &ContactProblem<D, K>,
        k: Arc<dyn SquareBlocks>,
        ties: Vec<(u32, f64)>,
    ) -> Result<Self, PcgError> {
        let (b, load) = (problem.contact_matrix(), problem.load_case().force());
        let unit = power_of_two_below(problem.ranks().norm(load));
        Ok(Self {
            ranks: problem.ranks().clone(),
            b: Arc::clone(b),
            filled: Arc::clone(problem.filled_columns()),
            k,
            load: Arc::clone(load),
            on_backend: OnBackend::new(&mut pcg, b, load, unit)?,
            u: if pcg.is_f64() {
                Vec::new()
            } else {
                vec![0.0; b.n_cols()]
            },
            pcg,
            ties,
            unit,
            x: Vec::new(),
            unit_of_x: 1.0,
        })
    }

    /// Switches to another problem. Returns whether the preconditioner has new values; None if its structure does not fit. After
    /// None and after an error the operator is unusable.
    pub(crate) fn update<const D: usize>(
        &mut self,
        problem: &ContactProblem<D>,
        change: Change,
    ) -> Result<Option<bool>, PcgError> {
        if [problem.n_rows(), D] != [self.k.n_rows(), self.k.block()] {
            return Ok(None);
        }
        let mut renewed = false;
        // Which unknowns are tied depends on the rows of B.
        if change != Change::Same || !self.ties.is_empty() {
            let Grounded { k, ties, vertices } = Grounded::of(problem);
            if change != Change::Same || ties != self.ties {
                let before = self.pcg.counts.set_ups;
                let updated = match change {
                    Change::Near => self.pcg.follow(&k, problem.coordinates(), renewal(problem)),
                    _ => (self.pcg).update(&k, problem.coordinates(), vertices.as_deref()),
                };
                renewed = self.pcg.counts.set_ups > before;
                match updated {
                    Err(PcgError::Hierarchy(
                        AmgError::OtherPattern { .. } | AmgError::OtherCorners,
                    )) => return Ok(None),
                    updated => updated?,
                }
            }
            (self.k, self.ties) = (Arc::clone(problem.stiffness()) as _, ties);
        }
        self.b = Arc::clone(problem.contact_matrix());
        self.filled = Arc::clone(problem.filled_columns());
        self.load = Arc::clone(problem.load_case().force());
        self.unit = power_of_two_below(norm(&self.load));
        self.u.fill(0.0);
        // B there goes before another one comes.
        self.on_backend = None;
        self.on_backend = OnBackend::new(&mut self.pcg, &self.b, &self.load, self.unit)?;
        Ok(Some(renewed))
    }

    /// The backend.
    pub fn backend(&self) -> &B {
        &self.pcg.backend
    }

    /// The levels of multigrid, for a log, and why multigrid is missing although requested.
    pub fn levels(&self) -> [Option<&str>; 2] {
        [self.pcg.hierarchy.as_deref(), self.pcg.fallback.as_deref()]
    }

    /// Takes another f: all ranks get one at the same time, even if their own part has not changed.
    fn take(&mut self, force: &Arc<Vec<f64>>) -> Result<(), PcgError> {
        if Arc::ptr_eq(&self.load, force) {
            return Ok(());
        }
        let is_other = take_force(force, &mut self.load);
        if !self.ranks.any(is_other) {
            return Ok(());
        }
        self.u.fill(0.0);
        self.scale_to(power_of_two_below(self.ranks.norm(force)))
    }

    /// Passes the load to the backend in another unit; the u there starts from zero.
    fn scale_to(&mut self, unit: f64) -> Result<(), PcgError> {
        self.unit = unit;
        if let Some(there) = &mut self.on_backend {
            let backend = &mut self.pcg.backend;
            let scaled: Vec<f64> = self.load.iter().map(|f| f / unit).collect();
            backend.upload(&scaled, &mut there.f);
            backend.clear(&mut there.u);
            let loads = loads(&self.b.transposed(), &scaled);
            there.loads = backend.rows(&loads, &there.lambda, &self.pcg.x)?;
        }
        Ok(())
    }
}

/// Makes the preconditioner of a problem when it is needed.
fn renewal<const D: usize, B: Backend>(problem: &ContactProblem<D>) -> Renewal<B> {
    let problem = problem.clone();
    Box::new(move |backend, preconditioner| {
        let Grounded { k, vertices, .. } = Grounded::of(&problem);
        preconditioner.rebuild::<D, _>(backend, &k, problem.coordinates(), vertices.as_deref())
    })
}

/// The rows of Bᵀ that have entries, as (−Bᵀ, f).
fn loads(transposed: &Csr, f: &[f64]) -> Csr {
    let columns = transposed.n_cols();
    let triplets = transposed.filled_rows().into_iter().flat_map(|i| {
        let i = i as usize;
        let (cols, values) = transposed.row(i);
        cols.iter()
            .zip(values)
            .map(move |(&j, v)| (i, j as usize, -v[0][0]))
            .chain([(i, columns, f[i])])
    });
    Csr::from_triplets(transposed.n_rows(), columns + 1, triplets)
}

impl<B: Backend> DualOperator for NestedDual<B> {
    fn size(&self) -> (usize, usize) {
        (self.load.len(), self.b.n_rows())
    }

    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        let Some(there) = &mut self.on_backend else {
            let mut load = vec![0.0; self.b.n_cols()];
            self.b.mul_transpose_add(1.0, p, &mut load);
            self.x.fill(0.0);
            self.x.resize(load.len(), 0.0);
            let length = self.ranks.norm(&load);
            (self.pcg).refine(&load, length, &mut self.x, accuracy, stop)?;
            self.restrict(&self.x, y);
            return Ok(());
        };
        let unit = power_of_two_below(norm(p));
        let scaled: Vec<f64> = p.iter().map(|v| v / unit).collect();
        let run = self.pcg.run_to(accuracy, unit);
        let backend = &mut self.pcg.backend;
        backend.upload(&scaled, &mut there.p);
        backend.clear(&mut self.pcg.r);
        backend.multiply_rows(&there.scatter, &there.p, &mut self.pcg.r);
        let gather = Gather {
            rows: &there.gather,
            y: &mut there.y,
            out: y,
        };
        self.pcg.counts.solves += 1;
        match self.pcg.run(run, stop, Some(gather)) {
            // Rounding may push a body along a motion that nothing resists.
            Err(PcgError::NotPositiveDefinite) if is_rounding(&self.ranks, &self.b, p) => {
                y.fill(0.0);
                return Ok(());
            }
            made => made?,
        };
        let scale = unit * self.pcg.scale;
        self.unit_of_x = scale;
        y.iter_mut().for_each(|v| *v *= scale);
        self.ranks.sum(y);
        Ok(())
    }

    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.b.mul(u, y);
        self.ranks.sum(y);
    }

    fn at_contact(&mut self, request: &Request, y: &mut [f64]) -> Result<Correction, DualError> {
        self.take(request.force)?;
        let (along, stop) = (request.along, request.stop);
        let contact = self.filled.product(request.lambda);
        let terms = (self.ranks.norm(&self.load)).max(self.ranks.norm(&contact));
        if terms == 0.0 {
            // The error that PCG leaves in a vanishing u would have to shrink for ever.
            self.u.fill(0.0);
            if let Some(there) = &mut self.on_backend {
                self.pcg.backend.clear(&mut there.u);
            }
            y.fill(0.0);
            return Ok(Correction::default());
        }
        let unit = power_of_two_below(terms);
        if !(1.0 / FAR..FAR).contains(&(unit / self.unit)) {
            self.scale_to(unit)?;
        }
        let Some(there) = &mut self.on_backend else {
            for (u, x) in self.u.iter_mut().zip(&self.x) {
                *u -= along * x;
            }
            let accuracy = match request.accuracy {
                Accuracy::Residual(residual) => Accuracy::Residual(residual / terms),
                accuracy => accuracy,
            };
            let forces = request.forces(&self.b);
            let followed = (self.pcg).refine(&forces, terms, &mut self.u, accuracy, stop)?;
            self.restrict(&self.u, y);
            return Ok(followed);
        };
        let unit = self.unit;
        if along != 0.0 {
            let a = -along * self.unit_of_x / unit;
            self.pcg.backend.add(a, &self.pcg.x, &mut there.u);
        }
        let mut scaled: Vec<f64> = request.lambda.iter().map(|l| l / unit).collect();
        scaled.push(1.0);
        let run = match request.accuracy {
            Accuracy::Residual(residual) => Run {
                residual: residual / unit,
                ..Run::default()
            },
            accuracy => Run {
                // Forces that cancel leave rounding: without a floor the residual of a u that follows λ would have to
                // shrink from step to step.
                residual: UNREACHABLE * terms / unit,
                ..self.pcg.run_to(accuracy, unit)
            },
        };
        let run = Run {
            continues: true,
            ..run
        };
        let pcg = &mut self.pcg;
        pcg.backend.upload(&scaled, &mut there.lambda);
        pcg.backend.copy(&there.f, &mut pcg.r);
        pcg.backend
            .multiply_rows(&there.loads, &there.lambda, &mut pcg.r);
        pcg.subtract_product(&there.u);
        let gather = Gather {
            rows: &there.gather,
            y: &mut there.y,
            out: y,
        };
        pcg.counts.solves += 1;
        std::mem::swap(&mut pcg.x, &mut there.u);
        let outcome = pcg.run(run, stop, Some(gather));
        std::mem::swap(&mut pcg.x, &mut there.u);
        let followed = pcg.followed(&outcome?, unit);
        y.iter_mut().for_each(|v| *v *= unit);
        self.ranks.sum(y);
        Ok(followed)
    }

    fn is_exact(&self) -> bool {
        false
    }

    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        let mut y = vec![0.0; self.b.n_rows()];
        let mut u = vec![0.0; self.b.n_cols()];
        let residual = request.residual();
        let mut asked = residual;
        for _ in 0..MOST_PASSES {
            let pass = Request {
                along: 0.0,
                accuracy: Accuracy::Residual(asked),
                ..*request
            };
            self.at_contact(&pass, &mut y)?;
            match &self.on_backend {
                None => u.copy_from_slice(&self.u),
                Some(there) => {
                    (self.pcg.backend)
                        .download(&there.u, &mut u)
                        .map_err(PcgError::from)?;
                    u.iter_mut().for_each(|u| *u *= self.unit);
                }
            }
            // An imbalance that CG leaves all over a body is held by its ties in a few places.
            let held = (self.ties.iter()).map(|&(i, tie)| (tie * u[i as usize]).powi(2));
            let mut held = [held.sum::<f64>()];
            self.ranks.sum(&mut held);
            if held[0].sqrt() <= residual {
                break;
            }
            asked *= 0.1;
        }
        Ok(u)
    }

    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        Ok(self.k.multiply_with_sizes(u, s))
    }

    fn linear_iterations(&mut self, tolerance: f64) -> Result<Option<usize>, DualError> {
        let before = self.pcg.counts;
        let mut x = vec![0.0; self.b.n_cols()];
        self.pcg
            .solve(&self.load, &mut x, tolerance, &Stop::default())?;
        let iterations = self.pcg.counts.iterations - before.iterations;
        self.pcg.counts = SolveCounts {
            set_ups: self.pcg.counts.set_ups,
            ..before
        };
        Ok(Some(iterations))
    }

    fn costs(&self) -> Option<Costs> {
        Some(self.pcg.costs())
    }
}
