"""Contacts with a given Delassus operator: velocities u = W r + q at impulses r."""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _native
from ._errors import NotConvergedWarning, SolveError, with_solution
from ._problem import known_settings
from ._solution import Kkt, _freeze, _nan
from ._watch import LOG, Bar, Hearer, Step

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class DelassusSolution:
    """Impulses and velocities of m contacts; each row has the normal component first, then the tangential ones.

    Attributes
    ----------
    impulses : ndarray, (m, d)
        r; r[:, 0] ≥ 0 presses.
    velocities : ndarray, (m, d)
        u = W r + q; u[:, 0] ≥ 0 parts.
    state : ndarray of str, (m,)
        "separated", "stick", "slip", or "contact" where μ = 0.
    status : str
        "converged", "iteration_limit", "stagnated", "time_limit", "interrupted".
    natural_map : float
        ‖r − P(r − (u + μ ‖u_t‖ n))‖ / ‖q‖ with the projection P on the cones ‖r_t‖ ≤ μ r_n: the measure of Siconos and
        FCLIB.
    kkt : Kkt
        The optimality conditions, each relative to its own scale, in any units.
    iterations, products : int
        Outer steps; products with W.
    """

    impulses: Floats
    velocities: Floats
    state: NDArray[np.str_]
    status: str
    natural_map: float
    kkt: Kkt
    iterations: int
    products: int

    @property
    def converged(self) -> bool:
        """Whether the requested accuracy was reached, and checked."""
        return self.status == "converged"

    def __repr__(self) -> str:
        return (
            f"<DelassusSolution {self.status}: m = {len(self.impulses)}, {self.iterations} steps, {self.products} products, "
            f"natural map {self.natural_map:.1e}>"
        )


def natural_map(impulses: Floats, velocities: Floats, friction: Floats) -> float:
    """‖r − P(r − (u + μ ‖u_t‖ n))‖ of rows of impulses and velocities, the normal component first."""
    # Where μ is infinite, what is pressed does not slide, and neither term has a limit.
    sticks = np.isinf(friction)
    friction = np.where(sticks, 0.0, friction)
    slid = velocities.copy()
    slid[:, 0] += friction * np.linalg.norm(velocities[:, 1:], axis=1)
    moved = impulses - slid
    normal, along = moved[:, 0], np.linalg.norm(moved[:, 1:], axis=1)
    # Within the cone a point is its own projection, within the polar cone the tip is; other points go to the edge.
    edge = (normal + friction * along) / (1.0 + friction**2)
    inside = np.where(sticks, normal > 0.0, (normal >= 0.0) & (along <= friction * normal))
    tip = sticks | (friction * along <= -normal)
    scale = np.divide(friction * edge, along, out=np.zeros_like(along), where=along > 0.0)
    projected = np.column_stack([edge, scale[:, None] * moved[:, 1:]])
    projected = np.where(inside[:, None], moved, np.where(tip[:, None], 0.0, projected))
    return float(np.linalg.norm(impulses - projected))


