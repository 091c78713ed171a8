"""The result of a solve."""

from __future__ import annotations

import html
import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _native
from ._mesh import MESHIO, Mesh
from ._watch import slips

Floats = NDArray[np.float64]

HISTORY = np.dtype(
    [
        ("load_step", np.int64),
        ("round", np.int64),
        ("iter", np.int64),
        ("inner", np.int64),
        ("products", np.int64),
        ("err", np.float64),
        ("predicted", np.float64),
        ("separated", np.int64),
        ("stick", np.int64),
        ("slip", np.int64),
        ("frictionless", np.int64),
        ("tied", np.int64),
        ("changes", np.int64),
        ("safeguarded", np.bool_),
    ]
)


def _nan(value: float | None) -> float:
    """A number of a report, which has null for numbers that are not finite."""
    return float("nan") if value is None else value


def stated_names(pairs: Sequence[tuple[str | None, str, str]]) -> list[str]:
    """The names of contacts: their own, or else their boundary, or both boundaries if the first is in several contacts."""
    boundaries = [boundary for _, boundary, _ in pairs]
    return [own or (name if boundaries.count(name) == 1 else f"{name} / {against}") for own, name, against in pairs]


def contact_names(pairs: Sequence[tuple[str | None, str, str]]) -> list[str]:
    """The names of contacts, all different."""
    names: list[str] = []
    for name in stated_names(pairs):
        while name in names:
            name += "'"
        names.append(name)
    return names


@dataclass(frozen=True)
class Kkt:
    """Violations of the optimality conditions, checked in double precision against K, each relative to its own scale."""

    equilibrium: float
    penetration: float
    tension: float
    complementarity: float
    friction_bound: float
    slip: float

    def max(self) -> float:
        """The largest of them."""
        values = np.array([self.equilibrium, self.penetration, self.tension, self.complementarity])
        return float(np.max([*values, self.friction_bound, self.slip]))


@dataclass(frozen=True, repr=False, eq=False)
class Contact:
    """A contact at the end of a load step; arrays have an entry for each of its k places.

    Attributes
    ----------
    name, boundary, against, friction : str
    points, normals : ndarray, (k, d)
        The positions of the places, and their normals, away from the body of `boundary`.
    tangents : ndarray, (k, d − 1, d)
        The directions of the components of `traction` and `slip`.
    areas : ndarray, (k,)
    pressure : ndarray, (k,)
        In Pa; ≥ 0, but of ties < 0 where their sides pull at each other.
    traction : ndarray, (k, d − 1)
        Of friction, on the body of `boundary`, in Pa.
    bound : ndarray, (k,)
        The bound that the traction obeys, in Pa.
    traction_vectors : ndarray, (k, d)
        The whole traction along the axes, in Pa.
    gap : ndarray, (k,)
        In m, after loading; inf where the stated gap is.
    slip : ndarray, (k, d − 1)
        Displacement against the other side, in m.
    wear : ndarray, (k,)
        The depth that wear has taken off, in m.
    state : ndarray of str, (k,)
        "separated", "stick", "slip", "contact" without a law of friction, or "tied".
    force, moment, centre : ndarray
        Resultant on the body of `boundary` in N, its moment in N m about `centre`.
    normal_force, tangential_force : float
        In N.
    slipping_work : float
        The work that friction has dissipated in the load step, in J.
    area : float
        In contact, in m².
    tension, shortening : float or None
        Of a preload: the force in its section, in N, and by how much the ends overlap there, in m.
    motion : ndarray or None
        Of a coupling: the displacement of its point in m, then its rotation in rad; NaN where the nodes do not determine it.
    """

    name: str
    boundary: str
    against: str
    friction: str
    points: Floats
    normals: Floats
    tangents: Floats
    areas: Floats
    pressure: Floats
    traction: Floats
    bound: Floats
    traction_vectors: Floats
    gap: Floats
    slip: Floats
    wear: Floats
    state: NDArray[np.str_]
    force: Floats
    moment: Floats
    centre: Floats
    normal_force: float
    tangential_force: float
    slipping_work: float
    area: float
    tension: float | None = None
    shortening: float | None = None
    motion: Floats | None = None

    def __repr__(self) -> str:
        counts = ", ".join(f"{np.sum(self.state == state)} {state}" for state in np.unique(self.state))
        return f"<Contact {self.name!r} with {self.against}: {counts}; normal force {self.normal_force:.6g}>"


