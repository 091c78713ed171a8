//! From a case to a contact problem.

use super::{AlgebraicTable, Case, CaseError};
use crate::contact::Space;
use crate::matrix_market::{self, Matrix, MatrixMarketError};
use crate::mesh::{AnyMesh, ElementKind, FileError, Mesh, Topology};
#[cfg(feature = "mpi")]
use crate::model::Draft;
use crate::model::{
    Analysis, AnyAnalysis, AnyBuilt, Built, EntityKind, Fault, Model, ModelError,
    without_boundaries,
};
use crate::problem::{AnyProblem, ContactData, ContactProblem, ProblemError, dimension};
use std::path::PathBuf;

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
        /// The reason.
        source: ProblemError,
    },
    /// Something else about the case as a whole.
    #[error("{case}: {message}")]
    Unsupported {
        /// The case file.
        case: String,
        /// The fault.
        message: String,
    },
}

/// The contact problem of a case, in either dimension.
#[derive(Debug)]
pub enum CaseProblem {
    /// The problem of the bodies of an elastic case.
    Elastic(Box<AnyBuilt>),
    /// The problem of the matrices of an algebraic case.
    Algebraic(AnyProblem),
}

/// The model or matrices of a case before K is made, in either dimension.
#[cfg(feature = "mpi")]
#[derive(Debug)]
pub enum CaseDraft {
    /// An elastic case of the plane.
    Plane(Draft),
    /// An elastic case of space.
    Space(Draft<3>),
    /// The matrices of an algebraic case.
    Algebraic(Box<AnyProblem>),
}

impl CaseProblem {
    /// The model, of an elastic case in the plane.
    pub fn plane(self) -> Option<Built> {
        match self {
            Self::Elastic(built) => match *built {
                AnyBuilt::Plane(built) => Some(built),
                AnyBuilt::Space(_) => None,
            },
            Self::Algebraic(_) => None,
        }
    }

    /// The model, of an elastic case in space.
    pub fn space(self) -> Option<Built<3>> {
        match self {
            Self::Elastic(built) => match *built {
                AnyBuilt::Space(built) => Some(built),
                AnyBuilt::Plane(_) => None,
            },
            Self::Algebraic(_) => None,
        }
    }

    /// The problem to solve.
    pub fn analysis(&self) -> AnyAnalysis<'_> {
        match self {
            Self::Elastic(built) => built.as_ref().into(),
            Self::Algebraic(problem) => problem.into(),
        }
    }
}

impl Case {
    /// Reads the mesh or the matrices, which choose between the plane and space, and assembles the contact problem.
    ///
    /// # Errors
    /// If a file cannot be read, or the case is inconsistent: the error names the line or the file.
    pub fn build(&self) -> Result<CaseProblem, BuildError> {
        if let Some(table) = &self.tables.algebraic {
            return Ok(CaseProblem::Algebraic(self.build_algebraic(table)?));
        }
        self.build_on_mesh(self.mesh()?)
    }

    /// Makes the mesh of `[mesh]`.
    ///
    /// # Errors
    /// If there is none, a file cannot be read, or it gives no mesh.
    pub fn read_mesh(&self) -> Result<AnyMesh, BuildError> {
        self.mesh()
    }

    /// Assembles the contact problem of this case on a given mesh, which replaces `[mesh]`.
    ///
    /// # Errors
    /// As [`Case::build`].
    pub fn build_on_mesh(&self, mesh: AnyMesh) -> Result<CaseProblem, BuildError> {
        Ok(CaseProblem::Elastic(Box::new(match mesh {
            AnyMesh::Plane(mesh) => AnyBuilt::Plane(self.build_on(mesh)?),
            AnyMesh::Space(mesh) => AnyBuilt::Space(self.build_on(mesh)?),
        })))
    }

