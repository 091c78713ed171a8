//! Coulomb friction on random problems: the coupled Newton steps against rounds with frozen slip bounds.
//!
//! Every problem follows from its number alone: an elastic case as a user writes it (blocks on floors, between
//! walls, in a V, on inclined planes, stacked bodies with meshes that do not match; clamped, held in part, or held
//! by contact alone; one to four load steps with unloading and reversal), or matrices (networks of springs, AᵀA).
//! Each is solved by both ways to make products with A, with `coupled` on and off, and every step that says
//! `converged` is checked by [`Checker`], which shares no code with the check of the solver: it reads K, N, T, the
//! load and the gap, and nothing else.
//!
//! What has not converged is judged as well, where that can be done: of small problems all sets are tried
//! ([`has_solution`]), so that `not_held` is wrong where there is a solution; and where no forces on Coulomb's cones
//! balance the bodies ([`unbalanced`]) there is none.
//!
//! Coulomb's law may have several solutions. Where both ways find one each, and both stand the check, that is
//! counted and no failure.
//!
//! `cargo test --release --test coulomb -- --ignored --nocapture` tries 1000 problems on each path. Environment:
//!
//! - `COULOMB_PROBLEMS`: how many problems instead;
//! - `COULOMB_SEED`: the number of the first one (1);
//! - `COULOMB_PATHS`: `cholesky` or `pcg`, to try one path only;
//! - `COULOMB_ONLY`: the number of a single problem, which is printed with the history of each of its solves.

mod common;

use common::Random;
use signorini::backend::cpu::Cpu;
use signorini::case::Case;
use signorini::dual::{DualOperator, NestedDual};
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::{self, Load, Settings, State, StepSolution};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::Status;
use signorini::stiffness::cholesky::CholeskyDual;
use signorini::stiffness::pcg::Preconditioner;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::time::{Duration, Instant};

/// What a run may take.
const TIME_LIMIT: Duration = Duration::from_secs(20);

// ---------------------------------------------------------------------------------------------------------
// Random problems

/// A problem with its load steps.
struct Trial {
    /// What it is, in a few words.
    name: String,
    /// All of it, for whoever looks for an error.
    text: String,
    problem: ContactProblem,
    loads: Vec<Load>,
}

/// Neighbouring seeds make unrelated numbers (the finaliser of SplitMix64).
fn generator(seed: u64) -> Random {
    let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    Random((z ^ (z >> 31)) | 1)
}

/// 10 to a power between these.
fn decade(random: &mut Random, low: f64, high: f64) -> f64 {
    10f64.powf(random.between(low, high))
}

fn chance(random: &mut Random, probability: f64) -> bool {
    random.unit() < probability
}

fn pick<T: Copy>(random: &mut Random, from: &[T]) -> T {
    from[random.below(from.len())]
}

/// The problem of a seed, or why it could not be built.
fn trial(seed: u64) -> Result<Trial, String> {
    let mut random = generator(seed);
    match random.below(10) {
        0..=4 => elastic(one_body(&mut random)),
        5..=6 => elastic(stack(&mut random)),
        _ => Ok(algebraic(&mut random)),
    }
}

/// A name and a case file.
struct Written {
    name: String,
    text: String,
}

fn elastic(written: Written) -> Result<Trial, String> {
    let Written { name, text } = written;
    let told = |error: &dyn std::fmt::Display| format!("{name}: {error}\n{text}");
    let case =
        Case::parse(Path::new("tests/case.toml"), text.clone(), &[]).map_err(|e| told(&e))?;
    let build = case.build().map_err(|e| told(&e))?;
    let mut loads = Vec::new();
    for step in 0..case.n_steps() {
        let data = case.step(&build, step).map_err(|e| told(&e))?;
        loads.push(data.expect("an elastic case").load);
    }
    Ok(Trial {
        name,
        text,
        problem: build.problem,
        loads,
    })
}

/// A coefficient of friction: often one in use, seldom one that makes the problem hard.
fn coefficient(random: &mut Random) -> f64 {
    match random.below(10) {
        0 => 0.0,
        1..=6 => random.between(0.05, 0.6),
        7..=8 => random.between(0.6, 1.2),
        _ => random.between(1.2, 2.0),
    }
}

/// A friction law as the case file has it. `pressure` is a typical one, `width` a typical length.
fn friction(random: &mut Random, pressure: f64, width: f64, names: &mut Vec<String>) -> String {
    let mu = coefficient(random);
    let (name, text) = match random.below(10) {
        0 => ("none".to_owned(), "\"none\"".to_owned()),
        1 => {
            let bound = pressure * random.between(0.0, 1.0);
            (
                format!("tresca {bound:.2e}"),
                format!("{{ tresca = {bound:e} }}"),
            )
        }
        2 => (
            format!("coulomb ~{mu:.2} growing"),
            format!("{{ coulomb = \"{mu:e} + 0.2 * abs(x / {width:e})\" }}"),
        ),
        3 => (
            format!("coulomb ~{mu:.2} in places"),
            format!("{{ coulomb = \"max(0, {mu:e} * sin(7 * x / {width:e}))\" }}"),
        ),
        _ => (
            format!("coulomb {mu:.2}"),
            format!("{{ coulomb = {mu:e} }}"),
        ),
    };
    names.push(name);
    text
}

/// A turn about the origin.
#[derive(Clone, Copy)]
struct Turn {
    cos: f64,
    sin: f64,
}

impl Turn {
    fn by(angle: f64) -> Self {
        let (sin, cos) = if angle == 0.0 {
            (0.0, 1.0)
        } else {
            angle.sin_cos()
        };
        Self { cos, sin }
    }

    fn of(self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.cos * x - self.sin * y, self.sin * x + self.cos * y]
    }

    /// The `map` of a rectangle that places (ξ, η) there, these being expressions of x and y.
    fn map(self, xi: &str, eta: &str) -> String {
        let (c, s) = (self.cos, self.sin);
        format!(
            "map = [\"({c:e}) * ({xi}) - ({s:e}) * ({eta})\", \"({s:e}) * ({xi}) + ({c:e}) * ({eta})\"]"
        )
    }
}

/// A rigid half-plane under a boundary.
fn half_plane(boundary: &str, point: [f64; 2], normal: [f64; 2], friction: &str) -> String {
    let ([x, y], [a, b]) = (point, normal);
    format!(
        "[[contact]]\nboundary = \"{boundary}\"\n\
         obstacle = {{ half_plane = {{ point = [{x:e}, {y:e}], normal = [{a:e}, {b:e}] }} }}\n\
         friction = {friction}\n"
    )
}

fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|v| format!("{v:e}")).collect();
    format!("[{}]", values.join(", "))
}

/// Factors of what presses: positive; and of what shears or moves: up, down, reversed.
struct Factors {
    press: Vec<f64>,
    shear: Vec<f64>,
}

impl Factors {
    fn new(random: &mut Random, held: bool) -> Self {
        let steps = pick(random, &[1, 1, 1, 2, 2, 3, 4]);
        let shear: Vec<f64> = if steps == 1 {
            vec![1.0]
        } else {
            (0..steps)
                .map(|_| pick(random, &[0.3, 1.0, -0.5, 0.2, 0.0, -1.0, 0.7]))
                .collect()
        };
        let press = if held && chance(random, 0.4) {
            // All of the load together, up and down: bodies may lift off.
            shear.clone()
        } else if chance(random, 0.5) {
            vec![1.0; steps]
        } else {
            (0..steps)
                .map(|_| pick(random, &[0.3, 1.0, 0.6, 0.1]))
                .collect()
        };
        Self { press, shear }
    }

    fn text(&self) -> String {
        format!("[steps]\nfactors = {}\n", list(&self.shear))
    }
}

/// Cells such that there are few unknowns, and not too slender.
fn cells(random: &mut Random, [w, h]: [f64; 2], nodes: usize) -> [usize; 2] {
    let across = 1 + (random.unit().powi(2) * 30.0) as usize;
    let up = (across as f64 * h / w * decade(random, -0.3, 0.3)).round();
    let up = (up as usize).clamp(1, 24);
    [across, up.min((nodes / (across + 1)).max(2) - 1).max(1)]
}

/// The analysis, the material and their figures.
struct Stuff {
    young: f64,
    /// A typical strain, and the pressure that makes it.
    strain: f64,
    pressure: f64,
    poisson: f64,
}

impl Stuff {
    fn new(random: &mut Random) -> Self {
        let young = decade(random, 2.0, 11.5);
        let strain = decade(random, -6.0, -2.0);
        Self {
            young,
            strain,
            pressure: young * strain,
            poisson: pick(random, &[0.0, 0.2, 0.3, 0.3, 0.45, 0.49]),
        }
    }

    fn material(&self, region: &str, ratio: f64) -> String {
        format!(
            "[[material]]\nregion = \"{region}\"\nyoung = {:e}\npoisson = {}\n",
            self.young * ratio,
            self.poisson
        )
    }
}

