"""Models: the tables of a case file for bodies, in Python."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from . import _arrays, _native, _toml
from ._mesh import Mesh
from ._problem import Problem, _built
from ._solution import Solution

# A number, an expression of x, y (and z), a value for each node, or a function of the nodes (n, d).
Quantity: TypeAlias = float | str | Sequence[float] | NDArray[Any] | Callable[[NDArray[np.float64]], Any]
Names: TypeAlias = str | Sequence[str]


class Model:
    """Elastic bodies in contact: a mesh and its model.

    Keyword arguments are the keys of case files (explained in docs/case-file.md; most have ``name``), and each method
    returns the model, so that calls may be chained. Arguments are copied. A fault of an argument by itself is reported at
    once, a fault that depends on the mesh when the model is built.

    A *quantity* is a number; an expression such as ``"-2e7 * (1 - x / 1.5)"``; an array with a value for each row of
    ``mesh.points``; or a function that is called once with these points, (n, d), and returns such an array or a number.
    Between nodes, arrays and functions are interpolated by the shape functions of the facets or elements that they act on.

    Parameters
    ----------
    mesh : Mesh
    title : str
        Names the model in reports and pictures.
    """

    def __init__(self, mesh: Mesh, title: str = "") -> None:
        if not isinstance(mesh, Mesh):
            raise ValueError(f"mesh: expected a signorini.Mesh, found {type(mesh).__name__}")
        self.mesh = mesh
        self.title = title
        self._tables: list[tuple[str, dict[str, Any]]] = []
        self._once: dict[str, dict[str, Any]] = {}

    def add(self, table: str, **entries: Any) -> Model:
        """Add a table of a case file that may occur several times, such as ``"support"``, with its keys."""
        made = {name: self._entry(name, value) for name, value in entries.items() if value is not None}
        _native.check_tables(_toml.table(f"[[{_toml.key(table)}]]", made), self.mesh.dim)
        self._tables.append((table, made))
        return self

    def _say(self, table: str, **entries: Any) -> Model:
        """Set, or set again, a table that occurs once in a case file."""
        made = {name: self._entry(name, value) for name, value in entries.items() if value is not None}
        made = self._once.get(table, {}) | made
        _native.check_tables(_toml.table(f"[{_toml.key(table)}]", made), self.mesh.dim)
        self._once[table] = made
        return self

    def _entry(self, name: str, value: Any) -> Any:
        """A copy of a value, with its functions of the place replaced by their values at the nodes."""
        if isinstance(value, Mapping):
            return {key: self._entry(f"{name}.{key}", one) for key, one in value.items()}
        if not callable(value):
            return copy.deepcopy(value) if isinstance(value, (list, tuple, np.ndarray)) else value
        points = self.mesh.points
        made = value(points)
        _arrays.unmasked(name, made)
        made = np.asarray(made)
        if made.ndim == 0:
            made = np.broadcast_to(made, (len(points),))
        if made.shape != (len(points),):
            raise ValueError(
                f"{name}: the function was given {len(points)} points and returned an array of shape {made.shape} "
                f"instead of ({len(points)},)"
            )
        if made.dtype.kind not in "fiu":
            raise ValueError(f"{name}: the function returned an array of dtype {made.dtype} instead of real numbers")
        return made.astype(np.float64)

    def material(
        self,
        region: Names | None = None,
        *,
        young: float | None = None,
        poisson: float | None = None,
        density: float | None = None,
        incompressible: bool | str | None = None,
        incompatible_modes: bool | None = None,
        expansion: float | None = None,
        thickness: float | None = None,
        **more: Any,
    ) -> Model:
        """Give a region, several regions or all of them a material: E (`young`) in Pa, ν (`poisson`), `density` in kg/m³,
        `expansion` in 1/K, and in the plane the `thickness` of its bodies in m."""
        entries: dict[str, Any] = {"young": young, "poisson": poisson, "density": density}
        entries |= {"incompressible": incompressible, "incompatible_modes": incompatible_modes}
        entries |= {"expansion": expansion, "thickness": thickness}
        return self.add("material", region=region, **entries, **more)

    def support(
        self,
        boundary: Names | None = None,
        *,
        nodes: Names | None = None,
        point: Sequence[float] | None = None,
        x: Quantity | None = None,
        y: Quantity | None = None,
        z: Quantity | None = None,
        directions: Sequence[Sequence[float]] | None = None,
        radial: Quantity | None = None,
        hoop: Quantity | None = None,
        axial: Quantity | None = None,
        axis: Mapping[str, Sequence[float]] | None = None,
        symmetry: bool | None = None,
        factors: Sequence[float] | None = None,
        active: Sequence[float] | None = None,
        lock: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Prescribe displacements in m on boundaries, on sets of `nodes`, or at the node nearest to a `point`; omitted
        directions are free. `directions` are those of x, y (and z), perpendicular to each other, in place of the axes. `active` is 1
        for each load step, or 0 where the nodes are free; `lock` is 1 where they stay where the step before has left them, and 0 in
        the first step."""
        along = {"x": x, "y": y, "z": z, "directions": directions}
        around = {"radial": radial, "hoop": hoop, "axial": axial, "axis": axis}
        where = {"boundary": boundary, "nodes": nodes, "point": point}
        by_step = {"factors": factors, "active": active, "lock": lock}
        return self.add("support", **where, **along, **around, symmetry=symmetry, **by_step, **more)

    def foundation(
        self,
        boundary: Names,
        *,
        stiffness: Mapping[str, Quantity] | None = None,
        **more: Any,
    ) -> Model:
        """Put boundaries on an elastic foundation: `stiffness` is ``{"normal": 1e8, "tangential": 1e7}`` in Pa/m, a quantity each."""
        return self.add("foundation", boundary=boundary, stiffness=stiffness, **more)

    def traction(
        self,
        boundary: Names | None = None,
        *,
        x: Quantity | None = None,
        y: Quantity | None = None,
        z: Quantity | None = None,
        pressure: Quantity | None = None,
        force: Sequence[float] | None = None,
        radial: Quantity | None = None,
        hoop: Quantity | None = None,
        axial: Quantity | None = None,
        torque: float | None = None,
        axis: Mapping[str, Sequence[float]] | None = None,
        factors: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Add forces in Pa on boundaries, a resultant `force` in N, or a `torque` in N m about an `axis`."""
        along = {"x": x, "y": y, "z": z, "radial": radial, "hoop": hoop, "axial": axial, "axis": axis}
        whole = {"pressure": pressure, "force": force, "torque": torque, "factors": factors}
        return self.add("traction", boundary=boundary, **along, **whole, **more)

    def force(
        self,
        boundary: Names | None = None,
        *,
        nodes: Names | None = None,
        point: Sequence[float] | None = None,
        x: Quantity | None = None,
        y: Quantity | None = None,
        z: Quantity | None = None,
        factors: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Add forces in N on each node of boundaries or of sets of `nodes`, or on the node nearest to a `point`."""
        where = {"boundary": boundary, "nodes": nodes, "point": point}
        return self.add("force", **where, x=x, y=y, z=z, factors=factors, **more)

    def body_force(
        self,
        region: str | None = None,
        *,
        x: Quantity | None = None,
        y: Quantity | None = None,
        z: Quantity | None = None,
        factors: Sequence[float] | None = None,
        displaced: bool | None = None,
        **more: Any,
    ) -> Model:
        """Add forces in N/m³ in a region, or in all of them; with large displacements and `displaced`, expressions of where the body is."""
        components = {"x": x, "y": y, "z": z}
        return self.add("body_force", region=region, **components, factors=factors, displaced=displaced, **more)

    def temperature(
        self,
        value: Quantity,
        region: str | None = None,
        *,
        factors: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Set by how many K a region, or all of them, is warmer than in its stress-free state."""
        return self.add("temperature", value=value, region=region, factors=factors, **more)

    def contact(
        self,
        boundary: Names,
        against: Names | None = None,
        *,
        obstacle: Mapping[str, Mapping[str, Any]] | None = None,
        friction: Mapping[str, Quantity] | str | None = None,
        gap: Quantity | None = None,
        interference: Quantity | None = None,
        overlap: str | None = None,
        exclude: Sequence[Sequence[Names]] | None = None,
        stiffness: Mapping[str, Quantity] | None = None,
        adjust: float | None = None,
        edge_angle: float | None = None,
        search_distance: float | None = None,
        active: Sequence[float] | None = None,
        friction_factors: Sequence[float] | None = None,
        wear: Mapping[str, float] | None = None,
        **more: Any,
    ) -> Model:
        """Add contact of a boundary, which carries the contact forces, with another one or a rigid obstacle.

        Parameters
        ----------
        boundary, against : str or list of str
            The same on both sides may meet itself: any part of it any other.
        obstacle : dict; optional
            Instead of `against`, such as ``{"half_plane": {"point": [0, 0], "normal": [0, 1]}}``.
        friction : dict; optional
            ``{"coulomb": 0.3}``, or ``{"tresca": 2e6}`` in Pa; a quantity each, infinite where it never slips.
        gap, interference : quantity; optional
            In m, instead of the distance of the meshes. A gap is infinite where there is no obstacle.
        overlap : {"interference", "touching"}; optional
            An overlap of the meshes is intended and pressed apart, or comes from the drawing and counts as touching.
        exclude : list of pairs of str or list of str; optional
            Where boundaries meet themselves: those that do not meet each other. What ties and other contacts join is left to them without this.
        stiffness : dict; optional
            ``{"normal": 1e12, "tangential": 1e11}`` in Pa/m, for compliant contact; a quantity each.
        adjust, edge_angle, search_distance : float; optional
        active, friction_factors : list of float; optional
            One for each load step: 1 or, where it has no effect, 0; what the bound or the coefficient of friction is multiplied by.
        wear : dict; optional
            ``{"coefficient": 1e-14}`` in 1/Pa, the volume worn off over force and slip: gaps grow from cycle to cycle (`steps`).
        """
        law: dict[str, Any] = {"obstacle": obstacle, "friction": friction, "gap": gap, "interference": interference}
        law |= {"overlap": overlap, "exclude": exclude, "stiffness": stiffness}
        numbers = {"adjust": adjust, "edge_angle": edge_angle, "search_distance": search_distance}
        by_step = {"active": active, "friction_factors": friction_factors, "wear": wear}
        return self.add("contact", boundary=boundary, against=against, **law, **numbers, **by_step, **more)

    def tie(
        self,
        boundary: Names,
        against: Names,
        *,
        adjust: float | None = None,
        edge_angle: float | None = None,
        active: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Hold boundaries of two bodies together in every direction; their meshes need not match. `active` is 1 or 0 for each load step."""
        entries = {"adjust": adjust, "edge_angle": edge_angle, "active": active}
        return self.add("tie", boundary=boundary, against=against, **entries, **more)

    def equal(self, sets: Names, *, directions: Names | None = None, **more: Any) -> Model:
        """Make all nodes of a set move alike, along these axes (default: all); several sets move independently."""
        return self.add("equal", sets=sets, directions=directions, **more)

    def spring(
        self,
        boundary: Names | None = None,
        *,
        nodes: Names | None = None,
        point: Sequence[float] | None = None,
        to: Mapping[str, Any] | None = None,
        stiffness: float | None = None,
        direction: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Add a spring in N/m from a boundary, sets of `nodes` or a `point` to another such place (``to={"point": [1, 2]}``), or to the
        ground along a `direction`."""
        where = {"boundary": boundary, "nodes": nodes, "point": point, "to": to}
        return self.add("spring", **where, stiffness=stiffness, direction=direction, **more)

    def preload(
        self,
        boundary: Names | None = None,
        *,
        plane: Mapping[str, Sequence[float]] | None = None,
        region: Names | None = None,
        force: float | None = None,
        shortening: float | None = None,
        factors: Sequence[float] | None = None,
        lock: bool | Sequence[int] | None = None,
        **more: Any,
    ) -> Model:
        """Tighten a bolt by a `force` in N or a `shortening` in m, at a surface within it or near a plane
        (``plane={"point": [0, 30], "normal": [0, 1]}``) through a `region`. With `lock` it stays as short as the largest force makes it."""
        entries: dict[str, Any] = {"plane": plane, "region": region, "force": force, "shortening": shortening}
        return self.add("preload", boundary=boundary, **entries, factors=factors, lock=lock, **more)

    def coupling(
        self,
        boundary: Names | None = None,
        *,
        point: Sequence[float],
        nodes: Names | None = None,
        contacts: Names | None = None,
        kind: str | None = None,
        free: Names | None = None,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        rx: float | None = None,
        ry: float | None = None,
        rz: float | None = None,
        force: Sequence[float] | None = None,
        moment: float | Sequence[float] | None = None,
        factors: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Make the nodes of boundaries, or of sets of `nodes`, move with a `point`: as a rigid body, except along the axes in `free`, or freely,
        on average (`kind` "distributing"). Displacements of the point in m, rotations in rad, a `force` in N and a `moment` in N m; omitted
        motions are free. The rigid obstacles of `contacts`, by their names, move with the point. Without `boundary`
        and `nodes` they are a free rigid body, whose d + 1 nodes are at the end of `u`."""
        where = {"boundary": boundary, "nodes": nodes, "contacts": contacts, "point": point, "kind": kind, "free": free}
        motions = {"x": x, "y": y, "z": z, "rx": rx, "ry": ry, "rz": rz}
        return self.add("coupling", **where, **motions, force=force, moment=moment, factors=factors, **more)

    def cyclic(self, low: Names, high: Names, axis: Mapping[str, Any], sectors: int, **more: Any) -> Model:
        """Repeat the sector from the boundary `low` to `high` about an axis (``axis={"point": [0, 0]}``, in space
        with a direction). As many sectors make the whole body, and the meshes of both sides need not match. Files and pictures
        show all of them with ``whole=True``."""
        return self.add("cyclic", low=low, high=high, axis=axis, sectors=sectors, **more)

    def equation(
        self,
        terms: Sequence[Mapping[str, Any]],
        *,
        value: float | None = None,
        factors: Sequence[float] | None = None,
        **more: Any,
    ) -> Model:
        """Make a sum of displacements equal to a `value` in m (default: 0). A term has factors along the axes, of the
        node nearest to a point (``{"point": [2, 0], "x": 1}``) or of sets of nodes (``{"nodes": "right", "x": 1}``).
        Sets make an equation for each of their nodes, in the order of the mesh."""
        return self.add("equation", terms=terms, value=value, factors=factors, **more)

    def steps(self, factors: Sequence[float], *, cycles: int | None = None, jump: float | None = None) -> Model:
        """Make load steps: the factor of loads and prescribed displacements in each, in order; and all of them again for each of the
        `cycles`. Where contacts wear, cycles are left out over which at most the part `jump` of the wear moves elsewhere."""
        return self._say("steps", factors=factors, cycles=cycles, jump=jump)

    def analysis(
        self,
        *,
        plane: str | None = None,
        thickness: float | None = None,
        gravity: Sequence[float] | None = None,
        rotation: Mapping[str, Any] | None = None,
        geometry: str | None = None,
        **more: Any,
    ) -> Model:
        """Set "plane_strain", "plane_stress" or "axisymmetric", the thickness in m, gravity in m/s², a rotation about an
        axis, and "small" or "large" displacements (`geometry`)."""
        entries: dict[str, Any] = {"plane": plane, "thickness": thickness, "gravity": gravity, "rotation": rotation}
        entries["geometry"] = geometry
        return self._say("analysis", **entries, **more)

    def units(self, *, length: str | None = None, force: str | None = None) -> Model:
        """Set the names of lengths and forces in reports; nothing is converted."""
        return self._say("units", length=length, force=force)

    def solver(self, **settings: Any) -> Model:
        """Set the keys of ``[solver]``, the defaults for solves of this model."""
        return self._say("solver", **settings)

    @property
    def toml(self) -> str:
        """The model as the text of a case file, without its mesh."""
        head = _toml.table("", {"title": self.title or None}).lstrip()
        once = [_toml.table(f"[{_toml.key(name)}]", entries) for name, entries in self._once.items()]
        # Tables of one kind must be adjacent.
        kinds = dict.fromkeys(name for name, _ in self._tables)
        listed = [
            _toml.table(f"[[{_toml.key(kind)}]]", entries)
            for kind in kinds
            for name, entries in self._tables
            if name == kind
        ]
        return "\n".join(text for text in [head, *once, *listed] if text)

    def build(self) -> Problem:
        """Assemble the contact problem, for several solves.

        Raises
        ------
        ModelError
            If the model is inconsistent: the text names the part.
        """
        return _built(self.mesh, self.toml)

    def solve(self, **keywords: Any) -> Solution:
        """Assemble and solve: keywords, result and errors are those of `Problem.solve`."""
        return self.build().solve(**keywords)

    def __repr__(self) -> str:
        counts: dict[str, int] = {}
        for name, _ in self._tables:
            counts[name] = counts.get(name, 0) + 1
        said = ", ".join(f"{count} × {name}" for name, count in counts.items())
        return f"<Model on {self.mesh!r}: {said or 'nothing stated yet'}>"
