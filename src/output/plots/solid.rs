//! Deformed solids with their von Mises stresses, from two sides.

use super::bodies::Bodies;
use super::camera::Camera;
use super::legend::top;
use super::obstacles::{Patch, patches};
use super::raster::{FINE, pixels};
use super::surface::{Edge, Surface};
use super::svg::{Svg, line};
use super::zbuffer::{Corner, ZBuffer};
use crate::mesh::facet_nodes;
use crate::mesh::vector::{bounds, cross, dot, minus};

/// Room for both views.
const WIDTH: f64 = 780.0;
const HEIGHT: f64 = 620.0;
/// Between them, and around.
const GAP: f64 = 40.0;
const MARGIN: f64 = 26.0;
const LEGEND: f64 = 110.0;
const HEAD: f64 = 80.0;
const FOOT: f64 = 50.0;
/// Around a view, for lines on its border.
const ROOM: f64 = 4.0;
/// Edges of elements are drawn where these are longer than this on average.
const VISIBLE_EDGE: f64 = 8.0;
/// Lines are hidden and seen in pieces of this length.
const PIECE: f64 = 1.5;

/// The data of the picture and the view of a step.
pub(super) struct Solids<'a> {
    pub bodies: &'a Bodies<'a, 3>,
    pub surface: Surface,
    /// The stress with the last of the colours.
    pub top: f64,
    pub obstacles: Vec<Patch>,
    /// From both sides.
    pub cameras: [Camera; 2],
}

impl<'a> Solids<'a> {
    pub fn new(bodies: &'a Bodies<'a, 3>) -> Self {
        let mesh = &bodies.elastic.mesh;
        let surface = Surface::new(mesh);
        let seen = surface.vertices.iter().map(|vertex| vertex.node as usize);
        let seen: Vec<f64> = seen.map(|node| bodies.von_mises[node]).collect();
        Self {
            cameras: Camera::pair(mesh, &surface, &bodies.von_mises),
            obstacles: patches(bodies.elastic),
            top: top(&seen),
            bodies,
            surface,
        }
    }

    /// The picture.
    pub fn svg(&self, title: &str) -> String {
        let (nodes, moved) = (&self.bodies.elastic.mesh.nodes, &self.bodies.moved);
        let boxes = self.cameras.map(|camera| {
            let seen = self.surface.vertices.iter().map(|v| v.node as usize);
            let bodies = seen.flat_map(|i| [nodes[i], moved[i]]);
            let around = self.obstacles.iter().flat_map(|patch| patch.rows.iter());
            let places = bodies.chain(around.flatten().copied());
            bounds(places.map(|x| camera.flat(x)))
        });
        let layout = Layout::new(boxes.map(|(low, high)| minus(high, low)));
        let views: [View; 2] = std::array::from_fn(|k| View {
            solids: self,
            camera: self.cameras[k],
            corner: [boxes[k].0[0], boxes[k].1[1]],
            unit: layout.unit,
            size: layout.sizes[k],
        });
        let (first, second) = rayon::join(|| views[0].draw(), || views[1].draw());
        let [width, height] = layout.size;
        let more = "; grey lines: before";
        let mut svg = self.bodies.head(title, layout.size, MARGIN, more);
        for ((view, drawn), place) in views.iter().zip([first, second]).zip(layout.places) {
            let caption = view.camera.name();
            svg.open(place);
            svg.put(format_args!(
                "<text x=\"0\" y=\"-10\" font-size=\"12\" fill=\"#555555\">seen from {caption}</text>"
            ));
            svg.text += &drawn.text;
            svg.close();
        }
        let bar = (height - HEAD - FOOT - 20.0).clamp(140.0, 320.0);
        let place = [width - LEGEND, HEAD + 12.0];
        self.bodies.colour_bar(&mut svg, self.top, place, bar);
        svg.finish()
    }
}

/// The positions of the two views.
struct Layout {
    /// Units of the picture per unit of length.
    unit: f64,
    sizes: [[f64; 2]; 2],
    places: [[f64; 2]; 2],
    /// Of the whole picture.
    size: [f64; 2],
}

