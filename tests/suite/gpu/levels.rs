//! Kernels of the levels of multigrid, and systems solved with it.

use super::kernels::{RUN, assert_close, number, numbers};
use super::{INVOCATIONS, PRECISIONS, context, device, each, one_body};
use crate::common::Random;
use crate::common::or_panic::OrPanic as _;
use signorini::backend::cpu::Cpu;
use signorini::backend::gpu::{Context, Gpu};
use signorini::backend::{Backend, BackendError, GpuOptions, Precision, Product};
use signorini::control::Stop;
use signorini::elasticity::{Body, Material, Plane, Unknowns, assemble, vertices};
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::problem::{FloatingBodies, Vertices};
use signorini::reference;
use signorini::sparse::stored::{BlockMatrix, Dense};
use signorini::sparse::{BlockCsr, dot, norm};
use signorini::stiffness::pcg::{Pcg, Preconditioner};
use std::sync::Arc;

/// Two bodies without supports, one of them 1e7 times as stiff: K is singular.
#[test]
fn free_bodies_are_solved() {
    let (mut triplets, mut points, mut kernel) = (Vec::new(), Vec::new(), Vec::new());
    let parts = [([120, 40], 2e11), ([9, 7], 2e4)];
    for (i, &(cells, young)) in parts.iter().enumerate() {
        let origin = [4.0 * i as f64, 0.0];
        let mesh = rectangle(origin, [3.0, 1.0], cells, CellShape::Quad, "body", "");
        let body = Body {
            mesh: &mesh,
            materials: &[Material::new(young, 0.3)],
            plane: Plane::PlaneStrain,
            thickness: 1.0,
        };
        let unknowns = Unknowns::new(vec![[None; 2]; mesh.nodes.len()]);
        let (k, _) = assemble(&body, &unknowns, &vec![[0.0; 2]; mesh.nodes.len()]);
        let first = 2 * points.len();
        triplets.extend(k.triplets().map(|(i, j, v)| (first + i, first + j, v)));
        // About the centre, so that the three are orthogonal.
        let centre = [origin[0] + 1.5, 0.5];
        let motions: [fn([f64; 2]) -> [f64; 2]; 3] =
            [|_| [1.0, 0.0], |_| [0.0, 1.0], |x| [-x[1], x[0]]];
        for motion in motions {
            let mut mode = vec![0.0; first];
            mode.extend(
                (mesh.nodes.iter()).flat_map(|x| motion([x[0] - centre[0], x[1] - centre[1]])),
            );
            kernel.push(mode);
        }
        points.extend(mesh.nodes);
    }
    let n = 2 * points.len();
    let k = Arc::new(BlockCsr::from_triplets(n, n, triplets));
    let mut random = Random(3);
    let mut b = numbers(&mut random, n);
    for mode in &kernel {
        let part = dot(mode, &b[..mode.len()]) / dot(mode, mode);
        b.iter_mut().zip(mode).for_each(|(b, m)| *b -= part * m);
    }
    let free = FloatingBodies::find(&k, &points);
    assert_eq!(free.n_modes(), 6);
    fn solved<B: Backend>(
        backend: B,
        k: &Arc<BlockCsr<2>>,
        points: &[[f64; 2]],
        b: &[f64],
    ) -> usize {
        let (grounded, _) = FloatingBodies::find(k, points).grounded(k, |_| false);
        let mut pcg =
            Pcg::new(backend, &grounded, Some(points), Preconditioner::Multigrid).or_panic();
        let mut x = vec![0.0; b.len()];
        pcg.solve(b, &mut x, 1e-8, &Stop::default()).or_panic();
        let mut r = vec![0.0; b.len()];
        k.mul(&x, &mut r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r -= b);
        assert!(norm(&r) < 2e-8 * norm(b), "{:e}", norm(&r) / norm(b));
        pcg.counts.iterations
    }
    let on_cpu = solved(Cpu::<f32>::default(), &k, &points, &b);
    for precision in PRECISIONS {
        let gpu = Gpu::new(&context(precision, None)).or_panic();
        let found = solved(gpu, &k, &points, &b);
        println!("{found} iterations in {precision}, {on_cpu} on the CPU");
        // Corrections in f32 restart.
        let limit = match precision {
            Precision::F64 => on_cpu + 1,
            Precision::F32 => 2 * on_cpu,
        };
        assert!(
            found <= limit,
            "{found} iterations in {precision}, {on_cpu} on the CPU"
        );
    }
}

