//! How the forces of pairs of bodies turn with their surfaces: the part of the tangent that contact has.
//!
//! A pressure p acts on both sides, as −p n with the outward normal n of each. It turns with the sides, and acts elsewhere as one
//! side moves along the other. Let δ and Δ be two motions that keep the gap closed, a and A their tangential parts, and w and W their
//! normal parts, in which both sides agree. Then all of this without friction is the sum over both sides of
//!
//! ```text
//! −∫ p (a·∇W + A·∇w − a·κA) ds,     κ = ∇n,     w = n·δ
//! ```
//!
//! with ∇ along the surface: the second derivative of the gap by the motions, times p. It is symmetric, no term couples one side
//! to the other, and it has the pattern of K. Where both sides stick to each other the two parts cancel.

use super::super::contacts::PairData;
use super::super::elastic::Elastic;
use super::Block;
use super::meeting::{Meeting, of_pair};
use crate::contact::Space;
use crate::mesh::vector::{dot, unit};
use crate::mesh::{ElementKind, Facet, Mesh, Topology, facet_nodes};
use std::array::from_fn;
use std::collections::HashMap;

/// A facet of displaced bodies.
struct Turned<'f, const D: usize> {
    nodes: &'f [u32],
    measure: f64,
    /// At each of its nodes.
    normals: Vec<[f64; D]>,
    slopes: Vec<Vec<[f64; D]>>,
}

/// The facets of a side.
fn facets_of<'f, const D: usize>(moved: &Mesh<D>, facets: &'f [Facet<D>]) -> Vec<Turned<'f, D>>
where
    ElementKind: Topology<D>,
{
    let turned = facets.iter().map(|facet| {
        let (x, len) = moved.places_of(facet);
        Turned {
            nodes: facet_nodes(facet),
            measure: moved.facet_normal(facet).0,
            normals: <ElementKind as Topology<D>>::normals_at_nodes(&x[..len]),
            slopes: <ElementKind as Topology<D>>::slopes_at_nodes(&x[..len]),
        }
    });
    turned.collect()
}

/// Adds the part of forces on nodes of a side in the tangent: the integral with its points at the nodes.
fn add_side<const D: usize>(
    facets: &[Turned<D>],
    forces: &HashMap<u32, [f64; D]>,
    blocks: &mut Vec<Block<D>>,
) {
    let mut normals: HashMap<u32, [f64; D]> = HashMap::new();
    // Of several facets at a node those have the force that face it.
    let mut facing: HashMap<u32, f64> = HashMap::new();
    for facet in facets {
        for (node, normal) in facet.nodes.iter().zip(&facet.normals) {
            let sum = normals.entry(*node).or_insert([0.0; D]);
            (0..D).for_each(|c| sum[c] += facet.measure * normal[c]);
            if let Some(force) = forces.get(node) {
                let part = dot(*force, *normal).abs();
                *facing.entry(*node).or_default() += facet.measure * part;
            }
        }
    }
    for facet in facets {
        for (k, node) in facet.nodes.iter().enumerate() {
            let Some(force) = forces.get(node) else {
                continue;
            };
            let (normal, slopes) = (facet.normals[k], &facet.slopes[k]);
            let pressing = -dot(*force, normal);
            let share = facet.measure * pressing.abs() / facing[node];
            if !(share > 0.0) {
                continue;
            }
            let size = share * pressing;
            let mut curved = [[0.0; D]; D];
            for (&other, slope) in facet.nodes.iter().zip(slopes) {
                // −p (a·∇φ) (n·Δ), and its transpose.
                let part: [[f64; D]; D] = from_fn(|i| from_fn(|j| -size * slope[i] * normal[j]));
                blocks.push(([*node, other], part));
                blocks.push(([other, *node], from_fn(|i| from_fn(|j| part[j][i]))));
                let towards = match normals[&other] {
                    // Of a lip with both of its sides.
                    none if none == [0.0; D] => normal,
                    sum => unit(sum),
                };
                let across = dot(towards, normal);
                for i in 0..D {
                    for j in 0..D {
                        let along = towards[j] - across * normal[j];
                        curved[i][j] -= 0.5 * size * slope[i] * along;
                        curved[j][i] -= 0.5 * size * slope[i] * along;
                    }
                }
            }
            blocks.push(([*node; 2], curved));
        }
    }
}

