//! The charts of a solve: what happens along a contact, how it converged, how forces go with the steps.

use super::chart::{Axis, Chart, Mark, Series, Zone, colour};
use super::{ContactFields, Report};
use crate::case::Elastic;
use std::collections::HashMap;

/// Contact stresses against the place on the boundary of a contact, with its zones.
pub(super) fn contact(elastic: &Elastic, fields: &ContactFields, pair: usize) -> Chart {
    let (label, nodes) = along(elastic, pair);
    let nodes = zoomed(nodes, fields);
    let known = |values: &dyn Fn(usize) -> f64| -> Vec<(f64, f64)> {
        nodes
            .iter()
            .map(|node| node.map_or((f64::NAN, f64::NAN), |(s, i)| (s, values(i))))
            .collect()
    };
    let series = |name: &str, colour, mark, values: &dyn Fn(usize) -> f64| Series {
        name: name.to_owned(),
        colour,
        mark,
        points: known(values),
    };
    let mut all = Vec::new();
    let bounded = nodes.iter().flatten().any(|&(_, i)| fields.bound[i] > 0.0);
    if bounded {
        all.push(series("± slip bound", colour::GREY, Mark::Dashed, &|i| {
            fields.bound[i]
        }));
        all.push(series("", colour::GREY, Mark::Dashed, &|i| {
            -fields.bound[i]
        }));
        all.push(series(
            "tangential traction",
            colour::ORANGE,
            Mark::Line,
            &|i| fields.traction[i],
        ));
    }
    all.push(series("contact pressure", colour::BLUE, Mark::Line, &|i| {
        fields.pressure[i]
    }));
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

/// A contact node at its place along the boundary; None between parts of the boundary.
type Places = Vec<Option<(f64, usize)>>;

/// The nodes of a contact in the order of its boundary, with a coordinate where the boundary goes along an
/// axis, else with the distance along it.
fn along(elastic: &Elastic, pair: usize) -> (&'static str, Places) {
    let mesh = &elastic.mesh;
    let row: HashMap<u32, usize> = elastic
        .contact
        .nodes
        .iter()
        .zip(&elastic.pair_of)
        .enumerate()
        .filter(|(_, (_, owner))| **owner as usize == pair)
        .map(|(i, (node, _))| (node.node, i))
        .collect();
    let edges = &elastic.pairs[pair].edges;
    let next: HashMap<u32, u32> = edges.iter().map(|e| (e[0], e[1])).collect();
    let has_before: std::collections::HashSet<u32> = edges.iter().map(|e| e[1]).collect();
    // Chains begin where no edge ends; closed ones anywhere.
    let mut starts: Vec<u32> = edges
        .iter()
        .map(|e| e[0])
        .filter(|node| !has_before.contains(node))
        .collect();
    starts.extend(edges.iter().map(|e| e[0]));
    let place = |node: u32| mesh.nodes[node as usize];
    let steps: Vec<[f64; 2]> = edges
        .iter()
        .map(|&[a, b]| [place(b)[0] - place(a)[0], place(b)[1] - place(a)[1]])
        .collect();
    let monotone = |c: usize| steps.iter().all(|d| d[c] > 0.0) || steps.iter().all(|d| d[c] < 0.0);
    let extent = |c: usize| steps.iter().map(|d| d[c]).sum::<f64>().abs();
    let axis = match (monotone(0), monotone(1)) {
        (true, _) if extent(0) >= extent(1) || !monotone(1) => Some(0),
        (_, true) => Some(1),
        _ => None,
    };
    let mut seen = std::collections::HashSet::new();
    let mut places: Places = Vec::new();
    let mut s = 0.0;
    for start in starts {
        if seen.contains(&start) {
            continue;
        }
        places.push(None);
        let mut node = start;
        loop {
            if seen.insert(node)
                && let Some(&i) = row.get(&node)
            {
                places.push(Some((axis.map_or(s, |c| place(node)[c]), i)));
            }
            match next.get(&node) {
                Some(&b) if !seen.contains(&b) => {
                    let (p, q) = (place(node), place(b));
                    s += (q[0] - p[0]).hypot(q[1] - p[1]);
                    node = b;
                }
                _ => break,
            }
        }
    }
    if axis.is_some() {
        places.retain(Option::is_some);
        places.sort_by(|a, b| {
            let (a, b) = (a.map_or(0.0, |p| p.0), b.map_or(0.0, |p| p.0));
            a.total_cmp(&b)
        });
    }
    (
        match axis {
            Some(0) => "x",
            Some(_) => "y",
            None => "distance along the boundary",
        },
        places,
    )
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
        "separated" => ("separated", colour::SEPARATED),
        "contact" => ("in contact", colour::STICK),
        "stick" => ("stick", colour::STICK),
        _ => ("slip", colour::SLIP),
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
    const GAP: (f64, f64) = (f64::NAN, f64::NAN);
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
        let over = |value: &dyn Fn(&super::ContactReport) -> f64| -> Vec<(f64, f64)> {
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
