//! Space on every path: counts that do not depend on the machine, and CPU, PCG and GPU against each other.

use crate::common::distance;
use crate::common::or_panic::OrPanic as _;
use signorini::backend::{GpuOptions, Precision};
use signorini::dual::DualOperator as _;
use signorini::engine::{Device, Engine, EngineOptions, Stiffness};
use signorini::mesh::structured::SolidShape;
use signorini::problem::ContactProblem;
use signorini::reference::{BEAM, CASE_C, Solid};
use signorini::ssnm::{self, NewtonSettings, Solution, Status};
use std::ops::ControlFlow;

fn problem(solid: &Solid, q: usize, shape: SolidShape) -> ContactProblem<3> {
    (solid.problem(q, shape)).or_panic()
}

fn on(stiffness: Stiffness) -> EngineOptions {
    EngineOptions {
        place: Device::Cpu,
        stiffness,
        ..Default::default()
    }
}

fn engine(problem: &ContactProblem<3>, options: EngineOptions) -> Engine {
    Engine::new(problem, options, |_| {}).or_panic()
}

/// Steps and products to each of some errors, relative to the first one, and the solution to the least of them.
fn counts(
    problem: &ContactProblem<3>,
    engine: &mut Engine,
    beta: f64,
    errors: &[f64],
) -> (Vec<(usize, usize)>, Solution<3>) {
    let tolerance = errors.iter().copied().fold(1.0, f64::min);
    let settings = NewtonSettings {
        tolerance,
        beta,
        max_iterations: 300,
        ..Default::default()
    };
    let mut met = Vec::new();
    let solution = ssnm::solve(problem, engine, &settings, |step| {
        while errors
            .get(met.len())
            .is_some_and(|&error| step.err <= error)
        {
            met.push((step.iter, step.n_a));
        }
        ControlFlow::Continue(())
    })
    .or_panic();
    assert_eq!(solution.status, Status::Converged, "β = {beta}");
    assert!(solution.info.kkt.max() <= 10.0 * tolerance);
    (met, solution)
}

/// At most 16 | 24 products, and hardly more on finer meshes. Another implementation of the paper's method
/// needs 41 | 67 and 49 | 60 at q = 8 and 12, MPGP with discs 225 and more.
#[test]
fn case_c_takes_few_products_at_every_size() {
    let mut of_size = Vec::new();
    for q in [4, 8, 12] {
        let problem = problem(&CASE_C, q, SolidShape::Hexahedron);
        let mut engine = engine(&problem, on(Stiffness::Cholesky));
        let (met, _) = counts(&problem, &mut engine, 1.0, &[1e-4, 1e-6]);
        println!("q = {q}: {met:?}");
        assert!(met[0].1 <= 16 && met[1].1 <= 24, "q = {q}: {met:?}");
        of_size.push(met[1].1 as f64);
    }
    assert!(of_size[2] <= 1.25 * of_size[1], "{of_size:?}");
}

#[test]
fn every_beta_converges_in_space() {
    for (solid, q) in [(CASE_C, 4), (CASE_C, 8), (BEAM, 3)] {
        let problem = problem(&solid, q, SolidShape::Hexahedron);
        let mut engine = engine(&problem, on(Stiffness::Cholesky));
        for beta in [0.01, 0.1, 1.0, 20.0, 100.0, 1000.0] {
            let (met, _) = counts(&problem, &mut engine, beta, &[1e-4, 1e-6]);
            println!("q = {q}, β = {beta}: {met:?}");
        }
    }
}

/// Without the faces of its safeguard this does not converge at all.
#[test]
fn a_slender_beam_converges() {
    let problem = problem(&BEAM, 3, SolidShape::Hexahedron);
    let mut engine = engine(&problem, on(Stiffness::Cholesky));
    let (met, _) = counts(&problem, &mut engine, 1.0, &[1e-4, 1e-6, 1e-8]);
    println!("{met:?}");
    assert!(met[0].0 <= 30 && met[0].1 <= 150, "{met:?}");
    assert!(met[2].1 <= 350, "{met:?}");
}

/// Pressed and sliding tetrahedra.
#[test]
fn the_kind_of_elements_does_not_matter() {
    for shape in [SolidShape::Tetrahedron, SolidShape::Wedge] {
        let problem = problem(&CASE_C, 6, shape);
        let mut engine = engine(&problem, on(Stiffness::Cholesky));
        let (met, _) = counts(&problem, &mut engine, 1.0, &[1e-4, 1e-6]);
        println!("{shape:?}: {met:?}");
        assert!(met[0].1 <= 60 && met[1].1 <= 90, "{shape:?}: {met:?}");
    }
}

/// By PCG: the same answer, few iterations for each K⁻¹, and in all at most four times the work of one solve with K.
#[test]
fn case_c_by_pcg_costs_few_linear_solves() {
    for (shape, q, most) in [
        (SolidShape::Hexahedron, 10, 18),
        (SolidShape::Tetrahedron, 10, 25),
    ] {
        let problem = problem(&CASE_C, q, shape);
        let [(_, exact), (_, found)] = [Stiffness::Cholesky, Stiffness::Pcg].map(|stiffness| {
            let mut engine = engine(&problem, on(stiffness));
            let made = counts(&problem, &mut engine, 1.0, &[1e-4]);
            if stiffness == Stiffness::Pcg {
                let cycles = engine.costs().expect("PCG counts").solves.iterations;
                let linear = engine.linear_iterations(1e-8);
                let linear = (linear.or_panic()).expect("it iterates");
                println!("{shape:?}: {cycles} V-cycles, {linear} of one solve");
                assert!(linear <= most, "{shape:?}: {linear}");
                assert!(cycles <= 4 * linear, "{shape:?}: {cycles} of {linear}");
            }
            made
        });
        // Twice the permitted error of each.
        assert!(distance(&found.u, &exact.u) < 2e-3);
        assert!(found.sets.differences(&exact.sets) <= problem.m() / 50);
    }
}

/// On an adapter, in both precisions, and with arrays in many parts.
#[test]
fn case_c_on_a_gpu_is_that_of_the_cpu() {
    let problem = problem(&CASE_C, 4, SolidShape::Hexahedron);
    let mut cpu = engine(&problem, on(Stiffness::Cholesky));
    let (_, expected) = counts(&problem, &mut cpu, 1.0, &[1e-6]);
    for (precision, max_binding, least_invocations) in [
        (Precision::F64, None, Some(1 << 17)),
        (Precision::F32, None, None),
        (Precision::F64, Some(256 << 10), None),
        (Precision::F32, Some(256 << 10), Some(1 << 17)),
    ] {
        let options = EngineOptions {
            place: Device::Gpu,
            stiffness: Stiffness::Pcg,
            gpu: GpuOptions {
                precision: Some(precision),
                max_binding,
                least_invocations,
                ..Default::default()
            },
            ..Default::default()
        };
        let mut engine = engine(&problem, options);
        let (_, found) = counts(&problem, &mut engine, 1.0, &[1e-6]);
        let what = format!("{precision:?} {max_binding:?}");
        assert_eq!(found.sets.differences(&expected.sets), 0, "{what}");
        assert!(distance(&found.u, &expected.u) < 1e-5, "{what}");
        assert!(distance(&found.lambda, &expected.lambda) < 1e-3, "{what}");
    }
}
