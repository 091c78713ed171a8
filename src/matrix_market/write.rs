//! Matrices, vectors and points as the text of Matrix Market files.

use std::io::{Result, Write};

/// Writes the entries (row, column, value), counted from 0, of a matrix in coordinate form; for a symmetric one those below
/// the diagonal and on it. It iterates over them twice, because their number comes first.
///
/// # Errors
/// The error of the writer.
pub fn write_matrix<I>(
    to: &mut impl Write,
    [rows, cols]: [usize; 2],
    symmetric: bool,
    entries: impl Fn() -> I,
) -> Result<()>
where
    I: Iterator<Item = (usize, usize, f64)>,
{
    let is_written = |&(i, j, value): &(usize, usize, f64)| value != 0.0 && (!symmetric || i >= j);
    let kind = if symmetric { "symmetric" } else { "general" };
    let count = entries().filter(is_written).count();
    writeln!(to, "%%MatrixMarket matrix coordinate real {kind}")?;
    writeln!(to, "{rows} {cols} {count}")?;
    for (i, j, value) in entries().filter(is_written) {
        writeln!(to, "{} {} {value:e}", i + 1, j + 1)?;
    }
    Ok(())
}

/// Writes a matrix in array form, column by column: a vector, or points with a column for each coordinate.
///
/// # Errors
/// The error of the writer.
pub fn write_columns(to: &mut impl Write, columns: &[Vec<f64>]) -> Result<()> {
    let rows = columns.first().map_or(0, Vec::len);
    writeln!(to, "%%MatrixMarket matrix array real general")?;
    writeln!(to, "{rows} {}", columns.len())?;
    for value in columns.iter().flatten() {
        writeln!(to, "{value:e}")?;
    }
    Ok(())
}
