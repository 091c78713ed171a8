//! Matrix Market files: real (or integer) matrices in coordinate or array form, general or symmetric.

mod parse;
mod write;

use crate::input;
use crate::sparse::{BlockCsr, Csr};
use parse::Entry;
use std::path::{Path, PathBuf};
pub use write::{write_columns, write_matrix};

/// A file could not be read, or holds other data than requested.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MatrixMarketError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The system's message.
        source: std::io::Error,
    },
    /// A line is invalid.
    #[error("{}, line {line}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// The fault.
        message: String,
    },
    /// The matrix has a shape that does not fit its purpose.
    #[error("{}: {message}", path.display())]
    Shape {
        /// The file.
        path: PathBuf,
        /// The expected and the actual shape.
        message: String,
    },
}

/// A matrix as the file has it.
#[derive(Clone, Debug)]
pub struct Matrix {
    rows: usize,
    cols: usize,
    /// The entries in the order of the file, counted from 0, in pieces as they were read.
    stored: Vec<Vec<Entry>>,
    /// Whether the entries are the lower triangle of a symmetric matrix.
    symmetric: bool,
    path: PathBuf,
}

impl Matrix {
    /// Rows.
    pub fn n_rows(&self) -> usize {
        self.rows
    }

    /// Columns.
    pub fn n_cols(&self) -> usize {
        self.cols
    }

    /// The entries (row, column, value), counted from 0, in the order of the file; both triangles of a symmetric
    /// matrix. Repeated ones count as their sum.
    pub fn triplets(&self) -> impl Iterator<Item = (usize, usize, f64)> + '_ {
        self.entries()
            .map(|(i, j, value)| (i as usize, j as usize, value))
    }

    fn entries(&self) -> impl Iterator<Item = Entry> + '_ {
        self.stored.iter().flatten().flat_map(|&(i, j, value)| {
            let mirror = (self.symmetric && i != j).then_some((j, i, value));
            std::iter::once((i, j, value)).chain(mirror)
        })
    }

    /// The entries of a matrix with one column (or one row).
    pub fn into_vector(self) -> Result<Vec<f64>, MatrixMarketError> {
        if self.rows != 1 && self.cols != 1 {
            return Err(MatrixMarketError::Shape {
                message: format!(
                    "expected a vector, found a {} × {} matrix",
                    self.rows, self.cols
                ),
                path: self.path,
            });
        }
        let mut vector = vec![0.0; self.rows * self.cols];
        for (i, j, value) in self.triplets() {
            vector[i + j] += value;
        }
        Ok(vector)
    }

    /// The rows of a matrix with a column for each coordinate: points in the plane, or in space.
    pub fn into_points<const D: usize>(self) -> Result<Vec<[f64; D]>, MatrixMarketError> {
        if self.cols != D {
            let expected = match D {
                2 => "two columns (x and y)".to_owned(),
                3 => "three columns (x, y and z)".to_owned(),
                _ => format!("{D} columns"),
            };
            return Err(MatrixMarketError::Shape {
                message: format!("expected {expected}, found {}", self.cols),
                path: self.path,
            });
        }
        let mut points = vec![[0.0; D]; self.rows];
        for (i, j, value) in self.triplets() {
            points[i][j] += value;
        }
        Ok(points)
    }

    /// The matrix in compressed rows.
    pub fn into_csr(self) -> Csr {
        BlockCsr::from_passes(self.rows, self.cols, || self.entries())
    }

    /// A stiffness matrix, in blocks of the D unknowns of a node.
    ///
    /// # Errors
    /// If the file has too few entries to fill the diagonal: that many rows are a slip of the pen, and they would
    /// take memory.
    pub fn into_stiffness<const D: usize>(self) -> Result<BlockCsr<D>, MatrixMarketError> {
        let count: usize = self.stored.iter().map(Vec::len).sum();
        // Callers check that it is square.
        if self.rows == self.cols && count < self.rows {
            return Err(MatrixMarketError::Shape {
                message: format!(
                    "a stiffness matrix has a positive diagonal, and this one has {} rows and only {count} entries",
                    self.rows
                ),
                path: self.path,
            });
        }
        Ok(BlockCsr::from_passes(self.rows, self.cols, || {
            self.entries()
        }))
    }
}

