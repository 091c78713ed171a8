//! From parts and their instances to one list of nodes and elements with their groups.

use super::keyword::key;
use super::parts::{Assembly, Instance, Member, Part, Set, Sets, Surface};
use super::types::face;
use super::{Failure, Result};
use crate::mesh::copies::sorted;
use crate::mesh::element::unsided;
use crate::mesh::file::raw::{Cell, Numbers, Raw};
use crate::mesh::vector::{cross, dot, minus, unit};
use crate::mesh::{Element, ElementKind, Facet, Topology, facet_corners, facet_nodes};
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};

/// A part in its place; all of a flat file is one.
pub(super) struct Placed<'a> {
    pub part: &'a Part,
    /// As written; empty outside of instances.
    name: String,
    /// In capitals.
    pub key: String,
    pub first_node: u32,
    pub first_element: u32,
}

impl Placed<'_> {
    /// Its nodes or elements by their numbers in the file, and where ours begin.
    fn labels(&self, of_nodes: bool) -> (&Numbers, u32) {
        if of_nodes {
            (&self.part.node_of, self.first_node)
        } else {
            (&self.part.element_of, self.first_element)
        }
    }
}

/// What names name. A set of nodes, a set of elements and a surface may have the same name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum What {
    Nodes,
    Elements,
    Surface,
}

/// Sets go into sets no deeper than this.
const DEEPEST: usize = 50;

/// Everything in one list.
pub(super) struct Flat<'a> {
    pub placed: Vec<Placed<'a>>,
    pub raw: Raw,
    /// The kind of each element, and the start of its nodes.
    cells: Vec<(Cell, usize)>,
    nodes_of_cells: Vec<u32>,
    /// The tags of names in the mesh, by the dimension of what they name: 0 for sets of nodes.
    tags: HashMap<(i64, String), i64>,
    /// The names in the mesh of sets and surfaces: of each part in its place, by their names in capitals.
    names: HashMap<(What, usize, String), String>,
    /// Element and tag.
    pub regions: Vec<(u32, i64)>,
    /// Facets with their tags.
    pub boundaries: Vec<(i64, Vec<u32>)>,
    /// Sets of nodes that become boundaries: tag and nodes.
    node_sets: Vec<(i64, Vec<u32>)>,
}

pub(super) fn flatten(assembly: &Assembly) -> Result<Raw> {
    Ok(Flat::new(assembly)?.finish(assembly))
}

impl<'a> Flat<'a> {
    /// Everything in its place, with its sets and surfaces.
    pub(super) fn new(assembly: &'a Assembly) -> Result<Self> {
        let mut flat = Self::place(assembly)?;
        flat.name_surfaces()?;
        let curves = flat.name_elements()?;
        flat.name_nodes()?;
        for (tag, name) in curves {
            flat.share(tag, 0, &name, 1);
        }
        Ok(flat)
    }

    /// The whole contents of the file.
    pub(super) fn finish(mut self, assembly: &Assembly) -> Raw {
        self.add_elements();
        self.add_boundaries();
        self.raw.notes = assembly.notes.iter().cloned().collect();
        self.raw
    }

    /// Places the parts as their instances say, and the data outside of parts last.
    fn place(assembly: &'a Assembly) -> Result<Self> {
        let mut flat = Self {
            placed: Vec::new(),
            raw: Raw::default(),
            cells: Vec::new(),
            nodes_of_cells: Vec::new(),
            tags: HashMap::new(),
            names: HashMap::new(),
            regions: Vec::new(),
            boundaries: Vec::new(),
            node_sets: Vec::new(),
        };
        let part_of = |name: &str| {
            let mut parts = assembly.parts.iter();
            parts.find(|part| key(&part.0) == name).map(|part| &part.1)
        };
        for instance in &assembly.instances {
            let part = part_of(&instance.part).ok_or_else(|| {
                let text = format!("there is no part \"{}\"", instance.part);
                Failure::line(instance.line, text)
            })?;
            flat.add(part, &instance.name, |x| moved(instance, x))?;
        }
        if assembly.instances.is_empty() {
            // Parts without an assembly stay as drawn.
            for (name, part) in &assembly.parts {
                flat.add(part, name, |x| x)?;
            }
        }
        flat.add(&assembly.root, "", |x| x)?;
        Ok(flat)
    }

