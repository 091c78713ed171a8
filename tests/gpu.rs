//! The kernels against the CPU backend, whole solves on every path, and what happens when a GPU fails.
//!
//! Every test here needs an adapter; a software one will do (`sh tests/run.sh` installs it).

mod common;

use common::Random;
use signorini::backend::cpu::Cpu;
use signorini::backend::gpu::{self, Context, Gpu};
use signorini::backend::{Backend, BackendError, GpuOptions, Precision, Product, Progress, Run};
use signorini::control::{Accuracy, Costs, Stop};
use signorini::dual::DirectDual;
use signorini::dual::{DualOperator as _, NestedDual};
use signorini::elasticity::{Body, Elements, Material, Plane, Unknowns, assemble};
use signorini::engine::{Engine, Options as EngineOptions, Place, Stiffness};
use signorini::mesh::structured::{CellShape, SolidShape, block, rectangle};
use signorini::mesh::{Kind, Mesh};
use signorini::problem::{ContactProblem, FreeBodies};
use signorini::reference::{self, Geometry, TABLE1};
use signorini::sparse::stored::{BlockMatrix, Dense};
use signorini::sparse::{BlockCsr, Csr, dot, norm};
use signorini::ssnm::{self, Info, Settings, Solution, Status};
use signorini::ssnm::{Step, WarmStart};
use signorini::stiffness::amg::{Hierarchy, Multigrid};
use signorini::stiffness::pcg::{Pcg, Preconditioner};
use signorini::table1::BETAS;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// A CG run that is not over after an iteration.
const RUN: Run = Run {
    continues: false,
    residual: 0.0,
    residual_part: 1e-3,
    remaining: 0.0,
    remaining_part: 0.0,
    to_come: 1.0,
};

const PRECISIONS: [Precision; 2] = [Precision::F64, Precision::F32];

/// A device with all checks of the kernels on.
fn context(precision: Precision, max_binding: Option<u64>) -> Arc<Context> {
    let options = GpuOptions {
        precision: Some(precision),
        max_binding,
        checked: true,
        ..Default::default()
    };
    Context::new(&options).unwrap_or_else(|error| {
        panic!(
            "{error}\nthese tests need an adapter with f64: `sh tests/run.sh` installs a software one \
             (Debian: apt-get install mesa-vulkan-drivers libvulkan1)"
        )
    })
}

/// A random number that f32 represents.
fn number(random: &mut Random) -> f64 {
    f64::from(random.between(-1.0, 1.0) as f32)
}

fn numbers(random: &mut Random, len: usize) -> Vec<f64> {
    (0..len).map(|_| number(random)).collect()
}

/// What the kernels work on, in blocks of D.
struct Data<const D: usize> {
    k: Arc<BlockCsr<D>>,
    /// Blocks of D⁻¹.
    inverse: Vec<f32>,
    rows: Csr,
    x: Vec<f64>,
    y: Vec<f64>,
    short: Vec<f64>,
}

/// Random data with `n` block rows: some empty ones, one with entries in every column if `dense`.
fn data<const D: usize>(n: usize, dense: bool, random: &mut Random) -> Data<D> {
    let mut triplets = Vec::new();
    for i in 0..n {
        let count = match i % 7 {
            3 => 0,
            _ => 1 + random.below(9.min(n)),
        };
        let mut columns: Vec<usize> = if dense && i == n / 2 {
            (0..n).collect()
        } else {
            (0..count).map(|_| random.below(n)).collect()
        };
        columns.sort_unstable();
        columns.dedup();
        // Enough on the diagonal for a positive curvature in every direction that CG may try.
        let weight = (D * columns.len()) as f64;
        if count > 0 {
            triplets.extend((0..D).map(|a| (D * i + a, D * i + a, 2.0)));
        }
        for j in columns {
            for a in 0..D {
                for b in 0..D {
                    let value = number(random) / weight;
                    triplets.push((D * i + a, D * j + b, f64::from(value as f32)));
                }
            }
        }
    }
    let n_short = 1 + random.below(n.min(50));
    let rows = (0..n_short)
        .filter(|i| i % 5 != 4)
        .flat_map(|i| (0..1 + i % 4).map(move |_| i))
        .map(|i| (i, random.below(D * n), number(random)))
        .collect::<Vec<_>>();
    Data {
        k: Arc::new(BlockCsr::from_triplets(D * n, D * n, triplets)),
        inverse: (0..n)
            .flat_map(|_| {
                let c = (number(random) * 0.25) as f32;
                (0..D * D).map(move |e| if e % (D + 1) == 0 { 0.75 } else { c })
            })
            .collect(),
        rows: Csr::from_triplets(n_short, D * n, rows),
        x: numbers(random, D * n),
        y: numbers(random, D * n),
        short: numbers(random, n_short),
    }
}

/// Results of all kernels on one set of data.
#[derive(Debug)]
struct Results {
    /// y − K x.
    subtracted: Vec<f64>,
    /// K p after the start of CG with r = x.
    product: Vec<f64>,
    /// x, r, p after one iteration.
    step: [Vec<f64>; 3],
    progress: [Progress; 2],
    gathered: Vec<f64>,
    scattered: Vec<f64>,
    /// x, copied and handed to a run that continues.
    kept: Vec<f64>,
    /// y − 0.3 x.
    added: Vec<f64>,
}

