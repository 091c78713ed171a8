//! The CPU: f64, all cores.

mod levels;

pub use levels::Diagonal;

use super::{Backend, Block, GpuError, Progress, Run, block_is_full};
use crate::control::Counters;
use crate::sparse::stored::{BlockMatrix, Dense, Real};
use crate::sparse::{BlockCsr, Csr, ROWS_PER_TASK, dot};
use rayon::prelude::*;
use std::marker::PhantomData;
use std::sync::Arc;

/// Everything in f64 on the threads of rayon, but for the multigrid hierarchy, which is stored and applied
/// as `S`. Sums are made in tasks of a fixed size, so that they do not depend on the number of threads.
#[derive(Debug, Default)]
pub struct Cpu<S = f32> {
    stored: PhantomData<S>,
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
    /// α rᵀz over the last full block of iterations and over the one that is under way.
    full_block: f64,
    open_block: f64,
    remaining_goal: f64,
    remaining_part: f64,
    to_come: f64,
    /// Terms in the two blocks.
    in_full: usize,
    in_open: usize,
    curvature: f64,
    /// Of the step under way.
    next_rz: f64,
    done: bool,
    broken: bool,
    iterations: usize,
}

impl State {
    fn started(rz: f64, rr: f64, run: Run) -> Self {
        let goal = (run.residual_part * run.residual_part * rr).max(run.residual * run.residual);
        Self {
            rz,
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

    /// α of the step that begins, None where the direction has no positive curvature.
    fn step(&mut self) -> Option<f64> {
        self.broken = !(self.curvature > 0.0);
        if self.broken {
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

    /// The estimate of eᵀKe.
    fn remaining(&self) -> f64 {
        let recent = self.full_block + self.open_block;
        if self.in_full + self.in_open > 1 {
            recent
        } else {
            recent * self.to_come
        }
    }

    /// Whether an iteration has ended the run. Written so that NaN does.
    fn is_over(&self) -> bool {
        !(self.rr > self.goal)
            || !(self.remaining() > self.remaining_goal + self.remaining_part * self.energy)
            || self.broken
    }
}

/// Scalars handled by one parallel task.
const TASK: usize = 2 * ROWS_PER_TASK;

impl<S: Real> Backend for Cpu<S> {
    type Vector = Vec<f64>;
    type Matrix = Arc<BlockCsr<2>>;
    type BlockDiagonal = Vec<[f32; 4]>;
    type Rows = Rows;
    type State = State;
    type Stored = S;
    type LevelVector = Vec<S>;
    type LevelMatrix = BlockMatrix<S>;
    type LevelDiagonal = Diagonal<S>;
    type DenseMatrix = Dense<S>;

    fn unit_roundoff(&self) -> f64 {
        f64::EPSILON / 2.0
    }

    fn counters(&self) -> Counters {
        Counters::default()
    }

    fn vector(&mut self, len: usize) -> Result<Vec<f64>, GpuError> {
        Ok(vec![0.0; len.next_multiple_of(2)])
    }

    fn matrix(&mut self, k: &Arc<BlockCsr<2>>) -> Result<(Self::Matrix, f64), GpuError> {
        Ok((Arc::clone(k), 1.0))
    }

    fn block_diagonal(&mut self, blocks: &[Block]) -> Result<Self::BlockDiagonal, GpuError> {
        Ok(super::scaled_to_f32(blocks))
    }

    fn rows(&mut self, matrix: &Csr, _from: &Vec<f64>, _to: &Vec<f64>) -> Result<Rows, GpuError> {
        Ok(Rows {
            matrix: matrix.clone(),
            filled: matrix.filled_rows(),
        })
    }

    fn state(&mut self, _k: &Self::Matrix, _like: &Vec<f64>) -> Result<State, GpuError> {
        Ok(State::default())
    }

    fn upload(&mut self, from: &[f64], to: &mut Vec<f64>) {
        to[..from.len()].copy_from_slice(from);
    }

    fn download(&mut self, from: &Vec<f64>, to: &mut [f64]) -> Result<(), GpuError> {
        to.copy_from_slice(&from[..to.len()]);
        Ok(())
    }

    fn copy(&mut self, from: &Vec<f64>, to: &mut Vec<f64>) {
        to.copy_from_slice(from);
    }

    fn clear(&mut self, x: &mut Vec<f64>) {
        x.fill(0.0);
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
        k.for_rows(x, y, |y, _, sum| {
            y[0] -= sum[0];
            y[1] -= sum[1];
            0.0
        });
    }

    fn cg_start(
        &mut self,
        d: &Self::BlockDiagonal,
        r: &Vec<f64>,
        x: &mut Vec<f64>,
        p: &mut Vec<f64>,
        state: &mut State,
        run: Run,
    ) {
        if !run.continues {
            x.fill(0.0);
        }
        let partials: Vec<[f64; 2]> = p
            .par_chunks_mut(TASK)
            .zip(r.par_chunks(TASK))
            .zip(d.par_chunks(TASK / 2))
            .map(|((p, r), d)| {
                let mut sums = [0.0; 2];
                for ((p, r), d) in p.chunks_exact_mut(2).zip(r.chunks_exact(2)).zip(d) {
                    let z = precondition(d, r);
                    p.copy_from_slice(&z);
                    sums[0] += r[0] * z[0] + r[1] * z[1];
                    sums[1] += r[0] * r[0] + r[1] * r[1];
                }
                sums
            })
            .collect();
        let [rz, rr] = total(&partials);
        *state = State::started(rz, rr, run);
    }

    fn cg_multiply(&mut self, k: &Self::Matrix, p: &Vec<f64>, q: &mut Vec<f64>, state: &mut State) {
        if !state.done {
            state.curvature = k.for_rows(p, q, |q, p, sum| {
                q.copy_from_slice(&sum);
                p[0] * sum[0] + p[1] * sum[1]
            });
        }
    }

    fn cg_step_1(
        &mut self,
        d: &Self::BlockDiagonal,
        p: &Vec<f64>,
        q: &Vec<f64>,
        x: &mut Vec<f64>,
        r: &mut Vec<f64>,
        state: &mut State,
    ) {
        if state.done {
            return;
        }
        let Some(alpha) = state.step() else {
            return;
        };
        let partials: Vec<[f64; 2]> = x
            .par_chunks_mut(TASK)
            .zip(r.par_chunks_mut(TASK))
            .zip(p.par_chunks(TASK).zip(q.par_chunks(TASK)))
            .zip(d.par_chunks(TASK / 2))
            .map(|(((x, r), (p, q)), d)| {
                let mut sums = [0.0; 2];
                for i in 0..d.len() {
                    let (a, b) = (2 * i, 2 * i + 1);
                    x[a] += alpha * p[a];
                    x[b] += alpha * p[b];
                    r[a] -= alpha * q[a];
                    r[b] -= alpha * q[b];
                    let z = precondition(&d[i], &r[a..=b]);
                    sums[0] += r[a] * z[0] + r[b] * z[1];
                    sums[1] += r[a] * r[a] + r[b] * r[b];
                }
                sums
            })
            .collect();
        [state.next_rz, state.rr] = total(&partials);
    }

    fn cg_step_2(
        &mut self,
        d: &Self::BlockDiagonal,
        r: &Vec<f64>,
        p: &mut Vec<f64>,
        state: &mut State,
    ) {
        if state.done {
            return;
        }
        state.done = state.is_over();
        if state.done {
            return;
        }
        let beta = state.next_rz / state.rz;
        state.rz = state.next_rz;
        p.par_chunks_mut(TASK)
            .zip(r.par_chunks(TASK))
            .zip(d.par_chunks(TASK / 2))
            .for_each(|((p, r), d)| {
                for ((p, r), d) in p.chunks_exact_mut(2).zip(r.chunks_exact(2)).zip(d) {
                    let z = precondition(d, r);
                    p[0] = z[0] + beta * p[0];
                    p[1] = z[1] + beta * p[1];
                }
            });
    }

    fn level_vector(&mut self, len: usize) -> Result<Vec<S>, GpuError> {
        Ok(vec![S::default(); len])
    }

    fn level_matrix(&mut self, m: BlockMatrix<S>) -> Result<BlockMatrix<S>, GpuError> {
        Ok(m)
    }

    fn level_diagonal(&mut self, values: Vec<S>, block: usize) -> Result<Diagonal<S>, GpuError> {
        Ok(Diagonal { block, values })
    }

    fn dense_matrix(&mut self, m: Dense<S>) -> Result<Dense<S>, GpuError> {
        Ok(m)
    }

    fn chebyshev_first(
        &mut self,
        state: &State,
        inverse_diagonal: &Diagonal<S>,
        c: S,
        b: &Vec<S>,
        d: &mut Vec<S>,
        x: &mut Vec<S>,
    ) {
        if !state.done {
            levels::chebyshev_first(inverse_diagonal, c, b, d, x);
        }
    }

    fn chebyshev_step(
        &mut self,
        state: &State,
        a: &BlockMatrix<S>,
        inverse_diagonal: &Diagonal<S>,
        steps: [S; 2],
        b: &Vec<S>,
        x: &Vec<S>,
        d: &mut Vec<S>,
        x_next: &mut Vec<S>,
    ) {
        if !state.done {
            levels::chebyshev_step(a, inverse_diagonal, steps, b, x, d, x_next);
        }
    }

    fn level_residual(
        &mut self,
        state: &State,
        a: &BlockMatrix<S>,
        b: &Vec<S>,
        x: &Vec<S>,
        r: &mut Vec<S>,
    ) {
        if !state.done {
            levels::residual(a, b, x, r);
        }
    }

    fn level_product(&mut self, state: &State, m: &BlockMatrix<S>, x: &Vec<S>, y: &mut Vec<S>) {
        if !state.done {
            levels::restrict(m, x, y);
        }
    }

    fn level_product_add(&mut self, state: &State, m: &BlockMatrix<S>, x: &Vec<S>, y: &mut Vec<S>) {
        if !state.done {
            levels::prolong_add(m, x, y);
        }
    }

    fn dense_product(&mut self, state: &State, m: &Dense<S>, b: &Vec<S>, x: &mut Vec<S>) {
        if !state.done {
            levels::dense_apply(m, b, x);
        }
    }

    fn mg_load(
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
        *state = State::started(0.0, partials.iter().sum(), run);
    }

    fn mg_step_1(
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
            state.done = true;
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
        state.rr = partials.iter().sum();
        state.done = state.is_over();
    }

    fn mg_step_2(&mut self, r: &Vec<f64>, z: &Vec<S>, p: &mut Vec<f64>, state: &mut State) {
        if state.done {
            return;
        }
        let partials: Vec<f64> = (r.par_chunks(TASK))
            .zip(z.par_chunks(TASK))
            .map(|(r, z)| r.iter().zip(z).map(|(r, z)| r * z.to_f64()).sum())
            .collect();
        let rz: f64 = partials.iter().sum();
        let first = state.rz == 0.0;
        let beta = if first { 0.0 } else { rz / state.rz };
        state.rz = rz;
        (p.par_chunks_mut(TASK))
            .zip(z.par_chunks(TASK))
            .for_each(|(p, z)| {
                for (p, z) in p.iter_mut().zip(z) {
                    // What p holds before the first iteration may not even be a number.
                    *p = z.to_f64() + if first { 0.0 } else { beta * *p };
                }
            });
    }

    fn progress(
        &mut self,
        state: &State,
        result: Option<(&Vec<f64>, &mut [f64])>,
    ) -> Result<Progress, GpuError> {
        if let Some((vector, out)) = result {
            out.copy_from_slice(&vector[..out.len()]);
        }
        Ok(Progress {
            iterations: state.iterations,
            rr: state.rr,
            goal: state.goal,
            rr_start: state.rr_start,
            energy: state.energy,
            recent: state.full_block + state.open_block,
            recent_terms: state.in_full + state.in_open,
            done: state.done,
            broken: state.broken,
        })
    }
}

/// D⁻¹r for one node, in f32 as on the GPU.
fn precondition(d: &[f32; 4], r: &[f64]) -> [f64; 2] {
    let r = [r[0] as f32, r[1] as f32];
    [
        f64::from(d[0] * r[0] + d[1] * r[1]),
        f64::from(d[2] * r[0] + d[3] * r[1]),
    ]
}

fn total(partials: &[[f64; 2]]) -> [f64; 2] {
    partials
        .iter()
        .fold([0.0; 2], |sum, p| [sum[0] + p[0], sum[1] + p[1]])
}
