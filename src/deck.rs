//! Whole decks: input files of Abaqus and CalculiX, as cases.
//!
//! A deck of static steps in its linear-elastic, small-strain subset becomes a mesh and what a case file says of one: [`read`]. What
//! changes the result and cannot be said in a case is refused, all of it in one message; what does not is passed over.
//! `docs/decks.md` says what is understood.

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
    /// What it calls itself; empty if it does not.
    pub title: String,
    /// The mesh, with the boundaries, sets of nodes and regions that the definition names.
    pub mesh: AnyMesh,
    /// What a case file calls the file of the mesh.
    pub mesh_file: String,
    /// What is said of the mesh.
    pub(crate) definition: AnyDefinition,
    /// Where the tables of a case file come from that say it.
    pub origins: Vec<Origin>,
    /// The numbers of the nodes of the mesh in the deck, in their order (of instances, each in its part). Nodes that are made
    /// here, in the middle of faces, follow them.
    pub node_numbers: Vec<u64>,
    /// What the deck says and has no effect here, a line each.
    pub notes: Vec<String>,
}

/// What is said of a mesh of either dimension.
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

/// Where a table of a case comes from in a deck.
#[derive(Clone, Debug)]
pub struct Origin {
    /// The path of the table, such as `support[0]`.
    pub table: String,
    /// The deck, or a file that it includes.
    pub file: PathBuf,
    /// The line, from 1.
    pub line: usize,
}

/// Why a deck is no case.
#[derive(Debug, thiserror::Error)]
pub enum DeckError {
    /// A file could not be read, or a line makes no sense.
    #[error(transparent)]
    File(#[from] FileError),
    /// It says what changes the result and cannot be said in a case.
    #[error("{}", listed(path, refusals))]
    Refused {
        /// The deck.
        path: PathBuf,
        /// What: place (file and line), the keyword that `--ignore` takes (empty where that would leave nothing that makes sense), and
        /// why.
        refusals: Vec<(String, String, String)>,
    },
}

fn listed(path: &Path, refusals: &[(String, String, String)]) -> String {
    let keys: BTreeSet<&str> = refusals.iter().map(|one| one.1.as_str()).collect();
    let keys: Vec<&str> = keys.into_iter().filter(|key| !key.is_empty()).collect();
    let way_out = match keys.is_empty() {
        true => String::new(),
        false => format!("; to go on without it: --ignore '{}'", keys.join(",")),
    };
    // What is said of several lines stands once.
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
        "{}: this deck says what changes the result and is not understood here{way_out}{}",
        path.display(),
        lines.collect::<String>()
    )
}

/// Whether a file is called like a deck (`.inp`).
pub fn is_deck(path: &Path) -> bool {
    (path.extension()).is_some_and(|extension| extension.eq_ignore_ascii_case("inp"))
}

/// Whether a deck has a step, and is no mere mesh.
///
/// # Errors
/// If it cannot be read.
pub fn has_steps(path: &Path) -> Result<bool, FileError> {
    let deck = index::Deck::read(path)?;
    Ok(deck.cards().iter().any(|card| card.keyword.name == "STEP"))
}

/// Reads a deck as a case that calls the file of its mesh `mesh_file`; what has a keyword that is `ignored` is passed over even if it
/// changes the result.
///
/// # Errors
/// If a file cannot be read or makes no sense, or the deck says what cannot be said in a case.
pub fn read(path: &Path, mesh_file: &str, ignored: &[String]) -> Result<Deck, DeckError> {
    let deck = index::Deck::read(path)?;
    let cards = deck.cards();
    let mut said = Said::read(&cards, ignored).map_err(|wrong| deck.error(wrong))?;
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
    // What shows with the mesh is told as well, as far as that makes sense without what is refused already.
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
        let note = format!("{}: *{keyword} is passed over", place(*line));
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
        let text = "*TEMPERATURE: temperatures that differ from node to node, and elements that get nodes in the middle of their faces \
                    from their neighbours: there are no temperatures for these"
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
