//! Helpers of several rooms.

pub mod cases;
pub mod close;
pub mod draw;
pub mod half_space;
pub mod manufactured;
pub mod models;
pub mod or_panic;
pub mod oracle;
pub mod order;
pub mod published;
pub mod random;
pub mod runs;
pub mod solve;
pub mod solved;
pub mod space;

pub use close::close;
pub use random::Random;
pub use solve::{solve, solve_nested, solve_on};
pub use solved::{Solved, built, case, price_of_coulomb, solve_case, solve_case_twice};

/// max |a − b|.
pub fn apart(a: &[f64], b: &[f64]) -> f64 {
    let pairs = a.iter().zip(b);
    pairs.fold(0.0, |d: f64, (a, b)| d.max((a - b).abs()))
}

/// max |a − b| / max |b|.
pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    let scale = b.iter().fold(1e-300, |s: f64, v| s.max(v.abs()));
    apart(a, b) / scale
}
