//! The common part of mesh files of any program, and their errors.

pub(super) mod build;
pub(super) mod raw;

use super::MeshError;
use crate::input;
use std::path::{Path, PathBuf};

/// The reason why a mesh file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file could not be opened or read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// An entry of the file is invalid.
    #[error("{}, {place}: {message}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The line, or in a binary file the byte.
        place: String,
        /// The fault and the remedy.
        message: String,
    },
    /// The file is of another kind, or invalid as a whole.
    #[error("{}: this is {what}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Its kind and the remedy.
        what: String,
    },
    /// The file is valid, but gives no mesh.
    #[error("{}: {message}", path.display())]
    NoMesh {
        /// The file.
        path: PathBuf,
        /// The missing part and the remedy.
        message: String,
    },
    /// The mesh of the file is invalid.
    #[error("{}: {source}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// The fault of the mesh.
        source: MeshError,
    },
}

/// An error of a reader.
#[derive(Debug)]
pub(super) enum Failure {
    Line { number: usize, message: String },
    Format { place: String, message: String },
    NoMesh(String),
    Mesh(MeshError),
}

pub(super) type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    /// The error about a line, counted from 1.
    pub fn line(number: usize, message: impl Into<String>) -> Self {
        Self::Line {
            number,
            message: message.into(),
        }
    }

    /// The same with its file.
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
