//! The text of a file: its header, and the entries of its lines by several tasks at once.

use crate::input::line_pieces;
use crate::memory;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;

/// Row, column and value.
pub(super) type Entry = (u32, u32, f64);

/// Bytes that one task parses.
pub(super) const PIECE: usize = 1 << 18;

/// The contents of the lines before the entries.
pub(super) struct Header<'a> {
    coordinate: bool,
    pub symmetric: bool,
    pub rows: usize,
    pub cols: usize,
    /// Entries in the file.
    count: u64,
    /// The line with the sizes, counted from 1, and the text after it.
    line: usize,
    body: &'a [u8],
}

/// The number of a line and its fault.
pub(super) type Fault = (usize, String);

/// The header and the entries of a file; of a symmetric one those of the lower triangle. `piece` bytes are parsed by
/// one task.
pub(super) fn parse(text: &[u8], piece: usize) -> Result<(Header<'_>, Vec<Vec<Entry>>), Fault> {
    let header = parse_header(text)?;
    if header.coordinate {
        let entry = |line: &str, entries: &mut Vec<Entry>| {
            entries.push(header.entry(line)?);
            Ok(())
        };
        let ended = |read| format!("the file ends after {read} of {} entries", header.count);
        let more = format!("there are more than the {} announced entries", header.count);
        let entries = header.gather(piece, entry, ended, &more, |_| 1)?;
        return Ok((header, entries));
    }
    let words = |line: &str| line.split_ascii_whitespace().count();
    let values = |line: &str, values: &mut Vec<f64>| {
        for word in line.split_ascii_whitespace() {
            values.push(number(Some(word))?);
        }
        Ok(())
    };
    let ended = |_| "the file ends before the last value".to_owned();
    let more = "there are more values than the matrix has entries";
    let values = header.gather(piece, values, ended, more, words)?;
    // Column by column; of a symmetric matrix the lower triangle.
    let rows = header.rows as u32;
    let first = |j: u32| if header.symmetric { j } else { 0 };
    let places = (0..header.cols as u32).flat_map(|j| (first(j)..rows).map(move |i| (i, j)));
    let entries = places.zip(values.into_iter().flatten());
    let entries = entries.map(|((i, j), value)| (i, j, value)).collect();
    Ok((header, vec![entries]))
}

/// Whether the entries are given with their indices, and whether one triangle represents both.
fn parse_banner(banner: &str) -> Result<(bool, bool), String> {
    let banner = banner.to_lowercase();
    let banner: Vec<&str> = banner.split_whitespace().collect();
    let ["%%matrixmarket", "matrix", form, field, symmetry] = banner[..] else {
        return Err(
            "the first line must be: %%MatrixMarket matrix coordinate|array real general|symmetric"
                .to_owned(),
        );
    };
    let coordinate = match form {
        "coordinate" => true,
        "array" => false,
        _ => return Err(format!("form \"{form}\" is not coordinate or array")),
    };
    if !matches!(field, "real" | "integer" | "double") {
        return Err(format!(
            "field \"{field}\" is not supported: only real numbers are"
        ));
    }
    match symmetry {
        "general" => Ok((coordinate, false)),
        "symmetric" => Ok((coordinate, true)),
        _ => Err(format!(
            "symmetry \"{symmetry}\" is not general or symmetric"
        )),
    }
}

