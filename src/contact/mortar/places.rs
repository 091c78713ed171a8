//! The places of a contact: the sums over the facets of the slave boundary at each.

use super::surface::Surface;
use super::{Change, FacetShares, Integrals, Mortar, Share, Shares, Site, add_to};
use crate::contact::transformed::Transformed;
use crate::contact::{
    ContactError, ContactPlace, Friction, PairOptions, checked, frame, is_quarter_off,
    match_tangents, mean, turn_tangents,
};
use crate::dense;
use crate::elasticity::{Body, Depth, Plane};
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{ElementKind, Groups, Mesh, Topology, border, facet_corners, facet_nodes};
use faer::Mat;
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::collections::{BTreeMap, HashMap, HashSet};

/// A place on the border of the covered part that is closer to another one than this part of the shortest edge there
/// passes its share to it. Otherwise there would be more places along a border than meshes can resolve, rows would
/// depend on each other, and Newton's steps lose their way. Of 250 stacks of coarse blocks in balance, 18 did not
/// converge without passing shares on; of those 18, 3 fail with 0.3, 1 with 0.5, none with 0.7 and 1.
const APART: f64 = 0.7;
/// Corners of the covered part support a body, so they stay in place, but not at a distance below this. Closer corners
/// worsen the condition of A by the square, and removing them shrinks the support by no more than this.
const SLIVER: f64 = 1e-3;
/// The border of the covered part has a corner where it turns by more than this, in half turns (10°).
const TURN: f64 = 10.0 / 180.0;
/// The remainder of a place that has passed its shares on is rounding if it is below this part of it.
const NOTHING: f64 = 1e-9;
/// Points on an edge that two facets place within this part of it are one point.
const ONE: f64 = 1e-2;

/// The identity of a place: points with the same key are one. Nodes come first, in the order of their numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
enum Key {
    /// A node, in a smooth part of its boundary, against a part of the other one.
    Node { node: u32, part: u32, other: u32 },
    /// A point on the edge between two nodes, the same parts, and which of those.
    Edge {
        edge: [u32; 2],
        part: u32,
        other: u32,
        number: usize,
    },
    /// A point inside of a facet.
    Inside {
        facet: usize,
        cover: usize,
        vertex: usize,
    },
}

/// The smooth parts of the slave boundary and of the other one at a place.
type Parts = (u32, u32);

/// A vertex of the covered part of a facet: the facet, the number of the cover, its own number.
type Vertex = (usize, usize, usize);

/// Vertices on an edge, each with the part of it.
type OnEdge = Vec<(f64, Vertex)>;

/// The sums over the facets of the slave boundary at each place.
pub(super) struct Places<const D: usize> {
    sums: BTreeMap<Key, Sums<D>>,
}