fn results<B: Backend<Stored = f32>, const D: usize>(mut b: B, data: &Data<D>) -> Results {
    let n = data.x.len();
    let run = |b: &mut B| -> Result<Results, BackendError> {
        let (k, scale) = b.matrix(Arc::clone(&data.k) as _)?;
        let inverse = b.level_diagonal(data.inverse.clone(), D)?;
        let poison = vec![f64::NAN; n];
        let vector = |b: &mut B, values: &[f64]| -> Result<B::Vector, BackendError> {
            let mut v = b.vector(n)?;
            b.upload(values, &mut v);
            Ok(v)
        };
        let get = |b: &mut B, v: &B::Vector| -> Result<Vec<f64>, BackendError> {
            let mut out = vec![f64::INFINITY; n];
            b.download(v, &mut out)?;
            Ok(out)
        };
        let x = vector(b, &data.x)?;
        let scaled: Vec<f64> = data.y.iter().map(|v| v * scale).collect();
        let mut y = vector(b, &scaled)?;
        b.subtract_product(&k, &x, &mut y);
        let subtracted = get(b, &y)?.iter().map(|v| v / scale).collect();

        let mut added = vector(b, &data.y)?;
        b.add(-0.3, &x, &mut added);
        let added = get(b, &added)?;

        let mut short = b.vector(data.short.len())?;
        b.upload(&data.short, &mut short);
        let scatter = b.rows(&data.rows.transposed(), &short, &x)?;
        let mut scattered = vector(b, &data.y)?;
        b.multiply_rows(&scatter, &short, &mut scattered);
        let scattered = get(b, &scattered)?;
        let gather = b.rows(&data.rows, &x, &short)?;
        b.multiply_rows(&gather, &x, &mut short);

        let mut r = vector(b, &data.x)?;
        let (mut x_cg, mut p, mut q) = (
            vector(b, &poison)?,
            vector(b, &poison)?,
            vector(b, &poison)?,
        );
        let (mut rounded, mut d, mut z) =
            (b.level_vector(n)?, b.level_vector(n)?, b.level_vector(n)?);
        let mut state = b.state(&k, &x)?;
        // A run that continues leaves x as it is.
        let mut kept = vector(b, &poison)?;
        b.copy(&x, &mut kept);
        let continues = Run {
            continues: true,
            ..RUN
        };
        b.start(&r, &mut kept, &mut rounded, &mut state, continues);
        let kept = get(b, &kept)?;
        b.start(&r, &mut x_cg, &mut rounded, &mut state, RUN);
        b.smooth_first(&state, &inverse, 1.0, &rounded, &mut d, &mut z);
        b.direction(&r, &z, &mut p, &mut state);
        let start = b.progress(&state, None)?;
        b.multiply(&k, &p, &mut q, &mut state);
        let product = get(b, &q)?.iter().map(|v| v / scale).collect();
        b.step(&p, &q, &mut x_cg, &mut r, &mut rounded, &mut state);
        b.smooth_first(&state, &inverse, 1.0, &rounded, &mut d, &mut z);
        b.direction(&r, &z, &mut p, &mut state);
        let mut gathered = vec![f64::INFINITY; data.short.len()];
        let end = b.progress(&state, Some((&short, &mut gathered)))?;
        // The matrix in f32 is scaled, and the step with it.
        let step = [
            get(b, &x_cg)?.iter().map(|v| v * scale).collect(),
            get(b, &r)?,
            get(b, &p)?,
        ];
        let progress = [start, end].map(|p| Progress {
            energy: p.energy * scale,
            recent: p.recent * scale,
            ..p
        });
        Ok(Results {
            subtracted,
            product,
            step,
            progress,
            gathered,
            scattered,
            kept,
            added,
        })
    };
    run(&mut b).unwrap_or_else(|error| panic!("{error}"))
}

fn assert_close(found: &[f64], expected: &[f64], bound: f64, what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    let scale = expected.iter().fold(1.0, |acc: f64, v| acc.max(v.abs()));
    for (i, (f, e)) in found.iter().zip(expected).enumerate() {
        // Written so that NaN fails.
        assert!(
            (f - e).abs() <= bound * scale,
            "{what}, entry {i} of {}: {f:e} instead of {e:e}",
            found.len()
        );
    }
}

