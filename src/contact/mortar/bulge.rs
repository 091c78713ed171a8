//! The deviation of flat facets from the smooth surface that they approximate.

use crate::contact::{Centre, FITTING, Friction, PairOptions, fit, frame};
use crate::dense::{pseudo_inverse, symmetric_eigen};
use crate::mesh::shape::sum;
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, facet_corners, facet_nodes};
use faer::Mat;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};

/// The directions of both radii at a point of contact of round sides that fit differ by less than this, in rad: by half as much where
/// one lies in the other, and more where it lies on the end of a partial arc.
const RADII_DIFFER: f64 = 2.0 * FITTING;

/// A surface that turns by more than this from a node to the next, in rad, has a corner there. Circles of 12 facets turn by 30°, octagons
/// by 45°.
const CORNER: f64 = 35.0 * std::f64::consts::PI / 180.0;
/// Nodes are on both sides of another one if the cosine between them is below this, as seen from there.
const OPPOSITE: f64 = -0.5;
/// Directions are the same if the cosine is above this (30°): a node has five neighbours or six.
const ALONG: f64 = 0.866;
/// A direction has no part in another one with less than this square of the cosine.
const ACROSS: f64 = 0.05;
/// Curvatures below this part of the largest at a node are what its neighbours leave of nothing.
const NONE: f64 = 0.1;
/// Places in files are no more accurate than this, as a part of the distance of nodes: six digits at least.
const WRITTEN: f64 = 2e-6;
/// What turns by less than this from a node to the next, in rad, is flat.
const FLAT: f64 = 1e-3;
/// Differences of curvatures on both sides of a node are even if the smaller one is more than this part of the other one.
const EVEN: f64 = 0.3;

/// The nodes of a facet beside its corners, by their numbers in it, each with those between which it is: two corners, or all of them.
fn midside(corners: usize, nodes: usize) -> impl Iterator<Item = (usize, Vec<usize>)> {
    (corners..nodes).map(move |node| match node - corners {
        k if k < corners => (node, vec![k, (k + 1) % corners]),
        _ => (node, (0..corners).collect()),
    })
}

/// Whether its edges are straight: of first order, or with nodes in the middle between the corners, as where a mesh of first order is
/// raised.
pub(crate) fn is_straight<const D: usize>(mesh: &Mesh<D>, facet: &Facet<D>) -> bool
where
    ElementKind: Topology<D>,
{
    /// As a part of the distance of the corners: coordinates have six digits at least.
    const STRAIGHT: f64 = 1e-5;
    let (x, len) = mesh.places_of(facet);
    midside(facet_corners(facet).len(), len).all(|(node, ends)| {
        let count = ends.len() as f64;
        let mean = std::array::from_fn(|c| ends.iter().map(|&k| x[k][c]).sum::<f64>() / count);
        let size = length(minus(x[ends[1]], x[ends[0]]));
        length(minus(x[node], mean)) <= STRAIGHT * size
    })
}

/// The deviation of a facet from the smooth surface through its nodes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bulge<const D: usize> {
    /// Four times the deviation halfway along each of its edges.
    rises: [f64; 4],
    /// Whether they are known.
    pub is_known: bool,
    /// The numbers of its corners and nodes.
    pub corners: usize,
    nodes: usize,
    /// At rest from the axis or centre to its nodes; zero where the side is not round.
    radii: [[f64; D]; 9],
    /// The lengths of these; at a node in the middle between others the mean of theirs.
    lengths: [f64; 9],
    /// Half the angle between those of its corners, in rad.
    half_angle: f64,
    /// [`Centre::radius`]; 0 where the side is not round.
    radius: f64,
    /// How far it has been stretched around the axis.
    stretch: f64,
}

impl<const D: usize> Bulge<D> {
    /// Those of the facets of a boundary, of which some are round about a centre.
    pub fn all(
        meshes: [&Mesh<D>; 2],
        facets: &[Facet<D>],
        part: &[u32],
        options: &PairOptions<D>,
        centres: &[Option<Centre<D>>],
    ) -> Vec<Self>
    where
        ElementKind: Topology<D>,
    {
        let smooth = Smooth::new(meshes, facets, part, options);
        let each = facets.iter().enumerate().map(|(number, facet)| {
            let mut bulge = smooth.bulge(meshes, facet, part[number]);
            if let Some(Some(centre)) = centres.get(number) {
                bulge.set_round(meshes, facet, centre);
            }
            bulge
        });
        each.collect()
    }

