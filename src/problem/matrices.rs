//! The entry for matrices of other libraries: scalar entries, in compressed rows or columns, read in place.

use super::{ContactData, ContactProblem, ProblemError, check};
use crate::sparse::{BlockCsr, Csr};
use faer::sparse::SparseColMatRef;

/// The data of a [`ContactProblem`] in the form of other libraries: scalar sparse matrices and slices. The letters and
/// the lengths are those of [`ContactData`].
///
/// ```
/// use faer::sparse::{SparseColMat, Triplet};
/// use signorini::problem::{ContactProblem, Matrices, SparseRef};
///
/// // A matrix of faer, and one in compressed rows: row pointers, column indices and values.
/// let k = [(0, 0, 2.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)];
/// let k = k.map(|(row, col, val)| Triplet { row, col, val });
/// let k: SparseColMat<usize, f64> = SparseColMat::try_new_from_triplets(2, 2, &k)?;
/// let problem: ContactProblem = ContactProblem::from_matrices(Matrices {
///     stiffness: k.as_ref().into(),
///     load: &[0.0, 1.0],
///     normal: SparseRef::from_rows(1, 2, &[0, 1], &[1], &[1.0]),
///     tangential: SparseRef::from_rows(1, 2, &[0, 1], &[0], &[1.0]),
///     gap: &[1.0],
///     slip_bound: &[0.1],
///     ..Matrices::default()
/// })?;
/// assert_eq!((problem.n(), problem.m()), (2, 1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct Matrices<'a, const D: usize = 2> {
    /// K, n × n, both triangles.
    pub stiffness: SparseRef<'a>,
    /// f, length n.
    pub load: &'a [f64],
    /// N, m × n.
    pub normal: SparseRef<'a>,
    /// T, (D − 1)m × n.
    pub tangential: SparseRef<'a>,
    /// d, length m.
    pub gap: &'a [f64],
    /// Whether entries of d below 0 are intended: an overlap of pressed or shrunk parts.
    pub interference: bool,
    /// Whether rows of N and T may depend on each other, as rows of bodies do where several parts of one are under one
    /// facet of another. Forces on the bodies are still unique, multipliers need not be.
    pub dependent_rows: bool,
    /// g, length m; may be empty where coefficients of friction are given. A node has one or the other: 0 there.
    pub slip_bound: &'a [f64],
    /// μ, length m: Coulomb's law where it is above 0. Empty without.
    pub friction_coefficient: &'a [f64],
    /// The diagonal of C, length D m in the order of λ: compliant contact ([`ContactProblem::with_compliance`]). Rows of N and T
    /// that have one may depend on all others, and such a row of N may be empty. Empty: hard contact.
    pub compliance: &'a [f64],
    /// The node that each D unknowns belong to, if n is a multiple of D and they are ordered node by node.
    pub coordinates: Option<&'a [[f64; D]]>,
}

impl<const D: usize> ContactProblem<D> {
    /// A problem from scalar matrices. They are copied into blocks; n need not be a multiple of D.
    ///
    /// # Errors
    /// The entry and its fault: those of the matrices themselves (lengths, pointers, indices), and all that
    /// [`ContactProblem::new`], [`ContactProblem::with_friction_coefficient`], [`ContactProblem::with_one_law`] and
    /// [`ContactProblem::with_gap`] check.
    pub fn from_matrices(matrices: Matrices<'_, D>) -> Result<Self, ProblemError> {
        let k = matrices.stiffness;
        // Blocks would hide these errors, or allocate memory for a typing error.
        if k.n_rows != k.n_cols {
            return Err(ProblemError::NotSquare {
                rows: k.n_rows,
                cols: k.n_cols,
            });
        }
        if matrices.load.len() != k.n_rows {
            return Err(ProblemError::Length {
                name: "the load f",
                found: matrices.load.len(),
                expected: k.n_rows,
                reason: "one entry per row of K",
            });
        }
        let shape = |matrix: &SparseRef| (matrix.n_rows, matrix.n_cols);
        let (normal, tangential) = (matrices.normal, matrices.tangential);
        let (m, n) = (matrices.gap.len(), matrices.load.len());
        check::contact_shapes::<D>(shape(&normal), shape(&tangential), m, n)?;
        let mu = matrices.friction_coefficient;
        let slip_bound = match matrices.slip_bound {
            [] if !mu.is_empty() => vec![0.0; m],
            given => given.to_vec(),
        };
        let gap = matrices.gap.to_vec();
        let open = |d: &f64| {
            if matrices.interference {
                d.max(0.0)
            } else {
                *d
            }
        };
        let data = ContactData {
            stiffness: k.blocks("K")?,
            load: matrices.load.to_vec(),
            normal: normal.blocks("N")?,
            tangential: tangential.blocks("T")?,
            gap: gap.iter().map(open).collect(),
            slip_bound,
            coordinates: matrices.coordinates.map(<[_]>::to_vec),
        };
        let compliance = matrices.compliance.to_vec();
        let checked = match matrices.dependent_rows {
            true => Self::of_bodies(data, compliance, &[]),
            false => Self::compliant(data, compliance),
        };
        let problem = (checked?.with_friction_coefficient(mu.to_vec())?).with_one_law()?;
        match matrices.interference {
            true => problem.with_gap(gap),
            false => Ok(problem),
        }
    }