fn parse_header(text: &[u8]) -> Result<Header<'_>, Fault> {
    if text.is_empty() {
        return Err((1, "the file is empty".to_owned()));
    }
    let (banner, mut body) = split_line(text);
    let (coordinate, symmetric) = parse_banner(&banner).map_err(|fault| (1, fault))?;
    let mut line = 1;
    let sizes = loop {
        if body.is_empty() {
            return Err((2, "the line with the sizes is missing".to_owned()));
        }
        let (sizes, rest) = split_line(body);
        (line, body) = (line + 1, rest);
        if !is_void(&sizes) {
            break sizes.trim().to_owned();
        }
    };
    let parsed: Option<Vec<u64>> = sizes.split_whitespace().map(|w| w.parse().ok()).collect();
    let (rows, cols, announced) = match (parsed.as_deref(), coordinate) {
        (Some(&[rows, cols, count]), true) => (rows, cols, Some(count)),
        (Some(&[rows, cols]), false) => (rows, cols, None),
        _ => {
            let expected = if coordinate {
                "rows columns entries"
            } else {
                "rows columns"
            };
            return Err((line, format!("\"{sizes}\" is not: {expected}")));
        }
    };
    if symmetric && rows != cols {
        return Err((
            line,
            format!("a symmetric matrix cannot be {rows} × {cols}"),
        ));
    }
    let largest = rows.max(cols);
    if largest >= u64::from(u32::MAX) {
        return Err((line, format!("{rows} × {cols} is too large")));
    }
    // Below 2⁶⁴, since both are below 2³².
    let count = announced.unwrap_or(if symmetric {
        rows * (rows + 1) / 2
    } else {
        rows * cols
    });
    // An entry takes more than a byte.
    if count > body.len() as u64 {
        let what = if coordinate { "entries" } else { "values" };
        return Err((
            line,
            format!(
                "\"{sizes}\" announces {count} {what}, and only {} bytes follow",
                body.len()
            ),
        ));
    }
    // Something will be stored for each row, which a file with so few entries has not paid for.
    if largest > text.len() as u64
        && memory::total_bytes().is_some_and(|bytes| largest > bytes as u64 / BYTES_PER_ROW)
    {
        return Err((
            line,
            format!("{rows} × {cols} is too large for the memory of this machine"),
        ));
    }
    Ok(Header {
        coordinate,
        symmetric,
        rows: rows as usize,
        cols: cols as usize,
        count,
        line,
        body,
    })
}

/// The first line of a text, and the rest.
fn split_line(text: &[u8]) -> (Cow<'_, str>, &[u8]) {
    let mut lines = text.splitn(2, |&byte| byte == b'\n');
    let line = lines.next().unwrap_or_default();
    let rest = lines.next().unwrap_or_default();
    (readable(line), rest)
}

/// The least memory per row of a matrix in the resulting problem, several matrices and vectors together.
const BYTES_PER_ROW: u64 = 64;

/// The result of one task: up to the first unreadable line, numbered within the task.
struct Piece<T> {
    start: usize,
    found: Vec<T>,
    fault: Option<Fault>,
}

impl Header<'_> {
    /// The results of `parse` on the lines of the body, a piece per task, in the order of the file.
    ///
    /// A number other than `count` is an error: `ended` reports the number found, and `more` the line of the first
    /// surplus entry, which `found` locates.
    fn gather<T: Send>(
        &self,
        piece: usize,
        parse: impl Fn(&str, &mut Vec<T>) -> Result<(), String> + Sync,
        ended: impl Fn(u64) -> String,
        more: &str,
        found: impl Fn(&str) -> usize,
    ) -> Result<Vec<Vec<T>>, Fault> {
        let pieces: Vec<Piece<T>> = (line_pieces(self.body, piece).into_par_iter())
            .map(|range| parse_lines(self.body, range, &parse))
            .collect();
        // Lines are counted only for a message.
        let lines = || {
            (self.line + 1..)
                .zip(self.body.split(|&byte| byte == b'\n'))
                .map(|(number, line)| (number, readable(line)))
                .filter(|(_, line)| !is_void(line))
        };
        let mut read = 0;
        let mut all = Vec::with_capacity(pieces.len());
        for part in pieces {
            read += part.found.len() as u64;
            if read + u64::from(part.fault.is_some()) > self.count {
                let mut seen = 0;
                let place = lines().find(|(_, line)| {
                    seen += found(line) as u64;
                    seen > self.count
                });
                return Err((place.map_or(self.line, |(line, _)| line), more.to_owned()));
            }
            if let Some((line, message)) = part.fault {
                return Err((
                    self.line + newlines(&self.body[..part.start]) + line,
                    message,
                ));
            }
            all.push(part.found);
        }
        if read < self.count {
            let last = lines().last().map_or(self.line, |(line, _)| line);
            return Err((last, ended(read)));
        }
        Ok(all)
    }

    /// The entry on a line: row, column, value.
    fn entry(&self, line: &str) -> Result<Entry, String> {
        let mut words = line.split_ascii_whitespace();
        let i = index(words.next(), "row", self.rows)?;
        let j = index(words.next(), "column", self.cols)?;
        if self.symmetric && j > i {
            return Err("a symmetric file holds the lower triangle only".to_owned());
        }
        Ok((i, j, number(words.next())?))
    }
}

