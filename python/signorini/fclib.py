"""Problems of the Friction Contact Library (FCLIB), in HDF5: reads, solves and writes them. Needs h5py."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._delassus import DelassusSolution, solve_delassus
from ._problem import solve
from ._solution import Solution

__all__ = ["Global", "Local", "read", "write"]

Floats = NDArray[np.float64]


@dataclass(eq=False)
class Local:
    """u = W r + q of contacts with Coulomb friction; entries are listed contact by contact, the normal one first.

    Attributes
    ----------
    W : scipy.sparse.csr_matrix, (d m, d m)
    q : ndarray, (d m,)
    friction : ndarray, (m,)
        μ.
    dimension : int
        d, 2 or 3.
    title, description, math_info : str
        The file's own description.
    impulses, velocities : ndarray, (d m,); or None
        The solution in the file, if it has one.
    """

    W: Any
    q: Floats
    friction: Floats
    dimension: int = 3
    title: str = ""
    description: str = ""
    math_info: str = ""
    impulses: Floats | None = field(default=None, repr=False)
    velocities: Floats | None = field(default=None, repr=False)

    def solve(self, **keywords: Any) -> DelassusSolution:
        """Solve it; keywords, result and errors are those of `signorini.solve_delassus`."""
        return solve_delassus(self.W, self.q, friction=self.friction, dimension=self.dimension, **keywords)


@dataclass(eq=False)
class Global:
    """M v = f + H r and u = Hᵀ v + w of bodies with velocities v and their contacts.

    Attributes
    ----------
    M : scipy.sparse.csr_matrix, (n, n)
    H : scipy.sparse.csr_matrix, (n, d m)
    f : ndarray, (n,)
    w : ndarray, (d m,)
    friction, dimension, title, description, math_info, impulses, velocities
        As of `Local`.
    body_velocities : ndarray, (n,); or None
        v of the solution in the file.
    """

    M: Any
    H: Any
    f: Floats
    w: Floats
    friction: Floats
    dimension: int = 3
    title: str = ""
    description: str = ""
    math_info: str = ""
    impulses: Floats | None = field(default=None, repr=False)
    velocities: Floats | None = field(default=None, repr=False)
    body_velocities: Floats | None = field(default=None, repr=False)

    def solve(self, **keywords: Any) -> Solution:
        """Solve it as a problem from matrices, with K = M: `u` of the solution is v, and λ are the impulses. Keywords, result
        and errors are those of `signorini.solve`."""
        d = self.dimension
        row = np.arange(len(self.w))
        normal, along = row[::d], row[row % d > 0]
        B = (-self.H.T).tocsr()
        keywords = {"dependent_rows": True, "interference": True, **keywords}
        return solve(
            (self.M + self.M.T) / 2,
            self.f,
            normal=B[normal],
            tangential=B[along],
            gap=self.w[normal],
            slip_origin=self.w[along],
            friction=self.friction,
            **keywords,
        )


def read(path: str | os.PathLike[str]) -> Local | Global:
    """Read a problem of FCLIB.

    Raises
    ------
    OSError
        If the file cannot be read.
    ValueError
        If it has no local or global problem, a part of it is missing or a matrix is not one, or the problem has constraints beside its
        contacts.
    """
    h5py = _h5py()
    with h5py.File(os.fspath(path), "r") as file:
        for name, of, matrices, vectors in _FORMS:
            if name in file:
                group = file[name]
                for constraint in ("V", "R", "G"):
                    if constraint in group:
                        raise ValueError(f"{path}: {name}/{constraint} constrains the bodies beside their contacts, which is not supported")
                made: dict[str, Any] = {key: _matrix(path, _part(path, group, key)) for key in matrices}
                numbers = _part(path, group, "vectors")
                made |= {key: np.asarray(_part(path, numbers, key), dtype=np.float64).ravel() for key in vectors}
                friction = np.asarray(_part(path, numbers, "mu"), dtype=np.float64).ravel()
                dimension = int(np.ravel(_part(path, group, "spacedim"))[0])
                made |= {key: _text(group["info"], key) for key in _INFO} if "info" in group else {}
                known = file["solution"] if "solution" in file else {}
                made |= {
                    meant: np.asarray(known[key], dtype=np.float64).ravel()
                    for key, meant in _SOLUTION.items()
                    if key in known and (key != "v" or of is Global)
                }
                return of(**made, friction=friction, dimension=dimension)
        raise ValueError(f"{path}: it has neither fclib_local nor fclib_global, but {', '.join(file) or 'nothing'}")


def write(path: str | os.PathLike[str], problem: Local | Global, solution: DelassusSolution | Solution | None = None) -> None:
    """Write a problem in FCLIB's format with its solution: the given one, or the one it was read with."""
    h5py = _h5py()
    name, _, matrices, vectors = next(form for form in _FORMS if isinstance(problem, form[1]))
    known = {key: getattr(problem, meant, None) for key, meant in _SOLUTION.items()}
    if isinstance(solution, DelassusSolution):
        known = {"r": solution.impulses.ravel(), "u": solution.velocities.ravel()}
    elif solution is not None and isinstance(problem, Global):
        r = np.column_stack([solution.lambda_normal, solution.lambda_tangential]).ravel()
        known = {"r": r, "u": problem.H.T @ solution.u + problem.w, "v": solution.u}
    elif solution is not None:
        raise ValueError("solution: expected that of Local.solve")
    with h5py.File(os.fspath(path), "w") as file:
        group = file.create_group(name)
        group["spacedim"] = np.array([problem.dimension], dtype=np.int32)
        for key in matrices:
            _write_matrix(group.create_group(key), getattr(problem, key))
        into = group.create_group("vectors")
        into["mu"] = problem.friction
        for key in vectors:
            into[key] = getattr(problem, key)
        about = group.create_group("info")
        for key in _INFO:
            about[key] = getattr(problem, key)
        made = {key: value for key, value in known.items() if value is not None}
        if made:
            into = file.create_group("solution")
            for key, value in made.items():
                into[key] = value


