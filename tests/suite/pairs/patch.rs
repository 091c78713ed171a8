//! Contact between two solids whose meshes do not match: states of constant stress across the interface, whatever the
//! elements, the direction and the law of friction; partly covered faces; the plane's interfaces, extruded.

use crate::common::Random;
use crate::common::models::{Answer, answer};
use crate::common::order::{Order, of_order};
use crate::common::space::{UPRIGHT, Vector, cross, dot, length, rotation, times};
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::Mesh;
use signorini::mesh::structured::{SolidShape, block, join};
use signorini::model::{Model, Pair, Support, Traction};

const RUBBER: Material = Material::new(3000.0, 0.4);

/// Elements of a block; `Both` are wedges in one half and hexahedra in the other, so that its faces have three and four
/// corners.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    Of(SolidShape),
    Both,
}

const HEXAHEDRA: Shape = Shape::Of(SolidShape::Hexahedron);
const TETRAHEDRA: Shape = Shape::Of(SolidShape::Tetrahedron);
const WEDGES: Shape = Shape::Of(SolidShape::Wedge);

/// A block from `from` on, its boundaries `name-left` …
fn solid(shape: Shape, from: Vector, size: Vector, cells: [usize; 3], name: &str) -> Mesh<3> {
    let of = |shape| block(from, size, cells, shape, name, &format!("{name}-"));
    let shape = match shape {
        Shape::Of(shape) => return of(shape),
        Shape::Both => SolidShape::Hexahedron,
    };
    // The nodes are the same, and so are edges between the halves, because wedges are upright.
    let (mut mesh, wedges) = (of(shape), of(SolidShape::Wedge));
    let half = from[0] + size[0] * (cells[0] / 2) as f64 / cells[0] as f64;
    let nodes = mesh.nodes.clone();
    let wedge_side = |numbers: &[u32]| {
        let sum: f64 = numbers.iter().map(|&node| nodes[node as usize][0]).sum();
        sum / (numbers.len() as f64) < half
    };
    mesh.elements.retain(|element| !wedge_side(element.nodes()));
    let others = wedges.elements.into_iter();
    (mesh.elements).extend(others.filter(|element| wedge_side(element.nodes())));
    for (name, faces) in &mut mesh.boundaries {
        faces.retain(|face| !wedge_side(face));
        let others = wedges.boundaries[name].iter().copied();
        faces.extend(others.filter(|face| wedge_side(face)));
    }
    mesh
}

/// Moves nodes that are not on a side across it: elements without a right angle, faces that are general quadrilaterals.
fn distort(mesh: &mut Mesh<3>, from: Vector, size: Vector, cells: [usize; 3], seed: u64) {
    let mut random = Random(seed);
    for node in &mut mesh.nodes {
        for c in 0..3 {
            let shift = random.between(-0.2, 0.2) * size[c] / cells[c] as f64;
            let at = node[c] - from[c];
            if at > 1e-9 && at < size[c] - 1e-9 {
                node[c] += shift;
            }
        }
    }
}

/// A block of 2 × 1.5 × 2 cut in two by a plane through the middle of its axis, and the normal of the cut, upwards.
fn cut(
    shapes: [Shape; 2],
    orders: [Order; 2],
    cells: [[usize; 3]; 2],
    [a, b]: [f64; 2],
) -> (Mesh<3>, Vector) {
    let size = [2.0, 1.5, 1.0];
    let [low, up] = [(0, "low"), (1, "up")].map(|(side, name)| {
        let from = [0.0, 0.0, side as f64];
        let mut mesh = solid(shapes[side], from, size, cells[side], name);
        distort(
            &mut mesh,
            from,
            size,
            cells[side],
            0x5eed_0f0b + side as u64,
        );
        for [x, y, z] in &mut mesh.nodes {
            *z += (a * (*x - 1.0) + b * (*y - 0.75)) * (1.0 - (*z - 1.0).abs());
        }
        of_order(mesh, orders[side])
    });
    let normal = [-a, -b, 1.0];
    (join(low, up), normal.map(|c| c / length(normal)))
}

