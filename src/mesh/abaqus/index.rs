//! A whole deck: its text, and the nodes, elements and surfaces that its keywords name.

use super::checked;
use super::flatten::{Flat, What, moved};
use super::keyword::{Keyword, is_keyword, key};
use super::parts::{self, Assembly, Part};
use super::text::Text;
use super::types::face;
use crate::mesh::file::build::build;
use crate::mesh::file::raw::Cell;
use crate::mesh::file::{self, Failure, FileError};
use crate::mesh::{AnyMesh, MeshError};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::fmt::{Display, Formatter};
use std::path::Path;

/// A line of the text, from 1, and its fault.
pub(crate) type Wrong = (usize, String);

/// A keyword with its data lines.
pub(crate) struct Card<'a> {
    pub keyword: Keyword<'a>,
    /// Each with its number.
    pub data: Vec<(usize, &'a str)>,
    /// Where the part is placed that it is in, or the instance; None outside of these.
    pub places: Option<Vec<usize>>,
}

/// A name or a number as a keyword states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Name<'a> {
    pub text: &'a str,
    /// The place of the part in which it has its meaning; None outside of parts.
    pub place: Option<usize>,
}

impl<'a> From<&'a str> for Name<'a> {
    fn from(text: &'a str) -> Self {
        Self { text, place: None }
    }
}

impl<'a> From<&&'a str> for Name<'a> {
    fn from(text: &&'a str) -> Self {
        Self::from(*text)
    }
}

impl Display for Name<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.text)
    }
}

/// A deck that has been read.
pub(crate) struct Deck {
    text: Text,
    assembly: Assembly,
}

impl Deck {
    /// Reads a deck with all files that it names.
    ///
    /// # Errors
    /// If a file cannot be read, or nodes, elements or sets are invalid.
    pub fn read(path: &Path) -> Result<Self, FileError> {
        let bytes = file::bytes(path)?;
        let text = Text::new(path, &String::from_utf8_lossy(&bytes), true)?;
        if !text.text.lines().any(|line| is_keyword(line.trim())) {
            let none = "there is no keyword in it: is this an Abaqus input file?".to_owned();
            return Err(Failure::NoMesh(none).of(path));
        }
        match parts::read(&text.text, true) {
            Ok(assembly) => Ok(Self { text, assembly }),
            Err(failure) => Err(text.locate(failure)),
        }
    }

    /// Unsupported types of elements: line, name, reason.
    pub fn unknown_elements(&self) -> &[(usize, String, String)] {
        &self.assembly.unknown
    }

    /// The file and the line of it that a line of the whole text comes from.
    pub fn place(&self, line: usize) -> (&Path, usize) {
        self.text.place(line)
    }

    /// The error about a faulty line.
    pub fn error(&self, (line, message): Wrong) -> FileError {
        self.text.locate(Failure::line(line, message))
    }

    /// All keywords in order.
    pub fn cards(&self) -> Vec<Card<'_>> {
        let mut cards: Vec<Card> = Vec::new();
        let mut places = None;
        let mut n_instances = 0;
        let mut lines = (1..).zip(self.text.text.lines());
        while let Some((line, text)) = lines.next() {
            let text = text.trim();
            if text.is_empty() || text.starts_with("**") {
                continue;
            }
            let Some(mut keyword) = Keyword::parse(line, text) else {
                if let Some(card) = cards.last_mut() {
                    card.data.push((line, text));
                }
                continue;
            };
            keyword.complete(text, || lines.next().map(|(_, more)| more));
            match keyword.name.as_str() {
                "PART" => {
                    let name = keyword.option("NAME").map(key);
                    places = Some(self.assembly.places(&name.unwrap_or_default()));
                }
                "INSTANCE" => {
                    places = Some(vec![n_instances]);
                    n_instances += 1;
                }
                "END PART" | "END INSTANCE" => places = None,
                _ => {}
            }
            cards.push(Card {
                keyword,
                data: Vec::new(),
                places: places.clone(),
            });
        }
        cards
    }

    /// A point of a part where it is placed.
    pub fn moved(&self, place: usize, x: [f64; 3]) -> [f64; 3] {
        let instance = self.assembly.instances.get(place);
        instance.map_or(x, |instance| moved(instance, x))
    }

    /// The meaning of its names.
    ///
    /// # Errors
    /// If its sets or surfaces refer to missing data.
    pub fn index(&self) -> Result<Index<'_>, FileError> {
        match Flat::new(&self.assembly) {
            Ok(flat) => Ok(Index {
                deck: self,
                is_solid: flat.has_solids(),
                flat,
            }),
            Err(failure) => Err(self.text.locate(failure)),
        }
    }
}

