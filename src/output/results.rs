//! The results of a run, written as its load steps end.

use super::files::{prepare, write_fields, write_index, write_report, write_vectors};
#[cfg(feature = "plots")]
pub use super::plots::Draw;
#[cfg(feature = "plots")]
use super::plots::{Picture, pictures, write_pictures};
use super::rubbing::Rubbing;
use super::{ContactFields, EnginePath, OutputError, Report, StepFields};
use crate::contact::Space;
use crate::dual::DualOperator as _;
use crate::engine::{Engine, slowness};
use crate::mesh::{ElementKind, Topology};
use crate::model::{Analysis, Elastic, StepData};
use crate::quasistatic::StepSolution;
use crate::solve::Solved;
use crate::ssnm::Status;
use std::path::{Path, PathBuf};
use web_time::Instant;

/// Without the feature `plots` nothing is drawn, in either dimension.
#[cfg(not(feature = "plots"))]
pub trait Draw<const D: usize>: Space<D> {}

#[cfg(not(feature = "plots"))]
impl<const D: usize, T: Space<D>> Draw<D> for T {}

/// A load step that has ended, with the fields that follow from its solution.
pub struct StepResults<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The subject of the solve.
    pub analysis: Analysis<'a, D>,
    /// u, λ, and how they were found.
    pub solution: &'a StepSolution<D>,
    /// Of the bodies; None where the problem was made from matrices.
    pub of_bodies: Option<OfBodies<'a, D>>,
    /// [`Solved::parts`].
    pub parts: usize,
}

/// The fields of the bodies at the end of a load step.
pub struct OfBodies<'a, const D: usize = 2>
where
    ElementKind: Topology<D>,
{
    /// The bodies.
    pub elastic: &'a Elastic<D>,
    /// Their load.
    pub data: &'a StepData<D>,
    /// Displacements and stresses.
    pub fields: StepFields<D>,
    /// The fields at the contact places.
    pub contact: ContactFields<D>,
}

impl<'a, const D: usize> StepResults<'a, D>
where
    ElementKind: Space<D>,
{
    /// From a step of the solve.
    pub fn new(analysis: Analysis<'a, D>, solved: &'a Solved<D>) -> Self {
        let solution = &solved.solution;
        let displaced = solved.displaced.as_deref();
        let analysis = displaced.map_or(analysis, Analysis::from);
        let of_bodies = analysis.elastic.zip(solved.data).map(|(elastic, data)| {
            let (fields, contact) = rayon::join(
                || StepFields::new(elastic, data, solution),
                || ContactFields::new(analysis.problem, elastic, data, solution),
            );
            OfBodies {
                elastic,
                data,
                fields,
                contact,
            }
        });
        Self {
            analysis,
            solution,
            of_bodies,
            parts: solved.parts,
        }
    }
}

/// The files of a run: those of a load step as it ends, and the report in the end.
///
/// # Example
/// A block pressed on a plane in two load steps, with everything that `signorini solve --plots` writes:
///
/// ```
/// use signorini::contact::Obstacle;
/// use signorini::elasticity::Material;
/// use signorini::engine::Engine;
/// use signorini::mesh::structured::{SolidShape, block};
/// use signorini::model::{Analysis, Model, Pair, Support, Traction};
/// use signorini::output::Results;
/// use signorini::solve::Event;
/// use std::ops::ControlFlow;
///
/// let floor = Obstacle::HalfSpace { point: [0.0; 3], normal: [0.0, 0.0, 1.0] };
/// let built = Model::on(block([0.0; 3], [3.0, 1.0, 1.0], [6, 2, 2], SolidShape::Hexahedron, "steel", ""))
///     .material(Material::new(2.1e11, 0.3))
///     .support(Support::on("left").fixed())
///     .traction(Traction::on("top").z(-1e7))
///     .contact(Pair::obstacle("bottom", floor).coulomb(0.2))
///     .steps([0.5, 1.0])
///     .build()?;
/// let analysis = Analysis::from(&built);
/// # let directory = tempfile::tempdir()?;
/// # let directory = directory.path();
/// let mut results = Results::new(directory, "Pressed", analysis)?;
/// # #[cfg(feature = "plots")]
/// results.draw();
/// let mut engine = Engine::new(analysis.problem, Default::default(), |line| println!("{line}"))?;
/// let mut written = Ok(());
/// analysis.solve_on(&mut engine, &Default::default(), |event| {
///     if let Event::Ends(step) = event {
///         written = results.add(&step);
///     }
///     // Without its results there is no use in going on.
///     if written.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
/// })?;
/// written?;
/// results.add_engine(&mut engine);
/// let files = results.finish()?;
/// for name in ["solution-001.vtu", "solution-002.vtu", "contact-002.csv", "solution.pvd", "report.json"] {
///     assert!(files.contains(&directory.join(name)), "{name}");
/// }
/// # #[cfg(feature = "plots")]
/// assert!(files.contains(&directory.join("report.html")));
/// // What report.json says is at hand, too.
/// let pressed = &results.report.steps[1].contacts[0];
/// assert!(pressed.normal_force > 0.0 && pressed.separated == 0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Results<'a, const D: usize = 2>
where
    ElementKind: Draw<D>,
{
    analysis: Analysis<'a, D>,
    directory: PathBuf,
    begin: Instant,
    /// The future `report.json`.
    pub report: Report,
    files: Vec<PathBuf>,
    rubbing: Rubbing,
    /// None: not asked for.
    #[cfg(feature = "plots")]
    pictures: Option<Vec<Picture>>,
}

