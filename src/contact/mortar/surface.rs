//! A boundary of a pair: its facets, the smooth parts that sharp edges cut it into, and its averaged normals.

use super::bulge::{Bulge, ridge};
use super::{MasterFacet, Mortar, PairOptions, SlaveFacet};
use crate::contact::search::Search;
use crate::contact::{Centre, ContactError};
use crate::elasticity::{Depth, Depths};
use crate::mesh::vector::{dot, length, unit};
use crate::mesh::{ElementKind, Facet, Groups, Mesh, Topology, facet_corners, facet_nodes};
use crate::rigid::Rotation;
use std::collections::{BTreeSet, HashMap};

pub(super) struct Surface<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    pub facets: &'a [Facet<D>],
    /// Their lengths (areas).
    pub measure: Vec<f64>,
    /// Their outward unit normals.
    pub outward: Vec<[f64; D]>,
    /// The largest deviation from the surfaces that they approximate.
    pub slack: Vec<f64>,
    /// The smooth part that each belongs to.
    pub part: Vec<u32>,
    /// The extents of their bodies perpendicular to the plane.
    pub depth: Vec<Depth>,
    /// The deviation of each from the arc through its nodes.
    pub bulge: Vec<Bulge<D>>,
    /// At each node, and in each part that it belongs to, the unit normal halfway between those of the facets, or along the radius.
    normals: HashMap<(u32, u32), [f64; D]>,
}

impl<'a, const D: usize> Surface<'a, D>
where
    ElementKind: Mortar<D>,
{
    /// # Errors
    /// If it turns back on itself within a smooth part.
    pub fn new(
        mesh: &Mesh<D>,
        facets: &'a [Facet<D>],
        depths: &Depths,
        options: &PairOptions<D>,
        centres: &[Option<Centre<D>>],
    ) -> Result<Self, ContactError> {
        let (measure, outward): (Vec<f64>, Vec<_>) =
            facets.iter().map(|facet| mesh.facet_normal(facet)).unzip();
        let at_nodes: Vec<_> = (facets.iter().zip(&outward))
            .map(|(facet, &mean)| normals_at_nodes(mesh, facet, mean))
            .collect::<Result<_, _>>()?;
        let part = match options.rest {
            None => smooth_parts(facets, &at_nodes, options.edge_angle),
            Some(rest) => smooth_parts_of(rest, facets, options.edge_angle)?,
        };
        let part = joined_parts(options.rest.unwrap_or(mesh), facets, part, options);
        let mut normals: HashMap<(u32, u32), [f64; D]> = HashMap::new();
        for ((facet, at_nodes), &part) in facets.iter().zip(&at_nodes).zip(&part) {
            let (corners, len) = mesh.corners_of(facet);
            let weights = <ElementKind as Mortar<D>>::corner_weights(&corners[..len]);
            for (k, &node) in facet_nodes(facet).iter().enumerate() {
                let weight = if k < len { weights[k] } else { 1.0 };
                let sum = normals.entry((node, part)).or_insert([0.0; D]);
                *sum = std::array::from_fn(|c| sum[c] + weight * at_nodes[k][c]);
            }
        }
        for (&(node, _), normal) in &mut normals {
            if !(length(*normal) > 1e-6) {
                let place = mesh.nodes[node as usize].into();
                return Err(ContactError::Folded { place });
            }
            *normal = unit(*normal);
        }
        let turns = match options.rest {
            Some(rest) if centres.iter().any(Option::is_some) => {
                turns_at_nodes([rest, mesh], facets)
            }
            _ => HashMap::new(),
        };
        let rest = options.rest.unwrap_or(mesh);
        for ((facet, centre), part) in facets.iter().zip(centres).zip(&part) {
            let Some(centre) = centre else { continue };
            for &node in facet_nodes(facet) {
                let radius = centre.radius_to(rest.nodes[node as usize]);
                let turned = turns.get(&node).map_or(radius, |turn| turn.of(radius));
                let outward = unit(turned).map(|c| centre.radius.signum() * c);
                normals.insert((node, *part), outward);
            }
        }
        let mut parts: HashMap<u32, Vec<[f64; D]>> = HashMap::new();
        for (&(node, _), &normal) in normals.iter().filter(|_| options.seams.is_some()) {
            parts.entry(node).or_default().push(normal);
        }
        let at = |node| parts.get(&node).cloned().unwrap_or_default();
        for (&(node, _), normal) in &mut normals {
            let whole = options.across_seams(*normal, node, at);
            *normal = options.within_planes(whole, &[node]);
        }
        let slack = facets.iter().map(|facet| {
            let (places, len) = mesh.places_of(facet);
            super::slack(&places, facet_corners(facet).len(), len)
        });
        Ok(Self {
            facets,
            measure,
            outward,
            slack: slack.collect(),
            bulge: Bulge::all([rest, mesh], facets, &part, options, centres),
            part,
            depth: (facets.iter())
                .map(|facet| depths.of(facet_nodes(facet)))
                .collect(),
            normals,
        })
    }

    /// The facets that one of another boundary may meet within a distance.
    pub fn near(
        &self,
        mesh: &Mesh<D>,
        search: &Search<D>,
        slave: &SlaveFacet<D>,
        distance: f64,
    ) -> Vec<MasterFacet<D>> {
        (search.near(<ElementKind as Mortar<D>>::beam(slave, distance)))
            .filter(|&(number, _)| dot(self.outward[number], slave.normal) < super::FACING)
            .map(|(number, facet)| {
                let (places, len) = mesh.places_of(&facet);
                MasterFacet {
                    number,
                    len,
                    nodes: std::array::from_fn(|k| facet.as_ref()[k.min(facet.as_ref().len() - 1)]),
                    places,
                    normal: self.outward[number],
                    slack: self.slack[number],
                    bulge: self.bulge[number],
                    part: self.part[number],
                    deepest: distance,
                    is_first: false,
                    hides: false,
                }
            })
            .collect()
    }
}

