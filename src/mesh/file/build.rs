//! From the contents of a file to a mesh of the plane or of space.

use super::raw::{GroupSets, Raw};
use super::{Failure, Result};
use crate::mesh::{
    AnyMesh, Element, ElementKind, Facet, FacetFault, FaultKind, Mesh, MeshParts, Topology, facet,
    facet_nodes,
};
use std::collections::{BTreeMap, HashMap};

impl Raw {
    /// Whether all nodes have one z, up to rounding.
    pub fn is_level(&self) -> bool {
        let coordinates = self.nodes.iter().flatten();
        let extent = coordinates.fold(0.0, |a: f64, v| a.max(v.abs()));
        let Some(first) = self.nodes.first() else {
            return true;
        };
        (self.nodes.iter()).all(|x| !((x[2] - first[2]).abs() > 1e-9 * extent))
    }

    /// Whether groups of elements or facets have names, but nothing in them.
    pub fn has_names_alone(&self) -> bool {
        let dimension = if self.solids.is_empty() { 2 } else { 3 };
        let named = |&(dim, _): &(i64, u64)| dim == dimension || dim == dimension - 1;
        self.groups.sets.len() == 1 && self.names.keys().any(named)
    }
}

/// The mesh of a file: a solid if it has any volume elements, otherwise one of the plane, whose nodes must all have one
/// z.
pub(in crate::mesh) fn build(raw: Raw, scale: f64) -> Result<AnyMesh> {
    if raw.solids.is_empty() {
        plane(raw, scale).map(AnyMesh::Plane)
    } else {
        solid(raw, scale).map(AnyMesh::Space)
    }
}

/// Surfaces are regions, curves boundaries, points sets of nodes.
fn plane(mut raw: Raw, scale: f64) -> Result<Mesh> {
    let groups = Groups::new(&raw, 2);
    let none = (raw.without_facets.iter())
        .map(|(name, x)| (name.clone(), [x[0] * scale, x[1] * scale]))
        .collect();
    let nodes: Vec<[f64; 2]> = (raw.nodes.iter())
        .map(|x| [x[0] * scale, x[1] * scale])
        .collect();
    let sets = groups.node_sets(&mut raw);
    let mut mesh = groups.mesh(&mut raw.groups, nodes, raw.faces, raw.lines, sets)?;
    note(&mut mesh, none);
    mesh.notes.extend(raw.notes);
    Ok(mesh)
}

/// Volumes are regions, surfaces boundaries, curves and points sets of nodes.
fn solid(mut raw: Raw, scale: f64) -> Result<Mesh<3>> {
    let groups = Groups::new(&raw, 3);
    let nodes = raw.nodes.iter().map(|x| x.map(|v| v * scale)).collect();
    let faces = raw.faces.iter();
    let faces = faces.map(|face| (face.region, facet::<3>(face.nodes())));
    let faces = faces.collect();
    let sets = groups.node_sets(&mut raw);
    let mut mesh = groups.mesh(&mut raw.groups, nodes, raw.solids, faces, sets)?;
    let none = (raw.without_facets.into_iter()).map(|(name, x)| (name, x.map(|v| v * scale)));
    note(&mut mesh, none.collect());
    mesh.notes.extend(raw.notes);
    Ok(mesh)
}

/// Notes the names of boundaries that have no facet, with a node of each.
fn note<const D: usize>(mesh: &mut Mesh<D>, without_facets: Vec<(String, [f64; D])>)
where
    ElementKind: Topology<D>,
{
    for (name, x) in without_facets {
        if mesh.boundaries.contains_key(&name) || mesh.faults.contains_key(&name) {
            continue;
        }
        let fault = FacetFault {
            kind: FaultKind::NoFacet,
            ends: [x; 2],
        };
        mesh.boundaries.insert(name.clone(), Vec::new());
        mesh.faults.insert(name, fault);
    }
}

