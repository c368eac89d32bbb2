//! One file per subcommand.

mod adaptation;
pub(crate) mod augment;
pub(crate) mod finetune;
pub(crate) mod gap;
mod map;
mod report;
pub(crate) mod run;
pub(crate) mod train;