    /// Adds what an arc tells.
    fn set_round(&mut self, [rest, now]: [&Mesh<D>; 2], facet: &Facet<D>, centre: &Centre<D>)
    where
        ElementKind: Topology<D>,
    {
        let bulge = self;
        bulge.radius = centre.radius;
        let radii = &mut bulge.radii;
        for (radius, &node) in radii.iter_mut().zip(facet_nodes(facet)) {
            *radius = centre.radius_to(rest.nodes[node as usize]);
        }
        bulge.lengths = radii.map(length);
        if is_straight(rest, facet) {
            for (node, ends) in midside(bulge.corners, bulge.nodes) {
                let all = ends.iter().map(|&k| bulge.lengths[k]);
                bulge.lengths[node] = all.sum::<f64>() / ends.len() as f64;
            }
        }
        // Along that way between corners which goes most around the axis.
        let corners = facet_corners(facet);
        let mut around = 0.0;
        for (k, &b) in corners.iter().enumerate() {
            for (j, &a) in corners[..k].iter().enumerate() {
                let [long, longer] = [rest, now]
                    .map(|mesh| length(minus(mesh.nodes[b as usize], mesh.nodes[a as usize])));
                let part = length(minus(radii[k], radii[j])) / long;
                let cos = dot(unit(radii[k]), unit(radii[j])).clamp(-1.0, 1.0);
                bulge.half_angle = bulge.half_angle.max(0.5 * cos.acos());
                if part > around {
                    (around, bulge.stretch) = (part, longer / long);
                }
            }
        }
    }

    /// Whether both are round, and their arcs fit.
    pub fn fits(&self, other: &Self) -> bool {
        fit(self.radius, other.radius)
    }

    /// Whether these facets, with their normals, may meet at a point where the directions of both radii hardly differ.
    pub fn faces(&self, normal: [f64; D], other: &Self, there: [f64; D]) -> bool {
        let most = RADII_DIFFER + self.half_angle + other.half_angle;
        -dot(normal, there) >= most.min(std::f64::consts::PI).cos()
    }

    /// How far the smooth surface is outside a flat facet at these φ of its nodes: that of a triangle with weights w of its corners
    /// Σ wₐ w_b times four times the rise halfway between a and b. A quadrilateral is bilinear itself, and bends along its edges.
    pub fn rise(&self, shape: &[f64; 9]) -> f64 {
        let mut w = *shape;
        for (node, ends) in midside(self.corners, self.nodes) {
            let part = shape[node] / ends.len() as f64;
            ends.into_iter().for_each(|k| w[k] += part);
        }
        let across = |a: usize, b: usize| match self.corners {
            // The weight of this edge, beside the one opposite to it.
            4 => {
                let [c, d] = [(b + 1) % 4, (b + 2) % 4];
                (w[a] + w[d]) * (w[b] + w[c]) * (w[a] + w[b])
            }
            _ => w[a] * w[b],
        };
        let each = edges(self.corners).zip(self.rises);
        each.map(|([a, b], rise)| across(a, b) * rise).sum()
    }

    /// The length of the shortest edge that rises, with these corners.
    pub fn shortest(&self, corners: &[[f64; D]]) -> f64 {
        let most = self
            .rises
            .iter()
            .fold(0.0_f64, |most, rise| most.max(rise.abs()));
        let each = edges(self.corners).zip(self.rises);
        let rising = each.filter(|(_, rise)| rise.abs() > NONE * most);
        let lengths = rising.map(|([a, b], _)| length(minus(corners[b], corners[a])));
        lengths.fold(f64::MAX, f64::min)
    }

    /// How far the arc is outside the facet at these φ of its nodes.
    pub fn at(&self, shape: &[f64; 9]) -> f64 {
        let each = self.lengths.iter().zip(shape);
        let radius: f64 = each.map(|(length, phi)| phi * length).sum();
        self.stretch * self.radius.signum() * (radius - length(sum(shape, &self.radii)))
    }
}

