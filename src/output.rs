//! What a solve leaves behind: `report.json`, `solution.vtu`, `contact.csv`, or the vectors of an
//! algebraic case.

pub mod chart;
mod hints;
mod html;
mod picture;
mod plots;
mod vtu;

use crate::backend::Precision;
use crate::case::{Build, Elastic, StepData, Units};
use crate::control::Costs;
use crate::dual::DualOperator as _;
use crate::elasticity::{Stress, internal_forces, stresses};
use crate::engine::Engine;
use crate::matrix_market::vector_text;
use crate::problem::Kkt;
use crate::quasistatic::StepSolution;
use crate::ssnm::{self, SetSizes, Sets, Status};
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
    /// The part of it for the search and the integrals of the contacts.
    pub pairing: f64,
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
#[derive(Clone, Debug, Default, Serialize)]
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

/// A pressure above this part of the largest is near it: beside the edge of a punch it falls to 0.6 of it from one node
/// to the next, on any mesh.
const PEAK: f64 = 0.7;

/// What a contact carries at the end of a step.
#[derive(Clone, Debug, Serialize)]
pub struct ContactReport {
    pub boundary: String,
    pub against: String,
    pub friction: String,
    /// Resultant on the body of `boundary`, in the unit of force as all that follow.
    pub force: [f64; 2],
    /// Σ λν.
    pub normal_force: f64,
    /// −Σ λτ: along the tangents, as the traction on the body.
    pub tangential_force: f64,
    pub max_pressure: f64,
    /// Area in contact.
    pub area: f64,
    pub separated: usize,
    pub stick: usize,
    pub slip: usize,
    /// In contact, without a law of friction.
    pub frictionless: usize,
    /// Nodes with a pressure near the largest: above 0.7 of it.
    #[serde(skip)]
    pub peak_nodes: usize,
}

/// What a support carries at the end of a step.
#[derive(Clone, Debug, Serialize)]
pub struct SupportReport {
    /// Its boundary or point.
    pub support: String,
    /// Resultant on the body, in N; a component that two supports hold counts for the first.
    pub force: [f64; 2],
}

/// A body that contact and friction do not hold.
#[derive(Clone, Debug, Serialize)]
pub struct NotHeldReport {
    /// Which body it is.
    pub body: String,
    /// Which way the loads push it.
    pub motion: String,
}

/// A load step in the report.
#[derive(Clone, Debug, Serialize)]
pub struct StepReport {
    pub factor: f64,
    pub status: Status,
    /// Solves in it: more than one where Coulomb's law took rounds with frozen slip bounds.
    pub rounds: usize,
    /// max |μλν − g| / max μλν of the last solve; 0 where no slip bounds were frozen.
    pub friction_change: f64,
    /// The bodies that contact and friction do not hold, and which way the loads push them.
    pub not_held: Vec<NotHeldReport>,
    /// Whether there is Coulomb friction.
    #[serde(skip)]
    pub coulomb: bool,
    pub iter: usize,
    #[serde(rename = "n_A")]
    pub n_a: usize,
    pub sets: SetSizes,
    pub kkt: Kkt,
    /// Resultant of all loads, in N; null in an algebraic case, as the two lists are empty there.
    pub total_load: Option<[f64; 2]>,
    pub contacts: Vec<ContactReport>,
    pub supports: Vec<SupportReport>,
}

/// An outer step in the report.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HistoryRow {
    /// The load step and the solve in it, from 1.
    pub load_step: usize,
    pub round: usize,
    /// Whether slip bounds were frozen in it.
    #[serde(skip)]
    pub frozen: bool,
    #[serde(flatten)]
    pub step: ssnm::Step,
}

/// Everything `report.json` says; see the README for the meaning of each entry.
#[derive(Debug, Serialize)]
pub struct Report {
    pub title: String,
    pub units: Units,
    /// That of the last step made; None, and "error" in the file, if an error has ended the run.
    #[serde(serialize_with = "or_error")]
    pub status: Option<Status>,
    /// The error that has ended the run; the steps before it are complete.
    pub error: Option<String>,
    /// What the figures suggest to look at.
    pub hints: Vec<String>,
    pub n: usize,
    pub m: usize,
    /// Outer steps and products with A of the whole run.
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
    /// The sets and the optimality conditions at the end of the last step.
    pub sets: SetSizes,
    pub kkt: Kkt,
    pub steps: Vec<StepReport>,
    pub timings: Timings,
    pub peak_memory_mib: Option<f64>,
    pub version: &'static str,
    pub history: Vec<HistoryRow>,
    /// Products with A so far and the change of the slip bounds, after each round with Coulomb friction.
    #[serde(skip)]
    friction_history: Vec<(f64, f64)>,
}