/// A traction with the direction of a frame that is turned.
fn traction(boundary: &str, force: [f64; 2], factors: &[f64]) -> String {
    let [x, y] = force;
    format!(
        "[[traction]]\nboundary = \"{boundary}\"\nx = {x:e}\ny = {y:e}\nfactors = {}\n",
        list(factors)
    )
}

fn pressure(boundary: &str, value: &str, factors: &[f64]) -> String {
    format!(
        "[[traction]]\nboundary = \"{boundary}\"\npressure = \"{value}\"\nfactors = {}\n",
        list(factors)
    )
}

fn support(place: &str, [x, y]: [Option<f64>; 2], factors: &[f64]) -> String {
    let mut text = format!("[[support]]\n{place}\n");
    for (name, value) in [("x", x), ("y", y)] {
        if let Some(value) = value {
            writeln!(text, "{name} = {value:e}").expect("writing to a string cannot fail");
        }
    }
    text + &format!("factors = {}\n", list(factors))
}

/// One block with rigid obstacles around it.
fn one_body(random: &mut Random) -> Written {
    let stuff = Stuff::new(random);
    let scale = decade(random, -3.0, 1.0);
    let [w, h] = pick(
        random,
        &[
            [1.0, 1.0],
            [2.0, 1.0],
            [4.0, 1.0],
            [10.0, 1.0],
            [1.0, 2.0],
            [1.0, 3.0],
            [1.5, 0.5],
        ],
    )
    .map(|v| v * scale);
    let [nx, ny] = cells(random, [w, h], 600);
    let shape = pick(random, &["quad", "quad", "triangle"]);
    let angle = match random.below(3) {
        0 => random.between(-0.7, 0.7),
        _ => 0.0,
    };
    let turn = Turn::by(angle);
    let mut laws = Vec::new();
    let p = stuff.pressure * random.between(0.2, 1.0);
    let gap = |random: &mut Random| match random.below(3) {
        0 => stuff.strain * h * random.between(0.0, 1.0),
        _ => 0.0,
    };

    // The frame of the body: ξ from −w/2 to w/2, η from 0 to h; `lean` makes it narrower below.
    let place = pick(
        random,
        &[
            "floor", "floor", "floor", "tilted", "disc", "walls", "V", "V",
        ],
    );
    let lean = if place == "V" {
        decade(random, -2.0, 0.3).min(0.6 * w / h)
    } else {
        0.0
    };
    let xi = format!("x * (1 + {:e} * (y - {:e}))", 2.0 * lean / w, 0.5 * h);
    let mut text = format!(
        "[mesh.rectangle]\norigin = [{:e}, 0]\nsize = [{w:e}, {h:e}]\ncells = [{nx}, {ny}]\n\
         shape = \"{shape}\"\n",
        -0.5 * w
    );
    if angle != 0.0 || lean != 0.0 {
        text += &turn.map(&xi, "y");
        text += "\n";
    }
    text += &stuff.material("body", 1.0);

    // Sides are numbered below, right, above, left.
    let mut contact = [false; 4];
    let mut contacts = String::new();
    let mut wall = |random: &mut Random, side: usize, tilt: f64, laws: &mut Vec<String>| {
        contact[side] = true;
        let slant = 1.0f64.hypot(lean);
        let (boundary, point, normal) = match side {
            0 => {
                // A tilted floor touches at a corner.
                let corner = -0.5 * w * tilt.signum() * f64::from(u8::from(tilt != 0.0));
                ("bottom", [corner, 0.0], [tilt.sin(), tilt.cos()])
            }
            1 => ("right", [0.5 * w, 0.5 * h], [-1.0 / slant, lean / slant]),
            2 => ("top", [0.0, h], [0.0, -1.0]),
            _ => ("left", [-0.5 * w, 0.5 * h], [1.0 / slant, lean / slant]),
        };
        let gap = gap(random);
        let point = [point[0] - gap * normal[0], point[1] - gap * normal[1]];
        let law = friction(random, p, w, laws);
        contacts += &half_plane(boundary, turn.of(point), turn.of(normal), &law);
    };
    match place {
        "tilted" => {
            let tilt = decade(random, -5.0, -1.0) * pick(random, &[-1.0, 1.0]);
            wall(random, 0, tilt, &mut laws);
        }
        "walls" => {
            let sides = if chance(random, 0.5) { [0, 2] } else { [1, 3] };
            for side in sides {
                wall(random, side, 0.0, &mut laws);
            }
        }
        "V" => {
            for side in [1, 3] {
                wall(random, side, 0.0, &mut laws);
            }
        }
        "disc" => {
            contact[0] = true;
            let radius = w * decade(random, -0.3, 1.5);
            let at = turn.of([random.between(-0.2, 0.2) * w, -radius - gap(random)]);
            let law = friction(random, p, w, &mut laws);
            contacts += &format!(
                "[[contact]]\nboundary = \"bottom\"\nfriction = {law}\n\
                 obstacle = {{ circle = {{ center = [{:e}, {:e}], radius = {radius:e} }} }}\n",
                at[0], at[1]
            );
        }
        _ => wall(random, 0, 0.0, &mut laws),
    }
    // One law at least is Coulomb's.
    if !contacts.contains("coulomb") {
        let (mu, law) = (coefficient(random).max(0.1), contacts.rfind("friction = "));
        let start = law.expect("there is a contact");
        let end = start + contacts[start..].find('\n').expect("a line ends");
        contacts.replace_range(start..end, &format!("friction = {{ coulomb = {mu:e} }}"));
        laws.pop();
        laws.push(format!("coulomb {mu:.2}"));
    }
    text += &contacts;

    let sides = ["bottom", "right", "top", "left"];
    let open: Vec<usize> = (0..4).filter(|&side| !contact[side]).collect();
    let held = pick(
        random,
        &[
            "clamped", "clamped", "moved", "rollers", "pinned", "free", "free",
        ],
    );
    let factors = Factors::new(random, held != "free");
    let side = if contact[0] && !contact[2] && held == "moved" {
        2
    } else {
        pick(random, &open)
    };
    let boundary = format!("boundary = \"{}\"", sides[side]);
    match held {
        "clamped" => text += &support(&boundary, [Some(0.0); 2], &factors.shear),
        "moved" => {
            // Pressed on what is opposite, and drawn along it.
            let down = -stuff.strain * h * random.between(0.0, 1.5);
            let along = stuff.strain * h * random.between(-2.0, 2.0);
            let motion = turn.of([along, down]);
            text += &support(&boundary, motion.map(Some), &factors.shear);
        }
        "rollers" => {
            let value = if chance(random, 0.5) {
                0.0
            } else {
                stuff.strain * w * random.between(-1.0, 1.0)
            };
            let along = if side % 2 == 0 {
                [None, Some(value)]
            } else {
                [Some(value), None]
            };
            text += &support(&boundary, along, &factors.shear);
        }
        "pinned" => {
            // The middle of an open side, where there may be no node: the nearest is taken.
            let corner = match side {
                1 | 2 => [0.5 * w * (1.0 + lean * h / w), h],
                _ => [-0.5 * w * (1.0 + lean * h / w), h],
            };
            let [x, y] = turn.of(corner);
            text += &support(
                &format!("point = [{x:e}, {y:e}]"),
                [Some(0.0); 2],
                &factors.shear,
            );
        }
        _ => {}
    }
    // What presses on the obstacles.
    let pressed = if place == "walls" && contact[1] {
        pick(random, &[0, 2])
    } else if contact[2] {
        pick(random, &[1, 3])
    } else {
        2
    };
    if held == "free" || chance(random, 0.8) {
        if chance(random, 0.3) {
            let force = turn.of([0.0, -p / h]);
            text += &format!(
                "[[body_force]]\nx = {:e}\ny = {:e}\nfactors = {}\n",
                force[0],
                force[1],
                list(&factors.press)
            );
        } else {
            let value = match random.below(3) {
                0 => format!("{p:e} * (1 + 0.5 * sin(5 * x / {w:e}))"),
                _ => format!("{p:e}"),
            };
            text += &pressure(sides[pressed], &value, &factors.press);
        }
    }
    // What shears.
    if chance(random, 0.8) {
        let side = pick(random, &open);
        let size = p * random.between(-0.8, 0.8) * if side % 2 == 1 { w / h } else { 1.0 };
        let size = if held == "free" { 0.5 * size } else { size };
        let force = if held != "free" && chance(random, 0.3) {
            [size, p * random.between(-0.5, 0.5)]
        } else {
            [size, 0.0]
        };
        text += &traction(sides[side], turn.of(force), &factors.shear);
    }
    text += &factors.text();
    Written {
        name: format!(
            "block {:.1}x{:.1} ({nx}x{ny}), {place}{}, {held}, {}, {} steps",
            w / scale,
            h / scale,
            if angle == 0.0 { "" } else { ", turned" },
            laws.join(" & "),
            factors.shear.len()
        ),
        text,
    }
}

