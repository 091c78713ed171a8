"""Exceptions and warnings."""

import contextlib
from typing import Any

from ._native import ModelError, SolveError

__all__ = ["ModelError", "NotConvergedWarning", "SolveError"]


class NotConvergedWarning(UserWarning):
    """A solve has stopped without convergence; ``status`` of the solution gives the reason."""


def with_solution(error: Any, solution: object) -> Any:
    """An exception with the result so far; one of a callback may have no room for it."""
    with contextlib.suppress(Exception):
        error.solution = solution
    return error


NotConvergedWarning.__module__ = "signorini"
