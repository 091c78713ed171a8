//! The other processes that work on the same problem, where there are any (feature `mpi`): each, a *rank*, has some of the
//! unknowns, and what goes over all of them is added up here.
//!
//! Every rank gets the same bits: the sum is made on rank 0 and handed to the others. All that depends on sums alone is then the
//! same on all ranks, and they take the same decisions.

#[cfg(feature = "mpi")]
mod group;

#[cfg(feature = "mpi")]
pub use group::Group;

use crate::sparse::{norm, norm_max};
#[cfg(feature = "mpi")]
use std::sync::Arc;

/// This process and those that have the other unknowns: nobody, unless it was made for a group of ranks.
///
/// Its methods are collective: all ranks of the group have to call them, with as many numbers each.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ranks {
    #[cfg(feature = "mpi")]
    group: Option<Arc<Group>>,
}

impl Ranks {
    /// Several ranks, of which this process is one.
    #[cfg(feature = "mpi")]
    pub fn of(group: &Arc<Group>) -> Self {
        Self {
            group: Some(Arc::clone(group)),
        }
    }

    /// Adds up what the ranks have, entry by entry.
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

    /// Euclidean norm of a vector of which each rank has some entries.
    pub fn norm(&self, x: &[f64]) -> f64 {
        #[cfg(feature = "mpi")]
        if let Some(group) = &self.group {
            // Scaled as that of one rank is.
            let scale = group.max(norm_max(x));
            if scale == 0.0 || !scale.is_finite() {
                return scale;
            }
            let mut sum = [x.iter().map(|v| (v / scale).powi(2)).sum::<f64>()];
            group.sum(&mut sum);
            return scale * sum[0].sqrt();
        }
        norm(x)
    }

    /// Its largest absolute value; NaN if there is one.
    pub fn norm_max(&self, x: &[f64]) -> f64 {
        self.max(norm_max(x))
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
