//! The deformed mesh with its von Mises stresses: a raster image of the field inside an SVG.

use super::chart::{STYLE, colour, escape, nice};
use super::{ContactFields, StepFields};
use crate::case::Elastic;
use crate::contact::Obstacle;
use crate::mesh::{Mesh, bounds};
use base64::Engine as _;
use std::collections::HashMap;
use std::fmt::Write as _;

/// Width of the field in the picture; the raster has twice as many pixels.
const FIELD_WIDTH: f64 = 740.0;
const FIELD_HEIGHT: f64 = 560.0;
const MARGIN: f64 = 24.0;
const LEGEND: f64 = 130.0;
const HEAD: f64 = 64.0;
const FOOT: f64 = 44.0;
/// Pixels of the raster per unit of the picture.
const FINE: f64 = 2.0;
/// Edges of elements are drawn where these are larger than this many units on average.
const VISIBLE_EDGE: f64 = 7.0;
/// Displacements are scaled to this part of the size of the mesh.
const SHOWN: f64 = 0.04;
/// Scaled bodies overlap where they have closed a gap: by this part of the size of the mesh at most.
const FALSE_OVERLAP: f64 = 0.003;

/// Stops of the colour map viridis (Smith and van der Walt 2015), evenly spaced.
const VIRIDIS: [[f64; 3]; 11] = [
    [68.0, 1.0, 84.0],
    [72.0, 36.0, 117.0],
    [65.0, 68.0, 135.0],
    [53.0, 95.0, 141.0],
    [42.0, 120.0, 142.0],
    [33.0, 145.0, 140.0],
    [34.0, 168.0, 132.0],
    [68.0, 191.0, 112.0],
    [122.0, 209.0, 81.0],
    [189.0, 223.0, 38.0],
    [253.0, 231.0, 37.0],
];

fn viridis(value: f64) -> [u8; 3] {
    let place = value.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let below = (place as usize).min(VIRIDIS.len() - 2);
    let t = place - below as f64;
    std::array::from_fn(|c| {
        ((1.0 - t) * VIRIDIS[below][c] + t * VIRIDIS[below + 1][c]).round() as u8
    })
}

/// A factor for the displacements: a round one that shows them, near 1 where bodies would overlap by it.
fn magnification(elastic: &Elastic, largest: f64, contact: &ContactFields) -> f64 {
    let (low, high) = elastic.mesh.bounding_box();
    let size = (high[0] - low[0]).hypot(high[1] - low[1]);
    if !(largest > 0.0) {
        return 1.0;
    }
    // A gap d that becomes g is drawn as d + s (g − d).
    let room = FALSE_OVERLAP * size;
    let wanted = (elastic.contact.nodes.iter().zip(&contact.gap))
        .map(|(node, gap)| (node.gap, node.gap - gap))
        .filter(|&(before, closed)| closed > 1e-9 * before)
        .map(|(before, closed)| (before + room) / closed)
        .fold(SHOWN * size / largest, f64::min);
    if wanted < 1.0 {
        return 1.0;
    }
    // The round number at or below.
    let up = nice(wanted);
    if up <= wanted * (1.0 + 1e-9) {
        up
    } else {
        [up / 2.0, up / 2.5]
            .into_iter()
            .find(|&f| (nice(f) / f - 1.0).abs() < 1e-9)
            .unwrap_or(up / 2.0)
            .max(1.0)
    }
}