# The group, its class here, its matrices, its vectors without μ.
_FORMS: list[tuple[str, type[Local] | type[Global], tuple[str, ...], tuple[str, ...]]] = [
    ("fclib_local", Local, ("W",), ("q",)),
    ("fclib_global", Global, ("M", "H"), ("f", "w")),
]
_INFO = ("title", "description", "math_info")
_SOLUTION = {"r": "impulses", "u": "velocities", "v": "body_velocities"}


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise ImportError("files of FCLIB are HDF5: install h5py to read them (pip install h5py)") from error
    return h5py


def _text(group: Any, key: str) -> str:
    if key not in group:
        return ""
    value = np.ravel(group[key][()])[0]
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def _part(path: str | os.PathLike[str], group: Any, key: str) -> Any:
    if key not in group:
        raise ValueError(f"{path}: {group.name} has no {key}")
    return group[key]


def _matrix(path: str | os.PathLike[str], group: Any) -> Any:
    """A matrix in the format of CSparse: nz entries in triplets, compressed columns if nz is −1, compressed rows if it is
    −2."""
    import scipy.sparse

    rows, cols, nz = (int(np.ravel(_part(path, group, key))[0]) for key in ("m", "n", "nz"))
    i, p, x = (np.asarray(_part(path, group, key)).ravel() for key in ("i", "p", "x"))
    shape = (rows, cols)
    try:
        if nz >= 0:
            return scipy.sparse.coo_matrix((x[:nz], (i[:nz], p[:nz])), shape).tocsr()
        if nz not in (-1, -2):
            raise ValueError(f"nz is {nz}")
        of, lines = (scipy.sparse.csc_matrix, cols) if nz == -1 else (scipy.sparse.csr_matrix, rows)
        made = of((x[: p[lines]], i[: p[lines]], p[: lines + 1]), shape)
        # The constructor leaves indices unchecked, and conversions write where they point.
        made.check_format(full_check=True)
        return made.tocsr()
    except (IndexError, ValueError) as error:
        raise ValueError(f"{path}: {group.name} is no matrix of {rows} x {cols}: {error}") from error


def _write_matrix(group: Any, matrix: Any) -> None:
    import scipy.sparse

    columns = scipy.sparse.csc_matrix(matrix, copy=True)
    columns.sum_duplicates()
    numbers = {"nzmax": columns.nnz, "m": columns.shape[0], "n": columns.shape[1], "nz": -1}
    for key, value in numbers.items():
        group[key] = np.array([value], dtype=np.int32)
    group["p"] = columns.indptr.astype(np.int32)
    group["i"] = columns.indices.astype(np.int32)
    group["x"] = columns.data.astype(np.float64)
