//! What `--plots` draws, in a program that can draw.

use signorini::case::Build;
use signorini::model::StepData;
use signorini::output::{OutputError, Report};
use signorini::quasistatic::StepSolution;
use std::path::{Path, PathBuf};

#[cfg(feature = "plots")]
use signorini::output::plots::{Picture, pictures, step_pictures, write_pictures};

/// The pictures drawn so far.
#[cfg(feature = "plots")]
#[derive(Default)]
pub struct Pictures(Vec<Picture>);

/// There are none.
#[cfg(not(feature = "plots"))]
pub enum Pictures {}

#[cfg(feature = "plots")]
impl Pictures {
    pub fn new() -> Result<Self, String> {
        Ok(Self::default())
    }

    /// Draws the step that was added to the report last.
    pub fn add_step(
        &mut self,
        report: &Report,
        build: &Build,
        data: Option<&StepData>,
        solution: &StepSolution,
        several: bool,
    ) {
        let drawn = step_pictures(report, build, data, solution, several);
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

    pub fn add_step(
        &mut self,
        _: &Report,
        _: &Build,
        _: Option<&StepData>,
        _: &StepSolution,
        _: bool,
    ) {
        match *self {}
    }

    pub fn write(&mut self, _: &Path, _: &Report) -> Result<Vec<PathBuf>, OutputError> {
        match *self {}
    }
}
