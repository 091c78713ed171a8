//! Numbers that may depend on the place.

mod expression;

use expression::Expression;
use serde::Deserialize;

/// A constant, or an expression of x and y such as `"-2e7 * (1 - x / 1.5)"`.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "Text")]
pub enum Quantity {
    Constant(f64),
    Expression(Box<Expression>),
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
            Text::Expression(text) => Ok(Self::Expression(Box::new(Expression::parse(text)?))),
        }
    }
}

impl Quantity {
    /// The value at a point; NaN where the expression has none.
    pub fn at(&self, x: [f64; 2]) -> f64 {
        match self {
            Self::Constant(value) => *value,
            Self::Expression(expression) => expression.at(x),
        }
    }
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Constant(value) => write!(f, "{value}"),
            Self::Expression(expression) => write!(f, "{expression}"),
        }
    }
}
