//! Each row has its own accuracy: gaps, slip bounds, origins of slip and bodies of any size leave other rows as they are. K is
//! diagonal in most of these, so that the right answers are known by hand.

use crate::common::or_panic::OrPanic as _;
use crate::common::random::Random;
use crate::common::runs::Way;
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::{self, Load, State, StepSettings, StepSolution};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::Status;
use std::ops::ControlFlow;

const WAYS: [Way; 2] = [Way::Cholesky, Way::Pcg];

/// Nodes on springs of these stiffnesses under these forces, a normal and a tangential unknown each.
fn on_springs(stiffness: &[f64], load: &[f64], gap: &[f64], slip_bound: &[f64]) -> ContactProblem {
    let (n, m) = (load.len(), gap.len());
    let rows = |first: usize| Csr::from_triplets(m, n, (0..m).map(|i| (i, 2 * i + first, 1.0)));
    ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(n, n, (0..n).map(|i| (i, i, stiffness[i]))),
        load: load.to_vec(),
        normal: rows(0),
        tangential: rows(1),
        gap: gap.to_vec(),
        slip_bound: slip_bound.to_vec(),
        coordinates: None,
    })
    .or_panic()
}

fn step(problem: &ContactProblem, start: &State, way: Way) -> StepSolution {
    quasistatic::solve_step(
        problem,
        &Load::of(problem),
        start,
        &mut *way.dual(problem).or_panic(),
        &StepSettings::default(),
        &mut Default::default(),
        |_| ControlFlow::Continue(()),
    )
    .or_panic()
}

/// Solves by both ways, and compares u and λ with the expected ones.
fn check(what: &str, problem: &ContactProblem, u: &[f64], lambda: &[f64]) {
    for way in WAYS {
        let what = format!("{what}, {}", way.name());
        let found = step(problem, &State::at_rest(problem), way);
        assert_eq!(found.status, Status::Converged, "{what}");
        for (found, expected) in [(&found.u, u), (&found.lambda, lambda)] {
            let largest = expected.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            let off = found
                .iter()
                .zip(expected)
                .map(|(a, b)| (a - b).abs() / (1e-9 * b.abs()).max(1e-12 * largest));
            let off = off.fold(0.0, f64::max);
            assert!(off <= 1.0, "{what}: {found:?} for {expected:?}");
        }
    }
}

#[test]
fn an_unreachable_gap_leaves_others_alone() {
    for far in [
        1.0,
        1e6,
        1e9,
        1e12,
        1e14,
        1e16,
        1e30,
        1e100,
        1e300,
        f64::INFINITY,
    ] {
        let problem = on_springs(&[1.0; 4], &[1.0, 0.0, 0.5, 0.0], &[0.1, far], &[0.0; 2]);
        check(
            &format!("{far:e}"),
            &problem,
            &[0.1, 0.0, 0.5, 0.0],
            &[0.9, 0.0, 0.0, 0.0],
        );
        // In the units of a block of steel.
        let problem = on_springs(&[1e11; 4], &[1e5, 0.0, 0.0, 0.0], &[1e-7, far], &[0.0; 2]);
        check(
            &format!("{far:e}, steel"),
            &problem,
            &[1e-7, 0.0, 0.0, 0.0],
            &[9e4, 0.0, 0.0, 0.0],
        );
    }
}

#[test]
fn an_unreachable_bound_never_slips_and_leaves_others_alone() {
    let load = [1.0, 0.5, 1.0, -0.5];
    for large in [1.0, 1e9, 1e30, 1e300, f64::INFINITY] {
        let problem = on_springs(&[1.0; 4], &load, &[0.0; 2], &[0.1, large]);
        let lambda = [1.0, 1.0, 0.1, -0.5];
        check(
            &format!("g = {large:e}"),
            &problem,
            &[0.0, 0.4, 0.0, 0.0],
            &lambda,
        );
        let problem = on_springs(&[1.0; 4], &load, &[0.0; 2], &[0.0; 2])
            .with_friction_coefficient(vec![0.1, large])
            .or_panic();
        check(
            &format!("mu = {large:e}"),
            &problem,
            &[0.0, 0.4, 0.0, 0.0],
            &lambda,
        );
        // An open node does not stick.
        let problem = on_springs(&[1.0; 4], &load, &[0.0, 2.0], &[0.0; 2])
            .with_friction_coefficient(vec![0.1, large])
            .or_panic();
        check(
            &format!("mu = {large:e}, apart"),
            &problem,
            &[0.0, 0.4, 1.0, -0.5],
            &[1.0, 0.0, 0.1, 0.0],
        );
    }
    // A bound is not a tie.
    let pulled = on_springs(&[1.0; 2], &[-1.0, 0.0], &[0.0], &[f64::INFINITY]);
    check("pulled", &pulled, &[-1.0, 0.0], &[0.0, 0.0]);
}

