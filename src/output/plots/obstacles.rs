//! The part of a rigid obstacle near its contact, as triangles.

use crate::contact::{Obstacle, frame};
use crate::mesh::vector::{bounds, cross, dot, length, minus, unit};
use crate::mesh::{ElementKind, Topology};
use crate::model::Elastic;
use std::f64::consts::{FRAC_PI_2, PI};

/// The margin of the drawing beyond the near part, as a part of the size of the mesh.
const AROUND: f64 = 0.07;
/// The distance that counts as near, as a part of that size.
const NEAR: f64 = 0.02;
/// Facets along a half circle.
const ROUND: f64 = 48.0;

/// A patch of a surface: rows of points.
pub(super) struct Patch {
    pub rows: Vec<Vec<[f64; 3]>>,
}

impl Patch {
    /// Its triangles.
    pub fn triangles(&self) -> impl Iterator<Item = [[f64; 3]; 3]> {
        let pairs = self.rows.windows(2).flat_map(|rows| {
            (1..rows[0].len()).map(|k| [rows[0][k - 1], rows[0][k], rows[1][k], rows[1][k - 1]])
        });
        pairs.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
    }

    /// The lines along its border.
    pub fn outline(&self) -> Vec<Vec<[f64; 3]>> {
        let column = |of: fn(&Vec<[f64; 3]>) -> Option<&[f64; 3]>| -> Vec<[f64; 3]> {
            self.rows.iter().filter_map(of).copied().collect()
        };
        let ends = [self.rows.first(), self.rows.last()];
        let mut lines: Vec<_> = ends.into_iter().flatten().cloned().collect();
        let sides = [column(|row| row.first()), column(|row| row.last())];
        // A closed surface has no sides.
        if sides[0] != sides[1] {
            lines.extend(sides);
        }
        lines
    }
}

/// The rigid obstacles of a case, each with the places of its contact, and the size of the mesh.
fn obstacles<const D: usize>(
    elastic: &Elastic<D>,
) -> (f64, impl Iterator<Item = (Obstacle<D>, Vec<[f64; D]>)>)
where
    ElementKind: Topology<D>,
{
    let (low, high) = elastic.mesh.bounding_box();
    let all = (elastic.pairs.iter().enumerate()).filter_map(|(number, pair)| {
        let places: Vec<[f64; D]> = (elastic.contact.places.iter().zip(&elastic.pair_of))
            .filter(|&(_, &owner)| owner as usize == number)
            .map(|(place, _)| place.place)
            .collect();
        Some((pair.obstacle?, places)).filter(|(_, places)| !places.is_empty())
    });
    (length(minus(high, low)), all)
}

/// The patches of the rigid obstacles of a case in space.
pub(super) fn patches(elastic: &Elastic<3>) -> Vec<Patch> {
    let (size, all) = obstacles(elastic);
    let near = |(obstacle, mut places): (Obstacle<3>, Vec<[f64; 3]>)| {
        let distance = |x: &[f64; 3]| obstacle.distance(*x).0;
        let nearest = places.iter().map(distance).fold(f64::INFINITY, f64::min);
        places.retain(|x| distance(x) <= nearest + NEAR * size);
        patch(&obstacle, &places, AROUND * size)
    };
    all.map(near).collect()
}

/// The rigid obstacles of a case in the plane, as bands below their surfaces.
pub(super) fn bands(elastic: &Elastic<2>) -> Vec<Patch> {
    let (size, all) = obstacles(elastic);
    all.map(|(obstacle, places)| band(&obstacle, &places, AROUND * size))
        .collect()
}

