//! The intersections of two boundaries in space: polygons on the plane of each facet of the first one. The facets of
//! the other are projected onto it along its normal and clipped (Puso and Laursen 2004; Popp, Gitterle, Gee and Wall
//! 2010).
//!
//! Where several facets cover the same part of it, that part is cut out of all but the nearest. Polygons are convex as
//! long as quadrilaterals are.

use super::super::frame;
use super::flat::{Flat, area, edges, turn};
use super::hull::Hull;
use super::{
    Beam, Cover, IntegrationPoint, MasterFacet, SAME, SAME_OF_WIDTH, Site, SlaveFacet, Vertex,
};
use crate::contact::transformed::Transformed;
use crate::mesh::shape::{FaceAt, LINE5, LINE8, ShapeFunctions, Visit, face_kind, triangle_points};
use crate::mesh::vector::{cross, dot, length, minus, unit};
use crate::mesh::{Groups, Topology, face_parts, face_ring};
use std::f64::consts::PI;

type Polygon = Vec<Flat>;

/// A polygon without the corners that clipping makes where it has none: twice the same, or on an edge.
fn cornered(polygon: &[Flat]) -> Polygon {
    let least = SAME * area(polygon);
    let mut corners = polygon.to_vec();
    let mut k = 0;
    while k < corners.len() && corners.len() > 3 {
        let n = corners.len();
        match turn(corners[(k + n - 1) % n], corners[k], corners[(k + 1) % n]).abs() > least {
            true => k += 1,
            false => drop(corners.remove(k)),
        }
    }
    corners
}

/// The centre of the area.
fn centroid(polygon: &[Flat]) -> Flat {
    let a = polygon[0];
    let mut sum = [0.0; 2];
    for bc in polygon.windows(2).skip(1) {
        let part = turn(a, bc[0], bc[1]);
        (0..2).for_each(|c| sum[c] += part * (bc[0][c] - a[c] + bc[1][c] - a[c]));
    }
    [0, 1].map(|c| a[c] + sum[c] / (6.0 * area(polygon)))
}

/// The mean of the corners.
fn middle(polygon: &[Flat]) -> Flat {
    let sum = |c: usize| polygon.iter().map(|x| x[c]).sum::<f64>();
    [sum(0), sum(1)].map(|sum| sum / polygon.len() as f64)
}

/// The part of a polygon on the left of the line from a to b (Sutherland and Hodgman 1974).
fn left_of(polygon: &[Flat], a: Flat, b: Flat) -> Polygon {
    let mut part = Polygon::with_capacity(polygon.len() + 1);
    for (k, &to) in polygon.iter().enumerate() {
        let from = polygon[(k + polygon.len() - 1) % polygon.len()];
        let [before, after] = [from, to].map(|x| turn(a, b, x));
        if (before < 0.0) != (after < 0.0) {
            let s = before / (before - after);
            part.push([0, 1].map(|c| from[c] + s * (to[c] - from[c])));
        }
        if after >= 0.0 {
            part.push(to);
        }
    }
    part
}

/// Whether a polygon is so thin that it is rounding: twice its area by its circumference is between its width and half of that.
fn is_thin(polygon: &[Flat], least: f64) -> bool {
    let around: f64 = edges(polygon).map(|(a, b)| length(minus(b, a))).sum();
    !(2.0 * area(polygon) > least * around)
}

/// The part of a polygon within a convex one; empty if it is no wider than `least`.
fn within(polygon: &[Flat], convex: &[Flat], least: f64) -> Option<Polygon> {
    let mut part = polygon.to_vec();
    for (a, b) in edges(convex) {
        part = left_of(&part, a, b);
        if part.len() < 3 {
            return None;
        }
    }
    (!is_thin(&part, least)).then_some(part)
}

/// The part of a polygon outside of a convex one, as polygons that are wider than `least`.
fn without(polygon: &[Flat], convex: &[Flat], least: f64) -> Vec<Polygon> {
    let mut rest = polygon.to_vec();
    let mut parts = Vec::new();
    for (a, b) in edges(convex) {
        let part = left_of(&rest, b, a);
        if part.len() > 2 && !is_thin(&part, least) {
            parts.push(part);
        }
        rest = left_of(&rest, a, b);
        if rest.len() < 3 {
            break;
        }
    }
    parts
}

