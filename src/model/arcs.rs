//! Sides of a contact that are drawn as arcs about one axis (or as parts of balls about one point): between their facets the gap
//! goes up and down by what the facets lack to the arcs, which is not what was meant.

use crate::dense::{least_squares, symmetric_eigen};
use crate::mesh::vector::{dot, length, minus};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, facet_corners};
use faer::Mat;
use std::collections::BTreeSet;

/// Gaps that scatter by no more than this part of that between the arcs are even enough.
const EVEN: f64 = 0.1;
/// Normals that have less than this of a direction, as a part of their squares, stand on it: what lies around that is a cylinder.
const ACROSS: f64 = 1e-6;
/// Nodes are this near to an arc, as a part of how much the gap scatters.
const ON_ARC: f64 = 0.05;

/// The gap between two sides that are drawn as arcs about one axis, where the initial gaps `range` of their facets scatter by more
/// than a tenth of it, and of the largest.
pub(super) fn between_arcs<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
    range: [f64; 2],
) -> Option<f64>
where
    ElementKind: Topology<D>,
{
    let scatter = range[1] - range[0];
    if !(scatter > EVEN * range[1].abs() && scatter > 0.0) {
        return None;
    }
    let nodes = sides.map(|facets| -> Vec<[f64; D]> {
        let corners = facets.iter().flat_map(facet_corners);
        let corners: BTreeSet<u32> = corners.copied().collect();
        (corners.iter())
            .map(|&node| mesh.nodes[node as usize])
            .collect()
    });
    let across = directions_across(mesh, sides)?;
    let radii = concentric(&nodes, &across, ON_ARC * scatter)?;
    let [first, second] = radii;
    let gap = (first - second).abs();
    (scatter > EVEN * gap).then_some(gap)
}

/// The directions that arcs lie in: all of them, or those across the axis of a cylinder.
fn directions_across<const D: usize>(
    mesh: &Mesh<D>,
    sides: [&[Facet<D>]; 2],
) -> Option<Vec<[f64; D]>>
where
    ElementKind: Topology<D>,
{
    let mut squares = Mat::<f64>::zeros(D, D);
    for facet in sides.into_iter().flatten() {
        let (area, normal) = mesh.facet_normal(facet);
        for i in 0..D {
            for j in 0..D {
                squares[(i, j)] += area * normal[i] * normal[j];
            }
        }
    }
    let (values, vectors) = symmetric_eigen(&squares)?;
    let total: f64 = values.iter().sum();
    let some = (0..D).filter(|&k| values[k] > ACROSS * total);
    let some: Vec<[f64; D]> = some
        .map(|k| std::array::from_fn(|c| vectors[(c, k)]))
        .collect();
    // What is flat has one direction, and is no arc.
    (some.len() > 1).then_some(some)
}

