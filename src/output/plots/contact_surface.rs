//! The contact surfaces of solids: pressures, tractions, what sticks and slips, and profiles of them.

mod profile;

use super::chart::{Axis, STYLE, Scale, colour, escape};
use super::legend::{self, ColourBar, short};
use super::raster::{Raster, viridis};
use super::sheet::{Sheet, sheets};
use crate::mesh::vector::bounds;
use crate::model::Elastic;
use crate::output::{ContactFields, NodeStatus, put, shown_at_nodes};
use base64::Engine as _;
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
/// Pixels per unit of the picture.
const FINE: f64 = 2.0;
/// The longest arrow, and how far arrows stand apart.
const ARROW: f64 = 26.0;
const APART: f64 = 22.0;
/// Edges of elements are drawn where these are longer than this on average.
const VISIBLE_EDGE: f64 = 7.0;
/// Where nothing lies opposite, or a support holds.
const NOTHING: f64 = -1.0;
const NOTHING_COLOUR: [u8; 3] = [214, 214, 214];

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
    svg: String,
    /// How far down it is drawn so far.
    y: f64,
}

/// The picture of a contact. `name` keeps the names in it apart from those of other pictures on the same page.
pub(super) fn svg(
    title: &str,
    name: &str,
    elastic: &Elastic<3>,
    contact: &ContactFields<3>,
    pair: usize,
) -> String {
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
            .any(|&i| contact.bound[i] > 0.0 || contact.status(i) == NodeStatus::Stick),
        rows,
        name: name.to_owned(),
        svg: String::new(),
        y: 44.0,
    };
    let pressure = |node: u32| scene.rows.get(&node).map_or(0.0, |&i| contact.pressure[i]);
    let all = sheets(&elastic.mesh, &elastic.pairs[pair].facets, &pressure);
    for (k, sheet) in all.iter().enumerate() {
        scene.sheet(sheet, k);
    }
    scene.legend();
    if let Some(first) = scene.sheet_of_peak(&all) {
        scene.profiles(&all[first]);
    }
    scene.finish(title)
}

/// The tangential traction of a contact node.
fn along(contact: &ContactFields<3>, i: usize) -> f64 {
    let [_, rubbed] = contact.traction_vectors(i);
    crate::mesh::vector::length(rubbed)
}

