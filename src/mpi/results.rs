//! The files of a run on several ranks: each writes the piece of its elements, rank 0 all the rest.

use super::petsc::PetscError;
use super::share::{Bodies, Imbalance, Share, completed};
use crate::contact::Space;
use crate::elasticity::Stress;
use crate::mesh::vector::{length, minus};
use crate::mesh::{ElementKind, Topology};
use crate::model::StepData;
use crate::output::files::{write, write_index, write_pieces, write_report, write_vectors};
use crate::output::hints::{self, Moved};
use crate::output::report::Balance;
use crate::output::rubbing::Rubbing;
use crate::output::{
    ContactFields, EnginePath, OfBodies, OutputError, Report, StepFields, peak_memory_mib, prepare,
    vtu,
};
use crate::problem::{ContactProblem, Elsewhere};
use crate::quasistatic::StepSolution;
use crate::ranks::Group;
use crate::solve::Solved;
use crate::ssnm::Status;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

/// Results of several ranks could not be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResultsError {
    /// A file could not be written by this rank.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Another rank could not write a file, and has the error; rank 0 has its message.
    #[error("another rank could not write its results{0}")]
    Elsewhere(String),
    /// PETSc has failed, perhaps only on this rank: end all of them.
    #[error(transparent)]
    Petsc(#[from] PetscError),
}

/// The distribution of the work among the ranks, as in report.json.
#[derive(Clone, Debug, Default, Serialize)]
pub struct RanksReport {
    /// The number of ranks.
    pub count: usize,
    /// Unknowns and elements of each, and the seconds to get there.
    #[serde(flatten)]
    pub division: Imbalance,
    /// Unknowns of the fullest over their mean.
    pub imbalance: f64,
    /// The largest resident size of each.
    pub peak_memory_mib: Vec<f64>,
    /// The adapter of each, where they compute on GPUs.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub adapters: Vec<String>,
    /// The number of collective sums over all unknowns, and the seconds that rank 0 spent in them, including waiting.
    pub reductions: u64,
    /// The seconds.
    pub reduction_seconds: f64,
}

/// The files of a run on several ranks, as [`crate::output::Results`] has those of one process. All its methods are collective.
pub struct Results<const D: usize>
where
    ElementKind: Topology<D>,
{
    group: Arc<Group>,
    problem: ContactProblem<D, Elsewhere>,
    bodies: Option<Arc<Bodies<D>>>,
    original: Vec<u32>,
    n_steps: usize,
    directory: PathBuf,
    begin: Instant,
    /// The future `report.json`; on rank 0.
    pub report: Report,
    rubbing: Rubbing,
    files: Vec<PathBuf>,
}

