//! A surrogate of A from all known products: the multisecant update of a multiple of the identity, or of what a similar A has left.

use super::pairs::Pairs;
use crate::dense::symmetric_eigen;
use crate::rounding::INDEPENDENT;
use crate::sparse::{add_times, dot, norm, norm_max};
use faer::Mat;

/// Ã = c (I − V(VᵀV)⁻¹Vᵀ) + W(VᵀW)⁻¹Wᵀ with W = AV: symmetric and positive definite, and Ãv = Av for all known v.
///
/// The columns of V are A-orthonormal, so that VᵀW = I; with an orthonormal basis Q of their span Ã is c (I − QQᵀ) + WWᵀ. That
/// is the block BFGS update of cI (Schnabel, Quasi-Newton methods using multiple secant equations, University of Colorado
/// 1983).
///
/// For compliant contact a part of A is known, the diagonal C. Then it is the update of B₀ = cI + C: with a basis Z of the span
/// for which ZᵀB₀Z = I it is B₀ − (B₀Z)(B₀Z)ᵀ + WWᵀ. The part that dependent rows of B have by C alone is then known from the
/// start, and c is the curvature of the rest.
///
/// Where the surrogate of a similar A is known, it is B₀ = cI + Σ ± ttᵀ. A trace t is one of its eigenvectors, of the length √|λ − c| for
/// the eigenvalue λ.
#[derive(Clone, Debug, Default)]
pub(super) struct Surrogate {
    /// c: the curvature of q along the last new direction, across the span of those before it. With traces it stays as it is.
    base: f64,
    /// V and W.
    pairs: Pairs,
    /// Q.
    basis: Vec<Vec<f64>>,
    /// The diagonal of C; empty where all contact is hard.
    compliance: Vec<f64>,
    /// Traces with their signs; none where there is a C.
    traces: Vec<(Vec<f64>, f64)>,
    /// S of [`Scaled`](super::scaling::Scaled), in whose multipliers all of this is; empty for the identity.
    scale: Vec<f64>,
    /// B₀Z, unless B₀ = cI.
    weighted: Vec<Vec<f64>>,
    /// The curvature of q along the last new direction, across the span of those before it; 0 before the first.
    curvature: f64,
    /// The largest eigenvalue of WWᵀ.
    largest: f64,
}

/// Pairs that are kept for another C, the latest: making them anew takes as long as the square of their number.
const KEPT: usize = 40;

/// Traces that are kept: those of the eigenvalues that differ most from c. With 20 of them `examples/hose.toml` takes 292 products,
/// 212 to 254 with 40, 60 and 150, and 428 without any.
const TRACES: usize = 60;

impl Surrogate {
    /// Pairs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether its directions have this many entries.
    pub fn fits_length(&self, len: usize) -> bool {
        let directions = self.pairs.directions.iter();
        let mut all = directions.chain(self.traces.iter().map(|trace| &trace.0));
        all.all(|d| d.len() == len)
    }

    /// Sets c for the first step, before any product, the number of pairs to keep, C, and S (empty for the identity). Pairs of a solve
    /// with another C get the images that they have with this one.
    pub fn prepare(&mut self, base: f64, most: usize, compliance: &[f64], scale: &[f64]) {
        self.pairs.allow(most);
        self.take_scale(scale);
        if !compliance.is_empty() {
            self.traces.clear();
        }
        if !self.is_known() {
            self.base = base;
        }
        let before = std::mem::replace(&mut self.compliance, compliance.to_vec());
        if self.len() == 0 || before == compliance {
            return;
        }
        let old = std::mem::take(self);
        self.base = old.base;
        self.pairs.allow(most);
        (self.compliance, self.scale) = (old.compliance, old.scale);
        let of = |c: &[f64], i: usize| c.get(i).copied().unwrap_or(0.0);
        let early = old.pairs.len().saturating_sub(KEPT);
        for ((direction, image), error) in old.pairs.iter().zip(&old.pairs.errors).skip(early) {
            let each = image.iter().zip(direction).enumerate();
            let image: Vec<f64> = each
                .map(|(i, (w, v))| w + (of(compliance, i) - of(&before, i)) * v)
                .collect();
            let size = dot(direction, &image).sqrt();
            self.enter(direction, &image, error / size, 0.0);
        }
        self.settle();
    }

