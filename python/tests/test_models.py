"""Models and cases: meshes from everywhere, quantities of all kinds, results against the command line, errors."""

from __future__ import annotations

import csv
import json
import pickle
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import pytest
import skfem
from conftest import EXAMPLES

import signorini

FLOOR = {"half_plane": {"point": [0, 0], "normal": [0, 1]}}


def block(mesh: signorini.Mesh | None = None, **contact: Any) -> signorini.Model:
    """A block, 3 × 1, clamped on the left, on a floor."""
    model = signorini.Model(mesh or signorini.rectangle([3, 1], [12, 4]), "block")
    model.material(young=2.1e11, poisson=0.3).support("left", x=0, y=0)
    return model.contact("bottom", **{"obstacle": FLOOR, "friction": {"tresca": 3e6}, **contact})


def pressed(**traction: Any) -> signorini.Solution:
    return block().traction("top", **traction).solve()


def test_forces_balance() -> None:
    solution = pressed(pressure=2e7)
    contact = solution.contacts["bottom"]
    load = np.array([0.0, -6e7])
    forces = contact.force + solution.supports[0].force + load
    np.testing.assert_allclose(forces, 0.0, atol=1e-4 * 6e7)
    np.testing.assert_allclose(contact.normal_force, np.sum(contact.pressure * contact.areas), rtol=1e-9)
    assert solution.u.shape == (13 * 5, 2) and solution.stress.shape == (65, 6)
    assert solution.stress_in_elements.shape == (48, 6)
    k = len(contact.pressure)
    assert contact.points.shape == contact.normals.shape == contact.traction_vectors.shape == (k, 2)
    assert contact.traction.shape == contact.slip.shape == (k, 1) and contact.tangents.shape == (k, 1, 2)
    assert set(contact.state) <= {"separated", "stick", "slip"}
    assert "block" == solution.report["title"] and "tresca" in contact.friction.lower()


@pytest.mark.parametrize("key", ["pressure", "y"])
def test_quantities_agree(key: str) -> None:
    """A linear load as an expression, as a function, as values at nodes: shape functions interpolate it exactly."""
    sign = 1.0 if key == "pressure" else -1.0
    mesh = block().mesh
    linear = lambda x: sign * 1e7 * (1.0 + x[:, 0])  # noqa: E731
    given = [f"{sign} * 1e7 * (1 + x)", linear, linear(mesh.points), linear(mesh.points).tolist()]
    found = [pressed(**{key: value}) for value in given]
    for other in found[1:]:
        np.testing.assert_allclose(other.u, found[0].u, atol=1e-9 * np.abs(found[0].u).max())
    np.testing.assert_array_equal(found[1].u, found[2].u)
    np.testing.assert_array_equal(found[1].u, found[3].u)


def test_functions_are_called_once_with_all_points() -> None:
    calls = []

    def gap(points: Any) -> float:
        calls.append(points.shape)
        return 1e-5

    one = block(gap=gap).traction("top", pressure=2e7).solve()
    other = block(gap=1e-5).traction("top", pressure=2e7).solve()
    assert calls == [(65, 2)]
    np.testing.assert_array_equal(one.u, other.u)