/// The pairs of corners between which a facet of so many corners is bent: all of a triangle, its edges elsewhere.
fn edges(corners: usize) -> impl Iterator<Item = [usize; 2]> {
    let count = if corners == 2 { 1 } else { corners };
    (0..count).map(move |k| [k, (k + 1) % corners])
}

/// What nodes tell about the smooth surface that the flat facets of a boundary approximate: its curvature at their corners, in each smooth
/// part that they belong to.
struct Smooth<const D: usize> {
    /// The corners of the facets around each.
    around: HashMap<Node, BTreeSet<u32>>,
    bends: HashMap<Node, Bend<D>>,
    /// Of the bodies that have moved, if they have.
    moved: Option<HashMap<Node, Bend<D>>>,
    /// The directions of curvatures that are not those of a smooth surface.
    rough: HashMap<Node, Vec<[f64; D]>>,
}

/// A node in a smooth part.
type Node = (u32, u32);

/// The curvature at a node.
struct Bend<const D: usize> {
    /// The second derivative of the depth below the tangent plane, above 0 where the surface is convex.
    curvature: [[f64; D]; D],
    normal: [f64; D],
    /// The only direction in which it is known, if the surface ends in the other one.
    along: Option<[f64; D]>,
    /// The normals of planes of symmetry through the node.
    planes: Vec<[f64; D]>,
    /// The distance of the farthest node around.
    size: f64,
}

/// A vector and its images in planes that are perpendicular to each other.
fn images<const D: usize>(v: [f64; D], planes: &[[f64; D]]) -> impl Iterator<Item = [f64; D]> {
    let in_plane = |v: [f64; D], plane: &[f64; D]| {
        let off = dot(v, *plane);
        std::array::from_fn(|c| v[c] - 2.0 * off * plane[c])
    };
    (0..1_usize << planes.len()).map(move |chosen| {
        let planes = planes.iter().enumerate();
        let planes = planes.filter(|(k, _)| chosen >> k & 1 == 1);
        planes.fold(v, |v, (_, plane)| in_plane(v, plane))
    })
}

impl<const D: usize> Bend<D> {
    fn knows(&self, way: [f64; D]) -> bool {
        (self.along).is_none_or(|along| dot(along, way).abs() > ALONG)
    }

    /// Along a direction near the tangent plane.
    fn in_way(&self, way: [f64; D]) -> f64 {
        let off = dot(way, self.normal);
        let way = unit(std::array::from_fn(|c| way[c] - off * self.normal[c]));
        dot(way, self.curvature.map(|row| dot(row, way)))
    }

    /// Whether both are known along directions that are across each other.
    fn is_across(&self, other: &Self) -> bool {
        let both = self.along.zip(other.along);
        both.is_some_and(|(one, other)| dot(one, other).abs() < -OPPOSITE)
    }

