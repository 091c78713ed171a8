//! The deformed mesh of the plane with its von Mises stresses: a raster image of the field inside an SVG.

use super::bodies::Bodies;
use super::legend;
use super::raster::{Raster, mean};
use super::surface::{Border, borders};
use super::svg::Svg;
use crate::contact::Obstacle;
use crate::mesh::{bounds, face_parts};

/// Room for the field.
const FIELD: [f64; 2] = [740.0, 560.0];
const MARGIN: f64 = 24.0;
const LEGEND: f64 = 130.0;
const HEAD: f64 = 64.0;
const FOOT: f64 = 44.0;
/// Edges of elements are drawn where these are larger than this many units on average.
const VISIBLE_EDGE: f64 = 7.0;

/// The picture of a step.
pub(super) fn svg(title: &str, bodies: &Bodies) -> String {
    let nodes = &bodies.elastic.mesh.nodes;
    let (low, high) = bounds(nodes.iter().chain(&bodies.moved).copied());
    let extent = [high[0] - low[0], high[1] - low[1]];
    let unit = (FIELD[0] / extent[0]).min(FIELD[1] / extent[1]);
    let scene = Scene {
        bodies,
        top: legend::top(&bodies.von_mises),
        corner: [low[0], high[1]],
        unit,
        size: extent.map(|v| unit * v),
    };
    let size = scene.size;
    // With room for the title, and for the legends beside narrow bodies.
    let width = (size[0] + 2.0 * MARGIN + LEGEND).max(560.0);
    let height = HEAD + FOOT + size[1].max(190.0);
    let mut svg = bodies.head(title, [width, height], MARGIN, "");
    svg.open([MARGIN, HEAD]);
    scene.obstacles(&mut svg);
    scene.bodies(&mut svg);
    scene.contact_places(&mut svg);
    svg.close();
    let bar = (size[1].max(180.0) - 30.0).min(320.0);
    let place = [MARGIN + size[0] + 30.0, HEAD + 22.0];
    bodies.colour_bar(&mut svg, scene.top, place, bar);
    if !bodies.elastic.contact.places.is_empty() {
        let sample = |fill| {
            format!(
                "<circle cx=\"13\" cy=\"-4.5\" r=\"4\" fill=\"{fill}\" stroke=\"#222222\" stroke-width=\"0.6\"/>"
            )
        };
        let states = legend::states(bodies.contact).into_iter();
        let entries: Vec<_> = states
            .map(|(_, name, _, fill)| (sample(fill), name.to_owned()))
            .collect();
        svg.legend(&entries, [MARGIN, height - 14.0], width);
    }
    svg.finish()
}

/// The deformed bodies on their way to a picture.
struct Scene<'a> {
    bodies: &'a Bodies<'a>,
    /// The stress with the last of the colours.
    top: f64,
    /// The left and upper ends of the field, and units of the picture per unit of length.
    corner: [f64; 2],
    unit: f64,
    /// Width and height of the field, in units of the picture.
    size: [f64; 2],
}