    /// Takes S. Traces lose the rows with another factor; those without any row go.
    fn take_scale(&mut self, scale: &[f64]) {
        let of = |scale: &[f64], i: usize| scale.get(i).copied().unwrap_or(1.0);
        for (trace, _) in &mut self.traces {
            for (i, t) in trace.iter_mut().enumerate() {
                if of(scale, i) != of(&self.scale, i) {
                    *t = 0.0;
                }
            }
        }
        self.scale = scale.to_vec();
        self.traces.retain(|(trace, _)| norm_max(trace) > 0.0);
    }

    /// Becomes B₀ of a similar A. `change` takes vectors to its rows: orthogonally, except for rows that are lost, so that it stays
    /// positive definite. `factors` does so with S, whose rows do not mix. With a C nothing is kept.
    pub fn renew(
        &mut self,
        change: impl Fn(&[f64]) -> Vec<f64>,
        factors: impl Fn(&[f64]) -> Vec<f64>,
    ) {
        let before = std::mem::take(self);
        if !before.compliance.is_empty() || !before.is_known() {
            return;
        }
        let columns: Vec<(Vec<f64>, f64)> = (before.columns())
            .map(|(column, factor, sign)| (column.iter().map(|v| factor * v).collect(), sign))
            .collect();
        let mut basis: Vec<Vec<f64>> = Vec::new();
        for (column, _) in &columns {
            let mut q = across(column, &basis);
            let length = norm(&q);
            if length > INDEPENDENT * norm(column) {
                q.iter_mut().for_each(|v| *v /= length);
                basis.push(q);
            }
        }
        let n = basis.len();
        let parts = Mat::from_fn(n, columns.len(), |i, j| dot(&basis[i], &columns[j].0));
        let small = Mat::from_fn(n, n, |i, j| {
            let each = columns.iter().enumerate();
            each.map(|(k, (_, sign))| sign * parts[(i, k)] * parts[(j, k)])
                .sum()
        });
        let Some((values, vectors)) = symmetric_eigen(&small) else {
            return;
        };
        // c follows the last direction, as without traces; the eigenvalues stay.
        let base = match before.curvature > 0.0 {
            true => before.curvature,
            false => before.base,
        };
        // Positive, except for rounding.
        let eigenvalue = |j: usize| (before.base + values[j]).max(INDEPENDENT * base);
        let apart = |j: &usize| (eigenvalue(*j) / base).ln().abs();
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|a, b| apart(b).total_cmp(&apart(a)));
        order.truncate(TRACES);
        let traces = order.into_iter().map(|j| {
            let value = eigenvalue(j) - base;
            let mut trace = vec![0.0; columns[0].0.len()];
            for (i, q) in basis.iter().enumerate() {
                add_times(value.abs().sqrt() * vectors[(i, j)], q, &mut trace);
            }
            (change(&trace), value.signum())
        });
        self.base = base;
        self.traces = traces.collect();
        if !before.scale.is_empty() {
            self.scale = factors(&before.scale);
        }
    }

    /// Whether it knows more than c and C.
    pub fn is_known(&self) -> bool {
        self.len() > 0 || !self.traces.is_empty()
    }

    /// c.
    pub fn base(&self) -> f64 {
        self.base
    }

    /// An estimate of the largest eigenvalue of A from the products: from below, and close after a few of them, because
    /// steps follow the directions in which A is large.
    pub fn largest(&self) -> f64 {
        let of_traces = self.traces.iter().filter(|trace| trace.1 > 0.0);
        let longest = of_traces.fold(0.0, |max: f64, (t, _)| max.max(dot(t, t)));
        self.largest.max(self.base + longest + self.softest())
    }

    /// The largest entry of C.
    pub fn softest(&self) -> f64 {
        norm_max(&self.compliance)
    }

    /// B₀ᵢᵢ for another c.
    pub fn diagonal(&self, i: usize, base: f64) -> f64 {
        base + self.compliance.get(i).copied().unwrap_or(0.0)
    }

    /// The number of [`Surrogate::columns`].
    pub fn n_columns(&self) -> usize {
        2 * self.len() + self.traces.len()
    }

    /// The traces and the columns of [B₀Z, W] (with B₀ = cI that is [√c Q, W]) with their factor, and their sign in Ã − cI − C.
    pub fn columns(&self) -> impl Iterator<Item = (&[f64], f64, f64)> {
        let (basis, root) = match self.is_plain() {
            true => (&self.basis, self.base.sqrt()),
            false => (&self.weighted, 1.0),
        };
        let traces = self.traces.iter();
        (traces.map(|(trace, sign)| (trace.as_slice(), 1.0, *sign)))
            .chain(basis.iter().map(move |q| (q.as_slice(), root, -1.0)))
            .chain(self.pairs.images.iter().map(|w| (w.as_slice(), 1.0, 1.0)))
    }

    /// Whether B₀ = cI.
    fn is_plain(&self) -> bool {
        self.compliance.is_empty() && self.traces.is_empty()
    }

    /// Ã p.
    pub fn times(&self, p: &[f64]) -> Vec<f64> {
        self.times_by(p, self.n_columns())
    }

    /// The same without all but the first columns; with those of the traces it is B₀p.
    fn times_by(&self, p: &[f64], columns: usize) -> Vec<f64> {
        let entries = p.iter().enumerate();
        let mut image: Vec<f64> = entries
            .map(|(i, p)| self.diagonal(i, self.base) * p)
            .collect();
        for (column, factor, sign) in self.columns().take(columns) {
            add_times(sign * factor * factor * dot(column, p), column, &mut image);
        }
        image
    }

    /// Splits p into its part in the span, whose image is returned, and the rest, which remains in p: all of it if images
    /// are not exact.
    pub fn split(&self, p: &mut [f64]) -> Vec<f64> {
        let mut image = vec![0.0; p.len()];
        if !self.pairs.are_exact() {
            return image;
        }
        for (v, w) in self.pairs.iter() {
            let c = dot(w, p);
            add_times(-c, v, p);
            add_times(c, w, &mut image);
        }
        image
    }

    /// Adds a direction with its image, which has an error of this part (in the norm of A⁻¹). Where errors hide its new
    /// part, mainly those of known pairs, the less accurate ones follow it. A direction along which A curves q by less than
    /// `flat` does not enter: where rows of B depend on each other, it is only rounding. False if errors have hidden
    /// something: the pair has not entered, or another has nothing new beside it.
    pub fn add(&mut self, direction: &[f64], image: &[f64], error: f64, flat: f64) -> bool {
        // Written so that NaN is refused.
        if !(dot(direction, image) > flat * dot(direction, direction))
            || image.iter().any(|v| !v.is_finite())
        {
            return true;
        }
        let before = self.len();
        self.enter(direction, image, error, flat);
        self.settle();
        error == 0.0 || self.len() > before
    }

    /// Keeps clear pairs only, from here on.
    pub fn be_strict(&mut self) {
        let kept = self.pairs.be_strict();
        self.extend_basis(kept);
        self.settle();
    }

    /// Adds a pair, without the quantities that follow from all pairs. Where too little of it is new, nothing changes.
    fn enter(&mut self, direction: &[f64], image: &[f64], error: f64, flat: f64) {
        let kept = self.pairs.enter(direction, image, error, flat);
        let curvatures = self.extend_basis(kept);
        // Below rounding the part of the curvature that is not from C contains no information.
        if let Some(curvature) = curvatures.into_iter().flatten().next_back() {
            self.curvature = curvature;
            if self.traces.is_empty() {
                self.base = curvature;
            }
        }
    }

    /// Finds the quantities that follow from all pairs.
    fn settle(&mut self) {
        if !self.is_plain() {
            self.weigh();
        }
        self.largest = self.pairs.largest();
    }

    /// B₀Z by the method of Gram and Schmidt.
    fn weigh(&mut self) {
        let (mut basis, mut weighted): (Vec<Vec<f64>>, Vec<Vec<f64>>) = Default::default();
        // For C = 0 and without traces the basis is orthonormal already.
        for q in &self.basis {
            let mut z = q.clone();
            for _ in 0..2 {
                for (other, image) in basis.iter().zip(&weighted) {
                    let c = dot(image, &z);
                    add_times(-c, other, &mut z);
                }
            }
            let mut image = self.times_by(&z, self.traces.len());
            let scale = 1.0 / dot(&z, &image).sqrt();
            z.iter_mut().for_each(|v| *v *= scale);
            image.iter_mut().for_each(|v| *v *= scale);
            basis.push(z);
            weighted.push(image);
        }
        self.weighted = weighted;
    }

    /// Makes the basis anew from this direction on. Returns the curvature along each of them across those before it, without the part
    /// from C, where rounding does not hide it.
    fn extend_basis(&mut self, kept: usize) -> Vec<Option<f64>> {
        self.basis.truncate(kept);
        let mut curvatures = Vec::new();
        for direction in &self.pairs.directions[kept..] {
            let mut q = across(direction, &self.basis);
            let length = norm(&q);
            q.iter_mut().for_each(|v| *v /= length);
            self.basis.push(q);
            let given = self.compliance.iter().zip(direction);
            let part = given.fold(1.0, |part, (c, v)| part - c * v * v);
            curvatures.push((part > INDEPENDENT).then(|| part / (length * length)));
        }
        curvatures
    }
}

