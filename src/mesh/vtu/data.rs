//! Arrays of a grid: ASCII, base64 or raw, inline or appended, plain or compressed.

use super::xml::{self, Document, Node};
use super::{Failure, Result, no_mesh};
use crate::input::pieces;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use rayon::prelude::*;
use std::io::Read as _;
use std::str::FromStr;

/// Bytes that one task reads: whole groups of base64.
const PIECE: usize = 1 << 16;

/// A file with its arrays.
pub(super) struct File<'a> {
    document: Document<'a>,
    big: bool,
    /// Bytes of a length in front of data.
    word: usize,
    compressed: bool,
    /// Whether the data behind the elements is base64, not raw.
    encoded: bool,
}

/// The numbers of an array.
pub(super) enum Values {
    Integers(Vec<i64>),
    Floats(Vec<f64>),
}

impl Values {
    pub fn floats(self) -> Result<Vec<f64>> {
        match self {
            Self::Floats(values) => Ok(values),
            Self::Integers(values) => Ok(values.into_iter().map(|v| v as f64).collect()),
        }
    }

    pub fn integers(self) -> Result<Vec<i64>> {
        match self {
            Self::Integers(values) => Ok(values),
            Self::Floats(_) => no_mesh(
                "cells need integers (connectivity, offsets, types), but this array has floating-point numbers",
            ),
        }
    }
}

impl<'a> File<'a> {
    pub fn new(bytes: &'a [u8]) -> Result<Self> {
        let document = xml::read(bytes)?;
        let Some(root) = document.nodes.first().filter(|node| node.name == "VTKFile") else {
            return no_mesh(
                "this is not an XML VTK file: save it as .vtu (an unstructured grid), not as a legacy .vtk file",
            );
        };
        let kind = root.attribute("type").unwrap_or_default();
        if kind != "UnstructuredGrid" {
            return no_mesh(format!(
                "this is a file of type {kind}: save an unstructured grid"
            ));
        }
        let compressor = root.attribute("compressor").unwrap_or_default();
        if !matches!(compressor, "" | "vtkZLibDataCompressor") {
            return no_mesh(format!(
                "{compressor} is not supported: save it with zlib or uncompressed"
            ));
        }
        let big = root.attribute("byte_order") == Some("BigEndian");
        let word = match root.attribute("header_type") {
            Some("UInt64") => 8,
            _ => 4,
        };
        let pieces = (document.nodes.iter()).filter(|node| node.name == "Piece");
        match pieces.count() {
            1 => {}
            0 => return no_mesh("there is no <Piece> in it"),
            n => {
                return no_mesh(format!(
                    "the grid is in {n} pieces: merge them into one (in ParaView: Merge Blocks)"
                ));
            }
        }
        let appended = document.nodes.last();
        let encoded = appended.and_then(|node| node.attribute("encoding")) == Some("base64");
        Ok(Self {
            compressed: !compressor.is_empty(),
            big,
            word,
            encoded,
            document,
        })
    }

