//! What `converged` and `not_held` promise, tried on many thousand random problems.
//!
//! Every problem follows from its seed alone. Families:
//!
//! - **known**: matrices with a solution that was chosen first: u, λ and the sets, then f = K u + Bᵀλ, d and g. K is a
//!   network of springs or AᵀA with up to 10¹¹ between its largest and smallest eigenvalue, by contrasts of stiffness or
//!   by scales of the unknowns; nodes may just touch, stick at the very bound, have no gap or no friction at all;
//! - **matrices**: the same matrices under random loads, in one to four load steps;
//! - **block**, **stack**: elastic cases as a user writes them (`common/cases.rs`), in units that differ by many
//!   decades: clamped, moved, guided, pinned or held by contact alone, on floors, discs, in V's and between walls, stacked
//!   with meshes that do not match, with unloading and reversal;
//! - **edge**: a block that contact alone holds, pushed by a force that is larger or smaller by 10⁻¹ to 10⁻⁸ than
//!   what statics says that it bears before it slides or tips.
//!
//! # What an answer is judged by
//!
//! [`Oracle`] reads K, N, T, the load and the gap, and shares no code with the solver. Its sums are compensated, so that
//! what it finds is in the answer. It allows what `docs/case-file.md` promises and no more, ε = 10⁻⁶ being the
//! tolerance:
//!
//! - conditions (1)–(3) to 10 ε: forces relative to the larger of the acting and of the contact forces, lengths relative
//!   to the deformation (u less the mean rigid motion of each body) or to what a contact force does to its own node;
//! - the balance of each body that can move as a whole (each motion by itself) to 100 ε of the forces on *this* body;
//! - node by node: forces to 3000 ε of the largest pressure: a node that is pressed *and* apart, or that slips without
//!   its full friction, is wrong by the force that would close the gap if it were the only one, at least;
//! - where the answer is the only one (no Coulomb friction) and known, or found again at a tolerance of 10⁻¹⁰:
//!   multipliers to 3000 ε of the largest pressure. For the known answer, what rounding of f and, of matrices with
//!   contrasts of stiffness, what the condition of A makes of violations as small as promised come on top. Without a known
//!   answer that is not known, and such matrices are only told. So are they where the paths
//!   differ by more than twice that. As the solver estimates these errors, one comparison in a thousand may be off by
//!   more.
//!
//! Rounding allowed: 32 units in the last place of the terms of a difference, as the documentation says. Where bodies
//! have moved far, that may be more than the forces; such answers are counted as *blind*. Contact forces that close no
//! more than a hundred times the rounding of a gap are dust, and none.
//!
//! Bodies with supports are in balance where the forces on each of their free unknowns are: what holds the others is not
//! part of (1), so that reactions are not looked at here.
//!
//! `not_held` is right where [`least_imbalance`], a bounded least-squares problem solved by an active-set method,
//! finds that no forces within the friction law balance a body, and proves it by a motion that all of them together
//! resist less than the loads drive it. Without Coulomb friction a problem that can be balanced has a solution, so that
//! `not_held` is wrong there; with Coulomb friction all sets are tried where they are few (`common/checker.rs`).
//!
//! `cargo test --release --test campaign -- --ignored --nocapture` tries 10 000 problems on each path. Environment:
//!
//! - `CAMPAIGN_PROBLEMS`: how many problems instead;
//! - `CAMPAIGN_SEED`: the seed of the first one (1);
//! - `CAMPAIGN_PATHS`: `cholesky`, `pcg` or both with a comma between;
//! - `CAMPAIGN_ONLY`: the seed of a single problem, which is printed with the history of its solves.

mod common;

use common::Random;
use common::cases::{
    Laws, Range, Trial, Written, chance, decade, elastic, generator, half_plane, list, one_body,
    pick, stack,
};
use common::checker::{Checker, Entries, eliminate, has_solution, largest, length};
use common::runs::{Run, TIME_LIMIT, Way, name_of, print_step};
use signorini::problem::{ContactData, ContactProblem};
use signorini::quasistatic::{self, Load, Settings, State, StepSolution};
use signorini::sparse::{BlockCsr, Csr};
use signorini::ssnm::Status;
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

/// ε, the default of a case file.
const TOLERANCE: f64 = 1e-6;
/// That of a second solve, where the first is compared with it.
const TIGHT: f64 = 1e-10;
/// What conditions (1)–(3) may be off by.
const MET: f64 = 10.0 * TOLERANCE;
/// What is told of forces that are off by more, where the condition of A explains it or may explain it.
const CONDITIONED: &str = "forces of matrices off by more than 3000 ε, as A is conditioned";
/// Nodal forces are estimated from the gradient: no more than one comparison in so many may be off by more.
const RARE: usize = 1000;
/// What the resultants on a body may be off by.
const RESULTANT: f64 = 100.0 * TOLERANCE;
/// What a nodal force may be off by, relative to the largest …
const NODAL: f64 = 3000.0 * TOLERANCE;
/// … and what the gap or slip at a node says that it is off by.
const LOCAL: f64 = NODAL;
/// What is below this part of its terms is rounding.
const NOTHING: f64 = 1e-11;
/// Rounding of a sum relative to its terms.
const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// An imbalance below this part of the loads is none: what it says is rounding.
const BALANCED: f64 = 1e-12;
/// Above this one, no forces balance the loads.
const UNBALANCED: f64 = 1e-10;
/// Forces that close this many times what rounding leaves of a gap are none.
const DUST: f64 = 100.0;

// ---------------------------------------------------------------------------------------------------------
// Sums

/// A sum with its rounding error (Neumaier; products split exactly by a fused multiplication).
#[derive(Clone, Copy, Default)]
struct Sum {
    high: f64,
    low: f64,
}

impl Sum {
    fn add(&mut self, x: f64) {
        let sum = self.high + x;
        let back = sum - self.high;
        self.low += (self.high - (sum - back)) + (x - back);
        self.high = sum;
    }

    fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(product);
        self.low += a.mul_add(b, -product);
    }

    fn value(self) -> f64 {
        self.high + self.low
    }
}

/// A product with a matrix, and with the absolute values of everything.
fn product(entries: &Entries, rows: usize, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut sums, mut sizes) = (vec![Sum::default(); rows], vec![0.0; rows]);
    for &(i, j, v) in entries {
        sums[i].add_product(v, x[j]);
        sizes[i] += (v * x[j]).abs();
    }
    (sums.into_iter().map(Sum::value).collect(), sizes)
}

