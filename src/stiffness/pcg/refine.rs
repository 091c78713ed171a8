//! Solves to f64 by corrections in the arithmetic of the backend.

use super::{Pcg, PcgError, UNREACHABLE};
use crate::backend::Backend;
use crate::control::{Accuracy, Correction, Stop};

/// The largest factor by which a correction in f32 should reduce the residual: beyond it the recurrence drifts away
/// from the true residual.
const CORRECTION: f64 = 1e-4;
/// The smallest such factor, however little the correction before has achieved.
const LEAST_CORRECTION: f64 = 0.05;
/// A relative residual in f64 below which a lack of progress is due to rounding.
const AT_ROUNDING: f64 = 1e-8;
/// Corrections that must not fail to halve the residual.
const MAX_CORRECTIONS: usize = 60;
/// The relative error in energy that rounding leaves of a correction in f32, before the first has measured it.
pub(super) const ROUNDING: f64 = 0.1;

impl<B: Backend> Pcg<B> {
    /// Lowers the error of x in K x = b by CG in low precision inside f64. `terms` is the norm of the terms whose
    /// difference is b, the scale of residuals. If it stalls, x has its result so far. (One function: a loop of
    /// corrections, each as accurate as the earlier ones show to be necessary.)
    pub(crate) fn refine(
        &mut self,
        b: &[f64],
        terms: f64,
        x: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<Correction, PcgError> {
        self.counts.solves += 1;
        let start = self.counts.iterations;
        let mut correction = vec![0.0; b.len()];
        let mut residual = b.to_vec();
        if self.backend.norm(x) != 0.0 {
            self.k.subtract_product(x, &mut residual);
        }
        let goal = match accuracy {
            Accuracy::Residual(tolerance) => tolerance * terms,
            // As far as f64 allows.
            Accuracy::Energy { .. } => UNREACHABLE * terms,
        };
        let mut asked = CORRECTION;
        // Of eᵀKe: the sum of all corrections, the last correction, and the part left on purpose.
        let (mut energy, mut last, mut truncated) = (0.0, f64::INFINITY, 0.0);
        let mut length = self.backend.norm(&residual);
        for _ in 0..MAX_CORRECTIONS {
            if length <= goal {
                return Ok(self.refined(energy, 0.0));
            }
            let target = match accuracy {
                Accuracy::Residual(_) => 0.0,
                Accuracy::Energy { absolute, relative } => {
                    absolute * absolute + relative * relative * energy
                }
            };
            let run = match accuracy {
                Accuracy::Residual(_) => Accuracy::Residual((0.5 * goal / length).max(asked)),
                Accuracy::Energy { relative, .. } => Accuracy::Energy {
                    absolute: target.sqrt(),
                    relative: relative.max(CORRECTION),
                },
            };
            let made = self.correct(&residual, length, run, stop, &mut correction)?;
            x.iter_mut().zip(&correction).for_each(|(x, c)| *x += c);
            let gained = made.change.powi(2);
            energy += gained;
            // A short run may lower the energy error and not the residual.
            let mut advances = true;
            if let Accuracy::Energy { relative, .. } = accuracy {
                if last.is_finite() {
                    // The remainder of the correction before is visible now: any excess over its goal is rounding.
                    let rounded = (gained - truncated).max(0.0) / last;
                    self.rounding = rounded.sqrt().clamp(CORRECTION, LEAST_CORRECTION.sqrt());
                }
                advances = gained > 0.0 && gained <= 0.25 * last;
                truncated = made.remaining.powi(2);
                let rounded = gained * self.rounding.powi(2);
                let enough = rounded <= target.max(relative * relative * energy);
                // Written so that NaN does not suffice. If rounding prevents progress, the caller has to accept the
                // present accuracy.
                if gained > 0.0 && (enough || !advances && gained <= last) {
                    return Ok(self.refined(energy, truncated + rounded));
                }
            }
            last = gained;
            residual.copy_from_slice(b);
            self.k.subtract_product(x, &mut residual);
            let before = std::mem::replace(&mut length, self.backend.norm(&residual));
            let achieved = length / before;
            if let Accuracy::Residual(_) = accuracy {
                advances = achieved <= 0.5;
            }
            if !advances {
                break;
            }
            // On fine meshes rounding K to f32 costs more than the recurrence knows: requesting more than the last
            // correction has achieved would be wasted.
            asked = (0.5 * achieved).clamp(CORRECTION, LEAST_CORRECTION);
        }
        // Accuracy beyond f64 is not requested again: the final check decides whether it suffices.
        if length <= goal.max(AT_ROUNDING * terms) {
            return Ok(self.refined(energy, 0.0));
        }
        let asked = match accuracy {
            Accuracy::Residual(tolerance) => tolerance,
            Accuracy::Energy { relative, .. } => relative,
        };
        Err(PcgError::Stalled {
            reached: length / terms,
            asked,
            iterations: self.counts.iterations - start,
        })
    }

    /// The change of eᵀKe by corrections and the remainder.
    fn refined(&self, energy: f64, left: f64) -> Correction {
        Correction {
            change: energy.sqrt(),
            remaining: left.sqrt(),
            slow: self.falls.is_slow(),
        }
    }

    /// A correction in low precision for a residual of norm `length`; returns its effect.
    fn correct(
        &mut self,
        residual: &[f64],
        length: f64,
        accuracy: Accuracy,
        stop: &Stop,
        correction: &mut [f64],
    ) -> Result<Correction, PcgError> {
        let factor = self.load(residual, length);
        let unit = factor / self.scale;
        let run = self.run_to(accuracy, unit);
        let made = match self.run(run, stop, None) {
            Ok(progress) => self.followed(&progress, unit),
            // In f32 a breakdown may be due to rounding, and so may a lack of progress: the residual in f64 decides.
            Err(PcgError::NotPositiveDefinite | PcgError::Stalled { .. }) => Correction::default(),
            Err(error) => return Err(error),
        };
        self.backend.download(&self.x, correction)?;
        correction.iter_mut().for_each(|c| *c *= factor);
        Ok(made)
    }
}