    /// From the nodes around one: their depths are those of a paraboloid with any slope. None where there are not two nodes opposite to each other.
    fn of(
        mesh: &Mesh<D>,
        node: u32,
        (normal, planes): ([f64; D], Vec<[f64; D]>),
        around: &BTreeSet<u32>,
    ) -> Option<Self>
    where
        ElementKind: Topology<D>,
    {
        let x = mesh.nodes[node as usize];
        let ways = frame(normal);
        let from = around.iter().filter(|&&other| other != node);
        let from = from.map(|&other| minus(mesh.nodes[other as usize], x));
        let from = from.flat_map(|from| images(from, &planes));
        // Places in the tangent plane, and depths.
        let places: Vec<([f64; D], f64)> = from
            .map(|from| {
                let depth = -dot(from, normal);
                let flat = std::array::from_fn(|c| from[c] + depth * normal[c]);
                (flat, depth)
            })
            .collect();
        let is_opposite = |a: &[f64; D], b: &[f64; D]| dot(*a, *b) / (length(*a) * length(*b));
        let mut opposite = (OPPOSITE, None);
        for (k, (a, _)) in places.iter().enumerate() {
            for (b, _) in &places[..k] {
                let cos = is_opposite(a, b);
                if cos < opposite.0 {
                    opposite = (cos, Some(unit(minus(*a, *b))));
                }
            }
        }
        let first = opposite.1?;
        let second: Option<[f64; D]> = ways[1..].iter().find_map(|way| {
            let part = dot(*way, first);
            let across: [f64; D] = std::array::from_fn(|c| way[c] - part * first[c]);
            (length(across) > 0.5).then(|| unit(across))
        });
        let ends = |way: [f64; D], sign: f64| {
            let cos = |(place, _): &([f64; D], f64)| sign * dot(way, *place) / length(*place);
            places.iter().any(|place| cos(place) > -OPPOSITE)
        };
        let is_known = |way: &[f64; D]| ends(*way, 1.0) && ends(*way, -1.0);
        let bent: Vec<[[f64; D]; 2]> = match second.filter(is_known) {
            Some(second) => vec![[first; 2], [second; 2], [first, second]],
            None => vec![[first; 2]],
        };
        let sizes = places.iter().map(|place| length(place.0));
        let size = sizes.fold(0.0, f64::max);
        let flat = Self {
            curvature: [[0.0; D]; D],
            normal,
            along: (D == 3 && bent.len() == 1).then_some(first),
            planes,
            size,
        };
        if places.iter().all(|place| place.1.abs() <= WRITTEN * size) {
            return Some(flat);
        }
        let slopes = [Some(first), second];
        let row = |place: [f64; D]| -> Vec<f64> {
            let slopes = slopes.iter().flatten().map(|way| dot(*way, place) / size);
            let each = bent.iter().map(|[a, b]| {
                let half = if a == b { 0.5 } else { 1.0 };
                half * dot(*a, place) * dot(*b, place) / (size * size)
            });
            slopes.chain(each).collect()
        };
        let rows: Vec<(Vec<f64>, f64)> =
            places.iter().map(|(x, depth)| (row(*x), *depth)).collect();
        let count = rows[0].0.len();
        let normal_matrix = Mat::from_fn(count, count, |i, j| {
            rows.iter().map(|(row, _)| row[i] * row[j]).sum::<f64>()
        });
        let right = Mat::from_fn(count, 1, |i, _| {
            rows.iter().map(|(row, depth)| row[i] * depth).sum::<f64>()
        });
        let found = pseudo_inverse(&normal_matrix, 1e-9) * right;
        let mut curvature = flat.curvature;
        for (k, [a, b]) in bent.iter().enumerate() {
            let value = found[(count - bent.len() + k, 0)] / (size * size);
            for i in 0..D {
                for j in 0..D {
                    let both = a[i] * b[j] + if a == b { 0.0 } else { b[i] * a[j] };
                    curvature[i][j] += value * both;
                }
            }
        }
        let is_finite = curvature.as_flattened().iter().all(|v| v.is_finite());
        is_finite.then_some(Self { curvature, ..flat })
    }

    /// Of all nodes in `around` that have one, with their averaged normals in each part.
    fn all(
        mesh: &Mesh<D>,
        facets: &[Facet<D>],
        part: &[u32],
        around: &HashMap<Node, BTreeSet<u32>>,
        options: &PairOptions<D>,
    ) -> HashMap<Node, Self>
    where
        ElementKind: Topology<D>,
    {
        let mut normals: HashMap<Node, [f64; D]> = HashMap::new();
        for (facet, part) in facets.iter().zip(part) {
            let normal = mesh.facet_normal(facet).1;
            for &node in facet_corners(facet) {
                let sum = normals.entry((node, *part)).or_insert([0.0; D]);
                *sum = std::array::from_fn(|c| sum[c] + normal[c]);
            }
        }
        let each = around.par_iter().filter_map(|(at, around)| {
            let normal = options.within_planes(unit(normals[at]), &[at.0]);
            let planes = options.symmetry.and_then(|all| all.get(&at.0)).into_iter();
            let planes = planes
                .flatten()
                .filter(|plane| dot(**plane, normal).abs() < 1e-9);
            let bend = Self::of(mesh, at.0, (normal, planes.copied().collect()), around)?;
            Some((*at, bend))
        });
        each.collect()
    }
}

