//! The tables of a case file, and what they say as parts of a model.

use super::SolverTable;
use crate::contact::Obstacle;
use crate::elasticity::{Material, Plane};
use crate::mesh::structured::CellShape;
use crate::model::{
    BodyForce, Definition, Entity, Kind, Names, Pair, Quantity, Support, Traction, Units,
};
use serde::Deserialize;
use std::ops::Range;
use std::path::PathBuf;
use toml::Spanned;

/// The tables of a case file.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// A title for the report.
    #[serde(default)]
    pub title: String,
    /// What lengths and forces are called.
    pub units: Option<Spanned<Units>>,
    /// The bodies, unless the case is algebraic.
    pub mesh: Option<Spanned<MeshTable>>,
    /// Plane, thickness and gravity.
    #[serde(default)]
    pub analysis: AnalysisTable,
    /// Elasticity and density of the regions.
    #[serde(default)]
    pub material: Vec<Spanned<MaterialTable>>,
    /// Prescribed displacements.
    #[serde(default)]
    pub support: Vec<Spanned<SupportTable>>,
    /// Forces on boundaries.
    #[serde(default)]
    pub traction: Vec<Spanned<TractionTable>>,
    /// Forces in the volume.
    #[serde(default)]
    pub body_force: Vec<Spanned<BodyForceTable>>,
    /// Contact pairs and their friction.
    #[serde(default)]
    pub contact: Vec<Spanned<ContactTable>>,
    /// Load steps.
    pub steps: Option<Spanned<StepsTable>>,
    /// Matrices of the user's own, instead of a mesh.
    pub algebraic: Option<Spanned<AlgebraicTable>>,
    /// Tolerances and limits.
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
    /// In kg/m³.
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
    /// In Pa.
    pub x: Option<Quantity>,
    /// In Pa.
    pub y: Option<Quantity>,
    /// In Pa, against the outward normal.
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
    /// In N/m³.
    pub x: Option<Quantity>,
    /// In N/m³.
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
    /// The law; none if left out.
    #[serde(default)]
    pub friction: FrictionTable,
    /// The initial gap in m, instead of the distance of the meshes.
    pub gap: Option<Quantity>,
    /// Gaps and overlaps up to this distance in m count as touching.
    pub adjust: Option<f64>,
    /// What is farther apart is no candidate with `against`, and not rubbed by Tresca's bound on an obstacle; in m.
    pub search_distance: Option<f64>,
}

/// What the boundary may touch.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum ObstacleTable {
    /// `{ half_plane = { point = […], normal = […] } }`; the normal points out of the obstacle.
    HalfPlane {
        /// Of the line that bounds it, in m.
        #[serde(deserialize_with = "two")]
        point: [f64; 2],
        /// Of any length.
        #[serde(deserialize_with = "two")]
        normal: [f64; 2],
    },
    /// `{ circle = { center = […], radius = … } }`.
    Circle {
        /// Its middle, in m.
        #[serde(deserialize_with = "two")]
        center: [f64; 2],
        /// In m.
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

/// The two spellings of names.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected the name of a boundary in quotes, or a list of names"
)]
enum Spelling {
    One(String),
    Several(Vec<String>),
}

impl<'de> Deserialize<'de> for Names {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Ok(match Spelling::deserialize(from)? {
            Spelling::One(name) => name.into(),
            Spelling::Several(names) => names.into(),
        })
    }
}

/// A part of a model with what a table may say of it, if it does.
fn with<T, V: Clone>(part: T, value: &Option<V>, say: impl Fn(T, V) -> T) -> T {
    match value {
        Some(value) => say(part, value.clone()),
        None => part,
    }
}

impl SupportTable {
    fn support(&self) -> Result<Support, &'static str> {
        let mut support = match (&self.boundary, self.point) {
            (Some(names), None) => Support::on(names.clone()),
            (None, Some(point)) => Support::at_point(point),
            _ => return Err("a support needs either a boundary or a point"),
        };
        support = with(support, &self.x, Support::x);
        support = with(support, &self.y, Support::y);
        if self.symmetry {
            support = support.symmetry();
        }
        Ok(with(support, &self.factors, Support::factors))
    }
}

impl TractionTable {
    fn traction(&self) -> Traction {
        let mut traction = Traction::on(self.boundary.clone());
        traction = with(traction, &self.x, Traction::x);
        traction = with(traction, &self.y, Traction::y);
        traction = with(traction, &self.pressure, Traction::pressure);
        with(traction, &self.factors, Traction::factors)
    }
}

