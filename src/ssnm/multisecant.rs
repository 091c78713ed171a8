//! Steps on a surrogate of A: one product with A in each (`docs/method.md`).

use super::Numbers;
use super::known::{Known, OnMatrix};
use super::law::Merit;
use super::newton::Newton;
use super::outer::{Best, Made, Steps, Way};
use super::point::{GradientStep, Point};
use super::sets::Sets;
use super::subproblem::Subproblem;
use crate::dual::DualError;
use crate::rounding::{INDEPENDENT, ROUNDING};
use crate::sparse::{add_times, difference, norm, norm_max};

/// A step that lets a squeezed body go is made again under held bounds, as are the next ones until the error has fallen by this factor:
/// after a single held step the next one often lets the body go again.
const HELD: f64 = 0.1;

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

/// Steps on the surrogate, or on A itself where it is a matrix.
#[derive(Default)]
pub(super) struct OnSurrogate {
    /// Steps in a row that did not lower the error.
    denied: usize,
    /// Whether the last one has lowered q.
    lowers_q: bool,
    /// The error when r was last recomputed for lack of progress.
    refreshed: Option<f64>,
    /// Steps keep the slip bounds of their start above this error, since one was taken back that let squeezed bodies go; 0 before.
    held_above: f64,
}

impl<const D: usize> Steps<D> for OnSurrogate {
    fn make(&mut self, newton: &mut Newton<D>, way: &mut Way<D>) -> Result<Made<D>, DualError> {
        let numbers = newton.dual.settings.numbers;
        way.most = way.most.max(norm_max(&way.point.lambda));
        let mut proposal = newton.propose(way, self.held_above > 0.0 && way.err > self.held_above);
        // Without forces there is no friction, and a squeezed body only moves on and on.
        if way.apart.is_none()
            && proposal.step.iter().all(|&v| v == 0.0)
            && let Some((squeezed, _)) = newton.gauge.squeeze_of(&way.point)
            && newton.press(way, squeezed)?
        {
            way.err = newton.gauge.update_error(&mut way.point);
            self.held_above = HELD * way.err;
            proposal = newton.propose(way, true);
        }
        let (before, err) = (way.point.clone(), way.err);
        newton.accept(way, &proposal)?;
        if newton.lets_go(way, &before) {
            self.held_above = HELD * err;
            let apart = std::mem::replace(&mut way.point, before.clone());
            way.apart.get_or_insert(apart);
        }
        // An error below rounding lowers q only by chance.
        self.lowers_q = newton.dual.law.merit.falls(&before, &way.point)
            && err > newton.gauge.rounding(&before);
        way.err = newton.gauge.update_error(&mut way.point);
        // The σ_max learnt from the step changes ρ, and with it err⁰.
        way.err0 = newton.gauge.first_error(&way.first);
        if let Some(known) = newton.known.as_mut().filter(|_| proposal.is_on_matrix) {
            known.adapt(proposal.is_solved, &numbers);
        }
        let leads_on = way.err <= numbers.progress * err;
        self.denied = if leads_on { 0 } else { self.denied + 1 };
        if self.denied == numbers.denied || newton.hidden == numbers.denied {
            if newton.products.tighten(newton.dual.settings.tolerance) {
                newton.surrogate.be_strict();
            }
            (self.denied, newton.hidden) = (0, 0);
        }
        let is_lower = way.err < numbers.progress * way.best.err;
        way.note([is_lower, self.lowers_q || way.err < way.best.err]);
        let Point { lambda, r, .. } = &way.point;
        let length = newton.gauge.gradient_length();
        Ok(Made {
            sets: Sets::at_solution(lambda, r, length, &newton.dual.law.bounds(lambda)),
            inner: proposal.steps,
            predicted: Some(proposal.err),
            safeguarded: false,
        })
    }

    /// And goes on from there where a recomputed r or more accurate products may help.
    fn turn_back(&mut self, newton: &mut Newton<D>, way: &mut Way<D>) -> Result<bool, DualError> {
        let settings = newton.dual.settings;
        let patience = newton.dual.law.merit.patience(&settings.numbers);
        if way.best.fruitless < patience || self.lowers_q {
            return Ok(false);
        }
        way.go_back();
        let sharper = newton.products.tighten(settings.tolerance) || newton.products.refine();
        newton.refresh_exactly(way)?;
        way.best = Best::new(&way.point, way.err);
        // An error of zero cannot be improved.
        let before = self.refreshed.replace(way.err).unwrap_or(f64::INFINITY);
        Ok(!(sharper || way.err < 0.5 * before))
    }
}

