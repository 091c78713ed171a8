//! Contact problems that are ready to be solved: from matrices, of a case, of a model on a mesh.

use crate::arrays::{Sparse, entries, flat, rows, sparse, table};
use crate::errors::{SolveError, argument, guarded, of_build, of_case, of_engine, of_solve};
use crate::fork;
use crate::mesh::Mesh;
use crate::settings;
use crate::solved::{AnyRun, Made, Run, Solved};
use crate::watch::{Ear, News, Voice, watched};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use signorini::case::{Case, CaseProblem};
use signorini::engine::{Device, Engine, EngineOptions};
use signorini::mesh::{ElementKind, Topology};
use signorini::model::{Analysis, AnyAnalysis};
use signorini::output::{EnginePath, Report, StepResults};
use signorini::problem::{
    AnyProblem, ContactProblem, Matrices, ProblemError, SparseRef, dimension,
};
use signorini::quasistatic::{self, StepSettings};
use signorini::solve::{self, Compiled, Event};
use signorini::sparse::Csr;
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::Instant;

/// An engine, and the options it was made with.
struct Kept {
    asked: String,
    engine: Engine,
}

/// A contact problem, and the engine that its solves share.
#[pyclass(frozen, module = "signorini._native")]
pub struct Problem {
    source: Arc<CaseProblem>,
    title: String,
    settings: StepSettings,
    /// Whether entries of the gap below 0 are intended.
    interference: bool,
    engine: Mutex<Option<Kept>>,
    /// The process in which a solve has taken it last.
    taken_in: AtomicU32,
    /// Of the engine.
    ear: Ear,
}

/// The changes of a solve to its problem, from Python.
#[derive(Default)]
struct Changes {
    load: Option<Vec<f64>>,
    gap: Option<Vec<f64>>,
    slip_bound: Option<Vec<f64>>,
    slip_origin: Option<Vec<f64>>,
    friction: Option<Vec<f64>>,
}

/// The optional data of a problem from matrices.
#[derive(Default)]
struct Beside {
    interference: bool,
    dependent_rows: bool,
    slip_bound: Vec<f64>,
    friction: Vec<f64>,
    compliance: Vec<f64>,
    tied: Vec<bool>,
    areas: Option<Vec<f64>>,
    slip_origin: Option<Vec<f64>>,
}

thread_local! {
    /// The problems that calls of this thread are solving: several, if callbacks solve others.
    static SOLVING: RefCell<Vec<*const Problem>> = const { RefCell::new(Vec::new()) };
}

/// A call of [`Problem::solve`], as long as it lives.
struct Call;

impl Call {
    /// Unless this thread is solving the problem already: the engine would never be free.
    fn of(problem: &Problem) -> PyResult<Self> {
        SOLVING.with_borrow_mut(|all| {
            if all.contains(&std::ptr::from_ref(problem)) {
                return Err(SolveError::new_err(
                    "a callback of solve called solve of the same problem, which goes on only after the callback: solve \
                     copy.copy(problem) there",
                ));
            }
            all.push(problem);
            Ok(Self)
        })
    }
}

impl Drop for Call {
    fn drop(&mut self) {
        SOLVING.with_borrow_mut(Vec::pop);
    }
}

/// Which places are tied.
fn ties<const D: usize>(problem: &ContactProblem<D>) -> Vec<bool> {
    (0..problem.m()).map(|i| problem.is_tied(i)).collect()
}

impl Changes {
    fn is_empty(&self) -> bool {
        let all = [
            &self.load,
            &self.gap,
            &self.slip_bound,
            &self.slip_origin,
            &self.friction,
        ];
        all.iter().all(|change| change.is_none())
    }

