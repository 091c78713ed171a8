//! A = B K⁻¹ Bᵀ with K on several ranks: conjugate gradients around PETSc's products and its multigrid.
//!
//! λ is on all ranks, K, u, f and the columns of B are where their unknowns are. A product needs no message for Bᵀλ, those of
//! PETSc for K⁻¹, and one sum for B u.

use super::petsc::{self, Ghosts, Matrix, PetscError, Vector};
use crate::backend::Run;
use crate::backend::cpu::State;
use crate::control::{Accuracy, Correction, Costs, SolveCounts, Stop, Stopped};
use crate::dual::{DualError, DualOperator, followed_right_hand_side};
use crate::problem::{ContactProblem, Elsewhere, LoadCase};
use crate::ranks::{Group, Ranks};
use crate::sparse::{BlockCsr, Csr, add_times, difference, dot};
use crate::stiffness::pcg::{
    ENERGY_GROWTH, Falls, GROWTH, PcgError, Preconditioner, UNREACHABLE, Watch, most_iterations,
};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// The number of refinements of a displacement for the sake of its ties, as on one machine.
const MOST_PASSES: usize = 4;

/// ‖r − αq‖² follows from sums made with pᵀq, up to the rounding of ‖r‖²: below this part of the last computed sum it is computed
/// again, so that it has ten digits.
const FAITHFUL: f64 = 1e-6;

/// The prefix of the options of the preconditioner, and that of the fallback preconditioner.
const PREFIX: &str = "signorini_";
const FALLBACK: &str = "signorini_fallback_";

/// All options of GAMG; its own defaults change from version to version. An aggregation without threshold, each smoothed once,
/// coarsened twice as fast on the finest level; V-cycles with two Chebyshev steps around the diagonal, whose range PETSc
/// estimates by ten steps of CG; the coarsest level, of at most 1000 unknowns, on one rank by a factor. Jacobi is the only
/// smoother that neither fails on coarse levels nor depends on the number of ranks.
const OPTIONS: [(&str, &str); 25] = [
    ("-signorini_pc_type", "gamg"),
    ("-signorini_pc_gamg_type", "agg"),
    ("-signorini_pc_gamg_agg_nsmooths", "1"),
    ("-signorini_pc_gamg_threshold", "0.0"),
    // The same by its names before and after 3.18.
    ("-signorini_pc_gamg_square_graph", "1"),
    ("-signorini_pc_gamg_aggressive_coarsening", "1"),
    ("-signorini_pc_gamg_coarse_eq_limit", "1000"),
    ("-signorini_pc_gamg_process_eq_limit", "50"),
    ("-signorini_pc_gamg_repartition", "false"),
    ("-signorini_pc_gamg_reuse_interpolation", "true"),
    ("-signorini_pc_gamg_use_sa_esteig", "true"),
    // The other ways to make PᵀAP add up contributions of other ranks as they arrive: on four ranks coarse matrices, and with them
    // the answer, then differ in the last bits from run to run. This way takes a fifth less memory, and three times as long.
    ("-matptap_via", "allatonce_merged"),
    ("-signorini_pc_mg_type", "multiplicative"),
    ("-signorini_pc_mg_cycle_type", "v"),
    ("-signorini_mg_levels_ksp_type", "chebyshev"),
    ("-signorini_mg_levels_ksp_max_it", "2"),
    ("-signorini_mg_levels_ksp_norm_type", "none"),
    ("-signorini_mg_levels_ksp_chebyshev_esteig", "0,0.05,0,1.1"),
    ("-signorini_mg_levels_esteig_ksp_type", "cg"),
    ("-signorini_mg_levels_esteig_ksp_max_it", "10"),
    ("-signorini_mg_levels_pc_type", "jacobi"),
    ("-signorini_mg_coarse_ksp_type", "preonly"),
    ("-signorini_mg_coarse_pc_type", "bjacobi"),
    ("-signorini_mg_coarse_sub_pc_type", "lu"),
    // The inverse of the diagonal block of each node.
    ("-signorini_fallback_pc_type", "pbjacobi"),
];

/// The rows of K that belong to the unknowns of a rank.
pub(super) struct OwnRows<const D: usize> {
    /// Its block rows; block columns are its own blocks, then those of others (`ghosts`). Where bodies can move as a whole, with
    /// their ties.
    pub rows: BlockCsr<D>,
    /// The number of its first block, where blocks are counted rank by rank.
    pub first: u64,
    /// The numbers of the blocks of others.
    pub ghosts: Vec<u64>,
    /// Own unknowns tied to the ground, and how stiffly.
    pub ties: Vec<(u32, f64)>,
}

/// When all ranks are to stop.
#[derive(Clone, Debug, Default)]
pub(super) struct Limits {
    /// By rank 0's clock.
    pub deadline: Option<Instant>,
    /// On any rank.
    pub interrupt: Option<Arc<AtomicBool>>,
}