impl<const D: usize> Places<D>
where
    ElementKind: Mortar<D>,
{
    pub fn new(body: &Body<D>, first: &Surface<D>, shares: &[FacetShares<D>]) -> Self {
        let keys = Keys::new(first, shares);
        let transformed = Transformed::new(body.plane, first.facets);
        let mut sums: BTreeMap<Key, Sums<D>> = BTreeMap::new();
        for (facet, shares) in shares.iter().enumerate() {
            let nodes = facet_nodes(&first.facets[facet]);
            let ring = border(&first.facets[facet]);
            let place = |k: usize| body.mesh.nodes[nodes[ring[k % ring.len()]] as usize];
            let edges = (0..ring.len()).map(|k| length(minus(place(k + 1), place(k))));
            let edge = edges.fold(f64::INFINITY, f64::min);
            for (number, cover) in shares.covers.iter().enumerate() {
                for (vertex, share) in cover.vertices.iter().enumerate() {
                    let key = keys.of(first, cover, (facet, number, vertex));
                    let parts = (first.part[facet], cover.part);
                    let sum = sums
                        .entry(key)
                        .or_insert_with(|| Sums::new(parts, share.place));
                    sum.add(share, nodes, &transformed);
                    sum.edge = sum.edge.min(edge);
                    sum.is_round |= cover.is_round;
                    sum.is_curved |= nodes.len() > facet_corners(&first.facets[facet]).len();
                }
            }
        }
        hand_on(&mut sums);
        Self { sums }
    }

    /// Gives places at the sides of sectors the mean normals of the places that they are halves of.
    fn join_seams(&mut self, options: &PairOptions<D>) {
        let Some(seams) = options.seams else { return };
        let mut at_nodes: HashMap<u32, Vec<[[f64; D]; 2]>> = HashMap::new();
        for (key, sums) in &self.sums {
            if let Key::Node { node, .. } = key
                && seams.contains_key(node)
            {
                at_nodes
                    .entry(*node)
                    .or_default()
                    .push(sums.normals.map(unit));
            }
        }
        for (key, sums) in &mut self.sums {
            let Key::Node { node, .. } = key else {
                continue;
            };
            let sound = sums.normals.iter().all(|normal| length(*normal) > 0.0);
            if !sound || !seams.contains_key(node) {
                continue;
            }
            for (side, normal) in sums.normals.iter_mut().enumerate() {
                let at = |node| -> Vec<[f64; D]> {
                    let all = at_nodes.get(&node).into_iter().flatten();
                    all.map(|normals| normals[side]).collect()
                };
                let size = length(*normal);
                *normal = options
                    .across_seams(unit(*normal), *node, at)
                    .map(|c| size * c);
            }
        }
    }

    /// The contact places, in the order of their keys.
    pub fn finish(
        mut self,
        body: &Body<D>,
        first: &Surface<D>,
        options: &PairOptions<D>,
    ) -> Result<Vec<ContactPlace<D>>, ContactError> {
        // ∫ φ over all facets of a smooth part at a node, covered or not (of a quadrilateral a fourth of its area), and the same times
        // the thickness.
        let mut full: HashMap<(u32, u32), [f64; 2]> = HashMap::new();
        for (number, facet) in first.facets.iter().enumerate() {
            let nodes = facet_nodes(facet);
            let n_corners = facet_corners(facet).len();
            let thickness = match first.depth[number] {
                Depth::Thickness(thickness) => thickness,
                Depth::Ring => 1.0,
            };
            let mut parts = [first.measure[number] / nodes.len() as f64; 9];
            if nodes.len() > n_corners {
                parts = [0.0; 9];
                let (x, len) = body.mesh.places_of(facet);
                <ElementKind as Topology<D>>::facet_points(&x[..len], |point| {
                    (0..len).for_each(|k| parts[k] += point.weight * point.shape[k]);
                });
                parts = Transformed::functions(body.plane, len, n_corners, parts);
            }
            for (&node, part) in nodes.iter().zip(parts) {
                let sums = full.entry((node, first.part[number])).or_default();
                sums[0] += part;
                sums[1] += part * thickness;
            }
        }
        let (mut places, mut of_parts, mut whole) = (Vec::new(), Vec::new(), Vec::new());
        self.join_seams(options);
        for (key, sums) in self.sums {
            let Some(place) = sums.contact_place(body.mesh, first, key, options)? else {
                continue;
            };
            whole.push(match key {
                Key::Node { node, .. } if sums.is_curved => full[&(node, sums.parts.0)],
                _ => [0, 1].map(|k| {
                    let own = place.own.iter();
                    own.map(|&(node, weight)| weight * full[&(node, sums.parts.0)][k])
                        .sum()
                }),
            });
            of_parts.push(sums.parts);
            places.push(place);
        }
        pool(&mut places, &of_parts, &whole, body.plane);
        Ok(places)
    }
}

/// Sizes and distances that differ by less than this part count as equal: rounding must not decide which comes first.
const TIE: f64 = 1e-9;

