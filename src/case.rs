//! Case files: the TOML that says what to solve, checked with the line at fault.
//!
//! A case is either *elastic* (`[mesh]`, `[[material]]`, `[[support]]`, `[[traction]]`, `[[contact]]` …)
//! or *algebraic* (`[algebraic]`: matrices in Matrix Market files). The README has the reference.

mod build;
mod quantity;
mod units;

pub use build::{Build, BuildError, Elastic, Pair, StepData};
pub use quantity::Quantity;
pub use units::Units;

use crate::elasticity::Plane;
use crate::mesh::structured::CellShape;
use crate::quasistatic;
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
    pub units: Option<Spanned<Units>>,
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
    pub steps: Option<Spanned<StepsTable>>,
    pub algebraic: Option<Spanned<AlgebraicTable>>,
    #[serde(default)]
    pub solver: SolverTable,
}

/// `[mesh]`: a Gmsh file, a rectangle, or parts.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshTable {
    /// A Gmsh file, relative to the case file.
    pub file: Option<PathBuf>,
    /// Factor for the coordinates, e.g. 1e-3 for a drawing in millimetres.
    pub scale: Option<f64>,
    /// A structured rectangle: region `body`, boundaries `left`, `right`, `bottom`, `top`.
    pub rectangle: Option<RectangleTable>,
    /// Several meshes side by side.
    #[serde(default)]
    pub part: Vec<Spanned<PartTable>>,
}

/// `[[mesh.part]]`: a Gmsh file or a rectangle among others. Its boundaries are called `name-boundary`; the
/// region of a rectangle `name`, those of a file `name-region`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartTable {
    /// What its regions and boundaries begin with.
    pub name: String,
    /// A Gmsh file, relative to the case file.
    pub file: Option<PathBuf>,
    /// Factor for the coordinates of the file.
    pub scale: Option<f64>,
    /// A structured rectangle.
    pub rectangle: Option<RectangleTable>,
    /// Where its origin is moved to, after scaling.
    #[serde(default, deserialize_with = "two")]
    pub shift: [f64; 2],
}

/// `[mesh.rectangle]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RectangleTable {
    /// The lower left corner.
    #[serde(default, deserialize_with = "two")]
    pub origin: [f64; 2],
    /// Width and height.
    #[serde(deserialize_with = "two")]
    pub size: [f64; 2],
    /// Cells across and up.
    #[serde(deserialize_with = "two")]
    pub cells: [usize; 2],
    /// `quad` or `triangle`.
    #[serde(default)]
    pub shape: CellShape,
    /// Where the point (x, y) of the rectangle goes: bends it, or grades its mesh.
    #[serde(default, deserialize_with = "two_or_none")]
    pub map: Option<[Quantity; 2]>,
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
    #[serde(default, deserialize_with = "two_or_none")]
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
    /// A boundary or several, or
    pub boundary: Option<Names>,
    /// the node nearest to a point.
    #[serde(default, deserialize_with = "two_or_none")]
    pub point: Option<[f64; 2]>,
    /// u_x in m; free if left out.
    pub x: Option<Quantity>,
    /// u_y in m; free if left out.
    pub y: Option<Quantity>,
    /// No displacement across a boundary parallel to an axis.
    #[serde(default)]
    pub symmetry: bool,
    /// Load factors of its own, one per step.
    pub factors: Option<Vec<f64>>,
}

/// `[[traction]]`: forces on a boundary.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TractionTable {
    /// A boundary or several.
    pub boundary: Names,
    /// Pa.
    pub x: Option<Quantity>,
    /// Pa.
    pub y: Option<Quantity>,
    /// Pa, against the outward normal.
    pub pressure: Option<Quantity>,
    /// Load factors of its own, one per step.
    pub factors: Option<Vec<f64>>,
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
    /// Load factors of its own, one per step.
    pub factors: Option<Vec<f64>>,
}

