"""Meshes: from files, made here, or from arrays of other programs."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _arrays, _native, _toml
from ._native import ModelError

# meshio's name of each kind; its nodes have the same order there, that of VTK.
MESHIO = {
    "tri3": "triangle",
    "tri6": "triangle6",
    "quad4": "quad",
    "quad8": "quad8",
    "quad9": "quad9",
    "tet4": "tetra",
    "tet10": "tetra10",
    "hex8": "hexahedron",
    "hex20": "hexahedron20",
    "hex27": "hexahedron27",
    "wedge6": "wedge",
    "wedge15": "wedge15",
    "wedge18": "wedge18",
    "pyramid5": "pyramid",
}
KINDS = {name: kind for kind, name in MESHIO.items()} | {kind: kind for kind in MESHIO}
PLANE = {"tri3", "tri6", "quad4", "quad8", "quad9"}
# The corners of a wedge in an order in which those of each face go around that face.
_AROUND_WEDGE = (0, 1, 2, 5, 4, 3)
# The facets of elements in the plane, and in space.
FACETS = {2: {"line": 2, "line3": 3}, 3: {"triangle": 3, "quad": 4, "triangle6": 6, "quad8": 8, "quad9": 9}}


class Mesh:
    """A mesh of the plane or of space, with named regions and boundaries.

    Parameters
    ----------
    points : array_like, (n, d)
        Coordinates of the nodes. Unused nodes are dropped: `Mesh.points` has the rest.
    cells : dict or list of pairs
        Elements by kind: nodes in VTK's order, (k, nodes of the kind), under names of meshio ("triangle", "tetra10", …) or
        of case files ("tri3", "tet10", …).
    regions : dict or array_like; optional
        The elements of each region by name, numbered through all of `cells`; regions may overlap, and elements in none are
        "unnamed". Or a name for each element. Default: all of them are "body".
    boundaries : dict; optional
        By name the facets of each boundary, (k, nodes), in the plane edges, in space faces (corners are enough), or a list of
        such arrays; or the numbers of nodes, (k,): the outer facets that have all of their corners among them.
    node_sets : dict; optional
        By name the numbers of nodes, (k,), for loads and supports of single nodes. The outer facets with all of their
        corners in a set also form a boundary of its name.

    Warns
    -----
    UserWarning
        If elements are copies of others on the same nodes: each counts once, in the regions of all of its copies.

    Raises
    ------
    ModelError
        If the mesh is invalid: the text names the element or the boundary.
    """

    def __init__(
        self,
        points: ArrayLike,
        cells: Mapping[str, ArrayLike] | Iterable[tuple[str, ArrayLike]],
        regions: Mapping[str, ArrayLike] | Sequence[str] | None = None,
        boundaries: Mapping[str, ArrayLike | Sequence[ArrayLike]] | None = None,
        node_sets: Mapping[str, ArrayLike] | None = None,
    ) -> None:
        pairs = list(cells.items() if isinstance(cells, Mapping) else cells)
        arrays: list[tuple[str, NDArray[np.int64]]] = []
        for name, nodes in pairs:
            if name not in KINDS:
                raise ModelError(f"cells: there are no elements {name!r}; the kinds are {', '.join(MESHIO.values())}")
            of_kind = _arrays.integers("cells", nodes)
            if of_kind.ndim != 2:
                raise ModelError(f"cells: {name!r} needs a row for each element, found shape {of_kind.shape}")
            arrays.append((KINDS[name], of_kind))
        count = sum(len(nodes) for _, nodes in arrays)
        numbers, names, groups = _regions(regions, count)
        facets: dict[str, list[NDArray[np.int64]]] = {}
        by_nodes: dict[str, NDArray[np.int64]] = {}
        for name, given in (boundaries or {}).items():
            several: list[Any] = [given]
            if isinstance(given, (list, tuple)) and any(np.ndim(one) == 2 for one in given):
                several = list(given)
            made = [_arrays.integers(f"boundaries, {name!r}", one) for one in several]
            if all(one.ndim == 2 for one in made):
                facets[name] = made
            elif len(made) == 1 and made[0].ndim == 1:
                by_nodes[name] = made[0]
            else:
                raise ModelError(f"boundaries: {name!r} needs an array of facets or of nodes")
        sets = {name: _arrays.integers(f"node_sets, {name!r}", nodes).ravel() for name, nodes in (node_sets or {}).items()}
        for name in sets.keys() & by_nodes.keys():
            raise ModelError(f"node_sets: {name!r} is also a boundary of nodes; keep one of them")
        self._native = _native.Mesh.of_arrays(
            _arrays.table("points", points), arrays, numbers, names, groups, facets, sets | by_nodes, list(by_nodes), []
        )
        for note in self.notes:
            warnings.warn(note, stacklevel=2)

    @classmethod
    def _of(cls, native: _native.Mesh) -> Mesh:
        self = cls.__new__(cls)
        self._native = native
        return self

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        scale: float | None = None,
        cell_data: str | None = None,
        order: int | None = None,
    ) -> Mesh:
        """Read a mesh of Gmsh (``.msh``), Abaqus (``.inp``) or VTK (``.vtu``).

        Parameters
        ----------
        path : path
            The file.
        scale : float; optional
            Factor for the coordinates, such as 1e-3 for a drawing in millimetres.
        cell_data : str; optional
            The cell array of a ``.vtu`` file that distinguishes regions and boundaries.
        order : {1, 2}; optional
            2 adds midside nodes to elements of first order, 1 drops them.

        Raises
        ------
        OSError
            If the file cannot be read.
        ModelError
            If the file gives no valid mesh; the text names the line.
        """
        entries = {"file": os.fspath(path), "scale": scale, "cell_data": cell_data, "order": order}
        return cls._of(_native.Mesh.stated(_toml.table("[mesh]", entries)))

    @classmethod
    def from_meshio(cls, mesh: Any, *, regions: str | None = None) -> Mesh:
        """A mesh of meshio: cells of the highest dimension are the bodies, those one dimension lower their boundaries.

        Cell sets are regions or boundaries under their names, and so are Gmsh's physical groups; point sets are sets of
        nodes, unless a boundary has their name. `regions` names an array of ``cell_data`` whose values distinguish regions
        and boundaries, instead of cell sets and groups.
        """
        kinds = {block.type for block in mesh.cells}
        dim = 3 if any(KINDS.get(name, "") in set(MESHIO) - PLANE for name in kinds) else 2
        points = np.asarray(mesh.points, dtype=np.float64)
        if dim == 2 and points.shape[1] == 3:
            if np.ptp(points[:, 2]) > 1e-9 * max(np.ptp(points[:, :2], axis=0).max(), 1e-300):
                raise ModelError("the mesh is not plane: its z coordinates differ; a solid body needs volume cells")
            points = points[:, :2]
        marks: dict[str, list[tuple[int, NDArray[np.bool_]]]] = {}

        def mark(name: str, block: int, where: NDArray[np.bool_]) -> None:
            if where.any():
                marks.setdefault(name, []).append((block, where))

        values = mesh.cell_data.get(regions if regions is not None else "gmsh:physical")
        if regions is not None and values is None:
            raise ValueError(f"regions: the mesh has no cell data {regions!r}; it has {', '.join(mesh.cell_data) or 'none'}")
        if values is not None:
            called: dict[tuple[float, int], str] = {}
            if regions is None:
                called = {(int(t), int(d)): n for n, (t, d) in mesh.field_data.items()}
            for number, (block, of_block) in enumerate(zip(mesh.cells, values)):
                d = block.dim
                for tag in np.unique(of_block):
                    value = int(tag) if float(tag).is_integer() else float(tag)
                    mark(called.get((value, d), str(value)), number, np.asarray(of_block) == tag)
        if regions is None:
            for name, sets in mesh.cell_sets.items():
                if name.startswith("gmsh:"):
                    continue
                for number, members in enumerate(sets):
                    if members is not None and len(members):
                        members = np.asarray(members)
                        where = np.zeros(len(mesh.cells[number].data), dtype=bool)
                        # Numbers of cells, or a mask.
                        where[members if members.dtype == bool else members.astype(np.int64)] = True
                        mark(name, number, where)
        cells: list[tuple[str, ArrayLike]] = []
        first: dict[int, int] = {}
        count = 0
        for number, block in enumerate(mesh.cells):
            kind = KINDS.get(block.type)
            if block.dim == dim:
                if kind is None:
                    raise ModelError(f"cells: {block.type!r} is not a supported element")
                first[number] = count
                cells.append((block.type, block.data))
                count += len(block.data)
        inside: dict[str, list[NDArray[np.int64]]] = {}
        bounds: dict[str, list[NDArray[np.int64]]] = {}
        for name, places in marks.items():
            for number, where in places:
                block = mesh.cells[number]
                if number in first:
                    inside.setdefault(name, []).append(first[number] + np.flatnonzero(where))
                elif block.type in FACETS[dim]:
                    bounds.setdefault(name, []).append(np.asarray(block.data)[where])
        return cls(
            points,
            cells,
            {name: np.concatenate(all_of) for name, all_of in inside.items()} or None,
            dict(bounds),
            {name: nodes for name, nodes in mesh.point_sets.items() if name not in bounds},
        )

    @classmethod
    def from_skfem(cls, mesh: Any, boundaries: Mapping[str, Any] | None = None) -> Mesh:
        """A mesh of scikit-fem, with its subdomains as regions and its boundaries.

        `boundaries` adds others by name, in the form that ``mesh.with_boundaries`` takes: numbers of facets, or a function
        of the place.
        """
        from skfem.io.meshio import to_meshio

        kind = type(mesh).__name__
        if kind.endswith("DG"):
            raise ModelError(
                f"elements of a {kind} share no nodes, so no body holds together: pass the continuous mesh that it was made from"
            )
        if boundaries is not None:
            mesh = mesh.with_boundaries(boundaries)
        try:
            plain = to_meshio(mesh)
        except KeyError:
            raise ModelError(f"a {kind} is not a supported mesh; pass its points and cells, as Mesh(points, cells)") from None
        blocks = [block for block in plain.cells if block.type in KINDS]
        points = np.asarray(plain.points, dtype=np.float64)[:, : mesh.dim()]
        regions = {name: np.asarray(of) for name, of in (mesh.subdomains or {}).items() if not name.startswith("skfem:")}
        facets: dict[str, list[NDArray[np.int64]]] = {}
        for name, of in (mesh.boundaries or {}).items():
            if name.startswith("skfem:"):
                continue
            numbers = np.asarray(of, dtype=np.int64)
            rows = np.asarray(mesh.facets).T[numbers]
            if kind.startswith("MeshWedge"):
                # Corners of a facet are sorted there, and a triangle repeats one of its corners.
                elements = np.asarray(mesh.t).T[np.asarray(mesh.f2t)[0, numbers]]
                inside = [np.isin(element, row) for element, row in zip(elements, rows)]
                faces = [element[[k for k in _AROUND_WEDGE if of_it[k]]] for element, of_it in zip(elements, inside)]
                facets[name] = [np.array([face for face in faces if len(face) == k]) for k in {len(face) for face in faces}]
                continue
            facets[name] = [rows]
        return cls(points, [(block.type, block.data) for block in blocks], regions or None, facets)

    @classmethod
    def join(cls, parts: Mapping[str, Mesh], shift: Mapping[str, Sequence[float]] | None = None) -> Mesh:
        """Several meshes in one, without common nodes.

        Boundaries of the part "punch" are called ``punch-left`` …, and its regions ``punch-NAME``, or ``punch`` if "body" is
        the only one. `shift` has vectors to add to the coordinates of parts.
        """
        shift = shift or {}
        for name in shift:
            if name not in parts:
                raise ValueError(f"shift: there is no part {name!r}; there are {', '.join(map(repr, parts))}")
        placed = []
        for name, part in parts.items():
            regions = {old: f"{name}-{old}" for old in [*part.regions, *part._native.regions()[1]]}
            if list(regions) in (["body"], ["body", "body"]):
                regions = {"body": name}
            boundaries = {old: f"{name}-{old}" for old in [*part.boundaries, *part.node_sets]}
            by = _arrays.vector(f"shift, {name!r}", shift.get(name, [0.0] * part.dim))
            if len(by) != part.dim or not np.isfinite(by).all():
                raise ValueError(f"shift, {name!r}: expected {part.dim} finite numbers, found {by.tolist()}")
            placed.append(part._native.placed(by.tolist(), regions, boundaries))
        return cls._of(_native.Mesh.joined(placed))

    @property
    def dim(self) -> int:
        """2 in the plane, 3 in space."""
        return self._native.dim

    @property
    def points(self) -> NDArray[np.float64]:
        """Coordinates of the nodes, (n, d)."""
        return self._native.points()

    @property
    def cells(self) -> dict[str, NDArray[np.uint32]]:
        """Elements by kind, under names of meshio: the nodes of each, (k, nodes), in VTK's order."""
        return {MESHIO[kind]: nodes for kind, _, nodes in self._native.cells()}

    @property
    def cell_numbers(self) -> dict[str, NDArray[np.uint32]]:
        """By kind the number of each row of `cells` among all elements, as in `regions` and `Solution.stress_in_elements`: elements
        of a file are in its order, whatever their kinds."""
        return {MESHIO[kind]: numbers for kind, numbers, _ in self._native.cells()}

    @property
    def regions(self) -> dict[str, NDArray[np.int64]]:
        """The numbers of the elements of each region, and of each group of them, by name (`cell_numbers`)."""
        of, _, groups = self._native.regions()
        return {name: np.flatnonzero(np.isin(of, members)) for name, members in groups.items()}

    @property
    def boundaries(self) -> dict[str, NDArray[np.uint32]]:
        """The numbers of the nodes of each boundary, in increasing order, by name."""
        empty = np.zeros(0, dtype=np.uint32)
        all_of = self._native.boundaries()
        return {
            name: np.unique(np.concatenate([empty, *(one.ravel() for one in facets)])) for name, facets in all_of.items()
        }

    @property
    def node_sets(self) -> dict[str, NDArray[np.uint32]]:
        """The numbers of the nodes of each set of nodes, in increasing order, by name."""
        return self._native.node_sets()

    @property
    def notes(self) -> list[str]:
        """Entries of a file or of arrays that were ignored or read differently."""
        return self._native.notes()

    def facets(self, name: str) -> list[NDArray[np.uint32]]:
        """The facets of a boundary: an array, (k, nodes), for each number of nodes per facet."""
        return self._native.boundaries()[name]

    @property
    def n_bodies(self) -> int:
        """The number of bodies: parts that share no node."""
        return self._native.n_bodies

    def __repr__(self) -> str:
        kinds = ", ".join(f"{len(nodes)} {kind}" for kind, _, nodes in self._native.cells())
        where = "the plane" if self.dim == 2 else "space"
        return f"<Mesh in {where}: {len(self.points)} nodes, {kinds}; boundaries {', '.join(self.boundaries) or 'none'}>"

    def __reduce__(self) -> tuple[Any, ...]:
        blocks = self._native.cells()
        of, names, groups = self._native.regions()
        order = np.concatenate([numbers for _, numbers, _ in blocks]).astype(np.int64)
        state: tuple[Any, ...] = (
            self.points,
            [(kind, nodes.astype(np.int64)) for kind, _, nodes in blocks],
            of.astype(np.int64)[order],
            names,
            groups,
            {name: [one.astype(np.int64) for one in facets] for name, facets in self._native.boundaries().items()},
            {name: nodes.astype(np.int64) for name, nodes in self.node_sets.items()},
            [],
            self.notes,
        )
        return _unpickled, state


