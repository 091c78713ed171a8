//! The promise of `converged`, tested on the program as a user runs it.
//!
//! A solve that ends with exit code 0 and the status `converged` promises, in every load step, whatever the stiffness,
//! the load or the supports:
//!
//! - every optimality condition in `kkt` is met to 10 ε, ε = `solver.tolerance`;
//! - the resultants of the contacts are accurate to 100 ε: those of a body that contact alone holds are in equilibrium
//!   with the load *of that step*;
//! - every nodal pressure and tangential traction is accurate to 1000 ε of the largest pressure.
//!
//! A body that contact and friction cannot hold ends with exit code 3 and the status `not_held`; the summary names it
//! and its motion. Any other failure ends with another status.
//!
//! The references are statics by hand, the same case in one step or at a tolerance of 1e-11, and for algebraic cases an
//! assembly of bilinear quadrilaterals in this file. Nothing here uses the library. Every case runs on the direct and
//! on the iterative path.
//!
//! `cargo test --release --test program -- --ignored --nocapture converged::` tries 200 random cases.

mod accuracy;
mod bodies;
mod cases;
mod held;
mod matrices;
mod reference;
mod run;
mod steps;
