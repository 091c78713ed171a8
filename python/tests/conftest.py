"""Helpers of the tests: matrices of the repository's example, and small problems with known answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.io
import scipy.sparse

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "examples"


def _read(name: str) -> Any:
    return scipy.io.mmread(EXAMPLES / "matrices" / f"{name}.mtx")


@pytest.fixture(scope="session")
def block() -> dict[str, Any]:
    """An elastic block on a foundation, with Tresca's law: the matrices of examples/matrices."""
    vectors = {name: np.asarray(_read(name)).ravel() for name in ("f", "d", "g")}
    return {
        "K": scipy.sparse.csr_array(_read("K")),
        "f": vectors["f"],
        "normal": scipy.sparse.csr_array(_read("N")),
        "tangential": scipy.sparse.csr_array(_read("T")),
        "gap": vectors["d"],
        "slip_bound": vectors["g"],
        "coordinates": np.asarray(_read("x")),
    }


@pytest.fixture
def springs() -> dict[str, Any]:
    """Two springs in a row, the outer one pushed into a wall; u = (0.45, 1)."""
    return {
        "K": np.array([[2.0, -1.0], [-1.0, 1.0]]),
        "f": np.array([0.0, 1.0]),
        "normal": np.array([[0.0, 1.0]]),
        "tangential": np.array([[1.0, 0.0]]),
        "gap": np.array([1.0]),
        "slip_bound": np.array([0.1]),
    }


def points_in_space(count: int = 4) -> dict[str, Any]:
    """Points on springs of stiffness 1 in space, pressed by 2 on planes that are 1 away (so λν = 1) and pushed sideways.

    With the bound 0.5 a push of (3, 4) times s slips where 5 s > 0.5: the displacement is the push less 0.5 along it.
    """
    rows = np.arange(count)
    f = np.zeros((count, 3))
    f[:, 2] = -2.0
    f[:, :2] = np.outer(0.05 * (rows + 1), [3.0, 4.0])
    normal = scipy.sparse.csr_array((-np.ones(count), (rows, 3 * rows + 2)), shape=(count, 3 * count))
    tangents = np.stack([3 * rows, 3 * rows + 1], axis=1).ravel()
    tangential = scipy.sparse.csr_array((np.ones(2 * count), (np.arange(2 * count), tangents)), shape=(2 * count, 3 * count))
    return {
        "K": scipy.sparse.identity(3 * count, format="csr"),
        "f": f.ravel(),
        "normal": normal,
        "tangential": tangential,
        "gap": np.ones(count),
        "slip_bound": np.full(count, 0.5),
    }


@pytest.fixture
def run_program() -> Any:
    """Runs the command `signorini` of the package as a user does; its exit code must be 0 unless stated otherwise."""
    import subprocess
    import sys

    def run(*arguments: Any, code: int = 0) -> str:
        command = [sys.executable, "-m", "signorini", *map(str, arguments)]
        made = subprocess.run(command, capture_output=True, text=True, timeout=600)
        assert made.returncode == code, made.stderr
        return made.stdout

    return run