impl Layout {
    /// For views of these sizes: beside each other or one below the other, whichever makes them larger.
    fn new([a, b]: [[f64; 2]; 2]) -> Self {
        // A view without width must not lead to a division by zero.
        let positive = |v: f64| v.max(f64::MIN_POSITIVE);
        let (widest, highest) = (positive(a[0].max(b[0])), positive(a[1].max(b[1])));
        let beside = ((WIDTH - GAP) / positive(a[0] + b[0])).min(0.75 * HEIGHT / highest);
        let below = (WIDTH / widest).min((HEIGHT - 2.0 * GAP) / positive(a[1] + b[1]));
        let is_beside = beside > 0.85 * below;
        let unit = if is_beside { beside } else { below };
        let sizes = [a, b].map(|size| size.map(|v| unit * v));
        // From the first view to the second.
        let [right, down] = if is_beside {
            [sizes[0][0] + GAP, 0.0]
        } else {
            [0.0, sizes[0][1] + 2.0 * GAP]
        };
        let width = (unit * widest).max(right + sizes[1][0]);
        let height = (unit * highest).max(down + sizes[1][1]).max(190.0);
        // Narrow bodies are centred under a long title.
        let left = MARGIN + 0.5 * (460.0 - width).max(0.0);
        Self {
            unit,
            sizes,
            places: [[left, HEAD], [left + right, HEAD + down]],
            size: [
                left + width.max(460.0) + 40.0 + LEGEND,
                HEAD + height + FOOT,
            ],
        }
    }
}

