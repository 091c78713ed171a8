//! What mesh files of any program have in common, and what is wrong with one.

pub(super) mod build;
pub(super) mod raw;

use super::MeshError;
use crate::input;
use std::path::{Path, PathBuf};

/// Why a mesh file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// What stands at a place of the file is not what should.
    #[error("{}, {place}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The line, or in a binary file the byte.
        place: String,
        /// What is wrong, and what to do.
        message: String,
    },
    /// The file is of another kind, or as a whole not what it should be.
    #[error("{}: this is {what}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it is, and what to do.
        what: String,
    },
    /// The file is in order, but no mesh comes of it.
    #[error("{}: {message}", path.display())]
    NoMesh {
        /// The file.
        path: PathBuf,
        /// What is missing, and what to do.
        message: String,
    },
    /// The mesh of the file is none.
    #[error("{}: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// What is wrong with the mesh.
        source: MeshError,
    },
}

/// What a reader complains of.
#[derive(Debug)]
pub(super) enum Failure {
    Line { number: usize, message: String },
    Format { place: String, message: String },
    NoMesh(String),
    Mesh(MeshError),
}

pub(super) type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    /// That a line, counted from 1, is not what it should be.
    pub fn line(number: usize, message: impl Into<String>) -> Self {
        Self::Line {
            number,
            message: message.into(),
        }
    }

    /// The same with the file that it is about.
    pub fn of(self, path: &Path) -> FileError {
        let path = path.to_owned();
        match self {
            Self::Line { number, message } => FileError::Format {
                path,
                place: format!("line {number}"),
                message,
            },
            Self::Format { place, message } => FileError::Format {
                path,
                place,
                message,
            },
            Self::NoMesh(message) => FileError::NoMesh { path, message },
            Self::Mesh(source) => FileError::Mesh { path, source },
        }
    }
}

/// All bytes of a file.
pub(super) fn bytes(path: &Path) -> std::result::Result<Vec<u8>, FileError> {
    input::whole(path, input::data_limit()).map_err(|source| FileError::Io {
        path: path.to_owned(),
        source,
    })
}