/// A random matrix of a multigrid level: some empty rows, a long row now and then.
pub fn level_matrix<const R: usize, const C: usize>(
    rows: usize,
    columns: usize,
    longest: usize,
    random: &mut Random,
) -> BlockMatrix<f32> {
    let (mut row_ptr, mut col_idx) = (vec![0], Vec::new());
    for i in 0..rows {
        let mut own: Vec<u32> = match i % 11 {
            4 => Vec::new(),
            7 => (0..columns as u32).step_by(2).take(longest).collect(),
            _ => (0..1 + random.below(6))
                .map(|_| random.below(columns) as u32)
                .collect(),
        };
        own.sort_unstable();
        own.dedup();
        col_idx.extend(own);
        row_ptr.push(col_idx.len());
    }
    let values = (0..col_idx.len())
        .map(|_| std::array::from_fn(|_| std::array::from_fn(|_| number(random))))
        .collect();
    let matrix = BlockCsr::<R, C>::from_parts(rows, columns, row_ptr, col_idx, values);
    BlockMatrix::new(&matrix, 1.0)
}

/// All parts of a V-cycle, on random data in blocks of D, coarser ones of M.
pub fn level_results<B: Backend<Stored = f32>, const D: usize, const M: usize>(
    b: &mut B,
    rows: usize,
    longest: usize,
) -> Result<Vec<Vec<f64>>, BackendError> {
    let mut random = Random((17 * rows + D) as u64);
    // An unfinished state, of a run on vectors of the same length.
    let n = rows * D;
    let k = BlockCsr::<D>::from_triplets(n, n, (0..n).map(|i| (i, i, 1.0)));
    let (k, _) = b.matrix(Arc::new(k))?;
    let r = numbers(&mut random, n);
    let mut r_there = b.vector(n)?;
    b.upload(&r, &mut r_there);
    let mut x = b.vector(n)?;
    let mut state = b.state(&k, &r_there)?;
    let mut right = b.level_vector(n)?;
    let mut results = Vec::new();

    let a = level_matrix::<D, D>(rows, rows, longest, &mut random);
    let coarse_rows = 1 + rows / 3;
    let restriction = level_matrix::<M, D>(coarse_rows, rows, longest, &mut random);
    let prolongation = level_matrix::<D, M>(rows, coarse_rows, longest, &mut random);
    let diagonal = numbers(&mut random, rows * D * D);
    let a = b.level_matrix(a)?;
    let restriction = b.level_matrix(restriction)?;
    let prolongation = b.level_matrix(prolongation)?;
    let diagonal = b.level_diagonal(diagonal.iter().map(|&v| v as f32).collect(), D)?;
    let (mut d, mut y, mut z) = (b.level_vector(n)?, b.level_vector(n)?, b.level_vector(n)?);
    let mut coarse = b.level_vector(M * coarse_rows)?;

    macro_rules! keep {
        ($z:expr) => {{
            let mut out = vec![f32::NAN; n];
            b.read_level($z, &mut out)?;
            results.push(out.into_iter().map(f64::from).collect());
        }};
    }
    b.start(&r_there, &mut x, &mut right, &mut state, RUN);
    keep!(&right);
    let written: Vec<f32> = r.iter().rev().map(|&v| v as f32).collect();
    b.write_level(&written, &mut right);
    b.smooth_first(&state, &diagonal, 0.75, &right, &mut d, &mut y);
    keep!(&y);
    keep!(&d);
    let steps = [0.25, 0.5];
    b.smooth(&state, &a, &diagonal, steps, &right, &y, &mut d, &mut z);
    keep!(&z);
    keep!(&d);
    // Patches are any matrix to the kernel.
    for c1 in [None, Some(0.25)] {
        b.smooth_patches(&state, &a, c1, 0.5, &right, &mut d, &mut y);
        keep!(&y);
        keep!(&d);
    }
    b.level_multiply(&state, &a, Product::Residual, &right, &y, &mut z);
    keep!(&z);
    b.level_multiply(
        &state,
        &restriction,
        Product::Plain,
        &right,
        &right,
        &mut coarse,
    );
    b.level_multiply(
        &state,
        &prolongation,
        Product::Added,
        &right,
        &coarse,
        &mut z,
    );
    keep!(&z);
    // The coarsest level is small.
    if n <= 500 {
        let values = numbers(&mut random, n * n);
        let dense = Dense::new(n, values.iter().map(|&v| v as f32).collect());
        let dense = b.dense_matrix(dense)?;
        b.dense_product(&state, &dense, &right, &mut z);
        keep!(&z);
    }
    Ok(results)
}

pub fn compare_levels<const D: usize, const M: usize>(
    context: &Arc<Context>,
    rows: usize,
    longest: usize,
) {
    let what = format!(
        "{rows} blocks of {D}, coarser ones of {M}, in {}, at most {longest} a row",
        context.precision
    );
    let mut gpu = Gpu::new(context).or_panic();
    let found = level_results::<_, D, M>(&mut gpu, rows, longest)
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    let expected = level_results::<_, D, M>(&mut Cpu::<f32>::default(), rows, longest).or_panic();
    assert_eq!(found.len(), expected.len());
    for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
        // Sums of up to 3000 numbers of size one in f32, three in a row.
        assert_close(f, e, 3e-5, &format!("result {i}, {what}"));
    }
}