/// The part of an obstacle of the plane around some places, as deep as the margin.
fn band(obstacle: &Obstacle<2>, places: &[[f64; 2]], margin: f64) -> Patch {
    let places: Vec<[f64; 3]> = places.iter().map(|&[x, y]| [x, y, 0.0]).collect();
    let across = |[x, y, _]: [f64; 3]| [-y, x, 0.0];
    let rows: [Vec<[f64; 3]>; 2] = match *obstacle {
        Obstacle::HalfSpace { point, normal } => {
            let (point, normal) = ([point[0], point[1], 0.0], unit([normal[0], normal[1], 0.0]));
            let axis = across(normal);
            let ends = range(&places, |x| dot(minus(x, point), axis), margin);
            [0.0, -margin].map(|h| {
                ends.map(|s| along(point, &[(s, axis), (h, normal)]))
                    .to_vec()
            })
        }
        // A cylinder along an axis of the plane does not exist there.
        Obstacle::Sphere { center, radius }
        | Obstacle::Cylinder {
            point: center,
            radius,
            ..
        } => {
            let center = [center[0], center[1], 0.0];
            let first = towards(places.iter().map(|&x| minus(x, center)));
            let axes = [first, across(first)];
            let angle = |x| {
                let to = minus(x, center);
                dot(to, axes[1]).atan2(dot(to, axes[0]))
            };
            let ends = range(&places, angle, margin / radius).map(|phi| phi.clamp(-PI, PI));
            [radius, (radius - margin).max(0.0)].map(|r| {
                steps(ends)
                    .map(|phi| on_circle(center, r, phi, axes))
                    .collect()
            })
        }
    };
    Patch {
        rows: rows.to_vec(),
    }
}

/// The part of an obstacle around some places.
fn patch(obstacle: &Obstacle<3>, places: &[[f64; 3]], margin: f64) -> Patch {
    let rows = match *obstacle {
        Obstacle::HalfSpace { point, normal } => {
            let axes = frame(unit(normal));
            let ends = [1, 2].map(|c| range(places, |x| dot(minus(x, point), axes[c]), margin));
            let corner = |a: f64, b: f64| along(point, &[(a, axes[1]), (b, axes[2])]);
            let [[a, b], [c, d]] = ends;
            let rows = [a, b].map(|s| vec![corner(s, c), corner(s, d)]);
            rows.to_vec()
        }
        Obstacle::Sphere { center, radius } => {
            let axes = frame(towards(places.iter().map(|&x| minus(x, center))));
            let angle = |x| dot(unit(minus(x, center)), axes[0]).clamp(-1.0, 1.0).acos();
            let widest = range(places, angle, margin / radius)[1].min(PI);
            let rows = steps([0.0, widest]).map(|theta| {
                let (across, up) = (radius * theta.sin(), radius * theta.cos());
                let centre = along(center, &[(up, axes[0])]);
                around(|phi| on_circle(centre, across, phi, [axes[1], axes[2]]))
            });
            rows.collect()
        }
        Obstacle::Cylinder {
            point,
            axis,
            radius,
        } => {
            let axis = unit(axis);
            let across = |x: [f64; 3]| {
                let to = minus(x, point);
                along(to, &[(-dot(to, axis), axis)])
            };
            let first = towards(places.iter().map(|&x| across(x)));
            let first = unit(along(first, &[(-dot(first, axis), axis)]));
            let second = cross(axis, first);
            let angle = |x| dot(across(x), second).atan2(dot(across(x), first));
            let [from, to] = range(places, |x| dot(minus(x, point), axis), margin);
            let ends = range(places, angle, margin / radius);
            let is_closed = ends[1] - ends[0] > 3.0 * FRAC_PI_2;
            let row = |s: f64| {
                let centre = along(point, &[(s, axis)]);
                let at = |phi: f64| on_circle(centre, radius, phi, [first, second]);
                if is_closed {
                    around(at)
                } else {
                    steps(ends).map(at).collect()
                }
            };
            vec![row(from), row(to)]
        }
    };
    Patch { rows }
}

/// A point and multiples of some directions.
fn along(point: [f64; 3], parts: &[(f64, [f64; 3])]) -> [f64; 3] {
    std::array::from_fn(|c| point[c] + parts.iter().map(|(s, axis)| s * axis[c]).sum::<f64>())
}

