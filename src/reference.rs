//! The reference problems: the two geometries that have the sizes of the paper's Table 1, and the two
//! load cases on which counts and timings are compared.
//!
//! The paper prints n and m and nothing else about its example. Both geometries here reproduce all of its pairs n/m
//! (k = 1, 3, …, 13). Material and loads are those usual in this family of tests, and the slip bound is our choice.

mod solid;

pub use solid::{BEAM, CASE_C, Solid};

use crate::contact::{ContactError, ContactPlace, Friction, Obstacle, PairOptions};
use crate::contact::{contact_rows, mortar_contact, obstacle_contact};
use crate::elasticity::{Body, Material, Plane, Unknowns, assemble, vertices};
use crate::mesh::structured::{CellShape, join, rectangle};
use crate::mesh::{ElementKind, Mesh, Topology, facet_nodes};
use crate::problem::{ContactData, ContactProblem, ProblemError};

/// The material of all reference problems.
pub const MATERIAL: Material = Material {
    young: 21.19e10,
    poisson: 0.277,
    density: 0.0,
    expansion: 0.0,
    incompressible: crate::elasticity::Incompressible::Auto,
    incompatible_modes: false,
    law: crate::elasticity::Hyperelastic::StVenantKirchhoff,
    thickness: None,
};

/// The geometry of a reference problem.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Geometry {
    /// A 3 × 1 rectangle of 60k × 10k square cells, clamped on x = 0, its bottom on a rigid plane.
    OneBody,
    /// Two such rectangles of 30k × 10k cells on top of each other, both clamped on x = 0, with matching nodes.
    TwoBodies,
}

/// Loads and slip bound of a reference problem.
#[derive(Clone, Copy, Debug)]
pub struct Loads {
    /// Traction on the top at x, in Pa.
    pub top: fn(f64) -> [f64; 2],
    /// Traction on the right side of the (upper) body at height y above its bottom, in Pa.
    pub right: fn(f64) -> [f64; 2],
    /// Tresca bound in Pa.
    pub tresca: f64,
}

/// The loads taken for Table 1: pressed from above, its right side pulled out and lifted.
pub const TABLE1: Loads = Loads {
    top: |x| [0.0, -6e7 - 1e7 / 3.0 * x],
    right: |y| [2e7, 4e7 - 2e7 * y],
    tresca: 2e6,
};

/// Reference case A: partial contact, nearly everything slips.
pub const CASE_A: Loads = Loads {
    top: |x| {
        [
            0.0,
            -2e7 * (1.0 - x / 1.5).max(0.0) + 6e6 * (x - 2.0).max(0.0),
        ]
    },
    right: |_| [4e6, 0.0],
    tresca: 1.5e6,
};

/// Reference case B: as case A with twice the slip bound, so that a part sticks.
pub const CASE_B: Loads = Loads {
    tresca: 3e6,
    ..CASE_A
};

/// A reference problem could not be built.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// Its contact is faulty.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// Its matrices are.
    #[error(transparent)]
    Problem(#[from] ProblemError),
}

/// The mesh of a geometry at refinement k; the bodies are `body`, or `lower` and `upper`.
pub fn mesh(geometry: Geometry, k: usize) -> Mesh {
    let quads = |origin, cells, region: &str, prefix: &str| {
        rectangle(origin, [3.0, 1.0], cells, CellShape::Quad, region, prefix)
    };
    match geometry {
        Geometry::OneBody => quads([0.0, 0.0], [60 * k, 10 * k], "body", ""),
        Geometry::TwoBodies => join(
            quads([0.0, 0.0], [30 * k, 10 * k], "lower", "lower-"),
            quads([0.0, 1.0], [30 * k, 10 * k], "upper", ""),
        ),
    }
}

/// The contact problem on a mesh made by [`mesh`].
pub fn problem(
    geometry: Geometry,
    mesh: &Mesh,
    loads: &Loads,
) -> Result<ContactProblem, ReferenceError> {
    let materials = vec![MATERIAL; mesh.regions.len()];
    let body = Body {
        mesh,
        materials: &materials,
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let mut prescribed = vec![[None; 2]; mesh.nodes.len()];
    for (name, edges) in &mesh.boundaries {
        if name.ends_with("left") {
            for &node in edges.iter().flat_map(facet_nodes) {
                prescribed[node as usize] = [Some(0.0); 2];
            }
        }
    }
    let unknowns = Unknowns::new(prescribed);

    let bottom = &mesh.boundaries["bottom"];
    let base = mesh.nodes[bottom[0][0] as usize][1];
    let mut forces = vec![[0.0; 2]; mesh.nodes.len()];
    body.add_traction(
        &mesh.boundaries["top"],
        |x, _| (loads.top)(x[0]),
        &mut forces,
    );
    body.add_traction(
        &mesh.boundaries["right"],
        |x, _| (loads.right)(x[1] - base),
        &mut forces,
    );
    let tresca = |_: [f64; 2]| loads.tresca;
    let options = PairOptions {
        friction: Friction::Tresca(&tresca),
        ..Default::default()
    };
    let candidates: Vec<ContactPlace> = match geometry {
        Geometry::OneBody => {
            let plane = Obstacle::HalfSpace {
                point: [0.0, 0.0],
                normal: [0.0, 1.0],
            };
            obstacle_contact(&body, bottom, &plane, &options)?
        }
        Geometry::TwoBodies => {
            mortar_contact(&body, bottom, &mesh.boundaries["lower-top"], &options)?.places
        }
    };
    contact_problem(&body, &unknowns, &forces, &candidates)
}

/// The problem of a body with given slip bounds, from its nodal forces and contact nodes.
fn contact_problem<const D: usize>(
    body: &Body<D>,
    unknowns: &Unknowns<D>,
    forces: &[[f64; D]],
    candidates: &[ContactPlace<D>],
) -> Result<ContactProblem<D>, ReferenceError>
where
    ElementKind: Topology<D>,
{
    let (stiffness, load) = assemble(body, unknowns, forces);
    let rows = contact_rows(body, unknowns, candidates)?;
    let problem = ContactProblem::new(ContactData {
        stiffness,
        load,
        gap: rows.gap(unknowns),
        normal: rows.normal,
        tangential: rows.tangential,
        slip_bound: rows.slip_bound,
        coordinates: Some(unknowns.coordinates(body.mesh)),
    })?
    .with_free_unknowns(unknowns.n_free());
    Ok(match vertices(body, unknowns) {
        Some(vertices) => problem.with_vertices(vertices),
        None => problem,
    })
}