@dataclass(frozen=True, eq=False)
class Support:
    """The reaction of a support at the end of a load step: `force` on the body in N, `moment` in N m about `centre`."""

    name: str
    force: Floats
    moment: Floats
    centre: Floats


class LoadStep:
    """The end of a load step.

    Attributes
    ----------
    number : int
        From 1.
    report : dict
        Its part of ``report.json``.
    """

    def __init__(self, of: Solution, number: int) -> None:
        self._of = of
        self.number = number
        self.report: dict[str, Any] = of.report["steps"][number - 1]

    @property
    def status(self) -> str:
        """ "converged", "iteration_limit", "stagnated", "not_held", "time_limit", "interrupted"."""
        return str(self.report["status"])

    @property
    def converged(self) -> bool:
        """Whether the requested accuracy was reached, and checked."""
        return self.status == "converged"

    @property
    def factor(self) -> float:
        """The common load factor."""
        return float(self.report["factor"])

    @property
    def cycle(self) -> int:
        """Its cycle, from 1, where load steps are repeated."""
        return int(self.report.get("cycle", 1))

    @property
    def u(self) -> Floats:
        """Displacements: of a model (nodes, d); of matrices (n,)."""
        return self._array("u")

    @property
    def lambda_normal(self) -> Floats:
        """λν, the normal contact forces, (m,)."""
        return self._array("lambda_normal")

    @property
    def lambda_tangential(self) -> Floats:
        """λτ, the friction forces, (m, d − 1)."""
        return self._array("lambda_tangential")

    @property
    def slip(self) -> Floats:
        """Slip in this load step, (m, d − 1)."""
        return self._array("slip")

    @property
    def slip_bound(self) -> Floats:
        """The slip bounds that λτ obeys, (m,)."""
        return self._array("slip_bound")

    @property
    def state(self) -> NDArray[np.str_]:
        """The state of each contact place, (m,): "separated", "stick", "slip", "contact" without friction, or "tied"."""
        state: NDArray[np.str_] = self._data("state")
        return state

    @property
    def stress(self) -> Floats:
        """Stresses at the nodes in Pa, (nodes, 6): xx, yy, zz, xy, yz, zx. Of models."""
        return self._array("stress")

    @property
    def stress_in_elements(self) -> Floats:
        """The same in the middle of the elements, (elements, 6), numbered as by `Mesh.cell_numbers`."""
        return self._array("stress_in_elements")

    @property
    def contacts(self) -> dict[str, Contact]:
        """The contacts and ties of a model by their names, or those of their boundaries; empty for a problem from
        matrices."""
        contacts: dict[str, Contact] = self._data("contacts")
        return contacts

    @property
    def supports(self) -> list[Support]:
        """The reactions of the supports of a model, in its order."""
        return [
            Support(one["support"], *(np.array(one[key]) for key in ("force", "moment", "centre")))
            for one in self.report["supports"]
        ]

    @property
    def kkt(self) -> Kkt:
        """The optimality conditions."""
        return Kkt(**{name: _nan(value) for name, value in self.report["kkt"].items()})

    @property
    def iterations(self) -> int:
        """Outer steps."""
        return int(self.report["iter"])

    @property
    def products(self) -> int:
        """Products with A."""
        return int(self.report["n_A"])

    def __repr__(self) -> str:
        return f"<LoadStep {self.number}: {self.status}, {self.iterations} steps, {self.products} products>"

    def _data(self, name: str) -> Any:
        return self._of._data(self.number - 1, name)

    def _array(self, name: str) -> Floats:
        array: Floats = self._data(name)
        return array