    /// The array of this name in `<of>`, or the first one.
    fn array(&self, of: &str, name: Option<&str>) -> Option<&Node<'a>> {
        self.document.nodes.iter().find(|node| {
            let parent = node.parent.map(|parent| self.document.nodes[parent].name);
            node.name == "DataArray"
                && parent == Some(of)
                && name.is_none_or(|name| node.attribute("Name") == Some(name))
        })
    }

    /// The names of the arrays with one number a cell.
    pub fn cell_arrays(&self) -> Vec<String> {
        let nodes = self.document.nodes.iter().filter(|node| {
            let parent = node.parent.map(|parent| self.document.nodes[parent].name);
            node.name == "DataArray"
                && parent == Some("CellData")
                && matches!(
                    node.attribute("NumberOfComponents"),
                    None | Some("" | "0" | "1")
                )
        });
        nodes
            .filter_map(|node| node.attribute("Name").map(str::to_owned))
            .collect()
    }

    /// The numbers of a required array.
    pub fn needed(&self, of: &str, name: Option<&str>) -> Result<Values> {
        match self.array(of, name) {
            Some(node) => self.values(node),
            None => no_mesh(format!(
                "there is no array {}in <{of}>",
                name.map_or(String::new(), |name| format!("\"{name}\" "))
            )),
        }
    }

    fn values(&self, node: &Node) -> Result<Values> {
        let kind = node.attribute("type").unwrap_or_default();
        let fail = |message: String| Failure::line(node.line, message);
        let bytes = match node.attribute("format").unwrap_or("ascii") {
            "ascii" => return ascii(node, kind),
            "binary" => self.inline(node)?,
            "appended" => self.appended(node)?,
            other => return Err(fail(format!("the format {other} is not known"))),
        };
        let big = self.big;
        // Numbers beyond i64 name no node; they stay out of range.
        macro_rules! read {
            ($type:ty, $values:ident, $from:expr) => {
                numbers(&bytes, |word| {
                    $from(match big {
                        true => <$type>::from_be_bytes(word),
                        false => <$type>::from_le_bytes(word),
                    })
                })
                .map(Values::$values)
            };
        }
        macro_rules! integers {
            ($type:ty) => {
                read!($type, Integers, |v| i64::try_from(v).unwrap_or(-1))
            };
        }
        let values = match kind {
            "Float32" => read!(f32, Floats, f64::from),
            "Float64" => read!(f64, Floats, f64::from),
            "Int8" => integers!(i8),
            "UInt8" => integers!(u8),
            "Int16" => integers!(i16),
            "UInt16" => integers!(u16),
            "Int32" => integers!(i32),
            "UInt32" => integers!(u32),
            "Int64" => integers!(i64),
            "UInt64" => integers!(u64),
            _ => return Err(fail(format!("the type \"{kind}\" is not numeric"))),
        };
        values.ok_or_else(|| fail("the data ends in the middle of a number".to_owned()))
    }

    /// The decoded data of an array.
    fn inline(&self, node: &Node) -> Result<Vec<u8>> {
        let dense = |text: &[u8]| -> Vec<u8> {
            let dense = text.iter().filter(|b| !b.is_ascii_whitespace());
            dense.copied().collect()
        };
        let parts: Vec<Vec<u8>> = (node.text.as_bytes().par_chunks(PIECE).map(dense)).collect();
        self.decoded(&parts.concat(), node.line)
    }

    fn appended(&self, node: &Node) -> Result<Vec<u8>> {
        let offset = node.attribute("offset").and_then(|text| text.parse().ok());
        let short = || Failure::line(node.line, "its offset is beyond the appended data");
        let rest = offset
            .and_then(|offset: usize| self.document.appended.get(offset..))
            .ok_or_else(short)?;
        if self.encoded {
            self.decoded(rest, node.line)
        } else {
            self.unpacked(node.line, |from, length| {
                rest.get(from..from.checked_add(length)?)
                    .map(<[u8]>::to_vec)
            })
        }
    }

    /// Base64; the header of compressed data is encoded separately.
    fn decoded(&self, encoded: &[u8], line: usize) -> Result<Vec<u8>> {
        let no_base64 = || Failure::line(line, "the data is not base64");
        let first = part(encoded, 0, self.word).ok_or_else(no_base64)?;
        let header = match self.compressed {
            true => self.word * (3 + self.number(&first)),
            false => self.word,
        };
        let split = 4 * header.div_ceil(3);
        let head = part(encoded, 0, header).ok_or_else(no_base64)?;
        let behind = encoded.get(split..).ok_or_else(no_base64)?;
        if !self.compressed {
            let length = self.number(&first);
            // Most programs encode both in one, some the length separately.
            let data = if encoded[..split].ends_with(b"=") && !behind.is_empty() {
                part(behind, 0, length)
            } else {
                part(encoded, header, length)
            };
            return data.ok_or_else(no_base64);
        }
        self.unpacked(line, |from, length| {
            if from.saturating_add(length) <= header {
                return head.get(from..from + length).map(<[u8]>::to_vec);
            }
            part(behind, 0, (from - header).saturating_add(length))
                .map(|mut all| all.split_off(from - header))
        })
    }

    /// The data behind its header: a length, or the sizes of compressed blocks. `take(from, length)` gives bytes.
    fn unpacked(
        &self,
        line: usize,
        take: impl Fn(usize, usize) -> Option<Vec<u8>>,
    ) -> Result<Vec<u8>> {
        let short = || Failure::line(line, "the data is cut short, or not base64");
        let word = |number: usize| {
            let bytes = take(number * self.word, self.word).ok_or_else(short)?;
            Ok(self.number(&bytes))
        };
        let first = word(0)?;
        if !self.compressed {
            return take(self.word, first).ok_or_else(short);
        }
        let mut packed = 0_usize;
        let mut lengths = Vec::new();
        for block in 0..first {
            lengths.push(word(3 + block)?);
            packed = packed.saturating_add(lengths[block]);
        }
        let packed = take(self.word * (3 + first), packed).ok_or_else(short)?;
        let mut rest = packed.as_slice();
        let blocks: Vec<&[u8]> = (lengths.into_iter())
            .map(|length| rest.split_off(..length).unwrap_or_default())
            .collect();
        let plain = |block: &&[u8]| {
            let mut plain = Vec::new();
            (flate2::read::ZlibDecoder::new(*block).read_to_end(&mut plain))
                .map(|_| plain)
                .map_err(|error| Failure::line(line, format!("compressed data: {error}")))
        };
        let plain: Vec<Result<Vec<u8>>> = blocks.par_iter().map(plain).collect();
        Ok(plain.into_iter().collect::<Result<Vec<_>>>()?.concat())
    }

    /// A length in front of data; nonsense is too large to be taken.
    fn number(&self, bytes: &[u8]) -> usize {
        let mut word = [0; 8];
        word[..bytes.len()].copy_from_slice(bytes);
        if self.big {
            word[..bytes.len()].reverse();
        }
        usize::try_from(u64::from_le_bytes(word))
            .map_or(usize::MAX >> 8, |n| n.min(usize::MAX >> 8))
    }
}

