//! Tests of the estimate of the energy error, of runs that get nowhere, and of bodies without supports.

use super::*;
use crate::backend::cpu::Cpu;
use crate::dual::DirectDual;
use crate::dual::{DualOperator, NestedDual};
use crate::elasticity::{Body, Material, Plane, Unknowns, assemble};
use crate::mesh::Mesh;
use crate::mesh::structured::{CellShape, rectangle};
use crate::problem::{ContactData, ContactProblem, FloatingBodies};
use crate::sparse::{Csr, dot, norm};
use crate::ssnm::{self, Status};
use std::ops::ControlFlow;

/// √(eᵀKe) of e = x − y.
fn energy_norm(k: &BlockCsr<2>, x: &[f64], y: &[f64]) -> f64 {
    let e: Vec<f64> = x.iter().zip(y).map(|(x, y)| x - y).collect();
    let mut ke = vec![0.0; e.len()];
    k.mul(&e, &mut ke);
    dot(&e, &ke).sqrt()
}

/// A block of hexahedra of the given size, held at x = 0; the unknowns in pairs, whatever they are.
fn hexahedra(cells: [usize; 3], size: [f64; 3], young: impl Fn(usize) -> f64) -> BlockCsr<2> {
    let nu = 0.3;
    let h: [f64; 3] = std::array::from_fn(|c| size[c] / cells[c] as f64);
    let corner = |a: usize| [a & 1, a >> 1 & 1, a >> 2];
    // The element matrix for E = 1, in 2×2×2 Gauss points.
    let (lambda, mu) = (nu / ((1.0 + nu) * (1.0 - 2.0 * nu)), 0.5 / (1.0 + nu));
    let mut element = vec![[0.0; 24]; 24];
    for point in 0..8 {
        let at = corner(point).map(|s| if s == 0 { -1.0 } else { 1.0 } / 3.0_f64.sqrt());
        let gradient: Vec<[f64; 3]> = (0..8)
            .map(|a| {
                let sign = corner(a).map(|s| if s == 0 { -1.0 } else { 1.0 });
                let factor: [f64; 3] = std::array::from_fn(|c| 0.5 * (1.0 + sign[c] * at[c]));
                std::array::from_fn(|c| factor[(c + 1) % 3] * factor[(c + 2) % 3] * sign[c] / h[c])
            })
            .collect();
        for (a, ga) in gradient.iter().enumerate() {
            for (b, gb) in gradient.iter().enumerate() {
                for i in 0..3 {
                    for j in 0..3 {
                        let same = if i == j { dot(ga, gb) } else { 0.0 };
                        element[3 * a + i][3 * b + j] += h.iter().product::<f64>() / 8.0
                            * (lambda * ga[i] * gb[j] + mu * ga[j] * gb[i] + mu * same);
                    }
                }
            }
        }
    }
    let [nx, ny, nz] = cells;
    // Without the nodes at x = 0.
    let unknown =
        |x: usize, y: usize, z: usize| (x > 0).then(|| 3 * ((z * (ny + 1) + y) * nx + x - 1));
    let n = 3 * nx * (ny + 1) * (nz + 1);
    let mut triplets = Vec::new();
    for cell in 0..nx * ny * nz {
        let (x, y, z) = (cell % nx, cell / nx % ny, cell / (nx * ny));
        let places: Vec<Option<usize>> = (0..8)
            .map(|a| {
                let [i, j, k] = corner(a);
                unknown(x + i, y + j, z + k)
            })
            .collect();
        for (a, pa) in places.iter().enumerate() {
            for (b, pb) in places.iter().enumerate() {
                if let (&Some(pa), &Some(pb)) = (pa, pb) {
                    for i in 0..3 {
                        for j in 0..3 {
                            let value = young(cell) * element[3 * a + i][3 * b + j];
                            triplets.push((pa + i, pb + j, value));
                        }
                    }
                }
            }
        }
    }
    BlockCsr::from_triplets(n, n, triplets)
}

