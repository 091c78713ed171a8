//! A = B K⁻¹ Bᵀ with K on several ranks: conjugate gradients around our own levels of multigrid, over those of PETSc.
//!
//! λ is on all ranks, K, u, f and the columns of B are where their unknowns are. A product needs no message for Bᵀλ, those of
//! the halo and of PETSc for K⁻¹, and one sum for B u. It is that of one process ([`NestedDual`]); what is of several ranks is
//! here: K in rows, PETSc, and when all of them stop.

use super::petsc::{self, PetscError};
use super::share::MpiError;
use crate::backend::cpu::Cpu;
#[cfg(feature = "gpu")]
use crate::backend::gpu::{Context, Gpu};
use crate::backend::{Backend, Precision};
use crate::control::{Accuracy, Correction, Costs, Stop};
use crate::dual::{DualError, DualOperator, NestedDual, Request};
use crate::engine::{Device, EngineError, EngineOptions, Stiffness};
use crate::problem::{ContactProblem, Elsewhere, Vertices};
use crate::ranks::{Group, Halo, Ranks};
use crate::sparse::BlockCsr;
use crate::sparse::stored::SquareBlocks;
use crate::stiffness::amg::{AmgError, AmgSettings, Hierarchy, OnRanks, RowsBelow, SolverBelow};
use crate::stiffness::pcg::{Pcg, PcgError, Preconditioner};
use std::cell::RefCell;
use std::fmt;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

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

    /// The adapter of this rank, and the precision of its kernels, if it computes on one.
    fn adapter(&self) -> Option<(String, Precision)> {
        #[cfg(feature = "gpu")]
        return (self.context.as_ref())
            .map(|context| (context.adapter.to_string(), context.precision));
        #[cfg(not(feature = "gpu"))]
        None
    }

    /// Conjugate gradients on the device of this rank.
    fn dual<const D: usize>(
        &self,
        problem: &ContactProblem<D, Elsewhere>,
        k: &Arc<dyn SquareBlocks>,
        ties: &[(u32, f64)],
        hierarchy: Hierarchy<f32>,
    ) -> Result<Box<dyn DualOperator>, PcgError> {
        #[cfg(feature = "gpu")]
        if let Some(context) = &self.context {
            let gpu = Gpu::on(context, problem.ranks())?;
            return on_device(gpu, problem, k, ties, hierarchy);
        }
        on_device(Cpu::on(problem.ranks()), problem, k, ties, hierarchy)
    }
}

/// The same on this backend.
fn on_device<B: Backend<Stored = f32> + 'static, const D: usize>(
    backend: B,
    problem: &ContactProblem<D, Elsewhere>,
    k: &Arc<dyn SquareBlocks>,
    ties: &[(u32, f64)],
    hierarchy: Hierarchy<f32>,
) -> Result<Box<dyn DualOperator>, PcgError> {
    let pcg = Pcg::with_hierarchy(backend, Arc::clone(k), hierarchy)?;
    let dual = NestedDual::on(pcg, problem, Arc::clone(k), ties.to_vec())?;
    Ok(Box::new(dual))
}

/// The dual operator of a problem whose unknowns are on several ranks.
pub(super) struct Distributed {
    ranks: Ranks,
    dual: Box<dyn DualOperator>,
    /// With ties.
    k: Arc<dyn SquareBlocks>,
    ties: Vec<(u32, f64)>,
    /// Why PETSc has failed since the last run began.
    failure: Arc<Mutex<Option<PetscError>>>,
    /// The preconditioner for a log, and the reason why it is not multigrid although that was requested.
    about: String,
    fallback: Option<String>,
    /// The adapter of this rank, and the precision of its kernels, if it computes on one.
    pub adapter: Option<(String, Precision)>,
    /// The stop; a request only tells whether its caller may be stopped at all.
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
        let k: Arc<dyn SquareBlocks> = Arc::new(Spread {
            x: Mutex::new(vec![0.0; rows.n_cols()]),
            rows,
            halo,
        });
        Ok(Self {
            ranks,
            dual: means.dual(problem, &k, &ties, hierarchy)?,
            k,
            ties,
            failure,
            about,
            fallback,
            adapter: means.adapter(),
            limits: Limits::default(),
        })
    }

    /// The operator for K⁻¹, for a log, and the reason why it is not multigrid although that was requested.
    pub fn about(&self) -> (&str, Option<&str>) {
        (&self.about, self.fallback.as_deref())
    }

    /// Makes a product or u. `stop` only tells whether the caller may be stopped at all.
    fn on_all<T>(
        &mut self,
        stop: &Stop,
        work: impl FnOnce(&mut dyn DualOperator, &Stop) -> Result<T, DualError>,
    ) -> Result<T, DualError> {
        let limits = &self.limits;
        let stop = match stop.deadline.is_some() || stop.interrupt.is_some() {
            true => Stop {
                deadline: limits.deadline,
                interrupt: limits.interrupt.as_deref(),
                ranks: Some(&self.ranks),
            },
            false => Stop::default(),
        };
        let outcome = work(&mut *self.dual, &stop);
        let mut failure = (self.failure.lock()).unwrap_or_else(PoisonError::into_inner);
        match failure.take() {
            Some(error) => Err(error.into()),
            None => outcome,
        }
    }
}

impl DualOperator for Distributed {
    fn size(&self) -> (usize, usize) {
        self.dual.size()
    }

    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        self.on_all(stop, |dual, stop| dual.apply(p, y, accuracy, stop))
    }

    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.dual.restrict(u, y);
    }

    fn at_contact(&mut self, request: &Request, y: &mut [f64]) -> Result<Correction, DualError> {
        self.on_all(request.stop, |dual, stop| {
            dual.at_contact(&Request { stop, ..*request }, y)
        })
    }

    fn is_exact(&self) -> bool {
        false
    }

    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        self.on_all(request.stop, |dual, stop| {
            dual.displacement(&Request { stop, ..*request })
        })
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
        self.on_all(&Stop::default(), |dual, _| {
            dual.linear_iterations(tolerance)
        })
    }

    fn costs(&self) -> Option<Costs> {
        self.dual.costs()
    }
}
