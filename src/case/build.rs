//! From a case to a contact problem.

use super::{AlgebraicTable, Case, CaseError};
use crate::contact::Space;
use crate::matrix_market::{self, Matrix, MatrixMarketError};
use crate::mesh::{AnyMesh, FileError, Kind as ElementKind, Mesh, Topology};
use crate::model::{
    self, Built, Elastic, Fault, Kind, Model, ModelError, StepData, without_boundaries,
};
use crate::problem::{ContactData, ContactProblem, ProblemError};
use std::path::PathBuf;
use std::time::Instant;

/// A case could not be turned into a contact problem.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// A line of the case file is at fault.
    #[error(transparent)]
    Case(#[from] CaseError),
    /// The mesh could not be read.
    #[error(transparent)]
    Mesh(#[from] FileError),
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
pub struct Build<const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The problem with the load of the first step.
    pub problem: ContactProblem<D>,
    /// None for an algebraic case.
    pub elastic: Option<Elastic<D>>,
    /// Seconds for the mesh, or the matrices, to be read or made.
    pub mesh_seconds: f64,
    /// Seconds for K, f and the contact rows.
    pub assembly_seconds: f64,
    /// The part of it for the search and the integrals of the contacts.
    pub pairing_seconds: f64,
}

/// That of a case of either dimension.
#[derive(Debug)]
pub enum AnyBuild {
    /// Of the plane.
    Plane(Build),
    /// Of space.
    Space(Build<3>),
}

impl<const D: usize> From<Built<D>> for Build<D>
where
    ElementKind: Topology<D>,
{
    fn from(built: Built<D>) -> Self {
        Self {
            problem: built.problem,
            elastic: Some(built.elastic),
            mesh_seconds: 0.0,
            assembly_seconds: built.assembly_seconds,
            pairing_seconds: built.pairing_seconds,
        }
    }
}

impl<const D: usize> Build<D>
where
    ElementKind: Topology<D>,
{
    /// Which body one of [`System::free_bodies`](crate::problem::System::free_bodies) is: its region and a point of it.
    pub fn free_body_name(&self, body: usize) -> String {
        model::body_name(&self.problem, self.elastic.as_ref(), body)
    }

    /// The bodies that only contact holds, and what they could do without, in words.
    pub fn free_bodies(&self) -> Vec<String> {
        model::free_bodies(&self.problem, self.elastic.as_ref())
    }
}

impl Case {
    /// Reads the mesh or the matrices of a case in the plane and assembles the contact problem; [`Case::build_any`]
    /// does so for solids, too.
    ///
    /// # Errors
    /// If the case is one in space, or as [`Case::build_any`].
    pub fn build(&self) -> Result<Build, BuildError> {
        match self.build_any()? {
            AnyBuild::Plane(build) => Ok(build),
            AnyBuild::Space(_) => {
                Err(self.unsupported("this case is one in space (Case::build_any)"))
            }
        }
    }

    /// Reads the mesh or the matrices, which choose between the plane and space, and assembles the contact problem.
    ///
    /// # Errors
    /// If a file cannot be read, or the case cannot be meant as it stands: the error names the line or the file.
    pub fn build_any(&self) -> Result<AnyBuild, BuildError> {
        let start = Instant::now();
        if let Some(table) = &self.tables.algebraic {
            return self.build_algebraic(table.get_ref());
        }
        Ok(match self.mesh()? {
            AnyMesh::Plane(mesh) => AnyBuild::Plane(self.build_on(mesh, start)?),
            AnyMesh::Space(mesh) => AnyBuild::Space(self.build_on(mesh, start)?),
        })
    }

    /// The contact problem on a mesh that has been made since `start`.
    fn build_on<const D: usize>(
        &self,
        mesh: Mesh<D>,
        start: Instant,
    ) -> Result<Build<D>, BuildError>
    where
        ElementKind: Space<D>,
    {
        let mesh_seconds = start.elapsed().as_secs_f64();
        let definition = self.definition()?;
        let built = Model { mesh, definition }.build();
        Ok(Build {
            mesh_seconds,
            ..built.map_err(|error| self.at_line(error))?.into()
        })
    }

    /// The load at the end of a step, counted from 0; None for an algebraic case, which has one.
    pub fn step<const D: usize>(
        &self,
        build: &Build<D>,
        step: usize,
    ) -> Result<Option<StepData<D>>, BuildError>
    where
        ElementKind: Space<D>,
    {
        let data = build.elastic.as_ref().map(|elastic| elastic.step(step));
        data.transpose().map_err(|error| self.at_line(error))
    }

    /// Something about the case as a whole.
    fn unsupported(&self, message: impl Into<String>) -> BuildError {
        BuildError::Unsupported {
            case: self.path.display().to_string(),
            message: message.into(),
        }
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
                dimension,
            } => self
                .part_without_boundaries(name, known, dimension)
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
    fn part_without_boundaries(
        &self,
        name: &str,
        known: &[String],
        dimension: usize,
    ) -> Option<String> {
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
        let group = &name[prefix.len()..];
        Some(format!(
            "there is no boundary \"{name}\"{}",
            without_boundaries(group, dimension)
        ))
    }

    /// The problem of matrices: T has a row per contact node in the plane, two in space.
    fn build_algebraic(&self, table: &AlgebraicTable) -> Result<AnyBuild, BuildError> {
        let start = Instant::now();
        let matrix = |path: &PathBuf| matrix_market::read(&self.beside(path));
        let stiffness = matrix(&table.stiffness)?;
        let mu = table.friction_coefficient.as_ref();
        let coefficient = match mu {
            Some(path) => matrix(path)?.into_vector()?,
            None => Vec::new(),
        };
        let load = matrix(&table.load)?.into_vector()?;
        let (normal, tangential) = (matrix(&table.normal)?, matrix(&table.tangential)?);
        let gap = matrix(&table.gap)?.into_vector()?;
        let slip_bound = match &table.slip_bound {
            Some(path) => matrix(path)?.into_vector()?,
            None => vec![0.0; coefficient.len()],
        };
        let coordinates = table.coordinates.as_ref().map(matrix).transpose()?;

        let (m, rows) = (normal.n_rows(), tangential.n_rows());
        let columns = coordinates.as_ref().map(Matrix::n_cols);
        let is_solid = if m > 0 {
            rows == 2 * m
        } else {
            columns == Some(3)
        };
        let of_matrices = OfMatrices {
            stiffness,
            load,
            normal,
            tangential,
            gap,
            slip_bound,
            coefficient,
            coordinates,
        };
        match (is_solid, columns) {
            (false, Some(3)) if rows == m => Err(self.unsupported(format!(
                "the coordinates have three columns, so this is a problem in space, but T has {rows} rows like N: there \
                 it has two for each contact node, {} in all",
                2 * m
            ))),
            (true, Some(2)) => Err(self.unsupported(format!(
                "T has two rows for each of the {m} contact nodes, so this is a problem in space, but the coordinates \
                 have two columns: there they have three"
            ))),
            (true, _) => Ok(AnyBuild::Space(self.build_of(of_matrices, start)?)),
            (false, _) => Ok(AnyBuild::Plane(self.build_of(of_matrices, start)?)),
        }
    }

    /// The contact problem of matrices that have been read since `start`.
    fn build_of<const D: usize>(
        &self,
        read: OfMatrices,
        start: Instant,
    ) -> Result<Build<D>, BuildError>
    where
        ElementKind: Topology<D>,
    {
        let failed = |source| BuildError::Problem {
            case: self.path.display().to_string(),
            source,
        };
        let (rows, cols) = (read.stiffness.n_rows(), read.stiffness.n_cols());
        let data = ContactData {
            stiffness: read.stiffness.into_stiffness()?,
            load: read.load,
            normal: read.normal.into_csr(),
            tangential: read.tangential.into_csr(),
            gap: read.gap,
            slip_bound: read.slip_bound,
            coordinates: read.coordinates.map(Matrix::into_points).transpose()?,
        };
        // Blocks round the sizes up to multiples of D and would hide these.
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
            .and_then(|problem| problem.with_friction_coefficient(read.coefficient))
            .map_err(failed)?;
        if let Some(text) = model::loose_body(&problem, None) {
            return Err(self.unsupported(format!("the stiffness matrix is singular: {text}")));
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

/// The matrices and vectors of an algebraic case, as their files have them.
struct OfMatrices {
    stiffness: Matrix,
    load: Vec<f64>,
    normal: Matrix,
    tangential: Matrix,
    gap: Vec<f64>,
    slip_bound: Vec<f64>,
    coefficient: Vec<f64>,
    /// A row per node.
    coordinates: Option<Matrix>,
}
