//! VPR-Bench, chapter 3 of the thesis: techniques × datasets × metrics, invariance and cost.
//!
//! What is computed is an experiment, as the files in `experiments/` are; what a technique finds on
//! a dataset comes from [`vpr_study`].
//!
//! ```
//! use bench::study::{Context, Study, run};
//! use vpr_report::{experiment::Experiment, table::Format};
//! use vpr_study::Sources;
//!
//! let study = Study::AucPr { datasets: vec!["world/street?places=3&camera.width=80".to_owned()] };
//! let experiment = Experiment::new("table-0", "AUC-PR on three places", study);
//! let cache = tempfile::tempdir()?;
//! let sources = Sources::new([], cache.path(), &());
//! let report = run(&experiment, Context { sources: &sources, timings: false, device: None, seed: 0 })?;
//! assert!(report.table.render(Format::Csv).contains("HOG"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod audit;
pub mod comparison;
pub mod rerank;
pub mod sequence;
pub mod study;
pub mod vocabulary;

/// The examples of the README, as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
pub struct Readme;
