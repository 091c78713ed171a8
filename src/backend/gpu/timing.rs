//! Times of kernels on the device, by timestamps around every dispatch.

use super::Gpu;
use super::buffers::Handle;
use super::kernels::Kernel;
use super::queue::MOST_COMMANDS;
use crate::backend::{Backend as _, BackendError};
use std::collections::HashMap;
use std::time::Duration;
use web_time::Instant;
use wgpu::BufferUsages;

/// The dispatches of a kernel for one number of rows or pairs.
#[derive(Clone, Debug, serde::Serialize)]
pub struct KernelTime {
    /// The kernel, with the shape of its blocks.
    pub kernel: String,
    /// Rows or pairs of unknowns of a dispatch.
    pub count: u32,
    /// Dispatches.
    pub dispatches: usize,
    /// Seconds of all of them.
    pub seconds: f64,
    /// Bytes that they have to move at least.
    pub bytes: u64,
}

/// What a dispatch does.
#[derive(Clone, Copy)]
pub(super) struct Work {
    pub kernel: Kernel,
    pub count: u32,
    pub bytes: u64,
}

/// The stopwatch of a device.
pub(super) struct Times {
    pub set: wgpu::QuerySet,
    resolved: Handle,
    readable: Handle,
    /// Dispatches, seconds and bytes of all work of a kind.
    sums: HashMap<(Kernel, u32), (usize, f64, u64)>,
}

impl Times {
    /// Brings the timestamps of so many dispatches to memory that the host can read.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder, dispatches: usize) {
        let resolved = &self.resolved.buffer.buffer;
        encoder.resolve_query_set(&self.set, 0..2 * dispatches as u32, resolved, 0);
        let readable = &self.readable.buffer;
        encoder.copy_buffer_to_buffer(resolved, 0, &readable.buffer, 0, readable.size);
    }
}

/// The speed of a device.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Speed {
    /// Bytes per second of y += x: the measure for all that memory bounds.
    pub bandwidth: f64,
    /// Seconds of a launch that has hardly any work and waits for the one before.
    pub launch: f64,
}

impl Gpu {
    /// Measures the device with vectors of this many bytes for some time: an idle one takes a moment to wake up.
    pub fn speed(&mut self, bytes: u64, time: Duration) -> Result<Speed, BackendError> {
        let bytes = bytes.min(self.context.max_binding());
        let len = (bytes / self.real_bytes()) as usize;
        let moved = 3 * len as u64 * self.real_bytes();
        Ok(Speed {
            bandwidth: moved as f64 / self.time_of_addition(len, 10, time)?,
            launch: self.time_of_addition(2, 100, time)?,
        })
    }

    /// Seconds of y += x: the best of several times `repeats` in a row.
    fn time_of_addition(
        &mut self,
        len: usize,
        repeats: u32,
        time: Duration,
    ) -> Result<f64, BackendError> {
        let (x, mut y) = (self.vector(len)?, self.vector(len)?);
        let mut best = f64::INFINITY;
        let begin = Instant::now();
        while best.is_infinite() || begin.elapsed() < time {
            let start = Instant::now();
            for _ in 0..repeats {
                self.add(1.0, &x, &mut y);
            }
            self.submit(None);
            // A fault shows in the check.
            let _ = self.context.wait();
            self.context.check()?;
            best = best.min(start.elapsed().as_secs_f64() / f64::from(repeats));
        }
        Ok(best)
    }

    /// Times every kernel from now on, one after the other, if the context has timestamps. The whole takes longer then.
    pub fn time_kernels(&mut self) -> Result<(), BackendError> {
        let features = self.context.device.features();
        if !features.contains(wgpu::Features::TIMESTAMP_QUERY) {
            return Ok(());
        }
        self.submit(None);
        let bytes = 16 * MOST_COMMANDS as u64;
        let usage = BufferUsages::QUERY_RESOLVE | BufferUsages::COPY_SRC;
        let resolved = self.allocate("timestamps", bytes, usage)?;
        let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
        let readable = self.allocate("timestamps", bytes, usage)?;
        let description = wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count: 2 * MOST_COMMANDS as u32,
        };
        self.times = Some(Times {
            set: self.context.device.create_query_set(&description),
            resolved,
            readable,
            sums: HashMap::new(),
        });
        Ok(())
    }

    /// Adds up the times of dispatches that have just been submitted.
    pub(super) fn add_times(&mut self, dispatched: &[Work]) {
        let Some(times) = &mut self.times else {
            return;
        };
        let unit = 1e-9 * f64::from(self.context.queue.get_timestamp_period());
        let readable = &times.readable.buffer;
        let sums = &mut times.sums;
        // A fault shows where results are read.
        let _ = self.context.mapped(readable, readable.size, |bytes| {
            let ticks: &[u64] = bytemuck::cast_slice(bytes);
            for (work, ticks) in dispatched.iter().zip(ticks.as_chunks::<2>().0) {
                let (dispatches, seconds, bytes) =
                    sums.entry((work.kernel, work.count)).or_default();
                *dispatches += 1;
                *seconds += unit * ticks[1].saturating_sub(ticks[0]) as f64;
                *bytes += work.bytes;
            }
        });
    }

    /// The times since [`Gpu::time_kernels`], which this ends; the longest first.
    pub fn kernel_times(&mut self) -> Vec<KernelTime> {
        self.submit(None);
        let sums = self.times.take().map(|times| times.sums);
        let mut all: Vec<KernelTime> = (sums.into_iter().flatten())
            .map(
                |((kernel, count), (dispatches, seconds, bytes))| KernelTime {
                    kernel: kernel.to_string(),
                    count,
                    dispatches,
                    seconds,
                    bytes,
                },
            )
            .collect();
        all.sort_by(|a, b| b.seconds.total_cmp(&a.seconds));
        all
    }
}
