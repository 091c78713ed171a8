//! Random problems of any units, some with a known answer: each follows from its seed alone.

use super::common::Random;
use super::common::cases::{
    Laws, Range, Trial, Written, chance, decade, elastic, generator, half_plane, list, one_body,
    pick, stack,
};
use super::common::checker::{Entries, eliminate, largest, length};
use super::oracle::{MET, ROUNDING, Sum, along};
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::Load;
use signorini::sparse::{BlockCsr, Csr};
use std::collections::BTreeMap;

/// A problem of a family, with what is known of its answer.
pub(super) struct Problem<const D: usize = 2> {
    pub(super) family: &'static str,
    pub(super) trial: Trial<D>,
    pub(super) known: Option<Known>,
    /// Whether statics says that forces can balance the loads.
    pub(super) held: Option<bool>,
}

/// An answer that was there before the problem.
pub(super) struct Known {
    pub(super) lambda: Vec<f64>,
    /// What rounding of f and d does to pressures and tractions at most; None where that was too much to find out.
    pub(super) blur: Option<f64>,
    /// What violations as small as promised do to them, as A is conditioned.
    pub(super) loose: f64,
}

/// The problem of a seed, or why it could not be built.
pub(super) fn problem(seed: u64) -> Result<Problem, String> {
    let mut random = generator(seed ^ 0x00ca_4d41_6000_0000);
    let random = &mut random;
    let plain = |family, trial| Problem {
        family,
        trial,
        known: None,
        held: None,
    };
    Ok(match random.below(20) {
        0..=5 => known(random),
        6..=9 => plain("matrices", matrices(random)),
        10..=14 => plain("block", elastic(block(random))?),
        15..=17 => plain("stack", elastic(pile(random))?),
        _ => {
            let (written, held) = edge(random);
            Problem {
                held,
                ..plain("edge", elastic(written)?)
            }
        }
    })
}

/// Any units; mostly small.
pub(super) fn range(random: &mut Random) -> Range {
    Range {
        young: [-6.0, 12.0],
        length: [-6.0, 3.0],
        nodes: match random.below(20) {
            0..=9 => 20,
            10..=15 => 80,
            16..=18 => 250,
            _ => 900,
        },
        laws: pick(random, &[Laws::Any, Laws::Any, Laws::Given, Laws::Coulomb]),
    }
}

pub(super) fn block(random: &mut Random) -> Written {
    let range = range(random);
    one_body(random, range)
}

pub(super) fn pile(random: &mut Random) -> Written {
    let mut range = range(random);
    range.nodes = range.nodes.min(400);
    stack(random, range)
}

/// A block on a floor that is pushed by nearly what it bears before it slides or tips. All tractions are uniform, so
/// that statics tells.
pub(super) fn edge(random: &mut Random) -> (Written, Option<bool>) {
    let young = decade(random, -4.0, 12.0);
    let scale = decade(random, -5.0, 3.0);
    let (w, h) = (
        scale * random.between(0.5, 3.0),
        scale * random.between(0.3, 2.0),
    );
    let (nx, ny) = (1 + random.below(10), 1 + random.below(6));
    let p = young * decade(random, -6.0, -2.0);
    let part = match random.below(9) {
        0 => 0.0,
        k => 10f64.powi(-(k as i32)),
    };
    let factor = 1.0 + if chance(random, 0.5) { part } else { -part };
    // The push acts in the middle of the height: it tips where more than w/h of the load.
    let tips = chance(random, 0.3);
    let most = w / h;
    let (law, push, what) = if tips {
        let mu = most * random.between(1.1, 2.0);
        (
            format!("{{ coulomb = {mu:e} }}"),
            most * p,
            "tips, coulomb".to_owned(),
        )
    } else if chance(random, 0.5) {
        let mu = most * random.between(0.05, 0.9);
        (
            format!("{{ coulomb = {mu:e} }}"),
            mu * p,
            format!("slides, coulomb {mu:.2}"),
        )
    } else {
        let bound = p * most * random.between(0.05, 0.9);
        (
            format!("{{ tresca = {bound:e} }}"),
            bound,
            "slides, tresca".to_owned(),
        )
    };
    let push = factor * push * pick(random, &[-1.0, 1.0]);
    // As a body force: its sum is push·w, its arm h/2.
    let text = format!(
        "[mesh.rectangle]\norigin = [{:e}, 0]\nsize = [{w:e}, {h:e}]\ncells = [{nx}, {ny}]\n\
         [[material]]\nyoung = {young:e}\npoisson = 0.3\n\
         [[traction]]\nboundary = \"top\"\npressure = {p:e}\n\
         [[body_force]]\nx = {:e}\n{}",
        -0.5 * w,
        push / h,
        half_plane("bottom", [0.0; 2], [0.0, 1.0], &law)
    );
    (
        Written {
            name: format!("edge: block {nx}x{ny}, {what}, pushed {factor:.9}"),
            text,
        },
        (part > 0.0).then_some(factor < 1.0),
    )
}

