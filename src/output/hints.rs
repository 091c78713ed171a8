//! Hints: the figures of a step that deserve a look. None of them is an error.

use super::{ContactReport, NodeStatus, OfBodies};
use crate::contact::Space;
use crate::dense::pseudo_inverse;
use crate::elasticity::{Hyperelastic, Plane};
use crate::mesh::vector::{cross, length, minus};
use crate::mesh::{Census, ElementKind, facet_nodes};
use crate::model::{Driven, Elastic, PairData, Units};
use crate::problem::ContactProblem;
use crate::quasistatic::StepSolution;
use crate::rounding::DEPENDENT;
use crate::ssnm::Status;
use faer::Mat;

/// A peak on one or two nodes counts as unresolved if at least this many nodes are in contact.
const RESOLVED: usize = 5;

/// So many nodes without friction are the ends of a boundary in the plane, in space its rim, and nothing to speak of.
fn rim<const D: usize>(nodes: usize) -> usize {
    match D {
        2 => 2,
        _ => (4.0 * (nodes as f64).sqrt()).ceil() as usize,
    }
}

/// Whether constraints contradict each other, where a solve has ended without an answer. Of several ranks, all have to ask.
pub(crate) fn contradiction<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    solution: &StepSolution<D>,
) -> Option<String> {
    let ended = solution.status != Status::Converged;
    (ended && problem.has_cancelling_forces(&solution.lambda)).then(|| {
        "constraints contradict each other: huge forces cancel at their nodes. Compare what equations, couplings, ties, preloads, \
         interferences and supports state of the same nodes"
            .to_owned()
    })
}

/// The regions of nearly incompressible materials whose elements lock.
fn locking<const D: usize>(elastic: &Elastic<D>, census: &Census) -> impl Iterator<Item = String>
where
    ElementKind: Space<D>,
{
    let mesh = &elastic.mesh;
    let locks = |kind| matches!(kind, ElementKind::Triangle | ElementKind::Tetrahedron);
    let regions = census
        .kinds
        .iter()
        .zip(mesh.regions.iter().zip(&elastic.materials));
    regions.filter_map(move |(kinds, (name, material))| {
        let any = kinds.iter().any(|&(kind, _)| locks(kind));
        let locked = material.is_projected(elastic.plane) && any;
        locked.then(|| {
            format!(
                "region {name}: first-order {} are far too stiff at ν = {}, and no formulation corrects them: take \
                 order = 2, or {}",
                if D == 2 { "triangles" } else { "tetrahedra" },
                material.poisson,
                if D == 2 { "quadrilaterals" } else { "hexahedra" },
            )
        })
    })
}

/// A hint names bodies that have turned so far that their lengths seem to grow by more than this part, 1/cos − 1. The
/// reason is that nodes move along tangents under the small-strain assumption: 8.1°. This is the accuracy expected of
/// strains; directions of loads and of normals are off by sin, 14 %.
const TURNED: f64 = 0.01;

/// A bolt is held at its section if a force shortens it by less than this part of the shortening of a cube over its
/// section.
const HELD: f64 = 1e-6;

/// The preloads by a force whose sections do not give way.
fn held_sections<const D: usize>(
    of: &OfBodies<D>,
    contacts: &[ContactReport],
) -> impl Iterator<Item = String>
where
    ElementKind: Space<D>,
{
    let elastic = of.elastic;
    let stiffest = (elastic.materials.iter()).fold(0.0, |most, m| m.young.max(most));
    let by_force = |driven: &&Driven| driven.motion.is_none() && !driven.locked;
    let driven = of.data.driven.iter().filter(by_force);
    driven.filter_map(move |driven| {
        let contact = contacts.get(elastic.pair_of[driven.row] as usize)?;
        let (tension, shortening) = (contact.tension?, contact.shortening?);
        let cube = tension.abs() / (stiffest * contact.area.sqrt());
        (shortening.abs() < HELD * cube).then(|| {
            format!(
                "preload {}: the force does not shorten the bolt, because something holds both ends of the section, as a tie beside it \
                 does: put the section into the free part of the bolt",
                contact.title()
            )
        })
    })
}

