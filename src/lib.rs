//! Contact with friction between elastic bodies, and between a body and a rigid obstacle.
//!
//! # The problem
//!
//! A finite element discretisation of elastic bodies in contact with Tresca friction leads to: find the displacement u ∈ ℝⁿ
//! and the multipliers λν, λτ ∈ ℝᵐ (nodal contact forces) with
//!
//! ```text
//! (1)  K u + Nᵀλν + Tᵀλτ = f                                  equilibrium
//! (2)  N u − d ≤ 0,  λν ≥ 0,  λνᵀ(N u − d) = 0                no penetration, no tension
//! (3)  |λτ,i| ≤ gᵢ;  |λτ,i| < gᵢ ⇒ (T u)ᵢ = 0;                stick below the slip bound,
//!      |λτ,i| = gᵢ ⇒ (T u)ᵢ = cᵢ λτ,i with cᵢ ≥ 0             slip at it
//! ```
//!
//! In space λτ has two components for each contact node, and |λτ,i| is their Euclidean length.
//!
//! K is the stiffness matrix. The rows of N and T measure the displacement of a contact node towards the obstacle and
//! along the boundary. d is the initial gap and g the slip bound. Eliminating u leaves the minimisation of a quadratic
//! function over simple bounds (in space also discs) in the multipliers alone. The inexact semi-smooth Newton method of
//! Kučera, Motyčková and Markopoulos solves it in few products with A = B K⁻¹ Bᵀ, B = (N; T).
//!
//! Bodies that can move as a whole make K singular. Their rigid motions R are found from the coordinates
//! ([`problem::FloatingBodies`]), u = K⁺(f − Bᵀλ) + Rα, and λ has to balance them: Rᵀ(f − Bᵀλ) = 0.
//!
//! Under Coulomb's law g = μ λν is part of the solution, and of the Newton steps
//! ([`problem::ContactProblem::with_friction_coefficient`]). Load steps are several such problems in a row: [`quasistatic`].
//!
//! # The way the data flows
//!
//! ```text
//! case ─▶ model ─▶ elasticity (K, f) ─┐
//!                  contact (N, T, d, g) ┴▶ ContactProblem ─▶ dual (A, b) ─▶ ssnm ─▶ Solution ─▶ output
//!                                                 │              └─ stiffness: Cholesky | PCG
//!                                                 └─ quasistatic: load steps          └─ backend: Cpu | Gpu
//! ```
//!
//! Each stage can be entered from outside: [`problem::ContactProblem`] is the entry for matrices of your own,
//! [`model::Model`] for a mesh made in code, [`case::Case`] for a case file. [`engine::Engine`] chooses between the ways to
//! apply K⁻¹; [`dual::DirectDual`] is the simplest.
//!
//! # A problem from matrices
//!
//! Two springs in a row, the outer one pushed into a wall that is 1 away and rubs with at most 0.1:
//!
//! ```
//! use signorini::problem::{ContactProblem, Matrices, SparseRef};
//! use signorini::ssnm::{self, NewtonSettings, Status};
//! use signorini::dual::DirectDual;
//! use std::ops::ControlFlow;
//!
//! // Compressed rows: where each starts, the columns, the values. Matrices of faer: `k.as_ref().into()`.
//! let problem: ContactProblem = ContactProblem::from_matrices(Matrices {
//!     stiffness: SparseRef::from_rows(2, 2, &[0, 2, 4], &[0, 1, 0, 1], &[2.0, -1.0, -1.0, 1.0]),
//!     load: &[0.0, 1.0],
//!     normal: SparseRef::from_rows(1, 2, &[0, 1], &[1], &[1.0]),
//!     tangential: SparseRef::from_rows(1, 2, &[0, 1], &[0], &[1.0]),
//!     gap: &[1.0],
//!     slip_bound: &[0.1],
//!     ..Matrices::default()
//! })?;
//! let mut dual = DirectDual::new(&problem)?;
//! // The observer sees every outer step, and may stop the solve.
//! let solution = ssnm::solve(&problem, &mut dual, &NewtonSettings::default(), |step| {
//!     println!("step {}: err {:e}, {} products with A", step.iter, step.err, step.n_a);
//!     ControlFlow::Continue(())
//! })?;
//! assert_eq!(solution.status, Status::Converged);
//! // The wall holds the second spring at 1, friction holds back the first: 2 u₁ − 1 = −0.1.
//! assert!((solution.u[1] - 1.0).abs() < 1e-6);
//! assert!((solution.u[0] - 0.45).abs() < 1e-6);
//! // λν is the force on the wall, and at the end all conditions are checked against K.
//! assert!((solution.lambda[0] - 0.45).abs() < 1e-6);
//! assert!(solution.info.kkt.max() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`problem::ContactProblem::solve`] does all of it in one call, on the path that suits the problem.
//!
//! # Two bodies from meshes made in code
//!
//! A block lowered onto another one, with non-matching meshes and Coulomb friction:
//!
//! ```
//! use signorini::elasticity::Material;
//! use signorini::mesh::structured::{CellShape, join, rectangle};
//! use signorini::model::{Model, Pair, Support};
//! use signorini::ssnm::Status;
//!
//! let mesh = join(
//!     rectangle([0.0, 0.0], [2.0, 1.0], [10, 5], CellShape::Quad, "low", "low-"),
//!     rectangle([0.0, 1.0], [2.0, 1.0], [7, 4], CellShape::Triangle, "up", "up-"),
//! );
//! let built = Model::on(mesh)
//!     .material(Material::new(5e6, 0.4))
//!     .support(Support::on("low-bottom").fixed())
//!     .support(Support::on("up-top").x(0.0).y(|x: [f64; 2]| -0.01 - 1e-4 * x[0]))
//!     .contact(Pair::new("up-bottom", "low-top").coulomb(0.3))
//!     .build()?;
//!
//! // One load step, on the path that suits the problem.
//! let solution = built.solve(&Default::default())?.remove(0);
//! assert_eq!(solution.status, Status::Converged);
//!
//! // Displacements of all nodes, and pressures at the contact places.
//! let u = built.step(0)?.unknowns.displacements(&solution.u);
//! let places = built.elastic.contact.places.iter();
//! let pressures: Vec<f64> = places.zip(&solution.lambda).map(|(place, l)| l / place.area).collect();
//! assert!(u.iter().all(|u| u[1] <= 0.0));
//! assert!(pressures.iter().all(|&p| p > 2e4 && p < 5e4));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # A case file
//!
//! ```
//! # #[cfg(feature = "case")] {
//! use signorini::case::Case;
//! use signorini::output::ContactFields;
//! use std::path::Path;
//!
//! let case = Case::read(Path::new("examples/press.toml"), &["solver.tolerance=1e-6".to_owned()])?;
//! let built = case.build()?.plane().expect("an elastic case of the plane");
//! let mut options = signorini::solve::SolveOptions::default();
//! options.settings = case.settings();
//! let solution = built.solve(&options)?.remove(0);
//! let fields = ContactFields::new(&built.problem, &built.elastic, &built.step(0)?, &solution);
//! let highest = fields.pressure.iter().copied().fold(0.0, f64::max);
//! assert!(highest > 4e7 && highest < 4.5e7);
//! # }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Load steps with an observer
//!
//! [`model::Analysis::solve_on`] makes the load steps of a model, calls an observer for each, and stops at the observer's
//! request; [`output::Results`] writes what `signorini solve` writes.

