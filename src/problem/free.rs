//! Bodies that can move as a whole: the kernel of K, as far as it consists of rigid motions.
//!
//! A body without enough supports has a singular stiffness matrix, whose kernel its rigid motions span: two
//! translations and a rotation, or what the supports have left of them. With R, one column a motion, and a
//! generalised inverse K⁺
//!
//! ```text
//! u = K⁺(f − Bᵀλ) + R α,    Rᵀ(f − Bᵀλ) = 0,  that is  G λ = e  with  G = Rᵀ Bᵀ,  e = Rᵀ f
//! ```
//!
//! so the contact forces have to balance each body, and α says where it goes (Farhat and Roux 1991; Dostál,
//! Horák and Kučera 2006).

use super::is_coupled;
use crate::dense::{right_singular, symmetric_eigen};
use crate::sparse::{BlockCsr, Csr, dot, norm, norm_max};
use faer::Mat;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Rigid motions of a body in the plane at most.
const MOTIONS: usize = 3;
/// A motion counts as one without stiffness where no unknown is pulled back by more than this part of what its
/// own row of K could: rounding of K, and nothing that a real support or spring would do.
const STIFFLESS: f64 = 1e-11;
/// An entry of G below this part of what it could be is rounding.
const DUST: f64 = 1e-12;
/// Columns of a basis are dependent below this part of the largest.
const DEPENDENT: f64 = 1e-10;
/// Unknowns without contact are fixed where that costs no more than this of the condition.
const FAR_ENOUGH: f64 = 1e-2;

/// A body with a motion as a whole that no support prevents.
#[derive(Clone, Debug)]
pub struct FreeBody {
    /// Its nodes: block rows of K.
    pub nodes: Vec<u32>,
    /// The middle of the box around them.
    pub centre: [f64; 2],
    /// Half the diagonal of that box.
    pub size: f64,
    /// The motions: velocity of the centre, and angular velocity times `size`.
    pub motions: Vec<[f64; MOTIONS]>,
    /// The columns of R on `nodes`, orthonormal.
    modes: Vec<Vec<[f64; 2]>>,
}

impl FreeBody {
    /// What a motion with these coefficients is, in words.
    pub fn describe(&self, coefficients: &[f64]) -> String {
        let mut motion = [0.0; MOTIONS];
        for (c, m) in coefficients.iter().zip(&self.motions) {
            for k in 0..MOTIONS {
                motion[k] += c * m[k];
            }
        }
        let [vx, vy, turn] = motion;
        let speed = vx.hypot(vy);
        // About a point far away.
        if turn.abs() <= 0.05 * speed {
            return format!("slides along ({:.3}, {:.3})", vx / speed, vy / speed);
        }
        let omega = turn / self.size;
        let (x, y) = (self.centre[0] - vy / omega, self.centre[1] + vx / omega);
        let way = if omega > 0.0 {
            "counter-clockwise"
        } else {
            "clockwise"
        };
        format!("rotates {way} about ({x:.4e}, {y:.4e})")
    }

    /// The motions that it is free to make, in words.
    pub fn freedom(&self) -> &'static str {
        let has = |c: usize| self.motions.iter().any(|m| m[c].abs() > 1e-6);
        match (self.motions.len(), has(0), has(1), has(2)) {
            (3, ..) => "move in x and y and rotate",
            (_, true, true, false) => "move in x and y",
            (2, true, _, _) => "move in x and rotate",
            (2, ..) => "move in y and rotate",
            (_, true, false, false) => "move in x",
            (_, false, true, false) => "move in y",
            _ => "rotate",
        }
    }
}

/// All bodies that can move as a whole.
#[derive(Clone, Debug, Default)]
pub struct FreeBodies {
    /// In the order of their first nodes.
    pub bodies: Vec<FreeBody>,
}

impl FreeBodies {
    /// Finds them from K and the points that its pairs of unknowns belong to.
    pub fn find(k: &BlockCsr<2>, points: &[[f64; 2]]) -> Self {
        let (count, parts) = k.components();
        Self::among(k, points, count, &parts)
    }

