//! Numbers that may depend on the place.

use exmex::{Express, FlatEx};
use serde::Deserialize;

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
    parsed: FlatEx<f64>,
    /// Which coordinate each of its variables is.
    variables: Vec<usize>,
}

/// The two spellings in the file.
#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a number or an expression of x and y in quotes")]
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
                let parsed = exmex::parse::<f64>(&text)
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