def solve_delassus(
    W: Any,
    q: ArrayLike,
    *,
    friction: ArrayLike,
    dimension: int = 3,
    order: str = "interleaved",
    diagonal: ArrayLike | None = None,
    tolerance: float = 1e-6,
    callback: Callable[[Step], object] | None = None,
    progress: bool = False,
    check: bool = False,
    **settings: Any,
) -> DelassusSolution:
    """Solve for the impulses r of m contacts with Coulomb friction whose velocities are u = W r + q.

    u_n ≥ 0, r_n ≥ 0 and u_n r_n = 0; ‖r_t‖ ≤ μ r_n, and where a contact slides, r_t opposes u_t and ‖r_t‖ = μ r_n. W may be
    semidefinite, as it is with more contacts than motions: velocities are unique in more cases than impulses.

    Parameters
    ----------
    W : sparse or dense matrix, (d m, d m), or callable
        The Delassus operator, symmetric and positive semidefinite; a callable, or a ``LinearOperator`` of SciPy, returns W x
        for a vector x.
    q : array_like, (d m,) or (m, d)
        The velocities without impulses; rows are those of contacts in either order.
    friction : array_like, (m,), or float
        μ.
    dimension : 2 or 3
        d.
    order : {"interleaved", "blocks"}
        Of rows of W and of a vector q: normal, tangential entries, contact by contact; or all normal entries first, then the
        tangential ones contact by contact.
    diagonal : array_like, (d m,), or float; optional
        The diagonal of a callable W, or an estimate: it makes the contacts comparable. Without it, some products estimate
        its mean.
    tolerance, callback, progress, check, **settings
        As of `Problem.solve`.

    Returns
    -------
    DelassusSolution

    Raises
    ------
    ValueError
        If an argument is invalid.
    SolveError
        With `check`, if the solve does not converge; `error.solution` has the result so far.

    Warns
    -----
    NotConvergedWarning
        If the solve stops without convergence.

    Examples
    --------
    A ball that falls on a floor and slides along it:

    >>> import numpy as np, signorini
    >>> solution = signorini.solve_delassus(2 * np.eye(3), [-1.0, 3.0, 0.0], friction=0.5)
    >>> solution.impulses.round(6)
    array([[ 0.5 , -0.25,  0.  ]])
    """
    _arrays.dimension("dimension", dimension)
    if order not in ("interleaved", "blocks"):
        raise ValueError(f"order: must be \"interleaved\" or \"blocks\", not {order!r}")
    known_settings(settings, solve_delassus)
    given = _arrays.floats("q", q)
    if given.ndim != 1 and given.shape[1:] != (dimension,):
        raise ValueError(f"q: expected a vector or an array of shape (m, {dimension}), found one of shape {given.shape}")
    free = given.ravel()
    m, rest = divmod(len(free), dimension)
    if rest:
        raise ValueError(f"q: {len(free)} entries are not a multiple of dimension = {dimension}")
    mu = _arrays.vector("friction", friction, m)
    place = np.arange(len(free))
    if order == "blocks":
        place = np.column_stack([np.arange(m), np.arange(m, len(free)).reshape(m, dimension - 1)]).ravel()
    free = np.ascontiguousarray(free if given.ndim == 2 else free[place])
    matrix = product = None
    if callable(W) or hasattr(W, "matvec"):
        product = _product(getattr(W, "matvec", W), place)
        if diagonal is None:
            # Of independent signs z, z ∘ W z has the diagonal as its mean.
            signs = np.random.default_rng(0).choice([-1.0, 1.0], (4, len(free)))
            mean = float(np.mean([z @ product(z) for z in signs])) / max(len(free), 1)
            diagonal = mean if mean > 0.0 else 1.0
        scale = _arrays.vector("diagonal", diagonal, len(free))
        scale = scale[place] if np.ndim(diagonal) else scale
    else:
        if diagonal is not None:
            raise ValueError("diagonal: W is a matrix and has its own diagonal; leave it out")
        matrix, scale = _matrix(W, len(free), place)
    bar = Bar(tolerance) if progress else None
    heard = callback is not None or bar is not None or LOG.isEnabledFor(20)
    made, stopped = _native.solve_delassus(
        matrix,
        product,
        np.ascontiguousarray(scale),
        free,
        mu,
        dimension,
        Hearer(callback, bar) if heard else None,
        {"tolerance": tolerance, **settings},
    )
    report = json.loads(made["report"])
    r, u = (made[name].reshape(m, dimension) for name in ("impulses", "velocities"))
    size = float(np.linalg.norm(free))
    solution = DelassusSolution(
        impulses=_freeze(r),
        velocities=_freeze(u),
        state=_freeze(np.array(made["state"], dtype=np.str_)),
        status=report["status"],
        natural_map=natural_map(r, u, mu) / (size if size > 0.0 else 1.0),
        kkt=Kkt(**{name: _nan(value) for name, value in report["kkt"].items()}),
        iterations=report["iter"],
        products=report["n_A"],
    )
    if stopped is not None:
        raise with_solution(stopped, solution)
    if not solution.converged:
        text = f"not converged: {solution.status}"
        if check:
            raise with_solution(SolveError(text), solution)
        warnings.warn(text, NotConvergedWarning, stacklevel=2)
    return solution


def _product(times: Callable[[Floats], ArrayLike], place: NDArray[np.int64]) -> Callable[[Floats], Floats]:
    """W x, with x and W x contact by contact."""

    def product(x: Floats) -> Floats:
        of_user = np.empty_like(x)
        of_user[place] = x
        made = _arrays.floats("W", times(of_user))
        if made.size != len(x) or made.size != max(made.shape, default=0):
            raise ValueError(f"W: it returns an array of shape {made.shape} for a vector of shape {x.shape}, and should return W x")
        made = made.ravel()
        if not np.isfinite(made).all():
            worst = int(np.flatnonzero(~np.isfinite(made))[0])
            raise ValueError(f"W: entry {worst} of W x is {made[worst]}")
        return np.ascontiguousarray(made[place])

    return product


def _matrix(W: Any, n: int, place: NDArray[np.int64]) -> tuple[_arrays.Sparse, Floats]:
    """W contact by contact, and its diagonal."""
    rows, cols, by_columns, starts, indices, values = _arrays.sparse("W", W)
    if (rows, cols) != (n, n):
        raise ValueError(f"W: q has {n} entries, and W is {rows} × {cols}")
    line = np.repeat(np.arange(n), np.diff(starts))
    if len(indices) and not (0 <= indices.min() and indices.max() < n):
        raise ValueError(f"W: it has an index that is not between 0 and {n - 1}")
    back = np.empty_like(place)
    back[place] = np.arange(n)
    i, j = back[line], back[indices]
    if by_columns:
        i, j = j, i
    order = np.lexsort((j, i))
    i, j, values = i[order], j[order], values[order]
    # Repeated entries add up.
    key = i * n + j
    first = np.flatnonzero(np.diff(key, prepend=-1))
    i, j, key = i[first], j[first], key[first]
    values = np.add.reduceat(values, first) if len(first) else values
    diagonal = np.zeros(n)
    diagonal[i[i == j]] = values[i == j]
    # The mirror of each entry: a search finds it, because keys are sorted.
    at = np.minimum(np.searchsorted(key, j * n + i), max(len(key) - 1, 0))
    mirror = np.where(key[at] == j * n + i, values[at], 0.0) if len(key) else values
    off = np.abs(values - mirror)
    largest = float(np.abs(values).max(initial=0.0))
    if off.max(initial=0.0) > 1e-9 * largest:
        worst = int(off.argmax())
        a, b = int(place[i[worst]]), int(place[j[worst]])
        raise ValueError(
            f"W: it is not symmetric: W[{a}, {b}] = {values[worst]:g} but W[{b}, {a}] = {mirror[worst]:g}; hand over "
            "(W + W.T) / 2 where that is rounding"
        )
    starts = np.zeros(n + 1, dtype=np.int64)
    np.cumsum(np.bincount(i, minlength=n), out=starts[1:])
    return (n, n, False, starts, np.ascontiguousarray(j), np.ascontiguousarray(values)), diagonal
