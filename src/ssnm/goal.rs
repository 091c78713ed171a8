//! The conditions on a point before the final check is worth its price, and on a solution.

use super::check::Verdict;
use super::{MET, NewtonSettings, Numbers, Status};
use crate::constraint::{at, put};
use crate::problem::{ContactProblem, Kkt, Scales, beyond, slip_violation, tangents_of};
use crate::rigid;
use crate::rounding::ROUNDING;
use crate::sparse::{add_times, dot, norm, norm_max};
use std::array::from_fn;

/// The goal of a solve; all in the units of the problem except `err`.
pub(super) struct Goal {
    /// err at most.
    pub err: f64,
    /// ε.
    tolerance: f64,
    numbers: Numbers,
    /// Penetration, gaps under forces, and slip where there should be none, at most, beyond rounding; known after the first check.
    slack: f64,
    /// |λνᵀ(Nu − d)| / ‖λ‖ at most, as above.
    work: f64,
    /// Final checks that failed.
    pub checks: usize,
    /// Forces are measured by those before the load step as well, where they were larger.
    pub by_start: bool,
}

/// What is known of a point.
pub(super) struct Evidence {
    pub err: f64,
    /// Whether it meets the goal; in the final check, whether its forces do.
    pub accurate: bool,
    /// Whether rounding hides err.
    pub hidden: bool,
    /// The conditions against K, after the final check.
    pub kkt: Option<Kkt>,
}

impl Goal {
    /// Of a solve with these settings; err is set at each point.
    pub fn new(settings: &NewtonSettings) -> Self {
        Self {
            err: 0.0,
            tolerance: settings.tolerance,
            numbers: settings.numbers,
            slack: f64::INFINITY,
            work: f64::INFINITY,
            checks: 0,
            by_start: false,
        }
    }

    /// Whether a solve has ended.
    pub fn judge(&self, evidence: &Evidence) -> Verdict {
        let limit = MET * self.tolerance;
        match &evidence.kkt {
            None if evidence.accurate => Verdict::Check,
            None if evidence.hidden => Verdict::MakeExact,
            None => Verdict::GoOn,
            Some(kkt)
                if evidence.err <= self.err * (1.0 + 1e-6)
                    && evidence.accurate
                    && kkt.max() <= limit =>
            {
                Verdict::Done(Status::Converged)
            }
            // Equilibrium does not depend on λ: no further step can repair it. A goal that was met again and again and
            // still fails the check is at the limit of rounding.
            Some(kkt) if !(kkt.equilibrium <= limit) || self.checks >= self.numbers.checks => {
                Verdict::Done(Status::Stagnated)
            }
            Some(_) => Verdict::Refreshed,
        }
    }

    /// Demands what the conditions against K demand, at these scales, from here on.
    pub fn tighten(&mut self, scales: &Scales) {
        self.slack = MET * self.tolerance * scales.length;
        self.work = MET * self.tolerance * scales.deformation;
    }

    /// Whether a point with gradient r and error err meets it; `moved` as in [`Goal::forces_met`]. Written so that NaN
    /// never passes.
    pub fn met<const D: usize, K>(
        &self,
        problem: &ContactProblem<D, K>,
        lambda: &[f64],
        r: &[f64],
        moved: &[f64],
        err: f64,
    ) -> bool {
        if !(err <= self.err) || !self.forces_met(problem, lambda, r, moved) {
            return false;
        }
        if self.checks == 0 {
            return true;
        }
        let m = problem.m();
        let (ln, lt) = lambda.split_at(m);
        let rounding = rounding(problem, lambda, r, moved);
        let (rn, rt) = r.split_at(m);
        let rn: Vec<f64> = (rn.iter().zip(&rounding))
            .map(|(r, of)| beyond(*r, *of))
            .collect();
        let (g, (own, c)) = (problem.bounds(lambda), problem.compliance().split_at(m));
        let penetration = (0..m).fold(0.0, |acc: f64, i| {
            let apart = rn[i].min(own[i] * ln[i]);
            acc.max(match problem.is_tied(i) {
                true => rn[i].abs(),
                false => apart.max(-rn[i]),
            })
        });
        let slip = (0..m).fold(0.0, |acc: f64, i| {
            let at = tangents_of::<D>(i);
            let slip: [f64; D] = from_fn(|a| if a == 0 { 0.0 } else { -rt[at.start + a - 1] });
            let c = norm_max(&c[at.clone()]);
            let off = slip_violation(&lt[at.clone()], &slip[1..], g[i], c);
            acc.max(beyond(off, rigid::length(&rounding[m..][at])))
        });
        let length = norm(lambda);
        penetration.max(slip) <= self.slack
            && (length == 0.0 || dot(ln, &rn).abs() / length <= self.work)
    }

