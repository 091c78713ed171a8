//! Numbers that may depend on the place, as a case file writes them.

mod expression;

use crate::model::Quantity;
use expression::Expression;
use serde::Deserialize;
use serde::de::Error as _;

/// A constant, or an expression of x and y such as `"-2e7 * (1 - x / 1.5)"`.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number or an expression of x and y in quotes"
)]
enum Text {
    Number(f64),
    Expression(String),
}

impl<'de> Deserialize<'de> for Quantity {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        match Text::deserialize(from)? {
            Text::Number(value) if value.is_finite() => Ok(value.into()),
            Text::Number(value) => Err(D::Error::custom(format!("{value} is not a finite number"))),
            Text::Expression(text) => {
                let expression = Expression::parse(&text).map_err(D::Error::custom)?;
                Ok(Self::described(&text, move |x| expression.at(x)))
            }
        }
    }
}
