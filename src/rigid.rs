//! Rigid-body motions of points: translations and rotations in the plane and in space.
//!
//! Rotations are about the centre of a [`Frame`] and divided by its size, so that their entries are as large as those
//! of translations, whatever the unit of length.

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