impl<const D: usize> Smooth<D> {
    fn new(
        [mesh, now]: [&Mesh<D>; 2],
        facets: &[Facet<D>],
        part: &[u32],
        options: &PairOptions<D>,
    ) -> Self
    where
        ElementKind: Topology<D>,
    {
        let mut around: HashMap<Node, BTreeSet<u32>> = HashMap::new();
        // Ties have the gap of facets.
        let is_tied = matches!(options.friction, Friction::Tied);
        for (facet, part) in facets.iter().zip(part).filter(|_| !is_tied) {
            if is_straight(mesh, facet) {
                let corners = facet_corners(facet);
                for &node in corners {
                    around.entry((node, *part)).or_default().extend(corners);
                }
            }
        }
        let bends = |mesh| Bend::all(mesh, facets, part, &around, options);
        let mut smooth = Self {
            bends: bends(mesh),
            moved: (!std::ptr::eq(mesh, now)).then(|| bends(now)),
            around,
            rough: HashMap::new(),
        };
        let each = smooth.bends.par_iter();
        smooth.rough = each
            .map(|(at, bend)| (*at, smooth.rough_ways(mesh, *at, bend)))
            .collect();
        smooth
    }

    /// The node around one that is farthest along a direction, as seen from it; beyond a plane of symmetry the image of one. With that
    /// direction as it is there.
    fn next(&self, mesh: &Mesh<D>, at: Node, way: [f64; D]) -> Option<(Node, [f64; D])>
    where
        ElementKind: Topology<D>,
    {
        let here = mesh.nodes[at.0 as usize];
        let planes = self.bends.get(&at).map_or(&[][..], |bend| &bend.planes);
        let others = self.around[&at].iter().filter(|&&node| node != at.0);
        let all = others.flat_map(|&node| {
            let from = unit(minus(mesh.nodes[node as usize], here));
            images(way, planes).map(move |way| (dot(from, way), node, way))
        });
        let (cos, node, way) = all.max_by(|a, b| a.0.total_cmp(&b.0))?;
        (cos > -OPPOSITE).then_some(((node, at.1), way))
    }

    /// The curvature at a node along a direction, if it is known there.
    fn known(&self, at: Node, way: [f64; D]) -> Option<f64> {
        let bend = self.bends.get(&at)?;
        bend.knows(way).then(|| bend.in_way(way))
    }

    /// The neighbours of a node along a direction, both ways, if no corner is there: each with that direction, and the curvature there
    /// less that of the node.
    fn beside(&self, mesh: &Mesh<D>, at: Node, way: [f64; D]) -> Vec<(Node, [f64; D], f64)>
    where
        ElementKind: Topology<D>,
    {
        let Some(here) = self.known(at, way) else {
            return Vec::new();
        };
        let both = [way, way.map(|c| -c)];
        let next = both.into_iter().filter_map(|way| self.next(mesh, at, way));
        next.filter_map(|(next, way)| {
            let there = self.known(next, way)?;
            let [a, b] = [at, next].map(|at| mesh.nodes[at.0 as usize]);
            let turn = here.abs().max(there.abs()) * length(minus(a, b));
            (turn <= CORNER).then_some((next, way, there - here))
        })
        .collect()
    }

    /// The neighbours of a node that have about its curvature, less than twice as much; and whether both have, or its curvature is evenly
    /// between theirs.
    fn alike(
        &self,
        mesh: &Mesh<D>,
        at: Node,
        way: [f64; D],
        none: f64,
    ) -> (Vec<(Node, [f64; D])>, bool)
    where
        ElementKind: Topology<D>,
    {
        let here = self.known(at, way).unwrap_or(0.0);
        let beside = self.beside(mesh, at, way);
        let is_even = match beside.as_slice() {
            [(.., a), (.., b)] => a * b < 0.0 && a.abs().min(b.abs()) > EVEN * a.abs().max(b.abs()),
            _ => false,
        };
        let alike = beside.into_iter().filter(|(.., more)| {
            let most = here.abs().max((here + more).abs());
            more.abs() <= 0.5 * most || most <= none
        });
        let alike: Vec<_> = alike.map(|(at, way, _)| (at, way)).collect();
        let both = alike.len() == 2 || is_even;
        (alike, both)
    }

