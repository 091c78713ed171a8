//! Small problems made by hand, for the consistency of the parts of the method: products, scaling, points, laws, the
//! final check.

use super::law::Law;
use super::point::Point;
use super::products::Products;
use super::scaling::Scaled;
use super::*;
use crate::constraint::SlipBound;
use crate::control::{Accuracy, Correction, Costs, Stop};
use crate::dual::{DirectDual, DualError, Request};
use crate::problem::ContactData;
use crate::sparse::{BlockCsr, Csr};
use std::cell::Cell;
use std::ops::ControlFlow;
use std::rc::Rc;

/// Nodes on springs of their own stiffness, tied to their neighbours by some of stiffness 1, and pressed onto the ground: the
/// first unknown of each is its normal one.
fn row_of_nodes(own: &[f64], bound: f64) -> ContactProblem {
    let m = own.len();
    let ties = (1..m).flat_map(|i| [(i - 1, i), (i, i - 1)]);
    let tie = |i: usize| (usize::from(i > 0) + usize::from(i + 1 < m)) as f64;
    let normal = (0..m).map(|i| (2 * i, 2 * i, own[i] + tie(i)));
    let tangential = (0..m).map(|i| (2 * i + 1, 2 * i + 1, own[i]));
    let entries = (normal.chain(tangential)).chain(ties.map(|(i, j)| (2 * i, 2 * j, -1.0)));
    let rows = |first: usize| Csr::from_triplets(m, 2 * m, (0..m).map(|i| (i, 2 * i + first, 1.0)));
    ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(2 * m, 2 * m, entries),
        load: (0..2 * m).map(|i| 1.0 + (i % 3) as f64).collect(),
        normal: rows(0),
        tangential: rows(1),
        gap: (0..m).map(|i| 0.1 * (i % 2) as f64).collect(),
        slip_bound: vec![bound; m],
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"))
}

fn factor(problem: &ContactProblem) -> DirectDual {
    DirectDual::new(problem).unwrap_or_else(|error| panic!("{error}"))
}

/// An operator whose products and displacements are too long by a part, and that may pass for an iterative one.
struct Off {
    of: DirectDual,
    by: f64,
    displaced: f64,
    iterates: Option<Correction>,
    /// The accuracy of the last request.
    asked: Rc<Cell<Option<Accuracy>>>,
}

impl DualOperator for Off {
    fn size(&self) -> (usize, usize) {
        self.of.size()
    }

    fn apply(
        &mut self,
        p: &[f64],
        y: &mut [f64],
        accuracy: Accuracy,
        stop: &Stop,
    ) -> Result<(), DualError> {
        self.asked.set(Some(accuracy));
        self.of.apply(p, y, accuracy, stop)?;
        y.iter_mut().for_each(|y| *y *= 1.0 + self.by);
        Ok(())
    }

    fn restrict(&self, u: &[f64], y: &mut [f64]) {
        self.of.restrict(u, y);
    }

    fn at_contact(&mut self, request: &Request, y: &mut [f64]) -> Result<Correction, DualError> {
        if self.is_exact() {
            return self.of.at_contact(request, y);
        }
        self.asked.set(Some(request.accuracy));
        y.fill(-1.0);
        Ok(self.iterates.unwrap_or_default())
    }

    fn is_exact(&self) -> bool {
        self.iterates.is_none()
    }

    fn displacement(&mut self, request: &Request) -> Result<Vec<f64>, DualError> {
        let mut u = self.of.displacement(request)?;
        u.iter_mut().for_each(|u| *u *= 1.0 + self.displaced);
        Ok(u)
    }

    fn stiffness_times(&mut self, u: &[f64], s: &[f64]) -> Result<[Vec<f64>; 2], DualError> {
        self.of.stiffness_times(u, s)
    }

    fn costs(&self) -> Option<Costs> {
        self.iterates.map(|_| Costs::default())
    }
}

fn solved(
    problem: &ContactProblem,
    dual: &mut impl DualOperator,
    settings: &NewtonSettings,
) -> Solution {
    solve(problem, dual, settings, |_| ControlFlow::Continue(()))
        .unwrap_or_else(|error| panic!("{error}"))
}

