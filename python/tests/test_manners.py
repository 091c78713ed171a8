"""Manners: other threads, Ctrl-C, callbacks, the log, warnings, pickles, memory."""

from __future__ import annotations

import copy
import logging
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
import warnings
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES, points_in_space
from test_models import block as model_block

import signorini


def test_other_threads_work_meanwhile() -> None:
    """A thread of Python's counts while a solve goes on, which it could not do if the solve kept the interpreter."""
    counted, done = [0], threading.Event()

    def count() -> None:
        while not done.is_set():
            counted[0] += 1
            time.sleep(0.001)

    mesh = signorini.rectangle([3, 1], [240, 80])
    model = model_block(mesh).traction("top", pressure=2e7)
    problem = model.build()
    thread = threading.Thread(target=count)
    thread.start()
    before = counted[0]
    problem.solve(backend="cpu", stiffness="pcg")
    during = counted[0] - before
    done.set()
    thread.join()
    assert during > 5


def test_callbacks_see_steps_and_stop(block: dict[str, Any]) -> None:
    seen: list[signorini.Step] = []
    solution = signorini.solve(**block, callback=seen.append)
    assert [step.iter for step in seen] == solution.history["iter"].tolist()
    assert [step.err for step in seen] == solution.history["err"].tolist()
    assert [step.slip for step in seen] == solution.history["slip"].tolist()
    assert seen[-1].separated + seen[-1].stick + seen[-1].slip >= solution.m
    with pytest.warns(signorini.NotConvergedWarning, match="interrupted"):
        stopped = signorini.solve(**block, callback=lambda step: step.iter < 2)
    assert stopped.status == "interrupted" and stopped.iterations == 2 and np.isfinite(stopped.u).all()
    with pytest.warns(signorini.NotConvergedWarning, match="interrupted"):
        assert signorini.solve(**block, callback=lambda step: np.float64(step.iter) < 2).iterations == 2
    for other in (None, 0, np.zeros(2)):
        assert signorini.solve(**block, callback=lambda step, other=other: other).converged


def test_exceptions_of_callbacks_come_out(block: dict[str, Any]) -> None:
    def fails(step: signorini.Step) -> None:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine") as caught:
        signorini.solve(**block, callback=fails)
    assert caught.value.solution.status == "interrupted"
    # And the problem continues as if nothing had happened.
    problem = signorini.Problem(**block)
    with pytest.raises(KeyError):
        problem.solve(callback=fails)
    assert problem.solve().converged

    class Closed(Exception):
        solution = property(lambda self: 1)

    def closed(step: object) -> None:
        raise Closed

    with pytest.raises(Closed):
        problem.solve(callback=closed)
    with pytest.raises(Closed):
        signorini.solve_delassus(np.eye(3), [-1.0, 3.0, 0.0], friction=0.5, callback=closed)


def test_callbacks_may_solve_other_problems_alone(block: dict[str, Any]) -> None:
    """The problem itself would wait for ever; of another thread it waits until the solve is done."""
    problem, other = signorini.Problem(**block), signorini.Problem(**block)
    with pytest.raises(signorini.SolveError, match="solve copy.copy.problem. there") as caught:
        problem.solve(callback=lambda step: problem.solve())
    assert caught.value.solution.status == "interrupted"
    with pytest.raises(signorini.SolveError, match="of the same problem"):
        problem.solve(callback=lambda step: other.solve(callback=lambda step: problem.solve()))
    expected = problem.solve(tolerance=1e-9).u
    found: list[Any] = []
    threads: list[threading.Thread] = []

    def within(step: signorini.Step) -> None:
        if step.iter == 1:
            found.extend([one.solve(tolerance=1e-9).u for one in (other, copy.copy(problem))])
            threads.append(threading.Thread(target=lambda: found.append(problem.solve(tolerance=1e-9).u)))
            threads[0].start()

    found.append(problem.solve(tolerance=1e-9, callback=within).u)
    threads[0].join()
    assert len(found) == 4
    for u in found:
        np.testing.assert_allclose(u, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_callbacks_run_on_the_calling_thread(block: dict[str, Any]) -> None:
    names = set()
    signorini.solve(**block, callback=lambda step: names.add(threading.current_thread().name))
    assert names == {threading.current_thread().name}


INTERRUPTED = """
import os, signal
import signorini

# Where tests run in the background of a shell, processes begin with Ctrl-C ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)

mesh = signorini.box([4, 1, 1], [24, 6, 6])
model = signorini.Model(mesh).material(young=2e11, poisson=0.3).support("left", x=0, y=0, z=0)
model.traction("top", pressure=2e7)
ground = {"half_space": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
model.contact("bottom", obstacle=ground, friction={"coulomb": 0.3})
# Many load steps: far more than can be made before the signal.
model.steps([1.0 + 0.001 * k for k in range(500)])
problem = model.build()
seen = []

def step(step):
    seen.append(step)
    if len(seen) == 3:
        os.kill(os.getpid(), signal.SIGINT)

try:
    problem.solve(backend="cpu", stiffness="pcg", callback=step)
except KeyboardInterrupt as error:
    assert error.solution.status == "interrupted", error.solution
    assert error.solution.history.size >= 2 and abs(error.solution.u).max() > 0
    print("interrupted", len(error.solution.steps))
"""


def test_ctrl_c_in_the_middle_of_a_solve() -> None:
    made = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=120)
    assert made.returncode == 0 and made.stdout.startswith("interrupted"), made.stderr


