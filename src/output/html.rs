//! `report.html`: everything of a solve on one page that a browser opens offline.

use super::chart::escape;
use super::{Picture, Report};
use crate::ssnm::Status;
use std::fmt::Write as _;

const STYLE: &str = "
body { font: 15px/1.5 system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif; color: #222; background: #fff; max-width: 920px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: .2rem } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid #ddd; padding-bottom: .2rem }
.status { display: inline-block; padding: .1rem .6rem; border-radius: .3rem; color: #fff; background: #00795a } .status.bad { background: #b5342b }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums } th, td { padding: .2rem .8rem .2rem 0; text-align: right; border-bottom: 1px solid #eee; vertical-align: top } th:first-child, td:first-child { text-align: left } th { font-weight: 600; color: #555 }
summary { cursor: pointer; margin: .5rem 0 } figure { margin: 1rem 0; overflow-x: auto } figure svg { max-width: 100%; height: auto } .scroll { overflow-x: auto } p.note { color: #555 }
";

/// Pictures of earlier load steps are on the page where there are no more steps than this.
const MOST_STEPS: usize = 12;

/// A table with a head; cells are escaped.
fn table(out: &mut String, head: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    out.push_str("<div class=\"scroll\"><table><tr>");
    for cell in head {
        write!(out, "<th>{}</th>", escape(cell)).expect("writing to a string cannot fail");
    }
    out.push_str("</tr>\n");
    for row in rows {
        out.push_str("<tr>");
        for cell in row {
            write!(out, "<td>{}</td>", escape(&cell)).expect("writing to a string cannot fail");
        }
        out.push_str("</tr>\n");
    }
    out.push_str("</table></div>\n");
}

pub(super) fn page(report: &Report, pictures: &[Picture]) -> String {
    let title = if report.title.is_empty() {
        "signorini"
    } else {
        &report.title
    };
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><title>{0}</title><style>{STYLE}</style></head>\n<body>\n<h1>{0}</h1>\n",
        escape(title)
    );
    let out = &mut page;
    let (class, text) = match report.status {
        Some(Status::Converged) => ("status", "converged"),
        Some(Status::IterationLimit) => ("status bad", "NOT converged: iteration limit"),
        Some(Status::Stagnated) => ("status bad", "NOT converged: stagnated"),
        Some(Status::NotHeld) => ("status bad", "NOT converged: a body is not held"),
        Some(Status::TimeLimit) => ("status bad", "NOT converged: time limit"),
        Some(Status::Interrupted) => ("status bad", "NOT converged: interrupted"),
        None => ("status bad", "ended by an error"),
    };
    writeln!(
        out,
        "<p><span class=\"{class}\">{text}</span> {} unknowns, {} contact nodes, {:.2} s; optimality conditions met to {:.1e}</p>",
        report.n,
        report.m,
        report.timings.total,
        report.kkt.max()
    )
    .expect("writing to a string cannot fail");
    for line in report.error.iter().chain(&report.hints) {
        writeln!(out, "<p class=\"note\">{}</p>", escape(line))
            .expect("writing to a string cannot fail");
    }
    let last = report.steps.len();
    let show = |out: &mut String, picture: &Picture| {
        writeln!(
            out,
            "<h2>{}</h2>\n<figure>\n{}</figure>",
            escape(&picture.title),
            picture.svg
        )
        .expect("writing to a string cannot fail");
    };
    let of_last = |picture: &&Picture| picture.step == Some(last);
    for picture in pictures.iter().filter(of_last) {
        show(out, picture);
    }
    for picture in pictures.iter().filter(|p| p.step.is_none()) {
        show(out, picture);
    }
    if last > 1 && last <= MOST_STEPS {
        for step in 1..last {
            writeln!(out, "<details><summary>Load step {step}</summary>")
                .expect("writing to a string cannot fail");
            for picture in pictures.iter().filter(|p| p.step == Some(step)) {
                writeln!(out, "<figure>\n{}</figure>", picture.svg)
                    .expect("writing to a string cannot fail");
            }
            out.push_str("</details>\n");
        }
    }
    let force = &report.units.force;
    if let Some(step) = report.steps.last() {
        let vector = |v: [f64; 2]| [format!("{:.6e}", v[0]), format!("{:.6e}", v[1])];
        if !step.contacts.is_empty() {
            out.push_str("<h2>Contacts at the end</h2>\n");
            table(
                out,
                &[
                    "contact",
                    "friction",
                    &format!("force x ({force})"),
                    &format!("force y ({force})"),
                    &format!("largest pressure ({})", report.units.stress()),
                    &format!("area in contact ({})", report.units.area()),
                    "separated",
                    "stick",
                    "slip",
                    "without friction",
                ],
                step.contacts.iter().map(|c| {
                    let [x, y] = vector(c.force);
                    vec![
                        format!("{} / {}", c.boundary, c.against),
                        c.friction.clone(),
                        x,
                        y,
                        format!("{:.4e}", c.max_pressure),
                        format!("{:.4e}", c.area),
                        c.separated.to_string(),
                        c.stick.to_string(),
                        c.slip.to_string(),
                        c.frictionless.to_string(),
                    ]
                }),
            );
            out.push_str(
                "<p class=\"note\">Forces act on the body of the boundary named first.</p>\n",
            );
        }
        if !step.supports.is_empty() || step.total_load.is_some() {
            out.push_str("<h2>Balance of forces</h2>\n");
            let loads = step.total_load.map(|f| ("all loads".to_owned(), f));
            table(
                out,
                &["", &format!("x ({force})"), &format!("y ({force})")],
                loads
                    .into_iter()
                    .chain(
                        step.supports
                            .iter()
                            .map(|s| (format!("support {}", s.support), s.force)),
                    )
                    .map(|(name, force)| {
                        let [x, y] = vector(force);
                        vec![name, x, y]
                    }),
            );
        }
    }
    if report.steps.len() > 1 {
        out.push_str("<h2>Load steps</h2>\n");
        table(
            out,
            &[
                "step",
                "factor",
                "rounds",
                "outer steps",
                "products with A",
                "separated",
                "stick",
                "slip",
            ],
            report.steps.iter().enumerate().map(|(i, s)| {
                vec![
                    (i + 1).to_string(),
                    s.factor.to_string(),
                    s.rounds.to_string(),
                    s.iter.to_string(),
                    s.n_a.to_string(),
                    s.sets.separated.to_string(),
                    s.sets.stick.to_string(),
                    (s.sets.slip_plus + s.sets.slip_minus).to_string(),
                ]
            }),
        );
    }
    out.push_str("<h2>Optimality conditions</h2>\n");
    let kkt = &report.kkt;
    table(
        out,
        &["condition", "violation"],
        [
            ("equilibrium ‖Ku + Nᵀλν + Tᵀλτ − f‖ / ‖f‖", kkt.equilibrium),
            ("penetration max(Nu − d)₊ / ‖u‖∞", kkt.penetration),
            ("tension max(−λν)₊ / ‖λ‖∞", kkt.tension),
            (
                "complementarity |λνᵀ(Nu − d)| / (‖λ‖ ‖u‖)",
                kkt.complementarity,
            ),
            ("friction bound max(|λτ| − g)₊ / ‖g‖∞", kkt.friction_bound),
            ("slip against friction / ‖u‖∞", kkt.slip),
        ]
        .into_iter()
        .map(|(name, value)| vec![name.to_owned(), format!("{value:.2e}")]),
    );
    out.push_str("<h2>Work</h2>\n");
    let t = &report.timings;
    let engine = &report.path;
    table(
        out,
        &["", ""],
        [
            ("outer steps", report.iter.to_string()),
            ("products with A", report.n_a.to_string()),
            (
                "K⁻¹ by",
                match (&engine.adapter, engine.stiffness) {
                    (Some(adapter), stiffness) => format!("{stiffness} on {adapter}"),
                    (None, stiffness) => format!("{stiffness} on the {}", engine.backend),
                },
            ),
            ("mesh", format!("{:.3} s", t.mesh)),
            ("assembly", format!("{:.3} s", t.assembly)),
            ("factorisation or set-up", format!("{:.3} s", t.factor)),
            ("b and σ_max", format!("{:.3} s", t.setup)),
            ("contact", format!("{:.3} s", t.ssnm)),
            ("in all", format!("{:.3} s", t.total)),
            ("version", report.version.to_owned()),
        ]
        .into_iter()
        .map(|(name, value)| vec![name.to_owned(), value]),
    );
    out.push_str("</body></html>\n");
    page
}
