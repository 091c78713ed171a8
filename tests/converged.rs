//! What `converged` promises, tried on the program as a user runs it.
//!
//! A solve that ends with exit code 0 and the status `converged` promises, in every load step, whatever the
//! stiffness, the load or the way that a body is held:
//!
//! - every optimality condition in `kkt` is met to 10 ε, ε = `solver.tolerance`;
//! - the resultants of the contacts are right to 100 ε: those of a body that contact alone holds are in
//!   equilibrium with the load *of that step*;
//! - every nodal pressure and tangential traction is right to 1000 ε of the largest pressure.
//!
//! A body that contact and friction cannot hold ends with exit code 3 and the status `not_held`; the summary
//! names it and says how it moves. Anything else that is no solution ends with another status.
//!
//! The references are statics by hand, the same case in one step or at a tolerance of 1e-11, and for algebraic
//! cases an assembly of bilinear quadrilaterals in this file. Nothing here uses the library. Every case runs on
//! the direct and on the iterative path.
//!
//! `cargo test --release --test converged -- --ignored --nocapture` tries 200 random cases.

use serde_json::Value;
use std::fmt::{Display, Write as _};
use std::path::Path;
use std::process::Command;

/// Both ways to make products with A.
const PATHS: [&str; 2] = ["cholesky", "pcg"];

/// `solver.tolerance` by default.
const DEFAULT: f64 = 1e-6;

/// What is allowed, in tolerances: of the optimality conditions (relative as `kkt` is) …
const KKT: f64 = 10.0;
/// … of the resultants, relative to the largest of the step; at the default tolerance that is 1e-4 …
const FORCE: f64 = 100.0;
/// … and of nodal pressures and tangential tractions, relative to the largest pressure of the step.
const NODAL: f64 = 1000.0;

/// What pressures differ by that a body has come to in steps or at once, and what areas times pressures sum up
/// to.
const CLOSE: f64 = 1e-4;

/// Tolerances of references, the first that is reached: what is compared with them is a thousand times coarser.
const REFERENCE: [f64; 2] = [1e-11, 1e-10];

/// The friction tolerance by default. A finer tolerance than this takes that of the friction along.
const FRICTION_DEFAULT: f64 = 1e-5;

const GRAVITY: f64 = 9.81;

// ---------------------------------------------------------------------------------------------------------
// Running the program

/// A row of `contact.csv`.
#[derive(Clone, Debug)]
struct Node {
    x: f64,
    pressure: f64,
    traction: f64,
}

/// What a run has left.
struct Run {
    name: String,
    tolerance: f64,
    code: Option<i32>,
    stdout: String,
    stderr: String,
    /// `Null` where nothing was written.
    report: Value,
    /// The contact nodes of each step, in the order of the file.
    nodes: Vec<Vec<Node>>,
    /// The vectors of an algebraic case: u, λν, λτ.
    vectors: [Vec<f64>; 3],
    /// The files in the output directory.
    files: Vec<String>,
}

/// How a case is to be run.
#[derive(Clone, Copy)]
struct How<'a> {
    path: &'a str,
    tolerance: f64,
    quiet: bool,
}

impl<'a> How<'a> {
    fn quiet(path: &'a str, tolerance: f64) -> Self {
        Self {
            path,
            tolerance,
            quiet: true,
        }
    }
}

fn read(path: &Path) -> Option<String> {
    std::fs::read_to_string(path).ok()
}

fn write(path: &Path, contents: &str) {
    std::fs::write(path, contents).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}

/// Solves a case in a directory of its own, beside the given files.
fn solve_with(name: &str, text: &str, files: &[(&str, String)], how: How) -> Run {
    let place = tempfile::tempdir().unwrap_or_else(|error| panic!("{error}"));
    let case = place.path().join("case.toml");
    write(&case, text);
    for (file, contents) in files {
        write(&place.path().join(file), contents);
    }
    let out = place.path().join("out");
    let mut command = Command::new(env!("CARGO_BIN_EXE_signorini"));
    command.arg("solve").arg(&case).arg("--output").arg(&out);
    command.args(["--backend", "cpu", "--stiffness", how.path]);
    let friction = how.tolerance.min(FRICTION_DEFAULT);
    for setting in [
        format!("solver.tolerance={:e}", how.tolerance),
        format!("solver.friction_tolerance={friction:e}"),
        // A case that runs for ever is one that fails.
        "solver.time_limit=60s".to_owned(),
    ] {
        command.args(["--set", &setting]);
    }
    if how.quiet {
        command.arg("--quiet");
    }
    let output = command.output().unwrap_or_else(|error| panic!("{error}"));
    let report = read(&out.join("report.json"))
        .and_then(|text| serde_json::from_str(&text).ok())
        .unwrap_or(Value::Null);
    let steps = report["steps"].as_array().map_or(0, Vec::len);
    let one = read(&out.join("contact.csv")).map(|text| vec![contact_nodes(&text)]);
    let nodes = one.unwrap_or_else(|| {
        (1..=steps)
            .filter_map(|step| read(&out.join(format!("contact-{step:03}.csv"))))
            .map(|text| contact_nodes(&text))
            .collect()
    });
    let files = std::fs::read_dir(&out)
        .into_iter()
        .flatten()
        .filter_map(|entry| Some(entry.ok()?.file_name().to_string_lossy().into_owned()))
        .collect();
    Run {
        name: format!("{name}, {}, ε = {:e}", how.path, how.tolerance),
        tolerance: how.tolerance,
        code: output.status.code(),
        stdout: String::from_utf8_lossy(&output.stdout).into_owned(),
        stderr: String::from_utf8_lossy(&output.stderr).into_owned(),
        report,
        nodes,
        vectors: ["u", "lambda_normal", "lambda_tangential"]
            .map(|name| read(&out.join(format!("{name}.mtx"))).map_or(Vec::new(), vector)),
        files,
    }
}

fn solve(name: &str, text: &str, how: How) -> Run {
    solve_with(name, text, &[], how)
}

/// The rows of `contact.csv`: x, y, gap, normal_pressure, tangential_traction, slip, status, contact.
fn contact_nodes(text: &str) -> Vec<Node> {
    text.lines()
        .skip(1)
        .map(|line| {
            let field: Vec<&str> = line.split(',').collect();
            let number = |i: usize| field[i].parse().unwrap_or(f64::NAN);
            Node {
                x: number(0),
                pressure: number(3),
                traction: number(4),
            }
        })
        .collect()
}

/// A vector in a Matrix Market file.
fn vector(text: String) -> Vec<f64> {
    let lines = text.lines().filter(|line| !line.starts_with('%'));
    lines
        .skip(1)
        .map(|line| line.trim().parse().unwrap_or(f64::NAN))
        .collect()
}

impl Run {
    fn status(&self) -> &str {
        self.report["status"].as_str().unwrap_or("no report")
    }

    fn steps(&self) -> usize {
        self.report["steps"].as_array().map_or(0, Vec::len)
    }

    fn contacts(&self, step: usize) -> usize {
        let contacts = &self.report["steps"][step]["contacts"];
        contacts.as_array().map_or(0, Vec::len)
    }

    /// The resultant of a contact on the body of its first boundary.
    fn force(&self, step: usize, contact: usize) -> [f64; 2] {
        pair(&self.report["steps"][step]["contacts"][contact]["force"])
    }

    /// The reaction of a support.
    fn reaction(&self, step: usize, support: usize) -> [f64; 2] {
        pair(&self.report["steps"][step]["supports"][support]["force"])
    }

    /// The first line that says what went wrong.
    fn first_words(&self) -> String {
        let line = |text: &str| text.lines().next().unwrap_or("").to_owned();
        line(if self.stderr.is_empty() {
            &self.stdout
        } else {
            &self.stderr
        })
    }

