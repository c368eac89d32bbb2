//! One file per subcommand.

pub(crate) mod densify;
pub(crate) mod localize;
pub(crate) mod run;
mod strategy;
pub(crate) mod train;
