//! Elements of second order: convergence orders, bending, nearly incompressible bodies, multigrid, and contact with
//! obstacles.
//!
//! `cargo test --release --test suite -- --nocapture second_order::` shows the figures.

use crate::common::half_space::{compare, ellipsoid_fit};
use crate::common::models::{Answer, answer};
use crate::common::or_panic::OrPanic as _;
use crate::common::order::{Order, of_order};
use crate::common::solve::solve_nested;
use signorini::backend::cpu::Cpu;
use signorini::contact::Obstacle;
use signorini::control::Stop;
use signorini::elasticity::{
    Body, Incompressible, Material, Plane, Unknowns, assemble, stresses, vertices,
};
use signorini::engine::Stiffness;
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{Element, ElementKind, Mesh, ShapeFunctions, Topology, Visit, facet_nodes};
use signorini::model::{Axis, Model, Pair, Support, Traction};
use signorini::reference::CASE_C;
use signorini::ssnm::NewtonSettings;
use signorini::stiffness::pcg::{Pcg, Preconditioner};
use std::collections::BTreeSet;
use std::f64::consts::PI;
use std::sync::Arc;

/// Displacements of the nodes of a body, and the PCG iterations to 1e-10, or to a tolerance.
struct Solved<const D: usize> {
    u: Vec<[f64; D]>,
    iterations: usize,
    n: usize,
}

fn solve<const D: usize>(
    body: &Body<D>,
    prescribed: Vec<[Option<f64>; D]>,
    forces: &[[f64; D]],
    tolerance: f64,
) -> Solved<D>
where
    ElementKind: Topology<D>,
{
    let unknowns = Unknowns::new(prescribed);
    let (k, f) = assemble(body, &unknowns, forces);
    let vertices = vertices(body, &unknowns);
    let points = unknowns.coordinates(body.mesh);
    let mut pcg = Pcg::of_second_order(
        Cpu::<f32>::default(),
        &Arc::new(k),
        Some(&points),
        vertices.as_ref(),
        Preconditioner::Multigrid,
    )
    .or_panic();
    let mut x = vec![0.0; f.len()];
    pcg.solve(&f, &mut x, tolerance, &Stop::default())
        .or_panic();
    Solved {
        u: unknowns.displacements(&x),
        iterations: pcg.counts.iterations,
        n: f.len(),
    }
}

/// A field with its gradient.
type Field<const D: usize> = fn([f64; D]) -> ([f64; D], [[f64; D]; D]);

/// ∫ (u_h − u)² and ∫ |∇(u_h − u)|² over an element.
struct Errors<'a, const D: usize>
where
    ElementKind: Topology<D>,
{
    mesh: &'a Mesh<D>,
    element: &'a Element<D>,
    u: &'a [[f64; D]],
    exact: Field<D>,
}

impl<const D: usize> Visit<D> for Errors<'_, D>
where
    ElementKind: Topology<D>,
{
    type Output = [f64; 2];

    fn visit<E: ShapeFunctions<D, N, Q>, const N: usize, const Q: usize>(self) -> [f64; 2] {
        let nodes = self.element.nodes();
        let x: [[f64; D]; N] = std::array::from_fn(|a| self.mesh.nodes[nodes[a] as usize]);
        let mut sum = [0.0; 2];
        for point in E::load_points(&x) {
            let (u, gradient) = (self.exact)(point.place(&x));
            for i in 0..D {
                let of_node = |a: usize| self.u[nodes[a] as usize][i];
                let value: f64 = (0..N).map(|a| point.shape[a] * of_node(a)).sum();
                sum[0] += point.weight * (value - u[i]).powi(2);
                for j in 0..D {
                    let slope: f64 = (0..N).map(|a| point.gradient[a][j] * of_node(a)).sum();
                    sum[1] += point.weight * (slope - gradient[i][j]).powi(2);
                }
            }
        }
        sum
    }
}

const RUBBER: Material = Material::new(2.0, 0.3);

