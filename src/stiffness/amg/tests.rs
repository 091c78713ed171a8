//! Tests of the hierarchy and of conjugate gradients with it.

mod stretched;

use super::aggregation::{Strength, aggregate, strength, ties, weights};
use super::prolongation::{Pattern, rigid_body_modes, smoothed, tentative};
use super::*;
use crate::backend::cpu::Cpu;
use crate::control::Stop;
use crate::elasticity::{Body, Material, Plane, Unknowns, assemble, vertices};
use crate::lattice::lattice;
use crate::mesh::structured::{CellShape, SolidShape, rectangle};
use crate::mesh::{Element, Mesh, facet_nodes};
use crate::problem::ContactProblem;
use crate::reference::{self, CASE_B, CASE_C, Geometry, MATERIAL};
use crate::sparse::{dot, norm};
use crate::stiffness::pcg::Pcg;
use std::sync::Arc;
use web_time::Instant;

/// How a solve went.
#[derive(Debug)]
struct Solve {
    iterations: usize,
    /// ‖K x − f‖ / ‖f‖ of the answer.
    residual: f64,
    /// Seconds per iteration.
    seconds: f64,
}

/// Conjugate gradients preconditioned with M, to ‖K x − f‖ ≤ 1e-8 ‖f‖.
fn pcg<const D: usize, S: Real>(k: &BlockCsr<D>, f: &[f64], m: &Hierarchy<S>) -> Solve {
    let k = Arc::new(k.clone());
    let mut pcg = Pcg::with_hierarchy(Cpu::<S>::default(), Arc::clone(&k) as _, m.clone())
        .unwrap_or_else(|error| panic!("{error}"));
    let mut x = vec![0.0; f.len()];
    let start = Instant::now();
    // A solve that does not get there shows in the residual.
    let _ = pcg.solve(f, &mut x, 1e-8, &Stop::default());
    let iterations = pcg.counts.iterations;
    let seconds = start.elapsed().as_secs_f64() / iterations as f64;
    let mut product = vec![0.0; f.len()];
    k.mul(&x, &mut product);
    Solve {
        iterations,
        residual: difference(&product, f),
        seconds,
    }
}

/// The preconditioner on the CPU.
struct Cycle<S: Real> {
    cpu: Cpu<S>,
    multigrid: Multigrid<Cpu<S>>,
    scale: f64,
}

impl<S: Real> Cycle<S> {
    fn new(hierarchy: &Hierarchy<S>) -> Self {
        let mut cpu = Cpu::default();
        Self {
            multigrid: Multigrid::new(&mut cpu, hierarchy.clone())
                .unwrap_or_else(|error| panic!("{error}")),
            cpu,
            scale: hierarchy.scale,
        }
    }

    /// z = M r.
    fn apply(&mut self, r: &[f64], z: &mut [f64]) {
        for (there, &r) in self.multigrid.r().iter_mut().zip(r) {
            *there = S::from_f64(r);
        }
        self.multigrid
            .cycle(&mut self.cpu, &Default::default())
            .unwrap();
        for (z, there) in z.iter_mut().zip(self.multigrid.z()) {
            *z = self.scale * there.to_f64();
        }
    }
}

