//! A program without the feature `mpi` under `mpirun` and `srun`, by the variables that these pass to their processes.

use crate::run::{command, directory, text, write};

const CASE: &str = "[mesh.rectangle]\nsize = [1, 1]\ncells = [2, 2]\n[[material]]\nyoung = 1e9\npoisson = 0.3\n\
    [[support]]\nboundary = \"left\"\nx = 0\ny = 0\n[[traction]]\nboundary = \"top\"\ny = -1e6\n";

/// One of several processes cannot solve or check for all of them: the first reports it, the others have its exit code. A process
/// alone works, also inside an allocation of Slurm: the shell of `salloc` and the script of `sbatch` know of tasks that are not
/// started.
#[test]
fn several_processes_report_once() {
    let place = directory();
    let case = place.path().join("case.toml");
    write(&case, CASE);
    let started = |name: &str, says: &[(&str, &str)]| {
        let mut program = command(&[name]);
        program.arg(&case).envs(says.iter().copied());
        if name == "solve" {
            program
                .arg("--quiet")
                .arg("--output")
                .arg(place.path().join("out"));
        }
        let run = program.output().unwrap_or_else(|error| panic!("{error}"));
        (run.status.code(), text(&run.stderr))
    };
    for name in ["solve", "check"] {
        for [rank, size] in [
            ["OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"],
            ["PMI_RANK", "PMI_SIZE"],
            ["SLURM_PROCID", "SLURM_STEP_NUM_TASKS"],
        ] {
            let (code, said) = started(name, &[(rank, "0"), (size, "4")]);
            assert_eq!(code, Some(1), "{said}");
            assert_eq!(said.matches("error: ").count(), 1, "{said}");
            assert!(said.contains("--features mpi"), "{said}");
            let (code, said) = started(name, &[(rank, "3"), (size, "4")]);
            assert_eq!((code, said.as_str()), (Some(1), ""));
            let (code, said) = started(name, &[(rank, "0"), (size, "1")]);
            assert_eq!((code, said.as_str()), (Some(0), ""));
        }
        let allocation = [
            ("SLURM_JOB_ID", "17"),
            ("SLURM_NTASKS", "4"),
            ("SLURM_NPROCS", "4"),
        ];
        let script = [&allocation[..], &[("SLURM_PROCID", "0")]].concat();
        for says in [&allocation[..], &script] {
            let (code, said) = started(name, says);
            assert_eq!((code, said.as_str()), (Some(0), ""));
        }
    }
}
