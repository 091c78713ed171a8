"""Contact with friction between elastic bodies, and between bodies and rigid obstacles.

Three ways lead to a :class:`Solution`:

- matrices of your own: :func:`solve` in one call, :class:`Problem` for many right-hand sides; :func:`solve_delassus` for a
  given Delassus operator W, :mod:`signorini.fclib` for files of such problems;
- a :class:`Model` on a :class:`Mesh`: the tables of a case file, with keyword arguments as its keys;
- a case file: ``Case.read("press.toml").solve()``.

Any consistent units will do. Long computations let other threads work, and Ctrl-C interrupts them.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import fclib
    from ._delassus import DelassusSolution, solve_delassus
    from ._errors import ModelError, NotConvergedWarning, SolveError
    from ._mesh import Mesh, box, rectangle
    from ._model import Model
    from ._problem import Case, Problem, solve
    from ._solution import Contact, Kkt, LoadStep, Solution, Support
    from ._watch import Step

    __version__: str

# The module of each name: NumPy and the solver itself are loaded with the first one used.
_HOMES = {
    "Case": "_problem",
    "Contact": "_solution",
    "DelassusSolution": "_delassus",
    "Kkt": "_solution",
    "LoadStep": "_solution",
    "Mesh": "_mesh",
    "Model": "_model",
    "ModelError": "_errors",
    "NotConvergedWarning": "_errors",
    "Problem": "_problem",
    "Solution": "_solution",
    "SolveError": "_errors",
    "Step": "_watch",
    "Support": "_solution",
    "box": "_mesh",
    "rectangle": "_mesh",
    "solve": "_problem",
    "solve_delassus": "_delassus",
}

__all__ = [
    "Case",
    "Contact",
    "DelassusSolution",
    "Kkt",
    "LoadStep",
    "Mesh",
    "Model",
    "ModelError",
    "NotConvergedWarning",
    "Problem",
    "Solution",
    "SolveError",
    "Step",
    "Support",
    "box",
    "fclib",
    "rectangle",
    "solve",
    "solve_delassus",
]


def __getattr__(name: str) -> object:
    if name == "__version__":
        from ._native import version

        return version()
    if name == "fclib":
        return importlib.import_module(".fclib", __name__)
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(importlib.import_module(f".{home}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__, "__version__"])