    /// What is wrong with a run that has to have converged in this many steps; nothing where all is well.
    fn unconverged(&self, steps: usize) -> Vec<String> {
        if self.code != Some(0) || self.status() != "converged" {
            let (code, status) = (self.code, self.status());
            return vec![format!(
                "exit {code:?}, status {status} after {} of {steps} steps {}",
                self.steps(),
                self.first_words()
            )];
        }
        let mut wrong = Vec::new();
        if self.steps() != steps {
            wrong.push(format!("{} of {steps} steps", self.steps()));
        }
        let of_steps = self.report["steps"].as_array().into_iter().flatten();
        for (number, step) in of_steps.enumerate() {
            if step["status"] != "converged" {
                wrong.push(format!("step {}: status {}", number + 1, step["status"]));
            }
            wrong.extend(self.broken(&step["kkt"], &format!("step {}: ", number + 1)));
        }
        wrong.extend(self.broken(&self.report["kkt"], ""));
        wrong
    }

    /// The optimality conditions that are not met.
    fn broken(&self, kkt: &Value, place: &str) -> Vec<String> {
        let Some(entries) = kkt.as_object().filter(|entries| !entries.is_empty()) else {
            return vec![format!("{place}there are no optimality conditions")];
        };
        entries
            .iter()
            .filter(|(_, value)| {
                !value
                    .as_f64()
                    .is_some_and(|v| v <= KKT * self.tolerance && v >= 0.0)
            })
            .map(|(name, value)| format!("{place}{name} {value}"))
            .collect()
    }

    /// What is wrong with a resultant, which has to be this to 100 ε of its length, or of `least` if that is
    /// more.
    fn wrong_force(
        &self,
        step: usize,
        contact: usize,
        expected: [f64; 2],
        least: f64,
    ) -> Option<String> {
        let force = self.force(step, contact);
        let error = length(difference(force, expected)) / length(expected).max(least);
        (!(error <= FORCE * self.tolerance)).then(|| {
            format!(
                "step {}, contact {}: force ({:.6e}, {:.6e}), expected ({:.6e}, {:.6e}): off by {error:.1e}",
                step + 1,
                contact + 1,
                force[0],
                force[1],
                expected[0],
                expected[1]
            )
        })
    }
}

fn pair(value: &Value) -> [f64; 2] {
    [0, 1].map(|c| value[c].as_f64().unwrap_or(f64::NAN))
}

fn length(v: [f64; 2]) -> f64 {
    v[0].hypot(v[1])
}

fn difference(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] - b[0], a[1] - b[1]]
}

/// The largest absolute value; NaN if one is.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |largest, v| {
        if largest.is_nan() || v.is_nan() {
            f64::NAN
        } else {
            f64::max(largest, v.abs())
        }
    })
}

fn largest_pressure(nodes: &[Node]) -> f64 {
    largest(nodes.iter().map(|node| node.pressure))
}

/// The failures of a test, told together at its end.
struct Failures {
    runs: usize,
    failed: usize,
    text: String,
}

impl Failures {
    fn new() -> Self {
        Self {
            runs: 0,
            failed: 0,
            text: String::new(),
        }
    }

    /// Counts a run, with what is wrong with it.
    fn add(&mut self, name: impl Display, wrong: Vec<String>) {
        self.runs += 1;
        if !wrong.is_empty() {
            self.failed += 1;
            writeln!(self.text, "  {name}").expect("writing to a string cannot fail");
        }
        for line in wrong {
            writeln!(self.text, "      {line}").expect("writing to a string cannot fail");
        }
    }

    fn finish(self) {
        assert!(self.runs > 0, "nothing was tried");
        assert!(
            self.failed == 0,
            "{} of {} runs failed:\n{}",
            self.failed,
            self.runs,
            self.text
        );
    }
}

/// Runs a case on both paths; `more` checks what has converged.
fn on_both_paths(
    failures: &mut Failures,
    case: &Case,
    tolerance: f64,
    more: impl Fn(&Run) -> Vec<String>,
) {
    for path in PATHS {
        let run = solve(&case.name, &case.text, How::quiet(path, tolerance));
        let mut wrong = run.unconverged(case.steps);
        if run.status() == "converged" {
            wrong.extend(more(&run));
        }
        failures.add(&run.name, wrong);
    }
}

// ---------------------------------------------------------------------------------------------------------
// Writing cases

/// A case file.
struct Case {
    name: String,
    text: String,
    steps: usize,
    /// Whether the end of a step depends on how it was reached: with friction and more than one step.
    history: bool,
    /// What friction may lock in at most, in N, where it may be more than the load of a small step.
    locked: f64,
    /// What statics says, for every step: the contact, and the force on the body of its first boundary.
    forces: Vec<Vec<[f64; 2]>>,
}

impl Case {
    fn new(name: impl Into<String>, text: String) -> Self {
        Self {
            name: name.into(),
            text,
            steps: 1,
            history: false,
            locked: 0.0,
            forces: Vec::new(),
        }
    }

    /// With these forces of the contacts at load factor 1.
    fn forces(mut self, forces: Vec<[f64; 2]>) -> Self {
        self.forces = vec![forces];
        self
    }

    /// In load steps; known forces follow the factors.
    fn in_steps(mut self, factors: &[f64]) -> Self {
        let list: Vec<String> = factors.iter().map(|factor| format!("{factor:e}")).collect();
        let list = list.join(", ");
        self.text += &format!("[steps]\nfactors = [{list}]\n");
        self.name += &format!(", factors [{list}]");
        self.steps = factors.len();
        self.history = self.steps > 1 && self.text.contains("friction = {");
        if let [forces] = &self.forces[..] {
            let scaled = |&factor: &f64| forces.iter().map(|f| f.map(|v| v * factor)).collect();
            self.forces = factors.iter().map(scaled).collect();
        }
        self
    }

    /// What is wrong with the forces of a run.
    fn wrong_forces(&self, run: &Run) -> Vec<String> {
        let mut wrong = Vec::new();
        for (step, forces) in self.forces.iter().enumerate() {
            for (contact, &force) in forces.iter().enumerate() {
                wrong.extend(run.wrong_force(step, contact, force, self.locked));
            }
        }
        wrong
    }
}

/// A rectangle as a part of the mesh.
fn part(name: &str, origin: [f64; 2], size: [f64; 2], cells: [usize; 2]) -> String {
    let ([x, y], [w, h], [nx, ny]) = (origin, size, cells);
    format!(
        "[[mesh.part]]\nname = \"{name}\"\n\
         rectangle = {{ origin = [{x:e}, {y:e}], size = [{w:e}, {h:e}], cells = [{nx}, {ny}] }}\n"
    )
}

/// The material of a part, ν = 0.3.
fn material(region: &str, young: f64, density: f64) -> String {
    format!(
        "[[material]]\nregion = \"{region}\"\nyoung = {young:e}\npoisson = 0.3\ndensity = {density:e}\n"
    )
}

/// A pressure on a boundary: a number or an expression.
fn pressure(boundary: &str, value: &str) -> String {
    format!("[[traction]]\nboundary = \"{boundary}\"\npressure = \"{value}\"\n")
}

/// A traction on a boundary along x or y.
fn traction(boundary: &str, axis: char, value: f64) -> String {
    format!("[[traction]]\nboundary = \"{boundary}\"\n{axis} = {value:e}\n")
}

/// Prescribed displacements of a boundary.
fn support(boundary: &str, x: f64, y: f64) -> String {
    format!("[[support]]\nboundary = \"{boundary}\"\nx = {x:e}\ny = {y:e}\n")
}

/// Both components held at a point.
fn pin(point: [f64; 2]) -> String {
    let [x, y] = point;
    format!("[[support]]\npoint = [{x:e}, {y:e}]\nx = 0\ny = 0\n")
}

/// Contact with the half-plane below y = height.
fn floor(boundary: &str, height: f64, friction: &str) -> String {
    wall(boundary, [0.0, height], [0.0, 1.0], friction)
}

/// Contact with a half-plane whose normal points out of it.
fn wall(boundary: &str, point: [f64; 2], normal: [f64; 2], friction: &str) -> String {
    let ([x, y], [a, b]) = (point, normal);
    format!(
        "[[contact]]\nboundary = \"{boundary}\"\n\
         obstacle = {{ half_plane = {{ point = [{x:e}, {y:e}], normal = [{a:e}, {b:e}] }} }}\n\
         friction = {friction}\n"
    )
}