    /// The problem with them.
    fn made<const D: usize>(
        &self,
        problem: &ContactProblem<D>,
        interference: bool,
    ) -> Result<ContactProblem<D>, ProblemError> {
        let mut problem = problem.clone();
        if let Some(load) = &self.load {
            if load.len() != problem.n() {
                return Err(ProblemError::Length {
                    name: "the load f",
                    found: load.len(),
                    expected: problem.n(),
                    reason: "one entry per row of K",
                });
            }
            // K may have rows that complete the last block.
            let mut load = load.clone();
            load.resize(problem.n_rows(), 0.0);
            problem = problem.with_load(load)?;
        }
        if let Some(gap) = &self.gap {
            problem = match interference {
                true => problem.with_gap(gap.clone())?,
                false => problem.with_open_gap(gap.clone())?,
            };
        }
        // One law takes the place of the other where both are given.
        if let (Some(_), Some(_)) = (&self.slip_bound, &self.friction) {
            problem = problem.with_friction_coefficient(Vec::new())?;
        }
        if let Some(bound) = &self.slip_bound {
            // A tie is a bound that nothing reaches: it stays.
            let tied = ties(&problem);
            problem = problem.with_slip_bound(bound.clone())?.with_ties(&tied)?;
        }
        if let Some(origin) = &self.slip_origin {
            problem = problem.with_slip_origin(origin.clone())?;
        }
        if let Some(friction) = &self.friction {
            problem = problem.with_friction_coefficient(friction.clone())?;
        }
        // Without a slip bound of the solve, friction takes the place of the law that the problem has.
        match self.slip_bound {
            Some(_) => problem.with_one_law(),
            None => Ok(problem),
        }
    }
}

fn wrong(error: ProblemError) -> PyErr {
    PyValueError::new_err(error.from_zero().to_string())
}

/// A problem of D dimensions from matrices.
fn of_matrices<const D: usize>(
    [stiffness, normal, tangential]: [SparseRef; 3],
    load: &[f64],
    gap: &[f64],
    coordinates: Option<&[[f64; D]]>,
    beside: Beside,
) -> Result<ContactProblem<D>, String>
where
    ElementKind: Topology<D>,
{
    // The law of a tied node does not matter.
    let mut slip_bound = beside.slip_bound;
    let tied = slip_bound.iter_mut().zip(&beside.tied);
    tied.filter(|of| *of.1).for_each(|of| *of.0 = 0.0);
    let made = ContactProblem::from_matrices(Matrices {
        stiffness,
        load,
        normal,
        tangential,
        gap,
        interference: beside.interference,
        dependent_rows: beside.dependent_rows,
        slip_bound: &slip_bound,
        friction_coefficient: &beside.friction,
        compliance: &beside.compliance,
        coordinates,
    });
    let made = made.and_then(|problem| {
        let problem = match beside.areas {
            Some(areas) => problem.with_areas(areas)?,
            None => problem,
        };
        let problem = problem.with_ties(&beside.tied)?;
        match beside.slip_origin {
            Some(origin) => problem.with_slip_origin(origin),
            None => Ok(problem),
        }
    });
    let problem = made.map_err(|error| error.from_zero().to_string())?;
    match Analysis::from(&problem).loose_body() {
        Some(text) => Err(format!("the stiffness matrix K is singular: {text}")),
        None => Ok(problem),
    }
}

impl Problem {
    fn new(source: CaseProblem, title: &str, settings: StepSettings, interference: bool) -> Self {
        Self {
            source: Arc::new(source),
            title: title.to_owned(),
            settings,
            interference,
            engine: Mutex::default(),
            taken_in: AtomicU32::new(0),
            ear: Ear::default(),
        }
    }

    /// The engine, as soon as no other solve has it.
    fn engine(&self) -> Result<MutexGuard<'_, Option<Kept>>, Failure> {
        let kept = match self.engine.try_lock() {
            Ok(kept) => kept,
            Err(TryLockError::Poisoned(error)) => error.into_inner(),
            Err(TryLockError::WouldBlock) => {
                // The thread that has it may have stayed in the parent.
                if fork::is_fork() && self.taken_in.load(Ordering::Relaxed) != std::process::id() {
                    return Err(Failure::Fork(
                        "a thread was solving this problem while the process was forked",
                    ));
                }
                self.engine.lock().unwrap_or_else(PoisonError::into_inner)
            }
        };
        self.taken_in.store(std::process::id(), Ordering::Relaxed);
        Ok(kept)
    }
}

