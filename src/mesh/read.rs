//! The choice of the reader of a mesh file.

use super::file::FileError;
use super::file::build::build;
use super::file::raw::Raw;
#[cfg(feature = "files")]
use super::vtu;
use super::{AnyMesh, abaqus, gmsh};
use std::path::Path;

/// Whether a file has the ending of a VTK file, whose regions come from a cell array.
pub fn has_cell_arrays(path: &Path) -> bool {
    extension(path) == "vtu"
}

fn extension(path: &Path) -> String {
    let extension = path.extension().unwrap_or_default();
    extension.to_string_lossy().to_lowercase()
}

/// Reads a mesh, in the dimension of its elements: an Abaqus input file (`.inp`), an unstructured grid of VTK (`.vtu`),
/// or else one of Gmsh. Coordinates are multiplied by `scale`; `groups` names the cell array of a grid that defines its
/// regions and boundaries.
///
/// # Errors
/// If the file cannot be read: with the line at fault, if it has lines.
pub fn read(path: &Path, scale: f64, groups: Option<&str>) -> Result<AnyMesh, FileError> {
    build(raw(path, groups)?, scale).map_err(|failure| failure.of(path))
}

/// As [`read`], with elements of first order at the corners of those in the file: midside nodes are left out, wherever they
/// are.
///
/// # Errors
/// As [`read`].
pub fn read_linear(path: &Path, scale: f64, groups: Option<&str>) -> Result<AnyMesh, FileError> {
    let mut raw = raw(path, groups)?;
    raw.drop_middles();
    build(raw, scale).map_err(|failure| failure.of(path))
}

/// The contents of a file.
fn raw(path: &Path, groups: Option<&str>) -> Result<Raw, FileError> {
    match extension(path).as_str() {
        "inp" => abaqus::raw(path),
        #[cfg(feature = "files")]
        "vtu" => vtu::raw(path, groups),
        #[cfg(not(feature = "files"))]
        "vtu" => {
            let _ = groups;
            Err(FileError::Foreign {
                path: path.to_owned(),
                what: "a grid of VTK, which this program was built without (the feature \"files\" of the crate)"
                    .to_owned(),
            })
        }
        _ => gmsh::raw(path),
    }
}