/// How bodies and the sides of contacts have moved, of all ranks.
pub(crate) struct Moved {
    /// By how much the sides of each contact have moved against each other.
    pub apart: Vec<f64>,
    /// The tangent of the angle by which each body has turned.
    pub turned: Vec<f64>,
    /// How far each body has gone that no force reaches and no support holds, 0 for others; empty on several ranks.
    pub gone: Vec<f64>,
}

impl Moved {
    /// In one process.
    pub fn of<const D: usize>(of: &OfBodies<D>) -> Self
    where
        ElementKind: Space<D>,
    {
        let (count, body_of) = of.elastic.mesh.bodies();
        Self {
            apart: apart(of),
            turned: turned(of, count, &body_of, |_| ()),
            gone: gone(of, count, &body_of),
        }
    }
}

/// The mean displacement of each body that only contact could hold and that bears no forces, if it is larger than all displacements of
/// bodies that bear forces; else 0. It is also 0 if the bodies that bear forces do not move: a body that others push aside moves as far
/// as those do.
fn gone<const D: usize>(of: &OfBodies<D>, count: usize, body_of: &[u32]) -> Vec<f64>
where
    ElementKind: Space<D>,
{
    let (mut reached, mut meets) = (vec![false; count], vec![false; count]);
    for (node, body) in (0..).zip(body_of) {
        let mut held = of.data.unknowns.prescribed(node).into_iter();
        reached[*body as usize] |=
            held.any(|held| held.is_some()) || of.data.forces[node as usize] != [0.0; D];
    }
    // Pressures below this part of the largest are what the tolerance has left.
    const PRESSED: f64 = 1e-6;
    // What is tied has forces, by rows that need no area.
    let contacts = of.contact.status.iter().zip(&of.contact.pressure);
    let pressures = contacts.filter(|of| *of.0 != NodeStatus::Tied);
    let most = pressures.fold(0.0, |most: f64, of| most.max(*of.1));
    let presses = |i: usize| match of.contact.status[i] {
        NodeStatus::Tied => true,
        _ => of.contact.pressure[i] > PRESSED * most,
    };
    for (i, place) in of.elastic.contact.places.iter().enumerate() {
        let further = place.further.iter().flatten().map(|(image, _)| image);
        let sides = place.own.iter().chain(&place.partners);
        for image in sides.map(|(image, _)| image).chain(further) {
            let body = body_of[place.node_of(*image) as usize] as usize;
            reached[body] |= presses(i);
            meets[body] = true;
        }
    }
    // The number of nodes of each, and the sum of their motions.
    let mut sums = vec![(0.0, [0.0; D]); count];
    let mut farthest = 0.0_f64;
    for (body, u) in body_of.iter().zip(&of.fields.displacement) {
        let (number, sum) = &mut sums[*body as usize];
        *number += 1.0;
        (0..D).for_each(|c| sum[c] += u[c]);
        if reached[*body as usize] {
            farthest = farthest.max(length(*u));
        }
    }
    let moved = sums.into_iter().enumerate().map(|(body, (number, sum))| {
        let mean = length(sum) / number;
        let is_gone = meets[body] && !reached[body] && mean > farthest && farthest > 0.0;
        if is_gone { mean } else { 0.0 }
    });
    moved.collect()
}

/// The bodies that nothing has held.
fn gone_away(census: &Census, gone: &[f64], units: &Units) -> impl Iterator<Item = String> {
    let gone = census.bodies.iter().zip(gone).filter(|of| *of.1 > 0.0);
    gone.map(|(name, far)| {
        format!(
            "the body with region \"{name}\" has no contact forces and has moved by {}, farther than any body that bears forces: nothing has \
             held it, and it could be anywhere; state more friction or a support if it is to stay in place",
            units.long(*far)
        )
    })
}

