//! Gmsh meshes: MSH 2.0 to 2.2 and 4.1, ASCII and binary.
//!
//! Physical groups become groups of regions (surfaces) and boundaries (curves) under their names, or under their
//! numbers where they have none. Elements in the same groups are a region, named after these.
//! Linear triangles and quadrilaterals in the plane z = const.

use super::{Element, Mesh, MeshError};
use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

/// Why a Gmsh file could not be read.
#[derive(Debug, thiserror::Error)]
pub enum GmshError {
    #[error("cannot read {}: {source}", path.display())]
    Io {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{}, {place}: {message}", path.display())]
    Format {
        path: PathBuf,
        place: String,
        message: String,
    },
    #[error("{}: this is {what}", path.display())]
    Foreign { path: PathBuf, what: String },
    #[error("{}: {source}", path.display())]
    Mesh { path: PathBuf, source: MeshError },
}

/// Reads a mesh; coordinates are multiplied by `scale`.
pub fn read(path: &Path, scale: f64) -> Result<Mesh, GmshError> {
    let bytes = std::fs::read(path).map_err(|source| GmshError::Io {
        path: path.to_owned(),
        source,
    })?;
    if let Some(what) = foreign(path, &bytes) {
        let path = path.to_owned();
        return Err(GmshError::Foreign { path, what });
    }
    parse(&bytes, scale).map_err(|error| match error {
        Failure::Format { place, message } => GmshError::Format {
            path: path.to_owned(),
            place,
            message,
        },
        Failure::Mesh(source) => GmshError::Mesh {
            path: path.to_owned(),
            source,
        },
    })
}

/// What Notepad and others put in front of a text.
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// What a file is that is no mesh of Gmsh, as far as it can be told, and what to do about it.
fn foreign(path: &Path, bytes: &[u8]) -> Option<String> {
    let bytes = bytes.strip_prefix(BYTE_ORDER_MARK).unwrap_or(bytes);
    let bytes = bytes.trim_ascii_start();
    if bytes.is_empty() {
        return Some("an empty file: save the mesh again".to_owned());
    }
    // Nastran begins comments with a dollar and a blank.
    if bytes[0] == b'$' && bytes.get(1).is_some_and(u8::is_ascii_alphabetic) {
        return None;
    }
    let head = String::from_utf8_lossy(&bytes[..bytes.len().min(1 << 16)]).to_lowercase();
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_lowercase();
    let begins = |what: &[&str]| what.iter().any(|what| head.starts_with(what));
    let holds = |what: &[&str]| what.iter().any(|what| head.contains(what));
    let named = |what: &[&str]| what.contains(&extension.as_str());
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let anew =
        "make the mesh in Gmsh, or convert it, with physical groups, and save it as MSH 4.1 or 2.2";
    Some(if begins(&["version https://git-lfs"]) {
        "a Git LFS pointer, not the mesh: git lfs pull".to_owned()
    } else if begins(&["<!doctype html", "<html"]) {
        "an HTML page, not the mesh: what the server sent instead; download the file itself"
            .to_owned()
    } else if bytes.starts_with(b"\x1f\x8b") || bytes.starts_with(b"PK\x03\x04") {
        "a compressed file: unpack it first".to_owned()
    } else if begins(&["# vtk datafile"]) || holds(&["<vtkfile"]) || named(&["vtk", "vtu"]) {
        format!("a VTK file, not a Gmsh mesh: {anew}")
    } else if begins(&["iso-10303-21"]) || named(&["step", "stp", "iges", "igs", "brep"]) {
        format!(
            "a geometry, not a mesh: mesh it first, with physical groups: open it in Gmsh, or by a script with \
             Merge \"{name}\";"
        )
    } else if holds(&["facet normal"]) || named(&["stl"]) {
        format!("an STL file, a surface without regions and boundaries: {anew}")
    } else if holds(&["*heading", "*node\n", "*node\r", "*node,"]) || named(&["inp"]) {
        format!("an Abaqus input file, not a Gmsh mesh: {anew}")
    } else if named(&["geo", "geo_unrolled"])
        || holds(&[
            "setfactory(",
            "physical surface(",
            "plane surface(",
            "curve loop(",
            "line loop(",
        ])
    {
        format!("a script for Gmsh, not the mesh: mesh it first: gmsh -2 {stem}.geo -o {stem}.msh")
    } else {
        format!("no Gmsh MSH file: it does not begin with $MeshFormat: {anew}")
    })
}

/// What [`parse`] complains of.
#[derive(Debug)]
enum Failure {
    Format { place: String, message: String },
    Mesh(MeshError),
}

/// The bytes with a place in them.
struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    binary: bool,
    swapped: bool,
}