/// A body clamped on `left` and loaded on `top`: K, f and the points of its blocks.
fn clamped(mesh: &Mesh, materials: &[Material]) -> (BlockCsr<2>, Vec<f64>, Vec<[f64; 2]>) {
    let body = Body {
        mesh,
        materials,
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let unknowns = held_left(mesh);
    let mut forces = vec![[0.0; 2]; mesh.nodes.len()];
    body.add_traction(&mesh.boundaries["top"], |_, _| [1e6, -1e7], &mut forces);
    let (k, f) = assemble(&body, &unknowns, &forces);
    (k, f, unknowns.coordinates(mesh))
}

fn held_left(mesh: &Mesh) -> Unknowns {
    let mut prescribed = vec![[None; 2]; mesh.nodes.len()];
    for &node in mesh.boundaries["left"].iter().flat_map(facet_nodes) {
        prescribed[node as usize] = [Some(0.0); 2];
    }
    Unknowns::new(prescribed)
}

/// A rectangle of triangles with moved nodes and diagonals at random.
fn shaken(size: [f64; 2], cells: [usize; 2]) -> Mesh {
    let mut mesh = rectangle([0.0, 0.0], size, cells, CellShape::Quad, "body", "");
    let [nx, ny] = cells;
    for j in 1..ny {
        for i in 1..nx {
            let node = j * (nx + 1) + i;
            for c in 0..2 {
                mesh.nodes[node][c] +=
                    0.25 * size[c] / cells[c] as f64 * smoother::noise(2 * node + c);
            }
        }
    }
    let quads = std::mem::take(&mut mesh.elements);
    for (e, quad) in quads.iter().enumerate() {
        let &[a, b, c, d] = quad.nodes() else {
            unreachable!()
        };
        let (one, two) = if smoother::noise(e) > 0.0 {
            ([a, b, c], [a, c, d])
        } else {
            ([a, b, d], [b, c, d])
        };
        mesh.elements
            .extend([Element::triangle(one, 0), Element::triangle(two, 0)]);
    }
    mesh
}

/// Gives every element for which `stiff` holds of its centre a second region.
fn second_region(mut mesh: Mesh, stiff: impl Fn([f64; 2]) -> bool) -> Mesh {
    mesh.regions.push("second".to_owned());
    for e in 0..mesh.elements.len() {
        let nodes = mesh.elements[e].nodes();
        let centre = std::array::from_fn(|c| {
            nodes
                .iter()
                .map(|&node| mesh.nodes[node as usize][c])
                .sum::<f64>()
                / nodes.len() as f64
        });
        mesh.elements[e].region = u32::from(stiff(centre));
    }
    mesh
}

fn quads(size: [f64; 2], cells: [usize; 2]) -> Mesh {
    rectangle([0.0, 0.0], size, cells, CellShape::Quad, "body", "")
}

fn reference_problem(geometry: Geometry, k: usize) -> ContactProblem {
    let mesh = reference::mesh(geometry, k);
    reference::problem(geometry, &mesh, &CASE_B).expect("the reference problem is sound")
}

fn hierarchy<S: Real>(k: &BlockCsr<2>, points: &[[f64; 2]]) -> Hierarchy<S> {
    Hierarchy::new(k, Some(points), &AmgSettings::default()).expect("K is positive definite")
}

/// A vector without pattern.
fn noise(n: usize, seed: usize) -> Vec<f64> {
    (0..n).map(|i| smoother::noise(seed * n + i)).collect()
}

#[test]
fn iterations_on_the_reference_problems() {
    for (geometry, k, limit) in [
        (Geometry::OneBody, 1, 11),
        (Geometry::OneBody, 3, 12),
        (Geometry::OneBody, 7, 15),
        (Geometry::OneBody, 13, 16),
        (Geometry::TwoBodies, 3, 12),
        (Geometry::TwoBodies, 7, 13),
    ] {
        let problem = reference_problem(geometry, k);
        let points = problem.coordinates().expect("made from a mesh");
        let m = hierarchy::<f32>(problem.stiffness(), points);
        let solve = pcg(problem.stiffness(), problem.load(), &m);
        println!(
            "{geometry:?} {k}: {solve:?}, {:.2}",
            m.operator_complexity()
        );
        assert!(solve.iterations <= limit, "{geometry:?} {k}: {solve:?}");
        assert!(solve.residual < 2e-8, "{geometry:?} {k}: {solve:?}");
        assert!(k < 13 || m.operator_complexity() < 1.5, "{m}");
    }
}

/// Hexahedra and tetrahedra of a clamped block: the last numbers bound the iterations and the complexity.
#[test]
fn iterations_in_space() {
    let mut small = None;
    for (q, shape, limit, complexity) in [
        (8, SolidShape::Hexahedron, 13, 1.15),
        (16, SolidShape::Hexahedron, 12, 1.2),
        (24, SolidShape::Hexahedron, 12, 1.2),
        (8, SolidShape::Tetrahedron, 12, 1.4),
        (16, SolidShape::Tetrahedron, 13, 1.45),
    ] {
        let problem = (CASE_C.problem(q, shape)).unwrap_or_else(|error| panic!("{error}"));
        let k = problem.stiffness();
        let m = Hierarchy::<f32>::new(k, problem.coordinates(), &AmgSettings::of_dimension(3))
            .unwrap_or_else(|error| panic!("{error}"));
        let solve = pcg(k, problem.load(), &m);
        println!("{shape:?} {q}: {solve:?}, {:.3}", m.operator_complexity());
        assert!(solve.iterations <= limit, "{shape:?} {q}: {solve:?}");
        assert!(solve.residual < 2e-8, "{shape:?} {q}: {solve:?}");
        assert!(m.operator_complexity() < complexity, "{shape:?} {q}: {m}");
        small.get_or_insert((problem, m));
    }
    let (problem, m) = small.expect("there is one");
    check_symmetric_definite(problem.stiffness(), &m, 1e-3);
}

#[test]
#[ignore = "needs a minute in the debug profile and 2 GB"]
fn iterations_on_large_reference_problems() {
    for k in [26, 40] {
        let problem = reference_problem(Geometry::OneBody, k);
        let points = problem.coordinates().expect("made from a mesh");
        let m = hierarchy::<f32>(problem.stiffness(), points);
        let solve = pcg(problem.stiffness(), problem.load(), &m);
        println!("{k}: {solve:?}\n{m}");
        assert!(solve.iterations <= 20, "{k}: {solve:?}");
        assert!(m.operator_complexity() < 1.5, "{m}");
    }
}

#[test]
fn iterations_on_meshes_and_materials() {
    let soft = Material {
        young: 1e-4 * MATERIAL.young,
        ..MATERIAL
    };
    let checkers = |x: [f64; 2]| ((x[0] * 8.0) as i32 + (x[1] * 8.0) as i32) % 2 == 0;
    let disc = |x: [f64; 2]| (x[0] - 1.5).powi(2) + (x[1] - 0.5).powi(2) < 0.09;
    let triangles = CellShape::Triangle;
    // The last entry bounds the complexity. Where elements are a hundred times as long as wide, only the short
    // direction is coarsened.
    let cases: [(&str, Mesh, [Material; 2], usize, f64); 10] = [
        (
            "triangles",
            rectangle([0.0; 2], [3.0, 1.0], [300, 100], triangles, "body", ""),
            [MATERIAL; 2],
            15,
            1.7,
        ),
        (
            "shaken",
            shaken([3.0, 1.0], [300, 100]),
            [MATERIAL; 2],
            16,
            2.1,
        ),
        // 203 500 unknowns.
        (
            "shaken, fine",
            shaken([3.0, 1.0], [550, 184]),
            [MATERIAL; 2],
            16,
            2.1,
        ),
        (
            "checkers",
            second_region(quads([3.0, 1.0], [300, 100]), checkers),
            [MATERIAL, soft],
            35,
            1.7,
        ),
        (
            "soft disc",
            second_region(shaken([3.0, 1.0], [300, 100]), disc),
            [MATERIAL, soft],
            16,
            2.1,
        ),
        (
            "stiff disc",
            second_region(shaken([3.0, 1.0], [300, 100]), disc),
            [soft, MATERIAL],
            17,
            2.1,
        ),
        ("flat", quads([3.0, 0.1], [60, 200]), [MATERIAL; 2], 37, 2.0),
        ("tall", quads([0.1, 3.0], [200, 60]), [MATERIAL; 2], 22, 2.0),
        (
            "flat triangles",
            shaken([3.0, 0.3], [100, 100]),
            [MATERIAL; 2],
            22,
            2.1,
        ),
        (
            "beam",
            quads([30.0, 1.0], [600, 20]),
            [MATERIAL; 2],
            17,
            2.2,
        ),
    ];
    for (name, mesh, materials, limit, complexity) in cases {
        let (k, f, points) = clamped(&mesh, &materials[..mesh.regions.len()]);
        let m = hierarchy::<f32>(&k, &points);
        let solve = pcg(&k, &f, &m);
        println!("{name}: {solve:?} {:.2}", m.operator_complexity());
        assert!(solve.iterations <= limit, "{name}: {solve:?}");
        assert!(m.operator_complexity() < complexity, "{name}: {m}");
    }
}

#[test]
fn translations_alone_do_worse_but_do() {
    let problem = reference_problem(Geometry::OneBody, 5);
    let k = problem.stiffness();
    let m =
        Hierarchy::<f32>::new(k, None, &AmgSettings::default()).expect("K is positive definite");
    let solve = pcg(k, problem.load(), &m);
    println!("{solve:?}\n{m}");
    assert!(solve.iterations <= 34, "{solve:?}");
}

#[test]
fn storing_in_f32_costs_few_iterations() {
    // Bending a slender beam is so soft that rounding the matrix to f32 shows.
    for (mesh, more) in [
        (shaken([3.0, 1.0], [180, 60]), 0),
        (quads([20.0, 1.0], [400, 20]), 3),
    ] {
        let (k, f, points) = clamped(&mesh, &[MATERIAL]);
        let single = pcg(&k, &f, &hierarchy::<f32>(&k, &points)).iterations;
        let double = pcg(&k, &f, &hierarchy::<f64>(&k, &points)).iterations;
        println!("f32 {single}, f64 {double}");
        assert!(single <= double + more, "f32 {single}, f64 {double}");
    }
}

#[test]
fn units_do_not_matter() {
    let (k, f, points) = clamped(&shaken([3.0, 1.0], [90, 30]), &[MATERIAL]);
    let reference = pcg(&k, &f, &hierarchy::<f32>(&k, &points)).iterations;
    for (stiffness, load, length) in [(1e-25, 1.0, 1e-3), (3e11, 1e-40, 1e3), (7e-3, 5e60, 1e9)] {
        let entries = k.triplets().map(|(i, j, v)| (i, j, stiffness * v));
        let k = BlockCsr::from_triplets(k.n_rows(), k.n_cols(), entries);
        let f: Vec<f64> = f.iter().map(|v| load * v).collect();
        let points: Vec<[f64; 2]> = points
            .iter()
            .map(|x| x.map(|v| length * (v + 5.0)))
            .collect();
        let found = pcg(&k, &f, &hierarchy::<f32>(&k, &points)).iterations;
        assert!(found.abs_diff(reference) <= 1, "{found}, not {reference}");
    }
}

/// y = M x for any block size.
fn multiply(m: &BlockMatrix<f64>, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; m.n_rows()];
    let [rows, cols] = m.block();
    for i in 0..m.n_block_rows() {
        for k in m.row_ptr()[i] as usize..m.row_ptr()[i + 1] as usize {
            for a in 0..rows {
                for b in 0..cols {
                    y[i * rows + a] += m.values()[(k * rows + a) * cols + b]
                        * x[m.col_idx()[k] as usize * cols + b];
                }
            }
        }
    }
    y
}

