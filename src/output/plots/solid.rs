//! Deformed solids with their von Mises stresses, from two sides.

use super::camera::Camera;
use super::chart::{STYLE, escape};
use super::legend::{self, ColourBar, magnification, short};
use super::obstacles::{Patch, patches};
use super::raster::png;
use super::surface::Surface;
use super::zbuffer::{Corner, ZBuffer};
use crate::mesh::facet_nodes;
use crate::mesh::vector::{bounds, cross, dot, length, minus};
use crate::model::Elastic;
use crate::output::{ContactFields, StepFields, put};
use base64::Engine as _;

/// Room for both views.
const WIDTH: f64 = 780.0;
const HEIGHT: f64 = 620.0;
/// Between them, and around.
const GAP: f64 = 40.0;
const MARGIN: f64 = 26.0;
const LEGEND: f64 = 110.0;
const HEAD: f64 = 70.0;
const FOOT: f64 = 50.0;
/// Pixels per unit of the picture.
const FINE: f64 = 2.0;
/// Edges of elements are drawn where these are longer than this on average.
const VISIBLE_EDGE: f64 = 8.0;
/// Lines are hidden and seen in pieces of this length.
const PIECE: f64 = 1.5;

/// What all pictures and views of a step are made of.
pub(super) struct Solids<'a> {
    pub elastic: &'a Elastic<3>,
    pub fields: &'a StepFields<3>,
    pub contact: &'a ContactFields<3>,
    pub surface: Surface,
    pub obstacles: Vec<Patch>,
    /// At the nodes.
    pub von_mises: Vec<f64>,
    /// The largest of all, and the one with the last of the colours.
    pub largest: f64,
    pub top: f64,
    /// The largest displacement, and what all are multiplied with.
    pub travel: f64,
    pub magnified: f64,
}

impl<'a> Solids<'a> {
    pub fn new(
        elastic: &'a Elastic<3>,
        fields: &'a StepFields<3>,
        contact: &'a ContactFields<3>,
    ) -> Self {
        let von_mises: Vec<f64> = fields.at_nodes.iter().map(|s| s.von_mises()).collect();
        let surface = Surface::new(&elastic.mesh);
        let seen: Vec<f64> = (surface.vertices.iter())
            .map(|vertex| von_mises[vertex.node as usize])
            .collect();
        let travel = (fields.displacement.iter().copied())
            .map(length)
            .fold(0.0, f64::max);
        Self {
            elastic,
            fields,
            contact,
            surface,
            obstacles: patches(elastic),
            largest: von_mises.iter().copied().fold(0.0, f64::max),
            top: legend::top(&seen),
            von_mises,
            travel,
            magnified: magnification(elastic, travel, contact),
        }
    }

    /// The picture of a step. `number` keeps the names in it apart from those of other pictures on the same page.
    pub fn svg(&self, title: &str, number: usize) -> String {
        let mesh = &self.elastic.mesh;
        let moved: Vec<[f64; 3]> = (mesh.nodes.iter().zip(&self.fields.displacement))
            .map(|(x, u)| std::array::from_fn(|c| x[c] + self.magnified * u[c]))
            .collect();
        let cameras = Camera::pair(mesh, &self.surface, &self.von_mises);
        let nodes = || {
            self.surface
                .vertices
                .iter()
                .map(|vertex| vertex.node as usize)
        };
        let boxes = cameras.map(|camera| {
            let bodies = nodes().flat_map(|i| [mesh.nodes[i], moved[i]]);
            let around = self.obstacles.iter().flat_map(|patch| patch.rows.iter());
            let places = bodies.chain(around.flatten().copied());
            bounds(places.map(|x| camera.flat(x)))
        });
        let layout = Layout::new(boxes.map(|(low, high)| minus(high, low)));
        let views: [View; 2] = std::array::from_fn(|k| View {
            solids: self,
            moved: &moved,
            camera: cameras[k],
            corner: [boxes[k].0[0], boxes[k].1[1]],
            unit: layout.unit,
            size: layout.sizes[k],
        });
        let drawn = {
            let [a, b] = &views;
            let (a, b) = rayon::join(|| a.draw(), || b.draw());
            [a, b]
        };
        let mut svg = String::new();
        self.head(&mut svg, title, &layout);
        for ((view, drawn), [x, y]) in views.iter().zip(drawn).zip(layout.places) {
            let caption = view.camera.name();
            put(
                &mut svg,
                format_args!(
                    "<g transform=\"translate({x:.1} {y:.1})\"><text x=\"0\" y=\"-10\" font-size=\"12\" fill=\"#555555\">seen from {caption}</text>"
                ),
            );
            svg += &drawn;
            svg += "</g>\n";
        }
        let bar = ColourBar {
            name: format!("mises{number}"),
            unit: &self.elastic.units.stress(),
            top: self.top,
            largest: self.largest,
            height: (layout.height - HEAD - FOOT - 30.0).clamp(140.0, 320.0),
        };
        bar.draw(&mut svg, [layout.width - LEGEND, HEAD + 22.0]);
        svg + "</svg>\n"
    }