    /// The same where the connected parts of K are known.
    pub(super) fn among(k: &BlockCsr<2>, points: &[[f64; 2]], count: usize, parts: &[u32]) -> Self {
        let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); count];
        for (node, &c) in parts.iter().enumerate() {
            nodes[c as usize].push(node as u32);
        }
        let bodies = nodes
            .into_iter()
            .filter_map(|nodes| free_body(k, points, nodes));
        Self {
            bodies: bodies.collect(),
        }
    }

    /// Whether every body is held.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Columns of R.
    pub fn n_motions(&self) -> usize {
        self.bodies.iter().map(|body| body.modes.len()).sum()
    }

    /// Each column of R with its body: first column, body.
    fn columns(&self) -> impl Iterator<Item = (usize, &FreeBody)> {
        self.bodies.iter().scan(0, |next, body| {
            let first = *next;
            *next += body.modes.len();
            Some((first, body))
        })
    }

    /// The bodies with their parts of a vector of coefficients.
    pub fn parts<'a>(
        &'a self,
        alpha: &'a [f64],
    ) -> impl Iterator<Item = (&'a FreeBody, &'a [f64])> {
        self.columns()
            .map(|(first, body)| (body, &alpha[first..][..body.modes.len()]))
    }

    /// Rᵀx.
    pub fn resultants(&self, x: &[f64]) -> Vec<f64> {
        self.sums(x, |m, x| m[0] * x[0] + m[1] * x[1])
    }

    /// What an entry of Rᵀx is small beside: Σ |R||x| over the nodes of the body, with the lengths of the vectors
    /// at each node.
    pub fn sizes(&self, x: &[f64]) -> Vec<f64> {
        self.sums(x, |m, x| m[0].hypot(m[1]) * x[0].hypot(x[1]))
    }

    /// For each motion, the sum of `term` of its column and of x over the nodes of its body.
    fn sums(&self, x: &[f64], term: impl Fn([f64; 2], [f64; 2]) -> f64) -> Vec<f64> {
        let of_mode = |nodes: &[u32], mode: &[[f64; 2]]| {
            let terms = nodes.iter().zip(mode);
            terms
                .map(|(&i, &m)| term(m, [x[2 * i as usize], x[2 * i as usize + 1]]))
                .sum()
        };
        (self.bodies.iter())
            .flat_map(|body| body.modes.iter().map(|mode| of_mode(&body.nodes, mode)))
            .collect()
    }

    /// The body of each column of R.
    pub fn body_of_motion(&self) -> Vec<usize> {
        let bodies = self.bodies.iter().enumerate();
        bodies
            .flat_map(|(number, body)| body.modes.iter().map(move |_| number))
            .collect()
    }

    /// x += R α.
    pub fn add_motion(&self, alpha: &[f64], x: &mut [f64]) {
        for (body, alpha) in self.parts(alpha) {
            for (mode, &a) in body.modes.iter().zip(alpha) {
                for (&i, m) in body.nodes.iter().zip(mode) {
                    x[2 * i as usize] += a * m[0];
                    x[2 * i as usize + 1] += a * m[1];
                }
            }
        }
    }

    /// Gᵀ = B R: a row for each multiplier, a column for each motion. What is rounding in it is left out: a tangential
    /// force that is at a right angle to a motion but for 1e-17 must not be asked to balance it.
    pub fn contact_motions(&self, b: &Csr) -> Csr {
        let mut place: Vec<Option<(u32, u32)>> = vec![None; b.n_cols().div_ceil(2)];
        for (number, body) in self.bodies.iter().enumerate() {
            for (i, &node) in body.nodes.iter().enumerate() {
                place[node as usize] = Some((number as u32, i as u32));
            }
        }
        let first: Vec<usize> = self.columns().map(|(first, _)| first).collect();
        let largest = |mode: &Vec<[f64; 2]>| norm_max(mode.as_flattened());
        let sizes: Vec<f64> = (self.bodies.iter())
            .flat_map(|body| body.modes.iter().map(largest))
            .collect();
        // Each entry beside what it could be.
        let mut entries: BTreeMap<(usize, usize), [f64; 2]> = BTreeMap::new();
        for (row, column, value) in b.triplets() {
            let Some((number, i)) = place[column / 2] else {
                continue;
            };
            let body = &self.bodies[number as usize];
            for (k, mode) in body.modes.iter().enumerate() {
                let motion = first[number as usize] + k;
                let [sum, most] = entries.entry((row, motion)).or_default();
                *sum += value * mode[i as usize][column % 2];
                *most += value.abs() * sizes[motion];
            }
        }
        let entries = (entries.into_iter())
            .filter(|(_, [sum, most])| sum.abs() > DUST * most)
            .map(|((row, motion), [sum, _])| (row, motion, sum));
        Csr::from_triplets(b.n_rows(), self.n_motions(), entries)
    }

    /// K with as many unknowns tied to the ground as there are motions, and these with their ties: positive
    /// definite, and its inverse is a generalised inverse of K. Loads in balance leave the ties without force, and
    /// what rounding has left unbalanced of them cannot grow, as it would in iterations with a singular matrix.
    /// K itself where all bodies are held.
    pub fn grounded(
        &self,
        k: &Arc<BlockCsr<2>>,
        avoid: impl Fn(usize) -> bool,
    ) -> (Arc<BlockCsr<2>>, Vec<(u32, f64)>) {
        let (mut grounded, mut ties) = (Arc::clone(k), Vec::new());
        if !self.is_empty() {
            let matrix = Arc::make_mut(&mut grounded);
            for unknown in self.unknowns_to_fix(avoid) {
                let (node, c) = (unknown as usize / 2, unknown as usize % 2);
                let block = matrix.block_mut(node, node).expect("K has its diagonal");
                ties.push((unknown, block[c][c]));
                block[c][c] *= 2.0;
            }
        }
        (grounded, ties)
    }

    /// As many unknowns as there are motions, such that K without their rows and columns is regular: those on
    /// which R is conditioned best, taken one after the other, and if that costs little, such that `avoid`
    /// does not say no to.
    pub fn unknowns_to_fix(&self, avoid: impl Fn(usize) -> bool) -> Vec<u32> {
        let mut fixed = Vec::new();
        for body in &self.bodies {
            let choose = |allowed: &dyn Fn(usize) -> bool| {
                let mut left = body.modes.clone();
                let (mut chosen, mut least) = (Vec::new(), f64::INFINITY);
                for _ in 0..body.modes.len() {
                    let size = |i: usize, c: usize| {
                        left.iter().map(|mode| mode[i][c] * mode[i][c]).sum::<f64>()
                    };
                    let best = (0..body.nodes.len())
                        .flat_map(|i| [(i, 0), (i, 1)])
                        .filter(|&(i, c)| allowed(2 * body.nodes[i] as usize + c))
                        .max_by(|&(i, c), &(j, d)| size(i, c).total_cmp(&size(j, d)))?;
                    let (i, c) = best;
                    let length = size(i, c).sqrt();
                    if !(length > 0.0) {
                        return None;
                    }
                    least = least.min(length);
                    chosen.push(2 * body.nodes[i] + c as u32);
                    // What the motions do beyond that unknown.
                    let direction: Vec<f64> = left.iter().map(|mode| mode[i][c] / length).collect();
                    for j in 0..body.nodes.len() {
                        for d in 0..2 {
                            let along: f64 =
                                left.iter().zip(&direction).map(|(m, w)| m[j][d] * w).sum();
                            for (mode, w) in left.iter_mut().zip(&direction) {
                                mode[j][d] -= along * w;
                            }
                        }
                    }
                }
                Some((chosen, least))
            };
            let any = choose(&|_| true);
            let away = choose(&|unknown| !avoid(unknown));
            let pick = match (any, away) {
                (Some((_, best)), Some((chosen, least))) if least >= FAR_ENOUGH * best => chosen,
                (Some((chosen, _)), _) => chosen,
                (None, _) => unreachable!("the modes of a body are independent"),
            };
            fixed.extend(pick);
        }
        fixed.sort_unstable();
        fixed
    }
}

