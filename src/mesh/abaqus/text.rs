//! A file with the texts of the files that it includes (`INPUT=`), each in its place.

use super::keyword::{Keyword, Lines};
use crate::input;
use crate::mesh::file::{Failure, FileError};
use std::path::{Component, Path, PathBuf};

/// All lines as of one file.
#[derive(Default)]
pub(super) struct Text {
    pub text: String,
    /// The number of lines.
    lines: usize,
    /// Their origins, in order.
    pieces: Vec<Piece>,
    /// Whether data of all keywords are read from the files that they name.
    whole: bool,
}

/// Lines of a file one after another.
struct Piece {
    path: PathBuf,
    /// The number of lines before it, of all and in its file.
    before: [usize; 2],
}

/// Files go into files no deeper than this: Abaqus itself allows for five.
const DEEPEST: usize = 10;

/// The keywords whose data a mesh needs, and which may therefore be in another file.
const READ: [&str; 5] = ["NODE", "ELEMENT", "NSET", "ELSET", "SURFACE"];

impl Text {
    /// The text of `path`, which has been read, with that of the files it names: for data of a mesh or, of a `whole` deck,
    /// of any keyword.
    ///
    /// # Errors
    /// If one of these cannot be read: with the line that includes it.
    pub fn new(path: &Path, text: &str, whole: bool) -> Result<Self, FileError> {
        let mut all = Self {
            whole,
            ..Self::default()
        };
        all.add(path, text, path.parent().unwrap_or(Path::new("")), 0)?;
        Ok(all)
    }

    /// The file and the line of it that a line of the whole text comes from.
    pub fn place(&self, number: usize) -> (&Path, usize) {
        // Of pieces that begin at the same line, all except the last are empty.
        let after = (self.pieces).partition_point(|piece| piece.before[0] < number);
        let Piece { path, before } = &self.pieces[after.max(1) - 1];
        (path, number - before[0] + before[1])
    }

    /// The error, with its file and the line there.
    pub fn locate(&self, failure: Failure) -> FileError {
        match failure {
            Failure::Line { number, message } => {
                let (path, line) = self.place(number);
                Failure::line(line, message).of(path)
            }
            failure => failure.of(&self.pieces[0].path),
        }
    }

    /// Adds a file; its included files are in the folder `place`.
    fn add(
        &mut self,
        path: &Path,
        text: &str,
        place: &Path,
        depth: usize,
    ) -> Result<(), FileError> {
        self.begin(path, 0);
        let mut lines = Lines::new(text);
        loop {
            let data = lines.data();
            self.text.push_str(data);
            // The last line may lack its end.
            if !self.text.is_empty() && !self.text.ends_with('\n') {
                self.text.push('\n');
            }
            self.lines += data.lines().count();
            let Some((line, first)) = lines.next() else {
                return Ok(());
            };
            let before = (self.text.len(), self.lines);
            self.push(first);
            let Some(mut keyword) = Keyword::parse(line, first) else {
                continue;
            };
            let mut last = line;
            keyword.complete(first, || {
                let (number, more) = lines.next()?;
                last = number;
                self.push(more);
                Some(more)
            });
            let is_include = keyword.name == "INCLUDE";
            let input = keyword.option("INPUT");
            let is_read = self.whole || READ.contains(&keyword.name.as_str());
            if !is_include && (input.is_none() || !is_read) {
                continue;
            }
            let failed = |message: String| {
                Failure::line(line, format!("*{}: {message}", keyword.name)).of(path)
            };
            let Some(name) = input.filter(|name| !name.is_empty()) else {
                return Err(failed("INPUT= must name a file".to_owned()));
            };
            if is_include {
                // The text of the file replaces the keyword.
                self.text.truncate(before.0);
                self.lines = before.1;
            }
            let inside = |part| matches!(part, Component::Normal(_) | Component::CurDir);
            if !Path::new(name).components().all(inside) {
                return Err(failed(format!(
                    "{name} must be in the folder of the first file, or below it: give its path from there"
                )));
            }
            let file = place.join(name);
            let shown = file.display();
            if depth == DEEPEST {
                return Err(failed(format!(
                    "{DEEPEST} files include each other down to {shown}: does one include itself?"
                )));
            }
            let left = input::data_limit().saturating_sub(self.text.len());
            let bytes = input::whole(&file, left)
                .map_err(|error| failed(format!("cannot read {shown}: {error}")))?;
            self.add(&file, &String::from_utf8_lossy(&bytes), place, depth + 1)?;
            self.begin(path, last);
        }
    }

    /// The following lines are from `path`, after so many of its lines.
    fn begin(&mut self, path: &Path, line: usize) {
        self.pieces.push(Piece {
            path: path.to_owned(),
            before: [self.lines, line],
        });
    }

    fn push(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
        self.lines += 1;
    }
}
