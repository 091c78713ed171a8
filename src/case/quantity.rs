//! Numbers that may depend on the place.

use exmex::{Express, FlatEx, FloatOpsFactory, MatchLiteral};
use serde::Deserialize;

// exmex's own numbers have no exponents.
exmex::literal_matcher_from_pattern!(
    DecimalNumber,
    r"^([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"
);

/// A constant, or an expression of x and y such as `"-2e7 * (1 - x / 1.5)"`.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Text")]
pub enum Quantity {
    Constant(f64),
    Expression(Box<Expression>),
}

/// A parsed expression.
#[derive(Clone, Debug)]
pub struct Expression {
    text: String,
    parsed: FlatEx<f64, FloatOpsFactory<f64>, DecimalNumber>,
    /// Which coordinate each of its variables is.
    variables: Vec<usize>,
}

/// The two spellings in the file.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number or an expression of x and y in quotes"
)]
enum Text {
    Number(f64),
    Expression(String),
}

impl TryFrom<Text> for Quantity {
    type Error = String;

    fn try_from(text: Text) -> Result<Self, String> {
        match text {
            Text::Number(value) if value.is_finite() => Ok(Self::Constant(value)),
            Text::Number(value) => Err(format!("{value} is not a finite number")),
            Text::Expression(text) => {
                let parsed =
                    FlatEx::<f64, FloatOpsFactory<f64>, DecimalNumber>::parse(&spell_signs(&text)?)
                        .map_err(|error| format!("cannot understand \"{text}\": {error}"))?;
                let variables = parsed
                    .var_names()
                    .iter()
                    .map(|name| match name.as_str() {
                        "x" => Ok(0),
                        "y" => Ok(1),
                        _ => Err(format!(
                            "\"{text}\" has the unknown name \"{name}\": only the coordinates x and y vary"
                        )),
                    })
                    .collect::<Result<_, _>>()?;
                Ok(Self::Expression(Box::new(Expression {
                    text,
                    parsed,
                    variables,
                })))
            }
        }
    }
}

/// Writes a leading sign as a difference from zero.
///
/// To exmex a sign binds closer than a power, so that −x^2 would be (−x)²; as 0−x^2 it is what everybody
/// means. After another operator that does not help, so brackets are asked for.
fn spell_signs(text: &str) -> Result<String, String> {
    let mut spelled = String::with_capacity(text.len() + 8);
    let mut before = '(';
    let characters: Vec<char> = text.chars().collect();
    for (i, &c) in characters.iter().enumerate() {
        if matches!(c, '-' | '+') {
            let exponent = i >= 2
                && matches!(characters[i - 1], 'e' | 'E')
                && (characters[i - 2].is_ascii_digit() || characters[i - 2] == '.');
            match before {
                '(' | ',' => spelled.push('0'),
                '*' | '/' | '+' | '-' if !exponent => {
                    return Err(format!(
                        "\"{text}\" has two operators in a row: put the signed part in brackets"
                    ));
                }
                _ => {}
            }
        }
        spelled.push(c);
        if !c.is_whitespace() {
            before = c;
        }
    }
    Ok(spelled)
}

impl Quantity {
    /// The value at a point; NaN where the expression has none.
    pub fn at(&self, x: [f64; 2]) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Expression(expression) => {
                let values: Vec<f64> = expression.variables.iter().map(|&i| x[i]).collect();
                expression.parsed.eval(&values).unwrap_or(f64::NAN)
            }
        }
    }
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Constant(value) => write!(f, "{value}"),
            Self::Expression(expression) => write!(f, "{}", expression.text),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str, x: f64, y: f64) -> f64 {
        Quantity::try_from(Text::Expression(text.to_owned()))
            .unwrap_or_else(|error| panic!("{error}"))
            .at([x, y])
    }

    #[test]
    fn expressions_mean_what_they_say() {
        assert_eq!(value("-x^2", 3.0, 0.0), -9.0);
        assert_eq!(value("2*(-x^2)", 3.0, 0.0), -18.0);
        assert_eq!(value("-2e7 * max(0, 1 - x / 1.5)", 0.75, 0.0), -1e7);
        assert_eq!(value("1e-3 + 2.5E+2*y", 0.0, 2.0), 500.001);
        assert_eq!(value("min(-1, x) - .5", 3.0, 0.0), -1.5);
        assert_eq!(value("x^-2", 2.0, 0.0), 0.25);
        assert_eq!(value("y - x - 1", 1.0, 5.0), 3.0);
        assert_eq!(value("7", 1.0, 5.0), 7.0);
        assert!((value("sin(PI*x)", 0.5, 0.0) - 1.0).abs() < 1e-15);
    }

    #[test]
    fn nonsense_is_refused() {
        for text in ["2*-x", "x +", "z + 1", "", "1 2", "sin(x", "x ; y"] {
            assert!(
                Quantity::try_from(Text::Expression(text.to_owned())).is_err(),
                "{text}"
            );
        }
    }
}
