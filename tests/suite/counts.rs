//! Counts that do not depend on the machine: Table 1, the reference cases, units, the cycling case.

use crate::common::manufactured::{Friction, Node, manufactured};
use crate::common::or_panic::OrPanic as _;
use crate::common::{Random, solve};
use signorini::dual::DirectDual;
use signorini::problem::{ContactData, ContactProblem};
use signorini::reference::{self, CASE_A, CASE_B, Geometry, Loads, TABLE1};
use signorini::sparse::BlockCsr;
use signorini::ssnm::{self, Method, NewtonSettings, Status};
use signorini::ssnm::{Step, WarmStart};
use signorini::table1::{self, BETAS, SIZES};
use std::ops::ControlFlow;
use std::sync::Arc;

fn problem(geometry: Geometry, k: usize, loads: &Loads) -> ContactProblem {
    let mesh = reference::mesh(geometry, k);
    reference::problem(geometry, &mesh, loads).or_panic()
}

#[test]
fn sizes_are_those_of_the_paper() {
    let sizes = [
        (1, 1320, 60),
        (3, 11160, 180),
        (5, 30600, 300),
        (7, 59640, 420),
    ];
    for (k, n, m) in sizes {
        let one = problem(Geometry::OneBody, k, &TABLE1);
        assert_eq!((one.n_free(), one.m()), (n, m));
        let two = problem(Geometry::TwoBodies, k, &TABLE1);
        assert_eq!((two.n_free(), 2 * two.m()), (n, m));
    }
}

#[test]
fn table1_converges_below_the_paper() {
    let geometries = [Geometry::OneBody, Geometry::TwoBodies];
    let methods = [Method::Inexact, Method::Multisecant];
    for (geometry, method) in geometries.iter().flat_map(|&g| methods.map(|m| (g, m))) {
        for k in SIZES {
            let problem = problem(geometry, k, &TABLE1);
            let mut dual = DirectDual::new(&problem).or_panic();
            let go_on = |_| ControlFlow::Continue(());
            let cells = table1::row(&problem, &mut dual, k, &BETAS, method, go_on).or_panic();
            assert_eq!(cells.len(), 5);
            for cell in cells {
                let what = format!("{geometry:?} k = {k}: {cell:?}");
                assert_eq!(cell.status, Status::Converged, "{what}");
                assert!(cell.kkt.max() <= 10.0 * table1::TOLERANCE, "{what}");
                let (_, n_a) = cell.paper.expect("all sizes and β of the paper");
                match (method, geometry) {
                    // Found: 9 or 10, including the final check, which the paper does not have.
                    (Method::Multisecant, _) => assert!(cell.n_a_checked <= 12, "{what}"),
                    (_, Geometry::OneBody) => {
                        assert!(cell.n_a <= n_a && cell.iter <= 12, "{what}");
                    }
                    _ => {}
                }
            }
        }
    }
}

/// Products with A against PERMON's best on the same case (projCG expansion; k, 1e-4, 1e-6).
#[test]
fn case_a_needs_no_more_products_than_permon() {
    let peers = [
        (1, 20, 24),
        (3, 29, 41),
        (5, 30, 44),
        (7, 36, 55),
        (13, 50, 65),
    ];
    for (k, loose, tight) in peers {
        let problem = problem(Geometry::OneBody, k, &CASE_A);
        for (tolerance, peer) in [(1e-4, loose), (1e-6, tight)] {
            let settings = NewtonSettings {
                tolerance,
                ..Default::default()
            };
            let solution = solve(&problem, &settings);
            assert_eq!(solution.status, Status::Converged);
            println!("k = {k}, {tolerance:e}: {} of {peer}", solution.info.n_a);
            // Less than half of it, and hardly more on finer meshes.
            let most = if tolerance > 1e-5 { 12 } else { 21 };
            assert!(
                solution.info.n_a <= peer.min(most),
                "k = {k}, {tolerance:e}: {} products, {peer} of the peer",
                solution.info.n_a
            );
        }
    }
}

#[test]
fn case_b_has_the_known_sets() {
    let problem = problem(Geometry::OneBody, 7, &CASE_B);
    let settings = NewtonSettings {
        tolerance: 1e-9,
        ..Default::default()
    };
    let solution = solve(&problem, &settings);
    let mut counts = [0; 4];
    for i in 0..problem.m() {
        let separated = solution.sets.is_separated(i);
        let slips = solution.sets.slip_sign(i) != 0;
        counts[usize::from(separated) * 2 + usize::from(slips)] += 1;
    }
    // In contact and stick, in contact and slip, separated and stick, separated and slip. An independent
    // prototype found 72, 63, 0 and 285; with residuals of 1e-12 this is the answer of our discretisation.
    assert_eq!(counts, [71, 63, 0, 286]);
}