/// A part of a sheet on its way to a panel.
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
    fn put(&mut self, line: std::fmt::Arguments) {
        put(&mut self.svg, line);
    }

    fn status(&self, i: usize) -> NodeStatus {
        self.contact.status(i)
    }

    /// Whether the contact node at a node of the mesh touches the other side: the others may have a pressure of rounding.
    fn pressed(&self, node: u32) -> bool {
        let row = self.rows.get(&node);
        row.is_some_and(|&i| self.status(i) != NodeStatus::Separated)
    }

    /// The sheet with the largest pressure.
    fn sheet_of_peak(&self, all: &[Sheet]) -> Option<usize> {
        let peak = |sheet: &Sheet| {
            let nodes = sheet.triangles.iter().flat_map(|(_, nodes)| nodes);
            let rows = nodes.filter_map(|node| self.rows.get(node));
            rows.map(|&i| self.contact.pressure[i]).fold(0.0, f64::max)
        };
        let peaks = all.iter().map(peak).enumerate();
        let best = peaks.max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.cmp(&a.0)))?;
        (best.1 > 0.0).then_some(best.0)
    }

    /// What is shown of a sheet: all of it, or the part in contact and what is around it, where that is small.
    fn range(&self, sheet: &Sheet) -> (([f64; 2], [f64; 2]), bool) {
        let all = sheet.triangles.iter().flat_map(|(at, _)| *at);
        let (low, high) = bounds(all);
        let pressed = (sheet.triangles.iter())
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

    /// The panels of a sheet: pressures, and with friction what sticks and slips, with the tractions.
    fn sheet(&mut self, sheet: &Sheet, number: usize) {
        let ((low, high), is_zoomed) = self.range(sheet);
        let extent = [0, 1].map(|c| (high[c] - low[c]).max(f64::MIN_POSITIVE));
        let is_wide = !self.has_friction || extent[0] > 2.2 * extent[1];
        let room = if is_wide { WIDE } else { PANEL };
        let unit = (room[0] / extent[0]).min(room[1] / extent[1]);
        let size = extent.map(|v| unit * v);
        let mut caption = sheet.caption.clone();
        if is_zoomed {
            caption += "; only the part in contact is shown";
        }
        let y = self.y + 12.0;
        self.put(format_args!(
            "<text x=\"{MARGIN}\" y=\"{y:.1}\" fill=\"#555555\">{}</text>",
            escape(&capitalised(&caption))
        ));
        let first = [MARGIN + AXIS, y + 38.0];
        let panel = |at: [f64; 2]| Panel {
            low,
            unit,
            size,
            at,
        };
        let bar = [first[0] + size[0] + 18.0, first[1] + 6.0];
        self.pressures(sheet, &panel(first));
        let bar_height = (size[1] - 6.0).clamp(110.0, 240.0);
        let unit_name = self.elastic.units.stress();
        let colours = ColourBar {
            name: format!("{}s{number}", self.name),
            unit: &unit_name,
            top: self.top,
            largest: self.largest,
            height: bar_height,
        };
        colours.draw(&mut self.svg, bar);
        let height = size[1].max(bar_height + 20.0);
        self.y = first[1] + height + BELOW;
        if !self.has_friction {
            return;
        }
        let second = if is_wide {
            [first[0], self.y + 26.0]
        } else {
            [bar[0] + BAR + AXIS, first[1]]
        };
        self.states(sheet, &panel(second));
        if is_wide {
            self.y = second[1] + size[1] + BELOW;
        }
    }

    /// The panel of the pressures, with the border of what is in contact.
    fn pressures(&mut self, sheet: &Sheet, panel: &Panel) {
        let (rows, pressure, top) = (&self.rows, &self.contact.pressure, self.top);
        let mut raster = self.raster(panel);
        for (at, nodes) in &sheet.triangles {
            let x = at.map(|x| panel.place(x).map(|v| FINE * v));
            let values = nodes.map(|node| rows.get(&node).map(|&i| pressure[i]));
            match values {
                [Some(a), Some(b), Some(c)] => raster.triangle(x, [a, b, c]),
                _ => raster.nearest(x, [NOTHING; 3]),
            }
        }
        let image = raster.coloured(|value| match value {
            NOTHING => NOTHING_COLOUR,
            value => viridis(value / top),
        });
        self.open(panel, "contact pressure", &image);
        self.edges(sheet, panel);
        let mut border = String::new();
        for (at, nodes) in &sheet.triangles {
            let pressed = nodes.map(|node| self.pressed(node));
            let middles: Vec<[f64; 2]> = [[0, 1], [1, 2], [2, 0]]
                .into_iter()
                .filter(|&[a, b]| pressed[a] != pressed[b])
                .map(|[a, b]| panel.place([0, 1].map(|c| 0.5 * (at[a][c] + at[b][c]))))
                .collect();
            if let [p, q] = middles[..] {
                border += &format!("M{:.1} {:.1}L{:.1} {:.1}", p[0], p[1], q[0], q[1]);
            }
        }
        self.put(format_args!(
            "<path d=\"{border}\" fill=\"none\" stroke=\"#ffffff\" stroke-width=\"1.4\" stroke-linecap=\"round\"/>"
        ));
        self.close(sheet, panel);
    }

    /// The panel of what nodes do, with the tangential tractions.
    fn states(&mut self, sheet: &Sheet, panel: &Panel) {
        let mut raster = self.raster(panel);
        for (at, nodes) in &sheet.triangles {
            let x = at.map(|x| panel.place(x).map(|v| FINE * v));
            let values = nodes.map(|node| self.rows.get(&node).map(|&i| self.status(i)));
            match values {
                [Some(a), Some(b), Some(c)] => {
                    raster.nearest(x, [a, b, c].map(|s| f64::from(s as u8)))
                }
                _ => raster.nearest(x, [NOTHING; 3]),
            }
        }
        let image = raster.coloured(|value| {
            let all = STATES
                .iter()
                .find(|(state, ..)| f64::from(*state as u8) == value);
            all.map_or(NOTHING_COLOUR, |(.., colour)| rgb(colour))
        });
        self.open(panel, "stick and slip, tangential traction", &image);
        self.edges(sheet, panel);
        self.arrows(sheet, panel);
        self.close(sheet, panel);
    }

    /// The tangential tractions on the body, not more of them than are told apart.
    fn arrows(&mut self, sheet: &Sheet, panel: &Panel) {
        if !(self.rubbed > 0.0) {
            return;
        }
        // In each cell of a lattice the node that is nearest to its middle.
        let mut cells: HashMap<[i64; 2], (f64, [f64; 2], usize, u32)> = HashMap::new();
        for (at, nodes) in &sheet.triangles {
            for (x, node) in at.iter().zip(nodes) {
                let Some(&i) = self.rows.get(node) else {
                    continue;
                };
                let place = panel.place(*x);
                let cell = place.map(|v| (v / APART).floor());
                let off = [0, 1].map(|c| place[c] - APART * (cell[c] + 0.5));
                let entry = (off[0].hypot(off[1]), place, i, *node);
                let held = cells.entry(cell.map(|v| v as i64)).or_insert(entry);
                if (entry.0, entry.2) < (held.0, held.2) {
                    *held = entry;
                }
            }
        }
        let mut chosen: Vec<_> = cells.into_values().collect();
        chosen.sort_by_key(|&(_, _, i, _)| i);
        let mut path = String::new();
        for (_, [x, y], i, node) in chosen {
            let [_, rubbed] = self.contact.traction_vectors(i);
            let [right, up] = sheet.vector(self.elastic.mesh.nodes[node as usize], rubbed);
            let scale = ARROW / self.rubbed;
            if right.hypot(up) > 0.02 * self.rubbed {
                path += &arrow([x, y], [scale * right, -scale * up]);
            }
        }
        self.put(format_args!(
            "<path d=\"{path}\" fill=\"none\" stroke=\"#222222\" stroke-width=\"1.1\" stroke-linecap=\"round\" stroke-linejoin=\"round\"/>"
        ));
    }

    fn raster(&self, panel: &Panel) -> Raster {
        let [width, height] = panel.size.map(|v| (FINE * v).ceil().max(1.0) as usize);
        Raster::new(width, height)
    }

    /// Begins a panel with its title and its image.
    fn open(&mut self, panel: &Panel, title: &str, image: &[u8]) {
        let ([x, y], [width, height]) = (panel.at, panel.size);
        let image = base64::engine::general_purpose::STANDARD.encode(image);
        let clip = format!("{}c{:.0}-{:.0}", self.name, x, y);
        self.put(format_args!(
            "<g transform=\"translate({x:.1} {y:.1})\"><text y=\"-10\" font-weight=\"600\">{title}</text><clipPath id=\"{clip}\"><rect x=\"-1\" y=\"-1\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath><g clip-path=\"url(#{clip})\"><image width=\"{width:.1}\" height=\"{height:.1}\" preserveAspectRatio=\"none\" href=\"data:image/png;base64,{image}\"/>",
            width + 2.0,
            height + 2.0
        ));
    }

    /// The edges of the elements where there is room, and where the surface ends.
    fn edges(&mut self, sheet: &Sheet, panel: &Panel) {
        let line = |[p, q]: [[f64; 2]; 2]| {
            let ([a, b], [c, d]) = (panel.place(p), panel.place(q));
            (
                (c - a).hypot(d - b),
                format!("M{a:.1} {b:.1}L{c:.1} {d:.1}"),
            )
        };
        let in_view = |ends: &[[f64; 2]; 2]| {
            let places = ends.map(|x| panel.place(x));
            places
                .iter()
                .any(|x| (0..2).all(|c| x[c] >= -1.0 && x[c] <= panel.size[c] + 1.0))
        };
        let shown: Vec<_> = (sheet.edges.iter())
            .filter(|(ends, _)| in_view(ends))
            .map(|&(ends, is_border)| (line(ends), is_border))
            .collect();
        let total: f64 = shown.iter().map(|((length, _), _)| length).sum();
        let all = |border: bool| -> String {
            let wanted = shown.iter().filter(|(_, is_border)| *is_border == border);
            wanted.map(|((_, path), _)| path.as_str()).collect()
        };
        let (thin, thick) = (all(false), all(true));
        if total > VISIBLE_EDGE * shown.len() as f64 {
            self.put(format_args!(
                "<path d=\"{thin}\" fill=\"none\" stroke=\"#000000\" stroke-opacity=\"0.14\" stroke-width=\"0.6\"/>"
            ));
        }
        self.put(format_args!(
            "<path d=\"{thick}\" fill=\"none\" stroke=\"#222222\"/>"
        ));
    }

    /// Ends a panel with its axes.
    fn close(&mut self, sheet: &Sheet, panel: &Panel) {
        let unit = self.elastic.units.length.clone();
        let [width, height] = panel.size;
        let [x, y] = [0, 1].map(|c| {
            let ends = [panel.low[c], panel.low[c] + panel.size[c] / panel.unit];
            let (start, end) = if c == 0 { (0.0, width) } else { (height, 0.0) };
            let axis = Axis::new(&sheet.labels[c], &unit);
            let scale = Scale::new(&axis, ends.into_iter(), start, end, 0.0);
            let label = escape(&scale.label(&axis));
            (scale, label)
        });
        let mut lines = String::new();
        for (value, label) in x.0.ticks((width / 45.0).max(1.5)) {
            let at = x.0.place(value);
            lines += &format!(
                "<path d=\"M{at:.1} {:.1}v5\" stroke=\"#222222\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"12\">{label}</text>",
                height + 4.0,
                height + 21.0
            );
        }
        for (value, label) in y.0.ticks((height / 40.0).max(1.5)) {
            let at = y.0.place(value);
            lines += &format!(
                "<path d=\"M-4 {at:.1}h-5\" stroke=\"#222222\"/><text x=\"-12\" y=\"{:.1}\" text-anchor=\"end\" font-size=\"12\">{label}</text>",
                at + 4.0
            );
        }
        self.put(format_args!(
            "</g><path d=\"M-4 0V{:.1}H{width:.1}\" fill=\"none\" stroke=\"#222222\"/>{lines}<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text><text transform=\"translate(-46 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text></g>",
            height + 4.0,
            0.5 * width,
            height + 40.0,
            x.1,
            0.5 * height,
            y.1
        ));
    }

    /// What the colours of the states and the arrows mean.
    fn legend(&mut self) {
        let mut entries: Vec<(String, String)> = Vec::new();
        let rows: Vec<usize> = self.rows.values().copied().collect();
        if self.has_friction {
            for (state, name, colour) in STATES {
                if rows.iter().any(|&i| self.status(i) == state) {
                    let sample = format!(
                        "<rect y=\"-11\" width=\"26\" height=\"13\" fill=\"{colour}\" stroke=\"#bbbbbb\"/>"
                    );
                    entries.push((sample, name.to_owned()));
                }
            }
            if self.rubbed > 0.0 {
                let path = arrow([0.0, -4.5], [ARROW, 0.0]);
                let sample = format!(
                    "<path d=\"{path}\" fill=\"none\" stroke=\"#222222\" stroke-width=\"1.1\"/>"
                );
                let unit = self.elastic.units.stress();
                let text = format!(
                    "tangential traction on the body, {} {unit}",
                    short(self.rubbed)
                );
                entries.push((sample, text));
            }
        }
        let (border, ground) = ("#ffffff", "#2a788e");
        let touching = rows
            .iter()
            .filter(|&&i| self.status(i) != NodeStatus::Separated);
        if ![0, rows.len()].contains(&touching.count()) {
            entries.push((
            format!(
                "<rect y=\"-11\" width=\"26\" height=\"13\" fill=\"{ground}\"/><path d=\"M2 -4.5h22\" stroke=\"{border}\" stroke-width=\"1.4\"/>"
            ),
            "border of the contact".to_owned(),
        ));
        }
        let (mut x, mut y) = (MARGIN, self.y + 8.0);
        for (sample, name) in entries {
            let wide = 56.0 + 7.0 * name.chars().count() as f64;
            if x > MARGIN && x + wide > WIDTH {
                (x, y) = (MARGIN, y + 22.0);
            }
            self.put(format_args!(
                "<g transform=\"translate({x:.1} {y:.1})\">{sample}<text x=\"34\">{}</text></g>",
                escape(&name)
            ));
            x += wide;
        }
        self.y = y + 22.0;
    }

    /// Pressure, tangential traction and slip bound along both lines through the largest pressure.
    fn profiles(&mut self, sheet: &Sheet) {
        const GAP: f64 = 10.0;
        let width = 0.5 * (WIDTH - 2.0 * MARGIN - GAP);
        let height = if self.has_friction { 320.0 } else { 280.0 };
        for axis in 0..2 {
            let chart = profile(self, sheet, axis).sized(width, height);
            let x = MARGIN - 10.0 + axis as f64 * (width + GAP);
            let y = self.y;
            self.put(format_args!(
                "<g transform=\"translate({x:.1} {y:.1})\">{chart}</g>"
            ));
        }
        self.y += height;
    }

    /// The file.
    fn finish(self, title: &str) -> String {
        let (title, height) = (escape(title), self.y + 12.0);
        let mut svg = String::new();
        put(
            &mut svg,
            format_args!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH:.0} {height:.0}\" width=\"{WIDTH:.0}\" height=\"{height:.0}\" role=\"img\" {STYLE}>"
            ),
        );
        put(
            &mut svg,
            format_args!(
                "<title>{title}</title><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/><text x=\"{MARGIN}\" y=\"26\" font-size=\"16\" font-weight=\"600\">{title}</text>"
            ),
        );
        svg + &self.svg + "</svg>\n"
    }
}

