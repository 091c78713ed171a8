//! The contact surfaces of solids: pressures, tractions, zones of stick and slip, and profiles of them.

mod profile;

use super::bodies::Bodies;
use super::chart::{Axis, Scale};
use super::developed::{Developed, developed_parts};
use super::legend::{self, ColourBar, short};
use super::raster::{Raster, largest, mean};
use super::svg::{LINE, Svg, escape, line, patch, places};
use crate::mesh::vector::{bounds, length};
use crate::model::Elastic;
use crate::model::Units;
use crate::output::{ContactFields, NodeStatus, shown_at_nodes};
use profile::profile;
use std::collections::HashMap;

const WIDTH: f64 = 900.0;
const MARGIN: f64 = 26.0;
/// Room left of and below a panel for its axes, and right of the first for the colours.
const AXIS: f64 = 62.0;
const BELOW: f64 = 56.0;
const BAR: f64 = 96.0;
/// The largest a panel gets.
const PANEL: [f64; 2] = [300.0, 330.0];
const WIDE: [f64; 2] = [690.0, 300.0];
/// The longest arrow, and the distance between arrows.
const ARROW: f64 = 26.0;
const APART: f64 = 22.0;
/// Edges of elements are drawn where these are longer than this on average.
const VISIBLE_EDGE: f64 = 7.0;
/// Parts without an opposite side, or held by a support.
const NOTHING: &str = "#d6d6d6";
/// The style of arrows and of the border of the contact.
const ARROWS: &str =
    "stroke=\"#222222\" stroke-width=\"1.1\" stroke-linecap=\"round\" stroke-linejoin=\"round\"";
const BORDER: &str = "stroke=\"#ffffff\" stroke-width=\"1.4\" stroke-linecap=\"round\"";

/// A contact on its way to a picture.
struct Scene<'a> {
    elastic: &'a Elastic<3>,
    contact: &'a ContactFields<3>,
    /// The contact place that a node of the mesh shows.
    rows: HashMap<u32, usize>,
    /// The pressures with the last of the colours, and the largest; the largest tangential traction.
    top: f64,
    largest: f64,
    rubbed: f64,
    has_friction: bool,
    /// Keeps names apart from those of other pictures.
    name: String,
    svg: Svg,
    /// The height drawn so far.
    y: f64,
}

/// The picture of a contact.
pub(super) fn svg(title: &str, bodies: &Bodies<3>, pair: usize) -> String {
    let (elastic, contact) = (bodies.elastic, bodies.contact);
    let rows = shown_at_nodes(elastic, contact, Some(pair));
    let order: Vec<usize> = (0..elastic.pair_of.len())
        .filter(|&i| elastic.pair_of[i] as usize == pair)
        .collect();
    let pressures: Vec<f64> = order.iter().map(|&i| contact.pressure[i]).collect();
    let rubbed = order.iter().map(|&i| along(contact, i));
    let mut scene = Scene {
        elastic,
        contact,
        top: legend::top_pressure(&pressures),
        largest: pressures.iter().copied().fold(0.0, f64::max),
        rubbed: rubbed.fold(0.0, f64::max),
        has_friction: (order.iter())
            .any(|&i| contact.bound[i] > 0.0 || contact.status[i] == NodeStatus::Stick),
        rows,
        name: format!("p{pair}t{}", bodies.step),
        svg: Svg::default(),
        y: 44.0,
    };
    let pressure = |node: u32| scene.rows.get(&node).map_or(0.0, |&i| contact.pressure[i]);
    let all = developed_parts(&elastic.mesh, &elastic.pairs[pair].facets, &pressure);
    for (k, developed) in all.iter().enumerate() {
        scene.developed(developed, k);
    }
    scene.legend();
    let peaks = all
        .iter()
        .map(|developed| (scene.peak(developed).0, developed));
    // The first of those with the largest.
    let highest = peaks.rev().max_by(|a, b| a.0.total_cmp(&b.0));
    if let Some((_, developed)) = highest.filter(|(peak, _)| *peak > 0.0) {
        scene.profiles(developed);
    }
    let mut svg = Svg::new(title, [WIDTH, scene.y + 12.0], MARGIN);
    svg.text += &scene.svg.text;
    svg.finish()
}

