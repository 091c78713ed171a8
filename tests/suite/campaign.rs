//! The promises of `converged` and `not_held`, tested on many thousand random problems.
//!
//! Every problem follows from its seed alone. Families:
//!
//! - **known**: matrices with a solution that was chosen first: u, λ and the sets, then f = K u + Bᵀλ, d and g. K is a network
//!   of springs or AᵀA with a ratio of up to 10¹¹ between its largest and smallest eigenvalue, by contrasts of stiffness or by
//!   scales of the unknowns; nodes may just touch, stick at the very bound, have no gap or no friction at all;
//! - **matrices**: the same matrices under random loads, in one to four load steps;
//! - **block**, **stack**: elastic cases as a user writes them (`common/cases.rs`), in units that differ by many decades:
//!   clamped, moved, guided, pinned or held by contact alone, on floors, discs, in V's and between walls, stacked with meshes
//!   that do not match, with unloading and reversal;
//! - **edge**: a block that contact alone holds, pushed by a force that differs by 10⁻¹ to 10⁻⁸ from the limit of statics for
//!   sliding or tipping.
//!
//! In space (`solids.rs`): **solid**, a block on a half-space, a ball or a cylinder, **solids**, two blocks on each other.
//!
//! # How an answer is judged
//!
//! [`Oracle`] reads K, N, T, the load and the gap, and shares no code with the solver. Its sums are compensated, so that its
//! findings come from the answer. It allows exactly the errors that `docs/case-file.md` permits, with the tolerance ε = 10⁻⁶:
//!
//! - conditions (1)–(3) to 10 ε: forces relative to the larger of the acting and of the contact forces, lengths relative to the
//!   deformation (u minus the mean rigid-body motion of each body) or to the effect of a contact force on its own node;
//! - the balance of each body that can move as a whole (each motion by itself) to 100 ε of the forces on *this* body;
//! - node by node: forces to 3000 ε of the largest pressure: a node that is pressed *and* apart, or that slips without its full
//!   friction, is wrong by the force that would close the gap if it were the only one, at least;
//! - where these are missed after unloading, nodal forces are compared again relative to the largest pressure before the load
//!   step, from which slip is measured, and reported as a remark;
//! - where the answer is unique (no Coulomb friction) and known, or found again at a tolerance of 10⁻¹⁰: multipliers to 3000 ε
//!   of the largest pressure. For the known answer, the effect of rounding of f is added and, for matrices with contrasts of
//!   stiffness, the effect of permitted violations under the condition of A. Without a known answer these effects are unknown,
//!   and such matrices are only reported, as are paths that differ by more than twice that. Because the solver estimates these
//!   errors, one comparison in a thousand may be off by more.
//!
//! Rounding allowed: 32 units in the last place of the terms of a difference, as the documentation says. Where bodies have
//! moved far, that may be more than the forces; such answers are counted as *blind*. Contact forces that close no more than a
//! hundred times the rounding of a gap are noise, and count as zero.
//!
//! Bodies with supports are in balance if the forces on each of their free unknowns are: reactions are not part of (1), and are
//! not checked here.
//!
//! `not_held` is right where [`least_imbalance`], a bounded least-squares problem solved by an active-set method, finds that no
//! forces within the friction law balance a body, and proves it by a motion that all of them together resist less than the
//! loads drive it. Without Coulomb friction a problem that can be balanced has a solution, so that `not_held` is wrong there;
//! with Coulomb friction all sets are tried where they are few (`common/oracle/all_sets.rs`).
//!
//! In space the bounded least-squares problem is a cone program, which Clarabel solves.
//!
//! `cargo test --release --test suite -- --ignored --nocapture campaign::random_problems` tries 10 000 problems in the plane on
//! each path, `random_solids` as many in space. Environment:
//!
//! - `CAMPAIGN_PROBLEMS`: how many problems instead;
//! - `CAMPAIGN_SEED`: the seed of the first one (1);
//! - `CAMPAIGN_PATHS`: `cholesky`, `pcg` or both with a comma between;
//! - `CAMPAIGN_ONLY`: the seed of a single problem, which is printed with the history of its solves.

mod ablation;
mod compliant;
mod problems;
mod runs;
mod solids;
mod tally;

use crate::common::cases::elastic;
use crate::common::draw::generator;
use crate::common::or_panic::OrPanic as _;
use crate::common::oracle::balance::least_imbalance;
use crate::common::oracle::{Oracle, length};
use crate::common::runs::Way;
use problems::{edge, problem};
use runs::{a_few, many, run};
use signorini::ssnm::Status;
use solids::solid;
use std::collections::BTreeMap;

#[test]
#[ignore = "20 000 solves"]
fn random_problems() {
    many(problem);
}

#[test]
fn a_few_random_problems() {
    a_few(problem, 150);
}