/// Σ over a sparse vector.
fn along(motion: &[(usize, f64)], x: &[f64]) -> f64 {
    let mut sum = Sum::default();
    for &(i, v) in motion {
        sum.add_product(v, x[i]);
    }
    sum.value()
}

// ---------------------------------------------------------------------------------------------------------
// The oracle

/// A body that K lets move as a whole.
struct Free {
    /// Orthonormal, as (unknown, entry).
    motions: Vec<Vec<(usize, f64)>>,
    /// Its unknowns.
    unknowns: Vec<usize>,
}

/// The conditions (1)–(3), from the matrices alone.
struct Oracle {
    /// K, N, T and what follows from them.
    of: Checker,
    free: Vec<Free>,
}

/// What an answer is off by in one respect, relative to what is allowed.
struct Deviation {
    name: &'static str,
    /// Contact node or body.
    place: usize,
    times: f64,
}

impl Oracle {
    fn new(problem: &ContactProblem) -> Self {
        let of = Checker::new(problem);
        Self {
            free: free_bodies(&of.k, of.n, &of.motions),
            of,
        }
    }

    fn has_coulomb(&self) -> bool {
        self.of.mu.iter().any(|&mu| mu > 0.0)
    }

    /// u less the mean rigid motion of each body.
    fn deformed(&self, u: &[f64]) -> Vec<f64> {
        let mut rest = u.to_vec();
        for motion in &self.of.motions {
            let part = along(motion, u);
            for &(i, v) in motion {
                rest[i] -= part * v;
            }
        }
        rest
    }

    /// Bᵀλ.
    fn contact_forces(&self, lambda: &[f64]) -> Vec<f64> {
        let (ln, lt) = lambda.split_at(self.of.m);
        let mut sums = vec![Sum::default(); self.of.n];
        for (rows, l) in [(&self.of.normal, ln), (&self.of.tangential, lt)] {
            for &(i, j, v) in rows {
                sums[j].add_product(v, l[i]);
            }
        }
        sums.into_iter().map(Sum::value).collect()
    }

    /// The slip bounds that go with these multipliers.
    fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        (0..self.of.m)
            .map(|i| match self.of.mu[i] {
                0.0 => self.of.given[i],
                mu => mu * lambda[i].max(0.0),
            })
            .collect()
    }

    /// What closes or opens no more of a gap than rounding does, at each node: forces that are none.
    fn dust(&self, load: &Load, start: &State, u: &[f64]) -> Vec<f64> {
        let reach = largest(u)
            .max(largest(&start.u))
            .max(largest(&load.gap))
            .max(largest(&load.slide));
        (self.of.compliance.iter())
            .map(|&c| {
                if c > 0.0 {
                    DUST * ROUNDING * reach / c
                } else {
                    0.0
                }
            })
            .collect()
    }

    /// The largest pressure; without pressure that is more than dust, the largest traction.
    fn largest_pressure(&self, lambda: &[f64], dust: &[f64]) -> f64 {
        let of = |which: std::ops::Range<usize>| {
            which
                .filter(|&i| lambda[i].abs() > dust[i])
                .fold(0.0, |p: f64, i| {
                    p.max(lambda[i].abs() / self.of.areas[i % self.of.m])
                })
        };
        // Under given bounds tractions may be all there is.
        let (pressure, traction) = (of(0..self.of.m), of(self.of.m..2 * self.of.m));
        if pressure > 1e-9 * traction {
            pressure
        } else {
            traction
        }
    }

    /// How far λ is from another λ, relative to a pressure; what is dust does not count.
    fn apart(&self, lambda: &[f64], other: &[f64], dust: &[f64], pressure: f64) -> f64 {
        let mut off = 0.0_f64;
        for i in 0..lambda.len() {
            let apart = (lambda[i] - other[i]).abs() - dust[i];
            off = off.max(apart / self.of.areas[i % self.of.m]);
        }
        if off == 0.0 { 0.0 } else { off / pressure }
    }

    /// How the end of a step meets the conditions; and whether rounding of a long way hides the forces.
    fn judge(
        &self,
        load: &Load,
        start: &State,
        u: &[f64],
        lambda: &[f64],
    ) -> (Vec<Deviation>, bool) {
        let (n, m) = (self.of.n, self.of.m);
        let (ln, lt) = lambda.split_at(m);
        let mut all = Vec::new();
        let mut note = |name: &'static str, place: usize, value: f64, allowed: f64| {
            let times = match (value.is_nan(), value > 0.0) {
                (true, _) => f64::INFINITY,
                (_, true) => value / allowed,
                _ => 0.0,
            };
            all.push(Deviation { name, place, times });
        };
        let (before, _) = product(&self.of.tangential, m, &start.u);
        let origin: Vec<f64> = (0..m)
            .map(|i| before[i] - (load.slide[i] - start.slide[i]))
            .collect();
        let reach = (largest(&start.u))
            .max(largest(&load.gap))
            .max(largest(&origin));

        // (1) and the balance of each body.
        let contact = self.contact_forces(lambda);
        let (inner, _) = product(&self.of.k, n, u);
        let far: Vec<f64> = u.iter().map(|u| u.abs() + reach).collect();
        let (_, mut terms) = product(&self.of.k, n, &far);
        let mut rest = vec![0.0; n];
        for i in 0..n {
            let mut sum = Sum::default();
            for v in [load.force[i], -contact[i], -inner[i]] {
                sum.add(v);
            }
            rest[i] = sum.value();
            terms[i] += load.force[i].abs() + contact[i].abs();
        }
        let force = match load.acting.max(length(&contact)) {
            0.0 => length(&load.force),
            force => force,
        };
        let rounding = ROUNDING * length(&terms);
        let blind = rounding > MET * force && force > 0.0;
        note("equilibrium", 0, length(&rest), MET * force + rounding);
        let dust = self.dust(load, start, u);
        let mut none = vec![0.0; n];
        for (rows, dust) in [
            (&self.of.normal, &dust[..m]),
            (&self.of.tangential, &dust[m..]),
        ] {
            for &(i, j, v) in rows {
                none[j] += v.abs() * dust[i];
            }
        }
        for (body, free) in self.free.iter().enumerate() {
            let of = |x: &[f64]| free.unknowns.iter().map(|&i| x[i] * x[i]).sum::<f64>();
            let own = of(&load.force).max(of(&contact)).sqrt();
            for motion in &free.motions {
                let open = along(motion, &load.force) - along(motion, &contact);
                let terms: f64 = (motion.iter())
                    .map(|&(i, v)| (v * load.force[i]).abs() + (v * contact[i]).abs())
                    .sum();
                let none: f64 = motion.iter().map(|&(i, v)| v.abs() * none[i]).sum();
                let allowed = RESULTANT * own + ROUNDING * terms + none;
                note("balance of a body", body, open.abs(), allowed);
            }
        }

        // (2)
        let deformed = self.deformed(u);
        let own: Vec<f64> = (self.of.compliance.iter().zip(lambda))
            .map(|(c, l)| c * l)
            .collect();
        let size = largest(&deformed).max(largest(&own));
        let whole = length(&deformed).max(length(&own));
        let rounding = ROUNDING * (largest(u) + reach);
        let (closing, _) = product(&self.of.normal, m, u);
        let gap: Vec<f64> = load.gap.iter().zip(&closing).map(|(d, c)| d - c).collect();
        let bound = self.bounds(lambda);
        let reference = self.largest_pressure(lambda, &dust);
        // Where nothing presses at all, the loads are the yardstick.
        let of_node = |i: usize| match reference > 0.0 {
            true => LOCAL * reference * self.of.areas[i],
            false => MET * force,
        };
        let most = largest(lambda);
        let mut work = Sum::default();
        let mut work_rounding = 0.0;
        for i in 0..m {
            note("penetration", i, -gap[i], MET * size + rounding);
            note("tension", i, -ln[i], MET * most);
            work.add_product(ln[i], gap[i]);
            work_rounding += ln[i].abs() * rounding;
            let c = self.of.compliance[i];
            // What closes no more than rounding is no pressure.
            let pressed = ln[i] - dust[i];
            let local = pressed.min((gap[i] - rounding) / c);
            note("pressed and apart", i, local.max(0.0), of_node(i) + dust[i]);
            if gap[i] < 0.0 {
                let local = (-gap[i] - rounding).max(0.0) / c;
                note("not pressed enough", i, local, of_node(i) + dust[i]);
            }
        }
        note(
            "complementarity",
            0,
            work.value().abs(),
            MET * length(lambda) * whole + work_rounding,
        );

        // (3)
        let (now, _) = product(&self.of.tangential, m, u);
        let friction = largest(&bound);
        for i in 0..m {
            note(
                "friction bound",
                i,
                lt[i].abs() - bound[i],
                MET * friction + f64::MIN_POSITIVE,
            );
            let c = self.of.compliance[m + i];
            if c == 0.0 {
                continue;
            }
            // A node that moves has all its friction, along the motion: λτ lacks so much to it.
            let slip = now[i] - origin[i];
            let slips = (slip.abs() - rounding).max(0.0);
            let lacks = (bound[i] - lt[i] * slip.signum()).max(0.0);
            let name = if lacks > bound[i] {
                "slip the wrong way"
            } else {
                "slip without full friction"
            };
            note(name, i, slips.min(c * lacks), MET * size + rounding);
            let local = (slips / c).min(lacks);
            note(
                "friction of a node",
                i,
                local,
                of_node(i) + dust[m + i] + ROUNDING * bound[i],
            );
        }
        (all, blind)
    }
}

