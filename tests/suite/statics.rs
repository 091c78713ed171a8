//! Contact judged by statics alone: a body stands exactly if the loads on it have their resultant within the convex hull
//! of what its boundary and the other one have in common, however the meshes cut that up. The oracles share no code with
//! the solver: polygons are clipped here, and loads are made such that their resultants are known.
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
