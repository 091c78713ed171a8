//! A GPU, through wgpu: the WGSL kernels in `shaders/`.
//!
//! - **Segments.** No storage binding may exceed a limit of the adapter (128 MiB on a software adapter, 2 GiB − 1 on
//!   real ones). So vectors are cut into segments, and matrices into parts (rows of one segment × columns of one
//!   segment, cut further by rows). Each gets its own dispatch. Nearly always there is one of each.
//! - **Scalars stay on the device.** Every workgroup adds up the partial sums of the dispatch before, in the same
//!   order. So all know α and β without another dispatch, and one of them writes the state for the next dispatch. Once
//!   the run is finished, kernels return at once.
//! - **Submissions** hold a bounded amount of work, far below the seconds after which a driver resets the device, and
//!   at most a few are pending at a time.

mod arrays;
mod buffers;
mod context;
mod kernels;
mod layout;
mod products;
mod queue;
mod shared;
mod timing;

pub use arrays::{
    DenseMatrix, LevelDiagonal, LevelMatrix, LevelVector, Matrix, Rows, State, Vector,
};
pub use context::{AdapterSummary, Ahead, Context, GpuError, adapters};
pub use timing::{KernelTime, Speed};

use super::{Backend, BackendError, Precision, Product, Progress, Run, cpu};
use crate::control::Counters;
use crate::ranks::Ranks;
use crate::sparse::Csr;
use crate::sparse::stored::{BlockMatrix, Dense, SquareBlocks};
use buffers::{Allocation, Handle, read_reals};
use kernels::{Kernel, Lanes, Shape, flag};
use layout::segments;
use queue::{Command, Wanted};
use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex};
use wgpu::BufferUsages;

/// The members of a CG state: real numbers, which come first, then words.
const STATE_REALS: [&str; 10] = [
    "rz",
    "rr",
    "goal",
    "rr_start",
    "energy",
    "full_block",
    "open_block",
    "remaining_goal",
    "remaining_part",
    "to_come",
];
const STATE_WORDS: [&str; 5] = ["done", "broken", "iterations", "in_full", "in_open"];
/// Bytes of a CG state in f64, which are allocated and copied to the host.
const STATE_BYTES: u64 = (8 * STATE_REALS.len() + 4 * STATE_WORDS.len()).next_multiple_of(8) as u64;
/// Bytes copied to the host in one piece.
const PIECE_BYTES: u64 = 64 << 20;

/// `Params` of `shaders/shared/params.wgsl`.
#[derive(Clone, Copy, Default)]
#[repr(C)]
struct Params {
    count: u32,
    first: u32,
    first_partial: u32,
    first_read: u32,
    n_read: u32,
    columns: u32,
    flags: u32,
    lanes: u32,
    steps: [f32; 2],
}

impl Params {
    /// Their words in a uniform buffer.
    fn words(self) -> [u32; 10] {
        let [c1, c2] = self.steps.map(f32::to_bits);
        [
            self.count,
            self.first,
            self.first_partial,
            self.first_read,
            self.n_read,
            self.columns,
            self.flags,
            self.lanes,
            c1,
            c2,
        ]
    }
}

/// A GPU with the work recorded for it.
pub struct Gpu {
    context: Arc<Context>,
    /// Those that have the other parts of the vectors.
    ranks: Ranks,
    /// An error between two methods that can report one.
    failure: Option<BackendError>,
    commands: Vec<Command>,
    /// Bytes that the recorded commands move.
    recorded_bytes: u64,
    /// A CG run was started among the recorded commands.
    recorded_start: bool,
    in_flight: VecDeque<wgpu::SubmissionIndex>,
    bind_groups: HashMap<(Kernel, [u64; 9]), wgpu::BindGroup>,
    uniforms: HashMap<[u32; 10], Handle>,
    gone: Arc<Mutex<Vec<u64>>>,
    /// The state of a run that never ends, for products outside CG.
    idle: Handle,
    idle_partials: Handle,
    staging: Option<Handle>,
    times: Option<timing::Times>,
    next_id: u64,
    counters: Counters,
}

