//! The tables of a case file.
//!
//! They are the same in the plane and in space: which of the two is meant is known when the mesh is, and
//! `case/definition.rs` holds it against what they say.

use super::{NumberOrExpression, SolverTable};
use crate::elasticity::{Incompressible, Plane};
use crate::mesh::structured::{CellShape, SolidShape};
use crate::model::{Names, Units};
use serde::{Deserialize, Deserializer};
use std::fmt;
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
    /// Forces on single nodes.
    #[serde(default)]
    pub force: Vec<Spanned<ForceTable>>,
    /// How much warmer bodies are.
    #[serde(default)]
    pub temperature: Vec<Spanned<TemperatureTable>>,
    /// Contact pairs and their friction.
    #[serde(default)]
    pub contact: Vec<Spanned<ContactTable>>,
    /// Boundaries that hold together.
    #[serde(default)]
    pub tie: Vec<Spanned<TieTable>>,
    /// Sets of nodes that move alike.
    #[serde(default)]
    pub equal: Vec<Spanned<EqualTable>>,
    /// Load steps.
    pub steps: Option<Spanned<StepsTable>>,
    /// Matrices of the user's own, instead of a mesh.
    pub algebraic: Option<Spanned<AlgebraicTable>>,
    /// Tolerances and limits.
    #[serde(default)]
    pub solver: SolverTable,
}

/// `[mesh]`: a mesh file, a rectangle or a box, or parts.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshTable {
    /// A file of Gmsh, Abaqus (`.inp`) or VTK (`.vtu`), relative to the case file.
    pub file: Option<PathBuf>,
    /// Factor for the coordinates, e.g. 1e-3 for a drawing in millimetres.
    pub scale: Option<f64>,
    /// The cell array of a VTK file whose values distinguish its regions and boundaries.
    pub cell_data: Option<String>,
    /// A structured rectangle: region `body`, boundaries `left`, `right`, `bottom`, `top`.
    pub rectangle: Option<RectangleTable>,
    /// A structured box in space: besides boundaries `front` and `back`.
    #[serde(rename = "box")]
    pub block: Option<BoxTable>,
    /// 2: elements of first order get nodes in the middle of their sides; 1: these are left out. As they are if left out.
    pub order: Option<Spanned<usize>>,
    /// Several meshes side by side.
    #[serde(default)]
    pub part: Vec<Spanned<PartTable>>,
}

/// `[[mesh.part]]`: a mesh file, a rectangle or a box among others. Its boundaries are called `name-boundary`; the
/// region of a rectangle or a box `name`, those of a file `name-region`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartTable {
    /// What its regions and boundaries begin with.
    pub name: String,
    /// A file of Gmsh, Abaqus (`.inp`) or VTK (`.vtu`), relative to the case file.
    pub file: Option<PathBuf>,
    /// Factor for the coordinates of the file.
    pub scale: Option<f64>,
    /// The cell array of a VTK file whose values distinguish its regions and boundaries.
    pub cell_data: Option<String>,
    /// A structured rectangle.
    pub rectangle: Option<RectangleTable>,
    /// A structured box.
    #[serde(rename = "box")]
    pub block: Option<BoxTable>,
    /// As in `[mesh]`, for this part alone.
    pub order: Option<Spanned<usize>>,
    /// A turn about an axis, after scaling.
    pub rotate: Option<Spanned<RotateTable>>,
    /// Where its origin is moved to, after scaling and turning: a number for each coordinate.
    pub shift: Option<Spanned<Vec<f64>>>,
}

/// `[mesh.rectangle]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RectangleTable {
    /// The lower left corner.
    #[serde(default, deserialize_with = "exactly")]
    pub origin: [f64; 2],
    /// Width and height.
    #[serde(deserialize_with = "exactly")]
    pub size: [f64; 2],
    /// Cells across and up.
    #[serde(deserialize_with = "exactly")]
    pub cells: [usize; 2],
    /// `quad` or `triangle`.
    #[serde(default)]
    pub shape: CellShape,
    /// Where the point (x, y) of the rectangle goes: bends it, or grades its mesh.
    #[serde(default, deserialize_with = "exactly_or_none")]
    pub map: Option<[Spanned<NumberOrExpression>; 2]>,
}

/// `[mesh.box]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BoxTable {
    /// The corner with the least coordinates.
    #[serde(default, deserialize_with = "exactly")]
    pub origin: [f64; 3],
    /// Along x, y and z.
    #[serde(deserialize_with = "exactly")]
    pub size: [f64; 3],
    /// Cells along x, y and z.
    #[serde(deserialize_with = "exactly")]
    pub cells: [usize; 3],
    /// `hexahedron`, `tetrahedron` or `wedge`.
    #[serde(default)]
    pub shape: SolidShape,
    /// Where the point (x, y, z) of the box goes: bends it, or grades its mesh.
    #[serde(default, deserialize_with = "exactly_or_none")]
    pub map: Option<[Spanned<NumberOrExpression>; 3]>,
}