    /// The directions in which the curvature at a node is not that of a smooth surface, where three nodes in a row have the same, of which it is
    /// one, or its curvature is evenly between those beside it. A corner between flat facets, or the end of a flat between two fillets,
    /// has no such neighbours.
    fn rough_ways(&self, mesh: &Mesh<D>, at: Node, bend: &Bend<D>) -> Vec<[f64; D]>
    where
        ElementKind: Topology<D>,
    {
        if bend.curvature.as_flattened().iter().all(|v| *v == 0.0) {
            return Vec::new();
        }
        let matrix = Mat::from_fn(D, D, |i, j| bend.curvature[i][j]);
        let Some((values, vectors)) = symmetric_eigen(&matrix) else {
            return Vec::new();
        };
        let largest = values.iter().fold(0.0_f64, |most, k| most.max(k.abs()));
        let none = (NONE * largest).max(FLAT / bend.size);
        let bent = (0..D).filter(|&k| values[k].abs() > none);
        let ways = bent.map(|k| std::array::from_fn(|c| vectors[(c, k)]));
        let is_rough = |way: &[f64; D]| {
            let (alike, both) = self.alike(mesh, at, *way, none);
            let is_end = |(next, way)| !self.alike(mesh, next, way, none).1;
            !both && alike.into_iter().all(is_end)
        };
        ways.filter(is_rough).collect()
    }

    /// Whether the curvature at a node is that of a smooth surface along a direction.
    fn is_smooth(&self, at: Node, way: [f64; D]) -> bool {
        let rough = self.rough.get(&at);
        rough.is_some_and(|rough| rough.iter().all(|r| dot(*r, way).powi(2) <= ACROSS))
    }

    /// The part of the curvature along an edge that counts once the bodies have moved: nothing where they have been bent by as much, as
    /// where a tube is crushed flat. Smaller changes are left out: those between contact forces would be a part of the gap that no
    /// tangent has.
    fn kept(
        &self,
        is_smooth: [bool; 2],
        ends: [u32; 2],
        part: u32,
        [rest, now]: [[f64; D]; 2],
    ) -> f64 {
        let Some(moved) = &self.moved else {
            return 1.0;
        };
        let each = ends.into_iter().zip(is_smooth).filter(|end| end.1);
        let each = each.filter_map(|(node, _)| {
            let at = (node, part);
            let [before, after] = [
                self.bends.get(&at)?.in_way(rest),
                moved.get(&at)?.in_way(now),
            ];
            Some((before.abs(), (after - before).abs()))
        });
        let (before, change) = each.fold((0.0, 0.0), |sum, end| (sum.0 + end.0, sum.1 + end.1));
        match before > 0.0 {
            true => (2.0 * (1.0 - change / before)).clamp(0.0, 1.0),
            false => 1.0,
        }
    }

