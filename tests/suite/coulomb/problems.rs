//! The problem of a seed.

use crate::common::Random;
use crate::common::cases::{Range, Trial, coefficient, elastic, one_body, stack};
use crate::common::draw::{chance, decade, generator, pick};
use crate::common::or_panic::OrPanic as _;
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::Load;
use signorini::sparse::{BlockCsr, Csr};

/// The problem of a seed, or why it could not be built.
pub fn trial(seed: u64) -> Result<Trial, String> {
    let mut random = generator(seed);
    match random.below(10) {
        0..=4 => elastic(one_body(&mut random, Range::coulomb(600))),
        5..=6 => elastic(stack(&mut random, Range::coulomb(280))),
        _ => Ok(algebraic(&mut random)),
    }
}

/// Matrices without a mesh.
pub fn algebraic(random: &mut Random) -> Trial {
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
    // Each contact node has its own two unknowns, which a rotation takes to normal and tangent; general rows also
    // contain a little of other unknowns.
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
    .and_then(|problem| problem.with_friction_coefficient(mu.clone()))
    .or_panic();
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
