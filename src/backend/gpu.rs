//! A GPU, through wgpu: the WGSL kernels in `shaders/`.
//!
//! - **Segments.** No storage binding may exceed a limit of the adapter (128 MiB on a software adapter,
//!   2 GiB − 1 on real ones), so vectors are cut into segments and K into parts (rows of one segment ×
//!   columns of one segment, cut further by rows); each gets a dispatch of its own. Nearly always there
//!   is one of each.
//! - **Scalars stay on the device.** Every workgroup adds up the partial sums that the dispatch before has
//!   left, in the same order, so that all know α and β without another dispatch, and one of them writes
//!   the state for the next dispatch. After the run is done, kernels return at once.
//! - **Submissions** hold a bounded amount of work, far below the seconds after which a driver takes the
//!   device away, and at most a few are under way at a time.

mod context;
mod kernels;
mod sliced;

pub use context::{AdapterSummary, Context, GpuError, Options, Precision, adapters};

use super::{Backend, Block, Progress, Run, scaled_to_f32};
use crate::control::Counters;
use crate::sparse::stored::power_of_two_below;
use crate::sparse::stored::{BlockMatrix, Dense};
use crate::sparse::{BlockCsr, Csr};
use context::Buffer;
use kernels::{Kernel, Shape};
use rayon::prelude::*;
use sliced::{LevelLayout, PartLayout};
use std::collections::{HashMap, HashSet, VecDeque};
use std::sync::{Arc, Mutex, mpsc};
use std::time::Instant;
use wgpu::BufferUsages;

/// Invocations of a workgroup; `WIDTH` in `shaders/shared/common.wgsl`.
const WIDTH: u32 = 128;
/// Bytes that a pair of unknowns may take in any array: a 2×2 block of the preconditioner in f32, or two f64.
const PAIR_BYTES: u64 = 16;
/// Real numbers in a CG state, which come first.
const STATE_REALS: usize = 10;
/// Bytes of a CG state in f64, five words included: so many are allocated and copied to the host.
const STATE_BYTES: u64 = 8 * STATE_REALS as u64 + 24;
/// Bytes copied to the host in one piece.
const PIECE_BYTES: u64 = 64 << 20;
/// Sets of parameters that are kept on the device at most: a hierarchy has some hundred.
const MOST_UNIFORMS: usize = 4096;
/// Submissions under way at most.
const IN_FLIGHT: usize = 3;

/// Flags of the kernels.
mod flag {
    pub const ADD: u32 = 1;
    pub const NEGATE: u32 = 2;
    pub const RESIDUAL: u32 = 2;
    pub const DOT: u32 = 4;
    pub const WRITES_STATE: u32 = 16;
    pub const CONTINUES: u32 = 32;
}

/// The words of a uniform buffer.
type Words = [u32; 6];

/// `Params` of `shaders/shared/params.wgsl`.
#[derive(Clone, Copy, Default)]
struct Params {
    count: u32,
    first: u32,
    first_partial: u32,
    first_read: u32,
    n_read: u32,
    flags: u32,
}

impl From<Params> for Words {
    fn from(p: Params) -> Words {
        [
            p.count,
            p.first,
            p.first_partial,
            p.first_read,
            p.n_read,
            p.flags,
        ]
    }
}

/// `Params` of `shaders/shared/level.wgsl`.
#[derive(Clone, Copy, Default)]
struct LevelParams {
    count: u32,
    first: u32,
    columns: u32,
    flags: u32,
    steps: [f32; 2],
}

impl From<LevelParams> for Words {
    fn from(p: LevelParams) -> Words {
        let [c1, c2] = p.steps.map(f32::to_bits);
        [p.count, p.first, p.columns, p.flags, c1, c2]
    }
}

/// A buffer on the device, with a number of its own by which bind groups are found again.
struct Allocation {
    id: u64,
    buffer: Buffer,
    context: Arc<Context>,
    /// Numbers of buffers that are gone, whose bind groups go too.
    gone: Arc<Mutex<Vec<u64>>>,
}

impl Drop for Allocation {
    fn drop(&mut self) {
        self.context.released(self.buffer.size);
        // Nothing that holds the lock can panic.
        if let Ok(mut gone) = self.gone.lock() {
            gone.push(self.id);
        }
    }
}

type Handle = Arc<Allocation>;

/// Bytes of a buffer to bring to the host.
struct Wanted<'a> {
    from: &'a Handle,
    offset: u64,
    bytes: u64,
}

/// Pairs `first..first + count` of a vector.
struct Segment {
    first: usize,
    count: u32,
    data: Handle,
}

/// A vector in segments.
pub struct Vector {
    segments: Vec<Segment>,
}

/// Some rows of K, with the columns of one segment.
struct Part {
    row_segment: usize,
    column_segment: usize,
    /// First block row, within the segment of the rows.
    first: u32,
    count: u32,
    /// Whether another part has written the rows before.
    adds: bool,
    slices: Handle,
    columns: Handle,
    values: Handle,
    bytes: u64,
}

/// K in sliced block-ELL: slices of 32 block rows, padded to their longest row, column by column.
pub struct Matrix {
    parts: Vec<Part>,
    /// Workgroups per part.
    groups: Vec<u32>,
}

/// D⁻¹ in the segments of a vector.
pub struct BlockDiagonal(Vec<Segment>);

