//! The inner problem (11): Step 3.3, by conjugate gradients or, under Coulomb's law, conjugate residuals.

use super::face::Face;
use super::newton::Newton;
use super::point::Point;
use crate::dual::DualError;
use crate::rounding::{DEPENDENT, INDEPENDENT};
use crate::sparse::{add_times, dot, norm};

impl<const D: usize> Newton<'_, D> {
    /// Lowers the residual on the free multipliers of a face to `target`; returns the number of iterations.
    pub fn solve_inner(
        &mut self,
        point: &mut Point,
        mut face: Face<D>,
        target: f64,
    ) -> Result<usize, DualError> {
        face.set_curvature(point, self.mean);
        let products = &mut self.products;
        minimise(
            point,
            &face,
            target,
            DEPENDENT * self.gauge.sigma,
            |p| match products.stop.now() {
                Some(_) => Ok(None),
                None => products.apply(p).map(Some),
            },
        )
    }
}

/// CGM(A, b, 𝒜, λ, tol): lowers Zᵀr on the free multipliers, Z their columns, until its norm is at most `target`; λ moves by F y.
/// `product` is A p, or None to stop. A direction along which A curves q by less than `flat` is only rounding.
///
/// All directions p = F y are kept with the free part of A p, q = Zᵀ A p, and each step is the best on their span.
/// - F = Z: with pᵢᵀqⱼ = 0 it minimises q(λ). These are the conjugate gradients of the paper.
/// - Under Coulomb's law, λτ = sμλν on a node that slips in the direction s, and Zᵀ A F is not symmetric. With qᵢᵀqⱼ =
///   0 it minimises ‖Zᵀr‖ (generalised conjugate residuals: Eisenstat, Elman and Schultz 1983).
///
/// Where circles curve, A is A + diag κ, and the residual is preconditioned. It also ends when a direction or its image adds
/// nothing new, and after somewhat more than twice as many iterations as there are free multipliers. Returns their number.
fn minimise<const D: usize, E>(
    point: &mut Point,
    face: &Face<D>,
    target: f64,
    flat: f64,
    mut product: impl FnMut(&[f64]) -> Result<Option<Vec<f64>>, E>,
) -> Result<usize, E> {
    let mut known: Vec<Direction> = Vec::new();
    // The vectors orthogonal to the q of others: p or q.
    let own = if face.is_symmetric() { 0 } else { 3 };
    // On the way r is the gradient of the model: at the λ where circles are linearised the two are the same.
    let mut r = point.r.clone();
    let mut stuck: Option<Vec<f64>> = None;
    // As many as exact arithmetic would need, and some for rounding.
    let most = 2 * face.sets.n_free() + 50;
    for iteration in 0..most {
        let mut rest = r.clone();
        face.residual(&mut rest);
        let residual = norm(&rest);
        if residual <= target {
            return Ok(iteration);
        }
        // If the residual does not fall along itself, its image is an untried direction.
        let mut p = stuck
            .take()
            .unwrap_or_else(|| rest.iter().map(|r| -r).collect());
        face.direction(&mut p);
        face.precondition(&mut p);
        if !(norm(&p) > 0.0) {
            return Ok(iteration);
        }
        let Some(image) = product(&p)? else {
            return Ok(iteration);
        };
        let mut curved = image.clone();
        face.add_curvature(&p, &mut curved);
        let mut seen = curved.clone();
        face.residual(&mut seen);
        let Some(new) = conjugate([p, image, curved, seen], &known, own, flat) else {
            return Ok(iteration + 1);
        };
        let step = -dot(&new[own], &r);
        add_times(step, &new[0], &mut point.lambda);
        add_times(step, &new[1], &mut point.r);
        add_times(step, &new[2], &mut r);
        if !face.is_symmetric() && step.abs() < INDEPENDENT * residual {
            stuck = Some(new[3].iter().map(|v| v * residual).collect());
        }
        known.push(new);
    }
    Ok(most)
}

/// p, A p, that with the curvature of circles, and q.
type Direction = [Vec<f64>; 4];

/// Makes a direction conjugate to the known ones, with length one; None if it adds nothing new.
fn conjugate(mut new: Direction, known: &[Direction], own: usize, flat: f64) -> Option<Direction> {
    let before = norm(&new[3]);
    for _ in 0..2 {
        for old in known {
            let c = dot(&old[own], &new[3]);
            for (new, old) in new.iter_mut().zip(old) {
                add_times(-c, old, new);
            }
        }
    }
    let curvature = dot(&new[own], &new[3]);
    // Written so that NaN is refused.
    let is_curved = curvature > flat * norm(&new[own]) * norm(&new[0]);
    let scale = 1.0 / curvature.sqrt();
    let is_new = is_curved && norm(&new[3]) > INDEPENDENT * before;
    new.iter_mut().flatten().for_each(|v| *v *= scale);
    is_new.then_some(new)
}

