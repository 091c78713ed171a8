//! Keyword lines and data lines.

use super::super::file::{Failure, Result};

/// A keyword line: `*ELEMENT, TYPE=C3D8, ELSET=body`.
pub(crate) struct Keyword<'a> {
    /// From 1.
    pub line: usize,
    /// Without the asterisk, in capitals, with single blanks: `END PART`.
    pub name: String,
    /// In capitals, each with its value.
    pub options: Vec<(String, &'a str)>,
}

/// Whether a trimmed line begins a keyword, and is not a comment.
pub(crate) fn is_keyword(line: &str) -> bool {
    line.starts_with('*') && !line.starts_with("**")
}

/// The lines of a text, counted from 1.
pub(crate) struct Lines<'a> {
    rest: &'a str,
    /// How many have been taken.
    pub taken: usize,
}

impl<'a> Lines<'a> {
    pub fn new(text: &'a str) -> Self {
        Self {
            rest: text.trim_start_matches('\u{feff}'),
            taken: 0,
        }
    }

    /// All lines before the next keyword.
    pub fn data(&mut self) -> &'a str {
        let begin = |at: usize| self.rest[..at].rfind('\n').map_or(0, |end| end + 1);
        let mut stars = self.rest.match_indices('*').map(|(at, _)| (begin(at), at));
        let keyword = stars.find(|&(begin, at)| {
            self.rest[begin..at].trim().is_empty() && is_keyword(&self.rest[at..])
        });
        let end = keyword.map_or(self.rest.len(), |(begin, _)| begin);
        let (data, rest) = self.rest.split_at(end);
        self.rest = rest;
        self.taken += data.lines().count();
        data
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a str);

    fn next(&mut self) -> Option<Self::Item> {
        let line = self.rest.lines().next()?;
        self.rest = self.rest.split_once('\n').map_or("", |(_, rest)| rest);
        self.taken += 1;
        Some((self.taken, line))
    }
}

/// A name in the form for comparisons: capitals do not matter, nor do quotation marks.
pub(crate) fn key(name: &str) -> String {
    plain(name).to_uppercase()
}

/// A name without quotation marks.
pub(crate) fn plain(name: &str) -> &str {
    name.trim().trim_matches('"').trim()
}

/// Whether two names of keywords or options in capitals are the same: CalculiX does not see blanks.
pub(crate) fn same(one: &str, other: &str) -> bool {
    let letters = |name| str::chars(name).filter(|&c| c != ' ');
    letters(one).eq(letters(other))
}

/// Keywords with blanks, which may be left out.
const SPACED: [&str; 23] = [
    "CHANGE FRICTION",
    "CHANGE SURFACE BEHAVIOR",
    "CONTACT EXCLUSIONS",
    "CONTACT INCLUSIONS",
    "CONTACT INITIALIZATION ASSIGNMENT",
    "CONTACT INITIALIZATION DATA",
    "CONTACT PAIR",
    "CONTACT PROPERTY ASSIGNMENT",
    "CYCLIC SYMMETRY MODEL",
    "DISTRIBUTING COUPLING",
    "END ASSEMBLY",
    "END INSTANCE",
    "END PART",
    "END STEP",
    "INITIAL CONDITIONS",
    "KINEMATIC COUPLING",
    "MODEL CHANGE",
    "PRE-TENSION SECTION",
    "RIGID BODY",
    "ROTARY INERTIA",
    "SOLID SECTION",
    "SURFACE BEHAVIOR",
    "SURFACE INTERACTION",
];

/// The options of keywords about the mesh.
const OF_MESH: [(&str, &[&str]); 5] = [
    ("NODE", &["NSET", "SYSTEM"]),
    ("ELEMENT", &["TYPE", "ELSET", "SOLID ELEMENT NUMBERING"]),
    (
        "NSET",
        &[
            "NSET",
            "ELSET",
            // Without any meaning, but in a deck of CalculiX.
            "FREQUENCY",
            "GENERATE",
            "INSTANCE",
            "INTERNAL",
            "SORTED",
            "UNSORTED",
        ],
    ),
    (
        "ELSET",
        &[
            "ELSET", "GENERATE", "INSTANCE", "INTERNAL", "SORTED", "UNSORTED",
        ],
    ),
    (
        "SURFACE",
        &[
            "NAME",
            "TYPE",
            "INTERNAL",
            "NO OFFSET",
            "NO THICK",
            "PROPERTY",
            "REGION TYPE=SURFACE",
            "TRIM",
        ],
    ),
];