/// Rows of B or Bᵀ that end in one segment, with the columns of one segment.
struct RowsPart {
    to: usize,
    from: usize,
    count: u32,
    adds: bool,
    starts: Handle,
    targets: Handle,
    columns: Handle,
    values: Handle,
    bytes: u64,
}

/// A rectangular matrix without its empty rows.
pub struct Rows(Vec<RowsPart>);

/// A vector of a multigrid level, in f32.
pub struct LevelVector {
    len: usize,
    data: Handle,
}

/// Some block rows of a matrix of a multigrid level.
struct LevelPart {
    first: u32,
    count: u32,
    /// Where the columns start in `structure`, behind the slices.
    columns: u32,
    structure: Handle,
    values: Handle,
    bytes: u64,
}

/// A matrix of a multigrid level in sliced block-ELL, in f32.
pub struct LevelMatrix {
    shape: Shape,
    parts: Vec<LevelPart>,
}

/// D⁻¹ of a multigrid level.
pub struct LevelDiagonal {
    shape: Shape,
    blocks: u32,
    data: Handle,
}

/// A dense matrix, by rows, in f32.
pub struct DenseMatrix {
    n: u32,
    data: Handle,
}

/// The scalars of a CG run and the partial sums that they are made of.
pub struct State {
    /// What the iterations and their first halves read.
    current: Handle,
    /// What the preconditioner and the second halves read.
    next: Handle,
    goals: Handle,
    partials: Handle,
    /// Partial sums of pᵀKp come first, then those of the vectors.
    n_curvature: u32,
    n_vector: u32,
}

enum Command {
    Dispatch {
        kernel: Kernel,
        bind_group: wgpu::BindGroup,
        groups: u32,
    },
    Copy(Handle, Handle),
    Clear(Handle),
}

/// A GPU with the work recorded for it.
pub struct Gpu {
    context: Arc<Context>,
    commands: Vec<Command>,
    /// Bytes that the recorded commands move.
    recorded_bytes: u64,
    /// A CG run was started among the recorded commands.
    recorded_start: bool,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
    bind_groups: HashMap<(Kernel, [u64; 9]), wgpu::BindGroup>,
    uniforms: HashMap<Words, Handle>,
    gone: Arc<Mutex<Vec<u64>>>,
    /// The state of a run that is never done, for products outside CG.
    idle: Handle,
    idle_partials: Handle,
    staging: Option<Handle>,
    next_id: u64,
    counters: Counters,
}

impl Gpu {
    /// A backend on the device of the context.
    pub fn new(context: &Arc<Context>) -> Result<Self, GpuError> {
        let gone = Arc::default();
        let allocate = |id, label, usage| {
            Ok(Arc::new(Allocation {
                id,
                buffer: context.buffer(label, STATE_BYTES, usage)?,
                context: Arc::clone(context),
                gone: Arc::clone(&gone),
            }))
        };
        Ok(Self {
            idle: allocate(0, "idle state", BufferUsages::STORAGE)?,
            idle_partials: allocate(1, "unused sums", BufferUsages::STORAGE)?,
            context: Arc::clone(context),
            commands: Vec::new(),
            recorded_bytes: 0,
            recorded_start: false,
            in_flight: VecDeque::new(),
            bind_groups: HashMap::new(),
            uniforms: HashMap::new(),
            gone,
            staging: None,
            next_id: 2,
            counters: Counters::default(),
        })
    }

    /// Bytes per second of a copy on the device, read and written bytes added up: the measure for all that
    /// memory bounds.
    pub fn copy_bandwidth(&mut self) -> Result<f64, GpuError> {
        const REPEATS: u64 = 10;
        let most = if self.context.adapter.is_software {
            64 << 20
        } else {
            512 << 20
        };
        let bytes = self.context.max_binding().min(most) / 16 * 16;
        let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let from = self.allocate("copy", bytes, usage)?;
        let to = self.allocate("copy", bytes, usage)?;
        let mut best = f64::INFINITY;
        for _ in 0..4 {
            let mut encoder = self
                .context
                .device
                .create_command_encoder(&Default::default());
            for _ in 0..REPEATS {
                let (from, to) = (&from.buffer.buffer, &to.buffer.buffer);
                encoder.copy_buffer_to_buffer(from, 0, to, 0, bytes);
            }
            let start = Instant::now();
            self.context.queue.submit([encoder.finish()]);
            // A fault shows in the check.
            let _ = self.context.wait();
            best = best.min(start.elapsed().as_secs_f64());
            self.context.check()?;
        }
        Ok((2 * bytes * REPEATS) as f64 / best)
    }

    /// Bind groups and parameters that are kept for later: no more of them than there are buffers to bind.
    pub fn kept(&self) -> usize {
        self.bind_groups.len() + self.uniforms.len()
    }

    /// The context it computes on.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }

    fn real_bytes(&self) -> u64 {
        self.context.precision.bytes()
    }

    fn allocate(
        &mut self,
        label: &'static str,
        bytes: u64,
        usage: BufferUsages,
    ) -> Result<Handle, GpuError> {
        let buffer = self.context.buffer(label, bytes, usage)?;
        self.next_id += 1;
        Ok(Arc::new(Allocation {
            id: self.next_id,
            buffer,
            context: Arc::clone(&self.context),
            gone: Arc::clone(&self.gone),
        }))
    }

    /// Forgets the bind groups of buffers that are gone: they would be kept alive by nothing else.
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

