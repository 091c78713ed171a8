//! Large symmetric matrices on the CPU, stored as half of their blocks: memory reads bound the time of a product.

use crate::sparse::stored::{BlockMatrix, Real};
use crate::sparse::vectorised;
use rayon::prelude::*;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Block rows of one parallel task.
const ROWS_PER_TASK: usize = 8192;
/// Fewer tasks do not keep many threads busy, and smaller matrices stay in the caches.
const LEAST_TASKS: usize = 8;
/// Sums that there may be for a row: nodes numbered at random would have one for each task.
const MOST_SUMS: usize = 2;

/// A symmetric matrix by its blocks on and above the diagonal.
///
/// A task adds up the contributions of its rows to all rows, from its first one to the last that they reach. A row is
/// then the sum over tasks, in their order, so that the number of threads does not change it.
#[derive(Debug)]
pub struct Half<S> {
    upper: BlockMatrix<S>,
    tasks: Vec<Task>,
    sums: Mutex<Vec<S>>,
}

/// Rows `first..first + ROWS_PER_TASK`.
#[derive(Clone, Debug)]
struct Task {
    first: usize,
    /// After the last row they reach.
    end: usize,
    /// The start of this task's sums among those of all, in blocks.
    start: usize,
    /// The first task that reaches these rows.
    from: usize,
}

/// The matrix that a level smooths with.
#[derive(Debug)]
pub enum LevelMatrix<S> {
    /// All blocks.
    Full(BlockMatrix<S>),
    /// Half of its blocks.
    Half(Half<S>),
}

impl<S: Real> LevelMatrix<S> {
    /// By half where that pays: if the matrix is large, and its rows couple only to rows with near numbers.
    pub fn symmetric(matrix: BlockMatrix<S>) -> Self {
        match tasks(&matrix) {
            Some(tasks) => {
                let [block, _] = matrix.block();
                let last = tasks.last().expect("there are tasks");
                let sums = block * (last.start + last.end - last.first);
                Self::Half(Half {
                    upper: matrix.into_upper(),
                    sums: Mutex::new(vec![S::default(); sums]),
                    tasks,
                })
            }
            None => Self::Full(matrix),
        }
    }

    /// Rows and columns of a block.
    pub fn block(&self) -> [usize; 2] {
        match self {
            Self::Full(matrix) => matrix.block(),
            Self::Half(half) => half.upper.block(),
        }
    }
}

/// The tasks of a matrix; None if it is better stored in full.
fn tasks<S: Real>(matrix: &BlockMatrix<S>) -> Option<Vec<Task>> {
    let n = matrix.n_block_rows();
    let ends = matrix.row_ptr();
    let columns = |i: usize| &matrix.col_idx()[ends[i] as usize..ends[i + 1] as usize];
    let has_diagonal = |i| columns(i).binary_search(&(i as u32)).is_ok();
    if n < LEAST_TASKS * ROWS_PER_TASK || !(0..n).into_par_iter().all(has_diagonal) {
        return None;
    }
    let mut tasks: Vec<Task> = Vec::new();
    let mut start = 0;
    for first in (0..n).step_by(ROWS_PER_TASK) {
        let last = (first + ROWS_PER_TASK).min(n);
        let end = (first..last).filter_map(|i| columns(i).last()).max();
        let end = end.map_or(last, |&j| last.max(j as usize + 1));
        let from = tasks.iter().position(|task| task.end > first);
        tasks.push(Task {
            first,
            end,
            start,
            from: from.unwrap_or(tasks.len()),
        });
        start += end - first;
    }
    (start <= MOST_SUMS * n).then_some(tasks)
}

