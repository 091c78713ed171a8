//! Devices that are lost, and adapters with too little of something.

use super::solves::solve;
use super::{context, one_body};
use crate::common::or_panic::OrPanic as _;
use signorini::backend::Backend as _;
use signorini::backend::gpu::{Context, Gpu};
use signorini::backend::{BackendError, GpuOptions, Precision, gpu};
use signorini::control::{Accuracy, Stop};
use signorini::dual::DirectDual;
use signorini::dual::{DualOperator as _, NestedDual, Request};
use signorini::engine::{Device, Engine, EngineOptions, Stiffness};
use signorini::sparse::BlockCsr;
use signorini::ssnm;
use signorini::ssnm::{NewtonSettings, Solution, Status};
use signorini::ssnm::{Step, WarmStart};
use signorini::stiffness::pcg::Preconditioner;
use std::ops::ControlFlow;
use std::sync::Arc;

#[test]
fn a_lost_device_falls_back_if_the_choice_is_open_and_else_is_a_clear_error() {
    let problem = one_body(1);
    let settings = NewtonSettings::default();
    let (expected, _) = solve(&problem, &EngineOptions::default(), &settings);
    let adapter = gpu::adapters().first().map(|adapter| adapter.name.clone());
    for place in [Device::Auto, Device::Gpu] {
        let options = EngineOptions {
            place,
            stiffness: Stiffness::Pcg,
            preconditioner: Preconditioner::Multigrid,
            gpu: GpuOptions {
                adapter: adapter.clone(),
                ..Default::default()
            },
        };
        let (say, heard) = std::sync::mpsc::channel();
        let mut engine = Engine::new(&problem, options, move |line| {
            say.send(line.to_owned()).expect("somebody listens");
        })
        .or_panic();
        assert_eq!(engine.backend(), "gpu");
        let context = Arc::clone(engine.context().expect("a GPU has a context"));
        let outcome = ssnm::solve(&problem, &mut engine, &settings, |step| {
            if step.iter == 2 {
                context.lose_device();
            }
            ControlFlow::Continue(())
        });
        if place == Device::Auto {
            let found = outcome.or_panic();
            assert_eq!((engine.backend(), engine.stiffness()), ("cpu", "pcg"));
            assert_eq!(found.status, Status::Converged);
            // The steps made on the GPU are not made again.
            assert!(
                found.info.iter <= expected.info.iter + 3,
                "{:?}",
                found.info
            );
            assert!(
                found.info.n_a <= expected.info.n_a * 3 / 2,
                "{:?}",
                found.info
            );
            assert!(crate::common::distance(&found.u, &expected.u) < 1e-5);
            drop(engine);
            let log: Vec<String> = heard.try_iter().collect();
            assert!(
                log.last().is_some_and(|line| line.contains("lost")),
                "{log:?}"
            );
        } else {
            let error = outcome.expect_err("the choice is fixed");
            let text = error.to_string();
            assert!(text.contains("lost"), "{text}");
            assert_eq!(error.history.len(), 2, "the steps made are kept");
            // The results so far can start another solve.
            let mut dual = DirectDual::new(&problem).or_panic();
            let start = WarmStart {
                lambda: Some(&error.lambda),
                ..Default::default()
            };
            let go_on = |_: &Step| ControlFlow::Continue(());
            let again = ssnm::solve_from(start, &problem, &mut dual, &settings, go_on).or_panic();
            assert_eq!(again.status, Status::Converged);
            let first = |solution: &Solution| solution.info.history[0].err;
            assert!(first(&again) < first(&expected), "it starts ahead");
        }
    }
}