/// The part of x across an orthonormal basis.
fn across(x: &[f64], basis: &[Vec<f64>]) -> Vec<f64> {
    let mut x = x.to_vec();
    for _ in 0..2 {
        for other in basis {
            let c = dot(other, &x);
            add_times(-c, other, &mut x);
        }
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::scatter;

    const MOST: usize = 20;

    /// A dense A with eigenvalues between 1 and 3, except for a large one.
    fn times_a(p: &[f64]) -> Vec<f64> {
        let n = p.len() as f64;
        let sum: f64 = p.iter().sum();
        let entries = p.iter().enumerate();
        entries
            .map(|(i, p)| (1.0 + 2.0 * i as f64 / n) * p + 5.0 * sum / n)
            .collect()
    }

    fn filled(len: usize, pairs: usize) -> (Surrogate, Vec<Vec<f64>>) {
        let mut surrogate = Surrogate::default();
        surrogate.prepare(2.0, MOST, &[], &[]);
        let numbers = scatter(len * pairs);
        let directions: Vec<Vec<f64>> = numbers.chunks(len).map(<[f64]>::to_vec).collect();
        for v in &directions {
            surrogate.add(v, &times_a(v), 0.0, 0.0);
        }
        (surrogate, directions)
    }

    #[test]
    fn known_pairs_are_reproduced_and_the_rest_is_positive() {
        let len = 40;
        let (surrogate, directions) = filled(len, 12);
        assert_eq!(surrogate.len(), 12);
        for v in &directions {
            for (found, expected) in surrogate.times(v).iter().zip(times_a(v)) {
                assert!((found - expected).abs() < 1e-12, "{found} {expected}");
            }
            let mut rest = v.clone();
            let image = surrogate.split(&mut rest);
            assert!(norm(&rest) < 1e-13);
            for (found, expected) in image.iter().zip(times_a(v)) {
                assert!((found - expected).abs() < 1e-12);
            }
        }
        let others = scatter(len * 30);
        for p in others.chunks(len) {
            let energy = dot(p, &surrogate.times(p));
            assert!(energy > 0.5 * dot(p, p) && energy < 9.0 * dot(p, p));
            let q = &directions[3];
            let symmetric = dot(q, &surrogate.times(p)) - dot(p, &surrogate.times(q));
            assert!(symmetric.abs() < 1e-12);
        }
        // From below, as the large eigenvector was not among the directions.
        assert!(surrogate.largest() > 3.0 && surrogate.largest() < 8.0);
    }

    /// Pairs of A + C are those of A with another C.
    #[test]
    fn pairs_are_kept_under_another_compliance() {
        let (len, given) = (40, [0.3, 2.0, 0.0]);
        let c = |factor: f64| -> Vec<f64> { (0..len).map(|i| factor * given[i % 3]).collect() };
        let (mut surrogate, directions) = filled(len, 12);
        for compliance in [c(1.0), c(4.0), Vec::new(), c(0.5)] {
            surrogate.prepare(2.0, MOST, &compliance, &[]);
            assert_eq!(surrogate.len(), 12);
            for v in &directions {
                let given_way = |i: usize| compliance.get(i).copied().unwrap_or(0.0) * v[i];
                let expected = times_a(v).into_iter().enumerate();
                for (found, (i, expected)) in surrogate.times(v).iter().zip(expected) {
                    let expected = expected + given_way(i);
                    assert!((found - expected).abs() < 1e-11, "{found} {expected}");
                }
            }
        }
    }

    /// The surrogate of a similar A keeps what is known in rows that remain, and learns on top of it.
    #[test]
    fn what_is_known_serves_another_a() {
        let (len, lost) = (40, 3);
        let (mut surrogate, directions) = filled(len, 12);
        let goal = surrogate.times(&directions[5]);
        // The rows in the reverse order, the last of them lost.
        let change = |v: &[f64]| -> Vec<f64> {
            let kept = v.iter().rev().take(len - lost).copied();
            kept.chain(vec![0.0; lost]).collect()
        };
        let same = |v: &[f64]| v.to_vec();
        let mut renewed = surrogate.clone();
        renewed.renew(same, same);
        renewed.prepare(7.0, MOST, &[], &[]);
        assert_eq!((renewed.len(), renewed.base()), (0, surrogate.base()));
        for (found, goal) in renewed.times(&directions[5]).iter().zip(&goal) {
            assert!((found - goal).abs() < 1e-12, "{found} {goal}");
        }
        surrogate.renew(change, same);
        surrogate.prepare(7.0, MOST, &[], &[]);
        let others = scatter(len * 30);
        let mut all = others.chunks(len);
        for p in all.clone() {
            let energy = dot(p, &surrogate.times(p));
            assert!(energy > 0.5 * dot(p, p) && energy < 9.0 * dot(p, p));
        }
        // Another A: pairs are met exactly, and it stays positive.
        for v in all.by_ref().take(8) {
            let image: Vec<f64> = times_a(v).iter().map(|w| 1.5 * w).collect();
            surrogate.add(v, &image, 0.0, 0.0);
        }
        assert_eq!(surrogate.n_columns(), 2 * 8 + 12 * 2);
        for v in others.chunks(len).take(8) {
            for (found, goal) in surrogate.times(v).iter().zip(times_a(v)) {
                assert!((found - 1.5 * goal).abs() < 1e-11, "{found} {goal}");
            }
        }
        for p in all {
            let energy = dot(p, &surrogate.times(p));
            assert!(energy > 0.5 * dot(p, p) && energy < 13.0 * dot(p, p));
        }
        // Another S in one row.
        let mut scale = vec![1.0; len];
        scale[7] = 4.0;
        surrogate.renew(same, same);
        surrogate.prepare(7.0, MOST, &[], &scale);
        let mut unit = vec![0.0; len];
        unit[7] = 1.0;
        assert_eq!(surrogate.times(&unit)[7], surrogate.base());
    }

    #[test]
    fn only_inaccurate_pairs_make_room() {
        let len = 40;
        let numbers = scatter(len * 6);
        let directions: Vec<&[f64]> = numbers.chunks(len).collect();
        // Images 5 % too long: all of it is error.
        let off = |v: &[f64], part: f64| -> Vec<f64> {
            times_a(v).iter().map(|w| (1.0 + part) * w).collect()
        };
        let missed = |surrogate: &Surrogate, v: &[f64]| {
            let image = times_a(v);
            norm(&crate::sparse::difference(&surrogate.times(v), &image)) / norm(&image)
        };
        let mut surrogate = Surrogate::default();
        surrogate.prepare(2.0, MOST, &[], &[]);
        for v in &directions {
            surrogate.add(v, &off(v, 0.05), 0.1, 0.0);
        }
        assert_eq!(surrogate.len(), 6);
        // This direction is not new, but more accurate now, and displaces the pair that it mostly consists of.
        let sum: Vec<f64> = (0..len)
            .map(|i| 3.0 * directions[0][i] + directions[1][i])
            .collect();
        surrogate.add(&sum, &times_a(&sum), 0.01, 0.0);
        let (count, now) = (surrogate.len(), missed(&surrogate, &sum));
        assert!(count < 7 && now < 0.01 && missed(&surrogate, directions[5]) < 0.06);
        // A worse product of a known direction changes nothing.
        surrogate.add(&sum, &off(&sum, 0.3), 0.5, 0.0);
        assert_eq!((surrogate.len(), missed(&surrogate, &sum)), (count, now));
    }

    /// Behind a pair of 10 % a more accurate one would have its error, too.
    #[test]
    fn accurate_pairs_come_first() {
        let len = 40;
        let numbers = scatter(len * 6);
        let directions: Vec<&[f64]> = numbers.chunks(len).collect();
        let mut surrogate = Surrogate::default();
        surrogate.prepare(2.0, MOST, &[], &[]);
        for v in &directions {
            surrogate.add(v, &times_a(v), 0.1, 0.0);
        }
        let (count, few) = (directions.len(), 1e-5);
        for k in 0..count {
            let mut sum = directions[k].to_vec();
            add_times(0.3, directions[(k + 1) % count], &mut sum);
            surrogate.add(&sum, &times_a(&sum), few, 0.0);
            let accurate = surrogate.pairs.errors.iter().filter(|&&e| e < 100.0 * few);
            assert_eq!((accurate.count(), surrogate.len()), (k + 1, count));
        }
    }

    /// Also where there is no room for all of them: the basis is that of the pairs.
    #[test]
    fn the_basis_follows_the_pairs() {
        let (len, room) = (40, 6);
        let numbers = scatter(len * 30);
        let mut surrogate = Surrogate::default();
        surrogate.prepare(2.0, room, &[], &[]);
        for (k, v) in numbers.chunks(len).enumerate() {
            surrogate.add(v, &times_a(v), [0.1, 1e-5, 0.3][k % 3], 0.0);
            let mut sum = numbers[..len].to_vec();
            add_times(0.1, v, &mut sum);
            surrogate.add(&sum, &times_a(&sum), 1e-4, 0.0);
            for (v, w) in surrogate.pairs.iter() {
                let differences = surrogate.times(v).into_iter().zip(w);
                let off = differences.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
                assert!(off < 1e-9 * norm(w), "{k}: {off:e}");
            }
        }
        assert_eq!(surrogate.len(), room);
    }

    #[test]
    fn a_new_pair_shows_the_errors_of_others() {
        let numbers = scatter(120);
        let directions: Vec<&[f64]> = numbers.chunks(40).collect();
        let filled = |errors: [f64; 2]| {
            let mut surrogate = Surrogate::default();
            surrogate.prepare(2.0, MOST, &[], &[]);
            let mut wrong = times_a(directions[0]);
            add_times(0.5, &times_a(directions[1]), &mut wrong);
            surrogate.add(directions[0], &wrong, errors[0], 0.0);
            surrogate.add(directions[1], &times_a(directions[1]), errors[1], 0.0);
            surrogate.pairs.errors
        };
        assert!(filled([1e-3, 1e-4])[0] > 0.3);
        // The other one would have it.
        let errors = filled([1e-4, 1e-3]);
        assert!(errors[0] < 2e-4 && errors[1] > 0.3);
    }

    #[test]
    fn pairs_without_information_do_not_enter_and_old_ones_make_room() {
        let (mut surrogate, directions) = filled(40, 5);
        let base = surrogate.base();
        let sum: Vec<f64> = (0..40)
            .map(|i| directions[0][i] + directions[1][i])
            .collect();
        surrogate.add(&sum, &times_a(&sum), 0.0, 0.0);
        surrogate.add(&[0.0; 40], &[0.0; 40], 0.0, 0.0);
        surrogate.add(&[1.0; 40], &[f64::NAN; 40], 0.0, 0.0);
        // Too flat.
        surrogate.add(&[1.0; 40], &times_a(&[1.0; 40]), 0.0, 10.0);
        assert_eq!((surrogate.len(), surrogate.base()), (5, base));
        let (surrogate, _) = filled(2 * MOST, MOST + 10);
        assert_eq!(surrogate.len(), MOST);
        for (v, w) in surrogate.pairs.iter() {
            let differences = surrogate.times(v).into_iter().zip(w);
            assert!(differences.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) < 1e-11);
        }
    }
}
