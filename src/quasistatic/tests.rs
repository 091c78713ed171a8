//! Tests of load steps: data passed between them, errors that keep results so far.

use super::*;
use crate::control::{Accuracy, Stop};
use crate::dual::{DirectDual, DualError, Request};
use crate::problem::ContactData;
use crate::sparse::{BlockCsr, Csr, norm_max};
use crate::stiffness::cholesky::FactorError;

/// Two springs in a row, the outer one pushed to a wall that rubs on both.
fn springs(nodes: usize) -> ContactProblem {
    let one = |j: usize| Csr::from_triplets(1, 2 * nodes, [(0, j, 1.0)]);
    let chain = (0..2 * nodes).flat_map(|i| {
        let next = (i + 1 < 2 * nodes).then_some((i, i + 1, -1.0));
        let before = i.checked_sub(1).map(|j| (i, j, -1.0));
        [Some((i, i, 2.0)), next, before].into_iter().flatten()
    });
    let mut load = vec![0.0; 2 * nodes];
    load[1] = 5.0;
    let problem = ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(2 * nodes, 2 * nodes, chain),
        load,
        normal: one(1),
        tangential: one(0),
        gap: vec![1.0],
        slip_bound: vec![0.0],
        coordinates: None,
    });
    let problem = problem.unwrap_or_else(|error| panic!("{error}"));
    (problem.with_friction_coefficient(vec![0.1])).unwrap_or_else(|error| panic!("{error}"))
}

/// Fails after this many displacements.
struct Failing(DirectDual, usize);

impl DualOperator for Failing {
    fn size(&self) -> (usize, usize) {
        self.0.size()
    }
    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        self.0.apply(p, y, accuracy, stop)
    }
    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.0.restrict(u, y);
    }
    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        if self.1 == 0 {
            return Err(FactorError::TooLarge.into());
        }
        self.1 -= 1;
        self.0.displacement(request)
    }
    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        self.0.stiffness_times(u, s)
    }
}

fn solve(
    problem: &ContactProblem,
    load: &Load,
    dual: &mut impl DualOperator,
    settings: &StepSettings,
) -> Result<StepSolution, StepError> {
    let start = State::at_rest(problem);
    let go_on = |_: Event| ControlFlow::Continue(());
    solve_step(
        problem,
        load,
        &start,
        dual,
        settings,
        &mut Default::default(),
        go_on,
    )
}

