//! Products with A and the gradient r = Aλ − b, as accurately as the present error needs them.
//!
//! Where K⁻¹ is applied by a factor, products are exact and r is carried along with λ. Where it is a matter
//! of iterations, three things keep their number low:
//!
//! - **Relaxation.** A product that is falsified by E p falsifies the carried r by α E p, α the length of
//!   the step. So after some steps r is off by at most Σ αⱼ ‖Eⱼpⱼ‖, and CG works on as if products were
//!   exact for as long as this sum is below the residual (van den Eshof and Sleijpen, SIAM J. Matrix Anal.
//!   Appl. 26 (2004) 125–153; Simoncini and Szyld, SIAM J. Sci. Comput. 25 (2003) 454–477). Each
//!   product may add a fixed part of the present error ([`RELAXED`]); the sum is kept as `drift`, CG ends
//!   where it reaches the residual, and r is made afresh once it is no longer small beside the error.
//! - **Following.** r made afresh is c − B u with u = K⁻¹(f − Bᵀλ), and the u of the last time is a good
//!   start. What a product has left out does not pile up: it is part of the residual f − Bᵀλ − K u that the
//!   next one starts from. A jump of λ needs no product of its own, r is made afresh where it lands.
//! - **Recycling.** What of p lies in the span of the directions known so far has a known image; only the
//!   rest p' = p − W WᵀA p goes through K⁻¹. This is the projection of the system with K on all earlier
//!   solutions K⁻¹Bᵀw, which are K-orthogonal as the w are A-orthogonal, without storing any of them.
//!
//! An error e of K⁻¹Bᵀp or of u falsifies A p or r by B e, at most √σ_max · √(eᵀKe) in length. That bound
//! is 25 to 140 times too large for all but the smoothest e, so the ratio ‖Be‖ / √(eᵀKe) is taken from
//! what the last change of u has brought, or from all of them where PCG is slow. The final check, which trusts
//! nothing, tells if that was too bold.

use super::scaling::Scaled;
use super::subspace::Subspace;
use crate::control::{Accuracy, Followed, Stop};
use crate::dual::{DualError, DualOperator, scatter, spectrum};
use crate::sparse::{dot, norm};

/// The part of the present error by which one product, or r made afresh, may be off.
const RELAXED: f64 = 0.1;
/// The same after a final check that failed, or where nothing else makes progress, relative to before.
const TIGHTER: f64 = 0.1;
/// At least this part is asked for.
const LEAST_PART: f64 = 1e-6;
/// No product is made with a larger relative error than this: it could not tell a direction of descent.
const LOOSEST: f64 = 0.1;
/// r made afresh is good enough at this multiple of what it may be off by.
const ENOUGH: f64 = 2.0;
/// Times that the accuracy is raised where r made afresh shows a much smaller error than expected.
const MOST_PASSES: usize = 5;
/// r is made afresh once the drift is more than this multiple of what one product may add.
const DRIFTED: f64 = 2.0;
/// The relative accuracy of the first r, on which nothing but err⁰ rests.
const ROUGH: f64 = 1e-2;
/// The accuracy in energy of a product where PCG is slow, relative to that of the product.
const SLOW: f64 = 0.1;
/// A direction along which A curves q by less than this part of its largest eigenvalue is not kept: where rows of B depend
/// on each other it is one of rounding, and combinations with directions that much longer than others fit no face.
const STEEP: f64 = 1e-10;
/// A part of the error to reach that does not matter.
const NEGLIGIBLE: f64 = 0.05;

/// The dual operator with all that is known of it.
pub(super) struct Products<'a, O: ?Sized> {
    pub dual: Scaled<'a, O>,
    pub stop: Stop<'a>,
    /// Products so far.
    pub n_a: usize,
    /// The estimate of σ_max.
    pub sigma: f64,
    /// What an entry of diag(A) is like, if that is known.
    pub mean: Option<f64>,
    /// All directions whose product is known.
    pub known: Subspace,
    /// By how much a product may falsify r.
    allowed: f64,
    /// The same relative to the present error.
    part: f64,
    /// The error to reach, or in the exact method what the inner problems are solved to.
    level: f64,
    /// The exact method: r has to resolve `level` from the start.
    exact: bool,
    /// What r is made afresh from, where products are not exact.
    following: Option<Following>,
}

