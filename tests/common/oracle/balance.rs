//! The certificate that nothing holds a body.

use super::least_squares::bounded_least_squares;
use super::sums::{Sum, along, dot};
use super::{Entries, NOTHING, Oracle, ROUNDING, length};

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettings, DefaultSolver, IPSolver as _, SolverStatus, SupportedConeT,
};
use signorini::quasistatic::Load;

/// The resolution of a balance in the plane, where it is found to rounding …
pub const BALANCED: f64 = 1e-12;

/// … and in space, the accuracy of Clarabel.
pub const BALANCED_IN_SPACE: f64 = 1e-7;

/// The remaining imbalance of the loads on bodies that only contact holds, with forces within the friction law.
pub struct Balance {
    /// The least imbalance relative to the loads.
    pub imbalance: f64,
    /// A motion for which the loads do more work than all contact forces together can resist.
    pub proven: bool,
    /// An imbalance below this part of the loads counts as rounding. Above 100 times that, no forces balance the loads.
    pub resolution: f64,
}

impl Balance {
    /// Whether forces within the friction law balance the loads; None between the two.
    pub fn holds(&self) -> Option<bool> {
        match self.imbalance {
            off if off <= self.resolution => Some(true),
            off if off > 100.0 * self.resolution && self.proven => Some(false),
            _ => None,
        }
    }
}

/// min ‖e − G λ‖ over Coulomb's cones and the given bounds: in the plane by an active-set method (Stark and Parker 1995),
/// in space by Clarabel. With the rest as a motion y: no λ resists it more than Σ max (yᵀGλ), the loads drive it by yᵀe.
pub fn least_imbalance(oracle: &Oracle, load: &Load) -> Balance {
    let (n, m, tangents) = (oracle.n, oracle.m, oracle.tangents);
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
    // The position of each unknown in the motions.
    let mut of_unknown: Vec<Vec<(usize, f64)>> = vec![Vec::new(); n];
    for (row, motion) in motions.iter().enumerate() {
        for &(i, v) in *motion {
            of_unknown[i].push((row, v));
        }
    }
    // A force that moves something only by rounding has no effect.
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
    let normal = columns(&oracle.normal, m);
    let tangential = columns(&oracle.tangential, tangents * m);
    if tangents > 1 {
        wanted.iter_mut().for_each(|w| *w /= size);
        let (imbalance, proven) =
            least_imbalance_of_cones(oracle, &normal, &tangential, &wanted, size);
        return Balance {
            imbalance,
            proven,
            resolution,
        };
    }
    // Each with factors from 0 to a limit; a range from −g to g is shifted by g.
    let mut generators: Vec<(Vec<f64>, f64)> = Vec::new();
    for i in 0..m {
        if oracle.mu[i] > 0.0 {
            for mu in [oracle.mu[i], -oracle.mu[i]] {
                let edge = normal[i].iter().zip(&tangential[i]);
                generators.push((edge.map(|(n, t)| n + mu * t).collect(), f64::INFINITY));
            }
        } else {
            generators.push((normal[i].clone(), f64::INFINITY));
            let g = oracle.given[i];
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
/// ‖e − G λ‖ ≤ t, and whether Clarabel confirms the minimum.
pub fn least_imbalance_of_cones(
    of: &Oracle,
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
