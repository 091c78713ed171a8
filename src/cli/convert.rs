//! `signorini convert`.

use super::advice::message_of;
use signorini::mesh::{self, AnyMesh, ElementKind, Mesh, Topology};
use signorini::output::write_whole;
use std::path::Path;

pub fn run(input: &Path, output: &Path, scale: f64, cell_data: Option<&str>) -> Result<u8, String> {
    if !(scale > 0.0 && scale.is_finite()) {
        return Err("--scale must be a positive number".to_owned());
    }
    if (output.extension()).is_none_or(|extension| !extension.eq_ignore_ascii_case("msh")) {
        return Err(format!(
            "{}: only files of Gmsh are written: call it .msh",
            output.display()
        ));
    }
    if let (Ok(from), Ok(to)) = (input.canonicalize(), output.canonicalize())
        && from == to
    {
        return Err(format!(
            "{}: the mesh would be written over itself: give the new file another name",
            output.display()
        ));
    }
    if cell_data.is_some() && !mesh::has_cell_arrays(input) {
        return Err("--cell-data belongs to a .vtu file".to_owned());
    }
    let read = mesh::read(input, scale, cell_data).map_err(|e| message_of(&e))?;
    write_whole(output, mesh::msh(&read).as_bytes()).map_err(|e| message_of(&e))?;
    let lines = match &read {
        AnyMesh::Plane(mesh) => describe(mesh),
        AnyMesh::Space(mesh) => describe(mesh),
    };
    super::print(&format!("{}\n{}\n", lines.join("\n"), output.display()))?;
    Ok(0)
}

/// The mesh, and the names that a case calls its parts by.
fn describe<const D: usize>(mesh: &Mesh<D>) -> Vec<String>
where
    ElementKind: Topology<D>,
{
    let mut lines = vec![super::check::mesh(mesh)];
    lines.extend(super::check::notes(mesh));
    let (measure, facets) = match D {
        2 => ("area", "edges"),
        _ => ("volume", "faces"),
    };
    let measures = mesh.measures();
    for (name, regions) in &mesh.groups {
        let size: f64 = (regions.iter())
            .map(|&region| measures[region as usize])
            .sum();
        lines.push(format!("region        \"{name}\": {measure} {size:.4e}"));
    }
    for (name, all) in &mesh.boundaries {
        let fault = (mesh.faults.get(name)).map_or(String::new(), |fault| format!("; {fault}"));
        lines.push(format!(
            "boundary      \"{name}\": {} {facets}{fault}",
            all.len()
        ));
    }
    lines.extend(super::check::node_sets(mesh));
    lines
}
