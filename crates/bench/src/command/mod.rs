//! The subcommands: each parses, calls the library and prints.

pub(crate) mod audit;
#[cfg(feature = "networks")]
mod by_network;
pub(crate) mod compare;
mod compared;
#[cfg(feature = "networks")]
pub(crate) mod encode;
#[cfg(feature = "networks")]
mod encoder;
pub(crate) mod evaluate;
mod input;
mod input_args;
pub(crate) mod list;
mod log_folder;
pub(crate) mod map;
pub(crate) mod match_images;
#[cfg(feature = "networks")]
pub(crate) mod methods;
mod named;
pub(crate) mod predictions;
mod report;
mod result;
mod retrieved;
pub(crate) mod run;
mod second_stage;
mod several;
pub(crate) mod train;
pub(crate) mod validate;