impl<const D: usize> Surface<'_, D>
where
    ElementKind: Topology<D>,
{
    /// The averaged normal of a smooth part at one of its nodes.
    pub fn normal(&self, node: u32, part: u32) -> [f64; D] {
        self.normals[&(node, part)]
    }
}

/// The nodes of the facets around each node.
pub(crate) fn nodes_around<const D: usize>(facets: &[Facet<D>]) -> HashMap<u32, BTreeSet<u32>>
where
    ElementKind: Topology<D>,
{
    let mut around: HashMap<u32, BTreeSet<u32>> = HashMap::new();
    for nodes in facets.iter().map(facet_nodes) {
        (nodes.iter()).for_each(|node| around.entry(*node).or_default().extend(nodes));
    }
    around
}

/// By how much the facets around each node have turned.
fn turns_at_nodes<const D: usize>(
    meshes: [&Mesh<D>; 2],
    facets: &[Facet<D>],
) -> HashMap<u32, Rotation<D>>
where
    ElementKind: Topology<D>,
{
    let turn = |(node, around): (u32, BTreeSet<u32>)| {
        let [rest, now] = meshes.map(|mesh| {
            let places = around.iter().map(|&node| mesh.nodes[node as usize]);
            places.collect::<Vec<_>>()
        });
        (node, Rotation::between(&rest, &now))
    };
    nodes_around(facets).into_iter().map(turn).collect()
}

/// The outward unit normals of a facet at its nodes.
///
/// # Errors
/// If it turns away from its mean normal so far that it cannot be projected along that.
fn normals_at_nodes<const D: usize>(
    mesh: &Mesh<D>,
    facet: &Facet<D>,
    mean: [f64; D],
) -> Result<[[f64; D]; 9], ContactError>
where
    ElementKind: Topology<D>,
{
    let mut normals = [mean; 9];
    let (x, len) = mesh.places_of(facet);
    // Facets of first order have one normal here: the warp of a quadrilateral says nothing about the surface.
    if len > facet_corners(facet).len() {
        let true_ones = <ElementKind as Topology<D>>::normals_at_nodes(&x[..len]);
        for ((normal, true_one), &place) in normals.iter_mut().zip(true_ones).zip(&x) {
            *normal = true_one;
            if !(dot(true_one, mean) > -super::FACING) {
                let place = place.into();
                return Err(ContactError::Folded { place });
            }
        }
    }
    Ok(normals)
}

