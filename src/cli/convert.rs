//! `signorini convert`.

use super::advice::message_of;
use super::mesh::described;
use signorini::case::Case;
use signorini::deck;
use signorini::mesh;
use signorini::output::write_whole;
use std::path::Path;

pub fn run(
    input: &Path,
    output: &Path,
    ignored: &[String],
    scale: f64,
    cell_data: Option<&str>,
) -> Result<u8, String> {
    let is_called = |ending: &str| {
        (output.extension()).is_some_and(|extension| extension.eq_ignore_ascii_case(ending))
    };
    if is_called("toml") {
        return whole(input, output, ignored, scale, cell_data);
    }
    if !ignored.is_empty() {
        return Err("--ignore applies only when a deck becomes a case file (.toml)".to_owned());
    }
    if !(scale > 0.0 && scale.is_finite()) {
        return Err("--scale must be a positive number".to_owned());
    }
    if !is_called("msh") {
        return Err(format!(
            "{}: only Gmsh meshes and, from a deck, case files are written: name the file .msh or .toml",
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
        return Err("--cell-data applies only to .vtu files".to_owned());
    }
    let read = mesh::read(input, scale, cell_data).map_err(|e| message_of(&e))?;
    write_whole(output, mesh::msh(&read).as_bytes()).map_err(|e| message_of(&e))?;
    let lines = described(&read);
    super::print(&format!("{}\n{}\n", lines.join("\n"), output.display()))?;
    Ok(0)
}

/// Writes a deck as a case file, with its mesh beside it.
fn whole(
    input: &Path,
    output: &Path,
    ignored: &[String],
    scale: f64,
    cell_data: Option<&str>,
) -> Result<u8, String> {
    if !deck::is_deck(input) {
        return Err(format!(
            "{}: only an Abaqus or CalculiX deck (.inp) can become a case file",
            input.display()
        ));
    }
    if scale != 1.0 || cell_data.is_some() {
        return Err(
            "--scale and --cell-data apply only to meshes: the coordinates of a deck are in the units of its loads"
                .to_owned(),
        );
    }
    let mesh = output.with_extension("msh");
    let name = mesh.file_name().unwrap_or_default().to_string_lossy();
    let deck = deck::read(input, &name, ignored).map_err(|e| message_of(&e))?;
    let (notes, mut lines) = (deck.notes.clone(), described(&deck.mesh));
    let text = mesh::msh(&deck.mesh);
    // It has to be a valid case before anything is written.
    let case = Case::of_deck(deck, &[]).map_err(|e| message_of(&e))?;
    write_whole(&mesh, text.as_bytes()).map_err(|e| message_of(&e))?;
    write_whole(output, case.text().as_bytes()).map_err(|e| message_of(&e))?;
    lines.extend(notes);
    lines.extend([&mesh, output].map(|path| path.display().to_string()));
    super::print(&(lines.join("\n") + "\n"))?;
    Ok(0)
}
