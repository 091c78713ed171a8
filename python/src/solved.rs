//! The result of a solve: vectors and fields of each load step, made on request.

use crate::arrays::{flat, table};
use crate::errors::guarded;
use crate::mesh::Mesh;
use pyo3::exceptions::{PyIndexError, PyOSError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use signorini::case::CaseProblem;
use signorini::contact::Space;
use signorini::elasticity::Stress;
use signorini::mesh::{AnyMesh, ElementKind};
use signorini::model::{Analysis, AnyAnalysis, Built, Elastic, StepData};
use signorini::output::{
    ContactFields, Draw, OutputError, Report, Results, StepFields, shown_at_nodes,
};
use signorini::problem::ContactProblem;
use signorini::quasistatic::{Load, State, StepSolution};
use signorini::solve;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The load steps of a solve in D dimensions, and their report.
pub struct Run<const D: usize>
where
    ElementKind: Space<D>,
{
    /// The problem, if the solve has changed the one it was called on.
    pub problem: Option<ContactProblem<D>>,
    pub steps: Vec<Made<D>>,
    pub report: Report,
}

/// A load step.
pub struct Made<const D: usize>
where
    ElementKind: Space<D>,
{
    pub solution: StepSolution<D>,
    /// With large displacements, the bodies where they are, and the load there.
    pub displaced: Option<(Arc<Built<D>>, StepData<D>)>,
    pub parts: usize,
}

impl<const D: usize> Made<D>
where
    ElementKind: Space<D>,
{
    pub fn new(solved: solve::Solved<D>) -> Self {
        Self {
            displaced: solved.displaced.zip(solved.data.cloned()),
            parts: solved.parts,
            solution: solved.solution,
        }
    }

    /// The analysis that its vectors belong to.
    fn of<'a>(&'a self, analysis: Analysis<'a, D>) -> Analysis<'a, D> {
        (self.displaced.as_ref()).map_or(analysis, |(built, _)| Analysis::from(&**built))
    }
}

impl<const D: usize> Run<D>
where
    ElementKind: Space<D>,
{
    /// Where it has ended, if it has begun; `source` is the problem that it was asked of.
    pub fn end(&self, source: &ContactProblem<D>) -> Option<State> {
        let problem = self.problem.as_ref().unwrap_or(source);
        Some(self.steps.last()?.solution.state(&Load::of(problem)))
    }
}

impl Solved {
    /// Whether it is of this problem, or of one with the same K, N and T.
    pub fn is_of(&self, problem: &Arc<CaseProblem>) -> bool {
        fn same<const D: usize>(a: Analysis<D>, b: Analysis<D>) -> bool
        where
            ElementKind: Space<D>,
        {
            let (a, b) = (a.problem, b.problem);
            (a.stiffness() == b.stiffness())
                && a.normal() == b.normal()
                && a.tangential() == b.tangential()
        }
        let is_same = || match (self.source.analysis(), problem.analysis()) {
            (AnyAnalysis::Plane(a), AnyAnalysis::Plane(b)) => same(a, b),
            (AnyAnalysis::Space(a), AnyAnalysis::Space(b)) => same(a, b),
            _ => false,
        };
        Arc::ptr_eq(&self.source, problem) || is_same()
    }
}

/// The same in either dimension.
pub enum AnyRun {
    Plane(Run<2>),
    Space(Run<3>),
}

/// The result of a solve.
#[pyclass(frozen, module = "signorini._native")]
pub struct Solved {
    pub source: Arc<CaseProblem>,
    pub title: String,
    pub run: AnyRun,
}

/// Selects the dimension, with its result.
macro_rules! either {
    ($solved:expr, ($analysis:ident, $run:ident) => $value:expr) => {
        match ($solved.source.analysis(), &$solved.run) {
            (AnyAnalysis::Plane(of), AnyRun::Plane($run)) => {
                let $analysis = Analysis {
                    problem: $run.problem.as_ref().unwrap_or(of.problem),
                    elastic: of.elastic,
                };
                $value
            }
            (AnyAnalysis::Space(of), AnyRun::Space($run)) => {
                let $analysis = Analysis {
                    problem: $run.problem.as_ref().unwrap_or(of.problem),
                    elastic: of.elastic,
                };
                $value
            }
            _ => unreachable!("a run is one of what was solved"),
        }
    };
}

#[pymethods]
impl Solved {
    /// Load steps made.
    #[getter]
    fn n_steps(&self) -> usize {
        either!(self, (_analysis, run) => run.steps.len())
    }

    /// `report.json`.
    fn report(&self) -> String {
        either!(self, (_analysis, run) => serde_json::to_string(&run.report).unwrap_or_default())
    }

    /// u, λν, λτ (m × (D − 1)), the slip bounds and the slip of a step from matrices.
    fn vectors<'py>(&self, py: Python<'py>, step: usize) -> PyResult<Bound<'py, PyDict>> {
        either!(self, (analysis, run) => {
            let made = at(&run.steps, step)?;
            let (analysis, solution) = (made.of(analysis), &made.solution);
            let (normal, tangential) = solution.lambda.split_at(analysis.problem.m());
            let all = PyDict::new(py);
            all.set_item("u", flat(py, solution.u[..analysis.problem.n()].to_vec()))?;
            all.set_item("lambda_normal", flat(py, normal.to_vec()))?;
            all.set_item("lambda_tangential", flat(py, tangential.to_vec()))?;
            all.set_item("slip_bound", flat(py, solution.slip_bound.clone()))?;
            all.set_item("slip", flat(py, solution.slip.clone()))?;
            let state = |i| {
                let problem = analysis.problem;
                if problem.is_tied(i) {
                    "tied"
                } else if solution.sets.is_separated(i) {
                    "separated"
                } else if !problem.has_friction(i) {
                    "contact"
                } else if !solution.sets.slips(i) && solution.slip_bound[i] > 0.0 {
                    "stick"
                } else {
                    "slip"
                }
            };
            let states: Vec<&str> = (0..normal.len()).map(state).collect();
            all.set_item("state", states)?;
            Ok(all)
        })
    }

    /// u of all nodes of the mesh in a step.
    fn displacement<'py>(&self, py: Python<'py>, step: usize) -> PyResult<Bound<'py, PyAny>> {
        either!(self, (analysis, run) => {
            let made = at(&run.steps, step)?;
            let u = of_bodies(py, analysis, (step, made), |_, data| {
                data.unknowns.displacements(&made.solution.u)
            })?;
            Ok(table(py, &u)?.into_any())
        })
    }

    /// Stresses at the nodes and in the middle of the elements in a step: xx, yy, zz, xy, yz, zx in each row.
    fn stress<'py>(&self, py: Python<'py>, step: usize) -> PyResult<[Bound<'py, PyAny>; 2]> {
        let row = |s: &Stress| [s.xx, s.yy, s.zz, s.xy, s.yz, s.zx];
        either!(self, (analysis, run) => {
            let made = at(&run.steps, step)?;
            let fields = of_bodies(py, analysis, (step, made), |elastic, data| {
                StepFields::new(elastic, data, &made.solution)
            })?;
            let (nodes, elements) = (fields.at_nodes, fields.in_elements);
            let rows = |all: Vec<Stress>| all.iter().map(row).collect::<Vec<_>>();
            Ok([
                table(py, &rows(nodes))?.into_any(),
                table(py, &rows(elements))?.into_any(),
            ])
        })
    }

    /// The fields at the contact places in a step.
    fn contact<'py>(&self, py: Python<'py>, step: usize) -> PyResult<Bound<'py, PyDict>> {
        fn made<'py, const D: usize>(
            py: Python<'py>,
            analysis: Analysis<D>,
            run: &Run<D>,
            step: usize,
        ) -> PyResult<Bound<'py, PyDict>>
        where
            ElementKind: Space<D>,
        {
            let made = at(&run.steps, step)?;
            let there = made.of(analysis);
            let (fields, vectors, states, shown, turns) =
                of_bodies(py, analysis, (step, made), |elastic, data| {
                    let solution = &made.solution;
                    let fields = ContactFields::new(there.problem, elastic, data, solution);
                    let count = fields.gap.len();
                    let whole = |i| {
                        let [pressed, rubbed] = fields.traction_vectors(i);
                        std::array::from_fn(|c| pressed[c] + rubbed[c])
                    };
                    let vectors: Vec<[f64; D]> = (0..count).map(whole).collect();
                    let states: Vec<&str> = (0..count).map(|i| fields.status[i].name()).collect();
                    // The place that each node shows.
                    let mut shown = vec![-1; elastic.mesh.nodes.len()];
                    let mut turns = Vec::new();
                    for (node, i) in shown_at_nodes(elastic, &fields, None) {
                        shown[node as usize] = i as i64;
                        turns.extend(elastic.turn_to(i, node).map(|turn| (node, turn)));
                    }
                    (fields, vectors, states, shown, turns)
                })?;
            let elastic = there.elastic.expect("it has bodies");
            let places = &elastic.contact.places;
            let points: Vec<[f64; D]> = places.iter().map(|place| place.place).collect();
            let normals: Vec<[f64; D]> = places.iter().map(|place| place.frame[0]).collect();
            let tangents = places.iter().flat_map(|place| place.frame[1..].to_vec());
            let tangents: Vec<[f64; D]> = tangents.collect();
            let all = PyDict::new(py);
            all.set_item("points", table(py, &points)?)?;
            all.set_item("normals", table(py, &normals)?)?;
            all.set_item("tangents", table(py, &tangents)?)?;
            all.set_item(
                "areas",
                flat(py, places.iter().map(|place| place.area).collect()),
            )?;
            all.set_item("gap", flat(py, fields.gap))?;
            all.set_item("pressure", flat(py, fields.pressure))?;
            all.set_item("traction", flat(py, fields.traction))?;
            all.set_item("bound", flat(py, fields.bound))?;
            all.set_item("slip", flat(py, fields.slip))?;
            let mut worn = fields.worn;
            worn.resize(places.len(), 0.0);
            all.set_item("wear", flat(py, worn))?;
            all.set_item("traction_vectors", table(py, &vectors)?)?;
            all.set_item("state", states)?;
            all.set_item("shown", flat(py, shown))?;
            // Of vectors, to nodes beyond the side of a sector.
            let (turned, turns): (Vec<u32>, Vec<[[f64; D]; D]>) = turns.into_iter().unzip();
            all.set_item("turned", flat(py, turned))?;
            all.set_item("turns", table(py, &turns.concat())?)?;
            all.set_item("contact", flat(py, elastic.pair_of.clone()))?;
            Ok(all)
        }
        either!(self, (analysis, run) => made(py, analysis, run, step))
    }

    /// The mesh; None for a problem from matrices.
    fn mesh(&self) -> Option<Mesh> {
        let mesh = match self.source.analysis() {
            AnyAnalysis::Plane(of) => AnyMesh::Plane(of.elastic?.mesh.clone()),
            AnyAnalysis::Space(of) => AnyMesh::Space(of.elastic?.mesh.clone()),
        };
        Some(Mesh::new(mesh))
    }

    /// Writes the results as `signorini solve` does into a directory; returns the files.
    fn write(&self, py: Python<'_>, directory: PathBuf, plots: bool) -> PyResult<Vec<PathBuf>> {
        let title = &self.title;
        let written = guarded(
            py,
            || either!(self, (analysis, run) => written(analysis, run, title, directory, plots)),
        )?;
        written.map_err(|error| match error {
            Unwritten::File(error) => PyOSError::new_err(error.to_string()),
            Unwritten::Step(error) => crate::errors::of_solve(error.into()),
        })
    }
}

