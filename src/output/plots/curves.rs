//! The charts of a solve: fields along a contact, convergence, forces over the steps.

use super::bodies::Bodies;
use super::chart::{Axis, Chart, Mark, Series, Zone, colour};
use super::legend::{State, state};
use crate::mesh::edge_parts;
use crate::mesh::vector::{bounds, length, minus};
use crate::model::Elastic;
use crate::output::{ContactFields, ContactReport, Report, StepReport};
use std::collections::{HashMap, HashSet};

/// The fields along a line of a contact.
#[derive(Default)]
pub(super) struct Line {
    /// Places with pressure, tangential traction and slip bound; NaN between parts.
    pub points: Vec<(f64, [f64; 3])>,
    pub zones: Vec<Zone>,
}

impl Line {
    /// Interrupts the line.
    pub fn interrupt(&mut self) {
        self.points.push((f64::NAN, [f64::NAN; 3]));
    }

    /// Adds a zone, or extends the last one if that ends here up to rounding.
    pub fn zone(&mut self, [from, to]: [f64; 2], rounding: f64, (_, name, colour, _): State) {
        match self.zones.last_mut() {
            Some(zone) if zone.name == name && (from - zone.to).abs() <= rounding => zone.to = to,
            _ => self.zones.push(Zone {
                from,
                to,
                name,
                colour,
            }),
        }
    }

    /// Its chart. Tractions have a direction in the plane, in space a size.
    pub fn chart(self, title: String, x: Axis, stress: &str, friction: bool, plane: bool) -> Chart {
        let series = |name, colour, mark, part: usize, sign: f64| {
            let points = self.points.iter().map(|(s, v)| (*s, sign * v[part]));
            Series::new(name, colour, mark, points.collect())
        };
        let bound = |name, sign| series(name, colour::GREY, Mark::Dashed, 2, sign);
        let mut all = Vec::new();
        if friction {
            let name = if plane { "± slip bound" } else { "slip bound" };
            all.push(bound(name, 1.0));
            if plane {
                all.push(bound("", -1.0));
            }
            let name = "tangential traction";
            all.push(series(name, colour::ORANGE, Mark::Line, 1, 1.0));
        }
        let name = "contact pressure";
        all.push(series(name, colour::BLUE, Mark::Line, 0, 1.0));
        Chart {
            title,
            x,
            y: Axis::new("contact stress", stress),
            series: all,
            zones: self.zones,
            rules: Vec::new(),
        }
    }
}

/// Contact stresses against the place on the boundary of a contact, with its zones.
pub(super) fn contact(title: &str, bodies: &Bodies, pair: usize) -> Chart {
    let (elastic, fields) = (bodies.elastic, bodies.contact);
    let (label, parts) = along(elastic, pair);
    let parts = zoomed(parts, fields);
    let mut line = Line::default();
    let values = |i: usize| [fields.pressure[i], fields.traction[i], fields.bound[i]];
    for part in &parts {
        line.points
            .extend(part.iter().map(|&(s, i)| (s, values(i))));
        line.interrupt();
        // Zones go from midpoint to midpoint.
        for (k, &(s, i)) in part.iter().enumerate() {
            let from = if k == 0 { s } else { 0.5 * (part[k - 1].0 + s) };
            let to = part.get(k + 1).map_or(s, |next| 0.5 * (s + next.0));
            line.zone([from, to], 0.0, state(fields, i));
        }
    }
    let friction = parts.iter().flatten().any(|&(_, i)| fields.bound[i] > 0.0);
    let x = Axis::new(label, &elastic.units.length);
    line.chart(title.to_owned(), x, &elastic.units.stress(), friction, true)
}

/// Interrupts a line.
const GAP: (f64, f64) = (f64::NAN, f64::NAN);

/// Contact places with their positions along the boundary, for each of its parts.
type Places = Vec<Vec<(f64, usize)>>;

/// The places of a contact in the order of its boundary, with a coordinate where the boundary goes along an
/// axis, else with the distance along it.
fn along(elastic: &Elastic, pair: usize) -> (&'static str, Places) {
    let edges: Vec<[u32; 2]> = (elastic.pairs[pair].facets.iter())
        .flat_map(edge_parts)
        .collect();
    let node = |node: u32| elastic.mesh.nodes[node as usize];
    let axis = direction(&edges, node);
    let label = match axis {
        Some(0) => "x",
        Some(_) => "y",
        None => "distance along the boundary",
    };
    let next: HashMap<u32, u32> = edges.iter().map(|e| (e[0], e[1])).collect();
    let long = |a: u32| {
        next.get(&a)
            .map_or(0.0, |&b| length(minus(node(b), node(a))))
    };
    // The chain of a node, and its position along it.
    let mut begin: HashMap<u32, (usize, f64)> = HashMap::new();
    for (number, chain) in chains(&edges).into_iter().enumerate() {
        let mut s = 0.0;
        for here in chain {
            begin.insert(here, (number, s));
            s += long(here);
        }
    }
    let of_pair = (elastic.contact.places.iter().enumerate())
        .filter(|&(i, _)| elastic.pair_of[i] as usize == pair);
    let mut all: Vec<(usize, f64, usize)> = of_pair
        .filter_map(|(i, here)| {
            if let Some(c) = axis {
                return Some((0, here.place[c], i));
            }
            let most = here.own.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
            let mut at = *begin.get(&here.node_of(most.0))?;
            if let (None, &[(a, _), (b, part)]) = (here.node, &here.own[..]) {
                // On the edge between two nodes, whichever is the first of them.
                for (from, to, part) in [(a, b, part), (b, a, 1.0 - part)] {
                    if next.get(&from) == Some(&to) {
                        let (chain, s) = begin[&from];
                        at = (chain, s + part * long(from));
                    }
                }
            }
            Some((at.0, at.1, i))
        })
        .collect();
    all.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let parts = all.chunk_by(|a, b| a.0 == b.0);
    let parts = parts.map(|part| part.iter().map(|&(_, s, i)| (s, i)).collect());
    (label, parts.collect())
}

