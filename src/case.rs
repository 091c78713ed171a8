//! Case files: the TOML that says what to solve, checked with the line at fault.
//!
//! A case is either *elastic* (`[mesh]`, `[[material]]`, `[[support]]`, `[[traction]]`, `[[contact]]` …)
//! or *algebraic* (`[algebraic]`: matrices in Matrix Market files). The README has the reference.

mod build;
mod quantity;

pub use build::{Build, BuildError, Elastic};
pub use quantity::Quantity;

use crate::elasticity::Plane;
use crate::mesh::structured::CellShape;
use crate::ssnm;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::time::Duration;
use toml::Spanned;

/// A case file could not be understood.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    #[error("cannot read {}: {source}", path.display())]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}: {message}", path.display())]
    Syntax { path: PathBuf, message: String },
    #[error("{}, line {line}: {message}", path.display())]
    Invalid {
        path: PathBuf,
        line: usize,
        message: String,
    },
    #[error("--set {setting}: {message}")]
    Setting { setting: String, message: String },
}

/// The tables of a case file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// A title for the report.
    #[serde(default)]
    pub title: String,
    pub mesh: Option<Spanned<MeshTable>>,
    #[serde(default)]
    pub analysis: AnalysisTable,
    #[serde(default)]
    pub material: Vec<Spanned<MaterialTable>>,
    #[serde(default)]
    pub support: Vec<Spanned<SupportTable>>,
    #[serde(default)]
    pub traction: Vec<Spanned<TractionTable>>,
    #[serde(default)]
    pub body_force: Vec<Spanned<BodyForceTable>>,
    #[serde(default)]
    pub contact: Vec<Spanned<ContactTable>>,
    pub algebraic: Option<Spanned<AlgebraicTable>>,
    #[serde(default)]
    pub solver: SolverTable,
}

/// `[mesh]`: a Gmsh file or a rectangle.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshTable {
    /// A Gmsh file, relative to the case file.
    pub file: Option<PathBuf>,
    /// Factor for the coordinates, e.g. 1e-3 for a drawing in millimetres.
    pub scale: Option<f64>,
    /// A structured rectangle: region `body`, boundaries `left`, `right`, `bottom`, `top`.
    pub rectangle: Option<RectangleTable>,
}

/// `[mesh.rectangle]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RectangleTable {
    /// The lower left corner.
    #[serde(default)]
    pub origin: [f64; 2],
    /// Width and height.
    pub size: [f64; 2],
    /// Cells across and up.
    pub cells: [usize; 2],
    /// `quad` or `triangle`.
    #[serde(default)]
    pub shape: CellShape,
}

/// `[analysis]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AnalysisTable {
    /// `plane_strain` or `plane_stress`.
    #[serde(default)]
    pub plane: Plane,
    /// Thickness in m.
    #[serde(default = "one")]
    pub thickness: Spanned<f64>,
    /// Acceleration in m/s², for materials with a density.
    pub gravity: Option<[f64; 2]>,
}

fn one() -> Spanned<f64> {
    Spanned::new(0..0, 1.0)
}

impl Default for AnalysisTable {
    fn default() -> Self {
        Self {
            plane: Plane::default(),
            thickness: one(),
            gravity: None,
        }
    }
}

/// `[[material]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialTable {
    /// The region it fills; may be left out if there is one material.
    pub region: Option<String>,
    /// E in Pa.
    pub young: f64,
    /// ν.
    pub poisson: f64,
    /// kg/m³.
    #[serde(default)]
    pub density: f64,
}

/// `[[support]]`: prescribed displacements.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SupportTable {
    /// A boundary, or
    pub boundary: Option<String>,
    /// the node nearest to a point.
    pub point: Option<[f64; 2]>,
    /// u_x in m; free if left out.
    pub x: Option<Quantity>,
    /// u_y in m; free if left out.
    pub y: Option<Quantity>,
    /// No displacement across a boundary parallel to an axis.
    #[serde(default)]
    pub symmetry: bool,
}

/// `[[traction]]`: forces on a boundary.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TractionTable {
    pub boundary: String,
    /// Pa.
    pub x: Option<Quantity>,
    /// Pa.
    pub y: Option<Quantity>,
    /// Pa, against the outward normal.
    pub pressure: Option<Quantity>,
}

