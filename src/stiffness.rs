//! Solvers for the stiffness matrix K.

pub mod amg;
pub mod cholesky;
mod ordering;
mod panel;
pub mod pcg;