    fn add(
        &mut self,
        part: &'a Part,
        name: &str,
        moved: impl Fn([f64; 3]) -> [f64; 3],
    ) -> Result<()> {
        let placed = Placed {
            part,
            name: name.to_owned(),
            key: key(name),
            first_node: self.raw.nodes.len() as u32,
            first_element: self.cells.len() as u32,
        };
        self.raw.nodes.extend(part.nodes.iter().map(|&x| moved(x)));
        let before = self.nodes_of_cells.len();
        let elements = part.elements.iter();
        (self.cells).extend(elements.map(|&(cell, begin)| (cell, before + begin)));
        let own = |&label: &u64| Some(placed.first_node + part.node_of.get(label)?);
        let nodes: Option<Vec<u32>> = match part.instances.is_empty() {
            true => part.labels.par_iter().map(own).collect(),
            false => None,
        };
        match nodes {
            Some(nodes) => self.nodes_of_cells.extend(nodes),
            None => self.add_nodes(&placed)?,
        }
        self.placed.push(placed);
        Ok(())
    }

    /// Adds the nodes of elements, some of which instances may have, or there may be none.
    fn add_nodes(&mut self, placed: &Placed<'a>) -> Result<()> {
        let part = placed.part;
        for (&(cell, begin), &line) in part.elements.iter().zip(&part.lines) {
            for at in begin..begin + cell.n_nodes() {
                let label = part.labels[at];
                let (of, first) = match part.instances.get(&at) {
                    None => (part, placed.first_node),
                    Some(name) => {
                        let found = self.placed.iter().find(|placed| placed.key == *name);
                        let found = found.ok_or_else(|| {
                            let text = format!("there is no instance \"{name}\"");
                            Failure::line(line, text)
                        })?;
                        (found.part, found.first_node)
                    }
                };
                let Some(node) = of.node_of.get(label) else {
                    let text = format!("an element names node {label}, which does not exist");
                    return Err(Failure::line(line, text));
                };
                self.nodes_of_cells.push(first + node);
            }
        }
        Ok(())
    }

    /// An element and its nodes.
    pub(super) fn cell(&self, number: usize) -> (Cell, &[u32]) {
        let (cell, begin) = self.cells[number];
        (cell, &self.nodes_of_cells[begin..][..cell.n_nodes()])
    }

    /// The number of elements, of bodies and others.
    #[cfg(feature = "case")]
    pub(super) fn n_cells(&self) -> usize {
        self.cells.len()
    }

    /// Whether there are volume elements.
    pub(super) fn has_solids(&self) -> bool {
        let is_solid =
            |&(cell, _): &(Cell, usize)| matches!(cell, Cell::Element(_)) && !cell.is_surface();
        self.cells.iter().any(is_solid)
    }

    /// Whether an element belongs to a body: in space a volume, in the plane a surface.
    #[cfg(feature = "case")]
    pub(super) fn is_body(&self, number: usize, is_solid: bool) -> bool {
        let (cell, _) = self.cells[number];
        matches!(cell, Cell::Element(_)) && cell.is_surface() != is_solid
    }

    /// The dimension of bodies.
    pub(super) fn dimension(&self) -> i64 {
        if self.has_solids() { 3 } else { 2 }
    }

    /// The tag of a name of something that has so many dimensions, 0 of a set of nodes.
    pub(super) fn tag(&mut self, dimension: i64, name: &str) -> i64 {
        let next = self.tags.len() as i64 + 1;
        let tag = *(self.tags.entry((dimension, name.to_owned()))).or_insert(next);
        self.raw
            .names
            .insert((dimension, tag as u64), name.to_owned());
        tag
    }

