#!/usr/bin/env python3
"""Writes the matrices of block.toml: an elastic block fixed to a wall, on a rigid foundation.

    python3 make.py

    minimise  1/2 u'Ku - f'u + g'|Tu|   subject to   Nu <= d

Bilinear quadrilaterals, plane strain; needs NumPy only. Units: m, N, Pa.
"""

from pathlib import Path

import numpy as np

HERE = Path(__file__).parent

LENGTH, HEIGHT, THICKNESS = 0.2, 0.06, 0.01
CELLS_X, CELLS_Y = 10, 3
YOUNG, POISSON = 2.1e11, 0.3
PRESSURE = 3e7  # on the top
PULL = 2e7  # on the right side, outwards (x)
LIFT = 3e7  # on the right side, upwards (y)
CURVATURE = 5e-5  # the foundation falls away as CURVATURE x^2
TRESCA = 1e7  # slip bound, wherever the node is: Tresca's law takes no notice of the pressure

# Nodes row by row from the bottom; the unknowns of node i are 2i (x) and 2i + 1 (y).
xs, ys = np.linspace(0, LENGTH, CELLS_X + 1), np.linspace(0, HEIGHT, CELLS_Y + 1)
nodes = np.array([(x, y) for y in ys for x in xs])


def number(i, j):
    return j * (CELLS_X + 1) + i


def element_stiffness(hx, hy):
    """8 x 8 stiffness of a rectangle, corners counter-clockwise, by 2 x 2 Gauss points."""
    nu = POISSON
    elasticity = (YOUNG / ((1 + nu) * (1 - 2 * nu))) * np.array(
        [[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]]
    )
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    stiffness = np.zeros((8, 8))
    for s, t in corners / np.sqrt(3):
        dx = corners[:, 0] * (1 + corners[:, 1] * t) / (2 * hx)  # of the shape functions
        dy = corners[:, 1] * (1 + corners[:, 0] * s) / (2 * hy)
        strain = np.zeros((3, 8))
        strain[0, 0::2] = strain[2, 1::2] = dx
        strain[1, 1::2] = strain[2, 0::2] = dy
        stiffness += strain.T @ elasticity @ strain * (THICKNESS * hx * hy / 4)
    return stiffness


def lumped(points):
    """The length that belongs to each of the points of a line."""
    lengths = np.zeros(len(points))
    halves = np.diff(points) / 2
    lengths[:-1] += halves
    lengths[1:] += halves
    return lengths


# Stiffness and load of all nodes.
K = np.zeros((2 * len(nodes), 2 * len(nodes)))
k = element_stiffness(LENGTH / CELLS_X, HEIGHT / CELLS_Y)
for j in range(CELLS_Y):
    for i in range(CELLS_X):
        corners = [number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)]
        unknowns = np.array([(2 * c, 2 * c + 1) for c in corners]).ravel()
        K[np.ix_(unknowns, unknowns)] += k
f = np.zeros(2 * len(nodes))
for i, length in enumerate(lumped(xs)):
    f[2 * number(i, CELLS_Y) + 1] -= PRESSURE * length * THICKNESS
for j, length in enumerate(lumped(ys)):
    f[2 * number(CELLS_X, j)] += PULL * length * THICKNESS
    f[2 * number(CELLS_X, j) + 1] += LIFT * length * THICKNESS

# The wall holds the nodes at x = 0: their rows and columns are left out.
kept = [number(i, j) for j in range(CELLS_Y + 1) for i in range(1, CELLS_X + 1)]
unknowns = np.array([(2 * c, 2 * c + 1) for c in kept]).ravel()
K, f = K[np.ix_(unknowns, unknowns)], f[unknowns]

# The other nodes of the bottom may touch the foundation: normals point to it, tangents along +x.
bottom = [kept.index(number(i, 0)) for i in range(1, CELLS_X + 1)]
N, T = np.zeros((len(bottom), len(f))), np.zeros((len(bottom), len(f)))
for row, node in enumerate(bottom):
    N[row, 2 * node + 1] = -1
    T[row, 2 * node] = 1
d = CURVATURE * xs[1:] ** 2
g = TRESCA * THICKNESS * lumped(xs)[1:]  # a force at each node


def write_sparse(name, matrix, symmetric=False):
    """Coordinate form, counted from 1; of a symmetric matrix the lower triangle."""
    rows, columns = np.nonzero(np.tril(matrix) if symmetric else matrix)
    with open(HERE / name, "w") as file:
        kind = "symmetric" if symmetric else "general"
        file.write(f"%%MatrixMarket matrix coordinate real {kind}\n")
        file.write(f"{matrix.shape[0]} {matrix.shape[1]} {len(rows)}\n")
        for i, j in zip(rows, columns):
            file.write(f"{i + 1} {j + 1} {matrix[i, j]:.15g}\n")


def write_dense(name, array):
    """Array form, column by column."""
    array = array.reshape(len(array), -1)
    with open(HERE / name, "w") as file:
        file.write("%%MatrixMarket matrix array real general\n")
        file.write(f"{array.shape[0]} {array.shape[1]}\n")
        for value in array.T.ravel():
            file.write(f"{value:.15g}\n")


K[np.abs(K) < 1e-9 * np.abs(K).max()] = 0  # what is left of terms that cancel
write_sparse("K.mtx", (K + K.T) / 2, symmetric=True)
write_dense("f.mtx", f)
write_sparse("N.mtx", N)
write_sparse("T.mtx", T)
write_dense("d.mtx", d)
write_dense("g.mtx", g)
write_dense("x.mtx", nodes[kept])
print(f"{len(f)} unknowns, {len(bottom)} contact nodes")
