//! Convex hulls of the covered part of a facet, and their barycentric functions.

use super::flat::{Flat, area, edges, turn};
use crate::mesh::vector::{length, minus};

/// The largest distance by which a hull may be inside its region, relative to its own least width. A round spot gets
/// some dozen vertices instead of one for every facet along its border, and each still has its own area.
const ROUND: f64 = 1e-2;

/// A convex polygon, counter-clockwise.
#[derive(Clone, Debug)]
pub(super) struct Hull {
    pub vertices: Vec<Flat>,
}

impl Hull {
    /// The hull of points that are not all on one line (Andrew 1979). Of points closer together than `same` one is taken,
    /// because the direction from one to the other is rounding.
    pub fn around(mut points: Vec<Flat>, same: f64) -> Self {
        points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
        let mut kept: Vec<Flat> = Vec::with_capacity(points.len());
        for p in points {
            let beside = kept.iter().rev().take_while(|q| p[0] - q[0] <= same);
            if !beside.into_iter().any(|q| length(minus(p, *q)) <= same) {
                kept.push(p);
            }
        }
        let points = kept;
        let half = |points: &mut dyn Iterator<Item = &Flat>| {
            let mut chain: Vec<Flat> = Vec::new();
            for &p in points {
                while let [.., a, b] = chain[..]
                    && turn(a, b, p) <= 0.0
                {
                    chain.pop();
                }
                chain.push(p);
            }
            chain.pop();
            chain
        };
        let mut vertices = half(&mut points.iter());
        vertices.extend(half(&mut points.iter().rev()));
        Self { vertices }
    }

    /// Without vertices that hardly protrude: those on a straight line, and most of those on an arc.
    pub fn simplified(self) -> Self {
        let n = self.vertices.len();
        let allowed = ROUND * self.width();
        // The two farthest apart stay, and between them those that protrude (Douglas and Peucker 1973).
        let pairs = (0..n).flat_map(|a| (0..a).map(move |b| (b, a)));
        let apart = |&(a, b): &(usize, usize)| length(minus(self.vertices[a], self.vertices[b]));
        let Some((first, last)) = pairs.max_by(|p, q| apart(p).total_cmp(&apart(q))) else {
            return self;
        };
        let mut kept = vec![false; n];
        kept[first] = true;
        kept[last] = true;
        let mut spans = vec![(first, last), (last, first + n)];
        while let Some((from, to)) = spans.pop() {
            let [a, b] = [from, to].map(|k| self.vertices[k % n]);
            let off = |k: &usize| -turn(a, b, self.vertices[k % n]) / length(minus(b, a));
            let Some(farthest) = (from + 1..to).max_by(|k, l| off(k).total_cmp(&off(l))) else {
                continue;
            };
            if off(&farthest) > allowed {
                kept[farthest % n] = true;
                spans.extend([(from, farthest), (farthest, to)]);
            }
        }
        let vertices = self.vertices.iter().zip(kept);
        let vertices: Vec<Flat> = vertices
            .filter_map(|(&v, kept)| kept.then_some(v))
            .collect();
        if vertices.len() < 3 {
            self
        } else {
            Self { vertices }
        }
    }

    /// The distance of a point outside of it.
    pub fn distance(&self, p: Flat) -> f64 {
        if edges(&self.vertices).all(|(a, b)| turn(a, b, p) >= 0.0) {
            return 0.0;
        }
        let to_edge = |(a, b): (Flat, Flat)| {
            let (along, to) = (minus(b, a), minus(p, a));
            let part =
                (along[0] * to[0] + along[1] * to[1]) / (along[0].powi(2) + along[1].powi(2));
            let part = part.clamp(0.0, 1.0);
            length([to[0] - part * along[0], to[1] - part * along[1]])
        };
        edges(&self.vertices)
            .map(to_edge)
            .fold(f64::INFINITY, f64::min)
    }

