//! x ≈ K⁻¹b by preconditioned conjugate gradients, written once for all backends.
//!
//! On a backend that computes in f64, CG runs on the system itself. On one that has f32 only, CG in f32 makes
//! corrections inside a refinement in f64. The host makes the residual b − Kx in f64 against the true K, so that the
//! answer is as accurate as that of the other path, whatever f32 has lost.

use super::amg::{AmgError, AmgSettings, Hierarchy, Multigrid};
use crate::backend::{Backend, BackendError, Progress, Run};
use crate::control::{Accuracy, Correction, Costs, SolveCounts, Stop, Stopped};
use crate::problem::Vertices;
use crate::sparse::BlockCsr;
use crate::sparse::stored::{SquareBlocks, power_of_two_below};
use std::sync::Arc;

mod energy;
mod kept;
mod refine;

pub(crate) use energy::Falls;
use kept::{Wear, turned};

/// The reason why K x = b was not solved.
#[derive(Clone, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PcgError {
    /// The backend cannot, or has failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// A direction without stiffness.
    #[error(
        "the stiffness matrix is singular, or not positive definite: conjugate gradients met a direction without \
         stiffness; a part of a body has no stiffness or hangs on a hinge: check that its parts are connected by more \
         than a point. Bodies that can move as a whole need supports, or coordinates that define their rigid-body \
         motions"
    )]
    NotPositiveDefinite,
    /// The multigrid hierarchy could not be made.
    #[error(transparent)]
    Hierarchy(#[from] AmgError),
    /// No progress any more.
    #[error(
        "conjugate gradients stopped at a relative residual of {reached:.1e} instead of {asked:.0e} after \
         {iterations} iterations; the stiffness matrix is singular or too badly conditioned: look for a \
         body without supports, slivers, or extreme ratios of the moduli"
    )]
    Stalled {
        /// ‖r‖/‖b‖ at the end.
        reached: f64,
        /// ‖r‖/‖b‖ to reach.
        asked: f64,
        /// Iterations made.
        iterations: usize,
    },
    /// Not an error of the problem: somebody asked to stop.
    #[error("{0}")]
    Stopped(Stopped),
}

impl PcgError {
    /// Whether the matrix is known to be singular or indefinite.
    pub(crate) fn is_indefinite(&self) -> bool {
        use AmgError::{NotPositiveDefinite, Singular};
        match self {
            Self::NotPositiveDefinite | Self::Stalled { .. } => true,
            Self::Hierarchy(error) => matches!(error, NotPositiveDefinite { .. } | Singular),
            Self::Backend(_) | Self::Stopped(_) => false,
        }
    }
}

/// Iterations between two looks at the progress at most, or an eighth of those made: a K that is singular up to rounding shows itself
/// by a residual that grows in between.
const CHUNK: usize = 16;
/// At most this many, so that a request to stop is answered soon.
const MAX_CHUNK: usize = 256;

/// A relative residual that is out of reach because of rounding.
pub(crate) const UNREACHABLE: f64 = 1e-15;

/// ‖r‖² never grows by this factor unless K is singular and the right-hand side has a part that no x can
/// meet.
pub(crate) const GROWTH: f64 = 1e14;
/// The energy of all iterations never exceeds that of the first ones by this factor unless K is singular up to
/// rounding. The ratio is at most its condition, scaled to a unit diagonal.
pub(crate) const ENERGY_GROWTH: f64 = 1e12;
/// A run counts as stalled only after this many iterations.
const LEAST_ITERATIONS: usize = 300;

/// How K⁻¹ is approximated inside CG.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Preconditioner {
    /// Smoothed-aggregation multigrid: iterations hardly depend on the mesh. Where it does not fit, block-Jacobi.
    #[default]
    Multigrid,
    /// The inverse of the blocks of the nodes on the diagonal: cheap to set up, but iterations grow with the width of
    /// the mesh in nodes.
    BlockJacobi,
}