/// A facet as seen along the normal of a plane.
struct Seen {
    len: usize,
    /// Its nodes on the plane.
    flat: [Flat; 9],
    /// Their heights above it.
    heights: [f64; 9],
}

/// The state of a facet where it covers a point of a plane.
struct Covering {
    /// Its shape functions, and the point in its reference element.
    shape: [f64; 9],
    xi: Flat,
    /// Its height above the plane.
    height: f64,
}

impl Seen {
    /// The point where the facet covers the point p of the plane.
    fn at(&self, p: Flat) -> Covering {
        let (shape, xi) = match self.len {
            3 => self.in_triangle(p),
            len => Topology::<2>::with(face_kind(len), Inverse { seen: self, p }),
        };
        let height = shape.iter().zip(&self.heights).map(|(s, h)| s * h).sum();
        Covering { shape, xi, height }
    }

    /// Its corners, how many there are.
    fn n_corners(&self) -> usize {
        if let 3 | 6 = self.len { 3 } else { 4 }
    }

    fn is_curved(&self) -> bool {
        self.len > 4
    }

    fn in_triangle(&self, p: Flat) -> ([f64; 9], Flat) {
        let [a, b, c] = [0, 1, 2].map(|k| self.flat[k]);
        let whole = turn(a, b, c);
        let [s, t] = [turn(p, c, a) / whole, turn(p, a, b) / whole];
        let mut shape = [0.0; 9];
        shape[..3].copy_from_slice(&[1.0 - s - t, s, t]);
        (shape, [s, t])
    }

    /// The unit normal at a point of the reference element, in the axes of the plane.
    fn normal(&self, xi: Flat) -> [f64; 3] {
        let x: [[f64; 3]; 9] = std::array::from_fn(|k| {
            let [s, t] = self.flat[k];
            [s, t, self.heights[k]]
        });
        let [s, t] = Topology::<2>::with(face_kind(self.len), FaceAt(&x[..self.len], xi)).tangents;
        unit(cross(s, t))
    }

    /// The bend of a facet of second order out of its plane, as a part of its size.
    fn bend(&self) -> Option<f64> {
        let heights = self.heights[..self.len].iter().copied();
        let [low, high] = [
            heights.clone().fold(0.0, f64::min),
            heights.fold(0.0, f64::max),
        ];
        let size = length(minus(self.flat[1], self.flat[0]));
        self.is_curved().then_some((high - low) / size)
    }

    /// Whether shape functions are polynomials on the plane.
    fn is_affine(&self) -> bool {
        let n = self.n_corners();
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| self.flat[k]);
        let diagonals = length(minus(c, a)) + length(minus(d, b));
        let size = if n == 3 {
            length(minus(c, a))
        } else {
            diagonals
        };
        let skew = [0, 1].map(|k| a[k] - b[k] + c[k] - d[k]);
        let centre = [0, 1].map(|k| 0.5 * (a[k] + c[k]));
        let middles = (n..self.len).all(|k| {
            let middle = match k - n {
                4 => centre,
                k => [0, 1].map(|c| 0.5 * (self.flat[k][c] + self.flat[(k + 1) % n][c])),
            };
            length(minus(self.flat[k], middle)) <= AFFINE * size
        });
        middles && (n == 3 || length(skew) <= AFFINE * size)
    }

    /// Whether its midside nodes are on the lines between its corners.
    fn is_straight(&self) -> bool {
        let n = self.n_corners();
        (n..self.len.min(2 * n)).all(|k| {
            let (a, b) = (self.flat[k - n], self.flat[(k - n + 1) % n]);
            turn(a, b, self.flat[k]).abs() <= SAME * length(minus(b, a)).powi(2)
        })
    }

    /// Convex polygons that it consists of: one, unless its edges are curved.
    fn polygons(&self) -> Vec<Polygon> {
        if self.is_straight() {
            return vec![self.flat[..self.n_corners()].to_vec()];
        }
        let parts = face_parts(self.len).iter();
        parts
            .map(|part| part.iter().map(|&k| self.flat[k]).collect())
            .collect()
    }
}

/// Coordinates that differ by less than this part of the size of a facet are rounding.
const AFFINE: f64 = 1e-12;