SILENT = """
import signal
import signorini
signal.signal(signal.SIGINT, signal.default_int_handler)
mesh = signorini.rectangle([3, 1], [120, 40])
model = signorini.Model(mesh).material(young=2e11, poisson=0.3).support("left", x=0, y=0).traction("top", pressure=2e7)
model.contact("bottom", obstacle={"half_plane": {"point": [0, 0], "normal": [0, 1]}}, friction={"coulomb": 0.3})
problem = model.steps([1.0 + 0.001 * k for k in range(500)]).build()
print("ready", flush=True)
try:
    problem.solve(backend="cpu", stiffness="pcg")
except KeyboardInterrupt as error:
    print("interrupted", error.solution is None or error.solution.status)
"""


def test_ctrl_c_without_a_callback() -> None:
    """The signal comes from outside, and nothing of Python's runs meanwhile."""
    process = subprocess.Popen([sys.executable, "-c", SILENT], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None and process.stdout.readline().strip() == "ready"
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    rest, _ = process.communicate(timeout=120)
    assert process.returncode == 0 and rest.strip() == "interrupted interrupted"


def test_the_log(block: dict[str, Any], caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, logger="signorini"):
        signorini.solve(**block)
    texts = [record.getMessage() for record in caplog.records if record.name == "signorini"]
    assert any(text.startswith("step 1: err ") for text in texts) and "load step 1: converged" in texts
    caplog.clear()
    with caplog.at_level(logging.INFO, logger="signorini"):
        model_block(friction={"coulomb": 0.3}).traction("top", pressure=2e7).steps([0.5, 1]).solve()
    texts = [record.getMessage() for record in caplog.records]
    assert "load step 2 of 2, factor 1" in texts and not any(text.startswith("step ") for text in texts)


def test_the_bar(block: dict[str, Any], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    signorini.solve(**block, progress=True)
    text = capsys.readouterr().err
    assert "█" * 30 in text and text.endswith("\n")
    signorini.solve(**block)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr(sys, "stderr", None)
    assert signorini.solve(**block, progress=True).converged


def test_no_convergence_is_a_warning_or_with_check_an_error(block: dict[str, Any]) -> None:
    with pytest.warns(signorini.NotConvergedWarning, match="not converged: iteration_limit") as record:
        solution = signorini.solve(**block, max_iterations=1)
    assert not solution.converged and record[0].filename.endswith("_problem.py") is False or len(record) == 1
    with pytest.raises(signorini.SolveError, match="iteration_limit") as caught:
        signorini.solve(**block, max_iterations=1, check=True)
    assert caught.value.solution.status == "iteration_limit"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert signorini.solve(**block, check=True).converged


def test_bodies_that_are_not_held_are_named() -> None:
    model = signorini.Model(signorini.rectangle([1, 1], [2, 2])).material(young=1e9, poisson=0.3)
    model.traction("left", x=1e6).traction("top", y=-1e6)
    model.contact("bottom", obstacle={"half_plane": {"point": [0, 0], "normal": [0, 1]}})
    with pytest.warns(signorini.NotConvergedWarning, match="not_held .the body with region"):
        assert model.solve().status == "not_held"


def test_a_time_limit(block: dict[str, Any]) -> None:
    with pytest.warns(signorini.NotConvergedWarning, match="time_limit"):
        assert signorini.solve(**block, time_limit=0.0).status == "time_limit"


def test_pickles() -> None:
    solution = model_block(friction={"coulomb": 0.3}).traction("top", pressure=2e7).steps([0.5, 1]).solve()
    copy = pickle.loads(pickle.dumps(solution))
    for one, other in zip(copy.steps, solution.steps):
        np.testing.assert_array_equal(one.u, other.u)
        np.testing.assert_array_equal(one.stress, other.stress)
        np.testing.assert_array_equal(one.contacts["bottom"].pressure, other.contacts["bottom"].pressure)
    assert repr(copy) == repr(solution) and copy._repr_html_().startswith("&lt;Solution")
    assert len(copy.to_meshio().points) == len(solution.u)
    with pytest.raises(ValueError, match="was pickled"):
        copy.write("nowhere")
    matrices = signorini.solve(**points_in_space())
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(matrices)).lambda_tangential, matrices.lambda_tangential)
    with pytest.raises(AttributeError, match="no mesh"):
        matrices.to_meshio()
    with pytest.raises(AttributeError, match="no mesh"):
        matrices.stress  # noqa: B018


