//! A rank's share of a model or problem, and its load steps.

use super::matrices::{self, More, OwnMatrices};
use super::operator::{Distributed, Limits, Means, OwnRows};
use super::partition;
use super::petsc::{self, PetscError};
use crate::backend::Precision;
use crate::contact::Space;
use crate::control::Costs;
use crate::dual::{DualError, DualOperator as _};
use crate::elasticity::{assemble_rows, vertices_of_rows};
use crate::engine::{EngineError, EngineOptions};
use crate::memory::peak_memory_mib;
use crate::mesh::{ElementKind, Topology};
use crate::model::share::{Common, Cut, Graph, Part, Received};
use crate::model::{Cycles, Draft, ModelError};
use crate::problem::{self, AnyProblem, ContactProblem, Elsewhere, LoadCase, System};
use crate::quasistatic::{State, StepSettings};
use crate::ranks::{Group, Halo, Ranks};
use crate::solve::{self, Event, Plan, make_steps};
use crate::sparse::BlockCsr;
use crate::ssnm::RecycledSubspace;
use crate::stiffness::pcg::PcgError;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Several ranks could not share a problem, or solve it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MpiError {
    /// The model is inconsistent. Only on rank 0.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The nodes could not be divided among the ranks. Only on rank 0.
    #[error("the nodes cannot be divided among the ranks: {0}")]
    Partition(String),
    /// Rank 0 has the error with the cause.
    #[error("rank 0 failed")]
    Elsewhere,
    /// The data of the ranks do not fit together.
    #[error("{0}")]
    Rows(String),
    /// PETSc has failed, perhaps only on this rank: end all of them.
    #[error(transparent)]
    Petsc(#[from] PetscError),
    /// A factor was asked for.
    #[error("the factor is made in one process; several ranks solve by conjugate gradients")]
    NoFactor,
    /// No GPU for this rank.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// K⁻¹ could not be set up. On all ranks, unless PETSc or a GPU has failed.
    #[error(transparent)]
    Operator(#[from] DualError),
    /// A load step could not be made. On all ranks, unless PETSc or a GPU has failed.
    #[error(transparent)]
    Solve(#[from] solve::Error),
    /// Multipliers are no longer the same on all ranks, which must not happen.
    #[error(
        "the ranks computed different contact forces: this is a fault of the program or of the machine"
    )]
    Apart,
}

impl MpiError {
    /// Whether other ranks may not know of it, and wait.
    pub fn is_of_one_rank(&self) -> bool {
        let is_of_device = |error: &DualError| {
            matches!(
                error,
                DualError::Other(_) | DualError::Pcg(PcgError::Backend(_))
            )
        };
        match self {
            Self::Petsc(_) => true,
            Self::Engine(error) => !matches!(error, EngineError::NoGpuSupport),
            Self::Operator(error) => is_of_device(error),
            Self::Solve(solve::Error::Step(step)) => matches!(
                &step.error.cause,
                crate::ssnm::Cause::Operator(error) if is_of_device(error)
            ),
            _ => false,
        }
    }
}

/// The distribution of unknowns and elements among the ranks.
#[derive(Clone, Debug, Default, serde::Serialize)]
pub struct Imbalance {
    /// Unknowns of each rank.
    pub unknowns: Vec<usize>,
    /// Elements that each rank has, those of others around its nodes included; none where K was given.
    pub elements: Vec<usize>,
    /// Seconds for the partition, on rank 0; for cutting the mesh up and sending; and for the rows of K and setting PETSc up, the
    /// slowest rank's.
    pub partition: f64,
    /// Seconds to cut the model up and to send the parts.
    pub distribution: f64,
    /// The largest resident size of rank 0 while it had the whole mesh, in mebibytes.
    pub root_mib: Option<f64>,
    /// Seconds for the rows of K on the slowest rank.
    pub assembly: f64,
    /// Seconds until PETSc has K and its preconditioner.
    pub setup: f64,
}

impl Imbalance {
    /// Unknowns of the fullest rank over their mean.
    pub fn of_unknowns(&self) -> f64 {
        let all: usize = self.unknowns.iter().sum();
        let most = self.unknowns.iter().max().copied().unwrap_or(0);
        most as f64 * self.unknowns.len() as f64 / all.max(1) as f64
    }
}

/// The bodies on this rank.
pub(super) struct Bodies<const D: usize>
where
    ElementKind: Topology<D>,
{
    pub received: Received<D>,
    /// Seconds of rank 0 up to here, and those for the contacts among them.
    pub seconds: [f64; 2],
}

/// This rank's part of a contact problem, with the operator for K⁻¹ on all of them.
pub struct Share<const D: usize>
where
    ElementKind: Topology<D>,
{
    group: Arc<Group>,
    pub(super) problem: ContactProblem<D, Elsewhere>,
    pub(super) dual: Distributed,
    pub(super) bodies: Option<Arc<Bodies<D>>>,
    /// Numbers of its blocks in the order that they were given in; empty where they are the ranks' own.
    pub(super) original: Vec<u32>,
    recycled: RecycledSubspace,
    division: Imbalance,
}

/// A [`Share`] of either dimension.
pub enum AnyShare {
    /// Of the plane.
    Plane(Box<Share<2>>),
    /// Of space.
    Space(Box<Share<3>>),
}

/// Whatever rank 0 has made, or that it has failed.
pub(super) fn agreed<T>(
    group: &Group,
    made: Option<Result<T, MpiError>>,
) -> Result<Option<T>, MpiError> {
    let failed = made.as_ref().is_some_and(Result::is_err);
    match (group.any(failed), made) {
        (false, made) => Ok(made.and_then(Result::ok)),
        (true, Some(Err(error))) => Err(error),
        (true, _) => Err(MpiError::Elsewhere),
    }
}

impl<const D: usize> Share<D>
where
    ElementKind: Space<D>,
{
    /// Divides a model, which rank 0 passes in, among the ranks: each gets its nodes with the elements around them, and
    /// makes its rows of K.
    ///
    /// # Errors
    /// On rank 0 the fault of the model; [`MpiError::Elsewhere`] on the others.
    ///
    /// # Panics
    /// If rank 0 has no model.
    pub fn of_model(
        group: &Arc<Group>,
        draft: Option<Draft<D>>,
        options: &EngineOptions,
    ) -> Result<Self, MpiError> {
        petsc::start()?;
        let means = Means::new(group, options)?;
        let is_root = group.rank() == 0;
        let elastic = draft.filter(|_| is_root).map(|draft| draft.0);
        assert!(elastic.is_some() == is_root, "rank 0 needs the model");
        let mut division = Imbalance::default();
        let start = Instant::now();
        let divided = elastic.as_ref().map(|elastic| {
            let mut graph = Graph::new(elastic).ok_or_else(|| {
                MpiError::Partition("the mesh is too large for METIS's 32-bit numbers".to_owned())
            })?;
            partition::owners(&mut graph, group.size()).map_err(MpiError::Partition)
        });
        let owner = agreed(group, divided)?;
        division.partition = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let cut = (elastic.as_ref().zip(owner.as_ref()))
            .map(|(elastic, owner)| Cut::new(elastic, owner, group.size()).map_err(MpiError::from));
        let cut = agreed(group, cut)?;
        let common: Common = group.broadcast(cut.as_ref().map(|cut| cut.common.clone()));
        let part: Part = match &cut {
            None => group.receive(0),
            Some(cut) => {
                let sizes = cut.sizes();
                division.unknowns = sizes.iter().map(|size| size[0]).collect();
                division.elements = sizes.iter().map(|size| size[1]).collect();
                group.send_each(|rank| cut.part(rank));
                cut.part(0)
            }
        };
        drop(cut);
        // Here the mesh goes.
        let whole = peak_memory_mib().filter(|_| is_root);
        let (mut pairs, mut seconds, mut temperatures) = (Vec::new(), [0.0; 2], Vec::new());
        if let Some(elastic) = elastic {
            temperatures = elastic.temperatures();
            seconds = [elastic.assembly_seconds, elastic.pairing_seconds];
            pairs = elastic.pairs;
            for pair in &mut pairs {
                (pair.facets, pair.others) = Default::default();
            }
        }
        drop(owner);
        give_back_freed();
        let mut received = Received::new(common, part);
        if group.rank() == 0 {
            // Without their facets.
            received.elastic.pairs = pairs;
        }
        received.learn_temperatures(group, &temperatures);
        drop(temperatures);
        group.any(false);
        division.distribution = start.elapsed().as_secs_f64();
        division.root_mib = whole;

        let start = Instant::now();
        let ranks = Ranks::of(group);
        let elastic = &received.elastic;
        let own = received.part.parts.len();
        let mut rows = assemble_rows(&elastic.body(), &elastic.unknowns, own);
        check_diagonal(group, &rows)?;
        let mut points = elastic.unknowns.coordinates(&elastic.mesh);
        points.truncate(own);
        let first = received.step(0);
        let contact = &elastic.contact;
        let zero = vec![0.0; contact.tangential.n_rows()];
        let problem = ContactProblem::of_share(
            problem::Share {
                rows: &rows,
                n: [received.common.n, received.common.n_free],
                normal: contact.normal.clone(),
                tangential: contact.tangential.clone(),
                free: received.floating_bodies(&points, &ranks),
                coordinates: Some(points),
                areas: received.common.areas.clone(),
                compliance: contact.compliance.clone(),
                parts: received.part.parts.clone(),
                case: LoadCase {
                    friction: Arc::new(coefficients(&contact.coefficient)),
                    ..LoadCase::new(
                        first.load.force,
                        first.load.acting,
                        first.load.gap,
                        zero,
                        contact.slip_bound.clone(),
                    )
                },
            },
            &ranks,
        );
        let ties = tie(&mut rows, &received.part.ties);
        group.any(false);
        division.assembly = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let halo = Halo::new(&ranks, own, received.part.ghost_blocks.clone());
        // The corners of tied nodes may be of other ranks: their matrix is then made from K.
        let is_tied = ranks.any(!ties.is_empty());
        let elastic = &received.elastic;
        let own_rows = OwnRows {
            vertices: vertices_of_rows(&elastic.body(), &elastic.unknowns, &halo, !is_tied),
            rows,
            halo,
            ties,
        };
        let dual = Distributed::new(group, &problem, own_rows, &means)?;
        division.setup = start.elapsed().as_secs_f64();
        give_back_freed();
        Ok(Self {
            group: Arc::clone(group),
            problem,
            dual,
            bodies: Some(Arc::new(Bodies { received, seconds })),
            original: Vec::new(),
            recycled: RecycledSubspace::default(),
            division,
        })
    }

    /// Divides a problem from matrices, which rank 0 has, among the ranks.
    ///
    /// # Errors
    /// As [`Share::of_model`].
    ///
    /// # Panics
    /// If rank 0 has no problem.
    pub fn of_problem(
        group: &Arc<Group>,
        problem: Option<ContactProblem<D>>,
        options: &EngineOptions,
    ) -> Result<Self, MpiError> {
        petsc::start()?;
        let (own, more, original) = matrices::divided(group, problem)?;
        let mut share = Self::of_parts(group, own, more, options)?;
        share.original = original;
        Ok(share)
    }

    /// Takes each rank's part of K, f and B.
    ///
    /// # Errors
    /// If the parts do not fit together, or an entry is not finite; on all ranks.
    pub fn of_rows(
        group: &Arc<Group>,
        own: OwnMatrices<D>,
        options: &EngineOptions,
    ) -> Result<Self, MpiError> {
        petsc::start()?;
        Self::of_parts(group, own, More::default(), options)
    }

    fn of_parts(
        group: &Arc<Group>,
        own: OwnMatrices<D>,
        more: More,
        options: &EngineOptions,
    ) -> Result<Self, MpiError> {
        let means = Means::new(group, options)?;
        let start = Instant::now();
        let ranks = Ranks::of(group);
        let made = own.made(more, group, &ranks)?;
        check_diagonal(group, &made.rows)?;
        let mut division = Imbalance {
            unknowns: group.counts(made.rows.n_rows()),
            ..Imbalance::default()
        };
        let mut rows = made.rows;
        let problem = ContactProblem::of_share(
            problem::Share {
                rows: &rows,
                n: made.n,
                normal: made.normal,
                tangential: made.tangential,
                coordinates: made.coordinates,
                areas: made.areas,
                compliance: made.compliance,
                free: made.free,
                parts: made.parts,
                case: made.case,
            },
            &ranks,
        );
        let ties = tie(&mut rows, &made.ties);
        division.assembly = start.elapsed().as_secs_f64();
        let start = Instant::now();
        let own = (rows.n_block_rows() as u64).min(u64::from(u32::MAX) - made.first);
        let original = (made.first..made.first + own)
            .map(|block| block as u32)
            .collect();
        let own_rows = OwnRows {
            halo: Halo::new(&ranks, rows.n_block_rows(), made.ghosts),
            rows,
            ties,
            vertices: None,
        };
        let dual = Distributed::new(group, &problem, own_rows, &means)?;
        division.setup = start.elapsed().as_secs_f64();
        Ok(Self {
            group: Arc::clone(group),
            problem,
            dual,
            bodies: None,
            original,
            recycled: RecycledSubspace::default(),
            division,
        })
    }

    /// The system as this rank sees it. Vectors with an entry per row of K have the entries of its own unknowns, and so
    /// have u and f wherever they are passed.
    pub fn system(&self) -> &System<D> {
        &self.problem
    }

    /// The ranks that share the problem.
    pub fn group(&self) -> &Arc<Group> {
        &self.group
    }

    /// The distribution of unknowns and elements, with seconds; complete on rank 0.
    pub fn division(&self) -> &Imbalance {
        &self.division
    }

    /// The operator for K⁻¹, for a log, and the reason why it is not multigrid although that was requested.
    pub fn about(&self) -> (&str, Option<&str>) {
        self.dual.about()
    }

    /// The adapter of this rank, and the precision of its kernels, if it computes on one.
    pub fn adapter(&self) -> Option<(String, Precision)> {
        self.dual.adapter.clone()
    }

    /// The bodies that only contact holds, and how they could move as a whole, in words; of a model.
    pub fn floating_bodies(&self) -> Vec<String> {
        let bodies = self
            .bodies
            .as_ref()
            .map(|bodies| &bodies.received.common.bodies);
        bodies
            .into_iter()
            .flatten()
            .map(|body| body.freedom.clone())
            .collect()
    }

    /// Number of load steps.
    pub fn n_steps(&self) -> usize {
        let bodies = self.bodies.as_ref();
        bodies.map_or(1, |bodies| bodies.received.common.steps.len())
    }

    /// The costs of K⁻¹ so far.
    pub fn costs(&self) -> Costs {
        self.dual.costs().unwrap_or_default()
    }

    /// PCG iterations of one linear solve to a relative residual.
    ///
    /// # Errors
    /// If it fails.
    pub fn linear_iterations(&mut self, tolerance: f64) -> Result<Option<usize>, DualError> {
        self.dual.linear_iterations(tolerance)
    }

    /// Makes the load steps one after another, as [`crate::model::Analysis::solve_on`] does. The settings have to be the same on
    /// all ranks. Rank 0's clock decides the time limit; `interrupt` on any rank stops all of them. The observer has to answer the
    /// same on all ranks.
    ///
    /// # Errors
    /// If a setting is invalid or K⁻¹ fails.
    pub fn solve(
        &mut self,
        settings: &StepSettings,
        interrupt: Option<Arc<AtomicBool>>,
        mut observer: impl FnMut(Event<D>) -> ControlFlow<()>,
    ) -> Result<(), MpiError> {
        let limit = settings.ssnm.time_limit;
        self.dual.limits = Limits {
            deadline: limit.and_then(|limit| Instant::now().checked_add(limit)),
            interrupt,
        };
        // The ranks agree on stopping in the products, where all of them are: no rank looks at its own clock. The flag, which
        // nobody sets, marks that stopping is possible.
        let mut settings = settings.clone();
        settings.ssnm.time_limit = None;
        settings.ssnm.interrupt = Some(Arc::default());
        let bodies = self.bodies.clone();
        let step = |step| Ok(bodies.as_ref().map(|bodies| bodies.received.step(step)));
        let plan = Plan {
            n_steps: self.n_steps(),
            step: &step,
            cycles: Cycles::ONCE,
            wearing: None,
        };
        let (group, mut is_apart) = (Arc::clone(&self.group), false);
        let mut watched = |event: Event<D>| {
            if let Event::Ends(solved) = &event {
                is_apart |= differ(&group, &solved.solution.lambda);
            }
            match observer(event) {
                ControlFlow::Continue(()) if !is_apart => ControlFlow::Continue(()),
                _ => ControlFlow::Break(()),
            }
        };
        let (problem, dual) = (&self.problem, &mut self.dual);
        let rest = State::at_rest(problem);
        make_steps(
            problem,
            rest,
            &plan,
            dual,
            &settings,
            &mut self.recycled,
            &mut watched,
        )?;
        match is_apart {
            true => Err(MpiError::Apart),
            false => Ok(()),
        }
    }
}

/// Whether numbers differ, in any bit, between ranks.
fn differ(group: &Group, values: &[f64]) -> bool {
    let hash = values.iter().fold(0_u64, |hash, v| {
        (hash.rotate_left(5) ^ v.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15)
    });
    // In halves, which an f64 holds.
    [hash >> 32, hash & 0xffff_ffff].into_iter().any(|half| {
        let half = half as f64;
        // Both, on all ranks.
        let (most, least) = (group.max(half), -group.max(-half));
        most != least
    })
}

/// Coefficients of friction as a load case has them.
pub(super) fn coefficients(mu: &[f64]) -> Vec<f64> {
    match mu.iter().all(|&mu| mu == 0.0) {
        true => Vec::new(),
        false => mu.to_vec(),
    }
}

/// Ties own unknowns to the ground, each as stiffly as K holds it; returns them.
fn tie<const D: usize>(rows: &mut BlockCsr<D>, unknowns: &[u32]) -> Vec<(u32, f64)> {
    let tie = |&unknown: &u32| {
        let (node, c) = (unknown as usize / D, unknown as usize % D);
        let block = rows.block_mut(node, node).expect("K has its diagonal");
        let stiffness = block[c][c];
        block[c][c] *= 2.0;
        (unknown, stiffness)
    };
    unknowns.iter().map(tie).collect()
}

/// The faults of K that are visible before it is used.
fn check_diagonal<const D: usize>(group: &Group, rows: &BlockCsr<D>) -> Result<(), MpiError> {
    let finite = rows
        .values()
        .iter()
        .flatten()
        .flatten()
        .all(|v| v.is_finite());
    let positive = rows.diagonal().iter().all(|&v| v > 0.0);
    match group.any(!(finite && positive)) {
        true => Err(MpiError::Rows(
            "the stiffness matrix has an entry that is not finite, or one on its diagonal that is not positive: check the moduli \
             and the mesh"
                .to_owned(),
        )),
        false => Ok(()),
    }
}

/// Returns freed memory to the system: glibc keeps it, and the whole mesh is a large part of it.
fn give_back_freed() {
    #[cfg(all(feature = "cli", target_os = "linux", target_env = "gnu"))]
    // SAFETY: it touches only free memory.
    unsafe {
        libc::malloc_trim(0);
    }
}

impl AnyShare {
    /// A problem from matrices, in whichever dimension: [`Share::of_problem`].
    ///
    /// # Errors
    /// As there.
    ///
    /// # Panics
    /// If rank 0 has no problem.
    pub fn of_problem(
        group: &Arc<Group>,
        problem: Option<AnyProblem>,
        options: &EngineOptions,
    ) -> Result<Self, MpiError> {
        let is_space = problem
            .as_ref()
            .map(|problem| matches!(problem, AnyProblem::Space(_)));
        if group.broadcast(is_space) {
            let problem = problem.and_then(|problem| match problem {
                AnyProblem::Space(problem) => Some(problem),
                AnyProblem::Plane(_) => None,
            });
            return Ok(Self::Space(Box::new(Share::of_problem(
                group, problem, options,
            )?)));
        }
        let problem = problem.and_then(|problem| match problem {
            AnyProblem::Plane(problem) => Some(problem),
            AnyProblem::Space(_) => None,
        });
        Ok(Self::Plane(Box::new(Share::of_problem(
            group, problem, options,
        )?)))
    }
}

/// Values of nodes with those of others: a vector per node.
pub(super) fn completed<const N: usize>(
    group: &Arc<Group>,
    own: usize,
    ghosts: &[u64],
    values: &mut [[f64; N]],
) {
    Halo::new(&Ranks::of(group), own, ghosts.to_vec()).update(N, values.as_flattened_mut());
}
