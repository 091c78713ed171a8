//! Least squares with bounds, and without.

use super::length;
use super::sums::{Sum, dot};

/// The shortest rest b − A x with 0 ≤ x ≤ limits; and the same without its rounding along the columns whose factors are
/// inside.
pub fn bounded_least_squares(columns: &[(Vec<f64>, f64)], b: &[f64]) -> (Vec<f64>, Vec<f64>) {
    #[derive(Clone, Copy, PartialEq)]
    enum Place {
        Low,
        Free,
        High,
    }
    let mut place = vec![Place::Low; columns.len()];
    let mut x = vec![0.0; columns.len()];
    let rest_of = |x: &[f64], skip: &dyn Fn(usize) -> bool| -> Vec<f64> {
        let mut sums: Vec<Sum> = vec![Sum::default(); b.len()];
        for (sum, b) in sums.iter_mut().zip(b) {
            sum.add(*b);
        }
        for (j, (column, _)) in columns.iter().enumerate() {
            if x[j] != 0.0 && !skip(j) {
                for (sum, c) in sums.iter_mut().zip(column) {
                    sum.add_product(-c, x[j]);
                }
            }
        }
        sums.into_iter().map(Sum::value).collect()
    };
    let mut refused = vec![false; columns.len()];
    for _ in 0..10 * columns.len() + 100 {
        let rest = rest_of(&x, &|_| false);
        let far = 1e-13 * length(&rest).max(1e-3);
        let gain = |j: usize| {
            let along = dot(&columns[j].0, &rest);
            match place[j] {
                Place::Low => along,
                Place::High => -along,
                Place::Free => 0.0,
            }
        };
        let best = (0..columns.len())
            .filter(|&j| !refused[j] && gain(j) > far)
            .max_by(|&i, &j| gain(i).total_cmp(&gain(j)));
        let Some(best) = best else { break };
        let was = place[best];
        place[best] = Place::Free;
        let mut first = true;
        loop {
            let free: Vec<usize> = (0..columns.len())
                .filter(|&j| place[j] == Place::Free)
                .collect();
            let target = rest_of(&x, &|j| place[j] == Place::Free);
            let chosen: Vec<&[f64]> = free.iter().map(|&j| &columns[j].0[..]).collect();
            let Some(z) = least_squares(&chosen, &target) else {
                // The last column depends on the others: rounding made it look like a gain.
                place[best] = was;
                refused[best] = true;
                break;
            };
            if std::mem::take(&mut first) {
                let own = z[free.iter().position(|&j| j == best).expect("it is free")];
                let wrong = match was {
                    Place::Low => own <= 0.0,
                    _ => own >= columns[best].1,
                };
                if wrong {
                    place[best] = was;
                    refused[best] = true;
                    break;
                }
            }
            // As far as all stay within their limits.
            let mut step = 1.0_f64;
            for (&j, &z) in free.iter().zip(&z) {
                let limit = columns[j].1;
                if z < 0.0 {
                    step = step.min(x[j] / (x[j] - z));
                } else if z > limit {
                    step = step.min((limit - x[j]) / (z - x[j]));
                }
            }
            for (&j, &z) in free.iter().zip(&z) {
                let limit = columns[j].1;
                let end = if z < 0.0 { 0.0 } else { limit };
                let inside = z >= 0.0 && z <= limit;
                let part = if inside {
                    1.0
                } else {
                    (end - x[j]) / (z - x[j])
                };
                if !inside && part <= step {
                    x[j] = end;
                    place[j] = if z < 0.0 { Place::Low } else { Place::High };
                } else {
                    x[j] += step * (z - x[j]);
                }
            }
            if step >= 1.0 {
                refused.iter_mut().for_each(|r| *r = false);
                break;
            }
        }
    }
    let rest = rest_of(&x, &|_| false);
    let free: Vec<&[f64]> = (0..columns.len())
        .filter(|&j| place[j] == Place::Free)
        .map(|j| &columns[j].0[..])
        .collect();
    let mut pure = rest.clone();
    for _ in 0..2 {
        let Some(factors) = least_squares(&free, &pure) else {
            break;
        };
        for (column, factor) in free.iter().zip(factors) {
            pure.iter_mut()
                .zip(*column)
                .for_each(|(p, c)| *p -= factor * c);
        }
    }
    (rest, pure)
}

/// The factors of few columns that make the rest of b shortest (Gram–Schmidt, twice); None if they are dependent.
pub fn least_squares(columns: &[&[f64]], b: &[f64]) -> Option<Vec<f64>> {
    let count = columns.len();
    if count > b.len() {
        return None;
    }
    let mut q: Vec<Vec<f64>> = Vec::new();
    let mut r = vec![vec![0.0; count]; count];
    for (j, column) in columns.iter().enumerate() {
        let mut v = column.to_vec();
        for _ in 0..2 {
            for (i, q) in q.iter().enumerate() {
                let part = dot(q, &v);
                r[i][j] += part;
                v.iter_mut().zip(q).for_each(|(v, q)| *v -= part * q);
            }
        }
        let norm = length(&v);
        if norm < 1e-11 {
            return None;
        }
        r[j][j] = norm;
        v.iter_mut().for_each(|v| *v /= norm);
        q.push(v);
    }
    let mut rest = b.to_vec();
    let mut y = vec![0.0; count];
    for _ in 0..2 {
        for (y, q) in y.iter_mut().zip(&q) {
            let part = dot(q, &rest);
            *y += part;
            rest.iter_mut().zip(q).for_each(|(v, q)| *v -= part * q);
        }
    }
    for i in (0..count).rev() {
        for j in i + 1..count {
            y[i] -= r[i][j] * y[j];
        }
        y[i] /= r[i][i];
    }
    Some(y)
}
