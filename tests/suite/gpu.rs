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
use signorini::problem::ContactProblem;
use signorini::reference;
use signorini::reference::{Geometry, TABLE1};
use std::sync::Arc;

pub const PRECISIONS: [Precision; 2] = [Precision::F64, Precision::F32];

/// A device with all checks of the kernels on.
pub fn context(precision: Precision, max_binding: Option<u64>) -> Arc<Context> {
    let options = GpuOptions {
        precision: Some(precision),
        max_binding,
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
