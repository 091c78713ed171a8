//! Pictures of a solve (SVG) and `report.html`, a page with all of them.

pub mod chart;
mod curves;
mod html;
mod legend;
mod picture;
mod raster;

use super::files::write;
use super::{ContactFields, OutputError, Report, StepFields};
use crate::case::Build;
use crate::contact::Space;
use crate::mesh::Kind;
use crate::model::StepData;
use crate::quasistatic::StepSolution;
use std::path::{Path, PathBuf};

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

/// Implemented by [`Kind`] for both dimensions: what can be drawn of bodies there.
pub trait Draw<const D: usize>: Space<D>
where
    Kind: Space<D>,
{
    /// Whether bodies and what happens along their contacts are drawn; charts of the whole solve always are.
    const BODIES: bool;

    /// The pictures at the end of the step that was added to the report last. `several` says whether there are more
    /// steps, which goes into the names.
    fn step_pictures(
        report: &Report,
        build: &Build<D>,
        data: Option<&StepData<D>>,
        solution: &StepSolution<D>,
        several: bool,
    ) -> Vec<Picture>;
}

/// The deformed bodies, and a chart for each contact.
impl Draw<2> for Kind {
    const BODIES: bool = true;

    fn step_pictures(
        report: &Report,
        build: &Build,
        data: Option<&StepData>,
        solution: &StepSolution,
        several: bool,
    ) -> Vec<Picture> {
        of_plane(report, build, data, solution, several)
    }
}

/// Solids are for ParaView so far.
impl Draw<3> for Kind {
    const BODIES: bool = false;

    fn step_pictures(
        _: &Report,
        _: &Build<3>,
        _: Option<&StepData<3>>,
        _: &StepSolution<3>,
        _: bool,
    ) -> Vec<Picture> {
        Vec::new()
    }
}

/// The pictures of a step in the plane.
fn of_plane(
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
        let mut chart = curves::contact(elastic, &contact, i);
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
    let mut charts = vec![("convergence", curves::convergence(report))];
    if report.steps.len() > 1 && report.steps.iter().any(|s| !s.contacts.is_empty()) {
        charts.insert(0, ("steps", curves::steps(report)));
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
    let mut files = (pictures.iter())
        .map(|picture| write(directory, &format!("{}.svg", picture.name), &picture.svg))
        .collect::<Result<Vec<_>, _>>()?;
    files.push(write(
        directory,
        "report.html",
        html::page(report, pictures),
    )?);
    Ok(files)
}