/// Two or three bodies on top of each other.
fn stack(random: &mut Random) -> Written {
    let stuff = Stuff::new(random);
    let scale = decade(random, -3.0, 1.0);
    let layers = pick(random, &[2, 2, 2, 3]);
    let angle = match random.below(4) {
        0 => random.between(-0.5, 0.5),
        _ => 0.0,
    };
    let turn = Turn::by(angle);
    let p = stuff.pressure * random.between(0.2, 1.0);
    let mut laws = Vec::new();
    let (mut text, mut contacts) = (String::new(), String::new());
    let mut materials = String::new();
    let (mut bottom, mut height, mut widths) = (0.0, 0.0, Vec::new());
    for layer in 0..layers {
        let w = scale * random.between(0.8, 3.0);
        let h = scale * random.between(0.3, 1.2);
        let [nx, ny] = cells(random, [w, h], 280);
        if layer > 0 && chance(random, 0.3) {
            bottom += stuff.strain * h * random.between(0.0, 1.0);
        }
        let left = -0.5 * w + scale * random.between(-0.2, 0.2);
        writeln!(
            text,
            "[[mesh.part]]\nname = \"b{layer}\"\n\
             [mesh.part.rectangle]\norigin = [{left:e}, {bottom:e}]\nsize = [{w:e}, {h:e}]\n\
             cells = [{nx}, {ny}]\n{}",
            if angle == 0.0 {
                String::new()
            } else {
                turn.map("x", "y")
            }
        )
        .expect("writing to a string cannot fail");
        materials += &stuff.material(&format!("b{layer}"), decade(random, -1.5, 1.5));
        if layer > 0 {
            let law = friction(random, p, w, &mut laws);
            let (below, above) = (format!("b{}-top", layer - 1), format!("b{layer}-bottom"));
            let (first, second) = if chance(random, 0.5) {
                (above, below)
            } else {
                (below, above)
            };
            contacts += &format!(
                "[[contact]]\nboundary = \"{first}\"\nagainst = \"{second}\"\nfriction = {law}\n"
            );
        }
        bottom += h;
        height += h;
        widths.push(w);
    }
    let top = layers - 1;
    let ground = pick(random, &["clamped", "clamped", "on a floor"]);
    let head = pick(random, &["loaded", "loaded", "loaded", "moved", "guided"]);
    let factors = Factors::new(random, false);
    let mut rest = String::new();
    if ground == "clamped" {
        rest += &support("boundary = \"b0-bottom\"", [Some(0.0); 2], &factors.shear);
    } else {
        let law = friction(random, p, widths[0], &mut laws);
        contacts += &half_plane("b0-bottom", [0.0; 2], turn.of([0.0, 1.0]), &law);
    }
    if !contacts.contains("coulomb") {
        let (mu, start) = (coefficient(random).max(0.1), contacts.rfind("friction = "));
        let start = start.expect("there is a contact");
        let end = start + contacts[start..].find('\n').expect("a line ends");
        contacts.replace_range(start..end, &format!("friction = {{ coulomb = {mu:e} }}"));
        laws.pop();
        laws.push(format!("coulomb {mu:.2}"));
    }
    let name = format!("b{top}-top");
    let boundary = format!("boundary = \"{name}\"");
    let shear = p * random.between(-0.6, 0.6);
    match head {
        "moved" => {
            let down = -stuff.strain * height * random.between(0.2, 2.0);
            let along = stuff.strain * height * random.between(-2.0, 2.0);
            let factors = if chance(random, 0.5) {
                &factors.press
            } else {
                &factors.shear
            };
            rest += &support(&boundary, turn.of([along, down]).map(Some), factors);
        }
        "guided" => {
            // No motion in x; pressed down.
            rest += &support(&boundary, [Some(0.0), None], &factors.shear);
            rest += &pressure(&name, &format!("{p:e}"), &factors.press);
        }
        _ => {
            let w = widths[top];
            let value = match random.below(3) {
                0 => format!("{p:e} * (1 + 0.6 * sin(3 * x / {w:e}))"),
                _ => format!("{p:e}"),
            };
            rest += &pressure(&name, &value, &factors.press);
            if chance(random, 0.8) {
                rest += &traction(&name, turn.of([shear, 0.0]), &factors.shear);
            }
        }
    }
    if chance(random, 0.3) {
        let force = turn.of([shear * random.between(-0.3, 0.3), 0.0]);
        rest += &traction("b0-right", force, &factors.shear);
    }
    Written {
        name: format!(
            "stack of {layers}{}, {ground}, {head}, {}, {} steps",
            if angle == 0.0 { "" } else { ", turned" },
            laws.join(" & "),
            factors.shear.len()
        ),
        text: text + &materials + &contacts + &rest + &factors.text(),
    }
}

/// Matrices without a mesh.
fn algebraic(random: &mut Random) -> Trial {
    let n = pick(random, &[4, 6, 7, 10, 16, 20, 31, 40, 60]);
    let m = 1 + random.below((n / 2).min(30));
    let stiffness = decade(random, -2.0, 8.0);
    let kind = pick(random, &["AtA", "springs", "springs"]);
    let mut entries = Vec::new();
    match kind {
        "AtA" => {
            let mut rows = Vec::new();
            for _ in 0..n {
                let row: Vec<(usize, f64)> = (0..3)
                    .map(|_| (random.below(n), random.between(-1.0, 1.0)))
                    .collect();
                rows.push(row);
            }
            let small = decade(random, -2.0, 0.0);
            for i in 0..n {
                entries.push((i, i, stiffness * small * random.between(0.2, 1.0)));
            }
            for row in rows {
                for &(i, a) in &row {
                    for &(j, b) in &row {
                        entries.push((i, j, stiffness * a * b));
                    }
                }
            }
        }
        _ => {
            // A node is a pair of unknowns; springs have a direction.
            let nodes = n / 2;
            let mut add = |row: &[(usize, f64)], k: f64| {
                for &(i, a) in row {
                    for &(j, b) in row {
                        entries.push((i, j, k * a * b));
                    }
                }
            };
            let soft = decade(random, -3.0, -0.5);
            for i in 0..n {
                let ground = if chance(random, 0.15) { 1.0 } else { soft };
                add(&[(i, 1.0)], stiffness * ground);
            }
            for i in 0..nodes {
                for _ in 0..3 {
                    let j = random.below(nodes);
                    let (s, c) = random.between(0.0, 6.3).sin_cos();
                    let k = stiffness * decade(random, -1.0, 1.0);
                    if i != j {
                        let row = [(2 * i, c), (2 * i + 1, s), (2 * j, -c), (2 * j + 1, -s)];
                        add(&row, k);
                    }
                }
            }
        }
    }
    // Each contact node has two unknowns of its own, which a rotation takes to normal and tangent; general rows
    // have a little of other unknowns besides.
    let mut order: Vec<usize> = (0..n / 2).collect();
    for i in 0..order.len() {
        let j = i + random.below(order.len() - i);
        order.swap(i, j);
    }
    let general = chance(random, 0.3);
    let (mut normal, mut tangential) = (Vec::new(), Vec::new());
    for i in 0..m {
        let (s, c) = random.between(0.0, 6.3).sin_cos();
        let (x, y) = (2 * order[i], 2 * order[i] + 1);
        normal.extend([(i, x, c), (i, y, s)]);
        tangential.extend([(i, x, -s), (i, y, c)]);
        if general {
            for rows in [&mut normal, &mut tangential] {
                let j = random.below(n);
                if j != x && j != y {
                    rows.push((i, j, random.between(-0.2, 0.2)));
                }
            }
        }
    }
    let size = decade(random, -4.0, 1.0);
    let force = stiffness * size;
    let mut load: Vec<f64> = (0..n).map(|_| force * random.between(-0.3, 0.3)).collect();
    for &(i, j, v) in &normal {
        // Most nodes are pressed on the obstacle.
        let sign = if (i * 7 + 3) % 5 == 0 { -0.3 } else { 1.0 };
        load[j] += sign * force * v * random.between(0.0, 1.0);
    }
    let gap: Vec<f64> = (0..m)
        .map(|_| {
            if chance(random, 0.5) {
                0.0
            } else {
                size * random.between(0.0, 0.5)
            }
        })
        .collect();
    let mut mu: Vec<f64> = (0..m).map(|_| coefficient(random)).collect();
    if mu.iter().all(|&mu| mu == 0.0) {
        mu[0] = 0.4;
    }
    // Given bounds where there is no coefficient.
    let bound: Vec<f64> = (mu.iter())
        .map(|&mu| match (mu > 0.0, random.below(3)) {
            (true, _) | (_, 0) => 0.0,
            _ => force * random.between(0.0, 0.5),
        })
        .collect();
    let largest = mu.iter().copied().fold(0.0, f64::max);
    let problem = ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(n, n, entries.iter().copied()),
        load,
        normal: Csr::from_triplets(m, n, normal.iter().copied()),
        tangential: Csr::from_triplets(m, n, tangential.iter().copied()),
        gap: gap.clone(),
        slip_bound: bound.clone(),
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"))
    .with_friction_coefficient(mu.clone());
    let steps = pick(random, &[1, 1, 2, 3, 4]);
    let factors: Vec<f64> = if steps == 1 {
        vec![1.0]
    } else {
        (0..steps)
            .map(|_| pick(random, &[0.3, 1.0, -0.5, 0.2, 0.7, 0.0]))
            .collect()
    };
    let whole = Load::of(&problem);
    let loads = (factors.iter())
        .map(|factor| Load {
            force: whole.force.iter().map(|f| factor * f).collect(),
            acting: factor.abs() * whole.acting,
            ..whole.clone()
        })
        .collect();
    let mut text =
        format!("n = {n}, m = {m}, factors {factors:?}\nmu = {mu:?}\ng = {bound:?}\nd = {gap:?}\n");
    text += &format!(
        "f = {:?}\nN = {normal:?}\nT = {tangential:?}\n",
        whole.force
    );
    text += &format!(
        "K = {:?}\n",
        problem.stiffness().triplets().collect::<Vec<_>>()
    );
    Trial {
        name: format!(
            "matrices ({kind}{}), n = {n}, m = {m}, mu up to {largest:.2}, {steps} steps",
            if general { ", general rows" } else { "" }
        ),
        text,
        problem,
        loads,
    }
}