/// The point at an angle from the first of two directions on to the second.
fn on_circle(centre: [f64; 3], radius: f64, angle: f64, [a, b]: [[f64; 3]; 2]) -> [f64; 3] {
    let (sin, cos) = angle.sin_cos();
    along(centre, &[(radius * cos, a), (radius * sin, b)])
}

/// The mean direction of vectors; an arbitrary one if it is undefined.
fn towards(vectors: impl Iterator<Item = [f64; 3]>) -> [f64; 3] {
    let sum = vectors.fold([0.0; 3], |sum, v| std::array::from_fn(|c| sum[c] + v[c]));
    if sum == [0.0; 3] {
        [1.0, 0.0, 0.0]
    } else {
        unit(sum)
    }
}

/// The least and the largest of a coordinate, and a margin.
fn range(places: &[[f64; 3]], of: impl Fn([f64; 3]) -> f64, margin: f64) -> [f64; 2] {
    let ([low], [high]) = bounds(places.iter().map(|&x| [of(x)]));
    [low - margin, high + margin]
}

/// Angles in a range, ends included.
fn steps([from, to]: [f64; 2]) -> impl Iterator<Item = f64> {
    let count = (ROUND * (to - from) / PI).ceil().max(1.0);
    (0..=count as usize).map(move |k| from + (to - from) * k as f64 / count)
}

/// Points all around, with the first repeated at the end.
fn around(point: impl Fn(f64) -> [f64; 3]) -> Vec<[f64; 3]> {
    let mut row: Vec<[f64; 3]> = steps([0.0, 2.0 * PI]).map(point).collect();
    // To the last bit.
    row.pop();
    row.extend(row.first().copied());
    row
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_lie_on_their_obstacles_and_reach_around_the_places() {
        let places = [[0.1, 0.0, 1.0], [0.0, 0.2, 1.1], [-0.1, -0.1, 0.9]];
        let (point, normal) = ([5.0, 3.0, 0.5], [0.0, 0.0, 3.0]);
        let plane = Obstacle::HalfSpace { point, normal };
        let (center, radius) = ([0.0, 0.0, -1.0], 1.5);
        let sphere = Obstacle::Sphere { center, radius };
        let (point, axis, radius) = ([0.0, 7.0, 0.0], [0.0, 2.0, 0.0], 0.5);
        let cylinder = Obstacle::Cylinder {
            point,
            axis,
            radius,
        };
        for obstacle in [plane, sphere, cylinder] {
            let patch = patch(&obstacle, &places, 0.3);
            let points = || patch.triangles().flatten();
            assert!(points().all(|x| obstacle.distance(x).0.abs() < 1e-12));
            for c in [0, 1] {
                let [low, high] = range(&points().collect::<Vec<_>>(), |x| x[c], 0.0);
                assert!(low < -0.2 && high > 0.25, "{obstacle:?}: {low} {high}");
            }
            assert!(!patch.outline().is_empty());
        }
    }

    #[test]
    fn bands_begin_at_their_obstacles_and_go_inwards() {
        let places = [[0.1, 0.5], [0.0, 0.6], [-0.1, 0.45]];
        let (point, normal) = ([5.0, 0.4], [0.0, 3.0]);
        let (center, radius) = ([0.0, -1.0], 1.4);
        for obstacle in [
            Obstacle::HalfSpace { point, normal },
            Obstacle::Sphere { center, radius },
        ] {
            let Patch { rows } = band(&obstacle, &places, 0.3);
            for (row, depth) in rows.iter().zip([0.0, -0.3]) {
                let distance = |&[x, y, _]: &[f64; 3]| obstacle.distance([x, y]).0;
                assert!(
                    row.iter().all(|x| (distance(x) - depth).abs() < 1e-12),
                    "{row:?}"
                );
            }
            let [low, high] = range(&rows[0], |x| x[0], 0.0);
            assert!(low < -0.3 && high > 0.3, "{low} {high}");
        }
    }
}
