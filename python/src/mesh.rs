//! Meshes: read, made, and of arrays.

use crate::arrays::{flat, rows, table};
use crate::errors::{ModelError, argument, guarded, of_build, of_case};
use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use signorini::case::Case;
use signorini::mesh::{
    self, AnyMesh, Element, ElementKind, Facet, MeshParts, Topology, facet, facet_nodes, structured,
};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Elements of a kind: its short name, their numbers, their nodes.
pub type Cells<'py> = (
    &'static str,
    Bound<'py, PyArray1<u32>>,
    Bound<'py, PyArray2<u32>>,
);

/// A mesh of either dimension.
#[pyclass(frozen, module = "signorini._native")]
pub struct Mesh(Arc<AnyMesh>);

/// Of both dimensions the one that it is.
macro_rules! either {
    ($mesh:expr, $one:ident => $value:expr) => {
        match &*$mesh.0 {
            AnyMesh::Plane($one) => $value,
            AnyMesh::Space($one) => $value,
        }
    };
}

impl Mesh {
    pub fn new(mesh: AnyMesh) -> Self {
        Self(Arc::new(mesh))
    }

    pub fn copy(&self) -> AnyMesh {
        (*self.0).clone()
    }
}

#[pymethods]
impl Mesh {
    /// The mesh of the tables `[mesh]` of a text.
    #[staticmethod]
    fn stated(py: Python<'_>, text: String) -> PyResult<Self> {
        let case = Case::stated(text).map_err(of_case)?;
        let mesh = guarded(py, || case.read_mesh())?.map_err(of_build)?;
        Ok(Self::new(mesh))
    }

    /// From arrays: points, elements by kind, the region of each element, the names of regions, groups of these by name,
    /// facets of boundaries by name (an array for each number of nodes), sets of nodes, those among them that are only
    /// boundaries, and notes.
    #[staticmethod]
    #[expect(clippy::too_many_arguments, reason = "one for each part")]
    fn of_arrays(
        py: Python<'_>,
        points: PyReadonlyArray2<f64>,
        cells: Vec<(String, PyReadonlyArray2<i64>)>,
        region_of: PyReadonlyArray1<i64>,
        regions: Vec<String>,
        groups: BTreeMap<String, Vec<u32>>,
        facets: BTreeMap<String, Vec<PyReadonlyArray2<i64>>>,
        node_sets: BTreeMap<String, PyReadonlyArray1<i64>>,
        by_nodes: Vec<String>,
        notes: Vec<String>,
    ) -> PyResult<Self> {
        let mut parts = Parts {
            kinds: Vec::new(),
            region_of: region_of.as_slice()?.to_vec(),
            regions,
            groups,
            facets: BTreeMap::new(),
            node_sets: BTreeMap::new(),
            by_nodes,
            notes,
        };
        for (name, nodes) in &cells {
            let kind = (ElementKind::ALL.into_iter())
                .find(|kind| kind.name() == name)
                .ok_or_else(|| argument("cells", format!("there are no elements \"{name}\"")))?;
            let (found, needed) = (nodes.shape()[1], kind.n_nodes());
            if found != needed {
                let text =
                    format!("a {name} has {needed} nodes, and the array has {found} columns");
                return Err(argument("cells", text));
            }
            parts
                .kinds
                .push((kind, numbers("cells", nodes.as_slice()?)?));
        }
        for (name, arrays) in &facets {
            let mut all = Vec::new();
            for array in arrays {
                let nodes = numbers("boundaries", array.as_slice()?)?;
                let width = array.shape()[1];
                all.extend(nodes.chunks(width.max(1)).map(<[u32]>::to_vec));
            }
            parts.facets.insert(name.clone(), all);
        }
        for (name, nodes) in &node_sets {
            let nodes = numbers("node_sets", nodes.as_slice()?)?;
            parts.node_sets.insert(name.clone(), nodes);
        }
        let mesh = match points.shape()[1] {
            2 => {
                let nodes = rows::<f64, 2>("points", &points)?;
                guarded(py, || parts.mesh(nodes).map(AnyMesh::Plane))?
            }
            3 => {
                let nodes = rows::<f64, 3>("points", &points)?;
                guarded(py, || parts.mesh(nodes).map(AnyMesh::Space))?
            }
            n => {
                return Err(argument(
                    "points",
                    format!("expected 2 or 3 columns, found {n}"),
                ));
            }
        };
        mesh.map(Self::new).map_err(ModelError::new_err)
    }