def test_quantities_everywhere() -> None:
    """Supports, body forces and laws of friction, in space and on elements of second order, against expressions."""
    for order in (1, 2):
        mesh = signorini.box([2, 1, 1], [4, 2, 2], order=order, shape="tetrahedron")
        found = []
        for as_array in (False, True):

            def say(text: str, function: Any) -> Any:
                return function(mesh.points) if as_array else text

            model = signorini.Model(mesh).material(young=1e9, poisson=0.3)
            model.support("left", x=say("1e-4 * y", lambda x: 1e-4 * x[:, 1]), y=0, z=0)
            model.body_force(z=say("-1e5 * (1 + x)", lambda x: -1e5 * (1 + x[:, 0])))
            model.traction("top", z=say("-1e5 * (1 + x + y)", lambda x: -1e5 * (1 + x[:, 0] + x[:, 1])))
            law = say("0.1 + 0.1 * x", lambda x: 0.1 + 0.1 * x[:, 0])
            gap = say("1e-5 * (x + y)", lambda x: 1e-5 * (x[:, 0] + x[:, 1]))
            ground = {"half_space": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
            model.contact("bottom", obstacle=ground, friction={"coulomb": law}, gap=gap)
            found.append(model.solve(tolerance=1e-9))
        scale = np.abs(found[0].u).max()
        np.testing.assert_allclose(found[1].u, found[0].u, atol=1e-6 * scale)
        assert found[0].contacts["bottom"].normal_force > 1e5


def test_values_of_bodies_that_touch_are_their_own() -> None:
    """Two blocks, each with its own value at coincident nodes; the mortar side has its own friction."""
    low, high = (signorini.rectangle([2, 1], [8, 4]) for _ in range(2))
    mesh = signorini.Mesh.join({"low": low, "high": high}, shift={"high": [0, 1]})
    upper = np.arange(len(mesh.points)) >= len(low.points)

    def solved(friction: Any) -> signorini.Solution:
        model = signorini.Model(mesh).material(young=1e9, poisson=0.3).support("low-bottom", x=0, y=0)
        model.traction("high-top", pressure=1e6, x=1e5).support("high-left", x=0)
        return model.contact("high-bottom", "low-top", friction={"coulomb": friction}).solve(tolerance=1e-9)

    mixed = solved(np.where(upper, 0.3, 99.0))
    plain = solved(0.3)
    np.testing.assert_allclose(mixed.u, plain.u, atol=1e-6 * np.abs(plain.u).max())
    assert "values at the nodes" in mixed.contacts["high-bottom"].friction


def test_temperatures() -> None:
    """Values at nodes, as another program computes them, and the expression that they are values of."""
    mesh = signorini.rectangle([3, 1], [12, 4])
    found = []
    for value in ("20 * x", 20 * mesh.points[:, 0]):
        model = signorini.Model(mesh).material(young=2.1e11, poisson=0.3, expansion=1.2e-5).support("left", x=0, y=0)
        found.append(model.temperature(value).contact("bottom", obstacle=FLOOR, friction={"coulomb": 0.3}).solve(tolerance=1e-9))
    assert np.abs(found[0].u).max() > 1e-4
    np.testing.assert_allclose(found[1].u, found[0].u, atol=1e-7 * np.abs(found[0].u).max())


def test_stresses_know_temperatures() -> None:
    """A bar that is free to grow has none; held between walls, −E α ΔT."""
    mesh = signorini.rectangle([3, 1], [6, 2])
    found = []
    for held in ("left", ["left", "right"]):
        model = signorini.Model(mesh).material(young=2e11, poisson=0.0, expansion=1e-5).temperature(50)
        model.support(held, x=0).support("bottom", y=0).contact("top", obstacle={"half_plane": {"point": [0, 9], "normal": [0, -1]}})
        found.append(model.solve().stress[:, 0])
    np.testing.assert_allclose(found[0], 0.0, atol=1.0)
    np.testing.assert_allclose(found[1], -1e8, rtol=1e-9)


def test_large_displacements() -> None:
    """Two blocks that press each other turn by 90°, with their forces; files and results are those of where they are."""
    parts = {"low": signorini.rectangle([1, 0.5], [8, 4]), "up": signorini.rectangle([0.8, 0.5], [5, 3])}
    mesh = signorini.Mesh.join(parts, shift={"up": [0.1, 0.46]})
    model = signorini.Model(mesh, "turned").material(young=1, poisson=0.3).analysis(geometry="large").steps([0, 0.5, 1])
    for side in ("low-bottom", "up-top"):
        model.support(side, rotate={"point": [0.5, 0.5], "angle": 90})
    model.contact("up-bottom", "low-top", overlap="interference", friction={"coulomb": 0.3})
    solution = model.solve(tolerance=1e-9)
    assert solution.status == "converged"
    forces = [step.contacts["up-bottom"].force for step in solution.steps]
    assert forces[0][1] > 0.03
    np.testing.assert_allclose(forces[2], [-forces[0][1], forces[0][0]], atol=1e-7)
    top = mesh.boundaries["up-top"].ravel()
    points, u = mesh.points[top] - 0.5, solution.u[top]
    np.testing.assert_allclose(points + u, np.stack([-points[:, 1], points[:, 0]], axis=1), atol=1e-9)
    # Stresses turn, contact places are displaced.
    pressures = [step.contacts["up-bottom"].pressure for step in solution.steps]
    np.testing.assert_allclose(pressures[2], pressures[0], atol=1e-6)
    np.testing.assert_allclose(solution.steps[2].stress[:, 0], solution.steps[0].stress[:, 1], atol=1e-6)
    places = [step.contacts["up-bottom"].points - 0.5 for step in solution.steps]
    np.testing.assert_allclose(places[2], np.stack([-places[0][:, 1], places[0][:, 0]], axis=1), atol=1e-6)
    with pytest.raises(signorini.SolveError, match="leave out all that changes"):
        model.build().solve(friction=0.1)


def test_names_ties_and_forces() -> None:
    """A block of two tied halves is the block; named parts are listed by their names."""
    halves = {"low": signorini.rectangle([2, 0.5], [8, 2]), "high": signorini.rectangle([2, 0.5], [8, 2])}
    mesh = signorini.Mesh.join(halves, shift={"high": [0, 0.5]})
    found = []
    for parts in (mesh, signorini.rectangle([2, 1], [8, 4])):
        tied = parts is mesh
        model = signorini.Model(parts).material(young=1e9, poisson=0.3)
        model.support("low-left" if tied else "left", x=0, name="wall")
        if tied:
            model.support("high-left", x=0).tie("high-bottom", "low-top")
        model.force(point=[2, 1], x=1e4, y=-1e4).traction("high-top" if tied else "top", pressure=1e5)
        model.contact("low-bottom" if tied else "bottom", obstacle=FLOOR, friction={"coulomb": 0.3}, name="floor")
        found.append(model.solve(tolerance=1e-9))
    assert set(found[1].contacts) == {"floor"} and "floor" in found[0].contacts
    one, other = (solution.contacts["floor"].force for solution in found)
    np.testing.assert_allclose(one, other, rtol=1e-6)
    assert np.unique(found[0].contacts["high-bottom"].state).tolist() == ["tied"]


def test_preload() -> None:
    """A bar between walls: its ends overlap by F l/(E A), and a wall that gives way by δ adds E A δ/l to the tension once it is locked."""
    mesh = signorini.rectangle([4, 1], [5, 2])
    force, give, stiffness = 3e5, 1e-4, 2e9 / 4

    def solved(**keywords: Any) -> list[signorini.LoadStep]:
        model = signorini.Model(mesh).material(young=2e9, poisson=0).support("left", x=0, y=0).support("right", x=give, factors=[0, 1])
        model.preload(plane={"point": [1.7, 0.5], "normal": [2, 0]}, name="bolt", **keywords)
        return model.steps([1, 1]).solve(tolerance=1e-9).steps

    cases: list[tuple[dict[str, Any], list[float]]] = [
        ({"force": force, "lock": True}, [force, force + stiffness * give]),
        ({"force": force, "region": "body"}, [force, force]),
        ({"shortening": force / stiffness, "factors": [1, 2]}, [force, 2 * force + stiffness * give]),
    ]
    for keywords, tensions in cases:
        steps = solved(**keywords)
        for step, tension, wall in zip(steps, tensions, (0.0, give)):
            (bolt,) = step.report["contacts"]
            np.testing.assert_allclose([bolt["tension"], bolt["shortening"]], [tension, tension / stiffness - wall], rtol=1e-8)
            np.testing.assert_allclose(step.contacts["bolt"].force, [tension, 0], atol=1e-8 * tension)
            np.testing.assert_allclose(step.stress[:, 0], tension, rtol=1e-8)
        # The three nodes of the section are there twice.
        assert len(steps[0].u) == len(mesh.points) + 3


@pytest.mark.parametrize("kind", ["rigid", "distributing"])
def test_coupling(kind: str) -> None:
    """A moment M bends a beam to an arc: its end turns by θ = M l/(E I) and goes up by θ l/2. A stated θ needs that moment."""
    mesh = signorini.rectangle([8, 1], [6, 2], order=2)
    moment = 1e4
    turn = moment * 8 / (2e9 * 0.5 / 12)
    for keywords in ({"moment": moment}, {"rz": turn}):
        model = signorini.Model(mesh).material(young=2e9, poisson=0).analysis(thickness=0.5)
        model.support("left", x=0).support(point=[0, 0.5], y=0)
        solution = model.coupling("right", point=[8, 0.5], kind=kind, name="end", **keywords).solve(tolerance=1e-9)
        (end,) = solution.last.report["contacts"]
        np.testing.assert_allclose(end["motion"], [0, 4 * turn, turn], atol=1e-8 * turn)
        np.testing.assert_allclose(solution.contacts["end"].moment, [moment], rtol=1e-8)
        np.testing.assert_allclose(solution.supports[0].moment, [-moment], rtol=1e-8)
        np.testing.assert_allclose(solution.u[mesh.boundaries["right"], 1], 4 * turn, rtol=1e-8)
    # Nodes do not follow along y: the coupling does not determine that motion.
    model = signorini.Model(mesh).material(young=2e9, poisson=0).support("left", x=0, y=0)
    solution = model.coupling("right", point=[8, 0.5], free="y", force=[1e4, 0]).solve(tolerance=1e-9)
    assert solution.last.report["contacts"][0]["motion"][1] is None


def test_an_obstacle_moves_with_a_point() -> None:
    """A rigid plate pressed off the middle of a block: it goes down by F h/(E A) and turns by M h/(E I). That motion takes that force."""
    mesh = signorini.rectangle([2, 1], [4, 2], order=2)
    force, off, young = 4e5, 0.1, 2e9
    turn = -force * off / (young * 8 / 12)
    motion = [0.0, -force / (2 * young) + turn * off, turn]
    for keywords in ({"force": [0, -force]}, {"y": motion[1], "rz": turn}):
        model = signorini.Model(mesh).material(young=young, poisson=0).support("bottom", y=0).support(point=[1, 0], x=0)
        model.contact("top", obstacle={"half_plane": {"point": [0, 1], "normal": [0, -1]}}, name="plate")
        model.coupling(contacts="plate", point=[1 + off, 1], x=0, name="hand", **keywords)
        solution = model.solve(tolerance=1e-10)
        hand, plate = solution.contacts["hand"], solution.contacts["plate"]
        assert hand.motion is not None
        np.testing.assert_allclose(hand.motion, motion, atol=1e-7 * abs(motion[1]))
        np.testing.assert_allclose(hand.force, [0, -force], atol=1e-7 * force)
        np.testing.assert_allclose(hand.moment, 0, atol=1e-7 * force)
        np.testing.assert_allclose(plate.force, [0, -force], atol=1e-7 * force)
        # The point, and a place along each axis.
        n = len(mesh.points)
        assert solution.u.shape == (n + 3, 2)
        np.testing.assert_allclose(solution.u[n], motion[:2], atol=1e-7 * abs(motion[1]))


def test_supports_of_some_load_steps() -> None:
    """A bar under F grows by l F/(E A). A clamp takes F over, and opens; a stated length is kept in some steps, with F of its own in them."""
    mesh = signorini.rectangle([2, 1], [4, 2])
    force, young = 4e6, 2e9
    long = 2 * force / young
    cases: list[tuple[dict[str, Any], list[float], list[float], list[float]]] = [
        ({"x": 0, "active": [0, 1, 1, 0], "lock": [0, 1, 1, 0]}, [1, 1, 0, 0], [1, 1, 1, 0], [0, 0, 1, 0]),
        ({"x": 2 * long, "active": [1, 0, 1, 1]}, [1, 1, 1, 0], [2, 1, 2, 2], [1, 0, 1, 2]),
    ]
    for keywords, factors, lengths, taken in cases:
        model = signorini.Model(mesh).material(young=young, poisson=0).support("left", x=0).support(point=[0, 0], y=0)
        model.support("right", name="end", **keywords).traction("right", x=force, factors=factors)
        steps = model.steps([1, 1, 1, 1]).solve(tolerance=1e-10).steps
        assert len(steps) == 4
        for step, length, carried in zip(steps, lengths, taken):
            np.testing.assert_allclose(step.u[:, 0], length * long * mesh.points[:, 0] / 2, atol=1e-8 * long)
            assert [support.name for support in step.supports][2] == "end"
            np.testing.assert_allclose(step.supports[2].force, [carried * force, 0], atol=1e-7 * force)
            assert step.contacts == {}


def test_equations() -> None:
    """A periodic cell in plane stress: opposite sides differ by strain times length, and the multipliers pull with E ε."""
    cells = signorini.rectangle([2, 1], [4, 2])
    sides = {"low": np.flatnonzero(cells.points[:, 0] == 0), "high": np.flatnonzero(cells.points[:, 0] == 2)}
    mesh = signorini.Mesh(cells.points, cells.cells, node_sets=sides)
    strain, young = 1e-3, 2e9
    model = signorini.Model(mesh).material(young=young, poisson=0.3).analysis(plane="plane_stress").support(point=[0, 0], x=0, y=0)
    for axis, value in (("x", 2 * strain), ("y", None)):
        terms = [{"nodes": "high", axis: 1}, {"nodes": "low", axis: -1}]
        model.equation(terms, value=value, factors=[0.5, 1], name=f"along {axis}")
    for step, part in zip(model.steps([1, 1]).solve(tolerance=1e-10).steps, (0.5, 1)):
        expected = part * strain * mesh.points * [1, -0.3]
        np.testing.assert_allclose(step.u, expected, atol=1e-8 * strain)
        np.testing.assert_allclose(step.stress[:, 0], part * young * strain, rtol=1e-7)
        np.testing.assert_allclose(step.contacts["along x"].normal_force, -part * young * strain, rtol=1e-7)
        np.testing.assert_allclose(step.supports[0].force, 0, atol=1e-7 * young * strain)
    # Between two nodes, along different axes.
    model = block().traction("top", pressure=2e7)
    model.equation([{"point": [3, 1], "y": 1}, {"point": [0.5, 1], "x": 2}], value=1e-5)
    solution = model.solve(tolerance=1e-10)
    at = [int(np.argmin(np.abs(model.mesh.points - x).sum(axis=1))) for x in ([3, 1], [0.5, 1])]
    np.testing.assert_allclose(solution.u[at[0], 1] + 2 * solution.u[at[1], 0], 1e-5, rtol=1e-6)


def test_infinite_gaps_and_bounds() -> None:
    """No obstacle where a gap is infinite, no slip under an infinite bound; an infinite traction is refused."""
    far = [block(gap=lambda x, far=far: np.where(x[:, 0] > 1.6, far, 0.0)).traction("top", pressure=2e7).solve() for far in (1e3, np.inf)]
    np.testing.assert_allclose(far[1].u, far[0].u, atol=1e-12 * np.abs(far[0].u).max())
    assert np.count_nonzero(far[1].contacts["bottom"].pressure) == np.count_nonzero(far[0].contacts["bottom"].pressure) > 0
    rough = block(friction={"tresca": np.inf}).traction("top", pressure=2e7, x=3e6).solve()
    contact = rough.contacts["bottom"]
    assert np.abs(contact.slip).max() < 1e-4 * np.abs(rough.u).max() and "slip" not in contact.state
    with pytest.raises(signorini.ModelError, match="inf is not a finite number"):
        block().traction("top", pressure=np.inf)


def test_wear_over_cycles() -> None:
    """A block under a pressure rubs to and fro on a floor: coefficient times force times slip."""
    model = signorini.Model(signorini.rectangle([2, 1], [8, 4])).material(young=2e11, poisson=0.3)
    model.support("top", x=1e-3, factors=[1, 0, -1, 0]).traction("top", pressure=1e6)
    model.contact("bottom", obstacle=FLOOR, wear={"coefficient": 1e-14})
    solution = model.steps([1, 1, 1, 1], cycles=200, jump=0.1).solve()
    last = solution.steps[-1]
    assert last.cycle == 200 and len(solution.steps) < 4 * 20
    contact = last.contacts["bottom"]
    volume = np.sum(contact.wear * contact.areas)
    np.testing.assert_allclose(volume, 1e-14 * 2e6 * 200 * 4e-3, rtol=1e-2)
    np.testing.assert_allclose(last.report["contacts"][0]["wear_volume"], volume)
    np.testing.assert_allclose(contact.gap, 0, atol=1e-12)
    assert not np.any(pressed(pressure=2e7).contacts["bottom"].wear)
    with pytest.raises(signorini.ModelError, match="at least one cycle"):
        model.steps([1, 1, 1, 1], cycles=0).build()


def test_load_steps() -> None:
    model = block(friction={"coulomb": 0.3}).traction("top", pressure=2e7).support("right", x=1e-4, factors=[0, 1, -1])
    solution = model.steps([1, 1, 1]).solve()
    assert [step.status for step in solution.steps] == ["converged"] * 3
    assert solution.u is solution.steps[2].u
    ends = [step.contacts["bottom"].slip.mean() for step in solution.steps]
    assert ends[1] > ends[0] > ends[2] or ends[1] < ends[0] < ends[2]
    assert solution.steps[1].contacts["bottom"].slipping_work > 0


@pytest.mark.parametrize("large", [False, True])
def test_sliding_distance_and_work(large: bool, tmp_path: Path) -> None:
    """A stiff block is pushed by 0.01 and back by twice as much, against a friction of 0.2 times 1000 Pa."""
    model = signorini.Model(signorini.rectangle([2, 1], [8, 4])).material(young=1e11, poisson=0)
    model.support("top", x=0.01, factors=[0, 1, -1, -1]).traction("top", pressure=1000)
    model.contact("bottom", obstacle=FLOOR, friction={"coulomb": 0.2}, friction_factors=[1, 1, 1, 0])
    if large:
        model.analysis(geometry="large")
    model.steps([1, 1, 1, 1]).solve().write(tmp_path)
    # Without friction in the last step the sums remain.
    for step, distance in ((2, 0.01), (3, 0.03), (4, 0.03)):
        grid = meshio.read(tmp_path / f"solution-{step:03}.vtu")
        below = np.isclose(grid.points[:, 1], 0)
        np.testing.assert_allclose(grid.point_data["sliding_distance"][below], distance, rtol=1e-4)
        # The push is a couple with friction: on average.
        work = grid.point_data["friction_work"][below].ravel()[np.argsort(grid.points[below, 0])]
        mean = (work.sum() - (work[0] + work[-1]) / 2) / 8
        np.testing.assert_allclose(mean, 200 * distance, rtol=1e-3)
        assert not grid.point_data["sliding_distance"][~below].any()


def test_friction_of_a_model_may_change() -> None:
    problem = block(friction={"coulomb": 0.1}).traction("top", pressure=2e7, x=1e6).build()
    assert problem.contacts == ["bottom"] and "m = 12" in repr(problem)
    for friction in (0.4, {"bottom": 0.4}, np.full(problem.m, 0.4)):
        found = problem.solve(friction=friction, tolerance=1e-9)
        alone = block(friction={"coulomb": 0.4}).traction("top", pressure=2e7, x=1e6).solve(tolerance=1e-9)
        np.testing.assert_allclose(found.u, alone.u, atol=1e-6 * np.abs(alone.u).max())
        assert "as given" in found.contacts["bottom"].friction
    same = problem.solve(friction=0.1)
    assert same.contacts["bottom"].friction == problem.solve().contacts["bottom"].friction == "Coulomb coefficient 0.1"
    for wrong, text in (({"top": 1.0}, "there is no contact 'top'"), ([0.1], "friction: expected 12 entries")):
        with pytest.raises(ValueError, match=text):
            problem.solve(friction=wrong)
    for name in ("f", "gap", "slip_bound", "slip_origin"):
        with pytest.raises(ValueError, match=f"{name}: a model states its own loads"):
            problem.solve(**{name: 1.0})


def stacked(lower: str, **upper: Any) -> signorini.Model:
    """Two blocks on a floor, one tied to the other, and a smooth wall."""
    part = signorini.rectangle([2, 1], [8, 4])
    mesh = signorini.Mesh.join({"low": part, "high": part}, shift={"high": [0, 1]})
    model = signorini.Model(mesh).material(young=1e9, poisson=0.3).traction("high-top", pressure=1e6, x=-2e4)
    model.tie("low-top", "high-bottom", name="tie").contact("low-bottom", obstacle=FLOOR, name=lower, friction={"coulomb": 0.1})
    wall = {"obstacle": {"half_plane": {"point": [0, 0], "normal": [1, 0]}}}
    return model.contact("low-left", **{**wall, **upper})


def test_friction_given_to_a_solve_is_that_of_contacts_alone(tmp_path: Path) -> None:
    """Ties stay ties, contacts that are not named keep their law, and files say the same."""
    model = stacked("floor", name="wall")
    plain = model.solve(tolerance=1e-9)
    problem = model.build()
    rough = problem.solve(friction={"floor": 0.4}, tolerance=1e-9)
    laws = {name: contact.friction for name, contact in rough.contacts.items()}
    assert laws == {"floor": "Coulomb, as given to the solve", "wall": "no friction", "tie": "tied"}
    rough.write(tmp_path)
    written = json.loads((tmp_path / "report.json").read_text())
    assert written["steps"] == rough.report["steps"]
    everywhere = problem.solve(friction=0.1, tolerance=1e-9)
    assert set(everywhere.contacts["tie"].state) == {"tied"} and everywhere.contacts["tie"].friction == "tied"
    np.testing.assert_allclose(everywhere.contacts["tie"].slip, 0.0, atol=1e-12)
    assert everywhere.contacts["wall"].friction == "Coulomb, as given to the solve"
    smooth = problem.solve(friction={"wall": 0.2, "floor": 0.0})
    assert smooth.contacts["floor"].friction.startswith("no friction")
    with pytest.raises(ValueError, match="friction: 'tie' is a tie or another joint"):
        problem.solve(friction={"tie": 0.3})
    np.testing.assert_allclose(problem.solve(tolerance=1e-9).u, plain.u, atol=1e-6 * np.abs(plain.u).max())


def test_contacts_of_one_name() -> None:
    """Friction by a name that two contacts have is an error, unless both are listed."""
    problem = stacked("base", name="base").build()
    assert problem.contacts[:2] == ["base", "base'"]
    with pytest.raises(ValueError, match="several contacts are called 'base': give each its own name, or list 'base', \"base'\""):
        problem.solve(friction={"base": 0.3})
    both = problem.solve(friction={"base": 0.3, "base'": 0.2})
    assert [both.contacts[name].friction for name in ("base", "base'")] == ["Coulomb, as given to the solve"] * 2


def test_arguments_of_models_are_copied() -> None:
    mesh = signorini.rectangle([2, 1], [4, 2])
    values, gravity, factors, point = np.full(len(mesh.points), 1e5), np.array([0.0, -9.81]), [1.0, 2.0], [2.0, 0.0]
    terms: list[dict[str, Any]] = [{"point": point, "x": 1}, {"point": [0.0, 0.0], "x": -1}]
    model = signorini.Model(mesh).traction("top", y=values).analysis(gravity=gravity).steps(factors).equation(terms)
    before = model.toml
    values[:], gravity[:], point[0], terms[1]["x"] = 0.0, 1.0, 1.0, 5
    factors.append(3.0)
    assert model.toml == before


def test_values_that_no_case_can_have() -> None:
    masked = np.ma.masked_greater(np.arange(65.0), 60.0)
    for value in (masked, lambda x: masked, [masked], masked[64]):
        with pytest.raises(ValueError, match="pressure: masked arrays have entries without a value"):
            block().traction("top", pressure=value)
    for value in (10**30, [10**30], np.array([2**63], dtype=np.uint64)):
        with pytest.raises(ValueError, match="pressure: [0-9]+ is too large for an integer; pass a float"):
            block().traction("top", pressure=value)
    for entries in ({"thickness": -1.0}, {"rotation": {"speed": np.inf}}):
        with pytest.raises(signorini.ModelError, match="|".join(entries)):
            block().analysis(**entries)


def test_states_are_those_of_their_load_step() -> None:
    """A tie and a support that do not act are no ties then, and nothing slips where a step has no friction."""
    model = stacked("floor", name="wall", active=[1, 0, 1])
    model._tables = [one for one in model._tables if one[0] != "tie"]
    model.tie("low-top", "high-bottom", name="tie", active=[0, 1, 1]).contact("low-top", "high-bottom", name="joint", active=[1, 0, 0])
    model.contact("high-left", obstacle={"half_plane": {"point": [0, 0], "normal": [1, 0]}}, friction={"coulomb": 0.2}, friction_factors=[0, 1, 0])
    model.support("high-right", x=0, active=[0, 1, 0])
    solution = model.steps([1, 1, 1]).solve()
    for step in solution.steps:
        counted = np.concatenate([contact.state for contact in step.contacts.values()])
        # Those of supports come last.
        assert list(step.state[: len(counted)]) == list(counted)
    assert [set(step.contacts["tie"].state) for step in solution.steps] == [{"separated"}, {"tied"}, {"tied"}]
    of_support = [set(step.state[len(counted) :]) for step in solution.steps]
    assert of_support == [{"separated"}, {"tied"}, {"separated"}]
    assert "slip" not in solution.steps[0].contacts["high-left"].state
    assert pickle.loads(pickle.dumps(solution)).state.tolist() == solution.state.tolist()


def same_as_files(solution: signorini.Solution, directory: Path) -> None:
    """The arrays are those of contact.csv, number by number."""
    with open(directory / "contact.csv", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    contacts = list(solution.contacts.values())
    d = contacts[0].points.shape[1]
    names = ("x", "y", "z")[:d]

    def written(columns: tuple[str, ...]) -> Any:
        return np.array([[float(row[next(k for k in row if k.split(" ")[0] == c)]) for c in columns] for row in rows])

    points = np.concatenate([contact.points for contact in contacts])
    order = []
    start = 0
    for contact in contacts:
        keys = [contact.points[:, c] for c in reversed(range(d))]
        order.append(start + np.lexsort(keys))
        start += len(contact.points)
    picked = np.concatenate(order)
    np.testing.assert_array_equal(points[picked], written(names))
    for name, columns in {
        "gap": ("gap",),
        "pressure": ("normal_pressure",),
        "traction": ("tangential_traction",) if d == 2 else ("tangential_traction_1", "tangential_traction_2"),
        "slip": ("slip",) if d == 2 else ("slip_1", "slip_2"),
    }.items():
        values = np.concatenate([getattr(contact, name).reshape(len(contact.points), -1) for contact in contacts])
        np.testing.assert_array_equal(values[picked], written(columns))
    states = np.concatenate([contact.state for contact in contacts])[picked]
    assert list(states) == [row["status"] for row in rows]


@pytest.mark.parametrize("case, settings", [("press", {}), ("ball", {}), ("dovetail", {"steps.factors": [1]})])
def test_cases_are_to_the_last_bit_those_of_the_command_line(case: str, settings: dict[str, Any], tmp_path: Path, run_program: Any) -> None:
    path = EXAMPLES / f"{case}.toml"
    solution = signorini.Case.read(path, settings).solve(backend="cpu")
    flags = [flag for key, value in settings.items() for flag in ("--set", f"{key}={json.dumps(value)}")]
    run_program("solve", path, "--backend", "cpu", "--output", tmp_path / "cli", *flags)
    same_as_files(solution, tmp_path / "cli")
    solution.write(tmp_path / "python")
    for name in ("contact.csv", "solution.vtu"):
        assert (tmp_path / "cli" / name).read_bytes() == (tmp_path / "python" / name).read_bytes()
    reports = [json.loads((tmp_path / place / "report.json").read_text()) for place in ("cli", "python")]
    for report in reports:
        # Seconds, memory, and the linear solve that the command line adds.
        for key in ("timings", "peak_memory_mib", "v_cycles_linear", "work_ratio"):
            del report[key]
    assert reports[0] == reports[1]


def test_matrices_are_to_the_last_bit_those_of_the_command_line(tmp_path: Path, run_program: Any, block: dict[str, Any]) -> None:
    run_program("solve", EXAMPLES / "matrices" / "block.toml", "--output", tmp_path, "--backend", "cpu")
    solution = signorini.solve(**block, backend="cpu")
    for name, values in {"u": solution.u, "lambda_normal": solution.lambda_normal, "lambda_tangential": solution.lambda_tangential}.items():
        lines = [line for line in (tmp_path / f"{name}.mtx").read_text().splitlines() if not line.startswith("%")]
        np.testing.assert_array_equal(np.array(lines[1:], dtype=float), values.ravel())


def test_settings_of_cases(tmp_path: Path) -> None:
    case = signorini.Case.read(EXAMPLES / "press.toml", {"solver.tolerance": 1e-3, "title": 'a "b" \\ c'})
    assert case.title == 'a "b" \\ c' and case.path == EXAMPLES / "press.toml" and case.dim == 2
    assert case.solve().products < case.solve(tolerance=1e-9).products
    with pytest.raises(FileNotFoundError, match="nothing.toml"):
        signorini.Case.read(tmp_path / "nothing.toml")
    with pytest.raises(signorini.ModelError, match="did you mean `tolerance`"):
        signorini.Case.read(EXAMPLES / "press.toml", {"solver.tolerence": 1e-3})
    (tmp_path / "wrong.toml").write_text("[mesh.rectangle]\nsize = [1, 1]\ncells = [2, 2]\n[[support]]\nboundary = 'left'\nz = 1\n")
    with pytest.raises(signorini.ModelError, match="wrong.toml, line 6: z has no meaning"):
        signorini.Case.read(tmp_path / "wrong.toml")
    with pytest.raises(TypeError):
        signorini.Case()


WRONG_TABLES = [
    ("material", {"young": -1.0, "poisson": 0.3}, "young is -1"),
    ("material", {"young": "stiff", "poisson": 0.3}, "material, young: invalid type"),
    ("material", {"young": 1e9}, "material: missing field `poisson`"),
    ("support", {"boundary": "left"}, "holds nothing"),
    ("support", {"boundary": "left", "x": "2 *"}, "support, x"),
    ("support", {"boundary": "left", "x": [1.0, np.nan]}, "support, x: value 1 of the list"),
    ("support", {"boundary": "left", "x": lambda points: points}, r"x: the function was given 65 points and returned an array of shape \(65, 2\)"),
    ("support", {"boundary": "left", "x": lambda points: points[:, 0].astype(str)}, "instead of real numbers"),
    ("support", {"boundary": "left", "z": 0.0}, "support, z: z has no meaning"),
    ("support", {"boundary": 3, "x": 0}, "support, boundary: .*expected the name of a boundary"),
    ("support", {"boundary": "left", "y": 1 + 2j}, "y: complex is not a type"),
    ("support", {"boundary": "left", "xx": 0}, "did you mean"),
    ("support", {"boundary": "left", "x": 0, "active": [1, 2]}, "active is 1 in load steps in which it acts"),
    ("support", {"boundary": "left", "x": 0, "lock": [1, 0]}, "the first step has 0"),
    ("traction", {"boundary": "top"}, "a traction needs"),
    ("traction", {"boundary": "top", "force": [1, 2, 3]}, "traction, force: expected 2 entries, found 3"),
    ("contact", {"boundary": "bottom"}, "either against"),
    ("contact", {"boundary": "bottom", "obstacle": {"sphere": {"center": [0, 0, 0], "radius": 1}}}, "not an obstacle in the plane"),
    ("contact", {"boundary": "bottom", "obstacle": FLOOR, "friction": {"coulomb": 0.3, "tresca": 1.0}}, "contact, friction"),
    ("contact", {"boundary": "bottom", "obstacle": FLOOR, "friction": 0.3}, "a friction law is written as"),
    ("preload", {"boundary": "left", "force": 1.0, "shortening": 1.0}, "needs one of force and shortening"),
    ("preload", {"force": 1.0}, "a preload needs a section"),
    ("preload", {"boundary": "left", "shortening": 1.0, "lock": True}, "lock belongs to a force"),
    ("coupling", {"boundary": "left"}, "coupling: missing field `point`"),
    ("coupling", {"point": [3, 0.5]}, "a coupling needs one of boundary and nodes"),
    ("coupling", {"boundary": "left", "point": [3, 0.5], "rx": 0.1}, "z, rx and ry have no meaning here"),
    ("coupling", {"boundary": "left", "point": [3, 0.5], "moment": [1.0, 2.0]}, "in the plane a moment is one number"),
    ("coupling", {"boundary": "left", "point": [3, 0.5], "kind": "soft"}, "expected `rigid` or `distributing`"),
    ("coupling", {"contacts": "plate", "point": [3, 0.5], "kind": "distributing"}, "obstacles are rigid: leave out kind and free"),
    ("coupling", {"contacts": [], "point": [3, 0.5]}, "a list of contacts is empty"),
    ("equation", {"value": 1.0}, "equation: missing field `terms`"),
    ("equation", {"terms": []}, "an equation needs terms"),
    ("equation", {"terms": [{"x": 1}]}, "needs one of boundary, nodes and point"),
    ("equation", {"terms": [{"point": [0, 0]}]}, "needs a finite factor other than 0"),
    ("equation", {"terms": [{"point": [0, 0], "x": 1}], "value": np.inf}, "the value of an equation must be finite"),
    ("wheel", {"radius": 1}, "wheel: unknown field"),
]


@pytest.mark.parametrize("table, entries, text", WRONG_TABLES)
def test_faults_of_a_table_are_reported_at_once(table: str, entries: dict[str, Any], text: str) -> None:
    model = signorini.Model(signorini.rectangle([3, 1], [12, 4]))
    with pytest.raises(ValueError, match=text):
        model.add(table, **entries)
    assert "nothing stated yet" in repr(model)


def test_faults_of_a_model_are_reported_when_it_is_built() -> None:
    wrong: list[tuple[Any, str]] = [
        (lambda m: m.support("lfet", x=0), 'support 2: there is no boundary "lfet".*did you mean "left"'),
        (lambda m: m.traction("top", pressure=[1.0, 2.0]), "traction: a quantity has 2 values, and the mesh 65 nodes"),
        (lambda m: m.traction("top", pressure="1 / 0"), 'traction: the traction has no finite value'),
        (lambda m: m.body_force("steel", y=1), 'there is no region "steel"'),
        (lambda m: m.steps([]), "steps: factors needs at least one number"),
        (lambda m: m.analysis(gravity=[0, -9.81]), "no material has a density"),
        (lambda m: m.material("body", young=1e9, poisson=0.3), "with several materials"),
        (lambda m: m.coupling(contacts="floor", point=[0, 0]), 'there is no contact named "floor"'),
        (lambda m: m.equation([{"nodes": "corner", "x": 1}]), 'there is no set of nodes "corner"'),
    ]
    for say, text in wrong:
        with pytest.raises(signorini.ModelError, match=text):
            model = block()
            say(model)
            model.build()
    bare = signorini.Model(signorini.Mesh([[0, 0], [1, 0], [0, 1]], {"triangle": [[0, 1, 2]]})).material(young=1.0, poisson=0.0)
    with pytest.raises(signorini.ModelError, match='"left": the mesh has none; name boundaries where the mesh is made'):
        bare.support("left", x=0).build()
    with pytest.raises(signorini.ModelError, match="there is no material"):
        signorini.Model(signorini.rectangle([1, 1], [2, 2])).build()
    with pytest.raises(ValueError, match="mesh: expected a signorini.Mesh"):
        signorini.Model("mesh.msh")  # type: ignore[arg-type]


def test_meshes_of_arrays() -> None:
    points = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [9, 9]]
    cells = {"quad": [[0, 1, 4, 3]], "triangle": [[1, 2, 5], [1, 5, 4]]}
    boundaries = {"low": [[0, 1], [1, 2]], "high": [3, 4, 5], "sides": [np.array([[0, 3]]), np.array([[2, 5]])]}
    mesh = signorini.Mesh(points, cells, {"a": [0, 1], "b": [1, 2]}, boundaries)
    assert mesh.dim == 2 and mesh.points.shape == (6, 2) and mesh.n_bodies == 1
    assert {name: sorted(of.tolist()) for name, of in mesh.regions.items() if " & " not in name} == {"a": [0, 1], "b": [1, 2]}
    assert mesh.boundaries["high"].tolist() == [3, 4, 5] and mesh.boundaries["sides"].tolist() == [0, 2, 3, 5]
    assert sorted(map(sorted, mesh.facets("low")[0].tolist())) == [[0, 1], [1, 2]]
    copy = pickle.loads(pickle.dumps(mesh))
    np.testing.assert_array_equal(copy.points, mesh.points)
    assert repr(copy) == repr(mesh) and "array" not in repr(mesh)
    assert list(copy.regions) == list(mesh.regions)
    # Elements are numbered in the order of the arrays, kind by kind or not.
    mixed = signorini.Mesh(points, [("triangle", [[1, 2, 5]]), ("quad", [[0, 1, 4, 3]]), ("triangle", [[1, 5, 4]])])
    assert {kind: of.tolist() for kind, of in mixed.cell_numbers.items()} == {"triangle": [0, 2], "quad": [1]}


WRONG_MESHES = [
    ({"points": [[0, 0], [1, 0], [np.nan, 1]]}, "not finite"),
    ({"points": [0, 1, 2]}, "points: expected an array of two dimensions"),
    ({"points": [[0], [1], [2]]}, "points: expected 2 or 3 columns, found 1"),
    ({"points": [["a", "b"]]}, "points: expected real numbers"),
    ({"cells": {"triangle": [[0, 1, 7]]}}, "names node 7"),
    ({"cells": {"triangle": [[0, 1, -2]]}}, "-2 is not the number of a node"),
    ({"cells": {"triangle": [[0, 1]]}}, "a tri3 has 3 nodes, and the array has 2 columns"),
    ({"cells": {"triangle": [0, 1, 2]}}, "a row for each element"),
    ({"cells": {"triangle": [[0.0, 1.0, 2.0]]}}, "cells: expected integers"),
    ({"cells": {"hexagon": [[0, 1, 2]]}}, "there are no elements 'hexagon'"),
    ({"cells": {"tetra": [[0, 1, 2, 0]]}}, "tet4 are not elements of a mesh whose points have 2"),
    ({"cells": {}}, "the mesh has no elements"),
    ({"cells": {"triangle": [[0, 1, 1]]}}, "element 0"),
    ({"regions": {"a": [3]}}, "regions: 'a' names an element that does not exist"),
    ({"regions": ["a", "b"]}, "regions: there are 1 elements, and regions for 2"),
    ({"boundaries": {"low": [[0, 9]]}}, "names node 9"),
    ({"boundaries": {"low": [0]}}, "all corners of no outer facet"),
    ({"boundaries": {"low": [0, 99]}}, "names node 99"),
    ({"boundaries": {"low": [[0, 1, 2, 0]]}}, "have 4 nodes"),
    ({"boundaries": {"low": [0.5]}}, "boundaries, 'low': expected integers"),
]


@pytest.mark.parametrize("changes, text", WRONG_MESHES)
def test_wrong_meshes(changes: dict[str, Any], text: str) -> None:
    good: dict[str, Any] = {"points": [[0, 0], [1, 0], [0, 1]], "cells": {"triangle": [[0, 1, 2]]}}
    with pytest.raises(ValueError, match=text):
        signorini.Mesh(**{**good, **changes})


def test_meshes_of_files(tmp_path: Path) -> None:
    mesh = signorini.Mesh.read(EXAMPLES / "bracket.msh", scale=2.0)
    np.testing.assert_allclose(mesh.points, 2.0 * signorini.Mesh.read(EXAMPLES / "bracket.msh").points)
    assert signorini.Mesh.read(EXAMPLES / "bracket.msh", order=2).cells.keys() == {"triangle6"}
    with pytest.raises(FileNotFoundError):
        signorini.Mesh.read(tmp_path / "nothing.msh")
    (tmp_path / "wrong.msh").write_text("nonsense")
    with pytest.raises(signorini.ModelError, match="wrong.msh"):
        signorini.Mesh.read(tmp_path / "wrong.msh")
    with pytest.raises(signorini.ModelError, match="order is the order of the elements"):
        signorini.Mesh.read(EXAMPLES / "bracket.msh", order=3)


@pytest.mark.parametrize("file", ["bracket", "bracket-3d", "shrink-fit", "dovetail"])
def test_meshio_and_the_reader_see_the_same_mesh(file: str) -> None:
    path = EXAMPLES / f"{file}.msh"
    ours, theirs = signorini.Mesh.read(path), signorini.Mesh.from_meshio(meshio.read(path))
    assert {k: len(v) for k, v in ours.cells.items()} == {k: len(v) for k, v in theirs.cells.items()}
    assert ours.boundaries.keys() == theirs.boundaries.keys() and ours.n_bodies == theirs.n_bodies

    def places(mesh: signorini.Mesh, name: str) -> Any:
        found = mesh.points[mesh.boundaries[name]]
        return found[np.lexsort(found.T)]

    for name in ours.boundaries:
        np.testing.assert_array_equal(places(ours, name), places(theirs, name))
    assert {n: len(of) for n, of in ours.regions.items()} == {n: len(of) for n, of in theirs.regions.items()}


def test_meshio_there_and_back(tmp_path: Path) -> None:
    """The mesh passed to meshio is the solved one; and a second-order mesh survives it."""
    for order in (1, 2):
        solution = block(signorini.rectangle([3, 1], [6, 2], order=order)).traction("top", pressure=2e7).solve()
        grid = solution.to_meshio()
        assert grid.points.shape[1] == 3
        np.testing.assert_array_equal(grid.point_data["displacement"][:, :2], solution.u)
        np.testing.assert_array_equal(np.concatenate(grid.cell_data["stress"]), solution.stress_in_elements)
        grid.write(tmp_path / "grid.vtu")
        again = signorini.Mesh.from_meshio(meshio.read(tmp_path / "grid.vtu"))
        np.testing.assert_array_equal(again.points, grid.points[:, :2])
    bent = meshio.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 1]], [("triangle", [[0, 1, 2]])])
    with pytest.raises(signorini.ModelError, match="not plane"):
        signorini.Mesh.from_meshio(bent)
    level = meshio.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [("triangle", [[0, 1, 2]])], cell_data={"mat": [[7]]})
    assert list(signorini.Mesh.from_meshio(level, regions="mat").regions) == ["7"]
    with pytest.raises(ValueError, match="no cell data 'colour'"):
        signorini.Mesh.from_meshio(level, regions="colour")


