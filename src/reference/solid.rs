//! Reference problems in space.

use super::{MATERIAL, ReferenceError, contact_problem};
use crate::contact::{Friction, Obstacle, PairOptions, obstacle_contact};
use crate::elasticity::{Body, Plane, Unknowns};
use crate::mesh::Mesh;
use crate::mesh::structured::{SolidShape, block};
use crate::problem::ContactProblem;

/// A block on a rigid plane, clamped on x = 0.
#[derive(Clone, Copy, Debug)]
pub struct Solid {
    /// Its edges in m.
    pub size: [f64; 3],
    /// Traction on the top, in Pa.
    pub top: fn([f64; 3]) -> [f64; 3],
    /// Traction on its free end, in Pa.
    pub end: [f64; 3],
    /// Tresca bound in Pa.
    pub tresca: f64,
}

/// Reference case C: a block of 3 × 1 × 1, pressed down, lifted and pulled sideways at its end: it sticks, slips in all
/// directions and separates.
pub const CASE_C: Solid = Solid {
    size: [3.0, 1.0, 1.0],
    top: |[x, y, _]| {
        let pressed = -2e7 * (1.0 - 0.8 * x / 3.0) * (1.0 + 0.3 * y);
        [0.0, 0.0, pressed + 1.6e7 * (x - 2.0).max(0.0)]
    },
    end: [6e6, 3e6, 1e6],
    tresca: 3e6,
};

/// A slender beam of 10 × 1 × 1, pressed down except at its end and pulled sideways there. Bending dwarfs everything
/// else in A, and pressures nearly vanish over much of the base.
pub const BEAM: Solid = Solid {
    size: [10.0, 1.0, 1.0],
    top: |[x, y, _]| [0.0, 0.0, if x < 7.0 { -2e6 * (1.0 + y) } else { 0.0 }],
    end: [0.0, 1e5, 0.0],
    tresca: 3e5,
};

impl Solid {
    /// The problem on a mesh of q cells per metre.
    ///
    /// # Panics
    /// If q is 0.
    pub fn problem(
        &self,
        q: usize,
        shape: SolidShape,
    ) -> Result<ContactProblem<3>, ReferenceError> {
        self.problem_on(&self.mesh(q, shape))
    }

    /// Its mesh of q cells per metre.
    ///
    /// # Panics
    /// If q is 0.
    pub fn mesh(&self, q: usize, shape: SolidShape) -> Mesh<3> {
        let cells = self.size.map(|edge| (edge * q as f64).round() as usize);
        block([0.0; 3], self.size, cells, shape, "body", "")
    }

    /// The problem on a mesh, for example [`Self::mesh`].
    pub fn problem_on(&self, mesh: &Mesh<3>) -> Result<ContactProblem<3>, ReferenceError> {
        let body = Body {
            mesh,
            materials: &[MATERIAL],
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        let mut prescribed = vec![[None; 3]; mesh.nodes.len()];
        for (held, node) in prescribed.iter_mut().zip(&mesh.nodes) {
            if node[0] == 0.0 {
                *held = [Some(0.0); 3];
            }
        }
        let unknowns = Unknowns::new(prescribed);
        let mut forces = vec![[0.0; 3]; mesh.nodes.len()];
        body.add_traction(&mesh.boundaries["top"], |x, _| (self.top)(x), &mut forces);
        body.add_traction(&mesh.boundaries["right"], |_, _| self.end, &mut forces);
        let tresca = |_: [f64; 3]| self.tresca;
        let options = PairOptions {
            friction: Friction::Tresca(&tresca),
            ..Default::default()
        };
        let floor = Obstacle::HalfSpace {
            point: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
        };
        let candidates = obstacle_contact(&body, &mesh.boundaries["bottom"], &floor, &options)?;
        contact_problem(&body, &unknowns, &forces, &candidates)
    }
}
