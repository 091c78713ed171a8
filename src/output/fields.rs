//! The fields of a step: displacements and stresses of the bodies, and the fields at the contact nodes.

use super::put;
use crate::contact::{Space, pooled};
use crate::elasticity::{Deformed, Stress, Temperature, cauchy_stresses, stresses_at};
use crate::mesh::{ElementKind, Topology};
use crate::model::{Elastic, EntityKind, StepData};
use crate::problem::{ContactProblem, is_infinite};
use crate::quasistatic::StepSolution;
use crate::sparse::add_times;
use std::collections::HashMap;

/// Displacements and stresses at the end of a step, in the units of the case.
pub struct StepFields<const D: usize = 2> {
    /// Of every node.
    pub displacement: Vec<[f64; D]>,
    /// Stresses at the nodes.
    pub at_nodes: Vec<Stress>,
    /// Stresses in the middle of the elements.
    pub in_elements: Vec<Stress>,
    /// The sliding distance and the work of friction per area at every node since the first step, if there has been friction.
    pub(super) rubbed: Option<Vec<[f64; 2]>>,
}

impl<const D: usize> StepFields<D>
where
    ElementKind: Space<D>,
{
    /// From a solution.
    pub fn new(elastic: &Elastic<D>, data: &StepData<D>, solution: &StepSolution<D>) -> Self {
        let displacement = data.unknowns.displacements(&solution.u);
        let field = |region, x| data.temperature.at(region, x);
        let temperature: Temperature<D> = &field;
        let temperature = (!data.temperature.is_none()).then_some(temperature);
        let body = elastic.body();
        let (at_nodes, in_elements) = match elastic.is_large() {
            true => cauchy_stresses(&Deformed::new(&body, &displacement, temperature)),
            false => stresses_at(&body, &displacement, temperature),
        };
        Self {
            displacement,
            at_nodes,
            in_elements,
            rubbed: None,
        }
    }
}

/// The state of a contact node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeStatus {
    /// It touches nothing.
    Separated,
    /// It is in contact, and no law of friction acts on it.
    Frictionless,
    /// It is in contact and does not slip.
    Stick,
    /// It is in contact and slips.
    Slip,
    /// It is tied.
    Tied,
}

impl NodeStatus {
    /// The word for it in contact.csv and in pictures.
    pub fn name(self) -> &'static str {
        match self {
            Self::Separated => "separated",
            Self::Frictionless => "contact",
            Self::Stick => "stick",
            Self::Slip => "slip",
            Self::Tied => "tied",
        }
    }
}

/// The fields at the m contact places, in the units of the case. Tangential fields have a component per node in the
/// plane; in space those along the two tangents of a node are adjacent.
pub struct ContactFields<const D: usize = 2> {
    /// Gap after loading, d − Nu, length m; of compliant contact negative where it is pressed, and infinite where a place has
    /// no other side.
    pub gap: Vec<f64>,
    /// Contact pressure λν / area, ≥ 0, length m: places with little area compared with the mesh are pooled with their
    /// neighbours ([`crate::contact::ContactPlace::pool`]), also in the tractions and bounds.
    pub pressure: Vec<f64>,
    /// Traction on the body along the tangents of [`crate::contact::ContactPlace::frame`] (in the plane ν turned
    /// counter-clockwise): −λτ / area, length (D − 1) m.
    pub traction: Vec<f64>,
    /// The slip bound g / area that the traction obeys, length m; 0 where a node is tied.
    pub bound: Vec<f64>,
    /// Displacement along the tangents relative to the other side, Tu, length (D − 1) m; for compliant contact including its
    /// elastic part before slip.
    pub slip: Vec<f64>,
    /// The depth that wear has taken off, length m; empty where nothing wears.
    pub worn: Vec<f64>,
    /// ν and the tangents of each node.
    pub(super) frames: Vec<[[f64; D]; D]>,
    /// The state of each node.
    pub status: Vec<NodeStatus>,
    /// Whether a law of friction acts on any node.
    #[cfg_attr(not(feature = "plots"), allow(dead_code))]
    pub(super) any_friction: bool,
}

