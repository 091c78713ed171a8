//! Contact surfaces in space laid flat: seen along their mean normal, or unrolled around an axis.

mod circle;

use super::legend::short;
use super::surface::{SMOOTH, borders, join, root};
use crate::dense::symmetric_eigen;
use crate::mesh::vector::{cross, dot, unit};
use crate::mesh::{Facet, Mesh, face_parts, facet_nodes};
use circle::circle;
use faer::Mat;
use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::PI;

/// Facets are well visible along a direction whose cosine with their normal is larger than this.
const SEEN_WELL: f64 = 0.5;
/// And at all, if it is larger than this one.
const SEEN: f64 = 0.02;
/// Less than this part of the area need not be seen: the last facets at the rim of a hollow.
const HIDDEN: f64 = 0.04;
/// A direction counts as an axis if the cosine between them is larger than this.
const NEARLY: f64 = 0.995;
/// The cosine between the normals of its facets and the radius is at least this one.
const ALONG: f64 = 0.8;
/// The normals around an axis have less than this part of their squares along it.
const ACROSS: f64 = 0.02;
/// The most pieces of a surface that are shown.
const MOST: usize = 4;

/// A surface, or a part of one, laid flat.
pub(super) struct Developed {
    /// Positions of nodes in the developed surface, with these nodes, for facets or their parts; those nearer to the
    /// viewer come later.
    pub triangles: Vec<([[f64; 2]; 3], [u32; 3])>,
    /// The edges of facets (halves of curved ones), whether the developed surface ends there, and the part of a whole edge.
    pub edges: Vec<([[f64; 2]; 2], bool, f64)>,
    /// The viewed side, and the view point.
    pub caption: String,
    /// The quantities of both coordinates.
    pub labels: [String; 2],
    way: Way,
}

/// The map from a surface to a developed surface.
#[derive(Clone, Copy)]
enum Way {
    /// Two directions.
    Flat([[f64; 3]; 2]),
    /// The arc about an axis, from the second direction to the third, and the place along the first.
    Rolled {
        axes: [[f64; 3]; 3],
        centre: [f64; 2],
        radius: f64,
    },
}

impl Way {
    /// The position of x in the developed surface; angles are taken around `near`.
    fn place(&self, x: [f64; 3], near: f64) -> [f64; 2] {
        match *self {
            Self::Flat(axes) => axes.map(|axis| dot(axis, x)),
            Self::Rolled {
                axes,
                centre,
                radius,
            } => {
                let angle = angle(&axes, centre, x);
                let turns = ((angle - near) / (2.0 * PI)).round();
                [radius * (angle - 2.0 * PI * turns), dot(axes[0], x)]
            }
        }
    }

    /// The directions of both coordinates at x.
    fn directions(&self, x: [f64; 3]) -> [[f64; 3]; 2] {
        match *self {
            Self::Flat(axes) => axes,
            Self::Rolled { axes, centre, .. } => {
                let (sin, cos) = angle(&axes, centre, x).sin_cos();
                let around = std::array::from_fn(|c| cos * axes[2][c] - sin * axes[1][c]);
                [around, axes[0]]
            }
        }
    }
}

/// The angle of x about an axis.
fn angle(axes: &[[f64; 3]; 3], centre: [f64; 2], x: [f64; 3]) -> f64 {
    (dot(axes[2], x) - centre[1]).atan2(dot(axes[1], x) - centre[0])
}

impl Developed {
    /// The part of a vector at x along the developed surface.
    pub fn vector(&self, x: [f64; 3], vector: [f64; 3]) -> [f64; 2] {
        self.way.directions(x).map(|axis| dot(axis, vector))
    }
}

/// The facets of a contact on their way to developed surfaces.
struct Facets<'a> {
    mesh: &'a Mesh<3>,
    facets: &'a [Facet<3>],
    /// Areas and outward normals.
    normals: Vec<(f64, [f64; 3])>,
    /// The pressure at a node.
    pressure: &'a dyn Fn(u32) -> f64,
}

/// The areas and outward normals of facets.
fn normals(mesh: &Mesh<3>, facets: &[Facet<3>]) -> Vec<(f64, [f64; 3])> {
    let normal = |facet| mesh.facet_normal(facet);
    facets.iter().map(normal).collect()
}