/// `[analysis]`.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AnalysisTable {
    /// `plane_strain` or `plane_stress`; in the plane only.
    pub plane: Option<Spanned<Plane>>,
    /// Thickness in m; in the plane only.
    pub thickness: Option<Spanned<f64>>,
    /// Acceleration in m/s², for materials with a density: a number for each coordinate.
    pub gravity: Option<Spanned<Vec<f64>>>,
    /// A steady rotation, for materials with a density.
    pub rotation: Option<Spanned<RotationTable>>,
}

/// `rotation = { point = […], axis = […], speed = … }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotationTable {
    /// On the axis, in m; the origin if left out.
    pub point: Option<Spanned<Vec<f64>>>,
    /// Along it, of any length; in space only.
    pub axis: Option<Spanned<Vec<f64>>>,
    /// In rad/s.
    pub speed: f64,
}

/// `rotate = { point = […], axis = […], angle = … }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotateTable {
    /// On the axis, in m; the origin if left out.
    pub point: Option<Spanned<Vec<f64>>>,
    /// Along it, of any length; in space only.
    pub axis: Option<Spanned<Vec<f64>>>,
    /// About it by the right-hand rule, in degrees.
    pub angle: f64,
}

/// `[[material]]`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaterialTable {
    /// The region it fills, or several; may be left out if there is one material.
    pub region: Option<Names>,
    /// E in Pa.
    pub young: f64,
    /// ν.
    pub poisson: f64,
    /// In kg/m³.
    #[serde(default)]
    pub density: f64,
    /// Of a length with the temperature, in 1/K.
    #[serde(default)]
    pub expansion: f64,
    /// Whether its elements are those for nearly incompressible bodies: "auto", true or false.
    #[serde(default, deserialize_with = "incompressible")]
    pub incompressible: Incompressible,
    /// Whether its quadrilaterals and hexahedra of first order have incompatible modes.
    #[serde(default)]
    pub incompatible_modes: bool,
}

/// "auto", true or false.
fn incompressible<'de, D: Deserializer<'de>>(from: D) -> Result<Incompressible, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected \"auto\", true or false")]
    enum Said {
        Flag(bool),
        Word(Word),
    }
    #[derive(Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Word {
        Auto,
    }
    Ok(match Said::deserialize(from)? {
        Said::Flag(true) => Incompressible::Yes,
        Said::Flag(false) => Incompressible::No,
        Said::Word(Word::Auto) => Incompressible::Auto,
    })
}

/// `[[support]]`: prescribed displacements.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SupportTable {
    /// What results call it, instead of its place.
    pub name: Option<String>,
    /// A boundary or several, or
    pub boundary: Option<Names>,
    /// a set of nodes or several, or
    pub nodes: Option<Names>,
    /// the node nearest to a point.
    pub point: Option<Spanned<Vec<f64>>>,
    /// u_x in m; free if left out.
    pub x: Option<Spanned<NumberOrExpression>>,
    /// u_y in m; free if left out.
    pub y: Option<Spanned<NumberOrExpression>>,
    /// u_z in m; free if left out, and in space only.
    pub z: Option<Spanned<NumberOrExpression>>,
    /// Displacement away from the axis, in m; free if left out.
    pub radial: Option<Spanned<NumberOrExpression>>,
    /// Displacement around the axis, in m; free if left out.
    pub hoop: Option<Spanned<NumberOrExpression>>,
    /// Displacement along the axis, in m; free if left out, and in space only.
    pub axial: Option<Spanned<NumberOrExpression>>,
    /// What these are about.
    pub axis: Option<Spanned<AxisTable>>,
    /// No displacement across a straight (plane) boundary.
    #[serde(default)]
    pub symmetry: bool,
    /// Load factors of its own, one per step.
    pub factors: Option<Vec<f64>>,
}

/// `[[traction]]`: forces on a boundary.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TractionTable {
    /// What messages call it.
    pub name: Option<String>,
    /// A boundary or several.
    pub boundary: Names,
    /// In Pa.
    pub x: Option<Spanned<NumberOrExpression>>,
    /// In Pa.
    pub y: Option<Spanned<NumberOrExpression>>,
    /// In Pa; in space only.
    pub z: Option<Spanned<NumberOrExpression>>,
    /// In Pa, against the outward normal.
    pub pressure: Option<Spanned<NumberOrExpression>>,
    /// In Pa, away from the axis.
    pub radial: Option<Spanned<NumberOrExpression>>,
    /// In Pa, around the axis.
    pub hoop: Option<Spanned<NumberOrExpression>>,
    /// In Pa, along the axis; in space only.
    pub axial: Option<Spanned<NumberOrExpression>>,
    /// A moment about the axis in N·m, as traction around it that grows with the distance.
    pub torque: Option<f64>,
    /// What these are about.
    pub axis: Option<Spanned<AxisTable>>,
    /// A resultant in N, spread evenly: a number for each coordinate.
    pub force: Option<Spanned<Vec<f64>>>,
    /// Load factors of its own, one per step.
    pub factors: Option<Vec<f64>>,
}