/// The radii of two sets of points about one centre in some directions, if none is farther than `near` from its arc.
///
/// |x|² = 2 c·x + kᵢ for the points of side i, rᵢ² = kᵢ + |c|², by least squares; about a point among them, for accuracy.
fn concentric<const D: usize>(
    sides: &[Vec<[f64; D]>; 2],
    across: &[[f64; D]],
    near: f64,
) -> Option<[f64; 2]> {
    let origin = *sides[0].first()?;
    let points = || {
        let each = sides.iter().enumerate();
        each.flat_map(|(side, points)| points.iter().map(move |&x| (side, x)))
    };
    let flat = |x: [f64; D]| -> Vec<f64> {
        across
            .iter()
            .map(|way| dot(*way, minus(x, origin)))
            .collect()
    };
    let (rows, ways) = (points().count(), across.len());
    if rows < ways + 2 {
        return None;
    }
    let size = points()
        .map(|(_, x)| length(minus(x, origin)))
        .fold(0.0, f64::max);
    let mut matrix = Mat::<f64>::zeros(rows, ways + 2);
    let mut right = vec![0.0; rows];
    for (row, (side, x)) in points().enumerate() {
        for (k, v) in flat(x).into_iter().enumerate() {
            matrix[(row, k)] = 2.0 * v / size;
            right[row] += (v / size).powi(2);
        }
        matrix[(row, ways + side)] = 1.0;
    }
    let found = least_squares(matrix, &right);
    let centre: Vec<f64> = found[..ways].iter().map(|c| c * size).collect();
    let distance = |x: [f64; D]| {
        let offsets = flat(x)
            .into_iter()
            .zip(&centre)
            .map(|(x, c)| (x - c).powi(2));
        offsets.sum::<f64>().sqrt()
    };
    let mut radii = [0.0; 2];
    for (side, radius) in radii.iter_mut().enumerate() {
        let all: Vec<f64> = sides[side].iter().map(|&x| distance(x)).collect();
        *radius = all.iter().sum::<f64>() / all.len() as f64;
        // NaN is no arc, either.
        if !all.iter().all(|d| (d - *radius).abs() <= near) {
            return None;
        }
    }
    Some(radii)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
    use std::f64::consts::PI;

    /// A ring within another one, 1 and 1.01 apart from the axis where they meet, with so many cells along each.
    fn rings(cells: [usize; 2], wave: f64) -> Mesh {
        let rectangle = |origin: f64, cells: usize, name: &str| {
            let prefix = format!("{name}-");
            rectangle(
                [origin, 0.0],
                [0.5, 0.5],
                [2, cells],
                CellShape::Quad,
                name,
                &prefix,
            )
        };
        let mut mesh = join(
            rectangle(0.5, cells[0], "in"),
            rectangle(1.01, cells[1], "out"),
        );
        for x in &mut mesh.nodes {
            let (sin, cos) = (PI * x[1]).sin_cos();
            let r = x[0] + wave * (20.0 * x[1]).sin();
            *x = [3.0 + r * cos, r * sin - 7.0];
        }
        mesh
    }

    fn found(mesh: &Mesh, range: [f64; 2]) -> Option<f64> {
        let side = |name: &str| mesh.outer_facets(name).map(<[_]>::to_vec);
        let (inner, outer) = (side("in-right"), side("out-left"));
        let (Ok(inner), Ok(outer)) = (inner, outer) else {
            panic!("the boundaries of a rectangle")
        };
        between_arcs(mesh, [&inner, &outer], range)
    }

    #[test]
    fn rings_that_fit_have_one_gap() {
        let gap = found(&rings([9, 14], 0.0), [0.002, 0.012]).expect("arcs");
        assert!((gap - 0.01).abs() < 1e-9, "{gap}");
        // Even enough; and no arcs.
        assert_eq!(found(&rings([9, 14], 0.0), [0.0099, 0.0101]), None);
        assert_eq!(found(&rings([9, 14], 0.01), [0.002, 0.012]), None);
        let flat = join(
            rectangle([0.0, 0.0], [0.5, 0.5], [2, 5], CellShape::Quad, "in", "in-"),
            rectangle(
                [0.6, 0.0],
                [0.5, 0.5],
                [2, 7],
                CellShape::Quad,
                "out",
                "out-",
            ),
        );
        assert_eq!(found(&flat, [0.0, 0.1]), None);
    }

    #[test]
    fn a_bolt_in_a_hole_is_round_about_its_axis() {
        let part = |origin: f64, cells: usize, name: &str| {
            let (from, prefix) = ([origin, 0.0, 0.0], format!("{name}-"));
            block(
                from,
                [0.5, 0.5, 1.0],
                [1, cells, 2],
                SolidShape::Hexahedron,
                name,
                &prefix,
            )
        };
        let mut mesh = join(part(0.5, 6, "in"), part(1.02, 9, "out"));
        for x in &mut mesh.nodes {
            let (sin, cos) = (PI * x[1]).sin_cos();
            // About an axis that is not one of the coordinates.
            let [a, b, c] = [x[0] * cos, x[0] * sin, x[2]];
            *x = [0.8 * a - 0.6 * c, b, 0.6 * a + 0.8 * c];
        }
        let side = |name: &str| mesh.outer_facets(name).map(<[_]>::to_vec);
        let (Ok(inner), Ok(outer)) = (side("in-right"), side("out-left")) else {
            panic!("the boundaries of a box")
        };
        let gap = between_arcs(&mesh, [&inner, &outer], [-0.01, 0.02]).expect("cylinders");
        assert!((gap - 0.02).abs() < 1e-9, "{gap}");
    }
}