#[test]
fn exact_and_inexact_agree_on_case_b() {
    let problem = problem(Geometry::OneBody, 3, &CASE_B);
    let [a, b] = [Method::Inexact, Method::Exact].map(|method| {
        let settings = NewtonSettings {
            tolerance: 1e-9,
            method,
            ..Default::default()
        };
        solve(&problem, &settings)
    });
    assert_eq!((a.status, b.status), (Status::Converged, Status::Converged));
    assert_eq!(a.sets, b.sets);
    assert!(crate::common::distance(&a.u, &b.u) < 1e-7);
    assert!(b.info.n_a > a.info.n_a);
}

/// The case in which the method without its safeguard cycles, and every β that it must handle.
#[test]
fn every_beta_converges() {
    let cycling = Loads {
        tresca: 4e7,
        ..TABLE1
    };
    for k in [1, 3, 5] {
        for (geometry, loads) in [
            (Geometry::TwoBodies, cycling),
            (Geometry::TwoBodies, TABLE1),
            (Geometry::OneBody, cycling),
            (Geometry::OneBody, CASE_B),
        ] {
            let problem = problem(geometry, k, &loads);
            let mut dual = DirectDual::new(&problem).or_panic();
            for beta in [0.01, 0.1, 1.0, 1.99, 10.0, 100.0, 1000.0] {
                let settings = NewtonSettings {
                    beta,
                    ..Default::default()
                };
                let solution =
                    ssnm::solve(
                        &problem,
                        &mut dual,
                        &settings,
                        |_| ControlFlow::Continue(()),
                    )
                    .or_panic();
                assert_eq!(
                    solution.status,
                    Status::Converged,
                    "{geometry:?} k = {k} β = {beta}"
                );
                assert!(solution.info.iter <= 40, "{geometry:?} k = {k} β = {beta}");
            }
        }
    }
}

#[test]
fn the_safeguard_acts_on_the_cycling_case() {
    let cycling = Loads {
        tresca: 4e7,
        ..TABLE1
    };
    let acted = [1, 3, 5].iter().any(|&k| {
        let settings = NewtonSettings {
            beta: 100.0,
            method: Method::Inexact,
            ..Default::default()
        };
        let solution = solve(&problem(Geometry::TwoBodies, k, &cycling), &settings);
        solution.info.history.iter().any(|step| step.safeguarded)
    });
    assert!(acted);
}

/// E and loads times 1e±9, lengths times 1e±6: the same sets, iter and n_A.
#[test]
fn nothing_depends_on_units() {
    for loads in [CASE_A, CASE_B] {
        let base = problem(Geometry::OneBody, 3, &loads);
        let plain = solve(&base, &NewtonSettings::default());
        for force in [1e-9, 1.0, 1e9] {
            for length in [1e-6, 1.0, 1e6] {
                // In plane strain K is in Pa (per length of thickness), forces in N/m.
                let k = base.stiffness();
                let scaled = ContactProblem::new(ContactData {
                    stiffness: BlockCsr::from_triplets(
                        k.n_rows(),
                        k.n_cols(),
                        k.triplets().map(|(i, j, v)| (i, j, v * force)),
                    ),
                    load: base.load().iter().map(|v| v * force * length).collect(),
                    normal: base.normal().clone(),
                    tangential: base.tangential().clone(),
                    gap: base.gap().iter().map(|v| v * length).collect(),
                    slip_bound: base
                        .slip_bound()
                        .iter()
                        .map(|v| v * force * length)
                        .collect(),
                    coordinates: base.coordinates().map(<[_]>::to_vec),
                })
                .or_panic();
                let solution = solve(&scaled, &NewtonSettings::default());
                assert_eq!(solution.status, Status::Converged);
                assert_eq!(solution.sets, plain.sets, "{force:e} {length:e}");
                assert_eq!(
                    (solution.info.iter, solution.info.n_a),
                    (plain.info.iter, plain.info.n_a),
                    "{force:e} {length:e}"
                );
            }
        }
    }
}