/// `[steps]`: the load in steps, one after another.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StepsTable {
    /// What loads and prescribed displacements are multiplied by in each step.
    pub factors: Vec<f64>,
}

/// `[[contact]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContactTable {
    /// The boundary that carries the multipliers, or several as one.
    pub boundary: Names,
    /// The boundary of another body that it meets (or several), or
    pub against: Option<Names>,
    /// a rigid obstacle.
    pub obstacle: Option<ObstacleTable>,
    #[serde(default)]
    pub friction: FrictionTable,
    /// The initial gap in m, instead of the distance of the meshes.
    pub gap: Option<Quantity>,
    /// Gaps and overlaps up to this distance in m count as touching.
    pub adjust: Option<f64>,
    /// What is farther apart is no candidate with `against`, and not rubbed by Tresca's bound on an obstacle; in m.
    pub search_distance: Option<f64>,
}

/// The name of a boundary, or a list of names that count as one.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a boundary in quotes, or a list of names"
)]
pub enum Names {
    One(String),
    Several(Vec<String>),
}

impl Names {
    /// All of them.
    pub fn all(&self) -> &[String] {
        match self {
            Self::One(name) => std::slice::from_ref(name),
            Self::Several(names) => names,
        }
    }
}

impl std::fmt::Display for Names {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.all().join(", "))
    }
}

/// What the boundary may touch.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum ObstacleTable {
    /// `{ half_plane = { point = […], normal = […] } }`; the normal points out of the obstacle.
    HalfPlane {
        #[serde(deserialize_with = "two")]
        point: [f64; 2],
        #[serde(deserialize_with = "two")]
        normal: [f64; 2],
    },
    /// `{ circle = { center = […], radius = … } }`.
    Circle {
        #[serde(deserialize_with = "two")]
        center: [f64; 2],
        radius: f64,
    },
}

/// Exactly two entries: arrays of serde take the first two of more.
fn two<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>>(from: D) -> Result<[T; 2], D::Error> {
    let entries = Vec::<T>::deserialize(from)?;
    <[T; 2]>::try_from(entries).map_err(|entries| {
        serde::de::Error::custom(format!("expected 2 entries, found {}", entries.len()))
    })
}

/// As [`two`], for an entry that may be left out.
fn two_or_none<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Option<[T; 2]>, D::Error> {
    two(from).map(Some)
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
    /// `{ coulomb = … }`: the coefficient of friction.
    Coulomb(Quantity),
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
    /// g, m, or
    pub slip_bound: Option<PathBuf>,
    /// μ, m: Coulomb friction.
    pub friction_coefficient: Option<PathBuf>,
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
    pub friction_tolerance: Option<Spanned<f64>>,
    pub max_rounds: usize,
}

