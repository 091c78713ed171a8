//! The decrease of the energy error from iteration to iteration, for accuracy in energy.

use super::UNREACHABLE;
use crate::backend::{Progress, Run};
use crate::control::{Accuracy, Correction};

/// The factor by which α rᵀz falls in an iteration of multigrid, before the first run has measured it, and the range of
/// credible values.
const FALL: f64 = 0.25;
const FALLS: (f64, f64) = (0.02, 0.98);

/// How α rᵀz falls under a preconditioner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Falls {
    /// The factor per iteration.
    fall: f64,
    /// The preconditioner knows all smooth errors.
    fast: bool,
    /// Whether runs predict the speed of later ones: not with block-Jacobi, where the first terms may fall quickly and later ones
    /// slowly.
    learns: bool,
}

impl Falls {
    /// Before the first run.
    pub fn new(fast: bool, learns: bool) -> Self {
        Self {
            fall: if fast { FALL } else { FALLS.1 },
            fast,
            learns,
        }
    }

    /// As before the first run.
    pub fn forget(&mut self) {
        *self = Self::new(self.fast, self.learns);
    }

    /// With a preconditioner that may have become slower.
    pub fn doubt(&mut self) {
        self.fall = self.fall.max(Self::new(self.fast, self.learns).fall);
    }

    /// Whether an iteration leaves half of the energy error and more, or is known to leave smooth errors.
    pub fn is_slow(&self) -> bool {
        !self.fast || self.fall >= 0.5
    }

    /// The sum of all decreases of the energy to come, relative to the last one: a geometric series.
    fn to_come(self) -> f64 {
        self.fall / (1.0 - self.fall)
    }

    /// Learns how fast the energy error falls from a run that has ended.
    pub fn learn(&mut self, progress: &Progress) {
        if !self.learns || progress.iterations < 2 || !(progress.energy > 0.0) {
            return;
        }
        // The first decreases, as many as the last ones, are nearly all of the energy.
        let between = progress.iterations - progress.recent_terms;
        let fall = (progress.recent / progress.energy)
            .powf(1.0 / between as f64)
            .clamp(FALLS.0, FALLS.1);
        // It may slow down at once, but a single fast run does not count.
        self.fall = fall.max(0.5 * (self.fall + fall));
    }

    /// The run that solves a system to an accuracy, where energies are `unit` times those of the run.
    pub fn run_to(&self, accuracy: Accuracy, unit: f64) -> Run {
        match accuracy {
            Accuracy::Residual(tolerance) => Run {
                residual_part: tolerance,
                ..Run::default()
            },
            Accuracy::Energy { absolute, relative } => Run {
                remaining: absolute * absolute / unit,
                remaining_part: relative * relative,
                to_come: self.to_come(),
                residual_part: UNREACHABLE,
                ..Run::default()
            },
        }
    }

    /// The change of x by a run and the remaining error, where energies are `unit` times those of the run.
    pub fn followed(&self, progress: &Progress, unit: f64) -> Correction {
        Correction {
            change: (unit * progress.energy).sqrt(),
            remaining: (unit * progress.remaining(self.to_come())).sqrt(),
            slow: self.is_slow(),
        }
    }
}
