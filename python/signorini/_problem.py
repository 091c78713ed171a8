"""Contact problems: from matrices, from case files, and from models."""

from __future__ import annotations

import difflib
import inspect
import os
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _arrays, _native
from ._errors import NotConvergedWarning, SolveError, with_solution
from ._mesh import Mesh
from ._solution import Solution, contact_names, stated_names
from ._toml import setting
from ._watch import LOG, Bar, Hearer, Step


# The settings of a solve without a separate keyword.
SETTINGS = ("beta", "c_fact", "max_iterations", "method", "r_tol", "time_limit")


def known_settings(settings: Mapping[str, Any], of: Callable[..., Any]) -> None:
    """Refuse unknown settings, and suggest a keyword of `of`."""
    for name in settings:
        if name not in SETTINGS:
            known = [*SETTINGS, *list(inspect.signature(of).parameters)[:-1]]
            meant = [one for one in known if one.startswith(name)] or difflib.get_close_matches(name, known, 1)
            hint = f"did you mean {meant[0]}?" if meant else f"there are {', '.join(SETTINGS)}"
            raise ValueError(f"{name}: no solve has such a setting; {hint}")


def _needs_tangential(slip_bound: Any, friction: Any, slip_origin: Any) -> None:
    """Refuse friction without T."""
    if any(given is not None for given in (slip_bound, friction, slip_origin)):
        raise ValueError("tangential: friction needs T, the displacements along the boundary")


