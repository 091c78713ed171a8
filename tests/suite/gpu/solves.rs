//! Contact problems on every path, and their costs in launches.

use super::{context, one_body};
use crate::common::Random;
use crate::common::manufactured::{Node, manufactured};
use crate::common::or_panic::OrPanic as _;
use signorini::backend::gpu::Gpu;
use signorini::backend::{GpuOptions, Precision};
use signorini::control::{Accuracy, Costs, Stop};
use signorini::dual::{DualOperator as _, NestedDual};
use signorini::engine::{Device, Engine, EngineOptions, Stiffness};
use signorini::problem::ContactProblem;
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm;
use signorini::ssnm::{Info, NewtonSettings, Solution, Status};
use signorini::stiffness::pcg::Preconditioner;
use signorini::table1::BETAS;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The paths besides the reference.
pub fn paths() -> Vec<(&'static str, EngineOptions)> {
    let gpu = |precision| GpuOptions {
        precision: Some(precision),
        checked: true,
        ..Default::default()
    };
    vec![
        (
            "PCG on the CPU",
            EngineOptions {
                place: Device::Cpu,
                stiffness: Stiffness::Pcg,
                ..Default::default()
            },
        ),
        (
            "GPU in f64",
            EngineOptions {
                place: Device::Gpu,
                gpu: gpu(Precision::F64),
                ..Default::default()
            },
        ),
        (
            "GPU in f32",
            EngineOptions {
                place: Device::Gpu,
                gpu: gpu(Precision::F32),
                ..Default::default()
            },
        ),
    ]
}

pub fn solve(
    problem: &ContactProblem,
    options: &EngineOptions,
    settings: &NewtonSettings,
) -> (Solution, Option<Costs>) {
    let mut engine = Engine::new(problem, options.clone(), |_| {}).or_panic();
    let solution = ssnm::solve(
        problem,
        &mut engine,
        settings,
        |_| ControlFlow::Continue(()),
    )
    .or_panic();
    (solution, engine.costs())
}

#[test]
fn every_path_solves_the_table() {
    for (k, beta) in [1, 3].into_iter().flat_map(|k| BETAS.map(|beta| (k, beta))) {
        let problem = one_body(k);
        let settings = NewtonSettings {
            tolerance: 1e-6,
            beta,
            ..Default::default()
        };
        let (expected, _) = solve(&problem, &EngineOptions::default(), &settings);
        let mut on_cpu = None;
        for (path, options) in paths() {
            let (found, costs) = solve(&problem, &options, &settings);
            let what = format!("{path}, k = {k}, β = {beta}");
            assert_eq!(found.status, Status::Converged, "{what}");
            // Products that are only as accurate as necessary lead to the same point by a slightly different path.
            let Info { iter, n_a, .. } = found.info;
            assert!(iter <= expected.info.iter + 6, "{what}: {iter}");
            assert!(n_a <= 2 * expected.info.n_a, "{what}: {n_a}");

            // Both are that far from the solution; their distance from each other is a matter of chance, and so is the
            // side of a bound for a multiplier that is hardly off it.
            let close = |f: usize, e: usize| f.abs_diff(e) <= 2;
            let sizes = |found: &Solution| found.sets.sizes(|i| problem.has_friction(i));
            let (f, e) = (sizes(&found), sizes(&expected));
            assert!(
                close(f.separated, e.separated)
                    && close(f.stick, e.stick)
                    && close(f.slip.total(), e.slip.total()),
                "{what}: {f:?} {e:?}"
            );
            let apart = |a: &[f64], b: &[f64]| crate::common::distance(a, b);
            assert!(apart(&found.u, &expected.u) < 1e-4, "{what}");
            assert!(apart(&found.lambda, &expected.lambda) < 1e-2, "{what}");
            // CPU and GPU differ only in the rounding of the V-cycle.
            if !path.ends_with("f32") {
                let (iter_there, n_a_there) = *on_cpu.get_or_insert((iter, n_a));
                assert!(
                    iter.abs_diff(iter_there) <= 5,
                    "{what}: {iter} {iter_there}"
                );
                assert!(n_a.abs_diff(n_a_there) <= 15, "{what}: {n_a} {n_a_there}");
            }
            let Costs { solves, device } = costs.expect("the nested path counts");
            // One look at the progress per system, rarely two; corrections in f32 need several, each with
            // its result.
            let looks = if path.ends_with("f32") { 9 } else { 2 };
            assert!(
                device.readbacks <= looks * solves.solves,
                "{what}: {device:?} {solves:?}"
            );
        }
    }
}

#[test]
fn manufactured_problems_on_every_path() {
    let mut random = Random(17);
    for (n, m, general) in [
        (3, 1, false),
        (40, 9, false),
        (41, 9, true),
        (301, 60, true),
    ] {
        let nodes: Vec<Node> = (0..m).map(|_| Node::any(&mut random)).collect();
        let made = manufactured::<2>(n, &nodes, general, &mut random);
        let settings = NewtonSettings {
            tolerance: 1e-8,
            ..Default::default()
        };
        let (expected, _) = solve(&made.problem, &EngineOptions::default(), &settings);
        for (path, options) in paths() {
            let (found, _) = solve(&made.problem, &options, &settings);
            let what = format!("{path}, n = {n}, m = {m}");
            assert_eq!(found.status, Status::Converged, "{what}");
            assert!(found.info.iter <= expected.info.iter + 6, "{what}");
            assert!(found.sets == expected.sets, "{what}");
            assert!(
                crate::common::distance(&found.u[..n], &made.u) < 1e-6,
                "{what}"
            );
            let apart = crate::common::distance(&found.lambda, &made.lambda);
            assert!(apart < 1e-6, "{what}: {apart}");
        }
    }
}

