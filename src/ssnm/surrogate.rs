//! A surrogate of A made of all products that are known: the multisecant update of a multiple of the identity.

use crate::dense::symmetric_eigen;
use crate::sparse::{add_times, dot, norm};
use faer::Mat;

/// Pairs kept at most. The hard cases of `tests/counts.rs` end with fewer than 60 in a load step; 120 of them take
/// 3 · 120 numbers for each multiplier, less than K has for the contact nodes.
const MOST: usize = 120;
/// A direction whose part outside the span of the others is smaller than this, in the norm of A, adds nothing but rounding:
/// its image would be known to no more than half of the digits.
const INDEPENDENT: f64 = 1e-8;

/// ‖Av‖² ≤ σ_max vᵀAv for all v. A pair that breaks this by so much, with what is known of σ_max, is all error.
const LONGER: f64 = 2.0;

/// Ã = c (I − V(VᵀV)⁻¹Vᵀ) + W(VᵀW)⁻¹Wᵀ with W = AV: symmetric and positive definite, and Ãv = Av for all known v.
///
/// The columns of V are A-orthonormal, so that VᵀW = I; with an orthonormal basis Q of their span Ã is
/// c (I − QQᵀ) + WWᵀ. That is the block BFGS update of cI (Schnabel, Quasi-Newton methods using multiple secant
/// equations, University of Colorado 1983).
#[derive(Clone, Debug, Default)]
pub(super) struct Surrogate {
    /// c: how much A curves q along the last direction that was new, across the span of those before it.
    base: f64,
    /// V, W and Q.
    directions: Vec<Vec<f64>>,
    images: Vec<Vec<f64>>,
    basis: Vec<Vec<f64>>,
    /// The largest eigenvalue of WWᵀ.
    largest: f64,
    /// Some images are not exact.
    is_rough: bool,
}

impl Surrogate {
    /// Pairs.
    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// Whether its directions have so many entries.
    pub fn fits_length(&self, len: usize) -> bool {
        self.directions.iter().all(|d| d.len() == len)
    }

    /// Forgets all pairs; c stays.
    pub fn forget(&mut self) {
        *self = Self {
            base: self.base,
            largest: self.largest,
            ..Self::default()
        };
    }

    /// c for the first step, before any product has told.
    pub fn guess_base(&mut self, base: f64) {
        if self.len() == 0 {
            self.base = base;
        }
    }

    /// c.
    pub fn base(&self) -> f64 {
        self.base
    }

    /// The largest eigenvalue of A, as far as products have shown it: from below, and close once there are a few of them,
    /// as steps follow the directions in which A is large.
    pub fn largest(&self) -> f64 {
        self.largest.max(self.base)
    }

    /// The columns of [√c Q, W] with their factor, and the sign that they enter Ã − cI with.
    pub fn columns(&self) -> impl Iterator<Item = (&[f64], f64, f64)> {
        let root = self.base.sqrt();
        let basis = self.basis.iter().map(move |q| (q.as_slice(), root, -1.0));
        basis.chain(self.images.iter().map(|w| (w.as_slice(), 1.0, 1.0)))
    }

    /// Ã p.
    pub fn times(&self, p: &[f64]) -> Vec<f64> {
        let mut image: Vec<f64> = p.iter().map(|p| self.base * p).collect();
        for (column, factor, sign) in self.columns() {
            add_times(sign * factor * factor * dot(column, p), column, &mut image);
        }
        image
    }

    /// Splits p into its part in the span, of which the image is returned, and the rest, which p becomes: all of it where
    /// images are not exact.
    pub fn split(&self, p: &mut [f64]) -> Vec<f64> {
        let mut image = vec![0.0; p.len()];
        if self.is_rough {
            return image;
        }
        for (v, w) in self.directions.iter().zip(&self.images) {
            let c = dot(w, p);
            add_times(-c, v, p);
            add_times(c, w, &mut image);
        }
        image
    }