impl Gpu {
    /// A backend on the device of the context.
    pub fn new(context: &Arc<Context>) -> Result<Self, BackendError> {
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
            ranks: Ranks::default(),
            failure: None,
            commands: Vec::new(),
            recorded_bytes: 0,
            recorded_start: false,
            in_flight: VecDeque::new(),
            bind_groups: HashMap::new(),
            uniforms: HashMap::new(),
            gone,
            staging: None,
            times: None,
            next_id: 2,
            counters: Counters::default(),
        })
    }

    /// For vectors that are on several ranks.
    #[cfg(feature = "mpi")]
    pub(crate) fn on(context: &Arc<Context>, ranks: &Ranks) -> Result<Self, BackendError> {
        Ok(Self {
            ranks: ranks.clone(),
            ..Self::new(context)?
        })
    }

    /// Bind groups and parameters that are kept: at most one per buffer.
    pub fn kept(&self) -> usize {
        self.bind_groups.len() + self.uniforms.len()
    }

    /// The context it computes on.
    pub fn context(&self) -> &Arc<Context> {
        &self.context
    }
}

/// The progress in a CG state.
fn read_progress(precision: Precision, state: &[u8]) -> Progress {
    let mut reals = [0.0; STATE_REALS.len()];
    read_reals(precision, state, &mut reals);
    let words = state[reals.len() * precision.bytes()..].as_chunks().0;
    let words: [u32; STATE_WORDS.len()] = std::array::from_fn(|i| u32::from_ne_bytes(words[i]));
    // In the order of `STATE_REALS` and `STATE_WORDS`.
    let [_, rr, goal, rr_start, energy, full_block, open_block, ..] = reals;
    let [done, broken, iterations, in_full, in_open] = words;
    Progress {
        iterations: iterations as usize,
        rr,
        goal,
        rr_start,
        energy,
        recent: full_block + open_block,
        recent_terms: (in_full + in_open) as usize,
        done: done != 0,
        broken: broken != 0,
    }
}

/// A flag where a condition holds.
fn flag_if(condition: bool, flag: u32) -> u32 {
    if condition { flag } else { 0 }
}

impl Backend for Gpu {
    type Vector = Vector;
    type Matrix = Matrix;
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

    fn norm(&self, x: &[f64]) -> f64 {
        self.ranks.norm(x)
    }

    fn counters(&self) -> Counters {
        self.counters
    }

    fn cost_of_hierarchy(&self) -> usize {
        // The host makes it: 550 iterations of an H100 at 4.7 million unknowns, fewer where the device is smaller or waits more.
        match self.context.adapter.is_software {
            true => 30,
            false => 300,
        }
    }

    fn vector(&mut self, len: usize) -> Result<Vector, BackendError> {
        self.zeros("vector", len, self.real_bytes())
    }

    fn matrix(&mut self, k: Arc<dyn SquareBlocks>) -> Result<(Matrix, f64), BackendError> {
        self.stiffness(&*k)
    }

    fn rows(&mut self, matrix: &Csr, from: &Vector, to: &Vector) -> Result<Rows, BackendError> {
        self.filled_rows(matrix, from, to)
    }

    fn state(&mut self, k: &Matrix, like: &Vector) -> Result<State, BackendError> {
        self.reserve_staging(like.len)?;
        let n_curvature = k.blocks.parts.iter().map(|part| part.groups).sum();
        let n_vector = self.vector_groups(like).iter().sum();
        let partials = u64::from(n_curvature + n_vector) * 2 * self.real_bytes();
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        Ok(State {
            current: self.allocate("CG state", STATE_BYTES, usage)?,
            next: self.allocate("CG state", STATE_BYTES, usage)?,
            goals: self.allocate("goals of CG", STATE_BYTES, usage)?,
            partials: self.allocate("partial sums", partials, usage)?,
            shared: (!self.ranks.is_alone()).then(cpu::State::default),
            len: like.len,
            n_curvature,
            n_vector,
        })
    }

    fn upload(&mut self, from: &[f64], to: &mut Vector) {
        self.write_reals(from, to);
    }

