//! Linear elasticity: materials, supports, loads, the stiffness matrix K and stresses.
//!
//! Small strains, isotropic materials; elements of first and of second order (`mesh/shape`), all with full integration,
//! except for the dilatation of nearly incompressible ones (`dilatation.rs`). Those of first order have incompatible
//! modes where the material has them (`modes.rs`). Forces in the plane are per body of the given thickness, those of
//! bodies of revolution for the whole ring. Coordinates, moduli and tractions may be in any consistent units (metres,
//! pascals and newtons in the documentation).

mod assembly;
mod bedding;
mod dilatation;
mod finite;
mod law;
mod loads;
mod modes;
mod stress;
#[cfg(test)]
mod tests;
mod unknowns;
mod vertices;

pub(crate) use assembly::{add_block, assemble_rows, free_forces, tangent_forces};
pub use assembly::{assemble, internal_forces, load_vector};
pub(crate) use bedding::Bedding;
pub use finite::{Deformed, Loose, Resistance};
pub use stress::{Stress, cauchy_stresses, stresses, stresses_at};
pub use unknowns::Unknowns;
pub use vertices::vertices;
#[cfg(feature = "mpi")]
pub(crate) use vertices::vertices_of_rows;

use crate::mesh::shape::Point;
use crate::mesh::{ElementKind, Mesh, ShapeFunctions, Topology};
use dilatation::Dilatation;
use law::Law;
use modes::Modes;
use rayon::prelude::*;
use std::collections::HashMap;
use std::f64::consts::TAU;

/// An isotropic linear material.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Material {
    /// Young's modulus E in Pa.
    pub young: f64,
    /// Poisson's ratio ν, in (−1, 0.5).
    pub poisson: f64,
    /// Density in kg/m³, for gravity and rotation.
    pub density: f64,
    /// Coefficient of thermal expansion α in 1/K.
    pub expansion: f64,
    /// Whether its elements are those for nearly incompressible bodies.
    pub incompressible: Incompressible,
    /// Whether quadrilaterals and hexahedra of first order of it have incompatible modes, with which they bend as they should; their
    /// dilatation is not projected then.
    pub incompatible_modes: bool,
    /// The elastic law for large displacements; for small ones both laws are the same.
    pub law: Hyperelastic,
    /// The thickness of its bodies perpendicular to the plane, in m; None: [`Body::thickness`].
    pub thickness: Option<f64>,
}

/// The law of a material with large displacements.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hyperelastic {
    /// St. Venant and Kirchhoff's: second Piola–Kirchhoff stresses are linear in Green's strains. For strains of a few per cent;
    /// it softens under compression.
    #[default]
    #[serde(rename = "st-venant-kirchhoff")]
    StVenantKirchhoff,
    /// A compressible neo-Hookean material, which resists being pressed flat.
    NeoHooke,
}

/// Whether the dilatation of elements is projected, so that they do not lock near ν = 0.5. It is not for 3-node
/// triangles, 6-node triangles and 4-node tetrahedra, and not in plane stress, where nothing locks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub enum Incompressible {
    /// From ν = 0.45 on.
    #[default]
    Auto,
    /// Whatever ν is.
    Yes,
    /// Never.
    No,
}

/// Poisson's ratio from which [`Incompressible::Auto`] projects: there the bulk modulus is nearly ten times the shear modulus.
const NEARLY_INCOMPRESSIBLE: f64 = 0.45;

/// The state of the plane: the behaviour perpendicular to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Plane {
    /// No strain perpendicular to the plane: a slice of a long body.
    #[default]
    PlaneStrain,
    /// No stress perpendicular to the plane: a thin sheet.
    PlaneStress,
    /// A body of revolution about x = 0 that moves only in planes through this axis. x is the radius, y the position
    /// along the axis, and the direction perpendicular to the plane (z) is circumferential, with the strain u_x/x.
    Axisymmetric,
}

impl Plane {
    /// 1/x where a motion along x causes a hoop strain; 0 otherwise.
    fn hoop<const D: usize>(self, place: [f64; D]) -> f64 {
        match self {
            Self::Axisymmetric => place[0].recip(),
            Self::PlaneStrain | Self::PlaneStress => 0.0,
        }
    }