    /// The tag of a name, if something with so many dimensions has it.
    pub(super) fn known(&self, dimension: i64, name: &str) -> Option<i64> {
        self.tags.get(&(dimension, name.to_owned())).copied()
    }

    /// Gives the parts with `of` dimensions of what has a tag its name as well, unless something else has it among those of `dimension`.
    fn share(&mut self, tag: i64, dimension: i64, name: &str, of: i64) {
        if self.known(dimension, name).is_none() {
            self.tags.insert((dimension, name.to_owned()), tag);
            self.raw.names.insert((of, tag as u64), name.to_owned());
        }
    }

    /// The name in the mesh of a set or surface of a part in its place, by its name in capitals.
    #[cfg(feature = "case")]
    pub(super) fn name(&self, what: What, number: usize, key: &str) -> Option<&str> {
        let name = self.names.get(&(what, number, key.to_owned()));
        name.map(String::as_str)
    }

    /// The name in the mesh of something with its own name in a part: the own one if it is free, with that of the instance before it
    /// where there are several or it is not free, and then with the kind behind it.
    fn choose(
        &mut self,
        what: What,
        number: usize,
        own: &str,
        is_free: impl Fn(&Self, &str) -> bool,
    ) -> String {
        let instance = &self.placed[number].name;
        let long = match instance.is_empty() {
            true => own.to_owned(),
            false => format!("{instance}.{own}"),
        };
        // Beside one instance there is only the data outside of parts.
        let short = (self.placed.len() <= 2).then(|| own.to_owned());
        let suffix = match what {
            What::Nodes => "nodes",
            What::Elements => "elements",
            What::Surface => "surface",
        };
        let numbered = (2..).map(|n| format!("{long}-{suffix}-{n}"));
        let mut all = (short.into_iter())
            .chain([long.clone(), format!("{long}-{suffix}")])
            .chain(numbered);
        let name = all.find(|name| is_free(self, name));
        let name = name.expect("numbers are without end");
        self.names.insert((what, number, key(own)), name.clone());
        name
    }

    /// The numbers of all parts in their places, data outside of parts first: keywords name these without an instance.
    fn scopes(&self) -> impl Iterator<Item = usize> + use<> {
        (0..self.placed.len()).rev()
    }