@pytest.mark.parametrize("kind", ["MeshTri", "MeshQuad", "MeshTri2", "MeshQuad2", "MeshTet", "MeshHex", "MeshTet2", "MeshHex2", "MeshWedge1"])
def test_scikit_fem(kind: str) -> None:
    """Every kind of its elements: a body of volume 1 that weight presses on a floor with all that it weighs."""
    of_kind = getattr(skfem, kind)
    if kind.endswith("2"):
        mesh = of_kind.from_mesh(getattr(skfem, kind[:-1])().refined(1))
    else:
        # It refines no wedges.
        mesh = of_kind() if kind == "MeshWedge1" else of_kind().refined(2)
    d = mesh.dim()
    low = (lambda x: x[1] == 0.0) if d == 2 else (lambda x: x[2] == 0.0)
    ours = signorini.Mesh.from_skfem(mesh, {"low": low, "side": lambda x: x[0] == 0.0})
    assert ours.dim == d and set(ours.boundaries) >= {"low", "side"}
    floor = FLOOR if d == 2 else {"half_space": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    down = {"y": -1e3} if d == 2 else {"z": -1e3}
    model = signorini.Model(ours).material(young=1e9, poisson=0.3).support("side", x=0).body_force(**down)
    if d == 3:
        model.support(point=[0, 0, 0], y=0).support(point=[0, 0, 1], y=0)
    contact = model.contact("low", obstacle=floor).solve().contacts["low"]
    np.testing.assert_allclose(contact.normal_force, 1e3, rtol=1e-5)


def test_discontinuous_meshes_are_refused() -> None:
    mesh = skfem.MeshTri1DG.from_mesh(skfem.MeshTri())
    with pytest.raises(signorini.ModelError, match="elements of a MeshTri1DG share no nodes"):
        signorini.Mesh.from_skfem(mesh)


def grid(copies: bool) -> meshio.Mesh:
    """A rectangle of 8 × 4 quadrilaterals, all of them in "all"; with copies, the middle ones once more, in "sensor"."""
    x, y = np.meshgrid(np.linspace(0, 1, 9), np.linspace(0, 0.5, 5))
    corner = (9 * np.arange(4)[:, None] + np.arange(8)).ravel()
    quads = np.stack([corner, corner + 1, corner + 10, corner + 9], axis=1)
    cells = [("quad", quads), ("line", np.stack([np.arange(8), np.arange(1, 9)], axis=1))]
    sets = {"all": [np.arange(32), None], "base": [None, np.arange(8)]}
    if copies:
        cells.append(("quad", np.roll(quads[8:24], 1, axis=1)))
        sets = {name: [*of, None] for name, of in sets.items()} | {"sensor": [None, None, np.arange(16)]}
    top = {"top": np.arange(36, 45), "corner": np.array([0])}
    return meshio.Mesh(np.stack([x.ravel(), y.ravel()], axis=1), cells, cell_sets=sets, point_sets=top)


def standing(mesh: signorini.Mesh) -> signorini.Solution:
    model = signorini.Model(mesh).material(young=1e9, poisson=0.3).contact("base", obstacle=FLOOR, friction={"coulomb": 0.3})
    return model.traction("top", pressure=1e6).solve()


def test_copies_of_elements_count_once() -> None:
    once = signorini.Mesh.from_meshio(grid(False))
    with pytest.warns(UserWarning, match="16 elements of the mesh are copies of others on the same nodes"):
        twice = signorini.Mesh.from_meshio(grid(True))
    assert len(twice.cells["quad"]) == 32 and once.notes == [] and len(twice.notes) == 1
    assert len(twice.regions["all"]) == 32 and twice.regions["sensor"].tolist() == list(range(8, 24))
    solution = standing(twice)
    np.testing.assert_allclose(solution.u, standing(once).u, rtol=0, atol=1e-12)
    assert any("are copies" in hint for hint in solution.hints)
    # Boundaries of nodes are those of the elements that are left.
    cells = {"triangle": [[0, 1, 2], [2, 0, 1]]}
    with pytest.warns(UserWarning, match="one element of the mesh is a copy"):
        mesh = signorini.Mesh([[0, 0], [1, 0], [0, 1]], cells, boundaries={"low": [0, 1]})
    assert mesh.boundaries["low"].tolist() == [0, 1]
    with pytest.raises(signorini.ModelError, match="elements 0 and 1 overlap"):
        signorini.Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], {"quad": [[0, 1, 2, 3]], "triangle": [[0, 1, 2]]})