/// The u that follows λ, as far as the multipliers see it.
struct Following {
    /// c − B u.
    r: Vec<f64>,
    /// ‖Be‖ / √(eᵀKe) for the last change e of u; 0 before the first.
    gain: f64,
    /// The largest of these ratios so far.
    largest_gain: f64,
    /// PCG is slow ([`Followed::slow`]).
    slow: bool,
    /// What r is off by.
    off: f64,
    /// What products may have falsified the carried r by since then.
    drift: f64,
}

impl<'a, O: DualOperator + ?Sized> Products<'a, O> {
    /// Knows nothing yet: [`Products::set_up`] comes next.
    pub fn new(dual: Scaled<'a, O>, exact: bool, stop: Stop<'a>) -> Self {
        Self {
            dual,
            stop,
            n_a: 0,
            sigma: 0.0,
            mean: None,
            known: Subspace::default(),
            allowed: 0.0,
            part: RELAXED,
            level: 0.0,
            exact,
            following: None,
        }
    }

    /// Makes r = Aλ − b at the λ to start from and, unless it is known, the estimate of σ_max; returns r and the
    /// products that the latter took. `c` are the offsets; `project` takes a vector to directions that leave
    /// all bodies in balance.
    pub fn set_up(
        &mut self,
        c: Vec<f64>,
        lambda: &[f64],
        sigma: Option<f64>,
        project: impl Fn(&mut [f64]),
    ) -> Result<(Vec<f64>, usize), DualError> {
        let accuracy = Accuracy::Energy {
            absolute: 0.0,
            relative: if self.exact { super::EXACT } else { ROUGH },
        };
        let mut r = vec![0.0; c.len()];
        // At u = 0, r is c.
        self.following = Some(Following {
            r: c,
            gain: 0.0,
            largest_gain: 0.0,
            slow: false,
            off: 0.0,
            drift: 0.0,
        });
        if !self.follow(lambda, &mut r, accuracy)? {
            self.dual.right_hand_side(&mut r, accuracy, &self.stop)?;
            r.iter_mut().for_each(|b| *b = -*b);
            if lambda.iter().any(|&l| l != 0.0) {
                let mut image = vec![0.0; r.len()];
                self.dual.apply(lambda, &mut image, accuracy, &self.stop)?;
                self.n_a += 1;
                r.iter_mut().zip(&image).for_each(|(r, a)| *r += a);
            }
        }
        let mut products = 0;
        self.sigma = match sigma {
            Some(sigma) => sigma,
            None => {
                let spectrum = spectrum(&mut self.dual, r.len(), project, &self.stop)?;
                (self.mean, products) = (Some(spectrum.mean), spectrum.products);
                spectrum.largest
            }
        };
        Ok((r, products))
    }

    /// What an entry of diag(A) is like: vᵀAv/vᵀv for a v without any pattern, which costs a product where σ_max was
    /// known before.
    pub fn mean(&mut self, len: usize) -> Result<f64, DualError> {
        if let Some(mean) = self.mean {
            return Ok(mean);
        }
        let (v, mut image) = (scatter(len), vec![0.0; len]);
        let accuracy = Accuracy::Energy {
            absolute: 0.0,
            relative: LOOSEST,
        };
        self.dual.apply(&v, &mut image, accuracy, &self.stop)?;
        self.n_a += 1;
        let mean = dot(&v, &image) / dot(&v, &v);
        self.mean = Some(mean);
        Ok(mean)
    }

    /// Sets the error to reach.
    pub fn aim_at(&mut self, level: f64) {
        self.level = level;
    }

    /// The error to reach.
    pub fn level(&self) -> f64 {
        self.level
    }

    /// Sets what a product may falsify r by at an error of `err`.
    pub fn allow(&mut self, err: f64) {
        let needed = if self.exact {
            self.level
        } else {
            err.max(self.level)
        };
        self.allowed = self.part * needed;
    }

    /// Asks for more accuracy from here on, and forgets what was known with less; false where there is none
    /// to be had.
    pub fn sharpen(&mut self) -> bool {
        if self.following.is_none() || self.part <= LEAST_PART {
            return false;
        }
        self.part *= TIGHTER;
        self.known = Subspace::default();
        true
    }

    /// What products may have falsified the carried r by.
    pub fn drift(&self) -> f64 {
        self.following.as_ref().map_or(0.0, |f| f.drift)
    }

    /// Whether r ought to be made afresh.
    pub fn has_drifted(&self) -> bool {
        self.drift() > DRIFTED * self.allowed
    }

    /// Whether r is carried without error.
    pub fn are_exact(&self) -> bool {
        self.following.is_none()
    }