fn difference(x: &[f64], y: &[f64]) -> f64 {
    let error: Vec<f64> = x.iter().zip(y).map(|(x, y)| x - y).collect();
    norm(&error) / norm(y)
}

#[test]
fn coarse_matrices_are_galerkin_products() {
    let (k, _, points) = clamped(&shaken([3.0, 1.0], [120, 40]), &[MATERIAL]);
    let settings = AmgSettings {
        dense_limit: 100,
        ..AmgSettings::default()
    };
    let m = Hierarchy::<f64>::new(&k, Some(&points), &settings).expect("K is positive definite");
    assert!(m.levels.len() >= 3, "{m}");
    for (i, pair) in m.levels.windows(2).enumerate() {
        let (level, coarse) = (&pair[0], &pair[1].smoother.matrix);
        let v = noise(coarse.n_rows(), i);
        let product = multiply(
            &level.restriction,
            &multiply(&level.smoother.matrix, &multiply(&level.prolongation, &v)),
        );
        assert!(difference(&product, &multiply(coarse, &v)) < 1e-13);
        // Row access to the transpose, and the transpose of row access.
        let (x, y) = (
            noise(level.prolongation.n_rows(), 7),
            noise(coarse.n_rows(), 8),
        );
        let (px, rx) = (
            multiply(&level.prolongation, &y),
            multiply(&level.restriction, &x),
        );
        assert!((dot(&x, &px) - dot(&rx, &y)).abs() < 1e-12 * norm(&x) * norm(&y));
    }
    // A⁻¹A = I on the coarsest level, up to the raised diagonal.
    let Coarse::Inverse(inverse) = &m.coarse else {
        panic!("{m}");
    };
    let last = m.levels.last().expect("there are levels");
    let v = noise(inverse.n(), 1);
    let av = multiply(
        &last.restriction,
        &multiply(&last.smoother.matrix, &multiply(&last.prolongation, &v)),
    );
    let back: Vec<f64> = (inverse.values().chunks(inverse.n()))
        .map(|row| dot(row, &av))
        .collect();
    assert!(difference(&back, &v) < 1e-2);
}