/// The dual operator of a problem whose unknowns are on several ranks.
pub(super) struct Distributed {
    group: Arc<Group>,
    ranks: Ranks,
    b: Arc<Csr>,
    /// The f of the last load case, and its norm over all ranks.
    load: Arc<Vec<f64>>,
    load_norm: f64,
    matrix: Rc<Matrix>,
    preconditioner: petsc::Preconditioner,
    /// Its description for a log, and the reason why it is not multigrid although that was requested.
    about: String,
    fallback: Option<String>,
    ghosts: Ghosts,
    /// The numbers of the blocks of others, in their order, each with its place here.
    places: Vec<(u64, u32)>,
    first: u64,
    block: usize,
    ties: Vec<(u32, f64)>,
    /// Unknowns on all ranks.
    n: usize,
    x: Vector,
    r: Vector,
    p: Vector,
    q: Vector,
    z: Vector,
    /// u of the last gradient or displacement, the start for the next, and K⁻¹Bᵀp of the last product.
    u: Vec<f64>,
    product: Vec<f64>,
    falls: Falls,
    counts: SolveCounts,
    /// The stop; a product only asks whether its caller may be stopped at all.
    pub limits: Limits,
}

impl From<PetscError> for DualError {
    fn from(error: PetscError) -> Self {
        Self::Other(Box::new(error))
    }
}

impl Distributed {
    /// Passes K to PETSc and sets up the preconditioner.
    pub fn new<const D: usize>(
        group: &Arc<Group>,
        problem: &ContactProblem<D, Elsewhere>,
        own: OwnRows<D>,
        preconditioner: Preconditioner,
    ) -> Result<Self, PetscError> {
        petsc::set_options(&OPTIONS)?;
        let OwnRows {
            rows,
            first,
            ghosts: numbers,
            ties,
        } = own;
        let count = rows.n_block_rows();
        let matrix = {
            let number = |j: u32| match (j as usize).checked_sub(count) {
                None => first + u64::from(j),
                Some(ghost) => numbers[ghost],
            };
            let counts: Vec<[usize; 2]> = (0..count)
                .map(|i| {
                    let columns = rows.row(i).0;
                    let here = columns.iter().filter(|&&j| (j as usize) < count).count();
                    [here, columns.len() - here]
                })
                .collect();
            let all: Vec<u64> = rows.col_idx().iter().map(|&j| number(j)).collect();
            let starts = rows.row_ptr();
            let filled = (0..count).map(|i| (&all[starts[i]..starts[i + 1]], rows.row(i).1));
            Matrix::new(group, first as usize, &counts, filled)?
        };
        drop(rows);
        let mut matrix = matrix;
        if let Some(points) = problem.coordinates() {
            matrix.set_points(points)?;
        }
        let matrix = Rc::new(matrix);
        let (made, fallback) = match preconditioner {
            Preconditioner::BlockJacobi => {
                (petsc::Preconditioner::new(group, &matrix, FALLBACK), None)
            }
            Preconditioner::Multigrid => {
                let made = petsc::Preconditioner::new(group, &matrix, PREFIX);
                // A failure on one rank makes the others useless.
                match group.any(made.is_err()) {
                    false => (made, None),
                    true => {
                        let reason = made.map_or_else(|error| error.to_string(), |_| String::new());
                        let reason = format!("multigrid could not be set up ({reason})");
                        (
                            petsc::Preconditioner::new(group, &matrix, FALLBACK),
                            Some(reason),
                        )
                    }
                }
            }
        };
        let made = made?;
        let kind = made.kind()?;
        let is_multigrid = kind == "gamg";
        let about = if is_multigrid {
            let levels: Vec<String> = made.levels()?.iter().map(usize::to_string).collect();
            format!(
                "{}: {kind}, levels of {} unknowns",
                petsc::version(),
                levels.join(", ")
            )
        } else {
            format!("{}: {kind}", petsc::version())
        };
        let mut places: Vec<(u64, u32)> = numbers.iter().copied().zip(count as u32..).collect();
        places.sort_unstable();
        let ranks = Ranks::of(group);
        let mut n = [(D * count) as f64];
        ranks.sum(&mut n);
        Ok(Self {
            b: Arc::clone(problem.contact_matrix()),
            load: Arc::clone(problem.load_case().force()),
            load_norm: ranks.norm(problem.load_case().force()),
            preconditioner: made,
            about,
            fallback,
            ghosts: Ghosts::new(group, D, count, &numbers)?,
            places,
            first,
            block: D,
            ties,
            n: n[0] as usize,
            x: matrix.vector()?,
            r: matrix.vector()?,
            p: matrix.vector()?,
            q: matrix.vector()?,
            z: matrix.vector()?,
            u: vec![0.0; D * count],
            product: vec![0.0; D * count],
            // GAMG leaves smooth errors that our own multigrid removes: with products that have them, contact takes up to twice the
            // steps on stretched meshes.
            falls: Falls::new(false, is_multigrid),
            counts: SolveCounts::default(),
            limits: Limits::default(),
            matrix,
            ranks,
            group: Arc::clone(group),
        })
    }

