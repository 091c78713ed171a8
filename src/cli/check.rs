//! `signorini check`.

use super::advice::told;
use signorini::case::{Build, Case};
use signorini::elasticity::Plane;
use signorini::engine::factor_bytes;
use signorini::mesh::{FaultKind, Kind, Mesh};
use signorini::model::Elastic;
use signorini::model::PairData;
use signorini::problem::ContactProblem;
use std::path::Path;

pub fn run(path: &Path, settings: &[String]) -> Result<u8, String> {
    let case = Case::read(path, settings).map_err(|e| told(&e))?;
    let build = case.build().map_err(|e| told(&e))?;
    let mut lines = Vec::new();
    if !case.tables.title.is_empty() {
        lines.push(case.tables.title.clone());
    }
    match &build.elastic {
        Some(elastic) => {
            bodies(&mut lines, &case, elastic);
            boundaries(&mut lines, &case, &elastic.mesh);
            loads(&mut lines, &case, &build, elastic)?;
            for pair in &elastic.pairs {
                contact(&mut lines, &case, pair);
            }
            if elastic.pairs.is_empty() {
                lines.push("contact       none: this is a linear problem".to_owned());
            }
        }
        None => lines.push(format!(
            "algebraic     n = {}, m = {}, {} coordinates",
            build.problem.n(),
            build.problem.m(),
            match build.problem.coordinates() {
                Some(_) => "with",
                None => "without",
            }
        )),
    }
    lines.push(size(&build.problem));
    super::print(&(lines.join("\n") + "\n"))?;
    Ok(0)
}

/// The mesh, its regions with their materials, its groups.
fn bodies(lines: &mut Vec<String>, case: &Case, elastic: &Elastic) {
    let (units, mesh) = (case.units(), &elastic.mesh);
    let (length, stress) = (&units.length, units.stress());
    let (low, high) = mesh.bounding_box();
    let triangles = (mesh.elements.iter())
        .filter(|e| e.kind() == Kind::Triangle)
        .count();
    let (bodies, _) = mesh.bodies();
    lines.push(format!(
        "mesh          {} nodes, {triangles} triangles, {} quadrilaterals, {bodies} {}; [{:.4e}, {:.4e}] × [{:.4e}, {:.4e}] {length}",
        mesh.nodes.len(),
        mesh.elements.len() - triangles,
        if bodies == 1 { "body" } else { "bodies" },
        low[0],
        high[0],
        low[1],
        high[1],
    ));
    let regions = mesh.regions.iter().zip(mesh.measures());
    for ((name, area), material) in regions.zip(&elastic.materials) {
        lines.push(format!(
            "region        \"{name}\": area {area:.4e} {length}², E = {:.4e} {stress}, ν = {}, density {}",
            material.young, material.poisson, material.density
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

/// The named boundaries, and what they are not good for.
fn boundaries(lines: &mut Vec<String>, case: &Case, mesh: &Mesh) {
    let length = case.units().length;
    for (name, edges) in &mesh.boundaries {
        let extent = (edges.iter()).fold(0.0, |sum, e| sum + mesh.facet_normal(e).0);
        let fault = match mesh.faults.get(name) {
            Some(fault) if fault.kind == FaultKind::Stray => {
                format!("; not to be used: {fault}")
            }
            Some(fault) => format!("; not for contact and traction: {fault}"),
            None => String::new(),
        };
        lines.push(format!(
            "boundary      \"{name}\": {} edges, {extent:.4e} {length}{fault}",
            edges.len()
        ));
    }
}

/// The analysis, the loads of each step, the supports, the bodies without enough of them.
fn loads(
    lines: &mut Vec<String>,
    case: &Case,
    build: &Build,
    elastic: &Elastic,
) -> Result<(), String> {
    let units = case.units();
    let plane = match elastic.plane {
        Plane::PlaneStrain => "plane strain",
        Plane::PlaneStress => "plane stress",
    };
    lines.push(format!(
        "analysis      {plane}, thickness {} {}",
        elastic.thickness, units.length
    ));
    for step in 0..case.n_steps() {
        let data = case.step(build, step).map_err(|e| told(&e))?;
        let [x, y] = data.map_or([0.0; 2], |data| data.total_load);
        let name = match case.n_steps() {
            1 => String::new(),
            _ => format!(", step {}", step + 1),
        };
        lines.push(format!(
            "total load    ({x:.6e}, {y:.6e}) {}{name}",
            units.force
        ));
    }
    for (name, table) in elastic.supports.iter().zip(&case.tables.support) {
        let s = table.get_ref();
        let mut what: Vec<String> = [("x", &s.x), ("y", &s.y)]
            .iter()
            .filter_map(|(c, value)| value.as_ref().map(|value| format!("{c} = {value}")))
            .collect();
        if s.symmetry {
            what.push("symmetry".to_owned());
        }
        if let Some(factors) = &s.factors {
            what.push(format!("factors {factors:?}"));
        }
        lines.push(format!("support       \"{name}\": {}", what.join(", ")));
    }
    if let Some(steps) = &case.tables.steps {
        let factors = &steps.get_ref().factors;
        lines.push(format!("steps         factors {factors:?}"));
    }
    for body in build.free_bodies() {
        lines.push(format!("supports      {body}: only contact holds it"));
    }
    Ok(())
}

/// A contact pair with its gaps, its law of friction and the nodes that the law does not reach.
fn contact(lines: &mut Vec<String>, case: &Case, pair: &PairData) {
    let length = case.units().length;
    lines.push(format!(
        "contact       \"{}\" / {}: {} nodes, {:.4e} {length}², initial gap {:.4e} to {:.4e} {length}, {}; \
         {} of the nodes within the search distance {:.4e} {length}",
        pair.boundary,
        pair.against,
        pair.nodes,
        pair.area,
        pair.gap[0],
        pair.gap[1],
        pair.friction,
        pair.within,
        pair.search_distance,
    ));
    if pair.kept > 0 {
        lines.push(format!(
            "              {} of them get no friction: supports, or another contact at a corner, keep them from sliding freely",
            pair.kept
        ));
    }
}

/// How large the problem is, and what the direct path will take.
fn size(problem: &ContactProblem) -> String {
    let direct = match factor_bytes(problem) {
        Ok(bytes) => format!("about {:.1} MiB for", bytes as f64 / f64::from(1 << 20)),
        Err(_) => "too many for".to_owned(),
    };
    format!(
        "size          {} unknowns, {} contact nodes; {direct} the direct solve",
        problem.n_free(),
        problem.m(),
    )
}
