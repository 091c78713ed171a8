//! Numbers that may depend on the place, as a case file writes them.

mod expression;

use crate::model::Quantity;
use expression::Expression;
use serde::Deserialize;
use serde::de::Error as _;
use std::fmt;

/// A constant, or an expression of the coordinates such as `"-2e7 * (1 - x / 1.5)"`: which coordinates there are the
/// mesh has to say, and until then an expression is a text.
#[derive(Clone, Debug)]
pub enum NumberOrExpression {
    /// A finite number.
    Number(f64),
    /// What stands in quotes.
    Expression(String),
    /// A list: a value for each node of the mesh.
    Nodes(Vec<f64>),
}

/// The three spellings.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number or an expression of the coordinates in quotes (or a list with a number for each node)"
)]
enum Spelling {
    Number(f64),
    Expression(String),
    Nodes(Vec<f64>),
}

impl<'de> Deserialize<'de> for NumberOrExpression {
    fn deserialize<D: serde::Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        match Spelling::deserialize(from)? {
            Spelling::Number(value) if value.is_finite() => Ok(Self::Number(value)),
            Spelling::Number(value) => {
                Err(D::Error::custom(format!("{value} is not a finite number")))
            }
            Spelling::Expression(text) => Ok(Self::Expression(text)),
            Spelling::Nodes(values) => match values.iter().position(|v| !v.is_finite()) {
                None => Ok(Self::Nodes(values)),
                Some(i) => Err(D::Error::custom(format!(
                    "value {i} of the list (counted from 0) is {}, which is not a finite number",
                    values[i]
                ))),
            },
        }
    }
}

impl NumberOrExpression {
    /// What it means in D dimensions; if nothing, why not.
    pub(super) fn quantity<const D: usize>(&self) -> Result<Quantity<D>, String> {
        match self {
            &Self::Number(value) => Ok(value.into()),
            Self::Expression(text) => {
                let expression = Expression::<D>::parse(text)?;
                Ok(Quantity::described(text, move |x| expression.at(x)))
            }
            Self::Nodes(values) => Ok(Quantity::at_nodes(values.clone())),
        }
    }
}

impl fmt::Display for NumberOrExpression {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Number(value) => write!(f, "{value}"),
            Self::Expression(text) => f.write_str(text),
            Self::Nodes(values) => write!(f, "{} values at the nodes", values.len()),
        }
    }
}