/// The point of the reference element of a facet that covers a point of a plane, with the shape functions there. It is
/// found by Newton's method, which takes one step if the map is affine. They are NaN where a curved facet covers no
/// such point.
struct Inverse<'a> {
    seen: &'a Seen,
    p: Flat,
}

impl Visit<2> for Inverse<'_> {
    type Output = ([f64; 9], Flat);

    #[inline]
    fn visit<E: ShapeFunctions<2, N, Q>, const N: usize, const Q: usize>(self) -> Self::Output {
        let flat = &self.seen.flat;
        let mut xi = if N == 6 {
            self.seen.in_triangle(self.p).1
        } else {
            [0.0; 2]
        };
        let mut found = [0.0; 9];
        let mut ended = false;
        for _ in 0..30 {
            let (shape, local) = E::shapes(xi);
            let mut off = self.p;
            let mut jacobian = [[0.0; 2]; 2];
            for a in 0..N {
                for c in 0..2 {
                    off[c] -= shape[a] * flat[a][c];
                    for d in 0..2 {
                        jacobian[c][d] += local[a][d] * flat[a][c];
                    }
                }
            }
            let [[a, b], [c, d]] = jacobian;
            let det = a * d - b * c;
            let step = [
                (d * off[0] - b * off[1]) / det,
                (a * off[1] - c * off[0]) / det,
            ];
            xi = [xi[0] + step[0], xi[1] + step[1]];
            let size = step[0].abs().max(step[1].abs());
            ended = size < super::CONVERGED;
            // Also where it is not finite.
            if !(size > 1e-14) {
                break;
            }
        }
        found[..N].copy_from_slice(&E::shapes(xi).0);
        if N > 4 && !ended {
            found.fill(f64::NAN);
        }
        (found, xi)
    }
}

/// The plane of a facet.
struct Plane {
    centre: [f64; 3],
    /// Two directions of the plane and its normal, right-handed.
    axes: [[f64; 3]; 3],
}

impl Plane {
    fn of(slave: &SlaveFacet<3>) -> Self {
        let nodes = slave.places();
        let sum = |c: usize| nodes.iter().map(|x| x[c]).sum::<f64>();
        let [normal, s, t] = frame(slave.normal);
        let right = dot(cross(s, t), normal) > 0.0;
        Self {
            centre: [0, 1, 2].map(|c| sum(c) / slave.len as f64),
            axes: if right {
                [s, t, normal]
            } else {
                [t, s, normal]
            },
        }
    }

    fn see(&self, nodes: &[[f64; 3]]) -> Seen {
        let mut seen = Seen {
            len: nodes.len(),
            flat: [[0.0; 2]; 9],
            heights: [0.0; 9],
        };
        for (k, &x) in nodes.iter().enumerate() {
            let to = minus(x, self.centre);
            let [s, t, height] = self.axes.map(|axis| dot(axis, to));
            seen.flat[k] = [s, t];
            seen.heights[k] = height;
        }
        seen
    }
}

/// The region that a facet can meet along its normal.
pub(super) fn beam(slave: &SlaveFacet<3>, distance: f64) -> Beam<3> {
    let nodes = slave.places().iter().copied();
    Beam::around(Plane::of(slave).axes, nodes, [0.0, 0.0, distance])
}

/// The angles of a facet at its corners: with them the averaged normal does not depend on how a surface is divided into
/// facets (Thürmer and Wüthrich 1998).
pub(super) fn angles(corners: &[[f64; 3]]) -> [f64; 4] {
    let len = corners.len();
    let mut angles = [0.0; 4];
    for (k, angle) in angles[..len].iter_mut().enumerate() {
        let to = |other: usize| unit(minus(corners[other % len], corners[k]));
        *angle = dot(to(k + 1), to(k + len - 1)).clamp(-1.0, 1.0).acos() / PI;
    }
    angles
}

/// A part of the facet and the facet that covers it.
struct Piece {
    polygon: Polygon,
    /// Its place among the facets that are near.
    other: usize,
}

