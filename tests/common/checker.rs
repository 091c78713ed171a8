//! The optimality conditions (1)–(3) under Coulomb's law, checked with no code of the solver's own check, and what can
//! be said of problems that have not been solved: whether forces can balance the bodies, and whether any choice of
//! sets is a solution.

use signorini::problem::ContactProblem;
use signorini::quasistatic::{Load, State};
use std::collections::BTreeMap;

/// Equilibrium, relative to the larger of the acting and of the contact forces.
pub const EQUILIBRIUM: f64 = 1e-4;
/// Penetration, relative to the deformation.
pub const PENETRATION: f64 = 1e-4;
/// Excess of the friction over μλν, relative to the largest μλν (and to that of the node).
pub const EXCESS: f64 = 1e-4;
/// The slip of a node that may not slip, and the gap of one that is pressed, relative to the deformation.
pub const LENGTH: f64 = 1e-3;
/// What the friction of a slipping node may lack to its bound, relative to that bound …
pub const LACK: f64 = 1e-3;
/// … and to the largest pressure: three times what the documentation promises of nodal tractions, as both the
/// traction and the pressure that bounds it have their errors.
pub const NODAL: f64 = 3e-3;
/// The part of what is allowed that an answer uses which is right beyond doubt.
pub const CLEARLY: f64 = 0.1;
/// What a body that is not held lacks to its balance at least, relative to the loads.
pub const BALANCE: f64 = 1e-7;
/// Rounding of a sum relative to its terms.
pub const ROUNDING: f64 = 1e-13;
/// Forces below this part of those that act are none.
pub const NOTHING: f64 = 1e-9;

pub type Entries = Vec<(usize, usize, f64)>;

/// A product with a matrix, and with the absolute values of everything.
pub fn times(entries: &Entries, rows: usize, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut product, mut size) = (vec![0.0; rows], vec![0.0; rows]);
    for &(i, j, v) in entries {
        product[i] += v * x[j];
        size[i] += (v * x[j]).abs();
    }
    (product, size)
}

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

/// The optimality conditions (1)–(3) with Coulomb's law, from the matrices alone.
pub struct Checker {
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
    /// For each connected part of K whose nodes have places, its rigid motions: orthonormal, as (unknown, entry).
    pub motions: Vec<Vec<(usize, f64)>>,
    /// How far a unit force of a multiplier moves its own node at least.
    pub compliance: Vec<f64>,
}

