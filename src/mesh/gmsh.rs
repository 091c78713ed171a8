//! Gmsh meshes: MSH 2.0 to 2.2 and 4.1, ASCII and binary.
//!
//! A file with volume elements is a mesh of space, one without a mesh of the plane. Physical groups become groups of
//! regions (surfaces; in space volumes) and boundaries (curves; in space surfaces) under their names, or under their
//! numbers where they have none. Elements in the same groups are a region, named after these. Triangles and
//! quadrilaterals in the plane z = const, tetrahedra, hexahedra and wedges in space, of first and of second order, and
//! pyramids.

mod foreign;
mod reader;
mod v2;
mod v4;
pub(super) mod write;

use super::file::build::build;
use super::file::raw::{Cell, MOST_NODES, Raw};
use super::file::{self, FileError, Result};
use super::{AnyMesh, ElementKind};
use reader::Reader;
use std::path::Path;

/// Reads a mesh, of the dimension that its elements have; coordinates are multiplied by `scale`.
///
/// # Errors
/// If the file cannot be read, is of another kind, or has something that no mesh here has: with its line.
pub fn read(path: &Path, scale: f64) -> std::result::Result<AnyMesh, FileError> {
    build(raw(path)?, scale).map_err(|failure| failure.of(path))
}

/// The contents of a file.
pub(super) fn raw(path: &Path) -> std::result::Result<Raw, FileError> {
    let bytes = file::bytes(path)?;
    if let Some(what) = foreign::foreign(path, &bytes) {
        let path = path.to_owned();
        return Err(FileError::Foreign { path, what });
    }
    parse(&bytes).map_err(|failure| failure.of(path))
}

fn parse(bytes: &[u8]) -> Result<Raw> {
    let mut reader = Reader::new(bytes);
    let mut raw = Raw::default();
    let mut version = None;
    while let Some(line) = reader.line() {
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        let Some(section) = line.strip_prefix('$') else {
            return reader.fail(format!(
                "expected the beginning of a section, found \"{line}\""
            ));
        };
        if matches!((section, version), ("NOD" | "NOE", None)) {
            return reader.fail(format!("MSH version 1 is not supported: {SAVE_AS}"));
        }
        if version.is_none() && section != "MeshFormat" && section != "Comments" {
            return reader.fail("this is not a Gmsh MSH file: it does not begin with $MeshFormat");
        }
        match (section, version) {
            ("MeshFormat", _) => version = Some(reader.format()?),
            ("PhysicalNames", _) => read_names(&mut reader, &mut raw)?,
            ("Entities", Some(4)) => v4::entities(&mut reader, &mut raw)?,
            ("Nodes", Some(4)) => v4::nodes(&mut reader, &mut raw)?,
            ("Nodes", _) => v2::nodes(&mut reader, &mut raw, false)?,
            ("ParametricNodes", Some(2)) => v2::nodes(&mut reader, &mut raw, true)?,
            ("Elements", Some(4)) => v4::elements(&mut reader, &mut raw)?,
            ("Elements", _) => v2::elements(&mut reader, &mut raw)?,
            ("PartitionedEntities", _) => {
                return reader
                    .fail("partitioned meshes are not supported: save the mesh unpartitioned");
            }
            _ => {}
        }
        reader.end(section)?;
    }
    if version.is_none() {
        return reader.fail("there is no $MeshFormat: the file is cut short");
    }
    if raw.solids.is_empty() && !raw.is_level() {
        return reader.fail(NOT_PLANE);
    }
    if raw.solids.is_empty() && raw.faces.is_empty() {
        return reader.fail(
            "no triangles or quadrilaterals: give the surface a physical group, or set Mesh.SaveAll = 1",
        );
    }
    if raw.has_names_alone() {
        // MSH 2 writes them so with Mesh.SaveAll = 1.
        return reader.fail(
            "the file names physical groups, but no element is in one: save it with Mesh.SaveAll = 0, or as MSH 4.1",
        );
    }
    Ok(raw)
}

const NOT_PLANE: &str = "the mesh is not plane: its z coordinates differ; for a solid body the file needs volume \
                         elements: mesh it with gmsh -3, with a physical group for its volumes";

/// The kinds of elements that bodies and their boundaries consist of, with Gmsh's numbers.
const TYPES: [(i64, Cell); 17] = [
    (15, Cell::Point),
    (1, Cell::Line),
    (8, Cell::Line3),
    (2, Cell::Element(ElementKind::Triangle)),
    (9, Cell::Element(ElementKind::Triangle6)),
    (3, Cell::Element(ElementKind::Quad)),
    (16, Cell::Element(ElementKind::Quad8)),
    (10, Cell::Element(ElementKind::Quad9)),
    (4, Cell::Element(ElementKind::Tetrahedron)),
    (11, Cell::Element(ElementKind::Tetrahedron10)),
    (5, Cell::Element(ElementKind::Hexahedron)),
    (17, Cell::Element(ElementKind::Hexahedron20)),
    (12, Cell::Element(ElementKind::Hexahedron27)),
    (6, Cell::Element(ElementKind::Wedge)),
    (18, Cell::Element(ElementKind::Wedge15)),
    (13, Cell::Element(ElementKind::Wedge18)),
    (7, Cell::Element(ElementKind::Pyramid)),
];