def test_steps_have_their_own_places() -> None:
    parts = {"A": signorini.rectangle([2, 1], [3, 1]), "B": signorini.rectangle([1, 0.5], [2, 1], origin=[0.1, 1.0])}
    model = signorini.Model(signorini.Mesh.join(parts)).material(young=1e4, poisson=0.3).analysis(geometry="large")
    model.support("A-bottom", x=0, y=0).support("B-top", y=-0.01).support("B-top", x=1.5, factors=[0, 0.3, 1])
    solution = model.contact("A-top", against="B-bottom").steps(factors=[1, 1, 1]).solve()
    copy = pickle.loads(pickle.dumps(solution))
    places = [len(step.lambda_normal) for step in copy.steps]
    assert len(set(places)) > 1
    for count, step in zip(places, copy.steps):
        contact = step.contacts["A-top"]
        assert step.slip.shape == step.lambda_tangential.shape == (count, 1) and len(contact.pressure) == count
        np.testing.assert_allclose(np.sum(step.lambda_normal), np.linalg.norm(contact.force), rtol=1e-2)


def test_problems_are_pickled(block: dict[str, Any]) -> None:
    """Problems of all kinds work on in another process, to the last bit."""
    springs = {"K": [[2.0, -1.0], [-1.0, 1.0]], "f": [0.0, 1.0], "normal": [[0.0, 1.0]], "tangential": [[1.0, 0.0]]}
    of_matrices: list[dict[str, Any]] = [
        block,
        points_in_space(),
        {**springs, "gap": 1.0, "slip_bound": 0.1, "compliance": [0.1, 0.2], "slip_origin": [0.05], "areas": [2.0]},
        {**springs, "gap": -0.5, "friction": 0.3, "interference": True},
        {**springs, "slip_bound": 0.1, "tied": [True]},
        {**springs, "normal": [[0.0, 1.0], [0.0, 2.0]], "tangential": None, "dependent_rows": True},
    ]
    problems = [signorini.Problem(**{"friction": None, **one}) for one in of_matrices]
    problems += [model_block().traction("top", pressure=2e7).build(), signorini.Case.read(EXAMPLES / "press.toml")]
    for problem in problems:
        copy = pickle.loads(pickle.dumps(problem))
        assert type(copy) is type(problem) and repr(copy) == repr(problem)
        np.testing.assert_array_equal(copy.solve().u, problem.solve().u)
        np.testing.assert_array_equal(copy.solve().lambda_normal, problem.solve().lambda_normal)


def test_arrays_of_solutions_are_read_only() -> None:
    solution = model_block().traction("top", pressure=2e7).solve()
    for holder in (solution, pickle.loads(pickle.dumps(solution))):
        contact = next(iter(holder.contacts.values()))
        for array in (holder.u, holder.lambda_normal, holder.stress, holder.state, contact.pressure, contact.points):
            with pytest.raises(ValueError, match="read-only"):
                array *= 1000
        millimetres = 1000 * holder.u
        millimetres *= 2