/// A gap that is closed by rounding alone, in a K of eleven decades, and loads that are taken away: hardly any force is left. The last
/// two have tractions of 4e-14 after forces of 3e-10, where the rounding of some contacts is more than what others are off, and
/// pressures of 1e-19 beside tractions of 2e-4.
#[test]
fn what_rounding_leaves_is_no_force() {
    for seed in [95_000_537, 95_000_115, 95_000_409, 116_000_331, 116_000_857] {
        let problem = problem(seed).or_panic();
        for way in [Way::Cholesky, Way::Pcg] {
            let run = run(&problem.trial, way);
            assert_eq!(run.end, "converged", "{seed} {}", way.name());
        }
    }
}

/// A block without supports along a disc slides far before the disc holds it: that is no body without a hold.
#[test]
fn a_body_that_moves_far_is_held() {
    let problem = problem(98_102_280).or_panic();
    for way in [Way::Cholesky, Way::Pcg] {
        let run = run(&problem.trial, way);
        assert_eq!(run.end, "converged", "{}", way.name());
    }
}

#[test]
#[ignore = "20 000 solves"]
fn random_solids() {
    many(solid);
}

#[test]
fn a_few_random_solids() {
    a_few(solid, 150);
}

/// The oracle detects errors: an answer with a multiplier changed by a hundredth, a sign reversed, or a node moved does
/// not pass.
#[test]
fn the_oracle_detects_errors() {
    let (mut told, mut missed) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for seed in 1..=120 {
        let Ok(problem) = problem(seed) else { continue };
        let oracle = Oracle::new(&problem.trial.problem);
        let (n, m) = (oracle.n, oracle.m);
        if n > 200 {
            continue;
        }
        let run = run(&problem.trial, Way::Cholesky);
        let Some(step) = run.steps.first().filter(|s| s.status == Status::Converged) else {
            continue;
        };
        let (load, start) = (&problem.trial.loads[0], run.start(&problem.trial, 0));
        let wrong = |u: &[f64], lambda: &[f64]| {
            let (deviations, blind) = oracle.judge(load, &start, u, lambda, false);
            assert!(!blind, "{seed}: {}", problem.trial.name);
            deviations.iter().any(|d| !(d.times <= 1.0))
        };
        assert!(
            !wrong(&step.u, &step.lambda),
            "{seed}: {}",
            problem.trial.name
        );
        // The multiplier with the largest force, among some of them.
        let mut weight = vec![0.0; 2 * m];
        for (shift, rows) in [(0, &oracle.normal), (m, &oracle.tangential)] {
            for &(i, _, v) in rows {
                weight[i + shift] += v * v;
            }
        }
        let heaviest = |which: std::ops::Range<usize>| {
            let force = |&i: &usize| step.lambda[i].abs() * weight[i].sqrt();
            let all = length(&oracle.contact_forces(&step.lambda));
            which
                .max_by(|a, b| force(a).total_cmp(&force(b)))
                .filter(|i| force(i) > 1e-2 * all.max(load.acting))
        };
        let mut count = |what: &'static str, is_told: bool| {
            if is_told {
                *told.entry(what).or_default() += 1;
            } else {
                missed.push(format!("{seed}: {what} [{}]", problem.trial.name));
            }
        };
        for (what, which, factor) in [
            ("a pressure changed", 0..m, 1.01),
            ("a pressure turned", 0..m, -1.0),
            ("friction changed", m..2 * m, 0.99),
            ("friction turned", m..2 * m, -1.0),
        ] {
            if let Some(i) = heaviest(which) {
                let mut lambda = step.lambda.clone();
                lambda[i] *= factor;
                count(what, wrong(&step.u, &lambda));
            }
        }
        // A node that is moved so far that it takes a thousandth of the forces.
        let force = length(&oracle.contact_forces(&step.lambda)).max(load.acting);
        let diagonal = oracle.k.iter().filter(|e| e.0 == e.1);
        let stiffest = diagonal.max_by(|a, b| a.2.total_cmp(&b.2));
        if let (Some(&(i, _, k)), true) = (stiffest, force > 0.0) {
            let mut u = step.u.clone();
            u[i] += 1e-3 * force / k;
            count("a node moved", wrong(&u, &step.lambda));
        }
    }
    println!("told {told:?}");
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(
        told.len() == 5 && told.values().all(|&n| n > 10),
        "{told:?}"
    );
}

/// The certificate: a block on a floor, with the limits of statics.
#[test]
fn the_certificate_is_statics() {
    let mut counts = [0; 2];
    for seed in 1..=200 {
        let (written, held) = edge(&mut generator(seed));
        let trial = elastic(written).or_panic();
        let oracle = Oracle::new(&trial.problem);
        assert_eq!(oracle.free.len(), 1, "{}", trial.name);
        assert_eq!(oracle.free[0].motions.len(), 3, "{}", trial.name);
        let balance = least_imbalance(&oracle, &trial.loads[0]);
        match held {
            Some(true) => assert!(
                balance.holds() == Some(true),
                "{}: {:e}",
                trial.name,
                balance.imbalance
            ),
            Some(false) => assert!(
                balance.holds() == Some(false),
                "{}: {:e}",
                trial.name,
                balance.imbalance
            ),
            None => continue,
        }
        counts[usize::from(held == Some(true))] += 1;
    }
    assert!(counts.iter().all(|&n| n > 50), "{counts:?}");
}
