//! The outer loop on a surrogate of A: one product with A in each step (`docs/method.md`).

use super::check::Ended;
use super::goal::Goal;
use super::known::{Known, OnMatrix};
use super::newton::{Newton, Way};
use super::point::{GradientStep, Point};
use super::sets::Sets;
use super::subproblem::Subproblem;
use super::{NewtonSettings, Numbers, Status, Step};
use crate::dual::DualError;
use crate::rounding::{INDEPENDENT, ROUNDING};
use crate::sparse::{add_times, difference, norm, norm_max};
use std::ops::ControlFlow;

/// The proposal of a subproblem.
struct Proposal {
    /// Its solution y, with the r that the surrogate predicts.
    point: Point,
    /// d = y − λᵏ and Ãd.
    step: Vec<f64>,
    image: Vec<f64>,
    /// The error there, by the surrogate.
    err: f64,
    /// Newton steps made for it.
    steps: usize,
    /// Whether it is one on A itself.
    is_on_matrix: bool,
    /// Whether it has the requested accuracy.
    is_solved: bool,
}

/// The best point, and whether steps still make progress.
struct Progress {
    best: Point,
    least: f64,
    /// Steps since the error last decreased clearly.
    fruitless: usize,
    /// The error when r was last recomputed for lack of progress.
    refreshed: f64,
}

impl Progress {
    fn new(point: &Point, err: f64) -> Self {
        Self {
            best: point.clone(),
            least: err,
            fruitless: 0,
            refreshed: f64::INFINITY,
        }
    }

    /// Records a step; one that lowers q by more than rounding counts as better, whatever its error.
    fn note(&mut self, point: &Point, err: f64, is_lower: bool, lowers_q: bool) {
        self.fruitless = if is_lower { 0 } else { self.fruitless + 1 };
        if lowers_q || err < self.least {
            self.best.clone_from(point);
        }
        self.least = self.least.min(err);
    }
}

