//! The CPU: f64, all cores.

use super::{Backend, Block, Counters, GpuError, Progress};
use crate::sparse::{BlockCsr, Csr, ROWS_PER_TASK};
use rayon::prelude::*;
use std::sync::Arc;

/// Everything in f64 on the threads of rayon. Sums are made in tasks of a fixed size, so that they do
/// not depend on the number of threads.
#[derive(Debug, Default)]
pub struct Cpu {
    counters: Counters,
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
    curvature: f64,
    /// Of the step under way.
    next_rz: f64,
    done: bool,
    broken: bool,
    iterations: usize,
}

/// Scalars handled by one parallel task.
const TASK: usize = 2 * ROWS_PER_TASK;

impl Backend for Cpu {
    type Vector = Vec<f64>;
    type Matrix = Arc<BlockCsr<2>>;
    type BlockDiagonal = Vec<[f32; 4]>;
    type Rows = Rows;
    type State = State;

    fn unit_roundoff(&self) -> f64 {
        f64::EPSILON / 2.0
    }

    fn counters(&self) -> Counters {
        self.counters
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
        tolerance: f64,
    ) {
        x.fill(0.0);
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
        let goal = tolerance * tolerance * rr;
        *state = State {
            rz,
            rr,
            goal,
            done: !(rr > goal),
            ..State::default()
        };
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
        state.broken = !(state.curvature > 0.0);
        if state.broken {
            return;
        }
        let alpha = state.rz / state.curvature;
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
        state.iterations += 1;
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
        state.done = !(state.rr > state.goal) || state.broken;
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