/// Contact between two boundaries.
fn between(boundary: &str, against: &str, friction: &str) -> String {
    format!(
        "[[contact]]\nboundary = \"{boundary}\"\nagainst = \"{against}\"\nfriction = {friction}\n"
    )
}

const FRICTIONLESS: &str = "\"none\"";

fn coulomb(mu: f64) -> String {
    format!("{{ coulomb = {mu:e} }}")
}

fn tresca(bound: f64) -> String {
    format!("{{ tresca = {bound:e} }}")
}

/// Size and density of the block on a floor.
const BLOCK: [f64; 2] = [1.0, 0.3];
const DENSITY: f64 = 7850.0;

/// A block on a floor without supports, under gravity with a sideways component.
fn heavy_block(young: f64, sideways: f64, friction: &str) -> Case {
    let text = part("block", [0.0; 2], BLOCK, [20, 6])
        + &format!("[analysis]\ngravity = [{sideways:e}, {:e}]\n", -GRAVITY)
        + &material("block", young, DENSITY)
        + &floor("block-bottom", 0.0, friction);
    let mass = DENSITY * BLOCK[0] * BLOCK[1];
    Case::new(
        format!("heavy block, E = {young:e}, gx = {sideways:.4e}, friction {friction}"),
        text,
    )
    .forces(vec![[-mass * sideways, mass * GRAVITY]])
}

/// The same block under a pressure on its top, pushed on its left side by `push` N in all.
fn pressed_block(young: f64, load: f64, push: f64, friction: &str) -> Case {
    let text = part("block", [0.0; 2], BLOCK, [20, 6])
        + &material("block", young, 0.0)
        + &pressure("block-top", &format!("{load:e}"))
        + &traction("block-left", 'x', push / BLOCK[1])
        + &floor("block-bottom", 0.0, friction);
    Case::new(
        format!(
            "pressed block, E = {young:e}, p = {load:.3e}, push {push:.3e} N, friction {friction}"
        ),
        text,
    )
    .forces(vec![[-push, load * BLOCK[0]]])
}

/// A block 1 m high and, half way up, 1 m wide, whose sides lean so that it narrows downwards, between two
/// walls that lean alike, `clearance` from it, under a pressure on its top.
fn taper(young: f64, lean: f64, clearance: f64, load: f64) -> Case {
    // Along a side x grows by `lean` per unit of y: its outward normal is (±1, −lean) / slant.
    let slant = 1.0f64.hypot(lean);
    let at = [
        0.5 + clearance / slant,
        0.5 - clearance * lean / slant, // from the middle of the side, along its normal
    ];
    let text = format!(
        "[mesh.rectangle]\norigin = [-0.5, 0]\nsize = [1, 1]\ncells = [10, 10]\n\
         map = [\"2 * x * (0.5 + {lean:e} * (y - 0.5))\", \"y\"]\n"
    ) + &material("body", young, 0.0)
        + &pressure("top", &format!("{load:e}"))
        + &wall("left", [-at[0], at[1]], [1.0, lean], FRICTIONLESS)
        + &wall("right", at, [-1.0, lean], FRICTIONLESS);
    // Two forces Fₙ along the normals of the walls, which lean by φ from the horizontal: 2 Fₙ sin φ carries
    // the load, sin φ = lean / slant.
    let down = load * (1.0 + lean);
    let normal = down / (2.0 * lean / slant);
    let side = |sign: f64| [sign * normal / slant, normal * lean / slant];
    Case::new(
        format!("taper, lean {lean:e}, clearance {clearance:e}, p = {load:.3e}"),
        text,
    )
    .forces(vec![side(1.0), side(-1.0)])
}

/// Size and cells of the levers.
const BEAM: [f64; 2] = [1.0, 0.1];
const BEAM_CELLS: [usize; 2] = [20, 2];

/// A beam pinned at a point over a floor.
fn lever(name: &str, pinned: [f64; 2], gap: f64, load: &str) -> Case {
    let text = part("beam", [0.0; 2], BEAM, BEAM_CELLS)
        + &material("beam", 2.1e11, 0.0)
        + &pin(pinned)
        + load
        + &floor("beam-bottom", -gap, FRICTIONLESS);
    Case::new(format!("lever, {name}, gap {gap:e}"), text)
}

/// A lever pinned at its left end with a force on its right end.
fn end_lever(gap: f64, force: f64) -> Case {
    let load = traction("beam-right", 'y', -force / BEAM[1]);
    lever(
        &format!("force {force:.3e} N on its end"),
        [0.0, 0.5 * BEAM[1]],
        gap,
        &load,
    )
}

/// What is wrong with the moment of the floor about x = `about`, from the pressures and the areas of the nodes:
/// a cell's length, half of it at the ends.
fn wrong_moment(run: &Run, about: f64, expected: f64) -> Option<String> {
    let cell = BEAM[0] / BEAM_CELLS[0] as f64;
    let nodes = run.nodes.first()?;
    let (mut moment, mut force) = (0.0, 0.0);
    for node in nodes {
        let end = node.x < 0.5 * cell || node.x > BEAM[0] - 0.5 * cell;
        let share = node.pressure * if end { 0.5 * cell } else { cell };
        force += share;
        moment += share * (node.x - about);
    }
    let (floor, error) = (run.force(0, 0)[1], (moment / expected - 1.0).abs());
    if !((force / floor - 1.0).abs() <= CLOSE) {
        return Some(format!(
            "pressures add up to {force:.6e} N, the floor carries {floor:.6e} N"
        ));
    }
    (!(error <= FORCE * run.tolerance)).then(|| {
        format!("moment of the floor {moment:.6e}, expected {expected:.6e}: off by {error:.1e}")
    })
}

/// A block on a held one. The lower one has the Young modulus `young`, the upper one `ratio` times that; the
/// pressure on the top leans to the right.
fn stacked(young: f64, ratio: f64, load: f64, lower_first: bool, friction: &str) -> Case {
    let contact = if lower_first {
        between("lower-top", "upper-bottom", friction)
    } else {
        between("upper-bottom", "lower-top", friction)
    };
    let text = part("lower", [-0.6, 0.0], [1.2, 0.4], [18, 6])
        + &part("upper", [-0.5, 0.4], [1.0, 0.3], [13, 4])
        + &material("lower", young, 0.0)
        + &material("upper", young * ratio, 0.0)
        + &support("lower-bottom", 0.0, 0.0)
        + &pressure("upper-top", &format!("{load:e} * (1 + x)"))
        + &contact;
    let sign = if lower_first { -1.0 } else { 1.0 };
    let first = if lower_first { "lower" } else { "upper" };
    Case::new(
        format!("stacked, E = {young:e}, ratio {ratio:e}, {first} first, friction {friction}"),
        text,
    )
    .forces(vec![[0.0, sign * load]])
}

/// A free block between two held ones, of which the upper one comes down by `approach`.
fn squeezed(young: f64, ratio: f64, approach: f64, friction: &str) -> Case {
    let text = part("lower", [-0.6, 0.0], [1.2, 0.3], [16, 4])
        + &part("middle", [-0.5, 0.3], [1.0, 0.3], [11, 4])
        + &part("upper", [-0.6, 0.6], [1.2, 0.3], [14, 4])
        + &material("lower", young, 0.0)
        + &material("middle", young * ratio, 0.0)
        + &material("upper", young, 0.0)
        + &support("lower-bottom", 0.0, 0.0)
        + &support("upper-top", 0.0, -approach)
        + &between("middle-bottom", "lower-top", friction)
        + &between("middle-top", "upper-bottom", friction);
    Case::new(
        format!("squeezed, E = {young:e}, ratio {ratio:e}, by {approach:.3e}, friction {friction}"),
        text,
    )
}