/// The tangent of the angle by which each body has turned, from the nodes whose bodies are known; `sum` adds up over ranks.
pub(crate) fn turned<const D: usize>(
    of: &OfBodies<D>,
    count: usize,
    body_of: &[u32],
    sum: impl Fn(&mut [f64]),
) -> Vec<f64>
where
    ElementKind: Space<D>,
{
    // A body of revolution cannot rotate; only its cross-section can, with a hoop strain visible elsewhere.
    let is_round = D == 2 && of.elastic.plane == Plane::Axisymmetric;
    if of.elastic.is_large() || is_round {
        return Vec::new();
    }
    let three = |v: &[f64; D]| std::array::from_fn::<_, 3, _>(|c| v.get(c).copied().unwrap_or(0.0));
    let places = of.elastic.mesh.nodes.iter().zip(&of.fields.displacement);
    let nodes = || {
        let all = body_of.iter().zip(places.clone());
        all.map(|(&body, (x, u))| (body as usize, three(x), three(u)))
    };
    // Of each body the number of nodes, and the sums of x and u.
    let mut means = vec![[0.0; 7]; count];
    for (body, x, u) in nodes() {
        let sums = std::iter::once(&1.0).chain(&x).chain(&u);
        (means[body].iter_mut().zip(sums)).for_each(|(mean, v)| *mean += v);
    }
    sum(means.as_flattened_mut());
    // Σ x xᵀ and Σ x × u, from the mean.
    let mut products = vec![[0.0; 12]; count];
    for (body, x, u) in nodes() {
        let [number, mean @ ..] = means[body];
        let [x, u] = [(x, 0), (u, 3)]
            .map(|(v, first)| std::array::from_fn::<_, 3, _>(|c| v[c] - mean[first + c] / number));
        let turn = cross(x, u);
        for i in 0..3 {
            (0..3).for_each(|j| products[body][3 * i + j] += x[i] * x[j]);
            products[body][9 + i] += turn[i];
        }
    }
    sum(products.as_flattened_mut());
    // Least squares of u − ω × x: (Σ |x|² − x xᵀ) ω = Σ x × u.
    let angle = |products: &[f64; 12]| {
        let trace = products[0] + products[4] + products[8];
        let square = Mat::from_fn(3, 3, |i, j| {
            f64::from(u8::from(i == j)) * trace - products[3 * i + j]
        });
        let inverse = pseudo_inverse(&square, DEPENDENT);
        let along = |i: usize| (0..3).map(|j| inverse[(i, j)] * products[9 + j]).sum();
        length::<3>(std::array::from_fn(along))
    };
    products.iter().map(angle).collect()
}

/// The bodies that have turned by a large angle.
fn turned_far<'t>(census: &'t Census, turned: &'t [f64]) -> impl Iterator<Item = String> + use<'t> {
    (census.bodies.iter().zip(turned)).filter_map(|(name, turn)| {
        let grown = turn.hypot(1.0) - 1.0;
        (grown > TURNED).then(|| {
            format!(
                "the body with region \"{name}\" has turned by {:.0}°: rotations are assumed small, and lengths that \
                 turn so far appear to grow by {:.0} %; check its supports and the load",
                turn.atan().to_degrees(),
                100.0 * grown
            )
        })
    })
}

/// Regions that ask for incompatible modes and have no elements that may have them.
fn without_modes<const D: usize>(
    elastic: &Elastic<D>,
    census: &Census,
) -> impl Iterator<Item = String>
where
    ElementKind: Space<D>,
{
    let mesh = &elastic.mesh;
    let regions = census
        .kinds
        .iter()
        .zip(mesh.regions.iter().zip(&elastic.materials));
    regions.filter_map(move |(kinds, (name, material))| {
        let any = kinds.iter().any(|(kind, _)| kind.may_have_modes());
        (material.incompatible_modes && !any).then(|| {
            format!("region {name}: incompatible modes exist in quadrilaterals and hexahedra of first order only, and \
                     it has none")
        })
    })
}

/// The regions with a law of large displacements where displacements are small.
fn without_law<const D: usize>(elastic: &Elastic<D>) -> impl Iterator<Item = String>
where
    ElementKind: Space<D>,
{
    let regions = elastic.mesh.regions.iter().zip(&elastic.materials);
    let stated = regions.filter(|(_, m)| !elastic.is_large() && m.law != Hyperelastic::default());
    stated.map(|(name, _)| {
        format!("region {name}: the law of its material has no effect, because displacements are small: state geometry = \"large\" under \
                 [analysis], or leave law out")
    })
}

/// The largest relative motion of the sides of each contact between bodies; moving together does not bring them closer.
fn apart<const D: usize>(of: &OfBodies<D>) -> Vec<f64>
where
    ElementKind: Space<D>,
{
    let moved = |pair: &PairData<D>| {
        let both = (pair.facets.iter().chain(&pair.others))
            .flat_map(facet_nodes)
            .map(|&node| of.fields.displacement[node as usize]);
        let (low, high) = crate::mesh::bounds(both);
        length(minus(high, low))
    };
    of.elastic.pairs.iter().map(moved).collect()
}

