"""Matrices: every form that they may have, every way that they may be wrong, many right-hand sides."""

from __future__ import annotations

import pickle
import threading
from typing import Any

import numpy as np
import pytest
import scipy.sparse
from conftest import points_in_space

import signorini

PATHS = ["cholesky", "pcg"]
# Two solves that are both this accurate differ by no more than EQUAL of the largest displacement.
EXACT = 1e-9
EQUAL = 1e-6


def same(u: Any, other: Any) -> None:
    np.testing.assert_allclose(u, other, rtol=0, atol=EQUAL * np.abs(other).max())


def solve(problem: dict[str, Any], **changes: Any) -> signorini.Solution:
    return signorini.solve(**{**problem, **changes})


def test_springs(springs: dict[str, Any]) -> None:
    solution = solve(springs)
    assert solution.converged and solution.status == "converged"
    np.testing.assert_allclose(solution.u, [0.45, 1.0], atol=1e-6)
    np.testing.assert_allclose(solution.lambda_normal, [0.45], atol=1e-6)
    assert solution.lambda_tangential.shape == (1, 1)
    np.testing.assert_allclose(np.abs(solution.lambda_tangential), 0.1, atol=1e-6)
    assert list(solution.state) == ["slip"]
    assert solution.kkt.max() < 1e-5
    assert solution.contacts == {} and solution.supports == []


def test_no_friction(springs: dict[str, Any]) -> None:
    del springs["tangential"], springs["slip_bound"]
    solution = solve(springs)
    np.testing.assert_allclose(solution.u, [0.5, 1.0], atol=1e-6)
    assert list(solution.state) == ["contact"]


@pytest.mark.parametrize("path", PATHS)
def test_space(path: str) -> None:
    problem = points_in_space()
    solution = solve(problem, stiffness=path)
    push = problem["f"].reshape(-1, 3)[:, :2]
    size = np.linalg.norm(push, axis=1, keepdims=True)
    expected = push * np.maximum(0.0, 1.0 - 0.5 / size)
    np.testing.assert_allclose(solution.u.reshape(-1, 3)[:, :2], expected, atol=1e-6)
    np.testing.assert_allclose(solution.lambda_normal, 1.0, atol=1e-6)
    assert solution.lambda_tangential.shape == (4, 2)
    assert list(solution.state[2:]) == ["slip", "slip"] and solution.state[0] == "stick"


def test_coulomb() -> None:
    problem = points_in_space()
    del problem["slip_bound"]
    # λν = 1: the bound is unchanged.
    np.testing.assert_allclose(solve(problem, friction=0.5).u, solve(points_in_space()).u, atol=1e-6)


def test_compliance_and_ties(springs: dict[str, Any]) -> None:
    """A wall that gives way by c λν; and a point that is held at the wall and may not slide."""
    # 2 u₁ = u₂ − 0.1, u₂ = 1 + c λ, u₂ − u₁ + λ = 1.
    c = 0.5
    found = solve(springs, compliance=[c, 0.0])
    force = 0.45 / (1 + c / 2)
    np.testing.assert_allclose(found.lambda_normal, force, atol=1e-6)
    np.testing.assert_allclose(found.u[1], 1 + c * force, atol=1e-6)
    held = solve(springs, tied=[True], gap=0.0)
    np.testing.assert_allclose(held.u, [0.0, 0.0], atol=1e-6)
    assert list(held.state) == ["tied"]


def _unsorted(matrix: Any) -> Any:
    """The entries of each row the other way round, the first of each in two halves."""
    csr = scipy.sparse.csr_array(matrix)
    rows, cols, values = [], [], []
    for i in range(csr.shape[0]):
        row = slice(csr.indptr[i], csr.indptr[i + 1])
        for j, value in list(zip(csr.indices[row], csr.data[row]))[::-1]:
            for _ in range(2):
                rows.append(i), cols.append(j), values.append(value / 2)
    made = scipy.sparse.csr_array(csr.shape)
    made.indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=csr.shape[0]))]).astype(np.int32)
    made.indices, made.data = np.array(cols, dtype=np.int32), np.array(values)
    return made


def _wide(matrix: Any) -> Any:
    made = scipy.sparse.csr_array(matrix)
    made.indptr, made.indices = made.indptr.astype(np.int64), made.indices.astype(np.int64)
    return made


