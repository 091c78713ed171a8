//! Expressions of x and y.
//!
//! ```text
//! sum      a + b, a − b        to the left
//! product  a * b, a / b        to the left
//! sign     −a, +a              −x^2 is −(x^2); may follow any operator
//! power    a ^ b               to the right
//! operand  number, name, name(sum, …), (sum)
//! ```

use std::f64::consts::{E, PI, TAU};

/// How deep brackets and operators may nest; also what the values in waiting of an evaluation take.
const DEPTH: usize = 100;
/// What of a text is shown in an error.
const SHOWN: usize = 100;

/// A parsed expression.
#[derive(Clone, Debug)]
pub struct Expression {
    text: String,
    program: Vec<Op>,
}

/// What is done with the values in waiting, of which the last is the nearest.
#[derive(Clone, Copy, Debug)]
enum Op {
    Number(f64),
    Coordinate(usize),
    One(fn(f64) -> f64),
    Two(fn(f64, f64) -> f64),
}

/// What a name stands for.
#[derive(Clone, Copy, Debug)]
enum Meaning {
    /// A value by itself.
    Value(Op),
    /// A function of one value.
    One(fn(f64) -> f64),
    /// A function of two values.
    Two(fn(f64, f64) -> f64),
    /// A function of two or more values.
    Several(fn(f64, f64) -> f64),
}