    /// What it tells about a facet. It turns as it does at rest, over its length now: what is bent between contact forces is not the shape of
    /// a surface.
    fn bulge(&self, [rest, now]: [&Mesh<D>; 2], facet: &Facet<D>, part: u32) -> Bulge<D>
    where
        ElementKind: Topology<D>,
    {
        let corners = facet_corners(facet);
        let mut bulge = Bulge {
            rises: [0.0; 4],
            is_known: true,
            corners: corners.len(),
            nodes: facet_nodes(facet).len(),
            radii: [[0.0; D]; 9],
            lengths: [0.0; 9],
            half_angle: 0.0,
            radius: 0.0,
            stretch: 1.0,
        };
        if !is_straight(rest, facet) {
            return bulge;
        }
        for (ends, rise) in edges(corners.len()).zip(&mut bulge.rises) {
            let ends = ends.map(|k| corners[k]);
            let edge = |mesh: &Mesh<D>| {
                let [a, b] = ends.map(|node| mesh.nodes[node as usize]);
                minus(b, a)
            };
            let (long, way) = (length(edge(rest)), unit(edge(rest)));
            let at_ends = ends.map(|node| {
                let at = (node, part);
                let bend = self.bends.get(&at).filter(|_| self.is_smooth(at, way))?;
                Some((bend.in_way(way), bend))
            });
            let has_bend = |node: &u32| self.bends.contains_key(&(*node, part));
            bulge.is_known &= at_ends.iter().any(Option::is_some) || !ends.iter().any(has_bend);
            let whole = at_ends.map(|end| end.filter(|end| end.1.knows(way)));
            let curvature = match (whole, at_ends) {
                // In a corner of a part each end knows what the other one does not.
                ([None, None], [Some((a, one)), Some((b, other))]) if one.is_across(other) => a + b,
                ([None, None], _) => between(at_ends.map(|end| end.map(|end| end.0))),
                _ => between(whole.map(|end| end.map(|end| end.0))),
            };
            // Of an arc with this chord and this turn from end to end. The next nodes on a circle are as far and 2 s deep,
            // with s the sine of half the turn: on a paraboloid of curvature 2 s / (1 − s²) per chord.
            let half = 0.5
                * long
                * curvature
                * self.kept(
                    at_ends.map(|end| end.is_some()),
                    ends,
                    part,
                    [way, unit(edge(now))],
                );
            let sine = 2.0 * half / (1.0 + (1.0 + 4.0 * half * half).sqrt());
            let turn = 2.0 * sine.clamp(-0.5, 0.5).asin();
            *rise = 2.0 * length(edge(now)) * (0.25 * turn).tan();
            bulge.half_angle = bulge.half_angle.max(0.5 * turn.abs());
        }
        bulge
    }
}

/// The curvature between two places, of which one may not be known: their mean, but hardly any where one of them is flat.
fn between(curvatures: [Option<f64>; 2]) -> f64 {
    match curvatures {
        [Some(a), Some(b)] if a * b > 0.0 => {
            a.signum() * (0.5 * (a + b).abs()).min(2.0 * a.abs().min(b.abs()))
        }
        [Some(_), Some(_)] | [None, None] => 0.0,
        [Some(one), None] | [None, Some(one)] => one,
    }
}