def test_point_sets_of_meshio_are_sets_of_nodes() -> None:
    mesh = signorini.Mesh.from_meshio(grid(False))
    assert mesh.node_sets["top"].tolist() == list(range(36, 45)) and mesh.node_sets["corner"].tolist() == [0]
    assert mesh.boundaries["top"].tolist() == list(range(36, 45)) and "corner" not in mesh.boundaries
    for other in (pickle.loads(pickle.dumps(mesh)), signorini.Mesh.join({"a": mesh})):
        assert sorted(len(nodes) for nodes in other.node_sets.values()) == [1, 9]
    both = signorini.Mesh.join({"a": mesh, "b": mesh}, shift={"b": [2, 0]})
    assert both.node_sets["b-corner"].tolist() == [45]
    # A support acts on a set that has no facet.
    model = signorini.Model(mesh).material(young=1e9, poisson=0.3).support(nodes="corner", x=0)
    model.contact("base", obstacle=FLOOR).traction("top", pressure=1e6)
    assert abs(model.solve().u[0, 0]) == 0.0
    with pytest.raises(signorini.ModelError, match="set of nodes \"far\" names node 99"):
        signorini.Mesh([[0, 0], [1, 0], [0, 1]], {"triangle": [[0, 1, 2]]}, node_sets={"far": [99]})