/// The kernel of K among the rigid motions of each part: combinations that no row of K pulls back by more than a
/// millionth of what it could.
fn free_bodies(k: &Entries, n: usize, motions: &[Vec<(usize, f64)>]) -> Vec<Free> {
    const PULLED: f64 = 1e-6;
    let mut rows = vec![0.0; n];
    for &(i, _, v) in k {
        rows[i] += v.abs();
    }
    let mut bodies = Vec::new();
    let mut first = 0;
    while first < motions.len() {
        let of_part = |motion: &Vec<(usize, f64)>| motion[0].0 == motions[first][0].0;
        let count = motions[first..].iter().take_while(|m| of_part(m)).count();
        let part = &motions[first..first + count];
        first += count;
        let images: Vec<Vec<f64>> = (part.iter())
            .map(|motion| {
                let mut whole = vec![0.0; n];
                motion.iter().for_each(|&(i, v)| whole[i] = v);
                let (image, _) = product(k, n, &whole);
                image.iter().zip(&rows).map(|(v, r)| v / r).collect()
            })
            .collect();
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let gram: Vec<Vec<f64>> = (images.iter())
            .map(|a| images.iter().map(|b| dot(a, b)).collect())
            .collect();
        let mut kernel = Vec::new();
        for (value, vector) in eigen(gram) {
            if value.max(0.0).sqrt() < PULLED {
                let unknowns = part[0].iter().map(|e| e.0).enumerate();
                let mixed = unknowns.map(|(place, unknown)| {
                    let terms = part.iter().zip(&vector);
                    (unknown, terms.map(|(m, c)| c * m[place].1).sum())
                });
                kernel.push(mixed.collect());
            }
        }
        if !kernel.is_empty() {
            bodies.push(Free {
                motions: kernel,
                unknowns: part[0].iter().map(|e| e.0).collect(),
            });
        }
    }
    bodies
}