/// What is wrong with the forces on a body between two contacts and no load: they cancel out.
fn wrong_balance(run: &Run) -> Option<String> {
    let (below, above) = (run.force(0, 0), run.force(0, 1));
    let rest = length([below[0] + above[0], below[1] + above[1]]);
    let error = rest / length(below);
    (!(below[1] > 0.0) || !(error <= FORCE * run.tolerance)).then(|| {
        format!(
            "the forces ({:.6e}, {:.6e}) and ({:.6e}, {:.6e}) do not cancel out",
            below[0], below[1], above[0], above[1]
        )
    })
}

/// A block held at its left side, under a pressure that grows to the right, on a floor.
fn bracket(young: f64, load: f64, friction: &str) -> Case {
    let text = part("block", [0.0; 2], [1.5, 0.5], [18, 6])
        + &material("block", young, 0.0)
        + &support("block-left", 0.0, 0.0)
        + &pressure("block-top", &format!("{load:e} * (0.2 + x)"))
        + &floor("block-bottom", 0.0, friction);
    Case::new(
        format!("bracket, E = {young:e}, p = {load:e}, friction {friction}"),
        text,
    )
}

/// A strip on a floor, held at its sides under a pressure, or at its top under a body force.
fn strip(young: f64, load: f64, sides: bool, friction: &str) -> Case {
    let held = if sides {
        support("strip-left", 0.0, 0.0)
            + &support("strip-right", 0.0, 0.0)
            + &pressure("strip-top", &format!("{load:e} * (1 + x)"))
    } else {
        support("strip-top", 0.0, 0.0)
            + &format!("[[body_force]]\ny = \"-{:e} * (1 + x)\"\n", 10.0 * load)
    };
    let text = part("strip", [0.0; 2], [1.0, 0.15], [20, 3])
        + &material("strip", young, 0.0)
        + &held
        + &floor("strip-bottom", 0.0, friction);
    let by = if sides { "sides" } else { "top" };
    Case::new(
        format!("strip held by its {by}, E = {young:e}, load {load:e}, friction {friction}"),
        text,
    )
}

/// A block whose top comes down by `travel` on a floor that lies `gap` below.
fn tool(gap: f64, travel: f64, friction: &str) -> Case {
    let text = part("tool", [0.0; 2], [1.0, 0.5], [12, 6])
        + &material("tool", 1e9, 0.0)
        + &support("tool-top", 0.0, -travel)
        + &floor("tool-bottom", -gap, friction);
    Case::new(
        format!("tool, gap {gap:e}, travel {travel:e}, friction {friction}"),
        text,
    )
}

/// The same over a held block instead of a floor.
fn tool_on_block(gap: f64, travel: f64, friction: &str) -> Case {
    let text = part("tool", [0.1, 0.5 + gap], [0.8, 0.5], [10, 6])
        + &part("die", [0.0; 2], [1.0, 0.5], [14, 6])
        + &material("tool", 1e9, 0.0)
        + &material("die", 1e9, 0.0)
        + &support("tool-top", 0.0, -travel)
        + &support("die-bottom", 0.0, 0.0)
        + &between("tool-bottom", "die-top", friction)
        + "search_distance = 2\n";
    Case::new(
        format!("tool on a block, gap {gap:e}, travel {travel:e}, friction {friction}"),
        text,
    )
}

// ---------------------------------------------------------------------------------------------------------
// Comparing with references

/// The same case, solved as well as can be; None where that fails.
fn reference(case: &Case) -> Option<Run> {
    REFERENCE
        .into_iter()
        .map(|tolerance| solve(&case.name, &case.text, How::quiet("cholesky", tolerance)))
        .find(|run| run.code == Some(0) && run.status() == "converged" && run.steps() == case.steps)
}

/// What is wrong with the nodes and the resultants of a run, beside its reference.
///
/// All is relative to the largest pressure or force of the step. Where friction keeps what has happened before,
/// the errors of a step are handed on as they are, so that there the largest so far counts.
fn apart(case: &Case, run: &Run, reference: &Run) -> Vec<String> {
    let mut wrong = Vec::new();
    if run.nodes.len() != reference.nodes.len() {
        return vec![format!(
            "{} files of contact nodes, {} of the reference",
            run.nodes.len(),
            reference.nodes.len()
        )];
    }
    let (mut most_pressure, mut most_force) = (0.0, 0.0);
    for (step, (nodes, others)) in run.nodes.iter().zip(&reference.nodes).enumerate() {
        let contacts = 0..run.contacts(step);
        let mut scale = largest_pressure(others);
        let mut force_scale =
            largest((contacts.clone()).map(|contact| length(reference.force(step, contact))));
        if case.history {
            scale = scale.max(most_pressure);
            force_scale = force_scale.max(most_force);
            (most_pressure, most_force) = (scale, force_scale);
        }
        let off = |of: fn(&Node) -> f64| {
            largest(nodes.iter().zip(others).map(|(a, b)| of(a) - of(b))) / scale
        };
        let resultant = largest(contacts.map(|contact| {
            length(difference(
                run.force(step, contact),
                reference.force(step, contact),
            ))
        })) / force_scale;
        for (what, error, allowed) in [
            ("pressure", off(|node| node.pressure), NODAL),
            ("traction", off(|node| node.traction), NODAL),
            ("resultant", resultant, FORCE),
        ] {
            if nodes.len() != others.len() || !(error <= allowed * run.tolerance) {
                wrong.push(format!(
                    "step {}: {what} off by {error:.1e} of {:.3e}",
                    step + 1,
                    if what == "resultant" {
                        force_scale
                    } else {
                        scale
                    }
                ));
            }
        }
    }
    wrong
}

// ---------------------------------------------------------------------------------------------------------
// 1. Blocks on a floor

#[test]
fn blocks_that_friction_holds() {
    let mut failures = Failures::new();
    for mu in [0.07, 0.1, 0.3, 0.8] {
        for share in [0.5, 0.8, 0.95, 0.99] {
            let friction = coulomb(mu);
            let young = if share == 0.8 { 1e9 } else { 2.1e11 };
            let heavy = heavy_block(young, share * mu * GRAVITY, &friction);
            let load = 1e5;
            let pressed = pressed_block(young, load, share * mu * load * BLOCK[0], &friction);
            for case in [heavy, pressed] {
                on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
            }
        }
    }
    // A given bound, of which the push takes a part.
    for share in [0.0, 0.5, 0.95] {
        let case = pressed_block(1e9, 1e5, share * 2e4 * BLOCK[0], &tresca(2e4));
        on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
    }
    failures.finish();
}

/// How a body may get away, and the words for it.
#[derive(Clone, Copy, PartialEq)]
enum Motion {
    Slides,
    /// Tips over, or turns about a pin.
    Turns,
    /// In whatever words.
    Away,
}

/// What is wrong with a run that has to end with a body that is not held.
fn wrongly_held(run: &Run, body: &str, motion: Motion) -> Vec<String> {
    let mut wrong = Vec::new();
    if run.code != Some(3) || run.status() != "not_held" {
        wrong.push(format!(
            "exit {:?}, status {}, instead of 3, not_held {}",
            run.code,
            run.status(),
            run.first_words()
        ));
    }
    let last = &run.report["steps"][run.steps().saturating_sub(1)]["status"];
    if last != "not_held" {
        wrong.push(format!("the step has the status {last}"));
    }
    let number = match run.steps() {
        0 | 1 => String::new(),
        several => format!("-{several:03}"),
    };
    for file in [
        "report.json".to_owned(),
        format!("contact{number}.csv"),
        format!("solution{number}.vtu"),
    ] {
        if !run.files.contains(&file) {
            wrong.push(format!("there is no {file}"));
        }
    }
    // The line that says how the body moves, with its name: that it "can rotate" if nothing holds it says little.
    let words: &[&str] = match motion {
        Motion::Slides => &["slides", "sliding", "would slide"],
        Motion::Turns => &[
            "tips",
            "tipping",
            "would tip",
            "rotates",
            "rotating",
            "would rotate",
            "turns",
            "turning",
            "tilts",
            "tilting",
            "would turn",
        ],
        Motion::Away => &[""],
    };
    let line = run
        .stdout
        .lines()
        .map(str::to_lowercase)
        // These are the resultants, with names of boundaries.
        .filter(|line| !line.trim_start().starts_with("contact "))
        .find(|line| line.contains(body) && words.iter().any(|word| line.contains(word)));
    match line {
        None => wrong.push(format!(
            "no line of the summary says of \"{body}\" how it moves: {}",
            run.stdout.lines().take(2).collect::<Vec<_>>().join(" / ")
        )),
        // A direction is a vector, an axis or a side.
        Some(line) if motion == Motion::Slides => {
            let after = &line[line.find("slid").unwrap_or(0)..];
            let named = ["(", "x", "right", "left"];
            if !named.iter().any(|word| after.contains(word)) {
                wrong.push(format!("no direction in \"{line}\""));
            }
        }
        Some(_) => {}
    }
    wrong
}

