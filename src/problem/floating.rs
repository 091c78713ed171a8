//! Bodies that can move as a whole: the part of the kernel of K that consists of rigid-body motions.
//!
//! A body without enough supports has a singular stiffness matrix, whose kernel its rigid-body motions span. They are
//! two translations and a rotation in the plane, three and three in space, or those of them that the supports leave
//! free. With R, one column a motion, and a generalised inverse K⁺
//!
//! ```text
//! u = K⁺(f − Bᵀλ) + R α,    Rᵀ(f − Bᵀλ) = 0,  that is  G λ = e  with  G = Rᵀ Bᵀ,  e = Rᵀ f
//! ```
//!
//! so the contact forces have to balance each body, and α is its rigid-body displacement (Farhat and Roux 1991; Dostál, Horák and
//! Kučera 2006).

mod find;
#[cfg(feature = "mpi")]
mod share;

#[cfg(feature = "mpi")]
pub(crate) use share::Motions;

use crate::dense::right_singular;
use crate::ranks::Ranks;
use crate::rigid::{self, Frame, length};
use crate::sparse::{BlockCsr, Csr, dot, norm_max};
use faer::Mat;
use std::sync::Arc;

/// An entry of G smaller than this part of the sum of its terms' sizes is rounding.
const ROUNDING_OF_G: f64 = 1e-12;
/// Unknowns without contact are preferred if that costs no more than this of the condition.
const FAR_ENOUGH: f64 = 1e-2;
/// A rotation or a sliding below this part of a whole motion is not mentioned.
const LITTLE: f64 = 0.05;
/// A component of a motion below this counts as zero; the largest is about one.
const NONE: f64 = 1e-6;

/// A body with a motion as a whole that no support prevents.
#[derive(Clone, Debug)]
pub struct FloatingBody<const D: usize = 2> {
    nodes: Vec<u32>,
    frame: Frame<D>,
    motions: Vec<Vec<f64>>,
    /// The columns of R on `nodes`, orthonormal.
    modes: Vec<Vec<[f64; D]>>,
}

impl<const D: usize> FloatingBody<D> {
    /// Its nodes: block rows of K.
    pub fn nodes(&self) -> &[u32] {
        &self.nodes
    }

    /// The middle of the box around them.
    pub fn centre(&self) -> [f64; D] {
        self.frame.centre
    }

    /// Half the diagonal of that box.
    pub fn size(&self) -> f64 {
        self.frame.size
    }

    /// The motions: velocity of the centre, and angular velocity times the size (about z in the plane; about x, y
    /// and z in space). Of the columns of R they are the same multiple, which makes their entries about one.
    pub fn motions(&self) -> &[Vec<f64>] {
        &self.motions
    }

    /// A motion with these coefficients, in words.
    pub fn describe(&self, coefficients: &[f64]) -> String {
        let mut motion = vec![0.0; rigid::count(D)];
        for (c, m) in coefficients.iter().zip(&self.motions) {
            motion.iter_mut().zip(m).for_each(|(sum, m)| *sum += c * m);
        }
        let (velocity, turn) = motion.split_at(D);
        let (speed, turning) = (length(velocity), length(turn));
        let listed = |vector: &[f64]| {
            // Without the sign of numbers rounded to zero.
            let rounded = vector.iter().map(|v| (v * 1e3).round() / 1e3 + 0.0);
            let entries: Vec<_> = rounded.map(|v| format!("{v:.3}")).collect();
            format!("({})", entries.join(", "))
        };
        // About a point far away.
        if turning <= LITTLE * speed {
            let way: Vec<f64> = velocity.iter().map(|v| v / speed).collect();
            return format!("slides along {}", listed(&way));
        }
        // As in space: the plane is z = 0.
        let (mut v, mut omega) = ([0.0; 3], [0.0; 3]);
        v[..D].copy_from_slice(velocity);
        omega[3 - turn.len()..].copy_from_slice(turn);
        omega = omega.map(|turn| turn / self.frame.size);
        let square = omega.iter().map(|w| w * w).sum::<f64>();
        let place: [_; D] = std::array::from_fn(|c| {
            let (a, b) = ((c + 1) % 3, (c + 2) % 3);
            let x = self.frame.centre[c] + (omega[a] * v[b] - omega[b] * v[a]) / square;
            format!("{x:.4e}")
        });
        let place = place.join(", ");
        if D == 2 {
            let way = if omega[2] > 0.0 {
                "counter-clockwise"
            } else {
                "clockwise"
            };
            return format!("rotates {way} about ({place})");
        }
        let axis: Vec<f64> = turn.iter().map(|w| w / turning).collect();
        let along: f64 = velocity.iter().zip(&axis).map(|(v, a)| v * a).sum();
        let screw = if along.abs() > LITTLE * turning {
            ", and slides along it"
        } else {
            ""
        };
        let axis = listed(&axis);
        format!("rotates about the axis through ({place}) along {axis}{screw}")
    }