/// Node 2 has slipped by any length before: node 1 sticks and slips as it does alone.
#[test]
fn a_long_way_of_one_node_leaves_others_alone() {
    let problem = on_springs(&[1.0; 4], &[1.0, 0.5, 1.0, 0.5], &[0.0; 2], &[0.1, 0.2]);
    for far in [1.0, 1e9, 1e15, 1e20] {
        let start = State {
            u: vec![0.0, 0.0, 0.0, far],
            ..State::at_rest(&problem)
        };
        for way in WAYS {
            let found = step(&problem, &start, way);
            assert_eq!(found.status, Status::Converged, "{far:e}");
            let expected = [0.0, 0.4, 0.0, 0.7];
            for (found, expected) in found.u.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-9, "{far:e}: {:?}", found);
            }
            assert!((found.lambda[2] - 0.1).abs() < 1e-9 && (found.lambda[3] + 0.2).abs() < 1e-9);
        }
    }
}

/// A body in other units, or under a load far from all contact, moves as far as it likes.
#[test]
fn bodies_that_move_far_leave_others_alone() {
    for far in [1.0, 1e6, 1e12, 1e20] {
        let problem = on_springs(&[1.0; 6], &[1.0, 0.5, 0.0, 0.0, 0.0, far], &[0.1], &[0.1]);
        for way in WAYS {
            let found = step(&problem, &State::at_rest(&problem), way);
            assert_eq!(found.status, Status::Converged, "{far:e}");
            let right =
                (found.lambda[0] - 0.9).abs() < 1e-6 && (found.lambda[1] - 0.1).abs() < 1e-6;
            assert!(
                right && (found.u[5] - far).abs() <= 1e-9 * far,
                "{far:e}, {}: {:?}",
                way.name(),
                found.lambda
            );
        }
    }
}

/// Rows of N and T in arbitrary units: multipliers are divided by these units.
#[test]
fn units_of_rows_are_arbitrary() {
    let scales: Vec<f64> = (-6..=6).map(|e| 10_f64.powi(e)).collect();
    let m = scales.len();
    let rows = |first: usize| {
        let entries = scales.iter().enumerate();
        Csr::from_triplets(m, 2 * m, entries.map(|(i, s)| (i, 2 * i + first, *s)))
    };
    let problem = ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(2 * m, 2 * m, (0..2 * m).map(|i| (i, i, 1e11))),
        load: [1e5, 5e4].repeat(m),
        normal: rows(0),
        tangential: rows(1),
        gap: scales.iter().map(|s| 1e-7 * s).collect(),
        slip_bound: vec![0.0; m],
        coordinates: None,
    })
    .and_then(|problem| problem.with_friction_coefficient(vec![0.3; m]))
    .or_panic();
    for way in WAYS {
        let found = step(&problem, &State::at_rest(&problem), way);
        assert_eq!(found.status, Status::Converged, "{}", way.name());
        for (i, scale) in scales.iter().enumerate() {
            let [normal, tangential] = [i, m + i].map(|row| scale * found.lambda[row]);
            let right = (normal - 9e4).abs() < 0.1 && (tangential - 2.7e4).abs() < 0.1;
            assert!(right, "{}, {scale:e}: {normal} {tangential}", way.name());
        }
    }
}

#[test]
fn rows_without_entries_hold_without_an_overlap() {
    let data = |gap: f64| ContactData {
        stiffness: BlockCsr::from_triplets(2, 2, (0..2).map(|i| (i, i, 1.0))),
        load: vec![1.0, 0.5],
        normal: Csr::from_triplets(2, 2, [(0, 0, 1.0)]),
        tangential: Csr::from_triplets(2, 2, []),
        gap: vec![0.1, gap],
        slip_bound: vec![0.3, f64::INFINITY],
        coordinates: None,
    };
    for gap in [0.0, 1.0, f64::INFINITY] {
        let problem = ContactProblem::new(data(gap)).or_panic();
        check("g", &problem, &[0.1, 0.5], &[0.9, 0.0, 0.0, 0.0]);
        let problem = problem.with_friction_coefficient(vec![0.3; 2]).or_panic();
        check("mu", &problem, &[0.1, 0.5], &[0.9, 0.0, 0.0, 0.0]);
        let said = problem
            .with_gap(vec![0.1, -1.0])
            .expect_err("it overlaps")
            .to_string();
        assert!(
            said.starts_with(
                "row 2 of N has no nonzero entry, so that no motion opens its gap of -1e0"
            ),
            "{said}"
        );
    }
}