impl Checker {
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
        // Those of both tangents of a node together, whichever pair of tangents they are.
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
            motions,
            compliance,
            k,
            normal,
            tangential,
        }
    }

    /// The largest displacement, less the mean rigid motion of each body.
    pub fn deformation(&self, u: &[f64]) -> f64 {
        let mut rest = u.to_vec();
        for motion in &self.motions {
            let part: f64 = motion.iter().map(|&(i, v)| v * u[i]).sum();
            for &(i, v) in motion {
                rest[i] -= part * v;
            }
        }
        largest(&rest)
    }

    /// What lengths at (u, λ) are compared with: the deformation, or what the contact forces do to their own nodes.
    pub fn size(&self, u: &[f64], lambda: &[f64]) -> f64 {
        let own = self.compliance.iter().zip(lambda).map(|(c, l)| c * l);
        let own: Vec<f64> = own.collect();
        self.deformation(u).max(largest(&own))
    }

    /// How the end of a step meets the conditions: for each its name, the contact node, and how many times what is
    /// allowed it is off.
    pub fn conditions(
        &self,
        load: &Load,
        start: &State,
        u: &[f64],
        lambda: &[f64],
    ) -> Vec<(&'static str, usize, f64)> {
        let (n, m) = (self.n, self.m);
        let (ln, lt) = lambda.split_at(m);
        let mut conditions = Vec::new();
        let mut check = |name: &'static str, node: usize, value: f64, allowed: f64| {
            if value > 0.0 {
                conditions.push((name, node, value / allowed));
            } else if value.is_nan() {
                conditions.push((name, node, f64::INFINITY));
            }
        };

        // (1)
        let (mut rest, mut sizes) = times(&self.k, n, u);
        // What is left of a larger displacement before has the rounding of that.
        let (_, before) = times(&self.k, n, &vec![largest(&start.u); n]);
        let mut contact = vec![0.0; n];
        for (rows, l) in [(&self.normal, ln), (&self.tangential, lt)] {
            for &(i, j, v) in rows {
                contact[j] += v * l[i];
            }
        }
        for i in 0..n {
            rest[i] += contact[i] - load.force[i];
            sizes[i] += before[i] + contact[i].abs() + load.force[i].abs();
        }
        let mut force = load.acting.max(length(&contact));
        if force == 0.0 {
            force = length(&load.force);
        }
        check(
            "equilibrium",
            0,
            length(&rest),
            EQUILIBRIUM * force + ROUNDING * length(&sizes),
        );

        // (2)
        let size = self.size(u, lambda);
        let far = largest(u).max(largest(&load.gap)).max(largest(&start.u));
        let rounding = ROUNDING * far.max(largest(&load.slide)).max(largest(&start.slide));
        let (closing, _) = times(&self.normal, m, u);
        let gap: Vec<f64> = load.gap.iter().zip(&closing).map(|(d, c)| d - c).collect();
        let pressure = (ln.iter().zip(&self.areas)).fold(0.0, |p: f64, (l, a)| p.max(l / a));
        let most = largest(lambda);
        for i in 0..m {
            check("penetration", i, -gap[i], PENETRATION * size + rounding);
            check("tension", i, -ln[i], 1e-10 * most);
            // Pressed, and apart.
            let open = (gap[i] - rounding) / (LENGTH * size);
            let pressed = ln[i] / (NODAL * pressure * self.areas[i]);
            if ln[i] > NOTHING * force && gap[i] > rounding {
                check("complementarity", i, open.min(pressed), 1.0);
            }
        }

        // (3)
        let (now, _) = times(&self.tangential, m, u);
        let (before, _) = times(&self.tangential, m, &start.u);
        let bound: Vec<f64> = (0..m)
            .map(|i| match self.mu[i] {
                0.0 => self.given[i],
                mu => mu * ln[i].max(0.0),
            })
            .collect();
        let of_law = (0..m).filter(|&i| self.mu[i] > 0.0);
        let friction = of_law.fold(0.0, |g: f64, i| g.max(bound[i]));
        // Forces are as exact as the largest pressure says; without pressure, as the largest bound says.
        let reference = if pressure > 0.0 {
            pressure
        } else {
            (bound.iter().zip(&self.areas)).fold(0.0, |p: f64, (g, a)| p.max(g / a))
        };
        for i in 0..m {
            let slack = match self.mu[i] {
                0.0 => 1e-10 * bound[i],
                _ => EXCESS * (bound[i] + friction),
            };
            check(
                "friction bound",
                i,
                lt[i].abs() - bound[i],
                slack + NOTHING * force,
            );
            let slip = now[i] - before[i] + load.slide[i] - start.slide[i];
            let slips = (slip.abs() - rounding) / (LENGTH * size);
            // The friction of a node that slips is all there, and (T u)ᵢ = c λτ,i with c ≥ 0.
            let lacks = bound[i] - lt[i] * slip.signum();
            let allowed = LACK * bound[i] + NODAL * reference * self.areas[i] + NOTHING * force;
            if slip.abs() > rounding && lacks > 0.0 {
                let which = if lacks > bound[i] {
                    "slip the wrong way"
                } else {
                    "slip without full friction"
                };
                check(which, i, slips.min(lacks / allowed), 1.0);
            }
        }
        conditions
    }
}

