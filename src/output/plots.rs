//! Pictures of a solve (SVG) and `report.html`, a page with all of them.

mod camera;
pub mod chart;
mod contact_surface;
mod curves;
mod html;
mod legend;
mod obstacles;
mod picture;
mod raster;
mod sheet;
mod solid;
mod surface;
mod view;
mod zbuffer;

use super::files::write;
use super::{ContactFields, OutputError, Report, StepFields, StepResults};
use crate::contact::Space;
use crate::mesh::{Kind, Topology};
use crate::model::Elastic;
use std::path::{Path, PathBuf};
pub use view::View;

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
    /// What can be turned beside it in `report.html`.
    pub view: Option<View>,
}

/// Implemented by [`Kind`] for both dimensions: how bodies and contacts are drawn there.
pub trait Draw<const D: usize>: Space<D>
where
    Kind: Space<D>,
{
    /// The deformed bodies under a title at the end of a step, counted from 1, and what can be turned of them.
    fn deformed(
        title: &str,
        step: usize,
        elastic: &Elastic<D>,
        fields: &StepFields<D>,
        contact: &ContactFields<D>,
    ) -> (String, Option<View>);

    /// A contact at the end of a step, whose title ends with `of_step`.
    fn contact(
        of_step: &str,
        step: usize,
        elastic: &Elastic<D>,
        contact: &ContactFields<D>,
        pair: usize,
    ) -> String;

    /// The pictures of the step that was added to the report last.
    fn step_pictures(report: &Report, results: &StepResults<D>) -> Vec<Picture> {
        let Some(of) = &results.of_bodies else {
            return Vec::new();
        };
        let (elastic, fields, contact) = (of.elastic, &of.fields, &of.contact);
        let names = Names::new(report, elastic.n_steps() > 1);
        let (svg, view) = Self::deformed(&names.title(), names.step, elastic, fields, contact);
        let mut pictures = vec![names.deformed(svg, view)];
        for pair in 0..elastic.pairs.len() {
            let svg = Self::contact(&names.of_step, names.step, elastic, contact, pair);
            pictures.push(names.contact(elastic, pair, svg));
        }
        pictures
    }
}

/// The deformed bodies, and a chart for each contact.
impl Draw<2> for Kind {
    fn deformed(
        title: &str,
        step: usize,
        elastic: &Elastic,
        fields: &StepFields,
        contact: &ContactFields,
    ) -> (String, Option<View>) {
        (picture::svg(title, step, elastic, fields, contact), None)
    }

    fn contact(
        of_step: &str,
        _: usize,
        elastic: &Elastic,
        contact: &ContactFields,
        pair: usize,
    ) -> String {
        let mut chart = curves::contact(elastic, contact, pair);
        chart.title += of_step;
        chart.svg()
    }
}

/// The deformed bodies from two sides, and each contact surface.
impl Draw<3> for Kind {
    fn deformed(
        title: &str,
        step: usize,
        elastic: &Elastic<3>,
        fields: &StepFields<3>,
        contact: &ContactFields<3>,
    ) -> (String, Option<View>) {
        let solids = solid::Solids::new(elastic, fields, contact);
        (solids.svg(title, step), Some(View::new(&solids, step)))
    }

    fn contact(
        of_step: &str,
        step: usize,
        elastic: &Elastic<3>,
        contact: &ContactFields<3>,
        number: usize,
    ) -> String {
        let pair = &elastic.pairs[number];
        let title = format!("{} / {}{of_step}", pair.boundary, pair.against);
        let id = format!("p{number}t{step}");
        contact_surface::svg(&title, &id, elastic, contact, number)
    }
}

/// The names of the pictures of the step that was added to the report last.
struct Names<'a> {
    report: &'a Report,
    step: usize,
    /// Behind the names of files, and behind titles.
    suffix: String,
    of_step: String,
}

impl<'a> Names<'a> {
    fn new(report: &'a Report, several: bool) -> Self {
        let step = report.steps.len();
        let (suffix, of_step) = if several {
            (format!("-{step:03}"), format!(", load step {step}"))
        } else {
            Default::default()
        };
        Self {
            report,
            step,
            suffix,
            of_step,
        }
    }

    /// What stands above the deformed bodies.
    fn title(&self) -> String {
        let title = match self.report.title.as_str() {
            "" => "Deformed bodies",
            title => title,
        };
        format!("{title}{}", self.of_step)
    }

    /// The picture of the deformed bodies.
    fn deformed(&self, svg: String, view: Option<View>) -> Picture {
        Picture {
            name: format!("deformed{}", self.suffix),
            step: Some(self.step),
            title: format!("Deformed bodies{}", self.of_step),
            svg,
            view,
        }
    }

    /// The picture of a contact.
    fn contact<const D: usize>(&self, elastic: &Elastic<D>, pair: usize, svg: String) -> Picture
    where
        Kind: Topology<D>,
    {
        let number = match elastic.pairs.len() {
            1 => String::new(),
            _ => format!("-{}", pair + 1),
        };
        let (suffix, of_step) = (&self.suffix, &self.of_step);
        let pair = &elastic.pairs[pair];
        Picture {
            name: format!("contact{number}{suffix}"),
            step: Some(self.step),
            title: format!("Contact {} / {}{of_step}", pair.boundary, pair.against),
            svg,
            view: None,
        }
    }
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
            view: None,
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