    /// Reads the mesh or the matrices, and makes all of the contact problem except K, for several ranks.
    ///
    /// # Errors
    /// As [`Case::build`].
    #[cfg(feature = "mpi")]
    pub fn draft(&self) -> Result<CaseDraft, BuildError> {
        if let Some(table) = &self.tables.algebraic {
            let problem = self.build_algebraic(table)?;
            return Ok(CaseDraft::Algebraic(Box::new(problem)));
        }
        Ok(match self.mesh()? {
            AnyMesh::Plane(mesh) => CaseDraft::Plane(self.draft_on(mesh)?),
            AnyMesh::Space(mesh) => CaseDraft::Space(self.draft_on(mesh)?),
        })
    }

    #[cfg(feature = "mpi")]
    fn draft_on<const D: usize>(&self, mesh: Mesh<D>) -> Result<Draft<D>, BuildError>
    where
        ElementKind: Space<D>,
    {
        let definition = self.definition()?;
        let drafted = Model { mesh, definition }.into_draft();
        drafted.map_err(|error| self.at_line(error))
    }

    /// The model on its mesh.
    fn build_on<const D: usize>(&self, mesh: Mesh<D>) -> Result<Built<D>, BuildError>
    where
        ElementKind: Space<D>,
    {
        let definition = self.definition()?;
        let built = Model { mesh, definition }.build();
        built.map_err(|error| self.at_line(error))
    }

    /// Something about the case as a whole.
    fn unsupported(&self, message: impl Into<String>) -> BuildError {
        BuildError::Unsupported {
            case: self.path.display().to_string(),
            message: message.into(),
        }
    }

    /// An error of the model that this case built, reported at the line of its part.
    pub fn at_line(&self, error: ModelError) -> BuildError {
        let ModelError { entity, fault } = error;
        let fault = *fault;
        let message = match fault {
            Fault::Problem(source) => {
                return BuildError::Problem {
                    case: self.path.display().to_string(),
                    source,
                };
            }
            // A mesh stated by a program has no physical groups.
            Fault::NoBoundary {
                ref name,
                ref known,
                ..
            } if self.stated && known.is_empty() => format!(
                "there is no boundary \"{name}\": the mesh has none; name boundaries where the mesh is made"
            ),
            Fault::NoNodeSet {
                ref name,
                ref known,
                is_boundary: false,
            } if self.stated && known.is_empty() => format!(
                "there is no set of nodes \"{name}\": the mesh has none; name sets of nodes where the mesh is made"
            ),
            Fault::NoBoundary {
                ref name,
                ref known,
                dimension,
            } => self
                .part_without_boundaries(name, known, dimension)
                .unwrap_or_else(|| fault.to_string()),
            Fault::NoRegion { .. } | Fault::Boundary(_) => fault.to_string(),
            _ if entity.kind == EntityKind::Contact && entity.number.is_some() => {
                format!("contact {}: {fault}", entity.place)
            }
            _ if entity.kind == EntityKind::Tie && entity.number.is_some() => {
                format!("tie {}: {fault}", entity.place)
            }
            _ if entity.kind == EntityKind::Equal && entity.number.is_some() => {
                format!("equal {}: {fault}", entity.place)
            }
            // The line identifies the part; a name from the user does so too.
            _ if entity.place.starts_with('"') => format!("{entity}: {fault}"),
            _ => fault.to_string(),
        };
        self.at(&entity.path(), message).into()
    }

