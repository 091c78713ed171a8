//! The charts of a solve: what happens along a contact, how it converged, how forces go with the steps.

use super::chart::{Axis, Chart, Mark, Series, Zone, colour};
use crate::model::Elastic;
use crate::output::{ContactFields, ContactReport, NodeStatus, Report};
use std::collections::{HashMap, HashSet};

/// Contact stresses against the place on the boundary of a contact, with its zones.
pub(super) fn contact(elastic: &Elastic, fields: &ContactFields, pair: usize) -> Chart {
    let (label, nodes) = along(elastic, pair);
    let nodes = zoomed(nodes, fields);
    let series = |name: &str, colour, mark, value: &dyn Fn(usize) -> f64| Series {
        name: name.to_owned(),
        colour,
        mark,
        points: (nodes.iter())
            .map(|node| node.map_or(GAP, |(s, i)| (s, value(i))))
            .collect(),
    };
    let (bound, traction) = (|i: usize| fields.bound[i], |i: usize| fields.traction[i]);
    let mut all = Vec::new();
    if nodes.iter().flatten().any(|&(_, i)| bound(i) > 0.0) {
        all.extend([
            series("± slip bound", colour::GREY, Mark::Dashed, &bound),
            series("", colour::GREY, Mark::Dashed, &|i| -bound(i)),
            series("tangential traction", colour::ORANGE, Mark::Line, &traction),
        ]);
    }
    let pressure = |i: usize| fields.pressure[i];
    all.push(series(
        "contact pressure",
        colour::BLUE,
        Mark::Line,
        &pressure,
    ));
    let pair = &elastic.pairs[pair];
    Chart {
        title: format!("{} / {}", pair.boundary, pair.against),
        x: Axis::new(label, &elastic.units.length),
        y: Axis::new("contact stress", &elastic.units.stress()),
        series: all,
        zones: zones(&nodes, fields),
        rules: Vec::new(),
    }
}

/// Interrupts a line.
const GAP: (f64, f64) = (f64::NAN, f64::NAN);

/// A contact place, and where it lies along the boundary; None between parts of the boundary.
type Places = Vec<Option<(f64, usize)>>;

/// The places of a contact in the order of its boundary, with a coordinate where the boundary goes along an
/// axis, else with the distance along it.
fn along(elastic: &Elastic, pair: usize) -> (&'static str, Places) {
    let edges = &elastic.pairs[pair].facets;
    let place = |node: u32| elastic.mesh.nodes[node as usize];
    let axis = direction(edges, place);
    // The places at each node, and those on the edge between two, with the part of it from the first.
    let mut at_node: HashMap<u32, Vec<usize>> = HashMap::new();
    let mut on_edge: HashMap<[u32; 2], Vec<(f64, usize)>> = HashMap::new();
    for (i, here) in elastic.contact.places.iter().enumerate() {
        if elastic.pair_of[i] as usize != pair {
            continue;
        }
        match (here.node, &here.own[..]) {
            (None, &[(a, _), (b, part)]) => {
                on_edge.entry([a, b]).or_default().push((part, i));
                on_edge.entry([b, a]).or_default().push((1.0 - part, i));
            }
            _ => {
                let most = here.own.iter().max_by(|a, b| a.1.total_cmp(&b.1));
                if let Some(&(node, _)) = most {
                    at_node.entry(node).or_default().push(i);
                }
            }
        }
    }
    let mut places: Places = Vec::new();
    let mut s = 0.0;
    for chain in chains(edges) {
        places.push(None);
        let mut add = |s: f64, i: usize| {
            places.push(Some((
                axis.map_or(s, |c| elastic.contact.places[i].place[c]),
                i,
            )));
        };
        let next = chain.iter().skip(1).copied().map(Some).chain([None]);
        for (&node, next) in chain.iter().zip(next) {
            at_node
                .get(&node)
                .into_iter()
                .flatten()
                .for_each(|&i| add(s, i));
            // A closed chain ends with the edge to its first node.
            let next = next.unwrap_or(chain[0]);
            let (p, q) = (place(node), place(next));
            let length = (q[0] - p[0]).hypot(q[1] - p[1]);
            let mut between = on_edge.get(&[node, next]).cloned().unwrap_or_default();
            between.sort_by(|a, b| a.0.total_cmp(&b.0));
            between
                .into_iter()
                .for_each(|(part, i)| add(s + part * length, i));
            s += length;
        }
    }
    if axis.is_some() {
        places.retain(Option::is_some);
        places.sort_by(|a, b| {
            let (a, b) = (a.map_or(0.0, |p| p.0), b.map_or(0.0, |p| p.0));
            a.total_cmp(&b)
        });
    }
    let label = match axis {
        Some(0) => "x",
        Some(_) => "y",
        None => "distance along the boundary",
    };
    (label, places)
}