/// A matrix K, with what a change of variables has done to it.
pub(super) struct Matrix {
    pub(super) name: String,
    pub(super) n: usize,
    pub(super) entries: Entries,
    /// Scales of the unknowns: K = D K₀ D.
    pub(super) scales: Vec<f64>,
    /// A typical diagonal entry of K₀.
    pub(super) stiffness: f64,
}

/// Between the largest and the smallest eigenvalue of K₀ and between the squares of the largest and the smallest
/// scale there are 11 decades together at most, so that K can be factorised in f64.
pub(super) fn matrix(random: &mut Random) -> Matrix {
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
    // A neighbour that is not far, so that factors stay sparse.
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

pub(super) type Row = Vec<(usize, f64)>;

/// N and T.
pub(super) struct Rows {
    pub(super) name: String,
    pub(super) normal: Vec<Row>,
    pub(super) tangential: Vec<Row>,
    /// What turns multipliers into pressures that can be compared.
    pub(super) areas: Vec<f64>,
}

/// N and T with full row rank: each row has a pivot of its own, which is dominant; or pairs of pivots are turned.
pub(super) fn contact_rows(random: &mut Random, matrix: &Matrix, m: usize) -> Rows {
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
        // A node has units of its own, which its area makes good.
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

pub(super) fn row_times(row: &Row, u: &[f64]) -> f64 {
    along(row, u)
}

pub(super) fn triplets(rows: &[Row]) -> Entries {
    let each = rows.iter().enumerate();
    each.flat_map(|(i, row)| row.iter().map(move |&(j, v)| (i, j, v)))
        .collect()
}

/// The laws of nodes.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Mixture {
    Frictionless,
    Tresca,
    Coulomb,
    All,
}

impl Mixture {
    pub(super) fn any(random: &mut Random) -> Self {
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
    pub(super) fn law(self, random: &mut Random) -> char {
        match self {
            Self::Frictionless => 'n',
            Self::Tresca => pick(random, &['t', 't', 't', 't', 't', 't', 't', 'n']),
            Self::Coulomb => 'c',
            Self::All => pick(random, &['n', 't', 'c', 'c']),
        }
    }

    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Frictionless => "frictionless",
            Self::Tresca => "tresca",
            Self::Coulomb => "coulomb",
            Self::All => "laws mixed",
        }
    }
}

/// How many contact nodes; seldom none, often as many as fit.
pub(super) fn nodes_for(random: &mut Random, n: usize) -> usize {
    let most = (n / 2).min(300);
    match random.below(12) {
        0 => most,
        1 => 1.min(most),
        2 if n < 20 => 0,
        _ => (1 + random.below(most.max(1))).min(most.max(usize::from(n == 1))),
    }
}

