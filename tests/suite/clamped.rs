//! Contact where supports hold nodes of the boundary that carries the multipliers: only touching places may push, whichever
//! side is named first.

use crate::common::Random;
use crate::common::draw::{chance, generator, pick};
use crate::common::models::{Answer, answer};
use crate::common::order::{Order, of_order};
use signorini::contact::Space;
use signorini::elasticity::Material;
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, join, rectangle};
use signorini::mesh::{ElementKind, Mesh};
use signorini::model::{Equal, Model, Pair, Support, Traction};
use signorini::reference::MATERIAL;

fn material(poisson: f64) -> Material {
    Material {
        young: 1000.0,
        poisson,
        ..MATERIAL
    }
}

const LENGTH: f64 = 10.0;

/// A leaf of a spring, from x = 0 to the length.
#[derive(Clone, Copy)]
struct Leaf {
    low: f64,
    height: f64,
    cells: [usize; 3],
    order: Order,
    is_split: bool,
}

/// The differences between the plane and space.
trait Dimension<const D: usize>
where
    ElementKind: Space<D>,
{
    fn mesh(leaf: &Leaf, name: &str) -> Mesh<D>;
}

struct InPlane;
struct InSpace;

impl Dimension<2> for InPlane {
    fn mesh(leaf: &Leaf, name: &str) -> Mesh {
        let shape = if leaf.is_split {
            CellShape::Triangle
        } else {
            CellShape::Quad
        };
        let [nx, ny, _] = leaf.cells;
        let (at, size) = ([0.0, leaf.low], [LENGTH, leaf.height]);
        let mesh = rectangle(at, size, [nx, ny], shape, name, &format!("{name}-"));
        of_order(mesh, leaf.order)
    }
}

impl Dimension<3> for InSpace {
    fn mesh(leaf: &Leaf, name: &str) -> Mesh<3> {
        let shape = if leaf.is_split {
            SolidShape::Tetrahedron
        } else {
            SolidShape::Hexahedron
        };
        let [nx, ny, nz] = leaf.cells;
        let (at, size) = ([0.0, 0.0, leaf.low], [LENGTH, 3.0, leaf.height]);
        let mesh = block(at, size, [nx, nz, ny], shape, name, &format!("{name}-"));
        of_order(mesh, leaf.order)
    }
}

fn upright<const D: usize>(load: f64) -> [f64; D] {
    std::array::from_fn(|c| if c == D - 1 { load } else { 0.0 })
}

/// Leaves on each other, clamped at x = 0, each with a force at its other end.
fn leaves<const D: usize, S: Dimension<D>>(
    all: &[Leaf],
    loads: &[f64],
    is_swapped: bool,
    poisson: f64,
    join_sides: impl Fn(Model<D>, &str, &str) -> Model<D>,
) -> Model<D>
where
    ElementKind: Space<D>,
{
    let name = |i: usize| format!("leaf{i}");
    let meshes = all
        .iter()
        .enumerate()
        .map(|(i, leaf)| S::mesh(leaf, &name(i)));
    let mesh = meshes.reduce(join).expect("there are leaves");
    let mut model = Model::on(mesh).material(material(poisson));
    for (i, &load) in loads.iter().enumerate() {
        model = model
            .support(Support::on(format!("{}-left", name(i))).fixed())
            .traction(Traction::on(format!("{}-right", name(i))).force(upright(load)));
    }
    for i in 1..all.len() {
        let mut sides = [
            format!("{}-top", name(i - 1)),
            format!("{}-bottom", name(i)),
        ];
        if is_swapped {
            sides.reverse();
        }
        model = join_sides(model, &sides[0], &sides[1]);
    }
    model
}

fn touch<const D: usize>(model: Model<D>, a: &str, b: &str) -> Model<D>
where
    ElementKind: Space<D>,
{
    model.contact(Pair::new(a, b))
}

fn normal_forces<const D: usize>(answer: &Answer<D>) -> f64
where
    ElementKind: Space<D>,
{
    answer.solution.lambda[..answer.m()].iter().sum()
}

/// How far the ends of leaves have moved upwards.
fn ends<const D: usize>(answer: &Answer<D>, all: &[Leaf]) -> Vec<f64>
where
    ElementKind: Space<D>,
{
    let (nodes, u) = (&answer.built.elastic.mesh.nodes, answer.displacement());
    let tip = |leaf: &Leaf| {
        let is_inside = |x: &[f64; D]| {
            let height = (x[D - 1] - leaf.low) / leaf.height;
            x[0] > LENGTH - 1e-9 && height > 0.01 && height < 0.99
        };
        let own: Vec<f64> = (nodes.iter().zip(&u))
            .filter(|(x, _)| is_inside(x))
            .map(|(_, u)| u[D - 1])
            .collect();
        own.iter().sum::<f64>() / own.len() as f64
    };
    all.iter().map(tip).collect()
}

