//! The content of `report.json`.

use super::energy::{Before, EnergyReport, energy};
use super::hints::{self, Moved};
use super::reactions::{ContactReport, SupportReport, contact_reports, support_reports};
use super::{OfBodies, StepResults, peak_memory_mib};
use crate::backend::Precision;
use crate::contact::Space;
use crate::control::Costs;
use crate::dual::DualOperator as _;
use crate::engine::Engine;
use crate::mesh::{Census, ElementKind, Topology};
use crate::model::{Analysis, Elastic, Units};
use crate::problem::{ContactProblem, Kkt};
use crate::quasistatic::{Round, StepSolution};
use crate::ssnm::{self, SetSizes, SlipSizes, Status};
use serde::Serialize;
use std::collections::BTreeMap;

/// Seconds of the phases of a solve.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Timings {
    /// Reading or making the mesh, or reading and checking the matrices.
    pub mesh: f64,
    /// K, f, N, T, d, g, and their validation; 0 where they are read.
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

/// The devices and methods behind a solution.
#[derive(Clone, Debug, Default, Serialize)]
pub struct EnginePath {
    /// `cpu` or `gpu`.
    pub backend: &'static str,
    /// The GPU.
    pub adapter: Option<String>,
    /// The precision of its kernels.
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
    /// The path of an engine after a solve.
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

/// A body that contact and friction do not hold.
#[derive(Clone, Debug, Serialize)]
pub struct NotHeldReport {
    /// The body.
    pub body: String,
    /// The direction in which the loads push it.
    pub motion: String,
    /// Whether this is proven: [`crate::quasistatic::NotHeld::proven`].
    pub proven: bool,
}

/// A load step in the report.
#[derive(Clone, Debug, Serialize)]
pub struct StepReport {
    /// Its cycle, from 1, where load steps are repeated; cycles between those that are listed were left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycle: Option<usize>,
    /// The common load factor.
    pub factor: f64,
    /// Its end.
    pub status: Status,
    /// Solves in it: more than one if monolithic steps made no progress under Coulomb's law.
    pub rounds: usize,
    /// The bodies that contact and friction do not hold, and which way the loads push them.
    pub not_held: Vec<NotHeldReport>,
    /// With large displacements: contact problems at positions of the bodies on the way.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub iterations: Option<usize>,
    /// Where displacements are large: the number of parts of the step, which is divided where Newton's method does not converge.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parts: Option<usize>,
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
    /// Missing in an algebraic case, and where temperatures act: they do work of their own.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub energy: Option<EnergyReport>,
}

/// The forces on the supports, and the energy.
pub(crate) type Balance = (Vec<SupportReport>, Option<EnergyReport>);

/// An outer step in the report.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct HistoryRow {
    /// The load step, from 1.
    pub load_step: usize,
    /// The solve in it, from 1.
    pub round: usize,
    /// The work in it, and its end.
    #[serde(flatten)]
    pub step: ssnm::Step,
}