FORMS = {
    "csc": scipy.sparse.csc_array,
    "coo": scipy.sparse.coo_array,
    "matrix": scipy.sparse.csr_matrix,
    "bsr": scipy.sparse.bsr_array,
    "dense": lambda matrix: matrix.toarray(),
    "lists": lambda matrix: matrix.toarray().tolist(),
    "fortran": lambda matrix: np.asfortranarray(matrix.toarray()),
    "wide": _wide,
    "unsorted": _unsorted,
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_are_the_same_to_the_last_bit(block: dict[str, Any], form: str) -> None:
    expected = solve(block).u
    matrices = {name: FORMS[form](block[name]) for name in ("K", "normal", "tangential")}
    np.testing.assert_array_equal(solve(block, **matrices).u, expected)


def test_vectors_of_any_stride_and_type(block: dict[str, Any]) -> None:
    expected = solve(block).u
    f = np.zeros((len(block["f"]), 3))
    f[:, 1] = block["f"]
    gap = block["gap"].copy()
    gap.setflags(write=False)
    found = solve(block, f=f[:, 1], gap=gap, slip_bound=block["slip_bound"][::-1][::-1], coordinates=block["coordinates"].tolist())
    np.testing.assert_array_equal(found.u, expected)
    whole = solve(block, f=(block["f"] / 1e3).round().astype(int), slip_bound=np.float32(1e4))
    same = solve(block, f=(block["f"] / 1e3).round(), slip_bound=1e4)
    np.testing.assert_array_equal(whole.u, same.u)


def test_nothing_of_the_user_is_changed(block: dict[str, Any]) -> None:
    before = {name: value.copy() for name, value in block.items()}
    solve(block)
    for name, value in block.items():
        if scipy.sparse.issparse(value):
            assert (value != before[name]).nnz == 0
        else:
            np.testing.assert_array_equal(value, before[name])


def test_empty_contact(springs: dict[str, Any]) -> None:
    none = scipy.sparse.csr_array((0, 2))
    solution = signorini.solve(springs["K"], springs["f"], normal=none)
    np.testing.assert_allclose(solution.u, [1.0, 2.0])
    assert solution.lambda_tangential.shape == (0, 1)


def _csr(data: Any, indices: Any, indptr: Any, shape: tuple[int, int] = (2, 2)) -> Any:
    """A matrix unchanged, however wrong."""
    made = scipy.sparse.csr_array(shape)
    made.data, made.indices, made.indptr = np.asarray(data), np.asarray(indices), np.asarray(indptr)
    return made


NAN, INF = np.nan, np.inf
WRONG = [
    ("K", [[2.0, -1.0], [-0.5, 1.0]], "symmetric"),
    ("K", [[2.0, NAN], [NAN, 1.0]], "K"),
    ("K", [[2.0, -1.0], [-1.0, INF]], "K"),
    ("K", [[-2.0, -1.0], [-1.0, 1.0]], "K"),
    ("K", [[2.0, -1.0]], "K"),
    ("K", [2.0, -1.0], "K: expected an array of two dimensions"),
    ("K", [[2.0, 1j], [1j, 1.0]], "K: expected real numbers"),
    ("K", [["a", "b"], ["c", "d"]], "K: expected real numbers"),
    ("K", [[2.0], [1.0, 2.0]], "K"),
    ("K", None, "K"),
    ("K", _csr([2.0, -1.0, -1.0, 1.0], [0, 1, 0, 7], [0, 2, 4]), "K"),
    ("K", _csr([2.0, -1.0, -1.0, 1.0], [0, 1, 0, -1], [0, 2, 4]), "K"),
    ("K", _csr([2.0, -1.0, -1.0, 1.0], [0, 1, 0, 1], [0, 3, 2]), "K"),
    ("K", _csr([2.0, -1.0, -1.0, 1.0], [0, 1, 0, 1], [0, 2, 9]), "K"),
    ("K", _csr([2.0, -1.0, -1.0], [0, 1, 0, 1], [0, 2, 4]), "K"),
    ("K", scipy.sparse.csr_array((2, 2)), "K"),
    ("f", [0.0, 1.0, 2.0], "f"),
    ("f", [[0.0, 1.0]], "f: expected a vector"),
    ("f", 1.0, "f: expected a vector"),
    ("f", [0.0, NAN], "f"),
    ("f", ["a", "b"], "f: expected real numbers"),
    ("f", None, "f: expected real numbers"),
    ("f", [], "f"),
    ("normal", [[0.0, 1.0, 0.0]], "N"),
    ("normal", [[0.0, NAN]], "N"),
    ("normal", np.zeros((0, 2)), "gap: expected 0 entries"),
    ("tangential", [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], "T"),
    ("tangential", [[0.0, 2.0]], "T"),
    ("gap", [1.0, 2.0], "gap: expected 1 entries, found 2"),
    ("gap", [-1.0], "gap"),
    ("gap", NAN, "gap"),
    ("slip_bound", [-0.1], "slip bound"),
    ("slip_bound", None, "slip_bound or friction"),
    ("friction", [-0.1], "friction"),
    ("friction", "a", "friction: expected real numbers"),
    ("coordinates", [[0.0, 0.0], [1.0, 0.0]], "coordinates"),
    ("coordinates", [[0.0]], "coordinates"),
    ("coordinates", [0.0, 0.0], "coordinates: expected an array of two dimensions"),
    ("coordinates", [[NAN, 0.0]], "coordinates"),
    ("dim", 4, "dim: must be the integer 2 or 3, not 4"),
    ("dim", 2.0, "dim: must be the integer 2 or 3, not 2.0"),
    ("dim", 3, "T"),
    ("areas", [0.0], "area"),
    ("areas", [1.0, 1.0], "areas: expected 1 entries"),
    ("slip_origin", [NAN], "slip"),
    ("compliance", [-1.0, 0.0], "compliance"),
    ("compliance", [1.0], "compliance: expected 2 entries"),
    ("tied", [1], "tied: expected 1 of True or False"),
    ("tied", [True, False], "tied: expected 1 of True or False"),
    ("tolerance", 2.0, "tolerance must lie between 0 and 1"),
    ("tolerance", "small", "tolerance: expected a number"),
    ("stiffness", "lu", 'stiffness: must be one of "auto", "cholesky", "pcg"'),
    ("backend", 3, "backend: must be one of"),
    ("precision", "f16", "precision: must be one of"),
    ("method", "newton", "method: must be one of"),
    ("time_limit", -1.0, "time_limit: must be a number of seconds"),
    ("max_iterations", -1, "max_iterations: -1 is out of range"),
    ("colour", "red", "colour: no solve has such a setting"),
    ("callback", 3, "callback: expected a callable"),
]


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("name, value, text", WRONG)
def test_faults_are_named(springs: dict[str, Any], name: str, value: Any, text: str, path: str) -> None:
    with pytest.raises((ValueError, signorini.SolveError)) as caught:
        solve(springs, **{"stiffness": path, name: value})
    assert text in str(caught.value), str(caught.value)
    assert "defect" not in str(caught.value)


def test_faults_name_the_remedy(springs: dict[str, Any]) -> None:
    """Rows and columns count from 0; each text has the keyword, or another remedy."""
    held = np.array([[1.0, 0.0], [-1.0, 1.0]])
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"gap": -0.5}, r"d\(0\) = -5e-1.*set interference to true"),
        ({"normal": [[0, 1], [0, 2]], "tangential": None, "slip_bound": None, "gap": 1.0}, "rows 0 and 1 .*set dependent_rows to true"),
        ({"normal": [[0, 1], [1, 1], [1, 0]], "tangential": None, "slip_bound": None, "gap": 1.0}, "3 rows for 2 unknowns.*dependent_rows"),
        ({"K": held}, r"K\(0, 1\) = 0e0 but K\(1, 0\) = -1e0. A row that holds an unknown.*condense"),
        ({"K": [[2.0, -1.0], [-0.9, 1.0]]}, r"K\(0, 1\) = -1e0.*\(K \+ Kᵀ\)/2 is the same problem only where"),
        ({"f": [0.0, np.inf]}, "the load f: entry 1 is inf"),
        ({"normal": [[0.0, np.nan]]}, r"N: entry \(0, 1\) is NaN"),
        ({"K": [[2.0, -1.0], [-1.0, -1.0]]}, "diagonal entry 1 is -1e0"),
    ]
    for change, text in wrong:
        with pytest.raises(ValueError, match=text):
            signorini.Problem(**{**springs, **change})
    for name, meant in {"tol": "tolerance", "maxiter": "max_iterations", "max_iteration": "max_iterations", "backnd": "backend"}.items():
        with pytest.raises(ValueError, match=f"{name}: no solve has such a setting; did you mean {meant}"):
            signorini.solve(**springs, **{name: 1})
    # A gap that is negative by rounding counts as zero.
    touching = signorini.solve(**{**springs, "gap": -1e-18})
    np.testing.assert_array_equal(touching.u, signorini.solve(**{**springs, "gap": 0.0}).u)