fn some_leaves(random: &mut Random, order: Order) -> Vec<Leaf> {
    let mut low = 0.0;
    let is_split = chance(random, 0.3);
    let coarser = if order == Order::First { 1 } else { 2 };
    (0..2 + random.below(3))
        .map(|_| {
            let height = 0.4 + 0.8 * random.unit();
            let nx = (4 + random.below(11)) / coarser;
            let leaf = Leaf {
                low,
                height,
                cells: [nx.max(3), 2, 1 + random.below(3)],
                order,
                is_split,
            };
            low += height;
            leaf
        })
        .collect()
}

/// Each leaf bends farther than the one below it, by ten times the difference under equal loads: nothing can touch.
fn pulled_apart<const D: usize, S: Dimension<D>>(seed: u64, number: usize)
where
    ElementKind: Space<D>,
{
    let orders = [Order::First, Order::Lagrange, Order::Serendipity];
    for number in 0..number {
        let mut random = generator(seed + number as u64);
        let order = pick(&mut random, &orders);
        let all = some_leaves(&mut random, order);
        let bends: &[f64] = match all.len() {
            2 => &[-1.0, 1.0],
            3 => &[-1.0, 0.0, 1.0],
            _ => &[-10.0, -1.0, 1.0, 10.0],
        };
        let loads: Vec<f64> = (bends.iter().zip(&all))
            .map(|(bend, leaf)| 0.02 * bend * leaf.height.powi(3))
            .collect();
        let poisson = pick(&mut random, &[0.0, 0.3, 0.4]);
        let law = random.below(3);
        for is_swapped in [false, true] {
            let pair = |model: Model<D>, a: &str, b: &str| {
                model.contact(match law {
                    0 => Pair::new(a, b),
                    1 => Pair::new(a, b).coulomb(0.4),
                    _ => Pair::new(a, b).normal_stiffness(1e5),
                })
            };
            let model = leaves::<D, S>(&all, &loads, is_swapped, poisson, pair);
            let answer = answer(model, 1e-8, Stiffness::Cholesky);
            let force = normal_forces(&answer);
            assert_eq!(
                force,
                0.0,
                "{D} dimensions, seed {}, {is_swapped}",
                seed + number as u64
            );
        }
    }
}

#[test]
fn leaves_that_are_pulled_apart_do_not_touch() {
    pulled_apart::<2, InPlane>(1, 60);
    pulled_apart::<3, InSpace>(1001, 25);
}

/// A leaf spring of two equal leaves bends like one under half of the load on each; the contact transfers that half.
#[test]
fn a_leaf_spring_hands_half_of_its_load_on() {
    fn of<const D: usize, S: Dimension<D>>(poisson: f64, off: f64)
    where
        ElementKind: Space<D>,
    {
        let leaf = |low: f64, nx: usize, nz: usize| Leaf {
            low,
            height: 0.2,
            cells: [nx, 2, nz],
            order: Order::Lagrange,
            is_split: false,
        };
        let all = [leaf(0.0, 30, 1), leaf(0.2, 40, 2)];
        for is_swapped in [false, true] {
            let model = leaves::<D, S>(&all, &[0.0, -1e-3], is_swapped, poisson, touch);
            let answer = answer(model, 1e-6, Stiffness::Cholesky);
            let force = normal_forces(&answer);
            println!(
                "{D} dimensions, poisson {poisson}, swapped {is_swapped}: {force:.4e} of 1e-3"
            );
            assert!((force / 5e-4 - 1.0).abs() < off, "{force:e}");
        }
    }
    of::<2, InPlane>(0.0, 0.07);
    of::<3, InSpace>(0.0, 0.08);
    // Both ends of the clamp are singular, and two meshes differ in the amount.
    of::<2, InPlane>(0.3, 0.4);
    of::<3, InSpace>(0.3, 0.5);
}

#[test]
fn tied_leaves_bend_as_one_in_either_order_of_sides() {
    fn of<const D: usize, S: Dimension<D>>(order: Order, cells: [[usize; 2]; 2], off: [f64; 2])
    where
        ElementKind: Space<D>,
    {
        let leaf = |low: f64, height: f64, [nx, nz]: [usize; 2]| Leaf {
            low,
            height,
            cells: [nx, 2, nz],
            order,
            is_split: false,
        };
        let all = [leaf(0.0, 1.0, cells[0]), leaf(1.0, 1.0, cells[1])];
        let tips: Vec<f64> = [false, true]
            .into_iter()
            .map(|is_swapped| {
                let model = leaves::<D, S>(&all, &[-0.01; 2], is_swapped, 0.3, |model, a, b| {
                    model.tie(Pair::tied(a, b))
                });
                ends(&answer(model, 1e-10, Stiffness::Cholesky), &all)[0]
            })
            .collect();
        // One body of both heights, on either mesh.
        let wholes = cells.map(|cells| {
            let whole = Leaf {
                cells: [cells[0], 4, cells[1]],
                ..leaf(0.0, 2.0, cells)
            };
            let apart = leaf(5.0, 1.0, [2, 1]);
            let model =
                leaves::<D, S>(&[whole, apart], &[-0.02, 0.0], false, 0.3, |model, a, b| {
                    model.contact(Pair::new(a, b).search_distance(4.5))
                });
            let answer = answer(model, 1e-10, Stiffness::Cholesky);
            ends(&answer, &[whole])[0]
        });
        println!("{D} dimensions, {order:?}: {tips:?}, one body {wholes:?}");
        assert!((tips[0] / tips[1] - 1.0).abs() < off[0]);
        let [low, high] = [wholes[0].min(wholes[1]), wholes[0].max(wholes[1])];
        assert!(
            tips.iter()
                .all(|tip| *tip > low * (1.0 + off[1]) && *tip < high * (1.0 - off[1]))
        );
    }
    let cells = [[8, 2], [9, 3]];
    of::<2, InPlane>(Order::First, cells, [1e-4, 1e-3]);
    of::<2, InPlane>(Order::Lagrange, cells, [1e-3, 1e-3]);
    of::<3, InSpace>(Order::First, cells, [1e-2, 1e-2]);
    of::<3, InSpace>(Order::Lagrange, cells, [1e-3, 1e-3]);
}

