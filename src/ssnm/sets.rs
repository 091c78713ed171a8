//! The active and inactive sets of Step 2.

use super::law::Law;

/// What a multiplier is held to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Held {
    /// In 𝒜: unknown of the inner problem.
    Free,
    /// In ℐν: λν = 0.
    Zero,
    /// In ℐτ⁺: λτ = g.
    Plus,
    /// In ℐτ⁻: λτ = −g.
    Minus,
}

/// The sets 𝒜ν, ℐν, 𝒜τ, ℐτ⁺ and ℐτ⁻, as one entry per multiplier.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sets(Vec<Held>);

/// How many contact nodes are in each set; a separated node sticks or slips as well, if it has friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct SetSizes {
    /// ℐν: not in contact.
    pub separated: usize,
    /// 𝒜τ: λτ below the bound.
    pub stick: usize,
    /// ℐτ⁺: λτ = g.
    pub slip_plus: usize,
    /// ℐτ⁻: λτ = −g.
    pub slip_minus: usize,
    /// No law of friction acts: neither stick nor slip.
    pub frictionless: usize,
}

impl Sets {
    /// The sets at λ with gradient r (Step 2). A multiplier with g = 0 has no freedom and is never free.
    pub(super) fn predict(lambda: &[f64], r: &[f64], rho: f64, g: &[f64]) -> Self {
        let m = g.len();
        Self(
            lambda
                .iter()
                .zip(r)
                .map(|(l, r)| l - rho * r)
                .enumerate()
                .map(|(i, s)| {
                    if i < m {
                        if s >= 0.0 { Held::Free } else { Held::Zero }
                    } else if s > g[i - m] {
                        Held::Plus
                    } else if s < -g[i - m] || g[i - m] == 0.0 {
                        Held::Minus
                    } else {
                        Held::Free
                    }
                })
                .collect(),
        )
    }

    /// The multipliers of λ ∈ Λ that lie on a bound and that a step against the gradient would push out.
    pub(super) fn binding(lambda: &[f64], r: &[f64], g: &[f64]) -> Self {
        let m = g.len();
        Self(
            (0..lambda.len())
                .map(|i| {
                    let (l, r) = (lambda[i], r[i]);
                    if i < m {
                        if l <= 0.0 && r >= 0.0 {
                            Held::Zero
                        } else {
                            Held::Free
                        }
                    } else if l >= g[i - m] && (r <= 0.0 || g[i - m] == 0.0) {
                        Held::Plus
                    } else if l <= -g[i - m] && r >= 0.0 {
                        Held::Minus
                    } else {
                        Held::Free
                    }
                })
                .collect(),
        )
    }

    /// Holds the free multipliers that lie on a bound; says whether there were any.
    pub(super) fn hold_at_bounds(&mut self, lambda: &[f64], g: &[f64]) -> bool {
        let m = g.len();
        let mut any = false;
        for (i, held) in self.0.iter_mut().enumerate() {
            if *held != Held::Free {
                continue;
            }
            let l = lambda[i];
            *held = if i < m {
                if l <= 0.0 { Held::Zero } else { Held::Free }
            } else if l >= g[i - m] {
                Held::Plus
            } else if l <= -g[i - m] {
                Held::Minus
            } else {
                Held::Free
            };
            any |= *held != Held::Free;
        }
        any
    }

    /// The sets at a solution λ ∈ Λ: by the multipliers themselves; where g = 0 by the direction of slip.
    pub(super) fn at_solution(lambda: &[f64], r: &[f64], g: &[f64]) -> Self {
        let m = g.len();
        Self(
            lambda
                .iter()
                .enumerate()
                .map(|(i, &l)| {
                    if i < m {
                        if l > 0.0 { Held::Free } else { Held::Zero }
                    } else {
                        let g = g[i - m];
                        if g == 0.0 {
                            // r = −Tu.
                            match r[i].partial_cmp(&0.0) {
                                Some(std::cmp::Ordering::Less) => Held::Plus,
                                Some(std::cmp::Ordering::Greater) => Held::Minus,
                                _ => Held::Free,
                            }
                        } else if l >= g {
                            Held::Plus
                        } else if l <= -g {
                            Held::Minus
                        } else {
                            Held::Free
                        }
                    }
                })
                .collect(),
        )
    }

    /// Whether multiplier i (of 2m) is an unknown of the inner problem.
    pub(super) fn is_free(&self, i: usize) -> bool {
        self.0[i] == Held::Free
    }

    /// Number of free multipliers.
    pub(super) fn n_free(&self) -> usize {
        self.0.iter().filter(|&&held| held == Held::Free).count()
    }

    /// Zeroes what is not free.
    pub(super) fn mask(&self, x: &mut [f64]) {
        for (x, held) in x.iter_mut().zip(&self.0) {
            if *held != Held::Free {
                *x = 0.0;
            }
        }
    }

    /// Puts the held multipliers on their bounds: the normal ones first, as Coulomb's bounds follow them.
    pub(super) fn set_bounds(&self, lambda: &mut [f64], law: &Law) {
        let m = lambda.len() / 2;
        for i in 0..lambda.len() {
            lambda[i] = match self.0[i] {
                Held::Free => continue,
                Held::Zero => 0.0,
                Held::Plus => law.bound(i - m, lambda[i - m]),
                Held::Minus => -law.bound(i - m, lambda[i - m]),
            };
        }
    }

    /// 2m.
    pub(super) fn len(&self) -> usize {
        self.0.len()
    }

    /// How many multipliers are held differently.
    pub fn differences(&self, other: &Self) -> usize {
        self.0.iter().zip(&other.0).filter(|(a, b)| a != b).count()
    }

    /// Whether contact node i (of m) is separated.
    pub fn is_separated(&self, i: usize) -> bool {
        self.0[i] == Held::Zero
    }

    /// −1, 0 or +1: the sign of λτ where contact node i (of m) slips, 0 where it sticks.
    pub fn slip_sign(&self, i: usize) -> i8 {
        match self.0[self.0.len() / 2 + i] {
            Held::Plus => 1,
            Held::Minus => -1,
            _ => 0,
        }
    }

    /// The sizes; `has_friction` says of which contact nodes (of m) a law of friction acts on.
    pub fn sizes(&self, has_friction: impl Fn(usize) -> bool) -> SetSizes {
        let (normal, tangential) = self.0.split_at(self.0.len() / 2);
        let mut sizes = SetSizes {
            separated: normal.iter().filter(|&&held| held == Held::Zero).count(),
            ..Default::default()
        };
        for (i, held) in tangential.iter().enumerate() {
            *match held {
                _ if !has_friction(i) => &mut sizes.frictionless,
                Held::Plus => &mut sizes.slip_plus,
                Held::Minus => &mut sizes.slip_minus,
                Held::Free | Held::Zero => &mut sizes.stick,
            } += 1;
        }
        sizes
    }
}