/// `[[body_force]]`: forces in the volume.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyForceTable {
    /// A region; all if left out.
    pub region: Option<String>,
    /// N/m³.
    pub x: Option<Quantity>,
    /// N/m³.
    pub y: Option<Quantity>,
}

/// `[[contact]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactTable {
    pub boundary: String,
    pub obstacle: ObstacleTable,
    #[serde(default)]
    pub friction: FrictionTable,
}

/// What the boundary may touch.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum ObstacleTable {
    /// `{ half_plane = { point = […], normal = […] } }`; the normal points out of the obstacle.
    HalfPlane { point: [f64; 2], normal: [f64; 2] },
    /// `{ circle = { center = […], radius = … } }`.
    Circle { center: [f64; 2], radius: f64 },
}

/// The friction law.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum FrictionTable {
    /// `"none"`.
    #[default]
    None,
    /// `{ tresca = … }`: the bound in Pa.
    Tresca(Quantity),
}

/// `[algebraic]`: Matrix Market files, relative to the case file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AlgebraicTable {
    /// K, n × n.
    pub stiffness: PathBuf,
    /// f, n.
    pub load: PathBuf,
    /// N, m × n.
    pub normal: PathBuf,
    /// T, m × n.
    pub tangential: PathBuf,
    /// d, m.
    pub gap: PathBuf,
    /// g, m.
    pub slip_bound: PathBuf,
    /// n/2 × 2.
    pub coordinates: Option<PathBuf>,
}

/// `[solver]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverTable {
    pub tolerance: Spanned<f64>,
    pub beta: Spanned<f64>,
    pub r_tol: Spanned<f64>,
    pub c_fact: Spanned<f64>,
    pub method: ssnm::Method,
    pub max_iterations: usize,
    pub time_limit: Option<Spanned<String>>,
}

impl Default for SolverTable {
    fn default() -> Self {
        let defaults = ssnm::Settings::default();
        let plain = |value| Spanned::new(0..0, value);
        Self {
            tolerance: plain(defaults.tolerance),
            beta: plain(defaults.beta),
            r_tol: plain(defaults.r_tol),
            c_fact: plain(defaults.c_fact),
            method: defaults.method,
            max_iterations: defaults.max_iterations,
            time_limit: None,
        }
    }
}

/// A case file, read and checked as far as it goes without its mesh or matrices.
#[derive(Debug)]
pub struct Case {
    /// Where it was read from.
    pub path: PathBuf,
    /// Its tables.
    pub tables: Tables,
    /// The solver table as settings.
    time_limit: Option<Duration>,
    text: String,
}

impl Case {
    /// Reads a case file; each of `settings` is `key.path=value` and replaces or adds an entry.
    pub fn read(path: &Path, settings: &[String]) -> Result<Self, CaseError> {
        let text = std::fs::read_to_string(path).map_err(|source| CaseError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, text, settings)
    }

    /// Like [`Case::read`], from a text that is already at hand.
    pub fn parse(path: &Path, mut text: String, settings: &[String]) -> Result<Self, CaseError> {
        let syntax = |message: String| CaseError::Syntax {
            path: path.to_owned(),
            message,
        };
        if !settings.is_empty() {
            let mut document: toml_edit::DocumentMut = text
                .parse()
                .map_err(|e: toml_edit::TomlError| syntax(e.to_string()))?;
            for setting in settings {
                set(&mut document, setting).map_err(|message| CaseError::Setting {
                    setting: setting.clone(),
                    message,
                })?;
            }
            text = document.to_string();
        }
        let tables: Tables =
            toml::from_str(&text).map_err(|e| syntax(e.to_string().trim_end().to_owned()))?;
        let mut case = Self {
            path: path.to_owned(),
            tables,
            time_limit: None,
            text,
        };
        case.check()?;
        Ok(case)
    }

    /// An error at the place of a span.
    pub(crate) fn invalid<T>(
        &self,
        span: std::ops::Range<usize>,
        message: impl Into<String>,
    ) -> Result<T, CaseError> {
        let before = &self.text.as_bytes()[..span.start.min(self.text.len())];
        Err(CaseError::Invalid {
            path: self.path.clone(),
            line: 1 + before.iter().filter(|&&b| b == b'\n').count(),
            message: message.into(),
        })
    }