/// The bodies from one side, on their way to a picture.
struct View<'a> {
    solids: &'a Solids<'a>,
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

    /// The same in pixels of the image.
    fn pixel(&self, x: [f64; 3]) -> [f64; 3] {
        let [a, b, depth] = self.place(x);
        [a + ROOM, b + ROOM, depth].map(|v| FINE * v)
    }

    /// The whole view.
    fn draw(&self) -> Svg {
        let (surface, obstacles) = (&self.solids.surface, &self.solids.obstacles);
        let bodies = self.solids.bodies;
        let [width, height] = self.size.map(|v| pixels(v + 2.0 * ROOM));
        let mut buffer = ZBuffer::new(width, height);
        let places: Vec<[f64; 3]> = bodies.moved.iter().map(|&x| self.pixel(x)).collect();
        self.bodies(&mut buffer, &places);
        for triangle in obstacles.iter().flat_map(Patch::triangles) {
            buffer.veil(triangle.map(|x| self.pixel(x)));
        }
        let nodes = &bodies.elastic.mesh.nodes;
        let (image, (before, lines)) = rayon::join(
            || buffer.png(self.solids.top),
            || {
                let before: String = (surface.edges.iter().filter(|edge| edge.sharp))
                    .map(|edge| edge.ends.map(|node| self.place(nodes[node as usize])))
                    .map(|ends| line(ends.map(|[x, y, _]| [x, y])))
                    .collect();
                let mut svg = Svg::default();
                self.lines(&mut svg, &buffer, &places);
                (before, svg.text)
            },
        );
        let mut svg = Svg::default();
        svg.path(&before, "stroke=\"#b5b5b5\"");
        let size = [width, height].map(|v| v as f64 / FINE);
        svg.image([-ROOM; 2], size, &image);
        svg.text += &lines;
        self.axes(&mut svg);
        svg
    }

    /// The borders of obstacles, the edges of elements and the outlines, where visible.
    fn lines(&self, svg: &mut Svg, buffer: &ZBuffer, places: &[[f64; 3]]) {
        let edges = &self.solids.surface.edges;
        let seen = |lines: &mut dyn Iterator<Item = [[f64; 3]; 2]>| {
            let mut path = String::new();
            lines.for_each(|line| add_seen(&mut path, buffer, line));
            path
        };
        let of_edge = |edge: &Edge| edge.ends.map(|node| places[node as usize]);
        let borders = self.solids.obstacles.iter().flat_map(Patch::outline);
        let mut borders = borders.flat_map(|line| {
            let line: Vec<_> = line.into_iter().map(|x| self.pixel(x)).collect();
            line.windows(2).map(|w| [w[0], w[1]]).collect::<Vec<_>>()
        });
        svg.path(&seen(&mut borders), "stroke=\"#9a9a9a\"");
        let of_elements = || edges.iter().filter(|edge| edge.share > 0.0);
        let lengths = of_elements().map(of_edge).map(|[p, q]| {
            let [x, y, _] = minus(p, q);
            x.hypot(y) / FINE
        });
        // Only where they have room between them.
        let count: f64 = edges.iter().map(|edge| edge.share).sum();
        if lengths.sum::<f64>() > VISIBLE_EDGE * count {
            let mut all = of_elements().filter(|e| !e.sharp).map(of_edge);
            let thin = "stroke=\"#000000\" stroke-opacity=\"0.2\" stroke-width=\"0.6\"";
            svg.path(&seen(&mut all), thin);
        }
        let sharp = edges.iter().filter(|edge| edge.sharp);
        let mut outlines = sharp.chain(self.contours()).map(of_edge);
        let dark = "stroke=\"#222222\" stroke-linecap=\"round\"";
        svg.path(&seen(&mut outlines), dark);
    }

    /// The surface of the bodies with its stresses, lit from beside the viewer.
    fn bodies(&self, buffer: &mut ZBuffer, places: &[[f64; 3]]) {
        let surface = &self.solids.surface;
        for facet in &surface.facets {
            let corners = facet.vertices.map(|number| {
                let vertex = surface.vertices[number as usize];
                let node = vertex.node as usize;
                Corner {
                    at: places[node],
                    value: self.solids.bodies.von_mises[node],
                    shade: self.camera.shade(vertex.normal),
                }
            });
            let [a, b, c, d] = corners;
            if facet.corners().len() == 3 {
                buffer.triangle([a, b, c]);
                continue;
            }
            // Four triangles around the middle, so that no diagonal shows.
            let mean = |of: &dyn Fn(&Corner) -> f64| corners.iter().map(of).sum::<f64>() / 4.0;
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

    /// The edges where the surface turns away from the viewer.
    fn contours(&self) -> impl Iterator<Item = &Edge> {
        let facets = &self.solids.surface.facets;
        let turned: Vec<bool> = (facets.iter())
            .map(|facet| {
                let nodes = facet_nodes(&facet.nodes);
                let place = |k: usize| self.solids.bodies.moved[nodes[k] as usize];
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
    fn axes(&self, svg: &mut Svg) {
        const LENGTH: f64 = 26.0;
        let origin = [14.0, self.size[1] + 30.0];
        // Those that point away from the viewer first.
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| self.camera.back[a].total_cmp(&self.camera.back[b]));
        for axis in order {
            let (a, b) = (self.camera.right[axis], self.camera.up[axis]);
            let at = |part: f64| [origin[0] + part * LENGTH * a, origin[1] - part * LENGTH * b];
            let path = line([origin, at(1.0)]);
            let ([x, y], name) = (at(1.36), ["x", "y", "z"][axis]);
            svg.path(
                &path,
                "stroke=\"#444444\" stroke-width=\"1.6\" stroke-linecap=\"round\"",
            );
            svg.put(format_args!(
                "<text x=\"{x:.1}\" y=\"{:.1}\" font-size=\"12\" text-anchor=\"middle\" fill=\"#444444\">{name}</text>",
                y + 4.0
            ));
        }
    }
}

/// Adds the parts of a line, its ends in pixels, that no body hides.
fn add_seen(path: &mut String, buffer: &ZBuffer, [p, q]: [[f64; 3]; 2]) {
    let long = (q[0] - p[0]).hypot(q[1] - p[1]) / FINE;
    let pieces = (long / PIECE).ceil().clamp(1.0, 4000.0) as usize;
    let at = |k: f64| std::array::from_fn(|c| p[c] + k / pieces as f64 * (q[c] - p[c]));
    let mut drawing = false;
    for k in 0..=pieces {
        let seen = k < pieces && !buffer.hides(at(k as f64 + 0.5));
        if seen != drawing {
            let [x, y, _] = at(k as f64).map(|v: f64| v / FINE - ROOM);
            let command = if seen { 'M' } else { 'L' };
            *path += &format!("{command}{x:.1} {y:.1}");
            drawing = seen;
        }
    }
}