impl<const D: usize> ContactFields<D>
where
    ElementKind: Topology<D>,
{
    /// At the end of a step.
    pub fn new<K>(
        problem: &ContactProblem<D, K>,
        elastic: &Elastic<D>,
        data: &StepData<D>,
        solution: &StepSolution<D>,
    ) -> Self {
        let m = problem.m();
        let (normal, tangential) = solution.lambda.split_at(m);
        let mut gap = problem.times(problem.normal(), &solution.u);
        let mut slip = problem.times(problem.tangential(), &solution.u);
        for (gap, before) in gap.iter_mut().zip(&data.load.gap) {
            *gap = match is_infinite(*before) {
                true => f64::INFINITY,
                false => before - *gap,
            };
        }
        add_times(1.0, &solution.worn, &mut gap[..solution.worn.len()]);
        for (slip, of_supports) in slip.iter_mut().zip(&data.load.slide) {
            *slip += of_supports;
        }
        let places = &elastic.contact.places;
        let areas = elastic.contact.pooled_areas();
        let pooled = |forces: &[f64]| pooled(places, forces);
        // Their values in this step.
        let changes = data.changes.as_ref();
        let acts = |i: usize| changes.is_none_or(|changes| changes.acts(i));
        let tied: Vec<bool> = (elastic.contact.tied().into_iter().enumerate())
            .map(|(i, tied)| tied && acts(i))
            .collect();
        let bounds = solution.slip_bound.iter().zip(&tied);
        let bounds: Vec<f64> = bounds
            .map(|(&g, &tied)| if tied { 0.0 } else { g })
            .collect();
        let has_friction = |i: usize| {
            problem.has_friction(i) && changes.is_none_or(|changes| changes.friction[i] > 0.0)
        };
        let bound = per_area(&pooled(&bounds), &areas, 1.0);
        let status = |i: usize| {
            if tied[i] {
                NodeStatus::Tied
            } else if solution.sets.is_separated(i) {
                NodeStatus::Separated
            } else if !has_friction(i) {
                NodeStatus::Frictionless
            } else if !solution.sets.slips(i) && bound[i] > 0.0 {
                NodeStatus::Stick
            } else {
                NodeStatus::Slip
            }
        };
        Self {
            gap,
            status: (0..m).map(status).collect(),
            any_friction: (0..m).any(|i| has_friction(i) && !tied[i]),
            pressure: per_area(&pooled(normal), &areas, 1.0),
            traction: per_area(&pooled(tangential), &areas, -1.0),
            bound,
            slip,
            worn: solution.worn.clone(),
            frames: places.iter().map(|place| place.frame).collect(),
        }
    }

    /// The traction on the body at contact node i, normal and tangential part, along the axes.
    pub fn traction_vectors(&self, i: usize) -> [[f64; D]; 2] {
        let (normal, tangents) = (self.frames[i][0], &self.frames[i][1..]);
        let along = &self.traction[(D - 1) * i..][..D - 1];
        // + 0.0 turns −0 into 0.
        let pressed = normal.map(|v| -self.pressure[i] * v + 0.0);
        let rubbed = std::array::from_fn(|c| {
            let parts = tangents.iter().zip(along);
            parts
                .map(|(tangent, along)| along * tangent[c])
                .sum::<f64>()
                + 0.0
        });
        [pressed, rubbed]
    }

    /// `contact.csv`, in the order of the contacts, of their places along x, then y, then z.
    pub(crate) fn csv(&self, elastic: &Elastic<D>) -> String {
        let place = |i: usize| elastic.contact.places[i].place;
        let mut order: Vec<usize> = (0..self.gap.len())
            .filter(|&i| kind(elastic, i) != EntityKind::Support)
            .collect();
        order.sort_by(|&a, &b| {
            let pairs = elastic.pair_of[a].cmp(&elastic.pair_of[b]);
            let places = place(a).into_iter().zip(place(b));
            places.fold(pairs, |order, (p, q)| order.then(p.total_cmp(&q)))
        });
        let mut text = self.head(elastic);
        let name_of = |pair: u32| {
            let pair = &elastic.pairs[pair as usize];
            pair.name.as_ref().unwrap_or(&pair.boundary)
        };
        for i in order {
            let along = (D - 1) * i..(D - 1) * (i + 1);
            let numbers = (place(i).into_iter())
                .chain([self.gap[i], self.pressure[i]])
                .chain(self.traction[along.clone()].iter().copied())
                .chain(self.slip[along].iter().copied());
            let numbers: Vec<String> = numbers.map(|value| format!("{value:e}")).collect();
            let [pressed, rubbed] = self.traction_vectors(i);
            let vector: String = match D {
                2 => String::new(),
                _ => (pressed.iter().zip(rubbed))
                    .map(|(p, t)| format!(",{:e}", p + t))
                    .collect(),
            };
            let mut rest = match elastic.is_large() {
                false => String::new(),
                true => (elastic.contact.places[i].mean_place(&elastic.mesh.nodes))
                    .map(|x| format!(",{x:e}"))
                    .concat(),
            };
            if let Some(depth) = self.worn.get(i) {
                rest += &format!(",{depth:e}");
            }
            put(
                &mut text,
                format_args!(
                    "{},{},{}{vector},{}{rest}",
                    numbers.join(","),
                    self.status[i].name(),
                    csv_text(name_of(elastic.pair_of[i])),
                    elastic.contact.places[i].node.map_or("edge", |_| "node")
                ),
            );
        }
        text
    }

    /// The first line of `contact.csv`. In space there are two tangents, and the whole traction along the axes.
    fn head(&self, elastic: &Elastic<D>) -> String {
        let told = |unit: &str| match unit {
            "" => String::new(),
            _ if !elastic.units_stated => String::new(),
            unit => format!(" [{unit}]"),
        };
        let (length, stress) = (told(&elastic.units.length), told(&elastic.units.stress()));
        // With large displacements, x and y are the displaced position of a place.
        let mut rest: String = match elastic.is_large() {
            false => String::new(),
            true => ["x", "y", "z"][..D]
                .iter()
                .map(|axis| format!(",rest_{axis}{length}"))
                .collect(),
        };
        if !self.worn.is_empty() {
            rest += &format!(",wear{length}");
        }
        match D {
            2 => format!(
                "x{length},y{length},gap{length},normal_pressure{stress},tangential_traction{stress},slip{length},\
                 status,contact,place{rest}\n"
            ),
            _ => format!(
                "x{length},y{length},z{length},gap{length},normal_pressure{stress},tangential_traction_1{stress},\
                 tangential_traction_2{stress},slip_1{length},slip_2{length},status,contact,traction_x{stress},\
                 traction_y{stress},traction_z{stress},place{rest}\n"
            ),
        }
    }
}

