//! A = B K⁻¹ Bᵀ with K on several ranks: conjugate gradients around our own levels of multigrid, over those of PETSc.
//!
//! λ is on all ranks, K, u, f and the columns of B are where their unknowns are. A product needs no message for Bᵀλ, those of
//! the halo and of PETSc for K⁻¹, and one sum for B u.

use super::petsc::{self, PetscError};
use super::share::MpiError;
use crate::backend::cpu::Cpu;
#[cfg(feature = "gpu")]
use crate::backend::gpu::{Context, Gpu};
use crate::backend::{Backend, Precision, Run};
use crate::control::{Accuracy, Correction, Costs, SolveCounts, Stop};
use crate::dual::{DualError, DualOperator, followed_right_hand_side};
use crate::engine::{Device, EngineError, EngineOptions, Stiffness};
use crate::problem::{ContactProblem, Elsewhere, LoadCase, Vertices};
use crate::ranks::{Group, Halo, Ranks};
use crate::sparse::stored::SquareBlocks;
use crate::sparse::{BlockCsr, Csr, add_times, difference};
use crate::stiffness::amg::{AmgError, AmgSettings, Hierarchy, OnRanks, RowsBelow, SolverBelow};
use crate::stiffness::pcg::{Pcg, PcgError, Preconditioner, UNREACHABLE};
use std::cell::RefCell;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// The number of refinements of a displacement for the sake of its ties, as on one machine.
const MOST_PASSES: usize = 4;

/// The prefix of the options.
const PREFIX: &str = "signorini_";

/// All options of GAMG, which works on the level below our own; its own defaults change from version to version. An
/// aggregation without threshold, each smoothed once. V-cycles have two Chebyshev steps around the diagonal, whose
/// range PETSc estimates by ten steps of CG. The coarsest level, of at most 1000 unknowns, is on one rank by a factor.
/// Jacobi is the only smoother that neither fails on coarse levels nor depends on the number of ranks.
const OPTIONS: [(&str, &str); 23] = [
    ("-signorini_pc_type", "gamg"),
    ("-signorini_pc_gamg_type", "agg"),
    ("-signorini_pc_gamg_agg_nsmooths", "1"),
    ("-signorini_pc_gamg_threshold", "0.0"),
    // The same by its names before and after 3.18. The level has few unknowns: iterations count more than its memory.
    ("-signorini_pc_gamg_square_graph", "0"),
    ("-signorini_pc_gamg_aggressive_coarsening", "0"),
    ("-signorini_pc_gamg_coarse_eq_limit", "1000"),
    ("-signorini_pc_gamg_process_eq_limit", "50"),
    ("-signorini_pc_gamg_repartition", "false"),
    ("-signorini_pc_gamg_reuse_interpolation", "true"),
    ("-signorini_pc_gamg_use_sa_esteig", "true"),
    ("-signorini_pc_mg_type", "multiplicative"),
    ("-signorini_pc_mg_cycle_type", "v"),
    ("-signorini_mg_levels_ksp_type", "chebyshev"),
    ("-signorini_mg_levels_ksp_max_it", "2"),
    ("-signorini_mg_levels_ksp_norm_type", "none"),
    ("-signorini_mg_levels_ksp_chebyshev_esteig", "0,0.1,0,1.1"),
    ("-signorini_mg_levels_esteig_ksp_type", "cg"),
    ("-signorini_mg_levels_esteig_ksp_max_it", "10"),
    ("-signorini_mg_levels_pc_type", "jacobi"),
    ("-signorini_mg_coarse_ksp_type", "preonly"),
    ("-signorini_mg_coarse_pc_type", "bjacobi"),
    ("-signorini_mg_coarse_sub_pc_type", "lu"),
];

/// How several ranks make PᵀAP, which one rank by itself does not know. Other ways add up contributions of other ranks
/// as they arrive. On four ranks coarse matrices, and with them the answer, then differ in the last bits from run to
/// run.
const OF_SEVERAL: [(&str, &str); 1] = [("-matptap_via", "allatonce_merged")];

/// The rows of K that belong to the unknowns of a rank.
pub(super) struct OwnRows<const D: usize> {
    /// Its block rows; block columns are its own blocks, then those of others (`ghosts`). Where bodies can move as a whole, with
    /// their ties.
    pub rows: BlockCsr<D>,
    /// That of its blocks.
    pub halo: Halo,
    /// Own unknowns tied to the ground, and how stiffly.
    pub ties: Vec<(u32, f64)>,
    /// The corners of elements of second order, and their halo.
    pub vertices: Option<(Vertices<D>, Halo)>,
}

