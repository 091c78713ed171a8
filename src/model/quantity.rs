//! Numbers that may depend on the place.

mod expression;

use super::stated::meaningless;
use expression::Expression;
use serde::de::Error as _;
use serde::ser::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt;
use std::sync::Arc;

/// A number, a function of the place such as `|x: [f64; 2]| -2e7 * (1.0 - x[0] / 1.5)`, or a value for each node of the mesh
/// ([`Quantity::at_nodes`]).
#[derive(Clone)]
pub struct Quantity<const D: usize = 2>(Form<D>);

/// The text for values at nodes in descriptions.
pub(super) const NODAL: &str = "values at the nodes";

#[derive(Clone)]
enum Form<const D: usize> {
    Constant(f64),
    /// Its text, and its meaning.
    Expression(Arc<str>, Expression<D>),
    Function {
        at: Arc<dyn Fn([f64; D]) -> f64 + Send + Sync>,
        /// Its text in descriptions.
        text: Arc<str>,
    },
    /// A value for each node of the mesh, which a model turns into a function of the place on its boundary or region.
    Nodes(Arc<[f64]>),
}

impl<const D: usize> Quantity<D> {
    /// A function of the place with the text that descriptions print for it.
    pub fn described(text: &str, at: impl Fn([f64; D]) -> f64 + Send + Sync + 'static) -> Self {
        Self(Form::Function {
            at: Arc::new(at),
            text: text.into(),
        })
    }

    /// A value for each node of the mesh. Between nodes shape functions interpolate, only on the boundaries (in the
    /// region) that it is stated for, so that touching bodies may have different ones.
    ///
    /// ```
    /// use signorini::elasticity::Material;
    /// use signorini::mesh::structured::{CellShape, rectangle};
    /// use signorini::model::{Model, Quantity, Support, Traction};
    ///
    /// let mesh = rectangle([0.0; 2], [2.0, 1.0], [4, 2], CellShape::Quad, "body", "");
    /// let pressure = mesh.nodes.iter().map(|x| 1e6 * (1.0 + x[0])).collect::<Vec<f64>>();
    /// let built = Model::on(mesh)
    ///     .material(Material::new(2.1e11, 0.3))
    ///     .support(Support::on("bottom").fixed())
    ///     .traction(Traction::on("top").pressure(Quantity::at_nodes(pressure)))
    ///     .build()?;
    /// // The resultant of the linear pressure over 0 ≤ x ≤ 2.
    /// assert!((built.step(0)?.total_load[1] + 4e6).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn at_nodes(values: impl Into<Vec<f64>>) -> Self {
        Self(Form::Nodes(values.into().into()))
    }

    /// An expression of the coordinates such as `-2e7 * (1 - x / 1.5)`.
    pub(crate) fn parse(text: &str) -> Result<Self, String> {
        Ok(Self(Form::Expression(
            text.into(),
            Expression::parse(text)?,
        )))
    }

    /// The values at the nodes, where it consists of these.
    pub(super) fn nodal(&self) -> Option<&[f64]> {
        match &self.0 {
            Form::Nodes(values) => Some(values),
            _ => None,
        }
    }

    /// The value at a point; NaN for values at nodes that belong to no mesh yet.
    pub fn at(&self, x: [f64; D]) -> f64 {
        match &self.0 {
            Form::Constant(value) => *value,
            Form::Expression(_, expression) => expression.at(x),
            Form::Function { at, .. } => at(x),
            Form::Nodes(_) => f64::NAN,
        }
    }

    /// The value at a point, where ∞ and values beyond `most` mean that.
    pub(super) fn at_most(&self, x: [f64; D], most: f64) -> f64 {
        match self.at(x) {
            value if value > most => most,
            value => value,
        }
    }
}

/// A number as text, with a point or an exponent, that reads back as the same number.
#[cfg(feature = "case")]
pub(crate) struct Number(pub f64);

#[cfg(feature = "case")]
impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let size = self.0.abs();
        match size == 0.0 || (1e-3..1e6).contains(&size) {
            true => write!(f, "{:?}", self.0),
            false => write!(f, "{:e}", self.0),
        }
    }
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

/// A number, an expression of the coordinates such as `"-2e7 * (1 - x / 1.5)"`, or a list with a value for each node.
impl<'de, const D: usize> Deserialize<'de> for Quantity<D> {
    fn deserialize<S: Deserializer<'de>>(from: S) -> Result<Self, S::Error> {
        Self::read(from, f64::is_finite)
    }
}

impl<const D: usize> Quantity<D> {
    /// The quantity with numbers that `fits` allows.
    fn read<'de, S: Deserializer<'de>>(from: S, fits: fn(f64) -> bool) -> Result<Self, S::Error> {
        match Spelling::deserialize(from)? {
            Spelling::Number(value) if fits(value) => Ok(value.into()),
            Spelling::Number(value) => {
                Err(S::Error::custom(format!("{value} is not a finite number")))
            }
            Spelling::Expression(text) => Self::parse(&text).map_err(meaningless),
            Spelling::Nodes(values) => match values.iter().position(|&v| !fits(v)) {
                None => Ok(Self::at_nodes(values)),
                Some(i) => Err(S::Error::custom(format!(
                    "value {i} of the list (counted from 0) is {}, which is not a finite number",
                    values[i]
                ))),
            },
        }
    }

    /// The quantity, where ∞ has a meaning: no obstacle in the way of a gap, no slip under a bound or a coefficient.
    pub(super) fn or_infinite<'de, S: Deserializer<'de>>(from: S) -> Result<Self, S::Error> {
        Self::read(from, |v| v > f64::NEG_INFINITY)
    }
}

/// As it is read; a function stated by a program has no such form.
impl<const D: usize> Serialize for Quantity<D> {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match &self.0 {
            Form::Constant(value) => to.serialize_f64(*value),
            Form::Expression(text, _) => to.serialize_str(text),
            Form::Nodes(values) => values.serialize(to),
            Form::Function { text, .. } => Err(S::Error::custom(format!(
                "{text} cannot be written as an expression"
            ))),
        }
    }
}

impl<const D: usize> From<f64> for Quantity<D> {
    fn from(value: f64) -> Self {
        Self(Form::Constant(value))
    }
}

impl<const D: usize, F: Fn([f64; D]) -> f64 + Send + Sync + 'static> From<F> for Quantity<D> {
    fn from(at: F) -> Self {
        Self::described("a function of the place", at)
    }
}

impl<const D: usize> fmt::Display for Quantity<D> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.0 {
            Form::Constant(value) => write!(f, "{value}"),
            Form::Expression(text, _) | Form::Function { text, .. } => f.write_str(text),
            Form::Nodes(_) => f.write_str(NODAL),
        }
    }
}

impl<const D: usize> fmt::Debug for Quantity<D> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Quantity({self})")
    }
}
