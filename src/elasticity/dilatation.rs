//! Elements for nearly incompressible bodies: the dilatation is projected on few functions in each element.
//!
//! The strain energy is μ ∫ dev ε : dev ε + ½ κ ∫ (π div u)², where π is the projection on the mean in an element, or
//! on the linear functions there. With the full div u, nearly incompressible elements have as many constraints as
//! unknowns and lock. The functions m are orthonormal in the element, so that ∫ (π div u)² is a sum of squares, Σ (∫ m
//! div u)².

use super::Plane;
use crate::mesh::shape::Point;

/// Most functions that a dilatation is projected on: 1, x, y, z.
const MOST: usize = 4;

/// The projection in an element with N nodes.
pub(super) struct Dilatation<const D: usize, const N: usize> {
    /// ∫ m ∂(div u)/∂uₐ for each function m and node a.
    integrals: [[[f64; D]; N]; MOST],
    /// The functions in terms of 1 and the coordinates from the middle, one a row.
    functions: [[f64; MOST]; MOST],
    middle: [f64; D],
    size: f64,
    count: usize,
}

impl<const D: usize, const N: usize> Dilatation<D, N> {
    /// On `count` functions, 1 or 1 + D, in an element with these points of integration; `plane` is for the plane.
    pub fn new(count: usize, points: &[Point<D, N>], x: &[[f64; D]; N], plane: Plane) -> Self {
        let volume: f64 = points.iter().map(|point| point.weight).sum();
        let mut middle = [0.0; D];
        for point in points {
            let place = point.place(x);
            (0..D).for_each(|c| middle[c] += point.weight / volume * place[c]);
        }
        let mut made = Self {
            integrals: [[[0.0; D]; N]; MOST],
            functions: std::array::from_fn(|k| {
                std::array::from_fn(|l| f64::from(u8::from(k == l)))
            }),
            middle,
            // So that the coordinates are of the size of 1.
            size: volume.abs().powf(1.0 / D as f64),
            count,
        };
        let at: Vec<[f64; MOST]> = points
            .iter()
            .map(|point| made.monomials(point.place(x)))
            .collect();
        // Gram and Schmidt.
        for k in 0..count {
            let values = |f: &[f64; MOST]| -> Vec<f64> {
                at.iter()
                    .map(|at| (0..count).map(|l| f[l] * at[l]).sum())
                    .collect()
            };
            let product = |a: &[f64], b: &[f64]| -> f64 {
                (points.iter().zip(a).zip(b))
                    .map(|((point, a), b)| point.weight * a * b)
                    .sum()
            };
            let mut function = made.functions[k];
            for before in &made.functions[..k] {
                let part = product(&values(&function), &values(before));
                (0..count).for_each(|l| function[l] -= part * before[l]);
            }
            let own = values(&function);
            let length = product(&own, &own).sqrt();
            made.functions[k] = function.map(|f| f / length);
            for (point, value) in points.iter().zip(own) {
                let weight = point.weight * value / length;
                let hoop = plane.hoop(point.place(x));
                for (a, integral) in made.integrals[k].iter_mut().enumerate() {
                    let part = point.divergence(a, hoop);
                    (0..D).for_each(|c| integral[c] += weight * part[c]);
                }
            }
        }
        made
    }

    fn monomials(&self, place: [f64; D]) -> [f64; MOST] {
        std::array::from_fn(|k| match k {
            0 => 1.0,
            _ if k <= D => (place[k - 1] - self.middle[k - 1]) / self.size,
            _ => 0.0,
        })
    }

    /// Adds `factor` times the part of Σ (∫ m div u)²/2 for nodes a and b to a block.
    pub fn add(&self, factor: f64, [a, b]: [usize; 2], block: &mut [[f64; D]; D]) {
        for of in &self.integrals[..self.count] {
            for i in 0..D {
                for j in 0..D {
                    block[i][j] += factor * of[a][i] * of[b][j];
                }
            }
        }
    }

    /// The functions at a place.
    pub fn values(&self, place: [f64; D]) -> [f64; MOST] {
        let monomials = self.monomials(place);
        std::array::from_fn(|k| match k < self.count {
            true => (self.functions[k].iter().zip(monomials))
                .map(|(f, m)| f * m)
                .sum(),
            false => 0.0,
        })
    }

    /// The part of π div u at a place due to the motion of node a along each axis.
    pub fn gradient(&self, place: [f64; D], a: usize) -> [f64; D] {
        let monomials = self.monomials(place);
        let mut sum = [0.0; D];
        for (of, function) in self.integrals[..self.count].iter().zip(&self.functions) {
            let value: f64 = (0..self.count).map(|l| function[l] * monomials[l]).sum();
            (0..D).for_each(|c| sum[c] += value * of[a][c]);
        }
        sum
    }

    /// π div u at a place, where the nodes move by u.
    pub fn at(&self, place: [f64; D], u: &[[f64; D]; N]) -> f64 {
        let monomials = self.monomials(place);
        (self.integrals[..self.count].iter().zip(&self.functions))
            .map(|(of, function)| {
                let part: f64 = (of.iter().zip(u))
                    .map(|(integral, u)| integral.iter().zip(u).map(|(g, u)| g * u).sum::<f64>())
                    .sum();
                part * (0..self.count)
                    .map(|l| function[l] * monomials[l])
                    .sum::<f64>()
            })
            .sum()
    }
}