/// When all ranks are to stop.
#[derive(Clone, Debug, Default)]
pub(super) struct Limits {
    /// By rank 0's clock.
    pub deadline: Option<Instant>,
    /// On any rank.
    pub interrupt: Option<Arc<AtomicBool>>,
}

/// The device of a rank, and the preconditioner of all.
pub(super) struct Means {
    preconditioner: Preconditioner,
    #[cfg(feature = "gpu")]
    context: Option<Arc<Context>>,
}

impl Means {
    /// Opens a device for each rank if GPUs are asked for: ranks of one machine take turns with its adapters.
    pub fn new(_group: &Group, options: &EngineOptions) -> Result<Self, MpiError> {
        if options.stiffness == Stiffness::Cholesky {
            return Err(MpiError::NoFactor);
        }
        #[cfg(not(feature = "gpu"))]
        if options.place == Device::Gpu {
            return Err(EngineError::NoGpuSupport.into());
        }
        Ok(Self {
            preconditioner: options.preconditioner,
            #[cfg(feature = "gpu")]
            context: match options.place {
                Device::Gpu => {
                    let gpu = crate::backend::GpuOptions {
                        turn: _group.turn(),
                        ..options.gpu.clone()
                    };
                    Some(Context::new(&gpu).map_err(EngineError::from)?)
                }
                Device::Auto | Device::Cpu => None,
            },
        })
    }
}

/// Conjugate gradients on the device of this rank.
enum Cg {
    Cpu(Box<Pcg<Cpu>>),
    #[cfg(feature = "gpu")]
    Gpu(Box<Pcg<Gpu>>),
}

impl Cg {
    fn new(
        _means: &Means,
        ranks: &Ranks,
        k: &Arc<dyn SquareBlocks>,
        hierarchy: Hierarchy<f32>,
    ) -> Result<Self, PcgError> {
        #[cfg(feature = "gpu")]
        if let Some(context) = &_means.context {
            let backend = Gpu::on(context, ranks)?;
            let pcg = Pcg::with_hierarchy(backend, Arc::clone(k), hierarchy)?;
            return Ok(Self::Gpu(Box::new(pcg)));
        }
        let pcg = Pcg::with_hierarchy(Cpu::on(ranks), Arc::clone(k), hierarchy)?;
        Ok(Self::Cpu(Box::new(pcg)))
    }

    fn solve(
        &mut self,
        k: &dyn SquareBlocks,
        system: SystemOfRank,
        stop: &Stop,
    ) -> Result<Correction, PcgError> {
        match self {
            Self::Cpu(pcg) => system.solved(pcg, k, stop),
            #[cfg(feature = "gpu")]
            Self::Gpu(pcg) => system.solved(pcg, k, stop),
        }
    }

    fn counts(&mut self) -> &mut SolveCounts {
        match self {
            Self::Cpu(pcg) => &mut pcg.counts,
            #[cfg(feature = "gpu")]
            Self::Gpu(pcg) => &mut pcg.counts,
        }
    }
}

/// K x = b, with an entry per unknown of this rank.
struct SystemOfRank<'a> {
    b: &'a [f64],
    /// The start, and the result so far, even after a failure.
    x: &'a mut [f64],
    /// The norm of the terms whose difference is b: residuals are then absolute, and x is the start. Without it they are
    /// relative to b, and the start is zero.
    terms: Option<f64>,
    accuracy: Accuracy,
}

impl SystemOfRank<'_> {
    fn solved<B: Backend>(
        self,
        pcg: &mut Pcg<B>,
        k: &dyn SquareBlocks,
        stop: &Stop,
    ) -> Result<Correction, PcgError> {
        let Self {
            b,
            x,
            terms,
            accuracy,
        } = self;
        if terms.is_none() {
            x.fill(0.0);
        }
        if !pcg.is_f64() {
            let accuracy = match (accuracy, terms) {
                (Accuracy::Residual(residual), Some(terms)) => Accuracy::Residual(residual / terms),
                (accuracy, _) => accuracy,
            };
            let terms = terms.unwrap_or_else(|| pcg.backend.norm(b));
            return pcg.refine(b, terms, x, accuracy, stop);
        }
        pcg.counts.solves += 1;
        let to = pcg.run_to(accuracy, 1.0);
        let run = match (accuracy, terms) {
            (Accuracy::Residual(residual), Some(_)) => Run {
                residual,
                ..Run::default()
            },
            // Forces that cancel leave rounding: without a floor the residual of a u that follows λ would have to shrink from
            // step to step.
            (_, Some(terms)) => Run {
                residual: UNREACHABLE * terms,
                ..to
            },
            (_, None) => to,
        };
        let run = Run {
            continues: terms.is_some(),
            ..run
        };
        if run.continues {
            let mut r = b.to_vec();
            k.subtract_product(x, &mut r);
            pcg.backend.upload(&r, &mut pcg.r);
            pcg.backend.upload(x, &mut pcg.x);
        } else {
            pcg.backend.upload(b, &mut pcg.r);
        }
        let outcome = pcg.run(run, stop, None);
        pcg.backend.download(&pcg.x, x)?;
        Ok(pcg.followed(&outcome?, 1.0))
    }
}

