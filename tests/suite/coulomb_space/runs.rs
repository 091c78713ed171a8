//! Their runs: products to given errors, compared with those of the same steps with the slip bounds given.

use crate::common::or_panic::OrPanic as _;
use crate::common::oracle::Oracle;
use crate::common::solve::engine;
use signorini::engine::{Engine, Stiffness};
use signorini::model::{Built, Model};
use signorini::problem::ContactProblem;
use signorini::quasistatic;
use signorini::quasistatic::{Event, Load, State, StepSettings, StepSolution};
use signorini::ssnm::Status;
use std::ops::ControlFlow;

/// Errors that products are counted to.
pub const ERRORS: [f64; 2] = [1e-4, 1e-6];

/// One load step, and its products to each of [`ERRORS`], those of all solves together.
pub fn counted(
    problem: &ContactProblem<3>,
    load: &Load,
    start: &State,
    engine: &mut Engine,
    settings: &StepSettings,
) -> (StepSolution<3>, Vec<usize>) {
    let verbose = std::env::var("COULOMB_PRINT").is_ok();
    let mut met = Vec::new();
    let (mut before, mut now) = (0, 0);
    let observer = |event: Event| {
        match event {
            Event::Newton(step) => {
                now = before + step.n_a;
                let reached = |error: &f64| step.err <= *error;
                while ERRORS.get(met.len()).is_some_and(reached) {
                    met.push(now);
                }
                if verbose {
                    let (sizes, mark) =
                        (step.sets, if step.safeguarded { "safeguard" } else { "" });
                    println!(
                        "    {:3} inner {:3} products {:4} err {:.3e} separated {} stick {} slip {} changes {} {mark}",
                        step.iter,
                        step.inner,
                        step.n_a,
                        step.err,
                        sizes.separated,
                        sizes.stick,
                        sizes.slip.total(),
                        step.changes
                    );
                }
            }
            Event::Round(_) => before = now,
        }
        ControlFlow::Continue(())
    };
    let solution = quasistatic::solve_step(
        problem,
        load,
        start,
        engine,
        settings,
        &mut Default::default(),
        observer,
    );
    (solution.or_panic(), met)
}

/// The load steps of a model up to the first that does not converge.
pub struct Run {
    pub built: Built<3>,
    pub loads: Vec<Load>,
    pub steps: Vec<StepSolution<3>>,
    pub met: Vec<Vec<usize>>,
}

impl Run {
    pub fn new(model: Model<3>, stiffness: Stiffness, settings: &StepSettings) -> Self {
        let built = model.build().or_panic();
        let mut loads = Vec::new();
        for number in 0..built.n_steps() {
            let data = built.step(number);
            loads.push(data.or_panic().load);
        }
        let (mut steps, mut all) = (Vec::new(), Vec::new());
        let mut engine = engine(&built.problem, stiffness);
        let mut state = State::at_rest(&built.problem);
        for load in &loads {
            let (solution, met) = counted(&built.problem, load, &state, &mut engine, settings);
            state = solution.state(load);
            let ended = solution.status != Status::Converged;
            steps.push(solution);
            all.push(met);
            if ended {
                break;
            }
        }
        drop(engine);
        Self {
            built,
            loads,
            steps,
            met: all,
        }
    }

    pub fn start(&self, step: usize) -> State {
        match step {
            0 => State::at_rest(&self.built.problem),
            _ => self.steps[step - 1].state(&self.loads[step - 1]),
        }
    }

    pub fn last(&self) -> &StepSolution<3> {
        self.steps.last().expect("a step")
    }

    pub fn products(&self) -> usize {
        self.steps.iter().map(StepSolution::n_a).sum()
    }

    /// The oracle finds nothing wrong with a step.
    pub fn check_step(&self, name: &str, number: usize) {
        let (step, load) = (&self.steps[number], &self.loads[number]);
        let oracle = Oracle::new(&self.built.problem);
        for d in oracle.deviations(load, &self.start(number), &step.u, &step.lambda) {
            let (what, place, times) = (d.name, d.place, d.times);
            assert!(
                times <= 1.0,
                "{name}, step {number}: {what} at {place}, {times:.2e} times what is allowed"
            );
        }
    }

    /// Every step has converged, and is right.
    pub fn check(&self, name: &str) {
        assert_eq!(self.steps.len(), self.loads.len(), "{name}");
        for (number, step) in self.steps.iter().enumerate() {
            assert_eq!(
                step.status,
                Status::Converged,
                "{name}, step {number}: {:?}",
                step.kkt
            );
            self.check_step(name, number);
        }
    }

    /// The steps as Tresca problems with their final slip bounds.
    pub fn given(&self) -> Vec<(StepSolution<3>, Vec<usize>)> {
        let problem = &self.built.problem;
        let mut engine = engine(problem, Stiffness::Cholesky);
        let all = self.steps.iter().zip(&self.loads).enumerate();
        all.map(|(number, (step, load))| {
            let (force, gap) = (load.force.clone(), load.gap.clone());
            let zero = vec![0.0; problem.slip_origin().len()];
            let given = problem
                .with_data(force, gap, zero, step.slip_bound.clone())
                .and_then(|problem| problem.with_friction_coefficient(Vec::new()))
                .or_panic();
            let start = self.start(number);
            counted(&given, load, &start, &mut engine, &StepSettings::default())
        })
        .collect()
    }
}

/// Solves a model, checks it, and compares its cost with that of the problem with its slip bounds given: products to
/// [`ERRORS`] and in all, of both.
pub fn priced(name: &str, model: Model<3>) -> [Vec<usize>; 2] {
    let run = Run::new(model, Stiffness::Cholesky, &StepSettings::default());
    let given = run.given();
    let mut costs = [vec![0; 3], vec![0; 3]];
    for (number, (step, (tresca, tresca_met))) in run.steps.iter().zip(&given).enumerate() {
        for (cost, (step, met)) in costs
            .iter_mut()
            .zip([(step, &run.met[number]), (tresca, tresca_met)])
        {
            for k in 0..2 {
                cost[k] += met.get(k).copied().unwrap_or(step.n_a());
            }
            cost[2] += step.n_a();
        }
    }
    let step = run.last();
    let problem = &run.built.problem;
    let sizes = step.sets.sizes(|i| problem.has_friction(i));
    println!(
        "{name}: m {} (separated {}, stick {}) {:?} {:?} in {} steps ({} solves), given {:?} in {}",
        problem.m(),
        sizes.separated,
        sizes.stick,
        step.status,
        costs[0],
        step.iter(),
        step.rounds.len(),
        costs[1],
        given.last().map_or(0, |made| made.0.iter()),
    );
    run.check(name);
    costs
}

/// At most 60 | 80 products, and 1.3 times those of the Tresca problem with its bounds.
pub fn few_products(
    all: impl IntoIterator<Item = (String, Model<3>)>,
    most: [usize; 2],
    ratio: f64,
) {
    let mut sums = [0; 2];
    for (name, model) in all {
        let [coulomb, given] = priced(&name, model);
        assert!(
            coulomb[0] <= most[0] && coulomb[1] <= most[1],
            "{name}: {coulomb:?}"
        );
        sums[0] += coulomb[1];
        sums[1] += given[1];
    }
    println!("in all {} of {}", sums[0], sums[1]);
    assert!(sums[0] as f64 <= ratio * sums[1] as f64, "{sums:?}");
}