/// The axis that edges go along without turning back, the one they go farther along if there are two.
fn direction(edges: &[[u32; 2]], place: impl Fn(u32) -> [f64; 2]) -> Option<usize> {
    let steps: Vec<[f64; 2]> = (edges.iter())
        .map(|&[a, b]| [place(b)[0] - place(a)[0], place(b)[1] - place(a)[1]])
        .collect();
    let monotone = |c: usize| steps.iter().all(|d| d[c] > 0.0) || steps.iter().all(|d| d[c] < 0.0);
    let extent = |c: usize| steps.iter().map(|d| d[c]).sum::<f64>().abs();
    match (monotone(0), monotone(1)) {
        (true, true) => Some(usize::from(extent(0) < extent(1))),
        (true, false) => Some(0),
        (false, true) => Some(1),
        (false, false) => None,
    }
}

/// The nodes of edges, connected ones after each other. Chains begin where no edge ends; closed ones anywhere.
fn chains(edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let next: HashMap<u32, u32> = edges.iter().map(|e| (e[0], e[1])).collect();
    let ends: HashSet<u32> = edges.iter().map(|e| e[1]).collect();
    let starts = edges.iter().map(|e| e[0]);
    let open = starts.clone().filter(|node| !ends.contains(node));
    let mut seen = HashSet::new();
    let mut chains = Vec::new();
    for start in open.chain(starts) {
        let mut chain = Vec::new();
        let mut node = Some(start);
        while let Some(here) = node.filter(|&node| seen.insert(node)) {
            chain.push(here);
            node = next.get(&here).copied();
        }
        if !chain.is_empty() {
            chains.push(chain);
        }
    }
    chains
}

/// The part in contact and what is around it, where that is small.
fn zoomed(nodes: Places, fields: &ContactFields) -> Places {
    let span = |all: &mut dyn Iterator<Item = f64>| {
        all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), s| {
            (a.min(s), b.max(s))
        })
    };
    let (low, high) = span(&mut nodes.iter().flatten().map(|n| n.0));
    let (from, to) = span(
        &mut nodes
            .iter()
            .flatten()
            .filter(|n| fields.pressure[n.1] > 0.0)
            .map(|n| n.0),
    );
    let width = to - from;
    if !(width > 0.0 && width < 0.4 * (high - low)) {
        return nodes;
    }
    let (from, to) = (from - 0.3 * width, to + 0.3 * width);
    nodes
        .into_iter()
        .filter(|node| node.is_none_or(|(s, _)| (from..=to).contains(&s)))
        .collect()
}

/// Stretches of nodes in one state, from midpoint to midpoint.
fn zones(nodes: &Places, fields: &ContactFields) -> Vec<Zone> {
    let mut zones: Vec<Zone> = Vec::new();
    let state = |i: usize| match fields.status(i) {
        NodeStatus::Separated => ("separated", colour::SEPARATED),
        NodeStatus::Frictionless => ("in contact", colour::STICK),
        NodeStatus::Stick => ("stick", colour::STICK),
        NodeStatus::Slip => ("slip", colour::SLIP),
    };
    for part in nodes.split(Option::is_none) {
        let part: Vec<(f64, usize)> = part.iter().flatten().copied().collect();
        for (k, &(s, i)) in part.iter().enumerate() {
            let from = if k == 0 { s } else { 0.5 * (part[k - 1].0 + s) };
            let to = part.get(k + 1).map_or(s, |next| 0.5 * (s + next.0));
            let (name, colour) = state(i);
            match zones.last_mut() {
                Some(zone) if zone.name == name && zone.to == from => zone.to = to,
                _ => zones.push(Zone {
                    from,
                    to,
                    name,
                    colour,
                }),
            }
        }
    }
    zones
}

