//! The deformed mesh with its von Mises stresses: a raster image of the field inside an SVG.

use super::chart::{STYLE, escape};
use super::legend::{self, ColourBar, magnification, short};
use super::raster::Raster;
use crate::contact::Obstacle;
use crate::mesh::{Mesh, bounds};
use crate::model::Elastic;
use crate::output::{ContactFields, StepFields, put};
use base64::Engine as _;
use std::collections::HashMap;

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
/// The edges of the elements, each once, from the lower to the higher node, and how many elements have it.
fn edges(mesh: &Mesh) -> Vec<([u32; 2], usize)> {
    let mut count: HashMap<[u32; 2], usize> = HashMap::new();
    for element in &mesh.elements {
        let nodes = element.nodes();
        for (i, &a) in nodes.iter().enumerate() {
            let b = nodes[(i + 1) % nodes.len()];
            *count.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let mut edges: Vec<_> = count.into_iter().collect();
    edges.sort_unstable();
    edges
}

/// The picture of a step. `number` keeps the names in it apart from those of other pictures on the same page.
pub(super) fn svg(
    title: &str,
    number: usize,
    elastic: &Elastic,
    fields: &StepFields,
    contact: &ContactFields,
) -> String {
    let mut scene = Scene::new(number, elastic, fields, contact);
    scene.head(title);
    scene.put(format_args!("<g transform=\"translate({MARGIN} {HEAD})\">"));
    scene.obstacles();
    scene.bodies();
    scene.contact_places();
    scene.put(format_args!("</g>"));
    scene.colour_bar();
    scene.legend();
    scene.svg + "</svg>\n"
}

/// The deformed bodies on their way to a picture.
struct Scene<'a> {
    number: usize,
    elastic: &'a Elastic,
    contact: &'a ContactFields,
    /// The largest displacement, and what all are multiplied with.
    travel: f64,
    magnified: f64,
    /// Where the nodes are drawn, in coordinates of the mesh.
    moved: Vec<[f64; 2]>,
    /// The left and upper ends of the field, and units of the picture per unit of length.
    corner: [f64; 2],
    unit: f64,
    /// Width and height of the field, in units of the picture.
    size: [f64; 2],
    /// At the nodes.
    von_mises: Vec<f64>,
    largest: f64,
    /// The stress with the last of the colours.
    top: f64,
    svg: String,
}

impl<'a> Scene<'a> {
    fn new(
        number: usize,
        elastic: &'a Elastic,
        fields: &StepFields,
        contact: &'a ContactFields,
    ) -> Self {
        let mesh = &elastic.mesh;
        let lengths = fields.displacement.iter().map(|u| u[0].hypot(u[1]));
        let travel = lengths.fold(0.0, f64::max);
        let magnified = magnification(elastic, travel, contact);
        let moved: Vec<[f64; 2]> = (mesh.nodes.iter().zip(&fields.displacement))
            .map(|(x, u)| [x[0] + magnified * u[0], x[1] + magnified * u[1]])
            .collect();
        let (low, high) = bounds(mesh.nodes.iter().chain(&moved).copied());
        let unit = (FIELD_WIDTH / (high[0] - low[0])).min(FIELD_HEIGHT / (high[1] - low[1]));

        let von_mises: Vec<f64> = fields.at_nodes.iter().map(|s| s.von_mises()).collect();
        let largest = von_mises.iter().copied().fold(0.0, f64::max);
        let top = legend::top(&von_mises);
        Self {
            number,
            elastic,
            contact,
            travel,
            magnified,
            moved,
            corner: [low[0], high[1]],
            unit,
            size: [unit * (high[0] - low[0]), unit * (high[1] - low[1])],
            von_mises,
            largest,
            top,
            svg: String::new(),
        }
    }

    fn put(&mut self, line: std::fmt::Arguments) {
        put(&mut self.svg, line);
    }

    /// A place of the mesh in the field; y goes down.
    fn place(&self, x: [f64; 2]) -> [f64; 2] {
        [
            self.unit * (x[0] - self.corner[0]),
            self.unit * (self.corner[1] - x[1]),
        ]
    }

    /// Of the whole picture, with room for the title and the legends beside narrow bodies.
    fn height(&self) -> f64 {
        (self.size[1] + HEAD + FOOT).max(HEAD + FOOT + 190.0)
    }

    /// The beginning of the file, the title, what is shown.
    fn head(&mut self, title: &str) {
        let (title, height) = (escape(title), self.height());
        let width = (self.size[0] + 2.0 * MARGIN + LEGEND).max(560.0);
        self.put(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" height=\"{height:.0}\" role=\"img\" {STYLE}>"
        ));
        self.put(format_args!(
            "<title>{title}</title><rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/><text x=\"{MARGIN}\" y=\"26\" font-size=\"16\" font-weight=\"600\">{title}</text>"
        ));
        let (magnified, travel) = (self.magnified, short(self.travel));
        let length = escape(&self.elastic.units.length);
        self.put(format_args!(
            "<text x=\"{MARGIN}\" y=\"46\" fill=\"#555555\">von Mises stress; displacements × {magnified}, the largest {travel} {length}</text>"
        ));
    }

    /// Rigid obstacles, cut off a little outside the bodies.
    fn obstacles(&mut self) {
        let number = self.number;
        let [width, height] = [self.size[0] + 28.0, self.size[1] + 22.0];
        self.put(format_args!(
            "<clipPath id=\"field{number}\"><rect x=\"-14\" y=\"-10\" width=\"{width:.1}\" height=\"{height:.1}\"/></clipPath><g clip-path=\"url(#field{number})\" fill=\"#e2e2e2\" stroke=\"#9a9a9a\">"
        ));
        for obstacle in self.elastic.pairs.iter().filter_map(|pair| pair.obstacle) {
            match obstacle {
                Obstacle::HalfPlane { point, normal } => {
                    let length = normal[0].hypot(normal[1]);
                    let [a, b] = normal.map(|v| v / length);
                    let [x, y] = self.place(point);
                    let angle = a.atan2(b).to_degrees();
                    // Turned so that its inside lies below.
                    self.put(format_args!(
                        "<rect x=\"-9999\" y=\"0\" width=\"19998\" height=\"9999\" transform=\"translate({x:.2} {y:.2}) rotate({angle:.4})\"/>"
                    ));
                }
                Obstacle::Circle { center, radius } => {
                    let ([x, y], r) = (self.place(center), self.unit * radius);
                    self.put(format_args!(
                        "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{r:.2}\"/>"
                    ));
                }
                Obstacle::Cylinder { .. } => {}
            }
        }
        self.put(format_args!("</g>"));
    }

    /// The stresses in the deformed bodies, between the outlines before and after; edges of elements where there is room.
    fn bodies(&mut self) {
        let mesh = &self.elastic.mesh;
        let all = edges(mesh);
        let outer = all.iter().filter(|(_, elements)| *elements == 1);
        let outline: Vec<[u32; 2]> = outer.map(|&(edge, _)| edge).collect();
        let before = self.path(&outline, &mesh.nodes);
        self.put(format_args!(
            "<path d=\"{before}\" fill=\"none\" stroke=\"#b5b5b5\"/>"
        ));
        let raster = self.stresses();
        let image = base64::engine::general_purpose::STANDARD.encode(raster.png(self.top));
        self.put(format_args!(
            "<image width=\"{:.1}\" height=\"{:.1}\" href=\"data:image/png;base64,{image}\"/>",
            raster.width as f64 / FINE,
            raster.height as f64 / FINE
        ));
        let area = mesh.measures().iter().sum::<f64>() / mesh.elements.len() as f64;
        if area.sqrt() * self.unit > VISIBLE_EDGE {
            let all: Vec<[u32; 2]> = all.iter().map(|&(edge, _)| edge).collect();
            let path = self.path(&all, &self.moved);
            self.put(format_args!(
                "<path d=\"{path}\" fill=\"none\" stroke=\"#000000\" stroke-opacity=\"0.22\" stroke-width=\"0.6\"/>"
            ));
        }
        let after = self.path(&outline, &self.moved);
        self.put(format_args!(
            "<path d=\"{after}\" fill=\"none\" stroke=\"#222222\" stroke-width=\"1.1\"/>"
        ));
    }

    /// Lines along edges, between nodes at these places.
    fn path(&self, edges: &[[u32; 2]], at: &[[f64; 2]]) -> String {
        let mut path = String::new();
        let mut last = None;
        for &[a, b] in edges {
            let [p, q] = [a, b].map(|node| self.place(at[node as usize]));
            if last != Some(a) {
                path += &format!("M{:.1} {:.1}", p[0], p[1]);
            }
            path += &format!("L{:.1} {:.1}", q[0], q[1]);
            last = Some(b);
        }
        path
    }

    /// The von Mises stress in the pixels of the field.
    fn stresses(&self) -> Raster {
        let pixels = |size: f64| (FINE * size).ceil().max(1.0) as usize;
        let mut raster = Raster::new(pixels(self.size[0]), pixels(self.size[1]));
        for element in &self.elastic.mesh.elements {
            let nodes = element.nodes();
            for k in 1..nodes.len() - 1 {
                let corners = [nodes[0], nodes[k], nodes[k + 1]].map(|node| node as usize);
                raster.triangle(
                    corners.map(|i| self.place(self.moved[i]).map(|v| FINE * v)),
                    corners.map(|i| self.von_mises[i]),
                );
            }
        }
        raster
    }

    /// The contact places in the colours of their states.
    fn contact_places(&mut self) {
        let places = &self.elastic.contact.places;
        let extent = self.size[0].max(self.size[1]);
        let radius = (0.25 * extent / places.len().max(1) as f64).clamp(1.6, 3.4);
        for (state, fill) in legend::states(self.contact) {
            let dots: String = (places.iter().enumerate())
                .filter(|&(i, _)| self.contact.status(i) == state)
                .map(|(_, place)| {
                    let [x, y] = self.place(place.mean(|node| self.moved[node as usize]));
                    format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"/>")
                })
                .collect();
            self.put(format_args!(
                "<g fill=\"{fill}\" stroke=\"#222222\" stroke-width=\"0.5\">{dots}</g>"
            ));
        }
    }

    /// The colours of the stresses, and the largest where it has none of them.
    fn colour_bar(&mut self) {
        let place = [MARGIN + self.size[0] + 30.0, HEAD + 22.0];
        let height = (self.size[1].max(180.0) - 30.0).min(320.0);
        let bar = ColourBar {
            name: format!("viridis{}", self.number),
            unit: &self.elastic.units.stress(),
            top: self.top,
            largest: self.largest,
            height,
        };
        bar.draw(&mut self.svg, place);
    }

    /// The colours of the contact nodes, below the field.
    fn legend(&mut self) {
        if self.elastic.contact.places.is_empty() {
            return;
        }
        let (mut x, y) = (MARGIN, self.height() - 14.0);
        for (state, fill) in legend::states(self.contact) {
            let name = state.name();
            self.put(format_args!(
                "<g transform=\"translate({x:.0} {y:.0})\"><circle cx=\"5\" cy=\"-4.5\" r=\"4\" fill=\"{fill}\" stroke=\"#222222\" stroke-width=\"0.6\"/><text x=\"15\">{name}</text></g>"
            ));
            x += 30.0 + 8.0 * name.len() as f64;
        }
    }
}