/// The kind of a type of element of Gmsh.
fn cell(reader: &Reader, kind: i64) -> Result<Cell> {
    if let Some(&(_, cell)) = TYPES.iter().find(|known| known.0 == kind) {
        return Ok(cell);
    }
    match kind {
        14 | 19 => reader.fail(
            "pyramids of second order are not supported: set Mesh.ElementOrder = 1 in Gmsh (or use tetrahedra alone, or \
             hexahedra and wedges of extruded or transfinite volumes)",
        ),
        20..=33 | 36..=66 | 71..=131 | 137 => reader.fail(
            "elements of an order above 2 are not supported: set Mesh.ElementOrder = 1 or 2 in Gmsh",
        ),
        _ => reader.fail(format!(
            "element type {kind} is not supported: use triangles and quadrilaterals, in space tetrahedra, hexahedra, \
             wedges and pyramids"
        )),
    }
}

/// Reads the numbers of the nodes of an element, and adds ours in our order.
fn nodes_of<'a>(
    cell: Cell,
    number: impl Fn(&mut Reader<'a>) -> Result<usize>,
    reader: &mut Reader<'a>,
    raw: &Raw,
    nodes: &mut Vec<u32>,
) -> Result<()> {
    let tags = &mut [0; MOST_NODES][..cell.n_nodes()];
    for tag in &mut *tags {
        *tag = number(reader)?;
    }
    let order = match cell {
        Cell::Element(kind) => order(kind),
        _ => None,
    };
    for place in 0..tags.len() {
        let tag = tags[order.map_or(place, |order| order[place])];
        let Some(node) = raw.node(tag) else {
            return reader.fail(format!("an element names node {tag}, which does not exist"));
        };
        nodes.push(node);
    }
    Ok(())
}

/// The nodes of an element, in the order in which Gmsh lists them.
fn in_gmshs_order(kind: ElementKind, nodes: &[u32]) -> Vec<u32> {
    let mut listed = nodes.to_vec();
    if let Some(order) = order(kind) {
        (nodes.iter().zip(order)).for_each(|(&node, &place)| listed[place] = node);
    }
    listed
}

/// The order of the nodes of a second-order element in Gmsh, if it differs from ours, which is VTK's.
pub(super) fn order(kind: ElementKind) -> Option<&'static [usize]> {
    match kind {
        ElementKind::Tetrahedron10 => Some(&[0, 1, 2, 3, 4, 5, 6, 7, 9, 8]),
        ElementKind::Hexahedron20 => Some(&HEXAHEDRON[..20]),
        ElementKind::Hexahedron27 => Some(&HEXAHEDRON),
        ElementKind::Wedge15 => Some(&WEDGE[..15]),
        ElementKind::Wedge18 => Some(&WEDGE),
        _ => None,
    }
}

const HEXAHEDRON: [usize; 27] = [
    0, 1, 2, 3, 4, 5, 6, 7, 8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 14, 15, 22, 23, 21, 24, 20, 25,
    26,
];
const WEDGE: [usize; 18] = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16];

/// The places of the nodes of an element that was read in our order, if its file lists them in Gmsh's, or was read in Gmsh's
/// and has ours.
pub(super) fn other_orders(kind: ElementKind) -> Vec<Vec<usize>> {
    let Some(order) = order(kind) else {
        return Vec::new();
    };
    let mut inverse = vec![0; order.len()];
    (order.iter().enumerate()).for_each(|(ours, &theirs)| inverse[theirs] = ours);
    vec![order.to_vec(), inverse]
}

const SAVE_AS: &str = "save as 4.1 or 2.2 (gmsh -format msh41 …)";

/// Names are text in binary files, too.
fn read_names(reader: &mut Reader, raw: &mut Raw) -> Result<()> {
    let binary = std::mem::replace(&mut reader.binary, false);
    let count: usize = reader.number("a number of physical names")?;
    reader.line();
    for _ in 0..count {
        let line = reader.line().unwrap_or_default();
        let line = line.trim();
        let mut parts = line.splitn(3, char::is_whitespace);
        let (dim, tag, name) = (parts.next(), parts.next(), parts.next());
        let parsed = dim
            .and_then(|d| d.parse().ok())
            .zip(tag.and_then(|t| t.parse::<i64>().ok()));
        let (Some((dim, tag)), Some(name)) = (parsed, name) else {
            return reader.fail(format!("\"{line}\" is not: dimension tag \"name\""));
        };
        let name = name.trim().trim_matches('"');
        if !name.is_empty() {
            let key = (dim, tag.unsigned_abs());
            raw.names.insert(key, name.to_owned());
        }
    }
    reader.binary = binary;
    Ok(())
}
