//! Problems whose solution was chosen first (validation by construction), in the plane and in space: any sets, nodes on
//! the verge of slip, and no simplifying properties.

use crate::common::manufactured::{Friction, Node, manufactured};
use crate::common::or_panic::OrPanic as _;
use crate::common::{Random, distance, solve, solve_on};
use proptest::prelude::*;
use signorini::engine::Stiffness;
use signorini::problem::{ContactData, ContactProblem};
use signorini::sparse::Csr;
use signorini::ssnm::{Method, NewtonSettings, Status};
use std::f64::consts::TAU;

const METHODS: &[Method] = &[Method::Multisecant, Method::Inexact, Method::Exact];

fn friction() -> impl Strategy<Value = Friction> {
    prop_oneof![
        3 => Just(Friction::Sticks),
        4 => (0.0..TAU).prop_map(Friction::Slips),
        1 => (0.0..TAU).prop_map(Friction::OnTheVerge),
        1 => Just(Friction::Idle),
        1 => Just(Friction::None),
    ]
}

fn node() -> impl Strategy<Value = Node> {
    (any::<bool>(), friction()).prop_map(|(separated, friction)| Node {
        separated,
        friction,
    })
}

/// Makes a problem and solves it on both paths, which have to find the chosen solution.
fn check<const D: usize>(
    n: usize,
    nodes: &[Node],
    general: bool,
    random: &mut Random,
    settings: &NewtonSettings,
) {
    let made = manufactured::<D>(n, nodes, general, random);
    // Without any force only rounding is left, and nothing to compare it with.
    if made.lambda.iter().all(|&l| l == 0.0) {
        return;
    }
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let found = solve_on(&made.problem, stiffness, settings);
        assert_eq!(found.status, Status::Converged, "{stiffness:?}, n = {n}");
        assert!(found.info.kkt.max() <= 10.0 * settings.tolerance);
        if let Err(what) = made.wrong(&found) {
            panic!("{stiffness:?}, n = {n}: {what}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn any_sets_any_beta(
        nodes in prop::collection::vec(node(), 1..22),
        extra in 0usize..40,
        general in any::<bool>(),
        exponent in -2.0f64..3.0,
        method in prop::sample::select(METHODS),
        seed in 1u64..1 << 40,
    ) {
        let settings = NewtonSettings {
            tolerance: 1e-9,
            beta: 10f64.powf(exponent),
            method,
            max_iterations: 2000,
            ..Default::default()
        };
        let random = &mut Random(seed);
        check::<2>(2 * nodes.len() + extra, &nodes, general, random, &settings);
        check::<3>(3 * nodes.len() + extra, &nodes, general, random, &settings);
    }
}

#[test]
fn exact_and_inexact_agree() {
    let mut random = Random(7);
    for general in [false, true] {
        let nodes: Vec<Node> = (0..60)
            .map(|i| Node {
                separated: i % 3 == 0,
                friction: Friction::WAYS[i % 5 % 3],
            })
            .collect();
        let m = manufactured::<2>(400, &nodes, general, &mut random);
        let [a, b] = [Method::Inexact, Method::Exact].map(|method| {
            let settings = NewtonSettings {
                tolerance: 1e-10,
                method,
                ..Default::default()
            };
            solve(&m.problem, &settings)
        });
        assert_eq!(a.sets, b.sets);
        assert!(distance(&a.u, &b.u) < 1e-8);
        assert!(
            b.info.iter <= a.info.iter,
            "{} {}",
            b.info.iter,
            a.info.iter
        );
    }
}

#[test]
fn one_node_all_separated_all_sticking_odd_sizes() {
    let uniform = |m, separated, slip: usize| {
        let friction = Friction::WAYS[slip];
        vec![
            Node {
                separated,
                friction
            };
            m
        ]
    };
    let mut random = Random(99);
    let settings = NewtonSettings {
        tolerance: 1e-9,
        ..Default::default()
    };
    for general in [false, true] {
        for nodes in [
            uniform(1, false, 0),
            uniform(1, true, 1),
            uniform(17, true, 0),
            uniform(17, true, 2),
            uniform(17, false, 0),
            uniform(17, false, 1),
        ] {
            // n = D m leaves no unknown free of contact; an n that is not a multiple of D is padded inside.
            for n in [2 * nodes.len(), 2 * nodes.len() + 1, 77] {
                check::<2>(n, &nodes, general, &mut random, &settings);
            }
            for n in [3 * nodes.len(), 3 * nodes.len() + 1, 77] {
                check::<3>(n, &nodes, general, &mut random, &settings);
            }
        }
    }
}

/// λν = 0 at zero gap and |λτ| = g at zero slip: no strict complementarity, but still one solution.
#[test]
fn degenerate_nodes() {
    let nodes: Vec<Node> = (0..20)
        .map(|i| Node {
            separated: i % 2 == 0,
            friction: Friction::Sticks,
        })
        .collect();
    for seed in 1..20 {
        let m = manufactured::<2>(70, &nodes, seed % 2 == 0, &mut Random(seed));
        let p = &m.problem;
        let mut nu = vec![0.0; 20];
        p.normal().mul(&m.u, &mut nu);
        // Separated nodes just touch; every second bound is met exactly by a sticking node.
        let gap: Vec<f64> = nu;
        let slip_bound: Vec<f64> = (0..20)
            .map(|i| match i % 3 {
                0 => m.lambda[20 + i].abs(),
                _ => p.slip_bound()[i],
            })
            .collect();
        let problem = ContactProblem::new(ContactData {
            stiffness: p.stiffness().as_ref().clone(),
            load: p.load().to_vec(),
            normal: p.normal().clone(),
            tangential: p.tangential().clone(),
            gap,
            slip_bound,
            coordinates: None,
        })
        .or_panic();
        for beta in [0.01, 1.0, 1000.0] {
            let settings = NewtonSettings {
                tolerance: 1e-8,
                beta,
                ..Default::default()
            };
            let solution = solve(&problem, &settings);
            assert_eq!(
                solution.status,
                Status::Converged,
                "seed {seed}, β = {beta}"
            );
            assert!(distance(&solution.u, &m.u) < 1e-5);
            assert!(distance(&solution.lambda, &m.lambda) < 1e-4);
        }
    }
}

/// g = 0 everywhere, with rows of T that may be empty: the frictionless problem.
#[test]
fn no_friction() {
    let nodes: Vec<Node> = (0..12)
        .map(|i| Node {
            separated: i % 2 == 0,
            friction: Friction::Sticks,
        })
        .collect();
    let m = manufactured::<2>(50, &nodes, false, &mut Random(5));
    let p = &m.problem;
    let with = |tangential: Csr| {
        let problem = ContactProblem::new(ContactData {
            stiffness: p.stiffness().as_ref().clone(),
            load: p.load().to_vec(),
            normal: p.normal().clone(),
            tangential,
            gap: p.gap().to_vec(),
            slip_bound: vec![0.0; 12],
            coordinates: None,
        })
        .or_panic();
        solve(&problem, &NewtonSettings::default())
    };
    let a = with(p.tangential().clone());
    let b = with(Csr::from_triplets(12, 50, []));
    assert_eq!(a.status, Status::Converged);
    assert_eq!(b.status, Status::Converged);
    assert!(distance(&a.u, &b.u) < 1e-5);
    assert!(a.lambda[12..].iter().all(|&l| l == 0.0));
}

#[test]
fn products_by_iterations_lead_the_same_way() {
    let mut random = Random(99);
    let (mut exact_products, mut nested_products) = (0, 0);
    const COUNT: usize = 240;
    for i in 0..COUNT {
        let m = 1 + random.below(40);
        let n = 2 * m + 1 + random.below(200);
        let nodes: Vec<Node> = (0..m).map(|_| Node::any(&mut random)).collect();
        let problem = manufactured::<2>(n, &nodes, i % 2 == 0, &mut random).problem;
        let settings = NewtonSettings {
            tolerance: [1e-4, 1e-6, 1e-9][i % 3],
            beta: [0.05, 1.0, 1.9, 30.0][i % 4],
            ..Default::default()
        };
        let [exact, nested] = [Stiffness::Cholesky, Stiffness::Pcg].map(|stiffness| {
            let solution = solve_on(&problem, stiffness, &settings);
            assert_eq!(solution.status, Status::Converged, "{i}: {stiffness:?}");
            solution.info
        });
        assert!(nested.iter <= 2 * exact.iter + 4, "{i}: {nested:?}");
        exact_products += exact.n_a;
        nested_products += nested.n_a;
    }
    // Products that are only as accurate as necessary can be recycled less often.
    let ratio = nested_products as f64 / exact_products as f64;
    assert!(
        ratio < 1.5,
        "{nested_products} for {exact_products} products"
    );
}

/// The directions of the tangents are arbitrary: any other pair of them gives the same answer in the same steps.
#[test]
fn tangents_may_be_turned() {
    let mut random = Random(11);
    for general in [false, true] {
        let nodes: Vec<Node> = (0..30)
            .map(|i| Node {
                separated: i % 4 == 0,
                friction: if i % 3 == 0 {
                    Friction::Sticks
                } else {
                    Friction::Slips(i as f64)
                },
            })
            .collect();
        let made = manufactured::<3>(150, &nodes, general, &mut random);
        let problem = &made.problem;
        let angle = |node: usize| 0.3 + node as f64;
        let turned = problem.tangential().triplets().flat_map(|(row, j, v)| {
            let (node, second) = (row / 2, row % 2 == 1);
            let (sin, cos) = angle(node).sin_cos();
            let parts = if second { [-sin, cos] } else { [cos, sin] };
            [(2 * node, j, v * parts[0]), (2 * node + 1, j, v * parts[1])]
        });
        let other = ContactProblem::new(ContactData {
            stiffness: problem.stiffness().as_ref().clone(),
            load: problem.load().to_vec(),
            normal: problem.normal().clone(),
            tangential: Csr::from_triplets(60, 150, turned.collect::<Vec<_>>()),
            gap: problem.gap().to_vec(),
            slip_bound: problem.slip_bound().to_vec(),
            coordinates: None,
        })
        .or_panic();
        let settings = NewtonSettings {
            tolerance: 1e-10,
            ..Default::default()
        };
        let [a, b] = [problem, &other].map(|p| solve_on(p, Stiffness::Cholesky, &settings));
        assert!(distance(&a.u, &b.u) < 1e-8);
        assert!(
            a.info.iter.abs_diff(b.info.iter) <= 1,
            "{} {}",
            a.info.iter,
            b.info.iter
        );
        for i in 0..30 {
            let (sin, cos) = angle(i).sin_cos();
            let [s, t] = [a.lambda[30 + 2 * i], a.lambda[31 + 2 * i]];
            let expected = [cos * s - sin * t, sin * s + cos * t];
            let found = &b.lambda[30 + 2 * i..32 + 2 * i];
            assert!(
                distance(found, &expected) < 1e-6,
                "{i}: {found:?} {expected:?}"
            );
        }
    }
}