def test_both_sides_of_a_sector_have_their_own_vectors() -> None:
    """A place at the side of a sector is at a node of either side; its traction turns with the sector."""
    parts = {}
    for name, low, high in [("shaft", 0.4, 1.0), ("hub", 1.0, 1.6)]:
        r = f"({low} + {high - low} * x)"
        around = [f"{r} * cos(pi / 4 * y)", f"{r} * sin(pi / 4 * y)"]
        parts[name] = signorini.rectangle([1, 1], [2, 4], map=around)
    model = signorini.Model(signorini.Mesh.join(parts))
    for name in parts:
        model.cyclic(f"{name}-bottom", f"{name}-top", {"point": [0, 0]}, 8)
    model.material(young=1e3, poisson=0.3)
    model.support("shaft-left", x=0, y=0).support("hub-right", x=0, y=0)
    model.contact("shaft-right", against="hub-left", interference=0.01)
    data = model.solve().to_meshio()
    traction, pressure = data.point_data["contact_traction"][:, :2], data.point_data["contact_pressure"]
    at = np.isclose(np.linalg.norm(data.points[:, :2], axis=1), 1.0) & (data.point_data["contact_status"] == 4)
    assert at.sum() >= 5
    inwards = -np.einsum("kc,kc->k", traction[at], data.points[at, :2])
    np.testing.assert_allclose(inwards, pressure[at], rtol=1e-3)


