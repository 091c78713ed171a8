//! Supports and forces of nodes.

use super::{Result, Translation, quantities, with_factors};
use crate::deck::history::{Tracks, factors};
use crate::deck::said::{Kind, Transform, What};
use crate::mesh::abaqus::index::Name;
use crate::mesh::vector::{cross, dot, minus, unit};
use crate::model::{AXES, Axis, Force, Number, Support};
use std::collections::{BTreeMap, BTreeSet};

/// Nodes with the same values of one component.
struct Same {
    line: usize,
    component: usize,
    values: Vec<f64>,
    nodes: Vec<u32>,
    transform: Option<usize>,
    origin: String,
    switches: Switches,
}

/// The common entry of nodes in one table.
struct Table {
    line: usize,
    nodes: Vec<u32>,
    transform: Option<usize>,
    origin: String,
    components: Vec<(usize, f64)>,
    factors: Option<Vec<f64>>,
    switches: Switches,
}

/// Of a support: the load steps in which it acts, and those in which it holds its nodes where they are.
type Switches = [Option<Vec<f64>>; 2];

impl<const D: usize> Translation<'_, '_, D> {
    /// The number of the transform that turns the directions of a node; the last that names it.
    pub(super) fn transforms(&mut self) -> Result<BTreeMap<u32, usize>> {
        let mut of_node = BTreeMap::new();
        for (number, transform) in self.said.transforms.iter().enumerate() {
            for node in self.index.nodes(transform.line, transform.set)? {
                match transform.axes() {
                    Some(axes) if axes == IDENTITY => of_node.remove(&node),
                    _ => of_node.insert(node, number),
                };
            }
        }
        Ok(of_node)
    }

    /// The nodes that an entry for a node applies to: also its equal nodes, or none if no body has it.
    fn meant(&mut self, kind: Kind, node: u32, component: usize) -> Vec<u32> {
        let own = self.used[node as usize];
        match self.equal_of.get(&(component, node)) {
            Some(&number) if kind == Kind::Boundary => {
                self.equal[number].held = true;
                self.equal[number].nodes.clone()
            }
            // A force moves all of them, whichever it acts on.
            Some(&number) if !own && self.equal[number].nodes.is_empty() => Vec::new(),
            Some(_) => vec![node],
            None if own => vec![node],
            _ => Vec::new(),
        }
    }

