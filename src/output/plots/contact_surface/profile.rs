//! The fields along a line of a contact surface.

use super::{Scene, along};
use crate::mesh::vector::bounds;
use crate::output::plots::chart::{Axis, Chart};
use crate::output::plots::curves::Line;
use crate::output::plots::developed::Developed;
use crate::output::plots::legend::{short, state};
use crate::output::plots::raster::largest;

/// Pressure, tangential traction and slip bound through the largest pressure, along the first or the second coordinate.
pub(super) fn profile(scene: &Scene, developed: &Developed, axis: usize) -> Chart {
    let across = 1 - axis;
    let peak = scene.peak(developed).1[across];
    let ((low, high), _) = scene.range(developed);
    let line = line(scene, developed, axis, peak, [low[axis], high[axis]]);
    let (length, stress) = (&scene.elastic.units.length, scene.elastic.units.stress());
    // The first word is its name.
    let called = |label: &str| label.split(' ').next().map(str::to_owned);
    let [along, other] = [axis, across].map(|c| called(&developed.labels[c]).unwrap_or_default());
    // Without the rounding of coordinates.
    let is_zero = peak.abs() < 1e-9 * (high[across] - low[across]);
    let place = short(if is_zero { 0.0 } else { peak });
    let title = format!("Along {along}, at {other} = {place} {length}");
    let x = Axis::new(&developed.labels[axis], length);
    line.chart(title, x, &stress, scene.has_friction, false)
}

/// The intersection of a line with the border of a triangle: the place, pressure, tangential traction and slip bound
/// there, and the nearest contact node.
type Cut = (f64, [f64; 3], usize);

/// The fields along a coordinate in a range, where the other one has this value.
fn line(scene: &Scene, developed: &Developed, axis: usize, value: f64, range: [f64; 2]) -> Line {
    // A line along the upper border has no triangle above it.
    let (low, high) = bounds(developed.triangles.iter().flat_map(|(at, _)| *at));
    let across = 1 - axis;
    let value = value.min(high[across] - 1e-9 * (high[across] - low[across]));
    let rounding = 1e-6 * (range[1] - range[0]);
    let mut parts: Vec<[Cut; 2]> = (developed.triangles.iter())
        .filter_map(|(at, nodes)| cuts(scene, at, nodes, axis, value))
        .collect();
    parts.retain(|[from, to]| {
        to.0 - from.0 > rounding && from.0 > range[0] - rounding && to.0 < range[1] + rounding
    });
    parts.sort_by(|a, b| a[0].0.total_cmp(&b[0].0));
    let mut line = Line::default();
    for [from, to] in parts {
        if (line.points.last()).is_some_and(|last| from.0 > last.0 + rounding) {
            line.interrupt();
        }
        line.points.extend([(from.0, from.1), (to.0, to.1)]);
        let middle = 0.5 * (from.0 + to.0);
        line.zone([from.0, middle], rounding, state(scene.contact, from.2));
        line.zone([middle, to.0], rounding, state(scene.contact, to.2));
    }
    line
}

/// The points where a line enters a triangle of contact nodes, and leaves it.
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
