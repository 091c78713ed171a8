//! The part of XML that grids of VTK use: tags with attributes, comments, text.

use super::{Failure, Result};
use std::borrow::Cow;

/// An element of the file.
#[derive(Debug)]
pub(super) struct Node<'a> {
    pub name: &'a str,
    attributes: Vec<(&'a str, Cow<'a, str>)>,
    /// From 1.
    pub line: usize,
    /// Its parent element.
    pub parent: Option<usize>,
    /// The text between its tags.
    pub text: &'a str,
}

impl<'a> Node<'a> {
    pub fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|attribute| attribute.0 == name);
        found.map(|attribute| &*attribute.1)
    }
}

/// The elements of a file in their order, and where the data behind them begins.
pub(super) struct Document<'a> {
    pub nodes: Vec<Node<'a>>,
    /// The bytes of `<AppendedData>` after their underscore.
    pub appended: &'a [u8],
}

pub(super) fn read(bytes: &[u8]) -> Result<Document<'_>> {
    let mut nodes: Vec<Node> = Vec::new();
    let mut open: Vec<usize> = Vec::new();
    // The place, and its line.
    let (mut at, mut line) = (0, 1);
    while let Some(next) = bytes[at..].iter().position(|&b| b == b'<') {
        let begin = at + next;
        line += lines(&bytes[at..begin]);
        let comment = bytes[begin..].starts_with(b"<!--");
        let end: &[u8] = if comment { b"-->" } else { b">" };
        let length = match comment {
            true => bytes[begin..].windows(3).position(|window| window == end),
            false => end_of_tag(&bytes[begin..]),
        };
        let length = length.ok_or_else(|| Failure::line(line, "the file is cut short in a tag"))?;
        let tag = &bytes[begin + 1..begin + length];
        let here = line;
        line += lines(tag);
        at = begin + length + end.len();
        if comment || tag.starts_with(b"?") || tag.starts_with(b"!") {
            continue;
        }
        let tag = text(tag, here)?;
        if let Some(name) = tag.strip_prefix('/') {
            let message = match open.pop() {
                Some(last) if nodes[last].name == name.trim() => continue,
                Some(last) => format!(
                    "<{}> of line {} is not closed",
                    nodes[last].name, nodes[last].line
                ),
                None => format!("</{name}> closes nothing"),
            };
            return Err(Failure::line(here, message));
        }
        let parent = open.last().copied();
        if tag.starts_with("AppendedData") {
            let start = bytes[at..].iter().position(|&b| b == b'_');
            let start = start
                .ok_or_else(|| Failure::line(here, "the appended data does not begin with _"))?;
            nodes.push(node(tag, here, parent, ""));
            return Ok(Document {
                nodes,
                appended: &bytes[at + start + 1..],
            });
        }
        let until = bytes[at..].iter().position(|&b| b == b'<');
        let content = &bytes[at..at + until.unwrap_or(0)];
        let closed = tag.ends_with('/');
        nodes.push(node(
            tag.trim_end_matches('/'),
            here,
            parent,
            text(content, here)?,
        ));
        at += content.len();
        line += lines(content);
        if !closed {
            open.push(nodes.len() - 1);
        }
    }
    match open.last() {
        None => Ok(Document {
            nodes,
            appended: &[],
        }),
        Some(&last) => {
            let (name, line) = (nodes[last].name, nodes[last].line);
            Err(Failure::line(line, format!("<{name}> is not closed")))
        }
    }
}

/// The end of a tag: a > in quotation marks is part of an attribute.
fn end_of_tag(bytes: &[u8]) -> Option<usize> {
    let mut mark = None;
    bytes.iter().position(|&b| match (mark, b) {
        (None, b'>') => true,
        (None, b'"' | b'\'') => {
            mark = Some(b);
            false
        }
        (Some(open), b) => {
            if open == b {
                mark = None;
            }
            false
        }
        _ => false,
    })
}

/// An attribute with its entities replaced, those of XML and those by numbers; anything else stays as it is.
fn unescaped(text: &str) -> Cow<'_, str> {
    if !text.contains('&') {
        return text.into();
    }
    let mut plain = String::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('&') {
        plain.push_str(before);
        let found = after.split_once(';').and_then(|(entity, behind)| {
            let letter = match entity {
                "lt" => '<',
                "gt" => '>',
                "amp" => '&',
                "quot" => '"',
                "apos" => '\'',
                number => {
                    let number = number.strip_prefix('#')?;
                    let code = match number.strip_prefix('x') {
                        Some(digits) => u32::from_str_radix(digits, 16).ok()?,
                        None => number.parse().ok()?,
                    };
                    char::from_u32(code)?
                }
            };
            Some((letter, behind))
        });
        match found {
            Some((letter, behind)) => {
                plain.push(letter);
                rest = behind;
            }
            None => {
                plain.push('&');
                rest = after;
            }
        }
    }
    plain.push_str(rest);
    plain.into()
}

fn lines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|&&b| b == b'\n').count()
}

fn text(bytes: &[u8], line: usize) -> Result<&str> {
    std::str::from_utf8(bytes).map_err(|_| Failure::line(line, "this is not text"))
}

/// An element with the attributes of its tag: `name="value"`, in either kind of quotation marks.
fn node<'a>(tag: &'a str, line: usize, parent: Option<usize>, text: &'a str) -> Node<'a> {
    let (name, mut rest) = tag
        .split_once(|c: char| c.is_whitespace())
        .unwrap_or((tag, ""));
    let mut attributes = Vec::new();
    while let Some((key, after)) = rest.split_once('=') {
        let after = after.trim_start();
        let Some(mark) = after
            .chars()
            .next()
            .filter(|mark| matches!(mark, '"' | '\''))
        else {
            break;
        };
        let Some((value, behind)) = after[1..].split_once(mark) else {
            break;
        };
        attributes.push((key.trim(), unescaped(value)));
        rest = behind;
    }
    Node {
        name,
        attributes,
        line,
        parent,
        text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn attributes_may_have_entities_and_brackets() {
        let text = br#"<A Name="a &gt; b &amp; &#x3b1;&#946;" of='1 > 0' c="&unknown; & d"/><B Name="plain"/>"#;
        let document = read(text).expect("it is well-formed");
        let [a, b] = &document.nodes[..] else {
            panic!("two elements");
        };
        assert_eq!(a.attribute("Name"), Some("a > b & αβ"));
        assert_eq!(a.attribute("of"), Some("1 > 0"));
        assert_eq!(a.attribute("c"), Some("&unknown; & d"));
        assert_eq!(b.attribute("Name"), Some("plain"));
        assert!(read(b"<A Name=\"never closed>").is_err());
    }
}