    /// Its least width, perpendicular to one of its edges.
    pub fn width(&self) -> f64 {
        let widths = edges(&self.vertices).map(|(a, b)| {
            let off = self.vertices.iter().map(|&v| turn(a, b, v));
            off.fold(0.0, f64::max) / length(minus(b, a))
        });
        widths.fold(f64::INFINITY, f64::min)
    }

    /// Its angles, in half turns.
    pub fn angles(&self) -> impl Iterator<Item = f64> {
        let n = self.vertices.len();
        (0..n).map(move |k| {
            let to = |other: usize| minus(self.vertices[other % n], self.vertices[k]);
            let ([a, b], [c, d]) = (to(k + 1), to(k + n - 1));
            (a * d - b * c).atan2(a * c + b * d) / std::f64::consts::PI
        })
    }

    /// Its barycentric functions at a point inside (Wachspress 1975): they add up to 1, have the point as the mean of the
    /// vertices, and are linear along edges.
    pub fn functions(&self, p: Flat) -> Vec<f64> {
        let n = self.vertices.len();
        let at = |k: usize| self.vertices[k % n];
        let whole = 2.0 * area(&self.vertices);
        // The product of the areas that p spans with all edges except the two of the vertex.
        let spans: Vec<f64> = (0..n).map(|k| turn(p, at(k), at(k + 1)) / whole).collect();
        let weights: Vec<f64> = (0..n)
            .map(|k| {
                let others = (k + 1..k + n - 1).map(|edge| spans[edge % n]);
                others.fold(
                    turn(at(k + n - 1), at(k), at(k + 1)) / whole,
                    |product, span| product * span,
                )
            })
            .collect();
        let sum: f64 = weights.iter().sum();
        weights.into_iter().map(|weight| weight / sum).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn regular(n: usize, radius: f64) -> Vec<Flat> {
        (0..n)
            .map(|k| {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
                [radius * cos, 0.3 * radius * sin]
            })
            .collect()
    }

    #[test]
    fn a_hull_leaves_out_points_inside_or_on_a_line() {
        let points = vec![
            [0.0, 0.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
            [0.0, 1.0],
            [0.5, 0.5],
        ];
        let hull = Hull::around(points, 0.0).simplified();
        assert_eq!(
            hull.vertices,
            [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]
        );
        // However thin it is.
        let thin = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1e-9], [0.0, 1e-9]];
        assert_eq!(Hull::around(thin, 0.0).simplified().vertices.len(), 4);
    }

    #[test]
    fn of_a_round_spot_few_vertices_are_left() {
        let round = Hull::around(regular(200, 1.0), 0.0);
        let width = 0.6;
        let few = round.clone().simplified();
        assert!(
            (8..=40).contains(&few.vertices.len()),
            "{}",
            few.vertices.len()
        );
        for &v in &round.vertices {
            let off = edges(&few.vertices)
                .map(|(a, b)| -turn(a, b, v) / length(minus(b, a)))
                .fold(f64::NEG_INFINITY, f64::max);
            assert!(off <= 1.001 * ROUND * width, "{off}");
        }
    }

    #[test]
    fn functions_are_barycentric() {
        for n in [3, 4, 5, 9, 24] {
            for scale in [1.0, 1e-7] {
                let hull = Hull::around(regular(n, scale), 0.0);
                for p in [[0.1, 0.05], [-0.3, 0.02], [0.0, 0.0]].map(|p| p.map(|c| c * scale)) {
                    let beta = hull.functions(p);
                    assert!(beta.iter().all(|&b| b > 0.0));
                    assert_relative_eq!(beta.iter().sum::<f64>(), 1.0, epsilon = 1e-13);
                    for c in 0..2 {
                        let mean = (beta.iter().zip(&hull.vertices)).map(|(b, v)| b * v[c]);
                        assert_relative_eq!(mean.sum::<f64>(), p[c], epsilon = 1e-13 * scale);
                    }
                }
            }
        }
    }
}
