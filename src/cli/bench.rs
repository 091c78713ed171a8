//! `signorini bench`.

use super::advice::message_of;
use super::{BenchArguments, NOT_CONVERGED, print};
use signorini::backend::gpu::Context;
use signorini::backend::{GpuOptions, Precision};
use signorini::bench::{self, Path, Row, Speeds};
use signorini::mesh::structured::SolidShape;
use signorini::mesh::{ElementKind, Mesh, Topology};
use signorini::output::write_whole;
use signorini::problem::ContactProblem;
use signorini::reference::{self, CASE_B, CASE_C, Geometry, ReferenceError};
use signorini::ssnm::Status;
use std::collections::BTreeMap;
use std::io::IsTerminal as _;
use std::sync::Arc;

/// ε of the contact problems.
const TOLERANCE: f64 = 1e-4;

pub fn run(arguments: &BenchArguments) -> Result<u8, String> {
    if arguments.k.contains(&0) {
        return Err("--k 0: the smallest size is k = 1".into());
    }
    let contexts = contexts(arguments)?;
    let software = contexts.first().is_some_and(|c| c.adapter.is_software);
    print(&device(contexts.first().map(|context| &**context)))?;
    let (case, (speeds, rows)) = match arguments.dimension {
        3 => {
            let case_c = |q| {
                let mesh = of_order(CASE_C.mesh(q, SolidShape::Hexahedron), arguments.order);
                CASE_C.problem_on(&mesh)
            };
            let k = if arguments.order == 2 {
                [4, 8, 12]
            } else {
                [8, 16, 24]
            };
            let sizes = Sizes::new(arguments, k, 150_000);
            (
                "a block in space, reference case C",
                measure(&sizes, &contexts, case_c)?,
            )
        }
        _ => {
            let case_b = |k| {
                let mesh = of_order(reference::mesh(Geometry::OneBody, k), arguments.order);
                reference::problem(Geometry::OneBody, &mesh, &CASE_B)
            };
            let k = if arguments.order == 2 {
                [2, 4, 7]
            } else {
                [3, 7, 13]
            };
            let sizes = Sizes::new(arguments, k, 1_000_000);
            (
                "one body, reference case B",
                measure(&sizes, &contexts, case_b)?,
            )
        }
    };
    print(&speeds_table(&speeds))?;
    print(&rows_table(&rows))?;
    for speeds in &speeds {
        print(&kernels_table(speeds))?;
    }
    let fits = fits(&rows);
    if !fits.is_empty() {
        print("Seconds grow with n to the power of:\n")?;
        for (path, [set_up, solve]) in &fits {
            print(&format!(
                "  {path:14} set-up {set_up:.2}, solve {solve:.2}\n"
            ))?;
        }
        print("\n")?;
    }
    let threads = rayon::current_num_threads();
    print(&format!("{threads} threads.\n"))?;
    if let Some(path) = &arguments.json {
        let document = serde_json::json!({
            "version": env!("CARGO_PKG_VERSION"),
            "case": case,
            "dimension": arguments.dimension,
            "order": arguments.order,
            "tolerance": TOLERANCE,
            "threads": threads,
            "adapter": contexts.first().map(|c| c.adapter.to_string()),
            "driver": contexts.first().map(|c| c.adapter.driver.clone()),
            "software_adapter": software,
            "speeds": speeds,
            "solves": rows,
            "growth": fits,
        });
        write_whole(path, format!("{document:#}\n").as_bytes()).map_err(|e| message_of(&e))?;
    }
    // Each answer may be off by ten times the tolerance.
    let sound = |row: &Row| row.status == Status::Converged && row.difference < 2e-3;
    Ok(if rows.iter().all(sound) {
        0
    } else {
        print("NOT all paths agree: see the columns status and difference.\n")?;
        NOT_CONVERGED
    })
}

/// The mesh with elements of this order, from one with those of first order.
fn of_order<const D: usize>(mesh: Mesh<D>, order: u8) -> Mesh<D>
where
    ElementKind: Topology<D>,
{
    match order {
        1 => mesh,
        _ => mesh
            .raised()
            .expect("rectangles and blocks have no pyramids"),
    }
}