    /// A buffer with contents.
    fn upload_bytes(&mut self, label: &'static str, bytes: &[u8]) -> Result<Handle, GpuError> {
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let handle = self.allocate(label, bytes.len() as u64, usage)?;
        // The contents are copied into staging memory first, which each submission gives back.
        for (i, piece) in bytes.chunks(PIECE_BYTES as usize).enumerate() {
            let queue = &self.context.queue;
            queue.write_buffer(&handle.buffer.buffer, i as u64 * PIECE_BYTES, piece);
            if bytes.len() as u64 > PIECE_BYTES {
                queue.submit([]);
                // The poll only frees memory here; a fault shows in the check.
                let _ = self.context.wait();
            }
        }
        self.context.check()?;
        Ok(handle)
    }

    /// Real numbers in the precision of the kernels.
    fn real_array(&self, values: &[f64]) -> Vec<u8> {
        match self.context.precision {
            Precision::F64 => bytemuck::cast_slice(values).to_vec(),
            Precision::F32 => values
                .iter()
                .flat_map(|&v| (v as f32).to_ne_bytes())
                .collect(),
        }
    }

    /// Pairs of a segment at most: a whole number of slices.
    fn segment_pairs(&self) -> usize {
        let pairs = (self.context.max_binding() / PAIR_BYTES) as usize;
        (pairs / sliced::SLICE * sliced::SLICE).max(sliced::SLICE)
    }

    /// The ranges of pairs of the segments of a vector.
    fn ranges(&self, pairs: usize) -> Vec<std::ops::Range<usize>> {
        let step = self.segment_pairs();
        (0..pairs.max(1))
            .step_by(step)
            .map(|first| first..(first + step).min(pairs.max(1)))
            .collect()
    }

    /// Workgroups for `count` invocations where `share` dispatches do the same work.
    fn groups(&self, count: u32, share: usize) -> u32 {
        let most = (self.context.max_groups() / share.max(1) as u32).max(1);
        count.div_ceil(WIDTH).clamp(1, most)
    }

    fn uniform(&mut self, words: Words) -> Result<Handle, GpuError> {
        if let Some(handle) = self.uniforms.get(&words) {
            return Ok(Arc::clone(handle));
        }
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let handle = self.allocate("parameters", size_of::<Words>() as u64, usage)?;
        self.context
            .queue
            .write_buffer(&handle.buffer.buffer, 0, bytemuck::cast_slice(&words));
        self.uniforms.insert(words, Arc::clone(&handle));
        Ok(handle)
    }

