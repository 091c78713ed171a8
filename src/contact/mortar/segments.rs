//! What two boundaries of the plane have in common: segments between projected nodes of both meshes, along the field of
//! averaged normals of the slave boundary.

use super::{Cover, IntegrationPoint, MasterFacet, SAME, SAME_OF_WIDTH, Site, SlaveFacet};
use crate::mesh::shape::edge_points;
use crate::mesh::vector::{length, minus, unit};

type Point = [f64; 2];

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

/// a + s (b − a).
fn between(a: Point, b: Point, s: f64) -> Point {
    [a[0] + s * (b[0] - a[0]), a[1] + s * (b[1] - a[1])]
}

/// An edge of the slave boundary: its ends and the averaged normals there.
struct Edge {
    ends: [Point; 2],
    normals: [Point; 2],
}

impl Edge {
    /// The place at s ∈ [0, 1] and the unit normal there.
    fn at(&self, s: f64) -> (Point, Point) {
        let normal = between(self.normals[0], self.normals[1], s);
        (between(self.ends[0], self.ends[1], s), unit(normal))
    }

    /// The s whose normal goes through x: a root of (x − p(s)) × n(s), the one nearest to the edge.
    fn projection(&self, x: Point) -> Option<f64> {
        let [p, q] = self.ends;
        let [n, k] = self.normals;
        let (along, turn, to) = (minus(q, p), minus(k, n), minus(x, p));
        // (to − s along) × (n + s turn) = c + b s + a s².
        let a = -cross(along, turn);
        let b = cross(to, turn) - cross(along, n);
        let c = cross(to, n);
        let roots = if a.abs() * 1e12 < b.abs() {
            [-c / b; 2]
        } else {
            let root = (b * b - 4.0 * a * c).max(0.0).sqrt();
            // Free of cancellation.
            let q = -0.5 * (b + root.copysign(b));
            [q / a, c / q]
        };
        let off = |s: &f64| (s - 0.5).abs();
        let nearest = roots
            .into_iter()
            .filter(|s| s.is_finite())
            .min_by(|s, t| off(s).total_cmp(&off(t)))?;
        Some(nearest)
    }
}

/// Where the ray from x along n meets the line through the edge: the parameter on the edge and the distance.
fn meet(x: Point, n: Point, [p, q]: [Point; 2]) -> (f64, f64) {
    let (along, to) = (minus(q, p), minus(p, x));
    let det = cross(n, along);
    (cross(n, to) / -det, cross(to, along) / det)
}

fn ends(near: &MasterFacet<2>) -> [Point; 2] {
    let ([from, to, ..], _) = near.corners;
    [from, to]
}

/// What connected parts of the others cover of an edge: three Gauss points on each segment.
pub(super) fn covers(
    slave: &SlaveFacet<2>,
    near: &[MasterFacet<2>],
    distance: f64,
) -> Vec<Cover<2>> {
    let edge = Edge {
        ends: [slave.corners[0], slave.corners[1]],
        normals: [slave.normals[0], slave.normals[1]],
    };
    let length = length(minus(edge.ends[1], edge.ends[0])) * slave.thickness;
    let mut covers = Vec::new();
    let segments = segments(&edge, near, distance);
    let connected = |&(a, _, end): &Segment, &(b, start, _): &Segment| {
        near[a].part == near[b].part && end == start
    };
    for segments in segments.chunk_by(connected) {
        let (from, to) = (segments[0].1, segments[segments.len() - 1].2);
        let same = SAME.min(SAME_OF_WIDTH * (to - from));
        let is_whole = from <= same && 1.0 - to <= same;
        let site = |s: f64| match s {
            s if s <= same => (Site::Corner(0), edge.ends[0], 0.5),
            s if 1.0 - s <= same => (Site::Corner(1), edge.ends[1], 0.5),
            _ => (Site::Inside, edge.at(s).0, 0.5),
        };
        let mut cover = Cover {
            part: near[segments[0].0].part,
            vertices: vec![site(from), site(to)],
            points: Vec::with_capacity(3 * segments.len()),
            functions: Vec::new(),
        };
        for &(other, a, b) in segments {
            let ends = ends(&near[other]);
            // In the parameter of the edge; the weights of a segment add up to its length.
            for ([s, _], _, w) in edge_points([[a, 0.0], [b, 0.0]]) {
                let (x, n) = edge.at(s);
                let (t, between) = meet(x, n, ends);
                if !is_whole {
                    let along = (s - from) / (to - from);
                    cover.functions.extend([1.0 - along, along]);
                }
                cover.points.push(IntegrationPoint {
                    other,
                    place: x,
                    slave: [1.0 - s, s, 0.0, 0.0],
                    master: [1.0 - t, t, 0.0, 0.0],
                    distance: between,
                    weight: w * (b - a) * length,
                });
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
            let [a, b] = ends(near).map(|end| edge.projection(end));
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
        let (x, n) = edge.at(middle);
        let nearest = covers
            .iter()
            .filter(|&&(_, a, b)| a < middle && middle < b)
            .map(|&(other, ..)| (other, meet(x, n, ends(&near[other])).1))
            .filter(|(_, gap)| gap.abs() <= distance)
            .min_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        if let Some((other, _)) = nearest {
            segments.push((other, cut[0], cut[1]));
        }
    }
    segments
}
