//! What two boundaries in space have in common: polygons on the plane of each facet of the first one, onto which the
//! facets of the other are projected along its normal and clipped (Puso and Laursen 2004; Popp, Gitterle, Gee and Wall
//! 2010).
//!
//! Where several facets cover the same part of it, that part is cut out of all but the nearest. Polygons are convex as
//! long as quadrilaterals are.

use super::super::frame;
use super::flat::{Flat, area, edges, turn};
use super::hull::Hull;
use super::{Beam, Cover, IntegrationPoint, MasterFacet, SAME, SAME_OF_WIDTH, Site, SlaveFacet};
use crate::mesh::Groups;
use crate::mesh::shape::{Quad, ShapeFunctions, triangle_points};
use crate::mesh::vector::{cross, dot, length, minus, unit};
use std::f64::consts::PI;

type Polygon = Vec<Flat>;

/// Polygons below this part of the area of the smaller one of both facets are rounding.
const NOTHING: f64 = 1e-9;

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

/// The part of a polygon within a convex one; nothing if that is no more than `least`.
fn within(polygon: &[Flat], convex: &[Flat], least: f64) -> Option<Polygon> {
    let mut part = polygon.to_vec();
    for (a, b) in edges(convex) {
        part = left_of(&part, a, b);
        if part.len() < 3 {
            return None;
        }
    }
    (area(&part) > least).then_some(part)
}

