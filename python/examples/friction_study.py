"""Twenty coefficients of friction on one factor, and a plot: how much of a push friction carries."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import numpy as np  # noqa: E402

import signorini  # noqa: E402

model = signorini.Model(signorini.rectangle([3, 1], [60, 20]))
model.material(young=2e9, poisson=0.3)
model.support("left", x=0, y=0)
model.traction("top", pressure=1e6)
model.traction("right", x=5e5)
model.contact("bottom", obstacle={"half_plane": {"point": [0, 0], "normal": [0, 1]}}, friction={"coulomb": 0.05})

# %% Built once: K is assembled and factorised once, and products made for one coefficient are known to the next
problem = model.build()
coefficients = np.linspace(0.0, 0.95, 20)
carried, slipping, products = [], [], []
for mu in coefficients:
    solution = problem.solve(friction=float(mu), stiffness="cholesky", check=True)
    contact = solution.contacts["bottom"]
    carried.append(-contact.tangential_force)
    slipping.append(np.mean(contact.state == "slip"))
    products.append(solution.products)
print("products with A:", products)
carried = np.abs(carried)
assert carried[0] < 1e-6 and np.all(np.diff(carried) > -1e-3 * carried.max())
# From the second solve on they profit from the products of earlier ones.
assert np.mean(products[1:]) < products[0]

# %% The plot
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.5))
left.plot(coefficients, carried / 5e5, "o-")
left.set(xlabel="coefficient of friction", ylabel="friction / push")
right.plot(coefficients, slipping, "o-")
right.set(xlabel="coefficient of friction", ylabel="part of the places that slips")
figure.tight_layout()
figure.savefig("friction.png", dpi=120)
