//! Problems in space whose solution was chosen first: λτ within discs, on their circles in any direction, and on the
//! borders between.

mod common;

use common::{Random, distance};
use proptest::prelude::*;
use signorini::engine::{Engine, Options, Place, Stiffness};
use signorini::problem::{ContactData, ContactProblem};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::{self, Method, Settings, Solution, Status};
use std::ops::ControlFlow;

/// What a contact node does.
#[derive(Clone, Copy, Debug)]
enum Friction {
    /// ‖λτ‖ < g.
    Sticks,
    /// ‖λτ‖ = g, in the direction of this angle, as the slip.
    Slips(f64),
    /// ‖λτ‖ = g in this direction, without any slip.
    OnTheVerge(f64),
    /// λτ = 0 without slip, g > 0.
    Idle,
    /// g = 0.
    None,
}

impl Friction {
    /// Whether strict complementarity says in which set it is.
    fn is_clear(self) -> bool {
        !matches!(self, Self::OnTheVerge(_) | Self::None)
    }
}

#[derive(Clone, Copy, Debug)]
struct Node {
    separated: bool,
    friction: Friction,
}

struct Manufactured {
    problem: ContactProblem<3>,
    u: Vec<f64>,
    lambda: Vec<f64>,
}

type Row = Vec<(usize, f64)>;

fn times(row: &Row, u: &[f64]) -> f64 {
    row.iter().map(|&(j, v)| v * u[j]).sum()
}

fn matrix(rows: &[Row], n: usize) -> Csr {
    let all = rows.iter().enumerate();
    let entries = all.flat_map(|(i, row)| row.iter().map(move |&(j, v)| (i, j, v)));
    Csr::from_triplets(rows.len(), n, entries)
}

