//! Contact between solids, against what is known: states of constant stress, the plane's answers, and closed forms.
//!
//! `cargo test --release --test pairs -- --nocapture` prints the figures of docs/validation.md; with `--ignored` those of
//! finer meshes.

#[path = "../common/mod.rs"]
mod common;

mod assemblies;
mod extruded;
mod patch;
mod spheres;