/// Wherever the device is lost, including set-up, the CPU continues as `auto` would have begun there.
#[test]
fn a_device_lost_at_any_submission() {
    let problem = one_body(1);
    let settings = NewtonSettings::default();
    let (expected, _) = solve(&problem, &EngineOptions::default(), &settings);
    let adapter = gpu::adapters().first().map(|adapter| adapter.name.clone());
    let mut lost = 0;
    for k in 0..20_usize {
        let options = EngineOptions {
            place: Device::Auto,
            stiffness: Stiffness::Pcg,
            gpu: GpuOptions {
                adapter: adapter.clone(),
                ..Default::default()
            },
            ..Default::default()
        };
        let mut engine = Engine::new(&problem, options, |_| {}).or_panic();
        assert_eq!(engine.backend(), "gpu");
        let context = Arc::clone(engine.context().expect("a GPU has a context"));
        context.lose_device_after(3 * k);
        let found = ssnm::solve(&problem, &mut engine, &settings, |_| {
            ControlFlow::Continue(())
        })
        .unwrap_or_else(|error| panic!("after {}: {error}", 3 * k));
        assert_eq!(found.status, Status::Converged);
        assert!(crate::common::distance(&found.u, &expected.u) < 1e-5);
        if engine.backend() == "cpu" {
            lost += 1;
            assert_eq!(engine.stiffness(), "pcg");
        }
    }
    assert!(lost >= 10, "{lost}");
}

/// Every new load makes its own buffers: bindings of earlier ones must not accumulate over thousands of rounds.
#[test]
fn bindings_of_dropped_buffers_are_dropped() {
    let problem = one_body(1);
    let context = context(Precision::F64, None);
    let gpu = Gpu::new(&context).or_panic();
    let mut dual = NestedDual::new(&problem, gpu, Preconditioner::Multigrid).or_panic();
    let lambda = vec![0.0; 2 * problem.m()];
    let mut r = lambda.clone();
    let accuracy = Accuracy::Energy {
        absolute: 0.0,
        relative: 0.1,
    };
    let mut kept = Vec::new();
    for round in 0..60 {
        let load: Vec<f64> = problem
            .load()
            .iter()
            .map(|f| f * f64::from(round + 1))
            .collect();
        let [gap, origin, bound] =
            [problem.gap(), problem.slip_origin(), problem.slip_bound()].map(<[f64]>::to_vec);
        let there = (problem.with_data(load, gap, origin, bound)).or_panic();
        let (force, stop) = (there.load_case().force(), Stop::default());
        dual.at_contact(&Request::new(force, &lambda, accuracy, &stop), &mut r)
            .or_panic();
        kept.push(dual.backend().kept());
    }
    assert!(kept[59] <= kept[9] + 2, "{kept:?}");
}

#[test]
fn a_device_that_is_lost_before_or_while_setting_up() {
    let context = context(Precision::F64, None);
    let mut gpu = Gpu::new(&context).or_panic();
    let mut x = gpu.vector(10).or_panic();
    context.lose_device();
    gpu.upload(&[1.0; 10], &mut x);
    let error = gpu.download(&x, &mut [0.0; 10]).err();
    assert!(
        matches!(error, Some(BackendError::Lost { .. })),
        "{error:?}"
    );
    let error = gpu.vector(1000).err();
    assert!(
        matches!(error, Some(BackendError::Lost { .. })),
        "{error:?}"
    );
}

#[test]
fn limits_that_are_too_small_are_named() {
    let small = context(Precision::F64, Some(4096));
    let mut gpu = Gpu::new(&small).or_panic();
    let row = (0..500).map(|j| (0, 2 * j, 1.0));
    let k = Arc::new(BlockCsr::<2>::from_triplets(1000, 1000, row));
    let error = gpu.matrix(k).err();
    assert!(
        matches!(error, Some(BackendError::DenseRow { .. })),
        "{error:?}"
    );

    let context = context(Precision::F64, None);
    if context.adapter.memory.is_some() {
        let error = context.check_memory("the stiffness matrix", 1 << 50).err();
        let text = error.map(|error| error.to_string()).unwrap_or_default();
        assert!(
            text.contains("the stiffness matrix") && text.contains("MiB"),
            "{text}"
        );
    }
    let options = GpuOptions {
        adapter: Some("no such adapter".into()),
        ..Default::default()
    };
    let error = Context::new(&options)
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(
        error.contains("no such adapter") && error.contains("0: "),
        "{error}"
    );
}
