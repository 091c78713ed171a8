//! Case files: TOML, checked, with errors that name the line at fault.
//!
//! A case is either *elastic* (`[mesh]`, `[[material]]`, `[[support]]`, `[[traction]]`, `[[contact]]` …): its tables
//! are the parts of a [`crate::model::Model`]. Or it is *algebraic* (`[algebraic]`: matrices in Matrix Market files).
//! Which dimension it is about follows from the mesh, or from the shape of the matrices. `docs/case-file.md` is the
//! reference.

mod build;
mod mesh;
mod solver;
mod tables;
#[cfg(test)]
mod tests;
mod text;

#[cfg(feature = "mpi")]
pub use build::CaseDraft;
pub use build::{BuildError, CaseProblem};
pub use solver::SolverTable;
pub use tables::{
    AlgebraicTable, BoxTable, MeshTable, PartTable, RectangleTable, RotateTable, Tables,
};

use crate::deck::{AnyDefinition, Deck, Origin};
use crate::input;
use crate::mesh::AnyMesh;
use crate::model::{Definition, MEANING, Steps, Units};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};
use std::time::Duration;

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
    /// What is said of it, where that is at hand and does not have to be read from the text.
    definition: Option<AnyDefinition>,
    /// Of a deck, with that of its mesh first.
    origins: Vec<Origin>,
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

    /// The case that a deck says; settings are those of [`Case::read`], and refer to [`Case::text`]. Errors name the lines of
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
        let text = text::of_deck(&deck);
        Self::made(&deck.path.clone(), text, settings, Some(deck))
    }

    /// Of a text, of which nothing has been read yet.
    fn of_text(path: &Path, text: String) -> Self {
        Self {
            path: path.to_owned(),
            tables: Tables::default(),
            time_limit: None,
            text,
            given: None,
            definition: None,
            origins: Vec::new(),
            stated: false,
        }
    }

    /// Like [`Case::read`], from a text that is already at hand.
    pub fn parse(path: &Path, text: String, settings: &[String]) -> Result<Self, CaseError> {
        Self::made(path, text, settings, None)
    }

    fn made(
        path: &Path,
        mut text: String,
        settings: &[String],
        deck: Option<Deck>,
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
        let mut case = Self::of_text(path, text);
        if let Some(deck) = deck {
            case.given = Some(deck.mesh);
            case.origins = deck.origins;
            case.definition = settings.is_empty().then_some(deck.definition);
        }
        case.heard(text::check_keys(&case.text))?;
        case.tables = case.said()?;
        case.check_kind()?;
        let of_given = case.given.as_ref().map(|mesh| match mesh {
            AnyMesh::Plane(_) => 2,
            AnyMesh::Space(_) => 3,
        });
        let dimension = of_given.or(case.check_mesh()?);
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
        let mut case = Self {
            stated: true,
            ..Self::of_text(Path::new("model"), text)
        };
        case.heard(text::check_keys(&case.text))?;
        case.tables = case.said()?;
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
            let checked = case.said::<Definition<D>>()?.check_parts();
            checked.or_else(|error| case.invalid(&error.entity.path(), error.fault.to_string()))
        }
        match dimension {
            2 => check::<2>(self),
            _ => check::<3>(self),
        }
    }

    /// Those of its tables that a type has keys for, as this type.
    fn said<T: DeserializeOwned>(&self) -> Result<T, CaseError> {
        self.heard(text::read(&self.text))
    }

    /// What the parser has found, or its error as one of the case.
    fn heard<T>(&self, read: Result<T, toml::de::Error>) -> Result<T, CaseError> {
        read.map_err(|error| {
            let path = text::path(&self.text, error.span().map_or(0, |span| span.start));
            if let Some(message) = error.message().strip_prefix(MEANING) {
                return self.at(&path, message);
            }
            match self.stated {
                true => self.at(&path, text::suggested(error.message(), &path)),
                false => CaseError::Syntax {
                    path: self.path.clone(),
                    message: text::suggested(error.to_string().trim_end(), &path),
                },
            }
        })
    }

    /// An error about an entry.
    fn at(&self, path: &str, message: impl Into<String>) -> CaseError {
        let message = message.into();
        if self.stated {
            let place = text::words(&self.text, path);
            return CaseError::Stated { place, message };
        }
        if let Some((path, line)) = self.origin(path) {
            return CaseError::Invalid {
                path,
                line,
                message,
            };
        }
        let start = text::span(&self.text, path).start;
        let before = &self.text.as_bytes()[..start.min(self.text.len())];
        CaseError::Invalid {
            path: self.path.clone(),
            line: 1 + before.iter().filter(|&&b| b == b'\n').count(),
            message,
        }
    }

    /// The file and line of the deck that an entry comes from, of a table that it has: else those of its mesh.
    fn origin(&self, path: &str) -> Option<(PathBuf, usize)> {
        let table = path.split('.').next().unwrap_or_default();
        let last = table.strip_suffix(']').filter(|list| list.ends_with('['));
        let is_it = |one: &&Origin| match last {
            Some(list) => one.table.starts_with(list),
            None => one.table == table,
        };
        let found = self.origins.iter().rfind(is_it);
        let origin = found.or(self.origins.first())?;
        Some((origin.file.clone(), origin.line))
    }

    /// The same as a result.
    fn invalid<T>(&self, path: &str, message: impl Into<String>) -> Result<T, CaseError> {
        Err(self.at(path, message))
    }

    /// The files that it is read from: itself, and those of its meshes or matrices. (Not those that an Abaqus input file
    /// names in its turn.)
    pub fn inputs(&self) -> Vec<PathBuf> {
        let tables = &self.tables;
        let files = tables.mesh.iter().flat_map(|mesh| {
            let parts = mesh.part.iter().map(|part| &part.file);
            parts.chain([&mesh.file]).flatten()
        });
        let matrices = (tables.algebraic.iter()).flat_map(AlgebraicTable::files);
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
                    "",
                    "the case has neither [mesh] nor [algebraic]: say what to solve",
                );
            }
            (Some(_), Some(_)) => {
                return self.invalid(
                    "algebraic",
                    "the case has both [mesh] and [algebraic]: keep one",
                );
            }
            (None, Some(_)) => {}
        }
        match text::OF_BODIES
            .iter()
            .find(|name| text::has(&self.text, name))
        {
            None => Ok(()),
            Some(name) => self.invalid(
                name,
                format!("[{name}] has no meaning in an [algebraic] case: its matrices say it all"),
            ),
        }
    }

    /// An algebraic case states a law of friction, and what its units are called if anything.
    fn check_algebraic(&self) -> Result<(), CaseError> {
        let Some(table) = &self.tables.algebraic else {
            return Ok(());
        };
        if table.slip_bound.is_none() && table.friction_coefficient.is_none() {
            return self.invalid(
                "algebraic",
                "[algebraic] needs slip_bound (Tresca) or friction_coefficient (Coulomb), or both",
            );
        }
        match self.tables.units.as_ref().and_then(Units::fault) {
            Some(fault) => self.invalid("units", fault),
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
        let given = self.definition.as_ref().and_then(AnyDefinition::of);
        let definition: Definition<D> = given.cloned().map_or_else(|| self.said(), Ok)?;
        match definition.check() {
            Ok(()) => Ok(definition),
            Err(error) => self.invalid(&error.entity.path(), error.fault.to_string()),
        }
    }

    /// What a description says of the parts of its model, each behind a word for what it is.
    pub(crate) fn told<const D: usize>(&self) -> Result<Vec<(&'static str, String)>, CaseError> {
        let (definition, units) = (self.definition::<D>()?, self.units());
        let parts = definition.parts();
        let mut told: Vec<_> = parts.filter_map(|(_, part)| part.told(&units)).collect();
        // What pulls comes before what holds.
        told.sort_by_key(|(what, _)| matches!(*what, "support" | "foundation"));
        if let Some(Steps { factors }) = &definition.steps {
            told.push(("steps", format!("factors {factors:?}")));
        }
        Ok(told)
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

    /// The text that it was read from, with the entries that settings have replaced: what [`Case::parse`] makes the same case of. Of a
    /// deck it is the case file that says the same, where a comment above each table names the line that it comes from.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What its units are called.
    pub fn units(&self) -> Units {
        self.tables.units.clone().unwrap_or_default()
    }

    /// Number of load steps.
    pub fn n_steps(&self) -> usize {
        /// What no dimension is needed for.
        #[derive(Deserialize)]
        struct Stepped {
            steps: Option<Steps>,
        }
        let read: Result<Stepped, _> = text::read(&self.text);
        let steps = read.ok().and_then(|read| read.steps);
        steps.map_or(1, |steps| steps.factors.len())
    }
}
