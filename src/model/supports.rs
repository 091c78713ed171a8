//! Prescribed displacements: which nodes supports hold, along which directions, and by how much in each step.

use super::axis::AROUND;
use super::entities::{AXES, Foundation, Names, Part as _, Support, Target};
use super::error::{Fault, ModelError};
use super::loads::{known, outer_facets};
use super::{Definition, Quantity};
use crate::contact::Space;
use crate::elasticity::{Bedding, Body, Unknowns};
use crate::mesh::vector::{dot, length, minus, unit};
use crate::mesh::{
    Element, ElementKind, Facet, FacetPoint, Location, Mesh, Topology, facet_corners, facet_nodes,
};
use crate::problem::{LARGEST, SIZES, is_sized};
use crate::rounding::ROUNDING;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

/// The sine of an angle between directions below which they count as one.
pub(super) const SAME: f64 = 1e-5;
/// Facets whose normals differ by more than this are not in one plane: files have six digits at least.
const PLANE: f64 = 1e-5;

/// A prescribed direction at a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Way<const D: usize> {
    /// A coordinate axis.
    Axis(usize),
    /// A unit vector.
    Along([f64; D]),
}

impl<const D: usize> Way<D> {
    pub(super) fn vector(self) -> [f64; D] {
        match self {
            Self::Axis(axis) => std::array::from_fn(|c| f64::from(u8::from(c == axis))),
            Self::Along(vector) => vector,
        }
    }

    /// A direction, as an axis if it is one up to rounding.
    fn of(vector: [f64; D]) -> Self {
        match (0..D).find(|&c| vector[c] > 1.0 - 1e-15) {
            Some(axis) if (0..D).all(|c| c == axis || vector[c] == 0.0) => Self::Axis(axis),
            _ => Self::Along(vector),
        }
    }
}

/// A displacement of a node that a support prescribes.
#[derive(Clone, Debug)]
struct Prescription<const D: usize> {
    node: u32,
    way: Way<D>,
    /// The number of the support.
    support: usize,
    /// Under the load factor 1.
    value: f64,
    /// The component that it prescribes: along an axis, or a direction of the node; None if earlier ones, at a node
    /// with its own directions, already prescribe all of it.
    component: Option<usize>,
}

/// All that supports prescribe, in their order.
#[derive(Clone, Debug, Default)]
pub(super) struct Prescriptions<const D: usize> {
    all: Vec<Prescription<D>>,
    /// Orthonormal directions of the nodes that are not held along axes alone.
    frames: BTreeMap<u32, [[f64; D]; D]>,
    /// The part of foundations: their numbers follow those of the supports.
    pub(super) bedding: Arc<Bedding<D>>,
}

/// The nodes of a support, with the directions and quantities that it prescribes of each.
pub(super) type Held<'s, const D: usize> = Vec<(u32, Vec<(Way<D>, &'s Quantity<D>)>)>;