/// Between neighbours: a node in the plane, two in space.
pub(crate) fn ridge<const D: usize>(corners: &[u32], k: usize) -> [u32; 2] {
    let a = corners[k];
    let b = match D {
        2 => a,
        _ => corners[(k + 1) % corners.len()],
    };
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::structured::{CellShape, SolidShape, block, rectangle};
    use std::f64::consts::PI;

    /// The rises in the middle of the facets of a side, in order, as parts of the distance of the surface there.
    fn rises<const D: usize>(
        mesh: &Mesh<D>,
        side: &str,
        distance: impl Fn([f64; D]) -> f64,
    ) -> Vec<f64>
    where
        ElementKind: Topology<D>,
    {
        let facets = mesh.outer_facets(side).expect("a side").to_vec();
        let bulges = Bulge::all(
            [mesh, mesh],
            &facets,
            &vec![0; facets.len()],
            &PairOptions::default(),
            &[],
        );
        let each = bulges.iter().zip(&facets).map(|(bulge, facet)| {
            let n = facet_corners(facet).len();
            let mut shape = [0.0; 9];
            shape[..n].fill(1.0 / n as f64);
            bulge.rise(&shape) / distance(mesh.facet_middle(facet))
        });
        let mut each: Vec<f64> = each.collect();
        each.sort_by(f64::total_cmp);
        each
    }

    fn are_near(rises: &[f64], off: f64) {
        let is_near = |rise: &f64| (rise - 1.0).abs() < off;
        assert!(rises.iter().all(is_near), "{off}: {rises:?}");
    }

    #[test]
    fn facets_rise_to_the_surface_through_their_nodes() {
        // Of an arc, with facets of several lengths.
        let mut arc = rectangle([1.0, 0.0], [0.5, 0.4], [1, 9], CellShape::Quad, "a", "a-");
        for x in &mut arc.nodes {
            let angle = PI * (x[1] + 0.01 * (60.0 * x[1]).sin());
            *x = [x[0] * angle.cos(), x[0] * angle.sin()];
        }
        for (side, radius, sign) in [("a-left", 1.0, -1.0), ("a-right", 1.5, 1.0)] {
            are_near(&rises(&arc, side, |x| sign * (radius - length(x))), 3e-2);
        }
        // Of a cone.
        let (quads, triangles) = (SolidShape::Hexahedron, SolidShape::Tetrahedron);
        for (shape, off) in [(quads, 0.0), (triangles, 0.0), (triangles, 0.01)] {
            let mut pin = block(
                [0.5, 0.0, 0.0],
                [0.5, 0.5, 0.4],
                [1, 9, 7],
                shape,
                "a",
                "a-",
            );
            for (k, x) in pin.nodes.iter_mut().enumerate() {
                let is_inner = |x: f64, end: f64| x > 1e-9 && x < end - 1e-9;
                if is_inner(x[1], 0.5) && is_inner(x[2], 0.4) {
                    x[1] += off * (7.0 * k as f64).sin();
                    x[2] += off * (11.0 * k as f64).sin();
                }
                let (sin, cos) = (PI * x[1]).sin_cos();
                let r = x[0] * (1.0 + 0.2 * x[2]);
                *x = [r * cos, r * sin, x[2]];
            }
            let slope = 1.0 / 0.2f64.hypot(1.0);
            let found = rises(&pin, "a-right", |x| {
                (1.0 + 0.2 * x[2] - x[0].hypot(x[1])) * slope
            });
            are_near(&found, if off > 0.0 { 0.15 } else { 1e-2 });
        }
    }

    /// A strip of cells with these widths and the turns between them, in degrees.
    fn bent(cells: &[(f64, f64)]) -> Mesh<2> {
        let n = cells.len();
        let mut mesh = rectangle(
            [0.0; 2],
            [1.0, n as f64],
            [1, n],
            CellShape::Quad,
            "a",
            "a-",
        );
        let (mut place, mut angle) = ([0.0_f64; 2], 0.0_f64);
        let drawn = mesh.nodes.clone();
        for (k, (width, turn)) in cells.iter().enumerate() {
            angle += turn.to_radians();
            place = [
                place[0] + width * angle.sin(),
                place[1] + width * angle.cos(),
            ];
            for (x, drawn) in mesh.nodes.iter_mut().zip(&drawn) {
                if *drawn == [0.0, k as f64 + 1.0] {
                    *x = place;
                }
            }
        }
        mesh
    }

    #[test]
    fn what_is_no_smooth_surface_does_not_rise() {
        let flat = |cells: &[(f64, f64)]| {
            let found = rises(&bent(cells), "a-left", |_| 1.0);
            assert!(
                found.iter().all(|rise| rise.abs() < 1e-12),
                "{cells:?}: {found:?}"
            );
        };
        // A corner, a chamfer with one facet, ramps with one at the end and on both sides of a flat with one, an octagon.
        flat(&[(1.0, 0.0), (1.0, 0.0), (1.0, 20.0), (1.0, 0.0)]);
        flat(&[(1.0, 0.0), (1.0, 0.0), (0.2, 30.0), (1.0, 30.0), (1.0, 0.0)]);
        flat(&[(1.0, 0.0), (1.0, 0.0), (1.0, 0.0), (0.5, 10.0)]);
        flat(&[(0.4, 0.0), (1.0, 10.0), (0.4, 10.0)]);
        flat(&[(1.0, 45.0); 7]);
        // A flat with one facet between fillets: nothing but the fillets rises, all of them.
        let fillet = [(0.2, 15.0); 5];
        let ends = [(0.2, 7.5), (2.0, 7.5), (0.2, 7.5)];
        let cells = [
            &[(2.0, 0.0)][..],
            &ends[2..],
            &fillet,
            &ends[1..2],
            &ends[..1],
            &fillet,
        ]
        .concat();
        let found = rises(&bent(&cells), "a-left", |_| 0.025 * (15.0_f64.to_radians()));
        are_near(&found[2..], 0.02);
        assert!(found[..2].iter().all(|rise| rise.abs() < 1e-9));
    }
}