// ---------------------------------------------------------------------------------------------------------
// The independent check

/// Equilibrium, relative to the larger of the acting and of the contact forces.
const EQUILIBRIUM: f64 = 1e-4;
/// Penetration, relative to the deformation.
const PENETRATION: f64 = 1e-4;
/// Excess of the friction over μλν, relative to the largest μλν (and to that of the node).
const EXCESS: f64 = 1e-4;
/// The slip of a node that may not slip, and the gap of one that is pressed, relative to the deformation.
const LENGTH: f64 = 1e-3;
/// What the friction of a slipping node may lack to its bound, relative to that bound …
const LACK: f64 = 1e-3;
/// … and to the largest pressure: three times what the documentation promises of nodal tractions, as both the
/// traction and the pressure that bounds it have their errors.
const NODAL: f64 = 3e-3;
/// The part of what is allowed that an answer uses which is right beyond doubt.
const CLEARLY: f64 = 0.1;
/// What a body that is not held lacks to its balance at least, relative to the loads.
const BALANCE: f64 = 1e-7;
/// Rounding of a sum relative to its terms.
const ROUNDING: f64 = 1e-13;
/// Forces below this part of those that act are none.
const NOTHING: f64 = 1e-9;

type Entries = Vec<(usize, usize, f64)>;

/// A product with a matrix, and with the absolute values of everything.
fn times(entries: &Entries, rows: usize, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut product, mut size) = (vec![0.0; rows], vec![0.0; rows]);
    for &(i, j, v) in entries {
        product[i] += v * x[j];
        size[i] += (v * x[j]).abs();
    }
    (product, size)
}

fn largest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |largest: f64, v| {
        if v.is_nan() || largest.is_nan() {
            f64::NAN
        } else {
            largest.max(v.abs())
        }
    })
}

fn length(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// The optimality conditions (1)–(3) with Coulomb's law, from the matrices alone.
struct Checker {
    k: Entries,
    normal: Entries,
    tangential: Entries,
    mu: Vec<f64>,
    given: Vec<f64>,
    areas: Vec<f64>,
    n: usize,
    m: usize,
    /// For each connected part of K whose nodes have places, its rigid motions: orthonormal, as (unknown, entry).
    motions: Vec<Vec<(usize, f64)>>,
    /// How far a unit force of a multiplier moves its own node at least.
    compliance: Vec<f64>,
}

impl Checker {
    fn new(problem: &ContactProblem) -> Self {
        let k: Entries = problem.stiffness().triplets().collect();
        let normal: Entries = problem.normal().triplets().collect();
        let tangential: Entries = problem.tangential().triplets().collect();
        let (n, m) = (problem.stiffness().n_rows(), problem.m());
        let mut mu = problem.friction_coefficient().to_vec();
        mu.resize(m, 0.0);
        let mut diagonal = vec![0.0; n];
        for &(i, j, v) in &k {
            if i == j {
                diagonal[i] = v;
            }
        }
        let mut compliance = vec![0.0; 2 * m];
        for (shift, rows) in [(0, &normal), (m, &tangential)] {
            for &(i, j, v) in rows {
                compliance[i + shift] += v * v / diagonal[j];
            }
        }
        let motions = match problem.coordinates() {
            Some(points) => rigid_motions(&k, n, points),
            None => Vec::new(),
        };
        Self {
            mu,
            given: problem.slip_bound().to_vec(),
            areas: problem.areas().to_vec(),
            n,
            m,
            motions,
            compliance,
            k,
            normal,
            tangential,
        }
    }

    /// The largest displacement, less the mean rigid motion of each body.
    fn deformation(&self, u: &[f64]) -> f64 {
        let mut rest = u.to_vec();
        for motion in &self.motions {
            let part: f64 = motion.iter().map(|&(i, v)| v * u[i]).sum();
            for &(i, v) in motion {
                rest[i] -= part * v;
            }
        }
        largest(&rest)
    }

    /// What lengths at (u, λ) are compared with: the deformation, or what the contact forces do to their own nodes.
    fn size(&self, u: &[f64], lambda: &[f64]) -> f64 {
        let own = self.compliance.iter().zip(lambda).map(|(c, l)| c * l);
        let own: Vec<f64> = own.collect();
        self.deformation(u).max(largest(&own))
    }

    /// How the end of a step meets the conditions: for each its name, the contact node, and how many times what is
    /// allowed it is off.
    fn conditions(
        &self,
        load: &Load,
        start: &State,
        u: &[f64],
        lambda: &[f64],
    ) -> Vec<(&'static str, usize, f64)> {
        let (n, m) = (self.n, self.m);
        let (ln, lt) = lambda.split_at(m);
        let mut conditions = Vec::new();
        let mut check = |name: &'static str, node: usize, value: f64, allowed: f64| {
            if value > 0.0 {
                conditions.push((name, node, value / allowed));
            } else if value.is_nan() {
                conditions.push((name, node, f64::INFINITY));
            }
        };

        // (1)
        let (mut rest, mut sizes) = times(&self.k, n, u);
        // What is left of a larger displacement before has the rounding of that.
        let (_, before) = times(&self.k, n, &vec![largest(&start.u); n]);
        let mut contact = vec![0.0; n];
        for (rows, l) in [(&self.normal, ln), (&self.tangential, lt)] {
            for &(i, j, v) in rows {
                contact[j] += v * l[i];
            }
        }
        for i in 0..n {
            rest[i] += contact[i] - load.force[i];
            sizes[i] += before[i] + contact[i].abs() + load.force[i].abs();
        }
        let mut force = load.acting.max(length(&contact));
        if force == 0.0 {
            force = length(&load.force);
        }
        check(
            "equilibrium",
            0,
            length(&rest),
            EQUILIBRIUM * force + ROUNDING * length(&sizes),
        );

        // (2)
        let size = self.size(u, lambda);
        let far = largest(u).max(largest(&load.gap)).max(largest(&start.u));
        let rounding = ROUNDING * far.max(largest(&load.slide)).max(largest(&start.slide));
        let (closing, _) = times(&self.normal, m, u);
        let gap: Vec<f64> = load.gap.iter().zip(&closing).map(|(d, c)| d - c).collect();
        let pressure = (ln.iter().zip(&self.areas)).fold(0.0, |p: f64, (l, a)| p.max(l / a));
        let most = largest(lambda);
        for i in 0..m {
            check("penetration", i, -gap[i], PENETRATION * size + rounding);
            check("tension", i, -ln[i], 1e-10 * most);
            // Pressed, and apart.
            let open = (gap[i] - rounding) / (LENGTH * size);
            let pressed = ln[i] / (NODAL * pressure * self.areas[i]);
            if ln[i] > NOTHING * force && gap[i] > rounding {
                check("complementarity", i, open.min(pressed), 1.0);
            }
        }

        // (3)
        let (now, _) = times(&self.tangential, m, u);
        let (before, _) = times(&self.tangential, m, &start.u);
        let bound: Vec<f64> = (0..m)
            .map(|i| match self.mu[i] {
                0.0 => self.given[i],
                mu => mu * ln[i].max(0.0),
            })
            .collect();
        let of_law = (0..m).filter(|&i| self.mu[i] > 0.0);
        let friction = of_law.fold(0.0, |g: f64, i| g.max(bound[i]));
        // Forces are as exact as the largest pressure says; without pressure, as the largest bound says.
        let reference = if pressure > 0.0 {
            pressure
        } else {
            (bound.iter().zip(&self.areas)).fold(0.0, |p: f64, (g, a)| p.max(g / a))
        };
        for i in 0..m {
            let slack = match self.mu[i] {
                0.0 => 1e-10 * bound[i],
                _ => EXCESS * (bound[i] + friction),
            };
            check(
                "friction bound",
                i,
                lt[i].abs() - bound[i],
                slack + NOTHING * force,
            );
            let slip = now[i] - before[i] + load.slide[i] - start.slide[i];
            let slips = (slip.abs() - rounding) / (LENGTH * size);
            // The friction of a node that slips is all there, and (T u)ᵢ = c λτ,i with c ≥ 0.
            let lacks = bound[i] - lt[i] * slip.signum();
            let allowed = LACK * bound[i] + NODAL * reference * self.areas[i] + NOTHING * force;
            if slip.abs() > rounding && lacks > 0.0 {
                let which = if lacks > bound[i] {
                    "slip the wrong way"
                } else {
                    "slip without full friction"
                };
                check(which, i, slips.min(lacks / allowed), 1.0);
            }
        }
        conditions
    }
}