def test_fields_and_groups_are_passed_on() -> None:
    """Fields at contacts, regions and boundaries reach meshio and PyVista, and come back from there."""
    solution = standing(signorini.Mesh.from_meshio(grid(False)))
    base = solution.contacts["base"]
    grid_of = solution.to_meshio()
    at = [int(np.argmin(np.abs(grid_of.points[:, :2] - x).sum(axis=1))) for x in base.points]
    data = grid_of.point_data
    np.testing.assert_array_equal(data["contact_pressure"][at], base.pressure)
    np.testing.assert_array_equal(data["contact_gap"][at], base.gap)
    np.testing.assert_array_equal(data["contact_traction"][at, :2], base.traction_vectors)
    np.testing.assert_allclose(data["contact_slip"][at, 0], np.abs(base.slip[:, 0]) * np.sign(data["contact_slip"][at, 0]))
    words = np.array(["", "separated", "stick", "slip", "contact", "tied"])
    np.testing.assert_array_equal(words[data["contact_status"][at]], base.state)
    elsewhere = np.setdiff1d(np.arange(45), at)
    assert not data["contact_pressure"][elsewhere].any() and np.isnan(data["contact_gap"][elsewhere]).all()
    again = signorini.Mesh.from_meshio(grid_of)
    assert again.boundaries.keys() == {"base", "top"} and len(again.regions["all"]) == 32
    shown = solution.to_pyvista()
    assert shown.cell_data["region all"].sum() == 32 and shown.point_data["boundary base"].sum() == 9
    np.testing.assert_array_equal(shown.point_data["contact_pressure"], data["contact_pressure"])
    copy = pickle.loads(pickle.dumps(solution)).to_meshio()
    np.testing.assert_array_equal(copy.point_data["contact_pressure"], data["contact_pressure"])