/// The names of groups, in a mesh of so many dimensions.
struct Groups {
    names: HashMap<(i64, u64), String>,
    dimension: i64,
}

impl Groups {
    fn new(raw: &Raw, dimension: i64) -> Self {
        Self {
            names: raw.names.clone(),
            dimension,
        }
    }

    /// The names of a set of groups of elements (`below` 0), of facets (1) or of less (2, 3); two tags may have the same one.
    fn names(&self, sets: &GroupSets, below: i64, set: u32) -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for &tag in &sets.sets[set as usize] {
            let name = match self.names.get(&(self.dimension - below, tag)) {
                Some(name) => name.clone(),
                None => tag.to_string(),
            };
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// The sets of nodes: those under names, the groups of points, and in space those of curves.
    fn node_sets(&self, raw: &mut Raw) -> BTreeMap<String, Vec<u32>> {
        let mut all: BTreeMap<String, Vec<u32>> = BTreeMap::new();
        for (name, nodes) in std::mem::take(&mut raw.node_sets) {
            all.entry(name).or_default().extend(nodes);
        }
        let mut add = |below: i64, set: u32, nodes: &[u32]| {
            for name in self.names(&raw.groups, below, set) {
                all.entry(name).or_default().extend(nodes);
            }
        };
        for &(set, node) in &raw.points {
            add(self.dimension, set, &[node]);
        }
        if self.dimension == 3 {
            for (set, line) in &raw.lines {
                add(2, *set, facet_nodes(line));
            }
        }
        for nodes in all.values_mut() {
            nodes.sort_unstable();
            nodes.dedup();
        }
        all
    }

    /// The mesh of elements and facets, with the numbers of their sets of groups.
    fn mesh<const D: usize>(
        &self,
        sets: &mut GroupSets,
        nodes: Vec<[f64; D]>,
        mut elements: Vec<Element<D>>,
        mut facets: Vec<(u32, Facet<D>)>,
        node_sets: BTreeMap<String, Vec<u32>>,
    ) -> Result<Mesh<D>>
    where
        ElementKind: Topology<D>,
    {
        let copies = (sets.merge_copies(&mut elements, &nodes)).map_err(Failure::NoMesh)?;
        let mut regions: Vec<String> = Vec::new();
        let mut groups: BTreeMap<String, Vec<u32>> = BTreeMap::new();
        let mut region_of_names: HashMap<Vec<String>, u32> = HashMap::new();
        let mut region_of_set: Vec<Option<u32>> = vec![None; sets.sets.len()];
        for element in &mut elements {
            let region = &mut region_of_set[element.region as usize];
            element.region = *region.get_or_insert_with(|| {
                let mut names = self.names(sets, 0, element.region);
                if names.is_empty() {
                    names.push("unnamed".to_owned());
                }
                *region_of_names.entry(names).or_insert_with_key(|names| {
                    let region = regions.len() as u32;
                    for name in names {
                        groups.entry(name.clone()).or_default().push(region);
                    }
                    regions.push(names.join(" & "));
                    region
                })
            });
        }
        for (region, name) in (0..).zip(&regions) {
            // A group that already has this name keeps it.
            groups.entry(name.clone()).or_insert_with(|| vec![region]);
        }

        facets.sort_by_key(|facet| facet.0);
        let mut boundaries: BTreeMap<String, Vec<Facet<D>>> = BTreeMap::new();
        for facets in facets.chunk_by(|a, b| a.0 == b.0) {
            for name in self.names(sets, 1, facets[0].0) {
                let boundary = boundaries.entry(name).or_default();
                boundary.extend(facets.iter().map(|facet| facet.1));
            }
        }
        let parts = MeshParts {
            nodes,
            elements,
            regions,
            groups,
            boundaries,
            node_sets,
            notes: copies.into_iter().collect(),
        };
        Mesh::checked(parts, false).map_err(Failure::Mesh)
    }
}