/// Those of the mesh and of materials, then in the order of the contacts, which have `moved`.
/// (One function: a paragraph for each hint.)
pub(super) fn hints<const D: usize>(
    of: &OfBodies<D>,
    census: &Census,
    contacts: &[ContactReport],
    moved: &Moved,
) -> Vec<String>
where
    ElementKind: Space<D>,
{
    let (elastic, fields) = (of.elastic, &of.contact);
    let mut hints = census.notes.clone();
    hints.extend(locking(elastic, census));
    hints.extend(without_modes(elastic, census));
    hints.extend(without_law(elastic));
    hints.extend(held_sections(of, contacts));
    hints.extend(turned_far(census, &moved.turned));
    let units = &elastic.units;
    hints.extend(gone_away(census, &moved.gone, units));
    let softest = (elastic.materials.iter()).fold(f64::INFINITY, |min, m| m.young.min(min));
    let pairs = elastic.pairs.iter().zip(contacts).enumerate();
    // A tie neither opens nor slides.
    for (number, (pair, contact)) in pairs.filter(|(_, (pair, _))| !pair.tied) {
        let name = format!("contact {}", pair.title());
        let rows = || (0..elastic.pair_of.len()).filter(|&i| elastic.pair_of[i] as usize == number);
        let touching = contact.stick + contact.slip + contact.frictionless;
        if touching == 0 {
            let least = rows().map(|i| fields.gap[i]).fold(f64::INFINITY, f64::min);
            hints.push(if least.is_infinite() && rows().next().is_some() {
                format!("{name}: no node touches; every gap is infinite")
            } else if least.is_infinite() {
                format!(
                    "{name}: the sides are farther apart than the search distance {}",
                    units.long(pair.search_distance)
                )
            } else if least > 1e-12 * census.size {
                format!(
                    "{name}: no node touches; the least gap left is {}",
                    units.long(least)
                )
            } else {
                format!("{name}: nothing is pressed, although some of it touches")
            });
            if elastic.is_large() && !elastic.loose.is_empty() && !pair.centres[0].is_empty() {
                hints.push(format!(
                    "{name}: both sides are round; without friction the slightest moment turns a body that may turn about the axis: hold it \
                     against turning, or state friction"
                ));
            }
        }
        if touching >= RESOLVED && contact.peaks <= 2 {
            hints.push(format!(
                "{name}: the largest pressure sits on {}: the mesh does not resolve it (an edge or a corner); it \
                 grows as the mesh is refined, the resultant does not",
                match contact.peaks {
                    1 => "one node".to_owned(),
                    n => format!("{n} nodes"),
                }
            ));
        }
        if contact.max_pressure > softest && !elastic.is_large() {
            hints.push(format!(
                "{name}: the pressure exceeds E of the softest material, but strains are assumed small: check units, \
                 scale and load"
            ));
        }
        let texts = [
            pair.unmet_text(units),
            pair.alike_text(),
            pair.arcs_text(units),
            pair.sagitta_text(units),
            pair.unmatched_text(units),
        ];
        let texts = texts.into_iter().flatten();
        hints.extend(texts.map(|text| format!("{name}: {text}")));
        if pair.kept > rim::<D>(pair.places) {
            hints.push(format!(
                "{name}: {} nodes get no friction, because supports keep them from sliding freely; their friction is \
                 missing in the forces of the contact and of the supports",
                pair.kept
            ));
        }
        match pair.obstacle {
            Some(_) => {
                let late = rows()
                    .filter(|&i| {
                        elastic.contact.places[i].gap > pair.search_distance
                            && fields.status[i] == NodeStatus::Frictionless
                    })
                    .count();
                if late > 0 && pair.tresca {
                    hints.push(format!(
                        "{name}: {late} nodes touch that were farther away than the search distance {}, \
                         and get no friction: state search_distance",
                        units.long(pair.search_distance)
                    ));
                }
            }
            None => {
                let apart = moved.apart[number];
                if apart > pair.search_distance && !elastic.is_large() {
                    hints.push(format!(
                        "{name}: its sides move by up to {} against each other, more than the search distance {}: \
                         parts farther apart were not searched; state search_distance",
                        units.long(apart),
                        units.long(pair.search_distance)
                    ));
                }
            }
        }
    }
    hints
}