impl<const D: usize> Support<D> {
    pub(super) fn nodes<'s>(
        &'s self,
        mesh: &Mesh<D>,
        zero: &'s Quantity<D>,
    ) -> Result<Held<'s, D>, Fault>
    where
        ElementKind: Topology<D>,
    {
        let unstated = self.rotate.is_some().then_some(zero);
        let stated = (self.components().into_iter().enumerate())
            .filter_map(|(c, value)| Some((self.way(c), value.or(unstated)?)));
        let stated: Vec<_> = stated.collect();
        let mut nodes = Held::new();
        match self.target() {
            Target::Point(point) => nodes.push((nearest_node(mesh, point)?, stated)),
            Target::Nodes(names) => {
                let held = nodes_of_sets(mesh, names)?.into_iter();
                nodes.extend(held.map(|node| (node, stated.clone())));
            }
            Target::Boundary(names) => {
                for name in names.all() {
                    let facets = known(mesh, mesh.facets(name))?;
                    let mut hold = |facets: &[Facet<D>], ways: &Vec<(Way<D>, &'s Quantity<D>)>| {
                        let held = facets.iter().flat_map(facet_nodes);
                        nodes.extend(held.map(|&node| (node, ways.clone())));
                    };
                    if !self.symmetry {
                        hold(facets, &stated);
                        continue;
                    }
                    for (way, facets) in planes(mesh, name, facets)? {
                        let mut ways = stated.clone();
                        ways.push((way, zero));
                        hold(&facets, &ways);
                    }
                }
            }
        }
        if self.ways().iter().any(Option::is_some) {
            let size = diagonal(mesh);
            for (node, ways) in &mut nodes {
                ways.extend(self.ways_around(mesh.nodes[*node as usize], size)?);
            }
        }
        Ok(nodes)
    }

    /// The direction of x, y or z.
    fn way(&self, component: usize) -> Way<D> {
        match &self.directions {
            None => Way::Axis(component),
            Some(directions) => Way::of(unit(directions[component])),
        }
    }

    /// The components about its axis that it prescribes at x, on a mesh of a size.
    fn ways_around(&self, x: [f64; D], size: f64) -> Result<Vec<(Way<D>, &Quantity<D>)>, Fault> {
        let axis = self.axis.as_ref().expect("checked: there is an axis");
        let along = |directions: [[f64; D]; 3]| {
            let stated = self.ways().into_iter().zip(directions);
            stated
                .filter_map(|(value, way)| Some((Way::of(way), value?)))
                .collect()
        };
        if let Some(directions) = axis.directions(x, 1e-9 * size) {
            return Ok(along(directions));
        }
        // On the axis both directions perpendicular to it are equivalent, if nothing is to move along them.
        let [radial, hoop, _] = self.ways().map(|value| value.map(|q| q.at(x)));
        match (radial, hoop) {
            (None, None) | (Some(0.0), Some(0.0)) => Ok(along(axis.any_directions())),
            _ => Err(Fault::Stated(format!(
                "the node at {} lies on the axis, where {} and {} have no direction: hold both at 0 there, or hold this \
                 boundary along {}",
                Location::from(x),
                AROUND[0],
                AROUND[1],
                &AXES[..D].join(", "),
            ))),
        }
    }
}

impl<const D: usize> Target<'_, D> {
    /// Its nodes, each once.
    pub(super) fn nodes(self, mesh: &Mesh<D>) -> Result<Vec<u32>, Fault>
    where
        ElementKind: Topology<D>,
    {
        let names = match self {
            Self::Point(point) => return Ok(vec![nearest_node(mesh, point)?]),
            Self::Nodes(names) => return nodes_of_sets(mesh, names),
            Self::Boundary(names) => names,
        };
        let mut nodes = Vec::new();
        for name in names.all() {
            let facets = known(mesh, mesh.facets(name))?;
            nodes.extend(facets.iter().flat_map(facet_nodes));
        }
        nodes.sort_unstable();
        nodes.dedup();
        Ok(nodes)
    }

    /// Those that a load or a mean counts, in the order of the mesh before cuts: one where a cut has made two of a node.
    pub(super) fn uncut_nodes(self, mesh: &Mesh<D>) -> Result<Vec<u32>, Fault>
    where
        ElementKind: Topology<D>,
    {
        let mut nodes = self.nodes(mesh)?;
        let before = |node: u32| mesh.twins.get(&node).copied().unwrap_or(node);
        // Those behind the cut come first.
        nodes.sort_by_key(|&node| before(node));
        nodes.dedup_by_key(|node| before(*node));
        Ok(nodes)
    }
}

/// The nodes of sets, each once.
pub(super) fn nodes_of_sets<const D: usize>(
    mesh: &Mesh<D>,
    names: &Names,
) -> Result<Vec<u32>, Fault>
where
    ElementKind: Topology<D>,
{
    let mut nodes = Vec::new();
    for name in names.all() {
        match mesh.node_sets.get(name) {
            Some(set) if set.is_empty() => {
                return Err(Fault::Stated(format!(
                    "the set of nodes \"{name}\" is empty, or its nodes belong to no element"
                )));
            }
            Some(set) => nodes.extend_from_slice(set),
            None => {
                return Err(Fault::NoNodeSet {
                    name: name.clone(),
                    known: mesh.node_sets.keys().cloned().collect(),
                    is_boundary: mesh.boundaries.contains_key(name),
                });
            }
        }
    }
    nodes.sort_unstable();
    nodes.dedup();
    Ok(nodes)
}

