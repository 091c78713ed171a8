//! Rigid-body motions of points: translations and rotations in the plane and in space.
//!
//! Rotations among small motions are about the centre of a [`Frame`] and divided by its size, so that their entries are as large as those
//! of translations, whatever the unit of length. A [`Rotation`] may be large.

use crate::dense::symmetric_eigen;
use faer::Mat;

/// Rigid motions in a space of this many dimensions: 3 in the plane, 6 in space.
pub(crate) const fn count(dimension: usize) -> usize {
    dimension * (dimension + 1) / 2
}

/// Planes that rotations turn, of the first axis towards the second one: in the plane that of z, in space those of
/// x, y and z.
const TURNS: [(usize, usize); 3] = [(1, 2), (2, 0), (0, 1)];

/// The origin and scale of rigid-body motions.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame<const D: usize> {
    /// The fixed point of rotations.
    pub centre: [f64; D],
    /// The distance at which a rotation moves by as much as a translation; above 0.
    pub size: f64,
}

impl<const D: usize> Frame<D> {
    /// About the middle of the box around the points, whose longest edge is the size; 0 counts as 1.
    pub fn of_box<'a>(
        points: impl IntoIterator<Item = &'a [f64; D]>,
        size: impl Fn([f64; D]) -> f64,
    ) -> Self {
        let (mut low, mut high) = ([f64::INFINITY; D], [f64::NEG_INFINITY; D]);
        for x in points {
            for c in 0..D {
                low[c] = low[c].min(x[c]);
                high[c] = high[c].max(x[c]);
            }
        }
        Self {
            centre: std::array::from_fn(|c| 0.5 * (low[c] + high[c])),
            size: match size(std::array::from_fn(|c| high[c] - low[c])) {
                0.0 => 1.0,
                size => size,
            },
        }
    }

    /// The first M rigid-body motions at x, `[c][k]` being the component c of motion k. They are translations along the
    /// axes, then the rotation of the plane, or those about x, y and z; zero beyond [`count`].
    pub fn motions<const M: usize>(&self, x: &[f64; D]) -> [[f64; M]; D] {
        const { assert!((D == 2 || D == 3) && D <= M) };
        let mut motions = [[0.0; M]; D];
        for c in 0..D {
            motions[c][c] = 1.0;
        }
        let offset = |c: usize| (x[c] - self.centre[c]) / self.size;
        let turns = &TURNS[if D == 2 { 2 } else { 0 }..];
        for (k, &(a, b)) in (D..M).zip(turns) {
            motions[a][k] = -offset(b);
            motions[b][k] = offset(a);
        }
        motions
    }
}

/// Euclidean length of a vector of few components.
pub(crate) fn length(x: &[f64]) -> f64 {
    x.iter().fold(0.0, |length: f64, v| length.hypot(*v))
}

/// A rotation, of the plane or of space: a unit quaternion, in the plane with its last entry alone.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rotation<const D: usize> {
    /// The cosine of half the angle, and the axis times its sine.
    half: [f64; 4],
}

impl<const D: usize> Rotation<D> {
    /// About the axes by a rotation vector: in the plane one number, about z.
    pub fn by(vector: &[f64]) -> Self {
        let angle = length(vector);
        let part = match angle {
            0.0 => 0.5,
            angle => (0.5 * angle).sin() / angle,
        };
        let mut half = [(0.5 * angle).cos(), 0.0, 0.0, 0.0];
        let first = half.len() - vector.len();
        half[first..]
            .iter_mut()
            .zip(vector)
            .for_each(|(h, v)| *h = part * v);
        Self { half }
    }

    /// The one that brings arms nearest to others, by least squares: each with its weight, from and to. (Horn, Closed-form solution of
    /// absolute orientation using unit quaternions, 1987.)
    pub fn nearest(arms: impl Iterator<Item = (f64, [f64; D], [f64; D])>) -> Self {
        let mut s = [[0.0; 3]; 3];
        for (weight, from, to) in arms {
            for a in 0..D {
                for b in 0..D {
                    s[a][b] += weight * from[a] * to[b];
                }
            }
        }
        if D == 2 {
            let angle = (s[0][1] - s[1][0]).atan2(s[0][0] + s[1][1]);
            return Self::by(&[angle]);
        }
        let size = s
            .as_flattened()
            .iter()
            .fold(0.0, |most: f64, v| most.max(v.abs()));
        let turns = |k: usize| {
            let (a, b) = TURNS[k];
            s[a][b] - s[b][a]
        };
        let trace = s[0][0] + s[1][1] + s[2][2];
        let matrix = Mat::from_fn(4, 4, |i, j| {
            let entry = match (i.min(j), i.max(j)) {
                (0, 0) => trace,
                (0, k) => turns(k - 1),
                (a, b) if a == b => 2.0 * s[a - 1][a - 1] - trace,
                (a, b) => s[a - 1][b - 1] + s[b - 1][a - 1],
            };
            entry / size
        });
        // A single point has no arms.
        let half = match symmetric_eigen(&matrix) {
            Some((_, vectors)) => std::array::from_fn(|i| vectors[(i, 3)]),
            None => [1.0, 0.0, 0.0, 0.0],
        };
        Self { half }.shorter()
    }

