//! Case files: TOML, checked, with errors that name the line at fault.
//!
//! A case is either *elastic* (`[mesh]`, `[[material]]`, `[[support]]`, `[[traction]]`, `[[contact]]` …): its tables
//! are the parts of a [`crate::model::Model`]. Or it is *algebraic* (`[algebraic]`: matrices in Matrix Market files).
//! Which dimension it is about follows from the mesh, or from the shape of the matrices. `docs/case-file.md` is the
//! reference.

mod build;
mod definition;
mod mesh;
mod quantity;
mod solver;
mod tables;
mod text;

#[cfg(feature = "mpi")]
pub use build::CaseDraft;
pub use build::{BuildError, CaseProblem};
pub use quantity::NumberOrExpression;
pub use solver::SolverTable;
pub use tables::{
    AlgebraicTable, AnalysisTable, AxisTable, BodyForceTable, BoxTable, ContactTable, ForceTable,
    FrictionTable, MaterialTable, MeshTable, ObstacleTable, PartTable, RectangleTable, RotateTable,
    RotationTable, StepsTable, SupportTable, Tables, TemperatureTable, TractionTable,
};

use crate::deck::{self, Deck};
use crate::input;
use crate::mesh::AnyMesh;
use crate::model::{Definition, Units};
use std::io::{Error, ErrorKind};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::Duration;
use toml::Spanned;

/// The most bytes of a case file. Its numbers are typed or made by a script, a few kilobytes; and its tables take many
/// times as much memory as its text, so that this is no question of what a machine can hold.
const LARGEST: usize = 64 << 20;

/// A case file could not be understood.
#[derive(Debug, thiserror::Error)]
pub enum CaseError {
    /// It could not be read.
    #[error("cannot read {}: {source}", path.display())]
    Io {
        /// The case file.
        path: PathBuf,
        /// Why not.
        source: std::io::Error,
    },
    /// It is no TOML, or has keys and values that no case file has.
    #[error("{}: {message}", path.display())]
    Syntax {
        /// The case file.
        path: PathBuf,
        /// What is wrong, with the line and its text.
        message: String,
    },
    /// Its content makes no sense.
    #[error("{}, line {line}: {message}", path.display())]
    Invalid {
        /// The case file.
        path: PathBuf,
        /// The line of the table or key, from 1.
        line: usize,
        /// What is wrong with it.
        message: String,
    },
    /// A table that a program states, without any file, makes no sense.
    #[error("{place}: {message}")]
    Stated {
        /// The table and its key, such as `support 2, x`.
        place: String,
        /// What is wrong with it.
        message: String,
    },
    /// An entry could not be replaced.
    #[error("setting \"{setting}\": {message}")]
    Setting {
        /// The `key.path=value` at fault.
        setting: String,
        /// What is wrong with it.
        message: String,
    },
}

/// A case file, read and checked as far as it goes without its mesh or matrices.
#[derive(Debug)]
pub struct Case {
    /// Where it was read from.
    pub path: PathBuf,
    /// Its tables.
    pub tables: Tables,
    time_limit: Option<Duration>,
    text: String,
    /// The mesh, where it is at hand and no file has to be read.
    given: Option<AnyMesh>,
    /// There is no file: errors name tables and keys in place of lines.
    stated: bool,
}

impl Case {
    /// Reads a case file; each of `settings` is `key.path=value` and replaces or adds an entry.
    pub fn read(path: &Path, settings: &[String]) -> Result<Self, CaseError> {
        let text = input::whole(path, LARGEST).and_then(|bytes| {
            let not_text = |_| Error::new(ErrorKind::InvalidData, "it is not text (UTF-8)");
            String::from_utf8(bytes).map_err(not_text)
        });
        let text = text.map_err(|source| CaseError::Io {
            path: path.to_owned(),
            source,
        })?;
        Self::parse(path, text, settings)
    }

    /// The case that a deck says; settings are those of [`Case::read`], and refer to [`Deck::case`]. Errors name the lines of
    /// the deck.
    pub fn of_deck(deck: Deck, settings: &[String]) -> Result<Self, CaseError> {
        for setting in settings {
            let path = setting.split('=').next().unwrap_or_default().trim();
            if let Some(key) = path.strip_prefix("mesh.")
                && !["order", "scale"].contains(&key)
            {
                let message =
                    "a deck has its own mesh, of which only mesh.order and mesh.scale can be set"
                        .to_owned();
                let setting = setting.clone();
                return Err(CaseError::Setting { setting, message });
            }
        }
        Self::made(&deck.path, deck.case, settings, Some(deck.mesh))
    }

