//! Matrices without a mesh, their contact rows and their loads.

use crate::common::Random;
use crate::common::cases::{Trial, list};
use crate::common::draw::{chance, decade, pick};
use crate::common::oracle::Entries;
use crate::common::oracle::sums::along;
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::Load;
use signorini::sparse::{BlockCsr, Csr};

/// A matrix K, with the change of variables applied to it.
pub struct Matrix {
    pub name: String,
    pub n: usize,
    pub entries: Entries,
    /// Scales of the unknowns: K = D K₀ D.
    pub scales: Vec<f64>,
    /// A typical diagonal entry of K₀.
    pub stiffness: f64,
}

/// Between the largest and the smallest eigenvalue of K₀ and between the squares of the largest and the smallest
/// scale there are 11 decades together at most, so that K can be factorised in f64.
pub fn matrix(random: &mut Random) -> Matrix {
    let n = match random.below(40) {
        0..=13 => 1 + random.below(12),
        14..=29 => 4 + random.below(60),
        30..=36 => 20 + random.below(300),
        37..=38 => 100 + random.below(900),
        _ => 1000 + random.below(1001),
    };
    let stiffness = decade(random, -6.0, 12.0);
    let decades = pick(random, &[0.0, 0.0, 1.0, 2.0, 4.0, 6.0, 8.0, 11.0]);
    let contrast = decades * pick(random, &[0.0, 0.5, 1.0]);
    let spread = (decades - contrast) / 4.0;
    let scales: Vec<f64> = (0..n).map(|_| decade(random, -spread, spread)).collect();
    let kind = pick(random, &["springs", "springs", "AtA", "bars"]);
    let mut entries = Vec::new();
    // A near neighbour, so that factors stay sparse.
    let near = |random: &mut Random, i: usize, n: usize| {
        let j = (i + 1 + random.below(6)).min(n - 1);
        if n <= 60 && chance(random, 0.3) {
            random.below(n)
        } else {
            j
        }
    };
    let ground = 10f64.powf(-contrast);
    let mut add = |row: &[(usize, f64)], k: f64| {
        for &(i, a) in row {
            for &(j, b) in row {
                let scale = scales[i] * scales[j];
                entries.push((i, j, stiffness * k * (a * b) * scale));
            }
        }
    };
    for i in 0..n {
        let held = chance(random, 0.1);
        add(&[(i, 1.0)], if held { 1.0 } else { ground.min(0.1) });
        for _ in 0..2 {
            let j = near(random, i, n);
            let k = decade(random, -contrast, 0.0);
            match kind {
                "AtA" => {
                    let l = near(random, j, n);
                    let row: Vec<(usize, f64)> = [i, j, l]
                        .into_iter()
                        .map(|i| (i, random.between(-1.0, 1.0)))
                        .collect();
                    add(&row, k);
                }
                "bars" => {
                    let (a, b) = (i / 2, j / 2);
                    if a != b && 2 * a.max(b) + 1 < n {
                        let (s, c) = random.between(0.0, 6.3).sin_cos();
                        let row = [(2 * a, c), (2 * a + 1, s), (2 * b, -c), (2 * b + 1, -s)];
                        add(&row, k);
                    }
                }
                _ if i != j => add(&[(i, 1.0), (j, -1.0)], k),
                _ => {}
            }
        }
    }
    Matrix {
        name: format!(
            "{kind}, n = {n}, decades {contrast:.1} + {:.1}",
            4.0 * spread
        ),
        n,
        entries,
        scales,
        stiffness,
    }
}

pub type Row = Vec<(usize, f64)>;

/// N and T.
pub struct Rows {
    pub name: String,
    pub normal: Vec<Row>,
    pub tangential: Vec<Row>,
    /// The areas that turn multipliers into comparable pressures.
    pub areas: Vec<f64>,
}

/// N and T with full row rank: each row has its own dominant pivot, or pairs of pivots are rotated.
pub fn contact_rows(random: &mut Random, matrix: &Matrix, m: usize) -> Rows {
    let n = matrix.n;
    let mut order: Vec<usize> = (0..n).collect();
    for i in 0..n {
        order.swap(i, i + random.below(n - i));
    }
    let kind = pick(random, &["unit", "turned", "several"]);
    let units = chance(random, 0.2);
    let scaled = chance(random, 0.5);
    let (mut normal, mut tangential, mut areas) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..m {
        let alone = 2 * m > n;
        let (x, y) = (order[i], if alone { 0 } else { order[m + i] });
        let mut rows: [Row; 2] = match kind {
            "turned" if !alone => {
                let (s, c) = random.between(0.0, 6.3).sin_cos();
                [vec![(x, c), (y, s)], vec![(x, -s), (y, c)]]
            }
            _ => [vec![(x, 1.0)], vec![(y, 1.0)]],
        };
        if kind == "several" {
            for row in &mut rows {
                for _ in 0..3 {
                    let j = random.below(n);
                    if row.iter().all(|&(i, _)| i != j) {
                        row.push((j, random.between(-0.25, 0.25)));
                    }
                }
            }
        }
        if alone {
            rows[1].clear();
        }
        // A node has its own units, which its area compensates.
        let unit = if units {
            decade(random, -2.0, 2.0)
        } else {
            1.0
        };
        areas.push(1.0 / unit);
        for (j, v) in rows.iter_mut().flatten() {
            *v *= unit * if scaled { matrix.scales[*j] } else { 1.0 };
        }
        let [n, t] = rows;
        normal.push(n);
        tangential.push(t);
    }
    let name = format!(
        "{kind} rows{}{}",
        if units { ", units" } else { "" },
        if scaled { ", scaled" } else { "" }
    );
    Rows {
        name,
        normal,
        tangential,
        areas,
    }
}