/// The strain that makes a stress (columns; symmetric).
fn strain(stress: [Vector; 3]) -> [Vector; 3] {
    let (e, nu) = (RUBBER.young, RUBBER.poisson);
    let trace: f64 = (0..3).map(|c| stress[c][c]).sum();
    std::array::from_fn(|j| {
        std::array::from_fn(|i| {
            ((1.0 + nu) * stress[j][i] - if i == j { nu * trace } else { 0.0 }) / e
        })
    })
}

/// The force that holds the sides of a contact together.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Law {
    None,
    Tresca,
    Coulomb,
}

/// The least resultant and the least moment of the contact forces of a pair, relative to their terms.
fn unbalance(answer: &Answer<3>) -> [f64; 2] {
    let nodes = &answer.built.elastic.mesh.nodes;
    let (mut resultant, mut moment) = ([0.0; 3], [0.0; 3]);
    let (mut forces, mut moments) = (0.0, 0.0);
    for i in 0..answer.m() {
        let force = answer.contact_force(i);
        for (node, weight) in answer.hands_on(i) {
            let part = force.map(|f| weight * f);
            let about = cross(nodes[node as usize], part);
            for c in 0..3 {
                resultant[c] += part[c];
                moment[c] += about[c];
            }
            forces += length(part);
            moments += length(about);
        }
    }
    [length(resultant) / forces, length(moment) / moments]
}

/// A block that is cut in two and under the same stress everywhere behaves as if it were whole: displacement, stress,
/// and the traction of each contact node. The upper part is held by the contact alone where there is friction; the whole
/// is turned by a rotation.
fn patch(
    (mesh, normal): (Mesh<3>, Vector),
    sides: [&str; 2],
    law: Law,
    turn: &[Vector; 3],
    stiffness: Stiffness,
) -> f64 {
    let stress = match law {
        // Only pressure on the cut, and another one along it.
        Law::None => std::array::from_fn(|j| {
            std::array::from_fn(|i| {
                let along = if i == j { 1.0 } else { 0.0 } - normal[i] * normal[j];
                -10.0 * normal[i] * normal[j] - 3.0 * along
            })
        }),
        _ => [[-2.0, 1.0, -1.5], [1.0, -4.0, 2.0], [-1.5, 2.0, -10.0]],
    };
    let strain = strain(stress);
    let displacement = |x: Vector| times(&strain, x);
    let traction = times(&stress, normal);
    let pressure = -dot(traction, normal);
    let shear = length(std::array::from_fn(|c| traction[c] + pressure * normal[c]));
    let mut mesh = mesh;
    for node in &mut mesh.nodes {
        *node = times(turn, *node);
    }
    let (columns, inverse) = (*turn, *turn);
    let along = move |c: usize| {
        move |x: Vector| {
            let back = inverse.map(|column| dot(column, x));
            times(&columns, times(&strain, back))[c]
        }
    };
    let mut pair = Pair::new(sides[0], sides[1]);
    pair = match law {
        Law::None => pair,
        Law::Tresca => pair.tresca(1.25 * shear),
        Law::Coulomb => pair.coulomb(1.25 * shear / pressure),
    };
    let held: &[&str] = match law {
        Law::None => &["low-bottom", "up-top"],
        _ => &["low-bottom"],
    };
    let held = held.iter().map(|name| name.to_string()).collect::<Vec<_>>();
    let mut model = Model::on(mesh)
        .material(RUBBER)
        .support(Support::on(held).x(along(0)).y(along(1)).z(along(2)))
        .contact(pair);
    for body in ["low", "up"] {
        let outer = [
            ("left", 0, -1.0),
            ("right", 0, 1.0),
            ("front", 1, -1.0),
            ("back", 1, 1.0),
            ("top", 2, 1.0),
        ];
        for (side, c, sign) in outer {
            if side == "top" && (body == "low" || law == Law::None) {
                continue;
            }
            let [x, y, z] = times(turn, stress[c].map(|s| sign * s));
            let name = format!("{body}-{side}");
            model = model.traction(Traction::on(name.as_str()).x(x).y(y).z(z));
        }
    }
    let answer = answer(model, 1e-11, stiffness);
    let back = |x: Vector| turn.map(|column| dot(column, x));
    let mut worst = 0.0f64;
    let mut off = |value: f64, expected: f64, scale: f64| {
        worst = worst.max((value - expected).abs() / scale);
    };
    let nodes = &answer.built.elastic.mesh.nodes;
    let largest = nodes.iter().map(|&x| length(displacement(back(x))));
    let largest = largest.fold(0.0, f64::max);
    for (u, &x) in answer.displacement().iter().zip(nodes) {
        let (u, expected) = (back(*u), displacement(back(x)));
        (0..3).for_each(|c| off(u[c], expected[c], largest));
    }
    for s in answer.stresses() {
        let found = [[s.xx, s.xy, s.zx], [s.xy, s.yy, s.yz], [s.zx, s.yz, s.zz]];
        for j in 0..3 {
            let column = back(times(&found, turn[j]));
            (0..3).for_each(|c| off(column[c], stress[j][c], 10.0));
        }
    }
    let sign = if sides[0] == "low-top" { 1.0 } else { -1.0 };
    for i in 0..answer.m() {
        let found = back(answer.contact_force(i).map(|f| f / answer.area(i)));
        (0..3).for_each(|c| off(found[c], sign * traction[c], pressure));
        off(answer.pressure(i), pressure, pressure);
    }
    assert!(answer.m() >= 12);
    if law != Law::None {
        let sets = answer.solution.sets.sizes(|_| true);
        assert_eq!((sets.stick, sets.separated), (answer.m(), 0), "{sets:?}");
    }
    for off in unbalance(&answer) {
        assert!(off < 1e-12, "{off:e}");
    }
    worst
}

