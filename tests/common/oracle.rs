//! The judge of answers: sums with their rounding errors, the conditions of the contact problem, and the certificate
//! that nothing holds a body. It shares no code with the solver.

pub mod all_sets;
pub mod balance;
mod bodies;
mod least_squares;
pub mod sums;

use bodies::{Free, floating_bodies, rigid_motions};
use faer::linalg::solvers::Solve as _;
use faer::{Mat, Side};
use signorini::problem::ContactProblem;
use signorini::quasistatic::{Load, State};
use sums::{Sum, along, dot, product};

/// ε, the default of a case file.
pub const TOLERANCE: f64 = 1e-6;

/// The allowed violation of conditions (1)–(3).
pub const MET: f64 = 10.0 * TOLERANCE;

/// The allowed error of the resultants on a body.
pub const RESULTANT: f64 = 100.0 * TOLERANCE;

/// The allowed error of a nodal force, relative to the largest …
pub const NODAL: f64 = 3000.0 * TOLERANCE;

/// … and the allowed error that the gap or slip at a node implies.
pub const LOCAL: f64 = NODAL;

/// A value below this part of its terms is rounding.
pub const NOTHING: f64 = 1e-11;

/// Rounding of a sum relative to its terms.
pub const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Forces that close less than this many times the rounding of a gap count as zero.
pub const NOISE: f64 = 100.0;

/// The entries of a matrix: row, column, value.
pub type Entries = Vec<(usize, usize, f64)>;

pub fn largest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |largest: f64, v| {
        if v.is_nan() || largest.is_nan() {
            f64::NAN
        } else {
            largest.max(v.abs())
        }
    })
}

