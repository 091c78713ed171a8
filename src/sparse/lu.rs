//! LU decompositions of sparse matrices that share a pattern, by faer in the calling thread.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::lu::{self, NumericLu};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, Mat, Par};

const PAR: Par = Par::Seq;

/// The common structure of all matrices with a pattern.
pub(crate) struct Pattern {
    n: usize,
    /// The starts of columns, and their rows, sorted.
    starts: Vec<usize>,
    rows: Vec<usize>,
    symbolic: lu::SymbolicLu<usize>,
}

impl Pattern {
    /// The pattern of a square matrix in compressed columns; None if memory is short.
    pub fn new(starts: Vec<usize>, rows: Vec<usize>) -> Option<Self> {
        let n = starts.len() - 1;
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &starts, None, &rows);
        let symbolic = lu::factorize_symbolic_lu(pattern, Default::default()).ok()?;
        Some(Self {
            n,
            starts,
            rows,
            symbolic,
        })
    }

    /// The x with M x = b, of the M with these entries; not finite where M is singular.
    pub fn solve(&self, values: &[f64], b: &[f64]) -> Vec<f64> {
        let (n, symbolic) = (self.n, &self.symbolic);
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &self.starts, None, &self.rows);
        let matrix = SparseColMatRef::new(pattern, values);
        let mut numeric = NumericLu::new();
        let mut x = Mat::from_fn(n, 1, |i, _| b[i]);
        let scratch = (symbolic.factorize_numeric_lu_scratch::<f64>(PAR, Default::default()))
            .or(symbolic.solve_in_place_scratch::<f64>(1, PAR));
        let Ok(mut memory) = MemBuffer::try_new(scratch) else {
            return vec![f64::NAN; n];
        };
        let stack = MemStack::new(&mut memory);
        match symbolic.factorize_numeric_lu(&mut numeric, matrix, PAR, stack, Default::default()) {
            Ok(factor) => factor.solve_in_place_with_conj(Conj::No, x.as_mut(), PAR, stack),
            Err(_) => return vec![f64::NAN; n],
        }
        (0..n).map(|i| x[(i, 0)]).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_of_one_pattern() {
        // Columns of [4 1 0; 2 5 1; 0 3 6], then of the same with other numbers, then of a singular one.
        let starts = vec![0, 2, 5, 7];
        let rows = vec![0, 1, 0, 1, 2, 1, 2];
        let pattern = Pattern::new(starts, rows).expect("there is memory");
        for values in [
            [4.0, 2.0, 1.0, 5.0, 3.0, 1.0, 6.0],
            [0.0, 2.0, 1.0, 0.0, 3.0, -1.0, 6.0],
        ] {
            let [a, b, c, d, e, f, g] = values;
            let expected = [1.0, -2.0, 3.0];
            let [x, y, z] = expected;
            let found = pattern.solve(
                &values,
                &[a * x + c * y, b * x + d * y + f * z, e * y + g * z],
            );
            for (found, expected) in found.iter().zip(expected) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
        }
        let found = pattern.solve(&[1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0], &[1.0; 3]);
        assert!(found.iter().any(|v| !v.is_finite()), "{found:?}");
    }
}
