//! Expressions of x and y, in space also of z.
//!
//! ```text
//! sum      a + b, a − b        to the left
//! product  a * b, a / b        to the left
//! sign     −a, +a              −x^2 is −(x^2); may follow any operator
//! power    a ^ b               to the right
//! operand  number, name, name(sum, …), (sum)
//! ```

#[cfg(test)]
mod tests;

use std::f64::consts::{E, PI, TAU};

/// How deep brackets and operators may nest; also the size of the value stack of an evaluation.
const DEPTH: usize = 100;
/// The part of a text that an error shows.
const SHOWN: usize = 100;

/// A parsed expression of a place in D dimensions.
#[derive(Clone, Debug)]
pub struct Expression<const D: usize = 2> {
    program: Vec<Op>,
}

/// An operation on the value stack, whose last entry is the top.
#[derive(Clone, Copy, Debug)]
enum Op {
    Number(f64),
    Coordinate(usize),
    One(fn(f64) -> f64),
    Two(fn(f64, f64) -> f64),
}

/// The meaning of a name.
#[derive(Clone, Copy, Debug)]
enum Meaning {
    /// A single value.
    Value(Op),
    /// A function of one value.
    One(fn(f64) -> f64),
    /// A function of two values.
    Two(fn(f64, f64) -> f64),
    /// A function of two or more values.
    Several(fn(f64, f64) -> f64),
}

const NAMES: [(&str, Meaning); 41] = [
    ("x", Meaning::Value(Op::Coordinate(0))),
    ("y", Meaning::Value(Op::Coordinate(1))),
    ("z", Meaning::Value(Op::Coordinate(2))),
    ("PI", Meaning::Value(Op::Number(PI))),
    ("pi", Meaning::Value(Op::Number(PI))),
    ("π", Meaning::Value(Op::Number(PI))),
    ("TAU", Meaning::Value(Op::Number(TAU))),
    ("tau", Meaning::Value(Op::Number(TAU))),
    ("τ", Meaning::Value(Op::Number(TAU))),
    ("E", Meaning::Value(Op::Number(E))),
    ("e", Meaning::Value(Op::Number(E))),
    ("abs", Meaning::One(f64::abs)),
    ("sign", Meaning::One(sign)),
    ("signum", Meaning::One(sign)),
    ("sqrt", Meaning::One(f64::sqrt)),
    ("cbrt", Meaning::One(f64::cbrt)),
    ("exp", Meaning::One(f64::exp)),
    ("ln", Meaning::One(f64::ln)),
    ("log", Meaning::One(f64::ln)),
    ("log2", Meaning::One(f64::log2)),
    ("log10", Meaning::One(f64::log10)),
    ("sin", Meaning::One(f64::sin)),
    ("cos", Meaning::One(f64::cos)),
    ("tan", Meaning::One(f64::tan)),
    ("asin", Meaning::One(f64::asin)),
    ("acos", Meaning::One(f64::acos)),
    ("atan", Meaning::One(f64::atan)),
    ("sinh", Meaning::One(f64::sinh)),
    ("cosh", Meaning::One(f64::cosh)),
    ("tanh", Meaning::One(f64::tanh)),
    ("asinh", Meaning::One(f64::asinh)),
    ("acosh", Meaning::One(f64::acosh)),
    ("atanh", Meaning::One(f64::atanh)),
    ("floor", Meaning::One(f64::floor)),
    ("ceil", Meaning::One(f64::ceil)),
    ("round", Meaning::One(f64::round)),
    ("trunc", Meaning::One(f64::trunc)),
    ("fract", Meaning::One(f64::fract)),
    ("atan2", Meaning::Two(f64::atan2)),
    ("min", Meaning::Several(f64::min)),
    ("max", Meaning::Several(f64::max)),
];

/// The names that mean something where there are this many coordinates.
fn names(dimension: usize) -> impl Iterator<Item = (&'static str, Meaning)> {
    NAMES.into_iter().filter(move |(_, meaning)| {
        !matches!(meaning, Meaning::Value(Op::Coordinate(c)) if *c >= dimension)
    })
}