/// How far the forces on Coulomb's cones, and within the given bounds, stay from balancing the loads on the bodies
/// that contact alone holds, relative to these loads. Where they cannot, there is no solution.
pub fn unbalanced(problem: &ContactProblem, checker: &Checker, load: &Load) -> f64 {
    let (n, m) = (checker.n, checker.m);
    let free = problem.free_bodies();
    let wanted = free.resultants(&load.force);
    let size = length(&wanted);
    if size <= ROUNDING * 1e3 * length(&load.force) {
        return 0.0;
    }
    // What each force that generates a cone or an interval does to the motions, and the interval of its factor.
    let mut columns: Vec<(Vec<f64>, f64, f64)> = Vec::new();
    for i in 0..m {
        let row = |rows: &Entries| {
            let mut force = vec![0.0; n];
            for &(_, j, v) in rows.iter().filter(|entry| entry.0 == i) {
                force[j] += v;
            }
            free.resultants(&force)
        };
        let (normal, tangential) = (row(&checker.normal), row(&checker.tangential));
        let mu = checker.mu[i];
        if mu > 0.0 {
            for mu in [mu, -mu] {
                let edge = normal.iter().zip(&tangential).map(|(n, t)| n + mu * t);
                columns.push((edge.collect(), 0.0, f64::INFINITY));
            }
        } else {
            columns.push((normal, 0.0, f64::INFINITY));
            columns.push((tangential, -checker.given[i], checker.given[i]));
        }
    }
    // Least squares one factor after another.
    let mut factors = vec![0.0; columns.len()];
    let mut rest = wanted;
    for _ in 0..20_000 {
        for (factor, (column, low, high)) in factors.iter_mut().zip(&columns) {
            let square: f64 = column.iter().map(|c| c * c).sum();
            if square > 0.0 {
                let along: f64 = column.iter().zip(&rest).map(|(c, r)| c * r).sum();
                let moved = (*factor + along / square).clamp(*low, *high) - *factor;
                *factor += moved;
                for (r, c) in rest.iter_mut().zip(column) {
                    *r -= moved * c;
                }
            }
        }
        if length(&rest) <= 1e-9 * size {
            break;
        }
    }
    length(&rest) / size
}

/// Sets that are tried at most where all of them are, and unknowns.
pub const ALL_SETS: usize = 5_000;
pub const FEW_UNKNOWNS: usize = 300;
/// Springs that make K regular, relative to it; they hang on the displacement before, so that little is left in
/// them after so many turns where the bodies are balanced.
pub const SPRINGS: f64 = 1e-7;
pub const TURNS: usize = 20;

/// What a contact node does.
#[derive(Clone, Copy)]
pub struct Choice {
    pub closed: bool,
    /// λτ = slip · g; None where it sticks.
    pub slip: Option<f64>,
}

