//! The end of a solve in words, on standard output.

use signorini::model::{EntityKind, Units};
use signorini::output::{ContactReport, Report, StepReport};
use signorini::ssnm::{SetSizes, Status};
use std::path::PathBuf;

/// More files are not listed one by one.
const MANY: usize = 30;

/// The whole summary.
pub fn text(report: &Report, files: &[PathBuf]) -> String {
    let mut lines = vec![describe(report.status).to_owned()];
    let last = report.steps.last();
    for one in last.iter().flat_map(|step| &step.not_held) {
        let why = match one.proven {
            true => "no forces within the friction law balance it",
            false => "balancing forces exist, but contact and friction do not reach them",
        };
        lines.push(format!(
            "  {} {}: {why}; add a [[support]], friction, or change the load",
            one.body, one.motion
        ));
    }
    lines.push(format!(
        "  {} outer steps, {} products with A, err {:.1e} of the first; optimality conditions met to {:.1e}",
        report.iter,
        report.n_a,
        report.err_relative,
        report.kkt.max()
    ));
    lines.extend(last.and_then(|step| rounds(step, report.steps.len())));
    lines.push(states(report));
    let t = &report.timings;
    lines.push(format!(
        "  {:.3} s in all: mesh {:.3}, assembly {:.3}, factor {:.3}, set-up {:.3}, contact {:.3}, output {:.3}",
        t.total, t.mesh, t.assembly, t.factor, t.setup, t.ssnm, t.output
    ));
    lines.extend(last.iter().flat_map(|step| forces(report, step)));
    lines.extend(report.hints.iter().map(|hint| format!("  hint: {hint}")));
    // Of many load steps not each file.
    let is_of_step = |file: &&PathBuf| {
        let name = file.file_stem().unwrap_or_default().to_string_lossy();
        files.len() > MANY
            && name
                .rsplit_once('-')
                .is_some_and(|(_, number)| number.parse::<u32>().is_ok())
    };
    let of_steps = files.iter().filter(is_of_step).count();
    lines.extend(
        files
            .iter()
            .filter(|file| !is_of_step(file))
            .map(|file| format!("  {}", file.display())),
    );
    if of_steps > 0 {
        lines.push(format!("  and {of_steps} files of load steps beside them"));
    }
    lines.join("\n") + "\n"
}

fn describe(status: Option<Status>) -> &'static str {
    let Some(status) = status else {
        return "ended by an error";
    };
    match status {
        Status::Converged => "converged",
        Status::IterationLimit => {
            "NOT converged: the limit of outer steps (solver.max_iterations) is reached"
        }
        Status::Stagnated => {
            "NOT converged: progress has stopped; loosen solver.tolerance or, where PCG is used, try --stiffness cholesky"
        }
        Status::NotHeld => {
            "NOT converged: contact and friction do not hold every body under this load"
        }
        Status::TimeLimit => "NOT converged: the time limit is reached (solver.time_limit)",
        Status::Interrupted => "NOT converged: interrupted",
        Status::Unstable => {
            "UNSTABLE: in balance, but the slightest push makes a body buckle; support it in that direction, or add a \
             small load or imperfection there"
        }
    }
}

/// The reason why a step has taken several solves, if it has.
fn rounds(step: &StepReport, n_steps: usize) -> Option<String> {
    if let Some(iterations) = step.iterations {
        return Some(format!(
            "  {iterations} iterations on the positions of the bodies"
        ));
    }
    if step.rounds < 2 {
        return None;
    }
    let steps = match n_steps {
        1 => String::new(),
        n => format!(" in the last of {n} load steps"),
    };
    let solves = step.rounds;
    Some(format!(
        "  {solves} solves{steps}: the first one made no progress, weak springs were used in between"
    ))
}