impl<'a, const D: usize> Results<'a, D>
where
    ElementKind: Draw<D>,
{
    /// For a run that is about to begin: removes the results of an earlier run in `directory`, recognised by their names,
    /// and makes the directory if necessary.
    ///
    /// # Errors
    /// If files cannot be written or removed there.
    pub fn new(
        directory: &Path,
        title: &str,
        analysis: impl Into<Analysis<'a, D>>,
    ) -> Result<Self, OutputError> {
        prepare(directory, &[])?;
        let analysis = analysis.into();
        Ok(Self {
            report: Report::new(title, analysis),
            analysis,
            directory: directory.to_owned(),
            begin: Instant::now(),
            files: Vec::new(),
            rubbing: Rubbing::default(),
            #[cfg(feature = "plots")]
            pictures: None,
        })
    }

    /// Sets the beginning of the run, if it was before [`Results::new`].
    pub fn set_begin(&mut self, begin: Instant) {
        self.begin = begin;
    }

    /// Pictures of all steps that follow, and `report.html`, are wanted as well.
    #[cfg(feature = "plots")]
    pub fn draw(&mut self) {
        self.pictures.get_or_insert_default();
    }

    /// Adds a load step to the report, and writes and draws its fields.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn add(&mut self, solved: &Solved<D>) -> Result<(), OutputError> {
        let start = Instant::now();
        let mut results = StepResults::new(self.analysis, solved);
        if let Some(of) = &mut results.of_bodies {
            self.rubbing.add(of, results.solution);
        }
        self.report.add_step(&results);
        let n_cycles = self.analysis.n_cycles();
        let several = self.analysis.n_steps() * n_cycles > 1;
        let suffix = match several {
            true => format!("-{:03}", solved.number),
            false => String::new(),
        };
        // Of cycles, the first and the last are drawn.
        #[cfg(feature = "plots")]
        let is_drawn = [1, n_cycles].contains(&solved.solution.cycle);
        let (directory, report) = (&self.directory, &self.report);
        let write = || match &results.of_bodies {
            Some(of) => write_fields(directory, of, &suffix),
            None => write_vectors(directory, results.analysis.problem, results.solution),
        };
        #[cfg(feature = "plots")]
        let written = match &mut self.pictures {
            Some(all) if is_drawn => {
                let draw = || <ElementKind as Draw<D>>::step_pictures(report, &results);
                let (written, drawn) = rayon::join(write, draw);
                all.extend(drawn);
                written
            }
            _ => write(),
        };
        #[cfg(not(feature = "plots"))]
        let written = write();
        self.files.extend(written?);
        if several {
            // After every step, so that ParaView can look in.
            let index = write_index(directory, &report.steps, "vtu")?;
            if solved.number == 1 {
                self.files.push(index);
            }
        }
        self.report.timings.output += start.elapsed().as_secs_f64();
        Ok(())
    }

    /// Adds the engine of the run and its work to the report. If the run has converged, the V-cycles of one linear solve are
    /// counted too, which takes about as long as such a solve.
    pub fn add_engine(&mut self, engine: &mut Engine) {
        let mut path = EnginePath::of(engine);
        if self.report.status == Some(Status::Converged) {
            // The cost of the whole solve in linear solves; after an interrupt nobody waits for it.
            path.v_cycles_linear = engine.linear_iterations(1e-8).ok().flatten();
        }
        if path.stiffness == "pcg"
            && let Some(text) = slowness(self.analysis.problem)
        {
            (self.report.hints).push(format!("{text}: with memory for it, --stiffness cholesky"));
        }
        self.report.set_path(path);
    }

    /// Writes the pictures of the whole run and the report; returns all files written. After an error, call [`Report::fail`]
    /// first.
    ///
    /// # Errors
    /// If a file cannot be written; the report then records it, if possible.
    pub fn finish(&mut self) -> Result<&[PathBuf], OutputError> {
        self.report.timings.total = self.begin.elapsed().as_secs_f64();
        let drawn = self.write_pictures();
        if let Err(error) = &drawn {
            self.report.fail(&error.to_string());
        }
        // Whether or not there was room for pictures.
        let report = write_report(&self.directory, &self.report)?;
        self.files.extend(drawn?);
        self.files.push(report);
        Ok(&self.files)
    }

    #[cfg(feature = "plots")]
    fn write_pictures(&mut self) -> Result<Vec<PathBuf>, OutputError> {
        let Some(all) = &mut self.pictures else {
            return Ok(Vec::new());
        };
        all.extend(pictures(&self.report));
        write_pictures(&self.directory, &self.report, all)
    }

    #[cfg(not(feature = "plots"))]
    fn write_pictures(&mut self) -> Result<Vec<PathBuf>, OutputError> {
        Ok(Vec::new())
    }
}
