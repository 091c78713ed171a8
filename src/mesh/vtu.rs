//! Unstructured grids of VTK (`.vtu`): points, cells, and the cell array that defines regions and boundaries.
//!
//! XML with ASCII, base64 or raw data, inline or appended, plain or compressed by zlib (VTK File Formats, docs.vtk.org).
//! Cells of the highest dimension are the bodies, those one dimension lower their boundaries; the value of the array in
//! them is their name.

mod data;
mod xml;

use super::ElementKind;
use super::file::raw::{Cell, Listed, Raw};
use super::file::{self, Failure, FileError, Result};
use data::{File, Values};
use rayon::prelude::*;
use std::path::Path;

/// Cells that one task reads.
const CELLS: usize = 1 << 12;

/// Cell arrays that programs use for regions, for cases that name none: the first one in the file counts.
const ARRAYS: [&str; 10] = [
    "region",
    "gmsh:physical",
    "physical",
    "CellEntityIds",
    "PhysicalIds",
    "MaterialIds",
    "material",
    "cell_tags",
    "medit:ref",
    "GroupIds",
];

/// The contents of a file. `groups` names the cell array that defines regions and boundaries; without it, the first of
/// the usual names counts.
///
/// # Errors
/// If it cannot be read, or has something that meshes here do not support: with its line.
pub(super) fn raw(path: &Path, groups: Option<&str>) -> std::result::Result<Raw, FileError> {
    let bytes = file::bytes(path)?;
    parse(&bytes, groups).map_err(|failure| failure.of(path))
}

fn parse(bytes: &[u8], groups: Option<&str>) -> Result<Raw> {
    let file = File::new(bytes)?;
    let mut raw = Raw::default();
    let coordinates = file.needed("Points", None)?.floats()?;
    if coordinates.len() % 3 != 0 {
        return no_mesh("the points of a grid need three coordinates each");
    }
    for x in coordinates.as_chunks::<3>().0 {
        if !x.iter().all(|v| v.is_finite()) {
            let number = raw.nodes.len();
            return no_mesh(format!(
                "point {number} has a coordinate that is not finite"
            ));
        }
        raw.nodes.push(*x);
    }
    let types = file.needed("Cells", Some("types"))?.integers()?;
    let offsets = file.needed("Cells", Some("offsets"))?.integers()?;
    let connectivity = file.needed("Cells", Some("connectivity"))?.integers()?;
    if types.len() != offsets.len() {
        return no_mesh("types and offsets differ in length");
    }
    let groups = Groups::find(&file, groups, types.len())?;
    let n_nodes = raw.nodes.len();
    let add = |number: usize, listed: &mut Listed| {
        let begin = number.checked_sub(1).map_or(0, |before| offsets[before]);
        let [begin, end] =
            [begin, offsets[number]].map(|end| usize::try_from(end).unwrap_or(usize::MAX));
        let Some(points) = connectivity.get(begin..end) else {
            return no_mesh(format!("cell {number} has offsets beyond its connectivity"));
        };
        let kind = types[number];
        let (cell, order) = cell(kind, number)?;
        if points.len() != cell.n_nodes() {
            let message = format!(
                "cell {number} of type {kind} has {} nodes instead of {}",
                points.len(),
                cell.n_nodes()
            );
            return no_mesh(message);
        }
        listed.cells.push((cell, groups.tag(number)));
        for place in 0..points.len() {
            let point = points[order.map_or(place, |order| order[place])];
            match u32::try_from(point) {
                Ok(point) if (point as usize) < n_nodes => listed.nodes.push(point),
                _ => {
                    return no_mesh(format!(
                        "cell {number} names point {point}, which does not exist"
                    ));
                }
            }
        }
        Ok(())
    };
    let parts: Vec<Result<Listed>> = (0..types.len().div_ceil(CELLS))
        .into_par_iter()
        .map(|task| {
            let mut listed = Listed::default();
            let mut numbers = task * CELLS..((task + 1) * CELLS).min(types.len());
            numbers.try_for_each(|number| add(number, &mut listed))?;
            Ok(listed)
        })
        .collect();
    raw.push_listed(parts.into_iter().collect::<Result<_>>()?);
    for (tag, name) in groups.names() {
        for dimension in 1..4 {
            raw.names.insert((dimension, tag), name.clone());
        }
    }
    if raw.solids.is_empty() && raw.faces.is_empty() {
        return no_mesh(
            "there are no triangles, quadrilaterals, tetrahedra, hexahedra, wedges or pyramids in it",
        );
    }
    if raw.solids.is_empty() && !raw.is_level() {
        return no_mesh(
            "the mesh is not plane: its z coordinates differ; a solid body needs volume cells",
        );
    }
    Ok(raw)
}