type Result_<T> = Result<T, Failure>;

impl<'a> Reader<'a> {
    fn fail<T>(&self, message: impl Into<String>) -> Result_<T> {
        let line = 1 + self.bytes[..self.at.min(self.bytes.len())]
            .iter()
            .filter(|&&b| b == b'\n')
            .count();
        let place = if self.binary {
            format!("byte {}", self.at)
        } else {
            format!("line {line}")
        };
        Err(Failure::Format {
            place,
            message: message.into(),
        })
    }

    /// The next line without its end; None at the end of the file. What is not UTF-8 is taken for Latin-1,
    /// in which older editors write names.
    fn line(&mut self) -> Option<Cow<'a, str>> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (end + 1).min(rest.len());
        Some(match std::str::from_utf8(&rest[..end]) {
            Ok(line) => line.into(),
            Err(_) => rest[..end].iter().map(|&byte| char::from(byte)).collect(),
        })
    }

    fn token(&mut self) -> Result_<&'a str> {
        let rest = &self.bytes[self.at..];
        let skip = rest
            .iter()
            .position(|b| !b.is_ascii_whitespace())
            .unwrap_or(rest.len());
        let rest = &rest[skip..];
        let end = rest
            .iter()
            .position(|b| b.is_ascii_whitespace())
            .unwrap_or(rest.len());
        if end == 0 {
            return self.fail("the file ends in the middle of a section");
        }
        self.at += skip + end;
        match std::str::from_utf8(&rest[..end]) {
            Ok(token) if !token.starts_with('$') => Ok(token),
            Ok(token) => {
                self.at -= end;
                self.fail(format!(
                    "found {token} where a number was expected: the section is cut short"
                ))
            }
            Err(_) => self.fail("not text: is this a binary file with an ASCII header?"),
        }
    }

    fn raw<const N: usize>(&mut self) -> Result_<[u8; N]> {
        let Some(bytes) = self.bytes.get(self.at..self.at + N) else {
            return self.fail("the file ends in the middle of a section");
        };
        self.at += N;
        let mut raw: [u8; N] = bytes.try_into().expect("N bytes");
        if self.swapped {
            raw.reverse();
        }
        Ok(raw)
    }

    fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result_<T> {
        let token = self.token()?;
        match token.parse() {
            Ok(value) => Ok(value),
            Err(_) => self.fail(format!("\"{token}\" is not {what}")),
        }
    }

    /// A C int.
    fn int(&mut self) -> Result_<i64> {
        if self.binary {
            Ok(i64::from(i32::from_le_bytes(self.raw()?)))
        } else {
            self.number("an integer")
        }
    }

    /// A size_t (MSH 4.1).
    fn size(&mut self) -> Result_<usize> {
        let value = if self.binary {
            u64::from_le_bytes(self.raw()?)
        } else {
            self.number("a non-negative integer")?
        };
        // A count larger than the file is nonsense, and nothing to allocate for.
        usize::try_from(value)
            .ok()
            .filter(|&v| v < (1 << 48))
            .map_or_else(
                || self.fail(format!("{value} is not a sensible number")),
                Ok,
            )
    }

    fn float(&mut self) -> Result_<f64> {
        if self.binary {
            Ok(f64::from_le_bytes(self.raw()?))
        } else {
            self.number("a number")
        }
    }

    /// The number of a node.
    fn tag(&mut self) -> Result_<usize> {
        let tag = self.int()?;
        usize::try_from(tag).or_else(|_| self.fail(format!("{tag} is not the number of a node")))
    }

    /// Moves behind the line `$End…` of a section.
    fn end(&mut self, section: &str) -> Result_<()> {
        let marker = format!("$End{section}");
        let rest = &self.bytes[self.at..];
        match rest
            .windows(marker.len())
            .position(|w| w == marker.as_bytes())
        {
            // Elements that a wrong count hides would be a hole in the body.
            Some(place)
                if matches!(section, "Nodes" | "ParametricNodes" | "Elements")
                    && !rest[..place].trim_ascii().is_empty() =>
            {
                self.fail(format!(
                    "${section} goes on behind the number of entries that it begins with"
                ))
            }
            Some(place) => {
                self.at += place;
                self.line();
                Ok(())
            }
            None => self.fail(format!("{marker} is missing: the file is cut short")),
        }
    }
}

