//! `report.html`: everything of a solve on one page that a browser opens offline.

use super::chart::escape;
use super::{Picture, view};
use crate::output::{Report, StepReport, put};
use crate::ssnm::Status;

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
fn table(out: &mut String, head: &[impl AsRef<str>], rows: impl Iterator<Item = Vec<String>>) {
    out.push_str("<div class=\"scroll\"><table>");
    let mut row = |tag: &str, cells: &mut dyn Iterator<Item = &str>| {
        let cells: String = cells
            .map(|cell| format!("<{tag}>{}</{tag}>", escape(cell)))
            .collect();
        put(out, format_args!("<tr>{cells}</tr>"));
    };
    row("th", &mut head.iter().map(AsRef::as_ref));
    for cells in rows {
        row("td", &mut cells.iter().map(String::as_str));
    }
    out.push_str("</table></div>\n");
}

/// The page.
pub(super) fn page(report: &Report, pictures: &[Picture]) -> String {
    let mut page = String::new();
    let out = &mut page;
    head(out, report);
    let has_view = figures(out, report, pictures);
    if let Some(step) = report.steps.last() {
        contacts(out, report, step);
        balance(out, report, step);
    }
    if report.steps.len() > 1 {
        steps(out, report);
    }
    conditions(out, report);
    work(out, report);
    if has_view {
        view::put_script(out);
    }
    page + "</body></html>\n"
}

/// The title, how it ended, what to look at.
fn head(out: &mut String, report: &Report) {
    let title = match report.title.as_str() {
        "" => "signorini".to_owned(),
        title => escape(title),
    };
    put(
        out,
        format_args!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><title>{title}</title><style>{STYLE}{}</style></head>\n<body>\n<h1>{title}</h1>",
            view::STYLE
        ),
    );
    let (class, text) = match report.status {
        Some(Status::Converged) => ("status", "converged"),
        Some(Status::IterationLimit) => ("status bad", "NOT converged: iteration limit"),
        Some(Status::Stagnated) => ("status bad", "NOT converged: stagnated"),
        Some(Status::NotHeld) => ("status bad", "NOT converged: a body is not held"),
        Some(Status::TimeLimit) => ("status bad", "NOT converged: time limit"),
        Some(Status::Interrupted) => ("status bad", "NOT converged: interrupted"),
        None => ("status bad", "ended by an error"),
    };
    put(
        out,
        format_args!(
            "<p><span class=\"{class}\">{text}</span> {} unknowns, {} contact nodes, {:.2} s; optimality conditions met to {:.1e}</p>",
            report.n,
            report.m,
            report.timings.total,
            report.kkt.max()
        ),
    );
    for line in report.error.iter().chain(&report.hints) {
        put(out, format_args!("<p class=\"note\">{}</p>", escape(line)));
    }
}

/// The pictures of the last step and of the whole, then those of earlier steps, folded. Whether there is a view of solids
/// that can be turned.
fn figures(out: &mut String, report: &Report, pictures: &[Picture]) -> bool {
    let last = report.steps.len();
    let of = |step| pictures.iter().filter(move |picture| picture.step == step);
    let is_on_page =
        |picture: &&Picture| last <= MOST_STEPS || picture.step.is_none_or(|s| s == last);
    let used = (pictures.iter().filter(is_on_page)).map(|picture| picture.svg.len());
    let used: usize = used.sum();
    let views: Vec<_> = pictures.iter().filter_map(|p| p.view.as_ref()).collect();
    let mut has_view = false;
    for picture in of(Some(last)).chain(of(None)) {
        let (title, svg) = (escape(&picture.title), &picture.svg);
        put(out, format_args!("<h2>{title}</h2>"));
        if picture.view.is_some() && view::put_view(out, &views, used) {
            has_view = true;
            // Folded by the script where the view works.
            put(
                out,
                format_args!(
                    "<details id=\"still\" open><summary>Still picture</summary><figure>\n{svg}</figure></details>"
                ),
            );
        } else {
            put(out, format_args!("<figure>\n{svg}</figure>"));
        }
    }
    if last > MOST_STEPS {
        return has_view;
    }
    for step in 1..last {
        put(
            out,
            format_args!("<details><summary>Load step {step}</summary>"),
        );
        for picture in of(Some(step)) {
            put(out, format_args!("<figure>\n{}</figure>", picture.svg));
        }
        put(out, format_args!("</details>"));
    }
    has_view
}

