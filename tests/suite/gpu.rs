//! The kernels against the CPU backend, whole solves on every path, and failures of a GPU.
//!
//! Every test here needs an adapter; a software one suffices (`sh tests/run.sh` installs it).

mod kernels;
mod levels;
mod lost;
mod solves;

use crate::common::or_panic::OrPanic as _;
use signorini::backend::gpu::Context;
use signorini::backend::{GpuOptions, Precision};
use signorini::engine::{Device, Engine, EngineOptions, Stiffness};
use signorini::problem::ContactProblem;
use signorini::reference;
use signorini::reference::{Geometry, TABLE1};
use std::sync::Arc;

pub const PRECISIONS: [Precision; 2] = [Precision::F64, Precision::F32];

/// Invocations of a device: one a row, as on a software adapter, and many that share rows, as on a real GPU.
pub const INVOCATIONS: [Option<usize>; 2] = [None, Some(1 << 17)];

/// All pairs.
pub fn each<A: Copy, B: Copy, const N: usize, const M: usize>(
    a: [A; N],
    b: [B; M],
) -> impl Iterator<Item = (A, B)> {
    a.into_iter().flat_map(move |a| b.map(|b| (a, b)))
}

/// A device with all checks of the kernels on.
pub fn context(precision: Precision, max_binding: Option<u64>) -> Arc<Context> {
    device(precision, max_binding, None)
}

/// As [`context`], with a device that wants at least so many invocations.
pub fn device(
    precision: Precision,
    max_binding: Option<u64>,
    least_invocations: Option<usize>,
) -> Arc<Context> {
    let options = GpuOptions {
        precision: Some(precision),
        max_binding,
        least_invocations,
        checked: true,
        ..Default::default()
    };
    Context::new(&options).unwrap_or_else(|error| {
        panic!(
            "{error}\nthese tests need an adapter with f64: `sh tests/run.sh` installs a software one \
             (Debian: apt-get install mesa-vulkan-drivers libvulkan1)"
        )
    })
}

pub fn one_body(k: usize) -> ContactProblem {
    let mesh = reference::mesh(Geometry::OneBody, k);
    reference::problem(Geometry::OneBody, &mesh, &TABLE1).or_panic()
}

/// The first engine takes it; one that nobody takes, and options that need none, do no harm.
#[test]
fn a_device_opens_ahead_of_its_engine() {
    let problem = one_body(1);
    for (place, stiffness) in each(
        [Device::Gpu, Device::Auto, Device::Cpu],
        [Stiffness::Auto, Stiffness::Pcg],
    ) {
        let mut options = EngineOptions {
            place,
            stiffness,
            ..Default::default()
        };
        options.open_ahead(2, problem.n());
        assert_eq!(options.gpu.ahead.is_some(), place == Device::Gpu);
        let solved = [(); 2].map(|()| {
            let mut engine = Engine::new(&problem, options.clone(), |_| {}).or_panic();
            problem
                .solve_on(&mut engine, &Default::default())
                .or_panic()
                .u
        });
        assert_eq!(solved[0], solved[1]);
    }
    let mut options = EngineOptions::default();
    options.open_ahead(3, 1 << 20);
    assert!(options.gpu.ahead.is_some());
}
