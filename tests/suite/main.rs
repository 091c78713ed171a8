//! All tests that need only the library, as one program: code generic in the dimension is compiled once for all of
//! them.
//!
//! `cargo test --release --test suite -- coulomb` runs the tests of a room.

#[path = "../common/mod.rs"]
mod common;

mod axisymmetric;
mod bolts;
mod by_row;
mod campaign;
mod case_c;
mod changes;
mod clamped;
mod compliance;
mod contact;
mod coulomb;
mod coulomb_space;
mod counts;
mod couplings;
mod cyclic;
mod decks;
mod decks_names;
mod elastic;
mod equal;
mod export;
mod far;
mod foundations;
mod gmsh;
mod gpu;
mod half_space;
mod incompatible;
mod invariance;
mod large;
mod manufactured;
mod nested;
mod nodal_data;
mod node_contact;
mod other_meshes;
mod overlap;
mod packings;
mod pairs;
mod pressed;
mod quasistatic;
mod releases;
mod second_order;
mod second_order_meshes;
mod slides;
mod solid_cases;
mod solids;
mod springs;
mod statics;
mod thermal;
mod thickness;
mod ties;
mod updated;
mod validation;
mod wear;