/// The edges of the mesh that belong to one element only.
fn outline(mesh: &Mesh) -> Vec<[u32; 2]> {
    let mut count: HashMap<[u32; 2], i32> = HashMap::new();
    for element in &mesh.elements {
        let nodes = element.nodes();
        for (i, &a) in nodes.iter().enumerate() {
            let b = nodes[(i + 1) % nodes.len()];
            *count.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let mut edges: Vec<[u32; 2]> = count
        .into_iter()
        .filter(|&(_, n)| n == 1)
        .map(|(edge, _)| edge)
        .collect();
    edges.sort_unstable();
    edges
}

/// Pixels of scalar values; NaN where there is nothing.
struct Raster {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Raster {
    /// A triangle with a linear field; corners in pixels.
    fn triangle(&mut self, x: [[f64; 2]; 3], v: [f64; 3]) {
        let cross = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
            (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        };
        let area = cross(x[0], x[1], x[2]);
        if !(area.abs() > 0.0) {
            return;
        }
        let range = |c: usize, end: usize| {
            let low = x.iter().map(|p| p[c]).fold(f64::INFINITY, f64::min);
            let high = x.iter().map(|p| p[c]).fold(f64::NEG_INFINITY, f64::max);
            // Centres of pixels lie at one half.
            let first = (low - 0.5).ceil().max(0.0) as usize;
            let last = (high - 0.5).floor().min(end as f64 - 1.0);
            first..if last < 0.0 { 0 } else { last as usize + 1 }
        };
        for row in range(1, self.height) {
            for column in range(0, self.width) {
                let p = [column as f64 + 0.5, row as f64 + 0.5];
                let weights = [
                    cross(p, x[1], x[2]) / area,
                    cross(x[0], p, x[2]) / area,
                    cross(x[0], x[1], p) / area,
                ];
                // A little outside, so that neighbours leave no seam.
                if weights.iter().all(|&w| w >= -1e-9) {
                    self.values[row * self.width + column] =
                        weights.iter().zip(v).map(|(w, v)| w * v).sum();
                }
            }
        }
    }

    /// As PNG, transparent where there is nothing.
    fn png(&self, top: f64) -> Vec<u8> {
        let mut pixels = Vec::with_capacity(4 * self.values.len());
        for &value in &self.values {
            if value.is_nan() {
                pixels.extend([255, 255, 255, 0]);
            } else {
                let [r, g, b] = viridis(value / top);
                pixels.extend([r, g, b, 255]);
            }
        }
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let written = encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&pixels));
        written.expect("writing to memory cannot fail");
        bytes
    }
}

/// The picture of a step.
/// `number` keeps the names in it apart from those of other pictures on the same page.
pub(super) fn svg(
    title: &str,
    number: usize,
    elastic: &Elastic,
    fields: &StepFields,
    contact: &ContactFields,
) -> String {
    let mesh = &elastic.mesh;
    let travel = fields
        .displacement
        .iter()
        .map(|u| u[0].hypot(u[1]))
        .fold(0.0, f64::max);
    let magnified = magnification(elastic, travel, contact);
    let moved: Vec<[f64; 2]> = mesh
        .nodes
        .iter()
        .zip(&fields.displacement)
        .map(|(x, u)| [x[0] + magnified * u[0], x[1] + magnified * u[1]])
        .collect();
    let (low, high) = bounds(mesh.nodes.iter().chain(&moved).copied());
    let unit = (FIELD_WIDTH / (high[0] - low[0])).min(FIELD_HEIGHT / (high[1] - low[1]));
    let size = [unit * (high[0] - low[0]), unit * (high[1] - low[1])];
    let place = |x: [f64; 2]| [unit * (x[0] - low[0]), unit * (high[1] - x[1])];

    let von_mises: Vec<f64> = fields.at_nodes.iter().map(|s| s.von_mises()).collect();
    let largest = von_mises.iter().copied().fold(0.0, f64::max);
    // A few singular corners must not take all the colours.
    let mut sorted = von_mises.clone();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[(sorted.len() - 1) * 998 / 1000];
    let top = if largest > 1.3 * usual && usual > 0.0 {
        usual
    } else {
        largest.max(f64::MIN_POSITIVE)
    };

    let mut raster = Raster {
        width: (FINE * size[0]).ceil().max(1.0) as usize,
        height: (FINE * size[1]).ceil().max(1.0) as usize,
        values: Vec::new(),
    };
    raster.values = vec![f64::NAN; raster.width * raster.height];
    for element in &mesh.elements {
        let nodes = element.nodes();
        for k in 1..nodes.len() - 1 {
            let corners = [nodes[0], nodes[k], nodes[k + 1]].map(|node| node as usize);
            raster.triangle(
                corners.map(|i| place(moved[i]).map(|v| FINE * v)),
                corners.map(|i| von_mises[i]),
            );
        }
    }
    let image = base64::engine::general_purpose::STANDARD.encode(raster.png(top));

    let (width, height) = (size[0] + 2.0 * MARGIN + LEGEND, size[1] + HEAD + FOOT);
    // Room for the title and the legends under narrow bodies.
    let (width, height) = (width.max(560.0), height.max(HEAD + FOOT + 190.0));
    let mut svg = String::new();
    let out = &mut svg;
    let mut put = |text: std::fmt::Arguments| {
        out.write_fmt(text)
            .expect("writing to a string cannot fail");
        out.push('\n');
    };
    put(format_args!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" role=\"img\" {STYLE}>"
    ));
    put(format_args!(
        "<title>{0}</title><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/><text x=\"{MARGIN}\" y=\"26\" font-size=\"16\" font-weight=\"600\">{0}</text>",
        escape(title)
    ));
    put(format_args!(
        "<text x=\"{MARGIN}\" y=\"46\" fill=\"#555555\">von Mises stress; displacements × {magnified}, the largest {} {}</text>",
        short(travel),
        escape(&elastic.units.length)
    ));
    put(format_args!("<g transform=\"translate({MARGIN} {HEAD})\">"));
    // Rigid obstacles, cut off a little outside the bodies.
    put(format_args!(
        "<clipPath id=\"field{number}\"><rect x=\"-14\" y=\"-10\" width=\"{:.1}\" height=\"{:.1}\"/></clipPath><g clip-path=\"url(#field{number})\" fill=\"#e2e2e2\" stroke=\"#9a9a9a\">",
        size[0] + 28.0,
        size[1] + 22.0
    ));
    for obstacle in elastic.pairs.iter().filter_map(|pair| pair.obstacle) {
        match obstacle {
            Obstacle::HalfPlane { point, normal } => {
                let length = normal[0].hypot(normal[1]);
                let [a, b] = normal.map(|v| v / length);
                let [x, y] = place(point);
                let angle = a.atan2(b).to_degrees();
                // Turned so that its inside lies below.
                put(format_args!(
                    "<rect x=\"-9999\" y=\"0\" width=\"19998\" height=\"9999\" transform=\"translate({x:.2} {y:.2}) rotate({angle:.4})\"/>"
                ));
            }
            Obstacle::Circle { center, radius } => {
                let [x, y] = place(center);
                put(format_args!(
                    "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{:.2}\"/>",
                    unit * radius
                ));
            }
        }
    }
    put(format_args!("</g>"));
    let edges = outline(mesh);
    let path = |edges: &[[u32; 2]], at: &[[f64; 2]]| {
        let mut path = String::new();
        let mut last = None;
        for &[a, b] in edges {
            let (p, q) = (place(at[a as usize]), place(at[b as usize]));
            if last != Some(a) {
                write!(path, "M{:.1} {:.1}", p[0], p[1]).expect("writing to a string cannot fail");
            }
            write!(path, "L{:.1} {:.1}", q[0], q[1]).expect("writing to a string cannot fail");
            last = Some(b);
        }
        path
    };
    put(format_args!(
        "<path d=\"{}\" fill=\"none\" stroke=\"#b5b5b5\"/>",
        path(&edges, &mesh.nodes)
    ));
    put(format_args!(
        "<image width=\"{:.1}\" height=\"{:.1}\" href=\"data:image/png;base64,{image}\"/>",
        raster.width as f64 / FINE,
        raster.height as f64 / FINE
    ));
    let typical = (mesh.areas().iter().sum::<f64>() / mesh.elements.len() as f64).sqrt() * unit;
    if typical > VISIBLE_EDGE {
        let mut inner: Vec<[u32; 2]> = mesh
            .elements
            .iter()
            .flat_map(|e| {
                let nodes = e.nodes();
                (0..nodes.len()).map(move |i| {
                    let (a, b) = (nodes[i], nodes[(i + 1) % nodes.len()]);
                    [a.min(b), a.max(b)]
                })
            })
            .collect();
        inner.sort_unstable();
        inner.dedup();
        put(format_args!(
            "<path d=\"{}\" fill=\"none\" stroke=\"#000000\" stroke-opacity=\"0.22\" stroke-width=\"0.6\"/>",
            path(&inner, &moved)
        ));
    }
    put(format_args!(
        "<path d=\"{}\" fill=\"none\" stroke=\"#222222\" stroke-width=\"1.1\"/>",
        path(&edges, &moved)
    ));
    let mut states = vec![
        ("contact", colour::PURPLE),
        ("stick", colour::BLUE),
        ("slip", colour::ORANGE),
        ("separated", "#ffffff"),
    ];
    // Bodies without friction know no stick and slip, and most with friction nothing else.
    let has_friction = (0..contact.pressure.len()).any(|i| contact.has_friction[i]);
    let without = (0..contact.pressure.len()).any(|i| contact.status(i) == "contact");
    states.retain(|&(state, _)| match state {
        "contact" => without,
        "separated" => true,
        _ => has_friction,
    });
    let radius =
        (0.25 * size[0].max(size[1]) / elastic.contact.nodes.len().max(1) as f64).clamp(1.6, 3.4);
    for &(state, fill) in &states {
        let mut dots = String::new();
        for (i, node) in elastic.contact.nodes.iter().enumerate() {
            if contact.status(i) == state {
                let [x, y] = place(moved[node.node as usize]);
                write!(
                    dots,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"/>"
                )
                .expect("writing to a string cannot fail");
            }
        }
        put(format_args!(
            "<g fill=\"{fill}\" stroke=\"#222222\" stroke-width=\"0.5\">{dots}</g>"
        ));
    }
    put(format_args!("</g>"));

    // The colour bar.
    let (x, y) = (MARGIN + size[0] + 30.0, HEAD + 22.0);
    let bar = (size[1].max(180.0) - 30.0).min(320.0);
    put(format_args!("<g transform=\"translate({x:.1} {y})\">"));
    let stops: String = (0..=10)
        .map(|k| {
            let [r, g, b] = viridis(f64::from(k) / 10.0);
            format!(
                "<stop offset=\"{}%\" stop-color=\"rgb({r},{g},{b})\"/>",
                10 * k
            )
        })
        .collect();
    put(format_args!(
        "<defs><linearGradient id=\"viridis{number}\" x1=\"0\" y1=\"1\" x2=\"0\" y2=\"0\">{stops}</linearGradient></defs>"
    ));
    put(format_args!(
        "<rect width=\"16\" height=\"{bar:.0}\" fill=\"url(#viridis{number})\" stroke=\"#222222\" stroke-width=\"0.6\"/><text y=\"-8\">{}</text>",
        escape(&elastic.units.stress())
    ));
    let step = nice(top / 8.0);
    let mut value = 0.0;
    while value <= top * (1.0 + 1e-9) {
        let at = bar * (1.0 - value / top);
        put(format_args!(
            "<path d=\"M16 {at:.1}h5\" stroke=\"#222222\"/><text x=\"25\" y=\"{:.1}\">{}</text>",
            at + 4.5,
            short(value)
        ));
        value += step;
    }
    put(format_args!("</g>"));
    if largest > top {
        put(format_args!(
            "<text x=\"{x:.1}\" y=\"{:.1}\" font-size=\"12\">largest {}</text>",
            y + bar + 18.0,
            short(largest)
        ));
    }
    if !elastic.contact.nodes.is_empty() {
        let mut at = MARGIN;
        for (state, fill) in states {
            put(format_args!(
                "<g transform=\"translate({at:.0} {:.0})\"><circle cx=\"5\" cy=\"-4.5\" r=\"4\" fill=\"{fill}\" stroke=\"#222222\" stroke-width=\"0.6\"/><text x=\"15\">{state}</text></g>",
                height - 14.0
            ));
            at += 30.0 + 8.0 * state.len() as f64;
        }
    }
    svg.push_str("</svg>\n");
    svg
}

/// A number of three digits.
fn short(value: f64) -> String {
    if value == 0.0 {
        "0".to_owned()
    } else if (0.01..1e4).contains(&value.abs()) {
        let digits = (2 - value.abs().log10().floor() as i32).max(0) as usize;
        let text = format!("{value:.digits$}");
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text
        }
    } else {
        let text = format!("{value:.2e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        let digits = digits.trim_end_matches('0').trim_end_matches('.');
        format!("{digits}e{exponent}")
    }
}