/// A problem whose solution is chosen first.
pub(super) fn known(random: &mut Random) -> Problem {
    let matrix = matrix(random);
    let n = matrix.n;
    let m = nodes_for(random, n);
    let Rows {
        name: rows_name,
        mut normal,
        mut tangential,
        areas,
    } = contact_rows(random, &matrix, m);
    let mixture = Mixture::any(random);
    let degenerate = pick(random, &[0.0, 0.1, 0.5]);
    let size = decade(random, -6.0, 3.0);
    let mut u: Vec<f64> = (0..n)
        .map(|i| size * random.between(-1.0, 1.0) / matrix.scales[i])
        .collect();
    // What each node does.
    let laws: Vec<char> = (0..m)
        .map(|i| match tangential[i].is_empty() {
            true => 'n',
            false => mixture.law(random),
        })
        .collect();
    let closed: Vec<bool> = (0..m).map(|_| chance(random, 0.6)).collect();
    let sticks: Vec<bool> = (0..m).map(|_| chance(random, 0.5)).collect();
    let no_gap: Vec<bool> = (0..m).map(|_| chance(random, 0.3 * degenerate)).collect();
    // Sticking, and no gap at all: sweeps over the pivots, which are dominant.
    for _ in 0..60 {
        for i in 0..m {
            for (row, wanted) in [
                (&normal[i], no_gap[i]),
                (&tangential[i], sticks[i] && laws[i] != 'n'),
            ] {
                if wanted {
                    // The entry that moves the row most.
                    let (j, v) = (row.iter().copied())
                        .max_by(|a, b| {
                            let weight = |e: &(usize, f64)| (e.1 / matrix.scales[e.0]).abs();
                            weight(a).total_cmp(&weight(b))
                        })
                        .expect("a row has entries");
                    u[j] -= row_times(row, &u) / v;
                }
            }
        }
    }
    let diagonal = {
        let mut diagonal = vec![0.0; n];
        for &(i, j, v) in &matrix.entries {
            if i == j {
                diagonal[i] += v;
            }
        }
        diagonal
    };
    let own = |row: &Row| row.iter().map(|&(j, v)| v * v / diagonal[j]).sum::<f64>();
    let level = decade(random, -2.0, 2.0);
    // Forces that are alike, or such that each moves its node alike.
    let alike = chance(random, 0.5);
    let typical = {
        let mut all: Vec<f64> = normal
            .iter()
            .map(|row| {
                let reach = row
                    .iter()
                    .map(|&(j, v)| (v / matrix.scales[j]).abs())
                    .fold(0.0, f64::max);
                reach * size / own(row)
            })
            .collect();
        all.sort_by(f64::total_cmp);
        all.get(m / 2).copied().unwrap_or(1.0)
    };
    let mut lambda = vec![0.0; 2 * m];
    let (mut gap, mut bound, mut mu) = (vec![0.0; m], vec![0.0; m], vec![0.0; m]);
    for i in 0..m {
        if row_times(&normal[i], &u) < 0.0 {
            normal[i].iter_mut().for_each(|e| e.1 = -e.1);
        }
        let reach = (normal[i].iter())
            .map(|&(j, v)| (v / matrix.scales[j]).abs())
            .fold(0.0, f64::max)
            * size;
        let force = level
            * if alike {
                typical
            } else {
                reach / own(&normal[i])
            };
        let weak = chance(random, degenerate);
        gap[i] = row_times(&normal[i], &u).max(0.0);
        if closed[i] {
            lambda[i] = if weak {
                0.0
            } else {
                force * random.between(0.2, 2.0)
            };
        } else if !no_gap[i] || chance(random, 0.5) {
            gap[i] += reach * random.between(0.05, 1.0);
        }
        match laws[i] {
            't' => bound[i] = force * random.between(0.2, 2.0),
            'c' => {
                mu[i] = random.between(0.05, 1.0);
                bound[i] = mu[i] * lambda[i];
            }
            _ => {}
        }
        let slip = row_times(&tangential[i], &u);
        // Rows that are not dominant may have been left with some slip.
        let terms: f64 = tangential[i].iter().map(|&(j, v)| (v * u[j]).abs()).sum();
        lambda[m + i] = if laws[i] == 'n' {
            0.0
        } else if sticks[i] && slip.abs() <= ROUNDING * terms {
            // At the very bound, or inside.
            bound[i]
                * if chance(random, degenerate) {
                    1.0
                } else {
                    random.between(-0.9, 0.9)
                }
        } else {
            if slip < 0.0 && chance(random, 0.5) {
                tangential[i].iter_mut().for_each(|e| e.1 = -e.1);
                bound[i]
            } else {
                bound[i].copysign(slip)
            }
        };
        if laws[i] == 'c' {
            bound[i] = 0.0;
        }
        if laws[i] == 'n' && chance(random, 0.1) {
            tangential[i].clear();
        }
    }
    let stiffness = BlockCsr::<2>::from_triplets(n, n, matrix.entries.iter().copied());
    let k: Entries = stiffness
        .triplets()
        .filter(|e| e.0 < n && e.1 < n)
        .collect();
    let mut sums = vec![Sum::default(); n];
    for &(i, j, v) in &k {
        sums[i].add_product(v, u[j]);
    }
    for (rows, l) in [(&normal, &lambda[..m]), (&tangential, &lambda[m..])] {
        for (row, l) in rows.iter().zip(l) {
            for &(j, v) in row {
                sums[j].add_product(v, *l);
            }
        }
    }
    let load: Vec<f64> = sums.into_iter().map(Sum::value).collect();
    let coulomb = mu.iter().any(|&mu| mu > 0.0);
    let name = format!(
        "known ({}), m = {m}, {rows_name}, {}, degenerate {degenerate}, forces {level:.1e}",
        matrix.name,
        mixture.name()
    );
    let text = format!(
        "d = {gap:?}\ng = {bound:?}\nmu = {mu:?}\nlambda = {lambda:?}\nu = {u:?}\nf = {load:?}\n\
         N = {normal:?}\nT = {tangential:?}\nK = {k:?}\n"
    );
    let made = ContactProblem::new(ContactData {
        stiffness,
        load,
        normal: Csr::from_triplets(m, n, triplets(&normal)),
        tangential: Csr::from_triplets(m, n, triplets(&tangential)),
        gap,
        slip_bound: bound.clone(),
        coordinates: None,
    })
    .and_then(|problem| problem.with_friction_coefficient(mu)?.with_areas(areas))
    .unwrap_or_else(|error| panic!("{name}: {error}\n{text}"));
    let known = (!coulomb).then(|| {
        let (blur, loose) = sensitivity(&made, &u, &lambda);
        Known {
            lambda,
            blur,
            loose,
        }
    });
    Problem {
        family: "known",
        trial: Trial {
            name,
            text,
            loads: vec![Load::of(&made)],
            problem: made,
        },
        known,
        held: None,
    }
}

