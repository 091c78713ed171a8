//! Equations between displacements of nodes, and nodes that move alike.

use super::nodes::IDENTITY;
use super::points::Given;
use super::{Result, Translation, with_factors};
use crate::deck::history::factors;
use crate::deck::said::{MpcCard, MpcKind};
use crate::mesh::abaqus::index::Name;
use crate::mesh::abaqus::keyword::key;
use crate::mesh::vector::{cross, dot, length, minus, unit};
use crate::model::{Equal, Equation, Force};
use std::collections::{BTreeMap, BTreeSet};

/// A node is on a line or plane if its distance from it is below this part of the distances along it: files have six digits, of
/// coordinates that may be large.
const OFF: f64 = 1e-4;

/// Parts of an equation below this, relative to its largest one, are what is left where others cancel.
const ROUNDING: f64 = 1e-13;

/// Nodes of bodies whose displacements along an axis are equal.
pub(super) struct Alike {
    line: usize,
    component: usize,
    /// Sorted.
    pub nodes: Vec<u32>,
    /// Whether a support prescribes these displacements: then it does so for all of them.
    pub held: bool,
}

/// Names of sets by their nodes.
type SetNames = BTreeMap<Vec<u32>, String>;

/// An equation as the deck has it: node, direction and factor of each term.
type Stated = (usize, Vec<(u32, usize, f64)>);

/// Nodes of bodies, each with factors along the axes.
type Terms<const D: usize> = Vec<(u32, [f64; D])>;

/// A sum of displacements of nodes, and its value at the end of each load step.
pub(super) struct Row<const D: usize> {
    line: usize,
    terms: Terms<D>,
    /// Factors of displacements without a body, each of a node in one of its directions.
    bare: BTreeMap<(u32, usize), f64>,
    value: Vec<f64>,
}

impl<const D: usize> Row<D> {
    fn add(&mut self, node: u32, way: [f64; D]) {
        match self.terms.iter_mut().find(|term| term.0 == node) {
            Some((_, sum)) => (0..D).for_each(|c| sum[c] += way[c]),
            None => self.terms.push((node, way)),
        }
    }

    /// Adds a multiple of another equation.
    fn plus(&mut self, factor: f64, other: &Self) {
        for &(node, way) in &other.terms {
            self.add(node, way.map(|part| factor * part));
        }
        for (&which, part) in &other.bare {
            *self.bare.entry(which).or_default() += factor * part;
        }
        let values = self.value.iter_mut().zip(&other.value);
        values.for_each(|(value, other)| *value += factor * other);
    }
}