impl Scene<'_> {
    /// A place of the mesh in the field; y goes down.
    fn place(&self, x: [f64; 2]) -> [f64; 2] {
        [
            self.unit * (x[0] - self.corner[0]),
            self.unit * (self.corner[1] - x[1]),
        ]
    }

    /// Rigid obstacles, cut off a little outside the bodies.
    fn obstacles(&self, svg: &mut Svg) {
        let number = self.bodies.step;
        let [width, height] = [self.size[0] + 28.0, self.size[1] + 22.0];
        svg.put(format_args!(
            "<clipPath id=\"field{number}\"><rect x=\"-14\" y=\"-10\" width=\"{width:.1}\" height=\"{height:.1}\"/></clipPath><g clip-path=\"url(#field{number})\" fill=\"#e2e2e2\" stroke=\"#9a9a9a\">"
        ));
        let pairs = self.bodies.elastic.pairs.iter();
        for obstacle in pairs.filter_map(|pair| pair.obstacle) {
            match obstacle {
                Obstacle::HalfSpace { point, normal } => {
                    let [x, y] = self.place(point);
                    let angle = normal[0].atan2(normal[1]).to_degrees();
                    // Rotated so that its inside is below.
                    svg.put(format_args!(
                        "<rect x=\"-9999\" y=\"0\" width=\"19998\" height=\"9999\" transform=\"translate({x:.2} {y:.2}) rotate({angle:.4})\"/>"
                    ));
                }
                Obstacle::Sphere { center, radius } => {
                    let ([x, y], r) = (self.place(center), self.unit * radius);
                    svg.put(format_args!(
                        "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"{r:.2}\"/>"
                    ));
                }
                Obstacle::Cylinder { .. } => {}
            }
        }
        svg.close();
    }

    /// The stresses in the deformed bodies, between the outlines before and after; edges of elements where there is room.
    fn bodies(&self, svg: &mut Svg) {
        let (mesh, moved) = (&self.bodies.elastic.mesh, &self.bodies.moved);
        let all = borders(mesh.elements.iter().map(|element| element.nodes()));
        let outline = |at| self.path(all.iter().filter(|edge| edge.count == 1), at);
        svg.path(&outline(&mesh.nodes), "stroke=\"#b5b5b5\"");
        let raster = self.stresses();
        svg.image([0.0; 2], raster.size(), &raster.png());
        let area = mesh.measures().iter().sum::<f64>() / mesh.elements.len() as f64;
        if area.sqrt() * self.unit > VISIBLE_EDGE {
            let thin = "stroke=\"#000000\" stroke-opacity=\"0.22\" stroke-width=\"0.6\"";
            svg.path(&self.path(all.iter(), moved), thin);
        }
        svg.path(&outline(moved), "stroke=\"#222222\" stroke-width=\"1.1\"");
    }

    /// Lines along edges, between nodes at these places.
    fn path<'b>(&self, edges: impl Iterator<Item = &'b Border>, at: &[[f64; 2]]) -> String {
        let mut path = String::new();
        let mut last = None;
        for &Border { ends, .. } in edges {
            let [p, q] = ends.map(|node| self.place(at[node as usize]));
            if last != Some(ends[0]) {
                path += &format!("M{:.1} {:.1}", p[0], p[1]);
            }
            path += &format!("L{:.1} {:.1}", q[0], q[1]);
            last = Some(ends[1]);
        }
        path
    }

    /// The von Mises stress in the pixels of the field.
    fn stresses(&self) -> Raster {
        let mut raster = Raster::new(self.size);
        for element in &self.bodies.elastic.mesh.elements {
            let nodes = element.nodes();
            let parts = face_parts(nodes.len()).iter();
            for [a, b, c] in
                parts.flat_map(|part| (1..part.len() - 1).map(|k| [part[0], part[k], part[k + 1]]))
            {
                let corners = [a, b, c].map(|place| nodes[place] as usize);
                let values = corners.map(|i| self.bodies.von_mises[i] / self.top);
                let places = corners.map(|i| self.place(self.bodies.moved[i]));
                raster.fill(places, |weights| Raster::level(mean(weights, values)));
            }
        }
        raster
    }

    /// The contact places in the colours of their states.
    fn contact_places(&self, svg: &mut Svg) {
        let places = &self.bodies.elastic.contact.places;
        let extent = self.size[0].max(self.size[1]);
        let radius = (0.25 * extent / places.len().max(1) as f64).clamp(1.6, 3.4);
        for (state, _, _, fill) in legend::states(self.bodies.contact) {
            let here = (places.iter().enumerate())
                .filter(|&(i, _)| self.bodies.contact.status[i] == state)
                .map(|(_, place)| place.mean_place(&self.bodies.moved));
            let dot = |x: [f64; 2]| {
                let [x, y] = self.place(x);
                format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\"/>")
            };
            let dots: String = here.map(dot).collect();
            svg.put(format_args!(
                "<g fill=\"{fill}\" stroke=\"#222222\" stroke-width=\"0.5\">{dots}</g>"
            ));
        }
    }
}