    /// The error about a missing boundary whose part of the mesh has none, while other parts have some.
    fn part_without_boundaries(
        &self,
        name: &str,
        known: &[String],
        dimension: usize,
    ) -> Option<String> {
        let parts = self.tables.mesh.iter().flat_map(|mesh| &mesh.part);
        let mut prefixes = parts.map(|part| format!("{}-", part.name));
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
    fn build_algebraic(&self, table: &AlgebraicTable) -> Result<AnyProblem, BuildError> {
        let matrix = |path: &PathBuf| matrix_market::read(&self.beside(path));
        let stiffness = matrix(&table.stiffness)?;
        let mu = table.friction_coefficient.as_ref();
        let coefficient = match mu {
            Some(path) => matrix(path)?.into_vector()?,
            None => Vec::new(),
        };
        let compliance = match &table.compliance {
            Some(path) => matrix(path)?.into_vector()?,
            None => Vec::new(),
        };
        let tied = match &table.tied {
            Some(path) => matrix(path)?.into_vector()?,
            None => Vec::new(),
        };
        if let Some(i) = tied.iter().position(|&v| v != 0.0 && v != 1.0) {
            let message = format!("entry {} of tied is {}: it must be 0 or 1", i + 1, tied[i]);
            return Err(self.unsupported(message));
        }
        let tied = tied.iter().map(|&v| v == 1.0).collect();
        let load = matrix(&table.load)?.into_vector()?;
        let (normal, tangential) = (matrix(&table.normal)?, matrix(&table.tangential)?);
        let gap = matrix(&table.gap)?.into_vector()?;
        let slip_bound = match &table.slip_bound {
            Some(path) => matrix(path)?.into_vector()?,
            None => vec![0.0; coefficient.len()],
        };
        let slip_origin = table.slip_origin.as_ref().map(matrix);
        let slip_origin = slip_origin
            .transpose()?
            .map(Matrix::into_vector)
            .transpose()?;
        let coordinates = table.coordinates.as_ref().map(matrix).transpose()?;

        let columns = coordinates.as_ref().map(Matrix::n_cols);
        let dimension = dimension(normal.n_rows(), tangential.n_rows(), columns)
            .map_err(|message| self.unsupported(message))?;
        let of_matrices = OfMatrices {
            stiffness,
            load,
            normal,
            tangential,
            gap,
            interference: table.interference,
            dependent_rows: table.dependent_rows,
            slip_bound,
            slip_origin,
            coefficient,
            compliance,
            tied,
            coordinates,
        };
        Ok(match dimension {
            2 => AnyProblem::Plane(self.build_of(of_matrices)?),
            _ => AnyProblem::Space(self.build_of(of_matrices)?),
        })
    }

    /// The contact problem of matrices that have been read.
    fn build_of<const D: usize>(&self, read: OfMatrices) -> Result<ContactProblem<D>, BuildError>
    where
        ElementKind: Topology<D>,
    {
        let failed = |source| BuildError::Problem {
            case: self.path.display().to_string(),
            source,
        };
        let (rows, cols) = (read.stiffness.n_rows(), read.stiffness.n_cols());
        let open = |d: &f64| if read.interference { d.max(0.0) } else { *d };
        let data = ContactData {
            stiffness: read.stiffness.into_stiffness()?,
            load: read.load,
            normal: read.normal.into_csr(),
            tangential: read.tangential.into_csr(),
            gap: read.gap.iter().map(open).collect(),
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
        let checked = match read.dependent_rows {
            true => ContactProblem::of_bodies(data, read.compliance, &read.tied),
            false => (ContactProblem::compliant(data, read.compliance))
                .and_then(|problem| problem.with_ties(&read.tied)),
        };
        let mut problem = checked
            .and_then(|problem| problem.with_friction_coefficient(read.coefficient))
            .and_then(ContactProblem::with_one_law)
            .and_then(|problem| problem.with_gap(read.gap))
            .map_err(failed)?;
        if let Some(origin) = read.slip_origin {
            problem = problem.with_slip_origin(origin).map_err(failed)?;
        }
        if let Some(text) = Analysis::from(&problem).loose_body() {
            return Err(self.unsupported(format!("the stiffness matrix is singular: {text}")));
        }
        Ok(problem)
    }
}

/// The matrices and vectors of an algebraic case, as their files have them.
struct OfMatrices {
    stiffness: Matrix,
    load: Vec<f64>,
    normal: Matrix,
    tangential: Matrix,
    gap: Vec<f64>,
    interference: bool,
    dependent_rows: bool,
    slip_bound: Vec<f64>,
    slip_origin: Option<Vec<f64>>,
    coefficient: Vec<f64>,
    compliance: Vec<f64>,
    tied: Vec<bool>,
    /// A row per node.
    coordinates: Option<Matrix>,
}
