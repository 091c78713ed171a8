//! Bodies that K lets move as a whole.

use super::Entries;
use super::sums::{dot, product};
use std::collections::BTreeMap;

/// A body that K lets move as a whole.
pub struct Free {
    /// Orthonormal, as (unknown, entry).
    pub motions: Vec<Vec<(usize, f64)>>,
    /// Its unknowns.
    pub unknowns: Vec<usize>,
}

/// The kernel of K among the rigid-body motions of each part: combinations that no row of K pulls back by more than a
/// millionth of its possible force.
pub fn floating_bodies(k: &Entries, n: usize, motions: &[Vec<(usize, f64)>]) -> Vec<Free> {
    const PULLED: f64 = 1e-6;
    let mut rows = vec![0.0; n];
    for &(i, _, v) in k {
        rows[i] += v.abs();
    }
    let mut bodies = Vec::new();
    let mut first = 0;
    while first < motions.len() {
        let of_part = |motion: &Vec<(usize, f64)>| motion[0].0 == motions[first][0].0;
        let count = motions[first..].iter().take_while(|m| of_part(m)).count();
        let part = &motions[first..first + count];
        first += count;
        let images: Vec<Vec<f64>> = (part.iter())
            .map(|motion| {
                let mut whole = vec![0.0; n];
                motion.iter().for_each(|&(i, v)| whole[i] = v);
                let (image, _) = product(k, n, &whole);
                image.iter().zip(&rows).map(|(v, r)| v / r).collect()
            })
            .collect();
        let gram: Vec<Vec<f64>> = (images.iter())
            .map(|a| images.iter().map(|b| dot(a, b)).collect())
            .collect();
        let mut kernel = Vec::new();
        for (value, vector) in eigen(gram) {
            if value.max(0.0).sqrt() < PULLED {
                let unknowns = part[0].iter().map(|e| e.0).enumerate();
                let mixed = unknowns.map(|(place, unknown)| {
                    let terms = part.iter().zip(&vector);
                    (unknown, terms.map(|(m, c)| c * m[place].1).sum())
                });
                kernel.push(mixed.collect());
            }
        }
        if !kernel.is_empty() {
            bodies.push(Free {
                motions: kernel,
                unknowns: part[0].iter().map(|e| e.0).collect(),
            });
        }
    }
    bodies
}

/// Eigenvalues and vectors of a small symmetric matrix (Jacobi).
pub fn eigen(mut a: Vec<Vec<f64>>) -> Vec<(f64, Vec<f64>)> {
    let n = a.len();
    let mut vectors: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for _ in 0..30 {
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q] == 0.0 {
                    continue;
                }
                let (s, c) = (0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p])).sin_cos();
                for i in 0..n {
                    let (x, y) = (a[i][p], a[i][q]);
                    (a[i][p], a[i][q]) = (c * x - s * y, s * x + c * y);
                }
                for i in 0..n {
                    let (x, y) = (a[p][i], a[q][i]);
                    (a[p][i], a[q][i]) = (c * x - s * y, s * x + c * y);
                }
                for i in 0..n {
                    let (x, y) = (vectors[p][i], vectors[q][i]);
                    (vectors[p][i], vectors[q][i]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    (0..n).map(|i| (a[i][i], vectors[i].clone())).collect()
}

/// The rigid motions of each connected part of K, orthonormal; unknowns that nothing ties to others are held.
pub fn rigid_motions<const D: usize>(
    k: &Entries,
    n: usize,
    points: &[[f64; D]],
) -> Vec<Vec<(usize, f64)>> {
    let mut tied = vec![false; n];
    let mut part: Vec<usize> = (0..n / D).collect();
    fn root(part: &mut [usize], mut i: usize) -> usize {
        while part[i] != i {
            part[i] = part[part[i]];
            i = part[i];
        }
        i
    }
    for &(i, j, v) in k {
        if i != j && v != 0.0 {
            tied[i] = true;
            let (a, b) = (root(&mut part, i / D), root(&mut part, j / D));
            part[a] = b;
        }
    }
    let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for node in 0..n / D {
        let root = root(&mut part, node);
        parts.entry(root).or_default().push(node);
    }
    let mut motions = Vec::new();
    for nodes in parts.values() {
        let count = nodes.len() as f64;
        let middle: [f64; D] =
            std::array::from_fn(|c| nodes.iter().map(|&i| points[i][c]).sum::<f64>() / count);
        let mut own: Vec<Vec<(usize, f64)>> = Vec::new();
        // Translations, and turns in each plane of two axes.
        let turns = (0..D).flat_map(|a| (a + 1..D).map(move |b| (a, b)));
        for (a, b) in (0..D).map(|a| (a, a)).chain(turns) {
            let mut column = Vec::new();
            for &node in nodes {
                let mut moved = [0.0; D];
                if a == b {
                    moved[a] = 1.0;
                } else {
                    moved[a] = middle[b] - points[node][b];
                    moved[b] = points[node][a] - middle[a];
                }
                for c in 0..D {
                    if tied[D * node + c] {
                        column.push((D * node + c, moved[c]));
                    }
                }
            }
            let norm =
                |column: &[(usize, f64)]| column.iter().map(|c| c.1 * c.1).sum::<f64>().sqrt();
            let before = norm(&column);
            for _ in 0..2 {
                for other in &own {
                    // Both list the same unknowns.
                    let part: f64 = other.iter().zip(&column).map(|(a, b)| a.1 * b.1).sum();
                    for (c, o) in column.iter_mut().zip(other) {
                        c.1 -= part * o.1;
                    }
                }
            }
            let after = norm(&column);
            if after > 1e-6 * before {
                for c in &mut column {
                    c.1 /= after;
                }
                own.push(column);
            }
        }
        motions.extend(own);
    }
    motions
}
