//! The span of all directions whose product with A is known, and what of it fits the present sets.

use super::face::Face;
use crate::dense::right_singular;
use crate::sparse::{dot, norm};
use faer::Mat;

/// Directions kept at most: 2 · 2m numbers each.
const MAX_DIRECTIONS: usize = 120;
/// A direction whose part outside the span is smaller than this (in the norm of A) adds nothing but rounding.
const INDEPENDENT: f64 = 1e-4;
/// A combination is zero on the held multipliers if its singular value is below this part of the largest.
const VANISHES: f64 = 1e-11;

/// A-orthonormal directions W (WᵀAW = I) with their images AW.
#[derive(Clone, Debug, Default)]
pub(super) struct Subspace {
    directions: Vec<Vec<f64>>,
    images: Vec<Vec<f64>>,
}

impl Subspace {
    /// Adds a direction with its image.
    pub fn add(&mut self, mut direction: Vec<f64>, mut image: Vec<f64>) {
        let before = dot(&direction, &image);
        for _ in 0..2 {
            self.make_conjugate(&mut direction, Some(&mut image));
        }
        let curvature = dot(&direction, &image);
        // Written so that NaN is refused.
        if !(curvature > INDEPENDENT * INDEPENDENT * before && before > 0.0) {
            return;
        }
        let scale = 1.0 / curvature.sqrt();
        direction.iter_mut().for_each(|v| *v *= scale);
        image.iter_mut().for_each(|v| *v *= scale);
        self.push(direction, image);
    }

    /// Whether its directions have so many entries.
    pub fn fits_length(&self, len: usize) -> bool {
        self.directions.iter().all(|d| d.len() == len)
    }

    /// Adds a direction that is conjugate to all others and has the length one in the norm of A.
    pub fn push(&mut self, direction: Vec<f64>, image: Vec<f64>) {
        if self.directions.len() == MAX_DIRECTIONS {
            self.directions.remove(0);
            self.images.remove(0);
        }
        self.directions.push(direction);
        self.images.push(image);
    }

    /// The directions that were added last.
    pub fn latest(mut self, count: usize) -> Self {
        let old = self.directions.len().saturating_sub(count);
        self.directions.drain(..old);
        self.images.drain(..old);
        self
    }

    /// Removes from x (and its image) what lies in the span.
    pub fn make_conjugate(&self, x: &mut [f64], mut image: Option<&mut [f64]>) {
        for (direction, known) in self.directions.iter().zip(&self.images) {
            let c = dot(known, x);
            subtract(c, direction, x);
            if let Some(image) = image.as_deref_mut() {
                subtract(c, known, image);
            }
        }
    }

    /// Splits x into its part in the span, of which only the image is kept, and the rest; returns √(xᵀAx) of
    /// that part.
    pub fn split(&self, x: &mut [f64], image: &mut [f64]) -> f64 {
        image.fill(0.0);
        let mut energy = 0.0;
        for (direction, known) in self.directions.iter().zip(&self.images) {
            let c = dot(known, x);
            subtract(c, direction, x);
            subtract(-c, known, image);
            energy += c * c;
        }
        energy.sqrt()
    }

    /// Moves to the minimum of q over the span: λ −= W Wᵀr, r −= AW Wᵀr. No product with A is spent.
    pub fn minimise(&self, lambda: &mut [f64], r: &mut [f64]) {
        for (direction, image) in self.directions.iter().zip(&self.images) {
            let c = dot(direction, r);
            subtract(c, direction, lambda);
            subtract(c, image, r);
        }
    }

    /// The combinations that the face allows, as a subspace of their own: those that vanish on every held multiplier,
    /// move what follows as it has to, and leave all bodies in balance.
    ///
    /// With C the rows of these conditions applied to W, they are W Z for the null space Z of C; Z has orthonormal
    /// columns, so W Z is A-orthonormal again.
    pub fn fitting<const D: usize>(&self, face: &Face<D>) -> Self {
        let mut fitting = Self::default();
        for (direction, mut image) in self.combinations(face) {
            if face.is_curved() {
                face.curve(&direction, &mut image);
                fitting.add(direction, image);
            } else {
                fitting.push(direction, image);
            }
        }
        fitting
    }

    /// Its directions with their images under A, which are no longer conjugate.
    pub fn straightened<const D: usize>(mut self, face: &Face<D>) -> Self {
        for (direction, image) in self.directions.iter().zip(&mut self.images) {
            face.straighten(direction, image);
        }
        self
    }

    /// The same with their images, as they come.
    pub fn combinations<const D: usize>(&self, face: &Face<D>) -> Vec<(Vec<f64>, Vec<f64>)> {
        let count = self.directions.len();
        let held = face.conditions(&self.directions);
        let moved: Vec<Vec<f64>> = self.directions.iter().map(|d| face.moves(d)).collect();
        let motions = moved.first().map_or(0, Vec::len);
        let n_rows = held.len() + motions;
        if n_rows == 0 {
            return std::iter::zip(self.directions.clone(), self.images.clone()).collect();
        }
        // Directions of other tangents fit only by chance.
        if face.sets.turn() && n_rows >= count {
            return Vec::new();
        }
        let rows = Mat::from_fn(n_rows, count, |i, j| match held.get(i) {
            Some(row) => row[j],
            None => moved[j][i - held.len()],
        });
        let Some((values, right)) = right_singular(&rows) else {
            return Vec::new();
        };
        // Directions that all leave the bodies in balance make rows of nothing but rounding.
        let mut largest = values[0];
        if face.has_balance() {
            largest = (self.directions.iter().map(|d| norm(d))).fold(largest, f64::max);
        }
        let rank = values
            .iter()
            .take_while(|&&s| s > VANISHES * largest)
            .count();
        let combine = |vectors: &[Vec<f64>], z: usize| {
            let mut sum = vec![0.0; vectors[0].len()];
            for (j, v) in vectors.iter().enumerate() {
                subtract(-right[(j, z)], v, &mut sum);
            }
            sum
        };
        (rank..count)
            .map(|z| {
                let mut direction = combine(&self.directions, z);
                face.direction(&mut direction);
                (direction, combine(&self.images, z))
            })
            .collect()
    }
}

/// y −= c x.
pub(super) fn subtract(c: f64, x: &[f64], y: &mut [f64]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y -= c * x;
    }
}
