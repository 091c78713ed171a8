//! The safeguard of the algorithms as printed: the definition of progress, and the action without it.
//!
//! With a large ρ neither q nor err falls in each step, and the sets still converge. So a step is replaced only where
//! the algorithm cycles. Either the sets of an earlier step return, after others and without any progress since, or
//! there is no progress in many steps.
//!
//! Under given bounds q falls along safeguarded steps. This is a proof: a projected gradient step with ρ = 1/σ_max <
//! 2/σ_max lowers q by at least half of ρ‖r̃_ρ‖² (Kučera 2008, reference 2 of the paper). Under Coulomb's law the error
//! is the only measure, and no step is known to lower it.

use super::Numbers;
use super::gauge::Gauge;
use super::law::Merit;
use super::outer::{Made, Way};
use super::sets::Sets;

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
    /// The sets of steps in a row without progress: those of steps with the same sets one after the other once.
    seen: Vec<Sets<D>>,
    /// The ρ for predicting sets.
    rho: f64,
    /// Safeguarded steps still to make, and the number after the next discarded steps.
    guarded: usize,
    penalty: usize,
    /// Whether to discard the last steps.
    pub discards: bool,
    merit: Merit,
    numbers: Numbers,
}

impl<const D: usize> Safeguard<D> {
    /// The safeguard before the first step.
    pub fn new(merit: Merit, rho: f64, numbers: Numbers) -> Self {
        Self {
            seen: Vec::new(),
            rho,
            guarded: 0,
            penalty: 1,
            discards: false,
            merit,
            numbers,
        }
    }

    /// The kind of the next step.
    pub fn plan(&mut self) -> Plan {
        if self.guarded == 0 {
            return Plan::Newton { rho: self.rho };
        }
        self.guarded -= 1;
        Plan::Gradient
    }

    /// Records a step in the best point, that of lowest q or of the least error, and decides about the last steps.
    pub fn note(&mut self, gauge: &Gauge<D>, way: &mut Way<D>, made: &Made<D>) {
        let (best, length) = (&way.best, gauge.gradient_length());
        let lost = best.point.q_change(&way.point);
        let gain = 0.5 * length * gauge.error_with(&best.point, length).powi(2);
        let progress = self.is_progress(lost, gain, way.err, best.err);
        let better = match self.merit {
            Merit::Energy => lost < 0.0,
            Merit::Error => way.err < best.err,
        };
        way.note([progress, better]);
        let fruitless = way.best.fruitless;
        let come_back = self.come_back(&made.sets, fruitless);
        self.discards = self.discards(fruitless, lost, come_back, made.safeguarded);
    }

    /// Whether a step made progress, by the loss of q against the best point, the least gain of a projected gradient step from
    /// there, and the errors of both. Progress is half of that gain, or a clearly smaller error: rounding must not count as progress.
    fn is_progress(&self, lost: f64, gain: f64, err: f64, least: f64) -> bool {
        let lowers_q = self.merit == Merit::Energy && -lost >= 0.5 * gain && lost < 0.0;
        lowers_q || err <= self.numbers.progress * least
    }

    /// Records the sets of a step; returns whether those of an earlier one have returned, after others.
    fn come_back(&mut self, sets: &Sets<D>, fruitless: usize) -> bool {
        if fruitless == 0 {
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
    fn discards(&self, fruitless: usize, lost: f64, come_back: bool, safeguarded: bool) -> bool {
        let cycles = come_back || (safeguarded && fruitless > 0) || lost.is_nan();
        fruitless >= self.numbers.fruitless || (self.merit == Merit::Energy && cycles)
    }

    /// Intervenes for twice as many steps as the last time, from where a gradient step has this length.
    pub fn act(&mut self, length: f64) {
        self.seen.clear();
        self.rho = self.rho.min(length);
        self.guarded = self.penalty;
        self.penalty *= 2;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn safeguard() -> Safeguard<2> {
        Safeguard::new(Merit::Energy, 20.0, Numbers::default())
    }

    #[test]
    fn only_a_real_gain_is_progress() {
        let is_progress = |lost: f64, err: f64| safeguard().is_progress(lost, 1.0, err, 1.0);
        assert!(is_progress(-0.6, 2.0) && !is_progress(-0.4, 2.0));
        assert!(is_progress(1.0, 0.89) && !is_progress(1.0, 0.95));
        assert!(!is_progress(f64::NAN, 2.0) && !is_progress(0.0, f64::NAN));
    }

    #[test]
    fn sets_that_come_back_without_progress_are_circles() {
        let sets = |normal: f64| Sets::<2>::predict(&[normal, 0.0], &[0.0; 2], 1.0, &[1.0]);
        let (a, b) = (sets(1.0), sets(-1.0));
        let mut safeguard = safeguard();
        // The same sets as in the last step are not a cycle, nor are those of a step before progress.
        assert!(!safeguard.come_back(&a, 1) && !safeguard.come_back(&a, 2));
        assert!(!safeguard.come_back(&b, 3));
        assert!(!safeguard.come_back(&a, 0) && !safeguard.come_back(&b, 1));
        assert!(safeguard.come_back(&a, 2));
    }

    #[test]
    fn circles_cost_safeguarded_steps() {
        let mut safeguard = safeguard();
        let most = safeguard.numbers.fruitless;
        for fruitless in 1..most {
            assert!(!safeguard.discards(fruitless, 0.0, false, false));
            assert!(
                safeguard.discards(fruitless, 0.0, false, true),
                "a safeguarded one at once"
            );
        }
        assert!(safeguard.discards(1, 0.0, true, false));
        assert!(safeguard.discards(1, f64::NAN, false, false));
        assert!(safeguard.discards(most, 0.0, false, false));

        assert_eq!(safeguard.plan(), Plan::Newton { rho: 20.0 });
        for steps in [1, 2, 4, 8] {
            safeguard.act(0.5);
            for _ in 0..steps {
                assert_eq!(safeguard.plan(), Plan::Gradient);
            }
            assert_eq!(safeguard.plan(), Plan::Newton { rho: 0.5 });
        }
    }
}