/// The order of things from the smallest to the largest, of equal ones from the innermost to the outermost and then by
/// number. Sizes and distances from the middle do not depend on how a model is turned or its nodes are numbered.
fn ranked<const D: usize>(all: &[(f64, [f64; D])]) -> Vec<usize> {
    let middle = all.iter().fold([0.0; D], |sum, (_, x)| {
        std::array::from_fn(|c| sum[c] + x[c] / all.len() as f64)
    });
    let far: Vec<f64> = all.iter().map(|(_, x)| length(minus(*x, middle))).collect();
    let size: Vec<f64> = all.iter().map(|(size, _)| *size).collect();
    // The number of the class of equal figures that each is in.
    let classes = |figures: &[f64]| {
        let largest = figures
            .iter()
            .fold(0.0_f64, |max, figure| max.max(figure.abs()));
        let mut order: Vec<usize> = (0..figures.len()).collect();
        order.sort_by(|&a, &b| figures[a].total_cmp(&figures[b]));
        let mut class = vec![0; figures.len()];
        for pair in order.windows(2) {
            let is_next = figures[pair[1]] - figures[pair[0]] > TIE * largest;
            class[pair[1]] = class[pair[0]] + usize::from(is_next);
        }
        class
    };
    let (size, far) = (classes(&size), classes(&far));
    let mut order: Vec<usize> = (0..all.len()).collect();
    order.sort_by_key(|&i| (size[i], far[i], i));
    order
}

/// Merges places that are too close to each other.
fn hand_on<const D: usize>(sums: &mut BTreeMap<Key, Sums<D>>) {
    let few: Vec<Key> = (sums.iter())
        .filter(|(_, sums)| sums.is_partial && sums.angle < 2.0 - TURN)
        .map(|(&key, _)| key)
        .collect();
    if few.is_empty() {
        return;
    }
    // The smaller one goes to the larger one.
    let sizes: Vec<_> = (few.iter())
        .map(|key| (sums[key].area, sums[key].place))
        .collect();
    let mut targets: HashMap<Parts, Vec<GeomWithData<[f64; D], Key>>> = HashMap::new();
    for (&key, sums) in sums.iter().filter(|(_, sums)| !sums.is_corner()) {
        let place = GeomWithData::new(sums.place, key);
        targets.entry(sums.parts).or_default().push(place);
    }
    let targets: HashMap<Parts, RTree<_>> = (targets.into_iter())
        .map(|(parts, places)| (parts, RTree::bulk_load(places)))
        .collect();
    for key in ranked(&sizes).into_iter().map(|i| few[i]) {
        let own = &sums[&key];
        let far = if own.is_corner() { SLIVER } else { APART } * own.edge * (1.0 + TIE);
        let Some(tree) = targets.get(&own.parts) else {
            continue;
        };
        let others = (tree.nearest_neighbor_iter(own.place))
            .filter(|place| place.data != key && sums.contains_key(&place.data))
            .map(|place| (length(minus(*place.geom(), own.place)), place.data));
        // The nearest one, or several at the same distance.
        let mut takers: Vec<(f64, Key)> = Vec::new();
        for (apart, to) in others {
            let limit = takers.first().map_or(far, |first| first.0 + TIE * own.edge);
            if apart > limit {
                break;
            }
            takers.push((apart, to));
        }
        let Some(from) = (!takers.is_empty()).then(|| sums.remove(&key)).flatten() else {
            continue;
        };
        for (_, to) in &takers {
            if let Some(taker) = sums.get_mut(to) {
                taker.take(&from, 1.0 / takers.len() as f64);
            }
        }
    }
}

/// The keys of points on edges that several facets have in common; all others follow from themselves.
struct Keys {
    on_edges: HashMap<Vertex, Key>,
}