#![warn(missing_docs)]
// docs.rs shows which feature an item needs.
#![cfg_attr(docsrs, feature(doc_cfg))]

// The program names the library as everybody does.
#[cfg(feature = "cli")]
extern crate self as signorini;

pub mod backend;
// For the program and the tests only: not a part of the public library.
#[cfg(all(feature = "cli", feature = "gpu"))]
#[doc(hidden)]
pub mod bench;
#[cfg(feature = "case")]
pub mod case;
// The program, which no other room uses: here so that the executable and the wheel (python/) share it.
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
mod constraint;
pub mod contact;
pub mod control;
#[cfg(feature = "case")]
pub mod deck;
mod dense;
pub mod dual;
pub mod elasticity;
pub mod engine;
pub mod input;
mod large;
#[cfg(test)]
mod lattice;
pub mod matrix_market;
pub mod memory;
pub mod mesh;
pub mod model;
#[cfg(feature = "mpi")]
pub mod mpi;
#[cfg(feature = "files")]
pub mod output;
pub mod problem;
pub mod quasistatic;
mod ranks;
#[doc(hidden)]
pub mod reference;
mod rigid;
mod rounding;
pub mod solve;
pub mod sparse;
pub mod ssnm;
pub mod stiffness;
#[doc(hidden)]
pub mod table1;
