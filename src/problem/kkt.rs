//! The optimality conditions (1)–(3), and the scales of their violations.
//!
//! Violations are relative to the present problem, not to rigid-body displacements nor to an earlier, larger load:
//!
//! - lengths to the largest deformation, which is u without the mean rigid-body motion of each connected body; or, if
//!   larger, to the effect of a contact force on its own node alone ((Σ Bᵢⱼ²/Kⱼⱼ + Cᵢᵢ) λᵢ, of λᵢ what arrives at the node). Where W is
//!   given in place of K, u alone counts: the effect of a force on a light body that others press back is far larger;
//! - forces to the acting ones: the larger of ‖f‖ (without the contribution of prescribed displacements) and ‖Bᵀλ‖.
//!
//! A difference within the rounding of its terms (32 units in the last place) counts as zero: f64 resolves nothing smaller. Each
//! row has its own rounding: that of its gap, of the motion of its bodies, and of its compliance.

use super::{ContactProblem, System, tangents_of};
use crate::constraint::tangential;
use crate::dense::pseudo_inverse;
use crate::rigid::{self, Frame};
use crate::rounding::{DEPENDENT, ROUNDING};
use crate::sparse::stored::SquareBlocks;
use crate::sparse::{PIECE, add_times, dot, norm, norm_max};
use faer::Mat;
use rayon::prelude::*;

/// Violations of the optimality conditions, each relative to its own scale: see [`ContactProblem::kkt`].
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
#[non_exhaustive]
pub struct Kkt {
    /// ‖Ku + Nᵀλν + Tᵀλτ − f‖ / the acting forces.
    pub equilibrium: f64,
    /// max (Nu − Cν λν − d)₊ / the deformation; of ties |Nu − Cν λν − d|.
    pub penetration: f64,
    /// max (−λν)₊ / ‖λ‖∞.
    pub tension: f64,
    /// |λνᵀ(Nu − d)| / (‖λ‖ · the deformation); where that is larger, the largest gap under a force, or the effect of this force on
    /// its own node if that is less, / the deformation: the largest contacts must not hide the others.
    pub complementarity: f64,
    /// max (|λτ,i| − gᵢ)₊ / the largest bound, except for bounds that are larger than all forces.
    pub friction_bound: f64,
    /// max over sticking nodes of the slip, over slipping ones of slip that is not along λτ; / the deformation. The
    /// distance of a tangential force from its bound counts as a length, with the compliance of its node.
    pub slip: f64,
}

impl Kkt {
    /// The largest of the six; NaN if one is.
    pub fn max(&self) -> f64 {
        norm_max(&[
            self.equilibrium,
            self.penetration,
            self.tension,
            self.complementarity,
            self.friction_bound,
            self.slip,
        ])
    }
}

/// The scales of violations.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scales {
    /// The largest component of the deformation.
    pub length: f64,
    /// Its Euclidean norm.
    pub deformation: f64,
    /// The forces that act.
    pub force: f64,
}

impl<const D: usize> ContactProblem<D> {
    /// The optimality conditions (1)–(3) at (u, λ), in f64 against the assembled K, relative to the deformation and the
    /// forces of this problem (see the head of the module).
    ///
    /// `u` has an entry per row of K, `lambda` has length D m: λν, then λτ node by node.
    ///
    /// # Panics
    /// If a length differs.
    pub fn kkt(&self, u: &[f64], lambda: &[f64]) -> Kkt {
        let [x, s] = self.deformed(u);
        self.conditions(u, lambda, &self.stiffness().multiply_with_sizes(&x, &s))
    }
}