    /// Supports or forces of nodes, a table for each set of nodes that have the same.
    pub(super) fn nodes(&mut self, kind: Kind) -> Result<()> {
        let transforms = self.transforms()?;
        let mut tracks = Tracks::default();
        let mut reported = BTreeSet::new();
        let refused = self.refusals.len();
        for load in &self.said.loads {
            let step = load.step.unwrap_or(0);
            let (target, components, value): (&str, &[usize], f64) = match &load.what {
                What::Clear(of) if *of == kind => {
                    tracks.clear(step, load.line);
                    continue;
                }
                What::Boundary {
                    target,
                    components,
                    value,
                } if kind == Kind::Boundary => (target, components, *value),
                What::Force {
                    target,
                    component,
                    value,
                } if kind == Kind::Force => (target, std::slice::from_ref(component), *value),
                What::Fixed { target, components } if kind == Kind::Boundary => {
                    (target, components, 0.0)
                }
                _ => continue,
            };
            let is_fixed = matches!(load.what, What::Fixed { .. });
            let origin = self.index.set_name(true, target).map_or("", |_| target);
            for node in self.index.nodes(load.line, target)? {
                // Reference nodes have been read already.
                if self.points.contains_key(&node) {
                    continue;
                }
                let transform = transforms.get(&node).copied();
                let axes = transform.and_then(|number| self.said.transforms[number].axes());
                let leaves = D == 2 && axes.is_some_and(|axes| axes[2][..2] != [0.0; 2]);
                if kind == Kind::Boundary && leaves {
                    let text =
                        "*BOUNDARY: the directions 1 and 2 of its *TRANSFORM leave the plane";
                    if reported.insert(load.line) {
                        self.refuse(load.line, "BOUNDARY", text);
                    }
                    continue;
                }
                for &component in components {
                    // Nodes of bodies have no rotations to hold.
                    if component >= 3 {
                        if kind == Kind::Force && reported.insert(load.line) {
                            let text = format!(
                                "*CLOAD, direction {}: nodes have forces along x, y and z only",
                                component + 1
                            );
                            self.refuse(load.line, "CLOAD", text);
                        }
                        continue;
                    }
                    if component >= D {
                        if value != 0.0 && reported.insert(load.line) {
                            let keyword = match kind {
                                Kind::Force => "CLOAD",
                                _ => "BOUNDARY",
                            };
                            let text = format!("*{keyword}: in the plane there is no direction 3");
                            self.refuse(load.line, keyword, text);
                        }
                        continue;
                    }
                    let meant = self.meant(kind, node, component);
                    if meant.is_empty() {
                        self.unused(kind, load.line, &mut reported);
                    }
                    for node in meant {
                        let key = (node, component);
                        match (is_fixed, kind) {
                            (true, _) => tracks.fix(key, origin, load.stated()),
                            (false, Kind::Force) => {
                                tracks.load(key, origin, value, load.stated());
                            }
                            _ => tracks.set(key, origin, value, load.stated()),
                        }
                    }
                }
            }
        }
        type Key = (
            String,
            usize,
            Option<usize>,
            Vec<u64>,
            [Option<Vec<u64>>; 2],
            Option<u32>,
        );
        let mut same: BTreeMap<Key, Same> = BTreeMap::new();
        for ((node, component), track) in &tracks.all {
            // The one that is held holds the others, too.
            let is_alike = self.equal_of.contains_key(&(*component, *node));
            if let (Kind::Boundary, true, Some(line)) = (kind, is_alike, track.changes()) {
                if reported.insert(line) {
                    let text = "*BOUNDARY: the support of nodes that an *EQUATION moves alike cannot be added, removed or fixed between \
                                steps";
                    self.refuse(line, "BOUNDARY", text);
                }
                continue;
            }
            let switches = match kind {
                Kind::Boundary => track.switches(&self.times),
                _ => Switches::default(),
            };
            if let (Kind::Boundary, Some(line)) = (kind, track.starts_anywhere(&self.times)) {
                if reported.insert(line) {
                    let text = "*BOUNDARY: it begins where its nodes are, and an amplitude of the same step has corners on the way from there: \
                                give it an AMPLITUDE of its own, or a step of its own";
                    self.refuse(line, "BOUNDARY", text);
                }
                continue;
            }
            let values = track.values(&self.times, 0.0);
            if kind == Kind::Force && values.iter().all(|&v| v == 0.0) {
                continue;
            }
            let transform = transforms.get(node).copied();
            let bits = |all: &Vec<f64>| all.iter().map(|v| v.to_bits()).collect::<Vec<u64>>();
            let of_switches = switches.each_ref().map(|list| list.as_ref().map(bits));
            let bits = bits(&values);
            // The force on a node without a body acts on a node that moves alike, in addition to that node's own.
            let bare = Some(*node).filter(|&node| !self.used[node as usize]);
            let origin = match bare {
                None => track.origin.clone(),
                Some(_) => String::new(),
            };
            let node = match (bare, self.equal_of.get(&(*component, *node))) {
                (Some(_), Some(&number)) => self.equal[number].nodes[0],
                _ => *node,
            };
            let key = (
                origin.clone(),
                *component,
                transform,
                bits,
                of_switches,
                bare,
            );
            let here = same.entry(key).or_insert_with(|| Same {
                line: track.line,
                component: *component,
                values,
                nodes: Vec::new(),
                transform,
                origin,
                switches,
            });
            here.line = here.line.min(track.line);
            here.nodes.push(node);
        }
        if kind == Kind::Boundary && same.is_empty() {
            // Without these nothing would be held.
            (self.refusals[refused..].iter_mut()).for_each(|one| one.key.clear());
        }
        let mut same: Vec<Same> = same.into_values().collect();
        same.sort_by_key(|one| (one.line, one.component));
        for table in merged(same) {
            self.put_nodes(kind, table)?;
        }
        Ok(())
    }

