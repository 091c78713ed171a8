//! Unstructured grids of VTK (`.vtu`): points, cells, and the cell array that tells regions and boundaries.
//!
//! XML with ASCII, base64 or raw data, inline or appended, plain or compressed by zlib (VTK File Formats, docs.vtk.org).
//! Cells of the highest dimension are the bodies, those of one less their boundaries; both are called after the value
//! that the array has in them.

mod data;
mod xml;

use super::AnyMesh;
use super::file::raw::{Cell, Raw};
use super::file::{self, Failure, FileError, Result};
use data::{File, Values};
use std::path::Path;

/// Cell arrays that programs tell regions by, where a case names none: the first that a file has.
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

/// Reads a mesh, of the dimension that its cells have; coordinates are multiplied by `scale`. `groups` names the cell
/// array that tells regions and boundaries; else it is the first of those that programs call so.
///
/// # Errors
/// If the file cannot be read, or has something that no mesh here has: with its line.
pub(super) fn read(
    path: &Path,
    scale: f64,
    groups: Option<&str>,
) -> std::result::Result<AnyMesh, FileError> {
    let bytes = file::bytes(path)?;
    parse(&bytes, scale, groups).map_err(|failure| failure.of(path))
}

fn parse(bytes: &[u8], scale: f64, groups: Option<&str>) -> Result<AnyMesh> {
    let file = File::new(bytes)?;
    let mut raw = Raw::default();
    let points = file.needed("Points", None)?.floats()?;
    if points.len() % 3 != 0 {
        return no_mesh("the points of a grid have three coordinates each");
    }
    for x in points.as_chunks::<3>().0 {
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
        return no_mesh("types and offsets are not of the same length");
    }
    let groups = Groups::find(&file, groups, types.len())?;
    let mut begin = 0;
    for (number, (&kind, &end)) in types.iter().zip(&offsets).enumerate() {
        let end = usize::try_from(end).unwrap_or(usize::MAX);
        let Some(corners) = connectivity.get(begin..end) else {
            return no_mesh(format!("cell {number} has offsets beyond its connectivity"));
        };
        begin = end;
        let (cell, order) = cell(kind, number)?;
        if corners.len() != cell.n_nodes() {
            let message = format!(
                "cell {number} of type {kind} has {} nodes instead of {}",
                corners.len(),
                cell.n_nodes()
            );
            return no_mesh(message);
        }
        let mut nodes = [0; 8];
        for (node, &place) in nodes.iter_mut().zip(order) {
            *node = match u32::try_from(corners[place]) {
                Ok(corner) if (corner as usize) < raw.nodes.len() => corner,
                _ => {
                    let corner = corners[place];
                    return no_mesh(format!(
                        "cell {number} names point {corner}, which does not exist"
                    ));
                }
            };
        }
        let set = raw.groups.number(groups.tag(number));
        raw.push(cell, set, &nodes);
    }
    for (tag, name) in groups.names() {
        for dimension in 1..4 {
            raw.names.insert((dimension, tag), name.clone());
        }
    }
    if raw.solids.is_empty() && raw.faces.is_empty() {
        return no_mesh(
            "there are no triangles, quadrilaterals, tetrahedra, hexahedra or wedges in it",
        );
    }
    if raw.solids.is_empty() && !raw.is_level() {
        return no_mesh(
            "the mesh is not plane: its z coordinates differ; a solid body needs volume cells",
        );
    }
    file::build::build(raw, scale)
}

fn no_mesh<T>(message: impl Into<String>) -> Result<T> {
    Err(Failure::NoMesh(message.into()))
}

/// The cell of a type of VTK, and where its corners stand in the file.
fn cell(kind: i64, number: usize) -> Result<(Cell, &'static [usize])> {
    const AS_THEY_ARE: [usize; 8] = [0, 1, 2, 3, 4, 5, 6, 7];
    let plain = |cell: Cell| Ok((cell, &AS_THEY_ARE[..cell.n_nodes()]));
    match kind {
        1 => plain(Cell::Point),
        3 => plain(Cell::Line),
        5 => plain(Cell::Triangle),
        // VTK_PIXEL and VTK_VOXEL count along the axes.
        8 => Ok((Cell::Quad, &[0, 1, 3, 2])),
        9 => plain(Cell::Quad),
        10 => plain(Cell::Tetrahedron),
        11 => Ok((Cell::Hexahedron, &[0, 1, 3, 2, 4, 5, 7, 6])),
        12 => plain(Cell::Hexahedron),
        13 => plain(Cell::Wedge),
        14 => no_mesh(format!(
            "cell {number} is a pyramid, which is not supported: use tetrahedra alone, or hexahedra and wedges"
        )),
        21..=37 | 60..=81 => no_mesh(format!(
            "cell {number} (type {kind}) is of higher order, which is not supported: save the mesh with linear cells"
        )),
        _ => no_mesh(format!(
            "cell {number} is of type {kind}, which is not supported: use triangles and quadrilaterals, in space \
             tetrahedra, hexahedra and wedges"
        )),
    }
}

/// The values of the cell array that tells regions.
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
                    "cell array \"{name}\" has numbers that are no integers: it cannot tell regions"
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

    /// The group of a cell as a number above 0.
    fn tag(&self, cell: usize) -> Option<i64> {
        let value = self.0.as_ref()?[cell];
        // Tags are without a sign, and 0 is none.
        Some(if value >= 0 {
            value + 1
        } else {
            (1 << 40) - value
        })
    }

    /// What each group is called: its value.
    fn names(&self) -> Vec<(u64, String)> {
        let mut names: Vec<(u64, String)> = (0..self.0.as_ref().map_or(0, Vec::len))
            .filter_map(|cell| Some((self.tag(cell)?.unsigned_abs(), cell)))
            .map(|(tag, cell)| {
                (
                    tag,
                    self.0.as_ref().map_or(0, |values| values[cell]).to_string(),
                )
            })
            .collect();
        names.sort_unstable();
        names.dedup();
        names
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of one tetrahedron and one of its sides, with the region array given; values in ASCII.
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
        let Ok(AnyMesh::Space(mesh)) = parse(text.as_bytes(), 2.0, None) else {
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
    fn what_is_no_mesh_is_told() {
        let told = |text: String, groups: Option<&str>| {
            let failure = parse(text.as_bytes(), 1.0, groups).err();
            let failure = failure.unwrap_or_else(|| panic!("accepted:\n{text}"));
            failure.of(Path::new("a.vtu")).to_string()
        };
        let sound = || grid("10 5", "0 1 2 3 2 1 0", "4 7", ARRAY);
        for (text, groups, expected) in [
            (
                grid("24 5", "0 1 2 3 2 1 0", "4 7", ARRAY),
                None,
                "a.vtu: cell 0 (type 24) is of higher order",
            ),
            (
                grid("14 5", "0 1 2 3 2 1 0", "4 7", ARRAY),
                None,
                "cell 0 is a pyramid",
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
                "a.vtu, line 7: \"x\" is no number",
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
                "line 10: the data is no base64",
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
            (String::new(), None, "no VTK file in XML"),
        ] {
            let message = told(text, groups);
            assert!(message.contains(expected), "{expected}\n{message}");
        }
    }
}
