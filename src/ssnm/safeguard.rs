//! The safeguard: what counts as progress, and what is done without.
//!
//! Under given bounds q falls along safeguarded steps, which is a proof ([`Descent`]). Under Coulomb's law there is
//! nothing but the error to go by, and steps are made in other ways until it falls ([`Attempts`]).

use super::Status;
use super::newton::{Newton, Way};
use super::point::Point;
use super::sets::Sets;
use super::subspace::Subspace;
use crate::dual::{DualError, DualOperator};

/// Steps in a row without progress before something is done about it.
const FRUITLESS: usize = 3;
/// Likewise in space, where safeguarded steps are the better ones once Newton's do not get on.
const FRUITLESS_IN_SPACE: usize = 2;
/// Likewise of coupled steps in space, which are early ended rather than searched.
const FRUITLESS_COUPLED: usize = 5;
/// An error below this part of the best one is progress.
const PROGRESS: f64 = 0.9;
/// The part of α‖r̃_α‖² by which a step has to lower q to count as progress; a projected gradient step
/// gains at least half of it.
const GAIN: f64 = 0.05;
/// The part of all progress that a single step must not lose.
const LOST: f64 = 0.5;
/// Faces of Λ that a safeguarded step may visit: one at first (in space, where all of them share what circles cost, more),
/// so many times more each time that the safeguard has to act again, up to the largest number.
const FIRST_FACES_IN_SPACE: usize = 16;
const MORE_FACES: usize = 4;
const MAX_FACES: usize = 64;
/// r made afresh has to lower the error to this part, or there is nothing left to do.
const REFRESHED: f64 = 0.5;
/// Under Coulomb's law sets are predicted with so much longer a ρ than that of the error, and each time that nothing else
/// has helped again with so much more.
const LONGER: f64 = 4.0;
/// Ways to make coupled steps: whole, searched for the least error, and both longer ρ after that.
const ATTEMPTS: i32 = 4;
/// How often coupled steps start again from the best point where products are exact.
const RESTARTS: usize = 1;

/// How the next step is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Plan {
    /// Newton's, with sets predicted with this ρ; `search` for the point of least error on the way.
    Newton { rho: f64, search: bool },
    /// Projected gradient, then minima over so many faces at most.
    Gradient { faces: usize },
}

/// Which of the two it is.
pub(super) enum Safeguard {
    Descent(Descent),
    Attempts(Attempts),
}

/// Steps that lower neither the best q nor the best error are discarded and replaced by projected gradient steps, each
/// time for twice as many steps.
pub(super) struct Descent {
    /// The point of lowest q, and the first one.
    best: Point,
    first: Point,
    /// The least error.
    best_err: f64,
    /// Steps in a row without progress.
    fruitless: usize,
    /// What sets are predicted with.
    rho: f64,
    /// Safeguarded steps still to make, how many the next discarded steps will cost, and their faces.
    guarded: usize,
    penalty: usize,
    faces: usize,
    first_faces: usize,
    /// [`FRUITLESS`].
    patience: usize,
}

/// Steps are made differently where the error does not fall.
pub(super) struct Attempts {
    /// The point of least error, and that error.
    best: Point,
    best_err: f64,
    /// Steps in a row without progress.
    fruitless: usize,
    /// How often steps have been made differently for want of progress.
    attempt: i32,
    /// How often they may start again from the best point.
    restarts: usize,
    /// [`FRUITLESS`].
    patience: usize,
}

impl Safeguard {
    /// What it has to say before the first step.
    pub fn new<O: DualOperator + ?Sized, const D: usize>(
        newton: &Newton<O, D>,
        way: &Way<D>,
    ) -> Self {
        let (best, best_err) = (way.point.clone(), way.err);
        if newton.law.is_coulomb() {
            let restarts = match newton.products.are_exact() {
                true => RESTARTS,
                false => 0,
            };
            return Self::Attempts(Attempts {
                best,
                best_err,
                fruitless: 0,
                attempt: 0,
                restarts,
                patience: if D == 2 { FRUITLESS } else { FRUITLESS_COUPLED },
            });
        }
        Self::Descent(Descent {
            first: best.clone(),
            best,
            best_err,
            fruitless: 0,
            rho: newton.rho,
            guarded: 0,
            penalty: 1,
            faces: 0,
            first_faces: if D == 2 { 1 } else { FIRST_FACES_IN_SPACE },
            patience: if D == 2 {
                FRUITLESS
            } else {
                FRUITLESS_IN_SPACE
            },
        })
    }

    /// The best point so far.
    pub fn best(&self) -> &Point {
        match self {
            Self::Descent(descent) => &descent.best,
            Self::Attempts(attempts) => &attempts.best,
        }
    }