/// Everything in `report.json`; docs/case-file.md has the meaning of each entry.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The title of the case.
    pub title: String,
    /// The names of lengths, forces and stresses.
    pub units: Units,
    /// The status of the last step made; None, and "error" in the file, if an error has ended the run.
    #[serde(serialize_with = "or_error")]
    pub status: Option<Status>,
    /// The error that has ended the run; the steps before it are complete.
    pub error: Option<String>,
    /// The hints.
    pub hints: Vec<String>,
    /// The number of elements of each kind in the mesh, under the [short names](ElementKind::name); none in an algebraic
    /// case.
    pub elements: BTreeMap<&'static str, usize>,
    /// The highest order of elements: 1 or 2; null in an algebraic case.
    pub order: Option<usize>,
    /// Unknowns that are not prescribed.
    pub n: usize,
    /// Contact nodes.
    pub m: usize,
    /// Outer steps of the whole run.
    pub iter: usize,
    /// Products with A of the whole run.
    #[serde(rename = "n_A")]
    pub n_a: usize,
    /// The products for σ_max, not included.
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
    /// The V-cycles of one linear solve with K to 1e-8, if they were counted.
    pub v_cycles_linear: Option<usize>,
    /// `v_cycles` / `v_cycles_linear`.
    pub work_ratio: Option<f64>,
    /// The devices and methods behind it.
    #[serde(flatten)]
    pub path: EnginePath,
    /// The sets at the end of the last step.
    pub sets: SetSizes,
    /// The optimality conditions at the end of the last step.
    pub kkt: Kkt,
    /// The load steps made.
    pub steps: Vec<StepReport>,
    /// How often the load steps are made.
    #[serde(skip)]
    pub cycles: usize,
    /// The times of the phases.
    pub timings: Timings,
    /// The largest resident size of the process, where the system reports it; of several processes the largest.
    pub peak_memory_mib: Option<f64>,
    /// The distribution of the work among several ranks; missing for a single process.
    #[cfg(feature = "mpi")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ranks: Option<crate::mpi::RanksReport>,
    /// The version of signorini.
    pub version: &'static str,
    /// The outer steps of all solves.
    pub history: Vec<HistoryRow>,
    /// The diagonal of the box around the mesh; 0 in an algebraic case.
    #[serde(skip)]
    pub size: f64,
    /// Of the whole mesh.
    #[serde(skip)]
    census: Census,
    /// [`ContactFields::slip`](super::ContactFields::slip) at the end of the last step; empty before the first.
    #[serde(skip)]
    slip: Vec<f64>,
    /// The forces and displacements then.
    #[serde(skip)]
    before: Before,
}

/// A status, or "error".
fn or_error<S: serde::Serializer>(status: &Option<Status>, to: S) -> Result<S::Ok, S::Error> {
    match status {
        Some(status) => status.serialize(to),
        None => to.serialize_str("error"),
    }
}

