"""Exceptions and warnings."""

from ._native import ModelError, SolveError

__all__ = ["ModelError", "NotConvergedWarning", "SolveError"]


class NotConvergedWarning(UserWarning):
    """A solve has stopped without convergence; ``status`` of the solution gives the reason."""


NotConvergedWarning.__module__ = "signorini"
