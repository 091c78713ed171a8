"""CPU against GPU: the same problem on the factor, by PCG on the CPU, and by PCG on a GPU, if there is an adapter.

Answers are accurate to f64 in any case, in whichever precision a GPU computes.
"""

import time

import numpy as np

import signorini

model = signorini.Model(signorini.box([3, 1, 1], [24, 8, 8]))
model.material(young=2.1e11, poisson=0.3)
model.support("left", x=0, y=0, z=0)
model.traction("top", z="-2e7 * max(0, 1 - x / 1.5)", pressure=1e6)
ground = {"half_space": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
model.contact("bottom", obstacle=ground, friction={"tresca": 3e6})
problem = model.build()
print(problem)

# %% Each path with its own factor or hierarchy; the second solve has it already
expected = None
for name, keywords in {
    "factor": {"stiffness": "cholesky"},
    "PCG, CPU": {"stiffness": "pcg", "backend": "cpu"},
    "PCG, GPU": {"stiffness": "pcg", "backend": "gpu"},
    "PCG, GPU, f32": {"stiffness": "pcg", "backend": "gpu", "precision": "f32"},
}.items():
    try:
        begin = time.perf_counter()
        solution = problem.solve(**keywords, check=True)
        seconds = time.perf_counter() - begin
    except signorini.SolveError as error:
        print(f"{name:14} not here: {error}")
        continue
    expected = solution.u if expected is None else expected
    off = np.abs(solution.u - expected).max() / np.abs(expected).max()
    adapter = solution.report["adapter"] or ""
    print(f"{name:14} {seconds:6.2f} s, {solution.products} products, {off:.0e} off {adapter}")
    assert off < 1e-5