#[cfg(test)]
mod tests {
    use super::super::law::Law;
    use super::super::sets::Sets;
    use super::*;
    use std::convert::Infallible;

    /// A full A on three nodes of the plane, positive definite, and b.
    fn times_a(x: &[f64]) -> Vec<f64> {
        let entry = |i: usize, j: usize| match i == j {
            true => 3.0,
            false => 1.0 / (1.0 + (i + j) as f64),
        };
        let row = |i: usize| (0..6).map(|j| entry(i, j) * x[j]).sum();
        (0..6).map(row).collect()
    }

    const B: [f64; 6] = [4.0, 3.0, -1.0, 2.0, 0.5, 1.5];

    fn gradient(lambda: &[f64]) -> Vec<f64> {
        let products = times_a(lambda);
        products.iter().zip(B).map(|(a, b)| a - b).collect()
    }

    /// The face of these sets, and the result on it from this λ.
    fn solved(law: &Law, z: [f64; 6], lambda: [f64; 6]) -> (Point, usize) {
        let g = law.bounds(&z);
        let sets = Sets::<2>::predict(&z, &[0.0; 6], 1.0, &g);
        let mut start = lambda.to_vec();
        sets.set_bounds(&mut start, law);
        let mut point = Point {
            r: gradient(&start),
            lambda: start,
            motion: Vec::new(),
        };
        let face = Face::new(sets, law, None);
        let Ok(iterations) = minimise(&mut point, &face, 1e-13, 1e-12, |p| {
            Ok::<_, Infallible>(Some(times_a(p)))
        });
        for (carried, made) in point.r.iter().zip(gradient(&point.lambda)) {
            assert!((carried - made).abs() < 1e-12, "{carried} {made}");
        }
        (point, iterations)
    }

    #[test]
    fn the_gradient_vanishes_on_free_multipliers_and_the_rest_stays() {
        // Two nodes stick; the third is apart, with its tangent at the bound.
        let law = Law::with(3, 0.5, 0.0);
        let (point, iterations) = solved(&law, [1.0, 1.0, -1.0, 0.1, -0.2, 9.0], [0.0; 6]);
        assert_eq!((point.lambda[2], point.lambda[5]), (0.0, 0.5));
        for i in [0, 1, 3, 4] {
            assert!(point.r[i].abs() < 1e-12, "{i}: {}", point.r[i]);
        }
        assert!(iterations <= 4, "{iterations}");
    }

    #[test]
    fn friction_follows_pressure_where_a_node_slips() {
        let law = Law::with(3, 0.0, 0.3);
        let (point, iterations) = solved(&law, [2.0, 1.0, -1.0, 5.0, 0.1, 0.0], [0.0; 6]);
        let l = &point.lambda;
        assert!((l[3] - 0.3 * l[0]).abs() < 1e-14 && l[0] > 0.1, "{l:?}");
        assert_eq!((l[2], l[5]), (0.0, 0.0));
        // The normal ones of both nodes, and the tangent of the one that sticks.
        for i in [0, 1, 4] {
            assert!(point.r[i].abs() < 1e-12, "{i}: {}", point.r[i]);
        }
        assert!(iterations <= 4, "{iterations}");
    }

    #[test]
    fn it_ends_without_resistance_and_on_request() {
        let law = Law::with(1, 1.0, 0.0);
        let face = || {
            Face::new(
                Sets::<2>::predict(&[1.0, 0.0], &[0.0; 2], 1.0, &[1.0]),
                &law,
                None,
            )
        };
        let start = || Point {
            lambda: vec![1.0, 0.0],
            r: vec![-1.0, -1.0],
            motion: Vec::new(),
        };
        let mut point = start();
        let Ok(made) = minimise(&mut point, &face(), 1e-9, 1e-12, |p| {
            Ok::<_, Infallible>(Some(vec![p[0], 0.0]))
        });
        assert!(
            made <= 3 && point.lambda.iter().all(|l| l.is_finite()),
            "{:?}",
            point.lambda
        );
        let mut point = start();
        let Ok(made) = minimise(&mut point, &face(), 1e-9, 1e-12, |_| {
            Ok::<_, Infallible>(None)
        });
        assert_eq!((made, point.lambda), (0, start().lambda));
        let mut point = start();
        let failed = minimise(&mut point, &face(), 1e-9, 1e-12, |_| Err("no more"));
        assert_eq!((failed, point.lambda), (Err("no more"), start().lambda));
    }
}
