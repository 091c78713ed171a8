//! What a solve leaves behind: `report.json`, `solution.vtu`, `contact.csv`, or the vectors of an
//! algebraic case.

mod vtu;

use crate::backend::gpu::Precision;
use crate::case::{Build, Elastic};
use crate::dual::{Costs, DualOperator as _};
use crate::elasticity::stresses;
use crate::engine::Engine;
use crate::matrix_market::vector_text;
use crate::ssnm::{Sets, Solution};
use serde::Serialize;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// A result could not be written.
#[derive(Debug, thiserror::Error)]
#[error("cannot write {}: {source}", path.display())]
pub struct OutputError {
    path: PathBuf,
    source: std::io::Error,
}

/// Seconds of the phases of a solve.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Timings {
    /// Reading or making the mesh, or reading the matrices.
    pub mesh: f64,
    /// K, f, N, T, d, g, and their validation.
    pub assembly: f64,
    /// b and σ_max.
    pub setup: f64,
    /// Ordering, symbolic and numeric factorisation, and the probe solve; or moving K to where PCG runs.
    pub factor: f64,
    /// Outer steps and the final check.
    pub ssnm: f64,
    /// Stress recovery and files (those written before the report).
    pub output: f64,
    /// All of the above.
    pub total: f64,
    /// The factorisation and one solve with K, measured in this run; None without a factor.
    pub linear_reference: Option<f64>,
}

/// Which arithmetic has made a solution.
#[derive(Clone, Debug, Serialize)]
pub struct EnginePath {
    pub backend: &'static str,
    pub adapter: Option<String>,
    pub precision: Precision,
    pub stiffness: &'static str,
    /// Systems with K, PCG iterations, dispatches; None on the direct path.
    pub costs: Option<Costs>,
    /// PCG iterations of one system with K to 1e-8, where they were counted.
    #[serde(skip)]
    pub v_cycles_linear: Option<usize>,
}

impl EnginePath {
    /// That of an engine, as it is after a solve.
    pub fn of(engine: &Engine) -> Self {
        Self {
            v_cycles_linear: None,
            backend: engine.backend(),
            adapter: engine.adapter(),
            precision: engine.precision(),
            stiffness: engine.stiffness(),
            costs: engine.costs(),
        }
    }
}

/// Everything `report.json` says; see the README for the meaning of each entry.
#[derive(Debug, Serialize)]
pub struct Report<'a> {
    pub title: &'a str,
    pub status: crate::ssnm::Status,
    pub n: usize,
    pub m: usize,
    pub iter: usize,
    #[serde(rename = "n_A")]
    pub n_a: usize,
    #[serde(rename = "n_A_sigma")]
    pub n_a_sigma: usize,
    pub err_relative: f64,
    pub rho: f64,
    pub sigma_max: f64,
    /// Applications of the preconditioner; null on the direct path.
    pub v_cycles: Option<usize>,
    pub v_cycles_linear: Option<usize>,
    pub work_ratio: Option<f64>,
    #[serde(flatten)]
    pub path: EnginePath,
    pub sets: crate::ssnm::SetSizes,
    pub kkt: crate::problem::Kkt,
    pub timings: Timings,
    pub peak_memory_mib: Option<f64>,
    pub version: &'static str,
    pub history: &'a [crate::ssnm::Step],
}

impl<'a> Report<'a> {
    /// The report of a solution.
    pub fn new(
        title: &'a str,
        build: &Build,
        solution: &'a Solution,
        path: EnginePath,
        timings: Timings,
    ) -> Self {
        let info = &solution.info;
        Self {
            title,
            status: solution.status,
            n: build.problem.n_free(),
            m: build.problem.m(),
            iter: info.iter,
            n_a: info.n_a,
            n_a_sigma: info.n_a_sigma,
            err_relative: info.err_relative,
            rho: info.rho,
            sigma_max: info.sigma_max,
            v_cycles: path.costs.map(|costs| costs.solves.iterations),
            v_cycles_linear: path.v_cycles_linear,
            work_ratio: path
                .costs
                .zip(path.v_cycles_linear)
                .map(|(costs, linear)| costs.solves.iterations as f64 / linear.max(1) as f64),
            path,
            sets: solution.sets.sizes(),
            kkt: info.kkt,
            timings,
            peak_memory_mib: peak_memory_mib(),
            version: env!("CARGO_PKG_VERSION"),
            history: &info.history,
        }
    }
}

/// The largest resident size of this process so far, where the system tells.
pub fn peak_memory_mib() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kib: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib / 1024.0)
}

/// Starts the count of [`peak_memory_mib`] anew from what is held now; false where the system cannot.
pub fn forget_peak_memory() -> bool {
    // 5 resets the peak of the resident size: proc_pid_clear_refs(5).
    std::fs::write("/proc/self/clear_refs", "5").is_ok()
}

