//! Gaps that are stated for two bodies at rest, where these have moved.

use super::Definition;
use super::contacts::{Candidates, largest_facet};
use super::entities::Part as _;
use super::error::{Fault, ModelError};
use crate::contact::{ContactError, ContactPlace, EDGE_ANGLE, Space, smooth_parts_of};
use crate::elasticity::Body;
use crate::mesh::{ElementKind, Facet, Mesh, facet_nodes};
use rstar::RTree;
use rstar::primitives::GeomWithData;
use std::collections::HashMap;

/// The difference between the gap that is stated for two bodies at rest and that between their meshes.
#[derive(Clone, Debug)]
pub(super) struct Stated {
    /// The longest way between corners of a facet of the boundary that has the multipliers.
    pub(super) facet: f64,
    /// The same of either boundary.
    pub(super) longest: f64,
    /// At nodes of the smooth parts of the boundary that has the multipliers, without the offset; empty where they are equal.
    beyond: HashMap<(u32, u32), f64>,
    /// What is added everywhere.
    offset: f64,
    /// The deepest overlap that is stated.
    depth: f64,
}

impl Stated {
    /// The summand of the distance at a place of bodies that have moved, where this part of overlaps has been pressed apart.
    pub(super) fn beyond<const D: usize>(&self, place: &ContactPlace<D>, grown: f64) -> f64 {
        let of_nodes = place.own.iter();
        let beyond = |node| {
            let node = place.node_of(node);
            self.beyond.get(&(place.part, node)).unwrap_or(&0.0)
        };
        let of_nodes = of_nodes.map(|&(node, w)| w * beyond(node));
        of_nodes.sum::<f64>() + self.offset + (1.0 - grown) * self.depth
    }
}

impl<const D: usize> Definition<D>
where
    ElementKind: Space<D>,
{
    /// Completes the data that find the places of contacts between two bodies again where these have moved.
    pub(super) fn state_sliding(
        &self,
        body: &Body<D>,
        found: &mut Candidates<D>,
    ) -> Result<(), ModelError> {
        let mut all = HashMap::new();
        for (number, (pair, data)) in self.pairs.iter().zip(&found.pairs).enumerate() {
            if !data.slides() {
                continue;
            }
            let failed = |error| pair.entity(number).error(Fault::Contact(error));
            let drawn = pair
                .meet_moved(
                    body,
                    data,
                    body.mesh,
                    &found.sliding,
                    data.search_distance,
                    &[],
                )
                .map_err(failed)?;
            let [begin, end] = [number, number + 1]
                .map(|number| found.pair_of.partition_point(|&of| (of as usize) < number));
            let both = found.places[begin..end].iter().zip(&drawn);
            let both: Vec<_> = both.map(|(place, drawn)| [place, drawn]).collect();
            if both.is_empty()
                && let Some((key, _)) = pair.stated_gap()
            {
                return Err(pair.entity(number).at(key).error(format!(
                    "no parts of both sides are opposite to each other within the search distance of {} at rest, and {key} says how far apart \
                     such parts are: draw the sides at their distance and leave out {key}, or state a larger search_distance",
                    self.units().long(data.search_distance)
                )));
            }
            let depths = both.iter().map(|[stated, _]| -stated.gap);
            let depth = depths.fold(0.0, f64::max);
            let beyond = both.into_iter().map(|[place, drawn]| Beyond {
                place,
                value: place.gap - pair.offset - drawn.gap,
                drawn: drawn.gap,
            });
            let value = pair.stated_gap().map(|(_, value)| value);
            let steepest = match pair.is_by_nodes() {
                true => None,
                false => Some(pair.edge_angle.unwrap_or(EDGE_ANGLE)),
            };
            let [facet, other] =
                [&data.facets, &data.others].map(|facets| largest_facet(body.mesh, facets));
            let stated = Stated {
                facet,
                longest: facet.max(other),
                beyond: at_nodes(body.mesh, &data.facets, steepest, beyond.collect(), value)
                    .map_err(failed)?,
                offset: pair.offset,
                depth,
            };
            all.insert(number as u32, stated);
        }
        found.sliding.stated = all;
        Ok(())
    }
}

/// What is stated for a place beyond the distance of the meshes there.
struct Beyond<'p, const D: usize> {
    place: &'p ContactPlace<D>,
    value: f64,
    /// The distance of the meshes.
    drawn: f64,
}

/// Values at the nodes of the smooth parts of a boundary whose means are those at contact places. A node that is at none of them takes
/// over the value of the nearest place of its part or, where the gap is stated as a function of the place, the distance of the meshes
/// there. In a part without a place the value is 0. The whole boundary is one part where no edge is steep enough to count.
fn at_nodes<const D: usize>(
    mesh: &Mesh<D>,
    facets: &[Facet<D>],
    steepest: Option<f64>,
    mut places: Vec<Beyond<D>>,
    stated: Option<impl Fn([f64; D]) -> f64>,
) -> Result<HashMap<(u32, u32), f64>, ContactError>
where
    ElementKind: Space<D>,
{
    let mut of_nodes = HashMap::new();
    if stated.is_none() && places.iter().all(|at| at.value == 0.0) {
        return Ok(of_nodes);
    }
    let mut of_parts: HashMap<u32, Vec<_>> = HashMap::new();
    for (number, at) in places.iter().enumerate() {
        let of_part = of_parts.entry(at.place.part).or_default();
        of_part.push(GeomWithData::new(at.place.place, number));
    }
    let trees = of_parts
        .into_iter()
        .map(|(part, all)| (part, RTree::bulk_load(all)));
    let trees: HashMap<u32, _> = trees.collect();
    let taken = places.iter().map(|at| match stated {
        Some(_) => -at.drawn,
        None => at.value,
    });
    let taken: Vec<f64> = taken.collect();
    let near = |&(part, node): &(u32, u32)| {
        let x = mesh.nodes[node as usize];
        let near = |tree: &RTree<GeomWithData<[f64; D], usize>>| {
            let near = tree.nearest_neighbor(x)?;
            Some(taken[near.data] + stated.as_ref().map_or(0.0, |stated| stated(x)))
        };
        trees.get(&part).and_then(near).unwrap_or(0.0)
    };
    // At corners first, which places at middles contain.
    places.sort_by_key(|at| at.place.own.len());
    for Beyond { place, value, .. } in places {
        let Some(node) = place.node else { continue };
        let (mut rest, mut own) = (value, 1.0);
        for &(other, weight) in &place.own {
            match other == node {
                true => own = weight,
                false => {
                    let entry = of_nodes.entry((place.part, place.node_of(other)));
                    rest -= weight * *entry.or_insert_with_key(near);
                }
            }
        }
        for node in place.nodes_of(node, mesh.nodes.len()) {
            of_nodes.insert((place.part, node), rest / own);
        }
    }
    let parts = match steepest {
        None => vec![0; facets.len()],
        Some(steepest) => smooth_parts_of(mesh, facets, steepest)?,
    };
    for (facet, part) in facets.iter().zip(parts) {
        for &node in facet_nodes(facet) {
            of_nodes.entry((part, node)).or_insert_with_key(near);
        }
    }
    Ok(of_nodes)
}