    /// Records a kernel. `bytes` is what it moves, more or less.
    fn dispatch(
        &mut self,
        kernel: Kernel,
        params: impl Into<Words>,
        buffers: &[&Handle],
        groups: u32,
        bytes: u64,
    ) {
        // A fault is kept by the context and reported where results are read.
        let Ok(uniform) = self.uniform(params.into()) else {
            return;
        };
        let mut key = [u64::MAX; 9];
        key[0] = uniform.id;
        for (place, handle) in key[1..].iter_mut().zip(buffers) {
            *place = handle.id;
        }
        let context = &self.context;
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
                        layout: context.kernels.layout(kernel),
                        entries: &entries,
                    })
            })
            .clone();
        self.counters.dispatches += 1;
        self.commands.push(Command::Dispatch {
            kernel,
            bind_group,
            groups,
        });
        self.recorded_bytes += bytes;
        // Seconds far below two even at a tenth of the bandwidth that such a device has.
        let most = if context.adapter.is_software { 1 } else { 4 } << 30;
        if self.recorded_bytes > most {
            self.submit(None);
        }
    }

    /// Hands the recorded commands to the device, with copies to the host at the end.
    fn submit(&mut self, copies: Option<(&Handle, &[Wanted])>) {
        if self.commands.is_empty() && copies.is_none() {
            return;
        }
        self.forget();
        let context = &self.context;
        let mut encoder = context.device.create_command_encoder(&Default::default());
        let mut commands = self.commands.drain(..).peekable();
        while let Some(command) = commands.next() {
            match command {
                Command::Copy(from, to) => {
                    let (source, target) = (&from.buffer.buffer, &to.buffer.buffer);
                    encoder.copy_buffer_to_buffer(source, 0, target, 0, from.buffer.size);
                }
                Command::Clear(handle) => encoder.clear_buffer(&handle.buffer.buffer, 0, None),
                Command::Dispatch {
                    kernel,
                    bind_group,
                    groups,
                } => {
                    let mut pass = encoder.begin_compute_pass(&Default::default());
                    let (mut kernel, mut bind_group, mut groups) = (kernel, bind_group, groups);
                    loop {
                        pass.set_pipeline(context.kernels.pipeline(kernel));
                        pass.set_bind_group(0, &bind_group, &[]);
                        pass.dispatch_workgroups(groups, 1, 1);
                        match commands.next_if(|c| matches!(c, Command::Dispatch { .. })) {
                            Some(Command::Dispatch {
                                kernel: k,
                                bind_group: b,
                                groups: g,
                            }) => (kernel, bind_group, groups) = (k, b, g),
                            _ => break,
                        }
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
        context.submitting();
        let index = context.queue.submit([encoder.finish()]);
        self.counters.submissions += 1;
        self.recorded_bytes = 0;
        self.recorded_start = false;
        self.in_flight.push_back(index);
        if self.in_flight.len() > IN_FLIGHT {
            // Waiting bounds the memory of what is under way; a fault shows where results are read.
            let _ = context.device.poll(wgpu::PollType::Wait {
                submission_index: self.in_flight.pop_front(),
                timeout: None,
            });
        }
    }

    /// Submits all work, waits for it, and hands the wanted bytes, one after the other, to `take`.
    fn read(&mut self, sources: &[Wanted], take: impl FnOnce(&[u8])) -> Result<(), GpuError> {
        self.context.check()?;
        let bytes: u64 = sources.iter().map(|s| s.bytes).sum();
        let staging = match self.staging.take() {
            Some(staging) if staging.buffer.size >= bytes => staging,
            _ => self.allocate(
                "staging",
                bytes,
                BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            )?,
        };
        self.submit(Some((&staging, sources)));
        self.in_flight.clear();
        self.counters.readbacks += 1;
        let slice = staging.buffer.buffer.slice(0..bytes);
        let (sender, receiver) = mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // Nobody listens any more only if the wait below has failed.
            let _ = sender.send(result);
        });
        let polled = self.context.wait();
        self.context.check()?;
        let fault = |reason: String| GpuError::Fault {
            adapter: self.context.adapter.to_string(),
            reason,
        };
        polled.map_err(|error| fault(error.to_string()))?;
        match receiver.try_recv() {
            Ok(Ok(())) => {}
            Ok(Err(error)) => return Err(fault(error.to_string())),
            Err(_) => return Err(fault("a buffer was not mapped".to_owned())),
        }
        let view = slice
            .get_mapped_range()
            .map_err(|error| fault(error.to_string()))?;
        take(&view);
        drop(view);
        staging.buffer.buffer.unmap();
        self.staging = Some(staging);
        Ok(())
    }

    /// The dispatches of y ±= K x or q = K p.
    fn product(
        &mut self,
        k: &Matrix,
        x: &Vector,
        y: &Vector,
        flags: u32,
        state: &Handle,
        partials: &Handle,
    ) {
        let mut first_partial = 0;
        for (part, &groups) in k.parts.iter().zip(&k.groups) {
            let adds = if part.adds { flag::ADD } else { 0 };
            self.dispatch(
                Kernel::Multiply,
                Params {
                    count: part.count,
                    first: part.first,
                    first_partial,
                    flags: flags | adds,
                    ..Params::default()
                },
                &[
                    state,
                    &part.slices,
                    &part.columns,
                    &part.values,
                    &x.segments[part.column_segment].data,
                    &x.segments[part.row_segment].data,
                    &y.segments[part.row_segment].data,
                    partials,
                ],
                groups,
                part.bytes,
            );
            first_partial += groups;
        }
    }

    /// The dispatches of a product with a matrix of a multigrid level.
    fn level_multiply(
        &mut self,
        state: &State,
        m: &LevelMatrix,
        x: &LevelVector,
        b: &LevelVector,
        y: &LevelVector,
        flags: u32,
    ) {
        for part in &m.parts {
            let params = LevelParams {
                count: part.count,
                first: part.first,
                columns: part.columns,
                flags,
                ..LevelParams::default()
            };
            let buffers = [
                &state.next,
                &part.structure,
                &part.values,
                &x.data,
                &b.data,
                &y.data,
            ];
            let groups = self.groups(part.count, 1);
            let kernel = Kernel::LevelMultiply(m.shape);
            self.dispatch(kernel, params, &buffers, groups, part.bytes);
        }
    }

    /// Sets the goals of the run that is about to be recorded.
    fn write_goals(&mut self, state: &State, run: Run) {
        if self.recorded_start {
            // Those of the one before must not be overwritten until they have been used.
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

    /// The only segment of a vector: multigrid works on vectors that fit into one binding.
    fn whole<'v>(&self, x: &'v Vector) -> &'v Segment {
        assert_eq!(
            x.segments.len(),
            1,
            "multigrid is refused for longer vectors"
        );
        &x.segments[0]
    }

    /// Workgroups of each segment of a vector.
    fn vector_groups(&self, x: &Vector) -> Vec<u32> {
        x.segments
            .iter()
            .map(|s| self.groups(s.count, x.segments.len()))
            .collect()
    }

    /// Bytes of `arrays` vectors over one segment.
    fn vector_bytes(&self, count: u32, arrays: u64) -> u64 {
        u64::from(count) * 2 * self.real_bytes() * arrays
    }
}

/// The flag of a run that starts from the x that is there.
fn continues(run: Run) -> u32 {
    if run.continues { flag::CONTINUES } else { 0 }
}

/// Real numbers of the device.
fn read_reals(precision: Precision, bytes: &[u8], out: &mut [f64]) {
    match precision {
        Precision::F64 => {
            for (out, bytes) in out.iter_mut().zip(bytes.chunks_exact(8)) {
                *out = f64::from_ne_bytes(bytes.try_into().expect("chunks of eight"));
            }
        }
        Precision::F32 => {
            for (out, bytes) in out.iter_mut().zip(bytes.chunks_exact(4)) {
                *out = f32::from_ne_bytes(bytes.try_into().expect("chunks of four")).into();
            }
        }
    }
}

impl Backend for Gpu {
    type Vector = Vector;
    type Matrix = Matrix;
    type BlockDiagonal = BlockDiagonal;
    type Rows = Rows;
    type State = State;
    type Stored = f32;
    type LevelVector = LevelVector;
    type LevelMatrix = LevelMatrix;
    type LevelDiagonal = LevelDiagonal;
    type DenseMatrix = DenseMatrix;

    fn unit_roundoff(&self) -> f64 {
        match self.context.precision {
            Precision::F64 => f64::EPSILON / 2.0,
            Precision::F32 => f64::from(f32::EPSILON) / 2.0,
        }
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn vector(&mut self, len: usize) -> Result<Vector, GpuError> {
        let pairs = len.div_ceil(2);
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let segments = self
            .ranges(pairs)
            .into_iter()
            .map(|range| {
                let bytes = self.vector_bytes(range.len() as u32, 1);
                Ok(Segment {
                    first: range.start,
                    count: range.len() as u32,
                    data: self.allocate("vector", bytes, usage)?,
                })
            })
            .collect::<Result<_, GpuError>>()?;
        Ok(Vector { segments })
    }

    fn matrix(&mut self, k: &Arc<BlockCsr<2>>) -> Result<(Matrix, f64), GpuError> {
        let scale = match self.context.precision {
            Precision::F64 => 1.0,
            Precision::F32 => {
                let largest = k
                    .values()
                    .par_iter()
                    .map(|b| b.iter().flatten().fold(0.0, |acc: f64, v| acc.max(v.abs())))
                    .reduce(|| 0.0, f64::max);
                power_of_two_below(largest).recip()
            }
        };
        let ranges = self.ranges(k.n_block_rows());
        let layouts = PartLayout::all(k, &ranges, self.context.max_binding(), self.real_bytes())
            .ok_or_else(|| GpuError::DenseRow {
                adapter: self.context.adapter.to_string(),
                limit_mib: self.context.max_binding() >> 20,
            })?;
        let block_bytes = 4 * self.real_bytes() + 4;
        let slots: u64 = layouts.iter().map(PartLayout::slots).sum();
        self.context
            .check_memory("the stiffness matrix", slots * block_bytes)?;
        let mut parts = Vec::new();
        for layout in layouts {
            let rows = &ranges[layout.row_segment];
            let by_rows = self.context.precision == Precision::F64;
            let columns = &ranges[layout.column_segment];
            let (columns, values) = layout.fill(k, rows.start, columns, scale, by_rows);
            let values = self.real_array(&values);
            let slot_count = layout.slots();
            parts.push(Part {
                row_segment: layout.row_segment,
                column_segment: layout.column_segment,
                first: layout.first as u32,
                count: layout.count as u32,
                adds: layout.row_segment != layout.column_segment,
                slices: self.upload_bytes("slices of K", bytemuck::cast_slice(&layout.slices))?,
                columns: self.upload_bytes("columns of K", bytemuck::cast_slice(&columns))?,
                values: self.upload_bytes("values of K", &values)?,
                bytes: slot_count * block_bytes + self.vector_bytes(layout.count as u32, 2),
            });
        }
        let groups = parts
            .iter()
            .map(|part| self.groups(part.count, parts.len()))
            .collect();
        Ok((Matrix { parts, groups }, scale))
    }

    fn block_diagonal(&mut self, blocks: &[Block]) -> Result<BlockDiagonal, GpuError> {
        let blocks = scaled_to_f32(blocks);
        self.ranges(blocks.len())
            .into_iter()
            .map(|range| {
                Ok(Segment {
                    first: range.start,
                    count: range.len() as u32,
                    data: self.upload_bytes(
                        "inverse diagonal",
                        bytemuck::cast_slice(&blocks[range.start..range.end.min(blocks.len())]),
                    )?,
                })
            })
            .collect::<Result<_, _>>()
            .map(BlockDiagonal)
    }

    fn rows(&mut self, matrix: &Csr, from: &Vector, to: &Vector) -> Result<Rows, GpuError> {
        let filled = matrix.filled_rows();
        let mut parts = Vec::new();
        for (t, target) in to.segments.iter().enumerate() {
            let targets = 2 * target.first..2 * (target.first + target.count as usize);
            let rows: Vec<u32> = filled
                .iter()
                .copied()
                .filter(|&i| targets.contains(&(i as usize)))
                .collect();
            for (s, source) in from.segments.iter().enumerate() {
                let sources = 2 * source.first..2 * (source.first + source.count as usize);
                let (mut starts, mut places) = (vec![0u32], Vec::new());
                let (mut columns, mut values) = (Vec::new(), Vec::new());
                for &i in &rows {
                    let (cols, blocks) = matrix.row(i as usize);
                    for (&j, v) in cols.iter().zip(blocks) {
                        if sources.contains(&(j as usize)) {
                            columns.push(j - sources.start as u32);
                            values.push(v[0][0]);
                        }
                    }
                    // The first part writes all rows; the others add to those where they have entries.
                    if s == 0 || columns.len() > starts[starts.len() - 1] as usize {
                        starts.push(columns.len() as u32);
                        places.push(i - targets.start as u32);
                    }
                }
                if places.is_empty() {
                    continue;
                }
                let values = self.real_array(&values);
                parts.push(RowsPart {
                    to: t,
                    from: s,
                    count: places.len() as u32,
                    adds: s > 0,
                    bytes: (values.len() + 4 * columns.len()) as u64,
                    starts: self.upload_bytes("rows of B", bytemuck::cast_slice(&starts))?,
                    targets: self.upload_bytes("rows of B", bytemuck::cast_slice(&places))?,
                    columns: self.upload_bytes("columns of B", bytemuck::cast_slice(&columns))?,
                    values: self.upload_bytes("values of B", &values)?,
                });
            }
        }
        Ok(Rows(parts))
    }

    fn state(&mut self, k: &Matrix, like: &Vector) -> Result<State, GpuError> {
        let n_curvature = k.groups.iter().sum();
        let n_vector = self.vector_groups(like).iter().sum();
        let partials = u64::from(n_curvature + n_vector) * 2 * self.real_bytes();
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        Ok(State {
            current: self.allocate("CG state", STATE_BYTES, usage)?,
            next: self.allocate("CG state", STATE_BYTES, usage)?,
            goals: self.allocate("goals of CG", STATE_BYTES, usage)?,
            partials: self.allocate("partial sums", partials, usage)?,
            n_curvature,
            n_vector,
        })
    }

    fn upload(&mut self, from: &[f64], to: &mut Vector) {
        // Writes take effect before all commands of the next submission.
        self.submit(None);
        for segment in &to.segments {
            let first = 2 * segment.first;
            let Some(from) = from.get(first..) else {
                break;
            };
            let from = &from[..from.len().min(2 * segment.count as usize)];
            let bytes = self.real_array(from);
            self.context
                .queue
                .write_buffer(&segment.data.buffer.buffer, 0, &bytes);
        }
    }

    fn download(&mut self, from: &Vector, to: &mut [f64]) -> Result<(), GpuError> {
        let real = self.real_bytes();
        let precision = self.context.precision;
        for segment in &from.segments {
            let Some(to) = to.get_mut(2 * segment.first..) else {
                break;
            };
            let count = to.len().min(2 * segment.count as usize);
            let piece = (PIECE_BYTES / real) as usize;
            for (i, to) in to[..count].chunks_mut(piece).enumerate() {
                let wanted = Wanted {
                    from: &segment.data,
                    offset: i as u64 * PIECE_BYTES,
                    bytes: to.len() as u64 * real,
                };
                self.read(&[wanted], |bytes| read_reals(precision, bytes, to))?;
            }
        }
        Ok(())
    }

    fn copy(&mut self, from: &Vector, to: &mut Vector) {
        for (from, to) in from.segments.iter().zip(&to.segments) {
            let (from, to) = (Arc::clone(&from.data), Arc::clone(&to.data));
            self.commands.push(Command::Copy(from, to));
        }
    }

    fn clear(&mut self, x: &mut Vector) {
        for segment in &x.segments {
            self.commands
                .push(Command::Clear(Arc::clone(&segment.data)));
        }
    }

    fn multiply_rows(&mut self, m: &Rows, x: &Vector, y: &mut Vector) {
        for part in &m.0 {
            self.dispatch(
                Kernel::Rows,
                Params {
                    count: part.count,
                    flags: if part.adds { flag::ADD } else { 0 },
                    ..Params::default()
                },
                &[
                    &part.starts,
                    &part.targets,
                    &part.columns,
                    &part.values,
                    &x.segments[part.from].data,
                    &y.segments[part.to].data,
                ],
                self.groups(part.count, m.0.len()),
                part.bytes,
            );
        }
    }

    fn subtract_product(&mut self, k: &Matrix, x: &Vector, y: &mut Vector) {
        let (state, partials) = (Arc::clone(&self.idle), Arc::clone(&self.idle_partials));
        self.product(k, x, y, flag::ADD | flag::NEGATE, &state, &partials);
    }

    fn cg_start(
        &mut self,
        d: &BlockDiagonal,
        r: &Vector,
        x: &mut Vector,
        p: &mut Vector,
        state: &mut State,
        run: Run,
    ) {
        self.write_goals(state, run);
        let groups = self.vector_groups(r);
        let mut first_partial = state.n_curvature;
        for (s, segment) in r.segments.iter().enumerate() {
            self.dispatch(
                Kernel::CgStart,
                Params {
                    count: segment.count,
                    first_partial,
                    flags: continues(run),
                    ..Params::default()
                },
                &[
                    &d.0[s].data,
                    &segment.data,
                    &x.segments[s].data,
                    &p.segments[s].data,
                    &state.partials,
                ],
                groups[s],
                self.vector_bytes(segment.count, 4),
            );
            first_partial += groups[s];
        }
        self.dispatch(
            Kernel::CgBegin,
            Params {
                first_read: state.n_curvature,
                n_read: state.n_vector,
                ..Params::default()
            },
            &[&state.goals, &state.partials, &state.current],
            1,
            0,
        );
    }

    fn cg_multiply(&mut self, k: &Matrix, p: &Vector, q: &mut Vector, state: &mut State) {
        let (current, partials) = (&state.current, &state.partials);
        self.product(k, p, q, flag::DOT, current, partials);
    }

    fn cg_step_1(
        &mut self,
        d: &BlockDiagonal,
        p: &Vector,
        q: &Vector,
        x: &mut Vector,
        r: &mut Vector,
        state: &mut State,
    ) {
        let groups = self.vector_groups(r);
        let mut first_partial = state.n_curvature;
        for (s, segment) in r.segments.iter().enumerate() {
            self.dispatch(
                Kernel::CgStep1,
                Params {
                    count: segment.count,
                    first: 0,
                    first_partial,
                    first_read: 0,
                    n_read: state.n_curvature,
                    flags: if s == 0 { flag::WRITES_STATE } else { 0 },
                },
                &[
                    &state.current,
                    &state.next,
                    &state.partials,
                    &d.0[s].data,
                    &p.segments[s].data,
                    &q.segments[s].data,
                    &x.segments[s].data,
                    &segment.data,
                ],
                groups[s],
                self.vector_bytes(segment.count, 7),
            );
            first_partial += groups[s];
        }
    }

    fn cg_step_2(&mut self, d: &BlockDiagonal, r: &Vector, p: &mut Vector, state: &mut State) {
        let groups = self.vector_groups(r);
        for (s, segment) in r.segments.iter().enumerate() {
            self.dispatch(
                Kernel::CgStep2,
                Params {
                    count: segment.count,
                    first_read: state.n_curvature,
                    n_read: state.n_vector,
                    flags: if s == 0 { flag::WRITES_STATE } else { 0 },
                    ..Params::default()
                },
                &[
                    &state.next,
                    &state.current,
                    &state.partials,
                    &d.0[s].data,
                    &segment.data,
                    &p.segments[s].data,
                ],
                groups[s],
                self.vector_bytes(segment.count, 4),
            );
        }
    }

    fn level_vector(&mut self, len: usize) -> Result<LevelVector, GpuError> {
        let bytes = 4 * len as u64;
        // K itself may be cut into segments, the levels are not.
        if bytes > self.context.max_binding() || self.ranges(len.div_ceil(2)).len() > 1 {
            return Err(GpuError::TooLarge {
                what: "a vector of the multigrid hierarchy",
                adapter: self.context.adapter.to_string(),
                needed_mib: (PAIR_BYTES * len as u64 / 2) >> 20,
                offered_mib: self.context.max_binding() >> 20,
            });
        }
        let data = self.allocate("vector of a level", bytes, BufferUsages::STORAGE)?;
        Ok(LevelVector { len, data })
    }

    fn level_matrix(&mut self, m: BlockMatrix<f32>) -> Result<LevelMatrix, GpuError> {
        let layouts =
            LevelLayout::all(&m, self.context.max_binding()).ok_or_else(|| GpuError::DenseRow {
                adapter: self.context.adapter.to_string(),
                limit_mib: self.context.max_binding() >> 20,
            })?;
        let block = m.block[0] * m.block[1];
        let slots: u64 = layouts.iter().map(LevelLayout::slots).sum();
        self.context
            .check_memory("the multigrid hierarchy", slots * (block as u64 + 1) * 4)?;
        let mut parts = Vec::new();
        for layout in layouts {
            let (structure, values) = layout.fill(&m);
            parts.push(LevelPart {
                first: layout.first as u32,
                count: layout.count as u32,
                columns: layout.slices.len() as u32,
                bytes: (4 * (structure.len() + values.len())) as u64,
                structure: self.upload_bytes("structure", bytemuck::cast_slice(&structure))?,
                values: self.upload_bytes("values of a level", bytemuck::cast_slice(&values))?,
            });
        }
        Ok(LevelMatrix {
            shape: Shape::of(m.block),
            parts,
        })
    }

    fn level_diagonal(
        &mut self,
        values: Vec<f32>,
        block: usize,
    ) -> Result<LevelDiagonal, GpuError> {
        Ok(LevelDiagonal {
            shape: Shape::of([block, block]),
            blocks: (values.len() / (block * block)) as u32,
            data: self.upload_bytes("inverse diagonal", bytemuck::cast_slice(&values))?,
        })
    }

    fn dense_matrix(&mut self, m: Dense<f32>) -> Result<DenseMatrix, GpuError> {
        Ok(DenseMatrix {
            n: m.n as u32,
            data: self.upload_bytes("coarse inverse", bytemuck::cast_slice(&m.values))?,
        })
    }

    fn chebyshev_first(
        &mut self,
        state: &State,
        inverse_diagonal: &LevelDiagonal,
        c: f32,
        b: &LevelVector,
        d: &mut LevelVector,
        x: &mut LevelVector,
    ) {
        let params = LevelParams {
            count: inverse_diagonal.blocks,
            steps: [0.0, c],
            ..LevelParams::default()
        };
        let groups = self.groups(inverse_diagonal.blocks, 1);
        self.dispatch(
            Kernel::ChebyshevFirst(inverse_diagonal.shape),
            params,
            &[
                &state.next,
                &inverse_diagonal.data,
                &b.data,
                &d.data,
                &x.data,
            ],
            groups,
            4 * 5 * b.len as u64,
        );
    }

    fn chebyshev_step(
        &mut self,
        state: &State,
        a: &LevelMatrix,
        inverse_diagonal: &LevelDiagonal,
        steps: [f32; 2],
        b: &LevelVector,
        x: &LevelVector,
        d: &mut LevelVector,
        x_next: &mut LevelVector,
    ) {
        for part in &a.parts {
            let params = LevelParams {
                count: part.count,
                first: part.first,
                columns: part.columns,
                flags: 0,
                steps,
            };
            let groups = self.groups(part.count, 1);
            self.dispatch(
                Kernel::ChebyshevStep(a.shape),
                params,
                &[
                    &state.next,
                    &part.structure,
                    &part.values,
                    &inverse_diagonal.data,
                    &b.data,
                    &x.data,
                    &d.data,
                    &x_next.data,
                ],
                groups,
                part.bytes,
            );
        }
    }

    fn level_residual(
        &mut self,
        state: &State,
        a: &LevelMatrix,
        b: &LevelVector,
        x: &LevelVector,
        r: &mut LevelVector,
    ) {
        self.level_multiply(state, a, x, b, r, flag::RESIDUAL);
    }

    fn level_product(
        &mut self,
        state: &State,
        m: &LevelMatrix,
        x: &LevelVector,
        y: &mut LevelVector,
    ) {
        self.level_multiply(state, m, x, x, y, 0);
    }

    fn level_product_add(
        &mut self,
        state: &State,
        m: &LevelMatrix,
        x: &LevelVector,
        y: &mut LevelVector,
    ) {
        self.level_multiply(state, m, x, x, y, flag::ADD);
    }

    fn dense_product(
        &mut self,
        state: &State,
        m: &DenseMatrix,
        b: &LevelVector,
        x: &mut LevelVector,
    ) {
        let params: Words = [m.n, 0, 0, 0, 0, 0];
        let bytes = 4 * u64::from(m.n) * u64::from(m.n);
        let buffers = [&state.next, &m.data, &b.data, &x.data];
        self.dispatch(Kernel::DenseApply, params, &buffers, m.n, bytes);
    }

    fn mg_load(
        &mut self,
        r: &Vector,
        x: &mut Vector,
        rounded: &mut LevelVector,
        state: &mut State,
        run: Run,
    ) {
        self.write_goals(state, run);
        let segment = self.whole(r);
        let params = Params {
            count: segment.count,
            first_partial: state.n_curvature,
            flags: continues(run),
            ..Params::default()
        };
        let x = self.whole(x);
        let buffers = [&segment.data, &x.data, &rounded.data, &state.partials];
        let bytes = self.vector_bytes(segment.count, 3);
        self.dispatch(Kernel::MgLoad, params, &buffers, state.n_vector, bytes);
        let params = Params {
            first_read: state.n_curvature,
            n_read: state.n_vector,
            ..Params::default()
        };
        let buffers = [&state.goals, &state.partials, &state.current, &state.next];
        self.dispatch(Kernel::MgBegin, params, &buffers, 1, 0);
    }

    fn mg_step_1(
        &mut self,
        p: &Vector,
        q: &Vector,
        x: &mut Vector,
        r: &mut Vector,
        rounded: &mut LevelVector,
        state: &mut State,
    ) {
        let segment = self.whole(r);
        let params = Params {
            count: segment.count,
            first_partial: state.n_curvature,
            n_read: state.n_curvature,
            ..Params::default()
        };
        let (p, q, x) = (self.whole(p), self.whole(q), self.whole(x));
        let buffers = [
            &state.current,
            &state.next,
            &state.partials,
            &p.data,
            &q.data,
            &x.data,
            &segment.data,
            &rounded.data,
        ];
        let bytes = self.vector_bytes(segment.count, 7);
        self.dispatch(Kernel::MgStep1, params, &buffers, state.n_vector, bytes);
        let params = Params {
            first_read: state.n_curvature,
            n_read: state.n_vector,
            ..Params::default()
        };
        let buffers = [&state.current, &state.partials, &state.next];
        self.dispatch(Kernel::MgCheck, params, &buffers, 1, 0);
    }

    fn mg_step_2(&mut self, r: &Vector, z: &LevelVector, p: &mut Vector, state: &mut State) {
        let (r, p) = (self.whole(r), self.whole(p));
        let params = Params {
            count: r.count,
            first_partial: state.n_curvature,
            first_read: state.n_curvature,
            n_read: state.n_vector,
            ..Params::default()
        };
        let buffers = [&state.next, &r.data, &z.data, &state.partials];
        let bytes = self.vector_bytes(r.count, 2);
        self.dispatch(Kernel::MgDot, params, &buffers, state.n_vector, bytes);
        let buffers = [
            &state.next,
            &state.current,
            &state.partials,
            &z.data,
            &p.data,
        ];
        let bytes = self.vector_bytes(r.count, 3);
        self.dispatch(Kernel::MgStep2, params, &buffers, state.n_vector, bytes);
    }

    fn progress(
        &mut self,
        state: &State,
        result: Option<(&Vector, &mut [f64])>,
    ) -> Result<Progress, GpuError> {
        let real = self.real_bytes();
        let precision = self.context.precision;
        let mut sources = vec![Wanted {
            from: &state.current,
            offset: 0,
            bytes: STATE_BYTES,
        }];
        let mut out: &mut [f64] = &mut [];
        if let Some((vector, to)) = result {
            sources.push(Wanted {
                from: &vector.segments[0].data,
                offset: 0,
                bytes: to.len() as u64 * real,
            });
            out = to;
        }
        let mut progress = None;
        self.read(&sources, |bytes| {
            let mut reals = [0.0; STATE_REALS];
            read_reals(precision, bytes, &mut reals);
            let words = &bytes[reals.len() * real as usize..];
            let word =
                |i: usize| u32::from_ne_bytes(words[4 * i..][..4].try_into().expect("four bytes"));
            progress = Some(Progress {
                rr: reals[1],
                goal: reals[2],
                rr_start: reals[3],
                energy: reals[4],
                recent: reals[5] + reals[6],
                recent_terms: (word(3) + word(4)) as usize,
                done: word(0) != 0,
                broken: word(1) != 0,
                iterations: word(2) as usize,
            });
            read_reals(precision, &bytes[STATE_BYTES as usize..], out);
        })?;
        Ok(progress.expect("a successful read has called its closure"))
    }
}
