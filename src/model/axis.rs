//! Directions about an axis: those of cylindrical coordinates.

use super::stated;
use crate::mesh::vector::{cross, dot, length, minus, unit};
use serde::{Deserialize, Serialize};
use std::fmt;

/// The names of the directions about an axis, in the order of a right-handed system.
pub(super) const AROUND: [&str; 3] = ["radial", "hoop", "axial"];

/// An axis in space; in the plane a point, where the axis is perpendicular to the plane.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(
    deny_unknown_fields,
    expecting = "a table such as { point = [0, 0] } or, in space, { point = [0, 0, 0], direction = [0, 0, 1] }"
)]
pub struct Axis<const D: usize = 2> {
    #[serde(
        deserialize_with = "stated::point",
        serialize_with = "<[f64] as Serialize>::serialize"
    )]
    point: [f64; D],
    /// Of any length; none in the plane, where it is (0, 0, 1).
    #[serde(default, deserialize_with = "stated::direction::<_, D>")]
    direction: Option<[f64; 3]>,
}

impl Axis {
    /// The axis of a point of the plane.
    pub fn at(point: [f64; 2]) -> Self {
        Self::through(point, None)
    }
}

impl Axis<3> {
    /// Through a point, along a direction of any length.
    pub fn new(point: [f64; 3], direction: [f64; 3]) -> Self {
        Self::through(point, Some(direction))
    }
}

impl<const D: usize> Axis<D> {
    /// In D dimensions; in the plane without a direction.
    pub(crate) fn through(point: [f64; D], direction: Option<[f64; 3]>) -> Self {
        Self { point, direction }
    }

    pub(super) fn stated(self) -> ([f64; D], Option<[f64; 3]>) {
        (self.point, self.direction)
    }

    fn direction(&self) -> [f64; 3] {
        self.direction.unwrap_or([0.0, 0.0, 1.0])
    }

    /// Its inconsistency.
    pub(crate) fn fault(&self) -> Option<&'static str> {
        if D == 3 && self.direction.is_none() {
            return Some(
                "an axis in space needs a direction: axis = { point = [x, y, z], direction = [x, y, z] }",
            );
        }
        let finite = |x: &[f64]| x.iter().all(|v| v.is_finite());
        let direction = self.direction();
        let is_axis = finite(&self.point) && finite(&direction) && length(direction) > 0.0;
        (!is_axis).then_some("an axis needs a finite point and a direction that is not zero")
    }

    /// The vector from the axis to a point, perpendicular to the axis.
    pub(super) fn arm(&self, x: [f64; D]) -> [f64; 3] {
        let (way, along) = (spatial(minus(x, self.point)), unit(self.direction()));
        let part = dot(way, along);
        std::array::from_fn(|c| way[c] - part * along[c])
    }

    /// The same in D dimensions.
    pub(super) fn across(&self, x: [f64; D]) -> [f64; D] {
        flat(self.arm(x))
    }

    /// Whether another axis is along the same line, in a model of this size.
    pub(super) fn is_along(&self, other: &Self, size: f64) -> bool {
        let along: [f64; D] = flat(unit(other.direction()));
        [0.0, size].iter().all(|far| {
            let end = std::array::from_fn(|c| other.point[c] + far * along[c]);
            length(self.arm(if D == 2 { other.point } else { end })) <= 1e-6 * size
        })
    }

    /// A point after a turn about the axis by an angle in radians, by the right-hand rule.
    pub(crate) fn turned(&self, x: [f64; D], angle: f64) -> [f64; D] {
        let (sin, cos) = angle.sin_cos();
        let (arm, turn) = (flat::<D>(self.arm(x)), self.turn(x));
        std::array::from_fn(|c| x[c] + (cos - 1.0) * arm[c] + sin * turn[c])
    }

    /// The motion of a point under a rotation about the axis: perpendicular to the axis and the arm, as long as the
    /// arm.
    pub(super) fn turn(&self, x: [f64; D]) -> [f64; D] {
        flat(cross(unit(self.direction()), self.arm(x)))
    }

    /// The unit vectors outwards, around and along at a point; in the plane the last is zero. None on the axis, or
    /// closer to it than `least`.
    pub(super) fn directions(&self, x: [f64; D], least: f64) -> Option<[[f64; D]; 3]> {
        let arm = self.arm(x);
        if !(length(arm) > least) {
            return None;
        }
        let (along, outwards) = (unit(self.direction()), unit(arm));
        Some([outwards, cross(along, outwards), along].map(flat))
    }

    /// Such unit vectors, where the first is any vector perpendicular to the axis.
    pub(super) fn any_directions(&self) -> [[f64; D]; 3] {
        let along = unit(self.direction());
        let least = |a: &usize, b: &usize| along[*a].abs().total_cmp(&along[*b].abs());
        let axis = (0..3).min_by(least).unwrap_or(0);
        let far = std::array::from_fn(|c| f64::from(u8::from(c == axis)));
        let outwards = unit(cross(along, cross(far, along)));
        [outwards, cross(along, outwards), along].map(flat)
    }
}

impl<const D: usize> fmt::Display for Axis<D> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let point = self.point;
        match self.direction {
            Some(direction) => write!(f, "the axis through {point:?} along {direction:?}"),
            None => write!(f, "the point {point:?}"),
        }
    }
}

/// A vector of the plane in space.
fn spatial<const D: usize>(v: [f64; D]) -> [f64; 3] {
    std::array::from_fn(|c| v.get(c).copied().unwrap_or(0.0))
}

/// The components of a vector in D dimensions.
fn flat<const D: usize>(v: [f64; 3]) -> [f64; D] {
    std::array::from_fn(|c| v[c])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_are_those_of_a_cylinder() {
        let axis = Axis::new([1.0, 2.0, 3.0], [0.0, 0.0, -2.0]);
        let found = axis.directions([4.0, 2.0, 9.0], 0.0);
        let expected = [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
        assert_eq!(found, Some(expected));
        assert_eq!(axis.turn([4.0, 2.0, 9.0]), [0.0, -3.0, 0.0]);
        assert_eq!(axis.directions([1.0, 2.0, 7.0], 0.0), None);
        let plane = Axis::at([1.0, 0.0]);
        let found = plane.directions([1.0, 2.0], 0.0);
        assert_eq!(found, Some([[0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]]));
        assert!(Axis::new([0.0; 3], [0.0; 3]).fault().is_some());
        assert!(axis.fault().is_none() && plane.fault().is_none());
    }
}