/// A node that sticks while its load goes and comes back: its remaining slip is rounding of the earlier motion.
#[test]
fn unloading_leaves_nothing() {
    for (k, n, load) in [
        ([1.76, 42.9], [0.27256, -0.96214], [5292.4, -135480.6]),
        ([3e-7, 2e5], [0.6, 0.8], [-7.0, 1e3]),
    ] {
        let problem = ContactProblem::new(ContactData {
            stiffness: BlockCsr::from_triplets(2, 2, (0..2).map(|i| (i, i, k[i]))),
            load: load.to_vec(),
            normal: Csr::from_triplets(1, 2, [(0, 0, n[0]), (0, 1, n[1])]),
            tangential: Csr::from_triplets(1, 2, [(0, 0, -n[1]), (0, 1, n[0])]),
            gap: vec![0.0],
            slip_bound: vec![1e6],
            coordinates: None,
        })
        .or_panic();
        for way in WAYS {
            let before = step(&problem, &State::at_rest(&problem), way);
            assert_eq!(before.status, Status::Converged);
            let state = before.state(&Load::of(&problem));
            let unloaded = problem.clone().with_load(vec![0.0; 2]).or_panic();
            let after = step(&unloaded, &state, way);
            assert_eq!(after.status, Status::Converged, "{k:?} {}", way.name());
            // The effect of the load alone.
            let moved = load
                .iter()
                .zip(&k)
                .map(|(f, k): (&f64, &f64)| (f / k).abs())
                .fold(0.0, f64::max);
            let left = after.u.iter().fold(0.0_f64, |most, u| most.max(u.abs()));
            assert!(left <= 1e-11 * moved, "{left:e} of {moved:e}");
        }
    }
}

/// Nodes that stick under Tresca's law without pressure, of bodies whose unknowns all depend on each other: what rounding leaves
/// after unloading is measured by the tractions before, even if it includes pressures.
#[test]
fn unloading_of_random_bodies_leaves_nothing() {
    let (n, m) = (6, 2);
    for seed in 1..=400 {
        let mut random = Random(seed * 7919);
        let entry = |_| -> Vec<f64> { (0..n).map(|_| random.between(-2.0, 2.0)).collect() };
        let factor: Vec<Vec<f64>> = (0..n).map(entry).collect();
        let product = |i: usize, j: usize| -> f64 {
            let sum: f64 = (0..n).map(|k| factor[i][k] * factor[j][k]).sum();
            sum / n as f64 + if i == j { 0.3 } else { 0.0 }
        };
        let entries = (0..n * n).map(|at| (at / n, at % n, product(at / n, at % n)));
        let row = |first: usize| Csr::from_triplets(m, n, (0..m).map(|i| (i, 2 * i + first, 1.0)));
        let mut load: Vec<f64> = (0..n).map(|_| random.between(-2.0, 2.0)).collect();
        // Away from the obstacle.
        (0..m).for_each(|i| load[2 * i] = -4.0 - load[2 * i].abs());
        let problem = ContactProblem::new(ContactData {
            stiffness: BlockCsr::from_triplets(n, n, entries),
            load,
            normal: row(0),
            tangential: row(1),
            gap: vec![0.0; m],
            slip_bound: vec![10.0; m],
            coordinates: None,
        })
        .or_panic();
        let way = Way::Cholesky;
        let before = step(&problem, &State::at_rest(&problem), way);
        assert_eq!(before.status, Status::Converged, "{seed}");
        let state = before.state(&Load::of(&problem));
        let after = step(&problem.with_load(vec![0.0; n]).or_panic(), &state, way);
        assert_eq!(after.status, Status::Converged, "{seed}: {:?}", after.kkt);
        let left = after
            .lambda
            .iter()
            .fold(0.0_f64, |most, l| most.max(l.abs()));
        assert!(left < 1e-6, "{seed}: {left:e}");
    }
}

/// Nodes with very different stiffnesses, each pressed by twice the force that closes its gap: each force is as accurate as the
/// tolerance promises of lengths, relative to its own.
#[test]
fn stiff_contacts_leave_soft_ones_alone() {
    for decades in [2, 4, 6, 8, 10, 12] {
        let m = 12;
        let each = |i: usize| 10f64.powf(decades as f64 * (i / 2) as f64 / (m - 1) as f64);
        let stiffness: Vec<f64> = (0..2 * m).map(each).collect();
        let load: Vec<f64> = (0..2 * m)
            .map(|i| if i % 2 == 0 { stiffness[i] } else { 0.0 })
            .collect();
        let problem = on_springs(&stiffness, &load, &vec![0.5; m], &vec![0.0; m]);
        for way in WAYS {
            let found = step(&problem, &State::at_rest(&problem), way);
            let what = format!("{decades} decades, {}", way.name());
            assert_eq!(found.status, Status::Converged, "{what}");
            for i in 0..m {
                let off = (found.lambda[i] / (0.5 * stiffness[2 * i]) - 1.0).abs();
                assert!(off < 2e-5, "{what}: force {i} is off by {off:e}");
            }
        }
    }
}