    /// The operator for K⁻¹, for a log, and the reason why it is not multigrid although that was requested.
    pub fn about(&self) -> (&str, Option<&str>) {
        (&self.about, self.fallback.as_deref())
    }

    /// The sum of a number over the ranks.
    fn sum(&self, value: f64) -> f64 {
        let mut sum = [value];
        self.ranks.sum(&mut sum);
        sum[0]
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

    /// z ≈ K⁻¹r, and rᵀz.
    fn precondition(&mut self) -> Result<f64, PetscError> {
        self.preconditioner.apply(&self.r, &mut self.z)?;
        let here = self.r.read(|r| self.z.read(|z| dot(r, z)))??;
        Ok(self.sum(here))
    }

    /// q = K p; pᵀq, rᵀq and qᵀq, and why to stop, if the caller may be stopped: all in one sum.
    fn multiply(&mut self, stop: &Stop) -> Result<([f64; 3], Option<Stopped>), PetscError> {
        self.matrix.multiply(&self.p, &mut self.q)?;
        let (p, q, r) = (&self.p, &self.q, &self.r);
        let here = p.read(|p| q.read(|q| r.read(|r| [dot(p, q), dot(r, q), dot(q, q)])))???;
        let [pq, rq, qq] = here;
        let mut sums = [pq, rq, qq, 0.0, 0.0];
        if stop.deadline.is_some() || stop.interrupt.is_some() {
            let interrupt = self.limits.interrupt.as_ref();
            sums[3] = f64::from(u8::from(
                interrupt.is_some_and(|flag| flag.load(Ordering::Relaxed)),
            ));
            // Clocks differ: that of rank 0 counts.
            let is_late = self
                .limits
                .deadline
                .is_some_and(|end| Instant::now() >= end);
            sums[4] = f64::from(u8::from(self.group.rank() == 0 && is_late));
        }
        self.ranks.sum(&mut sums);
        let stopped = match sums {
            [.., interrupts, _] if interrupts > 0.0 => Some(Stopped::Interrupted),
            [.., late] if late > 0.0 => Some(Stopped::TimeLimit),
            _ => None,
        };
        let [pq, rq, qq, ..] = sums;
        Ok(([pq, rq, qq], stopped))
    }

    /// CG for K x = b from `x`, where `r` is b − K x; both with an entry per unknown of this rank, and `rr` is ‖r‖² over all ranks.
    /// The result so far is in x, even after a failure. The steps and decisions are those of `stiffness::pcg`, checked after each
    /// iteration.
    fn run(
        &mut self,
        r: &[f64],
        rr: f64,
        x: &mut [f64],
        goals: Run,
        stop: &Stop,
    ) -> Result<Correction, DualError> {
        self.counts.solves += 1;
        self.r.write(|to| to.copy_from_slice(r))?;
        self.x.write(|to| to.copy_from_slice(x))?;
        let mut state = State::started(rr, goals);
        let outcome = self.iterate(&mut state, stop);
        self.x.read(|from| x.copy_from_slice(from))?;
        let progress = state.progress();
        self.counts.iterations += progress.iterations;
        outcome?;
        if goals.remaining > 0.0 || goals.remaining_part > 0.0 {
            self.falls.learn(&progress);
        }
        Ok(self.falls.followed(&progress, 1.0))
    }

    /// Iterates until a goal is reached.
    fn iterate(&mut self, state: &mut State, stop: &Stop) -> Result<(), DualError> {
        let mut watch = Watch::new(f64::EPSILON / 2.0);
        let limit = most_iterations(self.n);
        let mut first_energy = None;
        // ‖r‖² where it was last added up.
        let mut summed = state.progress().rr;
        while !state.progress().done {
            let rz = self.precondition()?;
            let beta = state.turned(rz);
            let (p, z) = (&mut self.p, &self.z);
            z.read(|z| {
                p.write(|p| {
                    for (p, z) in p.iter_mut().zip(z) {
                        *p = z + beta.map_or(0.0, |beta| beta * *p);
                    }
                })
            })??;
            let rr = state.progress().rr;
            let ([curvature, rq, qq], stopped) = self.multiply(stop)?;
            if let Some(stopped) = stopped {
                return Err(DualError::Stopped(stopped));
            }
            state.curves(curvature);
            let Some(alpha) = state.step() else {
                return Err(PcgError::NotPositiveDefinite.into());
            };
            let (p, q) = (&self.p, &self.q);
            p.read(|p| self.x.write(|x| add_times(alpha, p, x)))??;
            q.read(|q| self.r.write(|r| add_times(-alpha, q, r)))??;
            let mut rr = rr - alpha * (2.0 * rq - alpha * qq);
            if !(rr > FAITHFUL * summed) {
                let here = self.r.read(|r| dot(r, r))?;
                rr = self.sum(here);
                summed = rr;
            }
            state.stepped(rr);
            let progress = state.progress();
            let first_energy = *first_energy.get_or_insert(progress.energy);
            if progress.energy > ENERGY_GROWTH * first_energy || !progress.rr.is_finite() {
                return Err(PcgError::NotPositiveDefinite.into());
            }
            let grown = progress.rr > GROWTH * progress.rr_start;
            let issued = progress.iterations;
            if !progress.done && (watch.gets_nowhere(issued, &progress) || issued >= limit || grown)
            {
                return Err(DualError::Pcg(PcgError::Stalled {
                    reached: (progress.rr / progress.rr_start).sqrt(),
                    asked: (progress.goal / progress.rr_start).sqrt(),
                    iterations: issued,
                }));
            }
        }
        Ok(())
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
        self.x.write(|x| x.copy_from_slice(&u))?;
        self.matrix.multiply(&self.x, &mut self.q)?;
        let inner = self.q.read(<[f64]>::to_vec)?;
        let mut r = difference(&self.load, &contact);
        add_times(-1.0, &inner, &mut r);
        let mut sums = [dot(&r, &r), dot(&contact, &contact)];
        self.ranks.sum(&mut sums);
        let [rr, contact] = sums;
        let terms = self.load_norm.max(contact.sqrt());
        if terms == 0.0 {
            // The error that CG leaves in a vanishing u would have to shrink for ever.
            u.fill(0.0);
            self.u = u;
            y.fill(0.0);
            return Ok(Correction::default());
        }
        let run = match accuracy {
            Accuracy::Residual(residual) => Run {
                residual,
                ..Run::default()
            },
            accuracy => Run {
                // Forces that cancel leave rounding: without a floor the residual of a u that follows λ would have to
                // shrink from step to step.
                residual: UNREACHABLE * terms,
                ..self.falls.run_to(accuracy, 1.0)
            },
        };
        let outcome = self.run(&r, rr, &mut u, run, stop);
        self.u = u;
        self.seen(&self.u, y);
        outcome
    }

    /// The place of the column with this number among own blocks and those of others.
    fn place(&self, column: u64) -> usize {
        let (block, part) = (column / self.block as u64, column as usize % self.block);
        let own = self.u.len() / self.block;
        let place = match block.checked_sub(self.first) {
            Some(here) if (here as usize) < own => here as usize,
            _ => {
                let found = self.places.partition_point(|&(number, _)| number < block);
                self.places[found].1 as usize
            }
        };
        self.block * place + part
    }

    /// Own values with those of others that rows of K reach.
    fn with_others(&mut self, own: &[f64]) -> Result<Vec<f64>, PetscError> {
        let mut all = own.to_vec();
        all.resize(own.len() + self.block * self.places.len(), 0.0);
        self.ghosts.update(&mut all)?;
        Ok(all)
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
        product.fill(0.0);
        let run = self.falls.run_to(accuracy, 1.0);
        let rr = self.sum(dot(&forces, &forces));
        let outcome = self.run(&forces, rr, &mut product, run, stop);
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
            if self.sum(held.sum()).sqrt() <= residual {
                break;
            }
            asked *= 0.1;
        }
        Ok(self.u.clone())
    }

    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        let (u, s) = (self.with_others(u)?, self.with_others(s)?);
        let mut made = [vec![0.0; self.u.len()], vec![0.0; self.u.len()]];
        self.matrix.for_rows(|row, columns, values| {
            for (&column, value) in columns.iter().zip(values) {
                let place = self.place(column as u64);
                made[0][row] += value * u[place];
                made[1][row] += value.abs() * s[place];
            }
        })?;
        for &(i, tie) in &self.ties {
            let i = i as usize;
            made[0][i] -= tie * u[i];
            made[1][i] -= tie * s[i];
        }
        Ok(made)
    }

    fn linear_iterations(&mut self, tolerance: f64) -> Result<Option<usize>, DualError> {
        let (before, load) = (self.counts, Arc::clone(&self.load));
        let mut x = vec![0.0; load.len()];
        let run = Run {
            residual_part: tolerance,
            ..Run::default()
        };
        let rr = self.load_norm.powi(2);
        self.run(&load, rr, &mut x, run, &Stop::default())?;
        let iterations = self.counts.iterations - before.iterations;
        self.counts = before;
        Ok(Some(iterations))
    }

    fn costs(&self) -> Option<Costs> {
        Some(Costs {
            solves: self.counts,
            ..Costs::default()
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