/// How far the forces on Coulomb's cones, and within the given bounds, stay from balancing the loads on the bodies
/// that contact alone holds, relative to these loads. Where they cannot, there is no solution.
fn unbalanced(problem: &ContactProblem, checker: &Checker, load: &Load) -> f64 {
    let (n, m) = (checker.n, checker.m);
    let free = problem.free_bodies();
    let wanted = free.resultants(&load.force);
    let size = length(&wanted);
    if size <= ROUNDING * 1e3 * length(&load.force) {
        return 0.0;
    }
    // What each force that generates a cone or an interval does to the motions, and the interval of its factor.
    let mut columns: Vec<(Vec<f64>, f64, f64)> = Vec::new();
    for i in 0..m {
        let row = |rows: &Entries| {
            let mut force = vec![0.0; n];
            for &(_, j, v) in rows.iter().filter(|entry| entry.0 == i) {
                force[j] += v;
            }
            free.resultants(&force)
        };
        let (normal, tangential) = (row(&checker.normal), row(&checker.tangential));
        let mu = checker.mu[i];
        if mu > 0.0 {
            for mu in [mu, -mu] {
                let edge = normal.iter().zip(&tangential).map(|(n, t)| n + mu * t);
                columns.push((edge.collect(), 0.0, f64::INFINITY));
            }
        } else {
            columns.push((normal, 0.0, f64::INFINITY));
            columns.push((tangential, -checker.given[i], checker.given[i]));
        }
    }
    // Least squares one factor after another.
    let mut factors = vec![0.0; columns.len()];
    let mut rest = wanted;
    for _ in 0..20_000 {
        for (factor, (column, low, high)) in factors.iter_mut().zip(&columns) {
            let square: f64 = column.iter().map(|c| c * c).sum();
            if square > 0.0 {
                let along: f64 = column.iter().zip(&rest).map(|(c, r)| c * r).sum();
                let moved = (*factor + along / square).clamp(*low, *high) - *factor;
                *factor += moved;
                for (r, c) in rest.iter_mut().zip(column) {
                    *r -= moved * c;
                }
            }
        }
        if length(&rest) <= 1e-9 * size {
            break;
        }
    }
    length(&rest) / size
}

/// Sets that are tried at most where all of them are, and unknowns.
const ALL_SETS: usize = 5_000;
const FEW_UNKNOWNS: usize = 300;
/// Springs that make K regular, relative to it; they hang on the displacement before, so that little is left in
/// them after so many turns where the bodies are balanced.
const SPRINGS: f64 = 1e-7;
const TURNS: usize = 20;

/// What a contact node does.
#[derive(Clone, Copy)]
struct Choice {
    closed: bool,
    /// λτ = slip · g; None where it sticks.
    slip: Option<f64>,
}

/// Whether a step of a small problem has a solution, found by trying all sets one after another; None where there
/// are too many, or nothing to measure forces by. A solution has to stand the check.
fn has_solution(checker: &Checker, load: &Load, start: &State) -> Option<bool> {
    let (n, m) = (checker.n, checker.m);
    let mut slides = vec![false; m];
    for &(i, _, v) in &checker.tangential {
        slides[i] |= v != 0.0;
    }
    let choices: Vec<Vec<Choice>> = (0..m)
        .map(|i| {
            let of = |closed, slips: &[Option<f64>]| {
                let choice = |&slip| Choice { closed, slip };
                slips.iter().map(choice).collect::<Vec<_>>()
            };
            let all = [None, Some(1.0), Some(-1.0)];
            let coulomb = checker.mu[i] > 0.0;
            if !slides[i] || (!coulomb && checker.given[i] == 0.0) {
                [of(false, &[Some(0.0)]), of(true, &[Some(0.0)])].concat()
            } else if coulomb {
                [of(false, &[Some(0.0)]), of(true, &all)].concat()
            } else {
                [of(false, &all), of(true, &all)].concat()
            }
        })
        .collect();
    let count = (choices.iter()).try_fold(1usize, |c, of| c.checked_mul(of.len()))?;
    if n > FEW_UNKNOWNS || count > ALL_SETS || largest(&load.force) == 0.0 {
        return None;
    }
    // H, the inverse of K with its springs, in units of K, and C = H Bᵀ.
    let stiffness = (checker.k.iter()).fold(0.0, |k: f64, e| k.max(e.2.abs()));
    let mut matrix = vec![vec![0.0; 2 * n]; n];
    for &(i, j, v) in &checker.k {
        matrix[i][j] += v / stiffness;
    }
    for (i, row) in matrix.iter_mut().enumerate() {
        row[i] += SPRINGS;
        row[n + i] = 1.0;
    }
    if !eliminate(&mut matrix, n) {
        return None;
    }
    let inverse: Vec<&[f64]> = matrix.iter().map(|row| &row[n..]).collect();
    let rows = (checker.normal.iter().copied())
        .chain(checker.tangential.iter().map(|&(i, j, v)| (m + i, j, v)));
    let rows: Entries = rows.collect();
    let mut moved = vec![vec![0.0; 2 * m]; n];
    for &(i, j, v) in &rows {
        for (moved, inverse) in moved.iter_mut().zip(&inverse) {
            moved[i] += v * inverse[j];
        }
    }
    let mut compliance = vec![vec![0.0; 2 * m]; 2 * m];
    for &(i, j, v) in &rows {
        for (c, moved) in compliance[i].iter_mut().zip(&moved[j]) {
            *c += v * moved;
        }
    }
    // What the load does without contact, with the springs hanging on `hooks`.
    let alone = |hooks: &[f64]| -> Vec<f64> {
        let force = load.force.iter().zip(hooks);
        let force: Vec<f64> = force.map(|(f, h)| f / stiffness + SPRINGS * h).collect();
        (inverse.iter())
            .map(|row| row.iter().zip(&force).map(|(h, f)| h * f).sum())
            .collect()
    };
    let first = alone(&start.u);
    let (before, _) = times(&checker.tangential, m, &start.u);
    let wanted = |i: usize| match i.checked_sub(m) {
        None => load.gap[i],
        Some(i) => before[i] - load.slide[i] + start.slide[i],
    };
    for number in 0..count {
        let mut left = number;
        let mut own = Vec::with_capacity(m);
        for of in &choices {
            own.push(of[left % of.len()]);
            left /= of.len();
        }
        let (mut alone_now, mut springs) = (first.clone(), f64::INFINITY);
        for turn in 0..TURNS {
            let (free, _) = times(&rows, 2 * m, &alone_now);
            let mut system = vec![vec![0.0; 2 * m + 1]; 2 * m];
            for (i, choice) in own.iter().enumerate() {
                let closed = |row: usize| {
                    let mut equation = compliance[row].clone();
                    equation.push(free[row] - wanted(row));
                    equation
                };
                if choice.closed {
                    system[i] = closed(i);
                } else {
                    system[i][i] = 1.0;
                }
                match choice.slip {
                    None => system[m + i] = closed(m + i),
                    Some(sign) => {
                        system[m + i][m + i] = 1.0;
                        if checker.mu[i] > 0.0 {
                            system[m + i][i] = -sign * checker.mu[i];
                        } else {
                            system[m + i][2 * m] = sign * checker.given[i] / stiffness;
                        }
                    }
                }
            }
            if !eliminate(&mut system, 2 * m) {
                break;
            }
            let mut lambda: Vec<f64> = system.iter().map(|row| row[2 * m]).collect();
            let u: Vec<f64> = (alone_now.iter().zip(&moved))
                .map(|(u, row)| u - row.iter().zip(&lambda).map(|(c, l)| c * l).sum::<f64>())
                .collect();
            // Rounding may leave a separated node with a trace of tension.
            let most = largest(&lambda[..m]);
            let pulls = lambda[..m].iter().any(|&l| l < -1e-7 * most);
            for (i, l) in lambda.iter_mut().enumerate() {
                *l = stiffness * if i < m { l.max(0.0) } else { *l };
            }
            let conditions = checker.conditions(load, start, &u, &lambda);
            if !pulls && conditions.iter().all(|c| c.2 <= 1.0) {
                return Some(true);
            }
            // Without forces left in the springs it is these sets that are wrong; forces that do not grow less carry
            // what nothing else does.
            let equilibrium = conditions.iter().filter(|c| c.0 == "equilibrium");
            let left = equilibrium.fold(0.0, |left: f64, c| left.max(c.2));
            if left < 0.1 || (turn > 1 && left > 0.8 * springs) {
                break;
            }
            springs = left;
            alone_now = alone(&u);
        }
    }
    Some(false)
}

