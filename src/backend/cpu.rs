//! The CPU: f64, all cores.

mod half;
mod levels;

pub use half::{Half, LevelMatrix};
pub use levels::Diagonal;

use super::{Backend, BackendError, Product, Progress, Run, block_is_full};
use crate::control::Counters;
use crate::ranks::Ranks;
use crate::sparse::stored::{BlockMatrix, Dense, Real, SquareBlocks};
use crate::sparse::{Csr, ROWS_PER_TASK, dot};
use rayon::prelude::*;
use std::marker::PhantomData;
use std::sync::Arc;
use web_time::Instant;

/// Everything in f64 on the threads of rayon, except for the multigrid hierarchy, which is stored and applied as `S`.
/// Sums are made in tasks of a fixed size, so that they do not depend on the number of threads.
#[derive(Debug, Default)]
pub struct Cpu<S = f32> {
    /// Those that have the other parts of the vectors.
    ranks: Ranks,
    stored: PhantomData<S>,
}

impl<S> Cpu<S> {
    /// For vectors that are on several ranks.
    #[cfg(feature = "mpi")]
    pub(crate) fn on(ranks: &Ranks) -> Self {
        Self {
            ranks: ranks.clone(),
            stored: PhantomData,
        }
    }

    /// The sum of the results of parallel tasks, in their order, and over the ranks.
    fn sum(&self, partials: &[f64]) -> f64 {
        let mut sum = [partials.iter().sum()];
        self.ranks.sum(&mut sum);
        sum[0]
    }
}

/// A [`Csr`] without its empty rows.
#[derive(Clone, Debug)]
pub struct Rows {
    matrix: Csr,
    filled: Vec<u32>,
}

/// The scalars of a CG run.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    rz: f64,
    rr: f64,
    goal: f64,
    rr_start: f64,
    energy: f64,
    /// α rᵀz over the last full block of iterations and over the unfinished one.
    full_block: f64,
    open_block: f64,
    remaining_goal: f64,
    remaining_part: f64,
    to_come: f64,
    /// Terms in the two blocks.
    in_full: usize,
    in_open: usize,
    curvature: f64,
    done: bool,
    broken: bool,
    iterations: usize,
}

impl State {
    /// Of a run that begins with this ‖r‖².
    pub(crate) fn started(rr: f64, run: Run) -> Self {
        let goal = (run.residual_part * run.residual_part * rr).max(run.residual * run.residual);
        Self {
            rr,
            goal,
            rr_start: rr,
            remaining_goal: run.remaining,
            remaining_part: run.remaining_part,
            to_come: run.to_come,
            done: !(rr > goal),
            ..Self::default()
        }
    }

    /// α of the step that begins, None where the direction has no positive curvature: that ends the run.
    pub(crate) fn step(&mut self) -> Option<f64> {
        self.broken = !(self.curvature > 0.0);
        if self.broken {
            self.done = true;
            return None;
        }
        let alpha = self.rz / self.curvature;
        let decrease = alpha * self.rz;
        self.energy += decrease;
        self.iterations += 1;
        self.open_block += decrease;
        self.in_open += 1;
        if block_is_full(self.in_open, self.iterations) {
            (self.full_block, self.in_full) = (self.open_block, self.in_open);
            (self.open_block, self.in_open) = (0.0, 0);
        }
        Some(alpha)
    }

    /// Whether an iteration has ended the run. Written so that NaN does.
    fn is_over(&self) -> bool {
        !(self.rr > self.goal)
            || !(self.progress().remaining(self.to_come)
                > self.remaining_goal + self.remaining_part * self.energy)
    }

    /// Takes pᵀKp of the direction p.
    pub(crate) fn curves(&mut self, curvature: f64) {
        self.curvature = curvature;
    }

    /// Takes ‖r‖² after a step, and returns whether the run is over.
    pub(crate) fn stepped(&mut self, rr: f64) {
        self.rr = rr;
        self.done = self.is_over();
    }