/// Parses some of the lines of a text, up to the first that cannot be read.
fn parse_lines<T>(
    text: &[u8],
    range: Range<usize>,
    parse: impl Fn(&str, &mut Vec<T>) -> Result<(), String>,
) -> Piece<T> {
    let start = range.start;
    let text = readable(&text[range]);
    let mut found = Vec::with_capacity(newlines(text.as_bytes()) + 1);
    let mut fault = None;
    for (number, line) in text.split('\n').enumerate() {
        if is_void(line) {
            continue;
        }
        if let Err(message) = parse(line, &mut found) {
            fault = Some((number + 1, message));
            break;
        }
    }
    Piece {
        start,
        found,
        fault,
    }
}

/// The text, whose comments may be in any encoding.
fn readable(text: &[u8]) -> Cow<'_, str> {
    // Much faster than a search for invalid bytes.
    std::str::from_utf8(text).map_or_else(|_| String::from_utf8_lossy(text), Cow::Borrowed)
}

fn newlines(text: &[u8]) -> usize {
    text.iter().filter(|&&byte| byte == b'\n').count()
}

/// Whether there is nothing on a line, or a comment.
fn is_void(line: &str) -> bool {
    let line = line.trim_ascii_start();
    line.is_empty() || line.starts_with('%')
}

/// A row or column, counted from 0.
fn index(word: Option<&str>, name: &str, limit: usize) -> Result<u32, String> {
    let word = word.ok_or_else(|| format!("the {name} is missing"))?;
    // The parser of the standard library takes three times as long, which here is felt.
    let (mut i, mut digits) = (0, word.len() < 19);
    for byte in word.bytes() {
        let digit = u64::from(byte.wrapping_sub(b'0'));
        digits &= digit < 10;
        i = u64::wrapping_add(u64::wrapping_mul(i, 10), digit);
    }
    if !digits {
        i = word.parse().unwrap_or(0);
    }
    if (1..=limit as u64).contains(&i) {
        Ok((i - 1) as u32)
    } else {
        Err(format!("{name} \"{word}\" is not between 1 and {limit}"))
    }
}