impl<S: Real> Half<S> {
    /// A x.
    pub fn times<const B: usize>(&self, x: &[[S; B]]) -> Product<'_, B, S> {
        let mut sums = self.sums.lock().unwrap_or_else(PoisonError::into_inner);
        let mut rest = &mut sums.as_chunks_mut::<B>().0[..];
        let tasks: Vec<_> = (self.tasks.iter())
            .map(|task| {
                let (sums, tail) = std::mem::take(&mut rest).split_at_mut(task.end - task.first);
                rest = tail;
                (task.first, sums)
            })
            .collect();
        let upper = self.upper.view::<B, B>();
        tasks.into_par_iter().for_each(|(first, sums)| {
            vectorised!({
                sums.fill([S::default(); B]);
                for i in first..(first + ROWS_PER_TASK).min(x.len()) {
                    let (cols, blocks) = upper.row(i);
                    let xi = x[i];
                    // One sum for each entry of a block, as in `row_times`.
                    let mut own = [[S::default(); B]; B];
                    for (k, (&j, block)) in cols.iter().zip(blocks).enumerate() {
                        let (xj, there) = (x[j as usize], &mut sums[j as usize - first]);
                        for a in 0..B {
                            for b in 0..B {
                                own[a][b] += block[a][b] * xj[b];
                            }
                        }
                        // The first one is that of the diagonal.
                        if k > 0 {
                            for b in 0..B {
                                for a in 0..B {
                                    there[b] += block[a][b] * xi[a];
                                }
                            }
                        }
                    }
                    for a in 0..B {
                        for b in 0..B {
                            sums[i - first][a] += own[a][b];
                        }
                    }
                }
            });
        });
        Product {
            tasks: &self.tasks,
            sums,
        }
    }
}

/// A product with a [`Half`].
pub struct Product<'a, const B: usize, S> {
    tasks: &'a [Task],
    sums: MutexGuard<'a, Vec<S>>,
}

impl<const B: usize, S: Real> Product<'_, B, S> {
    /// Its block row i.
    #[inline(always)]
    pub fn row(&self, i: usize) -> [S; B] {
        let sums = self.sums.as_chunks::<B>().0;
        let own = i / ROWS_PER_TASK;
        let mut sum = [S::default(); B];
        for task in &self.tasks[self.tasks[own].from..=own] {
            if i < task.end {
                let part = &sums[task.start + i - task.first];
                (0..B).for_each(|c| sum[c] += part[c]);
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sparse::BlockCsr;

    /// Numbers in [−1, 1) without a simple pattern.
    fn noise(i: usize) -> f64 {
        (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 / f64::from(1 << 23) - 1.0
    }

    /// A symmetric matrix of n block rows with blocks in the columns i + `steps` of row i.
    fn matrix<const B: usize>(n: usize, steps: &[usize]) -> BlockMatrix<f64> {
        let entries = (0..n).flat_map(|i| {
            let ends = steps.iter().map(move |step| i + step);
            ends.filter(move |&j| j < n).flat_map(move |j| {
                (0..B * B).flat_map(move |place| {
                    let (p, q) = (B * i + place / B, B * j + place % B);
                    let v = noise(p.min(q) * 1_000_003 + p.max(q));
                    [(p, q, v), (q, p, if i == j { 0.0 } else { v })]
                })
            })
        });
        let entries: Vec<_> = entries.collect();
        BlockMatrix::new(&BlockCsr::<B>::from_triplets(B * n, B * n, entries), 1.0)
    }

    fn check<const B: usize>(n: usize, steps: &[usize], by_half: bool) {
        let full = matrix::<B>(n, steps);
        let x: Vec<[f64; B]> = (0..n)
            .map(|i| std::array::from_fn(|c| noise(B * i + c)))
            .collect();
        let expected: Vec<[f64; B]> = (0..n)
            .map(|i| full.view::<B, B>().row_times(i, &x))
            .collect();
        let LevelMatrix::Half(half) = LevelMatrix::symmetric(full) else {
            assert!(!by_half);
            return;
        };
        assert!(by_half);
        let with_threads = |threads: usize| -> Vec<[f64; B]> {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap_or_else(|error| panic!("{error}"));
            pool.install(|| {
                let product = half.times(&x);
                (0..n).map(|i| product.row(i)).collect()
            })
        };
        let found = with_threads(1);
        assert_eq!(found, with_threads(3));
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 1e-13, "{found} {expected}");
        }
    }

    #[test]
    fn half_of_the_blocks_give_the_whole_product() {
        let n = LEAST_TASKS * ROWS_PER_TASK;
        check::<3>(n + 1, &[0, 1, 70, 4099], true);
        check::<2>(n + 77, &[0, 3, ROWS_PER_TASK - 1], true);
        check::<6>(n, &[0, 2], true);
        // Small, numbered badly, without a diagonal.
        check::<2>(n - 1, &[0, 1], false);
        check::<2>(n, &[0, n / 2], false);
        check::<2>(n, &[1, 2], false);
    }
}
