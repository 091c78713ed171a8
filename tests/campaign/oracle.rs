//! What an answer is judged by: sums with their rounding errors, the conditions of the contact problem, and the
//! certificate that nothing holds a body. It shares no code with the solver.

use super::common::checker::{Checker, Entries, largest, length};
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use signorini::problem::ContactProblem;
use signorini::quasistatic::{Load, State};

/// ε, the default of a case file.
pub(super) const TOLERANCE: f64 = 1e-6;
/// What conditions (1)–(3) may be off by.
pub(super) const MET: f64 = 10.0 * TOLERANCE;
/// What the resultants on a body may be off by.
pub(super) const RESULTANT: f64 = 100.0 * TOLERANCE;
/// What a nodal force may be off by, relative to the largest …
pub(super) const NODAL: f64 = 3000.0 * TOLERANCE;
/// … and what the gap or slip at a node says that it is off by.
pub(super) const LOCAL: f64 = NODAL;
/// What is below this part of its terms is rounding.
pub(super) const NOTHING: f64 = 1e-11;
/// Rounding of a sum relative to its terms.
pub(super) const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// The resolution of a balance in the plane, where it is found to rounding …
const BALANCED: f64 = 1e-12;
/// … and in space, where it is what Clarabel finds.
const BALANCED_IN_SPACE: f64 = 1e-7;
/// Forces that close this many times what rounding leaves of a gap are none.
pub(super) const DUST: f64 = 100.0;

/// A sum with its rounding error (Neumaier; products split exactly by a fused multiplication).
#[derive(Clone, Copy, Default)]
pub(super) struct Sum {
    pub(super) high: f64,
    pub(super) low: f64,
}

impl Sum {
    pub(super) fn add(&mut self, x: f64) {
        let sum = self.high + x;
        let back = sum - self.high;
        self.low += (self.high - (sum - back)) + (x - back);
        self.high = sum;
    }

    pub(super) fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(product);
        self.low += a.mul_add(b, -product);
    }

    pub(super) fn value(self) -> f64 {
        self.high + self.low
    }
}

/// A product with a matrix, and with the absolute values of everything.
pub(super) fn product(entries: &Entries, rows: usize, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut sums, mut sizes) = (vec![Sum::default(); rows], vec![0.0; rows]);
    for &(i, j, v) in entries {
        sums[i].add_product(v, x[j]);
        sizes[i] += (v * x[j]).abs();
    }
    (sums.into_iter().map(Sum::value).collect(), sizes)
}

/// Σ over a sparse vector.
pub(super) fn along(motion: &[(usize, f64)], x: &[f64]) -> f64 {
    let mut sum = Sum::default();
    for &(i, v) in motion {
        sum.add_product(v, x[i]);
    }
    sum.value()
}

// ---------------------------------------------------------------------------------------------------------
// The conditions

/// A body that K lets move as a whole.
pub(super) struct Free {
    /// Orthonormal, as (unknown, entry).
    pub(super) motions: Vec<Vec<(usize, f64)>>,
    /// Its unknowns.
    pub(super) unknowns: Vec<usize>,
}

/// The conditions (1)–(3), from the matrices alone.
pub(super) struct Oracle {
    /// K, N, T and what follows from them.
    pub(super) of: Checker,
    pub(super) free: Vec<Free>,
}

/// What an answer is off by in one respect, relative to what is allowed.
pub(super) struct Deviation {
    pub(super) name: &'static str,
    /// Contact node or body.
    pub(super) place: usize,
    pub(super) times: f64,
}

impl Oracle {
    pub(super) fn new<const D: usize>(problem: &ContactProblem<D>) -> Self {
        let of = Checker::new(problem);
        Self {
            free: free_bodies(&of.k, of.n, &of.motions),
            of,
        }
    }

    pub(super) fn has_coulomb(&self) -> bool {
        self.of.mu.iter().any(|&mu| mu > 0.0)
    }