    /// Like [`Case::read`], from a text that is already at hand.
    pub fn parse(path: &Path, text: String, settings: &[String]) -> Result<Self, CaseError> {
        Self::made(path, text, settings, None)
    }

    fn made(
        path: &Path,
        mut text: String,
        settings: &[String],
        given: Option<AnyMesh>,
    ) -> Result<Self, CaseError> {
        let syntax = |message: String| CaseError::Syntax {
            path: path.to_owned(),
            message,
        };
        if !settings.is_empty() {
            let mut document: toml_edit::DocumentMut = text
                .parse()
                .map_err(|e: toml_edit::TomlError| syntax(e.to_string()))?;
            for setting in settings {
                text::set(&mut document, setting).map_err(|message| CaseError::Setting {
                    setting: setting.clone(),
                    message,
                })?;
            }
            text = document.to_string();
        }
        let tables: Tables =
            toml::from_str(&text).map_err(|e| syntax(text::suggested(e.to_string().trim_end())))?;
        let mut case = Self {
            path: path.to_owned(),
            tables,
            time_limit: None,
            text,
            given,
            stated: false,
        };
        case.check_kind()?;
        let dimension = case.check_mesh()?;
        case.check_algebraic()?;
        if case.tables.mesh.is_some() {
            case.check_model(dimension)?;
        }
        case.time_limit = case.check_solver()?;
        Ok(case)
    }