/// In space the levels have blocks of 3, then of 6, and the iterations hardly grow.
#[test]
fn a_lattice_in_space_is_solved() {
    let mut iterations = Vec::new();
    for cells in [[8, 8, 8], [16, 16, 16]] {
        let (k, points) = lattice(cells);
        let f = noise(k.n_rows(), 5);
        let settings = AmgSettings::of_dimension(3);
        let hierarchy = Hierarchy::<f32>::new(&k, Some(&points), &settings)
            .unwrap_or_else(|error| panic!("{error}"));
        let blocks: Vec<[usize; 2]> = (hierarchy.levels.iter())
            .map(|level| level.smoother.matrix.block())
            .collect();
        assert_eq!(blocks[0], [3, 3]);
        assert!(blocks[1..].iter().all(|&block| block == [6, 6]));
        assert!(hierarchy.has_rotations());
        let solved = pcg(&k, &f, &hierarchy);
        assert!(solved.residual < 2e-8, "{solved:?}");
        check_symmetric_definite(&k, &hierarchy, 1e-4);
        iterations.push(solved.iterations);
        let without =
            Hierarchy::<f32>::new(&k, None, &settings).unwrap_or_else(|error| panic!("{error}"));
        assert!(!without.has_rotations());
        assert!(pcg(&k, &f, &without).residual < 2e-8);
        let jacobi = Hierarchy::block_jacobi(&k).unwrap_or_else(|error| panic!("{error}"));
        assert!(pcg::<_, f32>(&k, &f, &jacobi).residual < 2e-8);
    }
    assert!(
        iterations[1] <= iterations[0] + 6 && iterations[1] <= 30,
        "{iterations:?}"
    );
    // Rigid motions are represented exactly.
    let (k, points) = lattice([5, 4, 6]);
    let modes = rigid_body_modes::<3, 6>(points.len(), Some(&points), &Ranks::default());
    let halo = Halo::alone(k.n_block_rows());
    let ties = ties(&k, &halo);
    let Strength { strong, .. } = strength(
        &ties,
        &weights(&k, 1.0, &halo),
        0.38,
        f64::INFINITY,
        Some(&points),
        &halo,
    );
    let aggregates = aggregate(&ties, &strong, false, |_| false);
    let tentative = tentative(&modes, &aggregates);
    for (i, mode) in modes.iter().enumerate() {
        let coarse = &tentative.coarse[aggregates.of_node[i] as usize];
        for (c, row) in tentative.q[i].iter().enumerate() {
            for m in 0..6 {
                let found: f64 = (0..6).map(|p| row[p] * coarse[p][m]).sum();
                assert!((found - mode[c][m]).abs() < 1e-12, "{found}");
            }
        }
    }
}

#[test]
fn rigid_body_modes_are_interpolated_exactly() {
    check_rigid_motions(&shaken([3.0, 1.0], [60, 20]));
    // With weak ties, which are left out of P.
    check_rigid_motions(&quads([3.0, 0.1], [60, 20]));
}