/// Why results could not be written.
enum Unwritten {
    File(OutputError),
    Step(signorini::model::ModelError),
}

impl From<OutputError> for Unwritten {
    fn from(error: OutputError) -> Self {
        Self::File(error)
    }
}

impl From<signorini::model::ModelError> for Unwritten {
    fn from(error: signorini::model::ModelError) -> Self {
        Self::Step(error)
    }
}

/// Writes the results of a run as if it were made just now.
fn written<const D: usize>(
    analysis: Analysis<D>,
    run: &Run<D>,
    title: &str,
    directory: PathBuf,
    plots: bool,
) -> Result<Vec<PathBuf>, Unwritten>
where
    ElementKind: Draw<D>,
{
    let mut results = Results::new(&directory, title, analysis)?;
    if plots {
        results.draw();
    }
    for (step, made) in run.steps.iter().enumerate() {
        let (built, data) = match &made.displaced {
            Some((built, data)) => (Some(Arc::clone(built)), Some(data.clone())),
            None => (None, analysis.step(step % analysis.n_steps())?),
        };
        results.add(&solve::Solved {
            number: step + 1,
            data: data.as_ref(),
            solution: made.solution.clone(),
            displaced: built,
            parts: made.parts,
        })?;
    }
    // With what the solve was given.
    results.report.steps.clone_from(&run.report.steps);
    if let Some(error) = &run.report.error {
        results.report.fail(error);
    }
    let (output, timings) = (results.report.timings.output, run.report.timings);
    results.report.timings = timings;
    results.report.timings.output = output;
    results.report.set_path(run.report.path.clone());
    let total = Duration::try_from_secs_f64(timings.total + output).unwrap_or_default();
    results.set_begin(
        Instant::now()
            .checked_sub(total)
            .unwrap_or_else(Instant::now),
    );
    Ok(results.finish()?.to_vec())
}

/// One of the steps made.
fn at<const D: usize>(steps: &[Made<D>], step: usize) -> PyResult<&Made<D>>
where
    ElementKind: Space<D>,
{
    let count = steps.len();
    (steps.get(step)).ok_or_else(|| PyIndexError::new_err(format!("{count} load steps were made")))
}

/// The data that follow from the bodies and the load of a step.
fn of_bodies<const D: usize, T: Send>(
    py: Python<'_>,
    analysis: Analysis<D>,
    (step, made): (usize, &Made<D>),
    follows: impl FnOnce(&Elastic<D>, &StepData<D>) -> T + Send,
) -> PyResult<T>
where
    ElementKind: Space<D>,
{
    let Some(elastic) = analysis.elastic else {
        let text = "a problem from matrices has no mesh: its vectors are u and lambda_normal, lambda_tangential";
        return Err(pyo3::exceptions::PyAttributeError::new_err(text));
    };
    guarded(py, || match &made.displaced {
        Some((built, data)) => Ok(follows(&built.elastic, data)),
        None => (elastic.step(step % elastic.n_steps())).map(|data| follows(elastic, &data)),
    })?
    .map_err(|error| crate::errors::of_solve(error.into()))
}