/// The stress of a field.
fn stress<const D: usize>(exact: Field<D>, x: [f64; D]) -> [[f64; D]; D] {
    let (e, nu) = (RUBBER.young, RUBBER.poisson);
    let (lambda, mu) = (
        e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        e / (2.0 * (1.0 + nu)),
    );
    let (_, g) = exact(x);
    let trace: f64 = (0..D).map(|c| g[c][c]).sum();
    std::array::from_fn(|i| {
        std::array::from_fn(|j| {
            mu * (g[i][j] + g[j][i]) + if i == j { lambda * trace } else { 0.0 }
        })
    })
}

/// Errors in L², in energy and of the stresses at nodes, of a body with the field prescribed all around.
fn errors<const D: usize>(mesh: &Mesh<D>, exact: Field<D>) -> [f64; 3]
where
    ElementKind: Topology<D>,
{
    let body = Body {
        mesh,
        materials: &[RUBBER],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let held: BTreeSet<u32> = (mesh.boundaries.values().flatten())
        .flat_map(facet_nodes)
        .copied()
        .collect();
    let prescribed = (0..).zip(&mesh.nodes).map(|(node, &x)| {
        if held.contains(&node) {
            exact(x).0.map(Some)
        } else {
            [None; D]
        }
    });
    // −div σ by differences.
    let force = |x: [f64; D], _: f64| {
        const STEP: f64 = 1e-5;
        let mut sum = [0.0; D];
        for j in 0..D {
            let [up, down] = [STEP, -STEP].map(|step| {
                let mut moved = x;
                moved[j] += step;
                stress(exact, moved)
            });
            (0..D).for_each(|i| sum[i] -= (up[i][j] - down[i][j]) / (2.0 * STEP));
        }
        sum
    };
    let mut forces = vec![[0.0; D]; mesh.nodes.len()];
    body.add_body_force(None, force, &mut forces);
    let solved = solve(&body, prescribed.collect(), &forces, 1e-11);
    let mut sums = [0.0; 2];
    for element in &mesh.elements {
        let of = element.kind().with(Errors {
            mesh,
            element,
            u: &solved.u,
            exact,
        });
        (0..2).for_each(|k| sums[k] += of[k]);
    }
    let (at_nodes, _) = stresses(&body, &solved.u);
    let squares = at_nodes.iter().zip(&mesh.nodes).map(|(s, &x)| {
        let exact = stress(exact, x);
        (s.xx - exact[0][0]).powi(2) + (s.xy - exact[0][1]).powi(2)
    });
    let mean = squares.sum::<f64>() / mesh.nodes.len() as f64;
    [sums[0].sqrt(), sums[1].sqrt(), mean.sqrt()]
}

/// The orders of convergence from a mesh to the next, of cells half as wide.
fn orders(coarse: [f64; 3], fine: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| (coarse[k] / fine[k]).log2())
}

