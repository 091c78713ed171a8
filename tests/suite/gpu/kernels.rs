//! Each kernel, compared with the same method in Rust.

use super::{INVOCATIONS, PRECISIONS, context, device, each, one_body};
use crate::common::Random;
use crate::common::or_panic::OrPanic as _;
use signorini::backend::cpu::Cpu;
use signorini::backend::gpu::Gpu;
use signorini::backend::{Backend, BackendError, Precision, Progress, Run};
use signorini::problem::ContactProblem;
use signorini::sparse::{BlockCsr, Csr, norm};
use signorini::stiffness::amg::{Hierarchy, Multigrid};
use std::sync::Arc;

/// A CG run that is not over after an iteration.
pub const RUN: Run = Run {
    continues: false,
    residual: 0.0,
    residual_part: 1e-3,
    remaining: 0.0,
    remaining_part: 0.0,
    to_come: 1.0,
};

/// A random number that f32 represents.
pub fn number(random: &mut Random) -> f64 {
    f64::from(random.between(-1.0, 1.0) as f32)
}

pub fn numbers(random: &mut Random, len: usize) -> Vec<f64> {
    (0..len).map(|_| number(random)).collect()
}

/// The data for the kernels, in blocks of D.
pub struct Data<const D: usize> {
    pub k: Arc<BlockCsr<D>>,
    /// Blocks of D⁻¹.
    pub inverse: Vec<f32>,
    pub rows: Csr,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub short: Vec<f64>,
}

/// Random data with `n` block rows: some empty ones, one with entries in every column if `dense`.
pub fn data<const D: usize>(n: usize, dense: bool, random: &mut Random) -> Data<D> {
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
pub struct Results {
    /// y − K x.
    pub subtracted: Vec<f64>,
    /// K p after the start of CG with r = x.
    pub product: Vec<f64>,
    /// x, r, p after one iteration.
    pub step: [Vec<f64>; 3],
    pub progress: [Progress; 2],
    pub gathered: Vec<f64>,
    pub scattered: Vec<f64>,
    /// x, copied and handed to a run that continues.
    pub kept: Vec<f64>,
    /// y − 0.3 x.
    pub added: Vec<f64>,
}

pub fn results<B: Backend<Stored = f32>, const D: usize>(mut b: B, data: &Data<D>) -> Results {
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
        // A run that continues leaves x unchanged.
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
    run(&mut b).or_panic()
}

pub fn assert_close(found: &[f64], expected: &[f64], bound: f64, what: &str) {
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

pub fn compare<const D: usize>(data: &Data<D>, gpu: Gpu, what: &str) {
    let precision = gpu.context().precision;
    let is_software = gpu.context().adapter.is_software;
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
    // A GPU may fuse the products and sums of the smoother, which is in f32: z differs in its last digit, and all that follows.
    let single = match is_software {
        true => 0.0,
        false => f64::from(f32::EPSILON) * (4.0 + D as f64),
    };
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
        bound.max(single),
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
            (found / expected - 1.0).abs() < 2.0 * of_sum.max(single),
            "{what}: {s:?} {e:?}"
        );
    }
    assert!(!s.broken, "the data give positive curvature, {what}");
    assert_eq!(s.iterations, 1, "{what}");
    for (i, name) in ["x", "r", "p"].iter().enumerate() {
        assert_close(
            &found.step[i],
            &expected.step[i],
            bound.max(single),
            &format!("{name}, {what}"),
        );
    }
}

/// The progress of a run after each of its first iterations.
pub fn followed<B: Backend<Stored = f32>>(
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
        let hierarchy = hierarchy.or_panic();
        let mut cycle = Multigrid::new(&mut b, hierarchy)?;
        b.start(&r, &mut x, cycle.r(), &mut state, goals);
        cycle.cycle(&mut b, &state).unwrap();
        b.direction(&r, cycle.z(), &mut p, &mut state);
        let mut progress = Vec::new();
        for _ in 0..26 {
            b.multiply(&matrix, &p, &mut q, &mut state);
            b.step(&p, &q, &mut x, &mut r, cycle.r(), &mut state);
            cycle.cycle(&mut b, &state).unwrap();
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
    run().or_panic()
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
            let gpu = Gpu::new(&context(precision, None)).or_panic();
            let found = followed(gpu, &problem, multigrid);
            for (f, e) in found.iter().zip(&expected) {
                let what = format!("{precision}, multigrid {multigrid}: {f:?} {e:?}");
                assert_eq!(f.iterations, e.iterations, "{what}");
                assert_eq!(f.recent_terms, e.recent_terms, "{what}");
                assert_eq!((f.done, f.broken), (e.done, e.broken), "{what}");
                // Directions lose their independence by rounding, which differs between the two.
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

#[test]
fn kernels_at_awkward_sizes() {
    for (precision, invocations) in each(PRECISIONS, INVOCATIONS) {
        let context = device(precision, None, invocations);
        let mut random = Random(7);
        for n in [
            1, 2, 3, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 128, 129, 255, 256, 257, 1000, 4099,
        ] {
            let gpu = || Gpu::new(&context).or_panic();
            let what = format!("{n} block rows, invocations {invocations:?}");
            compare(&data::<2>(n, n == 257, &mut random), gpu(), &what);
            compare(&data::<3>(n, n == 257, &mut random), gpu(), &what);
        }
    }
}

#[test]
fn kernels_on_vectors_and_matrices_in_pieces() {
    // 16 KiB a binding: 576 unknowns a segment, 8 blocks a row of a slice of K in blocks of 3 and f64.
    for (precision, invocations) in each(PRECISIONS, INVOCATIONS) {
        for (bytes, n) in [(16 << 10, 1500), (64 << 10, 4100), (48 << 10, 3072)] {
            let context = device(precision, Some(bytes), invocations);
            let mut random = Random(11);
            let gpu = || Gpu::new(&context).or_panic();
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
    let mut gpu = Gpu::new(&context).or_panic();
    let mut product = || -> Result<Vec<f64>, BackendError> {
        let (matrix, _) = gpu.matrix(Arc::clone(&k) as _)?;
        let (mut x_there, mut y) = (gpu.vector(2 * n)?, gpu.vector(2 * n)?);
        gpu.upload(&x, &mut x_there);
        gpu.subtract_product(&matrix, &x_there, &mut y);
        let mut found = vec![f64::NAN; 2 * n];
        gpu.download(&y, &mut found)?;
        Ok(found)
    };
    let found = product().or_panic();
    let mut expected = vec![0.0; 2 * n];
    k.mul(&x, &mut expected);
    expected.iter_mut().for_each(|v| *v = -*v);
    assert_close(&found, &expected, 1e-14, "−Kx");
}