#[test]
fn six_dispatches_per_iteration_of_block_jacobi_and_few_read_backs() {
    let problem = one_body(1);
    let gpu = Gpu::new(&context(Precision::F64, None)).or_panic();
    let mut dual = NestedDual::new(&problem, gpu, Preconditioner::BlockJacobi).or_panic();
    let p = vec![1.0; 2 * problem.m()];
    let mut y = p.clone();
    // The first product learns how many iterations one takes.
    dual.apply(&p, &mut y, Accuracy::Residual(1e-6), &Stop::default())
        .or_panic();
    for _ in 0..4 {
        let before = dual.costs().expect("it counts");
        dual.apply(&p, &mut y, Accuracy::Residual(1e-6), &Stop::default())
            .or_panic();
        let after = dual.costs().expect("it counts");
        let iterations = after.solves.iterations - before.solves.iterations;
        let dispatches = after.device.dispatches - before.device.dispatches;
        let readbacks = after.device.readbacks - before.device.readbacks;
        // In addition to the iterations: Bᵀp, the start of CG in two, z and p in three, and Bx with each look at the
        // progress.
        assert_eq!((dispatches - 6 - readbacks) % 6, 0);
        let issued = (dispatches - 6 - readbacks) / 6;
        assert!(
            issued >= iterations && 10 * issued <= 13 * iterations,
            "{issued} {iterations}"
        );
        assert_eq!(issued, after.solves.issued - before.solves.issued);
        assert!(readbacks <= 3, "{readbacks} {iterations}");
    }
}

#[test]
fn a_request_to_stop_is_heard_inside_a_solve_with_k() {
    let problem = one_body(1);
    for (path, options) in paths() {
        let mut engine = Engine::new(&problem, options, |_| {}).or_panic();
        let flag = Arc::new(AtomicBool::new(true));
        let settings = NewtonSettings {
            interrupt: Some(Arc::clone(&flag)),
            ..Default::default()
        };
        let stopped = ssnm::solve(&problem, &mut engine, &settings, |_| {
            ControlFlow::Continue(())
        })
        .or_panic();
        assert_eq!(stopped.status, Status::Interrupted, "{path}");
        assert_eq!(stopped.info.iter, 0, "{path}");
        assert!(stopped.u.iter().all(|v| v.is_finite()), "{path}");
        flag.store(false, Ordering::Relaxed);
        let stopped = ssnm::solve(&problem, &mut engine, &settings, |step| {
            flag.store(step.iter == 3, Ordering::Relaxed);
            ControlFlow::Continue(())
        })
        .or_panic();
        assert_eq!(
            (stopped.status, stopped.info.iter),
            (Status::Interrupted, 3),
            "{path}"
        );
    }
}

#[test]
fn a_singular_matrix_is_an_error_of_the_problem() {
    // Two nodes joined by springs and held by nothing, pulled.
    let spring = [(0, 0, 1.0), (2, 2, 1.0), (0, 2, -1.0), (2, 0, -1.0)];
    let other = spring.map(|(i, j, v)| (i + 1, j + 1, v));
    let problem: ContactProblem = ContactProblem::new(signorini::problem::ContactData {
        stiffness: BlockCsr::from_triplets(4, 4, spring.into_iter().chain(other)),
        load: vec![1.0, 0.0, 0.0, 0.0],
        normal: Csr::from_triplets(1, 4, [(0, 3, 1.0)]),
        tangential: Csr::from_triplets(1, 4, [(0, 2, 1.0)]),
        gap: vec![0.0],
        slip_bound: vec![0.1],
        coordinates: None,
    })
    .or_panic();
    for (path, options) in paths() {
        for preconditioner in [Preconditioner::Multigrid, Preconditioner::BlockJacobi] {
            let options = EngineOptions {
                preconditioner,
                ..options.clone()
            };
            // Multigrid notices when it is set up, block-Jacobi in the first solve.
            let text = match Engine::new(&problem, options, |_| {}) {
                Err(error) => error.to_string(),
                Ok(mut engine) => {
                    let settings = NewtonSettings::default();
                    ssnm::solve(&problem, &mut engine, &settings, |_| {
                        ControlFlow::Continue(())
                    })
                    .expect_err("K is singular")
                    .to_string()
                }
            };
            assert!(
                text.contains("supports"),
                "{path}, {preconditioner:?}: {text}"
            );
        }
    }
}

/// Matrices and preconditioner of another K, and other rows, come to the device.
#[test]
fn an_engine_switches_to_another_problem_there() {
    use crate::updated::{check, plane, space};
    for (path, options) in paths().into_iter().filter(|(path, _)| path.contains("GPU")) {
        println!("{path}");
        check(|young, slope| plane([45, 15], young, slope), &options);
        check(|young, slope| space([15, 5, 5], young, slope), &options);
    }
}
