//! The free multipliers in an outer step, their motion, and the curvature of circles in space.

use super::law::Law;
use super::point::Point;
use super::sets::Sets;
use crate::constraint::{at, row_of};
use crate::dual::balance::{Balance, FaceBalance};
use std::rc::Rc;

/// The unknowns y of a step: λ moves by F y.
///
/// F y has y on the free multipliers. On a node in contact that slips under Coulomb's law, λτ = μλν s: there the
/// tangential multipliers follow the normal one.
///
/// In space λτ of a slipping node moves along the tangent t of its circle. Complementarity on the circle is
/// rτ + κλτ = 0 with κ ≥ 0; linearised along t, the inner problem (11) gets the curvature κ there:
/// min ½ zᵀ(A + diag κ)z + zᵀr. It costs no product with A.
pub(super) struct Face<const D: usize> {
    pub sets: Sets<D>,
    /// μ where the tangential multipliers follow the normal one, 0 at all other nodes; empty if there is no such node.
    follows: Vec<f64>,
    /// The curvature of circles, if any.
    curvature: Option<Curvature>,
    /// G F, where bodies can move as a whole.
    balance: Option<FaceBalance<D>>,
}

/// The curvature term added to A on slipping nodes in space.
struct Curvature {
    /// κ of each node, 0 where nothing turns.
    kappa: Vec<f64>,
    /// The typical entry of diag(A): c.
    mean: f64,
}

impl<const D: usize> Face<D> {
    /// Without its curvature: [`Face::set_curvature`].
    pub fn new(sets: Sets<D>, law: &Law, balance: Option<&Rc<Balance>>) -> Self {
        let nodes = sets.nodes().iter().enumerate();
        let mu = nodes.map(|(i, node)| match node.slip {
            Some(_) if node.contact => law.of(i).mu(),
            _ => 0.0,
        });
        let mut follows: Vec<f64> = mu.collect();
        if follows.iter().all(|&mu| mu == 0.0) {
            follows.clear();
        }
        let balance = balance.map(|balance| balance.on_face(sets.nodes(), &follows));
        Self {
            sets,
            follows,
            curvature: None,
            balance,
        }
    }

    /// Linearises the circles at a point on the face. `mean` is the typical entry of diag(A).
    pub fn set_curvature(&mut self, point: &Point, mean: f64) {
        if self.sets.turn() {
            self.curvature = Some(Curvature::new(&self.sets, point, mean));
        }
    }

    /// μ where the tangential multipliers of node i (of m) follow the normal one.
    fn follows(&self, i: usize) -> Option<f64> {
        self.follows.get(i).copied().filter(|&mu| mu != 0.0)
    }

    /// Whether F = Z: no tangential multipliers follow normal ones.
    pub fn is_symmetric(&self) -> bool {
        self.follows.is_empty()
    }

    /// Turns y, arbitrary on other multipliers, into an F y that leaves the bodies in balance.
    pub fn direction(&self, y: &mut [f64]) {
        self.lift(y);
        if let Some(balance) = &self.balance {
            balance.project(y);
        }
    }

    /// That of a tangent of node i.
    fn row(&self, i: usize, a: usize) -> usize {
        row_of::<D>(self.sets.nodes().len(), i, a)
    }

    fn lift(&self, y: &mut [f64]) {
        self.sets.mask(y);
        for (i, node) in self.sets.nodes().iter().enumerate() {
            let (Some(mu), Some(s)) = (self.follows(i), node.slip) else {
                continue;
            };
            let normal = y[i];
            for a in 1..D {
                y[self.row(i, a)] += s[a] * mu * normal;
            }
        }
    }

    /// The part of a gradient that a step has to remove: on the free multipliers, without motions of the bodies.
    pub fn residual(&self, r: &mut [f64]) {
        self.sets.mask(r);
        if let Some(balance) = &self.balance {
            balance.project_residual(r);
        }
    }

    /// Balances the bodies by the free multipliers; false if that is impossible.
    pub fn balance(&self, lambda: &mut [f64]) -> bool {
        self.balance
            .as_ref()
            .is_none_or(|balance| balance.balance(lambda))
    }

