//! Linear elasticity: materials, supports, loads, the stiffness matrix K and stresses.
//!
//! Small strains, isotropic materials; in the plane 3-node triangles and bilinear 4-node quadrilaterals, in space
//! 4-node tetrahedra, trilinear 8-node hexahedra and 6-node wedges, all with full integration. Forces in the plane are
//! per body of the given thickness; coordinates, moduli and tractions may be in any consistent units (metres, pascals
//! and newtons in the documentation).
//!
//! A new type of element is a [`ElementKind`] of the mesh, a file beside `quad.rs` with its shape functions, and a line in
//! `ElementKind::with`; what its facets are integrated with is in `surface.rs`.

mod assembly;
mod element;
mod hexahedron;
mod loads;
mod quad;
mod shape;
mod stress;
mod surface;
#[cfg(test)]
mod tests;
mod tetrahedron;
mod triangle;
mod unknowns;
mod wedge;

pub use assembly::{assemble, internal_forces, load_vector};
pub use element::Elements;
pub(crate) use quad::Quad;
pub use stress::{Stress, stresses};
pub use surface::FacetPoint;
pub(crate) use surface::{edge_points, triangle_points};
pub use unknowns::Unknowns;

use crate::mesh::{ElementKind, Mesh, Topology};

/// An isotropic linear material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Young's modulus E in Pa.
    pub young: f64,
    /// Poisson's ratio ν, in (−1, 0.5).
    pub poisson: f64,
    /// Density in kg/m³, for gravity.
    pub density: f64,
}

/// The state of the plane: what happens perpendicular to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Plane {
    /// No strain perpendicular to the plane: a slice of a long body.
    #[default]
    PlaneStrain,
    /// No stress perpendicular to the plane: a thin sheet.
    PlaneStress,
}

impl Material {
    /// The Lamé pair (λ, μ) that makes σ = λ tr(ε) I + 2μ ε hold in the plane; that of plane strain is that of space.
    pub(crate) fn lame(&self, plane: Plane) -> (f64, f64) {
        let (e, nu) = (self.young, self.poisson);
        let mu = e / (2.0 * (1.0 + nu));
        let lambda = match plane {
            Plane::PlaneStrain => e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
            Plane::PlaneStress => e * nu / (1.0 - nu * nu),
        };
        (lambda, mu)
    }
}

/// A scalar as a function of the place, e.g. one component of a traction.
pub type Field<'a, const D: usize = 2> = &'a (dyn Fn([f64; D]) -> f64 + Sync);

/// The body: a mesh with a material for each region, the plane state and the thickness.
#[derive(Clone, Copy)]
pub struct Body<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The mesh.
    pub mesh: &'a Mesh<D>,
    /// One material per region of the mesh.
    pub materials: &'a [Material],
    /// Plane strain or plane stress; in space plane strain, which has the same moduli.
    pub plane: Plane,
    /// Thickness perpendicular to the plane; 1 in space.
    pub thickness: f64,
}

impl<const D: usize> Body<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The Lamé pair of each region times the thickness.
    fn moduli(&self) -> Vec<(f64, f64)> {
        (self.materials.iter())
            .map(|material| material.lame(self.plane))
            .map(|(lambda, mu)| (lambda * self.thickness, mu * self.thickness))
            .collect()
    }
}