    /// The sets of all parts, and whether they are in the mesh: these come first.
    fn all_sets(
        &self,
        of: fn(&'a Part) -> &'a Sets,
        counts: impl Fn(usize, &str) -> bool,
    ) -> Vec<(usize, &'a Set, bool)> {
        let mut all: Vec<_> = (self.scopes())
            .flat_map(|number| {
                let sets = of(self.placed[number].part).iter();
                sets.map(move |(key, set)| (number, key, set))
            })
            .map(|(number, key, set)| (number, set, !set.internal && counts(number, key)))
            .collect();
        all.sort_by_key(|one| !one.2);
        all
    }

    /// Surfaces of faces are boundaries.
    fn name_surfaces(&mut self) -> Result<()> {
        let facets = self.dimension() - 1;
        for number in self.scopes() {
            let surfaces = self.placed[number].part.surfaces.values();
            for surface in surfaces.filter(|surface| !surface.of_nodes) {
                let is_free = |flat: &Self, name: &str| flat.known(facets, name).is_none();
                let name = self.choose(What::Surface, number, &surface.name, is_free);
                let tag = self.tag(facets, &name);
                self.surface(number, tag, surface)?;
            }
        }
        Ok(())
    }

    /// Sets of elements are regions. Their facets are a boundary, unless that is a surface. Returns those with curves in space, which
    /// are sets of nodes.
    fn name_elements(&mut self) -> Result<Vec<(i64, String)>> {
        let mut curves = Vec::new();
        let dimension = self.dimension();
        let root = self.placed[self.placed.len() - 1].part;
        let has_sections = self.placed.iter().any(|one| !one.part.sections.is_empty());
        // CAE makes an element set beside the node set of each face that it names: it is not a region, if sections name others.
        let counts = |number: usize, name: &str| {
            let Placed { part, key, .. } = &self.placed[number];
            let has_section =
                part.sections.contains(name) || root.sections.contains(&format!("{key}.{name}"));
            has_section || !has_sections || !part.node_sets.contains_key(name)
        };
        for (number, set, counts) in self.all_sets(|part| &part.element_sets, counts) {
            let is_free = |flat: &Self, name: &str| flat.known(dimension, name).is_none();
            let name = self.choose(What::Elements, number, &set.name, is_free);
            let tag = self.tag(dimension, &name);
            if !counts {
                continue;
            }
            let members = self.members(number, false, set, 0)?;
            let cells = || members.iter().map(|&element| self.cell(element as usize).0);
            let has_faces = cells().any(Cell::is_surface);
            let has_lines = cells().any(|cell| matches!(cell, Cell::Line | Cell::Line3));
            match dimension {
                2 if has_lines => self.share(tag, 1, &name, 1),
                3 if has_faces => self.share(tag, 2, &name, 2),
                _ => {}
            }
            if has_lines && dimension == 3 {
                curves.push((tag, name));
            }
            let members = members.into_iter();
            self.regions.extend(members.map(|element| (element, tag)));
        }
        Ok(curves)
    }

    /// Sets of nodes, and surfaces of nodes. Their facets are a boundary, unless that is a surface or of elements.
    fn name_nodes(&mut self) -> Result<()> {
        let facets = self.dimension() - 1;
        for (number, set, counts) in self.all_sets(|part| &part.node_sets, |_, _| true) {
            let is_free = |flat: &Self, name: &str| flat.known(0, name).is_none();
            let name = self.choose(What::Nodes, number, &set.name, is_free);
            let tag = self.tag(0, &name);
            if counts {
                let members = self.members(number, true, set, 0)?;
                self.share(tag, facets, &name, facets);
                self.node_sets.push((tag, members));
            }
        }
        for number in self.scopes() {
            let surfaces = self.placed[number].part.surfaces.values();
            for surface in surfaces.filter(|surface| surface.of_nodes) {
                let mut nodes = Vec::new();
                for (line, what, _) in &surface.faces {
                    nodes.extend(self.named(number, true, *line, what)?);
                }
                nodes.sort_unstable();
                nodes.dedup();
                // A surface with the nodes of the set of its name is that set.
                let same = |flat: &Self, tag: i64| flat.node_sets.contains(&(tag, nodes.clone()));
                let is_free = |flat: &Self, name: &str| {
                    let tag = flat.known(0, name);
                    let facets = flat.known(facets, name);
                    tag.is_none_or(|tag| same(flat, tag)) && (facets.is_none() || facets == tag)
                };
                let name = self.choose(What::Surface, number, &surface.name, is_free);
                let tag = self.tag(0, &name);
                self.share(tag, facets, &name, facets);
                self.node_sets.push((tag, nodes));
            }
        }
        Ok(())
    }

    /// The faces of a surface.
    fn surface(&mut self, number: usize, tag: i64, surface: &Surface) -> Result<()> {
        let mut whole = BTreeSet::new();
        for (line, what, side) in &surface.faces {
            for element in self.named(number, false, *line, what)? {
                let (cell, nodes) = self.cell(element as usize);
                let is_surface = cell.is_surface();
                let sided = side.strip_prefix('S').or(side.strip_prefix('E'));
                if side.is_empty() {
                    whole.insert(element);
                } else if matches!(side.as_str(), "SPOS" | "SNEG") && is_surface {
                    let corners = nodes[..cell.n_corners()].to_vec();
                    self.boundaries.push((tag, corners));
                } else if let Some(corners) = sided
                    .and_then(|number| number.parse().ok())
                    .and_then(|number| face(cell, number))
                {
                    let corners = corners.iter().map(|&corner| nodes[corner]).collect();
                    self.boundaries.push((tag, corners));
                } else {
                    let text = format!(
                        "surface \"{}\": {side} is not a face of this element",
                        surface.name
                    );
                    return Err(Failure::line(*line, text));
                }
            }
        }
        // Without a side: those of its faces that no other element has.
        let mut times: HashMap<Vec<u32>, (usize, Vec<u32>)> = HashMap::new();
        let all = if whole.is_empty() {
            0
        } else {
            self.cells.len()
        };
        for number in 0..all {
            let (cell, nodes) = self.cell(number);
            for corners in (1..).map_while(|number| face(cell, number)) {
                let corners: Vec<u32> = corners.iter().map(|&corner| nodes[corner]).collect();
                let mut key = corners.clone();
                key.sort_unstable();
                let found = times.entry(key).or_default();
                found.0 += 1;
                if whole.contains(&(number as u32)) {
                    found.1 = corners;
                }
            }
        }
        let free =
            (times.into_values()).filter(|(times, corners)| *times == 1 && !corners.is_empty());
        self.boundaries
            .extend(free.map(|(_, corners)| (tag, corners)));
        Ok(())
    }

    /// The nodes or elements of a set.
    fn members(&self, number: usize, of_nodes: bool, set: &Set, depth: usize) -> Result<Vec<u32>> {
        let mut found = Vec::with_capacity(set.members.len());
        for (line, member) in &set.members {
            match member {
                Member::One(instance, label) => {
                    found.push(self.one(number, of_nodes, *line, instance.as_deref(), *label)?);
                }
                // Ranges may run over numbers that nothing has.
                Member::Range(instance, [from, to, step]) => {
                    let placed = self.placed(number, *line, instance.as_deref())?;
                    let (labels, first) = placed.labels(of_nodes);
                    let inside = |label: u64| {
                        (*from..=*to).contains(&label) && (label - from).is_multiple_of(*step)
                    };
                    let all = labels.iter().filter(|label| inside(label.0));
                    found.extend(all.map(|(_, place)| first + place));
                }
                Member::NodesOf(name) if depth < DEEPEST => {
                    for element in self.set(number, false, *line, name, depth + 1)? {
                        found.extend(self.cell(element as usize).1);
                    }
                }
                Member::Set(name) if depth < DEEPEST => {
                    found.extend(self.set(number, of_nodes, *line, name, depth + 1)?);
                }
                Member::Set(name) | Member::NodesOf(name) => {
                    let text = format!("set \"{name}\" contains itself");
                    return Err(Failure::line(*line, text));
                }
            }
        }
        found.sort_unstable();
        found.dedup();
        Ok(found)
    }

    /// A set or a number that a surface names.
    pub(super) fn named(
        &self,
        number: usize,
        of_nodes: bool,
        line: usize,
        what: &str,
    ) -> Result<Vec<u32>> {
        if let Ok(label) = what.parse() {
            return Ok(vec![self.one(number, of_nodes, line, None, label)?]);
        }
        self.set(number, of_nodes, line, &key(what), 0)
    }

    /// The members of a set by its name in capitals: of the part, or of an instance as `INSTANCE.SET`; or what an instance has under
    /// a number, `INSTANCE.5`.
    fn set(
        &self,
        number: usize,
        of_nodes: bool,
        line: usize,
        name: &str,
        depth: usize,
    ) -> Result<Vec<u32>> {
        let sets = |number: usize| {
            let part = self.placed[number].part;
            if of_nodes {
                &part.node_sets
            } else {
                &part.element_sets
            }
        };
        if let Some(set) = sets(number).get(name) {
            return self.members(number, of_nodes, set, depth);
        }
        let within = |placed: &Placed| name.strip_prefix(placed.key.as_str())?.strip_prefix('.');
        let inside =
            |(other, placed): (usize, &Placed)| Some((other, sets(other).get(within(placed)?)?));
        if let Some((other, set)) = self.placed.iter().enumerate().find_map(inside) {
            return self.members(other, of_nodes, set, depth);
        }
        let labelled = |placed: &Placed| Some((placed.key.clone(), within(placed)?.parse().ok()?));
        if let Some((instance, label)) = self.placed.iter().find_map(labelled) {
            let one = self.one(number, of_nodes, line, Some(&instance), label)?;
            return Ok(vec![one]);
        }
        let what = if of_nodes { "node" } else { "element" };
        let text = match name.rsplit_once('.') {
            Some((instance, label)) if label.parse::<u64>().is_ok() => {
                format!("there is no {what} set \"{name}\", nor an instance \"{instance}\"")
            }
            _ => format!("there is no {what} set \"{name}\""),
        };
        Err(Failure::line(line, text))
    }

    /// The part itself, or an instance by its name in capitals.
    fn placed(&self, number: usize, line: usize, instance: Option<&str>) -> Result<&Placed<'a>> {
        match instance {
            None => Ok(&self.placed[number]),
            Some(name) => (self.placed.iter().find(|placed| placed.key == name))
                .ok_or_else(|| Failure::line(line, format!("there is no instance \"{name}\""))),
        }
    }