    fn download(&mut self, from: &Vector, to: &mut [f64]) -> Result<(), BackendError> {
        assert!(to.len() <= from.len);
        let real = self.real_bytes();
        let precision = self.context.precision;
        for segment in &from.segments {
            let last = segment.range.end.min(to.len());
            let Some(to) = to.get_mut(segment.range.start..last) else {
                break;
            };
            let piece = (PIECE_BYTES / real) as usize;
            for (i, to) in to.chunks_mut(piece).enumerate() {
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
        assert_eq!(from.len, to.len);
        for (from, to) in from.segments.iter().zip(&to.segments) {
            let (from, to) = (Arc::clone(&from.data), Arc::clone(&to.data));
            self.record(Command::Copy(from, to));
        }
    }

    fn clear(&mut self, x: &mut Vector) {
        for segment in &x.segments {
            self.record(Command::Clear(Arc::clone(&segment.data)));
        }
    }

    fn add(&mut self, a: f64, x: &Vector, y: &mut Vector) {
        assert_eq!(x.len, y.len);
        let groups = self.vector_groups(x);
        for (s, (from, to)) in x.segments.iter().zip(&y.segments).enumerate() {
            let params = Params {
                count: from.pairs(),
                steps: [a as f32, 0.0],
                ..Params::default()
            };
            let bytes = self.vector_bytes(from, 3);
            let buffers = [&from.data, &to.data];
            self.dispatch(Kernel::Add, params, &buffers, groups[s], bytes);
        }
    }

    fn multiply_rows(&mut self, m: &Rows, x: &Vector, y: &mut Vector) {
        self.rows_product(m, x, y);
    }

    fn subtract_product(&mut self, k: &Matrix, x: &Vector, y: &mut Vector) {
        let (state, partials) = (Arc::clone(&self.idle), Arc::clone(&self.idle_partials));
        let flags = flag::ADD | flag::NEGATE;
        self.product_with_copies(k, x, y, flags, [&state, &partials]);
    }

    fn start(
        &mut self,
        r: &Vector,
        x: &mut Vector,
        rounded: &mut LevelVector,
        state: &mut State,
        run: Run,
    ) {
        assert_eq!([r.len, x.len, rounded.0.len], [state.len; 3]);
        self.write_goals(state, run);
        let groups = self.vector_groups(r);
        let mut first_partial = state.n_curvature;
        for (s, segment) in r.segments.iter().enumerate() {
            let params = Params {
                count: segment.pairs(),
                first_partial,
                flags: flag_if(run.continues, flag::CONTINUES),
                ..Params::default()
            };
            let (x, rounded) = (&x.segments[s].data, &rounded.0.segments[s].data);
            let buffers = [&segment.data, x, rounded, &state.partials];
            let bytes = self.vector_bytes(segment, 3);
            self.dispatch(Kernel::Start, params, &buffers, groups[s], bytes);
            first_partial += groups[s];
        }
        if state.shared.is_some() {
            return self.started(state, run);
        }
        let params = Params {
            first_read: state.n_curvature,
            n_read: state.n_vector,
            ..Params::default()
        };
        let buffers = [&state.goals, &state.partials, &state.current, &state.next];
        self.dispatch(Kernel::Begin, params, &buffers, 1, 0);
    }

    fn multiply(&mut self, k: &Matrix, p: &Vector, q: &mut Vector, state: &mut State) {
        if self.is_over(state) {
            return;
        }
        let groups: u32 = k.blocks.parts.iter().map(|part| part.groups).sum();
        assert_eq!(groups, state.n_curvature);
        let handles = [&state.current, &state.partials];
        self.product_with_copies(k, p, q, flag::DOT, handles);
        self.curves(state);
    }

    fn step(
        &mut self,
        p: &Vector,
        q: &Vector,
        x: &mut Vector,
        r: &mut Vector,
        rounded: &mut LevelVector,
        state: &mut State,
    ) {
        let all = [p.len, q.len, x.len, r.len, rounded.0.len];
        assert_eq!(all, [state.len; 5]);
        if !self.steps(state) {
            return;
        }
        let groups = self.vector_groups(r);
        let mut first_partial = state.n_curvature;
        for (s, segment) in r.segments.iter().enumerate() {
            let params = Params {
                count: segment.pairs(),
                first_partial,
                n_read: state.sums(state.n_curvature),
                flags: flag_if(s == 0 && state.shared.is_none(), flag::WRITES_STATE),
                ..Params::default()
            };
            let buffers = [
                &state.current,
                &state.next,
                &state.partials,
                &p.segments[s].data,
                &q.segments[s].data,
                &x.segments[s].data,
                &segment.data,
                &rounded.0.segments[s].data,
            ];
            let bytes = self.vector_bytes(segment, 7);
            self.dispatch(Kernel::Step, params, &buffers, groups[s], bytes);
            first_partial += groups[s];
        }
        if state.shared.is_some() {
            return self.stepped(state);
        }
        let params = Params {
            first_read: state.n_curvature,
            n_read: state.n_vector,
            ..Params::default()
        };
        let buffers = [&state.current, &state.partials, &state.next];
        self.dispatch(Kernel::Check, params, &buffers, 1, 0);
    }

    fn direction(&mut self, r: &Vector, z: &LevelVector, p: &mut Vector, state: &mut State) {
        assert_eq!([r.len, z.0.len, p.len], [state.len; 3]);
        if self.is_over(state) {
            return;
        }
        let groups = self.vector_groups(r);
        let mut first_partial = state.n_curvature;
        for (s, r) in r.segments.iter().enumerate() {
            let params = Params {
                count: r.pairs(),
                first_partial,
                ..Params::default()
            };
            let z = &z.0.segments[s].data;
            let buffers = [&state.next, &r.data, z, &state.partials];
            let bytes = self.vector_bytes(r, 2);
            self.dispatch(Kernel::Dot, params, &buffers, groups[s], bytes);
            first_partial += groups[s];
        }
        self.turned(state);
        for (s, p) in p.segments.iter().enumerate() {
            let params = Params {
                count: p.pairs(),
                first_read: state.n_curvature,
                n_read: state.sums(state.n_vector),
                flags: flag_if(s == 0, flag::WRITES_STATE),
                ..Params::default()
            };
            let buffers = [
                &state.next,
                &state.current,
                &state.partials,
                &z.0.segments[s].data,
                &p.data,
            ];
            let bytes = self.vector_bytes(p, 3);
            self.dispatch(Kernel::Direction, params, &buffers, groups[s], bytes);
        }
    }

    fn progress(
        &mut self,
        state: &State,
        result: Option<(&Vector, &mut [f64])>,
    ) -> Result<Progress, BackendError> {
        let real = self.real_bytes();
        let precision = self.context.precision;
        let mut sources = vec![Wanted {
            from: &state.current,
            offset: 0,
            bytes: STATE_BYTES,
        }];
        let mut out: &mut [f64] = &mut [];
        if let Some((vector, to)) = result {
            assert!(
                to.len() <= vector.segments[0].len(),
                "short vectors have one segment"
            );
            sources.push(Wanted {
                from: &vector.segments[0].data,
                offset: 0,
                bytes: to.len() as u64 * real,
            });
            out = to;
        }
        let mut progress = None;
        self.read(&sources, |bytes| {
            progress = Some(read_progress(precision, bytes));
            read_reals(precision, &bytes[STATE_BYTES as usize..], out);
        })?;
        let there = progress.expect("a successful read has called its closure");
        match self.failure.take() {
            Some(error) => Err(error),
            None => Ok(state.shared.map_or(there, |shared| shared.progress())),
        }
    }

    fn level_vector(&mut self, len: usize) -> Result<LevelVector, BackendError> {
        self.zeros("vector of a level", len, 4).map(LevelVector)
    }

    fn write_level(&mut self, from: &[f32], to: &mut LevelVector) {
        assert_eq!(from.len(), to.0.len);
        // Without a number there is a segment nevertheless.
        if from.is_empty() {
            return;
        }
        // Writes take effect before all commands of the next submission.
        self.submit(None);
        for segment in &to.0.segments {
            let bytes = bytemuck::cast_slice(&from[segment.range.clone()]);
            let buffer = &segment.data.buffer.buffer;
            self.context.queue.write_buffer(buffer, 0, bytes);
        }
    }

    fn read_level(&mut self, from: &LevelVector, to: &mut [f32]) -> Result<(), BackendError> {
        assert_eq!(to.len(), from.0.len);
        if to.is_empty() {
            return Ok(());
        }
        for segment in &from.0.segments {
            let to = &mut to[segment.range.clone()];
            for (i, to) in to.chunks_mut(PIECE_BYTES as usize / 4).enumerate() {
                let wanted = Wanted {
                    from: &segment.data,
                    offset: i as u64 * PIECE_BYTES,
                    bytes: 4 * to.len() as u64,
                };
                self.read(&[wanted], |bytes| {
                    to.copy_from_slice(bytemuck::cast_slice(bytes));
                })?;
            }
        }
        Ok(())
    }

    fn is_over(&self, state: &State) -> bool {
        state.shared.is_some_and(|shared| shared.is_done())
    }

    fn level_matrix(&mut self, m: BlockMatrix<f32>) -> Result<LevelMatrix, BackendError> {
        self.stored(&m)
    }

    fn level_diagonal(
        &mut self,
        values: Vec<f32>,
        block: usize,
    ) -> Result<LevelDiagonal, BackendError> {
        let shape = Shape::of([block, block])?;
        let len = values.len() / block;
        let segments = segments(len, self.context.max_binding())
            .into_iter()
            .map(|range| {
                let values = &values[range.start * block..(range.end * block).min(values.len())];
                self.upload_bytes("inverse diagonal", bytemuck::cast_slice(values))
            })
            .collect::<Result<_, _>>()?;
        Ok(LevelDiagonal {
            shape,
            block,
            len,
            segments,
        })
    }

    fn dense_matrix(&mut self, m: Dense<f32>) -> Result<DenseMatrix, BackendError> {
        Ok(DenseMatrix {
            n: m.n() as u32,
            data: self.upload_bytes("coarse inverse", bytemuck::cast_slice(m.values()))?,
        })
    }

    fn smooth_first(
        &mut self,
        state: &State,
        inverse_diagonal: &LevelDiagonal,
        c: f32,
        b: &LevelVector,
        d: &mut LevelVector,
        x: &mut LevelVector,
    ) {
        let params = Params {
            flags: flag::FIRST,
            steps: [0.0, c],
            ..Params::default()
        };
        self.smooth_by_diagonal(state, inverse_diagonal, params, &b.0, &b.0, &d.0, &x.0);
    }

    fn smooth(
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
        let (a, b, x, d, x_next) = (&a.0, &b.0, &x.0, &d.0, &x_next.0);
        if x.segments.len() > 1 {
            // No dispatch sees a whole row of A.
            let flags = flag::NEGATE | flag::BASE;
            self.product(a, x, b, x_next, flags, [&state.next, &state.partials]);
            let params = Params {
                steps,
                ..Params::default()
            };
            self.smooth_by_diagonal(state, inverse_diagonal, params, b, x, d, x_next);
            return;
        }
        for vector in [b, x, d, x_next] {
            assert_eq!(vector.len, inverse_diagonal.len);
        }
        assert_eq!((a.n_rows, a.n_cols), (x.len, x.len));
        assert_eq!(a.shape, inverse_diagonal.shape);
        for part in &a.parts {
            let params = Params {
                count: part.count,
                first: part.first,
                columns: part.columns,
                lanes: part.lanes,
                steps,
                ..Params::default()
            };
            let buffers = [
                &state.next,
                &part.structure,
                &part.values,
                &inverse_diagonal.segments[0],
                &b.segments[0].data,
                &x.segments[0].data,
                &d.segments[0].data,
                &x_next.segments[0].data,
            ];
            let kernel = Kernel::Smooth(a.shape, Lanes::of(part.lanes));
            self.dispatch(kernel, params, &buffers, part.groups, part.bytes);
        }
    }

    fn smooth_patches(
        &mut self,
        state: &State,
        patches: &LevelMatrix,
        c1: Option<f32>,
        c2: f32,
        r: &LevelVector,
        d: &mut LevelVector,
        x: &mut LevelVector,
    ) {
        let flags = flag_if(c1.is_none(), flag::FIRST);
        let steps = [c1.unwrap_or(0.0), c2];
        let params = Params {
            flags,
            steps,
            ..Params::default()
        };
        self.smooth_by_patches(state, &patches.0, params, &r.0, &d.0, &x.0);
    }

    fn level_multiply(
        &mut self,
        state: &State,
        m: &LevelMatrix,
        product: Product,
        b: &LevelVector,
        x: &LevelVector,
        y: &mut LevelVector,
    ) {
        let flags = match product {
            Product::Plain => 0,
            Product::Added => flag::ADD,
            Product::Residual => flag::NEGATE | flag::BASE,
        };
        let handles = [&state.next, &state.partials];
        self.product(&m.0, &x.0, &b.0, &y.0, flags, handles);
    }

    fn dense_product(
        &mut self,
        state: &State,
        m: &DenseMatrix,
        b: &LevelVector,
        x: &mut LevelVector,
    ) {
        assert_eq!([b.0.len, x.0.len], [m.n as usize; 2]);
        let params = Params {
            count: m.n,
            ..Params::default()
        };
        let bytes = 4 * u64::from(m.n) * u64::from(m.n);
        let (b, x) = (&b.0.segments[0].data, &x.0.segments[0].data);
        let buffers = [&state.next, &m.data, b, x];
        self.dispatch(Kernel::Dense, params, &buffers, m.n, bytes);
    }
}