/// A status, or "error".
fn or_error<S: serde::Serializer>(status: &Option<Status>, to: S) -> Result<S::Ok, S::Error> {
    match status {
        Some(status) => status.serialize(to),
        None => to.serialize_str("error"),
    }
}

impl Report {
    /// Of a case of which no step is made yet.
    pub fn new(title: &str, build: &Build) -> Self {
        Self {
            title: title.to_owned(),
            units: (build.elastic.as_ref()).map_or_else(Units::default, |e| e.units.clone()),
            status: Some(Status::Interrupted),
            error: None,
            hints: Vec::new(),
            n: build.problem.n_free(),
            m: build.problem.m(),
            iter: 0,
            n_a: 0,
            n_a_sigma: 0,
            err_relative: 0.0,
            rho: 0.0,
            sigma_max: 0.0,
            v_cycles: None,
            v_cycles_linear: None,
            work_ratio: None,
            path: EnginePath::default(),
            sets: SetSizes::default(),
            kkt: Kkt::default(),
            steps: Vec::new(),
            timings: Timings::default(),
            peak_memory_mib: None,
            version: env!("CARGO_PKG_VERSION"),
            history: Vec::new(),
            friction_history: Vec::new(),
        }
    }

    /// Adds a step.
    pub fn add_step(&mut self, build: &Build, data: Option<&StepData>, solution: &StepSolution) {
        let number = self.steps.len() + 1;
        let last = solution.last();
        self.status = Some(solution.status);
        let mut products = self.n_a;
        if solution.rounds.iter().any(|round| round.frozen) {
            // A gap between load steps.
            self.friction_history.push((f64::NAN, f64::NAN));
        }
        for round in &solution.rounds {
            products += round.info.n_a;
            if round.frozen {
                self.friction_history
                    .push((products as f64, round.friction_change));
            }
        }
        self.iter += solution.iter();
        self.n_a += solution.n_a();
        self.err_relative = last.info.err_relative;
        self.rho = last.info.rho;
        self.sigma_max = last.info.sigma_max;
        self.sets = solution.sets.sizes(|i| build.problem.has_friction(i));
        self.kkt = solution.kkt;
        for round in &solution.rounds {
            self.n_a_sigma += round.info.n_a_sigma;
            self.timings.setup += round.info.setup_seconds;
            self.timings.ssnm += round.info.solve_seconds;
            self.history
                .extend(round.info.history.iter().map(|&step| HistoryRow {
                    load_step: number,
                    round: round.round,
                    frozen: round.frozen,
                    step,
                }));
        }
        let (contacts, supports) = match (&build.elastic, data) {
            (Some(elastic), Some(data)) => {
                let fields = ContactFields::new(build, elastic, data, solution);
                let (contacts, supports) = reactions(build, elastic, data, solution, &fields);
                self.hints = hints::hints(elastic, data, solution, &fields, &contacts);
                (contacts, supports)
            }
            _ => Default::default(),
        };
        self.steps.push(StepReport {
            factor: data.map_or(1.0, |data| data.factor),
            status: solution.status,
            rounds: solution.rounds.len(),
            friction_change: last.friction_change,
            not_held: (solution.not_held.iter())
                .map(|one| NotHeldReport {
                    body: build.free_body_name(one.body),
                    motion: one.motion.clone(),
                })
                .collect(),
            coulomb: build.problem.has_coulomb(),
            iter: solution.iter(),
            n_a: solution.n_a(),
            sets: solution.sets.sizes(|i| build.problem.has_friction(i)),
            kkt: solution.kkt,
            total_load: data.map(|data| data.total_load),
            contacts,
            supports,
        });
    }

    /// Says that an error has ended the run.
    pub fn fail(&mut self, error: &str) {
        self.status = None;
        self.error = Some(error.to_owned());
    }

    /// Adds what has made it.
    pub fn set_path(&mut self, path: EnginePath) {
        self.v_cycles = path.costs.map(|costs| costs.solves.iterations);
        self.v_cycles_linear = path.v_cycles_linear;
        self.work_ratio = path
            .costs
            .zip(path.v_cycles_linear)
            .map(|(costs, linear)| costs.solves.iterations as f64 / linear.max(1) as f64);
        self.path = path;
        self.peak_memory_mib = peak_memory_mib();
    }
}