def _unpickled(*state: Any) -> Mesh:
    return Mesh._of(_native.Mesh.of_arrays(*state))


def _regions(
    given: Mapping[str, ArrayLike] | Sequence[str] | None, count: int
) -> tuple[NDArray[np.int64], list[str], dict[str, list[int]]]:
    """The number of the region of each element, their names, and the groups that overlap."""
    if given is None:
        return np.zeros(count, dtype=np.int64), ["body"], {}
    if not isinstance(given, Mapping):
        listed = [str(name) for name in given]
        names = list(dict.fromkeys(listed))
        return np.array([names.index(name) for name in listed], dtype=np.int64), names, {}
    inside = np.zeros((count, len(given)), dtype=bool)
    for column, (name, members) in enumerate(given.items()):
        numbers = _arrays.integers(f"regions, {name!r}", members)
        if numbers.size and not (0 <= numbers.min() and numbers.max() < count):
            raise ModelError(f"regions: {name!r} names an element that does not exist; there are {count}")
        inside[numbers, column] = True
    kinds, of = np.unique(inside, axis=0, return_inverse=True)
    called = list(given)
    groups: dict[str, list[int]] = {name: [] for name in called}
    joined: list[str] = []
    for number, row in enumerate(kinds):
        of_row = [called[column] for column in np.flatnonzero(row)]
        joined.append(" & ".join(of_row) or "unnamed")
        for name in of_row:
            groups[name].append(number)
    for number, name in enumerate(joined):
        groups.setdefault(name, [number])
    return of.reshape(-1).astype(np.int64), joined, groups


