//! The outer loop of all methods: judge the point, propose a step, accept it.

use super::check::Verdict;
use super::dual_problem::DualProblem;
use super::goal::Goal;
use super::multisecant::OnSurrogate;
use super::newton::Newton;
use super::point::Point;
use super::printed::AsPrinted;
use super::sets::Sets;
use super::{Method, Status, Step};
use crate::dual::DualError;
use std::ops::ControlFlow;

/// The data that change from step to step.
pub(super) struct Way<const D: usize> {
    /// P_Λ(λᵏ) and its gradient.
    pub point: Point,
    /// λᵏ itself, as the inner problem of a step as printed has left it: Step 2 uses it.
    pub inner: Option<Point>,
    /// errᵏ.
    pub err: f64,
    /// The point where err⁰ is computed, and err⁰.
    pub first: Point,
    pub err0: f64,
    /// The largest normal multipliers on bodies that are squeezed at that point and bear nothing there; 0 on others. Empty if there are
    /// none.
    pub squeezed: Vec<f64>,
    /// A point where squeezed bodies bear nothing, which may be a solution: steps look first for one that keeps them in place.
    pub apart: Option<Point>,
    pub best: Best,
    /// The largest multiplier of all points.
    pub most: f64,
    /// The sets of the last step.
    pub sets: Option<Sets<D>>,
    /// The steps made.
    pub history: Vec<Step>,
    /// The numbers of steps and products when the error was first small enough.
    pub first_met: Option<(usize, usize)>,
    /// Products that σ_max took, and seconds until the first step.
    pub n_a_sigma: usize,
    pub setup_seconds: f64,
}

/// The best point so far, and whether steps still make progress.
pub(super) struct Best {
    pub point: Point,
    /// The least error.
    pub err: f64,
    /// Steps in a row without progress.
    pub fruitless: usize,
}

impl Best {
    pub fn new(point: &Point, err: f64) -> Self {
        Self {
            point: point.clone(),
            err,
            fruitless: 0,
        }
    }
}

/// A step that was made.
pub(super) struct Made<const D: usize> {
    /// The sets it worked with.
    pub sets: Sets<D>,
    /// Newton steps on the surrogate, or iterations of CG.
    pub inner: usize,
    /// The error that the surrogate predicts.
    pub predicted: Option<f64>,
    /// Whether the safeguard replaced the step of an algorithm as printed.
    pub safeguarded: bool,
}

/// The steps of a method.
pub(super) trait Steps<const D: usize> {
    /// Proposes a step and accepts a part of it (Steps 2 and 3): moves the point, measures its error, and notes the best one.
    fn make(&mut self, newton: &mut Newton<D>, way: &mut Way<D>) -> Result<Made<D>, DualError>;

    /// Returns to the best point if steps make no progress; whether that is the end.
    fn turn_back(&mut self, newton: &mut Newton<D>, way: &mut Way<D>) -> Result<bool, DualError>;
}

impl<const D: usize> Newton<'_, D> {
    /// Outer steps until a point that meets the goal passes the final check, or a reason to stop.
    pub fn run(
        &mut self,
        way: &mut Way<D>,
        observer: &mut dyn FnMut(&Step) -> ControlFlow<()>,
    ) -> Result<Status, DualError> {
        way.err = self.gauge.update_error(&mut way.point);
        let mut goal = Goal::new(self.dual.settings);
        way.best = Best::new(&way.point, way.err);
        let steps: &mut dyn Steps<D> = match self.dual.settings.method {
            Method::Multisecant => &mut OnSurrogate::default(),
            _ => &mut AsPrinted::new(self),
        };
        let ended = loop {
            // Step 1.
            match self.step_1(way, &mut goal)? {
                Verdict::Done(status) => return Ok(status),
                Verdict::Refreshed => {
                    way.inner = None;
                    way.best.point.clone_from(&way.point);
                    way.best.err = way.err;
                    continue;
                }
                _ => {}
            }
            if let Some(status) = self.limit(way) {
                if status == Status::IterationLimit && self.go_apart(way)? {
                    continue;
                }
                break Ok(status);
            }
            // Steps 2 and 3.
            let made = match steps.make(self, way) {
                Ok(made) => way.record(made, self),
                Err(error) => break Err(error),
            };
            if observer(&made).is_break() {
                break Ok(Status::Interrupted);
            }
            if steps.turn_back(self, way)? && !self.go_apart(way)? {
                return Ok(Status::Stagnated);
            }
        };
        // In the middle of a step the point need not be feasible.
        way.go_back();
        ended
    }

    /// Moves to where squeezed bodies bear nothing after steps have found no other solution; false if that is no better.
    fn go_apart(&mut self, way: &mut Way<D>) -> Result<bool, DualError> {
        let better = |apart: &mut Point| self.gauge.error(apart) < way.best.err;
        let Some(apart) = way.apart.take_if(better) else {
            return Ok(false);
        };
        way.point = apart;
        self.refresh_exactly(way)?;
        way.best = Best::new(&way.point, way.err);
        Ok(true)
    }

    /// The reason not to make another step.
    fn limit(&self, way: &Way<D>) -> Option<Status> {
        let most = self.dual.settings.max_iterations;
        let steps = (way.history.len() >= most).then_some(Status::IterationLimit);
        self.products.stop.now().map(Status::from).or(steps)
    }
}

impl<const D: usize> Way<D> {
    /// Before the first step, at the λ of err⁰ without its r.
    pub fn new(dual: &DualProblem<D>) -> Self {
        let first = Point {
            lambda: dual.least.clone(),
            r: vec![0.0; dual.least.len()],
            motion: vec![0.0; dual.problem.floating_bodies().n_modes()],
        };
        Self {
            point: first.clone(),
            inner: None,
            err: 0.0,
            best: Best::new(&first, 0.0),
            most: 0.0,
            first,
            err0: 0.0,
            squeezed: Vec::new(),
            apart: None,
            sets: None,
            history: Vec::new(),
            first_met: None,
            n_a_sigma: 0,
            setup_seconds: 0.0,
        }
    }

    /// Takes a step into account in the best point: whether it made progress, and whether its point is better.
    pub fn note(&mut self, [progress, better]: [bool; 2]) {
        let best = &mut self.best;
        best.fruitless = if progress { 0 } else { best.fruitless + 1 };
        if better {
            best.point.clone_from(&self.point);
        }
        best.err = best.err.min(self.err);
    }

    /// To the best point.
    pub fn go_back(&mut self) {
        self.point.clone_from(&self.best.point);
    }

    fn record(&mut self, made: Made<D>, newton: &Newton<D>) -> Step {
        let step = Step {
            iter: self.history.len() + 1,
            inner: made.inner,
            n_a: newton.products.n_a,
            err: self.err / self.err0,
            predicted: made.predicted.map(|err| err / self.err0),
            sets: made.sets.sizes_in(&newton.dual.problem),
            changes: (self.sets.as_ref()).map_or(0, |old| old.differences(&made.sets)),
            safeguarded: made.safeguarded,
        };
        self.history.push(step);
        self.sets = Some(made.sets);
        step
    }
}
