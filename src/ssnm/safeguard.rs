//! The safeguard of the algorithms as printed: the definition of progress, and the action without it.
//!
//! With a large ρ neither q nor err falls in each step, and the sets still converge. So a step is replaced only where
//! the algorithm cycles. Either the sets of an earlier step return, after others and without any progress since, or
//! there is no progress in many steps.
//!
//! Under given bounds q falls along safeguarded steps. This is a proof: a projected gradient step with ρ = 1/σ_max <
//! 2/σ_max lowers q by at least half of ρ‖r̃_ρ‖² (Kučera 2008, reference 2 of the paper). Under Coulomb's law the error
//! is the only measure, and no step is known to lower it.

use super::newton::{Newton, Way};
use super::point::Point;
use super::sets::Sets;
use super::{Numbers, Status};
use crate::dual::DualError;

/// The kind of the next step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Plan {
    /// Newton's, with sets predicted with this ρ.
    Newton { rho: f64 },
    /// Projected gradient, then the minimum over a face.
    Gradient,
}

/// Steps that cycle are discarded and replaced by projected gradient steps, each time for twice as many steps.
pub(super) struct Safeguard<const D: usize> {
    /// The point of lowest q (under Coulomb's law of the least error).
    best: Point,
    /// The least error.
    best_err: f64,
    /// Steps in a row without progress, and their sets: those of steps with the same sets one after the other once.
    fruitless: usize,
    seen: Vec<Sets<D>>,
    /// The ρ for predicting sets.
    rho: f64,
    /// Safeguarded steps still to make, and the number after the next discarded steps.
    guarded: usize,
    penalty: usize,
    /// No function falls along the way.
    is_coulomb: bool,
    numbers: Numbers,
}

impl<const D: usize> Safeguard<D> {
    /// The safeguard before the first step.
    pub fn new(newton: &Newton<D>, way: &Way<D>) -> Self {
        Self {
            best: way.point.clone(),
            best_err: way.err,
            fruitless: 0,
            seen: Vec::new(),
            rho: newton.rho(),
            guarded: 0,
            penalty: 1,
            is_coulomb: newton.law.is_coulomb(),
            numbers: newton.numbers,
        }
    }

    /// The best point so far.
    pub fn best(&self) -> &Point {
        &self.best
    }

    /// Continues from a point whose r has been recomputed.
    pub fn go_on_from(&mut self, point: &Point, err: f64) {
        self.best.clone_from(point);
        self.best_err = err;
    }

    /// The kind of the next step.
    pub fn plan(&mut self) -> Plan {
        if self.guarded == 0 {
            return Plan::Newton { rho: self.rho };
        }
        self.guarded -= 1;
        Plan::Gradient
    }

    /// Records a step: the loss of q against the best point, the least gain of a projected gradient step from there,
    /// and the error. Progress is half of that gain, or a clearly smaller error: rounding must not count as progress.
    fn note(&mut self, lost: f64, gain: f64, err: f64) {
        let lowers_q = !self.is_coulomb && -lost >= 0.5 * gain && lost < 0.0;
        let progress = lowers_q || err <= self.numbers.progress * self.best_err;
        self.fruitless = if progress { 0 } else { self.fruitless + 1 };
    }

    /// Records the sets of a step; returns whether those of an earlier one have returned, after others.
    fn come_back(&mut self, sets: &Sets<D>) -> bool {
        if self.fruitless == 0 {
            self.seen.clear();
        }
        if self.seen.last() == Some(sets) {
            return false;
        }
        let before = self.seen.contains(sets);
        self.seen.push(sets.clone());
        before
    }

    /// Whether to discard the steps that led here; NaN is discarded at once.
    fn discards(&self, lost: f64, come_back: bool, safeguarded: bool) -> bool {
        if self.is_coulomb {
            return self.fruitless >= self.numbers.fruitless;
        }
        self.fruitless >= self.numbers.fruitless
            || come_back
            || (safeguarded && self.fruitless > 0)
            || lost.is_nan()
    }

    /// Intervenes for twice as many steps as the last time.
    fn act(&mut self, err: f64, alpha: f64) {
        self.best_err = err;
        self.fruitless = 0;
        self.seen.clear();
        self.rho = self.rho.min(alpha);
        self.guarded = self.penalty;
        self.penalty *= 2;
    }
}

