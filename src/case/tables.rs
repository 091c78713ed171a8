//! The tables of a case file that are not part of a model: the source of the mesh or the matrices, and the solver. The
//! tables of bodies are the types of `model` themselves.

use super::SolverTable;
use crate::mesh::structured::{CellShape, SolidShape};
use crate::model::{Quantity, Units, exactly};
use serde::{Deserialize, Deserializer};
use std::path::PathBuf;

/// The tables of a case file that mean the same in the plane and in space.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tables {
    /// A title for the report.
    #[serde(default)]
    pub title: String,
    /// The names of lengths and forces.
    pub units: Option<Units>,
    /// The bodies, unless the case is algebraic.
    pub mesh: Option<MeshTable>,
    /// Matrices of the user's own, instead of a mesh.
    pub algebraic: Option<AlgebraicTable>,
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
    pub order: Option<usize>,
    /// Several meshes side by side.
    #[serde(default)]
    pub part: Vec<PartTable>,
}

/// `[[mesh.part]]`: a mesh file, a rectangle or a box among others. Its boundaries are called `name-boundary`; the
/// region of a rectangle or a box `name`, those of a file `name-region`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PartTable {
    /// The prefix of its regions and boundaries.
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
    /// As in `[mesh]`, only for this part.
    pub order: Option<usize>,
    /// A turn about an axis, after scaling.
    pub rotate: Option<RotateTable>,
    /// The shift of its origin, after scaling and rotation: a number for each coordinate.
    pub shift: Option<Vec<f64>>,
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
    /// The new position of the point (x, y) of the rectangle: bends it, or grades its mesh.
    #[serde(default, deserialize_with = "exactly_or_none")]
    pub map: Option<[Quantity<2>; 2]>,
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
    /// The new position of the point (x, y, z) of the box: bends it, or grades its mesh.
    #[serde(default, deserialize_with = "exactly_or_none")]
    pub map: Option<[Quantity<3>; 3]>,
}

/// `rotate = { point = […], axis = […], angle = … }`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RotateTable {
    /// On the axis, in m; the origin if left out.
    pub point: Option<Vec<f64>>,
    /// Along it, of any length; in space only.
    pub axis: Option<Vec<f64>>,
    /// About it by the right-hand rule, in degrees.
    pub angle: f64,
}

/// Like [`exactly`], for an optional entry.
fn exactly_or_none<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    from: D,
) -> Result<Option<[T; N]>, D::Error> {
    exactly(from).map(Some)
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
    /// Whether entries of d below 0 are intended.
    #[serde(default)]
    pub interference: bool,
    /// g, m, or
    pub slip_bound: Option<PathBuf>,
    /// μ, m: Coulomb friction.
    pub friction_coefficient: Option<PathBuf>,
    /// The tied nodes, an entry per row of N: 1 or 0. None if left out.
    pub tied: Option<PathBuf>,
    /// The origin of slip, an entry per row of T; zero if left out.
    pub slip_origin: Option<PathBuf>,
    /// The diagonal of C, an entry per row of N, then one per row of T: compliant contact; zero if left out.
    pub compliance: Option<PathBuf>,
    /// Whether rows of N and T may depend on each other, as rows of bodies do where several parts of one are under one
    /// facet of another. Forces on the bodies are still unique, multipliers need not be.
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
