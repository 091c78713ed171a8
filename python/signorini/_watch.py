"""The observers of a solve: callbacks, the log, the bar."""

from __future__ import annotations

import json
import logging
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

LOG = logging.getLogger("signorini")


@dataclass(frozen=True)
class Step:
    """An outer step of the method, as a callback sees it.

    Attributes
    ----------
    load_step : int
        The load step, from 1.
    iter : int
        The step, from 1.
    inner : int
        Newton steps on the surrogate; in the algorithms as printed, CG iterations.
    products : int
        Products with A since the start of the load step.
    err : float
        The error relative to the first one.
    separated, stick, slip, frictionless, tied : int
        The numbers of contact places that are open, stick, slip, have no law of friction, or are tied.
    changes : int
        The number of places that changed their set since the step before.
    """

    load_step: int
    iter: int
    inner: int
    products: int
    err: float
    separated: int
    stick: int
    slip: int
    frictionless: int
    tied: int
    changes: int

    @classmethod
    def _of(cls, row: dict[str, Any]) -> Step:
        sets = row["sets"]
        err = row["err"]
        return cls(
            load_step=row["load_step"],
            iter=row["iter"],
            inner=row["inner"],
            products=row["n_A"],
            err=math.nan if err is None else err,
            separated=sets["separated"],
            stick=sets["stick"],
            slip=slips(sets),
            frictionless=sets["frictionless"],
            tied=sets["tied"],
            changes=row["changes"],
        )


def slips(sets: dict[str, int]) -> int:
    """The number of slipping places, in either direction."""
    return sets["slip"] if "slip" in sets else sets["slip_plus"] + sets["slip_minus"]


class Hearer:
    """Receives the events of a solve, on the thread that called it."""

    def __init__(self, callback: Callable[[Step], object] | None, bar: Bar | None) -> None:
        self._callback = callback
        self._bar = bar

    def line(self, text: str) -> None:
        """A choice and its reason."""
        LOG.info(text)

    def begins(self, number: int, of: int, factor: float) -> None:
        """A load step begins."""
        if of > 1:
            LOG.info("load step %d of %d, factor %g", number, of, factor)
        if self._bar:
            self._bar.begins(number, of)

    def step(self, row: str, words: str) -> bool:
        """An outer step is made; returns whether to continue."""
        LOG.debug(words)
        if not self._callback and not self._bar:
            return True
        step = Step._of(json.loads(row))
        if self._bar:
            self._bar.step(step)
        if self._callback is None:
            return True
        said = self._callback(step)
        return not isinstance(said, (bool, np.bool_)) or bool(said)

    def ends(self, number: int, status: str) -> None:
        """A load step has ended."""
        LOG.info("load step %d: %s", number, status)
        if self._bar:
            self._bar.ends()


class Bar:
    """A line on standard error that is overwritten: the decades by which the error still has to fall."""

    WIDTH = 30

    def __init__(self, tolerance: float) -> None:
        self._decades = -math.log10(tolerance)
        self._where = ""

    def begins(self, number: int, of: int) -> None:
        """A load step begins."""
        self._where = f"load step {number}/{of} " if of > 1 else ""
        self._show(0.0, "")

    def step(self, step: Step) -> None:
        """An outer step is made."""
        fallen = -math.log10(step.err) if step.err > 0 else self._decades
        self._show(fallen / self._decades, f"step {step.iter}, err {step.err:.1e}, {step.products} products")

    def ends(self) -> None:
        """A load step has ended."""
        self._write("\n")

    def _show(self, part: float, text: str) -> None:
        full = round(self.WIDTH * min(max(part, 0.0), 1.0)) if math.isfinite(part) else 0
        bar = "█" * full + "·" * (self.WIDTH - full)
        self._write(f"\r{self._where}{bar} {text:<40}")

    def _write(self, text: str) -> None:
        # Programs with windows may have none.
        if sys.stderr is not None:
            sys.stderr.write(text)
            sys.stderr.flush()
