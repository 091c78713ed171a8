//! Commands: recorded, submitted in bounded portions, and waited for where the host needs numbers.

use super::arrays::State;
use super::buffers::Handle;
use super::kernels::Kernel;
use super::timing::Work;
use super::{Gpu, PIECE_BYTES, Params, STATE_BYTES};
use crate::backend::{BackendError, Precision, Run};
use std::collections::HashSet;
use std::sync::Arc;
use wgpu::BufferUsages;

/// Sets of parameters that are kept on the device at most: a hierarchy has some hundred.
const MOST_UNIFORMS: usize = 4096;
/// Submissions under way at most: one computes while the next one waits for it, and the host records a third.
const IN_FLIGHT: usize = 2;
/// Commands of a submission at most. A device waits while the host records the first ones: 64 take it about 0.1 ms.
pub(super) const MOST_COMMANDS: usize = 64;

/// Bytes of a buffer to bring to the host.
pub(super) struct Wanted<'a> {
    pub from: &'a Handle,
    pub offset: u64,
    pub bytes: u64,
}

/// A recorded command.
pub(super) enum Command {
    Dispatch {
        pipeline: wgpu::ComputePipeline,
        bind_group: wgpu::BindGroup,
        groups: u32,
        work: Work,
    },
    Copy(Handle, Handle),
    Clear(Handle),
}

impl Gpu {
    /// Drops the bind groups of dropped buffers, which nothing else keeps alive.
    fn forget(&mut self) {
        if self.uniforms.len() > MOST_UNIFORMS {
            self.uniforms.clear();
        }
        let gone = match self.gone.lock() {
            Ok(mut gone) => std::mem::take(&mut *gone),
            Err(_) => return,
        };
        if !gone.is_empty() {
            let gone: HashSet<u64> = gone.into_iter().collect();
            self.bind_groups
                .retain(|(_, key), _| !key.iter().any(|id| gone.contains(id)));
        }
    }

    fn uniform(&mut self, params: Params) -> Result<Handle, BackendError> {
        let words = params.words();
        if let Some(handle) = self.uniforms.get(&words) {
            return Ok(Arc::clone(handle));
        }
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let handle = self.allocate("parameters", size_of_val(&words) as u64, usage)?;
        self.context
            .queue
            .write_buffer(&handle.buffer.buffer, 0, bytemuck::cast_slice(&words));
        self.uniforms.insert(words, Arc::clone(&handle));
        Ok(handle)
    }

    /// Records a kernel. `bytes` is roughly its memory traffic.
    pub(super) fn dispatch(
        &mut self,
        kernel: Kernel,
        params: Params,
        buffers: &[&Handle],
        groups: u32,
        bytes: u64,
    ) {
        // A fault is kept by the context and reported where results are read.
        let Ok(uniform) = self.uniform(params) else {
            return;
        };
        let mut key = [u64::MAX; 9];
        key[0] = uniform.id;
        for (place, handle) in key[1..].iter_mut().zip(buffers) {
            *place = handle.id;
        }
        let context = &self.context;
        let pipeline = context.kernels.pipeline(kernel);
        let bind_group = self
            .bind_groups
            .entry((kernel, key))
            .or_insert_with(|| {
                let entries: Vec<_> = std::iter::once(&uniform)
                    .chain(buffers.iter().copied())
                    .enumerate()
                    .map(|(binding, handle)| wgpu::BindGroupEntry {
                        binding: binding as u32,
                        resource: handle.buffer.buffer.as_entire_binding(),
                    })
                    .collect();
                context
                    .device
                    .create_bind_group(&wgpu::BindGroupDescriptor {
                        label: None,
                        layout: &pipeline.get_bind_group_layout(0),
                        entries: &entries,
                    })
            })
            .clone();
        self.counters.dispatches += 1;
        self.record(Command::Dispatch {
            pipeline,
            bind_group,
            groups,
            work: Work {
                kernel,
                count: params.count,
                bytes,
            },
        });
        self.recorded_bytes += bytes;
        // Far below two seconds even at a tenth of the bandwidth of such a device.
        let most = if self.context.adapter.is_software {
            1
        } else {
            4
        } << 30;
        if self.recorded_bytes > most {
            self.submit(None);
        }
    }

    /// Records a command, after a submission where many have been recorded.
    pub(super) fn record(&mut self, command: Command) {
        if self.commands.len() == MOST_COMMANDS {
            self.submit(None);
        }
        self.commands.push(command);
    }

