//! The rigid motions of a body that its stiffness matrix does not resist.

use super::FloatingBody;
use crate::dense::{right_singular, symmetric_eigen};
use crate::problem::system::is_coupled;
use crate::rigid::{Frame, length};
use crate::sparse::{BlockCsr, ROWS_PER_TASK, dot};
use faer::Mat;
use rayon::prelude::*;

/// A motion counts as one without stiffness if no unknown is pulled back by more than this part of the largest force
/// that its row of K allows. It is rounding of K, below any real support or spring.
pub(super) const STIFFLESS: f64 = 1e-11;
/// Columns of a basis are dependent below this part of the largest.
const DEPENDENT: f64 = 1e-10;

/// The body of these nodes, if it can move as a whole.
pub(super) fn floating_body<const D: usize>(
    k: &BlockCsr<D>,
    points: &[[f64; D]],
    nodes: Vec<u32>,
) -> Option<FloatingBody<D>> {
    match D {
        2 => floating_among::<D, 3>(k, points, nodes),
        _ => floating_among::<D, 6>(k, points, nodes),
    }
}

/// The same with the M rigid motions that there are.
fn floating_among<const D: usize, const M: usize>(
    k: &BlockCsr<D>,
    points: &[[f64; D]],
    nodes: Vec<u32>,
) -> Option<FloatingBody<D>> {
    let of_body = nodes.iter().map(|&node| &points[node as usize]);
    let frame = Frame::of_box(of_body, |edges| 0.5 * length(&edges));
    let mut mode_of: Vec<[[f64; M]; D]> = nodes
        .par_iter()
        .with_min_len(1024)
        .map(|&node| {
            let mut rows = frame.motions::<M>(&points[node as usize]);
            for (c, row) in rows.iter_mut().enumerate() {
                if !is_coupled(k, D * node as usize + c) {
                    *row = [0.0; M];
                }
            }
            rows
        })
        .collect();
    // To entries of about one.
    let unit = (D as f64 * nodes.len() as f64).sqrt();
    let weights = orthogonal(&mut mode_of, unit)?;
    let independent = weights.len();
    let pulled = pulled_back(k, &nodes, &mode_of, independent);
    let combinations: Vec<Vec<f64>> = if pulled.is_empty() {
        (0..independent)
            .map(|k| {
                (0..independent)
                    .map(|a| f64::from(u8::from(a == k)))
                    .collect()
            })
            .collect()
    } else {
        let rows = pulled.len().max(M);
        let matrix = Mat::from_fn(rows, independent, |i, j| {
            pulled.get(i).map_or(0.0, |row| row[j])
        });
        let (values, right) = right_singular(&matrix)?;
        (0..independent)
            .filter(|&k| !(values[k] > STIFFLESS * 10.0))
            .map(|k| (0..independent).map(|a| right[(a, k)]).collect())
            .collect()
    };
    if combinations.is_empty() {
        return None;
    }
    let mode = |z: &Vec<f64>| {
        let entry = |row: [f64; M]| dot(&row[..independent], z) / unit;
        mode_of.iter().map(|rows| rows.map(entry)).collect()
    };
    let motion = |z: &Vec<f64>| {
        let mut motion = vec![0.0; M];
        for (weight, z) in weights.iter().zip(z) {
            for a in 0..M {
                motion[a] += weight[a] * z;
            }
        }
        motion
    };
    Some(FloatingBody {
        modes: combinations.iter().map(mode).collect(),
        motions: combinations.iter().map(motion).collect(),
        nodes,
        frame,
    })
}

