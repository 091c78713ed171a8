//! Known products with A: directions and images, the images with errors.

use crate::dense::symmetric_largest;
use crate::rounding::INDEPENDENT;
use crate::sparse::{add_times, dot};
use faer::Mat;

/// The least energy of the new part of a pair over that of its error, once errors have stood in the way. The errors of products
/// by PCG have the same shape and add up more than the estimate says: a pair that was thought to be known to a third had 100 times
/// the stiffness of A. Of 5 113 load steps of random solids 14 found no answer, for 65 314 products, without this, 10 (61 001)
/// with 4, 5 (59 152) with 16, and 4 (61 178) with 100.
const CLEAR: f64 = 16.0;

/// V and W = AV. The columns of V are A-orthonormal, so that VᵀW = I.
#[derive(Clone, Debug, Default)]
pub(super) struct Pairs {
    /// V and W.
    pub directions: Vec<Vec<f64>>,
    pub images: Vec<Vec<f64>>,
    /// A bound of the error of each image, in the norm of A⁻¹, in which the image itself has length one.
    pub errors: Vec<f64>,
    /// WᵀW up to the diagonal, row by row.
    gram: Vec<Vec<f64>>,
    /// Pairs kept at most.
    most: usize,
    /// Whether pairs have to be [`CLEAR`].
    is_strict: bool,
}

/// What has become of a pair.
#[derive(PartialEq)]
enum Entry {
    Made,
    /// The oldest ones have made room.
    Replaced,
    /// Errors of other pairs are in its way.
    Hidden,
    Refused,
}

impl Pairs {
    /// Makes room for so many pairs, which need not be [`CLEAR`].
    pub fn allow(&mut self, most: usize) {
        (self.most, self.is_strict) = (most, false);
    }

    pub fn len(&self) -> usize {
        self.directions.len()
    }

    /// The pairs (v, w).
    pub fn iter(&self) -> impl Iterator<Item = (&[f64], &[f64])> {
        let images = self.images.iter().map(Vec::as_slice);
        self.directions.iter().map(Vec::as_slice).zip(images)
    }

    pub fn are_exact(&self) -> bool {
        self.errors.iter().all(|&error| error == 0.0)
    }

    /// The largest eigenvalue of WWᵀ, which has those of WᵀW.
    pub fn largest(&self) -> f64 {
        let gram = Mat::from_fn(self.len(), self.len(), |i, j| {
            self.gram[i].get(j).copied().unwrap_or(0.0)
        });
        // 0 for the NaN of no pairs at all.
        symmetric_largest(&gram).max(0.0)
    }

    /// Keeps clear pairs only, from here on. Returns the number of pairs up to the first that has gone.
    pub fn be_strict(&mut self) -> usize {
        self.is_strict = true;
        let is_clear: Vec<bool> = (self.errors.iter())
            .map(|error| CLEAR * error * error <= 1.0)
            .collect();
        for k in (0..self.len()).rev().filter(|&k| !is_clear[k]) {
            self.remove(k);
        }
        let first = is_clear.iter().position(|clear| !clear);
        first.unwrap_or(self.len())
    }

    /// Adds a pair. Where errors of known pairs hide its new part, those that are less accurate follow it, by their accuracy: only what
    /// is new beside it is left of them. Behind them it would inherit their errors, and so would all later pairs, however accurate they
    /// are. Returns the number of pairs that have remained as they were, from the first.
    pub fn enter(&mut self, direction: &[f64], image: &[f64], error: f64, flat: f64) -> usize {
        let before = self.len();
        let entry = self.extend(direction, image, error, flat);
        let first = self.errors.iter().position(|&known| known > error);
        let mut kept = match (entry, first) {
            (Entry::Hidden, Some(first)) => first,
            (Entry::Replaced, _) => return 0,
            _ => return before,
        };
        self.gram.truncate(kept);
        let pairs = (self.directions.split_off(kept).into_iter()).zip(self.images.split_off(kept));
        let mut later: Vec<_> = pairs.zip(self.errors.split_off(kept)).collect();
        later.push(((direction.to_vec(), image.to_vec()), error));
        later.sort_by(|(_, a), (_, b)| a.total_cmp(b));
        for ((direction, image), error) in later {
            if self.extend(&direction, &image, error, flat) == Entry::Replaced {
                kept = 0;
            }
        }
        kept
    }

    /// Adds a pair (p, Ap) unless too little of it is new.
    ///
    /// A is symmetric, so that wᵀp = vᵀAp, and the less accurate of two pairs has the difference as an error. Estimates of PCG may be
    /// far too small: a pair had 100 times the stiffness of A, and stayed.
    fn extend(&mut self, direction: &[f64], image: &[f64], mut error: f64, flat: f64) -> Entry {
        let (mut direction, mut image) = (direction.to_vec(), image.to_vec());
        let (before, is_exact) = (dot(&direction, &image), error == 0.0);
        let mut shares = vec![0.0; self.len()];
        for again in [false, true] {
            let known = self.directions.iter().zip(&self.images);
            for ((v, w), (bound, share)) in known.zip(self.errors.iter_mut().zip(&mut shares)) {
                let c = dot(w, &direction);
                // The same where images are exact. Otherwise that of the known pair is better, and stays as it is in Ã.
                let of_image = if is_exact { c } else { dot(v, &image) };
                if !again && !is_exact {
                    let worse = if *bound > error { bound } else { &mut error };
                    *worse = worse.max((c - of_image).abs() / before.sqrt());
                }
                add_times(-c, v, &mut direction);
                add_times(-of_image, w, &mut image);
                *share += c;
            }
        }
        let inherited = shares.iter().zip(&self.errors);
        let others: f64 = inherited.map(|(c, error)| (c * error).powi(2)).sum();
        let (own, new) = (error * error * before, dot(&direction, &image));
        // Written so that NaN is refused.
        let is_new =
            new > INDEPENDENT * INDEPENDENT * before && new > flat * dot(&direction, &direction);
        let clear = if self.is_strict { CLEAR } else { 1.0 };
        if !(is_new && new >= clear * (own + others)) {
            return match others > 0.0 && own <= others {
                true => Entry::Hidden,
                false => Entry::Refused,
            };
        }
        let scale = 1.0 / new.sqrt();
        direction.iter_mut().for_each(|v| *v *= scale);
        image.iter_mut().for_each(|v| *v *= scale);
        let surplus = (self.len() + 1).saturating_sub(self.most.max(1));
        (0..surplus).for_each(|_| self.remove(0));
        self.directions.push(direction);
        self.images.push(image);
        let last = &self.images[self.len() - 1];
        let row = self.images.iter().map(|w| dot(w, last)).collect();
        self.gram.push(row);
        self.errors.push((own + others).sqrt() * scale);
        match surplus {
            0 => Entry::Made,
            _ => Entry::Replaced,
        }
    }

    fn remove(&mut self, number: usize) {
        self.directions.remove(number);
        self.images.remove(number);
        self.errors.remove(number);
        self.gram.remove(number);
        for row in &mut self.gram[number..] {
            row.remove(number);
        }
    }
}
