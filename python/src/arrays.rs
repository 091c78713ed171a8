//! Arrays of NumPy as the library reads them, and back.

use crate::errors::argument;
use numpy::{
    Element, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use signorini::problem::SparseRef;

/// The entries of an array that Python has made contiguous.
pub fn entries<'a, T: Element>(
    name: &str,
    array: &'a PyReadonlyArray1<'_, T>,
) -> PyResult<&'a [T]> {
    array
        .as_slice()
        .map_err(|_| argument(name, "the array is not contiguous"))
}

/// The rows of an array with so many columns.
pub fn rows<T: Element + Copy, const N: usize>(
    name: &str,
    array: &PyReadonlyArray2<'_, T>,
) -> PyResult<Vec<[T; N]>> {
    if array.shape()[1] != N {
        let found = array.shape()[1];
        return Err(argument(
            name,
            format!("expected {N} columns, found {found}"),
        ));
    }
    let all = array
        .as_slice()
        .map_err(|_| argument(name, "the array is not contiguous"))?;
    Ok(all.as_chunks::<N>().0.to_vec())
}

/// Numbers as an array of one dimension.
pub fn flat<'py, T: Element>(py: Python<'py>, values: Vec<T>) -> Bound<'py, PyArray1<T>> {
    PyArray1::from_vec(py, values)
}

/// Rows of N as an array of two dimensions.
pub fn table<'py, T: Element + Copy, const N: usize>(
    py: Python<'py>,
    rows: &[[T; N]],
) -> PyResult<Bound<'py, PyArray2<T>>> {
    PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), N])
}

/// A matrix in compressed rows as [`Sparse`] reads it, of entries that come in any order; those outside of it are left out.
pub fn sparse<'py, E>(
    py: Python<'py>,
    n_rows: usize,
    n_cols: usize,
    entries: impl Fn() -> E,
) -> PartsOf<'py>
where
    E: Iterator<Item = (usize, usize, f64)>,
{
    let inside = || entries().filter(|&(i, j, v)| i < n_rows && j < n_cols && v != 0.0);
    let mut starts = vec![0i64; n_rows + 1];
    inside().for_each(|(i, _, _)| starts[i + 1] += 1);
    (0..n_rows).for_each(|i| starts[i + 1] += starts[i]);
    let count = starts[n_rows] as usize;
    let (mut next, mut indices, mut values) = (starts.clone(), vec![0i64; count], vec![0.0; count]);
    for (i, j, v) in inside() {
        let at = next[i] as usize;
        (indices[at], values[at]) = (j as i64, v);
        next[i] += 1;
    }
    (
        n_rows,
        n_cols,
        false,
        flat(py, starts),
        flat(py, indices),
        flat(py, values),
    )
}

/// The parts of a sparse matrix for Python: rows, columns, whether by columns, starts, indices, values.
pub type PartsOf<'py> = (
    usize,
    usize,
    bool,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
);

/// Indices of 32 or 64 bits.
pub enum Indices<'py> {
    Narrow(PyReadonlyArray1<'py, i32>),
    Wide(PyReadonlyArray1<'py, i64>),
}

/// A sparse matrix of SciPy: its parts as they are.
pub struct Sparse<'py> {
    rows: usize,
    cols: usize,
    by_columns: bool,
    starts: Indices<'py>,
    indices: Indices<'py>,
    values: PyReadonlyArray1<'py, f64>,
}

impl<'py> FromPyObject<'_, 'py> for Sparse<'py> {
    type Error = PyErr;

    /// From (rows, columns, whether by columns, starts, indices, values).
    fn extract(from: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        type Parts<'py> = (
            usize,
            usize,
            bool,
            Bound<'py, PyAny>,
            Bound<'py, PyAny>,
            PyReadonlyArray1<'py, f64>,
        );
        let (rows, cols, by_columns, starts, indices, values): Parts = from.extract()?;
        let of_any = |any: &Bound<'py, PyAny>| {
            any.extract()
                .map(Indices::Narrow)
                .or_else(|_| any.extract().map(Indices::Wide))
        };
        Ok(Self {
            rows,
            cols,
            by_columns,
            starts: of_any(&starts)?,
            indices: of_any(&indices)?,
            values,
        })
    }
}

impl Sparse<'_> {
    /// Its shape.
    pub fn shape(&self) -> (usize, usize) {
        (self.rows, self.cols)
    }

    /// The matrix as the library reads it, where it is.
    pub fn matrix(&self, name: &str) -> PyResult<SparseRef<'_>> {
        let values = entries(name, &self.values)?;
        match (&self.starts, &self.indices) {
            (Indices::Narrow(starts), Indices::Narrow(indices)) => {
                Ok(self.of(entries(name, starts)?, entries(name, indices)?, values))
            }
            (Indices::Wide(starts), Indices::Wide(indices)) => {
                Ok(self.of(entries(name, starts)?, entries(name, indices)?, values))
            }
            _ => Err(argument(name, "its indices have different widths")),
        }
    }

    fn of<'a, I: signorini::problem::Index>(
        &self,
        starts: &'a [I],
        indices: &'a [I],
        values: &'a [f64],
    ) -> SparseRef<'a> {
        if self.by_columns {
            SparseRef::from_columns(self.rows, self.cols, starts, indices, values)
        } else {
            SparseRef::from_rows(self.rows, self.cols, starts, indices, values)
        }
    }
}