/// The final check reads K: products that are off by a twentieth cost steps, not the answer.
#[test]
fn wrong_products_are_found_out() {
    let problem = row_of_nodes(&[1.0, 2.0, 0.5, 1.0, 3.0, 1.0], 0.7);
    let right = solved(&problem, &mut factor(&problem), &NewtonSettings::default());
    assert_eq!(right.status, Status::Converged);
    for method in [Method::Multisecant, Method::Inexact, Method::Exact] {
        let mut off = Off {
            of: factor(&problem),
            by: 0.05,
            displaced: 0.0,
            iterates: None,
            asked: Rc::default(),
        };
        let settings = NewtonSettings {
            method,
            ..NewtonSettings::default()
        };
        let found = solved(&problem, &mut off, &settings);
        assert_eq!(found.status, Status::Converged, "{method:?}");
        assert!(found.info.kkt.max() <= 1e-5, "{method:?}");
        for (a, b) in found.lambda.iter().zip(&right.lambda) {
            assert!((a - b).abs() < 1e-5, "{method:?}: {a} {b}");
        }
    }
}

/// No step can repair a u that is not in equilibrium.
#[test]
fn a_point_that_k_refutes_is_not_a_solution() {
    let problem = row_of_nodes(&[1.0, 2.0, 0.5], 0.7);
    for (displaced, expected) in [(1e-7, Status::Converged), (1e-4, Status::Stagnated)] {
        let mut off = Off {
            of: factor(&problem),
            by: 0.0,
            displaced,
            iterates: None,
            asked: Rc::default(),
        };
        let found = solved(&problem, &mut off, &NewtonSettings::default());
        assert_eq!(found.status, expected, "{displaced:e}");
        assert!(
            (found.info.kkt.equilibrium / displaced - 1.0).abs() < 0.5,
            "{displaced:e}"
        );
    }
}

/// An unreachable accuracy is not reported as reached.
#[test]
fn a_goal_below_rounding_ends_without_one() {
    let problem = row_of_nodes(&[1.0, 1e-9, 1.0, 1e9], 0.3);
    let settings = NewtonSettings {
        tolerance: 1e-300,
        ..NewtonSettings::default()
    };
    let found = solved(&problem, &mut factor(&problem), &settings);
    // Or it is met to the last bit.
    assert!(
        found.status == Status::Stagnated || found.info.kkt.max() == 0.0,
        "{:?}",
        found.info
    );
}

#[test]
fn products_are_as_accurate_as_the_error_needs_them() {
    let problem = row_of_nodes(&[1.0, 2.0], 0.5);
    let settings = NewtonSettings::default();
    let mut off = Off {
        of: factor(&problem),
        by: 0.0,
        displaced: 0.0,
        iterates: Some(Correction {
            change: 0.5,
            remaining: 0.01,
            slow: false,
        }),
        asked: Rc::default(),
    };
    let energy = |absolute: f64, relative: f64| Some(Accuracy::Energy { absolute, relative });
    let asked = Rc::clone(&off.asked);
    let dual = Scaled::new(&problem, &mut off, 0.5);
    // √σ_max = 2 is the effect of a change of u in energy on r.
    let mut products = Products::new(dual, problem.load_case(), &settings, Stop::default(), 4.0);
    assert_eq!((products.part(), products.are_exact()), (0.1, false));
    let lambda = [0.0; 4];
    let made = |made: Result<Option<Vec<f64>>, DualError>| made.unwrap_or_else(|e| panic!("{e}"));
    // A tenth of an error of 3.
    let r = made(products.afresh(&lambda, 0.0, 3.0, &[1.0, 1.1, 1.0, 0.0]));
    assert_eq!(r, Some(vec![1.0, 1.1, 1.0, 1.0]));
    let Some(Accuracy::Energy { absolute, .. }) = asked.get() else {
        panic!("it was asked for an error in energy");
    };
    assert!((absolute - 0.1 * 3.0 / 2.0).abs() < 1e-12);
    // It has moved by 1 where u has moved by 0.5: the next one by 2 for 1, and 0.01 that remain are 0.02.
    assert!(products.is_enough(0.11) && !products.is_enough(0.09));
    made(products.afresh(&lambda, 0.0, 3.0, &[1.0, 1.1, 1.0, 1.0]));
    let Some(Accuracy::Energy { absolute, .. }) = asked.get() else {
        panic!("it was asked for an error in energy");
    };
    assert!((absolute - 0.1 * 3.0 / 2.0).abs() < 1e-12);
    // More accurate products, and an r more accurate by as much, down to the tolerance.
    assert!(products.tighten(1e-6) && (products.part() - 0.03).abs() < 1e-15);
    products
        .apply(&[1.0; 4])
        .unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        (products.n_a, asked.get()),
        (1, energy(0.0, products.part()))
    );
    made(products.afresh(&lambda, 0.0, 3.0, &[1.0, 1.1, 1.0, 1.0]));
    let Some(Accuracy::Energy { absolute, .. }) = asked.get() else {
        panic!("it was asked for an error in energy");
    };
    assert!((absolute - 0.03 * 3.0 / 2.0).abs() < 1e-12);
    assert!((0..20).any(|_| !products.tighten(1e-6)) && products.part() > 2e-7);
    // A factor is exact from the first product on.
    let mut exact = factor(&problem);
    let dual = Scaled::new(&problem, &mut exact, 0.5);
    let mut products = Products::new(dual, problem.load_case(), &settings, Stop::default(), 4.0);
    assert_eq!((products.part(), products.tighten(1e-6)), (0.0, false));
    assert_eq!(made(products.afresh(&lambda, 0.0, 3.0, &lambda)), None);
    assert!(products.are_exact());
}

