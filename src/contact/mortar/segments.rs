//! The intersections of two boundaries in the plane: segments between projected nodes of both meshes, along the field
//! of averaged normals of the slave boundary.

use super::{
    CONVERGED, Cover, IntegrationPoint, MISSED, MasterFacet, SAME_OF_WIDTH, Site, SlaveFacet,
    Vertex,
};
use crate::contact::transformed::Transformed;
use crate::mesh::shape::{LINE8, edge_at, edge_points, sum};
use crate::mesh::vector::{dot, length, minus, unit};

type Point = [f64; 2];

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// a + s (b − a).
fn between(a: Point, b: Point, s: f64) -> Point {
    [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])]
}

/// An edge of the slave boundary: its nodes, the ends first, and the averaged normals there.
struct Edge<'a> {
    x: &'a [Point],
    normals: &'a [Point],
}

/// The root of a s² + b s + c nearest to the middle of (0, 1).
fn nearest_root(a: f64, b: f64, c: f64) -> Option<f64> {
    let roots = if a.abs() * 1e12 < b.abs() {
        [-c / b; 2]
    } else {
        let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
        // Free of cancellation.
        let q = -0.5 * (b + root.copysign(b));
        [q / a, c / q]
    };
    let off = |s: &f64| (s - 0.5).abs();
    let finite = roots.into_iter().filter(|s| s.is_finite());
    finite.min_by(|s, t| off(s).total_cmp(&off(t)))
}

impl Edge<'_> {
    /// Its shape functions at s ∈ [0, 1].
    fn shape(&self, s: f64) -> [f64; 9] {
        if self.x.len() > 2 {
            return edge_at(self.x, 2.0 * s - 1.0).shape;
        }
        let mut shape = [0.0; 9];
        [shape[0], shape[1]] = [1.0 - s, s];
        shape
    }

    /// The place at s ∈ [0, 1] and the unit normal there.
    fn at(&self, s: f64) -> (Point, Point) {
        if self.x.len() > 2 {
            let at = edge_at(self.x, 2.0 * s - 1.0);
            return (at.place, unit(sum(&at.shape, self.normals)));
        }
        let normal = between(self.normals[0], self.normals[1], s);
        (between(self.x[0], self.x[1], s), unit(normal))
    }

    /// The s whose normal goes through x: a root of (x − p(s)) × n(s), the one nearest to the edge.
    fn projection(&self, x: Point) -> Option<f64> {
        let ([p, q], [n, k]) = ([0, 1].map(|a| self.x[a]), [0, 1].map(|a| self.normals[a]));
        let (along, turn, to) = (minus(q, p), minus(k, n), minus(x, p));
        // (to − s along) × (n + s turn) = c + b s + a s².
        let a = -cross(along, turn);
        let b = cross(to, turn) - cross(along, n);
        let c = cross(to, n);
        let on_chord = nearest_root(a, b, c)?;
        // A point this far beyond the ends of the chord is also beyond those of the curved edge, which bends back there.
        if self.x.len() == 2 || !(-0.5..1.5).contains(&on_chord) {
            return Some(on_chord);
        }
        // By Newton's method on the curved edge, starting from the point on its chord.
        let (mut s, mut step) = (on_chord, f64::INFINITY);
        for _ in 0..NEWTON {
            let at = edge_at(self.x, 2.0 * s - 1.0);
            let turned = edge_at(self.normals, 2.0 * s - 1.0);
            let to = minus(x, at.place);
            let slope = cross(to, turned.tangents[0]) - cross(at.tangents[0], turned.place);
            step = -0.5 * cross(to, turned.place) / slope;
            s += step;
            if !(step.abs() > 1e-14) {
                break;
            }
        }
        (step.abs() < CONVERGED).then_some(s)
    }
}

/// More than Newton's method takes on a quadratic edge whose midside node is roughly in the middle.
const NEWTON: usize = 20;

