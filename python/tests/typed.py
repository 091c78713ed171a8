"""A program that uses the package, for mypy."""

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

import signorini


def pressure(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return 1e6 * (1.0 + points[:, 0])


def stop(step: signorini.Step) -> bool:
    return step.err > 1e-3


mesh: signorini.Mesh = signorini.rectangle([3, 1], [12, 4], order=2)
model = signorini.Model(mesh).material(young=2.1e11, poisson=0.3).support("left", x=0, y="0 * x")
model.traction("top", pressure=pressure, factors=[1.0])
model.contact("bottom", obstacle={"half_plane": {"point": [0, 0], "normal": [0, 1]}}, friction={"coulomb": 0.3})
solution: signorini.Solution = model.steps([1.0]).solve(callback=stop, check=True)
u: NDArray[np.float64] = solution.u
contact: signorini.Contact = solution.contacts["bottom"]
force: float = contact.normal_force
worst: float = solution.kkt.max()
steps: list[signorini.LoadStep] = solution.steps
problem: signorini.Problem = model.build()
case: signorini.Case = signorini.Case.read("press.toml", {"solver.tolerance": 1e-8})
K = scipy.sparse.identity(2, format="csr")
springs: signorini.Solution = signorini.solve(K, [0.0, 1.0], normal=[[0.0, 1.0]], gap=1.0)
try:
    springs.write("out", plots=True)
except (signorini.ModelError, signorini.SolveError) as error:
    print(error)
