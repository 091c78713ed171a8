//! The other processes that work on the same problem, if any (feature `mpi`): each, a *rank*, has some of the unknowns, and sums
//! over all unknowns are made here.
//!
//! Every rank gets the same bits: rank 0 makes the sum and sends it to the others. Results that depend on sums alone are then
//! the same on all ranks, and so are the decisions.

#[cfg(feature = "mpi")]
mod group;
mod halo;

#[cfg(feature = "mpi")]
pub use group::Group;
pub(crate) use halo::Halo;

use crate::sparse::{norm, norm_max};
use bytemuck::Pod;
#[cfg(feature = "mpi")]
use std::sync::Arc;

/// This process and those that have the other unknowns: none, unless it was made for a group of ranks.
///
/// Its methods are collective: all ranks of the group have to call them, each with the same number of values.
#[derive(Clone, Debug, Default)]
pub struct Ranks {
    #[cfg(feature = "mpi")]
    group: Option<Arc<Group>>,
}

impl Ranks {
    /// Several ranks, including this process.
    #[cfg(feature = "mpi")]
    pub fn of(group: &Arc<Group>) -> Self {
        Self {
            group: Some(Arc::clone(group)),
        }
    }

    /// Adds up the values of the ranks, entry by entry.
    pub fn sum(&self, _values: &mut [f64]) {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            group.sum(_values);
        }
    }

    /// The largest value; NaN if there is one.
    pub fn max(&self, value: f64) -> f64 {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            return group.max(value);
        }
        value
    }

    /// The Euclidean norm of a vector whose entries are distributed over the ranks.
    pub fn norm(&self, x: &[f64]) -> f64 {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            // Scaled as that of one rank is.
            let scale = group.max(norm_max(x));
            if scale == 0.0 || !scale.is_finite() {
                return scale;
            }
            let mut sum = [crate::sparse::squares(x, scale)];
            group.sum(&mut sum);
            return scale * sum[0].sqrt();
        }
        norm(x)
    }

    /// Its largest absolute value; NaN if there is one.
    pub fn norm_max(&self, x: &[f64]) -> f64 {
        self.max(norm_max(x))
    }

    /// Whether there are no others.
    pub fn is_alone(&self) -> bool {
        #[cfg(feature = "mpi")]
        return self.group.is_none();
        #[cfg(not(feature = "mpi"))]
        true
    }

    /// How many there are, including this one.
    pub fn count(&self) -> usize {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            return group.size();
        }
        1
    }

    /// Whether this is the first rank.
    pub fn is_first(&self) -> bool {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            return group.rank() == 0;
        }
        true
    }

    /// Whether this is true on any rank.
    pub fn any(&self, here: bool) -> bool {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            return group.any(here);
        }
        here
    }

    /// The number of this rank, and the count of each.
    pub fn counts(&self, here: usize) -> (usize, Vec<usize>) {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            return (group.rank(), group.counts(here));
        }
        (0, vec![here])
    }

    /// Sends each rank its list, and returns those that the ranks have sent to this one.
    pub fn lists(&self, to: Vec<Vec<u64>>) -> Vec<Vec<u64>> {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            return group.lists(&to);
        }
        to
    }

    /// Sends values to ranks and receives others from them: `from` has the right lengths.
    pub fn swap<T: Pod>(&self, _with: &[usize], _to: &[Vec<T>], _from: &mut [Vec<T>]) {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            group.swap(_with, _to, _from);
        }
    }

    /// The corners of the box around the points of all ranks, the lowest and the highest.
    pub fn box_around<const D: usize>(&self, points: &[[f64; D]]) -> [[f64; D]; 2] {
        let most = |c: usize, sign: f64| {
            let here = points.iter().map(|x| sign * x[c]);
            sign * self.max(here.fold(f64::NEG_INFINITY, f64::max))
        };
        [-1.0, 1.0].map(|sign| std::array::from_fn(|c| most(c, sign)))
    }

    /// The rows of all ranks, one rank after the other.
    pub fn joined<const N: usize>(&self, rows: Vec<[f64; N]>) -> Vec<[f64; N]> {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            let all = group.joined(rows.as_flattened());
            return all.as_chunks().0.to_vec();
        }
        rows
    }
}