#[pymethods]
impl Problem {
    /// From matrices in compressed rows or columns and vectors, all prepared by Python.
    #[staticmethod]
    #[pyo3(signature = (stiffness, load, normal, tangential, gap, slip_bound, friction, coordinates, dim, *, interference,
                        dependent_rows, slip_origin=None, areas=None, compliance=None, tied=None))]
    #[expect(clippy::too_many_arguments, reason = "one for each matrix and vector")]
    fn matrices(
        py: Python<'_>,
        stiffness: Sparse,
        load: PyReadonlyArray1<f64>,
        normal: Sparse,
        tangential: Sparse,
        gap: PyReadonlyArray1<f64>,
        slip_bound: Option<PyReadonlyArray1<f64>>,
        friction: Option<PyReadonlyArray1<f64>>,
        coordinates: Option<PyReadonlyArray2<f64>>,
        dim: Option<usize>,
        interference: bool,
        dependent_rows: bool,
        slip_origin: Option<PyReadonlyArray1<f64>>,
        areas: Option<PyReadonlyArray1<f64>>,
        compliance: Option<PyReadonlyArray1<f64>>,
        tied: Option<Vec<bool>>,
    ) -> PyResult<Self> {
        use numpy::PyUntypedArrayMethods as _;
        let columns = coordinates.as_ref().map(|all| all.shape()[1]);
        let of_shapes = match (dim, columns) {
            (Some(dim), Some(columns)) if dim != columns => Err(format!(
                "coordinates have {columns} columns, and dim is {dim}"
            )),
            (Some(dim), _) => Ok(dim),
            (None, columns) => dimension(normal.shape().0, tangential.shape().0, columns),
        };
        let dim = of_shapes.map_err(PyValueError::new_err)?;
        let some = |name, vector: &Option<PyReadonlyArray1<f64>>| {
            let made = vector
                .as_ref()
                .map(|v| entries(name, v).map(<[f64]>::to_vec));
            made.transpose()
        };
        let tied = tied.unwrap_or_default();
        let friction = some("friction", &friction)?.unwrap_or_default();
        let beside = Beside {
            interference,
            dependent_rows,
            slip_bound: some("slip_bound", &slip_bound)?.unwrap_or_default(),
            friction,
            compliance: some("compliance", &compliance)?.unwrap_or_default(),
            tied,
            areas: some("areas", &areas)?,
            slip_origin: some("slip_origin", &slip_origin)?,
        };
        let load = entries("f", &load)?;
        let gap = entries("gap", &gap)?;
        let matrices = [
            stiffness.matrix("K")?,
            normal.matrix("normal")?,
            tangential.matrix("tangential")?,
        ];
        let problem = match dim {
            2 => {
                let points = coordinates.map(|x| rows::<f64, 2>("coordinates", &x));
                let points = points.transpose()?;
                guarded(py, || {
                    let made = of_matrices::<2>(matrices, load, gap, points.as_deref(), beside);
                    made.map(AnyProblem::Plane)
                })?
            }
            3 => {
                let points = coordinates.map(|x| rows::<f64, 3>("coordinates", &x));
                let points = points.transpose()?;
                guarded(py, || {
                    let made = of_matrices::<3>(matrices, load, gap, points.as_deref(), beside);
                    made.map(AnyProblem::Space)
                })?
            }
            _ => return Err(argument("dim", format!("must be 2 or 3, not {dim}"))),
        };
        let problem = problem.map_err(PyValueError::new_err)?;
        Ok(Self::new(
            CaseProblem::Algebraic(problem),
            "",
            StepSettings::default(),
            interference,
        ))
    }

    /// The title of its case.
    #[getter]
    fn title(&self) -> &str {
        &self.title
    }

    /// 2 in the plane, 3 in space.
    #[getter]
    fn dim(&self) -> usize {
        match self.source.analysis() {
            AnyAnalysis::Plane(_) => 2,
            AnyAnalysis::Space(_) => 3,
        }
    }

    /// Unknowns that no support prescribes.
    #[getter]
    fn n(&self) -> usize {
        match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => analysis.problem.n_free(),
            AnyAnalysis::Space(analysis) => analysis.problem.n_free(),
        }
    }

    /// Contact places.
    #[getter]
    fn m(&self) -> usize {
        match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => analysis.problem.m(),
            AnyAnalysis::Space(analysis) => analysis.problem.m(),
        }
    }

    /// Load steps.
    #[getter]
    fn n_steps(&self) -> usize {
        match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => analysis.n_steps(),
            AnyAnalysis::Space(analysis) => analysis.n_steps(),
        }
    }

    /// The contact that each place belongs to; None for a problem from matrices.
    fn contact_of_places(&self) -> Option<Vec<u32>> {
        match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => analysis.elastic.map(|elastic| elastic.pair_of.clone()),
            AnyAnalysis::Space(analysis) => analysis.elastic.map(|elastic| elastic.pair_of.clone()),
        }
    }

    /// The name of each contact, if it has its own, its boundary, and its other side.
    fn contacts(&self) -> Vec<(Option<String>, String, String)> {
        fn of<const D: usize>(analysis: Analysis<D>) -> Vec<(Option<String>, String, String)>
        where
            ElementKind: Topology<D>,
        {
            let pairs = analysis.elastic.map_or(&[][..], |elastic| &elastic.pairs);
            let name = |pair: &signorini::model::PairData<D>| {
                (
                    pair.name.clone(),
                    pair.boundary.clone(),
                    pair.against.clone(),
                )
            };
            pairs.iter().map(name).collect()
        }
        match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => of(analysis),
            AnyAnalysis::Space(analysis) => of(analysis),
        }
    }

    /// The arguments with which [`Self::matrices`] makes the same problem; None for a model. Rows may depend on each other: they
    /// have been checked.
    fn parts<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        fn made<'py, const D: usize>(
            py: Python<'py>,
            problem: &ContactProblem<D>,
        ) -> PyResult<Bound<'py, PyDict>> {
            let (n, tied) = (problem.n(), ties(problem));
            let bounds = problem.slip_bound().iter().zip(&tied);
            let bounds = bounds.map(|(&g, &tied)| if tied { 0.0 } else { g });
            let all = PyDict::new(py);
            all.set_item(
                "stiffness",
                sparse(py, n, n, || problem.stiffness().triplets()),
            )?;
            let rows = |matrix: &Csr| sparse(py, matrix.n_rows(), n, || matrix.triplets());
            all.set_item("normal", rows(problem.normal()))?;
            all.set_item("tangential", rows(problem.tangential()))?;
            all.set_item("load", flat(py, problem.load()[..n].to_vec()))?;
            all.set_item("gap", flat(py, problem.gap().to_vec()))?;
            all.set_item("slip_bound", flat(py, bounds.collect()))?;
            let some = |values: &[f64]| (!values.is_empty()).then(|| flat(py, values.to_vec()));
            all.set_item("friction", some(problem.friction_coefficient()))?;
            let points = problem.coordinates().map(|points| table(py, points));
            all.set_item("coordinates", points.transpose()?)?;
            all.set_item("dim", D)?;
            all.set_item("slip_origin", some(problem.slip_origin()))?;
            all.set_item("areas", some(problem.areas()))?;
            all.set_item("compliance", some(problem.contact_compliance()))?;
            all.set_item("tied", tied)?;
            Ok(all)
        }
        let all = match &*self.source {
            CaseProblem::Algebraic(AnyProblem::Plane(problem)) => made(py, problem)?,
            CaseProblem::Algebraic(AnyProblem::Space(problem)) => made(py, problem)?,
            _ => return Ok(None),
        };
        all.set_item("interference", self.interference)?;
        Ok(Some(all))
    }

    /// Whether T has entries: without, there is no friction.
    #[getter]
    fn has_tangential(&self) -> bool {
        let rows = match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => analysis.problem.tangential(),
            AnyAnalysis::Space(analysis) => analysis.problem.tangential(),
        };
        rows.triplets().next().is_some()
    }

    /// Which places are tied.
    fn tied(&self) -> Vec<bool> {
        match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => ties(analysis.problem),
            AnyAnalysis::Space(analysis) => ties(analysis.problem),
        }
    }

    /// The coefficients of friction of all places; empty without Coulomb's law.
    fn friction_coefficient(&self) -> Vec<f64> {
        match self.source.analysis() {
            AnyAnalysis::Plane(analysis) => analysis.problem.friction_coefficient().to_vec(),
            AnyAnalysis::Space(analysis) => analysis.problem.friction_coefficient().to_vec(),
        }
    }

    /// Solves; returns the result and, if a signal, an exception of `hears`, or an error after finished steps has ended it,
    /// that exception.
    #[pyo3(signature = (hears, keywords, *, load=None, gap=None, slip_bound=None, slip_origin=None, friction=None, before=None))]
    #[expect(clippy::too_many_arguments, reason = "one for each vector")]
    fn solve(
        &self,
        py: Python<'_>,
        hears: Option<Bound<PyAny>>,
        keywords: Bound<PyDict>,
        load: Option<PyReadonlyArray1<f64>>,
        gap: Option<PyReadonlyArray1<f64>>,
        slip_bound: Option<PyReadonlyArray1<f64>>,
        slip_origin: Option<PyReadonlyArray1<f64>>,
        friction: Option<PyReadonlyArray1<f64>>,
        before: Option<PyRef<Solved>>,
    ) -> PyResult<(Solved, Option<PyErr>)> {
        let _call = Call::of(self)?;
        let some = |name, vector: &Option<PyReadonlyArray1<f64>>| {
            let made = vector
                .as_ref()
                .map(|v| entries(name, v).map(<[f64]>::to_vec));
            made.transpose()
        };
        let changes = Changes {
            load: some("f", &load)?,
            gap: some("gap", &gap)?,
            slip_bound: some("slip_bound", &slip_bound)?,
            slip_origin: some("slip_origin", &slip_origin)?,
            friction: some("friction", &friction)?,
        };
        let (mut options, mut settings) = (EngineOptions::default(), self.settings.clone());
        settings::apply(&keywords, &mut options, &mut settings)?;
        let interrupt = Arc::new(AtomicBool::new(false));
        settings.ssnm.interrupt = Some(Arc::clone(&interrupt));
        let job = Job {
            of: self,
            options,
            settings,
            changes,
        };
        let before = before.as_deref();
        if before.is_some_and(|before| !before.is_of(&self.source)) {
            let text = "that is the solution of another problem: its K, N or T differs";
            return Err(argument("after", text));
        }
        let before = before.map(|solved| &solved.run);
        let plane = |made: Result<_, Failure>| made.map(|(run, error)| (AnyRun::Plane(run), error));
        let space = |made: Result<_, Failure>| made.map(|(run, error)| (AnyRun::Space(run), error));
        let (made, stopped) = watched(py, hears.as_ref(), &interrupt, |voice| {
            match (self.source.analysis(), before) {
                (AnyAnalysis::Plane(analysis), None) => plane(job.make(analysis, None, &voice)),
                (AnyAnalysis::Plane(analysis), Some(AnyRun::Plane(before))) => {
                    plane(job.make(analysis, Some(before), &voice))
                }
                (AnyAnalysis::Space(analysis), None) => space(job.make(analysis, None, &voice)),
                (AnyAnalysis::Space(analysis), Some(AnyRun::Space(before))) => {
                    space(job.make(analysis, Some(before), &voice))
                }
                _ => unreachable!("both are in one dimension"),
            }
        })?;
        let (run, failed) = made.map_err(|failure| match failure {
            Failure::Empty => argument("after", "no load step was made in it"),
            Failure::Problem(error) => wrong(error),
            Failure::Engine(error) => of_engine(error),
            Failure::Large => SolveError::new_err(
                "where displacements are large, a solve begins at rest with the friction of its model: leave out all that changes the \
                 problem, or geometry = \"large\"",
            ),
            Failure::Fork(what) => SolveError::new_err(format!("{what}: {}", fork::REMEDY)),
        })?;
        let solved = Solved {
            source: Arc::clone(&self.source),
            title: self.title.clone(),
            run,
        };
        Ok((solved, stopped.or(failed.map(of_solve))))
    }
}