/// A network of springs on n unknowns; the rows of N and T pick unknowns, or mix them.
fn manufactured(n: usize, nodes: &[Node], general: bool, random: &mut Random) -> Manufactured {
    let m = nodes.len();
    assert!(3 * m <= n);
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
    let k = BlockCsr::<3>::from_triplets(n, n, entries);
    let mut order: Vec<usize> = (0..n).collect();
    for i in 0..n {
        order.swap(i, i + random.below(n - i));
    }
    let mut row = |pivot: usize| -> Row {
        let mut row = vec![(pivot, 1.0)];
        for _ in 0..if general { 3 } else { 0 } {
            let j = random.below(n);
            if row.iter().all(|&(i, _)| i != j) {
                row.push((j, random.between(-0.2, 0.2)));
            }
        }
        row
    };
    let normal: Vec<Row> = (0..m).map(|i| row(order[i])).collect();
    let tangential: Vec<Row> = (m..3 * m).map(|i| row(order[i])).collect();
    let mut u: Vec<f64> = (0..n).map(|_| random.between(-1.0, 1.0)).collect();
    let mut slips = vec![0.0; 2 * m];
    let (mut lambda, mut d, mut g) = (vec![0.0; 3 * m], vec![0.0; m], vec![0.0; m]);
    for (i, node) in nodes.iter().enumerate() {
        g[i] = random.between(0.2, 2.0);
        let (part, angle, slip) = match node.friction {
            Friction::Sticks => (random.between(0.0, 0.9), random.between(0.0, 6.0), 0.0),
            Friction::Slips(angle) => (1.0, angle, random.between(0.1, 1.0)),
            Friction::OnTheVerge(angle) => (1.0, angle, 0.0),
            Friction::Idle => (0.0, 0.0, 0.0),
            Friction::None => {
                g[i] = 0.0;
                (0.0, random.between(0.0, 6.0), random.between(0.0, 1.0))
            }
        };
        for (a, s) in [angle.cos(), angle.sin()].into_iter().enumerate() {
            lambda[m + 2 * i + a] = part * g[i] * s;
            slips[2 * i + a] = slip * s;
        }
    }
    // The pivots are dominant: sweeps over them arrange N u* ≥ 0.1 and T u* as it was chosen.
    for _ in 0..300 {
        for i in 0..m {
            let now = times(&normal[i], &u);
            if now < 0.1 {
                u[order[i]] += 0.1 + 0.5 * (i % 3) as f64 - now;
            }
        }
        for i in 0..2 * m {
            u[order[m + i]] += slips[i] - times(&tangential[i], &u);
        }
    }
    for (i, node) in nodes.iter().enumerate() {
        d[i] = times(&normal[i], &u);
        if node.separated {
            d[i] += random.between(0.1, 1.0);
        } else {
            lambda[i] = random.between(0.2, 2.0);
        }
    }
    let mut f = vec![0.0; k.n_rows()];
    let mut padded = u.clone();
    padded.resize(k.n_rows(), 0.0);
    k.mul(&padded, &mut f);
    f.truncate(n);
    for (i, row) in normal.iter().chain(&tangential).enumerate() {
        for &(j, v) in row {
            f[j] += v * lambda[i];
        }
    }
    let problem = ContactProblem::new(ContactData {
        stiffness: k,
        load: f,
        normal: matrix(&normal, n),
        tangential: matrix(&tangential, n),
        gap: d,
        slip_bound: g,
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"));
    Manufactured { problem, u, lambda }
}

fn solve(problem: &ContactProblem<3>, stiffness: Stiffness, settings: &Settings) -> Solution<3> {
    let options = Options {
        place: Place::Cpu,
        stiffness,
        ..Default::default()
    };
    let mut engine =
        Engine::new(problem, options, |_| {}).unwrap_or_else(|error| panic!("{error}"));
    ssnm::solve(
        problem,
        &mut engine,
        settings,
        |_| ControlFlow::Continue(()),
    )
    .unwrap_or_else(|error| panic!("{error}"))
}

fn check(nodes: &[Node], made: &Manufactured, settings: &Settings) -> Result<(), TestCaseError> {
    // Without any force there is nothing that rounding, which is all there is then, could be accurate beside.
    prop_assume!(made.lambda.iter().any(|&l| l != 0.0));
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        let found = solve(&made.problem, stiffness, settings);
        prop_assert_eq!(found.status, Status::Converged, "{:?}", stiffness);
        prop_assert!(found.info.kkt.max() <= 10.0 * settings.tolerance);
        prop_assert!(distance(&found.u[..made.u.len()], &made.u) < 1e-5);
        // Forces of these problems are about one, where there are any.
        let off = found.lambda.iter().zip(&made.lambda);
        let off = off.fold(0.0, |off: f64, (a, b)| off.max((a - b).abs()));
        prop_assert!(off < 1e-5, "{}", off);
        for (i, node) in nodes.iter().enumerate() {
            prop_assert_eq!(found.sets.is_separated(i), node.separated);
            if node.friction.is_clear() {
                let slips = matches!(node.friction, Friction::Slips(_));
                prop_assert_eq!(found.sets.slips(i), slips, "{}", i);
            }
        }
    }
    Ok(())
}

fn friction() -> impl Strategy<Value = Friction> {
    let angle = || 0.0f64..std::f64::consts::TAU;
    prop_oneof![
        3 => Just(Friction::Sticks),
        4 => angle().prop_map(Friction::Slips),
        1 => angle().prop_map(Friction::OnTheVerge),
        1 => Just(Friction::Idle),
        1 => Just(Friction::None),
    ]
}

const METHODS: &[Method] = &[Method::Multisecant, Method::Inexact, Method::Exact];

fn node() -> impl Strategy<Value = Node> {
    (any::<bool>(), friction()).prop_map(|(separated, friction)| Node {
        separated,
        friction,
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, ..ProptestConfig::default() })]

    #[test]
    fn any_sets_any_beta(
        nodes in prop::collection::vec(node(), 1..20),
        extra in 0usize..40,
        general in any::<bool>(),
        exponent in -2.0f64..3.0,
        method in prop::sample::select(METHODS),
        seed in 1u64..1 << 40,
    ) {
        let n = 3 * nodes.len() + extra;
        let made = manufactured(n, &nodes, general, &mut Random(seed));
        let settings = Settings {
            tolerance: 1e-9,
            beta: 10f64.powf(exponent),
            method,
            max_iterations: 2000,
            ..Default::default()
        };
        check(&nodes, &made, &settings)?;
    }
}

/// The directions of the tangents are a choice: any other pair of them gives the same answer in the same steps.
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
        let made = manufactured(150, &nodes, general, &mut random);
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
        .unwrap_or_else(|error| panic!("{error}"));
        let settings = Settings {
            tolerance: 1e-10,
            ..Default::default()
        };
        let [a, b] = [problem, &other].map(|p| solve(p, Stiffness::Cholesky, &settings));
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
