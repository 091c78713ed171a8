//! Elastic cases in the plane, solved step by step.

use super::distance;
use crate::common::or_panic::OrPanic as _;
use signorini::backend::cpu::Cpu;
use signorini::case::Case;
use signorini::dual::{DirectDual, DualOperator, NestedDual};
use signorini::model::Built;
use signorini::model::{Elastic, StepData};
use signorini::output::ContactFields;
use signorini::problem::ContactProblem;
use signorini::quasistatic::{self, State, StepSolution};
use signorini::ssnm::{SetSizes, Status};
use signorini::stiffness::pcg::Preconditioner;
use std::ops::ControlFlow;
use std::path::Path;

/// An elastic case, solved.
pub struct Solved {
    pub build: Built,
    /// The load of the last step.
    pub data: StepData,
    /// The end of each step.
    pub steps: Vec<StepSolution>,
}

impl Solved {
    pub fn elastic(&self) -> &Elastic {
        &self.build.elastic
    }

    pub fn solution(&self) -> &StepSolution {
        self.steps.last().expect("a case has a step")
    }

    /// The sets at the end.
    pub fn sizes(&self) -> SetSizes {
        let problem = &self.build.problem;
        self.solution().sets.sizes(|i| problem.has_friction(i))
    }

    pub fn fields(&self) -> ContactFields {
        ContactFields::new(
            &self.build.problem,
            self.elastic(),
            &self.data,
            self.solution(),
        )
    }

    /// Displacement of every node.
    pub fn displacement(&self) -> Vec<[f64; 2]> {
        self.data.unknowns.displacements(&self.solution().u)
    }

    /// The position of a contact node.
    pub fn place(&self, i: usize) -> [f64; 2] {
        self.elastic().contact.places[i].place
    }

    /// The node of the mesh at a point.
    pub fn node_at(&self, point: [f64; 2]) -> usize {
        let apart = |x: &[f64; 2]| (x[0] - point[0]).abs() + (x[1] - point[1]).abs();
        let nodes = &self.elastic().mesh.nodes;
        (0..nodes.len())
            .min_by(|&a, &b| apart(&nodes[a]).total_cmp(&apart(&nodes[b])))
            .filter(|&node| apart(&nodes[node]) < 1e-9)
            .unwrap_or_else(|| panic!("no node at {point:?}"))
    }
}

/// What is wrong with the text of a case, or with what it says of its mesh.
pub fn refusal(text: &str) -> String {
    let built = match Case::parse(Path::new("case.toml"), text.to_owned(), &[]) {
        Ok(case) => case.build().map_err(|error| error.to_string()),
        Err(error) => Err(error.to_string()),
    };
    match built {
        Ok(_) => panic!("this was accepted:\n{text}"),
        Err(error) => error,
    }
}

/// Reads a case whose files are beside the tests.
pub fn case(text: &str) -> Case {
    Case::parse(Path::new("tests/case.toml"), text.to_owned(), &[]).or_panic()
}

/// The model of an elastic case in the plane.
pub fn built(case: &Case) -> Built {
    let made = case.build().or_panic();
    made.plane().expect("an elastic case in the plane")
}

/// All load steps of a case, each of which has to converge.
pub fn run_steps(
    case: &Case,
    build: &Built,
    dual: &mut dyn DualOperator,
    settings: &quasistatic::StepSettings,
) -> (StepData, Vec<StepSolution>) {
    let mut state = State::at_rest(&build.problem);
    let mut steps = Vec::new();
    let mut last = None;
    for number in 0..case.n_steps() {
        let data = build.step(number).or_panic();
        let solution = quasistatic::solve_step(
            &build.problem,
            &data.load,
            &state,
            dual,
            settings,
            &mut Default::default(),
            |_| ControlFlow::Continue(()),
        )
        .or_panic();
        assert_eq!(solution.status, Status::Converged);
        state = solution.state(&data.load);
        steps.push(solution);
        last = Some(data);
    }
    (last.expect("a case has a step"), steps)
}

/// Products with A of a case with Coulomb friction, and of the same steps with its final slip bounds given, on the direct path
/// and from the same states.
pub fn price_of_coulomb(case: &Case, tolerance: f64) -> [usize; 2] {
    let build = built(case);
    let problem = &build.problem;
    let mut dual = DirectDual::new(problem).or_panic();
    let mut settings = case.settings();
    settings.ssnm.tolerance = tolerance;
    let mut state = State::at_rest(problem);
    let mut products = [0; 2];
    for number in 0..case.n_steps() {
        let data = build.step(number).or_panic();
        let mut run = |problem: &ContactProblem| {
            let solution = quasistatic::solve_step(
                problem,
                &data.load,
                &state,
                &mut dual,
                &settings,
                &mut Default::default(),
                |_| ControlFlow::Continue(()),
            )
            .or_panic();
            assert_eq!(solution.status, Status::Converged);
            solution
        };
        let solution = run(problem);
        let zero = vec![0.0; problem.m()];
        let given = problem
            .with_data(
                data.load.force.clone(),
                data.load.gap.clone(),
                zero,
                solution.slip_bound.clone(),
            )
            .and_then(|problem| problem.with_friction_coefficient(Vec::new()))
            .or_panic();
        let runs = [&solution, &run(&given)];
        for (sum, run) in products.iter_mut().zip(runs) {
            assert!(distance(&run.u, &solution.u) < 1e3 * tolerance);
            *sum += run.n_a();
        }
        state = solution.state(&data.load);
    }
    let [coulomb, tresca] = products;
    println!("{coulomb} products under Coulomb's law, {tresca} with its slip bounds given");
    products
}

/// Solves a case on the direct path.
pub fn solve_case(text: &str, tolerance: f64) -> Solved {
    let case = case(text);
    let build = built(&case);
    let mut dual = DirectDual::new(&build.problem).or_panic();
    let mut settings = case.settings();
    settings.ssnm.tolerance = tolerance;
    let (data, steps) = run_steps(&case, &build, &mut dual, &settings);
    Solved { build, data, steps }
}

/// Like [`solve_case`], and once more by iterations, which must give the same.
pub fn solve_case_twice(text: &str, tolerance: f64) -> Solved {
    let solved = solve_case(text, tolerance);
    let case = case(text);
    let mut settings = case.settings();
    settings.ssnm.tolerance = tolerance;
    let mut dual = NestedDual::new(
        &solved.build.problem,
        Cpu::<f32>::default(),
        Preconditioner::Multigrid,
    )
    .or_panic();
    let (_, steps) = run_steps(&case, &solved.build, &mut dual, &settings);
    let apart = distance(&steps.last().expect("a step").u, &solved.solution().u);
    assert!(apart < 100.0 * tolerance, "{apart:e}");
    solved
}