impl Default for SolverTable {
    fn default() -> Self {
        let defaults = ssnm::Settings::default();
        let rounds = quasistatic::Settings::default();
        let plain = |value| Spanned::new(0..0, value);
        Self {
            tolerance: plain(defaults.tolerance),
            beta: plain(defaults.beta),
            r_tol: plain(defaults.r_tol),
            c_fact: plain(defaults.c_fact),
            method: defaults.method,
            max_iterations: defaults.max_iterations,
            time_limit: None,
            friction_tolerance: None,
            max_rounds: rounds.max_rounds,
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
            toml::from_str(&text).map_err(|e| syntax(suggested(e.to_string().trim_end())))?;
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
            (None, Some(_)) => {
                let elastic = [
                    t.material.first().map(|x| ("material", x.span())),
                    t.support.first().map(|x| ("support", x.span())),
                    t.traction.first().map(|x| ("traction", x.span())),
                    t.body_force.first().map(|x| ("body_force", x.span())),
                    t.contact.first().map(|x| ("contact", x.span())),
                    t.steps.as_ref().map(|x| ("steps", x.span())),
                ];
                if let Some((name, span)) = elastic.into_iter().flatten().next() {
                    return self.invalid(span, format!("[{name}] has no meaning in an [algebraic] case: its matrices say it all"));
                }
            }
            (Some(mesh), None) => {
                let (span, mesh) = (mesh.span(), mesh.get_ref());
                if mesh.part.is_empty() {
                    self.check_source(
                        span.clone(),
                        "[mesh]",
                        &mesh.file,
                        mesh.scale,
                        &mesh.rectangle,
                    )?;
                } else if mesh.file.is_some() || mesh.rectangle.is_some() || mesh.scale.is_some() {
                    return self.invalid(
                        span,
                        "[mesh] has parts: put file, scale and rectangle into a [[mesh.part]]",
                    );
                }
                let mut names: Vec<&str> = Vec::new();
                for part in &mesh.part {
                    let (span, part) = (part.span(), part.get_ref());
                    self.check_source(
                        span.clone(),
                        "a [[mesh.part]]",
                        &part.file,
                        part.scale,
                        &part.rectangle,
                    )?;
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
        if let Some(units) = &t.units
            && let Some(fault) = units.get_ref().fault()
        {
            return self.invalid(units.span(), fault);
        }
        let named = (t.support.iter())
            .map(|table| (table.span(), table.get_ref().boundary.as_ref()))
            .chain(
                t.traction
                    .iter()
                    .map(|table| (table.span(), Some(&table.get_ref().boundary))),
            )
            .chain(t.contact.iter().flat_map(|table| {
                let c = table.get_ref();
                [Some(&c.boundary), c.against.as_ref()].map(|names| (table.span(), names))
            }));
        for (span, names) in named {
            if names.is_some_and(|names| names.all().is_empty()) {
                return self.invalid(span, "a list of boundaries is empty: name at least one");
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
            let c = contact.get_ref();
            let distance = |value: Option<f64>| value.is_some_and(|v| !(v >= 0.0 && v.is_finite()));
            let bad = match (&c.obstacle, &c.against) {
                (None, None) => {
                    Some("a contact needs either against (another boundary) or an obstacle")
                }
                (Some(_), Some(_)) => {
                    Some("a contact is either against a boundary or with an obstacle: keep one")
                }
                _ if distance(c.search_distance) || distance(c.adjust) => {
                    Some("search_distance and adjust must be finite and not negative")
                }
                (Some(ObstacleTable::HalfPlane { point, normal }), _) => {
                    let length = normal[0].hypot(normal[1]);
                    (!point.iter().all(|v| v.is_finite()) || !(length > 0.0 && length.is_finite()))
                        .then_some("half_plane needs a finite point and a normal that is not zero")
                }
                (Some(ObstacleTable::Circle { center, radius }), _) => {
                    (!center.iter().all(|v| v.is_finite())
                        || !(*radius > 0.0 && radius.is_finite()))
                    .then_some("circle needs a finite center and a positive radius")
                }
                (None, Some(_)) => None,
            };
            if let Some(message) = bad {
                return self.invalid(contact.span(), message);
            }
        }
        for (i, contact) in t.contact.iter().enumerate() {
            let c = contact.get_ref();
            let common = |a: &Names, b: &Names| a.all().iter().any(|name| b.all().contains(name));
            let twice = t.contact[..i].iter().any(|other| {
                let o = other.get_ref();
                match (&c.against, &o.against) {
                    (Some(here), Some(there)) => {
                        common(here, &o.boundary) && common(there, &c.boundary)
                    }
                    _ => false,
                }
            });
            if c.against
                .as_ref()
                .is_some_and(|against| common(&c.boundary, against))
            {
                return self.invalid(
                    contact.span(),
                    "a boundary stands on both sides of this contact: contact of a body with itself needs two \
                     boundaries that share no node",
                );
            }
            if twice {
                return self.invalid(
                    contact.span(),
                    "this contact stands above with its boundaries the other way round: name each pair once",
                );
            }
        }
        if let Some(steps) = &t.steps {
            let factors = &steps.get_ref().factors;
            if factors.is_empty() || !factors.iter().all(|f| f.is_finite()) {
                return self.invalid(
                    steps.span(),
                    "factors needs at least one number, all of them finite",
                );
            }
        }
        let n_steps = t.steps.as_ref().map_or(1, |s| s.get_ref().factors.len());
        let own_factors = (t.support.iter().map(|s| (s.span(), &s.get_ref().factors)))
            .chain(t.traction.iter().map(|s| (s.span(), &s.get_ref().factors)))
            .chain(
                t.body_force
                    .iter()
                    .map(|s| (s.span(), &s.get_ref().factors)),
            );
        for (span, factors) in own_factors {
            if let Some(factors) = factors
                && (factors.len() != n_steps || !factors.iter().all(|f| f.is_finite()))
            {
                if t.steps.is_none() {
                    return self.invalid(
                        span,
                        "factors belong to load steps: add [steps] with its own factors",
                    );
                }
                return self.invalid(
                    span,
                    format!(
                        "factors needs {n_steps} finite numbers, one for each of [steps] factors"
                    ),
                );
            }
        }
        if let Some(algebraic) = &t.algebraic {
            let a = algebraic.get_ref();
            if a.slip_bound.is_some() == a.friction_coefficient.is_some() {
                return self.invalid(
                    algebraic.span(),
                    "[algebraic] needs either slip_bound (Tresca) or friction_coefficient (Coulomb)",
                );
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
        if let Some(tolerance) = &s.friction_tolerance
            && !unit(*tolerance.get_ref())
        {
            return self.invalid(
                tolerance.span(),
                "friction_tolerance must lie between 0 and 1",
            );
        }
        if let Some(limit) = &s.time_limit {
            match duration(limit.get_ref()) {
                Ok(duration) => self.time_limit = duration,
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

    /// A mesh comes from a file or a rectangle.
    fn check_source(
        &self,
        span: std::ops::Range<usize>,
        what: &str,
        file: &Option<PathBuf>,
        scale: Option<f64>,
        rectangle: &Option<RectangleTable>,
    ) -> Result<(), CaseError> {
        let problem = match (file, rectangle) {
            (Some(_), None) if scale.is_some_and(|s| !(s > 0.0 && s.is_finite())) => {
                "scale must be a positive number".to_owned()
            }
            (Some(_), None) => return Ok(()),
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
                    return Ok(());
                }
            }
            _ => format!("{what} needs either file or rectangle"),
        };
        self.invalid(span, problem)
    }

    /// What its units are called.
    pub fn units(&self) -> Units {
        let units = self.tables.units.as_ref();
        units.map_or_else(Units::default, |units| units.get_ref().clone())
    }

    /// Number of load steps.
    pub fn n_steps(&self) -> usize {
        (self.tables.steps.as_ref()).map_or(1, |steps| steps.get_ref().factors.len())
    }

    /// What a table with these factors of its own is multiplied by in a step.
    pub(crate) fn factor(&self, own: &Option<Vec<f64>>, step: usize) -> f64 {
        let common = self.tables.steps.as_ref().map(|s| &s.get_ref().factors);
        own.as_ref()
            .or(common)
            .and_then(|factors| factors.get(step))
            .copied()
            .unwrap_or(1.0)
    }

    /// The solver table as settings.
    pub fn settings(&self) -> quasistatic::Settings<'static> {
        let s = &self.tables.solver;
        quasistatic::Settings {
            ssnm: self.newton_settings(),
            friction_tolerance: s.friction_tolerance.as_ref().map(|t| *t.get_ref()),
            max_rounds: s.max_rounds,
            ..Default::default()
        }
    }

    fn newton_settings(&self) -> ssnm::Settings<'static> {
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

/// A duration such as "2h 30min"; None where it is longer than can be counted, which is as good as no limit.
fn duration(text: &str) -> Result<Option<Duration>, humantime::DurationError> {
    // Piece by piece: humantime itself panics where a sum of several overflows.
    let mut pieces = vec![String::new()];
    let mut before = ' ';
    for c in text.chars() {
        if c.is_ascii_digit() && before.is_alphabetic() {
            pieces.push(String::new());
        }
        if !c.is_whitespace() {
            before = c;
        }
        pieces.last_mut().expect("there is one").push(c);
    }
    let mut sum = Some(Duration::ZERO);
    for piece in &pieces {
        let part = match humantime::parse_duration(piece) {
            Ok(part) => Some(part),
            // If only the digits are to blame.
            Err(humantime::DurationError::NumberOverflow)
                if humantime::parse_duration(&piece.replace(|c: char| c.is_ascii_digit(), "0"))
                    .is_ok() =>
            {
                None
            }
            Err(error) => return Err(error),
        };
        sum = sum.zip(part).and_then(|(sum, part)| sum.checked_add(part));
    }
    Ok(sum)
}

/// A message of the parser, with the known key that an unknown one may have meant.
fn suggested(message: &str) -> String {
    let quoted = |text: &str| -> Vec<String> {
        text.split('`')
            .skip(1)
            .step_by(2)
            .map(str::to_owned)
            .collect()
    };
    let unknown = message
        .lines()
        .find_map(|line| {
            line.split_once("unknown field ")
                .or(line.split_once("unknown variant "))
        })
        .map(|(_, names)| quoted(names));
    const LAWS: &str = "\"none\", { tresca = 1e6 } (Pa) or { coulomb = 0.3 }";
    if message.contains("friction")
        && [
            "unit variant, expected newtype",
            "wanted string or table",
            "wanted exactly 1",
        ]
        .iter()
        .any(|text| message.contains(text))
    {
        return format!("{message}; a friction law is written as {LAWS}");
    }
    // A table where a list of tables is wanted: the line shows which.
    const LISTS: [&str; 5] = ["material", "support", "traction", "body_force", "contact"];
    let list = LISTS.iter().find(|name| {
        message.contains(&format!("[{name}]")) && !message.contains(&format!("[[{name}]]"))
    });
    if let Some(name) = list
        && message.contains("expected a sequence")
    {
        return format!(
            "{message}; there may be several of these: write [[{name}]], with double brackets"
        );
    }
    let Some((wrong, known)) = unknown.as_ref().and_then(|names| names.split_first()) else {
        return message.to_owned();
    };
    match nearest(wrong, known) {
        Some(name) => format!("{message}; did you mean `{name}`?"),
        None => message.to_owned(),
    }
}

/// The known name that a wrong one is most like, if it is like any.
fn nearest<'a>(wrong: &str, known: impl IntoIterator<Item = &'a String>) -> Option<&'a String> {
    known
        .into_iter()
        .map(|name| (strsim::damerau_levenshtein(wrong, name), name))
        .min()
        .filter(|&(distance, name)| distance <= 1 + name.len() / 3)
        .map(|(_, name)| name)
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
    const CHOICES: [&str; 2] = ["friction", "obstacle"];
    let parent = parts.last().copied().unwrap_or("");
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
    if let (Ok(index), Some(list)) = (last.parse::<usize>(), item.as_array_mut()) {
        let length = list.len();
        if index >= length {
            return Err(format!(
                "there is no entry {index} (they count from 0, and there are {length})"
            ));
        }
        list.replace(index, value);
        return Ok(());
    }
    let table = item
        .as_table_like_mut()
        .ok_or_else(|| format!("\"{last}\" would lie in something that is no table"))?;
    // Of these only one entry can stand: a new one replaces what was there.
    if CHOICES.contains(&parent) {
        let others: Vec<String> = table.iter().map(|(key, _)| key.to_owned()).collect();
        others.iter().filter(|key| *key != last).for_each(|key| {
            table.remove(key);
        });
    }
    table.insert(last, toml_edit::Item::Value(value));
    Ok(())
}