fn no_mesh<T>(message: impl Into<String>) -> Result<T> {
    Err(Failure::NoMesh(message.into()))
}

/// The cell of a type of VTK, and the order of its nodes in the file, if it differs from ours.
fn cell(kind: i64, number: usize) -> Result<(Cell, Option<&'static [usize]>)> {
    let plain = |kind: ElementKind| Ok((Cell::Element(kind), None));
    match kind {
        1 => Ok((Cell::Point, None)),
        3 => Ok((Cell::Line, None)),
        5 => plain(ElementKind::Triangle),
        // VTK_PIXEL and VTK_VOXEL count along the axes.
        8 => Ok((Cell::Element(ElementKind::Quad), Some(&[0, 1, 3, 2]))),
        9 => plain(ElementKind::Quad),
        10 => plain(ElementKind::Tetrahedron),
        11 => Ok((
            Cell::Element(ElementKind::Hexahedron),
            Some(&[0, 1, 3, 2, 4, 5, 7, 6]),
        )),
        12 => plain(ElementKind::Hexahedron),
        13 => plain(ElementKind::Wedge),
        14 => plain(ElementKind::Pyramid),
        21 => Ok((Cell::Line3, None)),
        22 => plain(ElementKind::Triangle6),
        23 => plain(ElementKind::Quad8),
        24 => plain(ElementKind::Tetrahedron10),
        25 => plain(ElementKind::Hexahedron20),
        26 => plain(ElementKind::Wedge15),
        28 => plain(ElementKind::Quad9),
        29 => plain(ElementKind::Hexahedron27),
        32 => plain(ElementKind::Wedge18),
        27 | 37 => no_mesh(format!(
            "cell {number} (type {kind}) is a pyramid of second order, which is not supported: save the mesh with linear \
             cells, or use tetrahedra alone, or hexahedra and wedges"
        )),
        30..=36 | 60..=81 => no_mesh(format!(
            "cell {number} (type {kind}) is not one of the supported linear and quadratic cells: save the mesh with \
             types 5, 9, 10, 12, 13, 14, 22 to 26, 28, 29 or 32"
        )),
        _ => no_mesh(format!(
            "cell {number} is of type {kind}, which is not supported: use triangles and quadrilaterals, in space \
             tetrahedra, hexahedra, wedges and pyramids"
        )),
    }
}

/// The values of the cell array that defines regions.
struct Groups(Option<Vec<i64>>);

impl Groups {
    fn find(file: &File, wanted: Option<&str>, cells: usize) -> Result<Self> {
        let known = file.cell_arrays();
        let name = match wanted {
            Some(name) if known.iter().any(|known| known == name) => Some(name),
            Some(name) => {
                return no_mesh(format!(
                    "there is no cell array \"{name}\"; the grid has {}",
                    match known.as_slice() {
                        [] => "none".to_owned(),
                        some => some.join(", "),
                    }
                ));
            }
            None => ARRAYS
                .into_iter()
                .find(|name| known.iter().any(|known| known == name)),
        };
        let Some(name) = name else {
            return Ok(Self(None));
        };
        let values = match file.needed("CellData", Some(name))? {
            Values::Integers(values) => values,
            Values::Floats(values) if values.iter().all(|v| v.fract() == 0.0) => {
                values.iter().map(|&v| v as i64).collect()
            }
            Values::Floats(_) => {
                return no_mesh(format!(
                    "cell array \"{name}\" has values that are not integers: it cannot define regions"
                ));
            }
        };
        if values.len() != cells {
            return no_mesh(format!(
                "cell array \"{name}\" has {} values for {cells} cells",
                values.len()
            ));
        }
        Ok(Self(Some(values)))
    }

    /// The group of a cell as a number above 0; 0 without groups.
    fn tag(&self, cell: usize) -> i64 {
        self.0.as_ref().map_or(0, |values| tag(values[cell]))
    }

    /// The name of each group: its value.
    fn names(self) -> impl Iterator<Item = (u64, String)> {
        let mut values = self.0.unwrap_or_default();
        values.par_sort_unstable();
        values.dedup();
        (values.into_iter()).map(|value| (tag(value).unsigned_abs(), value.to_string()))
    }
}