impl<const D: usize> Translation<'_, '_, D> {
    /// Finds the displacements that are equal, and all other equations.
    pub(super) fn equations(&mut self) -> Result<()> {
        let transforms = self.transforms()?;
        let mut stated: Vec<Stated> = Vec::new();
        let mut unsorted = Vec::new();
        for equation in &self.said.equations {
            let line = equation.line;
            let sets = equation.terms.iter();
            let sets = sets.map(|&(target, ..)| self.index.nodes(line, target));
            let sets = sets.collect::<Result<Vec<Vec<u32>>>>()?;
            let count = sets.iter().map(Vec::len).max().unwrap_or(0);
            if sets.iter().any(|set| set.len() != 1 && set.len() != count) {
                let text = "*EQUATION: all sets must have the same number of nodes, or one";
                return Err((line, text.to_owned()));
            }
            // Nodes of sets are paired by their numbers.
            let listed = |target: &Name| {
                let name = target.text.rsplit('.').next().unwrap_or_default();
                self.said.unsorted.contains(&key(name))
            };
            let several = sets
                .iter()
                .zip(&equation.terms)
                .filter(|(set, _)| set.len() > 1);
            let several: Vec<Name> = several.map(|(_, term)| term.0).collect();
            if let (2.., Some(target)) =
                (several.len(), several.iter().find(|target| listed(target)))
            {
                let text = format!(
                    "*EQUATION: the order of the set \"{target}\" counts, as it is UNSORTED: write the equations node by node"
                );
                unsorted.push((line, text));
            }
            stated.extend((0..count).map(|i| {
                let terms = sets.iter().zip(&equation.terms);
                let terms = terms.map(|(set, &(_, c, factor))| (set[i % set.len()], c, factor));
                // In the plane nothing moves along z.
                (line, terms.filter(|&(_, c, _)| c < D).collect())
            }));
        }
        for (line, text) in unsorted {
            self.refuse(line, "UNSORTED", text);
        }
        let n_steps = self.times.ends.len();
        let row = |line| Row {
            line,
            terms: Vec::new(),
            bare: BTreeMap::new(),
            value: vec![0.0; n_steps],
        };
        let mut rows: Vec<Row<D>> = Vec::new();
        for card in &self.said.multi_point {
            if self.said.large.is_some() {
                let text = format!(
                    "*MPC, {}: it is linear in the displacements, which have to be small",
                    card.name
                );
                self.refuse(card.line, "MPC", text);
                continue;
            }
            for terms in self.multi_point(card)? {
                let mut one = row(card.line);
                for (node, way) in terms {
                    if self.used[node as usize] {
                        one.add(node, way);
                        continue;
                    }
                    if transforms.contains_key(&node) {
                        let text = "*MPC: directions of a node without elements are the axes, not those of a *TRANSFORM";
                        return Err((card.line, text.to_owned()));
                    }
                    one.bare.extend((0..D).map(|c| ((node, c), way[c])));
                }
                rows.push(one);
            }
        }
        // Two terms along an axis make displacements equal, unless a node without elements also has other equations.
        let is_pair = |(_, terms): &Stated| match terms[..] {
            [(first, c, a), (second, d, b)] => {
                let turned = [first, second]
                    .iter()
                    .any(|node| transforms.contains_key(node));
                c == d && a == -b && a != 0.0 && !turned
            }
            _ => false,
        };
        let (mut pairs, mut others): (Vec<Stated>, Vec<Stated>) =
            stated.into_iter().partition(is_pair);
        let mut bare: BTreeSet<u32> = (rows.iter())
            .flat_map(|row| row.bare.keys().map(|which| which.0))
            .collect();
        let mut seen = 0;
        loop {
            let nodes = others[seen..].iter().flat_map(|(_, terms)| terms);
            bare.extend(
                nodes
                    .map(|term| term.0)
                    .filter(|&node| !self.used[node as usize]),
            );
            seen = others.len();
            let has_bare = |(_, terms): &Stated| terms.iter().any(|(node, ..)| bare.contains(node));
            let (moved, rest): (Vec<Stated>, Vec<Stated>) = pairs.into_iter().partition(has_bare);
            pairs = rest;
            if moved.is_empty() {
                break;
            }
            others.extend(moved);
        }
        self.find_equal(pairs);
        for (line, terms) in others {
            let mut one = row(line);
            for (node, c, factor) in terms {
                if !self.used[node as usize] {
                    *one.bare.entry((node, c)).or_default() += factor;
                    continue;
                }
                let way = match transforms.get(&node) {
                    None => std::array::from_fn(|axis| f64::from(u8::from(axis == c))),
                    Some(&number) => {
                        let ways = self.said.transforms[number].ways(self.index.place(node));
                        if !ways[c].iter().all(|part| part.is_finite()) {
                            let text = "*EQUATION: a node on the axis of its *TRANSFORM has no direction across it";
                            return Err((line, text.to_owned()));
                        }
                        std::array::from_fn(|axis| ways[c][axis])
                    }
                };
                one.add(node, way.map(|part| factor * part));
            }
            rows.push(one);
        }
        self.rows = rows;
        Ok(())
    }

    /// Groups of displacements along an axis that are equal.
    fn find_equal(&mut self, pairs: Vec<Stated>) {
        // The groups so far, and which one a displacement is in.
        let mut groups: Vec<(usize, Vec<(usize, u32)>)> = Vec::new();
        for (line, terms) in pairs {
            let ends = [0, 1].map(|i| (terms[i].1, terms[i].0));
            let [a, b] = ends.map(|end| {
                *self.equal_of.entry(end).or_insert_with(|| {
                    groups.push((line, vec![end]));
                    groups.len() - 1
                })
            });
            if a != b {
                let moved = std::mem::take(&mut groups[a.max(b)].1);
                for &end in &moved {
                    self.equal_of.insert(end, a.min(b));
                }
                groups[a.min(b)].1.extend(moved);
            }
        }
        self.equal = (groups.into_iter())
            .map(|(line, ends)| {
                let of_bodies = ends.iter().map(|end| end.1);
                let mut nodes: Vec<u32> =
                    of_bodies.filter(|&node| self.used[node as usize]).collect();
                nodes.sort_unstable();
                Alike {
                    line,
                    component: ends.first().map_or(0, |end| end.0),
                    nodes,
                    held: false,
                }
            })
            .collect();
    }