def test_singular(springs: dict[str, Any]) -> None:
    with pytest.raises(signorini.SolveError, match="singular"):
        solve(springs, K=[[1.0, -1.0], [-1.0, 1.0]])


def test_many_right_hand_sides_share_the_factor(block: dict[str, Any]) -> None:
    problem = signorini.Problem(**block)
    assert (problem.n, problem.m, problem.dim) == (len(block["f"]), len(block["gap"]), 2)
    first = problem.solve(tolerance=EXACT)
    for factor in (0.5, 1.0, 2.0):
        again = problem.solve(f=factor * block["f"], tolerance=EXACT)
        same(again.u, solve(block, f=factor * block["f"], tolerance=EXACT).u)
    assert problem.solve(tolerance=EXACT).products <= first.products
    changed = problem.solve(gap=2e-5, slip_bound=0.0, friction=0.2, tolerance=EXACT)
    alone = solve({k: v for k, v in block.items() if k != "slip_bound"}, gap=2e-5, friction=0.2, tolerance=EXACT)
    same(changed.u, alone.u)
    # One law a node: the other one takes its place.
    with pytest.raises(ValueError, match=r"contact node 0 has the slip bound g = 1e4 .* and the coefficient of friction μ = 2e-1"):
        problem.solve(friction=0.2, slip_bound=1e4)
    same(problem.solve(gap=2e-5, friction=0.2, tolerance=EXACT).u, changed.u)
    coulomb = signorini.Problem(**{**block, "slip_bound": None, "friction": 0.2})
    with pytest.raises(ValueError, match="only one law can hold there"):
        coulomb.solve(slip_bound=1e4)
    with pytest.raises(ValueError, match="only one law can hold there"):
        solve(block, friction=0.2)
    same(coulomb.solve(friction=0.0, slip_bound=block["slip_bound"], tolerance=EXACT).u, first.u)