/// The dual operator of a problem whose unknowns are on several ranks.
pub(super) struct Distributed {
    group: Arc<Group>,
    ranks: Ranks,
    b: Arc<Csr>,
    /// The f of the last load case, and its norm over all ranks.
    load: Arc<Vec<f64>>,
    load_norm: f64,
    /// With ties.
    k: Arc<dyn SquareBlocks>,
    cg: Cg,
    /// Why PETSc has failed since the last run began.
    failure: Arc<Mutex<Option<PetscError>>>,
    /// The preconditioner for a log, and the reason why it is not multigrid although that was requested.
    about: String,
    fallback: Option<String>,
    ties: Vec<(u32, f64)>,
    /// u of the last gradient or displacement, the start for the next, and K⁻¹Bᵀp of the last product.
    u: Vec<f64>,
    product: Vec<f64>,
    /// The stop; a product only asks whether its caller may be stopped at all.
    pub limits: Limits,
}

impl From<PetscError> for DualError {
    fn from(error: PetscError) -> Self {
        Self::Other(Box::new(error))
    }
}

/// The own rows of K with their halo: a square matrix of vectors that are on several ranks.
struct Spread<const D: usize> {
    rows: BlockCsr<D>,
    halo: Halo,
    /// A vector with copies.
    x: Mutex<Vec<f64>>,
}

impl<const D: usize> Spread<D> {
    /// The work on x with copies of the entries of others.
    fn with<T>(&self, x: &[f64], work: impl FnOnce(&[f64]) -> T) -> T {
        let mut extended = self.x.lock().unwrap_or_else(PoisonError::into_inner);
        extended[..x.len()].copy_from_slice(x);
        self.halo.update(D, &mut extended);
        work(&extended)
    }
}

impl<const D: usize> SquareBlocks for Spread<D> {
    fn block(&self) -> usize {
        D
    }

    fn row_ptr(&self) -> &[usize] {
        self.rows.row_ptr()
    }

    fn col_idx(&self) -> &[u32] {
        self.rows.col_idx()
    }

    fn entries(&self) -> &[f64] {
        self.rows.entries()
    }

    fn multiply(&self, x: &[f64], y: &mut [f64]) -> f64 {
        self.with(x, |x| self.rows.multiply(x, y))
    }

    fn subtract_product(&self, x: &[f64], y: &mut [f64]) {
        self.with(x, |x| self.rows.subtract_product(x, y));
    }

    fn multiply_with_sizes(&self, x: &[f64], s: &[f64]) -> [Vec<f64>; 2] {
        let s = self.halo.extended(D, s.to_vec());
        self.with(x, |x| self.rows.multiply_with_sizes(x, &s))
    }

    fn for_entries(&self, take: &mut dyn FnMut(usize, usize, f64)) {
        self.rows.for_entries(take);
    }

    fn halo(&self) -> Option<&Halo> {
        Some(&self.halo)
    }
}

/// The levels below ours, by PETSc.
struct Petsc {
    preconditioner: Mutex<petsc::Preconditioner>,
    failure: Arc<Mutex<Option<PetscError>>>,
}

impl fmt::Debug for Petsc {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("PETSc")
    }
}

impl SolverBelow for Petsc {
    fn solve(&self, r: &[f64], z: &mut [f64]) {
        let mut preconditioner =
            (self.preconditioner.lock()).unwrap_or_else(PoisonError::into_inner);
        if let Err(error) = preconditioner.apply(r, z) {
            z.fill(f64::NAN);
            self.failure
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .get_or_insert(error);
        }
    }
}

