//! Products with A and the gradient r = Aλ − b.
//!
//! Where K⁻¹ is applied by a factor, products are exact and r is carried along with λ. Where it is a matter of iterations,
//! a product is made to a part of its energy ([`PART`]), and r is not carried: it is c − B u with a u that follows λ. What
//! of u a product has found is added to it, and PCG on the residual f − Bᵀλ − K u takes out what products and earlier
//! steps have left, one or two iterations a step. Without these errors pile up, and err comes to a halt at 1e-3 or so.

use super::Method;
use super::scaling::Scaled;
use crate::control::{Accuracy, Followed, Stop};
use crate::dual::{DualError, DualOperator};
use crate::problem::LoadCase;
use crate::sparse::{add_times, difference, norm};

/// The error of a product relative to √(pᵀAp), in the norm of A. Case B to 1e-4 (`tests/counts.rs`) takes 9 products of
/// two V-cycles each with 0.05, 0.1 and 0.2, and does not converge with 0.3, one V-cycle each.
const PART: f64 = 0.1;
/// The same for the conjugate gradients of the algorithms as printed, which work on as if products were exact.
const PRINTED: f64 = 1e-3;
const PRINTED_EXACT: f64 = 1e-10;
/// Where PCG is slow, what it has left of an error moves the contact more than its energy says: so much more accuracy.
const SLOW: f64 = 0.1;
/// r is made as accurate as this part of the present error. An error e of u falsifies r by B e, at most √σ_max · √(eᵀKe) in
/// length. That bound is 25 to 140 times too large for all but the smoothest e, so the ratio ‖Be‖ / √(eᵀKe) is taken from
/// what the last change of u has brought; what turns out less accurate than this many times what it may be is made again.
const RELAXED: f64 = 0.1;
const ENOUGH: f64 = 2.0;
/// The relative accuracy of the first r.
const FIRST: f64 = 1e-2;
/// Where nothing else makes progress more accuracy is asked for, but not without end.
const TIGHTER: f64 = 0.3;
const LEAST_PART: f64 = 1e-6;

/// The dual operator, how accurately it is used, and how often.
pub(super) struct Products<'a, O: ?Sized> {
    pub dual: Scaled<'a, O>,
    load: &'a LoadCase,
    pub stop: Stop<'a>,
    /// Products so far.
    pub n_a: usize,
    /// r is made from a u that follows λ; otherwise it is carried.
    follows: bool,
    /// The relative accuracy of products.
    part: f64,
    /// How u came closer the last time.
    followed: Followed,
    /// ‖Be‖ / √(eᵀKe) for the last change e of u.
    gain: f64,
}

impl<'a, O: DualOperator + ?Sized> Products<'a, O> {
    /// `sigma` is what is known of σ_max.
    pub fn new(
        dual: Scaled<'a, O>,
        load: &'a LoadCase,
        method: Method,
        stop: Stop<'a>,
        sigma: f64,
    ) -> Self {
        Self {
            dual,
            load,
            stop,
            n_a: 0,
            follows: true,
            part: match method {
                Method::Multisecant => PART,
                Method::Inexact => PRINTED,
                Method::Exact => PRINTED_EXACT,
            },
            followed: Followed::default(),
            gain: sigma.sqrt(),
        }
    }

    /// Whether r is carried without error.
    pub fn are_exact(&self) -> bool {
        !self.follows
    }

    /// The error that a product may have, relative to √(pᵀAp) in the norm of A; nothing where K⁻¹ is applied by a factor.
    pub fn part(&self) -> f64 {
        match self.dual.costs() {
            None => 0.0,
            Some(_) if self.followed.slow => SLOW * self.part,
            Some(_) => self.part,
        }
    }

    /// Asks for more accuracy from here on; false where there is none to be had.
    pub fn sharpen(&mut self) -> bool {
        if self.part() == 0.0 || self.part <= LEAST_PART {
            return false;
        }
        self.part *= TIGHTER;
        true
    }

    /// u at λ but for the motions of free bodies: [`DualOperator::displacement`].
    pub fn displacement(
        &mut self,
        lambda: &[f64],
        residual: f64,
        stop: &Stop,
    ) -> Result<Vec<f64>, DualError> {
        self.dual.displacement(self.load, lambda, residual, stop)
    }

    /// A p.
    pub fn apply(&mut self, p: &[f64]) -> Result<Vec<f64>, DualError> {
        let accuracy = Accuracy::Energy {
            absolute: 0.0,
            relative: self.part(),
        };
        let mut image = vec![0.0; p.len()];
        self.dual.apply(p, &mut image, accuracy, &self.stop)?;
        self.n_a += 1;
        Ok(image)
    }

    /// r at the λ to start from, of which `c` are the offsets; one product where r is carried and λ is not zero.
    pub fn first(&mut self, c: &[f64], lambda: &[f64]) -> Result<Vec<f64>, DualError> {
        let accuracy = Accuracy::Energy {
            absolute: 0.0,
            relative: FIRST.min(self.part),
        };
        let mut r = c.to_vec();
        if self.follow(lambda, &mut r, 0.0, accuracy)? {
            return Ok(r);
        }
        self.dual
            .right_hand_side(self.load, &mut r, accuracy, &self.stop)?;
        r.iter_mut().for_each(|b| *b = -*b);
        if lambda.iter().any(|&l| l != 0.0) {
            let image = self.apply(lambda)?;
            add_times(1.0, &image, &mut r);
        }
        Ok(r)
    }

    /// r at a λ that has moved by `along` times the p of the last product, as accurate as an error of `err` needs it;
    /// `expected` is what r was taken for so far. None where r is carried.
    pub fn afresh(
        &mut self,
        lambda: &[f64],
        along: f64,
        err: f64,
        expected: &[f64],
    ) -> Result<Option<Vec<f64>>, DualError> {
        let accuracy = Accuracy::Energy {
            absolute: self.relaxed() * err / self.gain,
            relative: 0.0,
        };
        let mut r = vec![0.0; lambda.len()];
        if !self.follow(lambda, &mut r, along, accuracy)? {
            return Ok(None);
        }
        let (moved, change) = (norm(&difference(&r, expected)), self.followed.change);
        if change > 0.0 && moved > 0.0 {
            let gain = moved / change;
            // Where PCG is slow, what it has mended at first hardly moves the contact, what it has left does.
            self.gain = if self.followed.slow {
                gain.max(self.gain)
            } else {
                gain
            };
        }
        Ok(Some(r))
    }

    /// Whether r made afresh is as accurate as an error of `err` needs it.
    pub fn is_enough(&self, err: f64) -> bool {
        self.gain * self.followed.remaining <= ENOUGH * self.relaxed() * err
    }

    /// The part of the present error that r may be off by.
    fn relaxed(&self) -> f64 {
        RELAXED * (self.part / PART).min(1.0)
    }

    /// r from a u that follows λ; false where it is carried.
    fn follow(
        &mut self,
        lambda: &[f64],
        r: &mut [f64],
        along: f64,
        accuracy: Accuracy,
    ) -> Result<bool, DualError> {
        if !self.follows {
            return Ok(false);
        }
        let made = (self.dual).gradient(self.load, lambda, r, along, accuracy, &self.stop)?;
        match made {
            Some(followed) => self.followed = followed,
            // Or a GPU has failed in between, and products are exact from now on.
            None => self.follows = false,
        }
        Ok(self.follows)
    }
}
