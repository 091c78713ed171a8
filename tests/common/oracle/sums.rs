//! Sums with their rounding errors.

use super::Entries;

/// A sum with its rounding error (Neumaier; products split exactly by a fused multiplication).
#[derive(Clone, Copy, Default)]
pub struct Sum {
    pub high: f64,
    pub low: f64,
}

impl Sum {
    pub fn add(&mut self, x: f64) {
        let sum = self.high + x;
        let back = sum - self.high;
        self.low += (self.high - (sum - back)) + (x - back);
        self.high = sum;
    }

    pub fn add_product(&mut self, a: f64, b: f64) {
        let product = a * b;
        self.add(product);
        self.low += a.mul_add(b, -product);
    }

    pub fn value(self) -> f64 {
        self.high + self.low
    }
}

/// A product with a matrix, and with the absolute values of everything.
pub fn product(entries: &Entries, rows: usize, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut sums, mut sizes) = (vec![Sum::default(); rows], vec![0.0; rows]);
    for &(i, j, v) in entries {
        sums[i].add_product(v, x[j]);
        sizes[i] += (v * x[j]).abs();
    }
    (sums.into_iter().map(Sum::value).collect(), sizes)
}

/// Σ over a sparse vector.
pub fn along(motion: &[(usize, f64)], x: &[f64]) -> f64 {
    let mut sum = Sum::default();
    for &(i, v) in motion {
        sum.add_product(v, x[i]);
    }
    sum.value()
}

pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sum = Sum::default();
    for (a, b) in a.iter().zip(b) {
        sum.add_product(*a, *b);
    }
    sum.value()
}