/// K on a backend with its preconditioner and the vectors of CG.
pub struct Pcg<B: Backend> {
    pub(crate) backend: B,
    k: Arc<dyn SquareBlocks>,
    matrix: B::Matrix,
    /// The matrix on the backend is this times K.
    pub(crate) scale: f64,
    preconditioner: Multigrid<B>,
    /// The levels of multigrid, for a log; None for block-Jacobi.
    pub hierarchy: Option<String>,
    /// The reason why it is block-Jacobi although multigrid was requested.
    pub fallback: Option<String>,
    pub(crate) x: B::Vector,
    pub(crate) r: B::Vector,
    p: B::Vector,
    q: B::Vector,
    state: B::State,
    /// The logarithm of the factor by which an iteration of the last run reduced the residual: it predicts the
    /// iterations of the next run.
    rate: f64,
    /// How α rᵀz falls from iteration to iteration.
    falls: Falls,
    /// Iterations of the last two runs of each [`kind`].
    last: [[usize; 2]; 3],
    /// The points of this K, and what makes its preconditioner, where that of an earlier one is kept.
    renewal: Option<(Vec<f64>, Renewal<B>)>,
    /// The points of the K of the preconditioner, one number after the other.
    points: Vec<f64>,
    /// The iterations that were lost because that K is an earlier one.
    wear: Wear,
    /// The relative error in energy that rounding leaves of a correction in low precision.
    rounding: f64,
    /// The costs.
    pub counts: SolveCounts,
}

/// The measures of a run's progress.
pub(crate) struct Watch {
    /// The factor by which the energy has to grow to be noticeable.
    noticeable: f64,
    /// The smallest ‖r‖² at any look.
    least_rr: f64,
    /// The progress at the last close look: iterations, `least_rr` and energy.
    milestone: Option<(usize, f64, f64)>,
}

impl Watch {
    /// For arithmetic with this rounding error.
    pub fn new(unit_roundoff: f64) -> Self {
        Self {
            // More than the rounding in the sum of energies.
            noticeable: 1.0 + 64.0 * unit_roundoff,
            least_rr: f64::INFINITY,
            milestone: None,
        }
    }

    /// Twice the iterations must bring something: half of the residual or some energy. The energy alone grows for long
    /// where the residual goes up and down, the residual alone falls where the energy is nearly complete.
    pub fn gets_nowhere(&mut self, issued: usize, progress: &Progress) -> bool {
        self.least_rr = self.least_rr.min(progress.rr);
        let due = self
            .milestone
            .map_or(LEAST_ITERATIONS, |(then, ..)| 2 * then);
        let so_far = match self.milestone {
            None => 2 * issued,
            Some(_) => issued,
        };
        if so_far < due {
            return false;
        }
        let here = (issued, self.least_rr, progress.energy);
        self.milestone.replace(here).is_some_and(|(_, rr, energy)| {
            !(self.least_rr <= 0.25 * rr) && !(progress.energy > self.noticeable * energy)
        })
    }
}

/// The iterations left to a run if its residual goes on to fall as it has so far, at least one; None if it has not fallen.
fn iterations_left(goals: &Run, progress: &Progress) -> Option<usize> {
    // Of squares, as the residual and the energy here.
    let fall = (progress.rr_start / progress.rr).ln() / progress.iterations as f64;
    let remaining = progress.remaining(goals.to_come);
    let goal = goals.remaining + goals.remaining_part * progress.energy;
    let above = (progress.rr / progress.goal).min(remaining / goal);
    let left = (above.ln() / fall).ceil();
    (fall > 0.0 && left.is_finite()).then_some(left.max(1.0) as usize)
}

/// The iterations that suffice for so many unknowns, with rounding: in exact arithmetic one for each.
pub(crate) fn most_iterations(n: usize) -> usize {
    1000 + 30 * n
}

/// Runs are to an energy from zero, to one from a given x, or to a residual.
fn kind(goals: &Run) -> usize {
    match goals.remaining > 0.0 || goals.remaining_part > 0.0 {
        true => usize::from(goals.continues),
        false => 2,
    }
}

/// Makes a preconditioner.
pub(crate) type Renewal<B> =
    Box<dyn FnOnce(&mut B, &mut Multigrid<B>) -> Result<(), PcgError> + Send>;

