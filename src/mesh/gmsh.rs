//! Gmsh meshes: MSH 2.0 to 2.2 and 4.1, ASCII and binary.
//!
//! A file with volume elements is a mesh of space, one without a mesh of the plane. Physical groups become groups of
//! regions (surfaces; in space volumes) and boundaries (curves; in space surfaces) under their names, or under their
//! numbers where they have none. Elements in the same groups are a region, named after these. Linear triangles and
//! quadrilaterals in the plane z = const, linear tetrahedra, hexahedra and wedges in space.

mod build;
mod foreign;
mod raw;
mod reader;
mod v2;
mod v4;

use super::{AnyMesh, MeshError};
use raw::Raw;
use reader::Reader;
use std::path::{Path, PathBuf};

/// Why a Gmsh file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum GmshError {
    /// The file could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What stands at a place of the file is not what should.
    #[error("{}, {place}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The line, or in a binary file the byte.
        place: String,
        /// What is wrong, and what to do.
        message: String,
    },
    /// The file is of another kind.
    #[error("{}: this is {what}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is, and what to do.
        what: String,
    },
    /// The file is in order, but no mesh comes of it.
    #[error("{}: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with the mesh.
        source: MeshError,
    },
}

/// Reads a mesh, of the dimension that its elements have; coordinates are multiplied by `scale`.
pub fn read(path: &Path, scale: f64) -> std::result::Result<AnyMesh, GmshError> {
    let bytes = std::fs::read(path).map_err(|source| GmshError::Io {
        path: path.to_owned(),
        source,
    })?;
    if let Some(what) = foreign::foreign(path, &bytes) {
        let path = path.to_owned();
        return Err(GmshError::Foreign { path, what });
    }
    parse(&bytes, scale).map_err(|error| match error {
        Failure::Format { place, message } => GmshError::Format {
            path: path.to_owned(),
            place,
            message,
        },
        Failure::Mesh(source) => GmshError::Mesh {
            path: path.to_owned(),
            source,
        },
    })
}

/// What [`parse`] complains of.
#[derive(Debug)]
enum Failure {
    Format { place: String, message: String },
    Mesh(MeshError),
}

type Result<T> = std::result::Result<T, Failure>;

fn parse(bytes: &[u8], scale: f64) -> Result<AnyMesh> {
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
            return reader.fail("this is no Gmsh MSH file: it does not begin with $MeshFormat");
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
    build::build(raw, &reader, scale)
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
