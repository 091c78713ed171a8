//! `signorini export`.

use super::advice::message_of;
use super::{ExportArguments, NOT_CONVERGED};
use signorini::case::Case;
use signorini::contact::Space;
use signorini::mesh::ElementKind;
use signorini::model::{Analysis, AnyAnalysis};
use signorini::output::{self, ExportError};
use signorini::solve;

pub fn run(arguments: &ExportArguments) -> Result<u8, String> {
    let case = Case::read(&arguments.case, &arguments.settings).map_err(|e| message_of(&e))?;
    let made = case.build().map_err(|e| message_of(&e))?;
    match made.analysis() {
        AnyAnalysis::Plane(analysis) => export(&case, analysis, arguments),
        AnyAnalysis::Space(analysis) => export(&case, analysis, arguments),
    }
}

fn export<const D: usize>(
    case: &Case,
    analysis: Analysis<D>,
    arguments: &ExportArguments,
) -> Result<u8, String>
where
    ElementKind: Space<D>,
{
    let log = |line: &str| eprintln!("{line}");
    let options = arguments.engine.options();
    match output::export(&arguments.directory, case, analysis, options, log) {
        Ok(files) => {
            let files: String = (files.iter())
                .map(|file| format!("{}\n", file.display()))
                .collect();
            super::print(&files)?;
            Ok(0)
        }
        Err(error @ ExportError::NotConverged { .. }) => {
            eprintln!("{}: {error}", arguments.case.display());
            Ok(NOT_CONVERGED)
        }
        Err(ExportError::Solve(solve::Error::Model(error))) => {
            Err(message_of(&case.at_line(error)))
        }
        Err(ExportError::Output(error)) => Err(message_of(&error)),
        Err(error) => Err(format!(
            "{}: {}",
            arguments.case.display(),
            message_of(&error)
        )),
    }
}