    /// Reports a node that belongs to no body.
    fn unused(&mut self, kind: Kind, line: usize, reported: &mut BTreeSet<usize>) {
        if !reported.insert(line) {
            return;
        }
        match kind {
            Kind::Force => {
                self.refuse(
                    line,
                    "CLOAD",
                    "*CLOAD: this node belongs to no element of a body",
                );
            }
            _ => {
                let place = (self.place)(line);
                self.notes.push(format!(
                    "{place}: nodes that belong to no element of a body are left out"
                ));
            }
        }
    }

    /// The name of a set with these nodes: of the deck, if the one that named them has no others.
    pub(super) fn set_of(
        &mut self,
        line: usize,
        origin: Name,
        nodes: &[u32],
        what: &'static str,
    ) -> Result<String> {
        let mut name = None;
        if !origin.text.is_empty() {
            let all = self.index.nodes(line, origin)?;
            let of_bodies: Vec<u32> = (all.into_iter())
                .filter(|&node| self.used[node as usize])
                .collect();
            if of_bodies == nodes {
                name = self.index.set_name(true, origin);
            }
        }
        let name = match name {
            Some(name) => name,
            None => self.name(what),
        };
        self.index.add_nodes(&name, nodes);
        Ok(name)
    }

    fn put_nodes(&mut self, kind: Kind, mut table: Table) -> Result<()> {
        table.nodes.sort_unstable();
        let what = match kind {
            Kind::Boundary => "support",
            _ => "force",
        };
        let set = self.set_of(table.line, table.origin.as_str().into(), &table.nodes, what)?;
        self.comes_from(table.line, what);
        let transform = table.transform.map(|number| &self.said.transforms[number]);
        let components = table.components.into_iter();
        if kind == Kind::Force {
            let force = Force::at_nodes(set);
            let force = match transform {
                None => components.fold(force, |force, (axis, value)| force.along(axis, value)),
                Some(transform) => quantities(table.line, &transform.turned(components))?
                    .fold(force, |force, (axis, value)| force.along(axis, value)),
            };
            let force = with_factors(force, table.factors, Force::factors);
            self.definition.forces.push(force);
            return Ok(());
        }
        let support = Support::at_nodes(set);
        let support = match transform {
            None => components.fold(support, |support, (axis, value)| support.along(axis, value)),
            Some(transform) if transform.axes().is_some() => {
                let axes = transform.ways([0.0; 3]);
                let ways = std::array::from_fn(|c| std::array::from_fn(|g| axes[c][g]));
                components.fold(support.directed(ways), |support, (axis, value)| {
                    support.along(axis, value)
                })
            }
            Some(transform) => {
                let [point, end] = transform.points();
                let direction = (D == 3).then(|| minus(end, point));
                let axis = Axis::through(std::array::from_fn(|c| point[c]), direction);
                components.fold(support.about(axis), |support, (way, value)| {
                    support.around(way, value)
                })
            }
        };
        let [active, lock] = table.switches;
        let support = with_factors(support, table.factors, Support::factors);
        let support = with_factors(support, active, Support::active);
        let support = with_factors(support, lock, Support::locked_in);
        self.definition.supports.push(support);
        Ok(())
    }
}

/// Tables of the nodes that have the same components with the same factors.
fn merged(same: Vec<Same>) -> Vec<Table> {
    let mut tables: Vec<Table> = Vec::new();
    // By the nodes and their directions.
    let mut of_nodes: BTreeMap<(Vec<u32>, Option<usize>), Vec<usize>> = BTreeMap::new();
    for one in same {
        let mut nodes = one.nodes;
        nodes.sort_unstable();
        let (value, factors) = factors(&one.values);
        let key = (nodes, one.transform);
        let here = of_nodes.entry(key.clone()).or_default();
        let fits = |&&number: &&usize| {
            let table: &Table = &tables[number];
            let zero = table.components.iter().all(|component| component.1 == 0.0);
            let alike = table.factors == factors || value == 0.0 || zero;
            alike && table.switches == one.switches
        };
        let component = (one.component, value);
        match here.iter().find(fits) {
            Some(&number) => {
                let table = &mut tables[number];
                table.components.push(component);
                if value != 0.0 {
                    table.factors = factors;
                }
            }
            None => {
                here.push(tables.len());
                tables.push(Table {
                    line: one.line,
                    nodes: key.0,
                    transform: one.transform,
                    origin: one.origin,
                    components: vec![component],
                    factors,
                    switches: one.switches,
                });
            }
        }
    }
    tables
}