/// Gauss–Jordan on the first n columns: leaves the solutions in the others. False if it is singular.
fn eliminate(matrix: &mut [Vec<f64>], n: usize) -> bool {
    for k in 0..n {
        let best = (k..n).max_by(|&i, &j| matrix[i][k].abs().total_cmp(&matrix[j][k].abs()));
        matrix.swap(k, best.expect("there is a row"));
        let pivot = matrix[k].clone();
        if !(pivot[k].abs() > 1e-13) {
            return false;
        }
        for (i, row) in matrix.iter_mut().enumerate() {
            if i != k && row[k] != 0.0 {
                let factor = row[k] / pivot[k];
                for (v, p) in row[k..].iter_mut().zip(&pivot[k..]) {
                    *v -= factor * p;
                }
            }
        }
        for v in &mut matrix[k][k..] {
            *v /= pivot[k];
        }
    }
    true
}

/// The rigid motions of each connected part of K, orthonormal; unknowns that nothing ties to others are held.
fn rigid_motions(k: &Entries, n: usize, points: &[[f64; 2]]) -> Vec<Vec<(usize, f64)>> {
    let mut tied = vec![false; n];
    let mut part: Vec<usize> = (0..n / 2).collect();
    fn root(part: &mut [usize], mut i: usize) -> usize {
        while part[i] != i {
            part[i] = part[part[i]];
            i = part[i];
        }
        i
    }
    for &(i, j, v) in k {
        if i != j && v != 0.0 {
            tied[i] = true;
            let (a, b) = (root(&mut part, i / 2), root(&mut part, j / 2));
            part[a] = b;
        }
    }
    let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for node in 0..n / 2 {
        let root = root(&mut part, node);
        parts.entry(root).or_default().push(node);
    }
    let mut motions = Vec::new();
    for nodes in parts.values() {
        let count = nodes.len() as f64;
        let middle = [0, 1].map(|c| nodes.iter().map(|&i| points[i][c]).sum::<f64>() / count);
        let mut own: Vec<Vec<(usize, f64)>> = Vec::new();
        for motion in 0..3 {
            let mut column = Vec::new();
            for &node in nodes {
                let [x, y] = points[node];
                let moved = match motion {
                    0 => [1.0, 0.0],
                    1 => [0.0, 1.0],
                    _ => [middle[1] - y, x - middle[0]],
                };
                for c in 0..2 {
                    if tied[2 * node + c] {
                        column.push((2 * node + c, moved[c]));
                    }
                }
            }
            let norm =
                |column: &[(usize, f64)]| column.iter().map(|c| c.1 * c.1).sum::<f64>().sqrt();
            let before = norm(&column);
            for _ in 0..2 {
                for other in &own {
                    // Both list the same unknowns.
                    let part: f64 = other.iter().zip(&column).map(|(a, b)| a.1 * b.1).sum();
                    for (c, o) in column.iter_mut().zip(other) {
                        c.1 -= part * o.1;
                    }
                }
            }
            let after = norm(&column);
            if after > 1e-6 * before {
                for c in &mut column {
                    c.1 /= after;
                }
                own.push(column);
            }
        }
        motions.extend(own);
    }
    motions
}

// ---------------------------------------------------------------------------------------------------------
// Runs

#[derive(Clone, Copy, PartialEq)]
enum Way {
    Cholesky,
    Pcg,
}

impl Way {
    fn name(self) -> &'static str {
        match self {
            Self::Cholesky => "cholesky",
            Self::Pcg => "pcg",
        }
    }
}

/// All load steps up to the first that does not converge.
struct Run {
    steps: Vec<StepSolution>,
    /// The status of the last step, or what went wrong.
    end: String,
    /// Iterations of PCG.
    iterations: usize,
    seconds: f64,
}

impl Run {
    fn solved(&self) -> bool {
        self.end == "converged"
    }

    fn products(&self) -> usize {
        self.steps.iter().map(StepSolution::n_a).sum()
    }

    /// Whether a step has converged; None where it was not reached.
    fn status(&self, step: usize) -> Option<Status> {
        self.steps.get(step).map(|s| s.status)
    }
}

fn name_of(status: Status) -> &'static str {
    match status {
        Status::Converged => "converged",
        Status::IterationLimit => "iteration_limit",
        Status::Stagnated => "stagnated",
        Status::NotHeld => "not_held",
        Status::TimeLimit => "time_limit",
        Status::Interrupted => "interrupted",
    }
}

fn run(trial: &Trial, way: Way, coupled: bool) -> Run {
    let begin = Instant::now();
    let mut steps = Vec::new();
    let ended = catch_unwind(AssertUnwindSafe(|| {
        let problem = &trial.problem;
        let mut dual: Box<dyn DualOperator> = match way {
            Way::Cholesky => Box::new(CholeskyDual::new(problem).map_err(|e| e.to_string())?),
            Way::Pcg => Box::new(
                NestedDual::new(problem, Cpu::<f32>::default(), Preconditioner::Multigrid)
                    .map_err(|e| e.to_string())?,
            ),
        };
        let memory = RefCell::default();
        let mut settings = Settings {
            coupled,
            ..Settings::default()
        };
        settings.ssnm.time_limit = Some(TIME_LIMIT);
        settings.ssnm.memory = Some(&memory);
        let mut state = State::at_rest(problem);
        for load in &trial.loads {
            let solution =
                quasistatic::solve_step(problem, load, &state, &mut *dual, &settings, |_| {
                    ControlFlow::Continue(())
                })
                .map_err(|e| e.to_string())?;
            let status = solution.status;
            state = solution.state(load);
            steps.push(solution);
            if status != Status::Converged {
                break;
            }
        }
        Ok(dual.costs().map_or(0, |costs| costs.solves.iterations))
    }));
    let (end, iterations) = match ended {
        Ok(Ok(iterations)) => {
            let last = steps.last().expect("there is a step").status;
            (name_of(last).to_owned(), iterations)
        }
        Ok(Err::<usize, String>(error)) => (format!("error: {error}"), 0),
        Err(_) => ("panic".to_owned(), 0),
    };
    Run {
        steps,
        end,
        iterations,
        seconds: begin.elapsed().as_secs_f64(),
    }
}

/// The start of a step of a run.
fn start_of(trial: &Trial, run: &Run, step: usize) -> State {
    match step {
        0 => State::at_rest(&trial.problem),
        _ => run.steps[step - 1].state(&trial.loads[step - 1]),
    }
}

/// What is wrong with the steps of a run that say `converged`. What is right, but close to its limit,
/// is noted in `closest`.
fn wrong_steps(
    trial: &Trial,
    checker: &Checker,
    run: &Run,
    closest: &mut BTreeMap<&'static str, f64>,
) -> Vec<String> {
    let mut all = Vec::new();
    for (number, step) in run.steps.iter().enumerate() {
        let load = &trial.loads[number];
        if step.status != Status::Converged {
            continue;
        }
        let start = start_of(trial, run, number);
        let conditions = checker.conditions(load, &start, &step.u, &step.lambda);
        let wrong: Vec<_> = conditions.iter().filter(|c| !(c.2 <= 1.0)).collect();
        for &(name, _, times) in conditions.iter().filter(|c| c.2 <= 1.0) {
            let most = closest.entry(name).or_default();
            *most = most.max(times);
        }
        // The worst one says enough.
        if let Some((name, node, times)) = wrong.iter().max_by(|a, b| a.2.total_cmp(&b.2)) {
            all.push(format!(
                "step {}: {name} at contact node {node}, {times:.2e} times what is allowed ({} conditions broken)",
                number + 1,
                wrong.len()
            ));
        }
    }
    all
}

/// What a step that has not converged is worth.
enum GivenUp {
    /// It is a solution.
    Right,
    /// There is a solution.
    Missed,
    /// There is none.
    Hopeless,
    /// Nobody knows.
    Open,
}

/// Judges the last step of a run, if it has not converged.
fn judge(trial: &Trial, checker: &Checker, run: &Run) -> Option<(Status, GivenUp)> {
    let number = run.steps.len().checked_sub(1)?;
    let (status, load) = (run.steps[number].status, &trial.loads[number]);
    if status == Status::Converged {
        return None;
    }
    let start = start_of(trial, run, number);
    let end = &run.steps[number];
    let conditions = checker.conditions(load, &start, &end.u, &end.lambda);
    if status != Status::NotHeld && conditions.iter().all(|c| c.2 <= CLEARLY) {
        return Some((status, GivenUp::Right));
    }
    let given_up = match has_solution(checker, load, &start) {
        Some(true) => GivenUp::Missed,
        Some(false) => GivenUp::Hopeless,
        None if unbalanced(&trial.problem, checker, load) > BALANCE => GivenUp::Hopeless,
        None => GivenUp::Open,
    };
    Some((status, given_up))
}