    /// Reference nodes of constraints are in no equation; all other nodes without elements are reference nodes of equations.
    pub(super) fn find_points_of_equations(&mut self) {
        let alike =
            (self.equal_of.iter()).map(|(&(_, node), &group)| (self.equal[group].line, node));
        let of_rows = self.rows.iter();
        let of_rows = of_rows.flat_map(|row| row.bare.keys().map(|which| (row.line, which.0)));
        let of_rows: Vec<(usize, u32)> = of_rows.collect();
        let all = alike.chain(of_rows.iter().copied());
        let of_others: BTreeSet<usize> = all
            .filter(|(_, node)| self.points.contains_key(node))
            .map(|(line, _)| line)
            .collect();
        for line in of_others {
            let text = "*EQUATION: a reference node cannot depend on other nodes";
            self.refuse(line, "EQUATION", text);
        }
        for (_, node) in of_rows {
            self.points.entry(node).or_insert(0);
        }
    }

    /// The equations of a `*MPC`, linear in the displacements of its nodes.
    fn multi_point(&self, card: &MpcCard) -> Result<Vec<Terms<D>>> {
        let (line, name) = (card.line, card.name);
        let mut nodes: Vec<u32> = Vec::new();
        for target in &card.nodes {
            for node in self.index.nodes(line, *target)? {
                if !nodes.contains(&node) {
                    nodes.push(node);
                }
            }
        }
        let wrong = |text: &str| Err((line, format!("*MPC, {name}: {text}")));
        let defining = match card.kind {
            MpcKind::Link if nodes.len() != 2 => return wrong("it has two nodes"),
            MpcKind::Link => {
                let [a, b] = [nodes[0], nodes[1]];
                let way = unit(minus(self.index.place(a), self.index.place(b)));
                if !way[0].is_finite() {
                    return wrong("both nodes are in one place");
                }
                let way: [f64; D] = std::array::from_fn(|c| way[c]);
                return Ok(vec![vec![(a, way), (b, way.map(|part| -part))]]);
            }
            MpcKind::Straight => 2,
            MpcKind::Plane if D == 2 => {
                return wrong("in the plane nodes stay on a line: STRAIGHT");
            }
            MpcKind::Plane => 3,
        };
        if nodes.len() < defining {
            return wrong(&format!("it has at least {defining} nodes"));
        }
        // The first one and those farthest from it define the line or plane; with small displacements any do.
        let place = |node: u32| self.index.place(node);
        let from = place(nodes[0]);
        for i in 1..defining {
            let edge = minus(place(nodes[1]), from);
            let size = |node: u32| match (i, minus(place(node), from)) {
                (1, way) => length(way),
                (_, way) => length(cross(edge, way)),
            };
            let farthest =
                (i..nodes.len()).max_by(|&a, &b| size(nodes[a]).total_cmp(&size(nodes[b])));
            nodes.swap(i, farthest.unwrap_or(i));
        }
        let (base, rest) = nodes.split_at(defining);
        let origin = self.index.place(base[0]);
        let edges: Vec<[f64; 3]> = (base[1..].iter())
            .map(|&node| minus(self.index.place(node), origin))
            .collect();
        let normals: Vec<[f64; 3]> = match edges[..] {
            [a, b] => match cross(a, b) {
                // As long as rounding leaves of points on a line.
                normal if length(normal) < OFF * length(a) * length(a) => vec![[f64::NAN; 3]],
                normal => vec![unit(normal)],
            },
            _ => {
                let e = unit(edges[0]);
                let least = (0..3).min_by(|&i, &j| e[i].abs().total_cmp(&e[j].abs()));
                let across = if D == 2 { 2 } else { least.unwrap_or(0) };
                let first = unit(cross(e, IDENTITY[across]));
                vec![first, cross(e, first)]
            }
        };
        if !normals[0].iter().all(|part| part.is_finite()) {
            return wrong("its nodes define nothing: they are in one place, or on one line");
        }
        let mut all = Vec::new();
        for &node in rest {
            let way = minus(self.index.place(node), origin);
            // The node is the origin and these parts of the edges.
            let parts: Vec<f64> = match edges[..] {
                [a, b] => {
                    let area = cross(a, b);
                    let part = |u, v| dot(cross(u, v), area) / dot(area, area);
                    vec![part(way, b), part(a, way)]
                }
                _ => vec![dot(way, edges[0]) / dot(edges[0], edges[0])],
            };
            let off = normals.iter().map(|normal| dot(way, *normal).abs());
            if off.fold(0.0, f64::max) > OFF * length(way).max(length(edges[0])) {
                let number = self.index.node_numbers()[node as usize];
                return wrong(&format!("node {number} is beside the others"));
            }
            for normal in &normals {
                let normal: [f64; D] = std::array::from_fn(|c| normal[c]);
                if normal == [0.0; D] {
                    continue;
                }
                let first = std::iter::once(1.0 - parts.iter().sum::<f64>());
                let of_base = base.iter().zip(first.chain(parts.iter().copied()));
                let of_base = of_base.map(|(&base, part)| (base, normal.map(|n| -part * n)));
                all.push(std::iter::once((node, normal)).chain(of_base).collect());
            }
        }
        Ok(all)
    }