/// The part of a polygon outside of a convex one, as polygons that are larger than `least`.
fn without(polygon: &[Flat], convex: &[Flat], least: f64) -> Vec<Polygon> {
    let mut rest = polygon.to_vec();
    let mut parts = Vec::new();
    for (a, b) in edges(convex) {
        let part = left_of(&rest, b, a);
        if part.len() > 2 && area(&part) > least {
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
    /// Its corners on the plane.
    flat: [Flat; 4],
    /// Their heights above it.
    heights: [f64; 4],
}

impl Seen {
    /// The heights that the facet has where it covers the point p of the plane, and its shape functions there.
    fn at(&self, p: Flat) -> (f64, [f64; 4]) {
        let shape = match self.len {
            3 => self.in_triangle(p),
            _ => self.in_quadrilateral(p),
        };
        let height = shape.iter().zip(&self.heights).map(|(s, h)| s * h).sum();
        (height, shape)
    }

    fn in_triangle(&self, p: Flat) -> [f64; 4] {
        let [a, b, c, _] = self.flat;
        let whole = turn(a, b, c);
        let [s, t] = [turn(p, c, a) / whole, turn(p, a, b) / whole];
        [1.0 - s - t, s, t, 0.0]
    }

    /// By Newton's method on the bilinear map, which is one step if it is affine.
    fn in_quadrilateral(&self, p: Flat) -> [f64; 4] {
        let mut xi = [0.0; 2];
        for _ in 0..30 {
            let (shape, local) = Quad::shapes(xi);
            let mut off = p;
            let mut jacobian = [[0.0; 2]; 2];
            for a in 0..4 {
                for c in 0..2 {
                    off[c] -= shape[a] * self.flat[a][c];
                    for d in 0..2 {
                        jacobian[c][d] += local[a][d] * self.flat[a][c];
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
            // Also where it is not finite.
            if !(step[0].abs().max(step[1].abs()) > 1e-14) {
                break;
            }
        }
        Quad::shapes(xi).0
    }

    /// Whether shape functions are affine on the plane.
    fn is_affine(&self) -> bool {
        let [a, b, c, d] = self.flat;
        let off = [0, 1].map(|k| a[k] - b[k] + c[k] - d[k]);
        let size = length(minus(c, a)) + length(minus(d, b));
        self.len == 3 || length(off) <= 1e-12 * size
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
        let corners = &slave.corners[..slave.len];
        let sum = |c: usize| corners.iter().map(|x| x[c]).sum::<f64>();
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

    fn see(&self, corners: &[[f64; 3]]) -> Seen {
        let mut seen = Seen {
            len: corners.len(),
            flat: [[0.0; 2]; 4],
            heights: [0.0; 4],
        };
        for (k, &x) in corners.iter().enumerate() {
            let to = minus(x, self.centre);
            let [s, t, height] = self.axes.map(|axis| dot(axis, to));
            seen.flat[k] = [s, t];
            seen.heights[k] = height;
        }
        seen
    }
}

/// What a facet can meet along its normal.
pub(super) fn beam(slave: &SlaveFacet<3>, distance: f64) -> Beam<3> {
    let corners = slave.corners[..slave.len].iter().copied();
    Beam::around(Plane::of(slave).axes, corners, [0.0, 0.0, distance])
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

/// A part of the facet and what covers it.
struct Piece {
    polygon: Polygon,
    /// Its place among the facets that are near.
    other: usize,
}

/// What connected parts of the others cover of a facet: they are projected, clipped, cut where they lie over each other, and
/// joined, each step on the polygons of the one before.
pub(super) fn covers(
    slave: &SlaveFacet<3>,
    near: &[MasterFacet<3>],
    distance: f64,
) -> Vec<Cover<3>> {
    let plane = Plane::of(slave);
    let own = plane.see(&slave.corners[..slave.len]);
    let outline = &own.flat[..own.len];
    let size = area(outline);
    let seen: Vec<Seen> = (near.iter())
        .map(|MasterFacet { corners, .. }| plane.see(&corners.0[..corners.1]))
        .collect();
    // How far the plane's point p is from a facet, along its normal.
    let apart = |other: usize, p: Flat| seen[other].at(p).0 - own.at(p).0;

    let mut pieces: Vec<Piece> = Vec::new();
    for (other, seen) in seen.iter().enumerate() {
        let mut flat = seen.flat[..seen.len].to_vec();
        if area(&flat) < 0.0 {
            flat.reverse();
        }
        let least = NOTHING * size.min(area(&flat));
        let Some(polygon) = within(&flat, outline, least) else {
            continue;
        };
        if !(apart(other, middle(&polygon)).abs() <= distance) {
            continue;
        }
        add(&mut pieces, Piece { polygon, other }, least, &apart);
    }
    // Pieces of one facet, one after the other.
    pieces.sort_by_key(|piece| piece.other);

    connected(&pieces, near)
        .into_iter()
        .map(|pieces| {
            let corners = pieces.iter().flat_map(|piece| piece.polygon.clone());
            let hull = Hull::around(corners.collect());
            let (hull, sites) = places(outline, hull);
            let mut cover = Cover {
                part: near[pieces[0].other].part,
                vertices: Vec::new(),
                points: Vec::new(),
                functions: Vec::new(),
            };
            let weighted = |shape: &[f64; 4], of: &[[f64; 3]; 4]| -> [f64; 3] {
                std::array::from_fn(|c| (0..slave.len).map(|a| shape[a] * of[a][c]).sum())
            };
            let is_whole = sites.is_none();
            cover.vertices = match &sites {
                None => (slave
                    .corners
                    .iter()
                    .zip(angles(&slave.corners[..slave.len])))
                .take(slave.len)
                .enumerate()
                .map(|(k, (&corner, angle))| (Site::Corner(k), corner, angle))
                .collect(),
                Some(sites) => (sites.iter().zip(&hull.vertices))
                    .zip(hull.angles())
                    .map(|((&site, &v), angle)| match site {
                        Site::Corner(k) => (site, slave.corners[k], angle),
                        _ => (site, weighted(&own.at(v).1, &slave.corners), angle),
                    })
                    .collect(),
            };
            for piece in pieces {
                let other = &seen[piece.other];
                let fine = !(own.is_affine() && other.is_affine());
                each_point(&piece.polygon, fine, |p, weight| {
                    let (own_height, shape) = own.at(p);
                    let (height, master) = other.at(p);
                    let along = dot(unit(weighted(&shape, &slave.normals)), slave.normal);
                    if !is_whole {
                        cover.functions.extend(hull.functions(p));
                    }
                    cover.points.push(IntegrationPoint {
                        other: piece.other,
                        place: weighted(&shape, &slave.corners),
                        slave: shape,
                        master,
                        distance: (height - own_height) * along,
                        weight: weight * slave.thickness,
                    });
                });
            }
            cover
        })
        .collect()
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

/// The vertices of what is covered and where they lie on the facet with this outline; None for the sites of one that is
/// wholly covered: these are its corners.
fn places(outline: &[Flat], hull: Hull) -> (Hull, Option<Vec<Site>>) {
    let size = area(outline).sqrt();
    let near = |p: Flat, q: Flat, same: f64| length(minus(p, q)) <= same;
    if (outline.iter()).all(|&p| hull.vertices.iter().any(|&v| near(p, v, SAME * size))) {
        return (hull, None);
    }
    let hull = hull.simplified();
    let same = (SAME * size).min(SAME_OF_WIDTH * hull.width());
    let site = |&v: &Flat| {
        if let Some(corner) = outline.iter().position(|&p| near(p, v, same)) {
            return Site::Corner(corner);
        }
        let off = edges(outline).map(|(a, b)| (turn(a, b, v) / length(minus(b, a))).abs());
        let Some((edge, _)) = off.enumerate().find(|(_, off)| *off <= same) else {
            return Site::Inside;
        };
        let (a, b) = (outline[edge], outline[(edge + 1) % outline.len()]);
        let (along, to) = (minus(b, a), minus(v, a));
        let part = (to[0] * along[0] + to[1] * along[1]) / (along[0].powi(2) + along[1].powi(2));
        Site::Edge(edge, part)
    };
    let sites = hull.vertices.iter().map(site).collect();
    (hull, Some(sites))
}

/// Adds a piece without what other pieces have in common with it and are nearer to; those lose what it is nearer to.
fn add(pieces: &mut Vec<Piece>, new: Piece, least: f64, apart: &impl Fn(usize, Flat) -> f64) {
    let mut fresh = vec![new.polygon];
    for old in std::mem::take(pieces) {
        let common = fresh
            .iter()
            .find_map(|part| within(part, &old.polygon, least));
        let Some(common) = common.map(|part| middle(&part)) else {
            pieces.push(old);
            continue;
        };
        if apart(new.other, common).abs() < apart(old.other, common).abs() {
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

/// Gauss–Legendre points on (−1, 1) and their weights (Abramowitz and Stegun, table 25.4); those below 0 mirror them.
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_5),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_3),
];

/// Integration points of a polygon with their weights, by triangles from its first corner: six each, exact to degree 4,
/// or 8 × 8 where shape functions are no polynomials on the plane: right to 1e-10 on quadrilaterals whose corners are off by
/// a fifth of an edge.
fn each_point(polygon: &[Flat], fine: bool, mut take: impl FnMut(Flat, f64)) {
    let a = polygon[0];
    for bc in polygon.windows(2).skip(1) {
        let [b, c] = [bc[0], bc[1]];
        let area = 0.5 * turn(a, b, c);
        let at = |[r, s, t]: [f64; 3]| [0, 1].map(|k| r * a[k] + s * b[k] + t * c[k]);
        if !fine {
            for (corners, weight) in triangle_points() {
                take(at(corners), area * weight);
            }
            continue;
        }
        // On a square of which one side shrinks to the first corner.
        let points = || {
            GAUSS
                .into_iter()
                .flat_map(|(x, w)| [-1.0, 1.0].map(|sign| (0.5 + 0.5 * sign * x, 0.5 * w)))
        };
        for (along, weight) in points() {
            for (across, other) in points() {
                let corners = [1.0 - along, along * (1.0 - across), along * across];
                take(at(corners), 2.0 * area * along * weight * other);
            }
        }
    }
}
