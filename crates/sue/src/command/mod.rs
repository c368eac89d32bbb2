//! One file per subcommand.

pub(crate) mod calibrate;
pub(crate) mod estimate;
pub(crate) mod evaluate;
mod input;
mod normalization;
mod pictures;
mod report;
pub(crate) mod run;
mod scores;
mod side;
mod threshold;
pub(crate) mod train;
mod truth;