/// More groups of one element are nonsense, and no reason to keep long sets for each.
const MOST_GROUPS: usize = 255;

/// Sets of physical groups; elements refer to them by number, since few differ. Number 0 is that of none.
struct GroupSets {
    sets: Vec<Vec<u64>>,
    numbers: HashMap<Vec<u64>, u32>,
}

impl GroupSets {
    /// The number of a set. A negative tag means that the group turns the entity around.
    fn number(&mut self, tags: impl IntoIterator<Item = i64>) -> u32 {
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

/// From the numbers of nodes in the file to ours: a table, as far as those are dense.
#[derive(Default)]
struct NodeNumbers {
    table: Vec<u32>,
    others: HashMap<usize, u32>,
}

impl NodeNumbers {
    const NONE: u32 = u32::MAX;

    fn get(&self, tag: usize) -> Option<u32> {
        match self.table.get(tag) {
            Some(&node) if node != Self::NONE => Some(node),
            _ if self.others.is_empty() => None,
            _ => self.others.get(&tag).copied(),
        }
    }

    fn insert(&mut self, tag: usize, node: u32) {
        // No file makes the table much longer than there are nodes.
        if tag >= self.table.len() && tag <= 4 * node as usize + 1000 {
            self.table.resize(tag + 1, Self::NONE);
        }
        match self.table.get_mut(tag) {
            Some(place) => *place = node,
            None => {
                self.others.insert(tag, node);
            }
        }
    }
}

/// What the sections add up to.
struct Raw {
    /// Names of physical groups by (dimension, tag).
    names: HashMap<(i64, u64), String>,
    groups: GroupSets,
    /// Sets of physical groups of entities by (dimension, tag), MSH 4.1.
    entities: HashMap<(i64, i64), u32>,
    nodes: Vec<[f64; 3]>,
    numbers: NodeNumbers,
    /// (set of physical groups, nodes) of lines.
    lines: Vec<(u32, [u32; 2])>,
    /// Triangles and quadrilaterals; the region is the number of the set of physical groups.
    faces: Vec<Element>,
}

fn parse(bytes: &[u8], scale: f64) -> Result<Mesh, Failure> {
    let mut reader = Reader {
        bytes,
        at: if bytes.starts_with(BYTE_ORDER_MARK) {
            3
        } else {
            0
        },
        binary: false,
        swapped: false,
    };
    let mut raw = Raw {
        names: HashMap::new(),
        groups: GroupSets {
            sets: vec![Vec::new()],
            numbers: HashMap::from([(Vec::new(), 0)]),
        },
        entities: HashMap::new(),
        nodes: Vec::new(),
        numbers: NodeNumbers::default(),
        lines: Vec::new(),
        faces: Vec::new(),
    };
    let mut version = None;
    while let Some(line) = reader.line() {
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        let Some(section) = line.strip_prefix('$') else {
            return reader.fail(format!(
                "expected the beginning of a section, found \"{line}\""
            ));
        };
        if matches!((section, version), ("NOD" | "NOE", None)) {
            return reader.fail(format!("MSH version 1 is not supported: {SAVE_AS}"));
        }
        if version.is_none() && section != "MeshFormat" && section != "Comments" {
            return reader.fail("this is no Gmsh MSH file: it does not begin with $MeshFormat");
        }
        match (section, version) {
            ("MeshFormat", _) => version = Some(read_format(&mut reader)?),
            ("PhysicalNames", _) => read_names(&mut reader, &mut raw)?,
            ("Entities", Some(4)) => read_entities(&mut reader, &mut raw)?,
            ("Nodes", Some(4)) => read_nodes_4(&mut reader, &mut raw)?,
            ("Nodes", _) => read_nodes_2(&mut reader, &mut raw, false)?,
            ("ParametricNodes", Some(2)) => read_nodes_2(&mut reader, &mut raw, true)?,
            ("Elements", Some(4)) => read_elements_4(&mut reader, &mut raw)?,
            ("Elements", _) => read_elements_2(&mut reader, &mut raw)?,
            ("PartitionedEntities", _) => {
                return reader
                    .fail("partitioned meshes are not supported: save the mesh unpartitioned");
            }
            _ => {}
        }
        reader.end(section)?;
    }
    if version.is_none() {
        return reader.fail("there is no $MeshFormat: the file is cut short");
    }
    build(raw, &reader, scale)
}

const SAVE_AS: &str = "save as 4.1 or 2.2 (gmsh -format msh41 …)";

fn read_format(reader: &mut Reader) -> Result_<u32> {
    let line = reader.line().unwrap_or_default();
    let mut parts = line.split_whitespace();
    let name = parts.next().unwrap_or_default();
    let version = match name {
        "2" | "2.0" | "2.1" | "2.2" => 2,
        "4.1" => 4,
        _ => {
            return reader.fail(format!("MSH version {name} is not supported: {SAVE_AS}"));
        }
    };
    let binary = parts.next() == Some("1");
    let size = parts.next();
    if size != Some("8") {
        return reader.fail("only files with 8-byte numbers are supported");
    }
    if binary {
        reader.binary = true;
        if reader.int()? != 1 {
            reader.at -= 4;
            reader.swapped = true;
            if reader.int()? != 1 {
                return reader.fail("the byte order mark is not 1");
            }
        }
    }
    Ok(version)
}

/// Names are text in binary files, too.
fn read_names(reader: &mut Reader, raw: &mut Raw) -> Result_<()> {
    let binary = std::mem::replace(&mut reader.binary, false);
    let count: usize = reader.number("a number of physical names")?;
    reader.line();
    for _ in 0..count {
        let line = reader.line().unwrap_or_default();
        let line = line.trim();
        let mut parts = line.splitn(3, char::is_whitespace);
        let (dim, tag, name) = (parts.next(), parts.next(), parts.next());
        let parsed = dim
            .and_then(|d| d.parse().ok())
            .zip(tag.and_then(|t| t.parse::<i64>().ok()));
        let (Some((dim, tag)), Some(name)) = (parsed, name) else {
            return reader.fail(format!("\"{line}\" is not: dimension tag \"name\""));
        };
        let name = name.trim().trim_matches('"');
        if !name.is_empty() {
            let key = (dim, tag.unsigned_abs());
            raw.names.insert(key, name.to_owned());
        }
    }
    reader.binary = binary;
    Ok(())
}

fn read_entities(reader: &mut Reader, raw: &mut Raw) -> Result_<()> {
    let mut counts = [0; 4];
    for count in &mut counts {
        *count = reader.size()?;
    }
    for (dim, &count) in counts.iter().enumerate() {
        for _ in 0..count {
            let tag = reader.int()?;
            // A point has a place, the others a box.
            for _ in 0..if dim == 0 { 3 } else { 6 } {
                reader.float()?;
            }
            let n_groups = reader.size()?;
            if n_groups > MOST_GROUPS {
                return reader.fail(format!(
                    "entity {tag} is in more than {MOST_GROUPS} physical groups"
                ));
            }
            let mut groups = Vec::new();
            for _ in 0..n_groups {
                groups.push(reader.int()?);
            }
            let set = raw.groups.number(groups);
            raw.entities.insert((dim as i64, tag), set);
            if dim > 0 {
                for _ in 0..reader.size()? {
                    reader.int()?;
                }
            }
        }
    }
    Ok(())
}

impl Raw {
    fn add_node(&mut self, reader: &Reader, tag: usize, x: [f64; 3]) -> Result_<()> {
        if self.numbers.get(tag).is_some() {
            return reader.fail(format!("node {tag} stands twice"));
        }
        if !x.iter().all(|v| v.is_finite()) {
            return reader.fail(format!("node {tag} has a coordinate that is not finite"));
        }
        self.numbers.insert(tag, self.nodes.len() as u32);
        self.nodes.push(x);
        Ok(())
    }

    /// Adds an element of one of the kinds that [`nodes_of`] lets pass, with its nodes first in `tags`.
    fn add_element(
        &mut self,
        reader: &Reader,
        kind: i64,
        set: u32,
        tags: &[usize; 4],
        n_nodes: usize,
    ) -> Result_<()> {
        let mut nodes = [0; 4];
        for (node, tag) in nodes.iter_mut().zip(&tags[..n_nodes]) {
            *node = match self.numbers.get(*tag) {
                Some(node) => node,
                None => {
                    return reader
                        .fail(format!("an element names node {tag}, which does not exist"));
                }
            }
        }
        let [a, b, c, _] = nodes;
        match kind {
            1 => self.lines.push((set, [a, b])),
            2 => self.faces.push(Element::triangle([a, b, c], set)),
            3 => self.faces.push(Element::quad(nodes, set)),
            _ => {}
        }
        Ok(())
    }

    /// Lets every element stand once, in all groups of its copies: MSH 2 writes an element in two physical
    /// groups twice, and files that were merged may hold parts twice.
    fn merge_copies(&mut self, reader: &Reader) -> Result_<()> {
        // The elements by their lowest node: few share that.
        let lowest = |face: &Element| face.nodes.iter().copied().min().unwrap_or(0) as usize;
        let mut begin = vec![0u32; self.nodes.len() + 1];
        for face in &self.faces {
            begin[lowest(face) + 1] += 1;
        }
        for node in 0..self.nodes.len() {
            begin[node + 1] += begin[node];
        }
        let mut next = begin.clone();
        let mut order = vec![0u32; self.faces.len()];
        for (number, face) in (0..).zip(&self.faces) {
            let place = &mut next[lowest(face)];
            order[*place as usize] = number;
            *place += 1;
        }
        let key = |face: &Element| {
            let mut nodes = [face.nodes[0], face.nodes[1], face.nodes[2], u32::MAX];
            if face.len == 4 {
                nodes[3] = face.nodes[3];
            }
            nodes.sort_unstable();
            nodes
        };
        const COPY: u32 = u32::MAX;
        let mut unions = HashMap::new();
        let mut copies = false;
        for node in 0..self.nodes.len() {
            let same = &mut order[begin[node] as usize..begin[node + 1] as usize];
            if same.len() < 2 {
                continue;
            }
            same.sort_unstable_by_key(|&face| (key(&self.faces[face as usize]), face));
            let mut first = same[0] as usize;
            for &face in &same[1..] {
                let face = face as usize;
                if key(&self.faces[first]) != key(&self.faces[face]) {
                    first = face;
                    continue;
                }
                let sets = [self.faces[first].region, self.faces[face].region];
                if sets[0] != sets[1] {
                    let union = match unions.get(&sets) {
                        Some(&union) => union,
                        None => {
                            let all = sets.map(|set| self.groups.sets[set as usize].clone());
                            let tags = all.concat().into_iter().map(|tag| tag as i64);
                            let union = self.groups.number(tags);
                            if self.groups.sets[union as usize].len() > MOST_GROUPS {
                                return reader.fail(format!(
                                    "an element is in more than {MOST_GROUPS} physical groups"
                                ));
                            }
                            unions.insert(sets, union);
                            union
                        }
                    };
                    self.faces[first].region = union;
                }
                self.faces[face].region = COPY;
                copies = true;
            }
        }
        if copies {
            self.faces.retain(|face| face.region != COPY);
        }
        Ok(())
    }
}

/// Nodes of an element type of Gmsh that may stand in a plane mesh of first order.
fn nodes_of(reader: &Reader, kind: i64) -> Result_<usize> {
    match kind {
        15 => Ok(1),
        1 => Ok(2),
        2 => Ok(3),
        3 => Ok(4),
        8..=10 | 16 | 20..=28 => reader
            .fail("elements of higher order are not supported: set Mesh.ElementOrder = 1 in Gmsh"),
        4..=7 | 11..=14 | 17..=19 => {
            reader.fail("volume elements are not supported: the mesh must be plane")
        }
        _ => reader.fail(format!(
            "element type {kind} is not supported: use triangles and quadrilaterals"
        )),
    }
}

fn read_nodes_4(reader: &mut Reader, raw: &mut Raw) -> Result_<()> {
    let blocks = reader.size()?;
    for _ in 0..3 {
        reader.size()?;
    }
    for _ in 0..blocks {
        let dim = reader.int()?;
        reader.int()?;
        let parametric = reader.int()? != 0;
        let count = reader.size()?;
        let mut tags = Vec::new();
        for _ in 0..count {
            tags.push(reader.size()?);
        }
        for tag in tags {
            let x = [reader.float()?, reader.float()?, reader.float()?];
            for _ in 0..if parametric { dim } else { 0 } {
                reader.float()?;
            }
            raw.add_node(reader, tag, x)?;
        }
    }
    Ok(())
}

fn read_elements_4(reader: &mut Reader, raw: &mut Raw) -> Result_<()> {
    let blocks = reader.size()?;
    for _ in 0..3 {
        reader.size()?;
    }
    for _ in 0..blocks {
        let (dim, tag, kind) = (reader.int()?, reader.int()?, reader.int()?);
        let count = reader.size()?;
        let n_nodes = nodes_of(reader, kind)?;
        let set = raw.entities.get(&(dim, tag)).copied().unwrap_or(0);
        let mut tags = [0; 4];
        for _ in 0..count {
            reader.size()?;
            for tag in &mut tags[..n_nodes] {
                *tag = reader.size()?;
            }
            raw.add_element(reader, kind, set, &tags, n_nodes)?;
        }
    }
    Ok(())
}

/// The nodes of MSH 2; `parametric` ones also say where they lie on which curve or surface.
fn read_nodes_2(reader: &mut Reader, raw: &mut Raw, parametric: bool) -> Result_<()> {
    let count = count_line(reader, "nodes")?;
    for _ in 0..count {
        let tag = reader.tag()?;
        let x = [reader.float()?, reader.float()?, reader.float()?];
        if parametric {
            let dim = reader.int()?;
            reader.int()?;
            for _ in 0..if dim == 1 || dim == 2 { dim } else { 0 } {
                reader.float()?;
            }
        }
        raw.add_node(reader, tag, x)?;
    }
    Ok(())
}

fn read_elements_2(reader: &mut Reader, raw: &mut Raw) -> Result_<()> {
    let total = count_line(reader, "elements")?;
    let mut read = 0;
    // The tag of the last element and the number of its set: the next one mostly has the same.
    let (mut last, mut set) = (0, 0);
    while read < total {
        // Binary files have a header for each run of one type; in ASCII every element says its own.
        let (kind, count, n_tags) = if reader.binary {
            (reader.int()?, reader.int()?, reader.int()?)
        } else {
            reader.int()?;
            (reader.int()?, 1, reader.int()?)
        };
        let n_nodes = nodes_of(reader, kind)?;
        if count < 1 || !(0..1000).contains(&n_tags) {
            return reader.fail("the header of a run of elements makes no sense");
        }
        for _ in 0..count {
            if reader.binary {
                reader.int()?;
            }
            // The first tag is the physical group; 0 means none.
            let group = if n_tags > 0 { reader.int()? } else { 0 };
            for _ in 1..n_tags {
                reader.int()?;
            }
            if group != last {
                (last, set) = (group, raw.groups.number([group]));
            }
            let mut nodes = [0; 4];
            for node in &mut nodes[..n_nodes] {
                *node = reader.tag()?;
            }
            raw.add_element(reader, kind, set, &nodes, n_nodes)?;
        }
        read += count as usize;
    }
    Ok(())
}

/// The count at the beginning of a section of MSH 2.2: text in binary files, too.
fn count_line(reader: &mut Reader, what: &str) -> Result_<usize> {
    let line = reader.line().unwrap_or_default();
    let line = line.trim();
    match line.parse() {
        Ok(count) => Ok(count),
        Err(_) => reader.fail(format!("\"{line}\" is not a number of {what}")),
    }
}

fn build(mut raw: Raw, reader: &Reader, scale: f64) -> Result<Mesh, Failure> {
    let extent = raw
        .nodes
        .iter()
        .flatten()
        .fold(0.0, |a: f64, v| a.max(v.abs()));
    if let Some(first) = raw.nodes.first()
        && raw
            .nodes
            .iter()
            .any(|x| (x[2] - first[2]).abs() > 1e-9 * extent)
    {
        return reader.fail("the mesh is not plane: its z coordinates differ");
    }
    if raw.faces.is_empty() {
        return reader.fail(
            "no triangles or quadrilaterals: give the surface a physical group, or set Mesh.SaveAll = 1",
        );
    }
    if raw.groups.sets.len() == 1 && raw.names.keys().any(|&(dim, _)| dim == 1 || dim == 2) {
        // That is what MSH 2 makes of them with Mesh.SaveAll = 1.
        return reader.fail(
            "the file names physical groups, but no element is in one: save it with Mesh.SaveAll = 0, or as MSH 4.1",
        );
    }
    raw.merge_copies(reader)?;

    // The names of each set; two tags may have the same one.
    let names = |dim: i64, set: u32| -> Vec<String> {
        let mut names: Vec<String> = Vec::new();
        for &tag in &raw.groups.sets[set as usize] {
            let name = match raw.names.get(&(dim, tag)) {
                Some(name) => name.clone(),
                None => tag.to_string(),
            };
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    };
    let mut regions: Vec<String> = Vec::new();
    let mut groups: BTreeMap<String, Vec<u32>> = BTreeMap::new();
    let mut region_of_names: HashMap<Vec<String>, u32> = HashMap::new();
    let mut region_of_set: Vec<Option<u32>> = vec![None; raw.groups.sets.len()];
    let mut elements = std::mem::take(&mut raw.faces);
    for element in &mut elements {
        let region = &mut region_of_set[element.region as usize];
        element.region = *region.get_or_insert_with(|| {
            let mut names = names(2, element.region);
            if names.is_empty() {
                names.push("unnamed".to_owned());
            }
            *region_of_names.entry(names).or_insert_with_key(|names| {
                let region = regions.len() as u32;
                for name in names {
                    groups.entry(name.clone()).or_default().push(region);
                }
                regions.push(names.join(" & "));
                region
            })
        });
    }
    for (region, name) in (0..).zip(&regions) {
        // A group that is called like this already keeps its name for itself.
        groups.entry(name.clone()).or_insert_with(|| vec![region]);
    }

    let mut lines = std::mem::take(&mut raw.lines);
    lines.sort_by_key(|line| line.0);
    let mut boundaries: BTreeMap<String, Vec<[u32; 2]>> = BTreeMap::new();
    for lines in lines.chunk_by(|a, b| a.0 == b.0) {
        for name in names(1, lines[0].0) {
            let edges = boundaries.entry(name).or_default();
            edges.extend(lines.iter().map(|line| line.1));
        }
    }
    let nodes = raw
        .nodes
        .iter()
        .map(|x| [x[0] * scale, x[1] * scale])
        .collect();
    let mut mesh = Mesh::new(nodes, elements, regions, boundaries).map_err(Failure::Mesh)?;
    mesh.groups = groups;
    Ok(mesh)
}