/// `length` bytes from `from` on, decoded from the base64 at the beginning of a text.
fn part(encoded: &[u8], from: usize, length: usize) -> Option<Vec<u8>> {
    let end = from.checked_add(length)?;
    let text = encoded.get(..end.div_ceil(3).saturating_mul(4))?;
    let parts = text
        .par_chunks(PIECE)
        .map(|text| STANDARD.decode(text).ok());
    let mut all = parts.collect::<Option<Vec<_>>>()?.concat();
    all.truncate(end);
    (all.len() == end).then(|| all.split_off(from))
}

fn ascii(node: &Node, kind: &str) -> Result<Values> {
    match kind.starts_with("Float") {
        true => words(node).map(Values::Floats),
        false => words(node).map(Values::Integers),
    }
}

/// The numbers of a text.
fn words<T: FromStr + Clone + Send>(node: &Node) -> Result<Vec<T>> {
    let of_word = |word: &str| {
        let fail = |_| Failure::line(node.line, format!("\"{word}\" is not a number"));
        word.parse().map_err(fail)
    };
    let pieces = pieces(node.text.as_bytes(), PIECE, |byte| {
        byte.is_ascii_whitespace()
    });
    let parts: Vec<Result<Vec<T>>> = (pieces.into_par_iter())
        .map(|piece| {
            node.text[piece]
                .split_ascii_whitespace()
                .map(of_word)
                .collect()
        })
        .collect();
    Ok(parts.into_iter().collect::<Result<Vec<_>>>()?.concat())
}

/// The numbers in bytes; None if these end in the middle of one.
fn numbers<T: Send, const N: usize>(
    bytes: &[u8],
    from: impl Fn([u8; N]) -> T + Sync,
) -> Option<Vec<T>> {
    let (words, rest) = bytes.as_chunks::<N>();
    let words = words.par_iter().with_min_len(PIECE);
    rest.is_empty()
        .then(|| words.map(|&word| from(word)).collect())
}