    /// The one that brings points nearest to others, each about their mean.
    pub fn between(from: &[[f64; D]], to: &[[f64; D]]) -> Self {
        let arms = |points: &[[f64; D]]| {
            let count = points.len() as f64;
            let mean: [f64; D] =
                std::array::from_fn(|c| points.iter().map(|x| x[c]).sum::<f64>() / count);
            let arms = points
                .iter()
                .map(|x| std::array::from_fn(|c| x[c] - mean[c]));
            arms.collect::<Vec<[f64; D]>>()
        };
        let both = arms(from).into_iter().zip(arms(to));
        Self::nearest(both.map(|(from, to)| (1.0, from, to)))
    }

    /// The one about an axis of space, a unit vector, that brings arms nearest to others.
    pub fn nearest_about(
        axis: [f64; D],
        arms: impl Iterator<Item = (f64, [f64; D], [f64; D])>,
    ) -> Self {
        let inner = |a: [f64; D], b: [f64; D]| (0..D).map(|c| a[c] * b[c]).sum::<f64>();
        let (mut sin, mut cos) = (0.0, 0.0);
        for (weight, from, to) in arms {
            let turn = TURNS.map(|(a, b)| from[a] * to[b] - from[b] * to[a]);
            sin += weight * (0..D).map(|c| axis[c] * turn[c]).sum::<f64>();
            cos += weight * (inner(from, to) - inner(axis, from) * inner(axis, to));
        }
        let angle = f64::atan2(sin, cos);
        Self::by(&axis.map(|v| angle * v))
    }

    /// The same, by the shorter way.
    fn shorter(self) -> Self {
        match self.half[0] < 0.0 {
            true => Self {
                half: self.half.map(|v| -v),
            },
            false => self,
        }
    }

    /// v turned.
    pub fn of(&self, v: [f64; D]) -> [f64; D] {
        let q = &self.half;
        let mut space = [0.0; 3];
        space[..D].copy_from_slice(&v);
        let cross = |a: [f64; 3], b: [f64; 3]| TURNS.map(|(i, j)| a[i] * b[j] - a[j] * b[i]);
        let axis = [q[1], q[2], q[3]];
        let once = cross(axis, space);
        let twice = cross(axis, once);
        std::array::from_fn(|c| v[c] + 2.0 * (q[0] * once[c] + twice[c]))
    }

    /// v turned back.
    pub fn back(&self, v: [f64; D]) -> [f64; D] {
        self.inverse().of(v)
    }

    fn inverse(&self) -> Self {
        let [w, x, y, z] = self.half;
        Self {
            half: [w, -x, -y, -z],
        }
    }

    /// This rotation after another one is taken back.
    pub fn after_back(&self, other: &Self) -> Self {
        let ([a, b, c, d], [w, x, y, z]) = (self.half, other.inverse().half);
        let half = [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ];
        Self { half }
    }

    /// The rotation vector with an angle from 0 to π, or to 2π if it is not the shorter way.
    fn vector(&self) -> Vec<f64> {
        let axis = &self.half[4 - (count(D) - D)..];
        let size = length(axis);
        let factor = match size {
            0.0 => 2.0,
            size => 2.0 * size.atan2(self.half[0]) / size,
        };
        axis.iter().map(|v| factor * v).collect()
    }

