//! Contact judged by statics alone: a body is held exactly if the resultant of the loads on it is within the convex hull of the
//! common area of its boundary and the other one, however the meshes divide that. The oracles share no code with the solver:
//! polygons are clipped here, and loads have known resultants.
//!
//! `cargo test --release --test suite -- --ignored --nocapture statics::` tries a thousand stacks (`STATICS_SEED=…` for others).

mod bridges;
mod column;
mod common_area;
mod needles;
mod patch;
mod plates;
mod rows;
mod scene;
mod spots;
mod stacks;
