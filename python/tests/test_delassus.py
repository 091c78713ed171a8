"""Problems with a given Delassus operator, and files of FCLIB."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.sparse
from scipy.sparse.linalg import LinearOperator

import signorini
from signorini import fclib


def packing(d: int, bodies: int = 12, contacts: int = 40, seed: int = 1) -> dict[str, Any]:
    """Balls that touch each other at random: more contacts than motions, so W is singular."""
    rng = np.random.default_rng(seed)
    turns = 1 if d == 2 else 3
    n = bodies * (d + turns)
    H = np.zeros((n, d * contacts))
    for c in range(contacts):
        frame = np.linalg.qr(rng.normal(size=(d, d)))[0]
        for body, sign in zip(rng.choice(bodies, 2, replace=False), (1.0, -1.0)):
            at = body * (d + turns)
            arm = -sign * frame[:, 0]
            for k in range(d):
                along = frame[:, k]
                H[at : at + d, d * c + k] = sign * along
                turned = arm[0] * along[1] - arm[1] * along[0] if d == 2 else np.cross(arm, along)
                H[at + d : at + d + turns, d * c + k] = sign * turned
    M = np.diag(rng.uniform(1.0, 3.0, n))
    f = M @ rng.normal(size=n)
    return {"H": H, "M": M, "f": f, "W": H.T @ np.linalg.solve(M, H), "q": H.T @ np.linalg.solve(M, f), "m": contacts, "n": n}


def check(W: Any, q: Any, mu: float, solution: signorini.DelassusSolution, accuracy: float) -> None:
    """The laws of contact, one by one."""
    r, u = solution.impulses, solution.velocities
    np.testing.assert_allclose((W @ r.ravel()).reshape(r.shape) + q.reshape(r.shape), u, atol=1e-12 * np.abs(u).max() + 1e-12)
    size, speed = np.abs(r).max(), np.abs(q).max()
    assert r[:, 0].min() >= -accuracy * size and u[:, 0].min() >= -accuracy * speed
    assert np.abs(r[:, 0] * u[:, 0]).max() <= accuracy * size * speed
    force, slid = np.linalg.norm(r[:, 1:], axis=1), np.linalg.norm(u[:, 1:], axis=1)
    assert (force - mu * r[:, 0]).max() <= accuracy * size
    # Sliding contacts have their full friction, against the direction of sliding.
    power = np.sum(r[:, 1:] * u[:, 1:], axis=1)
    assert np.abs(power + mu * r[:, 0] * slid).max() <= accuracy * size * speed


BALLS = [
    # q, μ, r: it sticks, slides, leaves; nothing rubs.
    ([-1.0, 0.2], 0.5, [0.5, -0.1], "stick"),
    ([-1.0, 3.0], 0.5, [0.5, -0.25], "slip"),
    ([1.0, 3.0], 0.5, [0.0, 0.0], "separated"),
    ([-1.0, 3.0], 0.0, [0.5, 0.0], "contact"),
    ([1.0, 0.0], 0.0, [0.0, 0.0], "separated"),
    ([-1.0, 0.12, -0.16], 0.5, [0.5, -0.06, 0.08], "stick"),
    ([-2.0, 3.0, 4.0], 0.5, [1.0, -0.3, -0.4], "slip"),
]


@pytest.mark.parametrize("q, mu, r, state", BALLS)
def test_a_ball_on_a_floor(q: list[float], mu: float, r: list[float], state: str) -> None:
    solution = signorini.solve_delassus(2 * np.eye(len(q)), q, friction=mu, dimension=len(q), tolerance=1e-10)
    np.testing.assert_allclose(solution.impulses, [r], atol=1e-9)
    assert solution.converged and list(solution.state) == [state] and solution.natural_map < 1e-9
    assert "converged" in repr(solution) and not solution.impulses.flags.writeable
    # Ten of them, in other units.
    many = signorini.solve_delassus(2e-9 * np.eye(10 * len(q)), np.tile(q, (10, 1)), friction=mu, dimension=len(q))
    np.testing.assert_allclose(many.impulses, np.tile(np.array(r) * 1e9, (10, 1)), atol=10.0)


def test_infinite_friction() -> None:
    solution = signorini.solve_delassus(2.0 * np.eye(4), [-1.0, 3.0, 1.0, 3.0], friction=np.inf, dimension=2)
    np.testing.assert_allclose(solution.impulses, [[0.5, -1.5], [0.0, 0.0]], atol=1e-9)
    assert solution.converged and solution.natural_map < 1e-9


@pytest.mark.parametrize("d", [2, 3])
def test_rows_of_q_are_contacts_in_either_order(d: int) -> None:
    W, rows = np.diag(np.arange(1.0, 2 * d + 1)), np.array([[-1.0, 3.0, 0.5], [-2.0, 0.1, 1.0]])[:, :d]
    place = np.concatenate([[0, d], np.delete(np.arange(2 * d), [0, d])])
    expected = signorini.solve_delassus(W, rows, friction=0.5, dimension=d)
    for q in (rows, rows.ravel()[place]):
        found = signorini.solve_delassus(W[np.ix_(place, place)], q, friction=0.5, dimension=d, order="blocks")
        np.testing.assert_allclose(found.impulses, expected.impulses, atol=1e-9)
    for wrong in (np.zeros((2, 5)), rows[None], 1.0):
        with pytest.raises(ValueError, match="q: expected a vector or an array of shape"):
            signorini.solve_delassus(W, wrong, friction=0.5, dimension=d)


@pytest.mark.parametrize("d", [2, 3])
def test_more_contacts_than_motions(d: int) -> None:
    made = packing(d)
    W, q, mu = made["W"], made["q"], 0.3
    assert np.linalg.matrix_rank(W) <= made["n"] < len(W)
    solution = signorini.solve_delassus(W, q, friction=mu, dimension=d, tolerance=1e-8)
    assert solution.converged and solution.natural_map < 1e-5
    assert (solution.impulses[:, 0] > 0).any() and {"slip"} <= set(solution.state)
    check(W, q, mu, solution, 1e-5)
    # The bodies themselves, as a problem from matrices, move the same way.
    row = np.arange(len(q))
    moved = fclib.Global(scipy.sparse.csr_array(made["M"]), scipy.sparse.csr_array(made["H"]), made["f"], 0.0 * q, np.full(made["m"], mu), d)
    v = moved.solve(tolerance=1e-8).u
    np.testing.assert_allclose((made["H"].T @ v)[row % d == 0], solution.velocities[:, 0], atol=1e-5)


@pytest.mark.parametrize("d", [2, 3])
def test_forms_of_w(d: int) -> None:
    made = packing(d, 8, 10, 3)
    W, q, n, m = made["W"], made["q"], len(made["q"]), made["m"]
    mu = np.linspace(0.1, 0.9, m)
    expected = signorini.solve_delassus(W, q, friction=mu, dimension=d, tolerance=1e-10)
    blocks = np.concatenate([np.arange(0, n, d), np.arange(n)[np.arange(n) % d > 0]])
    turned = W[np.ix_(blocks, blocks)]
    forms: list[tuple[Any, Any, dict[str, Any]]] = [
        (scipy.sparse.csr_array(W), q, {}),
        (scipy.sparse.csc_array(W), q.reshape(m, d), {}),
        (scipy.sparse.coo_array(W / 2) + scipy.sparse.coo_array(W / 2), q, {}),
        (lambda x: W @ x, q, {}),
        (lambda x: W @ x, q, {"diagonal": W.diagonal()}),
        (LinearOperator((n, n), matvec=lambda x: W @ x), q, {}),
        (turned, q[blocks], {"order": "blocks"}),
        (scipy.sparse.csc_array(turned), q[blocks], {"order": "blocks"}),
        (lambda x: turned @ x, q[blocks], {"order": "blocks", "diagonal": turned.diagonal()}),
    ]
    for form, free, keywords in forms:
        solution = signorini.solve_delassus(form, free, friction=mu, dimension=d, tolerance=1e-10, **keywords)
        np.testing.assert_allclose(solution.velocities, expected.velocities, atol=1e-7)


def test_manners() -> None:
    made = packing(3, 8, 10, 3)
    W, q = made["W"], made["q"]
    steps: list[signorini.Step] = []
    solution = signorini.solve_delassus(W, q, friction=0.3, callback=steps.append)
    assert len(steps) == solution.iterations and solution.products >= 1

    def fails(x: Any) -> Any:
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        signorini.solve_delassus(fails, q, friction=0.3, diagonal=1.0)
    # A matrix may do with one step, a product does not.
    once: dict[str, Any] = {"friction": 0.3, "diagonal": np.diag(W), "tolerance": 1e-12, "max_iterations": 1}
    with pytest.warns(signorini.NotConvergedWarning, match="iteration_limit"):
        signorini.solve_delassus(lambda x: W @ x, q, **once)
    with pytest.raises(signorini.SolveError) as caught:
        signorini.solve_delassus(lambda x: W @ x, q, **once, check=True)
    assert caught.value.solution.status == "iteration_limit"
    # A row will do for W x.
    assert signorini.solve_delassus(lambda x: (W @ x)[None], q, friction=0.3, diagonal=np.diag(W)).products >= 1
    unsymmetric = W.copy()
    unsymmetric[2, 5] += 1.0
    wrong: list[tuple[dict[str, Any], str]] = [
        ({"W": unsymmetric}, r"W: it is not symmetric: W\[2, 5\]"),
        ({"W": W[:3, :3]}, "W: q has 30 entries, and W is 3 × 3"),
        ({"W": lambda x: x[:3], "diagonal": 1.0}, r"W: it returns an array of shape \(3,\) for a vector of shape \(30,\)"),
        ({"W": lambda x: np.eye(30), "diagonal": 1.0}, r"W: it returns an array of shape \(30, 30\)"),
        ({"W": lambda x: np.nan * x}, "W: entry 0 of W x is nan"),
        ({"W": 1e-100 * np.eye(30)}, "the diagonal of W: entry 0 is 1e-100"),
        ({"W": -W}, "W is not positive semidefinite: its diagonal entry 0"),
        ({"q": q[:-1]}, "q: 29 entries are not a multiple of dimension = 3"),
        ({"q": np.where(np.arange(30) == 4, np.nan, q)}, "q: entry 4 is NaN"),
        ({"friction": [0.3]}, "friction: expected 10 entries, found 1"),
        ({"friction": -0.3}, r"μ\(0\) = -3e-1"),
        ({"dimension": 4}, "dimension: must be the integer 2 or 3, not 4"),
        ({"dimension": 3.0}, "dimension: must be the integer 2 or 3, not 3.0"),
        ({"order": "ours"}, 'order: must be "interleaved" or "blocks"'),
        ({"diagonal": 1.0}, "diagonal: W is a matrix and has its own"),
        ({"tol": 1e-3}, "tol: no solve has such a setting; did you mean tolerance"),
    ]
    for change, text in wrong:
        arguments: dict[str, Any] = {"W": W, "q": q, "friction": 0.3, **change}
        with pytest.raises(ValueError, match=text):
            signorini.solve_delassus(**arguments)


@pytest.mark.parametrize("d", [2, 3])
def test_files_of_fclib(d: int, tmp_path: Path) -> None:
    made = packing(d, 8, 10, 5)
    mu = np.full(made["m"], 0.4)
    path = tmp_path / "problem.hdf5"
    local = fclib.Local(scipy.sparse.csr_array(made["W"]), made["q"], mu, d, title="balls", description="of our own")
    solution = local.solve(tolerance=1e-9)
    fclib.write(path, local, solution)
    again = fclib.read(path)
    assert isinstance(again, fclib.Local) and (again.title, again.dimension) == ("balls", d)
    np.testing.assert_array_equal(again.W.toarray(), made["W"])
    np.testing.assert_array_equal(again.q, made["q"])
    np.testing.assert_array_equal(again.impulses, solution.impulses.ravel())
    np.testing.assert_array_equal(again.solve(tolerance=1e-9).impulses, solution.impulses)
    whole = fclib.Global(scipy.sparse.csr_array(made["M"]), scipy.sparse.csr_array(made["H"]), made["f"], 0.0 * made["q"], mu, d)
    moved = whole.solve(tolerance=1e-9)
    fclib.write(path, whole, moved)
    again = fclib.read(path)
    assert isinstance(again, fclib.Global)
    np.testing.assert_array_equal(again.H.toarray(), made["H"])
    np.testing.assert_array_equal(again.body_velocities, moved.u)
    np.testing.assert_allclose(again.velocities, solution.velocities.ravel(), atol=1e-6)


def test_other_forms_of_fclib(tmp_path: Path) -> None:
    """Matrices as triplets and in compressed rows; constraints, and files of something else, are refused."""
    W = scipy.sparse.coo_array(np.array([[2.0, 0.5], [0.5, 1.0]]))
    rows = W.tocsr()
    forms = {
        "triplets": (4, W.row, W.col, W.data),
        "rows": (-2, rows.indices, rows.indptr, rows.data),
    }
    for name, (nz, i, p, x) in forms.items():
        path = tmp_path / f"{name}.hdf5"
        with h5py.File(path, "w") as file:
            group = file.create_group("fclib_local")
            group["spacedim"] = [2]
            for key, value in {"m": [2], "n": [2], "nz": [nz], "nzmax": [4], "i": i, "p": p, "x": x}.items():
                group[f"W/{key}"] = value
            group["vectors/q"], group["vectors/mu"] = [-1.0, 0.0], [0.5]
        np.testing.assert_array_equal(fclib.read(path).W.toarray(), W.toarray())
        with h5py.File(path, "a") as file:
            file["fclib_local/V/m"] = [2]
        with pytest.raises(ValueError, match="fclib_local/V constrains the bodies"):
            fclib.read(path)
        with h5py.File(path, "a") as file:
            del file["fclib_local/V"]
            file["fclib_local/W/i"][0] = 10**8
        with pytest.raises(ValueError, match=f"{name}.hdf5: /fclib_local/W is no matrix of 2 x 2"):
            fclib.read(path)
        with h5py.File(path, "a") as file:
            del file["fclib_local/vectors/mu"]
            file["fclib_local/W/i"][0] = 0
        with pytest.raises(ValueError, match=f"{name}.hdf5: /fclib_local/vectors has no mu"):
            fclib.read(path)
    dense = fclib.Local(W.toarray(), np.array([-1.0, 0.0]), np.array([0.5]), 2)
    fclib.write(tmp_path / "dense.hdf5", dense)
    np.testing.assert_array_equal(fclib.read(tmp_path / "dense.hdf5").W.toarray(), W.toarray())
    with h5py.File(tmp_path / "other.hdf5", "w") as file:
        file["something"] = [1]
    with pytest.raises(ValueError, match="neither fclib_local nor fclib_global, but something"):
        fclib.read(tmp_path / "other.hdf5")
    with pytest.raises(OSError):
        fclib.read(tmp_path / "nothing.hdf5")