impl Keys {
    fn new<const D: usize>(first: &Surface<D>, shares: &[FacetShares<D>]) -> Self
    where
        ElementKind: Topology<D>,
    {
        // The vertices on each edge, by the pair of parts, each with its position on the edge from its lower node on.
        let mut on_edge: BTreeMap<([u32; 2], Parts), OnEdge> = BTreeMap::new();
        for (facet, shares) in shares.iter().enumerate() {
            let nodes = facet_nodes(&first.facets[facet]);
            for (number, cover) in shares.covers.iter().enumerate() {
                for (vertex, share) in cover.vertices.iter().enumerate() {
                    let Site::Edge(edge, part) = share.site else {
                        continue;
                    };
                    let [a, b] = edge.map(|k| nodes[k]);
                    let part = if a < b { part } else { 1.0 - part };
                    let parts = (first.part[facet], cover.part);
                    let points = on_edge.entry(([a.min(b), a.max(b)], parts)).or_default();
                    points.push((part, (facet, number, vertex)));
                }
            }
        }
        let mut on_edges = HashMap::new();
        for ((edge, (part, other)), mut points) in on_edge {
            points.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            // Each point of a facet counts once, however near to the next one, such as those of a needle.
            let (mut number, mut begin, mut facets) = (0, f64::NEG_INFINITY, HashSet::new());
            for (at, vertex) in points {
                if !(at - begin <= ONE && facets.insert(vertex.0)) {
                    (number, begin) = (number + 1, at);
                    facets = HashSet::from([vertex.0]);
                }
                let key = Key::Edge {
                    edge,
                    part,
                    other,
                    number,
                };
                on_edges.insert(vertex, key);
            }
        }
        Self { on_edges }
    }

    fn of<const D: usize>(
        &self,
        first: &Surface<D>,
        cover: &Shares<D>,
        (facet, number, vertex): Vertex,
    ) -> Key
    where
        ElementKind: Topology<D>,
    {
        match cover.vertices[vertex].site {
            Site::Node(k) => Key::Node {
                node: facet_nodes(&first.facets[facet])[k],
                part: first.part[facet],
                other: cover.part,
            },
            Site::Edge(..) => self.on_edges[&(facet, number, vertex)],
            Site::Inside => Key::Inside {
                facet,
                cover: number,
                vertex,
            },
        }
    }
}

/// The sums over the facets of the slave boundary at a place.
struct Sums<const D: usize> {
    parts: Parts,
    /// Its position, before it receives shares of others.
    place: [f64; D],
    /// The angles of the covered parts around it, in half turns.
    angle: f64,
    /// Whether one of the facets is partly covered.
    is_partial: bool,
    /// Whether both sides are round, and fit.
    is_round: bool,
    /// Whether one of them is of second order.
    is_curved: bool,
    /// The shortest edge of the facets.
    edge: f64,
    area: f64,
    bound: f64,
    gap: f64,
    flat: f64,
    range: [f64; 2],
    normals: [[f64; D]; 2],
    own: Vec<(u32, f64)>,
    partners: Vec<(u32, f64)>,
    /// The contribution of directions that supports hold.
    held: Option<Change<D>>,
}

impl<const D: usize> Sums<D> {
    fn new(parts: Parts, place: [f64; D]) -> Self {
        Self {
            parts,
            place,
            angle: 0.0,
            is_partial: false,
            is_round: false,
            is_curved: false,
            edge: f64::INFINITY,
            area: 0.0,
            bound: 0.0,
            gap: 0.0,
            flat: 0.0,
            range: [f64::INFINITY, f64::NEG_INFINITY],
            normals: [[0.0; D]; 2],
            own: Vec::new(),
            partners: Vec::new(),
            held: None,
        }
    }

    /// Whether the border of the covered part turns there.
    fn is_corner(&self) -> bool {
        self.angle < 1.0 - TURN
    }

    /// Adds a share of a place that is dissolved.
    fn take(&mut self, other: &Self, part: f64) {
        self.area += part * other.area;
        self.bound += part * other.bound;
        self.gap += part * other.gap;
        self.flat += part * other.flat;
        self.see(other.range);
        self.add_normals(&other.normals, part);
        for &(node, weight) in &other.own {
            add_to(&mut self.own, node, part * weight);
        }
        for &(node, weight) in &other.partners {
            add_to(&mut self.partners, node, part * weight);
        }
        self.add_held(other.held.as_ref(), part);
    }

    fn add_held(&mut self, other: Option<&Change<D>>, part: f64) {
        let Some(other) = other else { return };
        let held = self.held.get_or_insert_with(|| Change {
            onto: other.onto,
            frame: other.frame,
            rows: std::array::from_fn(|_| Integrals::default()),
        });
        if held.onto.is_none() {
            (held.onto, held.frame) = (other.onto, other.frame);
        }
        // The tangents of neighbours on a curved boundary may be in another order.
        let is_off = is_quarter_off(&other.frame, &held.frame);
        for (a, rows) in other.rows.iter().enumerate() {
            let there = if is_off && a > 0 { D - a } else { a };
            held.rows[there].add(part, rows);
        }
    }