/// The developed surfaces of a boundary, that with the largest forces first.
pub(super) fn developed_parts(
    mesh: &Mesh<3>,
    facets: &[Facet<3>],
    pressure: &dyn Fn(u32) -> f64,
) -> Vec<Developed> {
    let all = Facets {
        mesh,
        facets,
        normals: normals(mesh, facets),
        pressure,
    };
    let whole: Vec<usize> = (0..facets.len()).collect();
    if let Some(developed) = all.one(&whole) {
        return vec![developed];
    }
    let mut pieces = all.pieces();
    if pieces.len() == 1 {
        return all.sides(&whole);
    }
    pieces.sort_by(|a, b| all.force(b).total_cmp(&all.force(a)));
    let mut developed_parts: Vec<Developed> = (pieces.iter())
        .flat_map(|piece| match all.one(piece) {
            Some(developed) => vec![developed],
            None => all.sides(piece),
        })
        .collect();
    let count = developed_parts.len();
    developed_parts.truncate(MOST);
    for (k, developed) in (1..).zip(&mut developed_parts) {
        developed.caption = format!("part {k} of {count}, {}", developed.caption);
    }
    if let Some(last) = developed_parts.last_mut().filter(|_| count > MOST) {
        last.caption += "; those with smaller forces are left out";
    }
    developed_parts
}