/// The components of a force.
fn components(force: &[f64]) -> impl Iterator<Item = String> {
    force.iter().map(|v| format!("{v:.6e}"))
}

/// What they are called, where there are so many.
fn axes(count: usize) -> impl Iterator<Item = &'static str> {
    ["x", "y", "z"].into_iter().take(count)
}

/// What the contacts carry at the end of a step.
fn contacts(out: &mut String, report: &Report, step: &StepReport) {
    if step.contacts.is_empty() {
        return;
    }
    let units = &report.units;
    let count = step.contacts.iter().map(|c| c.force.len()).max();
    let forces = axes(count.unwrap_or(0)).map(|axis| format!("force {axis} ({})", units.force));
    let head: Vec<String> = (["contact", "friction"].map(str::to_owned).into_iter())
        .chain(forces)
        .chain([
            format!("largest pressure ({})", units.stress()),
            format!("area in contact ({})", units.area()),
        ])
        .chain(["separated", "stick", "slip", "without friction"].map(str::to_owned))
        .collect();
    out.push_str("<h2>Contacts at the end</h2>\n");
    table(
        out,
        &head,
        step.contacts.iter().map(|c| {
            [
                format!("{} / {}", c.boundary, c.against),
                c.friction.clone(),
            ]
            .into_iter()
            .chain(components(&c.force))
            .chain([
                format!("{:.4e}", c.max_pressure),
                format!("{:.4e}", c.area),
                c.separated.to_string(),
                c.stick.to_string(),
                c.slip.to_string(),
                c.frictionless.to_string(),
            ])
            .collect()
        }),
    );
    out.push_str("<p class=\"note\">Forces act on the body of the boundary named first.</p>\n");
}

/// The loads and the reactions of the supports in a step.
fn balance(out: &mut String, report: &Report, step: &StepReport) {
    if step.supports.is_empty() && step.total_load.is_none() {
        return;
    }
    let force = &report.units.force;
    let loads = (step.total_load.iter()).map(|f| ("all loads".to_owned(), f));
    let supports = (step.supports.iter()).map(|s| (format!("support {}", s.support), &s.force));
    let rows: Vec<(String, &Vec<f64>)> = loads.chain(supports).collect();
    let count = rows.iter().map(|(_, force)| force.len()).max();
    let of_axes = axes(count.unwrap_or(0)).map(|axis| format!("{axis} ({force})"));
    let head: Vec<String> = std::iter::once(String::new()).chain(of_axes).collect();
    out.push_str("<h2>Balance of forces</h2>\n");
    table(
        out,
        &head,
        rows.into_iter()
            .map(|(name, force)| std::iter::once(name).chain(components(force)).collect()),
    );
}

/// The load steps, a row each.
fn steps(out: &mut String, report: &Report) {
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
                s.sets.slip.total().to_string(),
            ]
        }),
    );
}

/// How far each optimality condition is from being met.
fn conditions(out: &mut String, report: &Report) {
    let kkt = &report.kkt;
    out.push_str("<h2>Optimality conditions</h2>\n");
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
}

/// What it has cost.
fn work(out: &mut String, report: &Report) {
    let (t, engine) = (&report.timings, &report.path);
    let place = match &engine.adapter {
        Some(adapter) => adapter.clone(),
        None => format!("the {}", engine.backend),
    };
    out.push_str("<h2>Work</h2>\n");
    table(
        out,
        &["", ""],
        [
            ("outer steps", report.iter.to_string()),
            ("products with A", report.n_a.to_string()),
            ("K⁻¹ by", format!("{} on {place}", engine.stiffness)),
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
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_escape_their_cells() {
        let mut text = String::new();
        let rows = [vec!["<b>".to_owned(), "1".to_owned()]];
        table(&mut text, &["contact", "x & y"], rows.into_iter());
        assert_eq!(
            text,
            "<div class=\"scroll\"><table><tr><th>contact</th><th>x &amp; y</th></tr>\n\
             <tr><td>&lt;b&gt;</td><td>1</td></tr>\n</table></div>\n"
        );
    }
}