/// The meaning of the names of a deck. Nodes and elements are counted from 0.
pub(crate) struct Index<'a> {
    deck: &'a Deck,
    flat: Flat<'a>,
    /// Whether there are volume elements.
    is_solid: bool,
}

/// A surface that a deck names.
pub(crate) struct Surface {
    /// Its name in the mesh.
    pub name: String,
    /// Its nodes, for a surface of nodes.
    pub nodes: Option<Vec<u32>>,
}

/// An element as it is stated.
struct Stated {
    line: usize,
    label: u64,
    /// The position of its first node.
    first: [f64; 3],
}

fn wrong(failure: Failure) -> Wrong {
    match failure {
        Failure::Line { number, message } => (number, message),
        Failure::Format { message, .. } | Failure::NoMesh(message) => (0, message),
        Failure::Mesh(error) => (0, error.to_string()),
    }
}

impl Index<'_> {
    /// Where a name has its meaning: the data outside of parts come last.
    fn scope(&self, name: Name) -> usize {
        name.place.unwrap_or(self.flat.placed.len() - 1)
    }

    /// The nodes of a set, or the node with this number; sorted.
    pub fn nodes<'n>(&self, line: usize, what: impl Into<Name<'n>>) -> Result<Vec<u32>, Wrong> {
        let what = what.into();
        let nodes = self.flat.named(self.scope(what), true, line, what.text);
        nodes.map_err(wrong)
    }

    /// The elements of a set, or the element with this number; sorted.
    pub fn elements<'n>(&self, line: usize, what: impl Into<Name<'n>>) -> Result<Vec<u32>, Wrong> {
        let what = what.into();
        let elements = self.flat.named(self.scope(what), false, line, what.text);
        elements.map_err(wrong)
    }

    /// What has a name, of the part in which it is stated or as `INSTANCE.NAME`: where, and its name there in capitals.
    fn find<T>(
        &self,
        what: Name,
        of: impl Fn(&Part) -> &BTreeMap<String, T>,
    ) -> Option<(usize, String, &T)> {
        let wanted = key(what.text);
        let own = std::iter::once((self.scope(what), wanted.as_str()));
        let placed = self.flat.placed.iter().enumerate();
        let of_instances = placed.filter_map(|(number, placed)| {
            let rest = wanted.strip_prefix(placed.key.as_str())?;
            Some((number, rest.strip_prefix('.')?))
        });
        own.chain(of_instances).find_map(|(number, name)| {
            let found = of(self.flat.placed[number].part).get(name)?;
            Some((number, name.to_owned(), found))
        })
    }

    /// The name of a set in the mesh; None for a number.
    pub fn set_name<'n>(&self, of_nodes: bool, what: impl Into<Name<'n>>) -> Option<String> {
        let (sets, kind): (fn(&Part) -> &parts::Sets, _) = match of_nodes {
            true => (|part| &part.node_sets, What::Nodes),
            false => (|part| &part.element_sets, What::Elements),
        };
        let (number, name, _) = self.find(what.into(), sets)?;
        self.flat.name(kind, number, &name).map(str::to_owned)
    }

    /// A surface as it is stated, with the number of its instance and its name in the mesh.
    fn stated_surface(
        &self,
        line: usize,
        what: Name,
    ) -> Result<(usize, &str, &parts::Surface), Wrong> {
        let found = self.find(what, |part| &part.surfaces);
        let named = found.and_then(|(number, key, surface)| {
            let name = self.flat.name(What::Surface, number, &key)?;
            Some((number, name, surface))
        });
        named.ok_or_else(|| (line, format!("there is no surface \"{what}\"")))
    }

    /// From the middle of the elements of a surface to that of their faces in it, summed over all: outwards. Zero of faces that
    /// have no number.
    pub fn outward(&self, line: usize, what: Name) -> Result<[f64; 3], Wrong> {
        let (number, _, surface) = self.stated_surface(line, what)?;
        let mut sum = [0.0; 3];
        let mut add = |nodes: &[u32], sign: f64| {
            for node in nodes {
                let x = self.place(*node);
                (0..3).for_each(|c| sum[c] += sign / nodes.len() as f64 * x[c]);
            }
        };
        for (line, what, side) in &surface.faces {
            let Some(face) = side.strip_prefix('S').and_then(|face| face.parse().ok()) else {
                continue;
            };
            let elements = self.flat.named(number, false, *line, what);
            for element in elements.map_err(wrong)? {
                if let Some(corners) = self.face(element, face) {
                    let (cell, nodes) = self.flat.cell(element as usize);
                    add(&corners, 1.0);
                    add(&nodes[..cell.n_corners()], -1.0);
                }
            }
        }
        Ok(sum)
    }

    /// A surface, of the assembly or as `INSTANCE.SURFACE`.
    pub fn surface<'n>(&self, line: usize, what: impl Into<Name<'n>>) -> Result<Surface, Wrong> {
        let (number, name, surface) = self.stated_surface(line, what.into())?;
        let mut nodes = None;
        if surface.of_nodes {
            let mut all = Vec::new();
            for (line, what, _) in &surface.faces {
                let more = self.flat.named(number, true, *line, what);
                all.extend(more.map_err(wrong)?);
            }
            all.sort_unstable();
            all.dedup();
            nodes = Some(all);
        }
        let name = name.to_owned();
        Ok(Surface { name, nodes })
    }

    /// The corners of a face of an element, numbered as in the deck; None if it has no such face or belongs to no body.
    fn face(&self, element: u32, number: usize) -> Option<Vec<u32>> {
        let (cell, nodes) = self.flat.cell(element as usize);
        let corners = face(cell, number)?;
        Some(corners.iter().map(|&corner| nodes[corner]).collect())
    }

    pub fn has_face(&self, element: u32, number: usize) -> bool {
        self.face(element, number).is_some()
    }

    /// The numbers in the deck of the nodes that elements of bodies have, in the order of the mesh.
    pub fn node_numbers(&self) -> Vec<u64> {
        let mut numbers = vec![0; self.flat.raw.nodes.len()];
        for placed in &self.flat.placed {
            for (label, node) in placed.part.node_of.iter() {
                numbers[(placed.first_node + node) as usize] = label;
            }
        }
        let all = numbers.into_iter().zip(self.used_nodes());
        all.filter(|one| one.1).map(|one| one.0).collect()
    }

    /// Whether elements of bodies have each node.
    pub fn used_nodes(&self) -> Vec<bool> {
        let mut used = vec![false; self.flat.raw.nodes.len()];
        for number in 0..self.n_elements() {
            if self.is_of_body(number as u32) {
                let nodes = self.flat.cell(number).1;
                nodes.iter().for_each(|&node| used[node as usize] = true);
            }
        }
        used
    }

    pub fn n_elements(&self) -> usize {
        self.flat.n_cells()
    }

    /// Whether an element belongs to a body, and is not a point, line or facet.
    pub fn is_of_body(&self, element: u32) -> bool {
        self.flat.is_body(element as usize, self.is_solid)
    }

    /// The nodes of an element, in its order.
    pub fn ends(&self, element: u32) -> &[u32] {
        self.flat.cell(element as usize).1
    }

    /// The position of a node.
    pub fn place(&self, node: u32) -> [f64; 3] {
        self.flat.raw.nodes[node as usize]
    }

    /// Whether an element has incompatible modes.
    pub fn has_modes(&self, element: u32) -> bool {
        let mut placed = self.flat.placed.iter();
        let placed = placed.rfind(|placed| placed.first_element <= element);
        placed.is_some_and(|placed| {
            let own = element - placed.first_element;
            placed.part.with_modes.contains(&own)
        })
    }

    /// Whether elements of its kind may have incompatible modes.
    pub fn may_have_modes(&self, element: u32) -> bool {
        let (cell, _) = self.flat.cell(element as usize);
        matches!(cell, Cell::Element(kind) if kind.may_have_modes())
    }

    /// Whether the mesh is in space.
    pub fn is_solid(&self) -> bool {
        self.is_solid
    }

    /// The faces of the outside, of which only some may count, by their corners: each with its element and number, in order.
    pub fn outside(&self, counts: impl Fn(&[u32]) -> bool) -> Vec<(u32, usize)> {
        // None: between two elements.
        let mut faces: HashMap<[u32; 4], Option<(u32, usize)>> = HashMap::new();
        for element in (0..self.n_elements() as u32).filter(|&e| self.is_of_body(e)) {
            let numbered = (1..).map_while(|number| Some((number, self.face(element, number)?)));
            for (number, corners) in numbered.filter(|face| counts(&face.1)) {
                let mut sorted = [u32::MAX; 4];
                sorted[..corners.len()].copy_from_slice(&corners);
                sorted.sort_unstable();
                let twice = |face: &mut Option<_>| *face = None;
                (faces.entry(sorted).and_modify(twice)).or_insert(Some((element, number)));
            }
        }
        let mut outside: Vec<(u32, usize)> = faces.into_values().flatten().collect();
        outside.sort_unstable();
        outside
    }

    /// Makes all of the outside a boundary.
    pub fn add_outside(&mut self, name: &str) {
        let faces = self.outside(|_| true);
        self.add_boundary(name, &faces);
    }

    /// Whether the faces of the outside with all corners in a set have all of its nodes.
    pub fn covers(&self, nodes: &[u32]) -> bool {
        let all: BTreeSet<u32> = nodes.iter().copied().collect();
        let outside = self.outside(|corners| corners.iter().all(|corner| all.contains(corner)));
        let corners_of = |(element, number)| self.face(element, number).into_iter().flatten();
        let found: BTreeSet<u32> = outside.into_iter().flat_map(corners_of).collect();
        let corners = self.corners();
        (all.iter()).all(|node| found.contains(node) || !corners[*node as usize])
    }

    /// Whether nodes are corners of elements.
    fn corners(&self) -> Vec<bool> {
        let mut corners = vec![false; self.flat.raw.nodes.len()];
        for number in 0..self.n_elements() {
            let (cell, nodes) = self.flat.cell(number);
            for &node in &nodes[..cell.n_corners()] {
                corners[node as usize] = true;
            }
        }
        corners
    }

    /// The corners of the faces of a surface, by its name in the mesh; sorted.
    pub fn corners_of(&self, surface: &str) -> Vec<u32> {
        let tag = self.flat.known(self.flat.dimension() - 1, surface);
        let all = self.flat.boundaries.iter();
        let of_surface = all.filter(|one| Some(one.0) == tag);
        let mut nodes: Vec<u32> = of_surface.flat_map(|one| &one.1).copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Whether two surfaces, by their names in the mesh, have a face in common.
    pub fn have_common_face(&self, surfaces: [&str; 2]) -> bool {
        let [here, there] = surfaces.map(|name| {
            let tag = self.flat.known(self.flat.dimension() - 1, name);
            let all = self.flat.boundaries.iter();
            let corners = all.filter(|one| Some(one.0) == tag).map(|one| {
                let mut corners = one.1.clone();
                corners.sort_unstable();
                corners
            });
            corners.collect::<HashSet<Vec<u32>>>()
        });
        !here.is_disjoint(&there)
    }

    /// Adds a set of nodes to the mesh, unless it already has one of this name with these nodes.
    pub fn add_nodes(&mut self, name: &str, nodes: &[u32]) {
        let set = (name.to_owned(), nodes.to_vec());
        self.flat.raw.node_sets.push(set);
    }

    /// Makes elements a region, or part of it.
    pub fn add_region(&mut self, name: &str, elements: &[u32]) {
        let tag = self.flat.tag(self.flat.dimension(), name);
        let elements = elements.iter().map(|&element| (element, tag));
        self.flat.regions.extend(elements);
    }

    /// Makes faces a boundary; each has to be a face of the mesh.
    pub fn add_boundary(&mut self, name: &str, faces: &[(u32, usize)]) {
        let tag = self.flat.tag(self.flat.dimension() - 1, name);
        for &(element, number) in faces {
            let corners = self.face(element, number).expect("it has been asked for");
            self.flat.boundaries.push((tag, corners));
        }
    }

    /// The nodes of elements; sorted.
    pub fn nodes_of(&self, elements: &[u32]) -> Vec<u32> {
        let all = elements
            .iter()
            .map(|&element| self.flat.cell(element as usize).1);
        let mut nodes: Vec<u32> = all.flatten().copied().collect();
        nodes.sort_unstable();
        nodes.dedup();
        nodes
    }

    /// Whether a name is that of a set or a surface.
    pub fn is_taken(&self, name: &str) -> bool {
        (0..=3).any(|dimension| self.flat.known(dimension, name).is_some())
    }

    /// The mesh.
    pub fn finish(self) -> Result<AnyMesh, FileError> {
        let stated = self.stated_elements();
        let raw = checked(self.flat.finish(&self.deck.assembly));
        let mesh = raw.and_then(|raw| build(raw, 1.0));
        mesh.map_err(|mut failure| {
            if let Failure::Mesh(
                error @ (MeshError::Degenerate { .. } | MeshError::Folded { .. }),
            ) = &mut failure
                && let MeshError::Degenerate { element, place }
                | MeshError::Folded { element, place, .. } = error
            {
                // Copies of elements have been left out.
                let is_first = |one: &&Stated| one.first[..place.0.len()] == place.0[..];
                if let Some(stated) = stated[*element..].iter().find(is_first) {
                    *element = stated.label as usize;
                    failure = Failure::line(stated.line, error.to_string());
                }
            }
            self.deck.text.locate(failure)
        })
    }

    /// The elements of bodies in the order of the mesh.
    fn stated_elements(&self) -> Vec<Stated> {
        let mut all = Vec::new();
        for placed in &self.flat.placed {
            let mut labels = vec![0; placed.part.elements.len()];
            for (label, own) in placed.part.element_of.iter() {
                labels[own as usize] = label;
            }
            for (own, (label, &line)) in (0..).zip(labels.into_iter().zip(&placed.part.lines)) {
                let element = placed.first_element + own;
                if self.is_of_body(element) {
                    let first = self.place(self.ends(element)[0]);
                    all.push(Stated { line, label, first });
                }
            }
        }
        all
    }
}