/// −1, 0 or 1; the function of the standard library has no 0.
fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

/// The binding strength of a sign.
const SIGN: u8 = 3;

/// The operation of an operator, its binding strength, and the strength that it requires of the expression behind it.
fn operator(sign: char) -> Option<(Op, u8, u8)> {
    Some(match sign {
        '+' => (Op::Two(|a, b| a + b), 1, 2),
        '-' => (Op::Two(|a, b| a - b), 1, 2),
        '*' => (Op::Two(|a, b| a * b), 2, 3),
        '/' => (Op::Two(|a, b| a / b), 2, 3),
        '^' => (Op::Two(f64::powf), 4, 4),
        _ => return None,
    })
}

impl<const D: usize> Expression<D> {
    /// Parses a text; errors name the column, counted from 1.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut parser = Parser {
            text,
            rest: text.trim_start(),
            dimension: D,
            program: Vec::new(),
            depth: 0,
        };
        parser.operation(0)?;
        if !parser.rest.is_empty() {
            return Err(parser.expected("an operator"));
        }
        Ok(Self {
            program: parser.program,
        })
    }

    /// The value at a point.
    pub fn at(&self, x: [f64; D]) -> f64 {
        // Values in waiting; every call of the parser has left one, and it does not nest deeper.
        let mut values = [0.0; DEPTH];
        let mut count = 0;
        for &op in &self.program {
            match op {
                Op::Number(value) => {
                    values[count] = value;
                    count += 1;
                }
                Op::Coordinate(i) => {
                    values[count] = x[i];
                    count += 1;
                }
                Op::One(f) => values[count - 1] = f(values[count - 1]),
                Op::Two(f) => {
                    count -= 1;
                    values[count - 1] = f(values[count - 1], values[count]);
                }
            }
        }
        values[0]
    }
}

struct Parser<'a> {
    text: &'a str,
    /// The unread rest, without leading blanks.
    rest: &'a str,
    /// The number of coordinates.
    dimension: usize,
    program: Vec<Op>,
    depth: usize,
}

impl<'a> Parser<'a> {
    /// An operand with the operators after it that bind at least this strongly.
    fn operation(&mut self, least: u8) -> Result<(), String> {
        if self.depth == DEPTH {
            return Err(self.wrong("brackets and operators are nested too deeply"));
        }
        self.depth += 1;
        match self.next() {
            Some('-') => {
                self.skip(1);
                self.operation(SIGN)?;
                self.program.push(Op::One(|a| -a));
            }
            Some('+') => {
                self.skip(1);
                self.operation(SIGN)?;
            }
            _ => self.operand()?,
        }
        while let Some((op, binds, behind)) = self.next().and_then(operator)
            && binds >= least
        {
            self.skip(1);
            self.operation(behind)?;
            self.program.push(op);
        }
        self.depth -= 1;
        Ok(())
    }

    fn operand(&mut self) -> Result<(), String> {
        match self.next() {
            Some('(') => {
                self.skip(1);
                self.operation(0)?;
                self.close("an operator or \")\"")
            }
            Some('0'..='9' | '.') => self.number(),
            Some(c) if is_in_name(c) => self.name(),
            _ => Err(self.expected("a number, a name or \"(\"")),
        }
    }

    /// Digits, with a point among them or not, and an exponent.
    fn number(&mut self) -> Result<(), String> {
        let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
        let text = self.rest;
        let mut end = digits(text);
        if text[end..].starts_with('.') {
            end += 1 + digits(&text[end + 1..]);
        }
        if let Some(exponent) = text[end..].strip_prefix(['e', 'E']) {
            let unsigned = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
            if let more @ 1.. = digits(unsigned) {
                end = text.len() - unsigned.len() + more;
            }
        }
        let value: f64 = (text[..end].parse()).map_err(|_| self.expected("a number"))?;
        if !value.is_finite() {
            return Err(self.wrong("the number is too large"));
        }
        self.program.push(Op::Number(value));
        self.skip(end);
        Ok(())
    }