/// What a campaign on one path has found.
#[derive(Default)]
struct Tally {
    problems: usize,
    refused: Vec<String>,
    steps: [usize; 2],
    ends: [BTreeMap<String, usize>; 2],
    seconds: [f64; 2],
    slowest: [(f64, u64); 2],
    wrong: [Vec<String>; 2],
    /// For each condition, the largest part of what is allowed in a right answer.
    closest: [BTreeMap<&'static str, f64>; 2],
    /// Steps that have not converged, by what they say: those that have a solution, all the same; and how many
    /// have none, or may have one.
    missed: [Vec<String>; 2],
    too_strict: [Vec<String>; 2],
    hopeless: [BTreeMap<&'static str, usize>; 2],
    open: [BTreeMap<&'static str, usize>; 2],
    panics: Vec<String>,
    only_rounds: Vec<String>,
    only_coupled: Vec<String>,
    disputed: Vec<String>,
    others: Vec<String>,
    both: usize,
    products: [usize; 2],
    iterations: [usize; 2],
    slower: Vec<(usize, usize, u64, usize, String)>,
    resorted: Vec<String>,
    resort_rounds: usize,
}

const WAYS: [&str; 2] = ["coupled", "rounds"];

impl Tally {
    fn add(&mut self, seed: u64, way: Way) {
        self.problems += 1;
        let trial = match trial(seed) {
            Ok(trial) => trial,
            Err(error) => {
                self.refused.push(format!("{seed}: {error}"));
                return;
            }
        };
        let checker = Checker::new(&trial.problem);
        let runs = [true, false].map(|coupled| run(&trial, way, coupled));
        let mut right = [true; 2];
        for (k, run) in runs.iter().enumerate() {
            self.steps[k] += run.steps.len();
            *self.ends[k].entry(run.end.clone()).or_default() += 1;
            self.seconds[k] += run.seconds;
            if run.seconds > self.slowest[k].0 {
                self.slowest[k] = (run.seconds, seed);
            }
            if run.end == "panic" {
                self.panics
                    .push(format!("{seed} {}: {}", WAYS[k], trial.name));
            }
            let wrong = wrong_steps(&trial, &checker, run, &mut self.closest[k]);
            right[k] = wrong.is_empty();
            for wrong in wrong {
                self.wrong[k].push(format!("{seed}: {wrong} [{}]", trial.name));
            }
            let number = run.steps.len();
            match judge(&trial, &checker, run) {
                Some((Status::NotHeld, GivenUp::Missed)) => self.wrong[k].push(format!(
                    "{seed}: step {number}: not_held, but there is a solution [{}]",
                    trial.name
                )),
                Some((status, GivenUp::Right)) => self.too_strict[k].push(format!(
                    "{seed}: step {number}: {} [{}]",
                    name_of(status),
                    trial.name
                )),
                Some((status, GivenUp::Missed)) => self.missed[k].push(format!(
                    "{seed}: step {number}: {} [{}]",
                    name_of(status),
                    trial.name
                )),
                Some((status, GivenUp::Hopeless)) => {
                    *self.hopeless[k].entry(name_of(status)).or_default() += 1;
                }
                Some((status, GivenUp::Open)) => {
                    *self.open[k].entry(name_of(status)).or_default() += 1;
                }
                None => {}
            }
        }
        let [coupled, rounds] = &runs;
        // Step by step, as far as both have come, and as long as both have the same history.
        for number in 0..trial.loads.len() {
            let [c, r] = [coupled, rounds].map(|run| run.status(number));
            let (Some(c), Some(r)) = (c, r) else {
                // Panics and errors have no status.
                let broken = |run: &Run| run.end == "panic" || run.end.starts_with("error");
                if c.is_none() && r == Some(Status::Converged) && broken(coupled) {
                    let line = format!(
                        "{seed}: step {}: {} [{}]",
                        number + 1,
                        coupled.end,
                        trial.name
                    );
                    self.only_rounds.push(line);
                }
                if r.is_none() && c == Some(Status::Converged) && broken(rounds) {
                    let line = format!(
                        "{seed}: step {}: {} [{}]",
                        number + 1,
                        rounds.end,
                        trial.name
                    );
                    self.only_coupled.push(line);
                }
                break;
            };
            let line = || {
                format!(
                    "{seed}: step {} of {}: coupled {} ({} products, {} solves), rounds {} ({} products, {} solves) [{}]",
                    number + 1,
                    trial.loads.len(),
                    name_of(c),
                    coupled.steps[number].n_a(),
                    coupled.steps[number].rounds.len(),
                    name_of(r),
                    rounds.steps[number].n_a(),
                    rounds.steps[number].rounds.len(),
                    trial.name
                )
            };
            let not_held = [c, r].contains(&Status::NotHeld);
            match (c == Status::Converged, r == Status::Converged) {
                (true, true) => {
                    let [a, b] = [coupled, rounds].map(|run| &run.steps[number]);
                    let size = checker
                        .size(&a.u, &a.lambda)
                        .max(checker.size(&b.u, &b.lambda));
                    let apart: Vec<f64> = a.u.iter().zip(&b.u).map(|(a, b)| a - b).collect();
                    // Where all loads are gone, rounding of what was there is left.
                    let ago = (coupled.steps[..number].iter())
                        .fold(0.0, |s: f64, step| s.max(largest(&step.u)));
                    // And a body that moves as a whole has hardly a deformation.
                    let far = 1e-4 * largest(&a.u).max(largest(&b.u));
                    let apart = largest(&apart) / (size + 1e-9 * ago).max(far);
                    if apart > 1e-3 {
                        self.others.push(format!(
                            "{seed}: step {}: apart by {apart:.1e}{} [{}]",
                            number + 1,
                            if right == [true; 2] {
                                ""
                            } else {
                                ", and one is WRONG"
                            },
                            trial.name
                        ));
                        break;
                    }
                }
                (false, true) => self.only_rounds.push(line()),
                (true, false) => self.only_coupled.push(line()),
                // Both give up, but one says that there is no solution.
                (false, false) if not_held && c != r => self.disputed.push(line()),
                (false, false) => {}
            }
        }
        for (number, step) in coupled.steps.iter().enumerate() {
            if step.rounds.len() > 1 {
                self.resort_rounds += step.rounds.len() - 1;
                self.resorted.push(format!(
                    "{seed}: step {}: {}, {} solves [{}]",
                    number + 1,
                    name_of(step.status),
                    step.rounds.len(),
                    trial.name
                ));
            }
        }
        if coupled.solved() && rounds.solved() {
            self.both += 1;
            let products = [coupled.products(), rounds.products()];
            for k in 0..2 {
                self.products[k] += products[k];
                self.iterations[k] += runs[k].iterations;
            }
            if products[0] > products[1] {
                let solves = coupled.steps.iter().map(|s| s.rounds.len()).sum();
                self.slower
                    .push((products[0], products[1], seed, solves, trial.name));
            }
        }
    }

    fn print(&mut self, way: Way) {
        let section = |title: &str, lines: &[String]| {
            println!("{}: {}", title, lines.len());
            for line in lines {
                println!("    {line}");
            }
        };
        println!("\n== {} ==", way.name());
        println!(
            "problems {}, of which refused {}",
            self.problems,
            self.refused.len()
        );
        for k in 0..2 {
            let ends: Vec<String> = self.ends[k]
                .iter()
                .map(|(e, n)| format!("{e} {n}"))
                .collect();
            println!(
                "{:8} steps {}; problems: {}; {:.1} s, the slowest {:.2} s (seed {})",
                WAYS[k],
                self.steps[k],
                ends.join(", "),
                self.seconds[k],
                self.slowest[k].0,
                self.slowest[k].1
            );
        }
        for k in 0..2 {
            let parts: Vec<String> = (self.closest[k].iter())
                .map(|(name, part)| format!("{name} {part:.1e}"))
                .collect();
            println!(
                "{:8} right answers use of what is allowed at most: {}",
                WAYS[k],
                parts.join(", ")
            );
        }
        println!(
            "both solved {}; products: coupled {}, rounds {} (PCG iterations {}, {})",
            self.both, self.products[0], self.products[1], self.iterations[0], self.iterations[1]
        );
        println!(
            "coupled took more products in {} problems; the worst:",
            self.slower.len()
        );
        self.slower
            .sort_by_key(|&(c, r, ..)| std::cmp::Reverse(c - r));
        for (c, r, seed, solves, name) in self.slower.iter().take(10) {
            println!("    {seed}: {c} against {r}, {solves} solves [{name}]");
        }
        println!(
            "coupled steps that took rounds: {} of {}, {} more solves",
            self.resorted.len(),
            self.steps[0],
            self.resort_rounds
        );
        section("    they are", &self.resorted);
        section("another solution", &self.others);
        section("solved by rounds, not coupled", &self.only_rounds);
        section("solved coupled, not by rounds", &self.only_coupled);
        section("no solution by one, given up by the other", &self.disputed);
        for k in 0..2 {
            println!(
                "{:8} given up, but a small problem that has a solution: {}; without a solution {:?}, not known {:?}",
                WAYS[k],
                self.missed[k].len(),
                self.hopeless[k],
                self.open[k]
            );
            for line in &self.missed[k] {
                println!("    {line}");
            }
            println!(
                "{:8} given up at a point that stands the check: {}",
                WAYS[k],
                self.too_strict[k].len()
            );
            for line in &self.too_strict[k] {
                println!("    {line}");
            }
        }
        section("wrong, coupled", &self.wrong[0]);
        section("wrong, rounds", &self.wrong[1]);
        section("panics", &self.panics);
        section("refused", &self.refused);
    }

    /// What a campaign has to keep.
    fn failures(&self, way: Way) -> Vec<String> {
        let mut failures = Vec::new();
        let mut none = |what: &str, count: usize| {
            if count > 0 {
                failures.push(format!("{}: {count} {what}", way.name()));
            }
        };
        none("wrong answers of coupled steps", self.wrong[0].len());
        none("wrong answers of rounds", self.wrong[1].len());
        none("panics", self.panics.len());
        none("solved by rounds only", self.only_rounds.len());
        none("refused", self.refused.len());
        for k in 0..2 {
            let late = self.slowest[k].0 > 4.0 * 1.5 * TIME_LIMIT.as_secs_f64();
            none("runs without an end", usize::from(late));
        }
        if self.products[0] >= self.products[1] {
            none("products too many", 1 + self.products[0] - self.products[1]);
        }
        failures
    }
}

/// Tries so many problems on a path; what has failed.
fn campaign(way: Way, first: u64, problems: u64) -> Vec<String> {
    let mut tally = Tally::default();
    for seed in first..first + problems {
        tally.add(seed, way);
    }
    tally.print(way);
    tally.failures(way)
}

fn number(name: &str) -> Option<u64> {
    let value = std::env::var(name).ok()?;
    Some(
        value
            .parse()
            .unwrap_or_else(|_| panic!("{name} = {value} is no number")),
    )
}

/// Prints a problem, and how each solve of it goes.
fn tell(seed: u64, ways: &[Way]) {
    let trial = trial(seed).unwrap_or_else(|error| panic!("{error}"));
    let problem = &trial.problem;
    println!("{seed}: {}\n{}", trial.name, trial.text);
    println!("n = {}, m = {}", problem.n(), problem.m());
    let checker = Checker::new(problem);
    for &way in ways {
        for (k, coupled) in [true, false].into_iter().enumerate() {
            let run = run(&trial, way, coupled);
            println!(
                "---- {} {}: {} in {:.2} s",
                way.name(),
                WAYS[k],
                run.end,
                run.seconds
            );
            for (number, step) in run.steps.iter().enumerate() {
                println!(
                    "step {}: {}, {} products, {:?}",
                    number + 1,
                    name_of(step.status),
                    step.n_a(),
                    step.kkt
                );
                for body in &step.not_held {
                    println!("  not held: {body:?}");
                }
                for round in &step.rounds {
                    println!(
                        "  solve {}{}: {} steps, {} products, err {:.2e}, change {:.2e}, tolerance {:.0e}",
                        round.round,
                        if round.frozen { " (frozen)" } else { "" },
                        round.info.iter,
                        round.info.n_a,
                        round.info.err_relative,
                        round.friction_change,
                        round.tolerance
                    );
                    for row in &round.info.history {
                        println!(
                            "    {:3} inner {:3} products {:4} err {:.3e} {:?} changes {}{}",
                            row.iter,
                            row.inner,
                            row.n_a,
                            row.err,
                            row.sets,
                            row.changes,
                            if row.safeguarded { " safeguard" } else { "" }
                        );
                    }
                }
                let start = start_of(&trial, &run, number);
                if step.status == Status::Converged {
                    for (name, node, times) in
                        checker.conditions(&trial.loads[number], &start, &step.u, &step.lambda)
                    {
                        if !(times <= 1.0) {
                            println!(
                                "  WRONG: {name} at contact node {node}, {times:.2e} times what is allowed"
                            );
                        }
                    }
                }
            }
        }
    }
}

#[test]
#[ignore = "some thousand solves"]
fn random_problems() {
    let ways: Vec<Way> = match std::env::var("COULOMB_PATHS").as_deref() {
        Ok("cholesky") => vec![Way::Cholesky],
        Ok("pcg") => vec![Way::Pcg],
        _ => vec![Way::Cholesky, Way::Pcg],
    };
    if let Some(seed) = number("COULOMB_ONLY") {
        tell(seed, &ways);
        return;
    }
    let first = number("COULOMB_SEED").unwrap_or(1);
    let problems = number("COULOMB_PROBLEMS").unwrap_or(1000);
    let mut failures = Vec::new();
    for way in ways {
        failures.extend(campaign(way, first, problems));
    }
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn a_few_random_problems() {
    let mut failures = campaign(Way::Cholesky, 1, 60);
    failures.extend(campaign(Way::Pcg, 61, 20));
    assert!(failures.is_empty(), "{failures:#?}");
}

/// Trying all sets finds what the solver has found.
#[test]
fn all_sets_hold_the_solution() {
    let (mut tried, mut lost) = (0, Vec::new());
    for seed in 1..=150 {
        let Ok(trial) = trial(seed) else { continue };
        let checker = Checker::new(&trial.problem);
        let run = run(&trial, Way::Cholesky, true);
        for (number, step) in run.steps.iter().enumerate() {
            let start = start_of(&trial, &run, number);
            let load = &trial.loads[number];
            if step.status == Status::Converged && largest(&step.lambda) > 0.0 {
                match has_solution(&checker, load, &start) {
                    Some(true) => tried += 1,
                    Some(false) => {
                        lost.push(format!("{seed}, step {}: {}", number + 1, trial.name))
                    }
                    None => {}
                }
            }
        }
    }
    println!("{tried} steps");
    assert!(lost.is_empty(), "{lost:#?}");
    assert!(tried > 50, "{tried}");
}

/// The check is worth something: the answers to a neighbouring problem (friction higher or lower by a tenth, a gap
/// wider, a step that starts elsewhere) do not pass wherever they differ by a hundredth of the deformation.
#[test]
fn the_check_tells_a_neighbouring_problem() {
    let (mut told, mut missed) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for seed in 1..=150 {
        let Ok(trial) = trial(seed) else { continue };
        let checker = Checker::new(&trial.problem);
        let right = run(&trial, Way::Cholesky, true);
        if right.steps[0].status != Status::Converged {
            continue;
        }
        let solution = &right.steps[0];
        let size = checker.size(&solution.u, &solution.lambda);
        if size == 0.0 {
            continue;
        }
        let rest = State::at_rest(&trial.problem);
        for what in ["more friction", "less friction", "wider gap", "other start"] {
            let factor = match what {
                "more friction" => 1.1,
                "less friction" => 0.9,
                _ => 1.0,
            };
            let mu = trial.problem.friction_coefficient().iter();
            let problem = (trial.problem.clone())
                .with_friction_coefficient(mu.map(|mu| factor * mu).collect());
            let mut load = trial.loads[0].clone();
            let mut start = rest.clone();
            if what == "wider gap" {
                load.gap.iter_mut().for_each(|d| *d += 0.1 * size);
            }
            if what == "other start" {
                start.slide.iter_mut().for_each(|s| *s += 0.1 * size);
            }
            let mut dual = CholeskyDual::new(&problem).unwrap_or_else(|error| panic!("{error}"));
            let other = quasistatic::solve_step(
                &problem,
                &load,
                &start,
                &mut dual,
                &Settings::default(),
                |_| ControlFlow::Continue(()),
            )
            .unwrap_or_else(|error| panic!("{error}"));
            let apart = solution.u.iter().zip(&other.u).map(|(a, b)| a - b);
            let apart: Vec<f64> = apart.collect();
            if other.status != Status::Converged || largest(&apart) < 1e-2 * size {
                continue;
            }
            let conditions = checker.conditions(&trial.loads[0], &rest, &other.u, &other.lambda);
            match conditions.iter().max_by(|a, b| a.2.total_cmp(&b.2)) {
                Some((name, _, times)) if *times > 1.0 => *told.entry(name).or_default() += 1,
                _ => missed.push(format!("{seed}, {what}: {}", trial.name)),
            }
        }
    }
    println!("told by {told:?}");
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(told.values().sum::<usize>() > 100, "{told:?}");
}