fn check_rigid_motions(mesh: &Mesh) {
    let (k, _, points) = clamped(mesh, &[MATERIAL]);
    let n = k.n_block_rows();
    let modes = rigid_body_modes::<2, 3>(n, Some(&points), &Ranks::default());
    let halo = Halo::alone(k.n_block_rows());
    let ties = ties(&k, &halo);
    let Strength { strong, pulling } = strength(
        &ties,
        &weights(&k, 1.0, &halo),
        0.38,
        3.0,
        Some(&points),
        &halo,
    );
    let mut aggregates = aggregate(&ties, &strong, false, |_| false);
    let tentative = tentative(&modes, &aggregates);
    for i in 0..n {
        let coarse = &tentative.coarse[aggregates.of_node[i] as usize];
        for c in 0..2 {
            for b in 0..3 {
                let value: f64 = (0..3).map(|p| tentative.q[i][c][p] * coarse[p][b]).sum();
                assert!((value - modes[i][c][b]).abs() < 1e-12);
            }
        }
    }
    // Away from the support K moves them without force, so that smoothing keeps them too.
    let inverse_diagonal = smoother::inverse_diagonal(&k).expect("K is positive definite");
    let (pattern, coarse) = Pattern::new(&mut aggregates, &pulling, &halo);
    let p = smoothed(
        &k,
        &inverse_diagonal,
        &[0.5, 1.0],
        &aggregates,
        &pattern,
        &tentative,
        [&halo, &coarse],
    );
    for b in 0..3 {
        let coarse: Vec<f64> = tentative
            .coarse
            .iter()
            .flatten()
            .map(|row| row[b])
            .collect();
        let mut fine = vec![0.0; k.n_rows()];
        p.mul(&coarse, &mut fine);
        let whole: Vec<f64> = modes.iter().flatten().map(|row| row[b]).collect();
        let mut force = vec![0.0; k.n_rows()];
        k.mul(&whole, &mut force);
        for (i, x) in points.iter().enumerate().filter(|(_, x)| x[0] > 0.2) {
            for c in 0..2 {
                assert!(force[2 * i + c].abs() < 1e-12 * MATERIAL.young, "{x:?}");
                assert!((fine[2 * i + c] - whole[2 * i + c]).abs() < 1e-12, "{x:?}");
            }
        }
    }
}

/// Checks xᵀM y = yᵀM x and xᵀM x > 0 on random vectors, relative to the norms of the products.
fn check_symmetric_definite<const D: usize, S: Real>(
    k: &BlockCsr<D>,
    m: &Hierarchy<S>,
    tolerance: f64,
) {
    let n = k.n_rows();
    let mut cycle = Cycle::new(m);
    let (mut mx, mut my) = (vec![0.0; n], vec![0.0; n]);
    for seed in 0..4 {
        let (x, y) = (noise(n, 2 * seed), noise(n, 2 * seed + 1));
        cycle.apply(&x, &mut mx);
        cycle.apply(&y, &mut my);
        let (xmx, ymy) = (dot(&x, &mx), dot(&y, &my));
        assert!(xmx > 0.0 && ymy > 0.0, "{xmx:e} {ymy:e}");
        let difference = (dot(&x, &my) - dot(&y, &mx)).abs();
        assert!(
            difference < tolerance * (xmx * ymy).sqrt(),
            "{difference:e}"
        );
        // Vectors that K makes small: those that M x contains least of.
        k.mul(&x, &mut mx);
        cycle.apply(&mx.clone(), &mut my);
        assert!(dot(&mx, &my) > 0.0);
    }
}

#[test]
fn the_cycle_is_symmetric_positive_definite() {
    let stiff = Material {
        young: 1e4 * MATERIAL.young,
        ..MATERIAL
    };
    let disc = |x: [f64; 2]| (x[0] - 1.5).powi(2) + (x[1] - 0.5).powi(2) < 0.09;
    for (mesh, materials) in [
        (shaken([3.0, 1.0], [120, 40]), [MATERIAL; 2]),
        (
            second_region(shaken([3.0, 1.0], [120, 40]), disc),
            [MATERIAL, stiff],
        ),
        (quads([3.0, 0.1], [40, 133]), [MATERIAL; 2]),
        (quads([200.0, 1.0], [1600, 8]), [MATERIAL; 2]),
    ] {
        let (k, _, points) = clamped(&mesh, &materials[..mesh.regions.len()]);
        check_symmetric_definite(&k, &hierarchy::<f64>(&k, &points), 1e-9);
        check_symmetric_definite(&k, &hierarchy::<f32>(&k, &points), 1e-3);
    }
}

