//! `signorini check`.

use super::advice::message_of;
use super::mesh;
use signorini::case::Case;
#[cfg(feature = "mpi")]
use signorini::case::CaseDraft;
use signorini::contact::Space;
use signorini::deck;
use signorini::elasticity::Plane;
use signorini::engine::factor_bytes;
use signorini::mesh::{ElementKind, FaultKind, Mesh, Topology};
#[cfg(feature = "mpi")]
use signorini::model::Draft;
use signorini::model::{Analysis, AnyAnalysis, Elastic, EntityKind, PairData, Units};
#[cfg(feature = "mpi")]
use signorini::mpi::{Foreseen, MpiError};
#[cfg(feature = "mpi")]
use signorini::problem::AnyProblem;
use signorini::problem::ContactProblem;
use std::path::Path;

pub fn run(path: &Path, ignored: &[String], settings: &[String]) -> Result<u8, String> {
    if let Some(code) = mesh_alone(path)? {
        return Ok(code);
    }
    let (case, notes) = super::read_case(path, ignored, settings)?;
    let made = case
        .build()
        .map_err(|error| with_mesh(&case, message_of(&error)))?;
    let lines = match made.analysis() {
        AnyAnalysis::Plane(analysis) => describe(&case, analysis)?,
        AnyAnalysis::Space(analysis) => describe(&case, analysis)?,
    };
    tell(lines, &notes)
}

/// The description of a mesh, if the file is one.
fn mesh_alone(path: &Path) -> Result<Option<u8>, String> {
    if !is_mesh(path)? {
        return Ok(None);
    }
    let mesh = signorini::mesh::read(path, 1.0, None).map_err(|e| message_of(&e))?;
    super::print(&(mesh::described(&mesh).join("\n") + "\n"))?;
    Ok(Some(0))
}

/// Appends the contents of the case's mesh, which may show the name that the user wanted; the caller reports the error.
fn with_mesh(case: &Case, error: String) -> String {
    if case.tables.mesh.is_some()
        && let Ok(mesh) = case.mesh()
    {
        let lines = mesh::described(&mesh).join("\n");
        if let Err(unsaid) = super::print(&(lines + "\n")) {
            return unsaid;
        }
    }
    error
}

fn tell(lines: Vec<String>, notes: &[String]) -> Result<u8, String> {
    let notes = notes.iter().map(|note| format!("deck          {note}"));
    let lines: Vec<String> = lines.into_iter().chain(notes).collect();
    super::print(&(lines.join("\n") + "\n"))?;
    Ok(0)
}

/// Whether a file is a mesh rather than a case: by its name and, of an input file of Abaqus, as it has no steps.
fn is_mesh(path: &Path) -> Result<bool, String> {
    if deck::is_deck(path) {
        return deck::has_steps(path)
            .map(|has| !has)
            .map_err(|e| message_of(&e));
    }
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    Ok(["msh", "vtu"]
        .iter()
        .any(|known| extension.eq_ignore_ascii_case(known)))
}

/// The same on rank 0 of so many, which has no K either, with how they would share the work and the memory of each.
#[cfg(feature = "mpi")]
pub fn on_ranks(
    path: &Path,
    ignored: &[String],
    settings: &[String],
    ranks: usize,
) -> Result<u8, String> {
    if let Some(code) = mesh_alone(path)? {
        return Ok(code);
    }
    let (case, notes) = super::read_case(path, ignored, settings)?;
    let draft = case.draft();
    let lines = match draft.map_err(|error| with_mesh(&case, message_of(&error)))? {
        CaseDraft::Plane(draft) => describe_draft(&case, &draft, ranks)?,
        CaseDraft::Space(draft) => describe_draft(&case, &draft, ranks)?,
        CaseDraft::Algebraic(problem) => {
            let (mut lines, shares) = match &*problem {
                AnyProblem::Plane(problem) => (
                    describe(&case, problem.into())?,
                    Foreseen::of_problem(problem, ranks),
                ),
                AnyProblem::Space(problem) => (
                    describe(&case, problem.into())?,
                    Foreseen::of_problem(problem, ranks),
                ),
            };
            lines.extend(shares_of(&shares.map_err(|e| message_of(&e))?));
            lines
        }
    };
    tell(lines, &notes)
}

/// The description of a model without assembling K.
#[cfg(feature = "mpi")]
fn describe_draft<const D: usize>(
    case: &Case,
    draft: &Draft<D>,
    ranks: usize,
) -> Result<Vec<String>, String>
where
    ElementKind: Space<D>,
{
    let shares = Foreseen::of_model(draft, ranks).map_err(|error| match error {
        MpiError::Model(error) => message_of(&case.at_line(error)),
        error => message_of(&error),
    })?;
    let elastic = draft.elastic();
    let mut lines = titled(case);
    describe_bodies(&mut lines, case, elastic, shares.floating_bodies.clone())?;
    lines.push(format!(
        "size          {} unknowns, {} contact places",
        elastic.unknowns.n_free(),
        elastic.contact.places.len(),
    ));
    lines.extend(shares_of(&shares));
    Ok(lines)
}