class Problem:
    """A contact problem from matrices, kept with its factor or its multigrid hierarchy.

    Find u and the contact forces λν (m), λτ (m × (d − 1)) with K u + Nᵀλν + Tᵀλτ = f, N u ≤ d with pressure λν ≥ 0 only
    where the gap is closed, and friction by Tresca's or Coulomb's law.

    Parameters
    ----------
    K : sparse or dense matrix, (n, n)
        The stiffness matrix, symmetric, positive definite, or semidefinite where bodies can move as a whole (found from
        `coordinates`).
    f : array_like, (n,)
        The load.
    normal : sparse or dense matrix, (m, n)
        N: the displacement of contact node i towards the obstacle is (N u)ᵢ.
    tangential : sparse or dense matrix, (m, n) in the plane, (2 m, n) in space; optional
        T: the displacement of contact node i along the boundary; in space rows 2 i and 2 i + 1 are those along two
        directions at right angles. Without T there is no friction.
    gap : array_like, (m,), or float
        d: the initial gap.
    slip_bound : array_like, (m,), or float; optional
        g: Tresca's law, a force per contact node.
    friction : array_like, (m,), or float; optional
        μ: Coulomb's law, where it is above 0; `slip_bound` has to be 0 there.
    coordinates : array_like, (n / d, d); optional
        The node of each d unknowns, which are ordered node by node.
    dim : 2 or 3; optional
        The dimension; by default it follows from the shapes of T and `coordinates`.
    interference : bool
        Whether entries of `gap` below 0 are intended: an overlap of pressed or shrunk parts.
    slip_origin : array_like, a number per row of T; optional
        The origin of slip.
    areas : array_like, (m,); optional
        The areas that turn forces into pressures, to which the tolerance applies.
    compliance : array_like, (m + rows of T,); optional
        The diagonal of C in m/N, in the order of λν, then λτ: the contact itself deforms by C λ.
    tied : array_like of bool, (m,); optional
        Which contact nodes hold together in every direction; their gaps have to be finite.
    dependent_rows : bool
        Whether rows of N and T may depend on each other, as rows of bodies do where several parts of one are under one facet
        of another.

    Raises
    ------
    ValueError
        If an argument has the wrong shape or type, or invalid entries.
    """

    def __init__(
        self,
        K: Any,
        f: ArrayLike,
        *,
        normal: Any,
        tangential: Any = None,
        gap: ArrayLike = 0.0,
        slip_bound: ArrayLike | None = None,
        friction: ArrayLike | None = None,
        coordinates: ArrayLike | None = None,
        dim: int | None = None,
        interference: bool = False,
        slip_origin: ArrayLike | None = None,
        areas: ArrayLike | None = None,
        compliance: ArrayLike | None = None,
        tied: ArrayLike | None = None,
        dependent_rows: bool = False,
    ) -> None:
        if dim is not None:
            _arrays.dimension("dim", dim)
        points = None if coordinates is None else _arrays.table("coordinates", coordinates)
        self._model: tuple[Any, ...] = ()
        N = _arrays.sparse("normal", normal)
        m = N[0]
        if tangential is None:
            _needs_tangential(slip_bound, friction, slip_origin)
            d = dim if dim is not None else 2 if points is None else points.shape[1]
            T = _arrays.zeros((d - 1) * m, N[1])
        else:
            if slip_bound is None and friction is None:
                raise ValueError("slip_bound or friction: T is given, so state Tresca's or Coulomb's law, or leave T out")
            T = _arrays.sparse("tangential", tangential)
        bound = 0.0 if slip_bound is None else slip_bound
        self._native = _native.Problem.matrices(
            _arrays.sparse("K", K),
            _arrays.vector("f", f),
            N,
            T,
            _arrays.vector("gap", gap, m),
            _arrays.vector("slip_bound", bound, m),
            None if friction is None else _arrays.vector("friction", friction, m),
            points,
            dim,
            interference=bool(interference),
            dependent_rows=bool(dependent_rows),
            slip_origin=None if slip_origin is None else _arrays.vector("slip_origin", slip_origin, T[0]),
            areas=None if areas is None else _arrays.vector("areas", areas, m),
            compliance=None if compliance is None else _arrays.vector("compliance", compliance, m + T[0]),
            tied=None if tied is None else _arrays.flags("tied", tied, m),
        )

    @classmethod
    def _of(cls, native: _native.Problem, *model: Any) -> Problem:
        self = cls.__new__(cls)
        self._native = native
        # The mesh and the tables that it was built from.
        self._model = model
        return self

    @property
    def title(self) -> str:
        """The title of the case."""
        return self._native.title

    @property
    def dim(self) -> int:
        """2 in the plane, 3 in space."""
        return self._native.dim

    @property
    def n(self) -> int:
        """Unknowns that no support prescribes."""
        return self._native.n

    @property
    def m(self) -> int:
        """Contact places."""
        return self._native.m

    @property
    def n_steps(self) -> int:
        """Load steps."""
        return self._native.n_steps

    @property
    def contacts(self) -> list[str]:
        """The names of the contacts, as in `Solution.contacts`; empty for a problem from matrices."""
        return contact_names(self._native.contacts())

    def __reduce__(self) -> tuple[Any, ...]:
        parts = self._native.parts()
        if parts is None:
            return _built, self._model
        return _of_parts, (parts,)

    def __repr__(self) -> str:
        steps = f", {self.n_steps} load steps" if self.n_steps > 1 else ""
        where = "the plane" if self.dim == 2 else "space"
        return f"<{type(self).__name__} in {where}: n = {self.n}, m = {self.m}{steps}>"

    def _is_model(self) -> bool:
        return self._native.contact_of_places() is not None

    def _friction(self, given: ArrayLike | Mapping[str, float]) -> _arrays.Floats:
        """The coefficients of all places: one for all, one for each, or by the names of contacts."""
        if not isinstance(given, Mapping):
            return _arrays.vector("friction", given, self.m)
        of_places = self._native.contact_of_places()
        names = self.contacts
        if of_places is None:
            raise ValueError("friction: a problem from matrices has no named contacts; give a number, or one for each")
        stated, tied = stated_names(self._native.contacts()), np.array(self._native.tied(), dtype=bool)
        coefficients = np.array(self._native.friction_coefficient() or [0.0] * self.m)
        for name, value in given.items():
            if name not in names:
                raise ValueError(f"friction: there is no contact {name!r}; there are {', '.join(map(repr, names))}")
            alike = [one for one, of in zip(names, stated) if of == name]
            if not all(one in given for one in alike):
                listed = ", ".join(map(repr, alike))
                raise ValueError(f"friction: several contacts are called {name!r}: give each its own name, or list {listed}")
            there = np.asarray(of_places) == names.index(name)
            if tied[there].any():
                raise ValueError(f"friction: {name!r} is a tie or another joint, along which nothing slips")
            coefficients[there] = value
        return coefficients

    def solve(
        self,
        f: ArrayLike | None = None,
        *,
        gap: ArrayLike | None = None,
        slip_bound: ArrayLike | None = None,
        friction: ArrayLike | Mapping[str, float] | None = None,
        slip_origin: ArrayLike | None = None,
        after: Solution | None = None,
        tolerance: float | None = None,
        stiffness: str = "auto",
        backend: str = "auto",
        precision: str = "auto",
        preconditioner: str = "multigrid",
        adapter: str | int | None = None,
        callback: Callable[[Step], object] | None = None,
        progress: bool = False,
        check: bool = False,
        **settings: Any,
    ) -> Solution:
        """Solve, reusing the factor or the hierarchy of earlier solves if `stiffness`, `backend`, `precision`,
        `preconditioner` and `adapter` are the same.

        Several threads may call it: solves of one problem wait for each other, solves of different problems do not.

        Parameters
        ----------
        f, gap, slip_bound, slip_origin : array_like; optional
            Vectors that replace those of the problem, under the same rules. Only for problems from matrices: models and
            cases have them in their load steps.
        friction : array_like, (m,), float, or dict; optional
            Coefficients of friction that replace those of the problem: one for all places, one for each, or by the names of
            contacts. Ties stay ties.
        after : Solution; optional
            The load step before this one: friction acts on the slip since then, from the `slip_origin` of that step unless
            another one is given. Of this problem, or of one with the same K, N and T. Only for problems from matrices.
        tolerance : float; optional
            ε; default: that of the case, or 1e-6.
        stiffness : {"auto", "cholesky", "pcg"}
            The solver of the systems with K.
        backend : {"auto", "cpu", "gpu"}
            The device.
        precision : {"auto", "f64", "f32"}
            That of a GPU's kernels; answers are accurate to f64 in any case.
        preconditioner : {"multigrid", "block-jacobi"}
            The preconditioner of PCG.
        adapter : str or int; optional
            The GPU to take: a part of its name, or its number in the list of ``signorini adapters``.
        callback : callable; optional
            Called with a `Step` after each outer step; the solve stops when it returns False.
        progress : bool
            Whether to draw a bar on standard error.
        check : bool
            Whether a solve that does not converge is an error.
        **settings
            The other keys of ``[solver]`` in case files, such as ``max_iterations``; ``time_limit`` in seconds.

        Returns
        -------
        Solution

        Raises
        ------
        ValueError
            If an argument is invalid.
        SolveError
            If the problem cannot be solved or, with `check`, does not converge; `error.solution` has the result so far, or
            None.
        KeyboardInterrupt
            After Ctrl-C, as soon as the current product is finished; `error.solution` has the result so far.

        Warns
        -----
        NotConvergedWarning
            If the solve stops without convergence.
        """
        vectors = {"f": f, "gap": gap, "slip_bound": slip_bound, "slip_origin": slip_origin, "after": after}
        if self._is_model():
            for name, value in vectors.items():
                if value is not None:
                    raise ValueError(f"{name}: a model states its own loads and load steps: change the model")
        elif not self._native.has_tangential and self.m:
            _needs_tangential(slip_bound, friction, slip_origin)
        m = self.m
        lengths = {"gap": m, "slip_bound": m, "slip_origin": (self.dim - 1) * m}
        arrays = {
            name: _arrays.vector(name, value, lengths.get(name))
            for name, value in vectors.items()
            if value is not None and not isinstance(value, Solution)
        }
        if friction is not None:
            arrays["friction"] = self._friction(friction)
        if "f" in arrays:
            arrays["load"] = arrays.pop("f")
        if "after" in arrays:
            raise ValueError("after: expected a Solution")
        if callback is not None and not callable(callback):
            raise ValueError("callback: expected a callable or None")
        known_settings(settings, Problem.solve)
        keywords = {
            "tolerance": tolerance,
            "stiffness": stiffness,
            "backend": backend,
            "precision": precision,
            "preconditioner": preconditioner,
            "adapter": adapter,
            **settings,
        }
        bar = Bar(tolerance or 1e-6) if progress else None
        heard = callback is not None or bar is not None or LOG.isEnabledFor(20)
        native, stopped = self._native.solve(
            Hearer(callback, bar) if heard else None,
            keywords,
            before=None if after is None else after._handle("after"),
            **arrays,
        )
        solution = Solution(native)
        if stopped is not None:
            raise with_solution(stopped, solution if native.n_steps else None)
        return _told(solution, check)