/// The connected parts that others cover of a facet: they are projected, clipped, cut where they overlap, and joined, each
/// step on the polygons of the one before.
pub(super) fn covers(
    slave: &SlaveFacet<3>,
    near: &[MasterFacet<3>],
    distance: f64,
) -> Vec<Cover<3>> {
    let plane = Plane::of(slave);
    let own = plane.see(slave.places());
    let outline: Vec<Flat> = face_ring(own.len).iter().map(|&k| own.flat[k]).collect();
    let seen: Vec<Seen> = (near.iter())
        .map(|master| plane.see(master.places()))
        .collect();
    // The distance of the plane's point p from a facet, along its normal.
    let apart = |other: usize, p: Flat| seen[other].at(p).height - own.at(p).height;

    // Those of the others, counter-clockwise and each with the number of its facet.
    let mut others: Vec<(usize, Polygon)> = Vec::new();
    for (other, seen) in seen.iter().enumerate() {
        for mut flat in seen.polygons() {
            if area(&flat) < 0.0 {
                flat.reverse();
            } else if seen.is_curved() {
                // A part that looks away.
                continue;
            }
            others.push((other, flat));
        }
    }
    let mut pieces: Vec<Piece> = Vec::new();
    for part in own.polygons() {
        let size = area(&part);
        let mut of_part: Vec<Piece> = Vec::new();
        for (other, flat) in &others {
            let other = *other;
            let least = SAME * size.min(area(flat)).sqrt();
            let Some(polygon) = within(flat, &part, least) else {
                continue;
            };
            if !near[other].is_within(apart(other, middle(&polygon)), distance) {
                continue;
            }
            let rank = |other: usize, p: Flat| near[other].rank(apart(other, p));
            add(&mut of_part, Piece { polygon, other }, least, &rank);
        }
        pieces.extend(of_part);
    }
    pieces.retain(|piece| !near[piece.other].hides);
    // Pieces of one facet, one after the other.
    pieces.sort_by_key(|piece| piece.other);

    let mut normals = slave.normals[..slave.len].iter();
    let is_even = normals.all(|n| (0..3).all(|c| (n[c] - slave.normal[c]).abs() <= AFFINE));
    let weighted = |shape: &[f64; 9], of: &[[f64; 3]; 9]| -> [f64; 3] {
        std::array::from_fn(|c| (0..slave.len).map(|a| shape[a] * of[a][c]).sum())
    };
    let in_space = |local: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|c| (0..3).map(|a| local[a] * plane.axes[a][c]).sum())
    };
    connected(&pieces, near)
        .into_iter()
        .map(|pieces| {
            let corners = pieces.iter().flat_map(|piece| piece.polygon.clone());
            let hull = Hull::around(corners.collect(), SAME * area(&outline).sqrt());
            let (hull, sites) = {
                let missed = slave.missed(own.bend().unwrap_or(0.0));
                places(&outline, face_ring(own.len), [missed, slave.same()], hull)
            };
            // The whole facet, with places only at its corners.
            let (hull, sites) = match sites {
                None if slave.is_linear() => corners_of(&own),
                sites => (hull, sites),
            };
            let is_whole = sites.is_none();
            let mut cover = Cover {
                part: near[pieces[0].other].part,
                vertices: Vec::new(),
                points: Vec::new(),
                is_whole,
                functions: Vec::new(),
            };
            cover.vertices = match &sites {
                None => (0..slave.len)
                    .zip(angles_at_nodes(&slave.nodes, own.n_corners()))
                    .map(|(k, angle)| Vertex::at_node(slave, k, angle))
                    .collect(),
                Some(sites) => (sites.iter().zip(&hull.vertices))
                    .zip(hull.angles())
                    .map(|((&site, &v), angle)| {
                        if let Site::Node(k) = site {
                            return Vertex::at_node(slave, k, angle);
                        }
                        let shape = own.at(v).shape;
                        Vertex {
                            site,
                            place: weighted(&shape, &slave.nodes),
                            angle,
                            shape,
                        }
                    })
                    .collect(),
            };
            for piece in pieces {
                let other = &seen[piece.other];
                // Barycentric functions are no polynomials, nor are shape functions between curved edges, nor distances along
                // normals that turn.
                let from_centre =
                    !is_whole || !(own.is_straight() && other.is_straight()) || !is_even;
                let rule = rule(&own, other);
                each_point(&piece.polygon, rule, from_centre, |p, weight| {
                    let here = own.at(p);
                    let there = other.at(p);
                    let mut point = IntegrationPoint {
                        other: piece.other,
                        place: weighted(&here.shape, &slave.nodes),
                        slave: here.shape,
                        master: there.shape,
                        normals: [slave.normal, near[piece.other].normal],
                        distance: there.height - here.height,
                        weight,
                    };
                    if own.is_curved() {
                        let normal = own.normal(here.xi);
                        point.normals[0] = in_space(normal);
                        point.distance *= normal[2];
                        // On the curved surface, not on the plane.
                        point.weight /= normal[2];
                    } else {
                        point.distance *=
                            dot(unit(weighted(&here.shape, &slave.normals)), slave.normal);
                    }
                    if other.is_curved() {
                        point.normals[1] = in_space(other.normal(there.xi));
                    }
                    if is_whole {
                        let functions = Transformed::functions(
                            slave.plane,
                            slave.len,
                            own.n_corners(),
                            here.shape,
                        );
                        cover.functions.extend(&functions[..slave.len]);
                    } else {
                        cover.functions.extend(hull.functions(p));
                    }
                    cover.points.push(point);
                });
            }
            cover
        })
        .collect()
}