/// The axis that edges go along without turning back, the one they go farther along if there are two.
fn direction(edges: &[[u32; 2]], place: impl Fn(u32) -> [f64; 2]) -> Option<usize> {
    let step = |&[a, b]: &[u32; 2]| minus(place(b), place(a));
    let steps: Vec<[f64; 2]> = edges.iter().map(step).collect();
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

/// The part in contact with its surroundings, if that is small.
fn zoomed(mut parts: Places, fields: &ContactFields) -> Places {
    let span = |least: f64| {
        let all = parts.iter().flatten();
        let pressed = all.filter(|place| fields.pressure[place.1] > least);
        bounds(pressed.map(|place| [place.0]))
    };
    let (([low], [high]), ([from], [to])) = (span(f64::NEG_INFINITY), span(0.0));
    let width = to - from;
    if width > 0.0 && width < 0.4 * (high - low) {
        let shown = from - 0.3 * width..=to + 0.3 * width;
        let each = parts.iter_mut();
        each.for_each(|part| part.retain(|(s, _)| shown.contains(s)));
    }
    parts
}

/// The error over the products with A, load steps and solves marked.
pub(super) fn convergence(report: &Report) -> Chart {
    let mut rules = Vec::new();
    let (mut newton, mut before) = (Vec::new(), 0);
    let mut last: Option<(usize, usize)> = None;
    let mut products = 0;
    for row in &report.history {
        let now = (row.load_step, row.round);
        if last.is_some_and(|last| last != now) {
            before += products;
            rules.push(before as f64);
            newton.push(GAP);
        }
        last = Some(now);
        products = row.step.n_a;
        newton.push(((before + products) as f64, row.step.err));
    }
    let name = "error, relative to the first";
    let series = vec![Series::new(name, colour::BLUE, Mark::LineAndDots, newton)];
    Chart {
        title: "Convergence".to_owned(),
        x: Axis::new("products with A", ""),
        y: Axis::logarithmic("relative size", ""),
        series,
        zones: Vec::new(),
        rules,
    }
}

const COLOURS: [&str; 4] = [colour::BLUE, colour::ORANGE, colour::GREEN, colour::PURPLE];

/// The largest depth that wear has taken off each contact over the cycles; None of a run without cycles or wear.
pub(super) fn wear(report: &Report) -> Option<Chart> {
    let last = report.steps.last().filter(|step| step.cycle.is_some())?;
    let worn = |contact: &&ContactReport| contact.wear_depth.is_some();
    let contacts: Vec<&ContactReport> = last.contacts.iter().filter(worn).collect();
    let depth = |name: String| {
        let of_step = move |step: &StepReport| {
            let contact = step.contacts.iter().find(|contact| contact.title() == name);
            (
                step.cycle.unwrap_or(1) as f64,
                contact
                    .and_then(|contact| contact.wear_depth)
                    .unwrap_or(0.0),
            )
        };
        // The end of each cycle.
        let mut points: Vec<(f64, f64)> = report.steps.iter().map(of_step).collect();
        points.reverse();
        points.dedup_by_key(|point| point.0);
        points.reverse();
        points
    };
    let series = contacts.iter().zip(COLOURS).map(|(contact, colour)| {
        Series::new(
            &contact.title(),
            colour,
            Mark::LineAndDots,
            depth(contact.title()),
        )
    });
    (!contacts.is_empty()).then(|| Chart {
        title: "Wear over the cycles".to_owned(),
        x: Axis::new("cycle", ""),
        y: Axis::new("largest depth", &report.units.length),
        series: series.collect(),
        zones: Vec::new(),
        rules: Vec::new(),
    })
}

/// The forces of the contacts over the load steps.
pub(super) fn steps(report: &Report) -> Chart {
    let contacts = report.steps.first().map_or(0, |step| step.contacts.len());
    let mut series = Vec::new();
    for c in 0..contacts.min(COLOURS.len()) {
        let over = |value: &dyn Fn(&ContactReport) -> f64| -> Vec<(f64, f64)> {
            (report.steps.iter().enumerate())
                .map(|(i, step)| ((i + 1) as f64, value(&step.contacts[c])))
                .collect()
        };
        let contact = &report.steps[0].contacts[c];
        let name = contact.name.as_ref().unwrap_or(&contact.boundary);
        let (normal, tangential) = (format!("{name}, normal"), format!("{name}, tangential"));
        let forces = over(&|contact| contact.normal_force);
        series.push(Series::new(&normal, COLOURS[c], Mark::LineAndDots, forces));
        let forces = over(&|contact| contact.tangential_force);
        series.push(Series::new(&tangential, COLOURS[c], Mark::Dashed, forces));
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
