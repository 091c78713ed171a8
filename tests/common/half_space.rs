//! Elastic half-spaces: displacements of forces far away, meshes that grow finer towards a contact, and comparisons
//! with Hertz's theory.

use super::models::Answer;
use super::space::Vector;
use signorini::elasticity::Material;
use std::f64::consts::PI;

pub const STEEL: Material = Material::new(2e11, 0.3);

/// E/(1 − ν²) against a rigid body.
pub fn modulus(material: Material) -> f64 {
    material.young / (1.0 - material.poisson.powi(2))
}

pub fn shear_modulus(material: Material) -> f64 {
    0.5 * material.young / (1.0 + material.poisson)
}

/// Prints a row of the table and refuses a value that is off by more than `limit`.
#[track_caller]
pub fn compare(what: &str, computed: f64, reference: f64, limit: f64) {
    let off = computed / reference - 1.0;
    println!(
        "| {what} | {computed:.6e} | {reference:.6e} | {:+.3} % |",
        100.0 * off
    );
    assert!(
        off.abs() <= limit,
        "{what}: {computed:e} instead of {reference:e}"
    );
}

/// The displacement of the half-space z < 0 under a force P down at the origin (Boussinesq 1885).
pub fn under_a_force(material: Material, force: f64, [x, y, z]: Vector) -> Vector {
    let depth = -z;
    let r = (x * x + y * y + depth * depth).sqrt();
    let factor = force / (4.0 * PI * shear_modulus(material));
    let nu = material.poisson;
    let outwards = factor * (depth / r.powi(3) - (1.0 - 2.0 * nu) / (r * (r + depth)));
    let down = factor * (2.0 * (1.0 - nu) / r + depth * depth / r.powi(3));
    [outwards * x, outwards * y, -down]
}

/// The displacement of the half-space z < 0 under a force Q along x at the origin (Cerruti 1882).
pub fn under_a_drag(material: Material, force: f64, [x, y, z]: Vector) -> Vector {
    let depth = -z;
    let r = (x * x + y * y + depth * depth).sqrt();
    let factor = force / (4.0 * PI * shear_modulus(material));
    let rest = 1.0 - 2.0 * material.poisson;
    let aside = 1.0 / r.powi(3) - rest / (r * (r + depth).powi(2));
    let down = depth / r.powi(3) + rest / (r * (r + depth));
    [
        factor * (1.0 / r + rest / (r + depth) + x * x * aside),
        factor * x * y * aside,
        -factor * x * down,
    ]
}

/// The displacement under forces on a circle of radius a, where one at the origin makes `alone` and p r dr dθ is
/// proportional to `share` at r = a sin φ for equal parts of φ and θ.
pub fn under_a_disc(
    alone: impl Fn(Vector) -> Vector,
    a: f64,
    share: impl Fn(f64) -> f64,
    x: Vector,
) -> Vector {
    let (rings, points) = (8, 16);
    let middle = |k: usize, n: usize| (k as f64 + 0.5) / n as f64;
    let (mut u, mut total) = ([0.0; 3], 0.0);
    for ring in 0..rings {
        let phi = 0.5 * PI * middle(ring, rings);
        for point in 0..points {
            let (sin, cos) = (2.0 * PI * middle(point, points)).sin_cos();
            let from = [x[0] - a * phi.sin() * cos, x[1] - a * phi.sin() * sin, x[2]];
            let part = alone(from);
            (0..3).for_each(|c| u[c] += share(phi) * part[c]);
            total += share(phi);
        }
    }
    u.map(|u| u / total)
}

/// The share of Hertz's pressure p₀ √(1 − r²/a²).
pub fn hertz_share(phi: f64) -> f64 {
    phi.cos().powi(2) * phi.sin()
}

/// The displacement under a force P down on a circle, which is symmetric to the last bit.
pub fn under_a_pressed_disc(
    material: Material,
    force: f64,
    a: f64,
    share: impl Fn(f64) -> f64,
    x: Vector,
) -> Vector {
    let u = under_a_disc(|x| under_a_force(material, force, x), a, share, x);
    std::array::from_fn(|c| if x[c] == 0.0 && c < 2 { 0.0 } else { u[c] })
}