    /// Adds a direction with its image, in which an error of this part (of the norm of A) is expected. Where no more than
    /// that is new, the known direction that it repeats most makes room: what is told last is told of where steps go now. A
    /// direction along which A curves q by less than `flat` does not enter: where rows of B depend on each other, it is one
    /// of rounding. Says whether others had to make room.
    pub fn add(&mut self, direction: &[f64], image: &[f64], error: f64, flat: f64) -> bool {
        let mut repeats = false;
        // Written so that NaN is refused.
        if !(dot(direction, image) > flat * dot(direction, direction))
            || image.iter().any(|v| !v.is_finite())
        {
            return repeats;
        }
        while !self.extend(direction, image, error, flat) && error > 0.0 {
            let shares = self.images.iter().map(|w| dot(w, direction).abs());
            match shares.enumerate().max_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((most, _)) => self.remove(most),
                None => break,
            }
            repeats = true;
        }
        self.is_rough |= error > 0.0;
        self.find_largest();
        repeats
    }

    /// Adds a pair unless too little of it is new; says whether it did.
    fn extend(&mut self, direction: &[f64], image: &[f64], error: f64, flat: f64) -> bool {
        let (mut direction, mut image) = (direction.to_vec(), image.to_vec());
        let before = dot(&direction, &image);
        let steepest = (dot(&image, &image) / before).max(self.largest);
        for _ in 0..2 {
            for (v, w) in self.directions.iter().zip(&self.images) {
                let c = dot(w, &direction);
                add_times(-c, v, &mut direction);
                add_times(-c, w, &mut image);
            }
        }
        let (curvature, new) = (dot(&direction, &image), error.max(INDEPENDENT));
        // Written so that NaN is refused.
        let good = curvature > new * new * before
            && curvature > flat * dot(&direction, &direction)
            && (error == 0.0 || dot(&image, &image) <= LONGER * steepest * curvature);
        if !good {
            return false;
        }
        let scale = 1.0 / curvature.sqrt();
        direction.iter_mut().for_each(|v| *v *= scale);
        image.iter_mut().for_each(|v| *v *= scale);
        if self.len() == MOST {
            self.remove(0);
        }
        self.directions.push(direction);
        self.images.push(image);
        let length = self.extend_basis(self.len() - 1);
        self.base = 1.0 / (length * length);
        true
    }

    fn remove(&mut self, number: usize) {
        self.directions.remove(number);
        self.images.remove(number);
        self.basis.truncate(number);
        for k in number..self.len() {
            self.extend_basis(k);
        }
    }

    /// Adds the direction with number k to the basis; returns how long it is across those before it.
    fn extend_basis(&mut self, k: usize) -> f64 {
        let mut q = self.directions[k].clone();
        for _ in 0..2 {
            for other in &self.basis {
                let c = dot(other, &q);
                add_times(-c, other, &mut q);
            }
        }
        let length = norm(&q);
        q.iter_mut().for_each(|v| *v /= length);
        self.basis.push(q);
        length
    }

    /// WWᵀ has the eigenvalues of WᵀW.
    fn find_largest(&mut self) {
        let gram = Mat::from_fn(self.len(), self.len(), |i, j| {
            if j <= i {
                dot(&self.images[i], &self.images[j])
            } else {
                0.0
            }
        });
        if let Some((values, _)) = symmetric_eigen(&gram) {
            self.largest = values.last().copied().unwrap_or(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dual::scatter;

    /// A dense A with eigenvalues between 1 and 3, but for a large one.
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
        surrogate.guess_base(2.0);
        let numbers = scatter(len * pairs);
        let directions: Vec<Vec<f64>> = numbers.chunks(len).map(<[f64]>::to_vec).collect();
        for v in &directions {
            surrogate.add(v, &times_a(v), 0.0, 0.0);
        }
        (surrogate, directions)
    }

    #[test]
    fn what_is_known_is_reproduced_and_the_rest_is_positive() {
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

    #[test]
    fn pairs_that_tell_nothing_do_not_enter_and_old_ones_make_room() {
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
        // Nothing of it is new, but it tells of the same direction anew.
        let other: Vec<f64> = times_a(&sum).iter().map(|v| 1.1 * v).collect();
        surrogate.add(&sum, &other, 0.1, 0.0);
        assert_eq!(surrogate.len(), 5);
        let off = crate::sparse::difference(&surrogate.times(&sum), &other);
        assert!(
            norm(&off) < 0.1 * norm(&other),
            "{:e}",
            norm(&off) / norm(&other)
        );

        let (surrogate, _) = filled(200, MOST + 10);
        assert_eq!(surrogate.len(), MOST);
        for (v, w) in surrogate.directions.iter().zip(&surrogate.images) {
            let differences = surrogate.times(v).into_iter().zip(w);
            assert!(differences.fold(0.0, |most: f64, (a, b)| most.max((a - b).abs())) < 1e-11);
        }
    }
}
