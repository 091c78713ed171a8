//! Whether a boundary has passed through itself, or a node into another body.

use super::frame;
use super::nodes::depth_within;
use super::search::{Beam, Search};
use crate::mesh::vector::{cross, dot, length, minus, unit};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, bounds, facet_nodes, facet_parts};
use rayon::prelude::*;
use std::array::from_fn;

/// D times the volume, with its sign, that D + 1 points span (in the plane twice the area).
fn volume<const D: usize>(x: &[[f64; D]]) -> f64 {
    let [a, b] = [minus(x[1], x[0]), minus(x[2], x[0])];
    match D {
        2 => a[0] * b[1] - a[1] * b[0],
        _ => {
            let [a, b, c] = [a, b, minus(x[3], x[0])].map(|v| from_fn(|c| v[c]));
            dot(cross(a, b), c)
        }
    }
}

/// Whether the way from p to q goes through the line or triangle between D points, by more than `depth` on either side.
fn passes<const D: usize>(p: [f64; D], q: [f64; D], through: &[[f64; D]], depth: f64) -> bool {
    let [a, b] = [1, D - 1].map(|k| minus(through[k], through[0]));
    let measure = match D {
        2 => length(a),
        _ => length(cross(from_fn(|c| a[c]), from_fn(|c| b[c]))),
    };
    let height = |x: [f64; D]| {
        let all: Vec<[f64; D]> = through.iter().copied().chain([x]).collect();
        volume(&all) / measure
    };
    let heights = [p, q].map(height);
    let is_deep = heights.iter().all(|height| height.abs() > depth);
    if !(is_deep && heights[0] * heights[1] < 0.0) {
        return false;
    }
    let turns = (0..D).map(|k| {
        let mut points = vec![p, q];
        points.extend((1..D).map(|next| through[(k + next) % D]));
        volume(&points)
    });
    let turns: Vec<f64> = turns.collect();
    match D {
        2 => turns[0] * turns[1] < 0.0,
        _ => turns.iter().all(|v| *v > 0.0) || turns.iter().all(|v| *v < 0.0),
    }
}

/// The lines or triangles that a facet consists of, between its nodes.
fn simplices<const D: usize>(facet: &Facet<D>) -> Vec<Vec<u32>>
where
    ElementKind: Topology<D>,
{
    let parts = facet_parts(facet).into_iter();
    let simplices = parts.flat_map(|part| match part[..] {
        [a, b, c, d] => vec![vec![a, b, c], vec![a, c, d]],
        _ => vec![part],
    });
    simplices.collect()
}

/// The nodes that lie inside a body with this surface, deeper than a distance. A ray from such a node crosses the surface an odd number of
/// times.
pub(crate) fn enclosed<const D: usize>(
    mesh: &Mesh<D>,
    nodes: &[u32],
    surface: &[Facet<D>],
    deeper: f64,
) -> Vec<u32>
where
    ElementKind: Topology<D>,
{
    let at = |node: &u32| mesh.nodes[*node as usize];
    let (low, high) = bounds(surface.iter().flat_map(facet_nodes).map(at));
    let is_near = |node: &&u32| (0..D).all(|c| (low[c]..=high[c]).contains(&at(node)[c]));
    let near: Vec<u32> = nodes.iter().filter(is_near).copied().collect();
    if near.is_empty() {
        return near;
    }
    let search = Search::new(mesh, surface);
    // Oblique, so that the ray misses the edges of most meshes.
    let axes = frame(unit(from_fn(|c| [0.642, 0.581, 0.501][c])));
    let far = 2.0 * length(minus(high, low));
    let crosses_out = |x: [f64; D]| {
        let out = from_fn(|c| x[c] + far * axes[0][c]);
        let facets = search.near(Beam::around(axes, [x, out], [0.0; D]));
        let simplices = facets.flat_map(|(_, facet)| simplices(&facet));
        let crossed = simplices.filter(|nodes| {
            let through: Vec<[f64; D]> = nodes.iter().map(at).collect();
            passes(x, out, &through, 0.0)
        });
        crossed.count() % 2 == 1
    };
    let is_deep = |x| depth_within(mesh, &search, surface, x, deeper, |_| true).is_none();
    let inside = |node: &u32| is_deep(at(node)) && crosses_out(at(node));
    near.into_par_iter().filter(inside).collect()
}

/// Whether an edge of a facet passes through another facet.
fn pierces<const D: usize>(mesh: &Mesh<D>, one: &Facet<D>, other: &Facet<D>, depth: f64) -> bool
where
    ElementKind: Topology<D>,
{
    let at = |node: &u32| mesh.nodes[*node as usize];
    let through: Vec<Vec<[f64; D]>> = (simplices(other).iter())
        .map(|nodes| nodes.iter().map(at).collect())
        .collect();
    simplices(one).iter().any(|nodes| {
        let edges = match D {
            2 => 1,
            _ => nodes.len(),
        };
        let mut edges = (0..edges).map(|k| [nodes[k], nodes[(k + 1) % nodes.len()]]);
        edges.any(|[p, q]| (through.iter()).any(|through| passes(at(&p), at(&q), through, depth)))
    })
}

/// Whether a boundary that has moved passes through itself, where it did not at rest, by more than `depth`. Pairs of facets that have no
/// node in common count, but those that are `seen`: these hold each other back.
pub(crate) fn crosses_itself<const D: usize>(
    [rest, moved]: [&Mesh<D>; 2],
    facets: &[Facet<D>],
    depth: f64,
    seen: impl Fn([usize; 2]) -> bool + Sync,
) -> bool
where
    ElementKind: Topology<D>,
{
    let search = Search::new(moved, facets);
    let axes = from_fn(|a| from_fn(|c| f64::from(u8::from(a == c))));
    facets.par_iter().enumerate().any(|(number, one)| {
        let nodes = facet_nodes(one);
        let (places, len) = moved.places_of(one);
        let mut near = search.near(Beam::around(axes, places[..len].iter().copied(), [0.0; D]));
        near.any(|(number_of_other, other)| {
            let apart = !facet_nodes(&other).iter().any(|node| nodes.contains(node));
            apart
                && !seen([number, number_of_other])
                && pierces(moved, one, &other, depth)
                && !pierces(rest, one, &other, 0.0)
        })
    })
}