/// Eigenvalues and vectors of a small symmetric matrix (Jacobi).
fn eigen(mut a: Vec<Vec<f64>>) -> Vec<(f64, Vec<f64>)> {
    let n = a.len();
    let mut vectors: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for _ in 0..30 {
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q] == 0.0 {
                    continue;
                }
                let (s, c) = (0.5 * (2.0 * a[p][q]).atan2(a[q][q] - a[p][p])).sin_cos();
                for i in 0..n {
                    let (x, y) = (a[i][p], a[i][q]);
                    (a[i][p], a[i][q]) = (c * x - s * y, s * x + c * y);
                }
                for i in 0..n {
                    let (x, y) = (a[p][i], a[q][i]);
                    (a[p][i], a[q][i]) = (c * x - s * y, s * x + c * y);
                }
                for i in 0..n {
                    let (x, y) = (vectors[p][i], vectors[q][i]);
                    (vectors[p][i], vectors[q][i]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
    }
    (0..n).map(|i| (a[i][i], vectors[i].clone())).collect()
}

// ---------------------------------------------------------------------------------------------------------
// The certificate

/// How far forces within the friction law stay from balancing the loads on the bodies that contact alone holds.
struct Balance {
    /// The least imbalance relative to the loads.
    imbalance: f64,
    /// A motion has been found that the loads drive more than all contact forces together can resist.
    proven: bool,
}

/// min ‖e − G λ‖ over Coulomb's cones and the given bounds, by an active-set method (Stark and Parker 1995). With
/// the rest as a motion y: no λ resists it more than Σ max (yᵀGλ), the loads drive it by yᵀe.
fn least_imbalance(oracle: &Oracle, load: &Load) -> Balance {
    let (n, m) = (oracle.of.n, oracle.of.m);
    let motions: Vec<&Vec<(usize, f64)>> = oracle.free.iter().flat_map(|b| &b.motions).collect();
    let rows = motions.len();
    let mut wanted: Vec<f64> = motions.iter().map(|r| along(r, &load.force)).collect();
    let terms: Vec<f64> = (motions.iter())
        .map(|r| r.iter().map(|&(i, v)| (v * load.force[i]).abs()).sum())
        .collect();
    let size = length(&wanted);
    if size <= 100.0 * ROUNDING * length(&terms) {
        return Balance {
            imbalance: 0.0,
            proven: false,
        };
    }
    // Where each unknown stands in the motions.
    let mut of_unknown: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
    for (row, motion) in motions.iter().enumerate() {
        for &(i, v) in *motion {
            of_unknown[i].push((row, v));
        }
    }
    // A force that moves nothing but by rounding does nothing.
    let most =
        (motions.iter().flat_map(|r| r.iter())).fold(0.0, |most: f64, e| most.max(e.1.abs()));
    let columns = |entries: &Entries| {
        let mut columns = vec![vec![0.0; rows]; m];
        let mut sizes = vec![0.0; m];
        for &(i, j, v) in entries {
            sizes[i] += v.abs() * most;
            for &(row, r) in &of_unknown[j] {
                columns[i][row] += v * r;
            }
        }
        for (column, size) in columns.iter_mut().zip(&sizes) {
            for c in column {
                if c.abs() <= NOTHING * size {
                    *c = 0.0;
                }
            }
        }
        columns
    };
    let (normal, tangential) = (columns(&oracle.of.normal), columns(&oracle.of.tangential));
    // Each with factors from 0 to a limit; what goes from −g to g is moved by g.
    let mut generators: Vec<(Vec<f64>, f64)> = Vec::new();
    for i in 0..m {
        if oracle.of.mu[i] > 0.0 {
            for mu in [oracle.of.mu[i], -oracle.of.mu[i]] {
                let edge = normal[i].iter().zip(&tangential[i]);
                generators.push((edge.map(|(n, t)| n + mu * t).collect(), f64::INFINITY));
            }
        } else {
            generators.push((normal[i].clone(), f64::INFINITY));
            let g = oracle.of.given[i];
            if g > 0.0 {
                for (w, t) in wanted.iter_mut().zip(&tangential[i]) {
                    *w += g * t;
                }
                generators.push((tangential[i].clone(), 2.0 * g));
            }
        }
    }
    // Unit columns; imbalances in units of the loads.
    generators.retain_mut(|(column, limit)| {
        let norm = length(column);
        column.iter_mut().for_each(|c| *c /= norm);
        *limit *= norm / size;
        norm > 0.0
    });
    wanted.iter_mut().for_each(|w| *w /= size);
    let (rest, push) = bounded_least_squares(&generators, &wanted);
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let imbalance = length(&rest);
    let mut resisted = Sum::default();
    let mut bounded = true;
    for (column, limit) in &generators {
        let along = dot(column, &push);
        if limit.is_finite() {
            resisted.add(along.max(0.0) * limit);
        } else {
            bounded &= along <= NOTHING * length(&push);
        }
    }
    let mut driven = Sum::default();
    for (w, p) in wanted.iter().zip(&push) {
        driven.add_product(*w, *p);
    }
    Balance {
        imbalance,
        proven: bounded && driven.value() - resisted.value() > 0.5 * imbalance * imbalance,
    }
}

/// The rest b − A x with 0 ≤ x ≤ limits that is shortest; and the same without what rounding has left of it along the
/// columns whose factors are inside.
fn bounded_least_squares(columns: &[(Vec<f64>, f64)], b: &[f64]) -> (Vec<f64>, Vec<f64>) {
    #[derive(Clone, Copy, PartialEq)]
    enum Place {
        Low,
        Free,
        High,
    }
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
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
                // The last one depends on the others: rounding made it look like a gain.
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
fn least_squares(columns: &[&[f64]], b: &[f64]) -> Option<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
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

// ---------------------------------------------------------------------------------------------------------
// Random problems

/// A problem of a family, with what is known of its answer.
struct Problem {
    family: &'static str,
    trial: Trial,
    known: Option<Known>,
    /// Whether statics says that forces can balance the loads.
    held: Option<bool>,
}

/// An answer that was there before the problem.
struct Known {
    lambda: Vec<f64>,
    /// What rounding of f and d does to pressures and tractions at most; None where that was too much to find out.
    blur: Option<f64>,
    /// What violations as small as promised do to them, as A is conditioned.
    loose: f64,
}

/// The problem of a seed, or why it could not be built.
fn problem(seed: u64) -> Result<Problem, String> {
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
fn range(random: &mut Random) -> Range {
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

fn block(random: &mut Random) -> Written {
    let range = range(random);
    one_body(random, range)
}

fn pile(random: &mut Random) -> Written {
    let mut range = range(random);
    range.nodes = range.nodes.min(400);
    stack(random, range)
}

/// A block on a floor that is pushed by nearly what it bears before it slides or tips. All tractions are uniform, so
/// that statics tells.
fn edge(random: &mut Random) -> (Written, Option<bool>) {
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
struct Matrix {
    name: String,
    n: usize,
    entries: Entries,
    /// Scales of the unknowns: K = D K₀ D.
    scales: Vec<f64>,
    /// A typical diagonal entry of K₀.
    stiffness: f64,
}

/// Between the largest and the smallest eigenvalue of K₀ and between the squares of the largest and the smallest
/// scale there are 11 decades together at most, so that K can be factorised in f64.
fn matrix(random: &mut Random) -> Matrix {
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

type Row = Vec<(usize, f64)>;

/// N and T.
struct Rows {
    name: String,
    normal: Vec<Row>,
    tangential: Vec<Row>,
    /// What turns multipliers into pressures that can be compared.
    areas: Vec<f64>,
}

/// N and T with full row rank: each row has a pivot of its own, which is dominant; or pairs of pivots are turned.
fn contact_rows(random: &mut Random, matrix: &Matrix, m: usize) -> Rows {
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

fn row_times(row: &Row, u: &[f64]) -> f64 {
    along(row, u)
}

fn triplets(rows: &[Row]) -> Entries {
    let each = rows.iter().enumerate();
    each.flat_map(|(i, row)| row.iter().map(move |&(j, v)| (i, j, v)))
        .collect()
}

/// The laws of nodes.
#[derive(Clone, Copy, PartialEq)]
enum Mixture {
    Frictionless,
    Tresca,
    Coulomb,
    All,
}

impl Mixture {
    fn any(random: &mut Random) -> Self {
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
    fn law(self, random: &mut Random) -> char {
        match self {
            Self::Frictionless => 'n',
            Self::Tresca => pick(random, &['t', 't', 't', 't', 't', 't', 't', 'n']),
            Self::Coulomb => 'c',
            Self::All => pick(random, &['n', 't', 'c', 'c']),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Frictionless => "frictionless",
            Self::Tresca => "tresca",
            Self::Coulomb => "coulomb",
            Self::All => "laws mixed",
        }
    }
}

/// How many contact nodes; seldom none, often as many as fit.
fn nodes_for(random: &mut Random, n: usize) -> usize {
    let most = (n / 2).min(300);
    match random.below(12) {
        0 => most,
        1 => 1.min(most),
        2 if n < 20 => 0,
        _ => (1 + random.below(most.max(1))).min(most.max(usize::from(n == 1))),
    }
}

/// A problem whose solution is chosen first.
fn known(random: &mut Random) -> Problem {
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
fn sensitivity(problem: &ContactProblem, u: &[f64], lambda: &[f64]) -> (Option<f64>, f64) {
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
fn matrices(random: &mut Random) -> Trial {
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

// ---------------------------------------------------------------------------------------------------------
// Runs

fn settings(tolerance: f64) -> Settings<'static> {
    let mut settings = Settings::default();
    settings.ssnm.time_limit = Some(TIME_LIMIT);
    settings.ssnm.tolerance = tolerance;
    settings
}

fn run(trial: &Trial, way: Way) -> Run {
    let mut run = Run::new(trial, way, settings(TOLERANCE));
    if let Some(error) = run.end.strip_prefix("error: ") {
        // Without figures, so that the same errors are counted together.
        let words = error.chars().filter(|c| !c.is_ascii_digit()).take(100);
        run.end = format!("error: {}", words.collect::<String>());
    }
    run
}

/// A step once more, at a much finer tolerance, on the direct path.
fn tight(trial: &Trial, load: &Load, start: &State) -> Option<StepSolution> {
    let solved = catch_unwind(AssertUnwindSafe(|| {
        let mut dual = Way::Cholesky.dual(&trial.problem).ok()?;
        let problem = &trial.problem;
        quasistatic::solve_step(problem, load, start, &mut *dual, &settings(TIGHT), |_| {
            ControlFlow::Continue(())
        })
        .ok()
    }));
    solved
        .ok()
        .flatten()
        .filter(|solution| solution.status == Status::Converged)
}

// ---------------------------------------------------------------------------------------------------------
// What a campaign has found

/// Lines about seeds, by what they are about.
type Notes = BTreeMap<String, Vec<(u64, String)>>;

/// What one path has come to.
#[derive(Default)]
struct Tally {
    problems: usize,
    steps: usize,
    products: usize,
    seconds: f64,
    slowest: (f64, u64),
    /// For each family, how often it ended in which way.
    ends: BTreeMap<&'static str, BTreeMap<String, usize>>,
    /// For each condition the largest part of what is allowed.
    worst: BTreeMap<&'static str, (f64, u64)>,
    /// What must not be.
    failures: Notes,
    /// What may be, and is worth a look.
    remarks: Notes,
    /// Answers to steps whose forces rounding hides.
    blind: usize,
    /// Steps compared with a known answer, with one at a finer tolerance, and with the other path.
    compared: [usize; 3],
    /// Those of them that were off by more than promised.
    beyond: [usize; 3],
}

impl Tally {
    fn fail(&mut self, what: &str, seed: u64, line: String) {
        let of = self.failures.entry(what.to_owned()).or_default();
        of.push((seed, line));
    }

    fn remark(&mut self, what: &str, seed: u64, line: String) {
        let of = self.remarks.entry(what.to_owned()).or_default();
        of.push((seed, line));
    }

    fn worst(&mut self, name: &'static str, times: f64, seed: u64) {
        let worst = self.worst.entry(name).or_insert((0.0, seed));
        if !(times <= worst.0) {
            *worst = (times, seed);
        }
    }

    /// Two answers where there is one only.
    fn compare(&mut self, which: usize, apart: f64, allowed: f64, seed: u64, line: String) {
        const NAMES: [&str; 3] = [
            "forces from a known answer",
            "forces from a finer answer",
            "forces from the other path",
        ];
        self.compared[which] += 1;
        self.worst(NAMES[which], apart / allowed, seed);
        if !(apart <= allowed) {
            self.beyond[which] += 1;
            let line = format!("off by {apart:.1e} of the largest, {line}");
            self.remark(NAMES[which], seed, line);
        }
    }

    /// Judges a run.
    fn add(&mut self, seed: u64, problem: &Problem, oracle: &Oracle, run: &Run) {
        let trial = &problem.trial;
        self.problems += 1;
        self.steps += run.steps.len();
        self.products += run.steps.iter().map(StepSolution::n_a).sum::<usize>();
        self.seconds += run.seconds;
        if run.seconds > self.slowest.0 {
            self.slowest = (run.seconds, seed);
        }
        let ends = self.ends.entry(problem.family).or_default();
        *ends.entry(run.end.clone()).or_default() += 1;
        if run.end.starts_with("panic") {
            self.fail("panics", seed, format!("{} [{}]", run.end, trial.name));
        } else if run.end.starts_with("error") {
            let what = run.end.clone();
            self.remark(&what, seed, trial.name.clone());
        }
        for (number, step) in run.steps.iter().enumerate() {
            let load = &trial.loads[number];
            let start = run.start(trial, number);
            let place = format!(
                "step {} of {} [{}]",
                number + 1,
                trial.loads.len(),
                trial.name
            );
            if step.status == Status::Converged {
                self.converged(seed, problem, oracle, load, &start, step, &place);
            } else {
                self.given_up(seed, problem, oracle, load, &start, step, &place);
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn converged(
        &mut self,
        seed: u64,
        problem: &Problem,
        oracle: &Oracle,
        load: &Load,
        start: &State,
        step: &StepSolution,
        place: &str,
    ) {
        let (deviations, blind) = oracle.judge(load, start, &step.u, &step.lambda);
        self.blind += usize::from(blind);
        for deviation in &deviations {
            self.worst(deviation.name, deviation.times, seed);
        }
        let broken = deviations.iter().filter(|d| !(d.times <= 1.0));
        if let Some(worst) = broken.clone().max_by(|a, b| a.times.total_cmp(&b.times)) {
            let line = format!(
                "{} at {}, {:.2e} times what is allowed ({} broken), {place}",
                worst.name,
                worst.place,
                worst.times,
                broken.count()
            );
            self.fail("wrong converged", seed, line);
        }
        if problem.held == Some(false) {
            let balance = least_imbalance(oracle, load);
            if balance.imbalance > RESULTANT {
                let line = format!("imbalance {:.1e}, {place}", balance.imbalance);
                self.fail("converged where nothing holds", seed, line);
            }
        }
        let dust = oracle.dust(load, start, &step.u);
        if let Some(known) = &problem.known {
            let pressure = oracle.largest_pressure(&known.lambda, &dust);
            match known.blur {
                _ if blind || pressure == 0.0 => {}
                None => {}
                Some(blur) if blur > pressure => {
                    self.remark(
                        "rounding of f hides the known answer",
                        seed,
                        place.to_owned(),
                    );
                }
                Some(blur) => {
                    let apart = oracle.apart(&step.lambda, &known.lambda, &dust, pressure);
                    let line = format!(
                        "rounding explains {:.1e}, the condition of A {:.1e}, {place}",
                        blur / pressure,
                        known.loose / pressure
                    );
                    let allowed = NODAL + blur / pressure;
                    if apart > allowed && apart <= allowed + known.loose / pressure {
                        self.remark(CONDITIONED, seed, line);
                    } else {
                        self.compare(0, apart, allowed, seed, line);
                    }
                }
            }
        }
        let unique = !oracle.has_coulomb();
        if unique
            && !blind
            && oracle.of.n <= 600
            && let Some(fine) = tight(&problem.trial, load, start)
        {
            let pressure = oracle.largest_pressure(&fine.lambda, &dust);
            let apart = oracle.apart(&step.lambda, &fine.lambda, &dust, pressure);
            let explained = match &problem.known {
                Some(known) => apart <= NODAL + known.loose / pressure,
                None => problem.family == "matrices",
            };
            if apart > NODAL && explained {
                let line = format!("off by {apart:.1e} of the largest, {place}");
                self.remark(CONDITIONED, seed, line);
            } else {
                self.compare(1, apart, NODAL, seed, place.to_owned());
            }
        }
    }

    #[allow(clippy::too_many_arguments)]
    fn given_up(
        &mut self,
        seed: u64,
        problem: &Problem,
        oracle: &Oracle,
        load: &Load,
        start: &State,
        step: &StepSolution,
        place: &str,
    ) {
        let status = name_of(step.status);
        let balance = least_imbalance(oracle, load);
        let line = format!("imbalance {:.1e}, {place}", balance.imbalance);
        let coulomb = oracle.has_coulomb();
        let exists = if balance.imbalance > UNBALANCED && balance.proven {
            Some(false)
        } else if balance.imbalance > BALANCED {
            None
        } else if problem.family == "known" || !coulomb {
            Some(true)
        } else {
            has_solution(&Checker::new(&problem.trial.problem), load, start)
        };
        let what = match exists {
            Some(true) => "there is a solution",
            Some(false) => "there is none",
            None if balance.imbalance > BALANCED => "on the edge of what holds",
            None => "not known whether there is a solution",
        };
        if step.status == Status::NotHeld && exists == Some(true) {
            self.fail("wrong not_held", seed, line);
        } else {
            self.remark(&format!("{status}, {what}"), seed, line);
        }
        if step.status == Status::NotHeld && problem.held == Some(true) {
            let line = format!("statics says it holds, {place}");
            self.fail("wrong not_held", seed, line);
        }
    }

    fn merge(&mut self, other: Self) {
        self.problems += other.problems;
        self.steps += other.steps;
        self.products += other.products;
        self.seconds += other.seconds;
        self.blind += other.blind;
        for (sum, more) in self.compared.iter_mut().zip(other.compared) {
            *sum += more;
        }
        for (sum, more) in self.beyond.iter_mut().zip(other.beyond) {
            *sum += more;
        }
        if other.slowest.0 > self.slowest.0 {
            self.slowest = other.slowest;
        }
        for (family, ends) in other.ends {
            for (end, count) in ends {
                *self.ends.entry(family).or_default().entry(end).or_default() += count;
            }
        }
        for (name, (times, seed)) in other.worst {
            self.worst(name, times, seed);
        }
        for (mine, others) in [
            (&mut self.failures, other.failures),
            (&mut self.remarks, other.remarks),
        ] {
            for (what, lines) in others {
                mine.entry(what).or_default().extend(lines);
            }
        }
    }

    fn print(&mut self, name: &str) {
        println!("\n== {name} ==");
        println!(
            "{} problems, {} steps, {} products, {:.1} s in solves, the slowest {:.2} s (seed {})",
            self.problems, self.steps, self.products, self.seconds, self.slowest.0, self.slowest.1
        );
        let mut all: BTreeMap<String, usize> = BTreeMap::new();
        for (family, ends) in &self.ends {
            let list: Vec<String> = ends.iter().map(|(end, n)| format!("{end} {n}")).collect();
            println!("  {family:10} {}", list.join(", "));
            for (end, n) in ends {
                *all.entry(end.clone()).or_default() += n;
            }
        }
        let list: Vec<String> = all.iter().map(|(end, n)| format!("{end} {n}")).collect();
        println!("  {:10} {}", "all", list.join(", "));
        println!(
            "compared with a known answer {}, with a finer one {}, with the other path {}; blind {}",
            self.compared[0], self.compared[1], self.compared[2], self.blind
        );
        println!("worst, in parts of what is allowed:");
        for (name, (times, seed)) in &self.worst {
            println!("  {name:28} {times:.2e} (seed {seed})");
        }
        for (title, notes) in [
            ("FAILED", &mut self.failures),
            ("remark", &mut self.remarks),
        ] {
            for (what, lines) in notes {
                lines.sort();
                println!("{title}: {what}: {}", lines.len());
                for (seed, line) in lines.iter().take(20) {
                    println!("    {seed}: {line}");
                }
            }
        }
    }
}

/// Tries so many problems on some paths: a tally for each.
///
/// Each worker has a pool of its own with a single thread, so that no solve waits for parts of another one.
fn campaign(ways: &[Way], first: u64, problems: u64) -> Vec<Tally> {
    let next = AtomicU64::new(first);
    let tallies = Mutex::new(ways.iter().map(|_| Tally::default()).collect::<Vec<_>>());
    let workers = std::thread::available_parallelism().map_or(1, |n| n.get());
    std::thread::scope(|scope| {
        for _ in 0..workers {
            scope.spawn(|| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
                let pool = pool.unwrap_or_else(|error| panic!("{error}"));
                loop {
                    let seed = next.fetch_add(1, Ordering::Relaxed);
                    if seed >= first + problems {
                        break;
                    }
                    let found = pool.install(|| one(ways, seed));
                    let mut tallies = tallies.lock().expect("no worker panics while it holds it");
                    for (tally, found) in tallies.iter_mut().zip(found) {
                        tally.merge(found);
                    }
                }
            });
        }
    });
    let mut tallies = tallies.into_inner().expect("no worker has panicked");
    for (way, tally) in ways.iter().zip(&mut tallies) {
        tally.print(way.name());
    }
    tallies
}

/// One problem on some paths.
fn one(ways: &[Way], seed: u64) -> Vec<Tally> {
    let mut tallies: Vec<Tally> = ways.iter().map(|_| Tally::default()).collect();
    let made = catch_unwind(|| problem(seed)).unwrap_or_else(|_| Err("panic".to_owned()));
    let problem = match made {
        Ok(problem) => problem,
        Err(error) => {
            for tally in &mut tallies {
                // Right: a prescribed motion into an obstacle has no solution.
                if error.contains("supports drive the node") {
                    tally.remark(
                        "refused: supports drive a node into an obstacle",
                        seed,
                        String::new(),
                    );
                } else {
                    tally.fail("refused", seed, error.clone());
                }
            }
            return tallies;
        }
    };
    let oracle = Oracle::new(&problem.trial.problem);
    let runs: Vec<Run> = ways.iter().map(|&way| run(&problem.trial, way)).collect();
    for (tally, run) in tallies.iter_mut().zip(&runs) {
        tally.add(seed, &problem, &oracle, run);
    }
    // Both paths, as long as their histories are the same.
    if let ([a, b], [_, tally]) = (&runs[..], &mut tallies[..]) {
        // Each step starts from the end of the one before, with its errors.
        let (mut pressure, mut dust) = (0.0_f64, vec![0.0_f64; 2 * oracle.of.m]);
        for (number, (a, b)) in a.steps.iter().zip(&b.steps).enumerate() {
            if a.status != Status::Converged || b.status != Status::Converged {
                break;
            }
            let load = &problem.trial.loads[number];
            let start = runs[0].start(&problem.trial, number);
            let now = oracle.dust(load, &start, &a.u);
            dust.iter_mut()
                .zip(now)
                .for_each(|(d, now)| *d = d.max(now));
            pressure = pressure.max(oracle.largest_pressure(&a.lambda, &dust));
            let apart = oracle.apart(&b.lambda, &a.lambda, &dust, pressure);
            let place = format!("step {} [{}]", number + 1, problem.trial.name);
            let allowed = 2.0 * NODAL * (number + 1) as f64;
            if oracle.has_coulomb() {
                if apart > 3.0 * allowed {
                    let line = format!("off by {apart:.1e}, {place}");
                    tally.remark("paths differ, Coulomb", seed, line);
                    break;
                }
            } else if matches!(problem.family, "known" | "matrices") && apart > allowed {
                // As A is conditioned; each answer is judged by itself.
                let line = format!("off by {apart:.1e}, {place}");
                tally.remark("paths differ, matrices", seed, line);
                break;
            } else {
                tally.compare(2, apart, allowed, seed, place);
            }
        }
    }
    tallies
}

fn number(name: &str) -> Option<u64> {
    let value = std::env::var(name).ok()?;
    Some(
        value
            .parse()
            .unwrap_or_else(|_| panic!("{name} = {value} is no number")),
    )
}

/// Prints a problem, how its solves go and what the oracle says.
fn tell(seed: u64, ways: &[Way]) {
    let problem = problem(seed).unwrap_or_else(|error| panic!("{error}"));
    let trial = &problem.trial;
    println!("{seed}: {}\n{}", trial.name, trial.text);
    println!("n = {}, m = {}", trial.problem.n(), trial.problem.m());
    let oracle = Oracle::new(&trial.problem);
    for &way in ways {
        let run = run(trial, way);
        println!("---- {}: {} in {:.2} s", way.name(), run.end, run.seconds);
        for (number, step) in run.steps.iter().enumerate() {
            let (load, start) = (&trial.loads[number], run.start(trial, number));
            print_step(number, step);
            let balance = least_imbalance(&oracle, load);
            println!(
                "  least imbalance {:.2e}{}",
                balance.imbalance,
                if balance.proven { ", proven" } else { "" }
            );
            let (deviations, blind) = oracle.judge(load, &start, &step.u, &step.lambda);
            for deviation in deviations.iter().filter(|d| !(d.times <= 1.0)) {
                println!(
                    "  {} at {}: {:.2e} times what is allowed",
                    deviation.name, deviation.place, deviation.times
                );
            }
            if blind {
                println!("  blind: rounding hides the forces");
            }
            let dust = oracle.dust(load, &start, &step.u);
            if let Some(known) = &problem.known {
                println!(
                    "  from the known answer {:.2e}; rounding {:?}, condition of A {:.2e}; largest {:.2e}",
                    oracle.apart(
                        &step.lambda,
                        &known.lambda,
                        &dust,
                        oracle.largest_pressure(&known.lambda, &dust)
                    ),
                    known.blur,
                    known.loose,
                    largest(&known.lambda)
                );
                if trial.problem.m() <= 8 {
                    println!("  λ  {:?}\n  λ* {:?}", step.lambda, known.lambda);
                }
            }
            if let Some(fine) = tight(trial, load, &start) {
                println!(
                    "  from an answer to {TIGHT:e}: {:.2e}",
                    oracle.apart(
                        &step.lambda,
                        &fine.lambda,
                        &dust,
                        oracle.largest_pressure(&fine.lambda, &dust)
                    )
                );
                if trial.problem.m() <= 8 {
                    println!("  λ  {:?}\n  λ\u{302}  {:?}", step.lambda, fine.lambda);
                }
            }
        }
    }
}

/// What must not be, over all paths.
fn failures(tallies: &[Tally]) -> Vec<String> {
    let notes = tallies.iter().flat_map(|tally| &tally.failures);
    let mut failures: Vec<String> = notes
        .map(|(what, lines)| format!("{what}: {} (first seed {})", lines.len(), lines[0].0))
        .collect();
    for tally in tallies {
        for (beyond, compared) in tally.beyond.iter().zip(tally.compared) {
            if beyond * RARE > compared {
                failures.push(format!(
                    "forces off by more than promised: {beyond} of {compared}"
                ));
            }
        }
    }
    failures
}

#[test]
#[ignore = "20 000 solves"]
fn random_problems() {
    let ways: Vec<Way> = match std::env::var("CAMPAIGN_PATHS").as_deref() {
        Ok("cholesky") => vec![Way::Cholesky],
        Ok("pcg") => vec![Way::Pcg],
        _ => vec![Way::Cholesky, Way::Pcg],
    };
    if let Some(seed) = number("CAMPAIGN_ONLY") {
        tell(seed, &ways);
        return;
    }
    let first = number("CAMPAIGN_SEED").unwrap_or(1);
    let problems = number("CAMPAIGN_PROBLEMS").unwrap_or(10_000);
    let failures = failures(&campaign(&ways, first, problems));
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn a_few_random_problems() {
    let failures = failures(&campaign(&[Way::Cholesky, Way::Pcg], 1, 150));
    assert!(failures.is_empty(), "{failures:#?}");
}

/// The oracle is worth something: an answer with a multiplier changed by a hundredth, a sign turned, or a node moved
/// does not pass.
#[test]
fn the_oracle_tells_what_is_wrong() {
    let (mut told, mut missed) = (BTreeMap::<&str, usize>::new(), Vec::new());
    for seed in 1..=120 {
        let Ok(problem) = problem(seed) else { continue };
        let oracle = Oracle::new(&problem.trial.problem);
        let (n, m) = (oracle.of.n, oracle.of.m);
        if n > 200 {
            continue;
        }
        let run = run(&problem.trial, Way::Cholesky);
        let Some(step) = run.steps.first().filter(|s| s.status == Status::Converged) else {
            continue;
        };
        let (load, start) = (&problem.trial.loads[0], run.start(&problem.trial, 0));
        let wrong = |u: &[f64], lambda: &[f64]| {
            let (deviations, blind) = oracle.judge(load, &start, u, lambda);
            assert!(!blind, "{seed}: {}", problem.trial.name);
            deviations.iter().any(|d| !(d.times <= 1.0))
        };
        assert!(
            !wrong(&step.u, &step.lambda),
            "{seed}: {}",
            problem.trial.name
        );
        // The multiplier with the largest force, among some of them.
        let mut weight = vec![0.0; 2 * m];
        for (shift, rows) in [(0, &oracle.of.normal), (m, &oracle.of.tangential)] {
            for &(i, _, v) in rows {
                weight[i + shift] += v * v;
            }
        }
        let heaviest = |which: std::ops::Range<usize>| {
            let force = |&i: &usize| step.lambda[i].abs() * weight[i].sqrt();
            let all = length(&oracle.contact_forces(&step.lambda));
            which
                .max_by(|a, b| force(a).total_cmp(&force(b)))
                .filter(|i| force(i) > 1e-2 * all.max(load.acting))
        };
        let mut count = |what: &'static str, is_told: bool| {
            if is_told {
                *told.entry(what).or_default() += 1;
            } else {
                missed.push(format!("{seed}: {what} [{}]", problem.trial.name));
            }
        };
        for (what, which, factor) in [
            ("a pressure changed", 0..m, 1.01),
            ("a pressure turned", 0..m, -1.0),
            ("friction changed", m..2 * m, 0.99),
            ("friction turned", m..2 * m, -1.0),
        ] {
            if let Some(i) = heaviest(which) {
                let mut lambda = step.lambda.clone();
                lambda[i] *= factor;
                count(what, wrong(&step.u, &lambda));
            }
        }
        // A node that is moved so far that it takes a thousandth of the forces.
        let force = length(&oracle.contact_forces(&step.lambda)).max(load.acting);
        let diagonal = oracle.of.k.iter().filter(|e| e.0 == e.1);
        let stiffest = diagonal.max_by(|a, b| a.2.total_cmp(&b.2));
        if let (Some(&(i, _, k)), true) = (stiffest, force > 0.0) {
            let mut u = step.u.clone();
            u[i] += 1e-3 * force / k;
            count("a node moved", wrong(&u, &step.lambda));
        }
    }
    println!("told {told:?}");
    assert!(missed.is_empty(), "{missed:#?}");
    assert!(
        told.len() == 5 && told.values().all(|&n| n > 10),
        "{told:?}"
    );
}

/// The certificate: a block on a floor, with what statics says of it.
#[test]
fn the_certificate_is_statics() {
    let mut counts = [0; 2];
    for seed in 1..=200 {
        let (written, held) = edge(&mut generator(seed));
        let trial = elastic(written).unwrap_or_else(|error| panic!("{error}"));
        let oracle = Oracle::new(&trial.problem);
        assert_eq!(oracle.free.len(), 1, "{}", trial.name);
        assert_eq!(oracle.free[0].motions.len(), 3, "{}", trial.name);
        let balance = least_imbalance(&oracle, &trial.loads[0]);
        match held {
            Some(true) => assert!(
                balance.imbalance < BALANCED,
                "{}: {:e}",
                trial.name,
                balance.imbalance
            ),
            Some(false) => assert!(
                balance.imbalance > UNBALANCED && balance.proven,
                "{}: {:e}",
                trial.name,
                balance.imbalance
            ),
            None => continue,
        }
        counts[usize::from(held == Some(true))] += 1;
    }
    assert!(counts.iter().all(|&n| n > 50), "{counts:?}");
}
