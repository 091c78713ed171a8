"""Arrays of users, in the form that the solver reads."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]
# (rows, columns, whether by columns, starts, indices, values)
Sparse: TypeAlias = tuple[int, int, bool, NDArray[Any], NDArray[Any], Floats]


def unmasked(name: str, value: Any) -> None:
    """Refuse a masked array: masked entries have no value."""
    if isinstance(value, np.ma.MaskedArray):
        raise ValueError(f"{name}: masked arrays have entries without a value; pass value.filled(…) or value.compressed()")


def dimension(name: str, value: Any) -> None:
    """Refuse what is not the dimension of a plane or of space."""
    if not isinstance(value, (int, np.integer)) or value not in (2, 3):
        raise ValueError(f"{name}: must be the integer 2 or 3, not {value!r}")


def floats(name: str, value: ArrayLike) -> Floats:
    """Real numbers as contiguous float64; the same array if it is so already."""
    unmasked(name, value)
    try:
        array = np.asarray(value)
    except ValueError as error:
        raise ValueError(f"{name}: {error}") from None
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name}: expected real numbers, found an array of dtype {array.dtype}")
    return np.ascontiguousarray(array, dtype=np.float64) if array.ndim else array.astype(np.float64)


def vector(name: str, value: ArrayLike, length: int | None = None) -> Floats:
    """A vector; if its length is known, a number is repeated for all entries."""
    array = floats(name, value)
    if array.ndim == 0 and length is not None:
        return np.full(length, float(array))
    if array.ndim != 1:
        raise ValueError(f"{name}: expected a vector, found an array of shape {array.shape}")
    if length is not None and len(array) != length:
        raise ValueError(f"{name}: expected {length} entries, found {len(array)}")
    return array


def table(name: str, value: ArrayLike) -> Floats:
    """An array of two dimensions."""
    array = floats(name, value)
    if array.ndim != 2:
        raise ValueError(f"{name}: expected an array of two dimensions, found one of shape {array.shape}")
    return array


def integers(name: str, value: ArrayLike) -> NDArray[np.int64]:
    """Integers as contiguous int64."""
    unmasked(name, value)
    array = np.asarray(value)
    if array.size == 0:
        array = array.astype(np.int64)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name}: expected integers, found an array of dtype {array.dtype}")
    return np.ascontiguousarray(array, dtype=np.int64)


def flags(name: str, value: ArrayLike, length: int) -> list[bool]:
    """A list of so many booleans."""
    unmasked(name, value)
    array = np.asarray(value)
    if array.dtype.kind != "b" or array.shape != (length,):
        raise ValueError(f"{name}: expected {length} of True or False, found dtype {array.dtype}, shape {array.shape}")
    return [bool(one) for one in array]


def sparse(name: str, matrix: Any) -> Sparse:
    """A matrix of SciPy, a similar one, or a dense one, in compressed rows or columns, copied only if necessary."""
    if hasattr(matrix, "to_scipy_sparse"):
        matrix = matrix.to_scipy_sparse()
    if not hasattr(matrix, "tocsr"):
        dense = table(name, matrix)
        rows, cols = dense.nonzero()
        starts = np.zeros(dense.shape[0] + 1, dtype=np.int64)
        np.cumsum(np.bincount(rows, minlength=dense.shape[0]), out=starts[1:])
        return (*dense.shape, False, starts, cols.astype(np.int64), dense[rows, cols])
    if getattr(matrix, "format", None) not in ("csr", "csc"):
        matrix = matrix.tocsr()
    if len(matrix.shape) != 2:
        raise ValueError(f"{name}: expected a matrix, found an array of shape {matrix.shape}")
    starts, indices = np.asarray(matrix.indptr), np.asarray(matrix.indices)
    if starts.dtype != indices.dtype or starts.dtype not in (np.int32, np.int64):
        starts, indices = starts.astype(np.int64), indices.astype(np.int64)
    values = vector(name, matrix.data)
    # The arrays may be longer than the last entry.
    if len(starts) and 0 <= starts[-1] < min(len(indices), len(values)):
        indices, values = indices[: starts[-1]], values[: starts[-1]]
    starts, indices = np.ascontiguousarray(starts), np.ascontiguousarray(indices)
    rows, cols = matrix.shape
    return (int(rows), int(cols), matrix.format == "csc", starts, indices, values)


def zeros(rows: int, cols: int) -> Sparse:
    """A matrix without entries."""
    none = np.zeros(0, dtype=np.int64)
    return (rows, cols, False, np.zeros(rows + 1, dtype=np.int64), none, np.zeros(0))