impl<const D: usize> Definition<D>
where
    ElementKind: Topology<D>,
{
    /// Hands over the integration points of each foundation, whose number comes first. Each has nodes, place and
    /// normal, the weight with the depth of the bodies in it, and the stiffness along the normal and across it.
    pub(super) fn on_foundations(
        &self,
        body: &Body<D>,
        mut take: impl FnMut(usize, &[u32], &FacetPoint<D>, f64, [f64; 2]),
    ) -> Result<(), ModelError> {
        for (number, foundation) in self.foundations.iter().enumerate() {
            let at_fault = |fault: Fault| foundation.entity(number).error(fault);
            let facets = outer_facets(body.mesh, foundation.boundary.all()).map_err(at_fault)?;
            let mut bad = None;
            body.on_boundary(&facets, |nodes, point, weight| {
                let both = foundation.stiffness.both();
                let stiffness = both.map(|k| k.map_or(0.0, |k| k.at(point.place)));
                match stiffness.iter().find(|&&k| !(k >= 0.0 && is_sized(k))) {
                    Some(&k) => bad = bad.or(Some((k, point.place))),
                    None => take(number, nodes, point, weight, stiffness),
                }
            });
            if let Some((k, place)) = bad {
                let place = Location::from(place);
                let text = match k < 0.0 || !k.is_finite() {
                    true => format!(
                        "the stiffness is {k} at {place}: it must be finite and not negative"
                    ),
                    false => format!("the stiffness is {k:e} at {place}: {SIZES}"),
                };
                return Err(foundation.entity(number).at("stiffness").error(text));
            }
        }
        Ok(())
    }

    /// The normals of the planes of symmetry at nodes, including those of an axis of revolution, which acts like a plane.
    pub(super) fn symmetry_planes(
        &self,
        mesh: &Mesh<D>,
    ) -> Result<HashMap<u32, Vec<[f64; D]>>, ModelError> {
        let mut planes: HashMap<u32, Vec<[f64; D]>> = HashMap::new();
        for (node, &x) in (0..).zip(&mesh.nodes) {
            if self.is_on_axis(x) {
                planes.insert(node, vec![Way::Axis(0).vector()]);
            }
        }
        for (number, support) in self.supports.iter().enumerate() {
            let Target::Boundary(names) = support.target() else {
                continue;
            };
            for name in names.all().iter().filter(|_| support.symmetry) {
                let found = known(mesh, mesh.facets(name))
                    .and_then(|facets| self::planes(mesh, name, facets));
                for (way, facets) in found.map_err(|fault| support.entity(number).error(fault))? {
                    for &node in facets.iter().flat_map(facet_nodes) {
                        let of_node = planes.entry(node).or_default();
                        if !of_node.contains(&way.vector()) {
                            of_node.push(way.vector());
                        }
                    }
                }
            }
        }
        Ok(planes)
    }
}

/// Normals of one boundary whose cosine is below this, 26°, belong to different planes: smaller angles are those between the
/// facets of a curved boundary.
const APART: f64 = 0.9;

/// The planes of a boundary, up to one for each dimension, with their normals.
fn planes<const D: usize>(
    mesh: &Mesh<D>,
    name: &str,
    facets: &[Facet<D>],
) -> Result<Vec<(Way<D>, Vec<Facet<D>>)>, Fault>
where
    ElementKind: Topology<D>,
{
    let curved = match across(mesh, name, facets) {
        Ok(way) => return Ok(vec![(way, facets.to_vec())]),
        Err(curved) => curved,
    };
    let mut parts: Vec<([f64; D], Vec<Facet<D>>)> = Vec::new();
    for facet in facets {
        let normal = mesh.facet_normal(facet).1;
        let count = parts.len();
        let same = |(of, _): &&mut ([f64; D], Vec<Facet<D>>)| dot(*of, normal).abs() > APART;
        match parts.iter_mut().find(same) {
            Some((_, part)) => part.push(*facet),
            None if count < D => parts.push((normal, vec![*facet])),
            None => return Err(curved),
        }
    }
    if parts.len() < 2 {
        return Err(curved);
    }
    let of_part = |(_, part): ([f64; D], Vec<Facet<D>>)| Ok((across(mesh, name, &part)?, part));
    parts.into_iter().map(of_part).collect()
}

