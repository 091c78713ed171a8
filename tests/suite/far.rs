//! Problems far from the origin, and with their nodes in another order: the answers stay the same.

use crate::common::Random;
use crate::common::models::{answer_by, on_the_cpu};
use signorini::contact::{Obstacle, Space};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{Element, ElementKind, Mesh};
use signorini::model::{Model, Pair, Support, Traction};

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
    assert!(b.iter().all(|v| v.is_finite()));
    let most = |v: &mut dyn Iterator<Item = f64>| v.fold(0.0, |m: f64, v| m.max(v.abs()));
    most(&mut a.iter().zip(b).map(|(a, b)| a - b)) / most(&mut a.iter().copied())
}

/// Two blocks so far from the origin along each axis: the lower one is held, and the upper one is pushed on it or on a plane, by its upper
/// side or by tractions.
fn compare<const D: usize>(mesh: &Mesh<D>, push: fn(Support<D>) -> Support<D>)
where
    ElementKind: Space<D>,
{
    // Places are on a grid so coarse that all are numbers there, too.
    const GRID: f64 = 1.0 / (1 << 28) as f64;
    let solve = |away: f64, [second_order, large, pushed, on_plane]: [bool; 4]| {
        let mut mesh = mesh.clone();
        if second_order {
            mesh = mesh.raised().expect("no pyramids");
        }
        let place = |x: f64| (x / GRID).round() * GRID + away;
        mesh.nodes.iter_mut().for_each(|x| *x = x.map(place));
        let (mut point, mut normal) = ([away; D], [0.0; D]);
        (point[D - 1], normal[D - 1]) = (place(0.5), 1.0);
        let contact = match on_plane {
            true => Pair::obstacle("up-bottom", Obstacle::HalfSpace { point, normal }),
            false => Pair::new("up-bottom", "low-top"),
        };
        let model = Model::on(mesh)
            .material(Material::new(100.0, 0.3))
            .support(Support::on("low-bottom").fixed())
            .contact(contact.coulomb(0.4));
        let model = match pushed {
            true => model.support(push(Support::on("up-top"))),
            false => model.traction(Traction::on("up-top").pressure(1.0).x(0.1)),
        };
        let model = match large {
            true => model.large_displacements(),
            false => model,
        };
        let answer = answer_by(model, &on_the_cpu(1e-10, Stiffness::Cholesky));
        (answer.displacement(), answer.solution.lambda)
    };
    for bits in 0..16 {
        let flags = std::array::from_fn(|k| bits >> k & 1 == 1);
        let here = solve(0.0, flags);
        // Displaced places are rounded, and balance counts as met up to that: 6e-8 was found at 4096 sizes and 2e-7 at 65536, where
        // displacements are small 4e-10.
        for (away, limit) in match (flags[1], D) {
            (false, _) => &[(1048576.0, 1e-8)][..],
            (true, 2) => &[(4096.0, 1e-6)],
            (true, _) => &[(4096.0, 1e-6), (65536.0, 1e-5)],
        } {
            let there = solve(*away, flags);
            let off = [
                off(here.0.as_flattened(), there.0.as_flattened()),
                off(&here.1, &there.1),
            ];
            assert!(off.iter().all(|v| v < limit), "{flags:?} {away}: {off:?}");
        }
    }
}

#[test]
fn answers_do_not_depend_on_the_distance_from_the_origin() {
    for shape in [CellShape::Quad, CellShape::Triangle] {
        let part = |origin, size, cells, name: &str| {
            rectangle(origin, size, cells, shape, name, &format!("{name}-"))
        };
        let mesh = join(
            part([0.0; 2], [1.0, 0.5], [6, 3], "low"),
            part([0.1, 0.5], [0.7, 0.4], [4, 3], "up"),
        );
        compare(&mesh, |top| top.x(0.02).y(-0.01));
    }
    for shape in [SolidShape::Hexahedron, SolidShape::Tetrahedron] {
        compare(&stacked(shape), |top| top.x(0.02).y(0.0).z(-0.01));
    }
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
