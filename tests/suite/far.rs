//! Problems with their nodes in another order: the answers stay the same.

use crate::common::Random;
use crate::common::models::{answer_by, on_the_cpu};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{SolidShape, block, join};
use signorini::mesh::{Element, Mesh};
use signorini::model::{Model, Pair, Support};

/// In space: a block, `up`, on another one, which it covers in part.
fn stacked(shape: SolidShape) -> Mesh<3> {
    let part = |origin, size, cells, name: &str| {
        block(origin, size, cells, shape, name, &format!("{name}-"))
    };
    join(
        part([0.0; 3], [1.0, 1.0, 0.5], [3, 2, 1], "low"),
        part([0.1, 0.15, 0.5], [0.7, 0.6, 0.4], [2, 2, 1], "up"),
    )
}

/// The largest difference, over the largest entry.
fn off(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    let most = |v: &mut dyn Iterator<Item = f64>| v.fold(0.0, |m: f64, v| m.max(v.abs()));
    most(&mut a.iter().zip(b).map(|(a, b)| a - b)) / most(&mut a.iter().copied())
}

/// The same mesh with its nodes in another order, and each element with another of its corners as the first; with the new number of each node.
fn renumbered(mesh: &Mesh<3>, seed: u64) -> (Mesh<3>, Vec<u32>) {
    let mut random = Random(seed);
    let mut number: Vec<u32> = (0..mesh.nodes.len() as u32).collect();
    for k in (1..number.len()).rev() {
        number.swap(k, random.between(0.0, (k + 1) as f64) as usize);
    }
    let mut nodes = mesh.nodes.clone();
    (number.iter().zip(&mesh.nodes)).for_each(|(&to, x)| nodes[to as usize] = *x);
    let elements = mesh.elements.iter().map(|old| {
        let mut all: Vec<u32> = (old.nodes().iter())
            .map(|&node| number[node as usize])
            .collect();
        // Three corners of a tetrahedron turn, or the four below and above of a hexahedron.
        let ring = all.len() / 2 + usize::from(all.len() == 4);
        let turns = random.between(0.0, ring as f64) as usize;
        for ring in all.chunks_exact_mut(ring) {
            ring.rotate_left(turns);
        }
        Element::new(old.kind(), &all, old.region)
    });
    let boundaries = mesh.boundaries.iter().map(|(name, facets)| {
        let facets = facets.iter().map(|facet| {
            let known = |node: u32| number.get(node as usize).copied().unwrap_or(node);
            facet.map(known)
        });
        (name.clone(), facets.collect())
    });
    let (elements, boundaries) = (elements.collect(), boundaries.collect());
    let made = Mesh::new(nodes, elements, mesh.regions.clone(), boundaries);
    (made.unwrap_or_else(|error| panic!("{error}")), number)
}

#[test]
fn answers_do_not_depend_on_the_order_of_nodes() {
    for shape in [SolidShape::Hexahedron, SolidShape::Tetrahedron] {
        let mesh = stacked(shape);
        // The side that has places is the smaller one, or ends beyond the other one, so that facets are covered in part.
        for (slave, master) in [("up-bottom", "low-top"), ("low-top", "up-bottom")] {
            for (second_order, large) in
                [(false, false), (false, true), (true, false), (true, true)]
            {
                let solve = |mesh: Mesh<3>| {
                    let mesh = match second_order {
                        true => mesh.raised().expect("no pyramids"),
                        false => mesh,
                    };
                    let model = Model::on(mesh)
                        .material(Material::new(100.0, 0.3))
                        .support(Support::on("low-bottom").fixed())
                        .support(Support::on("up-top").x(0.02).y(0.01).z(-0.01))
                        .contact(Pair::new(slave, master).coulomb(0.4));
                    let model = match large {
                        true => model.large_displacements(),
                        false => model,
                    };
                    let answer = answer_by(model, &on_the_cpu(1e-11, Stiffness::Cholesky));
                    let mut forces = answer.solution.lambda[..answer.m()].to_vec();
                    forces.sort_by(f64::total_cmp);
                    (answer.displacement(), forces)
                };
                let here = solve(mesh.clone());
                for seed in 1..4 {
                    let (other, number) = renumbered(&mesh, seed);
                    let there = solve(other);
                    let corners = (number.iter()).map(|&to| there.0[to as usize]);
                    let corners: Vec<[f64; 3]> = corners.collect();
                    let here_at = here.0[..mesh.nodes.len()].as_flattened();
                    let off = [off(here_at, corners.as_flattened()), off(&here.1, &there.1)];
                    let what = format!("{shape:?} {slave} {second_order} {large}");
                    assert!(off.iter().all(|v| *v < 1e-12), "{what}: {off:?}");
                }
            }
        }
    }
}