    /// Takes rᵀz and returns the factor of the last direction in the next one; None in the first iteration.
    pub(crate) fn turned(&mut self, rz: f64) -> Option<f64> {
        let before = std::mem::replace(&mut self.rz, rz);
        (before != 0.0).then(|| rz / before)
    }

    /// Whether the run is over.
    #[cfg(feature = "gpu")]
    pub(crate) fn is_done(&self) -> bool {
        self.done
    }

    /// The real numbers and the words that the kernels of a GPU have of a state, in their order.
    #[cfg(feature = "gpu")]
    pub(crate) fn members(&self) -> ([f64; 10], [u32; 5]) {
        let reals = [
            self.rz,
            self.rr,
            self.goal,
            self.rr_start,
            self.energy,
            self.full_block,
            self.open_block,
            self.remaining_goal,
            self.remaining_part,
            self.to_come,
        ];
        let words = [
            u32::from(self.done),
            u32::from(self.broken),
            self.iterations as u32,
            self.in_full as u32,
            self.in_open as u32,
        ];
        (reals, words)
    }

    /// The progress of the run.
    pub(crate) fn progress(&self) -> Progress {
        Progress {
            iterations: self.iterations,
            rr: self.rr,
            goal: self.goal,
            rr_start: self.rr_start,
            energy: self.energy,
            recent: self.full_block + self.open_block,
            recent_terms: self.in_full + self.in_open,
            done: self.done,
            broken: self.broken,
        }
    }
}

/// Bytes of a copy whose bandwidth is that of memory: beyond any cache.
pub const COPIED: usize = 256 << 20;

/// Bytes per second of a copy of this many bytes on all threads, read and written bytes added up.
pub fn copy_bandwidth(bytes: usize) -> f64 {
    let from = vec![1.0f64; bytes / 8];
    let mut to = vec![0.0f64; bytes / 8];
    let mut best = f64::INFINITY;
    // The first one meets memory that has not been touched.
    for _ in 0..4 {
        let start = Instant::now();
        to.par_chunks_mut(1 << 17)
            .zip(from.par_chunks(1 << 17))
            .for_each(|(to, from)| to.copy_from_slice(from));
        best = best.min(start.elapsed().as_secs_f64());
    }
    std::hint::black_box(&to);
    (2 * bytes) as f64 / best
}

/// Scalars handled by one parallel task.
const TASK: usize = 2 * ROWS_PER_TASK;

impl<S: Real> Backend for Cpu<S> {
    type Vector = Vec<f64>;
    type Matrix = Arc<dyn SquareBlocks>;
    type Rows = Rows;
    type State = State;
    type Stored = S;
    type LevelVector = Vec<S>;
    type LevelMatrix = LevelMatrix<S>;
    type LevelDiagonal = Diagonal<S>;
    type DenseMatrix = Dense<S>;

    fn unit_roundoff(&self) -> f64 {
        f64::EPSILON / 2.0
    }

    fn norm(&self, x: &[f64]) -> f64 {
        self.ranks.norm(x)
    }

    fn counters(&self) -> Counters {
        Counters::default()
    }

    fn cost_of_hierarchy(&self) -> usize {
        // 35 on 2 cores at 600 000 unknowns, 18 on 16 cores at 4.7 million.
        30
    }

    fn vector(&mut self, len: usize) -> Result<Vec<f64>, BackendError> {
        Ok(vec![0.0; len])
    }

    fn matrix(&mut self, k: Arc<dyn SquareBlocks>) -> Result<(Self::Matrix, f64), BackendError> {
        Ok((k, 1.0))
    }

    fn rows(
        &mut self,
        matrix: &Csr,
        _from: &Vec<f64>,
        _to: &Vec<f64>,
    ) -> Result<Rows, BackendError> {
        Ok(Rows {
            matrix: matrix.clone(),
            filled: matrix.filled_rows(),
        })
    }

