//! Contact of single nodes with facets or an obstacle: collocated rows, for sets of nodes without facets to integrate over.
//!
//! Each node meets the nearest point of the other side, which moves with the nodes around it: ν·(uᵢ − Σⱼ φⱼ uⱼ) ≤ gap, with ν
//! against the outward normal there. The forces of both sides are opposite and act at one point, so that a pair has no moment
//! except that of friction across a gap. A uniform pressure is transferred as evenly as the nodes are spaced: for non-matching
//! meshes the mortar method is better, and needs facets. Facets of second order count as the straight parts between their nodes.

use super::search::{Beam, Search};
use super::sectors;
use super::{
    ContactError, ContactPlace, Friction, Obstacle, PairOptions, SlipBound, checked, frame,
    rounding,
};
use crate::elasticity::Body;
use crate::mesh::vector::{cross, dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, facet_nodes, facet_parts};
use rayon::prelude::*;
use std::collections::HashMap;

/// The opposite side of nodes.
#[derive(Clone, Copy)]
pub enum Met<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    /// The boundary of a body.
    Facets(&'a [Facet<D>]),
    /// A rigid obstacle.
    Obstacle(&'a Obstacle<D>),
}

/// A node may be beyond the rim of the other side by this part of its facets, along them: in the wedge between two that are bent
/// away.
const BEYOND: f64 = 0.05;
/// Normals that are as near as this part of their facets are averaged.
const AS_NEAR: f64 = 1e-6;
/// A facet around a node has a share of its area if its normal has this much of the direction to the other side.
const FACES: f64 = 0.1;

/// The nearest point of some facets.
struct Nearest<const D: usize> {
    weights: Vec<(u32, f64)>,
    /// Outward.
    normal: [f64; D],
    point: [f64; D],
}

/// The nodes that a node meets with their weights, ν, and the distance along it.
type Opposite<const D: usize> = (Vec<(u32, f64)>, [f64; D], f64);

/// The contact places of single nodes. `around` are the outer facets that have any of them, from which they get their
/// areas. A node without such a facet has the area 1, so that its pressure is its force.
///
/// # Errors
/// If nodes overlap with the other side or belong to it, do not find it within the search distance, or if a bound, coefficient,
/// stiffness, gap or interference is invalid.
pub fn node_contact<const D: usize>(
    body: &Body<D>,
    nodes: &[u32],
    around: &[Facet<D>],
    met: Met<D>,
    options: &PairOptions<D>,
) -> Result<Vec<ContactPlace<D>>, ContactError>
where
    ElementKind: Topology<D>,
{
    if let (Some(sectors), Met::Facets(others)) = (options.sectors, met) {
        return sectors::around(
            sectors,
            body,
            [around, others],
            options,
            |all, body, options| {
                let (nodes, met) = (all.beginning_nodes(nodes), Met::Facets(&all.others));
                let found = node_contact(body, &nodes, &all.facets, met, options)?;
                Ok(all.beginning(sectors, found))
            },
        );
    }
    let mesh = body.mesh;
    let rounding = rounding(body);
    let within = match met {
        Met::Facets(facets) => options.distance_between(body, around, facets),
        Met::Obstacle(obstacle) => options.distance_to(body, around, obstacle),
    } * (1.0 + 1e-9);
    let search = match met {
        Met::Facets(facets) => {
            let shared = nodes.iter().find(|node| {
                let mut all = facets.iter();
                all.any(|facet| facet_nodes(facet).contains(node))
            });
            if let Some(&node) = shared {
                let place = mesh.nodes[node as usize].into();
                return Err(ContactError::Shared { place });
            }
            Some((Search::new(mesh, facets), facets))
        }
        Met::Obstacle(_) => None,
    };
    // The facets around each node, where one of them may be across a wall of the other side.
    let mut numbers: HashMap<u32, Vec<usize>> = HashMap::new();
    for (number, facet) in around.iter().enumerate().take(options.walls.len()) {
        for &node in facet_nodes(facet) {
            numbers.entry(node).or_default().push(number);
        }
    }
    let found: Vec<Option<Opposite<D>>> = nodes
        .par_iter()
        .map(|&node| {
            let own = numbers.get(&node).map_or(&[][..], Vec::as_slice);
            let counts = |other: usize| {
                let other = options.walls.get(around.len() + other);
                let across = |&own: &usize| other.is_some_and(|o| options.walls[own].is_between(o));
                !own.iter().any(across)
            };
            let x = mesh.nodes[node as usize];
            match met {
                Met::Obstacle(obstacle) => {
                    let (distance, towards) = obstacle.distance(x);
                    Some((Vec::new(), towards, distance))
                }
                Met::Facets(_) => {
                    let (search, facets) = search.as_ref()?;
                    let near = nearest(mesh, search, facets, x, within, counts)?;
                    let distance = dot(minus(x, near.point), near.normal);
                    Some((near.weights, near.normal.map(|v| -v), distance))
                }
            }
        })
        .collect();
    let ways: Vec<_> = found
        .iter()
        .map(|found| found.as_ref().map(|found| found.1))
        .collect();
    let is_tie = matches!(options.friction, Friction::Tied);
    let areas = areas(body, nodes, around, &ways, is_tie);
    let mut places = Vec::new();
    for ((&node, area), found) in nodes.iter().zip(areas).zip(found) {
        let area = if area > 0.0 { area } else { 1.0 };
        let Some((partners, normal, distance)) = found else {
            continue;
        };
        let place = mesh.nodes[node as usize];
        // Of fields: where the node was at rest.
        let origin = options.rest.map_or(place, |rest| rest.nodes[node as usize]);
        if !normal.iter().all(|v| v.is_finite()) {
            let obstacle = match met {
                Met::Obstacle(obstacle) => obstacle.name(),
                Met::Facets(_) => {
                    return Err(ContactError::Folded {
                        place: place.into(),
                    });
                }
            };
            let place = place.into();
            return Err(ContactError::NoNormal { place, obstacle });
        }
        let gap = options.gap_at(place, distance, rounding);
        if options.interference.is_some() {
            checked("interference", place, -gap)?;
        } else if options.gap.is_some() {
            checked("gap", place, gap)?;
        } else if gap < 0.0 && !options.may_overlap() {
            let (place, depth) = (place.into(), -gap);
            return Err(match met {
                Met::Obstacle(_) => ContactError::Overlap { place, depth },
                Met::Facets(_) => ContactError::BodiesOverlap { place, depth },
            });
        }
        let bound = match options.friction {
            Friction::Tresca(tresca) => area * tresca(place),
            _ => 0.0,
        };
        let slip_bound = match options.friction.at(origin, bound)? {
            SlipBound::Given(_) if gap > within => SlipBound::Given(0.0),
            slip_bound => slip_bound,
        };
        places.push(ContactPlace {
            place,
            node: Some(node),
            own: vec![(node, 1.0)],
            partners,
            directed: Vec::new(),
            further: Vec::new(),
            sectors: None,
            frame: frame(normal),
            gap,
            area,
            part: 0,
            pool: places.len() as u32,
            slip_bound,
            compliance: options.compliance_at(origin, area)?,
        });
    }
    if places.is_empty() {
        return Err(ContactError::Apart {
            distance: within,
            nearest: f64::INFINITY,
        });
    }
    Ok(places)
}

/// The share that each node has of the facets around it that look at the other side, in its way; those of a tie may look away from it. 0
/// without such facets.
pub(crate) fn areas<const D: usize>(
    body: &Body<D>,
    nodes: &[u32],
    around: &[Facet<D>],
    ways: &[Option<[f64; D]>],
    is_tie: bool,
) -> Vec<f64>
where
    ElementKind: Topology<D>,
{
    let mut towards = vec![None; body.mesh.nodes.len()];
    for (&node, way) in nodes.iter().zip(ways) {
        towards[node as usize] = *way;
    }
    let facing = around.iter().filter(|facet| {
        let (_, outward) = body.mesh.facet_normal(facet);
        let mut ways = facet_nodes(*facet)
            .iter()
            .filter_map(|&node| towards[node as usize]);
        ways.any(|way| match is_tie {
            true => dot(outward, way).abs() > FACES,
            false => dot(outward, way) > FACES,
        })
    });
    let facing: Vec<Facet<D>> = facing.copied().collect();
    let shares = shares(body, &facing);
    nodes.iter().map(|&node| shares[node as usize]).collect()
}

/// The share that each node of the mesh has of the area of facets.
pub(crate) fn shares<const D: usize>(body: &Body<D>, facets: &[Facet<D>]) -> Vec<f64>
where
    ElementKind: Topology<D>,
{
    let mut shares = vec![0.0; body.mesh.nodes.len()];
    body.integrate_on_boundary(facets, &|_| 1.0, &mut shares);
    super::transformed::Transformed::new(body.plane, facets).share(&mut shares);
    shares
}

/// The point of facets nearest to x, within a distance along its normal; none beyond their rim.
fn nearest<const D: usize>(
    mesh: &Mesh<D>,
    search: &Search<D>,
    facets: &[Facet<D>],
    x: [f64; D],
    within: f64,
    counts: impl Fn(usize) -> bool,
) -> Option<Nearest<D>>
where
    ElementKind: Topology<D>,
{
    let (size, near) = nearest_of(mesh, search, facets, x, within, counts)?;
    let offset = minus(x, near.point);
    let along = dot(offset, near.normal);
    let beyond = length(std::array::from_fn::<_, D, _>(|c| {
        offset[c] - along * near.normal[c]
    }));
    (along.abs() <= within && beyond <= BEYOND * size + AS_NEAR * along.abs()).then_some(near)
}

/// How far x is inside of the boundary that some facets are, below 0 outside, and the outward normal there; None where none of them
/// is within a distance along each axis.
pub(super) fn depth_within<const D: usize>(
    mesh: &Mesh<D>,
    search: &Search<D>,
    facets: &[Facet<D>],
    x: [f64; D],
    within: f64,
    counts: impl Fn(usize) -> bool,
) -> Option<(f64, [f64; D])>
where
    ElementKind: Topology<D>,
{
    let (_, near) = nearest_of(mesh, search, facets, x, within, counts)?;
    let offset = minus(x, near.point);
    let side = if dot(offset, near.normal) > 0.0 {
        -1.0
    } else {
        1.0
    };
    Some((side * length(offset), near.normal))
}

/// The point nearest to x of those facets near to it that count, with the size of its facet. Where several facets have that point, their
/// normals are averaged.
fn nearest_of<const D: usize>(
    mesh: &Mesh<D>,
    search: &Search<D>,
    facets: &[Facet<D>],
    x: [f64; D],
    within: f64,
    counts: impl Fn(usize) -> bool,
) -> Option<(f64, Nearest<D>)>
where
    ElementKind: Topology<D>,
{
    let axes = std::array::from_fn(|a| std::array::from_fn(|c| f64::from(u8::from(a == c))));
    let beam = Beam::around(axes, [x], [within; D]);
    let mut best: Option<(f64, f64, Nearest<D>)> = None;
    let near = search.near(beam).filter(|(number, _)| counts(*number));
    for facet in near.map(|(number, _)| &facets[number]) {
        let (area, normal) = mesh.facet_normal(facet);
        let size = if D == 2 { area } else { area.sqrt() };
        for part in facet_parts(facet) {
            let corners: Vec<[f64; D]> = part.iter().map(|&n| mesh.nodes[n as usize]).collect();
            let weights = closest(&corners, normal, x);
            let point: [f64; D] =
                std::array::from_fn(|c| weights.iter().zip(&corners).map(|(w, y)| w * y[c]).sum());
            let distance = length(minus(x, point));
            match &mut best {
                Some((_, of, near)) if length(minus(near.point, point)) <= AS_NEAR * *of => {
                    near.normal = std::array::from_fn(|c| near.normal[c] + normal[c]);
                }
                Some((least, ..)) if distance >= *least => {}
                _ => {
                    let weights = part.iter().copied().zip(weights).filter(|w| w.1 != 0.0);
                    let near = Nearest {
                        weights: weights.collect(),
                        normal,
                        point,
                    };
                    best = Some((distance, size, near));
                }
            }
        }
    }
    let (_, size, mut near) = best?;
    near.normal = unit(near.normal);
    Some((size, near))
}

/// The weights of the corners of a segment, triangle or quadrilateral at its point nearest to x.
fn closest<const D: usize>(corners: &[[f64; D]], normal: [f64; D], x: [f64; D]) -> Vec<f64> {
    let n = corners.len();
    if let Some(inside) = inside(corners, normal, x) {
        return inside;
    }
    // On an edge.
    let edges = if n == 2 { 1 } else { n };
    let mut best = (f64::INFINITY, vec![0.0; n]);
    for a in 0..edges {
        let b = (a + 1) % n;
        let (way, to) = (minus(corners[b], corners[a]), minus(x, corners[a]));
        let t = (dot(way, to) / dot(way, way)).clamp(0.0, 1.0);
        let rest: [f64; D] = std::array::from_fn(|c| to[c] - t * way[c]);
        let distance = dot(rest, rest);
        if distance < best.0 {
            let mut weights = vec![0.0; n];
            (weights[a], weights[b]) = (1.0 - t, t);
            best = (distance, weights);
        }
    }
    best.1
}

/// The same within a triangle or a quadrilateral, straight across it; None where that is outside.
fn inside<const D: usize>(corners: &[[f64; D]], normal: [f64; D], x: [f64; D]) -> Option<Vec<f64>> {
    if D == 2 || corners.len() < 3 {
        return None;
    }
    // Two directions along the facet.
    let space = |v: [f64; D]| -> [f64; 3] { std::array::from_fn(|c| v[c]) };
    let nu = space(normal);
    let first = space(minus(corners[1], corners[0]));
    let along = dot(first, nu);
    let s = unit(std::array::from_fn::<_, 3, _>(|c| first[c] - along * nu[c]));
    let t = cross(nu, s);
    let flat = |y: [f64; D]| {
        let to = space(minus(y, corners[0]));
        [dot(to, s), dot(to, t)]
    };
    let p: Vec<[f64; 2]> = corners.iter().map(|&y| flat(y)).collect();
    let [u, v] = flat(x);
    let weights = if p.len() == 3 {
        let det = p[1][0] * p[2][1] - p[2][0] * p[1][1];
        let b = (u * p[2][1] - p[2][0] * v) / det;
        let c = (p[1][0] * v - u * p[1][1]) / det;
        vec![1.0 - b - c, b, c]
    } else {
        // Newton's method for the position in the unit square; a convex quadrilateral takes a few steps.
        let [mut a, mut b] = [0.5, 0.5];
        let at = |a: f64, b: f64| [(1.0 - a) * (1.0 - b), a * (1.0 - b), a * b, (1.0 - a) * b];
        for _ in 0..20 {
            let (f, da, db) = (
                at(a, b),
                [b - 1.0, 1.0 - b, b, -b],
                [a - 1.0, -a, a, 1.0 - a],
            );
            let sum = |w: [f64; 4], c: usize| (0..4).map(|k| w[k] * p[k][c]).sum::<f64>();
            let (r, e) = (u - sum(f, 0), v - sum(f, 1));
            let [xa, xb, ya, yb] = [sum(da, 0), sum(db, 0), sum(da, 1), sum(db, 1)];
            let det = xa * yb - xb * ya;
            let (step_a, step_b) = ((r * yb - xb * e) / det, (xa * e - r * ya) / det);
            (a, b) = (a + step_a, b + step_b);
            if !(step_a.abs() + step_b.abs() > 1e-14) {
                break;
            }
        }
        at(a, b).to_vec()
    };
    let is_inside = weights.iter().all(|&w| (-1e-12..=1.0 + 1e-12).contains(&w));
    is_inside.then_some(weights)
}