    /// From A p to (A + diag κ) p.
    pub fn add_curvature(&self, p: &[f64], image: &mut [f64]) {
        let Some(Curvature { kappa, .. }) = &self.curvature else {
            return;
        };
        for (i, (&kappa, node)) in kappa.iter().zip(self.sets.nodes()).enumerate() {
            let along: [f64; D] = node.free_part(at(p, i));
            for a in 1..if kappa == 0.0 { 1 } else { D } {
                image[self.row(i, a)] += kappa * along[a];
            }
        }
    }

    /// From a residual p on the face to c (c + κ)⁻¹ p: κ has no bound, and diag(c + κ) makes the model well-conditioned
    /// in spite of it.
    pub fn precondition(&self, p: &mut [f64]) {
        let Some(Curvature { kappa, mean, .. }) = &self.curvature else {
            return;
        };
        for (i, &kappa) in kappa.iter().enumerate().filter(|(_, kappa)| **kappa != 0.0) {
            let weight = mean / (mean + kappa);
            (1..D).for_each(|a| p[self.row(i, a)] *= weight);
        }
        self.direction(p);
    }
}

impl Curvature {
    /// κ = max(0, −λτᵀrτ/‖λτ‖²) where λτ turns.
    fn new<const D: usize>(sets: &Sets<D>, point: &Point, mean: f64) -> Self {
        let kappa = sets.nodes().iter().enumerate().map(|(i, node)| {
            let (lambda, r): ([f64; D], [f64; D]) = (at(&point.lambda, i), at(&point.r, i));
            let dot = |x: [f64; D], y: [f64; D]| (1..D).map(|a| x[a] * y[a]).sum::<f64>();
            let square = dot(lambda, lambda);
            if node.turns && square > 0.0 {
                (-dot(lambda, r) / square).max(0.0)
            } else {
                0.0
            }
        });
        Self {
            kappa: kappa.collect(),
            mean,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::constraint::{Disc, put};

    /// Two nodes, one that slips and one that sticks, and a full A.
    fn gradient(lambda: &[f64]) -> Vec<f64> {
        (0..6)
            .map(|i| {
                let entry = |j: usize| {
                    if i == j {
                        3.0
                    } else {
                        1.0 / (1.0 + (i + j) as f64)
                    }
                };
                (0..6).map(|j| entry(j) * lambda[j]).sum::<f64>() - 2.0 - 0.3 * i as f64
            })
            .collect()
    }

    fn point(lambda: Vec<f64>) -> Point {
        Point {
            r: gradient(&lambda),
            lambda,
            motion: Vec::new(),
        }
    }

    /// Back on the circle after a step along the tangent, q is that of the model up to the third order.
    #[test]
    fn the_model_is_q_along_the_circle() {
        let g = [0.5, 9.0];
        let start = point(vec![0.4, 0.2, 0.3, 0.4, 0.1, -0.2]);
        let sets = Sets::<3>::binding(&start.lambda, &start.r, &g);
        let mut face = Face {
            sets,
            follows: Vec::new(),
            curvature: None,
            balance: None,
        };
        face.set_curvature(&start, 1.0);
        let kappa = face.curvature.as_ref().map(|c| c.kappa[0]);
        assert!(kappa.is_some_and(|kappa| kappa > 0.1), "{kappa:?}");

        let mut along = vec![0.3, -0.7, 1.0, -0.2, 0.6, 0.5];
        face.direction(&mut along);
        // Within the face nothing moves across the circle.
        assert!((0.6 * along[2] + 0.8 * along[3]).abs() < 1e-15);
        let off = |t: f64| {
            let moved = |back: bool| {
                let mut lambda = start.lambda.clone();
                lambda.iter_mut().zip(&along).for_each(|(l, a)| *l += t * a);
                if back {
                    let projected = Disc { g: 0.5 }.project::<3>(at(&lambda, 0));
                    put(&mut lambda, 0, projected);
                }
                point(lambda)
            };
            let mut curved = vec![0.0; 6];
            face.add_curvature(&along, &mut curved);
            let straight = start.q_change(&moved(false));
            let bent: f64 = along.iter().zip(&curved).map(|(a, c)| a * c).sum();
            (start.q_change(&moved(true)) - straight - 0.5 * t * t * bent).abs()
        };
        let (coarse, fine) = (off(1e-2), off(1e-3));
        assert!(coarse < 1e-5 && fine < 2e-3 * coarse, "{coarse:e} {fine:e}");
    }
}