/// The device measured beside the CPU.
fn device(context: Option<&Context>) -> String {
    let Some(context) = context else {
        return "No adapter: only the CPU is measured.\n\n".to_owned();
    };
    let warning = if context.adapter.is_software {
        "This is a software adapter: its rows test the kernels and measure NO GPU; they say nothing about the speed of \
         one.\n"
    } else {
        ""
    };
    let (adapter, driver) = (&context.adapter, &context.adapter.driver);
    format!("GPU: {adapter}, {driver}\n{warning}\n")
}

/// The sizes to measure.
struct Sizes {
    /// Refinements.
    k: Vec<usize>,
    /// Unknowns up to which there is a factor.
    max_cholesky: usize,
}

impl Sizes {
    /// As requested, or sizes that suit the case.
    fn new(arguments: &BenchArguments, k: [usize; 3], max_cholesky: usize) -> Self {
        Self {
            k: if arguments.k.is_empty() {
                k.to_vec()
            } else {
                arguments.k.clone()
            },
            max_cholesky: arguments.max_cholesky.unwrap_or(max_cholesky),
        }
    }
}

/// Simple work and whole solves of every size, on the CPU and on each device.
fn measure<const D: usize>(
    sizes: &Sizes,
    contexts: &[Arc<Context>],
    problem: impl Fn(usize) -> Result<ContactProblem<D>, ReferenceError>,
) -> Result<(Vec<Speeds>, Vec<Row>), String> {
    let terminal = std::io::stderr().is_terminal();
    let progress = |line: &str| {
        if terminal {
            eprint!("\r\x1b[2K{line}");
        }
    };
    let (mut speeds, mut rows) = (Vec::new(), Vec::new());
    for &k in &sizes.k {
        progress(&format!("k = {k}: assembly"));
        let problem = problem(k).map_err(|e| message_of(&e))?;
        let failed = |e| format!("k = {k}: {e}");
        speeds.push(bench::measure(&problem).map_err(failed)?);
        for context in contexts {
            progress(&format!("k = {k}: simple work, {}", context.precision));
            speeds.push(bench::measure_gpu(&problem, context).map_err(failed)?);
        }
        let mut paths = Vec::new();
        if problem.n_free() <= sizes.max_cholesky {
            paths.push(Path::CpuCholesky);
        }
        paths.push(Path::CpuPcg);
        paths.extend(contexts.iter().cloned().map(Path::Gpu));
        let found = bench::solve_on(&paths, k, &problem, TOLERANCE, &speeds, |path| {
            progress(&format!("k = {k}: {path}"));
        });
        rows.extend(found.map_err(|e| format!("k = {k}: {e}"))?);
    }
    progress("");
    Ok((speeds, rows))
}

/// The device in every precision that was not excluded; empty without an adapter, unless one was named.
fn contexts(arguments: &BenchArguments) -> Result<Vec<Arc<Context>>, String> {
    let options = GpuOptions {
        timestamps: true,
        ..arguments.gpu.options()
    };
    let named = options.adapter.is_some();
    let first = match Context::new(&options) {
        Ok(context) => context,
        Err(error) if named => return Err(message_of(&error)),
        Err(_) => return Ok(Vec::new()),
    };
    let mut contexts = vec![first];
    if options.precision.is_none() && contexts[0].precision == Precision::F64 {
        let options = GpuOptions {
            precision: Some(Precision::F32),
            ..options
        };
        contexts.push(Context::new(&options).map_err(|e| message_of(&e))?);
    }
    Ok(contexts)
}

fn speeds_table(speeds: &[Speeds]) -> String {
    let mut text = format!(
        "{:8} {:>9}  {:>9} {:>9} {:>5}  {:>9}  {:>10} {:>10} {:>6}  {:>4}  {:>8} {:>10}\n",
        "where",
        "n",
        "copy GB/s",
        "Kx GB/s",
        "%",
        "µs/launch",
        "iteration",
        "floor ms",
        "ratio",
        "its",
        "set-up s",
        "launch/it"
    );
    for s in speeds {
        text += &format!(
            "{:8} {:9}  {:9.1} {:9.1} {:5.0}  {:9.2}  {:7.3} ms {:10.3} {:6.1}  {:4}  {:8.3} {:10.1}\n",
            s.path,
            s.n,
            s.copy / 1e9,
            s.product / 1e9,
            100.0 * s.product / s.copy,
            1e6 * s.dispatch,
            1e3 * s.iteration,
            1e3 * s.iteration_floor,
            s.iteration / s.iteration_floor,
            s.iterations,
            s.set_up,
            s.dispatches,
        );
    }
    text + "\n"
}