/// The number of contact nodes in each state.
fn states(report: &Report) -> String {
    let (m, [separated, stick, slip, frictionless, tied]) = match report.steps.last() {
        Some(step) if !step.contacts.is_empty() => {
            let sum = |of: fn(&ContactReport) -> usize| step.contacts.iter().map(of).sum::<usize>();
            let all = [
                sum(|c| c.separated),
                sum(|c| c.stick),
                sum(|c| c.slip),
                sum(|c| c.frictionless),
                sum(|c| c.tied),
            ];
            // With large displacements, places are others in each step.
            (all.iter().sum(), all)
        }
        // Without geometry only the sets are known: a separated multiplier sticks or slips as well.
        _ => {
            let SetSizes {
                separated,
                stick,
                slip,
                frictionless,
                tied,
            } = report.sets;
            let all = [separated, stick, slip.total(), frictionless, tied];
            (report.m, all)
        }
    };
    let mut text = format!(
        "  {} of {m} nodes in contact, {separated} separated",
        m - separated
    );
    let mut parts = Vec::new();
    if stick + slip > 0 {
        parts.push(format!("{stick} stick, {slip} slip"));
    }
    if frictionless > 0 {
        parts.push(format!("{frictionless} without friction"));
    }
    if tied > 0 {
        parts.push(format!("{tied} tied"));
    }
    if !parts.is_empty() {
        text += &format!("; {}", parts.join(", "));
    }
    text
}

/// The forces on contacts and supports, a line each.
fn forces<'a>(report: &'a Report, step: &'a StepReport) -> impl Iterator<Item = String> + 'a {
    let units = &report.units;
    let [unit, stress, of_moment] =
        [units.force.clone(), units.stress(), units.moment()].map(|unit| Units::behind(&unit));
    let (of_work, of_force) = (of_moment.clone(), unit.clone());
    let listed = move |force: &[f64]| {
        let components: Vec<String> = force.iter().map(|v| format!("{v:.6e}")).collect();
        components.join(", ")
    };
    let moment = move |moment: &[f64], centre: &[f64], force: &[f64]| {
        let size = |v: &[f64]| v.iter().fold(0.0_f64, |size, v| size.hypot(*v));
        // With lever arms of the size of the body, the rest is rounding.
        if !(size(moment) > 1e-6 * size(force) * report.size) {
            return String::new();
        }
        // With a centre at the origin, the rest is rounding.
        let snapped = |&c: &f64| {
            if c.abs() < 1e-12 * report.size {
                0.0
            } else {
                c
            }
        };
        let centre: Vec<String> = (centre.iter().map(snapped))
            .map(|c| format!("{c:.4e}"))
            .collect();
        format!(
            ", moment ({}){of_moment} about ({})",
            listed(moment),
            centre.join(", ")
        )
    };
    let of_support = moment.clone();
    let length = Units::behind(&units.length);
    let contacts = step.contacts.iter().map(move |contact| {
        if contact.kind == EntityKind::Equation {
            return format!(
                "  equation {}: holds at {} places",
                contact.title(),
                contact.tied
            );
        }
        if let (Some(tension), Some(shortening)) = (contact.tension, contact.shortening) {
            return format!(
                "  preload {}: tension {tension:.6e}{unit}, shortening {shortening:.6e}{length}",
                contact.title()
            );
        }
        if contact.is_driven() {
            let (force, about) = (listed(&contact.force), listed(&contact.moment));
            let motion = contact.motion.iter();
            let motion = motion.map(|motion| match motion {
                Some(motion) => format!("{motion:.6e}"),
                None => "-".to_owned(),
            });
            return format!(
                "  coupling {}: force ({force}){unit}, moment ({about}){of_work}, motion ({})",
                contact.title(),
                motion.collect::<Vec<_>>().join(", ")
            );
        }
        let work = if contact.slipping_work > 0.0 && contact.slip > 0 {
            format!(", slipping work {:.4e}{of_work}", contact.slipping_work)
        } else {
            String::new()
        };
        let worn = match (contact.wear_depth, contact.wear_volume) {
            (Some(depth), Some(volume)) => {
                format!(", wear up to {depth:.4e}{length}, volume {volume:.4e}")
            }
            _ => String::new(),
        };
        format!(
            "  contact {}: force on the first ({}){unit}{}, pressure up to {:.4e}{stress}{work}{worn}",
            contact.title(),
            listed(&contact.force),
            moment(&contact.moment, &contact.centre, &contact.force),
            contact.max_pressure
        )
    });
    let supports = step.supports.iter().map(move |support| {
        let force = listed(&support.force);
        format!(
            "  support {}: force ({force}){of_force}{}",
            support.support,
            of_support(&support.moment, &support.centre, &support.force)
        )
    });
    contacts.chain(supports)
}