/// The resultants of contacts and supports on the bodies.
fn reactions(
    build: &Build,
    elastic: &Elastic,
    data: &StepData,
    solution: &StepSolution,
    fields: &ContactFields,
) -> (Vec<ContactReport>, Vec<SupportReport>) {
    let (normal, tangential) = solution.lambda.split_at(build.problem.m());
    let mut contacts: Vec<ContactReport> = elastic
        .pairs
        .iter()
        .map(|pair| ContactReport {
            boundary: pair.boundary.clone(),
            against: pair.against.clone(),
            friction: pair.friction.clone(),
            force: [0.0; 2],
            normal_force: 0.0,
            tangential_force: 0.0,
            max_pressure: 0.0,
            area: 0.0,
            separated: 0,
            stick: 0,
            slip: 0,
            frictionless: 0,
            peak_nodes: 0,
        })
        .collect();
    // What holds the nodes beside the loads: contact here, supports below.
    let mut outer = data.forces.clone();
    for (i, node) in elastic.contact.nodes.iter().enumerate() {
        let (nu, tau) = (node.normal, node.tangent());
        let force: [f64; 2] =
            std::array::from_fn(|c| -(normal[i] * nu[c] + tangential[i] * tau[c]));
        let pair = &mut contacts[elastic.pair_of[i] as usize];
        for c in 0..2 {
            pair.force[c] += force[c];
            outer[node.node as usize][c] += force[c];
            for &(partner, weight) in &node.partners {
                outer[partner as usize][c] -= weight * force[c];
            }
        }
        pair.normal_force += normal[i];
        pair.tangential_force -= tangential[i];
        pair.max_pressure = pair.max_pressure.max(fields.pressure[i]);
        match fields.status(i) {
            "separated" => pair.separated += 1,
            status => {
                pair.area += node.area;
                *match status {
                    "stick" => &mut pair.stick,
                    "slip" => &mut pair.slip,
                    _ => &mut pair.frictionless,
                } += 1;
            }
        }
    }
    for (i, &pair) in elastic.pair_of.iter().enumerate() {
        let pair = &mut contacts[pair as usize];
        pair.peak_nodes += usize::from(fields.pressure[i] > PEAK * pair.max_pressure);
    }
    let displacement = data.unknowns.displacements(&solution.u);
    let inner = internal_forces(&elastic.body(), &data.unknowns, &displacement);
    let mut supports: Vec<SupportReport> = elastic
        .supports
        .iter()
        .map(|name| SupportReport {
            support: name.clone(),
            force: [0.0; 2],
        })
        .collect();
    for &(node, c, number) in &elastic.held {
        supports[number].force[c] += inner[node as usize][c] - outer[node as usize][c];
    }
    (contacts, supports)
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

/// Writes a file beside its place and moves it there: under its name there is the old file or the new one, never half
/// of it.
pub fn write_whole(path: &Path, contents: &[u8]) -> Result<(), OutputError> {
    let failed = |source| OutputError {
        path: path.to_owned(),
        source,
    };
    // Pipes and devices are written as they are, and what a link points to stays in its place.
    let place = match std::fs::metadata(path) {
        Ok(there) if !there.is_file() => return std::fs::write(path, contents).map_err(failed),
        Ok(_) => std::fs::canonicalize(path).map_err(failed)?,
        Err(_) => path.to_owned(),
    };
    let mut name = std::ffi::OsString::from(".");
    name.push(place.file_name().unwrap_or_default());
    name.push(".part");
    let beside = place.with_file_name(name);
    let written = std::fs::write(&beside, contents).and_then(|()| std::fs::rename(&beside, &place));
    if written.is_err() {
        // It may not even exist.
        let _ = std::fs::remove_file(&beside);
    }
    written.map_err(failed)
}

fn write(path: PathBuf, contents: &[u8]) -> Result<PathBuf, OutputError> {
    write_whole(&path, contents).map(|()| path)
}

/// Makes the directory of the results, and tries whether files can be written there: not only after an hour.
pub fn prepare(directory: &Path) -> Result<(), OutputError> {
    make(directory)?;
    let path = directory.join(".signorini.part");
    let tried = std::fs::write(&path, b"").and_then(|()| std::fs::remove_file(&path));
    tried.map_err(|source| OutputError {
        path: directory.to_owned(),
        source,
    })
}

/// Displacements and stresses at the end of a step.
pub struct StepFields {
    /// Of every node.
    pub displacement: Vec<[f64; 2]>,
    /// Stresses at the nodes.
    pub at_nodes: Vec<Stress>,
    /// Stresses in the middle of the elements.
    pub in_elements: Vec<Stress>,
}

impl StepFields {
    /// From a solution.
    pub fn new(elastic: &Elastic, data: &StepData, solution: &StepSolution) -> Self {
        let displacement = data.unknowns.displacements(&solution.u);
        let (at_nodes, in_elements) = stresses(&elastic.body(), &displacement);
        Self {
            displacement,
            at_nodes,
            in_elements,
        }
    }
}

/// A picture of a solve.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The name of its file, without `.svg`.
    pub name: String,
    /// The load step it shows, from 1; None for the whole of them.
    pub step: Option<usize>,
    /// What it shows.
    pub title: String,
    /// The picture itself.
    pub svg: String,
}