impl BodyForceTable {
    fn body_force(&self) -> BodyForce {
        let mut force = match &self.region {
            Some(name) => BodyForce::within(name),
            None => BodyForce::everywhere(),
        };
        force = with(force, &self.x, BodyForce::x);
        force = with(force, &self.y, BodyForce::y);
        with(force, &self.factors, BodyForce::factors)
    }
}

impl ContactTable {
    fn pair(&self) -> Result<Pair, &'static str> {
        let boundary = self.boundary.clone();
        let mut pair = match (&self.against, &self.obstacle) {
            (Some(against), None) => Pair::new(boundary, against.clone()),
            (None, Some(obstacle)) => Pair::obstacle(
                boundary,
                match *obstacle {
                    ObstacleTable::HalfPlane { point, normal } => {
                        Obstacle::HalfPlane { point, normal }
                    }
                    ObstacleTable::Circle { center, radius } => Obstacle::Circle { center, radius },
                },
            ),
            (None, None) => {
                return Err("a contact needs either against (another boundary) or an obstacle");
            }
            (Some(_), Some(_)) => {
                return Err("a contact is either against a boundary or with an obstacle: keep one");
            }
        };
        pair = match &self.friction {
            FrictionTable::None => pair,
            FrictionTable::Tresca(bound) => pair.tresca(bound.clone()),
            FrictionTable::Coulomb(coefficient) => pair.coulomb(coefficient.clone()),
        };
        pair = with(pair, &self.gap, Pair::gap);
        pair = with(pair, &self.adjust, Pair::adjust);
        Ok(with(pair, &self.search_distance, Pair::search_distance))
    }
}

impl Tables {
    /// What they say of a model beside its mesh; if a table says nothing that can be meant, its place and why.
    pub(super) fn definition(&self) -> Result<Definition, (Range<usize>, &'static str)> {
        let materials = self.material.iter().map(|table| {
            let &MaterialTable {
                ref region,
                young,
                poisson,
                density,
            } = table.get_ref();
            let material = Material {
                young,
                poisson,
                density,
            };
            (region.clone(), material)
        });
        let supports = self.support.iter().map(|table| {
            let support = table.get_ref().support();
            support.map_err(|fault| (table.span(), fault))
        });
        let pairs = self.contact.iter().map(|table| {
            let pair = table.get_ref().pair();
            pair.map_err(|fault| (table.span(), fault))
        });
        Ok(Definition {
            materials: materials.collect(),
            plane: self.analysis.plane,
            thickness: *self.analysis.thickness.get_ref(),
            gravity: self.analysis.gravity,
            supports: supports.collect::<Result<_, _>>()?,
            tractions: (self.traction.iter())
                .map(|table| table.get_ref().traction())
                .collect(),
            body_forces: (self.body_force.iter())
                .map(|table| table.get_ref().body_force())
                .collect(),
            pairs: pairs.collect::<Result<_, _>>()?,
            steps: (self.steps.as_ref()).map(|steps| steps.get_ref().factors.clone()),
            units: self.units.as_ref().map(|units| units.get_ref().clone()),
        })
    }

    /// Where what a model is made of stands in the file.
    pub(super) fn span(&self, entity: &Entity) -> Range<usize> {
        fn of<T>(tables: &[Spanned<T>], number: usize) -> Option<Range<usize>> {
            tables.get(number).map(Spanned::span)
        }
        let mesh = self.mesh.as_ref().map(Spanned::span);
        let number = entity.number.unwrap_or(0);
        let span = match entity.kind {
            Kind::Model => mesh,
            // A region without a material could stand behind the last.
            Kind::Material => match entity.number {
                Some(number) => of(&self.material, number),
                None => self.material.last().map(Spanned::span).or(mesh),
            },
            Kind::Gravity => of(&self.material, 0),
            Kind::Support => of(&self.support, number),
            Kind::Traction => of(&self.traction, number),
            Kind::BodyForce => of(&self.body_force, number),
            Kind::Contact => of(&self.contact, number),
            Kind::Thickness => Some(self.analysis.thickness.span()),
            Kind::Steps => self.steps.as_ref().map(Spanned::span),
            Kind::Units => self.units.as_ref().map(Spanned::span),
        };
        span.unwrap_or(0..0)
    }
}