#[test]
fn limits_end_with_an_honest_status() {
    use std::sync::atomic::AtomicBool;
    use std::time::Duration;
    let problem = problem(Geometry::OneBody, 3, &CASE_A);
    let run = |settings: NewtonSettings| {
        let solution = solve(&problem, &settings);
        // Whatever was reached is a feasible point with its displacement.
        let m = problem.m();
        assert!(solution.lambda[..m].iter().all(|&l| l >= 0.0));
        assert!(
            solution.lambda[m..]
                .iter()
                .zip(problem.slip_bound())
                .all(|(l, g)| l.abs() <= *g)
        );
        assert!(solution.info.kkt.equilibrium < 1e-8);
        solution
    };
    let short = run(NewtonSettings {
        max_iterations: 3,
        ..Default::default()
    });
    assert_eq!((short.status, short.info.iter), (Status::IterationLimit, 3));
    let none = run(NewtonSettings {
        max_iterations: 0,
        ..Default::default()
    });
    assert_eq!(none.status, Status::IterationLimit);
    let late = run(NewtonSettings {
        time_limit: Some(Duration::ZERO),
        ..Default::default()
    });
    assert_eq!(late.status, Status::TimeLimit);
    let stop = Arc::new(AtomicBool::new(true));
    let interrupted = run(NewtonSettings {
        interrupt: Some(stop),
        ..Default::default()
    });
    assert_eq!(interrupted.status, Status::Interrupted);
    // No f64 computation can meet this.
    let hopeless = run(NewtonSettings {
        tolerance: 1e-17,
        ..Default::default()
    });
    assert_eq!(hopeless.status, Status::Stagnated);
}

#[test]
fn a_warm_start_from_the_solution_is_done_at_once() {
    let problem = problem(Geometry::OneBody, 3, &CASE_B);
    let first = solve(&problem, &NewtonSettings::default());
    let mut dual = DirectDual::new(&problem).or_panic();
    let start = WarmStart {
        lambda: Some(&first.lambda),
        ..Default::default()
    };
    let go_on = |_: &Step| ControlFlow::Continue(());
    let second = ssnm::solve_from(
        start,
        &problem,
        &mut dual,
        &NewtonSettings::default(),
        go_on,
    )
    .or_panic();
    assert_eq!(second.status, Status::Converged);
    // One product, for r at the start.
    assert_eq!((second.info.iter, second.info.n_a), (0, 1));
    assert_eq!(second.sets, first.sets);
}

/// A product with A through the trailing block is B K⁻¹ Bᵀ, whatever the shape of B.
#[test]
fn the_dual_operator_satisfies_its_definition() {
    use signorini::control::{Accuracy, Stop};
    use signorini::dual::{DualOperator, Request};
    let mut random = Random(3);
    for (m, n, general) in [
        (1, 5, false),
        (5, 31, true),
        (20, 60, false),
        (40, 80, true),
    ] {
        let sticks = Node {
            separated: false,
            friction: Friction::Sticks,
        };
        let nodes = vec![sticks; m];
        let problem = manufactured::<2>(n, &nodes, general, &mut random).problem;
        let mut dual = DirectDual::new(&problem).or_panic();
        let p: Vec<f64> = (0..2 * m).map(|_| random.between(-1.0, 1.0)).collect();
        let (accuracy, stop) = (Accuracy::Residual(1e-12), Stop::default());
        let (mut ap, mut y) = (vec![f64::NAN; 2 * m], vec![f64::NAN; 2 * m]);
        dual.apply(&p, &mut ap, accuracy, &stop)
            .expect("it cannot fail");
        let force = problem.load_case().force();
        dual.at_contact(&Request::new(force, &p, accuracy, &stop), &mut y)
            .expect("it cannot fail");
        // u(λ) = K⁻¹(f − Bᵀλ), so A p = B u(0) − B u(p).
        let mut u = |l: &[f64]| {
            dual.displacement(&Request::new(force, l, accuracy, &stop))
                .expect("it cannot fail")
        };
        let (u0, up) = (u(&vec![0.0; 2 * m]), u(&p));
        let product = |u: &[f64]| {
            let mut y = vec![0.0; 2 * m];
            problem.normal().mul(u, &mut y[..m]);
            problem.tangential().mul(u, &mut y[m..]);
            y
        };
        let (b0, bp) = (product(&u0), product(&up));
        let expected: Vec<f64> = b0.iter().zip(&bp).map(|(a, b)| a - b).collect();
        assert!(crate::common::distance(&ap, &expected) < 1e-9);
        assert!(crate::common::distance(&y, &bp) < 1e-9);
        // And u(p) solves its equation.
        let kkt = problem.kkt(&up, &p);
        assert!(kkt.equilibrium < 1e-9, "{kkt:?}");
    }
}