#[test]
fn fixed_components_stay_alone() {
    // Rollers below, and every seventh node held in both components by a decoupled block.
    let mesh = shaken([3.0, 1.0], [90, 30]);
    let body = Body {
        mesh: &mesh,
        materials: &[MATERIAL],
        plane: Plane::PlaneStress,
        thickness: 1.0,
    };
    let mut prescribed = vec![[None; 2]; mesh.nodes.len()];
    for &node in mesh.boundaries["bottom"].iter().flatten() {
        prescribed[node as usize][1] = Some(0.0);
    }
    for &node in mesh.boundaries["left"].iter().flatten() {
        prescribed[node as usize][0] = Some(0.0);
    }
    let unknowns = Unknowns::new(prescribed);
    let (k, _) = assemble(&body, &unknowns, &vec![[0.0; 2]; mesh.nodes.len()]);
    let held = |unknown: usize| (unknown / 2).is_multiple_of(7);
    let entries = (k.triplets()).filter(|&(i, j, _)| i == j || !(held(i) || held(j)));
    let k = BlockCsr::from_triplets(k.n_rows(), k.n_cols(), entries);
    let m = hierarchy::<f32>(&k, &unknowns.coordinates(&mesh));
    let solve = pcg(&k, &noise(k.n_rows(), 3), &m);
    assert!(solve.iterations <= 20, "{solve:?}");
}

/// Springs between unknowns i and j, and from unknown i to the ground.
fn springs(n: usize, between: &[(usize, usize)], ground: &[usize]) -> BlockCsr<2> {
    let pairs =
        (between.iter()).flat_map(|&(i, j)| [(i, i, 1.0), (j, j, 1.0), (i, j, -1.0), (j, i, -1.0)]);
    BlockCsr::from_triplets(n, n, pairs.chain(ground.iter().map(|&i| (i, i, 1.0))))
}

#[test]
fn odd_problems_are_solved() {
    // Nodes along a line, moving along it or across it, in one piece, in pieces of two, and single.
    let n = 6000;
    let line: Vec<(usize, usize)> = (0..n - 2).map(|i| (i, i + 2)).collect();
    let pieces: Vec<(usize, usize)> = (0..n / 4)
        .flat_map(|i| [(4 * i, 4 * i + 2), (4 * i + 1, 4 * i + 3)])
        .collect();
    let mixed: Vec<(usize, usize)> = (0..n / 2).map(|i| (2 * i, 2 * i + 1)).collect();
    let all: Vec<usize> = (0..n).collect();
    let points: Vec<[f64; 2]> = (0..n / 2).map(|i| [i as f64, 0.0]).collect();
    for (name, k, limit) in [
        ("line", springs(n, &line, &[0, 1]), 40),
        ("pieces", springs(n, &pieces, &all), 20),
        ("single nodes", springs(n, &mixed, &all), 10),
        ("single unknowns", springs(n, &[], &all), 5),
        ("one node", springs(2, &[(0, 1)], &[0]), 3),
    ] {
        let nodes = k.n_block_rows();
        for points in [
            Some(&points[..nodes]),
            Some(&vec![[1.0, 2.0]; nodes][..]),
            None,
        ] {
            for settings in [
                AmgSettings::default(),
                AmgSettings {
                    dense_limit: 0,
                    ..AmgSettings::default()
                },
            ] {
                let m = Hierarchy::<f32>::new(&k, points, &settings).expect(name);
                let solve = pcg(&k, &noise(k.n_rows(), 1), &m);
                println!("{name}: {solve:?}");
                assert!(solve.iterations <= limit, "{name}: {solve:?}\n{m}");
            }
        }
    }
}

#[test]
fn a_stalled_hierarchy_ends_with_smoothing() {
    // Pairs of nodes that no other is tied to: too many for an inverse, and aggregates of two.
    let n = 6000;
    let pairs: Vec<(usize, usize)> = (0..n / 4)
        .flat_map(|i| [(4 * i, 4 * i + 2), (4 * i + 1, 4 * i + 3)])
        .collect();
    let all: Vec<usize> = (0..n).collect();
    let (k, f) = (springs(n, &pairs, &all), noise(n, 3));
    let points: Vec<[f64; 2]> = (0..n / 2).map(|i| [i as f64, 0.0]).collect();
    let m = hierarchy::<f32>(&k, &points);
    assert!(
        matches!(m.coarse, Coarse::Smoothed(_)) && m.levels.is_empty(),
        "{m}"
    );
    let solve = pcg(&k, &f, &m);
    assert!(solve.residual < 2e-8, "{solve:?}");
}

