//! All sets of a small problem, tried one after another.

use super::sums::product;
use super::{Deviation, Entries, Oracle, largest};
use signorini::quasistatic::{Load, State};

/// The most sets for an exhaustive search, and the most unknowns.
pub const ALL_SETS: usize = 5_000;
pub const FEW_UNKNOWNS: usize = 300;
/// Springs that make K regular, relative to it; they start from the displacement before, so that they carry little
/// after this many passes where the bodies are balanced.
pub const SPRINGS: f64 = 1e-7;
pub const TURNS: usize = 20;
/// Their violation of the conditions, in parts of the allowed deviation.
pub const BLURRED: f64 = 10.0;

/// The state of a contact node.
#[derive(Clone, Copy)]
pub struct Choice {
    pub closed: bool,
    /// λτ = slip · g; None where it sticks.
    pub slip: Option<f64>,
}

/// Whether a step of a small problem has a solution, found by trying all sets one after another; None if there are too
/// many, or no scale of forces. A solution has to pass the check. In the plane.
pub fn has_solution(oracle: &Oracle, load: &Load, start: &State) -> Option<bool> {
    assert_eq!(oracle.tangents, 1, "in the plane");
    let (n, m) = (oracle.n, oracle.m);
    let mut slides = vec![false; m];
    for &(i, _, v) in &oracle.tangential {
        slides[i] |= v != 0.0;
    }
    let choices: Vec<Vec<Choice>> = (0..m)
        .map(|i| {
            let of = |closed, slips: &[Option<f64>]| {
                let choice = |&slip| Choice { closed, slip };
                slips.iter().map(choice).collect::<Vec<_>>()
            };
            let all = [None, Some(1.0), Some(-1.0)];
            let coulomb = oracle.mu[i] > 0.0;
            if !slides[i] || (!coulomb && oracle.given[i] == 0.0) {
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
    let stiffness = (oracle.k.iter()).fold(0.0, |k: f64, e| k.max(e.2.abs()));
    let mut matrix = vec![vec![0.0; 2 * n]; n];
    for &(i, j, v) in &oracle.k {
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
    let rows = (oracle.normal.iter().copied())
        .chain(oracle.tangential.iter().map(|&(i, j, v)| (m + i, j, v)));
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
    // The effect of the load without contact, with the springs on `hooks`.
    let alone = |hooks: &[f64]| -> Vec<f64> {
        let force = load.force.iter().zip(hooks);
        let force: Vec<f64> = force.map(|(f, h)| f / stiffness + SPRINGS * h).collect();
        (inverse.iter())
            .map(|row| row.iter().zip(&force).map(|(h, f)| h * f).sum())
            .collect()
    };
    let first = alone(&start.u);
    let (before, _) = product(&oracle.tangential, m, &start.u);
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
            let (free, _) = product(&rows, 2 * m, &alone_now);
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
                        if oracle.mu[i] > 0.0 {
                            system[m + i][i] = -sign * oracle.mu[i];
                        } else {
                            system[m + i][2 * m] = sign * oracle.given[i] / stiffness;
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
            let (deviations, _) = oracle.judge(load, start, &u, &lambda, false);
            let solved = |d: &Deviation| d.times <= if d.local { 1.0 } else { BLURRED };
            if !pulls && deviations.iter().all(solved) {
                return Some(true);
            }
            // If the springs are left without forces, these sets are wrong; forces that do not decrease carry a load
            // that nothing else carries.
            let equilibrium = deviations.iter().filter(|d| d.name == "equilibrium");
            let left = equilibrium.fold(0.0, |left: f64, d| left.max(d.times));
            if left < 1.0 || (turn > 1 && left > 0.8 * springs) {
                break;
            }
            springs = left;
            alone_now = alone(&u);
        }
    }
    Some(false)
}

/// Gauss–Jordan on the first n columns: leaves the solutions in the others. False if it is singular.
pub fn eliminate(matrix: &mut [Vec<f64>], n: usize) -> bool {
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