def test_join_and_map() -> None:
    part = signorini.rectangle([1, 1], [2, 2], map=["x", "y + 0.1*x^2"], shape="triangle")
    mesh = signorini.Mesh.join({"a": part, "b": part}, shift={"b": [5, 0]})
    assert mesh.n_bodies == 2 and set(mesh.regions) == {"a", "b"} and "b-left" in mesh.boundaries
    with pytest.raises(signorini.ModelError, match="plane and of space"):
        signorini.Mesh.join({"a": part, "c": signorini.box([1, 1, 1], [1, 1, 1])})
    with pytest.raises(signorini.ModelError, match="positive sizes"):
        signorini.box([1, 1, 0], [1, 1, 1])
    for wrong in ([1, 2, 3], [np.nan, 0]):
        with pytest.raises(ValueError, match="shift, 'a': expected 2 finite numbers"):
            signorini.Mesh.join({"a": part}, shift={"a": wrong})
    with pytest.raises(ValueError, match="shift: there is no part 'B'; there are 'a', 'b'"):
        signorini.Mesh.join({"a": part, "b": part}, shift={"B": [5, 0]})


def test_names_of_joined_parts_differ() -> None:
    points, cells = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), {"quad": [[0, 1, 2, 3]]}
    kinds: list[tuple[str, Any]] = [("regions", [0]), ("boundaries", [[0, 1]]), ("node_sets", [0])]
    for kind, of in kinds:
        one = signorini.Mesh(points, cells, **{kind: {"b-c": of}})
        other = signorini.Mesh(points + [0, 5], cells, **{kind: {"c": of}})
        with pytest.raises(signorini.ModelError, match="a region or boundary called \"a-b-c\": give the parts other names"):
            signorini.Mesh.join({"a": one, "a-b": other})


