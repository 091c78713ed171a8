"""A row of the paper's Table 1 from matrices of SciPy.

A steel beam, 3 × 1, clamped on the left, pressed on a rigid foundation with Tresca friction: bilinear squares, assembled here
by hand. The paper prints n = 1320, m = 60 and 7 outer steps with 35 products with A for this row (β = 1).
"""

import numpy as np
import scipy.sparse

import signorini

K_REFINED = 1
YOUNG, POISSON = 21.19e10, 0.277
BOUND = 2e6  # Pa

# %% The mesh: nodes row by row from the bottom, 60 k × 10 k squares
nx, ny = 60 * K_REFINED, 10 * K_REFINED
h = 3.0 / nx
x, y = (a.ravel() for a in np.meshgrid(h * np.arange(nx + 1), h * np.arange(ny + 1)))
corner = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
cells = np.stack([corner, corner + 1, corner + nx + 2, corner + nx + 1], axis=1)

# %% The stiffness matrix of a square, by 2 × 2 points of Gauss, is that of all
elasticity = np.array([[1 - POISSON, POISSON, 0], [POISSON, 1 - POISSON, 0], [0, 0, (1 - 2 * POISSON) / 2]])
elasticity *= YOUNG / ((1 + POISSON) * (1 - 2 * POISSON))
signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
square = np.zeros((8, 8))
for s, t in signs / np.sqrt(3):
    dx = signs[:, 0] * (1 + signs[:, 1] * t) / (2 * h)
    dy = signs[:, 1] * (1 + signs[:, 0] * s) / (2 * h)
    strain = np.zeros((3, 8))
    strain[0, 0::2] = strain[2, 1::2] = dx
    strain[1, 1::2] = strain[2, 0::2] = dy
    square += strain.T @ elasticity @ strain * h * h / 4
unknowns = (2 * cells[:, :, None] + np.arange(2)).reshape(len(cells), 8)
rows, cols = np.repeat(unknowns, 8, axis=1).ravel(), np.tile(unknowns, 8).ravel()
K = scipy.sparse.coo_array((np.tile(square.ravel(), len(cells)), (rows, cols))).tocsr()

# %% Loads on the top and on the right side, by two points of Gauss on each edge
f = np.zeros(2 * len(x))


def load(nodes, traction):
    for a, b in zip(nodes[:-1], nodes[1:]):
        for s in np.array([-1, 1]) / np.sqrt(3):
            weights = np.array([1 - s, 1 + s]) / 2
            place = weights @ np.array([(x[a], y[a]), (x[b], y[b])])
            for node, weight in zip((a, b), weights):
                f[2 * node : 2 * node + 2] += weight * h / 2 * np.array(traction(*place))


load(np.flatnonzero(y == y.max()), lambda x, y: (0.0, -6e7 - 1e7 / 3 * x))
load(np.flatnonzero(x == x.max()), lambda x, y: (2e7, 4e7 - 2e7 * y))

# %% The left side is clamped; every other node of the bottom may touch, and carries the length around it
free = np.repeat(x > 0, 2)
bottom = np.flatnonzero((y == 0) & (x > 0))
lengths = np.where(bottom == bottom[-1], h / 2, h)
m = len(bottom)
normal = scipy.sparse.csr_array((-np.ones(m), (np.arange(m), 2 * bottom + 1)), shape=(m, len(f)))
tangential = scipy.sparse.csr_array((np.ones(m), (np.arange(m), 2 * bottom)), shape=(m, len(f)))



def problem():
    return signorini.Problem(
        K[free][:, free],
        f[free],
        normal=normal[:, free],
        tangential=tangential[:, free],
        slip_bound=BOUND * lengths,
        coordinates=np.stack([x, y], axis=1)[x > 0],
    )


print(problem())
assert (problem().n, problem().m) == (1320, 60)

# %% The algorithm as printed, and on a surrogate of A: steps and products until the optimality conditions, checked against K,
# are met to 10 ε. (The paper stops earlier, at err ≤ ε err⁰. Solves of one problem know the products of those before: here
# each has its own.)
for method, expected in {"inexact": (9, 41), "multisecant": (10, 10)}.items():
    solution = problem().solve(tolerance=1e-4, method=method, stiffness="cholesky", check=True)
    print(f"{method:12} iter/n_A = {solution.iterations}/{solution.products} (paper: 7/35); {solution.kkt.max():.0e} off at most")
    assert (solution.iterations, solution.products) == expected
    assert solution.history["err"][-1] <= 1e-4 and solution.kkt.max() <= 1e-3