#[test]
fn bodies_that_are_not_held() {
    let mut failures = Failures::new();
    let mut cases = Vec::new();
    for mu in [0.07, 0.3, 0.8] {
        let heavy = heavy_block(2.1e11, 1.01 * mu * GRAVITY, &coulomb(mu));
        let pressed = pressed_block(1e9, 1e5, 1.01 * mu * 1e5, &coulomb(mu));
        cases.extend([
            (heavy, "block", Motion::Slides),
            (pressed, "block", Motion::Slides),
        ]);
    }
    // Five times the bound.
    let small = pressed_block(2.1e11, 1e5, 5e3, &tresca(1e3 / BLOCK[0]));
    let none = heavy_block(2.1e11, 1.0, FRICTIONLESS);
    // Pulled off the floor.
    let pulled = pressed_block(2.1e11, -1e3, 0.0, &coulomb(0.3));
    // The load points (0.45, −1) from 0.5 m above the middle of a base that ends 0.05 m from there.
    let tall = part("tower", [0.0; 2], [0.1, 1.0], [3, 20])
        + &format!("[analysis]\ngravity = [4.5, {:e}]\n", -GRAVITY)
        + &material("tower", 2.1e11, DENSITY)
        + &floor("tower-bottom", 0.0, &coulomb(0.8));
    // Of two bodies the upper one slides on the lower one, which its floor holds.
    let two = part("lower", [0.0; 2], [1.2, 0.2], [18, 3])
        + &part("upper", [0.1, 0.2], [1.0, 0.2], [13, 3])
        + &format!("[analysis]\ngravity = [1, {:e}]\n", -GRAVITY)
        + &material("lower", 2.1e11, DENSITY)
        + &material("upper", 2.1e11, DENSITY)
        + &between("upper-bottom", "lower-top", &coulomb(0.05))
        + &floor("lower-bottom", 0.0, &coulomb(0.8));
    // Pressed and held in the first step, pushed away in the second: by half of what friction holds, 3e4 N, and
    // by a tenth more than that.
    let later = pressed_block(1e9, 1e5, 0.0, &coulomb(0.3)).in_steps(&[1.0, 1.0]);
    let push = traction("block-left", 'x', 1e5) + "factors = [0.5, 1.1]\n";
    let later = Case {
        name: "pushed away in the second step".to_owned(),
        text: later.text + &push,
        ..later
    };
    cases.extend([
        (later, "block", Motion::Slides),
        (small, "block", Motion::Slides),
        (none, "block", Motion::Slides),
        (pulled, "block", Motion::Away),
        (Case::new("tall and narrow", tall), "tower", Motion::Turns),
        (
            Case::new("the upper one slides", two),
            "upper",
            Motion::Slides,
        ),
    ]);
    for (case, body, motion) in cases {
        for path in PATHS {
            let how = How {
                quiet: false,
                ..How::quiet(path, DEFAULT)
            };
            let run = solve(&case.name, &case.text, how);
            let mut wrong = wrongly_held(&run, body, motion);
            if run.steps() != case.steps {
                wrong.push(format!("{} of {} steps", run.steps(), case.steps));
            }
            for step in 1..run.steps() {
                let status = &run.report["steps"][step - 1]["status"];
                if status != "converged" {
                    wrong.push(format!("step {step}: status {status}"));
                }
            }
            failures.add(&run.name, wrong);
        }
    }
    failures.finish();
}

// ---------------------------------------------------------------------------------------------------------
// 2. Tapers

#[test]
fn frictionless_tapers() {
    let mut failures = Failures::new();
    for lean in [0.2, 0.03, 0.005] {
        for clearance in [0.0, 1e-5, 1e-4, 1e-3] {
            for load in [1e4, 1e5, 1e7] {
                let case = taper(2.1e11, lean, clearance, load);
                on_both_paths(&mut failures, &case, DEFAULT, |run| {
                    let mut wrong = case.wrong_forces(run);
                    wrong.extend(wrong_sum(&case, run));
                    wrong
                });
            }
        }
    }
    for (lean, clearance, load) in [
        (0.2, 1e-3, 1e4),
        (0.03, 0.0, 1e5),
        (0.005, 1e-5, 1e7),
        (0.005, 1e-3, 1e4),
    ] {
        let case = taper(2.1e11, lean, clearance, load);
        on_both_paths(&mut failures, &case, 1e-3, |run| {
            let mut wrong = case.wrong_forces(run);
            wrong.extend(wrong_sum(&case, run));
            wrong
        });
    }
    failures.finish();
}

/// What is wrong with the vertical sum of two walls: it carries the load, however large their forces are.
fn wrong_sum(case: &Case, run: &Run) -> Option<String> {
    let expected: f64 = case.forces[0].iter().map(|force| force[1]).sum();
    let sum: f64 = (0..2).map(|contact| run.force(0, contact)[1]).sum();
    let error = (sum / expected - 1.0).abs();
    (!(error <= FORCE * run.tolerance))
        .then(|| format!("the walls carry {sum:.6e} N of {expected:.6e} N: off by {error:.1e}"))
}

// ---------------------------------------------------------------------------------------------------------
// 3. Levers

#[test]
fn levers() {
    let mut failures = Failures::new();
    for gap in [1e-6, 1e-4, 1e-2] {
        for force in [1.0, 100.0, 1e4] {
            let case = end_lever(gap, force);
            on_both_paths(&mut failures, &case, DEFAULT, |run| {
                // The force has the arm 1 m; the pin carries what the floor does not.
                let mut wrong = Vec::from_iter(wrong_moment(run, 0.0, force * BEAM[0]));
                let (floor, pin) = (run.force(0, 0), run.reaction(0, 0));
                let rest = length([floor[0] + pin[0], floor[1] + pin[1] - force]);
                if !(rest <= FORCE * DEFAULT * force) {
                    wrong.push(format!("floor {floor:?} and pin {pin:?} do not carry it"));
                }
                wrong
            });
        }
    }
    // Free to turn about its middle. A pressure p x on the top has the moment p (1/3 − 1/4) about x = 1/2.
    for gap in [0.0, 1e-6, 1e-3] {
        for load in [1e2, 1e6] {
            let middle = 0.5 * BEAM[0];
            let case = lever(
                &format!("pressure {load:e} x"),
                [middle, 0.5 * BEAM[1]],
                gap,
                &pressure("beam-top", &format!("{load:e} * x")),
            );
            on_both_paths(&mut failures, &case, DEFAULT, |run| {
                Vec::from_iter(wrong_moment(run, middle, load / 12.0))
            });
        }
    }
    failures.finish();
}

// ---------------------------------------------------------------------------------------------------------
// 4. Load steps

#[test]
fn every_step_carries_its_own_load() {
    let mut failures = Failures::new();
    // The bound is that of a hundredth of a percent of the pressure: it holds what is left of slip in small
    // steps.
    for friction in [FRICTIONLESS, &coulomb(0.3), &tresca(100.0)] {
        for factors in [
            &[1.0, 1e-4][..],
            &[1.0, 1e-6],
            &[1.0, 0.5, 1e-3, 1.0],
            &[1e-4, 1.0],
        ] {
            let case = pressed_block(1e9, 1e6, 0.0, friction).in_steps(factors);
            on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
        }
    }
    // Pushed as well: half of what friction holds.
    for factors in [&[1.0, 1e-4][..], &[1e-4, 1.0, 0.3]] {
        let case = pressed_block(1e9, 1e6, 1.5e5, &coulomb(0.3)).in_steps(factors);
        on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
    }
    failures.finish();
}

