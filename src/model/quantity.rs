//! Numbers that may depend on the place.

use std::fmt;
use std::sync::Arc;

/// A number, or a function of the place such as `|x: [f64; 2]| -2e7 * (1.0 - x[0] / 1.5)`.
#[derive(Clone)]
pub struct Quantity<const D: usize = 2>(Form<D>);

#[derive(Clone)]
enum Form<const D: usize> {
    Constant(f64),
    Function {
        at: Arc<dyn Fn([f64; D]) -> f64 + Send + Sync>,
        /// What descriptions print for it.
        text: Arc<str>,
    },
}

impl<const D: usize> Quantity<D> {
    /// A function of the place with the text that descriptions print for it.
    pub fn described(text: &str, at: impl Fn([f64; D]) -> f64 + Send + Sync + 'static) -> Self {
        Self(Form::Function {
            at: Arc::new(at),
            text: text.into(),
        })
    }

    /// The value at a point.
    pub fn at(&self, x: [f64; D]) -> f64 {
        match &self.0 {
            Form::Constant(value) => *value,
            Form::Function { at, .. } => at(x),
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
            Form::Function { text, .. } => f.write_str(text),
        }
    }
}

impl<const D: usize> fmt::Debug for Quantity<D> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "Quantity({self})")
    }
}