impl<const D: usize, K> ContactProblem<D, K> {
    /// The vector to multiply with K to test equilibrium: u without the motions of floating bodies, along which K R
    /// = 0. Products with rounded numbers are less accurate the farther a body has moved. Also the rounding of its
    /// entries, which includes that of the removed motion.
    pub(crate) fn deformed(&self, u: &[f64]) -> [Vec<f64>; 2] {
        let floating = self.floating_bodies();
        let back: Vec<f64> = floating.resultants(u).iter().map(|a| -a).collect();
        let mut deformed = u.to_vec();
        floating.add_motion(&back, &mut deformed);
        let mut sizes: Vec<f64> = u.iter().map(|u| u.abs()).collect();
        if let Some(travelled) = &self.load_case().travelled {
            add_times(1.0, travelled, &mut sizes);
        }
        [deformed, sizes]
    }

    /// The largest lengths whose differences are the gap and the slip of each row: gap or origin of slip, the earlier
    /// motion of the bodies, and the effect of the earlier force on its own node. A u that this force has brought to
    /// rest has the rounding of that.
    pub(crate) fn reach(&self) -> Vec<f64> {
        let case = self.load_case();
        let mut reach = match &case.travelled {
            None => vec![0.0; D * self.m()],
            Some(travelled) => self.row_sizes(travelled),
        };
        (reach.iter_mut().zip(case.offsets())).for_each(|(reach, c)| *reach = reach.max(c.abs()));
        let before = case.before.iter().zip(self.compliance());
        (reach.iter_mut().zip(before)).for_each(|(reach, (l, c))| *reach = reach.max(c * l.abs()));
        reach
    }

    /// The rounding of the gap and the slip of each row, where u is up to `moved` in it.
    pub(crate) fn rounding(&self, mut moved: Vec<f64>, lambda: &[f64]) -> Vec<f64> {
        add_times(1.0, &self.reach(), &mut moved);
        let given_way = self.contact_compliance().iter().zip(lambda);
        (moved.iter_mut().zip(given_way)).for_each(|(moved, (c, l))| *moved += (c * l).abs());
        moved.iter().map(|moved| ROUNDING * moved).collect()
    }

    /// The optimality conditions at (u, λ) where the product of K with [`ContactProblem::deformed`] is known, with its sizes.
    pub(crate) fn conditions(&self, u: &[f64], lambda: &[f64], product: &[Vec<f64>; 2]) -> Kkt {
        self.conditions_by(
            self.scales(u, lambda),
            &self.body_sizes(u),
            u,
            lambda,
            product,
        )
    }

    /// The same, measured by other scales; gaps and slip are rounded as much as sums with terms of these `sizes` for each unknown.
    pub(crate) fn conditions_by(
        &self,
        scales: Scales,
        sizes: &[f64],
        u: &[f64],
        lambda: &[f64],
        product: &[Vec<f64>; 2],
    ) -> Kkt {
        let m = self.m();
        let rounding = self.rounding(self.row_sizes(sizes), lambda);
        let (lambda_n, lambda_t) = lambda.split_at(m);
        let mut closing = self.beyond_compliance(self.normal(), 0, u, lambda);
        for (closing, (d, rounding)) in closing.iter_mut().zip(self.gap().iter().zip(&rounding)) {
            *closing = beyond(*closing - d, *rounding);
        }
        let mut slip = self.beyond_compliance(self.tangential(), m, u, lambda);
        (slip.iter_mut().zip(self.slip_origin())).for_each(|(slip, origin)| *slip -= origin);
        let bound = self.bounds(lambda);
        let positive = |values: &mut dyn Iterator<Item = f64>| {
            values.fold(
                0.0,
                |acc: f64, v| if v > acc || v.is_nan() { v } else { acc },
            )
        };
        let compliance = &self.compliance()[m..];
        let at = tangents_of::<D>;
        let slips = &mut (0..m).map(|i| {
            // One for both directions: other units would make an ellipse of the disc.
            let compliance = norm_max(&compliance[at(i)]);
            let off = slip_violation(&lambda_t[at(i)], &slip[at(i)], bound[i], compliance);
            // The violation changes by no more than the slip does. Without the rounding of either component, slip would have another direction.
            beyond(off, rigid::length(&rounding[m..][at(i)]))
        });
        let is_tied = |i: usize| self.is_tied(i);
        // The sides of a tie neither come nearer to each other nor move apart.
        let closed = &mut (0..m).map(|i| {
            if is_tied(i) {
                closing[i].abs()
            } else {
                closing[i]
            }
        });
        let compliance_n = &self.compliance()[..m];
        let apart = &mut (0..m).map(|i| match is_tied(i) {
            true => 0.0,
            false => (-closing[i]).min(compliance_n[i] * lambda_n[i]),
        });
        let pulled = &mut (0..m).map(|i| if is_tied(i) { 0.0 } else { -lambda_n[i] });
        let bounded: Vec<usize> = (0..m).filter(|&i| !is_tied(i)).collect();
        let most = norm_max(lambda);
        let largest = bounded
            .iter()
            .map(|&i| bound[i].min(most))
            .collect::<Vec<_>>();
        Kkt {
            equilibrium: ratio(self.imbalance(lambda, product), scales.force),
            penetration: ratio(positive(closed), scales.length),
            tension: ratio(positive(pulled), most),
            complementarity: norm_max(&[
                ratio(
                    dot(lambda_n, &closing).abs(),
                    norm(lambda) * scales.deformation,
                ),
                ratio(positive(apart), scales.length),
            ]),
            friction_bound: ratio(
                positive(
                    &mut (bounded.iter()).map(|&i| rigid::length(&lambda_t[at(i)]) - bound[i]),
                ),
                norm_max(&largest),
            ),
            slip: ratio(positive(slips), scales.length),
        }
    }

