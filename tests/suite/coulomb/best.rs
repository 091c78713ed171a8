//! However a step ends under Coulomb's law, its end is the best point met, and all reported figures are those of that
//! law.

use crate::common::or_panic::OrPanic as _;
use signorini::dual::DirectDual;
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::{self, Load, State, StepSettings};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::{self, NewtonSettings};
use std::ops::ControlFlow;

const NODES: usize = 30;
const MU: f64 = 0.6;

/// Numbers without any pattern, between −1 and 1.
fn arbitrary(i: usize, j: usize) -> f64 {
    let x = ((12.9898 * i as f64 + 78.233 * j as f64).sin() * 43758.5453).fract();
    if x < 0.0 {
        2.0 * x + 1.0
    } else {
        2.0 * x - 1.0
    }
}

/// The rows of B = (G, 0.03 I), node by node with the normal one first, where K = I: A = GGᵀ + 1e-3 I has a third of its rank, as
/// stacks of stiff bodies have.
fn row(i: usize) -> Vec<f64> {
    let of_g = (0..NODES).map(|j| 2.0 * arbitrary(i, j));
    let own = (0..3 * NODES).map(|j| if i == j { 0.03 } else { 0.0 });
    of_g.chain(own).collect()
}

/// Overlap and slip that bring all about.
fn driven(i: usize) -> f64 {
    arbitrary(i, 1000) + if i.is_multiple_of(3) { 1.0 } else { 0.0 }
}

fn problem() -> ContactProblem<3> {
    let n = 4 * NODES;
    let rows = |which: &dyn Fn(usize) -> bool| {
        let all: Vec<usize> = (0..3 * NODES).filter(|&i| which(i)).collect();
        let entries = all.iter().enumerate().flat_map(|(place, &i)| {
            let entries = row(i).into_iter().enumerate();
            entries.map(move |(j, v)| (place, j, v)).collect::<Vec<_>>()
        });
        Csr::from_triplets(all.len(), n, entries)
    };
    let of = |which: &dyn Fn(usize) -> bool| -> Vec<f64> {
        let all = (0..3 * NODES).filter(|&i| which(i));
        all.map(|i| -driven(i)).collect()
    };
    ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(n, n, (0..n).map(|i| (i, i, 1.0))),
        load: vec![0.0; n],
        normal: rows(&|i| i % 3 == 0),
        tangential: rows(&|i| i % 3 != 0),
        gap: vec![0.0; NODES],
        slip_bound: vec![0.0; NODES],
        coordinates: None,
    })
    .and_then(|problem| problem.with_friction_coefficient(vec![MU; NODES]))
    .and_then(|problem| problem.with_gap(of(&|i| i % 3 == 0)))
    .and_then(|problem| problem.with_slip_origin(of(&|i| i % 3 != 0)))
    .or_panic()
}

/// The change of λ in a step of length ρ against Aλ − b that is projected to λν ≥ 0 and then to the disc of μλν; divided by ρ.
fn off(lambda: &[f64], rho: f64) -> f64 {
    let rows: Vec<Vec<f64>> = (0..3 * NODES).map(row).collect();
    let force = |i: usize| match i % 3 {
        0 => lambda[i / 3],
        a => lambda[NODES + 2 * (i / 3) + a - 1],
    };
    let mut u = vec![0.0; 4 * NODES];
    for (i, row) in rows.iter().enumerate() {
        u.iter_mut().zip(row).for_each(|(u, v)| *u += v * force(i));
    }
    let moved = |i: usize| {
        let product: f64 = rows[i].iter().zip(&u).map(|(v, u)| v * u).sum();
        force(i) - rho * (product - driven(i))
    };
    let mut sum = 0.0;
    for node in 0..NODES {
        let [normal, t, s] = [0, 1, 2].map(|a| 3 * node + a);
        sum += (moved(normal).max(0.0) - force(normal)).powi(2);
        let (length, g) = (moved(t).hypot(moved(s)), MU * force(normal).max(0.0));
        let shrunk = if length > g { g / length } else { 1.0 };
        sum += [t, s]
            .map(|i| (shrunk * moved(i) - force(i)).powi(2))
            .iter()
            .sum::<f64>();
    }
    sum.sqrt() / rho
}

#[test]
fn the_end_of_a_step_is_its_best_point() {
    let problem = problem();
    for max_iterations in [5, 12, 30, 60] {
        let ssnm = NewtonSettings {
            tolerance: 1e-10,
            max_iterations,
            ..NewtonSettings::default()
        };
        let mut dual = DirectDual::new(&problem).or_panic();
        let go_on = |_: &ssnm::Step| ControlFlow::Continue(());
        let alone = ssnm::solve(&problem, &mut dual, &ssnm, go_on).or_panic();
        let settings = StepSettings { ssnm };
        let step = quasistatic::solve_step(
            &problem,
            &Load::of(&problem),
            &State::at_rest(&problem),
            &mut dual,
            &settings,
            &mut Default::default(),
            |_| ControlFlow::Continue(()),
        )
        .or_panic();
        let what = format!("{max_iterations} steps: {:?}", step.status);
        let rho = 1.0 / alone.info.sigma_max;
        let [found, before] = [&step.lambda, &alone.lambda].map(|lambda| off(lambda, rho));
        println!(
            "{what}: {found:.2e}, {before:.2e} by the method alone, {:.2e}",
            step.last().info.err_relative
        );
        // Figures of u and of λ, and the least of either, need not fall together.
        assert!(
            found <= 3.0 * before + 1e-10,
            "{what}: {found:e} after {before:e}"
        );
        // The scale at the end: the error without forces, or the effect of forces on their own nodes.
        let own = (0..3 * NODES).map(|i| {
            let force = match i % 3 {
                0 => step.lambda[i / 3],
                a => step.lambda[NODES + 2 * (i / 3) + a - 1],
            };
            (row(i).iter().map(|v| v * v).sum::<f64>() * force).powi(2)
        });
        let size = off(&vec![0.0; 3 * NODES], rho).max(own.sum::<f64>().sqrt());
        let (said, relative) = (step.last().info.err_relative, found / size);
        let alike = relative <= 5.0 * said && said <= 5.0 * relative;
        assert!(
            alike || relative < 1e-11,
            "{what}: {said:e} for {relative:e}"
        );
        let (normal, tangential) = step.lambda.split_at(NODES);
        let beyond = normal
            .iter()
            .zip(tangential.chunks(2))
            .map(|(n, t)| t[0].hypot(t[1]) - MU * n);
        let beyond = beyond.fold(0.0, f64::max) / (MU * normal.iter().copied().fold(0.0, f64::max));
        assert!(
            (beyond - step.kkt.friction_bound).abs() <= 1e-9,
            "{what}: {beyond:e}"
        );
        assert_eq!(step.kkt, step.last().info.kkt, "{what}");
    }
}
