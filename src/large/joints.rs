//! Stability of bodies that rows hold: of sectors, couplings, nodes that move alike, preloads and springs, which always act, and of
//! contact that presses or sticks, which goes on doing so under a small push.

use crate::constraint::row_of;
use crate::contact::Space;
use crate::dual::scatter;
use crate::mesh::ElementKind;
use crate::model::Configuration;
use crate::sparse::{Csr, add_times, dot, norm_max};

/// Steps at most: a direction of negative curvature shows long before the residual is small.
const STEPS: usize = 5000;
/// The residual at the end, as a part of the load.
const SOLVED: f64 = 1e-6;
/// Places press whose force is more than this part of the largest: as much as solves leave undecided.
const PRESSES: f64 = 1e-6;

/// Whether the tangent is definite where these rows are as stiff as they say, hard ones `hard` times the mean diagonal of K;
/// false without such rows.
///
/// Conjugate gradients with a load without a pattern tell: they meet negative curvature, if there is any.
pub(super) fn is_definite<const D: usize>(at: &Configuration<D>, hard: f64) -> bool
where
    ElementKind: Space<D>,
{
    let problem = &at.problem;
    let touched = problem.touched();
    let (k, _) =
        (problem.floating_bodies()).grounded(problem.stiffness(), |unknown| touched[unknown / D]);
    let mut diagonal = k.diagonal();
    let mean = diagonal.iter().sum::<f64>() / diagonal.len() as f64;
    let (tied, compliance, sets) = (at.contact.tied(), problem.compliance(), at.sets());
    let most = norm_max(&at.lambda[..tied.len()]);
    let (mut rows, mut entries) = (0, Vec::new());
    let acting = at.contact.numbered();
    for (r, ..) in acting.filter(|&(_, i, _)| !at.touches[i].idle) {
        let directions = match tied[r] {
            true => D,
            false if !(at.lambda[r] > PRESSES * most) => 0,
            false if problem.has_friction(r) && !sets.slips(r) => D,
            false => 1,
        };
        for a in 0..directions {
            let row = row_of::<D>(tied.len(), r, a);
            let given_way = compliance.get(row).copied().unwrap_or(0.0);
            let stiffness = (hard * mean).min(1.0 / given_way);
            let (cols, values) = problem.contact_matrix().row(row);
            let row = cols.iter().zip(values);
            entries.extend(row.map(|(&j, v)| (rows, j as usize, stiffness.sqrt() * v[0][0])));
            rows += 1;
        }
    }
    if entries.is_empty() {
        return false;
    }
    entries.iter().for_each(|&(_, j, v)| diagonal[j] += v * v);
    if !diagonal.iter().all(|d| *d > 0.0) {
        return false;
    }
    let joints = Csr::from_triplets(rows, problem.n(), entries);
    let scale: Vec<f64> = diagonal.iter().map(|d| 1.0 / d.sqrt()).collect();
    let scaled = |x: &[f64]| -> Vec<f64> { x.iter().zip(&scale).map(|(x, s)| x * s).collect() };
    let times = |x: &[f64]| {
        let x = scaled(x);
        let mut y = k.product(&x);
        joints.mul_transpose_add(1.0, &joints.product(&x), &mut y);
        scaled(&y)
    };
    let mut residual = scatter(problem.n());
    let (mut direction, mut size) = (residual.clone(), dot(&residual, &residual));
    let enough = SOLVED * SOLVED * size;
    for _ in 0..STEPS {
        let along = times(&direction);
        let curvature = dot(&direction, &along);
        if !(curvature > 0.0) {
            return false;
        }
        add_times(-size / curvature, &along, &mut residual);
        let before = size;
        size = dot(&residual, &residual);
        if size <= enough {
            break;
        }
        let part = size / before;
        for (p, r) in direction.iter_mut().zip(&residual) {
            *p = r + part * *p;
        }
    }
    true
}
