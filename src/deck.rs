//! Whole decks: input files of Abaqus and CalculiX, as cases.
//!
//! A deck of static steps in its linear-elastic, small-strain subset becomes a mesh and the definition of a model on it: [`read`].
//! Entries that change the result and that a case cannot express are refused, all in one message; other entries are skipped.
//! `docs/decks.md` lists the supported keywords.

mod adjust;
mod cards;
mod history;
mod said;
mod translate;

use crate::mesh::abaqus::index;
use crate::mesh::{AnyMesh, FileError};
use crate::model::Definition;
use said::{Refusal, Said};
use std::any::Any;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A deck as a case.
#[derive(Clone, Debug)]
pub struct Deck {
    /// Its file.
    pub path: PathBuf,
    /// The deck's own title; empty without one.
    pub title: String,
    /// The mesh, with the boundaries, sets of nodes and regions that the definition names.
    pub mesh: AnyMesh,
    /// The name of the mesh file in the case file.
    pub mesh_file: String,
    /// The model on the mesh.
    pub(crate) definition: AnyDefinition,
    /// The lines of the deck from which the tables of the case file come.
    pub origins: Vec<Origin>,
    /// The numbers of the nodes of the mesh in the deck, in their order (of instances, each in its part). Nodes that are made
    /// here, in the middle of faces, follow them.
    pub node_numbers: Vec<u64>,
    /// Entries of the deck that have no effect here, a line each.
    pub notes: Vec<String>,
}

/// The model on a mesh of either dimension.
#[derive(Clone, Debug)]
pub(crate) enum AnyDefinition {
    Plane(Definition),
    Space(Definition<3>),
}

impl AnyDefinition {
    /// The definition, of a mesh that has so many dimensions.
    pub(crate) fn of<const D: usize>(&self) -> Option<&Definition<D>> {
        let stated: &dyn Any = match self {
            Self::Plane(definition) => definition,
            Self::Space(definition) => definition,
        };
        stated.downcast_ref()
    }
}

/// The origin of a table of a case in a deck.
#[derive(Clone, Debug)]
pub struct Origin {
    /// The path of the table, such as `support[0]`.
    pub table: String,
    /// The deck, or a file that it includes.
    pub file: PathBuf,
    /// The line, from 1.
    pub line: usize,
}

