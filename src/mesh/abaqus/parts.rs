//! The contents of a file: parts, their instances, and their nodes, elements, sets and surfaces.

use super::keyword::{Keyword, Lines, entries, key, label, number, plain};
use super::types::{cell, has_modes, note, order};
use super::{Failure, Result};
use crate::input::line_pieces;
use crate::mesh::ElementKind;
use crate::mesh::file::raw::{Cell, Numbers};
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// A part, or the data outside of all parts: a flat file, or the assembly.
#[derive(Default)]
pub(super) struct Part {
    pub nodes: Vec<[f64; 3]>,
    pub node_of: Numbers,
    /// The kind of each element, and the start of its node numbers.
    pub elements: Vec<(Cell, usize)>,
    /// The numbers of the nodes of all elements, in our order.
    pub labels: Vec<u64>,
    /// The instances, in capitals, whose nodes some of these are: elements of the assembly name `INSTANCE.5`.
    pub instances: HashMap<usize, String>,
    /// The line of each element.
    pub lines: Vec<usize>,
    pub element_of: Numbers,
    /// Those with incompatible modes.
    pub with_modes: HashSet<u32>,
    pub node_sets: Sets,
    pub element_sets: Sets,
    pub surfaces: BTreeMap<String, Surface>,
    /// The element sets that sections name, in capitals.
    pub sections: HashSet<String>,
}

/// Sets by their names in capitals.
pub(super) type Sets = BTreeMap<String, Set>;

/// A set of nodes or of elements.
#[derive(Default)]
pub(super) struct Set {
    /// As written in the file.
    pub name: String,
    /// Whether only surfaces use it.
    pub internal: bool,
    /// Each with the line that names it.
    pub members: Vec<(usize, Member)>,
}

/// A member of a set.
pub(super) enum Member {
    /// A node or an element: of an instance (in capitals), or of the part itself.
    One(Option<String>, u64),
    /// From, to, every so many.
    Range(Option<String>, [u64; 3]),
    /// Another set, in capitals; or a node or an element of an instance, as `NAME.5`.
    Set(String),
    /// All nodes of a set of elements, in capitals.
    NodesOf(String),
}

/// A surface.
pub(super) struct Surface {
    pub name: String,
    /// Whether it consists of nodes rather than of faces.
    pub of_nodes: bool,
    /// The line, a set or a number, and its side: `S3`, or empty.
    pub faces: Vec<(usize, String, String)>,
}

/// A part where it is placed.
pub(super) struct Instance {
    pub name: String,
    /// In capitals.
    pub part: String,
    pub line: usize,
    pub shift: [f64; 3],
    /// Two points of an axis, and degrees about it.
    pub turn: Option<[f64; 7]>,
    /// The number of data lines so far.
    rows: usize,
}

/// A file.
#[derive(Default)]
pub(super) struct Assembly {
    /// The data outside of parts.
    pub root: Part,
    /// Names as written, in the order of the file.
    pub parts: Vec<(String, Part)>,
    pub instances: Vec<Instance>,
    /// Notes on elements that are read as another type.
    pub notes: BTreeSet<String>,
    /// For a whole deck: unsupported types of elements, each with its line, its name and the reason. Their elements remain in
    /// the sets that name them, but are not in the mesh.
    pub unknown: Vec<(usize, String, String)>,
}

impl Assembly {
    /// Where a part is placed, by its name in capitals: the numbers of its instances. Without any instance parts stay as drawn.
    #[cfg(feature = "case")]
    pub(super) fn places(&self, part: &str) -> Vec<usize> {
        let of_instances = self.instances.iter().map(|one| one.part == part);
        let of_parts = self.parts.iter().map(|one| key(&one.0) == part);
        let all: Vec<bool> = match self.instances.is_empty() {
            true => of_parts.collect(),
            false => of_instances.collect(),
        };
        (0..all.len()).filter(|&number| all[number]).collect()
    }
}