    /// A path of the case file, relative to it.
    pub(crate) fn beside(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    fn check(&mut self) -> Result<(), CaseError> {
        let t = &self.tables;
        match (&t.mesh, &t.algebraic) {
            (None, None) => {
                return self.invalid(
                    0..0,
                    "the case has neither [mesh] nor [algebraic]: say what to solve",
                );
            }
            (Some(_), Some(both)) => {
                return self.invalid(
                    both.span(),
                    "the case has both [mesh] and [algebraic]: keep one",
                );
            }
            (None, Some(algebraic)) => {
                let elastic = [
                    t.material.first().map(|x| ("material", x.span())),
                    t.support.first().map(|x| ("support", x.span())),
                    t.traction.first().map(|x| ("traction", x.span())),
                    t.body_force.first().map(|x| ("body_force", x.span())),
                    t.contact.first().map(|x| ("contact", x.span())),
                ];
                if let Some((name, span)) = elastic.into_iter().flatten().next() {
                    return self.invalid(span, format!("[[{name}]] has no meaning in an [algebraic] case: its matrices say it all"));
                }
                let _ = algebraic;
            }
            (Some(mesh), None) => {
                let (span, mesh) = (mesh.span(), mesh.get_ref());
                match (&mesh.file, &mesh.rectangle) {
                    (Some(_), None) => {}
                    (None, Some(rectangle)) => {
                        if mesh.scale.is_some() {
                            return self.invalid(span, "scale belongs to a mesh file: give the rectangle its size in metres");
                        }
                        if !rectangle.size.iter().all(|&s| s > 0.0 && s.is_finite())
                            || rectangle.cells.contains(&0)
                            || !rectangle.origin.iter().all(|o| o.is_finite())
                        {
                            return self.invalid(
                                span,
                                "the rectangle needs positive sizes and numbers of cells",
                            );
                        }
                        let nodes = rectangle
                            .cells
                            .iter()
                            .map(|&c| c as f64 + 1.0)
                            .product::<f64>();
                        if nodes > 4e8 {
                            return self.invalid(span, "the rectangle has more than 4e8 nodes");
                        }
                    }
                    _ => return self.invalid(span, "[mesh] needs either file or rectangle"),
                }
                if mesh.scale.is_some_and(|s| !(s > 0.0 && s.is_finite())) {
                    return self.invalid(span, "scale must be a positive number");
                }
                if t.material.is_empty() {
                    return self.invalid(span, "there is no [[material]]");
                }
            }
        }
        for material in &t.material {
            let m = material.get_ref();
            let span = material.span();
            if !(m.young > 0.0 && m.young.is_finite()) {
                return self.invalid(span, format!("young is {}: it must be positive", m.young));
            }
            if !(m.poisson > -1.0 && m.poisson < 0.5) {
                return self.invalid(
                    span,
                    format!(
                        "poisson is {}: it must lie between −1 and 0.5, both excluded",
                        m.poisson
                    ),
                );
            }
            if !(m.density >= 0.0 && m.density.is_finite()) {
                return self.invalid(
                    span,
                    format!("density is {}: it must not be negative", m.density),
                );
            }
        }
        let thickness = &t.analysis.thickness;
        if !(*thickness.get_ref() > 0.0 && thickness.get_ref().is_finite()) {
            return self.invalid(thickness.span(), "thickness must be positive");
        }
        for support in &t.support {
            let s = support.get_ref();
            if s.boundary.is_some() == s.point.is_some() {
                return self.invalid(
                    support.span(),
                    "a support needs either a boundary or a point",
                );
            }
            if s.symmetry && (s.x.is_some() || s.y.is_some() || s.point.is_some()) {
                return self.invalid(
                    support.span(),
                    "symmetry stands alone with a boundary: leave out x, y and point",
                );
            }
            if !s.symmetry && s.x.is_none() && s.y.is_none() {
                return self.invalid(
                    support.span(),
                    "a support needs x, y or symmetry = true: it holds nothing",
                );
            }
        }
        for traction in &t.traction {
            let q = traction.get_ref();
            if q.x.is_none() && q.y.is_none() && q.pressure.is_none() {
                return self.invalid(traction.span(), "a traction needs x, y or pressure");
            }
        }
        for force in &t.body_force {
            let q = force.get_ref();
            if q.x.is_none() && q.y.is_none() {
                return self.invalid(force.span(), "a body force needs x or y");
            }
        }
        for contact in &t.contact {
            let bad = match contact.get_ref().obstacle {
                ObstacleTable::HalfPlane { point, normal } => {
                    let length = normal[0].hypot(normal[1]);
                    (!point.iter().all(|v| v.is_finite()) || !(length > 0.0 && length.is_finite()))
                        .then_some("half_plane needs a finite point and a normal that is not zero")
                }
                ObstacleTable::Circle { center, radius } => (!center.iter().all(|v| v.is_finite())
                    || !(radius > 0.0 && radius.is_finite()))
                .then_some("circle needs a finite center and a positive radius"),
            };
            if let Some(message) = bad {
                return self.invalid(contact.span(), message);
            }
        }
        let s = &t.solver;
        let unit = |v: f64| v > 0.0 && v < 1.0;
        if !unit(*s.tolerance.get_ref()) {
            return self.invalid(s.tolerance.span(), "tolerance must lie between 0 and 1");
        }
        if !(*s.beta.get_ref() > 0.0 && s.beta.get_ref().is_finite()) {
            return self.invalid(s.beta.span(), "beta must be positive");
        }
        if !unit(*s.r_tol.get_ref()) {
            return self.invalid(s.r_tol.span(), "r_tol must lie between 0 and 1");
        }
        if !unit(*s.c_fact.get_ref()) {
            return self.invalid(s.c_fact.span(), "c_fact must lie between 0 and 1");
        }
        if let Some(limit) = &s.time_limit {
            match humantime::parse_duration(limit.get_ref()) {
                Ok(duration) => self.time_limit = Some(duration),
                Err(error) => {
                    return self.invalid(
                        limit.span(),
                        format!("time_limit = \"{}\" is not a duration such as \"10min\" or \"90s\": {error}", limit.get_ref()),
                    );
                }
            }
        }
        Ok(())
    }

    /// The solver table as settings.
    pub fn settings(&self) -> ssnm::Settings<'static> {
        let s = &self.tables.solver;
        ssnm::Settings {
            tolerance: *s.tolerance.get_ref(),
            beta: *s.beta.get_ref(),
            r_tol: *s.r_tol.get_ref(),
            c_fact: *s.c_fact.get_ref(),
            method: s.method,
            max_iterations: s.max_iterations,
            time_limit: self.time_limit,
            ..Default::default()
        }
    }
}