/// What rounding of f and d does to the pressures and tractions that are not on a bound, and what violations of 10 ε do;
/// None and infinity for large problems.
pub(super) fn sensitivity(
    problem: &ContactProblem,
    u: &[f64],
    lambda: &[f64],
) -> (Option<f64>, f64) {
    let (n, m) = (problem.stiffness().n_rows(), problem.m());
    if n > 200 || m == 0 {
        return (if m == 0 { Some(0.0) } else { None }, f64::INFINITY);
    }
    let mut scale = vec![0.0; n];
    for (i, j, v) in problem.stiffness().triplets() {
        if i == j {
            scale[i] = 1.0 / v.sqrt();
        }
    }
    let mut k = vec![vec![0.0; 2 * n]; n];
    for (i, j, v) in problem.stiffness().triplets() {
        k[i][j] += v * scale[i] * scale[j];
    }
    for (i, row) in k.iter_mut().enumerate() {
        row[n + i] = 1.0;
    }
    if !eliminate(&mut k, n) {
        return (None, f64::INFINITY);
    }
    let g = problem.slip_bound();
    let moves = |i: usize| match i.checked_sub(m) {
        None => lambda[i] > 0.0,
        Some(t) => lambda[i].abs() < g[t],
    };
    let mut rows: BTreeMap<usize, Row> = BTreeMap::new();
    for (i, j, v) in problem.contact_matrix().triplets() {
        if moves(i) {
            rows.entry(i).or_default().push((j, v));
        }
    }
    let areas: Vec<f64> = rows.keys().map(|i| problem.areas()[i % m]).collect();
    let rows: Vec<Row> = rows.into_values().collect();
    let count = rows.len();
    // B K⁻¹ and A on these.
    let images: Vec<Vec<f64>> = (rows.iter())
        .map(|row| {
            let mut image = vec![0.0; n];
            for &(j, v) in row {
                for (l, image) in image.iter_mut().enumerate() {
                    *image += v * scale[j] * k[j][n + l] * scale[l];
                }
            }
            image
        })
        .collect();
    // In units of the own compliance, so that singularity can be told.
    let own: Vec<f64> = (rows.iter().zip(&images))
        .map(|(row, image)| along(row, image).sqrt())
        .collect();
    let mut a: Vec<Vec<f64>> = (0..count)
        .map(|i| {
            let mut line: Vec<f64> = (0..count)
                .map(|j| along(&rows[j], &images[i]) / own[i] / own[j])
                .collect();
            line.extend((0..count).map(|j| f64::from(u8::from(i == j))));
            line
        })
        .collect();
    if !eliminate(&mut a, count) {
        return (None, f64::INFINITY);
    }
    let size = largest(u);
    let reach = size + largest(problem.gap());
    let (mut blur, mut loose) = (0.0_f64, 0.0_f64);
    for i in 0..count {
        let (mut rounded, mut free) = (0.0, 0.0);
        for j in 0..count {
            let factor = a[i][count + j].abs() / own[i] / own[j];
            let moved: f64 = (images[j].iter().zip(problem.load()))
                .map(|(h, f)| (h * f).abs())
                .sum();
            rounded += factor * (f64::EPSILON * moved + ROUNDING * reach);
            let shaken = MET * length(problem.load()) * length(&images[j]);
            free += factor * (MET * size + shaken);
        }
        blur = blur.max(rounded / areas[i]);
        loose = loose.max(free / areas[i]);
    }
    (Some(blur), loose)
}

/// Matrices under random loads.
pub(super) fn matrices(random: &mut Random) -> Trial {
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