    /// The nodes that move alike, where no support prescribes the motion: a table for each choice of axes.
    pub(super) fn put_equal(&mut self) {
        let mut axes: BTreeMap<Vec<u32>, (usize, BTreeSet<usize>)> = BTreeMap::new();
        for one in std::mem::take(&mut self.equal) {
            if one.nodes.len() > 1 && !one.held {
                let here = axes.entry(one.nodes).or_insert((one.line, BTreeSet::new()));
                here.0 = here.0.min(one.line);
                here.1.insert(one.component);
            }
        }
        let mut tables: BTreeMap<BTreeSet<usize>, (usize, Vec<Vec<u32>>)> = BTreeMap::new();
        for (nodes, (line, axes)) in axes {
            let here = tables.entry(axes).or_insert((line, Vec::new()));
            here.0 = here.0.min(line);
            here.1.push(nodes);
        }
        for (axes, (line, sets)) in tables {
            let names: Vec<String> = (sets.into_iter())
                .map(|nodes| {
                    let name = self.name("equal");
                    self.index.add_nodes(&name, &nodes);
                    name
                })
                .collect();
            self.comes_from(line, "equal");
            let bound = std::array::from_fn(|axis| axes.contains(&axis));
            self.definition.equals.push(Equal::of(names).along(bound));
        }
    }

    /// All other equations: without displacements of nodes that no element has, and as few tables as possible.
    pub(super) fn put_equations(&mut self) -> Result<()> {
        let mut rows = std::mem::take(&mut self.rows);
        let mut names = BTreeMap::new();
        self.eliminate(&mut rows, &mut names)?;
        // Those with the same factors and values may be in one table.
        let mut alike: BTreeMap<Vec<u64>, Vec<Row<D>>> = BTreeMap::new();
        for mut row in rows {
            let most = row.terms.iter().flat_map(|term| term.1);
            let most = most.fold(0.0, |most: f64, part| most.max(part.abs()));
            for (_, way) in &mut row.terms {
                let is_left = |part: f64| part.abs() > ROUNDING * most;
                *way = way.map(|part| if is_left(part) { part } else { 0.0 });
            }
            row.terms.retain(|term| term.1 != [0.0; D]);
            if row.terms.is_empty() {
                if row.value.iter().any(|&value| value != 0.0) {
                    let text = "*EQUATION: nothing is left of it that the bodies could do: it contradicts others, or the supports of its nodes";
                    return Err((row.line, text.to_owned()));
                }
                continue;
            }
            let parts = row.terms.iter().flat_map(|term| &term.1).chain(&row.value);
            let key = parts.map(|part| part.to_bits()).collect();
            alike.entry(key).or_default().push(row);
        }
        let mut tables: Vec<Vec<Row<D>>> = Vec::new();
        for mut rows in alike.into_values() {
            let nodes = |row: &Row<D>| row.terms.iter().map(|term| term.0).collect::<Vec<u32>>();
            rows.sort_by_key(nodes);
            let begin = tables.len();
            for row in rows {
                // The node of a term is the same in all equations of a table, or rises.
                let goes_on = |table: &&mut Vec<Row<D>>| {
                    let node = |i: usize, k: usize| table[i].terms[k].0;
                    let last = table.len() - 1;
                    row.terms.iter().enumerate().all(|(k, term)| match last {
                        0 => term.0 >= node(0, k),
                        _ if node(0, k) == node(1, k) => term.0 == node(0, k),
                        _ => term.0 > node(last, k),
                    })
                };
                match tables[begin..].iter_mut().find(goes_on) {
                    Some(table) => table.push(row),
                    None => tables.push(vec![row]),
                }
            }
        }
        tables.sort_by_key(|table| table[0].line);
        for table in tables {
            let first = &table[0];
            let (value, history) = factors(&first.value);
            let mut equation = Equation::of(value);
            for (k, &(_, way)) in first.terms.iter().enumerate() {
                let mut nodes: Vec<u32> = table.iter().map(|row| row.terms[k].0).collect();
                nodes.dedup();
                let name = self.set_named(&mut names, nodes);
                equation = equation.nodes(name, way);
            }
            self.comes_from(first.line, "equation");
            let equation = with_factors(equation, history, Equation::factors);
            self.definition.equations.push(equation);
        }
        Ok(())
    }

