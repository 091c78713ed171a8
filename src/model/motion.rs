//! How supports turn and obstacles move: by rigid motions that grow with load factors.

use super::axis::Axis;
use super::stated;
use crate::contact::Obstacle;
use serde::{Deserialize, Serialize};

/// A turn about an axis, by an angle in degrees under the load factor 1.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { point = [0, 0], angle = 90 } or, in space, { point = [0, 0, 0], axis = [0, 0, 1], angle = 90 }"
)]
pub(crate) struct Turn<const D: usize> {
    #[serde(
        deserialize_with = "stated::point",
        serialize_with = "<[f64] as Serialize>::serialize"
    )]
    pub(super) point: [f64; D],
    /// Of any length; in space only.
    #[serde(default, deserialize_with = "stated::axis::<_, D>")]
    axis: Option<[f64; 3]>,
    angle: f64,
}

impl<const D: usize> Turn<D> {
    pub(super) fn new(axis: Axis<D>, angle: f64) -> Self {
        let (point, axis) = axis.stated();
        Self { point, axis, angle }
    }

    pub(super) fn fault(&self) -> Option<&'static str> {
        match self.angle.is_finite() {
            true => Axis::through(self.point, self.axis).fault(),
            false => Some("the angle of a turn must be finite, in degrees"),
        }
    }

    /// Where a point goes under a load factor.
    pub(super) fn at(&self, x: [f64; D], factor: f64) -> [f64; D] {
        Axis::through(self.point, self.axis).turned(x, (factor * self.angle).to_radians())
    }
}

/// How an obstacle moves: a turn, then a shift, both in proportion to a load factor.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { shift = [0, -0.1] }"
)]
pub struct Motion<const D: usize = 2> {
    #[serde(
        default,
        deserialize_with = "stated::vector",
        serialize_with = "stated::entries"
    )]
    shift: Option<[f64; D]>,
    rotate: Option<Turn<D>>,
    pub(super) factors: Option<Vec<f64>>,
}

impl<const D: usize> Motion<D> {
    /// By a vector in m.
    pub fn shift(shift: [f64; D]) -> Self {
        Self {
            shift: Some(shift),
            ..Self::default()
        }
    }

    /// About an axis, by an angle in degrees; in the plane counter-clockwise.
    pub fn turn(axis: Axis<D>, angle: f64) -> Self {
        Self {
            rotate: Some(Turn::new(axis, angle)),
            ..Self::default()
        }
    }

    /// Followed by a shift by a vector in m.
    pub fn and_shift(mut self, shift: [f64; D]) -> Self {
        self.shift = Some(shift);
        self
    }

    /// Load factors of its own, one per step.
    pub fn factors(mut self, factors: impl Into<Vec<f64>>) -> Self {
        self.factors = Some(factors.into());
        self
    }

    pub(super) fn fault(&self) -> Option<&'static str> {
        let shift = self.shift.unwrap_or([0.0; D]);
        match &self.rotate {
            _ if !shift.iter().all(|v| v.is_finite()) => {
                Some("the shift of a motion must be finite")
            }
            None if self.shift.is_none() => Some("a motion needs shift or rotate"),
            Some(turn) => turn.fault(),
            None => None,
        }
    }
}

/// A [`Motion`], if there is one, under a load factor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Moved<'m, const D: usize> {
    pub of: Option<&'m Motion<D>>,
    pub factor: f64,
}

impl<const D: usize> Moved<'_, D> {
    /// The present place of a point of the obstacle.
    fn point(&self, x: [f64; D]) -> [f64; D] {
        let Some(motion) = self.of else { return x };
        let turned = (motion.rotate).map_or(x, |turn| turn.at(x, self.factor));
        let shift = motion.shift.unwrap_or([0.0; D]);
        std::array::from_fn(|c| turned[c] + self.factor * shift[c])
    }

    /// Where it was at rest.
    fn back(&self, x: [f64; D]) -> [f64; D] {
        let Some(motion) = self.of else { return x };
        let shift = motion.shift.unwrap_or([0.0; D]);
        let x = std::array::from_fn(|c| x[c] - self.factor * shift[c]);
        motion.rotate.map_or(x, |turn| turn.at(x, -self.factor))
    }

    /// Where a point that moves along goes from here to another factor.
    pub fn carried(&self, x: [f64; D], to: &Self) -> [f64; D] {
        match self.of {
            None => x,
            Some(_) => to.point(self.back(x)),
        }
    }

    /// The obstacle in its place.
    pub fn obstacle(&self, obstacle: &Obstacle<D>) -> Obstacle<D> {
        let direction = |base: [f64; D], v: [f64; D]| {
            let (to, from) = (std::array::from_fn(|c| base[c] + v[c]), self.point(base));
            let to = self.point(to);
            std::array::from_fn(|c| to[c] - from[c])
        };
        match *obstacle {
            _ if self.of.is_none() => *obstacle,
            Obstacle::HalfSpace { point, normal } => Obstacle::HalfSpace {
                point: self.point(point),
                normal: direction(point, normal),
            },
            Obstacle::Sphere { center, radius } => Obstacle::Sphere {
                center: self.point(center),
                radius,
            },
            Obstacle::Cylinder {
                point,
                axis,
                radius,
            } => Obstacle::Cylinder {
                point: self.point(point),
                axis: direction(point, axis),
                radius,
            },
        }
    }
}