    /// The points that integrate the stiffness of an element over its part of the plane or, round the axis, of a ring.
    fn stiffness_points<E, const D: usize, const N: usize, const Q: usize>(
        self,
        x: &[[f64; D]; N],
    ) -> [Point<D, N>; Q]
    where
        E: ShapeFunctions<D, N, Q>,
    {
        let mut points = E::stiffness_points(x);
        if self == Self::Axisymmetric {
            for point in &mut points {
                point.weight *= Depth::Ring.at(point.place(x));
            }
        }
        points
    }
}

/// The extent of bodies perpendicular to the plane.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Depth {
    /// Everywhere as far; 1 in space.
    Thickness(f64),
    /// Once round the axis.
    Ring,
}

impl Depth {
    /// At a place.
    pub fn at<const D: usize>(self, place: [f64; D]) -> f64 {
        match self {
            Self::Thickness(thickness) => thickness,
            Self::Ring => TAU * place[0],
        }
    }
}

/// The extents of bodies at their facets.
pub(crate) struct Depths {
    whole: Depth,
    /// Of edges of bodies whose thickness differs.
    of_edges: HashMap<[u32; 2], f64>,
}

impl Depths {
    fn ends([a, b]: [u32; 2]) -> [u32; 2] {
        [a.min(b), a.max(b)]
    }

    /// At a facet.
    pub fn of(&self, facet: &[u32]) -> Depth {
        let own = self.of_edges.get(&Self::ends([facet[0], facet[1]]));
        own.map_or(self.whole, |&thickness| Depth::Thickness(thickness))
    }
}

impl Material {
    /// A material without weight that does not expand; E in Pa.
    pub const fn new(young: f64, poisson: f64) -> Self {
        Self {
            young,
            poisson,
            density: 0.0,
            expansion: 0.0,
            incompressible: Incompressible::Auto,
            incompatible_modes: false,
            law: Hyperelastic::StVenantKirchhoff,
            thickness: None,
        }
    }

    /// The Lamé pair (λ, μ) that makes σ = λ tr(ε) I + 2μ ε hold in the plane; that of plane strain is that of space.
    pub(crate) fn lame(&self, plane: Plane) -> (f64, f64) {
        let (e, nu) = (self.young, self.poisson);
        let mu = e / (2.0 * (1.0 + nu));
        let lambda = match plane {
            Plane::PlaneStrain | Plane::Axisymmetric => e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
            Plane::PlaneStress => e * nu / (1.0 - nu * nu),
        };
        (lambda, mu)
    }

    /// The pressure in Pa that holds it in place where it is one degree warmer, in the directions of the plane. It is
    /// (3λ + 2μ) α, or (2λ + 2μ) α in plane stress, with the λ of that.
    pub(crate) fn thermal_pressure(&self, plane: Plane) -> f64 {
        let (lambda, mu) = self.lame(plane);
        let directions = match plane {
            Plane::PlaneStrain | Plane::Axisymmetric => 3.0,
            Plane::PlaneStress => 2.0,
        };
        (directions * lambda + 2.0 * mu) * self.expansion
    }

    /// The moduli for elements of this thickness.
    fn moduli(&self, plane: Plane, thickness: f64) -> Moduli {
        Moduli {
            law: Law::new(self, plane, thickness),
            projected: self.is_projected(plane),
            modes: self.incompatible_modes,
        }
    }

    /// Whether its elements have their dilatation projected, if they can.
    pub fn is_projected(&self, plane: Plane) -> bool {
        plane != Plane::PlaneStress
            && match self.incompressible {
                Incompressible::Auto => self.poisson >= NEARLY_INCOMPRESSIBLE,
                Incompressible::Yes => true,
                Incompressible::No => false,
            }
    }
}

/// The temperature of bodies above their stress-free state, in K, as a function of the region and the place.
pub type Temperature<'a, const D: usize = 2> = &'a (dyn Fn(u32, [f64; D]) -> f64 + Sync);

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
    /// The state of the plane; in space plane strain, which has the same moduli.
    pub plane: Plane,
    /// Thickness perpendicular to the plane of all regions whose material states none; 1 in space and for bodies of revolution.
    pub thickness: f64,
}