    /// The beginning of the file, the title, what is shown.
    fn head(&self, svg: &mut String, title: &str, layout: &Layout) {
        let (title, width, height) = (escape(title), layout.width, layout.height);
        put(
            svg,
            format_args!(
                "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" role=\"img\" {STYLE}>"
            ),
        );
        let (magnified, travel) = (self.magnified, short(self.travel));
        let length = escape(&self.elastic.units.length);
        put(
            svg,
            format_args!(
                "<title>{title}</title><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/><text x=\"{MARGIN}\" y=\"26\" font-size=\"16\" font-weight=\"600\">{title}</text><text x=\"{MARGIN}\" y=\"46\" fill=\"#555555\">von Mises stress; displacements × {magnified}, the largest {travel} {length}; grey lines: before</text>"
            ),
        );
    }
}

/// Where the two views stand.
struct Layout {
    /// Units of the picture per unit of length.
    unit: f64,
    sizes: [[f64; 2]; 2],
    places: [[f64; 2]; 2],
    width: f64,
    height: f64,
}

impl Layout {
    /// For views of these sizes: beside each other or one below the other, whichever makes them larger.
    fn new([a, b]: [[f64; 2]; 2]) -> Self {
        // What has no width is no reason to divide by zero.
        let positive = |v: f64| v.max(f64::MIN_POSITIVE);
        let (widest, highest) = (positive(a[0].max(b[0])), positive(a[1].max(b[1])));
        let beside = ((WIDTH - GAP) / positive(a[0] + b[0])).min(0.75 * HEIGHT / highest);
        let below = (WIDTH / widest).min((HEIGHT - 2.0 * GAP) / positive(a[1] + b[1]));
        let is_beside = beside > 0.85 * below;
        let unit = if is_beside { beside } else { below };
        let sizes = [a, b].map(|size| size.map(|v| unit * v));
        let (width, height) = if is_beside {
            (sizes[0][0] + GAP + sizes[1][0], unit * highest)
        } else {
            (unit * widest, sizes[0][1] + 2.0 * GAP + sizes[1][1])
        };
        let height = height.max(190.0);
        // Narrow bodies stand in the middle under a long title.
        let left = MARGIN + 0.5 * (460.0 - width).max(0.0);
        let second = if is_beside {
            [left + sizes[0][0] + GAP, HEAD + 10.0]
        } else {
            [left, HEAD + 10.0 + sizes[0][1] + 2.0 * GAP]
        };
        Self {
            unit,
            sizes,
            places: [[left, HEAD + 10.0], second],
            width: left + width.max(460.0) + 40.0 + LEGEND,
            height: height + HEAD + 10.0 + FOOT,
        }
    }
}

/// The bodies from one side, on their way to a picture.
struct View<'a> {
    solids: &'a Solids<'a>,
    /// Where the nodes are drawn.
    moved: &'a [[f64; 3]],
    camera: Camera,
    /// The left and upper end of the field, as the camera sees it.
    corner: [f64; 2],
    unit: f64,
    size: [f64; 2],
}