    /// Meshes side by side.
    #[staticmethod]
    fn joined(parts: Vec<PyRef<Mesh>>) -> PyResult<Self> {
        fn both<const D: usize>(a: mesh::Mesh<D>, b: mesh::Mesh<D>) -> PyResult<mesh::Mesh<D>>
        where
            ElementKind: Topology<D>,
        {
            match structured::shared_name(&a, &b) {
                None => Ok(structured::join(a, b)),
                Some(name) => Err(ModelError::new_err(format!(
                    "parts: two of them have a region or boundary called \"{name}\": give the parts other names"
                ))),
            }
        }
        let mut whole: Option<AnyMesh> = None;
        for part in &parts {
            whole = Some(match (whole, part.copy()) {
                (None, mesh) => mesh,
                (Some(AnyMesh::Plane(a)), AnyMesh::Plane(b)) => AnyMesh::Plane(both(a, b)?),
                (Some(AnyMesh::Space(a)), AnyMesh::Space(b)) => AnyMesh::Space(both(a, b)?),
                _ => {
                    let text = "meshes of the plane and of space cannot be joined";
                    return Err(ModelError::new_err(text));
                }
            });
        }
        let whole = whole.ok_or_else(|| ModelError::new_err("there are no meshes to join"))?;
        Ok(Self::new(whole))
    }

    /// The mesh moved, its regions and boundaries under other names.
    fn placed(
        &self,
        shift: Vec<f64>,
        regions: HashMap<String, String>,
        boundaries: HashMap<String, String>,
    ) -> PyResult<Self> {
        fn moved<const D: usize>(
            mesh: &mesh::Mesh<D>,
            shift: &[f64],
            regions: &HashMap<String, String>,
            boundaries: &HashMap<String, String>,
        ) -> PyResult<mesh::Mesh<D>>
        where
            ElementKind: Topology<D>,
        {
            let by: [f64; D] = shift.try_into().map_err(|_| {
                argument(
                    "shift",
                    format!("expected {D} numbers, found {}", shift.len()),
                )
            })?;
            let named = |names: &HashMap<String, String>, name: &str| {
                names.get(name).cloned().unwrap_or_else(|| name.to_owned())
            };
            let mut mesh = mesh.clone();
            mesh.shift(by);
            mesh.rename(|name| named(regions, name), |name| named(boundaries, name));
            Ok(mesh)
        }
        Ok(Self::new(match &*self.0 {
            AnyMesh::Plane(mesh) => AnyMesh::Plane(moved(mesh, &shift, &regions, &boundaries)?),
            AnyMesh::Space(mesh) => AnyMesh::Space(moved(mesh, &shift, &regions, &boundaries)?),
        }))
    }

    /// 2 in the plane, 3 in space.
    #[getter]
    fn dim(&self) -> usize {
        match &*self.0 {
            AnyMesh::Plane(_) => 2,
            AnyMesh::Space(_) => 3,
        }
    }

    /// Coordinates of the nodes.
    fn points<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        either!(self, mesh => table(py, &mesh.nodes))
    }

    /// Elements by kind.
    fn cells<'py>(&self, py: Python<'py>) -> PyResult<Vec<Cells<'py>>> {
        either!(self, mesh => cells(py, mesh))
    }

    /// How many elements there are.
    #[getter]
    fn n_elements(&self) -> usize {
        either!(self, mesh => mesh.elements.len())
    }

    /// The number of the region of each element, the names of regions, and groups of them by name.
    #[expect(clippy::type_complexity, reason = "a tuple for Python")]
    fn regions<'py>(
        &self,
        py: Python<'py>,
    ) -> (
        Bound<'py, PyArray1<u32>>,
        Vec<String>,
        BTreeMap<String, Vec<u32>>,
    ) {
        either!(self, mesh => {
            let of = mesh.elements.iter().map(|element| element.region).collect();
            (flat(py, of), mesh.regions.clone(), mesh.groups.clone())
        })
    }

    /// The facets of each boundary: arrays by the number of nodes.
    fn boundaries<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        either!(self, mesh => {
            for (name, facets) in &mesh.boundaries {
                let mut by_width: BTreeMap<usize, Vec<u32>> = BTreeMap::new();
                for facet in facets {
                    let nodes = facet_nodes(facet);
                    by_width.entry(nodes.len()).or_default().extend(nodes);
                }
                let arrays = by_width.into_iter().map(|(width, nodes)| {
                    let rows = nodes.len() / width;
                    flat(py, nodes).reshape([rows, width])
                });
                all.set_item(name, arrays.collect::<PyResult<Vec<_>>>()?)?;
            }
        });
        Ok(all)
    }

    /// Sets of nodes by name.
    fn node_sets<'py>(&self, py: Python<'py>) -> BTreeMap<String, Bound<'py, PyArray1<u32>>> {
        either!(self, mesh => {
            let sets = mesh.node_sets.iter();
            sets.map(|(name, set)| (name.clone(), flat(py, set.clone()))).collect()
        })
    }

    /// Remarks on it.
    fn notes(&self) -> Vec<String> {
        either!(self, mesh => mesh.notes.clone())
    }

    /// The number of bodies: parts that share no node.
    #[getter]
    fn n_bodies(&self) -> usize {
        either!(self, mesh => mesh.bodies().0)
    }
}

