//! Times of kernels on the device, by timestamps around every dispatch.

use super::Gpu;
use super::buffers::Handle;
use super::kernels::Kernel;
use super::queue::MOST_COMMANDS;
use crate::backend::BackendError;
use std::collections::HashMap;
use std::sync::mpsc;
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

impl Gpu {
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
        let slice = times.readable.buffer.buffer.slice(..);
        let (sender, receiver) = mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // The receiver is gone only if the wait below has failed.
            let _ = sender.send(result);
        });
        // A fault shows where results are read.
        let _ = self.context.wait();
        if let Ok(Ok(())) = receiver.try_recv()
            && let Ok(view) = slice.get_mapped_range()
        {
            let ticks: &[u64] = bytemuck::cast_slice(&view);
            let unit = 1e-9 * f64::from(self.context.queue.get_timestamp_period());
            for (work, ticks) in dispatched.iter().zip(ticks.as_chunks::<2>().0) {
                let (dispatches, seconds, bytes) =
                    times.sums.entry((work.kernel, work.count)).or_default();
                *dispatches += 1;
                *seconds += unit * ticks[1].saturating_sub(ticks[0]) as f64;
                *bytes += work.bytes;
            }
        }
        times.readable.buffer.buffer.unmap();
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