/// The intersection of the ray from x along n with an edge: the parameter on the edge and the distance.
fn meet(x: Point, n: Point, edge: &[Point]) -> (f64, f64) {
    if let [p, q] = *edge {
        let (along, to) = (minus(q, p), minus(p, x));
        let det = cross(n, along);
        return (cross(n, to) / -det, cross(to, along) / det);
    }
    // The edge is p + s b + s² a.
    let p = edge[0];
    let [q, m] = [edge[1], edge[2]].map(|x| minus(x, p));
    let b = [0, 1].map(|c| 4.0 * m[c] - q[c]);
    let a = [0, 1].map(|c| 2.0 * q[c] - 4.0 * m[c]);
    let root = nearest_root(cross(n, a), cross(n, b), cross(n, minus(p, x)));
    let s = root.unwrap_or(f64::NAN);
    let place = edge_at(edge, 2.0 * s - 1.0).place;
    (s, dot(minus(place, x), n))
}

/// The connected parts that others cover of an edge, with three Gauss points on each segment. There are eight where an
/// edge is of second order, because then one parameter is not a polynomial in the other.
pub(super) fn covers(
    slave: &SlaveFacet<2>,
    near: &[MasterFacet<2>],
    distance: f64,
) -> Vec<Cover<2>> {
    let edge = Edge {
        x: slave.places(),
        normals: &slave.normals[..slave.len],
    };
    let is_curved = slave.len > 2;
    let chord = length(minus(edge.x[1], edge.x[0]));
    // The distance of the midside node from the chord, as a part of the chord.
    let bend = edge.x.get(2).map(|&middle| {
        let along = minus(edge.x[1], edge.x[0]);
        cross(along, minus(middle, edge.x[0])).abs() / dot(along, along)
    });
    let mut covers = Vec::new();
    let segments = segments(&edge, near, distance);
    let connected = |&(a, _, end): &Segment, &(b, start, _): &Segment| {
        near[a].part == near[b].part && end == start
    };
    for segments in segments.chunk_by(connected) {
        let (from, to) = (segments[0].1, segments[segments.len() - 1].2);
        let same = slave.same().min(SAME_OF_WIDTH * (to - from));
        let missed = match bend {
            None if !slave.moves => same,
            bend => slave.missed(bend.unwrap_or(0.0)),
        };
        let is_covered = from <= missed && 1.0 - to <= missed;
        // A whole one is covered from end to end, whatever it misses.
        let (from, to) = if is_covered { (0.0, 1.0) } else { (from, to) };
        let is_whole = is_covered && !slave.is_linear();
        let vertex = |s: f64| match s {
            s if s <= same => Vertex::at_node(slave, 0, 0.5),
            s if 1.0 - s <= same => Vertex::at_node(slave, 1, 0.5),
            s if is_curved && (s - 0.5).abs() <= same => Vertex::at_node(slave, 2, 0.5),
            _ => Vertex {
                site: Site::Inside,
                place: edge.at(s).0,
                angle: 0.5,
                shape: edge.shape(s),
            },
        };
        let vertices = match is_whole && is_curved {
            false => vec![vertex(from), vertex(to)],
            true => (0..3)
                .zip([0.5, 0.5, 1.0])
                .map(|(k, angle)| Vertex::at_node(slave, k, angle))
                .collect(),
        };
        let [a, b] = [from, to].map(|s| edge.at(s).0);
        let (along, square) = (minus(b, a), dot(minus(b, a), minus(b, a)));
        let mut cover = Cover {
            part: near[segments[0].0].part,
            vertices,
            points: Vec::with_capacity(3 * segments.len()),
            is_whole,
            functions: Vec::new(),
        };
        let mut take = |other: usize, s: f64, weight: f64| {
            let (x, n) = edge.at(s);
            let depth = slave.depth.at(x);
            let master = &near[other];
            let (t, distance) = meet(x, n, master.places());
            let mut point = IntegrationPoint {
                other,
                place: x,
                slave: [0.0; 9],
                master: [0.0; 9],
                normals: [slave.normal, master.normal],
                distance,
                weight: weight * (chord * depth),
            };
            if is_curved {
                let at = edge_at(edge.x, 2.0 * s - 1.0);
                point.slave = at.shape;
                let [[dx, dy]] = at.tangents;
                point.normals[0] = unit([dy, -dx]);
                point.weight = 2.0 * weight * length([dx, dy]) * depth;
            } else {
                [point.slave[0], point.slave[1]] = [1.0 - s, s];
            }
            if master.len > 2 {
                let at = edge_at(master.places(), 2.0 * t - 1.0);
                point.master = at.shape;
                let [[dx, dy]] = at.tangents;
                point.normals[1] = unit([dy, -dx]);
            } else {
                [point.master[0], point.master[1]] = [1.0 - t, t];
            }
            match (is_whole, is_curved) {
                (true, _) => {
                    let beta = Transformed::functions(slave.plane, slave.len, 2, point.slave);
                    cover.functions.extend(&beta[..slave.len]);
                }
                (false, false) => {
                    let along = (s - from) / (to - from);
                    cover.functions.extend([1.0 - along, along]);
                }
                // Linear in the place, so that the force of an end acts there.
                (false, true) => {
                    let along = dot(minus(x, a), along) / square;
                    cover.functions.extend([1.0 - along, along]);
                }
            }
            cover.points.push(point);
        };
        for &(other, a, b) in segments {
            if is_curved || near[other].len > 2 {
                for (xi, weight) in LINE8 {
                    take(other, a + 0.5 * (1.0 + xi) * (b - a), weight * (b - a));
                }
            } else {
                // In the parameter of the edge; the weights of a segment add up to its length.
                for ([s, _], _, weight) in edge_points([[a, 0.0], [b, 0.0]]) {
                    take(other, s, weight * (b - a));
                }
            }
        }
        covers.push(cover);
    }
    covers
}

