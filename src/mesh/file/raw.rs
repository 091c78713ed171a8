//! The contents of a file before it is a mesh.

use crate::mesh::copies::{self, Copies};
use crate::mesh::{Element, ElementKind, Facet, Topology, facet, facet_corners};
use rayon::prelude::*;
use std::collections::HashMap;

/// The cells in files: elements of bodies, and their boundaries.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::mesh) enum Cell {
    Point,
    Line,
    /// A line with a node in its middle.
    Line3,
    /// Two nodes that a spring joins: no part of a mesh.
    Link,
    Element(ElementKind),
}

impl Cell {
    pub const fn n_nodes(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line | Self::Link => 2,
            Self::Line3 => 3,
            Self::Element(kind) => kind.n_nodes(),
        }
    }

    /// The number of its corners, which are the first of its nodes.
    pub const fn n_corners(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line | Self::Line3 | Self::Link => 2,
            Self::Element(kind) => kind.n_corners(),
        }
    }

    /// Whether it bounds a solid, or is an element of the plane.
    pub const fn is_surface(self) -> bool {
        match self {
            Self::Element(kind) => {
                matches!(kind.linear(), ElementKind::Triangle | ElementKind::Quad)
            }
            _ => false,
        }
    }
}

/// No element has more nodes.
pub(in crate::mesh) const MOST_NODES: usize = ElementKind::Hexahedron27.n_nodes();

/// More groups of one element are nonsense, and no reason to keep long sets for each.
pub(in crate::mesh) const MOST_GROUPS: usize = 255;

/// Sets of physical groups; elements refer to them by number, since few differ. Number 0 is that of none.
pub(in crate::mesh) struct GroupSets {
    pub sets: Vec<Vec<u64>>,
    numbers: HashMap<Vec<u64>, u32>,
}

impl Default for GroupSets {
    fn default() -> Self {
        Self {
            sets: vec![Vec::new()],
            numbers: HashMap::from([(Vec::new(), 0)]),
        }
    }
}

impl GroupSets {
    /// The number of a set. A negative tag means that the group turns the entity around.
    pub fn number(&mut self, tags: impl IntoIterator<Item = i64>) -> u32 {
        let mut set: Vec<u64> = tags.into_iter().map(i64::unsigned_abs).collect();
        set.retain(|&tag| tag != 0);
        set.sort_unstable();
        set.dedup();
        if let Some(&number) = self.numbers.get(&set) {
            return number;
        }
        let number = self.sets.len() as u32;
        self.sets.push(set.clone());
        self.numbers.insert(set, number);
        number
    }
}

/// From the numbers of nodes or elements in the file to ours: a table, where they are dense.
#[derive(Default)]
pub(in crate::mesh) struct Numbers {
    table: Vec<u32>,
    others: HashMap<u64, u32>,
}

impl Numbers {
    const NONE: u32 = u32::MAX;

    pub fn get(&self, tag: u64) -> Option<u32> {
        let place = usize::try_from(tag).ok();
        match place.and_then(|place| self.table.get(place)) {
            Some(&own) if own != Self::NONE => Some(own),
            _ if self.others.is_empty() => None,
            _ => self.others.get(&tag).copied(),
        }
    }

    /// Adds a number of the file with the next of ours; false if it is there already.
    pub fn insert(&mut self, tag: u64, own: u32) -> bool {
        if self.get(tag).is_some() {
            return false;
        }
        // No file makes the table much longer than there are nodes or elements.
        if tag >= self.table.len() as u64 && tag <= 4 * u64::from(own) + 1000 {
            self.table.resize(tag as usize + 1, Self::NONE);
        }
        let place = usize::try_from(tag).ok();
        match place.and_then(|place| self.table.get_mut(place)) {
            Some(place) => *place = own,
            None => {
                self.others.insert(tag, own);
            }
        }
        true
    }

    /// All numbers in the file with ours.
    pub fn iter(&self) -> impl Iterator<Item = (u64, u32)> {
        let table = (0..).zip(self.table.iter().copied());
        let others = self.others.iter().map(|(&tag, &own)| (tag, own));
        (table.filter(|&(_, own)| own != Self::NONE)).chain(others)
    }
}

/// Elements as they are listed: the kind and the group of each, and our numbers of their nodes one after the other.
#[derive(Default)]
pub(in crate::mesh) struct Listed {
    pub cells: Vec<(Cell, i64)>,
    pub nodes: Vec<u32>,
}

/// The contents of all sections.
#[derive(Default)]
pub(in crate::mesh) struct Raw {
    /// Names of physical groups by (dimension, tag).
    pub names: HashMap<(i64, u64), String>,
    pub groups: GroupSets,
    /// Sets of physical groups of entities by (dimension, tag), MSH 4.1.
    pub entities: HashMap<(i64, i64), u32>,
    pub nodes: Vec<[f64; 3]>,
    numbers: Numbers,
    /// (set of physical groups, node) of points.
    pub points: Vec<(u32, u32)>,
    /// Sets of nodes under their names.
    pub node_sets: Vec<(String, Vec<u32>)>,
    /// (set of physical groups, nodes) of lines.
    pub lines: Vec<(u32, Facet)>,
    /// Triangles and quadrilaterals; the region is the number of the set of physical groups.
    pub faces: Vec<Element>,
    /// Tetrahedra, hexahedra, wedges and pyramids, as above.
    pub solids: Vec<Element<3>>,
    /// Sets of nodes that were to be boundaries, but have no facet; each with a place of it.
    pub without_facets: Vec<(String, [f64; 3])>,
    /// Entries that have no effect.
    pub notes: Vec<String>,
}