/// The kernels of an iteration, the slowest first; empty without times.
fn kernels_table(speeds: &Speeds) -> String {
    if speeds.kernels.is_empty() {
        return String::new();
    }
    let total: f64 = speeds.kernels.iter().map(|k| k.seconds).sum();
    let mut text = format!(
        "{}, n = {}, {} iterations\n{:18} {:>9}  {:>9}  {:>10}  {:>6}  {:>8}  {:>6}\n",
        speeds.path,
        speeds.n,
        speeds.iterations,
        "kernel",
        "rows",
        "launch/it",
        "µs/launch",
        "time %",
        "GB/s",
        "copy %"
    );
    for k in &speeds.kernels {
        let rate = k.bytes as f64 / k.seconds.max(1e-12);
        text += &format!(
            "{:18} {:9}  {:9.1}  {:10.2}  {:6.1}  {:8.1}  {:6.0}\n",
            k.kernel,
            k.count,
            k.dispatches as f64 / speeds.iterations.max(1) as f64,
            1e6 * k.seconds / k.dispatches as f64,
            100.0 * k.seconds / total,
            rate / 1e9,
            100.0 * rate / speeds.copy,
        );
    }
    text + "\n"
}

fn rows_table(rows: &[Row]) -> String {
    let mut text = format!(
        "{:13} {:>3} {:>9}  {:>8} {:>8} {:>8}  {:>4} {:>4} {:>8} {:>6} {:>10} {:>8} {:>6}  {:>10} {:>10}  status\n",
        "path",
        "k",
        "n",
        "set-up s",
        "solve s",
        "total s",
        "iter",
        "n_A",
        "V-cycles",
        "ratio",
        "ms/V-cycle",
        "floor ms",
        "MiB",
        "difference",
        "other sets"
    );
    for r in rows {
        let optional = |value: Option<String>| value.unwrap_or_else(|| "–".to_owned());
        text += &format!(
            "{:13} {:3} {:9}  {:8.3} {:8.3} {:8.3}  {:4} {:4} {:>8} {:>6} {:>10} {:>8} {:>6}  {:10.1e} {:10}  {}\n",
            r.path,
            r.k,
            r.n,
            r.set_up,
            r.solve,
            r.total,
            r.iter,
            r.n_a,
            optional(r.v_cycles.map(|v| v.to_string())),
            optional(r.work_ratio.map(|w| format!("{w:.1}"))),
            optional(r.per_v_cycle.map(|s| format!("{:.2}", 1e3 * s))),
            optional(r.iteration_floor.map(|s| format!("{:.2}", 1e3 * s))),
            optional(r.peak_memory_mib.map(|m| format!("{m:.0}"))),
            r.difference,
            r.other_sets,
            match r.status {
                Status::Converged => "converged",
                _ => "NOT converged",
            }
        );
    }
    text + "\n"
}

/// Growth exponents of set-up and solve per path.
fn fits(rows: &[Row]) -> BTreeMap<&str, [f64; 2]> {
    let mut paths: Vec<&str> = rows.iter().map(|r| r.path.as_str()).collect();
    paths.sort_unstable();
    paths.dedup();
    let fit = |path: &str, seconds: fn(&Row) -> f64| {
        let of_path = rows.iter().filter(|r| r.path == path);
        bench::growth(of_path.map(|r| (r.n, seconds(r))))
    };
    paths
        .into_iter()
        .filter_map(|path| {
            let both = fit(path, |r| r.set_up).zip(fit(path, |r| r.solve));
            both.map(|(set_up, solve)| (path, [set_up, solve]))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solid_is_measured_on_both_paths() {
        let sizes = Sizes {
            k: vec![4],
            max_cholesky: 900,
        };
        let case_c = |q| CASE_C.problem(q, SolidShape::Hexahedron);
        let (speeds, rows) = measure(&sizes, &[], case_c).unwrap_or_else(|error| panic!("{error}"));
        assert_eq!(speeds.len(), 1);
        assert!(speeds[0].n == 900 && speeds[0].iterations > 0, "{speeds:?}");
        let paths: Vec<&str> = rows.iter().map(|row| row.path.as_str()).collect();
        assert_eq!(paths, ["cpu cholesky", "cpu pcg"]);
        for row in &rows {
            assert_eq!((row.n, row.m, row.status), (900, 60, Status::Converged));
            assert!(row.difference < 1e-3, "{row:?}");
        }
    }
}