/// `axis = { point = […], direction = […] }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AxisTable {
    /// On the axis, in m: a number for each coordinate.
    pub point: Spanned<Vec<f64>>,
    /// Along it, of any length; in space only.
    pub direction: Option<Spanned<Vec<f64>>>,
}

impl fmt::Display for AxisTable {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let point = self.point.get_ref();
        match &self.direction {
            Some(direction) => {
                write!(
                    f,
                    "the axis through {point:?} along {:?}",
                    direction.get_ref()
                )
            }
            None => write!(f, "the point {point:?}"),
        }
    }
}

/// `[[body_force]]`: forces in the volume.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyForceTable {
    /// What messages call it.
    pub name: Option<String>,
    /// A region; all if left out.
    pub region: Option<String>,
    /// In N/m³.
    pub x: Option<Spanned<NumberOrExpression>>,
    /// In N/m³.
    pub y: Option<Spanned<NumberOrExpression>>,
    /// In N/m³; in space only.
    pub z: Option<Spanned<NumberOrExpression>>,
    /// Load factors of its own, one per step.
    pub factors: Option<Vec<f64>>,
}

/// `[[temperature]]`: how much warmer bodies are than when they were free of stress.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TemperatureTable {
    /// What messages call it.
    pub name: Option<String>,
    /// A region; all if left out.
    pub region: Option<String>,
    /// In K.
    pub value: Spanned<NumberOrExpression>,
    /// Load factors of its own, one per step.
    pub factors: Option<Vec<f64>>,
}

/// `[[force]]`: forces on single nodes.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ForceTable {
    /// What messages call it.
    pub name: Option<String>,
    /// A set of nodes or several, or
    pub nodes: Option<Names>,
    /// the node nearest to a point, or
    pub point: Option<Spanned<Vec<f64>>>,
    /// the nodes of a boundary or several.
    pub boundary: Option<Names>,
    /// In N, on each node.
    pub x: Option<Spanned<NumberOrExpression>>,
    /// In N, on each node.
    pub y: Option<Spanned<NumberOrExpression>>,
    /// In N, on each node; in space only.
    pub z: Option<Spanned<NumberOrExpression>>,
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
    /// What results call it, instead of its boundaries.
    pub name: Option<String>,
    /// The boundary that carries the multipliers, or several as one, or
    pub boundary: Option<Names>,
    /// sets of nodes, one by one.
    pub nodes: Option<Names>,
    /// The boundary of another body that it meets (or several), or
    pub against: Option<Names>,
    /// a rigid obstacle.
    pub obstacle: Option<Spanned<ObstacleTable>>,
    /// The law; none if left out.
    #[serde(default)]
    pub friction: FrictionTable,
    /// The initial gap in m, instead of the distance of the meshes.
    pub gap: Option<Spanned<NumberOrExpression>>,
    /// How far the sides overlap where they meet, in m, instead of a gap.
    pub interference: Option<Spanned<NumberOrExpression>>,
    /// What an overlap of the meshes is; an error if left out.
    pub overlap: Option<OverlapTable>,
    /// How far the contact itself gives way; hard if left out.
    pub stiffness: Option<StiffnessTable>,
    /// Gaps and overlaps up to this distance in m count as touching.
    pub adjust: Option<f64>,
    /// What is added to the gap of the meshes, in m.
    pub offset: Option<f64>,
    /// Edges of the boundaries that are sharper, in degrees between the normals of neighbours, cut them into smooth parts.
    pub edge_angle: Option<f64>,
    /// What is farther apart is no candidate with `against`, and not rubbed by Tresca's bound on an obstacle; in m.
    pub search_distance: Option<f64>,
}

/// `[[tie]]`: boundaries of two bodies that hold together in every direction.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TieTable {
    /// What results call it, instead of its boundaries.
    pub name: Option<String>,
    /// The boundary that carries the multipliers, or several as one.
    pub boundary: Names,
    /// The boundary of another body that it is tied to (or several).
    pub against: Names,
    /// How far apart they may be, in m.
    pub adjust: Option<f64>,
    /// Edges of the boundaries that are sharper, in degrees between the normals of neighbours, cut them into smooth parts.
    pub edge_angle: Option<f64>,
}

