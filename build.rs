//! With the feature `mpi`: finds PETSc and MPI, and writes the part of PETSc's C interface that is used (`src/mpi/petsc.rs`).
//! Without it there is nothing to do.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    #[cfg(feature = "mpi")]
    if let Err(message) = petsc::bind() {
        // Cargo shows what a build script that failed has written to standard error.
        eprintln!("error: feature \"mpi\": {message}");
        std::process::exit(1);
    }
}

#[cfg(feature = "mpi")]
mod petsc {
    use std::env;
    use std::path::{Path, PathBuf};

    /// What of PETSc is called, with all types that this needs.
    const FUNCTIONS: [&str; 3] = [
        "Petsc(Initialized|InitializeNoArguments|Finalize|ErrorMessage|PushErrorHandler|GetVersionNumber|OptionsHasName|OptionsSetValue)",
        "Mat(Create|SetSizes|SetBlockSize|SetType|SetOption|SeqAIJSetPreallocation|MPIAIJSetPreallocation|SetValuesBlocked|Assembly(Begin|End)|CreateVecs|SetNearNullSpace|GetSize|Destroy|NullSpace(Create|Destroy))",
        "(Vec((Get|Restore)Array|GetLocalSize|Set|Destroy)|PC(Create|SetOptionsPrefix|SetOperators|SetFromOptions|SetUp|GetFailedReason|Apply|GetType|MGGetLevels|MGGetSmoother|Destroy)|KSPGetOperators)",
    ];
    const CONSTANTS: &str = "(InsertMode|MatAssemblyType|MatOption|PetscErrorType)_.*";

    /// What to install where something is missing.
    const INSTALL: &str = "on Debian: apt-get install libopenmpi-dev openmpi-bin libclang-dev libpetsc-real-dev; on a \
                           cluster: load the modules of MPI and PETSc (3.18 or newer, real numbers in double precision), and set \
                           PETSC_DIR and, where PETSc was built in place, PETSC_ARCH";

    /// Finds PETSc, checks what it was built for, links it, and writes its interface.
    pub fn bind() -> Result<(), String> {
        for name in ["PETSC_DIR", "PETSC_ARCH", "PKG_CONFIG_PATH"] {
            println!("cargo::rerun-if-env-changed={name}");
        }
        let petsc = find()?;
        check(&petsc.include_paths)?;
        for dir in &petsc.link_paths {
            println!("cargo::rustc-link-arg=-Wl,-rpath,{}", dir.display());
        }
        let mpi = build_probe_mpi::probe()
            .map_err(|_| format!("no MPI was found (is mpicc in the path?): {INSTALL}"))?;
        let mut builder = bindgen::builder()
            .header_contents("signorini-petsc.h", "#include <petscksp.h>\n")
            .allowlist_var(CONSTANTS)
            .allowlist_type("MatOption|PetscErrorType|MatAssemblyType|InsertMode")
            .blocklist_type("MPI_Comm|ompi_communicator_t")
            .raw_line("use mpi::ffi::MPI_Comm;")
            .default_enum_style(bindgen::EnumVariation::Consts)
            .layout_tests(false)
            .generate_comments(false);
        for functions in FUNCTIONS {
            builder = builder.allowlist_function(functions);
        }
        for dir in petsc.include_paths.iter().chain(&mpi.include_paths) {
            builder = builder.clang_arg(format!("-I{}", dir.display()));
        }
        let bindings = builder
            .generate()
            .map_err(|error| format!("PETSc's headers could not be read: {error}; {INSTALL}"))?;
        let to = Path::new(&env::var("OUT_DIR").unwrap_or_default()).join("petsc.rs");
        bindings
            .write_to_file(&to)
            .map_err(|error| format!("cannot write {}: {error}", to.display()))
    }

    /// PETSc as pkg-config knows it, that of PETSC_DIR and PETSC_ARCH first.
    fn find() -> Result<pkg_config::Library, String> {
        let mut stated = String::new();
        if let Ok(dir) = env::var("PETSC_DIR") {
            let arch = env::var("PETSC_ARCH").unwrap_or_default();
            let place = Path::new(&dir).join(arch).join("lib/pkgconfig");
            if !place.is_dir() {
                return Err(format!(
                    "PETSC_DIR and PETSC_ARCH lead to {}, which is no directory: correct or unset them",
                    place.display()
                ));
            }
            let path = env::var("PKG_CONFIG_PATH").unwrap_or_default();
            // SAFETY: a build script has one thread.
            unsafe { env::set_var("PKG_CONFIG_PATH", format!("{}:{path}", place.display())) };
            stated = format!(" (looked for in {} first)", place.display());
        }
        let mut last = String::new();
        for name in ["PETSc", "petsc"] {
            match pkg_config::Config::new()
                .atleast_version("3.18")
                .probe(name)
            {
                Ok(found) => return Ok(found),
                Err(error) => last = error.to_string(),
            }
        }
        let reason = last.lines().next().unwrap_or_default().to_owned();
        Err(format!(
            "no PETSc of version 3.18 or newer was found{stated} ({reason}): {INSTALL}"
        ))
    }

    /// Whether its numbers are real and of double precision, as petscconf.h has it.
    fn check(include: &[PathBuf]) -> Result<(), String> {
        let conf = include
            .iter()
            .map(|dir| dir.join("petscconf.h"))
            .find(|path| path.exists());
        let Some(conf) = conf else {
            return Err(format!(
                "PETSc has no petscconf.h beside its headers: {INSTALL}"
            ));
        };
        println!("cargo::rerun-if-changed={}", conf.display());
        let text = std::fs::read_to_string(&conf)
            .map_err(|error| format!("cannot read {}: {error}", conf.display()))?;
        let has = |name: &str| {
            text.lines()
                .any(|line| line.starts_with(&format!("#define {name} ")))
        };
        if has("PETSC_USE_REAL_DOUBLE") && !has("PETSC_USE_COMPLEX") {
            return Ok(());
        }
        Err(format!(
            "the PETSc of {} computes in complex numbers or not in double precision: {INSTALL}",
            conf.display()
        ))
    }
}