impl<const D: usize> Newton<'_, D> {
    /// Judges the step, and returns to the best point if it made no progress; the status if that is the end. `stopped`:
    /// at the observer's request.
    pub fn judge(
        &mut self,
        safeguard: &mut Safeguard<D>,
        way: &mut Way<D>,
        stopped: bool,
    ) -> Result<Option<Status>, DualError> {
        let safeguarded = way.history.last().is_some_and(|step| step.safeguarded);
        let lost = safeguard.best.q_change(&way.point);
        let error = self.error_with(&safeguard.best, self.gradient_length());
        safeguard.note(lost, 0.5 * self.gradient_length() * error.powi(2), way.err);
        let come_back = way
            .sets
            .as_ref()
            .is_some_and(|sets| safeguard.come_back(sets));
        let better = match safeguard.is_coulomb {
            true => way.err < safeguard.best_err,
            false => lost < 0.0,
        };
        if better {
            safeguard.best.clone_from(&way.point);
        }
        safeguard.best_err = safeguard.best_err.min(way.err);
        if stopped {
            way.point.clone_from(&safeguard.best);
            return Ok(Some(Status::Interrupted));
        }
        if !safeguard.discards(lost, come_back, safeguarded) {
            return Ok(None);
        }
        way.point.clone_from(&safeguard.best);
        way.inner = None;
        way.err = self.update_error(&mut way.point);
        // Not even a projected gradient step lowers q or the error.
        if safeguard.is_coulomb || (safeguarded && safeguard.fruitless > 0) {
            return Ok(Some(Status::Stagnated));
        }
        safeguard.act(way.err, self.gradient_length());
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn safeguard() -> Safeguard<2> {
        let point = Point {
            lambda: vec![0.0; 2],
            r: vec![0.0; 2],
            motion: Vec::new(),
        };
        Safeguard {
            best: point,
            best_err: 1.0,
            fruitless: 0,
            seen: Vec::new(),
            rho: 20.0,
            guarded: 0,
            penalty: 1,
            is_coulomb: false,
            numbers: Numbers::default(),
        }
    }

    #[test]
    fn only_a_real_gain_is_progress() {
        let counts = |lost: f64, err: f64| {
            let mut safeguard = safeguard();
            safeguard.note(lost, 1.0, err);
            safeguard.fruitless
        };
        assert_eq!((counts(-0.6, 2.0), counts(-0.4, 2.0)), (0, 1));
        assert_eq!((counts(1.0, 0.89), counts(1.0, 0.95)), (0, 1));
        assert_eq!((counts(f64::NAN, 2.0), counts(0.0, f64::NAN)), (1, 1));
    }

    #[test]
    fn sets_that_come_back_without_progress_are_circles() {
        let sets = |normal: f64| Sets::<2>::predict(&[normal, 0.0], &[0.0; 2], 1.0, &[1.0]);
        let (a, b) = (sets(1.0), sets(-1.0));
        let mut safeguard = safeguard();
        let mut step = |err: f64, sets: &Sets<2>| {
            safeguard.note(0.0, 1.0, err);
            safeguard.best_err = safeguard.best_err.min(err);
            safeguard.come_back(sets)
        };
        // The same sets as in the last step are not a cycle, nor are those of a step before progress.
        assert!(!step(1.0, &a) && !step(1.0, &a) && !step(1.0, &b));
        assert!(!step(0.5, &a) && !step(0.5, &b));
        assert!(step(0.5, &a));
    }

    #[test]
    fn circles_cost_safeguarded_steps() {
        let mut safeguard = safeguard();
        for _ in 0..safeguard.numbers.fruitless - 1 {
            safeguard.note(0.0, 1.0, 1.0);
            assert!(!safeguard.discards(0.0, false, false));
            assert!(
                safeguard.discards(0.0, false, true),
                "a safeguarded one at once"
            );
        }
        assert!(safeguard.discards(0.0, true, false) && safeguard.discards(f64::NAN, false, false));
        safeguard.note(0.0, 1.0, 1.0);
        assert!(safeguard.discards(0.0, false, false));

        assert_eq!(safeguard.plan(), Plan::Newton { rho: 20.0 });
        for steps in [1, 2, 4, 8] {
            safeguard.act(1.0, 0.5);
            for _ in 0..steps {
                assert_eq!(safeguard.plan(), Plan::Gradient);
            }
            assert_eq!(safeguard.plan(), Plan::Newton { rho: 0.5 });
        }
    }
}
