//! Files that are not meshes of Gmsh.

use std::path::Path;

/// The byte order mark that Notepad and others put before a text.
pub(super) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// The probable kind of a file that is not a mesh of Gmsh, and the remedy.
pub(super) fn foreign(path: &Path, bytes: &[u8]) -> Option<String> {
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let bytes = bytes.trim_ascii_start();
    if bytes.is_empty() {
        return Some("an empty file: save the mesh again".to_owned());
    }
    // Nastran begins comments with a dollar and a blank.
    if bytes[0] == b'$' && bytes.get(1).is_some_and(u8::is_ascii_alphabetic) {
        return None;
    }
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 16)]).to_lowercase();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_lowercase();
    let begins = |what: &[&str]| what.iter().any(|what| head.starts_with(what));
    let holds = |what: &[&str]| what.iter().any(|what| head.contains(what));
    let named = |what: &[&str]| what.contains(&extension.as_str());
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let anew =
        "make the mesh in Gmsh, or convert it, with physical groups, and save it as MSH 4.1 or 2.2";
    Some(if begins(&["version https://git-lfs"]) {
        "a Git LFS pointer, not the mesh: git lfs pull".to_owned()
    } else if begins(&["<!doctype html", "<html"]) {
        "an HTML page, not the mesh: what the server sent instead; download the file itself"
            .to_owned()
    } else if bytes.starts_with(b"\x1f\x8b") || bytes.starts_with(b"PK\x03\x04") {
        "a compressed file: unpack it first".to_owned()
    } else if begins(&["# vtk datafile"]) || holds(&["<vtkfile"]) || named(&["vtk", "vtu"]) {
        format!("a VTK file, not a Gmsh mesh: {anew}")
    } else if begins(&["iso-10303-21"]) || named(&["step", "stp", "iges", "igs", "brep"]) {
        format!(
            "a geometry, not a mesh: mesh it first, with physical groups: open it in Gmsh, or by a script with \
             Merge \"{name}\";"
        )
    } else if holds(&["facet normal"]) || named(&["stl"]) {
        format!("an STL file, a surface without regions and boundaries: {anew}")
    } else if holds(&["*heading", "*node\n", "*node\r", "*node,"]) || named(&["inp"]) {
        format!("an Abaqus input file, not a Gmsh mesh: {anew}")
    } else if named(&["geo", "geo_unrolled"])
        || holds(&[
            "setfactory(",
            "physical surface(",
            "plane surface(",
            "curve loop(",
            "line loop(",
        ])
    {
        let dimension = if holds(&[
            "volume(",
            "volume{",
            "extrude",
            "box(",
            "cylinder(",
            "sphere(",
        ]) {
            3
        } else {
            2
        };
        format!(
            "a script for Gmsh, not the mesh: mesh it first: gmsh -{dimension} {stem}.geo -o {stem}.msh"
        )
    } else {
        format!("not a Gmsh MSH file: it does not begin with $MeshFormat: {anew}")
    })
}