/// The same under a torque about z: twice what it is in the whole space.
pub fn under_a_torque(material: Material, torque: f64, [x, y, z]: Vector) -> Vector {
    let r = (x * x + y * y + z * z).sqrt();
    let factor = torque / (4.0 * PI * shear_modulus(material) * r.powi(3));
    [-factor * y, factor * x, 0.0]
}

/// Places from 0 on: those of `inner`, then `n` more at distances that grow geometrically from `first`, up to `end`.
pub fn growing(inner: &[f64], first: f64, n: usize, end: f64) -> Vec<f64> {
    let start = inner.last().copied().unwrap_or(0.0);
    let sum = |ratio: f64| first * (0..n as i32).map(|k| ratio.powi(k)).sum::<f64>();
    let (mut low, mut high) = (0.5, 10.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if start + sum(middle) < end {
            low = middle
        } else {
            high = middle
        }
    }
    let mut places = inner.to_vec();
    let mut step = first;
    for _ in 0..n {
        places.push(places.last().copied().unwrap_or(0.0) + step);
        step *= low;
    }
    places
}

/// Positions of squares around the axis that are bent into circles at the radius 1 and left alone at `size` and near the
/// axis: this many of them up to that radius, finest there, and `out` more. The width of the last one inside is the second
/// entry.
pub fn rings(across: usize, out: usize, size: f64) -> (Vec<f64>, f64) {
    let radii: Vec<f64> = (0..=across)
        .map(|k| (0.5 * PI * k as f64 / across as f64).sin())
        .collect();
    let last = 1.0 - radii[across - 1];
    (growing(&radii, last, out, size), last)
}

/// The place of the node [i, j] of a quarter of [`rings`].
pub fn on_rings(radii: &[f64], size: f64, [i, j]: [usize; 2]) -> [f64; 2] {
    let shell = i.max(j);
    let rho = radii[shell];
    let [s, t] = [i, j].map(|i| i as f64 / shell.max(1) as f64);
    let round = if rho <= 1.0 {
        rho
    } else {
        (size - rho) / (size - 1.0)
    };
    let square = if rho <= 1.0 { 0.7 } else { 1.0 } * (1.0 - round);
    let bent = [
        s * (1.0 - 0.5 * t * t).sqrt(),
        t * (1.0 - 0.5 * s * s).sqrt(),
    ];
    [0, 1].map(|c| rho * (square * [s, t][c] + round * bent[c]))
}

/// Prints the cost of an answer.
pub fn sizes(name: &str, answer: &Answer<3>) {
    let (nodes, solution) = (answer.built.elastic.mesh.nodes.len(), &answer.solution);
    println!(
        "{name}: {nodes} nodes, {} contact nodes, {} steps, {} products",
        answer.m(),
        solution.iter(),
        solution.n_a()
    );
}

/// Nothing is lost: contact and supports balance, up to a remainder in N.
pub fn balanced(answer: &Answer<3>, limit: f64) {
    let [load, contact, support] = answer.resultants();
    for c in 0..3 {
        let rest = load[c] + contact[c] + support[c];
        assert!(rest.abs() < limit, "{contact:?} {support:?}");
    }
}

/// The radius and the peak of p = p₀ √(1 − r²/a²): p² over r² is a line, fitted with the areas of the nodes as weights.
pub fn hertz_fit(answer: &Answer<3>) -> (f64, f64) {
    let top = (0..answer.m())
        .map(|i| answer.pressure(i))
        .fold(0.0, f64::max);
    let loaded = (0..answer.m()).filter(|&i| answer.pressure(i) > 0.2 * top);
    ellipsoid_fit(loaded.map(|i| {
        let place = answer.place(i);
        let r2 = place[0].powi(2) + place[1].powi(2);
        (answer.area(i), r2, answer.pressure(i))
    }))
}

/// The radius a and the peak of p₀ √(1 − r²/a²), from weights, r² and values at some places.
pub fn ellipsoid_fit(values: impl Iterator<Item = (f64, f64, f64)>) -> (f64, f64) {
    let [mut n, mut x, mut y, mut xx, mut xy] = [0.0; 5];
    for (w, r2, value) in values {
        let square = value * value;
        n += w;
        x += w * r2;
        y += w * square;
        xx += w * r2 * r2;
        xy += w * r2 * square;
    }
    let slope = (xy - x * y / n) / (xx - x * x / n);
    let peak = (y - slope * x) / n;
    ((-peak / slope).sqrt(), peak.sqrt())
}