    /// A coordinate, a constant or a function with its values.
    fn name(&mut self) -> Result<(), String> {
        let end = self.rest.find(|c| !is_in_name(c));
        let name = &self.rest[..end.unwrap_or(self.rest.len())];
        let known = names(self.dimension).find(|(known, _)| *known == name);
        let Some((_, meaning)) = known else {
            let coordinates = match self.dimension {
                2 => "x and y",
                _ => "x, y and z",
            };
            let hint = nearest(name, self.dimension).map_or_else(
                || format!("only the coordinates {coordinates} vary"),
                |known| format!("did you mean \"{known}\"?"),
            );
            return Err(self.wrong(&format!("unknown name \"{}\": {hint}", shown(name))));
        };
        self.skip(name.len());
        if let Meaning::Value(op) = meaning {
            self.program.push(op);
            return Ok(());
        }
        if self.next() != Some('(') {
            return Err(self.expected(&format!("\"(\" after {name}")));
        }
        self.skip(1);
        self.operation(0)?;
        match meaning {
            Meaning::Value(_) => {}
            Meaning::One(f) => {
                self.close(&format!("an operator or \")\" ({name} takes one value)"))?;
                self.program.push(Op::One(f));
            }
            Meaning::Two(f) | Meaning::Several(f) => {
                let several = matches!(meaning, Meaning::Several(_));
                let takes = if several {
                    "two values or more"
                } else {
                    "two values"
                };
                if self.next() != Some(',') {
                    return Err(
                        self.expected(&format!("an operator or \",\" ({name} takes {takes})"))
                    );
                }
                self.skip(1);
                self.operation(0)?;
                self.program.push(Op::Two(f));
                while several && self.next() == Some(',') {
                    self.skip(1);
                    self.operation(0)?;
                    self.program.push(Op::Two(f));
                }
                self.close(&format!("an operator or \")\" ({name} takes {takes})"))?;
            }
        }
        Ok(())
    }

    fn close(&mut self, expected: &str) -> Result<(), String> {
        if self.next() != Some(')') {
            return Err(self.expected(expected));
        }
        self.skip(1);
        Ok(())
    }

    fn next(&self) -> Option<char> {
        self.rest.chars().next()
    }

    fn skip(&mut self, bytes: usize) {
        self.rest = self.rest[bytes..].trim_start();
    }

    fn expected(&self, what: &str) -> String {
        let end = self
            .rest
            .find(|c| !is_in_name(c))
            .unwrap_or(self.rest.len());
        let found = match self.next() {
            None => "the end".to_owned(),
            Some(c) => format!("\"{}\"", shown(&self.rest[..end.max(c.len_utf8())])),
        };
        self.wrong(&format!("expected {what}, found {found}"))
    }

    fn wrong(&self, what: &str) -> String {
        let before = &self.text[..self.text.len() - self.rest.len()];
        format!(
            "cannot understand \"{}\", column {}: {what}",
            shown(self.text),
            before.chars().count() + 1
        )
    }
}

fn is_in_name(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// A text, cut where it is too long for a message.
fn shown(text: &str) -> String {
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// Names are guessed where they are read from files.
#[cfg(not(feature = "case"))]
fn nearest(_: &str, _: usize) -> Option<&'static str> {
    None
}

/// The name that was probably intended. A single letter has to be the same except for its case.
#[cfg(feature = "case")]
fn nearest(wrong: &str, dimension: usize) -> Option<&'static str> {
    if wrong.len() > SHOWN {
        return None;
    }
    let wrong = wrong.to_lowercase();
    names(dimension)
        .map(|(name, _)| {
            let distance = strsim::damerau_levenshtein(&wrong, &name.to_lowercase());
            (distance, name)
        })
        .min()
        .filter(|&(distance, _)| 2 * distance < wrong.chars().count().max(1))
        .map(|(_, name)| name)
}