pub fn row_times(row: &Row, u: &[f64]) -> f64 {
    along(row, u)
}

pub fn triplets(rows: &[Row]) -> Entries {
    let each = rows.iter().enumerate();
    each.flat_map(|(i, row)| row.iter().map(move |&(j, v)| (i, j, v)))
        .collect()
}

/// The laws of nodes.
#[derive(Clone, Copy, PartialEq)]
pub enum Mixture {
    Frictionless,
    Tresca,
    Coulomb,
    All,
}

impl Mixture {
    pub fn any(random: &mut Random) -> Self {
        pick(
            random,
            &[
                Self::Frictionless,
                Self::Tresca,
                Self::Tresca,
                Self::Coulomb,
                Self::All,
            ],
        )
    }

    /// For a node: 'n'one, 't'resca or 'c'oulomb.
    pub fn law(self, random: &mut Random) -> char {
        match self {
            Self::Frictionless => 'n',
            Self::Tresca => pick(random, &['t', 't', 't', 't', 't', 't', 't', 'n']),
            Self::Coulomb => 'c',
            Self::All => pick(random, &['n', 't', 'c', 'c']),
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Frictionless => "frictionless",
            Self::Tresca => "tresca",
            Self::Coulomb => "coulomb",
            Self::All => "laws mixed",
        }
    }
}

/// How many contact nodes; seldom none, often as many as fit.
pub fn nodes_for(random: &mut Random, n: usize) -> usize {
    let most = (n / 2).min(300);
    match random.below(12) {
        0 => most,
        1 => 1.min(most),
        2 if n < 20 => 0,
        _ => (1 + random.below(most.max(1))).min(most.max(usize::from(n == 1))),
    }
}

/// Matrices under random loads.
pub fn matrices(random: &mut Random) -> Trial {
    let matrix = matrix(random);
    let n = matrix.n;
    let m = nodes_for(random, n);
    let Rows {
        name: rows_name,
        normal,
        mut tangential,
        areas,
    } = contact_rows(random, &matrix, m);
    let mixture = Mixture::any(random);
    let size = decade(random, -6.0, 3.0);
    let force = matrix.stiffness * size;
    let mut load: Vec<f64> = (0..n)
        .map(|i| force * matrix.scales[i] * random.between(-0.3, 0.3))
        .collect();
    let (mut gap, mut bound, mut mu) = (vec![0.0; m], vec![0.0; m], vec![0.0; m]);
    for i in 0..m {
        // Most nodes are pressed on the obstacle.
        let press = force * random.between(-0.3, 1.0);
        for &(j, v) in &normal[i] {
            load[j] += press * matrix.scales[j] * v.signum();
        }
        let reach = (normal[i].iter())
            .map(|&(j, v)| (v / matrix.scales[j]).abs())
            .fold(0.0, f64::max);
        if chance(random, 0.5) {
            gap[i] = reach * size * random.between(0.0, 0.5);
        }
        // The force of a multiplier is that of its row.
        let row = (tangential[i].iter())
            .map(|&(j, v)| (v / matrix.scales[j]).abs())
            .fold(0.0, f64::max);
        match mixture.law(random) {
            _ if tangential[i].is_empty() => {}
            't' => bound[i] = force / row * random.between(0.0, 0.5),
            'c' => mu[i] = random.between(0.0, 1.5),
            _ if chance(random, 0.1) => tangential[i].clear(),
            _ => {}
        }
    }
    let name = format!(
        "matrices ({}), m = {m}, {rows_name}, {}",
        matrix.name,
        mixture.name()
    );
    let steps = pick(random, &[1, 1, 1, 2, 3, 4]);
    let factors: Vec<f64> = if steps == 1 {
        vec![1.0]
    } else {
        (0..steps)
            .map(|_| pick(random, &[0.3, 1.0, -0.5, 0.2, 0.7, 0.0]))
            .collect()
    };
    let text = format!(
        "factors {}\nd = {gap:?}\ng = {bound:?}\nmu = {mu:?}\nf = {load:?}\nN = {normal:?}\nT = {tangential:?}\nK = {:?}\n",
        list(&factors),
        matrix.entries
    );
    let problem = ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(n, n, matrix.entries.iter().copied()),
        load,
        normal: Csr::from_triplets(m, n, triplets(&normal)),
        tangential: Csr::from_triplets(m, n, triplets(&tangential)),
        gap,
        slip_bound: bound,
        coordinates: None,
    })
    .and_then(|problem| problem.with_friction_coefficient(mu)?.with_areas(areas))
    .unwrap_or_else(|error| panic!("{name}: {error}\n{text}"));
    let whole = Load::of(&problem);
    let loads = (factors.iter())
        .map(|factor| Load {
            force: whole.force.iter().map(|f| factor * f).collect(),
            acting: factor.abs() * whole.acting,
            ..whole.clone()
        })
        .collect();
    Trial {
        name: format!("{name}, {} steps", factors.len()),
        text,
        problem,
        loads,
    }
}