    /// A node or an element by its number: of the part, or of an instance.
    fn one(
        &self,
        number: usize,
        of_nodes: bool,
        line: usize,
        instance: Option<&str>,
        label: u64,
    ) -> Result<u32> {
        let (labels, first) = self.placed(number, line, instance)?.labels(of_nodes);
        let found = labels.get(label);
        found.map(|place| first + place).ok_or_else(|| {
            let what = if of_nodes { "node" } else { "element" };
            Failure::line(
                line,
                format!("a set names {what} {label}, which does not exist"),
            )
        })
    }

    /// Passes the elements on with their sets.
    fn add_elements(&mut self) {
        self.regions.sort_unstable();
        self.regions.dedup();
        let mut regions = self.regions.iter().peekable();
        let mut tags = Vec::new();
        let (mut last, mut set) = (Vec::new(), 0);
        // Of each element that a mesh has: its kind, its set and where its nodes begin.
        let mut listed = Vec::with_capacity(self.cells.len());
        for (number, &(cell, begin)) in (0..).zip(&self.cells) {
            tags.clear();
            let of = match cell {
                Cell::Line | Cell::Line3 => 1,
                _ if cell.is_surface() => 2,
                _ => 3,
            };
            while let Some((_, tag)) = regions.next_if(|region| region.0 == number) {
                // Elsewhere something else has its name.
                if self.raw.names.contains_key(&(of, *tag as u64)) {
                    tags.push(*tag);
                }
            }
            if tags != last {
                set = self.raw.groups.number(tags.iter().copied());
                last.clone_from(&tags);
            }
            // A mass or a spring at a node makes no set of nodes.
            if cell != Cell::Point {
                listed.push((cell, set, begin));
            }
        }
        let follows =
            |a: &(Cell, u32, usize), b: &(Cell, u32, usize)| (a.0, a.1, a.2 + a.0.n_nodes()) == *b;
        for run in listed.chunk_by(follows) {
            let (cell, set, begin) = run[0];
            let nodes = &self.nodes_of_cells[begin..][..run.len() * cell.n_nodes()];
            self.raw.push_all(cell, set, nodes);
        }
    }