#[test]
fn kernels_of_the_levels_at_awkward_sizes() {
    for (precision, invocations) in each(PRECISIONS, INVOCATIONS) {
        // 1344 unknowns a segment, and slices of this many columns, in the small one.
        for (max_binding, longest) in [(None, usize::MAX), (Some(32 << 10), 6)] {
            let context = device(precision, max_binding, invocations);
            for rows in [1, 2, 31, 32, 33, 64, 127, 128, 129, 257, 1001] {
                compare_levels::<2, 2>(&context, rows, longest);
                compare_levels::<2, 3>(&context, rows, longest);
                compare_levels::<3, 3>(&context, rows, longest);
                compare_levels::<3, 6>(&context, rows, longest);
                compare_levels::<6, 6>(&context, rows, longest);
            }
        }
    }
}

/// K, its load and the points of the nodes of a body that is clamped on its left side and loaded on its top.
pub type System<const D: usize> = (Arc<BlockCsr<D>>, Vec<f64>, Vec<[f64; D]>);

pub fn clamped<const D: usize>(mesh: &Mesh<D>) -> System<D>
where
    ElementKind: Topology<D>,
{
    let body = Body {
        mesh,
        materials: &[reference::MATERIAL],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let held = |x: &[f64; D]| [(x[0] == 0.0).then_some(0.0); D];
    let unknowns = Unknowns::new(mesh.nodes.iter().map(held).collect());
    let mut forces = vec![[0.0; D]; mesh.nodes.len()];
    body.add_traction(&mesh.boundaries["top"], |_, _| [1e6; D], &mut forces);
    let (k, f) = assemble(&body, &unknowns, &forces);
    (Arc::new(k), f, unknowns.coordinates(mesh))
}

/// The corners of the elements of second order of [`clamped`].
fn corners(mesh: &Mesh<3>) -> Option<Vertices<3>> {
    let body = Body {
        mesh,
        materials: &[reference::MATERIAL],
        plane: Plane::PlaneStrain,
        thickness: 1.0,
    };
    let held = |x: &[f64; 3]| [(x[0] == 0.0).then_some(0.0); 3];
    vertices(&body, &Unknowns::new(mesh.nodes.iter().map(held).collect()))
}

/// Multigrid whose vectors exceed a binding gives the same result as in one piece, with patches as well.
#[test]
fn multigrid_on_vectors_in_pieces() {
    let even = rectangle([0.0; 2], [3.0, 1.0], [45, 15], CellShape::Quad, "body", "");
    let flat = rectangle([0.0; 2], [3.0, 0.2], [20, 40], CellShape::Quad, "body", "");
    for (k, f, points) in [clamped(&even), clamped(&flat)] {
        let product = |max_binding| -> (Vec<f64>, usize) {
            let gpu = Gpu::new(&context(Precision::F64, max_binding)).or_panic();
            let mut pcg = Pcg::new(gpu, &k, Some(&points), Preconditioner::Multigrid).or_panic();
            assert!(pcg.hierarchy.is_some() && pcg.fallback.is_none());
            let mut x = vec![0.0; f.len()];
            pcg.solve(&f, &mut x, 1e-10, &Stop::default()).or_panic();
            (x, pcg.counts.iterations)
        };
        let (whole, iterations) = product(None);
        // Some 600 unknowns a segment, which the coarsest level fits into.
        let (pieces, iterations_there) = product(Some(24 << 10));
        println!("{iterations} iterations, {iterations_there} in pieces");
        assert!(iterations.abs_diff(iterations_there) <= 1);
        assert!(crate::common::distance(&pieces, &whole) < 1e-9);
    }
}

/// A cube of springs to the 26 neighbours of each node, held by springs at x = 0.
pub fn cube(n: usize) -> (BlockCsr<3>, Vec<[f64; 3]>) {
    let count = n * n * n;
    let place = |i: usize| [i % n, i / n % n, i / n / n].map(|c| c as f64);
    let mut triplets = Vec::new();
    for i in 0..count {
        if i % n == 0 {
            triplets.extend((0..3).map(|c| (3 * i + c, 3 * i + c, 1.0)));
        }
        for j in 0..count {
            let way: Vec<f64> = (0..3).map(|c| place(j)[c] - place(i)[c]).collect();
            if i == j || way.iter().any(|d| d.abs() > 1.0) {
                continue;
            }
            let square = dot(&way, &way);
            for (a, b) in (0..9).map(|e| (e / 3, e % 3)) {
                let value = way[a] * way[b] / square;
                triplets.push((3 * i + a, 3 * i + b, value));
                triplets.push((3 * i + a, 3 * j + b, -value));
            }
        }
    }
    let k = BlockCsr::from_triplets(3 * count, 3 * count, triplets);
    (k, (0..count).map(place).collect())
}

/// In space: K in blocks of 3, coarser levels in blocks of 6, on every device as on the CPU.
#[test]
fn a_body_in_space_is_solved() {
    let (k, points) = cube(11);
    let b = numbers(&mut Random(23), k.n_rows());
    // Flat elements make patches.
    let flat = block(
        [0.0; 3],
        [1.0, 1.0, 1.0],
        [7, 7, 56],
        SolidShape::Hexahedron,
        "body",
        "",
    );
    // Elements of second order, whose corners are the second level: blocks of 3 between both.
    let cells = [9, 3, 3];
    let long = block(
        [0.0; 3],
        [3.0, 1.0, 1.0],
        cells,
        SolidShape::Tetrahedron,
        "body",
        "",
    );
    let second = long.raised().or_panic();
    let of_second = corners(&second);
    assert!(of_second.is_some());
    let systems = [(Arc::new(k), b, points), clamped(&flat), clamped(&second)];
    let vertices = [None, None, of_second.as_ref()];
    type InSpace<'a> = (
        &'a Arc<BlockCsr<3>>,
        &'a [[f64; 3]],
        &'a [f64],
        Option<&'a Vertices<3>>,
    );
    fn solved<B: Backend>(
        backend: B,
        (k, points, b, vertices): InSpace,
        preconditioner: Preconditioner,
    ) -> usize {
        let mut pcg =
            Pcg::of_second_order(backend, k, Some(points), vertices, preconditioner).or_panic();
        let mut x = vec![0.0; b.len()];
        pcg.solve(b, &mut x, 1e-9, &Stop::default()).or_panic();
        let mut r = vec![0.0; b.len()];
        k.mul(&x, &mut r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r -= b);
        assert!(norm(&r) < 2e-9 * norm(b), "{:e}", norm(&r) / norm(b));
        pcg.counts.iterations
    }
    let all = [Preconditioner::Multigrid, Preconditioner::BlockJacobi];
    for (((k, b, points), vertices), preconditioner) in (systems.iter().zip(vertices))
        .flat_map(|system| all.map(|preconditioner| (system, preconditioner)))
    {
        let system = (k, &points[..], &b[..], vertices);
        let on_cpu = solved(Cpu::<f32>::default(), system, preconditioner);
        for precision in PRECISIONS {
            let gpu = Gpu::new(&context(precision, None)).or_panic();
            let found = solved(gpu, system, preconditioner);
            println!("{preconditioner:?}: {found} iterations in {precision}, {on_cpu} on the CPU");
            let limit = match precision {
                Precision::F64 => on_cpu + 2,
                Precision::F32 => 2 * on_cpu + 8,
            };
            assert!(
                found <= limit,
                "{found} in {precision}, {on_cpu} on the CPU"
            );
        }
    }
}

