//! The deformed bodies of a step: the common data of their pictures in the plane and in space and of the rotatable
//! view.

use super::chart::nice;
use super::legend::{ColourBar, short};
use super::svg::{Svg, escape};
use crate::mesh::vector::{length, minus};
use crate::mesh::{ElementKind, Topology};
use crate::model::Elastic;
use crate::model::Units;
use crate::output::{ContactFields, StepFields};

/// Displacements are scaled to this part of the size of the mesh.
const SHOWN: f64 = 0.04;
/// Scaled bodies overlap where they have closed a gap: by this part of the size of the mesh at most.
const FALSE_OVERLAP: f64 = 0.003;

/// The bodies at the end of a step.
pub struct Bodies<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// Counted from 1; in names, it keeps those of different pictures on a page apart.
    pub step: usize,
    pub elastic: &'a Elastic<D>,
    pub fields: &'a StepFields<D>,
    pub contact: &'a ContactFields<D>,
    /// At the nodes.
    pub von_mises: Vec<f64>,
    pub largest: f64,
    /// The largest displacement, and the magnification of all.
    pub travel: f64,
    pub magnified: f64,
    /// The positions of the nodes in the picture, in coordinates of the mesh.
    pub moved: Vec<[f64; D]>,
}

impl<'a, const D: usize> Bodies<'a, D>
where
    ElementKind: Topology<D>,
{
    pub fn new(
        step: usize,
        elastic: &'a Elastic<D>,
        fields: &'a StepFields<D>,
        contact: &'a ContactFields<D>,
    ) -> Self {
        let von_mises: Vec<f64> = fields.at_nodes.iter().map(|s| s.von_mises()).collect();
        let lengths = fields.displacement.iter().copied().map(length);
        let travel = lengths.fold(0.0, f64::max);
        let magnified = magnification(elastic, travel, contact);
        let nodes = elastic.mesh.nodes.iter().zip(&fields.displacement);
        let moved = nodes.map(|(x, u)| std::array::from_fn(|c| x[c] + magnified * u[c]));
        Self {
            step,
            elastic,
            fields,
            contact,
            largest: von_mises.iter().copied().fold(0.0, f64::max),
            von_mises,
            travel,
            magnified,
            moved: moved.collect(),
        }
    }

    /// The head of a picture of this width and height: the title, and the fields shown.
    pub(super) fn head(&self, title: &str, size: [f64; 2], left: f64, more: &str) -> Svg {
        let mut svg = Svg::new(title, size, left);
        let (magnified, travel) = (self.magnified, short(self.travel));
        let length = escape(&Units::behind(&self.elastic.units.length));
        svg.put(format_args!(
            "<text x=\"{left}\" y=\"46\" fill=\"#555555\">von Mises stress; displacements × {magnified}, the largest {travel}{length}{more}</text>"
        ));
        svg
    }

    /// The colours of the stresses up to `top`, with the left upper corner of their bar at a place.
    pub(super) fn colour_bar(&self, svg: &mut Svg, top: f64, at: [f64; 2], height: f64) {
        let bar = ColourBar {
            name: format!("mises{}", self.step),
            unit: &self.elastic.units.stress(),
            top,
            largest: self.largest,
            height,
        };
        bar.draw(svg, at);
    }
}

/// A factor for the displacements: a round one that shows them, near 1 where bodies would overlap by it.
fn magnification<const D: usize>(
    elastic: &Elastic<D>,
    largest: f64,
    contact: &ContactFields<D>,
) -> f64
where
    ElementKind: Topology<D>,
{
    let (low, high) = elastic.mesh.bounding_box();
    let size = length(minus(high, low));
    if !(largest > 0.0) || elastic.is_large() {
        return 1.0;
    }
    // A gap d that becomes g is drawn as d + s (g − d).
    let room = FALSE_OVERLAP * size;
    // Bodies with an interference must not come apart either.
    let pressed = (elastic.contact.places.iter().zip(&contact.gap))
        .filter(|(place, gap)| place.gap < 0.0 && **gap > place.gap)
        .map(|(place, gap)| 1.0 + room / (gap - place.gap))
        .fold(f64::INFINITY, f64::min);
    let wanted = (elastic.contact.places.iter().zip(&contact.gap))
        .map(|(place, gap)| (place.gap, place.gap - gap))
        .filter(|&(before, closed)| closed > 1e-9 * before)
        .map(|(before, closed)| (before + room) / closed)
        .fold((SHOWN * size / largest).min(pressed), f64::min);
    if wanted < 1.0 {
        return 1.0;
    }
    // The round number at or below.
    let up = nice(wanted);
    if up <= wanted * (1.0 + 1e-9) {
        up
    } else {
        nice(up / 2.5).max(1.0)
    }
}