    /// Its free motions, in words.
    pub fn freedom(&self) -> String {
        let turns = rigid::count(D) - D;
        let turn = Mat::from_fn(turns, self.motions.len(), |k, j| self.motions[j][D + k]);
        let Some((values, combinations)) = right_singular(&turn) else {
            return "move".to_owned();
        };
        let rotations = values.iter().filter(|&&value| value > NONE).count();
        // The part without rotation.
        let moves = |c: usize| {
            (rotations..self.motions.len()).any(|k| {
                let all = self.motions.iter().enumerate();
                let sum: f64 = all.map(|(j, m)| m[c] * combinations[(j, k)]).sum();
                sum.abs() > NONE
            })
        };
        let axes: Vec<_> = (0..D)
            .filter(|&c| moves(c))
            .map(|c| ["x", "y", "z"][c])
            .collect();
        let slide = match &axes[..] {
            [] => None,
            [one] => Some(format!("move in {one}")),
            [some @ .., last] => Some(format!("move in {} and {last}", some.join(", "))),
        };
        let turn = match rotations {
            0 => None,
            3 => Some("rotate about every axis"),
            2 => Some("rotate about two axes"),
            _ => Some("rotate"),
        };
        let parts: Vec<_> = slide.into_iter().chain(turn.map(str::to_owned)).collect();
        parts.join(" and ")
    }
}

/// All bodies that can move as a whole.
#[derive(Clone, Debug, Default)]
pub struct FloatingBodies<const D: usize = 2> {
    bodies: Vec<FloatingBody<D>>,
    /// The ranks with the other nodes, if this process has not all.
    ranks: Ranks,
}

impl<const D: usize> FloatingBodies<D> {
    /// Finds them from K and the points that its nodes (block rows) have.
    ///
    /// # Panics
    /// If there are fewer points than nodes, or K is not square.
    pub fn find(k: &BlockCsr<D>, points: &[[f64; D]]) -> Self {
        let (count, parts) = k.components();
        Self::among(k, points, count, &parts)
    }

    /// The same where the connected parts of K are known.
    pub(super) fn among(k: &BlockCsr<D>, points: &[[f64; D]], count: usize, parts: &[u32]) -> Self {
        let mut nodes: Vec<Vec<u32>> = vec![Vec::new(); count];
        for (node, &c) in parts.iter().enumerate() {
            nodes[c as usize].push(node as u32);
        }
        let bodies = nodes
            .into_iter()
            .filter_map(|nodes| find::floating_body(k, points, nodes));
        Self {
            bodies: bodies.collect(),
            ranks: Ranks::default(),
        }
    }

    /// The bodies, in the order of their first nodes.
    pub fn bodies(&self) -> &[FloatingBody<D>] {
        &self.bodies
    }

    /// Whether every body is held.
    pub fn is_empty(&self) -> bool {
        self.bodies.is_empty()
    }

    /// Columns of R.
    pub fn n_modes(&self) -> usize {
        self.bodies.iter().map(|body| body.modes.len()).sum()
    }

    /// Each column of R with its body: first column, body.
    fn columns(&self) -> impl Iterator<Item = (usize, &FloatingBody<D>)> {
        self.bodies.iter().scan(0, |next, body| {
            let first = *next;
            *next += body.modes.len();
            Some((first, body))
        })
    }