/// The direction across a plane boundary.
fn across<const D: usize>(mesh: &Mesh<D>, name: &str, facets: &[Facet<D>]) -> Result<Way<D>, Fault>
where
    ElementKind: Topology<D>,
{
    // A curved facet has other normals at its nodes than in the mean.
    let bends = |facet: &&Facet<D>| {
        let (x, len) = mesh.places_of(facet);
        if len == facet_corners(facet).len() {
            return false;
        }
        let (_, mean) = mesh.facet_normal(facet);
        (<ElementKind as Topology<D>>::normals_at_nodes(&x[..len]).into_iter())
            .any(|normal| length(minus(normal, mean)) > PLANE)
    };
    let curved = facets.iter().find(bends).is_some();
    let along = |&axis: &usize| {
        !curved && (facets.iter()).all(|facet| mesh.facet_normal(facet).1[axis].abs() > 1.0 - 1e-9)
    };
    if let Some(axis) = (0..D).find(along) {
        return Ok(Way::Axis(axis));
    }
    let first = facets
        .first()
        .map_or([0.0; D], |facet| mesh.facet_normal(facet).1);
    // Facets inside a body have no outside: either sign.
    let mut sum = [0.0; D];
    for facet in facets {
        let (area, normal) = mesh.facet_normal(facet);
        let area = area.copysign(dot(normal, first));
        (0..D).for_each(|c| sum[c] += area * normal[c]);
    }
    let mean = unit(sum);
    let flat = |facet: &Facet<D>| {
        let normal = mesh.facet_normal(facet).1;
        let part = dot(normal, mean);
        length(std::array::from_fn::<_, D, _>(|c| {
            normal[c] - part * mean[c]
        })) <= PLANE
    };
    if !curved && facets.iter().all(flat) {
        return Ok(Way::of(mean));
    }
    let (what, instead) = match D {
        2 => ("straight", "a straight one"),
        _ => ("plane", "a plane one"),
    };
    Err(Fault::Stated(format!(
        "boundary \"{name}\" is not {what}: symmetry needs {instead}; around an axis hold it by radial, hoop or axial"
    )))
}

/// The diagonal of the box around a mesh.
fn diagonal<const D: usize>(mesh: &Mesh<D>) -> f64
where
    ElementKind: Topology<D>,
{
    let (low, high) = mesh.bounding_box();
    length(minus(high, low))
}

/// A stated point is on the bodies or away from them by at most this part of their size.
pub(super) const NEAR: f64 = 0.05;

/// The node nearest to a point, which has to be on the body or close to it.
fn nearest_node<const D: usize>(mesh: &Mesh<D>, point: [f64; D]) -> Result<u32, Fault>
where
    ElementKind: Topology<D>,
{
    let distance = |node: &u32| length(minus(mesh.nodes[*node as usize], point));
    // Those of obstacles that move belong to no element.
    let of_elements = mesh.elements.iter().flat_map(Element::nodes).copied();
    let nearest = of_elements
        .min_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.cmp(b)))
        .expect("a mesh has nodes");
    let far = distance(&nearest);
    if far <= NEAR * diagonal(mesh) {
        return Ok(nearest);
    }
    let point: Vec<String> = point.iter().map(f64::to_string).collect();
    Err(Fault::Stated(format!(
        "the node nearest to ({}) is {far:.3e} away: is the point on the body?",
        point.join(", ")
    )))
}

impl<const D: usize> Prescriptions<D> {
    /// Node, component and support of each prescribed component, where it is prescribed first; components are along the
    /// axes, or along the directions of the node.
    pub(super) fn held(&self) -> Vec<(u32, usize, usize)> {
        let mut seen = HashSet::new();
        let all = self.all.iter();
        all.filter_map(|p| Some((p.node, p.component?, p.support)))
            .filter(|&(node, component, _)| seen.insert((node, component)))
            .collect()
    }