/// K of a mesh of these materials that is held on the left, and its unknowns.
fn held_on_the_left(mesh: &Mesh, materials: &[Material]) -> (BlockCsr<2>, Unknowns) {
    let body = Body {
        mesh,
        materials,
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let mut prescribed = vec![[None; 2]; mesh.nodes.len()];
    for &node in mesh.boundaries["left"].iter().flatten() {
        prescribed[node as usize] = [Some(0.0); 2];
    }
    let unknowns = Unknowns::new(prescribed);
    let k = assemble(&body, &unknowns, &vec![[0.0; 2]; mesh.nodes.len()]).0;
    (k, unknowns)
}

/// A rectangle of quadrilaterals held on the left, of two materials.
fn two_materials(
    cells: [usize; 2],
    contrast: f64,
    stiff: impl Fn([f64; 2]) -> bool,
) -> BlockCsr<2> {
    let mut mesh = rectangle([0.0; 2], [3.0, 1.0], cells, CellShape::Quad, "body", "");
    mesh.regions.push("second".to_owned());
    for e in 0..mesh.elements.len() {
        let corner = mesh.nodes[mesh.elements[e].nodes()[0] as usize];
        mesh.elements[e].region = u32::from(stiff(corner));
    }
    let young = 2e11;
    let soft = Material::new(young, 0.3);
    let stiff = Material {
        young: contrast * young,
        ..soft
    };
    held_on_the_left(&mesh, &[soft, stiff]).0
}

/// A force without pattern on the last `count` unknowns.
fn load(n: usize, count: usize, seed: usize) -> Vec<f64> {
    (0..n)
        .map(|i| {
            if i + count >= n {
                0.3 + ((i * 7919 + seed * 104_729) % 1000) as f64 / 1000.0
            } else {
                0.0
            }
        })
        .collect()
}

/// PCG roughly reaches the requested accuracy over plateaus, in the first run and later.
#[test]
fn the_energy_error_is_as_asked_where_pcg_is_slow() {
    let disc = |x: [f64; 2]| (x[0] - 1.5).powi(2) + (x[1] - 0.5).powi(2) < 0.09;
    let layers = |cell: usize| {
        if (cell / 8).is_multiple_of(2) {
            1.0
        } else {
            1e6
        }
    };
    let cases = [
        ("hexahedra", hexahedra([12, 9, 9], [3.0, 1.0, 1.0], |_| 1.0)),
        ("slender", hexahedra([40, 5, 5], [10.0, 1.0, 1.0], |_| 1.0)),
        ("layers", hexahedra([8, 9, 9], [1.0, 1.0, 1.0], layers)),
        ("plain", two_materials([60, 20], 1.0, disc)),
        ("half", two_materials([60, 20], 1e6, |x| x[0] < 1.5)),
        ("stiff disc", two_materials([60, 20], 1e2, disc)),
    ];
    for (name, k) in cases {
        let k = Arc::new(k);
        let n = k.n_rows();
        let new = |preconditioner| {
            Pcg::new(Cpu::<f32>::default(), &k, None, preconditioner)
                .unwrap_or_else(|error| panic!("{error}"))
        };
        for count in [n / 50, n] {
            let loads = [0, 1, 2].map(|seed| load(n, count, seed));
            let exact = loads.each_ref().map(|b| {
                let mut exact = vec![0.0; n];
                new(Preconditioner::Multigrid)
                    .solve(b, &mut exact, 1e-11, &Stop::default())
                    .unwrap_or_else(|error| panic!("{error}"));
                exact
            });
            for preconditioner in [Preconditioner::BlockJacobi, Preconditioner::Multigrid] {
                for asked in [0.1, 0.05, 0.01] {
                    let mut pcg = new(preconditioner);
                    for (i, (b, exact)) in loads.iter().zip(&exact).enumerate() {
                        let unit = pcg.load(b, norm(b));
                        let accuracy = Accuracy::Energy {
                            absolute: 0.0,
                            relative: asked,
                        };
                        let run = pcg.run_to(accuracy, unit);
                        let progress = pcg
                            .run(run, &Stop::default(), None)
                            .unwrap_or_else(|error| panic!("{error}"));
                        let mut x = vec![0.0; n];
                        pcg.backend
                            .download(&pcg.x, &mut x)
                            .unwrap_or_else(|error| panic!("{error}"));
                        x.iter_mut().for_each(|x| *x *= unit);
                        let error =
                            energy_norm(&k, &x, exact) / energy_norm(&k, exact, &vec![0.0; n]);
                        let what = format!(
                            "{name}, {preconditioner:?}, {count} loads, {asked}, run {i}: \
                             {} iterations, {:.2} times what was asked",
                            progress.iterations,
                            error / asked
                        );
                        println!("{what}");
                        assert!(error <= 2.0 * asked, "{what}");
                    }
                }
            }
        }
    }
}

/// ‖b − Kx‖ / ‖b‖.
fn residual(k: &BlockCsr<2>, x: &[f64], b: &[f64]) -> f64 {
    let mut r = vec![0.0; b.len()];
    k.mul(x, &mut r);
    r.iter_mut().zip(b).for_each(|(r, b)| *r = b - *r);
    norm(&r) / norm(b)
}

/// The square of a chain of springs with a condition of 1e4: multigrid, made for elasticity, is of little use
/// here, and all that it takes is patience.
#[test]
fn an_ill_conditioned_matrix_is_solved() {
    let n = 900;
    let chain = |i: usize, j: usize| match i.abs_diff(j) {
        0 => 2.0004,
        1 => -1.0,
        _ => 0.0,
    };
    let triplets = (0..n).flat_map(|i| {
        let near = |i: usize| i.saturating_sub(1)..(i + 2).min(n);
        near(i).flat_map(move |m| near(m).map(move |j| (i, j, chain(i, m) * chain(m, j))))
    });
    let k = Arc::new(BlockCsr::from_triplets(n, n, triplets));
    for preconditioner in [Preconditioner::BlockJacobi, Preconditioner::Multigrid] {
        let mut pcg = Pcg::new(Cpu::<f32>::default(), &k, None, preconditioner)
            .unwrap_or_else(|error| panic!("{error}"));
        let b = load(n, n, 1);
        let mut x = vec![0.0; n];
        pcg.solve(&b, &mut x, 1e-8, &Stop::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let reached = residual(&k, &x, &b);
        println!("{preconditioner:?}: {:?}, {reached:.1e}", pcg.counts);
        // Rounding leaves that much.
        assert!(reached < 1e-6, "{preconditioner:?}: {reached:e}");
    }
}

/// A body without supports, pulled: block-Jacobi does not notice when it is set up, and must not go on for
/// ever.
#[test]
fn an_unbalanced_load_ends_soon() {
    for cells in [[2, 1], [10, 4], [60, 20], [180, 60]] {
        let body = Bodies::new(&[(cells, [3.0, 1.0], 2e11, Held::Free)]);
        let n = body.k.n_rows();
        for count in [1, n.div_ceil(50), n] {
            let backend = Cpu::<f32>::default();
            let mut pcg = Pcg::new(backend, &body.k, None, Preconditioner::BlockJacobi)
                .unwrap_or_else(|error| panic!("{error}"));
            let mut x = vec![0.0; n];
            let error = pcg
                .solve(&load(n, count, 1), &mut x, 1e-8, &Stop::default())
                .expect_err("nothing balances the load");
            println!("{cells:?} {count}: {:?}: {error}", pcg.counts);
            assert!(error.to_string().contains("supports"), "{error}");
            assert!(pcg.counts.iterations <= 1000 + 2 * n, "{:?}", pcg.counts);
        }
    }
}

/// A goal that rounding keeps out of reach: the run ends, and its result so far is available.
#[test]
fn a_stalled_run_keeps_its_result() {
    let body = Bodies::new(&[([60, 20], [3.0, 1.0], 2e11, Held::Left)]);
    let n = body.k.n_rows();
    let b = load(n, n, 1);
    let mut pcg = Pcg::new(
        Cpu::<f32>::default(),
        &body.k,
        Some(&body.points),
        Preconditioner::Multigrid,
    )
    .unwrap_or_else(|error| panic!("{error}"));
    let mut x = vec![0.0; n];
    let ended = pcg.solve(&b, &mut x, 1e-200, &Stop::default());
    let reached = residual(&body.k, &x, &b);
    println!("{:?} {ended:?} {reached:.1e}", pcg.counts);
    assert!(reached < 1e-10, "{reached:e}");
    assert!(pcg.counts.iterations < 2000, "{:?}", pcg.counts);
}

/// The supports of a rectangular body.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Held {
    Left,
    /// Rollers below: it moves along x.
    Below,
    /// One corner: it turns about that.
    Corner,
    Free,
}

/// Bodies side by side.
struct Bodies {
    k: Arc<BlockCsr<2>>,
    points: Vec<[f64; 2]>,
    /// The motions without energy, orthonormal.
    kernel: Vec<Vec<f64>>,
}

impl Bodies {
    fn new(parts: &[([usize; 2], [f64; 2], f64, Held)]) -> Self {
        let (mut triplets, mut points, mut kernel) = (Vec::new(), Vec::new(), Vec::new());
        for (i, &(cells, size, young, held)) in parts.iter().enumerate() {
            let origin = [5.0 * i as f64, 1.0];
            let mesh = rectangle(origin, size, cells, CellShape::Quad, "body", "");
            let body = Body {
                mesh: &mesh,
                materials: &[Material::new(young, 0.3)],
                plane: Plane::PlaneStrain,
                thickness: 1.0,
            };
            let prescribed = (mesh.nodes.iter())
                .map(|x| match held {
                    Held::Left if x[0] == origin[0] => [Some(0.0); 2],
                    Held::Below if x[1] == origin[1] => [None, Some(0.0)],
                    Held::Corner if *x == origin => [Some(0.0); 2],
                    _ => [None; 2],
                })
                .collect();
            let unknowns = Unknowns::new(prescribed);
            let (k, _) = assemble(&body, &unknowns, &vec![[0.0; 2]; mesh.nodes.len()]);
            let first = 2 * points.len();
            triplets.extend(k.triplets().map(|(i, j, v)| (first + i, first + j, v)));
            let own = unknowns.coordinates(&mesh);
            let along: &dyn Fn([f64; 2]) -> [f64; 2] = &|_| [1.0, 0.0];
            let up: &dyn Fn([f64; 2]) -> [f64; 2] = &|_| [0.0, 1.0];
            let turn: &dyn Fn([f64; 2]) -> [f64; 2] = &|x| [origin[1] - x[1], x[0] - origin[0]];
            let motions = match held {
                Held::Left => vec![],
                Held::Below => vec![along],
                Held::Corner => vec![turn],
                Held::Free => vec![along, up, turn],
            };
            for motion in motions {
                // Nodes held in one component keep it as an unknown without effect: the motion spares it.
                let mut mode = vec![0.0; first];
                mode.extend(own.iter().flat_map(|&x| match held {
                    Held::Corner if x == origin => [0.0; 2],
                    _ => motion(x),
                }));
                kernel.push(mode);
            }
            points.extend(own);
        }
        let n = 2 * points.len();
        let k = Arc::new(BlockCsr::from_triplets(n, n, triplets));
        let mut bodies = Self {
            k,
            points,
            kernel: Vec::new(),
        };
        for mut mode in kernel {
            mode.resize(n, 0.0);
            bodies.balance(&mut mode);
            let length = norm(&mode);
            mode.iter_mut().for_each(|v| *v /= length);
            let mut force = vec![0.0; n];
            bodies.k.mul(&mode, &mut force);
            let stiffness = bodies.k.diagonal().into_iter().fold(0.0, f64::max);
            assert!(norm(&force) < 1e-10 * stiffness, "{:e}", norm(&force));
            bodies.kernel.push(mode);
        }
        bodies
    }

    /// Takes the motions without energy out of a vector.
    fn balance(&self, b: &mut [f64]) {
        for _ in 0..2 {
            for mode in &self.kernel {
                let part = dot(mode, b);
                b.iter_mut().zip(mode).for_each(|(b, m)| *b -= part * m);
            }
        }
    }

    /// Iterations to 1e-8 for some balanced loads.
    fn solve<B: Backend>(
        &self,
        backend: B,
        with_points: bool,
        preconditioner: Preconditioner,
    ) -> usize {
        let points = with_points.then_some(&self.points[..]);
        let (k, _) = FloatingBodies::find(&self.k, &self.points).grounded(&self.k, |_| false);
        let mut pcg =
            Pcg::new(backend, &k, points, preconditioner).unwrap_or_else(|error| panic!("{error}"));
        let n = 2 * self.points.len();
        let mut most = 0;
        for seed in 0..3 {
            let mut b: Vec<f64> = load(n, n, seed).iter().map(|v| v - 0.8).collect();
            self.balance(&mut b);
            let mut x = vec![0.0; n];
            let before = pcg.counts.iterations;
            pcg.solve(&b, &mut x, 1e-8, &Stop::default())
                .unwrap_or_else(|error| panic!("{error}"));
            most = most.max(pcg.counts.iterations - before);
            // The ties gather the imbalance that CG has left all over the body.
            let reached = residual(&self.k, &x, &b);
            assert!(reached < 1e-7, "{reached:e}");
        }
        most
    }
}

#[test]
fn bodies_without_supports_are_solved() {
    let size = [3.0, 1.0];
    let (stiff, soft) = (2e11, 2e4);
    let small = [4, 3];
    use Held::*;
    // The smallest are solved by an inverse alone; some bodies of the others shrink to one node.
    for cells in [[6, 2], [30, 10], [120, 40]] {
        for parts in [
            vec![(cells, size, stiff, Free)],
            vec![(cells, size, stiff, Below)],
            vec![(cells, size, stiff, Corner)],
            vec![(cells, size, stiff, Free), (cells, size, stiff, Free)],
            vec![(cells, size, stiff, Free), (cells, size, soft, Free)],
            vec![(cells, size, soft, Free), (small, size, stiff, Free)],
            vec![(cells, size, stiff, Free), (small, size, soft, Free)],
            vec![(cells, size, stiff, Left), (small, size, soft, Corner)],
            vec![
                (cells, size, stiff, Corner),
                (small, size, soft, Below),
                ([1, 1], size, soft, Free),
            ],
        ] {
            let bodies = Bodies::new(&parts);
            let multigrid = Preconditioner::Multigrid;
            let single = bodies.solve(Cpu::<f32>::default(), true, multigrid);
            let double = bodies.solve(Cpu::<f64>::default(), true, multigrid);
            let held: Vec<_> = (parts.iter().map(|&(c, s, e, _)| (c, s, e, Left))).collect();
            let held = Bodies::new(&held).solve(Cpu::<f32>::default(), true, multigrid);
            let what = format!("{parts:?}: {single} and {double} iterations, {held} if held");
            println!("{what}");
            // Where the supported bodies are small enough for an inverse, free ones may be a little too
            // large for one. (20 iterations for 12 where moduli are 1e7 apart, 15 with a hierarchy in f64.)
            assert!(single.max(double) <= held.max(10) + 8, "{what}");
            let free = FloatingBodies::find(&bodies.k, &bodies.points);
            assert_eq!(free.n_modes(), bodies.kernel.len(), "{what}");
        }
    }
    let body = Bodies::new(&[([60, 20], size, stiff, Free)]);
    let without_points = body.solve(Cpu::<f32>::default(), false, Preconditioner::Multigrid);
    let jacobi = body.solve(Cpu::<f32>::default(), false, Preconditioner::BlockJacobi);
    println!("without points {without_points}, block-Jacobi {jacobi}");
    assert!(without_points <= 40 && jacobi <= 500);
}

/// A block of hexahedra on a rigid floor, without friction and without coordinates, pressed down on one side.
fn hexahedra_on_a_floor(
    cells: [usize; 3],
    size: [f64; 3],
    young: impl Fn(usize) -> f64,
) -> ContactProblem {
    let [nx, ny, nz] = cells;
    let stiffness = hexahedra(cells, size, young);
    let n = 3 * nx * (ny + 1) * (nz + 1);
    let vertical = |x: usize, y: usize, z: usize| 3 * ((z * (ny + 1) + y) * nx + x) + 2;
    let mut load = vec![0.0; n];
    let mut normal = Vec::new();
    for x in 0..nx {
        for y in 0..=ny {
            let place = (x + 1) as f64 / nx as f64;
            load[vertical(x, y, nz)] = -1e-4 * (1.0 - 1.5 * place * place);
            normal.push((normal.len(), vertical(x, y, 0), -1.0));
        }
    }
    let m = normal.len();
    ContactProblem::new(ContactData {
        stiffness,
        load,
        normal: Csr::from_triplets(m, n, normal),
        tangential: Csr::from_triplets(m, n, []),
        gap: vec![0.0; m],
        slip_bound: vec![0.0; m],
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"))
}

/// The products with A that the contact problem takes on both paths to K⁻¹, where PCG is slow.
fn products_on_both_paths(problem: &ContactProblem, what: &str) {
    let settings = ssnm::NewtonSettings::default();
    let go_on = |_: &ssnm::Step| ControlFlow::Continue(());
    let mut direct = DirectDual::new(problem).unwrap_or_else(|error| panic!("{error}"));
    let mut nested = NestedDual::new(problem, Cpu::<f32>::default(), Preconditioner::Multigrid)
        .unwrap_or_else(|error| panic!("{error}"));
    let [a, b] = [&mut direct as &mut dyn DualOperator, &mut nested].map(|dual| {
        let found = ssnm::solve(problem, dual, &settings, go_on);
        let found = found.unwrap_or_else(|error| panic!("{what}: {error}"));
        assert_eq!(found.status, Status::Converged, "{what}");
        let largest = found
            .lambda
            .iter()
            .fold(0.0, |max: f64, l| max.max(l.abs()));
        (found.info.iter, found.info.n_a, found.lambda, largest)
    });
    let costs = nested.costs().expect("it iterates").solves;
    println!(
        "{what}: {} steps and {} products on the factor, {} and {} by PCG, {costs:?}",
        a.0, a.1, b.0, b.1
    );
    assert!(2 * b.1 <= 3 * a.1 + 20, "{what}");
    let apart = (a.2.iter().zip(&b.2)).fold(0.0, |max: f64, (a, b)| max.max((a - b).abs()));
    // Each is right to 1e-3.
    assert!(apart < 2e-3 * a.3, "{what}: {apart:e} of {:e}", a.3);
}

#[test]
fn contact_takes_few_products_where_pcg_is_slow() {
    let cells = [12, 4, 4];
    for (what, size, contrast) in [
        ("a block", [3.0, 1.0, 1.0], 1.0),
        ("a slender block", [30.0, 1.0, 1.0], 1.0),
        ("layers", [3.0, 1.0, 1.0], 1e6),
    ] {
        let young = |cell: usize| match cell / (cells[0] * cells[1]) % 2 {
            0 => 1.0,
            _ => contrast,
        };
        products_on_both_paths(&hexahedra_on_a_floor(cells, size, young), what);
    }
}

/// A block in which errors of products by PCG hide new directions, unless products become more accurate.
#[test]
#[ignore = "takes a minute"]
fn contact_of_a_large_block_of_hexahedra() {
    let problem = hexahedra_on_a_floor([48, 16, 16], [3.0, 1.0, 1.0], |_| 1.0);
    assert_eq!(problem.n(), 41_616);
    products_on_both_paths(&problem, "n = 41 616");
}

/// A slender strip held at one end, turned about the origin, of two materials in alternating elements; the points of its unknowns.
fn strip(angle: f64, contrast: f64) -> (Arc<BlockCsr<2>>, Vec<[f64; 2]>) {
    let (cells, size) = ([120, 12], [10.0, 1.0]);
    let mut mesh = rectangle([0.0; 2], size, cells, CellShape::Quad, "body", "");
    mesh.regions.push("second".to_owned());
    for e in 0..mesh.elements.len() {
        mesh.elements[e].region = u32::from(e % 7 < 3);
    }
    let (sin, cos) = angle.sin_cos();
    for x in &mut mesh.nodes {
        *x = [cos * x[0] - sin * x[1], sin * x[0] + cos * x[1]];
    }
    let (k, unknowns) = held_on_the_left(&mesh, &[1.0, contrast].map(|e| Material::new(e, 0.3)));
    let blocks = 0..unknowns.n_blocks();
    let points = blocks.map(|block| mesh.nodes[unknowns.node(block) as usize]);
    (Arc::new(k), points.collect())
}

/// The iterations of a solve, whose answer is checked.
fn solved<B: Backend>(pcg: &mut Pcg<B>, k: &BlockCsr<2>) -> usize {
    let b = load(k.n_rows(), k.n_rows(), 3);
    let (mut x, before) = (vec![0.0; b.len()], pcg.counts.iterations);
    pcg.solve(&b, &mut x, 1e-8, &Stop::default())
        .expect("a solution");
    let reached = residual(k, &x, &b);
    assert!(reached < 1e-6, "{reached:e}");
    pcg.counts.iterations - before
}

/// What makes the preconditioner of a K of plane problems.
fn made_of<B: Backend>(k: &Arc<BlockCsr<2>>, points: &[[f64; 2]]) -> Renewal<B> {
    let (k, points) = (Arc::clone(k), points.to_vec());
    Box::new(move |backend, multigrid| multigrid.rebuild(backend, &k, Some(&points), None))
}

fn a_preconditioner_is_kept<B: Backend>(mut backend: impl FnMut() -> B) {
    let (k, points) = strip(0.0, 1.0);
    let mut fresh = || {
        let mut pcg =
            Pcg::new(backend(), &k, Some(&points), Preconditioner::Multigrid).expect("a hierarchy");
        let own = solved(&mut pcg, &k);
        (pcg, own)
    };
    // It turns with the body, again and again.
    let (mut pcg, own) = fresh();
    for angle in [0.01, 0.4, 1.5, 3.0] {
        let (turned, there) = strip(angle, 1.0);
        pcg.follow(&turned, Some(&there), made_of(&turned, &there))
            .expect("the same pattern");
        let took = solved(&mut pcg, &turned);
        assert!(took <= own + 4, "{took} iterations after {own}");
        assert_eq!(pcg.counts.set_ups, 1);
    }
    // One that does not fit is replaced while a system is solved, which loses hardly more than that costs.
    for (angle, contrast, knows) in [(1.5, 1.0, false), (0.3, 1e4, true)] {
        let (mut pcg, _) = fresh();
        let (other, there) = strip(angle, contrast);
        let mut renewed = fresh().0;
        (renewed.update(&other, Some(&there), None)).expect("the same pattern");
        let alone = solved(&mut renewed, &other);
        let known = knows.then_some(&*there);
        pcg.follow(&other, known, made_of(&other, &there))
            .expect("the same pattern");
        let took = solved(&mut pcg, &other);
        let most = pcg.backend.cost_of_hierarchy() + 2 * CHUNK + 2 * alone;
        assert_eq!(pcg.counts.set_ups, 2);
        assert!(took <= most, "{took} iterations, {alone} alone");
        // From then on it is as good as new.
        let again = solved(&mut pcg, &other);
        assert!(again <= alone + 2, "{again} iterations, {alone} alone");
    }
}

#[test]
fn a_preconditioner_is_kept_on_the_cpu() {
    a_preconditioner_is_kept(Cpu::<f32>::default);
    a_preconditioner_is_kept(Cpu::<f64>::default);
}
