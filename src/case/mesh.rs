//! The mesh of a case.

use super::build::BuildError;
use super::{Case, CaseError, RectangleTable};
use crate::mesh::{Mesh, gmsh, structured};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Where a mesh comes from.
enum Source<'a> {
    /// A file, and the factor for its coordinates.
    File(&'a Path, f64),
    Rectangle(&'a RectangleTable),
}

/// The one place that a table names; `what` is that table.
fn source<'a>(
    what: &str,
    file: &'a Option<PathBuf>,
    scale: Option<f64>,
    rectangle: &'a Option<RectangleTable>,
) -> Result<Source<'a>, String> {
    let problem = match (file, rectangle) {
        (Some(_), None) if scale.is_some_and(|s| !(s > 0.0 && s.is_finite())) => {
            "scale must be a positive number".to_owned()
        }
        (Some(file), None) => return Ok(Source::File(file, scale.unwrap_or(1.0))),
        (None, Some(_)) if scale.is_some() => {
            "scale belongs to a mesh file: give the rectangle its size in metres".to_owned()
        }
        (None, Some(r)) => {
            let nodes = r.cells.iter().map(|&c| c as f64 + 1.0).product::<f64>();
            if !r.size.iter().all(|&s| s > 0.0 && s.is_finite())
                || r.cells.contains(&0)
                || !r.origin.iter().all(|o| o.is_finite())
            {
                "the rectangle needs positive sizes and numbers of cells".to_owned()
            } else if nodes > 4e8 {
                "the rectangle has more than 4e8 nodes".to_owned()
            } else {
                return Ok(Source::Rectangle(r));
            }
        }
        _ => format!("{what} needs either file or rectangle"),
    };
    Err(problem)
}

impl Case {
    /// `[mesh]` and its tables, as far as that can be checked without the files.
    pub(super) fn check_mesh(&self) -> Result<(), CaseError> {
        let Some(table) = &self.tables.mesh else {
            return Ok(());
        };
        let (span, mesh) = (table.span(), table.get_ref());
        if mesh.part.is_empty() {
            return match source("[mesh]", &mesh.file, mesh.scale, &mesh.rectangle) {
                Ok(_) => Ok(()),
                Err(problem) => self.invalid(span, problem),
            };
        }
        if mesh.file.is_some() || mesh.rectangle.is_some() || mesh.scale.is_some() {
            return self.invalid(
                span,
                "[mesh] has parts: put file, scale and rectangle into a [[mesh.part]]",
            );
        }
        let mut names: Vec<&str> = Vec::new();
        for part in &mesh.part {
            let (span, part) = (part.span(), part.get_ref());
            let found = source("a [[mesh.part]]", &part.file, part.scale, &part.rectangle);
            if let Err(problem) = found {
                return self.invalid(span, problem);
            }
            if part.name.is_empty() || names.contains(&part.name.as_str()) {
                return self.invalid(
                    span,
                    format!(
                        "the name \"{}\" of the part is empty or stands twice",
                        part.name
                    ),
                );
            }
            if !part.shift.iter().all(|v| v.is_finite()) {
                return self.invalid(span, "shift needs two finite numbers");
            }
            names.push(&part.name);
        }
        Ok(())
    }

    /// The mesh of an elastic case, its parts side by side.
    pub(super) fn mesh(&self) -> Result<Mesh, BuildError> {
        let Some(table) = &self.tables.mesh else {
            return Ok(self.invalid(0..0, "the case has no [mesh]")?);
        };
        let (span, table) = (table.span(), table.get_ref());
        if table.part.is_empty() {
            return self.part(
                span,
                source("[mesh]", &table.file, table.scale, &table.rectangle),
            );
        }
        let mut whole: Option<Mesh> = None;
        for part in &table.part {
            let (span, part) = (part.span(), part.get_ref());
            let found = source("a [[mesh.part]]", &part.file, part.scale, &part.rectangle);
            let mut mesh = self.part(span.clone(), found)?;
            mesh.shift(part.shift);
            let named = |name: &str| format!("{}-{name}", part.name);
            let region = |name: &str| match part.rectangle {
                Some(_) => part.name.clone(),
                None => named(name),
            };
            mesh.rename(region, named);
            let Some(before) = whole else {
                whole = Some(mesh);
                continue;
            };
            let group = (mesh.groups.keys()).find(|&name| before.groups.contains_key(name));
            let boundary =
                || (mesh.boundaries.keys()).find(|&name| before.boundaries.contains_key(name));
            if let Some(name) = group.or_else(boundary) {
                return Ok(self.invalid(
                    span,
                    format!(
                        "two parts have a region or boundary called \"{name}\": name the parts otherwise"
                    ),
                )?);
            }
            whole = Some(structured::join(before, mesh));
        }
        Ok(whole.expect("there are parts"))
    }

    fn part(&self, span: Range<usize>, source: Result<Source, String>) -> Result<Mesh, BuildError> {
        let r = match source {
            Ok(Source::File(file, scale)) => return Ok(gmsh::read(&self.beside(file), scale)?),
            Ok(Source::Rectangle(rectangle)) => rectangle,
            Err(problem) => return Ok(self.invalid(span, problem)?),
        };
        let mut mesh = structured::rectangle(r.origin, r.size, r.cells, r.shape, "body", "");
        if let Some([x, y]) = &r.map {
            for place in &mut mesh.nodes {
                *place = [x.at(*place), y.at(*place)];
            }
            let turned = (mesh.elements.iter())
                .filter(|element| mesh.signed_measure(element) < 0.0)
                .count();
            if turned != 0 && turned != mesh.elements.len() {
                return Ok(self.invalid(span, "map folds the rectangle over itself")?);
            }
            mesh = Mesh::new(mesh.nodes, mesh.elements, mesh.regions, mesh.boundaries)
                .or_else(|error| self.invalid(span, format!("map: {error}")))?;
        }
        Ok(mesh)
    }
}