/// Whether a step of a small problem has a solution, found by trying all sets one after another; None where there
/// are too many, or nothing to measure forces by. A solution has to stand the check.
pub fn has_solution(checker: &Checker, load: &Load, start: &State) -> Option<bool> {
    let (n, m) = (checker.n, checker.m);
    let mut slides = vec![false; m];
    for &(i, _, v) in &checker.tangential {
        slides[i] |= v != 0.0;
    }
    let choices: Vec<Vec<Choice>> = (0..m)
        .map(|i| {
            let of = |closed, slips: &[Option<f64>]| {
                let choice = |&slip| Choice { closed, slip };
                slips.iter().map(choice).collect::<Vec<_>>()
            };
            let all = [None, Some(1.0), Some(-1.0)];
            let coulomb = checker.mu[i] > 0.0;
            if !slides[i] || (!coulomb && checker.given[i] == 0.0) {
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
    let stiffness = (checker.k.iter()).fold(0.0, |k: f64, e| k.max(e.2.abs()));
    let mut matrix = vec![vec![0.0; 2 * n]; n];
    for &(i, j, v) in &checker.k {
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
    let rows = (checker.normal.iter().copied())
        .chain(checker.tangential.iter().map(|&(i, j, v)| (m + i, j, v)));
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
    // What the load does without contact, with the springs hanging on `hooks`.
    let alone = |hooks: &[f64]| -> Vec<f64> {
        let force = load.force.iter().zip(hooks);
        let force: Vec<f64> = force.map(|(f, h)| f / stiffness + SPRINGS * h).collect();
        (inverse.iter())
            .map(|row| row.iter().zip(&force).map(|(h, f)| h * f).sum())
            .collect()
    };
    let first = alone(&start.u);
    let (before, _) = times(&checker.tangential, m, &start.u);
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
            let (free, _) = times(&rows, 2 * m, &alone_now);
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
                        if checker.mu[i] > 0.0 {
                            system[m + i][i] = -sign * checker.mu[i];
                        } else {
                            system[m + i][2 * m] = sign * checker.given[i] / stiffness;
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
            let conditions = checker.conditions(load, start, &u, &lambda);
            if !pulls && conditions.iter().all(|c| c.2 <= 1.0) {
                return Some(true);
            }
            // Without forces left in the springs it is these sets that are wrong; forces that do not grow less carry
            // what nothing else does.
            let equilibrium = conditions.iter().filter(|c| c.0 == "equilibrium");
            let left = equilibrium.fold(0.0, |left: f64, c| left.max(c.2));
            if left < 0.1 || (turn > 1 && left > 0.8 * springs) {
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

/// The rigid motions of each connected part of K, orthonormal; unknowns that nothing ties to others are held.
pub fn rigid_motions<const D: usize>(
    k: &Entries,
    n: usize,
    points: &[[f64; D]],
) -> Vec<Vec<(usize, f64)>> {
    let mut tied = vec![false; n];
    let mut part: Vec<usize> = (0..n / D).collect();
    pub fn root(part: &mut [usize], mut i: usize) -> usize {
        while part[i] != i {
            part[i] = part[part[i]];
            i = part[i];
        }
        i
    }
    for &(i, j, v) in k {
        if i != j && v != 0.0 {
            tied[i] = true;
            let (a, b) = (root(&mut part, i / D), root(&mut part, j / D));
            part[a] = b;
        }
    }
    let mut parts: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for node in 0..n / D {
        let root = root(&mut part, node);
        parts.entry(root).or_default().push(node);
    }
    let mut motions = Vec::new();
    for nodes in parts.values() {
        let count = nodes.len() as f64;
        let middle: [f64; D] =
            std::array::from_fn(|c| nodes.iter().map(|&i| points[i][c]).sum::<f64>() / count);
        let mut own: Vec<Vec<(usize, f64)>> = Vec::new();
        // Translations, and turns in each plane of two axes.
        let turns = (0..D).flat_map(|a| (a + 1..D).map(move |b| (a, b)));
        for (a, b) in (0..D).map(|a| (a, a)).chain(turns) {
            let mut column = Vec::new();
            for &node in nodes {
                let mut moved = [0.0; D];
                if a == b {
                    moved[a] = 1.0;
                } else {
                    moved[a] = middle[b] - points[node][b];
                    moved[b] = points[node][a] - middle[a];
                }
                for c in 0..D {
                    if tied[D * node + c] {
                        column.push((D * node + c, moved[c]));
                    }
                }
            }
            let norm =
                |column: &[(usize, f64)]| column.iter().map(|c| c.1 * c.1).sum::<f64>().sqrt();
            let before = norm(&column);
            for _ in 0..2 {
                for other in &own {
                    // Both list the same unknowns.
                    let part: f64 = other.iter().zip(&column).map(|(a, b)| a.1 * b.1).sum();
                    for (c, o) in column.iter_mut().zip(other) {
                        c.1 -= part * o.1;
                    }
                }
            }
            let after = norm(&column);
            if after > 1e-6 * before {
                for c in &mut column {
                    c.1 /= after;
                }
                own.push(column);
            }
        }
        motions.extend(own);
    }
    motions
}
