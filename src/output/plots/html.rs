//! `report.html`: everything of a solve on one page that a browser opens offline.

use super::svg::escape;
use super::{Picture, view};
use crate::model::Units;
use crate::output::{Report, StepReport};
use crate::ssnm::Status;

const STYLE: &str = "
:root { color-scheme: light dark; --ink: #222; --paper: #fff; --line: #ddd; --quiet: #555 }
@media (prefers-color-scheme: dark) { :root { --ink: #ddd; --paper: #181a1c; --line: #444; --quiet: #aaa } }
body { font: 15px/1.5 system-ui, -apple-system, 'Segoe UI', 'DejaVu Sans', Arial, sans-serif; color: var(--ink); background: var(--paper); max-width: 920px; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.5rem; margin-bottom: .2rem } h2 { font-size: 1.15rem; margin-top: 2.2rem; border-bottom: 1px solid var(--line); padding-bottom: .2rem }
.status { display: inline-block; padding: .1rem .6rem; border-radius: .3rem; color: #fff; background: #00795a } .status.bad { background: #b5342b }
table { border-collapse: collapse; margin: .6rem 0; font-variant-numeric: tabular-nums } th, td { padding: .2rem .8rem .2rem 0; text-align: right; border-bottom: 1px solid var(--line); vertical-align: top } th:first-child, td:first-child { text-align: left } th { font-weight: 600; color: var(--quiet) }
summary { cursor: pointer; margin: .5rem 0 } figure { margin: 1rem 0; overflow-x: auto } figure svg { max-width: 100%; height: auto } .scroll { overflow-x: auto } p.note { color: var(--quiet) } :focus-visible { outline: 3px solid #0072b2; outline-offset: 2px }
@page { size: A4; margin: 12mm }
@media print { :root { --ink: #000; --paper: #fff; --line: #ccc; --quiet: #444 } body { font-size: 8.5pt; line-height: 1.3; max-width: none; margin: 0; padding: 0; columns: 2; column-gap: 8mm } h1, h1 + p, .wide { column-span: all } h2 { font-size: 10.5pt; margin-top: 0; break-after: avoid } figure { margin: .3rem 0; break-inside: avoid; overflow: visible } figure svg { max-height: 78mm; width: 100% } section { break-inside: avoid; padding-top: .8rem } th, td { padding: .1rem .5rem .1rem 0 } .scroll { overflow: visible } details:not([open]), summary, noscript { display: none } }
";

/// Pictures of earlier load steps take at most this many bytes of the page, the last steps first.
const LARGEST_EARLIER: usize = 2 << 20;

/// Tables with more columns than this take the whole width of a printed page, others one of its two columns.
const NARROW: usize = 4;

/// A table under a title, with a head; texts are escaped. It can be scrolled by keys where it is too wide.
fn table(out: &mut String, title: &str, head: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    let class = ["", " class=\"wide\""][usize::from(head.len() > NARROW)];
    *out += &format!(
        "<section{class} aria-label=\"{title}\"><h2>{title}</h2>\n<div class=\"scroll\" tabindex=\"0\"><table>\n"
    );
    let head = head.iter().map(|&cell| cell.to_owned()).collect();
    for (tag, row) in std::iter::once(("th", head)).chain(rows.map(|row| ("td", row))) {
        let cell = |cell: &String| format!("<{tag}>{}</{tag}>", escape(cell));
        let cells: String = row.iter().map(cell).collect();
        *out += &format!("<tr>{cells}</tr>\n");
    }
    out.push_str("</table></div></section>\n");
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
    page + "</main></body></html>\n"
}

/// The title, the end of the solve, the hints.
fn head(out: &mut String, report: &Report) {
    let title = match report.title.as_str() {
        "" => "signorini".to_owned(),
        title => escape(title),
    };
    let style = view::STYLE;
    *out += &format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\"><title>{title}</title><style>{STYLE}{style}</style></head>\n<body><main>\n<h1>{title}</h1>\n"
    );
    let (class, text) = match report.status {
        Some(Status::Converged) => ("status", "converged"),
        Some(Status::IterationLimit) => ("status bad", "NOT converged: iteration limit"),
        Some(Status::Stagnated) => ("status bad", "NOT converged: stagnated"),
        Some(Status::NotHeld) => ("status bad", "NOT converged: a body is not held"),
        Some(Status::TimeLimit) => ("status bad", "NOT converged: time limit"),
        Some(Status::Interrupted) => ("status bad", "NOT converged: interrupted"),
        Some(Status::Unstable) => (
            "status bad",
            "UNSTABLE: in balance, but the slightest push ends it",
        ),
        None => ("status bad", "ended by an error"),
    };
    let (n, m, total) = (report.n, report.m, report.timings.total);
    let met = report.kkt.max();
    *out += &format!(
        "<p><span class=\"{class}\">{text}</span> {n} unknowns, {m} contact nodes, {total:.2} s; optimality conditions met to {met:.1e}</p>\n"
    );
    for line in report.error.iter().chain(&report.hints) {
        *out += &format!("<p class=\"note\">{}</p>\n", escape(line));
    }
}

/// The pictures of the last step and of the whole, then those of earlier steps, folded: the script of the view puts them where
/// those of the last step are. Whether there is a view of the bodies.
fn figures(out: &mut String, report: &Report, pictures: &[Picture]) -> bool {
    let last = report.steps.len();
    let of = |step| pictures.iter().filter(move |picture| picture.step == step);
    let on_page = of(Some(last)).chain(of(None));
    let size = |pictures: &mut dyn Iterator<Item = &Picture>| -> usize {
        pictures.map(|picture| picture.svg.len()).sum()
    };
    let before = (1..last).flat_map(|step| of(Some(step)));
    let earlier = size(&mut before.filter(|picture| picture.view.is_none()));
    let used = size(&mut on_page.clone()) + earlier.min(LARGEST_EARLIER);
    let views: Vec<_> = pictures.iter().filter_map(|p| p.view.as_ref()).collect();
    let mut has_view = false;
    for picture in on_page {
        let title = escape(&picture.title);
        *out += &format!("<section aria-label=\"{title}\"><h2>{title}</h2>\n");
        // Folded by the script where the view works.
        let (open, close) = if picture.view.is_some() && view::put_view(out, &views, used) {
            has_view = true;
            let open = "<details id=\"still\" open><summary>Still picture</summary>";
            (open, "</details>")
        } else {
            ("", "")
        };
        *out += &format!("{open}{}{close}</section>\n", figure(picture));
    }
    // The view shows the bodies in earlier steps.
    let is_shown = |picture: &&Picture| !(has_view && picture.view.is_some());
    let mut left = LARGEST_EARLIER;
    let figures = |step| -> String { of(Some(step)).filter(is_shown).map(figure).collect() };
    let mut has_room = |(_, figures): &(usize, String)| {
        let rest = left.checked_sub(figures.len());
        left = rest.unwrap_or(0);
        rest.is_some() && !figures.is_empty()
    };
    let earlier = (1..last).rev().map(|step| (step, figures(step)));
    let mut earlier: Vec<_> = earlier.take_while(|one| has_room(one)).collect();
    earlier.reverse();
    for (step, figures) in earlier {
        *out += &format!(
            "<details class=\"earlier\"><summary>Load step {step}</summary>\n{figures}</details>\n"
        );
    }
    has_view
}

/// A picture, with the step and the part of its name that it shares with those of other steps.
fn figure(picture: &Picture) -> String {
    let of = match picture.step {
        Some(step) => {
            let name = &picture.name;
            let of = name.strip_suffix(&format!("-{step:03}")).unwrap_or(name);
            format!(" data-of=\"{of}\" data-step=\"{step}\"")
        }
        None => String::new(),
    };
    format!("<figure{of}>\n{}</figure>\n", picture.svg)
}

/// The components of a force.
fn components(force: &[f64]) -> impl Iterator<Item = String> {
    force.iter().map(|v| format!("{v:.6e}"))
}

/// The forces of the contacts at the end of a step.
fn contacts(out: &mut String, report: &Report, step: &StepReport) {
    let Some(first) = step.contacts.first() else {
        return;
    };
    let units = &report.units;
    let axes = ["x", "y", "z"].into_iter().take(first.force.len());
    let forces: Vec<String> = axes
        .map(|axis| Units::named(&format!("force {axis}"), &units.force))
        .collect();
    let pressure = Units::named("largest pressure", &units.stress());
    let area = Units::named("area in contact", &units.area());
    let head: Vec<&str> = (["contact", "friction"].into_iter())
        .chain(forces.iter().map(String::as_str))
        .chain([
            &pressure,
            &area,
            "separated",
            "stick",
            "slip",
            "without friction",
            "tied",
        ])
        .collect();
    let rows = step.contacts.iter().map(|c| {
        let counts = [c.separated, c.stick, c.slip, c.frictionless, c.tied];
        let name = c.title();
        ([name, c.friction.clone()].into_iter())
            .chain(components(&c.force))
            .chain([c.max_pressure, c.area].map(|v| format!("{v:.4e}")))
            .chain(counts.map(|count| count.to_string()))
            .collect()
    });
    table(out, "Contacts at the end", &head, rows);
    out.push_str("<p class=\"note\">Forces act on the body of the first-named boundary.</p>\n");
}

/// The loads and the reactions of the supports in a step.
fn balance(out: &mut String, report: &Report, step: &StepReport) {
    let loads = (step.total_load.iter()).map(|f| ("all loads".to_owned(), f));
    let supports = (step.supports.iter()).map(|s| (format!("support {}", s.support), &s.force));
    let rows: Vec<(String, &Vec<f64>)> = loads.chain(supports).collect();
    let Some((_, first)) = rows.first() else {
        return;
    };
    let axes = ["x", "y", "z"].into_iter().take(first.len());
    let axes: Vec<String> = axes
        .map(|axis| Units::named(axis, &report.units.force))
        .collect();
    let head: Vec<&str> = std::iter::once("")
        .chain(axes.iter().map(String::as_str))
        .collect();
    let rows = rows.into_iter().map(|(name, force)| {
        let row = std::iter::once(name).chain(components(force));
        row.collect()
    });
    table(out, "Balance of forces", &head, rows);
    let Some(energy) = &step.energy else {
        return;
    };
    let head = ["strain", "work of loads", "of supports", "of contacts"];
    let head = head.map(|name| Units::named(name, &report.units.moment()));
    let row = energy.all().map(|v| format!("{v:.6e}")).to_vec();
    table(
        out,
        "Energy",
        &head.each_ref().map(String::as_str),
        [row].into_iter(),
    );
}

/// The load steps, a row each.
fn steps(out: &mut String, report: &Report) {
    let head = [
        "step",
        "factor",
        "rounds",
        "outer steps",
        "products with A",
        "separated",
        "stick",
        "slip",
    ];
    let rows = report.steps.iter().enumerate().map(|(i, s)| {
        let sets = [s.sets.separated, s.sets.stick, s.sets.slip.total()];
        let of_cycle = (s.cycle).map_or(String::new(), |cycle| format!(" (cycle {cycle})"));
        ([
            format!("{}{of_cycle}", i + 1),
            s.factor.to_string(),
            s.rounds.to_string(),
        ]
        .into_iter())
        .chain([s.iter, s.n_a].map(|count| count.to_string()))
        .chain(sets.map(|count| count.to_string()))
        .collect()
    });
    table(out, "Load steps", &head, rows);
}

/// The violation of each optimality condition.
fn conditions(out: &mut String, report: &Report) {
    let kkt = &report.kkt;
    let rows = [
        ("equilibrium ‖Ku + Nᵀλν + Tᵀλτ − f‖ / ‖f‖", kkt.equilibrium),
        ("penetration max(Nu − d)₊ / ‖u‖∞", kkt.penetration),
        ("tension max(−λν)₊ / ‖λ‖∞", kkt.tension),
        (
            "complementarity |λνᵀ(Nu − d)| / (‖λ‖ ‖u‖)",
            kkt.complementarity,
        ),
        ("friction bound max(|λτ| − g)₊ / ‖g‖∞", kkt.friction_bound),
        ("slip against friction / ‖u‖∞", kkt.slip),
    ];
    let rows = rows.map(|(name, value)| vec![name.to_owned(), format!("{value:.2e}")]);
    let head = ["condition", "violation"];
    table(out, "Optimality conditions", &head, rows.into_iter());
}

/// The costs.
fn work(out: &mut String, report: &Report) {
    let (t, engine) = (&report.timings, &report.path);
    let place = match &engine.adapter {
        Some(adapter) => adapter.clone(),
        None => format!("the {}", engine.backend),
    };
    let seconds = |s: f64| format!("{s:.3} s");
    let rows = [
        ("outer steps", report.iter.to_string()),
        ("products with A", report.n_a.to_string()),
        ("K⁻¹ by", format!("{} on {place}", engine.stiffness)),
        ("mesh", seconds(t.mesh)),
        ("assembly", seconds(t.assembly)),
        ("factorisation or set-up", seconds(t.factor)),
        ("b and σ_max", seconds(t.setup)),
        ("contact", seconds(t.ssnm)),
        ("in all", seconds(t.total)),
        ("version", report.version.to_owned()),
    ];
    let rows = rows.map(|(name, value)| vec![name.to_owned(), value]);
    table(out, "Work", &["", ""], rows.into_iter());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_escape_their_cells() {
        let mut text = String::new();
        let rows = [vec!["<b>".to_owned(), "1".to_owned()]];
        table(&mut text, "Work", &["contact", "x & y"], rows.into_iter());
        let cells =
            "<tr><th>contact</th><th>x &amp; y</th></tr>\n<tr><td>&lt;b&gt;</td><td>1</td></tr>";
        assert!(
            text.contains(cells) && text.contains("<h2>Work</h2>"),
            "{text}"
        );
    }
}
