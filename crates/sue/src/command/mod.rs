//! One file per subcommand.

pub(crate) mod calibrate;
pub(crate) mod estimate;
pub(crate) mod evaluate;
mod input;
pub(crate) mod run;
mod scores;
pub(crate) mod train;
mod truth;
