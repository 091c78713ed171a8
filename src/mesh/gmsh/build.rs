//! From what a file holds to a mesh of the plane.

use super::raw::Raw;
use super::reader::Reader;
use super::{Failure, Result};
use crate::mesh::Mesh;
use std::collections::{BTreeMap, HashMap};

pub(super) fn build(mut raw: Raw, reader: &Reader, scale: f64) -> Result<Mesh> {
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
        return reader.fail("the mesh is not plane: its z coordinates differ");
    }
    if raw.faces.is_empty() {
        return reader.fail(
            "no triangles or quadrilaterals: give the surface a physical group, or set Mesh.SaveAll = 1",
        );
    }
    if raw.groups.sets.len() == 1 && raw.names.keys().any(|&(dim, _)| dim == 1 || dim == 2) {
        // That is what MSH 2 makes of them with Mesh.SaveAll = 1.
        return reader.fail(
            "the file names physical groups, but no element is in one: save it with Mesh.SaveAll = 0, or as MSH 4.1",
        );
    }
    raw.merge_copies(reader)?;

    // The names of each set; two tags may have the same one.
    let names = |dim: i64, set: u32| -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for &tag in &raw.groups.sets[set as usize] {
            let name = match raw.names.get(&(dim, tag)) {
                Some(name) => name.clone(),
                None => tag.to_string(),
            };
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    };
    let mut regions: Vec<String> = Vec::new();
    let mut groups: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    let mut region_of_names: HashMap<Vec<String>, u32> = HashMap::new();
    let mut region_of_set: Vec<Option<u32>> = vec![None; raw.groups.sets.len()];
    let mut elements = std::mem::take(&mut raw.faces);
    for element in &mut elements {
        let region = &mut region_of_set[element.region as usize];
        element.region = *region.get_or_insert_with(|| {
            let mut names = names(2, element.region);
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

    let mut lines = std::mem::take(&mut raw.lines);
    lines.sort_by_key(|line| line.0);
    let mut boundaries: BTreeMap<String, Vec<[u32; 2]>> = BTreeMap::new();
    for lines in lines.chunk_by(|a, b| a.0 == b.0) {
        for name in names(1, lines[0].0) {
            let edges = boundaries.entry(name).or_default();
            edges.extend(lines.iter().map(|line| line.1));
        }
    }
    let nodes = raw
        .nodes
        .iter()
        .map(|x| [x[0] * scale, x[1] * scale])
        .collect();
    let mut mesh = Mesh::new(nodes, elements, regions, boundaries).map_err(Failure::Mesh)?;
    mesh.groups = groups;
    Ok(mesh)
}