impl Raw {
    /// Adds a node with its number in the file; if it cannot be one, why not.
    pub fn add_node(&mut self, tag: usize, x: [f64; 3]) -> Result<(), String> {
        if !self.numbers.insert(tag as u64, self.nodes.len() as u32) {
            return Err(format!("node {tag} is listed twice"));
        }
        if !x.iter().all(|v| v.is_finite()) {
            return Err(format!("node {tag} has a coordinate that is not finite"));
        }
        self.nodes.push(x);
        Ok(())
    }

    /// Our number of the node with a number in the file.
    pub fn node(&self, tag: usize) -> Option<u32> {
        self.numbers.get(tag as u64)
    }

    /// Adds elements in parts that keep their order.
    pub fn push_listed(&mut self, parts: Vec<Listed>) {
        let (cells, nodes): (Vec<_>, Vec<_>) = parts
            .into_iter()
            .map(|part| (part.cells, part.nodes))
            .unzip();
        let (cells, nodes) = (cells.concat(), nodes.concat());
        let mut rest = nodes.as_slice();
        for run in cells.chunk_by(|a, b| a == b) {
            let (cell, group) = run[0];
            let (nodes, behind) = rest.split_at(run.len() * cell.n_nodes());
            let set = self.groups.number([group]);
            self.push_all(cell, set, nodes);
            rest = behind;
        }
    }

    /// Adds elements of one kind with our numbers of their nodes, as many as each has.
    pub fn push_all(&mut self, cell: Cell, set: u32, nodes: &[u32]) {
        /// The least elements for several threads: some 100 KB.
        const SEVERAL: usize = 1000;
        let each = nodes.chunks_exact(cell.n_nodes());
        if each.len() < SEVERAL {
            return each.for_each(|nodes| self.push(cell, set, nodes));
        }
        let each = nodes.par_chunks_exact(cell.n_nodes());
        match cell {
            Cell::Element(kind) if cell.is_surface() => {
                (self.faces).par_extend(each.map(|nodes| Element::new(kind, nodes, set)));
            }
            Cell::Element(kind) => {
                (self.solids).par_extend(each.map(|nodes| Element::new(kind, nodes, set)));
            }
            _ => nodes
                .chunks_exact(cell.n_nodes())
                .for_each(|nodes| self.push(cell, set, nodes)),
        }
    }

    /// Adds an element with our numbers of its nodes, as many as it has.
    pub fn push(&mut self, cell: Cell, set: u32, nodes: &[u32]) {
        match cell {
            Cell::Point => self.points.push((set, nodes[0])),
            Cell::Link => {}
            Cell::Line | Cell::Line3 => self.lines.push((set, facet::<2>(nodes))),
            Cell::Element(kind) if cell.is_surface() => {
                self.faces.push(Element::new(kind, nodes, set));
            }
            Cell::Element(kind) => self.solids.push(Element::new(kind, nodes, set)),
        }
    }

    /// Leaves out the nodes in the middle of sides, faces and elements.
    pub fn drop_middles(&mut self) {
        fn corners<const D: usize>(elements: &mut [Element<D>])
        where
            ElementKind: Topology<D>,
        {
            for element in elements {
                *element = element.linear();
            }
        }
        self.notes.clear();
        corners(&mut self.faces);
        corners(&mut self.solids);
        for (_, line) in &mut self.lines {
            *line = facet::<2>(facet_corners(line));
        }
    }
}

impl GroupSets {
    /// Keeps one element of each set of copies, in all of their groups: MSH 2 writes an element in two physical groups
    /// twice, and merged files may hold parts twice. Returns notes on copies in the same groups.
    pub fn merge_copies<const D: usize>(
        &mut self,
        elements: &mut Vec<Element<D>>,
        nodes: &[[f64; D]],
    ) -> Result<Option<String>, String>
    where
        ElementKind: Topology<D>,
    {
        let mut unions = HashMap::new();
        let mut copies = Copies::default();
        copies::merge(
            elements,
            nodes.len(),
            |first, copy| -> Result<u32, String> {
                let sets = [first.region, copy.region];
                if sets[0] == sets[1] {
                    copies.add(copy);
                    return Ok(sets[0]);
                }
                match unions.get(&sets) {
                    Some(&union) => Ok(union),
                    None => Ok(*unions.entry(sets).or_insert(self.union(sets)?)),
                }
            },
        )?;
        Ok(copies.note(nodes))
    }

    /// The number of the union of two sets.
    fn union(&mut self, sets: [u32; 2]) -> Result<u32, String> {
        let all = sets.map(|set| self.sets[set as usize].clone());
        let union = self.number(all.concat().into_iter().map(|tag| tag as i64));
        if self.sets[union as usize].len() > MOST_GROUPS {
            return Err(format!(
                "an element is in more than {MOST_GROUPS} physical groups (sets)"
            ));
        }
        Ok(union)
    }
}
