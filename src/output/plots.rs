//! Pictures of a solve (SVG) and `report.html`, a page with all of them.

mod bodies;
mod camera;
pub mod chart;
mod contact_surface;
mod curves;
mod developed;
mod html;
mod legend;
mod obstacles;
mod picture;
mod raster;
mod solid;
mod surface;
mod svg;
mod view;
mod zbuffer;

use super::files::write;
use super::{OutputError, Report, StepResults};
use crate::contact::Space;
use crate::mesh::ElementKind;
use bodies::Bodies;
use chart::Chart;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use surface::Surface;
pub use view::View;

/// A picture of a solve.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The name of its file, without `.svg`.
    pub name: String,
    /// The load step that it shows, from 1; None for all steps.
    pub step: Option<usize>,
    /// The title.
    pub title: String,
    /// The picture itself.
    pub svg: String,
    /// Its view in `report.html`.
    pub view: Option<View>,
}

/// Implemented by [`ElementKind`] for both dimensions: how bodies and contacts are drawn there.
pub trait Draw<const D: usize>: Space<D>
where
    ElementKind: Space<D>,
{
    /// The deformed bodies under a title, and their view.
    fn deformed(title: &str, bodies: &Bodies<D>) -> (String, Option<View>);

    /// A contact under a title.
    fn contact(title: &str, bodies: &Bodies<D>, pair: usize) -> String;

    /// The pictures of the step that was added to the report last.
    fn step_pictures(report: &Report, results: &StepResults<D>) -> Vec<Picture> {
        let Some(of) = &results.of_bodies else {
            return Vec::new();
        };
        let step = report.steps.len();
        // Behind the names of files, and behind titles.
        let cycles = results.analysis.n_cycles() > 1;
        let suffix = match of.elastic.n_steps() > 1 || cycles {
            true => format!("-{step:03}"),
            false => String::new(),
        };
        let within = (step - 1) % of.elastic.n_steps() + 1;
        let of_step = match (suffix.is_empty(), cycles) {
            (true, _) => String::new(),
            (_, false) => format!(", load step {step}"),
            (_, true) => format!(", cycle {}, load step {within}", results.solution.cycle),
        };
        let whole = of.whole(of.elastic.mesh.elements.len());
        let bodies = match &whole {
            None => Bodies::new(step, of.elastic, &of.fields, &of.contact),
            Some(all) => Bodies::new(step, &all.elastic, &all.fields, &all.contact),
        };
        let pairs = &of.elastic.pairs;
        let picture = |name: &str, title: &str, svg, view| Picture {
            name: format!("{name}{suffix}"),
            step: Some(step),
            title: format!("{title}{of_step}"),
            svg,
            view,
        };
        let deformed = || {
            let usual = "Deformed bodies";
            let title = if report.title.is_empty() {
                usual
            } else {
                &report.title
            };
            let (svg, view) = Self::deformed(&format!("{title}{of_step}"), &bodies);
            picture("deformed", usual, svg, view)
        };
        // Nodes that move alike have no surface.
        let drawn = pairs.par_iter().filter(|pair| !pair.is_of_nodes());
        let n_drawn = drawn.count();
        let all = pairs.par_iter().enumerate();
        let contacts = all.filter(|(_, pair)| !pair.is_of_nodes());
        let contacts = contacts.map(|(number, pair)| {
            let name = match n_drawn {
                1 => "contact".to_owned(),
                _ => format!("contact-{}", number + 1),
            };
            let title = pair.title();
            let svg = Self::contact(&format!("{title}{of_step}"), &bodies, number);
            picture(&name, &format!("Contact {title}"), svg, None)
        });
        let (deformed, contacts) = rayon::join(deformed, || contacts.collect::<Vec<_>>());
        std::iter::once(deformed).chain(contacts).collect()
    }
}

/// The deformed bodies, and a chart for each contact.
impl Draw<2> for ElementKind {
    fn deformed(title: &str, bodies: &Bodies) -> (String, Option<View>) {
        let view = || {
            let mesh = &bodies.elastic.mesh;
            let obstacles = obstacles::bands(bodies.elastic);
            View::new(
                bodies,
                &Surface::of_plane(mesh),
                &obstacles,
                [0.0, 0.0, 1.0],
            )
        };
        let (svg, view) = rayon::join(|| picture::svg(title, bodies), view);
        (svg, Some(view))
    }

    fn contact(title: &str, bodies: &Bodies, pair: usize) -> String {
        curves::contact(title, bodies, pair).svg()
    }
}

/// The deformed bodies from two sides, and each contact surface.
impl Draw<3> for ElementKind {
    fn deformed(title: &str, bodies: &Bodies<3>) -> (String, Option<View>) {
        let solids = solid::Solids::new(bodies);
        let back = solids.cameras[0].back;
        let view = || View::new(bodies, &solids.surface, &solids.obstacles, back);
        let (svg, view) = rayon::join(|| solids.svg(title), view);
        (svg, Some(view))
    }

    fn contact(title: &str, bodies: &Bodies<3>, pair: usize) -> String {
        contact_surface::svg(title, bodies, pair)
    }
}

/// The pictures of the whole: the convergence, the contact forces where there are several steps, and wear over the cycles.
pub fn pictures(report: &Report) -> Vec<Picture> {
    let mut charts = vec![("convergence", curves::convergence(report))];
    charts.extend(curves::wear(report).map(|chart| ("wear", chart)));
    if report.steps.len() > 1 && report.steps.iter().any(|s| !s.contacts.is_empty()) {
        charts.insert(0, ("steps", curves::steps(report)));
    }
    let picture = |(name, chart): (&str, Chart)| Picture {
        name: name.to_owned(),
        step: None,
        svg: chart.svg(),
        title: chart.title,
        view: None,
    };
    charts.into_iter().map(picture).collect()
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
    let page = html::page(report, pictures);
    files.push(write(directory, "report.html", page)?);
    Ok(files)
}