fn number(word: Option<&str>) -> Result<f64, String> {
    let word = word.ok_or("a value is missing")?;
    word.parse()
        .map_err(|_| format!("\"{word}\" is not a number"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes of pieces that cut lines, line ends and comments everywhere, and one that cuts nothing.
    fn pieces() -> impl Iterator<Item = usize> {
        (1..=50).chain([PIECE])
    }

    fn parsed(text: &str, piece: usize) -> Result<Vec<Entry>, Fault> {
        parse(text.as_bytes(), piece).map(|(_, stored)| stored.concat())
    }

    #[test]
    fn pieces_may_end_anywhere() {
        let coordinate = "%%MatrixMarket matrix coordinate real symmetric\n% sizes\n\n3 3 5\n\
                          1 1 2.5\n% between\n\n  2\t1 -1e-3 \n3 1 +7\n   % 1 1 1\n3 3 inf\n+2 002 .5\n\n%\n";
        let entries = vec![
            (0, 0, 2.5),
            (1, 0, -1e-3),
            (2, 0, 7.0),
            (2, 2, f64::INFINITY),
            (1, 1, 0.5),
        ];
        let array = "%%MatrixMarket matrix array integer general\n2 3\n1 2\n3\n%\n4 5\n\n6\n";
        let values = vec![
            (0, 0, 1.0),
            (1, 0, 2.0),
            (0, 1, 3.0),
            (1, 1, 4.0),
            (0, 2, 5.0),
            (1, 2, 6.0),
        ];
        let triangle = "%%MatrixMarket matrix array real symmetric\n2 2\n1\n2\n3";
        let lower = vec![(0, 0, 1.0), (1, 0, 2.0), (1, 1, 3.0)];
        let empty = "%%MatrixMarket matrix coordinate real general\n0 7 0";
        for (text, expected) in [
            (coordinate, entries),
            (array, values),
            (triangle, lower),
            (empty, vec![]),
        ] {
            for text in [
                text.to_owned(),
                text.replace('\n', "\r\n"),
                text.trim_end().to_owned(),
            ] {
                for piece in pieces() {
                    assert_eq!(
                        parsed(&text, piece),
                        Ok(expected.clone()),
                        "{piece}: {text}"
                    );
                }
            }
        }
    }

    #[test]
    fn comments_may_be_in_any_encoding() {
        let text =
            b"%%MatrixMarket matrix coordinate real general\n% \xfcber\n1 1 1\n% \xe9\n1 1 3\n";
        for piece in pieces() {
            let stored = parse(text, piece).map(|(_, stored)| stored.concat());
            assert_eq!(stored, Ok(vec![(0, 0, 3.0)]));
        }
    }

    #[test]
    fn errors_name_their_line_in_every_piece() {
        let lines = |count: usize| "7 7 1e0\n% comment\n\n".repeat(count);
        let coordinate = |entries: usize, rest: &str| {
            format!(
                "%%MatrixMarket matrix coordinate real symmetric\n7 7 {entries}\n{}{rest}",
                lines(5)
            )
        };
        let array = |rest: &str| {
            format!("%%MatrixMarket matrix array real general\n2 3\n1 2\n3\n% 4\n{rest}")
        };
        // The five entries end at line 17; the last two of them are empty.
        let cases = [
            (
                coordinate(7, "1 1 1\n2 1 x\n3 y z\n"),
                19,
                "\"x\" is not a number",
            ),
            (
                coordinate(9, "1 8 1\n"),
                18,
                "column \"8\" is not between 1 and 7",
            ),
            (coordinate(9, "0 1 1\n"), 18, "row \"0\" is not"),
            (coordinate(9, "-1 1 1\n"), 18, "row \"-1\" is not"),
            (
                coordinate(9, "18446744073709551617 1 1\n"),
                18,
                "row \"18446744073709551617\" is not",
            ),
            (coordinate(9, "1\n"), 18, "the column is missing"),
            (coordinate(9, "% 1\n\n1 1"), 20, "a value is missing"),
            (coordinate(9, "1 2 1\n"), 18, "lower triangle only"),
            (
                coordinate(5, "\n1 1 1\n1 1 x"),
                19,
                "more than the 5 announced",
            ),
            // A surplus entry is not parsed.
            (coordinate(5, "\nx"), 19, "more than the 5 announced"),
            (coordinate(3, "\nx"), 12, "more than the 3 announced"),
            (coordinate(0, ""), 3, "more than the 0 announced"),
            (coordinate(6, ""), 15, "ends after 5 of 6 entries"),
            (coordinate(7, "1 1 1\n\n%"), 18, "ends after 6 of 7 entries"),
            (array("4 5\n6 x"), 7, "more values than"),
            (array("4 5 6 x"), 6, "more values than"),
            (array("4\n5 x 6"), 7, "\"x\" is not a number"),
            (array("4\n5\n\n%"), 7, "ends before the last value"),
            (array(""), 4, "ends before the last value"),
        ];
        for (text, line, message) in cases {
            for text in [text.clone(), text.replace('\n', "\r\n")] {
                for piece in pieces() {
                    match parsed(&text, piece) {
                        Err((at, said)) if at == line && said.contains(message) => {}
                        other => panic!("{piece}: {other:?}, not {line}: {message}, in\n{text}"),
                    }
                }
            }
        }
    }

    #[test]
    fn headers_do_not_take_memory() {
        let cases = [
            (
                "coordinate real general\n2 2 1000000000000000000",
                "only 6 bytes follow",
            ),
            (
                "coordinate real general\n2 2 18446744073709551615",
                "only 6 bytes follow",
            ),
            (
                "coordinate real general\n2 2 18446744073709551616",
                "is not: rows columns entries",
            ),
            ("coordinate real general\n5000000000 2 1", "is too large"),
            ("coordinate real general\n2 4294967295 1", "is too large"),
            (
                "coordinate real general\n4294967294 4294967294 1",
                "for the memory of this machine",
            ),
            (
                "array real general\n4294967294 4294967294",
                "announces 18446744056529682436 values",
            ),
            (
                "array real symmetric\n4294967294 4294967294",
                "announces 9223372030412324865 values",
            ),
            ("array real general\n18446744073709551615 2", "is too large"),
            ("array real general\n4000000000 1", "only 6 bytes follow"),
        ];
        for (sizes, message) in cases {
            let text = format!("%%MatrixMarket matrix {sizes}\n1 1 1\n");
            match parsed(&text, PIECE) {
                Err((2, said)) if said.contains(message) => {}
                other => panic!("{other:?}, not {message}, in\n{text}"),
            }
        }
    }
}
