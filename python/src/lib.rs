//! The Rust part of the Python package `signorini`: problems, meshes and solves, with numbers as arrays of NumPy. Names,
//! defaults and everything easier in Python are in `signorini/*.py`; users never see this module.

mod arrays;
mod delassus;
mod errors;
mod fork;
mod mesh;
mod problem;
mod settings;
mod solved;
mod watch;

use pyo3::prelude::*;

#[global_allocator]
static ALLOCATOR: signorini::memory::LargePages = signorini::memory::LargePages;

/// The Rust side of the package.
#[pymodule]
mod _native {
    #[pymodule_export]
    use super::delassus::solve_delassus;
    #[pymodule_export]
    use super::errors::{ModelError, SolveError};
    #[pymodule_export]
    use super::mesh::Mesh;
    #[pymodule_export]
    use super::problem::{Problem, build, check_tables, read_case};
    #[pymodule_export]
    use super::solved::Solved;
    #[pymodule_export]
    use super::{program, version};

    #[pymodule_init]
    fn init(_module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
        super::fork::loaded();
        Ok(())
    }
}

/// Runs the command line with these arguments, the name of the program first; returns its exit code.
#[pyfunction]
fn program(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| fork::with_threads(|| signorini::cli::run(arguments)))
}

/// The version of the package, which is that of the program.
#[pyfunction]
fn version() -> &'static str {
    env!("CARGO_PKG_VERSION")
}
