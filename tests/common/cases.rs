//! Random elastic cases as a user writes them, from a stream of random numbers.

mod bodies;

use super::Random;
use super::draw::{chance, decade, pick};
use signorini::case::Case;
use signorini::problem::ContactProblem;
use signorini::quasistatic::Load;
use std::fmt::Write as _;
use std::path::Path;

pub use bodies::{one_body, stack};

/// The choices of random cases.
#[derive(Clone, Copy)]
pub struct Range {
    /// Decades of Young's modulus, and of the size of a body.
    pub young: [f64; 2],
    pub length: [f64; 2],
    /// Nodes of a body at most, about.
    pub nodes: usize,
    pub laws: Laws,
}

/// The friction laws of a case.
#[derive(Clone, Copy, PartialEq)]
pub enum Laws {
    /// Mostly Coulomb's; at least one contact has it.
    Coulomb,
    /// As often none or Tresca's.
    Any,
    /// None or Tresca's, which make answers unique.
    Given,
}

impl Range {
    /// Realistic blocks and forces, with Coulomb friction.
    pub fn coulomb(nodes: usize) -> Self {
        Self {
            young: [2.0, 11.5],
            length: [-3.0, 1.0],
            nodes,
            laws: Laws::Coulomb,
        }
    }
}

/// A problem with its load steps.
pub struct Trial<const D: usize = 2> {
    /// A short description.
    pub name: String,
    /// The whole case, for debugging.
    pub text: String,
    pub problem: ContactProblem<D>,
    pub loads: Vec<Load>,
}

/// A name and a case file.
pub struct Written {
    pub name: String,
    pub text: String,
}

pub fn elastic(written: Written) -> Result<Trial, String> {
    let Written { name, text } = written;
    let told = |error: &dyn std::fmt::Display| format!("{name}: {error}\n{text}");
    let case =
        Case::parse(Path::new("tests/case.toml"), text.clone(), &[]).map_err(|e| told(&e))?;
    let build =
        (case.build().map_err(|e| told(&e))?.plane()).ok_or("no elastic case in the plane")?;
    let mut loads = Vec::new();
    for step in 0..case.n_steps() {
        loads.push(build.step(step).map_err(|e| told(&e))?.load);
    }
    Ok(Trial {
        name,
        text,
        problem: build.problem,
        loads,
    })
}

/// A coefficient of friction: often one in use, seldom one that makes the problem hard.
pub fn coefficient(random: &mut Random) -> f64 {
    match random.below(10) {
        0 => 0.0,
        1..=6 => random.between(0.05, 0.6),
        7..=8 => random.between(0.6, 1.2),
        _ => random.between(1.2, 2.0),
    }
}

