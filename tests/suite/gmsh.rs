//! Gmsh files as they come: elements in several groups, reversed and inner curves, older formats, other files.

pub mod drawing;
mod groups;
mod refused;

use crate::common::or_panic::OrPanic as _;
use drawing::{Coding, squares};
use signorini::case::Case;
use signorini::mesh::gmsh::read;
use signorini::mesh::{AnyMesh, Mesh};
use signorini::model::Built;

/// Reads a file of this name and content.
pub fn read_named(name: &str, bytes: &[u8]) -> Result<Mesh, String> {
    let directory = tempfile::tempdir().or_panic();
    let path = directory.path().join(name);
    std::fs::write(&path, bytes).or_panic();
    match read(&path, 1.0) {
        Ok(AnyMesh::Plane(mesh)) => Ok(mesh),
        Ok(AnyMesh::Space(_)) => panic!("{name} is of the plane"),
        Err(error) => {
            let text = error.to_string();
            assert!(text.contains(name), "{text}");
            Err(text)
        }
    }
}

#[track_caller]
pub fn mesh_of(bytes: &[u8]) -> Mesh {
    read_named("test.msh", bytes).or_panic()
}

#[track_caller]
pub fn message(bytes: &[u8]) -> String {
    match read_named("test.msh", bytes) {
        Ok(_) => panic!("it was read"),
        Err(error) => error,
    }
}

/// Builds a case about the file `test.msh`.
pub fn case(bytes: &[u8], text: &str) -> Result<Built, String> {
    let directory = tempfile::tempdir().or_panic();
    std::fs::write(directory.path().join("test.msh"), bytes).or_panic();
    let case = Case::parse(&directory.path().join("case.toml"), text.to_owned(), &[])
        .map_err(|error| error.to_string())?;
    let made = case.build().map_err(|error| error.to_string())?;
    Ok(made.plane().expect("an elastic case in the plane"))
}

#[track_caller]
pub fn refused(bytes: &[u8], text: &str) -> String {
    match case(bytes, text) {
        Ok(_) => panic!("the case was accepted"),
        Err(error) => error,
    }
}

#[track_caller]
pub fn total_load(bytes: &[u8], text: &str) -> [f64; 2] {
    case(bytes, text).or_panic().step(0).or_panic().total_load
}

#[track_caller]
pub fn near(a: f64, b: f64) {
    assert!((a - b).abs() <= 1e-12 * a.abs().max(b.abs()), "{a} {b}");
}

/// That the regions of a mesh have these areas; those of elements are sums over points.
#[track_caller]
pub fn measures_are(mesh: &Mesh, expected: &[f64]) {
    let measures = mesh.measures();
    assert_eq!(measures.len(), expected.len(), "{measures:?}");
    (measures.iter().zip(expected)).for_each(|(&found, &expected)| near(found, expected));
}

pub const HELD: &str =
    "[mesh]\nfile = \"test.msh\"\n[[support]]\nboundary = \"left\"\nx = 0\ny = 0\n";

pub fn material(region: &str, density: f64) -> String {
    format!(
        "[[material]]\nregion = \"{region}\"\nyoung = 1e6\npoisson = 0.3\ndensity = {density}\n"
    )
}

/// `signorini check` is tried on this file (`tests/program`).
#[test]
fn the_squares_of_the_program_are_these() {
    let file = include_bytes!("../meshes/squares.msh");
    assert!(squares().msh4(Coding::Ascii) == file);
}
