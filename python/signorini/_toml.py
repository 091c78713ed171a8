"""Values of Python as values of TOML, for the tables of a case file."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import numpy as np

from ._arrays import unmasked


def value(name: str, given: Any) -> str:
    """A value in TOML; floats to the last bit."""
    unmasked(name, given)
    if isinstance(given, (bool, np.bool_)):
        return "true" if given else "false"
    if isinstance(given, (int, np.integer)):
        if not -(2**63) <= int(given) < 2**63:
            raise ValueError(f"{name}: {given} is too large for an integer; pass a float")
        return str(int(given))
    if isinstance(given, (float, np.floating)):
        return repr(float(given))
    if isinstance(given, (str, os.PathLike)):
        # A JSON string is also a TOML string, except for this character.
        return json.dumps(os.fspath(given), ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(given, Mapping):
        entries = (f"{key(k)} = {value(f'{name}.{k}', v)}" for k, v in given.items() if v is not None)
        return "{ " + ", ".join(entries) + " }"
    if isinstance(given, np.ndarray) and given.ndim == 1 and given.dtype.kind in "fi":
        return "[" + ", ".join(map(repr, given.tolist())) + "]"
    if isinstance(given, (list, tuple, np.ndarray)) and getattr(given, "ndim", 1) > 0:
        return "[" + ", ".join(value(name, entry) for entry in given) + "]"
    if isinstance(given, np.ndarray):
        return value(name, given[()])
    raise ValueError(f"{name}: {type(given).__name__} is not a type that a case can have")


def key(name: Any) -> str:
    """A key, quoted where necessary."""
    text = str(name)
    return text if text.replace("_", "a").replace("-", "a").isalnum() and text.isascii() else json.dumps(text)


def table(header: str, entries: Mapping[str, Any]) -> str:
    """A table under its header, a line for each key; None is left out."""
    lines = [f"{key(k)} = {value(k, v)}" for k, v in entries.items() if v is not None]
    return "\n".join([header, *lines, ""])


def setting(path: str, given: Any) -> str:
    """An entry of a case that replaces another, in the form of the command line."""
    if not isinstance(path, str):
        raise ValueError(f"settings: {path!r} is not a key such as \"solver.tolerance\"")
    return f"{path}={value(path, given)}"