/// Errors of a smooth displacement fall with h³ in L², with h² in energy, and with h² in the stresses at nodes, on meshes with
/// no straight lines of nodes.
#[test]
fn errors_fall_with_the_order() {
    let check = |name: &str, [coarse, fine]: [[f64; 3]; 2]| {
        let found = orders(coarse, fine);
        println!("{name}: errors {fine:?}, orders {found:.2?}");
        for (order, least) in found.into_iter().zip([2.9, 1.9, 1.85]) {
            assert!(order > least, "{name}: {found:?}");
        }
    };
    let plane: Field<2> = |[x, y]| {
        let ((sx, cx), (sy, cy)) = ((2.0 * x).sin_cos(), (1.5 * y).sin_cos());
        (
            [sx * cy, cx * sy + x * y],
            [
                [2.0 * cx * cy, -1.5 * sx * sy],
                [y - 2.0 * sx * sy, 1.5 * cx * cy + x],
            ],
        )
    };
    for (name, shape, order) in [
        ("tri6", CellShape::Triangle, Order::Lagrange),
        ("quad8", CellShape::Quad, Order::Serendipity),
        ("quad9", CellShape::Quad, Order::Lagrange),
    ] {
        let of = [8, 16].map(|n| {
            let mut mesh = of_order(
                rectangle([0.0; 2], [1.0; 2], [n, n], shape, "body", ""),
                order,
            );
            for x in &mut mesh.nodes {
                let [a, b] = *x;
                *x = [a + 0.1 * (3.0 * a).sin() * b * (1.0 - b), b + 0.15 * a * b];
            }
            errors(&mesh, plane)
        });
        check(name, of);
    }
    let space: Field<3> = |[x, y, z]| {
        (
            [
                (2.0 * x).sin() * y.cos() + z * z,
                (x + 2.0 * z).cos() * y,
                (x * y).sin() + z * x,
            ],
            [
                [
                    2.0 * (2.0 * x).cos() * y.cos(),
                    -(2.0 * x).sin() * y.sin(),
                    2.0 * z,
                ],
                [
                    -(x + 2.0 * z).sin() * y,
                    (x + 2.0 * z).cos(),
                    -2.0 * (x + 2.0 * z).sin() * y,
                ],
                [y * (x * y).cos() + z, x * (x * y).cos(), x],
            ],
        )
    };
    for (name, shape, order) in [
        ("tet10", SolidShape::Tetrahedron, Order::Lagrange),
        ("hex20", SolidShape::Hexahedron, Order::Serendipity),
        ("hex27", SolidShape::Hexahedron, Order::Lagrange),
        ("wedge15", SolidShape::Wedge, Order::Serendipity),
        ("wedge18", SolidShape::Wedge, Order::Lagrange),
    ] {
        let of = [4, 8].map(|n| {
            let mut mesh = of_order(block([0.0; 3], [1.0; 3], [n; 3], shape, "body", ""), order);
            for x in &mut mesh.nodes {
                let [a, b, c] = *x;
                let bent = a + 0.1 * (3.0 * a).sin() * b * (1.0 - b);
                *x = [bent, b + 0.1 * a * c, c + 0.1 * b * a];
            }
            errors(&mesh, space)
        });
        check(name, of);
    }
}

/// The displacement of a node near x.
fn at<const D: usize>(mesh: &Mesh<D>, u: &[[f64; D]], x: [f64; D]) -> [f64; D]
where
    ElementKind: Topology<D>,
{
    let off = |y: &[f64; D]| (0..D).map(|c| (y[c] - x[c]).powi(2)).sum::<f64>();
    let nearest = mesh
        .nodes
        .iter()
        .zip(u)
        .min_by(|a, b| off(a.0).total_cmp(&off(b.0)));
    *nearest.expect("there are nodes").1
}