/// Elements of a mesh by kind.
pub fn cells<'py, const D: usize>(
    py: Python<'py>,
    mesh: &mesh::Mesh<D>,
) -> PyResult<Vec<Cells<'py>>>
where
    ElementKind: Topology<D>,
{
    let of_kind = |(kind, _): &(ElementKind, usize)| {
        let elements = (0..).zip(&mesh.elements);
        let (mut numbers, mut nodes) = (Vec::new(), Vec::new());
        for (number, element) in elements.filter(|(_, element)| element.kind() == *kind) {
            numbers.push(number);
            nodes.extend(element.nodes());
        }
        let shape = [numbers.len(), kind.n_nodes()];
        Ok((
            kind.name(),
            flat(py, numbers),
            flat(py, nodes).reshape(shape)?,
        ))
    };
    mesh.kinds().iter().map(of_kind).collect()
}

/// Numbers of nodes, which are not negative and not too large to be counted.
fn numbers(name: &str, all: &[i64]) -> PyResult<Vec<u32>> {
    let one = |&number: &i64| {
        u32::try_from(number)
            .map_err(|_| argument(name, format!("{number} is not the number of a node")))
    };
    all.iter().map(one).collect()
}

/// The parts of a mesh, with the numbers of nodes of each kind of element one after the other.
struct Parts {
    kinds: Vec<(ElementKind, Vec<u32>)>,
    region_of: Vec<i64>,
    regions: Vec<String>,
    groups: BTreeMap<String, Vec<u32>>,
    facets: BTreeMap<String, Vec<Vec<u32>>>,
    node_sets: BTreeMap<String, Vec<u32>>,
    /// The sets that are only boundaries.
    by_nodes: Vec<String>,
    notes: Vec<String>,
}

impl Parts {
    fn mesh<const D: usize>(self, nodes: Vec<[f64; D]>) -> Result<mesh::Mesh<D>, String>
    where
        ElementKind: Topology<D>,
    {
        let mut elements: Vec<Element<D>> = Vec::new();
        for (kind, of_kind) in &self.kinds {
            let solid = is_solid(*kind);
            if solid != (D == 3) {
                return Err(format!(
                    "cells: {} are not elements of a mesh whose points have {D} coordinates",
                    kind.name()
                ));
            }
            for nodes in of_kind.chunks(kind.n_nodes()) {
                let region = self.region_of.get(elements.len()).copied().unwrap_or(0);
                elements.push(Element::new(*kind, nodes, region as u32));
            }
        }
        if elements.len() != self.region_of.len() {
            return Err(format!(
                "regions: there are {} elements, and regions for {}",
                elements.len(),
                self.region_of.len()
            ));
        }
        let mut boundaries: BTreeMap<String, Vec<Facet<D>>> = BTreeMap::new();
        let room = Facet::<D>::default().as_ref().len();
        for (name, facets) in &self.facets {
            let mut of_name = Vec::new();
            for nodes in facets {
                if nodes.len() < D || nodes.len() > room {
                    return Err(format!(
                        "boundaries: facets of \"{name}\" have {} nodes, which no facet of {} has",
                        nodes.len(),
                        if D == 2 { "the plane" } else { "space" }
                    ));
                }
                of_name.push(facet::<D>(nodes));
            }
            boundaries.insert(name.clone(), of_name);
        }
        let mesh = mesh::Mesh::from_parts(MeshParts {
            nodes,
            elements,
            regions: self.regions,
            groups: self.groups,
            boundaries,
            node_sets: self.node_sets,
            notes: self.notes,
        });
        let mut mesh = mesh.map_err(|error| error.to_string())?;
        // Sets of nodes are also boundaries, with their outer facets, as in Abaqus input files.
        let sets = (mesh.node_sets.iter()).filter(|(name, _)| !mesh.boundaries.contains_key(*name));
        let facets = sets.map(|(name, set)| (name.clone(), mesh.outer_facets_at(set, true)));
        let facets: Vec<_> = facets.filter(|(_, facets)| !facets.is_empty()).collect();
        mesh.boundaries.extend(facets);
        for name in self.by_nodes {
            mesh.node_sets.remove(&name);
            if !mesh.boundaries.contains_key(&name) {
                return Err(format!(
                    "boundaries: \"{name}\" is a set of nodes that contains all corners of no outer facet; give nodes of a contact or \
                     a support as node_sets"
                ));
            }
        }
        Ok(mesh)
    }
}

/// Whether a kind belongs to space.
fn is_solid(kind: ElementKind) -> bool {
    !matches!(kind.linear(), ElementKind::Triangle | ElementKind::Quad)
}