#[test]
fn a_small_step_after_a_large_one() {
    let mut failures = Failures::new();
    let (load, factor) = (1e6, 1e-4);
    for sides in [true, false] {
        let case = strip(1e9, load, sides, FRICTIONLESS).in_steps(&[1.0, factor]);
        let alone = strip(1e9, load * factor, sides, FRICTIONLESS);
        let Some(expected) = reference(&alone) else {
            failures.add(&alone.name, vec!["no reference".to_owned()]);
            continue;
        };
        for tolerance in [1e-3, 1e-6, 1e-8] {
            on_both_paths(&mut failures, &case, tolerance, |run| {
                let (Some(nodes), Some(others)) = (run.nodes.get(1), expected.nodes.first()) else {
                    return vec!["no contact nodes of the second step".to_owned()];
                };
                let error = nodes_apart(nodes, others);
                wrong_by(error, NODAL * tolerance)
            });
        }
    }
    failures.finish();
}

/// The largest difference of two steps in pressures and tangential tractions, relative to the largest pressure
/// of the second; NaN where they have not the same nodes.
fn nodes_apart(nodes: &[Node], others: &[Node]) -> f64 {
    if nodes.len() != others.len() {
        return f64::NAN;
    }
    let both = || nodes.iter().zip(others);
    let pressure = both().map(|(a, b)| a.pressure - b.pressure);
    let traction = both().map(|(a, b)| a.traction - b.traction);
    largest(pressure.chain(traction)) / largest_pressure(others)
}

fn wrong_by(error: f64, allowed: f64) -> Vec<String> {
    if error <= allowed {
        return Vec::new();
    }
    vec![format!(
        "pressures off by {error:.1e}, allowed {allowed:.1e}"
    )]
}

// ---------------------------------------------------------------------------------------------------------
// 5. Approach and press

#[test]
fn approach_and_press() {
    let mut failures = Failures::new();
    let gap = 1e-3;
    for friction in [FRICTIONLESS, &coulomb(0.3), &tresca(1e4)] {
        for make in [tool, tool_on_block] {
            // The last factor presses by 1e-5, the one before it only just touches.
            let alone = make(gap, 1.01 * gap, friction);
            let Some(single) = reference(&alone) else {
                failures.add(&alone.name, vec!["no reference".to_owned()]);
                continue;
            };
            for factors in [&[1.0, 1.01][..], &[0.5, 1.0, 1.01]] {
                let case = make(gap, gap, friction).in_steps(factors);
                on_both_paths(&mut failures, &case, DEFAULT, |run| {
                    let (Some(nodes), Some(others)) = (run.nodes.last(), single.nodes.first())
                    else {
                        return vec!["no contact nodes".to_owned()];
                    };
                    wrong_by(nodes_apart(nodes, others), CLOSE)
                });
            }
        }
    }
    failures.finish();
}

#[test]
fn an_indentation_after_a_long_way() {
    let mut failures = Failures::new();
    let (way, depth) = (1.0, 1e-5);
    for friction in [FRICTIONLESS, &coulomb(0.3)] {
        for make in [tool, tool_on_block] {
            let near = make(0.0, depth, friction);
            let far = make(way, way + depth, friction);
            for path in PATHS {
                let at_once = solve(&near.name, &near.text, How::quiet(path, DEFAULT));
                let wrong = at_once.unconverged(1);
                let usable = wrong.is_empty();
                failures.add(&at_once.name, wrong);
                let run = solve(&far.name, &far.text, How::quiet(path, DEFAULT));
                let mut wrong = run.unconverged(1);
                if wrong.is_empty() && usable {
                    wrong.extend(run.wrong_force(0, 0, at_once.force(0, 0), 0.0));
                }
                failures.add(&run.name, wrong);
            }
        }
    }
    failures.finish();
}

// ---------------------------------------------------------------------------------------------------------
// 6. Several bodies

#[test]
fn floating_bodies_on_others() {
    let mut failures = Failures::new();
    // Stiff on soft, either side first, with pressures of a thousandth of the soft modulus.
    for ratio in [1e7, 1.0, 1e-3] {
        for lower_first in [true, false] {
            for friction in [FRICTIONLESS, &coulomb(0.3)] {
                let case = stacked(
                    2e5,
                    ratio,
                    200.0 * f64::min(ratio, 1.0),
                    lower_first,
                    friction,
                );
                on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
            }
        }
    }
    // Nothing is pushed or pulled sideways, and the middle block may lie anywhere without friction.
    for friction in [FRICTIONLESS, &coulomb(0.3), &tresca(1e3)] {
        for ratio in [1.0, 1e4] {
            let case = squeezed(1e9, ratio, 1e-5, friction);
            on_both_paths(&mut failures, &case, DEFAULT, |run| {
                Vec::from_iter(wrong_balance(run))
            });
        }
    }
    for young in [2.1e11, 1e9] {
        let case = tower_of_three(young);
        on_both_paths(&mut failures, &case, DEFAULT, |run| case.wrong_forces(run));
    }
    failures.finish();
}

/// Three free blocks on a floor, Coulomb 0.3 everywhere, pulled sideways by half of what that holds.
fn tower_of_three(young: f64) -> Case {
    let (sideways, height) = (0.5 * 0.3 * GRAVITY, 0.2);
    let widths = [1.2, 1.0, 0.9];
    let names = ["low", "mid", "high"];
    let cells = [16, 13, 11];
    let mut text = String::new();
    for i in 0..3 {
        let origin = [-0.5 * widths[i], height * i as f64];
        text += &part(names[i], origin, [widths[i], height], [cells[i], 3]);
    }
    text += &format!("[analysis]\ngravity = [{sideways:e}, {:e}]\n", -GRAVITY);
    for name in names {
        text += &material(name, young, DENSITY);
    }
    text += &floor("low-bottom", 0.0, &coulomb(0.3));
    text += &between("mid-bottom", "low-top", &coulomb(0.3));
    text += &between("high-bottom", "mid-top", &coulomb(0.3));
    // Each interface carries what is above it.
    let force = |i: usize| {
        let mass = widths[i..].iter().sum::<f64>() * height * DENSITY;
        [-mass * sideways, mass * GRAVITY]
    };
    Case::new(format!("tower of three, E = {young:e}"), text).forces(vec![
        force(0),
        force(1),
        force(2),
    ])
}

// ---------------------------------------------------------------------------------------------------------
// 7. Accuracy

#[test]
fn as_exact_as_the_tolerance_says() {
    let mut failures = Failures::new();
    let cases = [
        bracket(2.1e11, 1e7, FRICTIONLESS),
        bracket(2.1e11, 1e7, &coulomb(0.3)),
        bracket(2.1e11, 1e7, &tresca(1e6)),
        bracket(1e9, 1e2, &coulomb(0.8)),
        strip(1e9, 1e6, true, &coulomb(0.3)).in_steps(&[1.0, 0.5]),
        strip(1e9, 1e6, false, FRICTIONLESS),
        heavy_block(2.1e11, 0.5 * 0.3 * GRAVITY, &coulomb(0.3)),
        pressed_block(1e9, 1e5, 0.8 * 1e4, &tresca(1e4)),
        pressed_block(1e9, 1e6, 0.0, FRICTIONLESS).in_steps(&[1.0, 1e-3]),
        taper(2.1e11, 0.03, 1e-4, 1e7),
        taper(2.1e11, 0.2, 0.0, 1e5),
        end_lever(1e-6, 1e4),
        stacked(2e5, 1e7, 200.0, true, FRICTIONLESS),
        stacked(1e9, 1.0, 1e6, false, &coulomb(0.3)),
        squeezed(1e9, 1.0, 1e-5, &coulomb(0.3)),
        tool(1e-3, 1.01e-3, &coulomb(0.3)),
    ];
    for case in cases {
        let Some(expected) = reference(&case) else {
            failures.add(&case.name, vec!["no reference".to_owned()]);
            continue;
        };
        for tolerance in [1e-3, 1e-5, 1e-8] {
            on_both_paths(&mut failures, &case, tolerance, |run| {
                let mut wrong = case.wrong_forces(run);
                wrong.extend(apart(&case, run, &expected));
                wrong
            });
        }
    }
    failures.finish();
}

