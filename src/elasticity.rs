//! Linear elasticity in the plane: materials, supports, loads, the stiffness matrix K and stresses.
//!
//! Small strains, isotropic materials, 3-node triangles and bilinear 4-node quadrilaterals with full
//! integration. Forces are per body of the given thickness; coordinates, moduli and tractions may be in
//! any consistent units (metres, pascals and newtons in the documentation).

mod assembly;
mod element;
mod stress;

pub use assembly::{assemble, internal_forces, load_vector};
pub(crate) use element::edge_points;
pub use stress::{Stress, stresses};

use crate::mesh::Mesh;
use element::integration_points;

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
    /// The Lamé pair (λ, μ) that makes σ = λ tr(ε) I + 2μ ε hold in the plane.
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
pub type Field<'a> = &'a (dyn Fn([f64; 2]) -> f64 + Sync);

/// The body: a mesh with a material for each region, the plane state and the thickness.
#[derive(Clone, Copy)]
pub struct Body<'a> {
    /// The mesh.
    pub mesh: &'a Mesh,
    /// One material per region of the mesh.
    pub materials: &'a [Material],
    /// Plane strain or plane stress.
    pub plane: Plane,
    /// Thickness perpendicular to the plane.
    pub thickness: f64,
}

/// Which displacement components are prescribed, and the numbering of the rest.
///
/// A node with at least one free component is a *block* of two unknowns; components prescribed at such
/// a node keep a decoupled equation (u = 0) so that every block is 2 × 2. Nodes prescribed in both
/// components are not in the system.
#[derive(Clone, Debug)]
pub struct Unknowns {
    prescribed: Vec<[Option<f64>; 2]>,
    block_of_node: Vec<Option<u32>>,
    node_of_block: Vec<u32>,
    n_free: usize,
}

impl Unknowns {
    /// The numbering for `prescribed[node][component]` (None: free).
    pub fn new(prescribed: Vec<[Option<f64>; 2]>) -> Self {
        let mut node_of_block = Vec::with_capacity(prescribed.len());
        let block_of_node = prescribed
            .iter()
            .enumerate()
            .map(|(node, components)| {
                components.iter().any(Option::is_none).then(|| {
                    node_of_block.push(node as u32);
                    node_of_block.len() as u32 - 1
                })
            })
            .collect();
        let n_free = prescribed.iter().flatten().filter(|c| c.is_none()).count();
        Self {
            prescribed,
            block_of_node,
            node_of_block,
            n_free,
        }
    }

    /// Number of free displacement components.
    pub fn n_free(&self) -> usize {
        self.n_free
    }

    /// Number of blocks: K has twice as many rows.
    pub fn n_blocks(&self) -> usize {
        self.node_of_block.len()
    }

    /// The block of a node, if any of its components is free.
    pub fn block(&self, node: u32) -> Option<u32> {
        self.block_of_node[node as usize]
    }

    /// The node of a block.
    pub fn node(&self, block: usize) -> u32 {
        self.node_of_block[block]
    }

    /// The prescribed value of a component of a node.
    pub fn prescribed(&self, node: u32) -> [Option<f64>; 2] {
        self.prescribed[node as usize]
    }

    /// Displacement of every node from the solution `u` of the system.
    pub fn displacements(&self, u: &[f64]) -> Vec<[f64; 2]> {
        self.prescribed
            .iter()
            .zip(&self.block_of_node)
            .map(|(prescribed, block)| {
                std::array::from_fn(|c| {
                    prescribed[c].unwrap_or_else(|| {
                        let block = block.expect("a node with a free component has a block");
                        u[2 * block as usize + c]
                    })
                })
            })
            .collect()
    }

    /// Coordinates of the nodes of the blocks (for rigid body modes).
    pub fn coordinates(&self, mesh: &Mesh) -> Vec<[f64; 2]> {
        self.node_of_block
            .iter()
            .map(|&node| mesh.nodes[node as usize])
            .collect()
    }
}

impl Body<'_> {
    /// Adds ∫ t·v over the edges to the nodal forces (two per node); `traction(x, n)` gives t in Pa at
    /// the point x with outward unit normal n.
    pub fn add_traction(
        &self,
        edges: &[[u32; 2]],
        traction: impl Fn([f64; 2], [f64; 2]) -> [f64; 2],
        forces: &mut [[f64; 2]],
    ) {
        for &edge in edges {
            let (length, normal) = self.mesh.edge_normal(edge);
            for (x, shape, weight) in edge_points(edge.map(|node| self.mesh.nodes[node as usize])) {
                let t = traction(x, normal);
                for (node, shape) in edge.iter().zip(shape) {
                    for c in 0..2 {
                        forces[*node as usize][c] +=
                            self.thickness * length * weight * shape * t[c];
                    }
                }
            }
        }
    }

    /// Adds ∫ b·v over the elements of some regions (None: all) to the nodal forces; `force(x, density)`
    /// gives the force per volume in N/m³.
    pub fn add_body_force(
        &self,
        regions: Option<&[u32]>,
        force: impl Fn([f64; 2], f64) -> [f64; 2],
        forces: &mut [[f64; 2]],
    ) {
        for element in &self.mesh.elements {
            if regions.is_some_and(|regions| !regions.contains(&element.region)) {
                continue;
            }
            let density = self.materials[element.region as usize].density;
            let x = self.mesh.coordinates(element);
            for point in integration_points(element.nodes().len(), &x) {
                let b = force(point.place(&x), density);
                for (a, &node) in element.nodes().iter().enumerate() {
                    for c in 0..2 {
                        forces[node as usize][c] +=
                            self.thickness * point.weight * point.shape[a] * b[c];
                    }
                }
            }
        }
    }

    /// ∫ q φᵢ ds for every node i of the edges: the nodal share of a quantity q given per area.
    pub fn integrate_on_boundary(&self, edges: &[[u32; 2]], q: Field, shares: &mut [f64]) {
        for &edge in edges {
            let (length, _) = self.mesh.edge_normal(edge);
            for (x, shape, weight) in edge_points(edge.map(|node| self.mesh.nodes[node as usize])) {
                for (node, shape) in edge.iter().zip(shape) {
                    shares[*node as usize] += self.thickness * length * weight * shape * q(x);
                }
            }
        }
    }
}