const SIDES: [[&str; 2]; 2] = [["low-top", "up-bottom"], ["up-bottom", "low-top"]];

#[test]
fn patch_test_between_solids() {
    let meshes = [
        ([HEXAHEDRA, HEXAHEDRA], [[5, 4, 2], [3, 5, 2]]),
        ([TETRAHEDRA, HEXAHEDRA], [[4, 3, 2], [5, 4, 2]]),
        ([WEDGES, TETRAHEDRA], [[4, 4, 2], [5, 3, 2]]),
        ([Shape::Both, Shape::Both], [[6, 3, 2], [4, 5, 2]]),
    ];
    patch_tests(&meshes.map(|(shapes, cells)| (shapes, [Order::First; 2], cells)));
}

/// The same with faces of six, eight and nine nodes, against each other and against those of first order.
#[test]
fn patch_test_between_solids_of_second_order() {
    use Order::{First, Lagrange, Serendipity};
    patch_tests(&[
        (
            [HEXAHEDRA, HEXAHEDRA],
            [Serendipity, Lagrange],
            [[4, 3, 1], [3, 4, 1]],
        ),
        (
            [TETRAHEDRA, HEXAHEDRA],
            [Lagrange, Serendipity],
            [[3, 2, 1], [4, 3, 1]],
        ),
        (
            [TETRAHEDRA, WEDGES],
            [Lagrange, Lagrange],
            [[3, 3, 1], [4, 2, 1]],
        ),
        (
            [Shape::Both, TETRAHEDRA],
            [Serendipity, First],
            [[4, 3, 1], [4, 3, 1]],
        ),
        (
            [HEXAHEDRA, TETRAHEDRA],
            [First, Lagrange],
            [[4, 3, 1], [3, 3, 1]],
        ),
    ]);
}

/// The elements of both sides, their orders and cells.
type Sides = ([Shape; 2], [Order; 2], [[usize; 3]; 2]);

fn patch_tests(meshes: &[Sides]) {
    let turns = [UPRIGHT, rotation([1.0, -0.4, 2.0], 1.1)];
    for &(shapes, orders, cells) in meshes {
        for slope in [[0.0; 2], [0.3, -0.2]] {
            let mut worst = [0.0f64; 2];
            for sides in SIDES {
                for law in [Law::None, Law::Tresca, Law::Coulomb] {
                    for (turn, worst) in turns.iter().zip(&mut worst) {
                        let off = patch(
                            cut(shapes, orders, cells, slope),
                            sides,
                            law,
                            turn,
                            Stiffness::Cholesky,
                        );
                        *worst = worst.max(off);
                    }
                }
            }
            println!(
                "{shapes:?} {orders:?} on a slope of {slope:?}: off by {:.1e}, turned {:.1e}",
                worst[0], worst[1]
            );
            assert!(worst.iter().all(|&off| off < 1e-9), "{worst:?}");
        }
    }
}