/// The axes one by one.
pub(super) const IDENTITY: [[f64; 3]; 3] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Transform<'_> {
    /// Its two points.
    pub fn points(&self) -> [[f64; 3]; 2] {
        [[0, 1, 2], [3, 4, 5]].map(|of| of.map(|at| self.points[at]))
    }

    /// The directions of a rectangular one: the first towards the first point, the second on the side of the second point.
    pub(super) fn axes(&self) -> Option<[[f64; 3]; 3]> {
        let [a, b] = self.points();
        let first = unit(a);
        let third = unit(cross(first, b));
        (!self.cylindrical).then(|| [first, cross(third, first), third])
    }

    /// Its directions at a place; not finite on the axis of a cylindrical one.
    pub(super) fn ways(&self, place: [f64; 3]) -> [[f64; 3]; 3] {
        if let Some(axes) = self.axes() {
            return axes;
        }
        let [point, end] = self.points();
        let along = unit(minus(end, point));
        let way = minus(place, point);
        let height = dot(way, along);
        let radial = unit(std::array::from_fn(|c| way[c] - height * along[c]));
        [radial, cross(along, radial), along]
    }

    /// A vector along its directions, as numbers or expressions along x, y and z; empty if it vanishes.
    fn turned(&self, components: impl Iterator<Item = (usize, f64)>) -> [String; 3] {
        let mut along = [0.0; 3];
        components.for_each(|(c, value)| along[c] += value);
        if let Some(axes) = self.axes() {
            return std::array::from_fn(|g| {
                // The cosine of a right angle is only rounding.
                let terms = (0..3).map(|c| along[c] * axes[c][g]);
                let sum: f64 = terms.clone().sum();
                match sum.abs() > 1e-14 * terms.fold(0.0, |most, term| f64::max(most, term.abs())) {
                    true => Number(sum).to_string(),
                    false => String::new(),
                }
            });
        }
        let [point, end] = self.points();
        let d = unit(minus(end, point));
        // Across the axis, and around it by the right-hand rule.
        let across = |g: usize, k: usize| f64::from(u8::from(g == k)) - d[g] * d[k];
        let around = |g: usize, k: usize| cross(d, IDENTITY[k])[g];
        let matrix = |of: &dyn Fn(usize, usize) -> f64| -> [[f64; 3]; 3] {
            std::array::from_fn(|g| std::array::from_fn(|k| of(g, k)))
        };
        let squares = linear(matrix(&across), point)
            .into_iter()
            .filter(|term| !term.is_empty());
        let squares: Vec<String> = squares.map(|term| format!("({term})^2")).collect();
        let radius = format!("sqrt({})", squares.join(" + "));
        let turned = linear(
            matrix(&|g, k| along[0] * across(g, k) + along[1] * around(g, k)),
            point,
        );
        std::array::from_fn(|g| {
            let mut terms = Vec::new();
            if !turned[g].is_empty() {
                terms.push(format!("({}) / {radius}", turned[g]));
            }
            if along[2] * d[g] != 0.0 {
                terms.push(bracketed(along[2] * d[g]));
            }
            terms.join(" + ")
        })
    }
}
/// A matrix times the way from a point, in terms of x, y and z; empty where a row is zero.
pub(super) fn linear(matrix: [[f64; 3]; 3], point: [f64; 3]) -> [String; 3] {
    let largest = matrix
        .as_flattened()
        .iter()
        .fold(0.0, |most: f64, v| most.max(v.abs()));
    std::array::from_fn(|c| {
        let terms: Vec<String> = (0..3)
            .filter(|&d| matrix[c][d].abs() > 1e-15 * largest)
            .map(|d| {
                let factor = Number(matrix[c][d]);
                match point[d] {
                    0.0 => format!("{factor} * {}", AXES[d]),
                    p => format!("{factor} * ({} - {})", AXES[d], bracketed(p)),
                }
            })
            .collect();
        terms.join(" + ")
    })
}

fn bracketed(value: f64) -> String {
    match value < 0.0 {
        true => format!("({})", Number(value)),
        false => Number(value).to_string(),
    }
}
