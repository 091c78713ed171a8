//! The accuracy of sums, small decompositions and directions in f64: limits shared by algorithms.

/// Rounding of a sum relative to its terms.
pub(crate) const ROUNDING: f64 = 32.0 * f64::EPSILON;
/// Eigenvalues of a small symmetric matrix below this part of the largest are rounding. So is a direction along which A
/// curves q by less than this part of its largest eigenvalue, where rows of B depend on each other.
pub(crate) const DEPENDENT: f64 = 1e-12;
/// A vector whose part outside the span of others is smaller than this is new only by rounding: half of its digits (√ε
/// is 1.5e-8).
pub(crate) const INDEPENDENT: f64 = 1e-8;