/// The reasons why a deck is not a case.
#[derive(Debug, thiserror::Error)]
pub enum DeckError {
    /// A file could not be read, or a line is invalid.
    #[error(transparent)]
    File(#[from] FileError),
    /// It has entries that change the result and that a case cannot express.
    #[error("{}", listed(path, refusals))]
    Refused {
        /// The deck.
        path: PathBuf,
        /// For each: place (file and line), the keyword that `--ignore` takes (empty if ignoring it leaves no valid case), and the
        /// reason.
        refusals: Vec<(String, String, String)>,
    },
}

fn listed(path: &Path, refusals: &[(String, String, String)]) -> String {
    let keys: BTreeSet<&str> = refusals.iter().map(|one| one.1.as_str()).collect();
    // What cannot be ignored would be refused again.
    let way_out = match keys.contains("") {
        true => String::new(),
        false => {
            let keys: Vec<&str> = keys.into_iter().collect();
            format!("; to go on without it: --ignore '{}'", keys.join(","))
        }
    };
    // A remark on several lines appears once.
    let mut places: Vec<(&str, Vec<&str>)> = Vec::new();
    for (place, _, text) in refusals {
        match places.iter_mut().find(|one| one.0 == text) {
            Some(one) => one.1.push(place),
            None => places.push((text, vec![place])),
        }
    }
    let lines = places.into_iter().map(|(text, places)| match places.len() {
        0..=4 => format!("\n  {}: {text}", places.join(", ")),
        n => format!("\n  {} and {} more: {text}", places[..3].join(", "), n - 3),
    });
    format!(
        "{}: this deck has entries that change the result and are not supported{way_out}{}",
        path.display(),
        lines.collect::<String>()
    )
}

/// Whether a file has the ending of a deck (`.inp`).
pub fn is_deck(path: &Path) -> bool {
    (path.extension()).is_some_and(|extension| extension.eq_ignore_ascii_case("inp"))
}

/// Whether a deck has a step; without one it is only a mesh.
///
/// # Errors
/// If it cannot be read.
pub fn has_steps(path: &Path) -> Result<bool, FileError> {
    let deck = index::Deck::read(path)?;
    Ok(deck.cards().iter().any(|card| card.keyword.name == "STEP"))
}

/// Reads a deck as a case whose mesh file is `mesh_file`; `ignored` keywords are skipped even if they change the result.
///
/// # Errors
/// If a file cannot be read or is invalid, or the deck has entries that a case cannot express.
pub fn read(path: &Path, mesh_file: &str, ignored: &[String]) -> Result<Deck, DeckError> {
    let deck = index::Deck::read(path)?;
    let cards = deck.cards();
    let mut said = Said::read(&deck, &cards, ignored).map_err(|wrong| deck.error(wrong))?;
    for (line, name, text) in deck.unknown_elements() {
        said.refuse(*line, name, text);
    }
    translate::check(&mut said);
    let said = said;
    let refused = |refusals: &[Refusal]| {
        let mut all = refusals.to_vec();
        all.sort();
        all.dedup();
        let refusals = all.into_iter().map(|one| {
            let (file, line) = deck.place(one.line.max(1));
            let place = match file == path {
                true => format!("line {line}"),
                false => format!("{}, line {line}", file.display()),
            };
            (place, one.key, one.text)
        });
        DeckError::Refused {
            path: path.to_owned(),
            refusals: refusals.collect(),
        }
    };
    // Faults that appear only with the mesh are reported as well, unless they follow from earlier refusals.
    let mut index = match deck.index() {
        Err(_) if !said.refusals.is_empty() => return Err(refused(&said.refusals)),
        index => index?,
    };
    let place = |line: usize| {
        let (file, line) = deck.place(line);
        format!("{}, line {line}", file.display())
    };
    let made = translate::definition(&said, &mut index, &place);
    let (mut translated, refusals) = match made {
        Err(_) if !said.refusals.is_empty() => return Err(refused(&said.refusals)),
        made => made.map_err(|wrong| deck.error(wrong))?,
    };
    let refusals = [said.refusals.clone(), refusals].concat();
    if !refusals.is_empty() {
        return Err(refused(&refusals));
    }
    for (keyword, line) in &said.passed {
        let note = format!("{}: *{keyword} is skipped", place(*line));
        translated.notes.push(note);
    }
    let origins = translated.lines.into_iter().map(|(table, line)| {
        let (file, line) = deck.place(line);
        let file = file.to_owned();
        Origin { table, file, line }
    });
    let origins = origins.collect();
    let node_numbers = index.node_numbers();
    let mesh =
        adjust::adjusted(index.finish()?, &translated.adjustments).map_err(|(line, error)| {
            let text = format!(
                "ADJUST= moves nodes of the slave surface onto the master surface, and {error}"
            );
            deck.error((line, text))
        })?;
    let n_nodes = match &mesh {
        AnyMesh::Plane(mesh) => mesh.nodes.len(),
        AnyMesh::Space(mesh) => mesh.nodes.len(),
    };
    if translated.has_nodal_values && n_nodes != node_numbers.len() {
        let text = "*TEMPERATURE: temperatures differ from node to node, and some elements take mid-face nodes from \
                    their neighbours: these nodes have no temperature"
            .to_owned();
        return Err(deck.error((1, text)).into());
    }
    Ok(Deck {
        path: path.to_owned(),
        node_numbers,
        title: said.title,
        mesh,
        mesh_file: mesh_file.to_owned(),
        definition: translated.definition,
        origins,
        notes: translated.notes,
    })
}