    /// The nodes that have slipped by more than rounding and a part of the deformation, without tied nodes. Each has
    /// its slip along the tangents (of length D, without a normal part).
    pub(crate) fn slipped(
        &self,
        u: &[f64],
        lambda: &[f64],
        part: f64,
    ) -> impl Iterator<Item = (usize, [f64; D])> + use<D, K> {
        let m = self.m();
        let scales = self.scales(u, lambda);
        let rounding = self.rounding(self.row_sizes(&self.body_sizes(u)), lambda);
        let least = part * scales.length;
        let mut slip = self.beyond_compliance(self.tangential(), m, u, lambda);
        for (slip, origin) in slip.iter_mut().zip(self.slip_origin()) {
            *slip -= origin;
        }
        let free: Vec<bool> = (0..m).map(|i| !self.is_tied(i)).collect();
        (0..m).filter_map(move |i| {
            let along = &slip[tangents_of::<D>(i)];
            let way = std::array::from_fn(|a| if a == 0 { 0.0 } else { along[a - 1] });
            let rounding = norm_max(&rounding[m..][tangents_of::<D>(i)]);
            (free[i] && tangential(way) > least + rounding).then_some((i, way))
        })
    }

    /// ‖Ku + Bᵀλ − f‖, without the rounding of its terms.
    fn imbalance(&self, lambda: &[f64], [sums, sizes]: &[Vec<f64>; 2]) -> f64 {
        let mut forces = self.load().to_vec();
        let mut terms: Vec<f64> = forces.par_iter().map(|f| f.abs()).collect();
        for (i, j, v) in self.contact_matrix().triplets() {
            forces[j] -= v * lambda[i];
            terms[j] += (v * lambda[i]).abs();
        }
        let residual: Vec<f64> = (0..forces.len())
            .into_par_iter()
            .with_min_len(PIECE)
            .map(|i| beyond(sums[i] - forces[i], ROUNDING * (terms[i] + sizes[i])))
            .collect();
        self.ranks().norm(&residual)
    }

    /// The larger of ‖f‖, without the contribution of prescribed displacements, and ‖Bᵀλ‖.
    pub(crate) fn acting_forces(&self, lambda: &[f64]) -> f64 {
        let forces = self.filled_columns().product(lambda);
        match self.load_case().acting.max(self.ranks().norm(&forces)) {
            // Only prescribed displacements.
            0.0 => self.ranks().norm(self.load()),
            force => force,
        }
    }

