//! Products with A and the gradient r = Aλ − b.
//!
//! With a factor, products are exact and r is updated along with λ. With iterations, a product is made to a part of its
//! energy ([`super::Numbers::product`]). r is not updated but recomputed: it is c − B u with a u that follows λ. The
//! displacement found by a product is added to u. PCG on the residual f − Bᵀλ − K u then removes the errors of products
//! and earlier steps, in one or two iterations a step. Without them errors accumulate, and err stops at about 1e-3.

use super::scaling::Scaled;
use super::{EXACT, Method, NewtonSettings, Numbers};
use crate::control::{Accuracy, Correction, Stop};
use crate::dual::{DualError, Request};
use crate::problem::{LoadCase, beyond};
use crate::rounding::ROUNDING;
use crate::sparse::{add_times, norm};
use std::sync::Arc;

/// The dual operator, the accuracy of its products, and their number.
pub(super) struct Products<'a> {
    pub dual: Scaled<'a>,
    load: &'a LoadCase,
    pub stop: Stop<'a>,
    /// Products so far.
    pub n_a: usize,
    numbers: Numbers,
    /// The relative accuracy of products, initially and now.
    first: f64,
    part: f64,
    /// The accuracy of the last correction of u.
    correction: Correction,
    /// ‖Be‖ / √(eᵀKe) for the last change e of u.
    gain: f64,
}

impl<'a> Products<'a> {
    /// `sigma` is the known value of σ_max.
    pub fn new(
        dual: Scaled<'a>,
        load: &'a LoadCase,
        settings: &NewtonSettings,
        stop: Stop<'a>,
        sigma: f64,
    ) -> Self {
        let numbers = settings.numbers;
        let part = match settings.method {
            Method::Multisecant => numbers.product,
            Method::Inexact => numbers.printed_product,
            Method::Exact => EXACT,
        };
        Self {
            dual,
            load,
            stop,
            n_a: 0,
            numbers,
            first: part,
            part,
            correction: Correction::default(),
            gain: sigma.sqrt(),
        }
    }

    /// Whether r is carried without error.
    pub fn are_exact(&self) -> bool {
        self.dual.operator.is_exact()
    }

    /// The error that a product may have, relative to √(pᵀAp) in the norm of A; nothing where K⁻¹ is applied by a factor.
    pub fn part(&self) -> f64 {
        match self.dual.operator.costs() {
            None => 0.0,
            Some(_) if self.correction.slow => self.numbers.product * self.part,
            Some(_) => self.part,
        }
    }

    /// Requests more accuracy from here on; false if that is impossible, or beyond the accuracy of the answer.
    pub fn tighten(&mut self, tolerance: f64) -> bool {
        if self.part() == 0.0 || self.part <= tolerance {
            return false;
        }
        self.part *= self.numbers.sharper;
        true
    }

    /// Computes r from a refined u from here on; false if this is already so, or if K⁻¹ is applied by iterations.
    pub fn refine(&mut self) -> bool {
        self.are_exact() && self.dual.operator.refine()
    }

    /// u at λ, up to the motions of floating bodies, with ‖f − Bᵀλ − Ku‖ ≤ `residual`.
    pub fn displacement(
        &mut self,
        lambda: &[f64],
        residual: f64,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        let (lambda, accuracy) = (self.dual.unscaled(lambda), Accuracy::Residual(residual));
        let request = Request::new(self.load.force(), &lambda, accuracy, stop);
        self.dual.operator.displacement(&request)
    }

    /// u under these forces alone, of this size.
    pub fn moved_by(&mut self, force: Vec<f64>, size: f64) -> Result<Vec<f64>, DualError> {
        let (force, none) = (Arc::new(force), vec![0.0; self.dual.operator.size().1]);
        let accuracy = Accuracy::Residual(EXACT * size);
        let request = Request::new(&force, &none, accuracy, &self.stop);
        self.dual.operator.displacement(&request)
    }

    /// A p.
    pub fn apply(&mut self, p: &[f64]) -> Result<Vec<f64>, DualError> {
        let accuracy = Accuracy::Energy {
            absolute: 0.0,
            relative: self.part(),
        };
        let image = self.dual.apply(p, accuracy, &self.stop)?;
        self.n_a += 1;
        Ok(image)
    }

    /// r at the initial λ; one product where r is updated and λ is not zero.
    pub fn first(&mut self, lambda: &[f64]) -> Result<Vec<f64>, DualError> {
        let accuracy = Accuracy::Energy {
            absolute: 0.0,
            relative: self.numbers.product * self.part,
        };
        if !self.are_exact() {
            return self.gradient(lambda, 0.0, accuracy);
        }
        let mut r = self.gradient(&vec![0.0; lambda.len()], 0.0, accuracy)?;
        if lambda.iter().any(|&l| l != 0.0) {
            let image = self.apply(lambda)?;
            add_times(1.0, &image, &mut r);
        }
        Ok(r)
    }

    /// r at a λ that has moved by `along` times the p of the last product, as accurate as an error of `err` requires.
    /// `expected` is the assumed r so far. None where r is updated.
    pub fn afresh(
        &mut self,
        lambda: &[f64],
        along: f64,
        err: f64,
        expected: &[f64],
    ) -> Result<Option<Vec<f64>>, DualError> {
        if self.are_exact() {
            return Ok(None);
        }
        let accuracy = Accuracy::Energy {
            absolute: self.relaxed() * err / self.gain,
            relative: 0.0,
        };
        let r = self.gradient(lambda, along, accuracy)?;
        // A GPU may have failed in the meantime.
        if self.are_exact() {
            return Ok(None);
        }
        let moved: Vec<f64> = (r.iter().zip(expected))
            .map(|(r, expected)| beyond(r - expected, ROUNDING * r.abs()))
            .collect();
        let (moved, change) = (norm(&moved), self.correction.change);
        if change > 0.0 && moved > 0.0 {
            let gain = moved / change;
            // Where PCG is slow, the error removed first hardly moves the contact, but the remaining error does.
            self.gain = if self.correction.slow {
                gain.max(self.gain)
            } else {
                gain
            };
        }
        Ok(Some(r))
    }

    /// Whether a recomputed r is roughly as accurate as an error of `err` requires.
    pub fn is_enough(&self, err: f64) -> bool {
        self.gain * self.correction.remaining <= 2.0 * self.relaxed() * err
    }

    /// The error that r may have, as a part of the present error err.
    ///
    /// An error e of u changes r by B e, at most √σ_max · √(eᵀKe) in length. That bound is 25 to 140 times too large for all
    /// but the smoothest e, so the ratio ‖Be‖ / √(eᵀKe) is taken from the last change of u.
    fn relaxed(&self) -> f64 {
        self.numbers.product * (self.part / self.first)
    }

    /// r at λ, from u.
    fn gradient(
        &mut self,
        lambda: &[f64],
        along: f64,
        accuracy: Accuracy,
    ) -> Result<Vec<f64>, DualError> {
        let unscaled = self.dual.unscaled(lambda);
        let mut r = vec![0.0; lambda.len()];
        let request = Request {
            along,
            ..Request::new(self.load.force(), &unscaled, accuracy, &self.stop)
        };
        self.correction = self.dual.operator.at_contact(&request, &mut r)?;
        (self.dual).finish_gradient(&self.load.offsets(), &unscaled, &mut r);
        Ok(r)
    }
}