/// One of height 1, of first order.
fn leaf(low: f64, nx: usize) -> Leaf {
    Leaf {
        low,
        height: 1.0,
        cells: [nx, 2, 2],
        order: Order::First,
        is_split: false,
    }
}

/// If supports hold the whole first-named boundary, the other one has the multipliers.
#[test]
fn a_rigid_side_may_be_named_first() {
    fn of<const D: usize, S: Dimension<D>>()
    where
        ElementKind: Space<D>,
    {
        let sides = [false, true].map(|is_swapped| {
            let all = [leaf(0.0, 13), leaf(1.0, 7)];
            let loads = [0.0, -0.3];
            let model = leaves::<D, S>(&all, &loads, is_swapped, 0.3, |model, a, b| {
                model.contact(Pair::new(a, b).coulomb(0.3))
            });
            let model = model.support(Support::on("leaf0-top").fixed());
            answer(model, 1e-10, Stiffness::Cholesky)
        });
        let [a, b] = &sides;
        assert_eq!(a.solution.lambda, b.solution.lambda);
        assert_eq!(a.solution.u, b.solution.u);
        assert!(normal_forces(a) > 0.05);
        let pair = &a.built.elastic.pairs[0];
        assert_eq!(
            [&pair.boundary[..], &pair.against[..]],
            ["leaf1-bottom", "leaf0-top"]
        );
    }
    of::<2, InPlane>();
    of::<3, InSpace>();
}

/// A leaf that is pressed down and then driven along another one by its end, whose corner touches: the whole pressing force
/// causes friction, whichever side has the multipliers.
#[test]
fn nodes_that_supports_drive_rub_as_well() {
    fn of<const D: usize, S: Dimension<D>>()
    where
        ElementKind: Space<D>,
    {
        for is_swapped in [false, true] {
            let mut sides = ["low-top", "up-bottom"];
            if is_swapped {
                sides.reverse();
            }
            let mesh = join(S::mesh(&leaf(0.0, 8), "low"), S::mesh(&leaf(1.0, 5), "up"));
            let mut driven = Support::on("up-left").x(0.05);
            if D == 3 {
                driven = driven.y(0.0);
            }
            let model = Model::on(mesh)
                .material(material(0.3))
                .support(Support::on("low-bottom").fixed())
                .support(driven)
                .traction(Traction::on("up-top").force(upright(-2.0)))
                .contact(Pair::new(sides[0], sides[1]).coulomb(0.25));
            let answer = answer(model, 1e-10, Stiffness::Cholesky);
            let (m, lambda) = (answer.m(), &answer.solution.lambda);
            let rubs: f64 = (0..m).map(|i| answer.friction(i)[0]).sum::<f64>().abs();
            println!("{D} dimensions, swapped {is_swapped}: {rubs}");
            assert!((lambda[..m].iter().sum::<f64>() - 2.0).abs() < 1e-6);
            assert!((rubs - 0.5).abs() < 2e-3, "{rubs}");
        }
    }
    of::<2, InPlane>();
    of::<3, InSpace>();
}

/// A face whose nodes move alike is held by what moves them.
#[test]
fn a_face_that_moves_as_one_does_not_clamp_its_contact() {
    for is_swapped in [false, true] {
        let all = [leaf(0.0, 9), leaf(1.0, 7)];
        let model = leaves::<2, InPlane>(&all, &[-0.01, 0.01], is_swapped, 0.3, touch);
        let model = model.equal(Equal::of("leaf1-left"));
        let answer = answer(model, 1e-10, Stiffness::Cholesky);
        let of_pair = |i: &usize| answer.built.elastic.pair_of[*i] == 0;
        let force: f64 = (0..answer.m())
            .filter(of_pair)
            .map(|i| answer.solution.lambda[i])
            .sum();
        assert_eq!(force, 0.0);
    }
}