    /// The scales of violations at (u, λ).
    pub(crate) fn scales(&self, u: &[f64], lambda: &[f64]) -> Scales {
        let deformation = self.deformation(u);
        let own = self.own_effects(lambda);
        Scales {
            length: self.ranks().norm_max(&deformation).max(norm_max(&own)),
            deformation: self.ranks().norm(&deformation).max(norm(&own)),
            force: self.acting_forces(lambda),
        }
    }

    /// Whether forces are as large as they are only because they cancel at their nodes, as those of constraints that contradict each other.
    #[cfg(feature = "files")]
    pub(crate) fn has_cancelling_forces(&self, lambda: &[f64]) -> bool {
        /// The least ratio of all forces to what is left of them. Contradictions were found with 6 · 10⁵ and more.
        const CANCELLING: f64 = 1e5;
        let mut all = vec![0.0; self.contact_matrix().n_cols()];
        for (i, j, v) in self.contact_matrix().triplets() {
            all[j] += (v * lambda[i]).abs();
        }
        self.ranks().norm(&all) > CANCELLING * self.acting_forces(lambda)
    }

    /// The effect of the force of each row on its own node alone, (Σ Bᵢⱼ²/Kⱼⱼ) λᵢ without what forces of other rows take back at the same
    /// unknowns, and Cᵢᵢ λᵢ. Where constraints contradict each other, forces grow without end and cancel at their nodes: they must not
    /// hide the contradiction.
    pub(crate) fn own_effects(&self, lambda: &[f64]) -> Vec<f64> {
        if self.is_rigid {
            return vec![0.0; lambda.len()];
        }
        let rows = self.contact_matrix();
        let mut forces = vec![0.0; rows.n_cols()];
        rows.mul_transpose_add(1.0, lambda, &mut forces);
        let along = self.times(rows, &forces);
        let mut sizes = vec![0.0; lambda.len()];
        rows.triplets().for_each(|(i, _, v)| sizes[i] += v * v);
        self.ranks().sum(&mut sizes);
        let soft = self.contact_compliance();
        (0..lambda.len())
            .map(|i| {
                let (force, soft) = (lambda[i].abs(), soft.get(i).unwrap_or(&0.0));
                // A row without entries moves nothing.
                let reaching = if sizes[i] > 0.0 {
                    (along[i] / sizes[i]).abs().min(force)
                } else {
                    0.0
                };
                self.own_compliance()[i] * reaching + soft * force
            })
            .collect()
    }

    /// u without the mean rigid motion of each connected part of K; u itself without coordinates.
    fn deformation(&self, u: &[f64]) -> Vec<f64> {
        match (self.coordinates(), D) {
            (None, _) => u.to_vec(),
            (Some(points), 2) => self.without_motions::<3>(points, u),
            (Some(points), _) => self.without_motions::<6>(points, u),
        }
    }

    /// The same with the M rigid motions that there are.
    fn without_motions<const M: usize>(&self, points: &[[f64; D]], u: &[f64]) -> Vec<f64> {
        let frames = self.part_frames(points);
        let system: &System<D> = self;
        let motions = |node: usize| {
            let rows = frames[system.parts[node] as usize].motions::<M>(&points[node]);
            let coupled = (D * node..).zip(rows);
            coupled.filter(|&(i, _)| system.is_coupled(i))
        };
        // The normal equations of the mean motion of each part.
        let none = ([[0.0; M]; M], [0.0; M]);
        let sums = self.over_parts(none, |(gram, right), node| {
            for (i, row) in motions(node) {
                for a in 0..M {
                    right[a] += row[a] * u[i];
                    add_times(row[a], &row, &mut gram[a]);
                }
            }
        });
        let mut gram = vec![[[0.0; M]; M]; frames.len()];
        let mut right = vec![[0.0; M]; frames.len()];
        for (part, (more_gram, more_right)) in sums {
            let gram = gram[part].as_flattened_mut();
            add_times(1.0, more_gram.as_flattened(), gram);
            add_times(1.0, &more_right, &mut right[part]);
        }
        self.ranks().sum(gram.as_flattened_mut().as_flattened_mut());
        self.ranks().sum(right.as_flattened_mut());
        let motion: Vec<[f64; M]> = (gram.iter().zip(&right))
            .map(|(gram, right)| {
                let inverse = pseudo_inverse(&Mat::from_fn(M, M, |a, b| gram[a][b]), DEPENDENT);
                std::array::from_fn(|a| (0..M).map(|b| inverse[(a, b)] * right[b]).sum())
            })
            .collect();
        let mut rest = u.to_vec();
        (rest.par_chunks_mut(D).enumerate())
            .with_min_len(PIECE / D)
            .for_each(|(node, rest)| {
                for (i, row) in motions(node) {
                    rest[i - D * node] -= dot(&row, &motion[system.parts[node] as usize]);
                }
            });
        rest
    }

