//! The preconditioner of an earlier K: how it turns with the bodies, and how many iterations it costs.

use crate::backend::Progress;
use crate::mesh::vector::minus;
use crate::rigid::Rotation;
use crate::sparse::BlockCsr;
use rayon::prelude::*;
use std::array::from_fn;

/// Bodies that have turned by less, in radians, leave the preconditioner as it is.
const HARDLY_TURNED: f64 = 0.02;

/// How the surroundings of each node, which are its neighbours in K, have turned: rotation matrices on the diagonal; None if all are
/// hardly more than 1. Points before have D numbers per node.
pub(super) fn turned<const D: usize>(
    k: &BlockCsr<D>,
    before: &[f64],
    now: &[[f64; D]],
) -> Option<BlockCsr<D>> {
    let before = before.as_chunks::<D>().0;
    let rotation = |i: usize| {
        let arm = |points: &[[f64; D]], j: u32| minus(points[j as usize], points[i]);
        let arms = (k.row(i).0.iter()).map(|&j| (1.0, arm(before, j), arm(now, j)));
        let rotation = Rotation::<D>::nearest(arms);
        let columns: [[f64; D]; D] =
            from_fn(|c| rotation.of(from_fn(|a| f64::from(u8::from(a == c)))));
        from_fn(|a| from_fn(|c| columns[c][a]))
    };
    let n = now.len();
    let all: Vec<[[f64; D]; D]> = (0..n).into_par_iter().map(rotation).collect();
    let is_turned = |m: &[[f64; D]; D]| (0..D).any(|a| m[a][a] < HARDLY_TURNED.cos());
    if !all.iter().any(is_turned) {
        return None;
    }
    let (ends, diagonal) = ((0..=n).collect(), (0..n as u32).collect());
    Some(BlockCsr::from_parts(n, n, ends, diagonal, all))
}

/// Iterations, and by how much they lowered the logarithm of the residual.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    iterations: f64,
    fall: f64,
}

impl Sums {
    fn add(&mut self, progress: &Progress) {
        // A residual that vanishes belongs to a tiny problem.
        let fall = 0.5 * (progress.rr_start / progress.rr).ln();
        if progress.iterations > 0 && fall.is_finite() {
            self.iterations += progress.iterations as f64;
            self.fall += fall;
        }
    }
}

/// Runs of one kind.
#[derive(Clone, Copy, Debug, Default)]
struct Runs {
    /// With the K for which the preconditioner was made; if it had no runs of this kind, with the next one that has.
    own: Sums,
    /// Whether there is another K now.
    is_over: bool,
    later: Sums,
}

impl Runs {
    /// Iterations that the preconditioner took more than it would have taken for its own K.
    fn excess(&self) -> f64 {
        match self.own.fall > 0.0 {
            true => self.later.iterations - self.later.fall * self.own.iterations / self.own.fall,
            false => 0.0,
        }
    }
}

/// Iterations lost because the preconditioner belongs to an earlier K, by kinds of runs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wear([Runs; 3]);

impl Wear {
    /// Another K comes.
    pub fn begin(&mut self) {
        for runs in &mut self.0 {
            runs.is_over = runs.own.iterations > 0.0;
        }
    }

    /// A run has ended.
    pub fn learn(&mut self, kind: usize, progress: &Progress) {
        let Runs {
            own,
            is_over,
            later,
        } = &mut self.0[kind];
        (if *is_over { later } else { own }).add(progress);
    }

    /// The iterations lost so far.
    pub fn lost(&self) -> f64 {
        self.0.iter().map(|runs| runs.excess().max(0.0)).sum()
    }

    /// The same with a run that has not ended.
    pub fn lost_with(&self, kind: usize, progress: &Progress) -> f64 {
        let mut with = *self;
        with.learn(kind, progress);
        with.lost()
    }
}