    /// Gives nodes that are held along other directions than the axes their own directions, and records which of these
    /// each support prescribes first.
    fn turn_nodes(&mut self) {
        let along = |p: &&Prescription<D>| matches!(p.way, Way::Along(_));
        let turned: HashSet<u32> = self.all.iter().filter(along).map(|p| p.node).collect();
        if turned.is_empty() {
            return;
        }
        let mut bases: BTreeMap<u32, Vec<[f64; D]>> = BTreeMap::new();
        for p in (self.all.iter_mut()).filter(|p| turned.contains(&p.node)) {
            let basis = bases.entry(p.node).or_default();
            p.component = extended(basis, p.way.vector(), SAME).then(|| basis.len() - 1);
        }
        for (node, mut basis) in bases {
            for axis in 0..D {
                // For each missing direction some axis has a large enough remainder.
                extended(&mut basis, Way::Axis(axis).vector(), 0.3);
            }
            let frame = std::array::from_fn(|c| basis[c]);
            self.frames.insert(node, frame);
        }
    }
}

/// Adds the part of a unit vector perpendicular to an orthonormal basis, if it is longer than `least`.
pub(super) fn extended<const D: usize>(
    basis: &mut Vec<[f64; D]>,
    vector: [f64; D],
    least: f64,
) -> bool {
    let mut left = vector;
    for _ in 0..2 {
        for before in basis.iter() {
            let part = dot(*before, left);
            left = std::array::from_fn(|c| left[c] - part * before[c]);
        }
    }
    let is_new = basis.len() < D && length(left) > least;
    if is_new {
        basis.push(unit(left));
    }
    is_new
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// All displacements that supports prescribe, in their order, and the forces of foundations.
    pub(super) fn prescriptions(&self, body: &Body<D>) -> Result<Prescriptions<D>, ModelError> {
        let mesh = body.mesh;
        let mut bedding = Bedding::default();
        self.on_foundations(body, |number, nodes, point, weight, stiffness| {
            let number = self.supports.len() + number;
            bedding.add_point(number, nodes, point, weight, stiffness);
        })?;
        self.put_trusses(mesh, body.materials, &mut bedding);
        let zero = Quantity::from(0.0);
        let mut all = Vec::new();
        // Those that change hold by rows.
        let lasting = self.supports.iter().enumerate();
        for (number, support) in lasting.filter(|(_, support)| !support.changes()) {
            let nodes = support.nodes(mesh, &zero);
            for (node, ways) in nodes.map_err(|fault| support.entity(number).error(fault))? {
                for (way, quantity) in ways {
                    all.push(Prescription {
                        node,
                        way,
                        support: number,
                        value: quantity.at(mesh.nodes[node as usize]),
                        component: match way {
                            Way::Axis(axis) => Some(axis),
                            Way::Along(_) => None,
                        },
                    });
                }
            }
        }
        let mut all = Prescriptions {
            all,
            frames: BTreeMap::new(),
            bedding: Arc::new(bedding),
        };
        all.turn_nodes();
        Ok(all)
    }

    /// The names of supports in results; after them those of foundations.
    pub(super) fn held_by(&self) -> Vec<String> {
        let supports = self.supports.iter().map(Support::name);
        supports
            .chain(self.foundations.iter().map(Foundation::title))
            .collect()
    }

    /// The centroid of the boundaries of each support, its node, or the mean of its nodes; after them those of foundations.
    pub(super) fn support_centres(&self, body: &Body<D>) -> Vec<[f64; D]> {
        let zero = Quantity::from(0.0);
        let centre = |support: &Support<D>| {
            let Target::Boundary(names) = support.target() else {
                let held = support.nodes(body.mesh, &zero).unwrap_or_default();
                let nodes: Vec<u32> = held.into_iter().map(|held| held.0).collect();
                let share = 1.0 / nodes.len().max(1) as f64;
                let places = nodes.iter().map(|&node| body.mesh.nodes[node as usize]);
                return places.fold([0.0; D], |mean, x| {
                    std::array::from_fn(|c| mean[c] + share * x[c])
                });
            };
            let mut facets: Vec<Facet<D>> = (names.all().iter())
                .filter_map(|name| body.mesh.boundaries.get(name))
                .flatten()
                .copied()
                .collect();
            facets.sort_unstable();
            facets.dedup();
            centroid(body, &facets)
        };
        let beds = self.foundations.iter().map(|foundation| {
            let facets = outer_facets(body.mesh, foundation.boundary.all());
            centroid(body, &facets.unwrap_or_default())
        });
        (self.supports.iter().map(centre)).chain(beds).collect()
    }

    /// The numbering of the free components, with the prescribed displacements of all nodes in a step.
    pub(super) fn unknowns(
        &self,
        mesh: &Mesh<D>,
        prescriptions: &Prescriptions<D>,
        time: f64,
    ) -> Result<Unknowns<D>, ModelError> {
        let factors = self.supports.iter().map(|s| self.factor(&s.factors, time));
        let factors: Vec<f64> = factors.collect();
        // Values that are computed have the rounding of their terms, whose size others show.
        let values = prescriptions
            .all
            .iter()
            .map(|p| factors[p.support] * p.value);
        let of_values = ROUNDING * values.map(f64::abs).fold(0.0, f64::max);
        let mut prescribed = vec![[None; D]; mesh.nodes.len()];
        for p in &prescriptions.all {
            let factor = factors[p.support];
            let turn = self.supports[p.support].rotate;
            let x = mesh.nodes[p.node as usize];
            let turned = turn.map_or(0.0, |turn| {
                dot(p.way.vector(), minus(turn.at(x, factor), x))
            });
            // A turn has the rounding of coordinates.
            let of_turn = turn.map_or(0.0, |turn| ROUNDING * (length(x) + length(turn.point)));
            let rounding = of_values.max(of_turn);
            let value = factor * p.value + turned;
            let here = &mut prescribed[p.node as usize];
            let place = Location::from(mesh.nodes[p.node as usize]);
            let fault = if !value.is_finite() {
                format!("the displacement is {value} at {place}")
            } else if value.abs() > LARGEST {
                format!("the displacement is {value:e} at {place}: {SIZES}")
            } else if let Err(way) =
                set(here, p, prescriptions.frames.get(&p.node), value, rounding)
            {
                format!("two supports prescribe different displacements in {way} at {place}")
            } else {
                continue;
            };
            return Err(self.supports[p.support].entity(p.support).error(fault));
        }
        Ok(Unknowns::new(prescribed)
            .along(prescriptions.frames.clone())
            .bedded(Arc::clone(&prescriptions.bedding)))
    }
}

