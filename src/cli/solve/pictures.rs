//! What `--plots` draws, in a program that can draw.

use signorini::case::Build;
use signorini::mesh::Kind;
use signorini::model::StepData;
use signorini::output::{OutputError, Report};
use signorini::quasistatic::StepSolution;
use std::path::{Path, PathBuf};

#[cfg(feature = "plots")]
pub use signorini::output::plots::Draw;
#[cfg(feature = "plots")]
use signorini::output::plots::{Picture, pictures, write_pictures};

/// The pictures drawn so far.
#[cfg(feature = "plots")]
#[derive(Default)]
pub struct Pictures(Vec<Picture>);

/// Nothing is drawn, in whichever dimension.
#[cfg(not(feature = "plots"))]
pub trait Draw<const D: usize>: signorini::contact::Space<D> {}

#[cfg(not(feature = "plots"))]
impl<const D: usize, T: signorini::contact::Space<D>> Draw<D> for T {}

/// There are none.
#[cfg(not(feature = "plots"))]
pub enum Pictures {}

#[cfg(feature = "plots")]
impl Pictures {
    pub fn new() -> Result<Self, String> {
        Ok(Self::default())
    }

    /// Draws the step that was added to the report last.
    pub fn add_step<const D: usize>(
        &mut self,
        report: &Report,
        build: &Build<D>,
        data: Option<&StepData<D>>,
        solution: &StepSolution<D>,
        several: bool,
    ) where
        Kind: Draw<D>,
    {
        let drawn = <Kind as Draw<D>>::step_pictures(report, build, data, solution, several);
        self.0.extend(drawn);
    }

    /// Draws the whole, and writes all pictures and the page.
    pub fn write(&mut self, output: &Path, report: &Report) -> Result<Vec<PathBuf>, OutputError> {
        self.0.extend(pictures(report));
        write_pictures(output, report, &self.0)
    }
}

#[cfg(not(feature = "plots"))]
impl Pictures {
    pub fn new() -> Result<Self, String> {
        Err(
            "--plots: this program was built without pictures; leave it out, or build the program with its feature \
             `plots`: cargo build --release"
                .to_owned(),
        )
    }

    pub fn add_step<const D: usize>(
        &mut self,
        _: &Report,
        _: &Build<D>,
        _: Option<&StepData<D>>,
        _: &StepSolution<D>,
        _: bool,
    ) where
        Kind: Draw<D>,
    {
        match *self {}
    }

    pub fn write(&mut self, _: &Path, _: &Report) -> Result<Vec<PathBuf>, OutputError> {
        match *self {}
    }
}
