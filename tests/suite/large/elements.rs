//! Plane elements of first order by the formulas of textbooks, with no code of the solver: the oracle of random problems.

use signorini::elasticity::{Hyperelastic, Material};
use signorini::mesh::Mesh;
use std::array::from_fn;

pub type Point = [f64; 2];

pub fn turned(v: Point, angle: f64) -> Point {
    let (sin, cos) = angle.to_radians().sin_cos();
    [cos * v[0] - sin * v[1], sin * v[0] + cos * v[1]]
}

pub fn plus<const D: usize>(a: [f64; D], b: [f64; D]) -> [f64; D] {
    std::array::from_fn(|c| a[c] + b[c])
}

pub fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// The way to a point from the nearest one of an edge, and where the point is along the line of the edge, 0 to 1 from end to end.
pub fn away(x: Point, [a, b]: [Point; 2]) -> (Point, f64) {
    let along = minus(b, a);
    let s = dot(minus(x, a), along) / dot(along, along);
    let nearest = plus(a, along.map(|v| s.clamp(0.0, 1.0) * v));
    (minus(x, nearest), s)
}

pub fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub fn length(v: Point) -> f64 {
    v[0].hypot(v[1])
}

/// The first Piola–Kirchhoff stress in plane strain.
fn stress(material: &Material, f: [Point; 2]) -> [Point; 2] {
    let Material { young, poisson, .. } = *material;
    let mu = 0.5 * young / (1.0 + poisson);
    let lambda = young * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    let det = f[0][0] * f[1][1] - f[0][1] * f[1][0];
    match material.law {
        Hyperelastic::NeoHooke => {
            let inverse_transposed = [[f[1][1], -f[1][0]], [-f[0][1], f[0][0]]];
            let size = (lambda * det.ln() - mu) / det;
            from_fn(|i| from_fn(|j| mu * f[i][j] + size * inverse_transposed[i][j]))
        }
        Hyperelastic::StVenantKirchhoff => {
            let strain = |i: usize, j: usize| {
                let product = f[0][i] * f[0][j] + f[1][i] * f[1][j];
                0.5 * (product - if i == j { 1.0 } else { 0.0 })
            };
            let trace = strain(0, 0) + strain(1, 1);
            let second = |i: usize, j: usize| {
                2.0 * mu * strain(i, j) + if i == j { lambda * trace } else { 0.0 }
            };
            from_fn(|i| from_fn(|j| f[i][0] * second(0, j) + f[i][1] * second(1, j)))
        }
    }
}

/// The forces that hold the nodes where they are; a material for each region.
pub fn resisting(mesh: &Mesh, materials: &[Material], u: &[Point]) -> Vec<Point> {
    let mut forces = vec![[0.0; 2]; u.len()];
    let gauss = 1.0 / 3f64.sqrt();
    for element in &mesh.elements {
        let nodes = element.nodes();
        // Gradients on the reference element with weights.
        let points: Vec<(f64, Vec<Point>)> = match nodes.len() {
            3 => vec![(0.5, vec![[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])],
            _ => [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]
                .map(|at: Point| {
                    let [xi, eta] = at.map(|v| v * gauss);
                    let slopes = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(
                        |corner: Point| {
                            let [a, b] = corner;
                            [0.25 * a * (1.0 + b * eta), 0.25 * b * (1.0 + a * xi)]
                        },
                    );
                    (1.0, slopes.to_vec())
                })
                .to_vec(),
        };
        for (weight, local) in points {
            let mut j = [[0.0; 2]; 2];
            for (&node, slope) in nodes.iter().zip(&local) {
                let x = mesh.nodes[node as usize];
                (0..2).for_each(|r| (0..2).for_each(|c| j[r][c] += x[r] * slope[c]));
            }
            let det = j[0][0] * j[1][1] - j[0][1] * j[1][0];
            let slopes: Vec<Point> = (local.iter())
                .map(|[a, b]| {
                    [
                        (j[1][1] * a - j[1][0] * b) / det,
                        (-j[0][1] * a + j[0][0] * b) / det,
                    ]
                })
                .collect();
            let mut f = [[1.0, 0.0], [0.0, 1.0]];
            for (&node, slope) in nodes.iter().zip(&slopes) {
                let u = u[node as usize];
                (0..2).for_each(|r| (0..2).for_each(|c| f[r][c] += u[r] * slope[c]));
            }
            let stress = stress(&materials[element.region as usize], f);
            for (&node, slope) in nodes.iter().zip(&slopes) {
                let force = &mut forces[node as usize];
                (0..2).for_each(|r| force[r] += weight * det * dot(stress[r], *slope));
            }
        }
    }
    forces
}

/// The edges of a side, the body on their left.
pub fn edges(mesh: &Mesh, side: &str) -> Vec<[u32; 2]> {
    let x = |node: u32| mesh.nodes[node as usize];
    let facets = mesh.boundaries[side].iter();
    facets
        .map(|facet| {
            let [a, b] = [facet[0], facet[1]];
            let beside = mesh.elements.iter().find(|element| {
                let nodes = element.nodes();
                nodes.contains(&a) && nodes.contains(&b)
            });
            let nodes = beside.expect("an element").nodes();
            let sum = (nodes.iter()).fold([0.0; 2], |sum, &node| plus(sum, x(node)));
            let centre = sum.map(|v| v / nodes.len() as f64);
            match cross(minus(x(b), x(a)), minus(centre, x(a))) > 0.0 {
                true => [a, b],
                false => [b, a],
            }
        })
        .collect()
}

/// The nodes of a side, in order.
pub fn nodes(mesh: &Mesh, side: &str) -> Vec<usize> {
    let ends = edges(mesh, side).into_flattened().into_iter();
    let mut nodes: Vec<usize> = ends.map(|node| node as usize).collect();
    nodes.sort_unstable();
    nodes.dedup();
    nodes
}