    /// About the mean of the points of each connected part of K, with the distance of the farthest one.
    fn part_frames(&self, points: &[[f64; D]]) -> Vec<Frame<D>> {
        let here = self
            .parts
            .iter()
            .max()
            .map_or(0.0, |&last| f64::from(last) + 1.0);
        let count = self.ranks().max(here) as usize;
        let mut frames = vec![
            Frame {
                centre: [0.0; D],
                size: 0.0_f64
            };
            count
        ];
        let mut members = vec![0.0; count];
        let ranks = self.ranks();
        let sums = self.over_parts(([0.0; D], 0.0), |(centre, members), node| {
            add_times(1.0, &points[node], centre);
            *members += 1.0;
        });
        for (part, (centre, more)) in sums {
            add_times(1.0, &centre, &mut frames[part].centre);
            members[part] += more;
        }
        ranks.sum(&mut members);
        for (frame, members) in frames.iter_mut().zip(members) {
            ranks.sum(&mut frame.centre);
            frame.centre = frame.centre.map(|sum| sum / members);
        }
        let system: &System<D> = self;
        let sizes = self.over_parts(0.0_f64, |size, node| {
            let centre = &frames[system.parts[node] as usize].centre;
            let away = std::array::from_fn::<_, D, _>(|c| points[node][c] - centre[c]);
            *size = size.max(rigid::length(&away));
        });
        for (part, size) in sizes {
            frames[part].size = frames[part].size.max(size);
        }
        for frame in &mut frames {
            frame.size = ranks.max(frame.size);
            if !(frame.size > 0.0) {
                frame.size = 1.0;
            }
        }
        frames
    }
}

/// The distance of λτ,i and the slip of a node from (3), as a length. It is the slip if the node sticks, else the part
/// of the slip that is not along λτ,i; or, if that is less, the distance of λτ,i from its bound times the compliance c.
/// A force that misses its bound by a rounding error still slips.
pub(crate) fn slip_violation(lambda: &[f64], slip: &[f64], g: f64, c: f64) -> f64 {
    if !(c > 0.0) {
        return 0.0;
    }
    let along = |k: usize| lambda[k] + slip[k] / c;
    if lambda.len() == 1 {
        return c * (lambda[0] - along(0).clamp(-g, g)).abs();
    }
    let far = rigid::length(&std::array::from_fn::<_, 2, _>(along));
    // On the disc, or beyond it.
    let shrunk = if far > g { g / far } else { 1.0 };
    c * rigid::length(&std::array::from_fn::<_, 2, _>(|k| {
        lambda[k] - shrunk * along(k)
    }))
}

/// The part of a difference that exceeds the rounding of its terms.
pub(crate) fn beyond(difference: f64, rounding: f64) -> f64 {
    if difference.abs() <= rounding {
        0.0
    } else {
        difference - rounding.copysign(difference)
    }
}

/// a / b, and 0 where a is; infinite where only b is 0.
fn ratio(a: f64, b: f64) -> f64 {
    if a == 0.0 { 0.0 } else { a / b }
}