fn direct(problem: &ContactProblem) -> DirectDual {
    DirectDual::new(problem).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn an_error_keeps_lambda() {
    let problem = springs(1);
    let (load, settings) = (Load::of(&problem), StepSettings::default());
    let error = solve(
        &problem,
        &load,
        &mut Failing(direct(&problem), 0),
        &settings,
    );
    let error = error.map(|_| ()).expect_err("it fails");
    assert!(matches!(error.error.cause, Cause::Operator(_)), "{error}");
    assert!(error.rounds.is_empty());
    assert_eq!(error.error.lambda.len(), 2);
}

#[test]
fn misfits_are_errors() {
    let (problem, other) = (springs(1), springs(2));
    let good = StepSettings::default();
    let load = Load::of(&problem);
    let said = |load: &Load, dual: &mut DirectDual, settings: &StepSettings| {
        let outcome = solve(&problem, load, dual, settings);
        outcome.map(|_| ()).expect_err("it is wrong").to_string()
    };
    let text = said(&load, &mut direct(&other), &good);
    assert!(
        text.contains("another problem, with 4 rows of K and 2"),
        "{text}"
    );
    let mut dual = direct(&problem);
    let text = said(&Load::of(&other), &mut dual, &good);
    assert_eq!(text, "load.force must have 2 entries, it has 4");
    let mut infinite = load.clone();
    infinite.gap[0] = f64::NAN;
    assert_eq!(
        said(&infinite, &mut dual, &good),
        "load.gap must have finite entries"
    );
    let initial = [0.0; 3];
    let start = WarmStart {
        lambda: Some(&initial),
        ..Default::default()
    };
    let go_on = |_: &Step| ControlFlow::Continue(());
    let error = ssnm::solve_from(start, &problem, &mut dual, &good.ssnm, go_on).map(|_| ());
    let text = error.expect_err("it is wrong").to_string();
    assert_eq!(text, "start.lambda must have 2 entries, it has 3");
}

/// Springs on the motions of a block: the operator is that of K + k R Rᵀ, and rests where it was put.
#[test]
fn a_block_on_springs() {
    use crate::contact::Obstacle;
    use crate::dense;
    use crate::elasticity::Material;
    use crate::mesh::structured::{CellShape, rectangle};
    use crate::model::{Model, Pair};
    use faer::Mat;

    let mesh = rectangle([0.0; 2], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    let ground = Obstacle::HalfSpace {
        point: [0.0; 2],
        normal: [0.0, 1.0],
    };
    let material = Material::new(10.0, 0.3);
    let built = Model::on(mesh)
        .material(material)
        .contact(Pair::obstacle("bottom", ground).coulomb(0.3))
        .build()
        .unwrap_or_else(|error| panic!("{error}"));
    let problem = built.problem.elsewhere();
    let (free, b) = (problem.floating_bodies(), problem.contact_matrix());
    let (n, stiffness) = (problem.n_rows(), 0.01);
    assert_eq!(free.n_modes(), 3);
    let motions: Vec<Vec<f64>> = (0..3)
        .map(|j| {
            let mut motion = vec![0.0; n];
            let unit: Vec<f64> = (0..3).map(|k| f64::from(u8::from(j == k))).collect();
            free.add_motion(&unit, &mut motion);
            motion
        })
        .collect();
    let mut k = Mat::from_fn(n, n, |i, j| {
        stiffness * motions.iter().map(|r| r[i] * r[j]).sum::<f64>()
    });
    for i in 0..n / 2 {
        let (cols, blocks) = built.problem.stiffness().row(i);
        for (&j, block) in cols.iter().zip(blocks) {
            for (a, row) in block.iter().enumerate() {
                for (c, v) in row.iter().enumerate() {
                    k[(2 * i + a, 2 * j as usize + c)] += v;
                }
            }
        }
    }
    let close = |found: &[f64], expected: &[f64]| {
        let size = norm_max(expected);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9 * size, "{found} {expected}");
        }
    };
    let mut dual = direct(&built.problem);
    let mut on_springs = OnSprings::new(&mut dual, &problem, stiffness);
    let p: Vec<f64> = (0..b.n_rows()).map(|i| (i as f64).sin()).collect();
    let mut forces = vec![0.0; n];
    b.mul_transpose_add(1.0, &p, &mut forces);
    let (mut found, mut expected) = (vec![0.0; p.len()], vec![0.0; p.len()]);
    let exact = Accuracy::Residual(1e-12);
    on_springs
        .apply(&p, &mut found, exact, &Stop::default())
        .unwrap_or_else(|error| panic!("{error}"));
    let u = dense::solve(k.clone(), &forces);
    b.mul(&u, &mut expected);
    close(&found, &expected);
    // K u of the result gives the forces again.
    let product = on_springs.stiffness_times(&u, &u);
    close(
        &product.unwrap_or_else(|error| panic!("{error}"))[0],
        &forces,
    );
    // Without any load, it stays in its place.
    let place = [0.3, -0.2, 0.1];
    let rests = on_springs.problem(&place);
    assert!(rests.floating_bodies().is_empty());
    let (force, none) = (rests.load_case().force(), vec![0.0; p.len()]);
    let (exact, stop) = (Accuracy::Residual(0.0), Stop::default());
    let u = on_springs.displacement(&Request::new(force, &none, exact, &stop));
    let mut there = vec![0.0; n];
    free.add_motion(&place, &mut there);
    close(&u.unwrap_or_else(|error| panic!("{error}")), &there);
}