/// The owner of the data lines.
enum Block<'a> {
    Skip,
    Nodes(Option<&'a str>),
    /// With incompatible modes or without.
    Elements(Cell, bool, Option<&'a str>),
    /// Elements of an unsupported type.
    Unknown(Option<&'a str>),
    Set {
        of_nodes: bool,
        key: String,
        instance: Option<String>,
        generate: bool,
    },
    Surface(String),
    Instance,
}

/// A file on its way.
#[derive(Default)]
struct Reader<'a> {
    assembly: Assembly,
    /// The open part.
    part: Option<usize>,
    in_instance: bool,
    /// An element whose nodes continue on the next line.
    begun: Vec<&'a str>,
    /// Whether unknown entries are collected, instead of refused at once.
    collects: bool,
}

/// Reads parts and assembly; of a whole deck, it `collects` the types of elements that are not known.
pub(super) fn read(text: &str, collects: bool) -> Result<Assembly> {
    let mut reader = Reader {
        collects,
        ..Reader::default()
    };
    let mut block = Block::Skip;
    let mut lines = Lines::new(text);
    loop {
        let first = lines.taken + 1;
        reader.data(&block, first, lines.data())?;
        let Some((line, text)) = lines.next() else {
            break;
        };
        let Some(mut keyword) = Keyword::parse(line, text) else {
            continue;
        };
        keyword.complete(text, || lines.next().map(|(_, more)| more));
        reader.end_element(line)?;
        block = reader.keyword(&keyword)?;
    }
    reader.end_element(lines.taken)?;
    if reader.part.is_some() {
        return Err(Failure::line(
            lines.taken,
            "the file is cut short: a *PART has no *END PART",
        ));
    }
    Ok(reader.assembly)
}

impl<'a> Reader<'a> {
    fn current(&mut self) -> &mut Part {
        match self.part {
            Some(part) => &mut self.assembly.parts[part].1,
            None => &mut self.assembly.root,
        }
    }

    /// Opens the block of a keyword: a line of the match for each supported one.
    fn keyword(&mut self, k: &Keyword<'a>) -> Result<Block<'a>> {
        let refuse = |what: &str| Err(Failure::line(k.line, format!("*{}: {what}", k.name)));
        let option = |name| k.option(name).filter(|value| !value.is_empty());
        // Of a whole deck they are refused with all others.
        if let (false, Some(known)) = (self.collects, k.of_mesh())
            && let Some((_, text)) = k.unknown(known).next()
        {
            return Err(Failure::line(k.line, text));
        }
        if self.in_instance && matches!(k.name.as_str(), "NODE" | "ELEMENT") {
            self.open_own_part(k)?;
        }
        // A set inside an instance belongs to its part.
        let of_instance = match self.assembly.instances.last() {
            Some(instance) if self.in_instance && self.part.is_none() => Some(key(&instance.name)),
            _ => option("INSTANCE").map(key),
        };
        let set = |of_nodes: bool, key: String| Block::Set {
            of_nodes,
            key,
            instance: of_instance.clone(),
            generate: k.option("GENERATE").is_some(),
        };
        Ok(match k.name.as_str() {
            "NODE" => {
                if option("SYSTEM").is_some_and(|system| system != "R") {
                    return refuse("only rectangular coordinates are read (SYSTEM=R)");
                }
                Block::Nodes(option("NSET"))
            }
            "ELEMENT" => {
                let name = k.needed("TYPE")?;
                match cell(name, self.collects) {
                    Ok(cell) => {
                        self.assembly.notes.extend(note(name, self.collects));
                        Block::Elements(cell, has_modes(name), option("ELSET"))
                    }
                    Err(text) if self.collects => {
                        let unknown = (k.line, name.to_uppercase(), text);
                        self.assembly.unknown.push(unknown);
                        Block::Unknown(option("ELSET"))
                    }
                    Err(text) => return Err(Failure::line(k.line, text)),
                }
            }
            // Numbers of entities of Gmsh that meshio passes on as if they belonged to elements.
            "ELSET" if option("ELSET").is_some_and(|name| name == "gmsh:bounding_entities") => {
                Block::Skip
            }
            "NSET" => {
                let name = self.named_set(true, k, k.needed("NSET")?);
                if let Some(elements) = option("ELSET") {
                    let sets = &mut self.current().node_sets;
                    let set = sets.get_mut(&name).expect("made by its keyword");
                    set.members.push((k.line, Member::NodesOf(key(elements))));
                }
                set(true, name)
            }
            "ELSET" => set(false, self.named_set(false, k, k.needed("ELSET")?)),
            "SURFACE" => {
                let name = k.needed("NAME")?;
                let kind = option("TYPE").unwrap_or("ELEMENT").to_uppercase();
                if kind != "ELEMENT" && kind != "NODE" {
                    return Ok(Block::Skip);
                }
                let surface = Surface {
                    name: name.to_owned(),
                    of_nodes: kind == "NODE",
                    faces: Vec::new(),
                };
                if self.current().surfaces.insert(key(name), surface).is_some() {
                    let text = format!(
                        "\"{name}\" is stated twice: state all of its faces or nodes at once"
                    );
                    return refuse(&text);
                }
                Block::Surface(key(name))
            }
            "SOLID SECTION" => {
                self.current().sections.extend(option("ELSET").map(key));
                Block::Skip
            }
            "PART" => {
                let name = k.needed("NAME")?.to_owned();
                self.part = Some(self.assembly.parts.len());
                self.assembly.parts.push((name, Part::default()));
                Block::Skip
            }
            "END PART" => {
                self.part = None;
                Block::Skip
            }
            "INSTANCE" => {
                self.assembly.instances.push(Instance {
                    name: k.needed("NAME")?.to_owned(),
                    part: key(k.needed("PART")?),
                    line: k.line,
                    shift: [0.0; 3],
                    turn: None,
                    rows: 0,
                });
                self.in_instance = true;
                Block::Instance
            }
            "END INSTANCE" => {
                self.in_instance = false;
                self.part = None;
                Block::Skip
            }
            "NGEN" | "NFILL" | "NCOPY" | "ELGEN" | "ELCOPY" | "NMAP" => {
                return refuse(
                    "nodes and elements must be listed one by one: let the program write a complete input file",
                );
            }
            "SYSTEM" => return refuse("coordinates must be global"),
            _ => Block::Skip,
        })
    }

    /// An instance with its own mesh has its own nodes and elements, and its part has none.
    fn open_own_part(&mut self, keyword: &Keyword) -> Result<()> {
        let instance = self.assembly.instances.last_mut();
        let (Some(instance), None) = (instance, self.part) else {
            return Ok(());
        };
        let parts = &mut self.assembly.parts;
        let has_nodes =
            |part: &&(String, Part)| key(&part.0) == instance.part && !part.1.nodes.is_empty();
        if parts.iter().any(|part| has_nodes(&part)) {
            return Err(Failure::line(
                keyword.line,
                "an instance has nodes or elements of its own beside those of its part: let the program write a flat file",
            ));
        }
        // No part of the file has this name.
        let name = format!("*{}", instance.name);
        instance.part = key(&name);
        self.part = Some(parts.len());
        parts.push((name, Part::default()));
        Ok(())
    }

    /// Makes a set, or reopens an existing one.
    fn named_set(&mut self, of_nodes: bool, keyword: &Keyword, name: &str) -> String {
        let internal = keyword.option("INTERNAL").is_some();
        let part = self.current();
        let sets = if of_nodes {
            &mut part.node_sets
        } else {
            &mut part.element_sets
        };
        let set = sets.entry(key(name)).or_default();
        set.name = plain(name).to_owned();
        set.internal |= internal;
        key(name)
    }

    /// The data lines of a block, from number `first` on.
    fn data(&mut self, block: &Block<'a>, first: usize, text: &'a str) -> Result<()> {
        match block {
            Block::Skip => Ok(()),
            Block::Nodes(set) => self.nodes(first, text, *set),
            Block::Elements(cell, modes, set) => self.elements(first, text, (*cell, *modes), *set),
            _ => data_lines(first, text).try_for_each(|(line, text)| self.line(block, line, text)),
        }
    }

    fn line(&mut self, block: &Block<'a>, line: usize, text: &'a str) -> Result<()> {
        match block {
            Block::Skip | Block::Nodes(_) | Block::Elements(..) => Ok(()),
            Block::Unknown(set) => self.unknown(line, text, *set),
            Block::Set {
                of_nodes,
                key,
                instance,
                generate,
            } => {
                let members = members(line, text, instance, *generate)?;
                let part = self.current();
                let sets = if *of_nodes {
                    &mut part.node_sets
                } else {
                    &mut part.element_sets
                };
                let set = sets.get_mut(key).expect("made by its keyword");
                set.members
                    .extend(members.into_iter().map(|member| (line, member)));
                Ok(())
            }
            Block::Surface(key) => {
                let mut entries = entries(text);
                let what = entries.next().unwrap_or_default().to_owned();
                let face = entries.next().unwrap_or_default().to_uppercase();
                if entries.next().is_some() {
                    return Err(Failure::line(
                        line,
                        "each line of a surface needs a set or an element number, and a side",
                    ));
                }
                let surface = self.current().surfaces.get_mut(key);
                let surface = surface.expect("made by its keyword");
                surface.faces.push((line, what, face));
                Ok(())
            }
            Block::Instance => self.placement(line, text),
        }
    }

    fn nodes(&mut self, first: usize, text: &str, set: Option<&str>) -> Result<()> {
        let read = |nodes: &mut Vec<_>, line: usize, text: &str| {
            let (label, x) = node(line, text)?;
            nodes.push((line, label, x));
            Ok(())
        };
        let part = self.current();
        let mut members = Vec::new();
        for (nodes, read) in in_parts(first, text, read) {
            for (line, label, x) in nodes {
                if !part.node_of.insert(label, part.nodes.len() as u32) {
                    let text = format!("node {label} is listed twice");
                    return Err(Failure::line(line, text));
                }
                part.nodes.push(x);
                members.push((line, label));
            }
            read?;
        }
        add(&mut part.node_sets, set, members);
        Ok(())
    }

    fn elements(
        &mut self,
        first: usize,
        text: &'a str,
        of: (Cell, bool),
        set: Option<&str>,
    ) -> Result<()> {
        let read = |listed: &mut Listed<'a>, line, text| listed.read(line, text, of);
        let part = self.current();
        let (mut members, mut begun) = (Vec::new(), Vec::new());
        for (listed, read) in in_parts(first, text, read) {
            let before = part.labels.len();
            let mut place = before;
            for (line, label, cell, modes) in listed.elements {
                let next = part.elements.len() as u32;
                if !part.element_of.insert(label, next) {
                    let text = format!("element {label} is listed twice");
                    return Err(Failure::line(line, text));
                }
                if modes {
                    part.with_modes.insert(next);
                }
                part.elements.push((cell, place));
                part.lines.push(line);
                members.push((line, label));
                place += cell.n_nodes();
            }
            part.labels.extend(listed.labels);
            let instances = listed.instances.into_iter();
            part.instances
                .extend(instances.map(|(at, of)| (before + at, of)));
            read?;
            begun = listed.begun;
        }
        add(&mut part.element_sets, set, members);
        self.begun = begun;
        Ok(())
    }

    /// An element of an unknown type: a point at its first node.
    fn unknown(&mut self, line: usize, text: &'a str, set: Option<&str>) -> Result<()> {
        self.begun.extend(entries(text));
        if text.ends_with(',') {
            return Ok(());
        }
        let all = std::mem::take(&mut self.begun);
        let element = label(line, all[0])?;
        let (instance, node) = match all.get(1) {
            Some(node) => node_of(line, node)?,
            None => (None, 0),
        };
        let part = self.current();
        let next = part.elements.len() as u32;
        part.element_of.insert(element, next);
        let place = part.labels.len();
        part.elements.push((Cell::Point, place));
        part.instances.extend(instance.map(|of| (place, of)));
        part.labels.push(node);
        part.lines.push(line);
        add(&mut part.element_sets, set, vec![(line, element)]);
        Ok(())
    }

    /// No element may be left open.
    fn end_element(&mut self, line: usize) -> Result<()> {
        if self.begun.is_empty() {
            return Ok(());
        }
        Err(Failure::line(
            line,
            "the element before it has too few nodes",
        ))
    }

    fn placement(&mut self, line: usize, text: &str) -> Result<()> {
        let mut numbers = Vec::new();
        for entry in entries(text).filter(|entry| !entry.is_empty()) {
            numbers.push(number(line, entry)?);
        }
        let instance = self.assembly.instances.last_mut();
        let instance = instance.expect("made by its keyword");
        instance.rows += 1;
        match (instance.rows, numbers.as_slice()) {
            (1, &[x, y, z]) => instance.shift = [x, y, z],
            (1, &[x, y]) => instance.shift = [x, y, 0.0],
            (2, turn) if turn.len() == 7 => {
                instance.turn = Some(std::array::from_fn(|i| turn[i]));
            }
            _ => {
                return Err(Failure::line(
                    line,
                    "an instance takes one line with its shift (3 numbers) and one with its rotation (7: two points \
                     and an angle in degrees)",
                ));
            }
        }
        Ok(())
    }
}

/// Lines with data, without blanks around them.
fn data_lines(first: usize, text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = (first..).zip(text.lines().map(str::trim));
    lines.filter(|(_, line)| !line.is_empty() && !line.starts_with("**"))
}

/// Bytes that one task reads.
const PIECE: usize = 1 << 16;

/// Reads data lines, on all threads: in parts that keep their order, each up to the first error. No part ends where a line continues on
/// the next one.
fn in_parts<'a, P: Default + Send>(
    first: usize,
    text: &'a str,
    read: impl Fn(&mut P, usize, &'a str) -> Result<()> + Sync,
) -> Vec<(P, Result<()>)> {
    let is_end = |&end: &usize| {
        let last = text[..end]
            .trim_end()
            .rsplit('\n')
            .next()
            .unwrap_or_default();
        end == text.len() || !last.ends_with(',') && !last.trim_start().starts_with("**")
    };
    let ends = line_pieces(text.as_bytes(), PIECE)
        .into_iter()
        .map(|piece| piece.end);
    let mut begin = 0;
    let pieces: Vec<&str> = (ends.filter(is_end))
        .map(|end| &text[std::mem::replace(&mut begin, end)..end])
        .collect();
    let counts: Vec<usize> = pieces.par_iter().map(|text| text.lines().count()).collect();
    let firsts: Vec<usize> = (counts.iter())
        .scan(first, |next, count| {
            Some(std::mem::replace(next, *next + count))
        })
        .collect();
    (pieces.into_par_iter().zip(firsts))
        .map(|(text, first)| {
            let mut part = P::default();
            let mut lines = data_lines(first, text);
            let read = lines.try_for_each(|(line, text)| read(&mut part, line, text));
            (part, read)
        })
        .collect()
}

/// A node: its number and its coordinates.
fn node(line: usize, text: &str) -> Result<(u64, [f64; 3])> {
    let mut all = entries(text);
    let node = label(line, all.next().unwrap_or_default())?;
    let mut x = [0.0; 3];
    for (x, entry) in x.iter_mut().zip(&mut all) {
        if !entry.is_empty() {
            *x = number(line, entry)?;
        }
    }
    // A node may have a normal after its coordinates, which shells use.
    if all.count() > 3 {
        return Err(Failure::line(
            line,
            format!("node {node} has more entries than coordinates and a direction"),
        ));
    }
    if !x.iter().all(|v| v.is_finite()) {
        return Err(Failure::line(
            line,
            format!("node {node} has a coordinate that is not finite"),
        ));
    }
    Ok((node, x))
}

/// Elements of some lines.
#[derive(Default)]
struct Listed<'a> {
    /// An element whose nodes continue on the next line.
    begun: Vec<&'a str>,
    /// The line of each, its number, its kind and whether it has incompatible modes.
    elements: Vec<(usize, u64, Cell, bool)>,
    /// The nodes of all, and the instances that some of these are of.
    labels: Vec<u64>,
    instances: Vec<(usize, String)>,
}

impl<'a> Listed<'a> {
    /// Reads an element, or a part of it where the line ends with a comma.
    fn read(&mut self, line: usize, text: &'a str, (cell, modes): (Cell, bool)) -> Result<()> {
        self.begun.extend(entries(text));
        let wanted = 1 + cell.n_nodes();
        if self.begun.len() < wanted && text.ends_with(',') {
            return Ok(());
        }
        let mut all = std::mem::take(&mut self.begun);
        while all.len() > wanted && all.last().is_some_and(|last| last.is_empty()) {
            all.pop();
        }
        // A beam may have one more node, for the orientation of its section.
        let most = wanted + usize::from(matches!(cell, Cell::Line | Cell::Line3));
        if !(wanted..=most).contains(&all.len()) {
            return Err(Failure::line(
                line,
                format!(
                    "an element of this type has {} nodes, but {} are given",
                    cell.n_nodes(),
                    all.len() - 1
                ),
            ));
        }
        let element = label(line, all[0])?;
        let middles = &all[1 + cell.n_corners()..wanted];
        if middles
            .iter()
            .any(|entry| *entry == "0" || entry.is_empty())
        {
            return Err(Failure::line(
                line,
                "this element of second order lacks some midside nodes: write all of its nodes",
            ));
        }
        let listed = (all[1..wanted].iter()).map(|entry| node_of(line, entry));
        let mut listed = listed.collect::<Result<Vec<_>>>()?;
        let again = (1..listed.len()).find(|&k| listed[..k].contains(&listed[k]));
        let (cell, modes) = match (cell, again) {
            // A quadrilateral of which two neighbouring corners are one is a triangle.
            (Cell::Element(ElementKind::Quad), Some(k))
                if listed[k] == listed[k - 1] || listed[k] == listed[(k + 1) % 4] =>
            {
                listed.remove(k);
                (Cell::Element(ElementKind::Triangle), false)
            }
            (Cell::Element(_), Some(k)) => {
                let node = listed[k].1;
                let text = match k < cell.n_corners() {
                    true => format!(
                        "element {element} has node {node} at several corners: collapsed elements are not supported, use triangles, \
                         wedges or pyramids"
                    ),
                    false => format!(
                        "element {element} has node {node} twice: nodes in the middle of sides and faces are nodes of their own"
                    ),
                };
                return Err(Failure::line(line, text));
            }
            _ => (cell, modes),
        };
        self.elements.push((line, element, cell, modes));
        let listed = match order(cell) {
            Some(order) => order.iter().map(|&place| listed[place].clone()).collect(),
            None => listed,
        };
        for (instance, label) in listed {
            let place = self.labels.len();
            self.instances.extend(instance.map(|of| (place, of)));
            self.labels.push(label);
        }
        Ok(())
    }
}

/// The number of a node, and the instance in capitals that has it: `INSTANCE.5` in elements of the assembly.
fn node_of(line: usize, entry: &str) -> Result<(Option<String>, u64)> {
    match entry.rsplit_once('.') {
        Some((of, number)) => Ok((Some(key(of)), label(line, number)?)),
        None => Ok((None, label(line, entry)?)),
    }
}

/// Adds nodes or elements, each with its line, to the set that their keyword names.
fn add(sets: &mut Sets, name: Option<&str>, members: Vec<(usize, u64)>) {
    let Some(name) = name.filter(|_| !members.is_empty()) else {
        return;
    };
    let set = sets.entry(key(name)).or_default();
    if set.name.is_empty() {
        set.name = plain(name).to_owned();
    }
    let members = members.into_iter();
    (set.members).extend(members.map(|(line, member)| (line, Member::One(None, member))));
}

/// The members in a data line of a set.
fn members(
    line: usize,
    text: &str,
    instance: &Option<String>,
    generate: bool,
) -> Result<Vec<Member>> {
    let all: Vec<&str> = entries(text).filter(|entry| !entry.is_empty()).collect();
    if generate {
        let mut range = [0, 0, 1];
        if all.len() < 2 || all.len() > 3 {
            return Err(Failure::line(
                line,
                "GENERATE takes the first number, the last one and the step",
            ));
        }
        for (place, entry) in range.iter_mut().zip(&all) {
            *place = label(line, entry)?;
        }
        let [first, last, _] = range;
        if first > last {
            let text = format!("GENERATE counts up, and {first} is more than {last}");
            return Err(Failure::line(line, text));
        }
        return Ok(vec![Member::Range(instance.clone(), range)]);
    }
    let member = |entry: &&str| {
        if let Ok(label) = entry.parse() {
            return Member::One(instance.clone(), label);
        }
        Member::Set(match instance {
            Some(of) => format!("{of}.{}", key(entry)),
            None => key(entry),
        })
    };
    Ok(all.iter().map(member).collect())
}
