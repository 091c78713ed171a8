//! Whether this process is one of several that a launcher (`mpirun`, `srun`) has started together.

use std::env;

/// The variables in which launchers pass the number of a process and the number of processes: mpirun of Open MPI, then
/// MPICH, Intel MPI and `srun --mpi=pmi2`, MVAPICH, and any `srun`. Other variables of Slurm, such as `SLURM_NTASKS`,
/// are also set in the shell of `salloc` and in the script of `sbatch`, where a program runs alone. Only `srun` counts
/// the processes of its step.
const LAUNCHERS: [[&str; 2]; 4] = [
    ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"],
    ["PMI_RANK", "PMI_SIZE"],
    ["MV2_COMM_WORLD_RANK", "MV2_COMM_WORLD_SIZE"],
    ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS"],
];

/// With the value 1 a process by itself is a rank, so that the costs of a rank can be measured.
const ALONE: &str = "SIGNORINI_RANKS";

/// One of several processes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Its number.
    pub rank: usize,
    /// The number of processes.
    pub size: usize,
}

/// The place that the launcher passes; None without a launcher, and for a process that it started alone, unless [`ALONE`] asks for
/// one.
pub fn place() -> Option<Place> {
    let number = |name: &str| env::var(name).ok()?.parse().ok();
    let place = LAUNCHERS.iter().find_map(|[rank, size]| {
        Some(Place {
            rank: number(rank)?,
            size: number(size)?,
        })
    });
    let alone = || (number(ALONE) == Some(1)).then_some(Place { rank: 0, size: 1 });
    place.filter(|place| place.size > 1).or_else(alone)
}