/// Makes the columns of a basis orthogonal, of norm `unit`, without dependent ones; returns the coefficients of the new
/// columns, which come first.
pub(super) fn orthogonal<const D: usize, const M: usize>(
    mode_of: &mut [[[f64; M]; D]],
    unit: f64,
) -> Option<Vec<[f64; M]>> {
    // The same sums for any number of threads.
    let parts = mode_of.par_chunks(ROWS_PER_TASK).map(|part| {
        let mut sums = [[0.0; M]; M];
        for row in part.as_flattened() {
            for (sums, x) in sums.iter_mut().zip(row) {
                sums.iter_mut().zip(row).for_each(|(sum, y)| *sum += x * y);
            }
        }
        sums
    });
    let parts: Vec<[[f64; M]; M]> = parts.collect();
    let gram = Mat::from_fn(M, M, |a, b| parts.iter().map(|sums| sums[a][b]).sum());
    let (values, vectors) = symmetric_eigen(&gram)?;
    let largest = values.iter().copied().fold(0.0, f64::max);
    let kept = (0..M).filter(|&k| values[k] > DEPENDENT * largest && values[k] > 0.0);
    let mut weights: Vec<[f64; M]> = kept
        .map(|k| std::array::from_fn(|a| vectors[(a, k)] * unit / values[k].sqrt()))
        .collect();
    // In space motions of symmetric bodies have the same eigenvalue, and rounding would decide their mixture: one after
    // another they keep their axes.
    if D > 2 && weights.len() == M {
        weights = one_after_another(&gram, unit);
    }
    let parts = mode_of.par_iter_mut().with_min_len(ROWS_PER_TASK);
    parts.flat_map_iter(|rows| rows).for_each(|row| {
        let old = *row;
        *row = [0.0; M];
        for (new, weight) in row.iter_mut().zip(&weights) {
            *new = (0..M).map(|a| old[a] * weight[a]).sum();
        }
    });
    Some(weights)
}

/// The columns of a basis with these products made orthogonal, one after another.
fn one_after_another<const M: usize>(gram: &Mat<f64>, unit: f64) -> Vec<[f64; M]> {
    let product = |x: &[f64; M], y: &[f64; M]| -> f64 {
        let rows = x.iter().enumerate();
        rows.map(|(a, x)| (0..M).map(|b| x * gram[(a, b)] * y[b]).sum::<f64>())
            .sum()
    };
    let mut weights: Vec<[f64; M]> = Vec::new();
    for k in 0..M {
        let mut next: [f64; M] = std::array::from_fn(|a| f64::from(u8::from(a == k)));
        for _ in 0..2 {
            for other in &weights {
                let along = product(other, &next) / (unit * unit);
                (next.iter_mut().zip(other)).for_each(|(n, o)| *n -= along * o);
            }
        }
        let scale = unit / product(&next, &next).sqrt();
        weights.push(next.map(|v| v * scale));
    }
    weights
}

/// The largest force on unknowns that the first `independent` motions move, as a part of the limit of their rows of K.
fn pulled_back<const D: usize, const M: usize>(
    k: &BlockCsr<D>,
    nodes: &[u32],
    mode_of: &[[[f64; M]; D]],
    independent: usize,
) -> Vec<[f64; M]> {
    let mut local = Vec::new();
    let contiguous = nodes.windows(2).all(|w| w[1] == w[0] + 1);
    if !contiguous {
        local = vec![u32::MAX; k.n_block_rows()];
        for (i, &node) in nodes.iter().enumerate() {
            local[node as usize] = i as u32;
        }
    }
    let index = &|node: u32| {
        if contiguous {
            (node - nodes[0]) as usize
        } else {
            local[node as usize] as usize
        }
    };
    nodes
        .par_iter()
        .with_min_len(1024)
        .flat_map_iter(|&node| {
            let (cols, blocks) = k.row(node as usize);
            (0..D).filter_map(move |a| {
                let (mut sum, mut most) = ([0.0; M], 0.0);
                for (&j, block) in cols.iter().zip(blocks) {
                    // Blocks of zeros alone may lead out of the body.
                    if block[a] == [0.0; D] {
                        continue;
                    }
                    let there = &mode_of[index(j)];
                    for b in 0..D {
                        most += block[a][b].abs();
                        for m in 0..independent {
                            sum[m] += block[a][b] * there[b][m];
                        }
                    }
                }
                let part = sum.map(|v| v / most);
                part.iter().any(|v| v.abs() > STIFFLESS).then_some(part)
            })
        })
        .collect()
}