    /// Takes gaps into account.
    fn see(&mut self, [least, most]: [f64; 2]) {
        self.range = [self.range[0].min(least), self.range[1].max(most)];
    }

    /// The integrals of ψ where nothing is held.
    fn plain(&self) -> Integrals {
        Integrals {
            area: self.area,
            gap: self.gap,
            flat: self.flat,
            own: self.own.clone(),
            partners: self.partners.clone(),
        }
    }

    /// The integrals of ψ for the rows along direction `a` of the frame.
    fn along(&self, a: usize) -> Integrals {
        let mut all = self.plain();
        if let Some(held) = &self.held {
            all.add(1.0, &held.rows[a]);
        }
        all
    }

    fn add_normals(&mut self, others: &[[f64; D]; 2], part: f64) {
        for (sum, other) in self.normals.iter_mut().zip(others) {
            (0..D).for_each(|c| sum[c] += part * other[c]);
        }
    }

    /// Adds the integrals of a vertex on a facet with these nodes.
    fn add(&mut self, share: &Share<D>, nodes: &[u32], transformed: &Transformed) {
        self.angle += share.angle;
        self.is_partial |= share.own.is_some();
        self.area += share.area;
        self.bound += share.bound;
        self.gap += share.gap;
        self.flat += share.flat;
        self.see(share.range);
        self.add_normals(&share.normals, 1.0);
        match (share.own, share.site) {
            (None, Site::Node(k)) => {
                for (node, weight) in transformed.own(nodes[k]) {
                    add_to(&mut self.own, node, weight * share.area);
                }
            }
            (own, _) => {
                for (&node, weight) in nodes.iter().zip(own.unwrap_or_default()) {
                    add_to(&mut self.own, node, weight);
                }
            }
        }
        for &(other, weight) in &share.partners {
            add_to(&mut self.partners, other, weight);
        }
        self.add_held(share.held.as_ref(), 1.0);
    }