impl Facets<'_> {
    /// One developed surface for some facets, where one shows them all.
    fn one(&self, part: &[usize]) -> Option<Developed> {
        // The touching part should be seen best; a large boundary may bend away from it.
        let touches = |f: usize| f64::from(u8::from(self.pressure(f) > 0.0));
        let ways = [self.mean(part, touches), self.mean(part, |_| 1.0)];
        for way in ways {
            let seen = part.iter().map(|&f| dot(self.normals[f].1, way));
            // Without a mean, nothing is visible along it.
            let least = seen.fold(1.0, |least, v| if v >= least { least } else { v });
            if least > SEEN_WELL {
                return Some(self.flat(part, way));
            }
        }
        let rolled = self.rolled(part);
        let flat = || {
            let mut ways = ways.into_iter();
            ways.find(|&way| self.hidden(part, way) < HIDDEN)
        };
        match rolled {
            None => flat().map(|way| self.flat(part, way)),
            rolled => rolled,
        }
    }

    /// The part of the area of some facets that is hidden along a direction.
    fn hidden(&self, part: &[usize], along: [f64; 3]) -> f64 {
        let is_hidden = |f: usize| !(dot(self.normals[f].1, along) > SEEN);
        let hidden = part.iter().filter(|&&f| is_hidden(f));
        let area = |f: &usize| self.normals[*f].0;
        hidden.map(area).sum::<f64>() / part.iter().map(area).sum::<f64>()
    }

    /// The mean normal of some facets, weighted; not finite if it is undefined.
    fn mean(&self, part: &[usize], weight: impl Fn(usize) -> f64) -> [f64; 3] {
        let mut sum = [0.0; 3];
        for &f in part {
            let (area, normal) = self.normals[f];
            let weight = area * weight(f);
            sum = std::array::from_fn(|c| sum[c] + weight * normal[c]);
        }
        unit(sum)
    }

    /// The mean pressure of a facet.
    fn pressure(&self, f: usize) -> f64 {
        let nodes = facet_nodes(&self.facets[f]);
        let sum: f64 = nodes.iter().map(|&node| (self.pressure)(node)).sum();
        sum / nodes.len() as f64
    }

    fn force(&self, part: &[usize]) -> f64 {
        let forces = part.iter().map(|&f| self.normals[f].0 * self.pressure(f));
        forces.sum()
    }

    /// The direction along which the normals of some facets have least, upwards; None if one of them has much of it.
    fn axis(&self, part: &[usize]) -> Option<[f64; 3]> {
        let total: f64 = part.iter().map(|&f| self.normals[f].0).sum();
        let matrix = Mat::from_fn(3, 3, |i, j| {
            let parts = part.iter().map(|&f| self.normals[f]);
            parts.map(|(area, n)| area * n[i] * n[j]).sum::<f64>()
        });
        let (values, vectors) = symmetric_eigen(&matrix)?;
        let least = (0..3).min_by(|&a, &b| values[a].total_cmp(&values[b]))?;
        let axis = tidy([0, 1, 2].map(|c| vectors[(c, least)]));
        let turn = axis.iter().sum::<f64>().signum();
        (values[least] < ACROSS * total).then(|| axis.map(|v| turn * v + 0.0))
    }

    /// Facets seen along a direction, their mean normal.
    fn flat(&self, part: &[usize], normal: [f64; 3]) -> Developed {
        let normal = match normal.iter().position(|v| v.abs() > NEARLY) {
            Some(c) => std::array::from_fn(|k| if k == c { normal[c].signum() } else { 0.0 }),
            None => tidy(normal),
        };
        let axes = flat_axes(normal);
        let side = if dot(cross(axes[0], axes[1]), normal) > 0.0 {
            "from outside"
        } else {
            "through the body"
        };
        let caption = format!("seen {side} along the normal {}", direction(normal));
        let labels = [0, 1].map(|c| match name(axes[c]) {
            Some(name) => name.to_owned(),
            None => format!("{} along {}", ["u", "v"][c], direction(axes[c])),
        });
        self.developed(part, Way::Flat(axes), caption, labels, normal)
    }

    /// Facets around an axis, unrolled so that the largest pressure is in the middle; None if they are not round.
    fn rolled(&self, part: &[usize]) -> Option<Developed> {
        let axis = self.axis(part)?;
        let first = flat_axes(axis)[0];
        let axes = [axis, first, cross(axis, first)];
        let nodes = part.iter().flat_map(|&f| facet_nodes(&self.facets[f]));
        let nodes: BTreeSet<u32> = nodes.copied().collect();
        let place = |node: u32| self.mesh.nodes[node as usize];
        let across = |&node| [1, 2].map(|k: usize| dot(axes[k], place(node)));
        let points: Vec<[f64; 2]> = nodes.iter().map(across).collect();
        let (centre, radius) = circle(&points)?;
        let outward = |x: [f64; 3]| {
            let (sin, cos) = angle(&axes, centre, x).sin_cos();
            std::array::from_fn(|c| cos * axes[1][c] + sin * axes[2][c])
        };
        let is_round = part.iter().all(|&f| {
            let mut corners = facet_nodes(&self.facets[f]).iter();
            corners.all(|&node| dot(outward(place(node)), self.normals[f].1).abs() > ALONG)
        });
        if !is_round {
            return None;
        }
        // Zero where the pressure is largest.
        let peak = nodes.iter().copied().max_by(|&a, &b| {
            let [a, b] = [a, b].map(|node| (self.pressure)(node));
            a.total_cmp(&b)
        })?;
        let towards = outward(place(peak));
        let middle: [f64; 3] =
            std::array::from_fn(|c| centre[0] * axes[1][c] + centre[1] * axes[2][c]);
        let axes = [axis, towards, cross(axis, towards)];
        let centre = [1, 2].map(|k: usize| dot(axes[k], middle));
        let caption = format!(
            "unrolled about its axis along {}, radius {}; arc 0 lies towards {}",
            direction(axis),
            short(radius),
            direction(towards)
        );
        let labels = [
            "arc".to_owned(),
            name(axis).map_or_else(|| format!("v along {}", direction(axis)), str::to_owned),
        ];
        let way = Way::Rolled {
            axes,
            centre,
            radius,
        };
        Some(self.developed(part, way, caption, labels, axis))
    }

    /// Facets from the side with the larger pressures, and from the other one.
    fn sides(&self, part: &[usize]) -> Vec<Developed> {
        let pressed = self.mean(part, |f| self.pressure(f));
        let is_pressed = pressed.iter().all(|v| v.is_finite());
        let axis = if is_pressed { pressed } else { [0.0, 0.0, 1.0] };
        let (front, behind): (Vec<usize>, Vec<usize>) =
            (part.iter()).partition(|&&f| dot(self.normals[f].1, axis) >= 0.0);
        let views = [(front, axis), (behind, axis.map(|v| -v))];
        (views.into_iter())
            .filter(|(part, _)| !part.is_empty())
            .map(|(part, axis)| self.flat(&part, axis))
            .collect()
    }

    /// The pieces that sharp edges leave.
    fn pieces(&self) -> Vec<Vec<usize>> {
        let mut joined: Vec<u32> = (0..self.facets.len() as u32).collect();
        for border in borders(self.facets.iter().map(facet_nodes)) {
            let [a, b] = border.facets.map(|f| self.normals[f as usize].1);
            if border.count == 2 && dot(a, b) > SMOOTH {
                join(&mut joined, border.facets);
            }
        }
        let mut pieces: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        for f in 0..self.facets.len() {
            let first = root(&mut joined, f as u32);
            pieces.entry(first).or_default().push(f);
        }
        pieces.into_values().collect()
    }

    /// Facets laid flat.
    fn developed(
        &self,
        part: &[usize],
        way: Way,
        caption: String,
        labels: [String; 2],
        towards: [f64; 3],
    ) -> Developed {
        let place = |node: u32| self.mesh.nodes[node as usize];
        let mut order = part.to_vec();
        let depth = |f: usize| dot(towards, place(self.facets[f][0]));
        order.sort_by(|&a, &b| depth(a).total_cmp(&depth(b)));
        let facets = || order.iter().map(|&f| facet_nodes(&self.facets[f]));
        // The nodes of each.
        let places: Vec<Vec<[f64; 2]>> = facets()
            .map(|nodes| {
                // All on the same side of the cut, the side of the middle.
                let near = match way {
                    Way::Flat(_) => 0.0,
                    Way::Rolled { axes, centre, .. } => {
                        let sum = |c: usize| nodes.iter().map(|&n| place(n)[c]).sum::<f64>();
                        let middle = std::array::from_fn(|c| sum(c) / nodes.len() as f64);
                        angle(&axes, centre, middle)
                    }
                };
                nodes.iter().map(|&n| way.place(place(n), near)).collect()
            })
            .collect();
        let triangles = facets().zip(&places).flat_map(|(nodes, at)| {
            let parts = face_parts(nodes.len()).iter();
            let corners =
                parts.flat_map(|part| (1..part.len() - 1).map(|k| [0, k, k + 1].map(|k| part[k])));
            corners.map(|corners| (corners.map(|k| at[k]), corners.map(|k| nodes[k])))
        });
        let edges = borders(facets()).into_iter().map(|border| {
            let first = border.facets[0] as usize;
            let nodes = facet_nodes(&self.facets[order[first]]);
            let corner = |node| nodes.iter().position(|&n| n == node).unwrap_or(0);
            let line = border.ends.map(|node| places[first][corner(node)]);
            let share = if nodes.len() > 4 { 0.5 } else { 1.0 };
            (line, border.count == 1, share)
        });
        Developed {
            triangles: triangles.collect(),
            edges: edges.collect(),
            caption,
            labels,
            way,
        }
    }
}

