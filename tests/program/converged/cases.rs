//! Cases as a user writes them.

use super::run::Run;

pub const GRAVITY: f64 = 9.81;

/// A case file.
pub struct Case {
    pub name: String,
    pub text: String,
    pub steps: usize,
    /// Whether the end of a step depends on how it was reached: with friction and more than one step.
    pub history: bool,
    /// The largest force that friction may lock in, in N, if it may exceed the load of a small step.
    pub locked: f64,
    /// The result of statics for every step: the contact, and the force on the body of its first boundary.
    pub forces: Vec<Vec<[f64; 2]>>,
}

impl Case {
    pub fn new(name: impl Into<String>, text: String) -> Self {
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
    pub fn forces(mut self, forces: Vec<[f64; 2]>) -> Self {
        self.forces = vec![forces];
        self
    }

    /// In load steps; known forces follow the factors.
    pub fn in_steps(mut self, factors: &[f64]) -> Self {
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

    /// The errors of the forces of a run.
    pub fn wrong_forces(&self, run: &Run) -> Vec<String> {
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
pub fn part(name: &str, origin: [f64; 2], size: [f64; 2], cells: [usize; 2]) -> String {
    let ([x, y], [w, h], [nx, ny]) = (origin, size, cells);
    format!(
        "[[mesh.part]]\nname = \"{name}\"\n\
         rectangle = {{ origin = [{x:e}, {y:e}], size = [{w:e}, {h:e}], cells = [{nx}, {ny}] }}\n"
    )
}

/// The material of a part, ν = 0.3.
pub fn material(region: &str, young: f64, density: f64) -> String {
    format!(
        "[[material]]\nregion = \"{region}\"\nyoung = {young:e}\npoisson = 0.3\ndensity = {density:e}\n"
    )
}

/// A pressure on a boundary: a number or an expression.
pub fn pressure(boundary: &str, value: &str) -> String {
    format!("[[traction]]\nboundary = \"{boundary}\"\npressure = \"{value}\"\n")
}

/// A traction on a boundary along x or y.
pub fn traction(boundary: &str, axis: char, value: f64) -> String {
    format!("[[traction]]\nboundary = \"{boundary}\"\n{axis} = {value:e}\n")
}

/// Prescribed displacements of a boundary.
pub fn support(boundary: &str, x: f64, y: f64) -> String {
    format!("[[support]]\nboundary = \"{boundary}\"\nx = {x:e}\ny = {y:e}\n")
}

/// Both components held at a point.
pub fn pin(point: [f64; 2]) -> String {
    let [x, y] = point;
    format!("[[support]]\npoint = [{x:e}, {y:e}]\nx = 0\ny = 0\n")
}

/// Contact with the half-plane below y = height.
pub fn floor(boundary: &str, height: f64, friction: &str) -> String {
    wall(boundary, [0.0, height], [0.0, 1.0], friction)
}

/// Contact with a half-plane whose normal points out of it.
pub fn wall(boundary: &str, point: [f64; 2], normal: [f64; 2], friction: &str) -> String {
    let ([x, y], [a, b]) = (point, normal);
    format!(
        "[[contact]]\nboundary = \"{boundary}\"\n\
         obstacle = {{ half_plane = {{ point = [{x:e}, {y:e}], normal = [{a:e}, {b:e}] }} }}\n\
         friction = {friction}\n"
    )
}

/// Contact between two boundaries.
pub fn between(boundary: &str, against: &str, friction: &str) -> String {
    format!(
        "[[contact]]\nboundary = \"{boundary}\"\nagainst = \"{against}\"\nfriction = {friction}\n"
    )
}

pub const FRICTIONLESS: &str = "\"none\"";

pub fn coulomb(mu: f64) -> String {
    format!("{{ coulomb = {mu:e} }}")
}

pub fn tresca(bound: f64) -> String {
    format!("{{ tresca = {bound:e} }}")
}

/// Size and density of the block on a floor.
pub const BLOCK: [f64; 2] = [1.0, 0.3];

pub const DENSITY: f64 = 7850.0;

/// A block on a floor without supports, under gravity with a sideways component.
pub fn heavy_block(young: f64, sideways: f64, friction: &str) -> Case {
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
pub fn pressed_block(young: f64, load: f64, push: f64, friction: &str) -> Case {
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

/// A block 1 m high and, half way up, 1 m wide, whose sides lean so that it narrows downwards, between two walls with
/// the same lean, `clearance` from it, under a pressure on its top.
pub fn taper(young: f64, lean: f64, clearance: f64, load: f64) -> Case {
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
pub const BEAM: [f64; 2] = [1.0, 0.1];

pub const BEAM_CELLS: [usize; 2] = [20, 2];

/// A beam pinned at a point over a floor.
pub fn lever(name: &str, pinned: [f64; 2], gap: f64, load: &str) -> Case {
    let text = part("beam", [0.0; 2], BEAM, BEAM_CELLS)
        + &material("beam", 2.1e11, 0.0)
        + &pin(pinned)
        + load
        + &floor("beam-bottom", -gap, FRICTIONLESS);
    Case::new(format!("lever, {name}, gap {gap:e}"), text)
}

/// A lever pinned at its left end with a force on its right end.
pub fn end_lever(gap: f64, force: f64) -> Case {
    let load = traction("beam-right", 'y', -force / BEAM[1]);
    lever(
        &format!("force {force:.3e} N on its end"),
        [0.0, 0.5 * BEAM[1]],
        gap,
        &load,
    )
}

/// A block on a held one. The lower one has the Young modulus `young`, the upper one `ratio` times that; the
/// pressure on the top leans to the right.
pub fn stacked(young: f64, ratio: f64, load: f64, lower_first: bool, friction: &str) -> Case {
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

/// A free block between two held ones, the upper of which comes down by `approach`.
pub fn squeezed(young: f64, ratio: f64, approach: f64, friction: &str) -> Case {
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

/// A block held at its left side, under a pressure that grows to the right, on a floor.
pub fn bracket(young: f64, load: f64, friction: &str) -> Case {
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
pub fn strip(young: f64, load: f64, sides: bool, friction: &str) -> Case {
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

/// A block whose top comes down by `travel` on a floor that is `gap` below.
pub fn tool(gap: f64, travel: f64, friction: &str) -> Case {
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
pub fn tool_on_block(gap: f64, travel: f64, friction: &str) -> Case {
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

/// Three free blocks on a floor, Coulomb 0.3 everywhere, pulled sideways by half of the holding force.
pub fn tower_of_three(young: f64) -> Case {
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
    // Each interface carries everything above it.
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
