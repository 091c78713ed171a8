//! A problem solved on a path.

use crate::common::or_panic::OrPanic as _;
use signorini::backend::cpu::Cpu;
use signorini::control::Costs;
use signorini::dual::DualOperator as _;
use signorini::dual::{DirectDual, NestedDual};
use signorini::engine::{Device, Engine, EngineOptions, Stiffness};
use signorini::problem::ContactProblem;
use signorini::ssnm::{self, NewtonSettings, Solution};
use signorini::stiffness::pcg::Preconditioner;
use std::ops::ControlFlow;

/// The engine on the CPU.
pub fn engine<const D: usize>(problem: &ContactProblem<D>, stiffness: Stiffness) -> Engine {
    let options = EngineOptions {
        place: Device::Cpu,
        stiffness,
        ..Default::default()
    };
    Engine::new(problem, options, |_| {}).or_panic()
}

/// Solves with an engine on the CPU.
pub fn solve_on<const D: usize>(
    problem: &ContactProblem<D>,
    stiffness: Stiffness,
    settings: &NewtonSettings,
) -> Solution<D> {
    let mut engine = engine(problem, stiffness);
    let go_on = |_: &ssnm::Step| ControlFlow::Continue(());
    ssnm::solve(problem, &mut engine, settings, go_on).or_panic()
}

/// Solves on the direct path.
pub fn solve(problem: &ContactProblem, settings: &NewtonSettings) -> Solution {
    let mut dual = DirectDual::new(problem).or_panic();
    ssnm::solve(problem, &mut dual, settings, |_| ControlFlow::Continue(())).or_panic()
}

/// Solves with PCG on the CPU; also returns the costs, and the iterations of one K x = f to 1e-8.
pub fn solve_nested<const D: usize>(
    problem: &ContactProblem<D>,
    settings: &NewtonSettings,
) -> (Solution<D>, Costs, usize) {
    let mut dual =
        NestedDual::new(problem, Cpu::<f32>::default(), Preconditioner::Multigrid).or_panic();
    let solution =
        ssnm::solve(problem, &mut dual, settings, |_| ControlFlow::Continue(())).or_panic();
    let costs = dual.costs().expect("the nested path counts");
    let linear = dual
        .linear_iterations(1e-8)
        .or_panic()
        .expect("it iterates");
    (solution, costs, linear)
}