/// Reads a file, on all threads.
///
/// The entries keep the order of the file, whatever the number of threads. Memory is allocated for the contents of the
/// file, not for the sizes in its header.
pub fn read(path: &Path) -> Result<Matrix, MatrixMarketError> {
    let text = input::whole(path, input::data_limit()).map_err(|source| MatrixMarketError::Io {
        path: path.to_owned(),
        source,
    })?;
    match parse::parse(&text, parse::PIECE) {
        Ok((header, stored)) => Ok(Matrix {
            rows: header.rows,
            cols: header.cols,
            symmetric: header.symmetric,
            stored,
            path: path.to_owned(),
        }),
        Err((line, message)) => Err(MatrixMarketError::Format {
            path: path.to_owned(),
            line,
            message,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::{ContactData, ContactProblem};
    use crate::reference::{self, CASE_A, Geometry};
    use web_time::Instant;

    /// Reads a text by way of a file.
    fn of_file(text: &str) -> Matrix {
        let file = tempfile::NamedTempFile::new().unwrap_or_else(|error| panic!("{error}"));
        std::fs::write(&file, text).unwrap_or_else(|error| panic!("{error}"));
        read(file.path()).unwrap_or_else(|error| panic!("{error}"))
    }

    #[test]
    fn a_stiffness_matrix_has_entries_for_its_diagonal() {
        let header = "%%MatrixMarket matrix coordinate real symmetric\n";
        let tall = of_file(&format!("{header}100000 100000 1\n1 1 1\n"));
        match tall.into_stiffness::<2>() {
            Err(error) => assert!(error.to_string().contains("100000 rows and only 1 entries")),
            Ok(k) => panic!("{} rows", k.n_rows()),
        }
        let sound = of_file(&format!("{header}2 2 4\n1 1 1\n2 1 -3\n2 1 1\n2 2 5\n"));
        let entries: Vec<_> = sound.triplets().collect();
        assert_eq!(entries.len(), 6);
        let k = sound
            .into_stiffness::<2>()
            .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(k.row(0).1, [[[1.0, -2.0], [-2.0, 5.0]]]);
    }

    /// The time before the solver starts, at n = 204 360.
    #[test]
    #[ignore = "prints times"]
    fn times_of_a_large_matrix() {
        let mesh = reference::mesh(Geometry::OneBody, 13);
        let problem = reference::problem(Geometry::OneBody, &mesh, &CASE_A)
            .unwrap_or_else(|error| panic!("{error}"));
        let (k, n) = (problem.stiffness(), problem.n());
        let mut text = Vec::new();
        write_matrix(&mut text, [n, n], true, || k.triplets())
            .unwrap_or_else(|error| panic!("{error}"));
        let file = tempfile::NamedTempFile::new().unwrap_or_else(|error| panic!("{error}"));
        std::fs::write(&file, text).unwrap_or_else(|error| panic!("{error}"));
        for _ in 0..3 {
            let mut last = Instant::now();
            let mut lap = |what: &str| {
                println!("{what:>10} {:7.1} ms", 1e3 * last.elapsed().as_secs_f64());
                last = Instant::now();
            };
            let bytes = std::fs::read(file.path()).map(|bytes| bytes.len());
            lap("bytes");
            let matrix = read(file.path()).unwrap_or_else(|error| panic!("{error}"));
            lap("read");
            let stiffness = matrix
                .into_stiffness()
                .unwrap_or_else(|error| panic!("{error}"));
            lap("blocks");
            // The same except for blocks that hold nothing.
            assert_eq!(stiffness.diagonal(), k.diagonal());
            lap("(check)");
            let again = ContactProblem::new(ContactData {
                stiffness,
                load: problem.load().to_vec(),
                normal: problem.normal().clone(),
                tangential: problem.tangential().clone(),
                gap: problem.gap().to_vec(),
                slip_bound: problem.slip_bound().to_vec(),
                coordinates: problem.coordinates().map(<[_]>::to_vec),
            });
            lap("problem");
            assert_eq!(again.map(|again| again.n()), Ok(n));
            println!("{bytes:?} bytes, n = {n}\n");
        }
    }
}
