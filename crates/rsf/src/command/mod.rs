//! One file per subcommand.

pub(crate) mod augment;
pub(crate) mod finetune;
pub(crate) mod gap;
mod map;
pub(crate) mod run;
