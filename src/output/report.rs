//! What `report.json` says.

use super::{ContactFields, NodeStatus, hints, peak_memory_mib};
use crate::backend::Precision;
use crate::case::Build;
use crate::contact::Space;
use crate::control::Costs;
use crate::dual::DualOperator as _;
use crate::elasticity::internal_forces;
use crate::engine::Engine;
use crate::mesh::vector::length;
use crate::mesh::{Kind, Topology};
use crate::model::{Elastic, StepData, Units};
use crate::problem::Kkt;
use crate::quasistatic::{Round, StepSolution};
use crate::ssnm::{self, SetSizes, SlipSizes, Status};
use serde::Serialize;

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
    /// `cpu` or `gpu`.
    pub backend: &'static str,
    /// The GPU.
    pub adapter: Option<String>,
    /// Of its kernels.
    pub precision: Precision,
    /// `cholesky` or `pcg`.
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
#[derive(Clone, Debug, Default, Serialize)]
pub struct ContactReport {
    /// The boundary that carries the multipliers.
    pub boundary: String,
    /// The other boundary, or what kind of obstacle.
    pub against: String,
    /// The law and its figure.
    pub friction: String,
    /// Resultant on the body of `boundary` along the axes, in the unit of force as all that follow.
    pub force: Vec<f64>,
    /// Σ λν.
    pub normal_force: f64,
    /// −Σ λτ: along the tangents, as the traction on the body; in space the length of the resultant of friction.
    pub tangential_force: f64,
    /// The largest nodal pressure.
    pub max_pressure: f64,
    /// Area in contact.
    pub area: f64,
    /// Nodes that touch nothing.
    pub separated: usize,
    /// Nodes in contact, their traction below the slip bound.
    pub stick: usize,
    /// Nodes in contact, their traction at the slip bound.
    pub slip: usize,
    /// Nodes in contact without a law of friction.
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
    /// Resultant on the body along the axes, in N; a component that two supports hold counts for the first.
    pub force: Vec<f64>,
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
    /// The common load factor.
    pub factor: f64,
    /// How it ended.
    pub status: Status,
    /// Solves in it: more than one where Coulomb's law took rounds with frozen slip bounds.
    pub rounds: usize,
    /// max |μλν − g| / max μλν of the last solve; 0 where no slip bounds were frozen.
    pub friction_change: f64,
    /// The bodies that contact and friction do not hold, and which way the loads push them.
    pub not_held: Vec<NotHeldReport>,
    /// Outer steps of all its solves.
    pub iter: usize,
    /// Products with A of all its solves.
    #[serde(rename = "n_A")]
    pub n_a: usize,
    /// The sets at its end.
    pub sets: SetSizes,
    /// The optimality conditions at its end.
    pub kkt: Kkt,
    /// Resultant of all loads along the axes, in N; null in an algebraic case, as the two lists are empty there.
    pub total_load: Option<Vec<f64>>,
    /// In the order of the case.
    pub contacts: Vec<ContactReport>,
    /// In the order of the case.
    pub supports: Vec<SupportReport>,
}

/// An outer step in the report.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HistoryRow {
    /// The load step, from 1.
    pub load_step: usize,
    /// The solve in it, from 1.
    pub round: usize,
    /// Whether slip bounds were frozen in it.
    #[serde(skip)]
    pub frozen: bool,
    /// What was done in it, and how far it has come.
    #[serde(flatten)]
    pub step: ssnm::Step,
}

