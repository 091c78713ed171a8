//! What is met along a line of a contact surface.

use super::{STATES, Scene, along};
use crate::mesh::vector::bounds;
use crate::output::NodeStatus;
use crate::output::plots::chart::{Axis, Chart, Mark, Series, Zone, colour};
use crate::output::plots::legend::short;
use crate::output::plots::raster::largest;
use crate::output::plots::sheet::Sheet;

/// Pressure, tangential traction and slip bound through the largest pressure, along the first or the second coordinate.
pub(super) fn profile(scene: &Scene, sheet: &Sheet, axis: usize) -> Chart {
    let peak = peak(scene, sheet)[1 - axis];
    let ((low, high), _) = scene.range(sheet);
    let line = Line::new(scene, sheet, axis, peak, [low[axis], high[axis]]);
    let series = |name: &str, colour, mark, part: usize| Series {
        name: name.to_owned(),
        colour,
        mark,
        points: line.points.iter().map(|(s, v)| (*s, v[part])).collect(),
    };
    let mut all = Vec::new();
    if scene.has_friction {
        all.push(series("slip bound", colour::GREY, Mark::Dashed, 2));
        all.push(series("tangential traction", colour::ORANGE, Mark::Line, 1));
    }
    all.push(series("contact pressure", colour::BLUE, Mark::Line, 0));
    let (unit, label, other) = (
        &scene.elastic.units.length,
        &sheet.labels[axis],
        &sheet.labels[1 - axis],
    );
    // The first word is what it is called.
    let [along, other] = [label, other].map(|l| l.split(' ').next().unwrap_or(l));
    // Without the rounding of coordinates.
    let extent = high[1 - axis] - low[1 - axis];
    let place = if peak.abs() < 1e-9 * extent {
        0.0
    } else {
        peak
    };
    Chart {
        title: format!("Along {along}, at {other} = {} {unit}", short(place)),
        x: Axis::new(label, unit),
        y: Axis::new("contact stress", &scene.elastic.units.stress()),
        series: all,
        zones: line.zones,
        rules: Vec::new(),
    }
}

/// The place of the largest pressure.
fn peak(scene: &Scene, sheet: &Sheet) -> [f64; 2] {
    let mut best = (f64::NEG_INFINITY, [0.0; 2]);
    for (at, nodes) in &sheet.triangles {
        for (x, node) in at.iter().zip(nodes) {
            let value = scene.rows.get(node).map(|&i| scene.contact.pressure[i]);
            if let Some(value) = value.filter(|value| *value > best.0) {
                best = (value, *x);
            }
        }
    }
    best.1
}

/// Where a line meets the border of a triangle: the place, pressure, tangential traction and slip bound there, and the
/// nearest contact node.
type Cut = (f64, [f64; 3], usize);

/// What is met along a line of a sheet.
struct Line {
    /// Places with pressure, tangential traction and slip bound; NaN between parts.
    points: Vec<(f64, [f64; 3])>,
    zones: Vec<Zone>,
}

impl Line {
    /// Along a coordinate in a range, where the other one has this value.
    fn new(scene: &Scene, sheet: &Sheet, axis: usize, value: f64, range: [f64; 2]) -> Self {
        // A line along the upper border has no triangle above it.
        let (low, high) = bounds(sheet.triangles.iter().flat_map(|(at, _)| *at));
        let across = 1 - axis;
        let value = value.min(high[across] - 1e-9 * (high[across] - low[across]));
        let rounding = 1e-6 * (range[1] - range[0]);
        let mut parts: Vec<[Cut; 2]> = (sheet.triangles.iter())
            .filter_map(|(at, nodes)| cuts(scene, at, nodes, axis, value))
            .collect();
        parts.retain(|[from, to]| {
            to.0 - from.0 > rounding && from.0 > range[0] - rounding && to.0 < range[1] + rounding
        });
        parts.sort_by(|a, b| a[0].0.total_cmp(&b[0].0));
        let mut line = Self {
            points: Vec::new(),
            zones: Vec::new(),
        };
        for [from, to] in parts {
            if (line.points.last()).is_some_and(|last| from.0 > last.0 + rounding) {
                line.points.push((f64::NAN, [f64::NAN; 3]));
            }
            line.points.extend([(from.0, from.1), (to.0, to.1)]);
            let middle = 0.5 * (from.0 + to.0);
            line.zone([from.0, middle], rounding, scene.contact.status(from.2));
            line.zone([middle, to.0], rounding, scene.contact.status(to.2));
        }
        line
    }

    /// Adds a zone, or goes on with the last.
    fn zone(&mut self, [from, to]: [f64; 2], rounding: f64, state: NodeStatus) {
        let Some((_, name, colour)) = STATES.into_iter().find(|(s, ..)| *s == state) else {
            return;
        };
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
}

/// Where a line goes into a triangle of contact nodes, and out of it.
fn cuts(
    scene: &Scene,
    at: &[[f64; 2]; 3],
    nodes: &[u32; 3],
    axis: usize,
    value: f64,
) -> Option<[Cut; 2]> {
    let contact = scene.contact;
    let mut rows = [0; 3];
    for (row, node) in rows.iter_mut().zip(nodes) {
        *row = *scene.rows.get(node)?;
    }
    let of = |i: usize| [contact.pressure[i], along(contact, i), contact.bound[i]];
    let off = at.map(|x| x[1 - axis] - value);
    let mut cuts: Vec<Cut> = Vec::new();
    for [p, q] in [[0, 1], [1, 2], [2, 0]] {
        if (off[p] > 0.0) == (off[q] > 0.0) {
            continue;
        }
        let t = off[p] / (off[p] - off[q]);
        let mut weights = [0.0; 3];
        (weights[p], weights[q]) = (1.0 - t, t);
        let s = (1.0 - t) * at[p][axis] + t * at[q][axis];
        let [u, v] = [p, q].map(|k| of(rows[k]));
        let mean = std::array::from_fn(|k| (1.0 - t) * u[k] + t * v[k]);
        cuts.push((s, mean, rows[largest(weights)]));
    }
    match cuts[..] {
        [p, q] if p.0 <= q.0 => Some([p, q]),
        [p, q] => Some([q, p]),
        _ => None,
    }
}