/// The angles of a facet at its nodes, in half turns: corners first.
fn angles_at_nodes(nodes: &[[f64; 3]; 9], n_corners: usize) -> [f64; 9] {
    let mut all = [1.0; 9];
    // That in the middle of a quadrilateral.
    all[8] = 2.0;
    all[..n_corners].copy_from_slice(&angles(&nodes[..n_corners])[..n_corners]);
    all
}

/// The pieces of each connected part of the master boundary, in their order: facets are connected that have a node in
/// common, on one side of every sharp edge.
fn connected<'p>(pieces: &'p [Piece], near: &[MasterFacet<3>]) -> Vec<Vec<&'p Piece>> {
    let mut groups = Groups::new(pieces.len());
    for (a, piece) in (0..).zip(pieces) {
        let now = &near[piece.other];
        for (b, before) in (0..a).zip(pieces) {
            let earlier = &near[before.other];
            let touch = || {
                let mut nodes = now.nodes().iter();
                nodes.any(|node| earlier.nodes().contains(node))
            };
            if now.part == earlier.part && groups.of(a) != groups.of(b) && touch() {
                groups.join(b, a);
            }
        }
    }
    let (count, numbers) = groups.numbers();
    let mut parts = vec![Vec::new(); count];
    for (piece, number) in pieces.iter().zip(numbers) {
        parts[number as usize].push(piece);
    }
    parts
}

/// The vertices of the covered part and their sites on the facet with this outline, whose nodes are `ring`. The part
/// `missed` of its size may be missed, and vertices `same` of it away from a corner or an edge are there. The sites of a wholly covered one are
/// None: its vertices are its nodes.
fn places(
    outline: &[Flat],
    ring: &[usize],
    [missed, same]: [f64; 2],
    hull: Hull,
) -> (Hull, Option<Vec<Site>>) {
    let size = area(outline).sqrt();
    let near = |p: Flat, q: Flat, same: f64| length(minus(p, q)) <= same;
    // Curved facets hardly ever have a border just where another one has it.
    let far = missed * size;
    if outline.iter().all(|&p| hull.distance(p) <= far) {
        return (hull, None);
    }
    let hull = hull.simplified();
    let same = (same * size).min(SAME_OF_WIDTH * hull.width());
    let site = |&v: &Flat| {
        if let Some(at) = outline.iter().position(|&p| near(p, v, same)) {
            return Site::Node(ring[at]);
        }
        // Both halves of an edge with a node in the middle are on one line.
        let off = edges(outline).map(|(a, b)| {
            let (along, to) = (minus(b, a), minus(v, a));
            let part =
                (to[0] * along[0] + to[1] * along[1]) / (along[0].powi(2) + along[1].powi(2));
            let part = part.clamp(0.0, 1.0);
            (length([0, 1].map(|c| to[c] - part * along[c])), part)
        });
        let Some((edge, (_, part))) = off.enumerate().find(|(_, (off, _))| *off <= same) else {
            return Site::Inside;
        };
        Site::Edge([ring[edge], ring[(edge + 1) % ring.len()]], part)
    };
    let sites = hull.vertices.iter().map(site).collect();
    (hull, Some(sites))
}

