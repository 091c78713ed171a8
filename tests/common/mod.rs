//! What several test files need.
#![allow(dead_code)]

pub mod cases;
pub mod checker;
pub mod half_space;
pub mod models;
pub mod published;
pub mod runs;
pub mod space;

use signorini::backend::cpu::Cpu;
use signorini::case::Case;
use signorini::control::Costs;
use signorini::dual::DirectDual;
use signorini::dual::{DualOperator, NestedDual};
use signorini::model::{Built, Elastic, StepData};
use signorini::output::ContactFields;
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::{self, State, StepSolution};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::{self, SetSizes, Settings, Solution, Status};
use signorini::stiffness::pcg::Preconditioner;
use std::ops::ControlFlow;
use std::path::Path;

/// A small generator of pseudo-random numbers: the tests must not change from run to run.
pub struct Random(pub u64);

impl Random {
    /// Uniform in [0, 1).
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
}

/// What a contact node of a manufactured problem does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    pub separated: bool,
    /// −1, 0 (stick), +1.
    pub slip: i8,
}

/// A contact problem with its solution (validation by construction).
pub struct Manufactured {
    pub problem: ContactProblem,
    pub u: Vec<f64>,
    pub lambda: Vec<f64>,
    pub nodes: Vec<Node>,
}

/// Chooses u*, λ* and the sets, then f, d and g so that (1)–(3) hold with strict complementarity.
///
/// K is the matrix of a random network of springs, held to the ground here and there, on `n` unknowns;
/// B selects unknowns, or has general sparse rows.
pub fn manufactured(n: usize, nodes: &[Node], general: bool, random: &mut Random) -> Manufactured {
    let m = nodes.len();
    assert!(2 * m <= n);
    let mut entries = Vec::new();
    for i in 0..n {
        entries.push((i, i, if random.unit() < 0.1 { 1.0 } else { 1e-2 }));
        for _ in 0..3 {
            let j = random.below(n);
            if i != j {
                let k = random.between(0.1, 2.0);
                entries.extend([(i, i, k), (j, j, k), (i, j, -k), (j, i, -k)]);
            }
        }
    }
    let k = BlockCsr::<2>::from_triplets(n, n, entries);
    let mut u: Vec<f64> = (0..n).map(|_| random.between(-1.0, 1.0)).collect();
    // Any m + m different unknowns.
    let mut order: Vec<usize> = (0..n).collect();
    for i in 0..n {
        order.swap(i, i + random.below(n - i));
    }
    let mut row = |pivot: usize| -> Vec<(usize, f64)> {
        let mut row = vec![(pivot, 1.0)];
        if general {
            // The pivots are dominant, so that B has full row rank.
            for _ in 0..3 {
                let j = random.below(n);
                if row.iter().all(|&(i, _)| i != j) {
                    row.push((j, random.between(-0.2, 0.2)));
                }
            }
        }
        row
    };
    let normal: Vec<_> = (0..m).map(|i| row(order[i])).collect();
    let tangential: Vec<_> = (0..m).map(|i| row(order[m + i])).collect();
    let times = |row: &[(usize, f64)], u: &[f64]| row.iter().map(|&(j, v)| v * u[j]).sum::<f64>();
    // d ≥ 0 asks for N u* ≥ 0 in contact, sticking for T u* = 0: sweeps over the pivots arrange both.
    for _ in 0..200 {
        for (i, node) in nodes.iter().enumerate() {
            let now = times(&normal[i], &u);
            if now < 0.1 {
                u[order[i]] += 0.1 + 0.5 * (i % 3) as f64 - now;
            }
            let now = times(&tangential[i], &u);
            match node.slip {
                0 => u[order[m + i]] -= now,
                s if now * f64::from(s) < 0.1 => u[order[m + i]] += 0.3 * f64::from(s) - now,
                _ => {}
            }
        }
    }
    let mut lambda = vec![0.0; 2 * m];
    let (mut d, mut g) = (vec![0.0; m], vec![0.0; m]);
    for (i, node) in nodes.iter().enumerate() {
        d[i] = times(&normal[i], &u);
        if node.separated {
            d[i] += random.between(0.1, 1.0);
        } else {
            lambda[i] = random.between(0.2, 2.0);
        }
        g[i] = random.between(0.2, 2.0);
        lambda[m + i] = match node.slip {
            0 => random.between(-0.8, 0.8) * g[i],
            s => f64::from(s) * g[i],
        };
    }
    let size = k.n_rows();
    let mut f = vec![0.0; size];
    let mut padded = u.clone();
    padded.resize(size, 0.0);
    k.mul(&padded, &mut f);
    f.truncate(n);
    for (i, rows) in normal.iter().chain(&tangential).enumerate() {
        for &(j, v) in rows {
            f[j] += v * lambda[i];
        }
    }
    let matrix = |rows: &[Vec<(usize, f64)>]| {
        let entries = rows
            .iter()
            .enumerate()
            .flat_map(|(i, row)| row.iter().map(move |&(j, v)| (i, j, v)));
        Csr::from_triplets(m, n, entries)
    };
    let problem = ContactProblem::new(ContactData {
        stiffness: k,
        load: f,
        normal: matrix(&normal),
        tangential: matrix(&tangential),
        gap: d,
        slip_bound: g,
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"));
    Manufactured {
        problem,
        u,
        lambda,
        nodes: nodes.to_vec(),
    }
}

/// Solves on the direct path.
pub fn solve(problem: &ContactProblem, settings: &Settings) -> Solution {
    let mut dual = DirectDual::new(problem).unwrap_or_else(|error| panic!("{error}"));
    ssnm::solve(problem, &mut dual, settings, |_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"))
}

/// Solves with PCG on the CPU; also returns what that has cost, and the iterations of one K x = f to 1e-8.
pub fn solve_nested(problem: &ContactProblem, settings: &Settings) -> (Solution, Costs, usize) {
    let mut dual = NestedDual::new(problem, Cpu::<f32>::default(), Preconditioner::Multigrid)
        .unwrap_or_else(|error| panic!("{error}"));
    let solution = ssnm::solve(problem, &mut dual, settings, |_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"));
    let costs = dual.costs().expect("the nested path counts");
    let linear = dual
        .linear_iterations(1e-8)
        .unwrap_or_else(|error| panic!("{error}"))
        .expect("it iterates");
    (solution, costs, linear)
}

/// max |a − b| / max |b|.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let scale = b.iter().fold(1e-300, |s: f64, v| s.max(v.abs()));
    a.iter()
        .zip(b)
        .fold(0.0, |d: f64, (a, b)| d.max((a - b).abs()))
        / scale
}

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

    /// Where a contact node lies.
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

/// Reads a case whose files lie beside the tests.
pub fn case(text: &str) -> Case {
    Case::parse(Path::new("tests/case.toml"), text.to_owned(), &[])
        .unwrap_or_else(|error| panic!("{error}"))
}

/// The model of an elastic case in the plane.
pub fn built(case: &Case) -> Built {
    let made = case.build().unwrap_or_else(|error| panic!("{error}"));
    made.plane().expect("an elastic case in the plane")
}

/// All load steps of a case, each of which has to converge.
pub fn run_steps(
    case: &Case,
    build: &Built,
    dual: &mut dyn DualOperator,
    settings: &quasistatic::Settings,
) -> (StepData, Vec<StepSolution>) {
    let mut state = State::at_rest(&build.problem);
    let mut steps = Vec::new();
    let mut last = None;
    for number in 0..case.n_steps() {
        let data = build.step(number).unwrap_or_else(|error| panic!("{error}"));
        let solution = quasistatic::solve_step(
            &build.problem,
            &data.load,
            &state,
            dual,
            settings,
            &mut Default::default(),
            |_| ControlFlow::Continue(()),
        )
        .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(solution.status, Status::Converged);
        state = solution.state(&data.load);
        steps.push(solution);
        last = Some(data);
    }
    (last.expect("a case has a step"), steps)
}

/// Products with A of a case with Coulomb friction, of the same steps with the slip bounds given that it ends with,
/// and of rounds alone; all on the direct path and from the same states.
pub fn price_of_coulomb(case: &Case, tolerance: f64) -> [usize; 3] {
    let build = built(&case);
    let problem = &build.problem;
    let mut dual = DirectDual::new(problem).unwrap_or_else(|error| panic!("{error}"));
    let mut settings = case.settings();
    settings.ssnm.tolerance = tolerance;
    let mut state = State::at_rest(problem);
    let mut products = [0; 3];
    for number in 0..case.n_steps() {
        let data = build.step(number).unwrap_or_else(|error| panic!("{error}"));
        let mut run = |problem: &ContactProblem, coupled: bool| {
            let settings = quasistatic::Settings {
                coupled,
                ..settings.clone()
            };
            let solution = quasistatic::solve_step(
                problem,
                &data.load,
                &state,
                &mut dual,
                &settings,
                &mut Default::default(),
                |_| ControlFlow::Continue(()),
            )
            .unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(solution.status, Status::Converged);
            solution
        };
        let solution = run(problem, true);
        let zero = vec![0.0; problem.m()];
        let given = problem
            .with_data(
                data.load.force.clone(),
                data.load.gap.clone(),
                zero,
                solution.slip_bound.clone(),
            )
            .and_then(|problem| problem.with_friction_coefficient(Vec::new()))
            .unwrap_or_else(|error| panic!("{error}"));
        let runs = [&solution, &run(&given, true), &run(problem, false)];
        for (sum, run) in products.iter_mut().zip(runs) {
            assert!(distance(&run.u, &solution.u) < 1e3 * tolerance);
            *sum += run.n_a();
        }
        state = solution.state(&data.load);
    }
    let [coulomb, tresca, rounds] = products;
    println!(
        "{coulomb} products under Coulomb's law, {tresca} with its slip bounds given, {rounds} by rounds"
    );
    products
}

/// Solves a case on the direct path.
pub fn solve_case(text: &str, tolerance: f64) -> Solved {
    let case = case(text);
    let build = built(&case);
    let mut dual = DirectDual::new(&build.problem).unwrap_or_else(|error| panic!("{error}"));
    let mut settings = case.settings();
    settings.ssnm.tolerance = tolerance;
    let (data, steps) = run_steps(&case, &build, &mut dual, &settings);
    Solved { build, data, steps }
}

/// As [`solve_case`], and once more by iterations, which has to come to the same.
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
    .unwrap_or_else(|error| panic!("{error}"));
    let (_, steps) = run_steps(&case, &solved.build, &mut dual, &settings);
    let apart = distance(&steps.last().expect("a step").u, &solved.solution().u);
    assert!(apart < 100.0 * tolerance, "{apart:e}");
    solved
}