    /// Goes on from a point whose r has been made afresh.
    pub fn go_on_from(&mut self, point: &Point) {
        match self {
            Self::Descent(descent) => descent.best.clone_from(point),
            Self::Attempts(attempts) => attempts.best.clone_from(point),
        }
    }

    /// Likewise after a final check that has failed: under Coulomb's law the error there is the one to fall.
    pub fn go_on_from_check(&mut self, point: &Point, err: f64) {
        self.go_on_from(point);
        if let Self::Attempts(attempts) = self {
            attempts.best_err = err;
        }
    }

    /// How the next step is to be made; `rho` is that of the error.
    pub fn plan(&mut self, rho: f64) -> Plan {
        match self {
            Self::Descent(descent) => descent.plan(),
            Self::Attempts(attempts) => Plan::Newton {
                rho: rho * LONGER.powi(attempts.attempt.max(1)),
                search: attempts.attempt > 0,
            },
        }
    }
}

impl Descent {
    fn plan(&mut self) -> Plan {
        if self.guarded == 0 {
            return Plan::Newton {
                rho: self.rho,
                search: false,
            };
        }
        self.guarded -= 1;
        Plan::Gradient { faces: self.faces }
    }

    /// Takes note of a step: what q has lost against the best point, what a projected gradient step from there would
    /// gain at least, and the error. Progress is a real part of that gain, or a clearly smaller error: rounding must
    /// not pass for it. `by_error`: only the latter counts.
    fn note(&mut self, lost: f64, gain: f64, err: f64, by_error: bool) {
        let progress =
            -lost >= GAIN * gain && lost < 0.0 && !by_error || err <= PROGRESS * self.best_err;
        self.fruitless = if progress { 0 } else { self.fruitless + 1 };
        self.best_err = self.best_err.min(err);
    }

    /// Whether to discard what has led here. More than half of all progress lost counts at once, and so does NaN.
    fn discards(&self, lost: f64, gained: f64, safeguarded: bool) -> bool {
        self.fruitless >= self.patience
            || (safeguarded && self.fruitless > 0)
            || !(lost <= LOST * gained)
    }

    /// Acts, for twice as many steps and with more faces than the last time.
    fn act(&mut self, err: f64, alpha: f64) {
        self.best_err = err;
        self.fruitless = 0;
        self.rho = self.rho.min(alpha);
        self.guarded = self.penalty;
        self.penalty *= 2;
        self.faces = (MORE_FACES * self.faces).clamp(self.first_faces, MAX_FACES);
    }
}

impl Attempts {
    /// Takes note of a step; false where every way to make it has been tried.
    fn note(&mut self, point: &Point, err: f64) -> bool {
        self.fruitless += 1;
        if err <= PROGRESS * self.best_err {
            (self.fruitless, self.attempt) = (0, 0);
        } else if self.fruitless >= self.patience {
            (self.fruitless, self.attempt) = (0, self.attempt + 1);
        }
        if err < self.best_err {
            (self.best, self.best_err) = (point.clone(), err);
        }
        self.attempt < ATTEMPTS
    }
}