/// Two directions of a picture across a normal: those of the axes where the normal is one, to the right and upwards.
fn flat_axes(normal: [f64; 3]) -> [[f64; 3]; 2] {
    let (x, y, z) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]);
    let main = (0..3).max_by(|&a, &b| normal[a].abs().total_cmp(&normal[b].abs()));
    match main {
        _ if name(normal.map(f64::abs)).is_none() => {
            let is_level = normal[2].abs() > 0.9;
            let level = if is_level { x } else { unit(cross(z, normal)) };
            let along = dot(level, normal);
            let right = unit(std::array::from_fn(|c| level[c] - along * normal[c]));
            let up = cross(normal, right);
            let is_turned = up[2] < -0.1 || (up[2] < 0.1 && up[1] < 0.0);
            let up = if is_turned { up.map(|v| -v) } else { up };
            [right, up].map(tidy)
        }
        Some(0) => [y, z],
        Some(1) => [x, z],
        _ => [x, y],
    }
}

/// A direction without the rounding of its components.
fn tidy(direction: [f64; 3]) -> [f64; 3] {
    let kept = direction.map(|v| if v.abs() < 1e-3 { 0.0 } else { v });
    unit(kept)
}

/// The axis that has a direction.
fn name(direction: [f64; 3]) -> Option<&'static str> {
    let axis = direction.iter().position(|v| *v > 1.0 - 1e-6)?;
    Some(["x", "y", "z"][axis])
}

