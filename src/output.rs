//! What a solve leaves behind: `report.json`, `solution.vtu`, `contact.csv`, or the vectors of an
//! algebraic case; with the feature `plots`, pictures and `report.html`.

mod fields;
mod files;
mod hints;
#[cfg(feature = "plots")]
pub mod plots;
mod reactions;
mod report;
mod resources;
mod vtu;

pub(crate) use fields::shown_at_nodes;
pub use fields::{ContactFields, NodeStatus, StepFields};
pub use files::{
    OutputError, prepare, withdraw, write_index, write_report, write_solution, write_whole,
};
pub use reactions::{ContactReport, SupportReport};
pub use report::{EnginePath, HistoryRow, NotHeldReport, Report, StepReport, Timings};
pub use resources::{forget_peak_memory, peak_memory_mib};

/// Adds a line to a text.
fn put(text: &mut String, line: std::fmt::Arguments) {
    use std::fmt::Write as _;
    text.write_fmt(line)
        .expect("writing to a string cannot fail");
    text.push('\n');
}