    /// Tables that a program states, as text of a case file but without any: a mesh ([`Case::read_mesh`]), or what is said of
    /// one that is at hand ([`Case::build_on_mesh`]), for which nothing needs to be complete yet. Files are looked for where
    /// the process runs.
    ///
    /// # Errors
    /// If the tables are none of a case file, or make no sense by themselves: the error names the table and the key.
    ///
    /// ```
    /// use signorini::case::Case;
    /// use signorini::mesh::AnyMesh;
    ///
    /// let mesh = Case::stated("[mesh.rectangle]\nsize = [3, 1]\ncells = [12, 4]".to_owned())?.read_mesh()?;
    /// let error = Case::stated("[[support]]\nboundary = \"left\"\nz = \"2 *\"".to_owned())?.check_parts(2).unwrap_err();
    /// assert!(error.to_string().starts_with("support, z: "), "{error}");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn stated(text: String) -> Result<Self, CaseError> {
        let tables: Tables = toml::from_str(&text).map_err(|error| {
            let place = text::place(&text, error.span().map_or(0, |span| span.start));
            // The place is a part of what suggestions follow from.
            let message = text::suggested(&format!("{place}: {}", error.message()));
            let message = message[place.len() + 2..].to_owned();
            CaseError::Stated { place, message }
        })?;
        let mut case = Self {
            path: PathBuf::from("model"),
            tables,
            time_limit: None,
            text,
            given: None,
            stated: true,
        };
        case.check_mesh()?;
        case.time_limit = case.check_solver()?;
        Ok(case)
    }

    /// Whether the tables that are there can be meant in so many dimensions, whatever is still missing.
    ///
    /// # Errors
    /// The first thing that cannot.
    pub fn check_parts(&self, dimension: usize) -> Result<(), CaseError> {
        fn check<const D: usize>(case: &Case) -> Result<(), CaseError> {
            let stated = case.tables.definition::<D>();
            let definition = stated.or_else(|(span, message)| case.invalid(span, message))?;
            let checked = definition.check_parts();
            checked.or_else(|e| case.invalid(case.tables.span(&e.entity), e.fault.to_string()))
        }
        match dimension {
            2 => check::<2>(self),
            _ => check::<3>(self),
        }
    }

    /// An error at the place of a span.
    fn at(&self, span: Range<usize>, message: impl Into<String>) -> CaseError {
        if self.given.is_some()
            && let Some((path, line)) = deck::origin(&self.text, span.start)
        {
            return CaseError::Invalid {
                path,
                line,
                message: message.into(),
            };
        }
        if self.stated {
            return CaseError::Stated {
                place: text::place(&self.text, span.start),
                message: message.into(),
            };
        }
        let before = &self.text.as_bytes()[..span.start.min(self.text.len())];
        CaseError::Invalid {
            path: self.path.clone(),
            line: 1 + before.iter().filter(|&&b| b == b'\n').count(),
            message: message.into(),
        }
    }

    /// The same as a result.
    fn invalid<T>(&self, span: Range<usize>, message: impl Into<String>) -> Result<T, CaseError> {
        Err(self.at(span, message))
    }

    /// The files that it is read from: itself, and those of its meshes or matrices. (Not those that an Abaqus input file
    /// names in its turn.)
    pub fn inputs(&self) -> Vec<PathBuf> {
        let tables = &self.tables;
        let mesh = tables.mesh.iter().map(Spanned::get_ref);
        let files = mesh.flat_map(|mesh| {
            let parts = mesh.part.iter().map(|part| &part.get_ref().file);
            parts.chain([&mesh.file]).flatten()
        });
        let matrices = (tables.algebraic.iter()).flat_map(|table| table.get_ref().files());
        let mut all = vec![self.path.clone()];
        all.extend(files.chain(matrices).map(|file| self.beside(file)));
        all
    }

    /// A path of the case file, relative to it.
    fn beside(&self, path: &Path) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(path)
    }

    /// The case is either elastic or algebraic, and an algebraic one has no tables of the other kind.
    fn check_kind(&self) -> Result<(), CaseError> {
        let t = &self.tables;
        match (&t.mesh, &t.algebraic) {
            (Some(_), None) => return Ok(()),
            (None, None) => {
                return self.invalid(
                    0..0,
                    "the case has neither [mesh] nor [algebraic]: say what to solve",
                );
            }
            (Some(_), Some(both)) => {
                return self.invalid(
                    both.span(),
                    "the case has both [mesh] and [algebraic]: keep one",
                );
            }
            (None, Some(_)) => {}
        }
        // Whatever else there is says something of bodies.
        const BESIDES: [&str; 4] = ["title", "units", "algebraic", "solver"];
        let document = toml_edit::Document::parse(&self.text).expect("it was read from this text");
        let mut names = document.iter().map(|(name, _)| name);
        match names.find(|name| !BESIDES.contains(name)) {
            None => Ok(()),
            Some(name) => self.invalid(
                (document.key(name))
                    .and_then(toml_edit::Key::span)
                    .unwrap_or(0..0),
                format!("[{name}] has no meaning in an [algebraic] case: its matrices say it all"),
            ),
        }
    }

    /// An algebraic case states a law of friction, and what its units are called if anything.
    fn check_algebraic(&self) -> Result<(), CaseError> {
        let Some(table) = &self.tables.algebraic else {
            return Ok(());
        };
        let given = table.get_ref();
        if given.slip_bound.is_none() && given.friction_coefficient.is_none() {
            return self.invalid(
                table.span(),
                "[algebraic] needs slip_bound (Tresca) or friction_coefficient (Coulomb), or both",
            );
        }
        let units = self.tables.units.as_ref();
        match units.and_then(|units| Some((units.span(), units.get_ref().fault()?))) {
            Some((span, fault)) => self.invalid(span, fault),
            None => Ok(()),
        }
    }

    /// The model can be meant, as far as that shows without its mesh, whose dimension may be known.
    fn check_model(&self, dimension: Option<usize>) -> Result<(), CaseError> {
        match dimension {
            Some(2) => self.definition::<2>().map(drop),
            Some(_) => self.definition::<3>().map(drop),
            None => {
                let (Err(plane), Err(space)) = (self.definition::<2>(), self.definition::<3>())
                else {
                    return Ok(());
                };
                // It is an error in any case, and a file says which.
                let is_solid = matches!(self.mesh(), Ok(AnyMesh::Space(_)));
                Err(if is_solid { space } else { plane })
            }
        }
    }

    /// What it says of a model on a mesh of D dimensions, checked as far as that goes without the mesh.
    fn definition<const D: usize>(&self) -> Result<Definition<D>, CaseError> {
        let stated = self.tables.definition();
        let definition: Definition<D> =
            stated.or_else(|(span, message)| self.invalid(span, message))?;
        match definition.check() {
            Ok(()) => Ok(definition),
            Err(error) => self.invalid(self.tables.span(&error.entity), error.fault.to_string()),
        }
    }

    /// Tables of these names as they stand in the file, those that it has.
    pub(crate) fn kept_tables<'a>(
        &self,
        names: impl IntoIterator<Item = &'a str>,
    ) -> Vec<(&'a str, toml_edit::Item)> {
        let document: toml_edit::DocumentMut =
            self.text.parse().expect("it was read from this text");
        let kept = |name| Some((name, document.get(name)?.clone()));
        names.into_iter().filter_map(kept).collect()
    }

    /// The text that it was read from, with the entries that settings have replaced: what [`Case::parse`] makes the same case of.
    #[cfg(feature = "mpi")]
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What its units are called.
    pub fn units(&self) -> Units {
        self.tables.units().unwrap_or_default()
    }

    /// Number of load steps.
    pub fn n_steps(&self) -> usize {
        self.tables.factors().map_or(1, <[f64]>::len)
    }
}