/// The tangential traction of a contact node.
fn along(contact: &ContactFields<3>, i: usize) -> f64 {
    let [_, rubbed] = contact.traction_vectors(i);
    length(rubbed)
}

/// A part of a developed surface on its way to a panel.
struct Panel {
    low: [f64; 2],
    unit: f64,
    size: [f64; 2],
    /// The left upper corner in the picture.
    at: [f64; 2],
}

impl Panel {
    /// A place in the panel, in units of the picture from its left upper corner.
    fn place(&self, x: [f64; 2]) -> [f64; 2] {
        [
            self.unit * (x[0] - self.low[0]),
            self.size[1] - self.unit * (x[1] - self.low[1]),
        ]
    }
}

impl Scene<'_> {
    /// Whether the contact node at a node of the mesh touches the other side: the others may have a pressure of rounding.
    fn pressed(&self, node: u32) -> bool {
        let row = self.rows.get(&node);
        row.is_some_and(|&i| self.contact.status[i] != NodeStatus::Separated)
    }

    /// The largest pressure of a developed surface, and its place.
    fn peak(&self, developed: &Developed) -> (f64, [f64; 2]) {
        let all = developed.triangles.iter();
        let corners = all.flat_map(|(at, nodes)| at.iter().zip(nodes));
        corners.fold((0.0, [0.0; 2]), |best, (x, node)| {
            let row = self.rows.get(node);
            let pressure = row.map_or(0.0, |&i| self.contact.pressure[i]);
            if pressure > best.0 {
                (pressure, *x)
            } else {
                best
            }
        })
    }

    /// The visible range of a developed surface: all of it, or the part in contact with its surroundings, if that is
    /// small.
    fn range(&self, developed: &Developed) -> (([f64; 2], [f64; 2]), bool) {
        let all = developed.triangles.iter().flat_map(|(at, _)| *at);
        let (low, high) = bounds(all);
        let pressed = (developed.triangles.iter())
            .filter(|(_, nodes)| nodes.iter().any(|&node| self.pressed(node)))
            .flat_map(|(at, _)| *at);
        let (from, to) = bounds(pressed);
        let size = [0, 1].map(|c| to[c] - from[c]);
        let is_small = (0..2).all(|c| size[c] > 0.0)
            && size[0] * size[1] < 0.16 * (high[0] - low[0]) * (high[1] - low[1]);
        if !is_small {
            return ((low, high), false);
        }
        let around = 0.25 * size[0].max(size[1]);
        let from = [0, 1].map(|c| low[c].max(from[c] - around));
        let to = [0, 1].map(|c| high[c].min(to[c] + around));
        ((from, to), true)
    }

    /// The panels of a developed surface: pressures, and with friction the zones of stick and slip, with the tractions.
    fn developed(&mut self, developed: &Developed, number: usize) {
        let ((low, high), is_zoomed) = self.range(developed);
        let extent = [0, 1].map(|c| (high[c] - low[c]).max(f64::MIN_POSITIVE));
        let is_wide = !self.has_friction || extent[0] > 2.2 * extent[1];
        let room = if is_wide { WIDE } else { PANEL };
        let unit = (room[0] / extent[0]).min(room[1] / extent[1]);
        let size = extent.map(|v| unit * v);
        let mut caption = capitalised(&developed.caption);
        if is_zoomed {
            caption += "; only the part in contact is shown";
        }
        let (y, caption) = (self.y + 12.0, escape(&caption));
        self.svg.put(format_args!(
            "<text x=\"{MARGIN}\" y=\"{y:.1}\" fill=\"#555555\">{caption}</text>"
        ));
        let first = [MARGIN + AXIS, y + 38.0];
        let mut panel = Panel {
            low,
            unit,
            size,
            at: first,
        };
        self.pressures(developed, &panel);
        let bar = [first[0] + size[0] + 18.0, first[1] + 6.0];
        let height = (size[1] - 6.0).clamp(110.0, 240.0);
        let colours = ColourBar {
            name: format!("{}s{number}", self.name),
            unit: &self.elastic.units.stress(),
            top: self.top,
            largest: self.largest,
            height,
        };
        colours.draw(&mut self.svg, bar);
        self.y = first[1] + size[1].max(height + 20.0) + BELOW;
        if !self.has_friction {
            return;
        }
        panel.at = if is_wide {
            [first[0], self.y + 26.0]
        } else {
            [bar[0] + BAR + AXIS, first[1]]
        };
        self.states(developed, &panel);
        if is_wide {
            self.y = panel.at[1] + size[1] + BELOW;
        }
    }

    /// The panel of the pressures, with the border of the contact.
    fn pressures(&mut self, developed: &Developed, panel: &Panel) {
        let mut raster = Raster::new(panel.size);
        let nothing = raster.add(NOTHING);
        for (at, nodes) in &developed.triangles {
            let values = nodes.map(|node| self.rows.get(&node).map(|&i| self.contact.pressure[i]));
            raster.fill(at.map(|x| panel.place(x)), |weights| match values {
                [Some(a), Some(b), Some(c)] => Raster::level(mean(weights, [a, b, c]) / self.top),
                _ => nothing,
            });
        }
        self.open(panel, "contact pressure", &raster);
        self.edges(developed, panel);
        let mut border = String::new();
        for (at, nodes) in &developed.triangles {
            let pressed = nodes.map(|node| self.pressed(node));
            let middles: Vec<[f64; 2]> = [[0, 1], [1, 2], [2, 0]]
                .into_iter()
                .filter(|&[a, b]| pressed[a] != pressed[b])
                .map(|[a, b]| panel.place([0, 1].map(|c| 0.5 * (at[a][c] + at[b][c]))))
                .collect();
            if let [p, q] = middles[..] {
                border += &line([p, q]);
            }
        }
        self.svg.path(&border, BORDER);
        self.close(developed, panel);
    }

    /// The panel of the states of nodes, with the tangential tractions.
    fn states(&mut self, developed: &Developed, panel: &Panel) {
        let mut raster = Raster::new(panel.size);
        let nothing = raster.add(NOTHING);
        let colours: Vec<_> = (legend::states(self.contact).into_iter())
            .map(|(state, _, colour, _)| (state, raster.add(colour)))
            .collect();
        let colour = |&i: &usize| {
            let mut all = colours.iter();
            let found = all.find(|(state, _)| *state == self.contact.status[i]);
            found.map_or(nothing, |&(_, colour)| colour)
        };
        for (at, nodes) in &developed.triangles {
            let of = nodes.map(|node| self.rows.get(&node).map(colour));
            raster.fill(at.map(|x| panel.place(x)), |weights| match of {
                [Some(a), Some(b), Some(c)] => [a, b, c][largest(weights)],
                _ => nothing,
            });
        }
        self.open(panel, "stick and slip, tangential traction", &raster);
        self.edges(developed, panel);
        self.arrows(developed, panel);
        self.close(developed, panel);
    }

    /// The tangential tractions on the body, no more of them than can be distinguished.
    fn arrows(&mut self, developed: &Developed, panel: &Panel) {
        if !(self.rubbed > 0.0) {
            return;
        }
        // In each cell of a lattice the node that is nearest to its middle.
        let mut cells: HashMap<[i64; 2], (f64, [f64; 2], usize, u32)> = HashMap::new();
        for (at, nodes) in &developed.triangles {
            for (x, node) in at.iter().zip(nodes) {
                let Some(&i) = self.rows.get(node) else {
                    continue;
                };
                let place = panel.place(*x);
                let cell = place.map(|v| (v / APART).floor());
                let off = [0, 1].map(|c| place[c] - APART * (cell[c] + 0.5));
                let entry = (length(off), place, i, *node);
                let held = cells.entry(cell.map(|v| v as i64)).or_insert(entry);
                if (entry.0, entry.2) < (held.0, held.2) {
                    *held = entry;
                }
            }
        }
        let mut chosen: Vec<_> = cells.into_values().collect();
        chosen.sort_by_key(|&(_, _, i, _)| i);
        let mut path = String::new();
        for (_, place, i, node) in chosen {
            let [_, rubbed] = self.contact.traction_vectors(i);
            let rubbed = self.elastic.turned_to(i, node, rubbed);
            let [right, up] = developed.vector(self.elastic.mesh.nodes[node as usize], rubbed);
            let scale = ARROW / self.rubbed;
            if right.hypot(up) > 0.02 * self.rubbed {
                path += &arrow(place, [scale * right, -scale * up]);
            }
        }
        self.svg.path(&path, ARROWS);
    }

    /// Begins a panel with its title and its image.
    fn open(&mut self, panel: &Panel, title: &str, raster: &Raster) {
        let ([x, y], [width, height]) = (panel.at, panel.size);
        let clip = format!("{}c{:.0}-{:.0}", self.name, x, y);
        self.svg.open(panel.at);
        self.svg.put(format_args!(
            "<text y=\"-10\" font-weight=\"600\">{title}</text><clipPath id=\"{clip}\"><rect x=\"-1\" y=\"-1\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath><g clip-path=\"url(#{clip})\">",
            width + 2.0,
            height + 2.0
        ));
        self.svg.image([0.0; 2], panel.size, &raster.png());
    }

    /// The edges of the elements where there is room, and where the surface ends.
    fn edges(&mut self, developed: &Developed, panel: &Panel) {
        let is_in_view = |x: &[f64; 2]| (0..2).all(|c| x[c] >= -1.0 && x[c] <= panel.size[c] + 1.0);
        let shown: Vec<_> = (developed.edges.iter())
            .map(|&(ends, is_border, share)| (ends.map(|x| panel.place(x)), is_border, share))
            .filter(|(ends, ..)| ends.iter().any(is_in_view))
            .collect();
        let lengths = shown
            .iter()
            .map(|([p, q], ..)| (q[0] - p[0]).hypot(q[1] - p[1]));
        let total: f64 = lengths.sum();
        let count: f64 = shown.iter().map(|(.., share)| share).sum();
        let all = |border: bool| -> String {
            let wanted = shown
                .iter()
                .filter(|(_, is_border, _)| *is_border == border);
            wanted.map(|&(ends, ..)| line(ends)).collect()
        };
        if total > VISIBLE_EDGE * count {
            let thin = "stroke=\"#000000\" stroke-opacity=\"0.14\" stroke-width=\"0.6\"";
            self.svg.path(&all(false), thin);
        }
        self.svg.path(&all(true), "stroke=\"#222222\"");
    }

    /// Ends a panel with its axes.
    fn close(&mut self, developed: &Developed, panel: &Panel) {
        let [width, height] = panel.size;
        let [(x, x_label), (y, y_label)] = [0, 1].map(|c| {
            let ends = [panel.low[c], panel.low[c] + panel.size[c] / panel.unit];
            let (start, end) = if c == 0 { (0.0, width) } else { (height, 0.0) };
            let axis = Axis::new(&developed.labels[c], &self.elastic.units.length);
            let scale = Scale::new(&axis, ends.into_iter(), start, end, 0.0);
            let label = escape(&scale.label(&axis));
            (scale, label)
        });
        let bottom = height + 4.0;
        let mut lines = String::new();
        for (value, label) in x.ticks((width / 45.0).max(1.5)) {
            let (at, below) = (x.place(value), bottom + 17.0);
            lines += &format!(
                "<path d=\"M{at:.1} {bottom:.1}v5\" stroke=\"#222222\"/><text x=\"{at:.1}\" y=\"{below:.1}\" text-anchor=\"middle\" font-size=\"12\">{label}</text>"
            );
        }
        for (value, label) in y.ticks((height / 40.0).max(1.5)) {
            let (at, below) = (y.place(value), y.place(value) + 4.0);
            lines += &format!(
                "<path d=\"M-4 {at:.1}h-5\" stroke=\"#222222\"/><text x=\"-12\" y=\"{below:.1}\" text-anchor=\"end\" font-size=\"12\">{label}</text>"
            );
        }
        self.svg.put(format_args!(
            "</g><path d=\"M-4 0V{bottom:.1}H{width:.1}\" fill=\"none\" stroke=\"#222222\"/>{lines}<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{x_label}</text><text transform=\"translate(-46 {:.1}) rotate(-90)\" text-anchor=\"middle\">{y_label}</text></g>",
            0.5 * width,
            bottom + 36.0,
            0.5 * height
        ));
    }

    /// The meaning of the colours of states, the arrows and the border.
    fn legend(&mut self) {
        let mut entries: Vec<(String, String)> = Vec::new();
        let count = |state| {
            let mut here = self.rows.values();
            here.by_ref()
                .filter(|&&i| self.contact.status[i] == state)
                .count()
        };
        if self.has_friction {
            let states = legend::states(self.contact).into_iter();
            let seen = states.filter(|state| count(state.0) > 0);
            entries.extend(seen.map(|(_, name, colour, _)| (patch(colour), name.to_owned())));
            if self.rubbed > 0.0 {
                let path = arrow([0.0, -4.5], [ARROW, 0.0]);
                let sample = format!("<path d=\"{path}\" fill=\"none\" {ARROWS}/>");
                let unit = Units::behind(&self.elastic.units.stress());
                let rubbed = short(self.rubbed);
                let name = format!("tangential traction on the body, {rubbed}{unit}");
                entries.push((sample, name));
            }
        }
        if ![0, self.rows.len()].contains(&count(NodeStatus::Separated)) {
            let ground = patch("#2a788e");
            let sample = format!("{ground}<path d=\"M2 -4.5h22\" {BORDER}/>");
            entries.push((sample, "border of the contact".to_owned()));
        }
        let first = self.y + 8.0;
        self.svg.legend(&entries, [MARGIN, first], WIDTH);
        let places = places(&entries, MARGIN, WIDTH);
        self.y = first + places.last().map_or(0.0, |at| at[1]) + LINE + 2.0;
    }

    /// Pressure, tangential traction and slip bound along both lines through the largest pressure.
    fn profiles(&mut self, developed: &Developed) {
        const GAP: f64 = 10.0;
        let width = 0.5 * (WIDTH - 2.0 * MARGIN - GAP);
        let height = if self.has_friction { 320.0 } else { 280.0 };
        for axis in 0..2 {
            let chart = profile(self, developed, axis).sized(width, height);
            let x = MARGIN - 10.0 + axis as f64 * (width + GAP);
            self.svg.open([x, self.y]);
            self.svg.text += &chart;
            self.svg.close();
        }
        self.y += height;
    }
}

/// With a capital letter.
fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(|c| c.to_uppercase().to_string());
    first.unwrap_or_default() + letters.as_str()
}

/// The path of an arrow.
fn arrow([x, y]: [f64; 2], [a, b]: [f64; 2]) -> String {
    let head = 0.28;
    let (tx, ty) = (x + a, y + b);
    let side = |turn: f64| {
        let (along, across) = (a + turn * 0.6 * b, b - turn * 0.6 * a);
        [tx - head * along, ty - head * across]
    };
    let [[px, py], [qx, qy]] = [1.0, -1.0].map(side);
    format!("M{x:.1} {y:.1}L{tx:.1} {ty:.1}M{px:.1} {py:.1}L{tx:.1} {ty:.1}L{qx:.1} {qy:.1}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrows_end_where_they_point() {
        let path = arrow([1.0, 2.0], [10.0, 0.0]);
        assert_eq!(path, "M1.0 2.0L11.0 2.0M8.2 3.7L11.0 2.0L8.2 0.3");
        assert_eq!(capitalised("seen"), "Seen");
    }
}
