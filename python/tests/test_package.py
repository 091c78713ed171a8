"""The package: types, the command, names."""

from __future__ import annotations

import ast
import importlib.metadata
import inspect
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import EXAMPLES, ROOT

import signorini
from signorini import _native

HERE = Path(__file__).resolve().parent


def test_types() -> None:
    """mypy in strict mode: the package, and a program that uses it."""
    for place, target in ((HERE.parent, "signorini"), (HERE, "typed.py")):
        command = [sys.executable, "-m", "mypy", "--config-file", str(HERE.parent / "pyproject.toml"), target]
        made = subprocess.run(command, capture_output=True, text=True, cwd=place)
        assert made.returncode == 0, made.stdout


def test_stubs_are_complete() -> None:
    tree = ast.parse((Path(signorini.__file__).parent / "_native.pyi").read_text(encoding="utf-8"))

    def names(of: Any) -> set[str]:
        return {name for name in dir(of) if not name.startswith("_")}

    stubs = {node.name: node for node in tree.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))}
    assert set(stubs) == names(_native)
    for name, node in stubs.items():
        if isinstance(node, ast.ClassDef) and name not in ("ModelError", "SolveError"):
            stated = {one.name for one in node.body if isinstance(one, ast.FunctionDef)}
            assert stated == names(getattr(_native, name)), name


def test_keywords_of_models_are_keys_of_case_files() -> None:
    """Each keyword that is spelled out is one that the library knows: it complains of the value, never of the key."""
    bodies = ("material", "support", "foundation", "traction", "force", "body_force", "temperature")
    for table in (*bodies, "contact", "tie", "spring", "preload", "coupling", "cyclic", "equation"):
        parameters = inspect.signature(getattr(signorini.Model, table)).parameters.values()
        for name in (p.name for p in parameters if p.name != "self" and p.kind is not p.VAR_KEYWORD):
            with pytest.raises(signorini.ModelError) as caught:
                signorini.Model(signorini.rectangle([1, 1], [1, 1])).add(table, **{name: object_of_no_type()})
            assert f"unknown field `{name}`" not in str(caught.value), caught.value


def object_of_no_type() -> Any:
    return {"no such key": 1}


def test_everything_offered_exists_and_is_documented() -> None:
    for name in signorini.__all__:
        assert getattr(signorini, name).__doc__, name
    assert set(signorini.__all__) <= set(dir(signorini))
    assert signorini.__version__ == importlib.metadata.version("signorini")
    with pytest.raises(AttributeError):
        signorini.nothing  # noqa: B018


def test_docstrings() -> None:
    import doctest

    from signorini import _problem

    assert doctest.testmod(_problem).failed == 0


def test_the_command(run_program: Any, tmp_path: Path) -> None:
    assert run_program("--version").strip() == f"signorini {signorini.__version__}"
    script = Path(sys.executable).with_name("signorini")
    made = subprocess.run([script, "check", EXAMPLES / "press.toml"], capture_output=True, text=True)
    assert made.returncode == 0 and "2382 nodes" in made.stdout
    run_program("solve", tmp_path / "nothing.toml", code=1)
    run_program("solve", code=2)
    run_program("solve", EXAMPLES / "press.toml", "--set", "solver.max_iterations=1", "--output", tmp_path / "out", code=3)


def test_one_version_everywhere() -> None:
    manifests = [(ROOT / path / "Cargo.toml").read_text(encoding="utf-8") for path in (".", "python")]
    versions = [next(line for line in text.splitlines() if line.startswith("version = ")) for text in manifests]
    assert versions[0] == versions[1] == f'version = "{signorini.__version__}"'


@pytest.mark.parametrize("example", sorted((ROOT / "python" / "examples").glob("*.py")), ids=lambda path: path.stem)
def test_examples(example: Path, tmp_path: Path) -> None:
    """Each runs to its end, where it checks its result."""
    command = [sys.executable, str(example)]
    made = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=600)
    assert made.returncode == 0, made.stderr
    assert made.stdout
