//! The results of a solve: `report.json`, `solution.vtu`, `contact.csv`, or the vectors of a problem from matrices; with the
//! feature `plots`, pictures and `report.html`. [`Results`] writes all of it as load steps end.

mod energy;
#[cfg(feature = "case")]
mod export;
mod fields;
pub(crate) mod files;
pub(crate) mod hints;
#[cfg(feature = "plots")]
pub mod plots;
mod reactions;
pub(crate) mod report;
mod results;
pub(crate) mod rubbing;
mod sectors;
pub(crate) mod vtu;

pub use crate::memory::{forget_peak_memory, peak_memory_mib};
pub use energy::EnergyReport;
#[cfg(feature = "case")]
pub use export::{ExportError, export};
pub use fields::{ContactFields, NodeStatus, StepFields, shown_at_nodes};
pub use files::{OutputError, prepare, withdraw, write_whole};
pub use reactions::{ContactReport, SupportReport};
pub use report::{EnginePath, HistoryRow, NotHeldReport, Report, StepReport, Timings};
pub use results::{Draw, OfBodies, Results, StepResults};

/// Adds a line to a text.
fn put(text: &mut String, line: std::fmt::Arguments) {
    use std::fmt::Write as _;
    text.write_fmt(line)
        .expect("writing to a string cannot fail");
    text.push('\n');
}