    /// Passes on the facets of surfaces, and those of node sets.
    fn add_boundaries(&mut self) {
        let is_solid = !self.raw.solids.is_empty();
        let mut all = std::mem::take(&mut self.boundaries);
        let mut inside = vec![false; self.raw.nodes.len()];
        let of_sets = self.node_sets.iter().flat_map(|set| &set.1);
        of_sets.for_each(|&node| inside[node as usize] = true);
        let (outside, is_middle) = if is_solid {
            outer(&self.raw.solids, &inside)
        } else {
            outer(&self.raw.faces, &inside)
        };
        inside.fill(false);
        let facets = self.dimension() - 1;
        for (tag, nodes) in &self.node_sets {
            let name = &self.raw.names[&(0, *tag as u64)];
            self.raw.node_sets.push((name.clone(), nodes.clone()));
            if !self.raw.names.contains_key(&(facets, *tag as u64)) {
                continue;
            }
            let before = all.len();
            nodes.iter().for_each(|&node| inside[node as usize] = true);
            // A set without nodes in the middle of sides names facets by their corners.
            let whole = nodes.iter().any(|&node| is_middle[node as usize]);
            for (facet, corners) in &outside {
                let wanted = if whole { facet.len() } else { *corners };
                if (facet[..wanted].iter()).all(|&node| inside[node as usize]) {
                    all.push((*tag, facet[..*corners].to_vec()));
                }
            }
            nodes.iter().for_each(|&node| inside[node as usize] = false);
            if let (Some(&node), true) = (nodes.first(), all.len() == before) {
                let none = (name.clone(), self.raw.nodes[node as usize]);
                self.raw.without_facets.push(none);
            }
        }
        for (tag, corners) in all {
            let cell = match (is_solid, corners.len()) {
                (false, 2) => Cell::Line,
                (true, 3) => Cell::Element(ElementKind::Triangle),
                (true, 4) => Cell::Element(ElementKind::Quad),
                // An edge of a shell in space, or a shell in the plane, bounds nothing.
                _ => continue,
            };
            let set = self.raw.groups.number([tag]);
            self.raw.push(cell, set, &corners);
        }
    }
}