impl View<'_> {
    /// A place in the field, in units of the picture: to the right, down, and towards the viewer.
    fn place(&self, x: [f64; 3]) -> [f64; 3] {
        let [right, up] = self.camera.flat(x);
        [
            self.unit * (right - self.corner[0]),
            self.unit * (self.corner[1] - up),
            self.unit * dot(self.camera.back, x),
        ]
    }

    /// The whole view.
    fn draw(&self) -> String {
        // For what is on the border of the field.
        const ROOM: f64 = 4.0;
        let pixels = |size: f64| (FINE * (size + 2.0 * ROOM)).ceil().max(1.0) as usize;
        let mut buffer = ZBuffer::new(pixels(self.size[0]), pixels(self.size[1]));
        let in_pixels = |x: [f64; 3]| {
            let [a, b, depth] = self.place(x);
            [FINE * (a + ROOM), FINE * (b + ROOM), FINE * depth]
        };
        let places: Vec<[f64; 3]> = self.moved.iter().map(|&x| in_pixels(x)).collect();
        self.bodies(&mut buffer, &places);
        for triangle in self.solids.obstacles.iter().flat_map(Patch::triangles) {
            buffer.veil(triangle.map(in_pixels));
        }
        let mut svg = String::new();
        let back = |at: [f64; 3]| [at[0] / FINE - ROOM, at[1] / FINE - ROOM];
        let surface = &self.solids.surface;
        let sharp = || surface.edges.iter().filter(|edge| edge.sharp);
        let mesh = &self.solids.elastic.mesh;
        let before: String = sharp()
            .map(|edge| {
                let [p, q] = edge.ends.map(|node| self.place(mesh.nodes[node as usize]));
                format!("M{:.1} {:.1}L{:.1} {:.1}", p[0], p[1], q[0], q[1])
            })
            .collect();
        put(
            &mut svg,
            format_args!("<path d=\"{before}\" fill=\"none\" stroke=\"#b5b5b5\"/>"),
        );
        let image = png(buffer.width, buffer.height, &buffer.pixels(self.solids.top));
        let image = base64::engine::general_purpose::STANDARD.encode(image);
        put(
            &mut svg,
            format_args!(
                "<image x=\"-{ROOM}\" y=\"-{ROOM}\" width=\"{:.1}\" height=\"{:.1}\" href=\"data:image/png;base64,{image}\"/>",
                buffer.width as f64 / FINE,
                buffer.height as f64 / FINE
            ),
        );
        let seen = |lines: &mut dyn Iterator<Item = [[f64; 3]; 2]>| -> String {
            let mut path = Path::default();
            lines.for_each(|line| path.add(&buffer, line, &back));
            path.text
        };
        let of_edges = |ends: [u32; 2]| ends.map(|node| places[node as usize]);
        let style = |path: String, style: &str, svg: &mut String| {
            if !path.is_empty() {
                put(
                    svg,
                    format_args!("<path d=\"{path}\" fill=\"none\" {style}/>"),
                );
            }
        };
        let borders = self.solids.obstacles.iter().flat_map(Patch::outline);
        let borders: Vec<Vec<[f64; 3]>> = borders
            .map(|line| line.into_iter().map(in_pixels).collect())
            .collect();
        let mut pieces = (borders.iter()).flat_map(|line| line.windows(2).map(|w| [w[0], w[1]]));
        style(seen(&mut pieces), "stroke=\"#9a9a9a\"", &mut svg);
        if self.shows_elements() {
            let mut all = surface
                .edges
                .iter()
                .filter(|e| !e.sharp)
                .map(|e| of_edges(e.ends));
            let thin = "stroke=\"#000000\" stroke-opacity=\"0.2\" stroke-width=\"0.6\"";
            style(seen(&mut all), thin, &mut svg);
        }
        let contours = self.contours();
        let mut outlines = sharp().chain(contours).map(|e| of_edges(e.ends));
        let dark = "stroke=\"#222222\" stroke-linecap=\"round\"";
        style(seen(&mut outlines), dark, &mut svg);
        self.axes(&mut svg);
        svg
    }

    /// The surface of the bodies with its stresses, lit from beside the viewer.
    fn bodies(&self, buffer: &mut ZBuffer, places: &[[f64; 3]]) {
        let surface = &self.solids.surface;
        let values = &self.solids.von_mises;
        for facet in &surface.facets {
            let corners = facet.corners();
            let mut all = [Corner {
                at: [0.0; 3],
                value: 0.0,
                shade: 0.0,
            }; 4];
            for (corner, &number) in all.iter_mut().zip(corners) {
                let vertex = surface.vertices[number as usize];
                *corner = Corner {
                    at: places[vertex.node as usize],
                    value: values[vertex.node as usize],
                    shade: self.camera.shade(vertex.normal),
                };
            }
            let [a, b, c, d] = all;
            if corners.len() == 3 {
                buffer.triangle([a, b, c]);
                continue;
            }
            // Four triangles around the middle, so that no diagonal shows.
            let mean = |of: &dyn Fn(&Corner) -> f64| all.iter().map(of).sum::<f64>() / 4.0;
            let middle = Corner {
                at: std::array::from_fn(|k| mean(&|corner| corner.at[k])),
                value: mean(&|corner| corner.value),
                shade: mean(&|corner| corner.shade),
            };
            for [p, q] in [[a, b], [b, c], [c, d], [d, a]] {
                buffer.triangle([p, q, middle]);
            }
        }
    }

    /// Whether the edges of elements have room between them.
    fn shows_elements(&self) -> bool {
        let edges = &self.solids.surface.edges;
        let place = |node: u32| self.place(self.moved[node as usize]);
        let lengths = edges.iter().map(|edge| {
            let [p, q] = edge.ends.map(place);
            (p[0] - q[0]).hypot(p[1] - q[1])
        });
        lengths.sum::<f64>() > VISIBLE_EDGE * edges.len() as f64
    }

    /// The edges where the surface turns away from the viewer.
    fn contours(&self) -> impl Iterator<Item = &super::surface::Edge> {
        let facets = &self.solids.surface.facets;
        let turned: Vec<bool> = (facets.iter())
            .map(|facet| {
                let nodes = facet_nodes(&facet.nodes);
                let place = |k: usize| self.moved[nodes[k] as usize];
                let last = nodes.len() - 1;
                // Of both diagonals; of a triangle two edges.
                let first = minus(place(2.min(last)), place(0));
                let second = minus(place(last), place(1));
                dot(cross(first, second), self.camera.back) < 0.0
            })
            .collect();
        let edges = self.solids.surface.edges.iter();
        edges.filter(move |edge| {
            let [a, b] = edge.facets.map(|facet| turned[facet as usize]);
            !edge.sharp && a != b
        })
    }

    /// The directions of the axes, in the lower left corner.
    fn axes(&self, svg: &mut String) {
        const LENGTH: f64 = 26.0;
        let origin = [14.0, self.size[1] + 30.0];
        // Those that point away from the viewer first.
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| self.camera.back[a].total_cmp(&self.camera.back[b]));
        for axis in order {
            let mut direction = [0.0; 3];
            direction[axis] = 1.0;
            let [a, b] = self.camera.flat(direction);
            let (x, y) = (origin[0] + LENGTH * a, origin[1] - LENGTH * b);
            let (tx, ty) = (
                origin[0] + 1.36 * LENGTH * a,
                origin[1] - 1.36 * LENGTH * b + 4.0,
            );
            let name = ["x", "y", "z"][axis];
            put(
                svg,
                format_args!(
                    "<path d=\"M{:.1} {:.1}L{x:.1} {y:.1}\" stroke=\"#444444\" stroke-width=\"1.6\" stroke-linecap=\"round\"/><text x=\"{tx:.1}\" y=\"{ty:.1}\" font-size=\"12\" text-anchor=\"middle\" fill=\"#444444\">{name}</text>",
                    origin[0], origin[1]
                ),
            );
        }
    }
}

/// Lines as far as they are seen.
#[derive(Default)]
struct Path {
    text: String,
}

impl Path {
    /// The parts of a line that no body hides; `back` gives units of the picture for pixels.
    fn add(
        &mut self,
        buffer: &ZBuffer,
        [p, q]: [[f64; 3]; 2],
        back: &dyn Fn([f64; 3]) -> [f64; 2],
    ) {
        let long = (q[0] - p[0]).hypot(q[1] - p[1]) / FINE;
        let pieces = (long / PIECE).ceil().clamp(1.0, 4000.0) as usize;
        let at = |k: f64| std::array::from_fn(|c| p[c] + k / pieces as f64 * (q[c] - p[c]));
        let mut drawing = false;
        for k in 0..=pieces {
            let seen = k < pieces && !buffer.hides(at(k as f64 + 0.5));
            if seen != drawing {
                let [x, y] = back(at(k as f64));
                let command = if seen { 'M' } else { 'L' };
                self.text += &format!("{command}{x:.1} {y:.1}");
                drawing = seen;
            }
        }
    }
}