/// The corners of a facet with their hull; its edges are those of the polygon that the nodes make.
fn corners_of(own: &Seen) -> (Hull, Option<Vec<Site>>) {
    let n = own.n_corners();
    let hull = Hull {
        vertices: own.flat[..n].to_vec(),
    };
    (hull, Some((0..n).map(Site::Node).collect()))
}

/// Adds a piece without the parts where other pieces are nearer; those lose the parts where the new piece is nearer.
fn add(pieces: &mut Vec<Piece>, new: Piece, least: f64, rank: &impl Fn(usize, Flat) -> f64) {
    let mut fresh = vec![new.polygon];
    for old in std::mem::take(pieces) {
        let common = fresh
            .iter()
            .find_map(|part| within(part, &old.polygon, least));
        let Some(common) = common.map(|part| middle(&part)) else {
            pieces.push(old);
            continue;
        };
        if rank(new.other, common) < rank(old.other, common) {
            let mut left = vec![old.polygon];
            for part in &fresh {
                left = left
                    .iter()
                    .flat_map(|old| without(old, part, least))
                    .collect();
            }
            let other = old.other;
            pieces.extend(left.into_iter().map(|polygon| Piece { polygon, other }));
        } else {
            fresh = (fresh.iter())
                .flat_map(|part| without(part, &old.polygon, least))
                .collect();
            pieces.push(old);
        }
    }
    let other = new.other;
    pieces.extend(fresh.into_iter().map(|polygon| Piece { polygon, other }));
}

/// The integration rule for the intersection of two facets, a triangle at a time.
#[derive(Clone, Copy, PartialEq)]
enum Rule {
    /// Six points: exact to degree 4, which bilinear functions and quadratic ones of triangles have as products.
    Six,
    /// 5 × 5 points: exact to degree 8, which biquadratic functions have as products.
    Square5,
    /// 8 × 8 points where shape functions are not polynomials on the plane: accurate to 1e-10 on quadrilaterals whose
    /// corners are off by a fifth of an edge.
    Square8,
}

/// The rule for two facets. Where edges are curved, pieces are smaller than facets.
fn rule(own: &Seen, other: &Seen) -> Rule {
    let both = |is: fn(&Seen) -> bool| is(own) && is(other);
    if !both(Seen::is_straight) {
        Rule::Square5
    } else if !both(Seen::is_affine) {
        Rule::Square8
    } else if both(|facet| facet.len <= 6) {
        Rule::Six
    } else {
        Rule::Square5
    }
}

/// Integration points of a polygon with their weights, by triangles from its first corner or, `from_centre`, from the centre.
/// A rule that is not exact gives the same there, whichever corner of its facet is counted first.
fn each_point(polygon: &[Flat], rule: Rule, from_centre: bool, mut take: impl FnMut(Flat, f64)) {
    let on_line: &[(f64, f64)] = match rule {
        Rule::Six => &[],
        Rule::Square5 => &LINE5,
        Rule::Square8 => &LINE8,
    };
    let unit = |x: f64| 0.5 + 0.5 * x;
    let (polygon, a) = match from_centre {
        true => (cornered(polygon), centroid(polygon)),
        false => (polygon.to_vec(), polygon[0]),
    };
    for (b, c) in edges(&polygon) {
        let area = 0.5 * turn(a, b, c);
        if area == 0.0 {
            continue;
        }
        let at = |[r, s, t]: [f64; 3]| [0, 1].map(|k| r * a[k] + s * b[k] + t * c[k]);
        if rule == Rule::Six {
            for (corners, weight) in triangle_points() {
                take(at(corners), area * weight);
            }
        }
        // On a square with one side collapsed to that corner.
        for (along, weight) in on_line.iter().map(|&(x, weight)| (unit(x), weight)) {
            for (across, other) in on_line.iter().map(|&(x, weight)| (unit(x), weight)) {
                let corners = [1.0 - along, along * (1.0 - across), along * across];
                take(at(corners), 2.0 * area * along * weight * other);
            }
        }
    }
}