def test_masked_arrays_are_refused(block: dict[str, Any]) -> None:
    for name in ("f", "gap"):
        masked = np.ma.masked_less(block[name], -1e300)
        with pytest.raises(ValueError, match=f"{name}: masked arrays have entries without a value"):
            signorini.solve(**{**block, name: masked})
    with pytest.raises(ValueError, match="cells: masked arrays"):
        signorini.Mesh([[0, 0], [1, 0], [0, 1]], {"triangle": np.ma.array([[0, 1, 2]])})


FORK = """
import multiprocessing, sys
import numpy as np
import signorini

def one(load):
    return signorini.solve([[2, -1], [-1, 1]], [0, load], normal=[[0, 1]], gap=1.0).u.tolist()

def again(load):
    return problem.solve(f=[0, load]).u.tolist()

def on_gpu(load):
    try:
        return signorini.solve([[2, -1], [-1, 1]], [0, load], normal=[[0, 1]], gap=1.0, backend="gpu").status
    except signorini.SolveError as error:
        return str(error)

problem = signorini.Problem([[2, -1], [-1, 1]], [0, 1], normal=[[0, 1]], gap=1.0)
if __name__ == "__main__":
    # A mesh large enough for all threads to have been at work.
    model = signorini.Model(signorini.rectangle([3, 1], [60, 20])).material(young=1e9, poisson=0.3).support("left", x=0, y=0)
    model.traction("top", pressure=1e6).solve()
    expected = [one(1.0), again(2.0)]
    with multiprocessing.get_context("fork").Pool(2) as pool:
        assert pool.map_async(one, [1.0] * 4).get(timeout=60) == [expected[0]] * 4
        assert pool.map_async(again, [2.0] * 4).get(timeout=60) == [expected[1]] * 4
        assert pool.apply_async(model.solve).get(timeout=60).converged
        print(pool.apply_async(on_gpu, [1.0]).get(timeout=60))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on this system")
def test_children_of_a_fork_work(tmp_path: Any) -> None:
    """They have no threads of the parent's, and no GPU."""
    script = tmp_path / "fork.py"
    script.write_text(FORK)
    made = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=240)
    assert made.returncode == 0, made.stderr
    assert "no GPU can be used after a fork" in made.stdout and '"spawn"' in made.stdout


def test_pages_for_notebooks(block: dict[str, Any]) -> None:
    for solution in (model_block().traction("top", pressure=2e7).solve(), signorini.solve(**block)):
        page = solution._repr_html_()
        assert page.startswith("<iframe") and "&lt;svg" in page


def test_reprs_are_short() -> None:
    solution = model_block().traction("top", pressure=2e7).solve()
    things = [solution, solution.steps[0], solution.contacts["bottom"], model_block(), model_block().mesh]
    assert all(len(repr(thing)) < 300 and "array" not in repr(thing) for thing in things)


def test_results_are_written(tmp_path: Any) -> None:
    solution = signorini.Case.read(EXAMPLES / "press.toml").solve()
    files = {path.name for path in solution.write(tmp_path / "new", plots=True)}
    assert {"report.html", "report.json", "solution.vtu", "contact.csv"} <= files
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="cannot write"):
        solution.write(tmp_path / "file" / "below")


def resident() -> int:
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * 4096


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="/proc")
def test_memory_does_not_grow(block: dict[str, Any]) -> None:
    """Over 1000 solves, each with its own factor, a callback and a result that is read."""

    def once() -> None:
        solution = signorini.solve(**block, callback=lambda step: None)
        _ = solution.u, solution.state, solution.history

    [once() for _ in range(200)]
    before = resident()
    [once() for _ in range(1000)]
    # A leak of a single copy of K, some 40 kB, would be 40 MB.
    assert resident() - before < 8e6


def test_memory_of_models_does_not_grow() -> None:
    def once() -> None:
        solution = model_block().traction("top", pressure=lambda x: 1e7 * x[:, 0]).solve()
        _ = solution.contacts, solution.stress, solution._repr_html_

    [once() for _ in range(30)]
    before = resident()
    [once() for _ in range(150)]
    assert resident() - before < 8e6