impl<const D: usize> Elastic<D>
where
    ElementKind: Space<D>,
{
    /// Adds the part of pairs of bodies that slide in the tangent.
    pub(super) fn turns(&self, moved: &Mesh<D>, met: &Meeting<D>, blocks: &mut Vec<Block<D>>) {
        for (number, data) in (0..)
            .zip(&self.pairs)
            .filter(|(_, data)| PairData::slides(data))
        {
            let mut forces: [HashMap<u32, [f64; D]>; 2] = Default::default();
            for touch in of_pair(&met.touches, number) {
                let nu = touch.place.frame[0];
                let pressing = dot(touch.force, nu);
                if pressing == 0.0 {
                    continue;
                }
                let sides = touch.place.sides(0);
                for ((forces, side), sign) in forces.iter_mut().zip(sides).zip([-1.0, 1.0]) {
                    for &(node, weight) in side {
                        let nu = touch.place.back(node, nu);
                        let sum = forces.entry(touch.place.node_of(node)).or_insert([0.0; D]);
                        (0..D).for_each(|c| sum[c] += sign * weight * pressing * nu[c]);
                    }
                }
            }
            for (facets, forces) in [&data.facets, &data.others].into_iter().zip(&forces) {
                if !forces.is_empty() {
                    add_side(&facets_of(moved, facets), forces, blocks);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::structured::{CellShape, SolidShape, block, rectangle};
    use crate::mesh::vector::{cross, length};

    /// The change of the forces along a side by a rigid motion under a uniform pressure of 1, against the forces that
    /// turn with it. It is the largest error over the largest force, at nodes far enough inside of the side, where
    /// normals are averaged from both sides.
    fn error_of<const D: usize>(
        mesh: &Mesh<D>,
        is_inside: impl Fn(u32) -> bool,
        motion: impl Fn([f64; D]) -> [f64; D],
    ) -> f64
    where
        ElementKind: Topology<D>,
    {
        let side = &mesh.boundaries["top"];
        let mut forces: HashMap<u32, [f64; D]> = HashMap::new();
        for facet in side {
            let (x, len) = mesh.places_of(facet);
            <ElementKind as Topology<D>>::facet_points(&x[..len], |point| {
                for (node, shape) in facet_nodes(facet).iter().zip(point.shape) {
                    let sum = forces.entry(*node).or_insert([0.0; D]);
                    (0..D).for_each(|c| sum[c] -= point.weight * shape * point.normal[c]);
                }
            });
        }
        let mut blocks = Vec::new();
        add_side(&facets_of(mesh, side), &forces, &mut blocks);
        let mut change: HashMap<u32, [f64; D]> = HashMap::new();
        for ([a, b], block) in &blocks {
            let moved = motion(mesh.nodes[*b as usize]);
            let sum = change.entry(*a).or_insert([0.0; D]);
            (0..D).for_each(|c| sum[c] += dot(block[c], moved));
        }
        let origin = motion([0.0; D]);
        let (mut most, mut largest) = (0.0_f64, 0.0_f64);
        for (&node, &force) in forces.iter().filter(|(node, _)| is_inside(**node)) {
            // The tangent has the resistance of the side: the opposite.
            let turned = motion(force);
            let off: [f64; D] = from_fn(|c| change[&node][c] + turned[c] - origin[c]);
            let along = dot(off, unit(force));
            most = most.max(length(from_fn::<_, D, _>(|c| {
                off[c] - along * unit(force)[c]
            })));
            largest = largest.max(length(force));
        }
        most / largest
    }

    /// The forces of a side turn with it and do not change as it is shifted: exactly where it is flat, and nearly where it is curved.
    #[test]
    fn forces_turn_with_a_side() {
        let turn = |x: [f64; 2]| [-x[1], x[0]];
        let shift = |_: [f64; 2]| [0.7, -0.3];
        for second_order in [false, true] {
            let flat = rectangle([0.0; 2], [2.0, 1.0], [16, 2], CellShape::Quad, "body", "");
            let flat = match second_order {
                true => flat.raised().expect("no pyramids"),
                false => flat,
            };
            let mut ring = flat.clone();
            for x in &mut ring.nodes {
                let (radius, angle) = (1.0 + x[1], 1.0 - x[0]);
                *x = [radius * angle.sin(), radius * angle.cos()];
            }
            let is_inside = |node: u32| (0.24..1.76).contains(&flat.nodes[node as usize][0]);
            for motion in [turn as fn([f64; 2]) -> [f64; 2], shift] {
                let errors = [&flat, &ring].map(|mesh| error_of(mesh, is_inside, motion));
                assert!(errors[0] < 1e-13 && errors[1] < 0.02, "{errors:?}");
            }
        }
        let turn = |x: [f64; 3]| cross([0.4, -0.8, 0.3], x);
        for second_order in [false, true] {
            let shape = SolidShape::Hexahedron;
            let flat = block([0.0; 3], [2.0, 1.0, 1.0], [6, 6, 1], shape, "body", "");
            let flat = match second_order {
                true => flat.raised().expect("no pyramids"),
                false => flat,
            };
            let mut saddle = flat.clone();
            for x in &mut saddle.nodes {
                x[2] += 0.3 * x[0] * x[1] * x[2];
            }
            let is_inside = |node: u32| {
                let [x, y, _] = flat.nodes[node as usize];
                (0.6..1.4).contains(&x) && (0.3..0.7).contains(&y)
            };
            let errors = [&flat, &saddle].map(|mesh| error_of(mesh, is_inside, turn));
            assert!(errors[0] < 1e-13 && errors[1] < 0.05, "{errors:?}");
        }
    }
}