    fn state(&mut self, _k: &Self::Matrix, _like: &Vec<f64>) -> Result<State, BackendError> {
        Ok(State::default())
    }

    fn upload(&mut self, from: &[f64], to: &mut Vec<f64>) {
        to[..from.len()].copy_from_slice(from);
    }

    fn download(&mut self, from: &Vec<f64>, to: &mut [f64]) -> Result<(), BackendError> {
        to.copy_from_slice(&from[..to.len()]);
        Ok(())
    }

    fn copy(&mut self, from: &Vec<f64>, to: &mut Vec<f64>) {
        to.copy_from_slice(from);
    }

    fn clear(&mut self, x: &mut Vec<f64>) {
        x.fill(0.0);
    }

    fn add(&mut self, a: f64, x: &Vec<f64>, y: &mut Vec<f64>) {
        let a = f64::from(a as f32);
        y.iter_mut().zip(x).for_each(|(y, x)| *y += a * x);
    }

    fn multiply_rows(&mut self, m: &Rows, x: &Vec<f64>, y: &mut Vec<f64>) {
        for &i in &m.filled {
            let (cols, values) = m.matrix.row(i as usize);
            y[i as usize] = cols
                .iter()
                .zip(values)
                .map(|(&j, v)| v[0][0] * x[j as usize])
                .sum();
        }
    }

    fn subtract_product(&mut self, k: &Self::Matrix, x: &Vec<f64>, y: &mut Vec<f64>) {
        k.subtract_product(x, y);
    }

    fn start(
        &mut self,
        r: &Vec<f64>,
        x: &mut Vec<f64>,
        rounded: &mut Vec<S>,
        state: &mut State,
        run: Run,
    ) {
        let partials: Vec<f64> = (r.par_chunks(TASK))
            .zip(x.par_chunks_mut(TASK))
            .zip(rounded.par_chunks_mut(TASK))
            .map(|((r, x), rounded)| {
                if !run.continues {
                    x.fill(0.0);
                }
                for (rounded, &r) in rounded.iter_mut().zip(r) {
                    *rounded = S::from_f64(r);
                }
                dot(r, r)
            })
            .collect();
        *state = State::started(self.sum(&partials), run);
    }

    fn multiply(&mut self, k: &Self::Matrix, p: &Vec<f64>, q: &mut Vec<f64>, state: &mut State) {
        if !state.done {
            state.curves(self.sum(&[k.multiply(p, q)]));
        }
    }

    fn step(
        &mut self,
        p: &Vec<f64>,
        q: &Vec<f64>,
        x: &mut Vec<f64>,
        r: &mut Vec<f64>,
        rounded: &mut Vec<S>,
        state: &mut State,
    ) {
        if state.done {
            return;
        }
        let Some(alpha) = state.step() else {
            return;
        };
        let partials: Vec<f64> = (x.par_chunks_mut(TASK))
            .zip(r.par_chunks_mut(TASK))
            .zip(p.par_chunks(TASK).zip(q.par_chunks(TASK)))
            .zip(rounded.par_chunks_mut(TASK))
            .map(|(((x, r), (p, q)), rounded)| {
                for i in 0..p.len() {
                    x[i] += alpha * p[i];
                    r[i] -= alpha * q[i];
                    rounded[i] = S::from_f64(r[i]);
                }
                dot(r, r)
            })
            .collect();
        state.stepped(self.sum(&partials));
    }

    fn direction(&mut self, r: &Vec<f64>, z: &Vec<S>, p: &mut Vec<f64>, state: &mut State) {
        if state.done {
            return;
        }
        let partials: Vec<f64> = (r.par_chunks(TASK))
            .zip(z.par_chunks(TASK))
            .map(|(r, z)| r.iter().zip(z).map(|(r, z)| r * z.to_f64()).sum())
            .collect();
        let beta = state.turned(self.sum(&partials));
        (p.par_chunks_mut(TASK))
            .zip(z.par_chunks(TASK))
            .for_each(|(p, z)| {
                for (p, z) in p.iter_mut().zip(z) {
                    // Before the first iteration p may not even be a number.
                    *p = z.to_f64() + beta.map_or(0.0, |beta| beta * *p);
                }
            });
    }