/// The reason why a solve has no result.
enum Failure {
    /// The solution to start from is empty.
    Empty,
    Problem(ProblemError),
    Engine(signorini::engine::EngineError),
    /// Displacements may be large, and the solve is to change or to continue what the model states.
    Large,
    /// An operation that is impossible in a fork.
    Fork(&'static str),
}

/// A solve that was asked for.
struct Job<'a> {
    of: &'a Problem,
    options: EngineOptions,
    settings: StepSettings,
    changes: Changes,
}

/// Lets the lines of an engine be heard as long as it lives.
struct Listening<'a>(&'a Ear);

impl<'a> Listening<'a> {
    fn to(ear: &'a Ear, voice: &Voice) -> Self {
        *ear.lock().unwrap_or_else(PoisonError::into_inner) = voice.sender();
        Self(ear)
    }
}

impl Drop for Listening<'_> {
    fn drop(&mut self) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }
}

impl Job<'_> {
    /// Makes or takes the engine, and the load steps on it.
    fn make<const D: usize>(
        &self,
        analysis: Analysis<D>,
        before: Option<&Run<D>>,
        voice: &Voice,
    ) -> Result<(Run<D>, Option<solve::Error>), Failure>
    where
        ElementKind: Compiled<D>,
    {
        let start = Instant::now();
        let is_large = analysis.elastic.is_some_and(|elastic| elastic.is_large());
        if is_large && (before.is_some() || !self.changes.is_empty()) {
            return Err(Failure::Large);
        }
        let state = match before {
            Some(run) => Some(run.end(analysis.problem).ok_or(Failure::Empty)?),
            None => None,
        };
        let stated = analysis.problem;
        let mut changed = self
            .changes
            .made(analysis.problem, self.of.interference)
            .map_err(Failure::Problem)?;
        // Slip goes on from where it was measured in the step before.
        if let (None, Some(run)) = (&self.changes.slip_origin, before)
            && let Some(problem) = &run.problem
        {
            changed = changed
                .with_slip_origin(problem.slip_origin().to_vec())
                .map_err(Failure::Problem)?;
        }
        let analysis = Analysis {
            problem: &changed,
            elastic: analysis.elastic,
        };
        let mut report = Report::new(&self.of.title, analysis);
        for body in analysis.floating_bodies() {
            voice.tell(News::Line(body));
        }
        let asked = format!("{:?}", self.options);
        let mut kept = self.of.engine()?;
        let _listening = Listening::to(&self.of.ear, voice);
        // An engine that a panic, or other wishes, have left behind is of no use.
        let usable = kept.take().filter(|kept| kept.asked == asked);
        let mut engine = match usable {
            Some(kept) if !(fork::is_fork() && kept.engine.backend() == "gpu") => kept.engine,
            unusable => {
                let mut options = self.options.clone();
                if fork::is_fork() {
                    // Releasing a GPU that the parent uses may take for ever.
                    std::mem::forget(unusable);
                    if options.place == Device::Gpu || options.gpu.adapter.is_some() {
                        return Err(Failure::Fork("no GPU can be used after a fork"));
                    }
                    options.place = Device::Cpu;
                }
                let ear = Arc::clone(&self.of.ear);
                let log = move |line: &str| {
                    let ear = ear.lock().unwrap_or_else(PoisonError::into_inner);
                    if let Some(to) = &*ear {
                        let _ = to.send(News::Line(line.to_owned()));
                    }
                };
                let engine = ElementKind::engine(&changed, options, Box::new(log));
                engine.map_err(Failure::Engine)?
            }
        };
        report.set_up(&engine, start.elapsed().as_secs_f64());

        let (mut steps, mut number) = (Vec::new(), 0);
        let state = state.unwrap_or_else(|| quasistatic::State::at_rest(&changed));
        let made = ElementKind::solve_after(
            &analysis,
            state,
            &mut engine,
            &self.settings,
            &mut |event| {
                let mut goes_on = true;
                match event {
                    Event::Begins {
                        number: n,
                        cycle,
                        factor,
                    } => {
                        // Among those of all cycles; some cycles may be left out.
                        let n_steps = analysis.n_steps();
                        number = (cycle - 1) * n_steps + (n - 1) % n_steps + 1;
                        voice.tell(News::Begins(number, n_steps * analysis.n_cycles(), factor));
                    }
                    Event::Within(quasistatic::Event::Newton(step)) if voice.is_heard() => {
                        let mut row = serde_json::to_value(step).unwrap_or_default();
                        row["load_step"] = number.into();
                        goes_on = voice.ask(row.to_string(), step.to_string());
                    }
                    Event::Within(_) => {}
                    Event::Ends(solved) => {
                        report.add_step(&StepResults::new(analysis, &solved));
                        voice.tell(News::Ends(number, word(solved.solution.status)));
                        steps.push(Made::new(*solved));
                    }
                }
                match goes_on {
                    true => ControlFlow::Continue(()),
                    false => ControlFlow::Break(()),
                }
            },
        );
        report.set_path(EnginePath::of(&engine));
        report.timings.total = start.elapsed().as_secs_f64();
        let failed = made.err();
        if let Some(error) = &failed {
            report.fail(&error.to_string());
        }
        if self.changes.friction.is_some() {
            for (contact, law) in given_laws(stated, analysis) {
                for step in &mut report.steps {
                    law.clone_into(&mut step.contacts[contact].friction);
                }
            }
        }
        *kept = Some(Kept { asked, engine });
        drop(kept);
        let problem = match self.changes.is_empty() {
            true => None,
            false => Some(changed),
        };
        Ok((
            Run {
                problem,
                steps,
                report,
            },
            failed,
        ))
    }
}