/// The body of these nodes, if it can move as a whole.
fn free_body(k: &BlockCsr<2>, points: &[[f64; 2]], nodes: Vec<u32>) -> Option<FreeBody> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for &node in &nodes {
        for c in 0..2 {
            low[c] = low[c].min(points[node as usize][c]);
            high[c] = high[c].max(points[node as usize][c]);
        }
    }
    let centre = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    let size = match 0.5 * (high[0] - low[0]).hypot(high[1] - low[1]) {
        0.0 => 1.0,
        size => size,
    };
    let rigid = |node: u32, c: usize| {
        let [x, y] = points[node as usize];
        match c {
            0 => [1.0, 0.0, -(y - centre[1]) / size],
            _ => [0.0, 1.0, (x - centre[0]) / size],
        }
    };
    let mut mode_of: Vec<[[f64; MOTIONS]; 2]> = nodes
        .par_iter()
        .with_min_len(1024)
        .map(|&node| {
            std::array::from_fn(|c| {
                if is_coupled(k, 2 * node as usize + c) {
                    rigid(node, c)
                } else {
                    [0.0; MOTIONS]
                }
            })
        })
        .collect();
    // Columns that the held unknowns leave dependent go first: W makes the rest orthonormal.
    let gram = Mat::from_fn(MOTIONS, MOTIONS, |a, b| {
        mode_of
            .iter()
            .flatten()
            .map(|row| row[a] * row[b])
            .sum::<f64>()
    });
    let (values, vectors) = symmetric_eigen(&gram)?;
    let largest = values.iter().copied().fold(0.0, f64::max);
    let kept: Vec<usize> = (0..MOTIONS)
        .filter(|&k| values[k] > DEPENDENT * largest && values[k] > 0.0)
        .collect();
    let independent = kept.len();
    // To entries of about one.
    let unit = (2.0 * nodes.len() as f64).sqrt();
    let weights: Vec<[f64; MOTIONS]> = (kept.iter())
        .map(|&k| std::array::from_fn(|a| vectors[(a, k)] * unit / values[k].sqrt()))
        .collect();
    for row in mode_of.iter_mut().flatten() {
        let old = *row;
        *row = [0.0; MOTIONS];
        for (new, weight) in row.iter_mut().zip(&weights) {
            *new = (0..MOTIONS).map(|a| old[a] * weight[a]).sum();
        }
    }
    // What pulls each unknown back, as a part of what its row of K could.
    let mut local = vec![u32::MAX; 0];
    let contiguous = nodes.windows(2).all(|w| w[1] == w[0] + 1);
    if !contiguous {
        local = vec![u32::MAX; k.n_block_rows()];
        for (i, &node) in nodes.iter().enumerate() {
            local[node as usize] = i as u32;
        }
    }
    let index = |node: u32| {
        if contiguous {
            (node - nodes[0]) as usize
        } else {
            local[node as usize] as usize
        }
    };
    let pulled: Vec<[f64; MOTIONS]> = nodes
        .par_iter()
        .with_min_len(1024)
        .flat_map_iter(|&node| {
            let (cols, blocks) = k.row(node as usize);
            let mode_of = &mode_of;
            let index = &index;
            (0..2).filter_map(move |a| {
                let (mut sum, mut most) = ([0.0; MOTIONS], 0.0);
                for (&j, block) in cols.iter().zip(blocks) {
                    // Blocks of nothing but zeros may lead out of the body.
                    if block[a] == [0.0; 2] {
                        continue;
                    }
                    let there = &mode_of[index(j)];
                    for b in 0..2 {
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
        .collect();
    let combinations: Vec<Vec<f64>> = if pulled.is_empty() {
        (0..independent)
            .map(|k| {
                (0..independent)
                    .map(|a| f64::from(u8::from(a == k)))
                    .collect()
            })
            .collect()
    } else {
        let rows = pulled.len().max(MOTIONS);
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
    let modes = combinations
        .iter()
        .map(|z| {
            mode_of
                .iter()
                .map(|rows| rows.map(|row| dot(&row[..independent], z) / unit))
                .collect()
        })
        .collect();
    let motions = combinations
        .iter()
        .map(|z| {
            let mut motion = [0.0; MOTIONS];
            for (weight, z) in weights.iter().zip(z) {
                for a in 0..MOTIONS {
                    motion[a] += weight[a] * z;
                }
            }
            let length = norm(&motion);
            motion.map(|v| v / length)
        })
        .collect();
    Some(FreeBody {
        nodes,
        centre,
        size,
        motions,
        modes,
    })
}
