//! Problems whose solution was chosen first.

use super::Problem;
use super::matrices::{Mixture, Row, Rows, contact_rows, matrix, nodes_for, row_times, triplets};
use crate::common::Random;
use crate::common::cases::Trial;
use crate::common::draw::{chance, decade, pick};
use crate::common::oracle::all_sets::eliminate;
use crate::common::oracle::sums::{Sum, along};
use crate::common::oracle::{Entries, MET, ROUNDING, largest, length};
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::Load;
use signorini::sparse::{BlockCsr, Csr};
use std::collections::BTreeMap;

/// An answer that was there before the problem.
pub struct Known {
    pub lambda: Vec<f64>,
    /// The largest effect of rounding of f and d on pressures and tractions; None if that was too expensive to compute.
    pub blur: Option<f64>,
    /// The effect of permitted violations on them, under the condition of A.
    pub loose: f64,
}

/// A problem whose solution is chosen first.
pub fn known(random: &mut Random) -> Problem {
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
    // The state of each node.
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
    // Equal forces, or forces that move their nodes equally.
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

/// The effect of rounding of f and d on the pressures and tractions that are not on a bound, and that of violations of
/// 10 ε; None and infinity for large problems.
pub fn sensitivity(problem: &ContactProblem, u: &[f64], lambda: &[f64]) -> (Option<f64>, f64) {
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
    // In units of the own compliance, so that singularity can be detected.
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