fn write(path: PathBuf, contents: &[u8]) -> Result<PathBuf, OutputError> {
    match std::fs::write(&path, contents) {
        Ok(()) => Ok(path),
        Err(source) => Err(OutputError { path, source }),
    }
}

/// Writes the fields of a solution into `directory` (made if need be); returns the files.
pub fn write_solution(
    directory: &Path,
    build: &Build,
    solution: &Solution,
) -> Result<Vec<PathBuf>, OutputError> {
    std::fs::create_dir_all(directory).map_err(|source| OutputError {
        path: directory.to_owned(),
        source,
    })?;
    match &build.elastic {
        Some(elastic) => {
            let fields = ContactFields::new(build, elastic, solution);
            let displacement = elastic.unknowns.displacements(&solution.u);
            let (at_nodes, in_elements) = stresses(&elastic.body(), &displacement);
            let text = vtu::text(elastic, &displacement, &at_nodes, &in_elements, &fields);
            Ok(vec![
                write(directory.join("solution.vtu"), text.as_bytes())?,
                write(
                    directory.join("contact.csv"),
                    fields.csv(elastic).as_bytes(),
                )?,
            ])
        }
        None => {
            let (normal, tangential) = solution.lambda.split_at(build.problem.m());
            let u = &solution.u[..build.problem.n()];
            [
                ("u", u),
                ("lambda_normal", normal),
                ("lambda_tangential", tangential),
            ]
            .into_iter()
            .map(|(name, values)| {
                let path = directory.join(format!("{name}.mtx"));
                write(path, vector_text(values).as_bytes())
            })
            .collect()
        }
    }
}

/// Writes `report.json`.
pub fn write_report(directory: &Path, report: &Report) -> Result<PathBuf, OutputError> {
    let path = directory.join("report.json");
    let failed = |source: std::io::Error| OutputError {
        path: path.clone(),
        source,
    };
    std::fs::create_dir_all(directory).map_err(failed)?;
    let text = serde_json::to_string_pretty(report).map_err(|e| failed(e.into()))?;
    write(path, (text + "\n").as_bytes())
}

/// What happens at the contact nodes, in the units of the case.
pub struct ContactFields {
    /// Gap after loading, d − Nu.
    pub gap: Vec<f64>,
    /// Contact pressure λν / area, ≥ 0.
    pub pressure: Vec<f64>,
    /// Traction on the body along the tangent (ν turned counter-clockwise): −λτ / area.
    pub traction: Vec<f64>,
    /// Displacement along the tangent, Tu.
    pub slip: Vec<f64>,
    sets: Sets,
}

impl ContactFields {
    /// From a solution.
    pub fn new(build: &Build, elastic: &Elastic, solution: &Solution) -> Self {
        let m = build.problem.m();
        let (mut gap, mut slip) = (vec![0.0; m], vec![0.0; m]);
        build.problem.normal().mul(&solution.u, &mut gap);
        build.problem.tangential().mul(&solution.u, &mut slip);
        for (gap, d) in gap.iter_mut().zip(build.problem.gap()) {
            *gap = d - *gap;
        }
        let (normal, tangential) = solution.lambda.split_at(m);
        let per_area = |forces: &[f64], sign: f64| -> Vec<f64> {
            let areas = elastic.contact.iter().map(|node| node.area);
            // + 0.0 turns −0 into 0.
            forces
                .iter()
                .zip(areas)
                .map(|(f, a)| sign * f / a + 0.0)
                .collect()
        };
        Self {
            gap,
            pressure: per_area(normal, 1.0),
            traction: per_area(tangential, -1.0),
            slip,
            sets: solution.sets.clone(),
        }
    }

    /// The state of contact node i: `separated`, `stick` or `slip`.
    pub fn status(&self, i: usize) -> &'static str {
        if self.sets.is_separated(i) {
            "separated"
        } else if self.sets.slip_sign(i) == 0 {
            "stick"
        } else {
            "slip"
        }
    }

    /// `contact.csv`, in the order of the nodes along x, then y.
    fn csv(&self, elastic: &Elastic) -> String {
        let place = |i: usize| elastic.mesh.nodes[elastic.contact[i].node as usize];
        let mut order: Vec<usize> = (0..self.gap.len()).collect();
        order.sort_by(|&a, &b| {
            let (p, q) = (place(a), place(b));
            p[0].total_cmp(&q[0]).then(p[1].total_cmp(&q[1]))
        });
        let mut text = "x,y,gap,normal_pressure,tangential_traction,slip,status\n".to_owned();
        for i in order {
            let [x, y] = place(i);
            writeln!(
                text,
                "{x:e},{y:e},{:e},{:e},{:e},{:e},{}",
                self.gap[i],
                self.pressure[i],
                self.traction[i],
                self.slip[i],
                self.status(i)
            )
            .expect("writing to a string cannot fail");
        }
        text
    }
}