/// The distribution of the work among the ranks.
#[cfg(feature = "mpi")]
fn shares_of(shares: &Foreseen) -> impl Iterator<Item = String> {
    let line = |(rank, &(unknowns, mebibytes)): (usize, &(usize, f64))| {
        format!("rank {rank:<8} {unknowns} unknowns, about {mebibytes:.0} MiB")
    };
    let whole = (shares.root_mib).map(|mebibytes| {
        format!("dividing      about {mebibytes:.0} MiB on rank 0 while it has the whole mesh")
    });
    shares.ranks.iter().enumerate().map(line).chain(whole)
}

fn titled(case: &Case) -> Vec<String> {
    let title = &case.tables.title;
    (!title.is_empty())
        .then(|| title.clone())
        .into_iter()
        .collect()
}

/// The description of a case.
fn describe<const D: usize>(case: &Case, analysis: Analysis<D>) -> Result<Vec<String>, String>
where
    ElementKind: Space<D>,
{
    let mut lines = titled(case);
    match analysis.elastic {
        Some(elastic) => {
            describe_bodies(&mut lines, case, elastic, analysis.floating_bodies())?;
        }
        None => lines.push(format!(
            "algebraic     n = {}, m = {}, {} coordinates",
            analysis.problem.n(),
            analysis.problem.m(),
            match analysis.problem.coordinates() {
                Some(_) => "with",
                None => "without",
            }
        )),
    }
    lines.push(size(analysis.problem));
    Ok(lines)
}

/// The bodies with all that acts on them, and their contacts.
fn describe_bodies<const D: usize>(
    lines: &mut Vec<String>,
    case: &Case,
    elastic: &Elastic<D>,
    floating: Vec<String>,
) -> Result<(), String>
where
    ElementKind: Space<D>,
{
    bodies(lines, case, elastic);
    boundaries(lines, case, &elastic.mesh);
    lines.extend(mesh::node_sets(&elastic.mesh));
    loads(lines, case, elastic)?;
    for body in floating {
        lines.push(format!("supports      {body}"));
    }
    for pair in &elastic.pairs {
        contact(lines, case, pair);
    }
    if elastic.pairs.is_empty() {
        lines.push("contact       none: this is a linear problem".to_owned());
    }
    Ok(())
}

/// The mesh, its regions with their materials, its groups.
fn bodies<const D: usize>(lines: &mut Vec<String>, case: &Case, elastic: &Elastic<D>)
where
    ElementKind: Topology<D>,
{
    let (units, mesh) = (case.units(), &elastic.mesh);
    let [length, stress] = [units.length.clone(), units.stress()].map(|unit| Units::behind(&unit));
    lines.push(format!("{}{length}", mesh::size(mesh)));
    lines.extend(mesh::notes(mesh));
    let (measure, power) = match D {
        2 => ("area", "²"),
        _ => ("volume", "³"),
    };
    let regions = mesh.regions.iter().zip(mesh.measures());
    let of_size = Units::behind(&units.power(power));
    for ((name, size), material) in regions.zip(&elastic.materials) {
        lines.push(format!(
            "region        \"{name}\": {measure} {size:.4e}{of_size}, E = {:.4e}{stress}, ν = {}, density {}{}{}{}",
            material.young,
            material.poisson,
            material.density,
            match material.is_projected(elastic.plane) {
                true => ", dilatation projected (incompressible)",
                false => "",
            },
            match material.incompatible_modes {
                true => ", incompatible modes",
                false => "",
            },
            match material.thickness {
                Some(thickness) => format!(", thickness {thickness}{length}"),
                None => String::new(),
            }
        ));
    }
    for (name, regions) in &mesh.groups {
        let members: Vec<String> = (regions.iter())
            .map(|&region| format!("\"{}\"", mesh.regions[region as usize]))
            .collect();
        if members != [format!("\"{name}\"")] {
            lines.push(format!("group         \"{name}\": {}", members.join(", ")));
        }
    }
}

/// The named boundaries, and their faults.
fn boundaries<const D: usize>(lines: &mut Vec<String>, case: &Case, mesh: &Mesh<D>)
where
    ElementKind: Topology<D>,
{
    let (facets_of, power) = match D {
        2 => ("edges", ""),
        _ => ("faces", "²"),
    };
    let unit = Units::behind(&case.units().power(power));
    for (name, facets) in &mesh.boundaries {
        let extent = (facets.iter()).fold(0.0, |sum, f| sum + mesh.facet_normal(f).0);
        let fault = match mesh.faults.get(name) {
            Some(fault) if fault.kind != FaultKind::Inside => {
                format!("; unusable: {fault}")
            }
            Some(fault) => format!("; unusable for contact and traction: {fault}"),
            None => String::new(),
        };
        lines.push(format!(
            "boundary      \"{name}\": {} {facets_of}, {extent:.4e}{unit}{fault}",
            facets.len()
        ));
    }
}