/// The numbers of points, if they are known.
fn flat<const D: usize>(points: Option<&[[f64; D]]>) -> Vec<f64> {
    points.unwrap_or_default().as_flattened().to_vec()
}

/// A short product y = M x to bring to the host.
pub(crate) struct Gather<'a, B: Backend> {
    pub rows: &'a B::Rows,
    pub y: &'a mut B::Vector,
    pub out: &'a mut [f64],
}

/// A preconditioner on a backend, its levels as a table, and whether a single α rᵀz is reliable before a run has shown
/// how fast they fall.
type Made<B> = (Multigrid<B>, Option<String>, bool);

fn on_backend<B: Backend>(
    backend: &mut B,
    hierarchy: Hierarchy<B::Stored>,
) -> Result<Made<B>, PcgError> {
    let table = hierarchy.is_multigrid().then(|| hierarchy.to_string());
    let fast = hierarchy.has_rotations();
    Ok((Multigrid::new(backend, hierarchy)?, table, fast))
}

impl<B: Backend> Pcg<B> {
    /// Moves K to the backend and sets up the preconditioner; `coordinates` has a point per node
    /// (without, multigrid has no rotations to work with and needs more iterations).
    pub fn new<const D: usize>(
        backend: B,
        k: &Arc<BlockCsr<D>>,
        coordinates: Option<&[[f64; D]]>,
        preconditioner: Preconditioner,
    ) -> Result<Self, PcgError> {
        Self::of_second_order(backend, k, coordinates, None, preconditioner)
    }

    /// Like [`Pcg::new`], for elements of second order with these corners, if there are any.
    pub fn of_second_order<const D: usize>(
        backend: B,
        k: &Arc<BlockCsr<D>>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
        preconditioner: Preconditioner,
    ) -> Result<Self, PcgError> {
        let make = |backend: &mut B| {
            let mut fallback = None;
            if preconditioner == Preconditioner::Multigrid {
                let settings = AmgSettings::of_dimension(D);
                let made = Hierarchy::of_second_order(k, coordinates, vertices, &settings)
                    .map_err(PcgError::from)
                    .and_then(|hierarchy| on_backend(backend, hierarchy));
                match made {
                    Err(
                        error @ (PcgError::Hierarchy(AmgError::TooLarge)
                        | PcgError::Backend(BackendError::TooLarge { .. })),
                    ) => fallback = Some(error.to_string()),
                    made => return Ok((made?, None)),
                }
            }
            Ok((on_backend(backend, Hierarchy::block_jacobi(k)?)?, fallback))
        };
        Self::set_up(backend, Arc::clone(k) as _, flat(coordinates), make)
    }

    /// As [`Pcg::new`], with a hierarchy made before.
    pub fn with_hierarchy(
        backend: B,
        k: Arc<dyn SquareBlocks>,
        hierarchy: Hierarchy<B::Stored>,
    ) -> Result<Self, PcgError> {
        Self::set_up(backend, k, Vec::new(), |backend| {
            Ok((on_backend(backend, hierarchy)?, None))
        })
    }

    /// With a preconditioner, and the reason if it is not the requested one.
    fn set_up(
        mut backend: B,
        k: Arc<dyn SquareBlocks>,
        points: Vec<f64>,
        make: impl FnOnce(&mut B) -> Result<(Made<B>, Option<String>), PcgError>,
    ) -> Result<Self, PcgError> {
        // Indispensable data come first: multigrid takes the rest.
        let (matrix, scale) = backend.matrix(Arc::clone(&k))?;
        let mut vector = || backend.vector(k.n_rows());
        let [x, r, p, q] = [vector()?, vector()?, vector()?, vector()?];
        let state = backend.state(&matrix, &x)?;
        let ((preconditioner, hierarchy, fast), fallback) = make(&mut backend)?;
        let falls = Falls::new(fast, hierarchy.is_some());
        Ok(Self {
            backend,
            k,
            matrix,
            scale,
            preconditioner,
            hierarchy,
            fallback,
            x,
            r,
            p,
            q,
            state,
            rate: 1.0,
            falls,
            last: Default::default(),
            renewal: None,
            wear: Wear::default(),
            points,
            rounding: refine::ROUNDING,
            counts: SolveCounts {
                set_ups: 1,
                ..SolveCounts::default()
            },
        })
    }