/// Everything `report.json` says; docs/case-file.md has the meaning of each entry.
#[derive(Debug, Serialize)]
pub struct Report {
    /// That of the case.
    pub title: String,
    /// What lengths, forces and stresses are called.
    pub units: Units,
    /// That of the last step made; None, and "error" in the file, if an error has ended the run.
    #[serde(serialize_with = "or_error")]
    pub status: Option<Status>,
    /// The error that has ended the run; the steps before it are complete.
    pub error: Option<String>,
    /// What the figures suggest to look at.
    pub hints: Vec<String>,
    /// Unknowns that are not prescribed.
    pub n: usize,
    /// Contact nodes.
    pub m: usize,
    /// Outer steps of the whole run.
    pub iter: usize,
    /// Products with A of the whole run.
    #[serde(rename = "n_A")]
    pub n_a: usize,
    /// Those for σ_max, not among them.
    #[serde(rename = "n_A_sigma")]
    pub n_a_sigma: usize,
    /// err / err⁰ at the end of the last solve.
    pub err_relative: f64,
    /// ρ of the last solve.
    pub rho: f64,
    /// The estimate of the largest eigenvalue of A in it.
    pub sigma_max: f64,
    /// Applications of the preconditioner; null on the direct path.
    pub v_cycles: Option<usize>,
    /// Those of one linear solve with K to 1e-8, where they were counted.
    pub v_cycles_linear: Option<usize>,
    /// `v_cycles` / `v_cycles_linear`.
    pub work_ratio: Option<f64>,
    /// Which arithmetic has made it.
    #[serde(flatten)]
    pub path: EnginePath,
    /// The sets at the end of the last step.
    pub sets: SetSizes,
    /// The optimality conditions at the end of the last step.
    pub kkt: Kkt,
    /// The load steps made.
    pub steps: Vec<StepReport>,
    /// Where the time has gone.
    pub timings: Timings,
    /// The largest resident size of the process, where the system tells.
    pub peak_memory_mib: Option<f64>,
    /// That of signorini.
    pub version: &'static str,
    /// The outer steps of all solves.
    pub history: Vec<HistoryRow>,
    /// Products with A so far and the change of the slip bounds, after each round with frozen ones; a pair of NaN where a
    /// load step begins that has such rounds.
    #[serde(skip)]
    pub friction_history: Vec<(f64, f64)>,
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
    pub fn new<const D: usize>(title: &str, build: &Build<D>) -> Self
    where
        Kind: Topology<D>,
    {
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
            sets: SetSizes {
                slip: SlipSizes::none::<D>(),
                ..SetSizes::default()
            },
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
    pub fn add_step<const D: usize>(
        &mut self,
        build: &Build<D>,
        data: Option<&StepData<D>>,
        solution: &StepSolution<D>,
    ) where
        Kind: Space<D>,
    {
        let last = solution.last();
        let sets = solution.sets.sizes(|i| build.problem.has_friction(i));
        self.status = Some(solution.status);
        self.err_relative = last.info.err_relative;
        self.rho = last.info.rho;
        self.sigma_max = last.info.sigma_max;
        self.sets = sets;
        self.kkt = solution.kkt;
        self.add_rounds(&solution.rounds);
        let (contacts, supports) = match (&build.elastic, data) {
            (Some(elastic), Some(data)) => {
                let fields = ContactFields::new(build, elastic, data, solution);
                let contacts = contact_reports(elastic, solution, &fields);
                self.hints = hints::hints(elastic, data, solution, &fields, &contacts);
                (contacts, support_reports(elastic, data, solution))
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
            iter: solution.iter(),
            n_a: solution.n_a(),
            sets,
            kkt: solution.kkt,
            total_load: data.map(|data| data.total_load.to_vec()),
            contacts,
            supports,
        });
    }

    /// Adds the counts, times and outer steps of the solves of a step.
    fn add_rounds(&mut self, rounds: &[Round]) {
        if rounds.iter().any(|round| round.frozen) {
            // A gap between load steps.
            self.friction_history.push((f64::NAN, f64::NAN));
        }
        for round in rounds {
            let info = &round.info;
            self.iter += info.iter;
            self.n_a += info.n_a;
            self.n_a_sigma += info.n_a_sigma;
            self.timings.setup += info.setup_seconds;
            self.timings.ssnm += info.solve_seconds;
            if round.frozen {
                let change = (self.n_a as f64, round.friction_change);
                self.friction_history.push(change);
            }
            self.history
                .extend(info.history.iter().map(|&step| HistoryRow {
                    load_step: self.steps.len() + 1,
                    round: round.round,
                    frozen: round.frozen,
                    step,
                }));
        }
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

/// The forces of the contact nodes on their body along the axes: those of pressure and those of friction.
fn contact_forces<'a, const D: usize>(
    elastic: &'a Elastic<D>,
    solution: &'a StepSolution<D>,
) -> impl Iterator<Item = [[f64; D]; 2]> + 'a
where
    Kind: Topology<D>,
{
    let (normal, tangential) = solution.lambda.split_at(elastic.contact.nodes.len());
    let nodes = elastic.contact.nodes.iter().zip(normal);
    (nodes.zip(tangential.chunks(D - 1))).map(|((node, normal), tangential)| {
        let tangents = || node.frame[1..].iter().zip(tangential);
        [
            node.frame[0].map(|nu| -normal * nu),
            std::array::from_fn(|c| -tangents().map(|(tau, force)| force * tau[c]).sum::<f64>()),
        ]
    })
}

/// What the contacts carry.
fn contact_reports<const D: usize>(
    elastic: &Elastic<D>,
    solution: &StepSolution<D>,
    fields: &ContactFields<D>,
) -> Vec<ContactReport>
where
    Kind: Topology<D>,
{
    let (normal, tangential) = solution.lambda.split_at(elastic.contact.nodes.len());
    let mut contacts: Vec<ContactReport> = (elastic.pairs.iter())
        .map(|pair| ContactReport {
            boundary: pair.boundary.clone(),
            against: pair.against.clone(),
            friction: pair.friction.clone(),
            force: vec![0.0; D],
            ..Default::default()
        })
        .collect();
    let mut friction = vec![[0.0; D]; contacts.len()];
    for (i, [pressed, rubbed]) in contact_forces(elastic, solution).enumerate() {
        let pair = elastic.pair_of[i] as usize;
        let contact = &mut contacts[pair];
        for c in 0..D {
            contact.force[c] += pressed[c] + rubbed[c];
            friction[pair][c] += rubbed[c];
        }
        contact.normal_force += normal[i];
        if D == 2 {
            contact.tangential_force -= tangential[i];
        }
        contact.max_pressure = contact.max_pressure.max(fields.pressure[i]);
        let status = fields.status(i);
        *match status {
            NodeStatus::Separated => &mut contact.separated,
            NodeStatus::Stick => &mut contact.stick,
            NodeStatus::Slip => &mut contact.slip,
            NodeStatus::Frictionless => &mut contact.frictionless,
        } += 1;
        if status != NodeStatus::Separated {
            contact.area += elastic.contact.nodes[i].area;
        }
    }
    if D == 3 {
        for (contact, friction) in contacts.iter_mut().zip(friction) {
            contact.tangential_force = length(friction);
        }
    }
    for (pressure, &pair) in fields.pressure.iter().zip(&elastic.pair_of) {
        let contact = &mut contacts[pair as usize];
        contact.peak_nodes += usize::from(*pressure > PEAK * contact.max_pressure);
    }
    contacts
}

/// What the supports carry: inner forces less all others at the nodes that they hold.
fn support_reports<const D: usize>(
    elastic: &Elastic<D>,
    data: &StepData<D>,
    solution: &StepSolution<D>,
) -> Vec<SupportReport>
where
    Kind: Space<D>,
{
    let mut outer = data.forces.clone();
    let forces = contact_forces(elastic, solution);
    for (node, [pressed, rubbed]) in (elastic.contact.nodes.iter()).zip(forces) {
        for c in 0..D {
            let force = pressed[c] + rubbed[c];
            outer[node.node as usize][c] += force;
            for &(partner, weight) in &node.partners {
                outer[partner as usize][c] -= weight * force;
            }
        }
    }
    let displacement = data.unknowns.displacements(&solution.u);
    let inner = internal_forces(&elastic.body(), &data.unknowns, &displacement);
    let mut supports: Vec<SupportReport> = (elastic.supports.iter())
        .map(|name| SupportReport {
            support: name.clone(),
            force: vec![0.0; D],
        })
        .collect();
    for &(node, c, number) in &elastic.held {
        supports[number].force[c] += inner[node as usize][c] - outer[node as usize][c];
    }
    supports
}