/// The pictures at the end of the step that was added to the report last: the deformed bodies and a chart for
/// each contact. `several` says whether there are more steps, which goes into the names.
pub fn step_pictures(
    report: &Report,
    build: &Build,
    data: Option<&StepData>,
    solution: &StepSolution,
    several: bool,
) -> Vec<Picture> {
    let (Some(elastic), Some(data)) = (&build.elastic, data) else {
        return Vec::new();
    };
    let step = report.steps.len();
    let (suffix, of_step) = if several {
        (format!("-{step:03}"), format!(", load step {step}"))
    } else {
        Default::default()
    };
    let fields = StepFields::new(elastic, data, solution);
    let contact = ContactFields::new(build, elastic, data, solution);
    let title = if report.title.is_empty() {
        "Deformed bodies"
    } else {
        &report.title
    };
    let title = format!("{title}{of_step}");
    let mut pictures = vec![Picture {
        name: format!("deformed{suffix}"),
        step: Some(step),
        title: format!("Deformed bodies{of_step}"),
        svg: picture::svg(&title, step, elastic, &fields, &contact),
    }];
    for (i, pair) in elastic.pairs.iter().enumerate() {
        let number = match elastic.pairs.len() {
            1 => String::new(),
            _ => format!("-{}", i + 1),
        };
        let mut chart = plots::contact(elastic, &contact, i);
        chart.title += &of_step;
        pictures.push(Picture {
            name: format!("contact{number}{suffix}"),
            step: Some(step),
            title: format!("Contact {} / {}{of_step}", pair.boundary, pair.against),
            svg: chart.svg(),
        });
    }
    pictures
}

/// The pictures of the whole: the convergence, and the contact forces where there are several steps.
pub fn pictures(report: &Report) -> Vec<Picture> {
    let mut charts = vec![("convergence", plots::convergence(report))];
    if report.steps.len() > 1 && report.steps.iter().any(|s| !s.contacts.is_empty()) {
        charts.insert(0, ("steps", plots::steps(report)));
    }
    charts
        .into_iter()
        .map(|(name, chart)| Picture {
            name: name.to_owned(),
            step: None,
            title: chart.title.clone(),
            svg: chart.svg(),
        })
        .collect()
}

/// Writes pictures as `NAME.svg` and, with the whole report, into `report.html`.
pub fn write_pictures(
    directory: &Path,
    report: &Report,
    pictures: &[Picture],
) -> Result<Vec<PathBuf>, OutputError> {
    make(directory)?;
    let mut files = Vec::new();
    for picture in pictures {
        let path = directory.join(format!("{}.svg", picture.name));
        files.push(write(path, picture.svg.as_bytes())?);
    }
    let page = html::page(report, pictures);
    files.push(write(directory.join("report.html"), page.as_bytes())?);
    Ok(files)
}