    /// Another gap, under the rule of [`ContactProblem::new`]: rounding apart, no entry is below 0.
    ///
    /// # Errors
    /// That of an entry below 0, and those of [`ContactProblem::with_gap`].
    pub fn with_open_gap(self, mut gap: Vec<f64>) -> Result<Self, ProblemError> {
        check::open_gap(&mut gap, self.coordinates(), self.load(), self.diagonal())?;
        self.with_gap(gap)
    }
}

/// A borrowed sparse matrix of scalars, in compressed rows or columns counted from 0.
///
/// Entries of a row may be in any order, and repeated ones add up. Nothing is checked before the matrix is used.
#[derive(Clone, Copy, Debug)]
pub struct SparseRef<'a> {
    n_rows: usize,
    n_cols: usize,
    by_columns: bool,
    starts: Indices<'a>,
    /// Of lines that are shorter than the distance to the next start.
    lengths: Option<Indices<'a>>,
    indices: Indices<'a>,
    values: &'a [f64],
}

impl<'a> SparseRef<'a> {
    /// Compressed rows (CSR): row i owns the entries `row_ptr[i]..row_ptr[i + 1]` of `col_idx` and `values`;
    /// `row_ptr` has one entry more than there are rows.
    pub fn from_rows<I: Index>(
        n_rows: usize,
        n_cols: usize,
        row_ptr: &'a [I],
        col_idx: &'a [I],
        values: &'a [f64],
    ) -> Self {
        Self {
            n_rows,
            n_cols,
            by_columns: false,
            starts: I::indices(row_ptr),
            lengths: None,
            indices: I::indices(col_idx),
            values,
        }
    }

    /// Compressed columns (CSC): the same with rows and columns exchanged.
    pub fn from_columns<I: Index>(
        n_rows: usize,
        n_cols: usize,
        col_ptr: &'a [I],
        row_idx: &'a [I],
        values: &'a [f64],
    ) -> Self {
        Self {
            n_rows,
            n_cols,
            by_columns: true,
            ..Self::from_rows(n_cols, n_rows, col_ptr, row_idx, values)
        }
    }

    /// A copy in compressed rows. `name` is the name of the matrix in errors.
    ///
    /// # Errors
    /// If its parts do not fit, or an index is out of range.
    pub fn to_rows(&self, name: &'static str) -> Result<Csr, ProblemError> {
        self.blocks(name)
    }

    /// A copy in blocks, with its sizes rounded up to whole blocks. `name` is the name of the matrix in errors.
    fn blocks<const B: usize>(&self, name: &'static str) -> Result<BlockCsr<B>, ProblemError> {
        self.check(name)?;
        Ok(BlockCsr::from_passes(self.n_rows, self.n_cols, || {
            let lines = 0..self.n_lines();
            lines.flat_map(|line| {
                let (start, end) = self.range(line);
                (start as usize..end as usize).map(move |k| {
                    let (line, across) = (line as u32, self.indices.get(k) as u32);
                    let (i, j) = if self.by_columns {
                        (across, line)
                    } else {
                        (line, across)
                    };
                    (i, j, self.values[k])
                })
            })
        }))
    }

    /// Rows of compressed rows, columns of compressed columns.
    fn n_lines(&self) -> usize {
        if self.by_columns {
            self.n_cols
        } else {
            self.n_rows
        }
    }

    /// The entries of a line: start and end.
    fn range(&self, line: usize) -> (i64, i64) {
        let start = self.starts.get(line);
        let end = match self.lengths {
            Some(lengths) => start.saturating_add(lengths.get(line)),
            None => self.starts.get(line + 1),
        };
        (start, end)
    }

