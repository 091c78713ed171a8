//! Input and output of every loop: stopping, accuracy, costs.

use crate::ranks::Ranks;
use std::sync::atomic::{AtomicBool, Ordering};
use web_time::Instant;

/// The reason why a computation was stopped from outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Stopped {
    /// Time is up.
    #[error("the time limit is reached")]
    TimeLimit,
    /// Somebody asked for it.
    #[error("interrupted")]
    Interrupted,
}

/// When to stop; looked at between products and inside long ones.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stop<'a> {
    /// No later than this.
    pub deadline: Option<Instant>,
    /// As soon as this is set.
    pub interrupt: Option<&'a AtomicBool>,
    /// Those that stop together: the clock of the first one decides, and the interrupt of any. They all have to ask.
    pub(crate) ranks: Option<&'a Ranks>,
}

impl Stop<'_> {
    /// The reason to stop now, if there is one.
    pub fn now(&self) -> Option<Stopped> {
        let mut interrupted = (self.interrupt).is_some_and(|flag| flag.load(Ordering::Relaxed));
        let mut late = self.deadline.is_some_and(|end| Instant::now() >= end);
        if let Some(ranks) = self.ranks {
            late &= ranks.is_first();
            let mut any = [interrupted, late].map(|here| f64::from(u8::from(here)));
            ranks.sum(&mut any);
            [interrupted, late] = any.map(|count| count > 0.0);
        }
        match (interrupted, late) {
            (true, _) => Some(Stopped::Interrupted),
            (_, true) => Some(Stopped::TimeLimit),
            _ => None,
        }
    }
}

/// The accuracy of the solution of a system K x = b; e is the error of x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Accuracy {
    /// ‖b − Kx‖ ≤ τ‖b‖.
    Residual(f64),
    /// √(eᵀKe) ≤ `absolute`, or ≤ `relative` · √(xᵀKx), or a sum of squares of the two.
    ///
    /// PCG lowers eᵀKe by α rᵀz in every iteration: Hestenes and Stiefel, J. Res. Nat. Bur. Standards 49 (1952)
    /// 409–436, §6; Strakoš and Tichý, ETNA 13 (2002) 56–80. Over up to nine iterations, the remainder is estimated
    /// from the last of these terms and from how fast they fell in earlier runs. A longer run has met a slow part of
    /// the spectrum, where they fall and rise again. There the sum over the last fifth to third of the iterations is
    /// the estimate. No such estimate sees a part of the spectrum that PCG has not reached yet. With a stiff inclusion
    /// that begins to move only after many iterations, the error is underestimated.
    Energy {
        /// Of √(eᵀKe).
        absolute: f64,
        /// Relative to √(xᵀKx).
        relative: f64,
    },
}

/// The progress of a u that follows λ towards K⁻¹(f − Bᵀλ), in the norm √(vᵀKv).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Correction {
    /// The change of the solution.
    pub change: f64,
    /// Its present error, as PCG estimates it.
    pub remaining: f64,
    /// PCG is slow: the remaining error is smoother than the change.
    pub slow: bool,
}

/// The costs of all solves so far.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SolveCounts {
    /// Systems with K solved.
    pub solves: usize,
    /// Iterations, each with one application of the preconditioner.
    pub iterations: usize,
    /// Iterations asked of a device: those after the end of a run have no effect, but take a little time.
    pub issued: usize,
    /// Set-ups of the preconditioner.
    pub set_ups: usize,
}

/// The work of a backend so far; all zero on the CPU.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counters {
    /// Kernel launches.
    pub dispatches: usize,
    /// Times that the host has waited for numbers.
    pub readbacks: usize,
    /// Command buffers handed to the device.
    pub submissions: usize,
}

/// The costs of the nested path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Costs {
    /// Systems with K and their iterations.
    pub solves: SolveCounts,
    /// Kernel launches and read-backs.
    pub device: Counters,
}