/// A part of an edge: the number of the edge that covers it, and from and to which parameter.
type Segment = (usize, f64, f64);

/// The parts of an edge, from and to a parameter of it, each with the nearest of the edges that cover it.
fn segments(edge: &Edge, near: &[MasterFacet<2>], distance: f64) -> Vec<Segment> {
    // The part of the edge that each of the others covers.
    let covers: Vec<Segment> = (near.iter().enumerate())
        .filter_map(|(other, near)| {
            let [a, b] = [0, 1].map(|end| edge.projection(near.places[end]));
            let (a, b) = (a?, b?);
            let (low, high) = (a.min(b).max(0.0), a.max(b).min(1.0));
            (high - low > 1e-10).then_some((other, low, high))
        })
        .collect();
    let mut cuts: Vec<f64> = covers.iter().flat_map(|&(_, a, b)| [a, b]).collect();
    cuts.sort_by(f64::total_cmp);
    cuts.dedup_by(|b, a| *b - *a < 1e-10);

    let mut segments: Vec<Segment> = Vec::new();
    for cut in cuts.windows(2) {
        let middle = 0.5 * (cut[0] + cut[1]);
        // Where normals meet in front of the other edge, its ends may be projected by a root of no meaning: rays miss it then.
        let meets = |s: f64, other: &MasterFacet<2>| {
            let (x, n) = edge.at(s);
            let (t, gap) = meet(x, n, other.places());
            (-MISSED..=1.0 + MISSED).contains(&t).then_some(gap)
        };
        let nearest = covers
            .iter()
            .filter(|&&(_, a, b)| a < middle && middle < b)
            .filter(|&&(other, ..)| cut.iter().all(|&s| meets(s, &near[other]).is_some()))
            .filter_map(|&(other, ..)| Some((other, meets(middle, &near[other])?)))
            .filter(|&(other, gap)| near[other].is_within(gap, distance))
            .min_by(|a, b| near[a.0].rank(a.1).total_cmp(&near[b.0].rank(b.1)));
        if let Some((other, _)) = nearest.filter(|&(other, _)| !near[other].hides) {
            segments.push((other, cut[0], cut[1]));
        }
    }
    segments
}