/// A value as a number above 0: tags are unsigned, and 0 means none.
fn tag(value: i64) -> i64 {
    if value >= 0 {
        value + 1
    } else {
        (1 << 40) - value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::AnyMesh;
    use crate::mesh::file::build::build;

    /// A grid of one tetrahedron and one of its faces, with the given region array; values in ASCII.
    fn grid(kind: &str, nodes: &str, ends: &str, array: &str) -> String {
        format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\">\n\
             <UnstructuredGrid>\n<Piece NumberOfPoints=\"4\" NumberOfCells=\"2\">\n\
             <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">\
             0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points>\n<Cells>\n\
             <DataArray type=\"Int32\" Name=\"connectivity\" format=\"ascii\">{nodes}</DataArray>\n\
             <DataArray type=\"Int32\" Name=\"offsets\" format=\"ascii\">{ends}</DataArray>\n\
             <DataArray type=\"UInt8\" Name=\"types\" format=\"ascii\">{kind}</DataArray></Cells>\n\
             <CellData>{array}</CellData></Piece></UnstructuredGrid></VTKFile>\n"
        )
    }

    const ARRAY: &str =
        "<DataArray type=\"Int64\" Name=\"material\" format=\"ascii\">7 -2</DataArray>";

    #[test]
    fn cells_and_their_groups_are_read() {
        let text = grid("10 5", "0 1 2 3 2 1 0", "4 7", ARRAY);
        let raw = parse(text.as_bytes(), None);
        let Ok(AnyMesh::Space(mesh)) = raw.and_then(|raw| build(raw, 2.0)) else {
            panic!("no solid");
        };
        assert_eq!(mesh.nodes[3], [0.0, 0.0, 2.0]);
        assert_eq!(mesh.regions, ["7"]);
        assert_eq!(mesh.boundaries["-2"].len(), 1);
        assert_eq!(
            mesh.facet_normal(&mesh.boundaries["-2"][0]).1,
            [0.0, 0.0, -1.0]
        );
    }

    #[test]
    fn files_without_a_mesh_are_reported() {
        let told = |text: String, groups: Option<&str>| {
            let failure = parse(text.as_bytes(), groups).err();
            let failure = failure.unwrap_or_else(|| panic!("accepted:\n{text}"));
            failure.of(Path::new("a.vtu")).to_string()
        };
        let sound = || grid("10 5", "0 1 2 3 2 1 0", "4 7", ARRAY);
        for (text, groups, expected) in [
            (
                grid("24 5", "0 1 2 3 2 1 0", "4 7", ARRAY),
                None,
                "a.vtu: cell 0 of type 24 has 4 nodes instead of 10",
            ),
            (
                grid("71 5", "0 1 2 3 2 1 0", "4 7", ARRAY),
                None,
                "a.vtu: cell 0 (type 71) is not one of the supported linear and quadratic cells",
            ),
            (
                grid("27 5", "0 1 2 3 2 1 0", "4 7", ARRAY),
                None,
                "cell 0 (type 27) is a pyramid of second order",
            ),
            (
                grid("10 5", "0 1 2 9 2 1 0", "4 7", ARRAY),
                None,
                "cell 0 names point 9, which does not exist",
            ),
            (
                grid("10 5", "0 1 2 3 2 1 0", "4 8", ARRAY),
                None,
                "cell 1 has offsets beyond its connectivity",
            ),
            (
                grid("10 5", "0 1 2 3 2 1 x", "4 7", ARRAY),
                None,
                "a.vtu, line 7: \"x\" is not a number",
            ),
            (
                sound(),
                Some("parts"),
                "there is no cell array \"parts\"; the grid has material",
            ),
            (
                sound().replace("</Cells>", "<Cells>"),
                None,
                "a.vtu, line 10: <Cells> of line 9 is not closed",
            ),
            (
                sound().replace("ascii\">7", "binary\">7"),
                None,
                "line 10: the data is not base64",
            ),
            (
                sound().replace("UnstructuredGrid\" byte", "PolyData\" byte"),
                None,
                "a file of type PolyData: save an unstructured grid",
            ),
            (
                sound().replace(
                    " byte_order",
                    " compressor=\"vtkLZ4DataCompressor\" byte_order",
                ),
                None,
                "vtkLZ4DataCompressor is not supported: save it with zlib or uncompressed",
            ),
            (String::new(), None, "not an XML VTK file"),
        ] {
            let message = told(text, groups);
            assert!(message.contains(expected), "{expected}\n{message}");
        }
    }
}