    /// The bodies with their parts of a vector of coefficients.
    pub(crate) fn parts<'a>(
        &'a self,
        alpha: &'a [f64],
    ) -> impl Iterator<Item = (&'a FloatingBody<D>, &'a [f64])> {
        self.columns()
            .map(|(first, body)| (body, &alpha[first..][..body.modes.len()]))
    }

    /// Rᵀx.
    pub fn resultants(&self, x: &[f64]) -> Vec<f64> {
        self.sums(x, dot)
    }

    /// The scale of an entry of Rᵀx: Σ |R||x| over the nodes of the body, with the lengths of the vectors at each node.
    pub(crate) fn sizes(&self, x: &[f64]) -> Vec<f64> {
        self.sums(x, |m, x| length(m) * length(x))
    }

    /// For each motion, the sum of `term` of its column and of x over the nodes of its body.
    fn sums(&self, x: &[f64], term: impl Fn(&[f64], &[f64]) -> f64) -> Vec<f64> {
        let of_mode = |nodes: &[u32], mode: &[[f64; D]]| {
            let terms = nodes.iter().zip(mode);
            terms
                .map(|(&i, m)| term(m, &x[D * i as usize..][..D]))
                .sum()
        };
        let mut sums: Vec<f64> = (self.bodies.iter())
            .flat_map(|body| body.modes.iter().map(|mode| of_mode(&body.nodes, mode)))
            .collect();
        self.ranks.sum(&mut sums);
        sums
    }

    /// The body of each column of R.
    pub(crate) fn body_of_motion(&self) -> Vec<usize> {
        let bodies = self.bodies.iter().enumerate();
        bodies
            .flat_map(|(number, body)| body.modes.iter().map(move |_| number))
            .collect()
    }

    /// x += R α.
    pub(crate) fn add_motion(&self, alpha: &[f64], x: &mut [f64]) {
        for (body, alpha) in self.parts(alpha) {
            for (mode, &a) in body.modes.iter().zip(alpha) {
                for (&i, m) in body.nodes.iter().zip(mode) {
                    for c in 0..D {
                        x[D * i as usize + c] += a * m[c];
                    }
                }
            }
        }
    }

    /// Gᵀ = B R: a row for each multiplier, a column for each motion. Entries that are only rounding are left out: a
    /// tangential force that is perpendicular to a motion up to 1e-17 must not have to balance it.
    pub(crate) fn contact_motions(&self, b: &Csr) -> Csr {
        let mut place: Vec<Option<(u32, u32)>> = vec![None; b.n_cols().div_ceil(D)];
        for (number, body) in self.bodies.iter().enumerate() {
            for (i, &node) in body.nodes.iter().enumerate() {
                place[node as usize] = Some((number as u32, i as u32));
            }
        }
        let first: Vec<usize> = self.columns().map(|(first, _)| first).collect();
        let largest = |mode: &Vec<[f64; D]>| norm_max(mode.as_flattened());
        let sizes: Vec<f64> = (self.bodies.iter())
            .flat_map(|body| body.modes.iter().map(largest))
            .collect();
        // Row, motion, entry, and its scale.
        let mut entries = Vec::new();
        // The entries of a row, with their scales, and the motions that have any.
        let mut sums = vec![[0.0_f64; 2]; self.n_modes()];
        let mut motions = Vec::new();
        for row in 0..b.n_rows() {
            let (columns, values) = b.row(row);
            for (&column, value) in columns.iter().zip(values) {
                let (column, value) = (column as usize, value[0][0]);
                let Some((number, i)) = place[column / D] else {
                    continue;
                };
                let body = &self.bodies[number as usize];
                for (k, mode) in body.modes.iter().enumerate() {
                    let motion = first[number as usize] + k;
                    sums[motion][0] += value * mode[i as usize][column % D];
                    sums[motion][1] += value.abs() * sizes[motion];
                    motions.push(motion);
                }
            }
            motions.sort_unstable();
            motions.dedup();
            for motion in motions.drain(..) {
                let [sum, most] = std::mem::take(&mut sums[motion]);
                entries.push([row as f64, motion as f64, sum, most]);
            }
        }
        let mut entries = self.ranks.joined(entries);
        // The contributions of the ranks to an entry are in the order of the ranks.
        entries.sort_by(|[i, j, ..], [k, l, ..]| i.total_cmp(k).then(j.total_cmp(l)));
        let same = |[i, j, ..]: &[f64; 4], [k, l, ..]: &[f64; 4]| i == k && j == l;
        let entries = entries.chunk_by(same).filter_map(|parts| {
            let [row, motion, ..] = parts[0];
            let [sum, most] = [2, 3].map(|k| parts.iter().map(|part| part[k]).sum::<f64>());
            (sum.abs() > ROUNDING_OF_G * most).then_some((row as usize, motion as usize, sum))
        });
        Csr::from_triplets(b.n_rows(), self.n_modes(), entries)
    }

    /// K with as many unknowns tied to the ground as there are motions, and these with their ties: positive definite,
    /// and its inverse is a generalised inverse of K. Balanced loads leave the ties without force, and an imbalance by
    /// rounding cannot grow, as it would in iterations with a singular matrix. K itself if all bodies are held.
    pub fn grounded(
        &self,
        k: &Arc<BlockCsr<D>>,
        avoid: impl Fn(usize) -> bool,
    ) -> (Arc<BlockCsr<D>>, Vec<(u32, f64)>) {
        let (mut grounded, mut ties) = (Arc::clone(k), Vec::new());
        if !self.is_empty() {
            let matrix = Arc::make_mut(&mut grounded);
            for unknown in self.unknowns_to_fix(avoid) {
                let (node, c) = (unknown as usize / D, unknown as usize % D);
                let block = matrix.block_mut(node, node).expect("K has its diagonal");
                ties.push((unknown, block[c][c]));
                block[c][c] *= 2.0;
            }
        }
        (grounded, ties)
    }

    /// As many unknowns as there are motions, such that K without their rows and columns is regular. They are those
    /// with the best condition of R, chosen one after the other and, if that costs little, none for which `avoid` is
    /// true.
    pub(crate) fn unknowns_to_fix(&self, avoid: impl Fn(usize) -> bool) -> Vec<u32> {
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
                        .flat_map(|i| (0..D).map(move |c| (i, c)))
                        .filter(|&(i, c)| allowed(D * body.nodes[i] as usize + c))
                        .max_by(|&(i, c), &(j, d)| size(i, c).total_cmp(&size(j, d)))?;
                    let (i, c) = best;
                    let length = size(i, c).sqrt();
                    if !(length > 0.0) {
                        return None;
                    }
                    least = least.min(length);
                    chosen.push((D * body.nodes[i] as usize + c) as u32);
                    // The values of the motions outside that unknown.
                    let direction: Vec<f64> = left.iter().map(|mode| mode[i][c] / length).collect();
                    for j in 0..body.nodes.len() {
                        for d in 0..D {
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