def rectangle(
    size: Sequence[float],
    cells: Sequence[int],
    *,
    origin: Sequence[float] | None = None,
    shape: str | None = None,
    order: int | None = None,
    map: Sequence[str] | None = None,
) -> Mesh:
    """A rectangle of equal cells: region "body", boundaries "left", "right", "bottom", "top".

    Parameters
    ----------
    size, cells : two numbers
        Width and height; cells across and up.
    origin : two numbers; optional
        The lower left corner.
    shape : {"quad", "triangle"}; optional
    order : {1, 2}; optional
    map : two expressions; optional
        The new position of the point (x, y), such as ``["x", "y + 0.1*x^2"]``.
    """
    return _structured("rectangle", order, size=size, cells=cells, origin=origin, shape=shape, map=map)


def box(
    size: Sequence[float],
    cells: Sequence[int],
    *,
    origin: Sequence[float] | None = None,
    shape: str | None = None,
    order: int | None = None,
    map: Sequence[str] | None = None,
) -> Mesh:
    """A box of equal cells: region "body", boundaries "left", "right" across x, "front", "back" across y, "bottom", "top".

    Parameters
    ----------
    size, cells : three numbers
        Along x, y and z.
    origin : three numbers; optional
        The corner with the least coordinates.
    shape : {"hexahedron", "tetrahedron", "wedge"}; optional
    order : {1, 2}; optional
    map : three expressions; optional
        The new position of the point (x, y, z).
    """
    return _structured("box", order, size=size, cells=cells, origin=origin, shape=shape, map=map)


def _structured(name: str, order: int | None, **entries: Any) -> Mesh:
    text = _toml.table("[mesh]", {"order": order}) + _toml.table(f"[mesh.{name}]", entries)
    return Mesh._of(_native.Mesh.stated(text))