/// The error over the products with A, load steps and rounds with frozen slip bounds marked.
pub(super) fn convergence(report: &Report) -> Chart {
    let mut rules = Vec::new();
    let (mut newton, mut frozen, mut before) = (Vec::new(), Vec::new(), 0);
    let mut last: Option<(usize, usize)> = None;
    let mut products = 0;
    for row in &report.history {
        let now = (row.load_step, row.round);
        if last.is_some_and(|last| last != now) {
            before += products;
            rules.push(before as f64);
            newton.push(GAP);
            frozen.push(GAP);
        }
        last = Some(now);
        products = row.step.n_a;
        let curve = if row.frozen { &mut frozen } else { &mut newton };
        curve.push(((before + products) as f64, row.step.err));
    }
    let mut series = vec![Series {
        name: "error, relative to the first".to_owned(),
        colour: colour::BLUE,
        mark: Mark::LineAndDots,
        points: newton,
    }];
    if !report.friction_history.is_empty() {
        series.push(Series {
            name: "error of rounds with frozen slip bounds".to_owned(),
            colour: colour::GREEN,
            mark: Mark::LineAndDots,
            points: frozen,
        });
        series.push(Series {
            name: "change of the slip bounds after a round".to_owned(),
            colour: colour::ORANGE,
            mark: Mark::LineAndDots,
            points: report.friction_history.clone(),
        });
    }
    Chart {
        title: "Convergence".to_owned(),
        x: Axis::new("products with A", ""),
        y: Axis::logarithmic("relative size", ""),
        series,
        zones: Vec::new(),
        rules,
    }
}

/// The forces of the contacts over the load steps.
pub(super) fn steps(report: &Report) -> Chart {
    const COLOURS: [&str; 4] = [colour::BLUE, colour::ORANGE, colour::GREEN, colour::PURPLE];
    let contacts = report.steps.first().map_or(0, |step| step.contacts.len());
    let mut series = Vec::new();
    for c in 0..contacts.min(COLOURS.len()) {
        let over = |value: &dyn Fn(&ContactReport) -> f64| -> Vec<(f64, f64)> {
            (report.steps.iter().enumerate())
                .map(|(i, step)| ((i + 1) as f64, value(&step.contacts[c])))
                .collect()
        };
        let name = &report.steps[0].contacts[c].boundary;
        series.push(Series {
            name: format!("{name}, normal"),
            colour: COLOURS[c],
            mark: Mark::LineAndDots,
            points: over(&|contact| contact.normal_force),
        });
        series.push(Series {
            name: format!("{name}, tangential"),
            colour: COLOURS[c],
            mark: Mark::Dashed,
            points: over(&|contact| contact.tangential_force),
        });
    }
    Chart {
        title: "Contact forces over the load steps".to_owned(),
        x: Axis::new("load step", ""),
        y: Axis::new("force", &report.units.force),
        series,
        zones: Vec::new(),
        rules: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn chains_begin_where_no_edge_ends() {
        let edges = [[2, 3], [1, 2], [7, 8], [4, 5], [5, 6], [6, 4]];
        assert_eq!(chains(&edges), [vec![1, 2, 3], vec![7, 8], vec![4, 5, 6]]);
        assert!(chains(&[]).is_empty());
    }

    #[test]
    fn boundaries_go_along_an_axis_or_around() {
        let along = |places: &[[f64; 2]]| {
            let edges: Vec<[u32; 2]> = (1..places.len() as u32).map(|k| [k - 1, k]).collect();
            direction(&edges, |node| places[node as usize])
        };
        assert_eq!(along(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.1]]), Some(0));
        assert_eq!(along(&[[0.0, 3.0], [1.0, 1.0], [1.5, 0.0]]), Some(1));
        assert_eq!(along(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), None);
        assert_eq!(along(&[[0.0, 0.0], [1.0, 1.0], [0.0, 2.0]]), Some(1));
    }
}
