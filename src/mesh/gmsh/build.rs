//! From what a file holds to a mesh of the plane or of space.

use super::raw::{GroupSets, Raw};
use super::reader::Reader;
use super::{Failure, Result};
use crate::mesh::{AnyMesh, Element, Facet, Kind, Mesh, Topology, facet};
use std::collections::{BTreeMap, HashMap};

pub(super) fn build(raw: Raw, reader: &Reader, scale: f64) -> Result<AnyMesh> {
    if raw.solids.is_empty() {
        plane(raw, reader, scale).map(AnyMesh::Plane)
    } else {
        solid(raw, reader, scale).map(AnyMesh::Space)
    }
}

/// Surfaces are regions, curves boundaries.
fn plane(mut raw: Raw, reader: &Reader, scale: f64) -> Result<Mesh> {
    let extent = raw
        .nodes
        .iter()
        .flatten()
        .fold(0.0, |a: f64, v| a.max(v.abs()));
    if let Some(first) = raw.nodes.first()
        && raw
            .nodes
            .iter()
            .any(|x| (x[2] - first[2]).abs() > 1e-9 * extent)
    {
        return reader.fail(
            "the mesh is not plane: its z coordinates differ; for a solid body the file needs volume elements: mesh it \
             with gmsh -3, with a physical group for its volumes",
        );
    }
    if raw.faces.is_empty() {
        return reader.fail(
            "no triangles or quadrilaterals: give the surface a physical group, or set Mesh.SaveAll = 1",
        );
    }
    let groups = Groups::new(&raw, reader, 2)?;
    let nodes: Vec<[f64; 2]> = (raw.nodes.iter())
        .map(|x| [x[0] * scale, x[1] * scale])
        .collect();
    groups.mesh(&mut raw.groups, reader, nodes, raw.faces, raw.lines)
}

/// Volumes are regions, surfaces boundaries; curves and points are left out.
fn solid(mut raw: Raw, reader: &Reader, scale: f64) -> Result<Mesh<3>> {
    let groups = Groups::new(&raw, reader, 3)?;
    let nodes = raw.nodes.iter().map(|x| x.map(|v| v * scale)).collect();
    let faces = raw.faces.iter();
    let faces = faces.map(|face| (face.region, facet::<3>(face.nodes())));
    let faces = faces.collect();
    groups.mesh(&mut raw.groups, reader, nodes, raw.solids, faces)
}

/// The names of physical groups, in a mesh of so many dimensions.
struct Groups {
    names: HashMap<(i64, u64), String>,
    dimension: i64,
}

impl Groups {
    fn new(raw: &Raw, reader: &Reader, dimension: i64) -> Result<Self> {
        let named = |&(dim, _): &(i64, u64)| dim == dimension || dim == dimension - 1;
        if raw.groups.sets.len() == 1 && raw.names.keys().any(named) {
            // That is what MSH 2 makes of them with Mesh.SaveAll = 1.
            return reader.fail(
                "the file names physical groups, but no element is in one: save it with Mesh.SaveAll = 0, or as MSH 4.1",
            );
        }
        Ok(Self {
            names: raw.names.clone(),
            dimension,
        })
    }

    /// The names of a set of groups of elements (`below` 0) or of facets (1); two tags may have the same one.
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

    /// The mesh of elements and facets, with the numbers of their sets of groups.
    fn mesh<const D: usize>(
        &self,
        sets: &mut GroupSets,
        reader: &Reader,
        nodes: Vec<[f64; D]>,
        mut elements: Vec<Element<D>>,
        mut facets: Vec<(u32, Facet<D>)>,
    ) -> Result<Mesh<D>>
    where
        Kind: Topology<D>,
    {
        sets.merge_copies(&mut elements, nodes.len(), reader)?;
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
            // A group that is called like this already keeps its name for itself.
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
        let mut mesh = Mesh::new(nodes, elements, regions, boundaries).map_err(Failure::Mesh)?;
        mesh.groups = groups;
        Ok(mesh)
    }
}
