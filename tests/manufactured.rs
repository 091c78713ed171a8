//! Problems whose solution was chosen first (validation by construction).

mod common;

use common::{Node, Random, distance, manufactured, solve};
use proptest::prelude::*;
use signorini::engine::{Engine, Options, Place, Stiffness};
use signorini::ssnm::{self, Method, Settings, Status};
use std::ops::ControlFlow;

const METHODS: &[Method] = &[Method::Multisecant, Method::Inexact, Method::Exact];

fn node() -> impl Strategy<Value = Node> {
    (any::<bool>(), -1i8..=1).prop_map(|(separated, slip)| Node { separated, slip })
}

/// Solves to 1e-9 and compares with the chosen solution and sets.
fn check(m: &common::Manufactured, settings: &Settings) -> Result<(), TestCaseError> {
    let solution = solve(&m.problem, settings);
    prop_assert_eq!(solution.status, Status::Converged);
    prop_assert!(solution.info.kkt.max() <= 10.0 * settings.tolerance);
    prop_assert!(distance(&solution.u[..m.u.len()], &m.u) < 1e-5);
    prop_assert!(distance(&solution.lambda, &m.lambda) < 1e-5);
    for (i, node) in m.nodes.iter().enumerate() {
        prop_assert_eq!(solution.sets.is_separated(i), node.separated);
        prop_assert_eq!(solution.sets.slip_sign(i), node.slip);
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn any_sets_any_beta(
        nodes in prop::collection::vec(node(), 1..25),
        extra in 0usize..40,
        general in any::<bool>(),
        exponent in -2.0f64..3.0,
        method in prop::sample::select(METHODS),
        seed in 1u64..1 << 40,
    ) {
        let n = 2 * nodes.len() + extra;
        let problem = manufactured(n, &nodes, general, &mut Random(seed));
        let settings = Settings {
            tolerance: 1e-9,
            beta: 10f64.powf(exponent),
            method,
            max_iterations: 2000,
            ..Default::default()
        };
        check(&problem, &settings)?;
    }
}

#[test]
fn exact_and_inexact_agree() {
    let mut random = Random(7);
    for general in [false, true] {
        let nodes: Vec<Node> = (0..60)
            .map(|i| Node {
                separated: i % 3 == 0,
                slip: (i % 5) as i8 % 3 - 1,
            })
            .collect();
        let m = manufactured(400, &nodes, general, &mut random);
        let [a, b] = [Method::Inexact, Method::Exact].map(|method| {
            let settings = Settings {
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
    let uniform = |m, separated, slip| vec![Node { separated, slip }; m];
    let mut random = Random(99);
    for general in [false, true] {
        for nodes in [
            uniform(1, false, 0),
            uniform(1, true, 1),
            uniform(17, true, 0),
            uniform(17, true, -1),
            uniform(17, false, 0),
            uniform(17, false, 1),
        ] {
            // n = 2m leaves no unknown free of contact; odd n is padded inside.
            for n in [2 * nodes.len(), 2 * nodes.len() + 1, 77] {
                let m = manufactured(n, &nodes, general, &mut random);
                let settings = Settings {
                    tolerance: 1e-9,
                    ..Default::default()
                };
                check(&m, &settings).unwrap_or_else(|error| panic!("n = {n}: {error}"));
            }
        }
    }
}

/// λν = 0 at zero gap and |λτ| = g at zero slip: no strict complementarity, but still one solution.
#[test]
fn degenerate_nodes() {
    use signorini::problem::ContactData;
    let nodes: Vec<Node> = (0..20)
        .map(|i| Node {
            separated: i % 2 == 0,
            slip: 0,
        })
        .collect();
    for seed in 1..20 {
        let m = manufactured(70, &nodes, seed % 2 == 0, &mut Random(seed));
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
        let problem = signorini::problem::ContactProblem::new(ContactData {
            stiffness: p.stiffness().as_ref().clone(),
            load: p.load().to_vec(),
            normal: p.normal().clone(),
            tangential: p.tangential().clone(),
            gap,
            slip_bound,
            coordinates: None,
        })
        .unwrap_or_else(|error| panic!("{error}"));
        for beta in [0.01, 1.0, 1000.0] {
            let settings = Settings {
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
    use signorini::problem::{ContactData, ContactProblem};
    use signorini::sparse::Csr;
    let nodes: Vec<Node> = (0..12)
        .map(|i| Node {
            separated: i % 2 == 0,
            slip: 0,
        })
        .collect();
    let m = manufactured(50, &nodes, false, &mut Random(5));
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
        .unwrap_or_else(|error| panic!("{error}"));
        solve(&problem, &Settings::default())
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
        let nodes: Vec<Node> = (0..m)
            .map(|_| Node {
                separated: random.below(3) == 0,
                slip: random.below(3) as i8 - 1,
            })
            .collect();
        let problem = manufactured(n, &nodes, i % 2 == 0, &mut random).problem;
        let settings = Settings {
            tolerance: [1e-4, 1e-6, 1e-9][i % 3],
            beta: [0.05, 1.0, 1.9, 30.0][i % 4],
            ..Default::default()
        };
        let [exact, nested] = [Stiffness::Cholesky, Stiffness::Pcg].map(|stiffness| {
            let options = Options {
                place: Place::Cpu,
                stiffness,
                ..Default::default()
            };
            let mut engine =
                Engine::new(&problem, options, |_| {}).unwrap_or_else(|error| panic!("{error}"));
            let solution = ssnm::solve(&problem, &mut engine, &settings, |_| {
                ControlFlow::Continue(())
            })
            .unwrap_or_else(|error| panic!("{i}: {error}"));
            assert_eq!(solution.status, Status::Converged, "{i}: {stiffness:?}");
            solution.info
        });
        assert!(nested.iter <= 2 * exact.iter + 4, "{i}: {nested:?}");
        exact_products += exact.n_a;
        nested_products += nested.n_a;
    }
    // Products that are only as exact as need be cannot be recycled as often.
    let ratio = nested_products as f64 / exact_products as f64;
    assert!(
        ratio < 1.5,
        "{nested_products} for {exact_products} products"
    );
}