    /// A p, which a step of length `step` along p adds to r, a vector of about the length `size`.
    pub fn apply(
        &mut self,
        p: &[f64],
        ap: &mut [f64],
        step: f64,
        size: f64,
    ) -> Result<(), DualError> {
        let mut rest = p.to_vec();
        let known = self.known.split(&mut rest, ap);
        if step * self.sigma * norm(&rest) <= NEGLIGIBLE * self.level {
            return Ok(());
        }
        let relative = (self.allowed / size).clamp(super::EXACT, LOOSEST);
        let part = match &self.following {
            // What is left of the error moves the contact more than its energy says.
            Some(following) if following.slow => SLOW * relative,
            _ => relative,
        };
        let accuracy = Accuracy::Energy {
            absolute: part * known,
            relative: part,
        };
        let mut image = vec![0.0; rest.len()];
        self.dual.apply(&rest, &mut image, accuracy, &self.stop)?;
        self.n_a += 1;
        if let Some(following) = &mut self.following {
            following.drift += relative * size;
        }
        ap.iter_mut().zip(&image).for_each(|(a, i)| *a += i);
        if dot(&rest, &image) > STEEP * self.sigma * dot(&rest, &rest) {
            self.known.add(rest, image);
        }
        Ok(())
    }

    /// Carries r along a jump of λ; false where it ought to be made afresh at its end instead.
    pub fn carry(&mut self, jump: &[f64], r: &mut [f64]) -> Result<bool, DualError> {
        let mut image = vec![0.0; jump.len()];
        if self.are_exact() {
            self.apply(jump, &mut image, 1.0, f64::INFINITY)?;
        } else {
            let mut rest = jump.to_vec();
            self.known.split(&mut rest, &mut image);
            if self.sigma * norm(&rest) > NEGLIGIBLE * self.level {
                return Ok(false);
            }
        }
        r.iter_mut().zip(&image).for_each(|(r, a)| *r += a);
        Ok(true)
    }

    /// r at λ made afresh, as accurately as the error there needs it: `error` says how large it is. Counts as
    /// one product. False, and nothing done, where products are exact.
    pub fn refresh(
        &mut self,
        lambda: &[f64],
        r: &mut [f64],
        error: impl Fn(&[f64]) -> f64,
    ) -> Result<bool, DualError> {
        for _ in 0..MOST_PASSES {
            let Some(following) = &self.following else {
                return Ok(false);
            };
            let gain = if following.gain > 0.0 {
                following.gain
            } else {
                self.sigma.sqrt()
            };
            let accuracy = Accuracy::Energy {
                absolute: self.allowed / gain,
                relative: 0.0,
            };
            if !self.follow(lambda, r, accuracy)? {
                return Ok(false);
            }
            self.allow(error(r));
            let off = self.following.as_ref().map_or(0.0, |f| f.off);
            if off <= ENOUGH * self.allowed {
                break;
            }
        }
        self.n_a += 1;
        Ok(true)
    }

    /// r at λ made afresh; false where there is no need to, as products are exact.
    fn follow(
        &mut self,
        lambda: &[f64],
        r: &mut [f64],
        accuracy: Accuracy,
    ) -> Result<bool, DualError> {
        let made = self.dual.gradient(lambda, r, accuracy, &self.stop)?;
        let (Some(following), Some(followed)) = (&mut self.following, made) else {
            self.following = None;
            self.known = Subspace::default();
            return Ok(false);
        };
        let Followed {
            change,
            remaining,
            slow,
        } = followed;
        let moved: f64 = (following.r.iter().zip(&*r))
            .map(|(old, new)| (new - old).powi(2))
            .sum();
        if change > 0.0 && moved > 0.0 {
            following.gain = moved.sqrt() / change;
            following.slow = slow;
            following.largest_gain = following.largest_gain.max(following.gain);
            // Where a soft body touches a stiff one, the ratio depends on which of them has changed; and where
            // PCG is slow, what it has mended at first hardly moves the contact, what it has left does.
            if self.part < RELAXED || slow {
                following.gain = following.largest_gain;
            }
        }
        following.off = following.gain * remaining;
        following.r.copy_from_slice(r);
        following.drift = 0.0;
        Ok(true)
    }

    /// Takes note of an r that the displacement of the final check has given.
    pub fn checked(&mut self, r: &[f64]) {
        if let Some(following) = &mut self.following {
            following.r.copy_from_slice(r);
            following.drift = 0.0;
        }
    }
}
