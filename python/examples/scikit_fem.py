"""A model of scikit-fem with contact: its mesh, its stiffness matrix, its load; contact from here.

A half disc of radius 1 is pressed on a rigid plane. The arrays of the solution are printed beside Hertz's formula for
cylinders.
"""

import numpy as np
import scipy.sparse
import skfem
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

import signorini

YOUNG, POISSON, RADIUS, FORCE = 2e5, 0.3, 1.0, 400.0

# %% A lower half disc, fine where it will touch
mesh = skfem.MeshTri.init_circle(4)
mesh = mesh.restrict(lambda x: x[1] < 0).refined(1)
for size in (0.3, 0.15, 0.08):
    near = np.flatnonzero(np.hypot(mesh.p[0, mesh.t].mean(axis=0), mesh.p[1, mesh.t].mean(axis=0) + 1) < size)
    mesh = mesh.refined(near)
# Refinement leaves new nodes on chords: back to the circle with them.
rim = np.unique(mesh.facets[:, mesh.boundary_facets()])
rim = rim[mesh.p[1, rim] < -1e-9]
places = mesh.p.copy()
places[:, rim] /= np.linalg.norm(places[:, rim], axis=0)
mesh = skfem.MeshTri(places, mesh.t)

# %% K and f as scikit-fem makes them
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP1()))
K = linear_elasticity(*lame_parameters(YOUNG, POISSON)).assemble(basis)
top = mesh.facets_satisfying(lambda x: np.abs(x[1]) < 1e-9)


@skfem.LinearForm
def weight(v, w):
    return dot(np.array([0.0, -FORCE / 2])[:, None, None] * np.ones_like(w.x), v)


f = weight.assemble(skfem.FacetBasis(mesh, skfem.ElementVector(skfem.ElementTriP1()), facets=top))

# %% Where nodes of the rim may touch the plane y = −1, and how far they are from it
touching = rim[(mesh.p[1, rim] < -0.9)]
m = len(touching)

normal = scipy.sparse.csr_array((-np.ones(m), (np.arange(m), basis.nodal_dofs[1, touching])), shape=(m, basis.N))
# Nothing else holds the body: its rigid motions are found by the coordinates, and it does not move where nothing pushes it.
problem = signorini.Problem(K, f, normal=normal, gap=mesh.p[1, touching] + 1.0, coordinates=mesh.p.T)
solution = problem.solve(check=True)
u = solution.u
print(solution)

# %% The whole force arrives, and the contact has the width of Hertz's theory
force = solution.lambda_normal.sum()
half_width = np.abs(mesh.p[0, touching[solution.lambda_normal > 0]]).max()
hertz = np.sqrt(4 * FORCE * RADIUS * (1 - POISSON**2) / (np.pi * YOUNG))
print(f"force {force:.6g} of {FORCE}, half width {half_width:.4f} (Hertz {hertz:.4f}), sunk by {-u[basis.nodal_dofs[1]].min():.5f}")
assert abs(force / FORCE - 1) < 1e-5
assert abs(half_width - hertz) < 0.02

# %% The same from a model: the mesh of scikit-fem, everything else in words
model = signorini.Model(signorini.Mesh.from_skfem(mesh, {"top": top, "rim": mesh.facets_satisfying(lambda x: x[1] < -0.5, boundaries_only=True)}))
model.material(young=YOUNG, poisson=POISSON)
model.support(point=[0, 0], x=0).support(point=[0, -1], x=0)
model.traction("top", force=[0, -FORCE])
model.contact("rim", obstacle={"half_plane": {"point": [0, -1], "normal": [0, 1]}})
contact = model.solve(check=True).contacts["rim"]
print(contact)
assert abs(contact.normal_force / FORCE - 1) < 1e-5
highest = np.sqrt(FORCE * YOUNG / (np.pi * RADIUS * (1 - POISSON**2)))
print(f"highest pressure {contact.pressure.max():.0f} (Hertz {highest:.0f})")
assert abs(contact.pressure.max() / highest - 1) < 0.05