def test_load_steps_remember_slip() -> None:
    """Pushed forth, a point slips; let go, it stays where friction holds it: 0.5 from where the spring would have it."""
    problem = signorini.Problem(**points_in_space(1))
    push = np.array([3.0, 0.0, -2.0])
    forth = problem.solve(f=push)
    back = problem.solve(f=np.array([0.0, 0.0, -2.0]), after=forth)
    np.testing.assert_allclose(forth.u[0], 2.5, atol=1e-5)
    np.testing.assert_allclose(back.u[0], 0.5, atol=1e-5)
    np.testing.assert_allclose(back.slip, [[-2.0, 0.0]], atol=1e-5)
    # A copy is the same problem; others are not, whatever their size.
    assert pickle.loads(pickle.dumps(problem)).solve(f=push, after=forth).converged
    stiff = {**points_in_space(1), "K": 2.0 * scipy.sparse.identity(3)}
    for other in (signorini.solve([[1.0]], [1.0], normal=[[1.0]]), signorini.solve(**points_in_space(2)), signorini.solve(**stiff)):
        with pytest.raises(ValueError, match="after: that is the solution of another problem"):
            problem.solve(after=other)


def test_vectors_of_a_solve_obey_the_rules_of_the_problem(springs: dict[str, Any]) -> None:
    """n need not be a multiple of d, and still f has n entries; overlaps must be intended; no friction without T."""
    odd: dict[str, Any] = {"f": np.ones(3), "normal": [[1.0, 0, 0]], "tangential": [[0, 1.0, 0]], "gap": 0.1, "friction": 0.3}
    problem = signorini.Problem(np.diag([1.0, 2.0, 3.0]), **odd)
    for length in (2, 4):
        with pytest.raises(ValueError, match=f"the load f has length {length}, expected 3"):
            problem.solve(f=np.ones(length))
    assert problem.solve(f=2 * np.ones(3)).converged
    for other in (problem, pickle.loads(pickle.dumps(problem))):
        with pytest.raises(ValueError, match=r"d\(0\) = -1e-1.*set interference to true"):
            other.solve(gap=-0.1)
    np.testing.assert_array_equal(problem.solve(gap=-1e-18).u, problem.solve(gap=0.0).u)
    pressed = signorini.Problem(np.diag([1.0, 2.0, 3.0]), **odd, interference=True)
    for other in (pressed, pickle.loads(pickle.dumps(pressed))):
        np.testing.assert_allclose(other.solve(gap=-0.1).u[0], -0.1, atol=1e-6)
    del springs["tangential"], springs["slip_bound"]
    smooth = signorini.Problem(**springs)
    for name in ("friction", "slip_bound", "slip_origin"):
        for make in (smooth.solve, lambda **given: signorini.Problem(**springs, **given)):
            with pytest.raises(ValueError, match="tangential: friction needs T"):
                make(**{name: 0.3})