    /// u less the mean rigid motion of each body.
    pub(super) fn deformed(&self, u: &[f64]) -> Vec<f64> {
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
    pub(super) fn contact_forces(&self, lambda: &[f64]) -> Vec<f64> {
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
    pub(super) fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        (0..self.of.m)
            .map(|i| match self.of.mu[i] {
                0.0 => self.of.given[i],
                mu => mu * lambda[i].max(0.0),
            })
            .collect()
    }

    /// What closes or opens no more of a gap than rounding does, at each node: forces that are none.
    pub(super) fn dust(&self, load: &Load, start: &State, u: &[f64]) -> Vec<f64> {
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

    /// The area of the node of a multiplier.
    fn area(&self, i: usize) -> f64 {
        let (m, tangents) = (self.of.m, self.of.tangents);
        self.of.areas[if i < m { i } else { (i - m) / tangents }]
    }

    /// The largest pressure; without pressure that is more than dust, the largest traction.
    pub(super) fn largest_pressure(&self, lambda: &[f64], dust: &[f64]) -> f64 {
        let of = |which: std::ops::Range<usize>| {
            which
                .filter(|&i| lambda[i].abs() > dust[i])
                .fold(0.0, |p: f64, i| p.max(lambda[i].abs() / self.area(i)))
        };
        // Under given bounds tractions may be all there is.
        let (pressure, traction) = (of(0..self.of.m), of(self.of.m..lambda.len()));
        if pressure > 1e-9 * traction {
            pressure
        } else {
            traction
        }
    }

    /// How far λ is from another λ, relative to a pressure; what is dust does not count.
    pub(super) fn apart(&self, lambda: &[f64], other: &[f64], dust: &[f64], pressure: f64) -> f64 {
        let mut off = 0.0_f64;
        for i in 0..lambda.len() {
            let apart = (lambda[i] - other[i]).abs() - dust[i];
            off = off.max(apart / self.area(i));
        }
        if off == 0.0 { 0.0 } else { off / pressure }
    }

    /// How the end of a step meets the conditions; and whether rounding of a long way hides the forces. Nodal forces are
    /// measured by the largest pressure, `by_start` by that before if it was larger.
    pub(super) fn judge(
        &self,
        load: &Load,
        start: &State,
        u: &[f64],
        lambda: &[f64],
        by_start: bool,
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
        let rows = self.of.tangents * m;
        let (before, _) = product(&self.of.tangential, rows, &start.u);
        let origin: Vec<f64> = (0..rows)
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
        let mut reference = self.largest_pressure(lambda, &dust);
        if by_start {
            reference = reference.max(self.largest_pressure(&start.lambda, &dust));
        }
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
        let (now, _) = product(&self.of.tangential, rows, u);
        let friction = largest(&bound);
        for i in 0..m {
            let of_node_i = self.of.tangents * i..self.of.tangents * (i + 1);
            let force = &lt[of_node_i.clone()];
            note(
                "friction bound",
                i,
                length(force) - bound[i],
                MET * friction + f64::MIN_POSITIVE,
            );
            let c = (self.of.compliance[m..][of_node_i.clone()].iter())
                .fold(0.0, |c: f64, &v| c.max(v));
            if c == 0.0 {
                continue;
            }
            // A node that moves has all its friction, along the motion: λτ is the point of the disc of the bound that is
            // closest to λτ + slip / c. What it is off by is the least change of slip or friction that makes it right.
            let slip: Vec<f64> = of_node_i
                .clone()
                .map(|row| now[row] - origin[row])
                .collect();
            let far = length(&slip);
            let slips = (far - rounding).max(0.0);
            let part = if far > 0.0 { slips / (c * far) } else { 0.0 };
            let beyond: Vec<f64> = (force.iter().zip(&slip))
                .map(|(force, slip)| force + part * slip)
                .collect();
            // 1 for the NaN of no force at all.
            let scale = (bound[i] / length(&beyond)).min(1.0);
            let missing: Vec<f64> = (beyond.iter().zip(force))
                .map(|(beyond, force)| scale * beyond - force)
                .collect();
            let lacks = length(&missing);
            let name = if lacks > bound[i] {
                "slip the wrong way"
            } else {
                "slip without full friction"
            };
            note(name, i, c * lacks, MET * size + rounding);
            let dust = length(&dust[m..][of_node_i]);
            note(
                "friction of a node",
                i,
                lacks,
                of_node(i) + dust + ROUNDING * bound[i],
            );
        }
        (all, blind)
    }
}

/// The kernel of K among the rigid motions of each part: combinations that no row of K pulls back by more than a
/// millionth of what it could.
pub(super) fn free_bodies(k: &Entries, n: usize, motions: &[Vec<(usize, f64)>]) -> Vec<Free> {
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
pub(super) fn eigen(mut a: Vec<Vec<f64>>) -> Vec<(f64, Vec<f64>)> {
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
pub(super) struct Balance {
    /// The least imbalance relative to the loads.
    pub(super) imbalance: f64,
    /// A motion has been found that the loads drive more than all contact forces together can resist.
    pub(super) proven: bool,
    /// An imbalance below this part of the loads is none: what it says is rounding. Above 100 times that, no forces
    /// balance the loads.
    pub(super) resolution: f64,
}

impl Balance {
    /// Whether forces within the friction law balance the loads; None between the two.
    pub(super) fn holds(&self) -> Option<bool> {
        match self.imbalance {
            off if off <= self.resolution => Some(true),
            off if off > 100.0 * self.resolution && self.proven => Some(false),
            _ => None,
        }
    }
}

/// min ‖e − G λ‖ over Coulomb's cones and the given bounds: in the plane by an active-set method (Stark and Parker 1995),
/// in space by Clarabel. With the rest as a motion y: no λ resists it more than Σ max (yᵀGλ), the loads drive it by yᵀe.
pub(super) fn least_imbalance(oracle: &Oracle, load: &Load) -> Balance {
    let (n, m, tangents) = (oracle.of.n, oracle.of.m, oracle.of.tangents);
    let resolution = if tangents == 1 {
        BALANCED
    } else {
        BALANCED_IN_SPACE
    };
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
            resolution,
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
    let columns = |entries: &Entries, count: usize| {
        let mut columns = vec![vec![0.0; rows]; count];
        let mut sizes = vec![0.0; count];
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
    let normal = columns(&oracle.of.normal, m);
    let tangential = columns(&oracle.of.tangential, tangents * m);
    if tangents > 1 {
        wanted.iter_mut().for_each(|w| *w /= size);
        let (imbalance, proven) =
            least_imbalance_of_cones(&oracle.of, &normal, &tangential, &wanted, size);
        return Balance {
            imbalance,
            proven,
            resolution,
        };
    }
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
        resolution,
        proven: bounded && driven.value() - resisted.value() > 0.5 * imbalance * imbalance,
    }
}

/// The same by a cone program, for columns of G and loads e of length 1 in units of `size`: Clarabel's minimum of t with
/// ‖e − G λ‖ ≤ t, and whether Clarabel says that it is the least.
fn least_imbalance_of_cones(
    of: &Checker,
    normal: &[Vec<f64>],
    tangential: &[Vec<f64>],
    wanted: &[f64],
    size: f64,
) -> (f64, bool) {
    use SupportedConeT::{NonnegativeConeT, SecondOrderConeT};
    let (m, t) = (of.m, of.tangents);
    let of_law = |i: usize| of.mu[i] > 0.0 || of.given[i] > 0.0;
    let rubbing: Vec<usize> = (0..m).filter(|&i| of_law(i)).collect();
    let unknowns = m + t * rubbing.len() + 1;
    // A x + s = b with s in the cones.
    let mut entries = Vec::new();
    let mut b = vec![0.0; m];
    let mut cones = vec![NonnegativeConeT(m)];
    entries.extend((0..m).map(|i| (i, i, -1.0)));
    for (k, &i) in rubbing.iter().enumerate() {
        let row = b.len();
        entries.push((row, i, -of.mu[i]));
        entries.extend((0..t).map(|c| (row + 1 + c, m + t * k + c, -1.0)));
        b.push(if of.mu[i] > 0.0 {
            0.0
        } else {
            of.given[i] / size
        });
        b.extend(vec![0.0; t]);
        cones.push(SecondOrderConeT(1 + t));
    }
    let row = b.len();
    entries.push((row, unknowns - 1, -1.0));
    for (motion, &w) in wanted.iter().enumerate() {
        let at = row + 1 + motion;
        entries.extend((0..m).map(|i| (at, i, normal[i][motion])));
        for (k, &i) in rubbing.iter().enumerate() {
            entries.extend((0..t).map(|c| (at, m + t * k + c, tangential[t * i + c][motion])));
        }
        b.push(w);
    }
    b.insert(row, 0.0);
    cones.push(SecondOrderConeT(1 + wanted.len()));
    let mut q = vec![0.0; unknowns];
    q[unknowns - 1] = 1.0;
    let (rows, (columns, values)): (Vec<_>, (Vec<_>, Vec<_>)) =
        entries.into_iter().map(|(i, j, v)| (i, (j, v))).unzip();
    let a = CscMatrix::new_from_triplets(b.len(), unknowns, rows, columns, values);
    let settings = DefaultSettings {
        verbose: false,
        tol_gap_abs: 1e-10,
        tol_gap_rel: 1e-10,
        tol_feas: 1e-10,
        ..Default::default()
    };
    let none = CscMatrix::zeros((unknowns, unknowns));
    let mut solver = DefaultSolver::new(&none, &q, &a, &b, &cones, settings)
        .unwrap_or_else(|error| panic!("{error:?}"));
    solver.solve();
    let solution = &solver.solution;
    let proven = matches!(
        solution.status,
        SolverStatus::Solved | SolverStatus::AlmostSolved
    );
    (solution.x[unknowns - 1], proven)
}

/// The rest b − A x with 0 ≤ x ≤ limits that is shortest; and the same without what rounding has left of it along the
/// columns whose factors are inside.
pub(super) fn bounded_least_squares(
    columns: &[(Vec<f64>, f64)],
    b: &[f64],
) -> (Vec<f64>, Vec<f64>) {
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
pub(super) fn least_squares(columns: &[&[f64]], b: &[f64]) -> Option<Vec<f64>> {
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