/// The laws of the contacts to which a solve has given other coefficients of friction than they have in their model.
fn given_laws<const D: usize>(
    stated: &ContactProblem<D>,
    Analysis { problem, elastic }: Analysis<D>,
) -> Vec<(usize, &'static str)>
where
    ElementKind: Topology<D>,
{
    let Some(elastic) = elastic else {
        return Vec::new();
    };
    let mu = |of: &ContactProblem<D>, i| of.friction_coefficient().get(i).copied().unwrap_or(0.0);
    let law = |contact: usize| {
        let places = || (0..problem.m()).filter(|&i| elastic.pair_of[i] as usize == contact);
        let changes = places().any(|i| mu(stated, i) != mu(problem, i));
        changes.then(|| match places().any(|i| mu(problem, i) > 0.0) {
            true => (contact, "Coulomb, as given to the solve"),
            false => (contact, "no friction, as given to the solve"),
        })
    };
    (0..elastic.pairs.len()).filter_map(law).collect()
}

/// A status as reports write it.
pub fn word(status: signorini::ssnm::Status) -> String {
    let value = serde_json::to_value(status).unwrap_or_default();
    value.as_str().unwrap_or_default().to_owned()
}

/// Reads a case file with these `key.path=value`, and builds its problem.
#[pyfunction]
pub fn read_case(py: Python<'_>, path: PathBuf, settings: Vec<String>) -> PyResult<Problem> {
    guarded(py, || -> Result<Problem, Wrong> {
        let case = Case::read(&path, &settings).map_err(Wrong::Case)?;
        let source = case.build().map_err(Wrong::Build)?;
        let algebraic = case.tables.algebraic.as_ref();
        let interference = algebraic.is_some_and(|table| table.interference);
        Ok(Problem::new(
            source,
            &case.tables.title,
            case.settings(),
            interference,
        ))
    })?
    .map_err(PyErr::from)
}

/// Builds the model that the tables of a text state on a mesh.
#[pyfunction]
pub fn build(py: Python<'_>, mesh: PyRef<Mesh>, text: String) -> PyResult<Problem> {
    let mesh = mesh.copy();
    guarded(py, || -> Result<Problem, Wrong> {
        let case = Case::stated(text).map_err(Wrong::Case)?;
        let source = case.build_on_mesh(mesh).map_err(Wrong::Build)?;
        let (title, settings) = (&case.tables.title, case.settings());
        Ok(Problem::new(source, title, settings, false))
    })?
    .map_err(PyErr::from)
}

/// Checks everything in the tables of a text that needs no mesh.
#[pyfunction]
pub fn check_tables(py: Python<'_>, text: String, dim: usize) -> PyResult<()> {
    guarded(py, || {
        let case = Case::stated(text)?;
        case.check_parts(dim)
    })?
    .map_err(of_case)
}

/// A fault of a case.
enum Wrong {
    Case(signorini::case::CaseError),
    Build(signorini::case::BuildError),
}

impl From<Wrong> for PyErr {
    fn from(wrong: Wrong) -> Self {
        match wrong {
            Wrong::Case(error) => of_case(error),
            Wrong::Build(error) => of_build(error),
        }
    }
}
