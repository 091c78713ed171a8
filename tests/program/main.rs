//! The program as a user runs it: its messages, files and promises, and its remains after failures.

#[path = "../common/close.rs"]
mod close;
#[path = "../common/or_panic.rs"]
mod or_panic;
#[path = "../common/random.rs"]
mod random;

mod cli;
mod converged;
mod decks;
mod examples;
#[cfg(unix)]
mod faults;
#[cfg(not(feature = "mpi"))]
mod launchers;
mod reports;
mod run;
mod solid_files;
mod threads;