/// In powers of two, by the root of how much softer or stiffer than the median a node is. Within a factor of four, the
/// bound included, not at all.
#[test]
fn multipliers_are_scaled_where_stiffness_varies() {
    let own = [1.0, 1.0, 1.0, 4.0, 0.25, 100.0, 1e-6];
    let m = own.len();
    let entries = (0..2 * m).map(|i| (i, i, own[i / 2]));
    let rows = |first: usize| Csr::from_triplets(m, 2 * m, (0..m).map(|i| (i, 2 * i + first, 1.0)));
    let problem: ContactProblem = ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(2 * m, 2 * m, entries),
        load: vec![1.0; 2 * m],
        normal: rows(0),
        tangential: rows(1),
        gap: vec![0.0; m],
        slip_bound: vec![6.0; m],
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"));
    let mut dual = factor(&problem);
    let mut scaled = Scaled::new(&problem, &mut dual, Numbers::default().scaling);
    let expected = [1.0, 1.0, 1.0, 1.0, 1.0, 8.0, 1.0 / 512.0];
    for (i, s) in expected.iter().enumerate() {
        assert_eq!((scaled.factor(i), scaled.factor(m + i)), (*s, *s), "{i}");
    }
    let law = Law::new(&problem, &scaled);
    assert_eq!(law.of(5), SlipBound::Given(6.0 / 8.0));
    // Â = S A S, and back and forth is exact.
    let y = scaled
        .apply(&vec![1.0; 2 * m], Accuracy::Residual(0.0), &Stop::default())
        .unwrap_or_else(|error| panic!("{error}"));
    for (i, s) in expected.iter().enumerate() {
        assert!(
            (y[i] - s * s / own[i]).abs() < 1e-12 * y[i],
            "{i}: {}",
            y[i]
        );
    }
    let mut x = vec![0.1; 2 * m];
    scaled.times(&mut x);
    scaled.divide(&mut x);
    assert_eq!(x, vec![0.1; 2 * m]);
}

/// In space both tangents of a node have the factor of the softer one, so that a disc stays a disc. Directions without
/// sliding are unchanged. b̂ = S b and ĝ = S⁻¹ g by hand, and displacements are those of λ = S λ̂.
#[test]
fn both_tangents_of_a_node_are_scaled_alike() {
    // Springs of the three unknowns of each node; the last one has no tangents.
    let own = [
        [1.0, 1.0, 1.0],
        [1.0, 1.0, 1.0],
        [64.0, 16.0, 1.0 / 64.0],
        [1.0, 1.0, 1.0],
    ];
    let m = own.len();
    let entries = (0..3 * m).map(|i| (i, i, own[i / 3][i % 3]));
    let sliding = (0..m - 1).flat_map(|i| [0, 1].map(|a| (2 * i + a, 3 * i + 1 + a, 1.0)));
    let problem: ContactProblem<3> = ContactProblem::new(ContactData {
        stiffness: BlockCsr::from_triplets(3 * m, 3 * m, entries),
        load: vec![32.0; 3 * m],
        normal: Csr::from_triplets(m, 3 * m, (0..m).map(|i| (i, 3 * i, 1.0))),
        tangential: Csr::from_triplets(2 * m, 3 * m, sliding),
        gap: vec![0.25; m],
        slip_bound: vec![3.0, 3.0, 3.0, 0.0],
        coordinates: None,
    })
    .unwrap_or_else(|error| panic!("{error}"));
    let mut dual = DirectDual::new(&problem).unwrap_or_else(|error| panic!("{error}"));
    let scaled = Scaled::new(&problem, &mut dual, Numbers::default().scaling);
    // 64 times as stiff is a factor of 8, up to the tiny amount by which the power is below ½: the power of two below
    // is 4.
    let normal = [1.0, 1.0, 4.0, 1.0];
    let tangential = [1.0, 1.0, 1.0, 1.0, 0.25, 0.25, 1.0, 1.0];
    let scale = [&normal[..], &tangential].concat();
    for (i, s) in scale.iter().enumerate() {
        assert_eq!(scaled.factor(i), *s, "{i}");
    }
    let law = Law::new(&problem, &scaled);
    assert_eq!(law.bounds(&[0.0; 12]), [3.0, 3.0, 12.0, 0.0]);
    // b is f / K of the unknown, less the gap: 0.5 − 0.25 of the stiff one.
    let stop = Stop::default();
    let settings = NewtonSettings::default();
    let mut products = Products::new(scaled, problem.load_case(), &settings, stop, 1.0);
    let r = products
        .first(&vec![0.0; 3 * m])
        .unwrap_or_else(|error| panic!("{error}"));
    let expected = [
        31.75, 31.75, 1.0, 31.75, 32.0, 32.0, 32.0, 32.0, 0.5, 512.0, 0.0, 0.0,
    ];
    for (i, (r, expected)) in r.iter().zip(expected).enumerate() {
        assert!((r + expected).abs() < 1e-12 * 32.0, "{i}: {r}");
    }
    // λ̂ = 1 is λ = 4 on the stiff spring: (32 − 4) / 64.
    let u = products
        .displacement(&vec![1.0; 3 * m], 0.0, &stop)
        .unwrap_or_else(|error| panic!("{error}"));
    for (i, expected) in [(6, 28.0 / 64.0), (7, 31.75 / 16.0), (8, 31.75 * 64.0)] {
        assert!((u[i] - expected).abs() < 1e-12 * expected, "{i}: {}", u[i]);
    }
}

