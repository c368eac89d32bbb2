//! From numbers to pages: tables whose cells say where they come from, figures, experiment files,
//! the checks that hold a committed page against what is computed, and the shared command line.
//!
//! ```
//! use vpr_core::Provenance;
//! use vpr_report::table::{Cell, Format, Table};
//!
//! let mut table = Table::new("table-0", "Recall@1");
//! table.push(Cell::new("Corridor", "HOG", 0.477, Provenance::Measured, 111));
//! table.push(Cell::absent("Corridor", "NetVLAD", "no weights at hand"));
//! let text = table.render(Format::Csv);
//! assert!(text.contains("Corridor,HOG,0.477") && text.contains("no weights at hand"));
//! ```

#[cfg(test)]
mod browser;
#[cfg(feature = "cli")]
pub mod cli;
pub mod experiment;
pub mod figure;
pub mod index;
pub mod page;
pub mod report;
pub mod table;

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