impl Report {
    /// For the problem to be solved, before its first step.
    pub fn new<'a, const D: usize>(title: &str, analysis: impl Into<Analysis<'a, D>>) -> Self
    where
        ElementKind: Topology<D>,
    {
        let Analysis { problem, elastic } = analysis.into();
        let census = elastic.map_or_else(Census::default, |elastic| elastic.mesh.census());
        Self::of(title, problem, elastic, census)
    }

    /// The same, for any K and parts of a mesh.
    pub(crate) fn of<const D: usize, K>(
        title: &str,
        problem: &ContactProblem<D, K>,
        elastic: Option<&Elastic<D>>,
        census: Census,
    ) -> Self
    where
        ElementKind: Topology<D>,
    {
        let kinds = || census.kinds.iter().flatten();
        let mut elements = BTreeMap::new();
        kinds().for_each(|(kind, count)| *elements.entry(kind.name()).or_default() += count);
        Self {
            title: title.to_owned(),
            units: elastic.map_or_else(Units::default, |e| e.units.clone()),
            status: Some(Status::Interrupted),
            error: None,
            hints: Vec::new(),
            elements,
            order: kinds().map(|(kind, _)| kind.order()).max(),
            cycles: elastic.map_or(1, |elastic| elastic.cycles().count),
            n: problem.n_free(),
            m: problem.m(),
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
            timings: Timings {
                assembly: elastic.map_or(0.0, |elastic| elastic.assembly_seconds),
                pairing: elastic.map_or(0.0, |elastic| elastic.pairing_seconds),
                ..Timings::default()
            },
            peak_memory_mib: None,
            #[cfg(feature = "mpi")]
            ranks: None,
            version: env!("CARGO_PKG_VERSION"),
            history: Vec::new(),
            size: census.size,
            census,
            slip: Vec::new(),
            before: Before::default(),
        }
    }

    /// Sets the time of making its engine.
    pub fn set_up(&mut self, engine: &Engine, seconds: f64) {
        self.timings.factor = seconds;
        self.timings.linear_reference =
            (engine.cholesky()).map(|dual| dual.factor().seconds + dual.solve_seconds);
    }

    /// Adds a step.
    pub fn add_step<const D: usize>(&mut self, results: &StepResults<D>)
    where
        ElementKind: Space<D>,
    {
        let (analysis, solution) = (results.analysis, results.solution);
        let of_bodies = results.of_bodies.as_ref();
        let (contacts, balance) = match of_bodies {
            Some(of) => (
                self.contacts(of, solution, &Moved::of(of)),
                self.balance(of, solution, of.elastic.mesh.nodes.len()),
            ),
            None => Default::default(),
        };
        let load = of_bodies.map(|of| (of.data.factor, of.data.total_load.to_vec()));
        let body_name = |body| analysis.body_name(body);
        self.hints
            .extend(hints::contradiction(analysis.problem, solution));
        self.push(solution, load, contacts, balance, body_name);
        let made = self.steps.last_mut().expect("just pushed");
        if of_bodies.is_some_and(|of| of.elastic.is_large()) {
            made.iterations = Some(std::mem::replace(&mut made.rounds, 1));
            made.parts = Some(results.parts);
        }
    }

    /// The forces of the contacts of a step, and hints on them; they have `moved`.
    pub(crate) fn contacts<const D: usize>(
        &mut self,
        of: &OfBodies<D>,
        solution: &StepSolution<D>,
        moved: &Moved,
    ) -> Vec<ContactReport>
    where
        ElementKind: Space<D>,
    {
        let contacts = contact_reports(of, solution, &self.slip);
        self.hints = hints::hints(of, &self.census, &contacts, moved);
        self.slip.clone_from(&of.contact.slip);
        contacts
    }

    /// The forces on the supports at the end of a step, and the energy of the first so many nodes.
    pub(crate) fn balance<const D: usize>(
        &mut self,
        of: &OfBodies<D>,
        solution: &StepSolution<D>,
        own: usize,
    ) -> Balance
    where
        ElementKind: Space<D>,
    {
        let (supports, forces) = support_reports(of, solution, own);
        (supports, energy(of, forces, own, &mut self.before))
    }

    /// Adds a complete step.
    pub(crate) fn push<const D: usize>(
        &mut self,
        solution: &StepSolution<D>,
        load: Option<(f64, Vec<f64>)>,
        contacts: Vec<ContactReport>,
        (supports, energy): Balance,
        body_name: impl Fn(usize) -> String,
    ) {
        let last = solution.last();
        self.status = Some(solution.status);
        self.err_relative = last.info.err_relative;
        self.rho = last.info.rho;
        self.sigma_max = last.info.sigma_max;
        self.sets = solution.sizes;
        self.kkt = solution.kkt;
        self.add_rounds(&solution.rounds);
        self.steps.push(StepReport {
            cycle: (self.cycles > 1).then_some(solution.cycle),
            factor: load.as_ref().map_or(1.0, |load| load.0),
            status: solution.status,
            rounds: solution.rounds.len(),
            not_held: (solution.not_held.iter())
                .map(|one| NotHeldReport {
                    body: body_name(one.body),
                    motion: one.motion.clone(),
                    proven: one.proven,
                })
                .collect(),
            iterations: None,
            parts: None,
            iter: solution.iter(),
            n_a: solution.n_a(),
            sets: solution.sizes,
            kkt: solution.kkt,
            total_load: load.map(|load| load.1),
            contacts,
            supports,
            energy,
        });
    }

    /// Adds the counts, times and outer steps of the solves of a step.
    fn add_rounds(&mut self, rounds: &[Round]) {
        for round in rounds {
            let info = &round.info;
            self.iter += info.iter;
            self.n_a += info.n_a;
            self.n_a_sigma += info.n_a_sigma;
            self.timings.setup += info.setup_seconds;
            self.timings.ssnm += info.solve_seconds;
            self.history
                .extend(info.history.iter().map(|&step| HistoryRow {
                    load_step: self.steps.len() + 1,
                    round: round.round,
                    step,
                }));
        }
    }

    /// Records that an error has ended the run.
    pub fn fail(&mut self, error: &str) {
        self.status = None;
        self.error = Some(error.to_owned());
    }

    /// Adds the path of the solve.
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