    /// Submits the recorded commands to the device, with copies to the host at the end.
    pub(super) fn submit(&mut self, copies: Option<(&Handle, &[Wanted])>) {
        if self.commands.is_empty() && copies.is_none() {
            return;
        }
        self.forget();
        let context = Arc::clone(&self.context);
        let mut encoder = context.device.create_command_encoder(&Default::default());
        let mut dispatched = Vec::new();
        let mut commands = self.commands.drain(..).peekable();
        while let Some(command) = commands.next() {
            match command {
                Command::Copy(from, to) => {
                    let (source, target) = (&from.buffer.buffer, &to.buffer.buffer);
                    encoder.copy_buffer_to_buffer(source, 0, target, 0, from.buffer.size);
                }
                Command::Clear(handle) => encoder.clear_buffer(&handle.buffer.buffer, 0, None),
                first @ Command::Dispatch { .. } => {
                    let at = 2 * dispatched.len() as u32;
                    let timestamp_writes =
                        (self.times.as_ref()).map(|times| wgpu::ComputePassTimestampWrites {
                            query_set: &times.set,
                            beginning_of_pass_write_index: Some(at),
                            end_of_pass_write_index: Some(at + 1),
                        });
                    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
                        label: None,
                        timestamp_writes,
                    });
                    let mut next = Some(first);
                    while let Some(Command::Dispatch {
                        pipeline,
                        bind_group,
                        groups,
                        work,
                    }) = &next
                    {
                        pass.set_pipeline(pipeline);
                        pass.set_bind_group(0, bind_group, &[]);
                        pass.dispatch_workgroups(*groups, 1, 1);
                        dispatched.push(*work);
                        // One pass for each dispatch where it is timed.
                        next = commands.next_if(|c| {
                            self.times.is_none() && matches!(c, Command::Dispatch { .. })
                        });
                    }
                }
            }
        }
        if let Some((staging, sources)) = copies {
            let mut to = 0;
            for wanted in sources {
                encoder.copy_buffer_to_buffer(
                    &wanted.from.buffer.buffer,
                    wanted.offset,
                    &staging.buffer.buffer,
                    to,
                    wanted.bytes,
                );
                to += wanted.bytes;
            }
        }
        drop(commands);
        if let Some(times) = self.times.as_ref().filter(|_| !dispatched.is_empty()) {
            times.resolve(&mut encoder, dispatched.len());
        }
        context.submitting();
        let index = context.queue.submit([encoder.finish()]);
        self.add_times(&dispatched);
        self.counters.submissions += 1;
        self.recorded_bytes = 0;
        self.recorded_start = false;
        self.in_flight.push_back(index);
        if self.in_flight.len() > IN_FLIGHT {
            // Waiting bounds the memory of pending work; a fault appears where results are read.
            let _ = context.device.poll(wgpu::PollType::Wait {
                submission_index: self.in_flight.pop_front(),
                timeout: None,
            });
        }
    }

    /// The buffer for data that the host reads, of at least this many bytes.
    fn staging_of(&mut self, bytes: u64) -> Result<Handle, BackendError> {
        match self.staging.take() {
            Some(staging) if staging.buffer.size >= bytes => Ok(staging),
            _ => {
                let usage = BufferUsages::MAP_READ | BufferUsages::COPY_DST;
                self.allocate("staging", bytes, usage)
            }
        }
    }

    /// Makes room for reading vectors of this many unknowns, before multigrid takes the rest.
    pub(super) fn reserve_staging(&mut self, len: usize) -> Result<(), BackendError> {
        let bytes = (len as u64 * self.real_bytes()).clamp(STATE_BYTES, PIECE_BYTES);
        self.staging = Some(self.staging_of(bytes)?);
        Ok(())
    }

    /// Submits all work, waits for it, and passes the wanted bytes, one after the other, to `take`.
    pub(super) fn read(
        &mut self,
        sources: &[Wanted],
        take: impl FnOnce(&[u8]),
    ) -> Result<(), BackendError> {
        self.context.check()?;
        let bytes: u64 = sources.iter().map(|s| s.bytes).sum();
        let staging = self.staging_of(bytes)?;
        self.submit(Some((&staging, sources)));
        self.in_flight.clear();
        self.counters.readbacks += 1;
        self.context.mapped(&staging.buffer, bytes, take)?;
        self.staging = Some(staging);
        Ok(())
    }

    /// Sets the goals of the run to be recorded next.
    pub(super) fn write_goals(&mut self, state: &State, run: Run) {
        if self.recorded_start {
            // The parameters before must not be overwritten until they have been used.
            self.submit(None);
        }
        self.recorded_start = true;
        // The range of f32 ends at about 1e-38. A goal of zero stays zero: never reached.
        let least = match self.context.precision {
            Precision::F64 => 0.0,
            Precision::F32 => 1e-30,
        };
        let within_range = |goal: f64| if goal > 0.0 { goal.max(least) } else { 0.0 };
        let goals = [
            run.residual_part * run.residual_part,
            run.residual * run.residual,
            run.remaining,
            run.remaining_part,
            run.to_come,
        ];
        let goals = self.real_array(&goals.map(within_range));
        self.context
            .queue
            .write_buffer(&state.goals.buffer.buffer, 0, &goals);
    }
}