/// The nodes of the facets that belong to exactly one element and have all corners among some nodes, corners first, with the number of
/// corners; and which nodes are midside nodes.
fn outer<const D: usize>(
    elements: &[Element<D>],
    among: &[bool],
) -> (Vec<(Vec<u32>, usize)>, Vec<bool>)
where
    ElementKind: Topology<D>,
{
    let is_among = |facet: &Facet<D>| {
        let mut corners = facet_corners(facet).iter();
        corners.all(|&corner| among[corner as usize])
    };
    let lists = sorted(elements.len(), among.len(), |number| {
        let facets = elements[number].facets().filter(is_among);
        facets.map(|facet| (unsided(&facet), facet))
    });
    let single = |same: &&[([u32; 4], Facet<D>)]| same.len() == 1;
    let mut outside: Vec<(Vec<u32>, usize)> = (lists.par_iter())
        .flat_map_iter(|list| list.chunk_by(|a, b| a.0 == b.0).filter(single))
        .map(|same| {
            let facet = &same[0].1;
            (facet_nodes(facet).to_vec(), facet_corners(facet).len())
        })
        .collect();
    outside.sort_unstable();
    let mut is_middle = vec![false; among.len()];
    for element in elements {
        for &node in &element.nodes()[element.kind().n_corners()..] {
            is_middle[node as usize] = true;
        }
    }
    (outside, is_middle)
}

/// A point of a part where its instance puts it: shifted, then turned about an axis.
pub(super) fn moved(instance: &Instance, x: [f64; 3]) -> [f64; 3] {
    let x: [f64; 3] = std::array::from_fn(|c| x[c] + instance.shift[c]);
    let Some([ax, ay, az, bx, by, bz, degrees]) = instance.turn else {
        return x;
    };
    let origin = [ax, ay, az];
    let along = unit(minus([bx, by, bz], origin));
    let (sin, cos) = degrees.to_radians().sin_cos();
    let way = minus(x, origin);
    // Rodrigues.
    let (side, part) = (cross(along, way), dot(along, way) * (1.0 - cos));
    std::array::from_fn(|c| origin[c] + cos * way[c] + sin * side[c] + part * along[c])
}
