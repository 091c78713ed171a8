//! The numbers of the method that are neither the paper's nor the user's, in one table.
//!
//! Their effect was measured by halving and doubling each over templates, hard cases and random problems
//! (`docs/constants.md`; `cargo test --release --test suite -- --ignored --nocapture campaign::ablation`).

/// Defines [`Numbers`] with its defaults, and the names by which an ablation changes them.
macro_rules! numbers {
    ($($(#[doc = $text:literal])+ $name:ident: $kind:ty = $value:expr;)+) => {
        /// The numbers of the method, for research: [`super::NewtonSettings::numbers`]. Other users leave them alone.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct Numbers {
            $($(#[doc = $text])+ pub $name: $kind,)+
        }

        impl Default for Numbers {
            fn default() -> Self {
                Self { $($name: $value,)+ }
            }
        }

        impl Numbers {
            /// Their names.
            pub const NAMES: &[&str] = &[$(stringify!($name)),+];

            /// With one of them multiplied by a factor, and rounded if it is a count; unchanged if there is none of this
            /// name.
            pub fn times(mut self, name: &str, factor: f64) -> Self {
                match name {
                    $(stringify!($name) => {
                        let changed = factor * self.$name as f64;
                        let is_count = stringify!($kind) == "usize";
                        self.$name = (if is_count { changed.round() } else { changed }) as $kind;
                    })+
                    _ => {}
                }
                self
            }
        }
    };
}

numbers! {
    /// A multiplier is scaled by (median compliance / own compliance) to this power: half makes the diagonal of A even.
    /// Slightly less, because rounding must not decide on corners, which are stiffer by exactly a factor of four.
    scaling: f64 = 0.5 * (1.0 - 1e-9);
    /// The error of a product by PCG relative to √(pᵀAp), in the norm of A, and the allowed error of r, as a part of the
    /// present error. Case B to 1e-4 takes 9 products of two V-cycles each with 0.05, 0.1 and 0.2, and does not converge
    /// with 0.3, one V-cycle each. Where PCG is slow, the remaining error moves the contact more than its energy suggests:
    /// then it is this part of that.
    product: f64 = 0.1;
    /// The same for the conjugate gradients of Algorithm ISSNM as printed, which assume exact products.
    printed_product: f64 = 1e-3;
    /// The factor in accuracy of products if nothing else makes progress, and of a final check after one that has failed:
    /// an iteration or two of PCG. Twice or half of it makes no difference.
    sharper: f64 = 0.3;
    /// The most pairs kept in the surrogate. Most problems end with fewer than 60 in a load step. A bar of 600 by 1,
    /// whose slip creeps from end to end, takes 209 products, and some 30 more with half as many pairs.
    pairs: usize = 240;
    /// A problem on the surrogate is solved to this part of the present error: products are not more accurate.
    solved: f64 = 0.03;
    /// Where A is available as a matrix, the least τ of a step on it, as a part of the mean of its diagonal. Smaller
    /// values are rounding where rows of B depend on each other. With 1e-6 every step leaves 1e-6 of forces along which
    /// A is small.
    proximal: f64 = 1e-12;
    /// τ grows by this factor after a step that is not solved, and falls by it after one that is. Of 16 random packings
    /// 15 are solved in 2 400 Newton steps; with 10, from 1e-6 on, as many in 3 500.
    proximal_factor: f64 = 100.0;
    /// The most Newton steps for it: most problems take 1 to 6, and where sweeps are needed more steps do not help.
    matrix_steps: usize = 12;
    /// Sweeps of projected Gauss–Seidel before it, in the first step and after one without progress: random packings of bodies that
    /// stagnate without them are solved in a few steps.
    sweeps: usize = 20;
    /// The most Newton steps for it; most problems take 1 to 6, bodies that have to find their position up to 30.
    newton_steps: usize = 60;
    /// Its merit has to fall by this part of the decrease that Newton's model predicts (Armijo): otherwise it may
    /// cycle.
    fall: f64 = 1e-3;
    /// Its fall is measured from the largest of this many steps before (Grippo, Lampariello and Lucidi 1986): sets that
    /// change make it go up and down.
    memory: usize = 4;
    /// The most halvings of a step: where 1/64 of it makes no progress, another direction is needed.
    halvings: usize = 6;
    /// Where q is not a measure, mainly under Coulomb's law, an error may grow by this factor in a step before a
    /// shorter step is taken. Changing sets make it go up and down.
    growth: f64 = 2.0;
    /// An error below this part of the least so far counts as progress.
    progress: f64 = 0.9;
    /// Steps without progress before steps are made shorter, under Coulomb's law. Bodies that find their position take up to 12
    /// of them.
    fruitless: usize = 15;
    /// Steps without progress under Coulomb's law before the method returns to the best point.
    patience: usize = 45;
    /// Steps in a row that do not lower the error, and pairs hidden by errors of products, before products by PCG are
    /// made more accurate. Under given bounds it is also the number of steps before the method returns to the best
    /// point, if the last one has not lowered q either.
    denied: usize = 4;
    /// The largest remaining change of a pressure by the gradient at the end, in ε times the largest pressure,
    /// estimated as if only the unknowns under the contact moved. It is a third of the promised accuracy, because other
    /// unknowns move as well.
    forces: f64 = 1000.0;
    /// Steps of conjugate gradients for this change: 100 of them find the same in all cases measured.
    force_steps: usize = 10;
    /// Forces that close less than this multiple of the rounding of a gap are not contact.
    touching: f64 = 10.0;
    /// The number of final checks that may fail although the goal was met.
    checks: usize = 5;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_changed_by_its_name() {
        let numbers = Numbers::default();
        for name in Numbers::NAMES {
            assert_ne!(numbers.times(name, 2.0), numbers, "{name}");
            assert_eq!(numbers.times(name, 1.0), numbers, "{name}");
        }
        assert_eq!(numbers.times("denied", 0.6).denied, 2);
        assert_eq!(numbers.times("nothing of the kind", 2.0), numbers);
    }
}