/// A direction in words.
fn direction(of: [f64; 3]) -> String {
    if let Some(name) = name(of) {
        return name.to_owned();
    }
    if let Some(name) = name(of.map(|v| -v)) {
        return format!("−{name}");
    }
    let rounded = of.map(|v| (100.0 * v).round() / 100.0 + 0.0);
    let parts = rounded.map(|v| format!("{v:.2}").replace('-', "−"));
    format!("({})", parts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::structured::{SolidShape, block};
    use crate::mesh::vector::minus;

    /// A box of 33 × 2 × 3 cells.
    fn cells() -> Mesh<3> {
        let hexahedra = SolidShape::Hexahedron;
        block([0.0; 3], [1.0; 3], [33, 2, 3], hexahedra, "body", "")
    }

    fn area(developed: &Developed) -> f64 {
        let triangles = developed.triangles.iter().map(|([a, b, c], _)| {
            let (p, q) = (minus(*b, *a), minus(*c, *a));
            0.5 * (p[0] * q[1] - p[1] * q[0]).abs()
        });
        triangles.sum()
    }

    #[test]
    fn flat_surfaces_keep_their_axes() {
        let mesh = cells();
        let bottom = developed_parts(&mesh, &mesh.boundaries["bottom"], &|_| 1.0);
        assert_eq!(bottom.len(), 1);
        assert_eq!(bottom[0].labels, ["x", "y"]);
        let caption = &bottom[0].caption;
        assert_eq!(caption, "seen through the body along the normal −z");
        assert!((area(&bottom[0]) - 1.0).abs() < 1e-12);
        assert_eq!(bottom[0].edges.iter().filter(|e| e.1).count(), 2 * (33 + 2));
        assert_eq!(bottom[0].vector([0.3; 3], [1.0, 2.0, 3.0]), [1.0, 2.0]);
        // Two faces of the box: one after the other, that with the forces first.
        let both = [&mesh.boundaries["left"][..], &mesh.boundaries["top"]].concat();
        let on_left = |node: u32| f64::from(u8::from(mesh.nodes[node as usize][0] == 0.0));
        let parts = developed_parts(&mesh, &both, &on_left);
        assert_eq!(parts.len(), 1, "{}", parts[0].caption);
        let opposite = [&mesh.boundaries["left"][..], &mesh.boundaries["right"]].concat();
        let parts = developed_parts(&mesh, &opposite, &on_left);
        let captions = [0, 1].map(|k: usize| parts[k].caption.as_str());
        assert_eq!(
            captions[0],
            "part 1 of 2, seen through the body along the normal −x"
        );
        assert_eq!(
            captions[1],
            "part 2 of 2, seen from outside along the normal x"
        );
    }

    #[test]
    fn round_surfaces_are_unrolled_about_their_axis() {
        // The box bent to three quarters of a ring about z; its outer side, of radius 3.
        let mut mesh = cells();
        for x in &mut mesh.nodes {
            let (angle, radius) = (1.5 * PI * x[0], 2.0 + x[1]);
            *x = [5.0 - radius * angle.cos(), radius * angle.sin(), x[2]];
        }
        let peak = [5.0, 3.0, 0.0];
        let pressure = |node: u32| {
            let to = minus(mesh.nodes[node as usize], peak);
            -to[0].hypot(to[1])
        };
        let rolled = developed_parts(&mesh, &mesh.boundaries["back"], &pressure);
        assert_eq!(rolled.len(), 1);
        assert_eq!(rolled[0].labels, ["arc", "z"]);
        let developed = &rolled[0];
        let (caption, area) = (&developed.caption, area(developed));
        assert!(
            caption.ends_with("radius 3; arc 0 lies towards y"),
            "{caption}"
        );
        assert!((area - 4.5 * PI).abs() < 1e-9 * area, "{area}");
        let [around, up] = developed.vector([5.0, 3.0, 0.0], [-2.0, 1.0, 7.0]);
        assert!((around - 2.0).abs() < 1e-9 && (up - 7.0).abs() < 1e-12);
    }

    #[test]
    fn closed_surfaces_are_seen_from_two_sides() {
        let mesh = cells();
        let facets: Vec<Facet<3>> = mesh.boundaries.values().flatten().copied().collect();
        let all = Facets {
            mesh: &mesh,
            facets: &facets,
            normals: normals(&mesh, &facets),
            pressure: &|node| mesh.nodes[node as usize][2],
        };
        let part: Vec<usize> = (0..facets.len()).collect();
        assert!(all.one(&part).is_none());
        assert_eq!(all.pieces().len(), 6);
        let sides = all.sides(&part);
        assert_eq!(sides.len(), 2);
        assert!(sides.iter().all(|side| (area(side) - 1.0).abs() < 1e-12));
        assert_eq!(sides[0].caption, "seen from outside along the normal z");
    }

    /// Curved facets are there in parts at their nodes, with the edges of elements in halves.
    #[test]
    fn surfaces_of_second_order_have_all_their_nodes() {
        let cells = |shape| block([0.0; 3], [1.0; 3], [3, 2, 2], shape, "body", "");
        for (shape, of_facet, facets, edges) in [
            (SolidShape::Hexahedron, 8, 6, 17),
            (SolidShape::Tetrahedron, 4, 12, 23),
        ] {
            let mesh = cells(shape)
                .raised()
                .unwrap_or_else(|error| panic!("{error}"));
            let parts = developed_parts(&mesh, &mesh.boundaries["top"], &|_| 1.0);
            let [top] = &parts[..] else {
                panic!("{} parts", parts.len());
            };
            assert_eq!(top.triangles.len(), of_facet * facets);
            assert!((area(top) - 1.0).abs() < 1e-12);
            let seen: BTreeSet<u32> = top.triangles.iter().flat_map(|part| part.1).collect();
            assert_eq!(seen.len(), 7 * 5);
            assert_eq!(top.edges.len(), 2 * edges);
            assert!(top.edges.iter().all(|edge| edge.2 == 0.5));
            assert_eq!(top.edges.iter().filter(|edge| edge.1).count(), 2 * 10);
        }
    }
}