fn compare<const D: usize>(data: &Data<D>, gpu: Gpu, what: &str) {
    let precision = gpu.context().precision;
    let expected = results(Cpu::<f32>::default(), data);
    let found = results(gpu, data);
    // Sums of a few to a few thousand numbers of size one.
    let widest = (0..data.k.n_block_rows())
        .map(|i| D * data.k.row(i).0.len())
        .max()
        .unwrap_or(1) as f64;
    let unit = match precision {
        Precision::F64 => f64::EPSILON,
        Precision::F32 => f64::from(f32::EPSILON),
    };
    let bound = unit * (4.0 + widest);
    let what = &format!("{what} of {D} in {precision}");
    assert_close(
        &found.subtracted,
        &expected.subtracted,
        bound,
        &format!("y − Kx, {what}"),
    );
    assert_close(
        &found.gathered,
        &expected.gathered,
        bound,
        &format!("gather, {what}"),
    );
    assert_close(
        &found.scattered,
        &expected.scattered,
        bound,
        &format!("scatter, {what}"),
    );
    assert_close(&found.kept, &data.x, unit, &format!("copy, {what}"));
    let added: Vec<f64> = (data.y.iter().zip(&data.x))
        .map(|(y, x)| y - f64::from(0.3_f32) * x)
        .collect();
    for (sum, by) in [(&found.added, "GPU"), (&expected.added, "CPU")] {
        assert_close(sum, &added, 2.0 * unit, &format!("y − 0.3 x, {by}, {what}"));
    }
    assert_close(
        &found.product,
        &expected.product,
        bound,
        &format!("Kp, {what}"),
    );
    // The CPU adds up in another order.
    let of_sum = unit * (4.0 + (data.x.len() as f64).sqrt());
    let (s, e) = (found.progress[0], expected.progress[0]);
    assert!(
        (s.rr / e.rr - 1.0).abs() < of_sum && !s.done,
        "{what}: {s:?} {e:?}"
    );
    assert!(
        (s.goal / e.goal - 1.0).abs() < of_sum + 1e-6,
        "{what}: {s:?} {e:?}"
    );
    let (s, e) = (found.progress[1], expected.progress[1]);
    assert_eq!((s.done, s.broken), (e.done, e.broken), "{what}");
    for (found, expected) in [(s.energy, e.energy), (s.recent, e.recent)] {
        assert!(
            (found / expected - 1.0).abs() < 2.0 * of_sum,
            "{what}: {s:?} {e:?}"
        );
    }
    assert!(!s.broken, "the data give positive curvature, {what}");
    assert_eq!(s.iterations, 1, "{what}");
    for (i, name) in ["x", "r", "p"].iter().enumerate() {
        assert_close(
            &found.step[i],
            &expected.step[i],
            bound,
            &format!("{name}, {what}"),
        );
    }
}

/// The progress of a run after each of its first iterations.
fn followed<B: Backend<Stored = f32>>(
    mut b: B,
    problem: &ContactProblem,
    multigrid: bool,
) -> Vec<Progress> {
    let mut run = || -> Result<Vec<Progress>, BackendError> {
        let k = problem.stiffness();
        let n = k.n_rows();
        let (matrix, scale) = b.matrix(Arc::clone(k) as _)?;
        let length = norm(problem.load());
        let load: Vec<f64> = problem.load().iter().map(|f| f / length).collect();
        let (mut r, mut x) = (b.vector(n)?, b.vector(n)?);
        let (mut p, mut q) = (b.vector(n)?, b.vector(n)?);
        b.upload(&load, &mut r);
        let mut state = b.state(&matrix, &x)?;
        let goals = Run {
            remaining_part: 1e-9,
            to_come: 0.5,
            ..Run::default()
        };
        let hierarchy = match multigrid {
            true => Hierarchy::new(k, problem.coordinates(), &Default::default()),
            false => Hierarchy::block_jacobi(k),
        };
        let hierarchy = hierarchy.unwrap_or_else(|error| panic!("{error}"));
        let mut cycle = Multigrid::new(&mut b, hierarchy)?;
        b.start(&r, &mut x, cycle.r(), &mut state, goals);
        cycle.cycle(&mut b, &state);
        b.direction(&r, cycle.z(), &mut p, &mut state);
        let mut progress = Vec::new();
        for _ in 0..26 {
            b.multiply(&matrix, &p, &mut q, &mut state);
            b.step(&p, &q, &mut x, &mut r, cycle.r(), &mut state);
            cycle.cycle(&mut b, &state);
            b.direction(&r, cycle.z(), &mut p, &mut state);
            let made = b.progress(&state, None)?;
            progress.push(Progress {
                energy: made.energy * scale,
                recent: made.recent * scale,
                ..made
            });
        }
        Ok(progress)
    };
    run().unwrap_or_else(|error| panic!("{error}"))
}

