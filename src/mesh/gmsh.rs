//! Gmsh meshes: MSH 2.2 and 4.1, ASCII and binary.
//!
//! Physical groups become regions (surfaces) and boundaries (curves) under their names, or under their
//! numbers where they have none. Linear triangles and quadrilaterals in the plane z = const.

use super::{Element, Mesh, MeshError};
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
    #[error("{}: {source}", path.display())]
    Mesh { path: PathBuf, source: MeshError },
}

/// Reads a mesh; coordinates are multiplied by `scale`.
pub fn read(path: &Path, scale: f64) -> Result<Mesh, GmshError> {
    let bytes = std::fs::read(path).map_err(|source| GmshError::Io {
        path: path.to_owned(),
        source,
    })?;
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

    /// The next line without its end; None at the end of the file.
    fn line(&mut self) -> Option<&'a str> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (end + 1).min(rest.len());
        std::str::from_utf8(&rest[..end])
            .ok()
            .map(|line| line.trim_end_matches('\r'))
            .or(Some(""))
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

    /// Moves behind the line `$End…` of a section.
    fn end(&mut self, section: &str) -> Result_<()> {
        let marker = format!("$End{section}");
        let rest = &self.bytes[self.at..];
        match rest
            .windows(marker.len())
            .position(|w| w == marker.as_bytes())
        {
            Some(place) => {
                self.at += place;
                self.line();
                Ok(())
            }
            None => self.fail(format!("{marker} is missing: the file is cut short")),
        }
    }
}

/// What the sections add up to.
#[derive(Default)]
struct Raw {
    /// Names of physical groups by (dimension, tag).
    names: HashMap<(i64, i64), String>,
    /// Physical groups of entities by (dimension, tag), MSH 4.1.
    groups: HashMap<(i64, i64), Vec<i64>>,
    nodes: Vec<[f64; 3]>,
    number: HashMap<usize, u32>,
    /// (physical groups, nodes) of lines.
    lines: Vec<(Vec<i64>, [u32; 2])>,
    /// (physical groups, nodes) of triangles and quadrilaterals.
    faces: Vec<(Vec<i64>, Vec<u32>)>,
}