/// The smooth part that each facet of a boundary belongs to, with edges sharper than an angle, in degrees, between them.
///
/// # Errors
/// If a facet is folded.
pub(crate) fn smooth_parts_of<const D: usize>(
    mesh: &Mesh<D>,
    facets: &[Facet<D>],
    edge_angle: f64,
) -> Result<Vec<u32>, ContactError>
where
    ElementKind: Topology<D>,
{
    let at_nodes: Vec<_> = (facets.iter())
        .map(|facet| normals_at_nodes(mesh, facet, mesh.facet_normal(facet).1))
        .collect::<Result<_, _>>()?;
    Ok(smooth_parts(facets, &at_nodes, edge_angle))
}

/// The smooth part of each facet where parts go on beyond a side of a sector: at other nodes of the same mesh, which no turn takes there.
fn joined_parts<const D: usize>(
    mesh: &Mesh<D>,
    facets: &[Facet<D>],
    part: Vec<u32>,
    options: &PairOptions<D>,
) -> Vec<u32>
where
    ElementKind: Topology<D>,
{
    let (Some(seams), Some(_)) = (options.seams, options.around) else {
        return part;
    };
    let is_still = |turn: &[[f64; D]; D]| (0..D).all(|c| turn[c][c] == 1.0);
    let mut at: HashMap<u32, Vec<(u32, [f64; D])>> = HashMap::new();
    for (facet, part) in facets.iter().zip(&part) {
        let normal = mesh.facet_normal(facet).1;
        for node in facet_nodes(facet) {
            at.entry(*node).or_default().push((*part, normal));
        }
    }
    let least = options.edge_angle.to_radians().cos() - 1e-9;
    let count = part.iter().map(|part| part + 1).max().unwrap_or(0);
    let mut groups = Groups::new(count as usize);
    for (node, beyond) in seams {
        let here = at.get(node).into_iter().flatten();
        for (part, normal) in here {
            let beyond = beyond.iter().filter(|(_, _, turn)| is_still(turn));
            for (other, there) in beyond.filter_map(|(other, ..)| at.get(other)).flatten() {
                if dot(*normal, *there) >= least {
                    groups.join(*part, *other);
                }
            }
        }
    }
    let numbers = groups.numbers().1;
    part.into_iter()
        .map(|part| numbers[part as usize])
        .collect()
}

/// The part of each facet: neighbours whose normals differ by at most the angle, in degrees, where they meet are in the
/// same part.
fn smooth_parts<const D: usize>(
    facets: &[Facet<D>],
    at_nodes: &[[[f64; D]; 9]],
    edge_angle: f64,
) -> Vec<u32>
where
    ElementKind: Topology<D>,
{
    // Rounding must not decide about meshes that have just this angle between their facets.
    let least = edge_angle.to_radians().cos() - 1e-9;
    let mut groups = Groups::new(facets.len());
    let mut at_edge: HashMap<[u32; 2], Vec<(u32, [f64; D])>> = HashMap::new();
    for ((number, facet), normals) in (0..).zip(facets).zip(at_nodes) {
        let corners = facet_corners(facet);
        let is_curved = facet_nodes(facet).len() > corners.len();
        for k in 0..corners.len() {
            let met = if D == 3 && is_curved {
                corners.len() + k
            } else {
                k
            };
            let beside = at_edge.entry(ridge::<D>(corners, k)).or_default();
            for &(other, normal) in &*beside {
                if dot(normals[met], normal) >= least {
                    groups.join(other, number);
                }
            }
            beside.push((number, normals[met]));
        }
    }
    groups.numbers().1
}