impl<'a> Keyword<'a> {
    /// Reads a keyword line; None if `line` is not one.
    pub fn parse(line: usize, text: &'a str) -> Option<Self> {
        let text = text.trim();
        if !is_keyword(text) {
            return None;
        }
        let mut parts = text[1..].split(',');
        let words = parts.next().unwrap_or_default().split_whitespace();
        let name = words.collect::<Vec<&str>>().join(" ").to_uppercase();
        let mut known = SPACED.iter();
        let name = match known.find(|known| same(known, &name)) {
            Some(known) => (*known).to_owned(),
            None => name,
        };
        let mut keyword = Self {
            line,
            name,
            options: Vec::new(),
        };
        keyword.add(parts);
        Some(keyword)
    }

    /// Adds the options of a line, either the first line of the keyword or a continuation.
    fn add(&mut self, parts: impl Iterator<Item = &'a str>) {
        let options = parts.filter(|part| !part.trim().is_empty()).map(|part| {
            let (name, value) = part.split_once('=').unwrap_or((part, ""));
            (key(name), plain(value))
        });
        self.options.extend(options);
    }

    /// Adds the lines that go on with it: while one ends with a comma, the next one does. `last` is its first line.
    pub fn complete(&mut self, mut last: &'a str, mut next: impl FnMut() -> Option<&'a str>) {
        while last.trim().ends_with(',') {
            let Some(more) = next() else { break };
            if more.trim().starts_with("**") {
                continue;
            }
            last = more;
            self.add(last.trim().split(','));
        }
    }

    /// The value of an option, empty where it has none; None without the option.
    pub fn option(&self, name: &str) -> Option<&'a str> {
        let found = self.options.iter().find(|option| same(&option.0, name));
        found.map(|option| option.1)
    }

    /// The options of a keyword except these, given by name or, with a value, as `NAME=VALUE`: each with what is wrong about it,
    /// and without a name where it cannot be left out.
    pub fn unknown(&self, known: &[&str]) -> impl Iterator<Item = (&str, String)> {
        let rest = self.options.iter().filter_map(move |(name, value)| {
            let whole = format!("{name}={}", value.to_uppercase());
            let is_known = |known: &&str| same(known, name) || same(known, &whole);
            let is_read = name == "INPUT" || known.iter().any(is_known);
            (!is_read).then_some((name.as_str(), value, whole))
        });
        rest.map(|(name, value, whole)| match parsed(name) {
            // Nothing is left to read without it.
            Some(_) => {
                let text = format!(
                    "*{}: its line ends with a comma and goes on in the next one, whose numbers are no options: remove that comma",
                    self.name
                );
                ("", text)
            }
            None => {
                let shown = if value.is_empty() { name } else { &whole };
                let text = format!("*{}, {shown}: this option is not understood", self.name);
                (name, text)
            }
        })
    }

    /// The known options of a keyword about the mesh: those of shells change nothing here.
    pub fn of_mesh(&self) -> Option<&'static [&'static str]> {
        let known = OF_MESH.iter().find(|known| known.0 == self.name);
        known.map(|known| known.1)
    }

    /// The value of a required option.
    pub(in crate::mesh) fn needed(&self, name: &str) -> Result<&'a str> {
        match self.option(name) {
            Some(value) if !value.is_empty() => Ok(value),
            _ => Err(Failure::line(
                self.line,
                format!("*{} needs {name}=…", self.name),
            )),
        }
    }
}

/// The entries of a data line; a comma at its end adds none.
pub(crate) fn entries(text: &str) -> impl Iterator<Item = &str> {
    let text = text.trim();
    let text = text.strip_suffix(',').unwrap_or(text);
    text.split(',').map(str::trim)
}

/// An entry as a number, if it is one.
pub(crate) fn parsed(text: &str) -> Option<f64> {
    // Fortran writes 1.D-3.
    let value = text
        .parse()
        .or_else(|_| text.replace(['d', 'D'], "e").parse());
    value.ok()
}

/// An entry as a number.
pub(in crate::mesh) fn number(line: usize, text: &str) -> Result<f64> {
    parsed(text).ok_or_else(|| Failure::line(line, format!("\"{text}\" is not a number")))
}

/// An entry as the number of a node or an element.
pub(in crate::mesh) fn label(line: usize, text: &str) -> Result<u64> {
    match text.parse() {
        Ok(label) if label > 0 => Ok(label),
        _ => Err(Failure::line(
            line,
            format!("\"{text}\" is not the number of a node or an element"),
        )),
    }
}