/// A body clamped at x = 0 under a traction on its right side: the displacement at a place.
fn tip<const D: usize>(mesh: &Mesh<D>, material: Material, traction: [f64; D], x: [f64; D]) -> f64
where
    ElementKind: Topology<D>,
{
    let body = Body {
        mesh,
        materials: &[material],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let held = |x: &[f64; D]| [(x[0].abs() < 1e-9).then_some(0.0); D];
    let mut forces = vec![[0.0; D]; mesh.nodes.len()];
    body.add_traction(&mesh.boundaries["right"], |_, _| traction, &mut forces);
    let solved = solve(&body, mesh.nodes.iter().map(held).collect(), &forces, 1e-10);
    let loaded = (0..D).max_by(|&a, &b| traction[a].abs().total_cmp(&traction[b].abs()));
    at(mesh, &solved.u, x)[loaded.unwrap_or(0)]
}

/// A cantilever of 10 × 1 × 1 with two layers of elements, against 80 × 8 × 8 elements with 27 nodes (n = 138 720): −4.0031e-2.
#[test]
fn a_cantilever_of_two_layers() {
    const REFERENCE: f64 = -4.003_07e-2;
    for (name, shape, order, limit) in [
        ("hex8", SolidShape::Hexahedron, Order::First, 0.15),
        ("tet10", SolidShape::Tetrahedron, Order::Lagrange, 0.01),
        ("hex20", SolidShape::Hexahedron, Order::Serendipity, 0.01),
        ("hex27", SolidShape::Hexahedron, Order::Lagrange, 0.01),
    ] {
        let mesh = block([0.0; 3], [10.0, 1.0, 1.0], [20, 2, 2], shape, "body", "");
        let mesh = of_order(mesh, order);
        let material = Material::new(1e5, 0.3);
        let found = tip(&mesh, material, [0.0, 0.0, -1.0], [10.0, 0.0, 0.0]);
        compare(
            &format!("cantilever, two layers of {name}"),
            found,
            REFERENCE,
            limit,
        );
    }
}

/// Cook's membrane in plane strain with ν = 0.499 and 16 × 16 cells, in the plane and as a slab in space that nothing moves out of
/// its plane, against 64 × 64 quadrilaterals with nine nodes; without projection elements of first order lose half.
#[test]
fn cooks_membrane_nearly_incompressible() {
    // 8.0787 at ν = 0.499, where 128 × 128 give 8.0806.
    const REFERENCE: f64 = 8.080_6;
    let material = Material::new(240.565, 0.499);
    let bent = |[a, b]: [f64; 2]| [48.0 * a, 44.0 * a + b * (44.0 - 28.0 * a)];
    let plane = |shape, order, material| {
        let mut mesh = of_order(
            rectangle([0.0; 2], [1.0; 2], [16; 2], shape, "body", ""),
            order,
        );
        mesh.nodes.iter_mut().for_each(|x| *x = bent(*x));
        tip(&mesh, material, [0.0, 6.25], [48.0, 60.0])
    };
    for (name, shape, order, limit) in [
        // 16 cells of first order are 3.7 % too stiff at ν = 0.3 as well.
        ("quad4", CellShape::Quad, Order::First, 0.023),
        ("quad8", CellShape::Quad, Order::Serendipity, 0.01),
        ("quad9", CellShape::Quad, Order::Lagrange, 0.005),
    ] {
        compare(
            &format!("Cook, {name}"),
            plane(shape, order, material),
            REFERENCE,
            limit,
        );
    }
    let locked = Material {
        incompressible: Incompressible::No,
        ..material
    };
    let found = plane(CellShape::Quad, Order::First, locked);
    assert!(found < 0.6 * REFERENCE, "{found}");
    for (name, shape, order, limit) in [
        ("hex8", SolidShape::Hexahedron, Order::First, 0.023),
        ("tet10", SolidShape::Tetrahedron, Order::Lagrange, 0.02),
        ("hex20", SolidShape::Hexahedron, Order::Serendipity, 0.02),
        ("hex27", SolidShape::Hexahedron, Order::Lagrange, 0.02),
        // Its triangles have the constant strains of first order in the plane, and their mean dilatation is the same.
        ("wedge6", SolidShape::Wedge, Order::First, 0.1),
        ("wedge18", SolidShape::Wedge, Order::Lagrange, 0.02),
    ] {
        let mesh = block([0.0; 3], [1.0, 1.0, 0.2], [16, 16, 1], shape, "body", "");
        let mut mesh = of_order(mesh, order);
        for x in &mut mesh.nodes {
            let [a, b] = bent([x[0], x[1]]);
            *x = [a, b, 5.0 * x[2]];
        }
        let body = Body {
            mesh: &mesh,
            materials: &[material],
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        let held = |x: &[f64; 3]| {
            let clamped = (x[0].abs() < 1e-9).then_some(0.0);
            [clamped, clamped, Some(0.0)]
        };
        let mut forces = vec![[0.0; 3]; mesh.nodes.len()];
        body.add_traction(
            &mesh.boundaries["right"],
            |_, _| [0.0, 6.25, 0.0],
            &mut forces,
        );
        let solved = solve(&body, mesh.nodes.iter().map(held).collect(), &forces, 1e-10);
        let found = at(&mesh, &solved.u, [48.0, 60.0, 0.0])[1];
        compare(&format!("Cook's slab, {name}"), found, REFERENCE, limit);
    }
}

/// A projected element has the stresses of its strains: a block under uniform pressure, ν = 0.4999.
#[test]
fn projected_elements_have_uniform_stresses() {
    let material = Material::new(3.0, 0.4999);
    for (shape, order) in [
        (SolidShape::Hexahedron, Order::First),
        (SolidShape::Wedge, Order::First),
        (SolidShape::Hexahedron, Order::Lagrange),
        (SolidShape::Hexahedron, Order::Serendipity),
        (SolidShape::Tetrahedron, Order::Lagrange),
        (SolidShape::Wedge, Order::Serendipity),
        (SolidShape::Wedge, Order::Lagrange),
    ] {
        let mut mesh = of_order(block([0.0; 3], [1.0; 3], [2; 3], shape, "body", ""), order);
        // Inner nodes anywhere.
        for x in &mut mesh.nodes {
            if x.iter().all(|&v| v > 0.3 && v < 0.7) {
                *x = [x[0] + 0.06, x[1] - 0.05, x[2] + 0.04];
            }
        }
        let body = Body {
            mesh: &mesh,
            materials: &[material],
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        let gradient = [[0.03, 0.01, -0.02], [0.0, -0.01, 0.02], [0.01, 0.0, 0.015]];
        let field = |x: [f64; 3]| gradient.map(|row| (0..3).map(|c| row[c] * x[c]).sum::<f64>());
        let outside: BTreeSet<u32> = (mesh.boundaries.values().flatten())
            .flat_map(facet_nodes)
            .copied()
            .collect();
        let held = (0..).zip(&mesh.nodes).map(|(node, &x)| {
            if outside.contains(&node) {
                field(x).map(Some)
            } else {
                [None; 3]
            }
        });
        let solved = solve(
            &body,
            held.collect(),
            &vec![[0.0; 3]; mesh.nodes.len()],
            1e-12,
        );
        for (u, &x) in solved.u.iter().zip(&mesh.nodes) {
            for (u, exact) in u.iter().zip(field(x)) {
                assert!((u - exact).abs() < 1e-9, "{shape:?} {order:?}");
            }
        }
        let (lambda, mu) = {
            let (e, nu) = (material.young, material.poisson);
            (
                e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
                e / (2.0 * (1.0 + nu)),
            )
        };
        let (nodes, elements) = stresses(&body, &solved.u);
        for s in nodes.iter().chain(&elements) {
            let normal = |c: usize| lambda * 0.035 + 2.0 * mu * gradient[c][c];
            for (found, c) in [(s.xx, 0), (s.yy, 1), (s.zz, 2)] {
                assert!((found - normal(c)).abs() < 1e-5 * lambda * 0.035);
            }
            assert!((s.xy - mu * 0.01).abs() < 1e-5, "{} {}", s.xy, mu * 0.01);
        }
    }
}

/// PCG to 1e-8 takes no more iterations than this for a body of steel that is clamped where `held`, under a traction.
fn check_iterations(
    (name, most): (&str, usize),
    mesh: &Mesh<3>,
    held: fn(&[f64; 3]) -> bool,
    (side, traction): (&str, [f64; 3]),
) {
    let body = Body {
        mesh,
        materials: &[Material::new(2e11, 0.3)],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let prescribed = mesh.nodes.iter().map(|x| [held(x).then_some(0.0); 3]);
    let mut forces = vec![[0.0; 3]; mesh.nodes.len()];
    body.add_traction(&mesh.boundaries[side], |_, _| traction, &mut forces);
    let solved = solve(&body, prescribed.collect(), &forces, 1e-8);
    println!("{name}: n = {}, {} iterations", solved.n, solved.iterations);
    assert!(solved.iterations <= most, "{name}: {}", solved.iterations);
}

/// Iterations of PCG to 1e-8 for n of about 70 000: 12, 14, 14, 16 with the corners as the second level.
#[test]
fn iterations_of_a_linear_solve() {
    for (name, shape, order, most) in [
        ("hex27", SolidShape::Hexahedron, Order::Lagrange, 14),
        ("hex20", SolidShape::Hexahedron, Order::Serendipity, 18),
        ("wedge18", SolidShape::Wedge, Order::Lagrange, 18),
        ("tet10", SolidShape::Tetrahedron, Order::Lagrange, 20),
    ] {
        let mesh = of_order(CASE_C.mesh(10, shape), order);
        check_iterations(
            (name, most),
            &mesh,
            |x| x[0] < 1e-9,
            ("top", [1e5, 2e5, -1e6]),
        );
    }
}

/// Iterations of PCG to 1e-8 on cells of aspect ratios up to 13: 15, 29, 15; 43, 41, 45 with the corners as the second level.
#[test]
fn iterations_on_stretched_cells() {
    for (name, shape, order, most) in [
        ("hex27", SolidShape::Hexahedron, Order::Lagrange, 17),
        ("hex20", SolidShape::Hexahedron, Order::Serendipity, 31),
        ("tet10", SolidShape::Tetrahedron, Order::Lagrange, 17),
    ] {
        let mut mesh = block(
            [-1.0, -1.0, 0.0],
            [2.0, 2.0, 1.0],
            [12, 12, 6],
            shape,
            "body",
            "",
        );
        let map = |x: f64| 0.2 * x + 0.8 * x * x * x;
        mesh.nodes.iter_mut().for_each(|x| *x = x.map(map));
        let mesh = of_order(mesh, order);
        check_iterations(
            (name, most),
            &mesh,
            |x| x[2] > 1.0 - 1e-9,
            ("bottom", [1e6, 2e6, -1e7]),
        );
    }
}

/// Reference case C with as many contact nodes of either order: products and V-cycles. (12 products of first order, 15 of
/// second; 13 and 16, 14 and 17 on finer meshes.)
#[test]
fn a_contact_solve_costs_as_much_as_one_of_first_order() {
    let counts = |q, order| {
        let mesh = of_order(CASE_C.mesh(q, SolidShape::Hexahedron), order);
        let problem = CASE_C.problem_on(&mesh).or_panic();
        let settings = NewtonSettings {
            tolerance: 1e-4,
            ..Default::default()
        };
        let (solution, costs, linear) = solve_nested(&problem, &settings);
        let cycles = costs.solves.iterations;
        println!(
            "{order:?}: n = {}, m = {}, {} products, {cycles} V-cycles, {linear} for a linear solve",
            problem.n(),
            problem.m(),
            solution.info.n_a
        );
        assert!(cycles <= 9 * linear);
        solution.info.n_a
    };
    let first = counts(8, Order::First);
    for order in [Order::Lagrange, Order::Serendipity] {
        let second = counts(4, order);
        assert!(
            4 * second <= 5 * first,
            "{second} products, {first} of first order"
        );
    }
}

/// A block pressed on a rigid plane has the pressure of its load everywhere, by the factor and by PCG.
#[test]
fn patch_test_against_an_obstacle() {
    let material = Material::new(3000.0, 0.3);
    let check = |name: &str, pressures: Vec<f64>| {
        for p in pressures {
            assert!((p / 10.0 - 1.0).abs() < 1e-8, "{name}: {p}");
        }
    };
    for stiffness in [Stiffness::Cholesky, Stiffness::Pcg] {
        for (name, shape, order) in [
            ("tri6", CellShape::Triangle, Order::Lagrange),
            ("quad8", CellShape::Quad, Order::Serendipity),
            ("quad9", CellShape::Quad, Order::Lagrange),
        ] {
            let mesh = of_order(
                rectangle([0.0; 2], [2.0, 1.0], [5, 3], shape, "body", ""),
                order,
            );
            let floor = Obstacle::HalfSpace {
                point: [0.0; 2],
                normal: [0.0, 1.0],
            };
            let model = Model::on(mesh)
                .material(material)
                .support(Support::on("left").x(0.0))
                .traction(Traction::on("top").pressure(10.0))
                .contact(Pair::obstacle("bottom", floor));
            let answer = answer(model, 1e-11, stiffness);
            check(name, (0..answer.m()).map(|i| answer.pressure(i)).collect());
        }
        for (name, shape, order) in [
            ("tet10", SolidShape::Tetrahedron, Order::Lagrange),
            ("hex20", SolidShape::Hexahedron, Order::Serendipity),
            ("hex27", SolidShape::Hexahedron, Order::Lagrange),
            ("wedge15", SolidShape::Wedge, Order::Serendipity),
            ("wedge18", SolidShape::Wedge, Order::Lagrange),
        ] {
            let mesh = block([0.0; 3], [2.0, 1.0, 1.0], [3, 2, 2], shape, "body", "");
            let floor = Obstacle::HalfSpace {
                point: [0.0; 3],
                normal: [0.0, 0.0, 1.0],
            };
            let model = Model::on(of_order(mesh, order))
                .material(material)
                .support(Support::on(["left", "front"]).symmetry())
                .traction(Traction::on("top").pressure(10.0))
                .contact(Pair::obstacle("bottom", floor));
            let answer = answer(model, 1e-11, stiffness);
            check(name, (0..answer.m()).map(|i| answer.pressure(i)).collect());
        }
    }
}

/// A parabola pressed on half of an elastic strip, as a rigid disc with a large radius: half-width, peak and the pressure in the
/// middle, against Hertz's for the force found, with this many elements across the half-width.
fn plane_hertz(shape: CellShape, order: Order, across: usize) -> [f64; 3] {
    let (r, a, size) = (10.0, 0.1_f64, 4.0);
    let material = Material::new(2e11, 0.3);
    let modulus = material.young / (1.0 - material.poisson.powi(2));
    let force = PI * modulus * a * a / (4.0 * r);
    let grade = |n: usize, h: f64| {
        crate::common::half_space::growing(
            &(0..=n).map(|k| h * k as f64).collect::<Vec<_>>(),
            1.2 * h,
            16,
            size,
        )
    };
    let h = a / across as f64;
    let (flat, deep) = (grade(across + across / 4 + 1, h), grade(across, h));
    let cells = [flat.len() - 1, deep.len() - 1];
    let extent = cells.map(|n| n as f64);
    let mut mesh = rectangle([0.0, -extent[1]], extent, cells, shape, "body", "");
    for x in &mut mesh.nodes {
        let [i, j] = x.map(|v| v.abs().round() as usize);
        *x = [flat[i], -deep[j]];
    }
    let mut edges = mesh.boundaries["top"].clone();
    edges.retain(|edge| {
        facet_nodes(edge)
            .iter()
            .all(|&node| mesh.nodes[node as usize][0] < 1.3 * a)
    });
    mesh.boundaries.insert("contact".to_owned(), edges);
    // The disc comes from above, by loads from below.
    let disc = Obstacle::Sphere {
        center: [0.0, r],
        radius: r,
    };
    let model = Model::on(of_order(mesh, order))
        .material(material)
        .support(Support::on("left").symmetry())
        .traction(Traction::on("bottom").y(0.5 * force / size))
        .contact(Pair::obstacle("contact", disc));
    let answer = answer(model, 1e-9, Stiffness::Cholesky);
    fitted(
        &answer,
        |f| (4.0 * 2.0 * f * r / (PI * modulus)).sqrt(),
        |f, a| 2.0 * 2.0 * f / (PI * a),
    )
}

/// Half-width, peak and middle of the computed pressures, beside those of Hertz for the force of the (half or quarter)
/// model.
fn fitted<const D: usize>(
    answer: &Answer<D>,
    width: impl Fn(f64) -> f64,
    peak: impl Fn(f64, f64) -> f64,
) -> [f64; 3]
where
    ElementKind: signorini::contact::Space<D>,
{
    let force: f64 = (0..answer.m())
        .map(|i| answer.pressure(i) * answer.area(i))
        .sum();
    let (a, top) = (width(force), answer.m());
    let p0 = peak(force, a);
    let far = |i: usize| answer.place(i)[..D - 1].iter().map(|x| x * x).sum::<f64>();
    let loaded = (0..top).filter(|&i| answer.pressure(i) > 0.2 * p0);
    let (found_a, found_p0) =
        ellipsoid_fit(loaded.map(|i| (answer.area(i), far(i), answer.pressure(i))));
    let middle = (0..top)
        .min_by(|&i, &j| far(i).total_cmp(&far(j)))
        .expect("there is contact");
    // No pressure oscillates: inside of 0.8 a all are near the ellipse.
    let worst = (0..top)
        .filter(|&i| far(i) < (0.8 * a).powi(2))
        .map(|i| (answer.pressure(i) - p0 * (1.0 - far(i) / (a * a)).sqrt()).abs() / p0)
        .fold(0.0, f64::max);
    println!("  m = {top}, worst inside of 0.8 a {:.2} %", 100.0 * worst);
    assert!(worst < 0.04, "{worst}");
    [found_a / a, found_p0 / p0, answer.pressure(middle) / p0]
}

#[test]
fn hertz_cylinder() {
    for (name, shape, order, across, limit) in [
        ("tri6", CellShape::Triangle, Order::Lagrange, 4, 0.015),
        ("quad8", CellShape::Quad, Order::Serendipity, 4, 0.006),
        ("quad9", CellShape::Quad, Order::Lagrange, 4, 0.005),
    ] {
        let found = plane_hertz(shape, order, across);
        for (what, found) in ["a", "p₀", "p(0)"].into_iter().zip(found) {
            compare(&format!("cylinder, {name}, {what}"), found, 1.0, limit);
        }
    }
}

/// Half a ring with curved tetrahedra, shrunk onto a cylinder and turned until it slips: the forces of its contact are those that its supports
/// bear, and so are their moments, though forces on curved facets act beside the nodes.
#[test]
fn the_moment_of_contact_is_that_of_its_forces() {
    let (shape, cells) = (SolidShape::Tetrahedron, [2, 8, 1]);
    let mut mesh = block([0.0; 3], [1.0, 1.0, 0.4], cells, shape, "ring", "")
        .raised()
        .or_panic();
    for x in &mut mesh.nodes {
        let (sin, cos) = (PI * x[1]).sin_cos();
        let r = 2.0 + 1.5 * x[0];
        *x = [r * cos, r * sin, x[2]];
    }
    let shaft = Obstacle::Cylinder {
        point: [0.0; 3],
        axis: [0.0, 0.0, 1.0],
        radius: 2.0,
    };
    let axis = Axis::new([0.0; 3], [0.0, 0.0, 1.0]);
    let model = Model::on(mesh)
        .material(Material::new(1e3, 0.3))
        .support(Support::on("right").about(axis).hoop(0.1).radial(0.0))
        .support(Support::on(["front", "back"]).z(0.0))
        .contact(
            Pair::obstacle("left", shaft)
                .interference(0.01)
                .coulomb(0.2),
        );
    let found = answer(model, 1e-10, Stiffness::Cholesky);
    let report = found.report();
    let about_axis = |force: &[f64], moment: &[f64], centre: &[f64]| {
        moment[2] + centre[0] * force[1] - centre[1] * force[0]
    };
    let contact = &report.contacts[0];
    let rubbed = about_axis(&contact.force, &contact.moment, &contact.centre);
    let supports = report.supports.iter();
    let held = supports.map(|held| about_axis(&held.force, &held.moment, &held.centre));
    let held: f64 = held.sum();
    assert!(rubbed.abs() > 1.0, "{rubbed}");
    assert!(
        (rubbed + held).abs() < 1e-6 * rubbed.abs(),
        "{rubbed} {held}"
    );
}