impl<const D: usize> Results<D>
where
    ElementKind: Space<D>,
{
    /// For a run that is about to begin, like [`crate::output::Results::new`]. `inputs` are the files that the run
    /// reads.
    ///
    /// # Errors
    /// If files cannot be written or removed there.
    pub fn new(
        directory: &Path,
        title: &str,
        inputs: &[PathBuf],
        share: &Share<D>,
    ) -> Result<Self, ResultsError> {
        let group = Arc::clone(share.group());
        let prepared = match group.rank() {
            0 => prepare(directory, inputs),
            _ => Ok(()),
        };
        agreed(&group, prepared)?;
        let bodies = share.bodies.clone();
        let elastic = bodies.as_ref().map(|bodies| &bodies.received.elastic);
        let census = bodies
            .as_ref()
            .map(|bodies| bodies.received.common.census.clone());
        let mut report = Report::of(title, &share.problem, elastic, census.unwrap_or_default());
        report.n = share.system().n_free();
        if let Some(bodies) = &bodies {
            [report.timings.assembly, report.timings.pairing] = bodies.seconds;
        }
        let division = share.division();
        report.timings.assembly += division.partition + division.distribution + division.assembly;
        report.timings.factor = division.setup;
        Ok(Self {
            problem: share.problem.clone(),
            original: share.original.clone(),
            n_steps: share.n_steps(),
            directory: directory.to_owned(),
            begin: Instant::now(),
            files: Vec::new(),
            rubbing: Rubbing::default(),
            report,
            bodies,
            group,
        })
    }

    /// Sets the beginning of the run, if it was before [`Results::new`].
    pub fn set_begin(&mut self, begin: Instant) {
        self.begin = begin;
    }

    /// Adds a load step to the report, and writes its fields.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn add(&mut self, solved: &Solved<D>) -> Result<(), ResultsError> {
        let start = Instant::now();
        let solution = &solved.solution;
        let step = match self.n_steps {
            1 => String::new(),
            _ => format!("-{:03}", solved.number),
        };
        let problem = self.problem.clone();
        match (self.bodies.clone(), solved.data) {
            (Some(bodies), Some(data)) => {
                let mut of = self.fields(&bodies, data, solution)?;
                self.rubbing.add(&mut of, solution);
                let moved = self.moved(&bodies, &of);
                let balance = self.balance(&of, solution);
                let contradiction = hints::contradiction(&problem, solution);
                if self.group.rank() == 0 {
                    let contacts = self.report.contacts(&of, solution, &moved);
                    let load = Some((data.factor, data.total_load.to_vec()));
                    let name = |body: usize| bodies.received.common.bodies[body].name.clone();
                    self.report.push(solution, load, contacts, balance, name);
                    self.report.hints.extend(contradiction);
                }
                self.write_fields(&bodies, &of, &step)?;
            }
            _ => {
                let free = problem.floating_bodies();
                let name = |body: usize| {
                    let centre = free.bodies()[body].centre().map(|x| format!("{x:.4e}"));
                    format!("the body around ({})", centre.join(", "))
                };
                self.report
                    .push(solution, None, Vec::new(), Balance::default(), name);
                self.write_vectors(solution)?;
            }
        }
        let index = match (self.group.rank(), self.n_steps) {
            (0, 2..) => write_index(&self.directory, &self.report.steps, "pvtu").map(Some),
            _ => Ok(None),
        };
        if let Some(index) = agreed(&self.group, index)?
            && solved.number == 1
        {
            self.files.push(index);
        }
        self.report.timings.output += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// The fields on the nodes of this rank's elements.
    fn fields<'a>(
        &self,
        bodies: &'a Bodies<D>,
        data: &'a StepData<D>,
        solution: &StepSolution<D>,
    ) -> Result<OfBodies<'a, D>, ResultsError> {
        let (elastic, part) = (&bodies.received.elastic, &bodies.received.part);
        let blocks = part.parts.len();
        let mut u: Vec<[f64; D]> = solution.u.as_chunks().0.to_vec();
        u.resize(blocks + part.ghost_blocks.len(), [0.0; D]);
        completed(&self.group, blocks, &part.ghost_blocks, &mut u);
        let complete = StepSolution {
            u: u.into_flattened(),
            ..solution.clone()
        };
        let mut fields = StepFields::new(elastic, data, &complete);
        // At nodes of others some elements are missing here.
        let mut stresses: Vec<[f64; 6]> = (fields.at_nodes.iter())
            .map(|s| [s.xx, s.yy, s.zz, s.xy, s.yz, s.zx])
            .collect();
        completed(&self.group, part.own, &part.ghosts, &mut stresses);
        fields.at_nodes = (stresses.into_iter())
            .map(|[xx, yy, zz, xy, yz, zx]| Stress {
                xx,
                yy,
                zz,
                xy,
                yz,
                zx,
            })
            .collect();
        Ok(OfBodies {
            elastic,
            data,
            fields,
            contact: ContactFields::new(&self.problem, elastic, data, solution),
        })
    }

    /// How bodies and the sides of contacts between them have moved.
    fn moved(&self, bodies: &Bodies<D>, of: &OfBodies<D>) -> Moved {
        let part = &bodies.received.part;
        let count = bodies.received.common.census.bodies.len();
        let apart = |nodes: &Vec<u32>| {
            let here = nodes
                .iter()
                .map(|&node| of.fields.displacement[node as usize]);
            let (low, high) = crate::mesh::bounds(here);
            let (low, high) = (
                low.map(|v| -self.group.max(-v)),
                high.map(|v| self.group.max(v)),
            );
            length(minus(high, low))
        };
        Moved {
            apart: part.pair_nodes.iter().map(apart).collect(),
            turned: hints::turned(of, count, &part.body_of, |all| self.group.sum(all)),
            gone: Vec::new(),
        }
    }

    /// The forces on the supports and the energy, over all ranks.
    fn balance(&mut self, of: &OfBodies<D>, solution: &StepSolution<D>) -> Balance {
        let own = self
            .bodies
            .as_ref()
            .map_or(0, |bodies| bodies.received.part.own);
        let (mut supports, energy) = self.report.balance(of, solution, own);
        for support in &mut supports {
            self.group.sum(&mut support.force);
            self.group.sum(&mut support.moment);
        }
        let energy = energy.map(|energy| energy.combined(|all| self.group.sum(all)));
        (supports, energy)
    }

    fn write_fields(
        &mut self,
        bodies: &Bodies<D>,
        of: &OfBodies<D>,
        step: &str,
    ) -> Result<(), ResultsError> {
        let elements = bodies.received.part.own_elements;
        let piece = vtu::text(of, elements);
        let name = |rank: usize| format!("solution{step}-p{rank}.vtu");
        let (directory, rank) = (&self.directory, self.group.rank());
        let written = write_pieces(directory, &name(rank), &piece);
        agreed(&self.group, written)?;
        let rest = match rank {
            0 => {
                let names: Vec<String> = (0..self.group.size()).map(name).collect();
                let whole = vtu::whole(&String::from_utf8_lossy(&piece.concat()), &names);
                write(directory, &format!("solution{step}.pvtu"), whole).and_then(|whole| {
                    let table = of.contact.csv(of.elastic);
                    let table = write(directory, &format!("contact{step}.csv"), table)?;
                    Ok(vec![whole, table])
                })
            }
            _ => Ok(Vec::new()),
        };
        self.files.extend(agreed(&self.group, rest)?);
        Ok(())
    }

    /// u of all ranks and λ, in the order that the problem was given in.
    fn write_vectors(&mut self, solution: &StepSolution<D>) -> Result<(), ResultsError> {
        let mine = (self.original.clone(), solution.u.clone());
        let written = match self.group.rank() {
            0 => {
                let others = (1..self.group.size()).map(|rank| self.group.receive(rank));
                let all: Vec<(Vec<u32>, Vec<f64>)> = std::iter::once(mine).chain(others).collect();
                let mut u = vec![0.0; all.iter().map(|part| part.1.len()).sum()];
                for (blocks, values) in all {
                    for (block, values) in blocks.into_iter().zip(values.chunks(D)) {
                        u[D * block as usize..][..D].copy_from_slice(values);
                    }
                }
                let whole = StepSolution {
                    u,
                    ..solution.clone()
                };
                write_vectors(&self.directory, &self.problem, &whole)
            }
            _ => {
                self.group.send(0, &mine);
                Ok(Vec::new())
            }
        };
        self.files.extend(agreed(&self.group, written)?);
        Ok(())
    }

    /// Adds the distribution of the work and its costs to the report. If the run has converged, the V-cycles of one linear
    /// solve are counted too.
    ///
    /// # Errors
    /// If PETSc fails in that.
    pub fn add_share(&mut self, share: &mut Share<D>) {
        let costs = share.costs();
        let (seconds, reductions) = self.group.spent();
        let converged = self.report.status == Some(Status::Converged);
        let linear = match self.group.any(converged) {
            true => share.linear_iterations(1e-8).ok().flatten(),
            false => None,
        };
        let (adapter, precision) = share.adapter().unzip();
        let adapters = match (&adapter, self.group.rank()) {
            (None, _) => Vec::new(),
            (Some(own), 0) => {
                let others = (1..self.group.size()).map(|rank| self.group.receive(rank));
                std::iter::once(own.clone()).chain(others).collect()
            }
            (Some(own), _) => {
                self.group.send(0, own);
                Vec::new()
            }
        };
        self.report.set_path(EnginePath {
            backend: "mpi",
            adapter,
            precision: precision.unwrap_or_default(),
            stiffness: "pcg",
            costs: Some(costs),
            v_cycles_linear: linear,
        });
        let peak = self.group.joined(&[peak_memory_mib().unwrap_or(0.0)]);
        self.report.peak_memory_mib = peak.iter().copied().reduce(f64::max).filter(|&v| v > 0.0);
        self.report.ranks = Some(RanksReport {
            count: self.group.size(),
            division: share.division().clone(),
            imbalance: share.division().of_unknowns(),
            peak_memory_mib: peak,
            adapters,
            reductions,
            reduction_seconds: seconds,
        });
    }

    /// Writes the report; returns the files of rank 0, without the pieces of the others. After an error, call [`Report::fail`]
    /// first.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn finish(&mut self) -> Result<&[PathBuf], ResultsError> {
        self.report.timings.total = self.begin.elapsed().as_secs_f64();
        let report = match self.group.rank() {
            0 => write_report(&self.directory, &self.report).map(Some),
            _ => Ok(None),
        };
        self.files.extend(agreed(&self.group, report)?);
        Ok(&self.files)
    }
}

/// The files of a rank, unless any rank could not write.
fn agreed<T>(group: &Group, made: Result<T, OutputError>) -> Result<T, ResultsError> {
    if !group.any(made.is_err()) {
        return Ok(made?);
    }
    let own = (made.as_ref().err()).map_or(String::new(), |error| format!(": {error}"));
    let mut told = own.clone();
    match group.rank() {
        0 => told.extend((1..group.size()).map(|rank| group.receive::<String>(rank))),
        _ => group.send(0, &own),
    }
    match made {
        Err(error) => Err(error.into()),
        Ok(_) => Err(ResultsError::Elsewhere(told)),
    }
}