impl Distributed {
    /// Sets up multigrid, or block-Jacobi.
    pub fn new<const D: usize>(
        group: &Arc<Group>,
        problem: &ContactProblem<D, Elsewhere>,
        own: OwnRows<D>,
        means: &Means,
    ) -> Result<Self, DualError> {
        petsc::set_options(&OPTIONS)?;
        if group.size() > 1 {
            petsc::set_options(&OF_SEVERAL)?;
        }
        let OwnRows {
            rows,
            halo,
            ties,
            vertices,
        } = own;
        let ranks = Ranks::of(group);
        let (failure, below) = (Arc::default(), RefCell::new(String::new()));
        let make = |rows: RowsBelow| -> Result<Arc<dyn SolverBelow>, AmgError> {
            let made = petsc::Matrix::new(group, &rows)
                .and_then(|matrix| petsc::Preconditioner::new(group, matrix, PREFIX))
                .and_then(|made| Ok((made.about()?, made)));
            // A failure on one rank makes the others useless.
            match made {
                Ok((about, made)) if !group.any(false) => {
                    *below.borrow_mut() = about;
                    Ok(Arc::new(Petsc {
                        preconditioner: Mutex::new(made),
                        failure: Arc::clone(&failure),
                    }))
                }
                Ok(_) => Err(AmgError::Below("another rank has failed".to_owned())),
                Err(error) => {
                    group.any(true);
                    Err(AmgError::Below(error.to_string()))
                }
            }
        };
        let made = match means.preconditioner {
            Preconditioner::BlockJacobi => None,
            Preconditioner::Multigrid => Some(Hierarchy::on_ranks(
                &rows,
                problem.coordinates(),
                vertices.as_ref().map(|(vertices, _)| vertices),
                &AmgSettings::of_dimension(D),
                OnRanks {
                    nodes: &halo,
                    corners: vertices.as_ref().map(|(_, halo)| halo),
                    below: &make,
                },
            )),
        };
        let fallback = match &made {
            Some(Err(error @ (AmgError::Below(_) | AmgError::TooLarge))) => {
                Some(format!("multigrid could not be set up ({error})"))
            }
            _ => None,
        };
        let hierarchy = match made {
            Some(made) if fallback.is_none() => made,
            _ => Hierarchy::block_jacobi_on(&rows, &ranks),
        };
        let hierarchy = hierarchy.map_err(PcgError::from)?;
        let mut sizes: Vec<f64> = (hierarchy.sizes().iter())
            .map(|size| size.unknowns as f64)
            .collect();
        ranks.sum(&mut sizes);
        let about = match (hierarchy.is_multigrid(), &sizes[..]) {
            (false, _) => "block-Jacobi".to_owned(),
            (true, [own @ .., _]) if !own.is_empty() => {
                let below = below.into_inner();
                let own: Vec<String> = own.iter().map(f64::to_string).collect();
                format!(
                    "own levels of {} unknowns, below them {below}",
                    own.join(", ")
                )
            }
            (true, _) => below.into_inner(),
        };
        let own = rows.n_rows();
        let k: Arc<dyn SquareBlocks> = Arc::new(Spread {
            x: Mutex::new(vec![0.0; rows.n_cols()]),
            rows,
            halo,
        });
        Ok(Self {
            b: Arc::clone(problem.contact_matrix()),
            load: Arc::clone(problem.load_case().force()),
            load_norm: ranks.norm(problem.load_case().force()),
            cg: Cg::new(means, &ranks, &k, hierarchy)?,
            k,
            failure,
            about,
            fallback,
            ties,
            u: vec![0.0; own],
            product: vec![0.0; own],
            limits: Limits::default(),
            ranks,
            group: Arc::clone(group),
        })
    }

    /// The operator for K⁻¹, for a log, and the reason why it is not multigrid although that was requested.
    pub fn about(&self) -> (&str, Option<&str>) {
        (&self.about, self.fallback.as_deref())
    }

    /// The adapter of this rank, and the precision of its kernels, if it computes on one.
    pub fn adapter(&self) -> Option<(String, Precision)> {
        match &self.cg {
            Cg::Cpu(_) => None,
            #[cfg(feature = "gpu")]
            Cg::Gpu(pcg) => {
                let context = pcg.backend.context();
                Some((context.adapter.to_string(), context.precision))
            }
        }
    }

    /// Bᵀλ on the unknowns of this rank.
    fn forces(&self, lambda: &[f64]) -> Vec<f64> {
        let mut forces = vec![0.0; self.b.n_cols()];
        self.b.mul_transpose_add(1.0, lambda, &mut forces);
        forces
    }

    /// y = B u.
    fn seen(&self, u: &[f64], y: &mut [f64]) {
        self.b.mul(u, y);
        self.ranks.sum(y);
    }

    /// Solves a system. `stop` only tells whether the caller may be stopped at all.
    fn solve(&mut self, system: SystemOfRank, stop: &Stop) -> Result<Correction, DualError> {
        let limits = &self.limits;
        let stop = match stop.deadline.is_some() || stop.interrupt.is_some() {
            true => Stop {
                deadline: limits.deadline,
                interrupt: limits.interrupt.as_deref(),
                ranks: Some(&self.ranks),
            },
            false => Stop::default(),
        };
        let outcome = self.cg.solve(&*self.k, system, &stop);
        if let Some(error) = (self.failure.lock())
            .unwrap_or_else(PoisonError::into_inner)
            .take()
        {
            return Err(error.into());
        }
        Ok(outcome?)
    }