/// Writes the fields of a step into `directory` (made if need be); returns the files. `number` is that of the
/// step where there are several, and goes into the names.
pub fn write_solution(
    directory: &Path,
    build: &Build,
    data: Option<&StepData>,
    solution: &StepSolution,
    number: Option<usize>,
) -> Result<Vec<PathBuf>, OutputError> {
    make(directory)?;
    match (&build.elastic, data) {
        (Some(elastic), Some(data)) => {
            let fields = ContactFields::new(build, elastic, data, solution);
            let text = vtu::text(elastic, &StepFields::new(elastic, data, solution), &fields);
            let suffix = number.map_or(String::new(), |number| format!("-{number:03}"));
            Ok(vec![
                write(
                    directory.join(format!("solution{suffix}.vtu")),
                    text.as_bytes(),
                )?,
                write(
                    directory.join(format!("contact{suffix}.csv")),
                    fields.csv(elastic).as_bytes(),
                )?,
            ])
        }
        _ => {
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

/// Writes `solution.pvd`, the index of the steps 1 … n for ParaView, with their load factors as times where
/// these increase, their numbers otherwise.
pub fn write_index(directory: &Path, steps: &[StepReport]) -> Result<PathBuf, OutputError> {
    make(directory)?;
    let increase = steps.windows(2).all(|w| w[0].factor < w[1].factor);
    let mut text =
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n"
            .to_owned();
    for (i, step) in steps.iter().enumerate() {
        let time = if increase {
            step.factor
        } else {
            (i + 1) as f64
        };
        writeln!(
            text,
            "<DataSet timestep=\"{time}\" part=\"0\" file=\"solution-{:03}.vtu\"/>",
            i + 1
        )
        .expect("writing to a string cannot fail");
    }
    text.push_str("</Collection>\n</VTKFile>\n");
    write(directory.join("solution.pvd"), text.as_bytes())
}

fn make(directory: &Path) -> Result<(), OutputError> {
    std::fs::create_dir_all(directory).map_err(|source| OutputError {
        path: directory.to_owned(),
        source,
    })
}

/// Writes `report.json`.
pub fn write_report(directory: &Path, report: &Report) -> Result<PathBuf, OutputError> {
    make(directory)?;
    let path = directory.join("report.json");
    let failed = |source: std::io::Error| OutputError {
        path: path.clone(),
        source,
    };
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
    /// The slip bound g / area that the traction obeys.
    pub bound: Vec<f64>,
    /// Displacement along the tangent relative to the other side, Tu.
    pub slip: Vec<f64>,
    /// Whether a law of friction acts on the node.
    has_friction: Vec<bool>,
    sets: Sets,
}

impl ContactFields {
    /// At the end of a step.
    pub fn new(build: &Build, elastic: &Elastic, data: &StepData, solution: &StepSolution) -> Self {
        let m = build.problem.m();
        let (mut gap, mut slip) = (vec![0.0; m], vec![0.0; m]);
        build.problem.normal().mul(&solution.u, &mut gap);
        build.problem.tangential().mul(&solution.u, &mut slip);
        for i in 0..m {
            gap[i] = data.load.gap[i] - gap[i];
            slip[i] += data.load.slide[i];
        }
        let (normal, tangential) = solution.lambda.split_at(m);
        let per_area = |forces: &[f64], sign: f64| -> Vec<f64> {
            let areas = elastic.contact.nodes.iter().map(|node| node.area);
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
            bound: per_area(&solution.slip_bound, 1.0),
            slip,
            has_friction: (0..m).map(|i| build.problem.has_friction(i)).collect(),
            sets: solution.sets.clone(),
        }
    }

    /// The state of contact node i: `separated`; `contact` where no law of friction acts, else `stick` or `slip`.
    pub fn status(&self, i: usize) -> &'static str {
        if self.sets.is_separated(i) {
            "separated"
        } else if !self.has_friction[i] {
            "contact"
        } else if self.sets.slip_sign(i) == 0 && self.bound[i] > 0.0 {
            "stick"
        } else {
            "slip"
        }
    }

    /// `contact.csv`, in the order of the contacts, of the nodes along x, then y.
    fn csv(&self, elastic: &Elastic) -> String {
        let place = |i: usize| elastic.mesh.nodes[elastic.contact.nodes[i].node as usize];
        let mut order: Vec<usize> = (0..self.gap.len()).collect();
        order.sort_by(|&a, &b| {
            let (p, q) = (place(a), place(b));
            let pairs = elastic.pair_of[a].cmp(&elastic.pair_of[b]);
            pairs
                .then(p[0].total_cmp(&q[0]))
                .then(p[1].total_cmp(&q[1]))
        });
        let mut text = if elastic.units_stated {
            let (length, stress) = (&elastic.units.length, elastic.units.stress());
            format!(
                "x [{length}],y [{length}],gap [{length}],normal_pressure [{stress}],\
                 tangential_traction [{stress}],slip [{length}],status,contact\n"
            )
        } else {
            "x,y,gap,normal_pressure,tangential_traction,slip,status,contact\n".to_owned()
        };
        for i in order {
            let [x, y] = place(i);
            writeln!(
                text,
                "{x:e},{y:e},{:e},{:e},{:e},{:e},{},{}",
                self.gap[i],
                self.pressure[i],
                self.traction[i],
                self.slip[i],
                self.status(i),
                csv_text(&elastic.pairs[elastic.pair_of[i] as usize].boundary)
            )
            .expect("writing to a string cannot fail");
        }
        text
    }
}

/// A text as a field of a CSV file.
fn csv_text(text: &str) -> String {
    if text.contains([',', '"', '\n']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}