/// What a contact node may do, what that is called and its colour.
const STATES: [(NodeStatus, &str, &str); 4] = [
    (NodeStatus::Stick, "stick", colour::STICK),
    (NodeStatus::Slip, "slip", colour::SLIP),
    (NodeStatus::Frictionless, "in contact", colour::STICK),
    (NodeStatus::Separated, "separated", colour::SEPARATED),
];

/// A colour as three numbers.
fn rgb(colour: &str) -> [u8; 3] {
    let part = |k: usize| u8::from_str_radix(colour.get(k..k + 2).unwrap_or("00"), 16).unwrap_or(0);
    [part(1), part(3), part(5)]
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
        [
            tx - head * (a + turn * 0.6 * b),
            ty - head * (b - turn * 0.6 * a),
        ]
    };
    let ([px, py], [qx, qy]) = (side(1.0), side(-1.0));
    format!("M{x:.1} {y:.1}L{tx:.1} {ty:.1}M{px:.1} {py:.1}L{tx:.1} {ty:.1}L{qx:.1} {qy:.1}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_states_are_those_of_charts() {
        assert_eq!(rgb(colour::STICK), [0xcf, 0xe5, 0xf5]);
        assert_eq!(rgb("#0a0b0c"), [10, 11, 12]);
    }

    #[test]
    fn arrows_end_where_they_point() {
        let path = arrow([1.0, 2.0], [10.0, 0.0]);
        assert_eq!(path, "M1.0 2.0L11.0 2.0M8.2 3.7L11.0 2.0L8.2 0.3");
        assert_eq!(capitalised("seen"), "Seen");
    }
}