def test_an_empty_boundary_is_refused() -> None:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    boundaries = {"low": [[0, 1]], "top": np.zeros((0, 2), int)}
    mesh = signorini.Mesh(square, {"quad": [[0, 1, 2, 3]]}, boundaries=boundaries)
    model = signorini.Model(mesh).material(young=1.0, poisson=0.3).support("low", x=0, y=0)
    for wrong in (model.traction("top", y=-1.0), model.support("top", y=0.0)):
        with pytest.raises(signorini.ModelError, match='"top": it has no facet'):
            wrong.solve()


def test_cell_data_and_masks_of_meshio() -> None:
    points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [0.0, 1.0], [1.0, 1.0], [2.0, 1.0]]
    cells = [("quad", [[0, 1, 4, 3], [1, 2, 5, 4]]), ("line", [[0, 1], [1, 2]])]
    data = {"tag": [np.array([1.5, 1.7]), np.array([1.0, 1.0])]}
    tagged = signorini.Mesh.from_meshio(meshio.Mesh(points, cells, cell_data=data), regions="tag")
    assert {name: list(of) for name, of in tagged.regions.items()} == {"1.5": [0], "1.7": [1]}
    assert list(tagged.boundaries) == ["1"]
    masked = meshio.Mesh(points, cells)
    masked.cell_sets["b"] = [np.zeros(2, bool), np.array([False, True])]
    found = signorini.Mesh.from_meshio(masked)
    assert np.unique(found.boundaries["b"]).tolist() == [1, 2]