    fn progress(
        &mut self,
        state: &State,
        result: Option<(&Vec<f64>, &mut [f64])>,
    ) -> Result<Progress, BackendError> {
        if let Some((vector, out)) = result {
            out.copy_from_slice(&vector[..out.len()]);
        }
        Ok(state.progress())
    }

    fn level_vector(&mut self, len: usize) -> Result<Vec<S>, BackendError> {
        Ok(vec![S::default(); len])
    }

    fn write_level(&mut self, from: &[S], to: &mut Vec<S>) {
        to.copy_from_slice(from);
    }

    fn read_level(&mut self, from: &Vec<S>, to: &mut [S]) -> Result<(), BackendError> {
        to.copy_from_slice(from);
        Ok(())
    }

    fn is_over(&self, state: &State) -> bool {
        state.done
    }

    fn level_matrix(&mut self, m: BlockMatrix<S>) -> Result<LevelMatrix<S>, BackendError> {
        levels::check_shape(m.block())?;
        Ok(LevelMatrix::Full(m))
    }

    fn symmetric_level_matrix(
        &mut self,
        m: BlockMatrix<S>,
    ) -> Result<LevelMatrix<S>, BackendError> {
        levels::check_shape(m.block())?;
        Ok(LevelMatrix::symmetric(m))
    }

    fn level_diagonal(
        &mut self,
        values: Vec<S>,
        block: usize,
    ) -> Result<Diagonal<S>, BackendError> {
        levels::check_shape([block; 2])?;
        Ok(Diagonal { block, values })
    }

    fn dense_matrix(&mut self, m: Dense<S>) -> Result<Dense<S>, BackendError> {
        Ok(m)
    }

    fn smooth_first(
        &mut self,
        state: &State,
        inverse_diagonal: &Diagonal<S>,
        c: S,
        b: &Vec<S>,
        d: &mut Vec<S>,
        x: &mut Vec<S>,
    ) {
        if !state.done {
            levels::smooth_first(inverse_diagonal, c, b, d, x);
        }
    }

    fn smooth(
        &mut self,
        state: &State,
        a: &LevelMatrix<S>,
        inverse_diagonal: &Diagonal<S>,
        steps: [S; 2],
        b: &Vec<S>,
        x: &Vec<S>,
        d: &mut Vec<S>,
        x_next: &mut Vec<S>,
    ) {
        if !state.done {
            levels::smooth(a, inverse_diagonal, steps, b, x, d, x_next);
        }
    }

    fn smooth_patches(
        &mut self,
        state: &State,
        patches: &LevelMatrix<S>,
        c1: Option<S>,
        c2: S,
        r: &Vec<S>,
        d: &mut Vec<S>,
        x: &mut Vec<S>,
    ) {
        let LevelMatrix::Full(patches) = patches else {
            unreachable!("only matrices used for smoothing are stored by half");
        };
        if !state.done {
            levels::smooth_patches(patches, c1, c2, r, d, x);
        }
    }

    fn level_multiply(
        &mut self,
        state: &State,
        m: &LevelMatrix<S>,
        product: Product,
        b: &Vec<S>,
        x: &Vec<S>,
        y: &mut Vec<S>,
    ) {
        if !state.done {
            levels::multiply(m, product, b, x, y);
        }
    }

    fn dense_product(&mut self, state: &State, m: &Dense<S>, b: &Vec<S>, x: &mut Vec<S>) {
        if !state.done {
            levels::dense_apply(m, b, x);
        }
    }
}