    /// Solves K u = f − Bᵀλ from the previous u; and y = B u. The accuracy of a residual is absolute, not relative to
    /// the right-hand side.
    fn follow(
        &mut self,
        lambda: &[f64],
        y: &mut [f64],
        along: f64,
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<Correction, DualError> {
        let contact = self.forces(lambda);
        let mut u = std::mem::take(&mut self.u);
        if along != 0.0 {
            add_times(-along, &self.product, &mut u);
        }
        let terms = self.load_norm.max(self.ranks.norm(&contact));
        if terms == 0.0 {
            // The error that CG leaves in a vanishing u would have to shrink for ever.
            u.fill(0.0);
            self.u = u;
            y.fill(0.0);
            return Ok(Correction::default());
        }
        let system = SystemOfRank {
            b: &difference(&self.load, &contact),
            x: &mut u,
            terms: Some(terms),
            accuracy,
        };
        let outcome = self.solve(system, stop);
        self.u = u;
        self.seen(&self.u, y);
        outcome
    }
}

impl DualOperator for Distributed {
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
        let forces = self.forces(p);
        let mut product = std::mem::take(&mut self.product);
        let system = SystemOfRank {
            b: &forces,
            x: &mut product,
            terms: None,
            accuracy,
        };
        let outcome = self.solve(system, stop);
        self.product = product;
        self.seen(&self.product, y);
        outcome.map(|_| ())
    }

    fn right_hand_side(
        &mut self,
        load: &LoadCase,
        b: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        followed_right_hand_side(self, load, b, accuracy, stop)
    }

    fn gradient(
        &mut self,
        load: &LoadCase,
        lambda: &[f64],
        r: &mut [f64],
        along: f64,
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<Option<Correction>, DualError> {
        self.take(load);
        let followed = self.follow(lambda, r, along, accuracy, stop)?;
        for (r, c) in r.iter_mut().zip(load.offsets()) {
            *r = c - *r;
        }
        Ok(Some(followed))
    }

    fn displacement(
        &mut self,
        load: &LoadCase,
        lambda: &[f64],
        residual: f64,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        self.take(load);
        let mut y = vec![0.0; self.b.n_rows()];
        let mut asked = residual;
        for _ in 0..MOST_PASSES {
            self.follow(lambda, &mut y, 0.0, Accuracy::Residual(asked), stop)?;
            // An imbalance that CG leaves all over a body is held by its ties in a few places.
            let held = (self.ties.iter()).map(|&(i, tie)| (tie * self.u[i as usize]).powi(2));
            let mut held = [held.sum::<f64>()];
            self.ranks.sum(&mut held);
            if held[0].sqrt() <= residual {
                break;
            }
            asked *= 0.1;
        }
        Ok(self.u.clone())
    }

    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        let mut made = self.k.multiply_with_sizes(u, s);
        for &(i, tie) in &self.ties {
            let i = i as usize;
            made[0][i] -= tie * u[i];
            made[1][i] -= tie * s[i];
        }
        Ok(made)
    }

    fn linear_iterations(&mut self, tolerance: f64) -> Result<Option<usize>, DualError> {
        let (before, load) = (*self.cg.counts(), Arc::clone(&self.load));
        let system = SystemOfRank {
            b: &load,
            x: &mut vec![0.0; load.len()],
            terms: None,
            accuracy: Accuracy::Residual(tolerance),
        };
        self.solve(system, &Stop::default())?;
        let counts = self.cg.counts();
        let iterations = counts.iterations - before.iterations;
        *counts = before;
        Ok(Some(iterations))
    }

    fn costs(&self) -> Option<Costs> {
        Some(match &self.cg {
            Cg::Cpu(pcg) => pcg.costs(),
            #[cfg(feature = "gpu")]
            Cg::Gpu(pcg) => pcg.costs(),
        })
    }
}

impl Distributed {
    /// Takes the f of a load case: all ranks get another one at the same time, even if their own part has not changed.
    fn take(&mut self, load: &LoadCase) {
        if Arc::ptr_eq(&self.load, load.force()) {
            return;
        }
        let is_other = load.take_force(&mut self.load);
        if self.group.any(is_other) {
            self.u.fill(0.0);
            self.load_norm = self.ranks.norm(&self.load);
        }
    }
}