def _built(mesh: Mesh, tables: str) -> Problem:
    """The problem of a model, assembled again from the mesh and the tables in its pickle."""
    return Problem._of(_native.build(mesh._native, tables), mesh, tables)


def _of_parts(parts: dict[str, Any]) -> Problem:
    """A pickled problem from matrices; it was checked when it was made."""
    return Problem._of(_native.Problem.matrices(**parts, dependent_rows=True))


def _told(solution: Solution, check: bool) -> Solution:
    """The solution, with a warning or an error if it has not converged."""
    if solution.converged:
        return solution
    text = f"not converged: {solution.status}"
    bodies = [f"{body['body']}: {body['motion']}" for body in solution.report["steps"][-1]["not_held"]]
    if bodies:
        text += " (" + "; ".join(bodies) + ")"
    if check:
        raise with_solution(SolveError(text), solution)
    warnings.warn(text, NotConvergedWarning, stacklevel=3)
    return solution


def solve(
    K: Any,
    f: ArrayLike,
    *,
    normal: Any,
    tangential: Any = None,
    gap: ArrayLike = 0.0,
    slip_bound: ArrayLike | None = None,
    friction: ArrayLike | None = None,
    coordinates: ArrayLike | None = None,
    dim: int | None = None,
    interference: bool = False,
    slip_origin: ArrayLike | None = None,
    areas: ArrayLike | None = None,
    compliance: ArrayLike | None = None,
    tied: ArrayLike | None = None,
    dependent_rows: bool = False,
    tolerance: float = 1e-6,
    stiffness: str = "auto",
    backend: str = "auto",
    precision: str = "auto",
    callback: Callable[[Step], object] | None = None,
    progress: bool = False,
    check: bool = False,
    **settings: Any,
) -> Solution:
    """Solve a contact problem from matrices.

    The parameters are those of `Problem`, then those of `Problem.solve`, as are the result and the errors.

    Examples
    --------
    Two springs in a row, the outer one pushed into a wall that is 1 away and rubs with at most 0.1:

    >>> import signorini
    >>> solution = signorini.solve(
    ...     [[2, -1], [-1, 1]], [0, 1], normal=[[0, 1]], tangential=[[1, 0]], gap=1.0, slip_bound=0.1
    ... )
    >>> solution.u.round(6)
    array([0.45, 1.  ])
    """
    problem = Problem(
        K,
        f,
        normal=normal,
        tangential=tangential,
        gap=gap,
        slip_bound=slip_bound,
        friction=friction,
        coordinates=coordinates,
        dim=dim,
        interference=interference,
        slip_origin=slip_origin,
        areas=areas,
        compliance=compliance,
        tied=tied,
        dependent_rows=dependent_rows,
    )
    return problem.solve(
        tolerance=tolerance,
        stiffness=stiffness,
        backend=backend,
        precision=precision,
        callback=callback,
        progress=progress,
        check=check,
        **settings,
    )


class Case(Problem):
    """The problem of a case file, ready to be solved; `Case.read` makes it."""

    path: Path
    _settings: dict[str, Any]

    def __init__(self) -> None:
        raise TypeError("make one with Case.read(path)")

    @classmethod
    def read(cls, path: str | os.PathLike[str], settings: Mapping[str, Any] | None = None) -> Case:
        """Read a case file with its mesh or matrices, and assemble it.

        Parameters
        ----------
        path : path
            The case file (TOML).
        settings : dict; optional
            Entries to replace or add, by their keys: ``{"solver.tolerance": 1e-8, "contact.0.friction.coulomb": 0.4}``.

        Returns
        -------
        Case

        Raises
        ------
        OSError
            If a file cannot be read.
        ModelError
            If the case is inconsistent; the text names the line.
        """
        texts = [setting(key, value) for key, value in (settings or {}).items()]
        self = cls.__new__(cls)
        self._native = _native.read_case(os.fspath(path), texts)
        self.path = Path(path)
        self._settings = dict(settings or {})
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        # Unpickling reads the file again.
        return Case.read, (self.path.absolute(), self._settings)