const NAMES: [(&str, Meaning); 40] = [
    ("x", Meaning::Value(Op::Coordinate(0))),
    ("y", Meaning::Value(Op::Coordinate(1))),
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

/// −1, 0 or 1; the function of the standard library has no 0.
fn sign(value: f64) -> f64 {
    if value == 0.0 { 0.0 } else { value.signum() }
}

/// How strongly a sign binds.
const SIGN: u8 = 3;

/// What an operator does, how strongly it binds, and how strongly what follows it has to.
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

impl Expression {
    /// Parses a text; errors name the column, counted from 1.
    pub fn parse(text: String) -> Result<Self, String> {
        let mut parser = Parser {
            text: &text,
            rest: text.trim_start(),
            program: Vec::new(),
            depth: 0,
        };
        parser.operation(0)?;
        if !parser.rest.is_empty() {
            return Err(parser.expected("an operator"));
        }
        let program = parser.program;
        Ok(Self { text, program })
    }

    /// The value at a point.
    pub fn at(&self, x: [f64; 2]) -> f64 {
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

impl std::fmt::Display for Expression {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        f.write_str(&self.text)
    }
}

struct Parser<'a> {
    text: &'a str,
    /// What is still to be read, without blanks before it.
    rest: &'a str,
    program: Vec<Op>,
    depth: usize,
}

impl<'a> Parser<'a> {
    /// An operand with the operators behind it that bind at least as strongly as said.
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
        let Some(&(_, meaning)) = NAMES.iter().find(|(known, _)| *known == name) else {
            let hint = nearest(name).map_or_else(
                || "only the coordinates x and y vary".to_owned(),
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

/// The name that was probably meant. One letter is like any other: it has to be the same but for its case.
fn nearest(wrong: &str) -> Option<&'static str> {
    if wrong.len() > SHOWN {
        return None;
    }
    let wrong = wrong.to_lowercase();
    let names = NAMES.iter().map(|&(name, _)| name);
    names
        .map(|name| {
            let distance = strsim::damerau_levenshtein(&wrong, &name.to_lowercase());
            (distance, name)
        })
        .min()
        .filter(|&(distance, _)| 2 * distance < wrong.chars().count().max(1))
        .map(|(_, name)| name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn value(text: &str, x: f64, y: f64) -> f64 {
        Expression::parse(text.to_owned())
            .unwrap_or_else(|error| panic!("{error}"))
            .at([x, y])
    }

    #[test]
    fn expressions_mean_what_they_say() {
        assert_eq!(value("-x^2", 3.0, 0.0), -9.0);
        assert_eq!(value("2*(-x^2)", 3.0, 0.0), -18.0);
        assert_eq!(value("2*-x", 3.0, 0.0), -6.0);
        assert_eq!(value("2 - -x", 3.0, 0.0), 5.0);
        assert_eq!(value("1/-x*2 + +x", 4.0, 0.0), 3.5);
        assert_eq!(value("--x", 4.0, 0.0), 4.0);
        assert_eq!(value("-2e7 * max(0, 1 - x / 1.5)", 0.75, 0.0), -1e7);
        assert_eq!(value("1e-3 + 2.5E+2*y", 0.0, 2.0), 500.001);
        assert_eq!(value("1.e1 + 1.", 0.0, 2.0), 11.0);
        assert_eq!(value("min(-1, x) - .5", 3.0, 0.0), -1.5);
        assert_eq!(value("x^-2", 2.0, 0.0), 0.25);
        assert_eq!(value("2^-x^2", 2.0, 0.0), 0.0625);
        assert_eq!(value("2^3^2", 0.0, 0.0), 512.0);
        assert_eq!(value("x^0.5^-1", 3.0, 0.0), 9.0);
        assert_eq!(value("y - x - 1", 1.0, 5.0), 3.0);
        assert_eq!(value("8 / x / 2", 2.0, 5.0), 2.0);
        assert_eq!(value("7", 1.0, 5.0), 7.0);
        assert_eq!(value("max(0, min(1, 7 - x))", 6.5, 0.0), 0.5);
        assert_eq!(value("max(1, x, y, -3) + min(x,y,2)", 4.0, 5.0), 7.0);
        assert_eq!(value("(sqrt((x)^2 + ((y)^2)))", 3.0, 4.0), 5.0);
        assert_eq!(value("sin(PI*x) + sin(pi*x) + sin(π * x)", 0.5, 0.0), 3.0);
        assert_eq!(value("ln(e) + log(E)", 0.5, 0.0), 2.0);
        assert_eq!(value("2*e - e*2 + 1e0", 0.5, 0.0), 1.0);
        assert_eq!(value("sign(x) + sign(-2) + signum(3)", 0.0, 0.0), 0.0);
        assert_eq!(value("atan2(y, x)", 0.0, 2.0), PI / 2.0);
        assert!(value("sqrt(x)", -1.0, 0.0).is_nan());
    }

    #[test]
    fn nonsense_is_refused_with_its_column() {
        for (text, column, message) in [
            (
                "x +",
                4,
                "expected a number, a name or \"(\", found the end",
            ),
            ("2*/x", 3, "found \"/\""),
            (
                " z + 1",
                2,
                "unknown name \"z\": only the coordinates x and y vary",
            ),
            (
                "1 + sni(x)",
                5,
                "unknown name \"sni\": did you mean \"sin\"?",
            ),
            ("X", 1, "did you mean \"x\"?"),
            ("Sqrt(x)", 1, "did you mean \"sqrt\"?"),
            ("", 1, "found the end"),
            ("   ", 4, "found the end"),
            ("1 2", 3, "expected an operator, found \"2\""),
            ("2x", 2, "expected an operator, found \"x\""),
            ("2e", 2, "expected an operator, found \"e\""),
            ("1..2", 3, "expected an operator"),
            (".", 1, "expected a number, found \".\""),
            (
                "sin(x",
                6,
                "expected an operator or \")\" (sin takes one value), found the end",
            ),
            ("sin(x, y)", 6, "sin takes one value"),
            ("sin x", 5, "expected \"(\" after sin, found \"x\""),
            (
                "sin()",
                5,
                "expected a number, a name or \"(\", found \")\"",
            ),
            ("atan2(x)", 8, "atan2 takes two values), found \")\""),
            ("atan2(x, y, 1)", 11, "atan2 takes two values"),
            ("max(x)", 6, "\",\" (max takes two values or more)"),
            ("(x, y)", 3, "an operator or \")\", found \",\""),
            ("x)", 2, "expected an operator, found \")\""),
            ("x(2)", 2, "expected an operator"),
            ("x ; y", 3, "found \";\""),
            ("x**2", 3, "found \"*\""),
            ("π π", 3, "found \"π\""),
            ("1 + 1e999", 5, "too large"),
        ] {
            match Expression::parse(text.to_owned()) {
                Ok(_) => panic!("accepted: {text}"),
                Err(error) => assert!(
                    error.contains(&format!("\", column {column}: ")) && error.contains(message),
                    "{error}\nnot {column}: {message}"
                ),
            }
        }
    }

    #[test]
    fn nesting_ends_in_an_error() {
        for text in ["(", "-", "2^", "sin(", "max(1,", "1+(", "1-"] {
            let deep = format!("{}x", text.repeat(100_000));
            match Expression::parse(deep) {
                // A chain that is evaluated as it goes is no nesting.
                Ok(_) => assert_eq!(text, "1-"),
                Err(error) => assert!(
                    error.contains("nested too deeply") && error.len() < 300,
                    "{error}"
                ),
            }
        }
        // What is allowed is also evaluated.
        let deepest = format!("{}x{}", "(".repeat(DEPTH - 1), ")".repeat(DEPTH - 1));
        assert_eq!(value(&deepest, 2.0, 0.0), 2.0);
        let powers = format!("{}x", "1^".repeat(DEPTH - 1));
        assert_eq!(value(&powers, 2.0, 0.0), 1.0);
        let unknown = "q".repeat(1 << 20);
        assert!(Expression::parse(unknown).is_err_and(|error| error.len() < 400));
    }

    /// An expression before it is written down.
    #[derive(Clone, Debug)]
    enum Tree {
        Number(f64),
        Coordinate(bool),
        Minus(Box<Tree>),
        Operation(char, Box<Tree>, Box<Tree>),
        Call(&'static str, Vec<Tree>),
    }

    impl Tree {
        fn value(&self, x: f64, y: f64) -> f64 {
            match self {
                Self::Number(value) => *value,
                Self::Coordinate(first) => [y, x][usize::from(*first)],
                Self::Minus(a) => -a.value(x, y),
                Self::Operation(sign, a, b) => {
                    let (a, b) = (a.value(x, y), b.value(x, y));
                    match sign {
                        '+' => a + b,
                        '-' => a - b,
                        '*' => a * b,
                        '/' => a / b,
                        _ => a.powf(b),
                    }
                }
                Self::Call(name, values) => {
                    let values: Vec<f64> = values.iter().map(|v| v.value(x, y)).collect();
                    match (*name, &values[..]) {
                        ("abs", [a]) => a.abs(),
                        ("sqrt", [a]) => a.sqrt(),
                        ("cos", [a]) => a.cos(),
                        ("exp", [a]) => a.exp(),
                        ("atan2", [a, b]) => a.atan2(*b),
                        ("min", all) => all.iter().copied().reduce(f64::min).unwrap_or(f64::NAN),
                        ("max", all) => all.iter().copied().reduce(f64::max).unwrap_or(f64::NAN),
                        _ => f64::NAN,
                    }
                }
            }
        }

        /// With brackets around everything.
        fn plain(&self) -> String {
            match self {
                Self::Minus(a) => format!("(-{})", a.plain()),
                Self::Operation(sign, a, b) => format!("({}{sign}{})", a.plain(), b.plain()),
                Self::Call(name, values) => {
                    let values: Vec<String> = values.iter().map(Self::plain).collect();
                    format!("({name}({}))", values.join(","))
                }
                _ => format!("({})", self.terse(0)),
            }
        }

        /// With brackets only where another tree would be meant without: where this one binds less than it has to.
        fn terse(&self, least: u8) -> String {
            let (binds, text) = match self {
                Self::Number(value) => (5, format!("{value:e}")),
                Self::Coordinate(first) => (5, ["y", "x"][usize::from(*first)].to_owned()),
                Self::Minus(a) => (3, format!("-{}", a.terse(3))),
                Self::Operation(sign, a, b) => {
                    let (binds, before, behind) = match sign {
                        '+' | '-' => (1, 1, 2),
                        '*' | '/' => (2, 2, 3),
                        _ => (4, 5, 3),
                    };
                    (
                        binds,
                        format!("{} {sign}{}", a.terse(before), b.terse(behind)),
                    )
                }
                Self::Call(name, values) => {
                    let values: Vec<String> = values.iter().map(|v| v.terse(0)).collect();
                    (5, format!("{name} ({})", values.join(", ")))
                }
            };
            if binds < least {
                format!("({text})")
            } else {
                text
            }
        }
    }

    fn trees() -> impl Strategy<Value = Tree> {
        let leaf = prop_oneof![
            prop::sample::select(vec![0.0, 0.5, 1.0, 2.0, 3.0, 1.5e-3, 2.5e7])
                .prop_map(Tree::Number),
            any::<bool>().prop_map(Tree::Coordinate),
        ];
        leaf.prop_recursive(6, 40, 3, |tree| {
            let signs = prop::sample::select(vec!['+', '-', '*', '/', '^']);
            let boxed = tree.clone().prop_map(Box::new);
            prop_oneof![
                1 => boxed.clone().prop_map(Tree::Minus),
                4 => (signs, boxed.clone(), boxed)
                    .prop_map(|(sign, a, b)| Tree::Operation(sign, a, b)),
                1 => (prop::sample::select(vec!["abs", "sqrt", "cos", "exp"]), tree.clone())
                    .prop_map(|(name, a)| Tree::Call(name, vec![a])),
                1 => (tree.clone(), tree.clone()).prop_map(|(a, b)| Tree::Call("atan2", vec![a, b])),
                1 => (
                    prop::sample::select(vec!["min", "max"]),
                    prop::collection::vec(tree, 2..4)
                ).prop_map(|(name, values)| Tree::Call(name, values)),
            ]
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(2000))]

        #[test]
        fn brackets_are_needed_nowhere_else(tree in trees(), x in -2.0..2.0, y in -2.0..2.0) {
            let expected = tree.value(x, y);
            for text in [tree.plain(), tree.terse(0)] {
                let found = value(&text, x, y);
                prop_assert!(
                    found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan(),
                    "{} is {}, not {}", text, found, expected
                );
            }
        }
    }
}