    fn check(&self, name: &'static str) -> Result<(), ProblemError> {
        let (rows, cols) = (self.n_rows, self.n_cols);
        if rows.max(cols) >= u32::MAX as usize {
            return Err(ProblemError::TooLarge { name, rows, cols });
        }
        let (line, across, limit, pointers, indices) = if self.by_columns {
            ("column", "row", rows, "column pointers", "row indices")
        } else {
            ("row", "column", cols, "row pointers", "column indices")
        };
        let (lines, count) = (self.n_lines(), self.values.len());
        let parts = [
            (
                pointers,
                self.starts.len(),
                lines + 1,
                "one per line, and one more",
            ),
            (indices, self.indices.len(), count, "one per value"),
        ];
        for (part, found, expected, reason) in parts {
            if found != expected {
                return Err(ProblemError::Parts {
                    name,
                    part,
                    found,
                    expected,
                    reason,
                });
            }
        }
        let mut next = 0;
        for number in 0..lines {
            let (start, end) = self.range(number);
            let follows = start == next || (self.lengths.is_some() && start >= next);
            let complete = number + 1 < lines || self.lengths.is_some() || end == count as i64;
            if !(follows && complete && start <= end && end <= count as i64) {
                return Err(ProblemError::Pointers {
                    name,
                    line,
                    number: number + 1,
                    start,
                    end,
                    count,
                });
            }
            next = end;
            for k in start as usize..end as usize {
                let index = self.indices.get(k);
                if !(0..limit as i64).contains(&index) {
                    return Err(ProblemError::Index {
                        name,
                        line,
                        number: number + 1,
                        across,
                        index,
                        limit,
                    });
                }
            }
        }
        Ok(())
    }
}

impl Default for SparseRef<'_> {
    /// A matrix without rows and columns.
    fn default() -> Self {
        Self::from_rows::<usize>(0, 0, &[0], &[], &[])
    }
}

impl<'a, I: Index + faer::Index> From<SparseColMatRef<'a, I, f64>> for SparseRef<'a> {
    fn from(matrix: SparseColMatRef<'a, I, f64>) -> Self {
        let (n_rows, n_cols, col_ptr, lengths, row_idx) = matrix.symbolic().parts();
        // The arrays may be longer than the last column.
        let end = match (lengths, col_ptr.last()) {
            (None, Some(end)) => end.zx().min(row_idx.len()),
            _ => row_idx.len(),
        };
        let (row_idx, values) = (&row_idx[..end], &matrix.val()[..end]);
        Self {
            lengths: lengths.map(I::indices),
            ..Self::from_columns(n_rows, n_cols, col_ptr, row_idx, values)
        }
    }
}

/// An integer that rows, columns and entries may be counted with: `i32`, `u32`, `i64` or `usize`.
pub trait Index: Copy + sealed::Sealed {
    #[doc(hidden)]
    fn indices(slice: &[Self]) -> Indices<'_>;
}

/// Indices of any integer type.
#[doc(hidden)]
#[derive(Clone, Copy, Debug)]
pub enum Indices<'a> {
    I32(&'a [i32]),
    U32(&'a [u32]),
    I64(&'a [i64]),
    Usize(&'a [usize]),
}

impl Indices<'_> {
    fn len(&self) -> usize {
        match self {
            Self::I32(all) => all.len(),
            Self::U32(all) => all.len(),
            Self::I64(all) => all.len(),
            Self::Usize(all) => all.len(),
        }
    }

    /// One of them; negative if it overflows.
    fn get(&self, k: usize) -> i64 {
        match self {
            Self::I32(all) => all[k].into(),
            Self::U32(all) => all[k].into(),
            Self::I64(all) => all[k],
            Self::Usize(all) => all[k].try_into().unwrap_or(-1),
        }
    }
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for i32 {}
    impl Sealed for u32 {}
    impl Sealed for i64 {}
    impl Sealed for usize {}
}

impl Index for i32 {
    fn indices(slice: &[Self]) -> Indices<'_> {
        Indices::I32(slice)
    }
}

impl Index for u32 {
    fn indices(slice: &[Self]) -> Indices<'_> {
        Indices::U32(slice)
    }
}

impl Index for i64 {
    fn indices(slice: &[Self]) -> Indices<'_> {
        Indices::I64(slice)
    }
}

impl Index for usize {
    fn indices(slice: &[Self]) -> Indices<'_> {
        Indices::Usize(slice)
    }
}