class Solution:
    """The result of a solve: its load steps; its own fields are those of the last one.

    Pickling keeps all of its numbers; `write` and the page in notebooks then need the original. Its arrays are
    read-only: compute in place on a copy.

    Attributes
    ----------
    report : dict
        The contents of ``report.json``.
    steps : list of LoadStep
        The load steps made.
    """

    def __init__(self, native: _native.Solved) -> None:
        self._native: _native.Solved | None = native
        self.report: dict[str, Any] = json.loads(native.report())
        self._cache: dict[tuple[int, str], Any] = {}

    @property
    def steps(self) -> list[LoadStep]:
        """The load steps made, from the first."""
        return [LoadStep(self, number + 1) for number in range(len(self.report["steps"]))]

    @property
    def last(self) -> LoadStep:
        """The last load step made."""
        steps = self.report["steps"]
        if not steps:
            raise AttributeError("no load step was made")
        return LoadStep(self, len(steps))

    @property
    def status(self) -> str:
        """How the last load step ended: "converged", "iteration_limit", "stagnated", "not_held", "time_limit",
        "interrupted"; "error" if an error ended the solve after the load steps made."""
        return str(self.report["status"])

    @property
    def converged(self) -> bool:
        """Whether the requested accuracy was reached, and checked, in all load steps."""
        return self.status == "converged"

    @property
    def u(self) -> Floats:
        """Displacements: of a model (nodes, d); of matrices (n,)."""
        return self.last.u

    @property
    def lambda_normal(self) -> Floats:
        """λν, the normal contact forces, (m,)."""
        return self.last.lambda_normal

    @property
    def lambda_tangential(self) -> Floats:
        """λτ, the friction forces, (m, d − 1)."""
        return self.last.lambda_tangential

    @property
    def slip(self) -> Floats:
        """Slip in the last load step, (m, d − 1)."""
        return self.last.slip

    @property
    def slip_bound(self) -> Floats:
        """The slip bounds that λτ obeys, (m,)."""
        return self.last.slip_bound

    @property
    def state(self) -> NDArray[np.str_]:
        """The state of each contact place, (m,): "separated", "stick", "slip", "contact" without friction, or "tied"."""
        return self.last.state

    @property
    def stress(self) -> Floats:
        """Stresses at the nodes in Pa, (nodes, 6): xx, yy, zz, xy, yz, zx. Of models."""
        return self.last.stress

    @property
    def stress_in_elements(self) -> Floats:
        """The same in the middle of the elements, (elements, 6), numbered as by `Mesh.cell_numbers`."""
        return self.last.stress_in_elements

    @property
    def contacts(self) -> dict[str, Contact]:
        """The contacts and ties of a model by their names, or those of their boundaries; empty for a problem from
        matrices."""
        return self.last.contacts

    @property
    def supports(self) -> list[Support]:
        """The reactions of the supports of a model, in its order."""
        return self.last.supports

    @property
    def kkt(self) -> Kkt:
        """The optimality conditions."""
        return self.last.kkt

    @property
    def n(self) -> int:
        """Unknowns that no support prescribes."""
        return int(self.report["n"])

    @property
    def m(self) -> int:
        """Contact places."""
        return int(self.report["m"])

    @property
    def iterations(self) -> int:
        """Outer steps of all load steps."""
        return int(self.report["iter"])

    @property
    def products(self) -> int:
        """Products with A of all load steps."""
        return int(self.report["n_A"])

    @property
    def hints(self) -> list[str]:
        """The hints: figures that deserve a look."""
        return list(self.report["hints"])

    @property
    def history(self) -> NDArray[Any]:
        """A row for each outer step, as a structured array: ``history["err"]``, ``history["products"]`` …"""
        rows = [
            (
                row["load_step"],
                row["round"],
                row["iter"],
                row["inner"],
                row["n_A"],
                _nan(row["err"]),
                _nan(row["predicted"]),
                row["sets"]["separated"],
                row["sets"]["stick"],
                slips(row["sets"]),
                row["sets"]["frictionless"],
                row["sets"]["tied"],
                row["changes"],
                row["safeguarded"],
            )
            for row in self.report["history"]
        ]
        return np.array(rows, dtype=HISTORY)

    def write(self, directory: str | os.PathLike[str], plots: bool = False) -> list[Path]:
        """Write the results as ``signorini solve`` does: ``report.json``, ``solution.vtu``, ``contact.csv``.

        Parameters
        ----------
        directory : path
            Made if necessary; results of an earlier run are removed.
        plots : bool
            Whether to draw pictures and write ``report.html``.

        Returns
        -------
        list of Path
            The files.
        """
        files = self._handle("write").write(os.fspath(directory), plots)
        return [Path(file) for file in files]

    def to_meshio(self) -> Any:
        """The bodies at the end of the last load step as a mesh of meshio.

        Point data: ``displacement``, ``stress`` and, along the axes, the fields at nodes of contacts (0 elsewhere, and NaN
        for ``contact_gap``): ``contact_pressure``, ``contact_traction`` (the whole traction), ``contact_slip``,
        ``contact_gap``, and ``contact_status`` (0 no contact, 1 separated, 2 stick, 3 slip, 4 without friction, 5 tied). Cell
        data: ``stress``. Regions are cell sets; boundaries and sets of nodes are point sets.
        """
        import meshio

        points, cells, regions, sets = self._mesh()
        numbers = [of_kind for _, of_kind, _ in cells]
        order = np.concatenate(numbers)
        in_elements = self.stress_in_elements
        ends = np.cumsum([len(of_kind) for of_kind in numbers])[:-1]
        return meshio.Mesh(
            _in_space(points),
            [(MESHIO[kind], nodes.astype(np.int64)) for kind, _, nodes in cells],
            point_data={"displacement": _in_space(self.u), "stress": self.stress, **self.last._data("at_nodes")},
            cell_data={"stress": np.split(in_elements[order], ends)},
            cell_sets={
                name: [np.flatnonzero(np.isin(of_kind, members)) for of_kind in numbers] for name, members in regions.items()
            },
            point_sets={name: nodes.astype(np.int64) for name, nodes in sets.items()},
        )

    def to_pyvista(self) -> Any:
        """The bodies at the end of the last load step as a ``pyvista.UnstructuredGrid``, with the arrays of
        `to_meshio`. Each region is a cell array, each boundary and set of nodes a point array, of 0 and 1."""
        import pyvista

        plain = self.to_meshio()
        cell_sets, plain.cell_sets, plain.point_sets = plain.cell_sets, {}, {}
        grid = pyvista.from_meshio(plain)
        sizes = [len(block.data) for block in plain.cells]
        for name, of_blocks in cell_sets.items():
            inside = [np.isin(np.arange(size), members) for size, members in zip(sizes, of_blocks)]
            grid.cell_data[f"region {name}"] = np.concatenate(inside).astype(np.uint8)
        for name, nodes in self._mesh()[3].items():
            grid.point_data[f"boundary {name}"] = np.isin(np.arange(len(plain.points)), nodes).astype(np.uint8)
        return grid

    def __repr__(self) -> str:
        loads = len(self.report["steps"])
        of = f" in {loads} load steps" if loads > 1 else ""
        return (
            f"<Solution {self.status}: n = {self.n}, m = {self.m}, "
            f"{self.iterations} steps, {self.products} products{of}>"
        )

    def _repr_html_(self) -> str:
        if self._native is None:
            return html.escape(repr(self))
        with tempfile.TemporaryDirectory() as directory:
            self.write(directory, plots=True)
            page = Path(directory, "report.html").read_text(encoding="utf-8")
        frame = 'style="width: 100%; height: 640px; border: 1px solid #ddd"'
        return f'<iframe {frame} srcdoc="{html.escape(page)}"></iframe>'

    def __getstate__(self) -> dict[str, Any]:
        names = list(_VECTORS)
        if self._mesh_or_none() is not None:
            names += ["stress", "stress_in_elements", "contacts", "at_nodes"]
        for step in range(len(self.report["steps"])):
            for name in names:
                self._data(step, name)
        return {"report": self.report, "_cache": self._cache, "_native": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        for data in self._cache.values():
            _freeze(data)

    def _handle(self, what: str) -> _native.Solved:
        """The object of the solver; missing after pickling."""
        if self._native is None:
            raise ValueError(f"{what}: this solution was pickled and has only its numbers; use the original from the solve")
        return self._native

    def _mesh_or_none(self) -> Any:
        if (0, "mesh") not in self._cache:
            native = self._handle("mesh").mesh()
            made: Any = None
            if native is not None:
                mesh = Mesh._of(native)
                made = (mesh.points, native.cells(), mesh.regions, {**mesh.node_sets, **mesh.boundaries})
            self._cache[0, "mesh"] = made
        return self._cache[0, "mesh"]

    def _mesh(self) -> Any:
        mesh = self._mesh_or_none()
        if mesh is None:
            raise AttributeError("a problem from matrices has no mesh")
        return mesh

    def _data(self, step: int, name: str) -> Any:
        """An array of a load step, made on first use."""
        if (step, name) not in self._cache:
            self._make(step, name)
        return self._cache[step, name]

    def _make(self, step: int, name: str) -> None:
        native = self._handle(name)
        made: dict[str, Any] = {}
        bodies = self._mesh_or_none() is not None
        if name == "u" and bodies:
            made["u"] = native.displacement(step)
        elif name in ("contacts", "at_nodes", "state") and bodies:
            made["contacts"], made["at_nodes"], made["state"] = self._contacts(step)
        elif name in _VECTORS:
            made = native.vectors(step)
            # Contact may have other places in each step.
            places = len(made["lambda_normal"])
            rows = (places, -1) if places else (0, self._mesh()[0].shape[1] - 1 if bodies else 1)
            for tangential in ("lambda_tangential", "slip"):
                made[tangential] = made[tangential].reshape(rows)
            made["state"] = np.array(made["state"], dtype=np.str_)
            if bodies:
                # Laws may change from step to step, which the fields of contacts know.
                del made["u"], made["state"]
        elif name in ("contacts", "at_nodes"):
            made[name] = {}
        else:
            made["stress"], made["stress_in_elements"] = native.stress(step)
        for key, value in made.items():
            self._cache[step, key] = _freeze(value)

    def _contacts(self, step: int) -> tuple[dict[str, Contact], dict[str, NDArray[Any]], NDArray[np.str_]]:
        """The contacts, their fields at the nodes of the mesh, and the state of all places."""
        fields = self._handle("contacts").contact(step)
        pair_of, shown = fields.pop("contact"), fields.pop("shown")
        turned, turns = fields.pop("turned"), fields.pop("turns")
        fields["state"] = np.array(fields["state"], dtype=np.str_)
        places, d = fields["points"].shape
        for name, shape in {"traction": (places, d - 1), "slip": (places, d - 1), "tangents": (places, d - 1, d)}.items():
            fields[name] = fields[name].reshape(shape)
        slip = np.einsum("kt,ktd->kd", fields["slip"], fields["tangents"])
        status = np.array([STATES.index(state) for state in fields["state"]], dtype=np.int32)
        at_nodes = {
            f"contact_{name}": _scattered(shown, of_places, none)
            for name, of_places, none in [
                ("pressure", fields["pressure"], 0.0),
                ("traction", fields["traction_vectors"], 0.0),
                ("slip", slip, 0.0),
                ("gap", fields["gap"], np.nan),
                ("status", status, 0),
            ]
        }
        for name in ("contact_traction", "contact_slip"):
            vectors = at_nodes[name]
            vectors[turned] = np.einsum("kij,kj->ki", turns.reshape(-1, d, d), vectors[turned])
            at_nodes[name] = _in_space(vectors)
        reports = self.report["steps"][step]["contacts"]
        names = contact_names([(one["name"], one["boundary"], one["against"]) for one in reports])
        contacts = {}
        for number, (name, one) in enumerate(zip(names, reports)):
            of = pair_of == number
            known: dict[str, Any] = {key: value[of] for key, value in fields.items()}
            known |= {key: one[key] for key in ("boundary", "against", "friction")}
            known |= {key: np.array(one[key]) for key in ("force", "moment", "centre")}
            known |= {key: _nan(one[key]) for key in ("normal_force", "tangential_force", "slipping_work", "area")}
            known |= {key: _nan(one[key]) for key in ("tension", "shortening") if key in one}
            if "motion" in one:
                known["motion"] = np.array([_nan(value) for value in one["motion"]])
            contacts[name] = Contact(name=name, **known)
        return contacts, at_nodes, fields["state"]


_VECTORS = ("u", "lambda_normal", "lambda_tangential", "slip_bound", "slip", "state")


# The codes of `contact_status`, as in files for ParaView.
STATES = ("", "separated", "stick", "slip", "contact", "tied")


def _freeze(data: Any) -> Any:
    """Shared arrays become read-only: users copy them to compute in place."""
    if isinstance(data, np.ndarray):
        data.setflags(write=False)
    elif isinstance(data, dict):
        for value in data.values():
            _freeze(value)
    elif isinstance(data, Contact):
        _freeze(vars(data))
    return data


def _scattered(shown: NDArray[np.int64], of_places: NDArray[Any], none: float) -> NDArray[Any]:
    """The values of contact places at each node of the mesh; `none` at nodes without one."""
    at_nodes = np.full((len(shown), *of_places.shape[1:]), none, dtype=of_places.dtype)
    at_nodes[shown >= 0] = of_places[shown[shown >= 0]]
    return at_nodes


def _in_space(vectors: Floats) -> Floats:
    """Points or vectors with three components."""
    missing = 3 - vectors.shape[1]
    return np.pad(vectors, ((0, 0), (0, missing))) if missing else vectors
