//! What the figures of a step suggest to look at: nothing here is an error.

use super::{ContactReport, NodeStatus, OfBodies};
use crate::contact::Space;
use crate::mesh::vector::{length, minus};
use crate::mesh::{ElementKind, facet_nodes};
use crate::model::{Elastic, PairData};

/// So many nodes in contact at least, for a peak on one or two of them to be called unresolved.
const RESOLVED: usize = 5;

/// So many nodes without friction are the ends of a boundary in the plane, in space its rim, and nothing to speak of.
fn rim<const D: usize>(nodes: usize) -> usize {
    match D {
        2 => 2,
        _ => (4.0 * (nodes as f64).sqrt()).ceil() as usize,
    }
}

/// The regions of nearly incompressible materials whose elements lock.
fn locking<const D: usize>(elastic: &Elastic<D>) -> impl Iterator<Item = String>
where
    ElementKind: Space<D>,
{
    let mesh = &elastic.mesh;
    let locks = |kind| matches!(kind, ElementKind::Triangle | ElementKind::Tetrahedron);
    let regions = (0..).zip(mesh.regions.iter().zip(&elastic.materials));
    regions.filter_map(move |(region, (name, material))| {
        let elements = || mesh.elements.iter().filter(|e| e.region == region);
        let locked = material.is_projected(elastic.plane) && elements().any(|e| locks(e.kind()));
        locked.then(|| {
            format!(
                "region {name}: {} of first order are far too stiff at ν = {}, and have no form for it: take order = 2, or {}",
                if D == 2 { "triangles" } else { "tetrahedra" },
                material.poisson,
                if D == 2 { "quadrilaterals" } else { "hexahedra" },
            )
        })
    })
}

/// How far the sides of each contact between bodies have moved against each other; both moving together do not come closer.
pub(super) fn apart<const D: usize>(of: &OfBodies<D>) -> Vec<f64>
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

/// Those of the mesh and of materials, then in the order of the contacts, whose sides have moved against each other by `apart`. (One text: a paragraph for each hint.)
pub(super) fn hints<const D: usize>(
    of: &OfBodies<D>,
    contacts: &[ContactReport],
    apart: &[f64],
) -> Vec<String>
where
    ElementKind: Space<D>,
{
    let (elastic, fields) = (of.elastic, &of.contact);
    let mut hints = elastic.mesh.notes.clone();
    hints.extend(locking(elastic));
    let unit = &elastic.units.length;
    let (low, high) = elastic.mesh.bounding_box();
    let size = length(minus(high, low));
    let softest = (elastic.materials.iter()).fold(f64::INFINITY, |min, m| m.young.min(min));
    let pairs = elastic.pairs.iter().zip(contacts).enumerate();
    // What is tied neither opens nor rubs.
    for (number, (pair, contact)) in pairs.filter(|(_, (pair, _))| !pair.tied) {
        let name = format!("contact {}", pair.title());
        let rows = || (0..elastic.pair_of.len()).filter(|&i| elastic.pair_of[i] as usize == number);
        let touching = contact.stick + contact.slip + contact.frictionless;
        if touching == 0 {
            let least = rows().map(|i| fields.gap[i]).fold(f64::INFINITY, f64::min);
            hints.push(if least > 1e-12 * size {
                format!("{name}: no node touches; the least gap left is {least:.3e} {unit}")
            } else {
                format!("{name}: nothing is pressed, though some of it touches")
            });
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
        if contact.max_pressure > softest {
            hints.push(format!(
                "{name}: the pressure is above E of the softest material: are units, scale and load as meant? Strains \
                 are taken to be small"
            ));
        }
        if let Some(text) = pair.unmet_text(&elastic.units) {
            hints.push(format!("{name}: {text}"));
        }
        if let Some(text) = pair.arcs_text(&elastic.units) {
            hints.push(format!("{name}: {text}"));
        }
        if pair.kept > rim::<D>(pair.places) {
            hints.push(format!(
                "{name}: {} nodes get no friction, as supports keep them from sliding freely; what they would carry is \
                 missing in the forces of the contact and of the supports",
                pair.kept
            ));
        }
        match pair.obstacle {
            Some(_) => {
                let late = rows()
                    .filter(|&i| {
                        elastic.contact.places[i].gap > pair.search_distance
                            && fields.status(i) == NodeStatus::Frictionless
                    })
                    .count();
                if late > 0 && pair.tresca {
                    hints.push(format!(
                        "{name}: {late} nodes touch that were farther away than the search distance {:.3e} {unit}, \
                         and get no friction: state search_distance",
                        pair.search_distance
                    ));
                }
            }
            None => {
                let apart = apart[number];
                if apart > pair.search_distance {
                    hints.push(format!(
                        "{name}: its sides move by up to {apart:.3e} {unit} against each other, more than the search \
                         distance {:.3e} {unit}: what was farther apart has not been looked at; state search_distance",
                        pair.search_distance
                    ));
                }
            }
        }
    }
    hints
}