    /// Whether the possible change of a pressure or a traction by the gradient r at a point is a small enough part of
    /// the largest pressure for ε. Without pressure, the largest traction counts.
    ///
    /// Gaps r in closed contacts are closed by forces δ with (B D⁻¹ Bᵀ + C) δ = −r, D the diagonal of K, as if only the
    /// unknowns under the contact moved. Neighbours over the same unknowns share them, and a fine mesh on a coarse soft
    /// one has patterns of force that only its own unknowns resist. No gap is more accurate than the rounding of its
    /// terms, and a force that closes less counts as zero. These terms are displacements up to `moved` in its row, even
    /// if they cancel in B u.
    pub fn forces_met<const D: usize, K>(
        &self,
        problem: &ContactProblem<D, K>,
        lambda: &[f64],
        r: &[f64],
        moved: &[f64],
    ) -> bool {
        let Numbers {
            forces, touching, ..
        } = self.numbers;
        let (areas, compliance) = (problem.areas(), problem.compliance());
        let rounding = rounding(problem, lambda, r, moved);
        let Some(missing) = missing(problem, lambda, r, &rounding) else {
            return false;
        };
        let closing = close_alone(problem, &missing, self.numbers.force_steps);
        // The largest pressure and the largest traction, before the load step and now.
        let mut largest = [[0.0_f64; 2]; 2];
        let mut note = |when: usize, i: usize, a: usize, force: f64| {
            let kind = &mut largest[when][usize::from(a > 0)];
            *kind = kind.max(force.abs() / areas[i]);
        };
        let before = &problem.load_case().before;
        for i in 0..if self.by_start { before.len() / D } else { 0 } {
            let before: [f64; D] = at(before, i);
            (0..D).for_each(|a| note(0, i, a, before[a]));
        }
        let mut off = 0.0_f64;
        for i in 0..problem.m() {
            let [node, more, c, none] =
                [lambda, &closing, compliance, &rounding].map(|x| at::<D>(x, i));
            let disc = problem.law(i).disc(node[0]);
            let met: [f64; D] = disc.project(from_fn(|a| node[a] + more[a]));
            for a in 0..D {
                if c[a] * node[a].abs() > touching * none[a] {
                    note(1, i, a, node[a]);
                    off = off.max(none[a] / c[a] / areas[i]);
                }
                let moved = (met[a] - node[a]).abs() / areas[i];
                if moved.is_nan() || more[a].is_nan() {
                    return false;
                }
                off = off.max(moved);
            }
        }
        // Under given bounds there may be only tractions, and pressures that are rounding of those: of the traction and of the one before.
        let [before, now] = largest.map(|[pressure, traction]| match pressure > 0.0 {
            true => (forces * self.tolerance * pressure).max(2.0 * ROUNDING * traction),
            false => forces * self.tolerance * traction,
        });
        let allowed = before.max(now);
        allowed == 0.0 || off <= allowed
    }
}

/// The gap that each node would close by itself, within its law; None if one is not a number: a projection would hide that.
fn missing<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    lambda: &[f64],
    r: &[f64],
    rounding: &[f64],
) -> Option<Vec<f64>> {
    let compliance = problem.compliance();
    let mut missing = vec![0.0; r.len()];
    for i in 0..problem.m() {
        let [node, slope, c, none] = [lambda, r, compliance, rounding].map(|x| at::<D>(x, i));
        let alone: [f64; D] = from_fn(|a| match c[a] > 0.0 && !(slope[a].abs() <= none[a]) {
            true => node[a] - slope[a] / c[a],
            false => node[a],
        });
        if alone.iter().any(|v| v.is_nan()) {
            return None;
        }
        let met = problem.law(i).disc(node[0]).project(alone);
        let closed: [f64; D] = from_fn(|a| c[a] * (met[a] - node[a]));
        put(&mut missing, i, closed);
    }
    Some(missing)
}

/// The rounding of each entry of r.
pub(super) fn rounding<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    lambda: &[f64],
    r: &[f64],
    moved: &[f64],
) -> Vec<f64> {
    let offsets = problem.load_case().offsets();
    let now = offsets.iter().zip(r).map(|(c, r)| (c - r).abs());
    let moved = moved.iter().zip(now).map(|(moved, now)| moved.max(now));
    problem.rounding(moved.collect(), lambda)
}