    /// Takes another K of the same pattern: the preconditioner keeps its structure, which may be worse if K has changed much.
    /// After an error nothing can be solved.
    pub fn update<const D: usize>(
        &mut self,
        k: &Arc<BlockCsr<D>>,
        coordinates: Option<&[[f64; D]]>,
        vertices: Option<&Vertices<D>>,
    ) -> Result<(), PcgError> {
        self.replace(k, flat(coordinates), |backend, preconditioner| {
            preconditioner.rebuild::<D, PcgError>(backend, k, coordinates, vertices)
        })
    }

    /// The same with the preconditioner of an earlier K, until conjugate gradients have lost as many iterations with it as a new one
    /// costs; then `renewal` makes that. It is made at once where the earlier one, or both K, do not fit.
    pub(crate) fn follow<const D: usize>(
        &mut self,
        k: &Arc<BlockCsr<D>>,
        coordinates: Option<&[[f64; D]]>,
        renewal: Renewal<B>,
    ) -> Result<(), PcgError> {
        if self.preconditioner.fits(k) {
            match self.keep(k, coordinates) {
                Ok(()) => {
                    self.renewal = Some((flat(coordinates), renewal));
                    return Ok(());
                }
                Err(PcgError::Backend(BackendError::TooLarge { .. })) => {}
                failed => return failed,
            }
        }
        self.replace(k, flat(coordinates), renewal)
    }

    /// Takes another K and makes its preconditioner: two hierarchies may not fit.
    fn replace<const D: usize>(
        &mut self,
        k: &Arc<BlockCsr<D>>,
        points: Vec<f64>,
        renewal: impl FnOnce(&mut B, &mut Multigrid<B>) -> Result<(), PcgError>,
    ) -> Result<(), PcgError> {
        self.preconditioner.clear();
        self.take(k)?;
        self.renew(points, renewal)
    }

    /// Takes another K and turns the preconditioner.
    fn keep<const D: usize>(
        &mut self,
        k: &Arc<BlockCsr<D>>,
        coordinates: Option<&[[f64; D]]>,
    ) -> Result<(), PcgError> {
        self.take(k)?;
        let known = coordinates.filter(|now| D * now.len() == self.points.len());
        let turned = known.and_then(|now| turned(k, &self.points, now));
        self.preconditioner.turn(&mut self.backend, turned)?;
        self.wear.begin();
        self.falls.doubt();
        Ok(())
    }

    /// Puts a K in the place of the one before.
    fn take<const D: usize>(&mut self, k: &Arc<BlockCsr<D>>) -> Result<(), PcgError> {
        self.renewal = None;
        self.k = Arc::clone(k) as _;
        (self.matrix, self.scale) = self.backend.matrix(Arc::clone(&self.k))?;
        self.state = self.backend.state(&self.matrix, &self.x)?;
        self.rounding = refine::ROUNDING;
        self.forget_speed();
        Ok(())
    }

    /// Measurements of earlier runs belong to the K, or the preconditioner, before.
    fn forget_speed(&mut self) {
        (self.rate, self.last) = (1.0, Default::default());
    }

    /// Makes the preconditioner of the present K.
    fn renew(
        &mut self,
        points: Vec<f64>,
        renewal: impl FnOnce(&mut B, &mut Multigrid<B>) -> Result<(), PcgError>,
    ) -> Result<(), PcgError> {
        self.points = points;
        self.wear = Wear::default();
        self.forget_speed();
        self.falls.forget();
        self.counts.set_ups += 1;
        renewal(&mut self.backend, &mut self.preconditioner)
    }

    /// Makes the preconditioner of the present K if that of an earlier one is kept, and worn.
    fn renew_if(&mut self, worn: bool) -> Result<(), PcgError> {
        match self.renewal.take_if(|_| worn) {
            Some((points, renewal)) => self.renew(points, renewal),
            None => Ok(()),
        }
    }