    /// None where supports leave nothing of it.
    fn contact_place(
        &self,
        mesh: &Mesh<D>,
        first: &Surface<D>,
        key: Key,
        options: &PairOptions<D>,
    ) -> Result<Option<ContactPlace<D>>, ContactError>
    where
        ElementKind: Topology<D>,
    {
        let weights = |entries: &[(u32, f64)], area: f64| -> Vec<(u32, f64)> {
            let mut weights: Vec<(u32, f64)> = (entries.iter())
                .map(|&(node, weight)| (node, weight / area))
                .filter(|p| p.1.abs() > 1e-14)
                .collect();
            weights.sort_unstable_by_key(|p| p.0);
            weights
        };
        let is_nothing = |sums: &Integrals| !(sums.area > NOTHING * self.area);
        let own_of = |sums: &Integrals| {
            let mut own = weights(&sums.own, sums.area);
            if let [only] = &mut own[..] {
                only.1 = 1.0;
            }
            own
        };
        let own = own_of(&self.plain());
        let nodes: Vec<u32> = own.iter().map(|p| p.0).collect();
        let x = mean(&own, |node| mesh.nodes[node as usize]);
        let [outward, facing] = self.normals;
        // On a curved facet the mean normal transfers a uniform pressure unchanged; on the border of the covered part
        // it would represent that of a place inside.
        let is_whole_curve = self.is_curved && !self.is_partial;
        let outward = if is_whole_curve && !self.is_round {
            options.within_planes(unit(outward), &nodes)
        } else {
            mean(&own, |node| first.normal(node, self.parts.0))
        };
        let outward = if nodes.len() > 1 {
            unit(outward)
        } else {
            outward
        };
        // Of fields: where the place was at rest.
        let origin = (options.rest).map_or(x, |rest| mean(&own, |node| rest.nodes[node as usize]));
        let slip_bound = options.friction.at(origin, self.bound)?;
        let normal = match self.is_round {
            true => outward,
            // ν is between the normals of both sides, so that their order does not matter.
            false => unit(minus(outward, facing.map(|c| c / self.area))),
        };
        let normal = options.within_planes(normal, &nodes);
        let mut frame = frame(normal);
        if let Some(held) = &self.held {
            held.onto.map(|onto| turn_tangents(&mut frame, &onto));
            match_tangents(&mut frame, &held.frame);
        }
        // The sides of a row along a direction of the frame, and the mean position of its own side.
        let sides = |sums: &Integrals| {
            if is_nothing(sums) {
                return (x, [Vec::new(), Vec::new()]);
            }
            let own = own_of(sums);
            let x = mean(&own, |node| mesh.nodes[node as usize]);
            let mut partners = weights(&sums.partners, sums.area);
            centre(mesh, x, &frame, self.edge, &mut partners);
            (x, [own, partners])
        };
        // Without held nodes all rows equal the one along ν.
        let directions = if self.held.is_some() { D } else { 1 };
        let rows: Vec<Integrals> = (0..directions).map(|a| self.along(a)).collect();
        let is_tied = matches!(options.friction, Friction::Tied);
        // Without a row along ν only a tie keeps anything.
        let Some(across) = rows
            .iter()
            .take(if is_tied { D } else { 1 })
            .find(|row| !is_nothing(row))
        else {
            return Ok(None);
        };
        let of_normal = |gap: f64| gap * dot(outward, normal);
        let [gap, flat] = [across.gap, across.flat].map(|sum| of_normal(sum / across.area));
        let [least, most] = self.range.map(of_normal);
        // ψ has negative parts, so the mean of a gap that is curved may be outside its range, by O(h²): bodies would press each other
        // before they touch. At a border that of flat facets may be outside as well: the range is that of the points inside.
        let [low, high] = match self.angle < 2.0 - TURN {
            true => [flat.min(least), flat.max(most)],
            false => [least, most],
        };
        // Not so with large displacements: no tangent has a limit, and the position of contact took twice as many iterations.
        let gap = match gap == flat || options.moves {
            true => gap,
            false => gap.max(low).min(high),
        };
        if let Some(interference) = options.interference {
            checked("interference", x, interference(x))?;
        }
        if !gap.is_finite() {
            checked("gap", x, f64::NAN)?;
        }
        let (mean_place, [own, partners]) = sides(across);
        let directed = match self.held {
            None => Vec::new(),
            Some(_) => rows.iter().map(|row| sides(row).1).collect(),
        };
        // On a curved surface a uniform pressure p is the force p ∫ β n.
        let area = if is_whole_curve {
            length(self.normals[0]) * across.area / self.area
        } else {
            across.area
        };
        // Received shares move the place away from its node.
        let at_node = match key {
            // The middle of a curved edge is its node, while the force acts at its transformed position.
            Key::Node { node, .. } if is_whole_curve => Some(node),
            Key::Node { node, .. } => {
                let off = length(minus(mesh.nodes[node as usize], x));
                (off <= 1e-6 * self.edge).then_some(node)
            }
            _ => None,
        };
        Ok(Some(ContactPlace {
            place: at_node
                .filter(|_| self.is_curved)
                .map_or(mean_place, |node| mesh.nodes[node as usize]),
            node: at_node,
            part: self.parts.0,
            own,
            partners,
            directed,
            further: Vec::new(),
            sectors: None,
            frame,
            gap: if options.rest.is_some() || (least < 0.0 && options.may_overlap()) {
                gap
            } else {
                gap.max(0.0)
            },
            area,
            pool: 0,
            slip_bound,
            compliance: options.compliance_at(origin, area)?,
        }))
    }
}