/// `[[equal]]`: sets of nodes that move alike, each by itself.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EqualTable {
    /// What results call it, instead of its sets.
    pub name: Option<String>,
    /// A set of nodes whose displacements are equal, or several, each by itself.
    pub sets: Names,
    /// The axes along which they are: all if left out.
    pub directions: Option<Spanned<Names>>,
}

/// What an overlap of the meshes is.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OverlapTable {
    /// `"interference"`: it is pressed apart.
    Interference,
}

/// `{ normal = …, tangential = … }`: pressure over what the gap closes by, and traction over what comes before slip, in Pa/m.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StiffnessTable {
    /// Along the normal; hard if left out.
    pub normal: Option<Spanned<NumberOrExpression>>,
    /// Along the boundary; hard if left out.
    pub tangential: Option<Spanned<NumberOrExpression>>,
}

/// What the boundary may touch: two shapes in the plane, three in space.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum ObstacleTable {
    /// `{ half_plane = { point = […], normal = […] } }`; the normal points out of the obstacle.
    HalfPlane {
        /// Of the line that bounds it, in m.
        #[serde(deserialize_with = "exactly")]
        point: [f64; 2],
        /// Of any length.
        #[serde(deserialize_with = "exactly")]
        normal: [f64; 2],
    },
    /// `{ circle = { center = […], radius = … } }`.
    Circle {
        /// Its middle, in m.
        #[serde(deserialize_with = "exactly")]
        center: [f64; 2],
        /// In m.
        radius: f64,
    },
    /// `{ half_space = { point = […], normal = […] } }`; the normal points out of the obstacle.
    HalfSpace {
        /// Of the plane that bounds it, in m.
        #[serde(deserialize_with = "exactly")]
        point: [f64; 3],
        /// Of any length.
        #[serde(deserialize_with = "exactly")]
        normal: [f64; 3],
    },
    /// `{ sphere = { center = […], radius = … } }`.
    Sphere {
        /// Its middle, in m.
        #[serde(deserialize_with = "exactly")]
        center: [f64; 3],
        /// In m.
        radius: f64,
    },
    /// `{ cylinder = { point = […], axis = […], radius = … } }`, without ends.
    Cylinder {
        /// Of its axis, in m.
        #[serde(deserialize_with = "exactly")]
        point: [f64; 3],
        /// Along it, of any length.
        #[serde(deserialize_with = "exactly")]
        axis: [f64; 3],
        /// In m.
        radius: f64,
    },
}

/// Exactly N entries: arrays of serde take the first N of more.
fn exactly<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    from: D,
) -> Result<[T; N], D::Error> {
    let entries = Vec::<T>::deserialize(from)?;
    <[T; N]>::try_from(entries).map_err(|entries| {
        serde::de::Error::custom(format!("expected {N} entries, found {}", entries.len()))
    })
}

/// As [`exactly`], for an entry that may be left out.
fn exactly_or_none<'de, D: serde::Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    from: D,
) -> Result<Option<[T; N]>, D::Error> {
    exactly(from).map(Some)
}

/// The friction law.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "snake_case")]
pub enum FrictionTable {
    /// `"none"`.
    #[default]
    None,
    /// `{ tresca = … }`: the bound in Pa.
    Tresca(Spanned<NumberOrExpression>),
    /// `{ coulomb = … }`: the coefficient of friction.
    Coulomb(Spanned<NumberOrExpression>),
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
    /// T, m × n; in space 2m × n.
    pub tangential: PathBuf,
    /// d, m.
    pub gap: PathBuf,
    /// Whether entries of d below 0 are meant.
    #[serde(default)]
    pub interference: bool,
    /// g, m, or
    pub slip_bound: Option<PathBuf>,
    /// μ, m: Coulomb friction.
    pub friction_coefficient: Option<PathBuf>,
    /// Which nodes are tied, an entry per row of N: 1, or 0. None if left out.
    pub tied: Option<PathBuf>,
    /// Where slip is counted from, an entry per row of T; zero if left out.
    pub slip_origin: Option<PathBuf>,
    /// The diagonal of C, an entry per row of N, then one per row of T: compliant contact; zero if left out.
    pub compliance: Option<PathBuf>,
    /// Whether rows of N and T may depend on each other, as those of bodies do where several parts of one lie under one facet
    /// of another: forces on the bodies are unique even so, multipliers need not be.
    #[serde(default)]
    pub dependent_rows: bool,
    /// n/2 × 2; in space n/3 × 3.
    pub coordinates: Option<PathBuf>,
}

impl AlgebraicTable {
    /// All of its files.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        let needed = [
            &self.stiffness,
            &self.load,
            &self.normal,
            &self.tangential,
            &self.gap,
        ];
        let others = [
            &self.slip_bound,
            &self.friction_coefficient,
            &self.tied,
            &self.slip_origin,
            &self.compliance,
            &self.coordinates,
        ];
        needed.into_iter().chain(others.into_iter().flatten())
    }
}
