//! Bodies that can move as a whole where their nodes are on several ranks: a few numbers define their motions, from which each
//! rank makes those of its own nodes.

use super::find::{STIFFLESS, orthogonal};
use super::{FloatingBodies, FloatingBody};
use crate::dense::right_singular;
use crate::ranks::Ranks;
use crate::rigid::{self, Frame, length};
use faer::Mat;
use serde::{Deserialize, Serialize};

/// The rows from which a basis of held directions is made at once.
const AT_ONCE: usize = 512;

/// The possible motions of a body as a whole.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Motions {
    centre: Vec<f64>,
    size: f64,
    /// Like [`FloatingBody::motions`].
    motions: Vec<Vec<f64>>,
    /// The divisor for columns of R of length one.
    unit: f64,
}

impl Motions {
    /// The possible motions of a body with these nodes, with some nodes held along directions: empty if it cannot move.
    pub fn left<const D: usize>(
        points: &[[f64; D]],
        held: &[([f64; D], [f64; D])],
    ) -> Option<Self> {
        match D {
            2 => left_among::<D, 3>(points, held),
            _ => left_among::<D, 6>(points, held),
        }
    }

    fn frame<const D: usize>(&self) -> Frame<D> {
        Frame {
            centre: std::array::from_fn(|c| self.centre[c]),
            size: self.size,
        }
    }

    /// The body on some of its nodes, at `points` (of all nodes here); `moves` tells in which of its components a node
    /// moves.
    pub fn body<const D: usize>(
        &self,
        nodes: Vec<u32>,
        points: &[[f64; D]],
        moves: impl Fn(u32, usize) -> bool,
    ) -> FloatingBody<D> {
        let frame = self.frame();
        let mode = |motion: &Vec<f64>| -> Vec<[f64; D]> {
            let at_node = |&node: &u32| {
                // As many as in space; those of the plane are the first three.
                let rows = frame.motions::<6>(&points[node as usize]);
                std::array::from_fn(|c| match moves(node, c) {
                    true => {
                        motion.iter().zip(&rows[c]).map(|(a, r)| a * r).sum::<f64>() / self.unit
                    }
                    false => 0.0,
                })
            };
            nodes.iter().map(at_node).collect()
        };
        FloatingBody {
            modes: self.motions.iter().map(mode).collect(),
            motions: self.motions.clone(),
            frame,
            nodes,
        }
    }
}

/// The motions that directions held leave, with the M rigid motions that there are.
fn left_among<const D: usize, const M: usize>(
    points: &[[f64; D]],
    held: &[([f64; D], [f64; D])],
) -> Option<Motions> {
    let frame = Frame::of_box(points, |edges| 0.5 * length(&edges));
    // A basis of the rows so far: as many rows as there are motions define all of them.
    let mut basis: Vec<[f64; M]> = Vec::new();
    let mut left = Mat::from_fn(M, M, |a, b| f64::from(u8::from(a == b)));
    let mut free = M;
    for held in held.chunks(AT_ONCE) {
        basis.extend(held.iter().map(|(x, way)| {
            let rows = frame.motions::<M>(x);
            std::array::from_fn(|a| (0..D).map(|c| way[c] * rows[c][a]).sum())
        }));
        let rows = basis.len().max(M);
        let matrix = Mat::from_fn(rows, M, |i, j| basis.get(i).map_or(0.0, |row| row[j]));
        let (values, right) = right_singular(&matrix)?;
        basis = (0..M)
            .map(|k| std::array::from_fn(|a| values[k] * right[(a, k)]))
            .collect();
        free = values.iter().filter(|&&v| !(v > 10.0 * STIFFLESS)).count();
        if free == 0 {
            return None;
        }
        left = right;
    }
    // The last ones are left.
    let first = M - free;
    let mut mode_of: Vec<[[f64; M]; D]> = (points.iter())
        .map(|x| {
            let rows = frame.motions::<M>(x);
            rows.map(|row| {
                std::array::from_fn(|k| match k < free {
                    true => (0..M).map(|a| row[a] * left[(a, first + k)]).sum(),
                    false => 0.0,
                })
            })
        })
        .collect();
    let unit = (D as f64 * points.len() as f64).sqrt();
    let weights = orthogonal(&mut mode_of, unit)?;
    let motion = |weights: &[f64; M]| -> Vec<f64> {
        (0..M)
            .map(|a| (0..free).map(|k| left[(a, first + k)] * weights[k]).sum())
            .collect()
    };
    Some(Motions {
        centre: frame.centre.to_vec(),
        size: frame.size,
        motions: weights.iter().map(motion).collect(),
        unit,
    })
}

impl<const D: usize> FloatingBody<D> {
    /// Its possible motions, if all its nodes are here.
    pub(crate) fn how(&self) -> Motions {
        Motions {
            centre: self.frame.centre.to_vec(),
            size: self.frame.size,
            motions: self.motions.clone(),
            unit: (D as f64 * self.nodes.len() as f64).sqrt(),
        }
    }
}

impl<const D: usize> FloatingBodies<D> {
    /// The bodies of these ranks.
    pub(crate) fn of_ranks(bodies: Vec<FloatingBody<D>>, ranks: &Ranks) -> Self {
        debug_assert!(
            bodies
                .iter()
                .all(|b| b.motions.iter().all(|m| m.len() == rigid::count(D)))
        );
        Self {
            bodies,
            ranks: ranks.clone(),
        }
    }
}
