//! Abaqus input files: nodes, elements, sets and surfaces, as Abaqus/CAE and meshers write them.
//!
//! Element sets become groups of regions; element-based surfaces become boundaries, and so do node sets, with the outer
//! facets that have all of their corners in the set. Parts are placed as their instances say. Files named by `INPUT=`,
//! of `*INCLUDE` and of supported data, are looked for beside the first one. Materials, loads and steps are not read.

mod flatten;
#[cfg(feature = "case")]
pub(crate) mod index;
pub(crate) mod keyword;
mod parts;
mod text;
mod types;

use super::file::raw::Raw;
use super::file::{self, Failure, FileError, Result};
use std::path::Path;

/// The contents of a file.
///
/// # Errors
/// If it cannot be read, or has something that meshes here do not support: with its line.
pub(super) fn raw(path: &Path) -> std::result::Result<Raw, FileError> {
    let bytes = file::bytes(path)?;
    let text = text::Text::new(path, &String::from_utf8_lossy(&bytes), false)?;
    drop(bytes);
    parse(&text.text).map_err(|failure| text.locate(failure))
}

fn parse(text: &str) -> Result<Raw> {
    if !text.lines().any(|line| keyword::is_keyword(line.trim())) {
        return Err(Failure::NoMesh(
            "there is no keyword in it (*NODE, *ELEMENT): is this an Abaqus input file?".to_owned(),
        ));
    }
    let assembly = parts::read(text, false)?;
    checked(flatten::flatten(&assembly)?)
}

/// The contents of a file, if it is a mesh.
fn checked(raw: Raw) -> Result<Raw> {
    if raw.solids.is_empty() && raw.faces.is_empty() {
        return Err(Failure::NoMesh(format!(
            "it contains no elements of a body: write {}",
            types::KNOWN
        )));
    }
    if raw.solids.is_empty() && !raw.is_level() {
        return Err(Failure::NoMesh(
            "the mesh is not plane: its z coordinates differ; a solid body needs volume elements (C3D4, C3D6, C3D8)"
                .to_owned(),
        ));
    }
    Ok(raw)
}