impl<const D: usize> Newton<'_, D> {
    /// Outer steps until a point that meets the goal passes the final check, or a reason to stop.
    pub fn run_multisecant(
        &mut self,
        way: &mut Way<D>,
        settings: &NewtonSettings,
        observer: &mut dyn FnMut(&Step) -> ControlFlow<()>,
    ) -> Result<Status, DualError> {
        way.err = self.update_error(&mut way.point);
        let numbers = self.numbers;
        let mut goal = Goal::new(self.tolerance, numbers);
        let mut progress = Progress::new(&way.point, way.err);
        let mut denied = 0;
        loop {
            match self.step_1(way, &mut goal)? {
                Ended::With(status) => return Ok(status),
                Ended::Again => {
                    progress.best.clone_from(&way.point);
                    progress.least = way.err;
                    continue;
                }
                Ended::NotYet => {}
            }
            if let Some(status) = self.limit(way, settings) {
                way.point = progress.best;
                return Ok(status);
            }
            let proposal = self.propose(way, progress.fruitless);
            let before = way.point.clone();
            if let Err(error) = self.go_towards(way, &proposal) {
                way.point = progress.best;
                return Err(error);
            }
            // An error below rounding lowers q only by chance.
            let lowers_q = !self.law.is_coulomb()
                && way.err > self.rounding(&before)
                && before.q_change(&way.point) < -before.q_rounding(&way.point);
            let err = self.update_error(&mut way.point);
            let leads_on = err <= numbers.progress * way.err;
            denied = if leads_on { 0 } else { denied + 1 };
            if let Some(known) = self.known.as_mut().filter(|_| proposal.is_on_matrix) {
                known.adapt(proposal.is_solved, &numbers);
            }
            if denied == numbers.denied || self.hidden == numbers.denied {
                if self.products.tighten(self.tolerance) {
                    self.surrogate.be_strict();
                }
                (denied, self.hidden) = (0, 0);
            }
            way.err = err;
            let made = self.record(way, &proposal);
            let is_lower = way.err < numbers.progress * progress.least;
            progress.note(&way.point, way.err, is_lower, lowers_q);
            if observer(&made).is_break() {
                way.point = progress.best;
                return Ok(Status::Interrupted);
            }
            let stuck = match self.law.is_coulomb() {
                true => progress.fruitless >= numbers.patience,
                false => progress.fruitless >= numbers.denied && !lowers_q,
            };
            if stuck && self.is_at_the_end(way, &mut progress)? {
                return Ok(Status::Stagnated);
            }
        }
    }

    /// Solves the problem from λᵏ with the known pairs of A.
    fn propose(&self, way: &Way<D>, fruitless: usize) -> Proposal {
        // If A itself makes no progress, the surrogate may: it has no τ that hides directions along which A is small.
        let known = self.known.as_ref().filter(|_| fruitless % 4 != 2);
        let (point, steps, is_solved) = match known {
            Some(known) => self.on_matrix(known, way),
            None => self.on_surrogate(way, fruitless),
        };
        let proposal = self.proposed(way, point, steps, [known.is_some(), is_solved]);
        let is_convex = known.is_none() && !self.law.is_coulomb();
        if !is_convex || proposal.err < way.err || self.products.stop.now().is_some() {
            return proposal;
        }
        // Where forces at their bounds leave a body free, Newton's method may find no direction. A projected gradient step leads on.
        let GradientStep { end, start } = self.step_from(&way.point, self.gradient_length());
        let point = Point {
            lambda: end,
            ..start
        };
        self.proposed(way, point, steps, [false, true])
    }

    /// The proposal of a point that has the r of λᵏ and its own motion.
    fn proposed(
        &self,
        way: &Way<D>,
        mut point: Point,
        steps: usize,
        [is_on_matrix, is_solved]: [bool; 2],
    ) -> Proposal {
        // Forces below the rounding of those from which they were computed, step by step, count as zero.
        let none = vec![0.0; point.lambda.len()];
        if norm_max(&point.lambda) <= 100.0 * ROUNDING * norm_max(&way.point.lambda)
            && self.balance.as_ref().is_none_or(|b| b.holds(&none))
        {
            point.lambda = none;
        }
        let step = difference(&point.lambda, &way.point.lambda);
        let image = match &self.known {
            Some(known) => known.times(&step),
            None => self.surrogate.times(&step),
        };
        add_times(1.0, &image, &mut point.r);
        Proposal {
            err: self.error(&point),
            point,
            step,
            image,
            steps,
            is_on_matrix,
            is_solved,
        }
    }

    /// On A itself: the proposed forces, with r and α there in advance, the Newton steps made, and whether they have solved the
    /// problem. Sweeps come first if the last step made no progress.
    fn on_matrix(&self, known: &Known<D>, way: &Way<D>) -> (Point, usize, bool) {
        let numbers = self.numbers;
        let mut from = way.point.clone();
        if known.is_stuck() || way.history.is_empty() {
            (0..numbers.sweeps).for_each(|_| known.sweep(&self.law, &mut from));
        }
        let problem = OnMatrix {
            known,
            law: &self.law,
            from: &from,
            numbers: Numbers {
                newton_steps: numbers.matrix_steps,
                ..numbers
            },
            stop: &self.products.stop,
        };
        let (lambda, steps, is_solved) = problem.solve(numbers.solved * way.err);
        let point = Point {
            lambda,
            ..way.point.clone()
        };
        (point, steps, is_solved)
    }

    /// On the surrogate, the same. Under Coulomb's law it takes shorter steps where the last ones were `fruitless`;
    /// under given bounds the minimum of q on the chord makes a step as short as necessary.
    fn on_surrogate(&self, way: &Way<D>, fruitless: usize) -> (Point, usize, bool) {
        let (surrogate, from) = (&self.surrogate, &way.point);
        let base = surrogate.base();
        let mut tau = match self.law.is_coulomb() {
            true => base * (fruitless / self.numbers.fruitless.max(1)) as f64,
            false => 0.0,
        };
        let mut steps = 0;
        let solved = loop {
            let subproblem = Subproblem {
                surrogate,
                law: &self.law,
                balance: self.balance.as_deref(),
                from,
                stiffness: base + tau,
                numbers: self.numbers,
                stop: &self.products.stop,
            };
            let motion = self.balance.as_ref().map_or(Vec::new(), |balance| {
                let stiffness = subproblem.stiffness + surrogate.softest();
                let step = self.step_from(from, 1.0 / stiffness);
                balance.eta(&difference(&step.start.motion, &from.motion))
            });
            let (trial, more) = subproblem.solve::<D>(motion, self.numbers.solved * way.err);
            steps += more;
            let ends = tau > self.sigma || self.products.stop.now().is_some();
            // If hardly solved, it is made easier: [`Subproblem::stiffness`].
            if trial.merit <= 10.0 * self.numbers.solved * way.err || ends {
                break trial;
            }
            tau = (4.0 * tau).max(base);
        };
        let mut point = from.clone();
        point.lambda.clone_from(&solved.lambda);
        if let Some(balance) = &self.balance {
            self.law.balance::<D>(&mut point.lambda, balance);
            let eta = solved.motion(surrogate);
            add_times(1.0, &balance.coefficients(eta), &mut point.motion);
            add_times(-1.0, &balance.spread(eta), &mut point.r);
        }
        (point, steps, true)
    }

    /// Moves towards a proposal, by the part that one product with A shows to be best.
    fn go_towards(&mut self, way: &mut Way<D>, proposal: &Proposal) -> Result<(), DualError> {
        let before = way.point.clone();
        let mut end = proposal.point.clone();
        let Proposal {
            step,
            image: expected,
            ..
        } = proposal;
        if step.iter().all(|&v| v == 0.0) {
            return Ok(());
        }
        let mut rest = step.clone();
        if let Some(balanced) = &self.balanced {
            balanced.project(&mut rest);
        }
        // Products with a matrix cost nothing, and have no rounding of earlier ones.
        let mut image = match proposal.is_on_matrix {
            true => vec![0.0; step.len()],
            false => self.surrogate.split(&mut rest),
        };
        let mut new = vec![0.0; step.len()];
        if norm_max(&rest) > f64::EPSILON * norm_max(step) {
            new = self.products.apply(&rest)?;
            add_times(1.0, &new, &mut image);
            add_times(1.0, &difference(&image, expected), &mut end.r);
        }
        // τ has already determined the length of a step on A itself.
        let part = match proposal.is_on_matrix {
            true => 1.0,
            false => self.part_towards(&before, &end, way.err),
        };
        way.point = before.towards(&end, part);
        self.refresh(&mut way.point, part)?;
        // If the part outside the span of known directions is only rounding of the step, it contains no information.
        // Under Coulomb's law a block that is unloaded to 1e-4 takes 74 steps without such pairs, 40 with them.
        if self.law.is_coulomb() || norm(&rest) > INDEPENDENT * norm(step) {
            self.learn(&rest, &new);
        }
        Ok(())
    }

    /// Records a step. The σ_max learnt from it changes ρ, and with it err⁰.
    fn record(&self, way: &mut Way<D>, proposal: &Proposal) -> Step {
        way.err0 = self.measure(&way.first);
        let Point { lambda, r, .. } = &way.point;
        let sets = Sets::at_solution(lambda, r, self.gradient_length(), &self.law.bounds(lambda));
        let made = Step {
            iter: way.history.len() + 1,
            inner: proposal.steps,
            n_a: self.products.n_a,
            err: way.err / way.err0,
            predicted: Some(proposal.err / way.err0),
            sets: sets.sizes_in(self.problem),
            changes: (way.sets.as_ref()).map_or(0, |old| old.differences(&sets)),
            safeguarded: false,
        };
        way.history.push(made);
        way.sets = Some(sets);
        made
    }

    /// Without progress: whether to end, or to continue with a recomputed r or more accurate products.
    fn is_at_the_end(
        &mut self,
        way: &mut Way<D>,
        progress: &mut Progress,
    ) -> Result<bool, DualError> {
        way.point.clone_from(&progress.best);
        let sharper = self.products.tighten(self.tolerance) || self.products.refine();
        self.make_exact(&mut way.point)?;
        way.err = self.update_error(&mut way.point);
        // An error of zero cannot be improved.
        let leads_on = sharper || way.err < 0.5 * progress.refreshed;
        *progress = Progress {
            refreshed: way.err,
            ..Progress::new(&way.point, way.err)
        };
        Ok(!leads_on)
    }
}