/// The material data that elements need.
#[derive(Clone, Copy)]
struct Moduli {
    /// Times the thickness.
    law: Law,
    /// Whether the dilatation is projected.
    projected: bool,
    /// Whether there are incompatible modes.
    modes: bool,
}

impl<const D: usize> Body<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The largest Poisson's ratio of its materials; 0 in plane stress, where bodies may change their volume.
    pub(crate) fn poisson(&self) -> f64 {
        match self.plane {
            Plane::PlaneStress => 0.0,
            _ => (self.materials.iter()).fold(0.0, |most, material| material.poisson.max(most)),
        }
    }

    /// The thickness of a region.
    fn thickness_of(&self, region: u32) -> f64 {
        let own = self.materials[region as usize].thickness;
        own.unwrap_or(self.thickness)
    }

    /// The extent of a region perpendicular to the plane.
    fn depth_of(&self, region: u32) -> Depth {
        self.depth(self.thickness_of(region))
    }

    fn depth(&self, thickness: f64) -> Depth {
        match self.plane {
            Plane::Axisymmetric => Depth::Ring,
            Plane::PlaneStrain | Plane::PlaneStress => Depth::Thickness(thickness),
        }
    }

    /// The extents perpendicular to the plane at facets.
    pub(crate) fn depths(&self) -> Depths {
        let mut of_edges = HashMap::new();
        let differ = self
            .materials
            .iter()
            .any(|material| material.thickness.is_some());
        for element in self.mesh.elements.iter().filter(|_| D == 2 && differ) {
            let (nodes, thickness) = (element.nodes(), self.thickness_of(element.region));
            for facet in element.kind().facets() {
                let ends = Depths::ends([nodes[facet[0]], nodes[facet[1]]]);
                // Between two bodies the thinner one bears.
                let least = of_edges.entry(ends).or_insert(thickness);
                *least = thickness.min(*least);
            }
        }
        let whole = self.depth(self.thickness);
        Depths { whole, of_edges }
    }

    /// The moduli of each region.
    fn moduli(&self) -> Vec<Moduli> {
        let of = |region: u32| {
            self.materials[region as usize].moduli(self.plane, self.thickness_of(region))
        };
        (0..self.materials.len() as u32).map(of).collect()
    }
}

/// Finds a result for each piece of some elements on all cores, and takes them in order, whoever has found them. At most
/// 64 pieces are in memory at once.
fn in_order<E: Sync, R: Send>(
    elements: &[E],
    piece: usize,
    find: impl Fn(&[E]) -> R + Sync,
    mut take: impl FnMut(&[E], R),
) {
    /// Enough for all cores, and few enough for memory.
    const AT_ONCE: usize = 64;
    for elements in elements.chunks(AT_ONCE * piece) {
        let found: Vec<R> = elements.par_chunks(piece).map(&find).collect();
        for (elements, found) in elements.chunks(piece).zip(found) {
            take(elements, found);
        }
    }
}

impl Moduli {
    /// The incompatible modes of an element with these points of integration, if it has any.
    fn modes<E, const D: usize, const N: usize, const Q: usize>(
        &self,
        kind: ElementKind,
        points: &[Point<D, N>; Q],
        x: &[[f64; D]; N],
        plane: Plane,
    ) -> Option<Modes<D, N>>
    where
        E: ShapeFunctions<D, N, Q>,
    {
        let modes = || Modes::new::<E, Q>(points, x, plane, &self.law);
        self.has_modes(kind).then(modes).flatten()
    }

    fn has_modes(&self, kind: ElementKind) -> bool {
        self.modes && kind.may_have_modes()
    }

    /// The projection of its dilatation, if there is one.
    fn dilatation<E, const D: usize, const N: usize, const Q: usize>(
        &self,
        kind: ElementKind,
        points: &[Point<D, N>; Q],
        x: &[[f64; D]; N],
        plane: Plane,
    ) -> Option<Dilatation<D, N>>
    where
        E: ShapeFunctions<D, N, Q>,
    {
        let projected = self.projected && E::DILATATION_MODES > 0 && !self.has_modes(kind);
        projected.then(|| Dilatation::new(E::DILATATION_MODES, points, x, plane))
    }
}