/// The centroid of facets.
fn centroid<const D: usize>(body: &Body<D>, facets: &[Facet<D>]) -> [f64; D]
where
    ElementKind: Topology<D>,
{
    let mut shares = vec![0.0; body.mesh.nodes.len()];
    body.integrate_on_boundary(facets, &|_| 1.0, &mut shares);
    let area: f64 = shares.iter().sum();
    let place = |c: usize| -> f64 {
        let nodes = body.mesh.nodes.iter().zip(&shares);
        nodes.map(|(x, share)| x[c] * share).sum()
    };
    std::array::from_fn(|c| place(c) / area)
}

/// Prescribes a value at a node, with its rounding; returns the direction if that contradicts an earlier value.
fn set<const D: usize>(
    here: &mut [Option<f64>; D],
    p: &Prescription<D>,
    frame: Option<&[[f64; D]; D]>,
    value: f64,
    rounding: f64,
) -> Result<(), String> {
    let differ = |a: f64, b: f64, tolerance: f64| {
        (a - b).abs() > tolerance * f64::max(a.abs(), b.abs()) + rounding
    };
    let (Some(frame), vector) = (frame, p.way.vector()) else {
        let component = p.component.expect("an axis");
        return match here[component].replace(value) {
            Some(old) if differ(old, value, 1e-12) => Err(AXES[component].to_owned()),
            _ => Ok(()),
        };
    };
    // The part that earlier directions have already prescribed.
    let parts = frame.map(|way| dot(way, vector));
    let others = (0..D).filter(|&c| Some(c) != p.component);
    let (mut known, mut size) = (0.0, 0.0_f64);
    for (part, value) in others.map(|c| (parts[c], here[c].unwrap_or(0.0))) {
        known += part * value;
        size = size.max(value.abs());
    }
    match p.component {
        Some(component) => {
            here[component] = Some((value - known) / parts[component]);
            Ok(())
        }
        None if (value - known).abs() <= 1e-12 * value.abs() + 2.0 * SAME * size + rounding => {
            Ok(())
        }
        None => Err(match p.way {
            Way::Axis(axis) => AXES[axis].to_owned(),
            Way::Along(way) => format!("direction {}", Location::from(way)),
        }),
    }
}