/// δ with (B D⁻¹ Bᵀ + C) δ = `missing` on the multipliers where that is not zero, by this many steps of conjugate residuals: where
/// rows depend on each other, some of what is missing is out of reach of all forces, and the steps leave it. NaN if something
/// missing is not finite.
fn close_alone<const D: usize, K>(
    problem: &ContactProblem<D, K>,
    missing: &[f64],
    steps: usize,
) -> Vec<f64> {
    let diagonal = problem.diagonal();
    let b = problem.contact_matrix();
    let masked = |x: &mut [f64]| {
        x.iter_mut()
            .zip(missing)
            .filter(|(_, missing)| **missing == 0.0)
            .for_each(|(x, _)| *x = 0.0);
    };
    let times = |x: &[f64]| {
        let mut moved = vec![0.0; diagonal.len()];
        b.mul_transpose_add(1.0, x, &mut moved);
        moved.iter_mut().zip(diagonal).for_each(|(u, k)| *u /= k);
        let mut closed = vec![0.0; x.len()];
        b.mul(&moved, &mut closed);
        problem.ranks().sum(&mut closed);
        for (closed, (c, x)) in (closed.iter_mut()).zip(problem.contact_compliance().iter().zip(x))
        {
            *closed += c * x;
        }
        masked(&mut closed);
        closed
    };
    let compliance = problem.compliance();
    let preconditioned = |r: &[f64]| -> Vec<f64> {
        let each = r.iter().zip(compliance);
        each.map(|(r, c)| if *c > 0.0 { r / c } else { 0.0 })
            .collect()
    };
    let mut rest = preconditioned(missing);
    let mut delta = vec![0.0; rest.len()];
    let size = dot(&rest, missing);
    if !size.is_finite() {
        return vec![f64::NAN; rest.len()];
    }
    let mut p = rest.clone();
    let mut image = times(&p);
    let mut along_rest = dot(&rest, &image);
    for _ in 0..steps {
        if !(along_rest > ROUNDING * size) {
            break;
        }
        let weighted = preconditioned(&image);
        let part = along_rest / dot(&image, &weighted);
        add_times(part, &p, &mut delta);
        add_times(-part, &weighted, &mut rest);
        let of_rest = times(&rest);
        let before = std::mem::replace(&mut along_rest, dot(&rest, &of_rest));
        let factor = along_rest / before;
        (p.iter_mut().zip(&rest)).for_each(|(p, z)| *p = z + factor * *p);
        (image.iter_mut().zip(&of_rest)).for_each(|(image, z)| *image = z + factor * *image);
    }
    delta
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::ContactData;
    use crate::sparse::{BlockCsr, Csr};

    /// Four nodes on springs of stiffness 1, pressed onto two unknowns of stiffness `under` that each meet two of them.
    fn four_on_two(under: f64) -> ContactProblem {
        let entries = (0..4).flat_map(|i| [(i, i, 1.0), (i, 4 + i / 2, -1.0)]);
        ContactProblem::new(ContactData {
            stiffness: BlockCsr::from_triplets(
                6,
                6,
                (0..6).map(|i| (i, i, if i < 4 { 1.0 } else { under })),
            ),
            load: [[1.0; 4].as_slice(), &[0.0; 2]].concat(),
            normal: Csr::from_triplets(4, 6, entries),
            tangential: Csr::from_triplets(4, 6, []),
            gap: vec![0.0; 4],
            slip_bound: vec![0.0; 4],
            coordinates: None,
        })
        .unwrap_or_else(|error| panic!("{error}"))
    }

    /// (B D⁻¹ Bᵀ) has the blocks 1 + J/under, J all ones. Its inverse is (1 + 2/under)⁻¹ for equal forces on both nodes
    /// of a pair, and 1 for opposite ones, however soft the other side is.
    #[test]
    fn a_side_unseen_by_the_other_closes_by_itself() {
        let problem = four_on_two(1e-3);
        let closed = |missing: [f64; 4]| close_alone(&problem, &[missing, [0.0; 4]].concat(), 10);
        let found = closed([1.0, 1.0, 1.0, -1.0]);
        for (found, expected) in found.iter().zip([1.0 / 2001.0, 1.0 / 2001.0, 1.0, -1.0]) {
            assert!((found - expected).abs() < 1e-9, "{found} {expected}");
        }
        let one = closed([1.0, 0.0, 0.0, 0.0]);
        assert!((one[0] - 1.0 / 1001.0).abs() < 1e-9 && one[1..] == [0.0; 7]);
        assert_eq!(closed([0.0; 4]), [0.0; 8]);
    }

    #[test]
    fn a_solve_ends_by_its_certificate() {
        let mut goal = Goal::new(&NewtonSettings::default());
        goal.err = 1.0;
        let judge = |goal: &Goal, [accurate, hidden]: [bool; 2]| {
            goal.judge(&Evidence {
                err: 2.0,
                accurate,
                hidden,
                kkt: None,
            })
        };
        assert_eq!(judge(&goal, [true, true]), Verdict::Check);
        assert_eq!(judge(&goal, [false, true]), Verdict::MakeExact);
        assert_eq!(judge(&goal, [false, false]), Verdict::GoOn);
        let checked = |goal: &Goal, err: f64, accurate: bool, [equilibrium, slip]: [f64; 2]| {
            let kkt = Kkt {
                equilibrium,
                slip,
                ..Kkt::default()
            };
            goal.judge(&Evidence {
                err,
                accurate,
                hidden: false,
                kkt: Some(kkt),
            })
        };
        let (done, again) = (Verdict::Done, Verdict::Refreshed);
        assert_eq!(
            checked(&goal, 1.0, true, [9e-6; 2]),
            done(Status::Converged)
        );
        // An error, forces or slip that further steps may improve; NaN is not among them.
        for (err, accurate, slip) in [(1.1, true, 0.0), (1.0, false, 0.0), (1.0, true, 1.1e-5)] {
            assert_eq!(checked(&goal, err, accurate, [0.0, slip]), again);
        }
        for equilibrium in [1.1e-5, f64::NAN] {
            let verdict = checked(&goal, 1.0, true, [equilibrium, 0.0]);
            assert_eq!(verdict, done(Status::Stagnated));
        }
        goal.checks = goal.numbers.checks;
        assert_eq!(checked(&goal, 1.1, true, [0.0; 2]), done(Status::Stagnated));
    }

    #[test]
    fn gaps_are_forces_that_are_missing() {
        let goal = Goal::new(&NewtonSettings::default());
        let problem = four_on_two(1e-3);
        let mut lambda = vec![1.0; 8];
        lambda[4..].fill(0.0);
        let met = |lambda: &[f64], r: [f64; 4]| {
            let r = [r, [0.0; 4]].concat();
            goal.forces_met(&problem, lambda, &r, &[0.0; 8])
        };
        assert!(met(&lambda, [0.0; 4]));
        // 0.9e-3 of the largest pressure, and 1.1e-3, where 1e-3 is asked for: together, then against each other.
        assert!(met(&lambda, [0.0009 * 2001.0; 4]) && !met(&lambda, [0.0011 * 2001.0; 4]));
        let apart = |size: f64| [size, -size, 0.0, 0.0];
        assert!(met(&lambda, apart(0.0009)) && !met(&lambda, apart(0.0011)));
        assert!(!met(&lambda, [f64::NAN, 0.0, 0.0, 0.0]));
        // A node without force stays open, and closes.
        lambda[0] = 0.0;
        assert!(!met(&lambda, [f64::NAN, 0.0, 0.0, 0.0]));
        assert!(met(&lambda, [5000.0, 0.0, 0.0, 0.0]) && !met(&lambda, [-5000.0, 0.0, 0.0, 0.0]));
        // Rounding of a displacement of 10⁹ is 7e-6. Forces that close smaller gaps count as zero; slightly
        // larger ones are not accurate enough.
        let near = four_on_two(1e-3);
        let mut case = near.load_case().clone();
        case.travelled = Some(vec![1e9; 6].into());
        let far = near.under(case);
        for (size, expected) in [(1e-8, true), (1e-6, false), (1.0, true)] {
            let lambda: Vec<f64> = lambda.iter().map(|l| size * l).collect();
            assert_eq!(
                goal.forces_met(&far, &lambda, &[0.0; 8], &[0.0; 8]),
                expected,
                "{size:e}"
            );
            // The same holds if B u is a difference of displacements of that size.
            assert_eq!(
                goal.forces_met(&near, &lambda, &[0.0; 8], &[1e9; 8]),
                expected,
                "{size:e}"
            );
        }
    }

    #[test]
    fn pressures_that_are_rounding_of_tractions_measure_nothing() {
        let problem = ContactProblem::<2>::new(ContactData {
            stiffness: BlockCsr::from_triplets(2, 2, (0..2).map(|i| (i, i, 1.0))),
            load: vec![0.0, 1.0],
            normal: Csr::from_triplets(1, 2, [(0, 0, 1.0)]),
            tangential: Csr::from_triplets(1, 2, [(0, 1, 1.0)]),
            gap: vec![0.0],
            slip_bound: vec![2.0],
            coordinates: None,
        })
        .unwrap_or_else(|error| panic!("{error}"));
        let goal = Goal::new(&NewtonSettings::default());
        for (traction, expected) in [(0.0, false), (1.0, true)] {
            let met = goal.forces_met(&problem, &[1e-20, traction], &[-1e-17, 0.0], &[0.0; 2]);
            assert_eq!(met, expected, "{traction}");
        }
    }
}
