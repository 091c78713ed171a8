//! Numbers and lines of a file, as text or as bytes of either order.

use super::SAVE_AS;
use super::foreign::BYTE_ORDER_MARK;
use crate::input::line_pieces;
use crate::mesh::file::{Failure, Result};
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Bytes that one task reads: so few that little is left for one thread at the end of a section, where pieces get too short.
const PIECE: usize = 1 << 15;

/// The bytes with a place in them.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    pub at: usize,
    pub binary: bool,
    swapped: bool,
}

impl<'a> Reader<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        let marked = bytes.starts_with(BYTE_ORDER_MARK);
        Self {
            bytes,
            at: if marked { BYTE_ORDER_MARK.len() } else { 0 },
            binary: false,
            swapped: false,
        }
    }

    /// The section $MeshFormat: the form of numbers. Returns the version, 2 or 4.
    pub fn format(&mut self) -> Result<u32> {
        let line = self.line().unwrap_or_default();
        let mut parts = line.split_whitespace();
        let name = parts.next().unwrap_or_default();
        let version = match name {
            "2" | "2.0" | "2.1" | "2.2" => 2,
            "4.1" => 4,
            _ => {
                return self.fail(format!("MSH version {name} is not supported: {SAVE_AS}"));
            }
        };
        let binary = parts.next() == Some("1");
        let size = parts.next();
        if size != Some("8") {
            return self.fail("only files with 8-byte numbers are supported");
        }
        if binary {
            self.binary = true;
            if self.int()? != 1 {
                self.at -= 4;
                self.swapped = true;
                if self.int()? != 1 {
                    return self.fail("the byte order mark is not 1");
                }
            }
        }
        Ok(version)
    }

    pub fn fail<T>(&self, message: impl Into<String>) -> Result<T> {
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

    /// An error at another place.
    pub fn fail_at<T>(&mut self, at: usize, message: String) -> Result<T> {
        self.at = at;
        self.fail(message)
    }

    /// The next line without its end; None at the end of the file. Text that is not UTF-8 is read as Latin-1, in which
    /// older editors write names.
    pub fn line(&mut self) -> Option<Cow<'a, str>> {
        let rest = self.bytes.get(self.at..).filter(|rest| !rest.is_empty())?;
        let end = rest.iter().position(|&b| b == b'\n').unwrap_or(rest.len());
        self.at += (end + 1).min(rest.len());
        Some(match std::str::from_utf8(&rest[..end]) {
            Ok(line) => line.into(),
            Err(_) => rest[..end].iter().map(|&byte| char::from(byte)).collect(),
        })
    }

    pub fn token(&mut self) -> Result<&'a str> {
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

    pub fn raw<const N: usize>(&mut self) -> Result<[u8; N]> {
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

    pub fn number<T: std::str::FromStr>(&mut self, what: &str) -> Result<T> {
        let token = self.token()?;
        match token.parse() {
            Ok(value) => Ok(value),
            Err(_) => self.fail(format!("\"{token}\" is not {what}")),
        }
    }

    /// The next number of a text, if it consists of some digits alone, as nearly all do: much faster than [`Self::number`].
    fn digits(&mut self) -> Option<u32> {
        let rest = self.bytes[self.at..].trim_ascii_start();
        let mut value = 0;
        let digits = rest.iter().take(9).take_while(|byte| byte.is_ascii_digit());
        let len = digits
            .map(|byte| value = 10 * value + u32::from(byte - b'0'))
            .count();
        let is_whole = len > 0 && rest.get(len).is_none_or(u8::is_ascii_whitespace);
        is_whole.then(|| {
            self.at = self.bytes.len() - rest.len() + len;
            value
        })
    }

    /// A C int.
    pub fn int(&mut self) -> Result<i64> {
        if self.binary {
            return Ok(i64::from(i32::from_le_bytes(self.raw()?)));
        }
        match self.digits() {
            Some(value) => Ok(i64::from(value)),
            None => self.number("an integer"),
        }
    }

    /// A size_t (MSH 4.1).
    pub fn size(&mut self) -> Result<usize> {
        let value = if self.binary {
            u64::from_le_bytes(self.raw()?)
        } else {
            match self.digits() {
                Some(value) => u64::from(value),
                None => self.number("a non-negative integer")?,
            }
        };
        // A count larger than the file is nonsense, and nothing to allocate for.
        Some(value)
            .filter(|&v| v < (1 << 48))
            .and_then(|v| usize::try_from(v).ok())
            .map_or_else(
                || self.fail(format!("{value} is not a sensible number")),
                Ok,
            )
    }

    pub fn float(&mut self) -> Result<f64> {
        if self.binary {
            Ok(f64::from_le_bytes(self.raw()?))
        } else {
            self.number("a number")
        }
    }

    /// The number of a node.
    pub fn tag(&mut self) -> Result<usize> {
        let tag = self.int()?;
        usize::try_from(tag).or_else(|_| self.fail(format!("{tag} is not the number of a node")))
    }

    /// Reads `count` records one after the other, in parts that keep their order. A record has at least so many bytes as `[text, binary]`,
    /// in a binary file exactly so many. All threads read together where lines end with records; what they cannot read is read again
    /// in sequence, which finds the first error.
    pub fn records<P: Default + Send>(
        &mut self,
        mut count: usize,
        [text, binary]: [usize; 2],
        record: impl Fn(&mut Self, &mut P) -> Result<()> + Sync,
    ) -> Result<Vec<P>> {
        let least = if self.binary { binary } else { text };
        let mut parts = Vec::new();
        while count > 0 {
            let rest = &self.bytes[self.at..];
            // These bytes have no more records than are left.
            let rest = &rest[..count.saturating_mul(least).min(rest.len())];
            let pieces: Vec<Range<usize>> = if self.binary {
                let ends = (0..=rest.len()).step_by((PIECE / least.max(1)).max(1) * least.max(1));
                ends.clone()
                    .zip(ends.skip(1))
                    .map(|(start, end)| start..end)
                    .collect()
            } else {
                let lines = rest
                    .iter()
                    .rposition(|&b| b == b'\n')
                    .map_or(0, |last| last + 1);
                line_pieces(&rest[..lines], PIECE)
            };
            let read = |piece: &Range<usize>| {
                let mut reader = Self {
                    bytes: &self.bytes[..self.at + piece.end],
                    at: self.at + piece.start,
                    ..*self
                };
                let (mut part, mut found) = (P::default(), 0);
                while !reader.is_at_end() {
                    record(&mut reader, &mut part)?;
                    found += 1;
                }
                Ok((part, found))
            };
            let read = || pieces.par_iter().map(read).collect::<Result<Vec<_>>>();
            match (pieces.len() > 1).then(read) {
                Some(Ok(read)) => {
                    self.at += pieces[pieces.len() - 1].end;
                    for (part, found) in read {
                        parts.push(part);
                        count -= found;
                    }
                }
                _ => {
                    let mut part = P::default();
                    for _ in 0..std::mem::take(&mut count) {
                        record(self, &mut part)?;
                    }
                    parts.push(part);
                }
            }
        }
        Ok(parts)
    }

    /// Whether nothing is left; as text, nothing but blanks, which it skips.
    fn is_at_end(&mut self) -> bool {
        if !self.binary {
            let rest = &self.bytes[self.at..];
            self.at += rest.len() - rest.trim_ascii_start().len();
        }
        self.at == self.bytes.len()
    }

    /// Moves behind the line `$End…` of a section.
    pub fn end(&mut self, section: &str) -> Result<()> {
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
                self.fail(format!("${section} has more entries than it announces"))
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
