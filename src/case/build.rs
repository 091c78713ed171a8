//! From a case to a contact problem.

use super::{AlgebraicTable, Case, CaseError};
use crate::matrix_market::{self, MatrixMarketError};
use crate::mesh::gmsh::GmshError;
use crate::model::{
    self, Built, Elastic, Fault, Kind, Model, ModelError, StepData, without_curves,
};
use crate::problem::{ContactData, ContactProblem, ProblemError};
use std::time::Instant;

/// A case could not be turned into a contact problem.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// A line of the case file is at fault.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The mesh could not be read.
    #[error(transparent)]
    Gmsh(#[from] GmshError),
    /// A matrix could not be read.
    #[error(transparent)]
    Matrix(#[from] MatrixMarketError),
    /// The matrices do not make a contact problem.
    #[error("{case}: {source}")]
    Problem {
        /// The case file.
        case: String,
        /// Why not.
        source: ProblemError,
    },
    /// Something else about the case as a whole.
    #[error("{case}: {message}")]
    Unsupported {
        /// The case file.
        case: String,
        /// What is wrong.
        message: String,
    },
}

/// A contact problem made from a case.
#[derive(Debug)]
pub struct Build {
    /// The problem with the load of the first step.
    pub problem: ContactProblem,
    /// None for an algebraic case.
    pub elastic: Option<Elastic>,
    /// Seconds for the mesh, or the matrices, to be read or made.
    pub mesh_seconds: f64,
    /// Seconds for K, f and the contact rows.
    pub assembly_seconds: f64,
    /// The part of it for the search and the integrals of the contacts.
    pub pairing_seconds: f64,
}

impl From<Built> for Build {
    fn from(built: Built) -> Self {
        Self {
            problem: built.problem,
            elastic: Some(built.elastic),
            mesh_seconds: 0.0,
            assembly_seconds: built.assembly_seconds,
            pairing_seconds: built.pairing_seconds,
        }
    }
}

impl Build {
    /// Which body one of [`ContactProblem::free_bodies`] is: its region and a point of it.
    pub fn free_body_name(&self, body: usize) -> String {
        model::body_name(&self.problem, self.elastic.as_ref(), body)
    }

    /// The bodies that only contact holds, and what they could do without, in words.
    pub fn free_bodies(&self) -> Vec<String> {
        model::free_bodies(&self.problem, self.elastic.as_ref())
    }
}

impl Case {
    /// Reads the mesh or the matrices and assembles the contact problem.
    pub fn build(&self) -> Result<Build, BuildError> {
        let start = Instant::now();
        if let Some(table) = &self.tables.algebraic {
            return self.build_algebraic(table.get_ref());
        }
        // The mesh is what chooses between the plane and space: from here on there is one model for each.
        let mesh = self.mesh()?;
        let mesh_seconds = start.elapsed().as_secs_f64();
        let definition = self.definition.clone();
        let built = Model { mesh, definition }.build();
        Ok(Build {
            mesh_seconds,
            ..built.map_err(|error| self.at_line(error))?.into()
        })
    }

    /// The load at the end of a step, counted from 0; None for an algebraic case, which has one.
    pub fn step(&self, build: &Build, step: usize) -> Result<Option<StepData>, BuildError> {
        let data = build.elastic.as_ref().map(|elastic| elastic.step(step));
        data.transpose().map_err(|error| self.at_line(error))
    }

    /// What is wrong with a part of the model, said about the line that it stands in.
    fn at_line(&self, error: ModelError) -> BuildError {
        let ModelError { entity, fault } = error;
        let fault = *fault;
        let message = match fault {
            Fault::Problem(source) => {
                return BuildError::Problem {
                    case: self.path.display().to_string(),
                    source,
                };
            }
            Fault::NoBoundary {
                ref name,
                ref known,
            } => self
                .part_without_curves(name, known)
                .unwrap_or_else(|| fault.to_string()),
            Fault::NoRegion { .. } | Fault::Boundary(_) => fault.to_string(),
            _ if entity.kind == Kind::Contact && entity.number.is_some() => {
                format!("contact {}: {fault}", entity.place)
            }
            _ => fault.to_string(),
        };
        let span = self.tables.span(&entity);
        self.at(span, message).into()
    }

    /// That a boundary is not there, where its part of the mesh has none while others have.
    fn part_without_curves(&self, name: &str, known: &[String]) -> Option<String> {
        let parts = self
            .tables
            .mesh
            .iter()
            .flat_map(|mesh| &mesh.get_ref().part);
        let mut prefixes = parts.map(|part| format!("{}-", part.get_ref().name));
        let prefix = prefixes.find(|prefix| name.starts_with(prefix))?;
        if known.iter().any(|known| known.starts_with(&prefix)) {
            return None;
        }
        let curve = &name[prefix.len()..];
        Some(format!(
            "there is no boundary \"{name}\"{}",
            without_curves(curve)
        ))
    }

    fn build_algebraic(&self, table: &AlgebraicTable) -> Result<Build, BuildError> {
        let start = Instant::now();
        let matrix = |path| matrix_market::read(&self.beside(path));
        let vector = |path| matrix(path)?.into_vector();
        let stiffness = matrix(&table.stiffness)?;
        let (rows, cols) = (stiffness.n_rows(), stiffness.n_cols());
        let coefficient = match &table.friction_coefficient {
            Some(path) => vector(path)?,
            None => Vec::new(),
        };
        let data = ContactData {
            stiffness: stiffness.into_stiffness()?,
            load: vector(&table.load)?,
            normal: matrix(&table.normal)?.into_csr(),
            tangential: matrix(&table.tangential)?.into_csr(),
            gap: vector(&table.gap)?,
            slip_bound: match &table.slip_bound {
                Some(path) => vector(path)?,
                None => vec![0.0; coefficient.len()],
            },
            coordinates: match &table.coordinates {
                Some(path) => Some(matrix(path)?.into_points()?),
                None => None,
            },
        };
        let failed = |source| BuildError::Problem {
            case: self.path.display().to_string(),
            source,
        };
        // Blocks round the sizes up to even numbers and would hide these.
        if rows != cols {
            return Err(failed(ProblemError::NotSquare { rows, cols }));
        }
        if data.load.len() != rows {
            return Err(failed(ProblemError::Length {
                name: "the load f",
                found: data.load.len(),
                expected: rows,
                reason: "one entry per row of K",
            }));
        }
        let mesh_seconds = start.elapsed().as_secs_f64();
        let problem = ContactProblem::new(data)
            .and_then(|problem| problem.with_friction_coefficient(coefficient))
            .map_err(failed)?;
        if let Some(text) = model::loose_body(&problem, None) {
            return Err(BuildError::Unsupported {
                case: self.path.display().to_string(),
                message: format!("the stiffness matrix is singular: {text}"),
            });
        }
        Ok(Build {
            problem,
            elastic: None,
            mesh_seconds,
            assembly_seconds: start.elapsed().as_secs_f64() - mesh_seconds,
            pairing_seconds: 0.0,
        })
    }
}