impl<O: DualOperator + ?Sized, const D: usize> Newton<'_, O, D> {
    /// Judges the step that was made, and goes back to the best point where it has led nowhere; the status where that
    /// is the end. `stopped` says that the observer has asked for one.
    pub fn judge(
        &mut self,
        safeguard: &mut Safeguard,
        way: &mut Way<D>,
        stopped: bool,
    ) -> Result<Option<Status>, DualError> {
        match safeguard {
            Safeguard::Descent(descent) => self.judge_descent(descent, way, stopped),
            Safeguard::Attempts(attempts) => self.judge_attempts(attempts, way, stopped),
        }
    }

    fn judge_descent(
        &mut self,
        descent: &mut Descent,
        way: &mut Way<D>,
        stopped: bool,
    ) -> Result<Option<Status>, DualError> {
        let safeguarded = way.history.last().is_some_and(|step| step.safeguarded);
        let lost = descent.best.q_change(&way.point);
        let error = self.error_with(&mut descent.best.clone(), self.alpha);
        // Newton steps back and forth between circles gain a little each time.
        let by_error = !safeguarded && way.sets.as_ref().is_some_and(Sets::turn);
        descent.note(lost, self.alpha * error.powi(2), way.err, by_error);
        if stopped {
            if !(lost < 0.0) {
                way.point.clone_from(&descent.best);
            }
            return Ok(Some(Status::Interrupted));
        }
        let gained = -descent.first.q_change(&descent.best);
        if lost < 0.0 {
            descent.best.clone_from(&way.point);
        }
        if !descent.discards(lost, gained, safeguarded) {
            return Ok(None);
        }
        way.go_back_to(&descent.best);
        way.err = self.error(&mut way.point);
        // It may have been for want of accuracy.
        if self.products.sharpen() {
            self.products.allow(way.err);
            self.refresh(&mut way.point)?;
            way.err = self.error(&mut way.point);
            descent.best.clone_from(&way.point);
        } else if safeguarded {
            // Not even a projected gradient step lowers q or the error: rounding, of an r that was
            // carried along or of what is left to do.
            self.make_exact(&mut way.point)?;
            way.err = self.error(&mut way.point);
            if !(way.err <= REFRESHED * self.refreshed) {
                return Ok(Some(Status::Stagnated));
            }
            self.refreshed = way.err;
            descent.best.clone_from(&way.point);
            descent.first.clone_from(&way.point);
        }
        descent.act(way.err, self.alpha);
        Ok(None)
    }

    /// No function falls along the way: the error itself has to say.
    fn judge_attempts(
        &mut self,
        attempts: &mut Attempts,
        way: &mut Way<D>,
        stopped: bool,
    ) -> Result<Option<Status>, DualError> {
        let goes_on = attempts.note(&way.point, way.err);
        if goes_on && !stopped {
            return Ok(None);
        }
        way.go_back_to(&attempts.best);
        if stopped {
            return Ok(Some(Status::Interrupted));
        }
        // It may have been for want of accuracy. Where there is no more to be had, other inexact solutions lead
        // other ways.
        if !self.products.sharpen() {
            if attempts.restarts == 0 {
                return Ok(Some(Status::Stagnated));
            }
            attempts.restarts -= 1;
            self.products.known = Subspace::default();
        }
        self.products.allow(attempts.best_err);
        self.refresh(&mut way.point)?;
        way.err = self.error(&mut way.point);
        (attempts.best, attempts.best_err) = (way.point.clone(), way.err);
        attempts.attempt = 0;
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point() -> Point {
        Point {
            lambda: vec![0.0; 2],
            r: vec![0.0; 2],
            motion: Vec::new(),
        }
    }

    fn descent() -> Descent {
        Descent {
            best: point(),
            first: point(),
            best_err: 1.0,
            fruitless: 0,
            rho: 20.0,
            guarded: 0,
            penalty: 1,
            faces: 0,
            first_faces: 1,
            patience: FRUITLESS,
        }
    }

    #[test]
    fn only_a_real_gain_is_progress() {
        let counts = |lost: f64, err: f64| {
            let mut descent = descent();
            descent.note(lost, 1.0, err, false);
            descent.fruitless
        };
        assert_eq!((counts(-0.06, 2.0), counts(-0.04, 2.0)), (0, 1));
        assert_eq!((counts(1.0, 0.89), counts(1.0, 0.95)), (0, 1));
        assert_eq!((counts(f64::NAN, 2.0), counts(0.0, f64::NAN)), (1, 1));
    }

    #[test]
    fn three_steps_without_progress_cost_safeguarded_ones() {
        let mut descent = descent();
        let newton = |rho| Plan::Newton { rho, search: false };
        for _ in 0..2 {
            descent.note(0.0, 1.0, 1.0, false);
            assert!(!descent.discards(0.0, 1.0, false));
            assert!(
                descent.discards(0.0, 1.0, true),
                "a safeguarded one at once"
            );
        }
        // A step that loses too much of all progress, too.
        assert!(descent.discards(0.6, 1.0, false) && descent.discards(f64::NAN, 1.0, false));
        descent.note(0.0, 1.0, 1.0, false);
        assert!(descent.discards(0.0, 1.0, false));

        assert_eq!(descent.plan(), newton(20.0));
        for (steps, faces) in [(1, 1), (2, 4), (4, 16), (8, 64), (16, 64)] {
            descent.act(1.0, 0.5);
            for _ in 0..steps {
                assert_eq!(descent.plan(), Plan::Gradient { faces });
            }
            assert_eq!(descent.plan(), newton(0.5));
        }
    }

    #[test]
    fn coupled_steps_are_tried_in_all_ways() {
        let mut attempts = Attempts {
            best: point(),
            best_err: 1.0,
            fruitless: 0,
            attempt: 0,
            restarts: 0,
            patience: FRUITLESS,
        };
        assert!((0..11).all(|_| attempts.note(&point(), 1.0)));
        assert!(!attempts.note(&point(), 1.0), "four times three steps");
        assert!(attempts.note(&point(), 0.8) && attempts.attempt == 0);
        // A little better is the best point, but no progress.
        attempts.note(&point(), 0.79);
        assert_eq!((attempts.best_err, attempts.fruitless), (0.79, 1));
    }
}