/// The analysis, the loads of each step, the supports.
fn loads<const D: usize>(
    lines: &mut Vec<String>,
    case: &Case,
    elastic: &Elastic<D>,
) -> Result<(), String>
where
    ElementKind: Space<D>,
{
    let units = case.units();
    lines.push(match elastic.plane {
        _ if D == 3 => "analysis      solid".to_owned(),
        Plane::Axisymmetric => {
            "analysis      axisymmetric about x = 0; forces are for the whole ring".to_owned()
        }
        plane => format!(
            "analysis      plane {}, thickness {}{}",
            if plane == Plane::PlaneStress {
                "stress"
            } else {
                "strain"
            },
            elastic.thickness,
            Units::behind(&units.length)
        ),
    });
    for step in 0..case.n_steps() {
        let data = elastic
            .step(step)
            .map_err(|e| message_of(&case.at_line(e)))?;
        let name = match case.n_steps() {
            1 => String::new(),
            _ => format!(", step {}", step + 1),
        };
        lines.push(format!(
            "total load    ({}){}{name}",
            data.total_load.map(|v| format!("{v:.6e}")).join(", "),
            Units::behind(&units.force)
        ));
    }
    let told = case.told::<D>().map_err(|e| message_of(&e))?;
    lines.extend(told.iter().map(|(what, text)| format!("{what:<14}{text}")));
    Ok(())
}

/// A contact pair with its gaps, its law of friction and the nodes that the law does not reach.
fn contact<const D: usize>(lines: &mut Vec<String>, case: &Case, pair: &PairData<D>)
where
    ElementKind: Topology<D>,
{
    let units = case.units();
    if pair.kind == EntityKind::Equal {
        let name = (pair.name.as_ref()).map_or(String::new(), |name| format!("\"{name}\" of "));
        lines.push(format!(
            "equal         {name}\"{}\": {} nodes move alike with another node, {}",
            pair.boundary, pair.places, pair.friction
        ));
        return;
    }
    // It is told with the other supports.
    if pair.kind == EntityKind::Support {
        return;
    }
    if pair.is_of_nodes() {
        let (word, between) = match pair.kind {
            EntityKind::Equation => ("equation", "is"),
            EntityKind::Coupling => ("coupling", "with"),
            EntityKind::Preload => ("preload", "with"),
            EntityKind::Cyclic => ("cyclic", "to"),
            _ => ("spring", "to"),
        };
        let name = (pair.name.as_ref()).map_or(String::new(), |name| match pair.kind {
            EntityKind::Spring => format!("\"{name}\" from "),
            _ => format!("\"{name}\" of "),
        });
        let stiffness = (pair.stiffness.as_ref()).map_or(String::new(), |stiffness| {
            format!("stiffness {stiffness}, ")
        });
        lines.push(format!(
            "{word:<14}{name}{} {between} {}: {stiffness}{}",
            pair.boundary,
            pair.against,
            pair.friction.trim_start_matches("spring ")
        ));
        return;
    }
    let length = Units::behind(&units.length);
    if pair.places == 0 {
        lines.push(format!(
            "contact       {}\"{}\" / {}: no places at rest: nothing is opposite within the search distance {:.4e}{length}; {}",
            (pair.name.as_ref()).map_or(String::new(), |name| format!("\"{name}\" on ")),
            pair.boundary,
            pair.against,
            pair.search_distance,
            pair.friction,
        ));
        return;
    }
    lines.push(format!(
        "{}{}\"{}\" / {}: {} places, {:.4e}{}, initial gap {:.4e} to {:.4e}{length}, {}; \
         {} of them within the search distance {:.4e}{length}",
        if pair.tied {
            "tie           "
        } else {
            "contact       "
        },
        (pair.name.as_ref()).map_or(String::new(), |name| format!("\"{name}\" on ")),
        pair.boundary,
        pair.against,
        pair.places,
        pair.area,
        Units::behind(&units.area()),
        pair.gap[0],
        pair.gap[1],
        pair.friction,
        pair.within,
        pair.search_distance,
    ));
    if let Some(stiffness) = &pair.stiffness {
        lines.push(format!("              compliant: stiffness {stiffness}"));
    }
    let texts = [
        pair.unmet_text(&units),
        pair.alike_text(),
        pair.arcs_text(&units),
        pair.sagitta_text(&units),
        pair.unmatched_text(&units),
    ];
    let texts = texts.into_iter().flatten();
    lines.extend(texts.map(|text| format!("              {text}")));
    if pair.kept > 0 {
        lines.push(format!(
            "              {} of them get no friction: supports, or another contact at a corner, keep them from sliding freely",
            pair.kept
        ));
    }
}

/// The size of the problem, and the memory of the direct path.
fn size<const D: usize>(problem: &ContactProblem<D>) -> String {
    let direct = match factor_bytes(problem) {
        Ok(bytes) => format!("about {:.1} MiB for", bytes as f64 / f64::from(1 << 20)),
        Err(_) => "too many for".to_owned(),
    };
    format!(
        "size          {} unknowns, {} contact places; {direct} the direct solve",
        problem.n_free(),
        problem.m(),
    )
}