/// A friction law in the form of the case file. `pressure` is a typical one, `width` a typical length.
pub fn friction(
    random: &mut Random,
    laws: Laws,
    pressure: f64,
    width: f64,
    names: &mut Vec<String>,
) -> String {
    let mu = coefficient(random);
    let law = match laws {
        Laws::Coulomb => random.below(10),
        Laws::Any => pick(random, &[0, 0, 0, 1, 1, 10, 2, 3, 4, 4]),
        Laws::Given => pick(random, &[0, 0, 1, 1, 10]),
    };
    let (name, text) = match law {
        0 => ("none".to_owned(), "\"none\"".to_owned()),
        10 => {
            let bound = pressure * random.between(0.0, 1.0);
            (
                format!("tresca {bound:.2e} in places"),
                format!("{{ tresca = \"max(0, {bound:e} * sin(7 * x / {width:e}))\" }}"),
            )
        }
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
pub struct Turn {
    pub cos: f64,
    pub sin: f64,
}

impl Turn {
    pub fn by(angle: f64) -> Self {
        let (sin, cos) = if angle == 0.0 {
            (0.0, 1.0)
        } else {
            angle.sin_cos()
        };
        Self { cos, sin }
    }

    pub fn of(self, [x, y]: [f64; 2]) -> [f64; 2] {
        [self.cos * x - self.sin * y, self.sin * x + self.cos * y]
    }

    /// The `map` of a rectangle to (ξ, η), given as expressions of x and y.
    pub fn map(self, xi: &str, eta: &str) -> String {
        let (c, s) = (self.cos, self.sin);
        format!(
            "map = [\"({c:e}) * ({xi}) - ({s:e}) * ({eta})\", \"({s:e}) * ({xi}) + ({c:e}) * ({eta})\"]"
        )
    }
}

/// A rigid half-plane under a boundary.
pub fn half_plane(boundary: &str, point: [f64; 2], normal: [f64; 2], friction: &str) -> String {
    let ([x, y], [a, b]) = (point, normal);
    format!(
        "[[contact]]\nboundary = \"{boundary}\"\n\
         obstacle = {{ half_plane = {{ point = [{x:e}, {y:e}], normal = [{a:e}, {b:e}] }} }}\n\
         friction = {friction}\n"
    )
}

pub fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(|v| format!("{v:e}")).collect();
    format!("[{}]", values.join(", "))
}

/// Factors of pressing loads: positive; and of shearing or moving ones: up, down, reversed.
pub struct Factors {
    pub press: Vec<f64>,
    pub shear: Vec<f64>,
}

impl Factors {
    pub fn new(random: &mut Random, held: bool) -> Self {
        let steps = pick(random, &[1, 1, 1, 2, 2, 3, 4]);
        let shear: Vec<f64> = if steps == 1 {
            vec![1.0]
        } else {
            (0..steps)
                .map(|_| pick(random, &[0.3, 1.0, -0.5, 0.2, 0.0, -1.0, 0.7]))
                .collect()
        };
        let press = if held && chance(random, 0.4) {
            // The whole load together, up and down: bodies may lift off.
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

    pub fn text(&self) -> String {
        format!("[steps]\nfactors = {}\n", list(&self.shear))
    }
}

/// Cells, few enough for few unknowns, and not too slender.
pub fn cells(random: &mut Random, [w, h]: [f64; 2], nodes: usize) -> [usize; 2] {
    let across = 1 + (random.unit().powi(2) * 30.0) as usize;
    let up = (across as f64 * h / w * decade(random, -0.3, 0.3)).round();
    let up = (up as usize).clamp(1, 24);
    [across, up.min((nodes / (across + 1)).max(2) - 1).max(1)]
}

/// The analysis, the material and their figures.
pub struct Stuff {
    pub young: f64,
    /// A typical strain, and the pressure that makes it.
    pub strain: f64,
    pub pressure: f64,
    pub poisson: f64,
}

impl Stuff {
    pub fn new(random: &mut Random, range: Range) -> Self {
        let young = decade(random, range.young[0], range.young[1]);
        let strain = decade(random, -6.0, -2.0);
        Self {
            young,
            strain,
            pressure: young * strain,
            poisson: pick(random, &[0.0, 0.2, 0.3, 0.3, 0.45, 0.49]),
        }
    }

    pub fn material(&self, region: &str, ratio: f64) -> String {
        format!(
            "[[material]]\nregion = \"{region}\"\nyoung = {:e}\npoisson = {}\n",
            self.young * ratio,
            self.poisson
        )
    }
}

/// A traction with directions of a rotated frame.
pub fn traction(boundary: &str, force: [f64; 2], factors: &[f64]) -> String {
    let [x, y] = force;
    format!(
        "[[traction]]\nboundary = \"{boundary}\"\nx = {x:e}\ny = {y:e}\nfactors = {}\n",
        list(factors)
    )
}

pub fn pressure(boundary: &str, value: &str, factors: &[f64]) -> String {
    format!(
        "[[traction]]\nboundary = \"{boundary}\"\npressure = \"{value}\"\nfactors = {}\n",
        list(factors)
    )
}

pub fn support(place: &str, [x, y]: [Option<f64>; 2], factors: &[f64]) -> String {
    let mut text = format!("[[support]]\n{place}\n");
    for (name, value) in [("x", x), ("y", y)] {
        if let Some(value) = value {
            writeln!(text, "{name} = {value:e}").expect("writing to a string cannot fail");
        }
    }
    text + &format!("factors = {}\n", list(factors))
}