    /// What it has done, and its backend.
    pub(crate) fn costs(&self) -> Costs {
        Costs {
            solves: self.counts,
            device: self.backend.counters(),
        }
    }

    /// Whether the backend's own arithmetic suffices for an f64 answer.
    pub fn is_f64(&self) -> bool {
        self.backend.unit_roundoff() < 1e-12
    }

    /// x ≈ K⁻¹b with ‖b − Kx‖ ≤ `tolerance` ‖b‖, or as close as rounding allows; both of length n. If it stalls, x has
    /// its result so far.
    pub fn solve(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
        stop: &Stop,
    ) -> Result<(), PcgError> {
        let length = self.backend.norm(b);
        if !self.is_f64() {
            x.fill(0.0);
            self.refine(b, length, x, Accuracy::Residual(tolerance), stop)?;
            return Ok(());
        }
        self.counts.solves += 1;
        let factor = self.load(b, length);
        let run = Run {
            residual_part: tolerance,
            ..Run::default()
        };
        let outcome = self.run(run, stop, None);
        if let Ok(_) | Err(PcgError::Stalled { .. }) = outcome {
            self.backend.download(&self.x, x)?;
            x.iter_mut().for_each(|v| *v *= factor);
        }
        outcome.map(|_| ())
    }

    /// Passes the right-hand side b of norm `length` to CG; returns the factor for the solution.
    ///
    /// Powers of two bring b near one, within the range of f32, and change no digit.
    fn load(&mut self, b: &[f64], length: f64) -> f64 {
        let unit = power_of_two_below(length);
        let scaled: Vec<f64> = b.iter().map(|v| v / unit).collect();
        self.backend.upload(&scaled, &mut self.r);
        unit * self.scale
    }

    /// The run that solves a system to an accuracy, for a right-hand side that was divided by `unit`.
    pub(crate) fn run_to(&self, accuracy: Accuracy, unit: f64) -> Run {
        self.falls.run_to(accuracy, self.energy_unit(unit))
    }

    /// The factor for the energy on the backend if the right-hand side was divided by `unit`.
    fn energy_unit(&self, unit: f64) -> f64 {
        unit * unit * self.scale
    }

    /// The change of x by a run and the remaining error, for a right-hand side that was divided by `unit`.
    pub(crate) fn followed(&self, progress: &Progress, unit: f64) -> Correction {
        self.falls.followed(progress, self.energy_unit(unit))
    }

    /// r −= K x.
    pub(crate) fn subtract_product(&mut self, x: &B::Vector) {
        self.backend.subtract_product(&self.matrix, x, &mut self.r);
    }

    /// CG for the right-hand side in `r`; the result is in `x`, even after a stall.
    ///
    /// With `gather`, y = M x comes along with each look at the progress.
    pub(crate) fn run(
        &mut self,
        goals: Run,
        stop: &Stop,
        mut gather: Option<Gather<B>>,
    ) -> Result<Progress, PcgError> {
        self.renew_if(self.wear.lost() > self.backend.cost_of_hierarchy() as f64)?;
        let kind = kind(&goals);
        let first = self.run_until_worn(goals, kind, stop, &mut gather)?;
        if first.done {
            return Ok(first);
        }
        self.renew_if(true)?;
        match self.run_until_worn(goals.after(&first), kind, stop, &mut gather) {
            Ok(rest) => Ok(Progress {
                iterations: first.iterations + rest.iterations,
                rr_start: first.rr_start,
                energy: first.energy + rest.energy,
                ..rest
            }),
            Err(PcgError::Stalled {
                reached,
                asked,
                iterations,
            }) => {
                let part = (first.rr / first.rr_start).sqrt();
                Err(PcgError::Stalled {
                    reached: part * reached,
                    asked: part * asked,
                    iterations: first.iterations + iterations,
                })
            }
            failed => failed,
        }
    }