/// Moves the mean place of the partners of a node at x onto its normal, by the least change of their weights.
///
/// Only then a pressure has no moment on the pair, and a rotation of the pair as a whole needs none. For flat
/// boundaries this holds already; for curved ones only up to O(h²).
fn centre<const D: usize>(
    mesh: &Mesh<D>,
    x: [f64; D],
    frame: &[[f64; D]; D],
    edge: f64,
    partners: &mut [(u32, f64)],
) where
    ElementKind: Topology<D>,
{
    // Offsets along the tangents; the first entry belongs to the normal and stays 0.
    let offset = |node: u32| -> [f64; D] {
        let to = minus(mesh.nodes[node as usize], x);
        std::array::from_fn(|a| if a == 0 { 0.0 } else { dot(frame[a], to) })
    };
    let (mut off, mut middle, mut size) = ([0.0; D], [0.0; D], 0.0);
    for &(node, weight) in &*partners {
        let y = offset(node);
        size += weight.abs();
        for a in 1..D {
            off[a] += weight * y[a];
            middle[a] += weight.abs() * y[a];
        }
    }
    let middle = middle.map(|sum| sum / size);
    let mut spread = Mat::<f64>::zeros(D - 1, D - 1);
    for &(node, weight) in &*partners {
        let y = minus(offset(node), middle);
        for a in 1..D {
            for b in 1..D {
                spread[(a - 1, b - 1)] += weight.abs() * y[a] * y[b];
            }
        }
    }
    let scale = (0..D - 1).map(|a| spread[(a, a)]).sum::<f64>().sqrt();
    // Rounding needs no correction, and partners in one place allow none.
    if !(length(off) > 1e-11 * edge && length(off) < 0.5 * scale) {
        return;
    }
    let inverse = dense::pseudo_inverse(&spread, 1e-6);
    let slope: [f64; D] = std::array::from_fn(|a| match a {
        0 => 0.0,
        _ => (1..D).map(|b| -inverse[(a - 1, b - 1)] * off[b]).sum(),
    });
    for (node, weight) in partners {
        *weight += weight.abs() * dot(slope, minus(offset(*node), middle));
    }
}

/// Gives each place the number of the pool for its displayed pressure. A place may have little area compared with the
/// mesh there, `whole` (without and with the thickness) if all of it were covered. It is then pooled with those nearest to it
/// until they have enough area together.
///
/// With less than a quarter of the size along each direction of the boundary, pressures depend as much on where the
/// facets of the master boundary happen to end.
fn pool<const D: usize>(
    places: &mut [ContactPlace<D>],
    parts: &[Parts],
    whole: &[[f64; 2]],
    plane: Plane,
) {
    let ways = D as i32 - 1;
    let enough = |i: usize| {
        let round = match plane {
            Plane::Axisymmetric => Depth::Ring.at(places[i].place),
            Plane::PlaneStrain | Plane::PlaneStress => 1.0,
        };
        (1.0 - TIE) * whole[i][1] * round * 0.25_f64.powi(ways)
    };
    let enough: Vec<f64> = (0..places.len()).map(enough).collect();
    let few: Vec<usize> = (0..places.len())
        .filter(|&i| places[i].area < enough[i])
        .collect();
    let mut groups = Groups::new(places.len());
    if !few.is_empty() {
        let mut area: Vec<f64> = places.iter().map(|place| place.area).collect();
        let all = (places.iter().enumerate()).map(|(i, place)| GeomWithData::new(place.place, i));
        let tree = RTree::bulk_load(all.collect());
        let sizes: Vec<_> = few
            .iter()
            .map(|&i| (places[i].area, places[i].place))
            .collect();
        for i in ranked(&sizes).into_iter().map(|k| few[k]) {
            // A place more than two facets away is not a neighbour.
            let reach = 2.0 * whole[i][0].abs().powf(1.0 / f64::from(ways));
            // All places at the same distance are taken.
            let mut before = 0.0;
            for near in tree.nearest_neighbor_iter(places[i].place) {
                let (mine, j) = (groups.of(i as u32), near.data);
                let to = minus(*near.geom(), places[i].place);
                let far = length(to);
                if (area[mine as usize] >= enough[i] && far > before + TIE * reach) || far > reach {
                    break;
                }
                before = far;
                let other = groups.of(j as u32);
                if other != mine && parts[j] == parts[i] {
                    let sum = area[mine as usize] + area[other as usize];
                    groups.join(mine, other);
                    area[mine as usize] = sum;
                }
            }
        }
    }
    let (_, numbers) = groups.numbers();
    for (place, number) in places.iter_mut().zip(numbers) {
        place.pool = number;
    }
}