/// Pseudo-random numbers that are the same in every run (xorshift).
struct Random(u64);

impl Random {
    /// Uniform in [0, 1).
    fn unit(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// 10 to a uniform exponent, rounded so that it is read as it is written.
    fn decade(&mut self, low: f64, high: f64) -> f64 {
        let value = 10f64.powf(self.between(low, high));
        format!("{value:.3e}").parse().unwrap_or(value)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.unit() * n as f64) as usize
    }
}

/// A random case that is held in every step.
fn random_case(random: &mut Random, number: usize) -> Case {
    let young = random.decade(6.0, 12.0);
    // Strains between 1e-8 and 1e-3.
    let strain = random.decade(-8.0, -3.0);
    let load = young * strain;
    let law = random.below(3);
    let bound = load * random.decade(-2.0, 0.0);
    let mu = random.decade(-1.3, -0.2);
    let friction = match law {
        0 => FRICTIONLESS.to_owned(),
        1 => coulomb(mu),
        _ => tresca(bound),
    };
    // Half of the free blocks are pushed, by up to 80 % of what holds.
    let push = if random.unit() < 0.5 { 0.0 } else { 0.8 } * random.unit();
    let push = match law {
        0 => 0.0,
        1 => push * mu * load * BLOCK[0],
        _ => push * bound * BLOCK[0],
    };
    let ratio = random.decade(-4.0, 4.0);
    let lower_first = random.unit() < 0.5;
    let mut case = match number % 8 {
        0 => bracket(young, load, &friction),
        1 => strip(young, load, lower_first, &friction),
        2 | 3 => pressed_block(young, load, push, &friction),
        4 => {
            let lean = random.decade(-2.5, -0.5);
            let clearance = if lower_first {
                0.0
            } else {
                random.decade(-6.0, -3.0)
            };
            taper(young, lean, clearance, load)
        }
        5 => end_lever(random.decade(-7.0, -2.0), 2.1e11 * strain * 1e-3),
        6 => stacked(
            young,
            ratio,
            load * f64::min(ratio, 1.0),
            lower_first,
            &friction,
        ),
        _ => squeezed(young, ratio, strain * 0.3, &friction),
    };
    case.name = format!("{number}: {}", case.name);
    if law == 2 {
        case.locked = bound * BLOCK[0];
    }
    // Up and down over ten decades. Half of the cases with one step have it at full load.
    let steps = 1 + random.below(4);
    let mut factors: Vec<f64> = (0..steps).map(|_| random.decade(-10.0, 0.0)).collect();
    if random.unit() < 0.5 {
        factors[random.below(steps)] = 1.0;
    }
    case.in_steps(&factors)
}

/// Every status but `converged` is an answer here as long as it is honest; only what claims to have converged,
/// and has not, is wrong. A body that is held must not be called `not_held`.
#[test]
#[ignore = "600 solves and more, of which a few may give up"]
fn random_cases() {
    let (mut random, mut right, mut no_reference) = (Random(20_260_101), 0, 0);
    let (mut honest, mut honest_text) = (0, String::new());
    let mut failures = Failures::new();
    for number in 0..200 {
        let case = random_case(&mut random, number);
        let tolerance = [1e-3, 1e-5, 1e-7][random.below(3)];
        let expected = reference(&case);
        no_reference += usize::from(expected.is_none());
        for path in PATHS {
            let run = solve(&case.name, &case.text, How::quiet(path, tolerance));
            let given_up = ["stagnated", "iteration_limit", "time_limit"];
            if run.code == Some(3) && given_up.contains(&run.status()) {
                honest += 1;
                writeln!(
                    honest_text,
                    "  {}: {} in step {} of {}",
                    run.name,
                    run.status(),
                    run.steps(),
                    case.steps
                )
                .expect("writing to a string cannot fail");
                continue;
            }
            let mut wrong = run.unconverged(case.steps);
            if run.status() == "converged" {
                wrong.extend(case.wrong_forces(&run));
                if let Some(expected) = &expected {
                    wrong.extend(apart(&case, &run, expected));
                }
            }
            right += usize::from(wrong.is_empty());
            failures.add(&run.name, wrong);
        }
    }
    println!(
        "{right} runs right, {honest} given up honestly, {} wrong; {no_reference} cases without a reference",
        failures.failed
    );
    println!("given up:\n{honest_text}");
    failures.finish();
}

// ---------------------------------------------------------------------------------------------------------
// 8. Matrices of one's own

/// Bilinear quadrilaterals in plane strain, as an algebraic case.
struct Grid {
    nodes: Vec<[f64; 2]>,
    /// Corners, counter-clockwise.
    cells: Vec<[usize; 4]>,
    /// Nodes on a floor, with the lengths of boundary that they stand for.
    base: Vec<(usize, f64)>,
    load: Vec<f64>,
}

const ALGEBRAIC_SIZE: [f64; 2] = [1.0, 0.4];
const ALGEBRAIC_CELLS: [usize; 2] = [10, 4];
const ALGEBRAIC_YOUNG: f64 = 1e9;

impl Grid {
    /// A free block that is pressed on a floor and pushed sideways at its top, by these tractions.
    fn block(press: f64, push: f64) -> Self {
        let ([w, h], [nx, ny]) = (ALGEBRAIC_SIZE, ALGEBRAIC_CELLS);
        let number = |i: usize, j: usize| j * (nx + 1) + i;
        let mut nodes = Vec::new();
        for j in 0..=ny {
            for i in 0..=nx {
                nodes.push([w * i as f64 / nx as f64, h * j as f64 / ny as f64]);
            }
        }
        let cells = (0..nx * ny)
            .map(|cell| {
                let (i, j) = (cell % nx, cell / nx);
                [
                    number(i, j),
                    number(i + 1, j),
                    number(i + 1, j + 1),
                    number(i, j + 1),
                ]
            })
            .collect();
        let share = |i: usize| w / nx as f64 * if i == 0 || i == nx { 0.5 } else { 1.0 };
        let mut load = vec![0.0; 2 * nodes.len()];
        for i in 0..=nx {
            load[2 * number(i, ny)] = push * share(i);
            load[2 * number(i, ny) + 1] = -press * share(i);
        }
        Self {
            nodes,
            cells,
            base: (0..=nx).map(|i| (number(i, 0), share(i))).collect(),
            load,
        }
    }

    /// Two square cells side by side that share their common upper corner only, so that they can turn against
    /// each other about it, pressed on a floor.
    fn hinged() -> Self {
        let nodes = vec![
            [0.0, 0.0],
            [1.0, 0.0],
            [1.0, 1.0],
            [0.0, 1.0],
            [1.0, 0.0],
            [2.0, 0.0],
            [2.0, 1.0],
        ];
        let mut load = vec![0.0; 2 * nodes.len()];
        for node in [2, 3, 6] {
            load[2 * node + 1] = -1e5;
        }
        Self {
            nodes,
            cells: vec![[0, 1, 2, 3], [4, 5, 6, 2]],
            base: [0, 1, 4, 5].map(|node| (node, 0.5)).to_vec(),
            load,
        }
    }