    /// The same until it is done, or the preconditioner of an earlier K has become too slow. (One function: the last looks decide
    /// where a run stops, and nothing else needs them.)
    fn run_until_worn(
        &mut self,
        goals: Run,
        kind: usize,
        stop: &Stop,
        gather: &mut Option<Gather<B>>,
    ) -> Result<Progress, PcgError> {
        if self.preconditioner.is_missing() {
            // It could not be made.
            return Err(AmgError::Singular.into());
        }
        let Self {
            backend,
            matrix,
            preconditioner,
            x,
            r,
            p,
            q,
            state,
            ..
        } = self;
        // A run without progress ends before.
        let limit = most_iterations(self.k.n_all_rows());
        let mut watch = Watch::new(backend.unit_roundoff());
        let mut first_energy = None;
        backend.start(r, x, preconditioner.r(), state, goals);
        preconditioner.cycle(backend, state)?;
        backend.direction(r, preconditioner.z(), p, state);
        let to_energy = goals.remaining > 0.0 || goals.remaining_part > 0.0;
        let predicted = if to_energy || goals.residual > 0.0 {
            // An iteration without effect costs more than a look.
            self.last[kind][0].min(self.last[kind][1])
        } else {
            (-(goals.residual_part.max(1e-16)).ln() / self.rate).ceil() as usize
        };
        let mut chunk = predicted.clamp(1, MAX_CHUNK);
        let mut issued = 0;
        loop {
            for _ in 0..chunk {
                if backend.is_over(state) {
                    break;
                }
                backend.multiply(matrix, p, q, state);
                backend.step(p, q, x, r, preconditioner.r(), state);
                preconditioner.cycle(backend, state)?;
                backend.direction(r, preconditioner.z(), p, state);
                issued += 1;
                self.counts.issued += 1;
            }
            let progress = match gather {
                Some(Gather { rows, y, out }) => {
                    backend.multiply_rows(rows, x, y);
                    backend.progress(state, Some((y, out)))?
                }
                None => backend.progress(state, None)?,
            };
            let first_energy = *first_energy.get_or_insert(progress.energy);
            // Rounding may have given a free motion some stiffness: then x has moved far along it.
            let free = progress.energy > ENERGY_GROWTH * first_energy;
            // A device may not see that its numbers are not finite: shaders may assume that they are.
            let lost = !progress.rr.is_finite();
            if progress.done || free || lost {
                self.counts.iterations += progress.iterations;
                self.last[kind] = [progress.iterations, self.last[kind][0]];
                if to_energy {
                    self.falls.learn(&progress);
                } else if progress.iterations > 0 {
                    let reached = 0.5 * (progress.rr / progress.rr_start).ln();
                    self.rate = (-reached / progress.iterations as f64).clamp(1e-4, 10.0);
                }
                self.wear.learn(kind, &progress);
                if progress.broken || free || lost {
                    return Err(PcgError::NotPositiveDefinite);
                }
                return Ok(progress);
            }
            if let Some(stopped) = stop.now() {
                self.counts.iterations += progress.iterations;
                return Err(PcgError::Stopped(stopped));
            }
            // A residual that grows without end belongs to a singular matrix.
            let grown = progress.rr > GROWTH * progress.rr_start;
            let stalls = watch.gets_nowhere(issued, &progress) || issued >= limit;
            let is_worn = || {
                let cost = backend.cost_of_hierarchy() as f64;
                stalls || self.wear.lost_with(kind, &progress) > cost
            };
            if !grown && self.renewal.is_some() && is_worn() {
                self.counts.iterations += progress.iterations;
                return Ok(progress);
            }
            if stalls || grown {
                self.counts.iterations += progress.iterations;
                return Err(PcgError::Stalled {
                    reached: (progress.rr / progress.rr_start).sqrt(),
                    asked: (progress.goal / progress.rr_start).sqrt(),
                    iterations: progress.iterations,
                });
            }
            // The first iterations say little about later ones.
            let most = (2 * issued).min((issued / 8).max(CHUNK)).min(MAX_CHUNK);
            chunk = match (
                predicted.saturating_sub(issued),
                iterations_left(&goals, &progress),
            ) {
                (0, None) => issued.min(most),
                (0, Some(left)) => left.clamp((issued / 8).clamp(1, most), most),
                (predicted, _) => predicted.min(most),
            };
        }
    }
}

#[cfg(test)]
mod tests;