/// q(λ) = ½ λᵀAλ − λᵀb with A = diag(2, 4), b = (2, 4), on the way from 0 to (2, 0).
#[test]
fn q_is_known_on_a_chord() {
    let point = |lambda: [f64; 2]| Point {
        r: vec![2.0 * lambda[0] - 2.0, 4.0 * lambda[1] - 4.0],
        lambda: lambda.to_vec(),
        motion: Vec::new(),
    };
    let q = |l: [f64; 2]| l[0] * l[0] + 2.0 * l[1] * l[1] - 2.0 * l[0] - 4.0 * l[1];
    let (start, end) = (point([0.0, 0.0]), point([3.0, 0.5]));
    assert!((start.q_change(&end) - q([3.0, 0.5])).abs() < 1e-15);
    assert!(start.q_rounding(&end) > 0.0 && start.q_rounding(&end) < 1e-13);
    // Slope −8, curvature 19.
    let part = start.lowest_part(&end);
    assert!((part - 8.0 / 19.0).abs() < 1e-15);
    let there = start.towards(&end, part);
    assert!(start.q_change(&there) < start.q_change(&start.towards(&end, part + 0.01)));
    assert!(start.q_change(&there) < start.q_change(&start.towards(&end, part - 0.01)));
    assert_eq!(start.lowest_part(&start.towards(&end, 0.1)), 1.0);
    assert_eq!(start.lowest_part(&point([-1.0, 0.0])), 0.0);
}

/// The derivative of a node's solution, and that it is one, for each law, apart, sticking and slipping.
fn laws_of_a_node<const D: usize>() {
    let numbers = crate::dual::scatter(60 * D);
    for law in [
        SlipBound::Given(0.0),
        SlipBound::Given(0.6),
        SlipBound::Coulomb(0.4),
        SlipBound::Tied,
    ] {
        for z in numbers.chunks(D) {
            let z: [f64; D] = std::array::from_fn(|a| 2.0 * z[a]);
            let (end, derivative) = law.solve::<D>(z);
            let length = end[1..].iter().map(|t| t * t).sum::<f64>().sqrt();
            let is_tied = law == SlipBound::Tied;
            assert_eq!(end[0], if is_tied { z[0] } else { z[0].max(0.0) });
            assert!(length <= law.disc(end[0]).g * (1.0 + 1e-15));
            for b in 0..D {
                let step = 1e-6;
                let at = |sign: f64| {
                    let mut there = z;
                    there[b] += sign * step;
                    law.solve::<D>(there).0
                };
                let (above, below) = (at(1.0), at(-1.0));
                for a in 0..D {
                    let slope = (above[a] - below[a]) / (2.0 * step);
                    assert!((slope - derivative[a][b]).abs() < 1e-5, "{z:?}: {a}, {b}");
                }
            }
        }
    }
}

#[test]
fn a_node_is_solved_exactly() {
    laws_of_a_node::<2>();
    laws_of_a_node::<3>();
}