/// A block that hangs over on two sides, turned and pushed: the covered part of the faces bears the whole load, nothing
/// is lost between the bodies, and the pair turns neither of them.
#[test]
fn partly_covered_faces_hand_on_all_force() {
    for orders in [
        [Order::First; 2],
        [Order::Serendipity, Order::Lagrange],
        [Order::Lagrange, Order::First],
    ] {
        partly_covered(orders);
    }
}

fn partly_covered(orders: [Order; 2]) {
    let turn = rotation([0.3, 1.0, 0.1], -1.6);
    let mut sinks = Vec::new();
    for sides in SIDES {
        for law in [Law::None, Law::Coulomb] {
            let low = solid(HEXAHEDRA, [0.0; 3], [2.0, 1.5, 1.0], [7, 5, 3], "low");
            let up = solid(
                TETRAHEDRA,
                [0.77, 0.41, 1.0],
                [1.5, 1.3, 0.8],
                [5, 4, 3],
                "up",
            );
            let mut mesh = join(of_order(low, orders[0]), of_order(up, orders[1]));
            for node in &mut mesh.nodes {
                *node = times(&turn, *node);
            }
            let [x, y, z] = turn;
            let load = move |c: usize| {
                move |place: Vector| {
                    let [x0, y0] = [x, y].map(|axis| dot(axis, place));
                    0.2 * x[c] - 0.3 * y[c] - (8.0 - 2.0 * x0 - y0) * z[c]
                }
            };
            let mut pair = Pair::new(sides[0], sides[1]);
            if law == Law::Coulomb {
                pair = pair.coulomb(0.5);
            }
            let mut model = Model::on(mesh)
                .material(RUBBER)
                .support(Support::on("low-bottom").fixed())
                .contact(pair);
            // Without friction something else has to bear the push along the face.
            let whole = match law {
                Law::Coulomb => 3,
                _ => 1,
            };
            let traction = match whole {
                3 => Traction::on("up-top").x(load(0)).y(load(1)).z(load(2)),
                _ => {
                    let down = move |c: usize| {
                        move |place: Vector| {
                            let along: f64 = (0..3).map(|c| load(c)(place) * z[c]).sum();
                            along * z[c]
                        }
                    };
                    Traction::on("up-top").x(down(0)).y(down(1)).z(down(2))
                }
            };
            model = model.traction(traction);
            let answer = answer(model, 1e-10, Stiffness::Cholesky);
            for off in unbalance(&answer) {
                assert!(off < 1e-12, "{off:e}");
            }
            let mut sum = [0.0; 3];
            for i in 0..answer.m() {
                let force = answer.contact_force(i);
                (0..3).for_each(|c| sum[c] += force[c]);
            }
            let [total, contact, support] = answer.resultants();
            let sign = if sides[0] == "low-top" { 1.0 } else { -1.0 };
            let size = length(total);
            for c in 0..3 {
                assert!(
                    (sign * sum[c] - total[c]).abs() < 1e-8 * size,
                    "{sum:?} {total:?}"
                );
                assert!(
                    (total[c] + support[c]).abs() < 1e-8 * size && contact[c].abs() < 1e-9 * size
                );
            }
            let nodes = &answer.built.elastic.mesh.nodes;
            let sink = (nodes.iter().zip(answer.displacement()))
                .map(|(_, u)| dot(u, z))
                .fold(0.0, f64::min);
            let loose = (0..answer.m()).filter(|&i| answer.solution.sets.is_separated(i));
            println!(
                "{sides:?} {orders:?} {law:?}: {} contact nodes, {} of them separated, sinks by {sink:.4e}",
                answer.m(),
                loose.count()
            );
            sinks.push(sink);
        }
    }
    // The result hardly depends on which side is named first.
    for law in [0, 1] {
        assert!((sinks[law] / sinks[2 + law] - 1.0).abs() < 0.1, "{sinks:?}");
    }
}
