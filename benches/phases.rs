//! Seconds of the phases of a solve on the direct path, and their ratios in one run.
//!
//! `cargo bench --bench phases -- [k …]` on reference case A (default k = 13). The whole solve, from the
//! load vector to the verified answer, is compared with one factorisation and one solve.

use signorini::dual::DirectDual;
use signorini::output::peak_memory_mib;
use signorini::reference::{self, CASE_A, Geometry};
use signorini::ssnm::{self, NewtonSettings};
use std::ops::ControlFlow;
use std::time::Instant;

fn main() {
    let mut sizes: Vec<usize> = std::env::args().filter_map(|a| a.parse().ok()).collect();
    if sizes.is_empty() {
        sizes.push(13);
    }
    println!(
        "reference case A; seconds; whole = factor + set-up + ssnm, reference = factor + one solve"
    );
    println!(
        "{:>3} {:>9} {:>6}  {:>8} {:>8} {:>8} {:>8} {:>8}  {:>9} {:>9} {:>6}  {:>5} {:>4}",
        "k",
        "n",
        "eps",
        "assembly",
        "factor",
        "solve",
        "set-up",
        "ssnm",
        "whole",
        "reference",
        "ratio",
        "iter",
        "n_A"
    );
    for k in sizes {
        let mesh = reference::mesh(Geometry::OneBody, k);
        let mut assembly = f64::INFINITY;
        let mut problem = None;
        for _ in 0..3 {
            let start = Instant::now();
            problem = reference::problem(Geometry::OneBody, &mesh, &CASE_A).ok();
            assembly = assembly.min(start.elapsed().as_secs_f64());
        }
        let problem = problem.expect("the reference problem is sound");
        for tolerance in [1e-4, 1e-6] {
            let start = Instant::now();
            let mut dual = DirectDual::new(&problem).expect("K is positive definite");
            let settings = NewtonSettings {
                tolerance,
                ..Default::default()
            };
            let solution =
                ssnm::solve(
                    &problem,
                    &mut dual,
                    &settings,
                    |_| ControlFlow::Continue(()),
                )
                .expect("the direct path does not fail");
            let whole = start.elapsed().as_secs_f64();
            let one = dual.factor().seconds + dual.solve_seconds;
            println!(
                "{k:3} {:9} {tolerance:6.0e}  {assembly:8.3} {:8.3} {:8.4} {:8.4} {:8.4}  {whole:9.3} {one:9.3} {:6.2}  {:5} {:4}",
                problem.n_free(),
                dual.factor().seconds,
                dual.solve_seconds,
                solution.info.setup_seconds,
                solution.info.solve_seconds,
                whole / one,
                solution.info.iter,
                solution.info.n_a,
            );
        }
    }
    if let Some(peak) = peak_memory_mib() {
        println!("peak memory {peak:.0} MiB");
    }
}
