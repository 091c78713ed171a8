//! Contact with friction between elastic bodies, and between a body and a rigid obstacle.
//!
//! # The problem
//!
//! A finite element discretisation of elastic bodies in contact with Tresca friction leads to: find the
//! displacement u ∈ ℝⁿ and the multipliers λν, λτ ∈ ℝᵐ (nodal contact forces) with
//!
//! ```text
//! (1)  K u + Nᵀλν + Tᵀλτ = f                                  equilibrium
//! (2)  N u − d ≤ 0,  λν ≥ 0,  λνᵀ(N u − d) = 0                no penetration, no tension
//! (3)  |λτ,i| ≤ gᵢ;  |λτ,i| < gᵢ ⇒ (T u)ᵢ = 0;                stick below the slip bound,
//!      |λτ,i| = gᵢ ⇒ (T u)ᵢ = cᵢ λτ,i with cᵢ ≥ 0             slip at it
//! ```
//!
//! K is the stiffness matrix, the rows of N and T measure the displacement of a contact node towards the
//! obstacle and along the boundary, d is the initial gap and g the slip bound. Eliminating u leaves the
//! minimisation of a quadratic function over simple bounds in 2m unknowns, which the inexact semi-smooth
//! Newton method of Kučera, Motyčková and Markopoulos solves in few products with A = B K⁻¹ Bᵀ,
//! B = (N; T).
//!
//! # The way the data flows
//!
//! ```text
//! case ─▶ mesh ─▶ elasticity (K, f) ─┐
//!                 contact (N, T, d, g) ┴▶ ContactProblem ─▶ dual (A, b) ─▶ ssnm ─▶ Solution ─▶ output
//!                                                                        └─ stiffness: Cholesky | PCG
//!                                                                             └─ backend: Cpu | Gpu
//! ```
//!
//! Each stage can be entered from outside: [`problem::ContactProblem`] is the door for matrices of your
//! own, [`case::Case`] that for a case file. [`engine::Engine`] chooses between the ways to apply K⁻¹.
//!
//! # A first solve
//!
//! Two springs in a row, the outer one pushed into a wall that is 1 away and rubs with at most 0.1:
//!
//! ```
//! use signorini::problem::{ContactData, ContactProblem};
//! use signorini::sparse::{BlockCsr, Csr};
//! use signorini::ssnm::{self, Settings, Status};
//! use signorini::stiffness::cholesky::CholeskyDual;
//! use std::ops::ControlFlow;
//!
//! let problem = ContactProblem::new(ContactData {
//!     stiffness: BlockCsr::from_triplets(2, 2, [(0, 0, 2.0), (0, 1, -1.0), (1, 0, -1.0), (1, 1, 1.0)]),
//!     load: vec![0.0, 1.0],
//!     normal: Csr::from_triplets(1, 2, [(0, 1, 1.0)]),
//!     tangential: Csr::from_triplets(1, 2, [(0, 0, 1.0)]),
//!     gap: vec![1.0],
//!     slip_bound: vec![0.1],
//!     coordinates: None,
//! })?;
//! let mut dual = CholeskyDual::new(&problem)?;
//! let solution = ssnm::solve(&problem, &mut dual, &Settings::default(), |step| {
//!     println!("step {}: err {:e}", step.iter, step.err);
//!     ControlFlow::Continue(())
//! })?;
//! assert_eq!(solution.status, Status::Converged);
//! // The wall holds the second spring at 1, friction holds back the first: 2 u₁ − 1 = −0.1.
//! assert!((solution.u[1] - 1.0).abs() < 1e-6);
//! assert!((solution.u[0] - 0.45).abs() < 1e-6);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod backend;
pub mod bench;
pub mod case;
pub mod contact;
pub mod dual;
pub mod elasticity;
pub mod engine;
pub mod matrix_market;
pub mod mesh;
pub mod output;
pub mod problem;
pub mod quasistatic;
pub mod reference;
pub mod sparse;
pub mod ssnm;
pub mod stiffness;
pub mod table1;
