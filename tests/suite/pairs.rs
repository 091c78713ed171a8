//! Contact between solids, against what is known: states of constant stress, the plane's answers, and closed forms.
//!
//! `cargo test --release --test suite -- --nocapture pairs::` prints the figures of docs/validation.md; with `--ignored` those of
//! finer meshes.

mod assemblies;
mod curved;
mod extruded;
mod moved;
mod patch;
mod spheres;