#[test]
fn unsolvable_cases_are_refused() {
    let refused = |k: &BlockCsr<2>, points: Option<&[[f64; 2]]>| {
        Hierarchy::<f32>::new(k, points, &AmgSettings::default()).map(|m| m.to_string())
    };
    // A body without supports, small and large.
    for cells in [[4, 3], [60, 20]] {
        let mesh = shaken([3.0, 1.0], cells);
        let body = Body {
            mesh: &mesh,
            materials: &[MATERIAL],
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        let unknowns = Unknowns::new(vec![[None; 2]; mesh.nodes.len()]);
        let (k, _) = assemble(&body, &unknowns, &vec![[0.0; 2]; mesh.nodes.len()]);
        for points in [Some(&mesh.nodes[..]), None] {
            assert_eq!(refused(&k, points), Err(AmgError::Singular));
        }
    }
    // A small piece without supports beside a supported body.
    let (body, _, mut points) = clamped(&shaken([3.0, 1.0], [60, 20]), &[MATERIAL]);
    let n = body.n_rows();
    for cells in [[1, 1], [2, 2], [9, 7]] {
        let piece = shaken([1.0, 1.0], cells);
        let unknowns = Unknowns::new(vec![[None; 2]; piece.nodes.len()]);
        let forces = vec![[0.0; 2]; piece.nodes.len()];
        let floating = Body {
            mesh: &piece,
            materials: &[MATERIAL],
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        let (piece_k, _) = assemble(&floating, &unknowns, &forces);
        let shifted = piece_k.triplets().map(|(i, j, v)| (i + n, j + n, v));
        let size = n + piece_k.n_rows();
        let k = BlockCsr::from_triplets(size, size, body.triplets().chain(shifted));
        points.truncate(n / 2);
        points.extend(piece.nodes.iter().map(|x| [x[0] + 5.0, x[1]]));
        assert_eq!(
            refused(&k, Some(&points)),
            Err(AmgError::Singular),
            "{cells:?}"
        );
    }
    // Positive definite blocks, but a coupling that is too strong for a definite matrix.
    let chain = (0..3998).flat_map(|i| [(i, i + 2, -0.9), (i + 2, i, -0.9)]);
    let diagonal = (0..4000).map(|i| (i, i, 1.0));
    let indefinite = BlockCsr::from_triplets(4000, 4000, chain.chain(diagonal));
    assert_eq!(refused(&indefinite, None), Err(AmgError::Singular));
    let n = 4000;
    let all: Vec<usize> = (0..n).collect();
    assert_eq!(
        refused(&springs(n, &[], &all[..n - 1]), None),
        Err(AmgError::NotPositiveDefinite {
            node: n / 2 - 1,
            block: 2
        })
    );
    assert_eq!(
        refused(
            &BlockCsr::from_triplets(2, 2, [(0, 0, -1.0), (1, 1, -1.0)]),
            None
        ),
        Err(AmgError::NotPositiveDefinite { node: 0, block: 2 })
    );
    assert_eq!(
        refused(&springs(4, &[], &all[..4]), Some(&[[0.0; 2]])),
        Err(AmgError::Coordinates {
            found: 1,
            expected: 2
        })
    );
    assert_eq!(
        refused(&BlockCsr::from_triplets(0, 0, []), None),
        Err(AmgError::Shape)
    );
    assert_eq!(
        refused(&BlockCsr::from_triplets(4, 2, []), None),
        Err(AmgError::Shape)
    );
}

#[test]
fn the_table_lists_the_levels() {
    let problem = reference_problem(Geometry::OneBody, 3);
    let m = hierarchy::<f32>(
        problem.stiffness(),
        problem.coordinates().expect("made from a mesh"),
    );
    let table = m.to_string();
    assert_eq!(table.lines().count(), m.levels.len() + 3, "{table}");
    let sizes = m.sizes();
    assert_eq!(sizes[0].unknowns, problem.stiffness().n_rows());
    assert_eq!(sizes[0].entries, 4 * problem.stiffness().n_blocks());
    assert!(table.contains(&sizes[1].unknowns.to_string()), "{table}");
}

/// Seconds of the fastest of some runs.
fn fastest(runs: usize, mut work: impl FnMut()) -> f64 {
    (0..runs).fold(f64::INFINITY, |best: f64, _| {
        let start = Instant::now();
        work();
        best.min(start.elapsed().as_secs_f64())
    })
}

#[test]
#[ignore = "measures times; run it alone in the release profile"]
fn times() {
    println!(" k         n  set-up iteration product ms");
    for k in [3, 7, 13, 26, 40] {
        let problem = reference_problem(Geometry::OneBody, k);
        let (k_matrix, f) = (problem.stiffness(), problem.load());
        let points = problem.coordinates().expect("made from a mesh");
        let mut m = hierarchy::<f32>(k_matrix, points);
        let setup = fastest(7, || m = hierarchy::<f32>(k_matrix, points));
        let mut z = vec![0.0; f.len()];
        let product = fastest(30, || k_matrix.mul(f, &mut z));
        let solve = pcg(k_matrix, f, &m);
        println!(
            "{k:2} {:9} {:7.1} {:9.2} {:7.2}   set-up/iteration {:.1}, iteration/product {:.1}",
            problem.n_free(),
            1e3 * setup,
            1e3 * solve.seconds,
            1e3 * product,
            setup / solve.seconds,
            solve.seconds / product,
        );
    }
}

/// With the values of its own K a hierarchy is the same to the last bit. With those of another one, on the aggregates
/// of the first, it takes as many iterations as one made for it, up to one, or four where the ties of nodes have
/// changed completely.
#[test]
fn a_rebuilt_hierarchy_is_as_good() {
    fn check<const D: usize>(
        problems: &[(BlockCsr<D>, &str, usize)],
        f: &[f64],
        points: &[[f64; D]],
    ) {
        let made = |k: &BlockCsr<D>| {
            Hierarchy::<f32>::new(k, Some(points), &AmgSettings::of_dimension(D))
                .unwrap_or_else(|error| panic!("{error}"))
        };
        let rebuilt = |m: &Hierarchy<f32>, k: &BlockCsr<D>| {
            (m.rebuild(k, Some(points), None)).unwrap_or_else(|error| panic!("{error}"))
        };
        let first = made(&problems[0].0);
        assert!(!first.levels.is_empty());
        let own = rebuilt(&first, &problems[0].0);
        for (a, b) in first.levels.iter().zip(&own.levels) {
            assert!(a.prolongation == b.prolongation && a.restriction == b.restriction);
            assert!(a.smoother.matrix == b.smoother.matrix && a.smoother.steps == b.smoother.steps);
        }
        for (k, what, limit) in problems {
            let (here, mine) = (pcg(k, f, &rebuilt(&first, k)), pcg(k, f, &made(k)));
            println!(
                "{what}: {} iterations, {} afresh",
                here.iterations, mine.iterations
            );
            assert!(here.residual < 2e-8, "{what}: {here:?}");
            assert!(
                here.iterations.abs_diff(mine.iterations) <= *limit,
                "{what}: {here:?}, {mine:?}"
            );
        }
        // Back to the first, by way of the last.
        let last = rebuilt(&first, &problems[problems.len() - 1].0);
        let back = rebuilt(&last, &problems[0].0);
        assert!(
            first
                .levels
                .iter()
                .zip(&back.levels)
                .all(|(a, b)| a.prolongation == b.prolongation)
        );
    }
    let mesh = second_region(shaken([2.0, 1.0], [96, 48]), |x| x[0] > 1.0);
    let of = |young: [f64; 2]| clamped(&mesh, &young.map(|young| Material { young, ..MATERIAL }));
    let (_, f, points) = of([1.0; 2]);
    let plane = [
        ([1.0, 1.0], "one material", 0),
        ([7.3, 7.3], "stiffer", 1),
        ([1.0, 20.0], "stiffer on one side", 1),
        ([1e3, 1.0], "much softer on one side", 4),
    ];
    let plane = plane.map(|(young, what, limit)| (of(young.map(|e| e * 1e9)).0, what, limit));
    check(&plane, &f, &points);
    let problem =
        (CASE_C.problem(16, SolidShape::Hexahedron)).unwrap_or_else(|error| panic!("{error}"));
    let k = problem.stiffness().as_ref().clone();
    let triplets = k.triplets().map(|(i, j, v)| (i, j, 7.3 * v));
    let scaled = BlockCsr::from_triplets(k.n_rows(), k.n_rows(), triplets);
    let points = problem.coordinates().expect("made from a mesh");
    let space = [(k, "in space", 0), (scaled, "stiffer", 1)];
    check(&space, problem.load(), points);
    // Another size is refused.
    let m = hierarchy::<f32>(&plane[0].0, &clamped(&mesh, &[MATERIAL; 2]).2);
    let (other, _, points) = clamped(&quads([1.0, 1.0], [8, 8]), &[MATERIAL]);
    let refused = m.rebuild(&other, Some(&points), None).map(|_| ());
    assert!(
        matches!(refused, Err(AmgError::OtherPattern { found: [72, _], .. })),
        "{refused:?}"
    );
    // Nor does a hierarchy that begins with the corners of elements of second order serve without them.
    let mesh = mesh.raised().unwrap_or_else(|error| panic!("{error}"));
    let (k, _, points) = clamped(&mesh, &[MATERIAL; 2]);
    let body = Body {
        mesh: &mesh,
        materials: &[MATERIAL; 2],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let vertices = vertices(&body, &held_left(&mesh));
    let (points, vertices) = (Some(&points[..]), vertices.as_ref());
    let settings = AmgSettings::of_dimension(2);
    let m = Hierarchy::<f32>::of_second_order(&k, points, vertices, &settings)
        .unwrap_or_else(|error| panic!("{error}"));
    assert!(m.rebuild(&k, points, vertices).is_ok());
    let refused = m.rebuild(&k, points, None).map(|_| ());
    assert_eq!(refused, Err(AmgError::OtherCorners));
}

/// Seconds of a set-up and of a rebuild.
#[test]
#[ignore = "a measurement"]
fn times_of_a_rebuild() {
    let problem =
        (CASE_C.problem(40, SolidShape::Hexahedron)).unwrap_or_else(|error| panic!("{error}"));
    let (k, points) = (problem.stiffness(), problem.coordinates());
    let settings = AmgSettings::of_dimension(3);
    let mut m = None;
    let set_up = fastest(2, || m = Hierarchy::<f32>::new(k, points, &settings).ok());
    let m = m.expect("K is positive definite");
    let rebuild = fastest(2, || drop(m.rebuild(k, points, None)));
    println!(
        "in space, n = {}: {set_up:.3} s, {rebuild:.3} s",
        k.n_rows()
    );
    let problem = reference_problem(Geometry::OneBody, 13);
    let (k, points) = (problem.stiffness(), problem.coordinates());
    let m = hierarchy::<f32>(k, points.expect("made from a mesh"));
    let set_up = fastest(3, || {
        drop(Hierarchy::<f32>::new(k, points, &AmgSettings::default()))
    });
    let rebuild = fastest(3, || drop(m.rebuild(k, points, None)));
    println!(
        "in the plane, n = {}: {set_up:.3} s, {rebuild:.3} s",
        k.n_rows()
    );
}