fn parse(bytes: &[u8], scale: f64) -> Result<Mesh, Failure> {
    let mut reader = Reader {
        bytes,
        at: 0,
        binary: false,
        swapped: false,
    };
    let mut raw = Raw::default();
    let mut version = None;
    while let Some(line) = reader.line() {
        let line = line.trim();
        if line.is_empty() {
            continue;
        }
        let Some(section) = line.strip_prefix('$') else {
            let before = version.is_none();
            return reader.fail(if before {
                "this is no Gmsh MSH file: it does not begin with $MeshFormat".to_owned()
            } else {
                format!("expected the beginning of a section, found \"{line}\"")
            });
        };
        if version.is_none() && section != "MeshFormat" && section != "Comments" {
            return reader.fail("this is no Gmsh MSH file: it does not begin with $MeshFormat");
        }
        match (section, version) {
            ("MeshFormat", _) => version = Some(read_format(&mut reader)?),
            ("PhysicalNames", _) => read_names(&mut reader, &mut raw)?,
            ("Entities", Some(4)) => read_entities(&mut reader, &mut raw)?,
            ("Nodes", Some(4)) => read_nodes_4(&mut reader, &mut raw)?,
            ("Nodes", _) => read_nodes_2(&mut reader, &mut raw)?,
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
        return reader.fail("the file is empty");
    }
    build(raw, &reader, scale)
}

fn read_format(reader: &mut Reader) -> Result_<u32> {
    let line = reader.line().unwrap_or_default();
    let mut parts = line.split_whitespace();
    let name = parts.next().unwrap_or_default();
    let version = match name {
        "2.2" | "2" => 2,
        "4.1" => 4,
        _ => {
            return reader.fail(format!(
                "MSH version {name} is not supported: save as 4.1 or 2.2 (gmsh -format msh41 …)"
            ));
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
        let line = reader.line().unwrap_or_default().trim();
        let mut parts = line.splitn(3, char::is_whitespace);
        let (dim, tag, name) = (parts.next(), parts.next(), parts.next());
        let parsed = dim
            .and_then(|d| d.parse().ok())
            .zip(tag.and_then(|t| t.parse().ok()));
        let (Some(key), Some(name)) = (parsed, name) else {
            return reader.fail(format!("\"{line}\" is not: dimension tag \"name\""));
        };
        raw.names
            .insert(key, name.trim().trim_matches('"').to_owned());
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
            let mut groups = Vec::new();
            for _ in 0..n_groups {
                groups.push(reader.int()?);
            }
            raw.groups.insert((dim as i64, tag), groups);
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
        if self.number.insert(tag, self.nodes.len() as u32).is_some() {
            return reader.fail(format!("node {tag} stands twice"));
        }
        self.nodes.push(x);
        Ok(())
    }

    fn add_element(
        &mut self,
        reader: &Reader,
        kind: i64,
        groups: &[i64],
        tags: &[usize],
    ) -> Result_<()> {
        let mut nodes = Vec::with_capacity(tags.len());
        for tag in tags {
            match self.number.get(tag) {
                Some(&node) => nodes.push(node),
                None => {
                    return reader
                        .fail(format!("an element names node {tag}, which does not exist"));
                }
            }
        }
        match kind {
            1 => self.lines.push((groups.to_vec(), [nodes[0], nodes[1]])),
            2 | 3 => self.faces.push((groups.to_vec(), nodes)),
            _ => {}
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
        let groups = raw.groups.get(&(dim, tag)).cloned().unwrap_or_default();
        let mut tags = vec![0; n_nodes];
        for _ in 0..count {
            reader.size()?;
            for tag in &mut tags {
                *tag = reader.size()?;
            }
            raw.add_element(reader, kind, &groups, &tags)?;
        }
    }
    Ok(())
}

fn read_nodes_2(reader: &mut Reader, raw: &mut Raw) -> Result_<()> {
    let count = count_line(reader, "nodes")?;
    for _ in 0..count {
        let tag = reader.int()? as usize;
        let x = [reader.float()?, reader.float()?, reader.float()?];
        raw.add_node(reader, tag, x)?;
    }
    Ok(())
}

fn read_elements_2(reader: &mut Reader, raw: &mut Raw) -> Result_<()> {
    let total = count_line(reader, "elements")?;
    let mut read = 0;
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
            let mut tags = Vec::new();
            for _ in 0..n_tags {
                tags.push(reader.int()?);
            }
            let mut nodes = Vec::with_capacity(n_nodes);
            for _ in 0..n_nodes {
                nodes.push(reader.int()? as usize);
            }
            // The first tag is the physical group; 0 means none.
            let groups: Vec<i64> = tags
                .first()
                .copied()
                .filter(|&t| t != 0)
                .into_iter()
                .collect();
            raw.add_element(reader, kind, &groups, &nodes)?;
        }
        read += count as usize;
    }
    Ok(())
}

/// The count at the beginning of a section of MSH 2.2: text in binary files, too.
fn count_line(reader: &mut Reader, what: &str) -> Result_<usize> {
    let line = reader.line().unwrap_or_default().trim();
    match line.parse() {
        Ok(count) => Ok(count),
        Err(_) => reader.fail(format!("\"{line}\" is not a number of {what}")),
    }
}

fn build(raw: Raw, reader: &Reader, scale: f64) -> Result<Mesh, Failure> {
    let name = |dim: i64, tag: i64| {
        raw.names
            .get(&(dim, tag))
            .cloned()
            .unwrap_or_else(|| tag.to_string())
    };
    let z: Vec<f64> = raw.nodes.iter().map(|x| x[2]).collect();
    let extent = raw
        .nodes
        .iter()
        .flatten()
        .fold(0.0, |a: f64, v| a.max(v.abs()));
    if let Some(first) = z.first()
        && z.iter().any(|z| (z - first).abs() > 1e-9 * extent)
    {
        return reader.fail("the mesh is not plane: its z coordinates differ");
    }
    let mut regions: Vec<String> = Vec::new();
    let mut elements = Vec::with_capacity(raw.faces.len());
    for (groups, nodes) in &raw.faces {
        let region = match groups[..] {
            [] => "unnamed".to_owned(),
            [tag] => name(2, tag),
            _ => {
                let names: Vec<String> = groups.iter().map(|&tag| name(2, tag)).collect();
                return reader.fail(format!(
                    "a surface belongs to several physical groups ({}): an element needs one region",
                    names.join(", ")
                ));
            }
        };
        let region = match regions.iter().position(|r| *r == region) {
            Some(place) => place,
            None => {
                regions.push(region);
                regions.len() - 1
            }
        } as u32;
        elements.push(match nodes[..] {
            [a, b, c] => Element::triangle([a, b, c], region),
            [a, b, c, d] => Element::quad([a, b, c, d], region),
            _ => unreachable!("faces have three or four nodes"),
        });
    }
    if elements.is_empty() && !raw.nodes.is_empty() {
        return reader.fail(
            "no triangles or quadrilaterals: give the surface a physical group, or set Mesh.SaveAll = 1",
        );
    }
    let mut boundaries: BTreeMap<String, Vec<[u32; 2]>> = BTreeMap::new();
    for (groups, edge) in &raw.lines {
        for &tag in groups {
            boundaries.entry(name(1, tag)).or_default().push(*edge);
        }
    }
    let nodes = raw
        .nodes
        .iter()
        .map(|x| [x[0] * scale, x[1] * scale])
        .collect();
    Mesh::new(nodes, elements, regions, boundaries).map_err(Failure::Mesh)
}