/// Puts one `key.path=value` into the document.
fn set(document: &mut toml_edit::DocumentMut, setting: &str) -> Result<(), String> {
    let (key, value) = setting
        .split_once('=')
        .ok_or("write it as key.path=value")?;
    let value = value.trim();
    // What is no TOML value is meant as a string, so that shells need no second pair of quotes.
    let value: toml_edit::Value = value
        .parse()
        .unwrap_or_else(|_| toml_edit::Value::from(value));
    let mut parts: Vec<&str> = key.trim().split('.').collect();
    let last = parts
        .pop()
        .filter(|k| !k.is_empty())
        .ok_or("the key is empty")?;
    let mut item = document.as_item_mut();
    for part in parts {
        item = match part.parse::<usize>() {
            Ok(index) => {
                let length = match &*item {
                    toml_edit::Item::ArrayOfTables(tables) => tables.len(),
                    other => other.as_array().map_or(0, toml_edit::Array::len),
                };
                if index >= length {
                    return Err(format!(
                        "there is no entry {index} (they count from 0, and there are {length})"
                    ));
                }
                &mut item[index]
            }
            Err(_) => {
                let table = item
                    .as_table_like_mut()
                    .ok_or_else(|| format!("\"{part}\" lies in something that is no table"))?;
                if !table.contains_key(part) {
                    table.insert(part, toml_edit::Item::Table(toml_edit::Table::new()));
                }
                table.get_mut(part).expect("just inserted")
            }
        };
    }
    let table = item
        .as_table_like_mut()
        .ok_or_else(|| format!("\"{last}\" would lie in something that is no table"))?;
    table.insert(last, toml_edit::Item::Value(value));
    Ok(())
}
