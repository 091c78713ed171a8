"""Two bodies in space, drawn and meshed with Gmsh from Python; a picture with PyVista.

A ring is pressed on a plate and turned. Both are drawn for themselves, so that Gmsh does not weld them together.
"""

from pathlib import Path

import gmsh
import numpy as np

import signorini

gmsh.initialize(["", "-v", "1"])
gmsh.model.add("ring on a plate")
occ = gmsh.model.occ
plate = occ.addBox(-2, -2, -1, 4, 4, 1)
tube = occ.addCylinder(0, 0, 0, 0, 0, 1, 1.2)
hole = occ.addCylinder(0, 0, 0, 0, 0, 1, 0.7)
ring = occ.cut([(3, tube)], [(3, hole)])[0][0][1]
occ.synchronize()


def surface(volume, height, name):
    """Names the horizontal surface of a volume at a height."""
    for _, tag in gmsh.model.getBoundary([(3, volume)], oriented=False):
        low, high = np.split(np.array(gmsh.model.getBoundingBox(2, tag)), 2)
        if abs(low[2] - height) < 1e-3 and abs(high[2] - height) < 1e-3:
            gmsh.model.addPhysicalGroup(2, [tag], name=name)


for volume, name, low, high in ((plate, "plate", -1, 0), (ring, "ring", 0, 1)):
    gmsh.model.addPhysicalGroup(3, [volume], name=name)
    surface(volume, low, f"{name}-bottom")
    surface(volume, high, f"{name}-top")
gmsh.option.setNumber("Mesh.MeshSizeMax", 0.3)
gmsh.model.mesh.generate(3)
gmsh.write("ring.msh")
gmsh.finalize()

# %% Pressed by 1000 N, then turned by 0.002
mesh = signorini.Mesh.read("ring.msh")
print(mesh)
axis = {"point": [0, 0, 0], "direction": [0, 0, 1]}
model = signorini.Model(mesh, title="A ring on a plate")
model.material("plate", young=2e5, poisson=0.3)
model.material("ring", young=5e4, poisson=0.35)
model.support("plate-bottom", x=0, y=0, z=0)
model.support("ring-top", radial=0, hoop=lambda x: 2e-3 * np.hypot(x[:, 0], x[:, 1]), axis=axis, factors=[0, 1])
model.traction("ring-top", force=[0, 0, -1000])
model.contact("ring-bottom", "plate-top", friction={"coulomb": 0.2})
solution = model.steps([1, 1]).solve(check=True)
print(solution)

contact = solution.contacts["ring-bottom"]
torque = contact.moment[2]
print(f"normal force {contact.normal_force:.2f}, torque {torque:.2f}, {np.sum(contact.state == 'slip')} places slip")
assert abs(contact.normal_force - 1000) < 0.1
# No more than friction can bear: μ N times the outer radius.
assert 0 < abs(torque) < 0.2 * 1000 * 1.2

# %% A picture, and files for ParaView
import pyvista  # noqa: E402

grid = solution.to_pyvista()
grid["size of u"] = np.linalg.norm(grid["displacement"], axis=1)
plotter = pyvista.Plotter(off_screen=True, window_size=[900, 700])
plotter.add_mesh(grid.warp_by_vector("displacement", factor=200.0), scalars="size of u", show_edges=True)
plotter.camera_position = "iso"
plotter.screenshot("ring.png")
assert Path("ring.png").stat().st_size > 10_000
files = solution.write("ring-out")
print(*files)