    /// Of the rotation vectors that differ by whole rounds, the one nearest to another vector. After a whole round a rotation hardly has
    /// an axis of its own: it is that of the other vector.
    pub fn vector_near(&self, other: &[f64]) -> Vec<f64> {
        use std::f64::consts::{FRAC_PI_2, PI, TAU};
        let vector = self.shorter().vector();
        let (angle, far) = (length(&vector), length(other));
        let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        // Along an axis, with as many rounds as come nearest.
        let along = |axis: &[f64], angle: f64| -> Vec<f64> {
            let rounds = ((inner(axis, other) - angle) / TAU).round();
            axis.iter().map(|a| (angle + TAU * rounds) * a).collect()
        };
        let own = match angle > 0.0 {
            true => along(&vector.iter().map(|v| v / angle).collect::<Vec<_>>(), angle),
            false => vector.clone(),
        };
        let off: Vec<f64> = own
            .iter()
            .zip(other)
            .map(|(own, other)| own - other)
            .collect();
        match far > PI && length(&off) > FRAC_PI_2 {
            true => {
                let axis: Vec<f64> = other.iter().map(|v| v / far).collect();
                along(&axis, inner(&axis, &vector))
            }
            false => own,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// No motion stretches the distance of two points.
    fn rigid<const D: usize, const M: usize>(points: &[[f64; D]]) {
        let frame = Frame::of_box(points, |edges| edges.into_iter().fold(0.0, f64::max));
        for x in points {
            let there = frame.motions::<M>(x);
            assert!(there.as_flattened().iter().all(|v| v.abs() <= 1.0));
            for y in points {
                let here = frame.motions::<M>(y);
                for k in 0..M {
                    let along = |c: usize| (x[c] - y[c]) * (there[c][k] - here[c][k]);
                    assert!((0..D).map(along).sum::<f64>().abs() < 1e-12, "motion {k}");
                }
            }
        }
        assert_eq!(frame.motions::<M>(&frame.centre)[D - 1][M - 1], 0.0);
    }

    #[test]
    fn motions_do_not_stretch() {
        rigid::<2, 3>(&[[0.0, 0.0], [3.0, 1.0], [-2.0, 5.0]]);
        rigid::<3, 6>(&[[0.0, 0.0, 1.0], [3.0, 1.0, -4.0], [-2.0, 5.0, 2.0]]);
    }

    /// Arms that are turned by a vector determine it again, also after whole turns, and turn back.
    #[test]
    fn arms_determine_their_rotation() {
        let arms = [[1.0, 0.2, -0.4], [-0.7, 1.5, 0.3], [0.1, -0.6, 2.0]];
        for by in [
            [0.3, -0.2, 0.9],
            [0.0, 0.0, 0.0],
            [2.0, 1.5, -1.5],
            [0.0, -5.0, 7.0],
        ] {
            let rotation = Rotation::<3>::by(&by);
            let turned = arms.iter().map(|x| (0.5, *x, rotation.of(*x)));
            let found = Rotation::nearest(turned.clone());
            let near: Vec<f64> = by.iter().map(|v| 1.1 * v).collect();
            for (found, expected) in found.vector_near(&near).iter().zip(by) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
            for (_, x, there) in turned {
                let back = found.back(there);
                assert!((0..3).all(|c| (back[c] - x[c]).abs() < 1e-14));
            }
        }
        // Beside a whole round, where the axis of what is left is another one; and on the way to it.
        for (left, before) in [
            ([1e-4, 0.0, 0.0], 6.2),
            ([0.0, 0.0, -0.3], 6.2),
            ([0.0, 1e-3, 0.1], 12.0),
        ] {
            let rounds = (before / std::f64::consts::TAU).round() * std::f64::consts::TAU;
            let found = Rotation::<3>::by(&left).vector_near(&[0.0, 0.0, before]);
            assert!((found[2] - rounds - left[2]).abs() < 1e-3, "{found:?}");
        }
        // About a given axis: what is across it does not count.
        let by = [0.0, 0.0, 0.8];
        let tilted = Rotation::<3>::by(&by);
        let pairs = arms.iter().map(|x| {
            let mut to = tilted.of(*x);
            to[2] += 0.7;
            (1.0, *x, to)
        });
        let found = Rotation::nearest_about([0.0, 0.0, 1.0], pairs).vector_near(&[0.0; 3]);
        assert!(
            (found[2] - 0.8).abs() < 1e-14 && found[0] == 0.0,
            "{found:?}"
        );
        // A point in the plane, and nothing at all.
        let plane = Rotation::<2>::nearest([(1.0, [2.0, 0.0], [0.0, 3.0])].into_iter());
        assert!((plane.vector_near(&[20.0])[0] - 6.5 * std::f64::consts::PI).abs() < 1e-13);
        assert_eq!(
            Rotation::<2>::nearest(std::iter::empty()).of([1.0, 2.0]),
            [1.0, 2.0]
        );
        let none = Rotation::<3>::nearest(std::iter::empty());
        assert_eq!(none.of([1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]);
    }

    #[test]
    fn rotations_are_about_the_axes() {
        let frame = Frame {
            centre: [1.0, 1.0, 1.0],
            size: 2.0,
        };
        let there = frame.motions::<6>(&[3.0, 1.0, 1.0]);
        // A point on the side of x turns about y towards −z, about z towards y.
        assert_eq!(there.map(|row| row[3]), [0.0, 0.0, 0.0]);
        assert_eq!(there.map(|row| row[4]), [0.0, 0.0, -1.0]);
        assert_eq!(there.map(|row| row[5]), [0.0, 1.0, 0.0]);
        // Only translations.
        assert_eq!(
            frame.motions::<3>(&[9.0; 3]),
            [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
        );
        // A single point has no size.
        assert_eq!(Frame::of_box(&[[5.0, 6.0]], |_| 0.0).size, 1.0);
        assert_eq!(length(&[-3.0, 4.0]), 5.0);
    }
}