pub fn length(x: &[f64]) -> f64 {
    x.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// The conditions (1)–(3), including Coulomb's law, in the plane and in space: from the matrices alone.
pub struct Oracle {
    pub k: Entries,
    pub normal: Entries,
    pub tangential: Entries,
    pub mu: Vec<f64>,
    pub given: Vec<f64>,
    pub areas: Vec<f64>,
    pub n: usize,
    pub m: usize,
    /// Tangential multipliers of a contact node.
    pub tangents: usize,
    /// For each connected part of K whose nodes have positions, its rigid-body motions: orthonormal, as (unknown,
    /// entry).
    pub motions: Vec<Vec<(usize, f64)>>,
    /// The least motion of its own node under a unit force of a multiplier.
    pub compliance: Vec<f64>,
    pub free: Vec<Free>,
}

/// A deviation of an answer, relative to the allowed one.
pub struct Deviation {
    pub name: &'static str,
    /// Contact node or body.
    pub place: usize,
    pub times: f64,
    /// Whether it concerns the force of one node, which may be off by more.
    pub local: bool,
}

impl Oracle {
    pub fn new<const D: usize>(problem: &ContactProblem<D>) -> Self {
        let k: Entries = problem.stiffness().triplets().collect();
        let normal: Entries = problem.normal().triplets().collect();
        let tangential: Entries = problem.tangential().triplets().collect();
        let (n, m) = (problem.stiffness().n_rows(), problem.m());
        let mut mu = problem.friction_coefficient().to_vec();
        mu.resize(m, 0.0);
        let mut diagonal = vec![0.0; n];
        for &(i, j, v) in &k {
            if i == j {
                diagonal[i] = v;
            }
        }
        let mut compliance = vec![0.0; D * m];
        for (shift, rows) in [(0, &normal), (m, &tangential)] {
            for &(i, j, v) in rows {
                compliance[i + shift] += v * v / diagonal[j];
            }
        }
        // For both tangents of a node together, independent of the choice of tangents.
        for of_node in compliance[m..].chunks_mut(D - 1) {
            let moved: Vec<f64> = of_node.iter().copied().filter(|&c| c > 0.0).collect();
            if moved.len() > 1 {
                of_node.fill(moved.iter().sum::<f64>() / moved.len() as f64);
            }
        }
        let motions = match problem.coordinates() {
            Some(points) => rigid_motions(&k, n, points),
            None => Vec::new(),
        };
        Self {
            mu,
            given: problem.slip_bound().to_vec(),
            areas: problem.areas().to_vec(),
            n,
            m,
            tangents: D - 1,
            free: floating_bodies(&k, n, &motions),
            motions,
            compliance,
            k,
            normal,
            tangential,
        }
    }

    pub fn has_coulomb(&self) -> bool {
        self.mu.iter().any(|&mu| mu > 0.0)
    }

    /// u minus the mean rigid-body motion of each body.
    pub fn deformed(&self, u: &[f64]) -> Vec<f64> {
        let mut rest = u.to_vec();
        for motion in &self.motions {
            let part = along(motion, u);
            for &(i, v) in motion {
                rest[i] -= part * v;
            }
        }
        rest
    }

    /// The scale of lengths at (u, λ): the deformation, or the effect of the contact forces on their own nodes.
    pub fn size(&self, u: &[f64], lambda: &[f64]) -> f64 {
        largest(&self.deformed(u)).max(largest(&self.own(lambda)))
    }

    /// The scale of the terms of earlier displacements: a node that sticks has hardly moved, and K⁻¹f and K⁻¹Bᵀλ are as large
    /// as the effect of its force.
    fn before(&self, start: &State) -> f64 {
        largest(&start.u).max(largest(&self.own(&start.lambda)))
    }

    /// The least effect of each contact force on its own node.
    fn own(&self, lambda: &[f64]) -> Vec<f64> {
        (self.compliance.iter().zip(lambda))
            .map(|(c, l)| c * l)
            .collect()
    }

    /// Bᵀλ.
    pub fn contact_forces(&self, lambda: &[f64]) -> Vec<f64> {
        let (ln, lt) = lambda.split_at(self.m);
        let mut sums = vec![Sum::default(); self.n];
        for (rows, l) in [(&self.normal, ln), (&self.tangential, lt)] {
            for &(i, j, v) in rows {
                sums[j].add_product(v, l[i]);
            }
        }
        sums.into_iter().map(Sum::value).collect()
    }

    /// The slip bounds for these multipliers.
    pub fn bounds(&self, lambda: &[f64]) -> Vec<f64> {
        (0..self.m)
            .map(|i| match self.mu[i] {
                0.0 => self.given[i],
                mu => mu * lambda[i].max(0.0),
            })
            .collect()
    }

    /// For each node the force that closes or opens a gap no more than rounding: smaller forces count as zero.
    pub fn noise(&self, load: &Load, start: &State, u: &[f64]) -> Vec<f64> {
        let reach = largest(u)
            .max(self.before(start))
            .max(largest(&load.gap))
            .max(largest(&load.slide));
        (self.compliance.iter())
            .map(|&c| {
                if c > 0.0 {
                    NOISE * ROUNDING * reach / c
                } else {
                    0.0
                }
            })
            .collect()
    }

    /// The area of the node of a multiplier.
    pub fn area(&self, i: usize) -> f64 {
        let (m, tangents) = (self.m, self.tangents);
        self.areas[if i < m { i } else { (i - m) / tangents }]
    }

    /// The largest pressure; if no pressure exceeds the noise, the largest traction.
    pub fn largest_pressure(&self, lambda: &[f64], noise: &[f64]) -> f64 {
        let of = |which: std::ops::Range<usize>| {
            which
                .filter(|&i| lambda[i].abs() > noise[i])
                .fold(0.0, |p: f64, i| p.max(lambda[i].abs() / self.area(i)))
        };
        // Under given bounds there may be only tractions.
        let (pressure, traction) = (of(0..self.m), of(self.m..lambda.len()));
        if pressure > 1e-9 * traction {
            pressure
        } else {
            traction
        }
    }

    /// The distance of λ from another λ, relative to a pressure. Noise does not count, nor does the part that displacements
    /// hardly depend on ([`Self::loose`]).
    pub fn apart(&self, lambda: &[f64], other: &[f64], noise: &[f64], pressure: f64) -> f64 {
        let mut apart: Vec<f64> = (0..lambda.len())
            .map(|i| {
                let apart = lambda[i] - other[i];
                apart.signum() * (apart.abs() - noise[i]).max(0.0) / self.area(i)
            })
            .collect();
        if largest(&apart) > NODAL * pressure {
            for loose in self.loose() {
                let part = dot(&loose, &apart);
                apart
                    .iter_mut()
                    .zip(loose)
                    .for_each(|(apart, c)| *apart -= part * c);
            }
        }
        match largest(&apart) {
            0.0 => 0.0,
            off => off / pressure,
        }
    }

    /// Orthonormal pressures and tractions that move their own nodes so little that a violation of [`MET`] allows them to
    /// be off by [`NODAL`]. Forces that cancel each other at each node, where rows of B depend on each other, move nothing.
    /// Those that one body hardly yields to and the other one's facets do not see move next to nothing.
    fn loose(&self) -> Vec<Vec<f64>> {
        let rows = self.compliance.len();
        let mut k = Mat::<f64>::zeros(self.n, self.n);
        let mut stiffest = 0.0_f64;
        for &(i, j, v) in &self.k {
            k[(i, j)] += v;
            stiffest = stiffest.max(v.abs());
        }
        // A body that nothing holds is held softly: its balance is checked by itself.
        for motion in &self.motions {
            for &(i, a) in motion {
                for &(j, b) in motion {
                    k[(i, j)] += stiffest * a * b;
                }
            }
        }
        let mut transposed = Mat::<f64>::zeros(self.n, rows);
        for (shift, entries) in [(0, &self.normal), (self.m, &self.tangential)] {
            for &(i, j, v) in entries {
                transposed[(j, shift + i)] += v;
            }
        }
        let Ok(factor) = k.llt(Side::Lower) else {
            return Vec::new();
        };
        let a = transposed.transpose() * factor.solve(&transposed);
        let moving: Vec<usize> = (0..rows).filter(|&i| a[(i, i)] > 0.0).collect();
        let own: Vec<f64> = moving.iter().map(|&i| a[(i, i)].sqrt()).collect();
        let count = moving.len();
        let scaled = Mat::from_fn(count, count, |i, j| {
            a[(moving[i], moving[j])] / own[i] / own[j]
        });
        let eigen = (scaled.self_adjoint_eigen(Side::Lower)).expect("a symmetric matrix");
        let compliances = eigen.S().column_vector();
        let mut found: Vec<Vec<f64>> = Vec::new();
        for pattern in (0..count).filter(|&c| compliances[c] < MET / NODAL) {
            let mut c = vec![0.0; rows];
            for (at, &i) in moving.iter().enumerate() {
                c[i] = eigen.U()[(at, pattern)] / own[at] / self.area(i);
            }
            // Twice is enough.
            for _ in 0..2 {
                for other in &found {
                    let part = dot(other, &c);
                    c.iter_mut().zip(other).for_each(|(c, o)| *c -= part * o);
                }
                let size = length(&c);
                c.iter_mut().for_each(|c| *c /= size);
            }
            found.push(c);
        }
        found
    }

    /// The deviations of the end of a step. Remaining forces after unloading are no more accurate than those before:
    /// where they fail, they are compared again relative to those.
    pub fn deviations(
        &self,
        load: &Load,
        start: &State,
        u: &[f64],
        lambda: &[f64],
    ) -> Vec<Deviation> {
        let (deviations, _) = self.judge(load, start, u, lambda, false);
        if deviations.iter().all(|d| d.times <= 1.0) {
            return deviations;
        }
        self.judge(load, start, u, lambda, true).0
    }

    /// The deviations of the end of a step; and whether rounding of a large motion hides the forces. Nodal forces are
    /// measured by the largest pressure, `by_start` by that before if it was larger.
    pub fn judge(
        &self,
        load: &Load,
        start: &State,
        u: &[f64],
        lambda: &[f64],
        by_start: bool,
    ) -> (Vec<Deviation>, bool) {
        let (n, m) = (self.n, self.m);
        let (ln, lt) = lambda.split_at(m);
        let mut all = Vec::new();
        let mut note = |name: &'static str, place: usize, value: f64, allowed: f64| {
            let times = match (value.is_nan(), value > 0.0) {
                (true, _) => f64::INFINITY,
                (_, true) => value / allowed,
                _ => 0.0,
            };
            let local = matches!(
                name,
                "pressed and apart" | "not pressed enough" | "friction of a node"
            );
            all.push(Deviation {
                name,
                place,
                times,
                local,
            });
        };
        let rows = self.tangents * m;
        let (before, _) = product(&self.tangential, rows, &start.u);
        let origin: Vec<f64> = (0..rows)
            .map(|i| before[i] - (load.slide[i] - start.slide[i]))
            .collect();
        let reach = (self.before(start))
            .max(largest(&load.gap))
            .max(largest(&origin));

        // (1) and the balance of each body.
        let contact = self.contact_forces(lambda);
        let (inner, _) = product(&self.k, n, u);
        let far: Vec<f64> = u.iter().map(|u| u.abs() + reach).collect();
        let (_, mut terms) = product(&self.k, n, &far);
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
        let noise = self.noise(load, start, u);
        let mut none = vec![0.0; n];
        for (rows, noise) in [(&self.normal, &noise[..m]), (&self.tangential, &noise[m..])] {
            for &(i, j, v) in rows {
                none[j] += v.abs() * noise[i];
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
        let own = self.own(lambda);
        let size = largest(&deformed).max(largest(&own));
        let whole = length(&deformed).max(length(&own));
        let rounding = ROUNDING * (largest(u) + reach);
        let (closing, _) = product(&self.normal, m, u);
        let gap: Vec<f64> = load.gap.iter().zip(&closing).map(|(d, c)| d - c).collect();
        let bound = self.bounds(lambda);
        let mut reference = self.largest_pressure(lambda, &noise);
        if by_start {
            reference = reference.max(self.largest_pressure(&start.lambda, &noise));
        }
        // Without any pressure, the loads are the reference.
        let of_node = |i: usize| match reference > 0.0 {
            true => LOCAL * reference * self.areas[i],
            false => MET * force,
        };
        let most = largest(lambda);
        let mut work = Sum::default();
        let mut work_rounding = 0.0;
        for i in 0..m {
            note("penetration", i, -gap[i], MET * size + rounding);
            note("tension", i, -ln[i], MET * most);
            work.add_product(ln[i], gap[i]);
            // Forces that rounding explains do no work.
            work_rounding += ln[i].abs() * rounding + ln[i].abs().min(noise[i]) * gap[i].abs();
            let c = self.compliance[i];
            // A force that closes no more than rounding is not a pressure.
            let pressed = ln[i] - noise[i];
            let local = pressed.min((gap[i] - rounding) / c);
            note(
                "pressed and apart",
                i,
                local.max(0.0),
                of_node(i) + noise[i],
            );
            if gap[i] < 0.0 {
                let local = (-gap[i] - rounding).max(0.0) / c;
                note("not pressed enough", i, local, of_node(i) + noise[i]);
            }
        }
        note(
            "complementarity",
            0,
            work.value().abs(),
            MET * length(lambda) * whole + work_rounding,
        );

        // (3)
        let (now, _) = product(&self.tangential, rows, u);
        let friction = largest(&bound);
        for i in 0..m {
            let of_node_i = self.tangents * i..self.tangents * (i + 1);
            let force = &lt[of_node_i.clone()];
            note(
                "friction bound",
                i,
                length(force) - bound[i],
                MET * friction + f64::MIN_POSITIVE,
            );
            let c =
                (self.compliance[m..][of_node_i.clone()].iter()).fold(0.0, |c: f64, &v| c.max(v));
            if c == 0.0 {
                continue;
            }
            // A moving node has its full friction, along the motion: λτ is the point of the disc of the bound closest to
            // λτ + slip / c. Its deviation is the least change of slip or friction that makes it right.
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
            let noise = length(&noise[m..][of_node_i]);
            note(
                "friction of a node",
                i,
                lacks,
                of_node(i) + noise + ROUNDING * bound[i],
            );
        }
        (all, blind)
    }
}