def test_ties_have_no_friction(springs: dict[str, Any]) -> None:
    held = solve(springs, tied=[True], gap=0.0)
    del springs["slip_bound"]
    problem = signorini.Problem(**{**springs, "tied": [True], "gap": 0.0, "friction": 0.01})
    for solution in (problem.solve(), problem.solve(friction=0.02)):
        np.testing.assert_array_equal(solution.u, held.u)


def test_threads(block: dict[str, Any]) -> None:
    """Two problems at once, and one from two threads."""
    shared = signorini.Problem(**block)
    expected = [solve(block, f=factor * block["f"], tolerance=EXACT).u for factor in (1.0, 2.0)]
    found: dict[tuple[str, int], Any] = {}

    def work(number: int) -> None:
        f = (number + 1.0) * block["f"]
        for _ in range(5):
            found["own", number] = solve(block, f=f, tolerance=EXACT).u
            found["shared", number] = shared.solve(f=f, tolerance=EXACT).u

    threads = [threading.Thread(target=work, args=(number,)) for number in range(2)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    for (_, number), u in found.items():
        same(u, expected[number])
    assert len(found) == 4


def test_reports(block: dict[str, Any]) -> None:
    solution = solve(block)
    assert repr(solution).startswith("<Solution converged: n = ")
    assert len(solution.steps) == 1 and solution.steps[0].iterations == solution.iterations
    history = solution.history
    assert len(history) == solution.iterations and history.dtype.names[0] == "load_step"
    assert history["err"][-1] <= 1e-6 and history["products"][-1] <= solution.products
    assert repr(signorini.Problem(**block)).count("[") == 0


def test_pcg_and_the_factor_agree(block: dict[str, Any]) -> None:
    direct, iterative = (solve(block, stiffness=path, tolerance=EXACT) for path in PATHS)
    assert direct.report["stiffness"] == "cholesky" and iterative.report["stiffness"] == "pcg"
    same(iterative.u, direct.u)


@pytest.mark.parametrize("far", [1e9, 1e16, 1e30, INF])
@pytest.mark.parametrize("stiffness", PATHS)
def test_no_obstacle_is_a_gap_of_any_size(far: float, stiffness: Any) -> None:
    """A gap that means "no obstacle" does not hide the contact elsewhere."""
    for gap in ([0.1, far], [far, 0.1]):
        solution = signorini.solve(np.eye(2), np.ones(2), normal=np.eye(2), gap=gap, stiffness=stiffness, tolerance=EXACT)
        assert solution.converged
        same(solution.u, np.minimum(gap, 1.0))
        same(solution.lambda_normal, 1.0 - np.minimum(gap, 1.0))


def test_slip_goes_on_from_the_origin_of_the_step_before() -> None:
    matrices = {"normal": np.array([[0, 1.0]]), "tangential": np.array([[1.0, 0]])}
    problem = signorini.Problem(np.diag([2.0, 2.0]), [1.0, 1.0], **matrices, gap=0.0, slip_bound=100.0)
    first = problem.solve(slip_origin=0.1)
    np.testing.assert_allclose(first.u, [0.1, 0.0], atol=1e-12)
    for again in ({}, {"slip_origin": 0.1}):
        second = problem.solve(after=first, **again)
        np.testing.assert_allclose(second.u, first.u, atol=1e-12)
        third = problem.solve(after=second, **again)
        np.testing.assert_allclose(third.u, first.u, atol=1e-12)


def test_given_friction_holds_a_floating_body_where_no_obstacle_is() -> None:
    """Two masses on each other by springs, on a floor; a third contact has no obstacle, as with any gap that is not closed."""
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    stiffness = np.kron(spring, np.eye(2))
    normal = np.array([[0, -1.0, 0, 0], [0, 0, 0, 1.0]])
    tangential = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
    for push in (0.05, 0.03):
        load = [0.0, -0.1, push, -0.1]
        found = [
            signorini.solve(
                stiffness,
                load,
                normal=normal,
                tangential=tangential,
                gap=[0.0, far],
                slip_bound=[0.04, 0.03],
                coordinates=[[0.0, 0.0], [0.0, 1.0]],
                tolerance=EXACT,
            )
            for far in (1e3, np.inf)
        ]
        assert all(one.converged for one in found)
        same(found[1].lambda_tangential, found[0].lambda_tangential)
