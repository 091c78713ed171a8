"""The Rust side of the package."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._watch import Hearer

class ModelError(ValueError):
    """A mesh, a model or a case is inconsistent; the text gives the remedy."""

class SolveError(RuntimeError):
    """A problem could not be solved: K is singular, for example, or a GPU failed.

    ``solution`` has what was reached, where anything was.
    """

    solution: Any

_Sparse = tuple[int, int, bool, NDArray[Any], NDArray[Any], NDArray[np.float64]]
_Cells = list[tuple[str, NDArray[np.uint32], NDArray[np.uint32]]]

class Problem:
    @staticmethod
    def matrices(
        stiffness: _Sparse,
        load: NDArray[np.float64],
        normal: _Sparse,
        tangential: _Sparse,
        gap: NDArray[np.float64],
        slip_bound: NDArray[np.float64] | None,
        friction: NDArray[np.float64] | None,
        coordinates: NDArray[np.float64] | None,
        dim: int | None,
        *,
        interference: bool,
        dependent_rows: bool,
        slip_origin: NDArray[np.float64] | None = None,
        areas: NDArray[np.float64] | None = None,
        compliance: NDArray[np.float64] | None = None,
        tied: list[bool] | None = None,
    ) -> Problem: ...
    @property
    def title(self) -> str: ...
    @property
    def dim(self) -> int: ...
    @property
    def n(self) -> int: ...
    @property
    def m(self) -> int: ...
    @property
    def n_steps(self) -> int: ...
    def contact_of_places(self) -> list[int] | None: ...
    def contacts(self) -> list[tuple[str | None, str, str]]: ...
    def friction_coefficient(self) -> list[float]: ...
    def parts(self) -> dict[str, Any] | None: ...
    def solve(
        self,
        hears: Hearer | None,
        keywords: dict[str, Any],
        *,
        load: NDArray[np.float64] | None = None,
        gap: NDArray[np.float64] | None = None,
        slip_bound: NDArray[np.float64] | None = None,
        slip_origin: NDArray[np.float64] | None = None,
        friction: NDArray[np.float64] | None = None,
        before: Solved | None = None,
    ) -> tuple[Solved, Any]: ...

class Solved:
    @property
    def n_steps(self) -> int: ...
    def report(self) -> str: ...
    def vectors(self, step: int) -> dict[str, Any]: ...
    def displacement(self, step: int) -> NDArray[np.float64]: ...
    def stress(self, step: int) -> list[NDArray[np.float64]]: ...
    def contact(self, step: int) -> dict[str, Any]: ...
    def mesh(self) -> Mesh | None: ...
    def write(self, directory: str, plots: bool) -> list[str]: ...

class Mesh:
    @staticmethod
    def stated(text: str) -> Mesh: ...
    @staticmethod
    def of_arrays(
        points: NDArray[np.float64],
        cells: Sequence[tuple[str, NDArray[np.int64]]],
        region_of: NDArray[np.int64],
        regions: Sequence[str],
        groups: Mapping[str, Sequence[int]],
        facets: Mapping[str, Sequence[NDArray[np.int64]]],
        node_sets: Mapping[str, NDArray[np.int64]],
        by_nodes: Sequence[str],
        notes: Sequence[str],
    ) -> Mesh: ...
    @staticmethod
    def joined(parts: Sequence[Mesh]) -> Mesh: ...
    def placed(self, shift: Sequence[float], regions: Mapping[str, str], boundaries: Mapping[str, str]) -> Mesh: ...
    @property
    def dim(self) -> int: ...
    @property
    def n_elements(self) -> int: ...
    @property
    def n_bodies(self) -> int: ...
    def points(self) -> NDArray[np.float64]: ...
    def cells(self) -> _Cells: ...
    def regions(self) -> tuple[NDArray[np.uint32], list[str], dict[str, list[int]]]: ...
    def boundaries(self) -> dict[str, list[NDArray[np.uint32]]]: ...
    def node_sets(self) -> dict[str, NDArray[np.uint32]]: ...
    def notes(self) -> list[str]: ...

def solve_delassus(
    matrix: _Sparse | None,
    product: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None,
    diagonal: NDArray[np.float64],
    q: NDArray[np.float64],
    friction: NDArray[np.float64],
    dimension: int,
    hears: Hearer | None,
    keywords: dict[str, Any],
) -> tuple[dict[str, Any], Any]: ...
def build(mesh: Mesh, text: str) -> Problem: ...
def check_tables(text: str, dim: int) -> None: ...
def read_case(path: str, settings: Sequence[str]) -> Problem: ...
def program(arguments: Sequence[str]) -> int: ...
def version() -> str: ...