    /// The set with these nodes, one of those that have `names`.
    fn set_named(&mut self, names: &mut SetNames, nodes: Vec<u32>) -> String {
        if let Some(name) = names.get(&nodes) {
            return name.clone();
        }
        let name = self.name(if nodes.len() == 1 { "node" } else { "nodes" });
        self.index.add_nodes(&name, &nodes);
        names.insert(nodes, name.clone());
        name
    }

    /// Takes the displacements of nodes without elements out of the equations: those that are prescribed are values; each other one
    /// follows from one equation, and its force acts on what it follows.
    fn eliminate(&mut self, rows: &mut Vec<Row<D>>, names: &mut SetNames) -> Result<()> {
        let unknown: BTreeSet<(u32, usize)> = rows
            .iter()
            .flat_map(|row| row.bare.keys())
            .copied()
            .collect();
        let mut loads: BTreeMap<(u32, usize), (usize, Vec<f64>)> = BTreeMap::new();
        let nodes: BTreeSet<u32> = unknown.iter().map(|which| which.0).collect();
        let mut left = unknown;
        let loose = "*CLOAD: no body follows this node in this direction, or a *BOUNDARY holds it";
        for node in nodes {
            let (given, fixed) = self.given(&BTreeMap::from([(node, 0)]))?;
            self.refuse_fixed(fixed);
            for Given {
                component,
                values,
                is_motion,
                line,
            } in given
            {
                let which = (node, component);
                match is_motion {
                    true if left.remove(&which) => {
                        for row in rows.iter_mut() {
                            let part = row.bare.remove(&which).unwrap_or(0.0);
                            let all = row.value.iter_mut().zip(&values);
                            all.for_each(|(value, u)| *value -= part * u);
                        }
                    }
                    true => {}
                    false if left.contains(&which) => {
                        loads.insert(which, (line, values));
                    }
                    false => self.refuse(line, "CLOAD", loose),
                }
            }
        }
        while let Some(which) = left.pop_first() {
            let load = loads.remove(&which);
            let size = |row: &Row<D>| row.bare.get(&which).map_or(0.0, |part| part.abs());
            let sizes = rows
                .iter()
                .map(size)
                .enumerate()
                .filter(|(_, size)| *size > 0.0);
            // The first of equally large ones.
            let largest = sizes.reduce(|best, next| if next.1 > best.1 { next } else { best });
            let Some((best, _)) = largest else {
                if let Some((line, _)) = load {
                    self.refuse(line, "CLOAD", loose);
                }
                continue;
            };
            let mut known = rows.remove(best);
            let part = known.bare.remove(&which).unwrap_or(1.0);
            for row in rows.iter_mut() {
                if let Some(own) = row.bare.remove(&which) {
                    row.plus(-own / part, &known);
                }
            }
            // The work of its force is that of forces on what it follows.
            let Some((line, load)) = load else {
                continue;
            };
            let shared = |factor: f64| load.iter().map(move |f| -factor / part * f);
            for (&other, &factor) in &known.bare {
                let none = || (line, vec![0.0; load.len()]);
                let (_, sum) = loads.entry(other).or_insert_with(none);
                sum.iter_mut()
                    .zip(shared(factor))
                    .for_each(|(sum, f)| *sum += f);
            }
            let (size, history) = factors(&load);
            for (node, way) in known.terms {
                let name = self.set_named(names, vec![node]);
                let parts = way.into_iter().enumerate();
                let force = parts.fold(Force::at_nodes(name), |force, (axis, factor)| {
                    force.along(axis, -factor / part * size)
                });
                self.comes_from(known.line, "force");
                let force = with_factors(force, history.clone(), Force::factors);
                self.definition.forces.push(force);
            }
        }
        Ok(())
    }
}
