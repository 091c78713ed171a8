//! `signorini check`.

use signorini::case::Case;
use signorini::mesh::FaultKind;
use std::fmt::Write as _;
use std::path::Path;

pub fn run(path: &Path, settings: &[String]) -> Result<u8, String> {
    let case = Case::read(path, settings).map_err(|e| e.to_string())?;
    let build = case.build().map_err(|e| e.to_string())?;
    let mut text = String::new();
    let mut say = |line: std::fmt::Arguments| {
        text.write_fmt(line)
            .expect("writing to a string cannot fail");
        text.push('\n');
    };
    let tables = &case.tables;
    if !tables.title.is_empty() {
        say(format_args!("{}", tables.title));
    }
    let problem = &build.problem;
    let units = case.units();
    let (length, stress) = (&units.length, units.stress());
    if let Some(elastic) = &build.elastic {
        let mesh = &elastic.mesh;
        let (low, high) = mesh.bounding_box();
        let triangles = mesh
            .elements
            .iter()
            .filter(|e| e.nodes().len() == 3)
            .count();
        let (bodies, _) = mesh.bodies();
        say(format_args!(
            "mesh          {} nodes, {triangles} triangles, {} quadrilaterals, {bodies} {}; [{:.4e}, {:.4e}] × [{:.4e}, {:.4e}] {length}",
            mesh.nodes.len(),
            mesh.elements.len() - triangles,
            if bodies == 1 { "body" } else { "bodies" },
            low[0],
            high[0],
            low[1],
            high[1],
        ));
        for ((name, area), material) in mesh
            .regions
            .iter()
            .zip(mesh.areas())
            .zip(&elastic.materials)
        {
            say(format_args!(
                "region        \"{name}\": area {area:.4e} {length}², E = {:.4e} {stress}, ν = {}, density {}",
                material.young, material.poisson, material.density
            ));
        }
        for (name, regions) in &mesh.groups {
            let members: Vec<String> = (regions.iter())
                .map(|&region| format!("\"{}\"", mesh.regions[region as usize]))
                .collect();
            if members != [format!("\"{name}\"")] {
                say(format_args!(
                    "group         \"{name}\": {}",
                    members.join(", ")
                ));
            }
        }
        for (name, edges) in &mesh.boundaries {
            let extent = (edges.iter()).fold(0.0, |sum, &e| sum + mesh.edge_normal(e).0);
            let fault = match mesh.faults.get(name) {
                Some(fault) if fault.kind == FaultKind::Stray => {
                    format!("; not to be used: {fault}")
                }
                Some(fault) => format!("; not for contact and traction: {fault}"),
                None => String::new(),
            };
            say(format_args!(
                "boundary      \"{name}\": {} edges, {extent:.4e} {length}{fault}",
                edges.len()
            ));
        }
        let plane = match elastic.plane {
            signorini::elasticity::Plane::PlaneStrain => "plane strain",
            signorini::elasticity::Plane::PlaneStress => "plane stress",
        };
        say(format_args!(
            "analysis      {plane}, thickness {} {length}",
            elastic.thickness
        ));
        for step in 0..case.n_steps() {
            let data = case.step(&build, step).map_err(|e| e.to_string())?;
            let [x, y] = data.map_or([0.0; 2], |data| data.total_load);
            let name = match case.n_steps() {
                1 => String::new(),
                _ => format!(", step {}", step + 1),
            };
            say(format_args!(
                "total load    ({x:.6e}, {y:.6e}) {}{name}",
                units.force
            ));
        }
        for (name, table) in elastic.supports.iter().zip(&tables.support) {
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
            say(format_args!(
                "support       \"{name}\": {}",
                what.join(", ")
            ));
        }
        if let Some(steps) = &tables.steps {
            say(format_args!(
                "steps         factors {:?}",
                steps.get_ref().factors
            ));
        }
        for body in build.free_bodies() {
            say(format_args!("supports      {body}: only contact holds it"));
        }
        for pair in &elastic.pairs {
            say(format_args!(
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
                say(format_args!(
                    "              {} of them get no friction: supports, or another contact at a corner, keep them from sliding freely",
                    pair.kept
                ));
            }
        }
        if elastic.pairs.is_empty() {
            say(format_args!("contact       none: this is a linear problem"));
        }
    } else {
        say(format_args!(
            "algebraic     n = {}, m = {}, {} coordinates",
            problem.n(),
            problem.m(),
            if problem.coordinates().is_some() {
                "with"
            } else {
                "without"
            }
        ));
    }
    // The factor of a plane problem has about 31 n log₂ n entries in nested-dissection order, a third of
    // them in small pieces; measured 90 to 160 per unknown from n = 1e4 to 1e6.
    let n = problem.n() as f64;
    let factor = (n * (8.0 * n.max(2.0).log2() - 10.0).max(20.0)) * 8.0;
    let matrix = problem.stiffness().n_blocks() as f64 * 36.0;
    say(format_args!(
        "size          {} unknowns, {} contact nodes; about {:.0} MiB for the direct solve",
        problem.n_free(),
        problem.m(),
        (factor + 3.0 * matrix) / (1 << 20) as f64 + 20.0
    ));
    super::print(&text)?;
    Ok(0)
}