/// The owner of a row.
fn kind<const D: usize>(elastic: &Elastic<D>, row: usize) -> EntityKind
where
    ElementKind: Topology<D>,
{
    elastic.pairs[elastic.pair_of[row] as usize].kind
}

/// The contact place that each node shows: its own, or on a partly covered facet the one with the largest share in the
/// node. Of several the one with the largest pressure. For all contacts and other joints of bodies, or for one of them.
pub fn shown_at_nodes<const D: usize>(
    elastic: &Elastic<D>,
    contact: &ContactFields<D>,
    pair: Option<usize>,
) -> HashMap<u32, usize>
where
    ElementKind: Topology<D>,
{
    let mut shown: HashMap<u32, (f64, usize)> = HashMap::new();
    for (i, node, part) in elastic.at_nodes() {
        let i = i as usize;
        let is_shown = match pair {
            Some(pair) => elastic.pair_of[i] as usize == pair,
            // Equations and supports have no stresses.
            None => !matches!(kind(elastic, i), EntityKind::Support | EntityKind::Equation),
        };
        if !is_shown {
            continue;
        }
        let held = shown.entry(node).or_insert((part, i));
        if part > held.0 || part == held.0 && contact.pressure[i] > contact.pressure[held.1] {
            *held = (part, i);
        }
    }
    shown.into_iter().map(|(node, (_, i))| (node, i)).collect()
}

/// Forces as stresses; there are as many for each node as go to each area.
fn per_area(forces: &[f64], areas: &[f64], sign: f64) -> Vec<f64> {
    let each = forces.len() / areas.len().max(1);
    let areas = areas.iter().flat_map(|&a| std::iter::repeat_n(a, each));
    // + 0.0 turns −0 into 0.
    (forces.iter().zip(areas))
        .map(|(f, a)| sign * f / a + 0.0)
        .collect()
}

/// A text as a field of a CSV file (RFC 4180).
fn csv_text(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn csv_fields_are_quoted_where_they_must_be() {
        assert_eq!(csv_text("bottom"), "bottom");
        assert_eq!(csv_text("left, right"), "\"left, right\"");
        assert_eq!(csv_text("the \"foot\""), "\"the \"\"foot\"\"\"");
        assert_eq!(csv_text("two\nlines"), "\"two\nlines\"");
    }

    #[test]
    fn forces_per_area_keep_the_tangents_of_a_node_together() {
        let plane = per_area(&[2.0, 0.0, 6.0], &[1.0, 2.0, 4.0], -1.0);
        assert_eq!(plane, [-2.0, 0.0, -1.5]);
        assert!(plane[1].is_sign_positive());
        let space = per_area(&[2.0, 4.0, 6.0, 8.0], &[2.0, 4.0], 1.0);
        assert_eq!(space, [1.0, 2.0, 1.5, 2.0]);
        assert!(per_area(&[], &[], 1.0).is_empty());
    }
}
