//! The same solve on several machines: MPI for the processes, PETSc for the coarsest levels of multigrid
//! (feature `mpi`).
//!
//! Each process, a *rank*, has the rows of K that belong to its nodes, with u and f there and the columns of B; no rank
//! has all of K. λ and the Newton method are on all ranks, the same to the last bit, because rank 0 adds up every sum
//! over unknowns and sends it to the others. All functions here are collective: every rank has to call them, in the
//! same order. docs/mpi.md has the options of PETSc, measurements and limits.
//!
//! A model is cut up by rank 0 ([`Share::of_model`]); a program whose matrices are already distributed passes the rows of each rank
//! ([`Share::of_rows`]). An error of PETSc's on one rank leaves the others waiting: the rank with the error has to end all of them
//! ([`Group::abort`]).

mod foreseen;
mod matrices;
mod operator;
mod partition;
mod petsc;
#[cfg(feature = "files")]
mod results;
mod share;

pub use crate::ranks::Group;
pub use foreseen::Foreseen;
pub use matrices::OwnMatrices;
pub use mpi;
pub use petsc::PetscError;
#[cfg(feature = "files")]
pub use results::{RanksReport, Results, ResultsError};
pub use share::{AnyShare, Imbalance, MpiError, Share};

use mpi::environment::Universe;
use mpi::traits::Communicator;
use mpi::{Threading, initialize_with_threading};
use std::io::Write as _;
use std::sync::Arc;
use std::time::Duration;

/// MPI as long as a program uses it; it ends PETSc and MPI when it is dropped.
pub struct World {
    group: Arc<Group>,
    _universe: Universe,
}

/// How long a failed rank waits for rank 0 to report the same error: an error on all ranks is reported once.
const FIRST: Duration = Duration::from_millis(500);

impl World {
    /// Starts MPI. From here on a panic of any rank ends all of them, with exit code 1.
    ///
    /// # Errors
    /// If MPI is already running, or does not allow calls from several threads one at a time.
    pub fn start() -> Result<Self, String> {
        let (universe, level) =
            initialize_with_threading(Threading::Serialized).ok_or("MPI is already running")?;
        if level < Threading::Serialized {
            return Err("this MPI cannot be called from several threads, one at a time".to_owned());
        }
        let group = Arc::new(Group::of(&universe.world()));
        share_cores(&universe);
        let here = Arc::clone(&group);
        std::panic::set_hook(Box::new(move |panic| {
            here.abort(&format!("{panic}"), 1);
        }));
        Ok(Self {
            group,
            _universe: universe,
        })
    }

    /// All ranks.
    pub fn group(&self) -> &Arc<Group> {
        &self.group
    }
}

/// Ranks of one machine share its cores: each takes its share of the cores as threads, at least one. Cores to which a launcher
/// binds a rank are not shared.
fn share_cores(universe: &Universe) {
    if std::env::var_os("RAYON_NUM_THREADS").is_some() {
        return;
    }
    let world = universe.world();
    let here = world.split_shared(world.rank()).size() as usize;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    // Existing threads stay.
    let _ = rayon::ThreadPoolBuilder::new()
        .num_threads((cores / here).max(1))
        .build_global();
}

impl Drop for World {
    fn drop(&mut self) {
        petsc::finish();
    }
}

impl Group {
    /// Ends all ranks with a message and an exit code. If rank 0 has the same error, rank 0 reports it.
    pub fn abort(&self, message: &str, code: i32) -> ! {
        if self.rank() != 0 {
            std::thread::sleep(FIRST + self.rank().min(20) as u32 * FIRST / 10);
        }
        let _ = writeln!(std::io::stderr(), "error: rank {}: {message}", self.rank());
        self.communicator().abort(code)
    }
}