/// The sums that the energy error is estimated from, over all lengths that their blocks take, and the end of
/// the run that they decide.
#[test]
fn runs_are_followed_as_on_the_cpu() {
    let problem = one_body(1);
    for multigrid in [false, true] {
        let expected = followed(Cpu::<f32>::default(), &problem, multigrid);
        let ended = expected[25];
        assert_eq!(ended.done, multigrid, "{ended:?}");
        for precision in PRECISIONS {
            let gpu = Gpu::new(&context(precision, None)).unwrap_or_else(|error| panic!("{error}"));
            let found = followed(gpu, &problem, multigrid);
            for (f, e) in found.iter().zip(&expected) {
                let what = format!("{precision}, multigrid {multigrid}: {f:?} {e:?}");
                assert_eq!(f.iterations, e.iterations, "{what}");
                assert_eq!(f.recent_terms, e.recent_terms, "{what}");
                assert_eq!((f.done, f.broken), (e.done, e.broken), "{what}");
                // Directions lose their independence by rounding, which is another one.
                let bound = match precision {
                    Precision::F64 => 1e-4,
                    Precision::F32 => 1e-2,
                };
                assert!((f.energy / e.energy - 1.0).abs() < bound, "{what}");
                assert!((f.recent / e.recent - 1.0).abs() < 10.0 * bound, "{what}");
            }
        }
    }
}

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
            materials: &[Material {
                young,
                poisson: 0.3,
                density: 0.0,
            }],
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
    let free = FreeBodies::find(&k, &points);
    assert_eq!(free.n_motions(), 6);
    fn solved<B: Backend>(
        backend: B,
        k: &Arc<BlockCsr<2>>,
        points: &[[f64; 2]],
        b: &[f64],
    ) -> usize {
        let (grounded, _) = FreeBodies::find(k, points).grounded(k, |_| false);
        let mut pcg = Pcg::new(backend, &grounded, Some(points), Preconditioner::Multigrid)
            .unwrap_or_else(|error| panic!("{error}"));
        let mut x = vec![0.0; b.len()];
        pcg.solve(b, &mut x, 1e-8, &Stop::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let mut r = vec![0.0; b.len()];
        k.mul(&x, &mut r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r -= b);
        assert!(norm(&r) < 2e-8 * norm(b), "{:e}", norm(&r) / norm(b));
        pcg.counts.iterations
    }
    let on_cpu = solved(Cpu::<f32>::default(), &k, &points, &b);
    for precision in PRECISIONS {
        let gpu = Gpu::new(&context(precision, None)).unwrap_or_else(|error| panic!("{error}"));
        let found = solved(gpu, &k, &points, &b);
        println!("{found} iterations in {precision}, {on_cpu} on the CPU");
        // Corrections in f32 start anew.
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

#[test]
fn kernels_at_awkward_sizes() {
    for precision in PRECISIONS {
        let context = context(precision, None);
        let mut random = Random(7);
        for n in [
            1, 2, 3, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 128, 129, 255, 256, 257, 1000, 4099,
        ] {
            let gpu = || Gpu::new(&context).unwrap_or_else(|error| panic!("{error}"));
            let what = format!("{n} block rows");
            compare(&data::<2>(n, n == 257, &mut random), gpu(), &what);
            compare(&data::<3>(n, n == 257, &mut random), gpu(), &what);
        }
    }
}

#[test]
fn kernels_on_vectors_and_matrices_in_pieces() {
    // 16 KiB a binding: 576 unknowns a segment, 8 blocks a row of a slice of K in blocks of 3 and f64.
    for precision in PRECISIONS {
        for (bytes, n) in [(16 << 10, 1500), (64 << 10, 4100), (48 << 10, 3072)] {
            let context = context(precision, Some(bytes));
            let mut random = Random(11);
            let gpu = || Gpu::new(&context).unwrap_or_else(|error| panic!("{error}"));
            let what = format!("{n} block rows in bindings of {bytes} bytes");
            compare(&data::<2>(n, false, &mut random), gpu(), &what);
            compare(&data::<3>(n, false, &mut random), gpu(), &what);
        }
    }
}

#[test]
fn a_matrix_beyond_one_binding_of_the_adapter() {
    // 9 blocks per row: 134 MiB of values in f64, where a software adapter binds 128 MiB.
    let n = 490_000;
    let width = 4;
    let mut random = Random(13);
    let mut columns = Vec::new();
    let mut starts = vec![0];
    for i in 0..n {
        columns.extend((i.max(width) - width..(i + width + 1).min(n)).map(|j| j as u32));
        starts.push(columns.len());
    }
    let values = (0..columns.len())
        .map(|_| {
            [
                [number(&mut random), number(&mut random)],
                [number(&mut random), number(&mut random)],
            ]
        })
        .collect();
    let k = Arc::new(BlockCsr::from_parts(n, n, starts, columns, values));
    let context = context(Precision::F64, None);
    assert!(
        context.adapter.max_binding > 128 << 20
            || k.n_blocks() as u64 * 32 > context.adapter.max_binding,
        "the matrix is meant to exceed one binding"
    );
    let x = numbers(&mut random, 2 * n);
    let mut gpu = Gpu::new(&context).unwrap_or_else(|error| panic!("{error}"));
    let mut product = || -> Result<Vec<f64>, BackendError> {
        let (matrix, _) = gpu.matrix(Arc::clone(&k) as _)?;
        let (mut x_there, mut y) = (gpu.vector(2 * n)?, gpu.vector(2 * n)?);
        gpu.upload(&x, &mut x_there);
        gpu.subtract_product(&matrix, &x_there, &mut y);
        let mut found = vec![f64::NAN; 2 * n];
        gpu.download(&y, &mut found)?;
        Ok(found)
    };
    let found = product().unwrap_or_else(|error| panic!("{error}"));
    let mut expected = vec![0.0; 2 * n];
    k.mul(&x, &mut expected);
    expected.iter_mut().for_each(|v| *v = -*v);
    assert_close(&found, &expected, 1e-14, "−Kx");
}

fn one_body(k: usize) -> ContactProblem {
    let mesh = reference::mesh(Geometry::OneBody, k);
    reference::problem(Geometry::OneBody, &mesh, &TABLE1).unwrap_or_else(|error| panic!("{error}"))
}

/// The paths besides the reference.
fn paths() -> Vec<(&'static str, EngineOptions)> {
    let gpu = |precision| GpuOptions {
        precision: Some(precision),
        checked: true,
        ..Default::default()
    };
    vec![
        (
            "PCG on the CPU",
            EngineOptions {
                place: Place::Cpu,
                stiffness: Stiffness::Pcg,
                ..Default::default()
            },
        ),
        (
            "GPU in f64",
            EngineOptions {
                place: Place::Gpu,
                gpu: gpu(Precision::F64),
                ..Default::default()
            },
        ),
        (
            "GPU in f32",
            EngineOptions {
                place: Place::Gpu,
                gpu: gpu(Precision::F32),
                ..Default::default()
            },
        ),
    ]
}

fn solve(
    problem: &ContactProblem,
    options: &EngineOptions,
    settings: &Settings,
) -> (Solution, Option<Costs>) {
    let mut engine =
        Engine::new(problem, options.clone(), |_| {}).unwrap_or_else(|error| panic!("{error}"));
    let solution = ssnm::solve(
        problem,
        &mut engine,
        settings,
        |_| ControlFlow::Continue(()),
    )
    .unwrap_or_else(|error| panic!("{error}"));
    (solution, engine.costs())
}

#[test]
fn every_path_solves_the_table() {
    for (k, beta) in [1, 3].into_iter().flat_map(|k| BETAS.map(|beta| (k, beta))) {
        let problem = one_body(k);
        let settings = Settings {
            tolerance: 1e-6,
            beta,
            ..Default::default()
        };
        let (expected, _) = solve(&problem, &EngineOptions::default(), &settings);
        let mut on_cpu = None;
        for (path, options) in paths() {
            let (found, costs) = solve(&problem, &options, &settings);
            let what = format!("{path}, k = {k}, β = {beta}");
            assert_eq!(found.status, Status::Converged, "{what}");
            // Products that are only as exact as need be lead to the same point by a slightly other way.
            let Info { iter, n_a, .. } = found.info;
            assert!(iter <= expected.info.iter + 6, "{what}: {iter}");
            assert!(n_a <= 2 * expected.info.n_a, "{what}: {n_a}");

            // Both are that far from the solution; how far from each other is a matter of chance, and so is
            // on which side of a bound a multiplier lies that is hardly off it.
            let close = |f: usize, e: usize| f.abs_diff(e) <= 2;
            let sizes = |found: &Solution| found.sets.sizes(|i| problem.has_friction(i));
            let (f, e) = (sizes(&found), sizes(&expected));
            assert!(
                close(f.separated, e.separated)
                    && close(f.stick, e.stick)
                    && close(f.slip.total(), e.slip.total()),
                "{what}: {f:?} {e:?}"
            );
            let apart = |a: &[f64], b: &[f64]| common::distance(a, b);
            assert!(apart(&found.u, &expected.u) < 1e-4, "{what}");
            assert!(apart(&found.lambda, &expected.lambda) < 1e-2, "{what}");
            // CPU and GPU round the V-cycle otherwise, and no more.
            if !path.ends_with("f32") {
                let (iter_there, n_a_there) = *on_cpu.get_or_insert((iter, n_a));
                assert!(
                    iter.abs_diff(iter_there) <= 5,
                    "{what}: {iter} {iter_there}"
                );
                assert!(n_a.abs_diff(n_a_there) <= 15, "{what}: {n_a} {n_a_there}");
            }
            let Costs { solves, device } = costs.expect("the nested path counts");
            // One look at the progress per system, rarely two; corrections in f32 need several, each with
            // its result.
            let looks = if path.ends_with("f32") { 9 } else { 2 };
            assert!(
                device.readbacks <= looks * solves.solves,
                "{what}: {device:?} {solves:?}"
            );
        }
    }
}

#[test]
fn manufactured_problems_on_every_path() {
    let mut random = Random(17);
    for (n, m, general) in [
        (3, 1, false),
        (40, 9, false),
        (41, 9, true),
        (301, 60, true),
    ] {
        let nodes: Vec<common::Node> = (0..m)
            .map(|_| common::Node {
                separated: random.below(3) == 0,
                slip: random.below(3) as i8 - 1,
            })
            .collect();
        let made = common::manufactured(n, &nodes, general, &mut random);
        let settings = Settings {
            tolerance: 1e-8,
            ..Default::default()
        };
        let (expected, _) = solve(&made.problem, &EngineOptions::default(), &settings);
        for (path, options) in paths() {
            let (found, _) = solve(&made.problem, &options, &settings);
            let what = format!("{path}, n = {n}, m = {m}");
            assert_eq!(found.status, Status::Converged, "{what}");
            assert!(found.info.iter <= expected.info.iter + 6, "{what}");
            assert!(found.sets == expected.sets, "{what}");
            assert!(common::distance(&found.u[..n], &made.u) < 1e-6, "{what}");
            let apart = common::distance(&found.lambda, &made.lambda);
            assert!(apart < 1e-6, "{what}: {apart}");
        }
    }
}

#[test]
fn six_dispatches_per_iteration_of_block_jacobi_and_few_read_backs() {
    let problem = one_body(1);
    let gpu = Gpu::new(&context(Precision::F64, None)).unwrap_or_else(|error| panic!("{error}"));
    let mut dual = NestedDual::new(&problem, gpu, Preconditioner::BlockJacobi)
        .unwrap_or_else(|error| panic!("{error}"));
    let p = vec![1.0; 2 * problem.m()];
    let mut y = p.clone();
    // The first product learns how many iterations one takes.
    dual.apply(&p, &mut y, Accuracy::Residual(1e-6), &Stop::default())
        .unwrap_or_else(|error| panic!("{error}"));
    for _ in 0..4 {
        let before = dual.costs().expect("it counts");
        dual.apply(&p, &mut y, Accuracy::Residual(1e-6), &Stop::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let after = dual.costs().expect("it counts");
        let iterations = after.solves.iterations - before.solves.iterations;
        let dispatches = after.device.dispatches - before.device.dispatches;
        let readbacks = after.device.readbacks - before.device.readbacks;
        // Beside the iterations: Bᵀp, the start of CG in two, z and p in three, and Bx with each look at the progress.
        assert_eq!((dispatches - 6 - readbacks) % 6, 0);
        let issued = (dispatches - 6 - readbacks) / 6;
        assert!(
            issued >= iterations && issued <= iterations + 16,
            "{issued} {iterations}"
        );
        assert!(
            readbacks <= iterations.div_ceil(16),
            "{readbacks} {iterations}"
        );
    }
}

#[test]
fn a_lost_device_costs_an_open_choice_nothing_and_a_fixed_one_a_clear_error() {
    let problem = one_body(1);
    let settings = Settings::default();
    let (expected, _) = solve(&problem, &EngineOptions::default(), &settings);
    let adapter = gpu::adapters().first().map(|adapter| adapter.name.clone());
    for place in [Place::Auto, Place::Gpu] {
        let options = EngineOptions {
            place,
            stiffness: Stiffness::Pcg,
            preconditioner: Preconditioner::Multigrid,
            gpu: GpuOptions {
                adapter: adapter.clone(),
                ..Default::default()
            },
        };
        let (say, heard) = std::sync::mpsc::channel();
        let mut engine = Engine::new(&problem, options, move |line| {
            say.send(line.to_owned()).expect("somebody listens");
        })
        .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(engine.backend(), "gpu");
        let context = Arc::clone(engine.context().expect("a GPU has a context"));
        let outcome = ssnm::solve(&problem, &mut engine, &settings, |step| {
            if step.iter == 2 {
                context.lose_device();
            }
            ControlFlow::Continue(())
        });
        if place == Place::Auto {
            let found = outcome.unwrap_or_else(|error| panic!("{error}"));
            assert_eq!((engine.backend(), engine.stiffness()), ("cpu", "pcg"));
            assert_eq!(found.status, Status::Converged);
            // The steps made on the GPU are not made again.
            assert!(
                found.info.iter <= expected.info.iter + 3,
                "{:?}",
                found.info
            );
            assert!(
                found.info.n_a <= expected.info.n_a * 3 / 2,
                "{:?}",
                found.info
            );
            assert!(common::distance(&found.u, &expected.u) < 1e-5);
            drop(engine);
            let log: Vec<String> = heard.try_iter().collect();
            assert!(
                log.last().is_some_and(|line| line.contains("lost")),
                "{log:?}"
            );
        } else {
            let error = outcome.expect_err("the choice is fixed");
            let text = error.to_string();
            assert!(text.contains("lost"), "{text}");
            assert_eq!(error.history.len(), 2, "the steps made are kept");
            // What was reached is a start for another solve.
            let mut dual = DirectDual::new(&problem).unwrap_or_else(|error| panic!("{error}"));
            let start = WarmStart {
                lambda: Some(&error.lambda),
                ..Default::default()
            };
            let go_on = |_: &Step| ControlFlow::Continue(());
            let again = ssnm::solve_from(start, &problem, &mut dual, &settings, go_on)
                .unwrap_or_else(|error| panic!("{error}"));
            assert_eq!(again.status, Status::Converged);
            let first = |solution: &Solution| solution.info.history[0].err;
            assert!(first(&again) < first(&expected), "it starts ahead");
        }
    }
}

/// Wherever the device is lost, setting up included, the CPU goes on as `auto` would have begun there.
#[test]
fn a_device_lost_at_any_submission() {
    let problem = one_body(1);
    let settings = Settings::default();
    let (expected, _) = solve(&problem, &EngineOptions::default(), &settings);
    let adapter = gpu::adapters().first().map(|adapter| adapter.name.clone());
    let mut lost = 0;
    for k in 0..20_usize {
        let options = EngineOptions {
            place: Place::Auto,
            stiffness: Stiffness::Pcg,
            gpu: GpuOptions {
                adapter: adapter.clone(),
                ..Default::default()
            },
            ..Default::default()
        };
        let mut engine =
            Engine::new(&problem, options, |_| {}).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(engine.backend(), "gpu");
        let context = Arc::clone(engine.context().expect("a GPU has a context"));
        context.lose_device_after(3 * k);
        let found = ssnm::solve(&problem, &mut engine, &settings, |_| {
            ControlFlow::Continue(())
        })
        .unwrap_or_else(|error| panic!("after {}: {error}", 3 * k));
        assert_eq!(found.status, Status::Converged);
        assert!(common::distance(&found.u, &expected.u) < 1e-5);
        if engine.backend() == "cpu" {
            lost += 1;
            assert_eq!(engine.stiffness(), "pcg");
        }
    }
    assert!(lost >= 10, "{lost}");
}

/// Every new load makes buffers of its own: what was bound to those before must not pile up over thousands of rounds.
#[test]
fn what_was_bound_to_dropped_buffers_is_forgotten() {
    let problem = one_body(1);
    let context = context(Precision::F64, None);
    let gpu = Gpu::new(&context).unwrap_or_else(|error| panic!("{error}"));
    let mut dual = NestedDual::new(&problem, gpu, Preconditioner::Multigrid)
        .unwrap_or_else(|error| panic!("{error}"));
    let lambda = vec![0.0; 2 * problem.m()];
    let mut r = lambda.clone();
    let accuracy = Accuracy::Energy {
        absolute: 0.0,
        relative: 0.1,
    };
    let mut kept = Vec::new();
    for round in 0..60 {
        let load: Vec<f64> = problem
            .load()
            .iter()
            .map(|f| f * f64::from(round + 1))
            .collect();
        let [gap, origin, bound] =
            [problem.gap(), problem.slip_origin(), problem.slip_bound()].map(<[f64]>::to_vec);
        let there =
            (problem.with_data(load, gap, origin, bound)).unwrap_or_else(|error| panic!("{error}"));
        let (case, stop) = (there.load_case(), Stop::default());
        dual.gradient(case, &lambda, &mut r, 0.0, accuracy, &stop)
            .unwrap_or_else(|error| panic!("{error}"));
        kept.push(dual.backend().kept());
    }
    assert!(kept[59] <= kept[9] + 2, "{kept:?}");
}

#[test]
fn a_device_that_is_lost_before_or_while_setting_up() {
    let context = context(Precision::F64, None);
    let mut gpu = Gpu::new(&context).unwrap_or_else(|error| panic!("{error}"));
    let mut x = gpu.vector(10).unwrap_or_else(|error| panic!("{error}"));
    context.lose_device();
    gpu.upload(&[1.0; 10], &mut x);
    let error = gpu.download(&x, &mut [0.0; 10]).err();
    assert!(
        matches!(error, Some(BackendError::Lost { .. })),
        "{error:?}"
    );
    let error = gpu.vector(1000).err();
    assert!(
        matches!(error, Some(BackendError::Lost { .. })),
        "{error:?}"
    );
}

#[test]
fn limits_that_are_too_small_are_named() {
    let small = context(Precision::F64, Some(4096));
    let mut gpu = Gpu::new(&small).unwrap_or_else(|error| panic!("{error}"));
    let row = (0..500).map(|j| (0, 2 * j, 1.0));
    let k = Arc::new(BlockCsr::<2>::from_triplets(1000, 1000, row));
    let error = gpu.matrix(k).err();
    assert!(
        matches!(error, Some(BackendError::DenseRow { .. })),
        "{error:?}"
    );

    let context = context(Precision::F64, None);
    if context.adapter.memory.is_some() {
        let error = context.check_memory("the stiffness matrix", 1 << 50).err();
        let text = error.map(|error| error.to_string()).unwrap_or_default();
        assert!(
            text.contains("the stiffness matrix") && text.contains("MiB"),
            "{text}"
        );
    }
    let options = GpuOptions {
        adapter: Some("no such adapter".into()),
        ..Default::default()
    };
    let error = Context::new(&options)
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(
        error.contains("no such adapter") && error.contains("0: "),
        "{error}"
    );
}

#[test]
fn a_request_to_stop_is_heard_inside_a_solve_with_k() {
    let problem = one_body(1);
    for (path, options) in paths() {
        let mut engine =
            Engine::new(&problem, options, |_| {}).unwrap_or_else(|error| panic!("{error}"));
        let flag = Arc::new(AtomicBool::new(true));
        let settings = Settings {
            interrupt: Some(Arc::clone(&flag)),
            ..Default::default()
        };
        let stopped = ssnm::solve(&problem, &mut engine, &settings, |_| {
            ControlFlow::Continue(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(stopped.status, Status::Interrupted, "{path}");
        assert_eq!(stopped.info.iter, 0, "{path}");
        assert!(stopped.u.iter().all(|v| v.is_finite()), "{path}");
        flag.store(false, Ordering::Relaxed);
        let stopped = ssnm::solve(&problem, &mut engine, &settings, |step| {
            flag.store(step.iter == 3, Ordering::Relaxed);
            ControlFlow::Continue(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(
            (stopped.status, stopped.info.iter),
            (Status::Interrupted, 3),
            "{path}"
        );
    }
}

#[test]
fn a_singular_matrix_is_an_error_of_the_problem() {
    // Two nodes joined by springs and held by nothing, pulled.
    let spring = [(0, 0, 1.0), (2, 2, 1.0), (0, 2, -1.0), (2, 0, -1.0)];
    let other = spring.map(|(i, j, v)| (i + 1, j + 1, v));
    let problem: ContactProblem = ContactProblem::new(signorini::problem::ContactData {
        stiffness: BlockCsr::from_triplets(4, 4, spring.into_iter().chain(other)),
        load: vec![1.0, 0.0, 0.0, 0.0],
        normal: Csr::from_triplets(1, 4, [(0, 3, 1.0)]),
        tangential: Csr::from_triplets(1, 4, [(0, 2, 1.0)]),
        gap: vec![0.0],
        slip_bound: vec![0.1],
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"));
    for (path, options) in paths() {
        for preconditioner in [Preconditioner::Multigrid, Preconditioner::BlockJacobi] {
            let options = EngineOptions {
                preconditioner,
                ..options.clone()
            };
            // Multigrid notices when it is set up, block-Jacobi in the first solve.
            let text = match Engine::new(&problem, options, |_| {}) {
                Err(error) => error.to_string(),
                Ok(mut engine) => {
                    let settings = Settings::default();
                    ssnm::solve(&problem, &mut engine, &settings, |_| {
                        ControlFlow::Continue(())
                    })
                    .expect_err("K is singular")
                    .to_string()
                }
            };
            assert!(
                text.contains("supports"),
                "{path}, {preconditioner:?}: {text}"
            );
        }
    }
}

/// A random matrix of a multigrid level: some empty rows, a long row now and then.
fn level_matrix<const R: usize, const C: usize>(
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

/// Everything that a V-cycle is made of, on random data in blocks of D, coarser ones of M: each result through CG's
/// own door, since vectors of a level have no other way to the host.
fn level_results<B: Backend<Stored = f32>, const D: usize, const M: usize>(
    b: &mut B,
    rows: usize,
    longest: usize,
) -> Result<Vec<Vec<f64>>, BackendError> {
    let mut random = Random((17 * rows + D) as u64);
    // A state that is not done, of a run on vectors of the same length.
    let n = rows * D;
    let k = BlockCsr::<D>::from_triplets(n, n, (0..n).map(|i| (i, i, 1.0)));
    let (k, _) = b.matrix(Arc::new(k))?;
    let r = numbers(&mut random, n);
    let mut r_there = b.vector(n)?;
    b.upload(&r, &mut r_there);
    let (mut x, mut p) = (b.vector(n)?, b.vector(n)?);
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

    // p = z + β p with the z in question, in the first iteration of a run: p = z.
    macro_rules! keep {
        ($z:expr) => {{
            b.direction(&r_there, $z, &mut p, &mut state);
            let mut out = vec![f64::NAN; n];
            b.download(&p, &mut out)?;
            results.push(out);
            b.start(&r_there, &mut x, &mut right, &mut state, RUN);
        }};
    }
    b.start(&r_there, &mut x, &mut right, &mut state, RUN);
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

fn compare_levels<const D: usize, const M: usize>(
    context: &Arc<Context>,
    rows: usize,
    longest: usize,
) {
    let what = format!(
        "{rows} blocks of {D}, coarser ones of {M}, in {}, at most {longest} a row",
        context.precision
    );
    let mut gpu = Gpu::new(context).unwrap_or_else(|error| panic!("{error}"));
    let found = level_results::<_, D, M>(&mut gpu, rows, longest)
        .unwrap_or_else(|error| panic!("{what}: {error}"));
    let expected = level_results::<_, D, M>(&mut Cpu::<f32>::default(), rows, longest)
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(found.len(), expected.len());
    for (i, (f, e)) in found.iter().zip(&expected).enumerate() {
        // Sums of up to 3000 numbers of size one in f32, three in a row.
        assert_close(f, e, 3e-5, &format!("result {i}, {what}"));
    }
}

#[test]
fn kernels_of_the_levels_at_awkward_sizes() {
    for precision in PRECISIONS {
        // 1344 unknowns a segment, and slices of so many columns, in the small one.
        for (max_binding, longest) in [(None, usize::MAX), (Some(32 << 10), 6)] {
            let context = context(precision, max_binding);
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
type System<const D: usize> = (Arc<BlockCsr<D>>, Vec<f64>, Vec<[f64; D]>);

fn clamped<const D: usize>(mesh: &Mesh<D>) -> System<D>
where
    Kind: Elements<D>,
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

/// Multigrid whose vectors exceed a binding gives what it gives in one piece, with patches as well.
#[test]
fn multigrid_on_vectors_in_pieces() {
    let even = rectangle([0.0; 2], [3.0, 1.0], [45, 15], CellShape::Quad, "body", "");
    let flat = rectangle([0.0; 2], [3.0, 0.2], [20, 40], CellShape::Quad, "body", "");
    for (k, f, points) in [clamped(&even), clamped(&flat)] {
        let product = |max_binding| -> (Vec<f64>, usize) {
            let gpu = Gpu::new(&context(Precision::F64, max_binding))
                .unwrap_or_else(|error| panic!("{error}"));
            let mut pcg = Pcg::new(gpu, &k, Some(&points), Preconditioner::Multigrid)
                .unwrap_or_else(|error| panic!("{error}"));
            assert!(pcg.hierarchy.is_some() && pcg.fallback.is_none());
            let mut x = vec![0.0; f.len()];
            pcg.solve(&f, &mut x, 1e-10, &Stop::default())
                .unwrap_or_else(|error| panic!("{error}"));
            (x, pcg.counts.iterations)
        };
        let (whole, iterations) = product(None);
        // Some 600 unknowns a segment, which the coarsest level fits into.
        let (pieces, iterations_there) = product(Some(24 << 10));
        assert!(iterations.abs_diff(iterations_there) <= 1);
        assert!(common::distance(&pieces, &whole) < 1e-9);
    }
}

/// A cube of springs to the 26 neighbours of each node, held by springs at x = 0.
fn cube(n: usize) -> (BlockCsr<3>, Vec<[f64; 3]>) {
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
    let systems = [(Arc::new(k), b, points), clamped(&flat)];
    fn solved<B: Backend>(
        backend: B,
        (k, points, b): (&Arc<BlockCsr<3>>, &[[f64; 3]], &[f64]),
        preconditioner: Preconditioner,
    ) -> usize {
        let mut pcg = Pcg::new(backend, k, Some(points), preconditioner)
            .unwrap_or_else(|error| panic!("{error}"));
        let mut x = vec![0.0; b.len()];
        pcg.solve(b, &mut x, 1e-9, &Stop::default())
            .unwrap_or_else(|error| panic!("{error}"));
        let mut r = vec![0.0; b.len()];
        k.mul(&x, &mut r);
        r.iter_mut().zip(b).for_each(|(r, b)| *r -= b);
        assert!(norm(&r) < 2e-9 * norm(b), "{:e}", norm(&r) / norm(b));
        pcg.counts.iterations
    }
    let all = [Preconditioner::Multigrid, Preconditioner::BlockJacobi];
    for ((k, b, points), preconditioner) in
        (systems.iter()).flat_map(|system| all.map(|preconditioner| (system, preconditioner)))
    {
        let system = (k, &points[..], &b[..]);
        let on_cpu = solved(Cpu::<f32>::default(), system, preconditioner);
        for precision in PRECISIONS {
            let gpu = Gpu::new(&context(precision, None)).unwrap_or_else(|error| panic!("{error}"));
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

/// Where there is room for K and not for its hierarchy, PCG goes on with block-Jacobi and says so.
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
        let context = Context::new(&options).unwrap_or_else(|error| panic!("{error}"));
        let gpu = Gpu::new(&context).unwrap_or_else(|error| panic!("{error}"));
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