/// If there is memory for K but not for its hierarchy, PCG continues with block-Jacobi and reports it.
#[test]
fn without_room_for_multigrid_there_is_block_jacobi() {
    let problem = one_body(1);
    let with = |max_memory| {
        let options = GpuOptions {
            precision: Some(Precision::F64),
            max_memory: Some(max_memory),
            checked: true,
            ..Default::default()
        };
        let context = Context::new(&options).or_panic();
        let gpu = Gpu::new(&context).or_panic();
        Pcg::new(
            gpu,
            problem.stiffness(),
            problem.coordinates(),
            Preconditioner::Multigrid,
        )
    };
    let mut seen = [false; 3];
    for kib in (100..3000).step_by(100) {
        match with(kib << 10) {
            Err(error) => {
                assert!(error.to_string().contains("MiB"), "{error}");
                assert_eq!(seen, [seen[0], false, false], "{kib} KiB");
                seen[0] = true;
            }
            Ok(mut pcg) => {
                let fallback = pcg.fallback.clone();
                assert_eq!(fallback.is_some(), pcg.hierarchy.is_none());
                seen[if fallback.is_some() { 1 } else { 2 }] = true;
                assert!(fallback.is_none() || !seen[2], "{kib} KiB");
                assert!(fallback.is_none_or(|why| why.contains("MiB")));
                let mut x = vec![0.0; problem.load().len()];
                pcg.solve(problem.load(), &mut x, 1e-8, &Stop::default())
                    .unwrap_or_else(|error| panic!("{kib} KiB: {error}"));
            }
        }
    }
    assert_eq!(seen, [true; 3]);
}