    /// K by 2 × 2 Gauss points, E = 1e9, ν = 0.3.
    fn stiffness(&self) -> Vec<Vec<f64>> {
        let n = 2 * self.nodes.len();
        let mut k = vec![vec![0.0; n]; n];
        let (young, nu) = (ALGEBRAIC_YOUNG, 0.3);
        let lambda = young * nu / ((1.0 + nu) * (1.0 - 2.0 * nu));
        let shear = young / (2.0 * (1.0 + nu));
        let c = lambda + 2.0 * shear;
        let point = 1.0 / 3f64.sqrt();
        for cell in &self.cells {
            for (a, b) in [
                (-point, -point),
                (point, -point),
                (point, point),
                (-point, point),
            ] {
                // Derivatives of the shape functions (1 ± a)(1 ± b) / 4 along the sides of the unit cell.
                let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
                let local = signs
                    .map(|(s, t): (f64, f64)| [s * (1.0 + t * b) / 4.0, t * (1.0 + s * a) / 4.0]);
                let mut jacobian = [[0.0; 2]; 2];
                for (corner, &node) in cell.iter().enumerate() {
                    for r in 0..2 {
                        for s in 0..2 {
                            jacobian[r][s] += local[corner][r] * self.nodes[node][s];
                        }
                    }
                }
                let [[ja, jb], [jc, jd]] = jacobian;
                let det = ja * jd - jb * jc;
                let gradient =
                    local.map(|[s, t]| [(jd * s - jb * t) / det, (ja * t - jc * s) / det]);
                for (i, &p) in cell.iter().enumerate() {
                    for (j, &q) in cell.iter().enumerate() {
                        let ([px, py], [qx, qy]) = (gradient[i], gradient[j]);
                        k[2 * p][2 * q] += det * (c * px * qx + shear * py * qy);
                        k[2 * p][2 * q + 1] += det * (lambda * px * qy + shear * py * qx);
                        k[2 * p + 1][2 * q] += det * (lambda * py * qx + shear * px * qy);
                        k[2 * p + 1][2 * q + 1] += det * (c * py * qy + shear * px * qx);
                    }
                }
            }
        }
        k
    }

    /// The files of the case. `limit` is the slip bound in Pa, or the coefficient of friction.
    fn files(&self, limit: f64, coulomb: bool) -> Vec<(&'static str, String)> {
        let n = 2 * self.nodes.len();
        let k = self.stiffness();
        let mut entries = Vec::new();
        for i in 0..n {
            for j in 0..=i {
                if k[i][j] != 0.0 {
                    // Symmetric to the last digit: only the lower half is written.
                    entries.push(format!("{} {} {:e}", i + 1, j + 1, k[i][j]));
                }
            }
        }
        let stiffness = format!(
            "%%MatrixMarket matrix coordinate real symmetric\n{n} {n} {}\n{}\n",
            entries.len(),
            entries.join("\n")
        );
        // Towards the floor is −y; that turned counter-clockwise is +x.
        let rows = |component: usize, sign: f64| {
            let m = self.base.len();
            let rows: Vec<String> = (self.base.iter().enumerate())
                .map(|(row, &(node, _))| {
                    format!("{} {} {sign:e}", row + 1, 2 * node + component + 1)
                })
                .collect();
            format!(
                "%%MatrixMarket matrix coordinate real general\n{m} {n} {m}\n{}\n",
                rows.join("\n")
            )
        };
        let limits: Vec<f64> = (self.base.iter())
            .map(|&(_, length)| if coulomb { limit } else { limit * length })
            .collect();
        let coordinates: Vec<f64> = (0..2)
            .flat_map(|c| self.nodes.iter().map(move |x| x[c]))
            .collect();
        vec![
            ("K.mtx", stiffness),
            ("f.mtx", array(&self.load, 1)),
            ("N.mtx", rows(1, -1.0)),
            ("T.mtx", rows(0, 1.0)),
            ("d.mtx", array(&vec![0.0; self.base.len()], 1)),
            ("limit.mtx", array(&limits, 1)),
            ("x.mtx", array(&coordinates, 2)),
        ]
    }
}

/// A dense matrix, column by column, as a Matrix Market file.
fn array(values: &[f64], columns: usize) -> String {
    let lines: Vec<String> = values.iter().map(|v| format!("{v:e}")).collect();
    format!(
        "%%MatrixMarket matrix array real general\n{} {columns}\n{}\n",
        values.len() / columns,
        lines.join("\n")
    )
}

fn algebraic(coulomb: bool, coordinates: bool) -> String {
    let limit = if coulomb {
        "friction_coefficient"
    } else {
        "slip_bound"
    };
    let coordinates = if coordinates {
        "coordinates = \"x.mtx\"\n"
    } else {
        ""
    };
    format!(
        "[algebraic]\nstiffness = \"K.mtx\"\nload = \"f.mtx\"\nnormal = \"N.mtx\"\n\
         tangential = \"T.mtx\"\ngap = \"d.mtx\"\n{limit} = \"limit.mtx\"\n{coordinates}"
    )
}

#[test]
fn matrices_of_a_free_block() {
    let mut failures = Failures::new();
    let (press, push) = (1e6, 1.5e5);
    let [width, _] = ALGEBRAIC_SIZE;
    for (limit, friction) in [(0.3, true), (2e5, false)] {
        let law = if friction {
            coulomb(limit)
        } else {
            tresca(limit)
        };
        let text = part("block", [0.0; 2], ALGEBRAIC_SIZE, ALGEBRAIC_CELLS)
            + &material("block", ALGEBRAIC_YOUNG, 0.0)
            + &traction("block-top", 'y', -press)
            + &traction("block-top", 'x', push)
            + &floor("block-bottom", 0.0, &law);
        let grid = Grid::block(press, push);
        for path in PATHS {
            let how = How::quiet(path, DEFAULT);
            let mesh = solve(&format!("mesh, friction {law}"), &text, how);
            let mesh_wrong = mesh.unconverged(1);
            let usable = mesh_wrong.is_empty();
            failures.add(&mesh.name, mesh_wrong);
            let run = solve_with(
                &format!("matrices, friction {law}"),
                &algebraic(friction, true),
                &grid.files(limit, friction),
                how,
            );
            let mut wrong = run.unconverged(1);
            if run.status() == "converged" {
                let [_, normal, tangential] = &run.vectors;
                let (down, along): (f64, f64) = (normal.iter().sum(), tangential.iter().sum());
                // λτ acts against the push on the block: B transposed stands on the side of K.
                let error = length([down - press * width, along - push * width]) / (press * width);
                if !(error <= FORCE * DEFAULT) {
                    wrong.push(format!(
                        "Σ λν = {down:.6e}, Σ λτ = {along:.6e} for the loads {press:.6e}, {push:.6e}"
                    ));
                }
                let nodes: Vec<Node> = (grid.base.iter().enumerate())
                    .filter(|&(i, _)| i < normal.len() && i < tangential.len())
                    .map(|(i, &(node, share))| Node {
                        x: grid.nodes[node][0],
                        pressure: normal[i] / share,
                        traction: -tangential[i] / share,
                    })
                    .collect();
                if usable {
                    let others = mesh.nodes.first().map_or(&[][..], |nodes| nodes);
                    // Two Coulomb fixed points, each to the default tolerance.
                    wrong.extend(wrong_by(nodes_apart(&nodes, others), NODAL * DEFAULT));
                }
            }
            failures.add(&run.name, wrong);
        }
    }
    failures.finish();
}

#[test]
fn matrices_with_a_kernel_that_nothing_explains() {
    let mut failures = Failures::new();
    let block = Grid::block(1e6, 0.0);
    let hinged = Grid::hinged();
    for (name, grid, coordinates) in [
        ("a free block without coordinates", &block, false),
        ("two hinged cells", &hinged, true),
        ("two hinged cells without coordinates", &hinged, false),
    ] {
        for friction in [true, false] {
            for path in PATHS {
                let limit = if friction { 0.3 } else { 1e5 };
                let run = solve_with(
                    &format!("{name}, {}", if friction { "Coulomb" } else { "Tresca" }),
                    &algebraic(friction, coordinates),
                    &grid.files(limit, friction),
                    How::quiet(path, DEFAULT),
                );
                let said = run.stderr.to_lowercase();
                let mut wrong = Vec::new();
                if run.code != Some(1) {
                    wrong.push(format!("exit {:?}, status {}", run.code, run.status()));
                }
                let explained = said.contains("singular") || said.contains("coordinates");
                if !said.starts_with("error: ") || !explained || said.contains("panicked") {
                    wrong.push(format!("it says: {}", run.stderr.trim_end()));
                }
                failures.add(&run.name, wrong);
            }
        }
    }
    failures.finish();
}
