//! A forecast of each rank's part, before anything is divided.

use super::partition;
use super::share::MpiError;
use crate::contact::Space;
use crate::mesh::ElementKind;
use crate::model::Draft;
use crate::model::share::{Graph, freedoms};
use crate::problem::ContactProblem;

/// The distribution of a problem among so many ranks.
#[derive(Clone, Debug)]
pub struct Foreseen {
    /// For each rank its unknowns, and roughly the mebibytes of the process.
    pub ranks: Vec<(usize, f64)>,
    /// Roughly the mebibytes of rank 0 while it has the whole mesh and divides it; of a model.
    pub root_mib: Option<f64>,
    /// The bodies that only contact holds, and how they could move as a whole, in words; of a model.
    pub floating_bodies: Vec<String>,
}

impl Foreseen {
    /// Of a model.
    ///
    /// # Errors
    /// If METIS fails, or a body can move as a whole and has no contact to hold it.
    pub fn of_model<const D: usize>(draft: &Draft<D>, ranks: usize) -> Result<Self, MpiError>
    where
        ElementKind: Space<D>,
    {
        let elastic = draft.elastic();
        let graph = Graph::new(elastic).ok_or_else(too_large)?;
        let has_block = |node: usize| elastic.unknowns.block(node as u32).is_some();
        let mesh = &elastic.mesh;
        let sizes = [mesh.nodes.len(), mesh.elements.len(), graph.others.len()];
        let bytes: usize = (sizes.iter().zip(WHOLE))
            .map(|(size, bytes)| size * bytes)
            .sum();
        Ok(Self {
            ranks: shares::<D>(graph, has_block, ranks)?,
            root_mib: Some(ALONE + bytes as f64 / f64::from(1 << 20)),
            floating_bodies: freedoms(elastic)?,
        })
    }

    /// Of a problem from matrices.
    ///
    /// # Errors
    /// If METIS fails.
    pub fn of_problem<const D: usize>(
        problem: &ContactProblem<D>,
        ranks: usize,
    ) -> Result<Self, MpiError> {
        let graph = Graph::of_matrix(problem.stiffness()).ok_or_else(too_large)?;
        Ok(Self {
            ranks: shares::<D>(graph, |_| true, ranks)?,
            root_mib: None,
            floating_bodies: Vec::new(),
        })
    }
}

fn too_large() -> MpiError {
    MpiError::Partition("the mesh is too large for METIS's 32-bit numbers".to_owned())
}

/// The part of each rank in a graph whose nodes have D unknowns each, or none.
fn shares<const D: usize>(
    mut graph: Graph,
    has_block: impl Fn(usize) -> bool,
    ranks: usize,
) -> Result<Vec<(usize, f64)>, MpiError> {
    let owners = partition::owners(&mut graph, ranks).map_err(MpiError::Partition)?;
    let mut all = vec![(0, 0); ranks];
    for (node, (&owner, &work)) in owners.iter().zip(&graph.work).enumerate() {
        if has_block(node) {
            let (unknowns, blocks) = &mut all[owner as usize];
            *unknowns += D;
            *blocks += work as usize;
        }
    }
    let mebibytes = |blocks: usize| BYTES * (D * D * blocks) as f64 / f64::from(1 << 20);
    Ok(all
        .into_iter()
        .map(|(unknowns, blocks)| (unknowns, ALONE + mebibytes(blocks)))
        .collect())
}

/// Bytes of a rank for each entry of its rows of K, including all levels of multigrid and their set-up. Reference case
/// C has 81 entries a row. On two ranks it takes 2.3 kB an unknown with n = 313 632, and 2.0 kB with n = 1 037 232.
const BYTES: f64 = 27.0;
/// Bytes of rank 0 for each node, each element and each neighbour of a node while it divides a mesh. Reference case C of
/// hexahedra and tetrahedra of both orders with 105 000 nodes, and of hexahedra with 348 000, takes 0 to 7 % less.
const WHOLE: [usize; 3] = [290, 140, 15];
/// Mebibytes of a rank that has no unknowns: MPI, PETSc, and the program.
const ALONE: f64 = 57.0;