impl<const D: usize> Newton<'_, D> {
    /// Solves the problem from λᵏ with the known pairs of A.
    fn propose(&self, way: &Way<D>, holds: bool) -> Proposal {
        // If A itself makes no progress, the surrogate may: it has no τ that hides directions along which A is small.
        let known = self.known.as_ref().filter(|_| way.best.fruitless % 4 != 2);
        let proposal = match known {
            Some(known) => self.on_matrix(known, way),
            None => self.on_surrogate(way, holds),
        };
        let is_convex = known.is_none() && self.dual.law.merit == Merit::Energy;
        if !is_convex || proposal.err < way.err || self.products.stop.now().is_some() {
            return proposal;
        }
        // Where forces at their bounds leave a body free, Newton's method may find no direction. A projected gradient step leads on.
        let GradientStep { end, start } =
            (self.gauge).step_from(&way.point, self.gauge.gradient_length());
        let point = Point {
            lambda: end,
            ..start
        };
        self.proposed(way, point, proposal.steps, [false, true])
    }

    /// Whether a step from a point has let a squeezed body go.
    fn lets_go(&self, way: &Way<D>, before: &Point) -> bool {
        if way.squeezed.is_empty() {
            return false;
        }
        let [before, after] = [before, &way.point].map(|point| self.dual.pressed(&point.lambda));
        let bodies = way.squeezed.iter().zip(before.iter().zip(after));
        bodies.into_iter().any(|(&squeezed, (&before, after))| {
            squeezed > 0.0 && before > 0.0 && after <= self.dual.settings.tolerance * before
        })
    }

    /// The proposal of a point that has the r of λᵏ and its own motion.
    fn proposed(
        &self,
        way: &Way<D>,
        mut point: Point,
        steps: usize,
        [is_on_matrix, is_solved]: [bool; 2],
    ) -> Proposal {
        // Forces below the rounding of those from which they were computed count as zero. A body that friction alone has pressed at first
        // sheds a part of them in each step.
        let none = vec![0.0; point.lambda.len()];
        let from = match way.apart {
            Some(_) => way.most,
            None => norm_max(&way.point.lambda),
        };
        if norm_max(&point.lambda) <= 100.0 * ROUNDING * from
            && (self.dual.balance.as_ref()).is_none_or(|b| b.holds(&none))
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
            err: self.gauge.error(&point),
            point,
            step,
            image,
            steps,
            is_on_matrix,
            is_solved,
        }
    }

    /// On A itself. Sweeps come first if the last step made no progress.
    fn on_matrix(&self, known: &Known<D>, way: &Way<D>) -> Proposal {
        let (law, numbers) = (&self.dual.law, self.dual.settings.numbers);
        let mut from = way.point.clone();
        if known.is_stuck() || way.history.is_empty() {
            (0..numbers.sweeps).for_each(|_| known.sweep(law, &mut from));
        }
        let problem = OnMatrix {
            known,
            law,
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
        self.proposed(way, point, steps, [true, is_solved])
    }

    /// On the surrogate, with shorter steps where the last ones made no progress; if it `holds`, under the slip bounds of λᵏ.
    fn on_surrogate(&self, way: &Way<D>, holds: bool) -> Proposal {
        let (surrogate, from, dual) = (&self.surrogate, &way.point, self.dual);
        let held = holds.then(|| dual.law.held_at(&from.lambda));
        let law = held.as_ref().unwrap_or(&dual.law);
        let (numbers, balance) = (dual.settings.numbers, dual.balance.as_deref());
        let base = surrogate.base();
        let mut tau = base * dual.law.merit.shortening(way.best.fruitless, &numbers);
        let mut steps = 0;
        let solved = loop {
            let subproblem = Subproblem {
                surrogate,
                law,
                balance,
                from,
                stiffness: base + tau,
                numbers,
                stop: &self.products.stop,
            };
            let motion = balance.map_or(Vec::new(), |balance| {
                let stiffness = subproblem.stiffness + surrogate.softest();
                let step = self.gauge.step_from(from, 1.0 / stiffness);
                balance.eta(&difference(&step.start.motion, &from.motion))
            });
            let (trial, more) = subproblem.solve::<D>(motion, numbers.solved * way.err);
            steps += more;
            let ends = tau > self.gauge.sigma || self.products.stop.now().is_some();
            // If hardly solved, it is made easier: [`Subproblem::stiffness`].
            if trial.merit <= 10.0 * numbers.solved * way.err || ends {
                break trial;
            }
            tau = (4.0 * tau).max(base);
        };
        let mut point = from.clone();
        point.lambda.clone_from(&solved.lambda);
        if holds {
            dual.project(&mut point.lambda);
        }
        if let Some(balance) = balance {
            dual.law.balance::<D>(&mut point.lambda, balance);
            let eta = solved.motion(surrogate);
            add_times(1.0, &balance.coefficients(eta), &mut point.motion);
            add_times(-1.0, &balance.spread(eta), &mut point.r);
        }
        self.proposed(way, point, steps, [false, true])
    }

    /// Moves towards a proposal, by the part that one product with A shows to be best.
    fn accept(&mut self, way: &mut Way<D>, proposal: &Proposal) -> Result<(), DualError> {
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
        if let Some(balanced) = &self.dual.balanced {
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
            false => self.gauge.part_towards(&before, &end, way.err),
        };
        way.point = before.towards(&end, part);
        self.refresh(&mut way.point, part)?;
        // If the part outside the span of known directions is only rounding of the step, it contains no information.
        // Under Coulomb's law a block that is unloaded to 1e-4 takes 74 steps without such pairs, 40 with them.
        if self.dual.law.merit == Merit::Error || norm(&rest) > INDEPENDENT * norm(step) {
            self.learn(&rest, &new);
        }
        Ok(())
    }
}
